"""The effects a scene can call for, one per file; what a scene does not name does not exist.

An effect is a frozen subclass of `Effect` and holds physics alone; docs/extending.md shows one
being added. Each file is imported when its effect is first named.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fourbar.effects.effect import Actions as Actions
    from fourbar.effects.effect import Effect as Effect
    from fourbar.effects.flywheel import Flywheel as Flywheel
    from fourbar.effects.friction import Friction as Friction
    from fourbar.effects.gravity import Gravity as Gravity
    from fourbar.effects.linear_drive import LinearDrive as LinearDrive
    from fourbar.effects.load import Load as Load
    from fourbar.effects.load import Table as Table
    from fourbar.effects.pin_friction import PinFriction as PinFriction
    from fourbar.effects.spring import Spring as Spring
    from fourbar.effects.spring import SpringEnd as SpringEnd
    from fourbar.effects.spring import Springs as Springs
    from fourbar.effects.torsion import Torsion as Torsion
    from fourbar.effects.viscous import Viscous as Viscous

FILE_OF = {
    "Gravity": "gravity",
    "Viscous": "viscous",
    "Friction": "friction",
    "PinFriction": "pin_friction",
    "Torsion": "torsion",
    "Springs": "spring",
    "Flywheel": "flywheel",
}
"""The effects and their files; a new one is added here."""
OTHER_FILES = {
    "Effect": "effect",
    **dict.fromkeys(("Load", "Table"), "load"),
    **dict.fromkeys(("Spring", "SpringEnd"), "spring"),
    "Actions": "effect",
    "LinearDrive": "linear_drive",
}


def __getattr__(name: str) -> Any:
    file = FILE_OF.get(name) or OTHER_FILES.get(name)
    if file is None:
        raise AttributeError(f"module 'fourbar.effects' has no attribute {name!r}")
    globals()[name] = value = getattr(import_module(f"fourbar.effects.{file}"), name)
    return value


def list_kinds() -> "dict[str, type[Effect]]":
    """List the effects by their keys under ``[effects]``, in the order in which they are listed."""
    return {kind.key: kind for kind in map(__getattr__, FILE_OF)}
