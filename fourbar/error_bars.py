"""Error bars of torque and pin forces: how far rounding makes them scatter.

The forces are evaluated again with every length, arm and term changed in its last digit. All
roundings then fall differently, so the root mean square of the changes is of the size of the error
itself, whatever the formulas lose at this position. Signs are taken from a Hadamard matrix: the
changes of different inputs do not cancel over the evaluations.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import count

import numpy as np

from fourbar.errors import InputError
from fourbar.kinematics import Array, State, add_accelerations, add_velocities, close_loop
from fourbar.kinetostatics import PinForces, Term, solve_pins
from fourbar.linkage import Bar, FourBar
from fourbar.margins import diagonal_to_O4
from fourbar.more_digits import rounded

EVALUATIONS = 8
"""With fewer, all of them may by chance come out as far off as the answer itself."""
LAST_DIGIT = 2.0**-52
LAST_ROUNDING = 2.0**-55
"""A typical error of rounding to nearest, whose largest is 2^-53."""
TYPICAL = 0.5
"""The root mean square holds the error of the answer besides the scatter; half of it is a typical error."""


def error_bars(state: State, pins: PinForces, terms: Iterable[Term], drive_bar: int) -> dict[str, Array]:
    """`torque_error` (N m) and `force_error` (N, worst of the four pin forces), each (n,).

    Parameters
    ----------
    state, pins : the evaluation that the error bars are for.
    terms, drive_bar : as given to `solve_pins`.
    """
    terms = tuple(terms)
    if not isinstance(state.theta_2, np.ndarray):  # evaluated in more digits: the last rounding is all there is
        sizes = [np.hypot(rounded(x), rounded(y)) for x, y in pins[:4]]
        return {"torque_error": LAST_ROUNDING * np.abs(rounded(pins.torque)), "force_error": LAST_ROUNDING * np.max(sizes, axis=0)}
    n = len(state.theta_2)
    torque, forces = np.zeros(n), np.zeros((4, n))
    runs = 0
    for run in range(EVALUATIONS):
        signs = _signs(run)
        try:
            linkage = _moved(state.linkage, signs)
        except InputError:  # the bars lie stretched out: moved, they cannot close anywhere
            continue
        moved = _moved_state(state, linkage, signs)
        other = solve_pins(moved, terms, drive_bar, factors=signs)
        torque += (other.torque - pins.torque) ** 2
        for total, before, after in zip(forces, pins[:4], other[:4], strict=True):
            total += (after[0] - before[0]) ** 2 + (after[1] - before[1]) ** 2
        runs += 1
    scale = TYPICAL / math.sqrt(max(runs, 1))
    return {"torque_error": scale * np.sqrt(torque), "force_error": scale * np.sqrt(forces.max(axis=0))}


def _signs(run: int) -> Iterator[float]:
    """1 +- one last digit for input 1, 2, ...: a row of the Hadamard matrix, over and over."""
    for column in count(1):
        bits = run & (column % EVALUATIONS or EVALUATIONS - 1)
        yield 1.0 + LAST_DIGIT * (1.0 if bits.bit_count() % 2 else -1.0)


def _moved(linkage: FourBar, signs: Iterator[float]) -> FourBar:
    def bar(old: Bar) -> Bar:
        assert old.centre is not None
        return replace(old, length=old.length * next(signs), centre=(old.centre[0] * next(signs), old.centre[1]))

    ground = linkage.ground * next(signs)
    return FourBar(ground, bar(linkage.input), bar(linkage.coupler), bar(linkage.output), linkage.ground_angle)


def _moved_state(state: State, linkage: FourBar, signs: Iterator[float]) -> State:
    diagonal = diagonal_to_O4(linkage, state.theta_2, decide=False)
    exact = state.diagonal.decided
    # margins of 60 digits carry one rounding, not the cancellation of the lengths
    diagonal.root[exact] = state.diagonal.root[exact] * next(signs)
    moved = close_loop(linkage, state.theta_2, state.branch, diagonal)
    moved.assembled, moved.singular = state.assembled, state.singular
    add_velocities(moved, state.omega_2)
    add_accelerations(moved, state.alpha_2)
    return moved
