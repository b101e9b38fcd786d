"""Entries of somebody's MJCF that the check does not look at."""

import tomllib
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as ET

_ENTRIES = tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8"))
_EVERY = "*"
"""Every attribute of an element."""


def list_unread(text: str) -> list[str]:
    """Return "element attribute" of what a screened MJCF states and no check reads."""

    def walk(element: ET.Element) -> Iterator[str]:
        looked_at = _ENTRIES["read"].get(element.tag)
        if looked_at is None:
            yield element.tag
        elif looked_at != _EVERY:
            for name in element.attrib.keys() - {*looked_at.split()}:
                yield f"{element.tag} {name}"
        if element.tag not in _ENTRIES["skipped"]:
            for part in element:
                yield from walk(part)

    return sorted(set(walk(ET.fromstring(text))))
