"""The run: every scene judged, in parallel, and the results written."""

import csv
import io
from collections.abc import Iterator, Sequence
from pathlib import Path

import click

from fourbar.scene import Scene
from fourbar.writing import write_text
from validation.judge import Record, judge
from validation.report.html import html
from validation.report.markdown import markdown
from validation.results import Row, sorted_rows, write_results
from validation.suites import model_files, named_scenes

WORKERS = 2


def records(scenes: Sequence[tuple[str, Scene]], workers: int = WORKERS) -> Iterator[Record]:
    """The record of each scene as it is done, in the order given."""
    from joblib import Parallel, delayed

    if workers == 1 or len(scenes) == 1:
        yield from (judge(name, scene) for name, scene in scenes)
        return
    pool = Parallel(n_jobs=workers, return_as="generator", batch_size=1)
    yield from pool(delayed(judge)(name, scene) for name, scene in scenes)


def all_rows(done: Sequence[Record]) -> list[Row]:
    """The rows of all scenes, sorted by scene, engine, setting and quantity."""
    return sorted_rows(row for record in done for row in record.rows)


def timings_csv(done: Sequence[Record]) -> str:
    """Seconds per answer, and their ratio to the formulas' on the same scene in the same process."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["scene", "engine", "setting", "positions", "seconds", "times_formulas"])
    for record in done:
        formulas = record.timings[0].seconds
        for t in record.timings:
            writer.writerow(
                [t.scene, t.engine, t.setting, t.positions, f"{t.seconds:.6f}", f"{t.seconds / formulas:.1f}"]
            )
    return text.getvalue()


def write(done: Sequence[Record], out: Path) -> None:
    """Write results.csv, timings.csv, report.md and report.html into a folder."""
    out.mkdir(parents=True, exist_ok=True)
    write_results(all_rows(done), out / "results.csv")
    write_text(out / "timings.csv", timings_csv(done))
    write_text(out / "report.md", markdown(done))
    write_text(out / "report.html", html(done))


@click.command(name="run")
@click.argument("scenes", nargs=-1, type=click.Path(path_type=Path))
@click.option("--out", type=click.Path(path_type=Path, file_okay=False), default=Path("results"), show_default=True)
@click.option("--workers", type=click.IntRange(min=1), default=WORKERS, show_default=True, help="Processes.")
def command(scenes: tuple[Path, ...], out: Path, workers: int) -> int:
    """Judge scenes (default: all of models/) and write results.csv, timings.csv, report.md and report.html."""
    from rich.console import Console
    from rich.progress import track

    from validation.report.terminal import table

    console = Console(stderr=True)
    todo = named_scenes(scenes or model_files())
    done = list(
        track(records(todo, workers), total=len(todo), description="judging", console=console, disable=console.quiet)
    )
    write(done, out)
    table(done, out)
    return 0 if all(row.passed for row in all_rows(done)) else 1
