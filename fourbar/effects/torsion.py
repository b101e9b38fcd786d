"""Torsion springs at pins: a couple proportional to the angle between the two bars."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fourbar.effects.effect import Act, Effect, Joints, Tree
from fourbar.effects.pins import known, shortest_bar
from fourbar.effects.wrenches import Wrenches
from fourbar.errors import LimitError
from fourbar.linkage import PINS, FourBar, require
from fourbar.solution import OK, WOUND, Solution
from fourbar.state import Array, State

FIELDS = {"stiffness": "N m/rad", "rest": "rad", "preload": "N m"}
HALF_TURN = math.pi * (1.0 - 1e-12)
"""rad; at half a turn itself rounding would decide which way the spring turns."""


@dataclass(frozen=True, slots=True)
class Torsion(Effect):
    """Springs as (pin, stiffness in N m/rad, rest angle in rad, preload in N m).

    With beta = theta_j - theta_i (theta_1 for the ground) the couple on bar j is
    -(preload + stiffness (beta - rest)). Where the motion begins beta - rest is within half a turn, whatever
    whole turns the scene's angles count; where the pin then turns beyond half a turn from rest, followed
    continuously along theta_2, the status is "wound" and there are no forces.
    """

    springs: tuple[tuple[str, float, float, float], ...]
    turns: tuple[float, ...] | None = None
    """Whole turns of each pin where the motion begins, rad; not part of a scene."""
    counts_turns: ClassVar[bool] = True
    key: ClassVar[str] = "torsion"
    example: ClassVar[str] = 'torsion = { B = { stiffness = "2 N m/rad", rest = "30 deg", preload = "0.1 N m" } }'

    @classmethod
    def at(cls, **springs: tuple[float, float, float]) -> "Torsion":
        """``Torsion.at(B=(stiffness, rest, preload))``."""
        return cls(_checked(springs))

    @classmethod
    def read(cls, value: object, reader: Any) -> "Torsion":
        """From ``{ B = { stiffness = "2 N m/rad", rest = "30 deg", preload = "0.1 N m" } }``; preload 0 if left out."""
        key = "effects.torsion"
        springs = {}
        for pin, entry in reader.table(key, value, PINS).items():
            given = reader.table(f"{key}.{pin}", entry, FIELDS)
            texts = {"preload": "0 N m", **given}
            k, rest, preload = (
                reader.quantity(f"{key}.{pin}.{name}", texts.get(name), unit) for name, unit in FIELDS.items()
            )
            springs[pin] = (k, rest, preload)
        return cls.at(**springs)

    def write(self, writer: Any) -> Any:
        """Back to the form of a scene file."""
        return {
            pin: {name: writer.quantity(x, FIELDS[name]) for name, x in zip(FIELDS, numbers, strict=True)}
            for pin, *numbers in self.springs
        }

    def add_wrenches(self, wrenches: Wrenches, state: State) -> None:
        """M on bar j = -(preload + k (theta_j - theta_i - rest)), its opposite on bar i."""
        for pin, k, rest, preload in self.springs:
            i, j = PINS[pin]
            couple = -(preload + k * _wound(self._angle(state, j) - self._angle(state, i) - rest))
            wrenches.add_moment(j, couple)
            wrenches.add_moment(i, -couple)

    def begun(self, start: State) -> "Torsion":
        """Whole turns counted at the first position that assembles; none where the motion changes its branch."""
        if not start.assembled.any() or np.ptp(start.branch) != 0:
            return self
        first = int(np.argmax(start.assembled))
        away = [
            float(angle[first]) - rest for angle, (_, _, rest, _) in zip(self._along(start), self.springs, strict=True)
        ]
        return replace(self, turns=tuple(math.tau * math.floor(angle / math.tau + 0.5) for angle in away))

    def unsettled(self, state: State) -> NDArray[np.uint8] | None:
        """WOUND at half a turn from rest and beyond."""
        if self.turns is None:
            return None
        wound = np.zeros(state.theta_2.shape, dtype=bool)
        for angle, turns, (_, _, rest, _) in zip(self._along(state), self.turns, self.springs, strict=True):
            wound |= np.abs(angle - rest - turns) > HALF_TURN
        return np.where(wound, WOUND, OK).astype(np.uint8)

    def _along(self, state: State) -> list[Array]:
        """theta_j - theta_i of each sprung pin, continuous in theta_2 on one branch."""
        angles = _continuous(state)
        return [angles[PINS[pin][1]] - angles[PINS[pin][0]] for pin, *_ in self.springs]

    @staticmethod
    def _angle(state: State, bar: int) -> Array | float:
        return state.linkage.ground_angle if bar == 1 else _hi(state.angle(bar))

    def power(self, state: State) -> Array | float:
        """P = -dV/dt with V = sum of preload beta + k beta^2/2, W; beta from the sine and cosine between the bars."""
        total: Array | float = 0.0
        for pin, k, rest, preload in self.springs:
            i, j = PINS[pin]
            ground = (math.cos(state.linkage.ground_angle), math.sin(state.linkage.ground_angle))
            one, other = (np.asarray(x) for x in (ground if i == 1 else state.unit(i))), state.unit(j)
            x, y = one
            sine, cosine = x * other[1] - y * other[0], x * other[0] + y * other[1]
            c, s = math.cos(rest), math.sin(rest)
            beta = np.arctan2(sine * c - cosine * s, cosine * c + sine * s)
            total = total - (preload + k * beta) * (state.omega(j) - state.omega(i))
        return total

    def engine_term(self, tree: Tree) -> Act:
        """Couples from the engine's own angles of the two bars."""

        def act() -> None:
            for pin, k, rest, preload in self.springs:
                one, other = PINS[pin]
                twist = math.remainder(tree.angle(one) - tree.angle(other) + rest, math.tau)
                tree.twist(other, k * twist - preload)
                tree.twist(one, preload - k * twist)

        return act

    def add_mjcf(self, model: Any) -> None:
        """``stiffness`` of the hinge (of a tendon at the cut pin B), its rest shifted by the preload."""
        for pin, k, rest, preload in self.springs:
            turned = model.linkage.ground_angle if pin in ("O2", "O4") else 0.0
            model.pin[pin]["stiffness"] = k
            # a tendon's rest is a length
            model.pin[pin]["springlength" if pin == "B" else "springref"] = rest + turned - preload / k

    def unwind(self, linkage: FourBar, q: Joints) -> Joints:
        """Each sprung pin within half a turn of its rest; LimitError where the turns of A, B and O4 contradict."""
        rests = {pin: rest for pin, _, rest, _ in self.springs}

        def turns(pin: str, angle: float, line: float) -> float:
            return 0.0 if pin not in rests else math.tau * round((rests[pin] + line - angle) / math.tau)

        theta_1 = linkage.ground_angle
        q2, q3, q4 = q[0] + turns("O2", q[0], theta_1), q[1] + turns("A", q[1], 0.0), q[2] + turns("O4", q[2], theta_1)
        at_B = turns("B", q4 - q2 - q3, 0.0)
        if at_B and "O4" not in rests:
            q4 += at_B
        elif at_B and "A" not in rests:
            q3 -= at_B
        elif at_B:
            raise LimitError("the springs at A, B and O4 count turns that MuJoCo's joints cannot have at once")
        return q2, q3, q4

    def size(self, linkage: FourBar, solution: Solution) -> float:
        """Greatest couples, divided by the shortest moving bar, N."""
        return self.couple(linkage, 0.0) / shortest_bar(linkage)

    def couple(self, linkage: FourBar, speed: float) -> float:
        """Greatest couples, N m."""
        return sum(abs(preload) + k * math.pi for _, k, _, preload in self.springs)


def _continuous(state: State) -> dict[int, Array]:
    """theta_1 .. theta_4 without jumps at a whole turn, on one branch.

    The diagonal from A to O4 swings about the ground's line where a < d, and otherwise about the input's, never by
    more than a quarter turn; bars 3 and 4 make angles with it that stay between 0 and half a turn.
    """
    d, a, _, _ = state.linkage.lengths
    theta_1, sign = state.linkage.ground_angle, state.branch
    theta_2, theta_3, theta_4 = (_hi(state.angle(bar)) for bar in (2, 3, 4))
    phi = np.arctan2(state.O4[1] - a * np.sin(theta_2), state.O4[0] - a * np.cos(theta_2))
    line = theta_1 if a < d else theta_2 + math.pi
    phi = line + _wound(phi - line)

    def beyond(angle: Array) -> Array:
        """An angle between 0 and half a turn, or as far outside as rounding puts it."""
        return _wound(angle - 0.5 * math.pi) + 0.5 * math.pi

    return {
        1: np.full_like(theta_2, theta_1),
        2: theta_2,
        3: phi + sign * beyond(sign * (theta_3 - phi)),
        4: phi + math.pi - sign * beyond(sign * (phi + math.pi - theta_4)),
    }


def _hi(angle: Any) -> Array:
    """A double: a spring's angle needs no more than its digits."""
    return np.asarray(getattr(angle, "hi", angle))


def _wound(angle: Array | float) -> Array:
    """The angle in [-pi, pi)."""
    return np.remainder(np.asarray(angle) + np.pi, 2.0 * np.pi) - np.pi


def _checked(springs: Mapping[str, tuple[float, float, float]]) -> tuple[tuple[str, float, float, float], ...]:
    for pin, values in springs.items():
        known(f"effects.torsion.{pin}", pin, values)
    rows = []
    for pin in (name for name in PINS if name in springs):
        key, (k, rest, preload) = f"effects.torsion.{pin}", springs[pin]
        stiffness = require(f"{key}.stiffness", k, positive=True)
        rows.append((pin, stiffness, require(f"{key}.rest", rest), require(f"{key}.preload", preload)))
    return tuple(rows)
