"""The first screen of a report.

A few lines say what agrees, how closely, and which engine is at fault if not.
"""

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, field
from operator import itemgetter

from fourbar.errors import abbreviate, write_count
from fourbar.quantities import LINE, PIN_FORCES, UNITS
from fourbar_validation.compare.compare import NO_POSITION, NO_VALUE, NOWHERE
from fourbar_validation.compare.rows import (
    FORMULAS,
    HOLDING_VERDICTS,
    QUOTED,
    REFUSES,
    UNDECIDED,
    Row,
    write_one_line,
)
from fourbar_validation.compare.tolerance import find_used
from fourbar_validation.report.scene_record import Record
from fourbar_validation.report.words import NUMBERS_IN_A_REASON, AlikeTexts

TORQUE_GROUP = "torque"
PIN_FORCE_GROUP = "pin forces"
MOTION_GROUP = "motion"
OVERVIEW_GROUPS = (TORQUE_GROUP, PIN_FORCE_GROUP, MOTION_GROUP)
"""Columns of the table."""
DRIVES = ("torque", LINE.value)
"""Names of what drives: a couple, or the force of a cylinder."""
ENGINE_NAMES = {
    "free-body": "free bodies",
    "pinocchio-inverse": "Pinocchio {}",
    "pinocchio-forward": "Pinocchio {}, released",
    "mujoco-inverse": "MuJoCo {}, inverse",
    "mujoco-simulated": "MuJoCo {}, simulated",
    "mujoco-forward": "MuJoCo {}, released",
    "exudyn-constraints": "Exudyn {}",
    "opensim-constraints": "OpenSim {}",
    "drake-inverse": "Drake {}",
    "ball-arithmetic": "320-bit balls",
}
"""Names of engines as people write them, with the place of the version."""
INDEPENDENT_ERROR = 1e-4
"""Largest error that an engine may declare which counts as an independent one: at 1e-2
a pin force without an inertia may agree.
"""
_MOST_KINDS = 500
"""Causes that are told apart; further ones are one."""
_MOST_LISTED = len(PIN_FORCES) + 1
"""Quantities that are listed where several are wrong."""
_LONGEST_QUOTE = 60
"""Characters that are printed of what an engine said."""
OTHER_CAUSES = "other causes"
_TOLD_BY = {"all": "no answer: ", "watch": "alarm: "}
"""Quantities whose reason is the cause, and how it begins."""
ERROR_OF_MISSING_DIGITS = 1e-5
"""Largest error, relative to a quantity's scale, of an engine that lacks digits and not
an equation.
"""
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
_FREE_MOTION = ("theta_2", "omega_2", "energy")
"""Quantities that are compared of a released linkage's motion."""
_DOES_NOT_APPLY = "where a check does not apply"


@dataclass(slots=True)
class _OverviewCell:
    """Worst row of an engine in one group of quantities."""

    row: Row | None = None
    used: float = -1.0
    """error/allowed of that row."""
    scenes: int = 0
    """Number of scenes, where its rows have a cause in common."""

    def add(self, row: Row, used: float) -> None:
        """Take in a row."""
        if used > self.used:
            self.row = row
            self.used = used

    @property
    def failed(self) -> bool:
        """Return whether that row fails."""
        return self.row is not None and self.row.failed

    @property
    def parts(self) -> tuple[str, ...]:
        """Return the error, and of what it is allowed, as the parts of a cell."""
        if self.row is None:
            return ("-",)
        if math.isnan(self.row.error):
            return ("no number",)
        error = f"{self.row.error:.1e}"
        allowed = f"{self.row.allowed:.0e}"
        if float(error) > float(allowed):  # with as many digits they are in order
            allowed = f"{self.row.allowed:.1e}"
        return error, f"of {allowed}"

    def __str__(self) -> str:
        return " ".join(self.parts)


@dataclass(slots=True)
class OverviewLine:
    """Answers of an engine, in the columns of the table."""

    engine: str
    name: str
    columns: dict[str, _OverviewCell] = field(
        default_factory=lambda: {group: _OverviewCell() for group in OVERVIEW_GROUPS}
    )
    compared: int = 0
    failed: int = 0
    answered: bool = False
    """True if any number of it was compared. The reason why none was stands beneath the
    table.
    """
    reasons: AlikeTexts = field(default_factory=AlikeTexts)
    """Why it was not compared, by scene."""


@dataclass(slots=True)
class Cause:
    """Mistake of an engine, by a known name or in words."""

    engine: str
    text: str
    scenes: int
    worst: Row

    @property
    def place(self) -> str:
        """Return the scene and the position where it is worst."""
        if math.isnan(self.worst.theta_2):
            return self.worst.scene
        return f"{self.worst.scene} {math.degrees(self.worst.theta_2):.4g} deg"

    def __str__(self) -> str:
        count = write_count(self.scenes, "scene")
        return f"{self.engine}: {self.text}: {count}; worst {self.place}"


def _name_whole(row: Row) -> str:
    """Name the quantity of a row, or that of which it is the inertial part."""
    return row.quantity.removesuffix("_inertia")


def _find_group(row: Row) -> str | None:
    """Find the column of an engine's row; None for what is no error of a quantity."""
    name = row.quantity
    if _name_whole(row) in DRIVES:
        return TORQUE_GROUP
    if name in PIN_FORCES:
        return PIN_FORCE_GROUP
    if name in UNITS or name in ("energy", "frequency", "closure"):
        return MOTION_GROUP
    return None


class Overview:
    """The first screen, condensed scene by scene."""

    def __init__(self) -> None:
        self.statements = self.statements_failed = 0
        """Comparisons that no engine takes part in."""
        self.scenes = self.with_forces = self.checked_twice = 0
        self.released = False
        self.not_compared: Counter[str] = Counter()
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
        self.declared: dict[str, float] = {}
        """Error that each engine declares, relative to the scale."""
        self.asked: list[str] = []
        """Engines that were asked for by name: a run checks each of them."""
        self.listed: dict[str, dict[str, None]] = {}
        """Effects and quantities that the hello of each guest lists, without those that
        were compared.
        """
        self._lines: dict[str, OverviewLine] = {}
        self._kinds: dict[tuple[str, tuple[str, ...]], _OverviewCell] = {}

    def add(self, scene: Record) -> None:
        """Add one more scene."""
        self.scenes += 1
        refused = {row.reason for row in scene.rows if row.verdict == REFUSES}
        for line in scene.left_out:
            if line.partition(": ")[2] not in refused:
                self.not_compared[_DOES_NOT_APPLY] += 1
        for row in scene.rows:
            self._add_row(row)
            listed = self.listed.get(row.engine, {})
            if row.compared and row.quantity == _name_whole(row):
                for name in (row.quantity, *scene.needs):
                    listed.pop(name, None)
        self._add_agreement(scene.rows)
        self._add_causes(scene)
        named = {*ENGINE_NAMES, *self.declared}
        for engine, reason in _list_reasons(scene, named):
            self._line(engine).reasons.add(reason)

    def _line(self, engine: str) -> OverviewLine:
        return self._lines.setdefault(engine, OverviewLine(engine, engine))

    def _add_row(self, row: Row) -> None:
        if usual := _NOT_COMPARED.get(row.verdict):
            kinds = (kind for why, kind in _BY_REASON.items() if why in row.reason)
            self.not_compared[next(kinds, usual)] += 1
        if row.engine == FORMULAS:
            self.statements += row.compared
            self.statements_failed += row.failed
            return
        line = self._line(row.engine)
        line.compared += row.compared
        line.failed += row.failed
        line.answered |= row.compared and row.quantity != "all"
        group = _find_group(row)
        if row.compared and group is not None:
            line.columns[group].add(row, float(find_used(row.error, row.allowed)))

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

    def _add_causes(self, scene: Record) -> None:
        failing: dict[str, list[Row]] = {}
        ours = _list_ours(scene)
        for row in scene.rows:
            if row.failed:
                engine = FORMULAS if _name_whole(row) in ours else row.engine
                failing.setdefault(engine, []).append(row)
        for engine, rows in failing.items():
            # without an answer the rest is a consequence
            telling = _find_telling(scene, engine, rows)
            named = [row for row in rows if _name_whole(row) in scene.against]
            shown = telling or (engine == FORMULAS and named) or rows
            key = (engine, tuple(_name_causes(scene, engine, rows)))
            if key not in self._kinds and len(self._kinds) >= _MOST_KINDS:
                key = (engine, (OTHER_CAUSES,))
            kind = self._kinds.setdefault(key, _OverviewCell())
            kind.scenes += 1
            for row in shown:
                kind.add(row, float(find_used(row.error, row.allowed)))

    @property
    def causes(self) -> list[Cause]:
        """Return what is wrong, engine by engine.

        The mistake that explains most comes first.
        """
        causes: list[Cause] = []
        for engine in dict.fromkeys(engine for engine, _ in self._kinds):
            left = {
                texts: kind for (of, texts), kind in self._kinds.items() if of == engine
            }
            of_engine = []
            while left:
                counts: Counter[str] = Counter()
                for texts, kind in left.items():
                    counts.update(dict.fromkeys(texts, kind.scenes))
                text, scenes = counts.most_common(1)[0]
                explained = [left.pop(texts) for texts in [*left] if text in texts]
                worst = max(explained, key=lambda kind: kind.used).row
                assert worst is not None
                begin = _TOLD_BY.get(worst.quantity)
                if begin is not None and text.startswith(begin):
                    text = begin + "".join(_take_reason(worst))
                of_engine.append(Cause(engine, text, scenes, worst))
            causes += sorted(of_engine, key=lambda cause: -cause.scenes)
        return causes

    @property
    def named_failure(self) -> Row | None:
        """Return the failing row that the verdict names; None if nothing fails."""
        return next((cause.worst for cause in self.causes), None)

    def name_lines(self, versions: Mapping[str, str]) -> list[OverviewLine]:
        """Return the engines that were compared, with their names and versions."""
        order = list(ENGINE_NAMES)
        lines = []
        for line in self._lines.values():
            version = versions.get(line.engine, "")
            name = f"{line.engine} {version}"
            if line.engine in order:
                name = ENGINE_NAMES[line.engine].format(version).replace(" ,", ",")
            line.name = name.strip()
            if line.answered or line.failed or line.reasons:
                place = [*order, line.engine].index(line.engine)
                lines.append((place, line.name, line))
        return [line for *_, line in sorted(lines, key=itemgetter(0, 1))]

    @property
    def silent(self) -> dict[str, str]:
        """Return a line for each engine with nothing to compare, with the reason.

        Of several reasons the commonest is stated.
        """
        lines = {}
        for line in sorted(self._lines.values(), key=lambda one: one.engine):
            if not line.compared and not line.failed and line.reasons:
                reason, count = line.reasons.find_commonest()
                scenes = write_count(count, "scene")
                told = f"{line.engine}: nothing compared ({scenes}): {reason}"
                lines[line.engine] = told
        return lines

    @property
    def unchecked(self) -> list[str]:
        """Return the lines of the engines that were asked for in vain."""
        return [line for name, line in self.silent.items() if name in self.asked]

    @property
    def notes(self) -> list[str]:
        """Return what is said beneath the table."""
        notes = []
        if self.statements or self.statements_failed:
            failed = self.statements_failed
            held = f"{failed} FAIL" if failed else "all hold"
            many = write_count(self.statements, "identity")
            notes.append(
                f"also checked, without an engine: {many} of the formulas; {held}"
            )
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
            if listed and self._line(engine).answered
        ]
        notes += self.silent.values()
        if self.not_compared:
            total = sum(self.not_compared.values())
            kinds = ", ".join(
                f"{count} {kind}" for kind, count in self.not_compared.most_common()
            )
            notes.append(f"{total} not compared: {kinds}")
        return notes


def _list_reasons(scene: Record, named: Set[str]) -> Iterable[tuple[str, str]]:
    """List the engines that a scene was not compared with, each with the reason."""
    for row in scene.rows:
        whole = row.verdict == REFUSES and row.quantity == "all"
        if whole and row.engine != FORMULAS:
            yield row.engine, row.reason
    refused = {row.engine for row in scene.rows}
    for line in scene.left_out:
        engine, _, reason = line.partition(": ")
        if engine in named and engine not in refused:
            yield engine, reason


def _list_ours(scene: Record) -> set[str]:
    """List the quantities in which fourbar itself is wrong.

    Engines agree with each other against it, or one that alone answers the quantity is
    among these. By itself it is believed where equations of fourbar do not hold, unless
    its torque or pin forces differ by a known mistake. A free motion follows from the
    forces.
    """
    witnesses = {name for names in scene.against.values() for name in names}
    rows = [row for row in scene.rows if row.engine != FORMULAS]
    ours = {row.quantity for row in scene.rows if row.engine == FORMULAS and row.failed}
    if ours - {"status"}:  # which is that of the free bodies
        forces = [row for row in rows if _find_group(row) in OVERVIEW_GROUPS[:2]]
        failing = {row.engine for row in forces if not row.passed}
        explained = {engine for engine, causes in scene.causes.items() if causes}
        witnesses |= {row.engine for row in rows} - (failing & explained)
    answered = Counter(row.quantity for row in rows if row.compared)
    return {*scene.against, *(_FREE_MOTION if scene.against else ())} | {
        _name_whole(row)
        for row in rows
        if row.failed and _name_whole(row) in UNITS and answered[row.quantity] == 1
        if row.engine in witnesses
    }


def _find_telling(scene: Record, engine: str, rows: Sequence[Row]) -> list[Row]:
    """Find the rows whose reason is the cause: without an answer, or of an alarm.

    A known mistake tells more than an alarm.
    """
    told_by = [*_TOLD_BY][: 1 if scene.causes.get(engine) else 2]
    found = ([row for row in rows if row.quantity == name] for name in told_by)
    return next(filter(None, found), [])


def _take_reason(row: Row) -> tuple[str, str]:
    """Return why an engine has no answer, and the beginning of what it said.

    What it printed is left out.
    """
    reason = write_one_line(row.reason.partition("; what it printed")[0])
    why, quoted, said = reason.partition(QUOTED)
    return why, f"{quoted}{abbreviate(said, _LONGEST_QUOTE)}"


def _name_causes(
    scene: Record,
    engine: str,
    rows: Sequence[Row],
) -> list[str]:
    """Name the mistakes that explain the failing rows of an engine in a scene.

    Without such a mistake the text says what fails.
    """
    if telling := _find_telling(scene, engine, rows):
        why, _ = _take_reason(telling[0])
        begin = _TOLD_BY[telling[0].quantity]
        return [f"{begin}{NUMBERS_IN_A_REASON.sub('#', why)}"]
    if known := scene.causes.get(engine):
        return known
    if engine == FORMULAS and scene.against:
        engines = sorted({name for names in scene.against.values() for name in names})
        return [
            f"{', '.join(engines)} agree with each other, and differ from it in"
            f" {_list_first([*scene.against])}"
        ]
    if engine == FORMULAS:
        names = sorted({row.quantity for row in rows if row.engine == FORMULAS})
        return [f"{_list_first(names)} {'does' if len(names) == 1 else 'do'} not hold"]
    groups = set(map(_name_group, rows))
    missing = sorted({row.quantity for row in rows if math.isnan(row.error)})
    if missing and len(missing) == len({row.quantity for row in rows}):
        if "assembled" in missing:
            return [NOWHERE]
        return [f"no number for {_list_first(missing)}"]
    differ = [group for group in OVERVIEW_GROUPS if group in groups]
    differ += sorted(groups - set(OVERVIEW_GROUPS))
    of_engine = [row for row in scene.rows if row.engine == engine]
    agreeing = {_name_group(row) for row in of_engine if row.passed}
    agreeing -= {_name_group(row) for row in of_engine if row.failed}
    agree = [group for group in OVERVIEW_GROUPS if group in agreeing]
    words = _join_groups(differ[:3], "differ")
    if agree:
        words += f", {_join_groups(agree, 'agree')}"
    worst = max(row.error for row in rows)
    if worst < ERROR_OF_MISSING_DIGITS:
        digits = math.floor(-math.log10(worst))
        return [f"{words}: the first {digits} digits agree"]
    if engine not in scene.causes:
        return [f"{words}; mistakes are not looked for there"]
    return [f"{words}; no known mistake explains it"]


def _list_first(names: Sequence[str]) -> str:
    """List the first of some names, with dots for the others."""
    return ", ".join(names[:_MOST_LISTED]) + ", ..." * (len(names) > _MOST_LISTED)


def _name_group(row: Row) -> str:
    """Name what an engine's row is about, where it is said what differs."""
    if _name_whole(row) != row.quantity:
        return f"inertial part of the {_find_group(row)}"
    if row.quantity == "closure":  # an identity of the engine's own angles
        return row.quantity
    if row.quantity == "assembled":
        return "positions at which the loop closes"
    return _find_group(row) or row.quantity


def _join_groups(groups: Sequence[str], verb: str) -> str:
    """Write groups of quantities with their verb."""
    plural = len(groups) > 1 or groups[0].endswith("s")
    listed = " and ".join([", ".join(groups[:-1]), groups[-1]][len(groups) < 2 :])
    return f"{listed} {verb if plural else verb + 's'}"
