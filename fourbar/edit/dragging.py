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
from fourbar.scene.drawing import DRAWN_WORD
from fourbar.show.plot.style import split_complex
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
        pairs = {"at": split_complex(self.at), "beyond": split_complex(self.beyond)}
        return self._asdict() | pairs


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
    points = {point.name: point for point in scene.points}
    for key, _, one in list_described(scene):
        if not isinstance(one, Place | Load) and not states_place(type(one)):
            continue
        path = split_key(key)
        name = _name_handle(path)
        stated: Any = one
        force = None
        if isinstance(one, Load) and one.force is not None:
            force = (*path, "force")
        named = getattr(one, "point", None)
        if named is not None:  # the handle is that of the point
            path = ("points", named)
            stated = points[named]
        for form in ("from_pin", "from_centre", "arm"):
            pair = getattr(stated, form, None)
            if pair is None:
                continue
            at = 0j
            if form != "from_pin":
                at = scene.linkage.bar(stated.bar).to_centre
            handle = _Handle(
                name,
                (*path, form),
                stated.bar,
                at,
                cmath.rect(*pair),
                turns=form != "arm",
                force=force,
                force_turns=force is not None and one.frame == "bar",
            )
            handles.append(handle)
    return handles


def _name_handle(path: KeyPath) -> str:
    """Name what is dragged: "load 1", "point P", "to of springs 2"."""
    table, *inner = (step + 1 if isinstance(step, int) else step for step in path)
    if table in ("loads", "points"):
        return f"{str(table)[:-1]} {inner[0]}"
    *of, last = inner if table == "effects" else (table, *inner)
    return f"{last} of {' '.join(map(str, of))}" if of else f"point of {last}"


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
    theta_2 = np.array([dragged.theta_2], dtype=float)
    branch = np.array([dragged.branch], dtype=np.int8)
    state = compute_shown_state(scene, Command(theta_2, branch, 0.0, 0.0))
    if isinstance(dragged.what, str):
        _drag_pin(document, dragged, scene, state)
        return
    if not np.isfinite(state.position.u3).all():
        raise InputError(
            "theta_2",
            dragged.theta_2,
            "the linkage does not assemble there; choose another position",
        )
    for handle in list_handles(scene):
        bar_frame = _take_one(state.direction(handle.bar))
        foot = _take_one(state.point(handle.bar, handle.at))
        frame = bar_frame if handle.turns else 1.0
        if list(handle.path) == dragged.what:
            pair = (dragged.to - foot) / frame
            put_place(document, handle.path, pair, dragged.grain)
            return
        if handle.force is not None and list(handle.force) == dragged.what:
            force_frame = bar_frame if handle.force_turns else 1.0
            arrow = (dragged.to - foot - frame * handle.beyond) / force_frame
            stated = plain["loads"][handle.force[1]]["force"][0]
            # a negative force stays so
            size = to_si(stated, "N") * dragged.stretch
            angle = cmath.phase(math.copysign(1.0, size) * arrow)
            put_number(document, (*handle.force, 0), size, abs(size) / 50.0, "N")
            put_number(document, (*handle.force, 1), angle, 0.02, "rad")
            return
    raise InputError(
        "drag",
        dragged.what,
        "cannot be dragged; drag a pin, a point, a mass centre, an end or an arrow",
    )


def _take_one(value: Any) -> complex:
    """Return a place or direction at the one position of a state."""
    return complex(np.ravel(value)[0])


def _drag_pin(
    document: SceneDocument, dragged: Dragged, scene: Scene, state: State
) -> None:
    """Change the lengths of the bars that end in a pin, or the pin of a drawing.

    Raises InputError at another position than the one that is drawn.
    """
    pin = str(dragged.what)
    to = dragged.to
    grain = dragged.grain
    if scene.drawing is not None:
        drawn = scene.drawing.angle(2)
        if abs(math.remainder(dragged.theta_2 - drawn, math.tau)) > _SAME_ANGLE:
            raise InputError(
                "drag",
                pin,
                "the pins are those of the drawing: go to theta_2 ="
                f" {math.degrees(drawn):.6g} deg",
            )
        x0, y0 = scene.drawing.O2
        put_number(document, ("pins", pin, 0), to.real + x0, grain)
        put_number(document, ("pins", pin, 1), to.imag + y0, grain)
        return
    ground = ("lengths", "ground")
    if pin == "O4" and isinstance(document.at(ground), dict):
        put_place(document, ground, to, grain)
        return
    for bar, second in SECOND_PIN.items():
        if second == pin:
            length = abs(to - _take_one(state.foot(bar)))
            put_number(document, ("lengths", BAR_NAMES[bar]), length, grain)
    if pin == "O4":
        angle_grain = grain / max(abs(to), grain)
        angle = cmath.phase(to)
        put_number(document, ("lengths", "ground_angle"), angle, angle_grain, "rad")


def put_place(
    document: SceneDocument,
    path: KeyPath,
    place: complex,
    grain: float,
    by: str = "",
) -> None:
    """State a place as the file does, by coordinates or in polar form, in its units.

    `by`: "xy" or "polar" changes from the one to the other. Where the file has no place
    yet, its unit is that of the ground's length.
    """
    by_coordinates = by == "xy" or (not by and isinstance(document.at(path), dict))
    keys: Any = ("x", "y") if by_coordinates else (0, 1)
    first, second = ((*path, key) for key in keys)
    if document.at(first) is None:
        # what is drawn is a place of its bar from now on
        lengths = (
            (*path, DRAWN_WORD, 0),
            (*path, "x"),
            (*path, 0),
            ("lengths", "ground", "x"),
            ("lengths", "ground"),
            ("pins", "A", 0),
        )
        length = str(next(filter(None, map(document.at, lengths))))
        new: Any = {"x": length, "y": length} if by_coordinates else [length, "0 deg"]
        document.put(path, new)
    if by_coordinates:
        put_number(document, first, place.real, grain)
        put_number(document, second, place.imag, grain)
        return
    put_number(document, first, abs(place), grain)
    angle_grain = grain / max(abs(place), grain)
    put_number(document, second, cmath.phase(place), angle_grain, "rad")


def put_number(
    document: SceneDocument, path: KeyPath, value: float, grain: float, si: str = "m"
) -> None:
    """State a number of an SI unit in the unit of what stood there; angles in deg."""
    unit = find_unit(document.at(path), "deg" if si == "rad" else si)
    factor = to_si(f"1 {si}", unit)
    document.put(path, write_rounded(value * factor, grain * factor, unit))


def write_rounded(value: float, grain: float, unit: str) -> str:
    """Write a number with its unit, to the power of ten next below the grain."""
    finest = max(grain, _LEAST_DIGITS * abs(value), 1e-300)
    digits = -math.floor(math.log10(finest))
    shown = f"{round(value, digits):.{max(digits, 0)}f}"
    return f"{shown.rstrip('0').rstrip('.') if '.' in shown else shown} {unit}"
