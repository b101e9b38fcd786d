"""The energy method with all the digits that a position beside a limit needs: its forward error is held too."""

from decimal import Decimal

import numpy as np
from numpy.typing import NDArray

from fourbar.dynamics import TOUCHING, Half, Triangle, driving_torque, half_angle, path, triangle
from fourbar.scene import Command, Scene
from fourbar.state import Array

UNSURE = 2.0**-20
"""Where a factor of Heron's formula is this small beside its terms, balls take the place of doubles."""
BITS = 320
"""More than the 60 digits in which a limit position is stated ..."""
LIMIT_DIGITS = 1e-55
"""... and what those digits leave of it."""


def by_energy(scene: Scene, command: Command) -> tuple[NDArray[np.bool_], dict[str, Array]]:
    """Where the loop closes, (n,), and theta_3, theta_4, and with velocities the torque, from
    T_k theta_k' = J alpha_2 + J'/2 omega_2^2 - Q.
    """
    at = surely(scene, command)
    way = path(scene.linkage, command.theta_2, np.asarray(command.branch, dtype=float), at)
    found = {"theta_3": np.angle(way.unit[3]), "theta_4": np.angle(way.unit[4])}
    if command.omega_2 is not None:
        terms = (*scene.loads, *scene.effects)
        torque = driving_torque(scene.linkage, way, command.omega_2, command.alpha_2, terms, scene.drive_bar)
        # one number for all positions where nothing that moves has mass and nothing acts
        found["torque"] = np.broadcast_to(np.where(np.isfinite(torque), torque, np.nan), command.theta_2.shape)
    return (at.outer >= 0.0) & (at.inner >= 0.0), found


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
