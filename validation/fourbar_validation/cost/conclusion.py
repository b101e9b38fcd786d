"""Say in a few lines what digits cost, what the defaults pay, and what matters."""

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain

from fourbar_validation.advise.matters import (
    DEGREE_BETWEEN,
    SettingInfluence,
    write_sentence,
)
from fourbar_validation.advise.worst_errors import ERROR_NAMES
from fourbar_validation.cost.laws import ErrorLaw, find_floor
from fourbar_validation.cost.work_precision import (
    EXACT_MOTION,
    FORMULAS_CURVE,
    STEPPED_MOTION,
    CostPoint,
)

DEFAULT = "MuJoCo's defaults"
"""Label of the point that a new user gets."""
_DEFAULT_LADDER = "Euler, MuJoCo's defaults"
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
    ladder = curves.get(_DEFAULT_LADDER, ())
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
