"""Spread of a scene's quantities due to its tolerances.

Samples give the spread, and the sensitivities give it to first order.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from fourbar.errors import InputError, expect, needing
from fourbar.formulas.mobility import TURN
from fourbar.linkage import Whole, require_whole
from fourbar.quantities import NOT_ASSEMBLED, Array, Indices, Mask
from fourbar.scene import Scene, command
from fourbar.solution import SHOWN_PARTS, find_values, split_parts
from fourbar.solving import split
from fourbar.studies.derivatives import Sensitivity, sensitivity
from fourbar.studies.keys import (
    LEFT_OUT,
    command_key,
    list_entries,
    read_numbers,
    refuse_key,
)
from fourbar.studies.study import Study, take_positions, vary
from fourbar.writing import (
    describe_extent,
    list_names,
    make_html,
    write_between,
)

SAMPLES = 8192
BAND_PERCENTILES = (1.0, 99.0)
"""Percentiles of the band."""
EVALUATED_AT_ONCE = 200_000
"""Members times positions: about 40 quantities of them are 70 MB."""
PARTED = 0.1
"""First order and samples part where their standard deviations differ by more than this
share of the larger: the quantity is no longer straight over the tolerances, and a share
of a variance is that of a straight one.
"""
_MOST_SAMPLES = 10_000_000
"""Samples of a study: their angles and numbers take gigabytes."""
_SEEDS = range(2**128)
"""Whole numbers that seed a generator: it has 128 bits."""
_NEGLIGIBLE = 1e-9
"""Share of the quantity's largest value below which a deviation is rounding. It decides
nothing then.
"""


class Spread(NamedTuple):
    """Spread of a quantity, a component or a magnitude at n positions; SI, rad."""

    nominal: Array
    deviation: Array
    """Standard deviation of the samples."""
    low: Array
    """Percentiles 1 and 99 of the samples."""
    high: Array
    least: Array
    greatest: Array
    worst: Array
    """First-order worst case: sum of |s_i| t_i, to either side of the nominal."""
    shares: Array
    """(k, n), (s_i sigma_i)^2 of each tolerance."""

    @property
    def first_order(self) -> Array:
        """Standard deviation to first order."""
        return np.asarray(np.sqrt(self.shares.sum(axis=0)))

    @property
    def parted(self) -> Mask:
        """Mark where first order and samples differ by more than `PARTED`.

        Positions at which only samples have a value are marked too.
        """
        larger = np.fmax(self.deviation, self.first_order)
        size = np.nanmax(np.abs(self.nominal), initial=0.0)
        apart = np.abs(self.deviation - self.first_order)
        differ = np.isfinite(self.deviation) & ~(apart <= PARTED * larger)
        return np.asarray(differ & (larger > _NEGLIGIBLE * size))


@dataclass(frozen=True, slots=True, eq=False)
class Tolerances:
    """Result of `tolerances`."""

    scene: Scene
    samples: int
    seed: int | None
    """None if the samples were drawn by a generator of the caller's."""
    theta_2: Array
    """(n,), rad."""
    spreads: dict[str, Spread]
    """Spreads by quantity. Vectors are components F12_x, F12_y; pin forces are also
    magnitudes |F12|.
    """
    without: Indices
    """Members without a value of everything at each position, (n,)."""
    apart: int
    """Members that fail to assemble at a position. The nominal linkage assembles there.
    """
    invalid: int
    """Members with a number that no scene takes (a length below zero)."""
    time: Array | None = None
    """Times of the positions along a law, (n,), s."""

    def describe_seed(self) -> str:
        """Say where the random numbers came from."""
        if self.seed is None:
            return "a generator's"
        return f"seed {self.seed}"

    def __repr__(self) -> str:
        drawn = f"{self.samples} samples ({self.describe_seed()})"
        tried = f"{drawn}, {self.apart} of them do not assemble somewhere"
        return (
            f"Tolerances {self.scene.title!r}: {describe_extent(self.theta_2)}, {tried}"
            "\n" + list_names("quantities", self.spreads)
        )

    def _repr_html_(self) -> str:
        head = ("", "nominal", "largest sigma", "largest worst case")
        rows = []
        for part in SHOWN_PARTS:
            if part in self.spreads:
                spread = self.spreads[part]
                cells = [part, write_between(spread.nominal)]
                for x in (spread.deviation, spread.worst):
                    cells.append(f"{np.max(x[np.isfinite(x)], initial=0.0):.3g}")
                rows.append(cells)
        return make_html(repr(self), head, rows)


def tolerances(
    scene: Scene,
    samples: int = SAMPLES,
    seed: int | np.random.Generator = 0,
    *,
    progress: Callable[[float], None] | None = None,
) -> Tolerances:
    """Compute the spread of every quantity at each position, due to the tolerances.

    Quasi-random samples of the toleranced numbers give the estimate.

    With the samples come first-order figures, from s_i = d(quantity)/d(number i): the
    worst case sum |s_i| t_i and the shares (s_i sigma_i)^2 of the variance.

    Parameters
    ----------
    samples : number of points of a scrambled Sobol' sequence.
    seed : whole number, or the generator that scrambles the sequence.
    progress : is given the share that is done, from time to time.

    Raises
    ------
    InputError : no tolerances, a key that the scene does not have, a number that it
        leaves out, a free motion.
    DependencyError : SciPy is not installed.

    Source: I. M. Sobol', USSR Comput. Math. Math. Phys. 7 (1967) 86; error propagation:
    JCGM 100:2008, 5.1.2.
    """
    expect("scene", scene, Scene)
    samples = Whole(2, _MOST_SAMPLES).check("samples", samples)
    is_generator = isinstance(seed, np.random.Generator)
    if not is_generator:
        allowed = "must be a whole number, 0 or more, or a numpy.random.Generator"
        require_whole("seed", seed, _SEEDS, allowed)
    if not scene.tolerances:
        allowed = 'the scene states none; like [tolerances] "lengths.input" = "0.05 mm"'
        raise InputError("tolerances", None, allowed)
    if progress is not None:
        progress(0.0)
    slopes = sensitivity(scene)
    study = _make_members(scene, samples, seed)
    n = len(slopes.solution)
    names = list(slopes.by)
    values = {name: split_parts(name, slopes.value(name)) for name in names}
    spreads = {
        part: _compute_first_order(slopes, part)
        for name, parts in values.items()
        for part in parts
    }
    without = np.zeros(n, dtype=np.intp)
    gone = np.zeros(len(study), dtype=bool)
    nominal_closes = slopes.solution.status_code != NOT_ASSEMBLED
    for columns in split(n, max(1, EVALUATED_AT_ONCE // samples)):
        at = take_positions(study.at, slice(None), columns)
        solution = study.solve(at=at)
        code = solution.status_code
        without[columns] = np.count_nonzero(code, axis=0)
        gone |= ((code == NOT_ASSEMBLED) & nominal_closes[columns]).any(axis=1)
        for name in names:
            number = find_values(solution, name)
            if name.startswith("theta_"):
                # each member counts its turns from its own first position
                turns = np.rint((number - values[name][name][columns]) / TURN)
                number = number - TURN * turns
            for part, sampled in split_parts(name, number).items():
                _fill(spreads[part], columns, sampled)
        if progress is not None:
            progress(columns.stop / n)
    invalid = int(np.count_nonzero(study.invalid))
    return Tolerances(
        scene,
        samples,
        None if is_generator else seed,  # type: ignore[arg-type]
        slopes.solution.theta_2,
        spreads,
        without,
        int(gone.sum()),
        invalid,
        slopes.solution.time,
    )


def _make_members(scene: Scene, samples: int, seed: int | np.random.Generator) -> Study:
    """Make the study of the samples, one member each."""
    with needing("SciPy is needed for tolerances", "studies"):
        from scipy.stats import norm, qmc
    entries = list_entries(scene)
    stated = read_numbers(scene)
    numbers = dict[str, Any]()
    rng = np.random.default_rng(seed)  # a generator is returned as it is
    drawn = qmc.Sobol(len(scene.tolerances), rng=rng).random_base2(
        max(1, (samples - 1).bit_length())
    )[:samples]
    for tolerance, column in zip(scene.tolerances, drawn.T, strict=True):
        if tolerance.key not in entries:
            raise refuse_key(tolerance.key, tolerance.width, list(entries))
        if tolerance.key not in stated:
            raise InputError(tolerance.key, tolerance.width, LEFT_OUT)
        inside = np.clip(column, 0.5 / samples, 1.0 - 0.5 / samples)
        change = norm.ppf(inside) if tolerance.sigma else 2.0 * column - 1.0
        numbers[tolerance.key] = stated[tolerance.key] + tolerance.width * change
    if scene.motion.law is None:
        numbers[command_key(scene)] = command(scene).places
    return vary(scene, numbers)


def _compute_first_order(slopes_of: Sensitivity, part: str) -> Spread:
    """Compute the nominal and the first-order figures of a part of a quantity.

    Figures of the samples are NaN until `_fill` puts them in.
    """
    toleranced = slopes_of.scene.tolerances
    nominal, of_all = slopes_of.find(part)
    keys = list(slopes_of.keys)
    slopes = of_all[[keys.index(tolerance.key) for tolerance in toleranced]]
    deviations = np.array([[tolerance.deviation] for tolerance in toleranced])
    reaches = np.array([[tolerance.reach] for tolerance in toleranced])
    shares = (slopes * deviations) ** 2
    worst = np.asarray(np.abs(slopes * reaches).sum(axis=0))
    deviation, low, high, least, greatest = np.full((5, *nominal.shape), np.nan)
    return Spread(nominal, deviation, low, high, least, greatest, worst, shares)


def _fill(spread: Spread, columns: slice, sampled: Array) -> None:
    """Fill in the samples' figures at some positions.

    Samples without a value are left out.
    """
    if np.isfinite(sampled).all():
        # standard deviation of differences: a mean of equal numbers is rounded
        apart = sampled - np.nan_to_num(spread.nominal[columns])
        spread.deviation[columns] = apart.std(axis=0)
        band = np.percentile(sampled, BAND_PERCENTILES, axis=0)
        spread.low[columns], spread.high[columns] = band
        spread.least[columns] = sampled.min(axis=0)
        spread.greatest[columns] = sampled.max(axis=0)
        return
    for column, values in enumerate(sampled.T, columns.start):
        finite = values[np.isfinite(values)]
        if finite.size > 1:
            _fill(spread, slice(column, column + 1), finite[:, None])
