"""A slider-crank in MuJoCo, by mj_inverse without constraints.

The tree is open at B.
"""

import mujoco
import numpy as np

from fourbar.quantities import Array
from fourbar_lab.simulators.slider_engines import SliderBar

VERSION = mujoco.__version__
_NO_INERTIA = 1e-12
"""Inertia of the slider, which does not turn, kg m^2. MuJoCo holds no body without any.
"""


class MujocoSlider:
    """The tree, with sites at the rod's end and the slider."""

    def __init__(
        self,
        bodies: list[SliderBar],
        lengths: tuple[float, float, float],
        field: Array,
        push: Array,
    ) -> None:
        crank, rod, offset = lengths
        of_crank, of_rod, of_slider = map(_write_inertial, bodies)
        hinge = '<joint type="hinge" axis="0 0 1"/>'
        gravity_x, gravity_y = field.tolist()
        lines = [
            "<mujoco>",
            f'<option gravity="{gravity_x!r} {gravity_y!r} 0">',
            '<flag constraint="disable"/>',
            "</option>",
            "<worldbody>",
            f'<body name="crank">{hinge}{of_crank}',
            f'<body name="rod" pos="{crank!r} 0 0">{hinge}{of_rod}',
            f'<site name="end" pos="{rod!r} 0 0"/>',
            "</body>",
            "</body>",
            f'<body name="slider" pos="0 {offset!r} 0">',
            f'<joint type="slide" axis="1 0 0"/>{of_slider}',
            '<site name="slider"/>',
            "</body>",
            "</worldbody>",
            "</mujoco>",
        ]
        self.model = mujoco.MjModel.from_xml_string("\n".join(lines))
        self.data = mujoco.MjData(self.model)
        self.push = push
        self.bodies = [self.model.body(name).id for name in ("crank", "rod", "slider")]
        self.sites = [self.model.site(name).id for name in ("end", "slider")]

    def set(self, q: Array, v: Array) -> None:
        """Set joint positions and speeds."""
        self.data.qpos[:], self.data.qvel[:], self.data.qacc[:] = q, v, 0.0
        mujoco.mj_fwdPosition(self.model, self.data)
        mujoco.mj_fwdVelocity(self.model, self.data)

    def gap(self) -> tuple[Array, Array, Array]:
        """Return the rod's end less the slider (2,), its Jacobian and its drift."""
        slopes = np.zeros((2, 3, 3))
        rates = np.zeros((2, 3, 3))
        for slope, rate, site in zip(slopes, rates, self.sites, strict=True):
            mujoco.mj_jacSite(self.model, self.data, slope, None, site)
            body = self.model.site_bodyid[site]
            mujoco.mj_jacDot(
                self.model,
                self.data,
                rate,
                None,
                self.data.site_xpos[site],
                body,
            )
        end, slider = (self.data.site_xpos[site][:2] for site in self.sites)
        return (
            end - slider,
            (slopes[0] - slopes[1])[:2],
            (rates[0] - rates[1])[:2] @ self.data.qvel,
        )

    def inverse(self, a: Array) -> Array:
        """Return the joint forces of accelerations a, without the closing force."""
        self.data.xfrc_applied[:], self.data.qacc[:] = 0.0, a
        mujoco.mj_inverse(self.model, self.data)
        slope = np.zeros((3, 3))
        mujoco.mj_jacSite(self.model, self.data, slope, None, self.sites[1])
        return np.array(self.data.qfrc_inverse) - slope[:2].T @ self.push

    def borne(self, a: Array, closing: Array) -> tuple[Array, Array, Array]:
        """Return the force on crank, rod and slider by the body before, (2,), N."""
        for body, force, site in zip(
            self.bodies[1:],
            (closing, self.push - closing),
            self.sites,
            strict=True,
        ):
            arm = self.data.site_xpos[site] - self.data.xipos[body]
            pull = np.array([*force, 0.0])
            self.data.xfrc_applied[body] = [*pull, *np.cross(arm, pull)]
        self.data.qacc[:] = a
        mujoco.mj_rnePostConstraint(self.model, self.data)
        forces = [np.array(self.data.cfrc_int[body][3:5]) for body in self.bodies]
        return forces[0], forces[1], forces[2]


def _write_inertial(body: SliderBar) -> str:
    x, y = body.centre
    inertia = body.inertia or _NO_INERTIA
    return (
        f'<inertial pos="{x!r} {y!r} 0" mass="{body.mass!r}"'
        f' diaginertia="{inertia!r} {inertia!r} {inertia!r}"/>'
    )
