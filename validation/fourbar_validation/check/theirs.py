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
import io
import math
import re
from collections.abc import Collection
from contextlib import suppress
from dataclasses import dataclass, replace
from decimal import Decimal, InvalidOperation
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fourbar.errors import InputError
from fourbar.quantities import COUPLE, LINE, UNITS, VECTORS, Array, find_derived
from fourbar.scene.motion import Law, Rise, Sine
from fourbar.solution import find_unit_of_quantity
from fourbar.writing import read_text
from fourbar_validation.check.csv_columns import GROWING
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
    **GROWING,
}
"""Columns of `fourbar analyze --csv` that are no answer, and why."""
_BLANK = "blank"
_COMMENT = ("#", "%", "//")
"""Beginnings of a line that is a comment."""
_COMMANDED_ANGLE = ("angle", "winkel", "antriebswinkel", "inputangle")
"""Names of the angle that a scene commands, spelled as in _OTHER_NAMES."""
_PLACES = ("theta_2", "theta_4", "theta_3")
"""Angles by which a row may be found where the commanded one has no column."""
_OTHER_NAMES = {
    **dict.fromkeys(("t2", "t3", "t4", "moment", "drehmoment"), "torque"),
    **dict.fromkeys(
        ("antriebsmoment", "motortorque", "inputtorque", "cranktorque"), "torque"
    ),
    **dict.fromkeys(("drivetorque", "drivingtorque"), "torque"),
    **dict.fromkeys(("kurbelwinkel", "crankangle"), "theta_2"),
    **dict.fromkeys(("abtriebswinkel", "outputangle"), "theta_4"),
    **dict.fromkeys(("koppelwinkel", "couplerangle"), "theta_3"),
    "zeit": "time",
}
"""Names that other programs and languages use, in small letters, without spaces and
underscores.
"""
_BY_UNIT = {"t": {"time": "s", "torque": "N m"}, "m": {"torque": "N m"}}
"""Letters, spelled as in _OTHER_NAMES, and what they mean by the unit beside them."""
_REACTIONS = {"F21": "F12", "F23": "F32", "F34": "F43", "F41": "F14"}
"""Pin forces on the other bar, and those that they are the opposite of."""
_MAY_MEAN = (
    ("theta", "theta_2"),
    ("omega", "omega_2"),
    ("alpha", "alpha_2"),
    (r"(?:r|fr|force|kraft|reaction)([1-4])([1-4])[xy]?", r"F\1\2_x or F\1\2_y"),
    (r"[tm](?:_?in)?|.*(?:torque|moment).*", "torque"),
    (
        r"f[xy]?(?:at)?(?:a|b|o2|o4)?|.*(?:force|kraft|reaction).*",
        "F12_x, F32_x, F43_x, F14_x, or their y",
    ),
    (r".*(?:speed|velocity|geschwindigkeit).*", "omega_2, omega_3 or omega_4"),
    (r".*(?:acceleration|beschleunigung).*", "alpha_2, alpha_3 or alpha_4"),
    (r".*(?:angle|winkel|theta|phi).*", "theta_2, theta_3 or theta_4"),
)
"""Patterns of names, spelled as in _OTHER_NAMES, and what they may mean."""
OTHER_UNITS = {
    "rad": ("rad", "deg"),
    "rad/s": ("rad/s", "deg/s", "rpm", "rev/s"),
    "rad/s^2": ("rad/s^2", "deg/s^2", "rpm/s"),
    "m": ("m", "mm", "cm", "in", "ft"),
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
_GERMAN_THOUSANDS = re.compile(r"[-+]?\d{1,3}(?:\.\d{3})+,\d+")
_TWO_TURNS = 4.0 * math.pi
"""Angles beyond this many rad, all of them multiples of half a one, are degrees."""
_MOST_DEGREES = 1e6
"""Beyond this no angle is meant."""
LARGEST_TABLE_FILE = 64 * 2**20
"""Bytes; a table larger than this is not a hand-made comparison."""
_HEADING = re.compile(
    r"\|?(?P<name>\w[\w /]*?)\|?\s*"
    r"(?:\[(?P<square>[^\]]*)\]|\((?P<round>.*)\))?"
    r"(?P<letter>_[xy])?"
)
"""Heading of a column: a name, its unit in brackets, and a component. The name may
stand between bars.
"""


@dataclass(frozen=True, slots=True)
class Unit:
    """Unit of the numbers of a column."""

    text: str
    factor: float
    """Factor to SI."""


@dataclass(frozen=True, slots=True, eq=False)
class TheirTable:
    """Somebody's numbers in SI units: an angle (n,) and values by quantity.

    Values are (n,) or (n, 2) and have their rounding. Of a vector (n,) are its
    magnitudes, under |name|. What the table does not state is NaN.
    """

    places: Array
    """Angle by which each row is found, rad, (n,)."""
    values: dict[str, Array]
    rounding: dict[str, Array]
    """Half a unit of the last digit printed, in SI, (n,); of the angle too."""
    units: dict[str, Unit]
    lines: list[int]
    """The line of the file that each row stands in."""
    filled: dict[str, Array]
    """Rounding of values if the zeros at their ends were left off."""
    places_rounding: Array
    """Rounding of the angle, rad, (n,): half a unit of its last digit if the column is
    printed with _DECIMALS, else 0: somebody chose it.
    """
    left_out: dict[str, str]
    """Headings of columns that are not judged, and why."""
    notes: tuple[str, ...] = ()
    """Sentences on how the table was read where it does not say so itself."""
    found_by: str = "theta_2"
    """Name of the angle by which rows are found."""
    times: Array | None = None
    """Time of each row and half a unit of its last digit, s, (n, 2)."""

    def label(self, key: str) -> str:
        """Name the quantity, or the one component of it that the table has."""
        values = self.values[key]
        letters = [
            letter
            for letter, gone in zip("xy", np.isnan(values).T, strict=False)
            if not gone.all()
        ]
        if values.ndim == 2 and len(letters) == 1:
            return f"{key}_{letters[0]}"
        return key

    def stated(self, key: str) -> NDArray[np.bool_]:
        """Mark the rows in which a quantity has any number, (n,)."""
        finite = np.isfinite(self.values[key])
        return np.asarray(finite.any(axis=1) if finite.ndim == 2 else finite)

    def part(self, rows: slice) -> "TheirTable":
        """Return some of the rows."""
        return replace(
            self,
            places=self.places[rows],
            values={key: value[rows] for key, value in self.values.items()},
            rounding={key: value[rows] for key, value in self.rounding.items()},
            filled={key: value[rows] for key, value in self.filled.items()},
            lines=self.lines[rows],
            places_rounding=self.places_rounding[rows],
            times=None if self.times is None else self.times[rows],
        )

    def from_pin(self, origin: tuple[float, float]) -> "TheirTable":
        """Return the table with its places from O2.

        O2 stands at `origin` in a drawing's coordinates.
        """
        if not any(origin):
            return self
        drawn = {
            key
            for key, value in self.values.items()
            if value.ndim == 2 and find_unit_of_quantity(key) == "m"
        }
        if not drawn:
            return self
        values = {
            key: value - origin if key in drawn else value
            for key, value in self.values.items()
        }
        x, y = origin
        note = (
            f"places are those of the drawing; shown from O2, at ({x:.6g}, {y:.6g}) m"
        )
        return replace(self, values=values, notes=(*self.notes, note))


def name_quantity(key: str) -> str:
    """Name the quantity of a key of `TheirTable.values`."""
    return key.strip("|")


def read_table(
    path: Path,
    commanded: str = "theta_2",
    points: Collection[str] = (),
    law: Law | Rise | Sine | None = None,
) -> TheirTable:
    """Read a CSV table; InputError names the column or line that cannot be read.

    `commanded`: name of the angle that the scene commands. Rows are found by it, or by
    another bar's angle where the table does not have it. Without an angle they are
    found by their time along the scene's law.

    `points`: names of places, velocities and accelerations of the scene's points.
    """
    lines_of_file = _read_lines(path)
    unit_line: list[str] = []
    if len(lines_of_file) > 1 and _is_unit_line(lines_of_file[1][1]):
        unit_line = lines_of_file.pop(1)[1]
    if len(lines_of_file) < 2:
        allowed = "needs a header and at least one row"
        raise InputError("table", path.name, allowed, str(path))
    (_, headings), *rows = lines_of_file
    columns, left_out, renamings = _read_headings(
        path, headings, unit_line, commanded, points
    )
    times = _read_times(columns, rows)
    _drop_repeated(path, columns, left_out, headings, rows)
    names = [name for name, _ in columns.values()]
    numbers = {name: np.empty(len(rows)) for name in names}
    halves = {name: np.empty(len(rows)) for name in names}
    units = {name: unit for name, unit in columns.values()}
    found_by = next((name for name in (commanded, *_PLACES) if name in names), None)
    if found_by is None and law is not None and times is not None:
        found_by, units[commanded] = commanded, Unit("rad", 1.0)
        lines_of_rows = [line for line, _ in rows]
        numbers[commanded], halves[commanded] = _follow(law, times, lines_of_rows, path)
        left_out = {
            name: why for name, why in left_out.items() if why != NOT_JUDGED["time"]
        }
    if found_by is None:
        raise InputError(
            "header",
            headings,
            f"needs a column {commanded} (say {commanded} [deg] for degrees), or the"
            " angle of another bar" + _list_renamings(renamings),
            str(path),
        )
    for row, (line, cells) in enumerate(rows):
        _require_cells(path, headings, line, cells)
        for index, (name, unit) in columns.items():
            is_component = name.endswith(("_x", "_y"))
            is_reaction = headings[index].strip()[:3] in _REACTIONS
            sign = -1.0 if is_component and is_reaction else 1.0
            try:
                value, half = _read_cell(cells[index])
            except InputError as error:
                place = f"line {line}, {headings[index].strip()}"
                raise InputError(
                    place,
                    cells[index],
                    error.allowed,
                    str(path),
                ) from None
            numbers[name][row], halves[name][row] = (
                sign * value * unit.factor,
                half * unit.factor,
            )
        if math.isnan(numbers[found_by][row]):
            raise InputError(
                f"line {line}",
                cells,
                f"needs a {found_by}",
                str(path),
            )
    notes = _read_degrees(found_by, numbers, halves, units, headings, columns)
    blank = {
        headings[index]: _BLANK
        for index, (name, _) in columns.items()
        if np.isnan(numbers[name]).all()
    }
    lines = [line for line, _ in rows]
    table = TheirTable(
        numbers[found_by],
        {},
        {found_by: halves[found_by]},
        {found_by: units[found_by]},
        lines,
        {},
        _find_rounding(halves[found_by], units[found_by]),
        left_out | blank,
        notes,
        found_by,
        times,
    )
    for name in names:
        if name != found_by and not np.isnan(numbers[name]).all():
            _enter_column(table, name, units[name], numbers[name], halves[name])
    if not table.values:
        example = "such as torque, F12_x and F12_y, or F12 (its magnitude)"
        stated = " in place of blank cells" * bool(blank)
        raise InputError(
            "header",
            headings,
            f"needs a result{stated}, {example}{_list_renamings(renamings)}; "
            "known are the columns of fourbar analyze SCENE --csv",
            str(path),
        )
    return table


def _read_times(
    columns: dict[int, tuple[str, Unit]],
    rows: list[tuple[int, list[str]]],
) -> Array | None:
    """Take the times out of the columns; None if they are not all numbers."""
    of_time = [index for index, (name, _) in columns.items() if name == "time"]
    units = [columns.pop(index)[1] for index in of_time]
    with suppress(InputError, IndexError):
        for index, unit in zip(of_time, units, strict=True):
            times = np.array([_read_cell(cells[index]) for _, cells in rows])
            return times * unit.factor if np.isfinite(times).all() else None
    return None


def _follow(
    law: Law | Rise | Sine,
    times: Array,
    lines: list[int],
    path: Path,
) -> tuple[Array, Array]:
    """Return the law's angle at each time, and what the rounding of the time moves it.

    Raises InputError for a time that the law does not have.
    """
    printed, half = times.T
    first, *_, last = law.time
    inside = np.clip(printed, first, last)
    beyond = np.abs(printed - inside) > half
    if beyond.any():
        row = int(np.argmax(beyond))
        wanted = f"the law lasts from {first:g} to {last:g} s"
        raise InputError(f"line {lines[row]}, time", printed[row], wanted, str(path))
    angle, speed, _ = law.at(inside)
    return angle, np.abs(speed) * _find_rounding(half, Unit("s", 1.0))


def _require_cells(
    path: Path,
    headings: list[str],
    line: int,
    cells: list[str],
) -> None:
    """Refuse a row that has not one cell for each heading; blank ones may follow."""
    if len(cells) < len(headings) or any(
        cell.strip() for cell in cells[len(headings) :]
    ):
        allowed = f"needs {len(headings)} cells"
        if len(cells) > len(headings):
            allowed += "; with decimal commas, semicolons between them"
        raise InputError(f"line {line}", cells, allowed, str(path))


def _list_renamings(renamings: dict[str, str]) -> str:
    """List the columns that are not known and what they may be renamed to."""
    return "".join(f"; {heading}: {what}" for heading, what in renamings.items())


def _drop_repeated(
    path: Path,
    columns: dict[int, tuple[str, Unit]],
    left_out: dict[str, str],
    headings: list[str],
    rows: list[tuple[int, list[str]]],
) -> None:
    """Leave out a column that repeats another one.

    Raises InputError if it says otherwise.
    """
    first: dict[str, int] = {}
    for index, (name, unit) in list(columns.items()):
        earlier = first.setdefault(name, index)
        if earlier == index:
            continue
        same = all(
            cells[index : index + 1] == cells[earlier : earlier + 1]
            for _, cells in rows
        )
        if not same or unit != columns[earlier][1]:
            allowed = (
                f"columns {earlier + 1} and {index + 1} are both {name}, with other "
                "numbers: rename or remove one"
            )
            raise InputError(
                "header",
                headings,
                allowed,
                str(path),
            )
        left_out[f"{headings[index].strip()} (column {index + 1})"] = (
            f"repeats column {earlier + 1}"
        )
        del columns[index]


def _read_degrees(
    name: str,
    numbers: dict[str, Array],
    halves: dict[str, Array],
    units: dict[str, Unit],
    headings: list[str],
    columns: dict[int, tuple[str, Unit]],
) -> tuple[str, ...]:
    """Read an angle without a unit as degrees if it can be nothing else."""
    values = numbers[name]
    stated = [headings[i] for i, (one, _) in columns.items() if one == name]
    bare = not re.search(r"[\[(]", "".join(stated)) and units[name].text == "rad"
    bare &= bool(stated)  # and not found by a time
    largest = float(np.abs(values).max())
    if not bare or not _TWO_TURNS < largest < _MOST_DEGREES:
        return ()
    if np.any(np.abs(2.0 * values - np.round(2.0 * values)) > 1e-9):
        text = f"{name} has no unit and is read in rad: write {name} [deg] if it is not"
        return (text,)
    factor = math.pi / 180.0
    numbers[name], halves[name] = values * factor, halves[name] * factor
    units[name] = Unit("deg", factor)
    return (
        (
            f"{name} has no unit and goes to {largest:g}: it is read as degrees; "
            f"write {name} [deg], or {name} [rad] if it is not"
        ),
    )


def _enter_column(
    table: TheirTable,
    name: str,
    unit: Unit,
    numbers: Array,
    halves: Array,
) -> None:
    """Enter a column into the table, a component into its vector."""
    halves = np.where(np.isnan(numbers), 0.0, halves)
    filled = fill_zeros(numbers / unit.factor, halves)
    if name[-2:] not in ("_x", "_y"):
        table.values[name], table.units[name] = numbers, unit
        table.rounding[name], table.filled[name] = halves, filled
        return
    vector = name[:-2]
    axis = "xy".index(name[-1])
    values = table.values.setdefault(vector, np.full((len(numbers), 2), np.nan))
    values[:, axis] = numbers
    for roundings, more in ((table.rounding, halves), (table.filled, filled)):
        roundings[vector] = np.hypot(roundings.get(vector, 0.0), more)
    table.units.setdefault(vector, unit)


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


def _find_rounding(halves: Array, unit: Unit) -> Array:
    """Find half a unit of the last digit of each place by which a row is found.

    For a cell whose zeros were left off it is that of the column.
    """
    least = halves.min()
    if least > 0.5 * unit.factor * 10.0**-_DECIMALS * (1.0 + EPS):
        return np.zeros_like(halves)
    return np.where(
        halves <= 0.5 * unit.factor * 10.0 ** (1 - _DECIMALS) * (1.0 + EPS),
        halves,
        least,
    )


def _read_lines(path: Path) -> list[tuple[int, list[str]]]:
    """Read the lines that hold anything, with their numbers."""
    text = read_text(path, "table", LARGEST_TABLE_FILE)
    text = _remove_comments(text)
    header = next((line for line in text.splitlines() if line.strip()), "")
    delimiter = next((mark for mark in ";\t" if mark in header), ",")
    try:
        reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter)
        numbered = [
            (reader.line_num, row)
            for row in reader
            if any(cell.strip() for cell in row)
        ]
    except csv.Error:
        raise InputError(
            "table",
            path.name,
            "must be a CSV file",
            str(path),
        ) from None
    if delimiter != ",":  # there a comma is a decimal comma
        numbered[1:] = [
            (line, [_read_comma(cell) for cell in cells])
            for line, cells in numbered[1:]
        ]
    return numbered


def _remove_comments(text: str) -> str:
    """Blank the lines that are comments.

    The last one before the numbers may be the header.
    """
    lines = text.splitlines()
    of_comment = [line.lstrip().startswith(_COMMENT) for line in lines]
    first = next(
        (i for i, line in enumerate(lines) if line.strip() and not of_comment[i]), 0
    )
    words = re.sub(r"\d[eE][-+]?\d", "", lines[first]) if lines else ""
    has_header = re.search(r"[^\W\d_]", words)
    for i, line in enumerate(lines):
        if not of_comment[i]:
            continue
        header = i == first - 1 and not has_header
        lines[i] = line.lstrip().lstrip("#%/ ") if header else ""
    return "\n".join(lines) + "\n"


def _read_comma(cell: str) -> str:
    """Read a decimal comma, with points between thousands, as a decimal point."""
    text = cell.strip()
    if _GERMAN_THOUSANDS.fullmatch(text):
        text = text.replace(".", "")
    return text.replace(",", ".")


def _is_vector(name: str) -> bool:
    """Return True for a vector of a solution, or a derived one."""
    derived = find_derived(name)
    return name in VECTORS or (derived is not None and derived.kind == "vector")


def _find_name(name: str, commanded: str, points: Collection[str]) -> str:
    """Find the quantity that a column's name means, in any letters."""
    if name in UNITS or name in NOT_JUDGED or find_derived(name) is not None:
        return name
    vector = name[:-2] if name[-2:] in ("_x", "_y") else name
    if vector in points or _is_vector(vector):
        return name
    plain = _spell(name)
    if plain in _COMMANDED_ANGLE:
        return commanded
    known = {**dict.fromkeys(NOT_JUDGED), **UNITS}
    spelled = {one.lower().replace("_", ""): one for one in known}
    for letter in "xy":
        spelled |= {f"{one.lower()}{letter}": f"{one}_{letter}" for one in VECTORS}
    return spelled.get(plain, _OTHER_NAMES.get(plain, name))


def _spell(name: str) -> str:
    """Spell a name in small letters, without spaces, hyphens and underscores."""
    plain = name.replace("θ", "theta").replace("ω", "omega").replace("α", "alpha")
    return re.sub(r"[\s_-]", "", plain.lower())


def _suggest_column(name: str) -> str:
    """Say what a column may be renamed to; an empty string where nothing is like it."""
    plain = _spell(name)
    for pattern, meaning in _MAY_MEAN:
        if match := re.fullmatch(pattern, plain):
            return f"rename it if it is {match.expand(meaning)}"
    return ""


def _is_unit_line(cells: list[str]) -> bool:
    """Return whether a line under the header states units.

    No cell of it contains a number.
    """
    return not any(
        re.search("[0-9]", re.sub(r"[\^*][0-9]|[²³]", "", cell)) for cell in cells
    )


def _read_headings(
    path: Path,
    headings: list[str],
    unit_line: list[str],
    commanded: str,
    points: Collection[str],
) -> tuple[dict[int, tuple[str, Unit]], dict[str, str], dict[str, str]]:
    """Return each column's name and unit by its place in a row.

    The headings left out are returned too. Of these each has a reason, and some that
    are not known what they may be renamed to.
    """
    columns: dict[int, tuple[str, Unit]] = {}
    left_out: dict[str, str] = {}
    renamings: dict[str, str] = {}
    from fourbar.quantities.units import converts

    for index, heading in enumerate(headings):
        match = _HEADING.fullmatch(heading.strip())
        text = "".join(unit_line[index : index + 1]).strip(" []()")
        if match:
            name = match["name"] + (match["letter"] or "")
            text = (match["square"] or match["round"] or text).strip()
        else:
            name = heading.strip()
        plain = name
        name = _REACTIONS.get(name[:3], name[:3]) + name[3:]
        name = _find_name(name, commanded, points)
        if _spell(plain) in _BY_UNIT:
            means = _BY_UNIT[_spell(plain)].items()
            name = next((one for one, unit in means if converts(text, unit)), name)
        vector = name[:-2] if name[-2:] in ("_x", "_y") else name
        of_vector = vector in points or _is_vector(vector)
        quantity = vector if of_vector else name
        if not name and index >= len(headings) - 1:
            continue  # an empty cell that a spreadsheet leaves at the end of a line
        known = quantity in UNITS or of_vector or find_derived(quantity) is not None
        if match is None or quantity in NOT_JUDGED or not known:
            column = heading.strip() or f"column {index + 1}"
            parts = re.split("[-/]", re.sub(r"\s*\[.*", "", heading.strip()))
            if len(parts) > 1 and all(
                part in UNITS or part in points for part in parts
            ):
                left_out[column] = "follows from columns that are judged"
                continue
            left_out[column] = NOT_JUDGED.get(quantity, "not a known column")
            if quantity == "time":
                with suppress(InputError):
                    unit = _read_unit(path, heading, quantity, text)
                    columns[index] = (name, unit)
            if quantity not in NOT_JUDGED and (renaming := _suggest_column(name)):
                left_out[column] += f": {renaming}"
                renamings[column] = renaming
            continue
        if name != plain and len(name) == 1 and text in OTHER_UNITS["rad"]:
            renamings[heading] = _suggest_column("angle")
            left_out[heading] = f"not a known column: {renamings[heading]}"
            continue
        columns[index] = (
            f"|{name}|" if of_vector and name == vector else name,
            _read_unit(path, heading, quantity, text),
        )
    return columns, left_out, renamings


def _read_unit(
    path: Path,
    heading: str,
    quantity: str,
    text: str,
) -> Unit:
    unit = "s" if quantity == "time" else find_unit_of_quantity(quantity)
    if not text or text == unit:
        return Unit(unit, 1.0)
    from fourbar.quantities.units import find_factor

    plain = {_spell(name): name for name in OTHER_UNITS.get(unit, ())}
    try:
        return Unit(text, find_factor(unit, text))
    except InputError as error:
        if (usual := plain.get(_spell(text))) is not None:
            return Unit(text, find_factor(unit, usual))
        raise InputError(
            "header",
            heading,
            f"{text}: {error.allowed}",
            str(path),
        ) from None


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
