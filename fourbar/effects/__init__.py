"""The effects that a scene can name, one module each.

`FILE_OF` lists those of the package; a file in the folder that it does not list is
found by being there. An effect is a frozen subclass of `Effect` and holds physics
alone; docs/extending.md shows one being added. Each file is imported when its effect is
first named.
"""

from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fourbar.effects.effect import Actions as Actions
    from fourbar.effects.effect import Effect as Effect
    from fourbar.effects.flywheel import Flywheel as Flywheel
    from fourbar.effects.force_drive import ForceDrive as ForceDrive
    from fourbar.effects.friction import Friction as Friction
    from fourbar.effects.gravity import Gravity as Gravity
    from fourbar.effects.linear_drive import LinearDrive as LinearDrive
    from fourbar.effects.load import Load as Load
    from fourbar.effects.load import Table as Table
    from fourbar.effects.pin_friction import PinFriction as PinFriction
    from fourbar.effects.place import Place as Place
    from fourbar.effects.point_drive import PointDrive as PointDrive
    from fourbar.effects.spring import Spring as Spring
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
"""The effects of the package, in the order in which they are listed, and their files.
"""
OTHER_FILES = {
    "Effect": "effect",
    "Actions": "effect",
    "Place": "place",
    "Load": "load",
    "Table": "load",
    "Spring": "spring",
    "ForceDrive": "force_drive",
    "LinearDrive": "linear_drive",
    "PointDrive": "point_drive",
}


def __getattr__(name: str) -> Any:
    file = FILE_OF.get(name) or OTHER_FILES.get(name)
    if file is not None:
        value = getattr(import_module(f"fourbar.effects.{file}"), name)
    elif name.startswith("_"):
        value = None
    else:
        value = list_further().get(name)
    if value is None:
        raise AttributeError(f"module 'fourbar.effects' has no attribute {name!r}")
    globals()[name] = value
    return value


@cache
def list_further() -> "dict[str, type[Effect]]":
    """List by name the effects of the files in the folder that are not listed above."""
    base = __getattr__("Effect")
    known = {*FILE_OF.values(), *OTHER_FILES.values()}
    further: dict[str, type[Effect]] = {}
    for file in iter_modules(__path__):
        if file.name in known:
            continue
        module = import_module(f"fourbar.effects.{file.name}")
        for name, value in vars(module).items():
            is_kind = isinstance(value, type) and issubclass(value, base)
            if is_kind and value.__module__ == module.__name__:
                further[name] = value
    return further


def list_kinds() -> "dict[str, type[Effect]]":
    """List the effects by their keys under ``[effects]``, in their order."""
    kinds = [*map(__getattr__, FILE_OF), *list_further().values()]
    return {kind.key: kind for kind in kinds}
