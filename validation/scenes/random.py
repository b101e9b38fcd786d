"""Random linkages of a stated type, each from (seed, index) alone."""

import math
from enum import Enum

import numpy as np

from fourbar.effects import Gravity, Load
from fourbar.formulas.mobility import default_range
from fourbar.linkage import Bar, FourBar
from fourbar.scene import Scene
from fourbar.scene.motion import CROSSED, OPEN, Motion, Sweep


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


def random_scene(seed: int, index: int, types: tuple[LinkageType, ...]) -> Scene:
    """A linkage with random bars, loads, gravity and drive, at POSITIONS positions over the range it can move."""
    rng = np.random.default_rng([seed, index])
    kind = types[index % len(types)]
    size = 10.0 ** rng.uniform(-1.5, 1.0)
    d, *moving = (size * x for x in random_lengths(rng, kind))
    bars = []
    for length in moving:
        mass = length * 10.0 ** rng.uniform(-1.0, 1.0)
        about_g = mass * length**2 / 12.0 * rng.uniform(0.5, 2.0)
        bars.append(Bar(length, mass, about_g, (length * rng.uniform(0.2, 0.8), rng.uniform(-1.0, 1.0))))
    linkage = FourBar(d, bars[0], bars[1], bars[2], float(rng.uniform(-math.pi, math.pi)))
    weight = 9.81 * sum(bar.mass for bar in bars)
    loads = []
    for number in rng.choice([2, 3, 4], rng.integers(0, 3), replace=False):
        length = linkage.bar(int(number)).length
        force = (float(weight * rng.uniform(0.0, 1.0)), float(rng.uniform(-math.pi, math.pi)))
        at = (float(length * rng.uniform(0.0, 0.5)), float(rng.uniform(-math.pi, math.pi)))
        frame = "bar" if rng.random() < 0.5 else "world"
        loads.append(Load(int(number), force, at, float(weight * length * rng.uniform(-1.0, 1.0)), frame))
    omega_2 = float(rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-0.5, 1.5))
    alpha_2 = float(rng.choice([0.0, omega_2**2 * rng.uniform(-0.1, 0.1)]))
    branch = OPEN if rng.random() < 0.5 else CROSSED
    return Scene(
        linkage,
        Motion(Sweep(*default_range(linkage), POSITIONS - 1), omega_2, alpha_2, branch),
        int(rng.choice([2, 3, 4])),
        tuple(loads),
        (Gravity(),) if rng.random() < 0.5 else (),
        title=f"{kind.value} {index}",
    )
