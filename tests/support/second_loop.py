"""Simulate a four-bar a second time, from MuJoCo's documentation alone.

Not the MJCF of `fourbar_validation`, its assembly, its stepping, its reading of forces,
or its comparison: the bodies are those of a textbook. The formulas judge what is
simulated, and the simulation is told none of their numbers.
"""

import math
from dataclasses import dataclass

import mujoco
import numpy as np

import fourbar
from fourbar.quantities import PIN_FORCES
from fourbar.scene import Command
from fourbar_validation.compare.pins import state_from_pins
from tests.support.textbook import Bodies, Textbook, polar


@dataclass(frozen=True)
class LoopSettings:
    """Settings of MuJoCo, in the words of its documentation."""

    steps_per_revolution: float
    integrator: str
    solref_steps: float | None = None
    """solref[0] in timesteps; None leaves solref, solimp and solver to MuJoCo."""
    impedance: float = 0.9999
    pad: float | None = None
    wheel: float = 1e5
    """Armature of the crank's joint, kg m^2: a flywheel that keeps the speed."""


class Loop:
    """A crank with a heavy flywheel carries bars and their weight through a turn."""

    def __init__(self, scene, settings):
        self.settings = settings
        self.bodies = Bodies(state_from_pins(scene), Textbook.newton_steps)
        self.a, *_ = self.lengths = self.bodies.lengths[1:]
        (weight,) = scene.effects
        self.gravity = polar((weight.magnitude, weight.angle))
        self.motion = scene.motion
        seconds = 2.0 * math.pi / self.motion.omega_2
        self.timestep = seconds / settings.steps_per_revolution
        self.model = mujoco.MjModel.from_xml_string(self.write())
        self.data = mujoco.MjData(self.model)

    def write(self):
        """Write the MJCF.

        Crank and coupler are in series, the rocker stands by itself, and a `connect`
        holds two sites together.
        """
        settings = self.settings
        masses, inertias, centres = (
            values.tolist()
            for values in (self.bodies.mass, self.bodies.inertia, self.bodies.centre)
        )

        def bar(number):
            centre = centres[number]
            inertia = " ".join([repr(inertias[number])] * 3)
            armature = f' armature="{settings.wheel!r}"' if number == 0 else ""
            return (
                f'<inertial pos="{centre.real!r} {centre.imag!r} 0" '
                f'mass="{masses[number]!r}" diaginertia="{inertia}"/>'
                f'<joint name="pin{number}" axis="0 0 1"{armature}/>'
            )

        def closing_site(number):
            site = f'<site name="B{number}" pos="{self.lengths[number]!r} 0 0"/>'
            if settings.pad is None:
                return site
            place = settings.pad * self.lengths[number]
            return (
                f'<body><inertial pos="{place!r} 0 0" mass="0" diaginertia="0 0 0"/>'
                f"{site}</body>"
            )

        softness = option = ""
        if settings.solref_steps is not None:
            d = settings.impedance
            softness = (
                f'solref="{settings.solref_steps * self.timestep!r} 1" '
                f'solimp="{d!r} {d!r} 0.001 0.5 2"'
            )
            option = 'solver="Newton" tolerance="0" iterations="10"'
        ground = complex(self.bodies.ground)
        return f"""
        <mujoco>
          <option timestep="{self.timestep!r}" integrator="{settings.integrator}"
                  gravity="{self.gravity.real!r} {self.gravity.imag!r} 0" {option}/>
          <worldbody>
            <body name="bar0">{bar(0)}
              <body name="bar1" pos="{self.a!r} 0 0">{bar(1)}{closing_site(1)}</body>
            </body>
            <body name="bar2" pos="{ground.real!r} {ground.imag!r} 0">
              {bar(2)}{closing_site(2)}
            </body>
          </worldbody>
          <equality><connect site1="B2" site2="B1" {softness}/></equality>
        </mujoco>"""

    def start(self, theta_2):
        """Close the loop at an angle of the crank, and let it move."""
        assert self.bodies.close(theta_2, self.motion.branch)
        right = [0.0] * 8 + [self.motion.omega_2]
        speeds = np.linalg.solve(self.bodies.jacobian(), right)[6:]
        for of_joints, of_bars in (
            (self.data.qpos, self.bodies.theta),
            (self.data.qvel, speeds),
        ):
            of_joints[:3] = of_bars
            of_joints[1] -= of_bars[0]

    def run(self, theta_2):
        """Step through a turn from an angle on and read states on the way."""
        self.start(theta_2)
        for _ in range(round(self.settings.steps_per_revolution) + 1):
            yield self.read()
            mujoco.mj_step(self.model, self.data)

    def read(self):
        """Read angle, speed and acceleration of the crank in one state, pin forces, and
        the torque that the flywheel exerts.
        """
        mujoco.mj_forward(self.model, self.data)
        data = self.data
        angles, speeds, accelerations = (
            # the coupler's joint turns on the crank
            np.array([joints[0], joints[0] + joints[1], joints[2]])
            for joints in (data.qpos, data.qvel, data.qacc)
        )
        forces = self.balance(angles, speeds, accelerations)
        forces["torque"] = [-self.settings.wheel * accelerations[0]]
        return angles[0], speeds[0], accelerations[0], forces

    def balance(self, angles, speeds, accelerations):
        """Find each pin's force from Newton's law of its bar."""
        bent = np.exp(1j * angles) * (1j * accelerations - speeds**2)
        of_centres = self.bodies.centre * bent
        of_centres[1] += self.a * bent[0]
        needed = self.bodies.mass * (of_centres - self.gravity)
        force_34 = complex(*self.data.efc_force[:2])
        force_14 = needed[2] - force_34
        force_23 = needed[1] + force_34
        forces = (needed[0] + force_23, -force_23, -force_34, force_14)
        pairs = [[force.real, force.imag] for force in forces]
        return dict(zip(PIN_FORCES, pairs, strict=True))


def measure(scene, settings):
    """Return the worst error of the torque and of each pin's force, relative to the
    largest value in the turn.
    """
    states = Loop(scene, settings).run(fourbar.command(scene).theta_2[0])
    *motion, forces = zip(*states, strict=True)
    angle, speed, acceleration = np.array(motion)
    branch = np.full(len(angle), scene.motion.branch)
    right = fourbar.solve(scene, at=Command(angle, branch, speed, acceleration))
    errors = {}
    for name in ("torque", *PIN_FORCES):
        ours = np.array([one[name] for one in forces])
        exact = right[name].reshape(ours.shape)
        apart, size = (np.linalg.norm(one, axis=1) for one in (ours - exact, exact))
        errors[name] = apart.max() / size.max()
    return errors
