"""Kinematic coefficients of bars and points, instant centres, coupler curves.

A coefficient is a derivative by theta_2, so every motion law follows from it:
    omega_k = h_k omega_2,              alpha_k = h_k alpha_2 + h_k' omega_2^2,
    v_P = f omega_2,                    a_P = f alpha_2 + f' omega_2^2.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fourbar.circuits import circuits
from fourbar.kinematics import add_accelerations, add_velocities, close_loop
from fourbar.linkage import FourBar
from fourbar.margins import Array
from fourbar.mobility import TURN, change_points, on_smooth_path, turns_fully
from fourbar.state import State, Vector, cross


class Coefficients(NamedTuple):
    """First and second derivatives of theta_3, theta_4 by theta_2, each (n,); NaN at singular positions."""

    theta_3: Array
    theta_4: Array
    theta_3_second: Array
    """1/rad."""
    theta_4_second: Array


class PointCoefficients(NamedTuple):
    """First and second derivatives of a point's position by theta_2, components of shape (n,)."""

    first: Vector
    """m/rad."""
    second: Vector
    """m/rad^2."""


def _at_unit_speed(state: State) -> State:
    """The same positions at omega_2 = 1 rad/s, alpha_2 = 0, where speeds are coefficients."""
    moving = replace(state)
    add_velocities(moving, 1.0)
    add_accelerations(moving, 0.0)
    return moving


def bar_coefficients(state: State) -> Coefficients:
    """h_k = d theta_k/d theta_2 and h_k' = d^2 theta_k/d theta_2^2 of bars 3 and 4.

    Source: B. Paul, Kinematics and Dynamics of Planar Machinery (1979); R. L. Norton, Design of Machinery, ch. 6 and 7.
    """
    moving = _at_unit_speed(state)
    values = (moving.omega_3, moving.omega_4, moving.alpha_3, moving.alpha_4)
    h3, h4, second_3, second_4 = (np.asarray(value) for value in values)
    return Coefficients(h3, h4, second_3, second_4)


def point_coefficients(state: State, bar: int, r_along: float, r_across: float) -> PointCoefficients:
    """d r_P/d theta_2 and d^2 r_P/d theta_2^2 of a point of bar 2, 3 or 4.

    Parameters
    ----------
    r_along, r_across : the point in the bar's frame at its first pin, m.
    """
    moving = _at_unit_speed(state)
    return PointCoefficients(moving.velocity(bar, r_along, r_across), moving.acceleration(bar, r_along, r_across))


class Centre(NamedTuple):
    """Instant centre in homogeneous coordinates: the point (x, y)/w; at infinity in direction (x, y) where w = 0."""

    x: Array
    y: Array
    w: Array

    @property
    def point(self) -> Vector:
        """(x/w, y/w), m; inf or NaN where the centre is at infinity or undetermined."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.x / self.w, self.y / self.w


def instant_centres(state: State) -> dict[tuple[int, int], Centre]:
    """The six instant centres I_ij, keyed by (i, j) with i < j.

    I12, I23, I34, I14 are the pins; I13 = line O2 A with line B O4, I24 = line A B with line O2 O4
    (Aronhold-Kennedy). Where two such lines coincide the centre is undetermined: x = y = w = 0.

    Source: R. L. Norton, Design of Machinery, ch. 6.
    """
    one = np.ones_like(state.theta_2)
    pins = {(1, 2): "O2", (2, 3): "A", (3, 4): "B", (1, 4): "O4"}
    centres = {bars: Centre(*state.pin(name), one) for bars, name in pins.items()}
    pin_4, pin_a = state.pin("O4"), state.pin("A")
    u1 = (pin_4[0] / state.linkage.ground, pin_4[1] / state.linkage.ground)
    along_2, along_1 = cross(pin_4, state.u4), cross(pin_a, state.u3)
    centres[1, 3] = Centre(along_2 * state.u2[0], along_2 * state.u2[1], cross(state.u2, state.u4))
    centres[2, 4] = Centre(along_1 * u1[0], along_1 * u1[1], cross(u1, state.u3))
    return centres


class CouplerCurve(NamedTuple):
    """A closed curve that a point of the coupler draws; the last position repeats the first; each (n,)."""

    theta_2: Array
    """rad; not wrapped."""
    branch: NDArray[np.int8]
    x: Array
    """m."""
    y: Array


def coupler_curve(
    linkage: FourBar, r_along: float, r_across: float, circuit: int = 0, *, branch: int = 1, steps: int = 360
) -> CouplerCurve:
    """The closed coupler curve of one circuit, run smoothly through limits and change points.

    Where the input turns fully theta_2 is spaced evenly, over two turns if one turn ends on the
    other branch; else it goes from limit to limit on one branch and back on the other, spaced by
    the cosine, so that the curve's points do not thin out at the limits.

    Parameters
    ----------
    r_along, r_across : the point in the coupler's frame at A, m.
    circuit : index into `circuits`; ValueError where there is none of that number.
    branch : where to start, for a linkage with change points.
    steps : number of intervals, a multiple of 4 (ValueError otherwise): limits and change points,
        at which directions are undetermined or lose digits, then fall between positions.
    """
    found = circuits(linkage)
    if not 0 <= circuit < len(found):
        raise ValueError(f"circuit = {circuit!r}: must be from 0 to {len(found) - 1}")
    if steps < 4 or steps % 4:
        raise ValueError(f"steps = {steps!r}: must be a positive multiple of 4")
    (start, stop), branches = found[circuit]
    branch = branch if branch in branches else branches[0]
    half = np.arange(0.5, steps, dtype=np.float64)
    turns = 0
    if turns_fully(linkage):
        turns = 2 if len(change_points(linkage)) == 1 else 1
        # odd halves of a multiple of 4 never meet theta_1 or theta_1 + pi
        theta_2: Array = start + half * (turns * TURN / steps)
        signs = on_smooth_path(linkage, theta_2, branch)
    else:
        out = 0.5 * (start + stop) - 0.5 * (stop - start) * np.cos(half[: steps // 2] * (TURN / steps))
        there = on_smooth_path(linkage, out, branch)
        theta_2, signs = np.concatenate((out, out[::-1])), np.concatenate((there, -there[::-1]))
    x, y = close_loop(linkage, theta_2, signs).point(3, r_along, r_across)
    theta_2 = np.append(theta_2, theta_2[0] + turns * TURN)
    return CouplerCurve(theta_2, np.append(signs, signs[0]), np.append(x, x[0]), np.append(y, y[0]))
