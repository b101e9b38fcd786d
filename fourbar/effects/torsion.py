"""Torsion springs at pins: a couple proportional to the angle between the two bars."""

import math
from typing import Any, ClassVar

import numpy as np

from fourbar.effects.effect import Actions, Joints, PinRows
from fourbar.errors import LimitError
from fourbar.formulas.arithmetic import Number, angle, wrap_angle
from fourbar.formulas.motion import State
from fourbar.formulas.position import ROLES_OF_BARS, reorder_lengths
from fourbar.linkage import PINS, POSITIVE, Declared, FourBar, copy_with, record
from fourbar.quantities import OK, WOUND, Array, Codes, Signs

HALF_TURN = math.pi * (1.0 - 1e-12)
"""rad; at half a turn itself rounding would decide in which sense the spring turns."""


@record
class Torsion(PinRows):
    """Springs as (pin, stiffness in N m/rad, rest angle in rad, preload in N m).

    With beta = theta_j - theta_i (theta_1 for the ground) the couple on bar j is
    -(preload + stiffness (beta - rest)). Where the motion begins beta - rest is within
    half a turn, whatever whole turns the scene's angles count; where the pin then turns
    beyond half a turn from rest, followed continuously along the commanded angle, the
    status is "wound" and there are no forces.
    """

    springs: tuple[tuple[str, float, float, float], ...]
    turns: tuple[Number, ...] | None = None
    """Whole turns of each pin where the motion begins, rad; not part of a scene."""
    counts_turns = True
    key = "torsion"
    in_balls = True
    example = (
        'torsion = { B = { stiffness = "2 N m/rad", rest = "30 deg",'
        ' preload = "0.1 N m" } }'
    )
    numbers: ClassVar[dict[str, Declared]] = {
        "stiffness": Declared("N m/rad", POSITIVE),
        "rest": Declared("rad"),
        "preload": Declared("N m", left_out=0.0),
    }

    def act(self, actions: Actions, state: State) -> None:
        """Add M on bar j and its opposite on bar i.

        M = -(preload + k (theta_j - theta_i - rest)).
        """
        windings = self.list_windings(state)
        for wound, (pin, k, _, preload) in zip(windings, self.springs, strict=True):
            actions.pin_couple(pin, -(preload + k * wound))

    def list_windings(self, state: State) -> list[Number]:
        """List theta_j - theta_i - rest of each spring, within half a turn, rad."""
        windings = []
        for pin, _, rest, _ in self.springs:
            i, j = PINS[pin]
            relative = state.direction(j) * state.direction(i).conjugate()
            windings.append(wrap_angle(angle(relative) - rest))
        return windings

    def begin_at(self, start: State, branch: Number) -> "Torsion":
        """Count whole turns where the motion begins."""
        turns = []
        angles = self._follow_angles(start, branch)
        for followed, (_, _, rest, _) in zip(angles, self.springs, strict=True):
            from_rest = followed - rest
            turns.append(math.tau * np.floor(from_rest / math.tau + 0.5))
        return copy_with(self, turns=tuple(turns))

    def status(
        self,
        state: State,
        branch: Signs | None,
    ) -> Codes | None:
        """Return WOUND at half a turn from rest and beyond."""
        wound = [*self.list_wound(state, branch).values()]
        if not wound:
            return None
        return np.where(np.any(wound, axis=0), WOUND, OK).astype(np.uint8)

    def list_wound(self, state: State, branch: Number) -> dict[str, Number]:
        """List where each sprung pin is at half a turn from rest and beyond."""
        if self.turns is None:
            return {}
        angles = self._follow_angles(state, branch)
        rows = zip(angles, self.turns, self.springs, strict=True)
        return {
            pin: np.abs(followed - rest - turns) > HALF_TURN
            for followed, turns, (pin, _, rest, _) in rows
        }

    def add_to_mjcf(self, model: Any) -> None:
        """Write the ``stiffness`` of the hinge, or of a tendon at the cut pin B.

        The rest angle written is shifted by the preload.
        """
        for pin, k, rest, preload in self.springs:
            turned = model.linkage.ground_angle if pin in ("O2", "O4") else 0.0
            # a tendon's rest is a length
            rest_of_hinge = "springlength" if pin == "B" else "springref"
            model.pin[pin]["stiffness"] = k
            model.pin[pin][rest_of_hinge] = rest + turned - preload / k

    def couple_on_drive(self, linkage: FourBar, speed: float) -> float:
        """Return an upper bound of the sum of the couples, N m."""
        return sum(abs(preload) + k * math.pi for _, k, _, preload in self.springs)

    def unwind(self, linkage: FourBar, q: Joints) -> Joints:
        """Return each sprung pin within half a turn of its rest.

        Raises LimitError where the turns of A, B and O4 contradict.
        """
        rests = {pin: rest for pin, _, rest, _ in self.springs}

        def turns(pin: str, angle: float, line: float) -> float:
            if pin not in rests:
                return 0.0
            return math.tau * round((rests[pin] + line - angle) / math.tau)

        theta_1 = linkage.ground_angle
        q2 = q[0] + turns("O2", q[0], theta_1)
        q3 = q[1] + turns("A", q[1], 0.0)
        q4 = q[2] + turns("O4", q[2], theta_1)
        at_B = turns("B", q4 - q2 - q3, 0.0)
        if at_B and "O4" not in rests:
            q4 += at_B
        elif at_B and "A" not in rests:
            q3 -= at_B
        elif at_B:
            raise LimitError(
                "the springs at A, B and O4 count turns that MuJoCo's joints cannot"
                " have at once"
            )
        return q2, q3, q4

    def _follow_angles(self, state: State, branch: Number) -> list[Array]:
        """Compute theta_j - theta_i of each sprung pin, rad.

        On one branch the angles are continuous in the commanded angle.
        """
        angles = _remove_jumps(state, branch)
        relative = []
        for pin, *_ in self.springs:
            i, j = PINS[pin]
            relative.append(angles[j] - angles[i])
        return relative


def _remove_jumps(state: State, branch: Number) -> dict[int, Number]:
    """Compute theta_1 .. theta_4 without jumps at whole turns, on one branch.

    The loop is read from the commanded bar. The diagonal from A to O4 swings about the
    ground's line where a < d, and otherwise about the input's, never by more than a
    quarter turn. Where it vanishes at a change point (a = d, b = c) it has the
    direction of (theta_1 + theta_2)/2 less a quarter turn, and a signed length.
    """
    bar = state.bar
    roles = ROLES_OF_BARS[bar]
    d, a, b, c = reorder_lengths(bar, state.lengths[:4])
    u2, u3, u4 = (state.direction(role) for role in roles)
    # read from bar 4, the ground and the coupler point the other way
    half_turn = math.pi if bar == 4 else 0.0
    theta_1 = state.theta_1 + half_turn
    theta_2 = state.theta_2 if state.q is None else state.q
    theta_3 = np.angle(u3) + half_turn
    theta_4 = np.angle(u4)

    phi = np.angle(d * np.exp(1j * theta_1) - a * u2)
    line = np.where(a < d, theta_1, theta_2 + math.pi)
    phi = line + wrap_angle(phi - line)
    outer, inner = state.passing
    vanishes = inner & (a == d)
    phi_where_it_vanishes = 0.5 * (theta_1 + theta_2) - 0.5 * math.pi
    phi = np.where(vanishes, phi_where_it_vanishes, phi)

    half = 0.5 * (theta_2 - theta_1)
    middle_3 = _find_middle(b, c, half, outer, inner)
    middle_4 = _find_middle(c, b, half, outer, inner)
    from_diagonal_3 = branch * (theta_3 - phi)
    from_diagonal_4 = branch * (phi + math.pi - theta_4)
    swing_3 = middle_3 + wrap_angle(from_diagonal_3 - middle_3)
    swing_4 = middle_4 + wrap_angle(from_diagonal_4 - middle_4)

    second, third, fourth = roles
    return {
        1: np.full_like(theta_2, theta_1 - half_turn),
        second: theta_2,
        third: phi + branch * swing_3 - half_turn,
        fourth: phi + math.pi - branch * swing_4,
    }


def _find_middle(
    beside: Number,
    opposite: Number,
    half: Number,
    outer: Number,
    inner: Number,
) -> Number:
    """Find what the angle of a bar from the diagonal never leaves by half a turn, rad.

    In the triangle of bars 3 and 4 and the diagonal f the angle of a bar p, opposite to
    the bar q, is 2 arg(x + i y) with
        x^2 = (p + q + f)(f + p - q),   y^2 = (p + q - f)(f - p + q).
    Both are positive but where a root passes through zero: the outer one turns the sign
    of y at h = 90 deg, the inner one at h = 0 that of y if p > q, of x if p < q. Where
    both change their signs, the angle winds by as much as the bar commanded turns, and
    by half of that where the diagonal vanishes, p = q.

    Parameters
    ----------
    beside, opposite : lengths p and q.
    half : h, rad, not reduced.
    outer, inner : roots that pass through zero.
    """
    of_x = inner & (beside < opposite)
    of_y = outer | (inner & (beside > opposite))
    winds = math.pi - 2.0 * half
    of_both = np.where(beside == opposite, 0.5 * winds, winds)
    middle = np.where(of_y, 0.0, 0.5 * math.pi)
    middle = np.where(of_x, math.pi, middle)
    wound = outer & inner & (beside <= opposite)
    return np.where(wound, of_both, middle)
