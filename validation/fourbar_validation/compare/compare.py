"""An engine's answer against the formulas: one row per quantity, at the position where it is worst."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fourbar.quantities import (
    CHANGE_POINT,
    COUPLE,
    DRY_FRICTION_QUANTITIES,
    FORCES,
    JAMMED,
    LINE,
    LINE_QUANTITIES,
    OK,
    OVERFLOW,
    PIN_LOAD_QUANTITIES,
    SINGULAR,
    STAGE_OF,
    STATUS_NAMES,
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
    make_plain,
)
from fourbar_validation.compare.scales import (
    make_reference,
    take_smallest_scale,
    take_strictest_condition,
)
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

OF_THE_FORMULAS = (
    *DRY_FRICTION_QUANTITIES,
    *PIN_LOAD_QUANTITIES,
    COUPLE.error,
    LINE.error,
    "force_error",
    "power",
)
"""Quantities with checks of their own: the range in which dry friction holds, its residual, error bars, a product."""
COMPARED = tuple(
    name for name in STAGE_OF if name not in (*OF_THE_FORMULAS, *LINE_QUANTITIES)
)
"""Quantities that are compared with an exact engine: all that is printed of a position."""
OF_THE_LINE = {
    "stroke": "sin_mu",
    "drive_line": "sin_mu",
    "stroke_speed": "v_B",
    LINE.value: COUPLE.value,
}
"""Quantities of a linear drive; each is compared if the quantity it maps to is compared or the engine answers it."""
OF_FORCES = (*FORCES, *DRY_FRICTION_QUANTITIES)
MOST_UNDECIDED = 0.5
"""Share of the numbers of a scene that are undecided, beyond which it does not hold."""
SLOW_DRIVE = 0.1
"""Part of the drive's greatest speed above which a simulation's forces are judged. The torque on bar 3 or 4, the force
of a cylinder and the pin forces have poles where the speed of the drive vanishes."""
CLOSURE = "a e^{i theta_2} + b e^{i theta_3} = d e^{i theta_1} + c e^{i theta_4}"
NOWHERE = "no position at which it is demanded"
NUMBERS = ("error", "allowed", "theta_2", "condition")
"""Names of the numbers of a row."""


class Held(NamedTuple):
    """Tolerance, quantities and predictions that an answer is held to."""

    tolerance: ErrorBound
    quantities: Sequence[str]
    """Quantities that it must have."""
    predicted: Predicted | None = None
    """Errors predicted for it. With them an error beyond the tolerance must be within DEGRADED times its prediction."""
    nearby: Nearby | None = None
    """Evaluation near a position. With it an error beyond the tolerance is taken again within theta_2's rounding."""
    method: str = ""
    """Method for which the errors are predicted, as the end of a reason."""


class _Judged(NamedTuple):
    """Row of a quantity, with the number of positions that have it, and of those with a verdict."""

    row: Row
    numbers: int = 0
    decided: int = 0


@dataclass
class Comparison:
    """One answer held to the formulas."""

    name: str
    scene: Scene
    answer: Answer
    formulas: Solution
    """Solution of the formulas at `answer.at`."""
    held: Held
    reference: Solution | None = None
    """Second derivation at the same positions; by default the answer itself. The stricter of its scale and condition
    and those of the formulas sets the allowed error."""
    scales: Scales = field(default_factory=dict)
    """Scales of `formulas` and `reference`, if an earlier answer was compared with them."""

    def __post_init__(self) -> None:
        if self.reference is None:
            self.scales = {}

    def rows(self) -> list[Row]:
        """Compare where the loop closes, each quantity, and what the engine says of itself."""
        answer = self.answer
        if answer.refusal is not None:
            return [
                Row.unmeasured(
                    self.name,
                    answer.engine,
                    answer.setting,
                    "all",
                    REFUSES,
                    answer.refusal,
                )
            ]
        if answer.assembled is None or len(answer.assembled) != len(self.formulas):
            what = "the engine did not say where the loop closes"
            return [
                Row.unmeasured(
                    self.name, answer.engine, answer.setting, "assembled", FAILS, what
                )
            ]
        names = set(self.held.quantities)
        if self.scene.drive is not None:
            names |= {
                line
                for line, quantity in OF_THE_LINE.items()
                if quantity in names or line in answer.quantities
            }
        judged = [
            one
            for name in STAGE_OF
            if name in names and (one := self._compare(name)) is not None
        ]
        alarms = [self._row("watch", FAILS, alarm) for alarm in answer.alarms]
        numbers, decided = (
            sum(one.numbers for one in judged),
            sum(one.decided for one in judged),
        )
        rows = [self._compare_assembled(), *(one.row for one in judged), *alarms]
        if numbers:  # a scene of which most numbers are undecided does not hold
            reason = f"{numbers - decided} of {numbers} numbers are undecided"
            rows.append(
                Row.judged(
                    self._who,
                    "undecided",
                    (numbers - decided) / numbers,
                    MOST_UNDECIDED,
                    reason,
                )
            )
        return rows

    def closure(self) -> Row:
        """Check that the engine's angles close the loop."""
        answer, linkage = self.answer, self.scene.linkage
        assert answer.at is not None and answer.assembled is not None
        theta_2 = (
            answer.at.angle
            if answer.at.commanded == "theta_2"
            else answer.quantities["theta_2"]
        )
        theta_3, theta_4 = answer.quantities["theta_3"], answer.quantities["theta_4"]
        condition = 1.0 / count_half_turns(linkage.ground_angle, theta_2)
        allowed = (
            IDENTITY if answer.setting == "exact" else self.held.tolerance
        ).factor / condition
        reason = f"identity: {CLOSURE}" if answer.assembled.any() else NOWHERE
        gap = find_gap(linkage, theta_2, theta_3, theta_4)
        return Row.judged(
            self._who,
            "closure",
            gap,
            allowed,
            reason,
            theta_2,
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

    @cached_property
    def _answered_nearby(self) -> dict[str, Array]:
        """Ask again near each position, once an error calls for it."""
        assert self.held.nearby is not None
        return self.held.nearby(self.formulas.assembled)

    def _row(self, quantity: str, verdict: str, reason: str, **numbers: float) -> Row:
        error, allowed, theta_2, condition = (
            float(numbers.get(key, math.nan)) for key in NUMBERS
        )
        return Row(
            *self._who,
            quantity,
            error,
            allowed,
            verdict,
            make_plain(reason),
            theta_2,
            condition,
        )

    def _compare_assembled(self) -> Row:
        """Compare where both close the loop."""
        theirs, ours, command = self.answer.assembled, self.formulas, self.answer.at
        assert theirs is not None and command is not None
        differ = (theirs != ours.assembled) & ~mark_touching(
            self.scene.linkage, command.angle, command.bar
        )
        count = np.count_nonzero(differ)
        reason = (
            f"{count} of {len(differ)} positions differ"
            if count
            else "the same positions"
        )
        return Row.judged(
            self._who, "assembled", float(count) * differ, 0.0, reason, ours.theta_2
        )

    def _compare(self, quantity: str) -> _Judged | None:
        """Compare a quantity where both close the loop and the formulas state a value; None if neither side has it."""
        formulas, scene, tolerance = self.formulas, self.scene, self.held.tolerance
        ours, theirs = (
            getattr(formulas, quantity, None),
            self.answer.quantities.get(quantity),
        )
        if theirs is None and self._solution is not None:
            if quantity == "drive_condition" and any(
                effect.loaded_pins for effect in scene.effects
            ):
                return None  # an engine that passes over loads and friction does not know how near they are to jamming
            theirs = getattr(self._solution, quantity)
        if ours is None and theirs is None:  # the scene states positions only
            return None
        if ours is None or theirs is None:
            missing = "no answer" if theirs is None else "the formulas have no answer"
            return _Judged(self._row(quantity, FAILS, missing))
        assert self.answer.assembled is not None
        both = formulas.assembled & self.answer.assembled
        stated = both & _mark_stated(quantity, formulas, ours)
        closed, unstated = (
            int(np.count_nonzero(both)),
            _count(formulas.status_code[both & ~stated]),
        )
        if unstated and not stated.any():
            return _Judged(
                self._row(
                    quantity, REFUSES, f"the formulas state no value: {unstated}"
                ),
                closed,
            )
        answerable = stated & _mark_answerable(quantity, scene, formulas, tolerance)
        reversing = answerable & _mark_reversing(quantity, scene, formulas, tolerance)
        reversals = int(
            np.count_nonzero(reversing)
        )  # at a reversal the forces of either side are right
        note = f"; not judged: {unstated}" if unstated else ""
        note += (
            f"; {reversals} positions at which dry friction reverses not judged"
            if reversals
            else ""
        )
        mask = answerable & ~reversing
        if not mask.any():
            nowhere = "no position at which this quantity can be compared" + note
            return _Judged(self._row(quantity, UNDECIDED, nowhere), closed, reversals)
        row, decided = self._judge(quantity, ours, theirs, mask, note)
        return _Judged(row, closed, reversals + decided)

    def _judge(
        self, quantity: str, ours: Array, theirs: Array, mask: Mask, note: str
    ) -> tuple[Row, int]:
        """Judge the errors at the positions of `mask`.

        Return the row, and the number of positions with a verdict.
        """
        errors = self._measure(quantity, ours, theirs, mask)
        errors = self._take_again(quantity, ours, errors)
        worst = judge_errors(errors, self._predict(quantity, errors), self.held.method)
        i = worst.position
        row = self._row(
            quantity,
            worst.verdict,
            worst.reason + note,
            error=errors.error[i],
            allowed=worst.allowed,
            theta_2=self.formulas.theta_2[i],
            condition=errors.condition[i],
        )
        return row, worst.decided

    def _measure(
        self, quantity: str, ours: Array, theirs: Array, mask: Mask
    ) -> "Errors":
        """Measure the errors of a quantity, and what is allowed at each position.

        A quantity whose scale is 0 vanishes with all its terms. Nothing is relative to
        it: its error is in its own unit, and none is allowed.
        """
        scale, condition = self._scale(quantity)
        vanishes = scale == 0.0
        unit = replace_zero_size(scale)
        tolerance = self.held.tolerance
        decidable = mask
        if tolerance.conditioned:
            decidable = mask & (condition * NOTHING_TO_TELL > EPS)
        return Errors(
            error=find_error(quantity, ours, theirs, unit),
            allowed=np.where(vanishes, 0.0, tolerance.allowed(condition)),
            unit=unit,
            relative=~vanishes,
            condition=condition,
            mask=mask,
            decidable=decidable,
            tolerance=tolerance,
        )

    def _take_again(self, quantity: str, ours: Array, errors: "Errors") -> "Errors":
        """Ask again within the rounding of theta_2 where an error is beyond the allowed one."""
        beyond = errors.mask & (errors.error > errors.allowed)
        if self.held.nearby is None or not beyond.any():
            return errors
        theirs = self._answered_nearby[quantity]
        again = find_error(quantity, ours, theirs, errors.unit)
        return errors._replace(
            error=np.where(beyond, np.fmin(errors.error, again), errors.error),
            again=again,
            settled=int(np.count_nonzero(beyond & (again <= errors.allowed))),
        )

    def _predict(self, quantity: str, errors: "Errors") -> Array | None:
        """Predict the errors that are beyond the allowed ones, in the unit of the errors.

        None where nothing predicts them. A position that was asked again needs no more
        than what is allowed there: the prediction knows nothing of theta_2's rounding.
        """
        predicted = self.held.predicted
        if predicted is None:
            return None
        beyond = errors.beyond
        if not beyond.any():
            return np.zeros_like(errors.error)
        share = divide(predicted(quantity, beyond), errors.unit)
        if errors.again is not None:
            was_asked = np.isfinite(errors.again)
            share = np.where(was_asked, np.fmin(share, errors.allowed), share)
        return np.nan_to_num(share, nan=0.0, posinf=np.inf)

    def _scale(self, quantity: str) -> tuple[Array, Array]:
        """Return size and condition of a quantity at each position, each the stricter of formulas and reference."""
        if quantity not in self.scales:
            reference = self._solution if self.reference is None else self.reference
            self.scales[quantity] = (
                take_smallest_scale(quantity, self.scene, self.formulas, reference),
                take_strictest_condition(
                    quantity, self.scene.linkage, self.formulas, reference
                ),
            )
        return self.scales[quantity]


class Errors(NamedTuple):
    """Errors of one quantity, each (n,), all in one unit."""

    error: Array
    allowed: Array
    unit: Array
    """What they are divided by: the scale, or 1 of the quantity's unit where that is 0."""
    relative: Mask
    """Positions at which they are parts of the quantity's scale."""
    condition: Array
    mask: Mask
    """Positions that are compared."""
    decidable: Mask
    """Positions of the mask at which digits are left to decide by."""
    tolerance: ErrorBound
    """What they are held to."""
    again: Array | None = None
    """Errors of a second answer within the rounding of theta_2; NaN where not asked."""
    settled: int = 0
    """Number of positions at which that answer agrees."""

    @property
    def beyond(self) -> Mask:
        """Positions at which the error is beyond the allowed one, or is no number."""
        excessive = self.decidable & ~(self.error <= self.allowed)
        return np.asarray(excessive | (self.mask & ~np.isfinite(self.error)))

    @property
    def notes(self) -> str:
        """Positions that were not judged, or were asked again, as the end of a reason."""
        notes = ""
        if undecided := int(np.count_nonzero(self.mask & ~self.decidable)):
            limit = f"eps/condition > {NOTHING_TO_TELL:g}"
            notes += f"; {undecided} positions with {limit} not judged"
        if self.settled:
            notes += f"; {self.settled} positions within the rounding of theta_2"
        return notes


class WorstPosition(NamedTuple):
    """Verdict on a quantity, and the position where its error is worst."""

    position: int
    verdict: str
    reason: str
    allowed: float
    decided: int
    """Number of positions that have a verdict."""


def judge_errors(
    errors: Errors, predicted: Array | None, method: str = ""
) -> WorstPosition:
    """Judge errors by the allowed error, and larger ones by DEGRADED times the predicted one.

    An error that is no number fails. `predicted` is None where nothing predicts it;
    `method` says for which method it is predicted.
    """
    beyond = errors.beyond
    if not (errors.decidable | beyond).any():
        index = int(np.flatnonzero(errors.mask)[0])
        why = f"eps/condition = {EPS / errors.condition[index]:.1e}"
        return WorstPosition(index, UNDECIDED, why, errors.allowed[index], 0)
    if not beyond.any():
        used = find_used(errors.error, errors.allowed)
        index = int(np.argmax(np.where(errors.decidable, used, -1.0)))
        decided = int(np.count_nonzero(errors.decidable))
        why = errors.tolerance.explain(errors.condition[index]) + errors.notes
        return WorstPosition(index, AGREES, why, errors.allowed[index], decided)
    expected = np.zeros_like(errors.error) if predicted is None else predicted
    bound = np.maximum(errors.allowed, TIMES_PREDICTED * expected)
    used = find_used(errors.error, bound)
    # where a first-order prediction reaches the value itself, no digit is left to judge
    hopeless = np.where(errors.relative, expected >= 1.0, expected == np.inf)
    lost = beyond & np.isfinite(errors.error) & hopeless
    used[lost] = np.minimum(used[lost], 1.0)
    index = int(np.argmax(np.where(beyond, used, -1.0)))
    error, foreseen = errors.error[index], expected[index]
    if math.isnan(error):
        verdict, why = FAILS, "NaN"
    elif lost[index]:
        verdict = UNDECIDED
        why = f"an error of {foreseen:.1e} of the value is predicted"
    elif predicted is None:
        verdict, why = FAILS, errors.tolerance.explain(errors.condition[index])
    elif used[index] <= 1.0:
        verdict = DEGRADED
        why = f"{error:.1e} of {foreseen:.1e} predicted for this position{method}"
    else:
        verdict = FAILS
        why = f"{error:.1e} where {foreseen:.1e} was predicted{method}"
    decided = int(np.count_nonzero(errors.decidable & ~lost))
    return WorstPosition(index, verdict, why + errors.notes, bound[index], decided)


def _mark_stated(quantity: str, formulas: Solution, ours: Array) -> Mask:
    """Mark where the formulas have a single value. After an overflow these are the quantities computed before it."""
    if quantity in OF_FORCES:
        # A jam at rest concerns the motion that would begin, so its forces are stated. Forces with several solutions
        # are not: an engine may find another one, or not converge.
        stated = (formulas.status_code == JAMMED) & np.isfinite(magnitude(ours))
        return np.asarray(stated | (formulas.status_code == OK))
    beyond = (formulas.status_code == OVERFLOW) & np.isnan(magnitude(ours))
    jammed = (formulas.status_code == JAMMED) & (
        quantity == "drive_condition"
    )  # drive_condition says how near that is
    # on a change point no engine can tell the limits of an assembly
    in_line = np.isin(formulas.status_code, (SINGULAR, CHANGE_POINT))
    return np.asarray(~in_line & ~beyond & ~jammed)


def _count(codes: NDArray[np.uint8]) -> str:
    """Count positions by status: "3 singular, 5 no_torque"."""
    counts = np.bincount(codes, minlength=len(STATUS_NAMES)).tolist()
    return ", ".join(
        f"{count} {name}"
        for name, count in zip(STATUS_NAMES, counts, strict=True)
        if count
    )


def _mark_reversing(
    quantity: str, scene: Scene, formulas: Solution, tolerance: ErrorBound
) -> Mask:
    """Mark where dry friction reverses, so that a force may have either of two values."""
    near_jamming = quantity == "drive_condition" and any(
        effect.loaded_pins for effect in scene.effects
    )
    if quantity not in OF_FORCES and not near_jamming:
        return np.zeros(len(formulas), dtype=bool)
    return mark_reversing(scene, formulas, tolerance.factor, in_time=tolerance.in_time)


def _mark_answerable(
    quantity: str, scene: Scene, formulas: Solution, tolerance: ErrorBound
) -> Mask:
    """Mark where an engine of this class can be expected to have the quantity."""
    if quantity in FORCES and scene.drive_bar != 2 and tolerance.in_time:
        speed = {3: formulas.omega_3, 4: formulas.omega_4}.get(
            scene.drive_bar, formulas.stroke_speed
        )
        assert speed is not None
        return mark_turning(speed)
    return np.ones(len(formulas), dtype=bool)


def mark_turning(speed: Array) -> Mask:
    """Mark where the driven bar is fast enough that its torque and the pin forces are not near a pole, (n,)."""
    fast = np.abs(np.nan_to_num(speed))
    return np.asarray(fast > SLOW_DRIVE * fast.max())
