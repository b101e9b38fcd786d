"""Reading a table of somebody's results: columns named as `fourbar analyze --csv` names them, units in brackets.

    theta_2 [deg], torque [N cm], F12_x, F12_y

Of a vector one component may stand alone; it is judged by itself, at the scale of the vector.
Without a unit a column is SI (rad). How many digits were printed decides how much rounding is
theirs: half a unit of the last printed digit is always allowed, and what half a unit of a rounded
theta_2 changes.
"""

import csv
import io
import math
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fourbar.errors import InputError
from fourbar.files.reading import read_text
from fourbar.quantities import UNITS, VECTORS
from validation.compare.tolerance import EPS

Array = NDArray[np.float64]

DECIMALS = 4
"""12.5 deg and 0.25 rad are positions that somebody chose, 0.1745 rad is one that was rounded."""
NOT_JUDGED = {
    "time": "a row is found by its theta_2",
    **dict.fromkeys(("torque_error", "force_error", "friction_residual"), "it is an error of the formulas themselves"),
}
"""Columns of `fourbar analyze --csv` that are no answer, and why."""
LARGEST_FILE = 64 * 2**20
"""Bytes; a table larger than this is not a hand-made comparison."""


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Somebody's numbers in SI: theta_2 (n,), and per quantity values (n,) or (n, 2) with their rounding.

    A component that the table does not have is NaN, in every row.
    """

    theta_2: Array
    values: dict[str, Array]
    rounding: dict[str, Array]
    """Half a unit of the last digit printed, in SI, (n,)."""
    lines: list[int]
    """The line of the file that each row stands in."""
    theta_2_rounding: Array
    """Half a unit of the last digit of theta_2 in a column that is printed with DECIMALS, rad, (n,); else 0."""

    def label(self, quantity: str) -> str:
        """The quantity, or the one component of it that the table has."""
        values = self.values[quantity]
        there = [letter for letter, gone in zip("xy", np.isnan(values).T, strict=False) if not gone.any()]
        return f"{quantity}_{there[0]}" if values.ndim == 2 and len(there) == 1 else quantity


def read_table(path: Path) -> Table:
    """Read a CSV table; InputError names the column or line that cannot be read."""
    numbered = _lines(path)
    places, lines = [place for place, _ in numbered][1:], [cells for _, cells in numbered]
    if len(lines) < 2:
        raise InputError("table", path.name, "needs a header and at least one row", str(path))
    columns = [_column(path, heading) for heading in lines[0]]
    names = [name for name, _ in columns]
    if len(set(names)) != len(names):
        raise InputError("header", lines[0], "names a column twice", str(path))
    if "theta_2" not in names:
        raise InputError("header", lines[0], "needs a column theta_2 (say theta_2 [deg] for degrees)", str(path))
    numbers = np.empty((len(lines) - 1, len(columns)))
    halves = np.empty_like(numbers)
    for row, (line, cells) in enumerate(zip(places, lines[1:], strict=True)):
        if len(cells) != len(columns):
            raise InputError(f"line {line}", cells, f"needs {len(columns)} cells", str(path))
        for index, cell in enumerate(cells):
            numbers[row, index], halves[row, index] = _number(path, line, cell)
    factors = np.array([factor for _, factor in columns])
    numbers, halves = numbers * factors, halves * factors
    by_name = {name: numbers[:, index] for index, name in enumerate(names)}
    half_by_name = {name: halves[:, index] for index, name in enumerate(names)}
    values, rounding = {}, {}
    for quantity in UNITS:
        pair = (f"{quantity}_x", f"{quantity}_y")
        if quantity in VECTORS and not by_name.keys().isdisjoint(pair):
            gone = np.full(len(numbers), np.nan)
            values[quantity] = np.stack([by_name.get(name, gone) for name in pair], axis=1)
            rounding[quantity] = np.hypot(*(half_by_name.get(name, 0.0 * numbers[:, 0]) for name in pair))
        elif quantity in by_name and quantity != "theta_2":
            values[quantity], rounding[quantity] = by_name[quantity], half_by_name[quantity]
    if not values:
        raise InputError("header", lines[0], "needs a result, such as torque or F12_x and F12_y", str(path))
    return Table(by_name["theta_2"], values, rounding, places, _rounded(half_by_name["theta_2"], columns))


def _rounded(halves: Array, columns: list[tuple[str, float]]) -> Array:
    """Half a unit of each theta_2; of a cell whose zeros were left off, that of the column."""
    unit = dict(columns)["theta_2"]
    least = halves.min()
    if least > 0.5 * unit * 10.0**-DECIMALS * (1.0 + EPS):
        return np.zeros_like(halves)
    return np.where(halves <= 0.5 * unit * 10.0 ** (1 - DECIMALS) * (1.0 + EPS), halves, least)


def _lines(path: Path) -> list[tuple[int, list[str]]]:
    """The lines that hold anything, with their numbers."""
    text = read_text(path, "table", LARGEST_FILE)
    try:
        reader = csv.reader(io.StringIO(text, newline=""))
        return [(reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
    except csv.Error:
        raise InputError("table", path.name, "must be a CSV file", str(path)) from None


def _column(path: Path, heading: str) -> tuple[str, float]:
    """The quantity of a column and the factor that brings it to SI."""
    name, _, rest = heading.strip().partition("[")
    name, unit = name.strip(), rest.rstrip("] ").strip()
    quantity = name[:-2] if name[-2:] in ("_x", "_y") and name[:-2] in VECTORS else name
    if quantity in NOT_JUDGED:
        raise InputError("header", heading, f"is not judged: {NOT_JUDGED[quantity]}; leave this column out", str(path))
    if quantity not in UNITS or (quantity in VECTORS and quantity == name):
        known = ", ".join(f"{q}_x, {q}_y" if q in VECTORS else q for q in UNITS if q not in NOT_JUDGED)
        raise InputError("header", heading, f"is not a known column; known are {known}", str(path))
    if not unit:
        return name, 1.0
    from fourbar.files.units import factor_to

    try:
        return name, factor_to(UNITS[quantity], unit)
    except InputError as error:
        raise InputError("header", heading, error.allowed, str(path)) from None


def _number(path: Path, line: int, cell: str) -> tuple[float, float]:
    """The number in a cell and half a unit of its last printed digit."""
    text = cell.strip()
    try:
        exact = Decimal(text)
    except InvalidOperation:
        raise InputError(f"line {line}", cell, "must be a number", str(path)) from None
    if not exact.is_finite():
        raise InputError(f"line {line}", cell, "must be a finite number", str(path))
    exponent = exact.as_tuple().exponent
    assert isinstance(exponent, int)
    value = float(exact)
    if not math.isfinite(value):
        raise InputError(f"line {line}", cell, "is larger than a double can hold", str(path))
    return value, 0.5 * 10.0**exponent
