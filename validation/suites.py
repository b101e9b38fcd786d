"""Which scenes a run judges: the named mechanisms of `models/`, or the files given."""

from collections.abc import Iterable
from pathlib import Path

from fourbar.errors import InputError
from fourbar.files import load
from fourbar.scene import Scene

MODELS = Path(__file__).parent.parent / "models"


def model_files() -> list[Path]:
    """The scene files of `models/`, sorted."""
    return sorted(MODELS.glob("*.toml"))


def named_scenes(paths: Iterable[Path]) -> list[tuple[str, Scene]]:
    """Every scene with a name of its own: the file's stem, or its path where two stems are alike."""
    files = [Path(path) for path in paths]
    stems = [file.stem for file in files]
    seen: set[str] = set()
    scenes = []
    for file, stem in zip(files, stems, strict=True):
        name = stem if stems.count(stem) == 1 else file.with_suffix("").as_posix()
        if name in seen:
            raise InputError("SCENE", str(file), "is given twice")
        seen.add(name)
        scenes.append((name, load(file)))
    if not scenes:
        raise InputError("SCENE", [], "no scene file to run")
    return scenes
