"""List how a described MJCF differs from the one generated for the same scene, and what each difference does."""

import math
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

Value = float | str | tuple[float, ...]
Described = Mapping[str, Value]

SAME = 1e-12
"""Relative; a number written with its digits in another order of operations."""
TENFOLD = 1e-9
"""Relative distance from a power of ten at which a ratio is called one."""
OF_THE_DRIVE = {"pins.O2.armature": "the generated file keeps its speed by a flywheel; another drive needs none"}
"""Differences that are no fault: both files are driven alike here."""
ATTACHED = re.compile(r"((?:actuators|tendons)\.\d+)(\..+)?")
"""Keys of what a file may have any number of: numbered, so that their names can be anything."""
NEEDS = {
    r"(pins\.\w+)\.sol(?:ref|imp)friction": (r"\1.friction", 0.0),
    r"(tendons\.\d+)\.sol(?:ref|imp)friction": (r"\1.frictionloss", 0.0),
    r"(pins\.\w+|tendons\.\d+)\.(?:sol(?:ref|imp)limit|margin)": (r"\1.range", "free"),
    r"(pins\.\w+|tendons\.\d+)\.(?:spring angle|springyield|springlength.*)": (r"\1.stiffness", 0.0),
    r"(actuators\.\d+)\.dynprm": (r"\1.dyntype", 0.0),
    r"option\.wind": ("option.density", 0.0),
    r"option\.noslip_tolerance": ("option.noslip_iterations", 0.0),
    r"option\.sleep_tolerance": ("option.switched on", "nothing that matters here"),
    r"option\.meaninertia": ("option.tolerance", 0.0),
}
"""A key, and what its effect hangs on: where their file has that switched off, the key is left out."""
NEUTRAL: dict[str, Value] = {"damping": 0.0, "friction": 0.0, "stiffness": 0.0, "armature": 0.0, "range": "free"}
"""Properties of a pin without a hinge, where the other file is cut. Its other properties are not compared."""
WORDS = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
"""Names in MJCF where they differ, and what a difference does; see there."""


@dataclass(frozen=True, slots=True)
class Difference:
    """One entry that is not the same in both files."""

    key: str
    generated: Value
    theirs: Value
    remark: str
    written: str = ""
    """Element and attribute in their file, where there is one."""


def find_differences(
    generated: Described, theirs: Described, called: Mapping[str, str] | None = None
) -> list[Difference]:
    """Find what differs, in the order of the description; `called`: what their file calls a part of a key."""
    scale = max(value for key, value in generated.items() if _is_length(key) and isinstance(value, float))
    generated = _renumber_like(theirs, generated)
    result = []
    for key in [*theirs, *(key for key in generated if key not in theirs)]:
        ours, other = (file.get(key, _describe_missing(key)) for file in (generated, theirs))
        if (
            ours is not None
            and other is not None
            and not _is_same(key, ours, other, scale)
            and _has_effect(key, theirs)
        ):
            name = _write_name(key, theirs if key in theirs else generated)
            result.append(
                Difference(name, ours, other, _remark(key, ours, other), _find_written(key, theirs, called or {}))
            )
    return result


def _renumber_like(theirs: Described, generated: Described) -> Described:
    """Renumber the generated file's actuators and tendons as their counterparts: same role, if possible name.

    One without a counterpart keeps a number that theirs does not have.
    """
    heads = {key: value for key, value in theirs.items() if (m := ATTACHED.fullmatch(key)) and not m[2]}
    numbers: dict[str, str] = {}
    mine = [key for key in generated if (m := ATTACHED.fullmatch(key)) and not m[2]]
    for by_name in (True, False):
        for key in mine:
            for other, role in heads.items():
                same = not by_name or generated[f"{key}.name"] == theirs[f"{other}.name"]
                free = key not in numbers and other not in numbers.values()
                if free and same and role == generated[key] and other.partition(".")[0] == key.partition(".")[0]:
                    numbers[key] = other
    for key in mine:
        numbers.setdefault(key, f"{key}0{len(heads)}")
    renumbered = {}
    for key, value in generated.items():
        attached = ATTACHED.fullmatch(key)
        renumbered[numbers[attached[1]] + (attached[2] or "") if attached else key] = value
    return renumbered


def _describe_missing(key: str) -> Value | None:
    """Give what a file has that lacks the key; None: it is left out."""
    if attached := ATTACHED.fullmatch(key):
        return None if attached[2] else "none"
    if key.startswith("pins."):
        return NEUTRAL.get(key.split(".", 2)[2])
    return "none"


def _has_effect(key: str, theirs: Described) -> bool:
    """Return whether the entry of this key has an effect in their file; a name has none."""
    if ATTACHED.fullmatch(key) and key.endswith(".name"):
        return False
    for pattern, (switch, off) in NEEDS.items():
        if result := re.fullmatch(pattern, key):
            return theirs.get(result.expand(switch), off) != off
    return True


def _write_name(key: str, described: Described) -> str:
    attached = ATTACHED.fullmatch(key)
    if not attached or not (name := described[f"{attached[1]}.name"]):
        return key
    return f"{key.partition('.')[0]}.{name}{attached[2] or ''}"


def _find_written(key: str, theirs: Described, called: Mapping[str, str]) -> str:
    """Element and attribute as they stand in their MJCF, where the key does not say so itself."""
    if key not in theirs:
        return ""
    part = next((known for known in called if key == known or key.startswith(known + ".")), "")
    attribute = key[len(part) + 1 :]
    return f"{called[part]} {WORDS['written'].get(attribute, attribute)}".strip() if part else ""


def _is_length(key: str) -> bool:
    return key.startswith("lengths.") and not key.endswith("angle")


def _is_same(key: str, ours: Value, theirs: Value, length: float) -> bool:
    if isinstance(ours, str) or isinstance(theirs, str) or ours == theirs:
        return ours == theirs
    one, other = np.atleast_1d(ours), np.atleast_1d(theirs)
    if one.shape != other.shape:
        return False
    if key.endswith("angle"):
        return bool(np.all(np.abs(np.remainder(one - other + np.pi, math.tau) - np.pi) <= SAME))
    placed = any(part in key for part in ("centre", "plane", ".site", ".path"))
    floor = length if placed else 1.0 if key.startswith("gravity") else 0.0
    return bool(np.all(np.abs(one - other) <= SAME * max(np.abs(one).max(), np.abs(other).max(), floor)))


def _remark(key: str, ours: Value, theirs: Value) -> str:
    if key in OF_THE_DRIVE:
        return OF_THE_DRIVE[key]
    remark = next((text for part, text in WORDS["remarks"].items() if part in key), "")
    if isinstance(ours, float) and isinstance(theirs, float) and ours * theirs > 0.0 and not key.startswith("option"):
        power = math.log10(abs(theirs)) - math.log10(abs(ours))
        if round(power) and abs(power - round(power)) <= TENFOLD:
            return f"10^{round(power)} times: units? {remark}"
    return remark
