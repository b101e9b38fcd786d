"""List how a described MJCF differs from the one generated for the scene.

The list says what each difference costs.
"""

import cmath
import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fourbar.effects import Gravity, Load
from fourbar.linkage import BAR_NUMBERS, Bar, record
from fourbar.quantities import FORCE_NAMES
from fourbar.scene import Scene
from fourbar.studies.keys import list_entries, read_number, replace_number
from fourbar_validation.compare.rows import Row
from fourbar_validation.compare.tolerance import wrap_difference
from fourbar_validation.engines.description import ModelEntry, Value

SAME_NUMBER = 1e-12
"""Relative difference of a number that is computed in another order of operations."""
_SAME_WEIGHT = 1e-9
"""Relative difference that is round-off. It follows from the places of both bodies in
the world, which cost digits.
"""
_TENFOLD = 1e-9
"""Relative distance from a power of ten at which a ratio is called one."""
ANOTHER_LINKAGE = 1e-3
"""Cost of a length above which torque and pin forces are those of another linkage. What
the rounding of a length costs is below it.
"""
_FINER_BELOW = ("option.timestep", "option.tolerance", "closure.weight")
_FINER_ABOVE = ("option.iterations", "option.ls_iterations")
"""Settings of which a smaller or a greater value has the smaller error."""
ENTRIES_THAT_MAY_LACK = ("loads.", "tendons.", "actuators.")
"""Entries that a file may lack: what is missing on one side is a difference."""
_MISSING: dict[str, Value] = dict.fromkeys(
    (".couple", ".stiffness", ".damping", ".frictionloss", ".armature"), 0.0
)
_MISSING[".force"] = (0.0, 0.0)
"""Value of what a missing load or tendon exerts."""
_REMARKS = tomllib.loads(
    Path(__file__).with_suffix(".toml").read_text(encoding="utf-8")
)["remarks"]
"""Part of a key, and what a difference there does; the first that fits."""


@record
class Difference:
    """One entry that is not the same in both files, and its cost."""

    key: str
    generated: Value | None
    theirs: Value | None
    """None: it is not there."""
    remark: str
    written: str = ""
    """Element and attribute in their file, where there is one."""
    cost: float | None = None
    """What this entry alone adds to an error: of torque and pin forces that which grows
    most, of a setting the worst one. None if it was not measured, or cannot be set
    alone.
    """
    quantity: str = ""
    """Quantity that has this error."""

    @property
    def price(self) -> str:
        """Write the cost with its quantity."""
        if self.cost is None:
            return "-"
        return f"{self.cost:.1e} {self.quantity}".strip()

    def write(self) -> str:
        """Write the entry with both values, where it is written, and what it does."""
        theirs, generated = map(write_value, (self.theirs, self.generated))
        parts = [f"{self.key}: {theirs}, generated {generated}"]
        if self.written:
            parts.append(f"in the file: {self.written}")
        if self.remark:
            parts.append(self.remark)
        return "; ".join(parts)


def find_differences(
    generated: Mapping[str, ModelEntry],
    theirs: Mapping[str, ModelEntry],
) -> list[Difference]:
    """Return what differs, in the order of the description."""
    length = max(
        float(entry.value)  # type: ignore[arg-type]
        for key, entry in generated.items()
        if _is_length(key)
    )
    differences = []
    for key in dict.fromkeys((*theirs, *generated)):
        entries = (generated.get(key), theirs.get(key))
        may_lack = key.startswith(ENTRIES_THAT_MAY_LACK) or key.endswith(".motor")
        if None in entries and not may_lack:
            # one of the files has no use for it, like solver parameters of no friction
            continue
        zeros = (value for end, value in _MISSING.items() if key.endswith(end))
        nothing = next(zeros, None)
        mine, yours = (nothing if one is None else one.value for one in entries)
        if _is_same_value(key, mine, yours, length) or _is_finer(key, mine, yours):
            continue
        remark = _remark(key, mine, yours)
        written = "" if entries[1] is None else " ".join(entries[1][1:]).strip()
        differences.append(Difference(key, mine, yours, remark, written))
    return differences


def change_scene(scene: Scene, one: Difference) -> Scene | None:
    """Return a scene with a length, number of a bar, couple or gravity as in a file.

    None for other entries.
    """
    if not (isinstance(one.theirs, float) and isinstance(one.generated, float)):
        return None
    change = one.theirs - one.generated
    if one.key in ("gravity.x", "gravity.y"):
        pull = change if one.key.endswith("x") else 1j * change
        further = Gravity(*cmath.polar(pull))
        return replace(scene, effects=(*scene.effects, further))
    name = one.key.removeprefix("loads.").removesuffix(".couple")
    if name in BAR_NUMBERS:
        couple = Load(BAR_NUMBERS[name], moment=change)
        return replace(scene, loads=(*scene.loads, couple))
    linkage = scene.linkage
    crank, coupler, output = (
        Bar(bar.length, bar.mass, bar.moment_of_inertia, bar.mass_centre)
        for bar in linkage.moving
    )
    linkage = replace(linkage, input=crank, coupler=coupler, output=output)
    scene = replace(scene, linkage=linkage, drawing=None)
    key = one.key.replace("centre.distance", "centre.0").replace(".angle", ".1")
    entry = list_entries(scene).get(key)
    if entry is None or not key.startswith(("lengths.", "bars.")):
        return None
    return replace_number(scene, entry, read_number(scene, entry) + change)


def price(
    difference: Difference,
    rows: Sequence[Row],
    unchanged: Sequence[Row],
) -> Difference:
    """Put the cost on a difference: what it adds to the worst error of a force.

    `rows`: of a file that has it, none where there is no such file; `unchanged`: of the
    same file without it.
    """
    before = _collect_errors(unchanged)
    gains = []
    for (engine, quantity), error in _collect_errors(rows).items():
        earlier = before.get((engine, quantity), 0.0)
        if is_setting(difference.key):
            # one that lowers some errors and raises others alike changes nothing
            others = (one for (other, _), one in before.items() if other == engine)
            earlier = max(others, default=math.nan)
        if math.isfinite(earlier):
            gains.append((error - earlier, quantity))
    if not gains:
        return difference
    cost, quantity = max(gains)
    return replace(difference, cost=max(cost, 0.0), quantity=quantity)


def _collect_errors(rows: Sequence[Row]) -> dict[tuple[str, str], float]:
    """Collect the errors of the torque and of pin forces by method and quantity.

    An error is infinite if there is no answer.
    """
    return {
        (row.engine, row.quantity): row.error if math.isfinite(row.error) else math.inf
        for row in rows
        if row.quantity in FORCE_NAMES
    }


def order(differences: Sequence[Difference]) -> list[Difference]:
    """Order differences by their cost, the worst first.

    Lengths of another linkage come before the others, and those without a cost behind
    them, in their own order.
    """

    def rank(one: Difference) -> tuple[bool, bool, float]:
        first = is_of_another_linkage(one)
        return not first, one.cost is None, -(one.cost or 0.0)

    return sorted(differences, key=rank)


def is_of_another_linkage(one: Difference) -> bool:
    """Tell whether a difference is a length that makes another linkage.

    What the others cost is then a cost in that linkage.
    """
    return _is_length(one.key) and (one.cost or 0.0) >= ANOTHER_LINKAGE


def is_setting(key: str) -> bool:
    """Tell whether an entry is a setting, and no part of the mechanism.

    What it costs depends on the other settings of its file.
    """
    return key.startswith(("option.", "closure.sol")) or key.endswith(
        ("solreffriction", "solimpfriction")
    )


def _is_length(key: str) -> bool:
    return key.startswith("lengths.") and not key.endswith("angle")


def _is_finer(key: str, ours: Value | None, theirs: Value | None) -> bool:
    """Tell whether a setting costs time alone: it is finer than that of ours."""
    if isinstance(ours, float) and isinstance(theirs, float):
        if key in _FINER_BELOW:
            return theirs < ours
        if key in _FINER_ABOVE:
            return theirs > ours
    return False


def _is_same_value(
    key: str,
    ours: Value | None,
    theirs: Value | None,
    length: float,
) -> bool:
    numbers = (float, tuple)
    if ours == theirs:
        return True
    if not (isinstance(ours, numbers) and isinstance(theirs, numbers)):
        return False
    if np.shape(ours) != np.shape(theirs):
        return False
    both = np.array([ours, theirs])
    apart = both[0] - both[1]
    if key.endswith("angle"):
        return bool(np.all(np.abs(wrap_difference(apart)) <= SAME_NUMBER))
    floor = 0.0
    if any(part in key for part in ("centre", "plane", ".point", ".path")):
        floor = length
    elif key.startswith(("gravity", "loads")):
        floor = 1.0
    same = _SAME_WEIGHT if key == "closure.weight" else SAME_NUMBER
    limit = same * max(np.abs(both).max(), floor)
    return bool(np.all(np.abs(apart) <= limit))


def _remark(
    key: str,
    ours: Value | None,
    theirs: Value | None,
) -> str:
    remark = next((text for part, text in _REMARKS.items() if part in key), "")
    if key == "closure.by" and "tendon" not in (ours, theirs):
        return ""
    if isinstance(ours, float) and isinstance(theirs, float) and ours * theirs > 0.0:
        power = math.log10(abs(theirs)) - math.log10(abs(ours))
        tens = round(power)
        if tens and abs(power - tens) <= _TENFOLD and not key.startswith("option"):
            return f"10^{tens} times: units? {remark}"
    return str(remark)


def write_value(value: Value | None) -> str:
    """Write numbers with the digits that set them apart, or the word itself."""
    if value is None or isinstance(value, str):
        return value or "none"
    return " ".join(f"{number:.12g}" for number in np.atleast_1d(value).tolist())
