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

TURNS_AT_LEAST = 0.1
"""Part of a bar's greatest speed above which a couple on it is judged: it has poles
where the bar stands still.
"""
SAMPLES = 720
"""States of a revolution that are read, at most; every step's where there are fewer
steps.
"""


@dataclass(frozen=True)
class LoopSettings:
    """Settings of MuJoCo, in the words of its documentation."""

    steps_per_revolution: float
    integrator: str = "RK4"
    solref_steps: float | None = None
    """solref[0] in timesteps; None leaves solref, solimp and solver to MuJoCo."""
    impedance: float = 0.9999
    pad: float | None = None
    wheel: float = 1e5
    """Armature of the crank's joint, kg m^2: a flywheel that keeps the speed."""


class Loop:
    """Four bars by the program of a textbook, and the drive on them."""

    def __init__(self, scene):
        self.bodies = Bodies(state_from_pins(scene), Textbook.newton_steps)
        self.d, self.a, self.b, self.c = map(float, scene.linkage.lengths)
        self.theta_1 = scene.linkage.ground_angle
        self.masses = self.bodies.mass.tolist()
        self.inertias = self.bodies.inertia.tolist()
        self.centres = self.bodies.centre.tolist()
        """Mass centres from the bars' first pins, along the bars."""
        (weight,) = scene.effects
        self.gravity = polar((weight.magnitude, weight.angle))
        self.loads = scene.loads
        self.drive = scene.drive or scene.drive_bar
        self.branch = scene.motion.branch

    def start(self, theta_2, omega_2):
        """Return angles and speeds of bars 2, 3 and 4 that close the loop."""
        assert self.bodies.close(theta_2, self.branch), "the circles do not meet"
        right = [0.0] * 8 + [omega_2]
        return self.bodies.theta, np.linalg.solve(self.bodies.jacobian(), right)[6:]

    def drive_direction(self, angles):
        """Return the forces on bars 2, 3 and 4, and their couples about the first pin
        of the bar, of a drive of size one.
        """
        forces, couples = [0j, 0j, 0j], [0.0, 0.0, 0.0]
        if isinstance(self.drive, int):
            couples[self.drive - 2] = 1.0
            return forces, couples
        A, O4 = polar((self.a, angles[0])), polar((self.d, self.theta_1))
        ends = []
        for end in (self.drive.start, self.drive.end):
            number = end.bar - 2
            arm = polar((end.distance, end.angle + angles[number]))
            ends.append((number, arm, (0j, A, O4)[number] + arm))
        line = ends[1][2] - ends[0][2]
        line /= abs(line)
        for (number, arm, _), push in zip(ends, (-line, line), strict=True):
            forces[number] += push
            couples[number] += _cross(arm, push)
        return forces, couples

    def write(self, settings, timestep, wheel):
        """Write the MJCF.

        Crank and coupler are in series, the rocker stands by itself, and a `connect`
        holds two sites together.
        """
        lengths = (self.a, self.b, self.c)

        def bar(number):
            centre = self.centres[number]
            inertia = " ".join([repr(self.inertias[number])] * 3)
            armature = f' armature="{wheel!r}"' if number == 0 else ""
            return (
                f'<inertial pos="{centre.real!r} {centre.imag!r} 0" '
                f'mass="{self.masses[number]!r}" diaginertia="{inertia}"/>'
                f'<joint name="pin{number}" axis="0 0 1"{armature}/>'
            )

        def closing_site(number):
            site = f'<site name="B{number}" pos="{lengths[number]!r} 0 0"/>'
            if settings.pad is None:
                return site
            place = settings.pad * lengths[number]
            return (
                f'<body><inertial pos="{place!r} 0 0" mass="0" diaginertia="0 0 0"/>'
                f"{site}</body>"
            )

        softness = option = ""
        if settings.solref_steps is not None:
            d = settings.impedance
            softness = (
                f'solref="{settings.solref_steps * timestep!r} 1" '
                f'solimp="{d!r} {d!r} 0.001 0.5 2"'
            )
            option = 'solver="Newton" tolerance="0" iterations="10"'
        gravity = f"{self.gravity.real!r} {self.gravity.imag!r} 0"
        ground = polar((self.d, self.theta_1))
        sites = [[], [], []]
        motors = []
        for index, load in enumerate(self.loads):
            number = load.bar - 2
            push = polar(load.force or (0.0, 0.0))
            place = self.centres[number] + polar(load.from_centre or (0.0, 0.0))
            frame = "" if load.frame == "bar" else 'refsite="world"'
            couple = load.moment
            if load.arm is not None:
                couple += _cross(polar(load.arm), push)
            sites[number].append(
                f'<site name="load{index}" pos="{place.real!r} {place.imag!r} 0"/>'
            )
            motors.append(
                f'<general site="load{index}" {frame} gaintype="fixed" gainprm="0" '
                f'biastype="affine" biasprm="1 0 0" gear="{push.real!r} {push.imag!r} '
                f'0 0 0 {couple!r}"/>'
            )
        return f"""
        <mujoco>
          <option timestep="{timestep!r}" integrator="{settings.integrator}"
                  gravity="{gravity}" {option}/>
          <worldbody>
            <site name="world"/>
            <body name="bar0">{bar(0)}{"".join(sites[0])}
              <body name="bar1" pos="{self.a!r} 0 0">
                {bar(1)}{"".join(sites[1])}{closing_site(1)}
              </body>
            </body>
            <body name="bar2" pos="{ground.real!r} {ground.imag!r} 0">
              {bar(2)}{"".join(sites[2])}{closing_site(2)}
            </body>
          </worldbody>
          <equality><connect site1="B2" site2="B1" {softness}/></equality>
          <actuator>{"".join(motors)}</actuator>
        </mujoco>"""


class Simulation:
    """A crank with a heavy flywheel carries the loop through its sweep."""

    def __init__(self, scene, settings):
        self.loop = Loop(scene)
        self.settings = settings
        self.sweep = fourbar.solve(scene, "position").theta_2
        self.omega = scene.motion.omega_2
        self.timestep = 2.0 * math.pi / settings.steps_per_revolution / abs(self.omega)
        self.model = self.compile(settings.wheel)
        self.data = mujoco.MjData(self.model)
        # a linkage that is driven elsewhere has no flywheel on its crank; pads stiffen
        # the closure next to one alone
        self.wheel_read = settings.wheel
        if self.loop.drive != 2 and settings.pad is None:
            self.wheel_read = 0.0
        self.probed = self.compile(self.wheel_read)
        self.probe = mujoco.MjData(self.probed)

    def compile(self, wheel):
        """Compile the loop with a flywheel."""
        text = self.loop.write(self.settings, self.timestep, wheel)
        return mujoco.MjModel.from_xml_string(text)

    def start(self, theta_2):
        """Close the loop at an angle of the crank."""
        angles, speeds = self.loop.start(theta_2, self.omega)
        self.data.qpos[:3] = angles[0], angles[1] - angles[0], angles[2]
        self.data.qvel[:3] = speeds[0], speeds[1] - speeds[0], speeds[2]

    def run(self):
        """Step through the sweep and read states on the way."""
        self.start(self.sweep[0] if self.omega > 0.0 else self.sweep[-1])
        n = self.settings.steps_per_revolution
        steps = math.floor(np.ptp(self.sweep) / (2.0 * math.pi) * n)
        stride = max(1, round(n / SAMPLES))
        samples = []
        for step in range(steps + 1):
            if step % stride == 0:
                samples.append(self.read())
            mujoco.mj_step(self.model, self.data)
        return samples

    def read(self):
        """Read angle, speed and acceleration of the crank in one state, pin forces, and
        the drive under "torque".

        The drive is the one that gives the crank the acceleration which the flywheel
        gives it.
        """
        mujoco.mj_forward(self.model, self.data)
        alpha_2 = self.data.qacc[0]
        angles, speeds = _add_crank(self.data.qpos), _add_crank(self.data.qvel)
        acceleration, closing, drive = self.probe_drive(angles, alpha_2)
        turned = _add_crank(acceleration)
        forces = self.balance(angles, speeds, turned, closing, drive)
        return angles[0], speeds[0], alpha_2, forces

    def probe_drive(self, angles, alpha_2):
        """Find the drive that gives the crank its acceleration.

        Return the accelerations of the joints and the closing force with it.
        """
        unit = self.generalized_drive(angles)
        answers = []
        wheel_torque = np.array([self.wheel_read * alpha_2, 0.0, 0.0])
        # large enough to be felt by the crank's acceleration above its round-off
        scale = max(self.wheel_read, 1.0) / np.abs(unit).max()
        probe = self.probe
        for amount in (0.0, scale):
            probe.qpos[:], probe.qvel[:] = self.data.qpos[:3], self.data.qvel[:3]
            probe.qfrc_applied[:] = wheel_torque + amount * unit
            mujoco.mj_forward(self.probed, probe)
            answers.append((probe.qacc.copy(), probe.efc_force[:2].copy()))
        (rest, rest_closing), (pushed, pushed_closing) = answers
        part = (alpha_2 - rest[0]) / (pushed[0] - rest[0])
        acceleration = rest + part * (pushed - rest)
        closing = rest_closing + part * (pushed_closing - rest_closing)
        return acceleration, closing, part * scale

    def generalized_drive(self, angles):
        """Return the generalized forces on the three joints of a drive of size one, by
        virtual work.
        """
        pushes, couples = self.loop.drive_direction(angles)
        crank = self.loop.a * np.exp(1j * angles[0])
        # bar 3 turns with both joints and is carried by A; a force on it acts on the
        # crank through A
        on_crank = couples[0] + couples[1] + _cross(crank, pushes[1])
        return np.array([on_crank, couples[1], couples[2]])

    def balance(self, angles, speeds, accelerations, closing, drive):
        """Find each pin's force from Newton's law of its bar."""
        loop = self.loop
        loop.bodies.theta = angles
        outside, _ = loop.bodies.applied(speeds)
        pushes, _ = loop.drive_direction(angles)
        needed = []
        for number in range(3):
            centre = loop.centres[number] * np.exp(1j * angles[number])
            of_centre = centre * (1j * accelerations[number] - speeds[number] ** 2)
            if number == 1:
                crank = loop.a * np.exp(1j * angles[0])
                of_centre += crank * (1j * accelerations[0] - speeds[0] ** 2)
            inertial = loop.masses[number] * of_centre
            needed.append(inertial - outside[number] - drive * pushes[number])
        force_34 = complex(closing[0], closing[1])
        force_14 = needed[2] - force_34
        force_23 = needed[1] + force_34
        force_12 = needed[0] + force_23
        forces = (force_12, -force_23, -force_34, force_14)
        pairs = [np.array([force.real, force.imag]) for force in forces]
        return {
            **dict(zip(PIN_FORCES, pairs, strict=True)),
            "torque": np.array([drive]),
        }


def measure(scene, settings):
    """Return the worst error of the drive and of each pin's force, relative to the
    largest value in the sweep.
    """
    *motion, forces = zip(*Simulation(scene, settings).run(), strict=True)
    angle, speed, acceleration = np.array(motion)
    branch = np.full(len(angle), scene.motion.branch)
    at = Command(angle, branch, speed, acceleration)
    right = fourbar.solve(scene, at=at)
    drive, speed = "torque", right[f"omega_{scene.drive_bar or 2}"]
    if scene.drive is not None:
        drive, speed = "drive_force", right.stroke_speed
    judged = np.ones(len(angle), dtype=bool)
    if scene.drive is not None or scene.drive_bar != 2:  # with poles where it rests
        judged = np.abs(speed) > TURNS_AT_LEAST * np.abs(speed).max()
    errors = {}
    for name in ("torque", *PIN_FORCES):
        ours = np.array([one[name] for one in forces])[judged]
        exact = right[drive if name == "torque" else name][judged]
        exact = exact.reshape(ours.shape)
        apart, size = (np.linalg.norm(one, axis=1) for one in (ours - exact, exact))
        errors[name] = apart.max() / size.max()
    return errors


def _add_crank(joints):
    """Return angles, speeds or accelerations of the bars: the coupler's joint turns
    on the crank.
    """
    return np.array([joints[0], joints[0] + joints[1], joints[2]])


def _cross(arm, force):
    return (arm.conjugate() * force).imag
