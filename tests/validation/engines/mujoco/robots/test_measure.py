"""The loops of a robot's file as they are measured.

All, one by name, by a scene of one's own.
"""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import fourbar
from fourbar.errors import InputError
from fourbar.mjcf import Plane, write_mjcf
from fourbar_validation.engines.mujoco.robots.answers import (
    FORCE_QUANTITIES,
    MeasureOptions,
)
from fourbar_validation.engines.mujoco.robots.loop import PoseOptions, RobotFile
from fourbar_validation.engines.mujoco.robots.measure import (
    POSITIONS_OF_A_LOOP,
    measure_loops,
)
from fourbar_validation.engines.mujoco.robots.scene import read_loop_scene
from fourbar_validation.robots.files import read_robot
from fourbar_validation.robots.measure import (
    MEASURED_THROUGH_TIME,
    RIGID,
    STATES,
    find_left_out,
    find_worst_of_loop,
    list_errors_by_method,
)
from tests.support.robots import (
    FINGER,
    FOOT_PARALLELOGRAM,
    Planar,
    make_parallelogram,
)
from tests.support.scenes import mirrored

ROBOTS = Path(__file__).parents[5] / "models" / "robots"


@pytest.mark.slow
def test_both_fingers_of_a_gripper_are_measured_and_are_alike():
    file = read_robot(ROBOTS / "gripper.xml")
    right, left = measure_loops(file, MeasureOptions(PoseOptions()), None).loops
    assert find_worst_of_loop(right) == pytest.approx(
        find_worst_of_loop(left),
        rel=1e-3,
    )


@pytest.mark.slow
def test_a_scene_with_axes_of_its_own_gives_the_same_errors():
    """The axes of the scene are turned by 0.3 rad against those of the loop's plane.

    No weight acts across it.
    """
    file = read_robot(ROBOTS / "biped_foot.xml")
    options = MeasureOptions(PoseOptions(), "rod")
    (made,) = measure_loops(file, options, None).loops
    scene = made.scene
    linkage = replace(scene.linkage, ground_angle=scene.linkage.ground_angle + 0.3)
    gravity, *others = scene.effects
    turned = replace(
        scene,
        linkage=linkage,
        effects=(replace(gravity, angle=gravity.angle + 0.3), *others),
        motion=scene.motion.replace(angle=np.asarray(made_angles(made)) + 0.3),
    )
    (other,) = measure_loops(file, options, turned).loops
    assert find_worst_of_loop(other) == pytest.approx(
        find_worst_of_loop(made),
        rel=1e-6,
    )


ROCKER = fourbar.load(ROBOTS.parent / "crank_rocker.toml")
TILTED = Plane((-2.0, 5.0, 1.0), (1.0, -2.0, 0.5))


@pytest.mark.slow
@pytest.mark.parametrize("plane", [Plane(), TILTED], ids=["level", "tilted"])
def test_loads_of_the_file_act_and_its_motor_does_not(plane):
    """With rigid pins the robot's torque and forces are those of the scene.

    Loads are included.
    """
    assert len(ROCKER.loads) == 2
    text = write_mjcf(ROCKER, drive="motor", plane=plane)
    file = RobotFile(Path("arm.xml"), text)
    (loop,) = measure_loops(file, MeasureOptions(PoseOptions()), ROCKER).loops
    assert find_left_out(loop) < 1e-9
    without = replace(ROCKER, loads=ROCKER.loads[:1])
    (loop,) = measure_loops(file, MeasureOptions(PoseOptions()), without).loops
    assert find_left_out(loop) > 1e-3


@pytest.mark.slow
def test_a_scene_may_see_the_loop_from_behind():
    bare = replace(ROCKER, loads=(), effects=())
    file = RobotFile(Path("arm.xml"), write_mjcf(bare, drive="motor"))
    options = MeasureOptions(PoseOptions())
    (front,) = measure_loops(file, options, bare).loops
    (behind,) = measure_loops(file, options, mirrored(bare)).loops
    assert find_left_out(front) < 1e-9
    assert find_left_out(behind) < 1e-9
    assert find_worst_of_loop(behind) == pytest.approx(
        find_worst_of_loop(front),
        rel=1e-3,
    )


@pytest.mark.slow
def test_the_input_of_the_scene_is_driven_whatever_the_file_drives():
    """Here the motor of the file acts on the output of the scene."""
    scene = replace(ROCKER, loads=(), effects=())
    text = write_mjcf(scene, drive="motor")
    assert 'joint="O2"' in text
    file = RobotFile(Path("arm.xml"), text.replace('joint="O2"', 'joint="O4"'))
    (loop,) = measure_loops(file, MeasureOptions(PoseOptions()), scene).loops
    assert loop.joint == "O2"
    assert find_left_out(loop) < 1e-9
    (loop,) = measure_loops(file, MeasureOptions(PoseOptions()), None).loops
    assert loop.joint == "O4"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["dip_loop", "pip_link-middle"])
def test_the_loop_of_a_scene_is_found_by_its_lengths(name):
    file = RobotFile(Path("finger.xml"), FINGER)
    scene = read_loop_scene(file, PoseOptions(), name, None).scene
    (loop,) = measure_loops(file, MeasureOptions(PoseOptions()), scene).loops
    assert loop.name == name
    assert find_left_out(loop) < 1e-7


def made_angles(made):
    return [row.angle - made.turned for row in made.states.rows]


def test_a_loop_that_is_not_there_is_refused():
    file = read_robot(ROBOTS / "gripper.xml")
    with pytest.raises(InputError, match="no such closure"):
        measure_loops(file, MeasureOptions(PoseOptions(), "tail"), None)


HALVES = Planar(
    pins={"O2": (0.0, 0.0), "A": (0.3, 0.0), "B": (0.3, 0.5), "O4": (0.0, 0.5)},
    by="weld",
)
"""A parallelogram whose coupler is two halves."""


@pytest.mark.slow
@pytest.mark.parametrize(
    "file",
    [
        pytest.param(
            make_parallelogram(0.4, 0.4, "0 0 0"),
            id="no torque",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            make_parallelogram(0.4, 0.4, "0 0 -9.81"),
            id="rhombus",
            marks=pytest.mark.slow,
        ),
        pytest.param(make_parallelogram(0.5, 0.4, "0 0 -9.81"), id="rectangle"),
        pytest.param(RobotFile(Path("halves.xml"), HALVES.text()), id="welded"),
    ],
)
def test_a_full_turn_of_a_parallelogram_is_measured_but_for_its_change_points(file):
    """The loop stays a parallelogram past the positions in line."""
    (loop,) = measure_loops(file, MeasureOptions(PoseOptions()), None).loops
    assert len(loop.states.in_line) == 2
    across = [math.cos(joint) for joint in loop.states.in_line]
    assert across == pytest.approx([0.0, 0.0], abs=1e-6)
    assert len(loop.states.rows) == POSITIONS_OF_A_LOOP - 2
    assert find_left_out(loop) < 1e-8
    errors = list_errors_by_method(loop)
    assert len(errors) == 3 * len(FORCE_QUANTITIES)
    assert all(math.isfinite(error.part) for error in errors)


@pytest.mark.slow
def test_a_torque_that_vanishes_is_judged_on_the_pin_forces_times_a_bar():
    """A parallelogram of equal cranks that turns uniformly needs no torque."""
    file = make_parallelogram(0.5, 0.4, "0 0 0")
    (loop,) = measure_loops(file, MeasureOptions(PoseOptions()), None).loops
    (torque,) = (
        error
        for error in list_errors_by_method(loop)
        if (error.method, error.quantity) == (STATES, "torque")
    )
    # mass of the capsule times the centripetal acceleration of A, and of half the crank
    speed = loop.states.rows[0].speed
    rod = 1000.0 * math.pi * 0.02**2
    crank = rod * (0.4 + 4.0 / 3.0 * 0.02)
    coupler = rod * (0.5 + 4.0 / 3.0 * 0.02)
    largest = (0.5 * coupler + 0.5 * crank) * 0.4 * speed**2
    assert torque.vanishes
    assert torque.scale == pytest.approx(largest * 0.5, rel=1e-6)
    assert torque.part == torque.error / torque.scale
    assert loop.influence is not None and loop.influence.worst < 1.0


@pytest.mark.slow
def test_a_torque_beside_a_change_point_is_judged_by_itself():
    """Viscous couples of 0.5 N m at O2 and O4, and the weights on level cranks."""
    file = RobotFile(Path("foot.xml"), FOOT_PARALLELOGRAM)
    (loop,) = measure_loops(file, MeasureOptions(PoseOptions()), None).loops
    largest = 2.0 * 0.5 + 9.81 * (0.016 * 0.03 + 0.014 * 0.06 + 0.27 * 0.03)
    torques = [
        error for error in list_errors_by_method(loop) if error.quantity == "torque"
    ]
    assert len(torques) == 3
    for torque in torques:
        assert not torque.vanishes
        assert torque.scale == pytest.approx(largest, rel=1e-3)


@pytest.mark.slow
def test_what_the_scene_leaves_out_is_no_error_of_mujoco():
    """An armature I between bars 2 and 3 takes I (a3 - a2)(w3 - w2)/w2 of the motor."""
    bare = replace(ROCKER, loads=(), effects=())
    armature = 0.01
    text = write_mjcf(bare, drive="motor")
    file = RobotFile(Path("arm.xml"), text)
    changed = text.replace('joint name="A"', f'joint name="A" armature="{armature}"')
    assert changed != text
    with_armature = RobotFile(Path("arm.xml"), changed)
    options = MeasureOptions(PoseOptions())
    (loop,) = measure_loops(with_armature, options, bare).loops
    errors = {
        error.method: error
        for error in list_errors_by_method(loop)
        if error.quantity == "torque"
    }
    at = bare.motion.replace(angle=np.array(made_angles(loop)))
    solution = fourbar.solve(replace(bare, motion=at))
    alpha = solution.alpha_3 - solution.alpha_2
    omega = solution.omega_3 - solution.omega_2
    taken = armature * alpha * omega / solution.omega_2
    assert errors[RIGID].error == pytest.approx(np.abs(taken).max(), rel=1e-8)
    soft = np.array([row.soft.torque - row.rigid.torque for row in loop.states.rows])
    assert errors[STATES].error == np.abs(soft).max()
    # the closure of a generated file is nearly rigid, with the armature or without
    (plain,) = measure_loops(file, options, bare).loops
    assert find_worst_of_loop(plain) < 0.1 * errors[RIGID].part
    assert errors[STATES].part < 0.1 * errors[RIGID].part
    assert errors[MEASURED_THROUGH_TIME].part < 0.1 * errors[RIGID].part


def test_a_couple_is_found_where_nothing_accelerates():
    """At rest without weights no acceleration tells how large a trial is to be."""
    file = make_parallelogram(0.5, 0.4, "0 0 0")
    options = MeasureOptions(PoseOptions(), speed=0.0)
    (loop,) = measure_loops(file, options, None).loops
    assert len(loop.states.rows) == POSITIONS_OF_A_LOOP - 2
    assert all(abs(row.soft.torque) < 1e-9 for row in loop.states.rows)


def test_an_actuator_without_a_name_is_told_by_its_joint():
    file = make_parallelogram(0.5, 0.4, "0 0 0")
    made = read_loop_scene(file, PoseOptions(), None, None)
    assert "not in the scene: an actuator without a name, on hinge_2" in made.remarks


@pytest.mark.slow
def test_what_a_second_solver_of_dry_friction_changes_is_said():
    """The same file without it is measured by itself.

    Below the speed at which dry friction acts in full the solver changes it, and never
    the force of the loop.
    """
    plain = make_parallelogram(0.5, 0.4, "0 0 0")
    rubbing = plain.text.replace('name="hinge_2"', 'name="hinge_2" frictionloss="0.1"')
    assert rubbing != plain.text
    twice = rubbing.replace("<worldbody>", '<option noslip_iterations="5"/><worldbody>')
    options = MeasureOptions(PoseOptions(), speed=1e-3)
    with_it, without = (
        measure_loops(replace(plain, text=text), options, None).loops[0]
        for text in (twice, rubbing)
    )
    changed = max(
        np.abs(np.subtract(mine.soft.values()[name], other.soft.values()[name])).max()
        / with_it.scales[name]
        for name in FORCE_QUANTITIES
        for mine, other in zip(with_it.states.rows, without.states.rows, strict=True)
    )
    (remark,) = (text for text in with_it.remarks if "noslip" in text)
    told = float(remark.split("errors by ")[1].split()[0])
    assert changed > 1e-3
    assert told == pytest.approx(changed, rel=0.5)  # one digit, the size of a vector
    assert not any("noslip" in text for text in without.remarks)
