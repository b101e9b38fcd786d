"""Scenes to break things with: even numbers ordinary, odd ones adversarial; scene i depends on (seed, i) alone."""

import math
from typing import Any

import numpy as np

from fourbar.effects import Friction, Gravity, Load, Viscous
from fourbar.errors import InputError
from fourbar.linkage import MOVING_BARS, PINS, Bar, FourBar
from fourbar.scene import Scene
from fourbar.scene.motion import Motion

POSITIONS = 2
RANGES: dict[str, tuple[float, float]] = {"ordinary": (-0.7, 0.7), "adversarial": (-6.0, 6.0)}
"""Powers of ten between which lengths, masses, speeds and loads are drawn."""


def scene_of(seed: int, index: int) -> Scene:
    """The scene of that number; redrawn until its lengths can close at all."""
    rng = np.random.default_rng([seed, index])
    adversarial = index % 2 == 1
    while True:
        try:
            return _draw(rng, "adversarial" if adversarial else "ordinary")
        except InputError:
            continue


def _draw(rng: np.random.Generator, kind: str) -> Scene:
    low, high = RANGES[kind]
    hard = kind == "adversarial"

    def power() -> float:
        return float(10.0 ** rng.uniform(low, high))

    lengths = _lengths(rng, hard)
    size = power()
    d, *moving = (float(x * size) for x in lengths)
    bars = []
    for length in moving:
        mass = 0.0 if hard and rng.random() < 0.15 else power() * length
        inertia = 0.0 if hard and rng.random() < 0.15 else mass * length * length * float(rng.uniform(0.02, 0.4))
        reach = (
            length * float(rng.uniform(-1.0, 2.0)) * (10.0 ** rng.uniform(0, 3) if hard and rng.random() < 0.2 else 1)
        )
        bars.append(Bar(length, mass, inertia, (reach, float(rng.choice([0.0, rng.uniform(-3.0, 3.0)])))))
    theta_1 = float(rng.choice([0.0, math.pi, rng.uniform(-3.2, 3.2)]) if hard else rng.uniform(-3.2, 3.2))
    linkage = FourBar(d, bars[0], bars[1], bars[2], theta_1)
    weight = 9.81 * (sum(bar.mass for bar in bars) or 1.0)
    loads = []
    for _ in range(int(rng.integers(0, 3))):
        bar = int(rng.choice(MOVING_BARS))
        scale = weight * (power() if hard else 1.0)
        force = (scale * float(rng.uniform(-1, 1)), float(rng.uniform(-3.2, 3.2))) if rng.random() < 0.8 else None
        arm = (float(linkage.bar(bar).length * rng.uniform(0, 1)), float(rng.uniform(-3.2, 3.2)))
        moment = float(rng.choice([0.0, scale * linkage.bar(bar).length * rng.uniform(-1, 1)]))
        loads.append(Load(bar, force, arm, moment, "bar" if rng.random() < 0.5 else "world"))
    effects: list[Any] = [Gravity()] if rng.random() < 0.5 else []
    torque = weight * max(moving) * 0.1
    if rng.random() < 0.2:
        effects.append(Viscous.at(**{pin: float(torque * rng.uniform(0, 1)) for pin in PINS if rng.random() < 0.5}))
    if rng.random() < 0.1:
        effects.append(Friction.at(**{pin: float(torque * rng.uniform(0, 1)) for pin in PINS if rng.random() < 0.5}))
    omega = float(rng.choice([-1.0, 1.0])) * power() * (0.0 if rng.random() < 0.05 else 1.0)
    alpha = float(rng.choice([0.0, omega * omega * rng.uniform(-1, 1), rng.uniform(-10, 10)]))
    psi = _angles(rng, hard, (d, *moving))
    motion = Motion(theta_1 + psi, omega, alpha, int(rng.choice([-1, 1])))
    return Scene(linkage, motion, int(rng.choice(MOVING_BARS)), tuple(loads), tuple(effects))


def _lengths(rng: np.random.Generator, hard: bool) -> Any:
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


def _angles(rng: np.random.Generator, hard: bool, lengths: tuple[float, ...]) -> Any:
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
