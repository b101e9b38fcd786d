"""`python -m validation run`: what is judged, by whom, how, and against what."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import click

from fourbar.errors import FAILED, HOLDS, DependencyError, InputError
from fourbar.writing import require_file, write_text
from fourbar_validation.compare.columns import read_columns
from fourbar_validation.compare.rows import FAILS
from fourbar_validation.places import PROGRAM
from fourbar_validation.regression.accept import add_output_options, report_differences
from fourbar_validation.regression.record import find_baseline, open_run
from fourbar_validation.report.junit import list_cases, write_document
from fourbar_validation.report.summary import Summary
from fourbar_validation.run.run import SAMPLE, WORKERS, Collected, Pictured, RunOptions, run
from fourbar_validation.run.selection import choose_witnesses, find_askable, select_scenes
from fourbar_validation.scenes.random import DrawnType

ALL_TYPES = ",".join(kind.value for kind in DrawnType)
STAGES = {int: "judging", Collected: "collecting", Pictured: "drawing"}
"""Names of the stages in the progress line."""
EXCLUDED = (
    ("--random", "scenes", "judges random linkages; leave out the scene files"),
    ("--suite", "scenes", "has its own scenes; leave out scene files and --random"),
    ("--suite", "--random", "has its own scenes; leave out scene files and --random"),
)
"""Option, what it cannot be combined with, and why."""
OF_RANDOM = ("--seed", "--type")


def refuse_moved(context: click.Context, option: click.Parameter, value: tuple[str, ...]) -> None:
    """Name the command that does what these options did."""
    if value:
        allowed = f"is a command of its own: {PROGRAM} check-mjcf SCENE THEIRS.xml"
        raise InputError("--mjcf", value[0], allowed)


@click.command(name="run")
@click.argument("scenes", nargs=-1, type=click.Path(path_type=Path))
@click.option(
    "-o", "--out", type=click.Path(path_type=Path, file_okay=False), default=Path("results"), show_default=True
)
@click.option("--engines", metavar="NAMES", help="Comma-separated engines, of engines.toml too; left out: all of ours.")
@click.option("--error", "wanted", type=float, metavar="E", help="Simulate no more precisely than this relative error.")
@click.option("--suite", "named", metavar="hard|FILE", help="Judge the hard cases, or the scenes that FILE lists.")
@click.option("--random", "count", type=click.IntRange(min=1), help="Judge this many random linkages instead.")
@click.option("--seed", type=click.IntRange(min=0), metavar="S", help="Of the random linkages; left out: 0.")
@click.option(
    "--type",
    "types",
    metavar="TYPES",
    help=f"Of the random linkages, comma-separated: {ALL_TYPES} (all); or uneven: with every ratio over ten decades "
    "and every effect but loaded friction, for exact engines.",
)
@click.option("--workers", type=click.IntRange(min=1), default=WORKERS, show_default=True, help="Processes.")
@click.option("--scheduler", metavar="ADDRESS", help="Spread over the workers of this Dask scheduler.")
@click.option("--against", metavar="BASELINE", help="Compare with an accepted name or an earlier run's folder.")
@click.option(
    "--witness",
    "adapters",
    metavar="MODULE:CLASS|COMMAND",
    multiple=True,
    help="An engine of your own, a class or a program, to judge with the others (docs/protocol.md).",
)
@click.option(
    "--time-limit",
    type=click.FloatRange(min=0.0, min_open=True),
    metavar="SECONDS",
    help="End a --witness that takes longer for one answer; left out: a minute, and more for many positions.",
)
@click.option(
    "--sample-shipped",
    "sample",
    type=click.IntRange(min=0),
    default=SAMPLE,
    show_default=True,
    metavar="N",
    help="Judge studies, derivatives, bounds, equilibria, SDF and USD in this many scenes, evenly chosen.",
)
@click.option("--verbose", is_flag=True, help="Print the worst row of each scene and engine, and what was left out.")
@click.option("--no-pictures", is_flag=True, help="Draw nothing and measure no observed order; no verdict changes.")
@click.option("--mjcf", "--name", multiple=True, hidden=True, expose_value=False, is_eager=True, callback=refuse_moved)
@add_output_options
def command(
    scenes: tuple[Path, ...],
    out: Path,
    engines: str | None,
    wanted: float | None,
    named: str | None,
    count: int | None,
    seed: int | None,
    types: str | None,
    workers: int,
    scheduler: str | None,
    against: str | None,
    adapters: tuple[str, ...],
    time_limit: float | None,
    sample: int,
    verbose: bool,
    no_pictures: bool,
    **forms: Path | None,
) -> int:
    """Judge scenes (default: models/ and capabilities/); write results.csv, timings.csv, report.md, report.html."""
    from fourbar_validation.report.terminal import print_table

    of_random: dict[str, Any] = {"--random": count, "--seed": seed, "--type": types}
    refuse_combinations({"scenes": scenes or None, "--suite": named} | of_random)
    for form, path in forms.items():
        if path is not None:
            if against is None and form != "junit":
                raise InputError(f"--{form}", str(path), "tells differences; say --against BASELINE too")
            if out.exists() or path.parent != out:  # a folder that the run will make
                require_file(path, *scenes)
    if against is not None:
        open_run(find_baseline(against), "--against")  # before anything runs
    suite, witnesses = select_scenes(scenes, named, count, seed or 0, types or ALL_TYPES, adapters, time_limit)
    if wanted is not None:
        from fourbar_validation.engines.mujoco.required_error import adjust_witnesses

        witnesses = adjust_witnesses(witnesses, wanted)
    chosen = choose_witnesses(engines, witnesses, [path.parent for path in scenes], time_limit)
    present, missing = find_askable(chosen, by_name=engines is not None)
    options = RunOptions(workers, scheduler, drawn=not no_pictures, sample=sample)
    result = show_progress(len(suite), run(suite, out, present, options, missing))
    print_table(result, out, verbose=verbose)
    worse = _report_differences(against, out, forms, result.verdict)
    if result.counts[FAILS] or worse:
        return FAILED
    if missing:
        there = ",".join(witness.name for witness in present)
        raise DependencyError(f"{missing[0][1]}, or say --engines {there} where those are all that is wanted")
    return result.counts.status


def refuse_combinations(given: dict[str, Any]) -> None:
    """Refuse options that contradict each other, or that would do nothing."""
    for option, other, why in EXCLUDED:
        if given[option] is not None and given[other] is not None:
            raise InputError(option, given[option], why)
    for option in OF_RANDOM:
        if given[option] is not None and given["--random"] is None:
            raise InputError(option, given[option], "is of random linkages; say --random N too")


def _report_differences(against: str | None, out: Path, forms: dict[str, Path | None], verdict: str) -> int:
    """Report what differs from an earlier run; where there is none the run's own comparisons as JUnit, if wanted."""
    if against is not None:
        return report_differences(find_baseline(against), out, forms)
    if (xml := forms["junit"]) is not None:
        write_text(xml, write_document(verdict, list_cases(read_columns(out / "results.parquet"))))
    return HOLDS


def show_progress(scenes: int, steps: Iterable[int | str | Summary]) -> Summary:
    """Show the progress of a run, and give the summary at its end."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    step: int | str | Summary = 0
    with Progress(*columns, console=Console(stderr=True)) as progress:
        tasks: dict[type, TaskID] = {}
        for step in steps:
            if isinstance(step, str):
                progress.console.print(step, markup=False, highlight=False)
            elif isinstance(step, int):
                kind = type(step)
                if kind not in tasks:
                    tasks[kind] = progress.add_task(STAGES[kind], total=None if kind is Pictured else scenes)
                progress.advance(tasks[kind], step)
    assert isinstance(step, Summary)
    return step
