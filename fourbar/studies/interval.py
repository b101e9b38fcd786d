"""Over what guaranteed extremes are looked for: the input's interval, and whether every linkage assembles there."""

import itertools
import math
from typing import Any

import numpy as np

from fourbar.errors import InputError, LimitError
from fourbar.formulas.mobility import TURN, change_points, find_intervals, limit_positions, turns_fully
from fourbar.quantities import NOT_ASSEMBLED
from fourbar.scene import Scene, command, require_input
from fourbar.solve import solve
from fourbar.studies.keys import list_entries, read_place
from fourbar.studies.study import vary

DISTANCE = math.radians(1.0)
"""rad; how near to a limit, where forces grow without end, the bounds reach."""
TRIED = 10_000
"""Linkages drawn from the tolerances to say how many do not assemble: the share is known to half a percent of all."""
FARTHEST = 1e5
"""rad; farther round, boxes as narrow as are needed lie between two doubles."""
KNOWN = ("gravity", "viscous", "springs", "flywheel", "load")


def require(scene: Scene) -> None:
    """InputError for what has no proven extremes."""
    motion = scene.motion
    require_input(scene, "the search for proven extremes")
    if motion.free is not None or motion.law is not None:
        raise InputError("motion", "a free motion or a motion law", "has no interval of theta_2 at one speed")
    if motion.omega_2 is None:
        raise InputError("motion.omega_2", None, "is needed for extremes of torque and pin forces")
    if abs(scene.linkage.ground_angle) > FARTHEST:
        allowed = f"must lie within {FARTHEST:g} rad for extremes"
        raise InputError("lengths.ground_angle", scene.linkage.ground_angle, allowed)
    if change_points(scene.linkage):
        raise InputError("lengths", scene.linkage.lengths, "has a change point, towards which forces have no bound")
    for term in (*scene.loads, *scene.effects):
        if term.key not in KNOWN or getattr(term, "table", None) is not None:
            key = "loads" if term.key == "load" else f"effects.{term.key}"
            allowed = "gravity, viscous, springs, flywheel and loads without a table"
            raise InputError(key, None, f"its extremes cannot be guaranteed; those with {allowed} can")


def find_interval(scene: Scene) -> tuple[tuple[tuple[float, float], ...], float]:
    """Return the input's full interval without what lies within DISTANCE of its limits and of poles of the torque."""
    linkage, first = scene.linkage, float(command(scene).theta_2[0])
    psi = first - linkage.ground_angle
    if abs(psi) > TURN:
        first = linkage.ground_angle + math.atan2(math.sin(psi), math.cos(psi))
    if turns_fully(linkage):
        start, stop, gaps = first, first + TURN, False
    else:
        every = [
            (low + TURN * turn, high + TURN * turn)
            for low, high in find_intervals(linkage)
            for turn in (math.floor((first - low) / TURN),)
        ]
        start, stop = next(((low, high) for low, high in every if low <= first <= high), every[0])
        start, stop, gaps = start + DISTANCE, stop - DISTANCE, True
    parts = [(start, stop)]
    if scene.drive_bar in (3, 4):  # T3 has poles where bar 3 stands still against the ground, T4 where bar 4 does
        for limit in limit_positions(linkage, scene.drive_bar):
            for turn in range(-2, 3):
                at = limit.theta_2 + TURN * turn
                cut = [(low, min(high, at - DISTANCE)) for low, high in parts]
                cut += [(max(low, at + DISTANCE), high) for low, high in parts]
                kept = [(low, high) for low, high in cut if low < high]
                if kept != parts:
                    gaps = True
                parts = sorted(set(kept))
    parts = [(low, high) for low, high in parts if low < high]
    if not parts:
        nowhere = f"is nowhere farther than {math.degrees(DISTANCE):g} deg from a limit of the input or a pole"
        raise LimitError(f"the interval of theta_2 {nowhere}: nothing is proven there")
    return tuple(parts), DISTANCE if gaps else 0.0


def require_all(scene: Scene, parts: tuple[tuple[float, float], ...]) -> None:
    """LimitError with the share of the linkages within the tolerances that do not assemble over the whole interval.

    The diagonal from A to O4 is shortest and longest at the ends, and where the input lies along the ground's line.
    """
    given = [tolerance for tolerance in scene.tolerances if tolerance.key.startswith("lengths.")]
    if not given:
        return
    corners = np.array(list(itertools.product((-1.0, 1.0), repeat=len(given))))
    off = np.concatenate([corners, np.random.default_rng(0).uniform(-1.0, 1.0, (TRIED, len(given)))]).T
    known, first = list_entries(scene), scene.linkage.ground_angle
    values: dict[str, Any] = {
        tolerance.key: read_place(scene, known[tolerance.key].place) + tolerance.reach * part
        for tolerance, part in zip(given, off, strict=True)
    }
    along = [first + 0.5 * TURN * turn for turn in range(-4, 5)]
    inside = [at for at in along if any(low <= at <= high for low, high in parts)]
    values["motion.theta_2"] = np.array([*itertools.chain(*parts), *inside])
    apart = (solve(vary(scene, values), "position").status_code == NOT_ASSEMBLED).any(axis=1)
    if apart.any():
        share = 100.0 * float(apart[len(corners) :].mean())
        low, high = (math.degrees(end) for end in (parts[0][0], parts[-1][1]))
        raise LimitError(
            f"tolerances: {f'{share:.3g} %' if share else 'some'} of the linkages within them do not assemble over "
            f"theta_2 = {low:.6g} to {high:.6g} deg: no bound holds for all; narrow the tolerances"
        )
