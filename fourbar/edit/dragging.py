"""Dragging in the drawing: from a place in the plane to the numbers of the file.

The numbers are lengths, angles and forces. A pin changes the lengths that meet in it, a
point its distance and angle, an arrow its force; each number keeps the unit that it has
in the file and gets no more digits than a pixel is worth.
"""

import cmath
import math
from typing import Any, NamedTuple

import numpy as np

from fourbar.edit.scene_entries import KeyPath, SceneDocument
from fourbar.effects import Load, Place
from fourbar.effects.place import states_place
from fourbar.errors import InputError
from fourbar.evaluation.case import compute_shown_state
from fourbar.files.fields import split_key
from fourbar.formulas.motion import State
from fourbar.linkage import BAR_NAMES, MOVING_BARS, SECOND_PIN
from fourbar.quantities.units import find_unit, to_si
from fourbar.scene import Command, Scene
from fourbar.scene.drawing import DRAWN_WORD, DrawnPins
from fourbar.studies.keys import list_described

_SAME_ANGLE = 1e-9
"""rad. Difference below which the position shown is the one that is drawn."""
_LEAST_DIGITS = 1e-12
"""Finest grain, relative to the number itself."""


class _Handle(NamedTuple):
    """A point of the drawing that can be dragged, besides the pins."""

    name: str
    """Name of the handle for a reader."""
    path: KeyPath
    """Path of the handle's pair (distance, angle) in the file."""
    bar: int
    at: complex
    """Vector from the bar's first pin to the origin of the pair, in the bar's frame, m.
    """
    beyond: complex
    """The pair itself, m."""
    turns: bool = True
    """True if the pair's angle turns with the bar."""
    force: KeyPath | None = None
    """Path of the force whose arrow stands here."""
    force_turns: bool = False
    """True if the force's direction turns with the bar."""

    def drawn(self) -> dict[str, Any]:
        """Return the handle as the page has it, complex places as pairs."""
        plain = {
            name: [z.real, z.imag]
            for name, z in (("at", self.at), ("beyond", self.beyond))
        }
        return self._asdict() | plain


def list_handles(scene: Scene) -> list[_Handle]:
    """List everything that can be dragged.

    Mass centres can be dragged, and each place that a point, a load, the drive or an
    effect declares.
    """
    handles = []
    for number in MOVING_BARS:
        bar = scene.linkage.bar(number)
        if bar.mass > 0.0:
            name = BAR_NAMES[number]
            path: KeyPath = ("bars", name, "centre")
            mass_centre = f"mass centre of {name}"
            handles.append(_Handle(mass_centre, path, number, 0j, bar.to_centre))
    for key, _, one in list_described(scene):
        path = split_key(key)
        if not isinstance(one, Place | Load) and not states_place(type(one)):
            continue
        if one.place is not None:
            handle = _hold_place(path, one.place, scene)
        elif one.arm is not None:
            G = scene.linkage.bar(one.bar).to_centre
            arm = cmath.rect(*one.arm)
            of_arm = (*path, "arm")
            handle = _Handle(_name_handle(path), of_arm, one.bar, G, arm, turns=False)
        else:  # a couple without a place
            continue
        if isinstance(one, Load) and one.force is not None:
            turns = one.frame == "bar"
            handle = handle._replace(force=(*path, "force"), force_turns=turns)
        handles.append(handle)
    return handles


def _name_handle(path: KeyPath) -> str:
    """Name what is dragged: "load 1", "point P", "to of springs 2"."""
    table, *inner = (step + 1 if isinstance(step, int) else step for step in path)
    if table in ("loads", "points"):
        return f"{str(table)[:-1]} {inner[0]}"
    *of, last = inner if table == "effects" else (table, *inner)
    return f"{last} of {' '.join(map(str, of))}" if of else f"point of {last}"


def _hold_place(path: KeyPath, place: Place, scene: Scene) -> _Handle:
    """Make the handle of a place by the form in which it is stated.

    The handle of a named point is that of the point.
    """
    name = _name_handle(path)
    if place.point is not None:
        path = ("points", place.point)
        place = next(p.place for p in scene.points if p.name == place.point)
    if place.from_centre is None:
        return _Handle(name, (*path, "from_pin"), place.bar, 0j, place.vector())
    G = scene.linkage.bar(place.bar).to_centre
    pair = cmath.rect(*place.from_centre)
    return _Handle(name, (*path, "from_centre"), place.bar, G, pair)


class Dragged(NamedTuple):
    """Drag as the page describes it."""

    what: str | list[str | int]
    """A pin, or the path of a handle's pair or of its force."""
    to: complex
    """m, in world axes."""
    grain: float
    """m that a pixel is worth."""
    theta_2: float
    """Angle theta_2 of the position shown, rad."""
    branch: int
    stretch: float = 1.0
    """Length of an arrow relative to the length that it is drawn with."""


def drag(
    document: SceneDocument,
    scene: Scene,
    plain: dict[str, Any],
    dragged: Dragged,
) -> None:
    """Change the numbers of the file for a drag that began in `scene`.

    `plain`: entries of the file of that scene.

    Raises InputError where nothing of that name can be dragged, or the linkage does not
    assemble there.
    """
    theta_2 = np.array([dragged.theta_2])
    branch = np.array([dragged.branch], dtype=np.int8)
    state = compute_shown_state(scene, Command(theta_2, branch, 0.0, 0.0))
    if isinstance(dragged.what, str):
        if scene.drawing is None:
            _drag_pin(document, dragged, state)
        else:
            _drag_drawn_pin(document, dragged, scene.drawing)
        return
    if not np.isfinite(state.position.u3).all():
        raise InputError(
            "theta_2",
            dragged.theta_2,
            "the linkage does not assemble there; choose another position",
        )
    in_world = 1.0 + 0.0j
    for handle in list_handles(scene):
        bar_frame = _take_one(state.direction(handle.bar))
        foot = _take_one(state.foot(handle.bar)) + bar_frame * handle.at
        frame = bar_frame if handle.turns else in_world
        if list(handle.path) == dragged.what:
            pair = (dragged.to - foot) / frame
            put_place(document, handle.path, pair, dragged.grain)
            return
        if handle.force is not None and list(handle.force) == dragged.what:
            force_frame = bar_frame if handle.force_turns else in_world
            arrow = (dragged.to - foot - frame * handle.beyond) / force_frame
            _put_force(document, handle.force, plain, arrow, dragged.stretch)
            return
    raise InputError(
        "drag",
        dragged.what,
        "cannot be dragged; drag a pin, a point, a mass centre, an end or an arrow",
    )


def _take_one(value: Any) -> complex:
    """Return a place or direction at the one position of a state."""
    return complex(np.ravel(value)[0])


def _put_force(
    document: SceneDocument,
    path: KeyPath,
    plain: dict[str, Any],
    arrow: complex,
    stretch: float,
) -> None:
    """Turn a force into the direction of its arrow; a negative one stays so."""
    stated = str(plain["loads"][path[1]]["force"][0])
    unit = find_unit(stated, "N")
    force = to_si(stated, unit) * stretch
    angle = cmath.phase(arrow) + (0.0 if force >= 0.0 else math.pi)
    document.put((*path, 0), write_rounded(force, abs(force) / 50.0, unit))
    _put_like(document, (*path, 1), angle, 0.02, "rad")


def _drag_pin(document: SceneDocument, dragged: Dragged, state: State) -> None:
    """Change the lengths of the bars that end in a pin."""
    ground = ("lengths", "ground")
    if dragged.what == "O4" and isinstance(document.at(ground), dict):
        put_place(document, ground, dragged.to, dragged.grain)
        return
    for bar, pin in SECOND_PIN.items():
        if pin == dragged.what:
            length = abs(dragged.to - _take_one(state.foot(bar)))
            _put_like(document, ("lengths", BAR_NAMES[bar]), length, dragged.grain)
    if dragged.what == "O4":
        angle = cmath.phase(dragged.to)
        grain = dragged.grain / max(abs(dragged.to), dragged.grain)
        _put_like(document, ("lengths", "ground_angle"), angle, grain, "rad")


def _drag_drawn_pin(
    document: SceneDocument,
    dragged: Dragged,
    drawing: DrawnPins,
) -> None:
    """Move a pin of the drawing.

    Raises InputError at another position than the one that is drawn.
    """
    drawn = drawing.angle(2)
    if abs(math.remainder(dragged.theta_2 - drawn, 2.0 * math.pi)) > _SAME_ANGLE:
        raise InputError(
            "drag",
            dragged.what,
            "the pins are those of the drawing: go to theta_2 ="
            f" {math.degrees(drawn):.6g} deg",
        )
    x0, y0 = drawing.O2
    place = (dragged.to.real + x0, dragged.to.imag + y0)
    for axis, coordinate in enumerate(place):
        key = ("pins", str(dragged.what), axis)
        _put_like(document, key, coordinate, dragged.grain)


def parse_place(stated: Any) -> complex:
    """Return the place of a bar that an entry of the file states, m.

    The entry is polar, or by x and y.
    """
    if isinstance(stated, dict):
        return complex(to_si(stated["x"], "m"), to_si(stated["y"], "m"))
    distance, angle = stated
    return cmath.rect(to_si(distance, "m"), to_si(angle, "rad"))


def put_place(
    document: SceneDocument,
    path: KeyPath,
    place: complex,
    grain: float,
    by: str = "",
) -> None:
    """State a place as the file does, in its units.

    `by`: "xy" or "polar" changes between distance and angle, and x and y. Where the
    file has no place yet, its unit is that of the ground's length.
    """
    old = document.at(path)
    before = "polar"
    if isinstance(old, dict):
        # what is drawn is a place of its bar from now on
        before = DRAWN_WORD if DRAWN_WORD in old else "xy"
        by = by or "xy"
    lengths = (
        (*path, DRAWN_WORD, 0),
        (*path, "x"),
        (*path, 0),
        ("lengths", "ground", "x"),
        ("lengths", "ground"),
        ("pins", "A", 0),
    )
    length = next(filter(None, map(document.at, lengths)))
    stated: Any
    if by == "xy":
        x = _write_like(document.at((*path, "x")) or length, place.real, grain)
        y = _write_like(document.at((*path, "y")) or length, place.imag, grain)
        stated = {"x": x, "y": y}
        parts = [*stated.items()]
    else:
        distance = abs(place)
        angle_grain = grain / max(distance, grain)
        old_angle = document.at((*path, 1))
        angle = _write_like(old_angle, cmath.phase(place), angle_grain, "rad")
        stated = [_write_like(length, distance, grain), angle]
        parts = [*enumerate(stated)]
    if old is None or (by or before) != before:
        document.put(path, stated)
        return
    for step, text in parts:
        document.put((*path, step), text)


def _put_like(
    document: SceneDocument, path: KeyPath, value: float, grain: float, si: str = "m"
) -> None:
    """State a number as `_write_like` writes it in the place of an older one."""
    document.put(path, _write_like(document.at(path), value, grain, si))


def _write_like(old: object, value: float, grain: float, si: str = "m") -> str:
    """Write a number of an SI unit, "m" or "rad", in the unit of its older text."""
    unit = find_unit(old, "m" if si == "m" else "deg")
    factor = to_si(f"1 {si}", unit)
    return write_rounded(value * factor, grain * factor, unit)


def write_rounded(value: float, grain: float, unit: str) -> str:
    """Write a number with its unit, to the power of ten next below the grain."""
    finest = max(grain, _LEAST_DIGITS * abs(value), 1e-300)
    digits = -math.floor(math.log10(finest))
    shown = f"{round(value, digits):.{max(digits, 0)}f}"
    return f"{shown.rstrip('0').rstrip('.') if '.' in shown else shown} {unit}"
