"""Curves over a motion as polynomials on panels: peaks, zeros, means and integrals.

A panel is halved until the polynomial through the nodes of Gauss-Legendre quadrature
represents each curve; integrals of squares of the polynomials are then exact. Beside a
jump or a corner that is no end of a panel the halving goes on until the panel is too
narrow to matter. Towards a pole the values grow with each halving: such a curve has no
largest value and no integral.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import Legendre
from numpy.polynomial.legendre import leggauss, legint, legval, legvander
from numpy.typing import NDArray

from fourbar.quantities import Array

NODES = 10
"""Nodes of a panel. The polynomial has a degree less, and its square 18: the rule is
exact up to 19.
"""
SETTLED = 1e-10
"""Error of one panel below which it is not halved for the integrals. It is the part of
the motion that the panel is, times the last terms of the polynomial over the size of
the curve.
"""
EXTREME_ERROR = 1e-9
"""Error of a panel that may hold an extreme value below which it is not halved, over
the largest value.
"""
ZERO = 1e-12
"""Error of a panel that may hold a zero below which it is not halved, over the largest
value. Forces jump at a zero, so that it must not lie beside a node.
"""
HELD = 1e-6
"""Error of a panel, over the largest value, above which its polynomial is not used for
an extreme value: the values themselves are. The six digits that are shown hold.
"""
TIED = 1e-9
"""Part of the largest value by which another one counts as equal: it is the error of
both.
"""
DEEP, SHALLOW = 38, 26
"""Rounds of halving. The end of an assembly is then within 4e-12 of the first panels,
and an angle there, which changes by the root, within 2e-6; a jump or a pole of forces
within 1.5e-8.
"""
_NOISE = 3e-14
"""Rounding of a curve, over its own values in a panel, in the first panels. At a
distance x from a pole or a limit a value is rounded by some eps/x.
"""
_MOST_OPEN = 2000
"""Panels that are halved at once. A curve that needs more is noise."""
_GROWTH = 1.25
"""Growth of a curve over the last panels of 1, 1/2, 1/4 and 1/8 of a width from which
on it has no bound. A root of 1/x grows by 2.8 there, and what has a bound by nothing.
"""
_PANELS_BESIDE = 3
_BESIDE_END = 1e-6
"""Part of a panel by which its polynomial is checked inside both ends. A jump between
the last node and the end is seen there, and what happens on the end itself is not.
"""
_INSIDE = 1e-8
"""Part of half a panel by which the place of an extreme value stays inside the ends.
Evaluated there, a curve that jumps at the end has the value of this side.
"""
_FLAT = 1e-13
"""Part of the largest value by which values of one polynomial differ by rounding."""
_X, _WEIGHTS = leggauss(NODES)
_TO_SERIES = np.linalg.inv(legvander(_X, NODES - 1))
"""Matrix from the values at the nodes to the terms of the Legendre series."""
_DEGREES = np.arange(1.0, NODES)
_BEYOND_NODES = 0.25 * np.diff(_X).max() * _DEGREES * (_DEGREES + 1.0)
"""Amounts by which the terms of a series may exceed the values at the nodes: half the
largest gap of these, times the steepest slope k (k + 1)/2 of each term.
"""
_CHECKED = np.array([-1.0, 1.0]) * (1.0 - 2.0 * _BESIDE_END)
_TO_CHECKED = legvander(_CHECKED, NODES - 1) @ _TO_SERIES
"""Matrix from the values at the nodes to the polynomial where it is checked."""
_EVALUATED = np.concatenate((_CHECKED[:1], _X, _CHECKED[1:]))

UPPER, LOWER = np.positive, np.negative
"""Ranks of the values of a curve by which the largest, or the least, is its peak."""


class Peak(NamedTuple):
    """Largest or smallest value of a quantity, and where it is taken."""

    value: float
    place: float
    """Commanded angle or stroke at the peak, rad or m. For a motion over time it is the
    time, s.
    """


class Wanted(NamedTuple):
    """What is asked of a curve, and how far it settles."""

    rounding: float = 0.0
    """Size of its rounding, which does not settle."""
    integrated: bool = False
    """True if its integrals are wanted besides its largest size."""
    ranged: bool = False
    """True if both ends of its range are wanted."""
    zeros: bool = False
    """True if its zeros are wanted, and nothing else."""


Curves = dict[str, tuple[Array, Wanted]]
"""Values of curves at n places by name, each (n,) or (n, k): k components. What is
asked of each stands beside it.
"""


@dataclass
class PanelCurve:
    """One curve on the panels of a motion, p of them in the order of the motion."""

    values: Array
    """Values at the nodes, (p, N, k); NaN where it has none."""
    error: Array
    """Estimate of the error of each polynomial, (p,)."""
    poles: list[int]
    """Panels at which the curve grows without bound."""

    @property
    def sizes(self) -> Array:
        """Return the values of a scalar, or the sizes of vectors, (p, N)."""
        return _measure(self.values)

    @cached_property
    def series(self) -> Array:
        """Return the terms of the Legendre series of each panel, (p, N, k)."""
        if self.values.shape[1] == 1:
            return self.values
        return np.asarray(np.einsum("ij,pjk->pik", _TO_SERIES, self.values))


@dataclass
class Panels:
    """Curves over a motion, on panels that follow each other.

    Single positions, with nothing between them, are panels of one node.
    """

    start: Array
    """Where each panel begins, (p,), in the order of the motion: the commanded place,
    or the time.
    """
    stop: Array
    share: Array
    """Part of the motion that each panel is, (p,)."""
    curves: dict[str, PanelCurve]
    located: bool = True
    """False if the panels are single positions."""

    def leave_out(self, panels: NDArray[np.bool_]) -> "Panels":
        """Return the curves without values in some of the panels, (p,)."""
        curves = {}
        for name, curve in self.curves.items():
            values = np.where(panels[:, None, None], np.nan, curve.values)
            curves[name] = replace(curve, values=values)
        return replace(self, curves=curves)

    @property
    def length(self) -> float:
        """Return the angle, stroke or time over which the motion goes."""
        return float(abs(self.stop[-1] - self.start[0]))

    @property
    def growing(self) -> set[str]:
        """Return the names of the curves that grow without bound."""
        return {name for name, curve in self.curves.items() if curve.poles}

    def has_value(self, name: str) -> bool:
        """Return True if a curve has a value anywhere, and a bound."""
        curve = self.curves.get(name)
        if curve is None or curve.poles:
            return False
        return bool(np.isfinite(curve.values).any())

    def list_poles(self, name: str) -> list[float]:
        """List the places at which a curve grows without bound."""
        curve = self.curves.get(name)
        return self.start[curve.poles].tolist() if curve else []

    def find_rms(self, name: str) -> float:
        """Return the root of the mean square of a curve over the motion.

        The mean is that of the panels in which it has values.
        """
        sizes = self.curves[name].sizes
        scale = np.nanmax(np.abs(sizes)) or 1.0
        weights = 0.5 * _WEIGHTS if self.located else np.ones(1)
        means = np.square(sizes / scale) @ weights
        known = np.isfinite(means)
        mean = means[known] @ self.share[known] / self.share[known].sum()
        return float(scale * np.sqrt(mean))

    def accumulate(self, name: str, level: float = 0.0) -> Array:
        """Integrate a curve less a level up to where the integral may turn back.

        Such places are the ends of the panels, and the zeros of the difference within
        them. The first integral is 0, and the last that over the whole motion.
        """
        series = np.nan_to_num(self.curves[name].series[..., 0])
        series[:, 0] -= level
        rising = legint(series.T, lbnd=-1.0).T
        half = 0.5 * self.share * self.length
        whole = 2.0 * half * series[:, 0]
        integrals = [0.0]
        for panel, terms in enumerate(series):
            begin = integrals[-1]
            zeros = _find_panel_zeros(terms)
            until = [half[panel] * legval(zero, rising[panel]) for zero in zeros]
            integrals += [begin + more for more in (*until, whole[panel])]
        return np.array(integrals)

    def find_zeros(self, name: str) -> Array:
        """Find the places at which a curve changes its sign, in order."""
        series = self.curves[name].series[..., 0]
        is_zero = self._are_zero(name)
        least = TIED * np.nanmax(np.abs(self.curves[name].values), initial=0.0)
        zeros = []
        before = 0.0
        for panel, terms in enumerate(series):
            if is_zero[panel] or not np.isfinite(terms).all():
                before = 0.0
                continue
            parts = np.array([-1.0, *_find_panel_zeros(terms)])
            between = 0.5 * (parts + np.append(parts[1:], 1.0))
            for x, value in zip(parts, legval(between, terms), strict=True):
                if before * value < 0.0 and abs(value) > least:
                    zeros.append(self._place(panel, x))
                before = value if abs(value) > least else before
        return np.array(zeros)

    def find_rests(self, name: str) -> Array:
        """Find the places at which a curve begins or ceases to be zero for a while."""
        is_zero = self._are_zero(name)
        known = np.isfinite(self.curves[name].sizes.sum(axis=1))
        changes = (is_zero[1:] != is_zero[:-1]) & known[1:] & known[:-1]
        return np.asarray(self.start[1:][changes])

    def _are_zero(self, name: str) -> NDArray[np.bool_]:
        """Mark the panels in which a curve is zero, (p,)."""
        return np.asarray((self.curves[name].values == 0.0).all(axis=(1, 2)))

    def list_nodes(self) -> Array:
        """List the places of the nodes, (p, N)."""
        half = 0.5 * (self.stop - self.start)
        return (self.start + half)[:, None] + half[:, None] * _X

    def _place(self, panel: int, x: Array) -> Array:
        """Convert places within a panel, from -1 to 1, to those of the motion."""
        start = self.start[panel]
        stop = self.stop[panel]
        return np.asarray(0.5 * (start + stop) + 0.5 * (stop - start) * x)

    def find_peak(self, name: str, rank: Callable[[Array], Array] = np.abs) -> Peak:
        """Find the value of a curve that ranks highest: that of the largest size.

        Of equal ones it is the first. A signed curve keeps the sign of its value.
        """
        curve = self.curves[name]
        sizes = curve.sizes
        at_nodes = np.where(np.isfinite(sizes), rank(sizes), -np.inf)
        scale = np.nanmax(np.abs(sizes))
        best = at_nodes.max(axis=1)
        smooth = curve.error <= HELD * scale
        terms = np.hypot.reduce(np.abs(curve.series[:, 1:]), axis=-1)
        most = best + terms @ _BEYOND_NODES[: terms.shape[1]]
        node = np.argmax(at_nodes >= (best - TIED * scale)[:, None], axis=1)
        rows = np.arange(len(best))
        is_flat = terms.sum(axis=1) <= _FLAT * scale
        x = np.where(is_flat, _INSIDE - 1.0, _X[node])
        values = sizes[rows, node]
        may_exceed = most >= best.max() - TIED * scale
        for row in np.flatnonzero(may_exceed & smooth & ~is_flat):
            x[row], values[row] = _find_extreme(curve.series[row], rank)
        # the polynomial of a panel that was not settled may exceed the curve
        unsure = smooth & (curve.error > EXTREME_ERROR * scale)
        certain = rank(values) - np.where(unsure, curve.error, 0.0)
        ranks = np.where(np.isfinite(values), certain, -np.inf)
        first = int(np.argmax(ranks >= ranks.max() - TIED * scale))
        for after in range(first + 1, len(ranks)):
            rise = ranks[after] - ranks[first]
            # short panels, beside the pole of another curve, hold parts of one rise
            rises = rise > _FLAT * scale
            # the point at which a panel ends has the value that it rises to
            is_end = self.start[after] == self.stop[after] and x[first] == 1.0 - _INSIDE
            if not (rises or (is_end and rise >= 0.0)):
                break
            first = after
        return Peak(float(values[first]), float(self._place(first, x[first])))


def _measure(values: Array) -> Array:
    """Return the values of a scalar, or the sizes of vectors, without the last axis."""
    if values.shape[-1] == 1:
        return values[..., 0]
    return np.asarray(np.hypot.reduce(values, axis=-1))


def _find_extreme(series: Array, rank: Callable[[Array], Array]) -> tuple[float, float]:
    """Find the first place at which a polynomial, (N, k), ranks highest, and its value.

    A number, or the square of a size, has no slope there, unless it is an end.
    """
    square: Any = Legendre(series[:, 0])
    if series.shape[1] > 1:
        scaled = series / (np.abs(series).max() or 1.0)
        square = sum(Legendre(terms) ** 2 for terms in scaled.T)
    stops = [-1.0, *_find_panel_zeros(square.deriv().coef), 1.0]
    x = np.clip(stops, _INSIDE - 1.0, 1.0 - _INSIDE)
    values = _measure(np.moveaxis(legval(x, series), 0, -1))
    ranks = rank(values)
    slack = _FLAT * np.abs(values).max()
    best = int(np.argmax(ranks >= ranks.max() - slack))
    return float(x[best]), float(values[best])


def _find_panel_zeros(series: Array) -> Array:
    """Find where in its panel, from -1 to 1 in order, a polynomial is zero."""
    if abs(series[0]) > np.abs(series[1:]).sum():
        return np.zeros(0)
    roots = Legendre(series).roots()
    zeros = np.sort(roots[np.isreal(roots)].real)
    return zeros[(zeros > -1.0) & (zeros < 1.0)]


class _Fit(NamedTuple):
    """Polynomials of p panels for k curves, which have c components together."""

    start: Array
    stop: Array
    values: Array
    """Values at the nodes, (p, NODES, c)."""
    error: Array
    """Estimate of the error of each, (p, k); infinite where some values are missing,
    zero where all are.
    """
    sizes: Array
    """Values of scalars, or sizes of vectors, at the nodes and beside the ends,
    (p, NODES + 2, k); NaN where they are missing.
    """

    def part(self, rows: Any) -> "_Fit":
        """Return some of the panels."""
        return _Fit(*(column[rows] for column in self))


def fit_panels(
    compute: Callable[[Array], Curves],
    edges: Array,
    most_halvings: int = DEEP,
    points: Any = (),
) -> Panels:
    """Halve panels until each curve is settled.

    Parameters
    ----------
    compute : curves to represent. What is asked of them is that at the edges.
    edges : ends of the first panels, (p + 1,), in the order of the motion.
    most_halvings : number of rounds after which a curve is taken as it is.
    points : ends of panels that become panels of no width besides. A curve that jumps
        there may have a value of its own.
    """
    wanted = {name: asked for name, (_, asked) in compute(edges).items()}
    start, stop = (np.append(points, ends) for ends in (edges[:-1], edges[1:]))
    fit, first = _fit_panels(compute, start, stop)
    # a node next to a pole does not change the size of a curve
    sizes = np.nan_to_num(np.abs(fit.sizes[len(points) :, 1:-1]))
    medians = np.median(sizes, axis=1)
    scale = medians.max(axis=0)
    scale[scale == 0.0] = 1.0
    usual = scale * np.sqrt(np.square(medians / scale).mean(axis=0))
    whole = edges[-1] - edges[0]
    for halvings in range(most_halvings + 1):
        noise = _NOISE * 2.0**halvings * np.fmax.reduce(np.abs(fit.sizes), axis=1)
        is_open = _find_open(fit, whole, usual, [*wanted.values()])
        is_open &= ~(fit.error <= noise)
        halved = is_open.any(axis=1)
        if halvings == most_halvings or not 0 < halved.sum() <= _MOST_OPEN:
            break
        middle = 0.5 * (fit.start + fit.stop)[halved]
        start = np.concatenate((fit.start[halved], middle))
        stop = np.concatenate((middle, fit.stop[halved]))
        halves, _ = _fit_panels(compute, start, stop)
        both = zip(fit.part(~halved), halves, strict=True)
        fit = _Fit(*map(np.concatenate, both))
    order = np.argsort(fit.start * np.sign(whole), kind="stable")
    fit = fit.part(order)
    width = fit.stop - fit.start
    (panels,) = np.nonzero(width)
    is_open = is_open[order][panels]
    values = np.split(fit.values, first[1:], axis=-1)
    curves = {}
    for k, name in enumerate(wanted):
        poles = panels[_find_poles(fit.sizes[panels, 1:-1, k], is_open[:, k])]
        curves[name] = PanelCurve(values[k], fit.error[:, k], poles.tolist())
    return Panels(fit.start, fit.stop, width / width.sum(), curves)


def _find_open(
    fit: _Fit, whole: float, usual: Array, wanted: list[Wanted]
) -> NDArray[np.bool_]:
    """Mark the panels that are halved, (p, k): for extremes, zeros or integrals."""
    rounding, *asked = np.array(wanted).T
    integrated, ranged, zeros = np.array(asked, dtype=bool)
    highest: Array = np.fmax.reduce(fit.sizes, axis=1)
    lowest: Array = np.fmin.reduce(fit.sizes, axis=1)
    most: Array = np.fmax.reduce(highest)
    least: Array = np.fmin.reduce(lowest)
    scale = np.maximum(np.abs(most), np.abs(least))
    highest += fit.error
    lowest -= fit.error
    may_vanish = (lowest <= 0.0) & (highest >= 0.0) & ~(fit.error <= ZERO * scale)
    may_exceed = (highest >= most) | (lowest <= np.where(ranged, least, -scale))
    is_open = may_exceed & ~(fit.error <= EXTREME_ERROR * scale + rounding)
    share = (fit.stop - fit.start) / whole
    of_motion = share[:, None] * fit.error
    is_open |= integrated & ~(of_motion <= SETTLED * usual + rounding)
    return np.where(zeros, may_vanish, is_open)


def split_runs(rows: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    """Split rising numbers where one is left out; none make no run."""
    if not len(rows):
        return []
    return np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)


def _find_poles(sizes: Array, unsettled: NDArray[np.bool_]) -> list[int]:
    """Find the panels that no halving settles and towards which a curve grows.

    The panels beside them have two, four and eight times their width. At a jump and in
    noise the values are as large there.

    `sizes`: of the curve at the nodes, (p, NODES).
    """
    largest = np.nan_to_num(np.abs(sizes)).max(axis=1)
    poles = []
    for run in split_runs(np.flatnonzero(unsettled)):
        beside = [run[0] - _PANELS_BESIDE, run[-1] + _PANELS_BESIDE]
        away = [largest[panel] for panel in beside if 0 <= panel < len(largest)]
        if away and largest[run].max() > _GROWTH * max(away):
            poles.append(int(run[np.argmax(largest[run])]))
    return poles


def _fit_panels(
    compute: Callable[[Array], Curves], start: Array, stop: Array
) -> tuple[_Fit, NDArray[np.intp]]:
    """Fit the polynomials of panels to curves, and estimate their errors.

    An error is that of the last two terms, of which one is even and the other odd, or
    that beside the ends. The index of the first component of each curve is returned
    too, (k,).
    """
    places = start[:, None] + 0.5 * (stop - start)[:, None] * (1.0 + _EVALUATED)
    found = compute(places.ravel()).values()
    columns = [values.reshape(*places.shape, -1) for values, _ in found]
    first = np.cumsum([0, *(column.shape[-1] for column in columns[:-1])])
    curves = np.concatenate(columns, axis=-1)
    values = curves[:, 1:-1]
    last = np.einsum("ij,pjc->pic", _TO_SERIES[-2:], values)
    checked = np.einsum("ij,pjc->pic", _TO_CHECKED, values)
    terms = np.abs(last).sum(axis=1)
    beside = np.abs(checked - curves[:, [0, -1]]).max(axis=1)
    error = np.maximum.reduceat(np.maximum(terms, beside), first, axis=-1)
    sizes = np.hypot.reduceat(curves, first, axis=-1)
    missing = ~np.isfinite(sizes)
    error[missing.any(axis=1)] = np.inf
    error[missing.all(axis=1)] = 0.0
    return _Fit(start, stop, values, error, np.where(missing, np.nan, sizes)), first
