"""The couple under which a joint accelerates as wanted, asked of MuJoCo by trials.

The acceleration is continuous in the couple. Where nothing but pins acts it is linear;
dry friction, joint limits and clamped actuators make it piecewise linear, and the
couple is bracketed.
"""

import math
from collections.abc import Callable

import mujoco
import numpy as np

from fourbar_validation.engines.mujoco.closed_loop import solve_couple

LEAST_ACCELERATION = 1e-6
"""Acceleration of the driven joint, over that of the open tree's joints, that is not
told from none.
"""


def find_couple(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    acceleration: Callable[[float], float],
    wanted: float,
) -> float | None:
    """Find the couple that gives an acceleration; NaN where none does.

    The couple that was evaluated last is returned too. None where the acceleration does
    not depend on the couple.

    Parameters
    ----------
    acceleration : evaluates `model` and `data` under a couple, N m, and returns an
        acceleration, rad/s^2.
    """
    free = acceleration(0.0)
    # without a couple it may already accelerate as wanted, to the rounding of the
    # others, which may vanish too: a bar that turns uniformly has omega^2
    speed = float(np.abs(data.qvel).max())
    others = max(float(np.abs(data.qacc_smooth).max()), speed * speed) or 1.0
    sought = max(abs(wanted - free), LEAST_ACCELERATION * others)
    # N m or N: beside a heavy flywheel a larger trial is no number for MuJoCo, which
    # takes controls up to 1e10
    trial = min(float(model.dof_M0.sum()) * sought, 1e8)
    # secant steps after the first: each gains the digits that the one before has
    couple = solve_couple(acceleration, wanted, 0.0, trial, 3)
    # part of the acceleration sought that a linear solve may leave; its rounding is
    # 1e-12, also near a change point
    if couple is None or abs(acceleration(couple) - wanted) <= 1e-9 * sought:
        return couple
    # the solver starts from the same accelerations at every trial, or its noise would
    # look like a jump
    start = data.qacc_warmstart.copy()

    def repeatable(size: float) -> float:
        data.qacc_warmstart[:] = start
        return acceleration(size)

    # part of it that the noise of the file's solver may leave; where the acceleration
    # jumps, all of it is left
    bracketed = bracket_couple(repeatable, wanted, trial, 1e-3 * sought)
    if bracketed is None:
        return math.nan
    return bracketed


def bracket_couple(
    acceleration: Callable[[float], float],
    wanted: float,
    trial: float,
    allowed: float,
) -> float | None:
    """Solve for the couple under which an acceleration is the wanted one.

    The couple that was evaluated last is returned too. The acceleration is continuous
    in the couple and need not be linear: dry friction, joint limits and clamped
    actuators make it piecewise linear. None where no couple gives the acceleration to
    within `allowed`.
    """
    from scipy.optimize import brentq

    def miss(couple: float) -> float:
        return acceleration(couple) - wanted

    sought = miss(0.0)
    if sought == 0.0:
        return 0.0
    above = below = 0.0
    # times that a trial's size is doubled in search of a couple, to both sides; beyond
    # 1e12 times the size nothing is found
    for doubling in range(40):
        size = abs(trial) * 2.0**doubling
        for nearer, farther in ((above, size), (below, -size)):
            if miss(farther) * sought <= 0.0:
                couple = float(brentq(miss, nearer, farther, xtol=abs(trial) * 1e-15))
                left = abs(miss(couple))
                return couple if left <= allowed else None
        above = size
        below = -size
    return None
