"""Sensitivities in 320-bit arithmetic, and the error that rounding makes.

The predicted error of a result is

    predicted = eps (R sum_i w_i |dy/dx_i| + reach sum_j |dy/dz_j|),

the first-order change of a result y, at this very position and for this very quantity,
when every stored input x_i (lengths, angles, masses, loads, the command) moves in its
last digit, and when the loop opens with the speed and the acceleration, and the bars
get the couples, that rounding leaves in an engine whose lever arms are differences of
coordinates as long as `reach` (z_j, one rounding of them). Where the first order of a
torque vanishes, the product of two first orders is what remains: the error of a force
times that of its lever arm.

The prediction replaces K eps/condition where no power of a sine is the right law: near
change points, where a torque cancels, and for forces near a toggle, which a law in s^2
would excuse too much.
"""

import cmath
import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from fourbar.effects import LinearDrive
from fourbar.linkage import MOVING_BARS, FourBar
from fourbar.quantities import COUPLE, LINE, PIN_FORCES, STAGE_OF, VECTORS, Array
from fourbar.scene import Command, Scene, with_signs
from fourbar_validation.compare.pins import find_centre, find_inertia, find_mass
from fourbar_validation.compare.tolerance import (
    EPS,
    OF_THE_INPUT,
    RANDOM_WALK,
    TOUCHING_MARGIN,
    Mask,
    mark_touching,
    sum_lengths,
)
from fourbar_validation.engines.description import Sizes, list_speeds

DRIVE_QUANTITIES = (COUPLE.value, LINE.value)
"""Quantities of a drive, of which a scene has one."""
LARGEST_FIRST_ORDER = 0.1
"""Limit of first-order prediction. Angles uncertain by this part of the sine that
everything divides by leave speeds, forces and the torque undetermined; the torque's own
first order can cancel.
"""


def predict_from_data(
    scene: Scene,
    command: Command,
    quantity: str,
    mask: Mask | None = None,
    *,
    reach: float = 0.0,
    carried: float = 0.0,
) -> Array:
    """Predict the absolute error of a quantity at each position, (n,).

    As it stands it is that of a derivation that works in angles and lengths themselves.
    NaN where the loop does not close. Infinite at a singular position, where the
    equations have no answer, and where rounding decides whether the loop closes; but
    there angles and places are bounded by how far the loop opens, and what the input
    alone decides loses nothing.

    Parameters
    ----------
    mask : chooses positions.
    reach : length of the coordinates of which lever arms are differences, m.
    carried : moment of inertia, kg m^2, that is accelerated as the fastest bar is, and
        back again.
    """
    n = len(command.theta_2)
    rates = list_speeds(command)
    command = with_signs(scene.linkage, command)
    errors = np.full(n, np.nan)
    touching = mark_touching(scene.linkage, command.theta_2)
    if quantity in OF_THE_INPUT:
        touching[:] = False
    for i in range(n) if mask is None else np.flatnonzero(mask).tolist():
        theta_2 = float(command.theta_2[i])
        branch = int(command.branch[i])
        moved = _compute_sensitivity(
            scene, theta_2, branch, *(float(rate[i]) for rate in rates)
        )
        if touching[i]:
            errors[i] = _bound_touching(scene.linkage, theta_2, quantity)
        if moved is None:
            continue
        error = moved.first_order(quantity, reach, carried)
        errors[i] = min(error, errors[i]) if touching[i] else error
        if quantity in DRIVE_QUANTITIES:
            turned = max(moved.first_order(f"theta_{bar}", reach) for bar in (3, 4))
            pulled = max(
                moved.first_order(force, reach, carried) for force in PIN_FORCES
            )
            lever = sum_lengths(scene.linkage) if quantity == COUPLE.value else 1.0
            errors[i] += pulled * turned * lever
    return errors


def predict_in_world_axes(scene: Scene, *asked: Any) -> Array:
    """Predict for an engine that differences points in world axes.

    Pinocchio's frame Jacobians do so.
    """
    return predict_from_data(scene, *asked, reach=sum_lengths(scene.linkage))


def predict_for_free_bodies(scene: Scene, *asked: Any) -> Array:
    """Predict for bodies in angles and lengths, with the line of a cylinder by points.

    The direction of that line is the difference of its ends in world axes, and its
    moments on two bars cancel where it nearly passes their common pin.
    """
    if isinstance(scene.drive, LinearDrive):
        return predict_in_world_axes(scene, *asked)
    return predict_from_data(scene, *asked)


def predict_about_mass_centre(scene: Scene, *asked: Any) -> Array:
    """Predict for an engine that moves a tree about the common mass centre.

    MuJoCo moves it so; the mass centre is that of all bodies. Every bar is accelerated
    with the first of its tree and back again by its own joint, and its inertia leaves
    the rounding of both in the joints' couples.
    """
    bars = scene.linkage.moving
    furthest = max(abs(find_centre(bar)[0]) for bar in bars)
    reach = sum_lengths(scene.linkage) + furthest
    inertias = (max(find_mass(bar) * reach * reach, find_inertia(bar)) for bar in bars)
    return predict_from_data(scene, *asked, reach=reach, carried=max(inertias))


def predict_for_any_method(*asked: Any) -> Array:
    """Predict for an engine whose method nobody states: the worst of those above.

    Newton and Euler with moments about the mass centres are right, and lose the digits
    that a centre far from its pins takes.
    """
    methods = (predict_from_data, predict_in_world_axes, predict_about_mass_centre)
    return np.asarray(np.maximum.reduce([predict(*asked) for predict in methods]))


def _bound_touching(
    linkage: FourBar,
    theta_2: float,
    quantity: str,
) -> float:
    """Bound an error where rounding decides whether the loop closes; inf if unbounded.

    The diagonal e from A to O4 and bars 3 and 4 are a triangle that misses a line by h:
    e = b + c - h, or |b - c| + h. Bar 3 is off the diagonal by phi_3,

        sin^2(phi_3/2) = (c^2 - (e - b)^2)/(4 b e) = h (2 c - h)/(4 b e)

    (the cosine in its place where bar 3 points away from O4), so that phi_3 = sqrt(2 c
    h/(b e)) at the most, and bar 4 by the same with b and c exchanged. The diagonal
    itself turns by h/e. Places, the sine and the condition follow from both angles;
    their rates and the forces grow without bound.
    """
    _, a, b, c = linkage.lengths
    ground = cmath.rect(linkage.ground, linkage.ground_angle)
    e = abs(ground - cmath.rect(a, theta_2))
    if e == 0.0:
        return math.inf
    missed = TOUCHING_MARGIN * sum_lengths(linkage)
    of_3 = math.sqrt(2.0 * c * missed / (b * e)) + missed / e
    of_4 = math.sqrt(2.0 * b * missed / (c * e)) + missed / e
    bounds = {"theta_3": of_3, "theta_4": of_4, "B": c * of_4}
    bounds |= dict.fromkeys(("sin_mu", "condition"), of_3 + of_4)
    for bar, turned in ((3, of_3), (4, of_4)):
        distance, _ = find_centre(linkage.bar(bar))
        bounds[f"G{bar}"] = abs(distance) * turned
    return bounds.get(quantity, math.inf)


class Sensitivities(NamedTuple):
    """Change of each output at one position, by cause."""

    data: Sizes
    """Sensitivity to the data, |y| + sum w_i |dy/dx_i|. For the condition it is its
    value.
    """
    loop: Sizes
    """Change by a loop that opens at its fastest bar's speed and acceleration times
    1 m, and by couples on the bars of the strongest pin force times 1 m.
    """
    carried: Sizes
    """Change by couples on the bars: 1 kg m^2 at the fastest bar's acceleration."""

    def first_order(
        self,
        name: str,
        reach: float,
        carried: float = 0.0,
    ) -> float:
        """Return the predicted error of an output; of a vector, the norm.

        The error is infinite if the output has no prediction, NaN if the input alone
        decides it: where the linkage is singular only angles have a value.
        """
        missing = math.inf
        if name in OF_THE_INPUT:
            missing = math.nan
        elif STAGE_OF.get(name) != "position":
            of_angle = RANDOM_WALK * EPS * self.data["theta_4"]
            if of_angle >= LARGEST_FIRST_ORDER * self.data["condition"]:
                return math.inf
        parts = []
        name = "sin_mu" if name == "condition" else name
        for axis in ("_x", "_y") if name in VECTORS else ("",):
            component = name + axis
            part = RANDOM_WALK * self.data.get(component, missing)
            part += reach * self.loop.get(component, 0.0)
            part += carried * self.carried.get(component, 0.0)
            parts.append(part)
        return EPS * math.hypot(*parts)


@lru_cache(maxsize=8192)
def _compute_sensitivity(
    scene: Scene,
    theta_2: float,
    branch: int,
    omega_2: float,
    alpha_2: float,
) -> Sensitivities | None:
    """Compute the sensitivities at one position; None where the loop does not close."""
    from flint import acb

    from fourbar_validation.engines.balls import Responses, make_balls

    exact = make_balls(scene, theta_2, omega_2=omega_2, alpha_2=alpha_2)
    responses = Responses(scene, branch, exact)
    base = responses.base
    if base is None:
        return None
    step = responses.step
    data = {}
    for name, value in base.items():
        data[name] = 1.0 if name.startswith("theta") else abs(float(value.mid()))
    stored = {name: float(value) for name, value in exact.items()}
    responses.add_of_inputs(data, _weigh_inputs(stored))
    data["condition"] = float(base["condition"].mid())
    loop: Sizes = {}
    carried: Sizes = {}
    if "omega_3" in base:
        fastest = max(abs(base[f"omega_{bar}"]) for bar in MOVING_BARS)
        hardest = max(abs(base[f"alpha_{bar}"]) for bar in MOVING_BARS)
        hardest += fastest * fastest
        for name in VECTORS:  # points of the bars, by their places in world axes
            if name.startswith("a_"):
                loop[f"{name}_x"] = loop[f"{name}_y"] = float(hardest)
        for name, most in (("slip", fastest), ("jerk", hardest)):
            for direction in (acb(1), acb(0, 1)):
                responses.add(loop, **{name: most * step * direction})
    drive = next((name for name in DRIVE_QUANTITIES if name in base), None)
    if drive is not None:
        strongest = max(
            abs(base[name + axis]) for name in PIN_FORCES for axis in ("_x", "_y")
        )
        # the couple on a bar, or the force that drives, is rounded too
        lever = sum_lengths(scene.linkage) if drive == COUPLE.value else 1.0
        strongest += abs(base[drive]) / lever
        for bar in MOVING_BARS:
            for total, size in ((loop, strongest), (carried, hardest)):
                responses.add(total, **{f"couple_{bar}": size * step})
    return Sensitivities(data, loop, carried)


def _weigh_inputs(stored: Sizes) -> Sizes:
    """Return the size of each stored input, of which one rounding is a part of EPS.

    A chain of bars meets O4 as its longest bar is rounded, whatever the ground's
    length.
    """
    longest = max(stored[name] for name in ("d", "a", "b", "c"))
    weights = {name: abs(value) for name, value in stored.items() if value != 0.0}
    weights["d"] = longest
    # theta_2 - theta_1 is rounded as the larger of them is
    weights["theta_1"] = max(
        abs(stored["theta_1"]), abs(stored["theta_2"]), longest / stored["d"]
    )
    weights["theta_2"] = max(abs(stored["theta_2"]), 1.0)
    return weights
