"""The steps of a history: the runs at which a row, a scene or an engine's time changed, and what changed with them."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace

from fourbar_validation.compare.rows import FORMULAS, Row
from fourbar_validation.regression.change import Change, Key, Kind
from fourbar_validation.regression.changes import Differences, compare_rows
from fourbar_validation.regression.history import HistoryRun
from fourbar_validation.regression.record import About

NO_CHANGE = (Kind.SAME, Kind.ROUND_OFF, Kind.NOT_RUN)
"""A row keeps the number that it was last seen to change to, so that a drift of small steps adds up to one."""


@dataclass(frozen=True, slots=True)
class Step:
    """One run at which something changed."""

    number: int
    """Of the run, from 0."""
    run: HistoryRun
    found: Differences

    @property
    def changes(self) -> list[Change]:
        """The rows that changed."""
        return [change for change in self.found.changes if change.kind not in NO_CHANGE]

    @property
    def made_with(self) -> str:
        """What was changed with it."""
        return "; ".join(f"{what} {old} -> {new}" for what, old, new in self.found.surroundings) or "nothing recorded"

    def sentence(self) -> str:
        """Say in one line when, with what, and how many rows."""
        kinds = [kind for kind in Kind if kind not in NO_CHANGE and self.found.kinds[kind]]
        counts = [f"{self.found.kinds[kind]} {kind.value}" for kind in kinds]
        parts = [*map(str, self.found.scenes), ", ".join(counts), *map(str, self.found.other_times)]
        return f"{self.run.name}: {'; '.join(filter(None, parts))} [{self.made_with}]"


def find_steps(runs: Sequence[HistoryRun]) -> list[Step]:
    """Compare each run with the last state of every row before it; a run of a part leaves the rest as it was."""
    result: list[Step] = []
    known: dict[Key, Row] = {}
    about: About | None = None
    times: dict[tuple[str, str], float] = {}
    for number, run in enumerate(runs):
        if about is not None:
            here = compare_rows((about, known.values()), (run.about, run.rows), (times, run.times), kept=sys.maxsize)
            step = Step(number, run, here)
            if step.changes or here.scenes or here.other_times:
                result.append(step)
            for change in here.changes:
                if change.kind not in NO_CHANGE:
                    known.pop(change.key, None)
            others = {change.engine for change in here.other_times}  # what later ones are held against
            times |= {key: value for key, value in run.times.items() if others & {key[1], FORMULAS}}
        for row in run.rows:
            known.setdefault((row.scene, row.engine, row.setting, row.quantity), row)
        times = {**run.times, **times}
        about = replace(run.about, scenes={**(about.scenes if about else {}), **run.about.scenes})
    return result
