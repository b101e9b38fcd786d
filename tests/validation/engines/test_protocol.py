"""Scenes, commands and answers as JSON.

What is stated comes back bit for bit, and what is wrong is said in a line.
"""

import json
from dataclasses import replace
from functools import partial
from math import nan, pi

import numpy as np
from numpy.testing import assert_array_equal, assert_equal
from pytest import mark, raises

import fourbar
from fourbar import Motion, Place
from fourbar.errors import InputError
from fourbar.scene import StrokeOrigin
from fourbar.scene import command as list_positions
from fourbar_validation.compare.answer import Answer, EngineError
from fourbar_validation.compare.pins import state_from_pins
from fourbar_validation.engines import protocol
from fourbar_validation.engines.free_body import FreeBody
from fourbar_validation.engines.registry import ask_at
from fourbar_validation.places import MODELS
from fourbar_validation.scenes.hard_families import Hard
from fourbar_validation.scenes.random import DrawnType
from fourbar_validation.scenes.suites import Random
from tests.support.rows import read_rows, refused
from tests.support.scenes import MASSLESS, crank_rocker


def scenes():
    yield from (fourbar.load(file) for file in sorted(MODELS.rglob("*.toml")))
    for suite in (Random(40, 3, tuple(DrawnType)), Random(40, 3, ()), Hard()):
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
        replace(bar, density=None, mass_per_length=None, section=None, diameter=None)
        for bar in link.moving
    )
    return replace(
        scene,
        linkage=replace(link, input=input_bar, coupler=coupler, output=output),
        motion=Motion(),
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


@mark.slow
def test_every_scene_and_command_comes_back_bit_for_bit():
    seen = 0
    for scene in scenes():
        back = protocol.scene_from_json(through_text(protocol.scene_to_json(scene)))
        assert back == stated(scene)
        if scene.motion.free is not None:
            sent = through_text(protocol.release_to_json(scene))
            assert protocol.release_from_json(back, **sent).motion == scene.motion
            continue
        commanded = list_positions(scene)
        sent = through_text(protocol.command_to_json(scene, commanded))
        told, command = protocol.command_from_json(back, sent)
        if scene.motion.stroke is not None:
            none = np.full_like(commanded.angle, nan)
            commanded = commanded._replace(
                angle=none,
                speed=None if commanded.speed is None else none,
                acceleration=none,
                origin=StrokeOrigin(*commanded.stated),
            )
            assert told.motion.side == scene.motion.side
        elif commanded.speed is None:
            commanded = commanded._replace(acceleration=0.0)
        pairs = zip(commanded._fields, command, commanded, strict=True)
        assert [name for name, *both in pairs if not same(*both)] == [], scene.title
        assert through_text(protocol.command_to_json(told, command)) == sent
        seen += 1
    assert seen > 100


def test_nothing_travels_that_the_formulas_computed():
    """Every number of a scene's JSON stands in its file's text.

    What the file leaves out is left out.
    """
    acting = (fourbar.Gravity(), fourbar.Viscous.at(O2=0.01))
    scene = crank_rocker(effects=acting)
    data, text = protocol.scene_to_json(scene), fourbar.dump(scene)
    for number in numbers_of(data):
        assert repr(number).strip("'") in text, number
    assert data["bars"]["input"] == {"mass": 0.2}
    coupler = {"mass": 0.5, "inertia": 0.004, "centre": [0.13, 0.3]}
    assert data["bars"]["coupler"] == coupler
    placed = {"bar": 4, "force": [3.0, 0.7], "arm": [0.05, 1.0]}
    assert data["loads"][0] == placed | {"moment": 0.0, "frame": "world"}
    assert data["effects"] == {"gravity": [9.81, -pi / 2], "viscous": {"O2": 0.01}}
    massless = fourbar.Scene(MASSLESS, scene.motion)
    assert set(protocol.scene_to_json(massless)) == {"lengths", "drive"}


def test_a_gas_spring_travels_as_its_file_is_written_and_a_table_in_radians():
    ends = Place(1, (0.1, -1.0)), Place(4, (0.05, 0.2))
    gas = fourbar.Spring.gas(*ends, 0.4, 0.1, 100.0, 150.0)
    table = fourbar.Table((0.0, pi, 2 * pi), (1.0, 0.5, 1.0))
    couple = fourbar.Load(4, moment=1.0, from_centre=(0.1, 0.0), table=table)
    scene = crank_rocker(effects=(fourbar.Springs((gas,)),), loads=(couple,))
    data = protocol.scene_to_json(scene)
    (load,), (spring,) = data["loads"], data["effects"]["springs"]
    assert "from_pin" not in load, "a couple acts alike wherever it is"
    for name in ("stiffness", "length", "preload"):
        assert spring[name] == getattr(gas, name)
    assert load["table"] == {"theta_2": [*table.theta_2], "factor": [1.0, 0.5, 1.0]}


@mark.parametrize(
    "name", ["crank_rocker", "gallery/excavator_bucket", "gallery/tailgate"]
)
def test_an_engine_answers_alike_from_both_ends(name):
    scene = fourbar.load(MODELS / f"{name}.toml")
    commanded = list_positions(scene)
    told, command = protocol.command_from_json(
        protocol.scene_from_json(protocol.scene_to_json(scene)),
        protocol.command_to_json(scene, commanded),
    )
    direct = ask_at(FreeBody(), scene, commanded)
    answer = FreeBody().answer(told, command)
    sent = through_text(protocol.answer_to_json(told, command, answer))
    back = protocol.answer_from_json("free-body", commanded, sent)
    assert_equal(back.quantities, direct.quantities)
    assert_equal(back.assembled, direct.assembled)
    assert back.at is commanded


def test_an_answer_comes_back_with_all_that_it_says():
    scene = crank_rocker()
    commanded = list_positions(scene)
    n = len(commanded.angle)
    moved = commanded._replace(
        angle=commanded.angle + 1e-3, speed=np.full(n, 10.01), acceleration=5.0
    )
    torque, here = np.linspace(0.0, 1.0, n), np.arange(n) != 3
    torque[~here] = nan
    said = {
        "setting": "RK4",
        "assembled": here,
        "quantities": {"torque": torque, "F12": np.ones((n, 2))},
        "predicted": {"torque": torque},
        "alarms": ["it slipped"],
        "evidence": {"gap": 1e-9},
        "shared": "nothing",
        "own": "everything",
        "seconds": 0.25,
        "refusal": None,
    }
    answer = Answer("mine", at=moved, **said)
    sent = through_text(protocol.answer_to_json(scene, commanded, answer))
    back = protocol.answer_from_json("mine", commanded, sent)
    assert all(same(one, two) for one, two in zip(back.at, moved, strict=True))
    for name, value in said.items():
        assert_equal(getattr(back, name), value)


THREE = crank_rocker(Motion(np.array([0.0, 1.0, 2.0]), 1.0))


def read_answer(data):
    return protocol.answer_from_json("mine", list_positions(THREE), data)


def test_what_an_answer_leaves_out_has_defaults():
    pairs = [[1, 2], None, None]
    answer = read_answer({"answers": {"torque": [1, None, 3], "F12": pairs}})
    assert answer.assembled.tolist() == [True, False, True]
    assert answer.setting == "exact"
    assert_array_equal(answer.at.angle, list_positions(THREE).angle)
    assert np.isnan(answer.quantities["F12"][1:]).all()
    assert read_answer({"refusal": "no springs here"}).refusal == "no springs here"
    # what the command alone decides is no word on whether the loop closes
    echoed = {"omega_2": [1, 1, 1], "v_A": 3 * [[0, 1]]}
    closed = read_answer({"answers": {"theta_3": [1, None, 3], **echoed}}).assembled
    assert closed.tolist() == [True, False, True]
    assert read_answer({"answers": echoed}).assembled.all()
    with raises(EngineError, match="no licence"):
        read_answer({"error": "no licence"})
    faster = {"theta_2": [0, 1, 2], "omega_2": 1.01}
    assert read_answer({"answers": {}, "at": faster}).at.speed == 1.01
    half = [[1, 2], [3, "y"], None]
    with refused("F12, entry 1 = 'y'"):
        read_answer({"answers": {"F12": half}})


READ = {
    "scene": protocol.scene_from_json,
    "command": partial(protocol.command_from_json, crank_rocker()),
    "answer": read_answer,
}
MOVING = '"input": 0.1, "coupler": 0.25, "output": 0.22'
WRONG = read_rows("""
scene | null
scene | []
scene | {"lengths": {}}
scene | {"lengths": {"ground": "0.3 m", MOVING}}
scene | {"lengths": {"ground": true, MOVING}}
scene | {"lengths": {"ground": HUGE, MOVING}}
scene | {"lengths": {"ground": Infinity, MOVING}}
scene | {"lengths": {"ground": 9.0, MOVING}}
scene | {"lengths": {"ground": 0.3, MOVING}, "bars": {"input": {"mass": -1.0}}}
scene | {"lengths": {"ground": 0.3, MOVING}, "effects": {"gravity": [9.81]}}
scene | {"lengths": {"ground": 0.3, MOVING}, "motion": {}}
command | null
command | {}
command | {"theta_2": [], "omega_2": 1.0}
command | {"theta_2": 1.0}
command | {"theta_2": [1.0], "theta_3": [1.0]}
command | {"theta_2": [true]}
command | {"theta_2": ["1"]}
command | {"theta_2": [NaN]}
command | {"theta_2": [null]}
command | {"theta_2": [1.0], "omega_2": [1.0, 2.0]}
command | {"theta_2": [1.0], "omega_2": "fast"}
command | {"theta_2": [1.0], "branch": 0}
command | {"theta_2": [1.0], "branch": [1, 1]}
command | {"theta_2": [1.0], "remainder": ["x"]}
command | {"theta_2": [1.0], "omega_3": 1.0}
command | {"stroke": [0.3], "side": "left"}
answer | null
answer | []
answer | {}
answer | {"answers": []}
answer | {"answers": {"torque": [1.0]}}
answer | {"answers": {"torque": [1.0, 2.0, true]}}
answer | {"answers": {"torque": [1.0, 2.0, "3"]}}
answer | {"answers": {"torque": [1.0, 2.0, Infinity]}}
answer | {"answers": {"torque": [1.0, 2.0, NaN]}}
answer | {"answers": {"torque": [1.0, 2.0, HUGE]}}
answer | {"answers": {"torque": [[1.0], [2.0], [3.0]]}}
answer | {"answers": {"F12": [1.0, 2.0, 3.0]}}
answer | {"answers": {"F12": [[1.0, 2.0], [1.0, 2.0], [1.0]]}}
answer | {"answers": {}, "assembled": [1, 1, 1]}
answer | {"answers": {}, "alarms": "one"}
answer | {"answers": {}, "setting": 3}
answer | {"answers": {}, "seconds": -1.0}
answer | {"answers": {}, "at": {"theta_2": [5.0, 6.0, 7.0], "omega_2": 1.0}}
answer | {"answers": {}, "at": {"theta_2": [0.0, 1.0, 2.0]}}
answer | {"answers": {}, "at": {"theta_2": [0.0, 1.0, 2.0], "omega_2": 1.0, "branch": \
-1}}
answer | {"refusal": " "}
answer | {"refusal": 3}
""")


@mark.parametrize("part, text", WRONG)
def test_what_is_none_is_refused_in_one_line(part, text):
    data = json.loads(text.replace("MOVING", MOVING).replace("HUGE", "9" * 400))
    with refused():
        READ[part](data)


@mark.parametrize(
    ("text",),
    read_rows("""
[]
{"name": 1}
{"steps_per_turn": 3.5}
{"steps_per_turn": 0}
{"error": 1.0}
{"error": "small"}
{"steps_per_turn": 9, "error": 0.1}
{"timestep": 0.1}
"""),
)
def test_a_setting_that_is_none_is_refused_in_one_line(text):
    words = ": must be an object with name, and steps_per_turn"
    with refused(words, start="setting = "):
        protocol.read_setting(json.loads(text))


def test_a_setting_is_read_as_it_is_stated():
    assert protocol.read_setting(None) == {}
    for data in ({"error": 0.5}, {"name": "a", "steps_per_turn": 1}):
        assert protocol.read_setting(data) == data


def test_an_engine_through_time_may_be_faster_by_what_the_acceleration_gives():
    """omega^2 = omega_0^2 + 2 alpha theta.

    Of a stroke too, whose bar has the motion that the formulas state.
    """
    stroke = fourbar.load(MODELS / "capabilities" / "stroke_input.toml")
    command = list_positions(stroke)
    speed, acceleration = command.speed, command.acceleration
    faster = command._replace(
        origin=None, speed=1.2 * speed, acceleration=1.2 * acceleration
    )
    protocol.require_near(faster, command)
    steady = command._replace(acceleration=0.0 * acceleration)
    standing = faster._replace(speed=0.0 * speed)
    for made, asked in ((standing, command), (faster, steady)):
        with raises(InputError, match=r"must be within .* of the command"):
            protocol.require_near(made, asked)
