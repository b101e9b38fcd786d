"""Quantities that follow from those of a solution.

Shaking, ratios of speeds, instant centres, and lengths and forces of springs are
computed here. Tables, CSV, plots and the workbench show what `fourbar.quantities`
declares of them.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from fourbar.formulas.arithmetic import cross
from fourbar.formulas.path import NO_DIGIT_LEFT
from fourbar.linkage import MOVING_BARS
from fourbar.quantities import (
    DERIVED_NAMES,
    SPRING_NAME,
    SPRING_QUANTITIES,
    Array,
    find_derived,
)
from fourbar.scene import Scene
from fourbar.show.acting import list_springs, measure_end_distance
from fourbar.show.duty import shaking_force, shaking_moment
from fourbar.solution import (
    Conversion,
    Solution,
    find_unit_in,
    find_unit_of_quantity,
    find_values,
    shift_to_drawing,
    where_assembled,
)
from fourbar.studies.points import instant_centres


def derive(solution: Solution, name: str) -> Any:
    """Compute a quantity of a solution, (n,) or (n, 2); None without its stage.

    NaN marks a position where the quantity has no value: a ratio at a dead centre of
    bar 2, a centre at infinity.
    """
    quantity = find_derived(name)
    if quantity is None:
        return find_values(solution, name)
    if quantity.stage == "force" and solution.F12 is None:
        return None
    with np.errstate(all="ignore"):
        of_spring = SPRING_NAME.fullmatch(name)
        if of_spring is None:
            values = _COMPUTE[name](solution)
        else:
            spring = list_springs(solution.scene)[int(of_spring[1])]
            distance = measure_end_distance(solution.scene, spring, solution.at)
            values = where_assembled(solution, distance)
            if of_spring[2] != "length":
                values = np.asarray(spring.pull(values))
        return np.where(np.isfinite(values), values, np.nan)


def list_point_names(scene: Scene) -> list[str]:
    """List A, B, the mass centres of bars that have mass, and the scene's points."""
    massive = [bar for bar in MOVING_BARS if scene.linkage.bar(bar).mass > 0.0]
    points = [point.name for point in scene.points]
    return ["A", "B", *(f"G{bar}" for bar in massive), *points]


def list_derived_names(solution: Solution) -> list[str]:
    """List the derived quantities of a solution, those of its springs last."""
    count = 0 if solution.scene is None else len(list_springs(solution.scene))
    springs = [
        f"spring_{number}_{quantity.name}"
        for number in range(count)
        for quantity in SPRING_QUANTITIES
    ]
    return [*DERIVED_NAMES, *springs]


def _compute_transmission(solution: Solution) -> Array:
    """Return the acute angle between coupler and output, rad.

    Sine and cosine of the angle both keep their digits.
    """
    cosine = np.cos(solution.theta_4 - solution.theta_3)
    return np.arctan2(np.abs(solution.sin_mu), np.abs(cosine))


def _compute_ratio(solution: Solution, bar: int) -> Array:
    """Compute omega_k/omega_2: from the speeds, and where bar 2 has none from the pins.

    omega_3/omega_2 = -[A x (B - O4)] / [(B - A) x (B - O4)],
    omega_4/omega_2 = [A x (B - A)] / [(B - O4) x (B - A)].
    """
    linkage = solution.stated.linkage
    A = solution.A[..., 0] + 1j * solution.A[..., 1]
    B = solution.B[..., 0] + 1j * solution.B[..., 1]
    O4 = linkage.ground * np.exp(1j * np.asarray(linkage.ground_angle))
    if bar == 3:
        by_pins = -cross(A, B - O4) / cross(B - A, B - O4)
    else:
        by_pins = cross(A, B - A) / cross(B - O4, B - A)
    if solution.omega_2 is None:
        return np.asarray(by_pins)
    speed = getattr(solution, f"omega_{bar}")
    moves = solution.omega_2 != 0.0
    return np.asarray(np.where(moves, speed / solution.omega_2, by_pins))


def _locate_centre(solution: Solution, bars: tuple[int, int]) -> Array:
    """Return an instant centre; NaN where its lines are parallel within rounding."""
    centre = instant_centres(solution)[bars]
    point = shift_to_drawing(solution, np.stack(centre.point, axis=-1))
    parallel = np.abs(centre.w) <= NO_DIGIT_LEFT
    return np.where(parallel[..., None], np.nan, point)


_COMPUTE: dict[str, Callable[[Solution], Array]] = {
    "shaking_force": shaking_force,
    "shaking_moment": shaking_moment,
    "transmission": _compute_transmission,
    "omega_3/omega_2": lambda solution: _compute_ratio(solution, 3),
    "omega_4/omega_2": lambda solution: _compute_ratio(solution, 4),
    "mechanical_advantage": lambda solution: 1.0 / _compute_ratio(solution, 4),
    "I13": lambda solution: _locate_centre(solution, (1, 3)),
    "I24": lambda solution: _locate_centre(solution, (2, 4)),
}


def list_derived(solution: Solution, units: Conversion) -> dict[str, Array | None]:
    """List every derived quantity by name, in the given units."""
    values: dict[str, Array | None] = {}
    for name in list_derived_names(solution):
        derived = derive(solution, name)
        _, factor = find_unit_in(find_unit_of_quantity(name), units)
        values[name] = None if derived is None else factor * derived
    return values
