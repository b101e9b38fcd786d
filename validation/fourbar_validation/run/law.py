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
from fourbar_validation.compare.tolerance import IDENTITY, find_worst
from fourbar_validation.run.question import Question


class _Restated(NamedTuple):
    """A law in another form."""

    rates: Sequence[Array] | Array
    """Angle, speed and acceleration at each position, (n,) each."""
    size: float
    """Sum of the terms of the angle, rad or m."""
    shortest: float
    """Least time in which it changes, s: a rate has the size over this."""
    reason: str
    misfit: float = 0.0
    """Part of their size by which its pieces miss what joins them."""


def check_law(question: Question) -> Iterator[Row]:
    """Check angle, speed and acceleration of every position by another form of the law.

    The row has the worst of them, and of the conditions on the pieces of a table.
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
        if order == 0:  # a table of uneven steps overshoots its points
            size = max(size, float(np.abs(ours).max()))
        along.append(np.abs(ours - np.asarray(value)) / size)
    error = np.max(along, axis=0)
    worst = find_worst(error)
    error[worst] = max(error[worst], restated.misfit)
    yield question.row("law", error, IDENTITY.factor, restated.reason)


def _restate_table(law: Law, time: Array) -> _Restated:
    """Restate a table by Krogh's polynomial of each piece.

    It goes through the angles and rates at both ends of the piece. The speeds of a
    table of angles are the law's own; that they are right is decided by the
    accelerations of neighbouring pieces and by the ends alone.
    """
    from scipy.interpolate import KroghInterpolator

    t = np.array(law.time)
    speeds = law.at(t)[1] if law.omega is None else law.omega
    columns = [law.angle, speeds] + [law.alpha] * (law.alpha is not None)
    steps = np.diff(t)
    shortest = float(steps.min())
    after = np.searchsorted(t, time, side="right")
    piece = np.clip(after - 1, 0, len(steps) - 1)
    rates = np.zeros((3, len(time)))
    at_ends = np.zeros((len(steps), 4, 2))
    for number, step in enumerate(steps.tolist()):
        ends = np.array([0.0, step])
        stated = [column[i] for i in (number, number + 1) for column in columns]
        curve = KroghInterpolator(np.repeat(ends, len(columns)), stated)
        at_ends[number] = curve.derivatives(ends, 4)
        here = piece == number
        rates[:, here] = curve.derivatives(time[here] - t[number], 3)
    if law.omega is None:
        fastest = np.abs(np.diff(law.angle) / steps).max() + np.abs(speeds).max()
        size = float(fastest * shortest + np.abs(law.angle).max())
        misfit = _find_misfit(law, at_ends, shortest) * shortest / size
        reason = "the piecewise cubic through the table, its acceleration continuous"
        return _Restated(rates, size, shortest, reason, misfit)
    size = 0.0
    for order, column in enumerate(columns):
        size += float(steps.max()) ** order * float(np.abs(column).max())
    size *= law.time[-1] / shortest
    reason = "the polynomial through angles and rates, piece by piece"
    return _Restated(rates, size, shortest, reason)


def _find_misfit(law: Law, at_ends: Array, shortest: float) -> float:
    """Return the speed, rad/s, by which the pieces of a table of angles miss a spline.

    `at_ends`: angle and derivatives of each piece at both of its ends, (pieces, 4, 2).
    """
    _, speed, acceleration, jerk = np.moveaxis(at_ends, 1, 0)
    first, last = acceleration.T
    misfits = [(first[1:] - last[:-1]) * shortest]
    if law.ends == "rest":
        misfits.append(speed.flat[[0, -1]])
    elif law.ends == "periodic":
        misfits.append(speed.flat[0] - speed.flat[[-1]])
        misfits.append((first[:1] - last[-1:]) * shortest)
    else:  # one cubic through the first two pieces, and through the last two
        misfits.append(np.diff(jerk[[0, 1, -2, -1], 0])[::2] * shortest * shortest)
    return float(np.abs(np.concatenate(misfits)).max())


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
