"""The run: tasks judged over processes, results on disk, and the report.

Every machine cuts a run into the same tasks. A scene that breaks down is judged again
engine by engine.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from fourbar.errors import FAILED, DependencyError, InputError
from fourbar.linkage import record
from fourbar.writing import write_text
from fourbar_validation.compare.results_file import (
    draft_file,
    read_columns,
    write_tables,
)
from fourbar_validation.compare.rows import (
    FAILS,
    FORMULAS,
    Row,
    escape_controls,
    make_breakdown,
    write_csv_rows,
)
from fourbar_validation.engines import workers
from fourbar_validation.engines.guests import QUESTIONS, Guest, number_guests
from fourbar_validation.engines.programs import SECONDS_PER_POSITION
from fourbar_validation.engines.registry import Engine
from fourbar_validation.regression.accept import find_differences
from fourbar_validation.regression.changes import Kind
from fourbar_validation.regression.history import (
    collect_history,
    find_since,
    read_history,
)
from fourbar_validation.regression.record import (
    ABOUT_FILE,
    CSV_FILE,
    PARQUET_FILE,
    Recorded,
    describe_run,
    open_run,
    write_about,
)
from fourbar_validation.regression.render import write_change_line
from fourbar_validation.regression.scenes import describe_scenes
from fourbar_validation.report.html import write_html, write_summary_page
from fourbar_validation.report.machine import name_code
from fourbar_validation.report.run_summary import PICTURED, Summary
from fourbar_validation.report.scene_record import Record
from fourbar_validation.report.sections import collect_sections
from fourbar_validation.report.svg import STYLE_NUMBERS
from fourbar_validation.run.judge import OUTPUT, judge_for_report
from fourbar_validation.run.store import Store
from fourbar_validation.scenes.hard_families import Hard
from fourbar_validation.scenes.suites import Suite

WORKERS = 2
SCENES_OF_A_SLOW_TASK = 1
"""Scenes per task if something is simulated or drawn: a second each."""
SCENES_OF_A_QUICK_TASK = 20
"""Scenes per task otherwise: a second together."""
REQUEST_FILE = "request.json"
"""File beside a part that says what was asked for, so that parts can be collected."""
JUDGING, COLLECTING, DRAWING = "judging", "collecting", "drawing"
"""Stages of a run, as its progress is told."""
_MOST_TASKS = 10_000
"""Each has a file while the run goes on. Of a million scenes a hundred stand in one."""
_MOST_KEPT_NAMED = 5
"""Scenes whose kept answers a resumed run names; further ones are counted."""


class Progress:
    """Listener to a run: it notes lines, and on a terminal shows a bar per stage.

    Without bars it ignores what it is told.
    """

    def __init__(self, bars: Any = None, scenes: int = 0) -> None:
        self.bars = bars
        self.scenes = scenes
        self.stages: dict[str, Any] = {}

    def note(self, line: str) -> None:
        """Print above the bars why a task of an earlier run is judged again."""
        if self.bars is not None:
            self.bars.console.print(line, markup=False, highlight=False)

    def advance(self, stage: str, scenes: int) -> None:
        """Note that a stage has done so many scenes more.

        How many scenes are drawn is not told before.
        """
        if self.bars is None:
            return
        if stage not in self.stages:
            total = None if stage == DRAWING else self.scenes
            self.stages[stage] = self.bars.add_task(stage, total=total)
        self.bars.advance(self.stages[stage], scenes)


UNHEARD = Progress()


@contextmanager
def show_progress(scenes: int) -> Iterator[Progress]:
    """Show the progress of a run of so many scenes, and leave the bars as they are."""
    from rich import progress
    from rich.console import Console

    columns = (
        progress.TextColumn("{task.description}"),
        progress.BarColumn(),
        progress.MofNCompleteColumn(),
        progress.TimeRemainingColumn(),
    )
    console = Console(stderr=True)
    hidden = not console.is_terminal
    with progress.Progress(*columns, console=console, disable=hidden) as bars:
        yield Progress(bars, scenes)


@record
class Job:
    """One scene of a task, for a worker.

    The scene is a number in a suite; beside it stand its engines, and what is made of
    it.
    """

    suite: Suite
    scene: int
    engines: Sequence[Engine]
    draw: bool

    @property
    def name(self) -> str:
        """Return the scene's name."""
        return escape_controls(self.suite.name(self.scene))


def make_jobs(
    suite: Suite,
    scenes: Iterable[int],
    engines: Sequence[Engine],
    draw: bool,
) -> list[Job]:
    """Make the jobs of some scenes; one of a file carries its own text alone."""
    return [
        Job(
            *suite.alone(i),
            engines,
            draw and suite.name(i) not in suite.not_drawn,
        )
        for i in scenes
    ]


def judge_job(job: Job) -> Record:
    """Judge one scene; runs in a worker."""
    scene = job.suite.scene(job.scene)
    return judge_for_report(job.name, scene, job.engines, draw=job.draw)


def _judge_by_engine(
    job: Job,
    _: BaseException,
    attempt: workers.Attempt,
) -> Record:
    """Judge a scene that broke down one engine at a time.

    An engine at fault gets a row that says what broke down; where the formulas do, no
    engine is asked.
    """
    record = attempt(replace(job, engines=[]))
    if not isinstance(record, Record):
        return Record(job.name, rows=[make_breakdown(job.name, FORMULAS, record)])
    breakdowns = []
    for engine in job.engines:
        outcome = attempt(replace(job, engines=[engine]))
        if isinstance(outcome, Record):
            record = record.joined(outcome)
        else:
            breakdowns.append(make_breakdown(job.name, engine.name, outcome))
    return replace(record, rows=[*record.rows, *breakdowns])


def find_time_limit(suite: Suite, engines: Iterable[Engine]) -> float:
    """Return the seconds after which a scene of the suite counts as hanging.

    Guests have limits of their own besides.
    """
    limit = workers.SCENE_SECONDS + SECONDS_PER_POSITION * suite.positions
    return limit + QUESTIONS * sum(
        guest.seconds or limit for guest in engines if isinstance(guest, Guest)
    )


def judge_tasks(
    suite: Suite,
    engines: Iterable[Engine],
    tasks: Iterable[tuple[int, list[Job]]],
    count: int,
) -> Iterator[tuple[int, list[Record]]]:
    """Judge numbered tasks by so many processes, each as it is done.

    A job that takes too long hangs.
    """
    return workers.apply_over_processes(
        judge_job,
        tasks,
        count,
        seconds=find_time_limit(suite, engines),
        instead=_judge_by_engine,
    )


def read_part(text: str) -> tuple[int, int]:
    """Read `K/N`, part K of N parts; InputError for anything else."""
    number, _, of = text.partition("/")
    if number.isdecimal() and of.isdecimal() and 1 <= int(number) <= int(of):
        return int(number), int(of)
    allowed = "must be K/N, part K of N parts: --part 1/8 to --part 8/8"
    raise InputError("--part", text, allowed)


@dataclass(frozen=True)
class Plan:
    """A suite, the engines that are asked, and the tasks of this run.

    The tasks are the same on every machine.
    """

    suite: Suite
    engines: tuple[Engine, ...]
    workers: int = WORKERS
    """Number of processes."""
    drawn: bool = True
    """True for pictures. A long suite has them at the end, of the scenes that fail or
    come nearest to failing.
    """
    against: Path | None = None
    """Earlier run that `--against` names. The failure that the verdict names is looked
    up there, and its rules must not be stricter.
    """
    part: tuple[int, int] = (1, 1)
    """Number of the part of the run that is judged here, and how many there are."""
    missing: Sequence[tuple[str, str]] = ()
    """Engines that cannot answer here, each with the reason."""
    chosen: str = ""
    """Engines that were asked for by name; empty for all of ours."""
    suite_name: str = ""
    """Name of the suite; empty where scenes were chosen one by one."""

    @property
    def asked(self) -> dict[str, str]:
        """Return what was asked for, as the record of a run keeps it."""
        return {"chosen": self.chosen, "scenes of": self.suite_name}

    @property
    def draw_at_once(self) -> bool:
        """Return whether scenes are drawn as they are judged, because there are few."""
        pictures = len(self.suite) - len(self.suite.not_drawn)
        return self.drawn and pictures <= PICTURED

    @cached_property
    def tasks(self) -> list[range]:
        """Return the scenes of each task."""
        count = len(self.suite)
        slow = self.draw_at_once or any(one.through_time for one in self.engines)
        least = SCENES_OF_A_SLOW_TASK if slow else SCENES_OF_A_QUICK_TASK
        size = max(least, math.ceil(count / _MOST_TASKS))
        scenes = range(count)
        return [scenes[start : start + size] for start in scenes[::size]]

    @cached_property
    def identity(self) -> dict[str, Any]:
        """Return all that a result depends on.

        Two folders hold results of one run if it is equal.
        """
        return {
            "scenes": self.suite.fingerprint(),
            "engines": [engine.fingerprint() for engine in self.engines],
            **name_code(),
            "draw": self.draw_at_once,
        }

    @property
    def part_tasks(self) -> range:
        """Return the numbers of the tasks of its part: every N-th, from the K-th on."""
        number, of = self.part
        return range(len(self.tasks))[number - 1 :: of]

    @property
    def part_scenes(self) -> int:
        """Return how many scenes its part has."""
        return sum(len(self.tasks[task]) for task in self.part_tasks)

    def judge(self, store: Store, progress: Progress) -> None:
        """Judge the tasks of its part that the store does not have yet."""
        done = store.done()
        for line in store.notes:
            progress.note(line)
        left = [task for task in self.part_tasks if task not in done]
        kept = [i for task in self.part_tasks if task in done for i in self.tasks[task]]
        if kept:
            progress.note(self._tell_kept(kept))
        progress.advance(JUDGING, len(kept))
        how = self.engines, self.draw_at_once
        jobs = ((task, make_jobs(self.suite, self.tasks[task], *how)) for task in left)
        for task, records in judge_tasks(self.suite, self.engines, jobs, self.workers):
            store.put(task, [record.kept_all() for record in records])
            progress.advance(JUDGING, len(records))

    def _tell_kept(self, scenes: Sequence[int]) -> str:
        """Say which answers of an interrupted run are kept."""
        names = [escape_controls(self.suite.name(i)) for i in scenes[:_MOST_KEPT_NAMED]]
        more = len(scenes) - len(names)
        listed = ", ".join(names) + f" and {more} more" * bool(more)
        return (
            "kept from an interrupted run: the answers of all engines on"
            f" {len(scenes)} of {len(self.suite)} scenes, {listed}"
        )

    def conclude(self, summary: Summary, *, worse: bool = False) -> int:
        """Return the exit status of a run.

        Nothing compared is no success, also of one engine that was asked for by name.
        Raises DependencyError if only an engine is missing.

        `worse`: whether the run is worse than the one that it is compared with.
        """
        counts = summary.counts
        if counts[FAILS] or worse or summary.unchecked:
            return FAILED
        self.require_engines()
        return counts.status

    def require_engines(self) -> None:
        """Raise DependencyError if an engine could not answer here."""
        if self.missing:
            names = ",".join(engine.name for engine in self.engines)
            raise DependencyError(
                f"{self.missing[0][1]}, or say --engines {names} where those are all"
                " that is wanted"
            )


TIMING_COLUMNS = (
    "scene",
    "engine",
    "setting",
    "positions",
    "seconds",
    "times_formulas",
)
_OUTCOME = (
    CSV_FILE,
    PARQUET_FILE,
    ABOUT_FILE,
    "timings.csv",
    "report.md",
    "report.html",
    OUTPUT,
)
"""Files that a run ends with. A run first removes those of an earlier run, so that none
passes for its own if it ends early.
"""


def run(plan: Plan, out: Path, progress: Progress = UNHEARD) -> Summary:
    """Judge what is planned into a folder.

    The folder keeps what an interrupted run of the same suite, engines and versions
    left.
    """
    with open_store(plan, out) as store:
        plan.judge(store, progress)
        summary = write_outcome(plan, store.read, out, progress)
        store.finish()
        (out / REQUEST_FILE).unlink(missing_ok=True)
    return summary


@contextmanager
def open_store(plan: Plan, out: Path) -> Iterator[Store]:
    """Hold the folder of a run, without the files of an earlier one."""
    with Store(out, plan.identity, _OUTCOME).held() as store:
        for name in _OUTCOME:
            (out / name).unlink(missing_ok=True)
        yield store


def write_outcome(
    plan: Plan,
    read: Callable[[int], list[Any]],
    out: Path,
    progress: Progress,
) -> Summary:
    """Write tables and report of what was judged.

    `read`: returns the results of a task.
    """
    suite = plan.suite
    engines = plan.engines
    summary = Summary(engines, plan.missing, bool(plan.chosen))
    first_lines = _collect_tasks(plan, read, out, summary, progress)
    names = [escape_controls(suite.name(index)) for index in range(len(suite))]
    pictured = {record.name: record for record in summary.pictured if plan.drawn}
    if not plan.draw_at_once:
        jobs = (
            (index, [_redraw(plan, index, pictured[name])])
            for index, name in enumerate(names)
            if name in pictured
        )
        for _, records in judge_tasks(suite, engines, jobs, plan.workers):
            summary.picture(*records)
            progress.advance(DRAWING, 1)
    about = describe_run(
        engines, suite.fingerprint(), describe_scenes(suite), plan.asked
    )
    write_about(about, out)
    summary.date = about.date
    summary.commit = about.commit
    if len(suite) == 1:
        summary.scene = names[0]
    if plan.against is not None:
        before = open_run(plan.against, "--against")
        _hold_against(before, summary, Recorded(about, out / PARQUET_FILE))
    write_text(out / "report.md", write_summary_page(summary))
    rows = read_columns(out / PARQUET_FILE)
    sections = collect_sections(rows if isinstance(suite, Hard) else None, out)
    if plan.against is not None:
        sections += collect_history(before.table.parent)
    STYLE_NUMBERS.update(number_guests(engines))
    page = write_html(summary, first_lines, sections)
    write_text(out / "report.html", page)
    return summary


def _hold_against(before: Recorded, summary: Summary, after: Recorded) -> None:
    """Tell a summary what an earlier run says of it."""
    summary.baseline = before.describe()
    for cause in summary.causes[:1]:
        row = cause.worst
        key = (row.scene, row.engine, row.quantity)
        since = find_since(read_history(before), before, [key])
        summary.since = f"It {since[key]}."
    try:
        differences = find_differences(before, after, {})
    except InputError:  # raised again where the differences are printed
        return
    summary.weaker = [*map(str, differences.weakened)]
    summary.gone = differences.gone
    if not summary.counts[FAILS]:  # its cause stands first
        lines = differences.of(Kind.GONE).itertuples()
        summary.gone += map(write_change_line, lines)
        lines = differences.of(Kind.VERDICT_WORSE, Kind.WORSE).itertuples()
        summary.worse = [*map(write_change_line, lines)]


def _collect_tasks(
    plan: Plan,
    read: Callable[[int], list[Any]],
    out: Path,
    summary: Summary,
    progress: Progress,
) -> dict[str, int]:
    """Write the tables task by task, and add each scene to the summary.

    Return each scene's first line.
    """
    with (
        write_tables(out) as columns,
        draft_file(out / OUTPUT) as printed,
        printed.open("w", encoding="utf-8", newline="") as output,
        draft_file(out / "timings.csv") as timed,
        timed.open("w", encoding="utf-8", newline="") as times,
    ):
        times.write(write_csv_rows(TIMING_COLUMNS, []))
        for number, scenes in enumerate(plan.tasks):
            records = [Record.restore(kept) for kept in read(number)]
            for scene, record in zip(scenes, records, strict=True):
                name = escape_controls(plan.suite.name(scene))
                told = (FORMULAS, "", "all", FAILS, "nothing was judged")
                record.rows = record.rows or [Row.unmeasured(name, *told)]
                summary.add(record)
                for timing in record.timings:
                    # the ratio is of answers to the same scene in the same process
                    ratio = timing.seconds / record.timings[0].seconds
                    who = (timing.scene, timing.engine, timing.setting)
                    seconds = f"{timing.seconds:.6f}", f"{ratio:.1f}"
                    cells = (*who, str(timing.positions), *seconds)
                    times.write(write_csv_rows((), [cells]))
                output.writelines(
                    f"{record.name}: {engine}\n{text}\n\n"
                    for engine, text in record.output.items()
                )
            columns.add([row for record in records for row in record.rows])
            progress.advance(COLLECTING, len(scenes))
    return columns.first_lines


def _redraw(plan: Plan, scene: int, record: Record) -> Job:
    """Return the job of judging a scene once more, now with its pictures.

    The scene's answers were not kept. An engine that broke down, or hung, in the scene
    is not started in it again.
    """
    whole = [row for row in record.rows if row.quantity == "all"]
    broken = {row.engine for row in whole if row.failed}
    sound = [engine for engine in plan.engines if engine.name not in broken]
    return make_jobs(plan.suite, [scene], sound, draw=True)[0]
