"""Closures of robots.

What makes a planar four-bar, and the reason where none is made.
"""

import math
from dataclasses import replace
from itertools import product

import mujoco
import numpy as np
import pytest
from pytest import approx, raises

from fourbar.errors import InputError
from fourbar.linkage import ENDS, PINS
from fourbar_validation.engines.mujoco.robots.closures import find_loops
from fourbar_validation.engines.mujoco.robots.seen import LoopFrame
from tests.support.robots import (
    ADAPTIVE,
    EXCAVATOR,
    TILT,
    Planar,
    forward,
    pose_loop,
    read_scene,
    report_of,
    rotation,
)
from tests.support.rows import read_rows

PLANAR = Planar()
TEXT = PLANAR.text()


def closure_of(text, **options):
    return report_of(text, **options).closures[0]


def loop_of(text, **options):
    closure = closure_of(text, **options)
    assert closure.loop is not None, closure.reason
    return closure.loop


CUTS = [*product(("A", "B", "O4"), ("anchor", "site")), ("B", "weld")]


@pytest.mark.parametrize("cut, by", CUTS)
def test_a_loop_is_where_its_pins_are_wherever_it_is_cut(cut, by):
    planar = Planar(cut=cut, by=by)
    loop = loop_of(planar.text())
    assert np.allclose(loop.lengths, planar.lengths(), rtol=1e-12)
    assert loop.cut == (None if by == "weld" else cut)
    model, data = forward(planar.text())
    hinges = {*PINS} - ({cut} if by != "weld" else set())
    named = {pin: model.joint(joint).name for pin, joint in loop.hinges.items()}
    assert named == {pin: pin for pin in hinges}
    assert loop.misaligned == approx(0.0, abs=1e-12)
    named = {bar: model.body(bodies[0]).name for bar, bodies in loop.bodies.items()}
    assert named == {1: "ground", 2: "input", 3: "coupler", 4: "output"}
    assert len(loop.bodies[3]) == (2 if by == "weld" else 1)
    turn = rotation(TILT)
    frame = LoopFrame(loop, data)
    for pin, bars in PINS.items():
        expected = np.array([1.0, 2.0, 3.0]) + turn @ [*planar.pins[pin], 0.0]
        for bar in bars:
            assert np.allclose(frame.locate(bar, pin), expected, atol=1e-12), (bar, pin)
    assert np.allclose(frame.normal, turn @ [0.0, 0.0, 1.0])
    # open again, each end of the closure is still on its own bar
    data.qpos[-3:] += (0.1, 0.2, 0.4)
    mujoco.mj_kinematics(model, data)
    for bar, length in zip(ENDS, loop.lengths, strict=True):
        if len(loop.bodies[bar]) == 1:
            assert abs(frame.line(bar)) == approx(length)


@pytest.mark.parametrize("sign", ["1", "-1"])
def test_angles_count_from_the_horizontal_and_with_the_driven_joint(sign):
    planar = Planar(axes={"O2": f"0 0 {sign}", "A": "0 0 -2"})
    text = planar.text()
    loop = loop_of(text)
    # gravity in the plane points down: its angle is -90 deg
    model = mujoco.MjModel.from_xml_string(text)
    normal = float(sign) * rotation(TILT)[:, 2]
    along = rotation(TILT) @ loop.axes[0]
    gravity = model.opt.gravity - (model.opt.gravity @ normal) * normal
    assert along @ gravity == approx(0.0, abs=1e-12)
    assert np.cross(normal, along) @ gravity < 0.0
    # the angles close the polygon, and turn the other way about the other axis
    sides = loop.lengths * np.exp(1j * np.array(loop.angles))
    assert abs(sides @ [-1.0, 1.0, 1.0, -1.0]) < 1e-12
    *_, three, four = loop.angles
    pins = {pin: complex(*place) for pin, place in planar.pins.items()}
    between = np.angle((pins["B"] - pins["O4"]) / (pins["B"] - pins["A"]))
    assert math.remainder(four - three - float(sign) * between, math.tau) == (
        approx(0.0, abs=1e-12)
    )
    assert loop.senses["O2"] == 1.0
    assert loop.senses["A"] == -float(sign)


FIVE_BAR = """
<mujoco><worldbody><body name="base">
<body name="a"><joint name="a" axis="0 1 0"/><geom size="0.01"/>
 <body name="b" pos="0 0 0.1">
  <joint name="b" axis="0 1 0"/><geom size="0.01"/></body></body>
<body name="c" pos="0.05 0 0"><joint name="c" axis="0 1 0"/><geom size="0.01"/>
 <body name="d" pos="0.02 0 0.12">
  <joint name="d" axis="0 1 0"/><geom size="0.01"/></body></body>
</body></worldbody>
<equality><connect name="tip" body1="b" body2="d" anchor="0.05 0 0.08"/></equality>
<actuator><motor name="one" joint="a"/>{more}</actuator></mujoco>
"""


ONE_MOTOR = FIVE_BAR.format(more="")


def test_five_hinges_are_a_four_bar_once_one_is_held():
    loop = loop_of(ONE_MOTOR, held=("d",))
    model = mujoco.MjModel.from_xml_string(ONE_MOTOR)
    assert loop.lengths == approx(
        (0.05, 0.1, math.hypot(0.05, 0.08), math.hypot(0.0, 0.18)),
        abs=1e-12,
    )
    assert model.joint(loop.joint).name == "a"
    assert model.joint("d").id in loop.held


SPRUNG = ONE_MOTOR.replace('joint name="c"', 'joint name="c" stiffness="2"')
TWO_MOTORS = FIVE_BAR.format(more='<motor name="two" joint="c"/>')

COAXIAL = ONE_MOTOR.replace('pos="0.02 0 0.12"', 'pos="0 0 0"')
TWICE_COAXIAL = COAXIAL.replace('pos="0 0 0.1"', 'pos="0 0 0"')


@pytest.mark.parametrize(
    "text, words",
    [
        (
            ONE_MOTOR,
            "5 hinges and 2 freedoms; --hold b (or c or d)",
        ),
        (ADAPTIVE, "--hold spring_link (or "),
        (SPRUNG, "--hold c (or b or d)"),
        (TWO_MOTORS, "--hold a (or c) makes it a four-bar"),
        (ONE_MOTOR.replace('<joint name="d"', "<joint"), "--hold b (or c or joint 3)"),
        (COAXIAL, "freedoms; --hold c (or d) makes it a four-bar"),
        (TWICE_COAXIAL, "freedoms: no hold makes it a four-bar"),
    ],
)
def test_what_to_hold_is_said(text, words):
    """The joint that a spring holds is the first, or those of motors are."""
    assert words in closure_of(text).reason


def test_of_two_motors_one_is_taken_as_driven():
    chosen = loop_of(TWO_MOTORS, held=("d",)).chosen
    assert "motors act on a, c: a is taken as driven" in chosen[0]
    assert not loop_of(TWO_MOTORS, held=("d",), drive="c").chosen


@pytest.mark.parametrize(
    "planar, words",
    [
        (Planar(axes={"A": "0 0.0524078 1"}), "A and O2 are 3 deg apart"),
        (Planar(equality='active="false"'), "switched off"),
        *(
            (Planar(more=f'<option><flag {of}="disable"/></option>'), "switched off")
            for of in ("equality", "constraint")
        ),
        (Planar(by="weld", cut="B", joint='type="slide"'), "slide"),
        (
            Planar({"O2": (0, 0), "A": (0.2, 0), "B": (0.55, 0), "O4": (0.8, 0)}),
            "it cannot move; an anchor is taken in the rest pose",
        ),
        (
            Planar(
                more=(
                    '<equality><connect body1="input" body2="output" anchor="0.1 0.1'
                    ' 0"/></equality>'
                )
            ),
            "no freedom is left",
        ),
    ],
)
def test_the_reason_is_given_where_it_is_no_four_bar(planar, words):
    closure = closure_of(planar.text())
    assert closure.loop is None
    assert words in closure.reason


YOKE = """
<mujoco><worldbody><body name="crank"><joint axis="0 1 0"/><geom size=".1"/>
 <body name="pin" pos="0 0 1"/></body>
 <body name="yoke"><joint type="slide"/><geom size=".1"/></body></worldbody>
 <equality><weld body1="pin" body2="yoke"/></equality></mujoco>"""


def test_a_weld_of_three_joints_leaves_no_freedom():
    reason = closure_of(YOKE).reason
    assert reason == "a weld that leaves no freedom: 2 joints in a plane cannot move"
    text = TEXT.replace("<connect", "<weld")
    assert "a weld that leaves no freedom: 3 hinges" in closure_of(text).reason
    pin = text.replace("<weld", '<weld torquescale="0"')
    # the anchor of a weld is in the frame of the second body
    pins = PLANAR.pins
    x, y = np.subtract(pins["B"], pins["A"])
    closed_at = (pins["O4"][0] + x, pins["O4"][1] + y)
    assert loop_of(pin).lengths[2:] == approx(
        (math.dist(pins["A"], closed_at), math.hypot(x, y))
    )


LINKS = """
<mujoco><default><joint axis="0 0 1"/><geom size=".01"/></default><worldbody>
<body name="a"><joint/><geom/><body name="b" pos=".1 .1 0"><joint/><geom/>
<body name="c" pos=".3 0 0"><joint/><geom/><body name="d" pos="0 -.1 0"><joint/><geom/>
</body></body></body></body></worldbody><equality><weld {}/></equality></mujoco>
"""


@pytest.mark.parametrize("ends", ['body1="d"', 'body1="world" body2="d"'])
def test_a_weld_may_join_halves_of_the_ground(ends):
    loop = loop_of(LINKS.format(ends))
    assert loop.bodies == {1: (0, 4), 2: (1,), 3: (2,), 4: (3,)}


def test_a_closure_of_what_hangs_on_a_bar_acts_on_it():
    pad = '<body name="pad"><joint axis="0 0 1" pos=".1 0 0"/><geom size=".01"/></body>'
    pin = '<equality><connect body1="pad" body2="ground" anchor="0 0 0"/></equality>'
    planar = Planar(on_coupler=pad, more=pin)
    assert loop_of(planar.text()).other_equalities == (1,)


@pytest.mark.parametrize("limited", ["", 'limited="true" range="0 3"'])
def test_a_hinge_in_place_of_a_ball_among_parallel_axes_is_what_to_type(limited):
    """The frame of the ball's body is tilted: its axis is not that of the others.

    What is advised makes the linkage of the pins.
    """
    joint = 'name="A" axis="0 0 1" '
    place = TEXT.index(joint)
    before = TEXT[:place]
    tilted = 'quat="0.6 0.8 0 0"><joint '
    opened = before.rindex("><joint ")
    start = before[:opened] + " " + tilted + 'name="A" '
    # the end of the coupler stays where it was: turned back by the same angle
    x, y = np.subtract(PLANAR.pins["B"], PLANAR.pins["A"]).tolist()
    _, there, z = (rotation((0.6, -0.8, 0.0, 0.0)) @ (x, y, 0.0)).tolist()
    end = TEXT[place + len(joint) :].replace(
        f'anchor="{x!r} {y!r} 0"', f'anchor="{x!r} {there!r} {z!r}"'
    )
    reason = closure_of(f'{start}type="ball" {limited}{end}').reason
    typed = reason.partition("(")[2].partition(" in the file)")[0]
    assert ("limited" in typed) == bool(limited)
    loop = loop_of(f"{start}{typed}{end}")
    assert loop.lengths == approx(PLANAR.lengths(), rel=1e-6)
    assert loop.misaligned < 1e-6


def test_a_ball_joint_and_a_floating_body_are_named():
    ball = TEXT.replace('name="A" axis="0 0 1"', 'name="A" type="ball"')
    assert "A is a ball joint, but the axes" in closure_of(ball).reason
    spatial = ball.replace('name="O4" axis="0 0 1"', 'name="O4" axis="1 0 0"')
    served = "MuJoCo or Drake serve it, Pinocchio its inverse dynamics"
    said = f"is a ball joint: the loop is spatial ({served})"
    assert closure_of(spatial).reason == f"A {said}"
    crossing = 'name="A" axis="0 0 1"/><joint name="across" axis="1 0 0"'
    hinges = TEXT.replace('name="A" axis="0 0 1"', crossing)
    assert "unless hinges in one place are a ball" in closure_of(hinges).reason
    lengths = loop_of(hinges, held=("across",)).lengths
    assert lengths == approx(PLANAR.lengths())
    two = ball.replace('name="O4" axis="0 0 1"', 'name="O4" type="ball"')
    assert closure_of(two).reason.endswith(said)
    loose = (
        '<mujoco><worldbody><body name="a"><freejoint name="float"/><geom'
        " size=\"1\"/></body></worldbody><equality><connect body1='a' anchor='0 0"
        " 0'/></equality></mujoco>"
    )
    assert closure_of(loose).reason == "float floats freely"


FLOATING = """
<mujoco><worldbody>
<body name="left" pos="-.5 0 0"><joint name="j2" axis="0 1 0"/>
 <geom type="capsule" size=".02" fromto="0 0 0 .5 0 .3"/><site name="C" pos=".5 0 .3"/>
 {inside}</body>
<body name="right" pos=".5 0 0"><joint name="j4" axis="0 1 0"/>
 <geom type="capsule" size=".02" fromto="0 0 0 -.5 0 .3"/>
 <site name="D" pos="-.5 0 .3"/></body>{outside}
</worldbody><equality>{pin}
<connect name="at_D" site1="D" site2="r"/></equality></mujoco>
"""
TOP = """
<body name="top" pos="{pos}">{joint}
 <geom type="capsule" size=".02" fromto="-.4 0 0 .4 0 0"/>
 <site name="l" pos="-.4 0 0"/><site name="r" pos=".4 0 0"/></body>
"""


def test_a_body_that_floats_between_two_pins_is_told_its_hinge():
    """With the hinge it is the four-bar of the bars that are drawn, m."""
    free = TOP.format(pos="0 0 .3", joint='<freejoint name="free"/>')
    pin = '<connect name="at_C" site1="C" site2="l"/>'
    for closure in report_of(
        FLOATING.format(inside="", outside=free, pin=pin)
    ).closures:
        assert closure.reason == (
            "free floats freely: with top inside left, on a hinge in place of its free"
            " joint and of at_C, at_D closes the loop"
        )
    third = pin + '<connect body1="top" anchor="0 0 0"/>'
    served = "MuJoCo or Drake serve it, Pinocchio its inverse dynamics"
    spatial = FLOATING.format(inside="", outside=free, pin=third)
    assert closure_of(spatial).reason == (
        f"free floats freely on 3 pins: several loops in one ({served})"
    )
    universal = '<joint axis="1 0 0"/><joint axis="0 1 0"/><joint type="slide" '
    legs = spatial.replace("<joint ", universal)
    assert "on 3 pins: several loops in one" in closure_of(legs).reason
    hinge = '<joint name="j3" axis="0 1 0" pos="-.4 0 0"/>'
    typed = TOP.format(pos=".9 0 .3", joint=hinge)
    loop = loop_of(FLOATING.format(inside=typed, outside="", pin=""))
    side = math.hypot(0.5, 0.3)
    assert loop.lengths == approx((1.0, side, 0.8, side), rel=1e-12)


def test_two_connects_along_one_axis_are_one_pin():
    second = '<connect body1="coupler" body2="output" anchor="0.22 0.09 0.02"/>'
    text = TEXT.replace("</equality>", f"{second}</equality>")
    report = report_of(text)
    one, other = report.closures
    assert (one.name, other.name) == ("coupler-output-1", "coupler-output-2")
    assert one.loop.closures == (0, 1)
    assert other.loop is not None
    posed, _ = pose_loop(text)
    (loop,) = find_loops(posed, None)
    assert loop.name == one.name
    said = f"{other.name} holds the same pin, and acts with {one.name}"
    assert loop.remarks == (said,)


@pytest.mark.parametrize(
    "tendon, mimic, words",
    [
        (
            "",
            '<joint joint1="O4" joint2="O2" polycoef="0.1 0.5 0 0 0"/>',
            "O4 follows O2, polycoef 0.1 0.5 0 0 0",
        ),
        (
            '<tendon><fixed name="T"><joint joint="O4" coef="2"/>'
            '<joint joint="O2" coef="-1"/></fixed></tendon>',
            '<tendon tendon1="T"/>',
            "O4 follows O2, polycoef 0 0.5 0 0 0",
        ),
    ],
)
def test_an_equality_of_joints_or_of_a_fixed_tendon_is_a_mimic(tendon, mimic, words):
    text = TEXT.replace("</equality>", f"{mimic}</equality>{tendon}")
    one, other = report_of(text).closures
    named = "T: tendon, no four-bar" if tendon else "O4-O2: joint, no four-bar"
    assert other.text.startswith(named)
    assert other.loop is None
    assert words in other.reason
    assert one.loop.other_equalities == (1,)
    text = text.replace(mimic, mimic.replace("/>", ' active="false"/>'))
    one, other = report_of(text).closures
    assert other.reason.startswith("it is switched off in the file")
    assert one.loop.other_equalities == ()


def test_behind_a_slide_that_follows_a_hinge_no_four_bar_stands():
    slide = (
        '<body name="rack"><joint name="rack" type="slide"/><geom size=".1"/></body>'
    )
    follow = '<joint joint1="rack" joint2="O2" polycoef="0 .1 0 0 0"/></equality>'
    text = Planar(ground=slide).text().replace("</equality>", follow)
    _, rack = report_of(text).closures
    assert rack.reason.endswith("(a slide is in it: no four-bar stands behind it)")


ROPE = '<tendon><fixed name="T"><joint joint="O2" coef="1"/></fixed></tendon>'


def test_a_tendon_over_other_joints_is_told_how_it_becomes_loops():
    more = f'{ROPE}<equality><tendon tendon1="T"/></equality>'
    _, tendon = report_of(Planar(more=more).text()).closures
    assert tendon.reason.startswith("a tendon equality is no pin; where it stands for")


ON_COUPLER = '<site name="c1" pos=".1 0 0"/><site name="c2" pos=".2 0 0"/>'
ON_GROUND = (
    '<site name="g1"/><site name="g2" pos="0 .2 0"/>'
    '<geom name="drum" type="sphere" size=".01" pos="0 .1 0" mass="0"/>'
)


@pytest.mark.parametrize(
    "path, acts",
    read_rows("""
<site site="c1"/><site site="g1"/> | 1
<site site="g1"/><geom geom="drum"/><site site="c1"/> | 1
<site site="c1"/><site site="c2"/> | 0
<site site="g1"/><geom geom="drum"/><site site="g2"/> | 0
<site site="c1"/><site site="c2"/><pulley divisor="2"/><site site="g1"/><site \
site="g2"/> | 0
"""),
)
def test_an_equality_of_a_spatial_tendon_acts_if_its_length_follows_the_bars(
    path, acts
):
    """MuJoCo's own derivative of the length tells, in a pose without symmetries."""
    tied = (
        '<equality><tendon tendon1="rope"/></equality>'
        f'<tendon><spatial name="rope">{path}</spatial></tendon>'
    )
    planar = Planar(on_coupler=ON_COUPLER, ground=ON_GROUND, more=tied)
    model, data = forward(planar.text())
    moved = np.zeros((1, model.nv))
    mujoco.mju_sparse2dense(
        moved, data.ten_J, model.ten_J_rownnz, model.ten_J_rowadr, model.ten_J_colind
    )
    assert bool(np.abs(moved).max() > 1e-3) == int(acts)
    assert loop_of(planar.text()).other_equalities == (1,) * int(acts)


def test_another_hinge_of_the_ground_can_be_the_driven_one():
    loop = loop_of(TEXT, drive="O4")
    d, a, b, c = PLANAR.lengths()
    assert loop.lengths == approx((d, c, b, a))
    assert loop.cut == "A"
    other = loop_of(TEXT, drive="O2").from_other_end
    if other.axes[2] @ loop.axes[2] < 0.0:
        other = other.seen_from_behind()
    for name in ("cut", "cut_bars", "bodies", "hinges", "senses"):
        assert getattr(other, name) == getattr(loop, name), name
    turned = np.subtract(other.angles, loop.angles)
    np.testing.assert_allclose(np.exp(1j * (turned - turned[0])), 1.0)
    assert other.lengths == approx(loop.lengths)
    np.testing.assert_allclose(np.linalg.det(other.seen_from_behind().axes), 1.0)
    with raises(InputError, match="drives no four-bar"):
        loop_of(TEXT, drive="A")
    with raises(InputError, match="no such joint; the file has: joint 0, O2"):
        loop_of(TEXT, drive="wheel")


def test_without_a_motor_the_first_hinge_of_the_ground_is_driven():
    model = mujoco.MjModel.from_xml_string(EXCAVATOR)
    loop = loop_of(EXCAVATOR)
    assert model.joint(loop.joint).name == "bucket"
    assert "no motor acts on it: bucket is taken as driven" in loop.chosen[0]
    assert loop_of(EXCAVATOR, drive="rocker").joint == model.joint("rocker").id


@pytest.mark.parametrize(
    "drive",
    [
        'site="tip" gear="1 0 0 0 0 0"',
        'site="tip" refsite="base" gear="1 0 0 0 0 0"',
        'tendon="rope"',
        'slidersite="base" cranksite="tip" cranklength="2"',
    ],
)
def test_what_drives_a_loop_by_no_hinge_is_named(drive):
    rope = (
        '<tendon><spatial name="rope"><site site="base"/><site site="tip"/>'
        '<site site="base"/></spatial>'
    )
    planar = Planar(
        drive="",
        ground='<site name="base"/>',
        on_coupler='<site name="tip" pos=".01 .02 0"/>',
        more=f'{rope}</tendon><actuator><motor name="push" {drive}/></actuator>',
    )
    (chosen,) = loop_of(planar.text()).chosen
    assert chosen == (
        "what drives it is on no hinge (the actuator push), and a couple gives other"
        " pin forces ([drive] from and to of a SCENE state a cylinder): O2 is taken as"
        " driven (--drive states another)"
    )


def test_a_loop_is_chosen_by_its_name():
    posed, loop = pose_loop(TEXT)
    (chosen,) = find_loops(posed, "coupler-output")
    assert chosen.name == loop.name == "coupler-output"
    with raises(InputError, match="the file has: coupler-output"):
        find_loops(posed, "knee")
    skew = replace(Planar(), axes={"A": "0 1 1"}).text()
    for name in ("coupler-output", None):
        with raises(InputError, match="four-bar: coupler-output: the axes"):
            read_scene(skew, name)
    again = '<connect body1="coupler" body2="output" anchor="0 0 0"/></equality>'
    with raises(InputError, match="loops says why of its 2 equalities"):
        read_scene(skew.replace("</equality>", again))


TWO_LOOPS = """
<mujoco><worldbody>
<body name="a"><joint name="m1" axis="0 0 1"/><geom size="0.01"/>
 <body name="b" pos=".1 .1 0"><joint name="b" axis="0 0 1"/><geom size="0.01"/>
  <body name="e" pos=".1 .1 0"><joint name="e" axis="0 0 1"/><geom size="0.01"/>
   <site name="e1" pos=".1 -.1 0"/>
   <body name="f" pos=".1 .1 0"><joint name="f" axis="0 0 1"/><geom size="0.01"/>
    <site name="f1" pos=".1 -.1 0"/></body></body></body></body>
<body name="g" pos=".2 0 0"><joint name="m2" axis="0 0 1"/><geom size="0.01"/>
 <site name="g1" pos=".1 .1 0"/>
 <body name="h" pos=".15 .1 0"><joint name="h" axis="0 0 1"/><geom size="0.01"/>
  <site name="h1" pos=".05 .1 0"/></body></body>
</worldbody><equality><connect name="loop1" site1="e1" site2="g1"/>
<connect name="loop2" site1="f1" site2="h1"/></equality>
<actuator><motor joint="m1"/><motor joint="m2"/></actuator></mujoco>
"""
"""Gruebler: 7 bars, 6 hinges and 2 pins leave 3 (7 - 1) - 2 (6 + 2) = 2 freedoms."""


@pytest.mark.parametrize(
    "held, counts, ground",
    [
        ((), "6 hinges, 2 loops and 2 freedoms: a six-bar once 1 of its", "g"),
        (("m2",), "5 hinges, 2 loops and 1 freedom: a six-bar (", "world"),
    ],
)
def test_loops_that_share_bars_are_counted_together(held, counts, ground):
    first, second = report_of(TWO_LOOPS, held=held).closures
    if held:  # a, b and e on the ground and g, whose pin is at (3, 1) dm
        sides = [math.hypot(0.3, 0.1), *[math.hypot(0.1, 0.1)] * 3]
        assert first.loop.lengths == approx(sides)
    else:
        # its bars belong to loop2 too, so no hold is offered
        assert "--hold" not in first.reason and "on g" not in first.reason
    assert second.loop is None
    assert f"with loop1, which moves its bars too, {counts}" in second.reason
    inner = f"e, f, h on {ground} (50.00, 200.0, 141.4, 111.8 mm) are a four-bar"
    assert f"{inner}, but e belongs to another loop too" in second.reason
    assert "--hold" not in second.reason and "motors" not in second.reason
    alone = TWO_LOOPS.replace('name="loop1"', 'name="loop1" active="false"')
    assert "loop1" not in report_of(alone, held=held).closures[1].reason


PUSHED = """
<mujoco><worldbody>
<body name="tube"><joint name="tube" axis="0 1 0"/><geom size=".01"/>
 <body name="rod" pos=".1 0 0"><joint name="rod" type="slide" axis="1 0 0"/>
  <geom size=".01"/>{tip}</body></body>
{lever}
<body name="bucket" pos=".6 0 0"><joint name="bucket" axis="0 1 0"/><geom size=".01"/>
 <body name="link" pos="0 0 .2"><joint name="link" axis="0 1 0"/><geom size=".01"/>
  <site name="far" pos="-.4 0 0"/></body></body>
</worldbody><equality><connect name="foot" site1="low" site2="foot"/>
<connect name="top" site1="near" site2="far"/></equality></mujoco>
"""
LEVER = """
<body name="lever" pos="{}"><joint name="lever" axis="0 1 0"/><geom size=".01"/>
 <site name="near" pos="{}"/><site name="low" pos="{}"/></body>
"""
"""The lever on the rod and its foot on the ground, and the other way round, m."""


def test_a_four_bar_whose_lever_hangs_on_a_slide_is_named_and_can_be_made_one():
    top = LEVER.format(".1 0 .1", "0 0 .1", "0 0 -.1")
    foot = '<site name="foot" pos=".2 0 0"/>'
    *_, closure = report_of(PUSHED.format(tip=top, lever=foot)).closures
    assert closure.reason.startswith("rod is a slide")
    assert closure.reason.endswith(
        "lever, link, bucket on world (400.0, 200.0, 400.0, 200.0 mm) are a four-bar,"
        " but lever belongs to another loop too"
    )
    low = LEVER.format(".2 0 0", "0 0 .2", "0 0 .1")
    tip = '<site name="foot" pos=".1 0 .1"/>'
    *_, closure = report_of(PUSHED.format(tip=tip, lever=low)).closures
    assert closure.loop is not None
    assert closure.loop.lengths == approx((0.4, 0.2, 0.4, 0.2))


STANDS = """
<mujoco><worldbody>
<body name="crank"><joint name="f" axis="0 1 0"/><geom size=".01"/>
 <body name="rod" pos="0 0 .07"><joint name="r" axis="0 1 0"/><geom size=".01"/></body>
</body>
<body name="base" pos=".05 0 0"><joint name="b" axis="0 1 0"/><geom size=".01"/>
 <body name="back"><joint name="e" axis="0 1 0"/><geom size=".01"/></body></body>
</worldbody><equality><connect body1="rod" body2="back" anchor=".05 0 0"/>
<connect body1="base" body2="crank" anchor="-.05 0 0"/></equality></mujoco>
"""


def test_a_bar_that_is_pinned_on_the_axis_of_another_hinge_stands():
    """Its bars are those of a parallelogram that the second closure does not hold."""
    finger, idle = report_of(STANDS).closures
    assert finger.loop is not None
    assert finger.loop.lengths == approx((0.05, 0.07, 0.05, 0.07))
    assert finger.loop.chosen[0].startswith("no motor acts on it: f is taken")
    assert idle.reason == (
        "it lies on the axis of f and leaves it free; b cannot turn by it, and counts"
        " as held"
    )


TRUSS = """
<mujoco><worldbody>
<body name="p"><joint name="h" type="slide"/><joint axis="0 1 0"/><geom size=".01"/>
 <body pos="0 0 .1"><joint axis="0 1 0"/><geom size=".01"/>
  <body pos=".03 0 .04"><joint axis="0 1 0"/><geom size=".01"/>
   <site name="b" pos=".04 0 .03"/></body></body></body>
<body name="q" pos="{} 0 0"><joint axis="0 1 0"/><geom size=".01"/>
 <body pos="0 0 .1"><joint axis="0 1 0"/><geom size=".01"/>
  <site name="c" pos="-.03 0 .07"/></body></body>
</worldbody><equality><connect body1="p" body2="q" anchor=".05 0 .05"/>
<connect site1="b" site2="c"/></equality></mujoco>
"""


def test_three_pins_of_a_triangle_stand_unless_two_are_on_one_axis():
    truss, four_bar = report_of(TRUSS.format(0.1), held=("h",)).closures
    assert truss.reason == "3 hinges in a plane cannot move"
    assert "; hinges " in truss.text
    assert four_bar.loop.lengths == approx((0.1, 0.05, 0.05, math.hypot(0.03, 0.07)))
    _, turning = report_of(TRUSS.format(0.0), held=("h",)).closures
    assert "moves its bars too" in turning.reason


TWO_FINGERS = """
<mujoco><worldbody>
<body pos="0 0 0"><joint axis="0 1 0"/><geom size=".01"/>
 <body pos="0 0 .1"><joint axis="0 1 0"/><geom size=".01"/>
  <body pos=".1 0 .05"><joint axis="0 1 0"/><geom size=".01"/>
   <site name="l1" pos="0 0 -.1"/></body></body></body>
<body pos=".1 0 0"><joint axis="0 1 0"/><geom size=".01"/>
 <site name="l2" pos="0 0 .05"/></body>
<body pos=".5 0 0"><joint axis="0 1 0"/><geom size=".01"/>
 <body pos="0 0 .1"><joint axis="0 1 0"/><geom size=".01"/>
  <body pos=".1 0 .05"><joint axis="0 1 0"/><geom size=".01"/>
   <site name="r1" pos="0 0 -.1"/></body></body></body>
<body pos=".6 0 0"><joint axis="0 1 0"/><geom size=".01"/>
 <site name="r2" pos="0 0 .05"/></body>
</worldbody><equality><connect name="l" site1="l1" site2="l2"/>
<connect name="r" site1="r1" site2="r2"/></equality></mujoco>
"""


def test_two_fingers_on_one_base_stay_apart():
    for closure in report_of(TWO_FINGERS).closures:
        assert closure.reason.startswith("5 hinges and 2 freedoms; --hold ")


def test_a_slide_is_no_hinge():
    *_, piston = report_of(EXCAVATOR).closures
    assert "hinges cylinder, rocker; other joints stroke (slide)" in piston.text


@pytest.mark.parametrize("cut, by", [("B", "anchor"), ("B", "weld")])
def test_a_slide_beside_four_pins_is_to_be_held(cut, by):
    """It lifts the input's bearing; with skew axes or in place of a pin it stays."""
    hinge = '<joint name="O2"'
    slide = '<joint name="lift" type="slide" axis="1 0 0"/>'
    planar = Planar(cut=cut, by=by)
    text = planar.text().replace(hinge, slide + hinge)
    assert closure_of(text).reason.endswith("; --hold lift makes it a four-bar")
    loop = loop_of(text, held=("lift",))
    assert loop.lengths == approx(planar.lengths(), rel=1e-12)
    skew = replace(planar, axes={"A": "0 0.1 1"}).text().replace(hinge, slide + hinge)
    guided = planar.text().replace('"O4" axis="0 0 1"', '"O4" type="slide"')
    coaxial = replace(planar, pins={**planar.pins, "O4": planar.pins["O2"]})
    coaxial = coaxial.text().replace(hinge, slide + hinge)
    for other in (guided, coaxial):
        reason = closure_of(other).reason
        assert "is a slide" in reason and "--hold" not in reason
    assert "5.71 deg apart: the loop is spatial" in closure_of(skew).reason
