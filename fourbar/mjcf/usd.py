"""Scene -> USD text (UsdPhysics): the closed loop as rigid bodies and joints, for Newton."""

import json
import math

from fourbar.errors import clean_line
from fourbar.linkage import BAR_NAMES, FIRST_PIN, MOVING_BARS
from fourbar.mjcf.assembly import PARENT, assemble, write_comment
from fourbar.mjcf.document import Start
from fourbar.scene import Scene


def write_usd(scene: Scene, start: Start | None = None, *, without_loads: bool = False) -> str:
    """Write the USD text (.usda) of a scene: three rigid bodies, four revolute joints, the fourth closing the loop.

    Parameters and errors as of `write_sdf`; of the effects it has gravity and flywheel.

    Source: openusd.org, UsdPhysics.
    """
    linkage = scene.linkage
    assembled = assemble(scene, start, "USD", {}, without_loads=without_loads)
    turn, foot, _, inertia, (x, y), _ = assembled
    pull = math.hypot(x, y)
    bodies = []
    for number in MOVING_BARS:
        bar = linkage.bar(number)
        bodies.append(
            f"""    def Xform "{BAR_NAMES[number]}" (
        prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"]
    )
    {{
        float physics:mass = {bar.mass!r}
        point3f physics:centerOfMass = {_place(bar.to_centre)}
        float3 physics:diagonalInertia = ({", ".join([repr(inertia[number])] * 3)})
        quatf physics:principalAxes = (1, 0, 0, 0)
        double3 xformOp:translate = {_place(foot[number])}
        quatd xformOp:orient = {_write_turn(turn[number])}
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:orient"]
    }}
"""
        )
    joints = []
    length = {number: linkage.bar(number).length for number in MOVING_BARS}
    places = {FIRST_PIN[number]: (PARENT[number], number, 0.0) for number in MOVING_BARS} | {"B": (4, 3, length[3])}
    for pin, (one, other, along) in places.items():
        on_one = {"O2": 0j, "A": complex(length[2]), "B": complex(length[4]), "O4": foot[4]}[pin]
        joints.append(
            f"""    def PhysicsRevoluteJoint "{pin}"
    {{
        uniform token physics:axis = "Z"
        {"" if one == 1 else f"rel physics:body0 = </four_bar/{BAR_NAMES[one]}>"}
        rel physics:body1 = </four_bar/{BAR_NAMES[other]}>
        point3f physics:localPos0 = {_place(on_one)}
        quatf physics:localRot0 = {_write_turn(turn[other] - turn[one])}
        point3f physics:localPos1 = {_place(complex(along))}
        quatf physics:localRot1 = (1, 0, 0, 0)
        bool physics:excludeFromArticulation = {"true" if pin == "B" else "false"}
    }}
"""
        )
    notes = json.dumps(write_comment(scene, "USD", "newton", assembled))
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
    vector3f physics:gravityDirection = ({x / pull if pull else 0.0!r}, {y / pull if pull else -1.0!r}, 0)
    float physics:gravityMagnitude = {pull!r}
}}

def Xform "four_bar" (
    doc = {json.dumps(clean_line(scene.title) or "four-bar", ensure_ascii=False)}
    prepend apiSchemas = ["PhysicsArticulationRootAPI"]
)
{{
{"".join([*bodies, *joints])}}}
"""


def _place(point: complex) -> str:
    return f"({point.real!r}, {point.imag!r}, 0)"


def _write_turn(angle: float) -> str:
    """Quaternion (w, x, y, z) of a turn about z."""
    return f"({math.cos(0.5 * angle)!r}, 0, 0, {math.sin(0.5 * angle)!r})"
