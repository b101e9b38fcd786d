"""The run: every scene judged, and the report written.

The results are streamed to disk, and the pictures drawn.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from fourbar.errors import InputError
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
    write_csv_rows,
)
from fourbar_validation.engines.guests import number_guests
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
from fourbar_validation.report.run_summary import Summary
from fourbar_validation.report.scene_record import Record
from fourbar_validation.report.sections import collect_sections
from fourbar_validation.report.svg import STYLE_NUMBERS
from fourbar_validation.run.judge import OUTPUT
from fourbar_validation.run.plan import (
    COLLECTING,
    DRAWING,
    REQUEST_FILE,
    UNHEARD,
    Job,
    Plan,
    Progress,
    judge_tasks,
    make_jobs,
)
from fourbar_validation.run.store import Store
from fourbar_validation.scenes.hard_families import Hard

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
                times.write(write_csv_rows((), _list_timings(record)))
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


def _list_timings(record: Record) -> Iterator[list[str]]:
    """Yield the cells of each timing: seconds per answer and ratio to the formulas.

    The ratio is of answers to the same scene in the same process.
    """
    for timing in record.timings:
        ratio = timing.seconds / record.timings[0].seconds
        numbers = (str(timing.positions), f"{timing.seconds:.6f}", f"{ratio:.1f}")
        yield [timing.scene, timing.engine, timing.setting, *numbers]
