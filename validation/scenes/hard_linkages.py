"""Where the singular positions of a linkage lie, by the cosine rule on the collinear triangle."""

import math
from dataclasses import replace

import numpy as np

from fourbar.effects import Gravity, Load
from fourbar.linkage import Bar, FourBar
from fourbar.scene import Scene
from fourbar.scene.motion import Motion
from validation.scenes.random import LinkageType, Ranges, random_bars, random_lengths, uniform

Lengths = tuple[float, float, float, float]
"""(ground, input, coupler, output), m."""
BARS = Ranges(
    mass=uniform(0.2, 2.0),
    inertia=uniform(0.05, 0.2),
    centre=uniform(0.2, 0.8),
    centre_angle=uniform(-0.5, 0.5),
)


def linkage_of(kind: LinkageType, seed: int) -> Lengths:
    """Random lengths of a type, from its seed alone."""
    return random_lengths(np.random.default_rng([seed, list(LinkageType).index(kind)]), kind)


def dressed(lengths: Lengths, seed: int = 0) -> Scene:
    """A scene on these lengths: offset mass centres, gravity, a force and a couple; omega_2 = 3 rad/s, alpha_2 = 2."""
    rng = np.random.default_rng([seed, 4])
    d, *moving = lengths
    bars = random_bars(rng, moving, BARS)
    weight = 9.81 * sum(bar.mass for bar in bars)
    loads = (
        Load(4, (weight, float(rng.uniform(-3, 3))), (0.2 * moving[2], float(rng.uniform(-3, 3)))),
        Load(3, moment=0.1 * weight * moving[1]),
    )
    linkage = FourBar(d, bars[0], bars[1], bars[2], float(rng.uniform(-1, 1)))
    return Scene(linkage, Motion(0.0, 3.0, 2.0), 2, loads, (Gravity(),))


def at(scene: Scene, psi: object, branch: int = 1, **changes: object) -> Scene:
    """The scene at angles psi = theta_2 - theta_1 (rad) on a branch."""
    theta_2 = scene.linkage.ground_angle + np.atleast_1d(np.asarray(psi, dtype=float))
    motion = replace(scene.motion, theta_2=theta_2, branch=branch)
    return replace(scene, motion=motion, **changes)  # type: ignore[arg-type]


def with_bars(scene: Scene, **bars: Bar) -> Scene:
    """The scene with other bars."""
    return replace(scene, linkage=replace(scene.linkage, **bars))  # type: ignore[arg-type]


def collinear_3_4(lengths: Lengths) -> list[tuple[float, bool]]:
    """psi in (0, pi) where bars 3, 4 are stretched (True) or folded: a^2 + d^2 - 2 a d cos psi = (b +- c)^2."""
    d, a, b, c = lengths
    found = []
    for diagonal, stretched in ((b + c, True), (abs(b - c), False)):
        cosine = (a * a + d * d - diagonal**2) / (2 * a * d)
        if abs(cosine) < 1.0:
            found.append((math.acos(cosine), stretched))
    return found


def collinear_2_3(lengths: Lengths) -> list[tuple[float, int]]:
    """(psi, branch) where bars 2, 3 are collinear, so omega_4 = 0: O2, B, O4 form a triangle with O2 B = |a +- b|."""
    d, a, b, c = lengths
    found = []
    for along in (a + b, a - b):
        cosine = (d * d + along * along - c * c) / (2 * d * along)
        if abs(cosine) < 1.0:
            for psi in (math.acos(cosine), -math.acos(cosine)):
                u = complex(math.cos(psi), math.sin(psi))
                diagonal, coupler = d - a * u, (along - a) * u
                found.append((psi, 1 if (diagonal.conjugate() * coupler).imag > 0.0 else -1))
    return found


def parallel_2_4(lengths: Lengths) -> list[tuple[float, int]]:
    """(psi, branch) where bars 2, 4 are parallel, so omega_3 = 0: (a - c) e^{i psi} + b e^{i psi_3} = d, or a + c."""
    d, a, b, c = lengths
    found = []
    for joined, side in ((a - c, 1.0), (a + c, -1.0)):
        cosine = (d * d + joined * joined - b * b) / (2 * d * joined) if joined else 2.0
        if abs(cosine) < 1.0:
            for psi in (math.acos(cosine), -math.acos(cosine)):
                u = complex(math.cos(psi), math.sin(psi))
                coupler, output = d - joined * u, side * c * u
                found.append((psi, 1 if (coupler.conjugate() * output).imag > 0.0 else -1))
    return found
