"""Judge equilibria by the linkage held at rest in 320-bit arithmetic: torque, its
slope and inertia.

With T the torque that holds the independent bar and J the torque per unit of its
acceleration,
    T = -Q,
    dT/dq > 0 where it is stable,
    sqrt((dT/dq)/J)/(2 pi) is the frequency.
Free bodies held at many positions between say that no equilibrium was missed.
"""

from dataclasses import replace
from math import inf, nan, pi, remainder, sqrt
from typing import NamedTuple

import numpy as np
from flint import arb

import fourbar
from fourbar.formulas.mobility import change_points, find_intervals, turns_fully
from fourbar.linkage import MOVING_BARS
from fourbar.scene import Command, find_signs
from fourbar.scene.motion import Motion, Sweep
from fourbar_validation.compare.pins import (
    find_centre,
    find_inertia,
    find_mass,
    state_from_pins,
)
from fourbar_validation.compare.rows import Row
from fourbar_validation.compare.tolerance import (
    EPS,
    RANDOM_WALK,
    WELL_CONDITIONED,
    K,
    divide,
)
from fourbar_validation.engines import balls, free_body
from fourbar_validation.engines.prediction import LARGEST_FIRST_ORDER
from fourbar_validation.run.question import NotAskedError
from tests.oracle.bounds import REST
from tests.oracle.variants import make_row

POSITIONS_OF_A_TURN = 720
"""Positions of a turn of the input. Between two of them the torque changes its sign at
an odd number of equilibria.
"""
_OFF_GRID = 0.381966
"""Part of a sample's step by which the samples are moved. No equilibrium of a round
angle falls on one.
"""
PARTS_OF_ANGLE_NAMES = ("theta", "rest", "phi", "angle")
"""Parts of the names of inputs that are angles: they are rounded as 1 rad at least."""
_AT_LIMIT = EPS**-0.5
"""Most roundings by which a rounding of theta_2 moves theta_4. It is at a limit of
theta_2.
"""


class Derived(NamedTuple):
    """A number in many digits, rounded, and the size that its error is relative to."""

    value: float
    size: float


def equilibria(question):
    """Judge torque, slope and frequency at every equilibrium, and that none is
    missed.
    """
    scene = _at_rest(question.scene)
    theta_2 = _list_samples(question)
    answer = fourbar.equilibrium(question.scene)
    if answer.indifferent:
        raise NotAskedError("the linkage is indifferent")
    branches = (1, -1)
    if turns_fully(scene.linkage) and not change_points(scene.linkage):
        branches = (question.solution.branch[0],)
    torques = {branch: _hold(scene, theta_2, branch) for branch in branches}
    if turns_fully(scene.linkage) and len(change_points(scene.linkage)) == 2:
        signs = find_signs(scene.linkage, theta_2, question.at.branch[0])
        for branch, torque in torques.items():  # one assembly is a circuit of its own
            torque[signs != branch] = nan
    judged = [
        (equilibrium, _judge_equilibrium(scene, equilibrium))
        for equilibrium in answer.found
    ]
    missed = 0
    for branch, torque in torques.items():
        places = [
            (equilibrium.place.theta_2, off)
            for equilibrium, (off, _) in judged
            if equilibrium.place.branch in (branch, 0)
        ]
        missed += _count_missed(scene, branch, theta_2, torque, places)
    reason = (
        f"{len(answer.found)} equilibria; {POSITIONS_OF_A_TURN} positions of a turn"
        " held by free bodies"
    )
    yield Row.judged(
        (question.name, "equilibria", "exact"), "missed", missed, 0.0, reason
    )
    for name in ("torque", "slope", "inertia", "frequency"):
        errors_at = [
            (equilibrium.place.theta_2, errors[name])
            for equilibrium, (_, errors) in judged
            if name in errors
        ]
        if errors_at:
            angles, error = np.array(errors_at).T
            compared = f"{len(errors_at)} of {len(answer.found)} equilibria"
            yield make_row(question, "equilibria", name, error, REST, angles, compared)


def _at_rest(scene):
    """Leave out dry friction, which has equilibria of its own, and the drive."""
    if scene.counts_turns:
        raise NotAskedError(
            "how far its torsion springs are wound depends on the motion"
        )
    # what acts at a named point keeps its place without the points
    scene = state_from_pins(scene)
    effects = tuple(effect for effect in scene.effects if not effect.dry_pins)
    if not scene.loads and not effects:
        raise NotAskedError("nothing acts")
    return replace(
        scene,
        motion=Motion(),
        effects=effects,
        drive=None,
        drive_bar=2,
        points=(),
        tolerances=(),
    )


def _list_samples(question):
    """List the input's angles at which it is held, all that it reaches or its sweep
    has.
    """
    solution = question.solution
    motion = question.scene.motion
    linkage = question.scene.linkage
    swept = solution.theta_2[solution.assembled]
    turn = 2.0 * pi
    first = swept[0]
    reached = []
    for start, stop in find_intervals(linkage):
        half = 0.5 * (stop - start)
        middle = first - remainder(first - 0.5 * (start + stop), turn)
        reached.append((abs(first - middle) - half, middle - half, middle + half))
    _, low, high = min(reached)  # at an end it is outside by rounding
    if isinstance(motion.angle, Sweep) or motion.law is not None:
        if turns_fully(linkage):
            low = first - 2.0 * turn
            high = first + 2.0 * turn
        low = max(low, swept.min())
        high = min(high, swept.max(), swept.min() + turn)
    return np.arange(
        low + _OFF_GRID * turn / POSITIONS_OF_A_TURN, high, turn / POSITIONS_OF_A_TURN
    )


def _hold(scene, angle, branch):
    """Ask the free bodies for the torque on the input at rest.

    NaN where it is ill-conditioned or does not assemble.
    """
    command = Command(angle, np.full(angle.shape, branch, dtype=np.int8), 0.0, 0.0)
    with np.errstate(all="ignore"):
        answer = free_body.FreeBody().answer(scene, command)
        sine = np.sin(answer.quantities["theta_4"] - answer.quantities["theta_3"])
    sound = answer.assembled & (abs(sine) >= WELL_CONDITIONED)
    return np.where(sound, answer.quantities["torque"], nan)


def _count_missed(scene, branch, theta_2, torque, places):
    """Count the steps with a sign change of the torque and no equilibrium.

    The reverse counts too.

    `places`: angles of the equilibria on the branch, and how far off each may be: a
    step that one may be in or not is not counted, nor one at an end of which 320 bits
    find another sign than the free bodies, or none.
    """
    counted = np.zeros(len(torque) - 1, dtype=int)
    open_steps = ~np.isfinite(torque[:-1] * torque[1:])
    for angle, off in places:
        turned = theta_2[0] + np.remainder(angle - theta_2[0], 2.0 * pi)
        index = np.searchsorted(theta_2, turned) - 1
        if 0 <= index < len(counted):
            counted[index] += 1
        first, last = np.searchsorted(theta_2, [turned - off, turned + off]) - 1
        if first != last:
            open_steps[max(first, 0) : max(last + 1, 0)] = True
    differing = ~open_steps & ((torque[:-1] * torque[1:] < 0.0) != (counted % 2 == 1))

    def is_certain(index):
        held = _derive_torque(scene, 2, theta_2[index], branch)
        return (
            held is not None
            and held[0].value * torque[index] > 0.0
            and abs(held[0].value) > K * EPS * held[0].size
        )

    return sum(
        is_certain(index) and is_certain(index + 1)
        for index in np.flatnonzero(differing).tolist()
    )


def _judge_equilibrium(scene, equilibrium):
    """Return by how much the equilibrium may be off, rad, and the errors of torque,
    slope, inertia and frequency. No errors where nothing is decided: that near to a
    singular position first order predicts nothing.
    """
    place = equilibrium.place
    bar = int(equilibrium.angle[-1])
    theta = {2: place.theta_2, 3: place.theta_3, 4: place.theta_4}
    one, further = (theta[k] for k in MOVING_BARS if k != bar)
    held = _derive_torque(
        scene, bar, theta[bar], 1 if np.sin(further - one) > 0.0 else -1
    )
    if held is None or equilibrium.stability == "undecided":
        return inf, {}
    torque, slope, inertia = held
    errors = {
        "torque": divide(abs(torque.value), torque.size),
        "slope": divide(abs(slope.value + equilibrium.slope), slope.size),
        "inertia": divide(abs(inertia.value - equilibrium.inertia), inertia.size),
    }
    part = [divide(K * EPS * x.size, abs(x.value)) for x in (slope, inertia)]
    off = K * EPS * torque.size / abs(slope.value) if part[0] < 1.0 else inf
    if part[0] < LARGEST_FIRST_ORDER:
        stable = slope.value > 0.0
        if (equilibrium.stability == "stable") != stable or (
            equilibrium.frequency is not None and not stable
        ):
            errors["frequency"] = inf
        elif stable and part[1] < LARGEST_FIRST_ORDER:
            frequency = sqrt(slope.value / inertia.value) / (2.0 * pi)
            apart = abs((equilibrium.frequency or inf) - frequency)
            errors["frequency"] = apart / frequency / (0.5 * sum(part)) * K * EPS
        elif equilibrium.frequency is not None and part[1] >= 1.0:
            errors["frequency"] = inf  # of an inertia that is rounding
    return off, errors


def _derive_torque(scene, bar, angle, branch):
    """Derive the torque on a bar held at rest, its slope, and the bar's inertia.

    The slope is over the bar's angle. None where there are none, or where the rounding
    of the inputs decides the angles of the others. The bar's angle may be off by as
    much as makes theta_2 round otherwise: a place is stated by theta_2.
    """
    commanded_motion = {f"theta_{bar}": angle, f"omega_{bar}": 0.0}
    scene = replace(scene, motion=Motion(**commanded_motion), drive_bar=bar)
    x = balls.make_balls(scene, angle)
    x |= {
        f"{name}_{k}": arb(1)
        for k, load in enumerate(scene.loads)
        if load.table
        for name in balls.OF_PIECE
    }
    step = arb(2) ** -balls.STEP_BITS
    commanded = f"theta_{bar}"

    def derive(**changed):
        """Return torque, slope, inertia and angles; all outputs; and a ratio.

        The ratio is the change of theta_2 per rad of the bar.
        """
        base_inputs = x | changed
        turned = [
            base_inputs | {commanded: base_inputs[commanded] + side * step}
            for side in (1, -1)
        ]
        answers = [
            balls.compute_outputs(scene, branch, inputs)
            for inputs in (base_inputs, *turned, base_inputs | {f"alpha_{bar}": arb(1)})
        ]
        if not all(answer and "torque" in answer for answer in answers):
            return None
        held, ahead, behind, pushed = answers
        slope = (ahead["torque"] - behind["torque"]) / (2 * step)
        angles = [held.get(f"theta_{k}", base_inputs[commanded]) for k in MOVING_BARS]
        return (
            [held["torque"], slope, pushed["torque"] - held["torque"], *angles],
            held,
            (ahead.get("theta_2", step) - held.get("theta_2", 0)) / step,
        )

    base = derive()
    if base is None:
        return None
    numbers, outputs, rate = base
    sizes = np.zeros(len(numbers))
    for name, value in x.items():
        weight = max(
            abs(float(value)), float(any(part in name for part in PARTS_OF_ANGLE_NAMES))
        )
        if name == commanded:
            turned = max(abs(float(rate.mid())), 1.0 / _AT_LIMIT)
            weight = max(weight, 1.0 / turned)
        moved = next(
            (
                m
                for side in (1, -1)
                if weight and (m := derive(**{name: value + side * weight * step}))
            ),
            None,
        )
        if moved is not None:
            sizes += [
                abs(float(((after - before) / step).mid()))
                for after, before in zip(moved[0], numbers, strict=True)
            ]
    if not np.isfinite(sizes).all() or RANDOM_WALK * EPS * sizes[
        3:
    ].max() >= LARGEST_FIRST_ORDER * float(outputs["condition"]):
        return None
    sizes[2] = max(sizes[2], _sum_inertias(scene))
    pairs = zip(numbers[:3], sizes[:3], strict=True)
    return [Derived(float(x.mid()), size) for x, size in pairs]


def _sum_inertias(scene):
    """Sum m L^2 and I of the bars, and the inertias of flywheels.

    L is the linkage's longest reach.
    """
    linkage = scene.linkage
    bars = [linkage.bar(number) for number in MOVING_BARS]
    reach = max(linkage.lengths) + max(abs(find_centre(bar)[0]) for bar in bars)
    wheels = (effect.inertia for effect in scene.effects if effect.key == "flywheel")
    of_bars = sum(find_mass(bar) * reach**2 + find_inertia(bar) for bar in bars)
    return of_bars + sum(wheels)
