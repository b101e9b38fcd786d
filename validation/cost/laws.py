"""Laws behind the points: exponents with their uncertainty, floors, and what is expected of each."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from validation.cost.study import STEPPED, Point

TOO_LARGE = 0.1
"""A larger error is not small enough for its law: the motion itself is another."""
FLOORED = 0.8
"""An error that twice the steps leave above this part of what it was has met its floor."""
ABOVE_FLOOR = 3.0
"""Points within this factor of the floor carry part of it and are not fitted."""
WITHIN = 0.35
"""An exponent may miss the expected one by this much, or by twice its own uncertainty: over two decades of
a ladder the next order of the error's series moves a fitted slope by about a quarter."""
FEWEST = 3
"""Points of a fit."""
FIRST_ORDER, FOURTH_ORDER = 1.0, 4.0
EXPECTED_ORDER = {
    **dict.fromkeys(("Euler", "implicit", "implicitfast", "discrete"), FIRST_ORDER),
    "RK4": FOURTH_ORDER,
}


@dataclass(frozen=True, slots=True)
class Law:
    """error ~ dial^exponent over the points used."""

    name: str
    exponent: float
    sigma: float
    """Standard error of the fit."""
    expected: float
    points: int

    @property
    def decided(self) -> bool:
        """Whether enough points are left for a fit with an uncertainty."""
        return self.points >= FEWEST

    @property
    def holds(self) -> bool:
        """Whether the exponent is the expected one; False where it is not decided."""
        return self.decided and abs(self.exponent - self.expected) <= max(2.0 * self.sigma, WITHIN)

    def __str__(self) -> str:
        if not self.decided:
            return f"{self.name}: only {self.points} points above the floor and below {TOO_LARGE:g}: no fit"
        verdict = "holds" if self.holds else "FAILS"
        return f"{self.name}: exponent {self.exponent:.2f} +- {self.sigma:.2f}, expected {self.expected:g}: {verdict}"


def fit(x: Sequence[float], y: Sequence[float]) -> tuple[float, float]:
    """Slope of log y over log x by least squares, and its standard error."""
    u, v = np.log(np.asarray(x, dtype=float)), np.log(np.asarray(y, dtype=float))
    u = u - u.mean()
    slope = float(u @ v / (u @ u))
    left = v - v.mean() - slope * u
    free = len(u) - 2
    return slope, math.sqrt(float(left @ left) / free / float(u @ u)) if free > 0 else math.inf


def floor(points: Sequence[Point]) -> float | None:
    """The error that more steps no longer lessen, or None where it still falls at the end of the ladder."""
    worst = [point.worst for point in sorted(points, key=lambda point: point.steps_per_revolution)]
    if len(worst) < 2 or not math.isfinite(worst[-1]) or worst[-1] < FLOORED * worst[-2]:
        return None
    return worst[-1]  # on the way there two sources may cancel: a dip is not a floor


def steps_at_floor(points: Sequence[Point]) -> Point | None:
    """The first point of a ladder beyond which more steps buy nothing."""
    least = floor(points)
    if least is None:
        return None
    ordered = sorted(points, key=lambda point: point.steps_per_revolution)
    return next(point for point in ordered if point.worst <= least / FLOORED)


def laws(curves: Mapping[str, Sequence[Point]]) -> list[Law]:
    """Every law that the study was laid out for, as far as its curves are there."""
    found = []
    for integrator, order in EXPECTED_ORDER.items():
        points = curves.get(f"{integrator}, tc held", ())
        found.append(_law(f"order of {integrator} in the timestep", points, order, by_steps=True))
    found.append(_law("softness in (1-d)", curves.get("softness d", ()), 1.0))
    found.append(_law("sag at 0.1 rad/s in (1-d)", curves.get("sag d, slow", ()), 1.0))
    found.append(_law("sag at 0.1 rad/s in tc", curves.get("sag tc, slow", ()), 2.0))
    one_state = [point for point in curves.get("one state", ()) if point.dial > 0.0]
    found.append(_law("MuJoCo at one state in (1-d)/d", one_state, 1.0))
    found.append(_stiff(curves))
    return [law for law in found if law.points > 0]


def _law(name: str, points: Sequence[Point], expected: float, *, by_steps: bool = False) -> Law:
    least = (floor(points) or 0.0) if by_steps else 0.0
    used = [p for p in points if p.dial > 0.0 and ABOVE_FLOOR * least < p.worst < TOO_LARGE]
    if len(used) < FEWEST:
        return Law(name, math.nan, math.inf, expected, len(used))
    x = [1.0 / p.dial if by_steps else p.dial for p in used]
    slope, sigma = fit(x, [p.worst for p in used])
    return Law(name, slope, sigma, expected, len(used))


def _stiff(curves: Mapping[str, Sequence[Point]]) -> Law:
    """RK4's floor at a time constant of k steps goes as k^-4, whatever the timestep."""
    floors = {}
    for tc in (3.0, 10.0, 30.0, 100.0):
        least = floor(curves.get(f"RK4, pads, tc = {tc:g} h", ()))
        if least is not None:
            floors[tc] = least
    name = "floor of RK4 in tc/h"
    if len(floors) < FEWEST:
        return Law(name, math.nan, math.inf, -FOURTH_ORDER, len(floors))
    slope, sigma = fit(list(floors), list(floors.values()))
    return Law(name, slope, sigma, -FOURTH_ORDER, len(floors))


def warnings(curves: Mapping[str, Sequence[Point]]) -> list[str]:
    """Where a setting has passed its floor."""
    lines = []
    for name, points in curves.items():
        ladder = [p for p in points if p.kind == STEPPED and p.dial == p.dial and p.dial >= 2.0]
        if name == "recommended" or len(ladder) < 4 or ladder[0].dial == ladder[-1].dial:
            continue
        if len({round(p.steps_per_revolution) for p in ladder}) < 4:
            continue
        point = steps_at_floor(ladder)
        if point is not None:
            lines.append(
                f"{name}: beyond {point.steps_per_revolution:.0f} steps per revolution more steps buy nothing, "
                f"the error stays at {floor(ladder):.1e}"
            )
        elif all(not math.isfinite(p.worst) for p in ladder):
            lines.append(f"{name}: no timestep of the ladder keeps the motion")
    return lines


def pareto(points: Sequence[Point], quantity: str) -> list[Point]:
    """Points that no other beats in both error and cost, from cheap to accurate."""
    front: list[Point] = []
    for point in sorted(points, key=lambda p: (p.seconds_per_revolution, getattr(p, quantity))):
        if math.isfinite(getattr(point, quantity)) and (
            not front or getattr(point, quantity) < getattr(front[-1], quantity)
        ):
            front.append(point)
    return front
