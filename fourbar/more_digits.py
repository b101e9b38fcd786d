"""The second pass: positions at which plain doubles lose more than the data do are evaluated in 32 digits."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fourbar.kinematics import close_loop
from fourbar.margins import NONE, in_double_double
from fourbar.state import Array, State

NEAR = (0.03, 0.1)
"""|sin mu| and |sin(theta_2 - theta_1)| below which a position counts as near a change point: there errors that
are allowed in the velocities multiply each other in the torque, whose own sensitivity may vanish."""
SHORT_GROUND = 1.0 / 8.0
"""Of the input. Below it the bars turn nearly as one body: their centripetal forces cancel in the torque."""

SHORT_INPUT = 1.0 / 64.0
"""Of the ground. Below it the diagonal hardly leaves the ground's line, and forces along it have a component that is
small beside the other, with digits of its own."""


def needing_more_digits(state: State) -> NDArray[np.intp]:
    """Indices of the positions for the second pass; none in ordinary linkages away from change points."""
    linkage = state.linkage
    a, d = linkage.input.length, linkage.ground
    if d < SHORT_GROUND * a or a < SHORT_INPUT * d:
        hard = np.ones(state.theta_2.shape, dtype=bool)
    else:
        near_sine, near_angle = NEAR
        _, _, b, c = state.diagonal.lengths
        if state.diagonal.least_root > near_sine * (2.0 * b * c):
            return NONE  # at no theta_2
        hard = np.abs(state.sin_mu) < near_sine
        if not hard.any():
            return np.flatnonzero(hard)
        hard &= np.abs(state.diagonal.h) < 0.5 * near_angle
    hard &= state.assembled & ~state.singular
    hard[state.diagonal.decided] = False  # their margins carry 60 digits already
    if state.parallel is not None:
        hard &= ~state.parallel[0]
    return np.flatnonzero(hard)


def restated(
    state: State, omega_2: Array | float, alpha_2: Array | float, index: NDArray[np.intp]
) -> tuple[State, Any, Any]:
    """The positions of an index in 32 digits, with the motion there."""
    from fourbar.double_double import DoubleDouble

    theta_2: Any = DoubleDouble(state.theta_2[index])
    with np.errstate(all="ignore"):
        exact = close_loop(state.linkage, theta_2, state.branch[index], in_double_double(state.linkage, theta_2))
    size = np.zeros(index.shape)
    speed = DoubleDouble(size + (omega_2 if np.ndim(omega_2) == 0 else omega_2[index]))  # type: ignore[index]
    growth = alpha_2 if np.ndim(alpha_2) == 0 else alpha_2[index]  # type: ignore[index]
    return exact, speed, growth if np.ndim(growth) == 0 and growth == 0.0 else DoubleDouble(size + growth)


def rounded(value: Any) -> Any:
    """A number of 32 digits as the nearest double; a double as it is."""
    return getattr(value, "hi", value)
