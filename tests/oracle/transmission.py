"""Check the transmission angle, its extremes, and ratios.

The angle is that between bars 3 and 4; the ratios are those of speed and of stroke
times.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from fourbar.formulas import mobility, transmission
from fourbar.formulas.mobility import TURN
from fourbar.formulas.path import compute_state, drive_sine, find_singular
from fourbar.linkage import MOVING_BARS
from fourbar.quantities import Array
from fourbar.scene import Command, Scene, find_signs
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.compare import Predicted
from fourbar_validation.compare.tolerance import (
    EPS,
    EQUIVALENCE,
    NOTHING_TO_TELL,
    TIMES_PREDICTED,
    Mask,
    count_half_turns,
    find_roundoff,
    find_used,
    wrap_difference,
)
from tests.oracle.limit_positions import (
    Finding,
    LimitPlace,
    Seen,
    StatedLimits,
)

_RADII = (0.2, 0.3)
"""m; where the forces of the mechanical advantage act. Any two that differ."""


class StatedTransmission(NamedTuple):
    """Statements of the formulas on the angle at B and on the strokes, evaluated
    once.
    """

    limits: StatedLimits
    extremes: transmission.TransmissionExtremes
    collinear: list[float]
    """theta_2 where bars 3 and 4 are collinear on either branch, rad."""
    strokes: tuple[float, tuple[float, float]] | None
    """Turn of bar 2 while bar 4 goes between its limits, rad. theta_2 in the middle of
    that turn and of the rest follow.
    """

    @classmethod
    def of(cls, limits: StatedLimits) -> "StatedTransmission":
        """Evaluate the formulas of a linkage whose limits are stated."""
        extremes = transmission.transmission_extremes(limits.linkage)
        return cls(limits, extremes, _find_collinear(limits), _find_strokes(limits))

    @property
    def ends(self) -> tuple[tuple[float, float, float], ...]:
        """Return the extremes of the angle at B, and theta_2 there.

        The angle where bars 3 and 4 are collinear follows.
        """
        extremes = self.extremes
        return (extremes.least, extremes.theta_2_least, 0.0), (
            extremes.greatest,
            extremes.theta_2_greatest,
            math.pi,
        )


class StatedOver(NamedTuple):
    """Statements of the formulas over a motion, each (n,), evaluated once."""

    scene: Scene
    command: Command
    lever: float
    """As from `find_lever`."""
    roundoff: float
    """As from `find_roundoff`, at the angles of the motion, rad."""
    closed: Mask
    """True where the loop closes, and not in one line."""
    sin_mu: Array
    drive_condition: Array
    angle: Array
    """Transmission angle, rad."""
    extremes: transmission.TransmissionExtremes
    advantage: Array
    """Mechanical advantage of forces at _RADII."""
    to_singular: Finding
    """Distance to a singular position. It is held against the limits and dead centres
    that are stated.
    """

    @classmethod
    def of(cls, scene: Scene, command: Command, limits: StatedLimits) -> "StatedOver":
        """Evaluate the formulas."""
        state = compute_state(scene.linkage, command.theta_2, command.branch)
        half = state.position.half
        with np.errstate(divide="ignore", invalid="ignore"):
            advantage = transmission.mechanical_advantage(state, *_RADII)
        return cls(
            scene,
            command,
            limits.lever,
            find_roundoff(scene.linkage, command.theta_2),
            (half.outer >= 0.0) & (half.inner >= 0.0) & ~find_singular(state.position),
            state.position.sin_mu,
            # the leverage of a line is a quantity
            np.abs(drive_sine(state.position, scene.drive_bar or 2)),
            transmission.transmission_angle(state),
            transmission.transmission_extremes(scene.linkage),
            advantage,
            _compare_distance(scene, command, limits),
        )


def choose_places(stated: StatedTransmission) -> list[LimitPlace]:
    """Return angles at which an engine is evaluated: extremes that are no limits,
    and both strokes of bar 4.
    """
    places = [
        (theta_2, 1) for value, theta_2, collinear in stated.ends if value != collinear
    ]
    if stated.strokes is not None:
        places += [(theta_2, -1) for theta_2 in stated.strokes[1]]
    return places


def compare_transmission(
    stated: StatedTransmission,
    over: StatedOver | None,
    seen: Seen,
    answer: Answer,
    predicted: Predicted | None,
) -> Iterator[Finding]:
    """Compare over a motion, at extremes, and between bar 4's limits.

    The motion is left out if there is none.
    """
    if over is not None:
        yield from _compare_over(over, answer, predicted)
    yield from _compare_extremes(stated, seen)
    yield from _compare_time_ratio(stated, seen)


class _Claim(NamedTuple):
    """One statement over a motion: its error, the allowed one, and where it is
    demanded, (n,).
    """

    what: str
    error: Array
    allowed: Array
    where: Mask
    rates: bool = False
    """True if it follows from the speeds, otherwise from the angles."""


def _compare_over(
    over: StatedOver,
    answer: Answer,
    predicted: Predicted | None,
) -> Iterator[Finding]:
    """Compare the worst position of each statement over a motion."""
    claims = list(_list_claims(over, answer))
    error = np.array([claim.error for claim in claims])
    allowed = np.array([claim.allowed for claim in claims])
    mask = np.array([claim.where for claim in claims])
    mask &= ~(allowed >= NOTHING_TO_TELL)
    beyond = mask & ~(error <= allowed)
    if predicted is not None and beyond.any():
        for i in np.flatnonzero(beyond.any(axis=1)):
            if claims[i].rates:
                speed = np.abs(answer.quantities["omega_4"])
                lost = predicted("omega_4", beyond[i]) / speed
            else:
                lost = predicted("theta_3", beyond[i]) + predicted("theta_4", beyond[i])
            larger = np.fmax(allowed[i], TIMES_PREDICTED * lost)
            allowed[i] = np.where(beyond[i], larger, allowed[i])
        mask &= ~(allowed >= NOTHING_TO_TELL)
    used = np.where(mask, find_used(error, allowed), -1.0)
    worst = used.argmax(axis=1)
    for i in np.flatnonzero(mask.any(axis=1)):
        most = worst[i]
        yield Finding(
            float(error[i, most]),
            float(allowed[i, most]),
            float(over.command.theta_2[most]),
            claims[i].what,
        )
    yield over.to_singular


def _list_claims(over: StatedOver, answer: Answer) -> Iterator[_Claim]:
    """List what the formulas state at each position, against the engine's angles and
    speeds.
    """
    command = over.command
    drive = over.scene.drive_bar or 2
    assert command.omega_2 is not None and answer.assembled is not None
    theta = {
        2: command.theta_2,
        **{bar: answer.quantities[f"theta_{bar}"] for bar in (3, 4)},
    }
    first, second = (theta[bar] for bar in MOVING_BARS if bar != drive)
    angle = np.abs(wrap_difference(theta[4] - theta[3]))
    sine = np.abs(np.sin(angle))
    # a row of its own compares whether both say that the loop closes
    closed = answer.assembled & over.closed
    with np.errstate(divide="ignore", invalid="ignore"):
        allowed = over.roundoff / (over.lever * sine)
        ratio = answer.quantities["omega_4"] / command.omega_2
        gained = over.advantage * ratio * (_RADII[1] / _RADII[0]) - 1.0
        largest = np.maximum(
            1.0,
            np.maximum(
                np.abs(ratio), np.abs(answer.quantities["omega_3"] / command.omega_2)
            ),
        )
        allowed_gain = allowed / sine * largest / np.abs(ratio)
    # the divisor of every tolerance must not come from the formulas alone
    yield _Claim(
        "condition",
        np.abs(over.sin_mu - np.sin(theta[4] - theta[3])),
        allowed,
        closed,
    )
    drive_condition = np.abs(over.drive_condition - np.abs(np.sin(second - first)))
    yield _Claim("drive condition", drive_condition, allowed, closed)
    acute = np.minimum(angle, math.pi - angle)
    yield _Claim(
        "transmission angle",
        np.abs(over.angle - acute),
        allowed,
        closed,
    )
    outside = np.maximum(
        np.maximum(over.extremes.least - angle, angle - over.extremes.greatest), 0.0
    )
    yield _Claim("beyond the extremes", outside, allowed, closed)
    moving = (
        closed & (command.omega_2 != 0.0) & ~(allowed >= NOTHING_TO_TELL)
    )  # a missing number is none that holds
    yield _Claim(
        "mechanical advantage",
        np.abs(gained),
        allowed_gain,
        moving,
        rates=True,
    )


def _compare_distance(
    scene: Scene,
    command: Command,
    limits: StatedLimits,
) -> Finding:
    """Compare the distance to a singular position with stated limits and dead
    centres.
    """
    drive = scene.drive_bar or 2
    ours = transmission.distance_to_singular(
        scene.linkage, command.theta_2, drive, command.branch
    )
    theirs = _compute_to_singular(scene, command, limits)
    error = np.where(np.isinf(ours) == np.isinf(theirs), 0.0, math.inf)
    finite = np.isfinite(ours) & np.isfinite(theirs)
    error[finite] = np.abs(ours[finite] - theirs[finite])
    most = int(np.argmax(error))
    allowed = (
        EPS
        * 8.0
        * (abs(command.theta_2[most]) + abs(scene.linkage.ground_angle) + TURN)
    )
    return Finding(
        float(error[most]),
        float(allowed),
        float(command.theta_2[most]),
        "distance to a singular position",
    )


def _find_collinear(limits: StatedLimits) -> list[float]:
    """Return theta_2 where bars 3 and 4 are collinear on either branch."""
    of_input = [limit.theta_2 for limit in limits.positions[2]]
    return [*of_input, *mobility.change_points(limits.linkage)]


def _compute_to_singular(
    scene: Scene,
    command: Command,
    limits: StatedLimits,
) -> Array:
    """Compute the angle to the nearest singular position.

    Bars that must not be collinear are so there; inf if there is none.
    """
    drive = scene.drive_bar or 2
    always = _find_collinear(limits)
    if drive != 2:
        dead = limits.positions[drive]
    else:
        dead = ()
    points = np.array([*always, *(limit.theta_2 for limit in dead)])
    sides = np.array([*(0 for _ in always), *(limit.branch for limit in dead)])
    side = sides[:, None]
    apart = np.angle(np.exp(1j * (command.theta_2 - points[:, None])))
    there = find_signs(scene.linkage, command.theta_2 - apart, command.branch)
    reached = (there == side) | (side == 0)
    distances = np.where(reached, np.abs(apart), math.inf)
    return np.asarray(distances.min(axis=0, initial=math.inf))


def _compare_extremes(stated: StatedTransmission, seen: Seen) -> Iterator[Finding]:
    for value, theta_2, collinear in stated.ends:
        if value == collinear:
            error = min(
                (abs(wrap_difference(theta_2 - point)) for point in stated.collinear),
                default=math.inf,
            )
            yield Finding(
                error,
                EQUIVALENCE.factor * count_half_turns(0.0, theta_2),
                theta_2,
                "extreme at a limit",
            )
            continue
        angle = abs(
            wrap_difference(
                seen[(theta_2, 1)]["theta_4"] - seen[(theta_2, 1)]["theta_3"]
            )
        )
        digits = stated.limits.lever * math.sin(angle)
        if not digits * NOTHING_TO_TELL <= EPS:
            yield Finding(
                abs(angle - value),
                stated.limits.roundoff / digits,
                theta_2,
                "extreme of the angle at B",
            )
    extremes = stated.extremes
    smallest = min(extremes.least, math.pi - extremes.greatest)
    yield Finding(
        abs(extremes.worst - smallest),
        EPS,
        extremes.theta_2_least,
        "smallest transmission angle",
    )


def _find_strokes(limits: StatedLimits) -> tuple[float, tuple[float, float]] | None:
    """Find the turn of bar 2 while bar 4 goes between its limits on one branch, rad,
    and theta_2 in the middle of it and of the rest. Bar 4 turns in the other sense
    for the rest of the turn.
    """
    dead = [limit.theta_2 for limit in limits.positions[4] if limit.branch == -1]
    if (
        len(dead) != 2
        or not mobility.turns_fully(limits.linkage)
        or mobility.change_points(limits.linkage)
    ):
        return None
    stroke = (dead[1] - dead[0]) % TURN
    return stroke, (dead[0] + stroke / 2.0, dead[1] + (TURN - stroke) / 2.0)


def _compare_time_ratio(stated: StatedTransmission, seen: Seen) -> Iterator[Finding]:
    linkage = stated.limits.linkage
    strokes = stated.strokes
    ratio = mobility.time_ratio(linkage)
    theta_1 = linkage.ground_angle
    agree = (strokes is None) == (ratio is None)
    yield Finding(float(not agree), 0.0, theta_1, "whether there is a time ratio")
    if strokes is not None and ratio is not None:
        stroke, middles = strokes
        one, second = (seen[(theta_2, -1)]["omega_4"] for theta_2 in middles)
        place = middles[0]
        yield Finding(
            float(not one * second < 0.0), 0.0, place, "bar 4 turns in both senses"
        )
        shorter, longer = sorted((stroke, TURN - stroke))
        # both angles are differences of two that were rounded
        yield Finding(
            abs(ratio / (longer / shorter) - 1.0),
            stated.limits.roundoff * TURN / shorter,
            place,
            "time ratio",
        )
