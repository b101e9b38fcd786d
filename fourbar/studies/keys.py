"""The numbers of a scene by their keys in its file, and scenes of arrays of them."""

from collections.abc import Collection, Mapping
from difflib import get_close_matches
from typing import Any, NamedTuple

import numpy as np

from fourbar.effects import Gravity, Springs
from fourbar.effects.effect import PinRows
from fourbar.effects.place import STATED_PLACES
from fourbar.errors import InputError, expect, write_in_units
from fourbar.formulas.arithmetic import angle, dot, sine, vector
from fourbar.linkage import (
    ANY_NUMBER,
    AT_LEAST_ZERO,
    BAR_NAMES,
    ENDS,
    MOVING_BARS,
    PINS,
    POSITIVE,
    Bar,
    Declared,
    FourBar,
    copy_with,
)
from fourbar.scene import Scene
from fourbar.scene.drawing import DrawnPins
from fourbar.scene.numbers import PIN_COORDINATE, Tolerance

COMMAND_KEYS = ("motion.theta_2", "motion.theta_3", "motion.theta_4", "motion.stroke")
"""Keys of the commanded angle or stroke."""
_SAME_FOR_ALL = (
    *(
        "title",
        "source",
        "drive",
        "bar",
        "branch",
        "free",
        "law",
        "frame",
        "table",
        "picture",
    ),
    *("from", "to", "steps", "limit", "offset"),
)
"""Parts of keys that name no number. They name a word, a whole number, or what has
another form in a study.
"""
_BY_MATERIAL = ("density", "section", "diameter")
"""Numbers of a bar that are varied only where the scene states them."""
_LENGTH_OF_BAR = {bar: f"lengths.{name}" for bar, name in BAR_NAMES.items()}
_GROUND_ANGLE = "lengths.ground_angle"
NumberPath = tuple[str | int, ...]
"""Attributes and indices that lead from a scene to one of its numbers."""


class SceneNumber(NamedTuple):
    """One number of a scene."""

    place: NumberPath
    unit: str
    bound: str = ANY_NUMBER

    def holds(self, values: Any) -> Any:
        """Mark the numbers that a scene would accept."""
        low = {ANY_NUMBER: True, AT_LEAST_ZERO: values >= 0.0, POSITIVE: values > 0.0}[
            self.bound
        ]
        return np.isfinite(values) & low


def _list_entries(
    description: Any,
    key: str,
    place: NumberPath,
) -> dict[str, SceneNumber]:
    """List the entries of the numbers that a description states.

    A magnitude and its angle are two.
    """
    entries = dict[str, SceneNumber]()
    for name, stated in description.numbers.items():
        if stated.pair:
            entries |= _make_pair(f"{key}.{name}", (*place, name), stated)
        else:
            entries[f"{key}.{name}"] = SceneNumber((*place, name), *stated[:2])
    return entries


def _make_pair(
    key: str,
    place: NumberPath,
    by: Declared,
    names: tuple[str | int, str | int] = (0, 1),
) -> dict[str, SceneNumber]:
    """Make the two entries of a pair, mostly a magnitude with its angle."""
    parts = zip(names, by.units, by.bounds, strict=True)
    return {
        f"{key}.{index}": SceneNumber((*place, name), unit, bound)
        for index, (name, unit, bound) in enumerate(parts)
    }


def _list_effect(effect: Any, key: str, place: NumberPath) -> dict[str, SceneNumber]:
    """List the entries of an effect under its key, at its place."""
    if isinstance(effect, Gravity):
        of_gravity = effect.numbers["magnitude"]._replace(pair="rad")
        return _make_pair(key, place, of_gravity, ("magnitude", "angle"))
    if isinstance(effect, PinRows):
        return {
            f"{key}.{row[0]}.{name}".removesuffix("."): SceneNumber(
                (*place, effect.field, index, column), *declared[:2]
            )
            for index, row in enumerate(effect.rows)
            for column, (name, declared) in enumerate(effect.numbers.items(), 1)
        }
    if not isinstance(effect, Springs):
        return _list_entries(effect, key, place)
    entries = dict[str, SceneNumber]()
    for index, spring in enumerate(effect.springs):
        spring_place = (*place, "springs", index)
        entries |= _list_entries(spring, f"{key}.{index}", spring_place)
        entries |= _list_ends(spring, f"{key}.{index}", spring_place)
    return entries


def _list_ends(line: Any, key: str, place: NumberPath) -> dict[str, SceneNumber]:
    """List the entries of both ends of a line between two bars."""
    entries = dict[str, SceneNumber]()
    for name, end in (("from", "start"), ("to", "end")):
        entries |= _list_place(getattr(line, end), f"{key}.{name}", (*place, end))
    return entries


def _list_drive(drive: Any) -> dict[str, SceneNumber]:
    """List the entries of a drive that exerts a force."""
    if drive.has_stroke:
        return _list_ends(drive, "drive", ("drive",))
    place = _list_place(drive.place, "drive", ("drive", "place"))
    return place | {"drive.direction": SceneNumber(("drive", "direction"), "rad")}


def _list_place(stated: Any, key: str, place: NumberPath) -> dict[str, SceneNumber]:
    """List the entries of the form in which a place is stated.

    A named point has its entries elsewhere.
    """
    entries = dict[str, SceneNumber]()
    for name, declared in STATED_PLACES.items():
        if getattr(stated, name) is not None:
            entries |= _make_pair(f"{key}.{name}", (*place, name), declared)
    return entries


def _list_bar(bar: Bar, number: int) -> dict[str, SceneNumber]:
    """List the entries of a moving bar.

    Its cross-section is as it is stated; with a density there is no mass.
    """
    entries = _list_entries(Bar, "", ("linkage", BAR_NAMES[number]))
    absent = {name for name in _BY_MATERIAL if getattr(bar, name) is None}
    if bar.density is not None:
        absent.add("mass")
    return {
        key: entry for key, entry in entries.items() if entry.place[2] not in absent
    }


def _list_pins() -> dict[str, SceneNumber]:
    """List the coordinates of the drawn pins."""
    return {
        f"pins.{pin}.{axis}": SceneNumber(("drawing", pin, axis), PIN_COORDINATE.unit)
        for pin in PINS
        for axis in (0, 1)
    }


def list_entries(scene: Scene) -> dict[str, SceneNumber]:
    """List the numbers of a scene that a study varies, by key.

    Coordinates of drawn pins come first, then lengths. What is commanded is not among
    them.
    """
    of_ground = _list_entries(FourBar, "lengths", ("linkage",))
    bars = {
        BAR_NAMES[bar]: _list_bar(scene.linkage.bar(bar), bar) for bar in MOVING_BARS
    }
    lengths = {
        f"lengths.{name}": numbers.pop(".length") for name, numbers in bars.items()
    }
    if scene.drawing is None:
        entries = dict[str, SceneNumber]()
    else:
        entries = _list_pins()
    entries |= {"lengths.ground": of_ground["lengths.ground"], **lengths, **of_ground}
    entries |= {
        f"bars.{name}{key}": number
        for name, numbers in bars.items()
        for key, number in numbers.items()
    }
    if scene.motion.law is None:
        for field, name in zip(
            ("speed", "acceleration"),
            scene.motion.names[1:],
            strict=True,
        ):
            entries[f"motion.{name}"] = SceneNumber(
                ("motion", field), scene.motion.numbers[name].unit
            )
    if scene.drive is not None:
        entries |= _list_drive(scene.drive)
    for index, load in enumerate(scene.loads):
        numbers = _list_entries(load, f"loads.{index}", ("loads", index))
        entries |= {
            key: entry
            for key, entry in numbers.items()
            if getattr(load, str(entry.place[2])) is not None
        }
    for index, point in enumerate(scene.points):
        entries |= _list_place(point, point.key, ("points", index))
    for index, effect in enumerate(scene.effects):
        entries |= _list_effect(effect, f"effects.{effect.key}", ("effects", index))
    return entries


def command_key(scene: Scene) -> str:
    """Return the key of what is commanded."""
    return f"motion.{scene.motion.commanded}"


def refuse_key(key: str, value: object, keys: list[str]) -> InputError:
    """Make the error for a key that a study cannot vary."""
    expect("key", key, str)
    names_a_pin = key.split(".", maxsplit=1)[0] == "pins"
    if names_a_pin and not any(name.startswith("pins.") for name in keys):
        lengths = ", ".join(name for name in keys if name.startswith("lengths."))
        return InputError(
            key, value, f"the scene has no [pins]; it states lengths: {lengths}"
        )
    inner = [name for name in keys if name.startswith(f"{key}.")]
    if inner:
        return InputError(
            key, value, "is more than one number; vary " + ", ".join(inner)
        )
    if any(part in _SAME_FOR_ALL for part in key.split(".")):
        return InputError(
            key,
            value,
            "is the same for every member of a study: only numbers vary, theta_2 as"
            " angles",
        )
    close = get_close_matches(key, keys, 1, 0.0)
    return InputError(key, value, f'unknown key; did you mean "{close[0]}"?')


def find_overlap(keys: Collection[str]) -> tuple[str, str] | None:
    """Return the key of a length and that of a pin by which the length follows.

    None: the keys state no length twice.
    """
    ends = {_LENGTH_OF_BAR[bar]: pins for bar, pins in ENDS.items()}
    ends[_GROUND_ANGLE] = ENDS[1]
    for length, pins in ends.items():
        if length not in keys:
            continue
        for key in keys:
            if key.startswith(tuple(f"pins.{pin}." for pin in pins)):
                return length, key
    return None


LEFT_OUT = (
    "is left out of the scene and follows the length; state it to give it a tolerance"
)


def _is_left_out(scene: Scene, entry: SceneNumber) -> bool:
    """Return True if the scene leaves a number to a uniform bar."""
    if entry.place[0] != "linkage" or len(entry.place) < 3:
        return False
    bar = getattr(scene.linkage, str(entry.place[1]))
    return getattr(bar, str(entry.place[2])) is None


def find_misfit(scene: Scene, entry: SceneNumber, tolerance: Tolerance) -> str | None:
    """Say why a number of a scene cannot have a tolerance; None: it can.

    Its file and its samples need one.
    """
    if _is_left_out(scene, entry):
        return LEFT_OUT
    number = read_place(scene, entry.place)
    if number is None:
        return (
            "is the tolerance of a number that the scene leaves out: state the number "
            "first"
        )
    if entry.bound != ANY_NUMBER and tolerance.reach >= number:
        if tolerance.sigma:
            three = "three sigma of it "
        else:
            three = ""
        itself = write_in_units(entry.unit, number)
        return f"{three}must be less than the number itself, {itself}"
    return None


def read_place(value: Any, place: NumberPath) -> Any:
    """Read the number at a place; what a bar leaves out is that of a uniform one."""
    for name in place:
        if isinstance(name, int):
            value = value[name]
        elif isinstance(value, Bar) and getattr(value, name) is None:
            value = {"inertia": value.moment_of_inertia, "centre": value.mass_centre}[
                name
            ]
        else:
            value = getattr(value, name)
    return value


def read_numbers(scene: Scene) -> dict[str, Any]:
    """Read the numbers that the scene states, by key.

    What it leaves to a uniform bar is left out.
    """
    return {
        key: read_place(scene, entry.place)
        for key, entry in list_entries(scene).items()
        if not _is_left_out(scene, entry)
    }


def replace_numbers(scene: Scene, numbers: Mapping[str, Any]) -> Scene:
    """Copy the scene with some of its numbers replaced, by key."""
    entries = list_entries(scene)
    changed = scene
    for key, number in numbers.items():
        changed = replace_place(changed, entries[key].place, number)
    return changed


def replace_place(holder: Any, place: NumberPath, values: Any) -> Any:
    """Copy with one number replaced; what a constructor checks is not checked again."""
    if not place:
        return values
    name, *rest = place
    if isinstance(name, int):
        parts = [
            replace_place(part, tuple(rest), values) if i == name else part
            for i, part in enumerate(holder)
        ]
        return tuple(parts)
    if isinstance(holder, tuple):  # a named tuple
        tuple_of_names: Any = holder
        return tuple_of_names._replace(
            **{name: replace_place(getattr(tuple_of_names, name), tuple(rest), values)}
        )
    old = getattr(holder, name)
    if isinstance(holder, Bar) and name == "centre" and old is None:
        old = holder.mass_centre
    new = copy_with(holder, **{name: replace_place(old, tuple(rest), values)})
    if isinstance(new, Bar):
        return copy_with(new, mass=new.weigh())
    if isinstance(new, Scene) and name == "drawing":
        return _follow_pins(new, old)
    return new


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
        place: NumberPath = ("linkage", "ground")
        if bar in MOVING_BARS:
            place = ("linkage", BAR_NAMES[bar], "length")
        rounding = read_place(followed, place) - np.hypot(v.real, v.imag)
        length = np.hypot(moved_v.real, moved_v.imag) + rounding
        followed = replace_place(followed, place, length)
        if bar == 1:
            turned = angle(vector(dot(v, moved_v), sine(v, moved_v)))
            ground_angle = followed.linkage.ground_angle + turned
            place = ("linkage", "ground_angle")
            followed = replace_place(followed, place, ground_angle)
    return followed
