"""Collect the scenes that a run judges.

Scenes are the mechanisms of `models/`, the files given, or random linkages.
"""

import hashlib
import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Protocol

from fourbar import writing
from fourbar.errors import InputError, state_messages_in
from fourbar.files import parse_tables, read_scene_text, read_tables
from fourbar.linkage import record
from fourbar.scene import Scene, default_places
from fourbar.scene.motion import Free, Law, Rise, Sine, Sweep, require_steps
from fourbar.show.shown_units import units_of_scene
from fourbar_validation.compare.rows import escape_controls
from fourbar_validation.places import MODELS
from fourbar_validation.scenes.random import DrawnType, draw_random_scene

MOST_POSITIONS_OF_A_SCENE = 100_000
"""Most positions of a scene in a run. Every engine solves each of them: 3 ms each, with
all engines.
"""
_MOST_SECONDS = 100.0
"""Longest free motion in a run, s. The engines go through it in steps of 1 to 4 ms, a
second in about a second.
"""
AS_LONG_AS = 100
"""Positions that take as long as a second of free motion, generously."""


class Suite(Protocol):
    """An ordered set of named scenes.

    A scene is made where it is judged, so a long suite takes no memory.
    """

    positions: int = 0
    """The most that a scene of files asks for, or what takes as long."""
    not_drawn: frozenset[str] = frozenset()
    """Names of the scenes of which no pictures are made."""

    def __len__(self) -> int: ...

    def name(self, index: int) -> str:
        """Name a scene; the names are in ascending order."""

    def scene(self, index: int) -> Scene:
        """Return the scene itself."""

    def fingerprint(self) -> str:
        """Name the suite; changes when any scene does."""

    def alone(self, index: int) -> "tuple[Suite, int]":
        """Return what a worker needs of a scene: a suite, and its number there."""
        return self, index


@record
class Files(Suite):
    """Scene files, read once so that a run judges what it began with."""

    texts: tuple[tuple[str, str], ...]
    """(name, text of the file), sorted by name."""
    positions: int = 0
    not_drawn: frozenset[str] = frozenset()

    def __len__(self) -> int:
        return len(self.texts)

    def alone(self, index: int) -> "tuple[Files, int]":
        """Return the text of the scene alone."""
        return replace(self, texts=(self.texts[index],)), 0

    def name(self, index: int) -> str:
        """Name a scene."""
        return self.texts[index][0]

    def scene(self, index: int) -> Scene:
        """Read a scene."""
        name, text = self.texts[index]
        return _read_in_its_units(text, name)

    def fingerprint(self) -> str:
        """Hash the texts."""
        return hashlib.sha256(repr(self.texts).encode()).hexdigest()


@record
class Random(Suite):
    """`count` random linkages of the given types, or uneven ones.

    Scene i depends on (seed, i) alone.
    """

    count: int
    seed: int
    types: tuple[DrawnType, ...]

    def __len__(self) -> int:
        return self.count

    def name(self, index: int) -> str:
        """Name a scene."""
        return f"random-{self.seed}-{index:09d}"

    def scene(self, index: int) -> Scene:
        """Draw a scene."""
        return draw_random_scene(self.seed, index, self.types)

    def fingerprint(self) -> str:
        """State what the scenes are drawn from."""
        return (
            f"random {self.count} {self.seed}"
            f" {','.join(kind.value for kind in self.types)}"
        )


def list_model_files() -> list[Path]:
    """List the scene files of `models/`, sorted."""
    return sorted(MODELS.glob("*.toml"))


def list_capability_files() -> list[Path]:
    """List the files of small scenes that together use every capability, sorted."""
    return sorted((MODELS / "capabilities").glob("*.toml"))


def read_default_suite() -> Files:
    """Read the scene files of `models/` and the suite of small scenes."""
    capabilities = list_capability_files()
    suite = read_scene_files([*list_model_files(), *capabilities])
    return replace(suite, not_drawn=frozenset(file.stem for file in capabilities))


def read_scene_files(paths: Iterable[Path]) -> Files:
    """Read and check scene files.

    A scene's name is its file's stem, or its path if two stems are alike. What does not
    print in a name is written as its escape. Raises InputError for a file that is bad,
    and for two of one name, at once: a long run does not start on bad input.
    """
    files = list(dict.fromkeys(Path(path) for path in paths))
    stems = Counter(_write_printed(file.stem) for file in files)
    texts: dict[str, str] = {}
    most = 0
    for file in files:
        name = _write_printed(file.stem)
        if stems[name] > 1:
            name = _write_printed(file.with_suffix("").as_posix())
        if name in texts:
            raise InputError(
                "SCENE",
                str(file),
                f"must have a name of its own: another file is {name!r} too",
            )
        text = read_scene_text(file)
        scene = _read_in_its_units(text, str(file))
        most = max(most, _count_positions(scene, file))
        texts[name] = text
    if not texts:
        raise InputError("SCENE", [], "no scene file to run")
    return Files(tuple(sorted(texts.items())), most)


def _read_in_its_units(text: str, name: str) -> Scene:
    """Read the scene of a text; errors state numbers in its units."""
    tables = parse_tables(text, name)
    with state_messages_in(units_of_scene(tables)):
        return read_tables(tables, name)


def _write_printed(name: str) -> str:
    return escape_controls(name).replace("\n", "\\n")


def _count_positions(scene: Scene, file: Path) -> int:
    """Count the positions that a scene asks for, or what takes as long.

    Raises InputError beyond the most.
    """
    require_steps(scene.motion, MOST_POSITIONS_OF_A_SCENE, "in a run", str(file))
    for stated in (scene.motion.angle, scene.motion.law, scene.motion.free):
        if isinstance(stated, (Sweep, Law, Rise, Sine, Free)):
            seconds = stated.duration if isinstance(stated, Free) else 0.0
            if seconds > _MOST_SECONDS:
                allowed = (
                    f"must not exceed {_MOST_SECONDS:g} s in a run: engines go through"
                    " it in steps of 1 ms"
                )
                key = "motion.free.duration"
                raise InputError(key, seconds, allowed, str(file))
            return stated.steps + 1 + math.ceil(AS_LONG_AS * seconds)
    return len(default_places(scene))


LARGEST_LIST = 16 * 2**20
"""Bytes; a hundred thousand names."""


def read_suite(path: Path) -> Files:
    """Read the scenes that a file lists, named from its own folder.

    The file has one per line. An entry may hold * for any name. InputError where an
    entry leaves the folder or names no file.
    """
    refuse = partial(InputError, "--suite", file=str(path))
    if not path.exists():
        raise refuse(
            path.name,
            'must be "hard" or a file that lists scenes: there is no such file',
        )
    text = writing.read_text(path, "--suite", LARGEST_LIST)
    # one entry each; # begins a comment
    lines = (line.partition("#")[0].strip() for line in text.splitlines())
    files: list[Path] = []
    for entry in filter(None, lines):
        if Path(entry).is_absolute() or ".." in Path(entry).parts or "\0" in entry:
            raise refuse(entry, "must lie in the folder of the list, or below it")
        matches = [path.parent / entry]
        if "*" in entry:
            matches = sorted(path.parent.glob(entry))
        if not matches:
            raise refuse(entry, "names no file")
        files += matches
    return read_scene_files(files)
