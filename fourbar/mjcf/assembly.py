"""Files that hold no drive at a speed: SDF for Gazebo and Drake, USD for Newton.

The bars stand assembled.
"""

import cmath
import json
import math
from collections.abc import Iterable
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET

import numpy as np

from fourbar.effects.effect import list_bodies
from fourbar.errors import LimitError, clean_line
from fourbar.formulas.pin_forces import Body
from fourbar.linkage import BAR_NAMES, FIRST_PIN, MOVING_BARS
from fourbar.mjcf.document import NOTES, Start, find_start
from fourbar.mjcf.model import (
    add_comments,
    require_carriable,
    write_exactly,
    write_six_digits,
)
from fourbar.mjcf.plane import LEVEL, Plane
from fourbar.scene import Scene, require_input

_PARENT = {2: 1, 3: 2, 4: 1}
"""The bar that carries each bar's first pin."""


class Assembly(NamedTuple):
    """Bodies in the plane."""

    turn: dict[int, float]
    """Angle of each bar, 1 to 4, that of the ground 0, rad."""
    first_pin: dict[int, complex]
    """First pin of each bar, m."""
    numbers: tuple[float, ...]
    """theta_2, theta_3, theta_4, and the speeds of joints O2, A, O4."""
    bodies: dict[int, Body]
    """Inertial properties of the moving bars, with a flywheel's inertia."""
    gravity: tuple[float, float]
    """m/s^2."""
    dynamics: dict[str, dict[str, float]]
    """Attributes of each pin's joint."""


def assemble(
    scene: Scene,
    start: Start | None,
    form: str,
    reader: str | None,
    *,
    without_loads: bool = False,
) -> Assembly:
    """Evaluate the linkage in the state given, or in that of `find_start`.

    Parameters
    ----------
    form : the file's, for errors.
    reader : whose joints state what acts at the pins, as in `Effect.joint_elements`;
        None: they state nothing.
    without_loads : leave the loads out, instead of refusing them.

    Raises LimitError for a load, a motion law or an effect without a counterpart there,
    InputError for a bar without mass or inertia, NotAssembledError where the linkage
    closes at none of the scene's positions.
    """
    require_input(scene, "the drive of an SDF or a USD")
    if scene.motion.law is not None:
        raise LimitError(
            f"a motion law has no counterpart in {form}; apply it in the simulator"
        )
    if scene.loads and not without_loads:
        on = ", ".join(sorted({f"bar {load.bar}" for load in scene.loads}))
        raise LimitError(
            f"loads (here on {on}) have no counterpart in {form}; --without-loads"
            " leaves them out"
        )
    if scene.drive is not None:
        raise LimitError(f"a drive that exerts a force has no counterpart in {form}")
    linkage = scene.linkage
    require_carriable(linkage)
    gravity = (0.0, 0.0)
    dynamics = dict[str, dict[str, float]]()
    effect: Any
    for effect in scene.effects:
        if effect.key == "gravity":
            gravity = effect.vector
        elif reader in effect.joint_elements:
            name = effect.joint_elements[reader]
            for pin, value in effect.rows:
                dynamics.setdefault(pin, {})[name] = value
        elif effect.key != "flywheel":
            raise LimitError(f"the effect {effect.key!r} has no counterpart in {form}")
    (theta_2, of_3_to_2, theta_4), speeds, _ = start or find_start(scene)
    theta_3 = theta_2 + of_3_to_2
    bodies = list_bodies(linkage, scene.effects)
    return Assembly(
        {1: 0.0, 2: theta_2, 3: theta_3, 4: theta_4},
        {
            1: 0j,
            2: 0j,
            3: cmath.rect(linkage.input.length, theta_2),
            4: cmath.rect(linkage.ground, linkage.ground_angle),
        },
        (theta_2, theta_3, theta_4, *speeds),
        dict(zip(MOVING_BARS, bodies, strict=True)),
        gravity,
        dynamics,
    )


def _write_comment(
    scene: Scene,
    form: str,
    reader: str,
    assembly: Assembly,
    at_B: str = "",
    plane: Plane = LEVEL,
) -> str:
    """Say in what state the file stands, and where its reader's numbers are."""
    notes = {key: note.strip() for key, note in NOTES["assembled"].items()}
    bar = scene.drive_bar
    joint = f", joint {FIRST_PIN[bar]}" if bar != 3 else ""
    lines = [
        notes["opens"].format(*map(repr, assembly.numbers), form=form, at_B=at_B),
        notes["drive"].format(bar=bar, joint=joint),
    ]
    if scene.loads:
        lines.append(notes["without_loads"])
    if plane.is_moved:
        lines.append(notes["moved"].format(origin=write_exactly(*plane.origin)))
    if plane.is_tilted:
        axes = ", ".join(f"({write_six_digits(*axis)})" for axis in plane.rotation.T)
        gravity = write_exactly(*plane.turn(*assembly.gravity))
        lines.append(notes["tilted"].format(axes=axes, gravity=gravity))
    return "\n".join([*lines, notes[reader]])


def write_sdf(
    scene: Scene,
    reader: str = "gazebo",
    start: Start | None = None,
    *,
    without_loads: bool = False,
    plane: Plane = LEVEL,
) -> str:
    """Write the SDF 1.9 text of a scene.

    The text has a world with gravity, four links, and the pins as joints.

    Parameters
    ----------
    reader : who closes the loop how: "gazebo" by a fourth joint, "drake" by its own
        ball constraint.
    start : the assembled state to stand in; None: that of `find_start`.
    without_loads : leave the scene's loads out, for the program to apply; otherwise
        they are refused.
    plane : where the linkage, or the drawing that states its pins, stands in the world.

    Raises
    ------
    LimitError : a load, an effect or a motion law has no counterpart there.
    InputError : a bar without mass or inertia, which neither carries.
    NotAssembledError : the linkage closes at none of the scene's positions.

    Source: sdformat.org/spec, and Drake's documentation of its parser.
    """
    linkage = scene.linkage
    plane = plane.moved(*scene.origin)
    form = f"SDF for {reader}"
    assembled = assemble(scene, start, form, reader, without_loads=without_loads)
    turn, foot, numbers, bodies, gravity, dynamics = assembled
    root = ET.Element("sdf", version="1.9")
    at_B = ""
    if reader == "gazebo":
        omega_2, at_A, omega_4 = numbers[3:]
        at_B = f", joint B {omega_2 + at_A - omega_4!r} rad/s"
    else:
        root.set("xmlns:drake", "http://drake.mit.edu")
        if "B" in dynamics:
            raise LimitError("Drake's ball constraint at pin B has no damping")
    comment = _write_comment(scene, "SDF", reader, assembled, at_B, plane)
    add_comments(root, comment.splitlines())
    world = _add(root, "world", {"gravity": plane.turn(*gravity)}, name="four_bar")
    model = _add(world, "model", {}, name=clean_line(scene.title) or "four-bar")
    if plane.is_moved:
        _add(model, "pose", (*plane.origin, *plane.roll_pitch_yaw))

    def add_link(bar: int, body: Body) -> None:
        # izz alone acts in the plane; three equal ones are a possible body
        tensor = dict.fromkeys(("ixx", "iyy", "izz"), body.I)
        tensor |= dict.fromkeys(("ixy", "ixz", "iyz"), 0.0)
        centre = body.z.real, body.z.imag, 0, 0, 0, 0
        inertial = {"pose": centre, "mass": body.m, "inertia": tensor}
        pose = foot[bar].real, foot[bar].imag, 0, 0, 0, turn[bar]
        link = {"pose": pose, "inertial": inertial}
        _add(model, "link", link, name=BAR_NAMES[bar])

    def add_joint(pin: str, parent: int, child: int, **more: Any) -> None:
        axis: dict[str, Any] = {"xyz": (0, 0, 1)}
        if pin in dynamics:
            axis["dynamics"] = dynamics[pin]
        ends = {"parent": BAR_NAMES[parent], "child": BAR_NAMES[child]}
        joint = {**ends, "axis": axis, **more}
        _add(model, "joint", joint, name=pin, type="revolute")

    add_link(1, Body(1.0, 1.0, 0j))
    ends = {"parent": "world", "child": BAR_NAMES[1]}
    _add(model, "joint", ends, name="ground_on_world", type="fixed")
    for number, body in bodies.items():
        add_link(number, body)
        add_joint(FIRST_PIN[number], _PARENT[number], number)
    length_3 = linkage.coupler.length
    if reader == "gazebo":  # the pose is in the frame of the child
        add_joint("B", 4, 3, pose=(length_3, 0, 0, 0, 0, 0))
    else:
        name = "drake:ball_constraint"
        ball = {
            "body_A": BAR_NAMES[3],
            "body_B": BAR_NAMES[4],
            "p_AP": (length_3, 0, 0),
            "p_BQ": (linkage.output.length, 0, 0),
        }
        _add(model, name, {f"{name}_{key}": value for key, value in ball.items()})
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def _add(parent: ET.Element, tag: str, content: Any, **attributes: str) -> ET.Element:
    """Add an element that holds a text, numbers, or elements by their tags."""
    element = ET.SubElement(parent, tag, attributes)
    if isinstance(content, dict):
        for inner, value in content.items():
            _add(element, inner, value)
    elif isinstance(content, str):
        element.text = content
    else:
        element.text = write_exactly(*np.ravel(content))
    return element


def write_usd(
    scene: Scene,
    start: Start | None = None,
    *,
    without_loads: bool = False,
    plane: Plane = LEVEL,
) -> str:
    """Write the USD text (.usda) of a scene.

    The text has three rigid bodies and four revolute joints, the fourth of which closes
    the loop.

    Parameters and errors as of `write_sdf`; of the effects it has gravity and flywheel.

    Source: openusd.org, UsdPhysics.
    """
    linkage = scene.linkage
    plane = plane.moved(*scene.origin)
    assembled = assemble(scene, start, "USD", None, without_loads=without_loads)
    turn, foot, _, bodies, (x, y), _ = assembled
    pull = math.hypot(x, y)
    bars = []
    for number, (mass, inertia, centre) in bodies.items():
        place = plane.place(foot[number].real, foot[number].imag)
        bars.append(f"""    def Xform "{BAR_NAMES[number]}" (
        prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"]
    )
    {{
        float physics:mass = {mass!r}
        point3f physics:centerOfMass = {_write_tuple((centre.real, centre.imag, 0.0))}
        float3 physics:diagonalInertia = ({", ".join([repr(inertia)] * 3)})
        quatf physics:principalAxes = (1, 0, 0, 0)
        double3 xformOp:translate = {_write_tuple(place)}
        quatd xformOp:orient = {_write_tuple(plane.turn_on(turn[number]))}
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:orient"]
    }}
""")
    joints = []
    _, length_2, length_3, length_4 = linkage.lengths
    places = {
        "O2": (1, 0j, 2, 0.0),
        "A": (2, complex(length_2), 3, 0.0),
        "O4": (1, foot[4], 4, 0.0),
        "B": (4, complex(length_4), 3, length_3),
    }
    for pin, (one, on_one, follower, along) in places.items():
        relative = turn[follower] - turn[one]
        # the world's axes are not the plane's
        frame = plane if one == 1 else LEVEL
        on_first = frame.place(on_one.real, on_one.imag)
        turn_on_first = frame.turn_on(relative)
        joints.append(f"""    def PhysicsRevoluteJoint "{pin}"
    {{
        uniform token physics:axis = "Z"
        {"" if one == 1 else f"rel physics:body0 = </four_bar/{BAR_NAMES[one]}>"}
        rel physics:body1 = </four_bar/{BAR_NAMES[follower]}>
        point3f physics:localPos0 = {_write_tuple(on_first)}
        quatf physics:localRot0 = {_write_tuple(turn_on_first)}
        point3f physics:localPos1 = {_write_tuple((along, 0.0, 0.0))}
        quatf physics:localRot1 = (1, 0, 0, 0)
        bool physics:excludeFromArticulation = {"true" if pin == "B" else "false"}
    }}
""")
    comment = _write_comment(scene, "USD", "newton", assembled, plane=plane)
    notes = json.dumps(comment)
    down = plane.turn(x / pull, y / pull) if pull else (0.0, -1.0, 0.0)
    return f"""#usda 1.0
(
    doc = {notes}
    defaultPrim = "four_bar"
    metersPerUnit = 1
    kilogramsPerUnit = 1
    upAxis = "Z"
)

def PhysicsScene "physics"
{{
    vector3f physics:gravityDirection = {_write_tuple(down)}
    float physics:gravityMagnitude = {pull!r}
}}

def Xform "four_bar" (
    doc = {json.dumps(clean_line(scene.title) or "four-bar", ensure_ascii=False)}
    prepend apiSchemas = ["PhysicsArticulationRootAPI"]
)
{{
{"".join([*bars, *joints])}}}
"""


def _write_tuple(numbers: Iterable[float]) -> str:
    """Write a tuple of USD, every digit; whole zeros short."""
    texts = (repr(number) if number else "0" for number in numbers)
    return f"({', '.join(texts)})"
