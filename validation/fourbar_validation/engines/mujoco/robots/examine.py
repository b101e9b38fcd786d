"""Somebody's MJCF beside the one generated from a scene: its entries, and its answers.

A loop is found, closed and driven in the file and in the generated one, and with one
entry changed at a time.
"""

import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fourbar.errors import LimitError
from fourbar.mjcf import write_mjcf
from fourbar.mjcf.document import Drive
from fourbar.quantities import OK
from fourbar.scene import Scene, command
from fourbar.scene.motion import BRANCH_NAMES, Motion
from fourbar.solving import solve
from fourbar_validation.compare.tolerance import wrap_difference
from fourbar_validation.engines.description import Value
from fourbar_validation.engines.mujoco.describe import (
    STIFFEST,
    UNLIMITED_RANGE,
    Described,
    describe_model,
    mend_entry,
)
from fourbar_validation.engines.mujoco.robots.answers import (
    InsideAnswer,
    LoopMeasurement,
    MeasureOptions,
    measure_sizes,
)
from fourbar_validation.engines.mujoco.robots.compiled import collect_warnings
from fourbar_validation.engines.mujoco.robots.loop_facts import PoseOptions, RobotFile
from fourbar_validation.engines.mujoco.robots.loop_scene import miss_output
from fourbar_validation.engines.mujoco.robots.measure import (
    measure_loop,
    put_loop_inside,
)
from fourbar_validation.engines.mujoco.robots.onto_scene import (
    LoopOfScene,
    find_loop_of_scene,
)

PRICING = 60.0
"""Processor time in which differences are tried one by one, s; each takes two
evaluations.
"""
GENERATED = Path("generated.xml")
"""Name of the file that is generated from a scene."""
_PLAIN = MeasureOptions(PoseOptions())
Changes = Sequence[tuple[str, Value | None]]
"""Keys of entries, each with the value that it gets."""


@dataclass(slots=True)
class Examined:
    """Results of examining one file."""

    described: Described
    measured: LoopMeasurement
    notes: list[str]


def _generate(scene: Scene) -> RobotFile:
    """Generate the file of a scene, at rest if no MJCF has a motion like its own."""
    drive: Drive = "flywheel"
    commanded = command(scene)
    rates = (commanded.speed, commanded.acceleration)
    varies = any(rate is not None and np.ptp(rate) for rate in rates)
    if varies or commanded.bar != 2 or scene.motion.stroke is not None:
        solution = solve(scene, "position")
        closed = np.flatnonzero(solution.status_code == OK)
        if not len(closed):
            raise LimitError("the scene's loop closes at none of its positions")
        first = closed[0]
        moving = (solution.theta_2, solution.theta_3, solution.theta_4)
        angles = [float(np.asarray(theta)[first]) for theta in moving]
        at_rest = [
            replace(scene, motion=Motion(angles[0], branch=branch))
            for branch in BRANCH_NAMES
        ]
        pose = [scene.linkage.ground_angle, *angles]
        scene = min(at_rest, key=lambda one: miss_output(one, pose))
        drive = "none"
    return RobotFile(GENERATED, write_mjcf(scene, drive=drive))


def examine_file(
    scene: Scene,
    file: RobotFile | None,
    options: MeasureOptions = _PLAIN,
) -> Examined:
    """Describe the loop of a file that is nearest to a scene, and measure it.

    None: the file that is generated from the scene.
    """
    with collect_warnings() as warnings:
        found = find_loop_of_scene(file or _generate(scene), scene, options)
        measured = measure_loop(found, options, briefly=True)
        described = describe_model(found.see(), measured.flywheel)
    for pin, joint in found.loop.hinges.items():
        if joint in measured.unmet_stops:
            key = f"pins.{pin}.range"
            described[key] = described[key]._replace(value=UNLIMITED_RANGE)
    notes = [*found.compiled.notes, *found.robot.notes, *found.parts]
    notes += [f"MuJoCo warns: {warning}" for warning in warnings]
    return Examined(described, measured, notes)


def examine_mended(
    scene: Scene, file: RobotFile, options: MeasureOptions, changes: Changes
) -> list[LoopMeasurement | None]:
    """Measure a file with one entry at a time as in the generated one.

    None stands for an entry that cannot be set, or if time is up.
    """
    found = find_loop_of_scene(file, scene, options)

    def measure(change: tuple[str, Value | None]) -> LoopMeasurement | None:
        seen = found.see().with_model()
        if not mend_entry(seen, *change):
            return None
        return measure_loop(found, options, seen.model, briefly=True)

    return list(_take_in_time(map(measure, changes), len(changes)))


def _take_in_time(
    answers: Iterator[LoopMeasurement | None], count: int
) -> Iterator[LoopMeasurement | None]:
    """Yield answers, None for each that is not begun within PRICING."""
    end = time.process_time() + PRICING
    for _ in range(count):
        answer = None
        if time.process_time() < end:
            with collect_warnings():
                answer = next(answers)
        yield answer


def predict_softness(
    scene: Scene, file: RobotFile, options: MeasureOptions
) -> dict[str, float]:
    """Predict the errors by MuJoCo's soft closure of torque, N m, pin forces, N, angles
    and speeds through time, rad and rad/s.

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
    softness = {}
    for at_stiff, at_softer in zip(stiff, softer, strict=True):
        both = min(len(at_stiff), len(at_softer))
        for name in at_stiff.dtype.names:
            changes = at_stiff[name][:both] - at_softer[name][:both]
            if name.startswith("theta"):
                changes = wrap_difference(changes)
            softness[name] = float(np.nanmax(measure_sizes(changes), initial=0.0))
    return softness


def _answer_at_yield(found: LoopOfScene, times: float) -> tuple[Any, Any]:
    """Return torque and pin forces of single states at a multiple of the least yield,
    and the motion of the bars through time; nothing where it is not simulated.
    """
    seen = found.see().with_model()
    impedance = 1.0 / (1.0 + times * (1.0 / STIFFEST - 1.0))
    seen.model.eq_solimp[[*found.loop.closures], :2] = impedance
    inside, motion = put_loop_inside(found, seen.model)
    states = inside.answer_states(motion)
    through = InsideAnswer()
    with suppress(LimitError):
        through = inside.answer_through_time(motion)
    return states.rows.soft, through.rows.bars
