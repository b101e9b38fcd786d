"""What is predicted where rounding decides whether the loop closes.

Nothing that does not depend on it is excused.
"""

import math

import mpmath as mp
import numpy as np
from pytest import fixture, importorskip, mark

import fourbar
from fourbar.formulas.mobility import limit_positions
from fourbar.linkage import Bar, FourBar, uniform
from fourbar.scene import Scene
from fourbar.scene.motion import Motion
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.compare import COMPARED_QUANTITIES
from fourbar_validation.compare.tolerance import (
    EPS,
    FULL_ACCURACY,
    OF_THE_INPUT,
    TIMES_PREDICTED,
    TOUCHING_MARGIN,
    compute_difference,
    magnitude,
    mark_touching,
    sum_lengths,
)
from fourbar_validation.engines.balls import BallArithmetic
from fourbar_validation.engines.free_body import FreeBody
from fourbar_validation.engines.prediction import _bound_touching, predict_from_data
from fourbar_validation.engines.registry import Engine, list_engines, make_prediction
from fourbar_validation.engines.tree import solve_closed, solve_multipliers
from fourbar_validation.run.judge import make_question
from fourbar_validation.run.judge_engines import compare_answer
from tests.support.scenes import ON_COUPLER, crank_rocker, find_angle

importorskip("flint")
ROCKER = uniform(0.3, 0.25, 0.1, 0.22)
BOUNDED = ("theta_3", "theta_4", "B", "G3", "G4", "sin_mu", "condition")
"""What follows from the angles of bars 3 and 4 alone."""


def touch():
    """Command bar 2 to within a rounding of where its loop ceases to close, in the
    sense in which it closes.
    """
    limit = next(x.theta_2 for x in limit_positions(ROCKER) if 0.0 < x.theta_2 < np.pi)
    angles = limit + np.arange(-30, 31, 4) * EPS
    solution = fourbar.solve(Scene(ROCKER, Motion(angles, 3.0)))
    closed = angles[(solution.status_code == 0) & mark_touching(ROCKER, angles)]
    assert len(closed) >= 3
    return Scene(ROCKER, Motion(closed, 3.0))


@fixture(scope="module")
def question():
    """Ask nobody of a loop that just closes."""
    return make_question("scene", touch(), ())


ENGINE = Engine(
    "spoiled",
    FreeBody,
    FULL_ACCURACY,
    predictor=predict_from_data,
)


@mark.parametrize("quantity", ("A", "G2", "v_A", "omega_2", "B", "G4"))
def test_a_place_that_is_wrong_by_a_half_fails_where_the_loop_just_closes(
    quantity, question
):
    solution = question.solution
    numbers = {name: np.array(getattr(solution, name)) for name in COMPARED_QUANTITIES}
    numbers[quantity] *= 1.5
    answer = Answer(
        "spoiled",
        "exact",
        question.at,
        np.array(solution.assembled),
        numbers,
    )
    rows = compare_answer(question, ENGINE, answer)
    assert [row.quantity for row in rows if row.failed] == [quantity]


def test_what_the_input_decides_is_predicted_to_its_last_digits():
    scene = touch()
    command = fourbar.command(scene)
    for quantity in OF_THE_INPUT - {"theta_2"}:
        error = predict_from_data(scene, command, quantity)
        assert np.all(error < 1e3 * EPS), quantity
    for quantity in BOUNDED:
        error = predict_from_data(scene, command, quantity)
        assert np.all((error > EPS) & (error < 1e-6)), quantity
    for quantity in ("omega_3", "alpha_4", "F32", "torque"):
        assert np.isinf(predict_from_data(scene, command, quantity)).any()


@mark.parametrize("stretched", (True, False))
@mark.parametrize("b, c", ((0.1, 0.22), (0.4, 0.07), (0.3, 1e-3)))
def test_the_bound_of_the_angles_is_that_of_the_triangle(b, c, stretched):
    """Close a triangle that misses its line by the margin.

    The cosine rule is used in 200 bits.
    """
    e = b + c if stretched else abs(b - c)
    d, a = 0.8 * e, 0.7 * e
    linkage = uniform(
        d,
        a,
        b,
        c,
    )
    psi = find_angle(e, d, a)
    with mp.workprec(200):
        missed = mp.mpf(TOUCHING_MARGIN) * sum_lengths(linkage)
        B, C = mp.mpf(b), mp.mpf(c)
        E = B + C - missed if stretched else abs(B - C) + missed
        for name, one, other in (("theta_3", B, C), ("theta_4", C, B)):
            angle = mp.acos((E * E + one * one - other * other) / (2 * E * one))
            off = float(min(angle, mp.pi - angle))
            bound = _bound_touching(linkage, psi, name)
            assert 0.99 * off <= bound <= 1.01 * off + 1e-12, name
    assert math.isinf(_bound_touching(linkage, psi, "omega_3"))
    assert TIMES_PREDICTED * _bound_touching(linkage, psi, "sin_mu") < 1.0


UNEVEN = Scene(
    uniform(2.9e-3, 24.0, 1.0e5, 1.0e5), Motion(np.linspace(0.1, 6.0, 7), 2.2), 4
)
UNEVEN_BARS = (
    Bar(1.5e-3, 0.03, 1.9e-10),
    Bar(205.0, 8.7, 6.7e8),
    Bar(203.0, 3.4e-4, 2.6),
)
WHEEL_ON_COUPLER = Scene(
    FourBar(21.0, *UNEVEN_BARS), Motion(np.linspace(-7.0, -4.4, 3), 1.8e-5, 3.2e-10)
)


@mark.parametrize(
    "name, scene",
    (
        ("pinocchio-inverse", UNEVEN),
        ("mujoco-inverse", UNEVEN),
        ("mujoco-inverse", WHEEL_ON_COUPLER),
    ),
)
def test_an_open_tree_of_uneven_bars_keeps_to_its_prediction(name, scene):
    """All bars turn alike, and their accelerations are what is left of the speeds.

    Cramer's rule alone leaves them wrong by a hundred times what is predicted, and
    MuJoCo accelerates a wheel on the coupler with the crank and back again.
    """
    importorskip(name.split("-", maxsplit=1)[0])
    command = fourbar.command(scene)
    engine = list_engines()[name]
    answer = engine.start().answer(scene, command)
    exact = BallArithmetic().answer(scene, command).quantities
    predict = make_prediction(
        engine,
        scene,
        command,
        answer,
    )
    closed = answer.assembled
    assert closed.any()
    for quantity in ("omega_3", "alpha_3", "alpha_4", "F12", "F43", "torque"):
        right, predicted = exact[quantity], predict(quantity, closed)[closed]
        error = compute_difference(quantity, answer.quantities[quantity], right)
        assert np.all(error[closed] <= TIMES_PREDICTED * predicted), quantity
        assert np.all(predicted < 1e-3 * magnitude(right)[closed]), quantity


def test_a_step_of_refinement_leaves_the_residual_of_a_rounding():
    """Bars almost in line: the determinant has lost nine digits."""
    jacobian = np.array([[0.3, 1.0, -1.0], [0.2, 0.7, -0.7 + 1e-9]])
    turn = np.array([0.0, 1.0, 0.5])
    rates = solve_closed(jacobian, 2.0, turn, (0.3, -0.4))
    terms = abs(jacobian) @ abs(rates)
    assert np.all(abs(jacobian @ rates + [0.3, -0.4]) <= 4.0 * EPS * terms)
    multipliers = np.array(solve_multipliers(jacobian, turn, [0.3, -0.4, 0.7]))
    columns = np.vstack([jacobian, turn]).T
    rest = columns @ multipliers - [0.3, -0.4, 0.7]
    assert np.all(abs(rest) <= 4.0 * EPS * (abs(columns) @ abs(multipliers)))


def test_a_drive_that_exerts_a_force_is_predicted_and_moves_no_bar():
    driven = crank_rocker(drive=ON_COUPLER)
    turned = crank_rocker()
    command = fourbar.command(driven)
    solution = fourbar.solve(driven, "force")
    mask = np.arange(len(command.theta_2)) == 20
    assert solution.drive_condition[20] > 0.1

    def predict(scene, quantity):
        return predict_from_data(scene, command, quantity, mask)

    for quantity in ("theta_3", "omega_4", "a_G3"):
        both = (predict(scene, quantity) for scene in (driven, turned))
        np.testing.assert_array_equal(*both)
    for quantity in ("drive_force", "F12", "stroke_speed"):
        size = magnitude(getattr(solution, quantity))[20]
        predicted = predict(driven, quantity)[20]
        assert 4.0 * EPS * size < predicted < 1e3 * EPS * size, quantity
    engine = list_engines()["free-body"]
    answer = FreeBody().answer(driven, command)
    assert make_prediction(engine, driven, command, answer) is not None


def test_a_motion_is_predicted_under_pin_friction_and_its_forces_are_not():
    scene = crank_rocker(effects=(fourbar.PinFriction.at(O4=(0.15, 0.006)),))
    at = fourbar.command(scene)
    engine = list_engines()["free-body"]
    predict = make_prediction(engine, scene, at, engine.start().answer(scene, at))
    everywhere = np.ones(len(at.angle), dtype=bool)
    assert np.isfinite(predict("alpha_4", everywhere)).any()
    assert predict("F14", everywhere) is predict("torque", everywhere) is None
