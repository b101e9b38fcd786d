"""Layout of every printed table, and the progress line of long work.

The table of positions of `analyze --table` is one.
"""

import io
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from fourbar.errors import clean_line
from fourbar.quantities import (
    ANGLES,
    COUPLE,
    DERIVED_NAMES,
    LINE,
    OK,
    PIN_FORCES,
    RATES,
    Array,
)
from fourbar.show.acting import list_arm_notes
from fourbar.show.columns import Column, list_column_quantities, read_column
from fourbar.show.derived import list_derived_names
from fourbar.show.driving import leaves_range, read_drive_demand
from fourbar.show.lines import wrap_line
from fourbar.show.shown_units import drop_rounding, write_cell
from fourbar.solution import (
    DEGREES,
    Conversion,
    Solution,
    compute_times,
    has_size,
    is_scalar,
)

MOST_DIGITS = 16
"""Largest number of significant digits of a double."""
GAP = 2
"""Blanks between two columns of the table, the divider among them."""
MOST_ROWS_PRINTED = 40
"""Rows of the table on a terminal if --every does not state them. They can be read at a
glance.
"""


def write_table(
    title: str,
    lines: Iterable[str],
    heads: Iterable[str],
    rows: Sequence[Iterable[str]],
    *,
    left: Sequence[str] = ("",),
    gap: int = 0,
    after: Iterable[str] = (),
    width: int | None = None,
) -> str:
    """Write a table with its title and what stands above it and below.

    Without a row it is left out.

    Parameters
    ----------
    left : headings of the columns that are not aligned to the right.
    gap : blanks between two columns, besides the divider.
    width : that of a terminal.
    """
    from rich import box
    from rich.console import Console
    from rich.text import Text

    from fourbar.show.folded import FoldedTable

    shown = FoldedTable(
        box=box.SIMPLE_HEAD,
        show_edge=False,
        pad_edge=False,
        padding=(0, gap, 0, 0),
    )
    for head in heads:
        justify: Any = "left" if head in left else "right"
        shown.add_column(Text(head), justify=justify, no_wrap=True)
    for row in rows:
        shown.add_row(*map(Text, row))
    text = io.StringIO()
    if rows:
        Console(file=text, width=width or 10_000, color_system=None).print(shown)
    table = [line.rstrip() for line in text.getvalue().splitlines()]
    above, below = (
        [part for line in part_of for part in wrap_line(line, width)]
        for part_of in (filter(None, [clean_line(title), *lines]), after)
    )
    return "\n".join([*above, *table, *below, ""])


def print_positions(
    solution: Solution,
    width: int | None,
    units: Conversion = DEGREES,
    *,
    every: int | None = None,
    columns: Sequence[Column] = (),
) -> str:
    """Write the table of positions as text.

    Parameters
    ----------
    columns : the columns; left out: all of them, most wanted first.
    width : columns of a terminal, where the positions are thinned out; None: a file or
        a pipe, which gets them all.
    every : show every so many positions; left out: as `width` says.
    """
    step = every or 1
    if every is None and width is not None:
        step = math.ceil((len(solution) - 1) / (MOST_ROWS_PRINTED - 1)) or 1
    cells = dict[str, list[str]]()
    for column in columns:
        cells |= _write_column(column, column.name, units)
    cells = cells or list_columns(solution, units)
    widths = (
        max(map(len, (*name.split("\n"), *column))) for name, column in cells.items()
    )
    needed = np.cumsum([GAP + each for each in widths]) - GAP
    fitting = len(cells) if width is None else int((needed <= width).sum())
    kept = [*cells][:fitting]
    rows = [*zip(*(cells[name] for name in kept), strict=True)]
    last = rows[-1:] if (len(rows) - 1) % step else []
    notes = list_arm_notes(solution.scene)
    if step > 1:
        more = "; --all shows each" if every is None else ""
        suffix = {1: "st", 2: "nd", 3: "rd"}.get(step % 10, "th")
        if step % 100 in (11, 12, 13):
            suffix = "th"
        notes.append(f"shown: every {step}{suffix} of the {len(rows)} positions{more}")
    if left_out := [name.split("\n")[0] for name in cells if name not in kept]:
        notes.append(
            f"not shown: {', '.join(left_out)} (a wider terminal, --csv or --json has"
            " them)"
        )
    shown = rows[::step] + last
    title = solution.title
    return write_table(title, [], kept, shown, gap=GAP - 1, after=notes, width=width)


def list_columns(
    solution: Solution,
    units: Conversion = DEGREES,
) -> dict[str, list[str]]:
    """List the columns of the table, most wanted first: heading with unit -> cells.

    A status is among them only if one is not ok.
    """
    shown: dict[str, list[str]] = {}
    if (solution.status_code != OK).any():
        shown["status\n"] = [status.replace("_", " ") for status in solution.status]
    drive = read_drive_demand(solution)
    headings = {drive.keys.value: drive.symbol, "sin_mu": "sin mu"}
    vectors = filter(has_size, (*PIN_FORCES, *DERIVED_NAMES))
    headings |= {name: f"|{name}|" for name in vectors}
    for name in _list_names(solution):
        column = read_column(solution, name)
        shown |= _write_column(column, headings.get(name, name), units)
        if name == "sin_mu" and np.isfinite(drive.error).any():
            # digits of the torque that are not round-off; an error bar of 0 leaves all
            with np.errstate(all="ignore"):
                digits = np.floor(np.log10(drive.sizes / drive.error))
            digits[drive.error == 0.0] = MOST_DIGITS
            digits[~np.isfinite(drive.sizes + drive.error)] = np.nan
            cells = write_cells(np.clip(digits, 0, MOST_DIGITS))
            shown[f"digits\nof {drive.symbol[0]}"] = cells
    return shown


def _write_column(
    column: Column, heading: str, units: Conversion
) -> dict[str, list[str]]:
    """Write the cells of a column, by its heading with the unit."""
    column = column._replace(values=drop_rounding(column.values, column.size))
    form = ".4f" if column.unit == "rad" else ".6g"  # angles line up at the point
    unit, values = column.convert(units)
    return {f"{heading}\n{unit}": write_cells(values, form)}


def _list_names(solution: Solution) -> Iterator[str]:
    """List the names of the columns of a table, most wanted first.

    A vector has its components, and a force its size first; a pin force has that alone.
    """
    scene = solution.scene
    names = ["theta_2", COUPLE.value, LINE.value]
    if leaves_range(solution).any():
        names += read_drive_demand(solution).keys[2:]
    names += ["power", *PIN_FORCES]
    names += solution.points
    names += [f"v_{name}" for name in solution.velocity]
    names += [f"a_{name}" for name in solution.acceleration]
    names += [*ANGLES, "stroke", "stroke_speed", *RATES, "sin_mu"]
    known = {*list_column_quantities(solution)}
    if scene.motion.free is not None:  # its torque is rounding
        known -= {COUPLE.value, LINE.value, "power"}
    if solution.time is None:  # the rates that are commanded
        bar = solution.commanded[-1]
        known -= {f"omega_{bar}", f"alpha_{bar}"}
    if solution.time is not None or compute_times(scene, solution.at) is not None:
        known.add("time")
        names.insert(0 if solution.time is not None else len(names), "time")
    for name in (*names, *list_derived_names(solution)):
        if name not in known:
            continue
        if is_scalar(name) or has_size(name):
            yield name
        if not is_scalar(name) and name not in PIN_FORCES:
            yield from (f"{name}_x", f"{name}_y")


def write_cells(values: Array, form: str = ".6g") -> list[str]:
    """Write six digits, or another form.

    A dash stands for no value, 0 for the rounding of the others.
    """
    sizes = np.abs(values[np.isfinite(values)])
    # not the largest, which may stand beside a pole
    usual = float(np.percentile(sizes, 90.0)) if sizes.size else 0.0
    return [write_cell(value, form) for value in drop_rounding(values, usual).tolist()]


@contextmanager
def show_running(text: str) -> Iterator[Callable[[float], None] | None]:
    """Move a line on standard error while the body runs.

    Nothing is written if it is no terminal. Yields what the body may report the share
    that is done to; None where there is no terminal.
    """
    from rich.console import Console

    console = Console(stderr=True)
    if not console.is_terminal:
        yield None
        return
    with console.status(f"{text}; Ctrl-C stops it") as line:
        yield lambda share: line.update(
            f"{text}, {100.0 * share:.0f} % done; Ctrl-C stops it"
        )
