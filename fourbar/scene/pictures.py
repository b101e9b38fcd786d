"""Pictures of the bars: named in a scene file, laid along the bar by `fourbar animate`.

A scene file may be a stranger's: it can name a file in its own folder or below, no
other, and what is read there must be a PNG or JPEG of moderate size.
"""

import base64
import os
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from fourbar.errors import InputError, expect
from fourbar.linkage import BAR_NAMES, require_bar
from fourbar.writing import read_bytes

LARGEST_PICTURE = 2_000_000
"""Bytes of one picture: a page with three of them still opens quickly."""
LONGEST_FILE_NAME = 200
_RASTER = {b"\x89PNG\r\n\x1a\n": "image/png", b"\xff\xd8\xff": "image/jpeg"}
"""First bytes of the formats that may be attached. SVG may not, because it can carry
scripts.
"""
ALLOWED_PICTURE = (
    "must be the name of a PNG or JPEG file next to the scene file or below its folder,"
    ' like "coupler.png"'
)


@dataclass(frozen=True, slots=True)
class Picture:
    """The picture of a moving bar.

    Parameters
    ----------
    bar : 2, 3 or 4.
    name : path relative to the scene file, parts joined by "/", none of them "..".
    folder : where the scene file is.

    Raises InputError for a bar that does not move and for a name that leads out of the
    folder.
    """

    bar: int
    name: str
    folder: str = "."

    def __post_init__(self) -> None:
        object.__setattr__(self, "bar", require_bar("picture.bar", self.bar))
        expect("picture.folder", self.folder, str, Path)
        if isinstance(self.name, str):
            parts = self.name.split("/")
        else:
            parts = []
        plain = all(
            part not in ("", ".", "..") and not set(part) & set('\\:*?"<>|')
            for part in parts
        )
        if (
            not parts
            or not plain
            or not self.name.isprintable()
            or len(self.name) > LONGEST_FILE_NAME
        ):
            raise InputError(self.key, self.name, ALLOWED_PICTURE)

    @property
    def key(self) -> str:
        """Key of the picture in a scene file."""
        return f"bars.{BAR_NAMES[self.bar]}.picture"

    def data_uri(self) -> str:
        """Encode the picture as it is embedded in a page.

        Raises InputError where a link leads out of the folder, and as `encode_picture`
        does.
        """
        folder = Path(self.folder).resolve()
        file = (folder / self.name).resolve()
        if not file.is_relative_to(folder):
            raise InputError(
                self.key,
                self.name,
                f"leads out of the scene's folder; {ALLOWED_PICTURE}",
            )
        return encode_picture(self.key, file, self.name)

    def moved(self, folder: Path) -> "Picture":
        """Return the same file as a scene file in another folder names it.

        Raises InputError where it does not lie in that folder.
        """
        file = Path(self.folder).resolve() / self.name
        target = folder.resolve()
        if not file.is_relative_to(target):
            raise InputError(
                self.key,
                os.fspath(file),
                f"does not lie in {os.fspath(target)}: copy it there first",
            )
        return Picture(
            self.bar,
            PurePosixPath(file.relative_to(target)).as_posix(),
            os.fspath(folder),
        )


def encode_picture(key: str, path: str | Path, shown: str | None = None) -> str:
    """Encode a PNG or JPEG file as a data URI.

    Raises InputError, in one line, as `read_bytes` does, and for a file that begins as
    neither.
    """
    name = str(path) if shown is None else shown
    content = read_bytes(path, key, LARGEST_PICTURE, shown=name)
    kind = next(
        (kind for magic, kind in _RASTER.items() if content.startswith(magic)),
        None,
    )
    if kind is None:
        raise InputError(key, name, "must be a PNG or JPEG picture")
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"
