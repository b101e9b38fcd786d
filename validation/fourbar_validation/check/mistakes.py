"""Known mistakes as hypotheses.

The numbers that each would make are held against the table.
"""

from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import Any

import numpy as np

from fourbar.effects import Effect, Gravity
from fourbar.errors import FourBarError
from fourbar.formulas.mobility import TURN
from fourbar.linkage import Bar
from fourbar.quantities import FORCE_NAMES, LINE, PIN_FORCES, VECTORS, Array
from fourbar.scene import Command, Scene, StrokeOrigin
from fourbar.solution import Solution
from fourbar.solving import solve
from fourbar_validation.check.calculated import (
    ENOUGH_POSITIONS,
    find_miscalculated,
    find_single_precision,
)
from fourbar_validation.check.fitted import ENOUGH_NUMBERS, find_fitted
from fourbar_validation.check.judge import Judge
from fourbar_validation.check.variants import (
    Mistake,
    Predict,
    Variant,
    predict_variants,
    state_all,
)
from fourbar_validation.scenes.bars import list_moving

RPM = np.pi / 30.0
"""rad/s of one rev/min."""
_GRAVITY_TURNED = {
    "turned by 90 deg": np.pi / 2.0,
    "turned by -90 deg": -np.pi / 2.0,
}
"""Directions that gravity may be given, by their angle from the right one."""
MOST_EXPLANATIONS = 5
"""Explanations that are printed."""
_BETWEEN = {
    "half a step late: numbers between a position and the one before": 1,
    "half a step early: numbers between a position and the one after": -1,
}
"""Mistakes in time, and the side on which the numbers were taken."""


def list_column_mistakes() -> Iterator[Mistake]:
    """List the mistakes that a column can have by itself."""
    for text, change, applies in _COLUMN_MISTAKES:
        yield Mistake(text, partial(_change_column, change, applies), whole=False)
    for bar in (2, 3):
        yield Mistake(
            f"relative to bar {bar} instead of the ground",
            partial(_subtract_angle_of, bar),
            whole=False,
        )


def list_hypotheses(scene: Scene, command: Command) -> Iterator[Mistake]:
    """List every mistake that can be made on this scene, the simplest first."""
    if command.speed is not None:
        yield from _scale_inertial(scene, command)
        yield from _scale_actions(scene, command)
        yield from _take_differences(scene, command)
    variants = list(_list_variants(scene, command))
    predictions = predict_variants(state_all(scene), command, variants)
    for variant, predict in zip(variants, predictions, strict=True):
        yield Mistake(variant.text, predict, times=variant.times)
    if command.speed is not None:
        for text, changed in _list_other_scenes(scene):
            with suppress(FourBarError):  # the mistake leaves no valid scene
                wrong = solve(changed, "force", at=command)
                yield Mistake(text, partial(_take_from, wrong))


def _change_column(
    change: Callable[[Array], Array],
    applies: Callable[[str], bool],
    quantity: str,
    right: Solution,
) -> Array | None:
    values = getattr(right, quantity, None)
    if applies(quantity) and values is not None:
        return change(values)
    return None


def _subtract_angle_of(
    bar: int,
    quantity: str,
    right: Solution,
) -> Array | None:
    """Take an angle, or its rate, from the line of another bar."""
    if not _is_angular(quantity) or quantity.endswith(str(bar)):
        return None
    values, base = (
        getattr(right, name, None) for name in (quantity, f"{quantity[:-1]}{bar}")
    )
    if values is None or base is None:
        return None
    return np.asarray(values - base)


def _take_from(
    wrong: Solution,
    quantity: str,
    right: Solution,
) -> Array | None:
    return getattr(wrong, quantity, None)


def _scale_inertial(scene: Scene, command: Command) -> Iterator[Mistake]:
    """Scale the inertial forces against the loads.

    Forces and torque are linear in each.
    """
    bare = state_all(replace(scene, loads=(), effects=()))
    names = [f"bars.{name}" for name, _ in list_moving(scene)]
    pointlike = Variant("I = 0", {f"{name}.inertia": 0.0 for name in names})
    massless = Variant("m = 0", {f"{name}.mass": 0.0 for name in names})
    of_mass, of_inertia = predict_variants(bare, command, (pointlike, massless))

    def scaled(
        by_mass: float,
        by_inertia: float,
    ) -> Callable[[str, Solution], Array | None]:
        def predict(quantity: str, right: Solution) -> Array | None:
            if quantity not in FORCE_NAMES:
                return None
            m_a = of_mass(quantity, right)
            i_alpha = of_inertia(quantity, right)
            if m_a is None or i_alpha is None:
                return None
            extra = (by_mass - 1.0) * m_a + (by_inertia - 1.0) * i_alpha
            return np.asarray(getattr(right, quantity) + extra)

        return predict

    yield Mistake(
        "m a and I alpha in kg cm/s^2 and kg cm^2/s^2, added to N and N cm: 100 times",
        scaled(1e2, 1e2),
    )
    yield Mistake("m a in kg cm/s^2 added to N: 100 times too large", scaled(1e2, 1.0))
    yield Mistake(
        "I alpha in kg cm^2/s^2 added to N cm: 100 times too large", scaled(1.0, 1e2)
    )
    yield Mistake(
        "m a and I alpha in kg mm/s^2 and kg mm^2/s^2, added to N and N mm: 1000 times",
        scaled(1e3, 1e3),
    )
    yield Mistake("m a in kg mm/s^2 added to N: 1000 times too large", scaled(1e3, 1.0))
    yield Mistake(
        "inertial forces with the wrong sign (d'Alembert's forces put on the side of"
        " m a)",
        scaled(-1.0, -1.0),
    )
    yield Mistake("I alpha with the wrong sign", scaled(1.0, -1.0))


_EFFECT_NAMES = {
    "gravity": "gravity",
    "springs": "the springs",
    "torsion": "the torsion springs",
    "viscous": "the viscous damping",
    "friction": "the dry friction",
    "pin_friction": "the friction of the pin load",
    "flywheel": "the flywheel",
}
"""Names of the effects of the package, by their keys."""
_PART_FIELDS = {
    "springs": "springs",
    "torsion": "springs",
    "viscous": "coefficients",
    "friction": "torques",
    "pin_friction": "pins",
}
"""Field with the parts of an effect, by its key."""
_SCALED = {0.0: "missing", 2.0: "doubled", -1.0: "reversed"}
"""Factors on what acts besides inertia, and what was done to it."""
_WHERE = {
    "": FORCE_NAMES,
    " in the pin forces alone": PIN_FORCES,
    " in what drives alone": ("torque", LINE.value),
}
"""Quantities in which that was done."""


def _scale_actions(scene: Scene, command: Command) -> Iterator[Mistake]:
    """Leave out, double or reverse each load and effect, and each part of one.

    Forces and torque are linear in each but the friction of the pin load.
    """
    for name, without in _list_without(scene):
        try:
            left = solve(without, "force", at=command)
        except FourBarError:  # nothing can drive or hold the scene without it
            continue
        verb = "are" if name.endswith("s") else "is"
        for factor, done in _SCALED.items():
            for where, names in _WHERE.items():
                predict = partial(_scale_from, left, factor, names)
                yield Mistake(f"{name} {verb} {done}{where}", predict)


def _scale_from(
    without: Solution,
    factor: float,
    names: Collection[str],
    quantity: str,
    right: Solution,
) -> Array | None:
    values = getattr(right, quantity, None)
    if quantity not in names or values is None:
        return None
    left = getattr(without, quantity)
    return np.asarray(left + factor * (values - left))


def _list_without(scene: Scene) -> Iterator[tuple[str, Scene]]:
    """List what acts besides inertia, each with the scene without it."""
    if scene.loads:
        yield "the loads", replace(scene, loads=())
    for number, load in enumerate(scene.loads, 1):
        loads = tuple(one for one in scene.loads if one is not load)
        yield f"load {number} (bar {load.bar})", replace(scene, loads=loads)
    for effect in scene.effects:
        name = _EFFECT_NAMES.get(effect.key, f"effect {effect.key}")
        others = tuple(one for one in scene.effects if one is not effect)
        yield name, replace(scene, effects=others)
        for text, changed in _list_without_part(effect, name):
            yield text, replace(scene, effects=(*others, changed))


def _list_without_part(effect: Any, name: str) -> Iterator[tuple[str, Effect]]:
    """List the parts of an effect, each with the effect without it."""
    field = _PART_FIELDS.get(effect.key, "")
    parts = getattr(effect, field, ())
    for i, part in enumerate(parts):
        if len(parts) > 1:
            kept = {field: (*parts[:i], *parts[i + 1 :])}
            yield f"part {i + 1} of {name}", replace(effect, **kept)
        for text, relaxed in _relax(effect.key, part):
            kept = {field: (*parts[:i], relaxed, *parts[i + 1 :])}
            yield f"the {text} spring {i + 1}", replace(effect, **kept)


def _relax(key: str, spring: Any) -> Iterator[tuple[str, Any]]:
    """List the numbers that shift a spring's force, each with it left out."""
    if key == "springs":
        for text, name in {"preload": "preload", "free length": "length"}.items():
            if getattr(spring, name):
                with suppress(FourBarError):  # one that acts one way needs its length
                    yield f"{text} of", replace(spring, **{name: 0.0})
    elif key == "torsion":
        for text, place in {"rest angle": 2, "preload": 3}.items():
            if spring[place]:
                relaxed = (*spring[:place], 0.0, *spring[place + 1 :])
                yield f"{text} of torsion", relaxed


_DIFFERENCES = {
    "forward": ((0, 1), (0, 1, 2)),
    "backward": ((-1, 0), (-2, -1, 0)),
    "central": ((-1, 1), (-1, 0, 1)),
}
"""Steps of the table at which an angle is taken for its speed and acceleration."""
_SAME_STEP = 1e-6
"""Part of a step by which the steps of a table may differ: the rounding of a file."""


def _take_differences(scene: Scene, command: Command) -> Iterator[Mistake]:
    """Take speeds and accelerations from the angles at neighbouring rows of a table.

    The rows are those of a motion at one speed, at equal steps.
    """
    steps = np.diff(command.angle)
    speed = np.asarray(command.speed, dtype=float)
    changes = np.any(command.acceleration) or np.ptp(speed) != 0.0 or not speed.any()
    if changes or steps.size < ENOUGH_NUMBERS or not steps[0]:
        return
    if np.ptp(steps) > _SAME_STEP * abs(steps[0]):
        return
    numbers = range(-2, 3)
    shifted = [
        Variant("", at=command._replace(angle=command.angle + number * steps[0]))
        for number in numbers
    ]
    predictions = predict_variants(state_all(scene), command, shifted)
    moved = dict(zip(numbers, predictions, strict=True))
    second = steps[0] / float(speed.max())
    for name, (of_speed, of_acceleration) in _DIFFERENCES.items():
        predict = partial(_difference, moved, second, of_speed, of_acceleration)
        yield Mistake(f"speeds and accelerations are {name} differences", predict)


def _difference(
    moved: Mapping[int, Predict],
    second: float,
    of_speed: tuple[int, ...],
    of_acceleration: tuple[int, ...],
    quantity: str,
    right: Solution,
) -> Array | None:
    """Divide differences of an angle by those of the time; None for no rate of one."""
    rate, _, bar = quantity.rpartition("_")
    taken = {"omega": of_speed, "alpha": of_acceleration}.get(rate)
    if taken is None or quantity.endswith(right.commanded[-1]):
        return None
    angles = [np.asarray(moved[number](f"theta_{bar}", right)) for number in taken]
    turns = np.diff(angles, axis=0)
    turns -= TURN * np.rint(turns / TURN)
    if rate == "omega":
        return np.asarray(turns[0] / (second * (taken[1] - taken[0])))
    return np.asarray((turns[1] - turns[0]) / second**2)


def _list_other_scenes(scene: Scene) -> Iterator[tuple[str, Scene]]:
    """List scenes that differ by a word: the bar of the torque, or a load's frame."""
    for drive in {2, 3, 4} - {scene.drive_bar} if scene.drive is None else ():
        text = f"the torque acts on bar {drive} instead of bar {scene.drive_bar}"
        yield text, replace(scene, drive_bar=drive)
    for i, load in enumerate(scene.loads):
        if load.force is None or load.arm is not None:
            continue
        name = f"load {i + 1} (bar {load.bar})"
        other = "bar"
        how = "turns with the bar"
        if load.frame == "bar":
            other = "world"
            how = "is kept"
        loads = list(scene.loads)
        loads[i] = replace(load, frame=other)
        yield f"{name}: its direction {how}", replace(scene, loads=tuple(loads))


def _list_variants(scene: Scene, command: Command) -> Iterator[Variant]:
    """List the problems that differ by numbers of the scene, or by the command."""
    yield from _list_other_commands(command)
    yield from _change_gravity(scene)
    yield from _change_bars(scene)


def _list_other_commands(command: Command) -> Iterator[Variant]:
    name = command.commanded
    angle = command.angle
    yield Variant("the other branch", at=command._replace(branch=-command.branch))
    as_degrees = command._replace(angle=np.radians(angle))
    yield Variant(f"{name} read as degrees", at=as_degrees)
    # a whole turn is 6.28 of these degrees
    in_degrees = command._replace(angle=np.degrees(np.fmod(angle, TURN)))
    text = f"{name} in radians where degrees were announced"
    yield Variant(text, at=in_degrees, times=float(np.degrees(1.0)))
    if command.speed is not None:
        at_rest = command._replace(speed=0.0, acceleration=0.0)
        yield Variant("no inertial forces (statics)", at=at_rest)
        bar = command.bar
        if np.any(command.acceleration):
            steady = command._replace(acceleration=0.0)
            yield Variant(f"alpha_{bar} is left out", at=steady)
        for words, factor in (
            ("rev/min taken for rad/s", 1.0 / RPM),
            ("rad/s taken for rev/min", RPM),
        ):
            other = command._replace(speed=command.speed * factor)
            yield Variant(f"omega_{bar} in {words}", at=other)
    if len(angle) <= ENOUGH_POSITIONS:
        return
    for text, step in _BETWEEN.items():
        motion = (command.angle, command.speed, command.acceleration)
        angle, speed, acceleration = (_shift_by_half(rate, step) for rate in motion)
        between = command._replace(angle=angle, speed=speed, acceleration=acceleration)
        if isinstance(command.origin, StrokeOrigin):
            strokes = _shift_by_half(command.origin.stroke, step)
            between = between._replace(origin=command.origin._replace(stroke=strokes))
        yield Variant(text, at=between)
        yield Variant(f"{text} (forces alone)", at=between, names=FORCE_NAMES)


def _shift_by_half(values: Any, step: int) -> Any:
    """Return numbers half a step before (step 1) or after (-1) each position.

    One number of all positions stays.
    """
    if np.ndim(values) == 0:
        return values
    ends = 2.0 * values[:1] - values[1:2], 2.0 * values[-1:] - values[-2:-1]
    extended = np.concatenate((ends[0], values, ends[1]))
    return np.asarray(0.5 * (values + extended[1 - step : len(extended) - 1 - step]))


def _change_gravity(scene: Scene) -> Iterator[Variant]:
    magnitude = "effects.gravity.0"
    for effect in scene.effects:
        if isinstance(effect, Gravity):
            for text, angle in _GRAVITY_TURNED.items():
                turned = {"effects.gravity.1": effect.angle + angle}
                yield Variant(f"gravity is {text}", turned)
            return
    text = "gravity along -y is included though the scene has none"
    yield Variant(text, {magnitude: Gravity().magnitude})


def _change_bars(scene: Scene) -> Iterator[Variant]:
    every: dict[str, dict[str, float]] = {}
    for name, bar in list_moving(scene):
        for text, numbers in _list_bar_mistakes(bar):
            keyed = {f"bars.{name}.{key}": x for key, x in numbers.items()}
            yield Variant(f"{name}: {text}", keyed)
            every.setdefault(text, {}).update(keyed)
    for text, numbers in every.items():
        yield Variant(f"every bar: {text}", numbers)


def _list_bar_mistakes(bar: Bar) -> Iterator[tuple[str, dict[str, float]]]:
    """List the numbers of a bar that mistakes give it, by their keys."""
    r, phi = bar.mass_centre
    inertia = bar.moment_of_inertia

    def centre(r: float, phi: float) -> dict[str, float]:
        return {"centre.0": r, "centre.1": phi}

    if bar.mass:
        x = bar.length - r * np.cos(phi)
        y = r * np.sin(phi)
        from_second_pin = centre(float(np.hypot(x, y)), float(np.arctan2(y, x)))
        yield "mass centre measured from the wrong pin", from_second_pin
        yield "mass centre taken at mid-bar", centre(bar.length / 2.0, 0.0)
        if r:
            text = "mass centre turned by 180 deg about the bar's first pin"
            yield text, centre(r, phi + np.pi)
        if r * np.sin(phi):
            yield "mass centre on the other side of the bar's line", centre(r, -phi)
        text = "inertia about the pin used as the inertia about G"
        yield text, {"inertia": inertia + bar.mass * r**2}
        yield "mass left out", {"mass": 0.0}
    if inertia:
        yield "moment of inertia left out", {"inertia": 0.0}
        if bar.mass:
            text = "mass and moment of inertia left out"
            yield text, {"mass": 0.0, "inertia": 0.0}


def _is_angular(quantity: str) -> bool:
    return quantity.startswith(("theta", "omega", "alpha"))


def _is_angle(quantity: str) -> bool:
    return quantity.startswith("theta")


_COLUMN_MISTAKES: tuple[
    tuple[str, Callable[[Array], Array], Callable[[str], bool]], ...
] = (
    ("sign reversed, or F_ij given for F_ji", np.negative, lambda quantity: True),
    ("the sign is lost: sizes alone", np.abs, lambda quantity: quantity not in VECTORS),
    ("degrees where radians were announced", np.degrees, _is_angular),
    (
        "degrees from -180 to 180 where radians were announced",
        lambda values: np.degrees(np.remainder(values + np.pi, TURN) - np.pi),
        _is_angle,
    ),
    (
        "degrees from 0 to 360 where radians were announced",
        lambda values: np.degrees(np.remainder(values, TURN)),
        _is_angle,
    ),
    ("x and y exchanged", lambda values: values[:, ::-1], VECTORS.__contains__),
    ("y reversed", lambda values: values * (1.0, -1.0), VECTORS.__contains__),
    (
        (
            "measured from the other end of the bar (half a turn off): theta_4 or"
            " theta_3 from B, theta_2 from A"
        ),
        lambda values: values + np.pi,
        lambda quantity: quantity.startswith("theta"),
    ),
)
"""Mistakes in a column: name, change of the values, and quantities. The quantities are
those whose columns can have it.
"""


ENOUGH_EXPLAINED = 0.9
"""Part of the quantities that differ which must agree once a mistake is assumed, or the
mistakes of several columns together.
"""


@dataclass(frozen=True, slots=True)
class Explanation:
    """A mistake that accounts for what differs."""

    text: str
    quantities: tuple[str, ...]
    """The quantities that agree once it is assumed."""
    complete: bool
    """True if every quantity that differed now agrees."""
    whole: bool = True
    """True if the mistake is one of the calculation, False if it is one of columns."""


@np.errstate(all="ignore")
def explain(judge: Judge, differing: list[str]) -> list[Explanation]:
    """Find the mistakes under which nine tenths of what differs agrees.

    The most complete come first. A mistake of the calculation breaks no quantity that
    agreed as it was; those of columns count together.
    """
    least = ENOUGH_EXPLAINED * len(differing)
    whole: list[Explanation] = []
    of_columns: list[Explanation] = []
    for find in _SOURCES:
        for mistake in find(judge, differing):
            explained = _list_explained(judge, mistake, differing, least)
            if explained:
                explanation = Explanation(
                    mistake.text,
                    tuple(map(judge.table.label, explained)),
                    len(explained) == len(differing),
                    mistake.whole,
                )
                (whole if mistake.whole else of_columns).append(explanation)
        if any(explanation.complete for explanation in (*whole, *of_columns)):
            break
    together = {name for one in of_columns for name in one.quantities}
    if len(together) < least:
        of_columns.clear()
    explanations = [*of_columns, *whole]
    explanations.sort(key=lambda explanation: -len(explanation.quantities))
    return explanations[:MOST_EXPLANATIONS]


def _list_explained(
    judge: Judge,
    mistake: Mistake,
    differing: list[str],
    least: float,
) -> list[str]:
    """List the keys that differ and agree once a mistake is assumed.

    Empty if a mistake of the calculation explains fewer than `least`, breaks one that
    agreed, or is fitted to fewer than ENOUGH_NUMBERS.
    """
    explained = []
    possible = len(differing)
    numbers = 0
    others = judge.table.values if mistake.whole else ()
    for key in dict.fromkeys((*differing, *others)):
        ours = judge.ours(key)
        predicted = mistake.prediction(key, judge.right)
        if predicted is not None and np.array_equal(predicted, ours, equal_nan=True):
            predicted = None
        if predicted is not None and judge.where(key).any():
            agrees = judge.explained(key, predicted, mistake.times, mistake.left)
        else:
            agrees = False
        if key not in differing:
            if predicted is not None and not agrees:
                return []
        elif agrees:
            explained.append(key)
            error, allowed, _ = judge.judged_right(key)
            numbers += int((error > allowed)[judge.where(key)].sum())
        elif mistake.whole:
            possible -= 1
            if possible < least:
                return []
    if mistake.whole and mistake.fitted and numbers < ENOUGH_NUMBERS:
        return []
    return [key for key in judge.table.values if key in explained]


_SOURCES: tuple[Callable[[Judge, list[str]], Iterator[Mistake]], ...] = (
    lambda judge, differing: list_column_mistakes(),
    lambda judge, differing: chain(
        find_miscalculated(judge), list_hypotheses(judge.scene, judge.at)
    ),
    find_fitted,
    lambda judge, differing: find_single_precision(judge),
)
"""Sources of mistakes, the cheapest first: one is asked if none before it explains all.
"""
