"""`published`: the thesis's torque error by error, then every printed figure.

Ours stand beside them, and differences are explained.
"""

from collections import Counter
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import click

from fourbar.errors import FAILED, HOLDS, needing
from fourbar.writing import write_text
from fourbar_validation.places import HARNESS_PROGRAM
from fourbar_validation.published.printed_figures import (
    ERRATA,
    FIGURE_VERDICTS,
    PublishedFigure,
    read_printed,
)
from fourbar_validation.published.textbook import compare_textbooks, compute_worksheet
from fourbar_validation.published.thesis import (
    LADDER,
    ThesisProgram,
    compute_tables,
    find_noise,
)
from fourbar_validation.report.sentences import make_words_table
from fourbar_validation.report.templating import render

PAGE_WIDTH = 78


def list_figures() -> Iterator[PublishedFigure]:
    """List every published figure.

    The sources are the thesis, the Maple worksheet, and public test cases.
    """
    noise = find_noise()
    for table, figures in read_printed().items():
        for name, (text, errata) in figures.items():
            ours, made = (
                compute_worksheet() if table == "Maple" else compute_tables(ids)[table]
                for ids in ((), errata)
            )
            apart = noise.get(table, {}).get(name, 0.0)
            yield PublishedFigure(
                table, name, text, ours[name], errata, made[name], apart
            )
    yield from compare_textbooks()


def is_explained(figure: PublishedFigure) -> bool:
    """Return whether a difference has errata that give the published digits.

    A misprint that no erratum can give is explained too.
    """
    if not figure.errata or not set(figure.errata) <= set(ERRATA):
        return False
    return figure.reproduced() or not all(
        ERRATA[name].reproduced for name in figure.errata
    )


def explain_difference(figure: PublishedFigure) -> str:
    """Explain in a phrase why a figure differs."""
    if not figure.errata or not set(figure.errata) <= set(ERRATA):
        return "no erratum explains this"
    if len(figure.errata) > 3 and set(figure.errata) <= set(LADDER):
        text = "#" + " #".join(figure.errata) + ", the steps of the table above"
    else:
        text = "; ".join(f"#{name} {ERRATA[name].title}" for name in figure.errata)
    if figure.reproduced():
        decimals = len(figure.printed.partition(".")[2])
        return f"{text}: gives {figure.made:.{min(decimals + 1, 12)}f}"
    if is_explained(figure):
        return f"{text} (no computation gives these digits)"
    return f"{text}: does not give this"


def compare_figures(show_all: bool) -> int:
    """Compare the figures of the sources with ours.

    Return 1 on a difference that no erratum explains.
    """
    from rich.console import Console

    from fourbar.show.folded import FoldedTable
    from fourbar.show.lines import wrap_line

    console = Console(highlight=False, markup=False)
    page = min(PAGE_WIDTH, console.width)
    which = "" if show_all else " that differ from ours, and why"
    console.print(f"Printed figures{which}:")
    figures = list(list_figures())
    differing = [figure for figure in figures if figure.verdict() == "differs"]
    for figure in figures if show_all else differing:
        verdict = figure.verdict()
        differs = verdict == "differs"
        ours = f"ours {figure.ours:.10g}" + f", {verdict}" * (not differs)
        line = f"{figure.table}: {figure.name}  printed {figure.printed}  {ours}"
        click.echo("\n".join(wrap_line(line, console.width)))
        if differs:
            why = explain_difference(figure)
            click.echo(click.wrap_text(why, page, "    ", "    "))
    met = {erratum for figure in differing for erratum in figure.errata}
    unexplained = [figure for figure in differing if not is_explained(figure)]
    reproduced = sum(figure.reproduced() for figure in differing)
    counts = Counter((figure.table, figure.verdict()) for figure in figures)
    total = FoldedTable("table", *FIGURE_VERDICTS, title="Printed figures against ours")
    tables = dict.fromkeys(figure.table for figure in figures)
    rows = [[counts[table, one] for one in FIGURE_VERDICTS] for table in tables]
    for table, row in zip(tables, rows, strict=True):
        total.add_row(table, *map(str, row))
    total.add_section()
    sums = [sum(column) for column in zip(*rows, strict=True)] or [0, 0, 0]
    total.add_row(f"{len(figures)} figures", *map(str, sums))
    console.print(total)
    misprints = sums[2] - reproduced - len(unexplained)
    summary = (
        "A figure is rounded or truncated if ours, rounded or cut to its digits,"
        f" equals it. {sums[2]} figures differ: the errata named reproduce {reproduced}"
        f" of them digit for digit, and {misprints} are misprints."
    )
    click.echo(click.wrap_text(summary, page) + "\n")
    console.print("The errata met above (all: errata.toml of published/):")
    for name, erratum in ERRATA.items():
        if name in met:
            text = (
                f"#{name} {erratum.where}: printed {erratum.printed}. Right:"
                f" {erratum.right}. "
            )
            text += f"Why: {erratum.derivation}. Effect: {erratum.effect}."
            click.echo(click.wrap_text(text, page, "", "    "))
    if unexplained:
        console.print(f"No erratum explains {len(unexplained)} of the differences.")
    if not figures:
        console.print("Nothing was compared: there is no figure.")
    if unexplained or not figures:
        return FAILED
    return HOLDS


ERRATA_HEADINGS = (
    "error of its program, added to those above",
    "right",
    "T4 [N cm]",
    "F12x [N]",
    "F12y [N]",
)


def list_ladder_rows() -> list[tuple[str, ...]]:
    """List the rows from our answer to the two published ones, error by error.

    The first row is right: 309.309 N cm and (7.033, -2.121) N. The last two are what
    the manual and section 5.7 print: 308.804 N cm and (161.418, -156.506) N. After each
    of these answers stand the figures as printed.
    """
    printed = read_printed()
    tables = {"manual": printed["manual, unknowns"], "5b": printed["5.7 unknowns"]}

    def write(T4: float, *F12: float) -> tuple[str, ...]:
        return (f"{T4:.9f}", *(f"{component:.3f}" for component in F12))

    names = ("T4", "F12x", "F12y")
    rows: list[tuple[str, ...]] = []
    for step, erratum in enumerate(("", *LADDER)):
        x = ThesisProgram(LADDER[:step]).unknowns()
        did = "nothing wrong: SI, uniform bars m (L^2 + w^2)/12"
        right = "the answer of this project"
        if erratum in ERRATA:
            did = f"#{erratum} {ERRATA[erratum].title}"
            right = ERRATA[erratum].right
        elif erratum:
            did = "I_G3, I_G4 as printed in the manual, ten digits"
            right = "see #3"
        rows.append((did, right, *write(*(x[name] for name in names))))
        if table := tables.get(erratum):
            unknowns = [float(table[name].printed) for name in names]
            rows.append(("", "as printed:", *write(*unknowns)))
    return rows


@click.command()
@click.option("--all", "show_all", is_flag=True, help="List every figure.")
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Write the steps as Markdown.",
)
def published(show_all: bool, out: Path | None) -> int:
    """Compare the figures of the sources with ours.

    Exit with status 1 on a difference that no erratum explains.
    """
    from rich.console import Console

    # a missing library of the last source is noticed before the first is printed
    with needing("a free motion among the sources needs SciPy", "validation"):
        import_module("scipy.integrate")
    rows = list_ladder_rows()
    title = "The published torque, error by error"
    table = make_words_table(ERRATA_HEADINGS, rows, 2, title=title, show_lines=True)
    Console().print(table)
    if out is not None:
        head = {"head": ERRATA_HEADINGS, "rows": rows, "program": HARNESS_PROGRAM}
        write_text(out, render("fourbar_validation.published", "ladder.md.j2", **head))
    return compare_figures(show_all)
