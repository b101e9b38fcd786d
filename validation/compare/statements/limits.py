"""At each stated limit position the engine finds the same angles, two bars collinear, and the third one at rest."""

import math
from collections.abc import Iterator

import numpy as np

from fourbar.formulas import mobility
from fourbar.linkage import MOVING_BARS, FourBar
from fourbar.scene import Scene
from validation.compare.answer import Engine
from validation.compare.compare import TOUCHING_MARGIN, closing_margin
from validation.compare.statements.finding import Finding, answered, roundoff, wrapped
from validation.compare.statements.ranges import step_beyond
from validation.compare.tolerance import EPS, NOTHING_TO_TELL, lever


def limit_positions(linkage: FourBar, engine: Engine) -> Iterator[Finding]:
    """The limits of every moving bar; where all bars are collinear no side can be stated."""
    yield Finding(0.0, 0.0, linkage.ground_angle, "the same positions")
    yield from _of_input(linkage, engine)
    for bar in (3, 4):
        yield from _dead_centres(linkage, bar, engine)


def _of_input(linkage: FourBar, engine: Engine) -> Iterator[Finding]:
    """On both branches just inside each limit: bars 3 and 4 stand off their common line by the same angles."""
    d, a, *_ = linkage.lengths
    limits = mobility.limit_positions(linkage)
    # at the limit itself rounding decides whether the loop closes
    steps = [_inwards(linkage, limit.theta_2) for limit in limits]
    angles = [limit.theta_2 + step for limit, step in zip(limits, steps, strict=True)]
    open_, crossed = (
        (answered(engine, linkage, angles, [sign] * len(limits)) for sign in (1, -1)) if limits else ({}, {})
    )
    for i, (limit, step) in enumerate(zip(limits, steps, strict=True)):
        yield Finding(float(limit.branch != 0), 0.0, limit.theta_2, "both branches meet at a limit of bar 2")
        digits = lever(linkage) * abs(math.sin(open_["theta_4"][i] - open_["theta_3"][i]))
        if digits * NOTHING_TO_TELL <= EPS:
            continue
        e = abs(d - a * np.exp(1j * (limit.theta_2 - linkage.ground_angle)))
        allowed = roundoff(linkage) / digits + a / e * (abs(step) + _moved(linkage, 2, limit))
        middle = {}
        for name, stated in (("theta_3", limit.theta_3), ("theta_4", limit.theta_4)):
            middle[name] = open_[name][i] + 0.5 * wrapped(crossed[name][i] - open_[name][i])
            error = abs(float(wrapped(middle[name] - stated)))
            yield Finding(error, allowed, limit.theta_2, f"{name} at a limit of bar 2")
        aligned = math.cos(middle["theta_4"] - middle["theta_3"]) < 0.0
        yield Finding(float(aligned != limit.stretched), 0.0, limit.theta_2, "stretched or folded")


def _inwards(linkage: FourBar, theta_2: float) -> float:
    """The little that bar 2 turns from its limit to where the loop closes, rad."""
    step = step_beyond(linkage, theta_2)
    ahead, behind = closing_margin(Scene(linkage), np.array([theta_2 + step, theta_2 - step]))
    return step if ahead > behind else -step


def _moved(linkage: FourBar, bar: int, limit: mobility.LimitPosition) -> float:
    """What rounding may turn a limit by: the triangle of the ground, the bar and the other two in one line."""
    upright = abs(math.sin(limit[MOVING_BARS.index(bar)] - linkage.ground_angle))
    d, *moving = linkage.lengths
    spread = sum(linkage.lengths) / d * (1.0 + sum(moving) / linkage.bar(bar).length)
    return roundoff(linkage) * spread / max(upright, EPS)


def _dead_centres(linkage: FourBar, bar: int, engine: Engine) -> Iterator[Finding]:
    """The other two bars are in one line there, and the bar is at rest."""
    limits = []
    for limit in mobility.limit_positions(linkage, bar):
        margin = abs(float(closing_margin(Scene(linkage), np.array([limit.theta_2]))[0]))
        known = (1, -1) if margin > TOUCHING_MARGIN else (0, 1, -1)  # all bars collinear: rounding decides
        yield Finding(float(limit.branch not in known), 0.0, limit.theta_2, f"branch of a limit of bar {bar}")
        limits += [limit] if margin > TOUCHING_MARGIN and limit.branch != 0 else []
    if not limits:
        return
    seen = answered(engine, linkage, [limit.theta_2 for limit in limits], [limit.branch for limit in limits])
    for i, limit in enumerate(limits):
        what = f"bar {bar} at theta_2 = {limit.theta_2!r}"
        theta_3, theta_4, omega_3, omega_4 = (float(seen[q][i]) for q in ("theta_3", "theta_4", "omega_3", "omega_4"))
        sine, speed = abs(math.sin(theta_4 - theta_3)), max(1.0, abs(omega_3), abs(omega_4))
        digits = lever(linkage) * sine
        if digits * NOTHING_TO_TELL <= EPS:
            continue
        moved = _moved(linkage, bar, limit)
        for angle, stated in ((theta_3, limit.theta_3), (theta_4, limit.theta_4)):
            error = abs(float(wrapped(np.array(angle - stated))))
            yield Finding(error, roundoff(linkage) / digits + moved * speed, limit.theta_2, what)
        # the loop runs along bar 4 from B to O4
        aligned = math.cos({3: theta_4 + math.pi, 4: theta_3}[bar] - limit.theta_2) > 0.0
        yield Finding(float(aligned != limit.stretched), 0.0, limit.theta_2, "stretched or folded")
        slowing = abs(float(seen[f"alpha_{bar}"][i]))
        at_rest = roundoff(linkage) * speed / (digits * sine) + slowing * moved
        yield Finding(abs({3: omega_3, 4: omega_4}[bar]), at_rest, limit.theta_2, f"{what}: at rest")
