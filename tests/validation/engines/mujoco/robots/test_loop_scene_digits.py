"""Lengths of a robot's loop within the digits of its file."""

import math
import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from pytest import approx

import fourbar
from fourbar.formulas.mobility import classify
from fourbar_validation.compare.rows import DEGRADED, FAILS
from fourbar_validation.compare.tolerance import SIMULATED
from fourbar_validation.engines.mujoco.describe import describe_model
from fourbar_validation.engines.mujoco.robots.inside import (
    RESIDUAL_OF_AN_OPEN_LOOP,
    LoopInside,
)
from fourbar_validation.engines.mujoco.robots.loop_scene import find_rounding
from fourbar_validation.engines.mujoco.robots.measure import POSITIONS_OF_A_LOOP
from fourbar_validation.engines.mujoco.robots.onto_scene import find_loop_of_scene
from fourbar_validation.robots.judge_loop import FILE_AT_ONE_STATE, list_rows
from fourbar_validation.robots.loop_errors import RIGID, list_errors_by_method
from tests.support.robots import (
    AS_DRAWN,
    FOOT_PARALLELOGRAM,
    examine_text,
    file_of,
    measure,
    pose_loop,
    read_scene,
    rotation,
)
from tests.support.rows import read_rows, slow_but

FOLLOWS = ("theta_3", "theta_4", "omega_3", "omega_4")
ANCHOR = 'anchor="-0.06 0 0"'
QUATERNION = "0.982434 0 0.18661 0"
ROD = "-0.055821 0 0.022"
FREE = FOOT_PARALLELOGRAM.replace(' range="-1.2 1.2"', "")
FIVE_DIGITS = FREE.replace(ROD, "-0.05582 0 0.022").replace("0.982434", "0.98243")

TURNED = FREE.replace(ROD, "-0.06 0 0").replace(
    'pos="0 0 0.15"', 'pos="0 0 0.15" quat="0.98243 0 0.18661 0"'
)
"""Round places, and two quaternions of one turn with five digits and six."""
LARGE = (
    FREE.replace(ROD, "-0.5582 0 0.22")
    .replace(ANCHOR, 'anchor="-0.6 0 0"')
    .replace("0 0 0.15", "0 0 1.5")
    .replace("0 0 0.29", "0 0 2.9")
)
"""Ten times as large with two digits less: its gap is beyond that of a closed loop."""
ROUNDINGS = 20.0
"""Relative roundings of the lengths by which torque and pin forces may be off in the
median: they turn bars 3 and 4 by some of them.
"""
CHANGE_POINT = """
<mujoco><compiler angle="radian"/>
  <default><geom type="capsule" size="0.1" contype="0" conaffinity="0"/></default>
  <worldbody>
    <body name="crank"><joint name="motor" axis="0 1 0"/>
      <geom fromto="0 0 0 {a} 0 0"/>
      <body name="rod" pos="{a} 0 0"><joint name="A" axis="0 1 0"/>
        <geom fromto="0 0 0 {b} 0 0"/><site name="end" pos="{b} 0 0"/></body>
    </body>
    <body name="output" pos="{d} 0 0"><joint name="O4" axis="0 1 0"/>
      <geom fromto="0 0 0 -{c} 0 0"/><site name="top" pos="-{c} 0 0"/></body>
  </worldbody>
  <equality><connect name="B" site1="end" site2="top"/></equality>
  <actuator><motor joint="motor"/></actuator>
</mujoco>
"""


def write_change_point(d, a, b, c):
    return CHANGE_POINT.format(d=d, a=a, b=b, c=c)


def list_equal(made):
    return [remark for remark in made.remarks if "read as equal" in remark]


@pytest.mark.parametrize(
    "text, half",
    read_rows("""
-0.055821 0 0.022 | 5e-7
0.982434 0 0.18661 0 | 5e-7
12.3456 | 5e-5
1.23456e-05 | 5e-11
0 0 0.15 | 5e-3
0 0 0 | 5e-1
"""),
)
def test_the_rounding_of_numbers_is_half_of_the_last_digit_that_one_shows(text, half):
    vector = [float(number) for number in text.split()]
    rounding = float(half) * math.sqrt(np.count_nonzero(vector))
    assert find_rounding(tuple(vector)) == approx(rounding, rel=1e-12)


@pytest.mark.parametrize(
    "text, size",
    [(FREE, 1.0), (FIVE_DIGITS, 1.0), (TURNED, 1.0), (LARGE, 10.0)],
    ids=["six digits", "five digits", "quaternions", "large"],
)
def test_a_parallelogram_of_rounded_numbers_is_the_one_that_was_built(text, size):
    made = read_scene(text)
    lengths = np.multiply(size, (0.14, 0.06, 0.14, 0.06))
    assert made.scene.linkage.lengths == approx(lengths, rel=1e-12)
    assert made.loop.rounding > 1e-8 * size
    assert classify(made.scene.linkage).name == "parallelogram"
    sweep = made.scene.motion.angle
    assert sweep.stop - sweep.start == approx(math.tau)


def test_what_is_read_as_equal_is_said_with_its_difference():
    """The pins of the file: A on the turned crank, B on the foot."""
    quaternion = [float(number) for number in QUATERNION.split()]
    pin_a = np.array([0.0, 0.0, 0.29]) + rotation(quaternion) @ (-0.06, 0.0, 0.0)
    pin_b = np.array([-0.055821, 0.0, 0.15 + 0.022])
    coupler = 0.14 - np.linalg.norm(pin_a - pin_b)
    output = 0.06 - math.hypot(0.055821, 0.022)
    (said,) = list_equal(read_scene(FOOT_PARALLELOGRAM))
    assert said == (
        "lengths read as equal within the digits of the file: ground and coupler, which"
        f" differ by {coupler:.4g} m; input and output, which differ by {output:.4g} m"
    )


def test_a_file_has_the_lengths_of_the_scene_that_was_made_from_it():
    """Another loop, whose own lengths are round, is no nearer to them."""
    body = FREE.partition("<worldbody>")[2].partition("</worldbody>")[0]
    closure = FREE.partition("<equality>")[2].partition("</equality>")[0]
    body, closure = (
        re.sub('"(foot|pitch|rod|ankle|crank|motor)"', r'"round \1"', text)
        for text in (body, closure)
    )
    body = body.replace(ROD, "-0.06 0 0").replace(f' quat="{QUATERNION}"', "")
    text = FREE.replace("</worldbody>", f"{body}</worldbody>")
    file = file_of(text.replace("</equality>", f"{closure}</equality>"))
    scene = read_scene(FREE).scene
    found = find_loop_of_scene(file, scene, AS_DRAWN)
    described = describe_model(found.see(), 0.0)
    assert described["lengths.output"].value == scene.linkage.output.length
    assert found.loop.name == "rod" and found.loop.remarks
    own = replace(scene, linkage=fourbar.uniform(*pose_loop(FREE)[1].lengths))
    assert find_loop_of_scene(file, own, AS_DRAWN).loop.rounding == 0.0


def test_the_range_of_the_motor_is_that_of_the_file():
    """It passes the change point at which the rounded lengths would stop it."""
    made = read_scene(FOOT_PARALLELOGRAM)
    sweep = made.scene.motion.angle
    assert sweep.stop - sweep.start == approx(2.4, rel=1e-9)


@pytest.mark.parametrize(
    "text",
    [
        FREE.replace(ANCHOR, 'anchor="-0.060002 0 0"'),  # off by four of its last digit
        FREE.replace(ROD, "-0.055821000001 0 0.022").replace("434", "434000001"),
    ],
    ids=["another length", "more digits"],
)
def test_what_the_digits_tell_apart_stays(text):
    made = read_scene(text)
    assert not list_equal(made)
    assert made.loop.rounding == 0.0
    assert made.scene.linkage.lengths == approx(made.loop.lengths, rel=1e-11)
    assert classify(made.scene.linkage).name != "parallelogram"


def test_a_file_that_mujoco_saved_is_read_as_the_one_that_was_written(tmp_path):
    """Exact lengths and a turn of all digits, of which MuJoCo writes six."""
    half = 0.5 * math.radians(21.51)
    exact = FREE.replace(QUATERNION, f"{math.cos(half)!r} 0 {math.sin(half)!r} 0")
    x, z = 0.06 * math.cos(2.0 * half), 0.06 * math.sin(2.0 * half)
    exact = exact.replace(ROD, f"{-x!r} 0 {z!r}")
    assert not list_equal(read_scene(exact))
    assert classify(read_scene(exact).scene.linkage).name == "parallelogram"
    saved = tmp_path / "saved.xml"
    mujoco.mj_saveLastXML(str(saved), mujoco.MjModel.from_xml_string(exact))
    made = read_scene(saved.read_text("utf-8"))
    assert list_equal(made)
    assert made.scene.linkage.lengths == approx((0.14, 0.06) * 2, rel=2e-6)
    assert classify(made.scene.linkage).name == "parallelogram"


@pytest.mark.parametrize("text", slow_but({FIVE_DIGITS}, [FREE, FIVE_DIGITS, LARGE]))
@pytest.mark.slow
def test_a_turn_is_measured_but_where_the_digits_do_not_tell_the_pose(text):
    """The rigid robot is that of the formulas within the digits of its lengths."""
    loop = measure(text)
    assert loop.rounding > 1e-7
    assert len(loop.states.in_line) == 2
    assert len(loop.states.rows) == POSITIONS_OF_A_LOOP - 2
    assert not loop.refusal
    assert not loop.through_time.lost
    for error in list_errors_by_method(loop):
        assert math.isfinite(error.part)
        if error.method == RIGID:
            assert error.part < 0.01
            relative = loop.rounding / min(loop.scene.linkage.lengths)
            assert error.median < ROUNDINGS * relative


@pytest.mark.parametrize("text", [FREE, FIVE_DIGITS, LARGE])
def test_the_digits_of_a_file_are_no_error_of_its_motion(text):
    """Over the full turn of its own scene, at single states."""
    scene = read_scene(text, speed=1.0).scene
    measured = examine_text(scene, text).loops[0]
    for rounding, verdict in ((measured.rounding, DEGRADED), (0.0, FAILS)):
        known = replace(measured, rounding=rounding)
        rows = list_rows("foot", known, SIMULATED, {"torque": 0.0})
        motion = {
            row.quantity: row.verdict for row in rows if row.engine == FILE_AT_ONE_STATE
        }
        assert {motion[name] for name in FOLLOWS} == {verdict}


def test_a_loop_is_closed_on_a_change_point_that_its_lengths_miss():
    """The bars are in line there, and leave a gap of what a + d = b + c misses by."""
    posed, _ = pose_loop(LARGE)
    loop = read_scene(LARGE).loop
    in_line = 0.5 * math.pi
    ground, crank, coupler, output = loop.lengths
    miss = abs(ground + crank - coupler - output)
    assert RESIDUAL_OF_AN_OPEN_LOOP < miss == approx(loop.rounding)
    assert LoopInside(posed.model, loop).close(in_line) is not None
    exact = replace(loop, met=loop.lengths)
    assert LoopInside(posed.model, exact).close(in_line) is None


def test_one_equality_alone_is_met_by_chance():
    """The sum d + a is b + c but for 1e-5: less than three roundings of 5e-6."""
    lengths = (4.0, 1.00001, 2.00001, 3.00001)
    made = read_scene(write_change_point(*lengths))
    assert not list_equal(made)
    assert made.scene.linkage.lengths == approx(lengths)


def test_round_off_of_the_compiler_takes_no_change_point_away():
    """Beyond it the bars that follow are on the other sides of each other."""
    text = write_change_point(0.4, 0.1, 0.2, 0.30000000000003)
    posed, _ = pose_loop(text)
    made = read_scene(text)
    assert not list_equal(made)
    assert made.loop.rounding == 0.0
    inside = LoopInside(posed.model, made.loop)
    in_line = made.loop.angles[0] + math.pi
    poses = [inside.close(in_line + away) for away in (-0.3, 0.3)]
    before, after = map(inside.measure_sine, poses)
    assert before == approx(-after)
