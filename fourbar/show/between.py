"""What stands between the positions of a sweep: reversals of dry friction, and the largest torque and pin forces."""

from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fourbar.linkage import PINS
from fourbar.quantities import COUPLE, LINE, PIN_FORCES
from fourbar.scene import Scene, command_at
from fourbar.show.duty import read_drive
from fourbar.solution import Array, Solution
from fourbar.solve import solve

CUTS = 40
"""Parts into which one call of `solve` cuts every interval that is looked at."""
ROUNDS = 5
"""Calls: a step of 5 degrees is cut down to 5e-8 degrees, less than a largest value can be told from the next by."""
MOST_PEAKS = 6
"""Of one quantity, the highest."""
GROWING = 1e-3
"""Part of itself by which what has a largest value grows no more in the last two calls; towards a pole it grows on."""
AT_REST = 1e-12
"""Part of its largest slip below which a pin is at rest at a position."""
Branch = NDArray[np.int8]
At = Callable[[Array, Branch, str], Solution]
"""Solve at places (of what is commanded, or of a motion law the time) and branches, up to a stage."""


class Between(NamedTuple):
    """A sweep with what its steps pass over."""

    solution: Solution
    """At its positions and, among them, at both sides of each reversal and where each of `list_sizes` is largest."""
    reversals: list[tuple[float, str]]
    """Commanded angle or stroke, rad or m, and the pin at which dry friction reverses there: the pin forces jump."""
    growing: set[str]
    """Those of `list_sizes` that grow without bound within a step; all where nothing was looked for between."""


def list_sizes(solution: Solution) -> dict[str, Array]:
    """List the magnitudes whose largest values are located: torque, power and speed of the drive, and pin forces."""
    of_drive = read_drive(solution)
    drive = {of_drive.keys.value: of_drive.keys.value, "power": "power", "speed": of_drive.speed_key}
    forces = {name: np.hypot(*getattr(solution, name).T) for name in PIN_FORCES}
    return {**{name: np.abs(getattr(solution, key)) for name, key in drive.items()}, **forces}


def locate_between(scene: Scene, solution: Solution) -> Between:
    """Locate what the steps of a sweep, or of a motion law, pass over: by `solve`, at ever finer positions.

    Nothing stands between the positions of a released motion, of a list of angles, or where they alone are known.

    `solution`: of the scene's positions, or of its sweep in rising order, to the stage "force".
    """
    motion = scene.motion
    if motion.free is not None or isinstance(motion.angle, np.ndarray) or solution.F12 is None or len(solution) < 2:
        return Between(solution, [], {COUPLE.value, LINE.value, *PIN_FORCES})

    def at(places: Array, branch: Branch, stage: str = "force") -> Solution:
        return solve(scene, stage, at=command_at(scene, places, branch))

    pins, low, high, branch = _find_reversing(scene, solution)
    for _ in range(ROUNDS if pins else 0):
        places = _cut(low, high)
        inside = at(places.ravel(), np.repeat(branch, CUTS + 1), "velocity")
        slips = np.array([_compute_slip(inside, pin).reshape(places.shape)[row] for row, pin in enumerate(pins)])
        turned = np.argmax(slips * slips[:, :1] <= 0.0, axis=1)
        rows = np.arange(len(pins))
        low, high = places[rows, turned - 1], places[rows, turned]
    merged = _merge(at, solution, np.concatenate([low, high]), np.concatenate([branch, branch]))
    angles = low if motion.law is None else motion.law.at(low)[0]
    found, branch, growing = _find_largest(at, merged)
    reversals = sorted(zip(angles.tolist(), pins, strict=True))
    return Between(_merge(at, merged, found, branch), reversals, growing)


def _cut(low: Array, high: Array) -> Array:
    return low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, CUTS + 1)


def _merge(at: At, solution: Solution, places: Array, branch: Branch) -> Solution:
    """Solve at the positions of a solution and at others among them, in the order of the solution."""
    if not len(places):
        return solution
    over = np.concatenate([solution.at.places, places])
    order = np.unique(over, return_index=True)[1][:: 1 if over[0] < over[1] else -1]
    return at(over[order], np.concatenate([solution.at.branch, branch])[order], "force")


def _compute_slip(solution: Solution, pin: str) -> Array:
    """Compute omega_j - omega_i of the bars that meet at a pin."""
    one, other = (0.0 if bar == 1 else getattr(solution, f"omega_{bar}") for bar in PINS[pin])
    return np.asarray(other - one)


def _find_reversing(scene: Scene, solution: Solution) -> tuple[list[str], Array, Array, Branch]:
    """List the steps in which a pin with dry friction changes its sense: pin, ends, branch."""
    over, branch, steps = solution.at.places, solution.at.branch, list[tuple[str, int, int]]()
    for pin in sorted({pin for effect in scene.effects for pin in effect.dry_pins}):
        slip = np.nan_to_num(_compute_slip(solution, pin))
        moving = np.flatnonzero(np.abs(slip) > AT_REST * np.abs(slip).max())
        steps += [
            (pin, i, j)
            for i, j in pairwise(moving.tolist())
            if slip[i] * slip[j] < 0.0 and branch[i] == branch[j] and solution.assembled[i:j].all()
        ]
    first, last = (np.array([step[end] for step in steps], dtype=int) for end in (1, 2))
    return [pin for pin, *_ in steps], over[first], over[last], branch[first]


def _find_largest(at: At, solution: Solution) -> tuple[Array, Branch, set[str]]:
    """Find where each size is largest between positions that it has a local maximum at: places, branches, growing."""
    over, branch, peaks = solution.at.places, solution.at.branch, list[tuple[str, int, int, int]]()
    for name, size in list_sizes(solution).items():
        known = np.concatenate([[-1.0], np.nan_to_num(size, nan=-1.0, posinf=-1.0), [-1.0]])
        before, here, after = known[:-2], known[1:-1], known[2:]
        tops = np.flatnonzero((here >= before) & (here >= after) & (here > np.minimum(before, after)) & (here > 0.0))
        for i in tops[np.argsort(-here[tops], kind="stable")][:MOST_PEAKS]:
            left = i - (before[i] >= 0.0 and branch[i - 1] == branch[i])
            right = i + (after[i] >= 0.0 and branch[min(i + 1, len(branch) - 1)] == branch[i])
            peaks.append((name, i, left, right))
        for i, j in pairwise(range(len(branch))):  # towards a gap it may grow whatever it is beside it
            if known[i + 1] * known[j + 1] < 0.0 and branch[i] == branch[j]:
                peaks.append((name, i if known[j + 1] < 0.0 else j, i, j))
    rows, names = np.arange(len(peaks)), [name for name, *_ in peaks]
    at_grid, left, right = (np.array([peak[k] for peak in peaks], dtype=int) for k in (1, 2, 3))
    opens = ~(solution.assembled[left] & solution.assembled[right])
    low, high, places = over[left], over[right], over[at_grid]
    reached = [np.array([list_sizes(solution)[name][i] for name, i, *_ in peaks])]
    for _ in range(ROUNDS if len(peaks) else 0):
        cut = _cut(low, high)
        found = list_sizes(at(cut.ravel(), np.repeat(branch[at_grid], CUTS + 1), "force"))
        values = np.array([np.nan_to_num(found[n].reshape(cut.shape)[k], nan=-1.0) for k, n in enumerate(names)])
        inwards = np.abs(np.arange(CUTS + 1) - np.where(solution.assembled[left], 0, CUTS)[:, None])
        best = np.argmax(np.where(opens[:, None] & (values >= 0.0), inwards, values), axis=1)
        places, low, high = (cut[rows, np.clip(best + step, 0, CUTS)] for step in (0, -1, 1))
        reached.append(values[rows, best])
    growing = reached[-1] > (1.0 + GROWING) * reached[-3] if len(peaks) else rows > 0
    kept = ~growing & (reached[-1] > reached[0]) & ~opens  # beside a gap others grow
    return places[kept], branch[at_grid][kept], {name for name, grows in zip(names, growing, strict=True) if grows}
