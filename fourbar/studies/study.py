"""A scene with arrays in place of some numbers: one linkage for each entry."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fourbar.errors import InputError, expect
from fourbar.evaluation.case import Case
from fourbar.linkage import BAR_NAMES, convert_to_unit
from fourbar.quantities import INVALID, NOT_ASSEMBLED, Array, Mask
from fourbar.scene import Command, Scene, command, command_stroke
from fourbar.scene.motion import FromLimit
from fourbar.scene.numbers import find_unit_of_key
from fourbar.solution import Solution
from fourbar.solving import Results, make_solution, split
from fourbar.studies.keys import (
    COMMAND_KEYS,
    command_key,
    find_overlap,
    list_entries,
    refuse_key,
    replace_numbers,
)
from fourbar.writing import describe_extent, list_names


@dataclass(frozen=True, slots=True, eq=False)
class Study:
    """m linkages at n positions each, from one scene; made by `vary`."""

    scene: Scene
    """Scene with the numbers that do not vary."""
    values: dict[str, Array]
    """Varied numbers by key, pins and lengths first, (m,).

    A member that a scene would refuse has NaN.
    """
    invalid: Mask
    """The members that a scene would refuse, (m,)."""
    at: Command
    """Commanded angle and branch (m, n), with speed and acceleration. The latter are
    those of the scene, or (m, 1).
    """

    def __len__(self) -> int:
        return len(self.invalid)

    def __repr__(self) -> str:
        """Say what varies."""
        return (
            f"Study {self.scene.title!r}: {describe_extent(self.at.angle)}\n"
            + list_names("varied", self.values)
        )

    def solve(
        self,
        stage: str | None = None,
        *,
        at: Command | None = None,
        out: Mapping[str, Array] | None = None,
        side: int = 0,
    ) -> Solution:
        """Evaluate every member, in shapes (m, n) and (m, n, 2).

        Other parameters and errors are those of `fourbar.solve`.

        `at`: some of the positions; effects begin where the whole motion of a member
        does.
        """
        at = self.at if at is None else at
        results = Results(self.scene, at, stage, out)
        results.allocate()
        m, n = results.shape
        with np.errstate(all="ignore"):
            for rows in split(m, max(1, results.block // n)):
                case = self.case(rows, side)
                if results.asks_forces and self.scene.counts_turns:
                    case = case.begin_with(take_positions(self.at, rows, slice(None)))
                for columns in split(n, results.block):
                    positions = take_positions(at, rows, columns)
                    results.fill(case, positions, (rows, columns))
        members = {key: values[:, None] for key, values in self.values.items()}
        solution = make_solution(replace_numbers(self.scene, members), at, results)
        # what a scene would refuse, and strokes that a cylinder cannot have
        results.codes[np.isnan(at.angle)] = NOT_ASSEMBLED
        results.codes[self.invalid] = INVALID
        for array in results.arrays.values():
            array[self.invalid] = np.nan
        return solution

    def case(self, rows: slice, side: int = 0) -> Case:
        """Return the case of some members, whose numbers are (k, 1)."""
        numbers = {key: values[rows, None] for key, values in self.values.items()}
        scene = replace_numbers(self.scene, numbers)
        return Case.of(scene, self.at.bar, side).beside(self.scene)


def take_positions(at: Command, rows: slice, columns: slice) -> Command:
    """Take some positions of some members, (k, l)."""

    def take(value: Any) -> Any:
        if np.ndim(value) < 2:
            return value
        return value[rows] if value.shape[1] == 1 else value[rows, columns]

    return at.with_arrays(take)


def vary(scene: Scene, values: Mapping[str, Any]) -> Study:
    """Make m linkages from one scene, for `solve`.

    Some of its numbers are arrays, one entry for each member.

    Parameters
    ----------
    values : arrays of one length m, or single numbers, SI and rad or texts like
        "48 cm", by keys as in the scene file: lists by index ("loads.0.moment"), pairs
        likewise ("bars.coupler.centre.0"). "motion.theta_2" (or theta_3, theta_4,
        stroke, where that is commanded) is (n,), for all members, or (m, n); a scene
        that states none needs it. What the scene leaves out (the inertia of a uniform
        bar, its centre at mid-bar) follows the length of each member. Of a scene with
        `[pins]` also "pins.A.0", a coordinate of a drawn pin: the pin moves in the
        drawing, and lengths and ground_angle follow. What is commanded, the assembly
        and the places of the bars stay as they are. "points.P.drawn.0" likewise is a
        coordinate of a place that is stated from a bar's first pin: the place moves in
        the drawing, and the pins stay.

    Raises
    ------
    InputError : a key that the scene does not have or that is no number, a value that
        is no array of numbers, shapes that do not fit, a free motion, a number
        beside a coordinate by which it follows. A member with
        numbers that a scene refuses has the status "invalid", one that never closes
        "not_assembled".

    >>> from fourbar import Motion, Scene, solve, uniform
    >>> scene = Scene(uniform(0.3, 0.1, 0.25, 0.22), Motion(1.0, 10.0))
    >>> solve(vary(scene, {"lengths.input": [0.1, 0.11, 2.0]})).status
    [['ok'], ['ok'], ['not_assembled']]
    """
    expect("scene", scene, Scene)
    expect("values", values, Mapping)
    if scene.motion.free is not None:
        allowed = "is integrated for one linkage; a study prescribes theta_2"
        raise InputError("motion.free", "a free motion", allowed)
    entries = list_entries(scene)
    theta = command_key(scene)
    arrays = {
        key: _read_members(key, value, [*entries, theta])
        for key, value in values.items()
    }
    if (overlap := find_overlap(arrays.keys())) is not None:
        length, pin = overlap
        allowed = f"follows from {pin}, which varies too: vary one of them"
        raise InputError(length, values[length], allowed)
    angles = _read_angles(scene, arrays, theta)
    first, m = "", 1
    for key, array in (arrays | {theta: angles[:, 0]}).items():
        if m == 1:
            first, m = key, array.size
        elif array.size not in (1, m):
            allowed = f"must have one length: {first} has {m}"
            raise InputError(key, f"{array.size} members", allowed)
    numbers = {
        key: np.broadcast_to(arrays[key].ravel(), (m,))
        for key in entries
        if key in arrays
    }
    invalid = ~np.broadcast_to(np.isfinite(angles).all(axis=1), (m,))
    for key, array in numbers.items():
        invalid = invalid | ~entries[key].holds(array)
    drawing = replace_numbers(scene, numbers).drawing
    if drawing is not None:
        for bar in BAR_NAMES:
            invalid = invalid | (drawing.vector(bar) == 0.0)
    numbers = {key: np.where(invalid, np.nan, array) for key, array in numbers.items()}
    at = _list_commands(scene, numbers, angles, m)
    rates = {f"motion.{name}" for name in scene.motion.names[1:]}
    return Study(
        scene,
        {key: array for key, array in numbers.items() if key not in rates},
        invalid,
        at,
    )


def _list_commands(
    scene: Scene,
    numbers: Mapping[str, Array],
    angles: Array,
    m: int,
) -> Command:
    """Return the commands of all members, (m, n), from angles or strokes and numbers.

    Numbers that vary take the place of the scene's speed and acceleration.
    """
    angle = np.broadcast_to(angles, (m, angles.shape[1]))
    time = None
    if scene.motion.law is None:
        rates: Any = scene.motion.find_rates(angle)
    else:
        law: Any = command(scene)
        columns = law.speed, law.acceleration, law.time
        *rates, time = (np.broadcast_to(column, angle.shape) for column in columns)
    speed, acceleration = (
        numbers[f"motion.{name}"][:, None] if f"motion.{name}" in numbers else number
        for name, number in zip(scene.motion.names[1:], rates, strict=True)
    )
    if scene.motion.stroke is None:
        branch = np.full(angle.shape, scene.motion.branch, dtype=np.int8)
        return Command(angle, branch, speed, acceleration, scene.motion.bar, time)
    varied = replace_numbers(
        scene, {key: array[:, None] for key, array in numbers.items()}
    )
    return command_stroke(varied, angle, speed, acceleration)


def _read_members(key: str, value: Any, keys: list[str]) -> Array:
    """Return the array given for a key, (m,) or (1,); the angles as they are."""
    if key not in keys:
        raise refuse_key(key, value, keys)
    try:
        array = np.asarray(convert_to_unit(key, value, find_unit_of_key(key) or "1"))
    except ValueError:  # rows of different lengths
        raise InputError(key, "a ragged list", "must be an array of numbers") from None
    if array.dtype.kind not in "iuf" or array.size == 0:
        allowed = "must be an array of numbers, at least one"
        raise InputError(key, value, allowed)
    is_commanded = key in COMMAND_KEYS
    if array.ndim > 1 + is_commanded:
        shape = "(n,) or (m, n)" if is_commanded else "(m,)"
        raise InputError(key, f"shape {array.shape}", f"must have the shape {shape}")
    return array.astype(float)


def _read_angles(scene: Scene, arrays: Mapping[str, Array], key: str) -> Array:
    """Return the commanded angles of all members, (1, n) or (m, n)."""
    motion = scene.motion
    if key in arrays:
        if motion.law is not None:
            raise InputError(key, "angles", "are those of the scene's motion law")
        return np.atleast_2d(arrays[key])
    if motion.law is None and isinstance(motion.angle, FromLimit | None):
        allowed = "depends on the linkage; a study states it: (n,) or (m, n) angles"
        raise InputError(key, motion.angle, allowed)
    return np.atleast_2d(command(scene).stated[0])
