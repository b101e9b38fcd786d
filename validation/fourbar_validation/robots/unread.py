"""Entries of somebody's MJCF that the check does not look at."""

from collections.abc import Iterator
from xml.etree import ElementTree as ET

ANY_ATTRIBUTE = "*"
HINGE_ATTRIBUTES = (
    "name class type pos axis ref damping frictionloss stiffness springref springdamper"
    " armature range limited"
)
READ_ATTRIBUTES = {
    **dict.fromkeys(
        (
            "mujoco",
            "compiler",
            "inertial",
            "geom",
            "site",
            "worldbody",
            "default",
            "frame",
        ),
        ANY_ATTRIBUTE,
    ),
    **dict.fromkeys(
        (
            "equality",
            "connect",
            "weld",
            "tendon",
            "actuator",
            "motor",
            "contact",
            "pair",
            "exclude",
        ),
        ANY_ATTRIBUTE,
    ),
    **dict.fromkeys(
        ("visual", "asset", "camera", "light", "sensor", "keyframe", "custom", "size"),
        ANY_ATTRIBUTE,
    ),
    "option": (
        "timestep integrator solver tolerance iterations ls_iterations"
        " noslip_iterations gravity density viscosity wind jacobian"
    ),
    "flag": (
        "contact gravity limit spring damper passive frictionloss island sensor energy"
        " fwdinv"
    ),
    "statistic": "extent center meansize meanmass",
    "body": "name childclass pos quat axisangle euler xyaxes zaxis gravcomp",
    "joint": (
        HINGE_ATTRIBUTES
        + " solreffriction solimpfriction group user joint coef joint1 joint2 polycoef"
    ),
    **dict.fromkeys(
        ("fixed", "spatial"),
        "name class stiffness damping frictionloss springlength solreffriction"
        " solimpfriction group width rgba material user tendon1 tendon2 polycoef",
    ),
    **dict.fromkeys(
        ("general", "position", "velocity"),
        "name class group user joint tendon site refsite gear gaintype gainprm biastype"
        " biasprm kp kv dampratio ctrlrange ctrllimited",
    ),
    "dcmotor": (
        "name class group joint tendon site refsite gear input motorconst resistance"
        " cogging"
    ),
}
"""Elements and their attributes that the check compares, that enter what it compares,
or that move nothing: of those that read and draw, of what collides only whether
anything does, and of the drive nothing, for it is taken off.
"""
SKIPPED = ("visual", "asset", "sensor", "keyframe", "custom")
"""Elements whose whole content moves nothing."""


def list_unread(text: str) -> list[str]:
    """Return "element attribute" of what a screened MJCF states and no check reads."""

    def walk(element: ET.Element) -> Iterator[str]:
        looked_at = READ_ATTRIBUTES.get(element.tag)
        if looked_at is None:
            yield element.tag
        elif looked_at != ANY_ATTRIBUTE:
            yield from (
                f"{element.tag} {name}"
                for name in element.attrib
                if name not in looked_at.split()
            )
        if element.tag not in SKIPPED:
            for part in element:
                yield from walk(part)

    return sorted(set(walk(ET.fromstring(text))))
