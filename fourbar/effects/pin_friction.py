"""Coulomb friction in the pins: a couple mu r |F| against the rotation, with F the pin force it helps to make."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fourbar.effects.actions import Actions
from fourbar.effects.cones import NONE, ONE, solve_sliding
from fourbar.effects.effect import PinRows, SolvedFriction
from fourbar.errors import InputError
from fourbar.formulas.arithmetic import is_any, make_like
from fourbar.formulas.longer import shorten
from fourbar.formulas.pin_forces import PinForces
from fourbar.linkage import AT_LEAST_ZERO, PIN_FORCE, Declared
from fourbar.quantities import JAMMED, OK, SEVERAL, Array


@dataclass(frozen=True, slots=True)
class PinFriction(PinRows):
    """Pins as (pin, coefficient of friction mu, pin radius r in m): couple mu r |F| where the pin turns.

    At a pin that does not turn the couple may have any value up to that; 0, the middle, is taken, and
    `torque_low`, `torque_high` of the solution are the torques at which the motion would begin.
    Where no couples fulfil the equations the status is "jammed", where several do it is "several".
    """

    pins: tuple[tuple[str, float, float], ...]
    key: ClassVar[str] = "pin_friction"
    example: ClassVar[str] = 'pin_friction = { A = { coefficient = 0.1, radius = "8 mm" } }'
    numbers: ClassVar[dict[str, Declared]] = {
        "coefficient": Declared("1", AT_LEAST_ZERO),
        "radius": Declared("m", AT_LEAST_ZERO),
    }
    dry: ClassVar[bool] = True

    def __post_init__(self) -> None:
        PinRows.__post_init__(self)
        if not self.pins:
            raise InputError("effects.pin_friction", {}, "must name at least one pin")

    @property
    def loaded_pins(self) -> tuple[str, ...]:
        """The pins whose forces it depends on."""
        return tuple(pin for pin, mu, r in self.pins if is_any(mu * r != 0.0))

    @property
    def dry_pins(self) -> tuple[str, ...]:
        """The pins at which it acts."""
        return self.loaded_pins

    def per_unit(self, actions: Actions, eliminate: Callable[..., PinForces]) -> dict[str, PinForces]:
        """Compute the pin forces that a couple of 1 N m makes at each pin, against its rotation."""
        forces = {}
        for pin in self.loaded_pins:
            single = Actions(actions.state, actions.bodies)
            single.couple(pin, -actions.sense(pin))
            forces[pin] = eliminate(single, with_inertia=False)
        return forces

    def solve_friction(self, actions: Actions, pins: PinForces, eliminate: Callable[..., PinForces]) -> SolvedFriction:
        """Add the couples that fulfil x_p = mu_p r_p |F_p(x)|, F_p = F0_p + sum over q of C_pq x_q."""
        names, arms = self.loaded_pins, {pin: mu * r for pin, mu, r in self.pins}
        senses, per_unit = {pin: actions.sense(pin) for pin in names}, self.per_unit(actions, eliminate)
        shape = np.shape(pins.F12)

        def column(force: Any) -> Any:
            """Components of a force over all positions, (n, 2)."""
            flat = np.broadcast_to(_make_plain(force), shape).ravel()
            return np.stack([flat.real, flat.imag], axis=-1)

        k = np.stack([np.broadcast_to(_make_plain(arms[pin]), shape).ravel() for pin in names], axis=1)
        F = np.stack([column(getattr(pins, PIN_FORCE[pin])) for pin in names], axis=1)
        C = np.stack(
            [np.stack([column(getattr(per_unit[q], PIN_FORCE[pin])) for q in names], axis=1) for pin in names], axis=1
        )
        found = solve_sliding(F, C, k)
        couples = {pin: make_like(found.x[:, p].reshape(shape), pins.F12.real) for p, pin in enumerate(names)}
        if _make_plain(pins.F12) is not pins.F12:
            couples = self._refine(couples, pins, per_unit)
        for pin, couple in couples.items():
            actions.couple(pin, -senses[pin] * couple)
        done = eliminate(actions)
        left = [
            np.abs(_make_plain(couple - arms[pin] * np.abs(getattr(done, PIN_FORCE[pin]))))
            for pin, couple in couples.items()
        ]
        status = np.where(found.number == ONE, OK, np.where(found.number == NONE, JAMMED, SEVERAL)).astype(np.uint8)
        return SolvedFriction(done, found.from_jamming.reshape(shape), np.max(left, axis=0), status.reshape(shape))

    def _refine(self, couples: dict[str, Any], pins: PinForces, per_unit: dict[str, PinForces]) -> dict[str, Any]:
        """Take Newton's steps from couples in doubles, in the numbers of the forces: longer ones or with derivatives.

        (1 - J) dx = mu r |F + C x| - x, J the slope of the right-hand side by x: of numbers that carry their
        derivatives the same steps are the theorem of the implicit function.
        """
        names, arms = list(couples), {pin: mu * r for pin, mu, r in self.pins}
        for _ in range(2):
            gaps, slopes = [], []
            for pin in names:
                by, force = [getattr(per_unit[q], PIN_FORCE[pin]) for q in names], getattr(pins, PIN_FORCE[pin])
                for c, couple in zip(by, couples.values(), strict=True):
                    force = force + c * couple
                gaps.append(arms[pin] * np.abs(force) - couples[pin])
                along = _make_plain(force) / np.abs(_make_plain(force))
                pulls = [_make_plain(arms[pin]) * (along.conjugate() * _make_plain(c)).real for c in by]
                slopes.append(np.broadcast_arrays(*pulls, along.real)[:-1])
            matrix = np.eye(len(names)) - np.moveaxis(np.array(slopes), (0, 1), (-2, -1))
            usable = np.asarray(np.isfinite(matrix).all(axis=(-2, -1)))
            usable[usable] = np.linalg.det(matrix[usable]) != 0.0
            inverse = np.zeros_like(matrix)
            inverse[usable] = np.linalg.inv(matrix[usable])
            for row, pin in enumerate(names):
                for column, gap in enumerate(gaps):
                    couples[pin] = couples[pin] + inverse[..., row, column] * gap
        return couples

    def act_known(self, actions: Actions, forces: Mapping[str, Array]) -> None:
        """Its couples where the pin forces (name: (n, 2), N) are known already."""
        for pin, mu, r in self.pins:
            load = np.hypot(*np.asarray(forces[PIN_FORCE[pin]]).T)
            actions.couple(pin, -actions.sense(pin) * (mu * r * load))


def _make_plain(number: Any) -> Any:
    """Return the double, or the array of them, of a longer number or of one that carries its derivatives."""
    return shorten(getattr(number, "values", number))
