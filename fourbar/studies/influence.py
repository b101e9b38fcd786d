"""What a quantity depends on most: its largest change by a hundredth of each number, of an angle by a degree."""

import json
import math
from typing import Any, NamedTuple

import numpy as np

from fourbar.quantities import PIN_FORCES
from fourbar.solution import nulled
from fourbar.studies.derivatives import Sensitivity

SCHEMA = "fourbar-sensitivity/1"
HUNDREDTH, DEGREE = 0.01, math.radians(1.0)


class Influence(NamedTuple):
    """Of one number on one quantity, where it is largest."""

    key: str
    change: float
    """In the quantity's unit, signed; of a vector that is no force the length of its change."""
    theta_2: float
    """rad."""


def step_of(found: Sensitivity, key: str) -> float:
    """The change of a number that the influences are for: 1 % of it, of an angle 1 deg."""
    if found.keys[key].unit == "rad":
        return DEGREE
    return HUNDREDTH * abs(float(found.numbers[list(found.keys).index(key)]))


def shown_quantities(found: Sensitivity) -> list[str]:
    """Torque and pin forces, or where the scene states no speed the angles; and its own points."""
    own = [point.name for point in found.scene.points]
    return [*(("torque", *PIN_FORCES) if "torque" in found.by else ("theta_3", "theta_4")), *own]


def influences(found: Sensitivity, quantity: str) -> list[Influence]:
    """Of every number on a quantity, the largest first; those without any are left out."""
    value, rows = found.value(quantity), []
    for key in found.keys:
        change = step_of(found, key) * found.of(quantity, key)
        if quantity in PIN_FORCES:  # of the magnitude
            with np.errstate(all="ignore"):
                change = np.sum(value * change, axis=-1) / np.hypot(*value.T)
        elif change.ndim == 2:
            change = np.hypot(*change.T)
        if np.isfinite(change).any():
            worst = int(np.nanargmax(np.abs(change)))
            rows.append(Influence(key, float(change[worst]), float(found.solution.theta_2[worst])))
    return sorted((row for row in rows if row.change != 0.0), key=lambda row: -abs(row.change))


def largest(found: Sensitivity, quantity: str) -> float:
    """The largest magnitude of a quantity over the positions that have one; NaN where none has."""
    value = found.value(quantity)
    size = np.abs(value) if value.ndim == 1 else np.hypot(*value.T)
    return float(np.nanmax(size)) if np.isfinite(size).any() else math.nan


def json_text(found: Sensitivity) -> str:
    """One object, SI and rad: d(quantity)/d(key) over the positions, vectors as [x, y], null where there is none."""
    document: dict[str, Any] = {
        "schema": SCHEMA,
        "title": found.solution.title,
        "drive_bar": found.solution.drive_bar,
        "status": found.status,
        "theta_2": found.solution.theta_2.tolist(),
        "keys": {
            key: {"value": None if math.isnan(number) else number, "unit": entry.unit}
            for (key, entry), number in zip(found.keys.items(), found.numbers.tolist(), strict=True)
        },
        "by": {
            name: {key: nulled(row) for key, row in zip(found.keys, rows, strict=True)}
            for name, rows in found.by.items()
        },
    }
    return json.dumps(document, allow_nan=False) + "\n"
