"""Closed formulas of the planar four-bar linkage: driving torque and pin forces."""

from importlib import import_module as _import_module
from types import ModuleType as _ModuleType
from typing import TYPE_CHECKING as _TYPE_CHECKING
from typing import Any as _Any

from fourbar.errors import DependencyError as DependencyError
from fourbar.errors import FourBarError as FourBarError
from fourbar.errors import InputError as InputError
from fourbar.errors import NotAssembledError as NotAssembledError
from fourbar.formulas.mobility import change_points as change_points
from fourbar.formulas.mobility import circuits as circuits
from fourbar.formulas.mobility import classify as classify
from fourbar.formulas.mobility import limit_positions as limit_positions
from fourbar.formulas.mobility import swing as swing
from fourbar.formulas.mobility import time_ratio as time_ratio
from fourbar.linkage import Bar as Bar
from fourbar.linkage import FourBar as FourBar
from fourbar.linkage import uniform as uniform
from fourbar.scene import Scene as Scene
from fourbar.scene import command as command
from fourbar.scene.drawing import DrawnPins as DrawnPins
from fourbar.scene.motion import Free as Free
from fourbar.scene.motion import FromLimit as FromLimit
from fourbar.scene.motion import Law as Law
from fourbar.scene.motion import Motion as Motion
from fourbar.scene.motion import Rise as Rise
from fourbar.scene.motion import Sweep as Sweep
from fourbar.scene.numbers import Point as Point
from fourbar.scene.numbers import Tolerance as Tolerance
from fourbar.scene.pictures import Picture as Picture
from fourbar.solution import Solution as Solution
from fourbar.solving import solve as solve

__version__ = "1.0.0"

if _TYPE_CHECKING:
    from fourbar.effects import Flywheel as Flywheel
    from fourbar.effects import Friction as Friction
    from fourbar.effects import Gravity as Gravity
    from fourbar.effects import LinearDrive as LinearDrive
    from fourbar.effects import Load as Load
    from fourbar.effects import PinFriction as PinFriction
    from fourbar.effects import Place as Place
    from fourbar.effects import PointDrive as PointDrive
    from fourbar.effects import Spring as Spring
    from fourbar.effects import Springs as Springs
    from fourbar.effects import Table as Table
    from fourbar.effects import Torsion as Torsion
    from fourbar.effects import Viscous as Viscous
    from fourbar.evaluation.free_motion import Released as Released
    from fourbar.evaluation.free_motion import release as release
    from fourbar.files import dump as dump
    from fourbar.files import from_pins as from_pins
    from fourbar.files import load as load
    from fourbar.files import save as save
    from fourbar.formulas.points import point_coefficients as point_coefficients
    from fourbar.formulas.transmission import (
        transmission_extremes as transmission_extremes,
    )
    from fourbar.show.duty import bearing_load as bearing_load
    from fourbar.show.duty import motor_duty as motor_duty
    from fourbar.show.duty import shaking_force as shaking_force
    from fourbar.show.duty import shaking_moment as shaking_moment
    from fourbar.show.notebook import in_units as in_units
    from fourbar.show.units import units as units
    from fourbar.studies.derivatives import Sensitivity as Sensitivity
    from fourbar.studies.derivatives import sensitivity as sensitivity
    from fourbar.studies.equilibrium import equilibrium as equilibrium
    from fourbar.studies.internal_forces import internal_forces as internal_forces
    from fourbar.studies.points import coupler_curve as coupler_curve
    from fourbar.studies.points import instant_centres as instant_centres
    from fourbar.studies.spread import tolerances as tolerances
    from fourbar.studies.study import Study as Study
    from fourbar.studies.study import vary as vary

_EFFECTS = (
    *(
        "Flywheel",
        "Friction",
        "Gravity",
        "LinearDrive",
        "Load",
        "PinFriction",
        "Place",
        "PointDrive",
        "Spring",
        "Springs",
    ),
    *("Table", "Torsion", "Viscous"),
)
_ON_FIRST_USE = {
    **{name: "fourbar.effects" for name in _EFFECTS},
    **{name: "fourbar.files" for name in ("dump", "from_pins", "load", "save")},
    **{name: "fourbar.studies.points" for name in ("coupler_curve", "instant_centres")},
    "point_coefficients": "fourbar.formulas.points",
    **{
        name: "fourbar.show.duty"
        for name in ("bearing_load", "motor_duty", "shaking_force", "shaking_moment")
    },
    **{name: "fourbar.studies.derivatives" for name in ("Sensitivity", "sensitivity")},
    **{name: "fourbar.studies.study" for name in ("Study", "vary")},
    **{name: "fourbar.evaluation.free_motion" for name in ("Released", "release")},
    "transmission_extremes": "fourbar.formulas.transmission",
    "equilibrium": "fourbar.studies.equilibrium",
    "internal_forces": "fourbar.studies.internal_forces",
    "tolerances": "fourbar.studies.spread",
    "in_units": "fourbar.show.notebook",
    "units": "fourbar.show.units",
}
"""Modules of names that few programs use, or that need more than numpy. `import
fourbar` loads none of them.
"""


def __getattr__(name: str) -> _Any:
    if name in _ON_FIRST_USE:
        return getattr(_import_module(_ON_FIRST_USE[name]), name)
    raise AttributeError(f"module 'fourbar' has no attribute {name!r}")


def __dir__() -> list[str]:
    """List the public names; the modules behind them stay out of the list."""
    public = [
        name
        for name, value in globals().items()
        if name[0] != "_" and not isinstance(value, _ModuleType)
    ]
    return sorted([*public, *_ON_FIRST_USE, "__version__"])


__all__ = __dir__()  # noqa: PLE0605 - the names above, once
