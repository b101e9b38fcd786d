"""A run no more precise than wanted: the simulation's settings from the laws, confirmed by the engine itself.

The settings are chosen by the error that the engine predicts from its own residuals, never by what
the formulas say: how wrong it is against them stays a finding.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from fourbar.scene import Command, Scene
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.compare import COMPARED, mark_turning
from fourbar_validation.compare.tolerance import divide, hold_simulated, magnitude
from fourbar_validation.engines.guests import Guest
from fourbar_validation.engines.registry import Engine

ROUNDS = 6
"""Simulations of a scene at most; the laws are seldom wrong by more than one."""
MARGIN = 0.5
"""The engine's own prediction must stay within this part of the wanted error."""
LEAST_GROWTH, MOST_GROWTH = 1.15, 3.0
"""Factor on the steps from one round to the next."""


def adjust_engines(engines: Sequence[Engine], error: float) -> tuple[Engine, ...]:
    """Lay out simulations for `error`, and hold those of the harness to it.

    Exact engines stay exact. A guest is asked for this error; one that states its own tolerance keeps it.
    """
    tolerance = hold_simulated(error, "steps and softness are laid out for it")
    adjusted: list[Engine] = []
    for engine in engines:
        laid_out: dict[str, Any] = {"tolerance": tolerance, "order": None} if engine.through_time else {}
        if engine.through_time and not isinstance(engine, Guest):
            laid_out["start"] = partial(Dialled, error)
        adjusted.append(replace(engine.at_setting(error=error) if isinstance(engine, Guest) else engine, **laid_out))
    return tuple(adjusted)


@dataclass(slots=True)
class Dialled:
    """Engine "mujoco-simulated" with settings for a wanted error."""

    error: float
    name: str = "mujoco-simulated"

    def answer(self, scene: Scene, command: Command) -> Answer:
        """Simulate with as many steps as the laws ask for, and more while its own residuals say so."""
        from fourbar_validation.engines.mujoco.simulate import MujocoSimulated
        from fourbar_validation.engines.mujoco.trial import LONGEST, ORDER, guess, make_settings

        steps, tc = guess(self.error)
        spent, runs = 0.0, 0
        for _ in range(ROUNDS):
            answer = MujocoSimulated(make_settings(steps, tc)).answer(scene, command)
            if answer.refusal is not None:
                return answer
            spent, runs = spent + answer.evidence["steps"], runs + 1
            expected = compute_expected_error(scene, answer)
            if expected <= MARGIN * self.error and not answer.alarms:
                break
            ratio = expected / (MARGIN * self.error)
            growth = ratio ** (1.0 / ORDER) if np.isfinite(ratio) else MOST_GROWTH
            growth = min(max(growth, LEAST_GROWTH), MOST_GROWTH)
            # a run has at least as many steps as it has positions to read
            made = float(answer.setting.rpartition(" ")[2].removesuffix("/rev"))  # of "RK4 628/rev"
            steps = max(steps, made) * growth
            tc = min(tc * growth, LONGEST)
        answer.evidence |= {"wanted_error": self.error, "expected_error": expected}
        answer.evidence |= {"steps_with_the_search": spent, "runs": float(runs)}
        return answer


def compute_expected_error(scene: Scene, answer: Answer) -> float:
    """Compute the worst error that the engine predicts, relative to a quantity's largest magnitude (angles: 1 rad)."""
    worst = 0.0
    for name, predicted in answer.predicted.items():
        if name not in COMPARED:
            continue
        values = answer.quantities[name]
        sizes = np.where(np.isfinite(values), 1.0, np.nan) if name.startswith("theta") else magnitude(values)
        finite = np.isfinite(sizes)
        if name == "torque" and scene.drive_bar != 2:
            finite &= mark_turning(answer.quantities[f"omega_{scene.drive_bar}"])
        if finite.any() and sizes[finite].max() > 0.0:
            worst = float(np.maximum(worst, divide(predicted[finite].max(), sizes[finite].max())))  # NaN stays NaN
    return worst if np.isfinite(worst) else float("inf")
