"""Everything about one position, in aligned rows.

Rows state bars, points, pin forces, ratios and instant centres.
"""

from collections.abc import Iterable, Iterator
from itertools import product

import numpy as np

from fourbar.formulas.mobility import TURN
from fourbar.linkage import MOVING_BARS, PIN_FORCE
from fourbar.quantities import DERIVED_NAMES, Array
from fourbar.show.change_point import find_limits
from fourbar.show.columns import read_column
from fourbar.show.derived import derive
from fourbar.show.shown_units import (
    POSITION_DIGITS,
    choose_unit,
    drop_rounding,
    write_cell,
)
from fourbar.solution import (
    Conversion,
    Solution,
    find_unit_of_quantity,
    find_values,
)
from fourbar.solving import solve

LABEL_WIDTH, _CELL = 15, 15
"""Width of a label and of a cell: four of them and a unit are 80 columns."""
_NUMBER_LABEL = 22
"""Width of the label of a number that stands alone."""
ROUNDING_OF_PLACE = 2.0**-23
"""rad; to the root of round-off the place of a largest value is located, at which a
rate is zero. A number that changes its sign within it is shown as zero.
"""
AT_INFINITY = 1e7
"""Times the places of A and B beyond which an instant centre is at infinity. Where a
bar turns back, which is located to some 1e-9 of its turn, I13 is 1e8 times as far away.
"""


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
        at = solution.at._replace(origin=None)
        self.beside = [
            solve(scene, stage, at=at._replace(angle=at.angle + away))
            for away in (-ROUNDING_OF_PLACE, ROUNDING_OF_PLACE)
        ]

    def _read(self, name: str) -> Array:
        """Return a quantity of the motion, zero where it changes its sign.

        Angles stay: that of a whole turn has the sign of its rounding on either side.
        """
        values = find_values(self.solution, name)
        if find_unit_of_quantity(name) == "rad":
            return np.asarray(values[0])
        before, after = (find_values(beside, name)[0] for beside in self.beside)
        return np.where(before * after < 0.0, 0.0, values[0])

    def write_bars(self) -> list[str]:
        """Write angle, speed and acceleration of the moving bars."""
        kinds = {"theta": "rad"}
        if not self._rests():
            kinds |= {"omega": "rad/s", "alpha": "rad/s^2"}
        heads = []
        columns = []
        squared_speed = 0.0
        for letter, unit in kinds.items():
            numbers = np.array([self._read(f"{letter}_{bar}") for bar in MOVING_BARS])
            largest = np.nanmax(np.abs(numbers), initial=0.0)
            if letter == "omega":
                squared_speed = largest**2
            elif letter == "alpha":
                largest = max(largest, squared_speed)
            else:
                largest = min(largest, TURN)
            factor, name = choose_unit(0.0, unit, self.units)
            form = ".4f" if letter == "theta" else f".{POSITION_DIGITS}g"
            numbers = factor * drop_rounding(numbers, largest)
            heads.append(f"{letter}, {name}")
            columns.append(_write_cells_of(numbers, form))
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
        centres = [
            f"G{bar}" for bar in MOVING_BARS if self.scene.linkage.bar(bar).mass > 0.0
        ]
        names = ["A", "B", *centres, *self.solution.points]
        rows = [_write_row("", ("x", "y", "size"))]
        scales = {"": "m"}
        if not self._rests():
            scales |= {"v_": "m/s", "a_": "m/s^2"}
        largest = {start: self._find_largest(start, names) for start in scales}
        for name, (start, unit) in product(names, scales.items()):
            label = f"  {start[0]}" if start else name
            vector = self._read(start + name)
            row = self._write_vector(
                label, vector, unit, largest[start], sized=bool(start)
            )
            rows.append(row)
        return rows

    def write_pin_forces(self) -> list[str]:
        """Write the pin forces, and the force and the moment on the frame."""
        forces = {
            f"{name} at {pin}": getattr(self.solution, name)[0]
            for pin, name in PIN_FORCE.items()
        }
        forces["shaking force"] = derive(self.solution, "shaking_force")[0]
        sizes = [float(np.hypot(x, y)) for x, y in forces.values()]
        largest = max(filter(np.isfinite, sizes), default=0.0)
        rows = [_write_row("", ("x", "y", "size"))]
        for label, force in forces.items():
            rows.append(self._write_vector(label, force, "N", largest))
        moment = derive(self.solution, "shaking_moment")
        moment = drop_rounding(moment, largest * max(self.scene.linkage.lengths))
        factor, name = choose_unit(abs(float(moment[0])), "N m", self.units)
        cells = [*_write_cells_of(factor * moment), "", "", f"{name} about O2"]
        rows.append(_write_row("shaking moment", cells))
        if self.on_change_point:
            rows.append(self.on_change_point)
        return rows

    def write_ratios(self) -> list[str]:
        """Write the transmission angle, the ratios of speeds and the centres.

        The centres are the instant centres.
        """
        rows = []
        for name in ("transmission", "omega_3/omega_2", "omega_4/omega_2"):
            values = derive(self.solution, name)
            label = "transmission angle" if name == "transmission" else name
            rows.append(self._write_number(label, values, DERIVED_NAMES[name].unit))
        values = derive(self.solution, "mechanical_advantage")
        label = "mechanical advantage"
        if np.isfinite(values[0]):
            after = "  (torque of bar 4 to bar 2)"
            rows.append(self._write_number(label, values, "1", after))
        else:
            bound = "without a bound: bar 4 stands still"
            rows.append(f"{label:<{_NUMBER_LABEL}}{bound}")
        rows += self._write_force_ratios()
        for name in ("I13", "I24"):
            centre = derive(self.solution, name)
            label = f"centre {name}"
            size = self._find_largest("", ["A", "B"])
            if np.abs(centre).max() <= AT_INFINITY * size:
                rows.append(self._write_vector(label, centre[0], "m", size))
            else:
                rows.append(_write_row(label, ("at infinity",)))
        return rows

    def _write_force_ratios(self) -> Iterator[str]:
        """Write ratios of forces along the paths of two points, and to the drive's.

        Every point of the input is paired with every point of the output, and the force
        of the drive with points of bars 2 and 4 on which it does not act. By virtual
        work the ratio of forces is that of the speeds, the other way round; the drive
        does its work at the speed of its stroke.
        """
        points = self.scene.points
        of_input, of_output = (
            [point.name for point in points if point.bar == bar] for bar in (2, 4)
        )
        for start, end in product(of_input, of_output):
            ratio = read_column(self.solution, f"v_{start}/v_{end}")
            text = f"  (forces along the paths of {end} and {start})"
            yield self._write_number(f"F_{end}/F_{start}", ratio.values, "1", text)
        if self.scene.drive is None:
            return
        driven = {place.bar for _, place in self.scene.drive.ends}
        for point in points:
            if point.bar in {2, 4} - driven:
                column = f"stroke_speed/v_{point.name}"
                values = np.abs(read_column(self.solution, column).values)
                label = f"F_{point.name}/drive_force"
                text = f"  (force along the path of {point.name} to the drive's)"
                yield self._write_number(label, values, "1", text)

    def _find_largest(self, start: str, names: Iterable[str]) -> float:
        """Find the largest component of a kind: what is below its rounding is zero."""
        sizes = np.abs([self._read(start + name) for name in names])
        return float(np.max(sizes, where=np.isfinite(sizes), initial=0.0))

    def _write_vector(
        self,
        label: str,
        vector: Array,
        unit: str,
        largest: float,
        *,
        sized: bool = True,
    ) -> str:
        """Write the components of a vector, and its size."""
        factor, name = choose_unit(largest, unit, self.units)
        x, y = drop_rounding(vector, largest)
        cells = _write_cells_of(factor * np.array([x, y, np.hypot(x, y)]))
        if not sized:
            cells[2] = ""
        return _write_row(label, [*cells, name])

    def _write_number(
        self,
        label: str,
        values: Array,
        unit: str,
        after: str = "",
    ) -> str:
        """Write an angle or a ratio, which is about 1."""
        values = drop_rounding(values, 1.0)
        if unit == "rad":
            factor, name = choose_unit(abs(float(values[0])), unit, self.units)
            values = factor * values
            after = f" {name}{after}"
        (text,) = _write_cells_of(values)
        return f"{label:<{_NUMBER_LABEL}}{text}{after}"


def _write_cells_of(numbers: Array, form: str = f".{POSITION_DIGITS}g") -> list[str]:
    return [write_cell(number, form) for number in numbers.tolist()]


def _write_row(label: str, cells: Iterable[str]) -> str:
    row = "".join(f"{cell:<{_CELL - 1}} " for cell in cells)
    return f"{label:<{LABEL_WIDTH}}{row}".rstrip()
