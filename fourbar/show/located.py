"""Positions of a scene's motion at which a column has a value.

A place of a grid at which a column is larger or less than beside it is moved to the
extreme that is there. Between two places a column that changes its side of the value
then passes it; one that changes its side by a jump does not have the value.
"""

import numpy as np

from fourbar.errors import InputError, NotAssembledError, name_unit, write_in_units
from fourbar.formulas.mobility import limit_positions
from fourbar.linkage import require
from fourbar.quantities import UNITS, Array
from fourbar.quantities.units import read_bare
from fourbar.scene import Command, Scene
from fourbar.show.columns import read_column
from fourbar.show.shown_units import drop_rounding
from fourbar.solution import Solution, where_assembled
from fourbar.solving import find_last_stage
from fourbar.studies.course import MotionCourse
from fourbar.studies.passing import (
    COMMANDED_ANGLES,
    SAME_POSITION,
    STATED_POSITIONS,
    is_same_position,
)

TOUCHES = 1e-9
"""Part of a column's extent by which an extreme may miss the value: where it has a
corner, it is located to the root of round-off.
"""
LOCATED = 1e-11
"""Part of the motion within which an extreme is located."""
CONSTANT = 1e-12
"""Part of a column's usual value within which two values are one."""
TOLD = 1e-6
"""Error bar, as a part of a value or of the usual one, beyond which it is rounding."""
UNBOUNDED_BEYOND = 1e6
"""Times its usual size beyond which a column's largest value stands beside a pole."""
EXTREMES = {"min": 1.0, "max": -1.0}
"""Signs by which the least or the greatest value of a column is its least."""
USUAL = 90.0
"""Percentile of a column's sizes other than zero, and of its distances from the
median. A spring that only pushes may exert no force at nearly all positions.
"""
JUMP = 1e-3
"""Part of its change over an interval by which a column jumps at one place in it."""


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
        bar = f"{name}_error"
        stage = "error" if name.endswith("_error") or bar in UNITS else "force"
        if find_last_stage(scene) == "position" or name in STATED_POSITIONS:
            stage = "position"
        # beside a position without a value it may grow without bound
        self.course = MotionCourse(
            scene, stage, holds=lambda of: np.isfinite(self._read_column(of))
        )
        self.commanded = self.course.commanded
        column = read_column(self.course.solution, name)
        self.unit = column.unit if column.convert({})[0] else "1"
        """SI unit; that of a pure number is 1."""
        if "1" not in (self.unit, column.divisor):
            self.unit = f"({column.unit})/({column.divisor})"
        self.places = self.course.places
        self.values = where_assembled(self.course.solution, column.values)
        known = np.isfinite(self.values).any()
        if stage == "error" and bar in UNITS and known:
            # rounding beside a vanishing lever
            sizes = np.abs(self.values)
            most = TOLD * np.fmax(sizes, np.nanmedian(sizes))
            self.values[self.course.solution[bar] > most] = np.nan
        self.is_extreme = np.zeros(len(self.values), dtype=bool)

    def _read_column(self, solution: Solution) -> Array:
        """Return the column at positions, NaN where the linkage does not assemble."""
        values = read_column(solution, self.name).values
        return where_assembled(solution, values)

    def _gap(self, places: Array, value: Array | float) -> Array:
        """Return how far the column at places is from values, in an array of any shape.

        Angles are counted modulo a turn.
        """
        read = self._read_column(self.course.solve(np.ravel(places)))
        return self._wrap(read.reshape(np.shape(places)) - value)

    def _wrap(self, gaps: Array) -> Array:
        return np.angle(np.exp(1j * gaps)) if self.unit == "rad" else gaps

    def _locate_extremes(self) -> None:
        """Move places at which the column is larger or less than beside to extremes."""
        from scipy.optimize.elementwise import find_minimum

        rises = np.sign(np.diff(self.values))
        turns = (rises[:-1] != 0.0) & (rises[1:] * rises[:-1] <= 0.0)
        rows = 1 + np.flatnonzero(turns)
        sides = -rises[rows - 1]
        located = find_minimum(
            lambda places, side, value: side * self._gap(places, value),
            tuple(self.places[rows + shift] for shift in (-1, 0, 1)),
            args=(sides, self.values[rows]),
            tolerances={"xatol": LOCATED * self.course.span, "xrtol": 0.0},
        )
        rows = rows[located.success]
        self.places[rows] = located.x[located.success]
        self.values[rows] += (sides * located.f_x)[located.success]
        self.is_extreme[rows] = True
        if not {self.name, self.commanded} <= {*COMMANDED_ANGLES}:
            return
        # the limits of a bar's angle have a closed form
        for limit in limit_positions(self.scene.linkage, int(self.name[-1])):
            away = self._wrap(self.places - getattr(limit, self.commanded))
            near = self.is_extreme & (np.abs(away) <= SAME_POSITION)
            self.places[near] -= away[near]

    def locate(self, text: str) -> Command:
        """Locate the positions that have a value, in the order of the motion."""
        value = 0.0 if text in EXTREMES else self._read_value(text)
        finite = self.values[np.isfinite(self.values)]
        if not finite.size:
            raise NotAssembledError(f"--at {self.name}: it has no value in this motion")
        # the largest value may stand beside a pole, where many places are
        usual = self.values[np.isin(self.places, self.course.even)]
        usual = usual[np.isfinite(usual)]
        sizes = np.abs(usual[usual != 0.0])
        self.usual = float(np.percentile(sizes, USUAL)) if sizes.size else 0.0
        if np.ptp(finite) <= CONSTANT * np.abs(finite).max():
            raise self._refuse(text, "it is constant")
        self._locate_extremes()
        extent = float(np.percentile(np.abs(usual - np.median(usual)), USUAL))
        if text in EXTREMES:
            sided = EXTREMES[text] * self.values
            row = int(np.nanargmin(sided))
            if abs(self.values[row]) > UNBOUNDED_BEYOND * self.usual:
                raise self._refuse(text, "it has none")
            # the first of equal ones
            ties = self.is_extreme & (sided <= sided[row] + TOUCHES * extent)
            row = min([row, *np.flatnonzero(ties).tolist()])
            return self.course.command(self.places[row : row + 1])
        gaps = self._wrap(self.values - value)
        room = np.full(len(gaps), CONSTANT * max(self.usual, abs(value)))
        room[self.is_extreme] = TOUCHES * extent
        if self.unit == "rad":
            room[self.is_extreme] = max(TOUCHES * extent, SAME_POSITION)
        gaps[np.abs(gaps) <= room] = 0.0
        zeros = gaps == 0.0
        if (zeros[1:] & zeros[:-1]).any():
            raise self._refuse(text, "it is constant there")
        passed, jumps = self._find_crossings(gaps, value)
        found = np.concatenate([self.places[zeros], passed])
        if not found.size:
            why = "no position has it"
            if jumps.size:
                places = drop_rounding(np.sort(jumps), self.course.span).tolist()
                jumped = ", ".join(write_place(self.commanded, x) for x in places)
                why = f"it jumps over it at {self.commanded} = {jumped}"
            raise self._refuse(text, why)
        found = np.sort(found)
        if self.places[0] > self.places[-1]:
            found = found[::-1]
        return self.course.command(self._drop_repeated(found))

    def _read_value(self, text: str) -> float:
        """Read the value that is sought; InputError where its unit is missing."""
        number = read_bare(text)
        if number is None or self.unit == "1":
            return require("value", text if number is None else number, self.unit)
        hint = f'the unit is missing; did you mean "{text} {name_unit(self.unit)}"?'
        raise InputError("value", f"{self.name}={text}", hint)

    def _find_crossings(self, gaps: Array, value: float) -> tuple[Array, Array]:
        """Find where the column passes the value, and where it jumps over it."""
        from scipy.optimize.elementwise import find_root

        before = gaps[:-1]
        after = gaps[1:]
        crosses = before * after < 0.0
        if self.unit == "rad":  # half a turn away it changes its side, too
            crosses &= np.abs(after - before) < np.pi
        rows = np.flatnonzero(crosses)
        interval = self.places[rows], self.places[rows + 1]
        root = find_root(self._gap, interval, args=(value,))
        change = np.abs(after - before)[rows]
        left = np.abs(root.f_bracket[1] - root.f_bracket[0])
        steady = (root.f_x == 0.0) | (left <= JUMP * change)
        # at a pole itself there is no value
        jumps = np.mean(root.bracket, axis=0)[~steady]
        return root.x[steady], jumps

    def _drop_repeated(self, places: Array) -> Array:
        """Drop the positions that are an earlier one after whole turns."""
        if self.commanded not in COMMANDED_ANGLES:
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

    def _refuse(self, text: str, why: str) -> NotAssembledError:
        """Make the error of a value that no position has, with the column's range."""
        located = np.array([np.nanmin(self.values), np.nanmax(self.values)])
        largest = np.abs(located).max()
        ends = dict.fromkeys(drop_rounding(located, largest).tolist())
        start = f"--at {self.name} = {text}: {why}"
        if largest > UNBOUNDED_BEYOND * self.usual:
            return NotAssembledError(f"{start}, and grows without bound")
        unit = "" if self.unit == "1" else self.unit
        word = "is" if len(ends) == 1 else "goes from"
        extent = f"{word} {write_in_units(unit, *ends, between=' to ')}"
        return NotAssembledError(f"{start}; {self.name} {extent}")


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
