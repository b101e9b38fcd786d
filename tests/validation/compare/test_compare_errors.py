"""An answer with one error, at one position, of one quantity.

The comparison fails there and nowhere else.
"""

from dataclasses import replace
from functools import partial
from math import nan, sin

import numpy as np
from pytest import approx, importorskip, mark

from fourbar import Motion, Sweep, solve, uniform
from fourbar.quantities import PIN_FORCES
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.compare import COMPARED_QUANTITIES, Comparison, Demands
from fourbar_validation.compare.rows import AGREES, UNDECIDED
from fourbar_validation.compare.tolerance import EPS, EQUIVALENCE, IDENTITY, K
from fourbar_validation.engines.free_body import FreeBody
from fourbar_validation.engines.prediction import predict_from_data
from tests.support.rows import read_rows
from tests.support.scenes import balance, crank_rocker

POSITIONS = 40
SCENE = crank_rocker(Motion(Sweep(0.1, 5.9, POSITIONS - 1), 10.0, 5.0))
FORMULAS = solve(SCENE)
FIRST, MIDDLE, LAST = 0, 17, POSITIONS - 1


ALL = np.ones(POSITIONS, dtype=bool)


def make_answer(assembled=ALL, **changed):
    """Make an answer of an exact engine that agrees to the last digit.

    Some of it is changed; None: left out.
    """
    numbers = {name: np.array(FORMULAS[name]) for name in COMPARED_QUANTITIES} | changed
    left = {name: values for name, values in numbers.items() if values is not None}
    return Answer(
        "other",
        "exact",
        FORMULAS.at,
        assembled,
        left,
    )


def compare(
    answer, scene=SCENE, formulas=FORMULAS, demanded=COMPARED_QUANTITIES, **held
):
    """Return the rows of an answer by quantity."""
    comparison = Comparison(
        "scene",
        scene,
        answer,
        formulas,
        Demands(EQUIVALENCE, demanded, **held),
    )
    closure = [comparison.closure()] if "theta_3" in answer.quantities else []
    return {row.quantity: row for row in [*comparison.rows(), *closure]}


def list_failing(rows):
    return {name for name, row in rows.items() if row.failed}


def moved(name, place, by):
    """Return a quantity that is off at one position by so many parts of its largest
    value.
    """
    values = np.array(FORMULAS[name])
    values[place] += by * (1.0 if name[:5] == "theta" else abs(values).max())
    return values


def test_an_answer_without_an_error_agrees_in_every_quantity():
    rows = compare(make_answer())
    assert {row.verdict for row in rows.values()} == {AGREES}
    assert {*COMPARED_QUANTITIES, "closure", "assembled", "undecided"} == rows.keys()


@mark.parametrize("place", (FIRST, MIDDLE, LAST))
@mark.parametrize("name", ("theta_3", "omega_4", "alpha_3", "torque", "F12"))
def test_an_error_at_any_position_fails_its_row_there(name, place):
    axes = ((place, 0), (place, 1)) if name in PIN_FORCES else (place,)
    for axis in axes:
        rows = compare(make_answer(**{name: moved(name, axis, 1e-9)}))
        assert list_failing(rows) - {"closure"} == {name}
        assert rows[name].theta_2 == FORMULAS.theta_2[place]


@mark.parametrize("factor", (0.2, 5.0))
def test_what_is_allowed_is_fifty_last_digits_over_the_condition(factor):
    """Allowed of theta_3 are 50 eps over the condition of the position.

    The condition is |sin(theta_4 - theta_3)| times the shorter of bars 3, 4 over the
    longest bar.
    """
    assert (K, EPS) == (50.0, 2.0**-52)
    s = abs(sin(FORMULAS.theta_4[MIDDLE] - FORMULAS.theta_3[MIDDLE]))
    allowed = 50.0 * 2.0**-52 / (s * 0.22 / 0.3)
    answer = make_answer(theta_3=moved("theta_3", MIDDLE, factor * allowed))
    row = compare(answer)["theta_3"]
    assert row.failed == (factor > 1.0)
    if row.failed:
        assert row.allowed == approx(allowed, rel=1e-6, abs=0)


@mark.parametrize("name", ("torque", "F14", "alpha_4"))
def test_what_is_missing_or_no_number_where_the_loop_closes_fails(name):
    gone = compare(make_answer(**{name: None}))[name]
    assert gone.failed and gone.reason == "no answer"
    for place in (FIRST, LAST):
        row = compare(make_answer(**{name: moved(name, place, nan)}))[name]
        assert row.failed and row.reason.startswith("NaN")


def test_an_engine_that_closes_elsewhere_fails_either_way():
    for torque in (FORMULAS.torque, moved("torque", FIRST, nan)):
        rows = compare(make_answer(np.arange(POSITIONS) != FIRST, torque=torque))
        assert list_failing(rows) == {"assembled"}
    longer = crank_rocker(linkage=uniform(0.3, 0.25, 0.1, 0.22))
    solution = solve(longer, "position")
    assert not solution.assembled.all()
    answer = Answer("other", "exact", solution.at, np.ones(len(solution), dtype=bool))
    assert compare(answer, longer, solution, ())["assembled"].failed


def test_angles_that_do_not_close_the_loop_fail_beside_their_own_row():
    rows = compare(make_answer(theta_4=moved("theta_4", FIRST, 1e-10)))
    assert rows["closure"].failed
    assert rows["closure"].allowed == approx(IDENTITY.factor, rel=1.0, abs=0)


@mark.parametrize("shrunk", ("formulas", "answer"))
def test_neither_side_chooses_what_it_is_allowed(shrunk):
    """A torque a millionth of the right one would have terms that cancel."""
    small = 1e-6 * np.asarray(FORMULAS.torque)
    formulas = replace(FORMULAS, torque=small) if shrunk == "formulas" else FORMULAS
    answer = make_answer(**({"torque": small} if shrunk == "answer" else {}))
    row = compare(answer, SCENE, formulas)["torque"]
    assert row.failed and row.error > 0.9 and row.error / row.allowed > 1e12


@mark.parametrize("left", (1e-1, 1e-2, 1e-4))
def test_a_balanced_crank_agrees_and_a_slip_of_1e_9_does_not(left):
    """Sensitivities that predict an error hold the terms that cancel: predicted errors
    are not multiplied by them once more, which would excuse 1e-6.
    """
    scene = balance(left)
    formulas = solve(scene, "force")
    answer = FreeBody().answer(scene, formulas.at)
    rows = compare(answer, scene, formulas)
    assert {row.verdict for row in rows.values()} == {AGREES}
    assert "times N/K: the terms cancel" in rows["torque"].reason
    right = dict(answer.quantities)
    for name in ("torque", "F12", "alpha_4"):
        answer.quantities = right | {name: right[name] * (1.0 + 1e-9)}
        assert list_failing(compare(answer, scene, formulas)) == {name}
    importorskip("flint")
    answer.quantities = right | {"torque": right["torque"] * (1.0 + 1e-8)}
    rows = compare(
        answer,
        scene,
        formulas,
        ("torque",),
        predicted=partial(predict_from_data, scene, formulas.at),
    )
    assert list_failing(rows) == {"torque"}


@mark.parametrize(
    "condition, names, hidden, whose, verdict",
    read_rows("""
# no engine, however many quantities it answers, has digits to be judged by
1e-14 | omega_3 F12 | | own | undecided
1e-14 | torque | | own | undecided
# an engine's own predicted errors may hide half of what has digits
1 | omega_3 F12 | F12 | own | agrees
1 | omega_3 F12 | F12 omega_3 | own | fails
1 | torque | torque | own | fails
1 | torque | torque | | undecided
"""),
)
def test_an_engine_whose_predicted_errors_hide_most_numbers_does_not_hold(
    condition, names, hidden, whose, verdict
):
    blind = replace(FORMULAS, condition=np.full(POSITIONS, float(condition)))
    answer = make_answer(**{name: 3.0 * FORMULAS[name] for name in hidden.split()})

    def predict(name, mask):
        return np.full(POSITIONS, 1e9)

    answered = names.split()
    held = Demands(EQUIVALENCE, tuple(answered), predict, of_itself=bool(whose))
    compared = Comparison("", SCENE, answer, blind, held, blind).rows()
    rows = {row.quantity: row.verdict for row in compared}
    assert rows[answered[-1]] == UNDECIDED
    assert rows["undecided"] == verdict


def test_an_error_within_the_rounding_of_theta_2_is_taken_again():
    """Where it is larger than predicted; the answer nearby is that of the formulas."""
    answer = make_answer(torque=moved("torque", MIDDLE, 1e-9))

    def judge(**held):
        held["predicted"] = lambda quantity, mask: np.zeros(POSITIONS)
        return compare(answer, SCENE, FORMULAS, ("torque",), **held)["torque"]

    assert judge().failed
    again = judge(answer_nearby=lambda: {"torque": FORMULAS.torque})
    assert again.verdict == AGREES and "; 1 position within the" in again.reason
    assert K * EPS <= again.allowed < 1e-6
