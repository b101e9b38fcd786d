"""The harness itself, with engines with given answers.

Silence, NaN and breakdowns must cost the run.
"""

from functools import partial

import numpy as np
from pytest import mark

from fourbar import Bar, FourBar, Friction, Motion, limit_positions, solve, uniform
from fourbar.errors import LimitError
from fourbar.quantities import FORCE_NAMES, SINGULAR
from fourbar.scene import Scene, command, with_signs
from fourbar_lab.fault_scenes import FAULT_SCENES
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.compare import COMPARED_QUANTITIES
from fourbar_validation.compare.rows import (
    AGREES,
    FAILS,
    FORMULAS,
    REFUSES,
    UNDECIDED,
    Counts,
    Row,
    make_breakdown,
)
from fourbar_validation.compare.tolerance import EQUIVALENCE, FULL_ACCURACY, ErrorBound
from fourbar_validation.engines.free_body import FreeBody
from fourbar_validation.engines.registry import ENGINES, Engine, make_prediction
from fourbar_validation.run import judge as judging
from fourbar_validation.run.judge import judge
from fourbar_validation.run.question import FREE_BODY
from tests.support.here import judge_by, list_failed, spoil_formulas
from tests.support.scenes import UNIFORM, crank_rocker, find_angle


class Echo:
    """Answers with the formulas' own numbers, changed by `spoil` or replaced by what it
    returns.

    Only for tests of the harness.
    """

    name = "echo"

    def __init__(self, spoil):
        self.spoil = spoil

    def answer(self, scene, command):
        s = solve(scene, at=with_signs(scene.linkage, command))
        numbers = {name: np.array(s[name]) for name in COMPARED_QUANTITIES}
        answer = Answer("echo", "exact", command, np.array(s.assembled), numbers)
        return self.spoil(answer) or answer


def echo(answer):
    """Change nothing."""


def round_to_single(answer):
    for name, values in answer.quantities.items():
        answer.quantities[name] = values.astype(np.float32)


def turn(answer):
    answer.quantities["theta_3"] += 1e-9


def open_loop(answer):
    answer.assembled[:] = False


def refuse(answer):
    return Answer("echo", "exact", refusal="a declared limit")


def burn(answer):
    raise RuntimeError("engine on fire\nsecond line")


def answer_anyway(answer):
    """Have numbers of its own where the formulas state none."""
    for values in answer.quantities.values():
        np.nan_to_num(values, copy=False, nan=7.0)


def rows_of(spoil, scene=None, tolerance=EQUIVALENCE, **held):
    engine = Engine("echo", partial(Echo, spoil), tolerance, **held)
    return judge_by(engine, scene or crank_rocker())


def test_a_refusal_or_a_breakdown_is_one_row():
    """Nothing was compared."""
    for spoil, verdict, reason in (
        (refuse, REFUSES, "a declared limit"),
        (burn, FAILS, "RuntimeError: engine on fire second line"),
    ):
        ((quantity, row),) = rows_of(spoil).items()
        assert (quantity, row.verdict, row.passed) == ("all", verdict, False)
        assert row.reason.startswith(reason)


def test_a_limit_is_a_refusal_of_what_answers_and_none_of_a_check():
    limit = LimitError("a declared limit")
    for engine, setting, verdict in (
        ("echo", "MJCF as shipped", REFUSES),
        (FORMULAS, "", REFUSES),
        (FORMULAS, "check_transformed", FAILS),
    ):
        assert make_breakdown("s", engine, limit, setting).verdict == verdict


def test_angles_close_the_loop_to_what_their_engine_declares():
    declared = ErrorBound("stated", "7 digits", 1e-5, conditioned=False)
    rows = rows_of(round_to_single, None, declared)
    assert rows["closure"].allowed >= 1e-5
    assert not [row for row in rows.values() if row.failed]


@mark.parametrize(
    "spoil, failing",
    [(turn, ["closure", "theta_3"]), (open_loop, ["assembled"])],
)
def test_what_fails_with_the_loads_is_not_told_again_of_the_inertia(spoil, failing):
    rows = rows_of(spoil)
    assert sorted(name for name, row in rows.items() if row.failed) == failing
    assert "torque_inertia" in rows


def test_positions_are_singular_only_where_bars_3_and_4_are_in_line(monkeypatch):
    """Their numbers are there, and no engine is compared with them."""

    def withhold(solution):
        solution.status_code[:2] = SINGULAR

    spoil_formulas(monkeypatch, withhold)
    failed = list_failed(crank_rocker(), [FREE_BODY])
    assert ("status", 2.0) in [(row.quantity, row.error) for row in failed]


def test_a_basis_that_breaks_down_is_no_agreement(monkeypatch):
    """By the free bodies all are judged, also where they are no engine."""
    others = [engine for engine in ENGINES if engine.name == "mujoco-inverse"]

    def broken(*_):
        raise IndexError("lost")

    monkeypatch.setattr(FreeBody, "answer", broken)
    (row,) = list_failed(crank_rocker(), others)
    words = "the free bodies, by which it is judged, broke down"
    assert (row.quantity, row.reason) == ("status", words)


AT_REST = 1
"""Position at which bar 4 stands still in its dry pin."""


def miss_the_reversal(answer):
    """Be off by a thousandth at AT_REST, and nowhere else."""
    for values in answer.quantities.values():
        values[AT_REST] += 1e-3 + 1e-3 * abs(values[AT_REST])


def test_where_dry_friction_reverses_forces_are_not_judged_and_the_motion_is():
    """At the dead centre of bar 4, with dry friction at O4."""
    d, a, b, c = UNIFORM.lengths
    psi = find_angle(c, d, a + b)
    motion = Motion(np.array([psi - 0.2, psi, psi + 0.2]), 10.0)
    scene = Scene(UNIFORM, motion, effects=(Friction.at(O4=0.5),))
    rows = rows_of(miss_the_reversal, scene)
    for quantity in COMPARED_QUANTITIES:
        row = rows[quantity]
        noted = "1 position at which dry friction reverses not judged" in row.reason
        if quantity in FORCE_NAMES:
            assert row.verdict == AGREES and noted, quantity
        else:
            assert row.verdict == FAILS and not noted, quantity
            assert row.theta_2 == psi, quantity
    assert rows["undecided"].error == 0.0


ROCKER = uniform(0.3, 0.25, 0.1, 0.22)
LIMIT = limit_positions(ROCKER)[0].theta_2


NEAR_ITS_LIMIT = next(
    scene
    for away in (1e-13, -1e-13)
    for scene in [Scene(ROCKER, Motion(LIMIT + away, 1.0))]
    if solve(scene).assembled.all()
)
"""The condition of its accelerations is about 1e-13."""


def test_where_no_digit_is_left_nothing_is_judged():
    torque = rows_of(echo, NEAR_ITS_LIMIT)["torque"]
    assert torque.verdict == UNDECIDED and not torque.passed
    assert "eps/condition" in torque.reason


def open_at_one(answer):
    answer.assembled[5] = False


def test_a_loop_said_to_be_open_a_thousand_roundings_from_its_limit_fails():
    thetas = LIMIT + np.array([0.2, 0.3, 0.4, 0.5, 0.6, 1e-12])
    rows = rows_of(open_at_one, Scene(ROCKER, Motion(thetas, 1.0)))
    assert rows["assembled"].verdict == FAILS


def miss_slightly(answer):
    answer.quantities["torque"] *= 1.0 + 1e-9


def test_an_engine_that_may_answer_within_the_rounding_of_theta_2_is_held_to_it():
    rows = rows_of(miss_slightly, None, FULL_ACCURACY, answers_nearby=True)
    assert rows["torque"].verdict == FAILS and rows["F12"].verdict == AGREES


def test_an_engine_that_raised_an_alarm_is_excused_by_no_prediction_of_its_own():
    scene = crank_rocker()
    commanded = command(scene)
    engine = next(engine for engine in ENGINES if engine.residuals)
    ones = np.ones(len(commanded.theta_2))
    answer = Answer(
        engine.name,
        "RK4",
        commanded,
        predicted={"torque": ones},
    )
    predicted = make_prediction(
        engine,
        scene,
        commanded,
        answer,
    )
    assert predicted("torque", ones.astype(bool))[0] == 1.0
    answer.alarms.append("the loop is open")
    assert make_prediction(engine, scene, commanded, answer) is None


PARALLELOGRAM = uniform(1.0, 0.5, 1.0, 0.5)
FIVE = np.linspace(0.3, 2.0, 5)
HEAVY = FourBar(3.0, Bar(1.0, 1.0), Bar(2.5, 1e308, 1.0), Bar(2.2, 1.0))
WITHHELD = {
    "no torque on bar 3 of a parallelogram": (
        Scene(PARALLELOGRAM, Motion(FIVE, 1.0), 3),
        "the formulas state no value: 5 no_torque",
    ),
    "beyond the range of doubles": (
        Scene(HEAVY, Motion(FIVE, 10.0)),
        "the formulas state no value: 5 overflow",
    ),
}
"""Scene and why its forces are no answer; its motion is judged."""


@mark.parametrize("spoil", [echo, answer_anyway])
@mark.parametrize("what", WITHHELD)
def test_an_answer_that_the_formulas_withhold_is_not_compared(what, spoil):
    """No agreement, whatever the engine says."""
    scene, reason = WITHHELD[what]
    rows = rows_of(spoil, scene)
    for quantity in COMPARED_QUANTITIES:
        row = rows[quantity]
        if quantity in FORCE_NAMES:
            assert (row.verdict, row.reason) == (REFUSES, reason)
        else:
            said = EQUIVALENCE.explain(row.condition)
            assert row.verdict == AGREES and row.reason.startswith(said), quantity


def test_positions_without_a_value_are_counted_next_to_those_that_were_compared():
    """An antiparallelogram driven by its coupler, through its change point."""
    motion = Motion(np.array([-0.5, -0.3, 0.0, 0.3]), 1.0, branch=-1)
    rows = rows_of(answer_anyway, Scene(PARALLELOGRAM, motion, 3))
    assert rows["torque"].verdict == AGREES
    for quantity in ("torque", "omega_3"):
        row = rows[quantity]
        said = EQUIVALENCE.explain(row.condition)
        assert row.reason == f"{said}; not judged: 1 change_point"
        assert said.startswith("round-off of both sides: 50 eps over the condition")


def test_an_engine_that_is_commanded_by_a_stroke_is_given_no_angle(monkeypatch):
    """Angle, rates and lever are what the formulas computed from the stroke.

    The engine finds its own.
    """
    asked, answering = [], FreeBody.answer

    def note(self, scene, command):
        asked.append(command)
        return answering(self, scene, command)

    monkeypatch.setattr(FreeBody, "answer", note)
    rows = judge("", FAULT_SCENES["stroke_input"], [FREE_BODY]).rows
    assert not [row for row in rows if row.failed]
    assert sum(row.engine == "free-body" and row.compared for row in rows) > 20
    assert asked
    for at in asked:
        assert at.moves_stroke and at.condition == 1.0
        assert np.isfinite(at.stated[0]).all()
        assert np.isnan([at.angle, at.speed, at.acceleration]).all()


def test_a_check_that_raises_costs_its_own_rows_alone(monkeypatch):
    def check_nothing(_):
        raise ArithmeticError("lost")

    scene = crank_rocker()
    all_rows = judge("", scene, ()).rows
    checks = (judging.Check(check_nothing), *judging.CHECKS)
    monkeypatch.setattr(judging, "CHECKS", checks)
    (row,) = (row for row in judge("", scene, ()).rows if row not in all_rows)
    key = (row.engine, row.setting, row.quantity, row.verdict)
    assert key == ("formulas", "check_nothing", "all", FAILS)
    assert len(all_rows) > 3


@mark.parametrize("compares", [False, True])
def test_a_check_says_itself_whether_it_is_a_comparison(compares, monkeypatch):
    """A name of its own makes no comparison of it, and an empty run does not pass."""

    def check_something(question):
        return [Row.judged((question.name, "mine", "exact"), "torque", 0.0, 1.0, "")]

    checks = (judging.Check(check_something, compares=compares),)
    monkeypatch.setattr(judging, "CHECKS", checks)
    counts = Counts(judge("s", crank_rocker(), ()).rows)
    assert counts.nothing == (not compares)
    assert counts.status == (0 if compares else 1)
