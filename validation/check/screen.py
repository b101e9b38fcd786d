"""Somebody's MJCF is data: read with limits, and handed on only as what was screened.

The text that the engine gets is written anew from the elements that were looked at, so nothing
can mean one thing to the reader here and another to the engine's.
"""

from pathlib import Path
from xml.etree import ElementTree as ET

from fourbar.errors import InputError

LARGEST_MJCF = 2**20
"""Bytes; a four-bar takes four thousand."""
DEEPEST = 100
"""Nested elements; the readers of XML recurse."""
REACHING_OUT = ("include", "extension", "plugin", "attach", "composite", "flexcomp", "replicate")
"""Elements that read files, load plugins, or make a thousand bodies of one: no linkage of four bars needs them."""
OUTSIDE = ("file", "meshdir", "texturedir", "assetdir", "directory")
"""Attributes that name files; those of a cube texture are file and a side."""


def read_mjcf(path: Path) -> str:
    """The screened text of an MJCF; InputError says in one line what it may not hold."""

    def refuse(what: object, allowed: str) -> InputError:
        return InputError("--mjcf", what, allowed, str(path))

    try:
        with path.open("rb") as file:
            raw = file.read(LARGEST_MJCF + 1)
    except OSError as error:
        raise refuse(path.name, f"cannot be read: {error.strerror}") from None
    if len(raw) > LARGEST_MJCF:
        raise refuse(path.name, f"must be smaller than {LARGEST_MJCF // 2**20} MB")
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise refuse(path.name, "must be UTF-8") from None
    for word in ("<!DOCTYPE", "<!ENTITY"):
        if word in text.upper():
            raise refuse(word, "is not allowed: an MJCF needs no document type")
    try:
        nesting = _Depth()
        ET.XMLParser(target=nesting).feed(text)
        if nesting.deepest > DEEPEST:
            raise refuse(path.name, f"nests its elements deeper than {DEEPEST}")
        root = ET.fromstring(text)
    except (ET.ParseError, ValueError) as error:
        raise refuse(path.name, f"is no XML: {error}") from None
    if root.tag != "mujoco":
        raise refuse(root.tag, "must be an MJCF, whose outermost element is <mujoco>")
    for element in root.iter():
        if element.tag in REACHING_OUT:
            raise refuse(f"<{element.tag}>", "is not allowed: a linkage is described by the file itself")
        for name in element.attrib:
            if name.startswith(OUTSIDE):
                raise refuse(f"<{element.tag} {name}=...>", "is not allowed: no other file is read")
    return ET.tostring(root, encoding="unicode")


class _Depth:
    """Target of a parser that counts the nesting and keeps nothing."""

    def __init__(self) -> None:
        self.depth = self.deepest = 0

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """An element opens."""
        self.depth += 1
        self.deepest = max(self.deepest, self.depth)

    def end(self, tag: str) -> None:
        """An element closes."""
        self.depth -= 1
