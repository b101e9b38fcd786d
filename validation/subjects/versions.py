"""`python -m validation versions ENGINE`: the same suite under each released version, and where something changed."""

import csv
import io
import json
import math
import os
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click

import fourbar
from fourbar.errors import DependencyError
from fourbar.scene import command as on_path
from fourbar.writing import write_text
from validation.compare.rows import FAILS, REFUSES
from validation.engines.witnesses import FURTHER, WITNESSES
from validation.regression.changes import Change, Kind, differences
from validation.regression.history import Run
from validation.regression.record import read_run
from validation.regression.render import line
from validation.regression.steps import NO_CHANGE, Step, steps
from validation.report.colours import style_of
from validation.report.machine import machine
from validation.report.svg import drawn
from validation.report.templating import environment, number
from validation.run.elsewhere import CHECKOUT, ElsewhereError, run_elsewhere
from validation.subjects.examine import TORQUE_AND_FORCES
from validation.subjects.releases import installed, known, released

CACHE = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "fourbar-versions"
OF_VERDICTS = (Kind.VERDICT_WORSE, Kind.VERDICT_BETTER, Kind.NEW_FAILURE, Kind.GONE_FAILURE, Kind.GONE)
"""What a bisection looks for, where its two ends differ in any of them; else for any change."""
SCHEMA = "fourbar-versions/1"
CLOCK = "cpu_s_a_position"
REPEATED = 3
"""Of so many times the least counts."""
TIMED = Path(__file__).parents[2] / "models" / "crank_rocker.toml"
SECONDS = 120.0
"""For each scene of a version."""


@dataclass(frozen=True, slots=True)
class Release:
    """What the suite found under one version, or why it found nothing."""

    version: str
    run: Run | None
    why: str = ""
    seconds: Mapping[str, float] = field(default_factory=dict)
    """By witness: of the processor's clock for one position."""


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
@click.option("--out", type=click.Path(path_type=Path), help="Left out: results/versions-ENGINE.")
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
    module = known(engine)
    chosen = released(engine, first, last)
    out = out or Path("results") / f"versions-{engine}"
    out.mkdir(parents=True, exist_ok=True)
    witnesses = [witness.name for witness in (*WITNESSES, *FURTHER) if witness.library == module]
    arguments = [*map(os.path.abspath, scenes), f"--engines={','.join(witnesses)}", "--no-pictures", "--workers=1"]
    arguments.append(f"--time-limit={SECONDS!r}")
    timing = next(iter(scenes), TIMED).absolute()

    def attempt(version: str) -> Release:
        python, why = installed(engine, version, cache, more)
        if python is None:
            return Release(version, None, why)
        folder = out / "runs" / version
        folder.mkdir(parents=True, exist_ok=True)
        try:
            run_elsewhere(python, arguments, folder)
        except ElsewhereError as error:
            return Release(version, None, str(error).partition(": ")[2])
        run = Run(*read_run(folder), {})  # its times are of the wall clock, with other jobs
        return Release(version, run.of(lambda row: row.engine in witnesses), seconds=timed(python, timing, witnesses))

    found = bisected(chosen, attempt) if bisect else scanned(chosen, attempt, jobs)
    if sum(release.run is not None for release in found) < 2:
        reasons = "; ".join(f"{release.version}: {release.why}" for release in found if release.run is None)
        raise DependencyError(f"fewer than two versions of {engine} can be judged: {reasons}")
    left = len(chosen) - len(found)
    for name, text in written(engine, found, left, more).items():
        write_text(out / name, text)
    for release in found:
        if release.run is None:
            click.echo(f"{engine} {release.version} {release.why}")
    for sentence in changed(found):
        click.echo(sentence)
    click.echo(f"{len(found)} versions of {engine}, {left} not needed: {out}/versions.md, .svg, .csv, .json")


def timed(python: Path, scene: Path, witnesses: Sequence[str]) -> dict[str, float]:
    """What one position of a scene costs each witness under another Python, s of the processor's clock."""
    code = "import sys; from validation.subjects.versions import clock; clock(*sys.argv[1:])"
    command = [str(python), "-c", code, str(scene), *witnesses]
    done = subprocess.run(command, cwd=CHECKOUT, capture_output=True, text=True, check=False)
    return json.loads(done.stdout.splitlines()[-1]) if done.returncode == 0 else {}


def clock(file: str, *names: str) -> None:
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


def scanned(versions: Sequence[str], attempt: Try, jobs: int) -> list[Release]:
    """Every version, so many at a time."""
    with ThreadPoolExecutor(jobs) as pool:
        return list(pool.map(attempt, versions))


def bisected(versions: Sequence[str], attempt: Try) -> list[Release]:
    """The versions that had to be run to find those between which something changed.

    Of two versions that say the same, none between is run: what came and went again is not found.
    """
    tried: dict[int, Release] = {}

    def at(index: int) -> Run | None:
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
        changes = _changes(before, after)
        if kinds is None:
            verdicts = any(change.kind in OF_VERDICTS for change in changes)
            kinds = OF_VERDICTS if verdicts else tuple(kind for kind in Kind if kind not in NO_CHANGE)
        if not any(change.kind in kinds for change in changes):
            continue
        inner = sorted(range(low + 1, high), key=lambda index: abs(2 * index - low - high))
        if (middle := nearest(inner)) is not None:
            open_ends += [(low, middle), (middle, high)]
    return [tried[index] for index in sorted(tried)]


def _changes(before: Run, after: Run) -> list[Change]:
    found = differences((before.about, before.rows), (after.about, after.rows))
    return [change for change in found.changes if change.kind not in NO_CHANGE]


def changed(found: Sequence[Release]) -> list[str]:
    """One sentence for each version at which something changed: from which on, what, and the row that moved most."""
    ran = [release for release in found if release.run is not None]
    sentences = []
    for step in steps([release.run for release in ran if release.run is not None]):
        if not step.changes:  # times alone, which the table has
            continue
        counts = [f"{len(step.found.of(kind))} {kind.value}" for kind in Kind
                  if kind not in NO_CHANGE and step.found.of(kind)]  # fmt: skip
        where = f"{ran[step.number - 1].version} -> {ran[step.number].version}"
        most = line(max(step.changes, key=_moved))
        sentences.append(f"{where}: {', '.join(counts)}{_with(step)}. Most: {most}")
    return sentences


def _moved(change: Change) -> float:
    """By how many powers of e an error moved; what came or went, last."""
    if change.old is None or change.new is None or not (change.old.error and change.new.error):
        return 0.0
    moved = abs(math.log(change.new.error / change.old.error))
    return 0.0 if math.isnan(moved) else moved


def _with(step: Step) -> str:
    others = [f"{what} {old} -> {new}" for what, old, new in step.found.surroundings if what in ("numpy", "scipy")]
    return f" (with {', '.join(others)})" if others else ""


def lines(found: Sequence[Release]) -> list[dict[str, Any]]:
    """A line for each version and witness: greatest errors, verdicts, time; or why it has none."""
    made: list[dict[str, Any]] = []
    for release in found:
        if release.run is None:
            made.append({"version": release.version, "engine": None, "why": release.why})
            continue
        run = release.run
        for engine in dict.fromkeys(row.engine for row in run.rows):
            rows = [row for row in run.rows if row.engine == engine]
            errors = {
                name: max((row.error for row in rows if row.quantity == name and row.compared), default=None, key=_last)
                for name in TORQUE_AND_FORCES
            }
            counted = {"compared": sum(row.compared for row in rows)}
            counted |= {verdict: sum(row.verdict == verdict for row in rows) for verdict in (FAILS, REFUSES)}
            times = {CLOCK: release.seconds.get(engine)}
            made.append({"version": release.version, "engine": engine, "why": "", **errors, **counted, **times})
    return made


def _last(error: float) -> float:
    """NaN is the greatest."""
    return math.inf if math.isnan(error) else error


COLUMNS = ("version", "engine", *TORQUE_AND_FORCES, "compared", FAILS, REFUSES, CLOCK, "why")


def written(engine: str, found: Sequence[Release], left: int, more: Sequence[str] = ()) -> dict[str, str]:
    """The text of each file by its name."""
    rows, sentences = lines(found), changed(found)
    table = io.StringIO()
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows([row.get(name) for name in COLUMNS] for row in rows)
    about = next(release.run.about for release in found if release.run is not None)
    plain = [{key: None if isinstance(x, float) and math.isnan(x) else x for key, x in row.items()} for row in rows]
    kept = {"schema": SCHEMA, "engine": engine, "machine": machine(), "changed": sentences, "versions": plain}
    template = environment("validation.subjects", escape=False).get_template("versions.md.j2")
    shown = [[_cell(name, row.get(name)) for name in COLUMNS] for row in rows]
    made = {"machine": machine(), "python": about.versions.get("python", ""), "left": left, "more": more}
    page = template.render(engine=engine, rows=shown, columns=COLUMNS, changed=sentences, **made)
    texts = {"csv": table.getvalue(), "json": json.dumps(kept, indent=1) + "\n", "md": page, "svg": chart(rows)}
    return {f"versions.{ending}": text for ending, text in texts.items()}


def _cell(name: str, value: Any) -> str:
    if value is None:
        return ""
    if name == CLOCK:
        return f"{value:.2e}"
    return number(value) if isinstance(value, float) else str(value)


def chart(rows: Sequence[dict[str, Any]]) -> str:
    """SVG: the greatest error of the torque and of the pin forces, and the time, by version."""
    from matplotlib.figure import Figure

    versions = list(dict.fromkeys(row["version"] for row in rows))
    figure = Figure(figsize=(7.5, 5.0), layout="constrained")
    errors, times = figure.subplots(2, 1, sharex=True)
    for engine in dict.fromkeys(row["engine"] for row in rows if row["engine"]):
        own = [row for row in rows if row["engine"] == engine]
        at, style = [versions.index(row["version"]) for row in own], style_of(engine)
        forces = [max((row[name] or 0.0 for name in TORQUE_AND_FORCES[1:]), default=0.0) or math.nan for row in own]
        drawn_with: dict[str, Any] = {"color": style.colour, "marker": style.marker, "markersize": 4, "linewidth": 1}
        errors.plot(at, [row["torque"] or math.nan for row in own], label=f"{engine}: torque", **drawn_with)
        errors.plot(at, forces, linestyle="--", label=f"{engine}: pin forces", fillstyle="none", **drawn_with)
        times.plot(at, [row[CLOCK] or math.nan for row in own], label=engine, **drawn_with)
    for row in rows:
        if row["engine"] is None:
            errors.axvline(versions.index(row["version"]), color="#c74f00", linestyle=":", linewidth=1)
    errors.set_yscale("log")
    errors.set_ylabel("greatest error")
    times.set_ylim(bottom=0.0)
    times.set_ylabel("processor s a position")
    times.set_xticks(range(len(versions)), versions, rotation=45, ha="right", fontsize=7)
    for axes in (errors, times):
        axes.grid(alpha=0.3)
    errors.legend(fontsize=7, frameon=False)
    return drawn(figure, "versions")
