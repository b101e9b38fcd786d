"""`published`: the thesis's torque error by error, then every printed figure.

Ours stand beside them, and differences are explained.
"""

import re
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import click
import numpy as np

from fourbar.errors import FAILED, HOLDS
from fourbar.formulas.mobility import TURN
from fourbar.show.lines import wrap_line
from fourbar.writing import write_text
from fourbar_validation.places import HARNESS_PROGRAM
from fourbar_validation.published.printed_figures import (
    ERRATA,
    FIGURE_VERDICTS,
    PublishedFigure,
    compare_figure,
    read_printed,
)
from fourbar_validation.published.thesis import (
    LADDER,
    compute_model,
    compute_results,
)
from fourbar_validation.report.sentences import make_words_table
from fourbar_validation.report.templating import render

_TERM = re.compile(r"([-+]?) ?(\w+?)(?:_(x|y|mod|deg|turn|rad))?(?: |$)")
"""Term of a quantity: its sign, the name of a result, and what is taken of a vector."""
_TAKEN: dict[str, Callable[[Any], Any]] = {
    "": np.real,
    "x": np.real,
    "y": np.imag,
    "mod": np.abs,
    "deg": partial(np.angle, deg=True),
    "turn": lambda vector: np.angle(vector, deg=True) % 360.0,
    "rad": lambda vector: np.angle(vector) % TURN,
}
"""Component, size and direction: from -180 to 180 deg, and within one turn."""
PAGE_WIDTH = 78
_ERRATUM = (
    "#{id} {where}: printed {printed}. Right: {right}. Why: {derivation}. Effect:"
    " {effect}."
)
REPRODUCED, MISPRINT, UNEXPLAINED = "reproduced", "misprint", "unexplained"
"""Differences that their errata give, that no computation can give, and others."""


def list_figures() -> Iterator[PublishedFigure]:
    """List every published figure.

    The sources are the thesis, the Maple worksheet, and public test cases.
    """
    for figure in read_printed():
        ours, made = (_compute(figure, errata) for errata in ((), figure.errata))
        yield figure._replace(ours=ours, made=made)


def _compute(figure: PublishedFigure, errata: tuple[str, ...]) -> float:
    """Compute a figure, a result of ours or the sum of several, with errata made."""
    results = compute_results(errata, figure.scene)
    total = 0.0
    for sign, name, part in _TERM.findall(figure.quantity):
        value = np.atleast_1d(results[name])[figure.position]
        term = _TAKEN[part](complex(*np.ravel(value)))
        total += -term if sign == "-" else term
    return float(total)


def explain_difference(figure: PublishedFigure) -> tuple[str, str]:
    """Tell what a difference is, and explain in a phrase why a figure differs."""
    if not figure.errata:
        return UNEXPLAINED, "no erratum explains this"
    text = "; ".join(f"#{name} {ERRATA[name]['title']}" for name in figure.errata)
    if len(figure.errata) > 3 and set(figure.errata) <= set(LADDER):
        text = "#" + " #".join(figure.errata) + ", the steps of the table above"
    if compare_figure(figure.printed, figure.made, figure.noise) != "differs":
        decimals = len(figure.printed.partition(".")[2])
        return REPRODUCED, f"{text}: gives {figure.made:.{min(decimals + 1, 12)}f}"
    if all(ERRATA[name].get("reproduced", True) for name in figure.errata):
        return UNEXPLAINED, f"{text}: does not give this"
    return MISPRINT, f"{text} (no computation gives these digits)"


def compare_figures(figures: list[PublishedFigure], show_all: bool) -> int:
    """Compare the figures of the sources with ours.

    Return 1 on a difference that no erratum explains.
    """
    from rich.console import Console

    console = Console(highlight=False, markup=False)
    page = min(PAGE_WIDTH, console.width)
    which = "" if show_all else " that differ from ours, and why"
    console.print(f"Printed figures{which}:")
    differing = [figure for figure in figures if figure.verdict() == "differs"]
    kinds: Counter[str] = Counter()
    for figure in figures if show_all else differing:
        line = f"{figure.table}: {figure.name}  printed {figure.printed}"
        line += f"  ours {figure.ours:.10g}"
        if figure not in differing:
            line += f", {figure.verdict()}"
        click.echo("\n".join(wrap_line(line, console.width)))
        if figure in differing:
            kind, why = explain_difference(figure)
            kinds[kind] += 1
            click.echo(click.wrap_text(why, page, "    ", "    "))
    verdicts = [(figure.table, figure.verdict()) for figure in figures]
    every = [("every table", verdict) for _, verdict in verdicts]
    counts = Counter(verdicts + every)
    rows = [
        (table, *(str(counts[table, verdict]) for verdict in FIGURE_VERDICTS))
        for table in dict(verdicts + every)
    ]
    console.print(make_words_table(("table", *FIGURE_VERDICTS), rows))
    summary = (
        "A figure is rounded or truncated if ours, rounded or cut to its digits,"
        f" equals it. {len(differing)} figures differ: the errata named reproduce"
        f" {kinds[REPRODUCED]} of them digit for digit, and {kinds[MISPRINT]} are"
        " misprints."
    )
    click.echo(click.wrap_text(summary, page) + "\n")
    console.print("The errata met above (all: errata.toml of published/):")
    met = {name for figure in differing for name in figure.errata}
    for name in filter(met.__contains__, ERRATA):
        text = _ERRATUM.format_map(ERRATA[name])
        click.echo(click.wrap_text(text, page, "", "    "))
    if kinds[UNEXPLAINED]:
        console.print(f"No erratum explains {kinds[UNEXPLAINED]} of the differences.")
    elif not figures:
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
    steps += [
        (f"#{name} {ERRATA[name]['title']}", ERRATA[name]["right"]) for name in LADDER
    ]
    for count, did in enumerate(steps):
        model = compute_model(LADDER[:count])
        force = model["F12"]
        yield (*did, f"{model['T4']:.9f}", f"{force.real:.3f}", f"{force.imag:.3f}")


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
    figures = [*list_figures()]
    rows = [*list_ladder_rows()]
    title = "The published torque, error by error"
    table = make_words_table(ERRATA_HEADINGS, rows, 2, title=title, show_lines=True)
    Console().print(table)
    if out is not None:
        head = {"head": ERRATA_HEADINGS, "rows": rows, "program": HARNESS_PROGRAM}
        write_text(out, render("fourbar_validation.published", "ladder.md.j2", **head))
    return compare_figures(figures, show_all)
