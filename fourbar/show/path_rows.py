"""Extent, straightness and stroke of the paths of points, as they are printed."""

from typing import Any

import numpy as np

from fourbar.errors import clean_line
from fourbar.show.driving import name_places
from fourbar.show.duty import convert
from fourbar.show.lines import wrap_line
from fourbar.show.shown_units import choose_unit, drop_rounding
from fourbar.solution import Conversion, Solution, find_unit_in
from fourbar.studies.paths import measure_paths

_INDENT = " " * 4


def write_paths(solution: Solution, units: Conversion) -> list[str]:
    """Write lines for each point: its extent, and how straight its path is."""
    lines = []
    name, unit = name_places(solution)
    factor, place = choose_unit(1.0, unit, units)
    turned, angle = find_unit_in("rad", units)
    for point, path in measure_paths(solution).items():
        largest = max(path.stroke, *map(abs, (*path.x, *path.y)))
        per_metre, length = choose_unit(largest, "m", units)
        extents = np.array([*path.x, *path.y, path.straightness, path.stroke])
        left, right, below, above, across, along = (
            f"{per_metre * number:#.6g}".rstrip(".")
            for number in drop_rounding(extents, largest).tolist()
        )
        (direction,) = drop_rounding(np.array([path.direction]), np.pi)
        first, last = (f"{factor * end + 0.0:.6g}" for end in path.ends)
        extent = (
            f"x from {left} to {right} {length}, y from {below} to {above} {length}"
        )
        lines += [
            *wrap_line(f"path of {clean_line(point)}: {extent}"),
            f"{_INDENT}straightness {across} {length}, stroke {along} {length} along"
            f" {angle * direction:.6g} {turned},",
            f"{_INDENT}from {name} = {first} to {last} {place}",
        ]
    return lines


def collect_paths(solution: Solution, units: Conversion) -> dict[str, Any]:
    """Collect the paths as the JSON has them, by the name of the point."""
    _, place = name_places(solution)
    lengths = dict.fromkeys(("x", "y", "straightness", "stroke"), "m")
    si = {**lengths, "direction": "rad", "ends": place}
    return {
        name: convert(path, si, units) for name, path in measure_paths(solution).items()
    }
