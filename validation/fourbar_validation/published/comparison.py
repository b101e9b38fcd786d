"""`published`: the thesis's torque error by error, then every printed figure.

Ours stand beside them, and differences are explained.
"""

from collections import Counter
from collections.abc import Iterator, Mapping
from importlib import import_module
from pathlib import Path

import click

from fourbar.errors import FAILED, HOLDS, needing
from fourbar.show.folded import FoldedTable
from fourbar.show.lines import wrap_line
from fourbar.writing import write_text
from fourbar_validation.places import HARNESS_PROGRAM
from fourbar_validation.published.printed_figures import (
    ERRATA,
    FIGURE_VERDICTS,
    PublishedFigure,
    read_printed,
)
from fourbar_validation.published.textbook import compare_textbooks
from fourbar_validation.published.thesis import (
    AS_PRINTED,
    LADDER,
    compute_model,
    compute_numbers,
)
from fourbar_validation.report.sentences import make_words_table
from fourbar_validation.report.templating import render

PAGE_WIDTH = 78


def list_figures() -> Iterator[PublishedFigure]:
    """List every published figure.

    The sources are the thesis, the Maple worksheet, and public test cases.
    """
    ours = compute_numbers()
    for table, figures in read_printed().items():
        for name, (text, errata, noise) in figures.items():
            made = errata
            if errata and table == "manual, unknowns":
                made = (*errata, AS_PRINTED)
            wrong = compute_numbers(made)[name]
            yield PublishedFigure(table, name, text, ours[name], errata, wrong, noise)
    yield from compare_textbooks()


def is_explained(figure: PublishedFigure) -> bool:
    """Return whether a difference has errata that give the published digits.

    A misprint that no erratum can give is explained too.
    """
    known = all(ERRATA[name].reproduced for name in figure.errata)
    return bool(figure.errata) and (figure.reproduced() or not known)


def explain_difference(figure: PublishedFigure) -> str:
    """Explain in a phrase why a figure differs."""
    if not figure.errata:
        return "no erratum explains this"
    text = "; ".join(f"#{name} {ERRATA[name].title}" for name in figure.errata)
    if len(figure.errata) > 3 and set(figure.errata) <= set(LADDER):
        text = "#" + " #".join(figure.errata) + ", the steps of the table above"
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

    console = Console(highlight=False, markup=False)
    page = min(PAGE_WIDTH, console.width)
    which = "" if show_all else " that differ from ours, and why"
    console.print(f"Printed figures{which}:")
    counts: dict[str, Counter[str]] = {}
    differing = []
    for figure in list_figures():
        verdict = figure.verdict()
        counts.setdefault(figure.table, Counter())[verdict] += 1
        line = f"{figure.table}: {figure.name}  printed {figure.printed}"
        line += f"  ours {figure.ours:.10g}" + f", {verdict}" * (verdict != "differs")
        if show_all or verdict == "differs":
            click.echo("\n".join(wrap_line(line, console.width)))
        if verdict == "differs":
            differing.append(figure)
            why = explain_difference(figure)
            click.echo(click.wrap_text(why, page, "    ", "    "))
    sums = sum(counts.values(), Counter())
    total = FoldedTable("table", *FIGURE_VERDICTS, title="Printed figures against ours")
    for table, row in counts.items():
        total.add_row(table, *(str(row[one]) for one in FIGURE_VERDICTS))
    total.add_section()
    every = f"{sums.total()} figures"
    total.add_row(every, *(str(sums[one]) for one in FIGURE_VERDICTS))
    console.print(total)
    explained = [figure for figure in differing if is_explained(figure)]
    unexplained = len(differing) - len(explained)
    reproduced = sum(figure.reproduced() for figure in explained)
    misprints = len(explained) - reproduced
    summary = (
        "A figure is rounded or truncated if ours, rounded or cut to its digits,"
        f" equals it. {len(differing)} figures differ: the errata named reproduce"
        f" {reproduced} of them digit for digit, and {misprints} are misprints."
    )
    click.echo(click.wrap_text(summary, page) + "\n")
    console.print("The errata met above (all: errata.toml of published/):")
    met = {name for figure in differing for name in figure.errata}
    for name, erratum in ERRATA.items():
        if name in met:
            text = (
                f"#{name} {erratum.where}: printed {erratum.printed}. Right:"
                f" {erratum.right}. Why: {erratum.derivation}. Effect:"
                f" {erratum.effect}."
            )
            click.echo(click.wrap_text(text, page, "", "    "))
    if unexplained:
        console.print(f"No erratum explains {unexplained} of the differences.")
    if not counts:
        console.print("Nothing was compared: there is no figure.")
    if unexplained or not counts:
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
    names = ("T4", "F12x", "F12y")

    def write(*did: str, of: Mapping[str, float]) -> tuple[str, ...]:
        torque, *forces = (of[name] for name in names)
        return (*did, f"{torque:.9f}", *(f"{force:.3f}" for force in forces))

    first = "nothing wrong: SI, uniform bars m (L^2 + w^2)/12"
    rows = [write(first, "the answer of this project", of=compute_model())]
    printed = {AS_PRINTED: "manual, unknowns", "5b": "5.7 unknowns"}
    for step, name in enumerate(LADDER, 1):
        did = ("I_G3, I_G4 as printed in the manual, ten digits", "see #3")
        if name in ERRATA:
            did = (f"#{name} {ERRATA[name].title}", ERRATA[name].right)
        rows.append(write(*did, of=compute_model(LADDER[:step])))
        if name in printed:
            figures = read_printed()[printed[name]].items()
            as_printed = {unknown: float(figure.printed) for unknown, figure in figures}
            rows.append(write("", "as printed:", of=as_printed))
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
