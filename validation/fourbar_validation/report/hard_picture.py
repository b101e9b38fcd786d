"""What the picture of the hard cases shows: errors towards singular positions."""

import numpy as np

from fourbar.quantities import OK, Array
from fourbar.scene import Scene
from fourbar.scene import command as command_of
from fourbar.solving import solve
from fourbar_validation.compare.tolerance import find_error, magnitude
from fourbar_validation.engines.registry import Engine, ask_at
from fourbar_validation.scenes.hard_families import Hard

APPROACHES = (
    "toggle-double-rocker-1-folded-open",
    "pole-T4-0-0",
    "change-point-parallelogram-180-open",
)
"""Hard cases that approach a toggle, a pole of T4 and a change point."""
DRAWN_AS_ZERO = 1e-17
"""Differences of exactly zero are drawn here."""


def list_approaches() -> list[Scene]:
    """List the scenes of APPROACHES."""
    hard = Hard()
    return [hard.scene(i) for i in range(len(hard)) if hard.name(i) in APPROACHES]


def list_errors(
    scene: Scene,
    quantity: str,
    engine: Engine,
) -> tuple[Array, Array] | None:
    """Return theta_2 (rad) and the relative errors of one engine.

    An engine that refuses has None.
    """
    answer = ask_at(engine.start(), scene, command_of(scene))
    if answer.at is None or quantity not in answer.quantities:
        return None
    ours = solve(scene, "force", at=answer.at)
    values = ours[quantity]
    error = find_error(quantity, values, answer.quantities[quantity], magnitude(values))
    keep = (ours.status_code == OK) & np.isfinite(error)
    return answer.at.theta_2[keep], np.maximum(error[keep], DRAWN_AS_ZERO)
