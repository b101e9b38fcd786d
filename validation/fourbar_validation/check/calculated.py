"""Mistakes of a calculation, or of a simulation, that no other scene amounts to.

Wrong accelerations let other forces of d'Alembert act on bars 2, 3 and 4. Pins and
drive follow from these by the equations of the free bodies, which are solved for all
mistakes at once.
"""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from itertools import permutations
from typing import Any, NamedTuple

import numpy as np

from fourbar.effects import Flywheel
from fourbar.linkage import MOVING_BARS
from fourbar.quantities import FORCE_NAMES, PIN_FORCES, Array, ComplexArray
from fourbar_validation.check.judge_table import Judge, JudgedColumn, compute_column
from fourbar_validation.check.wrong_scenes import Mistake, drop_remainder, solve_other
from fourbar_validation.compare.bodies import BodyMotion, pose, stack_components
from fourbar_validation.compare.pins import find_inertia, find_mass, state_from_pins
from fourbar_validation.engines.description import FORCE_BETWEEN, name_driving
from fourbar_validation.engines.free_body import (
    DRIVE_COLUMN,
    FORCE_COLUMNS,
    BodyWrenches,
    solve_wrenches,
    speeds_and_accelerations,
)
from fourbar_validation.engines.free_body_closure import cross_products

_CUTS = {
    "B": ("F43", {2: ("O2", 1.0), 3: ("A", 1.0), 4: ("O4", -1.0)}),
    "A": ("F32", {2: ("O2", 1.0), 3: ("B", -1.0), 4: ("O4", -1.0)}),
    "O4": ("F14", {2: ("O2", 1.0), 3: ("A", 1.0), 4: ("B", 1.0)}),
}
"""Pins at which a loop is cut into a tree, the commonest first: the force that is no
longer passed, and by the driven bar the joint by which it hangs in its chain and the
sign of that force on the chain.
"""
ENOUGH_POSITIONS = 3
"""Positions that a mistake between positions needs."""
SOFT_TORQUE = 1e-6
"""Part of the torque that a soft constraint still carries at rest in MuJoCo's inverse
dynamics of a loop; 2e-8 was seen.
"""
_LATE = {
    "one step late: numbers of the position before": (1, 1.0),
    "one step early: numbers of the position after": (-1, 1.0),
    "half a step late: numbers between a position and the one before": (1, 0.5),
    "half a step early: numbers between a position and the one after": (-1, 0.5),
}
"""Mistakes in time: the side on which the numbers were taken, and the part of a step.
"""
_PART_OF_ACCELERATION = {
    -1.0: "is missing",
    -2.0: "has the wrong sign",
    1.0: "is doubled",
}
"""What is added of a part of an acceleration, and what was done to it."""
_VELOCITY_TERM = {
    -1.0: "is missing",
    -2.0: "has the wrong sign",
    -0.5: "is halved",
}
"""The same of the part of the others' accelerations that the speeds make."""


class _Accelerated(NamedTuple):
    """Wrong accelerations, by bar: what is added to the right ones."""

    text: str
    a_G: Mapping[int, ComplexArray]
    alpha: Mapping[int, Array] = {}
    others: Mapping[str, Array] = {}
    """Wrong accelerations of pins."""


def join(vectors: Array) -> ComplexArray:
    """Return vectors (n, 2) as complex numbers x + i y, (n,)."""
    return np.asarray(vectors[:, 0] + 1j * vectors[:, 1])


def find_miscalculated(judge: Judge) -> Iterator[Mistake]:
    """List the mistakes of a calculation, or of a simulation, that a table can show."""
    if judge.stage == "force":
        yield from _cut_loop(judge)
        yield from _turn_forces(judge)
        yield from _find_equal_forces(judge)
        yield from _find_wrong_accelerations(judge)
    yield from _find_late(judge)
    yield from _find_other_branch(judge)
    yield from _find_lone_row(judge)


def _cut_loop(judge: Judge) -> Iterator[Mistake]:
    """List forces and torque of the trees that a cut of the loop leaves.

    The sum of the forces on each bar stays. The torque is that of the joint by which
    the driven bar hangs on the ground or on the bar before it in its chain.
    """
    if judge.scene.drive is not None:
        return
    right = judge.right
    how = "the loop force is 0, as from mj_inverse or rnea of a loop"
    signs = {"F12": -1.0, "F32": 1.0, "F43": 1.0, "F14": 1.0}
    linkage = judge.scene.linkage
    place = {
        "O2": 0.0,
        "A": join(right.A),
        "B": join(right.B),
        "O4": linkage.ground * np.exp(1j * linkage.ground_angle),
    }
    for pin, (force, joints) in _CUTS.items():
        passed = right[force]
        joint, sense = joints[judge.scene.drive_bar]
        moment = cross_products(place[pin] - place[joint], sense * join(passed))
        numbers = {name: right[name] - sign * passed for name, sign in signs.items()}
        numbers["torque"] = right.torque + moment
        text = f"open tree, cut at {pin}: {how}"
        yield Mistake(f"forces and torque of the {text}", numbers.get, left=SOFT_TORQUE)


def _turn_forces(judge: Judge) -> Iterator[Mistake]:
    """List forces in the axes of a bar."""
    frames = {
        f"each force is in the frame of the bar {words}": {
            name: bars[side] for name, bars in FORCE_BETWEEN.items()
        }
        for words, side in (("on which it acts", 1), ("that exerts it", 0))
    }
    ground = judge.scene.linkage.ground_angle
    of_every = {"forces are": FORCE_BETWEEN.keys()}
    of_one = {f"{name} is": [name] for name in FORCE_BETWEEN}
    for words, names in {**of_every, **of_one}.items():
        for bar in (1, *MOVING_BARS)[not ground :]:
            frames[f"{words} in the frame of bar {bar}"] = dict.fromkeys(names, bar)
    right = judge.right
    theta: dict[int, Any] = {bar: right[f"theta_{bar}"] for bar in MOVING_BARS}
    theta[1] = ground
    for text, bars in frames.items():
        turned = {
            name: stack_components(join(right[name]) * np.exp(-1j * theta[bar]))
            for name, bar in bars.items()
        }
        whole = len(turned) > 1
        yield Mistake(f"{text}, not in world axes", turned.get, whole=whole)
        if not whole:
            opposite = {name: -force for name, force in turned.items()}
            signed = f"{text}, not in world axes, with the other sign"
            yield Mistake(signed, opposite.get, whole=False)


def _find_equal_forces(judge: Judge) -> Iterator[Mistake]:
    driving = name_driving(judge.scene)
    text = f"the power is given in place of the {driving}"
    yield Mistake(text, {driving: judge.right.power}.get, whole=False)
    for name, other in permutations(PIN_FORCES, 2):
        values = judge.right[other]
        yield Mistake(f"{name} = {other}", {name: values}.get, whole=False)
        if f"|{name}|" not in judge.columns:
            yield Mistake(f"{name} = -{other}", {name: -values}.get, whole=False)


def _find_wrong_accelerations(judge: Judge) -> Iterator[Mistake]:
    """List wrong accelerations with the forces that follow, and these alone."""
    scene = state_from_pins(judge.scene)
    right = judge.right
    bar = right.at.bar
    rates = right[f"omega_{bar}"], right[f"alpha_{bar}"]
    posed = pose(scene.linkage, [right.theta_2, right.theta_3, right.theta_4])
    motion = speeds_and_accelerations(posed, *rates, bar)
    wrong = [*_list_velocity_terms(judge, motion), *_list_parts_of_centres(motion)]
    inertia = {k: find_inertia(motion.linkage.bar(k)) for k in MOVING_BARS}
    for effect in scene.effects:
        if isinstance(effect, Flywheel):
            inertia[effect.bar] += effect.inertia
    acting = []
    for one in wrong:
        wrenches = BodyWrenches(len(right))
        for k in MOVING_BARS:
            push = -find_mass(motion.linkage.bar(k)) * one.a_G.get(k, 0.0)
            wrenches.push(k, push, motion.to_centre(k))
            wrenches.couple(k, -inertia[k] * one.alpha.get(k, 0.0))
        acting.append(wrenches)
    unknowns, _ = solve_wrenches(scene, motion, acting)
    driving = name_driving(scene)
    speed = right.stroke_speed
    if scene.drive is None:
        speed = motion.omega[scene.drive_bar]
    for one, more in zip(wrong, np.moveaxis(unknowns, 2, 0), strict=True):
        numbers = {
            name: right[name] + more[:, FORCE_COLUMNS[name] :][:, :2]
            for name in PIN_FORCES
        }
        numbers[driving] = right[driving] + more[:, DRIVE_COLUMN]
        numbers["power"] = numbers[driving] * speed
        moved = {f"alpha_{k}": right[f"alpha_{k}"] + x for k, x in one.alpha.items()}
        for k, a in one.a_G.items():
            moved[f"a_G{k}"] = right[f"a_G{k}"] + stack_components(a)
        yield Mistake(one.text, {**moved, **one.others, **numbers}.get)
        yield Mistake(f"{one.text}, from which the forces follow", numbers.get)


def _list_velocity_terms(judge: Judge, motion: BodyMotion) -> Iterator[_Accelerated]:
    """Leave out (dJ/dt) v, or reverse it, in the accelerations of the other bars.

    Without it these follow that of the commanded bar alone, by the ratios of the
    speeds: a omega_2 u_2 + b omega_3 u_3 = c omega_4 u_4 fixes them at rest too.
    """
    right = judge.right
    bar = right.at.bar
    zero = np.zeros(len(right))
    at_rest = speeds_and_accelerations(motion, motion.alpha[bar], zero, bar)
    for factor, done in _VELOCITY_TERM.items():
        alpha = {k: factor * (motion.alpha[k] - at_rest.omega[k]) for k in MOVING_BARS}
        alpha[bar] = zero
        of_A, of_B = (
            1j * alpha[k] * motion.linkage.bar(k).length * motion.unit[k]
            for k in (2, 4)
        )
        a_G = {k: 1j * alpha[k] * motion.to_centre(k) for k in MOVING_BARS}
        a_G[3] = a_G[3] + of_A
        of_pins = {
            "a_A": right.a_A + stack_components(of_A),
            "a_B": right.a_B + stack_components(of_B),
        }
        text = f"(dJ/dt) v {done} in the accelerations of the loop"
        yield _Accelerated(text, a_G, alpha, of_pins)


def _list_parts_of_centres(motion: BodyMotion) -> Iterator[_Accelerated]:
    """Leave out a part of the acceleration of each G about its bar's first pin."""
    arms = {bar: motion.to_centre(bar) for bar in MOVING_BARS}
    centripetal = {bar: -(motion.omega[bar] ** 2) * arms[bar] for bar in arms}
    tangential = {bar: 1j * motion.alpha[bar] * arms[bar] for bar in arms}
    whose: dict[str, tuple[int, ...]] = {"every bar": MOVING_BARS}
    whose |= {f"bar {bar}": (bar,) for bar in MOVING_BARS}
    for part, of_bars in (("-omega^2 r", centripetal), ("alpha x r", tangential)):
        for factor, done in _PART_OF_ACCELERATION.items():
            for name, bars in whose.items():
                text = f"{part} {done} in a_G of {name}, r from its first pin to G"
                yield _Accelerated(text, {bar: factor * of_bars[bar] for bar in bars})
    for bar in MOVING_BARS:
        text = f"the acceleration of bar {bar}'s first pin is used as its a_G"
        yield _Accelerated(text, {bar: -centripetal[bar] - tangential[bar]})
    r_A = motion.linkage.input.length * motion.unit[2]
    of_A = -(motion.omega[2] ** 2) * r_A
    a_A = of_A + 1j * motion.alpha[2] * r_A
    yield _Accelerated("a_A is missing in a_G of bar 3", {3: -a_A})
    whole = {bar: -part - of_A * (bar == 3) for bar, part in centripetal.items()}
    yield _Accelerated("-omega^2 r is missing in every a_G, and in a_A", whole)


def _find_late(judge: Judge) -> Iterator[Mistake]:
    """Give each position the numbers of an earlier one, or of a later one."""
    n = len(judge.at.angle)
    if n < ENOUGH_POSITIONS + 1:
        return
    for text, (step, part) in _LATE.items():
        at = drop_remainder(judge.at).with_arrays(partial(_shift, step, part))
        late = solve_other(text, judge.scene, at)
        edge = 0 if step == 1 else n - 1  # its number may be anything
        mistake = late._replace(predict=partial(_free_edge, judge, late, edge))
        yield mistake
        yield mistake.within(FORCE_NAMES, " (forces alone)")
        if part == 1.0:
            yield mistake._replace(whole=False)


def _shift(step: int, part: float, values: Any) -> Any:
    """Return the values of the positions before, or part of the way there."""
    if not np.ndim(values):
        return values
    shifted = np.roll(values, step, axis=0)
    if part == 1.0 or values.dtype == np.int8:
        return shifted
    return values + part * (shifted - values)


def _free_edge(
    judge: Judge, mistake: Mistake, edge: int, quantity: str
) -> Array | None:
    """Return the numbers of a mistake, at one row those of the table."""
    return take_theirs(judge, mistake.predict(quantity), quantity, lambda _: [edge])


def take_theirs(
    judge: Judge,
    values: Array | None,
    quantity: str,
    find_rows: Callable[[JudgedColumn], Any],
) -> Array | None:
    """Return numbers of a quantity, at some rows of its column those of the table."""
    columns = judge.columns
    column = columns.get(quantity) or columns.get(f"|{quantity}|")
    if values is None or column is None:
        return values
    theirs = column.theirs
    if theirs.ndim < values.ndim:  # any vector of that size
        theirs = np.stack((theirs, np.zeros_like(theirs)), axis=1)
    values, rows = values.copy(), find_rows(column)
    values[rows] = np.where(np.isnan(theirs), values, theirs)[rows]
    return values


def _find_lone_row(judge: Judge) -> Iterator[Mistake]:
    """Yield the one row that is wrong, where no other is."""
    wrong = [column.wrong for column in judge.columns.values()]
    rows = np.flatnonzero(np.any(wrong, axis=0))
    if len(rows) == 1 and len(judge.right) > ENOUGH_POSITIONS:

        def predict(quantity: str) -> Array | None:
            right = compute_column(judge.right, quantity)
            return take_theirs(judge, right, quantity, lambda _: rows)

        text = f"1 row alone: line {judge.table.lines[rows[0]]}"
        yield Mistake(text, predict, whole=False)


def _find_other_branch(judge: Judge) -> Iterator[Mistake]:
    """Yield the mistake of the other branch from where the numbers change."""
    keys = ("theta_3", "theta_4", *judge.columns)
    column = judge.columns[next(filter(judge.columns.__contains__, keys))]
    opposite = judge.at._replace(branch=-judge.at.branch)
    other = solve_other("", judge.scene, opposite)
    others = column.predict(other.predict)
    if others is None:
        return
    nearer = column.compare(others)[0] < column.judged_right[0]
    start = int(np.argmax(nearer))
    if not start:
        return

    def predict(quantity: str) -> Array | None:
        ours, theirs = getattr(judge.right, quantity, None), other.predict(quantity)
        if ours is None or theirs is None:
            return None
        return np.concatenate((ours[:start], theirs[start:]))

    here = np.degrees(judge.at.angle[start])
    place = f"{judge.at.commanded} = {here:.4g} deg"
    yield Mistake(f"the other branch from {place} on", predict)
