"""Known mistakes as hypotheses.

The numbers that each would make are held against the table.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import chain, product
from typing import Any, NamedTuple

import numpy as np

from fourbar.formulas.mobility import TURN
from fourbar.linkage import MOVING_BARS
from fourbar.quantities import FORCE_NAMES, PIN_FORCES, Array
from fourbar.scene import Command, Scene
from fourbar.solution import Solution
from fourbar_validation.check.calculated import find_miscalculated, take_theirs
from fourbar_validation.check.fitted import (
    ENOUGH_DIGITS,
    ENOUGH_NUMBERS,
    FITTED,
    REVERSED,
    find_fitted,
)
from fourbar_validation.check.judge_table import Judge, JudgedColumn, compute_column
from fourbar_validation.check.row_commands import RowCommands, command_rates
from fourbar_validation.check.wrong_scenes import (
    Mistake,
    drop_remainder,
    list_wrong_scenes,
    solve_other,
    state_all,
)
from fourbar_validation.compare.tolerance import wrap_difference

_RPM = np.pi / 30.0
"""rad/s of one rev/min."""
_DEGREES_TAKEN = {
    "in deg/{0} taken for rad/{0}": float(np.degrees(1.0)),
    "in rad/{0} taken for deg/{0}": float(np.radians(1.0)),
}
"""Factors on the speed or acceleration that is commanded, by the unit mistaken."""
_OF_SPEEDS = {
    "in rev/min taken for rad/s": 1.0 / _RPM,
    "in rad/s taken for rev/min": _RPM,
    "in rev/s taken for rad/s": 1.0 / TURN,
    "in deg/s taken for rev/min": 6.0,
    "in rev/min taken for deg/s": 1.0 / 6.0,
    **_DEGREES_TAKEN,
}
"""The same of a speed."""
_OTHER_BRANCH = "the other branch"
_CLOCKWISE = "counted clockwise, with all angles and torques"
_WHERE = {
    " in the pin forces alone": PIN_FORCES,
    " in what drives alone": tuple({*FORCE_NAMES} - {*PIN_FORCES}),
}
"""Quantities in which a mistake may show, by what is added to its text."""
_NEARLY_AT_REST = 1e-18
"""Factor on a speed of which only the sign is left."""
MOST_EXPLANATIONS = 5
"""Explanations that are printed."""


def list_column_mistakes(right: Solution) -> Iterator[Mistake]:
    """List the mistakes that a column can have by itself."""
    for text, (change, kinds) in _COLUMN_MISTAKES.items():
        predict = partial(_change_column, right, change, kinds)
        yield Mistake(text, predict, whole=False)
    to_180 = np.abs(wrap_difference(right.theta_4 - right.theta_3))
    for text, angle in {"": to_180, ", on the other side": np.pi - to_180}.items():
        counted = {"transmission": angle}
        yield Mistake(f"counted to 180 deg{text}", counted.get, whole=False)
    rates = _ANGULAR[:1] if right.at.speed is None else _ANGULAR
    for bar in (2, 3):
        turning = {
            f"{rate}_{other}": right[f"{rate}_{other}"] - right[f"{rate}_{bar}"]
            for rate, other in product(rates, MOVING_BARS)
            if other != bar
        }
        text = f"relative to bar {bar} instead of the ground"
        yield Mistake(text, turning.get, whole=False)


def list_hypotheses(scene: Scene, command: Command) -> Iterator[Mistake]:
    """List every other problem that may have been solved, the simplest first."""
    at = drop_remainder(command)
    stated = state_all(scene)
    yield from _list_other_commands(stated, at)
    for text, other in list_wrong_scenes(stated):
        mistake = solve_other(text, other, at)
        yield mistake
        if text.startswith(("loads", "effects", "the torque")):
            for words, names in _WHERE.items():
                yield mistake.within(names, words)


def list_rates_of_rows(
    judge: Judge, differing: list[JudgedColumn]
) -> Iterator[Mistake]:
    """List the motion at the rates of the rows, as of a log, if more than these differ.

    The rates are judged where the scene states its own.
    """
    fields = dict(zip(("speed", "acceleration"), judge.at.names[1:], strict=True))
    table = replace(judge.stated, is_rounded=True)
    stated = {
        field: table.columns[name]
        for field, name in fields.items()
        if name in judge.columns
    }
    others = any(one.key not in fields.values() for one in differing)
    if "speed" in stated and others and not judge.at.moves_stroke:
        text = "each row has its own speed"
        if judge.scene.motion.law is None:
            text += f": leave {' and '.join(fields.values())} out of the scene"
        rows = command_rates(RowCommands(judge.at, judge.rows.near), table, stated)
        logged = Judge(judge.scene, table, judge.tolerance, rows, judge.slack)

        def predict(quantity: str) -> Array | None:
            values = compute_column(logged.right, quantity)
            return take_theirs(
                logged, values, quantity, lambda column: column.answered & ~column.wrong
            )

        yield Mistake(text, predict)


def _change_column(
    right: Solution,
    change: Callable[[Array], Array],
    kinds: str | tuple[str, ...],
    quantity: str,
) -> Array | None:
    values = compute_column(right, quantity)
    if values is None or not quantity.startswith(kinds):
        return None
    return change(values)


def _list_other_commands(scene: Scene, at: Command) -> Iterator[Mistake]:
    """List other angles, speeds and accelerations of the commanded bar."""

    def change(text: str, **fields: Any) -> Mistake:
        return solve_other(text, scene, at._replace(**fields))

    name, omega, alpha = at.names
    yield change(_OTHER_BRANCH, branch=-at.branch)
    if at.speed is not None:
        yield change("no inertial forces (statics)", speed=0.0, acceleration=0.0)
        slow = _NEARLY_AT_REST * at.speed
        text = "no inertial forces (statics), with friction"
        yield change(text, speed=slow, acceleration=0.0).within(FORCE_NAMES)
        yield change(f"{omega} is reversed", speed=-at.speed)
        if np.any(at.acceleration):
            yield change(f"{omega} is left out", speed=slow)
            yield change(f"{alpha} is left out", acceleration=0.0)
            yield change(f"{alpha} is reversed", acceleration=-at.acceleration)
    if ground := scene.linkage.ground_angle:
        # a cylinder turns its bar with the ground
        turned = ground if at.moves_stroke else 0.0
        level = replace(scene, linkage=replace(scene.linkage, ground_angle=0.0))
        level_at = at._replace(angle=at.angle - turned)
        yield solve_other("ground_angle is left out", level, level_at)
    if at.moves_stroke:
        return
    yield change(f"{name} read as degrees", angle=np.radians(at.angle))
    # a whole turn is 6.28 of these degrees
    in_degrees = np.degrees(np.fmod(at.angle, TURN))
    text = f"{name} in radians where degrees were announced"
    yield change(text, angle=in_degrees)._replace(times=float(np.degrees(1.0)))
    clockwise = change(f"{name} {_CLOCKWISE}", angle=-at.angle)
    yield clockwise.mirrored(1.0)
    text = f"{clockwise.text}, and y reversed"
    yield clockwise.mirrored(-1.0)._replace(text=text)
    if at.speed is None:
        return
    text = f"the motion is clockwise: {name}, {omega} and {alpha} are reversed"
    reverse = {"speed": -at.speed, "acceleration": -at.acceleration}
    yield change(text, angle=-at.angle, **reverse)
    for words, factor in _OF_SPEEDS.items():
        yield change(f"{omega} {words.format('s')}", speed=at.speed * factor)
    if np.any(at.acceleration):
        for words, factor in _DEGREES_TAKEN.items():
            other = at.acceleration * factor
            yield change(f"{alpha} {words.format('s^2')}", acceleration=other)


_ANGULAR = ("theta", "omega", "alpha")
_OTHER_END = "measured from the other end of the bar (half a turn off): theta_4 or"
_OTHER_END += " theta_3 from B, theta_2 from A"
_COLUMN_MISTAKES: dict[str, tuple[Any, Any]] = {
    REVERSED: (np.negative, ""),
    "the sign is lost: sizes alone": (np.abs, ""),
    "degrees where radians were announced": (np.degrees, _ANGULAR),
    "degrees from -180 to 180 where radians were announced": (
        lambda values: np.degrees(np.remainder(values + np.pi, TURN) - np.pi),
        "theta",
    ),
    "degrees from 0 to 360 where radians were announced": (
        lambda values: np.degrees(np.remainder(values, TURN)),
        "theta",
    ),
    _OTHER_END: (lambda values: values + np.pi, "theta"),
}
"""Change of the values by a mistake in a column, and beginnings of the names of
quantities whose columns can have it.
"""


ENOUGH_EXPLAINED = 0.9
"""Part of the quantities that differ which must agree once a mistake is assumed, or the
mistakes of several columns together.
"""


class Explanation(NamedTuple):
    """A mistake that accounts for what differs."""

    text: str
    quantities: tuple[str, ...]
    """The quantities that agree once it is assumed."""
    complete: bool
    """True if every quantity that differed now agrees."""
    whole: bool = True
    """True if the mistake is one of the calculation, False if it is one of columns."""

    def narrows(self, other: "Explanation") -> bool:
        """Tell whether the text adds to another's, and nothing shows what it adds."""
        more = (f"{other.text},", f"{other.text} ")
        adds = self.text.startswith(more)
        if other.text == _OTHER_BRANCH:  # its angles are those of the mirror image
            adds = adds or _CLOCKWISE in self.text
        alike = self.quantities == other.quantities and self.whole == other.whole
        return alike and adds


@np.errstate(all="ignore")
def explain(
    judge: Judge,
    differing: list[JudgedColumn],
) -> list[Explanation]:
    """Find the mistakes under which nine tenths of what differs agrees.

    The most complete come first, of these the plainest. A fitted number is left out if
    a mistake of the calculation with a plain name explains as much. Such a mistake
    breaks no quantity that agreed as it was; those of columns count together.
    """
    least = ENOUGH_EXPLAINED * len(differing)
    found: list[Explanation] = []
    plainest_first = chain(
        list_column_mistakes(judge.right),
        list_hypotheses(judge.scene, judge.at),
        list_rates_of_rows(judge, differing),
        find_miscalculated(judge),
        find_fitted(judge, differing),
    )
    for mistake in plainest_first:
        explained = _list_explained(judge, mistake, differing, least)
        if explained:
            explanation = Explanation(
                mistake.text,
                tuple(column.label for column in explained),
                len(explained) == len(differing),
                mistake.whole,
            )
            if not any(map(explanation.narrows, found)):
                found.append(explanation)
    plain = [one for one in found if not one.text.endswith(FITTED)]
    most = max((len(one.quantities) for one in plain if one.whole), default=0)
    named = set().union(*(one.quantities for one in plain))
    found = plain + [
        one
        for one in found
        if one not in plain
        and (len(one.quantities) > most if one.whole else {*one.quantities} - named)
    ]
    of_columns = [one.quantities for one in found if not one.whole]
    if len(set().union(*of_columns)) < least:
        found = [one for one in found if one.whole]

    def rank(one: Explanation) -> tuple[int, bool, bool]:
        return -len(one.quantities), one.text.endswith(FITTED), not one.whole

    unlike: dict[object, Explanation] = {}
    for one in sorted(found, key=rank):
        unlike.setdefault((one.text, one.quantities), one)
    return list(unlike.values())[:MOST_EXPLANATIONS]


def _list_explained(
    judge: Judge,
    mistake: Mistake,
    differing: list[JudgedColumn],
    least: float,
) -> list[JudgedColumn]:
    """List the columns that differ and agree once a mistake is assumed.

    Empty if a mistake of the calculation explains fewer than `least`, breaks one that
    agreed, may do so by chance, or is fitted to fewer than ENOUGH_NUMBERS. Empty too if
    the right numbers lie within what the mistake allows: then there is nothing to
    explain.
    """
    explained = []
    possible = len(differing)
    numbers = 0
    digits = 0.0
    slack = mistake.times, mistake.left
    others = judge.columns.values() if mistake.whole else ()
    for column in dict.fromkeys((*differing, *others)):
        predicted = column.predict(mistake.predict)
        if predicted is not None and np.array_equal(
            predicted, column.ours, equal_nan=True
        ):
            predicted = None
        agrees = predicted is not None and column.explained(predicted, *slack)
        if column not in differing:
            if predicted is not None and not agrees:
                return []
        elif agrees:
            explained.append(column)
            excess = column.excess
            wrong = (excess > 1.0) & column.where
            numbers += int(wrong.sum())
            digits += float(np.log10(excess[wrong]).sum())
        else:
            possible -= 1
            if mistake.whole and possible < least:
                return []
    if mistake.whole and mistake.fitted and numbers < ENOUGH_NUMBERS:
        return []
    if mistake.whole and digits < ENOUGH_DIGITS:
        return []
    if all(column.explained(column.ours, *slack) for column in explained):
        return []
    return [column for column in judge.columns.values() if column in explained]
