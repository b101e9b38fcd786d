"""Loops that pass change points: the assembly, and the scale of what vanishes."""

import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from fourbar.scene import find_signs
from fourbar_validation.engines.free_body_closure import close
from fourbar_validation.engines.mujoco.robots.answers import (
    MeasureOptions,
    RobotMeasurement,
)
from fourbar_validation.engines.mujoco.robots.loop import PoseOptions, RobotFile
from fourbar_validation.engines.mujoco.robots.measure import measure_loops
from fourbar_validation.robots.measure import (
    MEASURED_THROUGH_TIME,
    STATES,
    find_left_out,
    list_errors_by_method,
)
from fourbar_validation.robots.report import describe_measurement

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
RHOMBUS = """
<mujoco><option gravity="0 0 0"/><worldbody>
<body name="one" pos="0 0 4"><joint name="h1" axis="1 0 0"/>
 <geom type="cylinder" size=".2 2" pos="0 2 0" euler="90 0 0" contype="0"
   conaffinity="0"/>
 <body name="two" pos="0 4 0"><joint name="h2" axis="1 0 0"/>
  <geom type="cylinder" size=".2 2" pos="0 0 -2" contype="0" conaffinity="0"/>
  <site name="end" pos="0 0 -4"/></body></body>
<body name="three" pos="0 0 0"><joint name="h3" axis="1 0 0"/>
 <geom type="cylinder" size=".2 2" pos="0 2 0" euler="90 0 0" contype="0"
   conaffinity="0"/>
 <site name="tip" pos="0 4 0"/></body>
</worldbody><equality><connect name="pin" site1="end" site2="tip"/></equality></mujoco>
"""


@cache
def measured(text, speed=1.0, **pose):
    file = RobotFile(Path("robot.xml"), text)
    options = MeasureOptions(PoseOptions(joints=pose), speed=speed)
    (loop,) = measure_loops(file, options, None).loops
    return loop


@pytest.mark.slow
@pytest.mark.parametrize("start", ["0deg", "10deg", "-160deg", "200deg"])
def test_states_are_compared_in_the_assembly_of_the_robot(start):
    assert find_left_out(measured(SINGLE, j2=start)) < 1e-8


@pytest.mark.slow
def test_a_state_after_a_turn_is_that_of_the_same_motion():
    """Beyond its change point the other assembly has the branch of the scene."""
    loop = measured(SINGLE, j2="10deg")
    theta_2 = np.array([row.angle for row in loop.states.rows]) - loop.turned
    assert np.ptp(theta_2) == pytest.approx(math.tau)
    linkage = loop.scene.linkage
    signs = find_signs(linkage, theta_2, loop.scene.motion.branch)
    theta_4 = np.unwrap(close(linkage, theta_2, signs).theta[1])
    assert abs(theta_4[-1] - theta_4[0]) > 0.1


@pytest.mark.slow
def test_going_over_to_the_other_assembly_is_said_and_is_in_no_percentage():
    loop = measured(SINGLE, -1.0, j2="10deg")
    through = loop.through_time
    assert through is not None and through.other_assembly is not None
    beyond = math.degrees(through.other_assembly)
    assert beyond < 120.0 < math.degrees(min(row.joint for row in through.rows)) + 5.0
    torques = [
        error
        for error in list_errors_by_method(loop)
        if (error.method, error.quantity) == (MEASURED_THROUGH_TIME, "torque")
    ]
    assert [torque.part < 0.5 for torque in torques] == [True]


@pytest.mark.slow
def test_one_scale_for_a_column_where_the_torque_is_rounding():
    """The torque is a sum that cancels: 12.6 % of 8042 N m, not 1e6 %."""
    loop = measured(RHOMBUS)
    torques = {
        error.method: error
        for error in list_errors_by_method(loop)
        if error.quantity == "torque"
    }
    force = max(
        row.rigid.forces["F12"] @ row.rigid.forces["F12"] for row in (loop.states.rows)
    )
    for torque in torques.values():
        assert torque.vanishes
        assert torque.scale == pytest.approx(4.0 * math.sqrt(force), rel=1e-9)
        assert torque.scale == pytest.approx(8042.0, abs=0.5)
        assert torque.part == torque.error / torque.scale
        assert torque.median < torque.part
    assert torques[MEASURED_THROUGH_TIME].part == pytest.approx(0.126, abs=0.002)
    assert torques[STATES].part == pytest.approx(0.0674, abs=1e-4)
    assert loop.influence is not None and loop.influence.worst < 0.01


@pytest.mark.slow
def test_what_is_said_of_a_change_of_assembly():
    loop = measured(SINGLE, -1.0, j2="10deg")
    said = [
        block
        for block in describe_measurement(RobotMeasurement((loop,), ()))
        if isinstance(block, str) and "goes over to the other assembly" in block
    ]
    assert len(said) == 1 and "seen at j2 = " in said[0]
