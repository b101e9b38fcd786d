"""A ratio in place of a loop.

A joint equality's polynomial is held against the four-bar that it stands for.
"""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import click
import numpy as np

from fourbar.errors import InputError
from fourbar.quantities import CHANGE_POINT, OK, Array
from fourbar.scene import Command, Scene, command
from fourbar.solving import solve
from fourbar_validation.engines.mujoco.robots.mimic import JointEquality
from fourbar_validation.report.sentences import print_sentence
from fourbar_validation.robots.files import read_robot
from fourbar_validation.robots.guard import examine_guarded

READ = "fourbar_validation.engines.mujoco.robots.mimic:read_joint_equality"
POLYNOMIAL_DEGREES = (1, 2, 3, 4)
"""Degrees of the polynomials of MuJoCo's polycoef; URDF's mimic has degree 1."""
POSITIONS_FITTED = 1001
"""Positions over the motion of the scene. A largest error between two of them is missed
by some 1e-6 of it.
"""
FEWEST_POSITIONS = 6
"""Least positions of the scene from which a polynomial of degree 4 is fitted by least
squares with an error to tell.
"""
FIT_HEADINGS = ("degree", "fit", "angle, deg", "ratio")
_FITS = ("least squares", "smallest largest error")
"""Names of the fits of `_MimicReport.squares` and `_MimicReport.fitted`."""
ROW = "{:6}  {:22}  {:>10}  {:>8}"
"""Format of a row under FIT_HEADINGS; its polycoef stands on a line below it."""


@dataclass(frozen=True, slots=True)
class _MimicError:
    """Largest errors of a polynomial over the motion."""

    coefficients: tuple[float, ...]
    """a0 to a4 of the leader counted from its zero."""
    angle: float
    """rad."""
    ratio: float
    """Largest error of the follower's speed over omega_2."""


@dataclass(frozen=True, slots=True)
class _MimicReport:
    """Losses of the polynomial of a file, and of others."""

    equality: JointEquality
    swing: tuple[float, float]
    """First and last theta_2 of the motion, rad."""
    file: _MimicError
    """Angle counted from the position of the loop at the zero of the file."""
    shifted: float
    """Largest error of the angle with the constant of least squares, rad. It replaces
    the constant of the file.
    """
    centred: float
    """Largest error of the angle with the constant that makes it smallest, rad."""
    squares: tuple[_MimicError, ...]
    """Polynomials of POLYNOMIAL_DEGREES by least squares over the scene's positions."""
    fitted: tuple[_MimicError, ...]
    """Polynomials of POLYNOMIAL_DEGREES whose largest error of the angle is least."""


def measure_mimic(
    path: Path,
    joint: str,
    scene: Scene,
    assets: Path | None = None,
) -> _MimicReport:
    """Hold the polynomial of a joint against the loop of a scene over its motion.

    The leader's zero is the theta_2 at which the file has the input, and the follower's
    is the angle between its two bars there. Where the file does not tell,
    the leader's position is theta_2.

    Parameters
    ----------
    assets : a further folder in which includes and meshes are looked for.

    Raises
    ------
    InputError : no such equality, or the loop does not close at the zero of the file or
        over the motion.
    """
    file = read_robot(path, assets)
    with examine_guarded(file) as examined:
        equality: JointEquality = examined(READ, file, joint, scene)
    positions = np.unique(command(scene).theta_2)
    low = float(positions[0])
    high = float(positions[-1])
    if len(positions) < FEWEST_POSITIONS:
        raise InputError(
            "motion.theta_2",
            low if low == high else f"{len(positions)} positions",
            f"must be a range of at least {FEWEST_POSITIONS} positions:"
            " a ratio is of a motion",
        )
    branch = int(command(scene).branch[0])
    zero = _find_zero(equality, 0.5 * (low + high))
    theta_2 = np.union1d(np.linspace(low, high, POSITIONS_FITTED), positions)
    through_zero = np.union1d(theta_2, zero)
    angle, ratio = _follow(scene, through_zero, branch, equality.bars)
    origin = angle[np.searchsorted(through_zero, zero)]
    inside = np.searchsorted(through_zero, theta_2)
    # both joints from their zeros, each in its own sense
    turned = equality.side * equality.sense * (angle - origin)[inside]
    ratio = equality.sense * ratio[inside]
    x = equality.side * (theta_2 - zero)
    own = _measure_polynomial(equality.coefficients, x, turned, ratio)
    left = np.polynomial.polynomial.polyval(x, own.coefficients) - turned
    stated = np.searchsorted(theta_2, positions)
    squares = []
    fitted = []
    for degree in POLYNOMIAL_DEGREES:
        least_squares = fit_squares(x[stated], turned[stated], degree)
        minimax = fit_minimax(x, turned, degree)
        squares.append(_measure_polynomial(least_squares, x, turned, ratio))
        fitted.append(_measure_polynomial(minimax, x, turned, ratio))
    return _MimicReport(
        equality,
        (low, high),
        own,
        shifted=float(np.abs(left - left[stated].mean()).max()),
        centred=float(np.ptp(left)) / 2.0,
        squares=tuple(squares),
        fitted=tuple(fitted),
    )


def _find_zero(equality: JointEquality, middle: float) -> float:
    """Return theta_2 at the leader's zero, rad.

    Whole turns bring what is read from the file near the motion.
    """
    if equality.theta_2 is None:
        return equality.leader_zero
    return middle + math.remainder(equality.theta_2 - middle, math.tau)


def _follow(
    scene: Scene,
    theta_2: Array,
    branch: int,
    bars: tuple[int, int],
) -> tuple[Array, Array]:
    """Return the angle of a bar against another, rad, and its speed over omega_2.

    Both are at given angles of bar 2; the angle is continuous.
    """
    moving = replace(scene, motion=scene.motion.replace(speed=1.0, acceleration=0.0))
    branches = np.full(len(theta_2), branch, dtype=np.int8)
    solution = solve(moving, "velocity", at=Command(theta_2, branches, 1.0, 0.0))
    closed = solution.status_code == OK
    if not closed.all():
        angle = math.degrees(float(theta_2[~closed][0]))
        reason = (
            "the loop does not close there; the motion and the zero of the file's"
            " joints must be in its range"
        )
        if solution.status_code[~closed][0] == CHANGE_POINT:
            reason = (
                "a change point, where the output may go on in two ways; neither the"
                " motion nor the zero of the file's joints may be there"
            )
        raise InputError("motion.theta_2", f"{angle:.6g} deg", reason)
    still = np.zeros_like(theta_2)
    theta = [still, theta_2, solution.theta_3, solution.theta_4]
    omega = [still, still + 1.0, solution.omega_3, solution.omega_4]
    turned, bearer = (bar - 1 for bar in bars)
    turn = np.asarray(theta[turned]) - np.asarray(theta[bearer])
    ratio = np.asarray(omega[turned]) - np.asarray(omega[bearer])
    return np.unwrap(turn), ratio


def _measure_polynomial(
    coefficients: tuple[float, ...],
    x: Array,
    turned: Array,
    ratio: Array,
) -> _MimicError:
    """Measure the largest errors of a polynomial."""
    polynomial = np.polynomial.Polynomial(coefficients)
    angle = float(np.abs(polynomial(x) - turned).max())
    speed = float(np.abs(polynomial.deriv()(x) - ratio).max())
    return _MimicError(tuple(coefficients), angle, speed)


def fit_squares(
    x: Array,
    y: Array,
    degree: int,
) -> tuple[float, ...]:
    """Fit a polynomial by least squares."""
    return _list_powers(np.polynomial.Polynomial.fit(x, y, degree).convert())


def _list_powers(polynomial: np.polynomial.Polynomial) -> tuple[float, ...]:
    """Return the coefficients of polycoef, (5,), lowest power first."""
    missing = max(POLYNOMIAL_DEGREES) + 1 - len(polynomial.coef)
    return tuple(np.pad(polynomial.coef, (0, missing)).tolist())


def fit_minimax(
    x: Array,
    y: Array,
    degree: int,
) -> tuple[float, ...]:
    """Fit a polynomial with the smallest largest error.

    minimize t subject to |p(x_i) - y_i| <= t, a linear program in the coefficients of
    Chebyshev's polynomials.
    """
    from scipy.optimize import linprog

    low = float(x.min())
    high = float(x.max())
    size = float(np.ptp(y)) or 1.0
    scaled = (2.0 * x - (low + high)) / (high - low)
    basis = np.polynomial.chebyshev.chebvander(scaled, degree)
    middle = 0.5 * float(y.max() + y.min())
    wanted = (y - middle) / size
    ones = np.ones((len(x), 1))
    above = np.block(
        [
            [basis, -ones],
            [-basis, -ones],
        ]
    )
    bounds = np.concatenate([wanted, -wanted])
    cost = np.zeros(degree + 2)
    cost[-1] = 1.0
    best = linprog(
        cost,
        A_ub=above,
        b_ub=bounds,
        bounds=(None, None),
        method="highs",
    )
    fitted = np.polynomial.Chebyshev(size * best.x[:-1], domain=(low, high))
    return _list_powers(fitted.convert(kind=np.polynomial.Polynomial) + middle)


def show_mimic(report: _MimicReport) -> None:
    """Print what the polynomial of the file loses, and the best of each degree."""
    equality = report.equality
    own = report.file
    low, high = (f"{math.degrees(angle):.6g}" for angle in report.swing)
    print_sentence(
        f"{equality.follower} ({_write_angle('theta', equality)}) follows"
        f" {equality.leader} by polycoef"
        f" {_write_coefficients(equality.coefficients)};"
        f" theta_2 is {_write_theta_2(equality)}, from {low} to {high} deg"
    )
    print_sentence(
        f"largest error of the angle: {_deg(own.angle)} deg through the zero of the "
        f"file; {_deg(report.shifted)} deg with the constant of least squares, "
        f"{_deg(report.centred)} deg with the best one; "
        f"of the ratio {_write_ratio(equality)}: {own.ratio:.4g}"
    )
    click.echo(ROW.format(*FIT_HEADINGS))
    for degree, *errors in zip(
        POLYNOMIAL_DEGREES,
        report.squares,
        report.fitted,
        strict=True,
    ):
        for fit, error in zip(_FITS, errors, strict=True):
            polycoef = _write_coefficients(error.coefficients)
            ratio = f"{error.ratio:.4g}"
            click.echo(ROW.format(str(degree), fit, _deg(error.angle), ratio))
            click.echo(f"{'':8}polycoef {polycoef}")


def _write_angle(symbol: str, equality: JointEquality) -> str:
    """Write the follower's angle or speed: that of its bar less that of its bearer."""
    turned, bearer = equality.bars
    return f"{symbol}_{turned}" + (f" - {symbol}_{bearer}" if bearer > 1 else "")


def _write_ratio(equality: JointEquality) -> str:
    speed = _write_angle("omega", equality)
    return f"({speed})/omega_2" if " " in speed else f"{speed}/omega_2"


def _write_theta_2(equality: JointEquality) -> str:
    """Write theta_2 as what the file makes it: the leader and an angle."""
    if equality.theta_2 is None:
        return (
            f"{equality.leader} (the file does not tell its zero: a site at the end of"
            " the input bar, and a joint of the output on the ground, would)"
        )
    zero = equality.theta_2 - equality.side * equality.leader_zero
    angle = f"{math.degrees(math.remainder(zero, math.tau)) + 0.0:.6g} deg"
    sign = "+" if equality.side > 0.0 else "-"
    return f"{angle} {sign} {equality.leader}"


def _deg(angle: float) -> str:
    return f"{math.degrees(angle):.5g}"


def _write_coefficients(coefficients: tuple[float, ...]) -> str:
    return " ".join(f"{number:.7g}" for number in coefficients)
