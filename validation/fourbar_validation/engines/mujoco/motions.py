"""The input's motion through a segment of positions, in time: steadily, or by a motion law."""

import bisect
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fourbar.mjcf import Settings, choose_run
from fourbar.mjcf.settings import FULL_TURN
from fourbar.scene import Command
from fourbar.scene.motion import Law
from fourbar_validation.compare.answer import Array

LOOKED_AT = 2000
"""Instants at which a law is searched for its greatest speed and acceleration; between them it hardly differs."""


class Steady:
    """A segment of positions in the order of their angles, at constant alpha_2.

    As of `Lawful`, `omega` is the speed at the start, `fastest` the greatest |omega_2|, and `turning` that of the
    input, rad/s.
    """

    bar: int | None = 2
    """Number of the bar that moves so; None for the stroke."""

    def __init__(self, theta_2: Array, segment: Sequence[int], omega: float, alpha: float) -> None:
        self.theta_2 = theta_2
        commanded = theta_2[list(segment)]
        self.run = choose_run(commanded, omega, alpha)
        self.width = len(np.unique(commanded)) - 1
        self.omega = omega
        self.fastest = self.turning = self.run.fastest

    def timestep(self, settings: Settings) -> float:
        """Choose the timestep for this segment, s: at least as many steps as positions; any where there is but one."""
        return self.run.timestep(settings, at_least=self.width) if self.width else 1e-3

    def seconds(self, index: int) -> float:
        """Return the time at which it passes a position, by the angle from the start of the segment."""
        return self.run.time(float(self.theta_2[index]))

    def speed(self, turned: float, seconds: float) -> float:
        """|omega_2| that is due after a turn (rad) and a time: by the angle turned."""
        return math.sqrt(max(self.run.omega**2 + 2.0 * self.run.alpha * turned, 0.0))


class Lawful:
    """A segment of positions in the order of their times, by a motion law."""

    bar = 2

    def __init__(self, law: Law, command: Command, segment: Sequence[int]) -> None:
        assert command.time is not None
        self.law, self.time = law, command.time
        self.began, ends = float(command.time[segment[0]]), float(command.time[segment[-1]])
        self.intervals, self.duration = len(segment) - 1, ends - self.began
        self.omega = float(law.at(np.array([self.began]))[1][0])
        self.knots = list(law.time)
        self.at_knots = law.at(np.array(law.time))[2].tolist()
        angles, speeds, _ = law.at(np.linspace(self.began, ends, LOOKED_AT))
        self.fastest = self.turning = float(np.abs(speeds).max())
        self.width = float(np.ptp(angles))

    def timestep(self, settings: Settings) -> float:
        """Divide the time from each position to the next into a whole number of steps."""
        if not self.intervals:
            return 1e-3
        turned = self.duration * self.fastest
        steps = turned / (2.0 * math.pi) * settings.steps_per_revolution
        if 0.0 < self.width < FULL_TURN:
            steps = max(steps, settings.steps_per_window * turned / self.width)
        each = math.ceil(steps / self.intervals * (1.0 - 1e-9))
        return self.duration / (self.intervals * each) * settings.timestep_scale

    def seconds(self, index: int) -> float:
        """Return it as the law was sampled."""
        return float(self.time[index]) - self.began

    def speed(self, turned: float, seconds: float) -> float:
        """Return it by the time."""
        return float(abs(self.law.at(np.array([self.began + seconds]))[1][0]))

    def alpha(self, seconds: float) -> float:
        """Interpolate linearly, as the second derivative of cubic pieces is."""
        at, t, f = self.began + seconds, self.knots, self.at_knots
        k = min(max(bisect.bisect_right(t, at), 1), len(t) - 1)
        part = (at - t[k - 1]) / (t[k] - t[k - 1])
        return float(f[k - 1] + part * (f[k] - f[k - 1]))


MotionSegment = Steady | Lawful


def find_extremes(law: Law) -> tuple[float, float]:
    """Greatest |omega_2| and |alpha_2| of a law: what flywheel and closure are laid out for."""
    _, omega, alpha = law.at(np.linspace(law.time[0], law.time[-1], LOOKED_AT))
    return float(np.abs(omega).max()), float(np.abs(alpha).max())


def order_in_time(values: Array, time: Array | None, speed: float) -> NDArray[np.intp]:
    """Order the positions as they are passed, by what is commanded or by the times of a law, as indices."""
    return np.argsort(time if time is not None else values if speed > 0.0 else -values, kind="stable")
