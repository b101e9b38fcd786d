"""In words, what a linkage can do whatever drives it: swings, limit positions, change points, transmission."""

import math
from collections.abc import Callable, Iterator
from functools import partial

from fourbar.formulas.mobility import (
    change_points,
    circuits,
    classify,
    limit_positions,
    reach_of,
    swing,
    time_ratio,
    turns_fully,
)
from fourbar.formulas.transmission import transmission_extremes
from fourbar.linkage import BAR_NAMES, MOVING_BARS, FourBar
from fourbar.scene.motion import BRANCH_NAMES
from fourbar.show.units import COMMON, choose_unit
from fourbar.solution import Conversion
from fourbar.writing import write_object

BRANCHES = {**BRANCH_NAMES, 0: "both"}


def write_type(linkage: FourBar, units: Conversion | None = COMMON, *, everything: bool = False) -> Iterator[str]:
    """Write the type of a linkage, the condition that decides it, what turns, how far, and between which limits.

    `units`: of the lengths; None where they are ratios. `everything`: the limits of all bars, not of the output alone.
    """
    found = classify(linkage)
    relation = "<" if found.surplus > 0.0 else ">" if found.surplus < 0.0 else "="
    outer = min(linkage.lengths) + max(linkage.lengths)
    write = partial(_write_length, linkage=linkage, units=units)
    yield found.name
    yield f"s + l = {write(outer)} {relation} p + q = {write(sum(linkage.lengths) - outer)}"
    yield "bars that turn fully: " + (", ".join(BAR_NAMES[number] for number in found.turning) or "none")
    if found.barker is not None:  # a structure does not move
        yield from _write_mobility(linkage, write, everything)


def _write_length(length: float, linkage: FourBar, units: Conversion | None) -> str:
    if units is None:
        return f"{length:.6g}"
    factor, name = choose_unit(max(linkage.lengths), "m", units)
    return f"{factor * length:.6g} {name}"


def write_type_json(linkage: FourBar) -> str:
    """Write the type as JSON: SI and radians, null where there is nothing; positions as `LimitPosition` has them."""
    found, more = classify(linkage), dict[str, object]()
    if found.barker is not None:
        transmission = transmission_extremes(linkage)
        more = {
            "swing": {BAR_NAMES[bar]: swing(linkage, bar) for bar in MOVING_BARS},
            "limit_positions": {BAR_NAMES[bar]: limit_positions(linkage, bar) for bar in MOVING_BARS},
            "change_points": change_points(linkage),
            "circuits": circuits(linkage),
            "transmission": {**transmission._asdict(), "worst": transmission.worst},
            "time_ratio": time_ratio(linkage),
        }
    lengths = dict(zip(BAR_NAMES.values(), linkage.lengths, strict=True))
    return write_object("fourbar-classify/1", lengths=lengths, **found._asdict(), **more)


def _write_mobility(linkage: FourBar, write: Callable[[float], str], everything: bool) -> Iterator[str]:
    """Line by line; angles in deg, digits as far as a drawing needs them."""
    swings = [
        f"{BAR_NAMES[bar]} {_write_degrees(swing(linkage, bar))}"
        for bar in MOVING_BARS
        if not turns_fully(linkage, bar)
    ]
    if swings:
        yield f"bars that swing: {', '.join(swings)}"
    limits = [(bar, limit) for bar in (MOVING_BARS if everything else (4,)) for limit in limit_positions(linkage, bar)]
    if limits:
        names = "".join(f"{name:>10}" for name in ("theta_2", "theta_3", "theta_4"))
        yield f"{'limit positions (deg)':<34}{names}  branch"
    for bar, limit in limits:
        one, other = (BAR_NAMES[number] for number in MOVING_BARS if number != bar)
        what = f"  {BAR_NAMES[bar]}: {one}, {other} {'stretched' if limit.stretched else 'folded'}"
        angles = "".join(f"{math.degrees(angle):10.4f}" for angle in limit[:3])
        yield f"{what:<34}{angles}  {BRANCHES[limit.branch]}"
    for bar in MOVING_BARS:
        if turns_fully(linkage, bar):
            yield from _explain_turning(linkage, bar, write)
    if points := change_points(linkage):
        yield f"change points: theta_2 = {' and '.join(_write_degrees(point) for point in points)}"
    found = transmission_extremes(linkage)
    yield (
        f"angle between coupler and output: {_write_degrees(found.least)} "
        f"at theta_2 = {_write_degrees(found.theta_2_least)}"
    )
    yield f"    to {_write_degrees(found.greatest)} at {_write_degrees(found.theta_2_greatest)}"
    if found.worst > 0.0:
        yield f"smallest transmission angle: {_write_degrees(found.worst)}"
    if (ratio := time_ratio(linkage)) is not None:
        yield f"slower stroke of the output over the faster, at constant omega_2: {ratio:.4f}"


def _explain_turning(linkage: FourBar, bar: int, write: Callable[[float], str]) -> Iterator[str]:
    """Say why a bar has no limits: the two others would have to be in line, stretched or folded."""
    reach, d, own = reach_of(linkage, bar), linkage.ground, linkage.lengths[bar - 1]
    (one, x), (other, y) = ((BAR_NAMES[k], linkage.lengths[k - 1]) for k in MOVING_BARS if k != bar)
    name, touches = BAR_NAMES[bar], reach.beyond_stretched == 0.0 or reach.beyond_folded == 0.0
    when = "are in line at change points alone" if touches else "are never in line"
    yield f"{name}: no limits, {one} and {other} {when}:"
    relation = "=" if reach.beyond_stretched == 0.0 else "<"
    yield f"    ground + {name} = {write(d + own)} {relation} {one} + {other} = {write(x + y)}"
    relation = "=" if reach.beyond_folded == 0.0 else ">"
    yield f"    |ground - {name}| = {write(abs(d - own))} {relation} |{one} - {other}| = {write(abs(x - y))}"


def _write_degrees(angle: float) -> str:
    return f"{math.degrees(angle):.4f} deg"
