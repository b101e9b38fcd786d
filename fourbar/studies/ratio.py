"""The loop as a gear: omega_4/omega_2, torque ratio, reflected inertia; and polynomials that can take its place.

A mimic joint holds theta_4 = P(theta_2) where a simulator has no loop. What it costs is the difference of angle, of
speed P' - omega_4/omega_2, and of the torque on the input, by virtual work with the polynomials in the place of the
angles and of their derivatives:
    T_2 = J q'' + J'/2 q'^2 - Q.
"""

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import Chebyshev, Polynomial

from fourbar.effects.actions import Actions
from fourbar.errors import InputError, expect
from fourbar.evaluation.case import Case
from fourbar.formulas.mobility import TURN, change_points
from fourbar.formulas.motion import Coefficients, State, rates
from fourbar.formulas.torque import half_slope, inertia
from fourbar.linkage import require_whole
from fourbar.quantities import OK
from fourbar.scene import Command, Scene, command
from fourbar.scene.motion import Sweep
from fourbar.solution import Array
from fourbar.solve import solve
from fourbar.studies.interval import find_interval

MOST = 4
"""Degree of MuJoCo's `polycoef`; URDF and SDF hold 1."""
SAMPLES = 2160
"""Intervals of the range: between two samples an error changes by a part of 1e-3 of itself, its square."""


class Error(NamedTuple):
    """The greatest error over the range, and where."""

    value: float
    theta_2: float


class Fit(NamedTuple):
    """Polynomials in theta_2 - about (rad), lowest power first, for the output and the coupler."""

    degree: int
    about: float
    """Middle of the range, rad."""
    theta_4: tuple[float, ...]
    """Of theta_4, rad."""
    joint_A: tuple[float, ...]
    """Of theta_3 - theta_2, rad, by which the coupler follows."""
    angle: Error
    """Of theta_4, rad."""
    speed: Error
    """Of omega_4/omega_2."""
    torque: Error
    """Of the torque on the input, N m, at the scene's speed and acceleration; at rest where it states none."""


class GearRatio(NamedTuple):
    """What `ratio` returns: arrays over positions of the range, (n,)."""

    theta_2: Array
    """rad."""
    omega_ratio: Array
    """omega_4/omega_2."""
    torque_ratio: Array
    """Torque that the output gives for one on the input, without losses: omega_2/omega_4; NaN where bar 4 stands."""
    reflected_inertia: Array
    """All that moves, as an inertia on the input, kg m^2."""
    torque: Array
    """On the input, N m: what the errors of torque are errors of."""
    fits: tuple[Fit, ...]
    """Of degree 1, 2, ... up to the one asked for."""


class _OpenActions(Actions):
    """Of polynomials in the place of the loop, which leave it open at B: a spring across that pin works there too."""

    pull = Actions.pull_ends


def ratio(scene: Scene, degree: int = MOST) -> GearRatio:
    """Compute the transmission of a linkage over the range of its scene, and the polynomials in its place.

    The range is the sweep or law of the scene; where it states a single angle, or none, all that the input can reach
    on its branch but for 1 deg at its limits.

    Parameters
    ----------
    degree : of the highest polynomial, 1 to 4.

    Raises
    ------
    InputError : another degree; friction that depends on pin forces, which a mimic joint does not have; or the linkage
        does not assemble, or stands at a limit of the input, somewhere in the range.
    """
    expect("scene", scene, Scene)
    degree = require_whole("degree", degree, range(1, MOST + 1), f"must be 1 to {MOST}")
    for term in scene.effects:
        if term.loaded_pins:
            raise InputError(f"effects.{term.key}", None, "needs pin forces, which a mimic joint does not have")
    at = _list_positions(scene)
    low, high = float(at.theta_2.min()), float(at.theta_2.max())
    for point in change_points(scene.linkage) if scene.motion.through == "sign" else ():
        if math.ceil((low - point) / TURN) <= math.floor((high - point) / TURN):
            allowed = 'at the change point the branches meet; state a sweep beside it, or through = "follow"'
            raise InputError("motion.theta_2", point, allowed)
    solution = solve(scene, "velocity", at=at)
    if (solution.status_code != OK).any():
        bad = int(np.argmax(solution.status_code != OK))
        where = f"the range of a mimic joint has no limit; here the position is {solution.status[bad]}"
        raise InputError("motion.theta_2", float(at.theta_2[bad]), where)
    with np.errstate(all="ignore"):
        case = Case.of(scene)
        case = case.started(Command(at.theta_2[0], at.branch[0], 0.0, 0.0)) if scene.counts_turns else case
        state = case.at(at)
        h4 = np.broadcast_to(state.k.h4, at.theta_2.shape)
        torque = _compute_torque(case, state, at.alpha_2)
        fits = tuple(
            _fit_polynomials(case, state, at, (solution.theta_3 - at.theta_2, solution.theta_4), torque, each)
            for each in range(1, degree + 1)
        )
        J = sum(inertia(case.lengths.a, case.bodies, state.at, state.k))
        through = np.where(h4 == 0.0, np.nan, 1.0 / h4)
        return GearRatio(at.theta_2, h4, through, np.broadcast_to(J, h4.shape), torque, fits)


def _list_positions(scene: Scene) -> Command:
    """Positions of the range, with the scene's speed and acceleration; at rest where it states none."""
    at = command(scene)
    if at.commanded != "theta_2":
        found = solve(scene, "position" if at.speed is None else "acceleration", at=at)
        turning = np.diff(found.theta_2)
        if (found.status_code != OK).any() or not ((turning > 0.0).all() or (turning < 0.0).all()) or len(turning) < 1:
            allowed = "must be a range over which theta_2 rises or falls throughout, as a mimic joint is of theta_2"
            raise InputError(f"motion.{at.commanded}", scene.motion.angle, allowed)
        speed, acceleration = (0.0 if rate is None else rate for rate in (found.omega_2, found.alpha_2))
        return Command(found.theta_2, found.branch, speed, acceleration)
    if scene.motion.law is not None:
        return at
    if isinstance(scene.motion.theta_2, Sweep):
        low, high = float(at.theta_2.min()), float(at.theta_2.max())
        if low == high:
            raise InputError("motion.theta_2", scene.motion.theta_2, "must sweep over a range")
    else:
        low, high = find_interval(replace(scene, drive_bar=2, drive=None))[0][0]
    at = command(replace(scene, motion=replace(scene.motion, theta_2=Sweep(low, high, SAMPLES), free=None)))
    return at._replace(speed=scene.motion.speed or 0.0)


def _compute_torque(case: Case, state: State, alpha_2: Any) -> Array:
    """Compute the torque on the input, by virtual work; the state need not close the loop."""
    actions = _OpenActions(state, case.bodies)
    for term in case.terms:
        term.act(actions, state)
    a, at, k = case.lengths.a, state.at, state.k
    inertial = sum(inertia(a, case.bodies, at, k)) * alpha_2 + half_slope(a, case.bodies, at, k) * state.speed**2
    return np.broadcast_to(inertial - actions.work()[0], np.shape(state.theta_2))


def _fit_polynomials(
    case: Case, state: State, at: Command, angles: tuple[Array, Array], torque: Array, degree: int
) -> Fit:
    """Fit polynomials whose greatest error is less than twice the least one, and compare them with the loop."""
    low, high = float(at.theta_2.min()), float(at.theta_2.max())
    about, half = 0.5 * (low + high), 0.5 * (high - low)
    x = at.theta_2 - about
    # weighted as by Chebyshev's nodes, which makes the greatest error nearly the least one possible
    weight = np.sqrt(np.abs(np.gradient(x)) / np.sqrt(np.maximum(1.0 - (x / half) ** 2, 1.0 / SAMPLES)))
    joint_A, output = (
        Chebyshev.fit(x, angle, degree, domain=[-half, half], w=weight).convert(kind=Polynomial) for angle in angles
    )
    h23, h4 = joint_A.deriv()(x), output.deriv()(x)
    h3 = 1.0 + h23
    k = Coefficients(1.0, h3, h4, -h23, h4 - h3, 0.0, joint_A.deriv(2)(x), output.deriv(2)(x))
    u3, u4 = (np.exp(1j * angle) for angle in (at.theta_2 + joint_A(x), output(x)))
    mimic = state._replace(at=state.at._replace(u3=u3, u4=u4), k=k, moving=rates(k, state.speed, at.alpha_2))
    off = (output(x) - angles[1], h4 - state.k.h4, _compute_torque(case, mimic, at.alpha_2) - torque)
    worst = [int(np.argmax(np.abs(each))) for each in off]
    errors = (Error(float(abs(each[i])), float(at.theta_2[i])) for each, i in zip(off, worst, strict=True))
    padded = [tuple(np.pad(p.coef, (0, degree + 1 - len(p.coef))).tolist()) for p in (output, joint_A)]
    return Fit(degree, about, *padded, *errors)  # type: ignore[arg-type]
