"""Each effect in a scene file: how its entry under ``[effects]`` is read and written, one row of a table each.

Units are checked here and nowhere else. An effect is imported when a file names it.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

from fourbar import effects as kinds
from fourbar.errors import InputError
from fourbar.files.fields import Reader, Writer
from fourbar.linkage import PINS

if TYPE_CHECKING:
    from fourbar.effects import Effect, Flywheel, Gravity, PinFriction, Point, Springs, Torsion

TORSION = {"stiffness": "N m/rad", "rest": "rad", "preload": "N m"}
SPRING = {"stiffness": "N/m", "length": "m", "preload": "N"}
MOST_SPRINGS = 1000


def _read_gravity(value: object, read: Reader) -> "Gravity":
    return kinds.Gravity(*read.polar("effects.gravity", value, "m/s^2"))


def _write_gravity(effect: "Gravity", write: Writer) -> Any:
    return write.polar(effect.magnitude, effect.angle, "m/s^2")


def _read_pin_friction(value: object, read: Reader) -> "PinFriction":
    key = "effects.pin_friction"
    pins = {}
    for pin, entry in read.table(key, value, PINS).items():
        given = read.table(f"{key}.{pin}", entry, ("coefficient", "radius"))
        mu = read.number(f"{key}.{pin}.coefficient", given.get("coefficient"))
        pins[pin] = (mu, read.quantity(f"{key}.{pin}.radius", given.get("radius"), "m", at_least_zero=True))
    return kinds.PinFriction.at(**pins)


def _write_pin_friction(effect: "PinFriction", write: Writer) -> Any:
    return {pin: {"coefficient": mu, "radius": write.quantity(r, "m")} for pin, mu, r in effect.pins}


def _read_torsion(value: object, read: Reader) -> "Torsion":
    """Preload 0 where it is left out."""
    key = "effects.torsion"
    springs = {}
    for pin, entry in read.table(key, value, PINS).items():
        given = read.table(f"{key}.{pin}", entry, TORSION)
        texts = {"preload": "0 N m", **given}
        k, rest, preload = (
            read.quantity(f"{key}.{pin}.{name}", texts.get(name), unit) for name, unit in TORSION.items()
        )
        springs[pin] = (k, rest, preload)
    return kinds.Torsion.at(**springs)


def _write_torsion(effect: "Torsion", write: Writer) -> Any:
    return {
        pin: {name: write.quantity(x, TORSION[name]) for name, x in zip(TORSION, numbers, strict=True)}
        for pin, *numbers in effect.springs
    }


def _read_springs(value: object, read: Reader) -> "Springs":
    """Preload 0 where it is left out."""
    key = "effects.springs"
    if not isinstance(value, list) or not 1 <= len(value) <= MOST_SPRINGS:
        raise read.refuse(key, value, f"must be a list of 1 to {MOST_SPRINGS} springs")
    springs = []
    for index, entry in enumerate(value):
        own = f"{key}[{index}]"
        given = read.table(own, entry, ("from", "to", *SPRING))
        texts = {"preload": "0 N", **given}
        numbers = [read.quantity(f"{own}.{name}", texts.get(name), unit) for name, unit in SPRING.items()]
        start, end = (_read_point(read, f"{own}.{name}", given.get(name)) for name in ("from", "to"))
        springs.append(kinds.Spring(start, end, *numbers))
    return kinds.Springs(tuple(springs))


def _read_point(read: Reader, key: str, value: object) -> "Point":
    entry = read.table(key, value, ("bar", "at"))
    bar = read.whole(f"{key}.bar", entry.get("bar"), 1, 4)
    return kinds.Point(bar, *(read.polar(f"{key}.at", entry["at"], "m") if "at" in entry else (0.0, 0.0)))


def _write_springs(effect: "Springs", write: Writer) -> Any:
    rows = []
    for spring in effect.springs:
        ends = zip(("from", "to"), (spring.start, spring.end), strict=True)
        row: dict[str, Any] = {
            name: {"bar": point.bar, "at": write.polar(point.distance, point.angle, "m")} for name, point in ends
        }
        row.update({name: write.quantity(getattr(spring, name), unit) for name, unit in SPRING.items()})
        rows.append(row)
    return rows


def _read_flywheel(value: object, read: Reader) -> "Flywheel":
    """On bar 2 where none is named."""
    key = "effects.flywheel"
    entry = read.table(key, value, ("bar", "inertia"))
    inertia = read.quantity(f"{key}.inertia", entry.get("inertia"), "kg m^2", at_least_zero=True)
    return kinds.Flywheel(inertia, read.whole(f"{key}.bar", entry.get("bar", 2), 2, 4))


def _write_flywheel(effect: "Flywheel", write: Writer) -> Any:
    return {"bar": effect.bar, "inertia": write.quantity(effect.inertia, "kg m^2")}


class Entry(NamedTuple):
    """What a scene file says of one effect."""

    read: Callable[[object, Reader], "Effect"]
    """From the value under its key."""
    write: Callable[[Any, Writer], Any]
    """Back to that value."""
    example: str
    """One line of a scene file."""


def _per_pin(key: str, kind: str, field: str, unit: str, example: str) -> Entry:
    """An effect that is one number for each pin."""

    def read(value: object, given: Reader) -> "Effect":
        effect: Effect = getattr(kinds, kind).at(**given.per_pin(f"effects.{key}", value, unit))
        return effect

    def write(effect: Any, write: Writer) -> Any:
        return {pin: write.quantity(value, unit) for pin, value in getattr(effect, field)}

    return Entry(read, write, example)


REGISTRY: dict[str, Entry] = {
    "gravity": Entry(_read_gravity, _write_gravity, 'gravity = ["9.81 m/s^2", "-90 deg"]'),
    "viscous": _per_pin("viscous", "Viscous", "coefficients", "N m s/rad", 'viscous = { O2 = "0.01 N m s/rad" }'),
    "friction": _per_pin("friction", "Friction", "torques", "N m", 'friction = { A = "0.05 N m" }'),
    "pin_friction": Entry(
        _read_pin_friction, _write_pin_friction, 'pin_friction = { A = { coefficient = 0.1, radius = "8 mm" } }'
    ),
    "torsion": Entry(
        _read_torsion,
        _write_torsion,
        'torsion = { B = { stiffness = "2 N m/rad", rest = "30 deg", preload = "0.1 N m" } }',
    ),
    "springs": Entry(
        _read_springs,
        _write_springs,
        'springs = [{ from = { bar = 1, at = ["10 cm", "-90 deg"] }, to = { bar = 4, at = ["8 cm", "0 deg"] }, '
        'stiffness = "200 N/m", length = "12 cm", preload = "3 N" }]',
    ),
    "flywheel": Entry(_read_flywheel, _write_flywheel, 'flywheel = { bar = 2, inertia = "0.02 kg m^2" }'),
}
"""By the key under ``[effects]``, in the order in which they are listed; a new one is added here."""


def written(effect: "Effect", write: Writer) -> Any:
    """The value of an effect under its key; InputError where a scene file has no form of it."""
    if effect.key not in REGISTRY:
        raise InputError(f"effects.{effect.key}", type(effect).__name__, "a scene file has no form of this effect")
    return REGISTRY[effect.key].write(effect, write)
