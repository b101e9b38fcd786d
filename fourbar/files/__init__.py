"""Files: scenes in TOML with units, pictures, and how somebody's file is read."""

from fourbar.files.drawing import from_pins as from_pins
from fourbar.files.scene_file import load as load
from fourbar.files.scene_file import loads as loads
from fourbar.files.scene_file import parse_tables as parse_tables
from fourbar.files.scene_file import read_scene_text as read_scene_text
from fourbar.files.scene_file import read_tables as read_tables
from fourbar.files.scene_text import dump as dump
from fourbar.files.scene_text import save as save
