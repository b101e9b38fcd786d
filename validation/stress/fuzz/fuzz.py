"""The command: random scenes in chunks, resumed where it was interrupted, findings shrunk and kept."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import click

from fourbar.writing import write_text
from validation.report.machine import versions
from validation.stress.fuzz.examine import findings
from validation.stress.fuzz.scenes import scene_of
from validation.stress.fuzz.shrink import keep, shrunk

CHUNK = 200
"""Scenes per task: some seconds, which is what an interruption costs."""
SHOWN = 20


def examine_chunk(seed: int, start: int, stop: int) -> dict[str, list[str]]:
    """Number of each scene that fails: what is wrong with it."""
    found = {}
    for index in range(start, stop):
        wrong = findings(scene_of(seed, index))
        if wrong:
            found[str(index)] = wrong
    return found


def run(count: int, seed: int, out: Path, workers: int) -> Iterator[dict[str, list[str]]]:
    """Examine the scenes chunk by chunk; chunks that an interrupted run finished are read, not done again."""
    from joblib import Parallel, delayed

    out.mkdir(parents=True, exist_ok=True)
    marker, identity = out / "run.json", json.dumps({"seed": seed, "versions": versions()}, sort_keys=True)
    if not marker.is_file() or marker.read_text(encoding="utf-8") != identity:
        for old in out.glob("chunk-*.json"):
            old.unlink()
        write_text(marker, identity)
    todo = []
    for start in range(0, count, CHUNK):
        stop = min(start + CHUNK, count)
        part = out / f"chunk-{start:09d}-{stop:09d}.json"
        if part.is_file():
            yield json.loads(part.read_text(encoding="utf-8"))
        else:
            todo.append((part, start, stop))
    tasks = (delayed(examine_chunk)(seed, start, stop) for _, start, stop in todo)
    for (part, _, _), found in zip(todo, Parallel(n_jobs=workers, return_as="generator")(tasks), strict=True):
        write_text(part, json.dumps(found))
        yield found


@click.command()
@click.option("--scenes", default=100_000, show_default=True, type=click.IntRange(1), help="Half of them adversarial.")
@click.option("--seed", default=0, show_default=True, type=click.IntRange(0))
@click.option("--workers", default=2, show_default=True, type=click.IntRange(1), help="Processes.")
@click.option(
    "-o", "--out", type=click.Path(path_type=Path, file_okay=False), default=Path("results/fuzz"), show_default=True
)
def fuzz(scenes: int, seed: int, workers: int, out: Path) -> int:
    """Random and adversarial scenes through files, formulas and exact engines; every failure is shrunk and kept."""
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)
    wrong: dict[str, list[str]] = {}
    chunks = -(-scenes // CHUNK)
    for found in track(run(scenes, seed, out, workers), "fuzzing", total=chunks, console=console):
        wrong |= found
    for number in sorted(wrong, key=int)[:SHOWN]:
        scene = shrunk(scene_of(seed, int(number)), lambda candidate: bool(findings(candidate)))
        title = f"found by fuzzing, seed {seed}, scene {number}"
        path = keep(replace(scene, title=title, source=findings(scene)[0]), f"seed_{seed}_scene_{number}")
        console.print(f"scene {number}: {wrong[number][0]}\n  kept as {path.name}")
    print(f"{len(wrong)} of {scenes} scenes fail (seed {seed}, half of them adversarial)")
    return 1 if wrong else 0
