"""Commands at the rows of a table of results."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from fourbar.errors import InputError
from fourbar.formulas.mobility import TURN
from fourbar.quantities import Array, Mask
from fourbar.scene import Command, Scene, command
from fourbar.solution import compute_times
from fourbar.solving import solve
from fourbar_validation.check.theirs import TheirColumn, TheirTable
from fourbar_validation.compare.tolerance import EPS, divide, wrap_difference

_AS_PRINTED = 4.0 * EPS
"""Relative difference of a position that went to degrees and back."""
_ONE_PLACE = 1e-6
"""Angle, rad, within which two positions are one: at a limit of the bar by which a row
is found they differ by the square root of round-off.
"""
_BY_CHANCE = 0.05
"""Probability of rounded times at which the law has every angle as it is printed."""
_NEWTON = 40
"""Steps to the time at which a law has an angle: few, but where it turns back there.
"""
_HALVINGS = 60
"""Halvings after which an interval of doubles is none."""


class RowCommands(NamedTuple):
    """Commands at the rows of a table."""

    at: Command
    near: tuple[Command, ...] = ()
    """Commands half a unit of a rounded angle, time or rate away, to either side."""
    rates: tuple[str, ...] = ()
    """Names of the speed and acceleration that the table states, and not the scene."""
    later: Callable[[Array | float], Command] | None = None
    """Commands so many seconds later, where the times of the rows say which these are.
    """
    notes: tuple[str, ...] = ()
    """Sentences on what is taken for a rate that the table does not state."""


def _find_by_time(scene: Scene, table: TheirTable, base: Command) -> RowCommands:
    """Command the law, or the one speed of the scene, at the times of the rows.

    Raises InputError for a time that the law does not have.
    """
    law: Any = scene.motion.law
    own: Any = base.time if law is not None else compute_times(scene, base)
    if law is not None:
        first, *_, last = law.time
    elif own is not None:
        first, last = -math.inf, math.inf
        places, *rates = base.stated
        start = places[np.argmin(own)]
    else:
        wanted = f"needs a column {base.commanded}: the scene has no motion over time"
        raise InputError("table", "time", wanted)
    table = _move_to_own(own, table)
    printed = table.places
    beyond = np.abs(printed - np.clip(printed, first, last)) > table.place.rounding
    if beyond.any():
        row = int(np.argmax(beyond))
        wanted = f"the law lasts from {first:g} to {last:g} s"
        raise InputError(f"line {table.lines[row]}, time", printed[row], wanted)

    def command_at(shift: Array | float) -> Command:
        time = np.clip(printed + shift, first, last)
        if law is None:
            place, speed, acceleration = start + np.ravel(rates[0])[0] * time, *rates
        else:
            place, speed, acceleration = law.at(time)
        if scene.motion.stroke is not None:
            return command(replace(scene, motion=scene.motion.replace(angle=place)))
        at = _command_each(base, place)
        return at._replace(speed=speed, acceleration=acceleration)

    # zeros at the ends of times may be left off
    filled = table.place._replace(rounding=table.place.filled)
    found = _command_rounded(replace(table, place=filled), command_at)
    return found._replace(later=command_at)


def find_row_commands(scene: Scene, table: TheirTable) -> RowCommands:
    """Return what is commanded at each row of the table.

    The scene's command serves if it has the same positions. Where the scene states no
    speed it is that of the row, as in the log of a simulator or a test stand. At other
    positions than those of a law or of listed speeds the rates are those of the law at
    the time of the row, or else of the row.

    Raises InputError for a motion whose rows are not found by an angle, and for an
    angle that the motion passes at several positions.
    """
    base = command(scene)
    if scene.motion.stroke is not None and table.found_by != "time":
        return _find_strokes(scene, table, base)
    if scene.motion.free is not None:
        allowed = (
            "not judged while released; without free and omega_2 each row is judged at"
            " its own omega_2 and alpha_2"
        )
        raise InputError("motion.free", None, allowed)
    if table.found_by == "time":
        return _find_by_time(scene, table, base)
    commanded = table.found_by == base.commanded
    same = _has_positions_of(scene, table, base)
    varies = scene.motion.law is not None or scene.motion.has_rate_of_each
    if varies and not same and commanded:
        along = _follow_law(scene, table, base)
        if along is not None:
            return along
    rates = scene.motion.names[1:]
    needed = not same if varies else scene.motion.speed is None
    fields = zip(("speed", "acceleration"), rates, strict=True)
    stated = {
        field: table.columns[rate]
        for field, rate in fields
        if needed and rate in table.columns
    }
    if needed and varies and len(stated) < 2:
        law = scene.motion.law is not None
        time = f"a column time beside {scene.motion.commanded}, or " if law else ""
        raise InputError(
            "motion.law" if law else f"motion.{rates[0]}",
            None,
            "a table is judged along a law or listed speeds at the scene's own"
            f" positions, all of them in its order; at others it needs {time}columns"
            f" {' and '.join(rates)}",
        )
    if "speed" not in stated:
        stated = {}
    if not commanded:
        found = RowCommands(base) if same else _find_by_another_bar(scene, table, base)
    else:
        table = table if same else _move_to_own(base.angle, table)
        at = base if same else _command_each(base, table.places)

        def command_at(shift: Array | float) -> Command:
            return at.as_doubles()._replace(angle=at.angle + shift)

        found = _command_rounded(table, command_at)._replace(at=at)
    if stated:
        found = command_rates(found, table, stated)._replace(rates=rates)
        speeds = stated["speed"].values
        if len(stated) == 1 and np.ptp(speeds) and not base.acceleration:
            said = f"{rates[1]} is not in the table: it is taken as 0"
            found = found._replace(notes=(said,))
    return found


def command_rates(
    rows: RowCommands, table: TheirTable, stated: Mapping[str, TheirColumn]
) -> RowCommands:
    """Command rows at the speed or acceleration that a table states, and beside.

    `stated`: columns by the field of a command.
    """
    numbers: dict[str, Any] = {field: rate.values for field, rate in stated.items()}
    at, *near = (one._replace(**numbers) for one in (rows.at, *rows.near))
    near = near or [at]
    for field, rate in stated.items():
        half = table.find_half(rate)
        if half.any():
            near = [
                one._replace(**{field: getattr(one, field) + end})
                for one, end in product(near, (-half, half))
            ]
    return rows._replace(at=at, near=tuple(one for one in near if one is not at))


def _command_rounded(
    table: TheirTable,
    command_at: Callable[[Array | float], Command],
) -> RowCommands:
    """Command the rows, and both ends of the rounding of their places."""
    half = table.find_half(table.place)
    near = (command_at(-half), command_at(half)) if half.any() else ()
    return RowCommands(command_at(0.0), near)


def _find_strokes(scene: Scene, table: TheirTable, base: Command) -> RowCommands:
    """Command the stroke of each row, or the scene's own if the angles are theirs."""
    if table.found_by != base.commanded:
        if _has_positions_of(scene, table, base):
            return RowCommands(base)
        why = "a table at other positions than the scene's own needs a column stroke"
        raise InputError("motion.stroke", None, why)
    row = int(np.argmin(table.places))
    if table.places[row] <= 0.0:
        allowed = "must be above 0: it is the distance of the cylinder's pins"
        raise InputError(f"line {table.lines[row]}, stroke", table.places[row], allowed)

    def command_at(shift: Array | float) -> Command:
        motion = scene.motion.replace(angle=table.places + shift)
        return command(replace(scene, motion=motion))

    return _command_rounded(table, command_at)


def _follow_law(
    scene: Scene,
    table: TheirTable,
    base: Command,
) -> RowCommands | None:
    """Command the law at the times of the rows; None without a law or times.

    Time and angle of a row are each within half a unit of its last digit. A row is
    judged at its time, or if its angle does not fit that, at the nearest time that
    rounds to it; and it may be off by what any other time that fits both changes.

    Raises InputError for a row that no time fits, or several, unless the table states
    its rates itself.
    """
    law = scene.motion.law
    if law is None or table.times is None:
        return None
    first, *_, last = law.time
    printed, half, filled, _ = table.times
    stated = np.clip(printed, first, last)
    rounding = table.place.rounding
    rounding = rounding + _AS_PRINTED * (1.0 + np.abs(table.places))

    def measure(time: Array) -> Array:
        return np.asarray(wrap_difference(table.places - law.at(time)[0]))

    def fits(time: Array) -> Mask:
        return np.abs(measure(time)) <= rounding

    def follow(time: Array) -> Command:
        angle, speed, acceleration = law.at(time)
        at = _command_each(base, angle)
        return at._replace(speed=speed, acceleration=acceleration)

    def command_at(time: Array) -> Command:
        at = follow(time)
        on_law = fits(time) | (rounding > _ONE_PLACE)
        return at._replace(angle=np.where(on_law, at.angle, table.places))

    fits_stated = np.abs(measure(stated)) <= rounding + _ONE_PLACE
    # zeros at the end of a time that fits may be left off; start and end are exact
    half = np.where(fits_stated, filled, half)
    half = np.where(fits_stated & np.isin(printed, (first, last)), 0.0, half)
    ends = [np.clip(printed + side, first, last) for side in (-half, half)]

    def find(time: Array) -> Array:
        """Return the time next to one at which the law has the angle of the row."""
        for _ in range(_NEWTON):
            step = divide(measure(time), law.at(time)[1])
            time = np.clip(time + step, *ends)
        return time

    time = np.where(fits_stated, stated, find(stated))
    off = ~(np.abs(measure(time)) <= rounding + _ONE_PLACE)
    before, after = map(find, ends)
    # the law turns back between two times that fit
    several = fits(before) & fits(after)
    several &= law.at(before)[1] * law.at(after)[1] < 0.0
    off |= several & ~fits_stated
    if off.any():
        names = scene.motion.names[1:]
        if all(name in table.columns for name in names):
            return None
        row = int(np.argmax(off))
        law_at, place = np.degrees([law.at(stated)[0][row], table.places[row]])
        raise InputError(
            f"line {table.lines[row]}, time",
            float(printed[row]),
            f"the law is at {law_at:.6g} deg then, and the table at {place:.6g} deg:"
            f" add columns {' and '.join(names)}",
        )
    at = command_at(time)
    passed = np.maximum(np.abs(law.at(time)[1]) * half, rounding)
    if fits_stated.all() and np.prod(rounding / passed) < _BY_CHANCE:
        near = []  # nobody rounded these times
    else:
        within = (_find_last_that_holds(fits, time, end) for end in ends)
        near = [*map(command_at, within)]

    def later(shift: Array | float) -> Command:
        return follow(np.clip(time + shift, first, last))

    return RowCommands(at, tuple(near), later=later)


def _find_last_that_holds(
    holds: Callable[[Array], Mask],
    inside: Array,
    outside: Array,
) -> Array:
    """Return the last times, from `inside` towards `outside`, at which it holds."""
    for _ in range(_HALVINGS):
        middle = 0.5 * (inside + outside)
        within = holds(middle)
        inside = np.where(within, middle, inside)
        outside = np.where(within, outside, middle)
    return inside


def _command_each(base: Command, angle: Array) -> Command:
    """Command the angle of each row, on the branch and at the speed of a command."""
    branch = np.full(len(angle), base.branch[0])
    return Command(angle, branch, base.speed, base.acceleration, bar=base.bar)


def _move_to_own(own: Array, table: TheirTable) -> TheirTable:
    """Return the table at the scene's places that all rows round to, which are exact.

    Where that may be chance the table is returned as it is.
    """
    own = np.sort(own)
    if own[0] == own[-1]:
        return table
    half = table.place.rounding
    after = np.clip(np.searchsorted(own, table.places), 1, len(own) - 1)
    lower, upper = own[after - 1], own[after]
    nearest = np.where(table.places - lower < upper - table.places, lower, upper)
    step = np.ptp(own) / (len(own) - 1)
    rounds = np.abs(nearest - table.places) <= half * (1.0 + _ONE_PLACE)
    by_chance = np.prod(np.minimum(half, 0.5 * step) / (0.5 * step))
    if not rounds.all() or by_chance >= _BY_CHANCE:
        return table
    exact = np.zeros_like(half)
    place = table.place._replace(values=nearest, rounding=exact, filled=exact)
    return replace(table, place=place)


def _has_positions_of(scene: Scene, table: TheirTable, base: Command) -> bool:
    """Return whether the rows are the scene's own positions, as they are printed."""
    angles = base.angle
    if table.found_by != base.commanded:
        angles = getattr(solve(scene, "position"), table.found_by)
    if angles.shape != table.places.shape:
        return False
    if angles is base.angle:
        return np.allclose(angles, table.places, rtol=_AS_PRINTED, atol=0.0)
    apart = np.abs(wrap_difference(angles - table.places))
    return bool(np.all(apart <= table.place.rounding + _ONE_PLACE))


def _find_by_another_bar(
    scene: Scene,
    table: TheirTable,
    base: Command,
) -> RowCommands:
    """Find the commanded angle at which another bar has the angle of each row.

    The other bar is commanded in both assemblies. A position counts if the scene has
    the angle there, one in the range of the scene before others.

    Raises InputError for a row whose angle the motion passes twice.
    """
    first, last = base.angle.min() - _ONE_PLACE, base.angle.max() + _ONE_PLACE

    def find(places: Array) -> Array:
        found = []
        for branch in (1, -1):
            branches = np.full(len(places), branch, dtype=np.int8)
            at = Command(places, branches, None, 0.0, bar=int(table.found_by[-1]))
            angle = solve(scene, "position", at=at)[base.commanded]
            angle = first + np.remainder(angle - first, TURN)
            at = _command_each(base, angle)._replace(speed=None, acceleration=0.0)
            theirs = solve(scene, "position", at=at)[table.found_by]
            fits = np.abs(wrap_difference(theirs - places)) <= _ONE_PLACE
            found.append(np.where(fits, angle, np.nan))
        within = np.less_equal(found, last)
        return np.where(within | ~within.any(axis=0), found, np.nan)

    angles = find(table.places)
    several = np.abs(np.subtract(*angles)) > _ONE_PLACE
    if several.any():
        row = int(np.argmax(several))
        place = table.places[row] / table.place.unit.factor
        passed = f"{base.commanded} = {math.degrees(angles[:, row].min()):.6g} deg"
        raise InputError(
            f"line {table.lines[row]}, {table.found_by}",
            f"{place:.6g} {table.place.unit.text}",
            f"the motion passes it at {passed} and again: add a column"
            f" {base.commanded}",
        )
    angle = np.fmax(*angles)

    def command_at(shift: Array | float) -> Command:
        shifted = find(table.places + shift)
        away = np.nan_to_num(np.abs(shifted - angle), nan=np.inf)
        nearest = np.where(away[0] <= away[1], shifted[0], shifted[1])
        return _command_each(base, nearest)

    return _command_rounded(table, command_at)
