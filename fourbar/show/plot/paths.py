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

    def path(self, points: Array) -> Array:
        """Return the path of a point, (k, 2), m.

        Positions that stand closer than needed are left out.
        """
        shown = np.where(self.solution.assembled[:, None], points, np.nan)
        if self.circuit:
            shown = np.concatenate([shown, shown[:1]])
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
        if all(_longest_chord(points) <= _CHORD for points in followed):
            break
    return Trace(solution, circuit)


def _list_circuit_commands(view: View, steps: int) -> Command:
    linkage = view.scene.linkage
    here = view.here
    number = int(find_circuit(linkage, here.theta_2, here.branch)[0])
    theta_2, assembly, _ = list_circuit(
        linkage,
        number,
        view.scene.motion.branch,
        steps,
    )
    return Command(theta_2, assembly.astype(np.int8), None, 0.0)


def _measure_chords(points: Array) -> tuple[Array, float]:
    """Return the chord of each step of a path, NaN beside a gap, and its extent, m."""
    dx, dy = np.diff(points, axis=0).T
    extents = np.nanmax(points, axis=0) - np.nanmin(points, axis=0)
    return np.hypot(dx, dy), float(np.nanmax(extents))


def _longest_chord(points: Array) -> float:
    """Return the longest chord of positions that assemble, over the path's extent."""
    chords, extent = _measure_chords(points)
    if extent:
        return float(np.nanmax(chords, initial=0.0)) / extent
    return 0.0


def _thin(path: Array) -> Array:
    """Leave out positions that lie within half a chord of the one before.

    Gaps and ends stay.
    """
    chords, extent = _measure_chords(path)
    step = 0.5 * _CHORD * extent
    if step == 0.0:
        return path[[0, -1]]
    is_gap = np.asarray(np.isnan(path).any(axis=1))
    before_edge = is_gap[1:] != is_gap[:-1]
    lengths = np.cumsum(np.nan_to_num(chords))
    steps_passed = np.floor(np.concatenate([[0.0], lengths]) / step)
    kept = np.diff(steps_passed, prepend=-1.0) > 0.0
    kept[:-1] |= before_edge
    kept[1:] |= before_edge
    kept[0] = True
    kept[-1] = True
    return np.asarray(path[kept])
