"""The effects a scene can call for, one per file; what a scene does not name does not exist.

An effect is a frozen subclass of `Effect`; docs/adding-an-effect.md shows one being added.
"""

from fourbar.effects.effect import Act as Act
from fourbar.effects.effect import Effect as Effect
from fourbar.effects.effect import Tree as Tree
from fourbar.effects.flywheel import Flywheel as Flywheel
from fourbar.effects.friction import Friction as Friction
from fourbar.effects.gravity import Gravity as Gravity
from fourbar.effects.load import Load as Load
from fourbar.effects.load import Table as Table
from fourbar.effects.pin_friction import PinFriction as PinFriction
from fourbar.effects.spring import Point as Point
from fourbar.effects.spring import Spring as Spring
from fourbar.effects.spring import Springs as Springs
from fourbar.effects.torsion import Torsion as Torsion
from fourbar.effects.viscous import Viscous as Viscous
from fourbar.effects.wrenches import Wrenches as Wrenches

REGISTRY: dict[str, type[Effect]] = {
    effect.key: effect for effect in (Gravity, Viscous, Friction, PinFriction, Torsion, Springs, Flywheel)
}
"""The effects of a scene file; a new one is added here."""
