"""Known mistakes as hypotheses: what the numbers would be if it had been made, held against what they are."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from fourbar.effects import Gravity, Load
from fourbar.errors import FourBarError
from fourbar.formulas.mobility import TURN
from fourbar.linkage import Bar
from fourbar.quantities import FORCES, VECTORS
from fourbar.scene import Command, Scene
from fourbar.solution import Solution
from fourbar.solve import solve
from fourbar_validation.check.fitted import ENOUGH, find_fitted
from fourbar_validation.check.judge import Judge, Mistake
from fourbar_validation.check.theirs import Array
from fourbar_validation.scenes.hard_families import list_moving, replace_bars

SHOWN = 5
"""Explanations that are printed."""
NEARER = 10.0
"""A mistake that brings every row that differs this much nearer is named, though it does not explain it wholly."""


def list_hypotheses(scene: Scene, at: Command) -> Iterator[Mistake]:
    """List every mistake that can be made on this scene, the simplest first."""
    for text, change, of in COLUMN_MISTAKES:
        yield Mistake(
            text,
            lambda quantity, right, change=change, of=of: (
                _choose_where(quantity, right, change) if of(quantity) else None
            ),  # type: ignore[misc]
            whole=False,
        )
    for bar in (2, 3):
        yield Mistake(
            f"relative to bar {bar} instead of the ground",
            lambda quantity, right, bar=bar: _take_relative(quantity, right, bar),  # type: ignore[misc]
            whole=False,
        )
    yield from _scale_inertial(scene, at)
    for text, changed, where in _list_other_problems(scene, at):
        try:
            wrong = solve(changed, "position" if where.omega_2 is None else "force", at=where)
        except FourBarError:  # the mistake leaves no valid scene
            continue
        yield Mistake(text, lambda quantity, right, wrong=wrong: getattr(wrong, quantity, None))  # type: ignore[misc]


def _scale_inertial(scene: Scene, at: Command) -> Iterator[Mistake]:
    """Inertial forces in another unit than the loads they are added to: forces and torque are linear in each."""
    if at.omega_2 is None:
        return
    bare = replace(scene, loads=(), effects=())
    massless = {name: replace(bar, mass=0.0, inertia=bar.moment_of_inertia) for name, bar in list_moving(bare)}
    pointlike = {name: replace(bar, inertia=0.0) for name, bar in list_moving(bare)}
    of_mass, of_inertia = (solve(replace_bars(bare, **bars), "force", at=at) for bars in (pointlike, massless))

    def scaled(by_mass: float, by_inertia: float) -> Callable[[str, Solution], Array | None]:
        def predict(quantity: str, right: Solution) -> Array | None:
            if quantity not in FORCES:
                return None
            extra = (by_mass - 1.0) * getattr(of_mass, quantity) + (by_inertia - 1.0) * getattr(of_inertia, quantity)
            return np.asarray(getattr(right, quantity) + extra)

        return predict

    yield Mistake("m a and I alpha in kg cm/s^2 and kg cm^2/s^2, added to N and N cm: 100 times", scaled(1e2, 1e2))
    yield Mistake("m a in kg cm/s^2 added to N: 100 times too large", scaled(1e2, 1.0))
    yield Mistake("I alpha in kg cm^2/s^2 added to N cm: 100 times too large", scaled(1.0, 1e2))
    yield Mistake("m a and I alpha in kg mm/s^2 and kg mm^2/s^2, added to N and N mm: 1000 times", scaled(1e3, 1e3))
    yield Mistake("m a in kg mm/s^2 added to N: 1000 times too large", scaled(1e3, 1.0))
    yield Mistake(
        "inertial forces with the wrong sign (d'Alembert's forces put on the side of m a)", scaled(-1.0, -1.0)
    )
    yield Mistake("I alpha with the wrong sign", scaled(1.0, -1.0))


def _list_other_problems(scene: Scene, at: Command) -> Iterator[tuple[str, Scene, Command]]:
    """Evaluate the same formulas on the scene that the mistake amounts to."""
    yield "the other branch", scene, at._replace(branch=-at.branch)
    yield "theta_2 read as degrees", scene, at._replace(angle=np.radians(at.theta_2))
    in_degrees = np.degrees(np.fmod(at.theta_2, TURN))  # a whole turn is 6.28 of these degrees
    yield "theta_2 in radians where degrees were announced", scene, at._replace(angle=in_degrees)
    gravity = [effect for effect in scene.effects if isinstance(effect, Gravity)]
    if gravity:
        others = tuple(effect for effect in scene.effects if not isinstance(effect, Gravity))
        yield "gravity is missing", replace(scene, effects=others), at
        flipped = tuple(replace(g, magnitude=-g.magnitude) for g in gravity)
        yield "gravity is reversed", replace(scene, effects=(*others, *flipped)), at
    else:
        added = replace(scene, effects=(*scene.effects, Gravity()))
        yield "gravity along -y is included though the scene has none", added, at
    if scene.loads:
        yield "the loads are missing", replace(scene, loads=()), at
        for number, load in enumerate(scene.loads, 1):
            kept = tuple(other for other in scene.loads if other is not load)
            yield f"load {number} (bar {load.bar}) is missing", replace(scene, loads=kept), at
        if len(scene.loads) > 1:
            yield "the loads are reversed", replace(scene, loads=tuple(map(_reverse, scene.loads))), at
        for number, load in enumerate(scene.loads, 1):
            turned = tuple(_reverse(other) if other is load else other for other in scene.loads)
            yield f"load {number} (bar {load.bar}) is reversed", replace(scene, loads=turned), at
    if at.omega_2 is not None:
        yield "no inertial forces (statics)", scene, at._replace(speed=0.0, acceleration=0.0)
        if np.any(at.alpha_2):
            yield "alpha_2 is left out", scene, at._replace(acceleration=0.0)
        rpm = np.pi / 30.0
        yield "omega_2 in rev/min taken for rad/s", scene, at._replace(speed=at.omega_2 / rpm)
        yield "omega_2 in rad/s taken for rev/min", scene, at._replace(speed=at.omega_2 * rpm)
    for name, bar in list_moving(scene):
        for text, change in BAR_MISTAKES:
            if (changed := change(bar)) is not None:
                yield f"{name}: {text}", replace_bars(scene, **{name: changed}), at
    for drive in {2, 3, 4} - {scene.drive_bar} if scene.drive is None else ():
        yield f"the torque acts on bar {drive} instead of bar {scene.drive_bar}", replace(scene, drive_bar=drive), at


def _reverse(load: Load) -> Load:
    force = None if load.force is None else (-load.force[0], load.force[1])
    return replace(load, force=force, moment=-load.moment)


def _take_relative(quantity: str, right: Solution, bar: int) -> Array | None:
    if not _is_angular(quantity) or quantity.endswith(str(bar)):
        return None
    base = getattr(right, f"{quantity[:-1]}{bar}", None)
    return None if base is None else _choose_where(quantity, right, lambda values: values - base)


def _measure_from_other_pin(bar: Bar) -> Bar | None:
    r, phi = bar.mass_centre
    x, y = bar.length - r * np.cos(phi), r * np.sin(phi)
    return replace(bar, centre=(float(np.hypot(x, y)), float(np.arctan2(y, x)))) if bar.mass else None


def _rotate(bar: Bar) -> Bar | None:
    r, phi = bar.mass_centre
    return replace(bar, centre=(r, phi + np.pi)) if bar.mass and r else None


def _mirror(bar: Bar) -> Bar | None:
    r, phi = bar.mass_centre
    return replace(bar, centre=(r, -phi)) if bar.mass and r and np.sin(phi) else None


BAR_MISTAKES: tuple[tuple[str, Callable[[Bar], Bar | None]], ...] = (
    ("mass centre measured from the wrong pin", _measure_from_other_pin),
    ("mass centre taken at mid-bar", lambda bar: replace(bar, centre=(bar.length / 2.0, 0.0)) if bar.mass else None),
    ("mass centre turned by 180 deg about the bar's first pin", _rotate),
    ("mass centre on the other side of the bar's line", _mirror),
    (
        "inertia about the pin used as the inertia about G",
        lambda bar: (
            replace(bar, inertia=bar.moment_of_inertia + bar.mass * bar.mass_centre[0] ** 2) if bar.mass else None
        ),
    ),
    ("moment of inertia left out", lambda bar: replace(bar, inertia=0.0) if bar.moment_of_inertia else None),
)


def _is_angular(quantity: str) -> bool:
    return quantity.startswith(("theta", "omega", "alpha"))


def _choose_where(quantity: str, right: Solution, change: Callable[[Array], Array]) -> Array | None:
    values = getattr(right, quantity, None)
    return None if values is None else change(values)


COLUMN_MISTAKES: tuple[tuple[str, Callable[[Array], Array], Callable[[str], bool]], ...] = (
    ("sign reversed, or F_ij given for F_ji", np.negative, lambda quantity: True),
    ("degrees where radians were announced", np.degrees, _is_angular),
    ("x and y exchanged", lambda values: values[:, ::-1], VECTORS.__contains__),
    (
        "measured from the other end of the bar (half a turn off): theta_4 or theta_3 from B, theta_2 from A",
        lambda values: values + np.pi,
        lambda quantity: quantity.startswith("theta"),
    ),
)
"""Mistakes in a column: name, change of the values, and the quantities whose columns can have it."""


@dataclass(frozen=True, slots=True)
class Explanation:
    """A mistake that accounts for what differs."""

    text: str
    quantities: tuple[str, ...]
    """The quantities that agree once it is assumed."""
    complete: bool
    """True if every quantity that differed now agrees."""
    nearer: tuple[str, ...] = ()
    """Quantities that it explains for the most part: what remains is NEARER times smaller."""


def explain(judge: Judge, differing: list[str]) -> list[Explanation]:
    """Find the mistakes under which quantities that differ agree, the most complete first; then those that come near.

    A mistake that breaks a quantity which agreed as it was is none.
    """
    result: list[Explanation] = []
    table = judge.table
    for mistake in chain(list_hypotheses(judge.scene, judge.at), find_fitted(judge, differing)):
        explained, nearer, broken = [], [], False
        for key in table.values:
            predicted = mistake.prediction(key, judge.right)
            if predicted is None or np.array_equal(predicted, judge.ours(key), equal_nan=True):
                continue
            if judge.explained(key, predicted, mistake.times):
                if key in differing:
                    explained.append(table.label(key))
            elif key not in differing:
                broken = mistake.whole
            else:
                before, allowed, _ = judge.judged(key, judge.ours(key))
                after = judge.judged(key, predicted)[0]
                where = judge.where(key)
                enough = int((before > allowed)[where].sum()) >= min(ENOUGH, int(where.sum()))
                if enough and np.all((after <= np.maximum(before / NEARER, allowed))[where]):
                    nearer.append(table.label(key))
        if (explained or nearer) and not broken:
            complete = len(explained) == len(differing)
            result.append(Explanation(mistake.text, tuple(explained), complete, tuple(nearer)))
    return sorted(result, key=lambda e: (-len(e.quantities), -len(e.nearer)))[:SHOWN]
