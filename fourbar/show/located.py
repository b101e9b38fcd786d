"""Positions of a scene's motion at which a column has a value.

Between the places of a grid a column that changes its side of the value passes it, and
one that comes nearest to it there may touch it. A column that changes its side by a
jump does not have the value.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from fourbar.errors import InputError, NotAssembledError, name_unit, write_in_units
from fourbar.linkage import require
from fourbar.quantities import Array
from fourbar.quantities.units import NUMBER_TEXT
from fourbar.scene import Command, Scene
from fourbar.show.columns import read_column
from fourbar.show.shown_units import drop_rounding
from fourbar.solution import where_assembled
from fourbar.solving import find_last_stage
from fourbar.studies.course import MotionCourse
from fourbar.studies.passing import SAME_POSITION, is_same_position

JUMP = 1e-3
"""Part of its change over an interval by which a column jumps at one place in it."""
TOUCHES = 1e-9
"""Part of a column's extent by which an extreme may miss the value: where it has a
corner, it is located to the root of round-off.
"""
LOCATED = 1e-11
"""Part of the motion within which an extreme is located."""
CONSTANT = 1e-12
"""Part of a column's usual value within which two values are one."""
UNBOUNDED_BEYOND = 1e6
"""Times its usual size beyond which a column's largest value stands beside a pole."""
EXTREMES = {"min": 1.0, "max": -1.0}
"""Signs by which the least or the greatest value of a column is its least."""
USUAL = 90.0
"""Percentile of a column's sizes other than zero, and of its distances from the
median. A spring that only pushes may exert no force at nearly all positions.
"""


def locate(scene: Scene, name: str, text: str) -> Command:
    """Locate the positions of a scene's motion at which a column has a value.

    A scene that states single positions is searched over the range that holds the
    first of them.

    Parameters
    ----------
    name : a column, as `read_column` takes it.
    text : the value with its unit; a pure number has none. "min" and "max" stand for
        the least and the greatest of the motion.

    Raises
    ------
    InputError : no column has the name, or the value is none of it.
    NotAssembledError : no position has the value; the message says the range.
    """
    try:
        return _LocatedSearch(scene, name).locate(text)
    except InputError as error:
        if error.key not in ("--columns", "value"):
            raise
        raise error.moved_to("--at", None) from None


class _LocatedSearch:
    """A column over the motion of a scene."""

    def __init__(self, scene: Scene, name: str) -> None:
        self.scene = scene
        self.name = name
        stage = "error" if name.endswith("_error") else "force"
        if find_last_stage(scene) == "position":
            stage = "position"
        self.course = MotionCourse(scene, stage)
        self.places = self.course.places
        self.commanded = self.course.commanded
        column = read_column(self.course.solution, name)
        self.unit = column.unit if column.label({}) else "1"
        """SI unit; that of a pure number is 1."""
        if "1" not in (self.unit, column.divisor):
            self.unit = f"({column.unit})/({column.divisor})"
        self.values = where_assembled(self.course.solution, column.values)

    def _read(self, places: Array) -> Array:
        """Return the column at places in an array of any shape."""
        solution = self.course.solve(np.ravel(places))
        column = read_column(solution, self.name)
        return where_assembled(solution, column.values).reshape(np.shape(places))

    def _gap(self, places: Array) -> Array:
        """Return the gaps at places in an array of any shape."""
        return self._measure_gaps(self._read(places))

    def _measure_gaps(self, values: Array) -> Array:
        """Return how far values lie from the one sought, of angles modulo a turn."""
        gaps = values - self.value
        if self.unit == "rad":
            gaps = np.angle(np.exp(1j * gaps))
        return np.asarray(gaps)

    def _minimize(self, function: Callable[..., Array], rows: Any, *side: Array) -> Any:
        """Locate the least values of a function about places of the course."""
        from scipy.optimize.elementwise import find_minimum

        bracket = tuple(self.places[rows + shift] for shift in (-1, 0, 1))
        located = {"xatol": LOCATED * self.course.span, "xrtol": 0.0}
        return find_minimum(function, bracket, args=side, tolerances=located)

    def locate(self, text: str) -> Command:
        """Locate the positions that have a value, in the order of the motion."""
        self.value = 0.0 if text in EXTREMES else self._read_value(text)
        finite = self.values[np.isfinite(self.values)]
        if not finite.size:
            raise NotAssembledError(f"--at {self.name}: it has no value in this motion")
        if np.ptp(finite) <= CONSTANT * np.abs(finite).max():
            raise self._refuse(text, "it is constant", finite)
        # the largest value may stand beside a pole
        usual = _find_usual_size(finite)
        if text in EXTREMES:
            place, value = self._find_extreme(EXTREMES[text])
            if abs(value) > UNBOUNDED_BEYOND * usual:
                raise self._refuse(text, "it has none", finite)
            return self.course.command(np.array([place]))
        gaps = self._measure_gaps(self.values)
        gaps[np.abs(gaps) <= CONSTANT * max(usual, abs(self.value))] = 0.0
        zeros = gaps == 0.0
        if (zeros[1:] & zeros[:-1]).any():
            raise self._refuse(text, "it is constant there", finite)
        extent = float(np.percentile(np.abs(finite - np.median(finite)), USUAL))
        touches, brackets = self._find_touches(gaps, extent)
        passed, jumps = self._find_crossings(gaps, brackets)
        found = np.concatenate([self.places[zeros], touches, passed])
        if not found.size:
            why = "no position has it"
            if jumps.size:
                places = drop_rounding(np.sort(jumps), self.course.span).tolist()
                jumped = [write_place(self.commanded, place) for place in places]
                why = f"it jumps over it at {self.commanded} = {', '.join(jumped)}"
            raise self._refuse(text, why, finite)
        found = np.sort(found)
        if self.places[0] > self.places[-1]:
            found = found[::-1]
        return self.course.command(self._drop_repeated(found))

    def _read_value(self, text: str) -> float:
        """Read the value that is sought; InputError where its unit is missing."""
        if not NUMBER_TEXT.fullmatch(text):
            return require("value", text, self.unit)
        if self.unit == "1":
            return require("value", float(text))
        hint = f'the unit is missing; did you mean "{text} {name_unit(self.unit)}"?'
        raise InputError("value", f"{self.name}={text}", hint)

    def _find_touches(self, gaps: Array, extent: float) -> tuple[Array, list[Array]]:
        """Find where the column turns round at the value, or beyond it.

        A place beyond it is returned as two intervals, on each of which the column
        passes the value.
        """
        sides = np.sign(gaps)
        before, here, after = np.abs([gaps[:-2], gaps[1:-1], gaps[2:]])
        # between two places a curve goes no farther beyond them than they are apart
        in_reach = here <= np.maximum(before, after) - here
        nearest = (here <= before) & (here <= after) & in_reach
        alike = (sides[1:-1] == sides[:-2]) & (sides[1:-1] == sides[2:])
        rows = 1 + np.flatnonzero(nearest & alike & (sides[1:-1] != 0.0))
        if not rows.size:
            return np.empty(0), []
        least = self._minimize(
            lambda places, side: side * self._gap(places), rows, sides[rows]
        )
        ends = np.array([self.places[rows - 1], least.x, self.places[rows + 1]])
        beyond = ends[:, least.f_x < -TOUCHES * extent]
        at = np.abs(least.f_x) <= TOUCHES * extent
        return least.x[at], [beyond[:2], beyond[1:]]

    def _find_crossings(
        self,
        gaps: Array,
        brackets: list[Array],
    ) -> tuple[Array, Array]:
        """Find where the column passes the value, and where it jumps over it.

        `brackets`: further intervals on which it changes its side, (2, k) each.
        """
        from scipy.optimize.elementwise import find_root

        before = gaps[:-1]
        after = gaps[1:]
        crosses = before * after < 0.0
        if self.unit == "rad":  # half a turn away it changes its side, too
            crosses &= np.abs(after - before) < np.pi
        rows = np.flatnonzero(crosses)
        intervals = [np.stack([self.places[rows], self.places[rows + 1]]), *brackets]
        low, high = np.concatenate(intervals, axis=1)
        if not low.size:
            return low, low
        root = find_root(self._gap, (low, high))
        change = np.abs(self._gap(high) - self._gap(low))
        left = np.abs(root.f_bracket[1] - root.f_bracket[0])
        steady = (root.f_x == 0.0) | (left <= JUMP * change)
        return root.x[steady], root.x[~steady]

    def _drop_repeated(self, places: Array) -> Array:
        """Drop the positions that are an earlier one after whole turns."""
        if self.commanded not in ("theta_2", "theta_3", "theta_4"):
            return places
        pins = self.course.solve(places).B
        room = SAME_POSITION * max(self.scene.linkage.lengths)
        kept: list[int] = []
        for row, place in enumerate(places.tolist()):
            if not any(
                is_same_position(self.commanded, place, float(places[other]))
                and np.hypot(*(pins[row] - pins[other])) <= room
                for other in kept
            ):
                kept.append(row)
        return places[kept]

    def _refuse(self, text: str, why: str, values: Array) -> NotAssembledError:
        """Make the error of a value that no position has, with the column's range."""
        located = np.array([self._find_extreme(side)[1] for side in EXTREMES.values()])
        ends = dict.fromkeys(drop_rounding(located, np.abs(values).max()).tolist())
        usual = _find_usual_size(values)
        start = f"--at {self.name} = {text}: {why}"
        if np.abs(located).max() > UNBOUNDED_BEYOND * usual:
            return NotAssembledError(f"{start}, and grows without bound")
        unit = "" if self.unit == "1" else self.unit
        extent = write_in_units(unit, *ends, between=" to ")
        word = "is" if len(ends) == 1 else "goes from"
        return NotAssembledError(f"{start}; {self.name} {word} {extent}")

    def _find_extreme(self, side: float) -> tuple[float, float]:
        """Find the place and the value of the column's extreme on this side.

        `side`: one of `EXTREMES`.
        """
        row = int(np.nanargmin(side * self.values))
        place = self.places[row]
        value = self.values[row]
        around = self.values[row - 1 : row + 2]
        if 0 < row < len(self.values) - 1 and np.isfinite(around).all():
            least = self._minimize(lambda places: side * self._read(places), row)
            place = least.x
            value = side * least.f_x
        return float(place), float(value)


def _find_usual_size(values: Array) -> float:
    """Return the size that nine tenths of the values other than zero do not exceed.

    Where all are zero it is zero.
    """
    sizes = np.abs(values[values != 0.0])
    return float(np.percentile(sizes, USUAL)) if sizes.size else 0.0


def write_place(name: str, place: float) -> str:
    """Write what is commanded, or the time, so that `--at` finds it again."""
    unit = {"time": "s", "stroke": "m"}.get(name, "rad")
    return write_in_units(unit, place, digits=12)


def list_positions(text: str, at: Command) -> list[str]:
    """List the positions of a value as the texts of `--at` that name each of them."""
    name = at.commanded if at.time is None else "time"
    lines = [f"{text} at {len(at.places)} positions:"]
    return lines + [
        f'  --at "{name}={write_place(name, place)}"' for place in at.places.tolist()
    ]
