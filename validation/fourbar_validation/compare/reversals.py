"""Find where dry friction reverses.

The sense of rotation at a pin changes, and the pin forces jump. The driving torque
bends there and does not jump: the power f |omega_j - omega_i| is continuous.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fourbar.linkage import MOVING_BARS, PIN_FORCE, PINS
from fourbar.quantities import OK, Array
from fourbar.scene import Command, Scene
from fourbar.solution import Solution
from fourbar.solving import solve
from fourbar_validation.compare.tolerance import EPS, K

HALVINGS_OF_AN_INTERVAL = 60
"""Halvings of the interval between two positions, down to neighbouring doubles."""


@dataclass(frozen=True, slots=True)
class Reversal:
    """The jump at one pin between two positions of a sweep."""

    pin: str
    theta_2: float
    """rad; `before` and `after` are solved there. Friction has the sense of either
    side.
    """
    before: Solution
    after: Solution
    position: int
    """Index of the position before it."""

    def jump(self, quantity: str) -> float:
        """Return by how much a force or the torque changes, N or N m."""
        return float(
            np.linalg.norm(
                getattr(self.after, quantity) - getattr(self.before, quantity)
            )
        )

    def __str__(self) -> str:
        most = max(PIN_FORCE.values(), key=self.jump)
        ends = [
            " ".join(f"{x:.6g}" for x in getattr(side, most)[0])
            for side in (self.before, self.after)
        ]
        place = f"pin {self.pin}, theta_2 = {np.degrees(self.theta_2):.6g} deg"
        return (
            f"dry friction reverses at {place}: {most} jumps from ({ends[0]}) to"
            f" ({ends[1]}) N"
        )


def find_reversals(
    scene: Scene,
    command: Command,
    solution: Solution,
) -> list[Reversal]:
    """Find every reversal between two positions of a sweep, in their order.

    A position at which the pin is at rest lies within its reversal and ends no stretch.
    """
    pins = [pin for effect in scene.effects for pin in effect.dry_pins]
    if not pins or command.omega_2 is None or solution.omega_3 is None:
        return []
    if np.ndim(command.omega_2) or np.ndim(command.alpha_2):
        return []
    reversals = []
    for pin in dict.fromkeys(pins):
        slip = compute_slip(solution, pin)
        at_rest = _mark_resting(solution, pin, EPS * K)
        last = None
        for i in range(len(solution)):
            if solution.status_code[i] != OK:
                last = None
            elif not at_rest[i]:
                if (
                    last is not None
                    and slip[last] * slip[i] < 0.0
                    and command.branch[last] == command.branch[i]
                ):
                    reversals.append(
                        _locate_reversal(
                            scene, command, pin, last, i, float(slip[last])
                        )
                    )
                last = i
    return sorted(reversals, key=lambda reversal: reversal.position)


def mark_reversing(
    scene: Scene,
    solution: Solution,
    slip: float,
    *,
    in_time: bool = False,
) -> NDArray[np.bool_]:
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


def _mark_resting(solution: Solution, pin: str, slip: float) -> NDArray[np.bool_]:
    one, second = (_compute_speeds(solution)[bar] for bar in PINS[pin])
    speeds = np.abs(one) + np.abs(second) + np.abs(_compute_speeds(solution)[2])
    return np.asarray(
        (np.abs(second - one) * solution.condition**2 <= slip * speeds) & (speeds > 0.0)
    )


def break_curve(
    theta_2: Array,
    values: Array,
    jumps: list[Reversal],
    value: Callable[[Solution], Array],
) -> tuple[Array, Array]:
    """Give a curve, (n,), both ends of each jump and NaN between them.

    No line is then drawn across. `theta_2` and `values`: the curve at the positions of
    the solution, rad. `value`: what the curve shows of a solution.
    """
    for jump in sorted(jumps, key=lambda jump: -jump.position):
        after = jump.position + 1
        ends = [*value(jump.before), np.nan, *value(jump.after)]
        values = np.concatenate([values[:after], ends, values[after:]])
        theta_2 = np.concatenate([theta_2[:after], [jump.theta_2] * 3, theta_2[after:]])
    return theta_2, values


def compute_slip(solution: Solution, pin: str) -> Array:
    """Return omega_j - omega_i of the bars that meet at a pin, rad/s, (n,)."""
    one, second = (_compute_speeds(solution)[bar] for bar in PINS[pin])
    return np.asarray(second - one)


def _compute_speeds(solution: Solution) -> dict[int, Any]:
    return {1: 0.0, 2: solution.omega_2, 3: solution.omega_3, 4: solution.omega_4}


def _locate_reversal(
    scene: Scene,
    command: Command,
    pin: str,
    i: int,
    j: int,
    slip: float,
) -> Reversal:
    """Locate the reversal between positions i and j by bisection.

    Friction has the sense of either side.
    """

    def look(theta_2: float, side: int, stage: str) -> Solution:
        moved = command.as_doubles()._replace(
            angle=np.array([theta_2]),
            branch=command.branch[i : i + 1],
            time=None,
        )
        return solve(scene, stage, at=moved, side=side)

    low = float(command.theta_2[i])
    high = float(command.theta_2[j])
    for _ in range(HALVINGS_OF_AN_INTERVAL):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        if float(compute_slip(look(middle, 0, "velocity"), pin)[0]) * slip > 0.0:
            low = middle
        else:
            high = middle
    side = 1 if slip > 0.0 else -1
    return Reversal(pin, low, look(low, side, "force"), look(low, -side, "force"), i)
