"""Points of the bars: kinematic coefficients, instant centres, coupler curves.

A coefficient is a derivative by theta_2, so every motion law follows from it:
    omega_k = h_k omega_2,              alpha_k = h_k alpha_2 + h_k' omega_2^2,
    v_P = f omega_2,                    a_P = f alpha_2 + f' omega_2^2.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fourbar.errors import InputError, expect
from fourbar.formulas.arithmetic import Number, cross, sine
from fourbar.formulas.mobility import (
    TURN,
    Array,
    change_points,
    circuits,
    turns_fully,
)
from fourbar.formulas.motion import State
from fourbar.formulas.path import compute_state
from fourbar.linkage import (
    A_BRANCH,
    FourBar,
    require,
    require_bar,
    require_numbers,
)


class PointCoefficients(NamedTuple):
    """First and second derivatives of a point's position by theta_2, complex, (n,)."""

    first: Number
    """m/rad."""
    second: Number
    """m/rad^2."""


def point_coefficients(
    linkage: FourBar,
    theta_2: Array,
    branch: Number,
    bar: int,
    z: complex,
) -> PointCoefficients:
    """Compute d r_P/d theta_2 and d^2 r_P/d theta_2^2 of a point of bar 2, 3 or 4.

    Parameters
    ----------
    theta_2 : (n,), rad.
    branch : +1 or -1, or one of them for each position.
    z : the point in the bar's frame at its first pin, along + i across, m.

    Source: B. Paul, Kinematics and Dynamics of Planar Machinery (1979).
    """
    bar = require_bar("bar", bar)
    expect("z", z, complex, float, int, np.number)
    require("z", z.real)
    require("z", z.imag)
    moving = compute_checked_state(linkage, theta_2, branch)
    return PointCoefficients(moving.velocity(bar, z), moving.acceleration(bar, z))


class Centre(NamedTuple):
    """Instant centre in homogeneous coordinates: the point (x, y)/w.

    A centre with w = 0 lies at infinity in the direction (x, y).
    """

    x: Array
    y: Array
    w: Array

    @property
    def point(self) -> tuple[Array, Array]:
        """(x/w, y/w), m; inf or NaN where the centre is at infinity or undetermined."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.x / self.w, self.y / self.w


def locate_centres(
    O4: Number, A: Number, B: Number, *along: Number
) -> dict[tuple[int, int], Centre]:
    """Locate the six instant centres, complex, from the pins and the bars' lines."""
    u1, u2, u3, u4 = along
    one = np.ones(np.shape(A))
    pins = {(1, 2): 0.0 * A, (2, 3): A, (3, 4): B, (1, 4): O4}
    centres = {bars: Centre(pin.real, pin.imag, one) for bars, pin in pins.items()}
    I13 = cross(O4, u4) * u2
    I24 = cross(A, u3) * u1
    centres[1, 3] = Centre(I13.real, I13.imag, sine(u2, u4))
    centres[2, 4] = Centre(I24.real, I24.imag, sine(u1, u3))
    return centres


class CouplerCurve(NamedTuple):
    """A closed curve that a point of the coupler draws, each field (n,).

    The last position repeats the first.
    """

    theta_2: Array
    """rad; not wrapped."""
    branch: NDArray[np.int8]
    """Sign of sin(theta_4 - theta_3)."""
    x: Array
    """m."""
    y: Array


def list_circuit(
    linkage: FourBar,
    circuit: int,
    branch: int,
    steps: int,
) -> tuple[Array, NDArray[np.int64], int]:
    """Return theta_2 and branch of a circuit's positions, (steps,), and its turns.

    The turns are those that theta_2 gains over the circuit, an integer. For the
    parameters see `coupler_curve` (`studies/points.py`).
    """
    (start, stop), branches = circuits(linkage)[circuit]
    branch = branch if branch in branches else branches[0]
    half = np.arange(0.5, steps, dtype=np.float64)
    if turns_fully(linkage):
        turns = 2 if len(change_points(linkage)) == 1 else 1
        # odd halves of a multiple of 4 never meet theta_1 or theta_1 + pi
        theta_2: Array = start + half * (turns * TURN / steps)
        return theta_2, np.full(theta_2.shape, branch), turns
    out = 0.5 * (start + stop) - 0.5 * (stop - start) * np.cos(
        half[: steps // 2] * (TURN / steps)
    )
    theta_2 = np.concatenate((out, out[::-1]))
    return theta_2, np.repeat((branch, -branch), len(out)), 0


def compute_checked_state(linkage: FourBar, theta_2: object, branch: object) -> State:
    """Compute the state at positions given by a user, after checking them."""
    expect("linkage", linkage, FourBar)
    angles = require_numbers("theta_2", theta_2)
    signs = require_numbers("branch", branch, A_BRANCH)
    if not (np.abs(signs) == 1.0).all() or signs.shape not in ((), angles.shape):
        raise InputError("branch", branch, f"{A_BRANCH}, or one of them for each angle")
    return compute_state(linkage, angles, signs)
