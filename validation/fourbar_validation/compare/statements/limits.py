"""At each stated limit position the engine finds the same angles, two bars collinear, and the third one at rest."""

import math
from collections.abc import Iterator

import numpy as np

from fourbar.formulas import mobility
from fourbar.linkage import MOVING_BARS, FourBar
from fourbar.scene import Scene
from fourbar_validation.compare.compare import TOUCHING_MARGIN, closing_margin
from fourbar_validation.compare.statements.finding import Finding, Place, Seen, Stated, roundoff, wrapped
from fourbar_validation.compare.statements.ranges import step_beyond
from fourbar_validation.compare.tolerance import EPS, NOTHING_TO_TELL, lever


def places(stated: Stated) -> list[Place]:
    """Where an engine is looked at for them."""
    inside = [(limit.theta_2 + step, branch) for limit, step in stated(_just_inside) for branch in (1, -1)]
    return inside + [(limit.theta_2, limit.branch) for bar in (3, 4) for limit in stated(_of_one_branch, bar)]


def limit_positions(stated: Stated, seen: Seen) -> Iterator[Finding]:
    """Compare the limits of every moving bar; where all bars are collinear no side can be stated."""
    yield Finding(0.0, 0.0, stated.linkage.ground_angle, "the same positions")
    yield from _of_input(stated, seen)
    for bar in (3, 4):
        yield from _dead_centres(stated, bar, seen)


def _just_inside(linkage: FourBar) -> list[tuple[mobility.LimitPosition, float]]:
    """Limits of bar 2, and the little that it turns from each: at the limit rounding decides if the loop closes."""
    return [(limit, _inwards(linkage, limit.theta_2)) for limit in mobility.limit_positions(linkage)]


def _of_input(stated: Stated, seen: Seen) -> Iterator[Finding]:
    """On both branches just inside each limit: bars 3 and 4 stand off their common line by the same angles."""
    linkage = stated.linkage
    d, a, *_ = linkage.lengths
    for limit, step in stated(_just_inside):
        open_, crossed = (
            {name: seen.at((limit.theta_2 + step, branch), name) for name in ("theta_3", "theta_4")}
            for branch in (1, -1)
        )
        yield Finding(float(limit.branch != 0), 0.0, limit.theta_2, "both branches meet at a limit of bar 2")
        digits = lever(linkage) * abs(math.sin(open_["theta_4"] - open_["theta_3"]))
        if digits * NOTHING_TO_TELL <= EPS:
            continue
        e = abs(d - a * np.exp(1j * (limit.theta_2 - linkage.ground_angle)))
        allowed = roundoff(linkage) / digits + a / e * (abs(step) + _moved(linkage, 2, limit))
        middle = {}
        for name, angle in (("theta_3", limit.theta_3), ("theta_4", limit.theta_4)):
            middle[name] = open_[name] + 0.5 * wrapped(crossed[name] - open_[name])
            error = abs(wrapped(middle[name] - angle))
            yield Finding(error, allowed, limit.theta_2, f"{name} at a limit of bar 2")
        aligned = math.cos(middle["theta_4"] - middle["theta_3"]) < 0.0
        yield Finding(float(aligned != limit.stretched), 0.0, limit.theta_2, "stretched or folded")


def _inwards(linkage: FourBar, theta_2: float) -> float:
    """Compute the little that bar 2 turns from its limit to where the loop closes, rad."""
    step = step_beyond(linkage, theta_2)
    ahead, behind = closing_margin(Scene(linkage), np.array([theta_2 + step, theta_2 - step]))
    return step if ahead > behind else -step


def _moved(linkage: FourBar, bar: int, limit: mobility.LimitPosition) -> float:
    """Compute what rounding may turn a limit by: the triangle of the ground, the bar and the other two in one line."""
    upright = abs(math.sin(limit[MOVING_BARS.index(bar)] - linkage.ground_angle))
    d, *moving = linkage.lengths
    spread = sum(linkage.lengths) / d * (1.0 + sum(moving) / linkage.bar(bar).length)
    return roundoff(linkage) * spread / max(upright, EPS)


def _collinear(linkage: FourBar, bar: int) -> list[bool]:
    """Of each limit of a bar, whether all bars are collinear there but for rounding."""
    angles = np.array([limit.theta_2 for limit in mobility.limit_positions(linkage, bar)])
    return [bool(each) for each in np.abs(closing_margin(Scene(linkage), angles)) <= TOUCHING_MARGIN]


def _of_one_branch(linkage: FourBar, bar: int) -> list[mobility.LimitPosition]:
    """Select the limits of a bar that are of one branch, as they should be."""
    limits = zip(mobility.limit_positions(linkage, bar), _collinear(linkage, bar), strict=True)
    return [limit for limit, collinear in limits if not collinear and limit.branch != 0]


def _dead_centres(stated: Stated, bar: int, seen: Seen) -> Iterator[Finding]:
    """Check that the other two bars are in one line there, and the bar is at rest."""
    linkage = stated.linkage
    for limit, collinear in zip(stated(mobility.limit_positions, bar), stated(_collinear, bar), strict=True):
        known = (0, 1, -1) if collinear else (1, -1)  # all bars collinear: rounding decides
        yield Finding(float(limit.branch not in known), 0.0, limit.theta_2, f"branch of a limit of bar {bar}")
    for limit in stated(_of_one_branch, bar):
        what, place = f"bar {bar} at theta_2 = {limit.theta_2!r}", (limit.theta_2, limit.branch)
        theta_3, theta_4, omega_3, omega_4 = (seen.at(place, q) for q in ("theta_3", "theta_4", "omega_3", "omega_4"))
        sine, speed = abs(math.sin(theta_4 - theta_3)), max(1.0, abs(omega_3), abs(omega_4))
        digits = lever(linkage) * sine
        if digits * NOTHING_TO_TELL <= EPS:
            continue
        moved = _moved(linkage, bar, limit)
        for angle, of_formula in ((theta_3, limit.theta_3), (theta_4, limit.theta_4)):
            error = abs(wrapped(angle - of_formula))
            yield Finding(error, roundoff(linkage) / digits + moved * speed, limit.theta_2, what)
        # the loop runs along bar 4 from B to O4
        aligned = math.cos({3: theta_4 + math.pi, 4: theta_3}[bar] - limit.theta_2) > 0.0
        yield Finding(float(aligned != limit.stretched), 0.0, limit.theta_2, "stretched or folded")
        slowing = abs(seen.at(place, f"alpha_{bar}"))
        at_rest = roundoff(linkage) * speed / (digits * sine) + slowing * moved
        yield Finding(abs({3: omega_3, 4: omega_4}[bar]), at_rest, limit.theta_2, f"{what}: at rest")
