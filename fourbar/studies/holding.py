"""What dry friction holds along a circuit, and how a linkage begins to move where it does not."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fourbar.formulas.mobility import TURN
from fourbar.quantities import JAMMED
from fourbar.solution import Array
from fourbar.studies.circuit_curve import NOTHING, SAMPLES, CircuitCurve, RestPosition

HALVINGS = 60
"""Of the distance between two samples: to its last digits."""


class CircuitRange(NamedTuple):
    """A part of a row of the circuit."""

    ends: tuple[RestPosition, RestPosition]
    row: int
    low: float
    """Where it begins, and how far it goes, rad of the row's own angle."""
    width: float
    samples: int
    """How many are in it."""


def add_friction(curve: CircuitCurve, points: Array, side: int) -> Array:
    """Q with what friction does against a motion that begins to one side; -inf or inf where it jams that motion."""
    state, result = curve.state(points), np.empty(len(points))
    along = np.abs(state.k.h2) >= np.abs(state.k.h4)  # the torque that balances Q, on the bar that turns faster
    for bar, chosen in ((2, along), (4, ~along)):
        if chosen.any():
            part = curve.state(points[chosen])
            case = curve.case._replace(drive_bar=bar, drive=None)
            found = case.dynamics(part, 0.0, side)
            Q = -found.drive * part.k[bar - 2]
            result[chosen] = Q if found.status is None else np.where(found.status == JAMMED, -side * np.inf, Q)
    return result


def holds(curve: CircuitCurve, points: Array) -> NDArray[np.bool_]:
    """Whether friction holds."""
    return (add_friction(curve, points, 1) <= 0.0) & (add_friction(curve, points, -1) >= 0.0)


def moves(curve: CircuitCurve, points: Array) -> NDArray[np.int8]:
    """How positions begin to move: +1 as theta_2 grows, -1 as it falls, 0 they stay."""
    state = curve.state(points)
    ahead, back = add_friction(curve, points, 1), add_friction(curve, points, -1)
    level = NOTHING * curve.size(points)
    sense = np.where(ahead > level, 1, np.where(back < -level, -1, 0))
    return np.asarray(sense * np.sign(state.k.h2), dtype=np.int8)


def list_ranges(curve: CircuitCurve, holds: Callable[[Array], NDArray[np.bool_]], known: Array) -> list[CircuitRange]:
    """List the ranges within the sweep in which something holds, row by row; it holds at the points known."""
    result = []
    own_tau, own_row = curve.tau(known)
    for row, branch in enumerate(curve.rows):

        def there(tau: Array, branch: int = branch) -> NDArray[np.bool_]:
            points = curve.point(tau, branch)
            return curve.inside(points[:, 0], np.zeros(1)) & holds(points)

        tau = np.concatenate([(np.arange(SAMPLES) + 0.5) * (TURN / SAMPLES), own_tau[own_row == row]])
        order = np.argsort(tau)
        tau, inside = tau[order], (there(tau) | (np.arange(len(tau)) >= SAMPLES))[order]
        if inside.all():
            first, last = curve.point(np.array([0.0, math.nextafter(TURN, 0.0)]), branch)
            result.append(CircuitRange((curve.place(first), curve.place(last)), row, 0.0, TURN, SAMPLES))
            continue
        starts, stops = (np.flatnonzero(inside & ~np.roll(inside, by)) for by in (1, -1))
        if len(starts) and stops[0] < starts[0]:
            stops = np.roll(stops, -1)
        following = tau[(stops + 1) % len(tau)]
        begin = _find_edge(there, tau[starts], np.remainder(tau[starts] - tau[starts - 1], TURN), -1.0)
        end = _find_edge(there, tau[stops], np.remainder(following - tau[stops], TURN), 1.0)
        for low, high, count in zip(begin, end, (stops - starts) % len(tau) + 1, strict=True):
            one, other = (curve.place(point) for point in curve.point(np.array([low, high]), branch))
            if curve.full and other.theta_2 < one.theta_2:
                other = other._replace(theta_2=other.theta_2 + TURN)
            ends = (other, one) if not curve.full and one.branch == other.branch == -1 else (one, other)
            width = float(np.remainder(high - low, TURN))
            result.append(CircuitRange(ends, row, low, width, int(count)))
    return result


def is_inside(curve: CircuitCurve, point: Array, of: CircuitRange) -> bool:
    """Whether a point lies in a range."""
    tau, row = curve.tau(point[None])
    return bool(row[0] == of.row and np.remainder(tau[0] - of.low, TURN) <= of.width)


def _find_edge(held: Callable[[Array], NDArray[np.bool_]], tau: Array, gap: Array, sense: float) -> Array:
    """Find where a range ends, between a place that is held and the next one, which is not."""
    low, high = np.zeros(tau.shape), gap
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        inside = held(tau + sense * middle)
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return np.asarray(np.remainder(tau + sense * low, TURN))
