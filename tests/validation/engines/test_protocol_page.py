"""docs/protocol.md: its engine answers by the page's words alone, and its schema is
what both sides write and read.
"""

import json
import subprocess
import sys

from pytest import fixture, importorskip, mark

import fourbar
from fourbar.effects import Gravity
from fourbar.quantities import PIN_FORCES
from fourbar.scene import command as list_positions
from fourbar.scene import with_signs
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.compare import COMPARED_QUANTITIES
from fourbar_validation.compare.tolerance import (
    EPS,
    K,
    compute_difference,
    magnitude,
)
from fourbar_validation.engines import protocol
from fourbar_validation.engines.free_body import FreeBody
from fourbar_validation.places import MODELS
from tests.support.checkout import read
from tests.support.guests import PLAIN
from tests.support.scenes import crank_rocker
from tests.validation.engines.test_protocol import (
    scenes,
)

SCHEMA = json.loads(read("docs/protocol.schema.json"))
NAMED = (*sorted(MODELS.glob("*.toml")), *sorted(MODELS.glob("textbook/*.toml")))


@fixture
def engine(tmp_path):
    """The page's engine, as a reader saves it."""
    file = tmp_path / "engine.py"
    file.write_text(PLAIN)
    return file


def ask(engine, scene):
    """Ask it hello, and the positions of a scene, in a Python that sees nothing of this
    project, nor any library.
    """
    # an engine is told the sign of the command's own sine at each position
    told = with_signs(scene.linkage, list_positions(scene))
    questions = (
        {"ask": "hello", "protocol": 4},
        {
            "ask": "answer",
            "scene": protocol.scene_to_json(scene),
            "command": protocol.command_to_json(scene, told),
        },
    )
    lines = [json.dumps({"id": k, **one}) + "\n" for k, one in enumerate(questions)]
    answered = subprocess.run(
        [sys.executable, "-I", "-S", engine],
        input="".join(lines),
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    replies = [json.loads(line) for line in answered.stdout.splitlines()]
    assert [reply["id"] for reply in replies] == [0, 1] and not answered.stderr
    return replies


@mark.parametrize("file", NAMED, ids=lambda file: file.stem)
def test_the_page_s_engine_answers_what_the_formulas_do(engine, file):
    scene = fourbar.load(file)
    motion = scene.motion
    if motion.free is not None:
        motion = fourbar.Motion(branch=motion.branch)
    gravity = tuple(effect for effect in scene.effects if isinstance(effect, Gravity))
    scene = fourbar.Scene(
        scene.linkage, motion.replace(speed=motion.speed or 1.0), effects=gravity
    )
    commanded = list_positions(scene)
    hello, reply = ask(engine, scene)
    answer = protocol.answer_from_json(hello["engine"], commanded, reply)
    truth = fourbar.solve(scene, at=commanded)
    steady = truth.condition >= 0.03
    force = max(magnitude(truth[name][steady]).max() for name in PIN_FORCES)
    size = {"torque": force * scene.linkage.input.length}
    size |= dict.fromkeys(PIN_FORCES, force)
    assert set(hello["answers"]) <= set(COMPARED_QUANTITIES) and steady.any()
    assert len(hello["answers"]) == 7
    for name in hello["answers"]:
        apart = compute_difference(name, truth[name], answer.quantities[name])[steady]
        # as it grows near a change point
        allowed = K * EPS * size.get(name, 1.0) / truth.condition[steady] ** 3
        assert (apart <= allowed).all(), name


def check(part):
    jsonschema = importorskip("jsonschema")
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    return jsonschema.Draft202012Validator(
        {"$ref": f"#/$defs/{part}", "$defs": SCHEMA["$defs"]}
    )


@mark.slow
def test_what_the_judge_writes_is_what_the_schema_says():
    seen, question = 0, check("question")
    for seen, scene in enumerate(scenes(), 1):
        told = {"id": seen, "scene": protocol.scene_to_json(scene)}
        if scene.motion.free is None:
            command = protocol.command_to_json(scene, list_positions(scene))
            told |= {"ask": "answer", "command": command}
        else:
            told |= {"ask": "release", **protocol.release_to_json(scene)}
        question.validate(json.loads(json.dumps(told)))
    assert seen > 100


@mark.slow
def test_what_an_engine_writes_is_what_the_schema_says(engine):
    scene = crank_rocker(loads=())
    commanded = list_positions(scene)
    hello, reply = ask(engine, scene)
    check("hello").validate(hello)
    check("answer").validate(reply)
    for answer in (
        FreeBody().answer(scene, commanded),
        Answer("mine", "exact", refusal="no"),
    ):
        data = {"id": 1, **protocol.answer_to_json(scene, commanded, answer)}
        check("reply").validate(json.loads(json.dumps(data)))
