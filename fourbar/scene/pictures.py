"""Pictures that a scene file names: of bars, and one under the drawing.

`fourbar animate` lays a picture along its bar; the workbench shows the other one to
trace a linkage. A scene file may be a stranger's: it can name a file in its own folder
or below, no other, and what is read there must be a picture of moderate size.
"""

import base64
import os
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, Self

from fourbar.errors import InputError, expect
from fourbar.linkage import (
    AT_LEAST_ZERO,
    BAR_NAMES,
    POSITIVE,
    Declared,
    Described,
    Text,
    record,
    require_bar,
)
from fourbar.writing import read_bytes

LARGEST_PICTURE = 2_000_000
"""Bytes of one picture: a page with three of them still opens quickly."""
_RASTER = {b"\x89PNG\r\n\x1a\n": "image/png", b"\xff\xd8\xff": "image/jpeg"}
"""First bytes of the formats that may be attached. SVG may not, because it can carry
scripts.
"""
ALLOWED_PICTURE = (
    "must be the name of a PNG or JPEG file next to the scene file or below its folder,"
    ' like "coupler.png"'
)
LONGEST_FILE_NAME = 200
"""Characters of a file's name: file systems take some 255 bytes."""
LONGEST_SVG_HEAD = 2000
"""Bytes within which an SVG file has its first tag."""


class _PictureFile:
    """A picture by its name in the folder of a scene file."""

    __slots__ = ()
    key: Any = "picture.file"
    """Key of the picture in a scene file."""
    name: str
    folder: str

    def __post_init__(self) -> None:
        expect("picture.folder", self.folder, str, Path)
        parts = self.name.split("/") if isinstance(self.name, str) else ["."]
        plain = all(
            part not in ("", ".", "..") and not set(part) & set('\\:*?"<>|')
            for part in parts
        )
        if (
            not plain
            or not self.name.isprintable()
            or len(self.name) > LONGEST_FILE_NAME
        ):
            raise InputError(self.key, self.name, ALLOWED_PICTURE)

    def find_file(self) -> Path:
        """Return the path; InputError where a link leads out of the folder."""
        root = Path(self.folder).resolve()
        file = root.joinpath(self.name).resolve()
        if not file.is_relative_to(root):
            allowed = f"leads out of the scene's folder; {ALLOWED_PICTURE}"
            raise InputError(self.key, self.name, allowed)
        return file

    def moved(self, folder: Path) -> Self:
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
        name = PurePosixPath(file.relative_to(target)).as_posix()
        return replace(self, name=name, folder=os.fspath(folder))  # type: ignore[type-var]


@record
class TracedPicture(_PictureFile, Described):
    """The picture that lies under the drawing in the workbench.

    Parameters
    ----------
    name : as that of `Picture`; a PNG, JPEG or SVG file.
    origin : pixel (x, y), from the upper left, that lies in the drawing's origin; left
        out: the middle of the picture.
    scale : length of a pixel, m; left out: the picture is as wide as the drawing.
    angle : by which it is turned counter-clockwise, rad.
    opacity : 0 to 1.
    folder : where the scene file is.
    """

    name: Annotated[str, Text("file")]
    origin: Annotated[tuple[float, float] | None, Declared("1", pair="1")] = None
    scale: Annotated[float | None, Declared("m", POSITIVE)] = None
    angle: Annotated[float, Declared("rad")] = 0.0
    opacity: Annotated[float, Declared("1", AT_LEAST_ZERO)] = 0.5
    folder: str = "."
    stated_at = "picture"

    def __post_init__(self) -> None:
        Described.__post_init__(self)
        _PictureFile.__post_init__(self)
        if self.opacity > 1.0:
            raise InputError("picture.opacity", self.opacity, "must be from 0 to 1")

    def read(self) -> tuple[bytes, str]:
        """Return the content of the file and its type, as a browser names it."""
        return read_picture(self.key, self.find_file(), self.name, svg=True)


@record
class Picture(_PictureFile):
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
        _PictureFile.__post_init__(self)

    @property
    def key(self) -> str:
        """Key of the picture in a scene file."""
        return f"bars.{BAR_NAMES[self.bar]}.picture"

    def data_uri(self) -> str:
        """Encode the picture as it is embedded in a page.

        Raises InputError where a link leads out of the folder, and as `encode_picture`
        does.
        """
        return encode_picture(self.key, self.find_file(), self.name)


def read_picture(
    key: str, path: str | Path, shown: str, *, svg: bool = False
) -> tuple[bytes, str]:
    """Return the content of a picture and its type, as a browser names it.

    `svg`: take an SVG file too.

    Raises InputError, in one line, as `read_bytes` does, and for another type.
    """
    content = read_bytes(path, key, LARGEST_PICTURE, shown=shown)
    for magic, kind in _RASTER.items():
        if content.startswith(magic):
            return content, kind
    if svg and b"<svg" in content[:LONGEST_SVG_HEAD]:
        return content, "image/svg+xml"
    formats = "PNG, JPEG or SVG" if svg else "PNG or JPEG"
    raise InputError(key, shown, f"must be a {formats} picture")


def encode_picture(key: str, path: str | Path, shown: str | None = None) -> str:
    """Encode a PNG or JPEG file as a data URI; InputError as `read_picture` raises."""
    content, kind = read_picture(key, path, shown or str(path))
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"
