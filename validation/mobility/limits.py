"""At each stated limit position the engine finds the same angles, two bars collinear, and the third one at rest."""

import math
from collections.abc import Iterator

import numpy as np

from fourbar import mobility
from fourbar.linkage import MOVING_BARS, FourBar
from fourbar.scene import Scene
from validation.answer import Engine
from validation.compare import TOUCHING_MARGIN, closing_margin
from validation.mobility.finding import Finding, asked, wrapped
from validation.mobility.ranges import beside
from validation.tolerance import EPS, EQUIVALENCE, NOTHING_TO_TELL, Array, lever


def limit_positions(linkage: FourBar, engine: Engine) -> Iterator[Finding]:
    """The limits of every moving bar; where all bars are collinear there is nothing to be told."""
    yield Finding(0.0, 0.0, linkage.ground_angle, "the same positions")
    for bar in MOVING_BARS:
        found = mobility.limit_positions(linkage, bar)
        limits = [limit for limit in found if bar == 2 or not _all_collinear(linkage, limit)]
        for limit in found:
            told = (0,) if bar == 2 else (1, -1) if limit in limits else (0, 1, -1)
            yield Finding(float(limit.branch not in told), 0.0, limit.theta_2, f"branch of a limit of bar {bar}")
        # at its own limit bar 2 stands where rounding decides whether the loop closes
        steps = [_inwards(linkage, limit.theta_2) if bar == 2 else 0.0 for limit in limits]
        angles = [limit.theta_2 + step for limit, step in zip(limits, steps, strict=True)]
        seen = asked(engine, linkage, angles, [limit.branch or 1 for limit in limits]) if limits else {}
        for i, (limit, step) in enumerate(zip(limits, steps, strict=True)):
            yield from _held(linkage, bar, limit, step, {name: value[i] for name, value in seen.items()})


def _all_collinear(linkage: FourBar, limit: mobility.LimitPosition) -> bool:
    """Whether rounding decides on which branch the position lies."""
    return bool(np.abs(closing_margin(Scene(linkage), np.array([limit.theta_2])))[0] <= TOUCHING_MARGIN)


def _inwards(linkage: FourBar, theta_2: float) -> float:
    """The little that bar 2 turns from its limit to where the loop closes, rad."""
    step = beside(linkage, theta_2)
    ahead, behind = closing_margin(Scene(linkage), np.array([theta_2 + step, theta_2 - step]))
    return step if ahead > behind else -step


def _held(
    linkage: FourBar, bar: int, limit: mobility.LimitPosition, step: float, seen: dict[str, Array]
) -> Iterator[Finding]:
    d, a, b, c = linkage.lengths
    what = f"bar {bar} at theta_2 = {limit.theta_2!r}"
    theta_3, theta_4 = float(seen["theta_3"]), float(seen["theta_4"])
    rates = {3: float(seen["omega_3"]), 4: float(seen["omega_4"])}
    sine, speed = abs(math.sin(theta_4 - theta_3)), max(1.0, *(abs(rate) for rate in rates.values()))
    digits = lever(linkage) * sine
    if digits * NOTHING_TO_TELL <= EPS:
        return
    # the triangle of the ground, the bar, and the other two in one line is known to eps of its perimeter
    upright = abs(math.sin(limit[MOVING_BARS.index(bar)] - linkage.ground_angle))
    rounding = sum(linkage.lengths) / d * (1.0 + (a + b + c) / linkage.bar(bar).length) / max(upright, EPS)
    moved = EQUIVALENCE.factor * rounding
    allowed = EQUIVALENCE.factor / digits + moved * speed
    if bar == 2:  # beside the limit bars 3 and 4 stand off their common line
        e = abs(d - a * np.exp(1j * (limit.theta_2 - linkage.ground_angle)))
        allowed = 2.0 * (max(b, c) / e * sine + (1.0 + a / e) * abs(step))
    for angle, stated in ((theta_3, limit.theta_3), (theta_4, limit.theta_4)):
        yield Finding(abs(float(wrapped(np.array(angle - stated)))), allowed, limit.theta_2, what)
    vectors = {2: limit.theta_2, 3: theta_3, 4: theta_4 + math.pi}  # the loop runs along bar 4 from B to O4
    one, other = (vectors[k] for k in MOVING_BARS if k != bar)
    yield Finding(float((math.cos(one - other) > 0.0) != limit.stretched), 0.0, limit.theta_2, what)
    if bar != 2:
        slowing = abs(float(seen[f"alpha_{bar}"]))
        at_rest = EQUIVALENCE.factor * speed / (digits * sine) + slowing * moved
        yield Finding(abs(rates[bar]), at_rest, limit.theta_2, f"{what}: at rest")
