"""A joint equality of a robot's file.

By its polynomial one joint follows another.
"""

import math
from dataclasses import dataclass

import mujoco

from fourbar.errors import InputError
from fourbar_validation.engines.mujoco.robots.ancestry import name_joint
from fourbar_validation.engines.mujoco.robots.compiled import compile_robot
from fourbar_validation.engines.mujoco.robots.loop import RobotFile
from fourbar_validation.engines.mujoco.robots.pose import HINGE, find_joint


@dataclass(frozen=True, slots=True)
class JointEquality:
    """The position of a joint as a polynomial of that of another.

    y - y0 = a0 + a1 (x - x0) + ... + a4 (x - x0)^4, with x of the leader and y of the
    follower.
    """

    follower: str
    leader: str
    coefficients: tuple[float, ...]
    """a0 to a4."""
    leader_zero: float
    """x0, rad: the leader in the rest pose of the file."""
    sense: float
    """+1 if both joints turn about the same direction, -1 if about opposite ones."""


def read_joint_equality(file: RobotFile, name: str) -> JointEquality:
    """Read the equality by which a joint follows another.

    Raises
    ------
    InputError : no such joint, no equality by which it follows, or a joint that is no
        hinge.
    """
    model = compile_robot(file).model
    joint = find_joint(model, name, "--mimic")
    for number in range(model.neq):
        ties = model.eq_type[number] == mujoco.mjtEq.mjEQ_JOINT
        leader = int(model.eq_obj2id[number])
        if ties and int(model.eq_obj1id[number]) == joint and leader >= 0:
            return _describe(model, number, joint, leader)
    raise InputError(
        "--mimic",
        name,
        f'follows no other joint: the file has no <joint joint1="{name}" joint2="...">',
    )


def _describe(
    model: mujoco.MjModel, number: int, follower: int, leader: int
) -> JointEquality:
    for joint in (follower, leader):
        if int(model.jnt_type[joint]) != HINGE:
            raise InputError(
                "--mimic", name_joint(model, joint), "is no hinge: both must be hinges"
            )
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    along = float(data.xaxis[follower] @ data.xaxis[leader])
    return JointEquality(
        name_joint(model, follower),
        name_joint(model, leader),
        tuple(model.eq_data[number, :5].tolist()),
        float(model.qpos0[model.jnt_qposadr[leader]]),
        math.copysign(1.0, along),
    )
