"""Quantities by the names that the command line takes.

Sizes, components, and ratios and differences of any two have names. `torque` and
`omega_4` are numbers, `F12` and `v_B` the sizes of vectors, `F12_x` a component, `A` a
place with two coordinates, `omega_4/omega_2` a ratio, `theta_3-theta_2` a difference,
`F_jaw/F_handle` the ratio of the forces along the paths of two points.
"""

import re
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fourbar.errors import (
    ELSEWHERE,
    InputError,
    list_allowed,
    names_other_mechanism,
)
from fourbar.quantities import STAGE_OF, Array, find_derived
from fourbar.scene import LimitOrigin, Scene, command_at
from fourbar.show.derived import derive, list_derived_names
from fourbar.solution import (
    Conversion,
    Solution,
    compute_times,
    find_unit_in,
    find_unit_of_quantity,
    is_scalar,
    unwrap,
)
from fourbar.solving import solve

COLUMN_AXES = {"_x": 0, "_y": 1}
_HEADING_MARKS = re.compile(r"\s*\[[^\]]*\]$|\|")
"""Marks of a heading of the CSV besides the name: its unit, and bars of a size."""


class Column(NamedTuple):
    """Column of a table: its name, SI unit and values."""

    name: str
    unit: str
    values: Array
    """(n,)."""
    divisor: str = "1"
    """SI unit of what a ratio is divided by."""
    size: Array | float = 0.0
    """Size of which the rounding of a value counts as zero: that of the vector of a
    component, (n,), and 1 of a pure number.
    """

    def convert(self, units: Conversion) -> tuple[str, Array]:
        """Return the unit that the column is shown in, and the values in it.

        The unit is empty for a pure number.
        """
        above, factor = find_unit_in(self.unit, units)
        below, divisor = find_unit_in(self.divisor, units)
        values = self.values * (factor / divisor)
        if above == below:
            return "", values
        if below == "1":
            return above, values
        if " " in below or "/" in below:
            below = f"({below})"
        return f"{above}/{below}", values


def choose_columns(solution: Solution, names: str) -> list[Column]:
    """Read the columns of a list like "theta_2,torque,F12,omega_4/omega_2".

    Headings of the CSV may stand for the names: "torque [N m]", "|F12|".

    Raises InputError for a name that no quantity has, and for one that was not
    evaluated.
    """
    columns: list[Column] = []
    for word in names.split(","):
        name = _HEADING_MARKS.sub("", word.strip())
        if _is_place(solution, name):
            columns += [read_column(solution, f"{name}{axis}") for axis in COLUMN_AXES]
        else:
            columns.append(read_column(solution, name))
    return columns


def read_column(solution: Solution, name: str) -> Column:
    """Read one column by its name; InputError as of `choose_columns`."""
    numbers = _list_numbers(solution)
    if name in numbers:
        return _read_number(solution, name)
    points = ("A", "B", *solution.points)
    # names of the forces along the paths of points
    velocities = {f"F_{point}": f"v_{point}" for point in points}
    # the sign of a difference may also stand in the name of a point
    for sign in re.finditer("-", name):
        parts = name[: sign.start()].strip(), name[sign.end() :].strip()
        named = map(str.strip, "/".join(parts).split("/"))
        if {*numbers, *velocities}.issuperset(named):
            return _subtract(name, *(read_column(solution, part) for part in parts))
    above, divides, below = map(str.strip, name.partition("/"))
    if not divides:
        raise _refuse_name(solution, name)
    if above in velocities and below in velocities:
        # by virtual work the forces are as the speeds, the other way round
        above, below = velocities[below], velocities[above]
    of = solution
    if _is_velocity(above) and _is_velocity(below):
        of = _solve_at_unit_speed(solution)
    # the name of a force alone is no column, whatever it is divided by
    denominator = _read_number(of, below)
    numerator = _read_number(of, above)
    with np.errstate(all="ignore"):
        ratio = numerator.values / denominator.values
    ratio = np.where(np.isfinite(ratio), ratio, np.nan)
    return Column(name, numerator.unit, ratio, denominator.unit)


def _list_numbers(solution: Solution) -> dict[str, tuple[str, int | None]]:
    """List the numbers of each position: the quantity of each, and its component.

    The component is None for a quantity itself, of a vector its size.
    """
    numbers: dict[str, tuple[str, int | None]] = {"time": ("time", None)}
    for name in list_column_quantities(solution):
        numbers[name] = name, None
        if not is_scalar(name):
            for ending, axis in COLUMN_AXES.items():
                numbers[f"{name}{ending}"] = name, axis
    return numbers


def _subtract(name: str, first: Column, second: Column) -> Column:
    """Return the difference of two columns of one unit.

    A difference of angles is in (-pi, pi] at the first position, and continuous from
    there.
    """
    if (first.unit, first.divisor) != (second.unit, second.divisor):
        raise InputError(
            "--columns",
            name,
            f"{first.name} is in {first.convert({})[0] or '1'} and {second.name} in"
            f" {second.convert({})[0] or '1'}: a difference is of two columns of one"
            " kind",
        )
    values = first.values - second.values
    if (first.unit, first.divisor) == ("rad", "1"):
        values = np.angle(np.exp(1j * values))
        unwrap(values)
    return first._replace(name=name, values=values)


def _read_number(solution: Solution, name: str) -> Column:
    """Read a number of each position."""
    values: Array | None
    if name == "time":
        values = solution.time
        if values is None:
            values = compute_times(solution.scene, solution.at)
        if values is None:
            none = "passed at no one speed, without a law, the positions have no time"
            raise InputError("--columns", name, none)
        return Column(name, "s", values)
    numbers = _list_numbers(solution)
    if name not in numbers:
        raise _refuse_name(solution, name)
    stem, axis = numbers[name]
    values = derive(solution, stem)
    if values is None:
        raise _ask_for_speed(solution.scene, name)
    unit = find_unit_of_quantity(stem)
    if is_scalar(stem):
        return Column(name, unit, values, size=float(unit == "1"))
    size = np.hypot(values[..., 0], values[..., 1])
    if axis is not None:
        return Column(name, unit, values[..., axis], size=size)
    if _is_place(solution, stem):
        raise InputError("--columns", name, f"is a place: {name}_x or {name}_y")
    return Column(name, unit, size)


def _refuse_name(solution: Solution, name: str) -> InputError:
    """Make the error of a name that no column has, or none without a speed."""
    scene = solution.scene
    with_speed = solution
    if solution.at.speed is None:
        with_speed = solve(replace(scene, motion=scene.motion.replace(speed=0.0)))
    if names_other_mechanism(re.sub("_[xy]$", "", name)):
        return InputError("--columns", name, f"unknown; {ELSEWHERE}")
    numbers = _list_numbers(with_speed)
    if name in numbers:
        return _ask_for_speed(scene, name)
    reaction = re.sub(r"^F(\d)(\d)", r"F\2\1", name)
    if reaction in numbers:
        return InputError("--columns", name, f"is the reaction of {reaction}: minus it")
    allowed = list_allowed(name, ["time", *list_column_quantities(with_speed)])
    return InputError(
        "--columns",
        name,
        f"{allowed}; F12_x is a component, omega_4/omega_2 a ratio, theta_3-theta_2 a"
        " difference, F_P/F_Q a ratio of forces along paths",
    )


def list_column_quantities(solution: Solution) -> list[str]:
    """List the quantities of a solution, those of its points and derived ones too."""
    names = [name for name in solution.evaluated() if name != "time"]
    points = [
        f"{start}{name}" for start in ("", "v_", "a_") for name in solution.points
    ]
    for name in list_derived_names(solution):
        quantity = find_derived(name)
        if quantity and (quantity.stage != "force" or solution.F12 is not None):
            names.append(name)
    return names + points


def _is_place(solution: Solution, name: str) -> bool:
    known = name in list_column_quantities(solution)
    return known and not is_scalar(name) and find_unit_of_quantity(name) == "m"


def _is_velocity(name: str) -> bool:
    """Return True for a quantity that grows with the speed of the command."""
    return name.startswith("v_") or STAGE_OF.get(name) == "velocity"


def explain_static(scene: Scene) -> str:
    """Say what asks for forces where a scene states positions alone."""
    motion = scene.motion
    gives = '"0 m/s" gives the static force'
    if motion.stroke is None:
        gives = '"0 rad/s" gives the static torque'
    return f"{motion.names[1]} = {gives} and pin forces"


def _ask_for_speed(scene: Scene, name: str) -> InputError:
    return InputError(
        "--columns",
        name,
        f"needs a speed, and the scene states none; {explain_static(scene)}",
    )


def _solve_at_unit_speed(solution: Solution) -> Solution:
    """Solve the same positions with speed 1 of the command.

    Ratios of speeds exist at rest too. A released motion commands bar 2.
    """
    scene = solution.scene
    at = solution.at
    if at.moves_stroke:
        motion = scene.motion.replace(speed=1.0, acceleration=0.0)
        at = command_at(replace(scene, motion=motion), at.stated[0])
    else:
        origin = at.origin if isinstance(at.origin, LimitOrigin) else None
        at = at._replace(speed=1.0, acceleration=0.0, origin=origin)
    return solve(scene, "velocity", at=at)
