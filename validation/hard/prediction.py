"""The error that rounding must be expected to make, computed from the description in 320-bit arithmetic.

    predicted = R eps sum_i w_i |dy/dx_i|,

the first-order change of a result y when every stored input x_i (lengths, angles, masses, loads, the
command) and the closure of the loop move in their last digit, at this very position and for this very
quantity. It replaces K eps/condition where no power of a sine is the right law: beside change points,
where a torque cancels, and for forces beside a toggle, which a law in s^2 would excuse too much.
"""

import math
from functools import lru_cache
from typing import Any

import numpy as np

from fourbar.scene import Command, Scene
from fourbar.solution import VECTORS
from validation.tolerance import EPS, Array

ROUNDINGS = 8.0
"""R: a chain of some fifty roundings moves a result by sqrt(50) = 7 last digits, as a random walk."""


def predicted_error(scene: Scene, at: Command, quantities: tuple[str, ...]) -> dict[str, Array]:
    """Absolute error predicted for each quantity at each position, (n,); NaN where the loop does not close.

    At a singular position, where the exact equations have no answer, it is infinite.
    """
    n = len(at.theta_2)
    omega = np.broadcast_to(np.nan if at.omega_2 is None else np.asarray(at.omega_2, float), (n,))
    alpha = np.broadcast_to(np.asarray(at.alpha_2, float), (n,))
    result = {name: np.full(n, np.nan) for name in quantities}
    for i in range(n):
        moved = _sensitivity(scene, float(at.theta_2[i]), int(at.branch[i]), float(omega[i]), float(alpha[i]))
        if moved is None:
            continue
        for name in quantities:
            parts = [moved.get(f"{name}{axis}", math.inf) for axis in (("_x", "_y") if name in VECTORS else ("",))]
            result[name][i] = ROUNDINGS * EPS * math.hypot(*parts)
    return result


@lru_cache(maxsize=4096)
def _sensitivity(scene: Scene, theta_2: float, branch: int, omega_2: float, alpha_2: float) -> dict[str, float] | None:
    """|y| + sum w_i |dy/dx_i| of every output; None where the loop does not close."""
    from flint import arb, ctx

    from validation.reference import BITS, STEP_BITS, inputs, outputs

    ctx.prec = BITS
    stored = inputs(scene, theta_2) | {"omega_2": 0.0 if math.isnan(omega_2) else omega_2, "alpha_2": alpha_2}
    exact: dict[str, Any] = {name: arb(value) for name, value in stored.items()}

    def evaluate(changed: dict[str, Any]) -> Any:
        return outputs(scene, branch, exact | changed, scene.drive_bar)

    base = evaluate({})
    if base is None:
        return None
    total = {name: 1.0 if name.startswith("theta") else abs(float(value.mid())) for name, value in base.items()}
    step, two_pi = arb(2) ** -STEP_BITS, 2 * arb.pi()
    for name, weight in _weights(stored).items():
        moved = None
        for side in (1, -1):
            moved = evaluate({name: exact[name] + side * weight * step})
            if moved is not None and len(moved) == len(base):
                break
        if moved is None:
            continue
        for output, y in base.items():
            change = abs(moved[output] - y)
            if output.startswith("theta") and change > 3:
                change = two_pi - change
            total[output] += abs(float((change / step).mid()))
    return total


def _weights(stored: dict[str, float]) -> dict[str, float]:
    """How much of each input is one rounding: relative, but a chain of bars meets O4 as its longest bar is rounded."""
    longest = max(stored[name] for name in ("d", "a", "b", "c"))
    weights = {name: abs(value) for name, value in stored.items() if value != 0.0}
    weights["d"] = longest
    weights["theta_1"] = max(abs(stored["theta_1"]), longest / stored["d"])
    weights["theta_2"] = max(abs(stored["theta_2"]), 1.0)
    return weights
