"""Files of `fourbar mjcf --for` and `fourbar sdf` are read as their comments say."""

import cmath
import importlib
import re
import tempfile
from dataclasses import replace
from functools import partial
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from pytest import approx

import fourbar
from fourbar import Friction, Gravity, Motion, Viscous, solve
from fourbar.effects import Torsion
from fourbar.errors import LimitError
from fourbar.mjcf import SIMULATORS, write_mjcf_for
from fourbar.mjcf.assembly import write_sdf, write_usd
from fourbar.quantities import Array
from fourbar.scene import Command
from fourbar_validation.scenes.suites import list_model_files
from tests.support.scenes import crank_rocker

STEPS = 20
NUMBER = r"-?[\d.]+(?:e-?\d+)?"


Read = tuple[Array, Array, Array, float, Array]
"""Angles, speeds and accelerations of the joints, T2, and the pin force at B."""


def errors(scene, read):
    """Of T2 and of the pin force at B, by their greatest value in a turn.

    The formulas are at the simulator's own angle, speed and acceleration, and the file
    drives bar 2 whatever the scene.
    """
    q, v, a, torque, force = read
    scene = replace(scene, drive_bar=2)
    state = (q[0], 1, v[0], a[0])
    command = Command(*(np.array([x]) for x in state))
    expected, turn = solve(scene, at=command), solve(scene)
    apart = np.hypot(*(force - expected.F43[0])) / np.hypot(*turn.F43.T).max()
    of_torque = abs(torque - expected.torque[0]) / np.abs(turn.torque).max()
    return of_torque, float(apart)


def start_mujoco(text):
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    return model, data


def read_state(model, state, force, world=...):
    """As the comment of the file says."""
    parts = state.qpos, state.qvel, state.qacc, state.actuator_force
    q, v, a, drive = (_to_numpy(part)[world].astype(float) for part in parts)
    torque = drive[model.actuator("drive").id] - model.dof_armature[0] * a[0]
    return q, v, a, float(torque), _to_numpy(force)[world][:2].astype(float)


def _to_numpy(array):
    return array.numpy() if hasattr(array, "numpy") else np.asarray(array)


def read_mujoco(text, forward):
    import mujoco

    model, data = start_mujoco(text)
    mujoco.mj_step(model, data, STEPS)
    for _ in range(forward):
        mujoco.mj_forward(model, data)
    return read_state(model, data, data.efc_force)


def read_warp(text, forward):
    """The kernels compile for minutes the first time."""
    mjw = pytest.importorskip("mujoco_warp")
    model, data = start_mujoco(text)
    theirs, state = mjw.put_model(model), mjw.put_data(model, data)
    for _ in range(STEPS):
        mjw.step(theirs, state)
    for _ in range(forward):
        mjw.forward(theirs, state)
    return read_state(model, state, state.efc.force, 0)


def read_mjx(text, steps):
    mjx = pytest.importorskip("mujoco.mjx")
    jax = importlib.import_module("jax")
    jax.config.update("jax_enable_x64", True)
    model, data = start_mujoco(text)
    theirs, state = mjx.put_model(model), mjx.put_data(model, data)
    step = jax.jit(mjx.step)
    for _ in range(steps):
        state = step(theirs, state)
    state = jax.jit(mjx.forward)(theirs, state)
    return read_state(model, state, getattr(state, "_impl", state).efc_force)


def keyframe(text):
    """Speeds of the keyframe, and the timestep."""
    root = ET.fromstring(text)
    speeds = root.find("keyframe/key").get("qvel").split()
    timestep = root.find("option").get("timestep")
    return np.array(speeds, dtype=float), float(str(timestep))


def read_genesis(file, steps):
    """As the comment of the file says."""
    gs = pytest.importorskip("genesis")
    text = file.read_text()
    speeds, timestep = keyframe(text)
    options = {"dt": timestep, "gravity": (0.0, -9.81, 0.0)}
    world = gs.Scene(
        sim_options=gs.options.SimOptions(**options),
        rigid_options=gs.options.RigidOptions(**options),
        show_viewer=False,
    )
    bars = world.add_entity(gs.morphs.MJCF(file=str(file), default_armature=None))
    world.build()
    bars.set_dofs_velocity(speeds)
    for _ in range(steps):
        world.step()
    q, v = (x.cpu().numpy().copy() for x in (bars.get_qpos(), bars.get_dofs_velocity()))
    world.step()
    a = world.sim.rigid_solver.get_dofs_acc().cpu().numpy().ravel()
    torque = -float(bars.get_dofs_armature()[0]) * float(a[0])
    solver = world.sim.rigid_solver.constraint_solver
    return q, v, a, torque, solver.efc_force.to_numpy()[:2].ravel()


def read_newton(file, steps):
    """As the comment of the file says."""
    newton = pytest.importorskip("newton")
    speeds, timestep = keyframe(file.read_text())
    builder = newton.ModelBuilder(gravity=(0.0, -9.81, 0.0))
    builder.add_mjcf(str(file))
    model = builder.finalize(device="cpu")
    solver, now, then = newton.solvers.SolverMuJoCo(model), model.state(), model.state()
    start = now.joint_qd.numpy()
    assert not now.joint_q.numpy()[:3].any()
    start[:3] = speeds
    now.joint_qd.assign(start)
    for _ in range(steps):
        solver.step(now, then, model.control(), None, timestep)
        now, then = then, now
    data, mjw = solver.mjw_data, importlib.import_module("mujoco_warp")
    for _ in range(2):
        mjw.forward(solver.mjw_model, data)
    return read_state(solver.mj_model, data, data.efc.force, 0)


MIDWAY = 200
"""Steps after which the closures have settled from the exact start."""


JOINTS = (Gravity(), Viscous.at(A=0.05), Friction.at(O4=0.1))
KEPT = crank_rocker(
    motion=Motion(fourbar.Sweep(0.4, 0.4 + 2.0 * np.pi, 60), 10.0),
    loads=(),
    effects=JOINTS,
)
"""All of it is in a file for Genesis."""
ENDS = fourbar.effects.Place(1, (0.1, -1.5)), fourbar.effects.Place(3, (0.08, 0.3))
WHOLE = crank_rocker(
    motion=KEPT.motion,
    effects=(*JOINTS, fourbar.Springs((fourbar.Spring(*ENDS, 200.0, 0.02),))),
)
STIFF = replace(KEPT, effects=(*JOINTS, Torsion.at(O4=(0.5, 0.2, 0.1))))


def test_a_file_for_genesis_names_what_it_leaves_out():
    at_B = (
        Viscous.at(A=0.05, B=0.1),
        Friction.at(B=0.2),
        Torsion.at(B=(1, 0, 0)),
    )
    for scene, names in (
        (KEPT, []),
        (WHOLE, ["loads, springs"]),
        (STIFF, ["rest angles of torsion (it rests as assembled)"]),
        (replace(KEPT, effects=at_B), ["viscous at B, friction at B, torsion at B"]),
    ):
        assert (
            re.findall(r"it leaves out ([^.]*)\. ", write_mjcf_for(scene, "genesis"))
            == names
        )


@pytest.fixture
def _genesis():
    """Genesis, which starts once in a process.

    The next test may want other settings.
    """
    gs = pytest.importorskip("genesis")
    gs.init(backend=gs.cpu, precision="64", logging_level="error")
    yield
    gs.destroy()


@pytest.mark.nightly
@pytest.mark.usefixtures("_genesis")
def test_genesis_reads_as_the_comment_says(tmp_path):
    assembled = float(solve(KEPT, "position").theta_4[0]) - KEPT.linkage.ground_angle
    resting = replace(KEPT, effects=(*JOINTS, Torsion.at(O4=(0.5, assembled, 0.0))))
    faster = replace(WHOLE, motion=KEPT.motion.replace(acceleration=30.0))
    for scene, moves_as in (
        (KEPT, KEPT),
        (WHOLE, KEPT),
        (faster, KEPT),
        (STIFF, resting),
    ):
        (file := tmp_path / "four_bar.xml").write_text(write_mjcf_for(scene, "genesis"))
        read = read_genesis(file, MIDWAY)
        assert max(errors(moves_as, read)) < YIELDING
        assert read[1][0] == approx(10.0, rel=1e-6), (
            "the keyframe's speed, of an accelerated scene too"
        )


@pytest.mark.nightly
def test_newton_reads_the_mjcf_as_the_comment_says(tmp_path):
    for motion in (Motion(1.0, 10.0), Motion(1.0, 10.0, 30.0)):
        scene = crank_rocker(motion=motion, drive_bar=4)
        (file := tmp_path / "four_bar.xml").write_text(write_mjcf_for(scene, "newton"))
        read = read_newton(file, MIDWAY)
        assert max(errors(scene, read)) < SINGLE
        assert read[2][0] == approx(motion.acceleration, abs=0.01)


SINGLE = 1e-2
"""Of MuJoCo Warp: single precision in a closure of impedance 0.9999 keeps 1e4
roundings; measured 2.5e-3 in a turn.
"""
YIELDING = 1e-2
"""Of MJX, whose closure makes up for the missing term by yielding; measured 8.5e-4 in a
turn.
"""


@pytest.mark.nightly
def test_warp_reads_as_the_comment_says():
    scene = crank_rocker(drive_bar=4)
    text = write_mjcf_for(scene, "warp")
    assert max(errors(scene, read_warp(text, forward=2))) < SINGLE
    assert "forward twice" in text


@pytest.mark.nightly
def test_mjx_reads_as_the_comment_says():
    scene = crank_rocker(drive_bar=4)
    assert max(errors(scene, read_mjx(write_mjcf_for(scene, "mjx"), STEPS))) < YIELDING
    assert max(errors(scene, read_mjx(write_mjcf_for(scene, "mjx"), 0))) > 0.1, (
        "a state that was only set"
    )


@pytest.mark.parametrize("simulator", SIMULATORS)
def test_each_file_loads_in_mujoco_and_runs(simulator):
    """Single precision, pads or none: MuJoCo itself carries all of them."""
    scene = crank_rocker()
    assert (
        max(errors(scene, read_mujoco(write_mjcf_for(scene, simulator), forward=1)))
        < CARRIED
    )


CARRIED = 2e-3
"""Of a closure with a time constant of two timesteps; measured 1.4e-3, the others 1e-5
and less.
"""


def released(**changes):
    """A linkage let go under its weight, with a damper."""
    motion = Motion(1.0, 3.0, free=fourbar.Free(0.2, 2))
    effects = (Gravity(), Viscous.at(O2=0.05))
    return crank_rocker(
        **({"motion": motion, "effects": effects, "loads": ()} | changes)
    )


FIRST_ORDER = 0.5
"""Drake's discrete plant errs as its step: half the step leaves half the error, within
this factor of two.
"""


FORCE = 0.01
"""Of Drake's reaction at A after 200 steps of 1 ms, of first order; measured 1.1e-3."""


@pytest.mark.nightly
@pytest.mark.slow
def test_drake_loads_the_sdf_and_moves_as_released():
    pytest.importorskip("pydrake")
    plants, parsing = (
        importlib.import_module(f"pydrake.multibody.{name}")
        for name in ("plant", "parsing")
    )
    simulator = importlib.import_module("pydrake.systems.analysis").Simulator
    scene = released()
    text = write_sdf(scene, "drake")
    theta_2, theta_3, _, *speeds = (
        float(x) for x in re.findall(r"(-?[\d.]+(?:e-?\d+)?) rad", text)
    )
    ours, missed, pulls = solve(scene), [], []
    for step in (1e-3, 5e-4):
        plant = plants.MultibodyPlant(step)
        plant.set_discrete_contact_approximation(
            plants.DiscreteContactApproximation.kSap
        )
        parsing.Parser(plant).AddModelsFromString(text, "sdf")
        plant.mutable_gravity_field().set_gravity_vector([0.0, -9.81, 0.0])
        plant.Finalize()
        context = plant.CreateDefaultContext()
        for name, speed in zip(("O2", "A", "O4"), speeds, strict=True):
            plant.GetJointByName(name).set_angular_rate(context, speed)
        simulator(plant, context).AdvanceTo(0.2)
        missed.append(
            theta_2 + plant.GetJointByName("O2").get_angle(context) - ours.theta_2[-1]
        )
        joint = plant.GetJointByName("A")
        on_3 = (
            plant.get_reaction_forces_output_port()
            .Eval(context)[int(joint.index())]
            .translational()[:2]
        )
        turned = (
            theta_3
            + plant.GetJointByName("O2").get_angle(context)
            + joint.get_angle(context)
        )
        pulls.append(
            abs(complex(*on_3) * cmath.exp(1j * turned) + complex(*ours.F32[-1]))
        )
    assert pulls[0] < FORCE * abs(complex(*ours.F32[-1])), (
        "the force at A as the comment says"
    )
    assert abs(missed[1]) < 1e-2
    assert missed[1] / missed[0] == approx(
        0.5,
        rel=FIRST_ORDER,
    )


def test_the_pin_at_B_alone_closes_the_loop_from_outside():
    sdf, usd = write_sdf(released()), write_usd(released(effects=()))
    assert re.findall(r'joint name="(\w+)"', sdf) == [
        "ground_on_world",
        "O2",
        "A",
        "O4",
        "B",
    ]
    assert re.findall(r'Joint "(\w+)"', usd) == ["O2", "A", "O4", "B"]
    assert re.findall(r"Articulation = (\w+)", usd) == [
        "false",
        "false",
        "false",
        "true",
    ]


LOADED = crank_rocker(loads=(fourbar.Load(4, moment=1.0),))
AT_B = (Viscous.at(B=1.0),)


@pytest.mark.parametrize(
    "write, scene, words",
    [
        (
            write_sdf,
            LOADED,
            r"^loads \(here on bar 4\) have no counterpart in SDF for gazebo",
        ),
        (
            partial(write_sdf, reader="drake"),
            released(effects=(Torsion.at(O2=(1.0, 0.0, 0.0)),)),
            "torsion",
        ),
        (partial(write_sdf, reader="drake"), released(effects=AT_B), "pin B"),
        (write_usd, LOADED, "no counterpart in USD"),
        (write_usd, released(effects=AT_B), "no counterpart in USD"),
    ],
)
def test_what_a_file_cannot_hold_is_refused(write, scene, words):
    with pytest.raises(LimitError, match=words):
        write(scene)


@pytest.mark.parametrize(
    "write", [write_sdf, partial(write_sdf, reader="drake"), write_usd]
)
def test_without_loads_every_model_is_written_and_says_how_to_start(write):
    for file in list_model_files():
        scene = fourbar.load(file)
        text = write(scene, without_loads=True)
        assert "loads are left out" in text and f"puts on bar {scene.drive_bar}" in text
        stated = [float(x) for x in re.findall(rf"({NUMBER}) rad", text)][:6]
        theta_2, omega_2 = stated[0], stated[3]
        command = Command(
            np.array([theta_2]), np.array([scene.motion.branch]), omega_2, 0.0
        )
        s = solve(scene, "velocity", at=command)
        assert omega_2 == scene.motion.omega_2
        expected = [s.theta_3[0], s.theta_4[0], s.omega_3[0] - omega_2, s.omega_4[0]]
        written = [*stated[1:3], *stated[4:]]
        assert (
            np.abs(
                np.exp(1j * np.array(written[:2])) - np.exp(1j * np.array(expected[:2]))
            ).max()
            < 1e-12
        )
        assert written[2:] == approx(expected[2:], rel=1e-9)


KAMINO = 0.01
"""Of Kamino's force at B in its third step of 1 ms: single precision, and a first-order
step; measured 1.5e-3.
"""


@pytest.mark.nightly
def test_newton_loads_the_usd_and_reads_as_the_comment_says():
    newton = pytest.importorskip("newton")
    pytest.importorskip("newton_usd_schemas")
    wheel = fourbar.Flywheel(100.0, 2)
    scene = crank_rocker(
        effects=(Gravity(), wheel),
        loads=(),
        motion=Motion(1.0, 3.0),
    )
    text = write_usd(scene)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "four_bar.usda"
        file.write_text(text)
        builder = newton.ModelBuilder()
        builder.add_usd(str(file))
    model = builder.finalize(device="cpu")
    solver, now, then = newton.solvers.SolverKamino(model), model.state(), model.state()
    *angles, omega_2, at_A, omega_4 = (
        float(x)
        for x in re.findall(r"= (-?[\d.]+(?:e-?\d+)?) rad", text)[:4]
        + re.findall(r"joint (?:A|O4) (\S+) rad/s", text)
    )
    speeds = now.joint_qd.numpy()
    speeds[:3] = omega_2, at_A, omega_4
    now.joint_qd.assign(speeds)
    newton.eval_fk(model, now.joint_q, now.joint_qd, now)
    for _ in range(3):
        turned = now.body_q.numpy().astype(float)
        solver.step(now, then, model.control(), None, 1e-3)
        now, then = then, now
    row = solver._solver_kamino.data.joints.lambda_kin_j.numpy().astype(float)[
        15 + 1 : 15 + 3
    ]
    theta = 2.0 * np.arctan2(turned[:, 5], turned[:, 6])
    force = complex(*row) * cmath.exp(1j * (theta[2] + angles[1] - angles[2]))
    command = Command(theta[:1], np.array([1]), np.array([omega_2]), np.zeros(1))
    expected = complex(*solve(scene, "force", at=command).F43[0])
    assert abs(force - expected) < KAMINO * abs(expected)
