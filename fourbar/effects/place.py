"""Places of bars: from the first pin, from the mass centre, or at a named point."""

from collections.abc import Callable, Iterable, Mapping
from typing import Annotated, Any, NamedTuple, Self

import numpy as np

from fourbar.errors import InputError
from fourbar.formulas.arithmetic import (
    angle,
    dot,
    polar,
    sine_of,
    vector,
)
from fourbar.formulas.motion import State
from fourbar.linkage import (
    MOVING_BARS,
    SECOND_PIN,
    Declared,
    Described,
    Entries,
    FourBar,
    OfBar,
    Text,
    copy_with,
    list_declared,
    list_fields,
)

STATED_PAIR = Declared("m", left_out=None, pair="rad")
StatedPair = Annotated[tuple[float, float] | None, STATED_PAIR]
STATED_PLACES = {"from_pin": STATED_PAIR, "from_centre": STATED_PAIR}
"""Forms in which numbers state a place that turns with its bar; `point` is a name."""
ALL_BARS = (1, *MOVING_BARS)
COINCIDENT_POINTS = 16.0 * 2.0**-52
"""Part of the paths from O2, bar by bar, below which two points count as one. There is
no direction between them.
"""
AT_FIRST_PIN = (0.0, 0.0)
"""Place of the bar's first pin, m and rad."""


class Place(NamedTuple):
    """A place of a bar, which turns with it; one of `from_pin`, `from_centre`, `point`.

    Parameters
    ----------
    bar : 1 (the ground), 2, 3 or 4.
    from_pin : (distance, angle) from the bar's first pin (O2, O2, A, O4), m, the angle
        from the bar's line, rad.
    from_centre : likewise from the bar's mass centre G.
    point : name of one of the scene's points on this bar.
    """

    bar: int
    from_pin: tuple[float, float] | None = None
    from_centre: tuple[float, float] | None = None
    point: str | None = None

    @property
    def numbers(self) -> dict[str, Declared]:
        """Declarations of the forms in which numbers state a place."""
        return STATED_PLACES

    @property
    def place(self) -> "Place":
        """The place itself, as that of what stands at a place."""
        return self

    def with_places(self, change: Callable[["Place"], "Place"]) -> "Place":
        """Return the changed place."""
        return change(self)

    def settle(self, linkage: FourBar, points: Mapping[str, "Place"]) -> "Place":
        """Return the same place from the bar's first pin, by numbers that are stated.

        A place from G becomes the sum of both: `from_pin` is that of G, `from_centre`
        stays. Nothing is rounded, and numbers may be arrays of any kind.

        `points`: places of the scene's points by name.
        """
        if self.point is not None:
            return points[self.point].settle(linkage, points)
        if self.from_centre is None or self.from_pin is not None:
            return self
        return self._replace(from_pin=linkage.bar(self.bar).mass_centre)

    def vector(self) -> Any:
        """Compute the vector to a settled place, complex, m, in the bar's frame.

        The vector starts at the bar's first pin.
        """
        assert self.from_pin is not None
        z = polar(*self.from_pin)
        if self.from_centre is None:
            return z
        return z + polar(*self.from_centre)

    def polar_from_pin(self) -> tuple[Any, Any]:
        """Return distance (m) and angle (rad) of a settled place from the first pin."""
        assert self.from_pin is not None
        if self.from_centre is None:
            return self.from_pin
        if type(self.from_centre[0]) is float and self.from_centre[0] == 0.0:
            return self.from_pin
        z = self.vector()
        return (abs(z) if type(z) is complex else np.abs(z)), angle(z)

    @property
    def distance(self) -> Any:
        """Distance of a settled place from the bar's first pin, m."""
        return self.polar_from_pin()[0]

    @property
    def angle(self) -> Any:
        """Angle of a settled place from the bar's line, rad."""
        return self.polar_from_pin()[1]

    @property
    def in_bar(self) -> Any:
        """Vector from the first pin in the bar's frame, along + i across its line, m.

        An array is returned even for one place, so that products round alike.
        """
        z = self.vector()
        if isinstance(z, complex):
            return np.asarray(z)
        return z

    def arm_from(self, pin: str, state: State) -> tuple[Any, Any]:
        """Return the vector from a pin, and the square of its length, m^2.

        The vector is complex, m, in the bar's frame.
        """
        arm = self.in_bar
        at_second = pin == SECOND_PIN[self.bar]
        length = state.lengths[self.bar - 1]
        if self.from_centre is not None:
            if at_second:
                arm = arm - length
            return arm, dot(arm, arm)
        if not at_second:
            return arm, self.distance * self.distance
        assert self.from_pin is not None
        distance, turned = self.from_pin
        # r cos phi - L, which keeps its digits near the pin: the cosine rounds to 1
        sine = sine_of(0.5 * turned)
        along = (distance - length) - 2.0 * distance * sine * sine
        arm = vector(along, arm.imag)
        return arm, dot(arm, arm)

    def locate(self, state: State) -> Any:
        """Return the position of the place, complex, m."""
        return state.foot(self.bar) + self.in_bar * state.direction(self.bar)


def settler(linkage: FourBar, points: Iterable[Any]) -> Callable[[Place], Place]:
    """Return the function that settles a place of a scene, as `Place.settle` does.

    `points`: the scene's, each with its name and place.
    """
    places = {point.name: point.place for point in points}
    return lambda place: place.settle(linkage, places)


def require_place(key: str, place: object, bars: tuple[int, ...] = ALL_BARS) -> Place:
    """Return a place of one of some bars, checked; InputError for what is none."""
    if not isinstance(place, Place):
        raise InputError(key, place, "must be a fourbar.Place")
    bar = OfBar(bars).check(f"{key}.bar", place.bar)
    forms = {
        name: value for name, value in place._asdict().items() if value is not None
    }
    del forms["bar"]
    if len(forms) != 1:
        raise InputError(
            key,
            ", ".join(forms) or None,
            "must be a pair from_pin or from_centre, or a point",
        )
    ((name, form),) = forms.items()
    if name == "from_centre" and bar == 1:
        allowed = "the ground has no mass centre: state from_pin"
        raise InputError(f"{key}.from_centre", bar, allowed)
    by: Any = STATED_PLACES.get(name, Text())
    return Place(bar, **{name: by.check(f"{key}.{name}", form)})


class At(NamedTuple):
    """Declaration of a place: its key, and the bars on which it may be."""

    key: str = ""
    bars: tuple[int, ...] = ALL_BARS
    is_value: bool = False
    """True if the place is stated in the description's own table."""

    def check(self, key: str, value: Any) -> Place:
        """Return the place; InputError for what is none."""
        return require_place(key, value, self.bars)


def states_place(kind: Any) -> bool:
    """Return True if fields of a class are the forms of its place."""
    return "from_pin" in list_fields(kind)


class Placed(Described):
    """Base class of descriptions whose places follow from their declared fields."""

    __slots__ = ()

    def with_places(self, change: Callable[[Place], Place]) -> Self:
        """Return the description with each place changed, itself where none is."""
        changed: dict[str, Any] = {}
        description: Any = self
        kind: Any = type(self)
        if states_place(kind) and (place := description.place) is not None:
            forms = change(place)._asdict().items()
            names = list_fields(kind)
            changed |= {name: form for name, form in forms if name in names}
        for field in list_declared(kind):
            value = getattr(self, field.name)
            if isinstance(field.by, At):
                changed[field.name] = change(value)
            elif isinstance(field.by, Entries):
                changed[field.name] = change_each(value, change)
        return copy_with(self, **changed)


class Line(Placed):
    """Base class of lines between two places, `start` and `end`, of different bars."""

    __slots__ = ()

    def __post_init__(self: Any) -> None:
        Placed.__post_init__(self)
        if self.start.bar == self.end.bar:
            raise InputError(
                f"{self.stated_at}.to.bar",
                self.end.bar,
                "must be another bar than that of `from`",
            )

    def across(self: Any, state: State) -> Any:
        """Return the vector from `start` to `end`, complex, m."""
        return self.end.locate(state) - self.start.locate(state)

    def reach(self: Any, state: State) -> Any:
        """Return the path from one end to the other, bar by bar, m."""
        distances = abs(self.start.distance) + abs(self.end.distance)
        return sum(state.lengths[:4]) + distances


def change_each(terms: Any, change: Callable[[Place], Place]) -> Any:
    """Return terms with their places changed."""
    return tuple(term.with_places(change) for term in terms)
