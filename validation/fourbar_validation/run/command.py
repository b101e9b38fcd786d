"""`fourbar-validation run`: what is judged, by whom, how, and against what."""

from pathlib import Path
from typing import Any

import click

from fourbar.errors import HOLDS, write_count
from fourbar.writing import write_text
from fourbar_validation.compare.results_file import read_columns
from fourbar_validation.regression.accept import add_output_options, report_differences
from fourbar_validation.regression.record import PARQUET_FILE
from fourbar_validation.report.junit import list_cases, write_document
from fourbar_validation.run.parts import judge_part
from fourbar_validation.run.plan import WORKERS, show_progress
from fourbar_validation.run.request import ALL_TYPES, Request, make_plan
from fourbar_validation.run.run import run


@click.command(name="run")
@click.argument("scenes", nargs=-1, type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("results"),
    show_default=True,
)
@click.option(
    "--engines",
    metavar="NAMES",
    help="Comma-separated engines, of engines.toml too; left out: all of ours.",
)
@click.option(
    "--error",
    type=float,
    metavar="E",
    help="Simulate no more precisely than this relative error.",
)
@click.option(
    "--suite",
    metavar="hard|FILE",
    help="Judge the hard cases, or the scenes that FILE lists.",
)
@click.option(
    "--random",
    type=click.IntRange(min=1),
    help="Judge this many random linkages instead.",
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    metavar="S",
    help="Seed of the random linkages; left out: 0.",
)
@click.option(
    "--type",
    metavar="TYPES",
    help=(
        f"Types of the random linkages, comma-separated: {ALL_TYPES} (all); or uneven:"
        " with every ratio over ten decades and every effect but loaded friction, for"
        " exact engines."
    ),
)
@click.option(
    "--workers",
    type=click.IntRange(min=1),
    default=WORKERS,
    show_default=True,
    help="Number of processes.",
)
@click.option(
    "--against",
    metavar="BASELINE",
    help="Compare with an accepted name or an earlier run's folder.",
)
@click.option(
    "--guest",
    metavar="MODULE:CLASS|COMMAND",
    multiple=True,
    help=(
        "An engine of your own, a class or a program, to judge with the others"
        " (docs/protocol.md)."
    ),
)
@click.option(
    "--time-limit",
    type=click.FloatRange(min=0.0, min_open=True),
    metavar="SECONDS",
    help=(
        "End a guest that takes longer for one answer; left out: a minute, and more for"
        " many positions."
    ),
)
@click.option(
    "--part",
    metavar="K/N",
    help=(
        "Judge the K-th of N parts alone, into DIR/parts; `collect` puts parts "
        "together."
    ),
)
@click.option(
    "--verbose",
    is_flag=True,
    help="Print the worst row of each scene and engine, and what was left out.",
)
@click.option(
    "--no-pictures",
    is_flag=True,
    help="Draw nothing; no verdict changes.",
)
@add_output_options("; without --against the comparisons of the run")
def run_command(**stated: Any) -> int:
    """Judge scenes and write a report.

    Without SCENES the run judges those of models/ and models/capabilities/. It writes
    results.parquet, results.csv, timings.csv, record.json, report.html, report.md and,
    if an engine printed anything, output.txt.
    """
    from fourbar_validation.report.terminal import print_table

    request = Request(**stated)
    request.require_consistent()
    plan = make_plan(request)
    if request.part is not None:
        scenes = plan.part_scenes
        with show_progress(scenes) as progress:
            judge_part(plan, request, progress)
        count = write_count(scenes, "scene")
        click.echo(f"part {request.part}: {count}, in {request.out / 'parts'}")
        plan.require_engines()
        return HOLDS
    with show_progress(len(plan.suite)) as progress:
        summary = run(plan, request.out, progress)
    print_table(summary, request.out, verbose=request.verbose)
    worse = False
    if plan.against is not None:
        worse = bool(report_differences(plan.against, request.out, request.forms))
    elif request.junit is not None:
        write_text(
            request.junit,
            write_document(
                summary.verdict, list_cases(read_columns(request.out / PARQUET_FILE))
            ),
        )
    return plan.conclude(summary, worse=worse)
