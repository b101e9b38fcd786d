"""Linear springs, each between two points of two bars, the ground included."""

from dataclasses import field
from typing import Annotated, Any, ClassVar

import numpy as np

from fourbar.effects.effect import Actions, Effect
from fourbar.effects.place import COINCIDENT_POINTS, At, Line, Place
from fourbar.errors import InputError, write_in_units
from fourbar.formulas.arithmetic import Number, is_any, select
from fourbar.formulas.motion import State
from fourbar.linkage import (
    AT_LEAST_ZERO,
    POSITIVE,
    Declared,
    Entries,
    FourBar,
    OneOf,
    record,
)
from fourbar.quantities import NO_DIRECTION, OK, Codes, Signs

GAS = {
    "extended": Declared("m", POSITIVE),
    "stroke": Declared("m", POSITIVE),
    "extended_force": Declared("N", AT_LEAST_ZERO),
    "compressed_force": Declared("N", AT_LEAST_ZERO, None),
}
"""Numbers of a gas spring, which becomes one of the springs."""
SENSES = ("push", "pull")
"""Senses in which a spring that acts one way may act."""


@record
class Spring(Line):
    """A spring that pulls its two points together.

    The pull is preload + stiffness (distance - length), N. Where that is negative it
    pushes them apart: a compression spring is shorter than `length`, a gas spring has a
    negative preload. With stiffness 0 the force is constant. A spring that acts one way
    comes off where its force would change its sign, and the force is 0 beyond.

    Parameters
    ----------
    start, end : points on two different bars.
    stiffness : N/m, >= 0.
    length : distance at which it pulls with the preload alone, m, >= 0.
    preload : N, > 0 pulls, < 0 pushes.
    stroke : by which a gas spring can be shorter than `length`, m; None: not stated.
        It changes no force, so that it does not count where springs are compared.
    acts : "push" or "pull", the one way in which it acts; None: both.
    """

    start: Annotated[Place, At("from")]
    end: Annotated[Place, At("to")]
    stiffness: Annotated[float, Declared("N/m", AT_LEAST_ZERO)]
    length: Annotated[float, Declared("m", AT_LEAST_ZERO, always=True)] = 0.0
    preload: Annotated[float, Declared("N")] = 0.0
    stroke: Annotated[float | None, Declared("m", POSITIVE)] = field(
        default=None, compare=False, repr=False
    )
    acts: Annotated[str | None, OneOf(SENSES)] = None
    stated_at = "effects.springs"
    forms: ClassVar[dict[str, dict[str, Declared]]] = {"gas": GAS}

    def __post_init__(self) -> None:
        Line.__post_init__(self)
        if self.stroke is not None and self.stroke >= self.length:
            longest = write_in_units("m", self.length)
            allowed = f"must be less than the length, {longest}"
            key = "effects.springs.stroke"
            raise InputError(key, self.stroke, allowed, unit="m")
        if self.acts is not None:
            self._require_one_way()

    def _require_one_way(self) -> None:
        """Raise InputError unless the force changes its sign at some length."""
        key = "effects.springs.acts"
        if self.stiffness == 0.0:
            allowed = "leave it out: the force is constant, and comes off at no length"
            raise InputError(key, self.acts, allowed)
        if self.slack >= 0.0:
            most = write_in_units("N", self.stiffness * self.length)
            allowed = (
                "leave it out, or state a preload below stiffness times length,"
                f" {most}: the spring pulls at every length"
            )
            raise InputError(key, self.acts, allowed)

    @classmethod
    def gas(
        cls,
        start: Place,
        end: Place,
        extended: float,
        stroke: float,
        extended_force: float,
        compressed_force: float | None = None,
        acts: str | None = None,
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
        acts : as of any spring.
        """
        key = "effects.springs.gas"
        last = extended_force if compressed_force is None else compressed_force
        pairs = zip(GAS.items(), (extended, stroke, extended_force, last), strict=True)
        extended, stroke, first, last = (
            declared.check(f"{key}.{name}", value) for (name, declared), value in pairs
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
        stiffness = (last - first) / stroke
        return cls(start, end, stiffness, extended, -first, stroke, acts)

    @property
    def slack(self) -> float:
        """Return tension less stiffness times distance, N.

        0: the force is proportional to the distance vector.
        """
        return self.preload - self.stiffness * self.length

    def pull(self, distance: Any) -> Any:
        """Compute the pull of the spring at a distance of its ends, N."""
        tension = self.preload + self.stiffness * (distance - self.length)
        if self.acts == "push":
            return np.minimum(tension, 0.0)
        return np.maximum(tension, 0.0) if self.acts == "pull" else tension

    def beyond_free_length(self, state: State) -> Any:
        """Return the distance of the ends less that at which the force is 0, m."""
        return np.abs(self.across(state)) + self.slack / self.stiffness


@record
class Springs(Effect):
    """Linear springs.

    Where the two points of a spring coincide its pull has no direction: status
    "no_direction". A spring that pulls with stiffness times distance alone pulls with 0
    there; its preload is stiffness times length. So does one that only pulls.
    """

    springs: Annotated[tuple[Spring, ...], Entries(Spring, is_value=True)]
    key = "springs"
    in_balls = True
    example = (
        'springs = [{ from = { bar = 1, from_pin = ["10 cm", "-90 deg"] }, '
        'to = { bar = 4, from_pin = ["8 cm", "0 deg"] }, '
        'stiffness = "200 N/m", length = "12 cm", preload = "3 N" }]'
    )

    def act(self, actions: Actions, state: State) -> None:
        """Add the tension at `start` towards `end`, and its opposite at `end`."""
        for spring in self.springs:
            across = spring.across(state)
            by_distance = spring.stiffness
            if is_any(spring.slack != 0.0):
                # NaN at a distance of 0, where the status says so
                by_distance = by_distance + spring.slack / np.abs(across)
            if spring.acts == "push":
                by_distance = select(by_distance < 0.0, by_distance, 0.0 * by_distance)
            elif spring.acts == "pull":
                by_distance = select(by_distance > 0.0, by_distance, 0.0)
            actions.pull(spring.start, spring.end, by_distance * across)

    def comes_off(self, state: State) -> Any:
        """Mark where a spring that acts one way just comes off; slopes jump there."""
        marks: Any = False
        for spring in self.springs:
            if spring.acts is not None:
                near = COINCIDENT_POINTS * spring.reach(state)
                marks = marks | (np.abs(spring.beyond_free_length(state)) <= near)
        return marks

    def breaks(self, state: State) -> dict[str, Number]:
        """Return the length of each spring that acts one way, less where it is off."""
        return {
            f"spring {number}": spring.beyond_free_length(state)
            for number, spring in enumerate(self.springs, 1)
            if spring.acts is not None
        }

    def status(
        self,
        state: State,
        branch: Signs | None,
    ) -> Codes | None:
        """Return NO_DIRECTION where the two points of a spring with slack coincide."""
        codes = None
        for spring in self.springs:
            is_off = spring.acts == "pull" and not is_any(spring.slack > 0.0)
            if is_off or not is_any(spring.slack != 0.0):
                continue
            near = COINCIDENT_POINTS * spring.reach(state)
            coincide = np.abs(spring.across(state)) <= near
            here = coincide & (spring.slack != 0.0)
            codes = select(here, NO_DIRECTION, OK if codes is None else codes)
        return codes

    def add_to_mjcf(self, model: Any) -> None:
        """Add spatial tendons."""
        model.springs.extend(self.springs)

    def couple_on_drive(self, linkage: FourBar, speed: float) -> float:
        """Sum bounds of the tensions, at the longest arm.

        The points stay within the linkage and the arms to them.
        """
        total = 0.0
        for spring in self.springs:
            arms = abs(spring.start.distance) + abs(spring.end.distance)
            reach = sum(linkage.lengths) + arms + spring.length
            total += abs(spring.preload) + spring.stiffness * reach
        return float(total * max(linkage.lengths))
