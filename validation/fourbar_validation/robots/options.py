"""Options that the commands about a robot's file have in common."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import click

from fourbar.errors import InputError
from fourbar.linkage import require
from fourbar_validation.engines.mujoco.robots.loop_facts import PoseOptions

ROBOT_PATH = click.Path(path_type=Path)
RobotCommand = Callable[..., Any]

_POSE_OPTIONS = (
    click.option(
        "--pose",
        metavar="JOINT=ANGLE,...",
        multiple=True,
        help=(
            "Positions of joints with units, like knee=-20deg,slide=3mm; the loops are "
            "closed again around them."
        ),
    ),
    click.option(
        "--key",
        metavar="NAME",
        help="Keyframe that the pose is taken from (default: the file's rest pose).",
    ),
    click.option(
        "--hold",
        metavar="JOINT,...",
        multiple=True,
        help="Joints that are held where they stand: their bodies become one bar.",
    ),
    click.option(
        "--drive",
        metavar="JOINT",
        help=(
            "Hinge on the ground of the loop that is driven (default: that of a motor)."
        ),
    ),
    click.option(
        "--assets",
        type=ROBOT_PATH,
        metavar="DIR",
        help="Folder in which includes and meshes are looked for too.",
    ),
)


def pose_options(command: RobotCommand) -> RobotCommand:
    """Add --pose, --key, --hold, --drive and --assets to a command.

    The parameters are `pose`, `key`, `hold`, `drive`, `assets`.
    """
    for option in reversed(_POSE_OPTIONS):
        command = option(command)
    return command


loop_option = click.option(
    "--loop",
    metavar="NAME",
    help="Closure by its name, as `loops` prints it.",
)
speed_option = click.option(
    "--speed",
    metavar="W",
    help='Speed of the driven bar, rad/s or with a unit like "60 rpm".',
)

range_option = click.option(
    "--range",
    "span",
    metavar="LOW,HIGH",
    help="Range of the driven joint, like -40deg,30deg (default: all that it has).",
)
torque_option = click.option(
    "--torque",
    metavar="T",
    help=(
        "Torque of the motor on its joint, N m or with a unit: the loop is let go under"
        " it from rest, and the largest gap is printed with the pin forces."
    ),
)


def read_pose(robot: Mapping[str, Any]) -> PoseOptions:
    """Read the values of `pose_options`, by their names.

    Raises
    ------
    InputError : an entry of --pose that is no JOINT=ANGLE.
    """
    joints = {}
    for entry in _split_at_commas(robot["pose"]):
        joint, equals, position = entry.partition("=")
        if not equals or not joint or not position:
            raise InputError("--pose", entry, "must be like JOINT=20deg")
        joints[joint.strip()] = position.strip()
    held = tuple(_split_at_commas(robot["hold"]))
    return PoseOptions(joints, robot["key"], held, robot["drive"])


def read_number(option: str, text: str | None, unit: str) -> float | None:
    """Read the value of an option, a number in the unit or with one of its own."""
    if text is None:
        return None
    try:
        return require(option, float(text))
    except ValueError:
        return require(option, text, unit)


def _split_at_commas(values: tuple[str, ...]) -> list[str]:
    """Split values at commas; the same option may be given several times."""
    return [
        part.strip() for value in values for part in value.split(",") if part.strip()
    ]
