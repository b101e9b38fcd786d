"""Printed figures against ours, every difference bound to named errata."""

from collections import Counter
from collections.abc import Iterator

import click

from fourbar.errors import FAILED, HOLDS
from fourbar_validation.published.figures import ERRATA, VERDICTS, PublishedFigure
from fourbar_validation.published.program import STEPS
from fourbar_validation.published.textbook import compare_maple, compare_textbooks
from fourbar_validation.published.thesis_dynamics import list_dynamics
from fourbar_validation.published.thesis_positions import list_position_figures

WIDTH = 78


def list_figures() -> Iterator[PublishedFigure]:
    """List every published figure: the thesis, the Maple worksheet, public test cases."""
    yield from list_position_figures()
    yield from list_dynamics()
    yield from compare_maple()
    yield from compare_textbooks()


def is_explained(figure: PublishedFigure) -> bool:
    """Tell whether a difference has errata that give the published digits, or is a misprint that none can give."""
    if not figure.errata or not set(figure.errata) <= set(ERRATA):
        return False
    return figure.reproduced() or not all(ERRATA[name].reproduced for name in figure.errata)


def explain_difference(figure: PublishedFigure) -> str:
    """Why a figure differs, in a phrase."""
    if not figure.errata or not set(figure.errata) <= set(ERRATA):
        return "no erratum explains this"
    steps = tuple(name for name, _, _ in STEPS if name in ERRATA)
    if len(figure.errata) > 3 and set(figure.errata) <= set(steps):
        text = "#" + " #".join(figure.errata) + ", the steps of the table above"
    else:
        text = "; ".join(f"#{name} {ERRATA[name].title}" for name in figure.errata)
    if figure.reproduced():
        decimals = len(figure.printed.partition(".")[2])
        return f"{text}: gives {figure.made:.{min(decimals + 1, 12)}f}"
    return f"{text} (no computation gives these digits)" if is_explained(figure) else f"{text}: does not give this"


def check(show_all: bool) -> int:
    """Compare the figures of the sources with ours; 1 on a difference that no erratum explains."""
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False, markup=False)
    counts: Counter[tuple[str, str]] = Counter()
    met: Counter[str] = Counter()
    unexplained, reproduced = [], 0
    console.print("Printed figures that differ from ours, and why:" if not show_all else "Printed figures:")
    for figure in list_figures():
        verdict = figure.verdict()
        counts[figure.table, verdict] += 1
        if verdict == "differs":
            met.update(figure.errata)
            reproduced += figure.reproduced()
            if not is_explained(figure):
                unexplained.append(figure)
        if verdict == "differs" or show_all:
            ours = f"ours {figure.ours:.10g}" + ("" if verdict == "differs" else f", {verdict}")
            click.echo(f"{figure.table}: {figure.name}  printed {figure.printed}  {ours}")
        if verdict == "differs":
            click.echo(click.wrap_text(explain_difference(figure), WIDTH, "    ", "    "))
    total = Table(*("table", *VERDICTS), title="Printed figures against ours")
    for table in dict.fromkeys(key[0] for key in counts):
        total.add_row(table, *(str(counts[table, verdict]) for verdict in VERDICTS))
    total.add_section()
    sums = [sum(n for (_, v), n in counts.items() if v == verdict) for verdict in VERDICTS]
    total.add_row(f"{sum(sums)} figures", *map(str, sums))
    console.print(total)
    misprints = sums[2] - reproduced - len(unexplained)
    summary = (
        "Rounded, truncated: ours, rounded or cut to the digits printed, is what is printed. "
        f"Of the {sums[2]} that differ {reproduced} are what the errata named make of ours, digit for digit; "
        f"{misprints} are misprints."
    )
    click.echo(click.wrap_text(summary, WIDTH) + "\n")
    console.print("The errata met above (all: errata.toml of published/):")
    for name, erratum in ERRATA.items():
        if met[name]:
            text = f"#{name} {erratum.where}: printed {erratum.printed}. Right: {erratum.right}. "
            text += f"Why: {erratum.derivation}. Effect: {erratum.effect}."
            click.echo(click.wrap_text(text, WIDTH, "", "    "))
    if unexplained:
        console.print(f"{len(unexplained)} differences are not explained by an erratum")
    if not sum(sums):
        console.print("Nothing was compared: there is no figure")
    return FAILED if unexplained or not sum(sums) else HOLDS
