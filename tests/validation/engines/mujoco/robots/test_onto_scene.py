"""A loop is closed onto the assembly of its scene, or its pose is refused."""

import math
from dataclasses import replace

import pytest

import fourbar
from fourbar.errors import InputError
from fourbar.mjcf import write_mjcf
from fourbar.scene.motion import CROSSED, OPEN
from fourbar_validation.engines.mujoco.robots.onto_scene import find_loop_of_scene
from fourbar_validation.robots.files import read_robot
from fourbar_validation.robots.judge_loop import FILE_THROUGH_TIME
from fourbar_validation.robots.loop_errors import find_left_out, find_worst_of_loop
from fourbar_validation.robots.report import SCENE_ROUND_OFF
from tests.support.robots import (
    AS_DRAWN,
    answer_of,
    examine_text,
    file_of,
    measure,
    measure_all,
    notes_of,
    read_scene,
)

TEXT = """
<mujoco><option timestep="0.001" integrator="implicitfast" gravity="0 0 -9.81"/>
<default><joint axis="0 -1 0"/></default>
<worldbody>
<body name="crank"><joint name="j_crank"/>
 <inertial pos="0.075 0 0" mass="0.3" diaginertia="1e-6 5.625e-4 5.625e-4"/>
 <body name="rod" pos="0.15 0 0"><joint name="j_rod"/>
  <inertial pos="0.225 0 0" mass="0.9" diaginertia="1e-6 0.0151875 0.0151875"/>
  <site name="rodend" pos="0.45 0 0"/></body></body>
<body name="rocker" pos="0.5 0 0"><joint name="j_rocker"/>
 <inertial pos="0.175 0 0" mass="0.7" diaginertia="1e-6 7.14583333333e-3 7.1458e-3"/>
 <site name="rockerend" pos="0.35 0 0"/></body>
</worldbody>
<equality><connect name="close" site1="rodend" site2="rockerend"/></equality>
<actuator><velocity name="m" joint="j_crank" kv="50"/></actuator></mujoco>"""
"""Its rest pose is flat and open: nothing in it tells an assembly."""
OPEN_POSE = {"j_crank": "60deg", "j_rod": "-30deg", "j_rocker": "95deg"}
"""Whole degrees near the open assembly; 6 mm are left."""


NEAR_G = fourbar.Gravity(9.80665)
"""The gravity of a scene differs from the robot's 9.81 in its size alone."""


def read_advice(text):
    """Return the positions of joints that are to be typed after --pose."""
    typed = text.rpartition("--pose ")[2].partition(" ")[0]
    return dict(entry.split("=") for entry in typed.split(","))


def find_in_line(read):
    """Return the one remark of a loop or scene that is drawn in line."""
    (remark,) = [text for text in read.remarks if "in line" in text]
    return remark


def make_scene(branch, gravity=fourbar.Gravity()):  # noqa: B008
    linkage = fourbar.FourBar(
        0.5,
        fourbar.Bar(0.15, 0.3, 0.3 * 0.15**2 / 12.0, (0.075, 0.0)),
        fourbar.Bar(0.45, 0.9, 0.9 * 0.45**2 / 12.0, (0.225, 0.0)),
        fourbar.Bar(0.35, 0.7, 0.7 * 0.35**2 / 12.0, (0.175, 0.0)),
    )
    sign = {"open": OPEN, "crossed": CROSSED}[branch]
    motion = fourbar.Motion(fourbar.Sweep(0.0, math.tau, 36), 4.0, branch=sign)
    return fourbar.Scene(linkage, motion, effects=(gravity,))


@pytest.mark.slow
@pytest.mark.parametrize("branch", ["open", "crossed"])
def test_a_flat_rest_pose_is_closed_onto_the_assembly_of_the_scene(branch):
    scene = make_scene(branch)
    loop = measure(TEXT, scene)
    assert find_left_out(loop) < SCENE_ROUND_OFF
    assert find_worst_of_loop(loop) < 0.06
    assert f"onto the {branch} one of the scene" in find_in_line(loop)


@pytest.mark.parametrize("branch", ["open", "crossed"])
def test_a_pose_is_closed_onto_the_assembly_of_a_scene_of_other_lengths(branch):
    """The outputs are 0.01 rad apart, which is no other assembly."""
    scene = make_scene(branch)
    linkage = replace(scene.linkage, input=fourbar.Bar(0.152))
    scene = replace(scene, linkage=linkage)
    loop = find_loop_of_scene(file_of(TEXT), scene, AS_DRAWN).loop
    assert f"onto the {branch} one of the scene" in find_in_line(loop)


@pytest.mark.slow
@pytest.mark.parametrize("branch", ["open", "crossed"])
@pytest.mark.parametrize("axis", ["0 -1 0", "0 1 0"])
def test_gravity_tells_the_side_by_its_direction_alone(branch, axis):
    """The hinges turn the other way: the plane is seen from the other side."""
    loop = measure(TEXT.replace("0 -1 0", axis), make_scene(branch, NEAR_G))
    difference = 1.0 - 9.80665 / 9.81
    assert find_left_out(loop) < 2.0 * difference


def test_a_pose_of_the_other_assembly_is_refused_for_another_size_of_gravity():
    with pytest.raises(InputError, match="to the open assembly"):
        measure(TEXT, make_scene("crossed", NEAR_G), OPEN_POSE)


@pytest.mark.slow
def test_a_pose_of_the_other_assembly_is_refused_with_one_that_closes():
    scene = make_scene("crossed")
    with pytest.raises(InputError, match="to the open assembly") as refused:
        measure(TEXT, scene, OPEN_POSE)
    assert "the scene names the crossed one" in str(refused.value)
    advised = read_advice(str(refused.value))
    measured = measure_all(TEXT, scene, advised)
    assert find_left_out(measured.loops[0]) < 1e-6
    assert not [note for note in measured.notes if "what is left" in note]


def test_without_a_scene_it_is_said_what_a_flat_pose_closed_to():
    made = read_scene(TEXT)
    remark = find_in_line(made)
    assert "closed to the crossed one" in remark
    assert made.scene.motion.branch == CROSSED
    other = read_scene(TEXT, joints=read_advice(remark))
    assert other.scene.motion.branch == OPEN
    assert not [text for text in other.remarks if "in line" in text]
    # the rocker is at -100 deg there, in the other assembly at 100 deg
    limited = TEXT.replace('name="j_rocker"', 'name="j_rocker" range="-170 0"')
    remark = find_in_line(read_scene(limited))
    assert remark.endswith("closed to the crossed one")


def test_joints_that_are_held_are_the_reason_why_a_pose_stays_open():
    made = read_scene(TEXT, joints=OPEN_POSE)
    (note,) = [note for note in made.notes if "what is left is 6.24 mm" in note]
    assert "--pose holds j_crank, j_rod, j_rocker, around which" in note
    assert "ranges" not in note


@pytest.mark.slow
def test_what_is_not_judged_is_said_of_a_file_with_its_own_flywheel_too():
    scene = make_scene("open")
    examined = examine_text(scene, write_mjcf(scene))
    judged = len(answer_of(examined, FILE_THROUGH_TIME).quantities["torque"])
    positions = len(fourbar.command(scene).theta_2) - 1
    assert judged < positions
    (note,) = [note for note in notes_of(examined) if "are not judged" in note]
    assert f"({positions - judged} of {positions} positions" in note


TWO_LOOPS = """
<mujoco><asset><mesh name="m" file="m.stl"/></asset>
<default><geom type="capsule" size=".01"/><joint axis="0 1 0"/></default><worldbody>
<body><joint/><geom fromto="0 0 0 .1 0 0"/>
 <body pos=".1 0 0"><joint/><geom fromto="0 0 0 .25 0 .1"/>
  <site name="end" pos=".25 0 .1"/></body></body>
<body pos=".3 0 0"><joint/><geom fromto="0 0 0 .05 0 .1"/>
 <site name="top" pos=".05 0 .1"/></body>
<body name="bare" pos="0 .5 0"><joint/><geom type="mesh" mesh="m"/>
 <body pos=".1 0 0"><joint/><geom fromto="0 0 0 .25 0 .1"/>
  <site name="end 2" pos=".25 0 .1"/></body></body>
<body pos=".33 .5 0"><joint/><geom fromto="0 0 0 .05 0 .1"/>
 <site name="top 2" pos=".02 0 .1"/></body>
</worldbody><equality><connect name="whole" site1="end" site2="top"/>
<connect name="bare" site1="end 2" site2="top 2"/></equality></mujoco>
"""


def test_a_loop_is_judged_beside_one_whose_masses_are_unknown(tmp_path):
    path = tmp_path / "robot.xml"
    path.write_text(TWO_LOOPS)
    file = read_robot(path)
    coupler = math.hypot(0.25, 0.1)
    for name, ground, x in (("whole", 0.3, 0.05), ("bare", 0.33, 0.02)):
        bars = fourbar.uniform(ground, 0.1, coupler, math.hypot(x, 0.1))
        scene = fourbar.Scene(bars, fourbar.Motion(0.0, 1.0))
        if name == "whole":
            assert find_loop_of_scene(file, scene, AS_DRAWN).loop.name == name
            continue
        with pytest.raises(InputError, match="its mass is unknown"):
            find_loop_of_scene(file, scene, AS_DRAWN)
