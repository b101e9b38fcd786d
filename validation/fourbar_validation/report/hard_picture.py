"""What the picture of the hard cases shows: errors towards singular positions."""

import numpy as np

from fourbar.quantities import OK, Array
from fourbar.scene import Scene
from fourbar.scene import command as command_of
from fourbar.solving import solve
from fourbar_validation.compare.tolerance import find_error, magnitude
from fourbar_validation.engines.asking import ask_at
from fourbar_validation.engines.registry import Engine
from fourbar_validation.scenes.hard_families import (
    CHANGE_POINTS,
    TYPES_WITH_A_CRANK,
    TYPES_WITH_A_ROCKER,
    draw_lengths_of_type,
    dress,
    find_collinear_2_3,
    find_collinear_3_4,
    set_angles,
)

_DISTANCES = np.logspace(-1, -12, 23)
"""rad from the singular position."""
DRAWN_AS_ZERO = 1e-17
"""Differences of exactly zero are drawn here."""


def list_approaches() -> list[Scene]:
    """List the approaches to a toggle, a pole of T4 and a change point."""
    rocker = draw_lengths_of_type(TYPES_WITH_A_ROCKER, 1)
    crank = draw_lengths_of_type(TYPES_WITH_A_CRANK, 0)
    (limit, stretched), *_ = find_collinear_3_4(rocker)
    (pole, branch), *_ = find_collinear_2_3(crank)
    lengths, (_, half_turn) = CHANGE_POINTS["parallelogram"]
    near = _DISTANCES[_DISTANCES >= 0.99e-8]
    inward = -1.0 if stretched else 1.0
    return [
        set_angles(dress(rocker, 1), limit + inward * _DISTANCES),
        set_angles(dress(crank), pole + _DISTANCES, branch, drive_bar=4),
        # it stays a parallelogram: its motion is regular, its pin forces are not
        set_angles(dress(lengths), half_turn + near, 1),
    ]


def list_errors(
    scene: Scene,
    quantity: str,
    engine: Engine,
) -> tuple[Array, Array] | None:
    """Return theta_2 (rad) and the relative errors of one engine.

    An engine that refuses has None.
    """
    command = command_of(scene)
    answer = ask_at(engine.start(), scene, command)
    if (
        answer.refusal is not None
        or quantity not in answer.quantities
        or answer.at is None
    ):
        return None
    ours = solve(scene, "force", at=answer.at)
    values = getattr(ours, quantity)
    error = find_error(quantity, values, answer.quantities[quantity], magnitude(values))
    keep = (ours.status_code == OK) & np.isfinite(error)
    return answer.at.theta_2[keep], np.maximum(error[keep], DRAWN_AS_ZERO)
