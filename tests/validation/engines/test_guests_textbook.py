"""A right program as a textbook has it agrees, and a slip of 1e-9 in it does not."""

from dataclasses import replace

import pytest

import fourbar
from fourbar_validation.compare.tolerance import EQUIVALENCE
from fourbar_validation.engines.prediction import predict_for_any_method
from fourbar_validation.engines.registry import Engine
from fourbar_validation.run.judge import make_question
from fourbar_validation.run.judge_engines import compare_answer
from fourbar_validation.scenes.random import DrawnType, draw_random_scene
from tests.support.textbook import Textbook
from tests.whole.test_imports import ROOT

ENGINE = Engine(
    Textbook.name,
    Textbook,
    EQUIVALENCE,
    Textbook.quantities,
    predictor=predict_for_any_method,
)
MODELS = sorted(path.stem for path in (ROOT / "models").glob("*.toml"))


def check(scene):
    """Judge the textbook right, and with a slip wrong; tell whether it answers."""
    question = make_question("scene", scene, (ENGINE,))
    answer = question.answer(ENGINE)
    if answer.refusal is not None:
        return False
    failed = [row for row in compare_answer(question, ENGINE, answer) if row.failed]
    assert not failed, failed
    unpredicted = replace(ENGINE, predictor=None)
    for name in ("torque", "F12", "alpha_4"):
        slipped = answer.quantities | {name: answer.quantities[name] * (1.0 + 1e-9)}
        wrong = replace(answer, quantities=slipped)
        rows = compare_answer(question, unpredicted, wrong)
        assert {row.quantity for row in rows if row.failed} == {name}
    return True


@pytest.mark.parametrize("name", MODELS)
def test_it_agrees_on_every_model(name):
    assert check(fourbar.load(ROOT / "models" / f"{name}.toml"))


@pytest.mark.slow
def test_it_agrees_on_a_hundred_random_scenes():
    drawn = (draw_random_scene(993, i, tuple(DrawnType)) for i in range(100))
    assert sum(map(check, drawn)) >= 65
