"""The effects a scene can call for, one per file; what a scene does not name does not exist.

An effect is a frozen dataclass with

* ``key``: its name under ``[effects]`` in a scene file;
* ``read(value, reader)`` / ``write(writer)``: its units, at the file edge;
* ``add_wrenches(wrenches, state)``: its term in Newton-Euler;
* ``power(state)``: the power it puts into the linkage, for the energy method, derived on its own;
* ``add_mjcf(model)``: its term in MJCF.
"""

from fourbar.effects.friction import Friction as Friction
from fourbar.effects.gravity import Gravity as Gravity
from fourbar.effects.load import Load as Load
from fourbar.effects.viscous import Viscous as Viscous
from fourbar.effects.wrenches import Wrenches as Wrenches

REGISTRY = {effect.key: effect for effect in (Gravity, Viscous, Friction)}
