"""Which scenes a run judges: the named mechanisms of `models/`, the files given, or random linkages."""

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from fourbar.errors import InputError
from fourbar.files import loads, read_text
from fourbar.scene import Scene
from validation.suite.random import LinkageType, random_scene

MODELS = Path(__file__).parent.parent.parent / "models"


class Suite(Protocol):
    """An ordered set of named scenes; each is made where it is judged, so a long suite takes no memory."""

    def __len__(self) -> int: ...

    def name(self, index: int) -> str:
        """Name of a scene; the names are in ascending order."""

    def scene(self, index: int) -> Scene:
        """The scene itself."""

    def fingerprint(self) -> str:
        """Changes when any scene does."""


@dataclass(frozen=True, slots=True)
class Files:
    """Scene files, read once so that a run judges what it began with."""

    texts: tuple[tuple[str, str], ...]
    """(name, text of the file), sorted by name."""

    def __len__(self) -> int:
        return len(self.texts)

    def name(self, index: int) -> str:
        return self.texts[index][0]

    def scene(self, index: int) -> Scene:
        name, text = self.texts[index]
        return loads(text, name)

    def fingerprint(self) -> str:
        return hashlib.sha256(repr(self.texts).encode()).hexdigest()


@dataclass(frozen=True, slots=True)
class Random:
    """`count` random linkages of the given types; scene i depends on (seed, i) alone."""

    count: int
    seed: int
    types: tuple[LinkageType, ...]

    def __len__(self) -> int:
        return self.count

    def name(self, index: int) -> str:
        return f"random-{self.seed}-{index:09d}"

    def scene(self, index: int) -> Scene:
        return random_scene(self.seed, index, self.types)

    def fingerprint(self) -> str:
        return f"random {self.count} {self.seed} {','.join(kind.value for kind in self.types)}"


def model_files() -> list[Path]:
    """The scene files of `models/`, sorted."""
    return sorted(MODELS.glob("*.toml"))


def scene_files(paths: Iterable[Path]) -> Files:
    """Read and check scene files; each is named by its stem, or by its path where two stems are alike.

    Raises InputError for a file that is bad, at once: a long run does not start on bad input.
    """
    files = list(dict.fromkeys(Path(path) for path in paths))
    stems = [file.stem for file in files]
    texts = []
    for file, stem in zip(files, stems, strict=True):
        name = stem if stems.count(stem) == 1 else file.with_suffix("").as_posix()
        text = read_text(file)
        loads(text, str(file))
        texts.append((name, text))
    if not texts:
        raise InputError("SCENE", [], "no scene file to run")
    return Files(tuple(sorted(texts)))
