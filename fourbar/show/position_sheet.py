"""Everything about one position, in aligned rows.

Rows state bars, points, pin forces, ratios and instant centres.
"""

from collections.abc import Iterable, Mapping
from itertools import product

import numpy as np

from fourbar.linkage import MOVING_BARS, PIN_FORCE
from fourbar.quantities import Array, find_derived
from fourbar.show.change_point import find_limits
from fourbar.show.columns import read_column
from fourbar.show.derived import derive, list_point_names
from fourbar.show.shown_units import (
    POSITION_DIGITS,
    choose_unit,
    drop_rounding,
    write_cell,
)
from fourbar.solution import Conversion, Solution, find_unit_of_quantity
from fourbar.solving import solve

LABEL_WIDTH, _CELL = 15, 15
"""Width of a label and of a cell: four of them and a unit are 80 columns."""
ROUNDING_OF_PLACE = 2.0**-23
"""rad; to the root of round-off the place of a largest value is located, at which a
rate is zero. A number that changes its sign within it is shown as zero.
"""
AT_INFINITY = 1e7
"""Times the places of A and B beyond which an instant centre has no place. Where a bar
turns back, which is located to some 1e-9 of its turn, I13 is 1e8 times as far away.
"""
_FORM = f".{POSITION_DIGITS}g"


class PositionSheet:
    """The rows of one position of a solved scene.

    Parameters
    ----------
    solution : of one position.
    units : units of the numbers; one that is left out is the SI unit with a prefix.
    """

    def __init__(self, solution: Solution, units: Conversion) -> None:
        scene = self.scene = solution.scene
        self.units = units
        self.solution, self.on_change_point = find_limits(solution)
        stage = "position" if solution.omega_2 is None else "acceleration"
        at = solution.at.part(np.zeros(2, dtype=int))._replace(origin=None)
        away = ROUNDING_OF_PLACE * np.array([-1.0, 1.0])
        self.beside = solve(scene, stage, at=at._replace(angle=at.angle + away))

    def _read(self, name: str) -> Array:
        """Return a quantity, of the motion zero where it changes its sign.

        Angles stay: that of a whole turn has the sign of its rounding on either side.
        """
        values = np.asarray(derive(self.solution, name)[0])
        if find_derived(name) or find_unit_of_quantity(name) == "rad":
            return values
        beside = derive(self.beside, name)
        if beside is None:  # a pin force
            return values
        return np.where(beside[0] * beside[1] < 0.0, 0.0, values)

    def write_bars(self) -> list[str]:
        """Write angle, speed and acceleration of the moving bars."""
        kinds = {"theta": "rad"}
        if not self._rests():
            kinds |= {"omega": "rad/s", "alpha": "rad/s^2"}
        heads = []
        columns = []
        least = 0.0
        for letter, unit in kinds.items():
            numbers = np.array([self._read(f"{letter}_{bar}") for bar in MOVING_BARS])
            largest = float(np.nanmax(np.abs(numbers), initial=least))
            least = largest**2 if letter == "omega" else 0.0
            factor, name = choose_unit(0.0, unit, self.units)
            form = ".4f" if letter == "theta" else _FORM
            numbers = factor * drop_rounding(numbers, largest)
            heads.append(f"{letter}, {name}")
            columns.append([write_cell(number, form) for number in numbers.tolist()])
        cells = zip(MOVING_BARS, *columns, strict=True)
        rows = [_write_row(f"bar {bar}", of_bar) for bar, *of_bar in cells]
        return [_write_row("", heads), *rows]

    def _rests(self) -> bool:
        """Return True if nothing moves or begins to move: no rate is shown."""
        names = ("omega_2", "alpha_2", "omega_4", "alpha_4")
        rates = [getattr(self.solution, name) for name in names]
        return all(rate is None or rate[0] == 0.0 for rate in rates)

    def write_points(self) -> list[str]:
        """Write place, velocity and acceleration of pins, mass centres, points."""
        kinds = {"": "m"}
        if not self._rests():
            kinds |= {"v_": "m/s", "a_": "m/s^2"}
        rows = [_VECTOR_HEADS]
        for start, unit in kinds.items():
            names = [f"{start}{name}" for name in list_point_names(self.scene)]
            rows += self._write_vectors(dict(zip(names, names, strict=True)), unit)
        return rows

    def write_pin_forces(self) -> list[str]:
        """Write the pin forces, and the force and the moment on the frame."""
        forces = {name: f"{name} at {pin}" for pin, name in PIN_FORCE.items()}
        forces["shaking_force"] = "shaking force"
        moment = self._find_largest(forces) * max(self.scene.linkage.lengths)
        rows = [
            _VECTOR_HEADS,
            *self._write_vectors(forces, "N"),
            self._write_number("shaking_moment", "moment about O2", moment),
        ]
        if self.on_change_point:
            rows.append(self.on_change_point)
        return rows

    def write_ratios(self) -> list[str]:
        """Write the transmission angle, ratios of speeds and of forces, and centres.

        Every point of the input is paired with every point of the output, and the force
        of the drive with points of bars 2 and 4 on which it does not act: the forces
        are those along their paths. By virtual work the ratio of forces is that of the
        speeds, the other way round; the drive does its work at the speed of its stroke.
        """
        numbers = {
            "transmission": "transmission angle",
            "omega_3/omega_2": "omega_3/omega_2",
            "omega_4/omega_2": "omega_4/omega_2",
            "mechanical_advantage": "mechanical advantage",
        }
        points = self.scene.points
        of_input, of_output = (
            [point.name for point in points if point.bar == bar] for bar in (2, 4)
        )
        for start, end in product(of_input, of_output):
            numbers[f"v_{start}/v_{end}"] = f"F_{end}/F_{start}"
        if self.scene.drive is not None:
            driven = {place.bar for _, place in self.scene.drive.ends}
            for point in points:
                if point.bar in {2, 4} - driven:
                    ratio = f"stroke_speed/v_{point.name}"
                    numbers[ratio] = f"F_{point.name}/drive_force"
        centres = {"I13": "centre I13", "I24": "centre I24"}
        return [
            *(self._write_number(name, label) for name, label in numbers.items()),
            *self._write_vectors(centres, "m", ("A", "B")),
        ]

    def _find_largest(self, names: Iterable[str]) -> float:
        """Find the largest size of a kind: what is below its rounding is zero."""
        sizes = np.array([np.hypot(*self._read(name)) for name in names])
        return float(np.max(sizes, where=np.isfinite(sizes), initial=0.0))

    def _write_vectors(
        self, labels: Mapping[str, str], unit: str, scale: Iterable[str] = ()
    ) -> list[str]:
        """Write components and sizes of vectors of one kind, by name and label.

        `scale`: quantities that choose the prefix; without any: these vectors.
        """
        largest = self._find_largest(scale or labels)
        factor, shown = choose_unit(largest, unit, self.units)
        rows = []
        for name, label in labels.items():
            vector = drop_rounding(self._read(name), largest)
            numbers = factor * np.array([*vector, np.hypot(*vector)])
            if np.hypot(*vector) > AT_INFINITY * largest:
                numbers[:] = np.nan
            cells = [write_cell(number, _FORM) for number in numbers.tolist()]
            if unit == "m":  # how far a place is from the origin is of no interest
                cells[2] = ""
            rows.append(_write_row(label, [*cells, shown]))
        return rows

    def _write_number(self, name: str, label: str, largest: float = 1.0) -> str:
        """Write a number of a column; a ratio of forces has no sign."""
        column = read_column(self.solution, name)
        (number,) = drop_rounding(column.values, largest).tolist()
        number = abs(number) if label.startswith("F_") else number
        unit = column.unit if column.divisor == "1" else "1"
        factor, shown = choose_unit(abs(number), unit, self.units)
        cell = write_cell(factor * number, _FORM)
        # width of the label of a number that stands alone
        return _write_row(label, [cell, "" if unit == "1" else shown], 22)


def _write_row(label: str, cells: Iterable[str], width: int = LABEL_WIDTH) -> str:
    row = "".join(f"{cell:<{_CELL - 1}} " for cell in cells)
    return f"{label:<{width - 1}} {row}".rstrip()


_VECTOR_HEADS = _write_row("", ("x", "y", "size"))
