"""Poses of robots.

The file's own, stated ones, and the loops closed again around them.
"""

import math
import re

import mujoco
import numpy as np
import pytest
from pytest import approx, raises

from fourbar.errors import InputError
from fourbar.linkage import require
from fourbar_validation.engines.mujoco.robots.loop_facts import PoseOptions
from fourbar_validation.engines.mujoco.robots.pose import pose_robot
from tests.support.robots import FOOT, file_of
from tests.support.rows import slow_but


def pose(text, key=None, **joints):
    """Pose a robot as stated."""
    return pose_robot(file_of(text), PoseOptions(joints=joints, key=key))


def position(posed, name):
    return posed.data.joint(name).qpos[0]


def gap(model, qpos):
    """Distance of the two sites of the first equality, m."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    one, two = (data.site_xpos[i[0]] for i in (model.eq_obj1id, model.eq_obj2id))
    return float(np.linalg.norm(one - two))


CLAMP = """
<mujoco><compiler angle="radian"/><worldbody>
  <body><joint name="handle" range="-1.16 2.12"/><geom size=".01"/>
    <body pos=".1 0 0"><joint range="-3.05 3.05"/><geom size=".01"/>
      <site name="coupler" pos=".2 0 0"/></body></body>
  <body pos=".18 0 0"><joint range="-2.72 .35"/><geom size=".01"/>
    <site name="rocker" pos=".14 0 0"/></body></worldbody>
  <equality><connect site1="coupler" site2="rocker"/></equality></mujoco>"""
"""A toggle clamp whose ranges hold one of its two assemblies; all joints at zero it is
stretched.
"""

STRETCHED = """
<mujoco><worldbody><site name="base"/>
  <body pos="0 0 .2"><joint name="crank" axis="0 1 0"/><geom size=".01"/>
    <body pos="0 0 .18"><joint axis="0 1 0"/><geom size=".01"/>
      <body pos="0 0 .36"><joint axis="0 1 0"/><geom size=".01"/>
        <site name="end" pos="0 0 .26"/></body></body></body></worldbody>
  <equality><connect site1="end" site2="base"/></equality></mujoco>"""
"""Bars in one line, on hinges that turn without limits."""


GRAB = """
<mujoco><compiler angle="radian"/><worldbody>
  <body pos=".01354 .073145 0"><joint name="handle" range="0 1.57"/><geom size=".01"/>
    <body pos="-.005788 -.020186 0"><joint name="pin"/><geom size=".01"/>
      <site name="rod" pos=".050178 0 0"/></body></body>
  <body pos="-.013 0 0"><joint name="jaw" range="-1.6 .001"/><geom size=".01"/>
    <site name="shell" pos="-.024601 .031487 0"/></body></worldbody>
  <equality><connect site1="rod" site2="shell"/></equality></mujoco>"""
"""A grab whose rod, without a range, is drawn along x and not to its pin."""


@pytest.mark.parametrize(
    "text, joints",
    slow_but(
        [
            (CLAMP, {"handle": "1.62 rad"}),
            (STRETCHED, {}),
            (GRAB, {"handle": "70 deg"}),
        ],
        [
            (CLAMP, {}),
            (CLAMP, {"handle": "1.62 rad"}),
            (CLAMP, {"handle": "-20 deg"}),
            (STRETCHED, {}),
            (GRAB, {}),
            (GRAB, {"handle": "70 deg"}),
        ],
    ),
)
def test_the_loop_closes_in_the_assembly_that_the_ranges_hold(text, joints):
    posed = pose(text, **joints)
    model, qpos = posed.model, posed.data.qpos
    assert gap(model, qpos) < 1e-9
    low, high = model.jnt_range.T
    inside = (low <= qpos) & (qpos <= high)
    assert inside[model.jnt_limited != 0].all()
    if joints:
        assert qpos[0] == approx(require("handle", joints["handle"], "rad"))


TWO_CLAMPS = """
<mujoco><compiler angle="radian"/><worldbody>
  <body><joint name="handle" range="-1.16 2.12"/><geom size=".01"/>
    <body pos=".1 0 0"><joint range="-3.05 3.05"/><geom size=".01"/>
      <site name="coupler" pos=".2 0 0"/></body></body>
  <body pos=".18 0 0"><joint range="-2.72 .35"/><geom size=".01"/>
    <site name="rocker" pos=".14 0 0"/></body>
  <body><joint name="grip" range="-1.16 2.12"/><geom size=".01"/>
    <body pos=".1 0 0"><joint range="-3.05 3.05"/><geom size=".01"/>
      <site name="hook" pos=".2 0 0"/></body></body>
  <body pos="{} 0 0"><joint range="-2.72 .35"/><geom size=".01"/>
    <site name="eye" pos=".14 0 0"/></body></worldbody>
  <equality><connect site1="coupler" site2="rocker"/><connect site1="hook" site2="eye"/>
  </equality></mujoco>"""
"""No one joint that starts elsewhere closes both."""
ROW = """
<mujoco><worldbody><body><joint name="a"/><geom size=".1"/></body>
<body><joint name="b"/><geom size=".1"/></body>
<body><joint name="c"/><geom size=".1"/></body>
<body><joint name="d"/><geom size=".1"/></body></worldbody>
<equality><joint joint1="b" joint2="a" polycoef=".1 1 0 0 0"/>
<joint joint1="d" joint2="c" polycoef=".1 1 0 0 0"/>
<joint joint1="c" joint2="b" polycoef=".1 1 0 0 0"/></equality></mujoco>"""


@pytest.mark.parametrize(
    "place, told", [(".18", "the loops are closed again"), ("9", "no pose near this")]
)
def test_loops_without_common_joints_close_each_by_itself(place, told):
    posed = pose(TWO_CLAMPS.format(place))
    handle, grip = (position(posed, name) for name in ("handle", "grip"))
    assert posed.notes[0].startswith(told)
    assert handle == position(pose(CLAMP), "handle") != 0.0
    assert (handle == grip) == (place == ".18")


def test_equalities_that_share_a_joint_close_together():
    assert np.diff(pose(ROW).data.qpos) == approx(0.1, abs=1e-9)


@pytest.mark.slow
def test_a_loop_closes_beside_the_turns_that_its_pose_counts():
    key = f'<key name="turned" qpos="{8.0 * math.pi!r} 0 0"/>'
    text = STRETCHED.replace("</mujoco>", f"<keyframe>{key}</keyframe></mujoco>")
    posed = pose(text, "turned")
    assert posed.data.qpos[0] == approx(8.0 * math.pi, abs=2.0)


def test_a_stated_joint_stays_and_the_loop_closes_around_it():
    joints = {"crank": "20deg", "knee": "60 deg"}
    posed = pose(FOOT, **joints)
    model = posed.model
    at = [position(posed, name) for name in joints]
    assert np.degrees(at) == approx((20.0, 60.0))
    assert gap(model, posed.stated) > 0.01
    assert gap(model, posed.data.qpos) < 1e-9
    low, high = model.joint("ankle").range
    assert low <= position(posed, "ankle") <= high
    still = [*range(7), *(model.joint(n).qposadr[0] for n in ("hip_roll", "toe"))]
    assert np.array_equal(posed.data.qpos[still], model.qpos0[still])
    assert any(re.search(r"rod by \S+ deg, ankle by", note) for note in posed.notes)


def test_a_rest_pose_outside_the_ranges_is_closed_inside_them():
    text = FOOT.replace('range="-70 60"', 'range="15 60"')
    posed = pose(text)
    assert math.radians(15.0) - 1e-9 <= position(posed, "crank") <= math.radians(60.0)
    assert gap(posed.model, posed.data.qpos) < 1e-9
    assert posed.notes[0] == "outside their ranges before closing: crank"
    stated = pose(text, crank="14 deg")
    assert stated.notes[0] == "outside their ranges before closing: crank"


@pytest.mark.slow
def test_closing_does_not_leave_the_range_of_a_joint():
    end = 0.5 * math.degrees(position(pose(FOOT, crank="20deg"), "ankle"))
    assert 0.0 < end < 20.0
    posed = pose(FOOT.replace('range="-50 40"', f'range="-50 {end}"'), crank="20deg")
    assert math.degrees(position(posed, "ankle")) == approx(end)
    said = "cannot close all loops within the joints' ranges"
    assert any(said in note for note in posed.notes)


def test_a_keyframe_is_a_pose():
    posed = pose(FOOT, "crouch")
    assert posed.data.qpos[2] == 0.82
    assert position(posed, "knee") == 1.0
    same = pose(FOOT, "0")
    assert np.array_equal(same.data.qpos, posed.data.qpos)
    with raises(InputError, match="no such keyframe; the file has: crouch"):
        pose(FOOT, "jump")


@pytest.mark.slow
def test_a_pose_that_cannot_close_says_what_is_left():
    posed = pose(FOOT.replace('pos="0.001 -0.316 0"', 'pos="0 -0.6 0"'))
    assert any("no pose near this one closes all loops" in note for note in posed.notes)


@pytest.mark.parametrize(
    "joints, words",
    [
        ({"crank": "20"}, 'the unit is missing; .* like "1 rad"'),
        ({"crank": "20 mm"}, "crank"),
        ({"wheel": "20deg"}, "no such joint"),
    ],
)
def test_what_is_no_position_is_refused(joints, words):
    with raises(InputError, match=words):
        pose(FOOT, **joints)


BOOM = """
<mujoco><worldbody>
<body name="boom"><joint name="boom" axis="0 -1 0"/>
 <inertial pos=".5 0 0" mass="10" diaginertia="1 1 1"/><site name="eye" pos=".4 0 .1"/>
</body>
<body name="tube" pos="0 0 -.3"><joint name="tilt" axis="0 -1 0"/>
 <inertial pos="0 0 .1" mass="1" diaginertia="1e-2 1e-2 1e-2"/>
 <body name="rod" pos=".2 0 .2"><joint name="stroke" type="slide" axis="1 0 1"/>
  <inertial pos="0 0 0" mass="1" diaginertia="1e-3 1e-3 1e-3"/>
  <site name="rod" pos=".2 0 .15"/></body></body>
</worldbody><equality><connect name="cylinder" site1="rod" site2="eye"/></equality>
{actuator}</mujoco>
"""
"""The rod's end is at (0.4, 0.35) m from the tube's hinge, the eye at (0.4, 0.4)."""


def test_what_a_motor_holds_stays_where_the_passive_joints_close_the_loop():
    held = '<actuator><motor joint="boom"/></actuator>'
    posed = pose(BOOM.format(actuator=held))
    boom, tilt, stroke = posed.data.qpos
    # the stroke is along (1, 1)/sqrt(2) of the tube: the distance of the eye decides it
    reach = np.array([0.4, 0.35]) + stroke * np.sqrt([0.5, 0.5])
    assert boom == 0.0
    assert np.hypot(*reach) == approx(math.hypot(0.4, 0.4), abs=1e-8)
    away = math.atan2(0.4, 0.4) - math.atan2(reach[1], reach[0])
    assert tilt == approx(away, abs=1e-8)
    (note,) = posed.notes
    assert f"tilt by {math.degrees(tilt):.4g} deg, stroke by {1e3 * stroke:.4g} mm" in (
        note
    )
    free = pose(BOOM.format(actuator=""))
    assert "boom by" in free.notes[0]


def test_motors_make_up_for_the_rounding_of_a_file():
    """The stroke alone brings the rod's end to 0.7 um from the eye."""
    held = '<actuator><motor joint="boom"/><motor joint="tilt"/></actuator>'
    text = BOOM.format(actuator=held).replace('pos=".4 0 .1"', 'pos=".450001 0 .1"')
    posed = pose(text)
    assert gap(posed.model, posed.data.qpos) < 1e-9
    assert np.abs(posed.data.qpos[:2]).max() < 1e-5


def test_a_stated_joint_with_ranges_beside_it_is_the_reason_too():
    (note,) = pose(GRAB, pin="-150 deg").notes
    assert note.startswith(
        "--pose holds pin, around which the other joints cannot close all loops within"
        " the joints' ranges; what is left is 3."
    )


def test_zero_needs_no_unit():
    assert position(pose(FOOT, crank="0"), "crank") == 0.0


def test_a_floating_body_that_is_tied_to_the_ground_moves_there():
    """A metre along x and a turn of 30 deg about z, by half angles."""
    posed = pose(
        """<mujoco><worldbody><body name="part"><freejoint name="free"/>
        <geom size="0.1"/></body></worldbody><equality><weld body1="part"
        relpose="-1 0 0 0.9659258262890683 0 0 0.25881904510252074"/></equality>
        </mujoco>"""
    )
    assert posed.notes == (
        "the loops are closed again by least squares: free by 1000 mm and 30 deg",
    )
    turned = [math.cos(math.radians(15.0)), 0.0, 0.0, -math.sin(math.radians(15.0))]
    assert posed.data.qpos[3:] == approx(turned, abs=1e-9)
