"""An engine's answer against the formulas: a row for each quantity.

The row states the position where the quantity is worst.
"""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fourbar.errors import write_count
from fourbar.quantities import (
    CHANGE_POINT,
    COUPLE,
    DRY_FRICTION_QUANTITIES,
    FORCE_NAMES,
    JAMMED,
    LINE,
    LINE_QUANTITIES,
    OK,
    OVERFLOW,
    PIN_LOAD_QUANTITIES,
    SINGULAR,
    STAGE_OF,
    STATUS_NAMES,
    Array,
    Codes,
)
from fourbar.scene import Scene
from fourbar.solution import Solution
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.reversals import mark_reversing
from fourbar_validation.compare.rows import (
    AGREES,
    DEGRADED,
    FAILS,
    REFUSES,
    UNDECIDED,
    Row,
    escape_controls,
)
from fourbar_validation.compare.scales import (
    Scale,
    TermSizes,
    make_reference,
    size_answer,
)
from fourbar_validation.compare.tolerance import (
    EPS,
    MOST_ALLOWED,
    TIMES_PREDICTED,
    ErrorBound,
    K,
    Mask,
    count_half_turns,
    divide,
    find_condition,
    find_error,
    find_gap,
    find_used,
    magnitude,
    mark_touching,
    replace_zero_size,
)

Predicted = Callable[[str, Mask], Array | None]
"""Function that predicts the error of a quantity, in its unit, (n,). It matters at the
positions of the mask alone. None: nothing predicts this quantity.
"""
AnswerNearby = Callable[[], dict[str, Array]]
"""Function that evaluates every quantity again where the formulas close the loop.
theta_2 is varied within its rounding; elsewhere a quantity is NaN.
"""

_OF_THE_FORMULAS = (
    *DRY_FRICTION_QUANTITIES,
    *PIN_LOAD_QUANTITIES,
    COUPLE.error,
    LINE.error,
    "force_error",
    "power",
)
"""Quantities with checks of their own: the range in which dry friction holds, its
residual, error bars, a product.
"""
COMPARED_QUANTITIES = tuple(
    name for name in STAGE_OF if name not in (*_OF_THE_FORMULAS, *LINE_QUANTITIES)
)
"""Quantities that are compared with an exact engine: all that is printed of a position.
"""
_OF_THE_LINE = {
    "stroke": "sin_mu",
    "drive_line": "sin_mu",
    "stroke_speed": "v_B",
    LINE.value: COUPLE.value,
}
"""Quantities of a drive that exerts a force; each is compared if the quantity it maps
to is compared or the engine answers it.
"""
_FOLLOWING = _OF_THE_LINE.keys() - {LINE.value}
"""Those of them that are due where they follow from the angles and speeds answered. The
force takes the place of the torque and is due itself.
"""
_OF_FORCES = (*FORCE_NAMES, *DRY_FRICTION_QUANTITIES)
_MOST_UNDECIDED = 0.5
"""Share of the numbers of a scene which have digits to decide by, and which the errors
that an engine predicts of itself may nevertheless leave undecided.
"""
_SLOW_DRIVE = 0.1
"""Part of the drive's greatest speed above which a simulation's forces are judged. The
torque on bar 3 or 4, the force of a cylinder and the pin forces have poles where the
speed of the drive vanishes.
"""
CLOSURE = "a e^{i theta_2} + b e^{i theta_3} = d e^{i theta_1} + c e^{i theta_4}"
NO_POSITION = "no position at which"
NO_VALUE = "the formulas state no value"
NOT_DEMANDED = f"{NO_POSITION} it is demanded"
NOWHERE = "no number at any position"


class Demands(NamedTuple):
    """Tolerance, quantities and predictions that an answer is held to."""

    tolerance: ErrorBound
    quantities: Sequence[str]
    """Quantities that it must have."""
    predicted: Predicted | None = None
    """Errors predicted for it.

    With them an error beyond the tolerance must be within TIMES_PREDICTED times its
    prediction.
    """
    answer_nearby: AnswerNearby | None = None
    """Evaluation near a position. With it an error beyond the tolerance is taken again
    within theta_2's rounding.
    """
    method: str = ""
    """Method for which the errors are predicted, as the end of a reason."""
    of_itself: bool = False
    """True if the engine itself predicts its errors: no prediction of the harness hides
    what is wrong.
    """


@dataclass
class Comparison:
    """One answer held to the formulas."""

    name: str
    scene: Scene
    answer: Answer
    formulas: Solution
    """Solution of the formulas at `answer.at`."""
    demands: Demands
    reference: Solution | None = None
    """Second derivation at the same positions; by default the answer itself. The
    stricter of its condition and that of the formulas sets the allowed error; its scale
    stands in for that of an answer which has too few quantities for one.
    """
    scales: dict[str, tuple[Scale, Array]] = field(default_factory=dict)
    """Scales of `formulas`, conditions of it and `reference`, by quantity, kept from
    earlier answers that were compared with both.
    """

    def rows(self) -> list[Row]:
        """Compare where the loop closes and each quantity.

        What the engine says of itself is a row too.
        """
        answer = self.answer
        if answer.refusal is not None:
            return [self._unmeasured("all", REFUSES, answer.refusal)]
        if answer.assembled is None or len(answer.assembled) != len(self.formulas):
            what = "the engine did not say where the loop closes"
            return [self._unmeasured("assembled", FAILS, what)]
        names = set(self.demands.quantities)
        if self.scene.drive is not None:
            names |= {
                line
                for line, quantity in _OF_THE_LINE.items()
                if quantity in names or line in answer.quantities
            }
        # numbers where both close the loop; those to which condition and N leave digits
        # for any engine to be judged by, or at a reversal, where either side is right;
        # those of them with a verdict: the engine predicts no error as large
        self._counts = np.zeros(3, dtype=int)
        self._closed = self.formulas.assembled & answer.assembled
        rows = [self._compare_assembled()]
        rows += filter(None, map(self._compare, filter(names.__contains__, STAGE_OF)))
        rows += [self._unmeasured("watch", FAILS, alarm) for alarm in answer.alarms]
        numbers, decidable, decided = self._counts.tolist()
        if numbers:  # an engine whose errors hide most of its numbers does not hold
            reason = f"{numbers - decided} of {numbers} numbers are undecided"
            if decidable < numbers:
                reason += f", {numbers - decidable} where no engine can be judged"
            most = 1.0 - (1.0 - _MOST_UNDECIDED) * decidable / numbers
            share = 1.0 - decided / numbers
            row = Row.judged(self._who, "undecided", share, most, reason)
            rows.append(row if decidable else replace(row, verdict=UNDECIDED))
        return rows

    def closure(self) -> Row:
        """Check that the engine's angles close the loop."""
        answer = self.answer
        linkage = self.scene.linkage
        theta = answer.theta
        assert theta is not None and answer.assembled is not None
        condition = 1.0 / count_half_turns(linkage.ground_angle, theta[2])
        allowed = self.demands.tolerance.factor / condition
        if answer.assembled.any():
            reason = f"identity: {CLOSURE}"
        else:
            reason = NOT_DEMANDED
        gap = find_gap(linkage, *theta.values())
        return Row.judged(
            self._who,
            "closure",
            gap,
            allowed,
            reason,
            theta[2],
            condition,
            answer.assembled,
        )

    @property
    def _who(self) -> tuple[str, str, str]:
        """Scene, engine and setting of its rows."""
        return self.name, self.answer.engine, self.answer.setting or "-"

    @cached_property
    def _solution(self) -> Solution | None:
        """Return the answer as a solution."""
        return make_reference(self.scene, self.answer)

    def _unmeasured(self, quantity: str, verdict: str, reason: str) -> Row:
        """Make a row without numbers."""
        return Row.unmeasured(*self._who, quantity, verdict, reason)

    def _compare_assembled(self) -> Row:
        """Compare where both close the loop."""
        theirs = self.answer.assembled
        ours = self.formulas
        command = self.answer.at
        assert theirs is not None and command is not None
        differ = (theirs != ours.assembled) & ~mark_touching(
            self.scene.linkage, command.angle, command.bar
        )
        count = np.count_nonzero(differ)
        if count and not theirs.any():
            return self._unmeasured("assembled", FAILS, NOWHERE)
        if count:
            reason = f"{count} of {len(differ)} positions differ"
        else:
            reason = "the same positions"
        return Row.judged(
            self._who, "assembled", float(count) * differ, 0.0, reason, ours.theta_2
        )

    def _compare(self, quantity: str) -> Row | None:
        """Compare a quantity of the answer, and count its numbers.

        None if neither side has it, or if it is none that is due of the answer.
        """
        formulas = self.formulas
        loaded = any(effect.loaded_pins for effect in self.scene.effects)
        of_jams = loaded and quantity == "drive_condition"
        ours = getattr(formulas, quantity, None)
        theirs = self.answer.quantities.get(quantity)
        if theirs is None and self._solution is not None:
            if of_jams:  # an engine without loads and friction cannot tell
                return None
            theirs = getattr(self._solution, quantity)
        # a scene of positions alone, or a line that does not follow from the answer
        if theirs is None and (ours is None or quantity in _FOLLOWING):
            return None
        if ours is None or theirs is None:
            missing = "the formulas have no answer" if ours is None else "no answer"
            return self._unmeasured(quantity, FAILS, missing)
        closed = self._closed
        self._counts[0] += np.count_nonzero(closed)
        mask = closed & _mark_stated(quantity, formulas.status_code, ours)
        note = ""
        if not np.array_equal(mask, closed):
            unstated = _count(formulas.status_code[closed & ~mask])
            if not mask.any():
                return self._unmeasured(quantity, REFUSES, f"{NO_VALUE}: {unstated}")
            note = f"; not judged: {unstated}"
        tolerance = self.demands.tolerance
        if tolerance.in_time and quantity in FORCE_NAMES:
            mask &= mark_moving_drive(self.scene, formulas)
        if of_jams or quantity in _OF_FORCES:
            # at a reversal the forces of either side are right
            reversing = mask & mark_reversing(
                self.scene, formulas, tolerance.factor, in_time=tolerance.in_time
            )
            mask &= ~reversing
            if reversals := int(np.count_nonzero(reversing)):
                self._counts[1:] += reversals
                count = write_count(reversals, "position")
                note += f"; {count} at which dry friction reverses not judged"
        if not mask.any():
            nowhere = f"{NO_POSITION} this quantity can be compared{note}"
            return self._unmeasured(quantity, UNDECIDED, nowhere)
        errors = self._measure(quantity, ours, theirs, mask)
        worst = judge_errors(
            errors, self._predict(quantity, errors), self.demands.method
        )
        decidable = worst.decided
        if self.demands.of_itself:
            decidable = int(np.count_nonzero(errors.decidable))
        self._counts[1:] += decidable, worst.decided
        return Row(
            *self._who,
            quantity,
            worst.error,
            worst.allowed,
            worst.verdict,
            escape_controls(worst.reason + note),
            float(formulas.theta_2[worst.position]),
            worst.condition,
        )

    def _measure(
        self, quantity: str, ours: Array, theirs: Array, mask: Mask
    ) -> "Errors":
        """Measure the errors of a quantity, and what is allowed at each position.

        A quantity whose size is 0 vanishes with all its terms. Nothing is relative to
        it: its error is in its own unit, and none is allowed. Errors that are too large
        are asked for again within the rounding of theta_2.
        """
        scale, condition = self._scale(quantity, ours)
        vanishes = scale.size == 0.0
        unit = replace_zero_size(scale.size)
        tolerance = self.demands.tolerance
        allowed = np.where(vanishes, 0.0, tolerance.allowed(condition) * scale.factor)
        error = find_error(quantity, ours, theirs, unit)
        beyond = mask & (error > allowed)
        again = np.full(error.shape, np.nan)
        if self.demands.answer_nearby is not None and beyond.any():
            nearby = self.demands.answer_nearby()[quantity]
            again = np.where(beyond, find_error(quantity, ours, nearby, unit), again)
        return Errors(
            error=np.fmin(error, again),
            allowed=allowed,
            scale=scale._replace(size=unit),
            relative=~vanishes,
            condition=condition,
            mask=mask,
            tolerance=tolerance,
            again=again,
        )

    def _predict(self, quantity: str, errors: "Errors") -> Array | None:
        """Predict the errors beyond the allowed ones, (n,), in the errors' unit.

        None where nothing predicts them, or none is beyond. A position that was asked
        again needs no more than what is allowed there: the prediction knows nothing of
        theta_2's rounding. N multiplies none: sensitivities hold the terms that cancel.
        """
        predicted = self.demands.predicted
        if predicted is None or not errors.beyond.any():
            return None
        expected = predicted(quantity, errors.beyond)
        if expected is None:
            return None
        share = divide(expected, errors.scale.size)
        was_asked = np.isfinite(errors.again)
        share = np.where(was_asked, np.fmin(share, errors.allowed), share)
        return np.nan_to_num(share, nan=0.0, posinf=np.inf)

    @cached_property
    def _sizes(self) -> tuple[TermSizes, TermSizes | None]:
        """Return the sizes of the formulas' quantities, and of the answer's.

        Sizes of the reference stand in where the answer has too few.
        """
        scene = self.scene
        answered = size_answer(scene, self._solution)
        answered = answered or size_answer(scene, self.reference)
        return TermSizes(scene, self.formulas), answered

    def _scale(self, quantity: str, ours: Array) -> tuple[Scale, Array]:
        """Return scale and condition of a quantity at each position, (n,).

        Of formulas and another derivation the stricter one counts: the larger
        condition, and the pair of size and N that allows less.
        """
        sizes, answered = self._sizes
        if quantity not in self.scales:
            link = self.scene.linkage
            condition = find_condition(quantity, link, self.formulas)
            reference = self._solution if self.reference is None else self.reference
            if reference is not None:
                theirs = find_condition(quantity, link, reference)
                condition = np.fmin(np.fmax(condition, theirs), 1.0)
            self.scales[quantity] = sizes.scale(quantity, ours), condition
        scale, condition = self.scales[quantity]
        if answered is not None:
            values = getattr(answered.solution, quantity)
            if values is not None:
                scale = scale.take_strictest(answered.scale(quantity, values))
        return scale, condition


@dataclass(frozen=True)
class Errors:
    """Errors of a quantity, (n,), in one unit."""

    error: Array
    allowed: Array
    """Errors that the tolerance allows; a row may be allowed what is predicted."""
    scale: Scale
    """Divisor of the errors and N. The size is 1 of the quantity's unit if it is 0."""
    relative: Mask
    """Positions at which they are parts of the quantity's size."""
    condition: Array
    mask: Mask
    """Positions that are compared."""
    tolerance: ErrorBound
    """Tolerance that the errors are held to."""
    again: Array
    """Errors of a second answer within the rounding of theta_2; NaN where not asked."""

    @cached_property
    def decidable(self) -> Mask:
        """Positions that are compared and have enough digits to decide by."""
        most = max(MOST_ALLOWED, self.tolerance.factor)
        return self.mask & (self.allowed <= most)

    @cached_property
    def judged(self) -> Mask:
        """Positions that have a verdict.

        An error that is no number needs no digits; but where round-off is as large as
        the number itself, none is as good as any.
        """
        missing = ~np.isfinite(self.error) & (self.allowed < 1.0)
        return self.decidable | (self.mask & missing)

    @cached_property
    def beyond(self) -> Mask:
        """Positions at which the error is beyond the allowed one, or is no number."""
        return self.judged & ~(self.error <= self.allowed)

    def explain(self, at: int) -> str:
        """Say in a sentence what is allowed at a position, and why."""
        why = self.tolerance.explain(float(self.condition[at]))
        cancellation = float(self.scale.cancellation[at])
        if cancellation > K:
            why += f", times N/K: the terms cancel {cancellation:.2g}-fold"
        if self.scale.vanishes[at]:
            why += ", of the sum of its terms, which cancel"
        return why

    def explain_undecided(self, at: int) -> str:
        """Say why there are too few digits to decide by at a position."""
        why = f"eps/condition = {EPS / self.condition[at]:.1e}"
        cancellation = float(self.scale.cancellation[at])
        if cancellation > K:
            why += f", the terms cancel {cancellation:.2g}-fold"
        return why


class _WorstPosition(NamedTuple):
    """Verdict on a quantity, and the position where its error is worst."""

    position: int
    verdict: str
    reason: str
    error: float
    allowed: float
    condition: float
    decided: int
    """Number of positions that have a verdict."""


def judge_errors(
    errors: Errors,
    predicted: Array | None,
    method: str = "",
) -> _WorstPosition:
    """Judge the errors of a quantity by the allowed error.

    Larger ones are judged by TIMES_PREDICTED times the predicted one, which the row
    then states as `allowed`. An error that is no number fails. The position is that
    where an error uses most of what is allowed.

    `predicted`: (n,), None where nothing predicts the errors. `method`: for which they
    are predicted, as the end of a reason.
    """
    beyond = errors.beyond
    bound = errors.allowed
    no_digit: Mask = np.zeros_like(beyond)
    if predicted is not None:
        bound = np.where(beyond, np.maximum(bound, TIMES_PREDICTED * predicted), bound)
        # where a first-order prediction reaches the value itself, no digit is left, and
        # where it is infinite no number is as good as any
        is_part = errors.relative & np.isfinite(errors.error)
        reaches = np.where(is_part, predicted >= 1.0, predicted == np.inf)
        no_digit = np.asarray(beyond & reaches)
    used = find_used(errors.error, bound)
    used = np.where(no_digit, np.minimum(used, 1.0), used)
    candidates = next(
        (mask for mask in (beyond, errors.judged) if mask.any()), errors.mask
    )
    at = int(np.where(candidates, used, -1.0).argmax())
    error = float(errors.error[at])
    if not errors.judged[at]:
        verdict = UNDECIDED
        why = errors.explain_undecided(at)
    elif math.isnan(error) and not no_digit[at]:
        verdict = FAILS
        why = "NaN"
    elif predicted is None or not beyond[at]:
        verdict = FAILS if beyond[at] else AGREES
        why = errors.explain(at)
    elif no_digit[at]:
        verdict = UNDECIDED
        why = f"an error of {predicted[at]:.1e} of the value is predicted"
    elif used[at] <= 1.0:
        verdict = DEGRADED
        expected = f"{predicted[at]:.1e} predicted for this position"
        why = f"{error:.1e} of {expected}{method}"
    else:
        verdict = FAILS
        why = f"{error:.1e} where {predicted[at]:.1e} was predicted{method}"
    if errors.judged.any():
        undecided = np.count_nonzero(errors.mask & ~errors.decidable)
        if undecided:
            limit = f"more than {MOST_ALLOWED:g} allowed"
            count = write_count(int(undecided), "position")
            why += f"; {count} with {limit} not judged"
        settled = int(np.count_nonzero(errors.again <= errors.allowed))
        if settled:
            count = write_count(settled, "position")
            why += f"; {count} within the rounding of theta_2"
    return _WorstPosition(
        at,
        verdict,
        why,
        error,
        float(bound[at]),
        float(errors.condition[at]),
        int(np.count_nonzero(errors.decidable & ~no_digit)),
    )


def _mark_stated(quantity: str, code: Codes, ours: Array) -> Mask:
    """Mark where the formulas have a single value of a quantity, (n,).

    After an overflow these are the quantities computed before it.
    """
    if quantity in _OF_FORCES:
        # A jam at rest concerns the motion that would begin, so its forces are stated.
        # Forces with several solutions are not: an engine may find another one, or not
        # converge.
        jammed = (code == JAMMED) & np.isfinite(magnitude(ours))
        return np.asarray(jammed | (code == OK))
    beyond = (code == OVERFLOW) & np.isnan(magnitude(ours))
    # on a change point no engine can tell the limits of an assembly
    unstated = beyond | (code == SINGULAR) | (code == CHANGE_POINT)
    if quantity == "drive_condition":  # it says how near a jam is
        unstated |= code == JAMMED
    return np.asarray(~unstated)


def _count(codes: Codes) -> str:
    """Count positions by status: "3 singular, 5 no_torque"."""
    counts = Counter(codes.tolist())
    return ", ".join(f"{counts[code]} {STATUS_NAMES[code]}" for code in sorted(counts))


def mark_moving_drive(scene: Scene, formulas: Solution) -> Mask:
    """Mark where no pole of the drive is near, (n,): the input has none."""
    if scene.drive_bar == 2:
        return np.ones(len(formulas), dtype=bool)
    speed = {3: formulas.omega_3, 4: formulas.omega_4}.get(
        scene.drive_bar, formulas.stroke_speed
    )
    return mark_turning(speed)


def mark_turning(speed: Array) -> Mask:
    """Return where the driven bar is fast enough to compare torque and forces, (n,).

    Near a pole, where the bar stands still, torque and pin forces grow without bound.
    """
    fast = np.abs(np.nan_to_num(speed))
    return np.asarray(fast > _SLOW_DRIVE * fast.max())
