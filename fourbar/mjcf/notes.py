"""What the model files say of themselves in a comment: how they start, and where their numbers stand."""

import tomllib
from importlib.resources import files
from typing import Any

NOTES: dict[str, Any] = tomllib.loads(files("fourbar.mjcf").joinpath("notes.toml").read_text(encoding="utf-8"))
