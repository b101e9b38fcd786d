"""MuJoCo's settings for a wanted error, from the laws that the study of cost measured.

the closure's time constant    error = STIFF (h/tc)^4, whatever the timestep        -> tc in steps
the timestep                   error ~ h^ORDER until a floor                         -> steps
"""

from fourbar.mjcf import Settings

STIFF = 4e-2
"""error (tc/h)^4 of RK4 with tc in steps: measured 1.3e-2 to 6e-2 on crank-rocker, drag link and double rocker."""
SHORTEST = 3.0
"""Steps of the time constant: below 2 the closure follows no integrator."""
LONGEST = 400.0
"""Beyond it nothing is gained above 1e-12, and the loop is no longer held together over a revolution."""
ORDER = 4.0
"""Of RK4; the first guess of the next number of steps, not what decides."""
FIRST_STEPS, FIRST_ERROR = 60.0, 1e-5
"""Steps per revolution from which the search begins, by the order, for other errors."""
FEWEST_STEPS = 6.0
"""A revolution cannot be followed by less."""
FLYWHEEL = 1e5
"""Lighter than the recipe's: the torque, armature times acceleration, is rounded in proportion to it."""


def guess(error: float) -> tuple[float, float]:
    """Steps per revolution and time constant in steps that the laws say for an error."""
    tc = (STIFF / (error / 2.0)) ** (1.0 / ORDER)
    steps = FIRST_STEPS * (FIRST_ERROR / error) ** (1.0 / ORDER)
    return max(steps, FEWEST_STEPS), min(max(tc, SHORTEST), LONGEST)


def dialled(steps_per_revolution: float, time_constant_steps: float) -> Settings:
    """The recommended settings at a number of steps and a time constant; a window has no steps of its own."""
    return Settings(
        steps_per_revolution=steps_per_revolution,
        steps_per_window=1,
        time_constant_steps=time_constant_steps,
        flywheel=FLYWHEEL,
    )
