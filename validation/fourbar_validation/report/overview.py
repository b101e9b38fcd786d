"""The first screen of a report.

A few lines say what agrees, how closely, and which engine is at fault if not.
"""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from statistics import median

from fourbar.errors import abbreviate, write_count
from fourbar.quantities import LINE, PIN_FORCES, UNITS
from fourbar_validation.compare.compare import NOWHERE
from fourbar_validation.compare.rows import (
    FORMULAS,
    QUOTED,
    Counts,
    Row,
    write_one_line,
)
from fourbar_validation.report.scene_record import Record
from fourbar_validation.report.words import NUMBERS_IN_A_REASON

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
USED = attrgetter("used")
_MOST_KINDS = 500
"""Causes that are told apart; further ones are one."""
_MOST_LISTED = len(PIN_FORCES) + 1
"""Quantities that are listed where several are wrong."""
_LONGEST_QUOTE = 60
"""Characters that are printed of what an engine said."""
_TOLD_BY = {"all": "no answer: ", "watch": "alarm: "}
"""Quantities whose reason is the cause, and how it begins."""
ERROR_OF_MISSING_DIGITS = 1e-5
"""Largest error, relative to a quantity's scale, of an engine that lacks digits and not
an equation.
"""


@dataclass(slots=True)
class EngineLine:
    """Answers of an engine, or the identities of the formulas: their worst, and times.

    The name is the engine's as people write it.
    """

    engine: str
    name: str = ""
    version: str = ""
    counts: Counts = field(default_factory=Counts)
    worst: dict[str, Row] = field(default_factory=dict)
    """The row that used most of its allowance, by group, and of all groups under ""."""
    undecided: float = 0.0
    """Largest share of the numbers of a scene that are undecided."""
    times: list[tuple[float, float]] = field(default_factory=list)
    """Microseconds per position, and the ratio to the formulas on the same scene in the
    same process, of each scene.
    """

    def add(self, row: Row) -> None:
        """Count a row; a share of undecided numbers is no error, unless it fails."""
        self.counts.add([row])
        if row.quantity == "undecided":
            self.undecided = max(self.undecided, row.error)
        if row.compared and (row.quantity != "undecided" or row.failed):
            for group in {"", find_group(row) or ""}:
                self.worst[group] = max(self.worst.get(group, row), row, key=USED)

    @property
    def microseconds(self) -> float:
        """Return the time per position, median over the scenes."""
        return median(time for time, _ in self.times) if self.times else math.nan

    @property
    def times_formulas(self) -> float:
        """Return the time over that of the formulas, median over the scenes."""
        return median(ratio for _, ratio in self.times) if self.times else math.nan

    def cell(self, group: str) -> tuple[str, ...]:
        """Return the worst error of a group, and of what it is allowed, for a table."""
        row = self.worst.get(group)
        if row is None:
            return ("-",)
        if math.isnan(row.error):
            return ("no number",)
        error = f"{row.error:.1e}"
        allowed = f"{row.allowed:.0e}"
        if float(error) > float(allowed):  # with as many digits they are in order
            allowed = f"{row.allowed:.1e}"
        return error, f"of {allowed}"


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


def name_whole(row: Row) -> str:
    """Name the quantity of a row, or that of which it is the inertial part."""
    return row.quantity.removesuffix("_inertia")


def find_group(row: Row) -> str | None:
    """Find the column of an engine's row; None for what is no error of a quantity."""
    name = row.quantity
    if name_whole(row) in DRIVES:
        return TORQUE_GROUP
    if name in PIN_FORCES:
        return PIN_FORCE_GROUP
    if name in UNITS or name in ("energy", "frequency", "closure"):
        return MOTION_GROUP
    return None


class Causes:
    """What is wrong, and whose fault it is, condensed scene by scene."""

    def __init__(self) -> None:
        self._kinds: dict[tuple[str, tuple[str, ...]], Cause] = {}

    def add(self, scene: Record) -> None:
        """Add one more scene."""
        failing: dict[str, list[Row]] = {}
        ours = _list_ours(scene)
        for row in scene.rows:
            if row.failed:
                engine = FORMULAS if name_whole(row) in ours else row.engine
                failing.setdefault(engine, []).append(row)
        for engine, rows in failing.items():
            # without an answer the rest is a consequence
            telling = _find_telling(scene, engine, rows)
            named = [row for row in rows if name_whole(row) in scene.against]
            shown = telling or (engine == FORMULAS and named) or rows
            key = (engine, tuple(_name_causes(scene, engine, rows)))
            if key not in self._kinds and len(self._kinds) >= _MOST_KINDS:
                key = (engine, ("other causes",))
            kind = self._kinds.setdefault(key, Cause(engine, "", 0, shown[0]))
            kind.scenes += 1
            kind.worst = max(kind.worst, *shown, key=USED)

    def list_all(self) -> list[Cause]:
        """List the causes engine by engine; that which explains most comes first."""
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
                worst = max((kind.worst for kind in explained), key=USED)
                begin = _TOLD_BY.get(worst.quantity)
                if begin is not None and text.startswith(begin):
                    text = begin + "".join(_take_reason(worst))
                of_engine.append(Cause(engine, text, scenes, worst))
            causes += sorted(of_engine, key=lambda cause: -cause.scenes)
        return causes


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
        forces = [row for row in rows if find_group(row) in OVERVIEW_GROUPS[:2]]
        failing = {row.engine for row in forces if not row.passed}
        explained = {engine for engine, causes in scene.causes.items() if causes}
        witnesses |= {row.engine for row in rows} - (failing & explained)
    answered = Counter(row.quantity for row in rows if row.compared)
    of_free_motion = ("theta_2", "omega_2", "energy") if scene.against else ()
    return {*scene.against, *of_free_motion} | {
        name_whole(row)
        for row in rows
        if row.failed and name_whole(row) in UNITS and answered[row.quantity] == 1
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
    if name_whole(row) != row.quantity:
        return f"inertial part of the {find_group(row)}"
    if row.quantity == "closure":  # an identity of the engine's own angles
        return row.quantity
    if row.quantity == "assembled":
        return "positions at which the loop closes"
    return find_group(row) or row.quantity


def _join_groups(groups: Sequence[str], verb: str) -> str:
    """Write groups of quantities with their verb."""
    plural = len(groups) > 1 or groups[0].endswith("s")
    listed = " and ".join([", ".join(groups[:-1]), groups[-1]][len(groups) < 2 :])
    return f"{listed} {verb if plural else verb + 's'}"
