"""`fourbar-validation check-mjcf`: loops of somebody's file in MuJoCo.

With a scene the loop whose lengths are nearest is judged against it; without one the
loops are measured. The file is somebody's: it is compiled and run in a process of its
own, with a limit on time and memory.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from fourbar.errors import InputError
from fourbar_validation.engines.mujoco.robots.loop_facts import BAR_ROLES, SITE_ROLES
from fourbar_validation.robots.files import read_robot
from fourbar_validation.robots.judge_loop import judge_file
from fourbar_validation.robots.judge_mimic import measure_mimic, show_mimic
from fourbar_validation.robots.loop_errors import (
    find_worst_of_loop,
    measure_robot,
    read_measure_options,
)
from fourbar_validation.robots.options import (
    ROBOT_PATH,
    loop_option,
    pose_options,
    range_option,
    read_pose,
    speed_option,
    torque_option,
)
from fourbar_validation.robots.report import (
    describe_judgement,
    describe_measurement,
    list_measured_rows,
    write_report,
)
from fourbar_validation.scenes.suites import read_scene_files

_BESIDE_MIMIC = ("files", "mimic", "pose", "assets")
"""Arguments that --mimic takes."""


def _read_role_names(pairs: tuple[str, ...]) -> dict[str, str]:
    """Read ROLE=NAME pairs of the command line."""
    allowed = (*BAR_ROLES, *SITE_ROLES)
    names = {}
    for pair in pairs:
        role, equals, name = pair.partition("=")
        if not equals or role not in allowed or not name:
            raise InputError(
                "--name",
                pair,
                f"must be ROLE=NAME, ROLE one of {', '.join(allowed)}",
            )
        names[role] = name
    return names


@click.command(name="check-mjcf")
@click.argument(
    "files",
    metavar="[SCENE] FILE.xml",
    nargs=-1,
    required=True,
    type=ROBOT_PATH,
)
@click.option(
    "--name",
    "names",
    metavar="ROLE=NAME",
    multiple=True,
    help=(
        "The body that is the input, coupler or output; B3, B4: the sites of pin B on"
        " the coupler and the output, where no connect or weld closes the loop. Left"
        " out: chosen by the lengths, and printed."
    ),
)
@loop_option
@pose_options
@speed_option
@range_option
@torque_option
@click.option(
    "--mimic",
    metavar="JOINT",
    help=(
        "Joint whose equality, a polynomial, stands for the loop of SCENE: what it"
        " loses. --pose theta_2=ANGLE states the input in the rest pose of the file;"
        " no other option but --assets goes with it."
    ),
)
@click.option(
    "--error",
    "wanted",
    type=float,
    metavar="E",
    help=(
        "The relative error that FILE.xml may have; without SCENE also: what to type to"
        " reach it."
    ),
)
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("results"),
    show_default=True,
    help=(
        "Folder for the report, robot.md, the errors, results.csv, and every state,"
        " states.csv."
    ),
)
def check_mjcf_command(
    files: tuple[Path, ...],
    names: tuple[str, ...],
    loop: str | None,
    mimic: str | None,
    wanted: float | None,
    out: Path,
    **robot: Any,
) -> int:
    """Measure the loops of a robot's file in MuJoCo, or judge one by a scene.

    With SCENE the loop whose lengths are nearest is judged at its motion: errors of
    torque and pin forces, what differs from the generated MJCF, and what each
    difference costs. Without SCENE every loop is measured inside the whole robot.
    """
    if len(files) > 2:
        raise click.UsageError("give one FILE.xml, and SCENE before it or not")
    if mimic is not None:
        _refuse_beside_mimic(click.get_current_context())
    theirs = files[-1]
    suite = read_scene_files(files[:-1]) if len(files) > 1 else None
    assets = robot.pop("assets")
    if mimic is not None:
        if suite is None:
            raise click.UsageError("--mimic needs the SCENE of the loop")
        angles = read_pose(robot).joints
        show_mimic(measure_mimic(theirs, mimic, suite.scene(0), assets, angles))
        return 0
    options = read_measure_options(loop, wanted, robot)
    if suite is None:
        if names:
            raise click.UsageError("--name needs a SCENE")
        measurement = measure_robot(theirs, options, None, assets)
        blocks = [*describe_measurement(measurement)]
        rows = list_measured_rows(measurement)
        write_report(theirs, out, blocks, rows, measurement.loops)
        worst = max(map(find_worst_of_loop, measurement.loops))
        return int(wanted is not None and not worst <= wanted)
    options = replace(options, names=_read_role_names(names))
    file = read_robot(theirs, assets)
    judgement = judge_file(suite.name(0), suite.scene(0), file, options)
    blocks = [*describe_judgement(judgement, _write_stated(robot))]
    write_report(theirs, out, blocks, judgement.rows, [judgement.measured])
    return judgement.counts.status


def _refuse_beside_mimic(context: click.Context) -> None:
    """Refuse the options that say something of a robot alone, or of its report."""
    for option in context.command.params:
        name = str(option.name)
        source = context.get_parameter_source(name)
        if source is ParameterSource.COMMANDLINE and name not in _BESIDE_MIMIC:
            raise click.UsageError(f"{option.opts[-1]} has no use beside --mimic")


def _write_stated(robot: Mapping[str, Any]) -> str:
    """Write the options that win over the scene, as they were typed."""
    named = {"range" if name == "span" else name: robot[name] for name in robot}
    return " ".join(
        f"--{name} {text}"
        for name, value in named.items()
        for text in (value if isinstance(value, tuple) else (value,))
        if text
    )
