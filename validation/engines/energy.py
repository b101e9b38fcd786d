"""The energy method as a witness of the driving torque: power balance and virtual work instead of Newton-Euler."""

import numpy as np

from fourbar.dynamics import driving_torque, path
from fourbar.errors import LimitError
from fourbar.scene import Command, Scene
from validation.answer import Answer


class EnergyMethod:
    """The driving torque from T_k theta_k' = J alpha_2 + J'/2 omega_2^2 - Q."""

    name = "energy-method"

    def answer(self, scene: Scene, command: Command) -> Answer:
        """Its torque; where the scene states no velocity, its angles alone."""
        way = path(scene.linkage, command.theta_2, np.asarray(command.branch, dtype=float))
        answer = Answer(
            self.name,
            "exact",
            assembled=np.isfinite(way.sine),
            shared="the positions' triangle, the powers of loads and effects",
            own="kinematic coefficients, equivalent inertia, virtual work",
        )
        answer.quantities["theta_3"] = np.angle(way.unit[3])
        answer.quantities["theta_4"] = np.angle(way.unit[4])
        if command.omega_2 is not None:
            terms = (*scene.loads, *scene.effects)
            try:
                torque = driving_torque(scene.linkage, way, command.omega_2, command.alpha_2, terms, scene.drive_bar)
            except LimitError as error:
                return Answer(self.name, "exact", refusal=str(error))
            # one number for all positions where nothing that moves has mass and nothing acts
            torque = np.where(np.isfinite(torque), torque, np.nan)
            answer.quantities["torque"] = np.broadcast_to(torque, command.theta_2.shape)
        return answer
