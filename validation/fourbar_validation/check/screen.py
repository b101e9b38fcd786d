"""Somebody's MJCF is data: read with limits, and handed on only as what was screened.

The text that the engine gets is written anew from the elements that were looked at, so nothing
can mean one thing to the reader here and another to the engine's.
"""

import io
import re
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as ET

from fourbar.errors import InputError
from fourbar.writing import read_text

LARGEST_MJCF = 2**20
"""Bytes; a four-bar takes four thousand."""
DEEPEST = 100
"""Nested elements; the readers of XML recurse."""
REACHING_OUT = (
    "include",
    "extension",
    "plugin",
    "attach",
    "composite",
    "flexcomp",
    "replicate",
)
"""Elements that read files, load plugins, or make a thousand bodies of one: no linkage of four bars needs them."""
OUTSIDE = ("file", "meshdir", "texturedir", "assetdir", "directory")
"""Attributes that name files; those of a cube texture are file and a side."""

COUNTS = (
    "iterations",
    "ls_iterations",
    "noslip_iterations",
    "ccd_iterations",
    "sdf_iterations",
    "sdf_initpoints",
)
MOST_ITERATIONS = 1000
"""Upper limit of each count in <option>, ten times the greatest of MuJoCo's defaults: MuJoCo already steps while it
compiles, and with a tolerance of 0 nothing else may stop a solver."""

ANY = "*"
HINGE = "name class type pos axis ref damping frictionloss stiffness springref springdamper armature range limited"
LOOKED_AT = {
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
        ANY,
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
        ANY,
    ),
    **dict.fromkeys(
        ("visual", "asset", "camera", "light", "sensor", "keyframe", "custom", "size"),
        ANY,
    ),
    "option": "timestep integrator solver tolerance iterations ls_iterations noslip_iterations gravity density "
    "viscosity wind jacobian",
    "flag": "contact gravity limit spring damper passive frictionloss island sensor energy fwdinv",
    "statistic": "extent center meansize meanmass",
    "body": "name childclass pos quat axisangle euler xyaxes zaxis",
    "joint": HINGE
    + " solreffriction solimpfriction group user joint coef joint1 joint2 polycoef",
    **dict.fromkeys(
        ("fixed", "spatial"),
        "name class stiffness damping frictionloss springlength solreffriction solimpfriction group width rgba "
        "material user tendon1 tendon2 polycoef",
    ),
    **dict.fromkeys(
        ("general", "position", "velocity"),
        "name class group user joint tendon site refsite gear gaintype gainprm biastype biasprm kp kv dampratio "
        "ctrlrange ctrllimited",
    ),
    "dcmotor": "name class group joint tendon site refsite gear input motorconst resistance cogging",
}
"""Elements and their attributes that the check compares, that enter what it compares, or that move nothing: of those
that read and draw, of what collides only whether anything does, and of the drive nothing, for it is taken off."""
SKIPPED = ("visual", "asset", "sensor", "keyframe", "custom")
"""Elements whose whole content moves nothing."""


def list_unread(text: str) -> list[str]:
    """List what a screened MJCF states and the check does not look at, as "element attribute"."""

    def walk(element: ET.Element) -> Iterator[str]:
        looked_at = LOOKED_AT.get(element.tag)
        if looked_at is None:
            yield element.tag
        elif looked_at != ANY:
            yield from (
                f"{element.tag} {name}"
                for name in element.attrib
                if name not in looked_at.split()
            )
        if element.tag not in SKIPPED:
            for part in element:
                yield from walk(part)

    return sorted(set(walk(ET.fromstring(text))))


def read_mjcf(path: Path) -> str:
    """Read the text of an MJCF; InputError says in one line what it may not hold."""

    def refuse(what: object, allowed: str) -> InputError:
        return InputError("MJCF", what, allowed, str(path))

    text = read_text(path, "MJCF", LARGEST_MJCF)
    for word in ("<!DOCTYPE", "<!ENTITY"):
        if word in text.upper():
            raise refuse(word, "is not allowed: an MJCF needs no document type")
    parsed, depth = ET.iterparse(io.StringIO(text), ("start", "end")), 0
    try:
        for event, _ in parsed:
            depth += 1 if event == "start" else -1
            if depth > DEEPEST:
                raise refuse(path.name, f"nests its elements deeper than {DEEPEST}")
    except (ET.ParseError, ValueError) as error:
        raise refuse(path.name, f"is no XML: {error}") from None
    root = parsed.root  # type: ignore[attr-defined]
    if root.tag != "mujoco":
        raise refuse(root.tag, "must be an MJCF, whose outermost element is <mujoco>")
    for element in root.iter():
        if element.tag in REACHING_OUT:
            raise refuse(
                f"<{element.tag}>",
                "is not allowed: a linkage is described by the file itself",
            )
        for name in element.attrib:
            if element.tag == "option" and name in COUNTS:
                count = element.attrib[name].strip()
                if (
                    not re.fullmatch("[0-9]{1,9}", count)
                    or int(count) > MOST_ITERATIONS
                ):
                    allowed = f"must be a whole number up to {MOST_ITERATIONS}: MuJoCo might never come back"
                    raise refuse(f'<option {name}="{count}">', allowed)
            if name.startswith(OUTSIDE):
                raise refuse(
                    f"<{element.tag} {name}=...>",
                    "is not allowed: no other file is read",
                )
    return ET.tostring(root, encoding="unicode")
