"""Scenes, commands and answers as JSON.

What is stated comes back bit for bit, and what is wrong is said in a line.
"""

import json
import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import fourbar
from fourbar.errors import FourBarError, InputError
from fourbar.files import dump
from fourbar.scene import StrokeOrigin
from fourbar.scene import command as list_positions
from fourbar_validation.compare.answer import Answer, EngineError
from fourbar_validation.compare.pins import state_from_pins
from fourbar_validation.engines import protocol
from fourbar_validation.engines.asking import ask_at
from fourbar_validation.engines.free_body import FreeBody
from fourbar_validation.places import MODELS
from fourbar_validation.scenes.hard_families import Hard
from fourbar_validation.scenes.random import DrawnType
from fourbar_validation.scenes.suites import Random
from tests.support.scenes import crank_rocker

FILES = sorted(MODELS.rglob("*.toml"))
RANDOM = (*(Random(40, 3, types) for types in (tuple(DrawnType), ())),)


def scenes():
    yield from (fourbar.load(file) for file in FILES)
    for suite in (*RANDOM, Hard()):
        yield from (suite.scene(index) for index in range(len(suite)))


def through_text(data):
    return json.loads(json.dumps(data, allow_nan=False))


def stated(scene):
    """What a guest is told.

    Every place from its bar's pin, every mass, the motion apart. No words, pictures,
    points, tolerances, and no drawing.
    """
    scene = state_from_pins(scene)
    link = scene.linkage
    input_bar, coupler, output = (
        replace(bar.with_mass(bar.mass), section=None, diameter=None)
        for bar in link.moving
    )
    return replace(
        scene,
        linkage=replace(link, input=input_bar, coupler=coupler, output=output),
        motion=fourbar.Motion(),
        title="",
        source="",
        pictures=(),
        points=(),
        tolerances=(),
        drawing=None,
    )


def numbers_of(data):
    if isinstance(data, dict):
        return [number for entry in data.values() for number in numbers_of(entry)]
    if isinstance(data, list):
        return [number for entry in data for number in numbers_of(entry)]
    return [data]


def same(one, two):
    if isinstance(one, np.ndarray) or isinstance(two, np.ndarray):
        return np.array_equal(one, two, equal_nan=True)
    if isinstance(one, tuple) and type(one) is type(two):
        return all(map(same, one, two))
    return one == two


def test_every_scene_and_command_comes_back_bit_for_bit():
    seen = 0
    for scene in scenes():
        data = through_text(protocol.scene_to_json(scene))
        back = protocol.scene_from_json(data)
        assert back == stated(scene)
        if scene.motion.free is not None:
            sent = through_text(protocol.release_to_json(scene))
            assert protocol.release_from_json(back, **sent).motion == scene.motion
            continue
        commanded = list_positions(scene)
        told, command = protocol.command_from_json(
            back, through_text(protocol.command_to_json(scene, commanded))
        )
        if scene.motion.stroke is not None:
            commanded = commanded._replace(
                angle=np.full_like(commanded.angle, np.nan),
                acceleration=np.full_like(commanded.angle, np.nan),
                speed=(
                    None
                    if commanded.speed is None
                    else np.full_like(commanded.angle, np.nan)
                ),
                origin=StrokeOrigin(*commanded.stated),
            )
            assert told.motion.side == scene.motion.side
        elif commanded.speed is None:
            commanded = commanded._replace(acceleration=0.0)
        differing = [
            name
            for name in commanded._fields
            if not same(getattr(command, name), getattr(commanded, name))
        ]
        assert not differing, (scene.title, differing)
        assert protocol.command_to_json(told, command) == protocol.command_to_json(
            scene, commanded
        )
        seen += 1
    assert seen > 100


def test_nothing_travels_that_the_formulas_computed():
    """Every number of a scene's JSON stands in its file's text.

    What the file leaves out is left out.
    """
    scene = replace(
        crank_rocker(),
        effects=(fourbar.Gravity(), fourbar.Viscous((("O2", 0.01),))),
    )
    data = protocol.scene_to_json(scene)
    text = dump(scene)
    for number in numbers_of(data):
        assert repr(number).strip("'") in text, number
    assert data["bars"]["input"] == {"mass": 0.2}
    assert data["bars"]["coupler"] == {
        "mass": 0.5,
        "inertia": 0.004,
        "centre": [0.13, 0.3],
    }
    assert data["loads"][0] == {
        "bar": 4,
        "force": [3.0, 0.7],
        "arm": [0.05, 1.0],
        "moment": 0.0,
        "frame": "world",
    }
    assert data["effects"] == {"gravity": [9.81, -math.pi / 2], "viscous": {"O2": 0.01}}
    massless = replace(
        scene,
        linkage=fourbar.FourBar(0.3, *(fourbar.Bar(x) for x in (0.1, 0.25, 0.22))),
        loads=(),
    )
    assert set(protocol.scene_to_json(replace(massless, effects=()))) == {
        "lengths",
        "drive",
    }


def test_a_gas_spring_travels_as_its_file_is_written_and_a_table_in_radians():
    ends = fourbar.Place(1, (0.1, -1.0)), fourbar.Place(4, (0.05, 0.2))
    gas = fourbar.Spring.gas(*ends, 0.4, 0.1, 100.0, 150.0)
    table = fourbar.Table((0.0, math.pi, 2 * math.pi), (1.0, 0.5, 1.0))
    scene = crank_rocker(
        effects=(fourbar.Springs((gas,)),),
        loads=(fourbar.Load(4, moment=1.0, from_centre=(0.1, 0.0), table=table),),
    )
    data = protocol.scene_to_json(scene)
    assert "from_pin" not in data["loads"][0], "a couple acts alike wherever it is"
    spring = data["effects"]["springs"][0]
    assert (spring["stiffness"], spring["length"], spring["preload"]) == (
        gas.stiffness,
        gas.length,
        gas.preload,
    )
    assert data["loads"][0]["table"] == {
        "theta_2": list(table.theta_2),
        "factor": [1.0, 0.5, 1.0],
    }


def test_an_engine_answers_alike_from_both_ends():
    for file in (
        "crank_rocker.toml",
        "gallery/excavator_bucket.toml",
        "gallery/tailgate.toml",
    ):
        scene = fourbar.load(MODELS / file)
        commanded = list_positions(scene)
        told, command = protocol.command_from_json(
            protocol.scene_from_json(protocol.scene_to_json(scene)),
            protocol.command_to_json(scene, commanded),
        )
        direct, received = (
            ask_at(FreeBody(), scene, commanded),
            FreeBody().answer(told, command),
        )
        back = protocol.answer_from_json(
            "free-body",
            commanded,
            through_text(protocol.answer_to_json(told, command, received)),
        )
        assert back.quantities.keys() == direct.quantities.keys()
        assert all(
            same(back.quantities[name], array)
            for name, array in direct.quantities.items()
        )
        assert same(back.assembled, direct.assembled) and back.at is commanded


def test_an_answer_comes_back_with_all_that_it_says():
    scene = crank_rocker()
    commanded = list_positions(scene)
    n = len(commanded.angle)
    moved = commanded._replace(
        angle=commanded.angle + 1e-3,
        speed=np.full(n, 10.01),
        acceleration=5.0,
    )
    torque, force = np.linspace(0.0, 1.0, n), np.ones((n, 2))
    torque[3] = np.nan
    answer = Answer(
        "mine",
        "RK4",
        moved,
        np.arange(n) != 3,
        {"torque": torque, "F12": force},
        None,
        {"torque": torque},
        ["it slipped"],
        {"gap": 1e-9},
        "nothing",
        "everything",
        0.25,
    )
    back = protocol.answer_from_json(
        "mine",
        commanded,
        through_text(protocol.answer_to_json(scene, commanded, answer)),
    )
    for name in (
        "setting",
        "alarms",
        "evidence",
        "shared",
        "own",
        "seconds",
        "refusal",
    ):
        assert getattr(back, name) == getattr(answer, name)
    assert all(same(one, two) for one, two in zip(back.at, moved, strict=True))
    assert same(back.quantities["torque"], torque) and same(
        back.predicted["torque"], torque
    )
    assert same(back.quantities["F12"], force) and same(
        back.assembled, answer.assembled
    )


def test_what_an_answer_leaves_out_has_defaults():
    commanded = list_positions(
        crank_rocker(motion=fourbar.Motion(np.array([0.0, 1.0, 2.0]), 1.0))
    )
    answer = protocol.answer_from_json(
        "mine",
        commanded,
        {"answers": {"torque": [1, None, 3], "F12": [[1, 2], None, None]}},
    )
    assert (
        answer.assembled.tolist() == [True, False, True]
        and answer.setting == "exact"
        and answer.at is commanded
    )
    assert np.isnan(answer.quantities["F12"][1:]).all()
    with pytest.raises(EngineError, match="no licence"):
        protocol.answer_from_json("mine", commanded, {"error": "no licence"})
    assert (
        protocol.answer_from_json(
            "mine", commanded, {"refusal": "no springs here"}
        ).refusal
        == "no springs here"
    )


WRONG_SCENES = [
    None,
    [],
    {"lengths": {}},
    {"lengths": {"ground": "0.3 m", "input": 0.1, "coupler": 0.25, "output": 0.22}},
    {"lengths": {"ground": True, "input": 0.1, "coupler": 0.25, "output": 0.22}},
    {"lengths": {"ground": 10**400, "input": 0.1, "coupler": 0.25, "output": 0.22}},
    {"lengths": {"ground": math.inf, "input": 0.1, "coupler": 0.25, "output": 0.22}},
    {"lengths": {"ground": 9.0, "input": 0.1, "coupler": 0.25, "output": 0.22}},
    {
        "lengths": {"ground": 0.3, "input": 0.1, "coupler": 0.25, "output": 0.22},
        "bars": {"input": {"mass": -1.0}},
    },
    {
        "lengths": {"ground": 0.3, "input": 0.1, "coupler": 0.25, "output": 0.22},
        "effects": {"gravity": [9.81]},
    },
    {
        "lengths": {"ground": 0.3, "input": 0.1, "coupler": 0.25, "output": 0.22},
        "motion": {},
    },
]
WRONG_COMMANDS = [
    None,
    {},
    {"theta_2": [], "omega_2": 1.0},
    {"theta_2": 1.0},
    {"theta_2": [1.0], "theta_3": [1.0]},
    {"theta_2": [True]},
    {"theta_2": ["1"]},
    {"theta_2": [math.nan]},
    {"theta_2": [1.0], "omega_2": [1.0, 2.0]},
    {"theta_2": [1.0], "omega_2": "fast"},
    {"theta_2": [1.0], "branch": 0},
    {"theta_2": [1.0], "branch": [1, 1]},
    {"theta_2": [1.0], "remainder": ["x"]},
    {"theta_2": [1.0], "omega_3": 1.0},
    {"stroke": [0.3], "side": "left"},
]
WRONG_ANSWERS = [
    None,
    [],
    {},
    {"answers": []},
    {"answers": {"torque": [1.0]}},
    {"answers": {"torque": [1.0, 2.0, True]}},
    {"answers": {"torque": [1.0, 2.0, "3"]}},
    {"answers": {"torque": [1.0, 2.0, math.inf]}},
    {"answers": {"torque": [1.0, 2.0, math.nan]}},
    {"answers": {"torque": [1.0, 2.0, 10**400]}},
    {"answers": {"torque": [[1.0], [2.0], [3.0]]}},
    {"answers": {"F12": [1.0, 2.0, 3.0]}},
    {"answers": {"F12": [[1.0, 2.0], [1.0, 2.0], [1.0]]}},
    {"answers": {}, "assembled": [1, 1, 1]},
    {"answers": {}, "alarms": "one"},
    {"answers": {}, "setting": 3},
    {"answers": {}, "seconds": -1.0},
    {"answers": {}, "at": {"theta_2": [5.0, 6.0, 7.0], "omega_2": 1.0}},
    {"answers": {}, "at": {"theta_2": [0.0, 1.0, 2.0]}},
    {"answers": {}, "at": {"theta_2": [0.0, 1.0, 2.0], "omega_2": 1.0, "branch": -1}},
    {"refusal": " "},
    {"refusal": 3},
]
WRONG_SETTINGS = [
    [],
    {"name": 1},
    {"steps_per_turn": 3.5},
    {"steps_per_turn": 0},
    {"error": 1.0},
    {"error": "small"},
    {"steps_per_turn": 9, "error": 0.1},
    {"timestep": 0.1},
]


def read_answer(data):
    commanded = list_positions(
        crank_rocker(motion=fourbar.Motion(np.array([0.0, 1.0, 2.0]), 1.0))
    )
    return protocol.answer_from_json("mine", commanded, data)


READ = {
    "scene": (protocol.scene_from_json, WRONG_SCENES),
    "command": (partial(protocol.command_from_json, crank_rocker()), WRONG_COMMANDS),
    "answer": (read_answer, WRONG_ANSWERS),
}


@pytest.mark.parametrize(
    ("part", "number"),
    [(part, n) for part, (_, wrong) in READ.items() for n in range(len(wrong))],
)
def test_what_is_none_is_refused_in_one_line(part, number):
    read, wrong = READ[part]
    with pytest.raises(FourBarError) as raised:
        read(wrong[number])
    assert str(raised.value) and "\n" not in str(raised.value)


@pytest.mark.parametrize("data", WRONG_SETTINGS, ids=str)
def test_a_setting_that_is_none_is_refused_in_one_line(data):
    with pytest.raises(
        InputError,
        match=r"^setting = [^\n]*: must be an object with name, and steps_per_turn",
    ):
        protocol.read_setting(data)
    assert protocol.read_setting(None) == {} and protocol.read_setting(
        {"error": 0.5}
    ) == {"error": 0.5}
    assert protocol.read_setting({"name": "a", "steps_per_turn": 1}) == {
        "name": "a",
        "steps_per_turn": 1,
    }


def test_an_engine_through_time_may_be_faster_by_what_the_acceleration_gives():
    """omega^2 = omega_0^2 + 2 alpha theta.

    Of a stroke too, whose bar has the motion that the formulas state.
    """
    command = list_positions(
        fourbar.load(MODELS / "capabilities" / "stroke_input.toml")
    )
    faster = command._replace(
        origin=None,
        speed=1.2 * command.speed,
        acceleration=1.2 * command.acceleration,
    )
    protocol.require_near(faster, command)
    steady = command._replace(acceleration=0.0 * command.acceleration)
    for made, asked in (
        (faster._replace(speed=0.0 * faster.speed), command),
        (faster, steady),
    ):
        with pytest.raises(InputError, match=r"must be within .* of the command"):
            protocol.require_near(made, asked)
