"""Error bars of torque and pin forces: how far rounding makes them scatter.

The forces are evaluated again with every part of the triangle, arm and term changed in its last digit. All
roundings then fall differently, so the root mean square of the changes is of the size of the error
itself, whatever the formulas lose at this position. Signs are taken from a Hadamard matrix: the
changes of different inputs do not cancel over the evaluations.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial
from itertools import count
from typing import Any

import numpy as np

from fourbar.kinematics import add_accelerations, add_velocities, close_loop
from fourbar.kinetostatics import PinForces, Term, solve_pins
from fourbar.linkage import Bar, FourBar
from fourbar.margins import diagonal_to_O4, lost_by_turning
from fourbar.more_digits import rounded
from fourbar.state import Array, State

EVALUATIONS = 16
"""A power of two. With fewer, all of them may by chance come out as far off as the answer itself."""
LAST_DIGIT = 1.01 * 2.0**-53
"""Relative: x + x LAST_DIGIT is the next double, whatever x."""
LAST_ROUNDING = 2.0**-56
"""An error of rounding to nearest, whose largest is 2^-53, is above this in 7 cases of 8."""
TYPICAL = 0.4
"""The error bar as a share of the root mean square. That holds the error of the answer besides the scatter, sqrt 2
times either, so the bar is 0.57 standard deviations: 2 in 100 million normal errors exceed ten bars, and 5 in 1000
are below a hundredth of one."""


def error_bars(state: State, pins: PinForces, terms: Iterable[Term], drive_bar: int) -> dict[str, Array]:
    """`torque_error` (N m) and `force_error` (N, worst of the four pin forces), each (n,).

    Parameters
    ----------
    state, pins : the evaluation that the error bars are for.
    terms, drive_bar : as given to `solve_pins`.
    """
    terms = tuple(terms)
    in_doubles = isinstance(state.theta_2, np.ndarray)
    turned = None
    if state.parallel is not None and state.linkage.ground_angle != 0.0:
        turned = lost_by_turning(state.linkage, state.theta_2, state.parallel[0], LAST_DIGIT)
    n = len(rounded(state.theta_2))
    torque, forces = np.zeros(n), np.zeros((4, n))
    for run in range(EVALUATIONS):
        signs = _signs(run)
        linkage = _moved_linkage(state.linkage, signs, all_of_it=in_doubles)
        beside = partial(_next, signs=signs)
        moved_terms = [term.rounded_anew(beside, all_of_it=in_doubles) for term in terms]
        if in_doubles:
            moved = _moved_state(state, linkage, signs, turned)
            other = solve_pins(moved, moved_terms, drive_bar, growths=signs)
        else:
            other = solve_pins(replace(state, linkage=linkage), moved_terms, drive_bar)
        torque += rounded(other.torque - pins.torque) ** 2
        for k, (before, after) in enumerate(zip(pins[:4], other[:4], strict=True)):
            forces[k] += rounded(after[0] - before[0]) ** 2 + rounded(after[1] - before[1]) ** 2
    scale = TYPICAL / math.sqrt(EVALUATIONS)
    torque_error, force_error = scale * np.sqrt(torque), scale * np.sqrt(forces.max(axis=0))
    if state.parallel is not None:
        # the torque is what the components of a force leave of each other, and none of the changes is a force's own
        bar, force = {2: (2, pins.F32), 3: (3, pins.F43), 4: (4, pins.F43)}[drive_bar]
        (ux, uy), (fx, fy) = state.unit(bar), force
        left = state.linkage.bar(bar).length * (np.abs(ux * fy) + np.abs(uy * fx))
        torque_error += np.where(state.parallel[0], LAST_ROUNDING * left, 0.0)
    sizes = [np.hypot(rounded(x), rounded(y)) for x, y in pins[:4]]
    torque_error += LAST_ROUNDING * np.abs(rounded(pins.torque))
    force_error += LAST_ROUNDING * np.max(sizes, axis=0)
    # a change that leaves no value, or none in the range of a double: of the value itself no digit is left
    torque_error = np.where(np.isfinite(torque_error), torque_error, np.abs(rounded(pins.torque)))
    force_error = np.where(np.isfinite(force_error), force_error, np.max(sizes, axis=0))
    return {"torque_error": torque_error, "force_error": force_error}


def _signs(run: int) -> Iterator[float]:
    """+- one last digit for input 1, 2, ...: a row of the Hadamard matrix, over and over."""
    for column in count(1):
        bits = run & (column % EVALUATIONS or EVALUATIONS - 1)
        yield LAST_DIGIT if bits.bit_count() % 2 else -LAST_DIGIT


def _next(value: Any, signs: Iterator[float]) -> Any:
    """The next double, up or down."""
    return value + value * next(signs)


def _moved_linkage(linkage: FourBar, signs: Iterator[float], *, all_of_it: bool) -> FourBar:
    """The linkage with centres and inertias changed in their last digit; or only what doubles round in 32 digits."""

    def bar(old: Bar) -> Bar:
        assert old.centre is not None and old.inertia is not None
        if not all_of_it and old.centre[1] == 0.0:
            return old
        centre = (_next(old.centre[0], signs), _next(old.centre[1], signs))
        return replace(old, inertia=_next(old.inertia, signs) if all_of_it else old.inertia, centre=centre)

    return replace(linkage, input=bar(linkage.input), coupler=bar(linkage.coupler), output=bar(linkage.output))


def _unit_vector_beside(angle: Array, signs: Iterator[float]) -> tuple[Array, Array]:
    """`unit_vector` with every rounding another: near a right angle its cosine is a small difference."""
    t = _next(np.tan(0.5 * angle), signs)
    squared = _next(t * t, signs)
    w = _next(1.0 / (1.0 + squared), signs)
    return (1.0 - squared) * w, 2.0 * t * w


def _moved_state(state: State, linkage: FourBar, signs: Iterator[float], turned: tuple[Array, Array] | None) -> State:
    """The motion of the changed linkage at the same positions, from a triangle changed in its last digits."""
    diagonal = diagonal_to_O4(linkage, state.theta_2, growths=signs, turned=turned)
    exact = state.diagonal.decided
    # margins of 60 digits carry one rounding, not the cancellation of the lengths
    diagonal.root[exact] = _next(state.diagonal.root[exact], signs)
    diagonal.decided = exact
    moved = close_loop(linkage, state.theta_2, state.branch, diagonal)
    moved.assembled, moved.singular = state.assembled, state.singular
    moved.u2, moved.u3, moved.u4 = ((_next(u[0], signs), _next(u[1], signs)) for u in (moved.u2, moved.u3, moved.u4))
    if state.parallel is not None:
        # all that is lost is in the directions, each of several roundings; bars that turn as one are one here too
        together, folded = (
            state.parallel[0] & (state.parallel[1] == 1.0),
            state.parallel[0] & (state.parallel[1] == 0.0),
        )
        if linkage.ground_angle != 0.0:
            ground = _unit_vector_beside(np.asarray(linkage.ground_angle), signs)
            moved.u2 = _unit_vector_beside(state.theta_2, signs)
            moved.u3 = tuple(np.where(together, u, v) for u, v in zip(ground, moved.u3, strict=True))  # type: ignore[assignment]
            moved.u4 = tuple(np.where(folded, -u, v) for u, v in zip(ground, moved.u4, strict=True))  # type: ignore[assignment]
        u2, u3, u4 = moved.u2, moved.u3, moved.u4
        for _ in range(3):
            u2, u3, u4 = ((_next(u[0], signs), _next(u[1], signs)) for u in (u2, u3, u4))
        moved.u2, moved.u3, moved.u4 = u2, u3, u4
        moved.u3 = tuple(np.where(folded, -u, v) for u, v in zip(moved.u2, moved.u3, strict=True))  # type: ignore[assignment]
        moved.u4 = tuple(np.where(together, u, v) for u, v in zip(moved.u2, moved.u4, strict=True))  # type: ignore[assignment]
    add_velocities(moved, state.omega_2)
    add_accelerations(moved, state.alpha_2)
    moved.omega_3, moved.omega_4 = _next(moved.omega_3, signs), _next(moved.omega_4, signs)
    moved.alpha_3, moved.alpha_4 = _next(moved.alpha_3, signs), _next(moved.alpha_4, signs)
    return moved
