"""MuJoCo's inverse dynamics on the open tree, constraints off.

Multipliers close the loop.
"""

import warnings
from collections.abc import Iterable, Sequence
from functools import partial
from typing import Any

import mujoco
import numpy as np

from fourbar.errors import LimitError
from fourbar.linkage import MOVING_BARS
from fourbar.quantities import Array
from fourbar.scene import Scene
from fourbar_validation.engines.description import (
    MovingPart,
    find_unknown,
    list_moving_parts,
)
from fourbar_validation.engines.limits import LIGHTEST
from fourbar_validation.engines.loaded import (
    Components,
    Wrenches,
    has_term,
    list_wrenches,
)
from fourbar_validation.engines.loop import Exact
from fourbar_validation.engines.tree import Tree


def find_limit_met(parts: Iterable[MovingPart]) -> str:
    """Name the declared limit that moving bars meet, if any."""
    least = LIGHTEST.boundary
    for part in parts:
        if min(part.mass, part.inertia) < least:
            return (
                f"bar {part.bar} has mass {part.mass:g} kg and inertia {part.inertia:g}"
                f" kg m^2; MuJoCo compiles no moving body below {least:g} of either"
            )
    return ""


_SITE = mujoco.mjtObj.mjOBJ_SITE.value


class MujocoTree(Tree):
    """The open tree, built from the description; constraints are off."""

    def __init__(self, scene: Scene) -> None:
        parts = list_moving_parts(scene.linkage)
        reason = find_unknown(scene, has_term, forces=True) or find_limit_met(parts)
        if reason:
            raise LimitError(reason)
        spec = mujoco.MjSpec()
        spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        bodies: dict[int, Any] = {1: spec.worldbody}
        for part in parts:
            body = bodies[part.bearer].add_body(name=f"bar{part.bar}")
            bodies[part.bar] = body
            body.pos = [*part.first_pin, 0.0]
            body.explicitinertial = True
            body.mass = part.mass
            body.ipos = [*part.centre, 0.0]
            body.inertia = [part.inertia] * 3
            body.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0.0, 0.0, 1.0])
            for name, place in part.points.items():
                body.add_site(name=name, pos=[*place, 0.0])
        # the compiler evaluates the bars once, and warns of a mass matrix that the
        # inverse dynamics never invert
        with warnings.catch_warnings(action="ignore"):
            self.model = model = spec.compile()
        # a centre or site nearer than 1e-6 m is taken for the body's origin, silently;
        # these marks are why
        model.body_sameframe[:] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
        model.site_sameframe[:] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
        model.body_simple[:] = 0
        model.dof_simplenum[:] = 0
        self.data = data = mujoco.MjData(model)
        self.body = {bar: model.body(f"bar{bar}").id for bar in MOVING_BARS}
        self.site = {model.site(number).name: number for number in range(model.nsite)}
        # the engine's own memory, read in place: to look it up again takes longer than
        # its work
        self.at = {name: data.site_xpos[site, :2] for name, site in self.site.items()}
        axes = data.xmat.reshape(-1, 3, 3)[:, :2, :2]
        self.turned_to = {bar: axes[body] for bar, body in self.body.items()}
        self._jac = np.zeros((3, 3))
        self._acceleration = np.zeros(6)
        self.ready(scene, list_wrenches(scene, self))

    def place(self, q: Sequence[float]) -> None:
        """Place bodies, sites and the axes of the Jacobians at q."""
        self.data.qpos[:] = q
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)

    def point_jacobian(self, name: str) -> Array:
        """Return the Jacobian of a site."""
        mujoco.mj_jacSite(self.model, self.data, self._jac, None, self.site[name])
        return self._jac[:2].copy()

    def turn(self, bar: int) -> Array:
        """Return the last row of the body's rotational Jacobian."""
        mujoco.mj_jacBody(self.model, self.data, None, self._jac, self.body[bar])
        return np.array(self._jac[2])

    def set_motion(self, v: Array, a: Array) -> None:
        """Set the speeds of the bodies."""
        self.data.qvel[:] = v
        self.data.qacc[:] = a
        mujoco.mj_comVel(self.model, self.data)

    def accelerations(self, names: Iterable[str]) -> list[list[float]]:
        """Return the accelerations of sites in world axes, m/s^2."""
        model = self.model
        data = self.data
        # MuJoCo counts gravity as an acceleration of the world
        model.opt.gravity[:2] = 0.0
        mujoco.mj_rnePostConstraint(model, data)
        accelerations = []
        for name in names:
            mujoco.mj_objectAcceleration(
                model, data, _SITE, self.site[name], self._acceleration, 0
            )
            *_, x, y, _ = self._acceleration.tolist()
            accelerations.append([x, y])
        return accelerations

    def needed(
        self,
        field: Components,
        wrenches: Wrenches,
    ) -> list[float]:
        """Return the coordinates' forces by mj_inverse, less loads and effects."""
        self.model.opt.gravity[:2] = field
        mujoco.mj_inverse(self.model, self.data)
        applied = np.zeros(3)
        for bar, (x, y, moment) in wrenches.items():
            if x or y or moment:
                mujoco.mj_applyFT(
                    self.model,
                    self.data,
                    np.array([x, y, 0.0]),
                    np.array([0.0, 0.0, moment]),
                    self.data.xpos[self.body[bar]],
                    self.body[bar],
                    applied,
                )
        torques: list[float] = (self.data.qfrc_inverse - applied).tolist()
        return torques

    def joint_forces(self) -> dict[int, complex]:
        """Return cfrc_int, the force of the parent on each body."""
        data = self.data
        for bar, body in self.body.items():
            # the couples about the mass centres, at which these forces act, ask nothing
            # of the pins of a tree
            data.xfrc_applied[body, :2] = self.wrenches[bar][:2]
        mujoco.mj_rnePostConstraint(self.model, data)
        return {
            bar: complex(*data.cfrc_int[body, 3:5].tolist())
            for bar, body in self.body.items()
        }


MujocoInverse = partial(Exact, "mujoco-inverse", MujocoTree)
