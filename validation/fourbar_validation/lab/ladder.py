"""`published`: the thesis's torque error by error, then every printed figure against ours."""

from pathlib import Path
from typing import Any, NamedTuple

import click

from fourbar.writing import write_text
from fourbar_validation.places import PROGRAM
from fourbar_validation.published.comparison import check
from fourbar_validation.published.figures import ERRATA
from fourbar_validation.published.program import climb_ladder, read_printed
from fourbar_validation.report.templating import render


class LadderRow(NamedTuple):
    """The model mechanism's torque and force at O2 after one more erratum of the thesis."""

    erratum: str
    """Its id; "" for the right answer."""
    did: str
    """What the program did."""
    right: str
    """What is right."""
    torque: float
    """T4, N cm."""
    F12: tuple[float, float]
    """N."""
    published: dict[str, str] | None = None
    """T4, F12x and F12y as printed, where the thesis prints the result of this row."""


def list_ladder_rows() -> list[LadderRow]:
    """From our answer to the two published ones, error by error: rows of `LadderRow`.

    The first row is right: 309.309 N cm and (7.033, -2.121) N. The last two are what the manual and
    section 5.7 print: 308.804 N cm and (161.418, -156.506) N.
    """
    source = read_printed()["published"]
    tables = {"manual": source["manual_program_dynamic"], "5b": source["section_5_7_hand_solution"]}
    rows = []
    for erratum, x in climb_ladder():
        did, right = "nothing wrong: SI, uniform bars m (L^2 + w^2)/12", "the answer of this project"
        if erratum in ERRATA:
            did, right = ERRATA[erratum].title, ERRATA[erratum].right
        elif erratum:
            did, right = "I_G3, I_G4 as printed in the manual, ten digits", "see #3"
        published = tables.get(erratum)
        digits = {name: published[name] for name in ("T4", "F12x", "F12y")} if published else None
        rows.append(LadderRow(erratum, did, right, x["T4"], (x["F12x"], x["F12y"]), digits))
    return rows


def show_ladder(console: Any) -> None:
    """Tabulate the published torque, error by error."""
    from rich.table import Table

    table = Table(title="The published torque, error by error", show_lines=True)
    table.add_column("what the program did", ratio=3)
    table.add_column("what is right", ratio=3)
    for name in ("T4, N cm", "F12, N"):
        table.add_column(name, justify="right", no_wrap=True)
    for row in list_ladder_rows():
        torque = f"{row.torque:.9f}"
        if row.published:
            torque += f"\nprinted {float(row.published['T4']):.9f}"
        force = f"{row.F12[0]:.6f}\n{row.F12[1]:.6f}"
        table.add_row((f"#{row.erratum} " if row.erratum in ERRATA else "") + row.did, row.right, torque, force)
    console.print(table)


@click.command()
@click.option("--all", "show_all", is_flag=True, help="List every figure.")
@click.option("-o", "--out", type=click.Path(path_type=Path, dir_okay=False), help="Write the steps as Markdown.")
def published(show_all: bool, out: Path | None) -> int:
    """Compare the figures of the sources with ours; exit 1 on a difference that no erratum explains."""
    from rich.console import Console

    console = Console(highlight=False, markup=False)
    show_ladder(console)
    console.print()
    if out is not None:
        write_text(out, render("fourbar_validation.lab", "ladder.md.j2", rows=list_ladder_rows(), program=PROGRAM))
    return check(show_all)
