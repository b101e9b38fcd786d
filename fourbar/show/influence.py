"""What `fourbar analyze --sensitivity` prints: the largest changes by a hundredth of each number, as a table."""

import math
from typing import TYPE_CHECKING

from fourbar.show.tables import plain_table
from fourbar.solution import unit_of
from fourbar.studies.derivatives import Sensitivity
from fourbar.studies.influence import influences, largest, shown_quantities

if TYPE_CHECKING:
    from rich.table import Table


def heading(found: Sensitivity) -> list[str]:
    """The lines above the table."""
    lines = [
        "largest change over the positions by 1 % of a number, of an angle by 1 deg; pin forces by their magnitude",
    ]
    for name in shown_quantities(found):
        own = influences(found, name)
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


def table(found: Sensitivity) -> "Table":
    """A row for each number that matters, those first that change any quantity most against its largest value."""
    names = shown_quantities(found)
    by = {name: {row.key: row.change for row in influences(found, name)} for name in names}
    rows = [["largest value", *(f"{largest(found, name):.4g}" for name in names)]]
    rows += [[key, *(f"{by[name].get(key, 0.0):.3g}" for name in names)] for key in ranked(found, names)]
    return plain_table(["", *(f"{name}\n{unit_of(name)}" for name in names)], rows, left=("",))


def ranked(found: Sensitivity, names: list[str]) -> list[str]:
    """The numbers that any of the quantities depends on, by their largest share of a largest value."""
    share: dict[str, float] = {}
    for name in names:
        size = largest(found, name)
        for row in influences(found, name):
            share[row.key] = max(share.get(row.key, 0.0), abs(row.change) / size if size > 0.0 else 0.0)
    return sorted(share, key=lambda key: -share[key])
