"""The effects a scene can call for, one per file; what a scene does not name does not exist.

An effect is a frozen subclass of `Effect`; docs/adding-an-effect.md shows one being added. Each file
is imported when its effect is first named.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
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

    REGISTRY: dict[str, type[Effect]]

FILE_OF = {
    "Gravity": "gravity",
    "Viscous": "viscous",
    "Friction": "friction",
    "PinFriction": "pin_friction",
    "Torsion": "torsion",
    "Springs": "spring",
    "Flywheel": "flywheel",
}
"""The effects of a scene file, in the order in which they are listed; a new one is added here."""
OTHERS = {
    **dict.fromkeys(("Act", "Effect", "Tree"), "effect"),
    **dict.fromkeys(("Load", "Table"), "load"),
    **dict.fromkeys(("Point", "Spring"), "spring"),
    "Wrenches": "wrenches",
}


def __getattr__(name: str) -> Any:
    if name == "REGISTRY":  # key in a scene file: effect
        value: Any = {effect.key: effect for effect in map(__getattr__, FILE_OF)}
    elif (file := FILE_OF.get(name) or OTHERS.get(name)) is not None:
        value = getattr(import_module(f"fourbar.effects.{file}"), name)
    else:
        raise AttributeError(f"module 'fourbar.effects' has no attribute {name!r}")
    globals()[name] = value
    return value
