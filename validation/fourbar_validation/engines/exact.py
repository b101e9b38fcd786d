"""Solve the scene in 320-bit ball arithmetic as an engine.

The loop is a quadratic, and all thirteen equations are solved.
"""

import math
from typing import Any

import numpy as np

from fourbar.formulas.many_digits import WORKING_DIGITS
from fourbar.linkage import FourBar
from fourbar.quantities import VECTORS, Array
from fourbar.scene import Command, Scene
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.compare import COMPARED_QUANTITIES
from fourbar_validation.compare.tolerance import EPS, RANDOM_WALK
from fourbar_validation.engines.description import (
    SHARED_BY_EXACT_ENGINES,
    find_unknown,
    list_speeds,
)
from fourbar_validation.engines.loop import make_blank

BALL_ARITHMETIC = "ball-arithmetic"


def find_refusal(scene: Scene) -> str:
    """Give the reason to refuse a scene, if any."""
    return find_unknown(scene, lambda effect: effect.in_balls)


class BallArithmetic:
    """Every compared quantity at each position, rounded once from 320 bits."""

    name = BALL_ARITHMETIC

    def answer(self, scene: Scene, command: Command) -> Answer:
        """Answer, or refuse by naming an effect that it does not know."""
        from flint import arb

        from fourbar_validation.engines.balls import compute_outputs, make_balls

        if reason := find_refusal(scene):
            return Answer(BALL_ARITHMETIC, "exact", refusal=reason)
        names = [
            q
            for q in COMPARED_QUANTITIES
            if command.omega_2 is not None or q.startswith("theta")
        ]
        out = make_blank(len(command.theta_2), names)
        assembled = np.zeros(len(command.theta_2), dtype=bool)
        rates = list_speeds(command)
        stated = make_balls(scene, 0.0)
        remainder = arb(0 if command.remainder is None else command.remainder)
        for i, (branch, *motion) in enumerate(
            zip(command.branch, command.theta_2, *rates, strict=True)
        ):
            theta_2, omega, alpha = (arb(float(number)) for number in motion)
            moved = {"theta_2": theta_2 + remainder, "omega_2": omega, "alpha_2": alpha}
            values = compute_outputs(scene, int(branch), stated | moved)
            if values is None:
                continue
            assembled[i] = True
            for name, array in out.items():
                axes = ("_x", "_y") if name in VECTORS else ("",)
                array[i] = np.squeeze([_to_double(values.get(name + x)) for x in axes])
        return Answer(
            BALL_ARITHMETIC,
            "exact",
            at=command,
            assembled=assembled,
            quantities=out,
            shared=SHARED_BY_EXACT_ENGINES,
            own=(
                "closure as a complex quadratic, linear speeds and accelerations,"
                " thirteen Newton-Euler equations"
            ),
        )


def compute_exact_sines(linkage: FourBar, command: Command) -> Array:
    """Compute sin(theta_4 - theta_3) of each position in many digits, (n,).

    The lengths are those that were stated. NaN where the loop does not close.
    """
    from flint import arb, ctx

    from fourbar_validation.engines.balls import (
        BITS,
        compute_directions,
        make_ball_lengths,
        wedge,
    )

    ctx.prec = BITS
    x = make_ball_lengths(linkage)
    x["theta_1"] = arb(linkage.ground_angle)
    sines = np.full(len(command.theta_2), np.nan)
    for i, (theta_2, branch) in enumerate(
        zip(command.theta_2.tolist(), command.branch.tolist(), strict=True)
    ):
        closed = compute_directions(x | {"theta_2": arb(theta_2)}, branch)
        # bars 3 and 4 have no direction if A is on O4
        sines[i] = (
            math.nan
            if closed is None
            else np.nan_to_num(_to_double(wedge(*closed[1:])))
        )
    return sines


def shift_to(
    linkage: FourBar,
    theta_2: float,
    sin_mu: float,
) -> Any:
    """Return the shift of theta_2 in rad at which sin(theta_4 - theta_3) is +-sin_mu.

    The shift is a number of mpmath, None if it is beyond rounding. The diagonal e from
    A to O4 has

        e^2 = d^2 + a^2 - 2 a d cos(theta_2 - theta_1) = b^2 + c^2 -+ 2 b c cos(mu).
    """
    from mpmath import mp, mpf

    with mp.workdps(WORKING_DIGITS):
        d, a, b, c = map(mpf, linkage.lengths)
        theta_1 = mpf(linkage.ground_angle)
        shifts = []
        cos_mu = mp.sqrt(max(1 - mpf(sin_mu) ** 2, 0))
        for side in (2 * b * c * cos_mu, -2 * b * c * cos_mu):
            cosine = (d * d + a * a - b * b - c * c + side) / (2 * a * d)
            if abs(cosine) > 1:
                continue
            for sign in (1, -1):
                shift = theta_1 + sign * mp.acos(cosine) - theta_2
                turns = mp.nint(shift / (2 * mp.pi))
                shifts.append(shift - 2 * mp.pi * turns)
        nearest = min(shifts, key=abs, default=mp.inf)
        largest = max(1.0, abs(theta_2), abs(linkage.ground_angle))
        if abs(nearest) <= RANDOM_WALK * EPS * largest:
            return nearest
        return None


def _to_double(ball: Any) -> float:
    if ball is None:
        return math.nan
    return float(ball.mid())
