"""Check a motion law by its own table, or by another form of a standard law.

Engines are handed the angles of a law, so that none of them would notice.
"""

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np

from fourbar.quantities import Array
from fourbar.scene.motion import Law, Rise, Sine
from fourbar_validation.compare.rows import Row
from fourbar_validation.compare.tolerance import IDENTITY, find_worst
from fourbar_validation.run.question import Question


def check_law(question: Question) -> Iterator[Row]:
    """Check a motion law by its own table.

    A law is the piecewise cubic through its points whose acceleration is continuous.
    Each piece is the cubic of Hermite through the table's angles with the speeds at its
    ends; that it is the law's is decided by the accelerations of neighbouring pieces
    and by the ends alone. Angle, speed and acceleration of every position, and the
    conditions on the pieces, are judged by the worst of them.
    """
    law = question.scene.motion.law
    command = question.at
    if law is None or command.time is None:
        return
    assert isinstance(command.speed, np.ndarray)
    if isinstance(law, Rise):
        yield _check_rise(question, law)
        return
    if isinstance(law, Sine) or law.omega is not None:
        yield _check_stated(question, law)
        return
    t = np.array(law.time)
    angle = np.array(law.angle)
    h = np.diff(t)
    shortest = float(h.min())
    rise = np.diff(angle) / np.diff(t)
    speed = law.at(t)[1]
    first = (6.0 * rise - 4.0 * speed[:-1] - 2.0 * speed[1:]) / h
    last = (-6.0 * rise + 2.0 * speed[:-1] + 4.0 * speed[1:]) / h
    farthest = float(np.abs(angle).max())
    fastest = float(np.abs(rise).max() + np.abs(speed).max())
    size = fastest + farthest / shortest
    bent = size / shortest
    misfits = [np.abs(first[1:] - last[:-1]) / bent]
    if law.ends == "rest":
        misfits.append(np.abs(speed[[0, -1]]) / size)
    elif law.ends == "periodic":
        jump_of_speed = speed[0] - speed[-1]
        jump_of_acceleration = (first[0] - last[-1]) / shortest
        misfits.append(np.abs([jump_of_speed, jump_of_acceleration]) / size)
    else:  # one cubic through the first two pieces, and through the last two
        jerk = (last - first) / h
        jumps = np.abs([jerk[1] - jerk[0], jerk[-1] - jerk[-2]])
        misfits.append(jumps * shortest / bent)
    knots_before = np.searchsorted(t, command.time, side="right")
    piece = np.clip(knots_before - 1, 0, len(h) - 1)
    theta, omega, alpha = _interpolate_hermite(
        command.time - t[piece],
        angle[piece],
        speed[piece],
        first[piece],
        last[piece],
        h[piece],
    )
    along = [
        np.abs(theta - command.angle) / max(1.0, farthest),
        np.abs(omega - command.speed) / size,
        np.abs(alpha - command.acceleration) / bent,
    ]
    error = np.max(along, axis=0)
    worst = find_worst(error)
    largest = [misfit.max(initial=0.0) for misfit in misfits]
    error[worst] = np.max([error[worst], *largest])
    yield question.row(
        "law",
        error,
        IDENTITY.factor,
        "the piecewise cubic through the table, its acceleration continuous",
    )


def _check_rise(question: Question, law: Rise) -> Row:
    """Check a rise, its dwell and its fall, part by part.

    Other forms of the standard laws serve:

        cycloidal, with x = pi u:  u - sin x cos x/pi,  2 sin^2 x,  4 pi sin x cos x;
        345: the polynomial of Bernstein with the coefficients 0, 0, 0, 1, 1, 1.
    """
    command = question.at
    assert command.time is not None
    assert command.speed is not None
    rise, duration = law.rise
    start = getattr(law, f"theta_{law.bar}")
    parts = [(0.0, duration, rise)]
    if law.fall is not None:
        parts.append((duration + law.dwell, law.fall, -rise))
    rates = np.zeros((3, len(command.time)))
    rates[0] += start
    for begin, lasts, height in parts:
        u = np.clip((command.time - begin) / lasts, 0.0, 1.0)
        for order, rate in enumerate(_restate_law(law.kind, u)):
            rates[order] += height * rate / lasts**order
    shortest = min(lasts for _, lasts, _ in parts)
    stated = [command.angle, command.speed, command.acceleration]
    size = abs(start) + abs(rise)
    # the time of a position is rounded, as a part of the whole motion
    late = law.time[-1] / shortest
    along = []
    for order, value in enumerate(stated):
        apart = np.abs(rates[order] - np.asarray(value))
        along.append(apart * shortest**order / (size * late))
    reason = f"the {law.kind} law in another form"
    return question.row("law", np.max(along, axis=0), IDENTITY.factor, reason)


def _check_stated(question: Question, law: Law | Sine) -> Row:
    """Check a sine, or a table with speeds, by another form of its formula."""
    command = question.at
    time = command.time
    assert time is not None
    rates: Any
    if isinstance(law, Sine):
        rates = _add_angles(law, time)
        shortest = 1.0 / law.frequency
        size = abs(law.mean) + abs(law.amplitude) * (1.0 + law.frequency * time[-1])
        reason = "the sine of a sum of angles"
    else:
        rates = _solve_pieces(law, time)
        shortest = float(np.diff(law.time).min())
        stated = [law.angle, law.omega or (0.0,), law.alpha or (0.0,)]
        longest = float(np.diff(law.time).max())
        size = sum(
            longest**order * float(np.abs(column).max())
            for order, column in enumerate(stated)
        )
        size *= law.time[-1] / shortest
        reason = "the polynomial through angles and rates, solved for piece by piece"
    along = []
    for order, value in enumerate([command.angle, command.speed, command.acceleration]):
        apart = np.abs(rates[order] - np.asarray(value))
        along.append(apart * shortest**order / size)
    return question.row("law", np.max(along, axis=0), IDENTITY.factor, reason)


def _add_angles(law: Sine, time: Array) -> tuple[Array, Array, Array]:
    """Compute a sine and its rates from those of frequency times time and phase."""
    w = law.frequency
    turned = np.exp(1j * w * time) * np.exp(1j * law.phase) * law.amplitude
    return law.mean + turned.imag, w * turned.real, -w * w * turned.imag


def _solve_pieces(law: Law, time: Array) -> Array:
    """Solve for the polynomial of each piece; angle and rates at times, (3, n)."""
    stated = [law.angle, law.omega, law.alpha][: 2 if law.alpha is None else 3]
    columns = np.array(stated, dtype=float)
    count = 2 * len(columns)
    powers = np.arange(count)
    rates = np.zeros((3, len(time)))
    for piece, (start, stop) in enumerate(pairwise(law.time)):
        h = stop - start
        here = (time >= start) & (time <= stop)

        def derive(u: Any, order: int) -> Any:
            """Return the derivatives of the powers of u, one a column."""
            factor = np.ones(count)
            for step in range(order):
                factor = factor * (powers - step)
            return factor * np.power.outer(u, np.maximum(powers - order, 0))

        orders = range(len(columns))
        left = [derive(u, order) for u in (0.0, 1.0) for order in orders]
        right = [columns[k, n] * h**k for n in (piece, piece + 1) for k in orders]
        coefficients = np.linalg.solve(np.array(left), np.array(right))
        u = (time[here] - start) / h
        for order in range(3):
            rates[order, here] = derive(u, order) @ coefficients / h**order
    return rates


def _restate_law(kind: str, u: Array) -> tuple[Array, Array, Array]:
    """Compute a standard law from 0 to 1 and its two derivatives in other forms."""
    v = 1.0 - u
    if kind == "cycloidal":
        sine = np.sin(np.pi * u)
        cosine = np.cos(np.pi * u)
        return (
            u - sine * cosine / np.pi,
            2.0 * sine * sine,
            4.0 * np.pi * sine * cosine,
        )
    place = u**3 * (10.0 * v * v + 5.0 * u * v + u * u)
    speed = 30.0 * (u**4 - 2.0 * u**3 + u * u)
    return place, speed, 60.0 * (2.0 * u**3 - 3.0 * u * u + u)


def _interpolate_hermite(
    s: Array,
    angle: Array,
    speed: Array,
    first: Array,
    last: Array,
    h: Array,
) -> tuple[Array, Array, Array]:
    """Return angle, speed and acceleration a time s into a piece, (n,) each.

    The piece has the accelerations `first` and `last` at its ends and lasts h.
    """
    jerk = (last - first) / h
    return (
        angle + s * (speed + s * (first / 2.0 + s * jerk / 6.0)),
        speed + s * (first + s * jerk / 2.0),
        first + s * jerk,
    )
