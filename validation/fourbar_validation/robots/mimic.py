"""A ratio in place of a loop: a joint equality's polynomial against the four-bar that it stands for."""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import click
import numpy as np

from fourbar.errors import InputError
from fourbar.quantities import OK
from fourbar.scene import Command, Scene, command
from fourbar.solve import solve
from fourbar_validation.compare.answer import Array
from fourbar_validation.compare.rows import make_plain
from fourbar_validation.engines.mujoco.robots.mimic import JointEquality
from fourbar_validation.robots.files import read_robot
from fourbar_validation.robots.guard import examine_guarded

READ = "fourbar_validation.engines.mujoco.robots.mimic:read_joint_equality"
DEGREES = (1, 2, 3, 4)
"""Degrees of the polynomials that MuJoCo's polycoef holds; URDF's mimic has degree 1."""
SAMPLES = 1001
"""Positions over the motion of the scene; a largest error between two of them is missed by some 1e-6 of it."""


@dataclass(frozen=True, slots=True)
class MimicError:
    """Largest errors of a polynomial over the motion."""

    coefficients: tuple[float, ...]
    """a0, a1, ... of (theta_2 - zero), lowest power first."""
    angle: float
    """rad."""
    ratio: float
    """Of omega_4/omega_2."""


@dataclass(frozen=True, slots=True)
class MimicReport:
    """What the polynomial of a file loses, and what others would."""

    equality: JointEquality
    swing: tuple[float, float]
    """First and last theta_2 of the motion, rad."""
    file: MimicError
    """Angle counted from the position of the loop at the zero of the file."""
    shifted: float
    """Largest error of the angle where the constant is free, rad."""
    fitted: tuple[MimicError, ...]
    """Polynomials of DEGREES with the smallest largest error of the angle."""


def measure_mimic(path: Path, joint: str, scene: Scene) -> MimicReport:
    """Hold the polynomial of a joint against the loop of a scene over its motion.

    The leader's position is taken as theta_2, and the follower's zero is theta_4 where the leader is at its own.

    Raises
    ------
    InputError : no such equality, or the loop does not close at the zero of the file or over the motion.
    """
    file = read_robot(path)
    with examine_guarded(path) as examined:
        equality: JointEquality = examined(READ, file, joint)
    commanded = command(scene)
    low, high = float(commanded.theta_2.min()), float(commanded.theta_2.max())
    if low == high:
        raise InputError(
            "motion.theta_2", low, "must be a range: a ratio is of a motion"
        )
    theta_2 = np.linspace(low, high, SAMPLES)
    branch = int(commanded.branch[0])
    theta_4, ratio = _follow(scene, theta_2, branch)
    zero = equality.leader_zero
    through_zero = np.unique(np.append(theta_2, zero))
    continued, _ = _follow(scene, through_zero, branch)
    origin = float(continued[np.searchsorted(through_zero, zero)])
    turned = equality.sense * (theta_4 - origin)
    ratio = equality.sense * ratio
    x = theta_2 - zero
    own = _measure(equality.coefficients, x, turned, ratio)
    left = np.polynomial.polynomial.polyval(x, own.coefficients) - turned
    fitted = tuple(
        _measure(fit_minimax(x, turned, degree), x, turned, ratio) for degree in DEGREES
    )
    return MimicReport(equality, (low, high), own, float(np.ptp(left)) / 2.0, fitted)


def _follow(scene: Scene, theta_2: Array, branch: int) -> tuple[Array, Array]:
    """Return theta_4, continuous, and omega_4/omega_2 at angles of bar 2."""
    moving = replace(scene, motion=scene.motion.replace(speed=1.0, acceleration=0.0))
    branches = np.full(len(theta_2), branch, dtype=np.int8)
    solution = solve(moving, "velocity", at=Command(theta_2, branches, 1.0, 0.0))
    closed = solution.status_code == OK
    if not closed.all():
        angle = math.degrees(float(theta_2[~closed][0]))
        raise InputError(
            "motion.theta_2",
            f"{angle:.6g} deg",
            "the loop does not close there; the motion and the zero of the file's joints must be in its range",
        )
    assert solution.omega_4 is not None
    return np.unwrap(solution.theta_4), np.asarray(solution.omega_4)


def _measure(
    coefficients: tuple[float, ...], x: Array, turned: Array, ratio: Array
) -> MimicError:
    """Measure the largest errors of a polynomial."""
    polynomial = np.polynomial.Polynomial(coefficients)
    angle = float(np.abs(polynomial(x) - turned).max())
    speed = float(np.abs(polynomial.deriv()(x) - ratio).max())
    return MimicError(tuple(coefficients), angle, speed)


def fit_minimax(x: Array, y: Array, degree: int) -> tuple[float, ...]:
    """Fit a polynomial with the smallest largest error, lowest power first.

    minimize t subject to |p(x_i) - y_i| <= t, a linear program in the coefficients of Chebyshev's polynomials.
    """
    from scipy.optimize import linprog

    domain = (float(x.min()), float(x.max()))
    size = float(np.ptp(y)) or 1.0
    basis = np.polynomial.chebyshev.chebvander(
        (2.0 * x - sum(domain)) / (domain[1] - domain[0]), degree
    )
    middle = 0.5 * float(y.max() + y.min())
    wanted = (y - middle) / size
    ones = np.ones((len(x), 1))
    above = np.block([[basis, -ones], [-basis, -ones]])
    bounds = np.concatenate([wanted, -wanted])
    cost = np.zeros(degree + 2)
    cost[-1] = 1.0
    best = linprog(cost, A_ub=above, b_ub=bounds, bounds=(None, None), method="highs")
    fitted = np.polynomial.Chebyshev(size * best.x[:-1], domain=domain)
    power = fitted.convert(kind=np.polynomial.Polynomial).coef
    coefficients = np.zeros(degree + 1)
    coefficients[: len(power)] = power
    coefficients[0] += middle
    return tuple(coefficients.tolist())


def show_mimic(report: MimicReport) -> None:
    """Print what the polynomial of the file loses, and the best of each degree."""
    equality, own = report.equality, report.file
    low, high = (f"{math.degrees(angle):.6g}" for angle in report.swing)
    _say(
        f"{equality.follower} follows {equality.leader} by polycoef {_write(equality.coefficients)}; "
        f"theta_2 is {equality.leader}, from {low} to {high} deg"
    )
    _say(
        f"largest error: angle {_deg(own.angle)} deg (with a free constant {_deg(report.shifted)}), "
        f"ratio omega_4/omega_2 {own.ratio:.4g}"
    )
    _say("smallest largest error of the angle, by degree:")
    for degree, best in zip(DEGREES, report.fitted, strict=True):
        padded = (*best.coefficients, *[0.0] * (5 - len(best.coefficients)))
        _say(
            f"{degree}: angle {_deg(best.angle)} deg, ratio {best.ratio:.4g}, "
            f'polycoef="{_write(padded)}"'
        )


def _deg(angle: float) -> str:
    return f"{math.degrees(angle):.4g}"


def _write(coefficients: tuple[float, ...]) -> str:
    return " ".join(f"{number:.10g}" for number in coefficients)


def _say(text: str) -> None:
    click.echo(make_plain(text))
