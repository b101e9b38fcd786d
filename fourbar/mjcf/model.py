"""The settings, bodies, joints and sites of an MJCF model, and how they look."""

import cmath
import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, Literal
from xml.etree import ElementTree as ET

import numpy as np

from fourbar.errors import InputError, write_in_units
from fourbar.linkage import BAR_NAMES, FIRST_PIN, MOVING_BARS, PINS, FourBar, record

if TYPE_CHECKING:
    from fourbar.effects import LinearDrive, Load
    from fourbar.effects.effect import Joints
    from fourbar.effects.spring import Spring
    from fourbar.scene import Scene


FULL_TURN = math.tau * (1.0 - 1e-9)
"""rad; a sweep over 0..360 deg may miss the turn by its rounding."""
FINEST_STEPS = 3e5
"""Steps per revolution beyond which a narrow window gains nothing. The closure divides
the rounding of positions by its time constant squared; measured, accelerations were
1e-3 wrong in a window of 1e-3 rad with 2000 steps.
"""


@record
class Settings:
    """Settings of MuJoCo in the file.

    The defaults carry a linkage of 5 mm to 100 m at any speed.

    Parameters
    ----------
    timestep : s; None: from the two numbers of steps.
    steps_per_window : at least so many where the input does not turn fully: towards a
        limit position bars 3 and 4 speed up without bound, and 628 steps per revolution
        are too few there. `FINEST_STEPS` bounds them.
    timestep_scale : factor on the timestep.
    integrator : "RK4", "Euler", "implicit" or "implicitfast".
    time_constant_steps : solref's time constant of the loop's closure, in timesteps.
    impedance : solimp's impedance d; MuJoCo clamps it at 0.9999.
    pad : where the inertial frame of the massless pads that carry the closure lies, as
        a part of the bar's length: the softness of the closure goes as its square.
        None: no pads; "fitted": to the speed and the loads (`fit_pad`).
    solver, tolerance, iterations : of the constraint solver. MuJoCo divides the
        tolerance by the flywheel's inertia, so only 0 is tight, and the number of
        iterations is then what stops it.
    flywheel : inertia on pin O2 relative to the linkage's own; the speed ripples by
        about its inverse.
    """

    timestep: float | None = None
    timestep_scale: float = 1.0
    steps_per_revolution: float = 628.0
    steps_per_window: int = 2000
    integrator: str = "RK4"
    time_constant_steps: float = 20.0
    impedance: float = 0.9999
    pad: float | Literal["fitted"] | None = "fitted"
    solver: str = "Newton"
    tolerance: float = 0.0
    iterations: int = 10
    flywheel: float = 1e8

    def count_steps(self, turned: float, width: float) -> float:
        """Return the least number of steps, a real number, of a motion of the input.

        Parameters
        ----------
        turned : angle in rad that the greatest speed throughout would cover.
        width : angle that the input covers, rad.
        """
        dense = self.steps_per_revolution
        if 0.0 < width < FULL_TURN:
            of_window = self.steps_per_window * math.tau / width
            dense = max(dense, min(of_window, FINEST_STEPS))
        return turned / math.tau * dense


RECIPE = Settings()


def write_six_digits(*numbers: float) -> str:
    """Write numbers that nothing is computed from, in six digits."""
    return " ".join(f"{number:.6g}" for number in numbers)


CYLINDER = "cylinder"
"""Name of the tendon of a linear drive, and of the actuator on it."""
_NEVER_REACHED = "1e10"
"""Length, m, up to which the tendon of a spring that only pushes has no force."""
LEAST_MASS = 1e-15
"""mjMINVAL: MuJoCo refuses a moving body of less mass (kg) or inertia (kg m^2)."""
LEAST_LENGTH = 1e-6
"""m: the compiler moves a site that is nearer to its body's origin onto it."""
RGBA_OF_BARS = {
    1: "0.45 0.45 0.48 1",
    2: "0.12 0.47 0.71 1",
    3: "1 0.5 0.05 1",
    4: "0.17 0.63 0.17 1",
}
_SLIP_DAMPING = 1e6
"""Damping of dry friction, per timestep: the greater, the slower the slip that it still
softens. The drive prescribes the slip itself, so it makes nothing stiff; measured, a
reversal is then as exact as any other position.
"""
_NEVER_NEEDED = ("contact", "limit", "island", "sensor")
"""Features that a closed loop of bars never uses; without contacts there is no
midphase, and MuJoCo Warp does not load a file that switches it off.
"""
_FLAGS = {"spring": "stiffness", "frictionloss": "frictionloss", "damper": "damping"}
"""Features that are needed where a pin has an attribute, or for springs."""
_THICKNESS = 0.02
"""Radius of a bar's capsule, as a part of the longest bar."""


def write_exactly(*numbers: float) -> str:
    """Write numbers so that they read back bit for bit."""
    return " ".join(repr(float(number)).removesuffix(".0") for number in numbers)


def add_comments(root: ET.Element, lines: Iterable[str]) -> None:
    """Add a comment for each line."""
    for line in lines:
        root.append(ET.Comment(f" {line} "))


def add_element(parent: ET.Element, tag: str, **stated: Any) -> ET.Element:
    """Add an element; numbers among its attributes are written exactly."""
    attributes = {
        name: value if isinstance(value, str) else write_exactly(*np.ravel(value))
        for name, value in stated.items()
    }
    return ET.SubElement(parent, tag, attributes)


_UNCONTROLLED = {"gaintype": "fixed", "gainprm": "0", "biastype": "affine"}


_PASSIVE = {"input": "none", "motorconst": "1e-200", "resistance": "1"}
"""A motor without a control and without back-EMF: what is left is its cogging, which
here does not depend on the angle. To MuJoCo, and so to Gymnasium, it is no control.
MuJoCo 3 refuses a motor constant of 0. The back-EMF goes as its square, and that of
1e-200 is 0 in double precision.
"""


def make_servo(couple: float, gain: float) -> dict[str, Any]:
    """Return the attributes of a drive on pin O2 that exerts couple - gain speed.

    The drive ignores its control. Without couple and gain there is none, and an empty
    dict.
    """
    if couple or gain:
        return {**_UNCONTROLLED, "joint": "O2", "biasprm": (couple, 0.0, 0.0 - gain)}
    return {}


def make_motor(bar: int | None, most: float) -> dict[str, Any]:
    """Make the drive a motor whose control is its effort.

    The effort is the couple of ground on a bar, N m, or the push of the cylinder, N.

    `most`: its `ctrlrange` reaches from -most to most; it bounds no control, and tells
    others the size of one.
    """
    placed = {"tendon": CYLINDER}
    if bar is not None:
        placed = {"joint": FIRST_PIN[bar]}
    if bar == 3:
        placed = {"site": "B3", "gear": "0 0 0 0 0 1"}
    return {**placed, "ctrlrange": (-most, most), "ctrllimited": "false"}


_A_MILLIONTH = 1e-6
"""Least mass of a bar as a fraction of the heaviest one. Simulations hold down to 1e-11
of it, and forces move by about this part.
"""
MASS_OF_MASSLESS_BARS = 1e-3
"""kg, where no bar has a mass."""


def require_carriable(linkage: FourBar) -> None:
    """Raise an InputError if a bar is shorter or lighter than MuJoCo carries.

    The error of a mass says which mass MuJoCo carries.
    """
    heaviest = max(bar.mass for bar in linkage.moving)
    enough = MASS_OF_MASSLESS_BARS
    part = "which all bars can have where loads alone act"
    if heaviest:
        enough = max(_A_MILLIONTH * heaviest, 2.0 * LEAST_MASS)
        part = "a millionth of the heaviest bar's"
    least = write_in_units("m", LEAST_LENGTH)
    too_short = (
        f"must be at least {least}: the compiler of MuJoCo takes a nearer site for its"
        " body's origin"
    )
    mass = write_in_units("kg", float(f"{enough:.2g}"))
    too_light = (
        f'MuJoCo cannot carry a massless bar; with mass = "{mass}" ({part}) and no'
        " inertia stated the simulation holds, and hardly a force moves"
    )
    for number in MOVING_BARS:
        bar = linkage.bar(number)
        name = BAR_NAMES[number]
        for key, value, unit, smallest, allowed in (
            (f"lengths.{name}", bar.length, "m", LEAST_LENGTH, too_short),
            (f"bars.{name}.mass", bar.mass, "kg", LEAST_MASS, too_light),
            (
                f"bars.{name}.inertia",
                bar.moment_of_inertia,
                "kg m^2",
                LEAST_MASS,
                too_light,
            ),
        ):
            if value < smallest:
                raise InputError(key, value, allowed, unit=unit)


class Model:
    """Content of the model: options, attributes of the pins, and loads.

    Loads and effects add to this content.
    """

    def __init__(
        self, linkage: FourBar, settings: Settings, timestep: float, *, passive: bool
    ) -> None:
        self.passive = passive
        """True if loads and springs have no controls."""
        self.root = ET.Element("mujoco")
        self.bodies: dict[int, ET.Element] = {}
        """Bodies of the bars by number, that of the ground among them."""
        self.linkage = linkage
        self.settings = settings
        self.option: dict[str, Iterable[float]] = {"gravity": (0.0, 0.0, 0.0)}
        self.timestep = timestep
        self.pin: dict[str, dict[str, float | tuple[float, ...]]] = {
            pin: {} for pin in PINS
        }
        self.loads: list[Load] = []
        self.springs: list[Spring] = []
        self.cylinder: LinearDrive | None = None
        """Tendon of this name. Unless the drive is "none" an actuator on it has its
        force as control, N.
        """
        self.inertia = dict.fromkeys(MOVING_BARS, 0.0)
        """Inertia added to that of each bar, kg m^2."""
        self.rest: tuple[float, float, float] | None = None
        """Angles of pins O2, A, O4 in which the bodies are put down, rad. None: every
        bar lies along its parent.
        """

    def add_dry_friction(self, pin: str, torque: float) -> None:
        """Write a ``frictionloss`` that reaches its full torque at once.

        MuJoCo's default reaches it over 0.02 s of slip.
        """
        impedance = self.settings.impedance
        self.pin[pin] |= {
            "frictionloss": torque,
            "solreffriction": (-1.0, -_SLIP_DAMPING / self.timestep),
            "solimpfriction": (impedance, impedance, 0.001, 0.5, 2.0),
        }

    @property
    def along_ground(self) -> complex:
        """Unit vector from O2 to O4: the ground's body keeps the world's axes."""
        return cmath.rect(1.0, self.linkage.ground_angle)

    @property
    def radius(self) -> float:
        """Radius of the capsules, m."""
        return _THICKNESS * max(self.linkage.lengths)

    @property
    def exerts(self) -> bool:
        """Return True if loads or springs need actuators."""
        return bool(self.loads) or not all(map(_is_slack_somewhere, self.springs))

    def add_option(self) -> None:
        """Add the timestep, integrator, solver and what effects state, as gravity.

        Flags switch off what a closed loop and this model do not need.
        """
        settings = self.settings
        option = add_element(
            self.root,
            "option",
            timestep=self.timestep,
            integrator=settings.integrator,
            solver=settings.solver,
            tolerance=settings.tolerance,
            iterations=settings.iterations,
            **self.option,
        )
        flags = dict.fromkeys(_NEVER_NEEDED, "disable")
        for flag, attribute in _FLAGS.items():
            if not any(attribute in stated for stated in self.pin.values()):
                flags[flag] = "disable"
        if self.springs:
            flags.pop("spring", None)
        add_element(option, "flag", **flags)
        # the viewer looks straight down on the plane
        visual = add_element(self.root, "visual")
        add_element(visual, "global", azimuth=90, elevation=-90)

    def add_bodies(self, flywheel: float) -> None:
        """Add ground > (input > coupler), output."""
        world = add_element(self.root, "worldbody")
        ground = add_element(world, "body", name="ground")
        self.bodies[1] = ground
        add_element(ground, "inertial", pos="0 0 0", mass=1, diaginertia="1 1 1")
        self._add_capsule(ground, 1, self.linkage.ground, -2.0 * self.radius)
        O4 = self.linkage.ground * self.along_ground
        self._add_site(ground, "O2", 0.0)
        self._add_site(ground, "O4", O4)
        self._add_bar(1, 2, 0.0, armature=flywheel)
        self._add_bar(2, 3, self.linkage.input.length)
        self._add_bar(1, 4, O4)

    def _add_bar(self, parent: int, number: int, at: complex, **drive: float) -> None:
        """Add a bar that turns about its first pin.

        Bars 3 and 4 end in the sites that the loop's closure joins.
        """
        bar = self.linkage.bar(number)
        pin = FIRST_PIN[number]
        pos = at.real, at.imag, 0.0
        name = BAR_NAMES[number]
        body = add_element(self.bodies[parent], "body", name=name, pos=pos)
        self.bodies[number] = body
        if self.rest is not None:
            angle = self.rest[number - 2]
            body.set("axisangle", write_exactly(0.0, 0.0, 1.0, angle))
            drive["ref"] = angle
        G = bar.to_centre
        # only the z-component acts in the plane; three equal ones satisfy the triangle
        # inequality
        add_element(
            body,
            "inertial",
            pos=(G.real, G.imag, 0.0),
            mass=bar.mass,
            diaginertia=[bar.moment_of_inertia + self.inertia[number]] * 3,
        )
        stated = {**drive, **self.pin[pin]}
        add_element(body, "joint", name=pin, type="hinge", axis="0 0 1", **stated)
        z = self.radius if number == 3 else -self.radius
        self._add_capsule(body, number, bar.length, z)
        if number == 2:
            self._add_site(body, "A", bar.length)
            return
        end = body
        if self.settings.pad is not None:
            assert not isinstance(self.settings.pad, str)  # the document has fitted it
            # massless and welded: it only moves the point at which MuJoCo measures how
            # soft the closure may be
            end = add_element(body, "body", name=f"{name}_pad")
            place = self.settings.pad * bar.length, 0.0, 0.0
            add_element(end, "inertial", pos=place, mass=0, diaginertia="0 0 0")
        self._add_site(end, f"B{number}", bar.length)

    def _add_site(self, body: ET.Element, name: str, at: complex) -> None:
        pos = at.real, at.imag, 0.0
        size = write_six_digits(self.radius)
        add_element(body, "site", name=name, pos=pos, size=size)

    def _add_capsule(
        self,
        body: ET.Element,
        number: int,
        length: float,
        z: float,
    ) -> None:
        """Add a bar's shape: for the eye only, without mass and without contact."""
        along = self.along_ground if number == 1 else 1.0
        middle = 0.5 * length * along
        add_element(
            body,
            "geom",
            name=BAR_NAMES[number],
            type="capsule",
            size=write_six_digits(self.radius, length / 2.0),
            pos=write_six_digits(middle.real, middle.imag, z),
            zaxis=write_six_digits(along.real, along.imag, 0.0),
            rgba=RGBA_OF_BARS[number],
            mass=0,
            contype=0,
            conaffinity=0,
        )

    def add_closure(self) -> None:
        """Close the loop at B."""
        s = self.settings
        add_element(
            add_element(self.root, "equality"),
            "connect",
            name="B",
            site1="B3",
            site2="B4",
            solref=(s.time_constant_steps * self.timestep, 1.0),
            solimp=(s.impedance, s.impedance, 0.001, 0.5, 2.0),
        )

    def add_tendons(self) -> None:
        """Add a tendon theta_4 - theta_3 for what acts at the cut pin B.

        Springs have a tendon each, between two sites.
        """
        tendons = ET.Element("tendon")
        if self.pin["B"]:
            fixed = add_element(tendons, "fixed", name="B", **self.pin["B"])
            for joint, coefficient in (("O2", -1), ("A", -1), ("O4", 1)):
                add_element(fixed, "joint", joint=joint, coef=coefficient)
        for index, spring in enumerate(self.springs, 1):
            tendon = self._add_line(tendons, f"spring_{index}", spring)
            length = "0"
            if _is_slack_somewhere(spring):
                free = write_exactly(-spring.slack / spring.stiffness)
                # between two lengths a tendon has no force
                dead_band = {"push": f"{free} {_NEVER_REACHED}", "pull": f"0 {free}"}
                length = dead_band.get(spring.acts or "", free)
            elif not self.passive:
                continue
            tendon.set("stiffness", write_exactly(spring.stiffness))
            tendon.set("springlength", length)
        if self.cylinder is not None:
            self._add_line(tendons, CYLINDER, self.cylinder)
        if len(tendons):
            self.root.append(tendons)

    def _add_line(
        self, tendons: ET.Element, name: str, line: "Spring | LinearDrive"
    ) -> ET.Element:
        """Add a tendon between two points of bars, with a site at each."""
        tendon = add_element(tendons, "spatial", name=name)
        for which, point in (("start", line.start), ("end", line.end)):
            add_element(tendon, "site", site=f"{name}_{which}")
            at = point.vector()
            if point.bar == 1:
                at = at * self.along_ground
            self._add_site(self.bodies[point.bar], f"{name}_{which}", at)
        return tendon

    def add_load_sites(self) -> None:
        """Add the point at which each load acts; an arm becomes a couple at G."""
        for index, load in enumerate(self.loads, 1):
            z = load.foot(self.linkage.bar(load.bar).to_centre)
            self._add_site(self.bodies[load.bar], f"load_{index}", z)

    def add_actuators(self, drive: dict[str, Any], *, driven: bool) -> None:
        """Add actuators: the drive, if it has attributes; loads; and some springs.

        Actuators of loads and springs ignore their controls.

        `driven`: a flywheel drives, and the cylinder's force is 0 without a control.
        """
        actuators = ET.Element("actuator")
        if drive:
            name = CYLINDER if drive.get("tendon") == CYLINDER else "drive"
            add_element(actuators, "general", **drive, name=name)
        if driven and self.cylinder is not None:
            add_element(actuators, "general", name=CYLINDER, tendon=CYLINDER)
        for index, spring in enumerate(self.springs, 1):
            if not _is_slack_somewhere(spring):
                name = f"spring_{index}"
                placed = {"name": name, "tendon": name}
                self._add_force(actuators, placed, -spring.slack, spring.stiffness)
        for index, load in enumerate(self.loads, 1):
            force = 0j if load.force is None else cmath.rect(*load.force)
            couple = load.moment
            if load.arm is not None:
                # force and arm both keep their direction, and so their moment
                arm, angle = load.arm
                couple += arm * (cmath.rect(1.0, -angle) * force).imag
            placed = {"name": f"load_{index}", "site": f"load_{index}"}
            if load.frame == "world":
                placed["refsite"] = "O2"
            placed["gear"] = write_exactly(force.real, force.imag, 0, 0, 0, couple)
            self._add_force(actuators, placed, 1.0)
        if len(actuators):
            self.root.append(actuators)

    def _add_force(
        self,
        actuators: ET.Element,
        placed: dict[str, str],
        force: float,
        stiffness: float = 0.0,
    ) -> None:
        """Add an actuator that exerts a force less stiffness times its tendon's length.

        The force is in N, or a factor on the gear; its control does nothing. Without a
        control it has no stiffness, which then is that of the tendon.
        """
        if self.passive:
            cogging = force, 0.0, math.pi / 2.0
            add_element(actuators, "dcmotor", **_PASSIVE, cogging=cogging, **placed)
        else:
            tension = force, 0.0 - stiffness, 0.0
            stated = {**_UNCONTROLLED, **placed}
            add_element(actuators, "general", **stated, biasprm=tension)


def _is_slack_somewhere(spring: "Spring") -> bool:
    """Return True if a rest length of a tendon can express the spring.

    Any other spring needs an actuator on the tendon.
    """
    return spring.stiffness > 0.0 and spring.slack <= 0.0


def unwind(scene: "Scene", q: "Joints") -> "Joints":
    """Compute the angles of pins O2, A, O4 as the scene's springs count them, rad."""
    for effect in scene.effects:
        q = effect.unwind(scene.linkage, q)
    return q
