"""An engine's answer against the formulas: one row per quantity, at the position where it is worst."""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fourbar.quantities import (
    COUPLE,
    FORCES,
    JAMMED,
    LINE,
    OF_DRY_FRICTION,
    OF_LINE,
    OF_PIN_LOADS,
    OK,
    OVERFLOW,
    SINGULAR,
    STAGE_OF,
    STATUS_NAMES,
)
from fourbar.scene import Scene
from fourbar.solution import Solution
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.reversals import mark_reversing
from fourbar_validation.compare.rows import AGREES, DEGRADED, FAILS, REFUSES, UNDECIDED, Row, make_plain
from fourbar_validation.compare.scales import make_reference, take_smallest_scale, take_strictest_condition
from fourbar_validation.compare.tolerance import DEGRADED as TIMES_PREDICTED
from fourbar_validation.compare.tolerance import (
    EPS,
    IDENTITY,
    NOTHING_TO_TELL,
    Array,
    ErrorBound,
    Mask,
    count_half_turns,
    divide,
    find_error,
    find_gap,
    find_used,
    magnitude,
    mark_touching,
    replace_zero_size,
)

Predicted = Callable[[str, Mask], Array]
"""The error to be expected of a quantity, in its own unit, (n,); it matters at the positions of the mask alone."""
Nearby = Callable[[Mask], dict[str, Array]]
"""Function that evaluates every quantity again at the positions of a mask, within theta_2's rounding; NaN elsewhere."""
Scales = dict[str, tuple[Array, Array]]
"""Size and condition of each quantity at each position."""

OF_THE_FORMULAS = (*OF_DRY_FRICTION, *OF_PIN_LOADS, COUPLE.error, LINE.error, "force_error", "power")
"""Quantities with checks of their own: the range in which dry friction holds, its residual, error bars, a product."""
COMPARED = tuple(name for name in STAGE_OF if name not in (*OF_THE_FORMULAS, *OF_LINE))
"""Quantities that are compared with an exact engine: all that is printed of a position."""
OF_THE_LINE = {"stroke": "sin_mu", "drive_line": "sin_mu", "stroke_speed": "v_B", LINE.value: COUPLE.value}
"""Quantities of a linear drive; each is compared if the quantity it maps to is compared or the engine answers it."""
OF_FORCES = (*FORCES, *OF_DRY_FRICTION)
MOST_UNDECIDED = 0.5
"""Share of the numbers of a scene that are undecided, beyond which it does not hold."""
SLOW_DRIVE = 0.1
"""T3 and T4, and the pin forces with them, have poles where omega_3, omega_4 vanish, a cylinder's force where it stands
still: a simulation is judged where the drive moves at more than this part of its greatest speed."""
CLOSURE = "a e^{i theta_2} + b e^{i theta_3} = d e^{i theta_1} + c e^{i theta_4}"
NOWHERE = "no position at which it is demanded"
NUMBERS = ("error", "allowed", "theta_2", "condition")
"""Names of the numbers of a row."""


@dataclass(slots=True)
class Comparison:
    """One answer held to the formulas; counts how many numbers there are and of how many a verdict is drawn."""

    name: str
    scene: Scene
    answer: Answer
    formulas: Solution
    """Solution of the formulas at `answer.at`."""
    tolerance: ErrorBound
    expected: Iterable[str]
    """Quantities that the engine must answer."""
    predicted: Predicted | None = None
    """Prediction of errors; with it an error beyond the tolerance must be within DEGRADED times the expected error."""
    reference: Solution | None = None
    """Another derivation at the same positions: the stricter of its conditions and sizes and the formulas' own decides
    what they may be wrong by; left out: the answer itself."""
    scales: Scales = field(default_factory=dict)
    """Scales of `formulas` and `reference`, if an earlier answer was compared with them."""
    nearby: Nearby | None = None
    """Evaluation near a position; with it an error beyond the tolerance is taken again within theta_2's rounding."""
    own: Solution | None = field(default=None, init=False)
    """The answer as a solution."""
    numbers: int = field(default=0, init=False)
    decided: int = field(default=0, init=False)
    again: dict[str, Array] | None = field(default=None, init=False)
    """Answer of `nearby`, once it was needed."""

    def rows(self) -> list[Row]:
        """Compare where the loop closes, each quantity, and what the engine says of itself."""
        answer = self.answer
        if answer.refusal is not None:
            return [Row.unmeasured(self.name, answer.engine, answer.setting, "all", REFUSES, answer.refusal)]
        if answer.assembled is None or len(answer.assembled) != len(self.formulas):
            what = "the engine did not say where the loop closes"
            return [Row.unmeasured(self.name, answer.engine, answer.setting, "assembled", FAILS, what)]
        held = tuple(self.expected)
        if self.scene.drive is not None:
            answered = answer.quantities
            held = (*held, *(name for name, other in OF_THE_LINE.items() if other in held or name in answered))
        self.own = make_reference(self.scene, answer)
        if self.reference is None:
            self.reference, self.scales = self.own, {}
        rows = [self.assembled()]
        rows += [row for quantity in STAGE_OF if quantity in held for row in self.compared(quantity)]
        rows += [self.row("watch", FAILS, alarm) for alarm in answer.alarms]
        return [*rows, *self.undecided()]

    @property
    def who(self) -> tuple[str, str, str]:
        """Scene, engine and setting of its rows."""
        return self.name, self.answer.engine, self.answer.setting or "-"

    def row(self, quantity: str, verdict: str, reason: str, **numbers: float) -> Row:
        """Make a row of this answer."""
        error, allowed, theta_2, condition = (float(numbers.get(key, math.nan)) for key in NUMBERS)
        return Row(*self.who, quantity, error, allowed, verdict, make_plain(reason), theta_2, condition)

    def closure(self) -> Row:
        """Check that the own angles of an engine close the loop."""
        answer, linkage = self.answer, self.scene.linkage
        assert answer.at is not None and answer.assembled is not None
        theta_2 = answer.at.angle if answer.at.commanded == "theta_2" else answer.quantities["theta_2"]
        theta_3, theta_4 = answer.quantities["theta_3"], answer.quantities["theta_4"]
        condition = 1.0 / count_half_turns(linkage.ground_angle, theta_2)
        allowed = (IDENTITY if answer.setting == "exact" else self.tolerance).factor / condition
        reason = f"identity: {CLOSURE}" if answer.assembled.any() else NOWHERE
        gap = find_gap(linkage, theta_2, theta_3, theta_4)
        return Row.judged(self.who, "closure", gap, allowed, reason, theta_2, condition, answer.assembled)

    def assembled(self) -> Row:
        """Compare where both close the loop."""
        theirs, ours, at = self.answer.assembled, self.formulas, self.answer.at
        assert theirs is not None and at is not None
        differ = (theirs != ours.assembled) & ~mark_touching(self.scene.linkage, at.angle, at.bar)
        count = np.count_nonzero(differ)
        reason = f"{count} of {len(differ)} positions differ" if count else "the same positions"
        return Row.judged(self.who, "assembled", float(count) * differ, 0.0, reason, ours.theta_2)

    def compared(self, quantity: str) -> Iterator[Row]:
        """Compare a quantity, if either side has it."""
        formulas, scene, tolerance = self.formulas, self.scene, self.tolerance
        ours, theirs = getattr(formulas, quantity, None), self.answer.quantities.get(quantity)
        if theirs is None and self.own is not None:
            if quantity == "drive_condition" and any(effect.loaded_pins for effect in scene.effects):
                return  # an engine that passes over loads and friction does not know how near they are to jamming
            theirs = getattr(self.own, quantity)
        if ours is None or theirs is None:
            if ours is not theirs:  # both are missing where the scene states positions only
                yield self.row(quantity, FAILS, "no answer" if theirs is None else "the formulas have no answer")
            return
        assert self.answer.assembled is not None
        both = formulas.assembled & self.answer.assembled
        judged = both & _mark_stated(quantity, formulas, ours)
        self.numbers += int(np.count_nonzero(both))
        withheld = _count(formulas.status_code[both & ~judged])
        if withheld and not judged.any():
            yield self.row(quantity, REFUSES, f"the formulas state no value: {withheld}")
            return
        where = judged & _mark_answerable(quantity, scene, formulas, tolerance)
        jumping = where & _mark_jumping(quantity, scene, formulas, tolerance)
        where &= ~jumping
        note = f"; not judged: {withheld}" if withheld else ""
        if jumping.any():
            count = int(np.count_nonzero(jumping))  # the forces of either side of a reversal are right
            self.decided += count
            note += f"; {count} positions at which dry friction reverses not judged"
        if not where.any():
            yield self.row(quantity, UNDECIDED, "no position at which both may be held to it" + note)
            return
        result, error, condition = self._measure(quantity, ours, theirs, where)
        self.decided += result.decided
        at = {"theta_2": formulas.theta_2[result.worst], "condition": condition[result.worst]}
        yield self.row(
            quantity, result.verdict, result.reason + note, error=error[result.worst], allowed=result.allowed, **at
        )

    def _measure(self, quantity: str, ours: Array, theirs: Array, where: Mask) -> "tuple[_Finding, Array, Array]":
        """Compare at the positions `where`: the result, the errors and the conditions, (n,)."""
        if quantity not in self.scales:
            self.scales[quantity] = (
                take_smallest_scale(quantity, self.scene, self.formulas, self.reference),
                take_strictest_condition(quantity, self.scene.linkage, self.formulas, self.reference),
            )
        size, condition = self.scales[quantity]
        full, predicted, expected = self.tolerance.allowed(condition), self.predicted, None
        if predicted is not None:
            full, size = np.where(size == 0.0, 0.0, full), replace_zero_size(size)
        error = find_error(quantity, ours, theirs, size)
        beyond, again, note = where & (error > full), np.full_like(error, np.nan), ""
        if self.nearby is not None and beyond.any():
            if self.again is None:
                self.again = self.nearby(self.formulas.assembled)
            again = find_error(quantity, ours, self.again[quantity], size)
            error = np.where(beyond, np.fmin(error, again), error)
            mended = np.count_nonzero(beyond & (again <= full))
            note = f"; {mended} positions within the rounding of theta_2" if mended else ""
        if predicted is not None:

            def expected(where: Mask) -> Array:
                of_data = divide(predicted(quantity, where), size)
                return np.where(np.isfinite(again), np.fmin(of_data, full), of_data)

        result = _judge_errors(error, condition, where, full, self.tolerance, expected)
        return result._replace(reason=result.reason + note), error, condition

    def undecided(self) -> Iterator[Row]:
        """Fail a scene of which most numbers are undecided."""
        if not self.numbers:
            return
        missing = self.numbers - self.decided
        share = missing / self.numbers
        reason = f"{missing} of {self.numbers} numbers are undecided"
        yield Row.judged(self.who, "undecided", share, MOST_UNDECIDED, reason)


class _Finding(NamedTuple):
    """Worst error of one quantity and the position where it occurs."""

    worst: int
    verdict: str
    reason: str
    allowed: float
    decided: int
    """Number of positions that have a verdict."""


def _judge_errors(
    error: Array,
    condition: Array,
    where: Mask,
    full: Array,
    tolerance: ErrorBound,
    predicted: Callable[[Mask], Array] | None,
) -> _Finding:
    """Compare errors at the positions `where` with the tolerance, `full`, and beyond it with what was predicted there.

    NaN at any of them fails. `full` is 0 where the quantity vanishes; the error is in its own unit there.
    """
    decidable = where & (condition * NOTHING_TO_TELL > EPS) if tolerance.conditioned else where
    undecided = int(np.count_nonzero(where & ~decidable))
    note = f"; {undecided} positions with eps/condition > {NOTHING_TO_TELL:g} not judged" if undecided else ""
    beyond = (decidable & ~(error <= full)) | (where & ~np.isfinite(error))
    if not (decidable | beyond).any():
        index = int(np.flatnonzero(where)[0])
        return _Finding(index, UNDECIDED, f"eps/condition = {EPS / condition[index]:.1e}", full[index], 0)
    if not beyond.any():
        index = int(np.argmax(np.where(decidable, find_used(error, full), -1.0)))
        return _Finding(index, AGREES, tolerance.name + note, full[index], int(np.count_nonzero(decidable)))
    expected = np.zeros_like(error)
    if predicted is not None:
        expected = np.nan_to_num(predicted(beyond), nan=0.0, posinf=np.inf)
    allowed = np.maximum(full, TIMES_PREDICTED * expected)
    ratio = find_used(error, allowed)
    # first order says that no digit is left, no more
    lost = beyond & np.isfinite(error) & np.where(full > 0.0, expected >= 1.0, expected == np.inf)
    ratio[lost] = np.minimum(ratio[lost], 1.0)
    index = int(np.argmax(np.where(beyond, ratio, -1.0)))
    if math.isnan(error[index]):
        verdict, reason = FAILS, "NaN"
    elif lost[index]:
        verdict, reason = UNDECIDED, f"an error of {expected[index]:.1e} of the value is predicted"
    elif predicted is None:
        verdict, reason = FAILS, tolerance.name
    elif ratio[index] <= 1.0:
        verdict, reason = DEGRADED, f"{error[index]:.1e} of {expected[index]:.1e} predicted for this position"
    else:
        verdict, reason = FAILS, f"{error[index]:.1e} where {expected[index]:.1e} was predicted"
    return _Finding(index, verdict, reason + note, allowed[index], int(np.count_nonzero(decidable & ~lost)))


def _mark_stated(quantity: str, formulas: Solution, ours: Array) -> Mask:
    """Mark where the formulas have one value: beyond the range of doubles the motion, up to the stage that met it."""
    if quantity in OF_FORCES:
        # at rest a jam is of the motion that would begin
        # where there are several solutions an engine may find another, or none by its own iteration
        stated = (formulas.status_code == JAMMED) & np.isfinite(magnitude(ours))
        return np.asarray(stated | (formulas.status_code == OK))
    beyond = (formulas.status_code == OVERFLOW) & np.isnan(magnitude(ours))
    jammed = (formulas.status_code == JAMMED) & (quantity == "drive_condition")  # drive_condition says how near that is
    return np.asarray((formulas.status_code != SINGULAR) & ~beyond & ~jammed)


def _count(codes: NDArray[np.uint8]) -> str:
    """Count positions by status: "3 singular, 5 no_torque"."""
    counts = np.bincount(codes, minlength=len(STATUS_NAMES)).tolist()
    return ", ".join(f"{count} {name}" for name, count in zip(STATUS_NAMES, counts, strict=True) if count)


def _mark_jumping(quantity: str, scene: Scene, formulas: Solution, tolerance: ErrorBound) -> Mask:
    """Mark where dry friction reverses and a force may have either value; the motion is prescribed and has one."""
    near_jamming = quantity == "drive_condition" and any(effect.loaded_pins for effect in scene.effects)
    if quantity not in OF_FORCES and not near_jamming:
        return np.zeros(len(formulas), dtype=bool)
    return mark_reversing(scene, formulas, tolerance.factor, in_time=tolerance.in_time)


def _mark_answerable(quantity: str, scene: Scene, formulas: Solution, tolerance: ErrorBound) -> Mask:
    """Mark where a quantity may be demanded of an engine of this class."""
    if quantity in FORCES and scene.drive_bar != 2 and tolerance.in_time:
        speed = {3: formulas.omega_3, 4: formulas.omega_4}.get(scene.drive_bar, formulas.stroke_speed)
        assert speed is not None
        return mark_turning(speed)
    return np.ones(len(formulas), dtype=bool)


def mark_turning(speed: Array) -> Mask:
    """Mark where a driven bar turns fast enough that its torque and the pin forces are no pole's, (n,)."""
    fast = np.abs(np.nan_to_num(speed))
    return np.asarray(fast > SLOW_DRIVE * fast.max())
