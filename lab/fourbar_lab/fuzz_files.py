"""`python -m fourbar_lab fuzz-files`: read mutated scene files.

Each must end in a scene or in one clear line.
"""

import time
from collections.abc import Sequence
from typing import TypeVar

import click
import numpy as np

from fourbar.errors import FourBarError
from fourbar.files import loads
from fourbar.scene import command
from fourbar.solving import find_last_stage, solve
from fourbar_validation.scenes.suites import list_model_files

_Choice = TypeVar("_Choice")
_HANG = 5.0
"""Seconds; a scene file takes milliseconds."""
MOST_POSITIONS_OF_A_FILE = 10_000
"""Positions that a mutated file may ask for here. It may have 10^8 of them, but only
the reading of it is tried.
"""
_PIECES = (
    '"',
    "'",
    "[",
    "]",
    "{",
    "}",
    "=",
    "\n",
    "#",
    ",",
    ".",
    "\\",
    "\x00",
    "\ud7ff",
    "é",
    "∞",
    "--",
    "1e999",
    "nan",
    "-0.0",
    "1e308 m",
    "1e-320 m",
    "0 m",
    "inf m",
    "48 kg",
    "deg",
    "m^99",
    "m/s/s/s",
    "9**9**9",
    "(((((",
    "0x10 m",
    "true",
    "[[loads]]",
    "[effects]",
    '"""',
    "'''",
    "1979-05-27",
    "__import__('os')",
    "../../etc/passwd",
    "<script>alert(1)</script>",
    "</mujoco>",
    "${x}",
    "{{x}}",
    "%s%n",
    "steps = 99999999999999999999",
)
"""Text that is put into files: the syntax itself, numbers at the edge, and text that
other formats would run.
"""


def _draw_mutant(seed: int, index: int, originals: Sequence[str]) -> str:
    """Mutate a scene file; which and how depends on (seed, index) alone."""
    rng = np.random.default_rng([seed, index])
    text = _pick(rng, originals)
    for _ in range(int(rng.integers(1, 6))):
        text = _mutate(text, rng, originals)
    return text


def _mutate(
    text: str,
    rng: np.random.Generator,
    originals: Sequence[str],
) -> str:
    if not text:
        return _pick(rng, _PIECES)
    start = int(rng.integers(len(text)))
    length = int(rng.geometric(0.1))
    lines = text.splitlines(keepends=True)
    line = int(rng.integers(len(lines)))
    match int(rng.integers(7)):
        case 0:  # a piece put in
            return text[:start] + _pick(rng, _PIECES) + text[start:]
        case 1:  # a piece in place of a value
            head, _, _ = lines[line].partition("=")
            lines[line] = f"{head}= {_pick(rng, _PIECES)}\n"
            return "".join(lines)
        case 2:  # something cut out
            return text[:start] + text[start + length :]
        case 3:  # one character changed
            return text[:start] + chr(int(rng.integers(1, 0xD7FF))) + text[start + 1 :]
        case 4:  # a line twice
            lines.insert(line, lines[line])
            return "".join(lines)
        case 5:  # two files in one
            donor = _pick(rng, originals)
            return text[:start] + donor[int(rng.integers(len(donor))) :]
        case _:  # a digit changed
            digits = [i for i, character in enumerate(text) if character.isdigit()]
            start = _pick(rng, digits or [0])
            return text[:start] + str(int(rng.integers(10))) + text[start + 1 :]


def _pick(rng: np.random.Generator, choices: Sequence[_Choice]) -> _Choice:
    return choices[int(rng.integers(len(choices)))]


def try_out(text: str) -> str:
    """Read a mutated file and evaluate what it describes.

    Return what it ended in but a scene or one line, or nothing.
    """
    start = time.perf_counter()
    try:
        scene = loads(text, "mutant.toml")
        if scene.motion.free is None:
            commanded = command(scene)
            if len(commanded.theta_2) <= MOST_POSITIONS_OF_A_FILE:
                solve(scene, find_last_stage(scene), at=commanded)
    except FourBarError as error:
        if "\n" in str(error):
            return f"more than one line: {error}"
    except MemoryError:
        # more positions than there is memory for: the command line says so
        pass
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    took = time.perf_counter() - start
    if took > _HANG:
        return f"took {took:.1f} s"
    return ""


@click.command()
@click.option("--count", type=click.IntRange(min=1), default=100_000, show_default=True)
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True)
def fuzz_files(count: int, seed: int) -> int:
    """Read mutated scene files.

    Any traceback or hang is printed with its text, and fails.
    """
    from rich.progress import track

    originals = [file.read_text(encoding="utf-8") for file in list_model_files()]
    failed = 0
    for index in track(range(count), "mutants"):
        text = _draw_mutant(seed, index, originals)
        if what := try_out(text):
            failed += 1
            click.echo(f"mutant {index}: {what}\n{text!r}")
    click.echo(
        f"{count} mutated scene files, {failed} of them ended in a traceback or a hang"
    )
    return 1 if failed else 0
