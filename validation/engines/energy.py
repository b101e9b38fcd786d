"""The energy method as a witness of the driving torque: power balance and virtual work instead of Newton-Euler."""

from decimal import Decimal

import numpy as np

from fourbar.dynamics import TOUCHING, Half, Triangle, driving_torque, half_angle, path, triangle
from fourbar.errors import LimitError
from fourbar.scene import Command, Scene
from validation.answer import Answer

UNSURE = 2.0**-20
"""Where a factor of Heron's formula is this small beside its terms, balls take the place of doubles."""
BITS = 320
"""More than the 60 digits in which a limit position is stated ..."""
LIMIT_DIGITS = 1e-55
"""... and what those digits leave of it."""


class EnergyMethod:
    """The driving torque from T_k theta_k' = J alpha_2 + J'/2 omega_2^2 - Q."""

    name = "energy-method"

    def answer(self, scene: Scene, command: Command) -> Answer:
        """Its torque; where the scene states no velocity, its angles alone."""
        at = surely(scene, command)
        way = path(scene.linkage, command.theta_2, np.asarray(command.branch, dtype=float), at)
        answer = Answer(
            self.name,
            "exact",
            assembled=(at.outer >= 0.0) & (at.inner >= 0.0),
            shared="the powers of loads and effects, with State.velocity and State.omega from which they are computed; "
            "the idea, not the code, of the triangle A, B, O4",
            own="positions and limits (python-flint decides near them), kinematic coefficients, equivalent inertia, "
            "virtual work",
        )
        answer.quantities["theta_3"] = np.angle(way.unit[3])
        answer.quantities["theta_4"] = np.angle(way.unit[4])
        if command.omega_2 is not None:
            terms = (*scene.loads, *scene.effects)
            try:
                torque = driving_torque(scene.linkage, way, command.omega_2, command.alpha_2, terms, scene.drive_bar)
            except LimitError as error:
                return Answer(self.name, "exact", refusal=str(error))
            # one number for all positions where nothing that moves has mass and nothing acts
            torque = np.where(np.isfinite(torque), torque, np.nan)
            answer.quantities["torque"] = np.broadcast_to(torque, command.theta_2.shape)
        return answer


def surely(scene: Scene, command: Command) -> Half:
    """Half angles and factors, in ball arithmetic where doubles leave too few digits to say whether the loop closes."""
    linkage, theta_2 = scene.linkage, command.theta_2
    shape = triangle(*linkage.lengths)
    at = half_angle(shape, linkage.ground_angle, theta_2)
    four_ad = 4.0 * shape.a * shape.d
    unsure = np.abs(at.outer) < UNSURE * (abs(shape.E1) + four_ad)
    unsure |= np.abs(at.inner) < UNSURE * (abs(shape.E2) + four_ad)
    unsure |= command.remainder is not None
    for index in np.flatnonzero(unsure):
        exact = in_balls(shape, linkage.ground_angle, float(theta_2[index]), command.remainder)
        for array, value in zip(at, exact, strict=True):
            array[index] = value
    return at


def in_balls(shape: Triangle, theta_1: float, theta_2: float, remainder: Decimal | None) -> Half:
    """One position, each number rounded once.

    Bars that miss each other by no more than the rounding of their lengths touch; not where the position
    is stated by its offset from the limit itself.
    """
    from flint import arb, ctx

    before, ctx.prec = ctx.prec, BITS
    try:
        d, a, b, c = (arb(length) for length in shape[:4])
        h = (arb(theta_2) + arb(str(remainder or 0)) - arb(theta_1)) / 2
        s, k = h.sin(), h.cos()
        squared = (d - a) ** 2 + 4 * a * d * s * s
        miss = arb(TOUCHING) if remainder is None else arb(LIMIT_DIGITS)
        touch = 2 * miss * (a + b + c + d) * squared.sqrt()
        outer, inner = (b + c) ** 2 - squared, squared - (b - c) ** 2
        return Half(*map(float, (s, k, *(0 if -touch < factor < 0 else factor for factor in (outer, inner)))))
    finally:
        ctx.prec = before
