"""What to type into a robot's file: typed, it does what was measured."""

import math
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from pytest import approx, raises
from scipy.optimize import brentq

from fourbar.errors import InputError
from fourbar_validation.engines.mujoco.robots.inside import LoopInside
from fourbar_validation.engines.mujoco.robots.loop_facts import (
    RobotFile,
    make_motion,
)
from fourbar_validation.engines.mujoco.robots.settings import (
    SOLVER,
    STIFFEST_IMPEDANCE,
    SettingsSearch,
    set_settings,
)
from fourbar_validation.places import MODELS
from fourbar_validation.robots.files import read_robot
from fourbar_validation.robots.loop_errors import (
    list_errors_by_method,
    read_measure_options,
)
from tests.support.robots import measure, pose_loop
from tests.support.rows import slow_but
from tests.support.scenes import find_angle, meet_circles

FOOT = MODELS / "robots" / "biped_foot.xml"
LIGHT_LOAD = 0.3
"""rad to either side of the pose."""


def find_loop(file):
    """Return the model of a robot with one loop, and the loop."""
    posed, loop = pose_loop(file)
    return posed.model, loop


def search(file):
    model, loop = find_loop(file)
    middle = loop.angles[1]
    angles = tuple(middle + LIGHT_LOAD * step / 4.0 for step in range(-4, 5))
    return SettingsSearch(LoopInside(model, loop), make_motion(angles, (2.0, 0.0)))


def paste(text, advice):
    """Put the elements that were printed in the place of those of the file."""
    for element in advice.typed:
        if element.startswith("<option"):
            text = text.replace('<option timestep="0.001" />', element)
        else:
            text = text.replace(
                '<connect name="rod" site1="rod_end" site2="heel" />', element
            )
        assert element in text
    return text


def test_what_is_set_in_a_model_is_read_from_it():
    """A search in the changed model has these settings for the file's own."""
    model, loop = find_loop(read_robot(FOOT))
    changes = {"integrator": "implicit", "timestep": "0.01", "iterations": "7"}
    changes |= {"solver": "CG", "tolerance": "0.001", "solref": "0.1 0.5"}
    changes["solimp"] = STIFFEST_IMPEDANCE
    motion = make_motion((loop.angles[1],), (2.0, 0.0))
    finer = {"iterations": "200", "tolerance": "1e-12"}
    own, others, fine = (
        SettingsSearch(LoopInside(set_settings(model, loop, one), loop), motion)
        for one in ({}, changes, finer)
    )
    assert others.own == own.own | changes
    assert all(own.own[name] != changes[name] for name in changes)
    assert own.solver == {"tolerance": "1e-10"}
    assert others.solver == SOLVER and fine.solver == {}


def test_what_steps_faster_changes_less_and_is_softer_is_tried_first():
    rank = search(read_robot(FOOT))._rank
    order = [
        {"timestep": "0.002"},
        {},
        {"solref": "0.004 1"},
        {"solref": "0.002 1"},
        {"solref": "0.002 1", "solimp": STIFFEST_IMPEDANCE},
        {"timestep": "0.0005"},
        {"integrator": "RK4"},
    ]
    assert sorted(reversed(order), key=rank) == order


@pytest.mark.slow
def test_what_is_typed_reaches_the_error_that_was_wanted():
    file = read_robot(FOOT)
    advice = search(file).advise(2e-3, file)
    assert advice.reached and advice.best.error <= 2e-3 < advice.before.error
    own = search(file).own
    assert own["solref"] == "0.005 1"
    typed = search(replace(file, text=paste(file.text, advice)))
    assert typed.own == own | advice.best.changes
    again = typed.measure({})
    assert again.error == approx(advice.best.error, rel=1e-3)


LIMIT = find_angle(0.12 + 0.15, 0.2, 0.3)
"""rad; coupler and output are stretched there."""
NEAR = math.radians(1.0)
ONE_STEP = 2e-3
"""rad; a simulation is read at its own steps, of 1 ms at 1 rad/s."""


def bend(angle):
    """Return pins A and B of the leg at an angle of its crank, m."""
    pin = 0.2 * complex(math.cos(angle), math.sin(angle))
    return pin, complex(meet_circles(pin, 0.3, 0.12, 0.15))


def write_leg(sense):
    """Write a leg that is drawn at 10 deg and whose knee stops beside its limit."""
    start = math.radians(10.0)
    pin, knee = bend(start)
    stop = LIMIT - NEAR - start
    ends = (0.0, stop) if sense > 0 else (-stop, 0.0)

    def place(point):
        return f"{point.real!r} 0 {point.imag!r}"

    return RobotFile(
        Path("leg.xml"),
        f"""<mujoco><compiler angle="radian"/><option integrator="RK4" timestep=".001"/>
        <default><geom type="capsule" size="0.008" density="2700"/></default>
        <worldbody><body name="thigh"><geom fromto="0 0 0 0.3 0 0"/>
        <body name="crank"><joint name="knee" axis="0 {-sense} 0" limited="true"
        range="{ends[0]!r} {ends[1]!r}"/><geom fromto="0 0 0 {place(pin)}"/>
        <body name="rod" pos="{place(pin)}"><joint name="rod" axis="0 -1 0"/>
        <geom fromto="0 0 0 {place(knee - pin)}"/></body></body>
        <body name="shank" pos="0.3 0 0"><joint name="shank" axis="0 -1 0"/>
        <geom fromto="0 0 0 {place(knee - 0.3)}"/></body></body></worldbody>
        <equality><connect body1="rod" body2="shank" anchor="{place(knee - pin)}"/>
        </equality></mujoco>""",
    )


@pytest.mark.slow
def test_states_beside_a_limit_decide_and_the_range_without_them_is_named():
    """The range is measured again, and the whole motion is not within the error."""
    wanted = 1e-4
    model, loop = find_loop(write_leg(1))
    first, last = loop.angles[1], loop.angles[1] + LIMIT - NEAR - math.radians(10.0)
    angles = [first + (last - first) * step / 8 for step in range(9)]

    def search(low, high):
        motion = make_motion(angles[low : high + 1], (2.0, 0.0))
        return SettingsSearch(LoopInside(model, loop), motion)

    whole = search(0, 8)
    stiff = {"solimp": STIFFEST_IMPEDANCE}
    error = whole.measure(stiff).error
    assert error > 2.0 * wanted
    deciding = whole.measure(stiff).deciding
    assert deciding.error == approx(error, rel=1e-9)
    assert deciding.angle == approx(last, abs=1e-2)
    within = whole.find_range(stiff, wanted)
    count = min(range(9), key=lambda step: abs(angles[step] - first - within[1]))
    assert within[0] == approx(0.0, abs=1e-9) and 4 < count < 8
    assert search(0, count).measure(stiff).error <= wanted
    assert search(0, 8).find_range(stiff, 1e-12) is None


TURN = find_angle(0.15, 0.32, 0.3)
"""rad; crank and rod are in line there, and the shank turns back."""
LOSS = 1.0
"""N m."""


def couple_in_plain_mujoco(text, angle, speed):
    """Find what turns the crank of the leg uniformly, N m, and omega_4 over omega_2."""

    def turns(angle):
        pin, knee = bend(angle)
        bars = np.angle([pin, knee - pin, knee - 0.3])
        return np.array([bars[0], bars[1] - bars[0], bars[2]])

    model = mujoco.MjModel.from_xml_string(text)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_LIMIT)
    data = mujoco.MjData(model)
    rates = (turns(angle + 1e-6) - turns(angle - 1e-6)) / 2e-6

    def accelerate(couple):
        mujoco.mj_resetData(model, data)
        data.qpos[:] = turns(angle) - turns(math.radians(10.0))
        data.qvel[:] = rates * speed
        data.qfrc_applied[0] = couple
        mujoco.mj_forward(model, data)
        return data.qacc[0]

    return brentq(accelerate, -10.0, 10.0, xtol=1e-12), rates[2]


@pytest.mark.slow
def test_dry_friction_that_pushes_a_hinge_on_gets_settings_of_its_own():
    """Dry friction asks for its couple times |omega_4 / omega_2|: virtual work."""
    speed = 10.0
    leg = write_leg(1)
    free = '<joint axis="0 -1 0"'  # without a name
    leg = replace(leg, text=leg.text.replace('<joint name="shank"', "<joint"))
    file = replace(leg, text=leg.text.replace(free, f'{free} frictionloss="{LOSS}"'))
    model, loop = find_loop(file)
    first = loop.angles[1] + TURN - math.radians(10.0)
    angles = tuple(first + math.radians(6.0 * step - 15.0) for step in range(9))
    motion = make_motion(angles, (speed, 0.0))
    search = SettingsSearch(LoopInside(model, loop), motion)
    advice = search.advise(0.01, file)
    assert advice.reached and "solreffriction" in advice.best.changes
    closure, joint = (one.removesuffix(" />") for one in advice.typed[-2:])
    plain = closure[: closure.index(" sol")]
    assert plain in leg.text and joint.startswith(f'{free} frictionloss="{LOSS}" sol')

    def ask(hinge):
        text = leg.text.replace(plain, closure).replace(free, hinge)
        return couple_in_plain_mujoco(text, TURN - math.radians(3.0), speed)

    smooth, rate = ask(free)
    due = LOSS * abs(rate)
    assert ask(joint)[0] - smooth == approx(due, rel=0.02)
    assert ask(f'{free} frictionloss="{LOSS}"')[0] - smooth < 0.0


@pytest.mark.slow
@pytest.mark.parametrize("sense", slow_but({-1}, [1, -1]))
def test_a_range_is_that_of_the_driven_joint(sense):
    span = (0.2, 0.6) if sense > 0 else (-0.6, -0.2)
    loop = measure(write_leg(sense), span=span)
    joints = [row.joint for row in loop.states.rows]
    assert (min(joints), max(joints)) == approx(span, abs=1e-9)
    far = [error.joint for error in list_errors_by_method(loop)]
    low, high = (span[0] - ONE_STEP, span[1] + ONE_STEP)
    assert all(low <= joint <= high for joint in far)
    loop = measure(write_leg(sense), span=(-9.0, 9.0))
    assert any("--range is cut to the motion of knee, " in one for one in loop.remarks)
    with raises(InputError, match="must overlap the motion of knee, "):
        measure(write_leg(sense), span=(2.0, 3.0))


@pytest.mark.parametrize(
    "text, message",
    [("-40deg", "two angles"), ("30deg,-40deg", "begin below"), ("1deg,2m", "--range")],
)
def test_a_range_is_two_angles(text, message):
    robot = {"pose": (), "key": None, "hold": (), "drive": None, "speed": None}
    read = read_measure_options(None, None, {**robot, "span": "-40deg, 0.5 rad"})
    assert read.span == approx((math.radians(-40.0), 0.5))
    with raises(InputError, match=message):
        read_measure_options(None, None, {**robot, "span": text})
