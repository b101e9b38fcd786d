"""A slider-crank in MuJoCo, by mj_inverse without constraints.

The tree is open at B.
"""

import mujoco
import numpy as np

from fourbar.quantities import Array
from fourbar_lab.simulators.slider_engines import SliderBar, SliderCrank

VERSION = mujoco.__version__
_NO_INERTIA = 1e-12
"""Inertia of the slider, which does not turn, kg m^2. MuJoCo holds no body without any.
"""


class MujocoSlider:
    """The tree, with sites at the rod's end and the slider."""

    def __init__(self, linkage: SliderCrank) -> None:
        of_crank, of_rod, of_slider = map(_write_inertial, linkage.bars)
        hinge = '<joint type="hinge" axis="0 0 1"/>'
        gravity_x, gravity_y = linkage.gravity.tolist()
        self.model = mujoco.MjModel.from_xml_string(f"""
        <mujoco>
          <option gravity="{gravity_x!r} {gravity_y!r} 0">
            <flag constraint="disable"/>
          </option>
          <worldbody>
            <body name="crank">{hinge}{of_crank}
              <body name="rod" pos="{linkage.crank!r} 0 0">{hinge}{of_rod}
                <site name="end" pos="{linkage.rod!r} 0 0"/>
              </body>
            </body>
            <body name="slider" pos="0 {linkage.offset!r} 0">
              <joint type="slide" axis="1 0 0"/>{of_slider}
              <site name="slider"/>
            </body>
          </worldbody>
        </mujoco>""")
        self.data = mujoco.MjData(self.model)
        self.bodies = [self.model.body(name).id for name in ("crank", "rod", "slider")]
        self.sites = [self.model.site(name).id for name in ("end", "slider")]

    def set(self, q: Array, v: Array) -> None:
        """Set joint positions and speeds."""
        self.data.qpos[:] = q
        self.data.qvel[:] = v
        self.data.qacc[:] = 0.0
        mujoco.mj_fwdPosition(self.model, self.data)
        mujoco.mj_fwdVelocity(self.model, self.data)

    def follow(self, end: int) -> tuple[Array, Array, Array]:
        """Return place, Jacobian and drift of an end of the cut."""
        site = self.sites[end]
        place = self.data.site_xpos[site]
        slope = np.zeros((3, 3))
        rate = np.zeros((3, 3))
        mujoco.mj_jacSite(self.model, self.data, slope, None, site)
        body = self.model.site_bodyid[site]
        mujoco.mj_jacDot(self.model, self.data, rate, None, place, body)
        return place[:2].copy(), slope[:2], rate[:2] @ self.data.qvel

    def inverse(self, a: Array) -> Array:
        """Return the joint forces of accelerations a, with no force at the cut."""
        self.data.xfrc_applied[:] = 0.0
        self.data.qacc[:] = a
        mujoco.mj_inverse(self.model, self.data)
        return np.array(self.data.qfrc_inverse)

    def borne(self, a: Array, on_ends: tuple[Array, Array]) -> list[Array]:
        """Return the force on crank, rod and slider by the body before, (2,), N."""
        for body, force, site in zip(self.bodies[1:], on_ends, self.sites, strict=True):
            arm = self.data.site_xpos[site] - self.data.xipos[body]
            pull = np.array([*force, 0.0])
            self.data.xfrc_applied[body] = [*pull, *np.cross(arm, pull)]
        self.data.qacc[:] = a
        mujoco.mj_rnePostConstraint(self.model, self.data)
        return [np.array(self.data.cfrc_int[body][3:5]) for body in self.bodies]


def _write_inertial(body: SliderBar) -> str:
    x, y = body.centre
    inertia = body.inertia or _NO_INERTIA
    return (
        f'<inertial pos="{x!r} {y!r} 0" mass="{body.mass!r}"'
        f' diaginertia="{inertia!r} {inertia!r} {inertia!r}"/>'
    )
