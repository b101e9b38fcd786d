"""Compute once, from the scenes, what every form of the report says."""

import math
from collections import Counter
from collections.abc import Sequence
from heapq import nlargest
from operator import attrgetter, itemgetter
from typing import Any

from fourbar.errors import HOLDS, write_count
from fourbar.quantities import PIN_FORCES
from fourbar_validation.compare.compare import NO_POSITION, NO_VALUE
from fourbar_validation.compare.rows import (
    COMPARED_VERDICTS,
    DEGRADED,
    FAILS,
    FORMULAS,
    HOLDING_VERDICTS,
    REFUSES,
    UNDECIDED,
    Counts,
    Row,
    sort_rows,
)
from fourbar_validation.compare.tolerance import (
    EPS,
    EQUIVALENCE,
    IDENTITY,
    MOST_ALLOWED,
    K,
)
from fourbar_validation.engines.guests import Guest
from fourbar_validation.engines.registry import Engine
from fourbar_validation.report.machine import list_versions, name_machine
from fourbar_validation.report.overview import (
    DRIVES,
    ENGINE_NAMES,
    INDEPENDENT_ERROR,
    USED,
    Cause,
    Causes,
    EngineLine,
    name_whole,
)
from fourbar_validation.report.scene_record import Record
from fourbar_validation.report.words import AlikeTexts

SCENES_SHOWN = 200
SKETCHED = 8
"""Scenes whose linkages are shown small."""
PICTURED = 24
"""Scenes with pictures, if fewer fail. Drawing one takes ten times as long as judging
it by an exact engine.
"""
_WORST_SHOWN = 80
_FAILURES_KEPT = 1000
"""Lines of a table at the most; everything is in results.csv."""
_TIMED = 1000
STATEMENT = (
    "Errors are relative to the largest magnitude over the positions whose condition is"
    " at least 0.1, below that to the position's own; angles modulo 2 pi, in rad."
    f" Allowed is the tolerance times max(1, N/K), K = {K:g}, N the largest sum of"
    " absolute terms over the largest magnitude. Size and N are those of the formulas"
    " or of the answer, whichever pair of error and allowed error is stricter. Where"
    f" condition and N raise it above {MOST_ALLOWED:g} and above what the engine"
    " declares, the position is undecided."
)


_NOT_COMPARED = {
    REFUSES: "at declared limits of an engine",
    UNDECIDED: "with no digit left to decide by",
}
"""Kinds of what was not compared, by verdict."""
_BY_REASON = {
    NO_VALUE: "where the formulas state no value",
    NO_POSITION: "at no position that can be judged",
}
"""Those that the reason tells."""


class Summary:
    """The report in data: a run condensed scene by scene.

    What is kept does not grow with their number.

    `engines`: those that are asked. `missing`: (engine, why it could not run here).
    `chosen`: whether all of them were asked for by name.
    """

    def __init__(
        self,
        engines: Sequence[Engine] = (),
        missing: Sequence[tuple[str, str]] = (),
        chosen: bool = False,
    ) -> None:
        guests = [engine for engine in engines if isinstance(engine, Guest)]
        self.missing = missing
        self.tolerances = dict.fromkeys(
            (IDENTITY, *(engine.tolerance for engine in engines))
        )
        self.declared = {engine.name: engine.tolerance.factor for engine in engines}
        """Error that each engine declares, relative to the scale."""
        self.asked = [engine.name for engine in (engines if chosen else guests)]
        """Engines that were asked for by name: a run checks each of them."""
        self.listed = {
            guest.name: dict.fromkeys((*guest.effects, *guest.answers))
            for guest in guests
        }
        """Effects and quantities that the hello of each guest lists, without those that
        were compared.
        """
        self.counts = Counts()
        self.date = ""
        """Date on which it was made."""
        self.commit = ""
        """Commit of the harness at which it was made."""
        self.scene = ""
        """Name of the scene that was asked for; empty if there are several."""
        self.versions = list_versions()
        self._versions = {name.lower(): text for name, text in self.versions.items()}
        self._versions |= {guest.name: guest.version for guest in guests}
        self.machine = name_machine()
        self.since = ""
        """State of the named failure in the run that this one is held against."""
        self.weaker: list[str] = []
        """Rules that are weaker than in that run."""
        self.gone: list[str] = []
        """Engines, scenes and rows that it had and this run lacks."""
        self.worse: list[str] = []
        """Rows that got worse, of a run without a failure."""
        self.baseline = ""
        """That run in words."""
        self.failures: list[Row] = []
        """Failures, at most _FAILURES_KEPT of them."""
        self.pairs = self.loose = 0
        """Quantities of a scene that were compared; those that no row judges tighter
        than degraded.
        """
        self.judged = 0
        """Pairs of scene and engine of which `worst` shows the worst."""
        self.measured_k: dict[str, float] = {}
        """Largest error*condition/eps of each exact engine: the K that would have
        sufficed.
        """
        self.independence: dict[str, Sequence[str]] = {}
        """engine: (shared with the formulas, found alone)."""
        self.with_forces = self.checked_twice = 0
        self.released = False
        self.not_compared: Counter[str] = Counter()
        self._causes = Causes()
        self._lines: dict[str, EngineLine] = {}
        self._left_out: dict[str, AlikeTexts] = {}
        self._worst: list[Row] = []
        self._nearest: list[tuple[float, Record]] = []
        """The scenes nearest to failing, each with the most that a row used."""

    def add(self, scene: Record) -> None:
        """Add one more scene."""
        rows = scene.rows
        self.counts.add_scene(rows)
        self._causes.add(scene)
        bad = [row for row in rows if row.failed]
        self.failures += bad[: _FAILURES_KEPT - len(self.failures)]
        refused = {(row.engine, row.reason) for row in rows if row.verdict == REFUSES}
        reasons = {reason for _, reason in refused}
        for line in scene.left_out:
            engine, _, reason = line.partition(": ")
            inapplicable = "where a check does not apply"
            self.not_compared[inapplicable] += reason not in reasons
            refused.add((engine, reason))
        for engine, reason in sorted(refused):
            self._left_out.setdefault(engine, AlikeTexts()).add(reason)
        worst: dict[tuple[str, str], Row] = {}
        loose: dict[str, bool] = {}
        for row in rows:
            self._add_row(row, scene.needs)
            if row.compared:
                key = row.engine, row.setting
                worst[key] = max(worst.get(key, row), row, key=USED)
                degraded = row.verdict == DEGRADED
                loose[row.quantity] = loose.get(row.quantity, True) and degraded
        self.pairs += len(loose)
        self.loose += sum(loose.values())
        self.judged += len(worst)
        self._worst = nlargest(_WORST_SHOWN, [*self._worst, *worst.values()], key=USED)
        self.independence.update(scene.independence)
        self._add_agreement(rows)
        self._add_times(scene)
        # a row that fails has used more than all that it is allowed
        used = max((row.used for row in worst.values()), default=0.0)
        scenes = [*self._nearest, (used, scene)]
        self._nearest = nlargest(SCENES_SHOWN, scenes, key=itemgetter(0))

    def _line(self, engine: str) -> EngineLine:
        return self._lines.setdefault(engine, EngineLine(engine))

    def _add_row(self, row: Row, needs: Sequence[str]) -> None:
        self._line(row.engine).add(row)
        if usual := _NOT_COMPARED.get(row.verdict):
            kinds = (kind for why, kind in _BY_REASON.items() if why in row.reason)
            self.not_compared[next(kinds, usual)] += 1
        if row.reason.startswith(EQUIVALENCE.cause) and math.isfinite(row.error):
            k = row.error * row.condition / EPS
            self.measured_k[row.engine] = max(self.measured_k.get(row.engine, 0.0), k)
        if row.compared:
            whole = name_whole(row)
            for name in (whole, *(needs if row.quantity == whole else ())):
                self.listed.get(row.engine, {}).pop(name, None)

    def _add_agreement(self, rows: Sequence[Row]) -> None:
        """Count a scene of which two engines confirm the torque and all pin forces.

        An engine that declares more than INDEPENDENT_ERROR confirms nothing.
        """
        asked: dict[str, dict[str, bool]] = {}
        for row in rows:
            name = "torque" if row.quantity in DRIVES else row.quantity
            if row.engine != FORMULAS and name in ("torque", *PIN_FORCES):
                asked.setdefault(row.engine, {})[name] = row.verdict in HOLDING_VERDICTS
        agreeing = [
            len(of) > len(PIN_FORCES) and all(of.values())
            for engine, of in asked.items()
            if self.declared.get(engine, 0.0) <= INDEPENDENT_ERROR
        ]
        self.with_forces += bool(asked)
        self.checked_twice += sum(agreeing) >= 2
        self.released |= any(row.quantity == "energy" for row in rows)

    def picture(self, drawn: Record) -> None:
        """Add what was drawn of a scene that is shown."""
        for scene in self._shown:
            if scene.name == drawn.name:
                scene.figure = drawn.figure
                scene.drawn = drawn.drawn

    def _add_times(self, scene: Record) -> None:
        refused = {row.engine for row in scene.rows if row.verdict == REFUSES}
        for timing in scene.timings:
            times = self._line(timing.engine).times
            if timing.engine not in refused and len(times) < _TIMED:
                microseconds = 1e6 * timing.seconds / timing.positions
                times.append((microseconds, timing.seconds / scene.timings[0].seconds))

    @property
    def not_run(self) -> str:
        """Return the end of the verdict that names the engines that are missing."""
        names = ", ".join(engine for engine, _ in self.missing)
        return f"; not run: {names}" * bool(names)

    @property
    def verdict(self) -> str:
        """Return the verdict of the run as one sentence."""
        return self.counts.sentence() + self.not_run

    @property
    def headline(self) -> str:
        """Say the verdict in plain words: where it is not green, whose fault it is."""
        words = self._say_first_cause()
        against = f", against {self.baseline}"
        for heading, lost, end in (
            ("NOT CHECKED", self.unchecked, ""),
            ("WORSE", self.worse, against),
            ("WEAKER RULE", self.weaker, against),
            ("GONE", self.gone, against),
        ):
            if lost:
                more = f", and {len(lost) - 1} more" * (len(lost) > 1)
                words = f"{heading}: {lost[0]}{more}{end}. {words}"
        return words

    def _say_first_cause(self) -> str:
        causes = self.causes
        if not causes:
            return self.counts.headline + self.not_run
        first = causes[0]
        more = len(causes) - 1
        others = f", and {write_count(more, 'more cause')}" * bool(more)
        named = "fourbar itself" if first.engine == FORMULAS else first.engine
        scenes = write_count(first.scenes, "scene")
        worst = f"worst {first.worst.quantity} of "
        worst *= not math.isnan(first.worst.error)
        since = f" {self.since}".rstrip()
        what = f"{named} is wrong: {first.text}, in {scenes}; {worst}"
        return f"FAILS: {what}{first.place}{others}.{since}"

    @property
    def causes(self) -> list[Cause]:
        """Return what is wrong, engine by engine; what explains most comes first."""
        return self._causes.list_all()

    @property
    def engines(self) -> list[EngineLine]:
        """Return the lines of all engines in the order of the table, the formulas last.

        An engine that had nothing to compare has a line if a reason is known.
        """
        for engine in {*ENGINE_NAMES, *self.declared} & self._left_out.keys():
            self._line(engine)
        for line in self._lines.values():
            ours = self._versions.get(line.engine.partition("-")[0], "")
            version = self._versions.get(line.engine, ours)
            line.version = "" if line.engine.endswith(f" {version}") else version
            name = ENGINE_NAMES.get(line.engine, f"{line.engine} {{}}")
            line.name = name.format(line.version).replace(" ,", ",").strip()

        def place(line: EngineLine) -> tuple[Any, ...]:
            name = line.engine
            return name == FORMULAS, [*ENGINE_NAMES, name].index(name), name

        return sorted(self._lines.values(), key=place)

    @property
    def independent(self) -> list[EngineLine]:
        """Return the lines of the engines other than the formulas."""
        return [line for line in self.engines if line.engine != FORMULAS]

    @property
    def silent(self) -> dict[str, str]:
        """Return by its name why an engine compared nothing, in a sentence.

        Of several reasons the commonest is stated.
        """
        lines = {}
        for line in self.engines:
            left_out = self._left_out.get(line.engine)
            if left_out and not line.counts.compared:
                reason, count = left_out.list_all()[0]
                scenes = write_count(count, "scene")
                told = f"{line.engine}: nothing compared ({scenes}): {reason}"
                lines[line.engine] = told
        return lines

    @property
    def unchecked(self) -> list[str]:
        """Return the lines of engines that were asked for in vain, beside others."""
        asked = () if self.counts.nothing else self.asked
        return [line for name, line in self.silent.items() if name in asked]

    @property
    def notes(self) -> list[str]:
        """Return what is said beneath the table."""
        notes = []
        identities = self._line(FORMULAS).counts
        many = sum(identities[verdict] for verdict in COMPARED_VERDICTS)
        if many:
            failed = identities[FAILS]
            held = f"{failed} FAIL" if failed else "all hold"
            told = f"{write_count(many, 'identity')} of the formulas; {held}"
            notes.append(f"also checked, without an engine: {told}")
        if self.with_forces:
            notes.append(
                f"Torque and pin forces of {self.checked_twice} of {self.with_forces}"
                " scenes: at least two independent engines compared all of them and"
                " agree."
            )
        if self.released:
            notes.append("released: angles, energy and speeds alone (no torque acts)")
        notes += [
            f"{engine} lists {', '.join(listed)}: compared in no scene"
            for engine, listed in self.listed.items()
            if listed and any(self._line(engine).worst)
        ]
        notes += self.silent.values()
        if self.not_compared.total():
            kinds = ", ".join(
                f"{count} {kind}"
                for kind, count in self.not_compared.most_common()
                if count
            )
            notes.append(f"{self.not_compared.total()} not compared: {kinds}")
        return notes

    @property
    def loosest(self) -> str:
        """Say how many quantities no engine judges tighter than degraded."""
        of = f"{self.loose} of {self.pairs} quantities of a scene are at best"
        return f'{of} "{DEGRADED}"' * bool(self.loose)

    @property
    def good(self) -> bool:
        """Return whether everything that was to be compared holds.

        All was compared, by no weaker rule, and nothing is gone or got worse.
        """
        if self.unchecked or self.weaker or self.gone or self.worse:
            return False
        return self.counts.status == HOLDS and not self.missing

    @property
    def worst(self) -> list[Row]:
        """Return the worst rows by scene and engine.

        More than _WORST_SHOWN are reduced to those that used most, in that order.
        """
        return self._worst if self.judged > _WORST_SHOWN else sort_rows(self._worst)

    @property
    def refusals(self) -> list[tuple[str, str, int]]:
        """Return (engine, reason, number of scenes) of declared limits that were met.

        Reasons that differ by their numbers alone are one.
        """
        return [
            (engine, *told)
            for engine, texts in sorted(self._left_out.items())
            for told in texts.list_all()
        ]

    @property
    def _shown(self) -> list[Record]:
        return [scene for _, scene in self._nearest]

    @property
    def shown(self) -> list[Record]:
        """Return the scenes shown, by name, at most SCENES_SHOWN.

        Scenes that fail come with those that used most of what is allowed.
        """
        return sorted(self._shown, key=attrgetter("name"))

    @property
    def pictured(self) -> list[Record]:
        """Return the scenes that have pictures.

        All that fail have one, then those that used most of their allowed error.
        """
        failing = sum(used > 1.0 for used, _ in self._nearest)
        return self._shown[: max(PICTURED, failing)]

    @property
    def sketched(self) -> list[Record]:
        """Return the scenes whose linkages are shown small.

        Scenes that fail come first, then those nearest to it.
        """
        return [scene for scene in self._shown if scene.figure][:SKETCHED]

    @property
    def first(self) -> Record | None:
        """Return the scene of the large figure, that which is nearest to failing."""
        return next((scene for scene in self._shown if scene.figure), None)
