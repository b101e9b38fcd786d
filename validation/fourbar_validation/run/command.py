"""`python -m validation run`: what is judged, by whom, how, and against what."""

from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import click

from fourbar.errors import FAILED, DependencyError, InputError
from fourbar.writing import require_file, write_text
from fourbar_validation.compare.columns import read_columns
from fourbar_validation.compare.rows import FAILS
from fourbar_validation.engines.guests import adjust_engines
from fourbar_validation.engines.registry import Engine, hold_fully
from fourbar_validation.engines.table import choose_engines, fill_table
from fourbar_validation.regression.accept import (
    FORMS,
    add_output_options,
    report_differences,
)
from fourbar_validation.regression.record import COLUMNS, find_baseline, open_run
from fourbar_validation.report.junit import list_cases, write_document
from fourbar_validation.run.run import (
    DRAWING,
    SAMPLE,
    WORKERS,
    Progress,
    RunOptions,
    run,
)
from fourbar_validation.scenes.hard_families import Hard
from fourbar_validation.scenes.random import UNEVEN_TYPE, DrawnType
from fourbar_validation.scenes.suites import (
    Random,
    Suite,
    read_default_suite,
    read_scene_files,
    read_suite,
)

ALL_TYPES = ",".join(kind.value for kind in DrawnType)
EXCLUDED = (
    ("random", "scenes", "judges random linkages; leave out the scene files"),
    ("suite", "scenes", "has its own scenes; leave out scene files and --random"),
    ("suite", "random", "has its own scenes; leave out scene files and --random"),
)
"""Option, what it cannot be combined with, and why."""
HARD = "hard"
"""Name of the suite of hard cases."""
OF_RANDOM = ("seed", "type")
"""Options that say which random linkages are drawn."""


@dataclass(frozen=True, kw_only=True)
class Request:
    """Everything that the command line of a run states, by the names of its options; None where it states nothing."""

    scenes: tuple[Path, ...] = ()
    out: Path = Path("results")
    engines: str | None = None
    error: float | None = None
    suite: str | None = None
    random: int | None = None
    seed: int | None = None
    type: str | None = None
    workers: int = WORKERS
    against: str | None = None
    guest: tuple[str, ...] = ()
    time_limit: float | None = None
    sample_shipped: int = SAMPLE
    verbose: bool = False
    no_pictures: bool = False
    markdown: Path | None = None
    html: Path | None = None
    junit: Path | None = None

    @property
    def forms(self) -> dict[str, Path | None]:
        """Return the files in which differences are written, by their form."""
        return {form: getattr(self, form) for form in FORMS}

    def require_consistent(self) -> None:
        """Refuse options that contradict each other or would do nothing, and files that cannot be written."""
        for option, excluded, why in EXCLUDED:
            if getattr(self, option) is not None and getattr(self, excluded) not in (
                None,
                (),
            ):
                raise InputError(f"--{option}", getattr(self, option), why)
        for option in OF_RANDOM:
            if getattr(self, option) is not None and self.random is None:
                raise InputError(
                    f"--{option}",
                    getattr(self, option),
                    "is of random linkages; say --random N too",
                )
        for form, path in self.forms.items():
            if path is not None:
                if self.against is None and form != "junit":
                    raise InputError(
                        f"--{form}",
                        str(path),
                        "tells differences; say --against BASELINE too",
                    )
                if (
                    self.out.exists() or path.parent != self.out
                ):  # a folder that the run will make
                    require_file(path, *self.scenes)
        if self.against is not None:
            open_run(find_baseline(self.against), "--against")


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
    help=f"Types of the random linkages, comma-separated: {ALL_TYPES} (all); or uneven: with every ratio over ten "
    "decades and every effect but loaded friction, for exact engines.",
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
    help="An engine of your own, a class or a program, to judge with the others (docs/protocol.md).",
)
@click.option(
    "--time-limit",
    type=click.FloatRange(min=0.0, min_open=True),
    metavar="SECONDS",
    help="End a guest that takes longer for one answer; left out: a minute, and more for many positions.",
)
@click.option(
    "--sample-shipped",
    type=click.IntRange(min=0),
    default=SAMPLE,
    show_default=True,
    metavar="N",
    help="Judge studies, derivatives, bounds, equilibria, SDF and USD in this many scenes, evenly chosen.",
)
@click.option(
    "--verbose",
    is_flag=True,
    help="Print the worst row of each scene and engine, and what was left out.",
)
@click.option(
    "--no-pictures",
    is_flag=True,
    help="Draw nothing and measure no observed order; no verdict changes.",
)
@add_output_options
def command(**stated: Any) -> int:
    """Judge scenes (default: models/ and capabilities/); write results.csv, timings.csv, report.md, report.html."""
    from fourbar_validation.report.terminal import print_table

    request = Request(**stated)
    request.require_consistent()
    suite = select_scenes(request)
    engines = select_engines(request)
    present, missing = find_askable(engines, by_name=request.engines is not None)
    against = None if request.against is None else find_baseline(request.against)
    options = RunOptions(
        request.workers,
        not request.no_pictures,
        against=against,
        sample=request.sample_shipped,
    )
    with ShownProgress(len(suite)) as progress:
        summary = run(suite, request.out, present, options, missing, progress)
    print_table(summary, request.out, verbose=request.verbose)
    worse = False
    if against is not None:
        worse = bool(report_differences(against, request.out, request.forms))
    elif request.junit is not None:
        write_text(
            request.junit,
            write_document(
                summary.verdict, list_cases(read_columns(request.out / COLUMNS))
            ),
        )
    if summary.counts[FAILS] or worse:
        return FAILED
    if missing:
        names = ",".join(engine.name for engine in present)
        raise DependencyError(
            f"{missing[0][1]}, or say --engines {names} where those are all that is wanted"
        )
    return summary.counts.status


def select_scenes(request: Request) -> Suite:
    """Select the scenes."""
    if request.suite == HARD:
        return Hard()
    if request.suite is not None:
        return read_suite(Path(request.suite))
    if request.random is not None:
        types = read_linkage_types(request.type or ALL_TYPES)
        return Random(request.random, request.seed or 0, types)
    if request.scenes:
        return read_scene_files(request.scenes)
    return read_default_suite()


def select_engines(request: Request) -> tuple[Engine, ...]:
    """Select the engines that are to answer, and say what each is held to."""
    hard = request.suite == HARD
    folders = [path.parent for path in request.scenes]
    table = fill_table(folders, request.guest, request.time_limit, balls=hard)
    engines = choose_engines(request.engines, table)
    if hard:
        engines = tuple(map(hold_fully, engines))
    if request.error is not None:
        engines = adjust_engines(engines, request.error)
    return engines


def read_linkage_types(text: str) -> tuple[DrawnType, ...]:
    """Read the types named in a comma-separated list; none for uneven linkages."""
    if text == UNEVEN_TYPE:
        return ()
    try:
        return tuple(DrawnType(name.strip()) for name in text.split(","))
    except ValueError:
        allowed = ALL_TYPES.replace(",", ", ")
        raise InputError(
            "--type",
            text,
            f"must be {UNEVEN_TYPE} or a comma-separated list of {allowed}",
        ) from None


def find_askable(
    engines: tuple[Engine, ...], *, by_name: bool
) -> tuple[tuple[Engine, ...], list[tuple[str, str]]]:
    """Find those that can answer here, and the others with the reason; DependencyError where those were named."""
    missing = [
        (engine.name, reason) for engine in engines if (reason := engine.missing())
    ]
    if missing and by_name:
        raise DependencyError(
            "; ".join(f"{name}: {reason}" for name, reason in missing)
        )
    return tuple(engine for engine in engines if not engine.missing()), missing


class ShownProgress(Progress):
    """Progress of a run on standard error: a bar for each stage, and the notes above them."""

    def __init__(self, scenes: int) -> None:
        from rich.console import Console
        from rich.progress import (
            BarColumn,
            MofNCompleteColumn,
            TextColumn,
            TimeRemainingColumn,
        )
        from rich.progress import Progress as Bars

        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(),
        )
        self.bars, self.scenes, self.tasks = (
            Bars(*columns, console=Console(stderr=True)),
            scenes,
            dict[str, Any](),
        )

    def __enter__(self) -> "ShownProgress":
        """Begin to show."""
        self.bars.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Leave the bars as they are."""
        self.bars.stop()

    def note(self, line: str) -> None:
        """Print the line above the bars."""
        self.bars.console.print(line, markup=False, highlight=False)

    def advance(self, stage: str, scenes: int) -> None:
        """Move the bar of the stage; how many scenes are drawn is not told before."""
        if stage not in self.tasks:
            self.tasks[stage] = self.bars.add_task(
                stage, total=None if stage == DRAWING else self.scenes
            )
        self.bars.advance(self.tasks[stage], scenes)
