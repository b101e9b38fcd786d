"""What the frame and the pins bear over a motion: shaking force and moment, power, bearing loads."""

from typing import NamedTuple

import numpy as np

from fourbar.errors import InputError, expect
from fourbar.linkage import PIN_FORCE, FourBar
from fourbar.solution import Array, Solution


class BearingLoad(NamedTuple):
    """Load of one pin over the positions of a solution."""

    largest: float
    """N."""
    rms: float
    """Root mean square over the positions, N; a closed sweep counts its two equal ends once."""
    where: float
    """theta_2 of the largest load, rad."""


def _evaluated(solution: Solution, name: str) -> Array:
    expect("solution", solution, Solution)
    force: Array | None = getattr(solution, name)
    if force is None:
        raise InputError("solution", name, "was not evaluated: solve up to the stage 'force'")
    return force


def shaking_force(solution: Solution) -> Array:
    """Force of the bars on the frame through its pins, F21 + F41 = -(F12 + F14), N, (n, 2).

    A spring with one end on the ground pulls there besides.
    """
    return -(_evaluated(solution, "F12") + _evaluated(solution, "F14"))


def shaking_moment(linkage: FourBar, solution: Solution) -> Array:
    """Moment of the bars and of the drive on the frame about O2, -T - O4 x F14, N m, (n,).

    Couples that effects exert between the bars and ground (pin damping or friction at O2, O4)
    are not part of it.
    """
    expect("linkage", linkage, FourBar)
    F14, torque = _evaluated(solution, "F14"), _evaluated(solution, "torque")
    x, y = linkage.ground * np.cos(linkage.ground_angle), linkage.ground * np.sin(linkage.ground_angle)
    return np.asarray(-torque - (x * F14[:, 1] - y * F14[:, 0]))


def drive_power(solution: Solution) -> Array:
    """T_k omega_k, W, (n,)."""
    return np.asarray(_evaluated(solution, "torque") * _evaluated(solution, f"omega_{solution.drive_bar}"))


def once_round(solution: Solution) -> slice:
    """All positions, but of a sweep over whole turns not the last one, which repeats the first."""
    turns = abs(solution.theta_2[-1] - solution.theta_2[0]) / (2.0 * np.pi)
    closed = len(solution) > 1 and turns > 0.5 and np.isclose(turns, round(turns), rtol=1e-12, atol=0.0)
    return slice(None, -1 if closed else None)


def bearing_load(solution: Solution, pin: str) -> BearingLoad:
    """Largest and root mean square load of pin "O2", "A", "B" or "O4", and where; NaN positions are left out."""
    if not isinstance(pin, str) or pin not in PIN_FORCE:
        raise InputError("pin", pin, "the pins are " + ", ".join(PIN_FORCE))
    loads = np.hypot(*_evaluated(solution, PIN_FORCE[pin]).T)
    one = once_round(solution)
    load, theta_2 = loads[one], solution.theta_2[one]
    known = np.isfinite(load)
    if not known.any():
        return BearingLoad(float("nan"), float("nan"), float("nan"))
    load, theta_2 = load[known], theta_2[known]
    worst = int(np.argmax(load))
    return BearingLoad(float(load[worst]), float(np.sqrt(np.mean(load**2))), float(theta_2[worst]))
