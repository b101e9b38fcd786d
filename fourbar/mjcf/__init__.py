"""Model files of a scene for simulators (MJCF, SDF, USD), without any of them."""

from fourbar.mjcf.document import (
    SIMULATORS,
    choose_run,
    list_defaults,
    make_scene,
    size_flywheel,
    write_mjcf,
    write_mjcf_for,
)
from fourbar.mjcf.model import RECIPE, Settings
from fourbar.mjcf.plane import LEVEL, Plane

__all__ = (
    "LEVEL",
    "RECIPE",
    "SIMULATORS",
    "Plane",
    "Settings",
    "choose_run",
    "list_defaults",
    "make_scene",
    "size_flywheel",
    "write_mjcf",
    "write_mjcf_for",
)
