"""An engine's answer against the formulas: one row per quantity, at the position where it is worst."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fourbar.quantities import FORCES, OK, OVERFLOW, SINGULAR, STATUS_NAMES, UNKNOWNS
from fourbar.scene import Scene
from fourbar.solution import Solution
from validation.compare.answer import Answer
from validation.compare.error import in_own_unit, relative, relative_error, used
from validation.compare.reversals import reversing
from validation.compare.rows import AGREES, DEGRADED, FAILS, REFUSES, UNDECIDED, Row
from validation.compare.scales import of_length, yardstick
from validation.compare.tolerance import DEGRADED as TIMES_PREDICTED
from validation.compare.tolerance import (
    EPS,
    NOTHING_TO_TELL,
    SIMULATED,
    Array,
    Tolerance,
    condition_of,
)

Mask = NDArray[np.bool_]

COMPARED = UNKNOWNS
"""Every quantity that an engine may be held to."""
SLOW_DRIVE = 0.1
"""T3 and T4 have poles where omega_3, omega_4 vanish: a simulation is judged where the driven bar
turns at more than this part of its greatest speed."""
NUMBERS = ("error", "allowed", "theta_2", "condition")
"""Of a row."""
TOUCHING_MARGIN = 32.0 * EPS
"""A loop that closes, or misses, by less than this part of the sum of its lengths does so by the
rounding of the data, and the engines may differ on whether it closes."""


def compare(
    name: str,
    scene: Scene,
    answer: Answer,
    formulas: Solution,
    tolerance: Tolerance,
    expected: Iterable[str],
    predicted: Callable[[], Mapping[str, Array]] | None = None,
) -> list[Row]:
    """Judge an answer; `formulas` is the solution at `answer.at`, `expected` what the engine must answer.

    With `predicted`, which gives the error to be expected of each quantity at each position in its own unit,
    an error beyond full accuracy must be within DEGRADED times that, and the law in the condition plays no part.
    """

    def row(quantity: str, verdict: str, reason: str, **numbers: float) -> Row:
        error, allowed, theta_2, condition = (float(numbers.get(key, math.nan)) for key in NUMBERS)
        return Row(name, answer.engine, answer.setting, quantity, error, allowed, verdict, reason, theta_2, condition)

    if answer.refusal is not None:
        return [row("all", REFUSES, answer.refusal)]
    rows = []
    if answer.assembled is None or len(answer.assembled) != len(formulas):
        return [row("assembled", FAILS, "the engine did not say where the loop closes")]
    differ = (answer.assembled != formulas.assembled) & ~_undecided(scene, formulas.theta_2)
    worst = int(np.argmax(differ))
    rows.append(
        row(
            "assembled",
            FAILS if differ.any() else AGREES,
            f"{np.count_nonzero(differ)} of {len(differ)} positions differ" if differ.any() else "the same positions",
            error=float(np.count_nonzero(differ)),
            allowed=0.0,
            theta_2=formulas.theta_2[worst],
            condition=1.0,
        )
    )
    both = formulas.assembled & answer.assembled
    for quantity in (q for q in COMPARED if q in expected):
        ours, theirs = getattr(formulas, quantity, None), answer.quantities.get(quantity)
        if ours is None or theirs is None:
            if ours is not theirs:  # both are missing where the scene states positions only
                rows.append(row(quantity, FAILS, "no answer" if theirs is None else "the formulas have no answer"))
            continue
        judged = both & _stated(quantity, formulas, ours)
        withheld = _counted(formulas.status_code[both & ~judged])
        if withheld and not judged.any():
            rows.append(row(quantity, REFUSES, f"the formulas state no value: {withheld}"))
            continue
        where = judged & _answerable(quantity, scene, formulas, tolerance)
        jumping = where & _jumping(quantity, scene, formulas, tolerance)
        where &= ~jumping
        if not where.any():
            rows.append(row(quantity, UNDECIDED, "no position at which both may be held to it"))
        else:
            size = yardstick(quantity, scene, formulas, ours)
            vanishing = size == 0.0
            if predicted is not None:
                size = in_own_unit(size)
            error = relative_error(quantity, ours, theirs, size)
            condition = condition_of(quantity, scene.linkage, formulas)
            if predicted is None:
                found = _by_condition(error, condition, where, tolerance)
            else:
                expected_error = partial(_relative, predicted, quantity, size)
                found = _by_prediction(
                    error, where, np.where(vanishing, 0.0, tolerance.factor), tolerance, expected_error
                )
            at = {"theta_2": formulas.theta_2[found.worst], "condition": condition[found.worst]}
            numbers = {"error": error[found.worst], "allowed": found.allowed, **at}
            rows.append(row(quantity, found.verdict, found.reason, **numbers))
        note = f"; not judged: {withheld}" if withheld else ""
        if jumping.any():
            note += f"; {np.count_nonzero(jumping)} positions at which dry friction reverses not judged"
        rows[-1] = replace(rows[-1], reason=rows[-1].reason + note)
    rows += [row("watch", FAILS, alarm) for alarm in answer.alarms]
    return rows


def _relative(predicted: Callable[[], Mapping[str, Array]], quantity: str, size: Array) -> Array:
    """The predicted error of a quantity in parts of its size; computed when it is called for."""
    return relative(predicted()[quantity], size)


class _Finding(NamedTuple):
    """What was found of one quantity at the position where it is worst."""

    worst: int
    verdict: str
    reason: str
    allowed: float


def _by_condition(error: Array, condition: Array, where: Mask, tolerance: Tolerance) -> _Finding:
    """Errors over the positions `where` against the law in the condition; NaN at any of them fails."""
    allowed = tolerance.allowed(condition)
    decidable = where & (condition * NOTHING_TO_TELL > EPS)
    undecided = int(np.count_nonzero(where & ~decidable))
    note = f"; {undecided} positions with eps/condition > {NOTHING_TO_TELL:g} not judged" if undecided else ""
    if not decidable.any():
        index = int(np.flatnonzero(where)[0])
        verdict, reason = UNDECIDED, f"eps/condition = {EPS / condition[index]:.1e}"
        if not np.isfinite(error[where]).all():
            verdict, reason = FAILS, "NaN"
        return _Finding(index, verdict, reason, allowed[index])
    ratio = np.where(decidable, used(error, allowed), -1.0)
    ratio[where & ~np.isfinite(error)] = np.inf
    index = int(np.argmax(ratio))
    reason = ("NaN" if math.isnan(error[index]) else tolerance.name) + note
    return _Finding(index, AGREES if ratio[index] <= 1.0 else FAILS, reason, allowed[index])


def _by_prediction(
    error: Array, where: Mask, full: Array, tolerance: Tolerance, predicted: Callable[[], Array]
) -> _Finding:
    """Errors against full accuracy, or else against what was predicted for each position; NaN always fails.

    Full accuracy is 0 where the quantity vanishes; the error is in its own unit there.
    """
    beyond = where & ~(error <= full)
    expected = np.zeros_like(error)
    if beyond.any():
        expected = np.nan_to_num(predicted(), nan=0.0, posinf=np.inf)
    allowed = np.maximum(full, TIMES_PREDICTED * expected)
    ratio = np.where(where, used(error, allowed), -1.0)
    lost = np.where(full > 0.0, expected >= 1.0, expected == np.inf)  # first order says that no digit is left, no more
    ratio[lost] = np.minimum(ratio[lost], 1.0)
    ratio[where & ~np.isfinite(error)] = np.inf
    index = int(np.argmax(np.where(beyond, ratio, -1.0) if beyond.any() else np.where(where, ratio, -2.0)))
    if not beyond.any():
        verdict, reason = AGREES, tolerance.name
    elif lost[index] and math.isfinite(error[index]):
        verdict, reason = UNDECIDED, f"an error of {expected[index]:.1e} of the value is predicted"
    elif ratio[index] <= 1.0:
        verdict, reason = DEGRADED, f"{error[index]:.1e} of {expected[index]:.1e} predicted for this position"
    elif math.isnan(error[index]):
        verdict, reason = FAILS, "NaN"
    else:
        verdict, reason = FAILS, f"{error[index]:.1e} where {expected[index]:.1e} was predicted"
    return _Finding(index, verdict, reason, allowed[index])


def turned(theta_2: Array) -> float:
    """Angles many turns away carry fewer digits of their direction: the largest of them, at least 1 rad."""
    return max(1.0, float(np.abs(theta_2).max(initial=0.0)) / np.pi)


def _stated(quantity: str, formulas: Solution, ours: Array) -> Mask:
    """Where the formulas state one value: beyond the range of doubles the motion is, up to the stage that met it."""
    if quantity in FORCES:
        return np.asarray(formulas.status_code == OK)
    return np.asarray((formulas.status_code != SINGULAR) & ~((formulas.status_code == OVERFLOW) & np.isnan(ours)))


def _counted(codes: NDArray[np.uint8]) -> str:
    """How many positions have which status: "3 singular, 5 no_torque"."""
    counts = np.bincount(codes, minlength=len(STATUS_NAMES)).tolist()
    return ", ".join(f"{count} {name}" for name, count in zip(STATUS_NAMES, counts, strict=True) if count)


def closing_margin(scene: Scene, theta_2: Array) -> Array:
    """By what part of the sum of the lengths the loop closes (> 0) or misses (< 0)."""
    d, a, b, c = scene.linkage.lengths
    e = np.abs(d * np.exp(1j * scene.linkage.ground_angle) - a * np.exp(1j * theta_2))
    return np.asarray(np.minimum(b + c - e, e - abs(b - c)) / of_length(scene))


def _undecided(scene: Scene, theta_2: Array) -> Mask:
    """Positions at which rounding decides whether the loop closes."""
    return np.asarray(np.abs(closing_margin(scene, theta_2)) < TOUCHING_MARGIN)


def _jumping(quantity: str, scene: Scene, formulas: Solution, tolerance: Tolerance) -> Mask:
    """Where dry friction reverses and a force may have either value; the motion is prescribed and has one."""
    if quantity not in FORCES:
        return np.zeros(len(formulas), dtype=bool)
    return reversing(scene, formulas, tolerance.factor, in_time=tolerance.name == SIMULATED.name)


def _answerable(quantity: str, scene: Scene, formulas: Solution, tolerance: Tolerance) -> Mask:
    """Where a quantity may be demanded of an engine of this class."""
    if quantity == "torque" and scene.drive_bar != 2 and tolerance.name == SIMULATED.name:
        speed = formulas.omega_3 if scene.drive_bar == 3 else formulas.omega_4
        assert speed is not None
        return turning(speed)
    return np.ones(len(formulas), dtype=bool)


def turning(speed: Array) -> Mask:
    """Where a driven bar turns fast enough that its torque is no pole's, (n,)."""
    fast = np.abs(np.nan_to_num(speed))
    return np.asarray(fast > SLOW_DRIVE * fast.max())
