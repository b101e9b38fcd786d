"""What a quantity depends on most: its largest change by a hundredth of each number, of an angle by a degree.

A table and one JSON object of it are what `fourbar analyze --sensitivity` prints.
"""

import math
from typing import TYPE_CHECKING

import numpy as np

from fourbar.quantities import COUPLE, LINE, PIN_FORCES
from fourbar.show.tables import make_plain_table
from fourbar.solution import find_unit
from fourbar.studies.derivatives import Sensitivity
from fourbar.writing import write_object

if TYPE_CHECKING:
    from rich.table import Table

SCHEMA = "fourbar-sensitivity/1"


def list_shown(found: Sensitivity) -> list[str]:
    """Torque and pin forces, or where the scene states no speed the angles; and its own points."""
    own = [point.name for point in found.scene.points]
    drive = [name for name in (COUPLE.value, LINE.value) if name in found.by]
    return [*((*drive, *PIN_FORCES) if drive else ("theta_3", "theta_4")), *own]


def find_largest(found: Sensitivity, quantity: str) -> float:
    """Find the largest magnitude of a quantity over the positions that have one; NaN where none has."""
    value = found.value(quantity)
    size = np.abs(value) if value.ndim == 1 else np.hypot(*value.T)
    return float(np.nanmax(size)) if np.isfinite(size).any() else math.nan


def write_heading(found: Sensitivity) -> list[str]:
    """Write the lines above the table."""
    lines = [
        "largest change over the positions by 1 % of a number, of an angle by 1 deg; pin forces by their magnitude"
    ]
    for name in list_shown(found):
        own = found.influences(name)
        angles = [row for row in own if found.keys[row.key].unit == "rad"]
        most = [rows[0] for rows in ([row for row in own if row not in angles], angles) if rows]
        if most:
            parts = [f"{row.key} (at theta_2 = {math.degrees(row.theta_2):.6g} deg)" for row in most]
            lines.append(f"{name} depends most on " + ", of the angles on ".join(parts))
    without = [status for status in found.status if status != "ok"]
    if without:
        counts = ", ".join(f"{without.count(word)} {word.replace('_', ' ')}" for word in dict.fromkeys(without))
        lines.append(f"positions without all derivatives: {counts}")
    return lines


def make_table(found: Sensitivity) -> "Table":
    """List a row for each number that matters, those first that change any quantity most against its largest value."""
    names = list_shown(found)
    by = {name: {row.key: row.change for row in found.influences(name)} for name in names}
    rows = [["largest value", *(f"{find_largest(found, name):.4g}" for name in names)]]
    rows += [[key, *(f"{by[name].get(key, 0.0):.3g}" for name in names)] for key in rank_numbers(found, names)]
    return make_plain_table(["", *(f"{name}\n{find_unit(name)}" for name in names)], rows, left=("",))


def rank_numbers(found: Sensitivity, names: list[str]) -> list[str]:
    """Rank the numbers that any of the quantities depends on, by their largest share of a largest value."""
    share: dict[str, float] = {}
    for name in names:
        size = find_largest(found, name)
        for row in found.influences(name):
            share[row.key] = max(share.get(row.key, 0.0), abs(row.change) / size if size > 0.0 else 0.0)
    return sorted(share, key=lambda key: -share[key])


def write_json(found: Sensitivity) -> str:
    """One object, SI and rad: d(quantity)/d(key) over the positions, vectors as [x, y], null where there is none."""
    return write_object(
        SCHEMA,
        title=found.solution.title,
        drive_bar=found.solution.drive_bar,
        status=found.status,
        theta_2=found.solution.theta_2,
        keys={
            key: {"value": number, "unit": entry.unit}
            for (key, entry), number in zip(found.keys.items(), found.numbers.tolist(), strict=True)
        },
        by={name: dict(zip(found.keys, rows, strict=True)) for name, rows in found.by.items()},
    )
