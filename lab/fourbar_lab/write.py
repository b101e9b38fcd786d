"""`python -m fourbar_lab write`: write the MJCF of every scene in models/.

Each MJCF file lies next to its scene.
"""

import math
import re
from collections.abc import Iterable
from functools import partial
from pathlib import Path

import click

from fourbar.files import load
from fourbar.mjcf import write_mjcf
from fourbar.writing import write_text
from fourbar_validation.places import find_checkout
from fourbar_validation.scenes.suites import list_model_files

NUMBER_IN_AN_MJCF = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
STATE_ROUND_OFF = 1e-12
"""Part by which the assembled state may differ: another processor's sine may end it in
another digit.
"""


def find_stale(files: Iterable[Path]) -> list[Path]:
    """Return the scene files whose MJCF is missing or differs from the generated one.

    Numbers that differ by round-off alone are equal.
    """
    stale = []
    for file in files:
        xml = file.with_suffix(".xml")
        text = xml.read_text(encoding="utf-8") if xml.is_file() else ""
        if not _is_same_model(text, write_mjcf(load(file))):
            stale.append(file)
    return stale


def _is_same_model(one: str, other: str) -> bool:
    if NUMBER_IN_AN_MJCF.split(one) != NUMBER_IN_AN_MJCF.split(other):
        return False
    numbers = zip(
        map(float, NUMBER_IN_AN_MJCF.findall(one)),
        map(float, NUMBER_IN_AN_MJCF.findall(other)),
        strict=True,
    )
    close = partial(math.isclose, rel_tol=STATE_ROUND_OFF, abs_tol=STATE_ROUND_OFF)
    return all(close(a, b) for a, b in numbers)


def write_models(files: Iterable[Path]) -> list[Path]:
    """Write the MJCF of the scenes for which it is stale; those scenes."""
    written = find_stale(files)
    for file in written:
        write_text(file.with_suffix(".xml"), write_mjcf(load(file)))
    return written


@click.command()
def write_command() -> None:
    """Write the MJCF of every scene in models/ for which it is stale."""
    find_checkout("write")
    for file in write_models(list_model_files()):
        click.echo(f"wrote {file.with_suffix('.xml').name}")
