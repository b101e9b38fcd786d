"""The command `fourbar`; what a command needs is imported when it is called."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

from fourbar import __version__
from fourbar.errors import InputError, NotAssembledError, run

if TYPE_CHECKING:
    from fourbar.scene import Scene

MOST_POSITIONS = 1_000_000
"""Positions that `analyze` prints: about a gigabyte of text."""

scene_argument = click.argument("scene", type=click.Path(path_type=Path))
out_option = click.option("-o", "--out", type=click.Path(path_type=Path), required=True, metavar="FILE")
or_out_option = click.option(
    "-o", "--out", type=click.Path(path_type=Path), metavar="FILE", help="Write there instead."
)


units_option = click.option(
    "--units", default="SI", metavar="UNITS", help='"imperial", or a list like "mm N.mm deg"; left out: SI.'
)


@click.group(
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="Begin with: fourbar new first.toml --lengths 300mm 100mm 250mm 220mm",
)
@click.version_option(__version__, "-V", "--version", prog_name="fourbar")
@click.option("--traceback", is_flag=True, help="Show where an internal error happened.")
@click.pass_context
def group(context: click.Context, traceback: bool) -> None:
    """Closed formulas of the planar four-bar linkage: from a scene file to driving torque and pin forces.

    The checks against MuJoCo and Pinocchio are no part of the installed package: in a checkout, python -m validation.

    Exit status: 0 all well (also when some positions do not assemble), 2 the input is bad, 3 the
    environment or the program failed, 130 interrupted.
    """
    del traceback  # looked at where errors are reported
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


@group.command()
@click.argument("lengths", nargs=4, metavar="D A B C")
@click.option("--json", "as_json", is_flag=True, help="One object, SI and radians, every digit.")
@or_out_option
def classify(lengths: tuple[str, ...], as_json: bool, out: Path | None) -> None:
    """Name a linkage by its bar lengths (ground, input, coupler, output), and say what turns and how far.

    Bare numbers are metres; "30 cm" works too.
    """
    from fourbar.linkage import Bar, FourBar
    from fourbar.show.words import type_json, type_lines

    d, a, b, c = _lengths(lengths)
    linkage = FourBar(d, Bar(a), Bar(b), Bar(c))
    _print((type_json(linkage) if as_json else "\n".join(type_lines(linkage))) + "\n", out)


@group.command()
@click.argument("file", type=click.Path(path_type=Path), required=False)
@click.option("-o", "--out", type=click.Path(path_type=Path), metavar="FILE", help="The same, as an option.")
@click.option("--lengths", nargs=4, required=True, metavar="D A B C", help="Ground, input, coupler, output.")
def new(file: Path | None, out: Path | None, lengths: tuple[str, ...]) -> None:
    """Write a new scene file with the four lengths, the rest explained in comments.

    Bare numbers are metres; "30 cm" works too.
    """
    from fourbar.files.new import new_scene
    from fourbar.writing import write_text

    if (file is None) == (out is None):
        raise click.UsageError("name the new file once: FILE, or -o FILE")
    file = file or out
    assert file is not None
    if file.exists():
        raise InputError("FILE", str(file), "is there already; a new scene needs a new name")
    write_text(file, new_scene(lengths))
    click.echo(f"wrote {file}; edit it, then: fourbar analyze {file}")


@group.command()
@scene_argument
@click.option("--json", "as_json", is_flag=True, help="One object, SI, every digit.")
@click.option("--csv", "as_csv", is_flag=True, help="One line per position, SI, every digit.")
@click.option("--degrees/--radians", default=None, help="Angles theta; left out: degrees in the table, else radians.")
@units_option
@click.option("--sensitivity", is_flag=True, help="What the quantities depend on: d(quantity)/d(number).")
@click.option("--every", type=click.IntRange(min=1), metavar="N", help="Show every N-th position in the table.")
@click.option("--all", "every", flag_value=1, help="Show every position; a terminal gets some forty at most.")
@or_out_option
def analyze(
    scene: Path,
    as_json: bool,
    as_csv: bool,
    degrees: bool | None,
    units: str,
    sensitivity: bool,
    every: int | None,
    out: Path | None,
) -> None:
    """Solve a scene: angles, speeds, accelerations, driving torque and pin forces."""
    if sensitivity:
        if as_csv or degrees or every is not None or units != "SI":
            raise click.UsageError("--sensitivity is a table, or with --json all of it, SI and rad")
        _sensitivity(scene, as_json, out)
        return
    from fourbar.show.motor import motor_entry
    from fourbar.show.tables import printed
    from fourbar.show.units import units as units_of
    from fourbar.solution import DEGREES, csv_text, json_text
    from fourbar.solve import last_stage, solve

    if as_json and as_csv:
        raise click.UsageError("--json and --csv are two forms of the output; give one of them")
    if every is not None and (as_json or as_csv):
        raise click.UsageError("--every and --all are of the table; --json and --csv hold every position")
    shown = dict(units_of(units))
    if degrees or (degrees is None and "rad" not in shown and not (as_json or as_csv)):
        shown |= DEGREES
    elif degrees is False:
        shown.pop("rad", None)
    described = _load(scene)
    with _named(scene), _waiting(described):
        solution = solve(described, last_stage(described))
    if not solution.assembled.any():
        raise NotAssembledError(f"{scene}: motion.theta_2: the linkage assembles at none of the positions requested")
    if as_json:
        text = json_text(solution, shown, motor=motor_entry(solution, shown))
    elif as_csv:
        text = csv_text(solution, shown)
    else:
        width = None if out else _terminal_width()
        text = printed(described, solution, width, shown, every=every)
    _print(text, out)


def _sensitivity(scene: Path, as_json: bool, out: Path | None) -> None:
    from fourbar.show import influence
    from fourbar.show.tables import under_heading
    from fourbar.studies.derivatives import sensitivity
    from fourbar.studies.influence import json_text

    stated = _load(scene)
    with _named(scene):
        found = sensitivity(stated)
    if not found.solution.assembled.any():
        raise NotAssembledError(f"{scene}: motion.theta_2: the linkage assembles at none of the positions")
    if as_json:
        text = json_text(found)
    else:
        text = under_heading(stated.title, influence.heading(found), influence.table(found))
    _print(text, out)


@group.command()
@scene_argument
@click.option("--samples", type=int, metavar="N", help="Linkages that are tried; left out: 8192.")
@click.option("--seed", type=int, default=0, show_default=True, metavar="S", help="Of the quasi-random samples.")
@click.option("--json", "as_json", is_flag=True, help="One object, SI, every digit.")
@click.option("-o", "--out", type=click.Path(path_type=Path), metavar="PLOT", help="Draw the bands: svg, png or pdf.")
def tolerance(scene: Path, samples: int | None, seed: int, as_json: bool, out: Path | None) -> None:
    """What the [tolerances] of a scene do to torque, pin forces and points, and which dimension does it."""
    from fourbar.show import tolerances as shown
    from fourbar.show.plot import draw_tolerances, format_of
    from fourbar.show.progress import share_done
    from fourbar.show.tables import under_heading
    from fourbar.studies.spread import SAMPLES, tolerances

    if out is not None:
        format_of(out)
    stated = _load(scene)
    with _named(scene), share_done("samples are solved") as progress:
        found = tolerances(stated, SAMPLES if samples is None else samples, seed, progress=progress)
    if (found.without == found.samples).all():
        raise NotAssembledError(f"{scene}: motion.theta_2: the linkage assembles at none of the positions")
    if out is not None:
        draw_tolerances(found, out)
    if as_json:
        _print(shown.json_text(found), None)
    else:
        _print(under_heading(stated.title, shown.heading(found), shown.table(found)), None)


@group.command()
@scene_argument
@click.option("--quantity", "quantities", multiple=True, metavar="NAME", help="torque, F12 .. F14, transmission.")
@click.option("--json", "as_json", is_flag=True, help="One object, SI and rad, every digit.")
def extremes(scene: Path, quantities: tuple[str, ...], as_json: bool) -> None:
    """Prove the largest and smallest torque, pin forces and transmission angle over the input's whole interval."""
    from fourbar.show import extremes as shown
    from fourbar.show.progress import running
    from fourbar.show.tables import under_heading
    from fourbar.studies.enclosure import NAMES
    from fourbar.studies.enclosure import extremes as proven

    stated = _load(scene)
    with _named(scene), running("the boxes are halved"):
        found = proven(stated, quantities or NAMES)
    if as_json:
        _print(shown.json_text(stated, found), None)
    else:
        _print(under_heading(stated.title, shown.heading(stated, found), shown.table(found)), None)


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
def usd(scene: Path, out: Path) -> None:
    """Write a scene as USD text (.usda) for Newton, the loop closed by a fourth revolute joint."""
    from fourbar.mjcf.usd import usd as written
    from fourbar.writing import write_text

    with _named(scene):
        text = written(_load(scene))
    write_text(out, text)


@group.command()
@scene_argument
@out_option
@click.option(
    "--figure",
    default="overview",
    show_default=True,
    metavar="NAME",
    help="overview, linkage, coupler, kinematics, points, torque, forces, hodograph, energy, transmission, freebody, "
    "sensitivity.",
)
@click.option("--position", metavar="ANGLE", help='theta_2 of the linkage and free bodies, like "135 deg".')
@click.option("--branches", default="one", show_default=True, metavar="WHICH", help="one or both.")
@click.option("--dimensions", is_flag=True, help="Write the lengths of the bars at them.")
@units_option
def plot(
    scene: Path, out: Path, figure: str, position: str | None, branches: str, dimensions: bool, units: str
) -> None:
    """Draw a scene as SVG, PNG or PDF (by the ending of FILE)."""
    from fourbar.show.plot import draw
    from fourbar.show.units import units as units_of

    at = None if position is None else _angle("--position", position)
    described = _load(scene)
    with _named(scene), _waiting(described):
        draw(described, out, figure, position=at, branches=branches, units=units_of(units), dimensions=dimensions)


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
@units_option
def animate(scene: Path, out: Path, pictures: tuple[str, ...], seconds: float | None, units: str) -> None:
    """Show a scene moving: one web page (.html), or a film (.gif, .mp4)."""
    from fourbar.show.animate import write
    from fourbar.show.units import units as units_of

    attached = {}
    for entry in pictures:
        bar, equals, file = entry.partition("=")
        if not equals:
            raise InputError("--picture", entry, "must be like coupler=FILE")
        attached[bar] = file
    described = _load(scene)
    with _named(scene), _waiting(described):
        write(described, out, pictures=attached, seconds=seconds, units=units_of(units))


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """Mistakes of a scene that show only when it is solved name its file too."""
    try:
        yield
    except InputError as error:
        if error.file is None and error.key.startswith(
            ("motion", "lengths", "bars", "drive", "loads", "effects", "tolerances")
        ):
            raise error.in_file(str(path)) from None
        raise


@contextmanager
def _waiting(scene: "Scene") -> Iterator[None]:
    """A long free motion takes minutes: a terminal shows that it is running."""
    if scene.motion.free is None:
        yield
        return
    from fourbar.free_motion import STEPS
    from fourbar.show.progress import running

    with running(f"the free motion is integrated, in {STEPS} steps at most"):
        yield


def _load(path: Path) -> "Scene":
    from fourbar.files import load
    from fourbar.scene.motion import Free, Sweep

    scene = load(path)
    for key, described in (("motion.theta_2", scene.motion.theta_2), ("motion.free", scene.motion.free)):
        if isinstance(described, (Sweep, Free)) and described.steps >= MOST_POSITIONS:
            raise InputError(f"{key}.steps", described.steps, f"must be below {MOST_POSITIONS} here", str(path))
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


def _angle(key: str, text: str) -> float:
    """An angle with its unit, rad: a bare number may have been meant in either."""
    try:
        float(text)
    except ValueError:
        return _number(key, text, "rad")
    raise InputError(key, text, f'the unit is missing; did you mean "{text} deg"?')


def _terminal_width() -> int | None:
    """Columns of the terminal; None where the output goes elsewhere."""
    if not sys.stdout.isatty():
        return None
    import shutil

    return shutil.get_terminal_size().columns


def _print(text: str, out: Path | None) -> None:
    """To standard output, or to a file, whole or not at all."""
    from fourbar.writing import write_text

    if out is None:
        click.echo(text, nl=False)
    else:
        write_text(out, text)


def main(arguments: list[str] | None = None) -> None:
    """Run a command and leave with its exit status."""
    sys.exit(status(arguments))


def status(arguments: list[str] | None = None) -> int:
    """Run a command; what goes wrong becomes one line on standard error and an exit status."""
    return run(group, "fourbar", arguments)
