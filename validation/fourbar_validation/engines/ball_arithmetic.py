"""Solve the scene in 320-bit ball arithmetic as an engine.

The loop is a quadratic, and nine Newton-Euler equations are solved as one system.
"""

from itertools import product
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
)
from fourbar_validation.engines.loop import read_each


def find_refusal(scene: Scene) -> str:
    """Give the reason to refuse a scene, if any."""
    return find_unknown(scene, lambda effect: effect.in_balls)


class BallArithmetic:
    """Every compared quantity at each position, rounded once from 320 bits."""

    name = "ball-arithmetic"

    def answer(self, scene: Scene, command: Command) -> Answer:
        """Answer, or refuse by naming an effect that it does not know."""
        from flint import arb

        from fourbar_validation.engines.balls import compute_outputs, make_balls

        if reason := find_refusal(scene):
            return Answer(self.name, "exact", refusal=reason)
        names = [
            q
            for q in COMPARED_QUANTITIES
            if command.omega_2 is not None or q.startswith("theta")
        ]
        stated = make_balls(scene, 0.0)
        remainder = arb(0 if command.remainder is None else command.remainder)

        def read(
            theta: float, branch: int, speed: float, acceleration: float
        ) -> dict[str, Any] | None:
            moved = {"theta_2": arb(theta) + remainder, "omega_2": arb(speed)}
            moved["alpha_2"] = arb(acceleration)
            balls = compute_outputs(scene, branch, stated | moved)
            if balls is None:
                return None
            values: dict[str, Any] = {
                name: float(ball.mid()) for name, ball in balls.items()
            }
            for name in VECTORS:
                if f"{name}_x" in values:
                    values[name] = values[f"{name}_x"], values[f"{name}_y"]
            return values

        out, assembled = read_each(command, names, read)
        return Answer(
            self.name,
            "exact",
            at=command,
            assembled=assembled,
            quantities=out,
            shared=SHARED_BY_EXACT_ENGINES,
            own=(
                "closure as a complex quadratic, linear speeds and accelerations,"
                " nine Newton-Euler equations"
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

    def read(theta: float, branch: int, *_: float) -> dict[str, float] | None:
        closed = compute_directions(x | {"theta_2": arb(theta)}, branch)
        if closed is None:
            return None
        # bars 3 and 4 have no direction if A is on O4
        return {"sin_mu": np.nan_to_num(float(wedge(*closed[1:]).mid()))}

    out, _ = read_each(command, ["sin_mu"], read)
    return out["sin_mu"]


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
        cos_mu = mp.sqrt(max(1 - mpf(sin_mu) ** 2, 0))
        nearest = mp.inf
        for side, sign in product((2 * b * c, -2 * b * c), (1, -1)):
            cosine = (d * d + a * a - b * b - c * c + side * cos_mu) / (2 * a * d)
            if abs(cosine) <= 1:
                shift = theta_1 + sign * mp.acos(cosine) - theta_2
                shift -= 2 * mp.pi * mp.nint(shift / (2 * mp.pi))
                nearest = min(nearest, shift, key=abs)
        largest = max(1.0, abs(theta_2), abs(linkage.ground_angle))
        return nearest if abs(nearest) <= RANDOM_WALK * EPS * largest else None
