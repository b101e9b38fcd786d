"""Linear springs, each between two points of two bars, the ground included."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fourbar.effects.effect import Actions, Effect
from fourbar.effects.place import STATED_PLACES, Place, change_each, require_ends
from fourbar.errors import InputError, expect, write_in_units
from fourbar.formulas.arithmetic import is_any, select
from fourbar.formulas.motion import State
from fourbar.linkage import (
    AT_LEAST_ZERO,
    POSITIVE,
    Declared,
    FourBar,
    check_numbers,
    copy_with,
    require,
)
from fourbar.quantities import NO_DIRECTION, OK

COINCIDENT_POINTS = 16.0 * 2.0**-52
"""Part of the paths from O2, bar by bar, below which two points count as one. There is
no direction between them.
"""
STROKE_FIELD = Declared("m", POSITIVE)
"""By how much a gas spring can be shortened."""
GAS = {
    "extended": Declared("m", POSITIVE),
    "stroke": STROKE_FIELD,
    **dict.fromkeys(
        ("extended_force", "compressed_force"),
        Declared("N", AT_LEAST_ZERO),
    ),
}
"""Numbers of a gas spring, which becomes one of the springs."""


@dataclass(frozen=True, slots=True)
class Spring:
    """A spring that pulls its two points together.

    The pull is preload + stiffness (distance - length), N. Where that is negative it
    pushes them apart: a compression spring is shorter than `length`, a gas spring has a
    negative preload. With stiffness 0 the force is constant.

    Parameters
    ----------
    start, end : points on two different bars.
    stiffness : N/m, >= 0.
    length : distance at which it pulls with the preload alone, m, >= 0.
    preload : N, > 0 pulls, < 0 pushes.
    stroke : by which a gas spring can be shorter than `length`, m; None: not stated.
        It changes no force, so that it does not count where springs are compared.
    """

    start: Place
    end: Place
    stiffness: float
    length: float = 0.0
    preload: float = 0.0
    stroke: float | None = field(default=None, compare=False, repr=False)
    numbers: ClassVar[dict[str, Declared]] = {
        "stiffness": Declared("N/m", AT_LEAST_ZERO),
        "length": Declared("m", AT_LEAST_ZERO),
        "preload": Declared("N", left_out=0.0),
    }

    def __post_init__(self) -> None:
        for name, point in zip(
            ("start", "end"),
            require_ends("effects.springs", self.start, self.end),
            strict=True,
        ):
            object.__setattr__(self, name, point)
        check_numbers(self, "effects.springs")
        if self.stroke is not None:
            key = "effects.springs.stroke"
            stroke = require(key, self.stroke, *STROKE_FIELD[:2])
            if stroke >= self.length:
                longest = write_in_units("m", self.length)
                allowed = f"must be less than the length, {longest}"
                raise InputError(key, stroke, allowed, unit="m")
            object.__setattr__(self, "stroke", stroke)

    @classmethod
    def gas(
        cls,
        start: Place,
        end: Place,
        extended: float,
        stroke: float,
        extended_force: float,
        compressed_force: float | None = None,
    ) -> "Spring":
        """Make a gas spring, which pushes its two points apart.

        The force grows evenly over the stroke. It has no end stops: beyond the stroke
        the force goes on along the same line.

        Parameters
        ----------
        extended : distance of its ends at no stroke, m.
        stroke : by which it can be shortened, m, less than `extended`.
        extended_force : at no stroke, N, >= 0.
        compressed_force : at full stroke, N, no less; left out: the same.
        """
        key = "effects.springs.gas"
        last = extended_force if compressed_force is None else compressed_force
        pairs = zip(GAS.items(), (extended, stroke, extended_force, last), strict=True)
        extended, stroke, first, last = (
            require(f"{key}.{name}", value, *declared[:2])
            for (name, declared), value in pairs
        )
        if stroke >= extended:
            raise InputError(
                f"{key}.stroke",
                stroke,
                "must be less than the extended length,"
                f" {write_in_units('m', extended)}",
                unit="m",
            )
        if last < first:
            raise InputError(
                f"{key}.compressed_force",
                last,
                "must be no less than the extended_force,"
                f" {write_in_units('N', first)}",
                unit="N",
            )
        return cls(start, end, (last - first) / stroke, extended, -first, stroke)

    def with_places(self, change: Callable[[Place], Place]) -> "Spring":
        """Return the same spring with its ends changed."""
        return copy_with(self, start=change(self.start), end=change(self.end))

    @property
    def slack(self) -> float:
        """Return tension less stiffness times distance, N.

        0: the force is proportional to the distance vector.
        """
        return self.preload - self.stiffness * self.length

    def pull(self, distance: Any) -> Any:
        """Compute the force with which it pulls at a distance of its ends, N."""
        return self.preload + self.stiffness * (distance - self.length)

    def greatest_tension(self, linkage: FourBar) -> float:
        """Return a bound of the tension, N.

        The points stay within the linkage and the arms to them.
        """
        reach = sum(linkage.lengths) + abs(self.start.distance) + abs(self.end.distance)
        return float(abs(self.preload) + self.stiffness * (reach + self.length))


@dataclass(frozen=True, slots=True)
class Springs(Effect):
    """Linear springs.

    Where the two points of a spring coincide its pull has no direction: status
    "no_direction". A spring that pulls with stiffness times distance alone pulls with 0
    there; its preload is stiffness times length.
    """

    springs: tuple[Spring, ...]
    key: ClassVar[str] = "springs"
    in_balls: ClassVar[bool] = True
    example: ClassVar[str] = (
        'springs = [{ from = { bar = 1, from_pin = ["10 cm", "-90 deg"] }, '
        'to = { bar = 4, from_pin = ["8 cm", "0 deg"] }, '
        'stiffness = "200 N/m", length = "12 cm", preload = "3 N" }]'
    )
    numbers: ClassVar[dict[str, Declared]] = {**Spring.numbers, **STATED_PLACES}

    def __post_init__(self) -> None:
        expect("effects.springs", self.springs, tuple, list)
        for spring in self.springs:
            expect("effects.springs", spring, Spring)
        object.__setattr__(self, "springs", tuple(self.springs))

    def with_places(self, change: Callable[[Place], Place]) -> "Springs":
        """Return the same springs with their ends changed."""
        springs = change_each(self.springs, change)
        return copy_with(self, springs=springs)

    def act(self, actions: Actions, state: State) -> None:
        """Add the tension at `start` towards `end`, and its opposite at `end`."""
        for spring in self.springs:
            across = spring.end.locate(state) - spring.start.locate(state)
            by_distance = spring.stiffness
            if is_any(spring.slack != 0.0):
                # NaN at a distance of 0, where the status says so
                by_distance = by_distance + spring.slack / np.abs(across)
            actions.pull(spring.start, spring.end, by_distance * across)

    def status(
        self,
        state: State,
        branch: NDArray[np.int8] | None,
    ) -> NDArray[np.uint8] | None:
        """Return NO_DIRECTION where the two points of a spring with slack coincide."""
        codes = None
        for spring in self.springs:
            if not is_any(spring.slack != 0.0):
                continue
            across = spring.end.locate(state) - spring.start.locate(state)
            away = (
                sum(state.lengths[:4])
                + abs(spring.start.distance)
                + abs(spring.end.distance)
            )
            coincide = np.abs(across) <= COINCIDENT_POINTS * away
            here = coincide & (spring.slack != 0.0)
            codes = select(here, NO_DIRECTION, OK if codes is None else codes)
        return codes

    def add_to_mjcf(self, model: Any) -> None:
        """Add spatial tendons."""
        model.springs.extend(self.springs)

    def couple_on_drive(self, linkage: FourBar, speed: float) -> float:
        """Sum the greatest tensions, at the longest arm."""
        tensions = (spring.greatest_tension(linkage) for spring in self.springs)
        return sum(tensions) * max(linkage.lengths)
