"""A table judged number by number.

A number gets its error, the allowed error, and what may explain the difference.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fourbar.errors import InputError
from fourbar.formulas.mobility import TURN
from fourbar.quantities import COUPLE, LINE, OK, PIN_FORCES, Array
from fourbar.scene import Scene
from fourbar.solution import Solution
from fourbar.solving import solve
from fourbar_validation.check.csv_columns import compute_column, find_made_of
from fourbar_validation.check.row_commands import (
    RowCommands,
    find_row_commands,
)
from fourbar_validation.check.theirs import NOT_JUDGED, TheirTable, name_quantity
from fourbar_validation.check.variants import open_tables
from fourbar_validation.compare.scales import Scale, TermSizes
from fourbar_validation.compare.tolerance import (
    EQUIVALENCE,
    MOST_ALLOWED,
    Mask,
    compute_difference,
    divide,
    find_conditions,
    magnitude,
    replace_zero_size,
)

ONE_DIGIT = 0.1
"""Largest allowed error by which a digit is compared, as a part of the scale."""


@dataclass(frozen=True, slots=True)
class Allowance:
    """Tolerance stated by a user, in NumPy's form: atol + rtol |ours|.

    atol is in the SI unit of each quantity.
    """

    rtol: float
    atol: float = 0.0


@dataclass(frozen=True, slots=True)
class Discrepancy:
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
        if self.permitted is None:
            return self.exact
        return self.exact or (self.judged and self.difference <= self.permitted)


class _Allowed(NamedTuple):
    """What a key is divided by and allowed, (n,) each, in parts of its size."""

    size: Array
    exact: Array
    """Round-off, and what half a unit of a rounded angle moves; infinite where no digit
    is left.
    """
    rounding: Array
    filled: Array
    """The same if the zeros at the end of a number were left off."""
    complete: bool
    """True if the table has a number in every row and component."""


def _is_shared(key: str) -> bool:
    """Return True for a force that depends on how pins at rest share the friction."""
    return name_quantity(key) in (*PIN_FORCES, "guide_force")


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
        self.table = replace(
            table,
            values={
                key: value
                for key, value in table.values.items()
                if key not in rows.rates
            },
            left_out={
                heading: why
                for heading, why in table.left_out.items()
                if not (rows.by_time and why == NOT_JUDGED["time"])
            },
            notes=(*table.notes, *rows.notes),
        )
        if self.at.moves_stroke:
            names = (f"theta_{self.at.bar}", self.at.angle)
            self.table = replace(self.table, found_by=names[0], places=names[1])
        self.stage = "position" if self.at.speed is None else "force"
        self.right = solve(scene, self.stage, at=self.at)
        self.ok = self.right.status_code == OK
        self._allowed: dict[str, _Allowed] = {}
        self._where: dict[str, Mask] = {}
        self._judged: dict[str, tuple[Array, Array, Array]] = {}
        self._nearest: dict[str, Array] = {}
        self._drive = COUPLE if scene.drive is None else LINE
        self._right_columns: dict[str, Array] = {}
        for key in table.values:
            name = name_quantity(key)
            column = compute_column(self.right, name)
            if column is not None:
                self._right_columns[name] = column
            else:
                if self.at.speed is None:
                    raise InputError(
                        f"motion.{self.at.names[1]}",
                        None,
                        f"is needed in the scene or the table to judge {key}",
                    )
                raise InputError(
                    "header",
                    key,
                    "does not exist in this scene: it has no dry friction",
                )

    def ours(self, key: str, solution: Solution | None = None) -> Array:
        """Give the formulas' values of a key of the table."""
        values: Array | None = self._right_columns[name_quantity(key)]
        if solution is not None:
            values = compute_column(solution, name_quantity(key))
        assert values is not None
        if key.startswith("|"):
            return magnitude(values)
        return values

    def nearest(self, key: str) -> Array:
        """Give the right number of a key that is nearest to that of the table.

        A drive that dry friction holds at rest has a range of them.
        """
        if key not in self._nearest:
            self._nearest[key] = self._approach(key, self.ours(key), self._holds)
        return self._nearest[key]

    def _approach(self, key: str, ours: Array, rows: Mask) -> Array:
        """Give a drive the number nearest to theirs that dry friction holds in rows."""
        if key != self._drive.value or not rows.any():
            return ours
        low, high = (
            ours + (getattr(self.right, end) - self.ours(key))
            for end in self._drive[2:]
        )
        return np.where(rows, np.clip(self.table.values[key], low, high), ours)

    @cached_property
    def _holds(self) -> Mask:
        """Mark the rows in which dry friction holds a range of drives, (n,)."""
        low, high = (getattr(self.right, name) for name in self._drive[2:])
        if low is None:
            return np.zeros(len(self.at.angle), dtype=bool)
        return np.asarray(low < high)

    @cached_property
    def held(self) -> Mask:
        """Mark the rows that state another drive within that range, (n,)."""
        key = self._drive.value
        if key not in self.table.values or not self._holds.any():
            return np.zeros(len(self.at.angle), dtype=bool)
        at_middle, at_nearest = (
            error <= allowed
            for error, allowed, _ in (
                self.judged(key, self.ours(key)),
                self.judged_right(key),
            )
        )
        return np.asarray(self._holds & ~at_middle & at_nearest)

    def describe_held(self) -> Iterator[str]:
        """Say which numbers of a drive agree since friction holds, and what follows."""
        name, _, *ends = self._drive
        if not (n := np.count_nonzero(self.held)):
            return
        text = f"at rest dry friction holds any {name} from {ends[0]} to {ends[1]}: "
        text += f"{n} of {name} lie within and agree"
        for end in ends:
            error, allowed, _ = self.judged(name, getattr(self.right, end))
            if at_end := np.count_nonzero(self.held & (error <= allowed)):
                text += f", {at_end} of them at {end}"
        yield text
        if pins := [key for key in self.table.values if _is_shared(key)]:
            names = ", ".join(dict.fromkeys(map(self.table.label, pins)))
            yield f"there pin forces depend on each pin's friction, not judged: {names}"

    def where(self, key: str) -> Mask:
        """Mark the rows in which both have a number that is judged, (n,)."""
        if key not in self._where:
            where = self._answer(key) & self.table.stated(key)
            if _is_shared(key):
                where &= ~self.held
            self._where[key] = np.asarray(where)
        return self._where[key]

    @cached_property
    def _made_of(self) -> list[str]:
        """Return the quantity whose size and condition each key has."""
        return [
            find_made_of(name_quantity(key), self.scene) for key in self.table.values
        ]

    @cached_property
    def _scales(self) -> dict[str, Scale]:
        columns = [self._right_columns[name_quantity(key)] for key in self.table.values]
        scales = TermSizes(self.scene, self.right).scales(self._made_of, columns)
        return {key: scales.select(i) for i, key in enumerate(self.table.values)}

    @cached_property
    def _exact(self) -> dict[str, Array]:
        linkage = self.scene.linkage
        conditions = find_conditions(self._made_of, linkage, self.right)
        allowed = EQUIVALENCE.allowed(conditions)
        exact = {}
        for of_key, (key, scale) in zip(allowed, self._scales.items(), strict=True):
            exact[key] = np.where(scale.size == 0.0, 0.0, scale.factor * of_key)
        return exact

    def scale(self, key: str) -> Scale:
        """Return size of a key and how far its terms cancel, (n,)."""
        return self._scales[key]

    def find_exact(self, key: str) -> Array:
        """Return the error that round-off allows a key at each position, (n,)."""
        return self._exact[key]

    def hold(self, key: str, exact: Array) -> None:
        """Allow a key another error at each position, (n,), in parts of its size."""
        self._exact[key] = exact

    def size(self, key: str) -> Array:
        """Return the size that the error of a key is divided by, (n,), in its unit."""
        return self.scale(key).size

    @cached_property
    def near(self) -> list[Solution]:
        """Solve again half a unit of a rounded angle away, to either side.

        The result is empty if the angle is not rounded.
        """
        return [solve(self.scene, self.stage, at=at) for at in self.rows.near]

    def judged_right(self, key: str) -> tuple[Array, Array, Array]:
        """Return (error, allowed, apart) of the table against the right numbers."""
        if key not in self._judged:
            self._judged[key] = self.judged(key, self.nearest(key))
        return self._judged[key]

    def judged(self, key: str, ours: Array) -> tuple[Array, Array, Array]:
        """Return (error, allowed, apart) of the table, each (n,).

        `ours` is taken for the right numbers.
        """
        quantity = name_quantity(key)
        limits = self._allow(key)
        theirs = self.table.values[key]
        if not limits.complete:
            theirs = np.where(np.isnan(theirs), ours, theirs)
        apart = compute_difference(quantity, ours, theirs)
        # the number a mistake would have printed is rounded at its own size, however
        # much larger
        larger = 1.0
        if ours is not self.nearest(key):
            usual = TURN if quantity.startswith("theta") else limits.size
            shares = (magnitude(ours) / usual)[self.ok]
            larger = float(np.nanmax(shares, initial=1.0))
        allowed = limits.exact * larger + limits.rounding
        return divide(apart, limits.size), allowed, apart

    def _allow(self, key: str) -> _Allowed:
        if key not in self._allowed:
            # quantities whose terms are all 0 have the size 1
            size = replace_zero_size(self.size(key))
            quantity = name_quantity(key)
            ours = self.ours(key)
            moves = [
                compute_difference(quantity, ours, self.ours(key, other))
                for other in self.near
            ]
            spread = divide(np.fmax.reduce(moves), size) if moves else 0.0
            exact = self.find_exact(key)
            rounding, filled = (
                divide(roundings[key], size)
                for roundings in (self.table.rounding, self.table.filled)
            )
            self._allowed[key] = _Allowed(
                size,
                np.where(exact <= MOST_ALLOWED, exact + spread + self.slack, np.inf),
                np.where(rounding > ONE_DIGIT, filled, rounding),
                np.asarray(filled),
                not np.isnan(self.table.values[key]).any(),
            )
        return self._allowed[key]

    def permitted(self, key: str, ours: Array) -> Array | None:
        """Return the difference that the given tolerance allows, (n,), in our unit."""
        if self.tolerance is None:
            return None
        limits = self._allow(key)
        return (
            self.tolerance.atol
            + self.tolerance.rtol * magnitude(ours)
            + limits.rounding * limits.size
        )

    def explained(
        self,
        key: str,
        predicted: Array,
        times: float = 1.0,
        left: float = 0.0,
    ) -> bool:
        """Return whether all numbers of a key are as `predicted`.

        Within `times` the allowed error, or the part `left` of the largest.
        """
        mask = self.where(key)
        predicted = self._approach(key, predicted, self.held)
        error, allowed, apart = (values[mask] for values in self.judged(key, predicted))
        within = error <= np.maximum(times * allowed, left)
        permitted = self.permitted(key, predicted)
        if permitted is not None:
            within |= apart <= permitted[mask]
        return bool(mask.any() and np.all(within))

    def findings(self) -> list[Discrepancy]:
        """List every number that the table states where the formulas have one."""
        findings = []
        for key, theirs in self.table.values.items():
            ours = self.nearest(key)
            label = self.table.label(key)
            error, allowed, apart = self.judged_right(key)
            permitted = self.permitted(key, ours)
            exact = self.find_exact(key)
            is_exact = (error <= exact) & (exact <= ONE_DIGIT)
            coarse = (allowed > ONE_DIGIT) & ~is_exact
            if permitted is not None:
                limits = self._allow(key)
                coarse &= allowed > divide(permitted, limits.size) - limits.rounding
            their_rows, our_rows = (
                numbers.reshape(len(numbers), -1).tolist() for numbers in (theirs, ours)
            )
            for i in np.flatnonzero(self.where(key)).tolist():
                stated = [
                    both
                    for both in zip(their_rows[i], our_rows[i], strict=True)
                    if math.isfinite(both[0])
                ]
                yours, mine = zip(*stated, strict=True)
                numbers = (float(error[i]), float(allowed[i]), float(apart[i]))
                most = None if permitted is None else float(permitted[i])
                findings.append(
                    Discrepancy(
                        self.table.lines[i],
                        label,
                        yours,
                        mine,
                        *numbers,
                        most,
                        float(self.table.places[i]),
                        bool(coarse[i]),
                    )
                )
        return findings

    def list_precisions(self) -> dict[str, float]:
        """Return the largest allowed error of each quantity, of numbers with a digit.

        A number that agrees with zeros in place of those left off is compared to them.
        """
        precisions: dict[str, float] = {}
        for key in self.table.values:
            error, allowed, _ = self.judged_right(key)
            limits = self._allow(key)
            filled = limits.exact + limits.filled
            allowed = np.where(error <= filled, np.minimum(allowed, filled), allowed)
            compared = allowed[self.where(key) & (allowed <= ONE_DIGIT)]
            if compared.size:
                precisions[self.table.label(key)] = float(compared.max())
        return precisions

    def without_answer(self) -> list[int]:
        """List lines with a number where the linkage does not assemble.

        No number is right there, nor at a singular position.
        """
        missing = [
            self.table.stated(key) & ~self._answer(key) for key in self.table.values
        ]
        return [self.table.lines[i] for i in np.flatnonzero(np.any(missing, axis=0))]

    def _answer(self, key: str) -> Mask:
        finite = np.isfinite(self.ours(key))
        return np.asarray(finite.all(axis=1) if finite.ndim == 2 else finite)
