"""A right program as a textbook has it agrees, and a slip of 1e-9 in it does not."""

from dataclasses import replace

from pytest import fixture, importorskip, mark

import fourbar
from fourbar_validation.engines.guests import read_guests
from fourbar_validation.places import MODELS
from fourbar_validation.run.judge import make_question
from fourbar_validation.run.judge_engines import compare_answer
from fourbar_validation.scenes.random import DrawnType, draw_random_scene

FILES = sorted(MODELS.glob("*.toml"))


@fixture(scope="module")
def engine():
    return read_guests(["tests.support.textbook:Textbook"], ())[0]


def check(engine, scene):
    """Judge the textbook right, and with a slip wrong; tell whether it answers."""
    question = make_question("scene", scene, (engine,))
    answer = question.answer(engine)
    if answer.refusal is not None:
        return False
    failed = [row for row in compare_answer(question, engine, answer) if row.failed]
    assert not failed, failed
    unpredicted = replace(engine, predictor=None)
    for name in ("torque", "F12", "alpha_4"):
        slipped = answer.quantities | {name: answer.quantities[name] * (1.0 + 1e-9)}
        wrong = replace(answer, quantities=slipped)
        rows = compare_answer(question, unpredicted, wrong)
        assert {row.quantity for row in rows if row.failed} == {name}
    return True


@mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_it_agrees_on_every_model(engine, file):
    assert check(engine, fourbar.load(file))


def test_it_is_allowed_the_error_that_is_predicted_for_the_position(engine):
    """alpha_4 cancels 3500-fold, and with it a torque whose own terms do not.

    A slip of ten times what the rule allows stands in for the rounding of a processor:
    1e-13 are allowed by the rule, and 1e-11 are predicted.
    """
    importorskip("flint")
    question = make_question("uneven", draw_random_scene(73, 27, ()), (engine,))
    answer = question.answer(engine)
    torque = answer.quantities["torque"]
    by_rule = replace(engine, predictor=None)
    for held, slip, fails in (
        (engine, 1e-12, False),
        (by_rule, 1e-12, True),
        (engine, 1e-10, True),
    ):
        slipped = answer.quantities | {"torque": torque * (1.0 + slip)}
        rows = compare_answer(question, held, replace(answer, quantities=slipped))
        failed = [row.quantity for row in rows if row.failed]
        assert failed == ["torque"] * fails


@mark.slow
def test_it_agrees_on_a_hundred_random_scenes(engine):
    drawn = (draw_random_scene(993, i, tuple(DrawnType)) for i in range(100))
    assert sum(check(engine, scene) for scene in drawn) >= 65
