"""The commands that evaluate one linkage: classify, new, analyze."""

from pathlib import Path

import click

from fourbar.cli.given import (
    lengths_of,
    loaded,
    named,
    or_out_option,
    printed_to,
    scene_argument,
    terminal_width,
    units_option,
    waiting,
)
from fourbar.errors import InputError, NotAssembledError


@click.command()
@click.argument("lengths", nargs=4, metavar="D A B C")
@click.option("--json", "as_json", is_flag=True, help="One object, SI and radians, every digit.")
@or_out_option
def classify(lengths: tuple[str, ...], as_json: bool, out: Path | None) -> None:
    """Name a linkage by its bar lengths (ground, input, coupler, output), and say what turns and how far.

    Bare numbers are metres; "30 cm" works too.
    """
    from fourbar.linkage import Bar, FourBar
    from fourbar.show.words import type_json, type_lines

    d, a, b, c = lengths_of(lengths)
    linkage = FourBar(d, Bar(a), Bar(b), Bar(c))
    printed_to((type_json(linkage) if as_json else "\n".join(type_lines(linkage))) + "\n", out)


@click.command()
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


@click.command()
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
    described = loaded(scene)
    with named(scene), waiting(described):
        solution = solve(described, last_stage(described))
    if not solution.assembled.any():
        raise NotAssembledError(f"{scene}: motion.theta_2: the linkage assembles at none of the positions requested")
    if as_json:
        text = json_text(solution, shown, motor=motor_entry(solution, shown))
    elif as_csv:
        text = csv_text(solution, shown)
    else:
        width = None if out else terminal_width()
        text = printed(described, solution, width, shown, every=every)
    printed_to(text, out)


def _sensitivity(scene: Path, as_json: bool, out: Path | None) -> None:
    from fourbar.show import influence
    from fourbar.show.tables import under_heading
    from fourbar.studies.derivatives import sensitivity
    from fourbar.studies.influence import json_text

    stated = loaded(scene)
    with named(scene):
        found = sensitivity(stated)
    if not found.solution.assembled.any():
        raise NotAssembledError(f"{scene}: motion.theta_2: the linkage assembles at none of the positions")
    if as_json:
        text = json_text(found)
    else:
        text = under_heading(stated.title, influence.heading(found), influence.table(found))
    printed_to(text, out)
