"""Find the singular positions of a linkage by the cosine rule on the collinear triangle."""

import math
from dataclasses import replace

import numpy as np

from fourbar.effects import Gravity, Load
from fourbar.linkage import BAR_NAMES, MOVING_BARS, Bar, FourBar
from fourbar.scene import Scene
from fourbar.scene.motion import Motion
from fourbar_validation.scenes.random import DrawnType, Ranges, draw_bars, draw_lengths, draw_uniform

Lengths = tuple[float, float, float, float]
"""(ground, input, coupler, output), m."""
BARS = Ranges(
    mass=draw_uniform(0.2, 2.0),
    inertia=draw_uniform(0.05, 0.2),
    centre=draw_uniform(0.2, 0.8),
    centre_angle=draw_uniform(-0.5, 0.5),
)


def draw_linkage(kind: DrawnType, seed: int) -> Lengths:
    """Random lengths of a type, from its seed alone."""
    return draw_lengths(np.random.default_rng([seed, list(DrawnType).index(kind)]), kind)


def dress(lengths: Lengths, seed: int = 0) -> Scene:
    """Make a scene on these lengths: offset mass centres, gravity, a force, a couple; 3 rad/s, 2 rad/s^2."""
    rng = np.random.default_rng([seed, 4])
    d, *moving = lengths
    bars = draw_bars(rng, moving, BARS)
    weight = 9.81 * sum(bar.mass for bar in bars)
    loads = (
        Load(4, (weight, float(rng.uniform(-3, 3))), (0.2 * moving[2], float(rng.uniform(-3, 3)))),
        Load(3, moment=0.1 * weight * moving[1]),
    )
    linkage = FourBar(d, bars[0], bars[1], bars[2], float(rng.uniform(-1, 1)))
    return Scene(linkage, Motion(0.0, 3.0, 2.0), 2, loads, (Gravity(),))


def set_angles(scene: Scene, psi: object, branch: int = 1, **changes: object) -> Scene:
    """Set the scene to angles psi = theta_2 - theta_1 (rad) on a branch."""
    theta_2 = scene.linkage.ground_angle + np.atleast_1d(np.asarray(psi, dtype=float))
    motion = scene.motion.replace(angle=theta_2, branch=branch)
    return replace(scene, motion=motion, **changes)  # type: ignore[arg-type]


def list_moving(scene: Scene) -> list[tuple[str, Bar]]:
    """Return the moving bars by their names."""
    return [(BAR_NAMES[number], scene.linkage.bar(number)) for number in MOVING_BARS]


def replace_bars(scene: Scene, **bars: Bar) -> Scene:
    """Give the scene other bars."""
    return replace(scene, linkage=replace(scene.linkage, **bars))  # type: ignore[arg-type]


def _compute_corners(one: float, other: float, opposite: float) -> list[float]:
    """Compute the angles, of either sign, between two sides of a triangle by its third side, if it closes."""
    cosine = (one * one + other * other - opposite * opposite) / (2 * one * other) if other else 2.0
    return [math.acos(cosine), -math.acos(cosine)] if abs(cosine) < 1.0 else []


def find_collinear_3_4(lengths: Lengths) -> list[tuple[float, bool]]:
    """Find psi in (0, pi) with bars 3, 4 stretched (True) or folded: a^2 + d^2 - 2 a d cos psi = (b +- c)^2."""
    d, a, b, c = lengths
    return [
        (psi, stretched)
        for joined, stretched in ((b + c, True), (b - c, False))
        for psi in _compute_corners(d, a, joined)[:1]
    ]


def find_collinear_2_3(lengths: Lengths) -> list[tuple[float, int]]:
    """Find (psi, branch) where bars 2, 3 are collinear, so omega_4 = 0: triangle O2, B, O4 with O2 B = |a +- b|."""
    d, a, b, c = lengths
    result = []
    for along in (a + b, a - b):
        for psi in _compute_corners(d, along, c):
            u = complex(math.cos(psi), math.sin(psi))
            result.append((psi, _find_side(d - a * u, (along - a) * u)))
    return result


def find_parallel_2_4(lengths: Lengths) -> list[tuple[float, int]]:
    """Find (psi, branch) where bars 2, 4 are parallel, omega_3 = 0: (a - c) e^{i psi} + b e^{i psi_3} = d, or a + c."""
    d, a, b, c = lengths
    result = []
    for joined, side in ((a - c, 1.0), (a + c, -1.0)):
        for psi in _compute_corners(d, joined, b):
            u = complex(math.cos(psi), math.sin(psi))
            result.append((psi, _find_side(d - joined * u, side * c * u)))
    return result


def _find_side(one: complex, other: complex) -> int:
    """Return the sign of the rotation from one direction to another."""
    return 1 if (one.conjugate() * other).imag > 0.0 else -1
