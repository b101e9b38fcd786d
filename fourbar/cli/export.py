"""The commands that write files: pictures, models for simulators; and the workbench."""

import re
from collections.abc import Callable
from functools import wraps
from itertools import chain, count
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from fourbar.cli import given
from fourbar.errors import (
    ELSEWHERE,
    DependencyError,
    InputError,
    say_install,
    state_messages_in,
)
from fourbar.scene import Scene
from fourbar.show.shown_units import units_of_length
from fourbar.solution import Conversion
from fourbar.writing import STANDARD_STREAM, require_file

if TYPE_CHECKING:
    from fourbar.mjcf.document import Drive
    from fourbar.mjcf.plane import Plane


def _plane_options(command: Callable[..., str]) -> Callable[..., str]:
    """Add --axis and --origin, given to the command as `plane`."""

    @click.option(
        "--axis",
        default="0 0 1",
        show_default=True,
        metavar='"X Y Z"',
        help=(
            "Direction of the pins' axes in the world, to which z is turned the"
            ' shortest way. "0 -1 0" sets the plane upright: its x stays, its y is z.'
        ),
    )
    @click.option(
        "--origin",
        default="0 0 0",
        show_default=True,
        metavar='"X Y Z"',
        help="Place of pin O2 (of a drawing's origin) in the world, m or with units.",
    )
    @wraps(command)
    def placed(scene: Scene, axis: str, origin: str, **others: Any) -> str:
        from fourbar.mjcf.plane import Plane

        direction = given.read_three("--axis", axis, "1")
        plane = Plane(direction, given.read_three("--origin", origin))
        return command(scene, plane=plane, **others)

    return placed


def _export_command(command: Callable[..., str]) -> Callable[..., None]:
    """Add SCENE, --lengths and --omega; what the command makes of a scene is written.

    One of the first two is given. The defaults of a scene of lengths are told at the
    end.
    """

    @click.argument("scene", type=given.FILE_PATH, required=False)
    @click.option(
        "--lengths",
        nargs=4,
        metavar="D A B C",
        help="Lengths of ground, input, coupler, output, m.",
    )
    @click.option(
        "--omega",
        metavar="W",
        help="Speed of the input with --lengths, rad/s.",
    )
    @wraps(command)
    def written(
        scene: Path | None,
        lengths: tuple[str, ...] | None,
        omega: str | None,
        out: Path,
        **options: Any,
    ) -> None:
        # the name of a scene that is a fifth length
        if lengths is not None and re.fullmatch(r"[\d.]+\w*", str(scene)):
            raise click.UsageError(f"--lengths are four: {ELSEWHERE}")
        if (scene is None) == (lengths is None):
            raise click.UsageError(
                "give a scene file or --lengths D A B C, one of the two"
            )
        if scene is not None and omega is not None:
            raise click.UsageError(
                "--omega goes with --lengths; a scene states its own omega_2"
            )
        if scene is not None:
            with given.open_scene(scene) as described:
                given.print_to(command(described, **options), out)
            return
        from fourbar.mjcf import list_defaults, make_scene

        assert lengths is not None
        speed = {}
        if omega is not None:
            speed["omega"] = given.read_number("--omega", omega, "rad/s")
        with state_messages_in(units_of_length(lengths[0])):
            made = make_scene(*given.read_lengths(lengths), **speed)
        given.print_to(command(made, **options), out)
        for line in list_defaults(made):
            click.echo(line, err=out == STANDARD_STREAM)

    return written


_without_loads_option = click.option(
    "--without-loads",
    is_flag=True,
    help="Leave the loads to your program; the file format has none.",
)


@click.command()
@given.scene_argument
@given.out_option
@click.option(
    "--figure",
    default="overview",
    show_default=True,
    metavar="NAME",
    help=(
        "Figure: overview, linkage, coupler, kinematics, points, torque, forces,"
        " energy, transmission, shaking, ratios, centres, freebody, bars or stroke."
    ),
)
@click.option(
    "--at",
    metavar="POSITION",
    help='Position of linkage and free bodies, like "135 deg" or "theta_4=30 deg".',
)
@click.option(
    "--dimensions",
    is_flag=True,
    help="Write the lengths of the bars at them.",
)
@given.units_option()
def plot(
    scene: Path,
    out: Path,
    figure: str,
    at: str | None,
    dimensions: bool,
    units: Conversion | None,
) -> None:
    """Draw a scene as SVG, PNG or PDF."""
    from fourbar.show.plot import draw

    with given.open_scene(scene) as described, given.show_waiting(described):
        place = None
        if at is not None:  # of a motion over time it is the angle at that time
            place = float(given.read_positions(described, at).stated[0][0])
        draw(
            described,
            out,
            figure,
            position=place,
            units=given.suit_file_units() if units is None else units,
            dimensions=dimensions,
        )
    _say_written(out)


def _say_written(out: Path, frames: int = 0) -> None:
    if out != STANDARD_STREAM:
        click.echo(f"wrote {out}" + (f": {frames} frames" if frames else ""))


@click.command()
@given.scene_argument
@given.out_option
@click.option(
    "--picture",
    "pictures",
    multiple=True,
    metavar="BAR=FILE",
    help="Picture (PNG, JPEG) laid along input, coupler or output of a page.",
)
@click.option(
    "--seconds",
    type=click.FloatRange(min=0.1, max=60.0),
    help="Duration of a film (default: 6, or that of the motion).",
)
@click.option(
    "--vectors",
    is_flag=True,
    help="Draw velocity and acceleration at the points.",
)
@given.units_option()
def animate(
    scene: Path,
    out: Path,
    pictures: tuple[str, ...],
    seconds: float | None,
    vectors: bool,
    units: Conversion | None,
) -> None:
    """Animate a scene as a web page (.html) or a film (.gif, .mp4)."""
    from fourbar.show.animate import write_animation

    attached = {}
    for entry in pictures:
        bar, equals, file = entry.partition("=")
        if not equals:
            raise InputError("--picture", entry, "must be like coupler=FILE")
        attached[bar] = file
    with given.open_scene(scene) as described, given.show_waiting(described):
        frames = write_animation(
            described,
            out,
            pictures=attached,
            seconds=seconds,
            units=given.suit_file_units() if units is None else units,
            vectors=vectors,
        )
    _say_written(out, frames)


@click.command(cls=given.LengthsCommand)
@_export_command
@click.option(
    "--for",
    "simulator",
    type=click.Choice(["mujoco", "warp", "mjx", "genesis", "newton"]),
    default="mujoco",
    show_default=True,
    help="Simulator that will load the file.",
)
@click.option(
    "--drive",
    type=click.Choice(["flywheel", "motor", "none"]),
    default="flywheel",
    show_default=True,
    help=(
        "What drives it: a flywheel keeps omega_2; a motor takes the couple or force of"
        " your controller."
    ),
)
@_plane_options
@given.text_option(".xml", ".mjcf", required=True)
def mjcf(scene: Scene, simulator: str, drive: "Drive", plane: "Plane") -> str:
    """Write a scene, or four lengths, as MJCF for MuJoCo and its kin."""
    from fourbar import mjcf as writer

    return writer.write_mjcf_for(scene, simulator, drive, plane)


@click.command("sdf", cls=given.LengthsCommand)
@_export_command
@click.option(
    "--for",
    "reader",
    type=click.Choice(["gazebo", "drake"]),
    default="gazebo",
    show_default=True,
    help="Simulator that will load the file.",
)
@_without_loads_option
@_plane_options
@given.text_option(".sdf", ".world", ".xml", required=True)
def sdf_command(scene: Scene, reader: str, without_loads: bool, plane: "Plane") -> str:
    """Write a scene, or four lengths, as SDF for Gazebo or Drake."""
    from fourbar.mjcf.assembly import write_sdf as written

    return written(scene, reader, without_loads=without_loads, plane=plane)


@click.command("usd", cls=given.LengthsCommand)
@_export_command
@_without_loads_option
@_plane_options
@given.text_option(".usda", ".usd", required=True)
def usd_command(scene: Scene, without_loads: bool, plane: "Plane") -> str:
    """Write a scene, or four lengths, as USD text (.usda) for Newton."""
    from fourbar.mjcf.assembly import write_usd as written

    return written(scene, without_loads=without_loads, plane=plane)


@click.command("edit")
@click.argument("scene", type=given.FILE_PATH, required=False)
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=0,
    help="Port of this machine (default: any free one).",
)
@click.option(
    "--exports",
    type=given.FILE_PATH,
    metavar="FOLDER",
    help="Folder of exports and reports (default: SCENE_exports).",
)
@click.option(
    "--no-browser",
    is_flag=True,
    help="Print the address and open no browser.",
)
def edit_command(
    scene: Path | None,
    port: int,
    exports: Path | None,
    no_browser: bool,
) -> None:
    """Edit a scene, or a new one, in the browser; torque and forces follow each change.

    Ctrl-C ends it, and so does a minute and a half without a page.
    """
    if scene is None:
        names = (Path(f"linkage{number}.toml") for number in chain([""], count(2)))
        scene = next(path for path in names if not path.exists())
    require_file(scene)
    try:
        from fourbar.edit.server import edit as opened_there
    except ModuleNotFoundError as error:
        raise DependencyError(
            f"{error.name} is not installed: {say_install('edit')}"
        ) from None
    opened_there(
        scene,
        exports or scene.with_name(f"{scene.stem}_exports"),
        port,
        browse=not no_browser,
    )
