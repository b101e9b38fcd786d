"""Extent, straightness and stroke of the paths of points, as they are printed."""

from typing import Any

import numpy as np

from fourbar.errors import clean_line
from fourbar.show.units import choose_unit, drop_rounding
from fourbar.solution import Conversion, Solution, find_unit_in
from fourbar.studies.paths import measure_paths

_INDENT = " " * 4


def write_paths(solution: Solution, units: Conversion) -> list[str]:
    """Write three lines for each point: its extent, and how straight its path is."""
    scene = solution.scene
    lines = []
    name = scene.motion.commanded
    unit = "rad" if scene.motion.stroke is None else "m"
    if scene.motion.law is not None or scene.motion.free is not None:
        name, unit = "t", "s"
    for point, path in measure_paths(solution).items():
        largest = max(path.stroke, *map(abs, (*path.x, *path.y)))
        factor, length = choose_unit(largest, "m", units)
        x, y, (across, along) = (
            [
                f"{factor * number:#.6g}".rstrip(".")
                for number in drop_rounding(np.array(pair), largest)
            ]
            for pair in (path.x, path.y, (path.straightness, path.stroke))
        )
        turned, angle = find_unit_in("rad", units)
        factor, place = choose_unit(1.0, unit, units)
        (direction,) = drop_rounding(np.array([path.direction]), np.pi)
        first, last = (f"{factor * end + 0.0:.6g}" for end in path.ends)
        lines += [
            f"path of {clean_line(point)}: x from {x[0]} to {x[1]} {length}, y from"
            f" {y[0]} to {y[1]} {length}",
            f"{_INDENT}straightness {across} {length}, stroke {along} {length} along"
            f" {angle * direction:.6g} {turned},",
            f"{_INDENT}from {name} = {first} to {last} {place}",
        ]
    return lines


def collect_paths(solution: Solution, units: Conversion) -> dict[str, Any]:
    """Collect the paths as the JSON has them, by the name of the point."""
    scene = solution.scene
    length, angle = (find_unit_in(unit, units)[1] for unit in ("m", "rad"))
    over_time = scene.motion.law is not None or scene.motion.free is not None
    place = 1.0 if over_time else length if scene.motion.stroke is not None else angle
    return {
        name: {
            "x": [length * x for x in path.x],
            "y": [length * y for y in path.y],
            "straightness": length * path.straightness,
            "stroke": length * path.stroke,
            "direction": angle * path.direction,
            "ends": [place * end for end in path.ends],
        }
        for name, path in measure_paths(solution).items()
    }
