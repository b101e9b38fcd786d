"""MuJoCo's inverse dynamics on the open tree, constraints off.

Multipliers close the loop.
"""

from collections.abc import Iterable, Sequence
from copy import copy
from functools import cache, partial
from typing import Any

import mujoco
import numpy as np

from fourbar.errors import LimitError
from fourbar.linkage import uniform
from fourbar.quantities import Array
from fourbar.scene import Scene
from fourbar_validation.engines.applied_effects import has_term, list_wrenches
from fourbar_validation.engines.description import (
    PIN_OF_MOVING_BAR,
    MovingPart,
    find_unknown,
    list_moving_parts,
)
from fourbar_validation.engines.limits import LIGHTEST
from fourbar_validation.engines.loop import Exact
from fourbar_validation.engines.tree import KeptTree, keep_tree


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


@cache
def _compile_bars() -> mujoco.MjModel:
    """Compile the open tree of three bars of unit length and mass.

    Constraints are off; what is fixed lies at 0. Only numbers differ from tree to tree,
    and to compile takes a hundred times as long as to write them. What the compiler
    takes from nobody, `find_limit_met` refuses.
    """
    spec = mujoco.MjSpec()
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    bodies: dict[int, Any] = {1: spec.worldbody}
    for part in list_moving_parts(uniform(1.0, 1.0, 1.0, 1.0)):
        body = bodies[part.bearer].add_body(name=f"bar{part.bar}")
        bodies[part.bar] = body
        body.explicitinertial = True
        body.mass = part.mass
        body.inertia = [part.inertia] * 3
        body.add_joint(
            name=PIN_OF_MOVING_BAR[part.bar],
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=[0.0, 0.0, 1.0],
        )
        for name in part.points:
            body.add_site(name=name)
    model = spec.compile()
    # a centre or site nearer than 1e-6 m is taken for the body's origin, silently;
    # these marks are why
    model.body_sameframe[:] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
    model.site_sameframe[:] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
    model.body_simple[:] = 0
    model.dof_simplenum[:] = 0
    dofs = [int(model.joint(pin).dofadr[0]) for pin in PIN_OF_MOVING_BAR.values()]
    assert dofs == [0, 1, 2]
    return model


_SITE = mujoco.mjtObj.mjOBJ_SITE.value


class MujocoTree(KeptTree):
    """The open tree, its numbers written from the description."""

    def __init__(self, scene: Scene) -> None:
        self.model = model = copy(_compile_bars())
        self.data = data = mujoco.MjData(model)
        self.body = {bar: model.body(f"bar{bar}").id for bar in PIN_OF_MOVING_BAR}
        self.site = {model.site(number).name: number for number in range(model.nsite)}
        # the engine's own memory, read and written in place: to look it up again takes
        # longer than its work
        self.at = {name: data.site_xpos[site, :2] for name, site in self.site.items()}
        self.turned_to = {}
        self.first_pins: dict[int, Array] = {}
        self.joint_force: dict[int, Array] = {}
        self.applied: dict[int, Array] = {}
        for bar, body in self.body.items():
            self.turned_to[bar] = data.xmat[body].reshape(3, 3)[:2, :2]
            self.first_pins[bar] = data.xpos[body]
            self.joint_force[bar] = data.cfrc_int[body, 3:5]
            self.applied[bar] = data.xfrc_applied[body]
        self._jac = np.zeros((3, 3))
        self._acceleration = np.zeros(6)
        self._force = np.zeros(3)
        self._couple = np.zeros(3)
        self.hold(scene)

    def hold(self, scene: Scene) -> None:
        """Write places, masses and inertias.

        Of what the compiler derives from them inverse dynamics reads the borne masses
        alone.
        """
        parts = list_moving_parts(scene.linkage)
        reason = find_unknown(scene, has_term, forces=True) or find_limit_met(parts)
        if reason:
            raise LimitError(reason)
        model = self.model
        mujoco.mj_resetData(model, self.data)
        for part in parts:
            body = self.body[part.bar]
            model.body_pos[body, :2] = part.first_pin
            model.body_ipos[body, :2] = part.centre
            model.body_mass[body] = part.mass
            model.body_subtreemass[body] = part.mass
            model.body_inertia[body] = part.inertia
            if part.bearer != 1:
                model.body_subtreemass[self.body[part.bearer]] += part.mass
            for name, place in part.points.items():
                model.site_pos[self.site[name], :2] = place
        self.field = (0.0, 0.0)
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
        field: tuple[float, float],
        wrenches: dict[int, list[float]],
    ) -> list[float]:
        """Return the coordinates' forces by mj_inverse, less loads and effects."""
        self.model.opt.gravity[:2] = field
        mujoco.mj_inverse(self.model, self.data)
        applied = np.zeros(3)
        for bar, wrench in wrenches.items():
            if any(wrench):
                self._force[0], self._force[1], self._couple[2] = wrench
                mujoco.mj_applyFT(
                    self.model,
                    self.data,
                    self._force,
                    self._couple,
                    self.first_pins[bar],
                    self.body[bar],
                    applied,
                )
        torques: list[float] = (self.data.qfrc_inverse - applied).tolist()
        return torques

    def joint_forces(self) -> dict[int, complex]:
        """Return cfrc_int, the force of the parent on each body."""
        for bar, (x, y, _) in self.wrenches.items():
            # the couples about the mass centres, at which these forces act, ask nothing
            # of the pins of a tree
            applied = self.applied[bar]
            applied[0] = x
            applied[1] = y
        mujoco.mj_rnePostConstraint(self.model, self.data)
        return {
            bar: complex(*force.tolist()) for bar, force in self.joint_force.items()
        }


MujocoInverse = partial(Exact, "mujoco-inverse", partial(keep_tree, MujocoTree))
