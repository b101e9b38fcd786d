"""The formulas' side of the study: their error against balls of many more digits."""

import math
from typing import Any

import numpy as np

from fourbar.quantities import PIN_FORCES
from fourbar.scene import Command, Scene, with_signs
from fourbar.solving import solve
from fourbar_validation.advise.worst_errors import WorstErrors, find_greatest
from fourbar_validation.compare.scales import scale_of
from fourbar_validation.compare.tolerance import divide

REFERENCE_BITS = 400
"""Bits of the reference, some hundred and twenty digits."""
POSITIONS_WITH_REFERENCE = 25
"""Positions at which errors against the reference are taken. They take a few
milliseconds each.
"""
_PARTS: dict[str, tuple[str, ...]] = {"torque": ("torque",)}
_PARTS |= {name: (f"{name}_x", f"{name}_y") for name in PIN_FORCES}
"""Outputs of the reference that a quantity consists of."""


def choose_few(command: Command) -> Command:
    """Choose at most POSITIONS_WITH_REFERENCE positions, evenly over the sweep."""
    n = len(command.theta_2)
    places = np.linspace(0, n - 1, min(POSITIONS_WITH_REFERENCE, n))
    return command.part(np.unique(places.round().astype(int)))


def evaluate_balls(scene: Scene, command: Command) -> list[dict[str, Any]]:
    """Evaluate balls of the independent reference, by name, at each position."""
    from flint import arb, ctx

    from fourbar_validation.engines.balls import collect_inputs, compute_outputs

    command = with_signs(scene.linkage, command)
    with ctx.workprec(REFERENCE_BITS):
        outputs = []
        positions = zip(command.theta_2.tolist(), command.branch.tolist(), strict=True)
        for theta_2, branch in positions:
            inputs = collect_inputs(scene, theta_2)
            x = {name: arb(value) for name, value in inputs.items()}
            outputs.append(compute_outputs(scene, branch, x) or {})
        return outputs


def compare_with_balls(
    scene: Scene,
    command: Command,
    quantities: dict[str, Any],
    balls: list[dict[str, Any]],
) -> WorstErrors:
    """Find the worst errors of an answer on their scales against balls."""
    formulas = solve(scene, "force", at=command)
    worst = {}
    for name, parts in _PARTS.items():
        sizes = scale_of(name, scene, formulas, formulas[name]).size.tolist()
        errors = []
        for size, ours, ball in zip(sizes, quantities[name], balls, strict=True):
            exact = [ball.get(part) for part in parts]
            if None not in exact:
                pairs = zip(np.atleast_1d(ours).tolist(), exact, strict=True)
                apart = [abs(float((one - other).mid())) for one, other in pairs]
                errors.append(float(divide(math.hypot(*apart), size)))
        worst[name] = find_greatest(errors)
    return WorstErrors(**worst)
