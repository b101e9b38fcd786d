"""A scene as the text of its file: SI and radians, every digit, so that it reads back bit for bit."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fourbar.effects import Load
from fourbar.errors import InputError, expect
from fourbar.files.effects import written
from fourbar.files.fields import polar, quantity
from fourbar.linkage import BAR_NAMES, MOVING_BARS, Bar
from fourbar.scene import Scene
from fourbar.scene.motion import BRANCH_NAMES, FromLimit, Motion, Sweep
from fourbar.writing import write_text

BRANCHES = {name: branch for branch, name in BRANCH_NAMES.items()}
BARS = {BAR_NAMES[number]: number for number in MOVING_BARS}


def save(scene: Scene, path: str | Path) -> None:
    """Write a scene to a TOML file, whole or not at all.

    Raises InputError as `dump` does, and for a picture that lies outside the file's folder.
    """
    expect("scene", scene, Scene)
    expect("path", path, str, Path)
    pictures = tuple(picture.moved(Path(path).parent) for picture in scene.pictures)
    write_text(path, dump(replace(scene, pictures=pictures)))


def dump(scene: Scene) -> str:
    """The scene as TOML text, in SI and radians; `loads` gives the same numbers back, bit for bit.

    Raises InputError for a scene that a file cannot hold: two effects of one kind, a title that is
    no valid text.
    """
    expect("scene", scene, Scene)
    linkage, motion = scene.linkage, scene.motion
    top = {"title": scene.title, "source": scene.source}
    parts = [_table("", {key: value for key, value in top.items() if value})]
    lengths: dict[str, Any] = {
        BAR_NAMES[number]: quantity(length, "m") for number, length in enumerate(linkage.lengths, 1)
    }
    lengths["ground_angle"] = quantity(linkage.ground_angle, "rad")
    parts.append(_table("lengths", lengths))
    for name, number in BARS.items():
        bar, entry = linkage.bar(number), dict[str, Any]()
        if bar != Bar(bar.length):
            entry = {"mass": quantity(bar.mass, "kg")}
            if bar.inertia is not None:
                entry["inertia"] = quantity(bar.inertia, "kg m^2")
            if bar.centre is not None:
                entry["centre"] = polar(*bar.centre, "m")
        for picture in scene.pictures:
            if picture.bar == number:
                entry["picture"] = picture.name
        parts.append(_table(f"bars.{name}", entry))
    parts.append(_table("motion", _motion_entry(motion)))
    parts.append(_table("drive", {"bar": scene.drive_bar}))
    points: dict[str, Any] = {
        point.name: {"bar": point.bar, "from_pin": polar(*point.from_pin, "m")} for point in scene.points
    }
    parts.append(_table("points", points))
    parts += [_table("[loads]", _load_entry(load)) for load in scene.loads]
    effects = {effect.key: written(effect) for effect in scene.effects}
    if len(effects) != len(scene.effects):
        raise InputError("effects", [effect.key for effect in scene.effects], "a file holds one of each kind")
    parts.append(_table("effects", effects))
    if scene.tolerances:
        from fourbar.files.tolerances import written_tolerances

        parts.append(_table("tolerances", written_tolerances(scene)))
    return "\n".join(part for part in parts if part)


def _motion_entry(motion: Motion) -> dict[str, Any]:
    entry: dict[str, Any] = {}
    wanted = motion.theta_2
    if isinstance(wanted, Sweep):
        ends = {"from": quantity(wanted.start, "rad"), "to": quantity(wanted.stop, "rad")}
        entry["theta_2"] = {**ends, "steps": wanted.steps}
    elif isinstance(wanted, FromLimit):
        entry["theta_2"] = {"limit": wanted.limit, "offset": quantity(wanted.offset, "rad")}
    elif isinstance(wanted, np.ndarray):
        entry["theta_2"] = [quantity(angle, "rad") for angle in wanted.tolist()]
    elif wanted is not None:
        entry["theta_2"] = quantity(wanted, "rad")
    if motion.omega_2 is not None:
        entry["omega_2"] = quantity(motion.omega_2, "rad/s")
    if motion.law is None:
        entry["alpha_2"] = quantity(motion.alpha_2, "rad/s^2")
    else:
        law = motion.law
        entry["law"] = {
            "time": [quantity(time, "s") for time in law.time],
            "theta_2": [quantity(angle, "rad") for angle in law.theta_2],
            "steps": law.steps,
            "ends": law.ends,
        }
    entry["branch"] = BRANCH_NAMES[motion.branch]
    entry["through"] = motion.through
    if motion.free is not None:
        entry["free"] = {"duration": quantity(motion.free.duration, "s"), "steps": motion.free.steps}
    return entry


def _load_entry(load: Load) -> dict[str, Any]:
    entry: dict[str, Any] = {"bar": load.bar}
    if load.force is not None:
        entry["force"] = polar(*load.force, "N")
        entry["at"] = polar(*load.at, "m")
    entry |= {"moment": quantity(load.moment, "N m"), "frame": load.frame}
    if load.table is not None:
        angles = [quantity(angle, "rad") for angle in load.table.theta_2]
        entry["table"] = {"theta_2": angles, "factor": list(load.table.factor)}
    return entry


def _table(name: str, entries: dict[str, Any]) -> str:
    """One TOML table, nothing where it is empty."""
    if not entries:
        return ""
    heading = f"[{name}]\n" if name else ""
    return heading + "".join(f"{key} = {_value(key, value)}\n" for key, value in entries.items())


def _value(key: str, value: object) -> str:
    """A TOML value; strings escape as in JSON, and DEL too."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{name} = {_value(key, entry)}" for name, entry in value.items()) + " }"
    if isinstance(value, list):
        # one line each where there are many, so that no line holds more than MOST_DOTS
        between = ", " if len(value) <= 3 else ",\n  "
        return "[" + between.join(_value(key, entry) for entry in value) + "]"
    if not isinstance(value, str):
        return repr(value)
    try:
        value.encode("utf-8")
    except UnicodeEncodeError:
        raise InputError(key, value, "must be valid Unicode text") from None
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
