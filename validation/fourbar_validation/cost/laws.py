"""Laws behind the points, of each quantity by itself.

A law is an exponent with its uncertainty; floors and jumps are found too.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain, groupby

import numpy as np

from fourbar.linkage import record
from fourbar_validation.advise.matters import (
    DEGREE_BETWEEN,
    ERROR_NAMES,
    SettingInfluence,
    write_sentence,
)
from fourbar_validation.cost.work_precision import (
    EXACT_MOTION,
    FORMULAS_CURVE,
    STEPPED_MOTION,
    CostPoint,
)

LARGEST_LAWFUL_ERROR = 0.1
"""A larger error is not small enough for its law: the motion itself is another."""
FLOORED = 0.8
"""Part of an error from which on it has met its floor. Twice the steps leave that part
or more.
"""
WITHIN = 0.35
"""An exponent may miss the expected one by this much, or by twice its own uncertainty:
over two decades of a ladder the next order of the error's series moves a fitted slope
by about a quarter.
"""
_FIRST_ORDER = 1.0
_FOURTH_ORDER = 4.0
_EXPECTED_ORDER = dict.fromkeys(
    ("Euler", "implicit", "implicitfast", "discrete"), _FIRST_ORDER
) | {"RK4": _FOURTH_ORDER}
_ABOVE_FLOOR = 3.0
"""Points within this factor of the floor carry part of it and are not fitted."""
FEWEST_FITTED = 3
"""Points of a fit."""
_LAWLESS_RISE = 10.0
"""An error so many times larger than at either of the two coarser settings is no part
of a law, where it has met no floor: between neighbours of a ladder the laws here change
it by 10 or less, and downwards.
"""


@record
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

    @property
    def decided(self) -> bool:
        """Return whether there are enough points for a fit, or a jump rules it out."""
        return self.points >= FEWEST_FITTED or bool(self.jumps)

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
        if not self.decided:
            return (
                f"no fit, {self.points} points above the floor"
                f" and below {LARGEST_LAWFUL_ERROR:g}"
            )
        verdict = "holds" if self.holds else "FAILS"
        return f"{verdict}, {self.exponent:.2f} (uncertain by {self.sigma:.2f})"


def write_laws(all_laws: Sequence[ErrorLaw]) -> list[str]:
    """Write each law in one line, quantities of the same text together."""
    shown = []
    for name, group in groupby(all_laws, key=lambda law: law.name):
        texts: dict[str, list[str]] = {}
        for law in group:
            texts.setdefault(str(law), []).append(law.quantity)
        told = "; ".join(f"{', '.join(names)}: {text}" for text, names in texts.items())
        shown.append(f"{name}, expected {law.expected:g}: {told}")
    return shown


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
    ladder = sorted(points, key=lambda point: point.steps_per_revolution)
    errors = _list_errors(ladder, quantity)
    if len(errors) < 2 or not FLOORED * errors[-2] <= errors[-1] < math.inf:
        return None
    return errors[-1]  # before it two sources may cancel: a dip is not a floor


def _list_errors(points: Sequence[CostPoint], quantity: str) -> list[float]:
    """List the errors of a quantity at the steps.

    Between them the laws are those of a spline.
    """
    return [getattr(point.at_steps, quantity) for point in points]


def _describe_jumps(ladder: Sequence[CostPoint], quantity: str) -> Iterator[str]:
    """Describe the places in a ladder where its errors jump up."""
    errors = _list_errors(ladder, quantity)
    for i in range(1, len(errors)):
        before, error = errors[i - 1 : i + 1]
        # two sources that cancel make a dip, and its far side is no jump; a motion that
        # is lost again is one
        allowed = before
        if error < LARGEST_LAWFUL_ERROR:
            allowed = max(errors[max(i - 2, 0) : i])
        if before < LARGEST_LAWFUL_ERROR and not error <= _LAWLESS_RISE * allowed:
            yield f"jumps from {before:.1e} to {error:.1e} at {ladder[i].setting}"


def fit_laws(curves: Mapping[str, Sequence[CostPoint]]) -> list[ErrorLaw]:
    """Fit every law that the study was laid out for, of each quantity.

    A law is fitted as far as its curves exist.
    """
    laws: list[ErrorLaw] = []
    for integrator, order in _EXPECTED_ORDER.items():
        name = f"order of {integrator} in the timestep"
        points = curves.get(f"{integrator}, tc held", ())
        laws += _fit_law(name, points, order, by_steps=True)
    for name, curve in (
        ("softness in (1-d)", "softness d"),
        ("sag at 0.1 rad/s in (1-d)", "sag d, slow"),
    ):
        laws += _fit_law(name, curves.get(curve, ()), _FIRST_ORDER)
    stiff = (_fit_stiff(curves, quantity) for quantity in ERROR_NAMES)
    return laws + [law for law in stiff if law.points > 0]


def _fit_law(
    name: str,
    points: Sequence[CostPoint],
    expected: float,
    *,
    by_steps: bool = False,
) -> Iterator[ErrorLaw]:
    """Fit a law of each quantity."""
    ladder = [point for point in points if point.setting_value > 0.0]
    ladder.sort(key=lambda p: p.setting_value if by_steps else -p.setting_value)
    for quantity in ERROR_NAMES if ladder else ():
        errors = _list_errors(ladder, quantity)
        floor = (find_floor(points, quantity) or 0.0) if by_steps else 0.0
        fitted = {}
        for point, error in zip(ladder, errors, strict=True):
            if _ABOVE_FLOOR * floor < error < LARGEST_LAWFUL_ERROR:
                x = point.setting_value
                fitted[1.0 / x if by_steps else x] = error
        slope = fit([*fitted], [*fitted.values()])
        jumps = tuple(_describe_jumps(ladder, quantity))
        yield ErrorLaw(name, quantity, *slope, expected, len(fitted), jumps)


def _fit_stiff(curves: Mapping[str, Sequence[CostPoint]], quantity: str) -> ErrorLaw:
    """Fit RK4's floor.

    At a time constant of k steps it goes as k^-4, whatever the timestep.
    """
    floors = {}
    for tc in (3.0, 10.0, 30.0, 100.0):
        points = curves.get(f"RK4, pads, tc = {tc:g} steps", ())
        floor = find_floor(points, quantity)
        if floor is not None:
            floors[tc] = floor
    slope = fit([*floors], [*floors.values()])
    name = "floor of RK4 in tc/h"
    return ErrorLaw(name, quantity, *slope, -_FOURTH_ORDER, len(floors))


def find_pareto(points: Sequence[CostPoint], quantity: str) -> list[CostPoint]:
    """Find the points that no other beats in both error and cost.

    The order is from cheap to accurate. The error is that at the steps and between
    them, as the advice judges it.
    """
    front: list[CostPoint] = []
    least = math.inf
    for point in sorted(
        points, key=lambda one: (one.seconds_per_second, one.error(quantity))
    ):
        if point.error(quantity) < least:
            least = point.error(quantity)
            front.append(point)
    return front


DEFAULT = "MuJoCo's defaults"
"""Label of the point that a new user gets."""
ERROR_OF_FOUR_DIGITS = 1e-4
SIX_DIGITS = 1e-6
ERROR_IN_WORDS = {ERROR_OF_FOUR_DIGITS: "Four digits", SIX_DIGITS: "Six digits"}
QUANTITY_WORDS = {"torque": "driving torque", "force": "worst pin force"}
Curves = Mapping[str, Sequence[CostPoint]]


def list_stepped(curves: Curves) -> list[CostPoint]:
    """List the points of all settings that were stepped at the scene's own speed."""
    return [
        point
        for name, row in curves.items()
        if "slow" not in name
        for point in row
        if point.kind == STEPPED_MOTION
    ]


def find_cheapest(
    curves: Curves,
    quantity: str,
    error: float,
) -> CostPoint | None:
    """Find the cheapest stepped point within an error.

    The error is that at the steps and between them.
    """
    points = (one for one in list_stepped(curves) if one.error(quantity) <= error)
    return min(points, key=lambda point: point.seconds_per_second, default=None)


def find_default(curves: Curves) -> CostPoint | None:
    """Find the point that a new user gets."""
    points = chain.from_iterable(curves.values())
    return next((point for point in points if point.setting == DEFAULT), None)


def _write_time(point: CostPoint) -> str:
    """Write the time of a simulated second, and of a revolution."""
    second = point.seconds_per_second
    revolution = point.seconds_per_revolution
    return f"{1e3 * second:.2g} ms ({1e3 * revolution:.2g} ms a revolution)"


def write_one_digit(value: float) -> str:
    """Format one digit and its power of ten."""
    mantissa, _, exponent = f"{value:.0e}".partition("e")
    return f"{mantissa}e{int(exponent)}"


def conclude(
    curves: Curves,
    laws: Sequence[ErrorLaw],
    influences: list[SettingInfluence],
) -> list[str]:
    """Write the conclusion, at most ten lines."""
    return [
        "CPU time of a simulated second, with the reading of torque and pin forces; "
        "errors at the steps and between them, by a curve of degree "
        f"{DEGREE_BETWEEN} through the steps:",
        *_write_cheapest_settings(curves),
        *_write_defaults(curves),
        write_sentence(influences),
        *_write_exact(curves),
        _write_law_sentences(laws),
    ]


def _write_cheapest_settings(curves: Curves) -> Iterator[str]:
    for error, quantity, what in (
        (ERROR_OF_FOUR_DIGITS, "torque", "of the driving torque"),
        (ERROR_OF_FOUR_DIGITS, "force", "of every pin force"),
        (SIX_DIGITS, "force", "of every pin force"),
    ):
        told = "no setting that was tried reaches them"
        if point := find_cheapest(curves, quantity, error):
            told = f"{_write_time(point)} by {point.name}"
        yield f"{ERROR_IN_WORDS[error]} {what}: {told}."


def _write_defaults(curves: Curves) -> Iterator[str]:
    point = find_default(curves)
    if point is None:
        return
    if point.broken:
        yield f"MuJoCo's defaults lose the motion: {point.broken}."
        return
    errors = point.errors
    text = (
        f"MuJoCo's defaults (Euler, 2 ms): {_write_time(point)} for an error of"
        f" {write_one_digit(errors.torque)} in the torque,"
        f" {write_one_digit(errors.force)} in the worst pin force"
    )
    ladder = curves.get("Euler, MuJoCo's defaults", ())
    floors = [find_floor(ladder, quantity) or math.inf for quantity in ERROR_NAMES]
    if max(floors) < math.inf:
        text += (
            f"; no timestep brings them all below {write_one_digit(min(floors))}, "
            "because their closure is soft"
        )
    yield text + "."


def _write_exact(curves: Curves) -> Iterator[str]:
    for kind, what in (
        (EXACT_MOTION, "Position by position"),
        (FORMULAS_CURVE, "The formulas"),
    ):
        exact = [
            point
            for point in chain.from_iterable(curves.values())
            if point.kind == kind and point.errors.worst < SIX_DIGITS
        ]
        if exact:
            cheapest = min(exact, key=lambda point: point.seconds_per_second)
            error = write_one_digit(cheapest.errors.worst)
            time = _write_time(cheapest)
            yield f"{what}: {time}, error {error}, by {cheapest.setting}."


def _write_law_sentences(laws: Sequence[ErrorLaw]) -> str:
    decided = [law for law in laws if law.decided]
    failing = dict.fromkeys(law.name for law in decided if not law.holds)
    held = sum(law.holds for law in decided)
    text = f"{held} of {len(decided)} laws of the error hold"
    if failing:
        text += f"; not: {', '.join(failing)}"
    return text + "."
