"""Check a motion law by its own table, or by another form of a standard law.

Engines are handed the angles of a law, so that none of them would notice.
"""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import Polynomial

from fourbar.quantities import Array
from fourbar.scene.motion import Law, Rise, Sine
from fourbar_validation.compare.rows import Row
from fourbar_validation.compare.tolerance import IDENTITY
from fourbar_validation.run.question import Question

_SPLINE_ENDS = {"free": None, "rest": "clamped", "periodic": "periodic"}
"""Conditions at the ends of a B-spline, by the ends of a law."""


class _Restated(NamedTuple):
    """A law in another form."""

    rates: Sequence[Array] | Array
    """Angle, speed and acceleration at each position, (n,) each."""
    size: float
    """Sum of the terms of the angle, rad or m."""
    shortest: float
    """Least time in which it changes, s: a rate has the size over this."""
    reason: str


def check_law(question: Question) -> Iterator[Row]:
    """Check angle, speed and acceleration of every position by another form of the law.

    The row has the worst of them.
    """
    law = question.scene.motion.law
    command = question.at
    if law is None or command.time is None:
        return
    restate: Any = {Rise: _restate_rise, Sine: _restate_sine, Law: _restate_table}
    restated = restate[type(law)](law, command.time)
    along = []
    stated = (command.angle, command.speed, command.acceleration)
    for order, (ours, value) in enumerate(zip(restated.rates, stated, strict=True)):
        size = restated.size / restated.shortest**order
        along.append(np.abs(ours - np.asarray(value)) / size)
    yield question.row("law", np.max(along, axis=0), IDENTITY.factor, restated.reason)


def _restate_table(law: Law, time: Array) -> _Restated:
    """Restate a table by B-splines through its angles, or piece by piece.

    Krogh's polynomial of a piece goes through the angles and rates at both of its ends.
    """
    from scipy.interpolate import KroghInterpolator, make_interp_spline

    t = np.array(law.time)
    steps = np.diff(t)
    shortest = float(steps.min())
    span = float(steps.max())
    columns = [x for x in (law.angle, law.omega, law.alpha) if x is not None]
    rates = np.zeros((3, len(time)))
    if law.omega is None:
        reason = "the cubic B-spline through the table"
        angle = np.array(law.angle)
        mean = 0.0
        if law.ends == "periodic":  # all but a mean speed
            mean = (angle[-1] - angle[0]) / (t[-1] - t[0])
            angle -= mean * t
            angle[-1] = angle[0]
        curve = make_interp_spline(t, angle, bc_type=_SPLINE_ENDS[law.ends])
        rates += [curve(time, order) for order in range(3)]
        rates[:2] += mean * time, np.full(len(time), mean)
    else:
        span = t[-1] - t[0]
        reason = "the polynomial through angles and rates, piece by piece"
        piece = np.clip(np.searchsorted(t, time, side="right") - 1, 0, len(steps) - 1)
        for number in range(len(steps)):
            ends = np.repeat(t[number : number + 2], len(columns))
            stated = [column[i] for i in (number, number + 1) for column in columns]
            here = piece == number
            curve = KroghInterpolator(ends, stated)
            rates[:, here] = curve.derivatives(time[here], 3)
    # a table of uneven steps overshoots its points
    sizes = [np.abs(rates[0]).max()]
    sizes += [np.abs(x).max() * steps.max() ** k for k, x in enumerate(columns)]
    # over which what is fitted together is rounded: a spline by its steps, pieces alone
    size = sum(sizes) * span / shortest
    return _Restated(rates, size, shortest, reason)


def _restate_rise(law: Rise, time: Array) -> _Restated:
    """Restate a rise, its dwell and its fall, part by part.

    Other forms of the standard laws serve:

        cycloidal, with x = pi u:  u - sin x cos x/pi,  2 sin^2 x,  4 pi sin x cos x;
        345, with w = 2 u - 1:  (8 + 15 w - 10 w^3 + 3 w^5)/16 and its derivatives.

    Both sum terms of the size of their result: in powers of u the acceleration of the
    345 law is a difference of terms as large as 120.
    """
    rise, duration = law.rise
    start = getattr(law, f"theta_{law.bar}")
    parts = [(0.0, duration, rise)]
    if law.fall is not None:
        parts.append((duration + law.dwell, law.fall, -rise))
    rates = np.zeros((3, len(time)))
    rates[0] += start
    for begin, lasts, height in parts:
        u = np.clip((time - begin) / lasts, 0.0, 1.0)
        for order, rate in enumerate(_restate_standard_law(law.kind, u)):
            rates[order] += height * rate / lasts**order
    shortest = min(lasts for _, lasts, _ in parts)
    # the time of a position is rounded, as a part of the whole motion
    size = (abs(start) + abs(rise)) * law.time[-1] / shortest
    return _Restated(rates, size, shortest, f"the {law.kind} law in another form")


def _restate_standard_law(kind: str, u: Array) -> Sequence[Array]:
    """Compute a standard law from 0 to 1 and its two derivatives in other forms."""
    if kind == "cycloidal":
        sine = np.sin(np.pi * u)
        cosine = np.cos(np.pi * u)
        return (
            u - sine * cosine / np.pi,
            2.0 * sine * sine,
            4.0 * np.pi * sine * cosine,
        )
    curve = Polynomial((8.0, 15.0, 0.0, -10.0, 0.0, 3.0)) / 16.0
    return [curve.deriv(order)(2.0 * u - 1.0) * 2.0**order for order in range(3)]


def _restate_sine(law: Sine, time: Array) -> _Restated:
    """Restate a sine by those of frequency times time and of its phase."""
    w = law.frequency
    turned = np.exp(1j * w * time) * np.exp(1j * law.phase) * law.amplitude
    rates = (law.mean + turned.imag, w * turned.real, -w * w * turned.imag)
    size = abs(law.mean) + abs(law.amplitude) * (1.0 + w * time[-1])
    return _Restated(rates, size, 1.0 / w, "the sine of a sum of angles")
