"""Means and energies of `analyze` do not change with the steps of a motion: those of a
weight at the end of a crank are known by hand.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import fourbar
from fourbar.scene.motion import Rise
from fourbar.show.block import write_block, write_motor

MASS, CRANK, G = 2.0, 0.1, 9.81
LINKAGE = fourbar.FourBar(
    0.3,
    fourbar.Bar(CRANK, MASS, 0.0, (CRANK, 0.0)),
    fourbar.Bar(0.25),
    fourbar.Bar(0.22),
)
DIGITS = 1e-8
"""Some hundred panels of 1e-10 each."""
STEPS = (2, 5, 8, 37, 360)


def analyze(motion: fourbar.Motion, **changes: Any) -> dict[str, Any]:
    scene = fourbar.Scene(LINKAGE, motion, effects=(fourbar.Gravity(G),))
    scene = replace(scene, **changes)
    entry = write_motor(scene, fourbar.solve(scene), {})
    assert entry is not None
    return entry


@pytest.mark.parametrize("steps", STEPS)
@pytest.mark.parametrize(("start", "stop"), [(0.3, 2.5), (2.5, 0.3)])
def test_the_mean_over_an_open_sweep_is_that_over_its_angle(
    steps: int,
    start: float,
    stop: float,
) -> None:
    """The torque at rest is m g a cos(theta_2); the pin O2 bears the weight."""
    entry = analyze(fourbar.Motion(fourbar.Sweep(start, stop, steps), 0.0))
    weight = MASS * G
    squares = 0.5 * (2.5 - 0.3) + 0.25 * (math.sin(5.0) - math.sin(0.6))
    rms = weight * CRANK * math.sqrt(squares / (2.5 - 0.3))
    assert entry["rms_torque"] == pytest.approx(rms, rel=DIGITS)
    assert entry["pins"]["O2"]["rms"] == pytest.approx(weight, rel=DIGITS)
    assert entry["energy_in"] is None


@pytest.mark.parametrize("steps", STEPS)
@pytest.mark.parametrize("speed", (10.0, -10.0))
def test_the_energies_of_a_turn_are_those_of_a_weight_that_is_lifted(
    steps: int,
    speed: float,
) -> None:
    """It goes up and down by two cranks; a couple of -0.7 N m acts besides."""
    turn = fourbar.Motion(fourbar.Sweep(0.3, 0.3 + math.tau, steps), speed)
    lifted = 2.0 * MASS * G * CRANK
    alone = analyze(turn)
    assert alone["energy_in"] == pytest.approx(lifted, rel=DIGITS)
    assert alone["energy_out"] == pytest.approx(lifted, rel=DIGITS)
    assert abs(alone["mean_torque"]) < DIGITS * lifted
    rms = MASS * G * CRANK / math.sqrt(2.0)
    assert alone["rms_torque"] == pytest.approx(rms, rel=DIGITS)
    loaded = analyze(turn, loads=(fourbar.Load(2, moment=-0.7),))
    assert loaded["mean_torque"] == pytest.approx(0.7, rel=DIGITS)
    assert loaded["energy_swing"] == pytest.approx(lifted, rel=DIGITS)


@pytest.mark.parametrize("steps", STEPS)
def test_the_energies_of_a_law_are_those_of_a_weight_that_rises_and_falls(
    steps: int,
) -> None:
    """Height and speed of the weight follow from the cycloid u - sin(2 pi u)/(2 pi)."""
    first, angle = math.radians(20.0), math.radians(60.0)
    law = Rise(
        "cycloidal",
        (angle, 0.5),
        theta_2=first,
        dwell=0.2,
        fall=0.4,
        rest=0.1,
        steps=steps,
    )
    entry = analyze(fourbar.Motion(law=law))
    u = np.linspace(0.0, 1.0, 400_001)
    theta = first + angle * (u - np.sin(math.tau * u) / math.tau)
    given = taken = 0.0
    for duration, sense in ((0.5, 1.0), (0.4, -1.0)):
        omega = angle / duration * (1.0 - np.cos(math.tau * u))
        energy = 0.5 * MASS * (CRANK * omega) ** 2 + MASS * G * CRANK * np.sin(theta)
        change = sense * np.diff(energy)
        given += change[change > 0.0].sum()
        taken -= change[change < 0.0].sum()
    assert entry["energy_in"] == pytest.approx(given, rel=DIGITS)
    assert entry["energy_out"] == pytest.approx(taken, rel=DIGITS)


@pytest.mark.parametrize("steps", (8, 37, 100))
def test_what_dry_friction_takes_is_what_it_turns_into_heat(steps: int) -> None:
    """A couple of 0.05 N m at O4, which turns back and forth by 54.49 deg in a turn."""
    friction = 0.05
    turn = fourbar.Motion(fourbar.Sweep(0.0, math.tau, steps), 10.0)
    scene = fourbar.Scene(
        LINKAGE,
        turn,
        effects=(fourbar.Gravity(G), fourbar.Friction.at(O4=friction)),
    )
    entry = analyze(turn, effects=scene.effects)
    # O2 A and A B are in line at both ends of the swing, by the cosine rule
    reach = [
        math.acos((0.3**2 + 0.22**2 - far**2) / (2.0 * 0.3 * 0.22))
        for far in (0.25 + CRANK, 0.25 - CRANK)
    ]
    heat = friction * 2.0 * abs(reach[0] - reach[1])
    assert entry["mean_torque"] == pytest.approx(heat / math.tau, rel=1e-6)


@pytest.mark.parametrize("steps", (8, 24, 360))
def test_the_printed_energies_of_a_law_do_not_depend_on_its_steps(steps: int) -> None:
    """Right are the free bodies of a rocker that rises and falls, at 24 001 times."""
    bars = fourbar.Bar(0.1), fourbar.Bar(0.25), fourbar.Bar(0.22, 2.0)
    law = Rise(
        "cycloidal",
        (math.radians(60.0), 0.5),
        theta_2=math.radians(20.0),
        dwell=0.2,
        fall=0.4,
        rest=0.1,
        steps=steps,
    )
    scene = fourbar.Scene(
        fourbar.FourBar(0.3, *bars),
        fourbar.Motion(law=law),
        effects=(fourbar.Gravity(G),),
    )
    text = " ".join(write_block(scene, fourbar.solve(scene)))
    assert "87.86 mJ over the motion given, 87.86 mJ taken back" in text
    assert "RMS 175.9 mN m" in text
    assert "sums over" not in text


@pytest.mark.slow
def test_what_has_a_pole_has_no_mean_and_its_power_has_one() -> None:
    """Beside a pole no integral of the torque's square exists."""
    turn = fourbar.Motion(fourbar.Sweep(0.0, math.tau, 36), 10.0)
    bars = fourbar.Bar(0.1), fourbar.Bar(0.25, 1.0), fourbar.Bar(0.22)
    scene = fourbar.Scene(
        fourbar.FourBar(0.3, *bars),
        turn,
        drive_bar=4,
        effects=(fourbar.Gravity(G),),
    )
    duty = fourbar.motor_duty(fourbar.solve(scene))
    of_input = fourbar.motor_duty(fourbar.solve(replace(scene, drive_bar=2)))
    assert duty is not None and of_input is not None
    assert duty.rms_torque is None and duty.peak_torque is None
    # the power is that of the input, which has no pole
    for name in ("peak_power", "rms_power", "energy_in", "energy_out"):
        right = getattr(of_input, name)
        assert getattr(duty, name) == pytest.approx(right, rel=1e-7), name
    text = " ".join(write_block(scene, fourbar.solve(scene)))
    assert "motor: none is enough, as the torque grows without bound" in text


def test_an_accelerated_sweep_has_no_means_and_no_energies() -> None:
    """Its positions are passed at no one speed."""
    turn = fourbar.Motion(fourbar.Sweep(0.0, math.tau, 36), 10.0, 5.0)
    scene = fourbar.Scene(LINKAGE, turn, effects=(fourbar.Gravity(G),))
    solution = fourbar.solve(scene)
    duty = fourbar.motor_duty(solution)
    assert duty is not None and duty.peak_torque is not None
    for name in ("rms_torque", "rms_power", "energy_in", "energy_out", "energy_swing"):
        assert getattr(duty, name) is None, name
    assert fourbar.bearing_load(solution, "A").rms is None
    text = " ".join(" ".join(write_block(scene, solution)).split())
    assert "positions are passed at no one speed: no RMS values, no energies" in text
    assert "RMS " not in text.replace("no RMS values", "")


def test_a_list_of_positions_has_its_own_means() -> None:
    angles = np.array([0.3, 0.4, 2.5])
    scene = fourbar.Scene(
        LINKAGE,
        fourbar.Motion(angles, 0.0),
        effects=(fourbar.Gravity(G),),
    )
    solution = fourbar.solve(scene)
    entry = write_motor(scene, solution, {})
    assert entry is not None
    rms = MASS * G * CRANK * math.sqrt(np.square(np.cos(angles)).mean())
    assert entry["rms_torque"] == pytest.approx(rms, rel=1e-12)
    text = " ".join(write_block(scene, solution))
    assert "peak and RMS are those of these positions" in text
    assert "sums over" not in text
