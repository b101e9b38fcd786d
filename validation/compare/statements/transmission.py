"""How well the linkage transmits: the angle between bars 3 and 4, its extremes, ratios of speed and of stroke times."""

import math
from collections.abc import Iterator

import numpy as np

from fourbar.formulas import mobility, transmission
from fourbar.formulas.path import singular
from fourbar.formulas.path import state as state_of
from fourbar.formulas.transmission import drive_sine
from fourbar.linkage import MOVING_BARS, FourBar
from fourbar.scene import Scene
from validation.compare.answer import Answer, Engine
from validation.compare.compare import Predicted, turned
from validation.compare.statements.finding import TURN, Finding, answered, roundoff, wrapped
from validation.compare.tolerance import DEGRADED, EPS, EQUIVALENCE, NOTHING_TO_TELL, Array, lever

RADII = (0.2, 0.3)
"""m; where the forces of the mechanical advantage act. Any two that differ."""


def transmitted(scene: Scene, engine: Engine, answer: Answer, predicted: Predicted | None) -> Iterator[Finding]:
    """Over the scene's own motion, if it is one, at the stated extremes, and between the stated limits of bar 4."""
    linkage = scene.linkage
    extremes = transmission.transmission_extremes(linkage)
    if answer.at is not None and answer.at.omega_2 is not None:
        yield from _over(scene, answer, extremes, predicted)
    yield from _extremes(linkage, engine, extremes)
    yield from _strokes(linkage, engine)


def _over(
    scene: Scene, answer: Answer, extremes: transmission.TransmissionExtremes, predicted: Predicted | None
) -> Iterator[Finding]:
    at, linkage = answer.at, scene.linkage
    assert at is not None and at.omega_2 is not None and answer.assembled is not None
    state = state_of(linkage, at.theta_2, at.branch)
    half = state.at.half
    theta = {2: at.theta_2, **{bar: answer.quantities[f"theta_{bar}"] for bar in (3, 4)}}
    one, other = (theta[bar] for bar in MOVING_BARS if bar != scene.drive_bar)
    driven = np.abs(np.sin(other - one))
    angle = np.abs(wrapped(theta[4] - theta[3]))
    sine = np.abs(np.sin(angle))
    with np.errstate(divide="ignore", invalid="ignore"):
        allowed = EQUIVALENCE.factor * turned(linkage.ground_angle, at.theta_2) / (lever(linkage) * sine)
        ratio = answer.quantities["omega_4"] / at.omega_2
        gained = transmission.mechanical_advantage(state, *RADII) * ratio * (RADII[1] / RADII[0]) - 1.0
        largest = np.maximum(1.0, np.maximum(np.abs(ratio), np.abs(answer.quantities["omega_3"] / at.omega_2)))
        allowed_gain = allowed / sine * largest / np.abs(ratio)
    closed = (
        answer.assembled & (half.outer >= 0.0) & (half.inner >= 0.0) & ~singular(state.at)
    )  # whether both say so is a row of its own
    where = closed & ~(allowed >= NOTHING_TO_TELL)  # a missing number is none that holds
    moving = where & (at.omega_2 != 0.0)
    acute = np.minimum(angle, math.pi - angle)
    outside = np.maximum(np.maximum(extremes.least - angle, angle - extremes.greatest), 0.0)
    for what, error, bound, counts in (
        # what divides every tolerance is not to be had from the formulas alone
        ("condition", np.abs(state.at.sin_mu - np.sin(theta[4] - theta[3])), allowed, where),
        ("drive condition", np.abs(np.abs(drive_sine(state.at, scene.drive_bar)) - driven), allowed, where),
        ("transmission angle", np.abs(transmission.transmission_angle(state) - acute), allowed, where),
        ("beyond the extremes", outside, allowed, where),
        ("mechanical advantage", np.abs(gained), allowed_gain, moving & ~(allowed_gain >= NOTHING_TO_TELL)),
    ):
        beyond = counts & ~(error <= bound)
        if predicted is not None and beyond.any():
            expected = predicted(beyond)
            lost = expected["theta_3"] + expected["theta_4"]
            if what == "mechanical advantage":
                lost = expected["omega_4"] / np.abs(answer.quantities["omega_4"])
            bound = np.where(beyond, np.fmax(bound, DEGRADED * lost), bound)  # noqa: PLW2901
        yield from (Finding(*each, what) for each in zip(error[counts], bound[counts], at.theta_2[counts], strict=True))
    branch = at.branch.astype(float)
    nearest = transmission.distance_to_singular(linkage, at.theta_2, scene.drive_bar, branch)
    found = _to_singular(scene, at.theta_2, branch)
    error = np.where(np.isinf(nearest) == np.isinf(found), 0.0, math.inf)
    finite = np.isfinite(nearest) & np.isfinite(found)
    error[finite] = np.abs(nearest[finite] - found[finite])
    worst = int(np.argmax(error))
    bound = EPS * 8.0 * (np.abs(at.theta_2) + abs(linkage.ground_angle) + TURN)
    yield Finding(float(error[worst]), float(bound[worst]), float(at.theta_2[worst]), "distance to a singular position")


def _to_singular(scene: Scene, theta_2: Array, branch: Array) -> Array:
    """The angle to the nearest position at which bars are collinear that must not be, inf where there is none."""
    linkage, drive = scene.linkage, scene.drive_bar
    always = [limit.theta_2 for limit in mobility.limit_positions(linkage)] + [*mobility.change_points(linkage)]
    dead = mobility.limit_positions(linkage, drive) if drive != 2 else ()
    nearest = np.full(theta_2.shape, math.inf)
    for point, side in [*((point, 0) for point in always), *((limit.theta_2, limit.branch) for limit in dead)]:
        apart = np.abs(np.angle(np.exp(1j * (theta_2 - point))))
        nearest = np.where((branch == side) | (side == 0), np.minimum(nearest, apart), nearest)
    return nearest


def _extremes(linkage: FourBar, engine: Engine, stated: transmission.TransmissionExtremes) -> Iterator[Finding]:
    singular = [limit.theta_2 for limit in mobility.limit_positions(linkage)] + [*mobility.change_points(linkage)]
    for value, theta_2, collinear in (
        (stated.least, stated.theta_2_least, 0.0),
        (stated.greatest, stated.theta_2_greatest, math.pi),
    ):
        if value == collinear:
            error = min((float(np.abs(wrapped(np.array(theta_2 - point)))) for point in singular), default=math.inf)
            yield Finding(error, EQUIVALENCE.factor * turned(0.0, theta_2), theta_2, "extreme at a limit")
            continue
        seen = answered(engine, linkage, [theta_2], [1])
        angle = abs(float(wrapped(seen["theta_4"] - seen["theta_3"])[0]))
        digits = lever(linkage) * math.sin(angle)
        if not digits * NOTHING_TO_TELL <= EPS:
            yield Finding(abs(angle - value), roundoff(linkage) / digits, theta_2, "extreme of the angle at B")
    worst = min(stated.least, math.pi - stated.greatest)
    yield Finding(abs(stated.worst - worst), EPS, stated.theta_2_least, "smallest transmission angle")


def _strokes(linkage: FourBar, engine: Engine) -> Iterator[Finding]:
    """Bar 4 turns in one sense between its two limits on a branch, and in the other for the rest of the turn."""
    stated = mobility.time_ratio(linkage)
    dead = [limit.theta_2 for limit in mobility.limit_positions(linkage, 4) if limit.branch == -1]
    strokes = len(dead) == 2 and mobility.turns_fully(linkage) and not mobility.change_points(linkage)
    yield Finding(float(strokes != (stated is not None)), 0.0, linkage.ground_angle, "whether there is a time ratio")
    if strokes and stated is not None:
        there = (dead[1] - dead[0]) % TURN
        rates = answered(engine, linkage, [dead[0] + there / 2.0, dead[1] + (TURN - there) / 2.0], [-1, -1])["omega_4"]
        yield Finding(float(not rates[0] * rates[1] < 0.0), 0.0, dead[0], "bar 4 turns in both senses")
        ratio = max(there, TURN - there) / min(there, TURN - there)
        # both angles are differences of two that were rounded
        allowed = roundoff(linkage) * TURN / min(there, TURN - there)
        yield Finding(abs(stated / ratio - 1.0), allowed, dead[0], "time ratio")
