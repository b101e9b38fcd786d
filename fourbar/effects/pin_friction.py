"""Coulomb friction in the pins: a couple mu r |F| against the rotation, with F the pin force it helps to make."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fourbar.bearing import PIN_FORCE
from fourbar.effects.cones import NONE, ONE, newton_step, settle
from fourbar.effects.effect import Act, Effect, Tree
from fourbar.effects.pins import known, sense, shortest_bar
from fourbar.effects.wrenches import Wrenches
from fourbar.errors import InputError, LimitError
from fourbar.linkage import PINS, FourBar, require
from fourbar.solution import JAMMED, OK, SEVERAL, Solution
from fourbar.state import Array, State

NO_POWER = "friction that depends on the pin forces does an amount of work that the energy method cannot know"
NO_MJCF = "friction that depends on the pin forces has no counterpart in MJCF"


@dataclass(frozen=True, slots=True)
class PinFriction(Effect):
    """Pins as (pin, coefficient of friction mu, pin radius r in m): couple mu r |F| where the pin turns.

    At a pin that does not turn the couple may have any value up to that; 0, the middle, is taken, and
    `torque_low`, `torque_high` of the solution are the torques at which the motion would begin.
    Where no couples fulfil the equations the status is "jammed", where several do it is "several".
    """

    pins: tuple[tuple[str, float, float], ...]
    side: int = 0
    """Which way pins at rest are about to turn; not part of a scene."""
    key: ClassVar[str] = "pin_friction"
    example: ClassVar[str] = 'pin_friction = { A = { coefficient = 0.1, radius = "8 mm" } }'
    dry: ClassVar[bool] = True

    @classmethod
    def at(cls, **pins: tuple[float, float]) -> "PinFriction":
        """``PinFriction.at(A=(mu, radius))``."""
        return cls(_checked(pins))

    @classmethod
    def read(cls, value: object, reader: Any) -> "PinFriction":
        """From ``{ A = { coefficient = 0.1, radius = "8 mm" } }``."""
        key = "effects.pin_friction"
        pins = {}
        for pin, entry in reader.table(key, value, PINS).items():
            given = reader.table(f"{key}.{pin}", entry, ("coefficient", "radius"))
            mu = reader.number(f"{key}.{pin}.coefficient", given.get("coefficient"))
            pins[pin] = (mu, reader.quantity(f"{key}.{pin}.radius", given.get("radius"), "m", at_least_zero=True))
        return cls.at(**pins)

    def write(self, writer: Any) -> Any:
        """Back to the form of a scene file."""
        return {pin: {"coefficient": mu, "radius": writer.quantity(r, "m")} for pin, mu, r in self.pins}

    @property
    def loaded_pins(self) -> tuple[str, ...]:
        """The pins whose forces it depends on."""
        return tuple(pin for pin, mu, r in self.pins if mu * r != 0.0)

    @property
    def dry_pins(self) -> tuple[str, ...]:
        """The pins at which it acts."""
        return self.loaded_pins

    def settle(self, state: State, wrenches: Wrenches, pins: Any, eliminate: Callable[[Wrenches], Any]) -> Any:
        """Pin forces with the couples that fulfil x_p = mu_p r_p |F_p(x)|, their residual and their status.

        The pin forces are linear in the couples: F_p = F0_p + sum over q of C_pq x_q.

        Parameters
        ----------
        wrenches : of everything else; the couples are added to it.
        pins : pin forces under those.
        eliminate : wrenches -> pin forces.
        """
        names = self.loaded_pins
        arms = {pin: mu * r for pin, mu, r in self.pins}
        k = np.array([arms[pin] for pin in names])
        senses = {pin: sense(state, pin, self.side) for pin in names}
        force = {pin: getattr(pins, PIN_FORCE[pin]) for pin in names}
        per_unit: dict[tuple[str, str], Any] = {}
        for turned in names:
            alone = Wrenches(state)
            _add_couple(alone, turned, -senses[turned])
            answer = eliminate(alone)
            per_unit.update({(pin, turned): getattr(answer, PIN_FORCE[pin]) for pin in names})
        F = np.stack([_doubles(force[pin]) for pin in names], axis=1)
        C = np.stack([np.stack([_doubles(per_unit[pin, q]) for q in names], axis=1) for pin in names], axis=1)
        found = settle(F, C, k)
        x: list[Any] = list(found.x.T)
        # one more step of Newton in the precision of the state, which may have 32 digits
        for _ in range(2):
            residuals, slope = [], []
            for p, pin in enumerate(names):
                fx, fy = force[pin]
                for other, couple in zip(names, x, strict=True):
                    cx, cy = per_unit[pin, other]
                    fx, fy = fx + cx * couple, fy + cy * couple
                size = np.sqrt(fx * fx + fy * fy)
                residuals.append(x[p] - k[p] * size)
                with np.errstate(invalid="ignore"):
                    unit = np.nan_to_num(_doubles((fx, fy)) / _double(size)[:, None])
                slope.append(k[p] * np.einsum("ni,nqi->nq", unit, C[:, p]))
            gap = -np.stack([_double(residual) for residual in residuals], axis=1)
            step = newton_step(gap, np.stack(slope, axis=1))
            x = [couple + step[:, p] for p, couple in enumerate(x)]
        for pin, couple in zip(names, x, strict=True):
            _add_couple(wrenches, pin, -senses[pin] * couple)
        done = eliminate(wrenches)
        left = [
            _double(couple) - arms[pin] * np.hypot(*_doubles(getattr(done, PIN_FORCE[pin])).T)
            for pin, couple in zip(names, x, strict=True)
        ]
        # how far from jamming: the least stretch of 1 - slope
        matrix = np.eye(len(names)) - np.stack(slope, axis=1)
        far = np.ones(len(matrix))
        usable = np.isfinite(matrix).all(axis=(1, 2))
        far[usable] = np.minimum(np.linalg.svd(matrix[usable], compute_uv=False)[:, -1], 1.0)
        unsettled = np.where(found.number == ONE, OK, np.where(found.number == NONE, JAMMED, SEVERAL)).astype(np.uint8)
        return done._replace(from_jamming=far, residual=np.max(np.abs(left), axis=0), unsettled=unsettled)

    def add_known(self, wrenches: Wrenches, state: State, forces: Mapping[str, Array]) -> None:
        """Its couples where the pin forces (name: (n, 2), N) are known already."""
        for pin, mu, r in self.pins:
            load = np.hypot(*np.asarray(forces[PIN_FORCE[pin]]).T)
            _add_couple(wrenches, pin, -sense(state, pin, self.side) * (mu * r * load))

    def power(self, state: State) -> Array | float:
        """Raises LimitError: the work depends on the pin forces."""
        raise LimitError(NO_POWER)

    def engine_term(self, tree: Tree) -> Act:
        """Couples of mu r times the load that the engine found at the pin in its last pass, against the spin."""

        def act() -> None:
            for pin, mu, r in self.pins:
                one, other = PINS[pin]
                slip = tree.velocity(one) - tree.velocity(other)
                if slip != 0.0:
                    couple = math.copysign(mu * r * tree.pin_load(pin), slip)
                    tree.twist(other, couple)
                    tree.twist(one, -couple)

        return act

    def add_mjcf(self, model: Any) -> None:
        """Raises LimitError: there is none."""
        raise LimitError(NO_MJCF)

    def size(self, linkage: FourBar, solution: Solution) -> Array:
        """The couples, divided by the shortest moving bar, N."""
        total = np.zeros(len(solution))
        for pin, mu, r in self.pins:
            total += mu * r * np.nan_to_num(np.hypot(*getattr(solution, PIN_FORCE[pin]).T)) / shortest_bar(linkage)
        return total


def _add_couple(wrenches: Wrenches, pin: str, couple: Any) -> None:
    i, j = PINS[pin]
    wrenches.add_moment(j, couple)
    wrenches.add_moment(i, -couple)


def _double(value: Any) -> Array:
    """A number of 32 digits as the nearest double; a double as it is."""
    return np.asarray(getattr(value, "hi", value))


def _doubles(vector: Any) -> Array:
    """Components as one array, (n, 2)."""
    return np.stack(np.broadcast_arrays(*(_double(component) for component in vector)), axis=-1)


def _checked(pins: Mapping[str, tuple[float, float]]) -> tuple[tuple[str, float, float], ...]:
    for pin, values in pins.items():
        known(f"effects.pin_friction.{pin}", pin, values)
    if not pins:
        raise InputError("effects.pin_friction", {}, "must name at least one pin")
    rows = []
    for pin in (name for name in PINS if name in pins):
        key, (mu, radius) = f"effects.pin_friction.{pin}", pins[pin]
        coefficient = require(f"{key}.coefficient", mu, at_least_zero=True)
        rows.append((pin, coefficient, require(f"{key}.radius", radius, at_least_zero=True)))
    return tuple(rows)
