"""Mistakes as hypotheses, and scenes that somebody may have solved for the one set.

A mistake in what was solved is another scene or another command, which the formulas
solve as they solve the right one.

A number of a scene, or all numbers under one name, may be left out or have another
factor; inertia may count about another point; a load may act elsewhere.
"""

import cmath
import math
from collections.abc import Collection, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from fourbar.effects import Gravity, Load
from fourbar.effects.load import PLACES_OF_LOADS
from fourbar.errors import FourBarError, InputError
from fourbar.linkage import BAR_NUMBERS, MOVING_BARS
from fourbar.quantities import COUPLE, LINE, Array
from fourbar.scene import Command, Scene, StrokeOrigin
from fourbar.solution import Solution, find_unit_of_quantity
from fourbar.solving import solve
from fourbar.studies.keys import list_entries, read_number, replace_numbers
from fourbar_validation.check.judge_table import Predict, compute_column
from fourbar_validation.compare.pins import resolve
from fourbar_validation.engines.free_body_closure import cross_products
from fourbar_validation.scenes.bars import list_moving, replace_bars

_OF_FORMULAS = (*COUPLE[1:], *LINE[1:])
"""Quantities that no wrong problem changes: an error and a range are the formulas'."""
_TURNING = ("rad", "rad/s", "rad/s^2", "N m")
"""Units of what is reversed where angles are counted clockwise."""
_PLACE_UNITS = ("m", "rad")
"""Units of numbers that say where and in which direction something acts."""
_DONE = {0.0: "left out", 2.0: "doubled", -1.0: "reversed"}
"""Factors on numbers of a scene, and what was done to them."""
_CENTIMETRES = "m a and I alpha in kg cm/s^2 and kg cm^2/s^2, added to N and N cm"
_MILLIMETRES = "m a and I alpha in kg mm/s^2 and kg mm^2/s^2, added to N and N mm"
_D_ALEMBERT = "(d'Alembert's forces put on the side of m a)"
_INERTIAL = {
    f"{_CENTIMETRES}: 100 times": (1e2, 1e2),
    "m a in kg cm/s^2 added to N: 100 times too large": (1e2, 1.0),
    "I alpha in kg cm^2/s^2 added to N cm: 100 times too large": (1.0, 1e2),
    f"{_MILLIMETRES}: 1000 times": (1e3, 1e3),
    "m a in kg mm/s^2 added to N: 1000 times too large": (1e3, 1.0),
    f"inertial forces with the wrong sign {_D_ALEMBERT}": (-1.0, -1.0),
}
"""Factors on m a and I alpha of every bar, by the mistake behind them."""
_GRAVITIES = (9.81, 9.80665, 9.8)
"""Gravity of textbooks and of simulators, m/s^2."""
_DAMPING = ("viscous", "friction", "pin_friction")
"""Effects that oppose motion, which many a simulator leaves out together."""
GRAVITY_ANGLE = "effects.gravity.1"
"""Key of the direction of gravity, which is fitted."""
Numbers = dict[str, float]
"""Numbers of a scene by their keys."""


class Mistake(NamedTuple):
    """A mistake as a hypothesis: what was done, and what the numbers become."""

    text: str
    predict: Predict
    whole: bool = True
    """True if it was made in the calculation and shows in every quantity; a wrong unit
    of a column shows in that column alone.
    """
    times: float = 1.0
    """Factor on the allowed error. A number that was fitted to rounded ones carries
    their rounding once more.
    """
    left: float = 0.0
    """Part of the largest value by which the numbers of an engine that makes this
    mistake may miss the prediction.
    """

    @property
    def fitted(self) -> bool:
        """Return whether a number of the mistake was fitted to the table."""
        return self.times > 1.0

    def within(self, names: Collection[str], words: str = "") -> "Mistake":
        """Return the mistake made in these quantities alone; words end its text."""

        def predict(quantity: str) -> Array | None:
            return self.predict(quantity) if quantity in names else None

        return self._replace(text=f"{self.text}{words}", predict=predict)

    def mirrored(self, y: float) -> "Mistake":
        """Return the mistake with angles, rates and torques of the opposite sign.

        The y components of its vectors are multiplied by a factor.
        """

        def predict(quantity: str) -> Array | None:
            values = self.predict(quantity)
            if values is None:
                return None
            if values.ndim == 2:
                return np.asarray(values * (1.0, y))
            return -values if find_unit_of_quantity(quantity) in _TURNING else values

        return self._replace(predict=predict)


def solve_other(text: str, scene: Scene, at: Command) -> Mistake:
    """Return the mistake of another problem than the one that was set.

    The other problem is solved when its numbers are asked for; without such a scene
    the mistake has none.
    """

    @cache
    def solved() -> Solution | None:
        try:
            return solve(scene, at=at)
        except FourBarError:
            return None

    def predict(quantity: str) -> Array | None:
        solution = solved()
        if solution is None or quantity in (at.commanded, *_OF_FORMULAS):
            return None
        return compute_column(solution, quantity)

    return Mistake(text, predict)


def drop_remainder(command: Command) -> Command:
    """Return a command without what its doubles leave out."""
    if isinstance(command.origin, StrokeOrigin):
        return command._replace(origin=command.origin._replace(lost=None))
    return command.as_doubles()


def state_all(scene: Scene) -> Scene:
    """State every number that a mistake may change: bars in full, places, gravity."""
    bars = {
        name: replace(
            bar,
            density=None,
            mass_per_length=None,
            inertia=bar.moment_of_inertia,
            centre=bar.mass_centre,
        )
        for name, bar in list_moving(scene)
    }
    named = {point.name: point.place for point in scene.points}
    scene = scene.with_places(lambda place: named.get(place.point or "", place))
    if not any(isinstance(effect, Gravity) for effect in scene.effects):
        scene = replace(scene, effects=(*scene.effects, Gravity(0.0)))
    return replace_bars(scene, **bars)


def group_numbers(scene: Scene, places: bool) -> dict[str, Numbers]:
    """List the numbers of a scene that are not 0, one by one and under one name.

    The name is a key, or the part of it that several have in common. Numbers that say
    where something acts (`places`) are put together with those of the same name alone;
    the others with all that acts with them.
    """
    groups: dict[str, Numbers] = {}
    for key, entry in list_entries(scene).items():
        acts = key.startswith(("bars.", "loads.", "effects."))
        value = read_number(scene, entry)
        is_other = (entry.unit in _PLACE_UNITS) != places or key == GRAVITY_ANGLE
        if not acts or not value or is_other:
            continue
        parts = key.split(".")
        which = 2 if parts[0] == "effects" else 1
        shared = ".".join([*parts[:which], "*", *parts[which + 1 :]])
        names = [key]
        if not places:
            names += [".".join(parts[:end]) for end in range(len(parts) - 1, 0, -1)]
            names += ["effects.*: damping and friction"] * (parts[1] in _DAMPING)
        if which < len(parts) - 1:
            names.append(shared)
        for name in names:
            groups.setdefault(name, {})[key] = value
    unlike: dict[str, Numbers] = {}
    for name, group in groups.items():
        if group not in unlike.values():
            unlike[name.removesuffix(".0")] = group
    return unlike


def list_wrong_scenes(scene: Scene) -> Iterator[tuple[str, Scene]]:
    """List scenes in place of one that states every number, the plainest first."""
    multiples = dict(_multiply_numbers(scene, places=False))
    if scene.loads and any(text.startswith("effects") for text in multiples):
        bare = replace(scene, loads=(), effects=())
        yield "loads and effects left out: inertia alone", bare
    for text, numbers in (
        *multiples.items(),
        *_list_wrong_numbers(scene),
        *_list_wrong_bars(scene),
        *_multiply_numbers(scene, places=True),
    ):
        yield text, replace_numbers(scene, numbers)
    for text, loads in _list_wrong_loads(scene):
        yield text, replace(scene, loads=loads)
    for bar in MOVING_BARS:
        if scene.drive is None and bar != scene.drive_bar:
            text = f"the torque acts on bar {bar} instead of bar {scene.drive_bar}"
            yield text, replace(scene, drive_bar=bar)


def _multiply_numbers(scene: Scene, places: bool) -> Iterator[tuple[str, Numbers]]:
    """List numbers of a scene left out, doubled or reversed."""
    for name, group in group_numbers(scene, places).items():
        for factor, done in _DONE.items():
            if factor >= 0.0 or not any(key.endswith(".mass") for key in group):
                yield f"{name} {done}", {key: factor * x for key, x in group.items()}


def _list_wrong_numbers(scene: Scene) -> Iterator[tuple[str, Numbers]]:
    """List other numbers of inertia and of gravity."""
    gravity = find_gravity(scene)
    for text, (by_mass, by_inertia) in _INERTIAL.items():
        numbers = {"effects.gravity.0": gravity.magnitude / by_mass}
        for name, bar in list_moving(scene):
            numbers[f"bars.{name}.mass"] = by_mass * bar.mass
            numbers[f"bars.{name}.inertia"] = by_inertia * bar.moment_of_inertia
        yield text, numbers
    if not gravity.magnitude:
        text = "gravity along -y is included though the scene has none"
        for size in _GRAVITIES:
            along_y = {"effects.gravity.0": size, GRAVITY_ANGLE: -math.pi / 2.0}
            yield f"{text}: {size} m/s^2", along_y
    with_ground = gravity.angle + scene.linkage.ground_angle
    yield "gravity is turned with the ground", {GRAVITY_ANGLE: with_ground}


def _list_wrong_bars(scene: Scene) -> Iterator[tuple[str, Numbers]]:
    """List other masses, centres and inertias of each bar, and of all of them."""
    moving = list_moving(scene)
    every: dict[str, Numbers] = {}
    for name, bar in moving:
        r, phi = bar.mass_centre
        x, y = bar.length - r * math.cos(phi), r * math.sin(phi)
        steiner = bar.mass * r * r
        from_other = {"centre.0": math.hypot(x, y), "centre.1": math.atan2(y, x)}
        at_middle = {"centre.0": bar.length / 2.0, "centre.1": 0.0}
        slender = bar.mass * bar.length**2 / 12.0
        wrong = {
            "inertia about the pin used as the inertia about G": {
                "inertia": bar.moment_of_inertia + steiner
            },
            "inertia about G used as the inertia about the pin": {
                "inertia": bar.moment_of_inertia - steiner
            },
            "mass centre measured from the wrong pin": from_other,
            "mass centre measured from the wrong pin, its angle too": {
                **from_other,
                "centre.1": math.atan2(-y, x),
            },
            "mass centre taken at mid-bar": at_middle,
            "mass centre taken at mid-bar, with m L^2/12": {
                **at_middle,
                "inertia": slender,
            },
        }
        for text, numbers in wrong.items():
            keyed = {f"bars.{name}.{key}": value for key, value in numbers.items()}
            yield f"bars.{name}: {text}", keyed
            every.setdefault(f"bars.*: {text}", {}).update(keyed)
    yield from every.items()


def find_gravity(scene: Scene) -> Gravity:
    """Return the gravity of a scene that states every number."""
    (gravity,) = (one for one in scene.effects if isinstance(one, Gravity))
    return gravity


def _list_wrong_loads(scene: Scene) -> Iterator[tuple[str, tuple[Load, ...]]]:
    """Let each load, and every load, act elsewhere or in another direction.

    Loads take off the weight of each bar.
    """
    changed: dict[str, dict[int, Load]] = {}
    for number, load in enumerate(scene.loads):
        for text, fields in _list_changes(scene, load).items():
            with suppress(InputError):  # no load can be so
                other = replace(load, **fields)
                changed[f"loads.{number} (bar {load.bar}): {text}"] = {number: other}
                changed.setdefault(f"loads.*: {text}", {})[number] = other
    for text, others in changed.items():
        if len(others) > 1 or not text.startswith("loads.*"):
            numbered = enumerate(scene.loads)
            yield text, tuple(others.get(number, load) for number, load in numbered)
    gravity = find_gravity(scene)
    for name, bar in list_moving(scene):
        lift = Load(BAR_NUMBERS[name], (-gravity.magnitude * bar.mass, gravity.angle))
        yield f"the weight of bar {lift.bar} is missing", (*scene.loads, lift)


def _list_changes(scene: Scene, load: Load) -> dict[str, dict[str, Any]]:
    """List the fields of a load that may be others, by the mistake."""
    changes: dict[str, dict[str, Any]] = {}
    if load.table is not None:
        changes["its table is left out"] = {"table": None}
    if load.force is None:
        return changes
    length = scene.linkage.bar(load.bar).length
    places: dict[str, dict[str, Any]] = {
        "its force acts at G of the bar": {"from_centre": (0.0, 0.0)},
        "its force acts at the first pin of the bar": {"from_pin": (0.0, 0.0)},
        "its force acts at the second pin of the bar": {"from_pin": (length, 0.0)},
        "its place is measured from G, not from the bar's first pin": {
            "from_centre": load.from_pin
        },
        "its place is measured from the bar's first pin, not from G": {
            "from_pin": load.from_centre
        },
    }
    if load.from_pin is not None:
        from_second = complex(*resolve(*load.from_pin)) + length
        text = "its place is measured from the bar's second pin, not from its first"
        places[text] = {"from_pin": cmath.polar(from_second)}
    if load.arm is not None:
        moment = cross_products(
            complex(*resolve(*load.arm)), complex(*resolve(*load.force))
        )
        text = "its arm is measured from the bar's first pin, not from G"
        places[text] = {"from_pin": (0.0, 0.0), "moment": load.moment + moment}
    for text, place in places.items():
        if None not in place.values():
            changes[text] = {**dict.fromkeys(PLACES_OF_LOADS), **place}
    if load.frame == "bar":
        changes["its direction is kept"] = {"frame": "world"}
    else:
        changes["its direction turns with the bar"] = {"frame": "bar"}
    return changes
