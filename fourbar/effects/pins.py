"""Values per pin, and the relative rotation of the two bars that meet there."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from fourbar.errors import InputError
from fourbar.linkage import MOVING_BARS, PINS, FourBar, require
from fourbar.solution import Solution
from fourbar.state import Array, State


def pin_values(key: str, values: Mapping[str, float]) -> tuple[tuple[str, float], ...]:
    """The non-negative value of each pin named, in the order of the pins."""
    for pin, value in values.items():
        known(f"{key}.{pin}", pin, value)
    return tuple((pin, require(f"{key}.{pin}", values[pin], at_least_zero=True)) for pin in PINS if pin in values)


def known(key: str, pin: str, value: object) -> None:
    """An InputError where there is no such pin."""
    if pin not in PINS:
        raise InputError(key, value, "the pins are " + ", ".join(PINS))


def relative_speed(solution: Solution, pin: str) -> Array:
    """omega_j - omega_i of the bars that meet at a pin, rad/s."""
    speeds = {1: 0.0, 2: solution.omega_2, 3: solution.omega_3, 4: solution.omega_4}
    i, j = PINS[pin]
    return np.asarray(speeds[j] - speeds[i])  # type: ignore[operator]


def shortest_bar(linkage: FourBar) -> float:
    """The least length of a moving bar, m."""
    return min(linkage.bar(number).length for number in MOVING_BARS)


AT_REST = 50.0 * 2.0**-52
"""Slip over the sum of the speeds, times sin^2 mu: what is below, rounding leaves of a slip that is zero."""


def resting(state: State, pin: str) -> Any:
    """Where the two bars turn together, as far as the digits of the state can tell, (n,)."""
    i, j = PINS[pin]
    one, other = state.omega(i), state.omega(j)
    speeds = (np.abs(one) + np.abs(other) + np.abs(state.omega_2)) + np.zeros(state.theta_2.shape)
    # positions evaluated in 32 digits tell slips apart that doubles cannot
    rounding = AT_REST if isinstance(state.theta_2, np.ndarray) else AT_REST * 2.0**-52
    lost: Any = state.sin_mu * state.sin_mu
    if state.parallel is not None:
        lost = np.where(state.parallel[0], 1.0, lost)  # speeds of bars that stay parallel are exact
    if state.diagonal.decided.size:
        lost[state.diagonal.decided] = 1.0  # margins of 60 digits lose nothing
    return ~np.greater(np.abs(other - one) * lost, rounding * speeds)


def sense(state: State, pin: str, side: int) -> Any:
    """Sign of omega_j - omega_i; at rest the one that a motion beginning to `side` would have, 0 for side 0.

    A linkage at rest begins to move as theta_2 grows (side +1) or falls (-1); a pin that is at rest in a
    linkage that moves turns either way.
    """
    i, j = PINS[pin]
    at_rest = resting(state, pin)
    sign = np.where(at_rest, 0.0, np.sign(state.omega(j) - state.omega(i)))
    if side == 0:
        return sign
    assert state.first is not None
    rates: dict[int, Any] = {1: 0.0, 2: 1.0, 3: state.first.h3, 4: state.first.h4}
    beginning = np.where(np.equal(state.omega_2, 0.0), np.sign(rates[j] - rates[i]), 1.0)
    return np.where(at_rest, side * beginning, sign)
