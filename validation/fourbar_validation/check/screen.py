"""Somebody's MJCF is data: read with limits, and handed on only as what was screened.

The text that the engine gets is written anew from the elements that were looked at, so nothing
can mean one thing to the reader here and another to the engine's.
"""

import io
import re
from pathlib import Path
from xml.etree import ElementTree as ET

from fourbar.errors import InputError
from fourbar.files.reading import read_text

LARGEST_MJCF = 2**20
"""Bytes; a four-bar takes four thousand."""
DEEPEST = 100
"""Nested elements; the readers of XML recurse."""
REACHING_OUT = ("include", "extension", "plugin", "attach", "composite", "flexcomp", "replicate")
"""Elements that read files, load plugins, or make a thousand bodies of one: no linkage of four bars needs them."""
OUTSIDE = ("file", "meshdir", "texturedir", "assetdir", "directory")
"""Attributes that name files; those of a cube texture are file and a side."""

COUNTS = ("iterations", "ls_iterations", "noslip_iterations", "ccd_iterations", "sdf_iterations", "sdf_initpoints")
MOST_ITERATIONS = 1000
"""Upper limit of each count in <option>, ten times the greatest of MuJoCo's defaults: MuJoCo already steps while it
compiles, and with a tolerance of 0 nothing else may stop a solver."""


def read_mjcf(path: Path) -> str:
    """Read the text of an MJCF; InputError says in one line what it may not hold."""

    def refuse(what: object, allowed: str) -> InputError:
        return InputError("MJCF", what, allowed, str(path))

    text = read_text(path, "MJCF", LARGEST_MJCF)
    for word in ("<!DOCTYPE", "<!ENTITY"):
        if word in text.upper():
            raise refuse(word, "is not allowed: an MJCF needs no document type")
    parsed, depth = ET.iterparse(io.StringIO(text), ("start", "end")), 0
    try:
        for event, _ in parsed:
            depth += 1 if event == "start" else -1
            if depth > DEEPEST:
                raise refuse(path.name, f"nests its elements deeper than {DEEPEST}")
    except (ET.ParseError, ValueError) as error:
        raise refuse(path.name, f"is no XML: {error}") from None
    root = parsed.root  # type: ignore[attr-defined]
    if root.tag != "mujoco":
        raise refuse(root.tag, "must be an MJCF, whose outermost element is <mujoco>")
    for element in root.iter():
        if element.tag in REACHING_OUT:
            raise refuse(f"<{element.tag}>", "is not allowed: a linkage is described by the file itself")
        for name in element.attrib:
            if element.tag == "option" and name in COUNTS:
                count = element.attrib[name].strip()
                if not re.fullmatch("[0-9]{1,9}", count) or int(count) > MOST_ITERATIONS:
                    allowed = f"must be a whole number up to {MOST_ITERATIONS}: MuJoCo might never come back"
                    raise refuse(f'<option {name}="{count}">', allowed)
            if name.startswith(OUTSIDE):
                raise refuse(f"<{element.tag} {name}=...>", "is not allowed: no other file is read")
    return ET.tostring(root, encoding="unicode")
