"""Assembly of a four-bar by Newton's method on its two closure equations.

All positions are solved at once.

    a e^{i theta_2} + b e^{i theta_3} = d e^{i theta_1} + c e^{i theta_4}

is solved for theta_3, theta_4. Vectors of the plane are complex numbers, x + i y.
"""

from typing import Any, NamedTuple

import numpy as np

from fourbar.linkage import FourBar
from fourbar.quantities import Array, ComplexArray, Mask, Signs
from fourbar.scene import Command, Scene
from fourbar.scene.motion import Motion
from fourbar_validation.compare.pins import resolve
from fourbar_validation.engines.description import place

NEWTON_STEPS = 100
"""Newton steps. Near a toggle Newton halves its distance: fifty steps reach the last
digit from any start.
"""
NEARLY_IN_LINE = 2.0**-26
"""Least angle of the shorter bar with the diagonal at a start, rad: the gap there is as
small as rounding.
"""
ROUNDING_OF_FOUR_BARS = 16.0 * 2.0**-52
"""Gap that the roundings of a sum of four bars can leave, relative to the sum of the
lengths.
"""
_STROKE_HALVINGS = 80
"""Number of times half a turn is halved: beyond the last digit of an angle."""


class Closed(NamedTuple):
    """Positions where the loop closes, the two angles, and the remaining gap, m.

    Angles and gap are NaN elsewhere.
    """

    assembled: Mask
    theta: Array
    """Angles of the two bars that are not commanded, rad, (2, n)."""
    gap: Array
    in_line: Array
    """Angles from which they are sought, rad, (2, n): where the loop does not close,
    both bars lie along the diagonal, as at its limits.
    """


def close(
    linkage: FourBar,
    theta: Array,
    branch: Signs,
    bar: int = 2,
) -> Closed:
    """Close the loop by Newton's method from the triangle of the lengths.

    Bar 2 commanded, bars 3 and 4 span the diagonal from A to O4; of bar 3 they are bars
    2 and 4, of bar 4 bars 3 and 2, bar 2 from A to O2.
    """
    d, a, b, c = linkage.lengths
    ground = d * np.exp(1j * linkage.ground_angle)
    held = {2: -a, 3: -b, 4: c}[bar]
    b, c = {2: (b, c), 3: (a, c), 4: (b, a)}[bar]
    diagonal = ground + held * np.exp(1j * theta)
    e = np.abs(diagonal)
    phi = np.angle(diagonal)
    closed = ROUNDING_OF_FOUR_BARS * sum(linkage.lengths)
    # the gap is least where bars 3 and 4 lie along the diagonal
    least_gap = np.maximum(e - (b + c), abs(b - c) - e)
    possible = np.flatnonzero(least_gap <= closed)
    e = np.maximum(e, closed / 4.0)
    start = np.array(
        [
            phi + branch * _compute_angle_between(e, b, c),
            phi + np.pi - branch * _compute_angle_between(e, c, b),
        ]
    )
    angles = np.full((2, len(e)), np.nan)
    gap = np.full(len(e), np.nan)
    angles[:, possible], gap[possible] = _solve_newton(
        diagonal[possible], b, c, branch[possible], start[:, possible]
    )
    assembled = gap <= closed
    missed = ~assembled & (least_gap < -closed)
    if missed.any():
        raise ArithmeticError(
            f"the loop closes at theta_{bar} = {theta[np.argmax(missed)]!r}, but"
            " Newton's method does not find it"
        )
    angles[:, ~assembled] = np.nan
    gap[~assembled] = np.nan
    if bar == 4:
        angles = np.array([angles[1] + np.pi, angles[0]])
    return Closed(assembled, np.angle(np.exp(1j * angles)), gap, start)


def _compute_angle_between(e: Array, near: float, far: float) -> Array:
    """Compute the angle between the sides e and near, by half-angle tangents.

    Bars 3 and 4 are never collinear: the corner between them is at least so far off the
    diagonal as the shorter one is at `NEARLY_IN_LINE`.
    """
    above = (e - (near - far)) * (near + far - e)
    below = (e + (near - far)) * (near + far + e)
    angle = 2.0 * np.arctan2(
        np.sqrt(np.maximum(above, 0.0)), np.sqrt(np.maximum(below, 0.0))
    )
    least = NEARLY_IN_LINE * min(near, far) / near
    return np.clip(angle, least, np.pi - least)


@np.errstate(all="ignore")
def _solve_newton(
    diagonal: ComplexArray,
    b: float,
    c: float,
    branch: Signs,
    theta: Array,
) -> tuple[Array, Array]:
    """Return theta_3, theta_4 (2, n) and the gap left (n,), by Newton's steps.

    The Jacobian's determinant is b c sin(theta_4 - theta_3), whose sign is the
    branch's. The last step is the one after which the gap falls no further on the
    branch.
    """

    def look(theta: Array) -> tuple[ComplexArray, ComplexArray, Array, Array]:
        """Return e^{i theta}, the gap, its size, inf off a branch, and the sine."""
        unit = np.exp(1j * theta)
        gap = b * unit[0] - c * unit[1] - diagonal
        sine = cross_products(*unit)
        return unit, gap, np.where(sine * branch > 0.0, np.abs(gap), np.inf), sine

    (u_3, u_4), gap, size, sine = look(theta)
    for _ in range(NEWTON_STEPS):
        # b step_3 u_3 - c step_4 u_4 = i gap
        step_3 = cross_products(1j * gap, u_4) / (b * sine)
        step_4 = cross_products(1j * gap, u_3) / (c * sine)
        trial = theta + np.array([step_3, step_4])
        _, _, trial_size, _ = look(trial)
        falls = trial_size < size
        if not falls.any():
            break
        theta = np.where(falls, trial, theta)
        (u_3, u_4), gap, size, sine = look(theta)
    return theta, size


def cross_products(u: Any, v: Any) -> Any:
    """Return u_x v_y - u_y v_x."""
    return (np.conj(u) * v).imag


def measure_cylinder(scene: Scene) -> tuple[complex, complex]:
    """Measure from the ground pin of its bar to a cylinder's ends, m.

    The end on the bar is at angle 0 of the bar; the other is on the ground.
    """
    drive = scene.drive
    assert drive is not None and drive.has_stroke
    on_ground, on_bar = sorted(
        (place for _, place in drive.ends),
        key=lambda place: place.bar,
    )
    d = scene.linkage.ground
    theta_1 = scene.linkage.ground_angle
    pivot = complex(*resolve(d, theta_1)) if on_bar.bar == 4 else 0j
    return (
        complex(*resolve(on_bar.distance, on_bar.angle)),
        place(on_ground, theta_1) - pivot,
    )


def find_angle(
    command: Command,
    motion: Motion,
    arm: complex,
    ground: complex,
) -> Command:
    """Find the bar's angle where its cylinder has the stroke, and its rates.

    The side is the one that is stated. `arm` and `ground`: as `measure_cylinder` has
    them, or as an engine measures them.
    """
    wanted = command.stated[0]
    sense = 1.0 if motion.side == "left" else -1.0
    towards = float(np.angle(ground / arm))

    def across(theta: Array) -> Array:
        return np.asarray(arm * np.exp(1j * theta) - ground)

    low = np.zeros(len(wanted))
    high = np.full(len(wanted), np.pi)
    for _ in range(_STROKE_HALVINGS):
        middle = 0.5 * (low + high)
        short = np.abs(across(towards + sense * middle)) < wanted
        low = np.where(short, middle, low)
        high = np.where(short, high, middle)
    theta = towards + sense * 0.5 * (low + high)
    if motion.stroke_speed is None:
        return command._replace(angle=theta, speed=None)
    line = across(theta)
    velocity = 1j * arm * np.exp(1j * theta)  # velocity of the end, per rad/s
    stroke = np.abs(line)
    with np.errstate(all="ignore"):
        slope = (np.conj(line) * velocity).real / stroke
        omega = motion.stroke_speed / slope
        # s s'' + s'^2 = |v|^2 + line . a, with a = alpha velocity - omega^2 arm
        centripetal = (np.conj(line) * (-arm * np.exp(1j * theta))).real * omega**2
        rest = (
            stroke * motion.stroke_acceleration
            + motion.stroke_speed**2
            - np.abs(velocity * omega) ** 2
        )
        alpha = (rest - centripetal) / (stroke * slope)
    return command._replace(angle=theta, speed=omega, acceleration=alpha)
