"""Linear springs, each between two points of two bars, the ground included."""

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fourbar.effects.effect import Actions, Effect
from fourbar.errors import InputError, expect
from fourbar.formulas.arithmetic import (
    dot,
    is_any,
    polar,
    select,
    sine_of,
    vector,
)
from fourbar.formulas.motion import State
from fourbar.linkage import (
    AT_LEAST_ZERO,
    BAR_NAMES,
    POSITIVE,
    SECOND_PIN,
    Declared,
    FourBar,
    check_numbers,
    require,
    require_pair,
    require_whole,
)
from fourbar.quantities import NO_DIRECTION, OK

COINCIDE = 16.0 * 2.0**-52
"""Two points nearer than this part of their paths from O2, bar by bar, have no direction between them."""


END_POSITION = Declared("m", left_out=(0.0, 0.0), pair=True)
"""Declaration of the position of an end on its bar."""
GAS = {
    **dict.fromkeys(("extended", "stroke"), Declared("m", POSITIVE)),
    **dict.fromkeys(
        ("extended_force", "compressed_force"), Declared("N", AT_LEAST_ZERO)
    ),
}
"""Numbers of a gas spring, which becomes one of the springs."""


class SpringEnd(NamedTuple):
    """A point of a bar.

    Parameters
    ----------
    bar : 1 (the ground), 2, 3 or 4.
    distance, angle : from the bar's first pin (O2, O2, A, O4), m, the angle from its line, rad.
    """

    bar: int
    distance: float
    angle: float

    @property
    def in_bar(self) -> Any:
        """Return the vector in the bar's frame, along + i across its line, m; an array, so products round alike."""
        point = polar(self.distance, self.angle)
        return np.asarray(point) if isinstance(point, complex) else point

    def from_pin(self, pin: str, state: State) -> tuple[Any, Any]:
        """Return the vector from one of the bar's pins in the bar's frame, complex, m, and the square of its length."""
        arm = self.in_bar
        if pin != SECOND_PIN[self.bar]:
            return arm, self.distance * self.distance
        half = sine_of(
            0.5 * self.angle
        )  # r cos phi - L near the pin, where the cosine rounds to 1
        arm = vector(
            (self.distance - state.lengths[self.bar - 1])
            - 2.0 * self.distance * half * half,
            arm.imag,
        )
        return arm, dot(arm, arm)

    def place(self, state: State) -> Any:
        """Return the position of the end, complex, m."""
        return state.foot(self.bar) + self.in_bar * state.direction(self.bar)


def require_ends(key: str, start: object, end: object) -> tuple[SpringEnd, SpringEnd]:
    """Return the ends of a line between two bars, checked; InputError for what is none."""
    ends = []
    for name, point in (("from", start), ("to", end)):
        if not isinstance(point, SpringEnd):
            raise InputError(f"{key}.{name}", point, "must be a fourbar.SpringEnd")
        bar = require_whole(
            f"{key}.{name}.bar", point.bar, BAR_NAMES, "must be 1, 2, 3 or 4"
        )
        ends.append(
            SpringEnd(
                bar, *require_pair(f"{key}.{name}.at", point[1:], END_POSITION.unit)
            )
        )
    if ends[0].bar == ends[1].bar:
        raise InputError(
            f"{key}.to.bar", ends[1].bar, "must be another bar than that of `from`"
        )
    return ends[0], ends[1]


@dataclass(frozen=True, slots=True)
class Spring:
    """A spring that pulls its two points together with preload + stiffness (distance - length), N.

    Where that is negative it pushes them apart: a compression spring is shorter than `length`, a gas spring has a
    negative preload. With stiffness 0 the force is constant.

    Parameters
    ----------
    start, end : points on two different bars.
    stiffness : N/m, >= 0.
    length : distance at which it pulls with the preload alone, m, >= 0.
    preload : N, > 0 pulls, < 0 pushes.
    """

    start: SpringEnd
    end: SpringEnd
    stiffness: float
    length: float = 0.0
    preload: float = 0.0
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

    @classmethod
    def gas(
        cls,
        start: SpringEnd,
        end: SpringEnd,
        extended: float,
        stroke: float,
        extended_force: float,
        compressed_force: float | None = None,
    ) -> "Spring":
        """Make a gas spring, which pushes its two points apart with a force that grows evenly over the stroke.

        It has no end stops: beyond the stroke the force goes on along the same line.

        Parameters
        ----------
        extended : distance of its ends at no stroke, m.
        stroke : by which it can be shortened, m, less than `extended`.
        extended_force : at no stroke, N, >= 0.
        compressed_force : at full stroke, N, no less; left out: the same.
        """
        key, last = (
            "effects.springs.gas",
            extended_force if compressed_force is None else compressed_force,
        )
        pairs = zip(GAS.items(), (extended, stroke, extended_force, last), strict=True)
        extended, stroke, first, last = (
            require(f"{key}.{name}", value, *declared[:2])
            for (name, declared), value in pairs
        )
        if stroke >= extended:
            raise InputError(
                f"{key}.stroke",
                stroke,
                f"must be less than the extended length, {extended:.6g} m",
            )
        if last < first:
            raise InputError(
                f"{key}.compressed_force",
                last,
                f"must be no less than the extended_force, {first:.6g} N",
            )
        return cls(start, end, (last - first) / stroke, extended, -first)

    @property
    def slack(self) -> float:
        """Tension less stiffness times distance, N; 0: the force is proportional to the distance vector."""
        return self.preload - self.stiffness * self.length

    def greatest_tension(self, linkage: FourBar) -> float:
        """Return a bound of the tension, N: the points stay within the linkage and their own arms."""
        reach = sum(linkage.lengths) + abs(self.start.distance) + abs(self.end.distance)
        return abs(self.preload) + self.stiffness * (reach + self.length)


@dataclass(frozen=True, slots=True)
class Springs(Effect):
    """Linear springs.

    Where the two points of a spring coincide its pull has no direction: status "no_direction". One that pulls
    with stiffness times distance alone (preload = stiffness length) pulls with 0 there.
    """

    springs: tuple[Spring, ...]
    key: ClassVar[str] = "springs"
    in_balls: ClassVar[bool] = True
    example: ClassVar[str] = (
        'springs = [{ from = { bar = 1, at = ["10 cm", "-90 deg"] }, to = { bar = 4, at = ["8 cm", "0 deg"] }, '
        'stiffness = "200 N/m", length = "12 cm", preload = "3 N" }]'
    )
    numbers: ClassVar[dict[str, Declared]] = {**Spring.numbers, "at": END_POSITION}

    def __post_init__(self) -> None:
        expect("effects.springs", self.springs, tuple, list)
        for spring in self.springs:
            expect("effects.springs", spring, Spring)
        object.__setattr__(self, "springs", tuple(self.springs))

    def act(self, actions: Actions, state: State) -> None:
        """Add the tension at `start` along the unit vector to `end`, and its opposite at `end`."""
        for spring in self.springs:
            across = spring.end.place(state) - spring.start.place(state)
            by_distance = spring.stiffness
            if is_any(spring.slack != 0.0):
                # NaN at a distance of 0, where the status says so
                by_distance = by_distance + spring.slack / np.abs(across)
            actions.pull(spring.start, spring.end, by_distance * across)

    def status(
        self, state: State, branch: NDArray[np.int8] | None
    ) -> NDArray[np.uint8] | None:
        """Return NO_DIRECTION where the two points of a spring with slack coincide."""
        codes = None
        for spring in self.springs:
            if not is_any(spring.slack != 0.0):
                continue
            across = spring.end.place(state) - spring.start.place(state)
            away = (
                sum(state.lengths[:4])
                + abs(spring.start.distance)
                + abs(spring.end.distance)
            )
            coincide = np.abs(across) <= COINCIDE * away
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
