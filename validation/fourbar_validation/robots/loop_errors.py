"""Errors of torque and pin forces of a robot's loops.

`check-mjcf` and `advise` ask for them.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fourbar.errors import InputError
from fourbar.linkage import record, require
from fourbar.quantities import OK, STATUS_NAMES, UNITS
from fourbar.scene import Command, Scene
from fourbar.solution import Solution
from fourbar.solving import solve
from fourbar_validation.compare.reversals import mark_reversing
from fourbar_validation.compare.tolerance import divide
from fourbar_validation.engines.mujoco.robots.loop_facts import (
    InsideAnswer,
    LoopMeasurement,
    MeasureOptions,
    RobotMeasurement,
    measure_sizes,
)
from fourbar_validation.robots.files import read_robot
from fourbar_validation.robots.guard import examine_guarded
from fourbar_validation.robots.options import read_number, read_pose

MEASURE = "fourbar_validation.engines.mujoco.robots.measure:measure_loops"
MEASURE_SECONDS = 600.0
"""s; a busy machine takes several times the two minutes of an idle one."""
RIGID = "rigid pins"
STATES = "single states"
MEASURED_THROUGH_TIME = "through time"
_DECIMALS_OF_A_POSE = 9
"""Decimals of a position in degrees; those beyond are rounding."""
_LEAST_PERCENT = 1e-5
"""Percentage below which errors are rounding, and none is written."""
_SLIP = 1e-9
"""Part of the speeds below which a pin with dry friction is at rest. It may then rub
either way.
"""


@record
class InsideError:
    """Worst error of one quantity of a loop by one method."""

    method: str
    quantity: str
    error: float
    """N m or N."""
    scale: float
    """Largest size of the quantity, or of its terms where it vanishes, N m or N."""
    vanishes: bool
    """True where the scale is that of the terms."""
    joint: float
    """Position of the driven joint where the error is largest, rad."""
    theta_2: float
    """Angle of bar 2 there in the axes of the scene, rad."""
    angle: float
    """Angle of the commanded bar there in the same axes, rad."""
    median: float
    """Median of the errors over the judged states, over the same scale; infinite
    without an answer.
    """

    @property
    def part(self) -> float:
        """The error over its scale; infinite without an answer."""
        return float(divide(self.error, self.scale))

    def cells(self) -> tuple[str, ...]:
        """Return method, quantity, error, relative size, place and median, as text."""
        return (
            self.method,
            self.quantity,
            f"{self.error:.3g} {UNITS[self.quantity]}",
            write_percent(self.part),
            f"{write_degrees(self.joint)} deg",
            write_percent(self.median),
        )


def write_percent(part: float) -> str:
    """Write a part of a whole in percent, with three digits and never an exponent."""
    percent = float(f"{100.0 * part:.3g}")
    if 0.0 < percent < _LEAST_PERCENT:
        return f"< {_LEAST_PERCENT:.5f} %"
    if not (percent and math.isfinite(percent)):
        return f"{percent:g} %"
    decimals = max(2 - math.floor(math.log10(percent)), 0)
    return f"{percent:.{decimals}f} %"


def write_degrees(joint: float) -> str:
    """Write the position of a joint, rad, in degrees."""
    return f"{round(math.degrees(joint), _DECIMALS_OF_A_POSE) + 0.0:.4g}"


def measure_robot(
    path: Path,
    options: MeasureOptions,
    scene: Scene | None,
    assets: Path | None,
) -> RobotMeasurement:
    """Measure the loops of a robot's file in a guarded process."""
    file = read_robot(path, assets)
    with examine_guarded(file, MEASURE_SECONDS) as examined:
        measurement: RobotMeasurement = examined(MEASURE, file, options, scene)
    return measurement


def list_errors_by_method(loop: LoopMeasurement) -> list[InsideError]:
    """List the worst errors of torque and pin forces, by method.

    Rigid pins are compared with the formulas: the difference is what the scene leaves
    out. MuJoCo is compared with rigid pins at the same states: the difference is what
    its soft constraint costs.
    """
    errors = list(_compare(RIGID, loop, loop.states))
    errors += _compare(STATES, loop, loop.states)
    if loop.through_time is not None and len(loop.through_time.rows):
        errors += _compare(MEASURED_THROUGH_TIME, loop, loop.through_time)
    return errors


def find_left_out(loop: LoopMeasurement) -> float:
    """Return what the scene leaves out of the robot, relative.

    The part is the worst difference of rigid pins from the formulas.
    """
    return max(error.part for error in _compare(RIGID, loop, loop.states))


def _compare(
    method: str,
    loop: LoopMeasurement,
    answer: InsideAnswer,
) -> Iterator[InsideError]:
    """Compare an answer at its own theta_2, omega_2 and alpha_2, as its method says.

    Where dry friction reverses the forces on both sides of the jump are right, and
    nothing is judged. Neither are rigid pins where the formulas have no value.
    """
    rows = answer.rows
    commanded, formulas = _solve_formulas(loop, answer)
    judged = ~mark_reversing(loop.scene, formulas, _SLIP)
    errors = answer.errors()
    rigid = loop.collect(answer, "rigid")
    if method == RIGID:
        judged &= formulas.status_code == OK
        errors = measure_sizes(rigid[q] - getattr(formulas, q) for q in rigid)
    vanishing = loop.find_vanishing()
    columns = zip(rigid, errors.T, loop.scales.tolist(), strict=True)
    for quantity, sizes, scale in columns:
        worst = int(np.argmax(np.where(judged, sizes, -1.0)))
        error = median = math.inf
        if judged.any() and not answer.lost:
            error = float(sizes[worst])
            median = float(divide(np.median(sizes[judged]), scale))
        yield InsideError(
            method,
            quantity,
            error,
            scale,
            quantity in vanishing,
            rows[worst].joint,
            float(np.asarray(formulas.theta_2)[worst]),
            float(commanded.angle[worst]),
            median,
        )


def _solve_formulas(
    loop: LoopMeasurement, answer: InsideAnswer
) -> tuple[Command, Solution]:
    """Return the command of an answer's states, and what the formulas have there."""
    commanded = loop.command(replace(answer, open=[]))
    return commanded, solve(loop.scene, "force", at=commanded)


def list_without_value(loop: LoopMeasurement) -> dict[str, list[float]]:
    """List the positions of the driven joint without a value of the formulas, rad.

    The key of each list is the status of the formulas there.
    """
    _, formulas = _solve_formulas(loop, loop.states)
    places: dict[str, list[float]] = {}
    for row, code in zip(loop.states.rows, formulas.status_code, strict=True):
        if code != OK:
            places.setdefault(STATUS_NAMES[code], []).append(row.joint)
    return places


def find_worst_of_loop(loop: LoopMeasurement) -> float:
    """Return the worst error of torque and pin forces, over the scale of each."""
    if loop.through_time is not None and loop.through_time.lost:
        return math.inf
    return max(error.part for error in list_errors_by_method(loop))


def _read_span(text: str | None) -> tuple[float, float] | None:
    """Read the value of `range_option`, rad."""
    if text is None:
        return None
    ends = text.split(",")
    if len(ends) != 2:
        raise InputError("--range", text, "must be two angles, like -40deg,30deg")
    low, high = (require("--range", end.strip(), "rad") for end in ends)
    if low >= high:
        raise InputError("--range", text, "must begin below its end")
    return low, high


def read_measure_options(
    loop: str | None,
    wanted: float | None,
    robot: Mapping[str, Any],
) -> MeasureOptions:
    """Read --loop, --error, and the other options of a robot, keyed by their names.

    Raises
    ------
    InputError : an error that no simulation can have, or an entry that cannot be read.
    """
    if wanted is not None and not 0.0 < wanted < 1.0:
        raise InputError(
            "--error",
            wanted,
            "must be a relative error, above 0 and below 1",
        )
    return MeasureOptions(
        read_pose(robot),
        loop,
        read_number("--speed", robot["speed"], "rad/s"),
        read_number("--torque", robot.get("torque"), "N m"),
        wanted,
        _read_span(robot.get("span")),
    )
