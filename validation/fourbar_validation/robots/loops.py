"""`fourbar-validation loops`: print the closed loops of a robot's file.

`engines/mujoco/robots/closures.py` finds them, `loop_scene.py` makes a scene of one.
"""

from pathlib import Path
from textwrap import wrap
from typing import Any

import click

from fourbar.files import dump
from fourbar.writing import require_file, write_text
from fourbar_validation.compare.rows import escape_controls
from fourbar_validation.engines.mujoco.robots.loop_facts import (
    LoopScene,
    RobotReport,
)
from fourbar_validation.report.sentences import print_sentence
from fourbar_validation.robots.files import read_robot
from fourbar_validation.robots.guard import examine_guarded
from fourbar_validation.robots.options import (
    ROBOT_PATH,
    loop_option,
    pose_options,
    read_number,
    read_pose,
    speed_option,
)

_COLUMNS_OF_A_COMMENT = 78
"""Columns of a comment in a scene: a file's reader takes no line of a hundred dots."""
SCENE = "fourbar_validation.engines.mujoco.robots.loop_scene:read_loop_scene"
_LIST = "fourbar_validation.engines.mujoco.robots.closures:list_closures"


def _show_report(report: RobotReport) -> None:
    """Print a line for each closure, and what was done to the file and its pose."""
    for closure in report.closures:
        print_sentence(closure.text)
    if not report.closures:
        print_sentence(
            "No loop is closed in the file: a <connect> between two sites closes one, "
            "in an SDF a further joint or <drake:ball_constraint>, in a URDF a "
            "<loop_joint>."
        )
    for closure in report.closures:
        loop = closure.loop
        for remark in () if loop is None else (*loop.chosen, *loop.remarks):
            print_sentence(f"note: {closure.name}: {remark}")
    for note in report.notes:
        print_sentence(f"note: {note}")


def _write_scene(made: LoopScene) -> str:
    """Return the scene file of a loop.

    Comments say where it is from and what it leaves out.
    """
    lines = [
        part
        for line in (*made.parts, *made.remarks, *made.notes)
        for part in wrap(
            escape_controls(line), _COLUMNS_OF_A_COMMENT, break_long_words=False
        )
    ]
    comments = "".join(f"# {line}\n" for line in lines)
    return f"{comments}\n{dump(made.scene)}"


@click.command()
@click.argument("robot", metavar="FILE", type=ROBOT_PATH)
@pose_options
@loop_option
@speed_option
@click.option(
    "-o",
    "--out",
    type=ROBOT_PATH,
    metavar="SCENE.toml",
    help="Write the loop as a scene: what it carries, its range, and what acts on it.",
)
def loops_command(
    robot: Path,
    assets: Path | None,
    loop: str | None,
    speed: str | None,
    out: Path | None,
    **pose: Any,
) -> None:
    """List the closed loops of a robot's MJCF, SDF or URDF.

    The command says which loops are planar four-bars.
    """
    options = read_pose(pose)
    omega = read_number("--speed", speed, "rad/s")
    if out is None and speed is not None:
        raise click.UsageError("--speed goes with -o: it is that of the scene")
    if out is not None:
        require_file(out, robot)
    file = read_robot(robot, assets)
    with examine_guarded(file) as examined:
        if out is not None:
            made: LoopScene = examined(SCENE, file, options, loop, omega)
        else:
            report: RobotReport = examined(_LIST, file, options, loop)
    if out is None:
        _show_report(report)
        return
    write_text(out, _write_scene(made))
    for line in [*made.parts, *made.remarks, *made.notes]:
        print_sentence(line)
    click.echo(escape_controls(f"written to {out}"))
