"""Newton-Euler equations in 320-bit balls, which share nothing with the formulas."""

import numpy as np
from flint import arb, ctx

from fourbar import Motion, Scene, command
from fourbar.scene import with_signs
from fourbar_validation.engines.balls import (
    compute_directions,
    compute_outputs,
    make_balls,
    polar_ball,
)


def answer_in_balls(scene):
    """Compute each output at each position, rounded once.

    (n,), vectors (n, 2), NaN where it has no value.
    """
    at = with_signs(scene.linkage, command(scene))
    rows = []
    with ctx.workprec(ctx.prec):
        places = at.stated[0]
        for place, branch in zip(places.tolist(), at.branch.tolist(), strict=True):
            inputs = make_balls(scene, place)
            inputs[at.commanded] += arb(0 if at.remainder is None else at.remainder)
            outputs = compute_outputs(scene, branch, inputs) or {}
            # the ball of an angle of half a turn holds both of its names
            rows.append(
                {
                    name: float(ball.mid()) if not ball.rad() > 3 else np.pi
                    for name, ball in outputs.items()
                }
            )
    columns = {
        name: np.array([row.get(name, np.nan) for row in rows])
        for name in set().union(*rows)
    }
    ends = [name.removesuffix("_x") for name in columns if name.endswith("_x")]
    return columns | {
        name: np.stack([columns[f"{name}_x"], columns[f"{name}_y"]], axis=-1)
        for name in ends
    }


def move_in_balls(linkage, bar, angle, sign):
    """Return the motion of all bars as one turns evenly at 1 rad/s.

    `sign`: of the sine between the two other bars. Beside the outputs in balls, whose
    omega_k and alpha_k are first and second derivatives by the angle, it has the
    directions of all bars under u_k, as complex numbers.
    """
    names = f"theta_{bar}", f"omega_{bar}", f"alpha_{bar}"
    scene = Scene(linkage, Motion(**dict(zip(names, (angle, 1.0, 0.0), strict=True))))
    with ctx.workprec(ctx.prec):
        inputs = make_balls(scene, angle)
        outputs = compute_outputs(scene, sign, inputs)
        directions = compute_directions(inputs, sign)
        ground = polar_ball(arb(1), inputs["theta_1"])
        for number, u in enumerate((ground, *directions), 1):
            outputs[f"u_{number}"] = complex(float(u.real), float(u.imag))
    return inputs | outputs
