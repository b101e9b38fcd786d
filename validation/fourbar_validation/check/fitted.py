"""Mistakes with a number in them, which is fitted to the table.

The number is a ratio, a factor, an offset or another order.
"""

import cmath
import math
from collections.abc import Callable, Iterator
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np

from fourbar.formulas.mobility import TURN
from fourbar.linkage import BAR_NAMES
from fourbar.quantities import FORCE_NAMES, STAGE_OF, STAGES, UNITS, VECTORS, Array
from fourbar.quantities.units import find_factor
from fourbar.scene import Command
from fourbar_validation.check.calculated import (
    MISSING,
    Calculation,
    Change,
    join,
)
from fourbar_validation.check.judge_table import Judge, JudgedColumn
from fourbar_validation.check.theirs import OTHER_UNITS
from fourbar_validation.check.variants import (
    Mistake,
    Variant,
    predict_variants,
    state_all,
)
from fourbar_validation.compare.tolerance import compute_difference, wrap_difference
from fourbar_validation.engines.free_body import stack_components
from fourbar_validation.scenes.bars import list_moving

_Vary = Callable[[float], Variant]
"""Function of a number that returns the problem in which a number has it."""
ENOUGH_NUMBERS = 3
"""Numbers that a fitted one must explain: fewer are explained by chance."""
ENOUGH_DIGITS = 3.0
"""Digits of the differences that a mistake of the calculation must explain. Hundreds of
mistakes are tried, and some explain fewer by chance.
"""
CARRIED = 2.0
"""Factor on what is allowed. A fitted number carries the rounding of the numbers it was
fitted to.
"""
NEAR_ENOUGH = 10.0 * CARRIED
"""Factor on what is allowed within which a ratio is looked at more closely: the best
fit has no more of the rounding of its numbers than that.
"""
_FACTORS = {
    0.5: "halved",
    2.0: "doubled",
    1e4: "in kg cm^2 taken for kg m^2",
    1e-4: "10^4 too small",
    4.0: "m L^2/3, of a slender bar about its end, where m L^2/12 is right",
}
"""Factors of a moment of inertia, and the mistake behind each."""
REVERSED = "sign reversed, or F_ij given for F_ji"
_AXES = {
    (False, 0.0): "",
    (False, 180.0): REVERSED,
    (True, 0.0): "y reversed",
    (True, 90.0): "x and y exchanged",
    (True, 180.0): "x reversed",
}
"""Names of axes by whether they are mirrored, and their angle, deg."""
_INERTIA = "moment of inertia"
LEAST_FACTOR = 1e-9
"""Least factor. What a smaller one multiplies was left out, which is a mistake of its
own.
"""
NEAR_A_PLAIN_NUMBER = 1e-2
"""Relative distance within which a fitted number is tried as a plain one."""
OFFSETS_TRIED = 72
"""Offsets of the crank angle that are tried before one is fitted, 5 deg apart."""
_NEARLY_ONE = 1e-3
"""Distance from 1 below which five digits do not tell a ratio from it."""
PROMISING = 0.5
"""Mean misfit, as a part of each quantity's size and at most 1 of each number, below
which an offset is fitted. Within 2.5 deg of the right one it is a few hundredths.
"""
_TRIED = 37
"""Rows by which the offsets are tried."""
MOST_FITTED = 3
"""Quantities to which an offset is fitted, those of the motion first."""
NEWTON = 9
"""Steps of the fit. It is quadratic; an offset starts within 2.5 deg, and a speed that
is a sixth of the right one takes eight steps.
"""
FIT_STEP = 1e-6
"""Step of the finite difference from which the fit finds its slope, rad."""
MOST_ROWS_REORDERED = 1000
"""Rows among which another order is looked for. Every one is held against every other.
"""


def find_fitted(judge: Judge, differing: list[JudgedColumn]) -> Iterator[Mistake]:
    """List every mistake whose number the table gives, the simplest first."""
    yield from _find_ratios(judge, differing)
    yield from _try_exchanged(judge, differing)
    moved = all(
        column in differing or not np.ptp(column.ours[column.where], axis=0).any()
        for column in judge.columns.values()
        if column.where.any()
    )
    if moved:  # another order or zero leaves nothing right that varies
        yield from _try_order(judge)
    if any(column.quantity in FORCE_NAMES for column in differing):
        yield from _try_factors(judge, differing)
    yield from _try_motions(judge, moved=moved)


def _find_ratios(judge: Judge, differing: list[JudgedColumn]) -> Iterator[Mistake]:
    """Yield columns that are ours times a number, vectors also in other axes."""
    by_text: dict[str, dict[str, Array]] = {}
    for column in differing:
        for text, multiple in _list_multiples(column):
            if column.explained(column.measure(multiple), CARRIED):
                if text:
                    by_text.setdefault(text, {})[column.quantity] = multiple
                break
    for text, multiples in by_text.items():
        yield Mistake(text, multiples.get, whole=False, times=CARRIED)


def _list_multiples(column: JudgedColumn) -> Iterator[tuple[str, Array]]:
    """List what a column may be of ours, the simplest first: its name, its numbers.

    As x + i y a vector, or its mirror image, has a complex factor in other axes.
    """
    right = column.judge.right[column.quantity]
    stated = (np.isfinite(column.theirs).T & column.where).T
    numbers = int(np.count_nonzero(column.ours[stated]))
    for mirrored in (False, True)[: column.ours.ndim]:
        units = [1.0, 1.0j][: column.ours.ndim]
        basis = [_multiply(unit, column.ours, mirrored)[stated] for unit in units]
        fit = np.linalg.lstsq(np.transpose(basis), column.theirs[stated], rcond=None)
        near = complex(*fit[0])
        nearly = _multiply(near, column.ours, mirrored)
        if not near or not column.explained(nearly, NEAR_ENOUGH):
            continue
        for axes, turn in _list_axes(near, mirrored, numbers):
            for text, ratio in _list_ratios(column, abs(near), numbers):
                multiple = _multiply(ratio * turn, right, mirrored)
                yield ", ".join(filter(None, (axes, text))), multiple


def _multiply(ratio: complex, values: Array, mirrored: bool) -> Array:
    """Multiply numbers, (n,), or vectors or their mirror images, (n, 2)."""
    if values.ndim == 1:
        return ratio.real * values
    vectors = join(values)
    return stack_components(ratio * (np.conj(vectors) if mirrored else vectors))


def _list_axes(
    near: complex, mirrored: bool, numbers: int
) -> Iterator[tuple[str, complex]]:
    """List the axes in which ours may be, and the factor of a vector in each."""
    sense = 1j if mirrored else -1j
    fitted = (math.degrees(cmath.phase(near)) * sense).imag
    for degrees in (float(round(fitted)), fitted)[: 1 + (numbers > ENOUGH_NUMBERS)]:
        turned = f"in axes turned by {degrees:.5g} deg" + ", y reversed" * mirrored
        name = _AXES.get((mirrored, degrees % 360.0), turned)
        yield name, cmath.exp(sense * math.radians(degrees))


def _list_ratios(
    column: JudgedColumn, near: float, numbers: int
) -> Iterator[tuple[str, float]]:
    """List what a ratio may be, by its name.

    The number is named as two units if a pair of them has that ratio.
    """
    yield "", 1.0
    unit = UNITS[column.quantity]
    announced = column.unit
    for tried in OTHER_UNITS.get(unit, ()):
        ratio = announced.factor / find_factor(unit, tried)
        if abs(near / ratio - 1.0) < NEAR_A_PLAIN_NUMBER:
            text = f"units: numbers in {tried} where {announced.text} was announced"
            yield f"{text} ({ratio:.6g} times)", ratio
    if numbers >= ENOUGH_NUMBERS:
        power = round(math.log10(near))
        yield f"every number is 10^{power} times ours", 10.0**power
        digits = 5 if abs(near - 1.0) > _NEARLY_ONE else 12
        yield f"every number is {near:.{digits}g} times ours", near


def _try_exchanged(judge: Judge, differing: list[JudgedColumn]) -> Iterator[Mistake]:
    """Try two columns of one unit, each under the name of the other."""
    names = dict.fromkeys(column.quantity for column in differing)
    for one, second in combinations(names, 2):
        if UNITS[one] == UNITS[second] and (one in VECTORS) == (second in VECTORS):
            taken = {one: judge.right[second], second: judge.right[one]}
            text = f"{one} and {second} are exchanged"
            yield Mistake(text, taken.get, whole=False)


_EVERY = slice(None)


def _compute_residual(
    columns: list[JudgedColumn],
    mistake: Mistake,
    rows: Any = _EVERY,
) -> Array:
    """Compute theirs less what a mistake predicts at some rows, in parts of the size.

    What they do not state, and what has no size, counts as right.
    """
    parts = [np.zeros(0)]
    for column in columns:
        theirs = column.theirs[rows]
        predicted = column.predict(mistake.predict)
        apart = theirs - (column.ours[rows] if predicted is None else predicted)
        if column.quantity.startswith("theta"):
            apart = wrap_difference(apart)
        apart = apart.reshape(len(theirs), -1) / column.divisor[rows, None]
        judged = (column.where & (column.size > 0.0))[rows, None]
        stated = np.isfinite(theirs).reshape(apart.shape)
        parts.append(np.where(judged & stated, apart, 0.0).ravel())
    return np.concatenate(parts)


def _try_factors(judge: Judge, differing: list[JudgedColumn]) -> Iterator[Mistake]:
    """Try a moment of inertia, a mass, a load or an effect times a factor.

    Damping or friction that the scene leaves out, and a mass centre elsewhere, too.
    Forces and torque are linear in each, so that a unit of it tells the amount.
    """
    columns = [column for column in differing if column.quantity in FORCE_NAMES]
    # a magnitude is linear in none of them
    vectors = [column for column in columns if not column.key.startswith("|")]
    columns = vectors or columns
    right = Mistake("", judge.right.__getitem__)
    theirs = _compute_residual(columns, right)
    if np.count_nonzero(theirs) < ENOUGH_NUMBERS:
        return
    calculation = Calculation(judge.scene, judge.right)
    parts = dict(calculation.list_factors())
    units = [Change(name, one) for name, several in parts.items() for one in several]
    moves: dict[str, list[Array]] = {}
    for unit in calculation.solve(units):
        moved = theirs - _compute_residual(columns, unit)
        moves.setdefault(unit.text, []).append(moved)
    fitted: list[tuple[str, float, Change]] = []
    centres = {name: bar.mass_centre for name, bar in list_moving(calculation.scene)}
    for name, several in moves.items():
        if not np.isfinite(several).all():
            continue
        amounts, *_ = np.linalg.lstsq(np.transpose(several), theirs, rcond=None)
        for text, these, times in _name_amounts(name, amounts.tolist(), centres):
            more = np.tensordot(these, np.array(parts[name]), 1)
            fitted.append((name, times, Change(f"{name} {text}", more)))
    explained = set()
    solved = calculation.solve([change for _, _, change in fitted])
    for (name, times, _), mistake in zip(fitted, solved, strict=True):
        if name in explained:
            continue  # by a plain factor
        yield mistake._replace(times=times)
        if times == 1.0 and all(
            (predicted := column.predict(mistake.predict)) is not None
            and column.explained(predicted)
            for column in columns
        ):
            explained.add(name)


def _name_amounts(
    name: str, amounts: list[float], centres: dict[str, tuple[float, float]]
) -> Iterator[tuple[str, tuple[float, ...], float]]:
    """Yield what fitted amounts of something are, those near plain ones first.

    Each comes with the amounts and the factor on what is allowed.
    """
    amount, *across = amounts
    if name in MISSING:
        if amount > 0.0:
            text = f"{amount:.6g}, which the scene leaves out (fitted)"
            yield text, (amount,), CARRIED
        return
    if across:
        bar = name.partition(":")[0]
        shift = complex(amount, across[0])
        r, phi = cmath.polar(cmath.rect(*centres[bar]) + shift)
        text = f"at {r:.6g} m and {math.degrees(phi):.4f} deg (fitted)"
        yield text, (shift.real, shift.imag, abs(shift) ** 2), CARRIED
        return
    factor = 1.0 + amount
    if name.endswith(f": {_INERTIA}"):
        for plain, mistake in _FACTORS.items():
            if abs(factor / plain - 1.0) < NEAR_A_PLAIN_NUMBER:
                yield mistake, (plain - 1.0,), 1.0
                break
    if amount and factor > LEAST_FACTOR:
        yield f"{factor:.6g} times ours (fitted)", (amount,), CARRIED


def _list_varied(judge: Judge, moved: bool) -> Iterator[_Vary]:
    """List lengths where angles are stated, speed and times, as functions.

    Lengths only if all that varies differs.
    """
    at = judge.at
    if moved and any(key.startswith("theta") for key in judge.columns):
        lengths = {name: bar.length for name, bar in list_moving(judge.scene)}
        lengths["ground"] = judge.scene.linkage.ground
        for name, length in lengths.items():
            yield partial(_stretch, name, length)
    if at.speed is not None:
        yield partial(_hasten, at, at.speed)
    law, times = judge.scene.motion.law, judge.table.times
    if law is not None and times is not None:
        yield partial(_delay, at, law, times[:, 0])


def _turn(at: Command, offset: float) -> Variant:
    """Return the problem of angles that are counted from another zero."""
    degrees = math.degrees(math.remainder(offset, TURN))
    name = at.commanded
    text = (
        f"the angle of the {BAR_NAMES[at.bar]} is measured from another zero:"
        f" {name} {degrees:+.6g} deg is what they solved"
    )
    turned = at._replace(angle=at.angle + offset)
    return Variant(text, at=turned, names=UNITS.keys() - {name}, times=CARRIED)


def _stretch(name: str, length: float, factor: float) -> Variant:
    text = f"{name}: length {factor:.6g} times ours (fitted)"
    return Variant(text, {f"lengths.{name}": factor * length}, times=CARRIED)


def _hasten(at: Command, speed: float | Array, factor: float) -> Variant:
    text = f"omega_{at.bar} {factor:.6g} times ours (fitted)"
    return Variant(text, at=at._replace(speed=factor * speed), times=CARRIED)


def _delay(at: Command, law: Any, time: Array, factor: float) -> Variant:
    """Return the problem of the law at times that are earlier by factor - 1, in s."""
    lag = factor - 1.0
    side = "before" if lag > 0.0 else "after"
    text = f"each row has the numbers of the time {abs(lag):.6g} s {side} its own"
    earlier = np.clip(time - lag, law.time[0], law.time[-1])
    angle, speed, acceleration = law.at(earlier)
    moved = at._replace(angle=angle, speed=speed, acceleration=acceleration)
    names = UNITS.keys() - {*at.names}
    return Variant(f"{text} (fitted)", at=moved, names=names, times=CARRIED)


def _find_stage(column: JudgedColumn) -> int:
    """Return the number of the stage that computes a quantity."""
    return STAGES.index(STAGE_OF.get(column.quantity, "force"))


def _try_motions(judge: Judge, *, moved: bool) -> Iterator[Mistake]:
    """Try another zero of the angle, other lengths, speed and times.

    Each is fitted by Gauss and Newton. A zero is tried if all that varies differs; it
    starts where theirs fit best.
    """
    scene = state_all(judge.scene)
    sized = [column for column in judge.columns.values() if column.size.any()]
    columns = sorted(sized, key=_find_stage)[:MOST_FITTED]
    stage = STAGES[max(map(_find_stage, columns), default=0)]
    offsets: list[float] = []
    numbers = sum(np.count_nonzero(column.where) for column in columns)
    if moved and numbers >= ENOUGH_NUMBERS and not judge.at.moves_stroke:
        n = len(judge.at.angle)
        rows = np.unique(np.linspace(0, n - 1, _TRIED).round().astype(int))
        at = judge.at.part(rows)
        tried = TURN * np.arange(1, OFFSETS_TRIED) / OFFSETS_TRIED
        turned = [_turn(at, offset) for offset in tried]
        wrong = predict_variants(scene, at, turned, stage)
        residuals = [_compute_residual(columns, one, rows) for one in wrong]
        misfits = np.mean(np.fmin(np.abs(residuals), 1.0), axis=1)
        if misfits.min() < PROMISING:
            offsets.append(float(tried[np.argmin(misfits)]))
    varied: list[_Vary] = [partial(_turn, judge.at) for _ in offsets]
    varied += _list_varied(judge, moved)
    fitted = np.ones(len(varied))
    fitted[: len(offsets)] = offsets
    if not varied:
        return

    def list_variants(shifts: tuple[float, ...]) -> list[Variant]:
        pairs = zip(varied, fitted.tolist(), strict=True)
        return [vary(number + shift) for vary, number in pairs for shift in shifts]

    least = np.full(len(varied), np.inf)
    for _ in range(NEWTON):
        variants = list_variants((0.0, FIT_STEP, -FIT_STEP))
        wrong = predict_variants(scene, judge.at, variants, stage)
        residuals = [_compute_residual(columns, one) for one in wrong]
        here, more, less = np.reshape(residuals, (len(varied), 3, -1)).swapaxes(0, 1)
        sizes = np.sqrt(np.nansum(here * here, axis=1))
        if not offsets and not np.any(sizes < 0.5 * least):
            break  # nothing fits better, or only by rounding
        least = np.fmin(least, sizes)
        # a number that jumps beside the position, as friction does, has no slope
        smooth = np.abs(less + more - 2.0 * here) < 0.5 * np.abs(less - more)
        slope = np.where(smooth, less - more, 0.0) / (2.0 * FIT_STEP)
        step = np.nansum(slope * here, axis=1) / np.sum(slope * slope, axis=1)
        fitted = np.where(
            np.isfinite(step) & (fitted + step > 0.0), fitted + step, fitted
        )
    yield from predict_variants(scene, judge.at, list_variants((0.0,)))


def _try_order(judge: Judge) -> Iterator[Mistake]:
    """Yield the right numbers in other rows: each row of theirs goes to our nearest."""
    n = len(judge.at.angle)
    columns = [
        column
        for column in judge.columns.values()
        if column.where.all() and column.size.all()
    ]
    if not ENOUGH_NUMBERS <= n <= MOST_ROWS_REORDERED or not columns:
        return
    apart = np.zeros((n, n))
    for column in columns:
        theirs = np.repeat(column.theirs, n, axis=0)
        ours = np.concatenate([column.ours] * n)
        filled = np.where(np.isnan(theirs), ours, theirs)
        difference = compute_difference(column.quantity, ours, filled)
        apart += difference.reshape(n, n) / column.size.max()
    nearest = np.argmin(apart, axis=1)
    in_place = np.arange(n)
    # a revolution ends where it began
    several_alike = len(np.unique(nearest)) < n - 1
    if several_alike or np.array_equal(nearest, in_place):
        return
    found_by = judge.table.found_by
    steps = np.diff(nearest)
    if np.all(steps[1:-1] == -1):
        text = f"the rows are in reverse order: {found_by} runs the other direction"
    elif np.count_nonzero(steps == 1) >= n - 2:
        shifts = np.remainder(nearest - in_place + n / 2, n) - n / 2
        rows = round(float(np.median(shifts)))
        text = (
            f"the rows are shifted by {rows:+d}: each has the numbers of another"
            f" {found_by}"
        )
    else:
        text = f"the rows are in another order than their {found_by}"

    def take(quantity: str) -> Array | None:
        values = getattr(judge.right, quantity, None)
        if values is None or quantity == judge.right.commanded:
            return None
        return np.asarray(values[nearest])

    yield Mistake(text, take)
