"""A polynomial in place of a loop: what it loses, and the best of each degree."""

import math
import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from pytest import approx, raises

import fourbar
from fourbar.errors import BAD_INPUT, InputError
from fourbar.scene import Command, Scene
from fourbar.solving import solve
from fourbar_validation.cli import status
from fourbar_validation.robots.judge_mimic import (
    MINIMAX,
    SQUARES,
    fit_minimax,
    measure_mimic,
    show_mimic,
)
from tests.support.rows import read_rows
from tests.support.scenes import bare, recommand
from tests.validation.robots.test_sdf import URDF

ROUND_OFF = 1e-12
"""rad, or without unit: angles and ratios of a few units in double precision."""


def angle_of(report):
    """Return the largest error of the angle from the file's zeros, rad."""
    return report.zeros[0][0] if report.zeros else math.nan


def swing(first, last, steps):
    """Turn at 1 rad/s from one angle to another, deg."""
    return fourbar.Motion(np.radians(np.linspace(first, last, steps + 1)), 1.0)


KNEE = Scene(
    bare(0.3, 0.04, 0.295, 0.045, -0.5 * math.pi),
    swing(-40.0, 40.0, 160),
    title="knee of a leg",
)
pytestmark = pytest.mark.usefixtures("in_this_process")
FILE = """<mujoco><worldbody>
<body name="crank"><joint name="c" axis="0 0 1"/>
<inertial pos="0.02 0 0" mass="0.1" diaginertia="1e-5 1e-5 1e-5"/></body>
<body name="shank" pos="0 -0.3 0"><joint name="s" axis="0 0 {axis}"/>
<inertial pos="0.1 0 0" mass="0.9" diaginertia="0.012 0.012 0.012"/></body>
</worldbody><equality>
<joint joint1="s" joint2="c" polycoef="{polycoef}"/>
</equality></mujoco>"""


GRIPPER = Scene(
    bare(0.03, 0.04, 0.034, 0.04),
    swing(60.0, 120.0, 60),
    title="gripper",
)
PARALLELOGRAM = replace(GRIPPER, linkage=bare(0.03, 0.04, 0.03, 0.04))
UPRIGHT = """<mujoco><worldbody>
<body name="crank"><joint name="drive" axis="0 0 {sense}"/>
<geom type="capsule" fromto="0 0 0 0 0.04 0" size="0.004"/>{pad}</body>
<body name="rocker" pos="0.03 0 0"><joint name="rocker_j" axis="0 0 {sense}"/>
<geom type="capsule" fromto="0 0 0 0 0.04 0" size="0.004"/></body>
</worldbody><equality><joint joint1="rocker_j" joint2="drive" polycoef="{polycoef}"/>
</equality></mujoco>"""
"""Both bars stand along +y at the zeros of their joints."""
PAD = """<body pos="0 0.04 0"><joint name="pad"/><geom size="0.004"/></body>"""


def write_upright(folder, polycoef="0 1 0 0 0", sense=1, pad=PAD):
    path = folder / "upright.xml"
    path.write_text(UPRIGHT.format(polycoef=polycoef, sense=sense, pad=pad))
    return path


@pytest.fixture
def shown(capsys):
    """Shows a report, and returns it in one line."""

    def show(report):
        show_mimic(report)
        return " ".join(capsys.readouterr().out.split())

    return show


@pytest.mark.slow
@pytest.mark.parametrize("sense, pad", [(1, PAD), (1, ""), (-1, PAD), (-1, "")])
def test_theta_2_is_counted_from_where_the_file_has_the_bar(
    sense, pad, tmp_path, shown
):
    report = measure_mimic(
        write_upright(tmp_path, sense=sense, pad=pad), "rocker_j", GRIPPER
    )
    assert math.degrees(angle_of(report)) == approx(0.95783, abs=5e-6)
    sign = "+" if sense > 0 else "-"
    printed = shown(report)
    assert f"theta_2 is 90 deg {sign} drive, from 60 to 120 deg" in printed
    # typed into the file, a polynomial turns the rocker as the loop does
    best = report.fits[MINIMAX][3]
    polycoef = " ".join(repr(number) for number in best.polynomial.coef.tolist())
    again = measure_mimic(
        write_upright(tmp_path, polycoef, sense, pad), "rocker_j", GRIPPER
    )
    assert angle_of(again) == approx(best.angle, rel=1e-9)
    assert abs(best.polynomial.coef[0]) <= best.angle + ROUND_OFF


def test_a_motion_through_a_change_point_is_refused(tmp_path):
    through = replace(PARALLELOGRAM, motion=swing(-30.0, 30.0, 60))
    with raises(InputError, match=r"'0 deg'.*change point"):
        measure_mimic(write_upright(tmp_path), "rocker_j", through)


def test_the_range_of_the_file_is_the_motion_of_a_scene_over_a_whole_turn(
    tmp_path, capsys
):
    turn = recommand(PARALLELOGRAM, angle=np.linspace(0.0, math.tau, 73))
    path = write_upright(tmp_path, pad="")
    limited = path.read_text().replace('name="drive"', 'name="drive" range="-40 20"')
    path.write_text(limited)
    report = measure_mimic(path, "rocker_j", turn)
    show_mimic(report)
    assert not re.search(r"e-\d", capsys.readouterr().out)  # round-off is 0
    # the crank stands at 90 deg
    assert np.degrees(report.swing) == approx((50.0, 110.0))
    assert angle_of(report) <= ROUND_OFF
    path.write_text(limited.replace("0 0.04 0", "0 0.03 0"))  # no end of a bar
    with raises(InputError, match=r"change point.*from -40 to 20 deg"):
        measure_mimic(path, "rocker_j", turn)


def write(folder, polycoef="0 0.8842 0 0 0", axis=1):
    path = folder / "mimic.xml"
    path.write_text(FILE.format(polycoef=polycoef, axis=axis))
    return path


def ask_mujoco(path):
    """Find the follower's position at each of the leader's.

    MuJoCo's own equality is satisfied at it.
    """
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    leader = np.radians(np.linspace(-40.0, 40.0, 41))
    follower = []
    for angle in leader:
        data.qpos[:] = (angle, 0.0)
        mujoco.mj_fwdPosition(model, data)
        follower.append(-data.efc_pos[0])  # the residual is y minus the polynomial
    return leader, np.array(follower)


def test_what_the_file_loses_through_its_own_zero(tmp_path):
    report = measure_mimic(write(tmp_path), "s", KNEE)
    smallest = [best.angle for best in report.fits[MINIMAX]]
    first, _, third, *_ = (one.angle for one in report.fits[SQUARES])
    angles = angle_of(report), report.shifted, report.centred, first, third
    figures = [1.7507, 1.2722, 0.8864, 1.2716, 0.0588, 0.0285]
    assert np.degrees([*angles, smallest[2]]) == approx(figures, abs=5e-5)
    assert math.degrees(smallest[0]) == approx(0.783, abs=5e-4)
    for ratio in (report.ratio, report.fits[SQUARES][0].ratio):
        assert ratio == approx(0.1267, abs=5e-5)
    assert smallest == sorted(smallest, reverse=True)
    leader, follower = ask_mujoco(write(tmp_path))
    branch = np.ones(len(leader), np.int8)
    theta_4 = solve(KNEE, "position", at=Command(leader, branch, None, 0.0)).theta_4
    off = np.abs(follower - (theta_4 - theta_4[20])).max()
    assert angle_of(report) == approx(off, rel=1e-9)


def test_each_error_stands_with_its_name(tmp_path, capsys):
    show_mimic(measure_mimic(write(tmp_path), "s", KNEE))
    out = capsys.readouterr().out
    assert max(map(len, out.splitlines())) <= 80
    sentences, _, table = out.partition("degree  fit")
    printed = " ".join(sentences.split())
    for words in (
        "1.7507 deg through the zero of the file",
        "1.2722 deg with the constant of least squares",
        "ratio omega_4/omega_2: 0.1267",
    ):
        assert words in printed
    lines = table.splitlines()[1:]
    cells = [re.split("  +", row.strip()) for row in lines[::2]]
    assert cells[0] == ["1", "least squares", "1.2716", "0.1267"]
    assert "".join(row[0] for row in cells) == "11223344"
    for polynomial in lines[1::2]:
        assert re.fullmatch(r" *polycoef( +\S+){5} *", polynomial)


@pytest.mark.slow
def test_an_axis_the_other_way_takes_the_opposite_polynomial(tmp_path):
    best = measure_mimic(write(tmp_path), "s", KNEE).fits[MINIMAX][2]
    opposite = " ".join(f"{-number!r}" for number in best.polynomial.coef.tolist())
    turned = measure_mimic(write(tmp_path, opposite, axis=-1), "s", KNEE)
    assert angle_of(turned) == approx(best.angle, rel=1e-9)


@pytest.mark.parametrize(
    "function, degree, smallest",
    [(np.square, 1, 0.5), (np.abs, 2, 0.125), (lambda x: x**3, 2, 0.25)],
)
def test_the_smallest_largest_error_is_that_of_the_textbooks(
    function, degree, smallest
):
    """Chebyshev's theorem.

    x^n is missed by 2^(1-n) by polynomials of degree n - 1, |x| by 1/8 by parabolas.
    """
    x = np.linspace(-1.0, 1.0, 2001)
    y = function(x)  # type: ignore[operator]
    left = fit_minimax(x, y, degree)(x) - y
    assert np.abs(left).max() == approx(smallest, rel=1e-5)


def test_an_include_may_lie_in_the_folder_of_assets(tmp_path):
    home, elsewhere = tmp_path / "a" / "b", tmp_path / "assets"
    for folder in (home, elsewhere):
        folder.mkdir(parents=True)
    text = write(elsewhere).read_text()
    inside = text.replace("mujoco>", "mujocoinclude>")
    (elsewhere / "mimic.xml").write_text(inside)
    path = home / "robot.xml"
    path.write_text('<mujoco><include file="mimic.xml"/></mujoco>')
    report = measure_mimic(path, "s", KNEE, elsewhere)
    assert report.equality.leader == "c"
    with raises(InputError, match="is not there"):
        measure_mimic(path, "s", KNEE)


def test_fewer_positions_than_a_fit_needs_are_refused(tmp_path):
    few = recommand(KNEE, angle=np.linspace(-0.5, 0.5, 5))
    with raises(InputError, match="range of at least 6 positions"):
        measure_mimic(write(tmp_path), "s", few)


def test_a_joint_that_follows_none_is_refused(tmp_path):
    with raises(InputError, match="follows no other"):
        measure_mimic(write(tmp_path), "c", KNEE)
    with raises(InputError, match="no such joint"):
        measure_mimic(write(tmp_path), "knee", KNEE)
    path = write(tmp_path)
    path.write_text(
        path.read_text().replace("<joint joint1", "<joint active='false' joint1")
    )
    with raises(InputError, match="the file has no active <joint"):
        measure_mimic(path, "s", KNEE)
    path = tmp_path / "leg.urdf"
    path.write_text(URDF.replace("<mimic", "<gone"))
    with raises(InputError, match="the file has no <mimic> in its knee"):
        measure_mimic(path, "knee", KNEE)


COUPLER = """<mujoco><worldbody><body name="crank"><joint name="j2" axis="0 0 1"/>
<geom type="capsule" fromto="0 0 0 .057 0 0" size=".003"/>
<body name="tip" pos=".057 0 0"><joint name="j3" axis="0 0 1"/>
<geom type="capsule" fromto="0 0 0 .022 0 0" size=".003"/></body></body>
</worldbody><equality><joint joint1="j3" joint2="j2" polycoef="0 -1 0 0 0"/></equality>
</mujoco>"""


COUPLER_SCENE = Scene(
    bare(0.02, 0.057, 0.022, 0.055),
    swing(30.0, 90.0, 60),
)


@pytest.mark.parametrize(
    "polycoef, angles, error, told",
    read_rows("""
0 -1 0 0 0 |  | nan | 7.4176 deg with the constant of least squares
0 -1 .1 0 0 |  | nan | of the file loses depends on theta_2 at that
0 -1 0 0 0 | 0deg | 38.65134 | theta_2 of the loop is -43.954 deg
"""),
)
def test_what_the_file_does_not_tell_is_stated_or_left_out(
    polycoef, angles, error, told, tmp_path, shown
):
    """The errors are those of pins B at the intersection of two circles."""
    path = tmp_path / "coupler.xml"
    path.write_text(COUPLER.replace("0 -1 0 0 0", polycoef))
    stated = {"theta_2": angles} if angles else {}
    report = measure_mimic(path, "j3", COUPLER_SCENE, angles=stated)
    assert math.degrees(angle_of(report)) == approx(float(error), nan_ok=True)
    printed = shown(report)
    assert told in printed
    assert ("a0 to a4 -0.3616111 -0.8158249 0 0 0" in printed) == (not angles)
    with raises(InputError, match=r"'j3'.*must be theta_2"):
        measure_mimic(path, "j3", COUPLER_SCENE, angles={"j3": "1 deg"})


LINK = """<link name="{0}"><inertial><origin xyz="{1} 0 0"/><mass value="0.02"/>
<inertia ixx="1e-6" ixy="0" ixz="0" iyy="3e-6" iyz="0" izz="3e-6"/></inertial></link>
<joint name="{0}_j" type="continuous"><origin xyz="{2} 0 0" rpy="0 0 {3}"/>
<parent link="palm"/><child link="{0}"/><axis xyz="0 0 1"/>{4}</joint>"""


@pytest.mark.parametrize(
    "millimetres, centres, rest, mimic, error, zero",
    read_rows("""
# bars at 85 deg and where the loop has the output: no end of the input
60 20 55 45 | 10 22 | 85 101.36063 | 0.3935185 0 | 1.57838 | 101.
# the loop closes at the zero, and is not what the file has there
60 20 55 45 | 10 22 | 0 0 | 0.3935185 1.2 | 0.84337 | is 0 deg
60 20 55 45 | 10 22 | -40 0 | 0.3935185 0.9252723 | 0.84337 | + p
# the loop is open at the zero, as the file has it
30 40 22 38 | 20 19 | 0 0 | 1.1 -0.4 | 29.01356 | is 0 deg
30 40 22 38 | 20 12 | 0 0 | 1.1 -0.4 | nan | not tell theta_4 there
30 40 22 38 | 12 19 | 0 0 | 1.1 -0.4 | nan | theta_2=ANGLE
"""),
)
def test_mass_centres_tell_where_the_bars_of_a_urdf_are(
    millimetres, centres, rest, mimic, error, zero, tmp_path, shown
):
    """The errors are those of pins B at the intersection of two circles."""
    ground, *moving = 1e-3 * np.array(millimetres.split(), float)
    near, far = 1e-3 * np.array(centres.split(), float)
    begin, end = np.radians(np.array(rest.split(), float))
    follow = '<mimic joint="prox_j" multiplier="{}" offset="{}"/>'.format(
        *mimic.split()
    )
    prox = LINK.format("prox", near, 0.0, begin, "")
    dist = LINK.format("dist", far, ground, end, follow)
    path = tmp_path / "finger.urdf"
    path.write_text(f'<robot name="finger"><link name="palm"/>{prox}{dist}</robot>')
    scene = Scene(bare(ground, *moving), swing(60.0, 110.0, 50))
    report = measure_mimic(path, "dist_j", scene)
    degrees = math.degrees(angle_of(report))
    assert degrees == approx(float(error), abs=2e-5, nan_ok=True)
    centred = 0.78919 if ground == 0.06 else 1.32753
    assert math.degrees(report.centred) == approx(centred, abs=2e-5)
    assert zero in shown(report)


@pytest.mark.parametrize("ground", [0.03, 0.04])
def test_the_zero_of_a_follower_on_the_crank_is_read_at_the_rocker(
    tmp_path, shown, ground
):
    """A coupler that stays parallel turns by -theta_2 on the crank.

    In a rhombus its hinge is as far from the crank's as the rocker's is.
    """
    path = write_upright(tmp_path)
    follow = '<joint joint1="pad" joint2="drive" polycoef="0 -1 0 0 0"/></equality>'
    text = path.read_text().replace("</equality>", follow)
    path.write_text(text.replace('pos="0.03 0 0"', f'pos="{ground} 0 0"'))
    level = replace(GRIPPER, linkage=bare(ground, 0.04, ground, 0.04))
    report = measure_mimic(path, "pad", level)
    assert max(angle_of(report), report.ratio) <= ROUND_OFF
    assert "theta_2 is 90 deg + drive, from 60 to 120 deg" in shown(report)


@pytest.mark.parametrize(
    "tree, bars",
    [
        ("(L)(F)", (4, 1)),
        ("(L(F))", (3, 2)),
        ("(L(C(F)))", (4, 3)),
        ("(L)(C(F))", (3, 4)),
    ],
)
def test_the_tree_tells_which_bars_a_follower_joins(tmp_path, tree, bars):
    body = '<body pos=".1 0 0"><joint name="{}" axis="0 0 1"/><geom size=".01"/>'
    bodies = tree.replace("(", "<").replace(")", "</body>")
    for name in "LCF":
        bodies = bodies.replace(f"<{name}", body.format(name))
    path = tmp_path / "tree.xml"
    path.write_text(
        f"<mujoco><worldbody>{bodies}</worldbody><equality>"
        '<joint joint1="F" joint2="L"/></equality></mujoco>'
    )
    assert measure_mimic(path, "F", GRIPPER).equality.bars == bars


KNUCKLE = """<mujoco><worldbody>
<body pos="-.024112 .136813 0"><joint name="lead" axis="0 0 -1" range="-36 36"/>
<geom type="capsule" fromto="0 0 0 -.047335 .064495 0" size=".003"/></body>
<body pos="-.01272 .1595 0"><joint name="knuckle" axis="0 0 1"/><geom size=".004"/>
</body></worldbody><equality><joint joint1="knuckle" joint2="lead"
polycoef="0 -1 0 0 0"/></equality></mujoco>"""
"""A finger without its output, whose leader is seen from behind in the file's plane."""
PINS = (
    (-0.024112, 0.136813),
    (-0.071447, 0.201308),
    (-0.061, 0.2242),
    (-0.01272, 0.1595),
)
AT_36 = swing(90.276, 162.276, 72)
BEHIND = {"theta_2": "126.2761691 deg"}


@pytest.mark.parametrize(
    "change, angles, told",
    [
        ({}, {}, "126.276 deg - lead, from 90.2762 to 162.276 deg, the range of the"),
        ({"motion": AT_36, "drawing": None}, {}, "126.276 deg - lead, from 90.276 to"),
        ({"drawing": None}, BEHIND, "126.276 deg - lead, from 90.2762 to 162.276 deg,"),
        ({"drawing": None}, {}, "is assumed, and --pose theta_2=ANGLE states another"),
    ],
)
def test_the_side_of_a_scene_is_that_of_its_drawing_its_range_or_stated(
    change, angles, told, tmp_path, shown
):
    """The errors are those of pins B at the intersection of two circles."""
    path = tmp_path / "knuckle.xml"
    path.write_text(KNUCKLE)
    drawn = recommand(fourbar.from_pins(*PINS), angle=None)
    scene = replace(drawn, **change)
    report = measure_mimic(path, "knuckle", scene, angles=angles)
    assert told in shown(report)
    assert report.equality.remark == ""
    if "another" not in told:
        errors = np.degrees([angle_of(report), report.centred])
        assert errors == approx([1.0203, 0.69427], abs=1e-4)
        # even powers tell the sense of theta_2
        assert report.fits[MINIMAX][1].polynomial.coef[2] == approx(0.01616, abs=1e-5)


@pytest.mark.parametrize("option", ["--key", "--hold", "--error"])
def test_an_option_that_would_be_ignored_is_refused(option, tmp_path, capsys):
    line = ["check-mjcf", "scene.toml", str(write(tmp_path)), "--mimic", "s"]
    assert status([*line, option, "1"]) == BAD_INPUT
    assert f"{option} has no use beside --mimic" in capsys.readouterr().err
