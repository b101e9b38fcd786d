"""Reading a table of somebody's results.

Columns are named as `fourbar analyze --csv` names them, with units in brackets.

    theta_2 [deg], torque [N cm], F12_x, F12_y, F43 [kN]

A vector under its own name is its magnitude; one of its components may stand alone.
Units may also stand in a line of their own under the names; without a unit a column is
SI (rad). Columns are parted by commas, by tabs, or by a spreadsheet's semicolons, with
which a number may have a decimal comma. A blank cell states nothing, and a column that
is no answer is left out by name. How many digits were printed decides how much rounding
is theirs: half a unit of the last printed digit is always allowed, and what half a unit
of a rounded angle changes.
"""

import csv
import math
import re
from collections.abc import Collection
from contextlib import nullcontext, suppress
from dataclasses import dataclass, replace
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import NamedTuple
from unicodedata import normalize

import numpy as np

from fourbar.errors import InputError
from fourbar.linkage import MOVING_BARS, record
from fourbar.quantities import COUPLE, LINE, UNITS, VECTORS, Array, find_derived
from fourbar.solution import find_unit_of_quantity
from fourbar.writing import read_text
from fourbar_validation.compare.tolerance import EPS

_DECIMALS = 4
"""Decimals of a position that somebody chose, like 12.5 deg or 0.25 rad. 0.1745 rad is
one that was rounded.
"""
NOT_JUDGED = {
    "time": "a row is found by its angle",
    **dict.fromkeys(
        (COUPLE.error, LINE.error, "force_error", "friction_residual"),
        "an error of the formulas themselves",
    ),
    **dict.fromkeys(("status", "branch", "drive_bar"), "stated by the scene"),
    **dict.fromkeys(
        ("omega_3/omega_2", "omega_4/omega_2", "mechanical_advantage", "I13", "I24"),
        "follows from the angles, which are judged",  # and grows without bound
    ),
}
"""Columns of `fourbar analyze --csv` that are no answer, and why."""
_PLACES = ("theta_2", "theta_4", "theta_3")
"""Angles by which a row may be found where the commanded one has no column."""
_OF_TORQUE = (
    "t2",
    "t3",
    "t4",
    "moment",
    "drehmoment",
    "antriebsmoment",
    "motortorque",
    "inputtorque",
    "cranktorque",
    "drivetorque",
    "drivingtorque",
)
_OTHER_NAMES = {
    **dict.fromkeys(_OF_TORQUE, "torque"),
    "kurbelwinkel": "theta_2",
    "crankangle": "theta_2",
    "abtriebswinkel": "theta_4",
    "outputangle": "theta_4",
    "koppelwinkel": "theta_3",
    "couplerangle": "theta_3",
    "zeit": "time",
    **{f"{name.lower()}{axis}": f"{name}_{axis}" for name in VECTORS for axis in "xy"},
    **{name.lower().replace("_", ""): name for name in (*NOT_JUDGED, *UNITS)},
}
"""Names that other programs and languages use, or other spellings, in small letters,
without spaces and underscores.
"""
_BY_UNIT = {
    "t": {"time": "s", "torque": "N m"},
    "m": {"torque": "N m"},
    **{f"w{bar}": {f"omega_{bar}": "rad/s"} for bar in MOVING_BARS},
    "t12": {"torque": "N m"},
}
"""Letters, spelled as in _OTHER_NAMES, and what they mean by the unit beside them."""
_REACTIONS = {"F21": "F12", "F23": "F32", "F34": "F43", "F41": "F14"}
"""Pin forces on the other bar, and those that they are the opposite of."""
_KNOWN = "known are the columns of fourbar analyze SCENE --csv, such as theta_2 [deg]"
_KNOWN += ", torque (drive_force of a cylinder), F12_x, F12_y, or F12 (its magnitude)"
OTHER_UNITS = {
    "rad": ("rad", "deg"),
    "rad/s": ("rad/s", "deg/s", "rpm", "rev/s"),
    "rad/s^2": ("rad/s^2", "deg/s^2", "rpm/s"),
    "m": ("m", "mm", "cm", "in", "ft"),
    "m/s": ("m/s", "mm/s", "cm/s", "in/s", "ft/s"),
    "m/s^2": ("m/s^2", "mm/s^2", "cm/s^2", "in/s^2", "ft/s^2", "g0"),
    "N": ("N", "kN", "mN", "lbf", "kgf"),
    "N m": (
        "N m",
        "N mm",
        "N cm",
        "kN m",
        "mN m",
        "lbf ft",
        "lbf in",
        "kgf m",
        "kgf cm",
        "kgf mm",
    ),
}
"""Units that may be taken for each SI unit. The SI unit is one if the file announced
another unit.
"""
_THOUSANDS = re.compile(r"[-+]?\d{1,3}(?:[ ,'\u2019\u00a0\u202f]\d{3})+(?:\.\d+)?")
_HEADING = re.compile(
    r"\|?(?P<name>\w[\w /]*?)\|?\s*"
    r"(?:\[(?P<square>[^\]]*)\]|\((?P<round>.*)\)|/ (?P<slash>.*))?"
    r"(?P<letter>_[xy])?"
)
"""Heading of a column: a name, its unit in brackets or after a slash, and a component.
The name may stand between bars.
"""
_TWO_TURNS = 4.0 * math.pi
"""Angles beyond this many rad, all of them multiples of half a one, are degrees."""
_MOST_DEGREES = 1e6
"""Beyond this no angle is meant."""
_ROUNDED_HALVES = 1e-9
"""Distance of a doubled angle from a whole number that its reading may leave."""
LARGEST_TABLE_FILE = 64 * 2**20
"""Bytes; a table larger than this is not a hand-made comparison."""


@record
class Unit:
    """Unit of the numbers of a column."""

    text: str
    factor: float
    """Factor to SI."""


class TheirColumn(NamedTuple):
    """One column of somebody's numbers, or the two of a vector, in SI units.

    What the table does not state is NaN.
    """

    values: Array
    """(n,), or (n, 2) of a vector."""
    rounding: Array
    """Half a unit of the last digit printed, (n,)."""
    filled: Array
    """The same if the zeros at the ends of numbers were left off, (n,)."""
    unit: Unit


@dataclass(frozen=True, slots=True, eq=False)
class TheirTable:
    """Somebody's numbers: the angle by which each row is found, and columns by key.

    A key is a quantity, or |name| of the magnitudes of a vector.
    """

    place: TheirColumn
    columns: dict[str, TheirColumn]
    lines: list[int]
    """The line of the file that each row stands in."""
    left_out: dict[str, str]
    """Headings of columns that are not judged, and why."""
    notes: tuple[str, ...] = ()
    """Sentences on how the table was read where it does not say so itself."""
    found_by: str = "theta_2"
    """Name of the angle by which rows are found."""
    times: TheirColumn | None = None
    """Time of each row; None if it is not known of all."""
    is_rounded: bool = False
    """True to take no place, speed or acceleration for one that somebody chose."""

    def find_half(self, column: TheirColumn) -> Array:
        """Find half a unit of the last digit of each place or rate of a row.

        A column without _DECIMALS has 0: somebody chose its numbers.
        """
        halves = column.rounding
        unit = 0.5 * column.unit.factor * (1.0 + EPS)
        chosen = halves.min() > unit * 10.0**-_DECIMALS
        if self.is_rounded:
            return halves
        if chosen:
            return np.zeros_like(halves)
        # a cell whose zeros were left off has the digits of the column
        return np.where(halves <= unit * 10.0 ** (1 - _DECIMALS), halves, halves.min())

    @property
    def places(self) -> Array:
        """Return the angle of each row, rad, (n,)."""
        return self.place.values

    def from_pin(self, origin: tuple[float, float]) -> "TheirTable":
        """Return the table with its places from O2.

        O2 stands at `origin` in a drawing's coordinates.
        """
        drawn = {
            key: column._replace(values=column.values - origin)
            for key, column in self.columns.items()
            if column.values.ndim == 2 and find_unit_of_quantity(key) == "m"
        }
        if not drawn or not any(origin):
            return self
        x, y = origin
        note = (
            f"places are those of the drawing; shown from O2, at ({x:.6g}, {y:.6g}) m"
        )
        return replace(self, columns=self.columns | drawn, notes=(*self.notes, note))


def read_table(
    path: Path, commanded: str = "theta_2", points: Collection[str] = ()
) -> TheirTable:
    """Read a CSV table; InputError names the column or line that cannot be read.

    `commanded`: name of the angle that the scene commands. Rows are found by it, or by
    another bar's angle where the table does not have it, or else by their time.

    `points`: names of places, velocities and accelerations of the scene's points.
    """
    text = read_text(path, "table", LARGEST_TABLE_FILE)
    try:
        return _read_columns(*_read_lines(text, path.name), commanded, points)
    except InputError as error:
        raise error.in_file(str(path)) from None


def _read_columns(
    headings: list[str],
    unit_line: list[str],
    rows: list[tuple[int, list[str]]],
    commanded: str,
    points: Collection[str],
) -> TheirTable:
    """Read the columns of the rows of a table, each a line number and its cells."""
    found, left_out = _find_columns(headings, unit_line, commanded, points)
    names = (commanded, *_PLACES, "time")
    found_by = next(filter(found.__contains__, names), "")
    if not found_by:
        raise InputError(
            "header",
            headings,
            f"needs a column {commanded} (say {commanded} [deg] for degrees), the angle"
            f" of another bar, or the time; {_KNOWN}",
        )
    count = len(headings)
    for line, cells in rows:
        more = cells[count:]
        if len(cells) < count or "".join(more).strip():
            allowed = f"needs {count} cells"
            if more:
                allowed += "; with decimal commas, semicolons between them"
            raise InputError(f"line {line}", cells, allowed)
    numbers = {}
    for name, (index, unit) in found.items():
        with suppress(InputError) if name == "time" != found_by else nullcontext():
            numbers[name] = _read_numbers(name, headings[index], unit, index, rows)
    place = numbers[found_by]
    times = numbers.pop("time", None)
    numbers.pop(found_by, None)
    missing = np.isnan(place.values)
    if missing.any():
        line, cells = rows[int(np.argmax(missing))]
        raise InputError(f"line {line}", cells, f"needs a {found_by}")
    if times is not None and np.isnan(times.values).any():
        times = None
    notes: tuple[str, ...] = ()
    is_stated = re.search(r"[\[(]|/ ", headings[found[found_by][0]])
    if place.unit.text == "rad" and not is_stated and _are_degrees(place.values):
        largest = np.abs(place.values).max()
        text = (
            f"{found_by} has no unit and goes to {largest:g}: it is read as degrees;"
            f" write {found_by} [deg], or {found_by} [rad] if it is not"
        )
        notes = (text,)
        in_degrees = Unit("deg", math.pi / 180.0)
        place = _make_column(place.values, place.rounding, in_degrees)
    columns: dict[str, TheirColumn] = {}
    blank = {}
    for name, column in numbers.items():
        if np.isnan(column.values).all():
            blank[headings[found[name][0]]] = "blank"
        else:
            _enter_column(columns, name, column)
    if not columns:
        wanted = " in place of blank cells" * bool(blank)
        raise InputError("header", headings, f"needs a result{wanted}; {_KNOWN}")
    lines = [line for line, _ in rows]
    return TheirTable(place, columns, lines, left_out | blank, notes, found_by, times)


def _find_columns(
    headings: list[str],
    unit_line: list[str],
    commanded: str,
    points: Collection[str],
) -> tuple[dict[str, tuple[int, Unit]], dict[str, str]]:
    """Return place and unit of the columns that are read, and why others are not."""
    left_out: dict[str, str] = {}
    found: dict[str, tuple[int, Unit]] = {}
    repeated: dict[str, str] = {}
    for index, heading in enumerate(headings):
        stated = "".join(unit_line[index : index + 1]).strip(" []()")
        name, unit, why = _read_heading(heading, stated, commanded, points)
        if not name and index == len(headings) - 1:
            continue  # an empty cell that a spreadsheet leaves at the end of a line
        if why:
            left_out[heading.strip() or f"column {index + 1}"] = why
        if unit is None:
            continue
        if name in found:
            both = f"columns {found[name][0] + 1} and {index + 1} are both {name}"
            repeated.setdefault(name, f"{both}: rename or remove one")
            continue
        found[name] = index, unit
    if found.keys() & {commanded, *_PLACES}:
        repeated.pop("time", None)  # beside an angle the first is read
    for why in repeated.values():
        raise InputError("header", headings, why)
    return found, left_out


def _read_numbers(
    name: str,
    heading: str,
    unit: Unit,
    index: int,
    rows: list[tuple[int, list[str]]],
) -> TheirColumn:
    """Read the cells of a column, at a place in each row."""
    numbers = np.empty((len(rows), 2))
    for row, (line, cells) in enumerate(rows):
        try:
            numbers[row] = _read_cell(cells[index])
        except InputError as error:
            place = f"line {line}, {heading.strip()}"
            raise error.moved_to(place, None) from None
    values, half = numbers.T
    if name.endswith(("_x", "_y")) and heading.strip()[:3] in _REACTIONS:
        values = -values
    column = _make_column(values, np.where(np.isnan(values), 0.0, half), unit)
    return column._replace(unit=Unit("s", 1.0)) if name == "time" else column


def _make_column(values: Array, half: Array, unit: Unit) -> TheirColumn:
    """Return a column of numbers in a unit, and half a unit of their last digits."""
    factor = unit.factor
    filled = factor * fill_zeros(values, half)
    return TheirColumn(values * factor, half * factor, filled, unit)


def _are_degrees(angles: Array) -> bool:
    """Return whether angles without a unit can be nothing but degrees.

    Degrees go beyond two turns in rad, and are multiples of half a degree.
    """
    largest = np.abs(angles).max()
    halves = 2.0 * angles
    missed = np.abs(halves - np.round(halves)).max()
    return bool(_TWO_TURNS < largest < _MOST_DEGREES and missed <= _ROUNDED_HALVES)


def _enter_column(
    columns: dict[str, TheirColumn], name: str, column: TheirColumn
) -> None:
    """Enter a column of a table, a component into its vector."""
    vector, _, axis = name.rpartition("_")
    if axis not in ("x", "y"):
        columns[name] = column
        return
    n = len(column.values)
    none = TheirColumn(np.full((n, 2), np.nan), np.zeros(n), np.zeros(n), column.unit)
    entered = columns.get(vector, none)
    entered.values[:, "xy".index(axis)] = column.values
    columns[vector] = entered._replace(
        rounding=np.hypot(entered.rounding, column.rounding),
        filled=np.hypot(entered.filled, column.filled),
    )


def fill_zeros(numbers: Array, halves: Array) -> Array:
    """Return the rounding of numbers with as many digits as others of their column.

    Others are those that are not smaller by a decade.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        decades = np.floor(np.log10(np.abs(numbers)))
    order = np.argsort(-decades, kind="stable")
    stated = np.where(np.isnan(numbers), np.inf, halves)
    least = np.minimum.accumulate(stated[order])
    last = np.searchsorted(-decades[order], -decades, side="right") - 1
    return np.where(np.isnan(numbers), 0.0, least[last])


def _read_lines(
    text: str, name: str
) -> tuple[list[str], list[str], list[tuple[int, list[str]]]]:
    """Read the headings, the units under them, and rows with their line numbers."""
    lines = _blank_titles(text.splitlines())
    header = next(filter(str.strip, lines), "")
    delimiter = next((mark for mark in ";\t" if mark in header), ",")
    reader = csv.reader((f"{line}\n" for line in lines), delimiter=delimiter)
    try:
        numbered = [(reader.line_num, row) for row in reader if "".join(row).strip()]
    except csv.Error:
        raise InputError("table", name, "must be a CSV file") from None
    numbered = numbered[_find_header([cells for _, cells in numbered]) :]
    if delimiter != ",":  # there a comma is a decimal comma
        numbered[1:] = [
            (line, [_read_comma(cell) for cell in cells])
            for line, cells in numbered[1:]
        ]
    units: list[str] = []
    if len(numbered) > 1 and _is_unit_line(numbered[1][1]):
        units = numbered.pop(1)[1]
    if len(numbered) < 2:
        raise InputError("table", name, "needs a header and at least one row")
    return numbered[0][1], units, numbered[1:]


def _find_header(rows: list[list[str]]) -> int:
    """Find the last row of text before the numbers, or the one above it if of units."""
    numbers = [sum(map(_is_number, cells)) for cells in rows]
    filled = [sum(map(bool, map(str.strip, cells))) for cells in rows]
    first = next((i for i in range(len(rows)) if 2 * numbers[i] > filled[i]), 0)
    header = max((i for i in range(first) if not numbers[i]), default=0)
    if header == 0 or len(rows[header - 1]) != len(rows[header]):
        return header
    names = {_spell(re.split(r"[\[(/]", cell)[0]) for cell in rows[header]}
    of_units = _is_unit_line(rows[header]) and not names & {*_OTHER_NAMES}
    return header - of_units


def _is_unit_line(cells: list[str]) -> bool:
    """Return whether a line under the header states units: no cell has a number."""
    return not any(re.search(r"(?<![A-Za-z^*])(?<!\^-)[0-9]", one) for one in cells)


def _is_number(cell: str) -> bool:
    with suppress(InputError):
        return not math.isnan(_read_cell(_read_comma(cell))[0])
    return False


def _blank_titles(lines: list[str]) -> list[str]:
    """Blank the comments, and lines of one cell above the first line of several.

    The last comment before the numbers may be the header. A heading in quotes may go on
    in the next line.
    """
    plain = ["" if re.match(r"\s*(#|%|//)", line) else line for line in lines]
    first = next((i for i, line in enumerate(plain) if line.strip()), 0)
    words = re.sub(r"\d[eE][-+]?\d", "", "".join(plain[first : first + 1]))
    if first and not re.search(r"[^\W\d_]", words):
        plain[first - 1] = lines[first - 1].lstrip().lstrip("#%/ ")
    for i, line in enumerate(plain):
        # what is quoted is in one cell; a quote that is left over is not closed here
        cells = re.split("[,;\t]", re.sub('"[^"]*"', "x", line))
        if '"' in cells[-1] or len([*filter(str.strip, cells)]) > 1:
            return [""] * i + plain[i:]
    return plain


def _read_comma(cell: str) -> str:
    """Read a decimal comma, with points between thousands, as a decimal point."""
    text = cell.strip()
    if re.fullmatch(r"[-+]?\d{1,3}(?:\.\d{3})+,\d+", text):
        text = text.replace(".", "")
    return text.replace(",", ".")


def _find_quantity(name: str, points: Collection[str]) -> tuple[str, bool]:
    """Return the quantity of a column by its name, and whether it is a vector.

    The name may be that of a component. Without such a quantity it is "".
    """
    vector = re.sub("_[xy]$", "", name)
    derived = find_derived(vector)
    is_derived = derived is not None and derived.kind == "vector"
    if is_derived or vector in points or vector in VECTORS:
        return vector, True
    is_known = name in UNITS or name in NOT_JUDGED or find_derived(name) is not None
    return name if is_known else "", False


def _spell(name: str) -> str:
    """Spell a name in small letters, without spaces, hyphens and underscores."""
    plain = normalize("NFKC", name)  # of a digit below the line
    plain = plain.replace("θ", "theta").replace("ω", "omega").replace("α", "alpha")
    return re.sub(r"[\s_-]", "", plain.lower())


def _read_heading(
    heading: str,
    unit: str,
    commanded: str,
    points: Collection[str],
) -> tuple[str, Unit | None, str]:
    """Find what a heading means, in any letters; `unit`: stated in another line.

    Returned are the quantity, or the component of one, |name| for the magnitudes of a
    vector; the unit of its numbers, None if they are not read; and the reason for which
    it is not judged.
    """
    from fourbar.quantities.units import converts

    plain = heading.strip()
    match = _HEADING.fullmatch(plain)
    if match:
        stated = match["square"] or match["round"] or match["slash"]
        unit = (stated or unit).strip()
        plain = match["name"] + (match["letter"] or "")
    name = _REACTIONS.get(plain[:3], plain[:3]) + plain[3:]
    if not _find_quantity(name, points)[0]:
        angles = ("angle", "winkel", "antriebswinkel", "inputangle")
        others = _OTHER_NAMES | dict.fromkeys(angles, commanded)
        name = others.get(_spell(name), name)
    for meaning, its_unit in _BY_UNIT.get(_spell(plain), {}).items():
        if converts(unit, its_unit):
            name = meaning
            break
    quantity, is_vector = _find_quantity(name, points)
    if quantity in NOT_JUDGED:
        known = None
        if quantity == "time":
            with suppress(InputError):
                known = _read_unit(heading, quantity, unit)
        return name, known, NOT_JUDGED[quantity]
    not_known = f"not a known column: {_KNOWN}"
    if match is None or not quantity:
        return name, None, not_known
    key = f"|{name}|" if is_vector and name == quantity else name
    try:
        return key, _read_unit(heading, quantity, unit), ""
    except InputError:
        if match["slash"] is None:
            raise
        return name, None, not_known  # a ratio


def _read_unit(heading: str, quantity: str, text: str) -> Unit:
    unit = "s" if quantity == "time" else find_unit_of_quantity(quantity)
    if not text or text == unit:
        return Unit(unit, 1.0)
    from fourbar.quantities.units import find_factor

    try:
        return Unit(text, find_factor(unit, text))
    except InputError as error:
        for usual in OTHER_UNITS.get(unit, ()):
            if _spell(usual) == _spell(text):
                return Unit(text, find_factor(unit, usual))
        allowed = f"{text}: {error.allowed}"
        raise InputError("header", heading, allowed) from None


def _read_cell(cell: str) -> tuple[float, float]:
    """Return the number in a cell, and half a unit of its last printed digit.

    Both are NaN for a blank.
    """
    text = cell.strip().replace("\N{MINUS SIGN}", "-")
    if not text:
        return math.nan, math.nan
    try:
        if _THOUSANDS.fullmatch(text):
            text = re.sub(r"[ ,'\u2019\u00a0\u202f]", "", text)
        exact = Decimal(text)
    except InvalidOperation:
        raise InputError("cell", cell, "must be a number") from None
    if not exact.is_finite():
        raise InputError("cell", cell, "must be a finite number")
    exponent = exact.as_tuple().exponent
    assert isinstance(exponent, int)
    value = float(exact)
    if not math.isfinite(value):
        raise InputError("cell", cell, "is larger than a double can hold")
    return value, 0.5 * 10.0**exponent
