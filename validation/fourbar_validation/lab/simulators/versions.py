"""`python -m validation standing --versions ENGINE`: the same suite under each released version."""

import json
import math
import os
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import click

import fourbar
from fourbar.errors import DependencyError
from fourbar.scene import command as on_path
from fourbar.writing import write_text
from fourbar_validation.engines.witnesses import FURTHER, WITNESSES
from fourbar_validation.engines.workers import apply_each
from fourbar_validation.lab.simulators.releases import CACHE, Release, find_module, install_version, list_released
from fourbar_validation.lab.simulators.versions_page import describe_changed, write_files
from fourbar_validation.places import MODELS
from fourbar_validation.regression.change import Kind
from fourbar_validation.regression.changes import compare_rows
from fourbar_validation.regression.history import HistoryRun
from fourbar_validation.regression.record import read_run
from fourbar_validation.regression.steps import NO_CHANGE
from fourbar_validation.run.elsewhere import ElsewhereError, run_elsewhere, start_harness

OF_VERDICTS = (Kind.VERDICT_WORSE, Kind.VERDICT_BETTER, Kind.NEW_FAILURE, Kind.GONE_FAILURE, Kind.GONE)
"""What a bisection looks for, where its two ends differ in any of them; else for any change."""
REPEATED = 3
"""Of so many times the least counts."""
TIMED = MODELS / "crank_rocker.toml"
SECONDS = 120.0
"""For each scene of a version."""
Try = Callable[[str], Release]


@click.command()
@click.argument("engine")
@click.argument("scenes", nargs=-1, type=click.Path(path_type=Path))
@click.option("--from", "first", metavar="VERSION", help="The oldest; left out: the oldest that pip lists.")
@click.option("--to", "last", metavar="VERSION", help="The newest; left out: the newest that pip lists.")
@click.option("--bisect", is_flag=True, help="Only the versions between which something changed, by halves.")
@click.option(
    "--jobs", type=click.IntRange(min=1), default=1, show_default=True, help="Versions at a time, not in a bisection."
)
@click.option("--with", "more", multiple=True, metavar="REQUIREMENT", help="For each that can take it (repeat).")
@click.option("--cache", type=click.Path(path_type=Path), default=CACHE, help="Where the versions are installed.")
@click.option("-o", "--out", type=click.Path(path_type=Path), help="Left out: results/versions-ENGINE.")
def command(
    engine: str,
    scenes: tuple[Path, ...],
    first: str | None,
    last: str | None,
    bisect: bool,
    jobs: int,
    more: tuple[str, ...],
    cache: Path,
    out: Path | None,
) -> None:
    """Judge SCENES (default: all of models/) under every released version of ENGINE, each installed by itself.

    Writes versions.md, .svg, .csv and .json: error and time by version, and the versions where something changed.
    """
    module = find_module(engine)
    for scene in scenes:
        fourbar.load(scene)  # before anything is installed
    chosen = list_released(engine, first, last)
    out = out or Path("results") / f"versions-{engine}"
    out.mkdir(parents=True, exist_ok=True)
    witnesses = [witness.name for witness in (*WITNESSES, *FURTHER) if witness.library == module]
    arguments = [*map(os.path.abspath, scenes), f"--engines={','.join(witnesses)}", "--no-pictures", "--workers=1"]
    arguments.append(f"--time-limit={SECONDS!r}")
    timing = next(iter(scenes), TIMED).absolute()

    there = partial(_attempt, arguments, witnesses, timing, (engine, cache, more), out / "runs")
    found = bisect_versions(chosen, there) if bisect else list(apply_each(there, chosen, jobs, seconds=None))
    if sum(release.run is not None for release in found) < 2:
        reasons = "; ".join(f"{release.version}: {release.why}" for release in found if release.run is None)
        raise DependencyError(f"fewer than two versions of {engine} can be judged: {reasons}")
    left = len(chosen) - len(found)
    for name, text in write_files(engine, found, left, more).items():
        write_text(out / name, text)
    for release in found:
        if release.run is None:
            click.echo(f"{engine} {release.version} {release.why}")
    for sentence in describe_changed(found):
        click.echo(sentence)
    click.echo(f"{len(found)} versions of {engine}, {left} not needed: {out}/versions.md, .svg, .csv, .json")


def _attempt(
    arguments: list[str],
    witnesses: list[str],
    timing: Path,
    what: tuple[str, Path, tuple[str, ...]],
    runs: Path,
    version: str,
) -> Release:
    engine, cache, more = what
    python, why = install_version(engine, version, cache, more)
    if python is None:
        return Release(version, None, why)
    folder = runs / version
    folder.mkdir(parents=True, exist_ok=True)
    try:
        run_elsewhere(python, arguments, folder)
    except ElsewhereError as error:
        return Release(version, None, str(error).partition(": ")[2])
    run = HistoryRun(*read_run(folder), {})  # its times are of the wall clock, with other jobs
    return Release(
        version, run.of(lambda row: row.engine in witnesses), seconds=time_position(python, timing, witnesses)
    )


def time_position(python: Path, scene: Path, witnesses: Sequence[str]) -> dict[str, float]:
    """Time one position of a scene for each witness under another Python, s of the processor's clock."""
    code = "import sys; from fourbar_validation.lab.simulators.versions import print_times; print_times(*sys.argv[1:])"
    done = start_harness([python, "-c", code, scene, *witnesses])
    try:
        least = json.loads(done.out.splitlines()[-1])
        return {name: float(least[name]) for name in witnesses if 0.0 < least[name] < math.inf}
    except (IndexError, KeyError, TypeError, ValueError):  # an engine failed, left early, or prints at its end
        return {}


def print_times(file: str, *names: str) -> None:
    """Print the least time of each witness for a position of a scene, as JSON."""
    scene = fourbar.load(file)
    at, least = on_path(scene), {}
    for witness in (*WITNESSES, *FURTHER):
        if witness.name in names:
            taken = []
            for _ in range(REPEATED):
                began = time.process_time()
                witness.engine().answer(scene, at)
                taken.append(time.process_time() - began)
            least[witness.name] = min(taken) / len(at.theta_2)
    click.echo(json.dumps(least))


def bisect_versions(versions: Sequence[str], attempt: Try) -> list[Release]:
    """Run the versions that it takes to find those between which something changed.

    Of two versions that say the same, none between is run: what came and went again is not found.
    """
    tried: dict[int, Release] = {}

    def at(index: int) -> HistoryRun | None:
        if index not in tried:
            tried[index] = attempt(versions[index])
        return tried[index].run

    def nearest(indices: Sequence[int]) -> int | None:
        return next((index for index in indices if at(index) is not None), None)

    low, high = nearest(range(len(versions))), nearest(range(len(versions) - 1, -1, -1))
    kinds = None
    open_ends = [(low, high)] if low is not None and high is not None and low < high else []
    while open_ends:
        low, high = open_ends.pop()
        before, after = at(low), at(high)
        assert before is not None and after is not None
        found = compare_rows((before.about, before.rows), (after.about, after.rows)).changes
        changes = [change for change in found if change.kind not in NO_CHANGE]
        if kinds is None:
            verdicts = any(change.kind in OF_VERDICTS for change in changes)
            kinds = OF_VERDICTS if verdicts else tuple(kind for kind in Kind if kind not in NO_CHANGE)
        if not any(change.kind in kinds for change in changes):
            continue
        inner = sorted(range(low + 1, high), key=lambda index: abs(2 * index - low - high))
        if (middle := nearest(inner)) is not None:
            open_ends += [(low, middle), (middle, high)]
    return [tried[index] for index in sorted(tried)]
