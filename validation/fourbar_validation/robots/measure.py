"""Torque and pin forces of a robot's loops against the formulas, and what to type: `check-mjcf` and `advise`."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click
import numpy as np

from fourbar.errors import InputError
from fourbar.linkage import require
from fourbar.quantities import OK, UNITS
from fourbar.scene import Command, Scene
from fourbar.solve import solve
from fourbar_validation.compare.answer import Array
from fourbar_validation.compare.reversals import mark_reversing
from fourbar_validation.compare.rows import make_plain
from fourbar_validation.engines.mujoco.robots.answers import (
    QUANTITIES,
    InsideAnswer,
    LoopMeasurement,
    MeasureOptions,
    RobotMeasurement,
    SettingsAdvice,
    TriedSettings,
    measure_sizes,
)
from fourbar_validation.report.terminal import make_table
from fourbar_validation.robots.files import read_robot
from fourbar_validation.robots.guard import examine_guarded
from fourbar_validation.robots.options import read_pose, read_speed

MEASURE = "fourbar_validation.engines.mujoco.robots.measure:measure_loops"
LIMIT = 600.0
"""s; a busy machine takes several times the two minutes of an idle one."""
HEADINGS = ("method", "quantity", "error", "of its largest", "at")
SETTING_HEADINGS = ("changed alone", "single states", "through time", "cost")
STATES, THROUGH_TIME = "single states", "through time"
SLIP = 1e-9
"""Part of the speeds below which a pin with dry friction is at rest, so that it may rub either way."""


@dataclass(frozen=True, slots=True)
class InsideError:
    """Worst error of one quantity of a loop by one method."""

    method: str
    quantity: str
    error: float
    """N m or N."""
    largest: float
    """Largest size of the quantity by the formulas, N m or N."""
    joint: float
    """Position of the driven joint where the error is largest, rad."""

    @property
    def part(self) -> float:
        """The error over the largest size; infinite without an answer."""
        if not math.isfinite(self.error):
            return math.inf
        return self.error / self.largest if self.largest else 0.0

    def cells(self) -> tuple[str, ...]:
        """Return the cells of a row under HEADINGS."""
        unit = UNITS[self.quantity]
        return (
            self.method,
            self.quantity,
            f"{self.error:.3g} {unit}",
            f"{100.0 * self.part:.3g} %",
            f"{math.degrees(self.joint):.4g} deg",
        )


def measure_robot(
    path: Path, options: MeasureOptions, scene: Scene | None, assets: Path | None
) -> RobotMeasurement:
    """Measure the loops of a robot's file in a guarded process."""
    file = read_robot(path, assets)
    with examine_guarded(path, LIMIT) as examined:
        measurement: RobotMeasurement = examined(MEASURE, file, options, scene)
    return measurement


def list_errors(loop: LoopMeasurement) -> list[InsideError]:
    """List the worst errors of torque and pin forces against the formulas, by method."""
    errors = list(_compare(STATES, loop, loop.states))
    if loop.through_time is not None:
        errors += _compare(THROUGH_TIME, loop, loop.through_time)
    return errors


def find_left_out(loop: LoopMeasurement) -> float:
    """Return what the scene leaves out of the robot: the worst difference of rigid pins from the formulas, relative."""
    rigid = [replace(row, soft=row.rigid) for row in loop.states.rows]
    answer = replace(loop.states, rows=rigid)
    return max(error.part for error in _compare(STATES, loop, answer))


def _compare(
    method: str, loop: LoopMeasurement, answer: InsideAnswer
) -> Iterator[InsideError]:
    """Compare an answer with the formulas at its own theta_2, omega_2 and alpha_2.

    Where dry friction reverses the forces on both sides of the jump are right, and nothing is judged.
    """
    rows = answer.rows
    motion = loop.scene.motion
    commanded = Command(
        np.array([row.theta_2 for row in rows]) - loop.turned,
        np.full(len(rows), motion.branch, dtype=np.int8),
        np.array([row.omega_2 for row in rows]),
        np.array([row.alpha_2 for row in rows]),
    )
    formulas = solve(loop.scene, "force", at=commanded)
    judged = formulas.status_code == OK
    reversing = mark_reversing(loop.scene, formulas, SLIP)
    for name in QUANTITIES:
        ours = np.asarray(getattr(formulas, name))
        theirs = np.array([row.soft.values()[name] for row in rows])
        if theirs.ndim == 2:
            theirs = _turn(theirs, -loop.turned)
        sizes = measure_sizes(theirs - ours)
        sizes = np.where(judged & np.isfinite(sizes), sizes, math.inf)
        sizes = np.where(judged & reversing, 0.0, sizes)
        worst = int(np.argmax(sizes))
        largest = float(np.max(measure_sizes(ours)[judged], initial=0.0))
        error = math.inf if answer.lost else float(sizes[worst])
        yield InsideError(method, name, error, largest, rows[worst].joint)


def _turn(vectors: Array, angle: float) -> Array:
    """Turn vectors (n, 2) counter-clockwise."""
    cos, sin = math.cos(angle), math.sin(angle)
    return np.asarray(vectors @ np.array([[cos, sin], [-sin, cos]]))


def find_worst(loop: LoopMeasurement) -> float:
    """Return the worst error of torque and pin forces, over the largest of each."""
    return max(error.part for error in list_errors(loop))


def show_measurement(measurement: RobotMeasurement) -> None:
    """Print the loops of a robot, the worst first."""
    for loop in sorted(measurement.loops, key=find_worst, reverse=True):
        _show_loop(loop)
        if loop.advice is not None:
            show_advice(loop.advice)
    for note in measurement.notes:
        _say(f"note: {note}")


def _show_loop(loop: LoopMeasurement) -> None:
    from rich.console import Console

    joints = [math.degrees(row.joint) for row in loop.states.rows]
    speed = loop.states.rows[0].omega_2
    _say(
        f"{loop.name}: {loop.joint} from {min(joints):.4g} to {max(joints):.4g} deg at {speed:.4g} rad/s, "
        "MuJoCo in the whole robot against the formulas"
    )
    _say(
        f"{loop.held} other degrees of freedom are held: at single states by generalized forces, "
        f"through time by armature (a tenth of it changes {loop.influence:.1e}); "
        "contacts, joint limits and motors are off"
    )
    if loop.switched_off:
        names = ", ".join(loop.switched_off)
        _say(f"switched off, because it ties its bars to joints that are held: {names}")
    left_out = find_left_out(loop)
    _say(
        f"with rigid pins the robot differs from the formulas by {left_out:.1e} of the "
        "largest: what the scene leaves out; the rest is MuJoCo's soft constraint"
    )
    rows = [error.cells() for error in list_errors(loop)]
    Console().print(make_table(HEADINGS, rows, show_edge=False))
    if loop.through_time is None:
        _say(f"not simulated: {loop.refusal}")
    elif loop.through_time.lost:
        _say(f"through time: {loop.through_time.lost}")
    else:
        worst = max(loop.through_time.rows, key=lambda row: row.gap)
        _say(
            f"gap through time: {1e3 * worst.gap:.3g} mm at {loop.joint} = "
            f"{math.degrees(worst.joint):.4g} deg; a step takes "
            f"{1e6 * loop.through_time.seconds_per_step:.3g} us"
        )
    sticking = {name for row in loop.states.rows for name in row.sticking}
    for name in sorted(sticking):
        count = sum(name in row.sticking for row in loop.states.rows)
        _say(
            f"note: {loop.name}: at {count} of {len(loop.states.rows)} states the dry "
            f"friction of {name} is less than its couple: it turns too slowly there for "
            "MuJoCo's soft friction (solreffriction and solimpfriction of the joint)"
        )
    _show_torn(loop)
    for remark in loop.remarks:
        _say(f"note: {loop.name}: {remark}")


def _show_torn(loop: LoopMeasurement) -> None:
    """Print the state of the largest gap under a motor's torque."""
    if not loop.torn:
        return
    worst = max(loop.torn, key=lambda state: state.gap)
    if not math.isfinite(worst.gap):
        _say("under the torque the loop comes apart: MuJoCo lost the motion")
        return
    forces = ", ".join(
        f"{name} {math.hypot(*force):.4g} N" for name, force in worst.forces.items()
    )
    _say(
        f"under the torque: gap at most {1e3 * worst.gap:.3g} mm, at {loop.joint} = "
        f"{math.degrees(worst.joint):.4g} deg with {forces}"
    )


def show_advice(advice: SettingsAdvice) -> None:
    """Print what each setting does alone, and what to type."""
    from rich.console import Console

    table = make_table(
        SETTING_HEADINGS,
        [_write_tried(one) for one in (advice.before, *advice.alone)],
        show_edge=False,
    )
    Console().print(table)
    before, best = advice.before, advice.best
    if not best.changes:
        _say(f"The file is within {advice.wanted:g} as it is.")
        return
    change = (
        f"error {before.error:.2g} -> {best.error:.2g}, gap {1e3 * before.gap:.2g} -> "
        f"{1e3 * best.gap:.2g} mm, {1e6 * before.seconds_per_step:.3g} -> "
        f"{1e6 * best.seconds_per_step:.3g} us a step"
    )
    if advice.reached:
        _say(f"Type this for an error within {advice.wanted:g} ({change}):")
    else:
        _say(
            f"None of {advice.tried} combinations was within {advice.wanted:g}; "
            f"the best ({change}):"
        )
    for element in advice.typed:
        click.echo(element)


def _write_tried(tried: TriedSettings) -> tuple[str, ...]:
    changes = " ".join(f'{name}="{value}"' for name, value in tried.changes.items())
    return (
        changes or "nothing",
        f"{tried.states:.2g}",
        f"{tried.through_time:.2g}",
        f"{1e3 * tried.cost:.3g} ms/s",
    )


def _say(text: str) -> None:
    click.echo(make_plain(text))


def read_torque(text: str | None) -> float | None:
    """Read the value of `torque_option`, N m."""
    if text is None:
        return None
    try:
        return require("--torque", float(text))
    except ValueError:
        return require("--torque", text, "N m")


def read_measure_options(
    loop: str | None, wanted: float | None, robot: Mapping[str, Any]
) -> MeasureOptions:
    """Read --loop, --error, and the values of the other options of a robot by their names.

    Raises
    ------
    InputError : an error that no simulation can have, or an entry that cannot be read.
    """
    if wanted is not None and not 0.0 < wanted < 1.0:
        raise InputError(
            "--error", wanted, "must be a relative error, above 0 and below 1"
        )
    return MeasureOptions(
        read_pose(robot["pose"], robot["key"], robot["hold"], robot["drive"]),
        loop,
        read_speed(robot["speed"]),
        read_torque(robot.get("torque")),
        wanted,
    )
