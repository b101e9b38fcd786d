"""Scene files: TOML with units <-> Scene, checked entry by entry.

Numbers are rounded once when they are read; what is written reads back bit for bit.
"""

import math
import re
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import IO, Any

import numpy as np

from fourbar import writing
from fourbar.effects import (
    ForceDrive,
    LinearDrive,
    Load,
    PointDrive,
    list_kinds,
)
from fourbar.effects.place import settler
from fourbar.errors import InputError, expect
from fourbar.files.drawn_pins import (
    DrawnGround,
    choose_assembly,
    find_side_of_cylinder,
    list_drawn,
    meet_lengths,
    read_drawing,
    read_ground,
    state_places,
)
from fourbar.files.fields import BARE_KEY, PLACES_OF_ENDS, Reader, list_keys
from fourbar.files.scene_text import MOVING_BAR_NUMBERS, SIGMA
from fourbar.formulas.mobility import meet_change_points
from fourbar.linkage import (
    BAR_NAMES,
    MOST_INTERVALS,
    POSITIVE,
    Bar,
    Declared,
    FourBar,
)
from fourbar.quantities import Array
from fourbar.quantities.units import half_unit_of_text
from fourbar.scene import Scene
from fourbar.scene.drawing import DRAWN_WORD, DrawnPins
from fourbar.scene.motion import (
    BAR_OF_ANGLE,
    BRANCH_OF_NAME,
    DEFAULT_STEPS,
    LAW_KINDS,
    SIDES,
    SINE_LAW,
    STROKE_COMMAND,
    Free,
    FromLimit,
    Law,
    Motion,
    Rise,
    Sine,
    Sweep,
)
from fourbar.scene.numbers import Point, Tolerance
from fourbar.scene.pictures import Picture, TracedPicture
from fourbar.studies.keys import (
    COMMAND_KEYS,
    find_misfit,
    find_overlap,
    list_entries,
    refuse_key,
)

LARGEST_SCENE_FILE = 500_000
"""Bytes; a scene takes about a thousand."""
MOST_DOTS_OF_A_LINE = 100
"""Largest number of dots in one line. The TOML reader's time grows with the square of a
dotted key's parts.
"""
LONGEST_SHOWN_LINE = 60
"""Characters shown of a line that cannot be read."""
_MOST_LOADS = 1000
"""Limit of the loads, each of which is a term at every position."""
SCENE_TABLES = (
    "title",
    "source",
    "lengths",
    "pins",
    "bars",
    "motion",
    "drive",
    "points",
    "loads",
    "effects",
    "tolerances",
    "picture",
)
_A_GIVEN_DRIVE = (
    "a drive is what is solved for; a torque or force that is given is a load"
    " ([[loads]]), which moves the linkage with motion.free"
)
_OVER_THETA_2 = (
    "a load follows theta_2, not time: at one speed theta_2 is omega_2 t; a torque over"
    " time that moves the linkage is for a simulator (fourbar mjcf SCENE --drive motor)"
)
_LIKE_A_SWEEP = re.compile(r"\d[^\d]*(\bto\b|\.\.|:|;)\s*-?\d")
_A_LINE = "a drive along a line has from and to alone"
_A_POINT = "a force acts at a place: state point, from_pin or from_centre"
_PICTURE = {
    "scale": Declared("m", POSITIVE, None),
    "angle": Declared("rad", left_out=0.0),
    "opacity": Declared("1", left_out=0.5),
}
"""Numbers of the picture under the drawing."""
MOST_POINTS_OF_A_SCENE = 1000
"""Limit of the points, each of which is three columns of every table."""


def load(path: str | Path | IO[str] | IO[bytes]) -> Scene:
    """Read the scene of a TOML file, of standard input (`-`), a pipe or an open file.

    Raises InputError, in one line with file, key, value and what is allowed, for a file
    that is missing, not a file, too large, not text or not TOML, and for every entry
    that is wrong.
    """
    if isinstance(path, str | Path):
        return loads(read_scene_text(path), str(path))
    if not hasattr(path, "read"):
        expect("path", path, str, Path)
    name = getattr(path, "name", None)
    shown = name if isinstance(name, str) else "stream"
    content = path.read(LARGEST_SCENE_FILE + 1)
    if len(content) > LARGEST_SCENE_FILE:
        allowed = f"must not exceed {LARGEST_SCENE_FILE} bytes"
        raise InputError("scene file", shown, allowed)
    if isinstance(content, bytes):
        try:
            content = content.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            allowed = f"must be UTF-8 text; byte {error.start} is not"
            raise InputError("scene file", shown, allowed) from None
    return loads(content.replace("\r\n", "\n"), shown)


def read_scene_text(path: str | Path) -> str:
    """Read the text of a scene file, of standard input for `-`, or of a pipe."""
    return writing.read_text(path, "scene file", LARGEST_SCENE_FILE, pipes=True)


def loads(text: str, name: str = "scene") -> Scene:
    """Read the scene of a TOML text.

    `name`: stands for the file in errors; pictures lie in its folder.
    """
    return read_tables(parse_tables(text, name), name)


def parse_tables(text: str, name: str) -> dict[str, Any]:
    """Parse the TOML text of a scene; InputError where it is none.

    `name`: as `loads` has it.
    """
    shown = _write_name(name)
    for number, line in enumerate(text.split("\n"), 1):
        if line.count(".") > MOST_DOTS_OF_A_LINE:
            allowed = f"line {number} holds more than {MOST_DOTS_OF_A_LINE} dots"
            raise InputError("TOML", line[:40], allowed, shown)
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise InputError("TOML", "...", "is nested too deeply", shown) from None
    except ValueError as error:  # TOMLDecodeError, and numbers that Python refuses
        raise _explain_unreadable(text, str(error), shown) from None


def read_tables(document: dict[str, Any], name: str = "scene") -> Scene:
    """Read the scene of the tables of a file.

    `name`: as `loads` has it.
    """
    shown = _write_name(name)
    try:
        return read_scene(Reader(shown, document), document, str(Path(name).parent))
    except InputError as error:
        raise (error if error.file else error.in_file(shown)) from None


def _write_name(name: str) -> str:
    return name if name.isprintable() else repr(name)


_UNQUOTED = re.compile(r"[=,\[{]\s*([+-]?\.?[0-9][0-9.]*\s*[A-Za-z°µ][^\",#\]}]*)")
"""9 in, where "9 in" is meant."""
PLACE = re.compile(r" \(at (?:line (\d+), column (\d+)|end of document)\)$")


def _explain_unreadable(text: str, reason: str, shown: str) -> InputError:
    """Make the error for what the TOML reader stumbles over, with its line."""
    place = PLACE.search(reason)
    lines = text.split("\n")
    if place is None:
        allowed = f"cannot be read: {' '.join(reason.split())[:120]}"
        return InputError("TOML", text[:LONGEST_SHOWN_LINE], allowed, shown)
    line = int(place[1] or len(lines))
    column = int(place[2] or len(lines[-1]) + 1)
    start = max(0, column - 1 - LONGEST_SHOWN_LINE // 2)
    value = lines[line - 1][start : start + LONGEST_SHOWN_LINE].strip()
    why = " ".join(reason[: place.start()].split())[:120]
    for bare in _UNQUOTED.finditer(lines[line - 1]):
        if bare.start(1) < column <= bare.end(1) + 1:
            number = bare[1].strip()[:LONGEST_SHOWN_LINE]
            why = f'a number with a unit stands in quotes, like "{number}"'
    key = f"line {line}, column {column}"
    return InputError(key, value, f"cannot be read as TOML: {why}", shown)


def read_scene(read: Reader, document: dict[str, Any], folder: str) -> Scene:
    """Read the scene of a file's tables; `folder`: of its pictures."""
    top = dict(read.table("", document, SCENE_TABLES))
    drawing = read_drawing(read, top)
    drawn = drawing or read_ground(read, top.get("lengths"))
    for key in top.keys() - {"pins", "lengths"}:
        top[key] = state_places(read, key, top[key], drawn)
    points = _read_points(read, top.get("points", {}))
    read.bars = {point.name: point.bar for point in points}
    drive_bar, drive = _read_drive(read, top.get("drive", {}))
    entries = top.get("loads", [])
    if not isinstance(entries, list) or len(entries) > _MOST_LOADS:
        allowed = f"must be written as [[loads]], at most {_MOST_LOADS}"
        raise read.refuse("loads", entries, allowed)
    effects = read.table("effects", top.get("effects", {}), list_kinds())
    lengths, met = _read_lengths(read, top, drawn)
    bars = top.get("bars", {})
    linkage = _read_linkage(read, bars, met, drawn.angle(1))
    pictures = []
    for name, bar in MOVING_BAR_NUMBERS.items():
        if "picture" in bars.get(name, {}):  # its file is read when it is shown
            text = read.text(f"bars.{name}.picture", bars[name]["picture"])
            pictures.append(Picture(bar, text, folder))
    settled = drive and drive.with_places(settler(linkage, points))
    scene = Scene(
        linkage,
        _read_motion(read, top.get("motion", {}), drawing, settled),
        drive_bar,  # type: ignore[arg-type]
        tuple(
            _read_load(read, f"loads[{index}]", entry)
            for index, entry in enumerate(entries)
        ),
        tuple(_read_effect(read, key, value) for key, value in effects.items()),
        read.text("title", top.get("title", "")),
        read.text("source", top.get("source", "")),
        tuple(pictures),
        points,
        drive=drive,
        drawing=drawing,
        picture=_read_traced(read, top.get("picture"), folder),
    )
    if drawing is not None:
        scene = choose_assembly(scene, drawing)
    return replace(
        scene,
        coordinates=tuple(read.coordinates.items()),
        met_lengths=None if met == lengths else (lengths, met),
        tolerances=_read_tolerances(read, scene, top.get("tolerances", {})),
    )


def _read_drive(read: Reader, value: object) -> tuple[int | None, ForceDrive | None]:
    """Read the bar on which a couple acts, or a force along a line or at a place."""
    if isinstance(value, dict):
        for name in ("torque", "moment", "force"):
            if name in value:
                raise read.refuse(f"drive.{name}", value[name], _A_GIVEN_DRIVE)
    on_line = list_keys(LinearDrive)
    allowed = dict.fromkeys(("bar", *on_line, *list_keys(PointDrive)))
    entry = read.table("drive", value, allowed)
    stated = entry.keys()
    kind: Any = PointDrive
    if not stated.isdisjoint(on_line):
        kind = LinearDrive
        for name in stated - {*on_line}:
            raise read.refuse(f"drive.{name}", entry[name], _A_LINE)
    elif stated <= {"bar"}:
        return read.bar("drive.bar", entry.get("bar", 2)), None
    elif stated.isdisjoint(PLACES_OF_ENDS):
        read.bar("drive.bar", entry.get("bar"))
        raise read.refuse("drive.point", None, _A_POINT)
    return None, read.described("drive", entry, kind)


def _read_points(read: Reader, value: object) -> tuple[Point, ...]:
    if not isinstance(value, dict) or len(value) > MOST_POINTS_OF_A_SCENE:
        allowed = f"must be a table of points, at most {MOST_POINTS_OF_A_SCENE}"
        raise read.refuse("points", value, allowed)
    points = []
    for name, point in value.items():
        key = f"points.{name}" if BARE_KEY.fullmatch(name) else "points"
        points.append(read.described(key, point, Point, name=name))
    return tuple(points)


def _read_traced(read: Reader, value: object, folder: str) -> TracedPicture | None:
    """Read the picture under the drawing; its file is read when it is shown."""
    if value is None:
        return None
    entry = read.table("picture", value, ("file", "origin", *_PICTURE))
    origin = entry.get("origin")
    if origin is not None:
        if not isinstance(origin, list) or len(origin) != 2:
            raise read.refuse("picture.origin", origin, "must be a pixel [x, y]")
        x, y = (read.number("picture.origin", number) for number in origin)
        origin = (x, y)
    numbers = read.numbers("picture", entry, _PICTURE)
    name = read.text("picture.file", entry.get("file"))
    return TracedPicture(name, origin, folder=folder, **numbers)


def _read_lengths(
    read: Reader, top: dict[str, Any], drawn: DrawnPins | DrawnGround
) -> tuple[Any, Any]:
    """Read the lengths of ground, input, coupler and output, m.

    Return them as they are stated, and with the equalities of change points that their
    last decimals miss.
    """
    if isinstance(drawn, DrawnPins):
        return tuple(map(drawn.length, BAR_NAMES)), meet_lengths(drawn, top["pins"])
    names = tuple(BAR_NAMES.values())
    allowed = (*names, "ground_angle")
    stated = dict(read.table("lengths", top.get("lengths", {}), allowed))
    if drawn.length is not None:
        # with every digit: lengths are compared within those that are stated
        stated["ground"] = f"{drawn.length:.16e} m"
    declared = dict.fromkeys(names, Bar.numbers["length"])
    lengths: Any = tuple(read.numbers("lengths", stated, declared).values())
    if not math.isfinite(sum(lengths)):  # refused where they are put together
        return lengths, lengths
    roundings: Any = tuple(half_unit_of_text(stated[name], "m") for name in names)
    return lengths, meet_change_points(lengths, roundings)


def _read_linkage(
    read: Reader, value: object, lengths: tuple[float, ...], angle: float
) -> FourBar:
    tables = read.table("bars", value, MOVING_BAR_NUMBERS)
    ground, *moving = lengths
    two, three, four = (
        _read_bar(read, f"bars.{name}", tables.get(name, {}), length)
        for name, length in zip(MOVING_BAR_NUMBERS, moving, strict=True)
    )
    return FourBar(ground, two, three, four, angle)


def _read_bar(read: Reader, key: str, value: object, length: float) -> Bar:
    declared = dict(Bar.numbers)
    del declared["length"]
    entry = read.table(key, value, (*declared, "picture"))
    numbers = read.numbers(key, entry, declared)
    inertia = numbers["mass"] * length * length
    if numbers["inertia"] is None and not math.isfinite(inertia):
        allowed = "must leave the inertia m L^2/12 a finite number"
        raise read.refuse(f"{key}.mass", entry.get("mass"), allowed)
    try:
        return Bar(length, **numbers)
    except InputError as error:  # which knows of one bar alone
        value = entry.get(error.key)
        raise read.refuse(f"{key}.{error.key}", value, error.allowed) from None


def _read_motion(
    read: Reader, value: object, drawing: DrawnPins | None, drive: ForceDrive | None
) -> Motion:
    """Read the motion, in which the word "drawn" stands for the numbers of a drawing.

    A side that is left out of a commanded stroke is the drawn one.
    """
    entry = read.table(
        "motion", value, (*Motion.numbers, "side", "branch", "free", "law")
    )
    if drawing is not None:
        read.drawn = list_drawn(drawing, drive)
        by_stroke = not entry.keys().isdisjoint(STROKE_COMMAND)
        if entry.get("side", DRAWN_WORD if by_stroke else None) == DRAWN_WORD:
            entry = {**entry, "side": find_side_of_cylinder(drawing, drive)}
    arguments: dict[str, Any] = {}
    for name, by in Motion.numbers.items():
        if name in entry:
            stated = entry[name]
            key = f"motion.{name}"
            if name in (*BAR_OF_ANGLE, "stroke"):
                arguments[name] = _read_commanded(read, key, stated, by.unit)
            elif isinstance(stated, list):
                arguments[name] = read.quantities(key, stated, by.unit)
            else:
                arguments[name] = read.quantity(key, stated, by.unit)
    for name, words in (("branch", BRANCH_OF_NAME), ("side", SIDES)):
        if name in entry:
            arguments[name] = read.choice(f"motion.{name}", entry[name], words)
    if "free" in entry:
        arguments["free"] = read.described("motion.free", entry["free"], Free)
    if "law" in entry:
        arguments["law"] = _read_law(read, entry["law"])
    return Motion(**arguments)


def _read_law(read: Reader, value: Any) -> Law | Rise | Sine:
    """Read a table; a sine; or a rise, a dwell, a fall and a rest by a standard law."""
    key = "motion.law"
    law: Any = Law
    if isinstance(value, dict) and "kind" in value:
        law = Rise
        if read.choice(f"{key}.kind", value["kind"], LAW_KINDS) == SINE_LAW:
            law = Sine
            value = {name: number for name, number in value.items() if name != "kind"}
    return read.described(key, value, law)  # type: ignore[no-any-return]


def _read_commanded(
    read: Reader,
    key: str,
    value: Any,
    unit: str,
) -> float | Array | Sweep | FromLimit:
    """Read angles or strokes: one, a list of them, or a sweep.

    An angle may be stated from a limit position.
    """
    if isinstance(value, str) and _LIKE_A_SWEEP.search(value):
        form = '{ from = "0 deg", to = "360 deg", steps = 360 }'
        raise read.refuse(key, value, f"is no number; a sweep is written {form}")
    if isinstance(value, str | int | float):
        return read.quantity(key, value, unit)
    if isinstance(value, list) and value:
        return np.array(read.quantities(key, value, unit))
    is_angle = unit == "rad"
    if not isinstance(value, dict):
        like = '"1.5 m", a list of such, { from, to, steps }'
        if is_angle:
            like = '"135 deg", a list of such, { from, to, steps } or { limit, offset }'
        raise read.refuse(key, value, f"must be like {like}")
    if is_angle and value.keys() & {"limit", "offset"}:
        return read.described(key, value, FromLimit)  # type: ignore[no-any-return]
    sweep = read.table(key, value, ("from", "to", "steps"))
    start, stop = (
        read.quantity(f"{key}.{end}", sweep.get(end), unit) for end in ("from", "to")
    )
    steps = sweep.get("steps", DEFAULT_STEPS)
    return Sweep(start, stop, read.whole(f"{key}.steps", steps, 1, MOST_INTERVALS))


def _read_load(read: Reader, key: str, value: Any) -> Load:
    if isinstance(value, dict):
        if value.keys().isdisjoint(("force", "moment")):
            read.table(key, value, list_keys(Load))
            raise read.refuse(key, value, "must have a force, a moment or both")
        table = value.get("table")
        if isinstance(table, dict) and "time" in table:
            raise read.refuse(f"{key}.table.time", table["time"], _OVER_THETA_2)
    return read.described(key, value, Load)  # type: ignore[no-any-return]


def _read_effect(read: Reader, name: str, value: object) -> Any:
    """Read an effect from the value under its key."""
    kind: Any = list_kinds()[name]
    key = f"effects.{name}"
    if kind.example and not isinstance(value, dict | list):
        raise read.refuse(key, value, f"must be like {kind.example}")
    return read.described(key, value, kind)


def _read_tolerances(
    read: Reader,
    scene: Scene,
    value: object,
) -> tuple[Tolerance, ...]:
    """Read ``"lengths.input" = "0.05 mm"`` or ``["0.02 mm", "sigma"]``.

    The first is plus or minus, the second a standard deviation.
    """
    entries = list_entries(scene)
    tolerances = []
    flat = _flatten(read, value)
    for key, stated in flat.items():
        name = f'tolerances."{key}"'
        if key not in entries:
            allowed = (
                "a commanded value has no tolerance; its speed and acceleration may"
                " have one"
            )
            if key not in COMMAND_KEYS:
                allowed = refuse_key(key, stated, list(entries)).allowed
            raise read.refuse(name, stated, allowed)
        entry = entries[key]
        sigma = isinstance(stated, list)
        if sigma and (len(stated) != 2 or stated[1] != SIGMA):
            form = f'"0.05 {entry.unit}" or ["0.02 {entry.unit}", "{SIGMA}"]'
            raise read.refuse(name, stated, f"must be like {form}")
        width = stated[0] if sigma else stated
        size = read.quantity(name, width, entry.unit, POSITIVE)
        if size <= 0.0:
            raise read.refuse(name, width, "must be > 0")
        tolerance = Tolerance(key, size, sigma)
        if (misfit := find_misfit(scene, entry, tolerance)) is not None:
            raise read.refuse(name, width, misfit)
        tolerances.append(tolerance)
    if (overlap := find_overlap(flat.keys())) is not None:
        length, pin = overlap
        allowed = f"follows from {pin}, which has a tolerance too: state one of them"
        raise read.refuse(f'tolerances."{length}"', flat[length], allowed)
    return tuple(tolerances)


def _flatten(read: Reader, value: object, before: str = "") -> dict[str, Any]:
    """Flatten a table to full keys, whether these are quoted or dotted."""
    if not isinstance(value, dict):
        allowed = 'must be a table of keys like "lengths.input" = "0.05 mm"'
        raise read.refuse("tolerances", value, allowed)
    flat: dict[str, Any] = {}
    for key, entry in value.items():
        if isinstance(entry, dict):
            flat |= _flatten(read, entry, f"{before}{key}.")
        else:
            flat[f"{before}{key}"] = entry
    return flat
