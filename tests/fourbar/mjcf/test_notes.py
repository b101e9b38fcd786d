"""Every sentence that a generated MJCF says of itself is run.

With loads, effects, and a drive on bar 4.
"""

import re
from dataclasses import replace
from math import atan2, cos, dist, remainder, sin, tau
from xml.etree import ElementTree as ET

import mujoco
import numpy as np
import pandas
from numpy.testing import assert_allclose
from pytest import approx, mark, raises

from fourbar import (
    Flywheel,
    Free,
    Friction,
    Gravity,
    InputError,
    LinearDrive,
    Load,
    Motion,
    Place,
    Spring,
    Springs,
    Sweep,
    Torsion,
    Viscous,
    solve,
)
from fourbar.linkage import BAR_NAMES
from fourbar.mjcf import document, write_mjcf_for
from fourbar.scene import Command
from fourbar_validation.engines.mujoco.closed_loop import open_model
from fourbar_validation.places import MODELS
from tests.support.scenes import crank_rocker, thesis

EXACT = 1e-6
"""Of the greatest value in a turn, at MuJoCo's own angle, speed and acceleration;
measured 2e-7.
"""
QUICK = 5e-3
"""The same of a released linkage, whose closure is made to take no energy out; measured
1.9e-3.
"""
FOUND = 2e-3
"""What a test must find where a sentence says that numbers differ."""
NEXT_BAR = {
    "input": ("input", "coupler"),
    "coupler": ("coupler",),
    "output": ("output",),
}
MATRIX = MODELS.parent / "docs/examples/benchmark.csv"


def acted_on(**changes):
    """Everything that has a counterpart in MJCF acts.

    A load of each kind on each bar, and the drive is on bar 4.
    """
    effects = (
        Gravity(),
        Viscous.at(O2=0.02, B=0.03),
        Friction.at(A=0.01),
        Torsion.at(O4=(0.5, 0.2, 0.1)),
        Springs((Spring(Place(1, (0.1, -1.5)), Place(3, (0.08, 0.3)), 200.0, 0.02),)),
        Flywheel(0.02, 4),
    )
    loads = (
        Load(2, (2.0, 0.4), arm=(0.03, 2.0), moment=0.1),
        Load(3, (4.0, -1.0), from_centre=(0.05, 0.7), frame="bar"),
        Load(3, moment=-0.2),
        Load(4, (3.0, 0.7), arm=(0.05, 1.0)),
    )
    motion = Motion(Sweep(0.4, 0.4 + tau, 60), 10.0)
    acting = {"motion": motion, "effects": effects, "loads": loads, "drive_bar": 4}
    return crank_rocker(**acting | changes)


class Opened:
    """A file in MuJoCo at its keyframe."""

    def __init__(self, scene, drive):
        self.scene, self.drive = scene, drive
        self.text = write_mjcf_for(scene, drive=drive)
        self.model, self.data = open_model(self.text)

    def comments(self):
        return re.findall("<!-- (.*?) -->", self.text)

    def step(self, steps=20):
        mujoco.mj_step(self.model, self.data, steps)

    def forward(self):
        mujoco.mj_forward(self.model, self.data)

    def move_on(self):
        self.step()
        self.forward()
        return self

    def is_moving_without_drive(self):
        """Return True if its controls are those of loads alone."""
        names = [self.model.actuator(n).name for n in range(self.model.nu)]
        of_loads = all(name.startswith("load_") for name in names)
        return of_loads and self.data.qvel[0] == 10.0

    @property
    def exact(self):
        return EXACT if self.scene.motion.free is None else QUICK

    @property
    def driven(self):
        """The scene with the drive where the file has its own."""
        if self.drive == "flywheel":
            return replace(self.scene, drive=None, drive_bar=2)
        return self.scene

    def solve_here(self, scene):
        """By the formulas at the state that was last forwarded."""
        d = self.data
        state = d.qpos[:1], np.array([1]), d.qvel[:1], d.qacc[:1]
        return solve(scene, "force", at=Command(*state))

    def errors(self, answers, scene=None):
        """Compare with the formulas; errors are over the greatest value in a turn."""
        scene = scene or self.driven
        motion = scene.motion.replace(free=None)
        # without poles
        round_ = replace(scene, drive=None, drive_bar=2, motion=motion)
        expected, turn = self.solve_here(scene), solve(round_, "force")
        return {
            name: abs(answer - expected[name][0]).max() / abs(turn[name]).max()
            for name, answer in answers.items()
        }

    def error(self, name, answer):
        return self.errors({name: answer})[name]

    @property
    def at_B(self):
        return self.data.efc_force[:2]

    def torque(self):
        m, d = self.model, self.data
        of_flywheel = m.dof_armature[m.joint("O2").dofadr[0]] * d.qacc[0]
        return d.actuator_force[m.actuator("drive").id] - of_flywheel

    def at_pins(self, *, loads):
        """cfrc_int, with the loads that MuJoCo counts in, or without."""
        mujoco.mj_rnePostConstraint(self.model, self.data)
        m, d, forces = self.model, self.data, {}
        for name, bars in NEXT_BAR.items():
            forces[name] = d.cfrc_int[m.body(name).id][3:5].copy()
            for index, load in enumerate(self.scene.loads, 1):
                if not loads and load.force is not None and BAR_NAMES[load.bar] in bars:
                    size, angle = load.force
                    if load.frame == "bar":
                        x = d.site(f"load_{index}").xmat
                        angle += atan2(x[3], x[0])
                    forces[name] -= size * np.array([cos(angle), sin(angle)])
        return {
            "F12": forces["input"],
            "F32": -forces["coupler"],
            "F14": forces["output"],
        }


def opens_assembled(file):
    m, d = file.model, file.data
    mujoco.mj_resetData(m, d)
    file.forward()
    gap = dist(d.site("B3").xpos, d.site("B4").xpos)
    at = Command(d.qpos[:1].copy(), np.array([1]), None, 0.0)
    s = solve(file.scene, "position", at=at)
    assert gap < 1e-9 and m.joint("O2").qpos0[0] == d.qpos[0] == approx(0.4)
    for apart in (d.qpos[0] + d.qpos[1] - s.theta_3[0], d.qpos[2] - s.theta_4[0]):
        assert remainder(apart, tau) == approx(0.0, abs=1e-12)


def is_driven(file):
    m, d = file.model, file.data
    mujoco.mj_resetData(m, d)
    file.step(round(8 * document.SETTLING))
    assert d.qvel[0] == approx(10.0, rel=1e-3)
    m.actuator("drive").gainprm[:] = m.actuator("drive").biasprm[:] = 0.0
    file.step(300)
    assert d.qvel[0] == approx(10.0, rel=1e-3), "the flywheel alone"


def is_accelerated(file):
    d = file.data
    assert d.qvel[0] == 10.0
    file.step(100)
    gained = 2.0 * file.scene.motion.alpha_2 * (d.qpos[0] - 0.4)
    assert d.qvel[0] ** 2 == approx(100.0 + gained, rel=1e-6)


def starts_anew(file):
    """What the viewer shows of an input that cannot turn fully.

    The same stretch again, from an assembled pose.
    """
    d, last = file.data, 0.0
    for _ in range(round(tau / 0.2244 / file.model.opt.timestep)):
        file.step(1)
        if d.time < last:
            gap = dist(d.site("B3").xpos, d.site("B4").xpos)
            assert gap < 1e-4 and abs(d.qpos[0] - file.model.qpos0[0]) < 0.01
            return
        last = d.time
    raise AssertionError("the linkage went past its limit position")


def is_driven_elsewhere(file):
    file.move_on()
    answers = {"F43": file.at_B, **file.at_pins(loads=False)}
    assert max(file.errors(answers).values()) < EXACT
    assert min(file.errors(answers, file.scene).values()) > FOUND


def takes_control(file):
    assert file.data.qvel[0] == 10.0
    file.data.ctrl[file.model.actuator("drive").id] = 0.7
    file.move_on()
    assert file.error("torque", 0.7) < EXACT


def takes_what_is_applied(file):
    assert file.is_moving_without_drive()
    file.data.qfrc_applied[{2: 0, 4: 2}[file.scene.drive_bar]] = 0.7
    file.move_on()
    assert file.error("torque", 0.7) < EXACT


def cylinder_force(file):
    """By the formulas, whose stroke is the tendon's length."""
    solution = file.solve_here(file.scene)
    length = file.data.ten_length[file.model.tendon("cylinder").id]
    assert length == approx(solution.stroke[0], rel=1e-9)
    return float(solution.drive_force[0])


def relieves_the_flywheel(file):
    file.move_on()
    before, control = file.torque(), file.model.actuator("cylinder").id
    file.data.ctrl[control] = cylinder_force(file)
    file.forward()
    assert abs(file.torque()) < EXACT * abs(before)
    file.data.ctrl[control] *= -1.0
    file.forward()
    assert file.torque() == approx(2.0 * before, rel=EXACT)


def pushes_as_controlled(file):
    assert file.data.qvel[0] == 10.0
    file.data.ctrl[file.model.actuator("cylinder").id] = 7.0
    file.move_on()
    assert cylinder_force(file) == approx(7.0, rel=FOUND)


def pushes_as_applied(file):
    assert file.is_moving_without_drive()
    assert abs(cylinder_force(file.move_on())) < FOUND * 7.0


def is_released(file):
    assert file.data.qvel[0] == 10.0
    file.move_on()
    assert file.error("torque", 0.0) < QUICK


def is_of_the_instant_after_forward(file):
    """The files without a flywheel step more finely."""

    def read():
        d = file.data
        return np.array([*d.qacc, *d.actuator_force, *d.efc_force[:2]])

    file.step()
    before = read()
    file.forward()
    assert abs(read() - before)[[0, 1, 2, -2, -1]].min() > 0.0
    assert file.error("F43", file.at_B) < file.exact
    if file.drive == "flywheel" and file.scene.motion.free is None:
        assert file.error("F43", before[-2:]) > 10.0 * file.exact


def gives_torque(file):
    file.move_on()
    assert file.error("torque", file.torque()) < EXACT


def gives_force_at_B(file):
    file.move_on()
    assert file.error("F43", file.at_B) < file.exact


def gives_forces_at_pins(file):
    """Without loads as it stands."""
    bare = Opened(replace(file.scene, loads=()), file.drive)
    bare.move_on()
    assert max(bare.errors(bare.at_pins(loads=True)).values()) < bare.exact
    assert "counts loads in" not in bare.text


def counts_loads_in(file):
    file.move_on()
    assert max(file.errors(file.at_pins(loads=False)).values()) < file.exact
    assert min(file.errors(file.at_pins(loads=True)).values()) > FOUND


def yields_more(file):
    """In this scene inertia dominates.

    Change points and static loads are measured with the check of files.
    """
    file.move_on()
    sine = abs(solve(file.scene, "position").sin_mu).min()
    assert file.error("F43", file.at_B) < 1e-4 / sine**2


def holds_with_a_flywheel(file):
    gives_force_at_B(Opened(replace(file.scene, drive=None, drive_bar=2), "flywheel"))


def has_one_control_with_a_range(file):
    """Gymnasium's MujocoEnv makes a row of its box of actions of each control's
    range.
    """
    m, d, scene = file.model, file.data, file.scene
    assert m.nu == 1 and m.actuator_ctrlrange.shape == (1, 2)
    turn = solve(scene, "force")
    driving = turn.torque if scene.drive is None else turn.drive_force
    most = 2.0 * np.nanmax(abs(driving))
    assert m.actuator_ctrlrange[0] == approx([-most, most], rel=5e-3)
    d.ctrl[0] = 10.0 * most
    file.forward()
    assert d.actuator_force[0] == 10.0 * most


def has_passive_motors(file):
    m, d = file.model, file.data
    drive = "drive" if file.scene.drive is None else "cylinder"
    others = [i for i in range(m.nactuator) if m.actuator(i).name != drive]
    assert len(others) >= len(file.scene.loads)
    assert all(m.actuator_ctrlnum[i] == 0 for i in others)
    # MuJoCo 3 refuses 0, and the back-EMF goes as the square
    for motor in ET.fromstring(file.text).iter("dcmotor"):
        constant = float(motor.get("motorconst", "nan"))
        assert constant > 0.0 == constant * constant
    file.forward()
    before = d.actuator_force[others].copy()
    file.step(50)
    assert_allclose(d.actuator_force[others], before, rtol=1e-15)


def was_wrong_before_3_7(file):
    """Compare two versions of the benchmark's matrix at the worst of three
    timesteps.
    """
    matrix = (
        pandas.read_csv(MATRIX)
        .set_index("problem")
        .query(
            "engine in ['MuJoCo 3.3.7: simulated', 'MuJoCo: simulated']"
            " and quantity == 'F43'"
        )
    )
    in_a_turn = matrix.loc[["crank_rocker", "newton_128", "drake_23842"]]
    errors = in_a_turn.astype({"error": float}).groupby(["version", "problem"])["error"]
    worst = errors.max()
    assert len(worst["3.3.7"]) == len(worst["4.0.0"]) == 3
    assert worst["3.3.7"].min() > 0.1 and worst["4.0.0"].max() < 1e-6


SAID = {
    "Written by fourbar. Opens assembled": opens_assembled,
    "The drive brings the input to omega_2": is_driven,
    "The drive is a constant motor for alpha_2": is_accelerated,
    "Past a limit position": starts_anew,
    "The scene drives bar 4, this file bar 2": is_driven_elsewhere,
    "ctrl[drive] is the couple of ground on bar ": takes_control,
    "No drive: the couple of ground on bar ": takes_what_is_applied,
    "Here the flywheel drives: the cylinder's force": relieves_the_flywheel,
    "ctrl[cylinder] is the cylinder's force": pushes_as_controlled,
    "No drive: the force along the tendon cylinder": pushes_as_applied,
    "Released: no drive": is_released,
    "After mj_step, qacc, actuator_force and efc_force": (
        is_of_the_instant_after_forward
    ),
    "T2 = actuator_force[drive] - dof_armature[O2] qacc[O2]": gives_torque,
    "efc_force[:3]: force of bar 4 on bar 3": gives_force_at_B,
    "cfrc_int[bar][3:]": gives_forces_at_pins,
    "MuJoCo counts loads in": counts_loads_in,
    "Without a flywheel the loop yields more": yields_more,
    "With the flywheel as drive they hold to 1e-6": holds_with_a_flywheel,
    "ctrlrange is twice the largest couple or force": has_one_control_with_a_range,
    "Loads and preloads are motors without a control": has_passive_motors,
    "MuJoCo before 3.7": was_wrong_before_3_7,
}
"""By how a sentence begins, what it promises."""
CYLINDER = LinearDrive(Place(1, (0.17, -1.1)), Place(3, (0.09, 0.7)))
PRELOADED = Spring(Place(1, (0.1, -1.5)), Place(3, (0.08, 0.3)), 200.0, 0.02, 30.0)
"""A spring that pulls even where its ends meet: a tendon's rest length cannot express
it.
"""
FILES = {
    "at omega_2": (acted_on(), "flywheel"),
    "at alpha_2": (
        acted_on(motion=Motion(Sweep(0.4, 5.0, 60), 10.0, 30.0)),
        "flywheel",
    ),
    "motor on bar 4": (acted_on(), "motor"),
    "motor on bar 3": (acted_on(drive_bar=3), "motor"),
    "motor on bar 2": (acted_on(drive_bar=2), "motor"),
    "motor and a preloaded spring": (
        acted_on(effects=(Springs((PRELOADED,)),), drive_bar=2),
        "motor",
    ),
    "no drive": (acted_on(), "none"),
    "cylinder": (acted_on(drive_bar=None, drive=CYLINDER), "flywheel"),
    "motor along a cylinder": (acted_on(drive_bar=None, drive=CYLINDER), "motor"),
    "no drive along a cylinder": (acted_on(drive_bar=None, drive=CYLINDER), "none"),
    "released": (
        acted_on(motion=Motion(0.4, 10.0, free=Free(0.1, 2))),
        "flywheel",
    ),
}


@mark.parametrize("name", FILES)
def test_every_sentence_holds(name):
    said = Opened(*FILES[name]).comments()
    assert len(said) >= 6 and all(len(line) <= 115 for line in said)
    for line in said:
        holds = [check for start, check in SAID.items() if line.startswith(start)]
        assert len(holds) == 1, f"no test of: {line}"
        holds[0](Opened(*FILES[name]))


def test_a_linkage_with_limits_says_so(tmp_path, monkeypatch):
    """MuJoCo writes a log of its resets into the working folder."""
    monkeypatch.chdir(tmp_path)
    file = Opened(thesis(), "flywheel")
    assert any(line.startswith("Past a limit position") for line in file.comments())
    starts_anew(file)


def test_every_sentence_of_the_table_is_said_somewhere():
    said = [line for name in FILES for line in Opened(*FILES[name]).comments()]
    said += Opened(thesis(), "flywheel").comments()
    for start in SAID:
        assert any(line.startswith(start) for line in said), start


def test_a_motor_for_one_that_takes_none_is_refused():
    for wrong in (("newton", "motor"), ("mujoco", "servo"), ("ode",)):
        with raises(InputError, match=r"^[^\n]+$"):
            write_mjcf_for(crank_rocker(), *wrong)
