"""Where each bar can stand: within its stated range the engine closes the loop, just beyond each limit it does not.

The loop is a sum of vectors, d u_1 = a u_2 + b u_3 - c u_4, and any moving bar may come first in it: an engine
that turns bar 2 alone is given the linkage with bar k in that place. The distance that the other two bars have to
span grows steadily while bar k turns from the ground's direction to the opposite one, so the answers beyond and on
the limits and along the ground settle every angle.
"""

import math
from collections.abc import Iterator
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from fourbar.formulas import mobility
from fourbar.linkage import MOVING_BARS, FourBar
from fourbar.scene import Command, Scene
from fourbar_validation.compare.answer import Engine
from fourbar_validation.compare.compare import TOUCHING_MARGIN, Mask, closing_margin
from fourbar_validation.compare.statements.finding import TURN, Finding, Stated, given, same
from fourbar_validation.compare.tolerance import EPS, EQUIVALENCE, Array

BEYOND = 4.0 * TOUCHING_MARGIN
"""Of the sum of the lengths: by this much the loop closes, or misses, past a limit where the engine is tried."""

LENGTHS_ROUNDED = (EPS / 4.0, EPS)
"""Of the perimeter: the lengths were rounded themselves, and between these two a change point may be stated or not."""


def ranges(stated: Stated, engine: Engine) -> Iterator[Finding]:
    """Ranges, limits and full turns of every moving bar, the range of a sweep, and the change points."""
    for bar in MOVING_BARS:
        yield from _of_bar(stated, bar, engine)
    yield stated(_change_points)


def _change_points(linkage: FourBar) -> Finding:
    """By the exact sums of the lengths: which of the two positions with input and ground in line have all bars so."""
    d, a, b, c = (Fraction(length) for length in linkage.lengths)
    missing = {0.0: abs(abs(d - a) - abs(b - c)), math.pi: abs(d + a - b - c)}
    stated, wrong, known = mobility.change_points(linkage), 0, 0
    for psi, gap in missing.items():
        part, angle = float(gap / (d + a + b + c)), linkage.ground_angle + psi
        allowed = EQUIVALENCE.factor * max(1.0, abs(angle))
        here = any(abs(math.remainder(point - angle, TURN)) <= allowed for point in stated)
        known += here
        wrong += part > LENGTHS_ROUNDED[1] if here else part < LENGTHS_ROUNDED[0]
    return Finding(float(wrong + len(stated) - known), 0.0, linkage.ground_angle, "change points")


def step_beyond(linkage: FourBar, theta_2: float) -> float:
    """Compute the angle, rad, by which bar 2 turns until the loop closes, or misses, by BEYOND more."""
    d, a, *_ = linkage.lengths
    psi, little = theta_2 - linkage.ground_angle, BEYOND * sum(linkage.lengths)
    e = max(abs(d - a * np.exp(1j * psi)), little)
    # e grows by d a sin(psi)/e to first order, by d a/(2 e) to second where the bar lies along the ground
    slope = max(d * a * abs(math.sin(psi)) / e, math.sqrt(0.5 * little * d * a / e))
    return float(little / slope) + 4.0 * EPS * (abs(theta_2) + TURN)


class _Question(NamedTuple):
    """What an engine is tried with for one bar, and what the formulas state of it."""

    scene: Scene
    """The linkage with the bar in the place of bar 2."""
    command: Command
    angles: Array
    """Of the bar, rad."""
    inside: Mask
    """Whether the loop closes there."""
    decidable: Mask
    """And it is not rounding that decides."""
    findings: tuple[Finding, ...]
    """Of the statements among themselves."""


def _question(linkage: FourBar, bar: int) -> _Question:
    second, third = (linkage.bar(k) for k in MOVING_BARS if k != bar)
    first = FourBar(linkage.ground, linkage.bar(bar), second, third, linkage.ground_angle)
    shift = math.pi if bar == 4 else 0.0  # the loop runs along bar 4 from B to O4
    spans, full = mobility.intervals(linkage, bar), mobility.turns_fully(linkage, bar)
    expected = [((start + stop) / 2.0, True) for start, stop in spans]
    # that the loop closes up to its limits is seen where the limit positions themselves are examined
    for i, (start, stop) in enumerate(() if full else spans):
        before, after = (start - spans[i - 1][1]) % TURN, (spans[i + 1 - len(spans)][0] - stop) % TURN
        expected.append((start - min(step_beyond(first, start + shift), 0.5 * before), False))
        expected.append((stop + min(step_beyond(first, stop + shift), 0.5 * after), False))
    along = [linkage.ground_angle + angle - shift for angle in (0.0, math.pi)]  # the ground, in both directions
    within = [any((angle - start) % TURN < stop - start for start, stop in spans) for angle in along]
    expected += zip(along, within, strict=True)
    if bar == 2:
        expected += [(angle, True) for angle in mobility.default_range(linkage)]
    angles, inside = (np.array(column) for column in zip(*expected, strict=True))
    limits = [limit[MOVING_BARS.index(bar)] for limit in mobility.limit_positions(linkage, bar)]
    findings = (
        same(f"limits of bar {bar}", limits, [] if full else [end for span in spans for end in span], linkage),
        same(f"swing of bar {bar}", [mobility.swing(linkage, bar)], [spans[0][1] - spans[0][0]], linkage),
        Finding(float(full != all(within)), 0.0, along[0], f"whether bar {bar} turns fully"),
    )
    decidable = np.abs(closing_margin(Scene(first), angles + shift)) > TOUCHING_MARGIN
    command = Command(angles + shift, np.ones(len(angles), np.int8), None, 0.0)
    return _Question(Scene(first), command, angles, inside, decidable, findings)


def _of_bar(stated: Stated, bar: int, engine: Engine) -> Iterator[Finding]:
    tried = stated(_question, bar)
    closes = given(engine, tried.scene, tried.command).assembled
    assert closes is not None
    wrong = tried.decidable & (closes != tried.inside)
    where = float(tried.angles[int(np.argmax(wrong))])
    what = f"bar {bar} at {where!r} rad: the engine finds the opposite" if wrong.any() else "closes where stated"
    yield Finding(float(np.count_nonzero(wrong)), 0.0, where, what)
    yield from tried.findings
