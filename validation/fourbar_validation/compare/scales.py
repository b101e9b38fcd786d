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

from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from fourbar.linkage import MOVING_BARS, Bar
from fourbar.quantities import LINE, OK, RATES, UNITS, Array
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
    """Sizes of the quantities of one solution of a scene."""

    def __init__(self, scene: Scene, solution: Solution) -> None:
        self.scene = state_from_pins(scene)
        self.solution = solution

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
        sums = {
            "m": self._sum_lengths,
            "rad/s": self._sum_turning,
            "m/s": self._sum_motion,
            "rad/s^2": self._sum_turning,
            "m/s^2": self._sum_motion,
            "N": lambda _: self._forces,
            "N m": lambda _: self._torques,
            "W": self._sum_powers,
        }
        with np.errstate(divide="ignore", invalid="ignore"):
            return sums[UNITS[quantity]](quantity)

    def _sum_lengths(self, _: str) -> Array:
        linkage = self.scene.linkage
        arms = sum(map(_compute_arm, linkage.moving)) + sum(self._drive_arms.values())
        return np.full(len(self.solution), sum_lengths(linkage) + arms)

    def _sum_turning(self, quantity: str) -> Array:
        """Sum the terms of a speed or an acceleration of a bar."""
        solution = self.solution
        _, a, b, c = self.scene.linkage.lengths
        accelerates = UNITS[quantity] == "rad/s^2"
        terms: Array = np.abs(solution.alpha_2 if accelerates else solution.omega_2)
        if quantity.endswith("_2"):
            return terms
        terms = a * terms
        if accelerates:
            w2, w3, w4 = (getattr(solution, f"omega_{k}") for k in MOVING_BARS)
            terms = a * w2 * w2 + terms + b * w3 * w3 + c * w4 * w4
        turning = b if quantity.endswith("_3") else c
        return terms / (turning * solution.condition)

    def _sum_motion(self, quantity: str) -> Array:
        """Sum the terms of a point's velocity or acceleration, bar by bar."""
        total = np.zeros(len(self.solution))
        for number in (2,) if quantity in OF_THE_INPUT else MOVING_BARS:
            bar = self.scene.linkage.bar(number)
            reach = bar.length + _compute_arm(bar)
            omega = getattr(self.solution, f"omega_{number}")
            if UNITS[quantity] == "m/s":
                total += (reach + self._drive_arms.get(number, 0.0)) * np.abs(omega)
            else:
                alpha = getattr(self.solution, f"alpha_{number}")
                total += reach * (omega * omega + np.abs(alpha))
        return total

    @property
    def _drive_arms(self) -> dict[int, float]:
        """Distances from the bars' first pins to where a force drives, m."""
        ends = () if self.scene.drive is None else self.scene.drive.ends
        return {end.bar: abs(end.distance) for _, end in ends}

    @cached_property
    def _forces(self) -> Array:
        """Magnitudes of all inertial and external forces, summed, as they drive, N.

        Couples are divided by their bar's length. A short lever of a force that drives
        makes it as many times larger.
        """
        scene = self.scene
        solution = self.solution
        linkage = scene.linkage
        total = np.zeros(len(solution))
        for number, bar in zip(MOVING_BARS, linkage.moving, strict=True):
            lever = 1.0 + _compute_arm(bar) / bar.length
            total += (
                lever * find_mass(bar) * magnitude(getattr(solution, f"a_G{number}"))
                + find_inertia(bar)
                * np.abs(getattr(solution, f"alpha_{number}"))
                / bar.length
            )
        for term in (*scene.loads, *scene.effects):
            total += find_size(term, linkage, solution)
        gain = 1.0
        if scene.drive is not None:
            short = find_most(linkage, scene.drive)
            gain = max(1.0, max(linkage.lengths) / short)
        return np.asarray(gain * total / solution.drive_condition)

    @property
    def _torques(self) -> Array:
        return max(self.scene.linkage.lengths[1:]) * self._forces

    def _sum_powers(self, _: str) -> Array:
        if self.scene.drive is not None:
            return self._forces * self._sum_motion("v_B")
        speed: Array = getattr(self.solution, f"omega_{self.scene.drive_bar}")
        return self._torques * np.abs(speed)


def scale_of(quantity: str, scene: Scene, solution: Solution, values: Array) -> Scale:
    """Compute size and N of one quantity at each position, (n,)."""
    return TermSizes(scene, solution).scale(quantity, values)


def _compute_arm(bar: Bar) -> float:
    """Compute the distance of a bar's mass centre from its first pin, m."""
    return abs(find_centre(bar)[0])


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
