"""Result of `solve`: one array per quantity, and `None` for what was not requested."""

import csv
import io
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from fourbar.errors import InputError, expect
from fourbar.formulas.mobility import TURN
from fourbar.linkage import POSITIVE, require
from fourbar.quantities import (
    COUPLE,
    LINE,
    LINE_QUANTITIES,
    NOT_ASSEMBLED,
    OF_POINTS,
    PIN_FORCES,
    STATUS_NAMES,
    STROKE,
    UNITS,
    Array,
    Codes,
    Mask,
    Quantities,
    Signs,
    find_quantity,
)
from fourbar.scene import Command, Scene, command, load_show
from fourbar.writing import (
    describe_extent,
    list_names,
    make_data_frame,
    write_object,
    write_text,
)

if TYPE_CHECKING:
    from pandas import DataFrame

    from fourbar.effects import ForceDrive

ANALYZE_SCHEMA = "fourbar-analyze/2"
Conversion = Mapping[str, tuple[str, float]]
"""Units to show: for an SI unit another unit and the factor to it. A unit that is left
out stays.
"""
SI: Conversion = {}
DEGREES: Conversion = {"rad": ("deg", 180.0 / math.pi)}
SHOWN_PARTS = (
    *(*COUPLE, *LINE, "theta_3", "theta_4"),
    *(f"|{name}|" for name in PIN_FORCES),
)
"""Main quantities, and sizes of the pin forces, that a notebook shows of a study."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Solution(Quantities):  # noqa: PLW1641 - arrays have no hash
    """The answer of the formulas at n positions, in SI units and radians.

    For a study it is at n positions of each of m linkages. Scalars have shape (n,),
    vectors (n, 2), of a study (m, n) and (m, n, 2); NaN marks a position where a
    quantity has no value (see `status`), None a quantity that was not requested.
    """

    at: Command
    """Positions that were solved, with what is commanded."""
    stated: Scene
    """Scene that was solved, or that of a study, whose numbers that vary are (m, 1)."""
    status_code: Codes
    """0 ok: every quantity that was requested is a number. 1 not_assembled: all but
    what is commanded is NaN. 2 singular (velocities are 0/0); of friction that depends
    on the pin forces: 3 jammed (no forces fulfil it: they are NaN; at rest, where it is
    the motion that would begin, torque_low or torque_high is), 4 several (more than one
    set does: those of the least friction); of springs, forces NaN: 5 no_direction (both
    ends in one point), 6 wound (turned beyond half a turn from rest). 7 no_torque: the
    two bars that are not driven are in line, no couple on the driven bar holds them in
    balance, forces are NaN (T3 and T4 have these poles where omega_3, omega_4 are 0). 8
    overflow: numbers beyond the range of doubles; from the first stage (position,
    velocity, ...) that meets them on everything is NaN. 9 invalid: a member of a study
    with numbers that a scene refuses (a length that is not positive, a mass below 0);
    all of it is NaN. 10 no_lever: the stroke of a linear drive stands still, or the
    point of a driving force moves across its direction; forces are NaN. 11
    change_point: all bars are in line; positions, speeds and the drive are their limits
    along the assembly, pin forces, which have no bound there, are NaN.
    """
    branch: Signs
    """Sign of sin(theta_4 - theta_3): +1 or -1."""
    points: dict[str, Array] = field(default_factory=dict)
    """Positions of the scene's own points by name, (n, 2), m."""
    velocity: dict[str, Array] = field(default_factory=dict)
    """Velocities of the scene's points, m/s."""
    acceleration: dict[str, Array] = field(default_factory=dict)
    """Accelerations of the scene's points, m/s^2."""
    scene: Scene = None  # type: ignore[assignment]
    """Scene that was solved; None for a study."""
    change_points: tuple[float, ...] | None = None
    """Times at which a free motion passed a change point, s. Another motion was
    possible there.
    """
    with_extremes: Command | None = None
    """Instants of a free motion, and those between at which an angle of it is largest
    or smallest.
    """
    command_at: Callable[[Array], Command] | None = None
    """Function that returns a free motion at other times, (n,) rising from 0, s,
    without integrating it again.
    """

    @classmethod
    def of(cls, **values: Any) -> Self:
        """Make a solution from all its fields; a quantity left out is None.

        `Solution(...)` sets some sixty frozen fields one call each, which takes a tenth
        of the time of a single position.
        """
        solution = cls.__new__(cls)
        solution.__dict__.update(values)
        return solution

    def __len__(self) -> int:
        return len(self.theta_2)

    def __getitem__(self, name: str) -> Array:
        """Return a quantity by its name, in SI units.

        The name may be that of a point of the scene (`P`, `v_P`, `a_P`). InputError for
        another name, and for a quantity that was not evaluated.
        """
        quantities = _list_quantities(self)
        allowed = f"must be among {', '.join(quantities)}"
        if isinstance(name, str) and name in quantities:
            values = quantities[name]
            if values is not None:
                return values
            allowed = "was not evaluated: solve as far as it"
        raise InputError("solution", name, allowed)

    __iter__: ClassVar[None] = None  # neither positions nor names

    def __eq__(self, other: object) -> bool:
        """Return whether all fields are equal, number by number and NaN to NaN."""
        if not isinstance(other, Solution):
            return NotImplemented
        names = {part.name for part in fields(self)} - {"stated", "command_at"}
        return all(_is_equal(getattr(self, n), getattr(other, n)) for n in names)

    def __repr__(self) -> str:
        """Say in three lines what it holds."""
        on = f"on bar {self.drive_bar}"
        if self.drive is not None:
            on = "along a line" if self.drive.has_stroke else "at a point"
        of = f" {self.title!r}" if self.title else ""
        codes, counts = np.unique(self.status_code, return_counts=True)
        stated = map("{} {}".format, counts, np.array(STATUS_NAMES)[codes])
        lines = (
            f"Solution{of}: {describe_extent(self.theta_2)}, drive {on}",
            f"status: {', '.join(stated)}",
            list_names("evaluated", self.evaluated()),
        )
        return "\n".join(lines)

    def _repr_html_(self) -> Any:
        return load_show("notebook").show_solution(self)

    @property
    def title(self) -> str:
        """Title of the scene."""
        return self.stated.title

    @property
    def drive_bar(self) -> int:
        """Bar of the drive, 2, 3 or 4; None where the drive exerts a force."""
        return self.stated.drive_bar

    @cached_property
    def drive(self) -> "ForceDrive | None":
        """Drive of the scene that exerts a force; None: a couple drives a bar."""
        return self.stated.settled_drive()

    @property
    def origin(self) -> tuple[Any, Any]:
        """Place of O2 in the coordinates of the scene's drawing, m.

        Of a study (m, 1) each where they vary.
        """
        return self.stated.origin

    @property
    def commanded(self) -> str:
        """Name of what was commanded: an angle, or "stroke"."""
        return self.at.commanded

    @property
    def assembled(self) -> Mask:
        """Mark the positions where the loop closes, (n,)."""
        return np.not_equal(self.status_code, NOT_ASSEMBLED)

    @property
    def status(self) -> Any:
        """Status of each position, one of `STATUS_NAMES`, as a list.

        A study has a list for each member.
        """
        return np.array(STATUS_NAMES)[self.status_code].tolist()

    def evaluated(self) -> list[str]:
        """List the names of the evaluated quantities, theta_2 first.

        Quantities of the scene's points are left out.
        """
        return [name for name in UNITS if getattr(self, name) is not None]

    def to_csv(
        self,
        path: str | Path | None = None,
        *,
        degrees: bool = False,
        units: Conversion = SI,
        decimal: str = ".",
    ) -> str | None:
        """Write one line per position with every digit.

        The text is returned, or written to a file atomically.

        Parameters
        ----------
        degrees : theta in deg.
        units : other units, as `fourbar.units("mm N.mm")` makes them; every heading
            then names its unit.
        decimal : "," writes decimal commas, and semicolons between the columns, as many
            spreadsheets expect.
        """
        expect("path", path, str, Path, type(None))
        expect("degrees", degrees, bool)
        if decimal not in (".", ","):
            raise InputError("decimal", decimal, 'must be "." or ","')
        text = write_csv(
            self,
            {**require_units(units), **(DEGREES if degrees else SI)},
            decimal,
        )
        if path is None:
            return text
        write_text(path, text)
        return None

    def to_pandas(self, units: Conversion = SI) -> "DataFrame":
        """Make a table of what was evaluated, a row per position.

        Vectors are `A_x`, `A_y`; the default is SI units and radians. `attrs["units"]`
        of the table is the unit of each column of numbers.

        Raises DependencyError where pandas is not installed.
        """
        columns = {}
        units_of = {}
        for heading, (unit, values) in _list_columns(
            self, require_units(units)
        ).items():
            if values is not None:
                columns[heading] = values
            if values is not None and unit:
                units_of[heading] = unit
        table = make_data_frame(columns)
        table.attrs["units"] = units_of
        return table


def _is_equal(one: Any, other: Any) -> bool:
    """Return True if two parts of a solution are equal, NaN to NaN, -0 to 0.

    An array equals an array of its shape alone, never a number that fills it.
    """
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        has_nan = np.issubdtype(one.dtype, np.floating)
        return np.array_equal(one, other, equal_nan=has_nan)
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        return False
    if isinstance(one, dict) and isinstance(other, dict):
        is_alike = one.keys() == other.keys()
        return is_alike and all(_is_equal(one[name], other[name]) for name in one)
    if isinstance(one, tuple) and isinstance(other, tuple):
        return len(one) == len(other) and all(map(_is_equal, one, other))
    return bool(one == other)


def where_assembled(solution: Solution, values: Any) -> Array:
    """Return values at positions; NaN where the linkage does not assemble.

    What is commanded, and what follows from the command alone, has a value there too.
    """
    return np.where(solution.assembled, values, np.nan)


def split_parts(name: str, values: Array) -> dict[str, Array]:
    """Split a quantity into scalars: components, and the magnitude of a force."""
    if is_scalar(name):
        return {name: values}
    x = values[..., 0]
    y = values[..., 1]
    parts = {}
    if has_size(name):
        parts[f"|{name}|"] = np.hypot(x, y)
    parts[f"{name}_x"] = x
    parts[f"{name}_y"] = y
    return parts


def write_json(solution: Solution, units: Conversion = SI, **more: Any) -> str:
    """Write one object: arrays over the positions in the given units.

    Vectors are [x, y]; null stands for no value. Entries of other names follow as they
    are given.
    """
    quantities = {
        name: find_values(solution, name, units) for name in _list_quantities(solution)
    }
    passed: dict[str, Any] = {}
    if solution.change_points is not None:
        passed["change_points"] = solution.change_points
    return write_object(
        ANALYZE_SCHEMA,
        title=solution.title,
        angle_unit=find_unit_in("rad", units)[0],
        units={
            name: find_unit_in(find_unit_of_quantity(name), units)[0]
            for name in quantities
        },
        status=solution.status,
        branch=solution.branch,
        **quantities,
        **passed,
        drive_bar=solution.drive_bar,
        assembled=solution.assembled,
        **more,
    )


def write_csv(
    solution: Solution,
    units: Conversion,
    decimal: str = ".",
    chosen: Mapping[str, Array] | None = None,
) -> str:
    """Write one line per position.

    Vectors are columns `A_x`, `A_y`; a missing value is empty.

    `chosen`: the columns by heading, in these units; without any: all quantities.
    """
    columns: Mapping[str, Any] = chosen or {
        heading: values
        for heading, (_, values) in _list_columns(solution, units).items()
    }

    def write_cell(number: float) -> str:
        return repr(number).replace(".", decimal) if math.isfinite(number) else ""

    def write_cells(values: Any) -> Iterable[Any]:
        if isinstance(values, np.ndarray):
            return map(write_cell, values.tolist())
        return values or [""] * solution.theta_2.size

    text = io.StringIO()
    delimiter = ";" if decimal == "," else ","
    writer = csv.writer(text, lineterminator="\n", delimiter=delimiter)
    writer.writerow(columns)
    writer.writerows(zip(*map(write_cells, columns.values()), strict=True))
    return text.getvalue()


def _list_columns(
    solution: Solution, units: Conversion
) -> dict[str, tuple[str, Array | list[Any] | None]]:
    """List the columns of a table, one entry for each position, by their headings.

    The table of a study begins with the number of the member; members follow in turn.
    Every quantity is a column of numbers, vectors are `A_x`, `A_y`, magnitudes of pin
    forces are included, and the time where it is known. A heading in other units than
    SI names its own ("F12_x [lbf]"). A column has its unit, empty for words, and None
    for what was not evaluated.
    """
    size = solution.theta_2.size
    columns = dict[str, tuple[str, Array | list[Any] | None]]()
    if solution.theta_2.ndim > 1:
        count = len(solution)
        columns["member"] = "", np.repeat(np.arange(count), size // count).tolist()
    statuses = np.array(STATUS_NAMES)[solution.status_code.ravel()]
    columns["status"] = "", statuses.tolist()
    columns["branch"] = "", np.ravel(solution.branch).tolist()
    columns["drive_bar"] = "", [solution.drive_bar] * size
    quantities = {
        name: find_values(solution, name, units) for name in _list_quantities(solution)
    }
    quantities |= load_show("derived").list_derived(solution, units)
    for name, values in quantities.items():
        unit, _ = find_unit_in(find_unit_of_quantity(name), units)
        named = f" [{unit}]" if units and unit != "1" else ""
        parts = split_parts(name, np.empty((1, 2)) if values is None else values)
        for part in sorted(parts, key=lambda part: part[0] == "|"):  # sizes come last
            flat = None if values is None else parts[part].ravel()
            columns[f"{part}{named}"] = unit, flat
    time = compute_times(solution.scene, solution.at)
    if time is not None:
        columns["time [s]" if units else "time"] = "s", time
    return columns


def is_scalar(name: str) -> bool:
    """Return True if a quantity is one number at a position."""
    return find_quantity(name).kind == "scalar"


def has_size(name: str) -> bool:
    """Return True if a table has the size of a vector besides its components.

    Forces have it.
    """
    quantity = find_quantity(name)
    return quantity.kind == "vector" and quantity.unit == "N"


def compute_times(scene: Scene | None, at: Command) -> Array | None:
    """Compute when each position of a steady sweep is passed, s; None for any other.

    A sweep is steady if what it commands moves at one speed. A motion over time states
    its times itself.

    `scene`: None for a study, whose positions have no time.
    """
    _, speed, acceleration = at.stated
    if scene is None or at.time is not None or speed is None:
        return None
    if np.ptp(speed) != 0.0 or np.any(acceleration) or not np.all(speed):
        return None
    places = at.places
    swept = places
    if at.commanded == scene.motion.commanded:
        swept = command(scene).places
    if len(swept) < 2:
        return None
    speed = np.ravel(speed)[0]
    time: Array = places / speed - (swept / speed).min()
    return time


def require_units(units: object) -> Conversion:
    """Return units as `fourbar.units` makes them; InputError for others."""
    if not isinstance(units, Mapping) or not all(
        isinstance(to, tuple) and len(to) == 2 and isinstance(to[0], str)
        for to in units.values()
    ):
        allowed = 'must be as fourbar.units makes them, like fourbar.units("mm N.mm")'
        raise InputError("units", units, allowed)
    return {
        si: (unit, require("units", factor, "1", POSITIVE))
        for si, (unit, factor) in units.items()
    }


def find_unit_in(unit: str, units: Conversion) -> tuple[str, float]:
    """Return the unit in which a quantity of an SI unit is given, and the factor."""
    return units.get(unit, (unit, 1.0))


def _list_quantities(solution: Solution) -> dict[str, Array | None]:
    """List every quantity of a solution in SI units, from O2; None: not evaluated.

    Time and those of a force drive are listed only if there is one.
    """
    left_out: tuple[str, ...] = LINE_QUANTITIES
    if solution.drive is not None:
        left_out = () if solution.drive.has_stroke else (STROKE,)
    if solution.time is None:
        left_out = (*left_out, "time")
    names = [name for name in UNITS if name not in left_out]
    quantities = {name: getattr(solution, name) for name in names}
    of_points = solution.points, solution.velocity, solution.acceleration
    for name in dict.fromkeys(chain(*of_points)):
        for start, arrays in zip(OF_POINTS, of_points, strict=True):
            quantities[start + name] = arrays.get(name)
    return quantities


def find_unit_of_quantity(name: str) -> str:
    """Return the SI unit of a quantity or of a point of the scene.

    Names of a point stand for its place, its velocity or its acceleration.
    """
    return find_quantity(name).unit


def find_values(solution: Solution, name: str, units: Conversion = SI) -> Any:
    """Return a quantity, or a point's, by its name; None if it was not evaluated.

    Places are in the coordinates of the scene's drawing.
    """
    values = _list_quantities(solution).get(name)
    unit = find_unit_of_quantity(name)
    if values is None:
        return None
    if unit == "m" and not is_scalar(name):
        values = shift_to_drawing(solution, values)
    return values * units[unit][1] if unit in units else values


def shift_to_drawing(solution: Solution, places: Array) -> Array:
    """Shift places, (n, 2) or (m, n, 2), from O2 to the origin of the drawing."""
    x, y = solution.origin
    if not (np.any(x) or np.any(y)):
        return places
    origin = np.stack(np.broadcast_arrays(x, y), axis=-1)
    return np.asarray(places + origin)


def unwrap(angles: Array) -> None:
    """Make angles in [-pi, pi] continuous along a sweep, in place.

    The first lies in (-pi, pi]; NaN is stepped over.

    `angles`: (n,), or (m, n) for as many sweeps.
    """
    if angles.shape[-1] < 2 or (
        np.ptp(angles) < np.pi and not (angles[..., 0] == -np.pi).any()
    ):
        return
    rows = angles.reshape(-1, angles.shape[-1])
    finite = ~np.isnan(rows)
    # each NaN stands for the number before it, at the start for the first one
    first = finite.argmax(axis=1)[:, None]
    place = np.where(finite, np.arange(rows.shape[1]), first)
    place = np.maximum.accumulate(place, axis=1)
    filled = np.take_along_axis(rows, place, axis=1)
    jumps = np.diff(filled, axis=1, prepend=filled[:, :1])
    turns = np.rint(jumps / TURN).cumsum(axis=1)
    # -pi as a double lies inside (-pi, pi], yet reads as the excluded end
    start = np.where(filled[:, :1] == -np.pi, TURN, 0.0)
    angles[...] = (rows + start - TURN * turns).reshape(angles.shape)
