"""`published`: the thesis's torque error by error, then every printed figure against ours."""

from collections.abc import Mapping
from importlib import import_module
from pathlib import Path

import click

from fourbar.errors import DependencyError, say_install
from fourbar.writing import write_text
from fourbar_validation.places import PROGRAM
from fourbar_validation.published.comparison import check
from fourbar_validation.published.figures import ERRATA
from fourbar_validation.published.program import climb_ladder, read_printed
from fourbar_validation.report.templating import render
from fourbar_validation.report.terminal import make_table

HEAD = ("what its program did, one error after another", "right", "T4 [N cm]", "F12x [N]", "F12y [N]")


def list_ladder_rows() -> list[tuple[str, ...]]:
    """List the rows from our answer to the two published ones, error by error, each of these with its printed figures.

    The first row is right: 309.309 N cm and (7.033, -2.121) N. The last two are what the manual and
    section 5.7 print: 308.804 N cm and (161.418, -156.506) N.
    """
    source = read_printed()["published"]
    tables = {"manual": source["manual_program_dynamic"], "5b": source["section_5_7_hand_solution"]}

    def write(figures: Mapping[str, str | float]) -> tuple[str, ...]:
        return (f"{float(figures['T4']):.9f}", f"{float(figures['F12x']):.3f}", f"{float(figures['F12y']):.3f}")

    rows = []
    for erratum, x in climb_ladder():
        did, right = "nothing wrong: SI, uniform bars m (L^2 + w^2)/12", "the answer of this project"
        if erratum in ERRATA:
            did, right = f"#{erratum} {ERRATA[erratum].title}", ERRATA[erratum].right
        elif erratum:
            did, right = "I_G3, I_G4 as printed in the manual, ten digits", "see #3"
        rows.append((did, right, *write(x)))
        if erratum in tables:
            rows.append(("", "as printed:", *write(tables[erratum])))
    return rows


@click.command()
@click.option("--all", "show_all", is_flag=True, help="List every figure.")
@click.option("-o", "--out", type=click.Path(path_type=Path, dir_okay=False), help="Write the steps as Markdown.")
def published(show_all: bool, out: Path | None) -> int:
    """Compare the figures of the sources with ours; exit 1 on a difference that no erratum explains."""
    from rich.console import Console

    try:  # a missing requirement of the last source is noticed before the first is printed
        import_module("scipy.integrate")
    except ModuleNotFoundError:
        raise DependencyError(f"a free motion among the sources needs SciPy: {say_install('validation')}") from None
    rows = list_ladder_rows()
    Console().print(make_table(HEAD, rows, 2, title="The published torque, error by error", show_lines=True))
    if out is not None:
        write_text(out, render("fourbar_validation.published", "ladder.md.j2", head=HEAD, rows=rows, program=PROGRAM))
    return check(show_all)
