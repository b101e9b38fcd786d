"""Free motions of every engine against the exact solution.

Where there is none, they are held against the formulas. An engine's error is predicted
by itself: it runs twice, with its step and with twice its step, and the difference is
what the coarser motion errs by. The finer one must not err by more than ten times that.
"""

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fourbar.effects import Friction, Gravity, Load
from fourbar.linkage import MOVING_BARS, PINS
from fourbar.quantities import UNKNOWNS, Array
from fourbar.scene import Command, Scene, with_signs
from fourbar_validation.compare.answer import ReleasedAnswer
from fourbar_validation.compare.compare import Comparison
from fourbar_validation.compare.pins import find_centre, find_inertia, find_mass
from fourbar_validation.compare.rows import (
    AGREES,
    DEGRADED,
    FAILS,
    FORMULAS,
    REFUSES,
    UNDECIDED,
    Row,
    keep_worst,
)
from fourbar_validation.compare.scales import make_reference
from fourbar_validation.compare.tolerance import (
    EQUIVALENCE,
    TIMES_PREDICTED,
    divide,
    find_worst,
    replace_zero_size,
)
from fourbar_validation.engines.asking import ask_at
from fourbar_validation.engines.free_body import FreeBody
from fourbar_validation.engines.guests import Guest
from fourbar_validation.engines.registry import (
    ENGINES_PACKAGE,
    Engine,
    Later,
    find_missing,
    make_demands,
)
from fourbar_validation.report.scene_record import Timing
from fourbar_validation.run.judge_engines import find_agreement
from fourbar_validation.run.question import Question, select_positions, take_member

FORWARD = {
    "mujoco-forward": (
        Later(f"{ENGINES_PACKAGE}.mujoco.forward:MujocoForward"),
        1e-3,
        "mujoco",
    ),
    "pinocchio-forward": (
        Later(f"{ENGINES_PACKAGE}.pinocchio:PinocchioReleased"),
        1e-3,
        "pinocchio",
    ),
}
"""Engines that integrate by themselves. Each has a function that starts it with a step,
the longest step (s), and its library.
"""
LONGEST_TIMESTEP = 2e-3
"""s, of a guest."""
RELEASED_ERRORS = {"theta_2": 1e-9, "omega_2": 1e-8, "energy": 1e-10}
"""Errors (rad, of the greatest speed, of the greatest energies) at which a free motion
agrees: the formulas hold theta_2 to 1e-9 rad over 5 s; a motion of 100 s may amplify
that by its duration, so 5 s is the unit.
"""
DURATION_OF_FULL_ACCURACY = 5.0


class _Pendulum(NamedTuple):
    """A parallelogram that stays parallel is a pendulum: J phi'' = W sin phi.

    phi is from the upright.
    """

    J: float
    W: float
    phi_0: float
    omega_0: float

    def motion(self, times: Array) -> tuple[Array, Array]:
        """Return phi and phi' (rad, rad/s) of a pendulum that turns over.

        Jacobi's elliptic functions give both.
        """
        from scipy.special import ellipj, ellipk, ellipkinc

        k = self.W / self.J
        sense = math.copysign(1.0, self.omega_0)
        bottom = math.sqrt(
            self.omega_0**2 + 2.0 * k * (1.0 + math.cos(self.phi_0))
        )  # speed at the lowest point
        m = 4.0 * k / bottom**2
        # half the angle from the lowest point is the amplitude; it starts at
        # phi_0 - pi, seen along the motion
        start = ellipkinc(0.5 * (sense * self.phi_0 - math.pi), m)
        turns = 0.5 * bottom * times + start
        half_turns = np.round(
            turns / (2.0 * ellipk(m))
        )  # the amplitude grows by pi in every 2 K
        _, _, dn, amplitude = ellipj(turns - half_turns * 2.0 * ellipk(m), m)
        return (
            sense * (2.0 * (amplitude + math.pi * half_turns) + math.pi),
            sense * bottom * dn,
        )


def make_pendulum(scene: Scene) -> _Pendulum | None:
    """Return the pendulum that the scene is, None unless it is one that turns over."""
    d, a, b, c = scene.linkage.lengths
    motion = scene.motion
    parallel = a == c and b == d and motion.branch == 1
    if not parallel or scene.loads or len(scene.effects) != 1 or not motion.omega_2:
        return None
    (down,) = scene.effects
    if not isinstance(down, Gravity) or not math.isclose(down.angle, -math.pi / 2):
        return None
    J = W = 0.0
    for number in MOVING_BARS:
        bar = scene.linkage.bar(number)
        r, phi = find_centre(bar)
        mass = find_mass(bar)
        if phi != 0.0:
            return None
        J += mass * a * a if number == 3 else find_inertia(bar) + mass * r * r
        W += mass * down.magnitude * (a if number == 3 else r)
    phi_0 = float(np.asarray(motion.theta_2)) - math.pi / 2
    over_the_top = motion.omega_2**2 > 2.0 * W / J * (1.0 - math.cos(phi_0))
    return _Pendulum(J, W, phi_0, motion.omega_2) if over_the_top else None


def check_released(question: Question) -> Iterator[Row]:
    """Compare every forward engine's free motion with that of the formulas.

    The forces of each instant are compared too. The motion goes on through limit
    positions and change points.
    """
    scene = question.scene
    solution = question.solution
    free = scene.motion.free
    assert free is not None and solution.omega_2 is not None
    times = np.linspace(0.0, free.duration, free.steps + 1)
    yield from _compare_forces(question)
    pendulum = make_pendulum(scene)
    truth = solution.theta_2, solution.omega_2
    if pendulum is not None:
        phi, rate = pendulum.motion(times)
        none = np.zeros(len(solution))
        ours = ReleasedAnswer("formulas", "exact", *truth, none, none)
        truth = phi + math.pi / 2, rate
        yield from _make_rows(question, ours, None, truth)

    def rows(start: Callable[[float], Any], longest: float) -> list[Row]:
        interval = free.duration / free.steps
        # two of them, or more, from one instant to the next
        step = interval / (2.0 * math.ceil(interval / (2.0 * longest) - 1e-6))
        begin = time.perf_counter()
        fine = start(step).release(scene, times)
        seconds = time.perf_counter() - begin
        who = (question.name, fine.engine, fine.setting)
        question.timings.append(Timing(*who, len(times), seconds))
        coarse = None
        if fine.refusal is not None:
            question.leave_out(fine.engine, fine.refusal)
        else:
            coarse = start(2.0 * step).release(scene, times)
        return _make_rows(question, fine, coarse, truth)

    for engine in question.engines:
        if isinstance(engine, Guest) and "release" in engine.effects:
            yield from question.attempt(
                partial(rows, engine.at_step, LONGEST_TIMESTEP), engine.name
            )
    for adapter, (start, longest, library) in FORWARD.items():
        if reason := find_missing(library):
            question.leave_out(adapter, reason)
        else:
            yield from question.attempt(partial(rows, start, longest), adapter)


def _compare_forces(question: Question) -> Iterator[Row]:
    """Compare motion, pin forces and torque of every instant.

    The torque is zero; engines that answer one by one are asked. They are given
    theta_2, omega_2 and alpha_2; that these balance without a torque is the equation of
    motion.
    """
    name = question.name
    scene = question.scene
    solution = question.solution
    none = solution.torque if solution.drive is None else solution.drive_force
    what = "a released linkage has no drive"
    who = (name, FORMULAS, "exact")
    yield Row.judged(who, "torque", np.abs(none), 0.0, what, solution.theta_2)
    held = replace(
        scene,
        motion=scene.motion.replace(free=None, acceleration=0.0),
        drive_bar=2,
        drive=None,
    )
    told = (solution.theta_2, solution.branch, solution.omega_2, solution.alpha_2)
    command = with_signs(scene.linkage, Command(*told))
    driven_ones = []
    for prescribed, indices in _prescribe(held, command):
        at = select_positions(command, indices)
        driven = Question(
            name, prescribed, at, question.engines, output=question.output
        )
        driven.solution = take_member(solution, indices)
        driven_ones.append(driven)
    rows: list[Row] = []
    for engine in question.engines:
        if (
            engine.tolerance == EQUIVALENCE
            and "theta_3" in engine.answers
            and not engine.missing()
        ):
            compare = partial(_keep_worst_forces, engine, driven_ones)
            rows += question.attempt(compare, engine.name, "forces")
    for driven in driven_ones:
        question.against |= find_agreement(driven, rows)
    yield from rows


def _keep_worst_forces(
    engine: Engine,
    driven: list[Question],
) -> list[Row]:
    """Compare what one engine answers to each part of the motion.

    Keep the worst row of each quantity.
    """
    return keep_worst(
        row for question in driven for row in _compare_forces_by(engine, question)
    )


def _compare_forces_by(
    engine: Engine,
    driven: Question,
) -> list[Row]:
    """Compare what one engine answers to the motion as a prescribed one."""
    answer = driven.answer(engine)
    scene = driven.scene
    if answer.refusal is not None:
        who = (driven.name, answer.engine, answer.setting)
        return [Row.unmeasured(*who, "all", REFUSES, answer.refusal)]
    reference = make_reference(scene, answer)
    assert reference is not None
    # the formulas are conditioned by the angle that is independent there, an engine by
    # theta_2
    conditioned = replace(
        driven.solution,
        condition=reference.condition,
        drive_condition=reference.drive_condition,
        drive_bar=2,
        at=driven.at,
    )
    names = tuple(name for name in UNKNOWNS if name in engine.answers)
    # nor are theta_2, omega_2 and alpha_2 more than that angle's, rounded: what that
    # costs there is computed
    held = make_demands(replace(engine, answers=names), scene, driven.at, answer)
    rows = Comparison(driven.name, scene, answer, conditioned, held, reference).rows()
    return [row for row in rows if row.quantity != "undecided"]


def _prescribe(
    scene: Scene,
    command: Command,
) -> Iterator[tuple[Scene, NDArray[np.intp]]]:
    """Yield scenes that prescribe the motion, and their positions' numbers.

    A standstill is prescribed with the couples of dry friction there, because an engine
    has no friction at rest. A standstill that lasts is held: every pin takes the same
    part of its torque, and no more than all of it; one that ends begins to move against
    the whole torque.
    """
    frictions = [effect for effect in scene.effects if isinstance(effect, Friction)]
    resting = np.flatnonzero((command.omega_2 == 0.0) & bool(frictions))
    moving = np.setdiff1d(np.arange(len(command.theta_2)), resting)
    if len(moving):
        yield scene, moving
    if not frictions:
        return
    friction = frictions[0]
    others = [effect for effect in scene.effects if effect is not friction]
    bare = replace(scene, effects=tuple(others))
    numbers = np.stack((command.theta_2, command.alpha_2), axis=1)[resting]
    _, different = np.unique(numbers, axis=0, return_index=True)
    for first in resting[different].tolist():
        index = np.array([first])
        here = select_positions(command, index)
        loads = _hold_by_friction(bare, here, friction)
        yield replace(bare, loads=(*scene.loads, *loads)), index


def _hold_by_friction(
    bare: Scene,
    here: Command,
    friction: Friction,
) -> list[Load]:
    """Return the couples of dry friction at a standstill, as loads.

    `bare`: the scene without this friction.
    """
    needed = ask_at(FreeBody(), bare, here).quantities["torque"][0]
    begins = float(np.sign(here.alpha_2)[0])
    at_one = here._replace(speed=np.ones(1))
    turning = ask_at(FreeBody(), bare, at_one).quantities
    rate = (0.0, 1.0, turning["omega_3"][0], turning["omega_4"][0])
    slips = {}
    for pin, _ in friction.torques:
        i, j = PINS[pin]
        slips[pin] = rate[j - 1] - rate[i - 1]
    most = sum(torque * abs(slips[pin]) for pin, torque in friction.torques)
    part = -begins or float(np.clip(needed / most, -1.0, 1.0))
    loads = []
    for pin, torque in friction.torques:
        couple = part * torque * float(np.sign(slips[pin]))
        for bar, moment in zip(PINS[pin], (-couple, couple), strict=True):
            if bar != 1:
                loads.append(Load(bar, moment=moment))
    return loads


def _make_rows(
    question: Question,
    fine: ReleasedAnswer,
    coarse: ReleasedAnswer | None,
    truth: tuple[Array, Array],
) -> list[Row]:
    """Judge the motion by the truth, its theta_2 and omega_2, and by twice the step."""
    free = question.scene.motion.free
    theta_2, omega_2 = truth
    n = len(theta_2)
    assert free is not None
    who = (question.name, fine.engine, fine.setting)
    if fine.refusal is not None:
        return [Row.unmeasured(*who, "all", REFUSES, fine.refusal)]
    if len(fine.theta_2) < n:
        why = f"it stopped after {len(fine.theta_2)} of {n} instants"
        return [Row.unmeasured(*who, "all", FAILS, why)]
    motions = [fine] if coarse is None else [fine, coarse]
    compared = {
        "theta_2": ([one.theta_2[:n] for one in motions], theta_2, 1.0),
        "omega_2": (
            [one.omega_2[:n] for one in motions],
            omega_2,
            np.abs(omega_2).max(),
        ),
    }
    if coarse is not None:
        # the formulas integrate the energy equation: their drift is tested too
        energies = [one.energy[:n] - one.energy[0] for one in motions]
        compared["energy"] = (energies, np.zeros(n), fine.terms[:n].max())
    rows = []
    for name, (series, right, largest) in compared.items():
        values, coarser = series[0], series[-1]
        size = replace_zero_size(np.array(float(largest)))
        error = divide(np.abs(values - right), size)
        expected = math.nan
        if len(coarser) == len(values):
            expected = float(divide(np.abs(values - coarser).max(), size))
        index = find_worst(error)
        longer = max(1.0, free.duration / DURATION_OF_FULL_ACCURACY)
        full = RELEASED_ERRORS[name] * longer
        allowed = max(full, TIMES_PREDICTED * expected)
        if error[index] <= full:
            verdict = AGREES
            reason = f"a free motion of {free.duration:g} s"
        elif not (error[index] <= allowed and math.isfinite(expected)):
            verdict = FAILS
            reason = f"{error[index]:.1e} where {expected:.1e} was predicted"
        elif expected >= 1.0:
            verdict = UNDECIDED
            reason = f"an error of {expected:.1e} of the value is predicted"
        else:
            verdict = DEGRADED
            told = f"{error[index]:.1e} of {expected:.1e}"
            reason = f"{told} predicted from twice the step"
        worst = float(error[index])
        place = float(fine.theta_2[index])
        rows.append(Row(*who, name, worst, allowed, verdict, reason, place, 1.0))
    return rows
