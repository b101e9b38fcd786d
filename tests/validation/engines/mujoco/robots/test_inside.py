"""A loop inside its robot.

MuJoCo asked a second way in the whole model, and the formulas of its scene. Every other
joint of the robot stands still.
"""

import math
from dataclasses import replace
from functools import cache

import mujoco
import numpy as np
import pytest
from pytest import approx
from scipy.optimize import bisect

import fourbar
from fourbar.errors import LimitError
from fourbar.files import load
from fourbar.mjcf import write_mjcf
from fourbar.scene import Command
from fourbar.scene.motion import CROSSED, OPEN
from fourbar.solving import solve
from fourbar_validation.compare.tolerance import magnitude
from fourbar_validation.engines.free_body import FreeBody
from fourbar_validation.engines.mujoco.robots.inside import LoopInside
from fourbar_validation.engines.mujoco.robots.loop_facts import (
    FORCE_QUANTITIES,
    make_motion,
)
from fourbar_validation.engines.mujoco.robots.loop_scene import make_loop_scene
from fourbar_validation.engines.mujoco.robots.measure import put_loop_inside
from fourbar_validation.engines.mujoco.robots.onto_scene import find_loop_of_scene
from fourbar_validation.places import MODELS
from tests.support.robots import (
    ADAPTIVE,
    AS_DRAWN,
    EXCAVATOR,
    FINGER,
    FOOT,
    GRIPPER,
    LIFTED,
    Planar,
    draw_knee,
    file_of,
    pose_loop,
)

ATTITUDE = GRIPPER.replace(
    '<body name="palm" pos="0 0 0.5">', '<body name="palm" euler="20 40 60">'
)
LOOPS = {
    "biped_foot": (FOOT, None, {}),
    "gripper": (GRIPPER, None, {}),
    "finger": (FINGER, "pip_link-middle", {}),
    "adaptive": (ADAPTIVE, "follower-coupler", {"held": ("spring_link",)}),
    "excavator": (EXCAVATOR, "bucket_linkage", {"drive": "rocker"}),
    "lifted": (LIFTED, "rod-arm", {}),
}
"""A file, the loop that is asked of it, and how it is posed; None: the first loop."""
SPRUNG = {
    "springs": Planar(joint='stiffness="2" springref="4.5"'),
    "springs wound beyond half a turn": Planar(joint='stiffness="0.5" springref="-4"'),
    "gravcomp": Planar(),
    "damping and friction": Planar(joint='damping="0.1" frictionloss="0.2"'),
    "output armature": Planar(cut="A", by="site"),
    "closure on the ground": Planar(cut="O4"),
    "axis the other way": Planar(
        axes={"O2": "0 0 -1", "A": "0 0 -1"}, joint='stiffness="1"'
    ),
}


def write_acting(name):
    """Write a four-bar on a hinge in which an effect acts."""
    planar = replace(SPRUNG[name], base='<joint name="base" axis="0 1 0"/>')
    text = planar.text()
    if name == "gravcomp":
        text = text.replace(
            '<body name="coupler"', '<body name="coupler" gravcomp="0.7"'
        )
    if name == "output armature":
        text = text.replace('name="O4" axis', 'name="O4" armature="0.02" axis')
        text = text.replace('name="O2" axis', 'name="O2" armature="0.03" axis')
    return text.replace('name="O2" ', 'name="O2" range="-0.5 0.4" limited="true" ')


WHOLE = {
    **LOOPS,
    "left finger": (GRIPPER, "left_finger-left_follower", {}),
    "in another attitude": (ATTITUDE, None, {"joints": {"wrist": "30deg"}}),
    "foot in a keyframe": (FOOT, None, {"key": "crouch"}),
    "gravcomp away from the mass centre": (
        FOOT.replace('<body name="toe"', '<body name="toe" gravcomp="1"'),
        None,
        {},
    ),
    **{name: (write_acting(name), None, {}) for name in SPRUNG},
}
REFSAFE = int(mujoco.mjtDisableBit.mjDSBL_REFSAFE)
ASKED_TWICE = 1e-6
"""Relative; the solver of the file stops at a tolerance of 1e-8 of its own."""
RIGID = 1e-8
"""Relative; the pose is closed to 1e-12 m and the scene has twelve digits."""


@cache
def open_loop(name):
    file, closing, pose = WHOLE[name]
    parts = pose_loop(file, closing, **pose)
    posed, loop = parts
    return LoopInside(posed.model, loop), make_loop_scene(*parts, 2.0)


def spread_over_range(inside, made, count):
    """Return angles of bar 2 in the loop's plane within its hinges' range, rad."""
    sweep = made.scene.motion.angle
    angles = np.linspace(sweep.start, sweep.stop, count + 2)[1:-1]
    angles = angles + _turn_back(inside, made)
    away = inside.loop.angles[1] - angles.mean()
    return np.asarray(angles + math.tau * round(away / math.tau))


def ask_again(inside, theta_2, alpha_2):
    """Find all joint forces at once by `mj_forward` alone.

    The hinges that are not driven are left to themselves. Newton's method on the
    accelerations of the driven and the held joints; then bisection on the couple.
    """
    state = inside.state(theta_2, 2.0)
    model, data = inside.model, mujoco.MjData(inside.model)
    moved = [inside.lead, *inside.held]
    wanted = np.zeros(len(moved))
    sense = inside.turn[inside.lead]
    wanted[0] = sense * alpha_2
    forces = np.zeros(len(moved))

    def accelerate(at):
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = state.qpos, state.qvel
        data.qfrc_applied[moved] = at
        mujoco.mj_forward(model, data)
        return data.qacc[moved].copy()

    for _ in range(8):
        left = wanted - accelerate(forces)
        slopes = np.empty((len(moved), len(moved)))
        for column in range(len(moved)):
            more = forces.copy()
            more[column] += 1e-3
            slopes[:, column] = (accelerate(more) - wanted + left) / 1e-3
        forces += np.linalg.solve(slopes, left)

    def miss(couple):
        forces[0] = couple
        return accelerate(forces)[0] - wanted[0]

    return sense * bisect(miss, forces[0] - 0.1, forces[0] + 0.1, xtol=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize("name", LOOPS)
def test_the_torque_is_the_one_that_mujoco_gives_when_asked_by_itself(name):
    inside, made = open_loop(name)
    theta_2 = float(spread_over_range(inside, made, 3)[-1])
    (row,) = inside.answer_states(make_motion([theta_2], (2.0, 3.0))).rows
    assert row.soft.torque == approx(ask_again(inside, theta_2, 3.0), rel=ASKED_TWICE)


@pytest.mark.parametrize("impedance", ["0.9999 0.9999", "0.95 0.95"])
def test_beside_a_huge_flywheel_a_soft_closure_has_the_force_of_its_equations(
    impedance,
):
    """M a + c - J^T f = tau and J a + R f = r, solved at once, a of the input given."""
    scene = load(MODELS / "crank_rocker.toml")
    text = write_mjcf(scene).replace("0.9999 0.9999", impedance)
    found = find_loop_of_scene(file_of(text), scene, AS_DRAWN)
    inside, motion = put_loop_inside(found)
    assert inside.flywheel > 1e6
    (row,) = inside.answer_states(make_motion([2.0], motion[0, 1:])).rows
    state = inside.state(2.0, row.speed)
    model, data = inside.model, mujoco.MjData(inside.model)
    data.qpos[:], data.qvel[:] = state.qpos, state.qvel
    mujoco.mj_forward(model, data)
    jacobian = data.efc_J[: data.nefc * model.nv].reshape(-1, model.nv)
    mass = np.zeros((model.nv, model.nv))
    for column, unit in enumerate(np.eye(model.nv)):
        mujoco.mj_mulM(model, data, mass[column], unit)
    bias = data.qfrc_bias - data.qfrc_passive - data.qfrc_actuator
    passive = [1, 2]
    equations = np.block(
        [
            [mass[np.ix_(passive, passive)], -jacobian[:, passive].T],
            [jacobian[:, passive], np.diag(data.efc_R[: data.nefc])],
        ]
    )
    right = np.concatenate([-bias[passive], data.efc_aref[: data.nefc]])
    solved = np.linalg.solve(equations, right)
    torque = mass[0, passive] @ solved[:2] + bias[0] - jacobian[:, 0] @ solved[2:]
    assert row.soft.torque == approx(torque, rel=ROUNDED)
    force = np.linalg.norm(solved[2:5])
    assert np.linalg.norm(row.soft["F43"]) == approx(force, rel=ROUNDED)


ROUNDED = 1e-12
"""Relative; 1e-15 as measured, and 4e-10 are from soft to rigid pins."""


@pytest.mark.parametrize("name", WHOLE)
def test_rigid_pins_in_the_robot_are_the_formulas_of_its_scene(name):
    """Multipliers on MuJoCo's mass matrix of the whole robot are the forces of a scene
    of three bars, and of its free bodies.
    """
    inside, made = open_loop(name)
    angles = spread_over_range(inside, made, 5)
    rows = inside.answer_states(make_motion(angles, (2.0, 3.0))).rows
    assert len(rows) == len(angles)
    branch = np.full(len(rows), made.scene.motion.branch, np.int8)
    command = Command(angles - _turn_back(inside, made), branch, 2.0, 3.0)
    formulas = solve(made.scene, "force", at=command)
    free_bodies = FreeBody().answer(made.scene, command).quantities
    for quantity in FORCE_QUANTITIES:
        rigid = rows.rigid[quantity]
        for right in (getattr(formulas, quantity), free_bodies[quantity]):
            size = magnitude(right).max()
            assert magnitude(rigid - right).max() <= RIGID * size


def _turn_back(inside, made):
    return inside.loop.angles[0] - made.scene.linkage.ground_angle


@pytest.mark.slow
def test_the_start_of_a_simulation_is_not_judged():
    """It begins exactly closed, where the loop has not yielded yet.

    The forces are those of a single state.
    """
    inside, _ = open_loop("excavator")
    assert inside.find_constant() == 0.02
    start = inside.loop.angles[1]
    motion = make_motion(start + np.linspace(0.0, 0.6, 31), (1.0, 0.0))
    through = inside.answer_through_time(motion)
    assert min(row.angle for row in through.rows) >= start + 0.1 - 1e-3
    errors, scales = through.errors(), through.scales(inside.loop.longest)
    single = inside.answer_states(motion[5:])
    settled = errors.max(axis=0) / scales
    assert settled.max() < 0.02
    assert (single.errors().max(axis=0) / scales > 10.0 * settled).all()


@pytest.mark.parametrize(
    "solref, flags, constant",
    [((0.02, 1), 0, 0.06), ((0.02, 1), REFSAFE, 0.02), ((-99, -50), 0, 0.04)],
)
def test_a_time_constant_below_two_timesteps_is_raised(solref, flags, constant):
    """MuJoCo does so, but where the closure states stiffness and damping."""
    inside, _ = open_loop.__wrapped__("finger")
    inside.model.opt.timestep = 0.03
    inside.model.opt.disableflags |= flags
    inside.model.eq_solref[inside.loop.equality] = solref
    assert inside.find_constant() == approx(constant)


def mirror(point, one, other):
    """Return a point mirrored in the line through two others, as complex numbers."""
    along = (other - one) / abs(other - one)
    return one + along**2 * (point - one).conjugate()


@pytest.mark.parametrize("turned", [-40.0, 40.0])
@pytest.mark.parametrize("drawn", [0, 180])
@pytest.mark.parametrize("bar", [2, 4])
@pytest.mark.parametrize("branch", [OPEN, CROSSED])
def test_a_loop_drawn_in_line_goes_on_in_the_assembly_of_the_branch(
    branch, bar, drawn, turned
):
    """The open one is the parallelogram, and the other its mirror image."""
    posed, loop = pose_loop(draw_knee(drawn))
    rates = {f"theta_{bar}": 0.0, f"omega_{bar}": 1.0}
    motion = fourbar.Motion(branch=branch, **rates)
    linkage = fourbar.uniform(*loop.lengths)
    scene = fourbar.Scene(linkage, motion, drive_bar=bar)
    inside = LoopInside(posed.model, loop, scene)
    angle = loop.angles[bar - 1] + math.radians(turned)
    state = inside.state(angle, 1.0)
    crank, _, knee = np.exp(1j * (state.qpos + math.radians(drawn))) * 0.03
    moved, follows = (crank, 0.25 + knee) if bar == 2 else (0.25 + knee, crank)
    wanted = moved + (0.25 if bar == 2 else -0.25)
    if branch == CROSSED:
        wanted = mirror(wanted, moved, 0.25 if bar == 2 else 0.0)
    assert follows == approx(wanted, abs=1e-9)


@pytest.mark.parametrize("speed, reason", [(2.0, "must be 1 to"), (0.0, "to rest")])
def test_one_position_is_no_motion_through_time(speed, reason):
    inside, _ = open_loop("finger")
    motion = make_motion([inside.loop.angles[1]], (speed, 0.0))
    with pytest.raises(LimitError, match=reason):
        inside.answer_through_time(motion)


def test_a_torque_meets_the_stops_of_the_file_after_a_motion_too():
    """A motion through time passes its ends by a step, and meets no stop there."""
    gaps = []
    for moves in (False, True):
        inside, _ = open_loop.__wrapped__("gripper")
        start = inside.loop.angles[1]
        if moves:
            motion = make_motion(start + np.linspace(0.0, 0.2, 5), (2.0, 0.0))
            inside.answer_through_time(motion)
        (state,) = inside.answer_under_torque([start], 5.0, 0.2)
        gaps.append(state.gap)
    assert gaps[0] == gaps[1]
