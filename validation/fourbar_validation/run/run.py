"""The run: every scene judged, the results streamed to disk, the report written."""

import math
import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO

import click

from fourbar.errors import FAILED, HOLDS, DependencyError, FourBarError, InputError
from fourbar.mjcf import mjcf
from fourbar.writing import naming, require_file, write_text
from fourbar_validation.compare.columns import Columns, read_columns
from fourbar_validation.compare.identities import FORMULAS
from fourbar_validation.compare.rows import FAILS, Row, csv_text, plain
from fourbar_validation.compare.tolerance import IDENTITY, SIMULATED
from fourbar_validation.engines.hard_suite import Hard
from fourbar_validation.engines.mujoco.picture import pictures
from fourbar_validation.engines.witnesses import Witness
from fourbar_validation.regression.accept import output_options, report_differences
from fourbar_validation.regression.record import ABOUT, COLUMNS, TABLE, about, baseline, recorded, write_about
from fourbar_validation.regression.scenes import descriptions
from fourbar_validation.report.html import html, markdown
from fourbar_validation.report.junit import cases, document
from fourbar_validation.report.machine import code
from fourbar_validation.report.record import Record
from fourbar_validation.report.sections import sections
from fourbar_validation.report.summary import PICTURED, Summary
from fourbar_validation.run import pool
from fourbar_validation.run.elsewhere import run_elsewhere
from fourbar_validation.run.judge import OUTPUT
from fourbar_validation.run.machines import Cluster
from fourbar_validation.run.selection import askable, chosen, selected
from fourbar_validation.run.store import Store
from fourbar_validation.scenes.random import LinkageType
from fourbar_validation.scenes.suites import Suite, scene_files

WORKERS = 2
ALL_TYPES = ",".join(kind.value for kind in LinkageType)
CHUNK = {True: 1, False: 20}
"""Scenes per task: one where something is simulated or drawn (a second each), else twenty (a second together)."""
MOST_PARTS = 10_000
"""Files that a run keeps while it goes on: of a million scenes a hundred stand in each."""
TIMINGS = ("scene", "engine", "setting", "positions", "seconds", "times_formulas")


class Collected(int):
    """Scenes that were read back for the report."""


class Drawn(int):
    """Scenes of a long suite that were drawn."""


OUTCOME = (TABLE, COLUMNS, ABOUT, "timings.csv", "report.md", "report.html", OUTPUT)
"""What a run ends with: of an earlier one it goes first, so that none is taken for that of a run that ended early."""
STAGES = {int: "judging", Collected: "collecting", Drawn: "drawing"}
"""What the progress says."""


def run(
    suite: Suite,
    out: Path,
    witnesses: tuple[Witness, ...],
    *,
    workers: int = WORKERS,
    scheduler: str | None = None,
    missing: Sequence[tuple[str, str]] = (),
    seconds: float | None = None,
    drawn: bool = True,
) -> Iterator[int | str | Summary]:
    """Judge a suite into a folder; yields the number of scenes done as they come, then collected, at last the summary.

    What of an earlier run is not kept is yielded as a line of text.

    `missing` are the witnesses that cannot answer here, each with the reason; `seconds`: after which a scene hangs;
    `drawn`: with pictures, of a long suite at the end, of the scenes that fail and those nearest to it.

    What an interrupted run of the same suite with the same engines and versions left is kept.
    """
    simulated = any(witness.name == "mujoco-simulated" for witness in witnesses)
    draw = drawn and len(suite) <= PICTURED
    size = max(CHUNK[simulated or draw], math.ceil(len(suite) / MOST_PARTS))
    chunks = [range(start, min(start + size, len(suite))) for start in range(0, len(suite), size)]
    identity = {
        "scenes": suite.fingerprint(),
        "witnesses": [repr(witness) for witness in witnesses],
        **code(),
        "draw": draw,
        "time limit": seconds,
    }
    with Store(out, identity).held() as store:
        for name in OUTCOME:
            (out / name).unlink(missing_ok=True)
        done = store.done()
        yield from store.notes
        yield sum(len(chunks[number]) for number in done)
        todo = [(number, scenes) for number, scenes in enumerate(chunks) if number not in done]
        cluster = None if scheduler is None else Cluster(scheduler)
        if cluster is not None:
            answers = cluster.over(suite, todo, witnesses, draw, seconds)
        else:
            answers = pool.over_processes(suite, todo, witnesses, draw, workers, seconds)
        for number, records in answers:
            store.put(number, records)
            yield len(records)
        summary = Summary()
        summary.tolerances = list(dict.fromkeys((IDENTITY, *(witness.tolerance for witness in witnesses))))
        summary.missing = missing
        with Columns(out) as columns, drafted(out / OUTPUT) as output, drafted(out / "timings.csv") as times:
            times.write(csv_text(TIMINGS, []))
            for number, scenes in enumerate(chunks):
                records = store.read(number)
                for scene, each in zip(scenes, records, strict=True):
                    each.rows = each.rows or [nothing_judged(plain(suite.name(scene)))]
                    summary.add(each)
                    times.write(csv_text((), timings(each)))
                    output.writelines(f"{each.name}: {engine}\n{text}\n\n" for engine, text in each.output.items())
                columns.add([row for each in records for row in each.rows])
                yield Collected(len(scenes))
        pictured = {record.name for record in summary.pictured} if drawn else set()
        places = [index for index in range(len(suite)) if plain(suite.name(index)) in pictured]
        if drawn and not draw:
            for shown in pictures_of(suite, places, summary.pictured, witnesses, workers, seconds):
                summary.picture(shown)
                yield Drawn(1)
        factors = {witness.name: witness.tolerance.factor for witness in witnesses}
        record = about(factors, suite.fingerprint(), descriptions(suite))
        if cluster is not None:
            record.settings["machines"] = cluster.machines
        write_about(record, out)
        write_text(out / "report.md", markdown(summary))
        models, why_not = mjcf_pictures(suite, places) if places and simulated else ({}, "")
        more = sections(read_columns(out / "results.parquet") if isinstance(suite, Hard) else None, out)
        page = html(summary, columns.first_lines, pictures=models, no_pictures=why_not, sections=more)
        write_text(out / "report.html", page)
        store.finish()
    yield summary


@contextmanager
def drafted(path: Path) -> Iterator[TextIO]:
    """A text file written line by line: in place once it is whole, and not there where it is empty."""
    draft = path.with_name(f".{path.name}.part")
    with naming(path):
        try:
            with draft.open("w", encoding="utf-8", newline="") as file:
                yield file
            if draft.stat().st_size:
                os.replace(draft, path)
        finally:
            draft.unlink(missing_ok=True)


def nothing_judged(scene: str) -> Row:
    """The row of a scene that came back without any."""
    return Row.unmeasured(scene, FORMULAS, "", "all", FAILS, "nothing was judged")


def pictures_of(
    suite: Suite,
    places: Sequence[int],
    records: Iterable[Record],
    witnesses: Sequence[Witness],
    workers: int,
    seconds: float | None,
) -> Iterator[Record]:
    """Some scenes judged once more, now with their pictures: their answers were not kept.

    An engine that broke down, or hung, in a scene is not started in it again.
    """
    broken = {record.name: {row.engine for row in record.rows if row.failed and row.quantity == "all"}
              for record in records}  # fmt: skip
    groups: dict[tuple[Witness, ...], list[int]] = {}
    for index in places:
        without = broken[plain(suite.name(index))]
        groups.setdefault(tuple(each for each in witnesses if each.name not in without), []).append(index)
    for who, indices in groups.items():
        chunks = [(index, range(index, index + 1)) for index in indices]
        for _, judged in pool.over_processes(suite, chunks, who, True, workers, seconds):
            yield from judged


def mjcf_pictures(suite: Suite, places: Iterable[int]) -> tuple[dict[str, str], str]:
    """MuJoCo's own pictures of some scenes' MJCF, base64 PNGs by name, and the reason where there are none."""
    texts = {}
    for index in places:
        try:
            texts[suite.name(index)] = mjcf(suite.scene(index))
        except FourBarError:  # bars without mass, a motion law: the engines' own rows say so
            continue
    return pictures(texts)


def timings(record: Record) -> Iterator[list[str]]:
    """Seconds per answer, and their ratio to the formulas' on the same scene in the same process."""
    for t in record.timings:
        ratio = t.seconds / record.timings[0].seconds
        yield [t.scene, t.engine, t.setting, str(t.positions), f"{t.seconds:.6f}", f"{ratio:.1f}"]


def examine(scenes: tuple[Path, ...], mjcf: Path, names: tuple[str, ...], out: Path, wanted: float | None) -> int:
    """What a user's own MJCF of one scene differs in, and what it costs; 1 where it is wrong by more than wanted."""
    from fourbar_validation.check.model import examine_model, named, show
    from fourbar_validation.run.dial import held_to

    if len(scenes) != 1:
        raise InputError("--mjcf", str(mjcf), f"needs the one scene it is a model of, not {len(scenes)}")
    suite = scene_files(scenes)
    tolerance = SIMULATED if wanted is None else held_to(wanted, "what this file may be wrong by")
    report = examine_model(suite.name(0), suite.scene(0), mjcf, named(names), tolerance)
    show(report, mjcf, out)
    return report.counts.status


@click.command(name="run")
@click.argument("scenes", nargs=-1, type=click.Path(path_type=Path))
@click.option(
    "-o", "--out", type=click.Path(path_type=Path, file_okay=False), default=Path("results"), show_default=True
)
@click.option("--engines", metavar="NAMES", help="Comma-separated witnesses; left out: all.")
@click.option(
    "--error",
    "wanted",
    type=float,
    metavar="E",
    help="Simulate no more precisely than this relative error; with --mjcf: what that file may be wrong by.",
)
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
    "--python",
    type=click.Path(path_type=Path),
    help="Run the suite under this interpreter too (into OUT/elsewhere), and say what changes from there to here.",
)
@click.option(
    "--witness",
    "adapters",
    metavar="MODULE:CLASS",
    multiple=True,
    help="A witness of your own, to judge with the others (docs/adding-a-witness.md).",
)
@click.option(
    "--time-limit",
    type=click.FloatRange(min=0.0, min_open=True),
    metavar="SECONDS",
    help="End what takes longer on one scene; left out: a minute, and more for many positions.",
)
@click.option("--no-pictures", is_flag=True, help="Draw nothing, and measure no observed order of a simulation.")
@click.option("--mjcf", type=click.Path(path_type=Path), help="Examine this MJCF of the one SCENE instead.")
@click.option(
    "--name",
    "names",
    metavar="ROLE=NAME",
    multiple=True,
    help="Of --mjcf: the body that is the input, coupler or output; B3, B4: the sites of pin B on the coupler and the "
    "output, where no connect or weld closes the loop. Left out: guessed from structure and lengths, and printed.",
)
@output_options
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
    python: Path | None,
    adapters: tuple[str, ...],
    time_limit: float | None,
    no_pictures: bool,
    mjcf: Path | None,
    names: tuple[str, ...],
    **forms: Path | None,
) -> int:
    """Judge scenes (default: all of models/); write results.csv, timings.csv, report.md and report.html."""
    from fourbar_validation.report.terminal import table

    if mjcf is not None:
        others = {"engines": engines, "suite": named, "random": count, "seed": seed, "type": types, "against": against}
        more = {"scheduler": scheduler, "python": python, "witness": adapters or None, "time-limit": time_limit}
        more["no-pictures"] = no_pictures or None
        for option, value in {**others, **more, **forms}.items():
            if value is not None:
                raise InputError(
                    f"--{option}", str(value), "is not of --mjcf, which examines one file together with its scene"
                )
        return examine(scenes, mjcf, names, out, wanted)
    if names:
        raise InputError("--name", names[0], "names a body or site of --mjcf; say which file that is")
    if count is not None and scenes:
        raise InputError("--random", count, "judges random linkages; leave out the scene files")
    if named is not None and (scenes or count is not None):
        raise InputError("--suite", named, "has its own scenes; leave out scene files and --random")
    for option, value in (("--seed", seed), ("--type", types)):
        if value is not None and count is None:
            raise InputError(option, value, "is of random linkages; say --random N too")
    if python is not None and against is not None:
        raise InputError(
            "--against", against, "cannot be combined with --python, which compares with the run made there"
        )
    for form, path in forms.items():
        if path is not None and python is None and against is None and form != "junit":
            raise InputError(f"--{form}", str(path), "tells differences; say --against BASELINE or --python PATH too")
    if against is not None:
        recorded(baseline(against))  # before anything runs
    for path in forms.values():
        if path is not None:
            require_file(path, *scenes)
    seed, types = seed or 0, types or ALL_TYPES
    suite, witnesses = selected(scenes, named, count, seed, types, adapters)
    if wanted is not None:
        from fourbar_validation.run.dial import dialled

        witnesses = dialled(witnesses, wanted)
    if python is not None:
        the_same = {"workers": workers, "engines": engines or None, "error": wanted, "time-limit": time_limit}
        the_same |= {"random": count, "seed": seed, "type": types} if count else {}
        the_same |= {"suite": named if named == "hard" else os.path.abspath(named)} if named else {}
        passed_on = [*map(os.path.abspath, scenes), "--no-pictures", *(f"--witness={adapter}" for adapter in adapters)]
        passed_on += [f"--{option}={value}" for option, value in the_same.items() if value is not None]
        against = str(run_elsewhere(python, passed_on, out / "elsewhere"))
    present, missing = askable(chosen(engines, witnesses, adapters), by_name=engines is not None)
    how: dict[str, Any] = {"workers": workers, "scheduler": scheduler, "seconds": time_limit, "drawn": not no_pictures}
    result = _in_sight(len(suite), run(suite, out, present, missing=missing, **how))
    table(result, out)
    worse = _held_against(against, out, forms, result.verdict)
    if result.counts[FAILS] or worse:
        return FAILED
    if missing:
        there = ",".join(witness.name for witness in present)
        raise DependencyError(f"{missing[0][1]}, or say --engines {there} where those are all that is wanted")
    return result.counts.status


def _held_against(against: str | None, out: Path, forms: dict[str, Path | None], verdict: str) -> int:
    """The differences from an earlier run; where there is none the run's own comparisons as JUnit, if wanted."""
    if against is not None:
        return report_differences(baseline(against), out, forms)
    if (xml := forms["junit"]) is not None:
        write_text(xml, document(verdict, cases(read_columns(out / "results.parquet"))))
    return HOLDS


def _in_sight(scenes: int, steps: Iterable[int | str | Summary]) -> Summary:
    """The summary at the end of a run, its progress shown meanwhile."""
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
                    tasks[kind] = progress.add_task(STAGES[kind], total=None if kind is Drawn else scenes)
                progress.advance(tasks[kind], step)
    assert isinstance(step, Summary)
    return step
