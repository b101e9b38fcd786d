"""The effects that a scene can name, one module each.

An effect is found by its file being in the folder. It is a frozen subclass of `Effect`
and holds physics alone; docs/extending.md shows one being added. The files are imported
when one of their classes is first named.
"""

from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fourbar.effects.effect import Actions, Effect
    from fourbar.effects.flywheel import Flywheel
    from fourbar.effects.force_drive import ForceDrive, LinearDrive, PointDrive
    from fourbar.effects.friction import Friction
    from fourbar.effects.gravity import Gravity
    from fourbar.effects.load import Load, Table
    from fourbar.effects.pin_friction import PinFriction
    from fourbar.effects.place import Place
    from fourbar.effects.spring import Spring, Springs
    from fourbar.effects.torsion import Torsion
    from fourbar.effects.viscous import Viscous

__all__ = (
    "Actions",
    "Effect",
    "Flywheel",
    "ForceDrive",
    "Friction",
    "Gravity",
    "LinearDrive",
    "Load",
    "PinFriction",
    "Place",
    "PointDrive",
    "Spring",
    "Springs",
    "Table",
    "Torsion",
    "Viscous",
)

FIRST_FILES = (
    "gravity",
    "viscous",
    "friction",
    "pin_friction",
    "torsion",
    "spring",
    "flywheel",
)
"""Files whose effects come first, in this order, where effects are listed."""


@cache
def list_classes() -> dict[str, Any]:
    """List the classes of the files in the folder by their names."""
    files = dict.fromkeys(
        (*FIRST_FILES, *(file.name for file in iter_modules(__path__)))
    )
    classes = dict[str, Any]()
    for file in files:
        module = import_module(f"fourbar.effects.{file}")
        for name, value in vars(module).items():
            if isinstance(value, type) and value.__module__ == module.__name__:
                classes[name] = value
    return classes


def __getattr__(name: str) -> Any:
    value = None if name.startswith("_") else list_classes().get(name)
    if value is None:
        raise AttributeError(f"module 'fourbar.effects' has no attribute {name!r}")
    globals()[name] = value
    return value


def list_kinds() -> "dict[str, type[Effect]]":
    """List the effects by their keys under ``[effects]``, in their order."""
    base = __getattr__("Effect")
    return {
        kind.key: kind
        for name, kind in list_classes().items()
        if issubclass(kind, base) and "key" in vars(kind) and name != "Load"
    }
