"""The commands `run` and `collect`: what is judged, by whom, how, and against what.

Parts K/N of one run are judged each in a folder of its own, and collected.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import click

from fourbar.errors import HOLDS, DependencyError, InputError, write_count
from fourbar.writing import require_file, write_text
from fourbar_validation.compare.results_file import read_columns
from fourbar_validation.engines.environments import choose_engines, fill_table
from fourbar_validation.engines.guests import adjust_engines
from fourbar_validation.engines.registry import Engine, hold_fully
from fourbar_validation.regression.accept import (
    FORMS,
    add_output_options,
    report_differences,
)
from fourbar_validation.regression.record import PARQUET_FILE, find_baseline, open_run
from fourbar_validation.report.junit import list_cases, write_document
from fourbar_validation.report.run_summary import Summary
from fourbar_validation.run.run import (
    REQUEST_FILE,
    WORKERS,
    Plan,
    Progress,
    open_store,
    read_part,
    run,
    show_progress,
    write_outcome,
)
from fourbar_validation.run.store import Store
from fourbar_validation.scenes.hard_families import Hard
from fourbar_validation.scenes.random import UNEVEN_TYPE, DrawnType
from fourbar_validation.scenes.suites import (
    Files,
    Random,
    Suite,
    read_default_suite,
    read_scene_files,
    read_suite,
)

ALL_TYPES = ",".join(kind.value for kind in DrawnType)
HARD_SUITE = "hard"
"""Name of the suite of hard cases."""


@dataclass(frozen=True, kw_only=True)
class Request:
    """Everything that the command line of a run states, by its options' names.

    An option that is not stated is None.
    """

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
    part: str | None = None
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
        """Refuse options that contradict each other or would do nothing.

        Files that cannot be written are refused too.
        """
        own_scenes = "has its own scenes; leave out scene files and --random"
        of_random = "is of random linkages; say --random N too"
        of_report = "is of a report: leave it out, and collect the parts first"
        of_two = "tells differences; say --against BASELINE too"
        drawn = self.random is not None
        part = self.part is not None
        alone = self.against is None
        for option, wrong, why in (
            (
                "random",
                self.scenes,
                "judges random linkages; leave out the scene files",
            ),
            ("suite", self.scenes or drawn, own_scenes),
            ("seed", not drawn, of_random),
            ("type", not drawn, of_random),
            ("against", part, of_report),
            *((form, part, of_report) for form in FORMS),
            *((form, alone and form != "junit", of_two) for form in FORMS),
        ):
            value = getattr(self, option)
            if value is not None and wrong:
                shown = str(value) if isinstance(value, Path) else value
                raise InputError(f"--{option}", shown, why)
        for path in self.forms.values():
            # the run will make its own folder
            if path is not None and (self.out.exists() or path.parent != self.out):
                require_file(path, *self.scenes)
        if self.against is not None:
            open_run(find_baseline(self.against), "--against")

    @property
    def suite_name(self) -> str:
        """Return the name of the suite; empty if its scenes are chosen one by one."""
        if self.scenes or self.random is not None:
            return ""
        if self.suite in (None, HARD_SUITE):
            return self.suite or "models"
        return Path(str(self.suite)).name


def make_plan(request: Request, files: Files | None = None) -> Plan:
    """Read the scenes and make the engines ready.

    Raises DependencyError if one that is named cannot answer here.

    `files`: the scenes as a part kept them.
    """
    suite = _select_scenes(request) if files is None else files
    reasons = {engine: engine.missing() for engine in select_engines(request)}
    missing = [(one.name, why) for one, why in reasons.items() if why is not None]
    if missing and request.engines is not None:
        raise DependencyError("; ".join(f"{name}: {why}" for name, why in missing))
    return Plan(
        suite,
        tuple(engine for engine, why in reasons.items() if why is None),
        request.workers,
        not request.no_pictures,
        None if request.against is None else find_baseline(request.against),
        (1, 1) if request.part is None else read_part(request.part),
        missing,
        request.engines or "",
        request.suite_name,
    )


def keep_request(request: Request, plan: Plan) -> None:
    """Write what was asked for beside a part, with the text of scene files.

    Another machine need not have the files.
    """
    _, parts = plan.part
    kept: dict[str, Any] = {"parts": parts, "asked": asdict(request)}
    if isinstance(plan.suite, Files):
        files = asdict(plan.suite)
        kept["files"] = files | {"not_drawn": sorted(plan.suite.not_drawn)}
    write_text(request.out / REQUEST_FILE, json.dumps(kept, default=str) + "\n")


def read_request(folder: Path) -> tuple[int, Request, Files | None]:
    """Read beside a part how many there are, and what was asked for.

    The scene files are read too; InputError without them.
    """
    try:
        kept = json.loads((folder / REQUEST_FILE).read_text(encoding="utf-8"))
        asked = kept["asked"]
        asked["scenes"] = tuple(map(Path, asked["scenes"]))
        asked["guest"] = tuple(asked["guest"])
        request = Request(**asked)
        files = kept.get("files")
        if files is not None:
            texts = tuple(map(tuple, files["texts"]))
            files = Files(texts, files["positions"], frozenset(files["not_drawn"]))
        return int(kept["parts"]), request, files
    except (OSError, KeyError, TypeError, ValueError):
        why = "must be a folder that `run --part` wrote and that was not collected yet"
        raise InputError("DIR", str(folder), why) from None


def _select_scenes(request: Request) -> Suite:
    """Select the scenes."""
    if request.suite == HARD_SUITE:
        return Hard()
    if request.suite is not None:
        return read_suite(Path(request.suite))
    if request.random is not None:
        types = _read_linkage_types(request.type or ALL_TYPES)
        return Random(request.random, request.seed or 0, types)
    if request.scenes:
        return read_scene_files(request.scenes)
    return read_default_suite()


def select_engines(request: Request) -> tuple[Engine, ...]:
    """Select the engines that are to answer, and say what each is held to."""
    hard = request.suite == HARD_SUITE
    folders = [path.parent for path in request.scenes]
    table = fill_table(folders, request.guest, request.time_limit, balls=hard)
    engines = choose_engines(request.engines, table, request.time_limit)
    if hard:
        engines = tuple(map(hold_fully, engines))
    if request.error is not None:
        engines = adjust_engines(engines, request.error)
    return engines


def _read_linkage_types(text: str) -> tuple[DrawnType, ...]:
    """Read the types named in a comma-separated list; none for uneven linkages."""
    if text == UNEVEN_TYPE:
        return ()
    try:
        return tuple(DrawnType(name.strip()) for name in text.split(","))
    except ValueError:
        listed = ALL_TYPES.replace(",", ", ")
        why = f"must be {UNEVEN_TYPE} or a comma-separated list of {listed}"
        raise InputError("--type", text, why) from None


_MOST_NAMED = 5
"""Parts that a message names; further ones are counted."""


def _gather(plan: Plan, folders: Sequence[Path], parts: int) -> dict[int, Store]:
    """Find the folder of each finished task of a run.

    InputError if a folder is of another run, if two copies of a task differ, or if
    tasks are missing or damaged, whose parts it names.
    """
    stores: dict[int, Store] = {}
    spoilt = []
    for folder in folders:
        store = Store(folder, plan.identity)
        store.require_same()
        for path, damage in store.examine():
            if damage:
                spoilt.append(f"{path} {damage}")
            else:
                task = int(path.name)
                first = stores.setdefault(task, store)
                if first is not store:
                    _require_alike(task, first, store)
    tasks = range(len(plan.tasks))
    missing = [task for task in tasks if task not in stores]
    if missing:
        numbers = sorted({task % parts + 1 for task in missing})
        named = [f"--part {number}/{parts}" for number in numbers]
        further = len(named) - _MOST_NAMED
        words = ", ".join(named[:_MOST_NAMED]) + f" and {further} more" * (further > 0)
        why = f"{len(missing)} of {len(tasks)} tasks are missing: run {words} again"
        raise InputError("DIR", "; ".join(spoilt[:_MOST_NAMED]) or None, why)
    return stores


def _require_alike(task: int, first: Store, second: Store) -> None:
    """Raise InputError unless two copies of a task have the same rows.

    Times and what engines printed may differ from machine to machine.
    """
    rows = [
        {json.dumps(row) for kept in store.read(task) for row in kept["rows"]}
        for store in (first, second)
    ]
    if differing := sorted(rows[0] ^ rows[1]):
        scene, engine, _, quantity, *_ = json.loads(differing[0])
        raise InputError(
            "DIR",
            str(second.folder),
            f"holds another result than {first.folder}: {quantity} of {engine} in"
            f" {scene}; name one of the two folders, or judge that part again",
        )


def collect_parts(
    plan: Plan,
    folders: Sequence[Path],
    parts: int,
    out: Path,
    progress: Progress,
) -> Summary:
    """Write tables and report of a run into `out` from its parts' folders.

    The folders stay as they are.
    """
    if any((out / "parts").glob("*")):
        why = "holds parts of a run: name it among the folders and choose another"
        raise InputError("--out", str(out), why)
    stores = _gather(plan, folders, parts)
    with open_store(plan, out) as store:
        summary = write_outcome(
            plan, lambda task: stores[task].read(task), out, progress
        )
        store.finish()
    return summary


@click.command(name="collect")
@click.argument(
    "folders",
    metavar="DIR...",
    nargs=-1,
    required=True,
    type=click.Path(path_type=Path),
)
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    required=True,
    help="Folder for tables and report.",
)
@click.option("--verbose", is_flag=True, help="Print the worst row of each scene too.")
def collect_command(
    folders: tuple[Path, ...],
    out: Path,
    verbose: bool,
) -> int:
    """Put together the parts of a run.

    Tables and report are written from the folders in which `run --part` judged the
    parts. Parts of different runs are refused. If parts are missing, the command names
    them.
    """
    from fourbar_validation.report.terminal import print_table

    parts, request, files = read_request(folders[0])
    plan = make_plan(request, files)
    with show_progress(len(plan.suite)) as progress:
        summary = collect_parts(plan, folders, parts, out, progress)
    print_table(summary, out, verbose=verbose)
    return plan.conclude(summary)


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
        with show_progress(scenes) as progress, open_store(plan, request.out) as store:
            keep_request(request, plan)
            plan.judge(store, progress)
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
