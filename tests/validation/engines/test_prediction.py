"""What is predicted where rounding decides whether the loop closes.

Nothing that does not depend on it is excused.
"""

import math

import numpy as np
import pytest

import fourbar
from fourbar.formulas.mobility import limit_positions
from fourbar.linkage import uniform
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
    mark_touching,
    sum_lengths,
)
from fourbar_validation.engines.free_body import FreeBody
from fourbar_validation.engines.prediction import _bound_touching, predict_from_data
from fourbar_validation.engines.registry import Engine
from fourbar_validation.run.answers import compare_answer
from fourbar_validation.run.judge import make_question
from fourbar_validation.run.question import Question

pytest.importorskip("flint")
ROCKER = uniform(0.3, 0.25, 0.1, 0.22)
BOUNDED = ("theta_3", "theta_4", "B", "G3", "G4", "sin_mu", "condition")
"""What follows from the angles of bars 3 and 4 alone."""


def touch() -> Scene:
    """Command bar 2 to within a rounding of where its loop ceases to close.

    It goes in the sense in which it closes.
    """
    limit = next(x.theta_2 for x in limit_positions(ROCKER) if 0.0 < x.theta_2 < np.pi)
    angles = limit + np.arange(-6, 7) * EPS
    scene = Scene(ROCKER, Motion(angles, 3.0))
    solution = fourbar.solve(scene)
    closed = angles[(solution.status_code == 0) & mark_touching(ROCKER, angles)]
    assert len(closed) >= 3
    return Scene(ROCKER, Motion(closed, 3.0))


@pytest.fixture(scope="module")
def question() -> Question:
    """Ask nobody of a loop that just closes."""
    return make_question("scene", touch(), ())


ENGINE = Engine("spoiled", FreeBody, FULL_ACCURACY, predictor=predict_from_data)


@pytest.mark.parametrize("quantity", ("A", "G2", "v_A", "omega_2", "B", "G4"))
def test_a_place_that_is_wrong_by_a_half_fails_where_the_loop_just_closes(
    quantity: str,
    question: Question,
) -> None:
    solution = question.solution
    numbers = {name: np.array(getattr(solution, name)) for name in COMPARED_QUANTITIES}
    numbers[quantity] *= 1.5
    closes = np.array(solution.assembled)
    answer = Answer("spoiled", "exact", question.at, closes, numbers)
    rows = compare_answer(question, ENGINE, answer)
    assert [row.quantity for row in rows if row.failed] == [quantity]


def test_what_the_input_decides_is_predicted_to_its_last_digits() -> None:
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


@pytest.mark.parametrize("stretched", (True, False))
@pytest.mark.parametrize(("b", "c"), ((0.1, 0.22), (0.4, 0.07), (0.3, 1e-3)))
def test_the_bound_of_the_angles_is_that_of_the_triangle(
    b: float,
    c: float,
    stretched: bool,
) -> None:
    """Close a triangle that misses its line by the margin.

    The cosine rule is used in 200 bits.
    """
    from flint import arb, ctx

    e = b + c if stretched else abs(b - c)
    d, a = 0.8 * e, 0.7 * e
    linkage = uniform(d, a, b, c)
    psi = math.acos((d * d + a * a - e * e) / (2.0 * d * a))
    bits, ctx.prec = ctx.prec, 200
    try:
        missed = arb(TOUCHING_MARGIN) * arb(sum_lengths(linkage))
        B, C = arb(b), arb(c)
        E = B + C - missed if stretched else abs(B - C) + missed
        for name, one, other in (("theta_3", B, C), ("theta_4", C, B)):
            cosine = (E * E + one * one - other * other) / (2 * E * one)
            angle = float(cosine.acos())
            off = min(angle, float(arb.pi() - cosine.acos()))
            bound = _bound_touching(linkage, psi, name)
            assert 0.99 * off <= bound <= 1.01 * off + 1e-12, name
    finally:
        ctx.prec = bits
    assert math.isinf(_bound_touching(linkage, psi, "omega_3"))
    assert TIMES_PREDICTED * _bound_touching(linkage, psi, "sin_mu") < 1.0
