"""A scene from a loop: what acts in it, how far it moves, and what it leaves out.

`test_inside.py` holds its torque and pin forces against MuJoCo in the whole robot.
"""

import cmath
import math
import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from pytest import approx, raises

import fourbar
from fourbar.scene.motion import OPEN
from tests.support.robots import (
    FOOT,
    GRIPPER,
    Planar,
    draw_knee,
    forward,
    read_scene,
)
from tests.support.rows import read_rows
from tests.support.scenes import find_angle, meet_circles


def test_a_motor_counts_behind_its_gear():
    motor = '<motor name="motor" joint="O2" gear="10" armature="1e-4" damping="2e-3"/>'
    plain = '<motor name="motor" joint="O2"/>'
    text = Planar().text().replace(plain, motor)
    if not hasattr(mujoco.MjModel, "actuator_armature"):
        pytest.skip("this MuJoCo has no armature of motors")
    effects = {effect.key: effect for effect in read_scene(text).scene.effects}
    assert effects["flywheel"].inertia == approx(0.01)
    assert effects["viscous"].coefficients == (("O2", approx(0.2)),)


def test_armature_between_moving_bars_is_named_with_its_size():
    text = Planar().text().replace('name="A" axis', 'name="A" armature="0.125" axis')
    remarks = read_scene(text).remarks
    assert any("armature 0.125 kg m^2 of A" in remark for remark in remarks)


@pytest.mark.parametrize(
    "tendon, actuator, named",
    read_rows("""
armature="0.02" |  | the tendon T (armature 0.02)
stiffness="3" damping="0 1 2" |  | the tendon T (stiffness 3, damping 0 1 2)
 | <general name="pull" tendon="T" biastype="affine" biasprm="5 0 0" gainprm="0"/> | \
the actuator pull
 | <motor name="pull" tendon="T"/> |
"""),
)
def test_what_acts_along_a_tendon_is_named(tendon, actuator, named):
    over = '<joint joint="O2" coef="1"/><joint joint="O4" coef="-1"/>'
    acting = (
        f'<tendon><fixed name="T" {tendon}>{over}</fixed></tendon>'
        f"<actuator>{actuator}</actuator>"
    )
    if "damping" in tendon and not hasattr(mujoco.MjModel, "tendon_dampingpoly"):
        pytest.skip("this MuJoCo has no polynomials of tendons")
    remarks = read_scene(Planar(more=acting).text()).remarks
    expected = [f"not in the scene: {named}"] if named else []
    left_out = [one for one in remarks if "not in the scene: the" in one]
    assert left_out == expected


def test_forces_across_the_plane_are_named_with_their_sizes():
    made = read_scene(FOOT)
    (remark,) = [r for r in made.remarks if "across the plane" in r]
    model, data = forward(FOOT)
    pull = abs(data.xaxis[model.joint("crank").id] @ model.opt.gravity)
    assert f"input {0.15 * pull:.4g} N" in remark
    assert f"output {0.53 * pull:.4g} N" in remark


def find_width(made):
    """Return the angle over which the input of a scene turns, rad."""
    sweep = made.scene.motion.angle
    return sweep.stop - sweep.start


@pytest.mark.parametrize("pin, end", [("A", 0.2), ("O4", 0.15)])
def test_the_range_ends_where_another_hinge_meets_its_stop(pin, end):
    """The hinge's angle at the end of the range, by two circles, is the stop."""
    planar = Planar()
    hinge = f'name="{pin}" axis="0 0 1" '
    stop = f'{hinge}limited="true" range="-2 {end}" '
    made = read_scene(planar.text().replace(hinge, stop)).scene
    _, a, b, c = planar.lengths()
    crank, end_of_rocker, ground = (
        complex(*planar.pins[name]) for name in ("A", "B", "O4")
    )
    reached = []
    for theta_2 in (made.motion.angle.start, made.motion.angle.stop):
        turned = theta_2 - made.linkage.ground_angle + cmath.phase(ground)
        tip = cmath.rect(a, turned)
        there = meet_circles(tip, ground, b, c)
        turns = {
            "A": (there - tip) / (end_of_rocker - crank) * crank / tip,
            "O4": (there - ground) / (end_of_rocker - ground),
        }
        reached.append(cmath.phase(turns[pin]))
    assert min(abs(one - end) for one in reached) < 1e-9


def test_without_a_range_it_goes_as_far_as_the_loop_assembles():
    planar = Planar()
    d, a, b, c = planar.lengths()
    # the input turns fully, for it and the longest bar are shorter than the other two
    assert a + d < b + c
    assert find_width(read_scene(planar.text())) == approx(math.tau)
    rocker = replace(planar, pins={**planar.pins, "A": (0.12, 0.2)})
    d, a, b, c = rocker.lengths()
    assert a + d > b + c
    # it stops where coupler and output are in one line
    most = find_angle(b + c, a, d)
    width = find_width(read_scene(rocker.text()))
    assert width == approx(2.0 * most - 2.0 * math.radians(1.0))
    drawn = cmath.phase(complex(0.12, 0.2) / complex(0.3, 0.02))
    least, most = (math.degrees(end - drawn) for end in (-width / 2.0, width / 2.0))
    with raises(fourbar.InputError, match=f"O2 from {least:.6g} to {most:.6g} deg"):
        read_scene(rocker.text(), joints={"O2": "100 deg"})


@pytest.mark.parametrize(
    "pin, limits",
    read_rows("""
O2 | -200 200
O2 | 0 400
O2 | -720 720
A | -100 100
A | -181 181
A | -200 200
O4 | -20 20
"""),
)
def test_the_range_goes_both_ways_from_the_pose_but_for_at_most_a_turn(pin, limits):
    planar = Planar()
    p = {name: complex(*place) for name, place in planar.pins.items()}
    turned = np.linspace(-math.tau, math.tau, 20001)
    at = p["A"] * np.exp(1j * turned)
    _, _, b, c = planar.lengths()
    B = meet_circles(at, p["O4"], b, c)
    lines = {"A": (B - at) / np.exp(1j * turned), "O4": B - p["O4"]}
    hinge = np.unwrap(np.angle(lines[pin])) if pin in lines else turned
    hinge = hinge - hinge[len(turned) // 2]
    low, high = np.radians([*map(float, limits.split())]).tolist()
    outside = turned[(hinge < low) | (hinge > high)]
    first = max([-math.tau, *outside[outside < 0.0]])
    last = min([math.tau, *outside[outside > 0.0]])
    start = max(first, min(0.0, last - math.tau))

    ranged = f'name="{pin}" range="{low} {high}"'
    text = planar.text().replace(f'name="{pin}"', ranged, 1)
    made = read_scene(text)
    grid = math.radians(0.51)
    width = min(last - start, math.tau)
    assert width - 2.0 * grid <= find_width(made) <= width + 1e-9
    if last - first > math.tau:
        assert find_width(made) == approx(math.tau, rel=1e-12)
    drawn = np.angle(p["A"]) - np.angle(p["O4"]) + made.scene.linkage.ground_angle
    away = made.scene.motion.angle.start - drawn - start
    assert abs(math.remainder(away, math.tau)) <= grid


REVERSED = """
<mujoco><compiler angle="degree"/><worldbody>
  <body name="crank" euler="0 0 60">
    <joint name="a" axis="0 0 -1" ref="30"/>
    <geom size=".01" pos=".05 0 0" mass=".2"/>
    <body name="coupler" pos=".1 0 0" euler="0 0 -28.58121702903738"><joint name="b"/>
      <geom size=".01" pos=".12 0 0" mass=".5"/></body>
  </body>
  <body name="rocker" pos=".3 0 0" euler="0 0 99.59098992"><joint name="c"/>
    <geom size=".01" pos=".11 0 0" mass=".4"/></body>
</worldbody><equality>
  <connect name="B" body1="rocker" body2="coupler" anchor=".22 0 0"/>
</equality></mujoco>
"""
"""A crank from the origin, at 60 deg in the x-y plane where its joint stands at 30 deg.
The joint turns it clockwise.
"""
FLOATING = """
<mujoco><worldbody><body name="pelvis" pos="0 0 1"><freejoint/>
  <geom size=".1" mass="8"/>
  <body name="crank"><joint name="j" axis="0 1 0"/>
    <geom size=".01" pos=".02 0 0" mass=".1"/>
    <body name="rod" pos=".05 0 0"><joint axis="0 1 0"/>
      <geom size=".01" pos="0 0 -.1" mass=".1"/></body>
  </body>
  <body name="shin" pos="-.04 0 -.25"><joint axis="0 1 0"/>
    <geom size=".01" pos="0 0 -.1" mass=".5"/></body>
</body></worldbody><equality>
  <connect name="w" body1="rod" body2="shin" anchor=".02 0 -.25"/>
</equality></mujoco>
"""
"""A crank along x where its joint stands at 0; about y it turns from x to -z."""
RELATION = (
    r"Angles: theta_2 = (-?)\S+(?: ([+-]) ([\d.]+) deg)?. Axes: x is (-?)([xyz])"
    r" of the world, y is (-?)([xyz])(?: in this pose)?\."
)


@pytest.mark.parametrize(
    "text, joint, crank",
    [
        (REVERSED, 30.0, (math.cos(math.pi / 3.0), math.sin(math.pi / 3.0), 0.0)),
        (REVERSED, 120.0, (math.sin(math.pi / 3.0), -math.cos(math.pi / 3.0), 0.0)),
        (FLOATING, 0.0, (1.0, 0.0, 0.0)),
        (FLOATING, 90.0, (0.0, 0.0, -1.0)),
        (FLOATING.replace("0 1 0", "0 -1 0"), 90.0, (0.0, 0.0, 1.0)),
    ],
)
def test_the_relation_of_joint_and_angle_is_that_of_the_world(text, joint, crank):
    made = read_scene(text)
    said = re.fullmatch(RELATION, made.parts[-1])
    sign, plus, constant, *axes = said.groups()
    theta_2 = float(f"{plus or ''}{constant or 0}") + float(f"{sign}1") * joint
    x, y = (
        float(f"{minus}1") * crank["xyz".index(name)]
        for minus, name in (axes[:2], axes[2:])
    )
    apart = theta_2 - math.degrees(math.atan2(y, x))
    assert math.remainder(apart, 360.0) == approx(0.0, abs=1e-9)
    sweep = made.scene.motion.angle
    assert sweep.start - 1e-9 <= math.radians(theta_2) <= sweep.stop + 1e-9


def test_gravcomp_away_from_the_mass_centre_is_a_load_where_it_acts():
    text = FOOT.replace('<body name="toe"', '<body name="toe" gravcomp="1"')
    made = read_scene(text)
    (load,) = made.scene.loads
    assert load.bar == 4
    # the toe's mass centre from the ankle: 150, -50 mm; the foot's line ends at the rod
    toe, rod = complex(0.15, -0.05), complex(-0.064, -0.006)
    assert load.from_pin[0] == approx(abs(toe))
    turned = math.remainder(cmath.phase(toe / rod) - load.from_pin[1], math.tau)
    assert turned == approx(0.0, abs=1e-9)


def test_a_loop_is_asked_for_where_there_are_several():
    with raises(fourbar.InputError, match="right_finger-right_follower, left_finger"):
        read_scene(GRIPPER)


def test_a_pose_in_a_change_point_is_said():
    text = GRIPPER.replace('range="-40 40"', 'range="-100 100"')
    upright = {"right_driver": "90deg"}
    made = read_scene(text, loop="right_finger-right_follower", joints=upright)
    assert any("in line in this pose" in remark for remark in made.remarks)


@pytest.mark.parametrize("drawn", [0, 180])
def test_of_a_loop_that_is_drawn_in_line_the_open_assembly_is_taken(drawn):
    made = read_scene(draw_knee(drawn))
    assert made.scene.motion.branch == OPEN
    (said,) = (remark for remark in made.remarks if "in line" in remark)
    assert said.endswith("in this pose: open is taken; --pose states another")
