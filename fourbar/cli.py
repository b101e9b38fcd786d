"""The command `fourbar`; what a command needs is imported when it is called."""

import io
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from fourbar import __version__
from fourbar.errors import InputError, NotAssembledError, printable, run

if TYPE_CHECKING:
    from fourbar.scene import Scene

MOST_POSITIONS = 1_000_000
"""Positions that `analyze` prints: about a gigabyte of text."""

scene_argument = click.argument("scene", type=click.Path(path_type=Path))
out_option = click.option("-o", "--out", type=click.Path(path_type=Path), required=True, metavar="FILE")


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="fourbar")
@click.option("--traceback", is_flag=True, help="Show where an internal error happened.")
def group(traceback: bool) -> None:
    """Closed formulas of the planar four-bar linkage: from a scene file to driving torque and pin forces.

    Exit status: 0 all well (also when some positions do not assemble), 2 the input is bad, 3 the
    environment or the program failed, 130 interrupted.
    """
    del traceback  # looked at where errors are told


@group.command()
@click.argument("lengths", nargs=4, metavar="D A B C")
def classify(lengths: tuple[str, ...]) -> None:
    """Name a linkage by its bar lengths (ground, input, coupler, output), and say what turns and how far.

    Bare numbers are metres; "30 cm" works too.
    """
    from fourbar.formulas.linkage_type import classify as type_of
    from fourbar.linkage import BAR_NAMES, Bar, FourBar
    from fourbar.show.words import told

    d, a, b, c = _lengths(lengths)
    linkage = FourBar(d, Bar(a), Bar(b), Bar(c))
    found = type_of(linkage)
    relation = "<" if found.surplus > 0.0 else ">" if found.surplus < 0.0 else "="
    outer = min(linkage.lengths) + max(linkage.lengths)
    turning = ", ".join(BAR_NAMES[number] for number in found.turning) or "none"
    click.echo(found.name)
    click.echo(f"s + l = {outer:.6g} m {relation} p + q = {sum(linkage.lengths) - outer:.6g} m")
    click.echo(f"bars that turn fully: {turning}")
    for line in told(linkage) if found.barker is not None else ():  # a structure does not move
        click.echo(line)


@group.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--lengths", nargs=4, required=True, metavar="D A B C", help="Ground, input, coupler, output.")
def new(file: Path, lengths: tuple[str, ...]) -> None:
    """Write a new scene file with the four lengths, the rest explained in comments.

    Bare numbers are metres; "30 cm" works too.
    """
    from fourbar.files.new import new_scene
    from fourbar.writing import write_text

    if file.exists():
        raise InputError("FILE", str(file), "is there already; a new scene needs a new name")
    write_text(file, new_scene(lengths))
    click.echo(f"wrote {file}; edit it, then: fourbar analyze {file}")


@group.command()
@scene_argument
@click.option("--json", "form", flag_value="json", help="One object, SI, every digit.")
@click.option("--csv", "form", flag_value="csv", help="One line per position, SI, every digit.")
@click.option("--degrees/--radians", default=None, help="Angles theta; left out: degrees in the table, else radians.")
@click.option("-o", "--out", type=click.Path(path_type=Path), metavar="FILE", help="Write there instead.")
def analyze(scene: Path, form: str | None, degrees: bool | None, out: Path | None) -> None:
    """Solve a scene: angles, speeds, accelerations, driving torque and pin forces."""
    from fourbar.solution import csv_text, json_text
    from fourbar.solve import last_stage, solve
    from fourbar.writing import write_text

    asked = _load(scene)
    with _named(scene), _waiting(asked):
        solution = solve(asked, last_stage(asked))
    if not solution.assembled.any():
        raise NotAssembledError(f"{scene}: motion.theta_2: the linkage assembles at none of the positions asked for")
    if form is None:
        text = _table_text(asked, solution, None if out else _terminal_width(), degrees is not False)
    else:
        write = json_text if form == "json" else csv_text
        text = write(solution, degrees=bool(degrees))
    if out is None:
        click.echo(text, nl=False)
    else:
        write_text(out, text)


@group.command()
@click.argument("scene", type=click.Path(path_type=Path), required=False)
@click.option("--lengths", nargs=4, metavar="D A B C", help="Ground, input, coupler, output (bare numbers: m).")
@click.option("--omega", metavar="W", help="Speed of the input with --lengths (a bare number: rad/s).")
@click.option(
    "--for",
    "simulator",
    type=click.Choice(["mujoco", "warp", "mjx", "genesis", "newton"]),
    default="mujoco",
    show_default=True,
    help="What loads it: settings that suit it, and where its numbers stand.",
)
@out_option
def mjcf(scene: Path | None, lengths: tuple[str, ...] | None, omega: str | None, simulator: str, out: Path) -> None:
    """Write a scene, or a linkage of uniform bars, as MJCF that runs on its own in MuJoCo and its kin."""
    from fourbar import mjcf as writer
    from fourbar.writing import write_text

    if (scene is None) == (lengths is None):
        raise click.UsageError("give a scene file or --lengths D A B C, one of the two")
    if scene is not None:
        if omega is not None:
            raise click.UsageError("--omega goes with --lengths; a scene states its own omega_2")
        with _named(scene):
            text = writer.mjcf_for(_load(scene), simulator)
        write_text(out, text)
        return
    assert lengths is not None
    speed = {} if omega is None else {"omega": _number("--omega", omega, "rad/s")}
    made = writer.scene_from_lengths(*_lengths(lengths), **speed)
    write_text(out, writer.mjcf_for(made, simulator))
    for line in writer.defaults_used(made):
        click.echo(line)


@group.command()
@scene_argument
@click.option("--for", "reader", type=click.Choice(["gazebo", "drake"]), default="gazebo", show_default=True)
@out_option
def sdf(scene: Path, reader: str, out: Path) -> None:
    """Write a scene as SDF, the loop closed by a fourth joint (Gazebo) or a ball constraint (Drake)."""
    from fourbar.mjcf.sdf import sdf as written
    from fourbar.writing import write_text

    with _named(scene):
        text = written(_load(scene), reader)
    write_text(out, text)


@group.command()
@scene_argument
@out_option
@click.option(
    "--figure",
    default="overview",
    show_default=True,
    metavar="NAME",
    help="overview, linkage, coupler, kinematics, torque, forces, hodograph, energy, transmission or freebody.",
)
@click.option("--position", metavar="ANGLE", help='theta_2 of the linkage and free bodies, like "135 deg".')
@click.option("--branches", default="one", show_default=True, metavar="WHICH", help="one or both.")
def plot(scene: Path, out: Path, figure: str, position: str | None, branches: str) -> None:
    """Draw a scene as SVG, PNG or PDF (by the ending of FILE)."""
    from fourbar.show.plot import draw

    at = None if position is None else _number("--position", position, "rad")
    asked = _load(scene)
    with _named(scene), _waiting(asked):
        draw(asked, out, figure, position=at, branches=branches)


@group.command()
@scene_argument
@out_option
@click.option(
    "--picture",
    "pictures",
    multiple=True,
    metavar="BAR=FILE",
    help="A PNG or JPEG laid along input, coupler or output (pages).",
)
@click.option(
    "--seconds",
    type=click.FloatRange(min=0.1, max=60.0),
    help="Length of a film; left out: 6, of a motion through time its own.",
)
def animate(scene: Path, out: Path, pictures: tuple[str, ...], seconds: float | None) -> None:
    """Show a scene moving: one web page (.html), or a film (.gif, .mp4)."""
    from fourbar.show.animate import write

    attached = {}
    for entry in pictures:
        bar, equals, file = entry.partition("=")
        if not equals:
            raise InputError("--picture", entry, "must be like coupler=FILE")
        attached[bar] = file
    asked = _load(scene)
    with _named(scene), _waiting(asked):
        write(asked, out, pictures=attached, seconds=seconds)


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """Mistakes of a scene that show only when it is solved name its file too."""
    try:
        yield
    except InputError as error:
        if error.file is None and error.key.startswith(("motion", "lengths", "bars", "drive", "loads", "effects")):
            raise error.in_file(str(path)) from None
        raise


@contextmanager
def _waiting(scene: "Scene") -> Iterator[None]:
    """A long free motion takes minutes: a terminal shows that it is under way."""
    if scene.motion.free is None:
        yield
        return
    from fourbar.free_motion import STEPS
    from fourbar.show.under_way import under_way

    with under_way(f"the free motion is integrated, in {STEPS} steps at most"):
        yield


def _load(path: Path) -> "Scene":
    from fourbar.files import load
    from fourbar.scene.motion import Free, Sweep

    scene = load(path)
    for key, asked in (("motion.theta_2", scene.motion.theta_2), ("motion.free", scene.motion.free)):
        if isinstance(asked, (Sweep, Free)) and asked.steps >= MOST_POSITIONS:
            raise InputError(f"{key}.steps", asked.steps, f"must be below {MOST_POSITIONS} here", str(path))
    return scene


def _lengths(texts: tuple[str, ...]) -> list[float]:
    names = ("ground", "input", "coupler", "output")
    return [_number(f"length of {name}", text, "m", positive=True) for name, text in zip(names, texts, strict=True)]


def _number(key: str, text: str, unit: str, *, positive: bool = False) -> float:
    """A number of the command line: bare in SI, or with a unit."""
    from fourbar.linkage import require

    try:
        return require(key, float(text), positive=positive)
    except ValueError:
        from fourbar.files.units import UnitError, to_si

        try:
            return require(key, to_si(text, unit), positive=positive)
        except UnitError as error:
            raise InputError(key, text, f"{error}; must be a number in {unit}, or one with a unit") from None


def _terminal_width() -> int | None:
    """Columns of the terminal; None where the output goes elsewhere."""
    if not sys.stdout.isatty():
        return None
    import shutil

    return shutil.get_terminal_size().columns


def _table_text(scene: "Scene", solution: Any, width: int | None, degrees: bool) -> str:
    from rich.console import Console
    from rich.text import Text

    from fourbar.show import tables

    shown, left_out = tables.table(solution, width, degrees=degrees)
    text = io.StringIO()
    console = Console(file=text, width=width or 10_000, color_system=None)
    if scene.title:
        console.print(Text(printable(scene.title)))
    for line in tables.heading(scene, solution):
        console.print(Text(line))
    console.print(shown)
    if left_out:
        console.print(Text(f"not shown: {', '.join(left_out)} (a wider terminal, --csv or --json has them)"))
    return "\n".join(line.rstrip() for line in text.getvalue().split("\n"))


def main(arguments: list[str] | None = None) -> None:
    """Run a command and leave with its exit status."""
    sys.exit(status(arguments))


def status(arguments: list[str] | None = None) -> int:
    """Run a command; what goes wrong becomes one line on standard error and an exit status."""
    return run(group, "fourbar", arguments)
