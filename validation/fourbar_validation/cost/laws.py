"""Laws behind the points, of each quantity by itself.

A law is an exponent with its uncertainty; floors and jumps are found too.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fourbar_validation.advise.worst_errors import ERROR_NAMES
from fourbar_validation.cost.work_precision import STEPPED_MOTION, CostPoint

LARGEST_LAWFUL_ERROR = 0.1
"""A larger error is not small enough for its law: the motion itself is another."""
FLOORED = 0.8
"""Part of an error from which on it has met its floor. Twice the steps leave that part
or more.
"""
_ABOVE_FLOOR = 3.0
"""Points within this factor of the floor carry part of it and are not fitted."""
WITHIN = 0.35
"""An exponent may miss the expected one by this much, or by twice its own uncertainty:
over two decades of a ladder the next order of the error's series moves a fitted slope
by about a quarter.
"""
FEWEST_FITTED = 3
"""Points of a fit."""
_LAWLESS_RISE = 10.0
"""An error so many times larger than at either of the two coarser settings is no part
of a law, where it has met no floor: between neighbours of a ladder the laws here change
it by 10 or less, and downwards.
"""
_MIXES = 1.0 / 30.0
"""Part of the least error from which on a rest flattens a slope. The rest does not
depend on the setting.
"""
_FIRST_ORDER = 1.0
_FOURTH_ORDER = 4.0
_EXPECTED_ORDER = dict.fromkeys(
    ("Euler", "implicit", "implicitfast", "discrete"), _FIRST_ORDER
) | {"RK4": _FOURTH_ORDER}


@dataclass(frozen=True, slots=True)
class ErrorLaw:
    """error ~ setting_value^exponent of one quantity over the points used."""

    name: str
    quantity: str
    exponent: float
    sigma: float
    """Standard error of the fit."""
    expected: float
    points: int
    jumps: tuple[str, ...] = ()
    """Settings where the error jumps up as the steps get finer. No law holds then,
    whatever the other points fit.
    """
    constant: float = 0.0
    """Part of the least fitted error that does not depend on the setting."""

    @property
    def mixed(self) -> bool:
        """Return whether a part that the setting does not change flattens the slope."""
        return (
            self.constant > _MIXES
            and self.points >= FEWEST_FITTED
            and self.exponent < self.expected - WITHIN
        )

    @property
    def decided(self) -> bool:
        """Return whether there are enough points for a fit, or a jump rules it out."""
        return (self.points >= FEWEST_FITTED and not self.mixed) or bool(self.jumps)

    @property
    def holds(self) -> bool:
        """Return whether the exponent is as expected throughout; False if undecided."""
        return (
            self.decided
            and not self.jumps
            and abs(self.exponent - self.expected) <= max(2.0 * self.sigma, WITHIN)
        )

    def __str__(self) -> str:
        if self.jumps:
            return f"FAILS, {'; '.join(self.jumps)}"
        if self.mixed:
            return (
                f"no order expected, {self.exponent:.2f}: sag and softness mix, of"
                f" which softness alone makes {100.0 * self.constant:.0f} % of the"
                " least error"
            )
        if not self.decided:
            return (
                f"no fit, {self.points} points above the floor"
                f" and below {LARGEST_LAWFUL_ERROR:g}"
            )
        verdict = "holds" if self.holds else "FAILS"
        return f"{verdict}, {self.exponent:.2f} (uncertain by {self.sigma:.2f})"


def write_laws(all_laws: Sequence[ErrorLaw]) -> list[str]:
    """Write each law in one line, quantity by quantity."""
    shown = []
    for name in dict.fromkeys(law.name for law in all_laws):
        laws = [law for law in all_laws if law.name == name]
        texts = _group_quantities([(law.quantity, str(law)) for law in laws])
        shown.append(f"{name}, expected {laws[0].expected:g}: {'; '.join(texts)}")
    return shown


def _group_quantities(pairs: Sequence[tuple[str, str]]) -> list[str]:
    """Group quantities with the same text."""
    texts = dict.fromkeys(text for _, text in pairs)
    return [
        f"{', '.join(quantity for quantity, text_of in pairs if text_of == text)}:"
        f" {text}"
        for text in texts
    ]


def fit(x: Sequence[float], y: Sequence[float]) -> tuple[float, float]:
    """Fit the slope of log y over log x by least squares.

    Return it and its standard error, which two points do not have.
    """
    if len(x) < 2:
        return math.nan, math.inf
    from scipy.stats import linregress

    line = linregress(np.log(x), np.log(y))
    return float(line.slope), float(line.stderr) if len(x) > 2 else math.inf


def find_floor(points: Sequence[CostPoint], quantity: str) -> float | None:
    """Return the error that more steps no longer lessen, None if it still falls."""
    errors = [_error_at_steps(point, quantity) for point in _list_by_steps(points)]
    if (
        len(errors) < 2
        or not math.isfinite(errors[-1])
        or errors[-1] < FLOORED * errors[-2]
    ):
        return None
    return float(errors[-1])  # before it two sources may cancel: a dip is not a floor


def _find_steps_at_floor(
    points: Sequence[CostPoint],
    quantity: str,
) -> CostPoint | None:
    """Find the first point of a ladder from which its error stays near its last."""
    floor = find_floor(points, quantity)
    if floor is None:
        return None
    ladder = _list_by_steps(points)
    first = ladder[-1]
    for point in reversed(ladder):
        if not FLOORED * floor <= _error_at_steps(point, quantity) <= floor / FLOORED:
            break
        first = point
    return first


def _list_by_steps(points: Sequence[CostPoint]) -> list[CostPoint]:
    return sorted(points, key=lambda point: point.steps_per_revolution)


def find_jumps(points: Sequence[CostPoint], quantity: str) -> list[CostPoint]:
    """Return the points where an error jumps up as steps get finer.

    A point counts once the motion is the scene's.
    """
    jumps = []
    for i, point in enumerate(points[1:], 1):
        value = _error_at_steps(point, quantity)
        before = [
            _error_at_steps(point_before, quantity)
            for point_before in points[max(i - 2, 0) : i]
        ]
        # two sources that cancel make a dip, and its far side is no jump; a motion that
        # is lost again is one
        if before[-1] < LARGEST_LAWFUL_ERROR and not value <= _LAWLESS_RISE * (
            max(before) if value < LARGEST_LAWFUL_ERROR else before[-1]
        ):
            jumps.append(point)
    return jumps


def fit_laws(curves: Mapping[str, Sequence[CostPoint]]) -> list[ErrorLaw]:
    """Fit every law that the study was laid out for, of each quantity.

    A law is fitted as far as its curves exist.
    """
    one_state = [
        point for point in curves.get("one state", ()) if point.setting_value > 0.0
    ]
    ladders = [
        *(
            (f"order of {name} in the timestep", curves.get(f"{name}, tc held"), order)
            for name, order in _EXPECTED_ORDER.items()
        ),
        ("softness in (1-d)", curves.get("softness d"), 1.0),
        ("sag at 0.1 rad/s in (1-d)", curves.get("sag d, slow"), 1.0),
        ("MuJoCo at one state in (1-d)/d", one_state, 1.0),
    ]
    laws = [
        _fit_law(name, quantity, points, order, by_steps=name.startswith("order"))
        for name, points, order in ladders
        if points
        for quantity in ERROR_NAMES
    ]
    if curves.get("sag tc, slow"):
        laws += [_fit_sag(curves, quantity) for quantity in ERROR_NAMES]
    stiff = [_fit_stiff(curves, quantity) for quantity in ERROR_NAMES]
    return laws + [law for law in stiff if law.points > 0]


def _fit_law(
    name: str,
    quantity: str,
    points: Sequence[CostPoint],
    expected: float,
    *,
    by_steps: bool = False,
) -> ErrorLaw:
    least = find_floor(points, quantity) or 0.0 if by_steps else 0.0
    ordered = sorted(
        (p for p in points if p.setting_value > 0.0),
        key=lambda p: p.setting_value if by_steps else -p.setting_value,
    )
    leaps = tuple(
        _measure_leap(p, ordered, quantity) for p in find_jumps(ordered, quantity)
    )
    used = [
        p
        for p in ordered
        if _ABOVE_FLOOR * least < _error_at_steps(p, quantity) < LARGEST_LAWFUL_ERROR
    ]
    x = [1.0 / p.setting_value if by_steps else p.setting_value for p in used]
    slope = fit(x, [_error_at_steps(p, quantity) for p in used])
    return ErrorLaw(name, quantity, *slope, expected, len(used), leaps)


def _error_at_steps(point: CostPoint, quantity: str) -> float:
    """Return the error of a quantity at the steps.

    Between them the laws are those of a spline.
    """
    return float(getattr(point.at_steps, quantity))


def _measure_leap(
    point: CostPoint,
    ladder: Sequence[CostPoint],
    quantity: str,
) -> str:
    before = _error_at_steps(ladder[ladder.index(point) - 1], quantity)
    after = _error_at_steps(point, quantity)
    return f"jumps from {before:.1e} to {after:.1e} at {point.setting}"


def _fit_sag(curves: Mapping[str, Sequence[CostPoint]], quantity: str) -> ErrorLaw:
    """Fit the law of the sag over the time constant.

    The sag is of second order where the error of softness alone is small next to it.
    """
    points = curves["sag tc, slow"]
    law = _fit_law("sag at 0.1 rad/s in tc", quantity, points, 2.0)
    least = min(_error_at_steps(point, quantity) for point in points)
    alone = curves.get("softness alone, slow", ())
    if not alone or not 0.0 < least < math.inf:
        return law
    return replace(law, constant=_error_at_steps(alone[0], quantity) / least)


def _fit_stiff(curves: Mapping[str, Sequence[CostPoint]], quantity: str) -> ErrorLaw:
    """Fit RK4's floor.

    At a time constant of k steps it goes as k^-4, whatever the timestep.
    """
    ladders = (
        (tc, curves.get(f"RK4, pads, tc = {tc:g} steps", ()))
        for tc in (3.0, 10.0, 30.0, 100.0)
    )
    floors = {
        tc: least
        for tc, points in ladders
        if (least := find_floor(points, quantity)) is not None
    }
    name = "floor of RK4 in tc/h"
    slope = fit(list(floors), list(floors.values()))
    return ErrorLaw(name, quantity, *slope, -_FOURTH_ORDER, len(floors))


def list_warnings(curves: Mapping[str, Sequence[CostPoint]]) -> list[str]:
    """List warnings where a quantity jumps, and where it has passed its floor.

    Jumps are towards finer steps.
    """
    warnings = []
    for name, points in curves.items():
        ladder = _list_by_steps(
            [
                p
                for p in points
                if p.kind == STEPPED_MOTION
                and p.setting_value == p.setting_value
                and p.setting_value >= 2.0
            ]
        )
        if (
            name == "recommended"
            or len(ladder) < 4
            or ladder[0].setting_value == ladder[-1].setting_value
        ):
            continue
        if len({round(p.steps_per_revolution) for p in ladder}) < 4:
            continue
        leaps = [
            (q, _measure_leap(p, ladder, q))
            for q in ERROR_NAMES
            for p in find_jumps(ladder, q)
        ]
        warnings += [f"{name}: {line}" for line in _group_quantities(leaps)]
        floored = [
            (q, _describe_floor(ladder, q))
            for q in ERROR_NAMES
            if find_floor(ladder, q) is not None
        ]
        warnings += [f"{name}: {line}" for line in _group_quantities(floored)]
        never = [
            q
            for q in ERROR_NAMES
            if not any(_error_at_steps(p, q) < LARGEST_LAWFUL_ERROR for p in ladder)
        ]
        if never:
            warnings.append(
                f"{name}: no timestep of the ladder brings {', '.join(never)} below"
                f" {LARGEST_LAWFUL_ERROR:g}"
            )
    return warnings


def _describe_floor(ladder: Sequence[CostPoint], quantity: str) -> str:
    """Say from how many steps on more steps do not lessen an error.

    An error that was less on the way is told too: two errors cancel there.
    """
    floor = find_floor(ladder, quantity)
    first = _find_steps_at_floor(ladder, quantity)
    assert floor is not None and first is not None
    text = f"{floor:.1e} from {first.steps_per_revolution:.0f} steps a revolution on"
    least = min(ladder, key=lambda point: _error_at_steps(point, quantity))
    if _error_at_steps(least, quantity) < FLOORED * floor:
        text += (
            f", but for {_error_at_steps(least, quantity):.1e} at "
            f"{least.steps_per_revolution:.0f}, where two errors cancel"
        )
    return text


def find_pareto(points: Sequence[CostPoint], quantity: str) -> list[CostPoint]:
    """Find the points that no other beats in both error and cost.

    The order is from cheap to accurate. The error is that at the steps and between
    them, as the advice judges it.
    """
    front: list[CostPoint] = []
    for point in sorted(
        points,
        key=lambda p: (p.seconds_per_second, getattr(p.errors, quantity)),
    ):
        error = getattr(point.errors, quantity)
        if math.isfinite(error) and (
            not front or error < getattr(front[-1].errors, quantity)
        ):
            front.append(point)
    return front
