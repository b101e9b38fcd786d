"""`python -m validation check SCENE THEIRS.csv`: judge a user's own torques and forces."""

import math
from collections import Counter
from pathlib import Path

import click

from fourbar.errors import InputError
from fourbar.files import load
from fourbar.writing import require_file, write_text
from fourbar_validation.check.judge import Allowance, Discrepancy
from fourbar_validation.check.judgement import Judgement, judge_table, write_json, write_junit
from fourbar_validation.check.mistakes import NEARER, Explanation
from fourbar_validation.check.problem import check_problem
from fourbar_validation.check.theirs import TheirTable, read_table
from fourbar_validation.compare.rows import make_plain
from fourbar_validation.report.terminal import make_table

SHOWN = 3


def write_extent(explanation: Explanation) -> str:
    """Write how far a mistake explains what differs."""
    if explanation.complete:
        return "explains everything that differs: " + ", ".join(explanation.quantities)
    parts = []
    if explanation.quantities:
        parts.append("explains " + ", ".join(explanation.quantities))
    if explanation.nearer:
        parts.append(", ".join(explanation.nearer) + f" then at least {NEARER:g} times nearer")
    return "; ".join(parts)


@click.command()
@click.argument("scene", type=click.Path(path_type=Path))
@click.argument("theirs", type=click.Path(path_type=Path))
@click.option("--rtol", type=float, metavar="R", help="Allow this part of each number too.")
@click.option("--atol", type=float, metavar="A", help="Allow this too, in the SI unit of each quantity.")
@click.option("--json", type=click.Path(path_type=Path, dir_okay=False), help="Write it as JSON too.")
@click.option("--junit", type=click.Path(path_type=Path, dir_okay=False), help="Write it as JUnit too.")
def check(
    scene: Path, theirs: Path, rtol: float | None, atol: float | None, json: Path | None, junit: Path | None
) -> int:
    """Judge a table of torques and forces (THEIRS.csv) against the formulas, row by row.

    `check PROBLEM.json RESULT.json` judges the answers to a problem of models/problems, by its levels of accuracy.

    Columns are named as by `fourbar analyze --csv`, whose file is read as it is; a unit may follow in
    brackets: theta_2 [deg], torque [lbf ft], F12_x, F12_y, F43 [kN] (a magnitude). A spreadsheet's
    semicolons and blank cells are understood. Half a unit of the last printed digit is allowed; with
    --rtol or --atol these decide, and how many agree exactly is printed too. Where the scene states no
    omega_2 each row is judged at its own omega_2 and alpha_2.
    """
    if scene.suffix == ".json":
        for option, value in (("--rtol", rtol), ("--atol", atol), ("--json", json), ("--junit", junit)):
            if value is not None:
                raise InputError(option, str(value), "is of a table: a problem has its own levels")
        return check_problem(scene, theirs)
    table = read_table(theirs)
    for path in (json, junit):
        if path is not None:
            require_file(path, scene, theirs)
    for option, value in (("--rtol", rtol), ("--atol", atol)):
        if value is not None and not 0.0 <= value < math.inf:
            raise InputError(option, value, "must be a finite number >= 0")
    tolerance = None if rtol is None and atol is None else Allowance(rtol or 0.0, atol or 0.0)
    judgement = judge_table(load(scene), table, tolerance)
    if json is not None:
        write_text(json, write_json(judgement, table))
    if junit is not None:
        write_text(junit, write_junit(judgement, theirs.name))
    show(judgement, table, theirs.name)
    return judgement.status


def show(judgement: Judgement, table: TheirTable, name: str) -> None:
    """Print what differs, what explains it, and the count."""
    from rich.console import Console
    from rich.markup import escape

    console = Console(soft_wrap=True)
    for why in dict.fromkeys(table.left_out.values()):
        headings = ", ".join(heading for heading, reason in table.left_out.items() if reason == why)
        console.print(f"left out ({why}): {escape(make_plain(headings))}")
    differing = judgement.differing
    if differing:
        title = f"{escape(make_plain(name))}: what differs, the {SHOWN} worst of each quantity"
        head = ("line", "theta_2\ndeg", "quantity", "theirs", "ours", "error", "allowed")
        rows = [(str(each.line), f"{math.degrees(each.theta_2):.7g}", *write_in_their_unit(each, table),
                 f"{each.error:.1e}", f"{each.allowed:.1e}") for each in choose_worst(differing)]  # fmt: skip
        console.print(make_table(head, rows, title=title, show_edge=False, padding=(0, 1, 0, 0)))
        counted = Counter(finding.quantity for finding in differing)
        console.print("in all: " + ", ".join(f"{count} of {quantity}" for quantity, count in counted.items()))
    for line in judgement.not_assembled:
        console.print(f"line {line}: the linkage has no motion there (it does not assemble, or is singular)")
    for explanation in judgement.explanations:
        console.print(f"looks like: {escape(explanation.text)} ({write_extent(explanation)})")
    if differing and not any(explanation.complete for explanation in judgement.explanations):
        together = "these together explain all of it" if judgement.together() else "no single known mistake explains it"
        console.print(together)
    console.print(f"[bold]{judgement.sentence()}[/]")


def choose_worst(differing: list[Discrepancy]) -> list[Discrepancy]:
    """Choose the largest differences of each quantity, the worst quantity first."""
    by_quantity: dict[str, list[Discrepancy]] = {}
    for finding in sorted(differing, key=lambda f: -f.error):
        by_quantity.setdefault(finding.quantity, []).append(finding)
    return [finding for findings in by_quantity.values() for finding in findings[:SHOWN]]


def write_in_their_unit(finding: Discrepancy, table: TheirTable) -> tuple[str, ...]:
    """Write the quantity with the unit of their column, and both numbers in it with the digits that set them apart."""
    unit = table.units[next(key for key in table.values if table.label(key) == finding.quantity)]
    theirs, ours = ([x / unit.factor for x in numbers] for numbers in (finding.theirs, finding.ours))
    digits = next((d for d in (4, 6, 9, 12) if any(f"{a:.{d}g}" != f"{b:.{d}g}" for a, b in zip(theirs, ours))), 15)  # noqa: B905
    written = (", ".join(f"{x:.{digits}g}" for x in numbers) for numbers in (theirs, ours))
    return f"{finding.quantity} [{make_plain(unit.text)}]", *written
