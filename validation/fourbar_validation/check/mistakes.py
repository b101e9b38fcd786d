"""Known mistakes as hypotheses.

The numbers that each would make are held against the table.
"""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from fourbar.effects import Effect, Gravity
from fourbar.errors import FourBarError
from fourbar.formulas.mobility import TURN
from fourbar.linkage import Bar
from fourbar.quantities import FORCE_NAMES, VECTORS, Array
from fourbar.scene import Command, Scene
from fourbar.solution import Solution
from fourbar.solving import solve
from fourbar_validation.check.calculated import find_miscalculated
from fourbar_validation.check.fitted import ENOUGH_NUMBERS, find_fitted
from fourbar_validation.check.judge import Judge, Mistake
from fourbar_validation.scenes.bars import list_moving, replace_bars

RPM = np.pi / 30.0
"""rad/s of one rev/min."""
_GRAVITY_TURNED = {
    "turned by 90 deg": np.pi / 2.0,
    "turned by -90 deg": -np.pi / 2.0,
}
"""Directions that gravity may be given, by their angle from the right one."""
MOST_EXPLANATIONS = 5
"""Explanations that are printed."""
NEARER = 10.0
"""Ratio of improvement above which a mistake is named. It then explains not all, but
brings every row that differs nearer.
"""


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
    for text, changed, other_command in _list_other_problems(scene, command):
        try:
            wrong = solve(
                changed,
                "position" if other_command.speed is None else "force",
                at=other_command,
            )
        except FourBarError:  # the mistake leaves no valid scene
            continue
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
    bare = replace(scene, loads=(), effects=())
    massless = {
        name: replace(bar.with_mass(0.0), inertia=bar.moment_of_inertia)
        for name, bar in list_moving(bare)
    }
    pointlike = {name: replace(bar, inertia=0.0) for name, bar in list_moving(bare)}
    of_mass, of_inertia = (
        solve(replace_bars(bare, **bars), "force", at=command)
        for bars in (pointlike, massless)
    )

    def scaled(
        by_mass: float,
        by_inertia: float,
    ) -> Callable[[str, Solution], Array | None]:
        def predict(quantity: str, right: Solution) -> Array | None:
            if quantity not in FORCE_NAMES:
                return None
            extra = (by_mass - 1.0) * getattr(of_mass, quantity) + (
                by_inertia - 1.0
            ) * getattr(of_inertia, quantity)
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


_ACTIONS = {
    "gravity": "gravity",
    "springs": "the springs",
    "torsion": "the torsion springs",
    "viscous": "the viscous damping",
    "friction": "the dry friction",
    "pin_friction": "the friction of the pin load",
    "flywheel": "the flywheel",
}
"""Names of the effects of the package, by their keys."""
_PARTS = {
    "springs": "springs",
    "torsion": "springs",
    "viscous": "coefficients",
    "friction": "torques",
    "pin_friction": "pins",
}
"""Field with the parts of an effect, by its key."""
_SCALED = {0.0: "missing", 2.0: "doubled", -1.0: "reversed"}
"""Factors on what acts besides inertia, and what was done to it."""


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
            yield Mistake(f"{name} {verb} {done}", partial(_scale_from, left, factor))


def _scale_from(
    without: Solution,
    factor: float,
    quantity: str,
    right: Solution,
) -> Array | None:
    values = getattr(right, quantity, None)
    if quantity not in FORCE_NAMES or values is None:
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
        name = _ACTIONS.get(effect.key, f"effect {effect.key}")
        others = tuple(one for one in scene.effects if one is not effect)
        yield name, replace(scene, effects=others)
        for text, changed in _list_without_part(effect, name):
            yield text, replace(scene, effects=(*others, changed))


def _list_without_part(effect: Any, name: str) -> Iterator[tuple[str, Effect]]:
    """List the parts of an effect, each with the effect without it."""
    field = _PARTS.get(effect.key, "")
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


def _list_other_problems(
    scene: Scene,
    command: Command,
) -> Iterator[tuple[str, Scene, Command]]:
    """List scenes and commands that mistakes amount to; the formulas answer them."""
    for text, other_command in _list_other_commands(command):
        yield text, scene, other_command
    for text, changed in chain(
        _change_gravity(scene),
        _change_loads(scene),
        _change_bars(scene),
    ):
        yield text, changed, command
    for drive in {2, 3, 4} - {scene.drive_bar} if scene.drive is None else ():
        yield (
            f"the torque acts on bar {drive} instead of bar {scene.drive_bar}",
            replace(scene, drive_bar=drive),
            command,
        )


def _list_other_commands(command: Command) -> Iterator[tuple[str, Command]]:
    yield "the other branch", command._replace(branch=-command.branch)
    name = command.commanded
    yield f"{name} read as degrees", command._replace(angle=np.radians(command.angle))
    in_degrees = np.degrees(
        np.fmod(command.angle, TURN)
    )  # a whole turn is 6.28 of these degrees
    yield (
        f"{name} in radians where degrees were announced",
        command._replace(angle=in_degrees),
    )
    if command.speed is not None:
        yield (
            "no inertial forces (statics)",
            command._replace(speed=0.0, acceleration=0.0),
        )
        if np.any(command.acceleration):
            left_out = f"alpha_{command.bar} is left out"
            yield left_out, command._replace(acceleration=0.0)
        yield (
            f"omega_{command.bar} in rev/min taken for rad/s",
            command._replace(speed=command.speed / RPM),
        )
        yield (
            f"omega_{command.bar} in rad/s taken for rev/min",
            command._replace(speed=command.speed * RPM),
        )


def _change_gravity(scene: Scene) -> Iterator[tuple[str, Scene]]:
    gravity = [effect for effect in scene.effects if isinstance(effect, Gravity)]
    others = tuple(
        effect for effect in scene.effects if not isinstance(effect, Gravity)
    )
    if not gravity:
        yield (
            "gravity along -y is included though the scene has none",
            replace(scene, effects=(*others, Gravity())),
        )
        return
    for text, angle in _GRAVITY_TURNED.items():
        turned = (replace(effect, angle=effect.angle + angle) for effect in gravity)
        yield f"gravity is {text}", replace(scene, effects=(*others, *turned))


def _change_loads(scene: Scene) -> Iterator[tuple[str, Scene]]:
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


def _change_bars(scene: Scene) -> Iterator[tuple[str, Scene]]:
    for name, bar in list_moving(scene):
        for text, change in _BAR_MISTAKES:
            changed = change(bar)
            if changed is not None:
                yield f"{name}: {text}", replace_bars(scene, **{name: changed})
    for text, change in _BAR_MISTAKES:
        changed_bars = {}
        for name, bar in list_moving(scene):
            changed = change(bar)
            if changed is not None:
                changed_bars[name] = changed
        if len(changed_bars) > 1:
            yield f"every bar: {text}", replace_bars(scene, **changed_bars)


def _measure_from_other_pin(bar: Bar) -> Bar | None:
    r, phi = bar.mass_centre
    if not bar.mass:
        return None
    x = bar.length - r * np.cos(phi)
    y = r * np.sin(phi)
    distance = float(np.hypot(x, y))
    angle = float(np.arctan2(y, x))
    return replace(bar, centre=(distance, angle))


def _rotate_bar(bar: Bar) -> Bar | None:
    r, phi = bar.mass_centre
    if bar.mass and r:
        return replace(bar, centre=(r, phi + np.pi))
    return None


def _mirror(bar: Bar) -> Bar | None:
    r, phi = bar.mass_centre
    if bar.mass and r and np.sin(phi):
        return replace(bar, centre=(r, -phi))
    return None


_BAR_MISTAKES: tuple[tuple[str, Callable[[Bar], Bar | None]], ...] = (
    ("mass centre measured from the wrong pin", _measure_from_other_pin),
    (
        "mass centre taken at mid-bar",
        lambda bar: replace(bar, centre=(bar.length / 2.0, 0.0)) if bar.mass else None,
    ),
    ("mass centre turned by 180 deg about the bar's first pin", _rotate_bar),
    ("mass centre on the other side of the bar's line", _mirror),
    (
        "inertia about the pin used as the inertia about G",
        lambda bar: (
            replace(
                bar,
                inertia=bar.moment_of_inertia + bar.mass * bar.mass_centre[0] ** 2,
            )
            if bar.mass
            else None
        ),
    ),
    (
        "moment of inertia left out",
        lambda bar: replace(bar, inertia=0.0) if bar.moment_of_inertia else None,
    ),
)


def _is_angular(quantity: str) -> bool:
    return quantity.startswith(("theta", "omega", "alpha"))


def _is_angle(quantity: str) -> bool:
    return quantity.startswith("theta")


_COLUMN_MISTAKES: tuple[
    tuple[str, Callable[[Array], Array], Callable[[str], bool]], ...
] = (
    ("sign reversed, or F_ij given for F_ji", np.negative, lambda quantity: True),
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
"""Part of the quantities that differ which a mistake of the calculation must explain.
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
    nearer: tuple[str, ...] = ()
    """Quantities that it explains for the most part. What remains is NEARER times
    smaller.
    """


def explain(judge: Judge, differing: list[str]) -> list[Explanation]:
    """Find the mistakes under which quantities that differ agree.

    The most complete come first, then those that come near. A mistake that breaks a
    quantity which agreed as it was is none. One of the calculation must explain nine
    tenths of the quantities that differ, or bring most of them nearer: of several only
    the nearest is named, for they exclude each other.
    """
    explanations: list[Explanation] = []
    near: list[tuple[float, Explanation]] = []
    for find in _SOURCES:
        for mistake in find(judge, differing):
            weighed = _weigh(judge, mistake, differing)
            if weighed is None:
                continue
            explanation = weighed.explanation(mistake, differing)
            if len(weighed.explained) >= ENOUGH_EXPLAINED * len(differing) or (
                not mistake.whole and (weighed.explained or weighed.nearer)
            ):
                explanations.append(explanation)
            elif weighed.is_near(differing):
                near.append((weighed.remaining, explanation))
        if any(explanation.complete for explanation in explanations):
            break
    if near:
        _, nearest = min(near, key=lambda pair: pair[0])
        explanations.append(nearest)
    explanations.sort(key=lambda e: (-len(e.quantities), -len(e.nearer)))
    return explanations[:MOST_EXPLANATIONS]


def explain_all(judge: Judge, differing: list[str]) -> list[Explanation]:
    """Find the mistakes under which every quantity that differs agrees.

    Most fall at the first number that they leave wrong.
    """
    labels = tuple(map(judge.table.label, differing))
    explanations: list[Explanation] = []
    for find in _SOURCES:
        explanations += [
            Explanation(mistake.text, labels, True, mistake.whole)
            for mistake in find(judge, differing)
            if _explains_all(judge, mistake, differing)
        ]
        if explanations:
            break
    return explanations[:MOST_EXPLANATIONS]


def _explains_all(judge: Judge, mistake: Mistake, differing: list[str]) -> bool:
    numbers = 0
    for key in dict.fromkeys((*differing, *judge.table.values)):
        ours = judge.ours(key)
        predicted = mistake.prediction(key, judge.right)
        if predicted is not None and np.array_equal(predicted, ours, equal_nan=True):
            predicted = None
        differs = key in differing
        if predicted is not None and (differs or mistake.whole):
            if not judge.explained(key, predicted, mistake.times, mistake.left):
                return False
        elif differs:
            return False
        numbers += differs * int(judge.where(key).sum())
    return not mistake.fitted or numbers >= ENOUGH_NUMBERS


_SOURCES: tuple[Callable[[Judge, list[str]], Iterator[Mistake]], ...] = (
    lambda judge, differing: list_column_mistakes(),
    lambda judge, differing: chain(
        find_miscalculated(judge), list_hypotheses(judge.scene, judge.at)
    ),
    find_fitted,
)
"""Sources of mistakes, the cheapest first: one is asked if none before it explains all.
"""


class _Weighed(NamedTuple):
    """Labels of the quantities that a mistake explains or brings nearer."""

    explained: list[str]
    nearer: list[str]
    numbers: int
    """Numbers that differ of the quantities in `nearer`."""
    remaining: float
    """Largest error that remains of those."""

    def is_near(self, differing: list[str]) -> bool:
        """Return True if it brings more numbers nearer than chance does."""
        most = 2 * len(self.nearer) > len(differing)
        return most and self.numbers >= ENOUGH_NUMBERS

    def explanation(self, mistake: Mistake, differing: list[str]) -> Explanation:
        """Return what is reported of the mistake."""
        return Explanation(
            mistake.text,
            tuple(self.explained),
            len(self.explained) == len(differing),
            mistake.whole,
            tuple(self.nearer),
        )


def _weigh(judge: Judge, mistake: Mistake, differing: list[str]) -> _Weighed | None:
    """Hold what a mistake would make against the table.

    None if it breaks a quantity that agreed. A number that is fitted to fewer than
    ENOUGH_NUMBERS explains nothing.
    """
    explained = []
    explained_numbers = 0
    nearer = []
    numbers = 0
    remaining = 0.0
    for key in judge.table.values:
        predicted = mistake.prediction(key, judge.right)
        if predicted is None or np.array_equal(
            predicted,
            judge.ours(key),
            equal_nan=True,
        ):
            continue
        before, allowed, _ = judge.judged(key, judge.ours(key))
        mask = judge.where(key)
        differs = int((before > allowed)[mask].sum())
        if judge.explained(key, predicted, mistake.times, mistake.left):
            if key in differing:
                explained.append(judge.table.label(key))
                explained_numbers += differs
        elif key not in differing:
            if mistake.whole:
                return None
        else:
            after = judge.judged(key, predicted)[0]
            enough = differs >= min(ENOUGH_NUMBERS, int(mask.sum()))
            if enough and np.all((after <= np.maximum(before / NEARER, allowed))[mask]):
                nearer.append(judge.table.label(key))
                numbers += differs
                remaining = max(remaining, float(after[mask].max()))
    if mistake.whole and mistake.fitted and explained_numbers < ENOUGH_NUMBERS:
        explained = []
    return _Weighed(explained, nearer, numbers, remaining)
