"""The commands that evaluate a linkage, what may vary of it, and where it rests."""

from pathlib import Path
from typing import Any

import click

from fourbar.cli import given
from fourbar.errors import ELSEWHERE, InputError, NotAssembledError, state_messages_in
from fourbar.linkage import PINS, POSITIVE, Bar, FourBar
from fourbar.quantities import Array
from fourbar.scene import Command, Scene
from fourbar.show.lines import wrap_line
from fourbar.show.shown_units import units_of_length
from fourbar.solution import DEGREES, SI, Conversion, Solution, write_csv, write_json
from fourbar.solving import find_last_stage, solve
from fourbar.studies.course import follow
from fourbar.studies.passing import join_commands, say_nowhere
from fourbar.writing import STANDARD_STREAM, write_text


@click.command("classify", cls=given.LengthsCommand)
@click.argument("lengths", nargs=4, metavar="D A B C")
@click.option(
    "--all",
    "everything",
    is_flag=True,
    help="Print the limits of the coupler too.",
)
@given.json_option
@given.text_option(*given.TABLE_ENDINGS)
def classify_command(
    lengths: tuple[str, ...],
    everything: bool,
    as_json: bool,
    out: Path | None,
) -> None:
    """Classify a linkage by its lengths: which bars turn, and how far.

    D A B C are ground, input, coupler and output: four bare numbers are ratios; lengths
    like 30cm work too.
    """
    from fourbar.show.studies import write_type, write_type_json

    ratios = [given.is_bare(text) for text in lengths]
    if any(ratios) and not all(ratios):
        raise InputError(
            "D A B C",
            " ".join(lengths),
            "must be four ratios, or four lengths each with its unit",
        )
    d, a, b, c = given.read_lengths(lengths)
    units = {"m": ("", 1.0)} if all(ratios) else units_of_length(lengths[0])
    with state_messages_in(units):
        linkage = FourBar(d, Bar(a), Bar(b), Bar(c))
    if as_json or given.ends_in(out, ".json"):
        text = write_type_json(linkage)
    else:
        width = given.find_width(out)
        lines = write_type(linkage, units, everything=everything)
        text = "".join(f"{part}\n" for line in lines for part in wrap_line(line, width))
    given.print_to(text, out)


@click.command(cls=given.LengthsCommand)
@click.argument("file", type=given.FILE_PATH, required=False)
@click.option(
    "-o",
    "--out",
    type=given.FILE_PATH,
    metavar="FILE",
    help="Name of the new file.",
)
@click.option(
    "--lengths",
    nargs=4,
    metavar="D A B C",
    help="Lengths of ground, input, coupler, output, like 300mm.",
)
@click.option(
    "--pins",
    metavar='"X,Y X,Y X,Y X,Y"',
    help="Places of the pins O2, A, B, O4 as they are drawn, in place of --lengths.",
)
@click.option(
    "--unit",
    metavar="UNIT",
    help="Unit of lengths and coordinates that are given without one, like mm.",
)
@click.option(
    "--positions-only",
    is_flag=True,
    help="Leave out masses, gravity, speed and drive.",
)
def new(
    file: Path | None,
    out: Path | None,
    lengths: tuple[str, ...] | None,
    pins: str | None,
    unit: str | None,
    positions_only: bool,
) -> None:
    """Write a new scene file with these lengths or pins; comments explain the rest.

    Each number has a unit, like 300mm; or --unit mm is the unit of all.
    """
    from fourbar.files.new_scene import (
        NEW_POSITIONS,
        NEW_SCENE,
        write_drawn_scene,
        write_new_scene,
    )

    if (lengths is None) == (pins is None):
        raise click.UsageError("give --lengths D A B C or --pins, one of the two")

    if (file is None) == (out is None):
        raise click.UsageError("name the new file once: FILE, or -o FILE")
    file = file or out
    assert file is not None
    if file.exists():
        raise InputError(
            "FILE",
            str(file),
            "file exists; give the new scene another name",
        )
    template = NEW_POSITIONS if positions_only else NEW_SCENE
    stated: Any
    write: Any = write_new_scene
    if lengths is not None:
        stated = [_add_unit("--lengths", text, unit) for text in lengths]
        first = stated[0]
    else:
        assert pins is not None
        write = write_drawn_scene
        stated = _read_pins(pins, unit)
        first, _ = stated["A"]
    with state_messages_in(units_of_length(first)):
        scene = write(stated, template)
    write_text(file, scene)
    if file == STANDARD_STREAM:
        return
    # to be copied into any shell
    shown = str(file) if " " not in str(file) else f'"{file}"'
    click.echo(f"wrote {file}; edit it, then: fourbar analyze {shown}")


def _add_unit(option: str, text: str, unit: str | None) -> str:
    """Add the unit of all numbers to a number that states none.

    Raises InputError if neither the number nor the option states one.
    """
    if not given.is_bare(text):
        return text
    if unit is None:
        raise InputError(
            option,
            text,
            "the unit is missing; write each with its own, like 300mm, or --unit mm"
            " once",
        )
    return f"{text} {unit}"


def _read_pins(text: str, unit: str | None) -> dict[str, tuple[str, str]]:
    """Read four pairs like "0,0 0,100 175,50 250,50" as x and y of the pins."""
    pairs = [pair.split(",") for pair in text.split()]
    if len(pairs) != len(PINS) or any(len(pair) != 2 for pair in pairs):
        raise InputError(
            "--pins",
            text,
            'must be x,y of O2, A, B, O4, like "0,0 0,100 175,50 250,50"'
            f"{f': {ELSEWHERE}' if len(pairs) > len(PINS) else ''}",
        )
    return {
        pin: (_add_unit("--pins", x, unit), _add_unit("--pins", y, unit))
        for pin, (x, y) in zip(PINS, pairs, strict=True)
    }


def _choose_output(table: bool, as_json: bool, as_csv: bool, out: Path | None) -> str:
    """Choose between "summary", "table", "json" and "csv".

    The options decide, or the ending of the file.
    """
    if as_json and as_csv:
        raise click.UsageError(
            "--json and --csv are two forms of the output; give one of them"
        )
    if table and (as_json or as_csv):
        raise click.UsageError(
            "--table, --every and --all shape the table; --json and --csv hold every"
            " position"
        )
    if table:
        return "table"
    if as_json or (given.ends_in(out, ".json") and not as_csv):
        return "json"
    if as_csv or given.ends_in(out, ".csv"):
        return "csv"
    return "summary"


@click.command()
@given.scene_argument
@click.option(
    "--at",
    multiple=True,
    metavar="POSITION",
    help=(
        'Position, like "60 deg", "time=0.2 s", "B_x=80 mm", "F12_y=max" or any column'
        " with a value, min or max; repeatable."
    ),
)
@click.option(
    "--positions",
    metavar="SCENE:ANGLE",
    help=(
        "Command the motion of another scene's bar, like"
        ' "first.toml:theta_4 + 30 deg".'
    ),
)
@click.option("--table", is_flag=True, help="Print the positions one by one.")
@click.option(
    "--columns",
    metavar="NAMES",
    help=(
        "Columns of the table or CSV, like"
        " theta_2,time,torque,F12,F12_x,omega_4/omega_2."
    ),
)
@click.option(
    "--every",
    type=click.IntRange(min=1),
    metavar="N",
    help="Print every N-th position of the table.",
)
@click.option("--all", "every", flag_value=1, help="Print every position of the table.")
@click.option(
    "--json",
    "as_json",
    is_flag=True,
    help="Print one JSON object in SI units.",
)
@click.option(
    "--csv",
    "decimal",
    flag_value=".",
    help="Print one line per position; every heading names its unit.",
)
@click.option(
    "--csv-comma",
    "decimal",
    flag_value=",",
    help="Print CSV with decimal commas and semicolons.",
)
@click.option(
    "--degrees/--radians",
    default=None,
    help="Unit of the angles (default: degrees; rad in JSON).",
)
@given.units_option("those of the file; SI in JSON")
@click.option(
    "--pressure",
    metavar="P",
    help='Pressure of the cylinder, like "210 bar"; adds the bore that it needs.',
)
@click.option(
    "--sensitivity",
    is_flag=True,
    help=(
        "Rank the numbers of the scene by how far each changes the results, in SI"
        " units; without --at, --units and --degrees."
    ),
)
@given.text_option(*given.TABLE_ENDINGS, ".csv")
def analyze(  # noqa: PLR0913 - one for each option
    scene: Path,
    at: tuple[str, ...],
    positions: str | None,
    table: bool,
    columns: str | None,
    every: int | None,
    as_json: bool,
    decimal: str | None,
    degrees: bool | None,
    units: Conversion | None,
    pressure: str | None,
    sensitivity: bool,
    out: Path | None,
) -> None:
    """Solve a scene: ranges, torque, pin forces, and what the drive must deliver.

    If the scene states one position, or --at names one, everything about it is printed.
    A FILE that ends in .csv or .json asks for that form.
    """
    form = _choose_output(table or every is not None, as_json, decimal is not None, out)
    if columns is not None and form == "json":
        raise click.UsageError("--columns are those of a table or of CSV")
    if columns is not None and form == "summary":
        form = "table"
    if sensitivity:
        if form in ("csv", "table") or degrees or units or at or positions:
            raise click.UsageError(
                "--sensitivity cannot be combined with --at, --positions, --units,"
                " --degrees, --columns, --table, --every, --all and --csv: it prints a"
                " table in SI units; --json prints every position"
            )
        _print_sensitivity(scene, form == "json", out)
        return

    with given.open_scene(scene) as stated, given.show_waiting(stated):
        if positions is None:
            described = stated
        else:
            described = given.take_motion(stated, positions)
        bore = _read_pressure(described, pressure)
        shown = _choose_units(form, units, degrees)
        asked, without = _find_positions(described, at)
        wanted = join_commands([*asked.values()]) if asked else None
        solution = solve(described, find_last_stage(described), at=wanted)
        if asked:
            follow(described, solution)
        if not solution.assembled.any():
            raise _assembles_nowhere(scene, described)
    if form == "summary":
        with state_messages_in(shown):
            width = given.find_width(out)
            text = _write_summary(described, solution, shown, bore, asked, width)
            text += "".join(
                f"{part}\n" for line in without for part in wrap_line(line, width)
            )
    else:
        text = _write_positions(solution, form, shown, columns, every, decimal, out)
        for line in without:
            click.echo(line, err=True)
    given.print_to(text, out)


def _find_positions(
    scene: Scene,
    at: tuple[str, ...],
) -> tuple[dict[str, Command], list[str]]:
    """Find the positions of each `--at`, and say which of them no position has.

    Raises NotAssembledError if none has one.
    """
    asked = dict[str, Command]()
    without = list[NotAssembledError]()
    for text in at:
        try:
            asked[text] = given.read_positions(scene, text)
        except NotAssembledError as error:
            without.append(error)
    if without and not asked:
        raise without[0]
    return asked, [f"left out: {error}" for error in without]


def _choose_units(
    form: str,
    units: Conversion | None,
    degrees: bool | None,
) -> Conversion:
    """Choose the units of the output: those asked for, else the file's; JSON is in SI.

    Angles are in degrees if not asked for, in CSV only if the file does not command
    them in rad.
    """
    in_degrees = form in ("summary", "table")
    if units is not None:
        shown = {**(DEGREES if in_degrees else SI), **units}
    elif form == "json":
        shown = dict(SI)
    else:
        shown = dict(given.suit_file_units())
        if form == "csv" and given.commands_radians():
            shown.pop("rad", None)
    if degrees:
        shown |= DEGREES
    elif degrees is False:
        shown.pop("rad", None)
    return shown


def _write_summary(
    scene: Scene,
    solution: Solution,
    units: Conversion,
    pressure: float | None,
    asked: dict[str, Command],
    width: int | None,
) -> str:
    """Write the block of a scene, or what `--at` asked for.

    One position that answers `--at` has a block, several have a line each.
    """
    from fourbar.show.block import SceneBlock, write_paths
    from fourbar.show.located import list_positions

    if not asked:
        block = SceneBlock(solution, units, pressure, width)
        return "\n".join([*block.write(), *write_paths(solution, units), ""])
    lines: list[str] = []
    headed = True
    for text, at in asked.items():
        if len(at.angle) > 1:
            lines += [*list_positions(text, at), ""]
            continue
        one = solve(scene, find_last_stage(scene), at=at)
        follow(scene, one)
        block = SceneBlock(one, units, pressure, width)
        lines += [*block.write(headed=headed), ""]
        headed = False
    return "\n".join(lines)


def _write_positions(
    solution: Solution,
    form: str,
    units: Conversion,
    names: str | None,
    every: int | None,
    decimal: str | None,
    out: Path | None,
) -> str:
    """Write every position, as JSON, CSV or a table, whose columns may be named."""
    from fourbar.show.acting import list_notes
    from fourbar.show.columns import choose_columns
    from fourbar.show.duty import collect_paths, list_duty
    from fourbar.show.tables import print_positions

    columns = [] if names is None else choose_columns(solution, names)
    if form == "json":
        motor = list_duty(solution, units)
        notes = list_notes(solution, units)
        paths = collect_paths(solution, units)
        return write_json(solution, units, motor=motor, notes=notes, paths=paths)
    if form == "csv":
        chosen = dict[str, Array]()
        for column in columns:
            # in units other than SI each heading names its unit
            label, values = column.convert(units)
            heading = f"{column.name} [{label}]" if units and label else column.name
            chosen[heading] = values
        return write_csv(solution, units, decimal or ".", chosen)
    width = given.find_width(out)
    return print_positions(solution, width, units, every=every, columns=columns)


def _assembles_nowhere(path: Path, scene: Scene) -> NotAssembledError:
    return NotAssembledError(f"{path}: {say_nowhere(scene)}")


def _read_pressure(scene: Scene, pressure: str | None) -> float | None:
    """Read the pressure of a cylinder, Pa; InputError where no cylinder drives."""
    if pressure is None:
        return None
    if scene.drive is None or not scene.drive.has_stroke:
        raise InputError(
            "--pressure",
            pressure,
            "needs a cylinder; the scene's [drive] has no from and to",
        )
    given.require_unit("--pressure", pressure, pressure, "bar")
    return given.read_number("--pressure", pressure, "Pa", POSITIVE)


def _print_sensitivity(scene: Path, as_json: bool, out: Path | None) -> None:
    from fourbar.show.studies import write_sensitivity, write_sensitivity_json
    from fourbar.studies.derivatives import sensitivity

    with given.open_scene(scene) as stated:
        derivatives = sensitivity(stated)
    if not derivatives.solution.assembled.any():
        raise _assembles_nowhere(scene, stated)
    if as_json:
        text = write_sensitivity_json(derivatives)
    else:
        text = write_sensitivity(derivatives, given.find_width(out))
    given.print_to(text, out)


@click.command()
@given.scene_argument
@click.option(
    "--samples",
    type=int,
    metavar="N",
    help="Number of linkages that are tried (default: 8192).",
)
@click.option(
    "--seed",
    type=int,
    default=0,
    show_default=True,
    metavar="S",
    help="Seed of the quasi-random samples.",
)
@given.json_option
@given.units_option("those of the file; SI in JSON")
@click.option(
    "-o",
    "--out",
    type=given.FILE_PATH,
    metavar="PLOT",
    help="Draw the bands into PLOT (svg, png or pdf).",
)
def tolerance(
    scene: Path,
    samples: int | None,
    seed: int,
    as_json: bool,
    units: Conversion | None,
    out: Path | None,
) -> None:
    """Compute what the [tolerances] do to the results, and which does most."""
    from fourbar.show import tolerances as shown
    from fourbar.show.plot import draw_tolerances, format_of
    from fourbar.show.tables import show_running
    from fourbar.studies.spread import SAMPLES, tolerances

    if as_json and units:
        raise click.UsageError(
            "--json has SI units and radians; --units changes the table only"
        )
    if out is not None:
        format_of(out)
    with (
        given.open_scene(scene) as stated,
        show_running("samples are solved") as progress,
    ):
        spreads = tolerances(
            stated,
            SAMPLES if samples is None else samples,
            seed,
            progress=progress,
        )
    if not (spreads.spreads["sin_mu"].deviation >= 0.0).any():
        raise _assembles_nowhere(scene, stated)
    named = given.suit_file_units() if units is None else units
    if out is not None:
        draw_tolerances(spreads, out, named)
    if as_json:
        text = shown.write_spreads_json(spreads)
    else:
        width = given.find_width()
        text = shown.write_spreads(spreads, {**DEGREES, **named}, width)
    given.print_to(text, None)


@click.command("equilibrium")
@given.scene_argument
@given.json_option
@given.text_option(*given.TABLE_ENDINGS)
def equilibrium_command(scene: Path, as_json: bool, out: Path | None) -> None:
    """Find positions of rest, stability, frequency, and what holds the others."""
    from fourbar.show.studies import write_equilibria, write_equilibria_json
    from fourbar.show.tables import show_running
    from fourbar.studies.equilibrium import equilibrium as found

    with given.open_scene(scene) as described, show_running("zeros are sought"):
        rest = found(described)
    if as_json or given.ends_in(out, ".json"):
        text = write_equilibria_json(described.title, rest)
    else:
        units = given.suit_file_units()
        width = given.find_width(out)
        text = write_equilibria(described.title, rest, units, width)
    given.print_to(text, out)
