"""A robot's file compiled as MuJoCo compiles it.

A mesh that is missing is a tetrahedron that touches nothing.
"""

import math
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from xml.etree import ElementTree as ET

import mujoco
import numpy as np

from fourbar.errors import InputError
from fourbar_validation.engines.mujoco.robots.ancestry import is_enabled, name_body
from fourbar_validation.engines.mujoco.robots.loop_facts import RobotFile

_MOST_KEYFRAMES = 100_000
"""A robot has a few; MuJoCo reserves as many as a file asks for, minutes long."""
_LARGEST_NUMBER = 1e100
"""m, kg or kg m^2 whose square is a double."""
_OTHER_SCALE = 1e3
"""Scale at which what stands in for a mesh gives every body that has it another mass.
"""


@dataclass(frozen=True, slots=True)
class CompiledRobot:
    """Compiled model of a robot's file."""

    model: mujoco.MjModel
    notes: tuple[str, ...]
    unknown_masses: tuple[int, ...]
    """Bodies whose mass a missing mesh would have given."""
    quaternions: Mapping[int, tuple[float, ...]]
    """Quaternion of each body whose orientation the file states by one, as it stands
    there: the compiled one is normalized, which hides its digits.
    """


@contextmanager
def collect_warnings() -> Iterator[list[str]]:
    """Collect the warnings of MuJoCo, each once.

    MuJoCo then neither prints nor logs them.
    """
    heard: list[str] = []

    def hear(warning: str) -> None:
        if warning not in heard:
            heard.append(warning)

    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(hear)
    try:
        yield heard
    finally:
        mujoco.set_mju_user_warning(before)


def compile_robot(file: RobotFile) -> CompiledRobot:
    """Compile a robot's file.

    What stands in for a missing mesh touches nothing; the body states its inertia.

    Raises
    ------
    InputError : MuJoCo's complaint, or what the file asks too much of, in one line.
    """
    try:
        spec = mujoco.MjSpec.from_string(file.text, assets=dict(file.assets))
        if spec.nkey > _MOST_KEYFRAMES:
            raise InputError(
                "MJCF",
                None,
                f"asks for {spec.nkey} keyframes; up to {_MOST_KEYFRAMES} are read",
            )
        _add_loop_joints(spec, file)
        _part_stand_ins(spec, file)
        quaternions = {
            number: tuple(body.quat.tolist())
            for number, body in enumerate(spec.bodies)
            if body.alt.type == mujoco.mjtOrientation.mjORIENTATION_QUAT
        }
        model = spec.compile()
        masses = _list_unknown_masses(spec, file, model)
    except ValueError as error:
        # its lines are those of a text that is written anew, and not of the file
        stated = re.sub(r", line \d+", "", str(error))
        complaint = " ".join(f"MuJoCo does not compile it: {stated}".split())
        raise InputError("MJCF", None, complaint) from None
    except RuntimeError:  # "unknown exception": a size that no memory holds
        raise InputError(
            "MJCF",
            None,
            "MuJoCo breaks down over it; is a size in it too large?",
        ) from None
    if not is_enabled(model, "equality", "constraint"):
        model.eq_active0[:] = 0
    if not 0.0 < model.opt.timestep < math.inf:
        raise InputError(
            "MJCF",
            None,
            f"its timestep of {model.opt.timestep:g} s must be above 0",
        )
    for name in ("body_mass", "body_inertia", "body_pos", "body_ipos", "site_pos"):
        largest = float(np.abs(getattr(model, name)).max(initial=0.0))
        if not largest < _LARGEST_NUMBER:
            raise InputError("MJCF", None, f"{name} of {largest:g} is out of range")
    notes = list(file.notes)
    if left_out := {*file.missing.values()}:
        notes.append(
            f"meshes that are missing are left out: {len(left_out)}, the first of them "
            f"{min(left_out)}"
        )
    if masses:
        names = ", ".join(name_body(model, number) for number in masses)
        notes.append(
            f"the masses of {names} are unknown: their meshes are missing and no "
            "inertial is stated; --assets DIR says where the meshes are"
        )
    return CompiledRobot(model, tuple(notes), masses, quaternions)


def list_unknown_parts(robot: CompiledRobot, bodies: set[int]) -> list[str]:
    """List the bodies of unknown mass that are parts of another body.

    Raises
    ------
    InputError : a body that has joints of its own is among them: nothing else of it is
        known.
    """
    model = robot.model
    unknown = [number for number in robot.unknown_masses if number in bodies]
    for number in unknown:
        if model.body_jntnum[number]:
            raise InputError(
                "MJCF",
                name_body(model, number),
                "states no inertial and its mesh is missing: its mass is unknown; "
                "--assets DIR says where the meshes are",
            )
    return [name_body(model, number) for number in unknown]


def _add_loop_joints(spec: mujoco.MjSpec, file: RobotFile) -> None:
    """Add a connect for each pin by which a URDF closes a loop."""
    for place, pin in enumerate(ET.fromstring(file.text).iter("loop_joint")):
        closure = spec.add_equality(
            name=pin.get("name", ""), type=mujoco.mjtEq.mjEQ_CONNECT
        )
        closure.objtype = mujoco.mjtObj.mjOBJ_SITE
        for number, end in enumerate(pin.findall("*[@link]"), 1):
            site = f"loop_joint {place} {number}"
            at = [float(part) for part in end.attrib["xyz"].split()]
            spec.body(end.attrib["link"]).add_site(name=site, pos=at)
            setattr(closure, f"name{number}", site)


def _part_stand_ins(spec: mujoco.MjSpec, file: RobotFile) -> None:
    """Let what stands in for a missing mesh touch nothing."""
    for geom in spec.geoms:
        if geom.meshname in file.missing:
            geom.contype = geom.conaffinity = 0
    for pair in [*spec.pairs] if file.missing else ():
        spec.delete(pair)  # it may name what stands in


def _list_unknown_masses(
    spec: mujoco.MjSpec, file: RobotFile, model: mujoco.MjModel
) -> tuple[int, ...]:
    """List the bodies that move and whose mass or inertia missing meshes would give.

    They have others where what stands in for a mesh has another size.
    """
    if not file.missing:
        return ()
    for mesh in spec.meshes:
        if mesh.name in file.missing:
            mesh.scale *= _OTHER_SCALE
    changed = (spec.compile().body_inertia != model.body_inertia).any(axis=1)
    bodies: list[int] = np.flatnonzero(changed & (model.body_weldid != 0)).tolist()
    return tuple(bodies)
