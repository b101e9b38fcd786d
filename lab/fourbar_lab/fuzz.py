"""Random scenes through files, formulas and exact engines.

What fails is made smaller and kept. Even numbers are ordinary scenes, odd ones of the
families of hard positions; scene i depends on the seed and i alone.
"""

import json
import re
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import click
import numpy as np

from fourbar.errors import FourBarError
from fourbar.files import dump, loads, save
from fourbar.scene import Scene
from fourbar_lab.families import FAMILY_DRAWERS
from fourbar_validation.compare.rows import say_error
from fourbar_validation.engines import workers as worker_processes
from fourbar_validation.engines.registry import ENGINES, hold_fully
from fourbar_validation.places import CHECKOUT
from fourbar_validation.run.judge import judge

ORDINARY = "random"
"""Family of the scenes with even numbers."""
ADVERSARIAL = tuple(
    family for family in FAMILY_DRAWERS if family not in (ORDINARY, "strokes")
)
"""Families of those with odd numbers, in turn; a stroke commands no angle."""
COUNTEREXAMPLES = (
    Path("results/counterexamples")
    if CHECKOUT is None
    else CHECKOUT / "tests" / "counterexamples"
)
DIGITS_OF_A_LENGTH = (1, 2, 3, 6, 10)
SHRINKING_ROUNDS = 4
NUMBER_BEFORE_A_UNIT = re.compile(r'(?<=")-?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?= )')
"""Pattern of the number of a quantity, before its unit."""
_NEEDED = ("[motion]", "theta_2", "omega_2")
"""A scene without them has no torque, and fails for another reason."""
EXACT_ENGINES = tuple(
    hold_fully(engine) for engine in ENGINES if not engine.through_time
)
"""The exact engines, held to full accuracy. Or they are held to what was predicted for
the position.
"""
SCENES_OF_A_TASK = 200
"""Scenes per task: some seconds."""
UNTOLD = ("undecided", "status", "exchanged")
"""Checks that are no finding where they fail: half of the scenes are drawn where
doubles have few digits, and one in three thousand, read from its other end, loses more
than identities allow: its angle is beyond a turn, where accelerations change fast.
"""
FAILURES_PRINTED = 20
WORKER_LOST = "worker:"
"""Beginning of the discrepancy of a scene that killed its worker, or never came back.
"""


def draw_fuzz_scene(seed: int, index: int) -> Scene:
    """Draw a scene of one position by its number alone."""
    family = ADVERSARIAL[index // 2 % len(ADVERSARIAL)] if index % 2 else ORDINARY
    return FAMILY_DRAWERS[family](np.random.default_rng([seed, index]))


def shrink_scene(scene: Scene, fails: Callable[[Scene], bool]) -> Scene:
    """Simplify a scene by one change of its file at a time while it fails."""
    lines = dump(scene).splitlines()
    for _ in range(SHRINKING_ROUNDS):
        before = lines
        # lines that a change removes lie behind
        for number in reversed(range(len(lines))):
            for simpler in _list_simpler(lines, number):
                try:
                    candidate = loads("\n".join(simpler))
                except FourBarError:  # no scene any more
                    continue
                if fails(candidate):
                    scene = candidate
                    lines = simpler
                    break
        if lines == before:
            break
    return scene


def _list_simpler(lines: list[str], number: int) -> Iterator[list[str]]:
    """Leave out one line, or the table that it begins.

    Or put a simpler entry in the line.
    """
    line = lines[number]
    until = number + 1
    if line.startswith("["):
        while until < len(lines) and not lines[until].startswith("["):
            until += 1
    if not line.startswith(_NEEDED):
        yield [*lines[:number], *lines[until:]]
    key, _, value = line.partition(" = ")
    entries = []
    if value.startswith('["'):
        entries = [f"{key} = {json.dumps(each)}" for each in json.loads(value)]
    for digits in DIGITS_OF_A_LENGTH:
        shorten = partial(_round_match, digits)
        entries.append(NUMBER_BEFORE_A_UNIT.sub(shorten, line))
    for entry in entries:
        if entry != line:
            yield [*lines[:number], entry, *lines[number + 1 :]]


def _round_match(digits: int, match: re.Match[str]) -> str:
    return f"{float(match[0]):.{digits}g}"


def keep_counterexample(
    scene: Scene,
    name: str,
    folder: Path = COUNTEREXAMPLES,
) -> Path:
    """Write a counter-example where the tests find it."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.toml"
    save(scene, path)
    return path


def list_findings(scene: Scene) -> list[str]:
    """List what is wrong with a scene, in one line each.

    Exceptions and warnings are listed too.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            text = dump(scene)
            rows = judge("", loads(text), EXACT_ENGINES).rows
            findings = [
                f"{row.engine} {row.quantity}: {row.reason}"
                for row in rows
                if row.failed and row.quantity not in UNTOLD
            ]
            if dump(loads(text)) != text:
                findings.append(
                    "file: a scene that was written and read is another one"
                )
            return findings
    except Exception as error:  # a traceback is what fuzzing looks for
        return [f"{type(error).__name__}: {error}".splitlines()[0]]


def examine_scene(seed: int, index: int) -> list[str]:
    """Examine the scene of a number."""
    return list_findings(draw_fuzz_scene(seed, index))


def _find_lost(
    _: int,
    error: BaseException,
    __: object,
) -> list[str]:
    return [f"{WORKER_LOST} {say_error(error)}"]


def examine_scenes(
    count: int, seed: int, workers: int
) -> Iterator[dict[int, list[str]]]:
    """Examine the scenes task by task, what is wrong by number."""
    starts = range(0, count, SCENES_OF_A_TASK)
    numbers = range(count)
    tasks = [(start, numbers[start : start + SCENES_OF_A_TASK]) for start in starts]
    for start, outcomes in worker_processes.apply_over_processes(
        partial(examine_scene, seed),
        tasks,
        workers,
        seconds=worker_processes.SCENE_SECONDS,
        instead=_find_lost,
    ):
        numbered = enumerate(outcomes, start)
        yield {number: found for number, found in numbered if found}


@click.command()
@click.option(
    "--scenes",
    default=100_000,
    show_default=True,
    type=click.IntRange(1),
    help="Half of them adversarial.",
)
@click.option("--seed", default=0, show_default=True, type=click.IntRange(0))
@click.option(
    "--workers",
    default=2,
    show_default=True,
    type=click.IntRange(1),
    help="Processes.",
)
def fuzz(scenes: int, seed: int, workers: int) -> int:
    """Put random scenes through files, formulas and exact engines.

    The first failures are shrunk and kept, each as soon as it is found.
    """
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)
    wrong = 0
    tasks = -(-scenes // SCENES_OF_A_TASK)
    running = examine_scenes(scenes, seed, workers)
    for task in track(running, "fuzzing", total=tasks, console=console):
        for number, (finding, *_) in task.items():
            wrong += 1
            if wrong <= FAILURES_PRINTED:
                path = _shrink_and_keep(seed, number, finding)
                console.print(f"scene {number}: {finding}\n  kept as {path.name}")
    print(f"{wrong} of {scenes} scenes fail (seed {seed}, half of them adversarial)")
    return 1 if wrong else 0


def _shrink_and_keep(seed: int, number: int, finding: str) -> Path:
    scene = draw_fuzz_scene(seed, number)
    if not finding.startswith(WORKER_LOST):  # shrinking would end this process too
        scene = shrink_scene(scene, lambda smaller: bool(list_findings(smaller)))
        finding = list_findings(scene)[0]
    title = f"found by fuzzing, seed {seed}, scene {number}"
    scene = replace(scene, title=title, source=finding)
    return keep_counterexample(scene, f"seed_{seed}_scene_{number}")
