"""The harness itself, with engines with given answers.

Silence, NaN and breakdowns must cost the run.
"""

from dataclasses import replace

import numpy as np
import pytest

import fourbar
from fourbar.formulas.mobility import limit_positions
from fourbar.quantities import FORCE_NAMES
from fourbar.scene import Scene, command, with_signs
from fourbar_lab.fault_scenes import FAULT_SCENES
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.columns import read_columns
from fourbar_validation.compare.compare import COMPARED_QUANTITIES
from fourbar_validation.compare.rows import (
    AGREES,
    FAILS,
    REFUSES,
    UNDECIDED,
    Counts,
    Row,
    write_results,
    write_rows,
)
from fourbar_validation.compare.tolerance import EQUIVALENCE, FULL_ACCURACY
from fourbar_validation.engines.free_body import FreeBody
from fourbar_validation.engines.registry import ENGINES, Engine, make_prediction
from fourbar_validation.run import judge as judging
from fourbar_validation.run.judge import judge
from tests.support.scenes import crank_rocker


class Echo:
    """Answers with the formulas' own numbers, changed by `spoil`.

    Only for tests of the harness.
    """

    name = "echo"

    def spoil(self, answer):
        return answer

    def answer(self, scene, command):
        s = fourbar.solve(scene, at=with_signs(scene.linkage, command))
        numbers = {name: np.array(getattr(s, name)) for name in COMPARED_QUANTITIES}
        return self.spoil(
            Answer("echo", "exact", command, np.array(s.assembled), numbers)
        )


class Elsewhere(Echo):
    def spoil(self, answer):
        answer.assembled[5] = False
        return answer


class Refuses(Echo):
    def answer(self, scene, command):
        return Answer("echo", "exact", refusal="a declared limit")


class Breaks(Echo):
    def answer(self, scene, command):
        raise RuntimeError("engine on fire\nsecond line")


class SlightlyOff(Echo):
    def spoil(self, answer):
        answer.quantities["torque"] *= 1.0 + 1e-9
        return answer


def rows_of(adapter, scene=None):
    engine = Engine("echo", adapter, EQUIVALENCE)
    record = judge("scene", scene or crank_rocker(), [engine])
    return {row.quantity: row for row in record.rows if row.engine == "echo"}


def test_an_equal_answer_agrees_in_every_quantity():
    rows = rows_of(Echo)
    of_engines = {"assembled", "undecided", "closure", "torque_inertia"}
    assert set(rows) == {*COMPARED_QUANTITIES, *of_engines}
    assert all(row.verdict == AGREES for row in rows.values())


def test_a_declared_refusal_is_reported_and_does_not_fail():
    rows = rows_of(Refuses)
    assert set(rows) == {"all"}
    assert rows["all"].verdict == REFUSES
    assert not rows["all"].failed and not rows["all"].passed  # nothing was compared


def test_an_engine_that_breaks_down_costs_its_own_row_in_one_line():
    rows = rows_of(Breaks)
    assert rows["all"].verdict == FAILS
    assert "engine on fire" in rows["all"].reason
    assert "\n" not in rows["all"].reason


def test_a_basis_that_breaks_down_is_no_agreement(monkeypatch):
    """By the free bodies all are judged, also where they are no engine."""
    others = [engine for engine in ENGINES if engine.name == "mujoco-inverse"]

    def broken(*_):
        raise IndexError("lost")

    monkeypatch.setattr(FreeBody, "answer", broken)
    failed = [row for row in judge("", crank_rocker(), others).rows if row.failed]
    assert [(row.quantity, row.reason) for row in failed] == [
        ("status", "the free bodies, by which it is judged, broke down")
    ]


class OffAtTheReversal(Echo):
    """Everything is off by a thousandth at the dead centre of `with_friction`.

    Nowhere else is anything off.
    """

    def spoil(self, answer):
        for values in answer.quantities.values():
            values[AT_REST] += 1e-3 + 1e-3 * np.abs(values[AT_REST])
        return answer


AT_REST = 1
"""Position at which bar 4 stands still in its dry pin."""


def with_friction():
    """Return a crank-rocker with dry friction at O4, at the dead centre of bar 4 and on
    either side of it.
    """
    linkage = fourbar.uniform(0.3, 0.1, 0.25, 0.22)
    d, a, b, c = linkage.lengths
    psi = np.arccos((d * d + (a + b) ** 2 - c * c) / (2.0 * d * (a + b)))
    motion = fourbar.Motion(np.array([psi - 0.2, psi, psi + 0.2]), 10.0)
    return Scene(
        linkage,
        motion,
        effects=(fourbar.Friction.at(O4=0.5),),
    )


def test_where_dry_friction_reverses_forces_are_not_judged_and_the_motion_is():
    rows = rows_of(OffAtTheReversal, with_friction())
    for quantity in COMPARED_QUANTITIES:
        row = rows[quantity]
        noted = "1 positions at which dry friction reverses not judged" in row.reason
        assert (row.verdict, noted) == (
            (AGREES, True) if quantity in FORCE_NAMES else (FAILS, False)
        ), quantity
        if quantity not in FORCE_NAMES:
            assert row.theta_2 == with_friction().motion.theta_2[AT_REST], quantity


def test_where_no_digit_is_left_nothing_is_judged():
    # 1e-13 rad from a limit of theta_2 the condition of the accelerations is about
    # 1e-13
    rocker = fourbar.uniform(0.3, 0.25, 0.1, 0.22)
    first = limit_positions(rocker)[0].theta_2
    for side in (1.0, -1.0):
        near = Scene(rocker, fourbar.Motion(np.array([first + side * 1e-13]), 1.0))
        if fourbar.solve(near).assembled.all():
            rows = rows_of(Echo, near)
            assert rows["torque"].verdict == UNDECIDED and not rows["torque"].passed
            assert "eps/condition" in rows["torque"].reason
            return
    pytest.fail("neither side of the limit assembles")


def test_a_scene_of_which_most_numbers_are_undecided_does_not_hold():
    # bar 4 turns by 0.3 eps/2e-14 where the loop closes to the last digit
    needles = fourbar.uniform(0.3, 1e-14, 0.3, 2e-14)
    scene = Scene(needles, fourbar.Motion(np.array([1.0, 1.5]), 1.0))
    row = rows_of(Echo, scene)["undecided"]
    assert row.verdict == FAILS and row.error > row.allowed == 0.5


def test_a_loop_said_to_be_open_a_thousand_roundings_from_its_limit_fails():
    rocker = fourbar.uniform(0.3, 0.25, 0.1, 0.22)
    first = limit_positions(rocker)[0].theta_2
    thetas = first + np.array([0.2, 0.3, 0.4, 0.5, 0.6, 1e-12])
    rows = rows_of(Elsewhere, Scene(rocker, fourbar.Motion(thetas, 1.0)))
    assert rows["assembled"].verdict == FAILS


def test_an_engine_that_may_answer_within_the_rounding_of_theta_2_is_held_to_it():
    engine = Engine("echo", SlightlyOff, FULL_ACCURACY, answers_nearby=True)
    rows = {
        row.quantity: row
        for row in judge("", crank_rocker(), [engine]).rows
        if row.engine == "echo"
    }
    assert rows["torque"].verdict == FAILS and rows["F12"].verdict == AGREES


def test_positions_alone_need_no_forces():
    scene = replace(crank_rocker(), motion=fourbar.Motion(fourbar.Sweep(0.0, 6.0, 10)))
    rows = judge("scene", scene, []).rows
    assert {row.quantity for row in rows} == {"closure"}


def test_results_survive_the_file(tmp_path):
    rows = judge("scene", crank_rocker(), [Engine("echo", Echo, EQUIVALENCE)]).rows
    write_results(rows, tmp_path / "results.csv")
    again = list(read_columns(tmp_path / "results.csv"))
    assert write_rows(again) == write_rows(rows)
    assert [(r.scene, r.engine, r.setting, r.quantity) for r in again] == sorted(
        (r.scene, r.engine, r.setting, r.quantity) for r in rows
    )


def test_an_engine_that_raised_an_alarm_is_excused_by_no_prediction_of_its_own():
    scene = crank_rocker()
    commanded = command(scene)
    engine = next(engine for engine in ENGINES if engine.residuals)
    ones = np.ones(len(commanded.theta_2))
    answer = Answer(engine.name, "RK4", commanded, predicted={"torque": ones})
    predicted = make_prediction(engine, scene, commanded, answer)
    assert predicted("torque", ones.astype(bool))[0] == 1.0
    answer.alarms.append("the loop is open")
    assert make_prediction(engine, scene, commanded, answer) is None


class AnswersAnyway(Echo):
    """Numbers of its own where the formulas state none."""

    def spoil(self, answer):
        answer.quantities = {
            name: np.nan_to_num(values, nan=7.0)
            for name, values in answer.quantities.items()
        }
        return answer


def test_an_answer_that_the_formulas_withhold_is_not_compared():
    """On bar 3 of a parallelogram no torque exists.

    No agreement, whatever the engine says; the motion is judged.
    """
    motion = fourbar.Motion(np.linspace(0.3, 2.0, 5), 1.0)
    for engine in (Echo, AnswersAnyway):
        rows = rows_of(engine, Scene(fourbar.uniform(1.0, 0.5, 1.0, 0.5), motion, 3))
        for quantity in COMPARED_QUANTITIES:
            row = rows[quantity]
            expected = (REFUSES, "the formulas state no value: 5 no_torque")
            if quantity in FORCE_NAMES:
                assert (row.verdict, row.reason) == expected
            else:
                said = EQUIVALENCE.explain(row.condition)
                assert row.verdict == AGREES and row.reason.startswith(said)


def test_positions_without_a_value_are_counted_next_to_those_that_were_compared():
    """An antiparallelogram driven by its coupler, through its change point."""
    motion = fourbar.Motion(
        np.array([-0.5, -0.3, 0.0, 0.3]),
        1.0,
        branch=-1,
    )
    scene = Scene(
        fourbar.uniform(1.0, 0.5, 1.0, 0.5),
        motion,
        3,
    )
    rows = rows_of(AnswersAnyway, scene)
    assert rows["torque"].verdict == AGREES
    for quantity in ("torque", "omega_3"):
        row = rows[quantity]
        said = EQUIVALENCE.explain(row.condition)
        assert row.reason == f"{said}; not judged: 1 change_point"
        assert said.startswith("round-off of both sides: 50 eps over the condition")


def test_beyond_the_range_of_doubles_what_was_before_is_judged():
    heavy = fourbar.FourBar(
        3.0, fourbar.Bar(1.0, 1.0), fourbar.Bar(2.5, 1e308, 1.0), fourbar.Bar(2.2, 1.0)
    )
    rows = rows_of(
        AnswersAnyway, Scene(heavy, fourbar.Motion(np.linspace(0.3, 2.0, 5), 10.0))
    )
    for quantity in COMPARED_QUANTITIES:
        assert rows[quantity].verdict == (
            REFUSES if quantity in FORCE_NAMES else AGREES
        ), quantity


class Counting(FreeBody):
    """The free bodies, with who was started and what it was given."""

    started = 0

    def __init__(self):
        Counting.started += 1


def test_an_engine_is_started_once_a_scene_and_no_question_is_put_twice(monkeypatch):
    put = []
    true = FreeBody.answer

    def noting(self, scene, command):
        put.append((scene, command))
        return true(self, scene, command)

    monkeypatch.setattr(FreeBody, "answer", noting)
    scene = crank_rocker()
    judge("scene", scene, [engine for engine in ENGINES if engine.name == "free-body"])
    assert len({(id(asked), id(command)) for asked, command in put}) == len(put)
    # nor of the bars without loads, which the answer holds too
    assert [asked for asked, _ in put if asked.linkage is scene.linkage] == [scene]
    judge("scene", scene, [Engine("counting", Counting, EQUIVALENCE)])
    assert Counting.started == 1


def test_an_engine_that_is_commanded_by_a_stroke_is_given_no_angle(monkeypatch):
    """Angle, rates and lever are what the formulas computed from the stroke.

    The engine finds its own.
    """
    commands = []
    answering = FreeBody.answer

    def seen(engine, scene, command):
        commands.append(command)
        return answering(engine, scene, command)

    monkeypatch.setattr(FreeBody, "answer", seen)
    rows = judge(
        "",
        FAULT_SCENES["stroke"],
        [engine for engine in ENGINES if engine.name == "free-body"],
    ).rows
    assert not [row for row in rows if row.failed]
    assert sum(row.engine == "free-body" and row.compared for row in rows) > 20
    assert commands
    for at in commands:
        assert (
            at.moves_stroke and np.isfinite(at.stated[0]).all() and at.condition == 1.0
        )
        assert all(
            np.isnan(values).all() for values in (at.angle, at.speed, at.acceleration)
        )


def test_a_check_that_raises_costs_its_own_rows_alone(monkeypatch):
    def check_nothing(_):
        raise ArithmeticError("lost")

    scene = crank_rocker()
    all_rows = judge("", scene, ()).rows
    checks = (judging.Check(check_nothing), *judging.CHECKS)
    monkeypatch.setattr(judging, "CHECKS", checks)
    (row,) = (row for row in judge("", scene, ()).rows if row not in all_rows)
    assert (row.engine, row.setting, row.quantity, row.verdict) == (
        "formulas",
        "check_nothing",
        "all",
        FAILS,
    )
    assert len(all_rows) > 3


@pytest.mark.parametrize("compares", [False, True])
def test_a_check_says_itself_whether_it_is_a_comparison(compares, monkeypatch):
    """A name of its own makes no comparison of it, and an empty run does not pass."""

    def check_something(question):
        return [Row.judged((question.name, "mine", "exact"), "torque", 0.0, 1.0, "")]

    checks = (judging.Check(check_something, compares=compares),)
    monkeypatch.setattr(judging, "CHECKS", checks)
    rows = judging.judge("s", crank_rocker(), ()).rows
    assert Counts(rows).nothing == (not compares)
    assert Counts(rows).status == (0 if compares else 1)
