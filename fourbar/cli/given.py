"""Readers of the commands' arguments: scenes, numbers with units, output files."""

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

# first of all: with it an interruption while NumPy is imported is one line
from fourbar.errors import (
    ELSEWHERE,
    InputError,
    NotAssembledError,
    state_messages_in,
)
from fourbar.linkage import ANY_NUMBER, BAR_NAMES, POSITIVE, require
from fourbar.quantities.units import half_unit_of_text, read_bare
from fourbar.scene import Command, Scene
from fourbar.scene.motion import require_steps
from fourbar.show.lines import find_terminal_width
from fourbar.show.shown_units import states_radians, units, units_of_scene
from fourbar.solution import Conversion
from fourbar.solving import find_last_stage, solve
from fourbar.studies.passing import (
    STATED_POSITIONS,
    extend_motion,
    find_commanded,
    meet_limit,
)
from fourbar.writing import require_file, write_text

_FILE_TABLES = "fourbar.file_tables"
"""Key of the tables of the scene file in the context of a command."""
FILE_PATH = click.Path(path_type=Path)
LENGTH_NAMES = tuple(BAR_NAMES.values())
"""Names of four lengths, in the order in which commands take them."""
_KEYS_OF_A_SCENE = (
    "motion",
    "lengths",
    "bars",
    "drive",
    "loads",
    "effects",
    "tolerances",
)


scene_argument = click.argument("scene", type=FILE_PATH)
TABLE_ENDINGS = (".txt", ".json")
MOST_PRINTED = 1_000_000
"""Positions that `analyze` prints: about a gigabyte of text."""


def units_option(default: str = "those of the file") -> Callable[..., Any]:
    """Make --units; the help states its default."""
    help_text = (
        f'Units: SI, imperial or a list like "mm N.mm deg" (default: {default}).'
    )
    return click.option(
        "--units",
        type=units,
        metavar="UNITS",
        help=help_text,
    )


def text_option(*endings: str, required: bool = False) -> Callable[..., Any]:
    """Make the option -o of a command that writes a file.

    An ending that belongs to another form is refused; without endings any is taken.
    """

    def read_path(text: str) -> Path:
        ending = Path(text).suffix.lower()
        if endings and ending and ending not in endings:
            allowed = f"must end in {', '.join(endings)}, or have no ending"
            raise InputError("path", text, allowed)
        return Path(text)

    help_text = "Write to FILE." if required else "Write to FILE instead of printing."
    return click.option(
        "-o",
        "--out",
        type=read_path,
        required=required,
        metavar="FILE",
        help=help_text,
    )


out_option = text_option(required=True)


json_option = click.option(
    "--json",
    "as_json",
    is_flag=True,
    help="Print one JSON object in SI units and radians.",
)


def ends_in(out: Path | None, suffix: str) -> bool:
    """Return True if there is a file to write to and its name has this ending."""
    return out is not None and out.suffix.lower() == suffix


class LengthsCommand(click.Command):
    """A command of four lengths, which says who serves another number of them."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Read the arguments."""
        try:
            return super().parse_args(ctx, args)
        except click.UsageError as error:
            message = error.message.removesuffix(".")
            if not re.search(r"extra arguments? \([\d.]|takes 4 values", message):
                raise
            if message.endswith("values"):
                message += f", {', '.join(LENGTH_NAMES)}"
                message += " (fourbar analyze takes a scene file)"
            raise click.UsageError(f"{message}: {ELSEWHERE}", ctx) from None


@contextmanager
def open_scene(path: Path) -> Iterator[Scene]:
    """Read the scene of a file.

    Raises InputError if it cannot be printed, or not to the file of -o. The output is
    looked at before anything is solved, which may take minutes. Mistakes that show only
    then name the file too.
    """
    from fourbar.files import parse_tables, read_scene_text, read_tables

    context = click.get_current_context()
    tables = parse_tables(read_scene_text(path), str(path))
    context.meta[_FILE_TABLES] = tables
    with state_messages_in(suit_file_units()):
        scene = read_tables(tables, str(path))
        out = context.params.get("out")
        if out is not None:
            require_file(out, path)
        require_steps(scene.motion, MOST_PRINTED, "here", str(path))
        try:
            yield scene
        except InputError as error:
            if error.file is None and error.key.startswith(_KEYS_OF_A_SCENE):
                raise error.in_file(str(path)) from None
            raise


@contextmanager
def show_waiting(scene: Scene) -> Iterator[None]:
    """Show in a terminal that a long free motion, which takes minutes, is running."""
    if scene.motion.free is None:
        yield
        return
    from fourbar.evaluation.free_motion import MOST_INTEGRATION_STEPS
    from fourbar.show.tables import show_running

    with show_running(
        f"the free motion is integrated, in {MOST_INTEGRATION_STEPS} steps at most"
    ):
        yield


def read_lengths(texts: tuple[str, ...]) -> list[float]:
    """Read the lengths of ground, input, coupler and output, m."""
    return [
        read_number(f"length of {name}", text, "m", POSITIVE)
        for name, text in zip(LENGTH_NAMES, texts, strict=True)
    ]


def suit_file_units() -> Conversion:
    """Return the units that suit the file of `open_scene`."""
    return units_of_scene(click.get_current_context().meta[_FILE_TABLES])


def commands_radians() -> bool:
    """Return True if the file of `open_scene` commands an angle in rad."""
    return states_radians(click.get_current_context().meta[_FILE_TABLES])


def is_bare(text: str) -> bool:
    """Return True if a text is a number without a unit."""
    return read_bare(text) is not None


def read_number(key: str, text: str, unit: str, bound: str = ANY_NUMBER) -> float:
    """Read a number of the command line: bare in SI, or with a unit."""
    number = read_bare(text)
    return require(key, text if number is None else number, unit, bound)


def read_positions(scene: Scene, text: str) -> Command:
    """Read the positions of a text like "60 deg", "theta_4=30 deg" or "P_y=30 mm".

    Without a name the number is what the scene commands. Angles and strokes are those
    that the linkage can have; any other column, and each of a motion over time, has its
    value in the scene's motion.
    """
    from fourbar.effects.force_drive import LinearDrive
    from fourbar.files.drawn_pins import list_drawn
    from fourbar.show.located import EXTREMES, locate

    name, equals, value = (part.strip() for part in text.rpartition("="))
    motion = scene.motion
    if not equals:
        name = motion.commanded
    if name == "t":  # as it is printed
        name = "time"
    unit = "m" if name == "stroke" else "rad"
    if value == "drawn":
        drawn = {}
        if scene.drawing is not None:
            drawn = list_drawn(scene.drawing, scene.settled_drive())
        if name not in drawn:
            raise InputError("--at", text, "needs a scene that states [pins]")
        value = f"{drawn[name]!r} {unit}"
    is_over_time = motion.law is not None or motion.free is not None
    is_column = name not in STATED_POSITIONS or value in EXTREMES or is_over_time
    if name == "stroke" and isinstance(scene.drive, LinearDrive):
        is_column |= not scene.drive.may_be_commanded
    if is_column:
        return locate(scene, name, value)
    require_unit("--at", text, value, "mm" if unit == "m" else "deg")
    stated = read_number("--at", value, unit)
    if name == motion.commanded:
        return find_commanded(scene, stated)
    range_of_bar = extend_motion(scene)
    if unit == "rad":
        rounding = half_unit_of_text(value, unit)
        met = meet_limit(scene.linkage, int(name[-1]), stated, rounding)
        if met != stated:
            with suppress(NotAssembledError):  # it may be one of the other assembly
                return locate(range_of_bar, name, f"{met!r} rad")
    return locate(range_of_bar, name, value)


def require_unit(key: str, text: str, value: str, likely: str) -> None:
    """Raise InputError for a number alone, which may have been meant in any unit."""
    if is_bare(value):
        hint = f'the unit is missing; did you mean "{value} {likely}"?'
        raise InputError(key, text, hint)


_ANGLE_OF_SCENE = re.compile(r"(.+):\s*(theta_[234])\s*(?:([+-])\s*(.+))?")


def take_motion(scene: Scene, text: str) -> Scene:
    """Return a scene that is moved by a bar of another one, like "a.toml:theta_4".

    Angles, speeds and accelerations are those of the bar at the positions of the other
    scene that have them; an angle that the text adds is where the two are joined.
    """
    import numpy as np

    from fourbar.files import load

    match = _ANGLE_OF_SCENE.fullmatch(text.strip())
    if match is None:
        allowed = 'must be a file and an angle, like "first.toml:theta_4 + 30 deg"'
        raise InputError("--positions", text, allowed)
    if scene.motion.stroke is not None or scene.motion.free is not None:
        allowed = "needs a scene whose motion commands an angle"
        raise InputError("--positions", text, allowed)
    file, name, sign, added = match.groups()
    added = f"{sign}{added}" if added else "0 deg"
    require_unit("--positions", text, added, "deg")
    first = load(file)
    moved = solve(first, find_last_stage(first))
    angle = getattr(moved, name) + read_number("--positions", added, "rad")
    speed, acceleration = (
        getattr(moved, name.replace("theta", rate)) for rate in ("omega", "alpha")
    )
    states = [state for state in (angle, speed, acceleration) if state is not None]
    moves = np.isfinite(states).all(axis=0)
    if not moves.any():
        raise InputError("--positions", text, "that scene has no such motion")
    motion = scene.motion.replace(
        angle=angle[moves],
        speed=None if speed is None else speed[moves],
        acceleration=0.0 if acceleration is None else acceleration[moves],
        law=None,
    )
    return replace(scene, motion=motion)


def read_three(key: str, text: str, unit: str = "m") -> tuple[float, float, float]:
    """Read a vector of the command line: three numbers between spaces or commas.

    Numbers are bare or with units.
    """
    parts = text.replace(",", " ").split()
    if len(parts) != 3:
        raise InputError(key, text, 'must be three numbers, like "0.3 0 1"')
    x, y, z = (read_number(key, part, unit) for part in parts)
    return x, y, z


def find_width(out: Path | None = None) -> int | None:
    """Return the columns of the terminal that is printed to; None: a file or pipe."""
    return find_terminal_width() if out is None else None


def print_to(text: str, out: Path | None) -> None:
    """Print to standard output, or write a file atomically."""
    if out is None:
        click.echo(text, nl=False)
    else:
        write_text(out, text)
