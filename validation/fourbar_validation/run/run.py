"""The run: every scene judged, the results streamed to disk, the report written."""

import math
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from fourbar.writing import name_file, write_text
from fourbar_validation.compare.columns import Columns, read_columns
from fourbar_validation.compare.rows import FAILS, FORMULAS, Row, make_plain, write_csv
from fourbar_validation.compare.tolerance import IDENTITY
from fourbar_validation.engines.guests import Guest, list_numbers
from fourbar_validation.engines.hard_suite import Hard
from fourbar_validation.engines.witnesses import Witness
from fourbar_validation.regression.record import ABOUT, COLUMNS, TABLE, describe_run, write_about
from fourbar_validation.regression.scenes import describe_scenes
from fourbar_validation.report.colours import NUMBERS
from fourbar_validation.report.html import write_html, write_markdown
from fourbar_validation.report.machine import name_code
from fourbar_validation.report.record import Record
from fourbar_validation.report.sections import collect_sections
from fourbar_validation.report.summary import PICTURED, Summary
from fourbar_validation.run import pool
from fourbar_validation.run.judge import OUTPUT
from fourbar_validation.run.machines import Cluster
from fourbar_validation.run.pictures import draw_scenes, picture_models
from fourbar_validation.run.store import Store
from fourbar_validation.scenes.suites import Files, Suite

WORKERS = 2
SAMPLE = 30
"""Scenes in which everything else that is shipped is judged. In a scene that takes as long as judging thirty scenes:
a tenth more for 10 000 random ones."""
CHUNK = {True: 1, False: 20}
"""Scenes per task: one where something is simulated or drawn (a second each), else twenty (a second together)."""
MOST_PARTS = 10_000
"""Files that a run keeps while it goes on: of a million scenes a hundred stand in each."""
TIMINGS = ("scene", "engine", "setting", "positions", "seconds", "times_formulas")


class Collected(int):
    """Scenes that were read back for the report."""


class Pictured(int):
    """Scenes of a long suite that were drawn."""


OUTCOME = (TABLE, COLUMNS, ABOUT, "timings.csv", "report.md", "report.html", OUTPUT)
"""Files that a run ends with. A run first removes those of an earlier run, so that none passes for its own if it ends
early."""


@dataclass(frozen=True, slots=True)
class RunOptions:
    """Options of a run; only the sample changes a result."""

    workers: int = WORKERS
    """Processes of this machine."""
    scheduler: str | None = None
    """Address of a Dask scheduler, whose workers are used instead."""
    seconds: float | None = None
    """Seconds after which a scene counts as hanging."""
    drawn: bool = True
    """True for pictures; a long suite has them at the end, of the scenes that fail or come nearest to failing."""
    sample: int = SAMPLE
    """Scenes, evenly chosen, of which what else is shipped is judged."""


def run(
    suite: Suite,
    out: Path,
    witnesses: tuple[Witness, ...],
    options: RunOptions = RunOptions(),
    missing: Sequence[tuple[str, str]] = (),
) -> Iterator[int | str | Summary]:
    """Judge a suite into a folder; yields the number of scenes done as they come, then collected, at last the summary.

    What of an earlier run is not kept is yielded as a line of text.

    `missing` are the witnesses that cannot answer here, each with the reason.

    What an interrupted run of the same suite with the same engines and versions left is kept.
    """
    generated = any(witness.generated for witness in witnesses)
    workers, seconds = options.workers, options.seconds
    plain = len(suite.not_drawn) if isinstance(suite, Files) else 0
    draw = options.drawn and len(suite) - plain <= PICTURED
    size = max(CHUNK[draw or any(witness.through_time for witness in witnesses)], math.ceil(len(suite) / MOST_PARTS))
    chunks = [range(start, min(start + size, len(suite))) for start in range(0, len(suite), size)]
    identity = {
        "scenes": suite.fingerprint(),
        "witnesses": [witness.fingerprint() for witness in witnesses],
        **name_code(),
        "draw": draw,
        "sample": options.sample,
        "time limit": seconds,
    }
    with Store(out, identity, OUTCOME).held() as store:
        for name in OUTCOME:
            (out / name).unlink(missing_ok=True)
        done = store.done()
        yield from store.notes
        yield sum(len(chunks[number]) for number in done)
        todo = [(number, scenes) for number, scenes in enumerate(chunks) if number not in done]
        cluster = None if options.scheduler is None else Cluster(options.scheduler)
        judged = pool.judge_chunks(suite, todo, witnesses, draw, workers, seconds, cluster, options.sample)
        for number, records in judged:
            store.put(number, [record.kept_all() for record in records])
            yield len(records)
        summary = Summary()
        summary.tolerances = list(dict.fromkeys((IDENTITY, *(witness.tolerance for witness in witnesses))))
        summary.missing = missing
        summary.stated = {guest.name: guest.version for guest in witnesses if isinstance(guest, Guest)}
        with Columns(out) as columns, draft_file(out / OUTPUT) as output, draft_file(out / "timings.csv") as times:
            times.write(write_csv(TIMINGS, []))
            for number, scenes in enumerate(chunks):
                records = [Record.restore(kept) for kept in store.read(number)]
                for scene, each in zip(scenes, records, strict=True):
                    name = make_plain(suite.name(scene))
                    each.rows = each.rows or [Row.unmeasured(name, FORMULAS, "", "all", FAILS, "nothing was judged")]
                    summary.add(each)
                    times.write(write_csv((), list_timings(each)))
                    output.writelines(f"{each.name}: {engine}\n{text}\n\n" for engine, text in each.output.items())
                columns.add([row for each in records for row in each.rows])
                yield Collected(len(scenes))
        pictured = {record.name for record in summary.pictured} if options.drawn else set()
        places = [index for index in range(len(suite)) if make_plain(suite.name(index)) in pictured]
        if options.drawn and not draw:
            for shown in draw_scenes(suite, places, summary.pictured, witnesses, workers, seconds):
                summary.picture(shown)
                yield Pictured(1)
        record = describe_run(witnesses, suite.fingerprint(), describe_scenes(suite))
        if cluster is not None:
            record.settings["machines"] = cluster.machines
        write_about(record, out)
        write_text(out / "report.md", write_markdown(summary))
        models, why_not = picture_models(suite, places) if places and generated else ({}, "")
        more = collect_sections(read_columns(out / "results.parquet") if isinstance(suite, Hard) else None, out)
        NUMBERS.update(list_numbers(witnesses))
        page = write_html(summary, columns.first_lines, pictures=models, no_pictures=why_not, sections=more)
        write_text(out / "report.html", page)
        store.finish()
    yield summary


@contextmanager
def draft_file(path: Path) -> Iterator[TextIO]:
    """Write a text file line by line: in place once it is complete, and not there where it is empty."""
    draft = path.with_name(f".{path.name}.part")
    with name_file(path):
        try:
            with draft.open("w", encoding="utf-8", newline="") as file:
                yield file
            if draft.stat().st_size:
                os.replace(draft, path)
        finally:
            draft.unlink(missing_ok=True)


def list_timings(record: Record) -> Iterator[list[str]]:
    """Give the seconds per answer, and their ratio to the formulas' on the same scene in the same process."""
    for t in record.timings:
        ratio = t.seconds / record.timings[0].seconds
        yield [t.scene, t.engine, t.setting, str(t.positions), f"{t.seconds:.6f}", f"{ratio:.1f}"]
