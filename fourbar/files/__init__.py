"""Files: scenes in TOML with units, pictures, and how somebody's file is read."""

from fourbar.files.drawn_pins import from_pins
from fourbar.files.scene_file import (
    load,
    loads,
    parse_tables,
    read_scene_text,
    read_tables,
)
from fourbar.files.scene_text import dump, save

__all__ = (
    "dump",
    "from_pins",
    "load",
    "loads",
    "parse_tables",
    "read_scene_text",
    "read_tables",
    "save",
)
