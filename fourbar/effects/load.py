"""External loads: a force at a point of a bar, or a pure couple on it, constant or a table over theta_2."""

import bisect
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from fourbar.effects.effect import Act, Effect, Tree
from fourbar.effects.wrenches import Wrenches
from fourbar.errors import InputError, LimitError
from fourbar.linkage import MOVING_BARS, FourBar, require
from fourbar.solution import Solution
from fourbar.state import Array, State, Vector, along, centre_in_bar

TURN = 2.0 * math.pi


@dataclass(frozen=True, slots=True)
class Table:
    """Factor of a load over theta_2, linear between its points; theta_2 is taken modulo a turn.

    Parameters
    ----------
    theta_2 : rising angles over at most one turn, rad.
    factor : one for each angle; over a whole turn the last equals the first.
    """

    theta_2: tuple[float, ...]
    factor: tuple[float, ...]

    def __post_init__(self) -> None:
        key = "loads.table"
        angles = tuple(require(f"{key}.theta_2", angle) for angle in self.theta_2)
        factors = tuple(require(f"{key}.factor", factor) for factor in self.factor)
        if len(angles) < 2 or len(angles) != len(factors):
            raise InputError(key, (len(angles), len(factors)), "needs two or more angles and as many factors")
        if any(b <= a for a, b in pairwise(angles)):
            raise InputError(f"{key}.theta_2", angles, "must rise")
        span = angles[-1] - angles[0]
        whole = math.isclose(span, TURN, rel_tol=1e-12)
        if span > TURN and not whole:
            raise InputError(f"{key}.theta_2", angles, "must not exceed one turn")
        if whole and factors[0] != factors[-1]:
            raise InputError(f"{key}.factor", factors, "must end as it begins: its ends are one turn apart")
        object.__setattr__(self, "theta_2", angles)
        object.__setattr__(self, "factor", factors)

    def at(self, theta_2: Any) -> Array:
        """The factor; InputError for a position that the table does not cover."""
        first, last = self.theta_2[0], self.theta_2[-1]
        angle = first + np.remainder(np.asarray(getattr(theta_2, "hi", theta_2)) - first, TURN)
        beyond = angle > last + 1e-12 * TURN
        if beyond.any():
            # a position just below the first angle has come round to a whole turn above it
            round_ = beyond & (first + TURN - angle < 1e-12 * TURN)
            if not (round_ == beyond).all():
                raise InputError(
                    "loads.table.theta_2", float(np.max(angle)), f"covers {first:g} to {last:g} rad; this lies outside"
                )
            angle = np.where(round_, first, angle)
        return np.asarray(np.interp(angle, self.theta_2, self.factor))

    def look_up(self, theta_2: float) -> float:
        """The factor at one angle, by the two neighbours' chord: for the engines, apart from `at`."""
        angle = self.theta_2[0] + math.fmod(math.fmod(theta_2 - self.theta_2[0], TURN) + TURN, TURN)
        k = min(max(bisect.bisect_right(self.theta_2, angle), 1), len(self.theta_2) - 1)
        (a, b), (f, g) = self.theta_2[k - 1 : k + 1], self.factor[k - 1 : k + 1]
        return (f * (b - angle) + g * (angle - a)) / (b - a)


@dataclass(frozen=True, slots=True)
class Load(Effect):
    """A force and a couple on a moving bar.

    Parameters
    ----------
    bar : 2, 3 or 4.
    force : (magnitude, angle), N and rad, or None.
    at : (distance, angle) from the mass centre G to where the force acts, m and rad.
    moment : couple, N m, counter-clockwise.
    frame : "world": both angles are from +x; "bar": both turn with the bar, from its line.
    table : factor of force and couple over theta_2; None: constant.
    """

    bar: int
    force: tuple[float, float] | None = None
    at: tuple[float, float] = (0.0, 0.0)
    moment: float = 0.0
    frame: str = "world"
    table: Table | None = None

    def __post_init__(self) -> None:
        if self.bar not in MOVING_BARS or isinstance(self.bar, bool):
            raise InputError("loads.bar", self.bar, "must be 2, 3 or 4")
        if self.frame not in ("world", "bar"):
            raise InputError("loads.frame", self.frame, 'must be "world" or "bar"')
        for key, pair in (("loads.force", self.force), ("loads.at", self.at)):
            for number in pair or ():
                require(key, number)
        require("loads.moment", self.moment)

    def force_and_arm(self, state: State) -> tuple[tuple[Any, Any], Vector]:
        """The force in world axes and its point of application from the bar's first pin."""
        assert self.force is not None
        f, f_angle = self.force
        r, r_angle = self.at
        fx, fy = f * math.cos(f_angle), f * math.sin(f_angle)
        rx, ry = r * math.cos(r_angle), r * math.sin(r_angle)
        gx, gy = centre_in_bar(state.linkage.bar(self.bar))
        if self.frame == "bar":
            force, arm = along(state.unit(self.bar), fx, fy), state.arm(self.bar, gx + rx, gy + ry)
        else:
            x, y = state.arm(self.bar, gx, gy)
            force, arm = (fx, fy), (x + rx, y + ry)  # type: ignore[assignment]
        if self.table is None:
            return force, arm
        factor = self.table.at(state.theta_2)
        return (factor * force[0], factor * force[1]), arm

    def add_wrenches(self, wrenches: Wrenches, state: State) -> None:
        """F at its point, and the couple."""
        if self.force is not None:
            wrenches.add_force(self.bar, *self.force_and_arm(state))
        if self.moment != 0.0:
            wrenches.add_moment(self.bar, self._moment(state))

    def _moment(self, state: State) -> Array | float:
        return self.moment if self.table is None else self.moment * self.table.at(state.theta_2)

    def rounded_anew(self, beside: Callable[[float], float], *, all_of_it: bool) -> "Load":
        """Force, arm and couple."""
        force = None if self.force is None else (beside(self.force[0]), beside(self.force[1]))
        at = (beside(self.at[0]), beside(self.at[1]))
        return replace(self, force=force, at=at, moment=beside(self.moment) if all_of_it else self.moment)

    def power(self, state: State) -> Array | float:
        """P = F . v of the point of application + M omega, W."""
        total: Array | float = self._moment(state) * state.omega(self.bar)
        if self.force is not None:
            force, (x, y) = self.force_and_arm(state)
            pin_x, pin_y = state.velocity(self.bar, 0.0, 0.0)
            w = state.omega(self.bar)
            total = total + force[0] * (pin_x - w * y) + force[1] * (pin_y + w * x)
        return total

    def engine_term(self, tree: Tree) -> Act:
        """A force at its point and a couple; in the bar's frame both vectors turn with the engine's bar."""

        def act() -> None:
            factor = 1.0 if self.table is None else self.table.look_up(tree.angle(2))
            if self.force is not None:
                f, f_angle = self.force
                r, r_angle = self.at
                x, y, at_x, at_y = (
                    *(f * math.cos(f_angle), f * math.sin(f_angle)),
                    *(r * math.cos(r_angle), r * math.sin(r_angle)),
                )
                if self.frame == "bar":
                    force, arm = tree.turned(self.bar, x, y), tree.turned(self.bar, at_x, at_y)
                else:
                    force, arm = np.array([x, y]), np.array([at_x, at_y])
                tree.push(self.bar, factor * force, tree.centre(self.bar) + arm)
            tree.twist(self.bar, factor * self.moment)

        return act

    def add_mjcf(self, model: Any) -> None:
        """A constant actuator on a site (force) or on the bar (couple)."""
        if self.table is not None:
            raise LimitError("a load that is a table over theta_2 has no counterpart in MJCF")
        model.loads.append(self)

    def size(self, linkage: FourBar, solution: Solution | None = None) -> float:
        """The force counted with its lever, and the couple divided by the bar's length, N."""
        bar = linkage.bar(self.bar)
        total = abs(self.moment) / bar.length
        if self.force is not None:
            total += abs(self.force[0]) * (1.0 + (abs(bar.centre[0]) + abs(self.at[0])) / bar.length)  # type: ignore[index]
        return total if self.table is None else total * max(abs(factor) for factor in self.table.factor)

    def couple(self, linkage: FourBar, speed: float) -> float:
        """The load's size at the longest bar, N m."""
        return self.size(linkage) * max(linkage.lengths)
