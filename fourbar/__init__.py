"""Closed formulas of the planar four-bar linkage: from position to driving torque and pin forces."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from fourbar.errors import FourBarError as FourBarError
from fourbar.errors import InputError as InputError
from fourbar.linkage import Bar as Bar
from fourbar.linkage import FourBar as FourBar
from fourbar.linkage import uniform as uniform
from fourbar.scene import Scene as Scene
from fourbar.scene import command as command
from fourbar.scene.motion import Free as Free
from fourbar.scene.motion import FromLimit as FromLimit
from fourbar.scene.motion import Motion as Motion
from fourbar.scene.motion import Sweep as Sweep
from fourbar.scene.point import Point as Point
from fourbar.scene.tolerance import Tolerance as Tolerance
from fourbar.solution import Solution as Solution
from fourbar.solve import solve as solve

__version__ = "0.1.0"

if TYPE_CHECKING:
    from fourbar.effects import Friction as Friction
    from fourbar.effects import Gravity as Gravity
    from fourbar.effects import Load as Load
    from fourbar.effects import Viscous as Viscous
    from fourbar.files import dump as dump
    from fourbar.files import load as load
    from fourbar.studies import Sensitivity as Sensitivity
    from fourbar.studies import Study as Study
    from fourbar.studies import extremes as extremes
    from fourbar.studies import sensitivity as sensitivity
    from fourbar.studies import tolerances as tolerances
    from fourbar.studies import vary as vary


def _notebook(name: str) -> Any:
    """How a notebook shows a scene or a solution; what draws it is loaded when it does."""

    def show(self: Any) -> str:
        return str(getattr(import_module("fourbar.show.notebook"), name)(self))

    return show


setattr(Scene, "_repr_html_", _notebook("scene_html"))  # noqa: B010 - declared where it is drawn
setattr(Solution, "_repr_html_", _notebook("solution_html"))  # noqa: B010


def __getattr__(name: str) -> Any:
    # the file edge needs a units library, most scenes few effects, and few are varied: loaded on first use
    if name in ("load", "dump"):
        return getattr(import_module("fourbar.files"), name)
    if name in ("Friction", "Gravity", "Load", "Viscous"):
        return getattr(import_module("fourbar.effects"), name)
    if name in ("Sensitivity", "Study", "extremes", "sensitivity", "tolerances", "vary"):
        return getattr(import_module("fourbar.studies"), name)
    raise AttributeError(f"module 'fourbar' has no attribute {name!r}")
