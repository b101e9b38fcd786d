"""The commands that evaluate a linkage, what may vary of it, and where it rests."""

import shutil
import sys
from pathlib import Path

import click

from fourbar.cli import given
from fourbar.errors import InputError, NotAssembledError
from fourbar.solution import DEGREES, Conversion


@click.command()
@click.argument("lengths", nargs=4, metavar="D A B C")
@given.json_option
@given.text_option(*given.TABLES)
def classify(lengths: tuple[str, ...], as_json: bool, out: Path | None) -> None:
    """Name a linkage by its bar lengths (ground, input, coupler, output), and say what turns and how far.

    Four bare numbers are ratios; lengths like 30cm work too.
    """
    from fourbar.linkage import Bar, FourBar
    from fourbar.show.words import write_type, write_type_json

    ratios = [given.is_bare(text) for text in lengths]
    if any(ratios) and not all(ratios):
        raise InputError("D A B C", " ".join(lengths), "must be four ratios, or four lengths each with its unit")
    d, a, b, c = given.read_lengths(lengths)
    linkage = FourBar(d, Bar(a), Bar(b), Bar(c))
    unit = "" if all(ratios) else " m"
    given.print_to(write_type_json(linkage) if as_json else "\n".join([*write_type(linkage, unit), ""]), out)


@click.command()
@click.argument("file", type=given.FILE, required=False)
@click.option("-o", "--out", type=given.FILE, metavar="FILE", help="The same, as an option.")
@click.option("--lengths", nargs=4, required=True, metavar="D A B C", help="Ground, input, coupler, output: 300mm ...")
@click.option("--unit", metavar="UNIT", help="Of bare numbers, like mm.")
def new(file: Path | None, out: Path | None, lengths: tuple[str, ...], unit: str | None) -> None:
    """Write a new scene file with the four lengths, the rest explained in comments.

    Each length has a unit, like 300mm; or --unit mm is the unit of all.
    """
    from fourbar.files.new import write_new_scene
    from fourbar.writing import write_text

    if (file is None) == (out is None):
        raise click.UsageError("name the new file once: FILE, or -o FILE")
    file = file or out
    assert file is not None
    if file.exists():
        raise InputError("FILE", str(file), "is there already; a new scene needs a new name")
    bare = [text for text in lengths if given.is_bare(text)]
    if bare and unit is None:
        raise InputError(
            "--lengths", bare[0], "the unit is missing; write each with its own, like 300mm, or --unit mm once"
        )
    write_text(file, write_new_scene([f"{text} {unit}" if text in bare else text for text in lengths]))
    shown = str(file) if " " not in str(file) else f'"{file}"'  # to be copied into any shell
    click.echo(f"wrote {file}; edit it, then: fourbar analyze {shown}")


@click.command()
@given.scene_argument
@click.option("--json", "as_json", is_flag=True, help="One object, SI, every digit.")
@click.option("--csv", "as_csv", flag_value=".", help="One line per position, SI, every digit.")
@click.option("--csv-comma", "as_csv", flag_value=",", help="The same with decimal commas, and semicolons between.")
@click.option("--degrees/--radians", default=None, help="Angles theta; left out: degrees in the table, else radians.")
@given.units_option
@click.option("--sensitivity", is_flag=True, help="What the quantities depend on: d(quantity)/d(number).")
@click.option("--every", type=click.IntRange(min=1), metavar="N", help="Show every N-th position in the table.")
@click.option("--all", "every", flag_value=1, help="Show every position; a terminal gets some forty at most.")
@given.text_option(*given.TABLES, ".csv")
def analyze(
    scene: Path,
    as_json: bool,
    as_csv: str | None,
    degrees: bool | None,
    units: Conversion,
    sensitivity: bool,
    every: int | None,
    out: Path | None,
) -> None:
    """Solve a scene: angles, speeds, accelerations, driving torque and pin forces.

    A FILE that ends in .csv or .json asks for that form.
    """
    if not as_json and not as_csv:
        as_json, as_csv = given.ends_in(out, ".json"), "." if given.ends_in(out, ".csv") else None
    if sensitivity:
        if as_csv or degrees or every is not None or units:
            raise click.UsageError("--sensitivity is a table, or with --json all of it, SI and rad")
        _write_sensitivity(scene, as_json, out)
        return
    from fourbar.show.between import locate_between
    from fourbar.show.duty import write_motor
    from fourbar.show.tables import print_tables
    from fourbar.solution import write_csv, write_json
    from fourbar.solve import find_last_stage, solve

    if as_json and as_csv:
        raise click.UsageError("--json and --csv are two forms of the output; give one of them")
    if every is not None and (as_json or as_csv):
        raise click.UsageError("--every and --all are of the table; --json and --csv hold every position")
    shown = dict(units)
    if degrees or (degrees is None and "rad" not in shown and not (as_json or as_csv)):
        shown |= DEGREES
    elif degrees is False:
        shown.pop("rad", None)
    with given.open_scene(scene) as described, given.show_waiting(described):
        solution = solve(described, find_last_stage(described))
    if not solution.assembled.any():
        raise NotAssembledError(
            f"{scene}: motion.{described.motion.names[0]}: the linkage assembles at none of the positions requested"
        )
    if as_json:
        located = locate_between(described, solution).solution
        text = write_json(solution, shown, motor=write_motor(solution, shown, located))
    elif as_csv:
        text = write_csv(solution, shown, as_csv)
    else:
        width = None if out or not sys.stdout.isatty() else shutil.get_terminal_size().columns
        text = print_tables(described, solution, width, shown, every=every)
    given.print_to(text, out)


def _write_sensitivity(scene: Path, as_json: bool, out: Path | None) -> None:
    from fourbar.show import influence
    from fourbar.show.tables import write_table
    from fourbar.studies.derivatives import sensitivity

    with given.open_scene(scene) as stated:
        found = sensitivity(stated)
    if not found.solution.assembled.any():
        raise NotAssembledError(
            f"{scene}: motion.{stated.motion.names[0]}: the linkage assembles at none of the positions"
        )
    if as_json:
        text = influence.write_json(found)
    else:
        text = write_table(stated.title, influence.write_heading(found), influence.make_table(found))
    given.print_to(text, out)


@click.command()
@given.scene_argument
@click.option("--samples", type=int, metavar="N", help="Linkages that are tried; left out: 8192.")
@click.option("--seed", type=int, default=0, show_default=True, metavar="S", help="Of the quasi-random samples.")
@given.json_option
@given.units_option
@click.option("-o", "--out", type=given.FILE, metavar="PLOT", help="Draw the bands: svg, png or pdf.")
def tolerance(scene: Path, samples: int | None, seed: int, as_json: bool, units: Conversion, out: Path | None) -> None:
    """Show what the [tolerances] of a scene do to torque, pin forces and points, and which dimension does it."""
    from fourbar.show import tolerances as shown
    from fourbar.show.plot import draw_tolerances, format_of
    from fourbar.show.progress import show_running
    from fourbar.show.tables import write_table
    from fourbar.studies.spread import SAMPLES, tolerances

    _refuse_units_of_json(as_json, units)
    if out is not None:
        format_of(out)
    with given.open_scene(scene) as stated, show_running("samples are solved") as progress:
        found = tolerances(stated, SAMPLES if samples is None else samples, seed, progress=progress)
    if (found.without == found.samples).all():
        raise NotAssembledError(
            f"{scene}: motion.{stated.motion.names[0]}: the linkage assembles at none of the positions"
        )
    if out is not None:
        draw_tolerances(found, out, units)
    if as_json:
        given.print_to(shown.write_json(found), None)
    else:
        own = {**DEGREES, **units}
        given.print_to(write_table(stated.title, shown.write_heading(found, own), shown.make_table(found, own)), None)


def _refuse_units_of_json(as_json: bool, units: Conversion) -> None:
    if as_json and units:
        raise click.UsageError("--json is SI and radians, every digit; --units is of the table")


@click.command()
@given.scene_argument
@click.option(
    "--quantity", "quantities", multiple=True, metavar="NAME", help="torque or drive_force, F12 .. F14, transmission."
)
@given.json_option
@given.units_option
@given.text_option(*given.TABLES)
def extremes(scene: Path, quantities: tuple[str, ...], as_json: bool, units: Conversion, out: Path | None) -> None:
    """Prove the largest and smallest torque, pin forces and transmission angle over the input's whole interval."""
    from fourbar.show import extremes as shown
    from fourbar.show.progress import show_running
    from fourbar.show.tables import write_table
    from fourbar.studies.enclosure import extremes as proven

    _refuse_units_of_json(as_json, units)
    with given.open_scene(scene) as stated, show_running("pieces of the interval are halved"):
        found = proven(stated, quantities)
    if as_json:
        text = shown.write_json(stated, found)
    else:
        own = {**DEGREES, **units}
        text = write_table(stated.title, shown.write_heading(stated, found, own), shown.make_table(found, own))
    given.print_to(text, out)


@click.command()
@given.scene_argument
@given.json_option
@given.text_option(*given.TABLES)
def equilibrium(scene: Path, as_json: bool, out: Path | None) -> None:
    """Find where a linkage stays by itself, stable or not, how fast it swings there, and what holds it elsewhere."""
    from fourbar.show import equilibrium as shown
    from fourbar.show.progress import show_running
    from fourbar.studies.equilibrium import equilibrium as found

    with given.open_scene(scene) as described, show_running("the boxes are halved"):
        result = found(described)
    given.print_to((shown.write_json if as_json else shown.write_tables)(described.title, result), out)
