"""A table judged number by number.

A number gets its error, the allowed error, and what may explain the difference.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from fourbar.effects import Table
from fourbar.errors import InputError
from fourbar.formulas.mobility import TURN
from fourbar.linkage import MOVING_BARS
from fourbar.quantities import (
    COUPLE,
    LINE,
    OK,
    PIN_FORCES,
    SPRING_NAME,
    UNITS,
    Array,
    find_derived,
)
from fourbar.scene import Command, Scene
from fourbar.show.acting import list_springs
from fourbar.show.derived import derive
from fourbar.show.driving import begin_to_move, find_senses, leaves_range
from fourbar.solution import Solution
from fourbar.solving import solve
from fourbar_validation.check.row_commands import (
    RowCommands,
    find_row_commands,
)
from fourbar_validation.check.theirs import NOT_JUDGED, TheirTable
from fourbar_validation.compare.scales import Scale, TermSizes
from fourbar_validation.compare.tolerance import (
    EQUIVALENCE,
    MOST_ALLOWED,
    Mask,
    compute_difference,
    divide,
    find_condition,
    magnitude,
    replace_zero_size,
)

Predict = Callable[[str], Array | None]
"""Function of a quantity that returns the numbers of a mistake; None: it has none."""
ONE_DIGIT = 0.1
"""Largest allowed error by which a digit is compared, as a part of the scale."""

MADE_OF = {
    "shaking_force": "F12",
    "shaking_moment": "torque",
    "transmission": "theta_4",
    "length": "B",
    "force": "F12",
}
"""Quantity whose size and condition a column has; a spring's by what is measured."""


class Allowance(NamedTuple):
    """Tolerance stated by a user, in NumPy's form: atol + rtol |ours|.

    atol is in the SI unit of each quantity.
    """

    rtol: float
    atol: float = 0.0


class Discrepancy(NamedTuple):
    """One quantity at one position of the user's table, in SI."""

    line: int
    """Line in the user's file."""
    quantity: str
    theirs: tuple[float, ...]
    ours: tuple[float, ...]
    error: float
    """Relative to the scale of the quantity (angles: rad)."""
    allowed: float
    difference: float
    """Difference in the unit of the quantity, as `permitted`."""
    permitted: float | None
    """Difference permitted by the stated tolerance and the printed digits. None if no
    tolerance was stated.
    """
    place: float
    """Angle by which the row is found, rad."""
    coarse: bool
    """True if ours has not all its digits, and the digits that it has allow more than
    a tenth of the scale, and than the stated tolerance.
    """

    @property
    def judged(self) -> bool:
        """Return whether it is wrong, or agrees in any digit."""
        return self.error > self.allowed or not self.coarse

    @property
    def exact(self) -> bool:
        """Return whether it agrees to round-off and its printed digits."""
        return self.judged and self.error <= self.allowed

    @property
    def agrees(self) -> bool:
        """Return whether it is within the allowed error, or a stated tolerance."""
        within = self.permitted is not None and self.difference <= self.permitted
        return self.exact or (self.judged and within)


def find_made_of(name: str, scene: Scene) -> str:
    """Return the quantity whose size and condition a column has: mostly itself."""
    if name in UNITS:
        return name
    of_spring = SPRING_NAME.fullmatch(name)
    kind = of_spring[2] if of_spring else name
    if kind in MADE_OF:
        return MADE_OF[kind]
    start = name[:2] if name[:2] in ("v_", "a_") else ""
    point = name.removeprefix(start)
    bar = next(each.bar for each in scene.points if each.name == point)
    return f"{start}G{bar}" if bar in MOVING_BARS else f"{start}A"


def compute_column(solution: Solution, name: str) -> Array | None:
    """Compute a column from O2, (n,) or (n, 2); None if its stage was not evaluated."""
    values: Array | None
    if name in UNITS:
        values = getattr(solution, name)
        return values
    if find_derived(name) is None:
        of_stage = {"v_": solution.velocity, "a_": solution.acceleration}
        stage = of_stage.get(name[:2], solution.points)
        return stage.get(name[2:] if name[:2] in of_stage else name)
    of_spring = SPRING_NAME.fullmatch(name)
    if of_spring and int(of_spring[1]) >= len(list_springs(solution.scene)):
        raise InputError("header", name, "does not exist in this scene")
    values = derive(solution, name)
    return values


class JudgedColumn:
    """One quantity of a table, row by row against the formulas."""

    def __init__(self, judge: "Judge", key: str) -> None:
        self.judge = judge
        self.key = key
        self.quantity = key.strip("|")
        self.theirs, self._rounding, self._filled, self.unit = judge.table.columns[key]
        self.ours = self.take(judge.right)
        each = np.isfinite(self.theirs.reshape(len(self.theirs), -1))
        self.stated = np.asarray(each.any(axis=1))
        """Rows in which the table has any number, (n,)."""
        self.label = key
        """Name of the quantity, or of the one component of it that the table has."""
        axes = np.flatnonzero(each.any(axis=0))
        if self.theirs.ndim == 2 and len(axes) == 1:
            self.label = f"{key}_{'xy'[axes[0]]}"
        finite = np.isfinite(self.ours.reshape(len(self.ours), -1))
        self.answered = np.asarray(finite.all(axis=1))
        """Rows in which the formulas have a number, (n,)."""
        self.is_shared = self.quantity in (*PIN_FORCES, "guide_force")
        """True for a force that depends on how pins at rest share the friction."""
        self.is_drive = key == judge.drive.value
        self._made_of = find_made_of(self.quantity, judge.scene)

    def measure(self, values: Array) -> Array:
        """Return the magnitudes of vectors where the table has magnitudes."""
        return magnitude(values) if self.key.startswith("|") else values

    def take(self, solution: Solution) -> Array:
        """Return the numbers of a solution for this column."""
        values = compute_column(solution, self.quantity)
        if values is not None:
            return self.measure(values)
        if solution.at.speed is None:
            rate = f"motion.{solution.at.names[1]}"
            needed = f"is needed in the scene or the table to judge {self.key}"
            raise InputError(rate, None, needed)
        exerts = "torque" if self.judge.drive is COUPLE else "force"
        why = f"its drive exerts a {exerts}"
        if self.quantity == "stroke":
            why = "it has no cylinder"
        if self.quantity in self.judge.drive:
            why = "it has no dry friction"
        missing = f"does not exist in this scene: {why}"
        raise InputError("header", self.key, missing)

    def predict(self, predict: Predict) -> Array | None:
        """Return the numbers that a mistake predicts for this column, or None."""
        predicted = predict(self.quantity)
        return None if predicted is None else self.measure(predicted)

    @cached_property
    def nearest(self) -> Array:
        """Right number that is nearest to theirs.

        A drive that dry friction holds at rest has a range of them. One that starts or
        stops is stated with the whole of it or, as a solution has it, without.
        """
        nearest = self._approach(self.ours, self.judge.holds)
        for ours in map(self.take, self.judge.begun):
            apart, so_far = (
                compute_difference(
                    self.quantity,
                    right,
                    np.where(np.isnan(self.theirs), right, self.theirs),
                )
                for right in (ours, nearest)
            )
            closer = apart < so_far
            nearest = nearest.copy()
            nearest[closer] = ours[closer]
        return nearest

    def _approach(self, ours: Array, rows: Mask) -> Array:
        """Give a drive the number nearest to theirs that dry friction holds in rows."""
        if not self.is_drive or not rows.any():
            return ours
        low, high = (
            ours + (getattr(self.judge.right, end) - self.ours)
            for end in self.judge.drive[2:]
        )
        return np.where(rows, np.clip(self.theirs, low, high), ours)

    @cached_property
    def where(self) -> Mask:
        """Rows in which both have a number that is judged, (n,)."""
        where = self.answered & self.stated
        return where & ~self.judge.held if self.is_shared else where

    @cached_property
    def scale(self) -> Scale:
        """Size of the quantity and how far its terms cancel, (n,)."""
        return self.judge.sizes.scale(self._made_of, self.ours)

    @property
    def size(self) -> Array:
        """Size that errors are divided by, (n,), in its unit."""
        return self.scale.size

    @cached_property
    def exact(self) -> Array:
        """Error that round-off allows at each position, (n,), in parts of the size."""
        judge = self.judge
        condition = find_condition(self._made_of, judge.scene.linkage, judge.right)
        allowed = self.scale.factor * EQUIVALENCE.allowed(condition)
        return np.where(self.size == 0.0, 0.0, allowed)

    @cached_property
    def divisor(self) -> Array:
        """The same size, and 1 of its unit where all terms of the quantity are 0."""
        return replace_zero_size(self.size)

    @cached_property
    def round_off(self) -> Array:
        """Round-off, and what half a unit of a rounded angle moves, (n,).

        Infinite where no digit is left.
        """
        ours = [self.ours, *map(self.take, self.judge.begun)]
        moves = [
            np.fmin.reduce(
                [compute_difference(self.quantity, one, moved) for one in ours]
            )
            for moved in map(self.take, self.judge.near)
        ]
        spread = divide(np.fmax.reduce(moves), self.divisor) if moves else 0.0
        allowed = self.exact + spread + self.judge.slack
        return np.where(self.exact <= MOST_ALLOWED, allowed, np.inf)

    @cached_property
    def filled(self) -> Array:
        """Half a unit of the last digit if the zeros at the end were left off, (n,)."""
        return divide(self._filled, self.divisor)

    @cached_property
    def rounding(self) -> Array:
        """Half a unit of the last printed digit, (n,), in parts of the size."""
        rounding = divide(self._rounding, self.divisor)
        return np.where(rounding > ONE_DIGIT, self.filled, rounding)

    @cached_property
    def judged_right(self) -> tuple[Array, Array, Array]:
        """(error, allowed, apart) of the table against the right numbers."""
        return self.compare(self.nearest)

    @property
    def wrong(self) -> Mask:
        """Rows in which the table is beyond what is allowed, (n,)."""
        error, allowed, _ = self.judged_right
        return np.asarray(self.where & ~(error <= allowed))

    @property
    def excess(self) -> Array:
        """Error in parts of what is allowed, or of what a tolerance permits, (n,)."""
        error, allowed, apart = self.judged_right
        permitted = self.permitted(self.nearest)
        return np.fmin(error / allowed, apart / permitted)

    def compare(self, ours: Array) -> tuple[Array, Array, Array]:
        """Return (error, allowed, apart) of the table, each (n,).

        `ours` is taken for the right numbers.
        """
        theirs = np.where(np.isnan(self.theirs), ours, self.theirs)
        apart = compute_difference(self.quantity, ours, theirs)
        # the number a mistake would have printed is rounded at its own size, however
        # much larger
        larger = 1.0
        if ours is not self.nearest:
            usual = TURN if self.quantity.startswith("theta") else self.divisor
            shares = (magnitude(ours) / usual)[self.judge.ok]
            larger = float(np.nanmax(shares, initial=1.0))
        allowed = self.round_off * larger + self.rounding
        return divide(apart, self.divisor), allowed, apart

    def permitted(self, ours: Array) -> Array:
        """Return the difference that the given tolerance allows, (n,), in our unit."""
        tolerance = self.judge.tolerance
        if tolerance is None:
            return np.zeros(len(ours))
        rounding = self.rounding * self.divisor
        return tolerance.atol + tolerance.rtol * magnitude(ours) + rounding

    def explained(
        self,
        predicted: Array,
        times: float = 1.0,
        left: float = 0.0,
    ) -> bool:
        """Return whether all numbers are as `predicted`.

        Within `times` the allowed error, or the part `left` of the largest.
        """
        predicted = self._approach(predicted, self.judge.held)
        error, allowed, apart = self.compare(predicted)
        within = error <= np.maximum(times * allowed, left)
        within |= apart <= self.permitted(predicted)
        return bool(self.where.any() and within[self.where].all())

    def findings(self) -> Iterator[Discrepancy]:
        """List every number that the table states where the formulas have one."""
        error, allowed, apart = self.judged_right
        permitted = self.permitted(self.nearest)
        is_exact = (error <= self.exact) & (self.exact <= ONE_DIGIT)
        coarse = (allowed > ONE_DIGIT) & ~is_exact
        coarse &= allowed > divide(permitted, self.divisor) - self.rounding
        table = self.judge.table
        for i in np.flatnonzero(self.where).tolist():
            theirs = np.atleast_1d(self.theirs[i])
            stated = np.isfinite(theirs)
            yield Discrepancy(
                table.lines[i],
                self.label,
                tuple(theirs[stated].tolist()),
                tuple(np.atleast_1d(self.nearest[i])[stated].tolist()),
                float(error[i]),
                float(allowed[i]),
                float(apart[i]),
                None if self.judge.tolerance is None else float(permitted[i]),
                float(table.place.values[i]),
                bool(coarse[i]),
            )

    @property
    def precision(self) -> float:
        """Largest allowed error of the numbers that have a digit; NaN if none has.

        A number that agrees with zeros in place of those left off is compared to them.
        """
        error, allowed, _ = self.judged_right
        filled = self.round_off + self.filled
        allowed = np.where(error <= filled, np.minimum(allowed, filled), allowed)
        compared = allowed[self.where & (allowed <= ONE_DIGIT)]
        return float(compared.max()) if compared.size else math.nan


class OpenTable(Table):
    """Table whose factor is NaN, and no error, at an angle that it does not cover."""

    def replace_outside(self, theta_2: Any) -> float:
        """Return NaN: what acts there is not known."""
        return math.nan


def open_tables(scene: Scene) -> Scene:
    """Let positions of hypotheses lie beyond the tables of loads, and have no force."""
    loads = tuple(
        load
        if load.table is None
        else replace(load, table=OpenTable(load.table.theta_2, load.table.factor))
        for load in scene.loads
    )
    return replace(scene, loads=loads)


class Judge:
    """Numbers of a table against the formulas at its positions.

    Parameters
    ----------
    rows : what was commanded at its rows; left out: what the scene and the table state.
    slack : part of each quantity's size that is allowed besides, of an engine that
        promises no more digits.
    """

    def __init__(
        self,
        scene: Scene,
        table: TheirTable,
        tolerance: Allowance | None = None,
        rows: RowCommands | None = None,
        slack: float = 0.0,
    ) -> None:
        self.scene, self.tolerance, self.slack = open_tables(scene), tolerance, slack
        if rows is None:
            rows = find_row_commands(scene, table)
        self.rows = rows
        self.at = rows.at
        self.stated = table
        columns = {k: own for k, own in table.columns.items() if k not in rows.rates}
        left_out = {
            heading: why
            for heading, why in table.left_out.items()
            if not (rows.later and why == NOT_JUDGED["time"])
        }
        notes = (*table.notes, *rows.notes)
        table = replace(table, columns=columns, left_out=left_out, notes=notes)
        if self.at.moves_stroke or table.found_by == "time":
            place = table.place._replace(values=self.at.angle)
            table = replace(table, place=place, found_by=f"theta_{self.at.bar}")
        self.table = table
        self.stage = "position" if self.at.speed is None else "force"
        self.right = solve(scene, self.stage, at=self.at)
        self.ok = self.right.status_code == OK
        self.drive = COUPLE if scene.drive is None else LINE
        self.sizes = TermSizes(self.scene, self.right)
        self.columns = {key: JudgedColumn(self, key) for key in columns}

    @cached_property
    def holds(self) -> Mask:
        """Rows in which dry friction holds a range of drives, (n,)."""
        return np.asarray(leaves_range(self.right))

    @cached_property
    def _senses(self) -> Array:
        """Senses in which rows at rest start and come to rest, (2, n)."""
        return find_senses(self.right)

    @cached_property
    def begun(self) -> list[Solution]:
        """Solutions with the whole of dry friction where rows start or stop by it.

        A row that turns back has it in the one sense or the other.
        """
        senses = self._senses
        begun = (
            begin_to_move(self.at.speed, np.unique(senses, axis=0))
            if senses.any()
            else []
        )
        return [
            solve(self.scene, self.stage, at=self.at._replace(speed=speed))
            for speed in begun
        ]

    @cached_property
    def held(self) -> Mask:
        """Rows that state another drive within that range, (n,)."""
        column = self.columns.get(self.drive.value)
        if column is None or not self.holds.any():
            return np.zeros(len(self.right), dtype=bool)
        at_middle, allowed_there, _ = column.compare(column.ours)
        at_nearest, allowed, _ = column.judged_right
        differs = ~(at_middle <= allowed_there)
        return np.asarray(self.holds & differs & (at_nearest <= allowed))

    def describe_held(self) -> Iterator[str]:
        """Say which numbers of a drive agree since friction holds, and what follows."""
        name, _, *ends = self.drive
        if not (n := np.count_nonzero(self.held)):
            return
        text = f"at rest dry friction holds any {name} from {ends[0]} to {ends[1]}: "
        text += f"{n} of {name} lie within and agree"
        yield text
        pins = [column.label for column in self.columns.values() if column.is_shared]
        if pins:
            names = ", ".join(dict.fromkeys(pins))
            yield f"there pin forces depend on each pin's friction, not judged: {names}"

    @cached_property
    def near(self) -> list[Solution]:
        """Solutions half a unit of rounded angles and rates away, to either side.

        The list is empty if none is rounded. What starts or stops keeps its sense.
        """
        near = self.rows.near
        if self._senses.any():
            near = tuple(map(self._keep_senses, near))
        return [solve(self.scene, self.stage, at=at) for at in near]

    def _keep_senses(self, at: Command) -> Command:
        """Return a command at whose rounded speeds no row starts or stops backwards."""
        speed: Any = at.speed
        back = (speed * self._senses < 0.0).all(axis=0)
        return at._replace(speed=np.where(back, -speed, speed))

    @cached_property
    def findings(self) -> list[Discrepancy]:
        """Every number that the table states where the formulas have one."""
        columns = self.columns.values()
        return [finding for column in columns for finding in column.findings()]

    @cached_property
    def not_assembled(self) -> list[int]:
        """Lines with a number where the linkage does not assemble, or is singular.

        There is no right number there.
        """
        missing = [each.stated & ~each.answered for each in self.columns.values()]
        return [self.table.lines[i] for i in np.flatnonzero(np.any(missing, axis=0))]
