"""The loops of a robot's file as they are measured, against formulas and free bodies.

All, one by name, by a scene of one's own; past change points, and with ends apart.
"""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from pytest import approx

import fourbar
from fourbar.mjcf import Plane, write_mjcf
from fourbar.scene import find_signs
from fourbar_validation.engines.free_body_closure import close
from fourbar_validation.engines.mujoco.robots.loop_facts import (
    FORCE_QUANTITIES,
    RobotMeasurement,
)
from fourbar_validation.engines.mujoco.robots.measure import POSITIONS_OF_A_LOOP
from fourbar_validation.places import MODELS
from fourbar_validation.robots.files import read_robot
from fourbar_validation.robots.loop_errors import (
    MEASURED_THROUGH_TIME,
    RIGID,
    STATES,
    find_left_out,
    find_worst_of_loop,
    list_errors_by_method,
    list_without_value,
)
from fourbar_validation.robots.report import describe_measurement
from tests.support.robots import (
    FINGER,
    FOOT_PARALLELOGRAM,
    Planar,
    draw_knee,
    forward,
    make_parallelogram,
    measure,
    read_scene,
    report_of,
)
from tests.support.scenes import mirrored, recommand, relink

ROBOTS = MODELS / "robots"
ROCKER = fourbar.load(MODELS / "crank_rocker.toml")
BARE = replace(ROCKER, loads=(), effects=())
XY, TILTED = Plane(), Plane((-2.0, 5.0, 1.0), (1.0, -2.0, 0.5))
SINGLE = """
<mujoco><compiler angle="degree"/><option gravity="0 -9.81 0"/><worldbody>
<body name="crank"><joint name="j2" axis="0 0 1"/>
 <inertial pos="0.025 0.0433 0" mass=".2" diaginertia="1e-4 1e-4 1e-4"/>
 <body name="coupler" pos="0.05 0.08660254037844387 0"><joint name="j3" axis="0 0 1"/>
  <inertial pos="0.0738 0.0674 0" mass=".5" diaginertia="2e-3 2e-3 2e-3"/>
  <site name="s3" pos="0.14766271094389716 0.13489152603740193 0"/></body></body>
<body name="rocker" pos="0.4 0 0"><joint name="j4" axis="0 0 1"/>
 <inertial pos="-0.1012 0.1107 0" mass=".4" diaginertia="2e-3 2e-3 2e-3"/>
 <site name="s4" pos="-0.20233728905610285 0.2214940664158458 0"/></body>
</worldbody><equality><connect name="pin" site1="s3" site2="s4"/></equality>
<actuator><motor joint="j2"/></actuator></mujoco>
"""
"""400, 100, 200 and 300 mm, with one change point at 180 deg."""
FILE = """
<mujoco><compiler angle="degree"/><option gravity="0 -9.81 0"/><worldbody>{}{}
</worldbody><equality>{}</equality><actuator><motor joint="j2"/></actuator></mujoco>
"""
CRANK = """
<body name="crank"><joint name="j2" axis="0 0 1"/>
 <inertial pos="0.025 0.04330127018922194 0" mass=".2" diaginertia="1e-4 1e-4 1e-4"/>
 <body name="coupler" pos="0.05 0.08660254037844387 0"><joint name="j3" axis="0 0 1"/>
  <inertial pos="0.106672493964356 0.065161177333012 0" mass=".5"
    diaginertia="2e-3 2e-3 2e-3"/>
  <site name="s3" pos="0.21334498792871323 0.130322354666025 0"/></body></body>
"""
ROCKER_BODY = """
<body name="rocker" pos="0.3 0 0"><joint name="j4" axis="0 0 1"/>
 <inertial pos="-0.018327506035643 0.108462447522234 0" mass=".4"
   diaginertia="2e-3 2e-3 2e-3"/>{}</body>
"""
HALF = """
<body name="half" pos="-0.03665501207128674 0.21692489504446885 0" euler="0 0 40">
 <joint name="pin" axis="0 0 1"/>
 <inertial pos="0 0 0" mass=".01" diaginertia="1e-5 1e-5 1e-5"/>
 <body name="end" euler="90 0 0"/></body>
"""
"""Half of the coupler on the rocker's end, whose welded part has axes of its own."""


def apart_along_the_axes(offset):
    site = f'<site name="s4" pos="-0.03665501207128674 0.21692489504446885 {offset}"/>'
    pin = '<connect name="pin" site1="s3" site2="s4"/>'
    return FILE.format(CRANK, ROCKER_BODY.format(site), pin)


TORQUES = {0.0: 0.13648498112812546, 111.0: -0.5759040624467816}
"""N m at positions of j2, deg, at 1 rad/s: Newton's steps on the gap in the plane, its
second derivative by differences, and multipliers by least squares.
"""
SAME = 1e-9
"""Relative; the differences of the derivation have some ten digits."""
CHORD = 1e-3
"""rad; theta_3 between two positions that are 3 deg apart, by a chord."""
LEFT_OUT = 1e-8
"""Relative: scenes have twelve digits."""


def driven_by_a_motor(scene, plane=XY, pin="O2"):
    text = write_mjcf(scene, drive="motor", plane=plane)
    assert 'joint="O2"' in text
    return text.replace('joint="O2"', f'joint="{pin}"')


RIGHT = {
    "loads act, the motor does not": ("O2", driven_by_a_motor(ROCKER), ROCKER),
    "tilted": ("O2", driven_by_a_motor(ROCKER, TILTED), ROCKER),
    "from behind": ("O2", driven_by_a_motor(BARE), mirrored(BARE)),
    "driven elsewhere": ("O2", driven_by_a_motor(BARE, pin="O4"), BARE),
    "driven as in the file": ("O4", driven_by_a_motor(BARE, pin="O4")),
    **{
        f"from {start}": ("j2", SINGLE, None, {"j2": start})
        for start in ("0deg", "10deg", "-160deg", "200deg")
    },
    "drawn in line": ("motor", draw_knee(0)),
}
"""Driven joint, file, scene and pose."""


@pytest.mark.slow
@pytest.mark.parametrize("case", RIGHT)
def test_rigid_pins_are_the_formulas_of_the_scene(case):
    driven, *asked = RIGHT[case]
    loop = measure(*asked)
    assert find_left_out(loop) < LEFT_OUT
    assert loop.joint == driven


@pytest.mark.slow
def test_states_without_a_value_of_the_formulas_are_named_and_not_judged():
    """A spring that is at rest where the turn begins is wound from half of it on."""
    spring = fourbar.Torsion.at(O2=(2.0, 0.0, 0.1))
    wound = replace(BARE, effects=(spring,))
    loop = measure(driven_by_a_motor(wound), wound)
    assert find_left_out(loop) < LEFT_OUT
    half_and_beyond = [10.0 * step for step in range(18, 37)]
    assert np.degrees(list_without_value(loop)["wound"]) == approx(half_and_beyond)
    blocks = map(str, describe_measurement(RobotMeasurement((loop,), ())))
    assert any("at 19 of 37 states (O2 = 180 to 360 deg" in text for text in blocks)


@pytest.mark.slow
def test_a_hinge_that_turns_fully_is_measured_in_any_range():
    span = (-7.0, -5.5)
    loop = measure(driven_by_a_motor(ROCKER), ROCKER, span=span)
    joints = [row.joint for row in loop.states.rows]
    assert (min(joints), max(joints)) == approx(span, abs=1e-9)
    assert find_left_out(loop) < LEFT_OUT


@pytest.mark.slow
def test_what_a_scene_does_not_have_is_left_out():
    without = replace(ROCKER, loads=ROCKER.loads[:1])
    assert find_left_out(measure(driven_by_a_motor(ROCKER), without)) > 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("name", ["dip_loop", "pip_link-middle"])
def test_the_loop_of_a_scene_is_found_by_its_lengths(name):
    scene = read_scene(FINGER, name, None).scene
    loop = measure(FINGER, scene)
    assert loop.name == name
    assert find_left_out(loop) < 1e-7


@pytest.mark.slow
def test_axes_sides_and_twins_have_the_same_errors():
    """Axes are turned by 0.3 rad in the plane, or seen from behind; fingers are alike.

    No weight acts across the plane.
    """
    foot = read_robot(ROBOTS / "biped_foot.xml")
    made = measure(foot, loop="rod")
    gravity, *others = made.scene.effects
    moved = recommand(made.scene, angle=angles_of(made) + 0.3)
    turned = replace(
        relink(moved, ground_angle=moved.linkage.ground_angle + 0.3),
        effects=(replace(gravity, angle=gravity.angle + 0.3), *others),
    )
    gripper = read_robot(ROBOTS / "gripper.xml")
    arm = driven_by_a_motor(BARE)
    for one, other, same in (
        (made, measure(foot, turned, loop="rod"), 1e-6),
        (measure(arm, BARE), measure(arm, mirrored(BARE)), 1e-3),
        (
            measure(gripper, loop="right_finger-right_follower"),
            measure(gripper, loop="left_finger-left_follower"),
            1e-3,
        ),
    ):
        worst = find_worst_of_loop(one)
        assert find_worst_of_loop(other) == approx(worst, rel=same)


def angles_of(loop):
    return loop.states.rows.angle


HALVES = Planar(
    pins={"O2": (0.0, 0.0), "A": (0.3, 0.0), "B": (0.3, 0.5), "O4": (0.0, 0.5)},
    by="weld",
)
"""A parallelogram whose coupler is two halves."""


def errors_of(loop, quantity="torque"):
    """Return the errors of one quantity by method."""
    errors = list_errors_by_method(loop)
    return {error.method: error for error in errors if error.quantity == quantity}


LEG = """
<mujoco><option integrator="implicitfast"/>
<default><geom type="capsule" size="0.003" contype="0" conaffinity="0"/>
 <joint axis="0 1 0"/></default>
<worldbody><body><freejoint/><geom type="sphere" size="0.1" mass="0.6"/>
 <body><joint name="crank"/><geom fromto="0 0 0 0.005 0 0" mass="0.003"/>
  <body pos="0.005 0 0"><joint/><geom fromto="0 0 0 0.02 0 -0.02" mass="0.01"/>
   <site name="one" pos="0.02 0 -0.02"/></body></body>
 <body pos="0.02 0 0"><joint/><geom fromto="0 0 0 0.005 0 -0.023" mass="0.003"/>
  <site name="two" pos="0.005 0 -0.023"/></body>
</body></worldbody>
<equality><connect site1="one" site2="two" solimp="0.9999 0.9999"/></equality></mujoco>
"""
"""A light leg on a body that floats."""


def test_what_holds_the_body_of_a_robot_does_not_stop_the_solver_early():
    """The solver's tolerance is a part of the mean inertia, which armature raises."""
    exact = LEG.replace("<option", '<option tolerance="0"')
    gaps = [measure(one).through_time.rows.gap.max() for one in (LEG, exact)]
    assert gaps[0] == approx(gaps[1], rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    "file",
    [
        pytest.param(make_parallelogram(0.4, 0.4, "0 0 0"), id="no torque"),
        pytest.param(make_parallelogram(0.4, 0.4, "0 0 -9.81"), id="rhombus"),
        pytest.param(make_parallelogram(0.5, 0.4, "0 0 -9.81"), id="rectangle"),
        pytest.param(HALVES.text(), id="welded"),
    ],
)
def test_a_full_turn_of_a_parallelogram_is_measured_but_for_its_change_points(file):
    """The loop stays a parallelogram past the positions in line."""
    loop = measure(file)
    assert len(loop.states.in_line) == 2
    across = [math.cos(joint) for joint in loop.states.in_line]
    assert across == approx([0.0, 0.0], abs=1e-6)
    assert len(loop.states.rows) == POSITIONS_OF_A_LOOP - 2
    assert find_left_out(loop) < LEFT_OUT
    errors = list_errors_by_method(loop)
    assert len(errors) == 3 * len(FORCE_QUANTITIES)
    assert all(math.isfinite(error.part) for error in errors)


@pytest.mark.slow
def test_a_torque_that_vanishes_is_judged_on_the_pin_forces_times_a_bar():
    """A parallelogram of equal cranks that turns uniformly needs no torque."""
    loop = measure(make_parallelogram(0.5, 0.4, "0 0 0"))
    # mass of the capsule times the centripetal acceleration of A, and of half the crank
    rod = 1000.0 * math.pi * 0.02**2
    crank, coupler = (rod * (length + 4.0 / 3.0 * 0.02) for length in (0.4, 0.5))
    speed = loop.states.rows[0].speed
    largest = (0.5 * coupler + 0.5 * crank) * 0.4 * speed**2
    for torque in errors_of(loop).values():
        assert torque.vanishes
        assert torque.scale == approx(largest * 0.5, rel=1e-6)
        assert torque.part == torque.error / torque.scale


@pytest.mark.slow
def test_a_torque_beside_a_change_point_is_judged_by_itself():
    """Viscous couples of 0.5 N m at O2 and O4, and the weights on level cranks."""
    largest = 2.0 * 0.5 + 9.81 * (0.016 * 0.03 + 0.014 * 0.06 + 0.27 * 0.03)
    torques = errors_of(measure(FOOT_PARALLELOGRAM)).values()
    assert len(torques) == 3
    for torque in torques:
        assert not torque.vanishes
        assert torque.scale == approx(largest, rel=1e-3)


@pytest.mark.slow
def test_what_the_scene_leaves_out_is_no_error_of_mujoco():
    """An armature I between bars 2 and 3 takes I (a3 - a2)(w3 - w2)/w2 of the motor."""
    text = driven_by_a_motor(BARE)
    changed = text.replace('joint name="A"', 'joint name="A" armature="0.01"')
    assert changed != text
    loop = measure(changed, BARE)
    errors = errors_of(loop)
    s = fourbar.solve(recommand(BARE, angle=angles_of(loop)))
    taken = 0.01 * (s.alpha_3 - s.alpha_2) * (s.omega_3 - s.omega_2) / s.omega_2
    assert errors[RIGID].error == approx(np.abs(taken).max(), rel=1e-8)
    soft = [row.soft.torque - row.rigid.torque for row in loop.states.rows]
    assert errors[STATES].error == np.abs(soft).max()
    # the closure of a generated file is nearly rigid, with the armature or without
    for part in (
        find_worst_of_loop(measure(text, BARE)),
        errors[STATES].part,
        errors[MEASURED_THROUGH_TIME].part,
    ):
        assert part < 0.1 * errors[RIGID].part


def test_a_tie_between_bars_is_switched_off_whatever_makes_it():
    """The errors are those without it: it holds another linkage than the closure."""
    tendon = (
        '<tendon><fixed name="tie"><joint joint="j2" coef="1"/>'
        '<joint joint="j4" coef="-.5"/></fixed></tendon>'
    )
    free = SINGLE.replace("</mujoco>", f"{tendon}</mujoco>")
    tied = '<tendon tendon1="tie"/></equality>'
    loops = [measure(free), measure(free.replace("</equality>", tied))]
    assert [loop.switched_off for loop in loops] == [(), ("tie",)]
    one, other = (loop.states.errors() for loop in loops)
    np.testing.assert_array_equal(one, other)


def test_dry_friction_along_a_tendon_is_that_of_its_hinge():
    """A tendon over one hinge, twice its angle, rubs with twice its couple there."""
    joint = SINGLE.replace('"j4"', '"j4" frictionloss=".02"')
    tendon = (
        '<tendon><fixed frictionloss=".01"><joint joint="j4" coef="2"/></fixed>'
        "</tendon></mujoco>"
    )
    one, other = (
        measure(text, speed=2.0).states.rows.rigid
        for text in (joint, SINGLE.replace("</mujoco>", tendon))
    )
    for name in FORCE_QUANTITIES:
        np.testing.assert_allclose(one[name], other[name], rtol=1e-9)


def test_a_couple_is_found_where_nothing_accelerates():
    """At rest without weights no acceleration tells how large a trial is to be."""
    loop = measure(make_parallelogram(0.5, 0.4, "0 0 0"), speed=0.0)
    assert len(loop.states.rows) == POSITIONS_OF_A_LOOP - 2
    assert all(abs(row.soft.torque) < 1e-9 for row in loop.states.rows)


@cache
def past_a_change_point(speed):
    return measure(SINGLE, joints={"j2": "10deg"}, speed=speed)


def test_what_a_second_solver_of_dry_friction_solves_is_said():
    plain = make_parallelogram(0.5, 0.4, "0 0 0").text
    twice = plain.replace("<worldbody>", '<option noslip_iterations="5"/><worldbody>')
    with_it, without = (measure(text) for text in (twice, plain))
    (remark,) = (text for text in with_it.remarks if "noslip" in text)
    assert "mj_forward with the file's 5 noslip_iterations" in remark
    assert not any("noslip" in text for text in without.remarks)


def test_a_spring_is_wound_by_whole_turns_of_its_hinge():
    """The coupler, beside -x, turns back once against the crank in a turn of it."""
    turn = np.exp(1.4j)
    turned = {pin: turn * complex(-x, y) for pin, (x, y) in Planar().pins.items()}
    pins = {pin: (place.real, place.imag) for pin, place in turned.items()}
    loop = measure(Planar(pins, base="", joint='stiffness="0.1"').text())
    assert np.ptp([row.bars.theta_3 for row in loop.states.rows]) > math.pi
    assert np.ptp([row.joint for row in loop.states.rows]) == approx(math.tau)
    assert find_left_out(loop) < 1e-8


@pytest.mark.slow
def test_a_state_after_a_turn_is_that_of_the_same_motion():
    """Beyond its change point the other assembly has the branch of the scene."""
    loop = past_a_change_point(1.0)
    theta_2 = angles_of(loop)
    assert np.ptp(theta_2) == approx(math.tau)
    linkage = loop.scene.linkage
    signs = find_signs(linkage, theta_2, loop.scene.motion.branch)
    theta_4 = np.unwrap(close(linkage, theta_2, signs).theta[1])
    assert abs(theta_4[-1] - theta_4[0]) > 0.1


@pytest.mark.slow
def test_going_over_to_the_other_assembly_is_said_and_is_in_no_percentage():
    loop = past_a_change_point(-1.0)
    through = loop.through_time
    assert through.other_assembly is not None
    beyond = math.degrees(through.other_assembly)
    assert beyond < 120.0 < math.degrees(min(row.joint for row in through.rows)) + 5.0
    assert errors_of(loop)[MEASURED_THROUGH_TIME].part < 0.5
    blocks = map(str, describe_measurement(RobotMeasurement((loop,), ())))
    (said,) = (text for text in blocks if "goes over to the other assembly" in text)
    assert said.startswith("through time coupler and output come into line, and")
    assert "seen at j2 = " in said


@pytest.mark.slow
@pytest.mark.parametrize("offset", [0.0, 1e-5, 1e-3])
def test_an_offset_along_the_axes_changes_nothing_in_the_plane(offset):
    loop = measure(apart_along_the_axes(offset), speed=1.0)
    torques = {round(np.degrees(row.joint), 6): row.rigid for row in loop.states.rows}
    for joint, torque in TORQUES.items():
        assert torques[joint].torque == approx(torque, rel=SAME)
    assert len(loop.states.rows) == POSITIONS_OF_A_LOOP
    assert not loop.through_time.lost
    assert max(row.gap for row in loop.states.rows) < 1e-12


@pytest.mark.parametrize("offset", [0.0, 1e-5, 1e-3])
def test_an_offset_is_named_with_the_force_that_mujoco_has_there(offset):
    text = apart_along_the_axes(offset)
    report = report_of(text)
    (closure,) = report.closures
    assert not report.notes
    assert "gap 0 mm" in closure.text
    _, data = forward(text)
    x, y, z = data.efc_force
    said = " ".join(closure.loop.remarks)
    for words in (
        f"{1e3 * offset:#.4g}".rstrip(".") + " mm apart along the axes",
        f"{abs(z):.4g} N across the plane",
        f"{np.hypot(x, y):.4g} N in it",
    ):
        assert (words in said) == bool(offset)


def test_the_force_of_an_offset_is_that_without_dry_friction():
    text = apart_along_the_axes(1e-3)
    rubbing = text.replace("<joint ", '<joint frictionloss="0.5" ')
    assert rubbing != text
    one, other = map(report_of, (text, rubbing))
    assert one.closures[0].loop.remarks == other.closures[0].loop.remarks


@pytest.mark.slow
def test_a_weld_holds_the_turn_whatever_the_axes_of_its_bodies():
    """Both halves of the coupler turn alike: no motion of the loop parts them.

    The rocker comes first: its half of the coupler tells theta_3.
    """
    weld = '<weld name="pin" body1="coupler" body2="end"/>'
    loop = measure(FILE.format(ROCKER_BODY.format(HALF), CRANK, weld), speed=1.0)
    formulas = fourbar.solve(loop.scene, "position")
    theta_3 = np.interp(angles_of(loop), formulas.theta_2, formulas.theta_3)
    found = loop.states.rows.bars.theta_3
    assert np.abs(np.sin(found - theta_3)).max() < CHORD
