"""Linear springs, each between two points of two bars, the ground included."""

import math
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fourbar.effects.effect import Act, Effect, Tree
from fourbar.effects.wrenches import Wrenches
from fourbar.errors import InputError
from fourbar.linkage import BAR_NAMES, FourBar, require
from fourbar.solution import NO_DIRECTION, OK, Solution
from fourbar.state import Array, State, Vector, along, dot

FIELDS = {"stiffness": "N/m", "length": "m", "preload": "N"}
COINCIDE = 16.0 * 2.0**-52
"""Two points nearer than this part of their ways from O2, bar by bar, do not tell where the other lies."""


class Point(NamedTuple):
    """A point of a bar: polar from the bar's first pin (O2 for the ground), the angle from the bar's line."""

    bar: int
    distance: float
    angle: float

    @property
    def in_bar(self) -> tuple[float, float]:
        """Along and across the bar's line, m."""
        if self.angle == 0.0:
            return (self.distance, 0.0)
        return (self.distance * math.cos(self.angle), self.distance * math.sin(self.angle))


@dataclass(frozen=True, slots=True)
class Spring:
    """A spring that pulls its two points together with preload + stiffness (distance - length), N.

    Parameters
    ----------
    start, end : points on two different bars.
    stiffness : N/m, > 0.
    length : distance at which it pulls with the preload alone, m, >= 0.
    preload : N.
    """

    start: Point
    end: Point
    stiffness: float
    length: float = 0.0
    preload: float = 0.0

    def __post_init__(self) -> None:
        for key, point in (("from", self.start), ("to", self.end)):
            if point.bar not in BAR_NAMES or isinstance(point.bar, bool):
                raise InputError(f"effects.springs.{key}.bar", point.bar, "must be 1, 2, 3 or 4")
            require(f"effects.springs.{key}.at", point.distance)
            require(f"effects.springs.{key}.at", point.angle)
        if self.start.bar == self.end.bar:
            raise InputError("effects.springs.to.bar", self.end.bar, "must be another bar than that of `from`")
        require("effects.springs.stiffness", self.stiffness, positive=True)
        require("effects.springs.length", self.length, at_least_zero=True)
        require("effects.springs.preload", self.preload)

    @property
    def slack(self) -> float:
        """Tension less stiffness times distance, N; 0: the force is proportional to the distance vector."""
        return self.preload - self.stiffness * self.length


@dataclass(frozen=True, slots=True)
class Springs(Effect):
    """Linear springs.

    Where the two points of a spring coincide its pull has no direction: status "no_direction". One that pulls
    with stiffness times distance alone (preload = stiffness length) pulls with 0 there.
    """

    springs: tuple[Spring, ...]
    key: ClassVar[str] = "springs"
    example: ClassVar[str] = (
        'springs = [{ from = { bar = 1, at = ["10 cm", "-90 deg"] }, to = { bar = 4, at = ["8 cm", "0 deg"] }, '
        'stiffness = "200 N/m", length = "12 cm", preload = "3 N" }]'
    )

    @classmethod
    def read(cls, value: object, reader: Any) -> "Springs":
        """From a list of tables; preload 0 where it is left out."""
        key = "effects.springs"
        if not isinstance(value, list) or not 1 <= len(value) <= 1000:
            raise reader.refuse(key, value, "must be a list of 1 to 1000 springs")
        springs = []
        for index, entry in enumerate(value):
            own = f"{key}[{index}]"
            given = reader.table(own, entry, ("from", "to", *FIELDS))
            texts = {"preload": "0 N", **given}
            numbers = [reader.quantity(f"{own}.{name}", texts.get(name), unit) for name, unit in FIELDS.items()]
            start, end = (_point(reader, f"{own}.{name}", given.get(name)) for name in ("from", "to"))
            springs.append(Spring(start, end, *numbers))
        return cls(tuple(springs))

    def write(self, writer: Any) -> Any:
        """Back to the form of a scene file."""
        rows = []
        for spring in self.springs:
            ends = zip(("from", "to"), (spring.start, spring.end), strict=True)
            row: dict[str, Any] = {
                name: {"bar": point.bar, "at": writer.polar(point.distance, point.angle, "m")} for name, point in ends
            }
            row.update({name: writer.quantity(getattr(spring, name), unit) for name, unit in FIELDS.items()})
            rows.append(row)
        return rows

    def add_wrenches(self, wrenches: Wrenches, state: State) -> None:
        """At `start` the tension along the unit vector to `end`, at `end` its opposite."""
        for spring in self.springs:
            across = _minus(_place(state, spring.end), _place(state, spring.start))
            pull = _per_distance(spring, across)
            force = (pull * across[0], pull * across[1])
            for point, sign in ((spring.start, 1.0), (spring.end, -1.0)):
                if point.bar != 1:
                    arm = state.arm(point.bar, *point.in_bar)
                    wrenches.add_force(point.bar, (sign * force[0], sign * force[1]), arm)

    def unsettled(self, state: State) -> NDArray[np.uint8] | None:
        """NO_DIRECTION where the two points of a spring with slack coincide."""
        codes = None
        for spring in self.springs:
            if spring.slack == 0.0:
                continue
            x, y = _minus(_place(state, spring.end), _place(state, spring.start))
            away = sum(state.linkage.lengths) + abs(spring.start.distance) + abs(spring.end.distance)
            here = np.hypot(getattr(x, "hi", x), getattr(y, "hi", y)) <= COINCIDE * away
            codes = np.where(here, NO_DIRECTION, OK if codes is None else codes).astype(np.uint8)
        return codes

    def power(self, state: State) -> Array | float:
        """P = -tension d(distance)/dt, W."""
        total: Array | float = 0.0
        for spring in self.springs:
            x, y = _minus(_place(state, spring.end), _place(state, spring.start))
            far, near = _speed(state, spring.end), _speed(state, spring.start)
            growth = x * (far[0] - near[0]) + y * (far[1] - near[1])
            if spring.slack == 0.0:
                total = total - spring.stiffness * growth
            else:
                distance = np.hypot(x, y)
                total = total - (spring.slack + spring.stiffness * distance) * growth / distance
        return total

    def engine_term(self, tree: Tree) -> Act:
        """Pulls at the engine's own places of the two points."""

        def act() -> None:
            for spring in self.springs:
                one, other = (
                    tree.foot(point.bar) + tree.turned(point.bar, *point.in_bar) for point in (spring.start, spring.end)
                )
                vector = np.asarray(other - one)
                distance = math.hypot(*vector)
                if spring.slack:
                    tension = spring.preload + spring.stiffness * (distance - spring.length)
                    vector = vector * (tension / distance) if distance else np.full(2, np.nan)
                else:
                    vector = spring.stiffness * vector
                tree.push(spring.start.bar, vector, one)
                tree.push(spring.end.bar, -vector, other)

        return act

    def add_mjcf(self, model: Any) -> None:
        """A spatial tendon between two sites, its rest length shortened by the preload."""
        model.springs += self.springs

    def size(self, linkage: FourBar, solution: Solution) -> float:
        """Greatest tensions counted with their levers, N."""
        return sum(
            _tension(spring, linkage)
            * sum(1.0 + abs(p.distance) / linkage.bar(p.bar).length for p in (spring.start, spring.end) if p.bar != 1)
            for spring in self.springs
        )

    def couple(self, linkage: FourBar, speed: float) -> float:
        """Greatest tensions times the longest bar, N m."""
        return sum(_tension(spring, linkage) for spring in self.springs) * max(linkage.lengths)


def _tension(spring: Spring, linkage: FourBar) -> float:
    """No less than the greatest tension: the points stay within the linkage and their own arms."""
    reach = sum(linkage.lengths) + abs(spring.start.distance) + abs(spring.end.distance)
    return abs(spring.preload) + spring.stiffness * (reach + spring.length)


def _place(state: State, point: Point) -> Vector:
    if point.bar != 1:
        return state.point(point.bar, *point.in_bar)
    theta_1 = state.linkage.ground_angle
    return along((math.cos(theta_1), math.sin(theta_1)), *point.in_bar)  # type: ignore[arg-type]


def _speed(state: State, point: Point) -> Any:
    return (0.0, 0.0) if point.bar == 1 else state.velocity(point.bar, *point.in_bar)


def _minus(u: Vector, v: Vector) -> Vector:
    return (u[0] - v[0], u[1] - v[1])


def _per_distance(spring: Spring, across: Vector) -> Any:
    """Tension over distance, N/m."""
    if spring.slack == 0.0:
        return spring.stiffness
    distance = np.sqrt(dot(across, across))
    # a distance of 0 has no direction, which `unsettled` says
    return spring.stiffness + spring.slack / (distance + np.where(distance == 0.0, 1.0, 0.0))


def _point(reader: Any, key: str, value: object) -> Point:
    entry: dict[str, Any] = reader.table(key, value, ("bar", "at"))
    bar = reader.whole(f"{key}.bar", entry.get("bar"), 1, 4)
    return Point(bar, *(reader.polar(f"{key}.at", entry["at"], "m") if "at" in entry else (0.0, 0.0)))
