"""The files of other simulators, SDF and USD, read as text.

The free bodies assemble them.
"""

import re
from cmath import phase, polar, rect
from dataclasses import replace
from math import atan2, nan
from typing import NamedTuple
from xml.etree import ElementTree as ET

import numpy as np

from fourbar.effects import Friction, Gravity, Viscous
from fourbar.errors import InputError, LimitError
from fourbar.files.scene_text import MOVING_BAR_NUMBERS
from fourbar.linkage import ENDS, Bar, FourBar
from fourbar.mjcf.assembly import write_sdf as sdf_text
from fourbar.mjcf.assembly import write_usd as usd_text
from fourbar.solving import solve
from fourbar_validation.compare.pins import state_from_pins
from fourbar_validation.compare.rows import REFUSES, Row, keep_worst
from fourbar_validation.compare.tolerance import EPS, K
from fourbar_validation.run.question import NotAskedError
from tests.oracle.variants import ask_free_bodies, at_places, hold_to, take_few

NUMBER_IN_A_FILE = r"[-+.\deE]+"


class _FileBody(NamedTuple):
    """A bar as a file holds it; the numbers are those of the plane."""

    place: complex
    turn: float
    mass: float
    inertia: float
    centre: complex


class Contents(NamedTuple):
    """Statements of a file on a linkage."""

    bodies: dict
    pins: dict
    """Places of the pins in the world; NaN if the two bars of a pin do not meet."""
    turns: list
    """Statements of the angles of all bars, rad. They are by the bodies, by the joints,
    and in words.
    """
    gravity: complex
    damping: dict
    """Damping by pin, as the next field."""
    friction: dict


def sdf(question):
    """Judge the SDF for Gazebo."""
    return _judge_file(question, "sdf", lambda scene: _read_sdf(sdf_text(scene)))


def usd(question):
    """Judge the USD."""
    return _judge_file(question, "usd", lambda scene: _read_usd(usd_text(scene)))


def _judge_file(question, engine, read):
    """Compare a file at its own position and at some more.

    Loads are what a simulator adds.
    """
    if question.at.commanded != "theta_2":
        raise NotAskedError(f"{question.at.commanded} is commanded")
    # a drive at a named point keeps its place without the point
    scene = replace(state_from_pins(take_few(question)), loads=(), points=())
    opened = at_places(scene, scene.motion.theta_2[:1])
    try:
        held = read(opened)
    except (LimitError, InputError) as limit:
        return [
            Row.unmeasured(question.name, engine, "exact", "all", REFUSES, str(limit))
        ]
    theirs = _build_scene(held, opened)
    rows = []
    with np.errstate(all="ignore"):
        for turns in held.turns:
            answer = ask_free_bodies(at_places(theirs, np.array([turns["input"]])))
            answer.quantities |= {
                f"theta_{MOVING_BAR_NUMBERS[bar]}": np.array([turns[bar]])
                for bar in ("coupler", "output")
            }
            rows += hold_to(question, engine, opened, solve(opened), answer)
        more = ask_free_bodies(replace(theirs, motion=scene.motion))
        return keep_worst(
            [*rows, *hold_to(question, engine, scene, solve(scene), more)]
        )


def _build_scene(held, scene):
    """Build the scene that a file describes, with motion and drive of another scene."""
    span, *bars = (held.pins[end] - held.pins[start] for start, end in ENDS.values())
    moving = []
    for name, bar in zip(MOVING_BAR_NUMBERS, bars, strict=True):
        _, _, mass, inertia, centre = held.bodies[name]
        moving.append(Bar(abs(bar), mass, inertia, polar(centre)))
    effects = (Gravity(*polar(held.gravity)),)
    if held.damping:
        effects += (Viscous.at(**held.damping),)
    if held.friction:
        effects += (Friction.at(**held.friction),)
    linkage = FourBar(abs(span), *moving, phase(span))
    return replace(scene, linkage=linkage, effects=effects)


def _read_sdf(text):
    root = ET.fromstring(text)

    def numbers(element, path, left_out="nan"):
        return [float(number) for number in element.findtext(path, left_out).split()]

    bodies = {}
    for link in root.iter("link"):
        x, y, _, _, _, turn = numbers(link, "pose")
        centre = complex(*numbers(link, "inertial/pose")[:2])
        (mass,) = numbers(link, "inertial/mass")
        (inertia,) = numbers(link, "inertial/inertia/izz")
        bodies[link.get("name", "")] = _FileBody(
            complex(x, y), turn, mass, inertia, centre
        )
    pins = {}
    dynamics = {"damping": {}, "friction": {}}
    for joint in root.iter("joint"):
        pin = joint.get("name", "")
        child = bodies[joint.findtext("child", "")]
        pose = complex(*numbers(joint, "pose", "0 0")[:2])
        pins[pin] = child.place + pose * rect(1.0, child.turn)
        for name, at_pins in dynamics.items():
            if (stated := joint.findtext(f"axis/dynamics/{name}")) is not None:
                at_pins[pin] = float(stated)
    gravity = complex(*numbers(next(root.iter("world")), "gravity")[:2])
    return Contents(
        bodies, pins, [_read_turns(bodies), _read_noted(text)], gravity, **dynamics
    )


def _read_usd(text):
    def numbers(block, key):
        stated = re.search(rf"{re.escape(key)} = (.*)", block)[1]
        return [float(number) for number in re.findall(NUMBER_IN_A_FILE, stated)]

    def turn(block, key):
        w, _, _, z = numbers(block, key)
        return 2.0 * atan2(z, w)

    blocks = dict(
        re.findall(
            r'def (?:Xform|PhysicsRevoluteJoint|PhysicsScene) "(\w+)"[^{]*\{([^{}]*)\}',
            text,
        )
    )
    bodies = {"ground": _FileBody(0j, 0.0, nan, nan, 0j)}
    for bar in MOVING_BAR_NUMBERS:
        block = blocks[bar]
        place, centre = (
            complex(*numbers(block, key)[:2])
            for key in ("xformOp:translate", "physics:centerOfMass")
        )
        mass = numbers(block, "physics:mass")[0]
        inertia = numbers(block, "physics:diagonalInertia")[2]
        bodies[bar] = _FileBody(
            place, turn(block, "xformOp:orient"), mass, inertia, centre
        )
    size = sum(abs(body.place) + abs(body.centre) for body in bodies.values())
    pins = {}
    at_joints = {"ground": 0.0}
    for pin in ("O2", "A", "O4", "B"):
        block = blocks[pin]
        ends = {
            end: re.search(rf"physics:body{end} = </four_bar/(\w+)>", block)
            for end in (0, 1)
        }
        names = [match[1] if match else "ground" for match in ends.values()]
        one, second = (
            bodies[bar].place
            + complex(*numbers(block, f"physics:localPos{end}")[:2])
            * rect(1.0, bodies[bar].turn)
            for end, bar in enumerate(names)
        )
        pins[pin] = one if abs(one - second) <= K * EPS * size else complex(nan)
        between = turn(block, "physics:localRot0") - turn(block, "physics:localRot1")
        if pin == "B":
            at_joints["coupler at B"] = at_joints[names[0]] + between
        else:
            at_joints[names[1]] = at_joints[names[0]] + between
    closing = at_joints | {"coupler": at_joints["coupler at B"]}
    (pull,) = numbers(blocks["physics"], "physics:gravityMagnitude")
    return Contents(
        bodies,
        pins,
        [_read_turns(bodies), at_joints, closing, _read_noted(text)],
        pull * complex(*numbers(blocks["physics"], "physics:gravityDirection")[:2]),
        {},
        {},
    )


def _read_turns(bodies):
    return {bar: body.turn for bar, body in bodies.items()}


def _read_noted(text):
    """Read the angles that the file states in words."""
    return {
        bar: float(match[1])
        for bar, number in MOVING_BAR_NUMBERS.items()
        if (match := re.search(f"theta_{number} = ({NUMBER_IN_A_FILE})", text))
    }
