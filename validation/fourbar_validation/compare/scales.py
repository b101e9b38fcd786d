"""Compute what errors are divided by, and how far the terms of a quantity cancel.

The size of a quantity is its largest magnitude over the well-conditioned positions; at
a position below that it is the magnitude there, or the forces that diverge near a limit
would excuse every other row. N is the sum of the absolute terms of its equation over
that size: the terms of a counterweighted linkage cancel, and two right derivations
agree to as many digits less. What is allowed is multiplied by max(1, N/K).

A wrong formula would choose its own size and N: an angle between bars 3 and 4 that is
too small, an acceleration that is too large. So both are taken of the engine's answer
too, and the stricter pair of error and allowance counts.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from fourbar.linkage import MOVING_BARS, Bar
from fourbar.quantities import COUPLE, LINE, OK, RATES, UNITS, Array
from fourbar.scene import Scene, StrokeOrigin
from fourbar.solution import Solution
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.bodies import pose, stack_components
from fourbar_validation.compare.effect_sizes import find_size
from fourbar_validation.compare.line import find_most, place_line
from fourbar_validation.compare.pins import (
    find_centre,
    find_inertia,
    find_mass,
    state_from_pins,
)
from fourbar_validation.compare.tolerance import (
    OF_THE_INPUT,
    WELL_CONDITIONED,
    K,
    Mask,
    magnitude,
    sum_lengths,
)

VANISHING = 2.0**-40
"""Part of the sum of its terms below which a quantity is taken to vanish. A double has
12 digits of it left there; the terms are what its error is relative to.
"""


class Scale(NamedTuple):
    """Size of a quantity at each position, and how far its terms cancel, (n,)."""

    size: Array
    """Divisor of the errors, in the unit of the quantity: its largest magnitude, or the
    sum of its terms where it vanishes; 0 where both vanish.
    """
    cancellation: Array
    """N, the sum of the terms over the size; 1 for angles, pure numbers and a quantity
    that vanishes.
    """
    vanishes: Mask
    """Positions at which the size is the sum of the terms, as they cancel."""

    @property
    def factor(self) -> Array:
        """Factor of the allowed error, max(1, N/K)."""
        return np.maximum(1.0, self.cancellation / K)

    @property
    def of_terms(self) -> Array:
        """Divisor of an identity: the sum of the terms where they cancel K-fold."""
        return np.where(self.cancellation > K, self.cancellation * self.size, self.size)

    def take_strictest(self, other: "Scale") -> "Scale":
        """Take the size and N that allow less of an absolute error."""
        ours = self.size * self.factor
        theirs = other.size * other.factor
        stricter = (theirs < ours) | np.isnan(ours)
        pairs = zip(self, other, strict=True)
        return Scale(*(np.where(stricter, theirs, ours) for ours, theirs in pairs))


class TermSizes:
    """Sizes of the quantities of one solution of a scene, each sum computed once."""

    def __init__(self, scene: Scene, solution: Solution) -> None:
        self.scene = state_from_pins(scene)
        self.solution = solution
        self._sums: dict[str, Array] = {}

    def scale(self, quantity: str, values: Array) -> Scale:
        """Compute the size of a quantity and how far its terms cancel, (n,)."""
        solution = self.solution
        n = len(solution)
        unit = UNITS[quantity]
        if unit in ("rad", "1"):
            return Scale(np.ones(n), np.ones(n), np.zeros(n, dtype=bool))
        size = magnitude(values)
        terms = self.sum_terms(quantity)
        well = (solution.condition >= WELL_CONDITIONED) & np.isfinite(size)
        # the poles of what the drive does are not where sin_mu vanishes
        if unit in ("N m", "W") or quantity == LINE.value:
            well &= solution.drive_condition >= WELL_CONDITIONED
        size, terms = (
            np.where(well, np.max(each, initial=0.0, where=well), each)
            for each in (size, terms)
        )
        vanishes = size < VANISHING * terms
        size = np.where(vanishes, terms, size)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            cancellation = np.where(size == 0.0, 1.0, terms / size)
        return Scale(size, cancellation, vanishes)

    def sum_terms(self, quantity: str) -> Array:
        """Sum the absolute terms of the equation of a quantity, (n,), in its unit.

        Raises KeyError for a quantity of a unit that has no such sum here: nothing is
        judged by another's scale.
        """
        unit = UNITS[quantity]
        if unit in _OF_EACH_BAR:
            key = quantity
        else:
            key = f"{unit} {_choose_bars(quantity)}"
        if key not in self._sums:
            with np.errstate(divide="ignore", invalid="ignore"):
                terms = TERMS_OF_UNIT[unit](quantity, self)
            self._sums[key] = np.asarray(terms, dtype=float)
        return self._sums[key]


def scale_of(quantity: str, scene: Scene, solution: Solution, values: Array) -> Scale:
    """Compute size and N of one quantity at each position, (n,)."""
    return TermSizes(scene, solution).scale(quantity, values)


_OF_EACH_BAR = ("rad/s", "rad/s^2")
"""Units of quantities whose sums of terms differ from bar to bar."""


def _sum_length_terms(_: str, sizes: TermSizes) -> Array:
    scene = sizes.scene
    arms = sum(map(_compute_arm, scene.linkage.moving)) + sum(
        _compute_drive_arms(scene).values()
    )
    return np.full(len(sizes.solution), sum_lengths(scene.linkage) + arms)


def _sum_speeds(quantity: str, sizes: TermSizes) -> Array:
    formulas = sizes.solution
    _, a, b, c = sizes.scene.linkage.lengths
    omega_2 = np.abs(formulas.omega_2)
    if quantity == "omega_2":
        return omega_2
    return a * omega_2 / ((b if quantity == "omega_3" else c) * formulas.condition)


def _sum_angular_accelerations(quantity: str, sizes: TermSizes) -> Array:
    formulas = sizes.solution
    _, a, b, c = sizes.scene.linkage.lengths
    w2 = formulas.omega_2
    w3 = formulas.omega_3
    w4 = formulas.omega_4
    a2 = formulas.alpha_2
    if quantity == "alpha_2":
        return np.abs(a2)
    terms = a * w2 * w2 + a * np.abs(a2) + b * w3 * w3 + c * w4 * w4
    return terms / ((b if quantity == "alpha_3" else c) * formulas.condition)


def _choose_bars(quantity: str) -> tuple[int, ...]:
    """Choose the bars whose motion is a term of a point's velocity or acceleration."""
    if quantity in OF_THE_INPUT:
        return (2,)
    return MOVING_BARS


def _sum_velocities(quantity: str, sizes: TermSizes) -> Array:
    total = np.zeros(len(sizes.solution))
    drive = _compute_drive_arms(sizes.scene)
    for number in _choose_bars(quantity):
        arm = _compute_reach(sizes.scene, number) + drive.get(number, 0.0)
        total += arm * np.abs(getattr(sizes.solution, f"omega_{number}"))
    return total


def _sum_accelerations(quantity: str, sizes: TermSizes) -> Array:
    total = np.zeros(len(sizes.solution))
    for number in _choose_bars(quantity):
        omega = getattr(sizes.solution, f"omega_{number}")
        alpha = getattr(sizes.solution, f"alpha_{number}")
        growth = omega * omega + np.abs(alpha)
        total += _compute_reach(sizes.scene, number) * growth
    return total


def _compute_reach(scene: Scene, number: int) -> float:
    """Compute the length of a bar and the distance of its mass centre, m."""
    bar = scene.linkage.bar(number)
    return bar.length + _compute_arm(bar)


def _sum_forces(_: str, sizes: TermSizes) -> Array:
    scene = sizes.scene
    formulas = sizes.solution
    gain = 1.0
    if scene.drive is not None:  # a short lever makes the force as many times larger
        short = find_most(scene.linkage, scene.drive)
        gain = max(1.0, max(scene.linkage.lengths) / short)
    return gain * _sum_force_terms(scene, formulas) / formulas.drive_condition


def _sum_torques(_: str, sizes: TermSizes) -> Array:
    longest = max(sizes.scene.linkage.lengths[1:])
    return longest * sizes.sum_terms(_A_FORCE)


def _sum_powers(_: str, sizes: TermSizes) -> Array:
    if sizes.scene.drive is not None:
        return sizes.sum_terms(_A_FORCE) * sizes.sum_terms(_A_VELOCITY)
    speed = getattr(sizes.solution, f"omega_{sizes.scene.drive_bar}")
    return np.asarray(sizes.sum_terms(COUPLE.value) * np.abs(speed))


_A_FORCE, _A_VELOCITY = "F12", "v_B"
"""Quantities of their units to which every bar contributes."""
TERMS_OF_UNIT: dict[str, Callable[[str, TermSizes], Array]] = {
    "m": _sum_length_terms,
    "rad/s": _sum_speeds,
    "m/s": _sum_velocities,
    "rad/s^2": _sum_angular_accelerations,
    "m/s^2": _sum_accelerations,
    "N": _sum_forces,
    "N m": _sum_torques,
    "W": _sum_powers,
}
"""Sum of the terms of a quantity's equation, by the quantity's unit."""


def _compute_drive_arms(scene: Scene) -> dict[int, float]:
    """Compute the distances from the bars' first pins to where a force drives, m."""
    ends = () if scene.drive is None else scene.drive.ends
    return {end.bar: abs(end.distance) for _, end in ends}


def _compute_arm(bar: Bar) -> float:
    """Compute the distance of a bar's mass centre from its first pin, m."""
    return abs(find_centre(bar)[0])


def _sum_force_terms(scene: Scene, formulas: Solution) -> Array:
    """Sum the magnitudes of all inertial and external forces, N.

    Couples are divided by their bar's length.
    """
    total = np.zeros(len(formulas))
    for number, bar in zip(MOVING_BARS, scene.linkage.moving, strict=True):
        acceleration = getattr(formulas, f"a_G{number}")
        alpha = getattr(formulas, f"alpha_{number}")
        lever = 1.0 + _compute_arm(bar) / bar.length
        total += (
            lever * find_mass(bar) * magnitude(acceleration)
            + find_inertia(bar) * np.abs(alpha) / bar.length
        )
    for term in (*scene.loads, *scene.effects):
        total += find_size(term, scene.linkage, formulas)
    return total


def make_reference(scene: Scene, answer: Answer) -> Solution | None:
    """Return an answer as a solution; None if it has no angles.

    Conditions follow from the sines between the answer's own angles, and stroke,
    direction, speed and leverage of a force that drives from its angles and speeds.
    """
    at = answer.at
    theta = answer.theta
    if at is None or theta is None:
        return None
    answered = answer.quantities
    known: dict[str, Any] = {name: answered[name] for name in UNITS if name in answered}
    known["theta_2"] = theta[2]
    n = len(theta[2])
    if at.speed is not None and not at.moves_stroke:  # else the engine finds them
        known[f"omega_{at.bar}"] = at.speed + np.zeros(n)
        known[f"alpha_{at.bar}"] = at.acceleration + np.zeros(n)
    motion = pose(scene.linkage, [*theta.values()])
    omega: dict[int, Any] = {bar: known.get(f"omega_{bar}") for bar in MOVING_BARS}
    moves = all(rate is not None for rate in omega.values())
    omega[1] = np.zeros(n)
    if moves and at.speed is not None:
        # velocities are the accelerations of a start from rest, each a rate of arms
        known |= motion._replace(alpha=omega).swing_points("v_")
    known["sin_mu"] = np.sin(theta[4] - theta[3])
    one, second = (theta[bar] for bar in theta if bar != at.bar)
    known["condition"] = np.abs(np.sin(second - one))
    drive = state_from_pins(scene).drive
    if drive is not None:
        line = place_line(motion, drive)
        known["drive_line"] = stack_components(line.unit)
        if drive.has_stroke:
            known["stroke"] = line.stroke
        if moves:
            known["stroke_speed"] = line.speed(omega)
        known.setdefault("drive_condition", line.condition)
        if isinstance(at.origin, StrokeOrigin):
            lever = line.lever
            at = at._replace(origin=at.origin._replace(condition=lever))
            known["condition"] = known["condition"] * lever
    elif "drive_condition" not in known:
        # an engine that knows how near friction is to jamming answers it
        one, second = (theta[bar] for bar in theta if bar != scene.drive_bar)
        # not of their difference: of an angle many turns away that has fewer digits
        # than its sine
        known["drive_condition"] = np.abs(
            np.sin(second) * np.cos(one) - np.cos(second) * np.sin(one)
        )
    codes = np.full(n, OK, dtype=np.uint8)
    return Solution(at=at, stated=scene, status_code=codes, branch=at.branch, **known)


def size_answer(scene: Scene, answered: Solution | None) -> TermSizes | None:
    """Return the sizes of an answer; None without the motion that the sums need."""
    if answered is None:
        return None
    if answered.at.speed is not None:
        if any(getattr(answered, name) is None for name in RATES):
            return None
        if any(getattr(answered, f"a_G{bar}") is None for bar in MOVING_BARS):
            theta, omega, alpha = (
                {bar: answered[f"{rate}_{bar}"] for bar in MOVING_BARS}
                for rate in ("theta", "omega", "alpha")
            )
            motion = pose(scene.linkage, [*theta.values()])
            moved = motion._replace(omega=omega, alpha=alpha).swing_points()
            centres: dict[str, Any] = {f"a_G{k}": moved[f"a_G{k}"] for k in MOVING_BARS}
            answered = replace(answered, **centres)
    return TermSizes(scene, answered)
