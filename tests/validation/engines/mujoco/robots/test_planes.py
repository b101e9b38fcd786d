"""Loops whose ends lie in two parallel planes, as CAD exports them."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from fourbar.solving import solve
from fourbar_validation.engines.mujoco.robots.answers import (
    MeasureOptions,
)
from fourbar_validation.engines.mujoco.robots.closures import list_closures
from fourbar_validation.engines.mujoco.robots.loop import PoseOptions, RobotFile
from fourbar_validation.engines.mujoco.robots.measure import measure_loops

OFFSET = """
<mujoco><compiler angle="degree"/><option gravity="0 -9.81 0"/><worldbody>
<body name="crank"><joint name="j2" axis="0 0 1"/>
 <inertial pos="0.025 0.043301270189221940" mass=".2" diaginertia="1e-4 1e-4 1e-4"/>
 <body name="coupler" pos="0.05 0.08660254037844387 0"><joint name="j3" axis="0 0 1"/>
  <inertial pos="0.106672493964356 0.065161177333012 0" mass=".5"
    diaginertia="2e-3 2e-3 2e-3"/>
  <site name="s3" pos="0.21334498792871323 0.130322354666025 0"/></body></body>
<body name="rocker" pos="0.3 0 0"><joint name="j4" axis="0 0 1"/>
 <inertial pos="-0.018327506035643 0.108462447522234 0" mass=".4"
   diaginertia="2e-3 2e-3 2e-3"/>
 <site name="s4" pos="-0.03665501207128674 0.21692489504446885 {offset}"/></body>
</worldbody><equality><connect name="pin" site1="s3" site2="s4"/></equality>
<actuator><motor joint="j2"/></actuator></mujoco>
""".replace("0.043301270189221940", "0.04330127018922194 0")
TORQUES = {0.0: 0.13648498112812546, 111.0: -0.5759040624467816}
"""N m at positions of j2, deg, at 1 rad/s: Newton's steps on the gap in the plane, its
second derivative by differences, and multipliers by least squares.
"""
CHORD = 1e-3
"""rad; theta_3 between two positions that are 3 deg apart, by a chord."""
SAME = 1e-9
"""Relative; the differences of the derivation have some ten digits."""


def file_of(offset):
    return RobotFile(Path("offset.xml"), OFFSET.format(offset=offset))


def measured(offset):
    options = MeasureOptions(PoseOptions(), speed=1.0)
    (loop,) = measure_loops(file_of(offset), options, None).loops
    return loop


@pytest.mark.slow
@pytest.mark.parametrize("offset", [1e-5, 1e-3])
def test_an_offset_along_the_axes_changes_nothing_in_the_plane(offset):
    loop = measured(offset)
    torques = {round(np.degrees(row.joint), 6): row.rigid for row in loop.states.rows}
    for joint, torque in TORQUES.items():
        assert torques[joint].torque == pytest.approx(torque, rel=SAME)
    assert len(loop.states.rows) == len(measured(0.0).states.rows)
    assert loop.through_time is not None and not loop.through_time.lost
    assert max(row.gap for row in loop.states.rows) < 1e-12


@pytest.mark.parametrize("offset", [1e-5, 1e-3])
def test_an_offset_is_named_with_the_force_that_mujoco_has_there(offset):
    report = list_closures(file_of(offset), PoseOptions())
    (closure,) = report.closures
    assert closure.loop is not None and not report.notes
    assert closure.gap == pytest.approx(0.0, abs=1e-12)
    model = mujoco.MjModel.from_xml_string(OFFSET.format(offset=offset))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    x, y, z = data.efc_force
    (remark,) = closure.loop.remarks
    assert f"{1e3 * offset:#.4g}".rstrip(".") + " mm apart along the axes" in remark
    assert f"{abs(z):.4g} N across the plane" in remark
    assert f"{np.hypot(x, y):.4g} N in it" in remark


def test_ends_in_one_plane_are_not_remarked():
    (closure,) = list_closures(file_of(0.0), PoseOptions()).closures
    assert closure.loop is not None and not closure.loop.remarks


HALF = """
<body name="half" pos="{x} {y} 0" euler="0 0 40"><joint name="pin" axis="0 0 1"/>
 <inertial pos="0 0 0" mass=".01" diaginertia="1e-5 1e-5 1e-5"/>
 <body name="end" euler="90 0 0"/></body></body>
"""
"""Half of the coupler on the rocker's end, whose welded part has axes of its own."""


@pytest.mark.slow
def test_a_weld_holds_the_turn_whatever_the_axes_of_its_bodies():
    """Both halves of the coupler turn alike: no motion of the loop parts them."""
    x, y = -0.03665501207128674, 0.21692489504446885
    text = OFFSET.format(offset=0.0)
    start, _, bodies = text.partition("<worldbody>")
    bodies, _, end = bodies.partition("</worldbody>")
    crank, _, rocker = bodies.partition('<body name="rocker" pos="0.3 0 0">')
    rocker = rocker.strip().removesuffix("</body>")
    halved = f'<body name="rocker" pos="0.3 0 0">{rocker}{HALF.format(x=x, y=y)}'
    # the rocker comes first: its half of the coupler tells theta_3
    text = f"{start}<worldbody>{halved}{crank}</worldbody>{end}"
    weld = '<weld name="pin" body1="coupler" body2="end"/>'
    text = text.replace('<connect name="pin" site1="s3" site2="s4"/>', weld)
    options = MeasureOptions(PoseOptions(), speed=1.0)
    (loop,) = measure_loops(RobotFile(Path("halves.xml"), text), options, None).loops
    formulas = solve(loop.scene, "position")
    expected = np.interp(
        [row.angle for row in loop.states.rows],
        formulas.theta_2 + loop.turned,
        formulas.theta_3 + loop.turned,
    )
    found = np.array([row.bars.theta_3 for row in loop.states.rows])
    assert np.abs(np.sin(found - expected)).max() < CHORD
