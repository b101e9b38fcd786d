"""A released linkage that reaches a limit position.

Judged to its end, whatever an engine does there.
"""

from dataclasses import replace
from functools import partial
from math import tau

import numpy as np
from pytest import mark

from fourbar import Bar, FourBar, Free, Friction, Gravity, Load, Motion, Table
from fourbar.scene import Scene
from fourbar.solving import solve
from fourbar_validation.compare.answer import RELEASED_QUANTITIES, Answer
from fourbar_validation.compare.rows import AGREES, DEGRADED, FAILS, REFUSES, UNDECIDED
from fourbar_validation.compare.tolerance import EQUIVALENCE
from fourbar_validation.engines.pinocchio import PinocchioReleased
from fourbar_validation.engines.registry import ENGINES
from fourbar_validation.report.scene_record import Record
from fourbar_validation.run import released as free
from fourbar_validation.run.judge import judge, judge_for_report, make_question
from tests.support.rows import each_branch
from tests.support.scenes import UNIFORM_PARALLELOGRAM, WEIGHT, recommand, relink


def falling(coupler=0.15):
    """It falls from rest until bars 3 and 4 lie in one line.

    With a coupler of 0.12 m that is a change point.
    """
    linkage = FourBar(0.3, Bar(0.2, 0.2), Bar(coupler, 0.5), Bar(0.22, 0.4))
    return Scene(linkage, Motion(1.0, 0.0, free=Free(1.0, 100)), effects=WEIGHT)


BEFORE_THE_LINE = 2e-6
"""Error of theta_2, rad, of an engine until all bars, or two of them, are in line."""
MOST_SPREAD = {
    0.12: {"mujoco-forward": 0.05, "pinocchio-forward": 5e-4},
    0.15: {"mujoco-forward": 5e-4, "pinocchio-forward": 5e-5},
}
"""rad, by the coupler's length: what an engine may lose to its energy there, which it
states itself; an engine that loses more than this has become worse.
"""


def find_spread_by_energy(scene, solution, instant, engine):
    """Find how far theta_2 goes apart, rad.

    An engine's loss of energy happens at an instant. The linkage has one freedom, so
    that its speed at an angle follows from its energy: an engine that keeps its bars
    together errs by no more than what its energy does. It loses that where the bars
    come into line and the constraint forces are large.
    """
    start, _ = free.FORWARD[engine]
    times = np.linspace(0.0, 1.0, len(solution))
    energy = start(free.LONGEST_TIMESTEP).release(scene, times).quantities["energy"]
    lost = float(abs(energy - energy[0]).max())
    kinetic = 0.0
    for number in (2, 3, 4):
        bar = scene.linkage.bar(number)
        v, omega = (
            solution[f"v_G{number}"][instant],
            solution[f"omega_{number}"][instant],
        )
        kinetic += 0.5 * (bar.mass * v @ v + bar.moment_of_inertia * omega**2)
    rest = Free(1.0 - times[instant], len(times) - 1 - instant)
    spread = 0.0
    for change in (lost, -lost):
        speed = solution.omega_2[instant] * np.sqrt(1.0 + change / kinetic)
        motion = Motion(float(solution.theta_2[instant]), float(speed), free=rest)
        other = solve(replace(scene, motion=motion))
        apart = abs(other.theta_2 - solution.theta_2[instant:])
        spread = max(spread, float(apart.max()))
    return spread


def ask_briefly():
    return make_question("falling", recommand(falling(), free=Free(0.1, 5)), ENGINES)


def row(rows, engine, quantity):
    (found,) = (row for row in rows if (row.engine, row.quantity) == (engine, quantity))
    return found


def test_engines_that_agree_on_a_released_linkage_against_fourbar_name_it():
    question = ask_briefly()
    question.solution = replace(question.solution, F14=-question.solution.F14)
    failed = {row.quantity for row in free._compare_forces(question) if row.failed}
    assert failed == question.against.keys() == {"F14"}


@mark.slow
@mark.parametrize("coupler", [0.12, 0.15])
def test_every_engine_is_judged_through_limits_and_change_points(coupler):
    scene = falling(coupler)
    solution = solve(scene)
    assert set(solution.branch) == {1, -1}
    assert bool(solution.change_points) == (coupler == 0.12)
    page = judge_for_report("falling", scene)
    assert {row.engine for row in page.rows} > set(free.FORWARD)
    assert all(row.passed for row in page.rows)
    assert page.figure is not None
    first = int(np.flatnonzero(np.diff(solution.branch))[0])
    for engine in free.FORWARD:
        passed = row(page.rows, engine, "theta_2")
        spread = find_spread_by_energy(
            scene,
            solution,
            first,
            engine,
        )
        assert spread < MOST_SPREAD[coupler][engine], (engine, spread)
        assert passed.error < BEFORE_THE_LINE + spread, passed
    rows = judge("falling", recommand(scene, free=Free(first / 100.0, first))).rows
    for engine in free.FORWARD:
        assert row(rows, engine, "theta_2").error < BEFORE_THE_LINE


@each_branch
def test_a_linkage_that_friction_holds_beyond_a_change_point_is_judged_as_it_stands(
    branch,
):
    """The couples of dry friction that hold it are those of its own assembly."""
    friction = Friction.at(**dict.fromkeys(("O2", "A", "B", "O4"), 5.0))
    motion = Motion(np.radians(250.0), 0.0, branch=branch, free=Free(0.1, 2))
    scene = Scene(UNIFORM_PARALLELOGRAM, motion, effects=(Gravity(), friction))
    assert not solve(scene).omega_2.any()
    rows = judge("held", scene).rows
    assert {row.engine for row in rows if row.quantity == "F43"} >= {
        "pinocchio-inverse",
        "mujoco-inverse",
        "free-body",
    }
    assert [row for row in rows if row.verdict == FAILS] == []


@mark.parametrize("bar", ["coupler", "output"])
def test_a_tree_without_a_mass_matrix_is_refused_by_its_reason(bar):
    scene = falling()
    without = relink(scene, **{bar: Bar(getattr(scene.linkage, bar).length)})
    answer = PinocchioReleased().release(without, np.zeros(1))
    assert answer.refusal.endswith("no inertia: the open tree has no mass matrix")


def test_a_load_over_theta_2_is_a_declared_limit_of_mujoco():
    """As every limit that an engine raises."""
    over = Load(4, moment=0.1, table=Table((0.0, tau), (1.0, 1.0)))
    pushed = recommand(replace(falling(), loads=(over,)), free=Free(0.01, 2))
    refused = row(judge("pushed", pushed).rows, "mujoco-forward", "all")
    assert refused.verdict == REFUSES and refused.reason.startswith("a load that is")


TRUE = PinocchioReleased.release


def shift(released, angle):
    """Move theta_2 of a released motion, rad."""
    quantities = released.quantities
    moved = quantities | {"theta_2": quantities["theta_2"] + angle}
    return replace(released, quantities=moved)


def answering(monkeypatch, change):
    """The rows of Pinocchio where its answer is changed."""
    monkeypatch.setattr(
        PinocchioReleased, "release", lambda *arguments: change(TRUE(*arguments))
    )
    rows = judge("falling", falling()).rows
    return [row for row in rows if row.engine == "pinocchio-forward"]


@mark.slow
def test_an_engine_that_stops_is_nan_or_drifts_unpredicted_fails(monkeypatch):
    def cut(answer):
        for name in ("theta_2", "omega_2", "energy"):
            answer.quantities[name] = answer.quantities[name][:20]
        return answer

    def strike(index, answer):
        answer.quantities["theta_2"][index] = np.nan
        return answer

    def drift(answer):
        """Be wrong by the same amount with either step: it predicts nothing of it."""
        return shift(answer, 1e-3)

    (only,) = answering(monkeypatch, cut)
    assert only.verdict == FAILS and "20 of 101 instants" in only.reason
    for change in (partial(strike, 20), partial(strike, 60), drift):
        rows = answering(monkeypatch, change)
        assert row(rows, "pinocchio-forward", "theta_2").verdict == FAILS


@mark.slow
def test_an_engine_is_run_at_twice_its_step_however_close_the_instants_are():
    """Released from rest by a couple alone.

    Kinetic energy and work are equal, and their difference is no scale.
    """
    pushed = replace(falling(), effects=(), loads=(Load(4, moment=0.1),))
    for steps in (20, 200):  # 10 and 1 ms apart
        rows = judge("pushed", recommand(pushed, free=Free(0.2, steps))).rows
        assert not any(row.failed for row in rows)
        energy = row(rows, "mujoco-forward", "energy")
        assert energy.verdict == DEGRADED and energy.error < 1e-3, energy


@mark.parametrize(
    "off, verdict",
    [((3.0, 5.0), UNDECIDED), ((np.inf, 5.0), FAILS), ((3.0, np.inf), FAILS)],
)
def test_an_engine_that_predicts_nothing_of_itself_is_undecided(
    off, verdict, monkeypatch
):
    """An engine that is wrong by 3 rad at its step and by 5 rad at twice it has no
    digit by which it could agree. What is infinite predicts nothing.
    """
    shifts = iter(off)
    rows = answering(
        monkeypatch,
        lambda released: shift(released, next(shifts)),
    )
    assert row(rows, "pinocchio-forward", "theta_2").verdict == verdict


@mark.parametrize("declared, verdict", [(1e-3, AGREES), (1e-5, FAILS)])
def test_a_guest_may_err_in_a_released_motion_by_what_it_declares(declared, verdict):
    """One of adaptive steps errs alike whatever step it is given."""
    question = ask_briefly()
    moved = question.solution.theta_2 + 3e-5, question.solution.omega_2
    numbers = (*moved, np.zeros(6), np.ones(6))
    quantities = dict(zip(RELEASED_QUANTITIES, numbers, strict=True))
    answer = Answer("adaptive", "", quantities=quantities)
    tolerance = replace(EQUIVALENCE, factor=declared, reason="as it says")
    rows = free._make_rows(question, answer, answer, tolerance)
    assert row(rows, "adaptive", "theta_2").verdict == verdict


@mark.slow
def test_a_released_scene_is_reported_without_a_torque_that_is_rounding(monkeypatch):
    from fourbar_validation.report import scene_pictures

    scene = falling()
    shown = []
    monkeypatch.setattr(
        scene_pictures._Curve,
        "draw",
        lambda curve: shown.append(curve.quantity) or "",
    )
    record = Record("falling")
    scene_pictures.draw_scene_figure(record, scene, solve(scene), [])
    assert shown == ["theta_4", "F32"]
