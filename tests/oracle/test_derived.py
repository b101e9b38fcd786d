"""What is derived from `solve` is judged by the oracles where that is hard.

That an oracle fails what errs is tried by the planted faults of the lab.
"""

from dataclasses import replace

import numpy as np
import pytest

import fourbar
from fourbar.effects import Place
from fourbar.evaluation.case import Case
from fourbar.files import loads
from fourbar.scene import Scene, command
from fourbar.studies import derivatives
from fourbar.studies.keys import read_numbers
from fourbar_lab.fault_scenes import FAULT_SCENES
from fourbar_validation.compare.rows import REFUSES
from fourbar_validation.run.question import NotAskedError
from tests.oracle.coordinates import DRAWN_SETTING
from tests.oracle.oracles import OF_FORCES, judge_by
from tests.oracle.scenes import SLENDER
from tests.oracle.variants import SceneFile
from tests.support.scenes import crank_rocker


def failing(rows):
    return {row.quantity for row in rows if row.failed}


CHANGE_POINTS = {
    "a parallelogram": (0.3, 0.1, 0.3, 0.1),
    "a kite": (0.3, 0.1, 0.1, 0.3),
}
NEAREST = ("study", "sensitivity", "tolerances")
"""Checks whose members keep the nominal assembly."""


def passing_change_points(name, branch):
    d, a, b, c = CHANGE_POINTS[name]
    linkage = fourbar.FourBar(
        d,
        fourbar.Bar(a),
        fourbar.Bar(b, 2.0),
        fourbar.Bar(c),
    )
    motion = fourbar.Motion(
        fourbar.Sweep(0.0, 2.0 * np.pi, 24),
        6.3,
        branch=branch,
    )
    return fourbar.Scene(linkage, motion, effects=(fourbar.Gravity(),))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "branch"), [("a parallelogram", 1), ("a kite", -1)])
def test_members_near_a_change_point_keep_the_nominal_assembly(name, branch):
    scene = passing_change_points(name, branch)
    for engine in NEAREST:
        rows = judge_by(scene, engine)
        assert {"theta_4", "torque"} <= {row.quantity for row in rows if row.compared}
        assert not failing(rows)


def test_a_member_in_the_other_closure_fails(monkeypatch):
    """Each member solved alone changes over to the other motion past 180 deg."""
    monkeypatch.setattr(Case, "beside", lambda case, _: case)
    scene = passing_change_points("a parallelogram", 1)
    assert {"theta_4", "torque"} <= failing(judge_by(scene, "study"))


@pytest.mark.slow
def test_derivatives_of_the_other_closure_fail(monkeypatch):
    monkeypatch.setattr(derivatives, "find_root_sign", lambda *_, **__: 1.0)
    scene = passing_change_points("a parallelogram", 1)
    assert {"theta_4", "torque"} <= failing(judge_by(scene, "sensitivity"))
    assert {"theta_4", "torque"} <= failing(judge_by(scene, "tolerances"))


def test_tolerances_far_past_a_change_point_are_not_asked():
    scene = passing_change_points("a parallelogram", 1)
    wide = fourbar.Tolerance("lengths.input", 0.01)
    with pytest.raises(NotAskedError, match="far past a change point"):
        judge_by(replace(scene, tolerances=(wide,)), "tolerances")


def turned(place):
    return place._replace(theta_2=place.theta_2 + 1e-7)


SPOILT = {
    "missed": lambda rest: [],
    "torque": lambda rest: [rest._replace(place=turned(rest.place))],
    "slope": lambda rest: [rest._replace(slope=-rest.slope)],
    "inertia": lambda rest: [rest._replace(inertia=1.000001 * rest.inertia)],
    "frequency": lambda rest: [rest._replace(frequency=3.0)],
}
"""What is put in the place of an equilibrium, by the quantity that fails."""


@pytest.mark.parametrize("quantity", SPOILT)
def test_equilibria_that_err_fail(monkeypatch, quantity):
    answer = fourbar.equilibrium(SLENDER)
    first, *others = answer.found
    spoilt = answer._replace(found=(*SPOILT[quantity](first), *others))
    monkeypatch.setattr(fourbar, "equilibrium", lambda _: spoilt)
    assert quantity in failing(judge_by(SLENDER, "equilibria"))


@pytest.mark.slow
def test_a_frequency_of_an_inertia_that_is_rounding_fails(monkeypatch):
    output = fourbar.Bar(0.25, 1.0, 0.002, (0.1, 0.0))
    bars = fourbar.Bar(0.4), fourbar.Bar(0.2), output
    scene = Scene(fourbar.FourBar(0.3, *bars, 0.5), effects=(fourbar.Gravity(),))
    assert not failing(judge_by(scene, "equilibria"))
    answer = fourbar.equilibrium(scene)
    found = [
        rest._replace(frequency=1e16)
        if rest.stability == "stable" and rest.frequency is None
        else rest
        for rest in answer.found
    ]
    spoilt = answer._replace(found=tuple(found))
    monkeypatch.setattr(fourbar, "equilibrium", lambda _: spoilt)
    assert "frequency" in failing(judge_by(scene, "equilibria"))


@pytest.mark.parametrize("gravity", [-0.7, 2.1])
def test_equilibria_near_a_limit_are_compared_too(gravity):
    scene = replace(
        FAULT_SCENES["limited"],
        effects=(fourbar.Gravity(9.81, gravity),),
    )
    rows = judge_by(scene, "equilibria")
    reasons = {row.reason for row in rows if row.quantity in ("torque", "slope")}
    assert reasons == {"rest: 2 of 2 equilibria"}
    assert not failing(rows)


NEARLY_MEET = fourbar.Spring(
    Place(1, (0.05, 0.0)), Place(2, (0.05005, 0.0)), 2e4, 0.1, 3e3
)
"""Its ends come within 0.05 mm of each other: there its line turns by half a turn
within 1 mrad of the input.
"""
MASSIVE = (fourbar.Bar(2.66, 2.0), fourbar.Bar(2.1, 1.0), fourbar.Bar(2.7, 1.0))
HARD_AT_REST = {
    "a stiff spring whose line turns within a milliradian": crank_rocker(
        motion=fourbar.Motion(1.0, 2.0, 0.5),
        effects=(fourbar.Gravity(), fourbar.Springs((NEARLY_MEET,))),
    ),
    "a flywheel alone, at a limit of the input": fourbar.Scene(
        fourbar.FourBar(0.4, fourbar.Bar(0.3), fourbar.Bar(0.25), fourbar.Bar(0.15)),
        fourbar.Motion(0.1, 2.0, 0.5),
        loads=(fourbar.Load(2, moment=1.5),),
        effects=(fourbar.Flywheel(0.3, 2),),
    ),
    "a sweep that begins on one circuit and goes on on another": fourbar.Scene(
        fourbar.FourBar(3.15, *MASSIVE, ground_angle=-0.19),
        fourbar.Motion(fourbar.Sweep(-0.3667, 2.037, 36), 7.4, 1.8),
        effects=(fourbar.Gravity(9.81, -2.0),),
    ),
    # where rounding moves the slope by 1e-10 of itself
    "an equilibrium 1e-6 rad beside a limit": replace(
        FAULT_SCENES["limited"],
        loads=(),
        effects=(fourbar.Gravity(9.81, 2.1920361095494605),),
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", HARD_AT_REST)
def test_right_equilibria_hold_where_they_are_hard_to_judge(name):
    rows = judge_by(HARD_AT_REST[name], "equilibria")
    assert {row.quantity for row in rows} >= {"missed", "torque", "slope", "inertia"}
    assert not [row for row in rows if row.failed]


def test_a_heavy_output_that_turns_slowly_keeps_its_inertia():
    """Its turn is 6e-7 of the fastest bar's, to all digits, beside a dead centre."""
    bars = fourbar.Bar(0.1, 0.2), fourbar.Bar(0.25, 0.5), fourbar.Bar(0.22, 4e5)
    linkage = fourbar.FourBar(0.3, *bars)
    rows = judge_by(Scene(linkage, effects=(fourbar.Gravity(),)), "equilibria")
    assert {"inertia", "frequency"} <= {row.quantity for row in rows if row.compared}
    assert not failing(rows)


@pytest.mark.parametrize("engine", ["equilibria", "study", "sensitivity"])
def test_where_nothing_assembles_nothing_is_asked(engine):
    scene = FAULT_SCENES["limited"]
    nowhere = scene.motion.replace(angle=fourbar.Sweep(3.0, 3.1, 4))
    scene = replace(scene, motion=nowhere)
    with pytest.raises(NotAskedError):
        judge_by(scene, engine)


BARELY = {
    "study": (
        0.11238507634792622,
        0.4082212569087814,
        0.018629148731677116,
        0.27731711941435316,
    ),
    "sensitivity": (1.00049, 0.3, 5e-4, 0.7),
    "tolerances": (0.99991, 0.3, 3e-4, 0.7),
}
"""Lengths, m, at positions of condition 0.1 and more, that the check's own changes
bring to where nothing assembles.
"""


@pytest.mark.parametrize("engine", BARELY)
def test_a_changed_linkage_that_hardly_assembles_is_no_failure(engine):
    d, *moving = BARELY[engine]
    linkage = fourbar.FourBar(d, *(fourbar.Bar(length, 1.0) for length in moving))
    motion = fourbar.Motion(None, 2.0, 0.5)
    scene = fourbar.Scene(
        linkage,
        motion,
        effects=(fourbar.Gravity(),),
    )
    assert not failing(judge_by(scene, engine))


COMMANDS = {
    "theta_3": fourbar.Motion(
        theta_3=fourbar.Sweep(0.67, 1.25, 20),
        omega_3=2.0,
        alpha_3=1.0,
        branch=-1,
    ),
    "theta_4": fourbar.Motion(
        theta_4=fourbar.Sweep(2.0, 2.75, 20),
        omega_4=2.0,
        alpha_4=1.0,
    ),
    "stroke": fourbar.Motion(
        stroke=fourbar.Sweep(0.2, 0.3, 20),
        stroke_speed=0.2,
        side="left",
    ),
}


def commanding(name):
    ends = Place(1, (0.25, -2.8)), Place(2, (0.09, 0.17))
    return crank_rocker(
        motion=COMMANDS[name],
        drive=fourbar.LinearDrive(*ends),
        effects=(fourbar.Gravity(),),
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_other_commands_are_judged_too(name):
    rows = judge_by(commanding(name))
    assert not failing(rows)
    oracles = {oracle.__name__ for oracle in OF_FORCES} - {"sdf", "usd"}
    assert {row.engine for row in rows if row.compared} >= oracles


def test_what_a_file_cannot_hold_is_refused():
    (row,) = judge_by(FAULT_SCENES["sliding pins"], "usd")
    assert row.verdict == REFUSES and "pin_friction" in row.reason


@pytest.mark.parametrize(
    "name", ["crank-rocker", "damped", "sprung", "flywheel", "sliding pins", "table"]
)
def test_every_number_that_a_scene_states_is_found_in_its_file(name):
    scene = FAULT_SCENES[name]
    keys = read_numbers(scene).keys()
    stated = SceneFile(scene).find_stated(keys)
    left_out = {key for key in keys if ".centre." in key or ".inertia" in key}
    assert stated.keys() >= keys - left_out
    changed = SceneFile(scene).move({"lengths.coupler": 0.01})
    assert changed.linkage.coupler.length == scene.linkage.coupler.length + 0.01
    assert np.array_equal(command(changed).theta_2, command(scene).theta_2)


LIFT = """\
[pins]
O2 = ["1 m", "2 m"]
A = ["1.8 m", "2.3 m"]
B = ["2.3 m", "2.3 m"]
O4 = ["1.5 m", "2 m"]
[bars.coupler]
mass = "200 kg"
[motion]
stroke = { from = "drawn", to = "75 cm", steps = 12 }
side = "drawn"
stroke_speed = "5 cm/s"
[drive]
from = { bar = 1, drawn = ["1.5 m", "1.9 m"] }
to = { bar = 2, drawn = ["1.6 m", "2.225 m"] }
[points]
edge = { bar = 3, drawn = ["2.4 m", "2.4 m"] }
[effects]
gravity = ["9.81 m/s^2", "-90 deg"]
"""


@pytest.mark.parametrize(
    "check",
    ["sensitivity", pytest.param("tolerances", marks=pytest.mark.slow), "study"],
)
def test_a_drawn_scene_is_judged_by_lengths_and_by_its_coordinates(check):
    rows = judge_by(loads(LIFT), check)
    assert not failing(rows)
    judged = {(row.setting, row.quantity): row.reason for row in rows if row.compared}
    settings = ["exact"] if check == "tolerances" else ["exact", DRAWN_SETTING]
    for setting in settings:
        for name in ("theta_4", "drive_force", "F12"):
            assert (setting, name) in judged
    if check == "sensitivity":
        assert judged["exact", "points"].endswith("in 17 numbers")
        # x and y of four pins, of the point and of both ends of the cylinder
        assert judged[DRAWN_SETTING, "points"].endswith("in 14 numbers")


def test_a_scene_stated_by_lengths_has_no_coordinates_to_judge():
    for check in ("sensitivity", "study"):
        assert {row.setting for row in judge_by(SLENDER, check)} == {"exact"}


@pytest.mark.slow
def test_tolerances_of_coordinates_are_judged():
    """A load acts at the point: it changes forces, and the pins the motion."""
    text = (
        LIFT
        + """
[[loads]]
point = "edge"
force = ["900 N", "-80 deg"]
[tolerances]
"pins.O4.1" = "0.1 mm"
"points.edge.drawn.0" = ["0.2 mm", "sigma"]
"""
    )
    scene = loads(text)
    for check in ("sensitivity", "tolerances", "study"):
        rows = judge_by(scene, check)
        assert not failing(rows)
        assert {row.quantity for row in rows if row.compared} >= {"theta_4", "F43"}
        if check == "tolerances":
            keys = "pins.O4.1, points.edge.drawn.0"
            assert {row.reason for row in rows} == {f"spread: {keys}"}


@pytest.mark.slow
def test_what_a_balanced_linkage_leaves_of_a_torque_is_not_judged():
    """A lamp that a spring of no free length balances: k = m g l/(r h)."""
    arms = (fourbar.Bar(0.3), fourbar.Bar(0.06, 2.0), fourbar.Bar(0.3))
    linkage = fourbar.FourBar(0.06, *arms, 0.5 * np.pi)
    stiffness = 2.0 * 9.81 * 0.3 / (0.08 * 0.1)
    spring = fourbar.Spring(
        Place(1, (0.1, 0.0)),
        Place(2, (0.08, 0.0)),
        stiffness,
    )
    scene = Scene(
        linkage,
        fourbar.Motion(fourbar.Sweep(-0.7, 1.0, 10), 0.0),
        effects=(fourbar.Gravity(), fourbar.Springs((spring,))),
    )
    rows = judge_by(scene, "summary")
    assert {row.quantity for row in rows} >= {"ranges", "pins"}
    assert not failing(rows)
