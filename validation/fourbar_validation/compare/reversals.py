"""Find where dry friction reverses.

The sense of rotation at a pin changes, and the pin forces jump. The driving torque
bends there and does not jump: the power f |omega_j - omega_i| is continuous.
"""

from typing import Any

import numpy as np

from fourbar.linkage import MOVING_BARS, PINS
from fourbar.quantities import Array, Mask
from fourbar.scene import Scene
from fourbar.solution import Solution


def mark_reversing(
    scene: Scene,
    solution: Solution,
    slip: float,
    *,
    in_time: bool = False,
) -> Mask:
    """Mark where a dry pin of a moving linkage slips little, (n,).

    The slip is at most this part of the two speeds over sin^2 mu. There the sense of
    friction is undecided, and the forces on both sides of the jump are right. An engine
    that runs through the motion `in_time` has no convention at rest either: 0 is as
    good as any couple up to the friction's.
    """
    mask = np.zeros(len(solution), dtype=bool)
    omega = _find_speeds(solution)
    size = {bar: np.abs(speed) for bar, speed in omega.items()}
    fastest = np.nan_to_num(np.max([size[bar] for bar in MOVING_BARS], axis=0))
    for pin in {pin for effect in scene.effects for pin in effect.dry_pins}:
        i, j = PINS[pin]
        speeds = size[i] + size[j] + size[2]
        slips = np.abs(omega[j] - omega[i]) * solution.condition**2
        mask |= (slips <= slip * speeds) & (speeds > 0.0)
        if in_time:
            mask |= fastest <= slip * fastest.max()
    return mask


def compute_slip(solution: Solution, pin: str) -> Array:
    """Return omega_j - omega_i of the bars that meet at a pin, rad/s, (n,)."""
    i, j = PINS[pin]
    omega = _find_speeds(solution)
    return np.asarray(omega[j] - omega[i])


def _find_speeds(solution: Solution) -> dict[int, Any]:
    return {1: 0.0, 2: solution.omega_2, 3: solution.omega_3, 4: solution.omega_4}
