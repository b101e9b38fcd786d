"""The command: random scenes through files, formulas and exact engines, or bounds; findings are shrunk and kept."""

import json
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import click
import numpy as np

from fourbar.files import dump, loads
from fourbar.scene import Command, Scene, command
from fourbar.solution import Solution
from fourbar.solve import solve
from fourbar.writing import write_text
from fourbar_validation.compare.compare import TOUCHING_MARGIN, closing_margin, compare
from fourbar_validation.compare.identities import identities
from fourbar_validation.compare.rows import FAILS
from fourbar_validation.compare.statements.statements import statements
from fourbar_validation.engines.hard_suite import predicting
from fourbar_validation.engines.witnesses import WITNESSES, predicting_from
from fourbar_validation.lab.stress.fuzz import outside
from fourbar_validation.lab.stress.fuzz.scenes import scene_of
from fourbar_validation.lab.stress.fuzz.shrink import keep, shrunk
from fourbar_validation.report.machine import versions

EXACT = tuple(predicting(w) for w in WITNESSES if w.name in ("pinocchio-inverse", "mujoco-inverse", "free-body"))
"""The exact engines, held to full accuracy or to what was predicted for the position."""
CHUNK, CHUNK_OF_PROOFS = 200, 10
"""Scenes per task: some seconds, which is what an interruption costs."""
SHOWN = 20


def findings(scene: Scene) -> list[str]:
    """What is wrong with a scene, in one line each; an exception or a warning is a finding too."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            at = command(scene)
            solution = solve(scene, "force", at=at)
            return [*_file(scene), *_assembly(scene, at, solution), *_engines(scene, at, solution)]
    except Exception as error:  # a traceback is what fuzzing looks for
        return [f"{type(error).__name__}: {error}".splitlines()[0]]


def _file(scene: Scene) -> list[str]:
    """Written as a scene file and read again, it must be the same scene to the last digit."""
    again = dump(loads(dump(scene)))
    return [] if again == dump(scene) else ["file: a scene that was written and read is another one"]


def _assembly(scene: Scene, at: Command, solution: Solution) -> list[str]:
    """No position where the loop does not close, none missing where it does, by ball arithmetic."""
    from fourbar_validation.engines.balls import closure, stored

    found = []
    margin = np.abs(closing_margin(scene, at.theta_2))
    for i, theta_2 in enumerate(at.theta_2):
        closes = closure(stored(scene, float(theta_2)), int(at.branch[i])) is not None
        if closes != bool(solution.assembled[i]) and margin[i] > TOUCHING_MARGIN:
            found.append(f"assembled: the formulas say {bool(solution.assembled[i])} at theta_2 = {theta_2!r}")
        angles = (solution.theta_3[i], solution.theta_4[i])
        if np.isfinite(angles).any() and not solution.assembled[i]:
            found.append(f"assembled: angles where the loop does not close, theta_2 = {theta_2!r}")
    return found


def _engines(scene: Scene, at: Command, solution: Solution) -> list[str]:
    rows = identities("", scene, at, solution)
    for witness in EXACT:
        answer = witness.engine().answer(scene, at)
        predicted = predicting_from(witness, scene, at, answer)
        rows += compare("", scene, answer, solution, witness.tolerance, witness.expected, predicted)
        if witness.name == "pinocchio-inverse" and answer.refusal is None:  # of two exact engines the quicker one
            rows += statements("", scene, witness.engine(), answer, predicted=predicted)
    # half of the scenes are drawn where doubles have few digits: that they are undecided is no fault
    failed = [row for row in rows if row.verdict == FAILS and row.quantity != "undecided"]
    return [f"{row.engine} {row.quantity}: {row.reason}" for row in failed]


def examine_chunk(seed: int, start: int, stop: int, bounds: bool = False) -> dict[str, list[str]]:
    """Number of each scene that fails: what is wrong with it, or with the bounds that are proven of it."""
    found = {}
    for index in range(start, stop):
        wrong = outside.findings(outside.scene_of(seed, index)) if bounds else findings(scene_of(seed, index))
        if wrong:
            found[str(index)] = wrong
    return found


def run(count: int, seed: int, out: Path, workers: int, bounds: bool = False) -> Iterator[dict[str, list[str]]]:
    """Examine the scenes chunk by chunk; chunks that an interrupted run finished are read, not done again."""
    from joblib import Parallel, delayed

    out.mkdir(parents=True, exist_ok=True)
    state = {"seed": seed, "bounds": bounds, "versions": versions()}
    marker, identity = out / "run.json", json.dumps(state, sort_keys=True)
    if not marker.is_file() or marker.read_text(encoding="utf-8") != identity:
        for old in out.glob("chunk-*.json"):
            old.unlink()
        write_text(marker, identity)
    todo, size = [], CHUNK_OF_PROOFS if bounds else CHUNK
    for start in range(0, count, size):
        stop = min(start + size, count)
        part = out / f"chunk-{start:09d}-{stop:09d}.json"
        if part.is_file():
            yield json.loads(part.read_text(encoding="utf-8"))
        else:
            todo.append((part, start, stop))
    tasks = (delayed(examine_chunk)(seed, start, stop, bounds) for _, start, stop in todo)
    for (part, _, _), found in zip(todo, Parallel(n_jobs=workers, return_as="generator")(tasks), strict=True):
        write_text(part, json.dumps(found))
        yield found


@click.command()
@click.option("--scenes", default=100_000, show_default=True, type=click.IntRange(1), help="Half of them adversarial.")
@click.option("--bounds", is_flag=True, help="Search for values outside proven extremes instead; two seconds a scene.")
@click.option("--seed", default=0, show_default=True, type=click.IntRange(0))
@click.option("--workers", default=2, show_default=True, type=click.IntRange(1), help="Processes.")
@click.option(
    "-o", "--out", type=click.Path(path_type=Path, file_okay=False), default=Path("results/fuzz"), show_default=True
)
def fuzz(scenes: int, bounds: bool, seed: int, workers: int, out: Path) -> int:
    """Random and adversarial scenes through files, formulas and exact engines; every failure is shrunk and kept."""
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)
    wrong: dict[str, list[str]] = {}
    chunks = -(-scenes // (CHUNK_OF_PROOFS if bounds else CHUNK))
    for found in track(run(scenes, seed, out, workers, bounds), "fuzzing", total=chunks, console=console):
        wrong |= found
    for number in sorted(wrong, key=int)[:SHOWN]:
        if bounds:  # each step of shrinking would be a proof
            scene, source, name = outside.scene_of(seed, int(number)), wrong[number][0], "bounds_seed"
        else:
            scene = shrunk(scene_of(seed, int(number)), lambda candidate: bool(findings(candidate)))
            source, name = findings(scene)[0], "seed"
        title = f"found by fuzzing, seed {seed}, scene {number}"
        path = keep(replace(scene, title=title, source=source), f"{name}_{seed}_scene_{number}")
        console.print(f"scene {number}: {wrong[number][0]}\n  kept as {path.name}")
    print(f"{len(wrong)} of {scenes} scenes fail (seed {seed}{'' if bounds else ', half of them adversarial'})")
    return 1 if wrong else 0
