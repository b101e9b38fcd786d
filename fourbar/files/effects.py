"""Each effect in a scene file: how its entry under ``[effects]`` is read and written, one row of a table each.

An effect is imported when a file names it.
"""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from fourbar import effects as kinds
from fourbar.effects.numbers import OF_EFFECT, OF_GAS_SPRING, ROWS
from fourbar.errors import InputError
from fourbar.files.fields import Reader, write_polar, write_quantity
from fourbar.linkage import AT_LEAST_ZERO, PINS

if TYPE_CHECKING:
    from fourbar.effects import Effect, Flywheel, SpringEnd, Springs

MOST_SPRINGS = 1000
FIELD, INERTIA = OF_EFFECT["gravity"]["magnitude"][0], OF_EFFECT["flywheel"]["inertia"][0]


def _read_springs(value: object, read: Reader) -> "Springs":
    """Read springs, whose preload is 0 where it is left out, and gas springs."""
    key, numbers = "effects.springs", OF_EFFECT["springs"]
    if not isinstance(value, list) or not 1 <= len(value) <= MOST_SPRINGS:
        raise read.refuse(key, value, f"must be a list of 1 to {MOST_SPRINGS} springs")
    springs = []
    for index, entry in enumerate(value):
        own = f"{key}[{index}]"
        given = read.table(own, entry, ("from", "to", *numbers, "gas"))
        start, end = read_ends(read, own, given)
        if gas := "gas" in given:
            read.table(own, entry, ("from", "to", "gas"))
            words = read.table(f"{own}.gas", given["gas"], OF_GAS_SPRING)
            words = {"compressed_force": words.get("extended_force"), **words}
            stated = _read_numbers(read, f"{own}.gas", words, OF_GAS_SPRING)
        else:
            stated = _read_numbers(read, own, given, numbers, preload=0.0)
        try:
            springs.append(kinds.Spring.gas(start, end, *stated) if gas else kinds.Spring(start, end, *stated))
        except InputError as error:  # which knows of one spring alone
            raise read.refuse(error.key.replace(key, own), error.value, error.allowed) from None
    return kinds.Springs(tuple(springs))


def _read_numbers(
    read: Reader, key: str, given: Mapping[str, object], numbers: Mapping[str, tuple[str, str]], **defaults: float
) -> list[float]:
    """Read each of some numbers within its bound."""
    return [
        read.quantity(f"{key}.{name}".rstrip("."), given.get(name), *of, defaults.get(name))
        for name, of in numbers.items()
    ]


def read_ends(read: Reader, key: str, given: dict[str, Any]) -> "tuple[SpringEnd, SpringEnd]":
    """Read the entries `from` and `to` of a line between two bars; an end without `at` is at the bar's first pin."""
    ends = []
    for name in ("from", "to"):
        own = f"{key}.{name}"
        entry = read.table(own, given.get(name), ("bar", "at"))
        bar = read.whole(f"{own}.bar", entry.get("bar"), 1, 4)
        ends.append(kinds.SpringEnd(bar, *(read.polar(f"{own}.at", entry["at"], "m") if "at" in entry else (0.0, 0.0))))
    return ends[0], ends[1]


def write_ends(line: Any) -> dict[str, Any]:
    """Write them back."""
    ends = {"from": line.start, "to": line.end}
    return {name: {"bar": end.bar, "at": write_polar(end[1], end[2], "m")} for name, end in ends.items()}


def _write_springs(effect: "Springs") -> Any:
    return [
        {
            **write_ends(s),
            **{name: write_quantity(getattr(s, name), unit) for name, (unit, _) in OF_EFFECT["springs"].items()},
        }
        for s in effect.springs
    ]


def _read_flywheel(value: object, read: Reader) -> "Flywheel":
    """On bar 2 where none is named."""
    key = "effects.flywheel"
    entry = read.table(key, value, ("bar", "inertia"))
    inertia = read.quantity(f"{key}.inertia", entry.get("inertia"), INERTIA, AT_LEAST_ZERO)
    return kinds.Flywheel(inertia, read.whole(f"{key}.bar", entry.get("bar", 2), 2, 4))


class EffectFormat(NamedTuple):
    """What a scene file says of one effect."""

    read: Callable[[object, Reader], "Effect"]
    """From the value under its key."""
    write: Callable[[Any], Any]
    """Back to that value."""
    example: str
    """One line of a scene file."""


def _describe_per_pin(key: str, kind: str, example: str, **defaults: float) -> EffectFormat:
    """Describe an effect that holds rows (pin, number, ...); where a pin has one number, that stands without a list."""
    numbers = OF_EFFECT[key]

    def read_rows(value: object, read: Reader) -> "Effect":
        rows = []
        for pin, entry in read.table(f"effects.{key}", value, PINS).items():
            own = f"effects.{key}.{pin}"
            texts = {"": entry} if "" in numbers else read.table(own, entry, numbers)
            rows.append((pin, *_read_numbers(read, own, texts, numbers, **defaults)))
        effect: Effect = getattr(kinds, kind)(tuple(rows))
        return effect

    def write_rows(effect: Any) -> Any:
        rows = {}
        for pin, *own in getattr(effect, ROWS[key]):
            texts = {name: write_quantity(x, unit) for (name, (unit, _)), x in zip(numbers.items(), own, strict=True)}
            rows[pin] = texts.get("", texts)
        return rows

    return EffectFormat(read_rows, write_rows, example)


REGISTRY: dict[str, EffectFormat] = {
    "gravity": EffectFormat(
        lambda value, read: kinds.Gravity(*read.polar("effects.gravity", value, FIELD)),
        lambda effect: write_polar(effect.magnitude, effect.angle, FIELD),
        'gravity = ["9.81 m/s^2", "-90 deg"]',
    ),
    "viscous": _describe_per_pin("viscous", "Viscous", 'viscous = { O2 = "0.01 N m s/rad" }'),
    "friction": _describe_per_pin("friction", "Friction", 'friction = { A = "0.05 N m" }'),
    "pin_friction": _describe_per_pin(
        "pin_friction", "PinFriction", 'pin_friction = { A = { coefficient = 0.1, radius = "8 mm" } }'
    ),
    "torsion": _describe_per_pin(
        "torsion",
        "Torsion",
        'torsion = { B = { stiffness = "2 N m/rad", rest = "30 deg", preload = "0.1 N m" } }',
        preload=0.0,
    ),
    "springs": EffectFormat(
        _read_springs,
        _write_springs,
        'springs = [{ from = { bar = 1, at = ["10 cm", "-90 deg"] }, to = { bar = 4, at = ["8 cm", "0 deg"] }, '
        'stiffness = "200 N/m", length = "12 cm", preload = "3 N" }]',
    ),
    "flywheel": EffectFormat(
        _read_flywheel,
        lambda effect: {"bar": effect.bar, "inertia": write_quantity(effect.inertia, INERTIA)},
        'flywheel = { bar = 2, inertia = "0.02 kg m^2" }',
    ),
}
"""By the key under ``[effects]``, in the order in which they are listed; a new one is added here."""


def write_effect(effect: "Effect") -> Any:
    """Write the value of an effect under its key; InputError where a scene file has no form of it."""
    if effect.key not in REGISTRY:
        raise InputError(f"effects.{effect.key}", type(effect).__name__, "a scene file has no form of this effect")
    return REGISTRY[effect.key].write(effect)
