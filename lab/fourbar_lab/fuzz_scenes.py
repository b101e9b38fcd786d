"""Scenes to break things with: even numbers ordinary, odd ones adversarial; scene i depends on (seed, i) alone."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from fourbar.errors import InputError
from fourbar.scene import Scene
from fourbar_validation.scenes.random import Ranges, draw_chance, draw_decades, draw_product, draw_scene, draw_uniform

POSITIONS = 2
SIZES = {False: draw_decades(-0.7, 0.7), True: draw_decades(-6.0, 6.0)}
"""Lengths, masses, speeds and loads: ordinary, adversarial."""
ORDINARY = Ranges(
    mass=SIZES[False],
    inertia=draw_uniform(0.02, 0.4),
    centre=draw_uniform(-1.0, 2.0),
    centre_angle=draw_chance(0.5, draw_uniform(-3.0, 3.0)),
    load=draw_uniform(-1.0, 1.0),
    without_force=0.2,
    speed=draw_chance(0.95, SIZES[False]),
    viscous=0.2,
    friction=0.1,
)
RANGES = {
    False: ORDINARY,
    True: replace(
        ORDINARY,
        mass=draw_chance(0.85, SIZES[True]),
        inertia=draw_chance(0.85, ORDINARY.inertia),
        centre=draw_product(ORDINARY.centre, draw_chance(0.2, draw_decades(0.0, 3.0), 1.0)),
        ground_angle=lambda rng: float(rng.choice([0.0, math.pi, rng.uniform(-3.2, 3.2)])),
        load=draw_product(ORDINARY.load, SIZES[True]),
        speed=draw_chance(0.95, SIZES[True]),
    ),
}
"""What the scenes are drawn from: ordinary, adversarial."""


def draw_fuzz_scene(seed: int, index: int) -> Scene:
    """Draw a scene, anew until its lengths can close at all."""
    rng = np.random.default_rng([seed, index])
    while True:
        try:
            return _draw(rng, index % 2 == 1)
        except InputError:
            continue


def _draw(rng: np.random.Generator, hard: bool) -> Scene:
    size = SIZES[hard](rng)
    lengths = tuple(float(x * size) for x in _draw_lengths(rng, hard))
    scene = draw_scene(rng, lengths, RANGES[hard])
    psi = _draw_angles(rng, hard, lengths)
    alpha = float(rng.uniform(-10.0, 10.0)) if rng.random() < 1.0 / 3.0 else scene.motion.alpha_2
    motion = replace(scene.motion, theta_2=scene.linkage.ground_angle + psi, alpha_2=alpha)
    return replace(scene, motion=motion)


def _draw_lengths(rng: np.random.Generator, hard: bool) -> Any:
    """(ground, input, coupler, output), some of them equal, in extreme ratios, or near s + l = p + q."""
    choice = rng.random() if hard else 1.0
    x = rng.uniform(0.1, 1.0, 4)
    if choice < 0.1:
        return (x[0], x[1], x[0], x[1])
    if choice < 0.2:
        return (x[0], x[1], x[1], x[0]) if rng.random() < 0.5 else (x[0], x[0], x[1], x[1])
    if choice < 0.35:
        return (
            x[0],
            x[1],
            x[2],
            x[0] + x[1] - x[2] + float(rng.choice([0.0, 1.0, -1.0])) * 10.0 ** rng.uniform(-15, -3),
        )
    if choice < 0.6:
        small = 10.0 ** rng.uniform(-6, 0, 2)
        k = rng.permutation(4)
        x[k[0]] *= small[0]
        if rng.random() < 0.3:
            x[k[1]] *= small[1]
    return x


def _draw_angles(rng: np.random.Generator, hard: bool, lengths: tuple[float, ...]) -> Any:
    """theta_2 - theta_1: anywhere, or near a limit position, a change point, or many turns away."""
    psi = rng.uniform(-3.2, 3.2, POSITIONS)
    if not hard:
        return psi
    d, a, b, c = lengths
    choice = rng.random()
    if choice < 0.5:
        diagonal = b + c if rng.random() < 0.5 else abs(b - c)
        cosine = (a * a + d * d - diagonal**2) / (2 * a * d)
        base = math.acos(min(1.0, max(-1.0, cosine)))
        psi = float(rng.choice([-1.0, 1.0])) * base + rng.choice([-1.0, 1.0], POSITIONS) * 10.0 ** rng.uniform(
            -14, -1, POSITIONS
        )
    elif choice < 0.6:
        psi = float(rng.choice([0.0, math.pi])) + rng.choice([-1.0, 0.0, 1.0], POSITIONS) * 10.0 ** rng.uniform(
            -9, -1, POSITIONS
        )
    elif choice < 0.65:
        psi = psi + 2 * math.pi * rng.integers(-1000, 1000)
    return psi
