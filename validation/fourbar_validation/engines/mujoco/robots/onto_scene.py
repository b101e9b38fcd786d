"""A loop of a robot, driven and assembled as a scene has it.

The pose of a robot closes to one assembly, and its plane may be seen from either side.
Seen from behind, the crossed assembly is the open one: the pose tells the side where it
tells the assembly, and gravity tells the side where the pose does not. The robot's own
closure is then closed onto the assembly of the scene.
"""

import math
from dataclasses import replace

import numpy as np

from fourbar.effects import Gravity
from fourbar.errors import InputError
from fourbar.quantities import Array
from fourbar.scene import Scene, command
from fourbar.scene.motion import BRANCH_NAMES
from fourbar_validation.engines.mujoco.robots.ancestry import is_enabled, name_joint
from fourbar_validation.engines.mujoco.robots.closures import (
    choose_loop,
    find_closures,
)
from fourbar_validation.engines.mujoco.robots.inside import LoopInside, reflect
from fourbar_validation.engines.mujoco.robots.loop import (
    FLAT,
    PoseOptions,
    RobotLoop,
)
from fourbar_validation.engines.mujoco.robots.pose import PosedRobot, move_to
from fourbar_validation.engines.mujoco.robots.scene import (
    is_seen_from_behind,
    miss_output,
    write_pose,
)

ALIKE = 1e-6
"""Difference of logarithms of lengths below which two ways round fit a scene alike."""
_SAME_DIRECTION = 1e-6
"""Difference of two unit vectors up to which gravity has the direction of a scene's:
angles of a pose have six digits.
"""


def close_onto(
    scene: Scene,
    posed: PosedRobot,
    loop: RobotLoop,
    pose: PoseOptions,
) -> tuple[RobotLoop, PosedRobot]:
    """Return the loop as a scene has it, and the robot in a pose of that assembly.

    The scene's input is driven, and the plane is seen from the scene's side.

    Raises
    ------
    InputError : gravity tells that the pose is of the other assembly.
    """
    apart, turned = miss_lengths(scene, loop)
    output = loop.hinges.get("O4")
    if pose.drive is None and output is not None and turned < apart - ALIKE:
        pose = replace(pose, drive=name_joint(posed.model, output))
        loop = choose_loop(find_closures(posed, pose), loop.name)
    if loop.is_flat:
        behind = not _fits_gravity(scene, posed, loop) and _fits_gravity(
            scene,
            posed,
            loop.seen_from_behind(),
        )
        return _close_flat(scene, posed, loop, pose, behind)
    theta_1, theta_2, _, theta_4 = loop.angles
    behind = is_seen_from_behind(scene, theta_1, theta_2, theta_4)
    seen = loop.seen_from_behind() if behind else loop
    _require_assembly(scene, posed, seen)
    return seen, posed


def _close_flat(
    scene: Scene,
    posed: PosedRobot,
    loop: RobotLoop,
    pose: PoseOptions,
    behind: bool,
) -> tuple[RobotLoop, PosedRobot]:
    """Close a loop whose pose does not tell its assembly onto that of a scene."""

    def sample_loop(at: PosedRobot) -> RobotLoop:
        sampled = choose_loop(find_closures(at, pose), loop.name)
        return sampled.seen_from_behind() if behind else sampled

    loop = sample_loop(posed)
    if _measure_sine(loop) <= FLAT:
        posed = move_to(posed, _leave_flat(scene, posed, loop))
        loop = sample_loop(posed)
    theta_1, theta_2, _, theta_4 = loop.angles
    missed = miss_output(scene, theta_1, theta_2, theta_4)
    reflected = reflect(posed.model, loop)
    if reflected is not None:
        other_pose = move_to(posed, reflected)
        other = sample_loop(other_pose)
        theta_1, theta_2, _, theta_4 = other.angles
        missed_by_other = miss_output(scene, theta_1, theta_2, theta_4)
        if missed_by_other < missed:
            posed = other_pose
            loop = other
            missed = missed_by_other
    text = (
        "the bars of pin B are in line in the pose before closing, which does not tell"
        " the assembly: "
    )
    if missed <= FLAT:
        name = BRANCH_NAMES[scene.motion.branch]
        text += f"the loop is closed onto the {name} one of the scene"
    else:
        text += "no pose that was tried closes onto that of the scene"
    return replace(loop, remarks=(*loop.remarks, text)), posed


def _leave_flat(
    scene: Scene,
    posed: PosedRobot,
    loop: RobotLoop,
) -> Array:
    """Return a pose at an angle of the scene at which the bars are not in line."""
    inside = LoopInside(posed.model, loop)
    turned = find_turn(scene, loop)
    best = loop.qpos
    largest = 0.0
    for theta_2 in np.unique(command(scene).theta_2) + turned:
        qpos = inside.close(float(theta_2))
        if qpos is None:
            continue
        size = inside.measure_transmission(qpos)
        if size > largest:
            best = qpos
            largest = size
    return best


def _measure_sine(loop: RobotLoop) -> float:
    """Return the sine of the angle between bars 3 and 4 in the pose, by its size."""
    return abs(math.sin(loop.angles[3] - loop.angles[2]))


def _require_assembly(
    scene: Scene,
    posed: PosedRobot,
    loop: RobotLoop,
) -> None:
    """Refuse a pose that is of the scene's assembly from the wrong side alone."""
    behind = loop.seen_from_behind()
    if _fits_gravity(scene, posed, loop) or not _fits_gravity(scene, posed, behind):
        return
    wanted = BRANCH_NAMES[scene.motion.branch]
    other = BRANCH_NAMES[-scene.motion.branch]
    reflected = reflect(posed.model, loop)
    if reflected is None:
        advice = "state a pose of that one"
    else:
        advice = f"give --pose {write_pose(posed.model, loop, reflected)}"
    raise InputError(
        "--pose",
        None,
        f"the pose of {loop.name} closes to the {other} assembly and the scene names"
        f" the {wanted} one (seen so that gravity points as in the scene): {advice}",
    )


def _fits_gravity(
    scene: Scene,
    posed: PosedRobot,
    loop: RobotLoop,
) -> bool:
    """Return whether gravity has the direction that it has in a scene.

    Sizes are compared elsewhere; without gravity in one of the two, no side fits.
    """
    model = posed.model
    wanted = np.zeros(2)
    for effect in scene.effects:
        if isinstance(effect, Gravity):
            wanted = wanted + effect.vector
    ground = posed.data.xmat[loop.bodies[1][0]].reshape(3, 3)
    along = ground @ loop.along
    across = ground @ np.cross(loop.axis, loop.along)
    gravity = model.opt.gravity * is_enabled(model, "gravity")
    angle = scene.linkage.ground_angle - loop.angles[0]
    cos = math.cos(angle)
    sin = math.sin(angle)
    x = float(gravity @ along)
    y = float(gravity @ across)
    of_robot = np.array([cos * x - sin * y, sin * x + cos * y])
    size = float(np.linalg.norm(of_robot))
    wanted_size = float(np.linalg.norm(wanted))
    if size == 0.0 or wanted_size == 0.0:
        return False
    difference = of_robot / size - np.asarray(wanted) / wanted_size
    return bool(np.linalg.norm(difference) <= _SAME_DIRECTION)


def miss_lengths(scene: Scene, loop: RobotLoop) -> tuple[float, float]:
    """Return by how much a loop's lengths miss those of a scene.

    The loop is as it is driven, and driven at its output.
    """
    ground, *moving = np.log(loop.lengths)
    wanted = np.log(scene.linkage.lengths)
    apart, turned = (
        float(np.abs(wanted - lengths).sum())
        for lengths in ([ground, *moving], [ground, *reversed(moving)])
    )
    return apart, turned


def find_turn(scene: Scene, loop: RobotLoop) -> float:
    """Return the angle from a scene's axes to those of the loop's plane, rad.

    Whole turns bring it near the pose. With one change point a turn leads to the other
    assembly: of two turns the one counts after which the scene has that of the pose.
    """
    theta_1, theta_2, _, theta_4 = loop.angles
    turned = theta_1 - scene.linkage.ground_angle
    middle = float(np.mean(command(scene).theta_2)) + turned
    away = (middle - theta_2) / math.tau

    def rank(turns: int) -> tuple[bool, float]:
        in_scene = theta_2 + math.tau * turns
        missed = miss_output(scene, theta_1, in_scene, theta_4)
        return missed > FLAT, abs(turns - away)

    nearest = round(away)
    turns = min((nearest, nearest - 1, nearest + 1), key=rank)
    return turned - math.tau * turns
