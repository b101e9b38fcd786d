"""Random linkages and scenes, from stated types and ranges and a random generator alone."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import numpy as np

from fourbar.effects import Friction, Gravity, Load, Viscous
from fourbar.formulas.mobility import default_range
from fourbar.linkage import MOVING_BARS, PINS, Bar, FourBar
from fourbar.scene import Scene
from fourbar.scene.motion import CROSSED, OPEN, Motion, Sweep

Draw = Callable[[np.random.Generator], float]
"""A number drawn at random."""


def uniform(low: float, high: float) -> Draw:
    """Between two numbers."""
    return lambda rng: float(rng.uniform(low, high))


def decades(low: float, high: float) -> Draw:
    """Ten to a power between two numbers."""
    return lambda rng: float(10.0 ** rng.uniform(low, high))


def sometimes(share: float, draw: Draw, otherwise: float = 0.0) -> Draw:
    """Drawn in this share of all cases."""
    return lambda rng: draw(rng) if rng.random() < share else otherwise


def product(*draws: Draw) -> Draw:
    """Of several draws."""
    return lambda rng: math.prod(draw(rng) for draw in draws)


ANY_ANGLE, ANY_PART, EITHER_SIGN = uniform(-math.pi, math.pi), uniform(0.0, 1.0), uniform(-1.0, 1.0)
ANY_SPEED = decades(-1.0, 2.0)


@dataclass(frozen=True, slots=True)
class Ranges:
    """What a random scene is drawn from."""

    mass: Draw
    """kg per metre of bar, or kg."""
    inertia: Draw
    """About G, of mass times length squared."""
    centre: Draw
    """Of the length."""
    centre_angle: Draw
    ground_angle: Draw = ANY_ANGLE
    load: Draw = ANY_PART
    """Of a force, of the weight of all bars; of a moment, of that weight at the bar's length."""
    arm: Draw = ANY_PART
    """Where a load acts, from G, of the length."""
    without_force: float = 0.0
    """Share of the loads that are a moment alone."""
    speed: Draw = ANY_SPEED
    """|omega_2|, rad/s."""
    acceleration: Draw = EITHER_SIGN
    """alpha_2 where there is one, of omega_2 squared."""
    gravity: float = 0.5
    viscous: float = 0.0
    friction: float = 0.0
    """Shares of the scenes that have such an effect."""
    by_length: bool = True
    """Whether the mass is per metre."""


class LinkageType(Enum):
    """What the input and output of a linkage do."""

    CRANK_ROCKER = "crank-rocker"
    DRAG_LINK = "drag-link"
    DOUBLE_ROCKER = "double-rocker"
    ROCKER_CRANK = "rocker-crank"
    TRIPLE_ROCKER = "triple-rocker"


SHORTEST = {
    LinkageType.DRAG_LINK: 0,
    LinkageType.CRANK_ROCKER: 1,
    LinkageType.DOUBLE_ROCKER: 2,
    LinkageType.ROCKER_CRANK: 3,
}
"""Which of (ground, input, coupler, output) is the shortest bar of a Grashof linkage of that type."""
POSITIONS = 37
CLEARANCE = 0.02
"""A random linkage keeps this part of its longest bar away from the change-point equality s + l = p + q."""


def random_lengths(rng: np.random.Generator, kind: LinkageType) -> tuple[float, float, float, float]:
    """(ground, input, coupler, output) of the given type, longest bar 1, away from change points."""
    while True:
        lengths = np.sort(rng.uniform(0.1, 1.0, 4))
        lengths[3] = 1.0
        shortest, p, q, longest = lengths
        surplus = p + q - shortest - longest
        if p + q + shortest - longest < CLEARANCE:
            continue
        if kind is LinkageType.TRIPLE_ROCKER:
            if surplus < -CLEARANCE:
                return tuple(float(x) for x in rng.permutation(lengths))  # type: ignore[return-value]
        elif surplus > CLEARANCE:
            others = list(rng.permutation(lengths[1:]))
            others.insert(SHORTEST[kind], shortest)
            return tuple(float(x) for x in others)  # type: ignore[return-value]


def random_bars(rng: np.random.Generator, lengths: Sequence[float], ranges: Ranges) -> list[Bar]:
    """Bars 2, 3, 4 of these lengths (m)."""
    bars = []
    for length in lengths:
        mass = ranges.mass(rng) * (length if ranges.by_length else 1.0)
        centre = (length * ranges.centre(rng), ranges.centre_angle(rng))
        bars.append(Bar(length, mass, mass * length**2 * ranges.inertia(rng), centre))
    return bars


def drawn(rng: np.random.Generator, lengths: Sequence[float], ranges: Ranges) -> Scene:
    """A scene on (ground, input, coupler, output), m, at theta_2 = 0."""
    d, *moving = (float(length) for length in lengths)
    bars = random_bars(rng, moving, ranges)
    linkage = FourBar(d, bars[0], bars[1], bars[2], ranges.ground_angle(rng))
    weight = 9.81 * (math.fsum(bar.mass for bar in bars) or 1.0)
    loads = tuple(_load(rng, linkage, weight, ranges) for _ in range(int(rng.integers(0, 3))))
    effects: list[Any] = [Gravity()] if rng.random() < ranges.gravity else []
    couple = 0.1 * weight * max(moving)
    for kind, share in ((Viscous, ranges.viscous), (Friction, ranges.friction)):
        if rng.random() < share:
            effects.append(kind.at(**{pin: couple * float(rng.random()) for pin in PINS if rng.random() < 0.5}))
    omega = float(rng.choice([-1.0, 1.0])) * ranges.speed(rng)
    alpha = float(rng.choice([0.0, omega**2 * ranges.acceleration(rng)]))
    motion = Motion(0.0, omega, alpha, OPEN if rng.random() < 0.5 else CROSSED)
    return Scene(linkage, motion, int(rng.choice(MOVING_BARS)), loads, tuple(effects))


def _load(rng: np.random.Generator, linkage: FourBar, weight: float, ranges: Ranges) -> Load:
    """A force and a moment, or one of them, on any bar."""
    bar = int(rng.choice(MOVING_BARS))
    length, size = linkage.bar(bar).length, weight * ranges.load(rng)
    force = None if rng.random() < ranges.without_force else (size, ANY_ANGLE(rng))
    at = (length * ranges.arm(rng), ANY_ANGLE(rng))
    moment = float(rng.choice([0.0, size * length * EITHER_SIGN(rng)]))
    return Load(bar, force, at, moment, "bar" if rng.random() < 0.5 else "world")


MACHINES = Ranges(
    mass=decades(-1.0, 1.0),
    inertia=uniform(1.0 / 24.0, 1.0 / 6.0),
    centre=uniform(0.2, 0.8),
    centre_angle=uniform(-1.0, 1.0),
    arm=uniform(0.0, 0.5),
    speed=decades(-0.5, 1.5),
    acceleration=uniform(-0.1, 0.1),
)
"""Bars as machines have them."""


def random_scene(seed: int, index: int, types: tuple[LinkageType, ...]) -> Scene:
    """A linkage with random bars, loads, gravity and drive, at POSITIONS positions over the range it can move."""
    rng = np.random.default_rng([seed, index])
    kind = types[index % len(types)]
    size = 10.0 ** rng.uniform(-1.5, 1.0)
    scene = drawn(rng, [size * x for x in random_lengths(rng, kind)], MACHINES)
    sweep = Sweep(*default_range(scene.linkage), POSITIONS - 1)
    return replace(scene, motion=replace(scene.motion, theta_2=sweep), title=f"{kind.value} {index}")
