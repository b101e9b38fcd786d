"""Quantities that follow from those of a solution.

These are shaking, ratios of speeds, instant centres. They are
declared in `fourbar.quantities.DERIVED_QUANTITIES`; tables, CSV, plots and the
workbench show them.
"""

from collections.abc import Callable

import numpy as np

from fourbar.formulas.arithmetic import cross
from fourbar.formulas.path import NO_DIGIT_LEFT
from fourbar.quantities import DERIVED_NAMES, Array
from fourbar.show.duty import read_drive_demand, shaking_force, shaking_moment
from fourbar.solution import Conversion, Solution, find_unit_in, shift_to_drawing
from fourbar.studies.points import instant_centres


def derive(solution: Solution, name: str) -> Array | None:
    """Compute a quantity of `DERIVED`, (n,) or (n, 2).

    It is None if its stage was not evaluated. NaN marks a position where it has no
    value: a ratio at a dead centre of bar 2, a centre at infinity.
    """
    if (
        DERIVED_NAMES[name].stage == "force"
        and read_drive_demand(solution).values is None
    ):
        return None
    with np.errstate(all="ignore"):
        values = _COMPUTE[name](solution)
        return np.asarray(np.where(np.isfinite(values), values, np.nan))


def _compute_transmission(solution: Solution) -> Array:
    """Return the acute angle between coupler and output.

    Both its sine and its cosine keep their digits.
    """
    cosine = np.cos(solution.theta_4 - solution.theta_3)
    return np.asarray(np.arctan2(np.abs(solution.sin_mu), np.abs(cosine)))


def _compute_ratio(solution: Solution, bar: int) -> Array:
    """Compute omega_k/omega_2: from the speeds, and where bar 2 has none from the pins.

    omega_3/omega_2 = -[A x (B - O4)] / [(B - A) x (B - O4)],
    omega_4/omega_2 = [A x (B - A)] / [(B - O4) x (B - A)].
    """
    A, B = (vector[..., 0] + 1j * vector[..., 1] for vector in (solution.A, solution.B))
    assert solution.ground is not None
    length, angle = solution.ground
    coupler = B - A
    output = B - length * np.exp(1j * np.asarray(angle))
    by_pins = {
        3: -cross(A, output) / cross(coupler, output),
        4: cross(A, coupler) / cross(output, coupler),
    }[bar]
    if solution.omega_2 is None:
        return np.asarray(by_pins)
    speed = getattr(solution, f"omega_{bar}")
    moves = solution.omega_2 != 0.0
    return np.asarray(np.where(moves, speed / solution.omega_2, by_pins))


def _locate_centre(solution: Solution, bars: tuple[int, int]) -> Array:
    """Return an instant centre.

    It is NaN where its two lines are parallel within rounding.
    """
    centre = instant_centres(solution)[bars]
    point = np.stack(centre.point, axis=-1)
    point = shift_to_drawing(solution, point)
    return np.where(np.abs(centre.w)[..., None] <= NO_DIGIT_LEFT, np.nan, point)


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
    for name, quantity in DERIVED_NAMES.items():
        derived = derive(solution, name)
        factor = find_unit_in(quantity.unit, units)[1]
        values[name] = None if derived is None else factor * derived
    return values
