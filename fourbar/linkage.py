"""The description of a planar four-bar linkage: frozen, validated, computing nothing.

Pins: O2 (origin; bars 1, 2), A (2, 3), B (3, 4), O4 (4, 1).
Bars: 1 ground (length d), 2 input (a), 3 coupler (b), 4 output (c).
"""

import cmath
import math
from collections.abc import Container
from contextlib import suppress
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from functools import cache
from numbers import Integral
from typing import (
    Annotated,
    Any,
    ClassVar,
    NamedTuple,
    TypeVar,
    dataclass_transform,
    get_type_hints,
)

import numpy as np

from fourbar.errors import ELSEWHERE, InputError, expect, name_unit, write_in_units
from fourbar.quantities import PIN_FORCES, Array

Lengths = tuple[float, float, float, float]
"""Of ground, input, coupler and output, m."""
BAR_NAMES = {1: "ground", 2: "input", 3: "coupler", 4: "output"}
BAR_NUMBERS = {name: bar for bar, name in BAR_NAMES.items()}
MOVING_BARS = (2, 3, 4)
PINS = {"O2": (1, 2), "A": (2, 3), "B": (3, 4), "O4": (1, 4)}
PIN_FORCE = dict(zip(PINS, PIN_FORCES, strict=True))
"""The independent force of each pin."""
ENDS = {1: ("O2", "O4"), 2: ("O2", "A"), 3: ("A", "B"), 4: ("O4", "B")}
"""The pins at both ends of each bar; its angle is measured at the first."""
FIRST_PIN = {bar: first for bar, (first, _) in ENDS.items()}
SECOND_PIN = {bar: second for bar, (_, second) in ENDS.items()}
_NO_NUMBERS = (bool, str, bytes, complex)
"""Types that `require` rejects although `float` may read them."""
A_BRANCH = "must be +1 (open) or -1 (crossed)"
MOST_INTERVALS = 100_000_000
"""Intervals of any motion or curve."""
ANY_NUMBER, AT_LEAST_ZERO, POSITIVE = (
    "a finite number",
    "a finite number >= 0",
    "a finite number > 0",
)
"""Bounds of a number, as errors say them."""


Description = TypeVar("Description")


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def record(kind: type[Description]) -> type[Description]:
    """Make a class a frozen dataclass with slots."""
    return dataclass(frozen=True, slots=True)(kind)


def is_within(number: Any, bound: str) -> Any:
    """Return True if a finite number satisfies a bound, of arrays one by one."""
    if bound == POSITIVE:
        return number > 0.0
    if bound == AT_LEAST_ZERO:
        return number >= 0.0
    return True


def require(key: str, value: object, unit: str = "1", bound: str = ANY_NUMBER) -> float:
    """Return the value as a float, or raise an InputError that says what is allowed.

    `unit`: of the number; a text like "48 cm" and a `pint.Quantity` are converted to
    it. "1": there is none, and neither is read.
    """
    if type(value) is float and math.isfinite(value) and is_within(value, bound):
        return value
    number = math.nan
    wanted = f"must be {bound}, like {_show(unit)}"
    if unit != "1":
        value = _read_quantity(value)
    elif isinstance(value, str):
        wanted += ", without quotes"
    if unit != "1" and isinstance(value, str):
        from fourbar.quantities.units import UnitError, to_si

        try:
            number = to_si(value, unit)
        except UnitError as error:
            raise InputError(key, value, f"{error}; {wanted}") from None
    elif not isinstance(value, _NO_NUMBERS) and not getattr(value, "shape", ()):
        with suppress(TypeError, ValueError, OverflowError):
            number = float(value)  # type: ignore[arg-type]
    if not math.isfinite(number) or not is_within(number, bound):
        raise InputError(key, value, wanted)
    return number


def _show(*units: str) -> str:
    """Show a number of each unit, as an error says what is allowed."""
    return ", ".join("1" if unit == "1" else f'"1 {name_unit(unit)}"' for unit in units)


def require_whole(key: str, value: object, among: Container[int], allowed: str) -> int:
    """Return the value as one of some integers.

    Raises an InputError that says what is allowed.
    """
    if type(value) is int and value in among:
        return value
    if isinstance(value, bool) or not isinstance(value, Integral) or value not in among:
        raise InputError(key, value, allowed)
    return int(value)


def _read_quantity(value: object) -> object:
    """Return a `pint.Quantity` as text with its unit, any other value as it is.

    An array gives a list of texts.
    """
    if not hasattr(value, "magnitude") or not hasattr(value, "units"):
        return value
    from fourbar.quantities.units import write_pint_quantity

    text: object = write_pint_quantity(value)
    return text


def convert_to_unit(key: str, value: object, unit: str) -> object:
    """Convert each text like "48 cm" of a value, in lists too, as `require` does.

    Numbers and arrays stay.
    """
    if unit != "1":
        value = _read_quantity(value)
    if isinstance(value, (list, tuple)):
        return [convert_to_unit(key, entry, unit) for entry in value]
    if unit != "1" and isinstance(value, str):
        return require(key, value, unit)
    return value


def require_numbers(
    key: str,
    value: object,
    allowed: str = "must be finite numbers",
    unit: str = "1",
) -> Array:
    """Return the value as finite floats in `unit`, shape () or (n,).

    Raises an InputError that says what is allowed. A text with a unit is converted as
    by `require`, in a list too.
    """
    try:
        array = np.asarray(convert_to_unit(key, value, unit))
    except ValueError:  # rows of different lengths
        array = np.asarray(None)
    is_numeric = array.dtype.kind in "iuf"
    if not is_numeric or array.ndim > 1 or not np.isfinite(array).all():
        raise InputError(key, value, f"{allowed}, one or a list, like {_show(unit)}")
    return array.astype(float)


def require_bar(key: str, value: object) -> int:
    """Return the number of a moving bar, or raise an InputError."""
    return require_whole(key, value, MOVING_BARS, "must be 2, 3 or 4")


REQUIRED_NUMBER = object()
"""Mark that replaces a default: the number has to be stated."""


class Declared(NamedTuple):
    """Declaration of a number of a scene.

    Constructors, scene files, studies and tolerances follow it.
    """

    unit: str
    bound: str = ANY_NUMBER
    left_out: Any = REQUIRED_NUMBER
    """Value where a scene file leaves it out; of a field its default."""
    pair: str = ""
    """Unit of the second number of a pair, "rad" for an angle; empty for one number."""
    key: str = ""
    """Key in a scene file; empty: the name of the field."""
    always: bool = False
    """True if a scene file must state it, although its field has a default."""

    def __repr__(self) -> str:
        """Write the unit, for `help`."""
        return repr(self.unit)

    @property
    def units(self) -> tuple[str, str]:
        """Units of both numbers of a pair; that of one number twice."""
        return self.unit, self.pair or self.unit

    @property
    def bounds(self) -> tuple[str, str]:
        """Bounds of both numbers of a pair; an angle has none."""
        return self.bound, ANY_NUMBER if self.pair == "rad" else self.bound

    def check(self, key: str, value: Any) -> Any:
        """Return the number or pair as floats, in its unit; InputError for others."""
        if not self.pair:
            return require(key, value, self.unit, self.bound)
        try:
            pair: Any = None if isinstance(value, str | dict) else value
            size, other = pair
        except (TypeError, ValueError):
            form = f"must be a pair like [{_show(*self.units)}]"
            raise InputError(key, value, form) from None
        numbers = zip((size, other), self.units, self.bounds, strict=True)
        return tuple(require(key, *number) for number in numbers)


class OneOf(NamedTuple):
    """Declaration of a word of a scene."""

    words: tuple[str, ...]
    key: str = ""

    def check(self, key: str, value: Any) -> Any:
        """Return the word; InputError for another."""
        if not isinstance(value, str) or value not in self.words:
            allowed = " or ".join(f'"{word}"' for word in self.words)
            raise InputError(key, value, f"must be {allowed}")
        return value


class OfBar(NamedTuple):
    """Declaration of the number of a bar."""

    bars: tuple[int, ...] = MOVING_BARS
    reason: str = ""
    key: str = ""

    def check(self, key: str, value: Any) -> Any:
        """Return the number of the bar; InputError for another."""
        *bars, last = (f"{bar} ({BAR_NAMES[bar]})" for bar in self.bars)
        allowed = f"must be {', '.join(bars)} or {last}"
        if self.reason:
            allowed = f"{allowed}, {self.reason}"
        if isinstance(value, int) and value > len(BAR_NAMES):
            allowed = f"{allowed}: {ELSEWHERE}"
        return require_whole(key, value, self.bars, allowed)


class Text(NamedTuple):
    """Declaration of a text."""

    key: str = ""

    def check(self, key: str, value: Any) -> str:
        """Return the text; InputError for what is none."""
        if not isinstance(value, str):
            raise InputError(key, value, "must be a text in quotes")
        return value


class Whole(NamedTuple):
    """Declaration of an integer from `least` to `most`."""

    least: int
    most: int
    key: str = ""

    def check(self, key: str, value: Any) -> Any:
        """Return the integer; InputError for what is none."""
        among = range(self.least, self.most + 1)
        allowed = f"must be a whole number from {self.least} to {self.most}"
        return require_whole(key, value, among, allowed)


class Listed(NamedTuple):
    """Declaration of a list of numbers of a unit."""

    unit: str
    key: str = ""

    @property
    def units(self) -> tuple[str]:
        """Unit of each number."""
        return (self.unit,)

    def check(self, key: str, value: Any) -> Any:
        """Return the numbers as a tuple of floats; InputError for others."""
        return tuple(require_numbers(key, value, unit=self.unit).ravel().tolist())


class Part(NamedTuple):
    """Declaration of a description within another."""

    kind: Any
    key: str = ""

    def check(self, key: str, value: Any) -> Any:
        """Return the description; InputError for one of another class."""
        expect(key, value, self.kind)
        return value


class Entries(NamedTuple):
    """Declaration of a list of descriptions."""

    kind: Any
    key: str = ""
    most: int = 1000
    is_value: bool = False
    """True if the list is the value of its effect, not an entry in a table."""

    def check(self, key: str, value: Any) -> Any:
        """Return the descriptions as a tuple; InputError for any of another class."""
        expect(key, value, tuple, list)
        for entry in value:
            expect(key, entry, self.kind)
        return tuple(value)


class DeclaredField(NamedTuple):
    """Field of a description with its declaration."""

    name: str
    by: Any
    """One of the declarations above, or what else has a key and `check`."""
    key: str
    """Key in a scene file, below that of the description."""
    left_out: Any
    """Value where a scene file leaves it out."""
    counts: bool
    """True if descriptions that differ in it differ."""


def list_declared(kind: Any) -> tuple[DeclaredField, ...]:
    """List the declared fields of a class of descriptions, in their order."""
    return _list_declared(kind)


@cache
def _list_declared(kind: type) -> tuple[DeclaredField, ...]:
    if not is_dataclass(kind):  # a base class, which `help` asks too
        return ()
    hints = get_type_hints(kind, include_extras=True)
    declared = []
    for one in fields(kind):
        for by in getattr(hints[one.name], "__metadata__", ()):
            must = one.default is MISSING or getattr(by, "always", False)
            left_out = REQUIRED_NUMBER if must else one.default
            key = "" if getattr(by, "is_value", False) else by.key or one.name
            declared.append(DeclaredField(one.name, by, key, left_out, one.compare))
    return tuple(declared)


@cache
def _list_numbers_of(kind: type) -> dict[str, Declared]:
    return {
        one.name: one.by._replace(left_out=one.left_out)
        for one in list_declared(kind)
        if isinstance(one.by, Declared) and one.counts
    }


class _Numbers:
    """Attribute of a class: the declarations of its numbers, by the fields' names."""

    def __get__(self, description: object, kind: type) -> dict[str, Declared]:
        return _list_numbers_of(kind)


class Described:
    """Base class of what a scene states: each field has its declaration as a hint.

    The constructor checks every field by its declaration, and scene files, `vary`,
    tolerances, the workbench and the list of what acts follow the same.

    >>> from dataclasses import dataclass
    >>> from typing import Annotated
    >>> @dataclass(frozen=True)
    ... class Wheel(Described):
    ...     radius: Annotated[float, Declared("m", POSITIVE)]
    >>> Wheel("20 cm")
    Wheel(radius=0.2)
    """

    __slots__ = ()
    stated_at: ClassVar[str] = ""
    """Key of the description, as errors name it; {0.name} stands for a field."""
    numbers: ClassVar[Any] = _Numbers()

    def __post_init__(self) -> None:
        section = self.stated_at.format(self)
        for one in list_declared(type(self)):
            value = getattr(self, one.name)
            if value is None and one.left_out is None:
                continue
            checked = one.by.check(f"{section}.{one.key}".strip("."), value)
            object.__setattr__(self, one.name, checked)


def copy_with(description: Description, /, **changed: Any) -> Description:
    """Return a frozen description with some fields changed, itself where none is.

    The new values may be arrays; nothing is checked again.
    """
    for name, value in changed.items():
        if value is not getattr(description, name):
            break
    else:
        return description
    kind: Any = description.__class__
    copied: Description = object.__new__(kind)
    for name in list_fields(kind):
        value = changed[name] if name in changed else getattr(description, name)
        object.__setattr__(copied, name, value)
    return copied


@cache
def list_fields(kind: type) -> tuple[str, ...]:
    """List the names of a dataclass's fields."""
    return tuple(field.name for field in fields(kind))


@record
class Bar(Described):
    """A moving bar; massless unless stated otherwise.

    Numbers may be texts with units instead, like "48 cm".

    Parameters
    ----------
    length : distance between its two pins, m, > 0.
    mass : kg, >= 0.
    inertia : about the mass centre G, kg m^2, >= 0; left out: uniform slender bar,
        m L^2/12.
    centre : (r, phi), polar position of G from the bar's first pin (O2, A, O4), phi
        measured from the bar's line, m and rad; left out: mid-bar.
    density : kg/m^3, > 0, in place of `mass`, which is then that of a uniform bar from
        pin to pin and follows the length: ``dataclasses.replace(bar, length=0.9,
        mass=0)``.
    section : (height, thickness) of a rectangular cross-section, m: the height lies in
        the plane of motion.
    diameter : of a round cross-section, m, in place of `section`.
    mass_per_length : kg/m, > 0, in place of `mass` as a density is, and without a
        cross-section.

    >>> bar = Bar("0.4 m", density="7850 kg/m^3", section=("20 mm", "5 mm"))
    >>> round(bar.mass, 6)
    0.314
    """

    length: Annotated[float, Declared("m", POSITIVE)]
    mass: Annotated[float, Declared("kg", AT_LEAST_ZERO)] = 0.0
    inertia: Annotated[float | None, Declared("kg m^2", AT_LEAST_ZERO)] = None
    centre: Annotated[tuple[float, float] | None, Declared("m", pair="rad")] = None
    density: Annotated[float | None, Declared("kg/m^3", POSITIVE)] = None
    section: Annotated[
        tuple[float, float] | None, Declared("m", POSITIVE, pair="m")
    ] = None
    diameter: Annotated[float | None, Declared("m", POSITIVE)] = None
    mass_per_length: Annotated[float | None, Declared("kg/m", POSITIVE)] = None

    def __post_init__(self) -> None:
        Described.__post_init__(self)
        size = "diameter" if self.section is None else "section"
        modulus = self.section_modulus
        wrong = allowed = ""
        if self.section is not None and self.diameter is not None:
            wrong = "diameter"
            allowed = "must be left out beside a section"
        elif modulus is not None and not 0.0 < modulus < math.inf:
            wrong = size
            allowed = "is no size of a bar: the cube of it must be a positive double"
        elif self.density is not None and self.area is None:
            wrong = "density"
            allowed = "needs the cross-section: section or diameter"
        elif self.density is not None and self.mass_per_length is not None:
            wrong = "density"
            allowed = "must be left out beside mass_per_length"
        elif self.mass not in (0.0, self.weigh()):
            wrong = "mass"
            allowed = (
                "must be left out (0 in dataclasses.replace): density or"
                " mass_per_length states it, unless it is None"
            )
        if wrong:
            unit = Bar.numbers[wrong].unit
            raise InputError(wrong, getattr(self, wrong), allowed, unit=unit)
        object.__setattr__(self, "mass", self.weigh())

    @property
    def area(self) -> Any:
        """Area of the cross-section, m^2; None if it is not stated."""
        if self.section is not None:
            return self.section[0] * self.section[1]
        if self.diameter is not None:
            return math.pi / 4.0 * (self.diameter * self.diameter)
        return None

    @property
    def section_modulus(self) -> Any:
        """Section modulus of bending in the plane, m^3; None without a cross-section.

        t h^2/6 of a rectangle of height h and thickness t, pi d^3/32 of a circle.
        """
        if self.section is not None:
            height, thickness = self.section
            return thickness * (height * height) / 6.0
        if self.diameter is not None:
            square = self.diameter * self.diameter
            return math.pi / 32.0 * (square * self.diameter)
        return None

    def weigh(self) -> Any:
        """Return the mass of the bar, kg.

        Density and cross-section, or the mass per length, state it from pin to pin;
        without these it is `mass`.
        """
        if self.mass_per_length is not None:
            return self.mass_per_length * self.length
        if self.density is None:
            return self.mass
        return self.density * self.area * self.length

    @property
    def moment_of_inertia(self) -> float:
        """Moment of inertia about the mass centre, kg m^2.

        If left out, it is that of a uniform slender bar, m L^2/12.
        """
        if self.inertia is None:
            return self.mass * self.length * self.length / 12.0
        return self.inertia

    @property
    def mass_centre(self) -> tuple[float, float]:
        """Polar (r, phi) from the bar's first pin, m and rad; mid-bar if left out."""
        return (0.5 * self.length, 0.0) if self.centre is None else self.centre

    @property
    def to_centre(self) -> complex:
        """Vector from the first pin to G in the bar's frame: along + i across, m."""
        return cmath.rect(*self.mass_centre)


@record
class FourBar(Described):
    """A four-bar linkage: ground length d and angle theta_1 (O2 to O4), three bars.

    Raises InputError where the four lengths cannot close anywhere (the longest exceeds
    the sum of the other three).
    """

    ground: Annotated[float, Declared("m", POSITIVE)]
    input: Bar
    coupler: Bar
    output: Bar
    ground_angle: Annotated[float, Declared("rad")] = 0.0
    stated_at = "lengths"

    def __post_init__(self) -> None:
        Described.__post_init__(self)
        for name, bar in zip(("input", "coupler", "output"), self.moving, strict=True):
            if not isinstance(bar, Bar):
                raise InputError(
                    f"bars.{name}",
                    bar,
                    "must be a Bar, like fourbar.Bar(0.1) for a bar of 0.1 m",
                )
        longest = max(self.lengths)
        if not math.isfinite(4.0 * longest):
            raise InputError(
                "lengths",
                self.lengths,
                "must be at most a quarter of the greatest double, 4.5e307 m",
            )
        # exact sum: a linkage that closes by one rounding is still a linkage
        if math.fsum((*self.lengths, -2.0 * longest)) < 0.0:
            others = math.fsum((*self.lengths, -longest))
            raise InputError(
                "lengths",
                self.lengths,
                "the bars (ground, input, coupler, output) can never close: "
                "the longest must not exceed the sum of the other three,"
                f" {write_in_units('m', others)}",
                unit="m",
            )

    @property
    def lengths(self) -> tuple[float, float, float, float]:
        """(d, a, b, c): ground, input, coupler, output, in m."""
        return (
            self.ground,
            self.input.length,
            self.coupler.length,
            self.output.length,
        )

    @property
    def moving(self) -> tuple[Bar, Bar, Bar]:
        """Bars 2, 3, 4."""
        return (self.input, self.coupler, self.output)

    def bar(self, number: int) -> Bar:
        """Return the moving bar 2, 3 or 4."""
        return self.moving[require_bar("bar", number) - 2]


def uniform(
    ground: float | str,
    input: float | str,
    coupler: float | str,
    output: float | str,
    *,
    per_metre: float | str = 1.0,
) -> FourBar:
    """Make a linkage of uniform slender bars.

    The lengths are in m, the mass per metre in kg/m.

    >>> uniform("6 in", "2 in", "5 in", "4 in").ground
    0.1524
    """
    density = require("per_metre", per_metre, "kg/m", AT_LEAST_ZERO)
    stated = zip(BAR_NUMBERS, (ground, input, coupler, output), strict=True)
    d, *lengths = (
        require(f"lengths.{name}", length, "m", POSITIVE) for name, length in stated
    )
    two, three, four = (Bar(length, mass=density * length) for length in lengths)
    return FourBar(d, two, three, four)
