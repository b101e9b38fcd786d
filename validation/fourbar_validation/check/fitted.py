"""Mistakes with a number in them, which is fitted to the table.

The number is a ratio, a factor, an offset or another order.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fourbar.linkage import BAR_NAMES
from fourbar.quantities import FORCE_NAMES, STAGE_OF, STAGES, UNITS, VECTORS, Array
from fourbar.quantities.units import find_factor
from fourbar.scene import Command, Scene
from fourbar.solution import Solution
from fourbar.solving import solve
from fourbar_validation.check.calculated import Calculation, Change
from fourbar_validation.check.judge_table import Judge
from fourbar_validation.check.theirs import OTHER_UNITS, name_quantity
from fourbar_validation.check.variants import (
    Mistake,
    Predict,
    Variant,
    predict_variants,
    state_all,
)
from fourbar_validation.compare.tolerance import compute_difference, replace_zero_size
from fourbar_validation.scenes.bars import list_moving

_Vary = Callable[[float], Variant]
"""Function of a factor that returns the problem in which a number has it."""
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
_LATE = "each row has the numbers of the time"
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


def find_fitted(judge: Judge, differing: list[str]) -> Iterator[Mistake]:
    """List every mistake whose number the table gives, the simplest first."""
    yield from _find_ratios(judge, differing)
    yield from _try_exchanged(differing)
    moved = all(
        key in differing or not np.ptp(judge.ours(key)[judge.where(key)], axis=0).any()
        for key in judge.table.values
        if judge.where(key).any()
    )
    if moved:  # another order or zero leaves nothing right that varies
        yield from _try_order(judge)
    if any(name_quantity(key) in FORCE_NAMES for key in differing):
        yield from _try_factors(judge, differing)
    if moved:
        yield from _try_offset(judge)
    yield from _try_motions(judge, lengths=moved)


def _find_ratios(judge: Judge, differing: list[str]) -> Iterator[Mistake]:
    """Yield columns that are ours times a number.

    The number is named as two units if a pair of them has that ratio.
    """
    by_ratio: dict[tuple[str, float], set[str]] = {}
    for key in differing:
        theirs = judge.table.values[key]
        stated = judge.where(key).reshape(-1, *[1] * (theirs.ndim - 1))
        stated = stated & np.isfinite(theirs)
        ours = judge.ours(key)[stated]
        if not (squares := float(ours @ ours)):
            continue
        near = float(ours @ theirs[stated]) / squares
        if not judge.explained(key, near * judge.ours(key), NEAR_ENOUGH):
            continue
        ratio_found = _name_ratio(judge, key, near)
        if ratio_found is None and np.count_nonzero(ours) >= ENOUGH_NUMBERS and near:
            ratio_found = _round_ratio(judge, key, near)
        if ratio_found is not None:
            group = next((g for g in by_ratio if g[0] == ratio_found[0]), ratio_found)
            by_ratio.setdefault(group, set()).add(name_quantity(key))
    for (text, ratio), quantities in by_ratio.items():
        yield Mistake(
            text,
            lambda quantity, right, ratio=ratio, own=quantities: (  # type: ignore[misc]
                ratio * getattr(right, quantity) if quantity in own else None
            ),
            whole=False,
            times=CARRIED,
        )


def _name_ratio(judge: Judge, key: str, near: float) -> tuple[str, float] | None:
    announced = judge.table.units[key]
    unit = UNITS[name_quantity(key)]
    for unit_tried in OTHER_UNITS.get(unit, ()):
        ratio = math.copysign(announced.factor / find_factor(unit, unit_tried), near)
        if (
            abs(near / ratio - 1.0) < NEAR_A_PLAIN_NUMBER
            and abs(ratio) != 1.0
            and judge.explained(key, ratio * judge.ours(key))
        ):
            text = (
                f"units: numbers in {unit_tried} where {announced.text} was announced"
                f" ({ratio:.6g} times)"
            )
            return text + ", and reversed" * (near < 0.0), ratio
    return None


def _round_ratio(
    judge: Judge,
    key: str,
    near: float,
) -> tuple[str, float] | None:
    """Round to a power of ten, or keep the ratio as fitted.

    A reversed sign is a mistake of its own, and is not named twice.
    """
    if judge.explained(key, -judge.ours(key)):
        return None
    power = round(math.log10(abs(near)))
    ten = math.copysign(10.0**power, near)
    if judge.explained(key, ten * judge.ours(key), CARRIED):
        if ten == -1.0:
            return REVERSED, ten
        return f"every number is {'-' if near < 0.0 else ''}10^{power} times ours", ten
    if judge.explained(key, near * judge.ours(key), CARRIED):
        digits = 5 if abs(abs(near) - 1.0) > _NEARLY_ONE else 12
        return f"every number is {near:.{digits}g} times ours", near
    return None


def _try_exchanged(differing: list[str]) -> Iterator[Mistake]:
    """Try two columns of one unit, each under the name of the other."""
    for one, second in combinations(dict.fromkeys(map(name_quantity, differing)), 2):
        if UNITS[one] == UNITS[second] and (one in VECTORS) == (second in VECTORS):
            taken = {one: second, second: one}
            yield Mistake(
                f"{one} and {second} are exchanged",
                lambda quantity, right, taken=taken: getattr(
                    right, taken.get(quantity, ""), None
                ),  # type: ignore[misc]
                whole=False,
            )


def _compute_residual(
    judge: Judge,
    key: str,
    one: Array,
    base: Array,
) -> Array:
    scale = judge.size(key)
    mask = judge.where(key) & (scale > 0.0)
    scaled = (one[mask] - base[mask]) / (
        scale[mask][:, None] if one.ndim == 2 else scale[mask]
    )
    stated = np.isfinite(judge.table.values[key][mask])
    return np.asarray(np.where(stated, scaled, 0.0)).ravel()


def _try_factors(judge: Judge, differing: list[str]) -> Iterator[Mistake]:
    """Try a moment of inertia, a mass, a load or an effect times a factor.

    Forces and torque are linear in each, so that the doubled number tells the factor.
    """
    keys = [key for key in differing if name_quantity(key) in FORCE_NAMES]
    keys = [
        key for key in keys if not key.startswith("|")
    ] or keys  # a magnitude is linear in none of them
    theirs = np.concatenate(
        [
            _compute_residual(judge, key, judge.table.values[key], judge.ours(key))
            for key in keys
        ]
    )
    if np.count_nonzero(theirs) < ENOUGH_NUMBERS:
        return
    calculation = Calculation(judge.scene, judge.right)
    parts = dict(calculation.list_factors())
    fitted: list[tuple[str, float, Change]] = []
    for doubled in calculation.solve([Change(*part) for part in parts.items()]):
        moves = np.concatenate(
            [
                _compute_residual(judge, key, predicted, judge.ours(key))
                for key in keys
                if (predicted := doubled.prediction(key, judge.right)) is not None
            ]
        )
        squares = float(moves @ moves)
        factor = 1.0 + float(moves @ theirs) / squares if squares else math.nan
        if LEAST_FACTOR < factor < math.inf and factor != 1.0:
            name = doubled.text
            for f, what, times in _name_factors(name, factor):
                more = calculation.none().plus(parts[name], f - 1.0)
                fitted.append((name, times, Change(f"{name} {what}", more)))
    explained = set()
    solved = calculation.solve([change for _, _, change in fitted])
    for (name, times, _), mistake in zip(fitted, solved, strict=True):
        if name in explained:
            continue  # by a plain factor
        yield replace(mistake, times=times)
        if times == 1.0 and all(
            (predicted := mistake.prediction(key, judge.right)) is not None
            and judge.explained(key, predicted)
            for key in keys
        ):
            explained.add(name)


def _name_factors(name: str, factor: float) -> Iterator[tuple[float, str, float]]:
    """Yield the plain factor near a fitted one, and the fitted one.

    Each comes with what was done, and the factor on what is allowed.
    """
    if name.endswith(f": {_INERTIA}"):
        for plain, mistake in _FACTORS.items():
            if abs(factor / plain - 1.0) < NEAR_A_PLAIN_NUMBER:
                yield plain, mistake, 1.0
                break
    yield factor, f"{factor:.6g} times ours (fitted)", CARRIED


def _try_offset(judge: Judge) -> Iterator[Mistake]:
    """Try the commanded angle from another zero, where no stroke is commanded.

    The offset is that at which theirs fit best, refined by Gauss and Newton.
    """
    keys = _list_fitted(judge)
    numbers = sum(np.count_nonzero(judge.where(key)) for key in keys)
    if numbers < ENOUGH_NUMBERS or judge.at.moves_stroke:
        return
    n = len(judge.at.angle)
    rows = np.unique(np.linspace(0, n - 1, _TRIED).round().astype(int))
    tried = 2.0 * np.pi * np.arange(1, OFFSETS_TRIED) / OFFSETS_TRIED
    residuals = _compute_residuals(judge, keys, tried, rows)
    sizes = np.abs(np.nan_to_num(residuals, nan=1.0))
    misfits = np.mean(np.minimum(sizes, 1.0), axis=1)
    if not misfits.min() < PROMISING:
        return
    offset = float(tried[np.argmin(misfits)])
    everything = np.arange(n)
    for _ in range(NEWTON):
        offsets = offset + np.array([0.0, FIT_STEP, -FIT_STEP])
        here, more, less = _compute_residuals(judge, keys, offsets, everything)
        slope = (more - less) / (2.0 * FIT_STEP)
        finite = np.isfinite(here) & np.isfinite(slope)
        if not finite.any():
            return
        squared = float(slope[finite] @ slope[finite])
        if not squared:
            return
        step = float(slope[finite] @ here[finite]) / squared
        offset -= step
        if abs(step) < FIT_STEP**2:
            break
    offset = math.remainder(offset, 2.0 * np.pi)
    moved = judge.at.as_doubles()._replace(angle=judge.at.angle + offset)
    wrong = solve(judge.scene, judge.stage, at=moved)

    name = judge.at.commanded

    def take(quantity: str, right: Solution) -> Array | None:
        return None if quantity == name else getattr(wrong, quantity, None)

    yield Mistake(
        f"the angle of the {BAR_NAMES[judge.at.bar]} is measured from another zero:"
        f" {name} {math.degrees(offset):+.6g} deg is what they solved",
        take,
        times=CARRIED,
    )


def _list_varied(judge: Judge, scene: Scene, lengths: bool) -> dict[str, _Vary]:
    """List the speed, and the lengths where angles are stated, as functions."""
    varied: dict[str, _Vary] = {}
    if lengths and any(key.startswith("theta") for key in judge.table.values):
        usual = {name: bar.length for name, bar in list_moving(scene)}
        for name, length in (*usual.items(), ("ground", scene.linkage.ground)):
            varied[f"{name}: length"] = partial(_stretch, name, length)
    if judge.at.speed is not None:
        varied[f"omega_{judge.at.bar}"] = partial(_hasten, judge.at, judge.at.speed)
    law, times = judge.scene.motion.law, judge.table.times
    if law is not None and times is not None:
        varied[_LATE] = partial(_delay, judge.at, law, times[:, 0])
    return varied


def _stretch(name: str, length: float, factor: float) -> Variant:
    return Variant(name, {f"lengths.{name}": factor * length})


def _hasten(at: Command, speed: float | Array, factor: float) -> Variant:
    return Variant("", at=at._replace(speed=factor * speed))


def _delay(at: Command, law: Any, time: Array, factor: float) -> Variant:
    """Return the problem of the law at times that are earlier by factor - 1, in s."""
    earlier = np.clip(time - (factor - 1.0), law.time[0], law.time[-1])
    angle, speed, acceleration = law.at(earlier)
    moved = at._replace(angle=angle, speed=speed, acceleration=acceleration)
    return Variant(_LATE, at=moved, names=UNITS.keys() - {*at.names})


def _try_motions(judge: Judge, *, lengths: bool) -> Iterator[Mistake]:
    """Try another speed, other lengths and times, each fitted by Gauss and Newton."""
    scene = state_all(judge.scene)
    varied = _list_varied(judge, scene, lengths)
    if not varied:
        return
    keys = _list_fitted(judge)
    factors = dict.fromkeys(varied, 1.0)

    def predict_all(*shifts: float) -> list[Predict]:
        variants = [
            vary(factors[name] + shift)
            for name, vary in varied.items()
            for shift in shifts
        ]
        return predict_variants(scene, judge.at, variants)

    def compute_residual(predict: Predict) -> Array:
        parts = []
        for key in keys:
            predicted = Mistake("", predict).prediction(key, judge.right)
            if predicted is not None:
                theirs = judge.table.values[key]
                parts.append(_compute_residual(judge, key, theirs, predicted))
        return np.concatenate([np.zeros(0), *parts])

    least = math.inf
    for _ in range(NEWTON):
        residuals = [
            compute_residual(predict)
            for predict in predict_all(0.0, FIT_STEP, -FIT_STEP)
        ]
        before = least
        least = float(np.fmin.reduce([np.linalg.norm(here) for here in residuals[::3]]))
        if not least < 0.5 * before:
            break  # nothing fits better, or only by rounding
        for name, here, more, less in zip(
            varied, residuals[::3], residuals[1::3], residuals[2::3], strict=True
        ):
            # a number that jumps beside the position, as friction does, has no slope
            smooth = np.abs(less + more - 2.0 * here) < 0.5 * np.abs(less - more)
            slope = ((less - more) / (2.0 * FIT_STEP))[smooth]
            squares = float(slope @ slope)
            step = float(slope @ here[smooth]) / squares if squares else math.nan
            if 0.0 < factors[name] + step < math.inf:
                factors[name] += step
    for name, predict in zip(varied, predict_all(0.0), strict=True):
        text = f"{name} {factors[name]:.6g} times ours (fitted)"
        if name == _LATE:
            lag = factors[name] - 1.0
            side = "before" if lag > 0.0 else "after"
            text = f"{_LATE} {abs(lag):.6g} s {side} its own (fitted)"
        yield Mistake(text, predict, times=CARRIED)


def _list_fitted(judge: Judge) -> list[str]:
    """List the columns to which a number of the motion is fitted."""
    keys = [key for key in judge.table.values if judge.size(key).any()]
    return sorted(keys, key=_find_stage)[:MOST_FITTED]


def _find_stage(key: str) -> int:
    """Return the number of the stage that computes a quantity."""
    return STAGES.index(STAGE_OF.get(name_quantity(key), "force"))


def _compute_residuals(
    judge: Judge,
    keys: list[str],
    offsets: Array,
    rows: NDArray[np.int_],
) -> Array:
    """Compute theirs against ours at crank angles from other zeros.

    Returns one line for each offset; what they do not state counts as right.
    """
    m = len(offsets)
    repeated = judge.at.part(np.tile(rows, m))
    angle = repeated.angle + np.repeat(offsets, len(rows))
    at = repeated.as_doubles()._replace(angle=angle, time=None)
    latest = max(map(_find_stage, keys))
    moved = solve(judge.scene, STAGES[latest], at=at)
    parts = []
    for key in keys:
        theirs = judge.table.values[key][rows].reshape(len(rows), -1)
        apart = judge.ours(key, moved).reshape(m, *theirs.shape) - theirs
        if name_quantity(key).startswith("theta"):
            apart = np.remainder(apart + np.pi, 2.0 * np.pi) - np.pi
        scaled = apart / replace_zero_size(judge.size(key)[rows])[:, None]
        stated = np.where(np.isfinite(theirs), scaled, 0.0)
        parts.append(stated.reshape(m, -1))
    return np.concatenate(parts, axis=1)


def _try_order(judge: Judge) -> Iterator[Mistake]:
    """Yield the right numbers in other rows: each row of theirs goes to our nearest."""
    table = judge.table
    n = len(judge.at.angle)
    keys = [
        key for key in table.values if judge.where(key).all() and judge.size(key).all()
    ]
    if not ENOUGH_NUMBERS <= n <= MOST_ROWS_REORDERED or not keys:
        return
    apart = np.zeros((n, n))
    for key in keys:
        tiled = np.tile(np.arange(n), n)
        ours = judge.ours(key)[tiled]
        theirs = np.repeat(table.values[key], n, axis=0)
        filled = np.where(np.isnan(theirs), ours, theirs)
        difference = compute_difference(name_quantity(key), ours, filled)
        apart += difference.reshape(n, n) / judge.size(key).max()
    nearest = np.argmin(apart, axis=1)
    in_place = np.arange(n)
    # a revolution ends where it began
    several_alike = len(np.unique(nearest)) < n - 1
    if several_alike or np.array_equal(nearest, in_place):
        return
    steps = np.diff(nearest)
    if np.all(steps[1:-1] == -1):
        direction = f"{table.found_by} runs the other direction"
        text = f"the rows are in reverse order: {direction}"
    elif np.count_nonzero(steps == 1) >= n - 2:
        shifts = np.remainder(nearest - in_place + n / 2, n) - n / 2
        rows = round(float(np.median(shifts)))
        text = (
            f"the rows are shifted by {rows:+d}: each has the numbers of another"
            f" {table.found_by}"
        )
    else:
        text = f"the rows are in another order than their {table.found_by}"

    def take(quantity: str, right: Solution) -> Array | None:
        values = getattr(right, quantity, None)
        if values is None or quantity == right.commanded:
            return None
        return np.asarray(values[nearest])

    yield Mistake(text, take)
