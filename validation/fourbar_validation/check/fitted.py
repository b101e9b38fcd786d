"""Mistakes with a number in them, which is fitted to the table.

The number is a ratio, a factor or an offset.
"""

import cmath
import math
from collections.abc import Callable, Iterator
from functools import partial
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from fourbar.effects import Friction, PinFriction
from fourbar.formulas.mobility import TURN
from fourbar.linkage import BAR_NAMES
from fourbar.quantities import FORCE_NAMES, Array
from fourbar.quantities.units import find_factor
from fourbar.scene import Command, Scene
from fourbar.solution import find_unit_of_quantity
from fourbar.studies.keys import replace_numbers
from fourbar_validation.check.calculated import join
from fourbar_validation.check.judge_table import Judge, JudgedColumn, compute_column
from fourbar_validation.check.theirs import OTHER_UNITS
from fourbar_validation.check.wrong_scenes import (
    GRAVITY_ANGLE,
    Mistake,
    drop_remainder,
    find_gravity,
    group_numbers,
    solve_other,
    state_all,
)
from fourbar_validation.compare.bodies import stack_components
from fourbar_validation.compare.tolerance import divide, wrap_difference
from fourbar_validation.scenes.bars import list_moving

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
FITTED = "(fitted)"
"""End of the text of a mistake whose number has no plain name."""
REVERSED = "sign reversed, or F_ij given for F_ji"
_AXES = {
    (False, 0.0): "",
    (False, 180.0): REVERSED,
    (True, 0.0): "y reversed",
    (True, 90.0): "x and y exchanged",
    (True, 180.0): "x reversed",
}
"""Names of axes by whether they are mirrored, and their angle, deg."""
LEAST_NUMBER = 1e-9
"""Least fitted number. What a smaller one multiplies was left out, which is a mistake
of its own.
"""
NEAR_A_PLAIN_NUMBER = 1e-2
"""Relative distance within which a fitted number is tried as a plain one."""
OFFSETS_TRIED = 72
"""Offsets of the crank angle that are tried before one is fitted, 5 deg apart."""
PROMISING = 0.5
"""Mean misfit, as a part of each quantity's size and at most 1 of each number, below
which an offset is fitted. Within 2.5 deg of the right one it is a few hundredths.
"""
_TRIED = 37
"""Rows by which the offsets are tried."""
NEWTON = 9
"""Steps of the fit. It is quadratic; an offset starts within 2.5 deg, and a speed that
is a sixth of the right one takes eight steps.
"""
FIT_STEP = 1e-6
"""Step of the finite difference from which the fit finds its slope."""
_IN_VAIN = 0.9
"""Part of a misfit that a step leaves of it, above which a fit is given up."""
_NEARLY_ONE = 1e-3
"""Distance from 1 below which five digits do not tell a ratio from it."""
_PARTS_OF_A_STEP = (1.0, 0.25)
"""Parts of a step of which the first that is nearer is taken: towards a speed that is
many times ours the slopes lead too far.
"""


def find_fitted(judge: Judge, differing: list[JudgedColumn]) -> Iterator[Mistake]:
    """List every mistake whose number the table gives, the simplest first."""
    yield from _find_ratios(judge, differing)
    yield from _try_exchanged(judge, differing)
    yield from _fit_problems(judge, differing)


def _find_ratios(judge: Judge, differing: list[JudgedColumn]) -> Iterator[Mistake]:
    """Yield columns that are ours times a number, vectors also in other axes."""
    by_text: dict[str, dict[str, Array]] = {}
    for column in differing:
        for text, multiple in (*_list_multiples(column), *_list_offsets(column)):
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
    right: Any = compute_column(column.judge.right, column.quantity)
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


def _list_offsets(column: JudgedColumn) -> Iterator[tuple[str, Array]]:
    """List the constant by which numbers may differ from ours, as of a sensor."""
    if column.ours.ndim > 1 or np.count_nonzero(column.where) < ENOUGH_NUMBERS:
        return
    apart = column.theirs - column.ours
    if column.quantity.startswith("theta"):
        apart = wrap_difference(apart)
    allowed = (column.judged_right[1] * column.divisor)[column.where]
    offset = np.average(apart[column.where], weights=allowed**-2.0)
    number = offset / column.unit.factor
    text = f"every number is ours {number:+.5g} {column.unit.text} {FITTED}"
    yield text, column.ours + offset


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
    unit = find_unit_of_quantity(column.quantity)
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
    right: dict[str, Any] = {
        column.quantity: compute_column(judge.right, column.quantity)
        for column in differing
    }
    for one, second in combinations(right, 2):
        first_unit, unit = map(find_unit_of_quantity, (one, second))
        if first_unit == unit and right[one].shape == right[second].shape:
            taken = {one: right[second], second: right[one]}
            text = f"{one} and {second} are exchanged"
            yield Mistake(text, taken.get, whole=False)


_EVERY = slice(None)


def _compute_residual(
    columns: list[JudgedColumn],
    mistake: Mistake,
    rows: Any = _EVERY,
) -> Array:
    """Compute theirs less what a mistake predicts at some rows, in parts of the size.

    Return (rows, numbers). What they do not state, and what has no size, counts as
    right.
    """
    parts = []
    for column in columns:
        theirs = column.theirs[rows]
        predicted = column.predict(mistake.predict)
        apart = theirs - (column.ours[rows] if predicted is None else predicted)
        if column.quantity.startswith("theta"):
            apart = wrap_difference(apart)
        apart = apart.reshape(len(theirs), -1) / column.divisor[rows, None]
        judged = (column.where & (column.size > 0.0))[rows, None]
        stated = np.isfinite(theirs).reshape(apart.shape)
        parts.append(np.where(judged & stated, apart, 0.0))
    return np.concatenate(parts, axis=1)


class _Family(NamedTuple):
    """Problems that differ by a number, which is fitted."""

    start: float
    """Number at which the fit begins: 1 of a factor, which has no plain name."""
    make: Callable[[float], Mistake]
    """Function of the number that returns the mistake of a problem."""
    of_ours: bool = True
    """True if the first is that of the right problem."""
    least: float = -math.inf
    """Least number that a problem can have."""


def _fit_problems(judge: Judge, differing: list[JudgedColumn]) -> Iterator[Mistake]:
    """Fit numbers of the scene, the command's speed and its zero, whole ones first.

    Each is fitted by Gauss and Newton to the columns that differ.
    """
    columns = [column for column in differing if column.size.any()]
    if not columns:
        return
    right = _compute_residual(
        columns, Mistake("", partial(compute_column, judge.right))
    ).ravel()
    allowed = [
        np.full_like(column.theirs.T, column.judged_right[1]).T for column in columns
    ]
    rounding = np.column_stack(allowed).ravel()
    scene = state_all(judge.scene)
    at = drop_remainder(judge.at)
    jumps = any(isinstance(one, Friction | PinFriction) for one in scene.effects)
    for family in (
        *_list_scenes(scene, at),
        *_list_commands(judge, scene, at, columns),
    ):
        fitted = _fit(columns, family, right, rounding, jumps)
        for number in () if fitted is None else (float(round(fitted)), fitted):
            if abs(number) > LEAST_NUMBER and number >= family.least:
                mistake = family.make(number)._replace(times=CARRIED)
                text = mistake.text
                if family.start == 1.0 or number != round(number):
                    text += f" {FITTED}"
                yield mistake._replace(text=text)
                left = _compute_residual(columns, mistake).ravel()
                if np.all(np.abs(left) <= CARRIED * rounding):
                    break


def _fit(
    columns: list[JudgedColumn],
    family: _Family,
    here: Array,
    rounding: Array,
    jumps: bool,
) -> float | None:
    """Fit the number of a family; None if no other fits better than its first.

    `here`: residual at this one, which is that of the right number if it is ours.
    `rounding`: what is allowed of each residual, by which the last step weighs them.
    `jumps`: whether friction may reverse, so that slopes are looked at on both sides.
    """
    number = family.start

    def measure(number: float) -> Array:
        return _compute_residual(columns, family.make(number)).ravel()

    if not family.of_ours:
        here = measure(number)
    for step in range(NEWTON):
        less = measure(number + FIT_STEP)
        more = 2.0 * here - less
        if jumps or step > 0:
            more = measure(number - FIT_STEP)
        # a number that jumps beside the position, as friction does, has no slope
        smooth = np.abs(less + more - 2.0 * here) < 0.5 * np.abs(less - more)
        slope = np.where(smooth, less - more, 0.0) / (2.0 * FIT_STEP)
        change = _find_change(here, slope)
        size = _find_size(here)
        left = _find_size(here - slope * change)
        if family.of_ours and step == 0 and left > _IN_VAIN * size:
            return None
        for part in _PARTS_OF_A_STEP:
            tried = number - part * change
            there = measure(tried)
            if _find_size(there) < size:
                break
        else:
            break
        number, here = tried, there
        if not _find_size(here) < _IN_VAIN * size:
            break
    if family.of_ours and number == family.start:
        return None
    return number - _find_change(here / rounding, slope / rounding)


def _find_change(residual: Array, slope: Array) -> float:
    """Return the change of a number that leaves the least squares, by its slopes."""
    known = np.isfinite(residual) & np.isfinite(slope)
    slopes = slope[known]
    return float(divide(slopes @ residual[known], slopes @ slopes))


def _find_size(residual: Array) -> float:
    return float(np.sqrt(np.nansum(residual * residual)))


def _list_scenes(scene: Scene, at: Command) -> Iterator[_Family]:
    """List numbers of a scene that may be others, as functions of a factor."""
    fitted = {
        name: group
        for name, group in group_numbers(scene, places=True).items()
        if name.endswith(".length")
    }
    fitted |= group_numbers(scene, places=False)
    lengths = {name: bar.length for name, bar in list_moving(scene)}
    lengths["ground"] = scene.linkage.ground
    for name, length in lengths.items():
        fitted[f"lengths.{name}"] = {f"lengths.{name}": length}
    for name, group in fitted.items():
        least = 0.0 if name.startswith(("bars", "lengths")) else -math.inf
        yield _Family(1.0, partial(_scale, scene, at, name, group), least=least)
    downwards = math.degrees(find_gravity(scene).angle) % 360.0
    yield _Family(360.0 + downwards, partial(_point_gravity, scene, at))


def _scale(
    scene: Scene, at: Command, name: str, group: dict[str, float], factor: float
) -> Mistake:
    numbers = {key: factor * value for key, value in group.items()}
    text = f"{name} {factor:.6g} times ours"
    return solve_other(text, replace_numbers(scene, numbers), at)


def _point_gravity(scene: Scene, at: Command, degrees: float) -> Mistake:
    text = f"gravity points to {180.0 - (180.0 - degrees) % 360.0:.6g} deg"
    other = replace_numbers(scene, {GRAVITY_ANGLE: math.radians(degrees)})
    return solve_other(text, other, at)


def _list_commands(
    judge: Judge, scene: Scene, at: Command, columns: list[JudgedColumn]
) -> Iterator[_Family]:
    """List commands that may be others, as functions of a number."""
    if judge.rows.later is not None:
        yield _Family(0.0, partial(_delay, judge, scene, columns))
    for field, rate in zip(("speed", "acceleration"), at.names[1:], strict=True):
        if np.any(getattr(at, field)):
            yield _Family(1.0, partial(_hasten, judge, scene, at, field, rate))
    if at.speed is not None and not np.any(at.acceleration):

        def accelerate(rate: float) -> Mistake:
            unit = find_unit_of_quantity(at.names[2])
            text = f"{at.names[2]} = {rate:.6g} {unit}, and not 0"
            return solve_other(text, scene, at._replace(acceleration=rate))

        yield _Family(0.0, accelerate)
    if at.moves_stroke:
        return
    n = len(at.angle)
    rows = np.unique(np.linspace(0, n - 1, _TRIED).round().astype(int))
    tried = TURN * np.arange(1, OFFSETS_TRIED) / OFFSETS_TRIED
    each = np.tile(rows, len(tried))
    part = at.part(each)
    turned = part._replace(angle=part.angle + np.repeat(tried, len(rows)))
    residual = _compute_residual(columns, solve_other("", scene, turned), each)
    shares = np.fmin(np.abs(residual), 1.0)
    misfits = shares.reshape(len(tried), -1).mean(axis=1)
    if misfits.min() < PROMISING:
        start = float(tried[np.argmin(misfits)])

        def turn(offset: float) -> Mistake:
            """Return the problem of angles that are counted from another zero, deg."""
            text = (
                f"the angle of the {BAR_NAMES[at.bar]} is measured from another zero:"
                f" {at.commanded} {math.remainder(offset, 360.0):+.6g} deg is what they"
                " solved"
            )
            angle = at.angle + math.radians(offset)
            return solve_other(text, scene, at._replace(angle=angle))

        yield _Family(math.degrees(start), turn, of_ours=False)


def _delay(
    judge: Judge, scene: Scene, columns: list[JudgedColumn], late: float
) -> Mistake:
    """Return the problem of forces, or of all numbers, that are so many ms late."""
    assert judge.rows.later is not None
    at = drop_remainder(judge.rows.later(-late / 1e3))
    word, instant = ("late", "an earlier") if late > 0.0 else ("early", "a later")
    mistake = solve_other(f"{abs(late):.6g} ms {word}", scene, at)
    if all(column.quantity in FORCE_NAMES for column in columns):
        return mistake.within(FORCE_NAMES, f" (forces of {instant} instant)")
    return mistake


def _hasten(
    judge: Judge, scene: Scene, at: Command, field: str, rate: str, factor: float
) -> Mistake:
    later, table = judge.rows.later, judge.stated
    if later and table.found_by == "time" and scene.motion.law is None:
        at = drop_remainder(later((factor - 1.0) * table.places))
    text = f"{rate} {factor:.6g} times ours"
    return solve_other(text, scene, at._replace(**{field: factor * getattr(at, field)}))
