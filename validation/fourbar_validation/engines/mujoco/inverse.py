"""MuJoCo's inverse dynamics on the open tree, constraints off; the loop is closed by multipliers."""

import warnings
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from fourbar.errors import LimitError
from fourbar.scene import Scene
from fourbar_validation.compare.answer import Array
from fourbar_validation.engines.description import FIRST_PIN, find_unknown, list_parts
from fourbar_validation.engines.effects import has_term, list_acting
from fourbar_validation.engines.limits import LIGHTEST
from fourbar_validation.engines.loop import Exact
from fourbar_validation.engines.tree import Tree


def find_refusal(scene: Scene) -> str:
    """Name the declared limit that a scene meets, if any."""
    if reason := find_unknown(scene, has_term, linear=True):
        return reason
    for part in list_parts(scene.linkage):
        if min(part.mass, part.inertia) < LIGHTEST.boundary:
            return (
                f"bar {part.bar} has mass {part.mass:g} kg and inertia {part.inertia:g} kg m^2; "
                f"MuJoCo compiles no moving body below {LIGHTEST.boundary:g} of either"
            )
    return ""


class MujocoTree(Tree):
    """The open tree, built from the description with MjSpec."""

    def __init__(self, scene: Scene, data: mujoco.MjData | None = None) -> None:
        spec = mujoco.MjSpec()
        spec.option.disableflags |= (
            mujoco.mjtDisableBit.mjDSBL_CONSTRAINT | mujoco.mjtDisableBit.mjDSBL_CONTACT
        )
        bodies: dict[int, Any] = {1: spec.worldbody}
        for part in list_parts(scene.linkage):
            body = bodies[part.bar] = bodies[part.bearer].add_body(
                name=f"bar{part.bar}", pos=[*part.first_pin, 0.0]
            )
            body.explicitinertial = True
            body.mass, body.ipos, body.inertia = (
                part.mass,
                [*part.centre, 0.0],
                [part.inertia] * 3,
            )
            body.add_joint(
                name=FIRST_PIN[part.bar],
                type=mujoco.mjtJoint.mjJNT_HINGE,
                axis=[0.0, 0.0, 1.0],
            )
            for name, place in part.points.items():
                body.add_site(name=name, pos=[*place, 0.0])
        with warnings.catch_warnings():
            # the warning is about the mass matrix at q = 0, which inverse dynamics never divides by
            warnings.filterwarnings("ignore", "Inertia matrix is too close to singular")
            self.model = model = spec.compile()
        # a centre or site nearer than 1e-6 m is taken for the body's origin, silently; these marks are why
        model.body_sameframe[:] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
        model.site_sameframe[:] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
        model.body_simple[:] = model.dof_simplenum[:] = 0
        self.data = mujoco.MjData(model) if data is None else data
        mujoco.mj_resetData(model, self.data)
        self.body = {bar: model.body(f"bar{bar}").id for bar in FIRST_PIN}
        self.site = {model.site(number).name: number for number in range(model.nsite)}
        assert [int(model.joint(pin).dofadr[0]) for pin in FIRST_PIN.values()] == [
            0,
            1,
            2,
        ]  # depth first
        # the engine's own memory, read in place
        self.at = {
            name: self.data.site_xpos[site, :2] for name, site in self.site.items()
        }
        self.turned_to = {
            bar: self.data.xmat[body].reshape(3, 3)[:2, :2]
            for bar, body in self.body.items()
        }
        self._jac, self._dot = np.zeros((3, 3)), np.zeros((3, 3))
        self.ready(scene, list_acting(scene, self))

    def place(self, q: Sequence[float]) -> None:
        """Place bodies, sites and the axes of the Jacobians at q."""
        self.data.qpos[:] = q
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)

    def point(self, name: str) -> Array:
        """Place of a site."""
        return np.asarray(self.at[name])

    def rotation(self, bar: int) -> Array:
        """Return that of the body."""
        return np.asarray(self.turned_to[bar])

    def point_jacobian(self, name: str) -> Array:
        """Return that of a site."""
        mujoco.mj_jacSite(self.model, self.data, self._jac, None, self.site[name])
        return self._jac[:2].copy()

    def turn(self, bar: int) -> Array:
        """Return the last row of the body's rotational Jacobian."""
        mujoco.mj_jacBody(self.model, self.data, None, self._jac, self.body[bar])
        return np.array(self._jac[2])

    def set_motion(self, v: Array, a: Array) -> None:
        """Set the speeds of the bodies."""
        self.data.qvel[:], self.data.qacc[:] = v, a
        mujoco.mj_comVel(self.model, self.data)

    def acceleration(self, name: str) -> Array:
        """Return J a + (dJ/dt) v of a site."""
        site, body = self.site[name], self.body[int(name[-1])]
        mujoco.mj_jacSite(self.model, self.data, self._jac, None, site)
        mujoco.mj_jacDot(
            self.model, self.data, self._dot, None, self.data.site_xpos[site], body
        )
        return np.asarray((self._jac @ self.a + self._dot @ self.v)[:2])

    def needed(
        self, field: tuple[float, float], wrenches: dict[int, list[float]]
    ) -> Array:
        """Return the result of mj_inverse less what loads and effects do on the coordinates."""
        self.model.opt.gravity[:] = (*field, 0.0)
        self.data.xfrc_applied[:] = 0.0
        mujoco.mj_inverse(self.model, self.data)
        applied = np.zeros(3)
        for bar, (x, y, moment) in (
            (bar, wrench) for bar, wrench in wrenches.items() if any(wrench)
        ):
            force, couple, body = (
                np.array([x, y, 0.0]),
                np.array([0.0, 0.0, moment]),
                self.body[bar],
            )
            mujoco.mj_applyFT(
                self.model,
                self.data,
                force,
                couple,
                self.data.xpos[body],
                body,
                applied,
            )
        return np.asarray(self.data.qfrc_inverse - applied)

    def carried(self) -> dict[int, Array]:
        """Return cfrc_int, the force of the parent on each body."""
        for bar, (x, y, moment) in self.wrenches.items():
            body = self.body[bar]
            to_x, to_y = (self.data.xipos[body] - self.data.xpos[body])[
                :2
            ]  # xfrc_applied acts at the mass centre
            self.data.xfrc_applied[body] = (
                x,
                y,
                0.0,
                0.0,
                0.0,
                moment - (to_x * y - to_y * x),
            )
        mujoco.mj_rnePostConstraint(self.model, self.data)
        return {
            bar: np.array(self.data.cfrc_int[body, 3:5])
            for bar, body in self.body.items()
        }


class MujocoInverse(Exact):
    """Trees in the memory of the one before: allocating it takes MuJoCo longer than all its work."""

    def __init__(self) -> None:
        super().__init__("mujoco-inverse", self._make_tree)
        self.data: mujoco.MjData | None = None

    def _make_tree(self, scene: Scene) -> MujocoTree:
        if reason := find_refusal(scene):
            raise LimitError(reason)
        tree = MujocoTree(scene, self.data)
        self.data = tree.data
        return tree
