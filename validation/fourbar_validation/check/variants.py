"""Mistakes as hypotheses, and wrong problems that they amount to, solved at once.

A mistake in what was solved is another number of the scene or another command: one
member of a study, whose members together take a tenth of the time of one by one.
"""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from fourbar.effects import Gravity, Table
from fourbar.quantities import UNITS, VECTORS, Array
from fourbar.scene import Command, Scene, StrokeOrigin
from fourbar.studies.keys import list_entries, read_number
from fourbar.studies.study import Study
from fourbar_validation.scenes.bars import list_moving, replace_bars

Predict = Callable[[str], Array | None]
"""Function of a quantity that returns the numbers of a mistake; None: it has none."""

_TURNING = ("rad", "rad/s", "rad/s^2", "N m")
"""Units of what is reversed where angles are counted clockwise."""
Wanted = Callable[[str], bool]
"""Function of the text of a mistake that returns True if it is tried."""


def always(text: str) -> bool:
    """Want every mistake."""
    return True


class Mistake(NamedTuple):
    """A mistake as a hypothesis: what was done, and what the numbers become."""

    text: str
    predict: Predict
    whole: bool = True
    """True if it was made in the calculation and shows in every quantity. A column's
    unit shows in that column only.
    """
    times: float = 1.0
    """Factor on the allowed error. A number that was fitted to rounded ones carries
    their rounding once more.
    """
    left: float = 0.0
    """Part of the largest value by which an engine may miss the prediction. The engine
    makes this mistake.
    """

    @property
    def fitted(self) -> bool:
        """Return True if a number of it was fitted to the table."""
        return self.times > 1.0


class Variant(NamedTuple):
    """Problem that somebody solved in place of the one that was set."""

    text: str
    """Mistake that leads to it."""
    numbers: Mapping[str, float] = {}
    """Numbers of the scene that are others, by key."""
    at: Command | None = None
    """Other command, if it is another one."""
    names: Collection[str] = UNITS
    """Quantities that were taken from it."""
    times: float = 1.0
    """Factor on what is allowed, where the rounding of an angle is magnified."""
    mirror: float = 0.0
    """Factor on y where angles, their rates and torques are reversed; 0: they are not.
    """


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
    """State every number that a variant may change: bars in full, and gravity."""
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
    if not any(isinstance(effect, Gravity) for effect in scene.effects):
        scene = replace(scene, effects=(*scene.effects, Gravity(0.0)))
    return replace_bars(scene, **bars)


def predict_variants(
    scene: Scene,
    at: Command,
    variants: Sequence[Variant],
    stage: str = "force",
) -> list[Mistake]:
    """Solve the variants of a scene that states all, to a stage or the end."""
    entries = list_entries(scene)
    keys = {key for variant in variants for key in variant.numbers}
    values = {}
    invalid = np.zeros(len(variants), dtype=bool)
    for key in keys:
        usual = read_number(scene, entries[key])
        column = [variant.numbers.get(key, usual) for variant in variants]
        values[key] = np.array(column, dtype=float)
        invalid |= ~entries[key].holds(values[key])
    commands = [_leave_out_lost(variant.at or at) for variant in variants]
    together: Command = _stack(commands, len(at.angle))
    together = together._replace(bar=at.bar)
    stage = "position" if at.speed is None else stage
    wrong = Study(scene, values, invalid, together).solve(stage)

    def predict(member: int, variant: Variant, quantity: str) -> Array | None:
        values = getattr(wrong, quantity, None)
        commanded = quantity == at.commanded
        if values is None or commanded or quantity not in variant.names:
            return None
        factor: Any = 1.0
        if variant.mirror and quantity in VECTORS:
            factor = 1.0, variant.mirror
        elif variant.mirror and UNITS[quantity] in _TURNING:
            factor = -1.0
        return np.asarray(values[member] * factor)

    return [
        Mistake(variant.text, partial(predict, member, variant), times=variant.times)
        for member, variant in enumerate(variants)
    ]


def _leave_out_lost(command: Command) -> Command:
    """Return a command without what its doubles leave out."""
    if isinstance(command.origin, StrokeOrigin):
        return command._replace(origin=command.origin._replace(lost=None))
    return command.as_doubles()


def _stack(values: Sequence[Any], n: int) -> Any:
    """Stack the fields of m commands and of their origins to (m, n) each.

    A field that is not stated is None.
    """
    first = values[0]
    if first is None:
        return None
    if isinstance(first, tuple):
        fields = zip(*values, strict=True)
        return type(first)(*(_stack(field, n) for field in fields))
    return np.stack([np.broadcast_to(value, (n,)) for value in values])
