"""Symbols of everything that acts in a scene.

Springs, loads, gravity, drive, flywheel, and effects in the pins have symbols. Each
symbol knows its bar and its points in that bar's frame: plot, film and page place it at
any position. Here they are drawn with matplotlib, and so are arrows of velocity and
acceleration at points.
"""

import cmath
import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fourbar.effects import Gravity, LinearDrive, PointDrive
from fourbar.effects.effect import PinRows
from fourbar.effects.place import At, Line
from fourbar.linkage import (
    ENDS,
    FIRST_PIN,
    MOVING_BARS,
    Entries,
    OfBar,
    list_declared,
)
from fourbar.scene import Scene
from fourbar.show.derived import derive, list_point_names
from fourbar.show.plot.curves import choose_limit
from fourbar.show.plot.labels import add_label
from fourbar.show.plot.style import (
    INK,
    MUTED,
    draw_arrow,
    largest_magnitude,
    plot_points,
    write_pin_name,
)
from fourbar.show.plot.view import View
from fourbar.solution import Solution

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LOAD_COLOUR = "#8A3B78"
SPRING = "#6b5b00"
SYMBOL_COLOURS = {
    "force": LOAD_COLOUR,
    "moment": LOAD_COLOUR,
    "drive": INK,
    "push": INK,
    "cylinder": INK,
    "gravity": MUTED,
    "flywheel": MUTED,
    "spring": SPRING,
    "torsion": SPRING,
}
_ARROW_SIZES = {"force": 7.0, "moment": 2.6, "drive": 3.2}
"""Length of a force's arrow and radii of couples, in sizes of a support."""
_RINGS = {
    "viscous": (1.5, -0.4),
    "friction": (1.8, 0.4),
    "pin_friction": (1.8, 0.9),
    "flywheel": (4.0, -1.0),
    "torsion": (2.2, 0.0),
}
"""Radius of a ring, in sizes of a support, and the angle at which its name stands, rad.
Several names at one pin do not meet.
"""
_RING_OF_OTHERS = (2.1, 1.4)
SMALLEST, _SHARE = 0.5, 0.12
"""Least part of its size that a symbol at a pin keeps, and the part of the shortest bar
there that it may take.
"""
_ARROWS = {"v": ("#0B6E99", "velocity"), "a": ("#B3261E", "acceleration")}
COILS = 7


class Symbol(NamedTuple):
    """Symbol of one thing that acts."""

    kind: str
    """spring, force, moment, drive, cylinder, flywheel, gravity, or an effect in a pin.
    These are torsion, viscous, ...
    """
    name: str
    """Label of the symbol."""
    bar: int = 1
    """1 to 4."""
    at: complex = 0.0j
    """Point of action, from the bar's first pin in the bar's frame, m."""
    beyond: complex = 0.0j
    """Vector from there to the point itself, m, in world axes. It is an arm that keeps
    its direction.
    """
    vector: complex = 0.0j
    """Force (N) or field (m/s^2) in world axes. It is in the bar's frame where `turns`.
    """
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
    """List everything that acts, the drive first; nothing that has no size.

    A torque is no drive where positions alone are asked for.
    """
    symbols = list[Symbol]()
    scene = scene.settled()
    motion = scene.motion
    has_torque = motion.speed is not None or motion.law is not None
    if motion.free is None and (has_torque or scene.drive is not None):
        symbols.append(_make_drive(scene))
    for number, load in enumerate(scene.loads, 1):
        at = load.foot(scene.linkage.bar(load.bar).to_centre)
        arm = 0j if load.arm is None else cmath.rect(*load.arm)
        of_load = Symbol("", f"load {number}", load.bar, at, arm, table=load.table)
        if load.force is not None and load.force[0] != 0.0:
            vector = cmath.rect(*load.force)
            turns = load.frame == "bar"
            symbols.append(of_load._replace(kind="force", vector=vector, turns=turns))
        if load.moment != 0.0:
            symbols.append(of_load._replace(kind="moment", moment=load.moment))
    for effect in scene.effects:
        symbols += _list_symbols(effect.key, effect)
    return symbols


def _list_symbols(kind: str, one: Any) -> list[Symbol]:
    """List the symbols of an effect, or of one entry of it, by its declared fields.

    A line between two places is drawn as a spring, what acts at a pin, about the first
    pin of a bar or at a place as a ring.
    """
    name = kind.replace("_", " ")
    if isinstance(one, PinRows):
        return [Symbol(kind, name, pin=pin) for pin, *_ in one.rows]
    if isinstance(one, Gravity):
        return [Symbol("gravity", "g", vector=complex(*one.vector))]
    if isinstance(one, Line):
        return [_join_ends("spring", type(one).__name__.lower(), one)]
    symbols = list[Symbol]()
    for declared in list_declared(type(one)):
        value = getattr(one, declared.name)
        if isinstance(declared.by, OfBar):
            symbols.append(Symbol(kind, name, value, pin=FIRST_PIN[value]))
        elif isinstance(declared.by, At):
            symbols.append(Symbol(kind, name, value.bar, value.vector()))
        elif isinstance(declared.by, Entries):
            for entry in value:
                symbols += _list_symbols(kind, entry)
    return symbols


def _make_drive(scene: Scene) -> Symbol:
    """Make the symbol of the drive, which exerts a torque or a force."""
    drive = scene.drive
    bar = scene.drive_bar
    if isinstance(drive, LinearDrive):
        return _join_ends("cylinder", "F", drive)
    if drive is None:
        return Symbol("drive", f"T{bar}", bar, pin=FIRST_PIN[bar])
    assert isinstance(drive, PointDrive)
    place = drive.place
    direction = cmath.rect(1.0, drive.direction)
    turns = drive.frame == "bar"
    at = place.vector()
    return Symbol("push", "F", place.bar, at, vector=direction, turns=turns)


def _join_ends(kind: str, name: str, line: Any) -> Symbol:
    """Make the symbol of a line between two points."""
    start, end = ((place.bar, place.vector()) for place in (line.start, line.end))
    return Symbol(kind, name, *start, end=end)


class Pose:
    """One position of a solution in the coordinates of a drawing."""

    def __init__(self, view: View, solution: Solution, index: int) -> None:
        linkage = view.scene.linkage
        self.plane = view.plane
        self.theta_2 = float(solution.theta_2[index])
        self.u = {1: cmath.rect(1.0, linkage.ground_angle)}
        """Direction of each bar, 1 to 4."""
        for bar in MOVING_BARS:
            self.u[bar] = cmath.rect(1.0, solution[f"theta_{bar}"][index])
        self.pins: dict[str, complex] = {
            "O2": self.plane.origin,
            "A": self.plane.place(complex(*solution.A[index])),
            "B": self.plane.place(complex(*solution.B[index])),
            "O4": self.plane.place(linkage.ground * self.u[1]),
        }
        self.turn = 1.0
        """Sign of the drive's torque; 1 where there is none."""
        if solution.torque is not None and np.isfinite(solution.torque[index]):
            self.turn = float(np.sign(solution.torque[index]))

    def shrink(self, pin: str) -> float:
        """Return the size of what stands around a pin, smaller at a short bar.

        At full size the symbol would hide the bar.
        """
        lengths = [
            abs(self.pins[second] - self.pins[first])
            for first, second in ENDS.values()
            if pin in (first, second)
        ]
        size = self.plane.size
        return min(size, max(SMALLEST * size, _SHARE * min(lengths)))

    def point(self, bar: int, z: complex) -> complex:
        """Place a point given in the frame of a bar."""
        return self.pins[FIRST_PIN[bar]] + self.plane.factor * z * self.u[bar]

    def tail(self, symbol: Symbol) -> complex:
        """Place the foot of a load's arrow; that of gravity stands in a corner."""
        if symbol.kind == "gravity":
            return self.plane.corner
        return self.point(symbol.bar, symbol.at) + self.plane.factor * symbol.beyond


class _Pen(NamedTuple):
    """Draws one symbol at one position."""

    axes: "Axes"
    symbol: Symbol
    pose: Pose

    @property
    def colour(self) -> str:
        """Colour of the symbol."""
        return SYMBOL_COLOURS.get(self.symbol.kind, "#4d5b70")

    def draw_line(self, points: Any, width: float) -> None:
        """Draw a line over the supports and under the bars."""
        plot_points(self.axes, points, color=self.colour, lw=width, zorder=3.5)

    def write_name(self, at: complex, away: complex) -> None:
        """Write the name of the symbol next to a point, in a direction from there."""
        name = self.symbol.name
        text = write_pin_name(name) if len(name) < 3 else name
        add_label(self.axes, text, at, away, self.colour)


def draw_symbol(axes: "Axes", symbol: Symbol, pose: Pose) -> None:
    """Draw one symbol at one position."""
    draw = _draw_between_ends
    if symbol.end is None:
        draw = _DRAW.get(symbol.kind, _draw_ring)
    draw(_Pen(axes, symbol, pose))


def _draw_between_ends(pen: _Pen) -> None:
    """Draw a spring as a zigzag, a cylinder as its rod and barrel, and both ends."""
    symbol = pen.symbol
    pose = pen.pose
    assert symbol.end is not None
    ends = start, end = pose.point(symbol.bar, symbol.at), pose.point(*symbol.end)
    if symbol.kind == "spring":
        pen.draw_line(_list_coils(start, end, 0.6 * pose.plane.size), 1.0)
    else:
        along = pose.plane.barrel * (end - start) / abs(end - start)
        pen.draw_line(ends, 1.2)
        pen.draw_line([start + 0.1 * along, start + along], 4.5)
        pen.write_name(start + 0.5 * along, 1j * along)
    plot_points(pen.axes, ends, "o", ms=3.5, color=pen.colour, zorder=5.5)


def _draw_couple(pen: _Pen) -> None:
    """Draw a moment, or the torque of the drive, as an arrow that turns."""
    symbol = pen.symbol
    pose = pen.pose
    turn = pose.turn
    centre = pose.tail(symbol)
    if symbol.kind == "moment":
        turn = math.copysign(1.0, symbol.moment) * symbol.sign(pose.theta_2)
    elif symbol.bar == 3:
        centre = 0.5 * (pose.pins["A"] + pose.pins["B"])
    if turn == 0.0:
        return
    radius = _ARROW_SIZES[symbol.kind] * pose.shrink(FIRST_PIN[symbol.bar])
    angles = turn * np.radians(np.linspace(-35.0, 215.0, 40))
    points = centre + radius * np.exp(1j * angles)
    pen.draw_line(points, 1.5)
    before_last, last = points[-2:]
    draw_arrow(pen.axes, before_last, last + 2.0 * (last - before_last), pen.colour)
    pen.write_name(points[20], points[20] - centre)


def _draw_ring(pen: _Pen) -> None:
    """Draw what acts at a pin or a place as a ring; a torsion spring is a spiral."""
    symbol = pen.symbol
    pose = pen.pose
    kind = symbol.kind
    centre = pose.pins.get(symbol.pin, pose.point(symbol.bar, symbol.at))
    relative, angle = _RINGS.get(kind, _RING_OF_OTHERS)
    radius = pose.shrink(symbol.pin or FIRST_PIN[symbol.bar]) * relative
    inner, turns = (0.3, 2.5) if kind == "torsion" else (1.0, 1.0)
    radii = np.linspace(inner * radius, radius, 90)
    ring = centre + radii * np.exp(1j * np.linspace(0.0, turns * math.tau, 90))
    pen.draw_line(ring, 2.2 if kind == "flywheel" else 1.2)
    away = cmath.rect(radius, angle)
    pen.write_name(centre + away, away)


def _draw_force(pen: _Pen) -> None:
    """Draw an arrow of one length at the place where a force acts."""
    symbol = pen.symbol
    pose = pen.pose
    size = symbol.sign(pose.theta_2) * _ARROW_SIZES["force"] * pose.plane.size
    if size == 0.0 or symbol.vector == 0.0:
        return
    axes = pose.u[symbol.bar] if symbol.turns else 1.0
    tail = pose.tail(symbol)
    arrow = size * axes * symbol.vector / abs(symbol.vector)
    draw_arrow(pen.axes, tail, tail + arrow, pen.colour)
    pen.write_name(tail + arrow, arrow)


def _list_coils(start: complex, end: complex, width: float) -> Any:
    """Draw a coil spring seen from the side: straight ends, teeth between."""
    along = end - start
    across = 1j * along / abs(along) * width if along else 0.0
    teeth = np.arange(COILS)
    shares = [0.0, 0.15, *(0.15 + 0.7 * (teeth + 0.5) / COILS), 0.85, 1.0]
    sides = [0.0, 0.0, *((-1.0) ** teeth), 0.0, 0.0]
    return start + np.array(shares) * along + np.array(sides) * across


_DRAW = {
    "gravity": _draw_force,
    "force": _draw_force,
    "push": _draw_force,
    "moment": _draw_couple,
    "drive": _draw_couple,
}
"""Functions that draw what is neither a ring nor between two ends."""


def draw_vectors(axes: "Axes", view: View, solution: Solution, index: int) -> None:
    """Draw the arrows of velocity and acceleration at points.

    Velocities have one scale for the sweep, and so have accelerations.
    """
    plane = view.plane
    names = list_point_names(view.scene)
    for letter, (colour, label) in _ARROWS.items():
        sizes = [np.hypot(*derive(view.sweep, f"{letter}_{name}").T) for name in names]
        top = choose_limit(sizes) or largest_magnitude(*sizes)
        for name in names:
            foot = plane.factor * complex(*derive(solution, name)[index])
            shaft = complex(*derive(solution, f"{letter}_{name}")[index])
            if shaft:
                # length of an arrow, in sizes of a support. The largest of the sweep
                # has it; if values diverge, all that are as large.
                shaft *= 7.0 * plane.size / max(abs(shaft), top)
            draw_arrow(axes, foot, foot + shaft, colour)
        axes.plot([], [], color=colour, label=label)
