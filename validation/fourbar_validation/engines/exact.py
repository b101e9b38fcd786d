"""The scene in 320-bit ball arithmetic as a witness: the loop as a quadratic, all thirteen equations, no shortcuts."""

import math
from typing import Any

import numpy as np

from fourbar.effects import Flywheel, Friction, Gravity, Springs, Torsion, Viscous
from fourbar.linkage import FourBar
from fourbar.quantities import VECTORS
from fourbar.scene import Command, Scene
from fourbar_validation.compare.answer import Answer, Array
from fourbar_validation.compare.compare import COMPARED, Mask
from fourbar_validation.compare.tolerance import EPS
from fourbar_validation.engines.description import SHARED, speeds, unknown_effect
from fourbar_validation.engines.loop import blank
from fourbar_validation.engines.prediction import ROUNDINGS

NAME = "ball-arithmetic"
NEWTON = 4
"""Steps, each of which doubles the digits, from a start that has those of a double but for the last ones."""
KNOWN = tuple(kind.key for kind in (Gravity, Viscous, Friction, Springs, Torsion, Flywheel))


def unknown(scene: Scene) -> str:
    """The reason to refuse a scene, or nothing."""
    return unknown_effect(scene, KNOWN)


class BallArithmetic:
    """Every compared quantity at each position, rounded once from 320 bits."""

    name = NAME

    def answer(self, scene: Scene, command: Command) -> Answer:
        """Its answer, or the refusal that names an effect it does not know."""
        from fourbar_validation.engines.balls import outputs, stored

        if reason := unknown(scene):
            return Answer(NAME, "exact", refusal=reason)
        n = len(command.theta_2)
        names = [q for q in COMPARED if command.omega_2 is not None or q.startswith("theta")]
        out, assembled, (omega, alpha) = blank(n, names), np.zeros(n, dtype=bool), speeds(command)
        for i in range(n):
            motion = {"omega_2": float(omega[i]), "alpha_2": float(alpha[i])}
            exact = stored(scene, float(command.theta_2[i]), **motion)
            values = outputs(scene, int(command.branch[i]), exact, scene.drive_bar)
            if values is None:
                continue
            assembled[i] = True
            _put(out, i, values)
        return Answer(
            NAME,
            "exact",
            at=command,
            assembled=assembled,
            quantities=out,
            shared=SHARED,
            own="closure as a complex quadratic, linear speeds and accelerations, thirteen Newton-Euler equations",
        )


def sines(linkage: FourBar, command: Command) -> Array:
    """sin(theta_4 - theta_3) of each position in many digits, (n,); NaN where the loop does not close."""
    from flint import arb, ctx

    from fourbar_validation.engines.balls import BITS, closure, wedge

    ctx.prec = BITS
    x = {name: arb(length) for name, length in zip("dabc", linkage.lengths, strict=True)}
    x["theta_1"] = arb(linkage.ground_angle)
    found = np.full(len(command.theta_2), np.nan)
    for i, (theta_2, branch) in enumerate(zip(command.theta_2.tolist(), command.branch.tolist(), strict=True)):
        closed = closure(x | {"theta_2": arb(theta_2)}, branch)
        # with A on O4 bars 3 and 4 have no direction
        found[i] = math.nan if closed is None else np.nan_to_num(_number(wedge(*closed[1:])))
    return found


def where_it_closes(scene: Scene, at: Command, sin_mu: Array, where: Mask) -> dict[str, Array]:
    """Every quantity at the theta_2, within its own rounding, at which sin(theta_4 - theta_3) is the one stated.

    Near a limit position the last digits of theta_2 decide this sine, and with it every other number; once they are
    chosen all the others have their digits. NaN where no theta_2 so near has this sine.
    """
    from flint import arb

    from fourbar_validation.engines.balls import STEP_BITS, closure, outputs, stored, wedge

    out, (omega, alpha) = blank(len(where), COMPARED), speeds(at)
    for i in np.flatnonzero(where & np.isfinite(sin_mu)).tolist():
        theta_2, branch, square = float(at.theta_2[i]), int(at.branch[i]), arb(float(sin_mu[i])) ** 2
        x = stored(scene, theta_2, omega_2=float(omega[i]), alpha_2=float(alpha[i]))
        near, step = (
            arb(ROUNDINGS * EPS * max(1.0, abs(theta_2), abs(scene.linkage.ground_angle))),
            arb(2) ** -STEP_BITS,
        )
        for _ in range(NEWTON):  # on the square, which is smooth at the limit position itself
            closed = [closure(x | {"theta_2": x["theta_2"] + by}, branch) for by in (0, step)]
            if None in closed:
                break
            here, ahead = (wedge(*each[1:]) ** 2 for each in closed if each is not None)
            by = (square - here) * step / (ahead - here)
            if not abs(x["theta_2"] + by - theta_2) <= near:
                break
            x["theta_2"] = arb((x["theta_2"] + by).mid())
        else:
            _put(out, i, outputs(scene, branch, x, scene.drive_bar) or {})
    return out


def _put(out: dict[str, Array], i: int, values: dict[str, Any]) -> None:
    """The numbers of one position into those of all."""
    for name, array in out.items():
        if name in VECTORS:
            array[i] = _number(values.get(f"{name}_x")), _number(values.get(f"{name}_y"))
        else:
            array[i] = _number(values.get(name))


def _number(ball: Any) -> float:
    return math.nan if ball is None else float(ball.mid())
