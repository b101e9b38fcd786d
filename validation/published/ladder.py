"""`python -m validation published`: printed figures against ours, every difference bound to named errata."""

from collections import Counter
from collections.abc import Iterator
from typing import Any, NamedTuple

import click

from fourbar.errors import FAILED, HOLDS
from validation.published.figures import ERRATA, VERDICTS, Figure
from validation.published.program import STEPS, ladder, printed
from validation.published.textbook import maple_figures, textbook_figures
from validation.published.thesis_dynamics import dynamics_figures
from validation.published.thesis_positions import position_figures

WIDTH = 78


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


def ladder_rows() -> list[LadderRow]:
    """List the rows from our answer to the two published ones, error by error.

    The first row is right: 309.309 N cm and (7.033, -2.121) N. The last two are what the manual and
    section 5.7 print: 308.804 N cm and (161.418, -156.506) N.
    """
    source = printed()["published"]
    tables = {"manual": source["manual_program_dynamic"], "5b": source["section_5_7_hand_solution"]}
    rows = []
    for erratum, x in ladder():
        did, right = "nothing wrong: SI, uniform bars m (L^2 + w^2)/12", "the answer of this project"
        if erratum in ERRATA:
            did, right = ERRATA[erratum].title, ERRATA[erratum].right
        elif erratum:
            did, right = "I_G3, I_G4 as printed in the manual, ten digits", "see #3"
        published = tables.get(erratum)
        digits = {name: published[name] for name in ("T4", "F12x", "F12y")} if published else None
        rows.append(LadderRow(erratum, did, right, x["T4"], (x["F12x"], x["F12y"]), digits))
    return rows


def figures() -> Iterator[Figure]:
    """List every published figure: the thesis, the Maple worksheet, public test cases."""
    yield from position_figures()
    yield from dynamics_figures()
    yield from maple_figures()
    yield from textbook_figures()


def explained(figure: Figure) -> bool:
    """Tell whether a difference has errata that give the published digits, or is a misprint that none can give."""
    if not figure.errata or not set(figure.errata) <= set(ERRATA):
        return False
    return figure.reproduced() or not all(ERRATA[name].reproduced for name in figure.errata)


def reason(figure: Figure) -> str:
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
    return f"{text} (no computation gives these digits)" if explained(figure) else f"{text}: does not give this"


def show_ladder(console: Any) -> None:
    """Print the table of the published torque, error by error."""
    from rich.table import Table

    table = Table(title="The published torque, error by error", show_lines=True)
    table.add_column("what the program did", ratio=3)
    table.add_column("what is right", ratio=3)
    for name in ("T4, N cm", "F12, N"):
        table.add_column(name, justify="right", no_wrap=True)
    for row in ladder_rows():
        torque = f"{row.torque:.9f}"
        if row.published:
            torque += f"\nprinted {float(row.published['T4']):.9f}"
        force = f"{row.F12[0]:.6f}\n{row.F12[1]:.6f}"
        table.add_row((f"#{row.erratum} " if row.erratum in ERRATA else "") + row.did, row.right, torque, force)
    console.print(table)


@click.command()
@click.option("--all", "show_all", is_flag=True, help="List every figure.")
def published(show_all: bool) -> int:
    """Compare the figures of the sources with ours; exit 1 on a difference that no erratum explains."""
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False, markup=False)
    show_ladder(console)
    counts: Counter[tuple[str, str]] = Counter()
    named: Counter[str] = Counter()
    unexplained, reproduced = [], 0
    console.print("\nPrinted figures that differ from ours, and why:" if not show_all else "\nPrinted figures:")
    for figure in figures():
        verdict = figure.verdict()
        counts[figure.table, verdict] += 1
        if verdict == "differs":
            named.update(figure.errata)
            reproduced += figure.reproduced()
            if not explained(figure):
                unexplained.append(figure)
        if verdict == "differs" or show_all:
            ours = f"ours {figure.ours:.10g}" + ("" if verdict == "differs" else f", {verdict}")
            click.echo(f"{figure.table}: {figure.name}  printed {figure.printed}  {ours}")
        if verdict == "differs":
            click.echo(click.wrap_text(reason(figure), WIDTH, "    ", "    "))
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
    console.print("The errata met above (all: validation/published/errata.toml):")
    for name, erratum in ERRATA.items():
        if named[name]:
            text = f"#{name} {erratum.where}: printed {erratum.printed}. Right: {erratum.right}. "
            text += f"Why: {erratum.derivation}. Effect: {erratum.effect}."
            click.echo(click.wrap_text(text, WIDTH, "", "    "))
    if unexplained:
        console.print(f"{len(unexplained)} differences are not explained by an erratum")
    if not sum(sums):
        console.print("Nothing was compared: there is no figure")
    return FAILED if unexplained or not sum(sums) else HOLDS
