"""A scene as the text of its file, in SI units and radians, with every digit.

The text reads back bit for bit.
"""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fourbar.effects import list_kinds
from fourbar.errors import InputError, expect
from fourbar.files.drawn_pins import choose_assembly, meet_lengths
from fourbar.files.fields import (
    write_described,
    write_quantity,
)
from fourbar.linkage import (
    BAR_NAMES,
    MOVING_BARS,
    Bar,
)
from fourbar.scene import Scene
from fourbar.scene.motion import (
    BRANCH_NAMES,
    FromLimit,
    Motion,
    Sweep,
)
from fourbar.studies.keys import OF_A_UNIFORM_BAR, find_misfit, list_entries
from fourbar.writing import write_text

SIGMA = "sigma"
"""Word of a tolerance that is a standard deviation."""
MOVING_BAR_NUMBERS = {BAR_NAMES[number]: number for number in MOVING_BARS}


def save(scene: Scene, path: str | Path) -> None:
    """Write a scene to a TOML file, atomically.

    Raises InputError as `dump` does, and for a picture that lies outside the file's
    folder.
    """
    expect("scene", scene, Scene)
    expect("path", path, str, Path)
    pictures = tuple(picture.moved(Path(path).parent) for picture in scene.pictures)
    traced = scene.picture and scene.picture.moved(Path(path).parent)
    write_text(path, dump(replace(scene, pictures=pictures, picture=traced)))


def dump(scene: Scene) -> str:
    """Write the scene as TOML text, in SI and radians.

    `loads` gives the same numbers back, bit for bit.

    Raises InputError for a scene that a file cannot hold: two effects of one kind, a
    title that is no valid text, a tolerance of a number that the scene leaves out or
    that exceeds it.
    """
    expect("scene", scene, Scene)
    words = {"title": scene.title, "source": scene.source}
    top = {name: text for name, text in words.items() if text}
    described = list_scene_tables(scene)
    motion = _write_motion(scene.motion)
    bars = described["bars"]
    for picture in scene.pictures:
        bars.setdefault(BAR_NAMES[picture.bar], {})["picture"] = picture.name
    pins_or_lengths = _write_lengths(scene, described["lengths"], motion)
    read_back = scene
    if "lengths" in dict(pins_or_lengths):
        read_back = replace(scene, drawing=None)
    traced = {}
    if scene.picture is not None:
        traced = write_described(scene.picture)
    tables: list[tuple[str, dict[str, Any]]] = [
        ("", top),
        *pins_or_lengths,
        *((f"bars.{name}", bars[name]) for name in MOVING_BAR_NUMBERS if name in bars),
        ("motion", motion),
        ("drive", described["drive"]),
        ("points", described["points"]),
        *(("[loads]", load) for load in described["loads"]),
        ("effects", described["effects"]),
        ("tolerances", _write_tolerances(read_back)),
        ("picture", traced),
    ]
    texts = []
    for name, entries in tables:
        if entries:
            lines = [f"[{name}]\n"] if name else []
            for key, value in entries.items():
                lines.append(f"{key} = {write_toml_value(key, value)}\n")
            texts.append("".join(lines))
    return "\n".join(texts)


def _write_lengths(
    scene: Scene,
    lengths: dict[str, Any],
    motion: dict[str, Any],
) -> list[tuple[str, dict[str, Any]]]:
    """Write the pins of a scene that still is as it was drawn, otherwise its lengths.

    Pins state the branch too.
    """
    drawing = scene.drawing
    if drawing is None:
        return [("lengths", lengths)]
    pins = write_described(drawing)
    drawn = (*meet_lengths(drawing, pins), drawing.angle(1))
    stated = (*scene.linkage.lengths, scene.linkage.ground_angle)
    motion_drawn = choose_assembly(scene, drawing).motion if drawn == stated else None
    if motion_drawn is None or motion_drawn.branch != scene.motion.branch:
        return [("lengths", lengths)]
    del motion["branch"]
    return [("pins", pins)]


def list_scene_tables(scene: Scene) -> dict[str, Any]:
    """Write lengths, bars, drive, points, loads and effects as a file's tables.

    A bar that states nothing is left out.

    Raises InputError where a file cannot hold the effects.
    """
    for effect in scene.effects:
        kind = type(effect)
        if list_kinds().get(effect.key) is not kind:
            allowed = "a scene file cannot state this effect"
            raise InputError(f"effects.{effect.key}", kind.__name__, allowed)
    keys = [effect.key for effect in scene.effects]
    if len(set(keys)) < len(keys):
        allowed = "a scene file holds one effect of each kind"
        raise InputError("effects", keys, allowed)
    linkage = scene.linkage
    lengths = dict[str, Any]()
    for name, length in zip(BAR_NAMES.values(), linkage.lengths, strict=True):
        lengths[name] = write_quantity(length, "m")
    lengths["ground_angle"] = write_quantity(linkage.ground_angle, "rad")
    bars = {}
    for name, number in MOVING_BAR_NUMBERS.items():
        bar = linkage.bar(number)
        numbers = write_described(bar)
        del numbers["length"]
        if bar.density is not None:  # which states the mass
            del numbers["mass"]
        # what a uniform bar has follows from the numbers before it
        last = {key: numbers.pop(key) for key in OF_A_UNIFORM_BAR if key in numbers}
        if bar != Bar(bar.length):
            bars[name] = numbers | last
    drive = {"bar": scene.drive_bar}
    return {
        "lengths": lengths,
        "bars": bars,
        "drive": drive if scene.drive is None else write_described(scene.drive),
        "points": {point.name: write_described(point) for point in scene.points},
        "loads": [*map(write_described, scene.loads)],
        "effects": {effect.key: write_described(effect) for effect in scene.effects},
    }


def _write_motion(motion: Motion) -> dict[str, Any]:
    stated: dict[str, Any] = {}
    if motion.law is not None:
        stated["law"] = write_described(motion.law)
    else:
        for name in motion.names:
            value = getattr(motion, name)
            unit = motion.numbers[name].unit
            if isinstance(value, Sweep):
                start = write_quantity(value.start, unit)
                stop = write_quantity(value.stop, unit)
                stated[name] = {"from": start, "to": stop, "steps": value.steps}
            elif isinstance(value, FromLimit):
                stated[name] = write_described(value)
            elif isinstance(value, np.ndarray):
                stated[name] = [write_quantity(number, unit) for number in value]
            elif value is not None:
                stated[name] = write_quantity(value, unit)
    stated["branch"] = BRANCH_NAMES[motion.branch]
    if motion.side is not None:
        stated["side"] = motion.side
    if motion.free is not None:
        stated["free"] = write_described(motion.free)
    return stated


def write_toml_value(key: str, value: object) -> str:
    """Write a TOML value; strings escape as in JSON, and DEL too."""
    if isinstance(value, dict):
        pairs = (f"{name} = {write_toml_value(key, x)}" for name, x in value.items())
        return f"{{ {', '.join(pairs)} }}"
    if isinstance(value, list):
        # one line each where there are many: no line has more than MOST_DOTS_OF_A_LINE
        between = ", " if len(value) <= 3 else ",\n  "
        return f"[{between.join(write_toml_value(key, entry) for entry in value)}]"
    if not isinstance(value, str):
        return repr(value)
    try:
        value.encode("utf-8")
    except UnicodeEncodeError:
        raise InputError(key, value, "must be valid Unicode text") from None
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _write_tolerances(scene: Scene) -> dict[str, Any]:
    """Write the table of tolerances in their order.

    Dotted keys would not keep it: TOML gathers their tables.

    Raises InputError for a tolerance that reading the file would refuse.
    """
    entries = list_entries(scene)
    rows = dict[str, Any]()
    for tolerance in scene.tolerances:
        key = tolerance.key
        if key not in entries:
            allowed = "no number of the scene has this key"
            raise InputError("tolerances", key, allowed)
        width = write_quantity(tolerance.width, entries[key].unit)
        if (misfit := find_misfit(scene, entries[key], tolerance)) is not None:
            raise InputError(f"tolerances.{key}", width, misfit)
        rows[json.dumps(key)] = [width, SIGMA] if tolerance.sigma else width
    return rows
