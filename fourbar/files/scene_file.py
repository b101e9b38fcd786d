"""Scene files: TOML with units <-> Scene, checked entry by entry.

Numbers are rounded once when they are read; what is written reads back bit for bit.
"""

import math
import re
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

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
)
from fourbar.files.fields import (
    PLACES_OF_ENDS,
    Entry,
    SceneFile,
    list_keys,
)
from fourbar.files.scene_text import MOVING_BAR_NUMBERS, SIGMA
from fourbar.formulas.mobility import meet_change_points
from fourbar.linkage import (
    BAR_NAMES,
    BAR_NUMBERS,
    POSITIVE,
    Bar,
    Declared,
    FourBar,
    Listed,
    OfBar,
    OneOf,
    Text,
)
from fourbar.quantities import Array
from fourbar.quantities.units import half_unit_of_text
from fourbar.scene import Scene
from fourbar.scene.drawing import DRAWN_WORD, DrawnPins
from fourbar.scene.motion import (
    BRANCH_OF_NAME,
    DEFAULT_STEPS,
    LAW_KINDS,
    SIDES,
    SINE_LAW,
    STEPS,
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
"""Largest number of dots in one line, besides those of decimals. The TOML reader's time
grows with the square of a dotted key's parts.
"""
_DECIMAL = re.compile(r"(?<![\w.-])[-+]?\d+\.\d")
"""A number with decimals; of a dotted key at most the first dot, however it goes on."""
_MOST_LOADS = 1000
"""Limit of the loads, each of which is a term at every position."""
_TABLES: dict[str, Any] = {
    "title": "",
    "source": "",
    "lengths": {},
    "pins": None,
    "bars": {},
    "motion": {},
    "drive": {},
    "points": {},
    "loads": [],
    "effects": {},
    "tolerances": {},
    "picture": None,
}
"""Entries of a file, and what stands for those that it leaves out."""
_A_GIVEN_DRIVE = (
    "a drive is what is solved for; a torque or force that is given is a load"
    " ([[loads]]), which moves the linkage with motion.free"
)
_OVER_THETA_2 = (
    "a load follows theta_2, not time: at one speed theta_2 is omega_2 t; a torque over"
    " time that moves the linkage is for a simulator (fourbar mjcf SCENE --drive motor)"
)
_LIKE_A_SWEEP = re.compile(r"\d[^\d]*(\bto\b|\.\.|:|;)\s*-?\d")
_A_POINT = "a force acts at a place: state point, from_pin or from_centre"
MOST_POINTS_OF_A_SCENE = 1000
"""Limit of the points, each of which is three columns of every table."""
LONGEST_SHOWN_LINE = 60
"""Characters shown of a line that cannot be read."""


def load(path: str | Path) -> Scene:
    """Read the scene of a TOML file, of standard input (`-`) or of a pipe.

    Raises InputError, in one line with file, key, value and what is allowed, for a file
    that is missing, not a file, too large, not text or not TOML, and for every entry
    that is wrong.
    """
    expect("path", path, str, Path)
    return loads(read_scene_text(path), str(path))


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
        if _DECIMAL.sub("", line).count(".") > MOST_DOTS_OF_A_LINE:
            allowed = (
                f"line {number} holds more than {MOST_DOTS_OF_A_LINE} dots besides"
                " those of decimals"
            )
            raise InputError("TOML", line[:40], allowed, shown)
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise InputError("TOML", "...", "is nested too deeply", shown) from None
    except ValueError as error:  # TOMLDecodeError, and numbers that Python refuses
        reason = " ".join(str(error).split())
        place = re.search(r"line (\d+)", reason)
        line = text.split("\n")[int(place[1]) - 1] if place else text
        allowed = f'{reason[:120]}; a number with a unit stands in quotes, like "9 in"'
        part = line.strip()[:LONGEST_SHOWN_LINE]
        raise InputError("TOML", part, allowed, shown) from None


def read_tables(document: dict[str, Any], name: str = "scene") -> Scene:
    """Read the scene of the tables of a file.

    `name`: as `loads` has it.
    """
    shown = _write_name(name)
    try:
        file = SceneFile(shown)
        return read_scene(Entry(file, "", document), str(Path(name).parent))
    except InputError as error:
        raise (error if error.file else error.in_file(shown)) from None


def _write_name(name: str) -> str:
    return name if name.isprintable() else repr(name)


def read_scene(document: Entry, folder: str) -> Scene:
    """Read the scene of a file's tables; `folder`: of its pictures."""
    document.table(_TABLES)
    drawing = read_drawing(document)
    drawn = drawing or read_ground(document["lengths"])
    top = document.holding(_TABLES | document.value)
    top.file.drawing = drawn
    named = top["points"]
    if not isinstance(named.value, dict) or len(named.value) > MOST_POINTS_OF_A_SCENE:
        allowed = f"must be a table of points, at most {MOST_POINTS_OF_A_SCENE}"
        raise named.refuse(allowed)
    points = tuple(named[name].described(Point, name=name) for name in named.value)
    top.file.bars = {point.name: point.bar for point in points}
    drive_bar, drive = _read_drive(top["drive"])
    loads = top["loads"]
    if not isinstance(loads.value, list) or len(loads.value) > _MOST_LOADS:
        raise loads.refuse(f"must be written as [[loads]], at most {_MOST_LOADS}")
    effects = top["effects"]
    effects.table(list_kinds())
    lengths, met = _read_lengths(top, drawn)
    bars = top["bars"]
    bars.table(MOVING_BAR_NUMBERS)
    moving = dict[str, Any]()
    pictures = []
    for name, number in MOVING_BAR_NUMBERS.items():
        moving[name] = _read_bar(bars[name], met[number - 1], number)
        if "picture" in bars.value.get(name, {}):  # its file is read when it is shown
            shown = bars[name]["picture"].check(Text())
            pictures.append(Picture(number, shown, folder))
    linkage = FourBar(met[0], **moving, ground_angle=drawn.angle(1))
    settled = drive and drive.with_places(settler(linkage, points))
    motion = _read_motion(top["motion"], drawing, settled)
    stated_loads = tuple(map(_read_load, loads.entries()))
    stated_effects = []
    for key, value in effects.value.items():
        effect: Any = list_kinds()[key]
        if effect.example and not isinstance(value, dict | list):
            raise effects[key].refuse(f"must be like {effect.example}")
        stated_effects.append(effects[key].described(effect))
    picture = None
    if top["picture"].value is not None:  # its file is read when it is shown
        picture = top["picture"].described(TracedPicture, folder=folder)
    scene = Scene(
        linkage,
        motion,
        drive_bar,  # type: ignore[arg-type]
        stated_loads,
        tuple(stated_effects),
        top["title"].check(Text()),
        top["source"].check(Text()),
        tuple(pictures),
        points,
        drive=drive,
        drawing=drawing,
        picture=picture,
    )
    if drawing is not None:
        scene = choose_assembly(scene, drawing)
    return replace(
        scene,
        met_lengths=None if met == lengths else (lengths, met),
        tolerances=_read_tolerances(top["tolerances"], scene),
    )


def _read_drive(drive: Entry) -> tuple[int | None, ForceDrive | None]:
    """Read the bar on which a couple acts, or a force along a line or at a place."""
    if isinstance(drive.value, dict):
        for name in ("torque", "moment", "force"):
            if name in drive.value:
                raise drive[name].refuse(_A_GIVEN_DRIVE)
    of_line = list_keys(LinearDrive)
    stated = drive.table(dict.fromkeys(("bar", *of_line, *list_keys(PointDrive))))
    if not stated:
        return 2, None
    if not stated.keys().isdisjoint(of_line):
        return None, drive.described(LinearDrive)
    if stated.keys().isdisjoint(PLACES_OF_ENDS):
        bar = drive["bar"].check(OfBar())
        if len(stated) == 1:
            return bar, None
        raise drive["point"].refuse(_A_POINT)
    return None, drive.described(PointDrive)


def _read_lengths(top: Entry, drawn: DrawnPins | DrawnGround) -> tuple[Any, Any]:
    """Read the lengths of ground, input, coupler and output, m.

    Return them as they are stated, and with the equalities of change points that their
    last decimals miss.
    """
    if isinstance(drawn, DrawnPins):
        return tuple(map(drawn.length, BAR_NAMES)), meet_lengths(
            drawn, top["pins"].value
        )
    table = top["lengths"]
    stated = dict(table.table((*BAR_NUMBERS, "ground_angle")))
    if drawn.length is not None:
        # with every digit: lengths are compared within those that are stated
        stated["ground"] = f"{drawn.length:.16e} m"
    declared = dict.fromkeys(BAR_NUMBERS, Bar.numbers["length"])
    lengths: Any = tuple(table.holding(stated).numbers(declared).values())
    if not math.isfinite(sum(lengths)):  # refused where they are put together
        return lengths, lengths
    roundings: Any = tuple(half_unit_of_text(stated[name], "m") for name in declared)
    return lengths, meet_change_points(lengths, roundings)


def _read_bar(bar: Entry, length: float, number: int) -> Bar:
    if bar.value is None:
        return Bar(length)
    _, *keys = Bar.numbers  # the length stands elsewhere
    stated = dict(bar.table((*keys, "picture")))
    stated.pop("picture", None)
    known: dict[str, Any] = {"length": length}
    if bar["centre"].is_drawn():
        known["centre"] = bar["centre"].locate(number)
    read: Bar = bar.holding(stated).described(Bar, **known)
    if not math.isfinite(read.moment_of_inertia):
        by = next(
            key for key in ("mass", "mass_per_length", "density") if key in stated
        )
        raise bar[by].refuse("must leave the inertia m L^2/12 a finite number")
    return read


def _read_motion(
    motion: Entry, drawing: DrawnPins | None, drive: ForceDrive | None
) -> Motion:
    """Read the motion, in which the word "drawn" stands for the numbers of a drawing.

    A side that is left out of a commanded stroke is the drawn one.
    """
    entry = motion.table((*Motion.numbers, "side", "branch", "free", "law"))
    if drawing is not None:
        motion.file.drawn |= list_drawn(drawing, drive)
        if not entry.keys().isdisjoint(STROKE_COMMAND):
            motion = motion.holding({"side": DRAWN_WORD, **entry})
        if motion["side"].value == DRAWN_WORD:
            motion.file.drawn["side"] = find_side_of_cylinder(drawing, drive)
    arguments: dict[str, Any] = {}
    for name, by in Motion.numbers.items():
        if name in entry:
            arguments[name] = _read_commanded(motion[name], by.unit)
    for name, words in (("branch", BRANCH_OF_NAME), ("side", SIDES)):
        if name in motion.value:
            arguments[name] = motion[name].check(OneOf((*words,)))
    if "free" in entry:
        arguments["free"] = motion["free"].described(Free)
    if "law" in entry:
        law = motion["law"]
        form: Any = Law  # a table of instants
        if isinstance(law.value, dict) and "kind" in law.value:
            kind = law["kind"].check(OneOf(LAW_KINDS))
            form = Sine if kind == SINE_LAW else Rise
        arguments["law"] = law.described(form)
    return Motion(**arguments)


def _read_commanded(entry: Entry, unit: str) -> float | Array | Sweep | FromLimit:
    """Read angles or strokes: one, a list of them, or a sweep.

    An angle may be stated from a limit position.
    """
    value = entry.value
    if isinstance(value, str) and _LIKE_A_SWEEP.search(value):
        form = '{ from = "0 deg", to = "360 deg", steps = 360 }'
        raise entry.refuse(f"is no number; a sweep is written {form}")
    if isinstance(value, str | int | float):
        return entry.check(Declared(unit))  # type: ignore[no-any-return]
    if isinstance(value, list) and value:
        return np.array(entry.check(Listed(unit)))
    is_angle = unit == "rad"
    if not isinstance(value, dict):
        like = '"1.5 m", a list of such, { from, to, steps }'
        if is_angle:
            like = '"135 deg", a list of such, { from, to, steps } or { limit, offset }'
        raise entry.refuse(f"must be like {like}")
    if is_angle and value.keys() & {"limit", "offset"}:
        return entry.described(FromLimit)  # type: ignore[no-any-return]
    entry.table(("from", "to", "steps"))
    start, stop = (entry[end].check(Declared(unit)) for end in ("from", "to"))
    steps = DEFAULT_STEPS
    if "steps" in value:
        steps = entry["steps"].check(STEPS)
    return Sweep(start, stop, steps)


def _read_load(load: Entry) -> Load:
    if isinstance(load.value, dict):
        if load.value.keys().isdisjoint(("force", "moment")):
            load.table(list_keys(Load))
            raise load.refuse("must have a force, a moment or both")
        table = load["table"]
        if isinstance(table.value, dict) and "time" in table.value:
            raise table["time"].refuse(_OVER_THETA_2)
    return load.described(Load)  # type: ignore[no-any-return]


def _read_tolerances(table: Entry, scene: Scene) -> tuple[Tolerance, ...]:
    """Read ``"lengths.input" = "0.05 mm"`` or ``["0.02 mm", "sigma"]``.

    The first is plus or minus, the second a standard deviation.
    """
    entries = list_entries(scene)
    tolerances = []
    flat = _flatten(table, table.value)
    for key, stated in flat.items():
        tolerance = Entry(table.file, f'tolerances."{key}"', stated)
        if key not in entries:
            allowed = (
                "a commanded value has no tolerance; a speed or acceleration that is"
                " one for all positions may have one"
            )
            if key not in COMMAND_KEYS and not key.startswith("motion.law."):
                allowed = refuse_key(key, stated, list(entries)).allowed
            raise tolerance.refuse(allowed)
        unit = entries[key].unit
        sigma = isinstance(stated, list)
        if sigma and (len(stated) != 2 or stated[1] != SIGMA):
            form = f'"0.05 {unit}" or ["0.02 {unit}", "{SIGMA}"]'
            raise tolerance.refuse(f"must be like {form}")
        width = tolerance.holding(stated[0] if sigma else stated)
        read = Tolerance(key, width.check(Declared(unit, POSITIVE)), sigma)
        if (misfit := find_misfit(scene, entries[key], read)) is not None:
            raise width.refuse(misfit)
        tolerances.append(read)
    if (overlap := find_overlap(flat.keys())) is not None:
        length, pin = overlap
        twice = Entry(table.file, f'tolerances."{length}"', flat[length])
        raise twice.refuse(
            f"follows from {pin}, which has a tolerance too: state one of them"
        )
    return tuple(tolerances)


def _flatten(table: Entry, value: object, before: str = "") -> dict[str, Any]:
    """Flatten a table to full keys, whether these are quoted or dotted."""
    if not isinstance(value, dict):
        raise table.refuse('must be a table of keys like "lengths.input" = "0.05 mm"')
    flat: dict[str, Any] = {}
    for key, entry in value.items():
        if isinstance(entry, dict):
            flat |= _flatten(table, entry, f"{before}{key}.")
        else:
            flat[before + key] = entry
    return flat
