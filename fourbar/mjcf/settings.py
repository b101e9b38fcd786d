"""Settings of the generated MJCF, with values that hold for every linkage that was tried."""

import math
from dataclasses import dataclass
from typing import Literal

from fourbar.errors import LimitError


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of MuJoCo in the file; the defaults carry a linkage of 5 mm to 100 m at any speed.

    Parameters
    ----------
    timestep : s; None: from the two numbers of steps.
    steps_per_window : at least so many where the input does not turn fully: towards a limit position
        bars 3 and 4 speed up without bound, and 628 steps per revolution are too few there.
    timestep_scale : factor on the timestep.
    integrator : "RK4", "Euler", "implicit" or "implicitfast".
    time_constant_steps : solref's time constant of the loop's closure, in timesteps.
    impedance : solimp's impedance d; MuJoCo clamps it at 0.9999.
    pad : where the inertial frame of the massless pads that carry the closure lies, as a part of
        the bar's length: the softness of the closure goes as its square. None: no pads; "fitted": to
        the speed and the loads (`fit_pad`).
    solver, tolerance, iterations : of the constraint solver. MuJoCo divides the tolerance by the
        flywheel's inertia, so only 0 is tight, and the number of iterations is then what stops it.
    flywheel : inertia on pin O2 relative to the linkage's own; the speed ripples by about its inverse.
    """

    timestep: float | None = None
    timestep_scale: float = 1.0
    steps_per_revolution: float = 628.0
    steps_per_window: int = 2000
    integrator: str = "RK4"
    time_constant_steps: float = 20.0
    impedance: float = 0.9999
    pad: float | Literal["fitted"] | None = "fitted"
    solver: str = "Newton"
    tolerance: float = 0.0
    iterations: int = 10
    flywheel: float = 1e8


RECIPE = Settings()
STIFF_PAD, SOFT_PAD = 1e-4, 2e-3
"""Stiff: the closure's softness plays no part above 1e-9. Soft: its forces have 7 digits after a single pass."""
QUICK = 1.0
"""rad/s^2. Newton stops where a pass moves the accelerations by less than 1e-15 rad/s^2 (mjMINVAL): below about
this acceleration there is no second pass, and with stiff pads the forces of the first are wrong by up to 1e-3."""
LIGHT = 100.0
"""A bar this many times lighter than the other that the closure joins makes the closure softer than loads do: 10 g
and 1 g on 14.5 kg had the inertial torque 3e-5 and 3e-3 wrong, in proportion to the ratio. Pads follow it from here."""


def fit_pad(acceleration: float, load_ratio: float, mass_ratio: float = 1.0) -> float:
    """Choose the pad that leaves the closure stiff enough for the loads, and soft enough for one pass of Newton.

    The sag of the closure grows as pad^2 times the loads, the rounding of one pass as 1/(pad^2 times the loads).

    Parameters
    ----------
    acceleration : of bars 3 and 4, by their size: omega_2^2 or alpha_2 times input by longest of them, rad/s^2.
    load_ratio : loads and weights by the inertial forces.
    mass_ratio : of the two bars that the closure joins, the heavier by the lighter.
    """
    least_sag = SOFT_PAD / math.sqrt((1.0 + load_ratio) * max(1.0, mass_ratio / LIGHT))
    return least_sag if acceleration < QUICK else min(STIFF_PAD, least_sag)


FULL_TURN = 2.0 * math.pi * (1.0 - 1e-9)
"""rad; a sweep over 0..360 deg may miss the turn by its rounding."""


class WindowMotion:
    """The input's motion through a window of theta_2, in time.

    theta_2 = start + omega t + alpha t^2/2 from `start` to `stop`, at the speed `omega` at the start.
    """

    def __init__(self, start: float, stop: float, omega: float, alpha: float) -> None:
        if (stop - start) * omega < 0.0:
            raise ValueError("the input turns away from the end of its window")
        self.start, self.stop, self.omega, self.alpha = start, stop, omega, alpha

    @property
    def fastest(self) -> float:
        """The greatest |omega_2| in the window, rad/s."""
        return math.sqrt(max(self.omega**2, self.omega**2 + 2.0 * self.alpha * (self.stop - self.start)))

    def time(self, theta_2: float) -> float:
        """Return the time when the input passes an angle, s; LimitError where alpha_2 stops it before."""
        angle = theta_2 - self.start
        squared = self.omega**2 + 2.0 * self.alpha * angle
        if squared <= 0.0:
            raise LimitError(f"alpha_2 brings the input to rest before theta_2 = {theta_2:.6g} rad")
        return 2.0 * angle / (self.omega + math.copysign(math.sqrt(squared), self.omega))

    def timestep(self, settings: Settings = RECIPE, at_least: int = 0) -> float:
        """Choose a timestep that divides the turn: at least so many steps per revolution, per window and in all, s."""
        if settings.timestep is not None:
            return settings.timestep * settings.timestep_scale
        duration = self.time(self.stop)
        per_revolution = duration * self.fastest / (2.0 * math.pi) * settings.steps_per_revolution
        # at the greatest speed throughout: an input that speeds up covers the end of its window in few steps
        width = abs(self.stop - self.start)
        window = settings.steps_per_window * duration * self.fastest / width if 0.0 < width < FULL_TURN else 1.0
        # a window of 628 steps per revolution must not become one more by a rounding
        steps = max(math.ceil(max(per_revolution, window) * (1.0 - 1e-9)), at_least)
        return duration / steps * settings.timestep_scale
