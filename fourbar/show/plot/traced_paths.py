"""Paths of points, traced by steps along the curve.

Near a small transmission angle a degree may be a long chord.
"""

from typing import NamedTuple

import numpy as np

from fourbar.formulas.mobility import find_circuit
from fourbar.formulas.points import list_circuit
from fourbar.quantities import Array
from fourbar.scene import Command, command_at
from fourbar.scene.motion import Sweep
from fourbar.show.plot.style import Points, join_points, split_points
from fourbar.show.plot.view import View
from fourbar.solution import Solution
from fourbar.solving import solve

STEPS_OF_A_PATH = (1440, 7200, 36_000, 180_000)
"""Steps that are tried until no chord is long, each a multiple of 4."""
_CHORD = 1.0 / 150.0
"""Longest chord of a path, as a part of its extent. No corner is seen in a printed
figure.
"""


class Trace(NamedTuple):
    """Positions from which paths are drawn."""

    solution: Solution
    circuit: bool
    """True for the whole circuit, through both branches where the input has limits."""

    def path(self, points: Array) -> Points:
        """Return the path of a point, whose places are (n, 2), m.

        Positions that stand closer than needed are left out.
        """
        shown = join_points(points)
        if self.circuit:
            shown = np.append(shown, shown[0])
        return _thin(shown)


def trace(view: View) -> Trace:
    """Solve the positions that the paths of a view run through.

    A motion of the input that names no sweep has the circuit of the position drawn; a
    sweep and the command of another bar have their own range; a motion through time and
    a list of angles have their own positions.
    """
    motion = view.scene.motion
    listed = isinstance(motion.angle, np.ndarray)
    if view.time is not None or listed:
        return Trace(view.sweep, circuit=False)
    circuit = motion.commanded == "theta_2" and not isinstance(motion.angle, Sweep)
    solution = view.sweep
    for steps in STEPS_OF_A_PATH:
        if circuit:
            at = _list_circuit_commands(view, steps)
        else:
            first, last = view.sweep.at.places[[0, -1]]
            at = command_at(view.scene, np.linspace(first, last, steps + 1))
        solution = solve(view.scene, "position", at=at)
        followed = [solution.A, solution.B, *solution.points.values()]
        if all(map(_has_short_chords, followed)):
            break
    return Trace(solution, circuit)


def _list_circuit_commands(view: View, steps: int) -> Command:
    linkage = view.scene.linkage
    here = view.here
    number = int(find_circuit(linkage, here.theta_2, here.branch)[0])
    branch = view.scene.motion.branch
    theta_2, assembly, _ = list_circuit(linkage, number, branch, steps)
    return Command(theta_2, assembly.astype(np.int8), None, 0.0)


def _measure_chords(path: Points) -> tuple[Array, float]:
    """Return the chord of each step of a path, NaN beside a gap, and its extent, m."""
    coordinates = split_points(path[np.isfinite(path)])
    return np.abs(np.diff(path)), float(np.ptp(coordinates, axis=0).max())


def _has_short_chords(points: Array) -> bool:
    """Return True if no chord between positions that assemble is seen as one."""
    chords, extent = _measure_chords(join_points(points))
    return bool(np.nanmax(chords, initial=0.0) <= _CHORD * extent)


def _thin(path: Points) -> Points:
    """Leave out positions that lie within half a chord of the one before.

    Gaps and ends stay.
    """
    chords, extent = _measure_chords(path)
    step = 0.5 * _CHORD * extent
    if step == 0.0:
        return path[[0, -1]]
    before_edge = np.diff(np.isnan(path))
    lengths = np.cumsum(np.nan_to_num(chords))
    steps_passed = np.floor(np.append(0.0, lengths) / step)
    kept = np.diff(steps_passed, prepend=-1.0) > 0.0
    kept[:-1] |= before_edge
    kept[1:] |= before_edge
    kept[[0, -1]] = True
    return path[kept]
