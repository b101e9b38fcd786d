"""A compiled MJCF as a closed loop: MuJoCo's own kinematics, assembly, velocities and pin forces."""

import math

import mujoco
import numpy as np
from numpy.typing import NDArray

from validation.engines.assembly import assemble, branch_sign

Array = NDArray[np.float64]
O2, A, O4 = 0, 1, 2
"""Degrees of freedom, in the order of the bodies."""
WARNINGS = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)


class ClosedLoop:
    """Model and data of one generated MJCF; nothing is edited after it is compiled."""

    def __init__(self, mjcf: str) -> None:
        self.model = mujoco.MjModel.from_xml_string(mjcf)
        self.data = mujoco.MjData(self.model)
        self.site = {name: self.model.site(name).id for name in ("A", "O4", "B3", "B4")}
        self.body = {name: self.model.body(name).id for name in ("input", "coupler", "output")}
        self.size = sum(
            math.dist(*pair)
            for pair in (
                (self.model.site("O2").pos, self.model.site("O4").pos),
                (self.model.site("A").pos, (0.0, 0.0, 0.0)),
                (self.model.site("B3").pos, (0.0, 0.0, 0.0)),
                (self.model.site("B4").pos, (0.0, 0.0, 0.0)),
            )
        )
        loads = [i for i in range(self.model.nu) if self.model.actuator(i).name.startswith("load_")]
        self.loads = [(i, self.model.site_bodyid[self.model.actuator_trnid[i, 0]]) for i in loads]
        self.drive = next((i for i in range(self.model.nu) if self.model.actuator(i).name == "drive"), None)
        self._jac3, self._jac4 = np.zeros((3, self.model.nv)), np.zeros((3, self.model.nv))

    def gap(self) -> Array:
        """B on bar 3 minus B on bar 4, (2,), m."""
        x = self.data.site_xpos
        return np.asarray(x[self.site["B3"]][:2] - x[self.site["B4"]][:2])

    def jacobian(self) -> Array:
        """Derivative of the gap by the joint angles, (2, 3)."""
        mujoco.mj_jacSite(self.model, self.data, self._jac3, None, self.site["B3"])
        mujoco.mj_jacSite(self.model, self.data, self._jac4, None, self.site["B4"])
        return np.asarray(self._jac3[:2] - self._jac4[:2])

    def place(self, theta_2: float, theta_3: float, theta_4: float) -> tuple[Array, Array]:
        """Gap, and its derivatives by theta_3 (joint A) and theta_4 (joint O4), (2, 2)."""
        self.data.qpos[:] = (theta_2, theta_3 - theta_2, theta_4)
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        return self.gap(), self.jacobian()[:, [A, O4]]

    def assemble(self, theta_2: float, branch: int, near: tuple[float, float] | None) -> tuple[float, float] | None:
        """Own (theta_3, theta_4), or None where the loop does not close."""
        self.place(theta_2, 0.0, 0.0)
        x = self.data.site_xpos
        to_O4 = x[self.site["O4"]] - x[self.site["A"]]
        return assemble(self.place, theta_2, branch, math.atan2(to_O4[1], to_O4[0]), self.size, near)

    def branch(self) -> int:
        """The branch of the state that was last forwarded, from the own Jacobian."""
        jac = self.jacobian()
        return branch_sign(float(np.linalg.det(jac[:, [A, O4]])))

    def set_state(self, theta: tuple[float, float, float], omega_2: float) -> None:
        """Start from own angles at omega_2, with the velocities that keep the gap closed."""
        mujoco.mj_resetData(self.model, self.data)
        _, by_34 = self.place(*theta)
        v = np.linalg.solve(by_34, -self.jacobian()[:, O2] * omega_2)
        self.data.qvel[:] = (omega_2, v[0], v[1])

    def forward(self) -> None:
        """Everything at the present state: after a Runge-Kutta step some fields are still of the step before."""
        mujoco.mj_forward(self.model, self.data)
        mujoco.mj_rnePostConstraint(self.model, self.data)

    def forces(self) -> dict[str, Array]:
        """Pin forces of the state that was last forwarded, world axes, N.

        cfrc_int is what the parent exerts on a body and all it carries, but MuJoCo counts the forces
        of actuators on sites into it; they are taken out again.
        """
        d = self.data
        on = {name: d.cfrc_int[body][3:5].copy() for name, body in self.body.items()}
        for actuator, body in self.loads:
            force = self._load_force(actuator)
            for name in {"input": ("input",), "coupler": ("coupler", "input"), "output": ("output",)}[
                self.model.body(body).name
            ]:
                on[name] -= force
        return {"F12": on["input"], "F32": -on["coupler"], "F43": d.efc_force[:2].copy(), "F14": on["output"]}

    def _load_force(self, actuator: int) -> Array:
        """Force of a load actuator, in world axes, (2,)."""
        site, frame = self.model.actuator_trnid[actuator]
        axes = self.data.site_xmat[frame if frame >= 0 else site].reshape(3, 3)
        gear = self.model.actuator_gear[actuator, :3]
        return np.asarray((axes @ gear)[:2] * self.data.actuator_force[actuator])

    def crank_torque(self) -> float:
        """T2: what the flywheel gives the crank, and the motor beside it, N m."""
        flywheel = -self.model.dof_armature[O2] * self.data.qacc[O2]
        motor = 0.0 if self.drive is None else self.data.actuator_force[self.drive]
        return float(flywheel + motor)

    def bad(self) -> int:
        """Warnings of a bad position, velocity or acceleration: each resets the data."""
        return sum(int(self.data.warning[kind].number) for kind in WARNINGS)
