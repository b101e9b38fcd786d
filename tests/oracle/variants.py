"""Scenes with other numbers, and rows of a comparison, for checks of derived
results.
"""

import tomllib
from cmath import phase, rect
from contextlib import suppress
from copy import deepcopy
from dataclasses import replace

import numpy as np
import tomlkit

from fourbar.files import dump, loads
from fourbar.linkage import BAR_NUMBERS, ENDS, MOVING_BARS, PIN_FORCE
from fourbar.quantities import LINE, OK, SCALARS, UNKNOWNS
from fourbar.scene import command as command_of
from fourbar.scene import with_signs
from fourbar_validation.compare.compare import COMPARED_QUANTITIES, Comparison, Demands
from fourbar_validation.compare.reversals import mark_reversing
from fourbar_validation.compare.rows import Row
from fourbar_validation.compare.scales import make_reference
from fourbar_validation.compare.tolerance import (
    EQUIVALENCE,
    WELL_CONDITIONED,
    magnitude,
    sum_lengths,
)
from fourbar_validation.engines.free_body import FreeBody
from fourbar_validation.engines.registry import ask_at, make_prediction
from fourbar_validation.run.question import FREE_BODY, NotAskedError
from tests.oracle.points import compare_points

POSITIONS_OF_VARIANTS = 5
"""Positions at which whatever takes more than one call is judged."""
_FROM_A_CORNER = 0.02
"""Distance from a point of a load's table without differences, rad. The table's slope
jumps at the point.
"""
_NOT_AT_REST = 1e-3
"""Part of the speeds over sin^2 mu below which a dry pin may reverse. Small changes of
a number reverse it then.
"""
MISS_OF_A_CHANGE_POINT = 1e-3
"""Part of the sum of the lengths by which a linkage near a change point misses it."""
_GOLDEN = 0.5 * (5.0**0.5 - 1.0)


def take_few(question):
    """Take the scene at a few of its positions.

    Small changes of its numbers change its quantities little there.

    Raises NotAskedError where there are none.
    """
    scene = question.scene
    command = question.at
    solution = question.solution
    if scene.motion.law is not None:
        raise NotAskedError("a motion law has no positions of its own choice")
    reference = question.reference
    fit = (
        (solution.status_code == OK)
        & (reference.condition >= WELL_CONDITIONED)
        & np.isfinite(reference.F12).all(axis=1)
    )
    fit &= (reference.drive_condition >= WELL_CONDITIONED) & (
        command.branch == scene.motion.branch
    )
    fit &= ~mark_reversing(scene, solution, _NOT_AT_REST) & (command.speed != 0.0)
    for load in scene.loads:
        for corner in () if load.table is None else load.table.theta_2:
            fit &= (
                abs(np.angle(np.exp(1j * (solution.theta_2 - corner)))) > _FROM_A_CORNER
            )
    indices = np.flatnonzero(fit)
    if not len(indices):
        raise NotAskedError("no position that is well-conditioned and moves")
    inside = np.linspace(0, len(indices) - 1, POSITIONS_OF_VARIANTS + 2)[1:-1]
    places = command.places[indices[np.unique(inside.astype(int))]]
    return at_places(replace(scene, title="", source="", pictures=()), places)


def at_places(scene, places):
    """Command other angles or strokes."""
    return replace(scene, motion=scene.motion.replace(angle=places))


DRAWN_SETTING = "drawn"
"""Setting of rows that judge numbers of a drawing."""
_ALONG_AXES = (1.0, 1.0j)
"""A coordinate's direction in the plane, by its index."""


def is_coordinate(key):
    """Return whether a key names a coordinate of a drawn pin or place."""
    return key.startswith("pins.") or ".drawn." in key


def find_entry(document, key):
    """Find the table that holds a number, and its name or index there."""
    *path, last = [int(part) if part.isdecimal() else part for part in key.split(".")]
    for part in path:
        document = document[part]
    return document, last


class SceneFile:
    """The text of a scene's file, in which numbers are moved: it states lengths and
    polar pairs, and what it leaves out follows the lengths. A second one states the
    pins of a drawing, in which coordinates are moved.
    """

    def __init__(self, scene):
        self.scene = scene
        # tolerances may be of coordinates, which a file by lengths does not have
        stated = replace(scene, tolerances=())
        self._by_pins = tomllib.loads(dump(stated))
        self._by_lengths = tomllib.loads(dump(replace(stated, drawing=None)))
        if scene.drawing is not None:
            pins = {pin: complex(*getattr(scene.drawing, pin)) for pin in PIN_FORCE}
            self._feet = {bar: pins[ends[0]] for bar, ends in ENDS.items()}
            self._bars = {bar: pins[j] - pins[i] for bar, (i, j) in ENDS.items()}
            self._along = {bar: x / abs(x) for bar, x in self._bars.items()}

    def find_stated(self, keys):
        """Find those of the keys whose numbers the file states, and what they may be
        moved by: most of itself, of an angle most of 1 rad, of a coordinate most of the
        shortest bar.

        Of motion.theta_2 it is the first.
        """
        stated = {}
        for index, key in enumerate(keys):
            # no two alike, between 1/2 and 1
            part = 0.5 + 0.5 * ((index + 1) * _GOLDEN % 1.0)
            with suppress(KeyError):
                number, size = self._find_number(key)
                stated[key] = number, part * size
        return stated

    def _find_number(self, key):
        """Find a number and the size of what it may be moved by.

        Raises KeyError if the file leaves it out.
        """
        drawn = is_coordinate(key)
        if ".drawn." in key:
            (holder, last), bar, axis = self._find_place(self._by_pins, key)
            turned = rect(*map(_read, holder[last])) * self._along[bar]
            place = self._feet[bar] + turned
            return (place.real, place.imag)[axis], min(map(abs, self._bars.values()))
        table, last = find_entry(self._by_pins if drawn else self._by_lengths, key)
        entry = table[last]
        if isinstance(entry, list):
            entry = entry[0]
        number = _read(entry)
        if drawn:
            return number, min(map(abs, self._bars.values()))
        return number, 1.0 if str(entry).endswith(" rad") else number

    def _find_place(self, document, key):
        """Find the entry of a drawn place, its bar, and the index of a coordinate."""
        name, _, axis = key.partition(".drawn.")
        if name.endswith(".centre"):
            return (
                find_entry(document, name),
                BAR_NUMBERS[name.split(".")[1]],
                int(axis),
            )
        holder, last = find_entry(document, f"{name}.from_pin")
        return (holder, last), holder["bar"], int(axis)

    def move(self, changes):
        """Read the file after some of its numbers were changed by so much.

        motion.theta_2 moves every position.
        """
        drawn = any(map(is_coordinate, changes))
        document = deepcopy(self._by_pins if drawn else self._by_lengths)
        for key, change in changes.items():
            if ".drawn." in key:  # moved where the bars are drawn
                (table, last), bar, axis = self._find_place(document, key)
                place = rect(*map(_read, table[last]))
                place += change * _ALONG_AXES[axis] / self._along[bar]
                table[last] = [f"{abs(place)!r} m", f"{phase(place)!r} rad"]
                continue
            table, last = find_entry(document, key)
            table[last] = _change_entry(table[last], change)
        if drawn:
            self._keep_on_ground(document, document["pins"])
        return loads(tomlkit.dumps(document))

    def _keep_on_ground(self, document, pins):
        """Let the places on the ground stay in the drawing while its pins move."""
        if isinstance(document, list):
            document = dict(enumerate(document))
        if not isinstance(document, dict):
            return
        for part in document.values():
            self._keep_on_ground(part, pins)
        if document.get("bar") == 1 and "from_pin" in document:
            O2, O4 = (complex(*map(_read, pins[pin])) for pin in ENDS[1])
            place = rect(*map(_read, document["from_pin"]))
            place = place * self._along[1] + self._feet[1] - O2
            place *= abs(O4 - O2) / (O4 - O2)
            document["from_pin"] = [f"{abs(place)!r} m", f"{phase(place)!r} rad"]


def _read(quantity):
    """Read the number of a text with a unit, or of a plain one."""
    return float(str(quantity).partition(" ")[0])


def _change_entry(quantity, change):
    """Change a number of a file, or each of a list."""
    if isinstance(quantity, list):
        return [_change_entry(entry, change) for entry in quantity]
    number, _, unit = str(quantity).partition(" ")
    changed = float(number) + change
    return f"{changed!r} {unit}" if unit else changed


def ask_free_bodies(scene, command=None):
    """Ask the free bodies at the scene's own positions, or others."""
    with np.errstate(all="ignore"):
        return ask_at(
            FreeBody(), scene, command_of(scene) if command is None else command
        )


def is_near_change_point(linkage):
    """Return whether two lengths are together nearly as long as the other two."""
    d, a, b, c = linkage.lengths
    differences = d + a - b - c, d + b - a - c, d + c - a - b
    return min(map(abs, differences)) <= MISS_OF_A_CHANGE_POINT * sum_lengths(linkage)


def ask_beside(member, scene, nominal):
    """Ask the free bodies about a linkage with slightly changed numbers.

    Near a change point each position has the closure nearest to the nominal one: of
    both, that whose bars turn least from where they are in the nominal linkage.

    Parameters
    ----------
    scene, nominal : nominal linkage, and the free bodies' answer at its positions, of
        which the member has as many.
    """
    if not is_near_change_point(scene.linkage):
        return ask_free_bodies(member)
    commanded = command_of(member)
    closures = []
    turns = []
    for sign in (1, -1):
        signs = np.full_like(commanded.branch, sign)
        closure = with_signs(member.linkage, commanded._replace(branch=signs))
        answer = ask_free_bodies(member, closure)
        turn = np.zeros(len(signs))
        for bar in MOVING_BARS:
            name = f"theta_{bar}"
            turn += 1.0 - np.cos(answer.quantities[name] - nominal.quantities[name])
        closures.append(closure.branch)
        turns.append(turn)
    nearest = np.where(turns[0] <= turns[1], *closures).astype(np.int8)
    return ask_free_bodies(member, commanded._replace(branch=nearest))


def hold_to(question, engine, scene, solution, answer):
    """Compare a solution with the answer of the free bodies.

    A public call gave the solution for a scene.
    """
    answer = replace(answer, engine=engine)
    predicted = make_prediction(FREE_BODY, scene, answer.at, answer)
    reference = make_reference(scene, answer)
    rows = Comparison(
        question.name,
        scene,
        answer,
        solution,
        Demands(EQUIVALENCE, COMPARED_QUANTITIES, predicted),
        reference,
    ).rows()
    if scene.points and reference is not None:
        rows.append(
            replace(
                compare_points(question, scene, solution, reference, WELL_CONDITIONED),
                engine=engine,
            )
        )
    return rows


def make_row(question, engine, quantity, error, tolerance, theta_2, reason):
    """Make the row of a quantity whose errors are held to one tolerance.

    The errors are those at some positions.
    """
    who = (question.name, engine, "exact")
    return Row.judged(
        who, quantity, error, tolerance.factor, f"{tolerance.name}: {reason}", theta_2
    )


def split_unknowns(answer):
    """Split the unknowns of a position.

    Vectors become components, pin forces also their magnitudes.
    """
    parts = {}
    for name in (*UNKNOWNS, LINE.value):
        values = answer.quantities.get(name)
        if name in SCALARS and values is not None:
            parts[name] = values
        elif values is not None:
            parts |= {
                f"{name}_x": values[:, 0],
                f"{name}_y": values[:, 1],
                f"|{name}|": magnitude(values),
            }
    return parts
