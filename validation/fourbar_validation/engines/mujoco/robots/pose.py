"""A robot's file, compiled and brought into the pose in which it is measured.

A mesh that is missing is a tetrahedron that touches nothing. The pose is the file's or
the stated one, closed again.

Least squares closes the pose. The residuals are those of MuJoCo's own active
equalities, the unknowns the joints that they depend on. A step of Gauss and Newton is a
linear least-squares problem within the joints' ranges; damping keeps the pose near the
one that was stated. Joints that a motor holds move only where the others cannot close
the loops.
"""

import math
import re
import warnings
from collections.abc import Iterator, Mapping, Set
from contextlib import contextmanager
from dataclasses import replace
from xml.etree import ElementTree as ET

import mujoco
import numpy as np

from fourbar.errors import InputError
from fourbar.linkage import record, require
from fourbar.quantities import Array
from fourbar_validation.engines.mujoco.robots.ancestry import (
    find_named,
    is_enabled,
    list_motors,
    list_tied_joints,
    name_body,
    name_joint,
)
from fourbar_validation.engines.mujoco.robots.loop_facts import PoseOptions, RobotFile
from fourbar_validation.engines.mujoco.robots.planes import (
    copy_for_closures,
    evaluate_closures,
    find_normals,
)

_MOST_KEYFRAMES = 100_000
"""A robot has a few; MuJoCo reserves as many as a file asks for, minutes long."""
_LARGEST_NUMBER = 1e100
"""m, kg or kg m^2 whose square is a double."""
_LEAST_MASS = 1e-6
"""kg, of a link of a URDF that states less than MuJoCo takes."""
_LEAST_MOMENT = 1e-9
"""kg m^2, of such a link."""
_OTHER_SCALE = 1e3
"""Scale at which what stands in for a mesh gives every body that has it another mass.
"""


@record
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
    """Collect the warnings of MuJoCo as notes, each once.

    MuJoCo then neither prints nor logs them.
    """
    heard: list[str] = []

    def hear(warning: str) -> None:
        note = f"MuJoCo warns: {warning}"
        if note not in heard:
            heard.append(note)

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
        with warnings.catch_warnings(record=True, action="always") as warned:
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
            other = spec.copy()  # compiling takes what is only visual out of it
            model, raised = _compile_links(spec, file)
            masses = _list_unknown_masses(other, file, model)
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
    said = dict.fromkeys(f"MuJoCo warns: {one.message}" for one in warned)
    notes = [*file.notes, *raised, *said]
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


def _compile_links(
    spec: mujoco.MjSpec, file: RobotFile
) -> tuple[mujoco.MjModel, list[str]]:
    """Compile a model, a URDF whose links MuJoCo refuses with others; a note says so.

    Links without mass bear the polynomials of mimic joints, which have no forces.
    """
    given = spec.copy()
    try:
        return spec.compile(), []
    except ValueError as error:
        if file.kind != "URDF":
            raise
        refused = " ".join(str(error).split("\n")[:2])
    bounds = given.compiler
    bounds.boundmass = max(bounds.boundmass, _LEAST_MASS)
    bounds.boundinertia = max(bounds.boundinertia, _LEAST_MOMENT)
    bounds.balanceinertia = True
    return given.compile(), [
        f"MuJoCo refuses the links as they stand ({refused}): masses below"
        f" {bounds.boundmass:g} kg and moments of inertia below {bounds.boundinertia:g}"
        " kg m^2 are raised to these, and three moments of which one exceeds the sum of"
        " the others become their mean"
    ]


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

    Mass and inertia differ from those of the robot where what stands in for a mesh has
    another size.
    """
    if not file.missing:
        return ()
    for mesh in spec.meshes:
        if mesh.name in file.missing:
            mesh.scale *= _OTHER_SCALE
    changed = (spec.compile().body_inertia != model.body_inertia).any(axis=1)
    bodies: list[int] = np.flatnonzero(changed & (model.body_weldid != 0)).tolist()
    return tuple(bodies)


FREE_JOINT, BALL, SLIDE, HINGE_JOINT = (
    int(getattr(mujoco.mjtJoint, f"mjJNT_{name}"))
    for name in ("FREE", "BALL", "SLIDE", "HINGE")
)
JOINT_UNITS = {HINGE_JOINT: "rad", SLIDE: "m"}
CLOSED_IN_THE_FILE = 1e-9
"""m or rad; a smaller residual of the equalities is closed as far as a file can say."""
_QUARTER_TURNS = 0.5 * math.pi * np.array([-1.0, 1.0])
"""Turns of a hinge without limits from which closing is tried again, rad."""
LARGEST_RESIDUAL = 1e-5
"""m or rad; a residual above this after closing is a loop that does not close."""
MOST_NEWTON_STEPS = 100
LONGEST_NEWTON_STEP = 0.3
"""rad or m; longer steps leave the region where the loops are nearly linear."""
_NO_STEP = 1e-12
"""rad or m; a shorter step moves nothing: the residuals are at their least."""
_DAMPING = 1e-4
"""Weight of a step against the residuals. It keeps what no equality decides where it
is.
"""
OUTSIDE_A_RANGE = 1e-6
"""rad or m; a joint is outside its range beyond the rounding of a file."""


@record
class PosedRobot(CompiledRobot):
    """A compiled robot in a pose; the notes say too what was done for the pose."""

    held: frozenset[int]
    """Joints that are fixed where they stand."""
    drive: int | None
    """Joint that is driven; None: that of a motor."""
    data: mujoco.MjData
    """State in the pose, closed, positions evaluated."""
    stated: Array
    """Joint positions before the loops were closed, (nq,)."""


def pose_robot(file: RobotFile, options: PoseOptions) -> PosedRobot:
    """Compile a robot's file, bring it into a pose and close its loops.

    Raises
    ------
    InputError : what `compile_robot` refuses, an unknown joint or keyframe, a position
        without a unit or of another kind.
    """
    compiled = compile_robot(file)
    model = compiled.model
    stated = _choose_start(model, options)
    held = frozenset(find_joint(model, name, "--hold") for name in options.held)
    drive = None
    if options.drive is not None:
        drive = find_joint(model, options.drive, "--drive")
    fixed = {*held}
    for name, text in options.joints.items():
        joint = find_joint(model, name, "--pose")
        unit = JOINT_UNITS.get(model.jnt_type[joint])
        if unit is None:
            raise InputError("--pose", f"{name}={text}", "must be a hinge or a slide")
        position = 0.0 if text == "0" else require(f"--pose {name}", text, unit)
        stated[model.jnt_qposadr[joint]] = position
        fixed.add(joint)
    closings = [_Closing(model, held, *group) for group in _list_groups(model)]
    tied = fixed.union(*(one.tied for one in closings))
    outside = [joint for joint in find_outside(model, stated) if joint in tied]
    notes = [*compiled.notes]
    if outside:
        names = ", ".join(name_joint(model, joint) for joint in outside)
        notes.append(f"outside their ranges before closing: {names}")
    closed = stated
    for closing in closings:
        closed = closing.find_pose(closed, fixed, {*outside})
    sizes = [closing.size(closed) for closing in closings]
    left = max(sizes, default=0.0)
    if left > LARGEST_RESIDUAL:
        widest = closings[sizes.index(left)]
        notes.append(widest.say_open(options, stated, left))
    elif moved := _list_moved(model, stated, closed):
        notes.append(f"the loops are closed again by least squares: {', '.join(moved)}")
    data = evaluate_kinematics(model, closed)
    return PosedRobot(
        model,
        tuple(notes),
        compiled.unknown_masses,
        compiled.quaternions,
        held,
        drive,
        data,
        stated,
    )


def _list_moved(model: mujoco.MjModel, stated: Array, closed: Array) -> list[str]:
    """List the joints that closing the loops moved, each with its amount."""
    change = np.zeros(model.nv)
    mujoco.mj_differentiatePos(model, change, 1.0, stated, closed)
    moved = []
    for joint in range(model.njnt):
        amounts = change[model.dof_jntid == joint]
        shifts = {SLIDE: 1, FREE_JOINT: 3}.get(model.jnt_type[joint], 0)
        parts = []
        for part, factor, unit in (
            (amounts[:shifts], 1e3, "mm"),
            (amounts[shifts:], math.degrees(1.0), "deg"),
        ):
            amount = float(part[0] if len(part) == 1 else np.linalg.norm(part))
            if abs(amount) > OUTSIDE_A_RANGE:
                parts.append(f"{factor * amount:.4g} {unit}")
        if parts:
            moved.append(f"{name_joint(model, joint)} by {' and '.join(parts)}")
    return moved


def move_to(posed: PosedRobot, qpos: Array) -> PosedRobot:
    """Return a robot whose loops are closed in another pose."""
    data = evaluate_kinematics(posed.model, qpos)
    return replace(posed, data=data, stated=qpos)


def find_joint(
    model: mujoco.MjModel,
    name: str,
    option: str,
) -> int:
    """Find a joint by its name, as it is printed.

    Raises an InputError that lists the joints.
    """
    names = [name_joint(model, joint) for joint in range(model.njnt)]
    return find_named(names, name, "joint", option)


def find_outside(model: mujoco.MjModel, qpos: Array) -> list[int]:
    """List the hinges and slides that are outside their ranges."""
    low, high = _list_bounds(model)
    outside = (qpos < low - OUTSIDE_A_RANGE) | (qpos > high + OUTSIDE_A_RANGE)
    joints: list[int] = np.flatnonzero(outside[model.jnt_qposadr]).tolist()
    return joints


def _choose_start(model: mujoco.MjModel, options: PoseOptions) -> Array:
    """Return the positions to begin with, (nq,)."""
    if options.key is None:
        return np.array(model.qpos0)
    keys = range(model.nkey)
    names = [*(model.key(i).name for i in keys), *map(str, keys)]
    number = find_named(names, options.key, "keyframe", "--key") % model.nkey
    return np.array(model.key_qpos[number])


def _list_bounds(model: mujoco.MjModel) -> tuple[Array, Array]:
    """Return the range of each position, (nq,) each; infinite if unlimited."""
    low = np.full(model.nq, -np.inf)
    high = np.full(model.nq, np.inf)
    limited = np.isin(model.jnt_type, [*JOINT_UNITS]) & (model.jnt_limited != 0)
    addresses = model.jnt_qposadr[limited]
    low[addresses], high[addresses] = model.jnt_range[limited].T
    return low, high


def evaluate_kinematics(model: mujoco.MjModel, qpos: Array) -> mujoco.MjData:
    """Return a state in which the positions of bodies are evaluated."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_normalizeQuat(model, data.qpos)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return data


def _list_groups(model: mujoco.MjModel) -> list[tuple[list[int], set[int]]]:
    """List the active equalities and the joints that they depend on, in groups.

    No joint of a group moves an equality of another.
    """
    groups: list[tuple[list[int], set[int]]] = []
    for number in np.flatnonzero(model.eq_active0).tolist():
        numbers = [number]
        joints = list_tied_joints(model, number)
        for group in [*groups]:
            if group[1] & joints:
                groups.remove(group)
                numbers += group[0]
                joints |= group[1]
        groups.append((numbers, joints))
    return groups


class _Closing:
    """Least squares of some equalities over the joints that they depend on."""

    def __init__(
        self,
        model: mujoco.MjModel,
        held: frozenset[int],
        equalities: list[int],
        tied: set[int],
    ) -> None:
        """Take equalities and their joints.

        `held`: joints that are no joints of a loop.
        """
        self.model = copy_for_closures(model, equalities)
        self.held = held
        self.data = mujoco.MjData(self.model)
        self.low, self.high = _list_bounds(model)
        self.tied = tied

    def _evaluate(self, qpos: Array) -> tuple[Array, Array]:
        """Return the equalities' residuals, (m,), and their Jacobian, (m, nv)."""
        data = self.data
        data.qpos[:] = qpos
        mujoco.mj_fwdPosition(self.model, data)
        normals = find_normals(self.model, data, self.held)
        return evaluate_closures(self.model, data, normals)

    def size(self, qpos: Array) -> float:
        """Return the largest residual in a pose, m or rad."""
        residuals, _ = self._evaluate(qpos)
        return float(np.abs(residuals).max(initial=0.0))

    def find_pose(self, stated: Array, fixed: Set[int], outside: set[int]) -> Array:
        """Return the pose near a stated one in which the loops are closed, (nq,).

        Fixed joints stay. `outside`: joints that are outside their ranges.
        """
        if self.size(stated) <= CLOSED_IN_THE_FILE and not outside - fixed & self.tied:
            return stated
        motors = {*list_motors(self.model)} - outside
        closed = self.close(stated, fixed | motors)
        # where a motor or a range stops it short of closing
        for start in (stated, *self.list_starts(stated, fixed)):
            if self.size(closed) <= LARGEST_RESIDUAL:
                break
            closed = min(closed, self.close(start, fixed), key=self.size)
        if self.size(closed) > CLOSED_IN_THE_FILE:  # but for the file's rounding
            closed = self.close(closed, fixed)
        return closed

    def list_starts(self, stated: Array, fixed: Set[int]) -> Iterator[Array]:
        """List poses from which closing may end elsewhere, (nq,).

        Each moves one joint: to a quarter, half or three quarters of its range, or a
        hinge without limits by a quarter turn either way, since least squares keep bars
        in line that are so. Fixed joints stay.
        """
        for joint in sorted(self.tied - fixed):
            place = self.model.jnt_qposadr[joint]
            values: list[float] = []
            if math.isfinite(self.low[place]):
                ends = (self.low[place], self.high[place])
                values = np.linspace(*ends, 5)[1:-1].tolist()
            elif self.model.jnt_type[joint] == HINGE_JOINT:
                values = (stated[place] + _QUARTER_TURNS).tolist()
            for value in values:
                start = stated.copy()
                start[place] = value
                yield start

    def close(self, start: Array, fixed: Set[int]) -> Array:
        """Return the pose near `start` of least residuals in the ranges, (nq,).

        Fixed joints do not move.
        """
        from scipy.optimize import lsq_linear

        model = self.model
        qpos = start.copy()
        moving = [*self.tied - fixed]
        dofs = np.flatnonzero(np.isin(model.dof_jntid, moving))
        places = model.jnt_qposadr[model.dof_jntid[dofs]]
        low = self.low[places]
        high = self.high[places]
        qpos[places] = np.clip(qpos[places], low, high)
        if not len(dofs):
            return qpos
        damping = _DAMPING * np.eye(len(dofs))
        for _ in range(MOST_NEWTON_STEPS):
            residuals, jacobian = self._evaluate(qpos)
            if np.abs(residuals).max(initial=0.0) <= 1e-3 * CLOSED_IN_THE_FILE:
                break
            matrix = np.vstack([jacobian[:, dofs], damping])
            wanted = np.concatenate([-residuals, np.zeros(len(dofs))])
            room = (  # scipy asks for some on both sides
                np.clip(low - qpos[places], -LONGEST_NEWTON_STEP, -1e-15),
                np.clip(high - qpos[places], 1e-15, LONGEST_NEWTON_STEP),
            )
            step = np.zeros(model.nv)
            step[dofs] = lsq_linear(matrix, wanted, room).x
            mujoco.mj_integratePos(model, qpos, step, 1.0)
            if np.abs(step).max() <= _NO_STEP:
                break
        return qpos

    def say_open(self, options: PoseOptions, stated: Array, left: float) -> str:
        """Say why no pose near the stated one closes all loops.

        Joints that --pose states are held, which is the reason where the loops close
        without that. `left`: residual, m or rad.
        """
        free = [joint for joint in self.tied if joint not in self.held]
        within = ""
        if self.model.jnt_limited[free].any():
            within = " within the joints' ranges"
        text = f"all loops{within}; what is left is {1e3 * left:.3g} mm or mrad"
        closed = self.find_pose(stated, self.held, set())
        if options.joints and self.size(closed) <= LARGEST_RESIDUAL:
            return (
                f"--pose holds {', '.join(options.joints)}, around which the other"
                f" joints cannot close {text}: state fewer joints, or more digits"
            )
        return f"no pose near this one closes {text}: state one by --pose or --key"
