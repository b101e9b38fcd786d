"""Read what a simulator answers: numbers of a turn that it ran through, or of states that it was given."""

import math
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fourbar.effects import Gravity
from fourbar.errors import LimitError, NotAssembledError
from fourbar.mjcf.document import Start
from fourbar.mjcf.document import choose_run as window
from fourbar.scene import Scene, command
from fourbar_validation.engines.description import find_field as field_of
from fourbar_validation.engines.free_body import move
from fourbar_validation.engines.free_body_closure import close

SAMPLES = 12
"""Readings in a turn; the first quarter, in which a closure settles, is not read."""


class Instant(NamedTuple):
    """Numbers that can be read from a simulator at one instant, SI units."""

    theta: Sequence[Any]
    """theta_2, theta_3, theta_4, of the simulator itself, rad."""
    omega_2: float
    alpha_2: float
    torque: float | None
    forces: dict[str, Any]
    """Forces of the pins that can be read, N."""


@dataclass(slots=True)
class Readings:
    """One simulator under one setting; each list has one entry a reading, SI units."""

    setting: str
    steps: int | None = None
    """Steps in a turn; None for single states."""
    theta: list[tuple[float, float, float]] = field(default_factory=list)
    omega_2: list[float] = field(default_factory=list)
    alpha_2: list[float] = field(default_factory=list)
    torque: list[float] = field(default_factory=list)
    forces: dict[str, list[tuple[float, float]]] = field(default_factory=dict)
    gap: float = 0.0
    """The greatest distance of B on bar 3 from B on bar 4, m."""
    seconds: float = 0.0
    """Processor time of the steps alone, s."""

    def read(self, scene: Scene, now: Instant) -> None:
        """Add a reading."""
        theta = (float(now.theta[0]), float(now.theta[1]), float(now.theta[2]))
        self.theta.append(theta)
        self.omega_2.append(float(now.omega_2))
        self.alpha_2.append(float(now.alpha_2))
        if now.torque is not None:
            self.torque.append(float(now.torque))
        for name, force in now.forces.items():
            self.forces.setdefault(name, []).append((float(force[0]), float(force[1])))
        self.gap = float(np.maximum(self.gap, compute_gap(scene, theta)))  # NaN stays NaN

    def plain(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return asdict(self)


def turn(scene: Scene, steps: int) -> tuple[float, list[int]]:
    """Compute the timestep (s) of one turn of the input in so many steps, and the steps after which to read."""
    if not scene.motion.omega_2 or scene.motion.alpha_2 or scene.loads:
        raise LimitError("simulators run through a turn at constant omega_2 without loads")
    first = steps // 4
    return math.tau / abs(scene.motion.omega_2) / steps, [
        first + round(k * (steps - first) / (SAMPLES - 1)) for k in range(SAMPLES)
    ]


def run_through(
    scene: Scene,
    steps: int,
    setting: str,
    advance: Callable[[int], Any],
    read: Callable[[Any], Instant],
    clock: Callable[[], float] = time.process_time,
) -> Readings:
    """Simulate a turn in so many steps.

    `advance`: so many steps further, by the clock; what it returns is read.
    `clock`: of the processor; of a GPU that of the wall.
    """
    found, done = Readings(setting, steps), 0
    for stop in turn(scene, steps)[1]:
        began = clock()
        reached = advance(stop - done)
        found.seconds += clock() - began
        done = stop
        found.read(scene, read(reached))
    return found


def start(scene: Scene) -> Start:
    """Assemble the first position that closes, in the direction of motion, and its speeds, as the free body does.

    No simulator starts from what the formulas computed.
    """
    at, omega_2 = command(scene), scene.motion.omega_2 or 0.0
    closed = close(scene.linkage, at.theta_2, at.branch)
    usable = np.flatnonzero(closed.assembled)
    if not len(usable):
        raise NotAssembledError("the linkage closes at none of the scene's positions: there is nothing to start from")
    theta_2 = at.theta_2[usable]
    first = usable[[np.argmin(theta_2) if omega_2 >= 0.0 else np.argmax(theta_2)]]
    theta = (at.theta_2[first], *closed.theta[:, first])
    omega = move(scene.linkage, theta[0], np.array([omega_2]), np.zeros(1), *theta[1:]).omega
    q, v = [float(x[0]) for x in theta], [float(omega[bar][0]) for bar in (2, 3, 4)]
    return Start((q[0], q[1] - q[0], q[2]), (v[0], v[1] - v[0], v[2]), window(theta_2, omega_2, 0.0))


def find_gravity(scene: Scene) -> tuple[float, float, float]:
    """Return the field of gravity, m/s^2."""
    fields = [field_of(effect) for effect in scene.effects if isinstance(effect, Gravity)]
    return (*fields[0], 0.0) if fields else (0.0, 0.0, 0.0)


@contextmanager
def write_temp(text: str, name: str) -> Iterator[str]:
    """Write a file that lasts as long as the context: for simulators that read no text."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / name
        file.write_text(text, encoding="utf-8")
        yield str(file)


def compute_gap(scene: Scene, theta: tuple[float, float, float]) -> float:
    """Compute the distance of B on bar 3 from B on bar 4 at the bars' directions, m."""
    linkage = scene.linkage
    a, b, c = (
        bar.length * np.exp(1j * angle)
        for bar, angle in zip((linkage.input, linkage.coupler, linkage.output), theta, strict=True)
    )
    return float(abs(a + b - c - linkage.ground * np.exp(1j * linkage.ground_angle)))
