"""Symbols of everything that acts in a scene: springs, loads, gravity, drive, flywheel, and effects in the pins.

Each symbol knows its bar and its points in that bar's frame, so that whoever draws it (plot, film, page) places it at
any position.
"""

import cmath
from typing import Any, NamedTuple

from fourbar.effects.effect import PinRows
from fourbar.linkage import FIRST_PIN
from fourbar.scene import Scene

NO_SYMBOL: set[str] = set()
"""Effects that no picture shows."""


class Symbol(NamedTuple):
    """One thing that acts."""

    kind: str
    """spring, force, moment, drive, cylinder, flywheel, gravity, or an effect in a pin: torsion, viscous, ..."""
    name: str
    """Label of the symbol."""
    bar: int = 1
    """1 to 4."""
    at: complex = 0.0j
    """Point of action, from the bar's first pin in the bar's frame, m."""
    beyond: complex = 0.0j
    """Vector from there to the point itself, m: in world axes, or in the bar's frame where `turns`."""
    vector: complex = 0.0j
    """Force (N) or field (m/s^2); in world axes, or in the bar's frame where `turns`."""
    turns: bool = False
    moment: float = 0.0
    """N m; of a drive and of what acts in a pin 0."""
    end: "tuple[int, complex] | None" = None
    """Bar and point at the other end of a spring or a cylinder."""
    pin: str = ""
    """Pin of an effect that acts in one."""
    table: Any = None
    """Factor of a load over theta_2."""

    def sign(self, theta_2: float) -> float:
        """Return +1 or -1, 0 where the load's factor is zero."""
        if self.table is None:
            return 1.0
        factor = float(self.table.at(theta_2))
        return (factor > 0.0) - (factor < 0.0)


def list_acting(scene: Scene) -> list[Symbol]:
    """List everything that acts, the drive first; nothing that has no size."""
    symbols = []
    if scene.drive is not None and scene.motion.free is None:
        (bar, *start), (bar_2, *end) = scene.drive.start, scene.drive.end
        symbols.append(Symbol("cylinder", "F", bar, cmath.rect(*start), end=(bar_2, cmath.rect(*end))))
    elif scene.motion.free is None:
        symbols.append(Symbol("drive", f"T{scene.drive_bar}", scene.drive_bar, pin=FIRST_PIN[scene.drive_bar]))
    for number, load in enumerate(scene.loads, 1):
        foot, turns = scene.linkage.bar(load.bar).to_centre, load.frame == "bar"
        if load.force is not None and load.force[0] != 0.0:
            beyond, force = cmath.rect(*load.at), cmath.rect(*load.force)
            symbols.append(Symbol("force", f"load {number}", load.bar, foot, beyond, force, turns, table=load.table))
        if load.moment != 0.0:
            symbols.append(Symbol("moment", f"load {number}", load.bar, foot, moment=load.moment, table=load.table))
    for effect in scene.effects:
        symbols += _list_symbols(effect)
    return symbols


def _list_symbols(effect: Any) -> list[Symbol]:
    """List the symbols of one effect; none of a kind without one."""
    if isinstance(effect, PinRows):
        return [Symbol(effect.key, effect.key.replace("_", " "), pin=pin) for pin, *_ in effect.rows]
    if effect.key == "gravity":
        return [Symbol("gravity", "g", vector=complex(*effect.vector))]
    if effect.key == "flywheel":
        return [Symbol("flywheel", "flywheel", effect.bar, pin=FIRST_PIN[effect.bar])]
    if effect.key == "springs":
        return [
            Symbol("spring", "spring", s.start.bar, cmath.rect(*s.start[1:]), end=(s.end.bar, cmath.rect(*s.end[1:])))
            for s in effect.springs
        ]
    return []
