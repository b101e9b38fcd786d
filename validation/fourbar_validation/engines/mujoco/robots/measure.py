"""Torque, pin forces and gap of the loops of a robot's file, and their entries.

`check-mjcf` and `advise` ask them of MuJoCo. A loop is found, closed and driven in the
file and in the one that is generated from a scene, and with one entry changed at a
time.
"""

import math
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from fourbar.effects import Flywheel
from fourbar.errors import InputError, LimitError, write_count
from fourbar.linkage import FIRST_PIN
from fourbar.mjcf import write_mjcf
from fourbar.mjcf.document import Drive
from fourbar.quantities import OK, Array
from fourbar.scene import Scene, command, find_signs
from fourbar.scene.motion import Motion
from fourbar.solving import solve
from fourbar_validation.compare.tolerance import magnitude, wrap_difference
from fourbar_validation.engines.description import Value, name_driving
from fourbar_validation.engines.mujoco.describe import (
    STIFFEST,
    UNLIMITED_RANGE,
    describe_model,
    mend_entry,
    word_of_number,
)
from fourbar_validation.engines.mujoco.robots.ancestry import (
    describe_actuator,
    name_joint,
)
from fourbar_validation.engines.mujoco.robots.closures import (
    describe_equality,
    find_loops,
)
from fourbar_validation.engines.mujoco.robots.inside import LoopInside
from fourbar_validation.engines.mujoco.robots.loop_facts import (
    HIDING,
    SETTINGS_OF_AN_SDF,
    InsideAnswer,
    LoopMeasurement,
    MeasureOptions,
    RobotFile,
    RobotMeasurement,
    TornState,
    make_motion,
    thin_out,
    varies,
)
from fourbar_validation.engines.mujoco.robots.loop_scene import make_loop_scene
from fourbar_validation.engines.mujoco.robots.onto_scene import (
    LoopOfScene,
    find_loop_of_scene,
    turn,
)
from fourbar_validation.engines.mujoco.robots.pose import (
    collect_warnings,
    pose_robot,
)
from fourbar_validation.engines.mujoco.robots.settings import SettingsSearch

POSITIONS_OF_A_LOOP = 37
"""Positions at which a loop is looked at."""
_TORN_POSITIONS = 5
"""Positions from which a motor's torque acts."""
_CONSTANTS = 10.0
"""Time constants of the closure during which the torque acts. The loop has then yielded
as far as it does.
"""
WHOLE_TURN = math.tau * (1.0 - 1e-9)
"""rad; motions state their ends with twelve digits."""


def measure_loops(
    file: RobotFile | None, options: MeasureOptions, scene: Scene | None
) -> RobotMeasurement:
    """Measure the loops of a robot.

    Parameters
    ----------
    file : None: the one that is generated from the scene.
    scene : of the loop, of several the one whose lengths fit; None: it is made from the
        file.

    Raises
    ------
    InputError : there is no four-bar of that name, or none at all.
    """
    with collect_warnings() as warnings:
        if scene is not None:
            scene = options.state_speed(scene)
            file = file or _generate(scene)
            found = [find_loop_of_scene(file, scene, options)]
        else:
            assert file is not None
            found = [*_find_loops(file, options)]
        share = 1.0 / len(found)
        measured = tuple(measure_loop(one, options, share=share) for one in found)
    notes = [*found[0].robot.notes]
    if file.kind != "MJCF" and options.error is not None:
        notes.append(SETTINGS_OF_AN_SDF)
    return RobotMeasurement(measured, (*notes, *warnings))


def _find_loops(file: RobotFile, options: MeasureOptions) -> Iterator[LoopOfScene]:
    """Yield the loops of a file, each with the scene that is made from it."""
    posed = pose_robot(file, options.pose)
    for loop in find_loops(posed, options.loop):
        made = make_loop_scene(posed, loop, options.speed, loop.name)
        remarked = replace(turn(made.loop, made.scene), remarks=made.remarks)
        yield LoopOfScene(file, posed, remarked, (), made.scene)


def put_loop_inside(
    found: LoopOfScene, model: mujoco.MjModel | None = None
) -> tuple[LoopInside, Array]:
    """Return a loop as its scene drives it, and the motion by rising angles, (n, 3).

    The file's own cylinder drives it if it can. `model`: changed model of the file;
    None: the file's own.
    """
    model = found.robot.model if model is None else model
    scene = found.scene
    inside = LoopInside(model, found.loop, scene, as_it_is=found.as_it_is)
    flywheels = (one for one in scene.effects if isinstance(one, Flywheel))
    inside.find_flywheel(sum(one.inertia for one in flywheels))
    commanded = command(scene)
    if commanded.speed is None:
        raise InputError(
            f"motion.omega_{commanded.bar}",
            None,
            "is needed: without a speed there is no torque to compare",
        )
    states = (commanded.angle, commanded.speed, commanded.acceleration)
    motion = np.unique(np.column_stack(np.broadcast_arrays(*states)), axis=0)
    return inside, thin_out(motion, POSITIONS_OF_A_LOOP)


def measure_loop(
    found: LoopOfScene,
    options: MeasureOptions,
    model: mujoco.MjModel | None = None,
    *,
    share: float = 1.0,
) -> LoopMeasurement:
    """Measure a loop at the motion of its scene.

    Parameters
    ----------
    model : changed model of the file; None: the file's own.
    share : part of the time in which settings are looked for.
    """
    inside, motion = put_loop_inside(found, model)
    loop = inside.loop
    remarks = [*loop.remarks]
    if options.span is not None:
        motion, cut = _take_span(motion, inside, options.span)
        remarks += cut
    states = inside.answer_states(motion)
    if not len(states.rows) and states.in_line:
        raise LimitError(
            f"{loop.name} is measured at no position: the bars that follow are in line"
            " at all of them, where the loop may go on in two ways; choose others by"
            " the motion of a SCENE"
        )
    if not len(states.rows):
        raise LimitError(
            f"{loop.name} closes at none of the positions of the scene; its lengths "
            f"are {loop.describe_lengths()}"
        )
    scales = states.scales(inside.lever)
    seen = found.see()
    through: InsideAnswer | None = None
    refusal = ""
    closing = motion
    if not varies(motion):
        angles = states.rows.angle
        runs = np.split(angles, np.searchsorted(angles, states.open))
        longest = max(runs, key=len)
        closing = make_motion(longest.tolist(), motion[0, 1:])
    try:
        if not motion[:, 1].any() or len(closing) < 2:
            raise LimitError("nothing moves: a sweep at a speed is needed")
        if seen.closed_by == "nothing":
            raise LimitError("nothing closes the loop")
        through = inside.answer_through_time(closing)
    except LimitError as error:
        refusal = str(error)
    torn: list[TornState] = []
    if options.torque is not None:
        seconds = _CONSTANTS * inside.find_constant()
        starts = thin_out(closing, _TORN_POSITIONS)[:, 0].tolist()
        torn = inside.answer_under_torque(starts, options.torque, seconds)
    advice = None
    if options.error is not None:
        if varies(motion):
            raise LimitError(
                f"settings are tried in one motion through time: {refusal}"
            )
        search = SettingsSearch(inside, closing, share)
        advice = search.advise(options.error, found.file)
    remarks += _describe_findings(inside, states, through)
    described = describe_model(seen, inside.flywheel)
    for joint in inside.list_unmet_stops():
        entry = f"pins.{seen.pins[joint]}.range"
        described[entry] = described[entry]._replace(value=UNLIMITED_RANGE)
    ties = (describe_equality(inside.model, one) for one in loop.other_equalities)
    option = inside.model.opt
    return LoopMeasurement(
        loop.name,
        inside.name,
        found.scene,
        tuple(remarks),
        f"{word_of_number('integrator', option.integrator)} {option.timestep:g} s",
        loop.rounding,
        len(inside.held),
        tuple(ties),
        states,
        scales,
        through,
        refusal,
        torn,
        advice,
        inside.as_it_is,
        found.parts,
        described,
    )


def _describe_findings(
    inside: LoopInside,
    states: InsideAnswer,
    through: InsideAnswer | None,
) -> Iterator[str]:
    """Say what was taken off, and what was met on the way."""
    model = inside.given
    pin = FIRST_PIN[inside.bar]
    if inside.flywheel:
        yield (
            f"its armature of {inside.flywheel:.3g} kg m^2 on pin {pin} is taken for a"
            " flywheel that drives: the torque on it is not counted"
        )
    for number in inside.taken_off:
        yield (
            f"its drive on pin {pin}, {describe_actuator(model, number)}, is taken off:"
            " the torque is solved for"
        )
    for number in inside.drive.cylinders:
        name = model.actuator(number).name
        yield f"its actuator {name!r} gives the cylinder's force that is solved for"
    if inside.as_it_is and inside.contacts:
        contacts = write_count(inside.contacts, "contact")
        yield f"{contacts} at a position where nothing but pins should touch"
    if through is not None and through.skipped:
        yield (
            f"through time the first {through.settling:.3g} s ({through.skipped} of"
            f" {len(states.rows) - 1} positions after the start) are not judged: the"
            " loop yields in them"
        )
    for joint in inside.list_unmet_stops():
        ends = " and ".join(
            f"{math.degrees(end):.4g}" for end in model.jnt_range[joint]
        )
        name = name_joint(model, joint)
        yield f"the stops of joint {name!r}, at {ends} deg, are not met"
    if noslip := int(model.opt.noslip_iterations):
        yield (
            f"torque and pin forces are those of mj_forward with the file's {noslip}"
            " noslip_iterations; the forces that hold other joints are those of"
            " mj_inverse, which knows nothing of them"
        )
    rows = [*states.rows, *(through.rows if through is not None else ())]
    unreached = [row for row in rows if math.isnan(row.soft.torque)]
    if unreached:
        places = dict.fromkeys(f"{math.degrees(row.joint):.4g}" for row in unreached)
        what = "its cylinder" if inside.lever == 1.0 else "its drive"
        yield (
            f"nothing on {what} gives the commanded acceleration at {inside.name} ="
            f" {', '.join(places)} deg"
        )


def _take_span(
    motion: Array, inside: LoopInside, span: tuple[float, float]
) -> tuple[Array, list[str]]:
    """Return a motion evenly over a range of the driven joint, and what was cut of it.

    A motion of a whole turn goes on in any range of a joint without limits; another
    one cuts the range, rad.

    Raises
    ------
    InputError : a range that the motion does not reach.
    """
    angles = motion[:, 0].tolist()
    joints = [inside.position(angle) for angle in angles]
    low, high = span
    cut = []
    limited = inside.joint is not None and inside.model.jnt_limited[inside.joint]
    if limited or np.ptp(angles) < WHOLE_TURN:
        ends = (min(joints), max(joints))
        low, high = np.clip(span, *ends)
        first, last = np.degrees(ends)
        moved = f"the motion of {inside.name}, {first:.6g} to {last:.6g} deg"
        if low >= high:
            first, last = np.degrees(span)
            wanted = f"{first:.6g} to {last:.6g} deg"
            raise InputError("--range", wanted, f"must overlap {moved}")
        if (low, high) != span:
            cut = [f"--range is cut to {moved}"]
    if varies(motion):
        raise InputError("--range", None, "needs a motion of one speed")
    sense = inside.position(angles[0] + 1.0) - joints[0]
    places = np.linspace(low, high, POSITIONS_OF_A_LOOP) - joints[0]
    return make_motion(np.sort(angles[0] + sense * places), motion[0, 1:]), cut


PRICING = 60.0
"""Processor time in which differences are tried one by one, s; each takes two
evaluations.
"""
GENERATED = Path("generated.xml")
"""Name of the file that is generated from a scene."""
Changes = Sequence[tuple[str, Value | None]]
"""Keys of entries, each with the value that it gets."""


def _generate(scene: Scene) -> RobotFile:
    """Generate the file of a scene, at rest if no MJCF has a motion like its own."""
    drive: Drive = "flywheel"
    commanded = command(scene)
    rates = (commanded.speed, commanded.acceleration)
    varies = any(rate is not None and np.ptp(rate) for rate in rates)
    if varies or commanded.bar != 2 or scene.motion.stroke is not None:
        solution = solve(scene, "position")
        closed = np.flatnonzero(solution.status_code == OK)[:1]
        if not len(closed):
            raise LimitError("the scene's loop closes at none of its positions")
        theta_2 = np.asarray(solution.theta_2)[closed]
        signs = np.asarray(solution.branch)[closed]
        (branch,) = find_signs(scene.linkage, theta_2, signs).tolist()
        scene = replace(scene, motion=Motion(float(theta_2[0]), branch=branch))
        drive = "none"
    return RobotFile(GENERATED, write_mjcf(scene, drive=drive))


def examine_mended(
    scene: Scene, file: RobotFile, options: MeasureOptions, changes: Changes
) -> list[LoopMeasurement | None]:
    """Measure a file with one entry at a time as in the generated one.

    Entries that hide others stay so. None stands for an entry that cannot be set, or if
    time is up.
    """
    found = find_loop_of_scene(file, scene, options)
    end = time.process_time() + PRICING
    measured = []
    kept: list[tuple[str, Value | None]] = []
    for change in changes:
        seen = found.see()
        one = None
        mended = all(mend_entry(seen, *each) for each in (*kept, change))
        if mended and time.process_time() < end:
            with collect_warnings():
                one = measure_loop(found, options, seen.model)
            if change[0].endswith(HIDING):
                kept.append(change)
        measured.append(one)
    return measured


def predict_softness(
    scene: Scene, file: RobotFile, options: MeasureOptions
) -> dict[str, float]:
    """Predict the errors by MuJoCo's soft closure of the drive, N m or N, pin forces,
    N, angles and speeds through time, rad and rad/s.

    The error of a soft constraint goes as (1 - d)/d in its impedance d. Between
    STIFFEST and an impedance of twice that yield it grows by itself, so the error is
    measured without anything to compare the file with. Empty where no connect or weld
    closes the loop.
    """
    with collect_warnings():
        found = find_loop_of_scene(file, scene, options)
        if not found.robot.model.eq_active0[found.loop.equality]:
            return {}
        stiff, softer = (_answer_at_yield(found, times) for times in (1.0, 2.0))
    driving = name_driving(scene)
    softness = {}
    for at_stiff, at_softer in zip(stiff, softer, strict=True):
        both = min(len(at_stiff), len(at_softer))
        for name in at_stiff.dtype.names:
            changes = at_stiff[name][:both] - at_softer[name][:both]
            if name.startswith("theta"):
                changes = wrap_difference(changes)
            largest = float(np.nanmax(magnitude(changes), initial=0.0))
            softness[driving if name == "torque" else name] = largest
    return softness


def _answer_at_yield(found: LoopOfScene, times: float) -> tuple[Any, Any]:
    """Return torque and pin forces of single states at a multiple of the least yield,
    and the motion of the bars through time; nothing where it is not simulated.
    """
    model = found.see().model
    impedance = 1.0 / (1.0 + times * (1.0 / STIFFEST - 1.0))
    model.eq_solimp[[*found.loop.closures], :2] = impedance
    inside, motion = put_loop_inside(found, model)
    states = inside.answer_states(motion)
    through = InsideAnswer()
    with suppress(LimitError):
        through = inside.answer_through_time(motion)
    return states.rows.soft, through.rows.bars
