"""MuJoCo's inverse dynamics on the open tree, constraints off; the loop is closed by multipliers."""

import math
import warnings
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from fourbar.linkage import MOVING_BARS
from fourbar.scene import Command, Scene
from validation.compare.answer import Answer, Array
from validation.engines import description
from validation.engines.effects import acting, unknown_effect
from validation.engines.loop import answer_exactly, turned_by, turned_ground

NAME = "mujoco-inverse"
ENDS = {"A": "end2", "B": "end4", "G2": "G2", "G3": "G3", "G4": "G4"}
"""Points whose acceleration is compared, and the sites that they are."""
LEAST = 1e-15
"""kg and kg m^2; the compiler raises ValueError for a moving body below it (mjMINVAL, measured with 4.0.0)."""


class MujocoInverse:
    """Inverse dynamics with loop multipliers."""

    name = NAME

    def __init__(self) -> None:
        self.data: mujoco.MjData | None = None

    def answer(self, scene: Scene, command: Command) -> Answer:
        """Its answer, or the refusal that names an effect it does not know or a bar it cannot hold."""
        reason = refusal(scene)
        if reason is not None:
            return Answer(NAME, "exact", refusal=reason)
        return answer_exactly(NAME, self._tree, scene, command)

    def _tree(self, scene: Scene) -> "MujocoTree":
        """The tree of a scene, in the memory of the one before: allocating it takes MuJoCo longer than all its work."""
        tree = MujocoTree(scene, self.data)
        self.data = tree.data
        return tree


def refusal(scene: Scene) -> str | None:
    """The declared limit that a scene meets, or None."""
    if (reason := unknown_effect(scene)) is not None:
        return reason
    for number in MOVING_BARS:
        bar = scene.linkage.bar(number)
        if bar.mass < LEAST or description.inertia(bar) < LEAST:
            return (
                f"bar {number} has mass {bar.mass:g} kg and inertia {description.inertia(bar):g} kg m^2; "
                f"MuJoCo compiles no moving body below {LEAST:g} of either"
            )
    return None


class MujocoTree:
    """The open tree, built from the description with MjSpec."""

    def __init__(self, scene: Scene, data: mujoco.MjData | None = None) -> None:
        linkage = scene.linkage
        spec = mujoco.MjSpec()
        spec.option.gravity = np.zeros(3)
        spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT | mujoco.mjtDisableBit.mjDSBL_CONTACT
        theta_1, d = linkage.ground_angle, linkage.ground
        foot = {2: (0.0, 0.0), 3: (linkage.input.length, 0.0), 4: (d * math.cos(theta_1), d * math.sin(theta_1))}
        bodies: dict[int, Any] = {}
        for number in MOVING_BARS:
            part = linkage.bar(number)
            r, phi = description.centre(part)
            centre = [r * math.cos(phi), r * math.sin(phi), 0.0]
            parent = bodies[2] if number == 3 else spec.worldbody
            body = parent.add_body(name=f"bar{number}", pos=[*foot[number], 0.0])
            body.explicitinertial = True
            body.mass, body.ipos, body.inertia = part.mass, centre, [description.inertia(part)] * 3
            body.add_joint(name=description.FIRST_PIN[number], type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0.0, 0.0, 1.0])
            body.add_site(name=f"G{number}", pos=centre)
            body.add_site(name=f"end{number}", pos=[part.length, 0.0, 0.0])
            bodies[number] = body
        with warnings.catch_warnings():
            # of the mass matrix at q = 0, which inverse dynamics never divides by
            warnings.filterwarnings("ignore", "Inertia matrix is too close to singular")
            self.model = model = spec.compile()
        # a centre or site nearer than 1e-6 m is taken for the body's origin, silently; these marks are why
        model.body_sameframe[:] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
        model.site_sameframe[:] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
        model.body_simple[:] = model.dof_simplenum[:] = 0
        self.data = mujoco.MjData(model) if data is None else data
        mujoco.mj_resetData(model, self.data)
        self.body = {n: model.body(f"bar{n}").id for n in MOVING_BARS}
        assert [int(model.joint(description.FIRST_PIN[n]).dofadr[0]) for n in MOVING_BARS] == [0, 1, 2]  # depth first
        self.site = {name: model.site(name).id for n in MOVING_BARS for name in (f"G{n}", f"end{n}")}
        self.on_bar = {name: self.body[int(name[-1])] for name in self.site}
        # the engine's own memory, read and written in place
        data = self.data
        self.at = {name: data.site_xpos[site, :2] for name, site in self.site.items()}
        self.first_pin = {n: data.xpos[body, :2] for n, body in self.body.items()}
        self.mass_centre = {n: data.xipos[body] for n, body in self.body.items()}
        self.rotation = {n: data.xmat[body].reshape(3, 3)[:2, :2] for n, body in self.body.items()}
        self.applied = {n: data.xfrc_applied[body] for n, body in self.body.items()}
        self.linear, self.linear_dot = np.zeros((2, len(ENDS), 3, 3))
        self.angular = np.zeros((3, 3))
        self.ground_angle = theta_1
        self.pin_loads: dict[str, float] = {}
        self.acting = acting(scene, self)

    def place(self, q: Sequence[float]) -> None:
        """Bodies, sites and the axes of the Jacobians at q."""
        self.data.qpos[:] = q
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)

    def point(self, name: str) -> Array:
        """A site, world axes, (2,)."""
        return np.array(self.at[name])

    def gap(self) -> tuple[float, float]:
        """B on bar 3 minus B on bar 4."""
        x, y = (self.at["end3"] - self.at["end4"]).tolist()
        return x, y

    def jacobian(self) -> Array:
        """Difference of the two site Jacobians."""
        on_3, on_4 = self._site_jacobians("end3", "end4")
        return np.asarray(on_3 - on_4)

    def _site_jacobians(self, *names: str) -> Array:
        """Of each site, (n, 2, 3)."""
        for name, out in zip(names, self.linear, strict=False):
            mujoco.mj_jacSite(self.model, self.data, out, None, self.site[name])
        return self.linear[: len(names), :2]

    def _site_jacobian_rates(self, *names: str) -> Array:
        """Of each site, (n, 2, 3)."""
        for name, out in zip(names, self.linear_dot, strict=False):
            at = self.data.site_xpos[self.site[name]]
            mujoco.mj_jacDot(self.model, self.data, out, None, at, self.on_bar[name])
        return self.linear_dot[: len(names), :2]

    def turn(self, bar: int) -> Array:
        """Last row of the body's rotational Jacobian."""
        mujoco.mj_jacBody(self.model, self.data, None, self.angular, self.body[bar])
        return np.array(self.angular[2])

    def positions(self) -> dict[str, Array]:
        """Points of the bars."""
        where = {name: self.point(name) for name in ("G2", "G3", "G4")}
        where.update(A=self.foot(3), O4=self.foot(4), B=self.point("end3"), B4=self.point("end4"))
        return where

    def gravity(self, vector: tuple[float, float]) -> None:
        """The model's own gravity."""
        self.model.opt.gravity[:2] = vector

    def foot(self, bar: int) -> Array:
        """First pin of a bar, (2,)."""
        return np.zeros(2) if bar == 1 else np.array(self.first_pin[bar])

    def centre(self, bar: int) -> Array:
        """Mass centre of a bar, from its site."""
        return self.point(f"G{bar}")

    def turned(self, bar: int, x: float, y: float) -> Array:
        """A vector of a bar in world axes, by the body's rotation."""
        if bar == 1:
            return turned_ground(self.ground_angle, x, y)
        return turned_by(self.rotation[bar].tolist(), x, y)

    def pin_load(self, pin: str) -> float:
        """Pin force of the last pass; none before the first."""
        return self.pin_loads.get(pin, 0.0)

    def angle(self, bar: int) -> float:
        """From the body's rotation matrix; the ground's line as described."""
        if bar == 1:
            return self.ground_angle
        rotation = self.rotation[bar]
        return math.atan2(rotation[1, 0], rotation[0, 0])

    def drift(self, v: Array) -> Array:
        """(dJ/dt) v from mj_jacDot."""
        self.data.qvel[:] = v
        mujoco.mj_comVel(self.model, self.data)
        on_3, on_4 = self._site_jacobian_rates("end3", "end4")
        return np.asarray((on_3 - on_4) @ v)

    def velocity(self, bar: int) -> float:
        """Spin of the body; the ground has none."""
        return float(self.data.cvel[self.body[bar], 2]) if bar != 1 else 0.0

    def alpha(self, bar: int) -> float:
        """From the body's rotational Jacobian, which is constant in the plane."""
        return float(self.turn(bar) @ self.data.qacc) if bar != 1 else 0.0

    def torques(self, v: Array, a: Array) -> Array:
        """mj_inverse, less what loads and effects do on the coordinates."""
        self.data.qvel[:], self.data.qacc[:] = v, a
        self.data.xfrc_applied[:] = 0.0
        mujoco.mj_inverse(self.model, self.data)
        for act in self.acting:
            act()
        applied = np.zeros(3)
        for bar, on in self.applied.items():
            mujoco.mj_applyFT(self.model, self.data, on[:3], on[3:], self.mass_centre[bar], self.body[bar], applied)
        return np.asarray(self.data.qfrc_inverse - applied)

    def inertial(self, v: Array, a: Array) -> Array:
        """mj_inverse without gravity."""
        gravity = self.model.opt.gravity.copy()
        self.model.opt.gravity[:] = 0.0
        self.data.qvel[:], self.data.qacc[:] = v, a
        self.data.xfrc_applied[:] = 0.0
        mujoco.mj_inverse(self.model, self.data)
        self.model.opt.gravity[:] = gravity
        return np.array(self.data.qfrc_inverse)

    def push(self, bar: int, force: Array, point: Array) -> None:
        """Add a force at a point, world axes, as force and couple at the mass centre; on the ground it does nothing."""
        if bar == 1:
            return
        (x, y), (f_x, f_y), on = (point - self.mass_centre[bar][:2]).tolist(), force.tolist(), self.applied[bar]
        on[0] += f_x
        on[1] += f_y
        on[5] += x * f_y - y * f_x

    def twist(self, bar: int, couple: float) -> None:
        """Add a couple; on the ground it does nothing."""
        if bar != 1:
            self.applied[bar][5] += couple

    def accelerations(self) -> dict[str, Array]:
        """J a + (dJ/dt) v of each point."""
        moved = self._site_jacobians(*ENDS.values()) @ self.data.qacc
        moved += self._site_jacobian_rates(*ENDS.values()) @ self.data.qvel
        return dict(zip(ENDS, moved, strict=True))

    def forces(self, loop_force: Array) -> dict[str, Array]:
        """cfrc_int, the force of the parent on each body, with the loop force put back."""
        self.push(3, loop_force, self.point("end3"))
        self.push(4, -loop_force, self.point("end4"))
        mujoco.mj_rnePostConstraint(self.model, self.data)
        on = {bar: np.array(self.data.cfrc_int[body, 3:5]) for bar, body in self.body.items()}
        return {"F12": on[2], "F32": -on[3], "F14": on[4]}
