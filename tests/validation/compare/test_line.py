"""A drive along a line before the free bodies.

Every pair of bars holds, faults show, who cannot do it says so.
"""

import numpy as np
from pytest import approx, mark, skip

from fourbar import Friction, Gravity, Motion, command, solve
from fourbar.effects import LinearDrive, Place
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.compare import Comparison, Demands
from fourbar_validation.compare.rows import AGREES
from fourbar_validation.compare.tolerance import EQUIVALENCE
from fourbar_validation.engines.balls import BallArithmetic
from fourbar_validation.engines.guests import GuestClient, Hello, Program
from fourbar_validation.engines.registry import ENGINES, load_further
from fourbar_validation.run.judge import judge
from fourbar_validation.run.question import FREE_BODY
from tests.support.here import judge_by
from tests.support.scenes import WEIGHT, cis, crank_rocker, recommand
from tests.validation.engines.test_engines import driven

EXACT = [engine for engine in (*ENGINES, *load_further()) if not engine.through_time]


@mark.parametrize("engine", EXACT, ids=lambda engine: engine.name)
@mark.parametrize("gap", [1e-2, 1e-4, 1e-6])
def test_the_direction_of_a_line_is_as_uncertain_as_its_ends_are_near(engine, gap):
    if missing := engine.missing():
        skip(missing)
    at = crank_rocker(Motion(1.0))
    linkage, (theta_4,) = at.linkage, solve(at, "position").theta_4
    on_bar = linkage.ground + 0.2 * cis(theta_4 + 0.4 - linkage.ground_angle)
    near = Place(1, (abs(on_bar + gap), np.angle(on_bar + gap)))
    scene = crank_rocker(
        Motion(1.0 + gap * np.linspace(-1.0, 1.0, 7), 10.0),
        drive=LinearDrive(near, Place(4, (0.2, 0.4))),
    )
    assert solve(scene, "position").stroke == approx(gap, rel=0.5)
    rows = judge_by(engine, scene)
    for quantity in ("stroke", "drive_line", "stroke_speed", "drive_force", "F14"):
        row = rows[quantity]
        assert row.verdict == AGREES and row.allowed < 1e-12 / gap, quantity


JUDGED = {
    "with its inertia": (
        (2, 4),
        {},
        {},
        {"drive_condition", "drive_force", "drive_force_inertia"},
    ),
    "positions alone": ((3, 4), {"speed": None}, {}, {"stroke", "drive_line"}),
    "statics and friction at rest": (
        (1, 3),
        {"speed": 0.0, "acceleration": 0.0},
        {"effects": (Gravity(), Friction.at(A=0.05, O4=0.02))},
        {"drive_force_low", "drive_force_high"},
    ),
}
"""Pair of bars, motion, what acts, and quantities that agree besides."""


@mark.parametrize("what", JUDGED)
def test_what_is_stated_of_a_line_is_judged(what):
    pair, motion, acting, quantities = JUDGED[what]
    scene = driven(*pair, 1, **{"effects": WEIGHT} | acting)
    rows = judge("", recommand(scene, **motion), [FREE_BODY]).rows
    assert not [row for row in rows if row.failed]
    agreeing = {row.quantity for row in rows if row.verdict == AGREES}
    assert quantities <= agreeing and "torque" not in agreeing


@mark.parametrize(
    "answered, due",
    [
        ({"v_B"}, set()),
        ({"v_B", "torque"}, {"drive_force"}),
        ({"theta_3", "theta_4", "sin_mu"}, {"stroke", "drive_line"}),
    ],
)
def test_of_a_line_is_due_what_takes_the_place_of_an_answer_or_follows(answered, due):
    scene = driven(1, 4, 1, ())
    solution = solve(scene)
    numbers = {name: np.array(solution[name]) for name in answered - {"torque"}}
    answer = Answer("theirs", "exact", solution.at, solution.assembled, numbers)
    held = Demands(EQUIVALENCE, tuple(answered))
    rows = Comparison("", scene, answer, solution, held).rows()
    quantities = {row.quantity for row in rows} - {"assembled", "undecided", "torque"}
    assert quantities == answered - {"torque"} | due
    failed = {row.quantity for row in rows if row.failed}
    assert failed == due & {"drive_force"}  # which is not answered


def test_who_cannot_do_it_refuses_in_one_line_that_names_it():
    scene = driven(
        1,
        4,
        1,
        WEIGHT,
    )
    outside = GuestClient("outside", Program(("none",)), Hello("outside"))
    for engine, words in (
        (BallArithmetic(), "a drive that exerts a force"),
        (outside, "hello does not list gravity, loads, cylinder in effects"),
    ):
        assert words in engine.answer(scene, command(scene)).refusal
