"""Make a failing scene smaller while it still fails, and keep it as a scene file that a test reads."""

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path

from fourbar.errors import FourBarError
from fourbar.files import dump, loads, save
from fourbar.scene import Scene
from fourbar_validation.places import CHECKOUT

KEPT = Path("results/counterexamples") if CHECKOUT is None else CHECKOUT / "tests" / "counterexamples"
DIGITS = (1, 2, 3, 6, 10)
ROUNDS = 4
NUMBER = re.compile(r'(?<=")-?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?= )')
"""Of a quantity, before its unit."""
NEEDED = ("[motion]", "theta_2", "omega_2")
"""A scene without them has no torque, and fails for another reason."""


def shrink_scene(scene: Scene, fails: Callable[[Scene], bool]) -> Scene:
    """Simplify a scene by one change of its file at a time while it fails."""
    lines = dump(scene).splitlines()
    for _ in range(ROUNDS):
        before = lines
        for number in reversed(range(len(lines))):  # what a change takes away lies behind
            for simpler in _list_simpler(lines, number):
                try:
                    other = loads("\n".join(simpler))
                    if fails(other):
                        scene, lines = other, simpler
                        break
                except FourBarError:  # no scene any more
                    continue
        if lines == before:
            break
    return scene


def _list_simpler(lines: list[str], number: int) -> Iterator[list[str]]:
    """Leave out one line, or the table that it begins, or put a simpler entry in the line."""
    line, until = lines[number], number + 1
    if line.startswith("["):
        until = next((i for i in range(until, len(lines)) if lines[i].startswith("[")), len(lines))
    if not line.startswith(NEEDED):
        yield [*lines[:number], *lines[until:]]
    key, _, value = line.partition(" = ")
    entries = [f"{key} = {json.dumps(each)}" for each in json.loads(value)] if value.startswith('["') else []
    for digits in DIGITS:
        entries.append(NUMBER.sub(lambda found, digits=digits: f"{float(found[0]):.{digits}g}", line))  # type: ignore[misc]
    for entry in entries:
        if entry != line:
            yield [*lines[:number], entry, *lines[number + 1 :]]


def keep(scene: Scene, name: str, folder: Path = KEPT) -> Path:
    """Write a counter-example where the tests find it."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.toml"
    save(scene, path)
    return path
