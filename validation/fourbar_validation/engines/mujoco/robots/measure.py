"""Torque, pin forces and gap of the loops of a robot's file.

`check-mjcf` and `advise` ask them of MuJoCo.
"""

import math
from collections.abc import Mapping
from dataclasses import replace

import mujoco
import numpy as np

from fourbar.errors import InputError, LimitError
from fourbar.scene import Scene, command
from fourbar_validation.engines.mujoco.robots.answers import (
    Influence,
    InsideAnswer,
    LoopMeasurement,
    LoopMotion,
    MeasureOptions,
    RobotMeasurement,
    TornState,
    divide,
    measure_sizes,
)
from fourbar_validation.engines.mujoco.robots.closures import (
    choose_loop,
    describe_equality,
    find_closures,
)
from fourbar_validation.engines.mujoco.robots.compiled import compile_robot
from fourbar_validation.engines.mujoco.robots.drive import LoopDrive
from fourbar_validation.engines.mujoco.robots.inside import HEAVY, LoopInside
from fourbar_validation.engines.mujoco.robots.loop import RobotFile, RobotLoop
from fourbar_validation.engines.mujoco.robots.onto_scene import (
    close_onto,
    find_turn,
    miss_lengths,
)
from fourbar_validation.engines.mujoco.robots.pose import pose_robot
from fourbar_validation.engines.mujoco.robots.scene import make_loop_scene
from fourbar_validation.engines.mujoco.robots.settings import (
    SettingsSearch,
    read_settings,
)
from fourbar_validation.engines.mujoco.theirs import collect_warnings

POSITIONS_OF_A_LOOP = 37
"""Positions at which a loop is looked at."""
_TORN_POSITIONS = 5
"""Positions from which a motor's torque acts."""
_CONSTANTS = 10.0
"""Time constants of the closure during which the torque acts. The loop has then yielded
as far as it does.
"""
_LIGHTER = 0.1
"""Factor on what holds the other joints, to see what it matters."""


def measure_loops(
    file: RobotFile,
    options: MeasureOptions,
    scene: Scene | None,
) -> RobotMeasurement:
    """Measure the loops of a robot.

    Parameters
    ----------
    scene : of the loop, of several the one whose lengths fit; None: it is made from the
        file.

    Raises
    ------
    InputError : there is no four-bar of that name, or none at all.
    """
    with collect_warnings() as warnings:
        compiled = compile_robot(file)
        posed = pose_robot(compiled.model, options.pose)
        closures = find_closures(posed, options.pose)
        if options.loop is not None:
            loops = [choose_loop(closures, options.loop)]
        else:
            loops = [one.loop for one in closures if one.loop is not None]
        if not loops:
            reasons = "; ".join(f"{one.name}: {one.reason}" for one in closures)
            why = reasons or "the file has no equality that closes a loop"
            raise InputError("MJCF", None, f"has no planar four-bar: {why}")
        if scene is not None and options.loop is None:
            loops = [min(loops, key=lambda one: min(miss_lengths(scene, one)))]
        measured = []
        for one in loops:
            if scene is None:
                loop, robot = one, posed
            else:
                loop, robot = close_onto(scene, posed, one, options.pose)
            made = make_loop_scene(compiled, robot, loop, options.speed, loop.name)
            stated = made.scene if scene is None else scene
            if scene is None:
                remarks = made.remarks
            else:
                remarks = loop.remarks
            share = 1.0 / len(loops)
            loop = made.loop
            measurement = _measure_loop(posed.model, loop, stated, options, file, share)
            solver = _describe_noslip(posed.model)
            measured.append(replace(measurement, remarks=(*remarks, *solver)))
    notes = [*compiled.notes, *posed.notes]
    notes += [f"MuJoCo warns: {warning}" for warning in warnings]
    return RobotMeasurement(tuple(measured), tuple(notes))


def _measure_loop(
    model: mujoco.MjModel,
    loop: RobotLoop,
    scene: Scene,
    options: MeasureOptions,
    file: RobotFile,
    share: float,
) -> LoopMeasurement:
    """Measure one loop; `share`: part of the time in which settings are looked for."""
    if options.speed is not None:
        scene = replace(scene, motion=scene.motion.replace(speed=options.speed))
    turned = find_turn(scene, loop)
    inside = LoopInside(model, loop, LoopDrive(model, loop, scene, turned))
    motion = _choose_motion(scene, turned)
    if options.span is not None:
        motion = _take_span(motion, inside, options.span)
    motion = motion.thin_out(POSITIONS_OF_A_LOOP)
    states = inside.answer_states(*motion)
    if not states.rows and states.in_line:
        raise LimitError(
            f"{loop.name} is measured at no position: coupler and output are in line at"
            " all of them, where the loop may go on in two ways; choose others by the"
            " motion of a SCENE"
        )
    if not states.rows:
        raise LimitError(
            f"{loop.name} closes at none of the positions of the scene; its lengths "
            f"are {loop.describe_lengths()}"
        )
    scales = states.scales(inside.lever)
    closing = motion._replace(theta_2=tuple(row.theta_2 for row in states.rows))
    through: InsideAnswer | None = None
    refusal = ""
    influence: Influence | None = None
    try:
        if motion.omega_2 == 0.0 or len(closing.theta_2) < 2:
            raise LimitError("nothing moves: a sweep at a speed is needed")
        through = inside.answer_through_time(*closing)
        lighter = inside.answer_through_time(*closing, HEAVY * _LIGHTER)
        influence = _compare_at_same_angles(through, lighter, scales)
    except LimitError as error:
        refusal = str(error)
    torn: tuple[TornState, ...] = ()
    if options.torque is not None:
        seconds = _CONSTANTS * inside.find_constant()
        starts = closing.thin_out(_TORN_POSITIONS).theta_2
        torn = tuple(inside.answer_under_torque(starts, options.torque, seconds))
    advice = None
    if options.error is not None:
        search = SettingsSearch(model, loop, closing, inside.acting, share)
        advice = search.advise(options.error, file)
    return LoopMeasurement(
        loop.name,
        inside.name,
        scene,
        turned,
        (),
        read_settings(model, loop),
        loop.rounding,
        len(inside.held),
        tuple(describe_equality(model, number) for number in loop.other_equalities),
        states,
        scales,
        through,
        refusal,
        influence,
        torn,
        advice,
    )


def _describe_noslip(model: mujoco.MjModel) -> list[str]:
    """Say what a second solver of dry friction changes, if the file has one."""
    if not model.opt.noslip_iterations or not model.dof_frictionloss.any():
        return []
    return [
        "torque and pin forces are those of mj_forward with the file's"
        f" noslip_iterations of {model.opt.noslip_iterations}, which dry friction is"
        " solved by again; the forces that hold other joints are those of mj_inverse,"
        " which knows nothing of it"
    ]


def _choose_motion(scene: Scene, turned: float) -> LoopMotion:
    """Return the motion of a scene in the plane of the loop."""
    commanded = command(scene)
    speed = float(np.max(commanded.omega_2 or 0.0))
    acceleration = float(np.max(commanded.alpha_2))
    angles = np.unique(commanded.theta_2) + turned
    return LoopMotion(tuple(angles.tolist()), speed, acceleration)


def _take_span(
    motion: LoopMotion, inside: LoopInside, span: tuple[float, float]
) -> LoopMotion:
    """Return a motion evenly over a range of the driven joint, rad, as far as it goes.

    Raises
    ------
    InputError : a range that the motion does not reach.
    """
    joints = [inside.position(angle) for angle in motion.theta_2]
    low, high = max(span[0], min(joints)), min(span[1], max(joints))
    if low >= high:
        moved, wanted = (
            " to ".join(f"{math.degrees(end):.6g}" for end in ends)
            for ends in ((min(joints), max(joints)), span)
        )
        raise InputError(
            "--range",
            f"{wanted} deg",
            f"must overlap the motion of {inside.name}, {moved} deg",
        )
    sense = inside.position(motion.theta_2[0] + 1.0) - joints[0]
    places = np.linspace(low, high, POSITIONS_OF_A_LOOP) - joints[0]
    angles = np.sort(motion.theta_2[0] + sense * places)
    return motion._replace(theta_2=tuple(angles.tolist()))


def _compare_at_same_angles(
    one: InsideAnswer,
    other: InsideAnswer,
    scales: Mapping[str, float],
) -> Influence:
    """Return by how much the errors of two runs differ at the same angles.

    An error is that at its run's own state: the motions differ too, and near a limit
    position the forces with them. `scales`: those of the errors, N m and N.
    """
    if one.lost or other.lost:
        return Influence(math.inf, math.inf)
    worst = 0.0
    median = 0.0
    pairs = [*zip(one.rows, other.rows, strict=False)]
    for name, scale in scales.items():
        first, second = (
            np.array(
                [row.soft.values()[name] - row.rigid.values()[name] for row in rows]
            )
            for rows in zip(*pairs, strict=True)
        )
        changes = measure_sizes(first - second)
        worst = max(worst, divide(float(changes.max()), scale))
        median = max(median, divide(float(np.median(changes)), scale))
    return Influence(worst, median)
