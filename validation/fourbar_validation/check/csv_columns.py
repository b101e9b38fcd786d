"""Columns of `fourbar analyze --csv` besides the quantities of a solution.

Each is judged as the quantity whose terms it is made of.
"""

from fourbar.errors import InputError
from fourbar.quantities import SPRING_NAME, UNITS, Array, find_derived
from fourbar.scene import Scene
from fourbar.show.acting import list_springs
from fourbar.show.derived import derive
from fourbar.solution import Solution

MADE_OF = {
    "shaking_force": "F12",
    "shaking_moment": "torque",
    "transmission": "theta_4",
    "length": "B",
    "force": "F12",
}
"""Quantity whose size and condition a column has; a spring's by what is measured."""
_OF_ANGLES = "follows from the angles, which are judged"
GROWING = dict.fromkeys(
    ("omega_3/omega_2", "omega_4/omega_2", "mechanical_advantage", "I13", "I24"),
    _OF_ANGLES,
)
"""Derived quantities that grow without bound where the linkage is well conditioned."""


def find_made_of(name: str, scene: Scene) -> str:
    """Return the quantity whose size and condition a column has: mostly itself."""
    if name in UNITS:
        return name
    of_spring = SPRING_NAME.fullmatch(name)
    kind = of_spring[2] if of_spring else name
    if kind in MADE_OF:
        return MADE_OF[kind]
    start = name[:2] if name[:2] in ("v_", "a_") else ""
    point = name.removeprefix(start)
    bar = next(each.bar for each in scene.points if each.name == point)
    return f"{start}G{bar}"


def list_names_of_points(scene: Scene) -> list[str]:
    """List the columns of the points of a scene."""
    return [
        f"{start}{point.name}" for start in ("", "v_", "a_") for point in scene.points
    ]


def compute_column(solution: Solution, name: str) -> Array | None:
    """Compute a column from O2, (n,) or (n, 2); None if its stage was not evaluated."""
    values: Array | None
    if name in UNITS:
        values = getattr(solution, name)
        return values
    if find_derived(name) is None:
        of_stage = {"v_": solution.velocity, "a_": solution.acceleration}
        stage = of_stage.get(name[:2], solution.points)
        return stage.get(name[2:] if name[:2] in of_stage else name)
    of_spring = SPRING_NAME.fullmatch(name)
    if of_spring and int(of_spring[1]) >= len(list_springs(solution.scene)):
        raise InputError("header", name, "does not exist in this scene")
    values = derive(solution, name)
    return values
