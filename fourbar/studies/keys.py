"""The numbers of a scene by their keys in its file, and scenes of arrays of them."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from fourbar.effects.effect import PinRows
from fourbar.effects.place import At, Place
from fourbar.errors import (
    InputError,
    expect,
    suggest_keys,
    write_in_units,
)
from fourbar.formulas.arithmetic import (
    angle,
    dot,
    polar,
    sine,
    vector,
    without_slopes,
)
from fourbar.linkage import (
    ANY_NUMBER,
    BAR_NAMES,
    BAR_NUMBERS,
    ENDS,
    FIRST_PIN,
    MOVING_BARS,
    PINS,
    Bar,
    Entries,
    copy_with,
    is_within,
    list_declared,
)
from fourbar.scene import Scene
from fourbar.scene.drawing import DRAWN_PLACE, DRAWN_WORD, DrawnPins
from fourbar.scene.numbers import Tolerance

COMMAND_KEYS = ("motion.theta_2", "motion.theta_3", "motion.theta_4", "motion.stroke")
"""Keys of the commanded angle or stroke."""
_MASS_CENTRE = "centre"
OF_A_UNIFORM_BAR = {"inertia": "moment_of_inertia", _MASS_CENTRE: "mass_centre"}
"""Numbers of a bar that are those of a uniform one if they are left out, and the
properties that have them then.
"""
_KEYS = {"loads": "loads.{0}", "points": "{1.key}", "effects": "effects.{1.key}"}
"""Keys of what a scene holds many of, by its field, from the index and the entry."""
NumberPath = tuple[str | int, ...]
"""Attributes and indices that lead from a scene to one of its numbers."""


class SceneNumber(NamedTuple):
    """Number of a scene that a study varies."""

    place: NumberPath
    unit: str
    bound: str = ANY_NUMBER
    is_left_out: bool = False
    """True if the scene leaves the number to a uniform bar."""

    @property
    def is_drawn_place(self) -> bool:
        """True for a coordinate, in the drawing, of a place of a bar."""
        return DRAWN_WORD in self.place

    def holds(self, values: Any) -> Any:
        """Mark the numbers that a scene would accept."""
        return np.isfinite(values) & is_within(values, self.bound)


def list_described(scene: Scene) -> list[tuple[str, NumberPath, Any]]:
    """List drive, loads, points and effects with their keys, each before its places.

    Entries of an effect that holds a list follow it. Between key and description are
    the attributes and indices that lead to it.
    """
    described: list[tuple[str, NumberPath, Any]] = []

    def add(key: str, path: NumberPath, holder: Any) -> None:
        described.append((key, path, holder))
        for field in list_declared(type(holder)):
            value = getattr(holder, field.name)
            inner = f"{key}.{field.key}".rstrip(".")
            place = (*path, field.name)
            if isinstance(field.by, At):
                # in the holder's own table it is the first of the numbers
                index = -1 if field.by.is_value else len(described)
                described.insert(index, (inner, place, value))
            elif isinstance(field.by, Entries):
                for index, entry in enumerate(value):
                    add(f"{inner}.{index}", (*place, index), entry)

    if scene.drive is not None:
        add("drive", ("drive",), scene.drive)
    for table, key in _KEYS.items():
        for index, one in enumerate(getattr(scene, table)):
            add(key.format(index, one), (table, index), one)
    return described


def _list_entries(key: str, path: NumberPath, described: Any) -> dict[str, SceneNumber]:
    """List the entries of the numbers that a description states.

    The numbers of a pair are listed one by one, and what each pin has by its name.
    """
    entries = dict[str, SceneNumber]()
    if isinstance(described, PinRows):
        for index, (pin, *_) in enumerate(described.rows):
            for column, (name, by) in enumerate(described.numbers.items(), 1):
                place = (*path, described.field, index, column)
                of_pin = f"{key}.{pin}.{name}".rstrip(".")
                entries[of_pin] = SceneNumber(place, by.unit, by.bound)
        return entries
    for name, by in described.numbers.items():
        is_left_out = getattr(described, name) is None
        if is_left_out and not (
            isinstance(described, Bar) and name in OF_A_UNIFORM_BAR
        ):
            continue
        stated = f"{key}.{by.key or name}"
        place = (*path, name)
        if by.pair:
            for index, (unit, bound) in enumerate(
                zip(by.units, by.bounds, strict=True)
            ):
                number = SceneNumber((*place, index), unit, bound, is_left_out)
                entries[f"{stated}.{index}"] = number
        else:
            entries[stated] = SceneNumber(place, by.unit, by.bound, is_left_out)
    return entries


def _list_drawn_places(
    scene: Scene,
    entries: Mapping[str, SceneNumber],
) -> dict[str, SceneNumber]:
    """List the coordinates, in the drawing, of places stated from a bar's first pin.

    A mass centre on that pin has none: its distance and angle, which a bar states, have
    no derivative there.

    `entries`: the numbers of the scene, which state each place by distance and angle.
    """
    drawn = dict[str, SceneNumber]()
    for key, entry in entries.items():
        if len(entry.place) < 3:
            continue
        *holder, form, axis = entry.place
        stem = key.removesuffix(f".{axis}")
        if form == "from_pin":
            stem = stem.removesuffix(f".{form}")
        else:
            is_centre = form == _MASS_CENTRE and not entry.is_left_out
            if not is_centre or read_place(scene, (*holder, form, 0)) == 0.0:
                continue
        place = (*holder, DRAWN_WORD, axis)
        drawn[f"{stem}.{DRAWN_WORD}.{axis}"] = SceneNumber(place, DRAWN_PLACE.unit)
    return drawn


def list_entries(scene: Scene) -> dict[str, SceneNumber]:
    """List the numbers of a scene that a study varies, by key.

    Coordinates of drawn pins come first, then lengths, those of other drawn places
    last. What is commanded is not among them.
    """
    of_ground = _list_entries("lengths", ("linkage",), scene.linkage)
    lengths = {"lengths.ground": of_ground["lengths.ground"]}
    bars = dict[str, SceneNumber]()
    for bar in MOVING_BARS:
        name = BAR_NAMES[bar]
        described = scene.linkage.bar(bar)
        of_bar = _list_entries(f"bars.{name}", ("linkage", name), described)
        lengths[f"lengths.{name}"] = of_bar.pop(f"bars.{name}.length")
        if described.density is not None or described.mass_per_length is not None:
            del of_bar[f"bars.{name}.mass"]  # it follows from the length
        # what a uniform bar has follows from the numbers before it
        bars |= sorted(
            of_bar.items(), key=lambda one: one[1].place[2] in OF_A_UNIFORM_BAR
        )
    entries = lengths | of_ground | bars
    motion = scene.motion
    if motion.law is None:
        for name in motion.names[1:]:
            if np.ndim(getattr(motion, name)) == 0:  # not one for each angle
                unit = motion.numbers[name].unit
                entries[f"motion.{name}"] = SceneNumber(("motion", name), unit)
    for key, path, described in list_described(scene):
        entries |= _list_entries(key, path, described)
    if scene.drawing is None:
        return entries
    of_pins = {
        f"pins.{pin}.{axis}": SceneNumber(("drawing", pin, axis), DRAWN_PLACE.unit)
        for pin in PINS
        for axis in (0, 1)
    }
    return of_pins | entries | _list_drawn_places(scene, entries)


def command_key(scene: Scene) -> str:
    """Return the key of what is commanded."""
    return f"motion.{scene.motion.commanded}"


def refuse_key(key: str, value: object, keys: list[str]) -> InputError:
    """Make the error for a key that a study cannot vary; keys like it come first."""
    expect("key", key, str)
    allowed = suggest_keys(key, keys)
    if key.endswith(("extended_force", "compressed_force")):
        allowed = f"preload and stiffness state the force of a gas spring; {allowed}"
    return InputError(key, value, f"is no number of this scene; {allowed}")


def find_overlap(keys: Collection[str]) -> tuple[str, str] | None:
    """Return the key of a number and that of a coordinate by which it follows.

    A length follows from the pins of its bar, distance and angle of a place from the
    coordinates of the place. None: the keys state no number twice.
    """
    follows: dict[str, tuple[str, ...]] = {
        f"lengths.{BAR_NAMES[bar]}": tuple(f"pins.{pin}." for pin in pins)
        for bar, pins in ENDS.items()
    }
    follows["lengths.ground_angle"] = follows["lengths.ground"]
    for key in keys:
        stem, drawn, _ = key.partition(f".{DRAWN_WORD}.")
        form = stem if stem.endswith(_MASS_CENTRE) else f"{stem}.from_pin"
        if drawn:
            follows |= dict.fromkeys((f"{form}.0", f"{form}.1"), (stem + drawn,))
    for number, coordinates in follows.items():
        for key in keys:
            if number in keys and key.startswith(coordinates):
                return number, key
    return None


LEFT_OUT = (
    "is left out of the scene and follows the length; state it to give it a tolerance"
)


def find_misfit(scene: Scene, entry: SceneNumber, tolerance: Tolerance) -> str | None:
    """Say why a number of a scene cannot have a tolerance; None: it can.

    The reader of scene files and the samples of a study both need the answer.
    """
    if entry.is_left_out:
        return LEFT_OUT
    number = read_number(scene, entry)
    if number is None:
        return (
            "is the tolerance of a number that the scene leaves out: state the number "
            "first"
        )
    if entry.bound != ANY_NUMBER and tolerance.reach >= number:
        three = "three sigma of it " if tolerance.sigma else ""
        itself = write_in_units(entry.unit, number)
        return f"{three}must be less than the number itself, {itself}"
    return None


def read_number(scene: Scene, entry: SceneNumber) -> Any:
    """Read a number of a scene; None where the scene leaves it out."""
    if not entry.is_drawn_place:
        return read_place(scene, entry.place)
    *holder, _, axis = entry.place
    _, _, pin, from_pin = _find_drawn(scene, holder)
    return pin[int(axis)] + from_pin[int(axis)]


def replace_number(scene: Scene, entry: SceneNumber, values: Any) -> Scene:
    """Copy a scene with one of its numbers replaced, unchecked.

    A place of the drawing moves by a vector, which turns with its bar:

        z' = x' e^{-i theta} + y' e^{i (pi/2 - theta)},

    x' and y' from the bar's first pin in the axes of the drawing, theta the drawn angle
    of the bar. Both terms stay polar, as a place is stated, and have slopes at z = 0.
    """
    path: Sequence[str | int] = entry.place
    new = values
    if entry.is_drawn_place:
        *path, _, axis = entry.place
        place, theta, pin, from_pin = _find_drawn(scene, path)
        from_pin[int(axis)] = values - pin[int(axis)]
        x, y = from_pin
        moved = place._replace(
            from_pin=(x, -theta), from_centre=(y, 0.5 * np.pi - theta)
        )
        new = read_place(scene, path)
        if isinstance(new, Bar):
            new = copy_with(new, centre=moved.polar_from_pin())
        else:
            new = new.with_places(lambda _: moved)
    changed: Scene = replace_place(scene, path, new)
    return changed


def _find_drawn(
    scene: Scene, path: Sequence[str | int]
) -> tuple[Place, Any, list[Any], list[Any]]:
    """Return a place of a bar, and where it is in the drawing.

    The place is that of a point, a load, an end of a line or a mass centre. After it
    follow the bar's direction, rad, its first pin, m, and the vector from there to the
    place, m.
    Slopes of the pins are left out: a place moves against its bar as that was drawn.
    """
    stated = read_place(scene, path)
    if isinstance(stated, Bar):
        place = Place(BAR_NUMBERS[str(path[-1])], stated.mass_centre)
    else:
        place = stated.place
    drawing: Any = scene.drawing
    theta = angle(without_slopes(drawing.vector(place.bar)))
    pin = [*map(without_slopes, drawing.place(FIRST_PIN[place.bar]))]
    z = place.vector() * polar(1.0, theta)
    return place, theta, pin, [z.real, z.imag]


def read_place(value: Any, place: Sequence[str | int]) -> Any:
    """Read the number at a place; what a bar leaves out is that of a uniform one."""
    for name in place:
        if isinstance(name, int):
            value = value[name]
        elif isinstance(value, Bar):
            value = getattr(value, OF_A_UNIFORM_BAR.get(name, name))
        else:
            value = getattr(value, name)
    return value


def read_numbers(scene: Scene) -> dict[str, Any]:
    """Read the numbers that the scene states, by key.

    Numbers that are left to a uniform bar are left out.
    """
    return {
        key: read_number(scene, entry)
        for key, entry in list_entries(scene).items()
        if not entry.is_left_out
    }


def moves_before_pins(key: str, entry: SceneNumber) -> bool:
    """Return True for a number of a place: the pins of its bar move after it."""
    return ".from_pin." in key or entry.is_drawn_place


def replace_numbers(scene: Scene, numbers: Mapping[str, Any]) -> Scene:
    """Copy the scene with some of its numbers replaced, by key."""
    entries = list_entries(scene)
    places_first = sorted(
        numbers, key=lambda key: not moves_before_pins(key, entries[key])
    )
    changed = scene
    for key in places_first:
        changed = replace_number(changed, entries[key], numbers[key])
    return changed


def replace_place(holder: Any, place: Sequence[str | int], values: Any) -> Any:
    """Copy with one number replaced; what a constructor checks is not checked again."""
    if not place:
        return values
    name: Any = place[0]
    old = read_place(holder, [name])
    new = replace_place(old, place[1:], values)
    if isinstance(name, int):
        return (*holder[:name], new, *holder[name + 1 :])
    if hasattr(holder, "_replace"):  # a named tuple
        return holder._replace(**{name: new})
    copied = copy_with(holder, **{name: new})
    if isinstance(copied, Bar):
        return copy_with(copied, mass=copied.weigh())
    if isinstance(copied, Scene) and name == "drawing":
        return _follow_pins(copied, old)
    return copied


def _follow_pins(scene: Scene, drawn: DrawnPins) -> Scene:
    """Return the scene whose lengths and ground angle follow its moved pins.

        L' = |v'| + (L - |v|),   theta_1' = theta_1 + angle from v to v',

    v and v' from pin to pin of a bar, before and after. A length that was drawn within
    the rounding of a parallelogram's keeps its equality where no pin moves.

    `drawn`: the pins before the move.
    """
    moved = scene.drawing
    assert moved is not None
    followed = scene
    for bar, pins in ENDS.items():
        if all(getattr(moved, pin) is getattr(drawn, pin) for pin in pins):
            continue
        v = drawn.vector(bar)
        moved_v = moved.vector(bar)
        place = ["linkage", BAR_NAMES[bar]]
        if bar in MOVING_BARS:
            place.append("length")
        rounding = read_place(followed, place) - np.hypot(v.real, v.imag)
        length = np.hypot(moved_v.real, moved_v.imag) + rounding
        followed = replace_place(followed, place, length)
        if bar == 1:
            turned = angle(vector(dot(v, moved_v), sine(v, moved_v)))
            theta = followed.linkage.ground_angle + turned
            followed = replace_place(followed, ["linkage", "ground_angle"], theta)
            followed = _keep_drawn(followed, drawn, turned)
    return followed


def _keep_drawn(scene: Scene, drawn: DrawnPins, turned: Any) -> Scene:
    """Return the scene whose places on the ground stay in the drawing.

    `drawn`, `turned`: the pins before their move, and by how much it turned the ground.
    """
    assert scene.drawing is not None
    x, y = drawn.place("O2")
    to_x, to_y = scene.drawing.place("O2")
    back = vector(x - to_x, y - to_y) * polar(1.0, -angle(drawn.vector(1)))

    def keep(place: Place) -> Place:
        if place.bar != 1 or place.from_pin is None:
            return place
        z = place.vector() + back
        return place._replace(
            from_pin=(z.real, -turned), from_centre=(z.imag, 0.5 * np.pi - turned)
        )

    return scene.with_places(keep)
