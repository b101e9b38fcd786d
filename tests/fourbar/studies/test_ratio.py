"""The loop as a gear: against solved scenes, energy and closed cases; the mimic model compiles and follows."""

import json
import math
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import mujoco
import numpy as np
import pytest
from numpy.polynomial import Polynomial

import fourbar
from fourbar import InputError, Motion, PinFriction, Scene, Sweep, uniform
from fourbar.cli import status
from fourbar.effects import SpringEnd
from fourbar.mjcf import replace_loop, write_mjcf
from fourbar.scene import Command
from fourbar.studies.ratio import GearRatio, ratio
from tests.support.scenes import crank_rocker

MODELS = Path(__file__).parents[3] / "models"
ROUNDING = 1e-9
"""Relative; two derivations in doubles, near which the linkages here have no limit."""


@pytest.fixture(scope="module")
def bonnet() -> tuple[Scene, GearRatio]:
    scene = fourbar.load(MODELS / "gallery" / "bonnet_hinge.toml")
    return scene, ratio(scene)


def test_the_gear_is_that_of_the_solved_scene(bonnet: tuple[Scene, GearRatio]) -> None:
    scene, gear = bonnet
    branch = np.full(len(gear.theta_2), scene.motion.branch, dtype=np.int8)
    at = Command(gear.theta_2, branch, scene.motion.omega_2, 0.0)
    solved = fourbar.solve(replace(scene, drive_bar=2), at=at)
    assert solved.omega_4 is not None and solved.torque is not None
    assert gear.omega_ratio == pytest.approx(solved.omega_4 / solved.omega_2, rel=ROUNDING)
    assert gear.torque_ratio == pytest.approx(solved.omega_2 / solved.omega_4, rel=ROUNDING)
    assert gear.torque == pytest.approx(solved.torque, rel=ROUNDING, abs=ROUNDING * np.abs(solved.torque).max())
    kinetic = 0.0
    for number, omega in ((2, solved.omega_2), (3, solved.omega_3), (4, solved.omega_4)):
        bar, v = scene.linkage.bar(number), getattr(solved, f"v_G{number}")
        kinetic = kinetic + 0.5 * bar.mass * (v**2).sum(axis=1) + 0.5 * bar.moment_of_inertia * omega**2
    assert 0.5 * gear.reflected_inertia * solved.omega_2**2 == pytest.approx(kinetic, rel=ROUNDING)
    low, high = gear.theta_2[[0, -1]]
    assert np.degrees([low, high]) == pytest.approx([109.0, 169.0])


def test_the_errors_are_those_of_the_polynomials(bonnet: tuple[Scene, GearRatio]) -> None:
    scene, gear = bonnet
    branch = np.full(len(gear.theta_2), scene.motion.branch, dtype=np.int8)
    solved = fourbar.solve(scene, "velocity", at=Command(gear.theta_2, branch, 1.0, 0.0))
    assert [fit.degree for fit in gear.fits] == [1, 2, 3, 4]
    for fit in gear.fits:
        P, x = Polynomial(fit.theta_4), gear.theta_2 - fit.about
        off = np.abs(P(x) - solved.theta_4)
        assert fit.angle.value == pytest.approx(off.max(), rel=1e-6)
        assert fit.speed.value == pytest.approx(np.abs(P.deriv()(x) - gear.omega_ratio).max(), rel=1e-6)
        # de la Vallee Poussin: where the error alternates degree + 2 times, none is better than its least peak
        signs = np.sign(P(x) - solved.theta_4)
        parts = np.split(off, np.flatnonzero(np.diff(signs) != 0) + 1)
        assert len(parts) == fit.degree + 2
        assert fit.angle.value < 2.0 * min(part.max() for part in parts)
    values = [fit.angle.value for fit in gear.fits]
    assert values == sorted(values, reverse=True) and values[-1] < 1e-5


def test_the_torque_of_a_mimic_joint_is_the_work_of_its_energy() -> None:
    """dE/dt at constant omega_2, E from the polynomials alone: no kinematic coefficient, no formula for J'."""
    linkage = uniform(0.3, 0.1, 0.25, 0.22)
    ends = {bar: SpringEnd(bar, 0.08, angle) for bar, angle in ((2, 0.5), (3, -0.7), (4, 0.9))}
    springs = fourbar.Springs(tuple(fourbar.Spring(ends[i], ends[j], 300.0, 0.05) for i, j in combinations(ends, 2)))
    scene = Scene(linkage, Motion(Sweep(0.5, 1.5, 50), 7.0), effects=(fourbar.Gravity(), springs))
    gear = ratio(scene, 2)
    fit, omega, h = gear.fits[1], 7.0, 1e-4

    def places(q: float) -> list[tuple[complex, float]]:
        theta_3 = q + float(Polynomial(fit.joint_A)(q - fit.about))
        theta_4 = float(Polynomial(fit.theta_4)(q - fit.about))
        A = 0.1 * np.exp(1j * q)
        G3, G4 = A + 0.125 * np.exp(1j * theta_3), 0.3 + 0.11 * np.exp(1j * theta_4)
        return [(0.5 * A, q), (G3, theta_3), (G4, theta_4)]

    def energy(q: float) -> float:
        total = 0.0
        for bar, here, (G0, t0), (G1, t1) in zip(linkage.moving, places(q), places(q - h), places(q + h), strict=True):
            v, w = omega * (G1 - G0) / (2 * h), omega * (t1 - t0) / (2 * h)
            total += 0.5 * bar.mass * abs(v) ** 2 + 0.5 * bar.moment_of_inertia * w * w + 9.81 * bar.mass * here[0].imag
        feet = (0.0, 0.1 * np.exp(1j * q), 0.3)
        held = [
            foot + ends[bar].distance * np.exp(1j * (here[1] + ends[bar].angle))
            for foot, bar, here in zip(feet, ends, places(q), strict=True)
        ]
        return float(total + sum(150.0 * (abs(one - other) - 0.05) ** 2 for one, other in combinations(held, 2)))

    worst = fit.torque.theta_2
    mimic = (energy(worst + h) - energy(worst - h)) / (2.0 * h)
    loop = gear.torque[np.argmin(np.abs(gear.theta_2 - worst))]
    assert abs(mimic - loop) == pytest.approx(fit.torque.value, rel=1e-5)


def test_a_parallelogram_is_a_gear_of_one_without_error() -> None:
    scene = Scene(uniform(0.3, 0.1, 0.3, 0.1), Motion(Sweep(0.3, 2.8, 10), 2.0))
    gear = ratio(scene)
    assert gear.omega_ratio == pytest.approx(1.0, abs=1e-14)
    for fit in gear.fits:
        assert max(fit.angle.value, fit.speed.value, fit.torque.value) < 1e-12


def test_what_no_polynomial_carries_is_refused() -> None:
    linkage = uniform(0.3, 0.1, 0.25, 0.22)
    friction = Scene(linkage, Motion(0.3, 1.0), effects=(PinFriction.at(A=(0.1, 0.01)),))
    rocker = Scene(uniform(0.3, 0.4, 0.2, 0.25), Motion(Sweep(-3.0, 3.0, 10), 1.0))
    through = Scene(uniform(0.3, 0.1, 0.3, 0.1), Motion(Sweep(0.0, 6.0, 10), 2.0))
    level = Scene(linkage, Motion(Sweep(1.0, 1.0, 1), 1.0))
    for scene, key in ((friction, "effects"), (rocker, "motion"), (through, "motion"), (level, "motion")):
        with pytest.raises(InputError) as error:
            ratio(scene)
        assert error.value.key.startswith(key)
    for degree in (0, 5, True, 2.0):
        with pytest.raises(InputError):
            ratio(Scene(linkage, Motion(0.3, 1.0)), degree)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["crank_rocker", "drag_link", "gallery/bonnet_hinge"])
def test_the_mimic_model_compiles_and_follows(name: str) -> None:
    scene = fourbar.load(MODELS / f"{name}.toml")
    gear = ratio(scene)
    fit = gear.fits[-1]
    text = replace_loop(write_mjcf(scene), scene, fit.about, fit.joint_A, fit.theta_4)
    assert "connect" not in text and "_pad" not in text
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    low, high, seen = gear.theta_2[0], gear.theta_2[-1], []
    while low - 1e-9 <= data.qpos[0] <= high + 1e-9:
        seen.append((*data.qpos[:3], data.qvel[0]))
        mujoco.mj_step(model, data)
    q2, qA, q4, omega_2 = np.array(seen).T
    assert len(seen) > 600 and abs(abs(q2[-1] - q2[0]) - (high - low)) < 0.02
    assert omega_2 == pytest.approx(scene.motion.omega_2, rel=1e-6)
    curve = np.max(np.abs([Polynomial(p).deriv(2)(gear.theta_2 - fit.about) for p in (fit.joint_A, fit.theta_4)]))
    lag = curve * (2.0 * model.opt.timestep * omega_2[0]) ** 2  # P'' omega^2 tc^2, which MuJoCo leaves out
    for q, coefficients in ((qA, fit.joint_A), (q4, fit.theta_4)):
        off = q - Polynomial(coefficients)(q2 - fit.about)
        assert np.abs(off - math.tau * np.rint(off / math.tau)).max() <= 2.0 * lag


def test_the_commands_print_and_write(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = str(MODELS / "gallery" / "bonnet_hinge.toml")
    assert status(["ratio", file]) == 0
    text = capsys.readouterr().out
    assert "0.6639" in text and 'polycoef="' in text and "<multiplier>" in text
    assert status(["ratio", file, "--degree", "2", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    gear = ratio(fourbar.load(file), 2)
    assert found["fits"][1]["theta_4"] == list(gear.fits[1].theta_4) and len(found["fits"]) == 2
    assert found["omega_ratio"] == gear.omega_ratio.tolist()
    for arguments in (["mjcf", file, "--mimic"], ["mjcf", "--lengths", "0.3", "0.1", "0.25", "0.22", "--mimic"]):
        out = tmp_path / f"{len(arguments)}.xml"
        assert status([*arguments, "-o", str(out)]) == 0
        mujoco.MjModel.from_xml_path(str(out))
    capsys.readouterr()
    hanging, no = str(MODELS / "problems" / "gz_physics_987.toml"), tmp_path / "no.xml"
    for bad in (["ratio", file, "--degree", "5"], ["ratio", hanging], ["mjcf", hanging, "--mimic", "-o", str(no)]):
        assert status(bad) == 2
        assert capsys.readouterr().err.count("\n") == 1
    assert not no.exists()


SAME_FIT = 0.2
"""Relative, of greatest errors of fits to one range by other samples: they stand at its ends, where the weights are
greatest and the first spacing counts; a fit to another range or of another weight is wrong by a factor."""


@pytest.mark.parametrize("name", ["theta_4", "stroke"])
def test_another_command_has_the_polynomials_of_the_range_that_it_passes(name: str) -> None:
    motion = {
        "theta_4": Motion(theta_4=Sweep(2.2, 2.75, 400), omega_4=3.0),
        "stroke": Motion(stroke=Sweep(0.17, 0.3, 400), stroke_speed=0.2, side="left"),
    }[name]
    ends = SpringEnd(1, 0.25, math.radians(-160.0)), SpringEnd(2, 0.09, 0.17)
    own = crank_rocker(motion=motion, drive=fourbar.LinearDrive(*ends), effects=(fourbar.Gravity(),))
    s = fourbar.solve(own)
    low, high = float(s.theta_2.min()), float(s.theta_2.max())
    found, known = ratio(own), ratio(replace(own, motion=Motion(Sweep(low, high, 400), 1.0)))
    np.testing.assert_allclose(found.omega_ratio, s.omega_4 / s.omega_2, rtol=ROUNDING)
    np.testing.assert_allclose(found.torque * s.omega_2, s.power, atol=ROUNDING * np.abs(s.power).max())
    for one, other in zip(found.fits, known.fits, strict=True):
        assert one.angle.value == pytest.approx(other.angle.value, rel=SAME_FIT)
        assert one.speed.value == pytest.approx(other.speed.value, rel=SAME_FIT)


def test_a_range_that_turns_back_is_refused() -> None:
    with pytest.raises(InputError, match="rises or falls throughout"):
        ratio(crank_rocker(motion=Motion(theta_4=2.2, omega_4=1.0)))
    with pytest.raises(InputError, match="rises or falls throughout"):
        ratio(crank_rocker(motion=Motion(theta_4=Sweep(1.0, 2.2, 50), omega_4=1.0)))
