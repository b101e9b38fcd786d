"""A loop of a robot, driven and assembled as a scene has it.

The pose of a robot closes to one assembly, and its plane may be seen from either side.
Seen from behind, the crossed assembly is the open one: the pose tells the side where it
tells the assembly, and gravity tells the side where the pose does not. The robot's own
closure is then closed onto the assembly of the scene.
"""

import math
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import replace
from xml.etree import ElementTree as ET

import mujoco
import numpy as np

from fourbar.effects import Gravity
from fourbar.errors import InputError
from fourbar.formulas.mobility import find_circuit
from fourbar.linkage import record
from fourbar.quantities import Array
from fourbar.scene import Scene, command
from fourbar.scene.motion import BRANCH_NAMES, CROSSED, OPEN
from fourbar_validation.engines.mujoco.robots.ancestry import (
    find_named,
    is_enabled,
    list_closing,
    name_body,
)
from fourbar_validation.engines.mujoco.robots.closures import find_loops
from fourbar_validation.engines.mujoco.robots.inside import LoopInside
from fourbar_validation.engines.mujoco.robots.loop_facts import (
    BAR_ROLES,
    FLAT,
    SITE_ROLES,
    MeasureOptions,
    RobotFile,
    RobotLoop,
    is_in_line,
    name_following,
)
from fourbar_validation.engines.mujoco.robots.loop_scene import (
    SceneOfLoop,
    is_seen_from_behind,
    miss_output,
    write_pose,
)
from fourbar_validation.engines.mujoco.robots.pose import (
    PosedRobot,
    compile_robot,
    move_to,
    pose_robot,
)
from fourbar_validation.engines.mujoco.robots.seen import LoopFrame, SeenLoop

_NOTHING_CLOSES = {
    "MJCF": (
        "has no equality that closes a loop; where something else does, say where"
        " pin B is: --name B3=SITE on the coupler, --name B4=SITE on the output"
    ),
    "SDF": (
        "has nothing that closes a loop: a further joint does, or"
        " <drake:ball_constraint>"
    ),
    "URDF": (
        "has no loop that pins close: its mimic joints stand for loops, and --mimic"
        " JOINT judges one"
    ),
}
"""Why a file of each format has no loop, and what to do."""
_BEHIND = (
    "its plane is seen from behind, where it is in the assembly of the scene; gravity"
    " does not tell the side"
)
ALIKE = 1e-6
"""Difference of logarithms of lengths below which two ways round fit a scene alike."""
_SAME_DIRECTION = 1e-6
"""Difference of two unit vectors up to which gravity has the direction of a scene's:
angles of a pose have six digits.
"""


@record
class LoopOfScene:
    """A loop of a file that a scene is held against."""

    file: RobotFile
    robot: PosedRobot
    """Robot in a pose of the assembly of the scene."""
    loop: RobotLoop
    """Loop as the scene has it: its input is driven, and seen from the same side."""
    parts: tuple[str, ...]
    """Sentences that say which joint is which pin, and which body which bar."""
    scene: Scene
    as_it_is: bool = False
    """True if contacts, joint limits and other motors act as in the file, since it
    holds nothing but the loop.
    """

    def see(self) -> SeenLoop:
        """Return the loop as its entries are described, in a model of its own."""
        bar = command(self.scene).bar
        return SeenLoop(copy(self.robot.model), self.loop, bar)


def find_loop_of_scene(
    file: RobotFile,
    scene: Scene,
    options: MeasureOptions,
) -> LoopOfScene:
    """Find the loop whose lengths are nearest to those of a scene, as the scene has it.

    Where nothing closes a loop two sites may be its fourth pin: those that are named,
    or those called B3 and B4. Nothing is then exerted there.

    Raises
    ------
    InputError : there is no such loop, or it stands in the other assembly.
    """
    closed = _close_by_sites(file, options.names)
    found = _fit(closed, scene, options)
    if closed is file:
        return found
    loop = found.loop
    model = found.robot.model
    model.eq_active0[loop.equality] = 0
    # a tendon holds the pin in its place
    others = tuple(
        number
        for number in loop.other_equalities
        if model.eq_type[number] != mujoco.mjtEq.mjEQ_TENDON
    )
    return replace(found, file=file, loop=replace(loop, other_equalities=others))


def _close_by_sites(file: RobotFile, names: Mapping[str, str]) -> RobotFile:
    """Return a file in which two sites are pin B, where nothing closes a loop."""
    model = compile_robot(file).model
    if list_closing(model):
        return file
    sites = [model.site(number).name for number in range(model.nsite)]
    for role, name in names.items():
        if role in SITE_ROLES:
            find_named(sites, name, "site", "--name", f"{role}={name}")
    stated = {f"site{i}": names.get(r, r) for i, r in enumerate(SITE_ROLES, 1)}
    if not {*stated.values()} <= {*sites}:
        raise InputError("MJCF", None, _NOTHING_CLOSES[file.kind])
    closed = ET.fromstring(file.text)
    equality = ET.SubElement(closed, "equality")
    ET.SubElement(equality, "connect", stated, name="B")
    return replace(file, text=ET.tostring(closed, encoding="unicode"))


def _fit(file: RobotFile, scene: Scene, options: MeasureOptions) -> LoopOfScene:
    """Return the loop of a file whose lengths are nearest to those of a scene.

    A loop is driven at either end unless a joint is stated.
    """
    posed = pose_robot(file, options.pose)
    loops = find_loops(posed, options.loop)
    ways = [*loops]
    if options.pose.drive is None:
        ways = [way for one in loops for way in (one, one.from_other_end or one)]
    lengths = scene.linkage.lengths
    ways = [SceneOfLoop(posed, way).meet_lengths(lengths) for way in ways]
    model = posed.model
    names = [name_body(model, body) for body in range(model.nbody)]
    wanted = {}
    for role, name in options.names.items():
        if role in BAR_ROLES:
            wanted[role] = 1 + find_named(names[1:], name, "body", "--name")
    usual = {role: names.index(role) for role in BAR_ROLES if role in names}

    def rank(way: RobotLoop) -> tuple[int, int, int]:
        """Count misnamed bodies and what lengths miss, the sum of |log ratio|."""
        ratios = np.abs(np.log(lengths) - np.log(way.met))
        missed = round(float(ratios.sum()) / ALIKE)
        return _count_misnamed(way, wanted), missed, _count_misnamed(way, usual)

    loop = min(ways, key=rank)
    if _count_misnamed(loop, wanted):
        stated = ", ".join(f"{role}={names[body]}" for role, body in wanted.items())
        bars = "; ".join(
            ", ".join(
                f"{role} {name_body(model, way.bodies[bar][0])}"
                for role, bar in BAR_ROLES.items()
            )
            for way in ways
        )
        raise InputError("--name", stated, f"no four-bar has these bars: {bars}")
    loop, robot = close_onto(scene, posed, loop)
    described = SceneOfLoop(robot, loop)
    described.require_masses()
    loop = described.meet_lengths(lengths)
    remarks = (*loop.remarks, *described.remarks)
    return LoopOfScene(
        file,
        robot,
        turn(replace(loop, remarks=remarks), scene),
        described.write_parts(),
        scene,
        as_it_is=not loop.held,
    )


def _count_misnamed(loop: RobotLoop, bodies: Mapping[str, int]) -> int:
    """Count the roles whose body is no part of the bar of that role."""
    return sum(loop.bars[body] != BAR_ROLES[role] for role, body in bodies.items())


def close_onto(
    scene: Scene, posed: PosedRobot, loop: RobotLoop
) -> tuple[RobotLoop, PosedRobot]:
    """Return a loop seen from the scene's side, and the robot in that assembly.

    Gravity tells the side, or else the pose does. A pose of the other assembly, or one
    that tells none, is closed onto that of the scene.

    Raises
    ------
    InputError : gravity tells that the pose is of the other assembly, from which the
        linkage does not move into that of the scene.
    """
    bar = command(scene).bar
    sides = (loop, loop.seen_from_behind())
    fits = [_fits_gravity(scene, posed, side) for side in sides]
    is_told = fits[0] != fits[1]
    is_flat = loop.is_flat(bar)
    by_pose = not is_flat and is_seen_from_behind(scene, loop.angles)
    behind = fits[1] if is_told else by_pose
    seen = sides[behind]
    if behind == by_pose and not is_flat:
        told_by = (_BEHIND,) * (behind and not is_told)
        return replace(seen, remarks=(*loop.remarks, *told_by)), posed
    if is_flat and is_in_line(loop.angles, bar):
        posed = move_to(posed, _leave_flat(scene, posed, seen))
        seen = _place(seen, posed)
    ways = [(seen, posed)]
    reflected = LoopInside(posed.model, seen, scene).reflect()
    if reflected is not None:
        there = move_to(posed, reflected)
        ways.append((_place(seen, there), there))
    branch = scene.motion.branch
    wanted = BRANCH_NAMES[branch]
    if is_flat:
        moved, robot = min(ways, key=lambda way: miss_output(scene, way[0].angles))
        text = (
            f"{name_following(bar)} are in line in the pose before closing, which does"
            " not tell the assembly: "
        )
        found = f"the loop is closed onto the {wanted} one of the scene"
        is_open = miss_output(scene, moved.angles) == math.inf
        if is_open or is_seen_from_behind(scene, moved.angles):
            found = "no pose that was tried closes onto that of the scene"
        text += found
    else:
        moved, robot = ways[-1]
        text = (
            f"the pose of {loop.name} closes to the {BRANCH_NAMES[-branch]} assembly"
            f" and the scene names the {wanted} one (seen so that gravity points as in"
            " the scene)"
        )
        before, after = (_find_circuit(scene, way.angles) for way in (seen, moved))
        if reflected is None or before != after:
            advice = "state a pose of that one"
            if other_pose := write_pose(posed.model, seen, reflected):
                advice = f"give --pose {other_pose}"
            raise InputError("--pose", None, f"{text}: {advice}")
        text += ": it is moved there"
    return replace(moved, remarks=(*loop.remarks, text)), robot


def _place(loop: RobotLoop, posed: PosedRobot) -> RobotLoop:
    """Return a loop of a robot in another pose."""
    qpos = posed.data.qpos.copy()
    lengths, angles = LoopFrame(loop, posed.data).measure_bars()
    return replace(
        loop, qpos=qpos, lengths=lengths, angles=angles, stated_angles=angles
    )


def _leave_flat(scene: Scene, posed: PosedRobot, loop: RobotLoop) -> Array:
    """Return a pose at an angle of the scene at which the bars are not in line."""
    angles = np.unique(command(scene).angle).tolist()
    inside = LoopInside(posed.model, turn(loop, scene), scene)
    poses = map(inside.close, angles)
    closed = [loop.qpos, *(qpos for qpos in poses if qpos is not None)]
    return max(closed, key=lambda qpos: abs(inside.measure_sine(qpos)))


def _fits_gravity(
    scene: Scene,
    posed: PosedRobot,
    loop: RobotLoop,
) -> bool:
    """Return whether gravity has the direction that it has in a scene.

    Sizes are compared elsewhere; without gravity in one of the two, no side fits.
    """
    model = posed.model
    turned = loop.angles[0] - scene.linkage.ground_angle
    gravity = model.opt.gravity * is_enabled(model, "gravity")
    in_scene = LoopFrame(loop.turn(turned), posed.data)
    effects = (one for one in scene.effects if isinstance(one, Gravity))
    wanted = sum(complex(*one.vector) for one in effects)
    pull = complex(*in_scene.in_plane(gravity))
    if not (pull and wanted):
        return False
    return abs(pull / abs(pull) - wanted / abs(wanted)) <= _SAME_DIRECTION


def _find_circuit(scene: Scene, angles: Sequence[float]) -> int:
    """Return the circuit of a scene's linkage in which a loop stands.

    `angles`: theta_1 to theta_4 of the loop, rad.
    """
    theta_1, theta_2, theta_3, theta_4 = angles
    branch = OPEN if math.sin(theta_4 - theta_3) > 0.0 else CROSSED
    angle = np.array([theta_2 - theta_1 + scene.linkage.ground_angle])
    return int(find_circuit(scene.linkage, angle, branch)[0])


def turn(loop: RobotLoop, scene: Scene) -> RobotLoop:
    """Return a loop in the axes of a scene.

    Whole turns bring it near the pose. With one change point a turn leads to the other
    assembly: of two turns the one counts after which the scene has that of the pose.
    """
    commanded = command(scene)
    turned = loop.angles[0] - scene.linkage.ground_angle
    middle = float(np.mean(commanded.angle)) + turned
    place = commanded.bar - 1
    away = (middle - loop.angles[place]) / math.tau

    def rank(turns: int) -> tuple[bool, float]:
        in_scene = [*loop.angles]
        in_scene[place] += math.tau * turns
        missed = miss_output(scene, in_scene)
        return missed > FLAT, round(abs(turns - away), 6)

    nearest = math.ceil(away - 0.5 - 1e-6)
    turns = min((nearest, nearest - 1, nearest + 1), key=rank)
    return loop.turn(turned - math.tau * turns)
