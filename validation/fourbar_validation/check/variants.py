"""Mistakes as hypotheses, and wrong problems that they amount to.

A mistake in what was solved is another scene or another command, which the formulas
solve as they solve the right one.
"""

import math
from collections.abc import Callable, Collection
from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from fourbar.effects import Gravity, Table
from fourbar.errors import FourBarError, InputError
from fourbar.quantities import (
    COUPLE,
    LINE,
    SPRING_NAME,
    UNITS,
    Array,
    find_derived,
)
from fourbar.scene import Command, Scene, StrokeOrigin
from fourbar.show.acting import list_springs
from fourbar.show.derived import derive
from fourbar.solution import Solution, find_unit_of_quantity
from fourbar.solving import solve
from fourbar_validation.scenes.bars import list_moving, replace_bars

Predict = Callable[[str], Array | None]
"""Function of a quantity that returns the numbers of a mistake; None: it has none."""

_OF_FORMULAS = (*COUPLE[1:], *LINE[1:])
"""Quantities that no wrong problem changes: an error and a range are the formulas'."""
_TURNING = ("rad", "rad/s", "rad/s^2", "N m")
"""Units of what is reversed where angles are counted clockwise."""


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


def compute_column(solution: Solution, name: str) -> Array | None:
    """Compute a column from O2, (n,) or (n, 2); None if its stage was not evaluated."""
    values: Array | None
    if name in UNITS:
        values = getattr(solution, name)
        return values
    if find_derived(name) is None:
        of_stage = {"v_": solution.velocity, "a_": solution.acceleration}
        stage = of_stage.get(name[:2], solution.points)
        return stage.get(name[2:] if name[:2] in of_stage else name)
    of_spring = SPRING_NAME.fullmatch(name)
    if of_spring and int(of_spring[1]) >= len(list_springs(solution.scene)):
        raise InputError("header", name, "does not exist in this scene")
    values = derive(solution, name)
    return values


def solve_other(text: str, scene: Scene, at: Command, times: float = 1.0) -> Mistake:
    """Return the mistake of another problem than the one that was set.

    It is solved when its numbers are asked for; without such a scene it has none.
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

    return Mistake(text, predict, times=times)


def drop_remainder(command: Command) -> Command:
    """Return a command without what its doubles leave out."""
    if isinstance(command.origin, StrokeOrigin):
        return command._replace(origin=command.origin._replace(lost=None))
    return command.as_doubles()


class OpenTable(Table):
    """Table whose factor is NaN, and no error, at an angle that it does not cover."""

    def replace_outside(self, theta_2: Any) -> float:
        """Return NaN: what acts there is not known."""
        return math.nan


def open_tables(scene: Scene) -> Scene:
    """Let positions of hypotheses lie beyond the tables of loads, and have no force."""
    loads = tuple(
        load
        if load.table is None
        else replace(load, table=OpenTable(load.table.theta_2, load.table.factor))
        for load in scene.loads
    )
    return replace(scene, loads=loads)


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
