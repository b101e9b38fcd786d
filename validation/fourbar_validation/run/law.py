"""Check a motion law by its own table, or by another form of a standard law.

Engines are handed the angles of a law, so that none of them would notice.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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
    if isinstance(law, Rise):
        restated = _restate_rise(law, command.time)
    elif isinstance(law, Sine):
        restated = _restate_sine(law, command.time)
    elif law.omega is not None:
        restated = _restate_rates(law, command.time)
    else:
        restated = _restate_spline(law, command.time)
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


def _restate_spline(law: Law, time: Array) -> _Restated:
    """Restate a table of angles: the piecewise cubic of continuous acceleration.

    Each piece is the cubic of Hermite through the table's angles with the speeds at its
    ends; that it is the law's is decided by the accelerations of neighbouring pieces
    and by the ends alone.
    """
    t = np.array(law.time)
    angle = np.array(law.angle)
    h = np.diff(t)
    shortest = float(h.min())
    rise = np.diff(angle) / h
    speed = law.at(t)[1]
    first = (6.0 * rise - 4.0 * speed[:-1] - 2.0 * speed[1:]) / h
    last = (-6.0 * rise + 2.0 * speed[:-1] + 4.0 * speed[1:]) / h
    jerk = (last - first) / h
    fastest = float(np.abs(rise).max() + np.abs(speed).max())
    size = fastest + float(np.abs(angle).max()) / shortest
    misfits = [(first[1:] - last[:-1]) * shortest]
    if law.ends == "rest":
        misfits.append(speed[[0, -1]])
    elif law.ends == "periodic":
        misfits.append(
            np.array([speed[0] - speed[-1], (first[0] - last[-1]) * shortest])
        )
    else:  # one cubic through the first two pieces, and through the last two
        jumps = np.array([jerk[1] - jerk[0], jerk[-1] - jerk[-2]])
        misfits.append(jumps * shortest * shortest)
    piece = _find_pieces(t, time)
    s = time - t[piece]
    angle = angle[piece]
    speed = speed[piece]
    first = first[piece]
    jerk = jerk[piece]
    rates = (
        angle + s * (speed + s * (first / 2.0 + s * jerk / 6.0)),
        speed + s * (first + s * jerk / 2.0),
        first + s * jerk,
    )
    return _Restated(
        rates,
        size * shortest,
        shortest,
        "the piecewise cubic through the table, its acceleration continuous",
        float(np.abs(np.concatenate(misfits)).max()) / size,
    )


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


def _restate_standard_law(kind: str, u: Array) -> tuple[Array, Array, Array]:
    """Compute a standard law from 0 to 1 and its two derivatives in other forms."""
    if kind == "cycloidal":
        sine = np.sin(np.pi * u)
        cosine = np.cos(np.pi * u)
        return (
            u - sine * cosine / np.pi,
            2.0 * sine * sine,
            4.0 * np.pi * sine * cosine,
        )
    w = 2.0 * u - 1.0
    return (
        (8.0 + 15.0 * w - 10.0 * w**3 + 3.0 * w**5) / 16.0,
        1.875 * (1.0 - 2.0 * w**2 + w**4),
        15.0 * (w**3 - w),
    )


def _restate_sine(law: Sine, time: Array) -> _Restated:
    """Restate a sine by those of frequency times time and of its phase."""
    w = law.frequency
    turned = np.exp(1j * w * time) * np.exp(1j * law.phase) * law.amplitude
    rates = (law.mean + turned.imag, w * turned.real, -w * w * turned.imag)
    size = abs(law.mean) + abs(law.amplitude) * (1.0 + w * time[-1])
    return _Restated(rates, size, 1.0 / w, "the sine of a sum of angles")


def _restate_rates(law: Law, time: Array) -> _Restated:
    """Restate a table with speeds by Krogh's polynomial of each piece."""
    from scipy.interpolate import KroghInterpolator

    columns = [
        np.array(column) for column in (law.angle, law.omega, law.alpha) if column
    ]
    t = np.array(law.time)
    steps = np.diff(t)
    shortest = float(steps.min())
    size = 0.0
    for order, column in enumerate(columns):
        size += float(steps.max()) ** order * float(np.abs(column).max())
    piece = _find_pieces(t, time)
    rates = np.zeros((3, len(time)))
    for number in np.unique(piece).tolist():
        ends = np.repeat([0.0, steps[number]], len(columns))
        stated = [column[i] for i in (number, number + 1) for column in columns]
        curve = KroghInterpolator(ends, stated)
        here = piece == number
        rates[:, here] = curve.derivatives(time[here] - t[number], 3)
    return _Restated(
        rates,
        size * law.time[-1] / shortest,
        shortest,
        "the polynomial through angles and rates, piece by piece",
    )


def _find_pieces(t: Array, time: Array) -> NDArray[np.intp]:
    """Find the piece of a table of times in which each time lies, (n,)."""
    after = np.searchsorted(t, time, side="right")
    return np.clip(after - 1, 0, len(t) - 2)
