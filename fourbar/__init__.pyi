"""The public names of fourbar.

Each module is imported when one of its names is first used.
"""

from .effects import Flywheel as Flywheel
from .effects import Friction as Friction
from .effects import Gravity as Gravity
from .effects import LinearDrive as LinearDrive
from .effects import Load as Load
from .effects import PinFriction as PinFriction
from .effects import Place as Place
from .effects import PointDrive as PointDrive
from .effects import Spring as Spring
from .effects import Springs as Springs
from .effects import Table as Table
from .effects import Torsion as Torsion
from .effects import Viscous as Viscous
from .errors import DependencyError as DependencyError
from .errors import FourBarError as FourBarError
from .errors import InputError as InputError
from .errors import NotAssembledError as NotAssembledError
from .evaluation.free_motion import Released as Released
from .evaluation.free_motion import release as release
from .files import dump as dump
from .files import from_pins as from_pins
from .files import load as load
from .files import save as save
from .formulas.mobility import change_points as change_points
from .formulas.mobility import circuits as circuits
from .formulas.mobility import classify as classify
from .formulas.mobility import limit_positions as limit_positions
from .formulas.mobility import swing as swing
from .formulas.mobility import time_ratio as time_ratio
from .formulas.points import point_coefficients as point_coefficients
from .formulas.transmission import transmission_extremes as transmission_extremes
from .linkage import Bar as Bar
from .linkage import FourBar as FourBar
from .linkage import uniform as uniform
from .scene import Scene as Scene
from .scene import command as command
from .scene.drawing import DrawnPins as DrawnPins
from .scene.motion import Free as Free
from .scene.motion import FromLimit as FromLimit
from .scene.motion import Law as Law
from .scene.motion import Motion as Motion
from .scene.motion import Rise as Rise
from .scene.motion import Sine as Sine
from .scene.motion import Sweep as Sweep
from .scene.numbers import Point as Point
from .scene.numbers import Tolerance as Tolerance
from .scene.pictures import Picture as Picture
from .show.duty import bearing_load as bearing_load
from .show.duty import motor_duty as motor_duty
from .show.duty import shaking_force as shaking_force
from .show.duty import shaking_moment as shaking_moment
from .show.shown_units import units as units
from .solution import Solution as Solution
from .solving import solve as solve
from .studies.derivatives import Sensitivity as Sensitivity
from .studies.derivatives import sensitivity as sensitivity
from .studies.equilibrium import equilibrium as equilibrium
from .studies.internal_forces import internal_forces as internal_forces
from .studies.points import coupler_curve as coupler_curve
from .studies.points import instant_centres as instant_centres
from .studies.spread import tolerances as tolerances
from .studies.study import Study as Study
from .studies.study import vary as vary

__version__: str
