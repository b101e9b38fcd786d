"""The picture of the hard cases: error against distance to the singular position.

Each engine has a panel.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from fourbar.quantities import OK, Array
from fourbar.scene import Command, Scene
from fourbar.scene import command as command_of
from fourbar.solving import solve
from fourbar_validation.compare.tolerance import (
    EPS,
    TIMES_PREDICTED,
    K,
    divide,
    find_condition,
    find_error,
    magnitude,
)
from fourbar_validation.engines.asking import ask_at
from fourbar_validation.engines.prediction import predict_in_world_axes
from fourbar_validation.engines.registry import HARD_ENGINES, Engine
from fourbar_validation.report.svg import choose_style, write_svg
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
GREY = "#777777"
"""Grey that reads on white and on black."""
DRAWN_AS_ZERO = 1e-17
"""Differences of exactly zero are drawn here."""
QUANTITIES_DRAWN = ("torque", "F32")
_SIMULATED_FROM = 3e-3
"""rad; nearer than this the simulation refuses."""


@dataclass(frozen=True, slots=True)
class Approach:
    """One approach to a singular position."""

    title: str
    scene: Scene
    distances: Array


def list_approaches() -> list[Approach]:
    """List a toggle, a pole of T4 and a change point."""
    rocker = draw_lengths_of_type(TYPES_WITH_A_ROCKER, 1)
    crank = draw_lengths_of_type(TYPES_WITH_A_CRANK, 0)
    (limit, stretched), *_ = find_collinear_3_4(rocker)
    (pole, branch), *_ = find_collinear_2_3(crank)
    lengths, (_, half_turn) = CHANGE_POINTS["parallelogram"]
    near = _DISTANCES[_DISTANCES >= 0.99e-8]
    inward = -1.0 if stretched else 1.0
    return [
        Approach(
            "toggle: bars 3, 4 collinear",
            set_angles(dress(rocker, 1), limit + inward * _DISTANCES),
            _DISTANCES,
        ),
        Approach(
            "pole of T4: omega_4 = 0",
            set_angles(dress(crank), pole + _DISTANCES, branch, drive_bar=4),
            _DISTANCES,
        ),
        # it stays a parallelogram: its motion is regular, its pin forces are not
        Approach(
            "change point of a parallelogram",
            set_angles(dress(lengths), half_turn + near, 1),
            near,
        ),
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
    if engine.through_time:
        psi = np.abs(command.theta_2 - command.theta_2[0]) - abs(
            command.theta_2[-1] - command.theta_2[0]
        )
        command = Command(
            command.theta_2[-psi > _SIMULATED_FROM],
            command.branch[-psi > _SIMULATED_FROM],
            *command[2:4],
        )
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


def draw_picture() -> str:
    """Draw the SVG of the page: a column per singular position, a row per quantity.

    Law and prediction are drawn in.
    """
    from matplotlib.figure import Figure

    columns = list_approaches()
    figure = Figure(figsize=(10.5, 6.4), layout="constrained", facecolor="none")
    axes = figure.subplots(
        len(QUANTITIES_DRAWN),
        len(columns),
        squeeze=False,
        sharex="col",
    )
    for column, approach in enumerate(columns):
        for row, quantity in enumerate(QUANTITIES_DRAWN):
            _draw_approach(axes[row][column], approach, quantity)
        axes[0][column].set_title(approach.title, fontsize=9)
        axes[-1][column].set_xlabel("distance in theta_2 [rad]")
    for row, quantity in enumerate(QUANTITIES_DRAWN):
        axes[row][0].set_ylabel(f"error of {quantity}, of its own size")
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="outside upper center",
        ncols=4,
        frameon=False,
        fontsize=8,
    )
    return write_svg(figure, "where it gets hard")


def _draw_approach(
    axes: Any,
    approach: Approach,
    quantity: str,
) -> None:
    solution = solve(approach.scene, "force")
    size = magnitude(getattr(solution, quantity))
    singular = _find_singular_angle(approach)
    predicted = divide(
        predict_in_world_axes(approach.scene, command_of(approach.scene), quantity),
        size,
    )
    law = K * EPS / find_condition(quantity, approach.scene.linkage, solution)
    shown = np.isfinite(predicted)
    axes.loglog(
        approach.distances,
        law,
        color=GREY,
        linestyle=(0, (1, 1)),
        linewidth=1,
        label="law K eps/condition",
    )
    axes.fill_between(
        approach.distances[shown],
        predicted[shown],
        TIMES_PREDICTED * predicted[shown],
        color=GREY,
        alpha=0.25,
        linewidth=0,
        label="computed: predicted to ten times that",
    )
    for engine in HARD_ENGINES:
        curve = list_errors(approach.scene, quantity, engine)
        if curve is not None and len(curve[0]):
            axes.loglog(
                np.abs(curve[0] - singular),
                curve[1],
                label=engine.name,
                **choose_style(engine.name).line,
            )
    axes.set_xlim(approach.distances[0] * 2, approach.distances[-1] / 2)
    axes.set_ylim(DRAWN_AS_ZERO, 1e3)
    axes.grid(visible=True, color=GREY, alpha=0.2)


def _find_singular_angle(approach: Approach) -> float:
    """Return theta_2 of the singular position.

    The positions lie at the distances from it.
    """
    theta_2 = command_of(approach.scene).theta_2
    side = math.copysign(1.0, float(theta_2[0] - theta_2[-1]))
    return float(theta_2[0]) - side * float(approach.distances[0])
