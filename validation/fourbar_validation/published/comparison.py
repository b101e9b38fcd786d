"""`published`: the thesis's torque error by error, then every printed figure.

Ours stand beside them, and differences are explained.
"""

from collections import Counter
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import click

from fourbar.errors import FAILED, HOLDS, needing
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
    for figure in read_printed():
        ours, made = (
            compute_numbers(errata)[figure.name] for errata in ((), figure.errata)
        )
        yield figure._replace(ours=ours, made=made)
    yield from compare_textbooks()


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
    if figure.explained():
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
        differs = verdict == "differs"
        line = f"{figure.table}: {figure.name}  printed {figure.printed}"
        line += f"  ours {figure.ours:.10g}" + f", {verdict}" * (not differs)
        if show_all or differs:
            click.echo("\n".join(wrap_line(line, console.width)))
        if differs:
            differing.append(figure)
            why = explain_difference(figure)
            click.echo(click.wrap_text(why, page, "    ", "    "))
    counts["every table"] = sum(counts.values(), Counter())
    rows = (
        (table, *(str(row[verdict]) for verdict in FIGURE_VERDICTS))
        for table, row in counts.items()
    )
    console.print(make_words_table(("table", *FIGURE_VERDICTS), rows))
    explained = [figure for figure in differing if figure.explained()]
    reproduced = sum(figure.reproduced() for figure in explained)
    summary = (
        "A figure is rounded or truncated if ours, rounded or cut to its digits,"
        f" equals it. {len(differing)} figures differ: the errata named reproduce"
        f" {reproduced} of them digit for digit, and {len(explained) - reproduced} are"
        " misprints."
    )
    click.echo(click.wrap_text(summary, page) + "\n")
    console.print("The errata met above (all: errata.toml of published/):")
    met = {name for figure in differing for name in figure.errata}
    for name in filter(met.__contains__, ERRATA):
        erratum = ERRATA[name]
        text = (
            f"#{name} {erratum.where}: printed {erratum.printed}. Right:"
            f" {erratum.right}. Why: {erratum.derivation}. Effect: {erratum.effect}."
        )
        click.echo(click.wrap_text(text, page, "", "    "))
    if unexplained := len(differing) - len(explained):
        console.print(f"No erratum explains {unexplained} of the differences.")
    elif not counts["every table"]:
        console.print("Nothing was compared: there is no figure.")
    else:
        return HOLDS
    return FAILED


ERRATA_HEADINGS = (
    "error of its program, added to those above",
    "right",
    "T4 [N cm]",
    "F12x [N]",
    "F12y [N]",
)


def list_ladder_rows() -> Iterator[tuple[str, ...]]:
    """List the rows from our answer to the two published ones, error by error.

    The first row is right: 309.309 N cm and (7.033, -2.121) N. The last two are what
    the manual and section 5.7 print: 308.804 N cm and (161.418, -156.506) N.
    """
    first = "nothing wrong: SI, uniform bars m (L^2 + w^2)/12"
    steps = [(first, "the answer of this project")]
    steps += [(f"#{name} {ERRATA[name].title}", ERRATA[name].right) for name in LADDER]
    for count, did in enumerate(steps):
        model = compute_model(LADDER[:count])
        forces = (f"{model[name]:.3f}" for name in ("F12x", "F12y"))
        yield (*did, f"{model['T4']:.9f}", *forces)


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
    rows = [*list_ladder_rows()]
    title = "The published torque, error by error"
    table = make_words_table(ERRATA_HEADINGS, rows, 2, title=title, show_lines=True)
    Console().print(table)
    if out is not None:
        head = {"head": ERRATA_HEADINGS, "rows": rows, "program": HARNESS_PROGRAM}
        write_text(out, render("fourbar_validation.published", "ladder.md.j2", **head))
    return compare_figures(show_all)
