"""Curves over a motion as polynomials on panels, for integrals without its steps.

A panel is halved until the polynomial through the nodes of Gauss-Legendre quadrature
represents each curve, and integrals of squares of the polynomials are then exact.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Legendre
from numpy.polynomial.legendre import leggauss, legvander

from fourbar.quantities import Array

NODES = 10
"""Nodes of a panel. The polynomial has a degree less, and its square 18: the rule is
exact up to 19.
"""
SETTLED = 1e-10
"""Error of one panel below which it is not halved. It is the part of the motion that
the panel is, times the last terms of the polynomial over the size of the curve.
"""
HELD = 1e-6
"""Sum of the errors of all panels, over the size of the curve, up to which its
integrals are given: the four digits that are shown hold.
"""
_MOST_HALVINGS = 40
"""Rounds of halving. A jump is then within 1e-12 of the first panels."""
_MOST_OPEN = 2000
"""Panels that are halved at once. A curve that needs more is noise, or has a pole."""

_BESIDE_END = 1e-6
"""Part of a panel by which its polynomial is checked inside both ends. A jump between
the last node and the end is seen there, and what happens on the end itself is not.
"""

_PLACES, _WEIGHTS = leggauss(NODES)
_TO_SERIES = np.linalg.inv(legvander(_PLACES, NODES - 1))
"""Matrix from the values at the nodes to the terms of the Legendre series."""
_CHECKED = np.array([-1.0, 1.0]) * (1.0 - 2.0 * _BESIDE_END)
_TO_CHECKED = legvander(_CHECKED, NODES - 1) @ _TO_SERIES
"""Matrix from the values at the nodes to the polynomial where it is checked."""

ComputeCurves = Callable[[Array], dict[str, Array]]
"""Compute curves at places (n,), by name, each (n, k): k components of one vector."""


class Panels(NamedTuple):
    """Curves over a motion, on panels that follow each other."""

    low: Array
    """Where each panel begins, (p,), rising: the commanded place, or the time."""
    high: Array
    values: dict[str, Array]
    """Values of each curve that settled, at the nodes, (p, NODES, k)."""

    def find_mean_square(self, name: str) -> float:
        """Return the mean of the square of a curve over the motion."""
        squares = np.square(self.values[name]).sum(axis=-1)
        widths = self.high - self.low
        # the weights of the rule are for a panel of width 2
        of_panels = 0.5 * widths * (squares @ _WEIGHTS)
        return float(of_panels.sum() / widths.sum())

    def integrate(self, name: str) -> float:
        """Return the integral of a curve over the motion."""
        widths = self.high - self.low
        of_panels = 0.5 * widths * (self.values[name][..., 0] @ _WEIGHTS)
        return float(of_panels.sum())

    def accumulate(self, name: str, level: float = 0.0) -> Array:
        """Integrate a curve less a level up to where the integral may turn back.

        Such places are the ends of the panels, and the zeros of the difference within
        them. The first integral is 0.
        """
        values = self.values[name][..., 0] - level
        series = values @ _TO_SERIES.T
        # a Legendre polynomial is 1 at the end and 1 or -1 at the start of a panel
        starts = series @ (-1.0) ** np.arange(NODES)
        stops = series.sum(axis=-1)
        signs = np.sign(np.column_stack((starts, values, stops)))
        crosses = signs.min(axis=-1) < signs.max(axis=-1)
        totals = np.cumsum(0.5 * (self.high - self.low) * (values @ _WEIGHTS))
        integrals = [np.zeros(1)]
        for panel in range(len(totals)):
            if crosses[panel]:
                curve = Legendre(series[panel], [self.low[panel], self.high[panel]])
                until = curve.integ(lbnd=self.low[panel])
                begin = totals[panel - 1] if panel else 0.0
                integrals.append(begin + until(_find_zeros(curve)))
            integrals.append(totals[panel : panel + 1])
        return np.concatenate(integrals)


class _Fit(NamedTuple):
    """The polynomials of some panels for one curve."""

    values: Array
    """Values at the nodes, (p, NODES, k)."""
    error: Array
    """Estimate of the error of each, (p,)."""


def _find_zeros(curve: Legendre) -> Array:
    """Find the places in its panel, in order, at which a polynomial is zero."""
    roots = curve.roots()
    zeros = np.sort(roots[np.isreal(roots)].real)
    low, high = curve.domain
    return np.asarray(zeros[(zeros > low) & (zeros < high)])


def fit_panels(
    compute: ComputeCurves,
    edges: Array,
    rounding: Mapping[str, float],
) -> Panels:
    """Halve panels until each curve is settled; leave out the curves that never are.

    A curve that never settles has a pole or positions without a value, or is noise.

    Parameters
    ----------
    compute : curves to represent.
    edges : ends of the first panels, (p + 1,), rising.
    rounding : by name of a curve the size of its rounding, which does not settle.
    """
    length = edges[-1] - edges[0]
    low = edges[:-1]
    high = edges[1:]
    fits = _fit(compute, low, high)
    sizes = {}
    for name, first in fits.items():
        if np.isfinite(first.error).all():
            whole = Panels(low, high, {name: first.values})
            sizes[name] = float(np.sqrt(whole.find_mean_square(name)))
    ends = [np.stack((low, high))]
    fitted = {name: [fits[name]] for name in sizes}
    kept = []
    for halvings in range(_MOST_HALVINGS + 1):
        part = (high - low) / length
        is_open = np.zeros(len(low), dtype=bool)
        for name, size in sizes.items():
            error = part * fitted[name][-1].error
            is_open |= ~(error <= SETTLED * size + rounding[name])
        if halvings == _MOST_HALVINGS or is_open.sum() > _MOST_OPEN:
            is_open[:] = False  # as they are; the sum of their errors tells
        kept.append(~is_open)
        if not is_open.any():
            break
        middle = 0.5 * (low[is_open] + high[is_open])
        low, high = (
            np.concatenate((low[is_open], middle)),
            np.concatenate((middle, high[is_open])),
        )
        fits = _fit(compute, low, high)
        ends.append(np.stack((low, high)))
        for name, rounds in fitted.items():
            rounds.append(fits[name])
    return _join(ends, fitted, kept, sizes, rounding)


def _join(
    ends: list[Array],
    fitted: dict[str, list[_Fit]],
    kept: list[Array],
    sizes: dict[str, float],
    rounding: Mapping[str, float],
) -> Panels:
    """Join the kept panels of all rounds in order, with the curves that settled."""
    low, high = np.concatenate(
        [of_round[:, keep] for of_round, keep in zip(ends, kept, strict=True)],
        axis=1,
    )
    order = np.argsort(low)
    low = low[order]
    high = high[order]
    part = (high - low) / (high - low).sum()
    settled = {}
    for name, rounds in fitted.items():
        errors = [one.error[keep] for one, keep in zip(rounds, kept, strict=True)]
        error = float(part @ np.concatenate(errors)[order])
        if error <= HELD * sizes[name] + rounding[name]:
            values = [one.values[keep] for one, keep in zip(rounds, kept, strict=True)]
            settled[name] = np.concatenate(values)[order]
    return Panels(low, high, settled)


def _fit(compute: ComputeCurves, low: Array, high: Array) -> dict[str, _Fit]:
    """Fit the polynomials of panels to curves, and estimate their errors.

    An error is that of the last two terms, of which one is even and the other odd, or
    that beside the ends.
    """
    middle = 0.5 * (low + high)
    half = 0.5 * (high - low)
    places = middle[:, None] + half[:, None] * np.concatenate((_PLACES, _CHECKED))
    fits = {}
    for name, of_curve in compute(places.ravel()).items():
        curve = of_curve.reshape(*places.shape, -1)
        values = curve[:, :NODES]
        last = np.einsum("ij,pjk->pik", _TO_SERIES[-2:], values)
        checked = np.einsum("ij,pjk->pik", _TO_CHECKED, values)
        terms = np.abs(last).sum(axis=1)
        beside = np.abs(checked - curve[:, NODES:]).max(axis=1)
        fits[name] = _Fit(values, np.maximum(terms, beside).max(axis=-1))
    return fits
