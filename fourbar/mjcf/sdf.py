"""Scene -> SDF text: the closed loop as links and joints, for Gazebo and Drake."""

from xml.etree import ElementTree as ET

from fourbar.errors import LimitError, clean_line
from fourbar.linkage import BAR_NAMES, FIRST_PIN, MOVING_BARS
from fourbar.mjcf.assembly import PARENT, assemble, write_comment
from fourbar.mjcf.document import Start
from fourbar.mjcf.model import join
from fourbar.scene import Scene

DAMPING = {"viscous": ("damping", "coefficients")}
AT_JOINTS = {"gazebo": {**DAMPING, "friction": ("friction", "torques")}, "drake": DAMPING}
"""What a joint holds, by effect: its element, and the field of the effect."""
DRAKE = "http://drake.mit.edu"
"""Namespace of the elements that only Drake reads."""


def write_sdf(scene: Scene, reader: str = "gazebo", start: Start | None = None, *, without_loads: bool = False) -> str:
    """Write the SDF 1.9 text of a scene: a world with gravity, four links, and the pins as joints.

    Parameters
    ----------
    reader : who closes the loop how: "gazebo" by a fourth joint, "drake" by its own ball constraint.
    start : the assembled state to stand in; None: that of `find_start`.
    without_loads : leave the scene's loads out, for the program to apply; otherwise they are refused.

    Raises
    ------
    LimitError : a load, an effect or a motion law has no counterpart there.
    InputError : a bar without mass or inertia, which neither carries.
    NotAssembledError : the linkage closes at none of the scene's positions.

    Source: sdformat.org/spec, and Drake's documentation of its parser.
    """
    linkage = scene.linkage
    form = f"SDF for {reader}"
    assembled = assemble(scene, start, form, AT_JOINTS[reader], without_loads=without_loads)
    turn, foot, numbers, inertia, gravity, dynamics = assembled
    if reader == "drake" and "B" in dynamics:
        raise LimitError("Drake's ball constraint at pin B has no damping")
    omega_2, at_A, omega_4 = numbers[3:]
    root = ET.Element("sdf", {"version": "1.9", **({"xmlns:drake": DRAKE} if reader == "drake" else {})})
    at_B = f", joint B {omega_2 + at_A - omega_4!r} rad/s" if reader == "gazebo" else ""
    for line in write_comment(scene, "SDF", reader, assembled, at_B).splitlines():
        root.append(ET.Comment(f" {line} "))
    world = ET.SubElement(root, "world", name="four_bar")
    ET.SubElement(world, "gravity").text = join(*gravity, 0.0)
    model = ET.SubElement(world, "model", name=clean_line(scene.title) or "four-bar")
    _add_link(model, BAR_NAMES[1], 0j, 0.0, 1.0, 1.0, 0j)
    _add_joint(model, "ground_on_world", "fixed", "world", BAR_NAMES[1])
    for number in MOVING_BARS:
        bar = linkage.bar(number)
        _add_link(model, BAR_NAMES[number], foot[number], turn[number], bar.mass, inertia[number], bar.to_centre)
        pin = FIRST_PIN[number]
        _add_joint(model, pin, "revolute", BAR_NAMES[PARENT[number]], BAR_NAMES[number], dynamics.get(pin, {}))
    length_3, length_4 = linkage.coupler.length, linkage.output.length
    if reader == "gazebo":
        joint = _add_joint(model, "B", "revolute", BAR_NAMES[4], BAR_NAMES[3], dynamics.get("B", {}))
        ET.SubElement(joint, "pose").text = join(length_3, 0, 0, 0, 0, 0)  # in the frame of its child
    else:
        ball = ET.SubElement(model, "drake:ball_constraint")
        for key, value in (("body_A", BAR_NAMES[3]), ("body_B", BAR_NAMES[4])):
            ET.SubElement(ball, f"drake:ball_constraint_{key}").text = value
        for key, length in (("p_AP", length_3), ("p_BQ", length_4)):
            ET.SubElement(ball, f"drake:ball_constraint_{key}").text = join(length, 0.0, 0.0)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def _add_link(
    model: ET.Element, name: str, foot: complex, turn: float, mass: float, inertia: float, centre: complex
) -> None:
    link = ET.SubElement(model, "link", name=name)
    ET.SubElement(link, "pose").text = join(foot.real, foot.imag, 0, 0, 0, turn)
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "pose").text = join(centre.real, centre.imag, 0, 0, 0, 0)
    ET.SubElement(inertial, "mass").text = join(mass)
    tensor = ET.SubElement(inertial, "inertia")
    for axes in ("ixx", "iyy", "izz"):  # izz alone acts in the plane; three equal ones are a possible body
        ET.SubElement(tensor, axes).text = join(inertia)
    for axes in ("ixy", "ixz", "iyz"):
        ET.SubElement(tensor, axes).text = "0"


def _add_joint(
    model: ET.Element, name: str, kind: str, parent: str, child: str, dynamics: dict[str, float] | None = None
) -> ET.Element:
    joint = ET.SubElement(model, "joint", name=name, type=kind)
    ET.SubElement(joint, "parent").text = parent
    ET.SubElement(joint, "child").text = child
    if dynamics is not None:
        axis = ET.SubElement(joint, "axis")
        ET.SubElement(axis, "xyz").text = "0 0 1"
        if dynamics:
            values = ET.SubElement(axis, "dynamics")
            for key, value in dynamics.items():
                ET.SubElement(values, key).text = join(value)
    return joint
