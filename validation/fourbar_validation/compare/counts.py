"""Count the comparisons by verdict, and write the one sentence that every form of a result states."""

from collections import Counter
from collections.abc import Iterable

from fourbar.errors import FAILED, HOLDS
from fourbar_validation.compare.rows import (
    AGREES,
    COMPARED,
    DEGRADED,
    FAILS,
    FORMULAS,
    IDENTITIES,
    REFUSES,
    UNDECIDED,
    VERDICTS,
    Row,
)

WORDING = {
    AGREES: ("agrees", "agree"),
    DEGRADED: ("degraded as predicted", "degraded as predicted"),
    FAILS: ("fails", "fail"),
    REFUSES: ("refuses", "refuse"),
    UNDECIDED: ("undecided", "undecided"),
}
"""Words for each verdict: of one comparison, and of several."""


class Counts:
    """Rows by verdict. What no engine answered is not compared, even where the formulas' own identities hold."""

    def __init__(self, rows: Iterable[Row] = ()) -> None:
        self._of = Counter(dict.fromkeys(VERDICTS, 0))
        self.scenes = self.scenes_compared = self._answered = 0
        self.add(rows)

    def __getitem__(self, verdict: str) -> int:
        return self._of[verdict]

    def add(self, rows: Iterable[Row]) -> None:
        """Take in rows."""
        for row in rows:
            self._of[row.verdict] += 1
            self._answered += row.compared and not (row.engine == FORMULAS and row.quantity in IDENTITIES)

    def add_scene(self, rows: Iterable[Row]) -> None:
        """Take in all rows of one scene."""
        before = self._answered
        self.add(rows)
        self.scenes += 1
        self.scenes_compared += self._answered > before

    @property
    def total(self) -> int:
        """Return the number of all rows."""
        return self._of.total()

    @property
    def compared(self) -> int:
        """Comparisons that were made."""
        return sum(self[verdict] for verdict in COMPARED)

    @property
    def nothing(self) -> bool:
        """Return whether nothing was compared and no answer that was due is missing."""
        return not self._answered and not self[FAILS]

    @property
    def status(self) -> int:
        """Exit status: nothing compared is no success."""
        return FAILED if self[FAILS] or self.nothing else HOLDS

    @property
    def word(self) -> str:
        """Return the verdict for a cell of a table."""
        return f"{self[FAILS]} fail" if self[FAILS] else "nothing compared" if self.nothing else "holds"

    def sentence(self) -> str:
        """Give the verdict in one sentence: "all hold" is stated only of what was compared."""
        total, failed = self.compared, self[FAILS]
        if failed:
            verdict = f"FAILS: {failed} of {total} comparisons{self._write_where()} do not hold"
        elif self.nothing:
            verdict = f"Nothing was compared{self._write_where()}"
        else:
            verdict = f"All {total} comparisons{self._write_where()} hold"
        if self.nothing:
            held = [f"{total} of the formulas' own identities hold"] if total else []
        else:
            held = self._write_worded(COMPARED)
        apart = self._write_worded((UNDECIDED, REFUSES))
        if apart and not self.nothing:
            apart[0] = "not compared: " + apart[0]
        parts = "; ".join(", ".join(each) for each in (held, apart) if each)
        return f"{verdict}: {parts}" if parts else verdict

    def _write_where(self) -> str:
        if not self.scenes:
            return ""
        of = "" if self.nothing or self.scenes_compared == self.scenes else f"{self.scenes_compared} of "
        return f" on {of}{self.scenes} scene{'s' if self.scenes != 1 else ''}"

    def _write_worded(self, verdicts: Iterable[str]) -> list[str]:
        return [f"{self[each]} {WORDING[each][self[each] != 1]}" for each in verdicts if self[each]]
