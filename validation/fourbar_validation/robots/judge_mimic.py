"""A ratio in place of a loop.

A joint equality's polynomial is held against the four-bar that it stands for.
"""

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import click
import numpy as np
from numpy.polynomial import Chebyshev, Polynomial

from fourbar.errors import InputError
from fourbar.linkage import record, require
from fourbar.quantities import CHANGE_POINT, OK, Array
from fourbar.scene import Command, Scene, command
from fourbar.solving import solve
from fourbar_validation.engines.mujoco.robots.measure import WHOLE_TURN
from fourbar_validation.engines.mujoco.robots.mimic import JointEquality, is_same_angle
from fourbar_validation.report.sentences import print_sentence
from fourbar_validation.robots.files import read_robot
from fourbar_validation.robots.guard import examine_guarded

READ = "fourbar_validation.engines.mujoco.robots.mimic:read_joint_equality"
POLYNOMIAL_DEGREES = (1, 2, 3, 4)
"""Degrees of the polynomials of MuJoCo's polycoef; URDF's mimic has degree 1."""
_DECIMALS = 11
"""Decimals beyond which angles in degrees, ratios and coefficients are round-off."""
POSITIONS_FITTED = 1001
"""Positions over the motion of the scene. A largest error between two of them is missed
by some 1e-6 of it.
"""
FEWEST_POSITIONS = 6
"""Least positions of the scene from which a polynomial of degree 4 is fitted by least
squares with an error to tell.
"""
SQUARES = "least squares"
"""Name of the fits to the scene's positions."""
MINIMAX = "smallest largest error"
"""Name of the fits whose largest error of the angle is least."""
ROW = "{:6}  {:22}  {:>10}  {:>8}"
"""Format of a row of the table of fits; its polycoef stands on a line below it."""


@record
class _MimicError:
    """Largest errors of a polynomial over the motion."""

    polynomial: Polynomial
    """Over the leader counted from its zero; over theta_2 where no zero of the follower
    is known.
    """
    angle: float
    """rad."""
    ratio: float
    """Largest error of the follower's speed over omega_2."""


@record
class _MimicReport:
    """Losses of the polynomial of a file, and of others."""

    equality: JointEquality
    swing: tuple[float, float]
    """First and last theta_2 of the motion, rad."""
    ratio: float
    """Largest error of the follower's speed over omega_2; NaN if it depends on an
    unknown zero.
    """
    zeros: tuple[tuple[float, float], ...]
    """Largest error counted from an angle of the follower's bar at the leader's zero,
    and that angle, rad. The loop and the file may have different ones: the better comes
    first. None is known of a file without a picture whose loop is open there.
    """
    shifted: float
    """Largest error of the angle with the constant of least squares, rad. It replaces
    the constant of the file.
    """
    centred: float
    """Largest error of the angle with the constant that makes it smallest, rad."""
    fits: Mapping[str, list[_MimicError]]
    """Polynomials of POLYNOMIAL_DEGREES by SQUARES and by MINIMAX."""


def measure_mimic(
    path: Path,
    joint: str,
    scene: Scene,
    assets: Path | None = None,
    angles: Mapping[str, str] | None = None,
) -> _MimicReport:
    """Hold the polynomial of a joint against the loop of a scene over its motion.

    The leader's zero is the theta_2 at which the file has the input. The follower's is
    the angle between its two bars there: that of the loop, or that of the bars in the
    file, whichever the polynomial fits better. Of a scene over a whole turn, or without
    a range, the motion is the range of the leader, if the file has one.

    Parameters
    ----------
    assets : a further folder in which includes and meshes are looked for.
    angles : "theta_2" in the rest pose of the file, with a unit. It wins over what the
        file tells.

    Raises
    ------
    InputError : no such equality, an angle of another bar, or the loop does not close
        over the motion.
    """
    file = read_robot(path, assets)
    stated = None
    for name, text in (angles or {}).items():
        if name != "theta_2":
            raise InputError(
                "--pose",
                name,
                "must be theta_2 beside --mimic, the angle of bar 2 in the rest pose of"
                " the file",
            )
        stated = require(f"--pose {name}", text, "rad")
    with examine_guarded(file) as examined:
        equality: JointEquality = examined(READ, file, joint, scene, stated)
    positions = _place_leader(scene, equality)
    low, high = positions[[0, -1]].tolist()
    branch = int(command(scene).branch[0])
    theta_2 = np.union1d(np.linspace(low, high, POSITIONS_FITTED), positions)
    angle, ratio = _follow(scene, theta_2, branch, equality)
    x = theta_2
    zeros = [equality.follower_zero]
    if not math.isnan(equality.theta_2):
        middle = 0.5 * (low + high)
        rest = middle + math.remainder(equality.theta_2 - middle, math.tau)
        x = equality.side * (theta_2 - rest)
        with suppress(InputError):  # the loop is open there
            (in_loop,), _ = _follow(scene, np.array([rest]), branch, equality)
            if is_same_angle(in_loop, zeros[0]):
                zeros.clear()
            zeros.append(float(in_loop))
    # both joints in their own senses
    side = equality.side * equality.sense
    turned = side * angle
    own = Polynomial(equality.coefficients)
    left = own(x) - turned
    ratio_left = own.deriv()(x) - equality.sense * ratio
    if math.isnan(equality.theta_2) and any(own.coef[2:]):
        ratio_left = left = np.full_like(left, math.nan)
    errors = sorted(
        (_find_largest(_drop_turns(left + side * zero)), zero)
        for zero in zeros
        if not math.isnan(zero)
    )
    y = angle
    if errors:
        _, zero = errors[0]
        missed = left + side * zero
        y = turned - side * zero + (missed - _drop_turns(missed))
        ratio = equality.sense * ratio
    else:
        x = theta_2
    at_positions = np.searchsorted(theta_2, positions)

    def measure(fitted: Polynomial) -> _MimicError:
        largest = _find_largest(fitted(x) - y)
        return _MimicError(fitted, largest, _find_largest(fitted.deriv()(x) - ratio))

    fits: dict[str, list[_MimicError]] = {SQUARES: [], MINIMAX: []}
    for degree in POLYNOMIAL_DEGREES:
        squares = Polynomial.fit(x[at_positions], y[at_positions], degree).convert()
        fits[SQUARES].append(measure(squares))
        fits[MINIMAX].append(measure(fit_minimax(x, y, degree)))
    return _MimicReport(
        equality,
        (low, high),
        _find_largest(ratio_left),
        tuple(errors),
        shifted=_find_largest(left - left[at_positions].mean()),
        centred=float(np.ptp(left)) / 2.0,
        fits=fits,
    )


def _find_largest(errors: Array) -> float:
    return float(np.abs(errors).max())


def _place_leader(scene: Scene, equality: JointEquality) -> Array:
    """List the angles of bar 2 over the motion, rad.

    A scene that states no range, or a whole turn, has that of the leader's limits, as
    far as the loop closes.

    Raises InputError where they are too few.
    """
    motion = scene.motion
    positions = np.unique(command(scene).theta_2)
    ends = positions[[0, -1]]
    named = motion.angle is not None or motion.law is not None
    turns = np.ptp(ends) >= WHOLE_TURN
    if equality.swing is not None and (turns or not named):
        low, high = equality.swing
        if not turns:
            away = ends.mean() - equality.theta_2
            closed = ends - math.tau * np.round(away / math.tau)
            low, high = np.clip(equality.swing, *closed)
        positions = np.unique(np.linspace(low, high, len(positions)))
    if len(positions) < FEWEST_POSITIONS:
        one = len(positions) == 1
        raise InputError(
            "motion.theta_2",
            float(positions[0]) if one else f"{len(positions)} positions",
            f"must be a range of at least {FEWEST_POSITIONS} positions:"
            " a ratio is of a motion",
        )
    return positions


def _drop_turns(angles: Array) -> Array:
    """Return angles without the whole turns of their mean."""
    return np.asarray(angles - math.tau * np.round(angles.mean() / math.tau))


def _follow(
    scene: Scene,
    theta_2: Array,
    branch: int,
    equality: JointEquality,
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
        reason = "the loop does not close there; the motion must be in its range"
        if solution.status_code[~closed][0] == CHANGE_POINT:
            reason = (
                "a change point, where the output may go on in two ways: state a motion"
                " that does not go through it"
            )
            if equality.limits is not None and math.isnan(equality.theta_2):
                ends = " to ".join(map(_deg, equality.limits))
                reason += (
                    "; or state by --pose theta_2=ANGLE the angle of bar 2 in the rest"
                    f" pose of the file, where {equality.leader} turns from {ends} deg"
                )
        raise InputError("motion.theta_2", f"{angle:.6g} deg", reason)
    still = np.zeros_like(theta_2)
    theta = np.array([still, theta_2, solution.theta_3, solution.theta_4])
    omega = np.array([still, still + 1.0, solution.omega_3, solution.omega_4])
    turned, bearer = (bar - 1 for bar in equality.bars)
    return np.unwrap(theta[turned] - theta[bearer]), omega[turned] - omega[bearer]


def fit_minimax(x: Array, y: Array, degree: int) -> Polynomial:
    """Fit a polynomial with the smallest largest error.

    minimize t subject to |p(x_i) - y_i| <= t, a linear program in the coefficients of
    Chebyshev's polynomials.
    """
    from scipy.optimize import linprog

    fitted = Chebyshev.fit(x, y, degree)
    left = y - fitted(x)
    size = float(np.abs(left).max()) or 1.0
    powers = range(degree + 1)
    basis = np.array([Chebyshev.basis(k, fitted.domain)(x) for k in powers]).T
    ones = np.ones((len(x), 1))
    above = np.block([[basis, -ones], [-basis, -ones]])
    limits = np.concatenate([left, -left]) / size
    cost = np.eye(degree + 2)[-1]
    best = linprog(cost, A_ub=above, b_ub=limits, bounds=(None, None))
    fitted += Chebyshev(size * best.x[:-1], fitted.domain)
    return fitted.convert(kind=Polynomial)


def show_mimic(report: _MimicReport) -> None:
    """Print what the polynomial of the file loses, and the best of each degree."""
    equality = report.equality
    angle = _write_angle("theta", equality)
    print_sentence(
        f"{equality.follower} ({angle}) follows"
        f" {equality.leader} by polycoef"
        f" {_write_coefficients(Polynomial(equality.coefficients))};"
        f" {_write_theta_2(report)}"
    )
    if equality.remark:
        print_sentence(equality.remark)
    if not equality.is_side_told:
        print_sentence(
            "nothing tells from which side the scene is drawn: the tip of the axis of"
            f" {equality.leader} is assumed, and --pose theta_2=ANGLE states another"
            " where theta_2 differs there; where it does not, a mirrored scene (angles"
            " and y of pins negated, the other branch) is seen from behind"
        )
    print_sentence(_write_errors(report))
    for largest, zero in report.zeros[1:]:
        print_sentence(
            f"{angle} at the zero of the file is another in the loop than in the"
            f" picture of the file: through {_deg(math.remainder(zero, math.tau))} deg"
            f" the largest error is {_deg(largest)} deg"
        )
    label = "polycoef"
    if not report.zeros:
        label = "a0 to a4"
        print_sentence(
            f"the polynomials below need no zero: {angle} = a0 + a1 theta_2 + a2"
            " theta_2^2 + ..., in rad"
        )
    click.echo(ROW.format("degree", "fit", "angle, deg", "ratio"))
    for row, degree in enumerate(POLYNOMIAL_DEGREES):
        for fit, errors in report.fits.items():
            error = errors[row]
            sizes = (_deg(error.angle), _write(error.ratio, 4))
            click.echo(ROW.format(str(degree), fit, *sizes))
            polycoef = _write_coefficients(error.polynomial)
            click.echo(f"{'':8}{label} {polycoef}")


def _write_angle(symbol: str, equality: JointEquality) -> str:
    """Write the follower's angle or speed: that of its bar less that of its bearer."""
    turned, bearer = equality.bars
    return f"{symbol}_{turned}" + (f" - {symbol}_{bearer}" if bearer > 1 else "")


def _write_theta_2(report: _MimicReport) -> str:
    """Write theta_2 as what the file makes it: the leader and an angle."""
    equality = report.equality
    low, high = (f"{math.degrees(angle):.6g}" for angle in report.swing)
    if math.isnan(equality.theta_2):
        return (
            f"theta_2 runs from {low} to {high} deg; the file does not tell it at the"
            f" zero of {equality.leader}, and --pose theta_2=ANGLE states it"
        )
    zero = equality.theta_2 - equality.side * equality.leader_zero
    angle = f"{math.degrees(math.remainder(zero, math.tau)) + 0.0:.6g} deg"
    sign = "+" if equality.side > 0.0 else "-"
    whose = ", the range of the file" if report.swing == equality.swing else ""
    return (
        f"theta_2 is {angle} {sign} {equality.leader}, from {low} to {high} deg{whose}"
    )


def _write_errors(report: _MimicReport) -> str:
    """Write the errors of the polynomial of the file that the known zeros tell."""
    equality = report.equality
    if math.isnan(report.centred):
        return "what the polynomial of the file loses depends on theta_2 at that zero"
    angle = _write_angle("theta", equality)
    speed = _write_angle("omega", equality)
    if " " in speed:
        speed = f"({speed})"
    through_zero = ""
    missing = ""
    if report.zeros:
        largest, zero = report.zeros[0]
        in_file = is_same_angle(zero, equality.follower_zero)
        through_zero = (
            f"{_deg(largest)} deg through the zero of the file, where {angle}"
            f"{'' if in_file else ' of the loop'} is"
            f" {_deg(math.remainder(zero, math.tau))} deg; "
        )
    elif not math.isnan(equality.theta_2):
        missing = (
            "; the loop does not close at the zero of the file, which does not tell"
            f" {angle} there"
        )
    return (
        f"largest error of the angle: {through_zero}"
        f"{_deg(report.shifted)} deg with the constant of least squares, "
        f"{_deg(report.centred)} deg with the best one; "
        f"of the ratio {speed}/omega_2: "
        f"{_write(report.ratio, 4)}{missing}"
    )


def _deg(angle: float) -> str:
    return _write(math.degrees(angle), 5)


def _write_coefficients(polynomial: Polynomial) -> str:
    """Write a0 to a4."""
    missing = max(POLYNOMIAL_DEGREES) + 1 - len(polynomial.coef)
    return " ".join(_write(a, 7) for a in np.pad(polynomial.coef, (0, missing)))


def _write(number: float, digits: int) -> str:
    """Write a number, and 0 where it is round-off."""
    return f"{round(number, _DECIMALS) + 0.0:.{digits}g}"
