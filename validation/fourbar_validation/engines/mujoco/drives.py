"""Drive the generated MJCF by other means, for the study of their cost.

A drive builds a loop from the generated text; the flywheel of the text is taken out
where another drive takes its place, and the torque is read where that drive exerts it.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from xml.etree import ElementTree as ET

from fourbar.mjcf.model import write_exactly as numbers
from fourbar_validation.engines.mujoco.closed_loop import O2, ClosedLoop

WHEEL = 1e8
"""Armature of the kinematic wheel that a joint equality follows, relative to the
crank's dof inertia.
"""
_POSITION_GAIN, _VELOCITY_GAIN = 1e6, 1e4
"""kp of the stiff servo, and kv of servo and velocity actuator. kp is per (inertia
omega^2), kv per (inertia omega).
"""
_GENTLE_GAIN = 1.0
"""Gain of position and of speed that an explicit integrator can follow. The drive
droops.
"""


class Softened(ClosedLoop):
    """The compiled model's body_invweight0 scaled.

    The softness of the closure goes in proportion.
    """

    def __init__(self, mjcf: str, factor: float) -> None:
        super().__init__(mjcf)
        self.model.body_invweight0[:] *= factor


class Driven(ClosedLoop):
    """Another drive in place of the flywheel."""

    def __init__(self, mjcf: str, omega: float) -> None:
        self.omega = omega
        root = ET.fromstring(mjcf)
        crank = root.find(".//joint[@name='O2']")
        assert crank is not None
        # the inertia that sized the flywheel is a measure of the linkage's inertia
        # about O2
        self.flywheel = float(crank.attrib.pop("armature"))
        self.add_drive(root)
        super().__init__(ET.tostring(root, encoding="unicode"))
        drive = [
            i for i in range(self.model.nu) if self.model.actuator(i).name == "servo"
        ]
        self.servo = drive[0] if drive else None

    def add_drive(self, root: ET.Element) -> None:
        """Add kp (act - theta_2) + kv (omega - omega_2), act integrating omega."""
        raise NotImplementedError

    def crank_torque(self) -> float:
        """Read what the actuator gives the crank."""
        return float(self.data.actuator_force[self.servo])


class _Actuated(Driven):
    """An actuator on O2: of speed alone, or a servo of position.

    The target of the servo turns at omega, as that of `intvelocity` does.

    `position`: kp per (inertia omega^2); none: kv (omega - omega_2), without a control
    input, by the affine bias. `velocity`: kv per (inertia omega).
    """

    def __init__(
        self,
        mjcf: str,
        omega: float,
        position: float,
        velocity: float,
    ) -> None:
        self.kp = position
        self.kv = velocity
        super().__init__(mjcf, omega)

    def add_drive(self, root: ET.Element) -> None:
        """Add kp (act - theta_2) + kv (omega - omega_2), act integrating omega."""
        kp = self.kp * self.flywheel * self.omega**2
        kv = self.kv * self.flywheel * abs(self.omega)
        actuators = root.find("actuator")
        if actuators is None:
            actuators = ET.SubElement(root, "actuator")
        servo = {"dyntype": "integrator"} if kp else {}
        servo |= {"gaintype": "fixed", "gainprm": numbers(kp), "biastype": "affine"}
        ET.SubElement(
            actuators,
            "general",
            servo,
            biasprm=numbers(kv * self.omega, -kp, -kv),
            name="servo",
            joint="O2",
        )

    def set_state(
        self,
        q: Sequence[float],
        speed: float,
        bar: int | None = 2,
    ) -> None:
        """Start the target where the crank is."""
        super().set_state(q, speed, bar)
        if self.kp:
            self.data.act[:] = q[O2]
            self.data.ctrl[self.servo] = self.omega


Servo = partial(_Actuated, position=_POSITION_GAIN, velocity=_VELOCITY_GAIN)
GentleServo = partial(_Actuated, position=_GENTLE_GAIN, velocity=_GENTLE_GAIN)
VelocityActuator = partial(_Actuated, position=0.0, velocity=_VELOCITY_GAIN)
"""Drive that holds the speed. It droops, so the motion that happened is compared."""
GentleVelocityActuator = partial(_Actuated, position=0.0, velocity=_GENTLE_GAIN)


class WheelEquality(Driven):
    """A joint equality to a kinematic wheel.

    The wheel is a second, heavy body that turns at omega next to the linkage.
    """

    def __init__(
        self,
        mjcf: str,
        omega: float,
        softness: float = 1.0,
    ) -> None:
        """Multiply dof_invweight0 by `softness`; at 1 the model is plain MJCF.

        MJCF cannot state that field: the compiled model is edited.
        """
        super().__init__(mjcf, omega)
        self.model.dof_invweight0[:] *= softness
        self.row = 3  # the closure takes three rows, the joint equality the next

    def add_drive(self, root: ET.Element) -> None:
        """Add the wheel last, so that O2, A, O4 stay the first degrees of freedom."""
        ground = root.find(".//body[@name='ground']")
        equality = root.find("equality")
        assert ground is not None and equality is not None
        wheel = ET.SubElement(ground, "body", name="wheel")
        ET.SubElement(wheel, "inertial", pos="0 0 0", mass="1", diaginertia="1 1 1")
        ET.SubElement(
            wheel,
            "joint",
            name="wheel",
            axis="0 0 1",
            armature=numbers(WHEEL * self.flywheel),
        )
        closure = equality.find("connect")
        assert closure is not None
        softness = {key: closure.attrib[key] for key in ("solref", "solimp")}
        ET.SubElement(
            equality,
            "joint",
            softness,
            joint1="O2",
            joint2="wheel",
            polycoef="0 1 0 0 0",
        )

    def place(self, q: Sequence[float]) -> None:
        """Place the wheel where the crank is."""
        super().place((*q, q[O2]))

    def set_state(
        self,
        q: Sequence[float],
        speed: float,
        bar: int | None = 2,
    ) -> None:
        """Let the wheel rotate as the crank does."""
        super().set_state(q, speed, bar)
        self.data.qvel[3] = speed

    def crank_torque(self) -> float:
        """Return the multiplier of the joint equality, N m.

        The row of the equality's Jacobian is 1 at the crank.
        """
        return float(self.data.efc_force[self.row])


StiffWheelEquality = partial(WheelEquality, softness=1e-8)
"""Drive by a wheel equality whose softness is edited down. The pads do as much for the
closure.
"""


def remove_attributes(mjcf: str, attributes: Mapping[str, Sequence[str]]) -> str:
    """Remove these attributes of the elements at these paths from a text.

    What they state is left to MuJoCo.
    """
    root = ET.fromstring(mjcf)
    for path, names in attributes.items():
        element = root.find(path)
        assert element is not None
        for name in names:
            element.attrib.pop(name, None)
    return ET.tostring(root, encoding="unicode")


def restore_defaults(mjcf: str, _: float = 0.0) -> ClosedLoop:
    """Return the loop with solref, solimp and the solver left to MuJoCo.

    MuJoCo's defaults are 0.02 s, impedance 0.9 to 0.95, and Newton to 1e-8.
    """
    return ClosedLoop(
        remove_attributes(
            mjcf,
            {
                "option": ("solver", "tolerance", "iterations"),
                "equality/connect": ("solref", "solimp"),
            },
        )
    )
