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
    for pin in {pin for effect in scene.effects for pin in effect.dry_pins}:
        mask |= _mark_resting(solution, pin, slip)
        if in_time:
            speeds = np.max(
                [np.abs(_compute_speeds(solution)[bar]) for bar in MOVING_BARS],
                axis=0,
            )
            speeds = np.nan_to_num(speeds)
            mask |= speeds <= slip * speeds.max()
    return mask


def _mark_resting(solution: Solution, pin: str, slip: float) -> Mask:
    one, second = (_compute_speeds(solution)[bar] for bar in PINS[pin])
    speeds = np.abs(one) + np.abs(second) + np.abs(_compute_speeds(solution)[2])
    return np.asarray(
        (np.abs(second - one) * solution.condition**2 <= slip * speeds) & (speeds > 0.0)
    )


def compute_slip(solution: Solution, pin: str) -> Array:
    """Return omega_j - omega_i of the bars that meet at a pin, rad/s, (n,)."""
    one, second = (_compute_speeds(solution)[bar] for bar in PINS[pin])
    return np.asarray(second - one)


def _compute_speeds(solution: Solution) -> dict[int, Any]:
    return {1: 0.0, 2: solution.omega_2, 3: solution.omega_3, 4: solution.omega_4}
