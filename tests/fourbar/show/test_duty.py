"""Shaking force and moment from momentum, and the duty of a motor.

The loads of the pins are tested too.
"""

import math
from dataclasses import replace
from math import tau

import numpy as np
import pytest
from pytest import approx

import fourbar
from fourbar import Bar, FourBar, Gravity, Motion, Scene, Sweep, solve, uniform, vary
from fourbar.linkage import MOVING_BARS
from fourbar.scene.motion import Law
from fourbar.show.block import write_motor
from fourbar.show.duty import bearing_load, motor_duty, shaking_force, shaking_moment
from fourbar.show.units import units
from tests.support.scenes import CYLINDER, crank_rocker

ROUND_OFF = 1e-11
"""Some hundred roundings, divided by the smallest sine of this sweep squared."""


@pytest.mark.parametrize("drive", [None, CYLINDER], ids=("couple", "cylinder"))
def test_shaking_is_the_momentum_that_the_bars_lose(drive):
    scene = crank_rocker(loads=(), effects=(), drive=drive)
    s = solve(scene)
    force, moment = np.zeros((61, 2)), np.zeros(61)
    for number, bar in zip(MOVING_BARS, scene.linkage.moving, strict=True):
        G, a, alpha = (getattr(s, f"{x}{number}") for x in ("G", "a_G", "alpha_"))
        force -= bar.mass * a
        moment -= bar.mass * (G[:, 0] * a[:, 1] - G[:, 1] * a[:, 0])
        moment -= bar.moment_of_inertia * alpha
    assert np.abs(shaking_force(s) - force).max() < ROUND_OFF * np.abs(force).max()
    assert np.abs(shaking_moment(s) - moment).max() < ROUND_OFF * np.abs(moment).max()


def test_bearing_load():
    listed = Motion(np.linspace(0.1, 0.1 + tau, 61), 10.0)
    s = solve(crank_rocker(motion=listed))
    load = np.hypot(*s.F43[:-1].T)
    bearing = bearing_load(s, "B")
    assert bearing.largest == load.max() and bearing.where == s.theta_2[load.argmax()]
    assert bearing.rms == approx(np.sqrt(np.mean(load**2)), rel=60e-14)


@pytest.mark.parametrize("second", [1.2, -1.2])
def test_the_mean_torque_of_a_law_is_the_work_over_the_angle(second):
    """The bar that goes back at first turns forwards in the end."""
    law = Law((0.0, 0.2, 0.5, 1.0), (0.1, second, 3.7, 0.1 + tau), ends="periodic")
    assert (law.at(np.zeros(1))[1] > 0.0) == (second > 0.0)
    damped = (fourbar.Viscous.at(O2=0.01),)
    duty = motor_duty(solve(crank_rocker(motion=Motion(law=law), effects=damped)))
    work = duty.energy_in - duty.energy_out
    # the difference of the energies has the roundings of the larger one
    assert duty.mean_torque * tau == approx(work, abs=ROUND_OFF * duty.energy_in)


def test_what_damping_turns_into_heat_is_what_the_drive_gives_over_a_turn():
    pins = {"O2": 0.004, "B": 0.02}
    damped = (Gravity(), fourbar.Viscous.at(**pins))
    sweep = Motion(Sweep(0.0, tau, 360), 10.0)
    s = solve(crank_rocker(motion=sweep, loads=(), effects=damped))
    duty = motor_duty(s)
    assert duty.closed
    losses = pins["O2"] * 10.0**2 + pins["B"] * (s.omega_3 - s.omega_4) ** 2
    heat = losses[:-1].mean() * tau / 10.0
    # the rule is exact on periods
    given = duty.energy_in - duty.energy_out
    assert abs(given - heat) < 1e-9 * duty.energy_in
    assert duty.mean_torque == approx(heat / tau, rel=1e-9)


def test_a_drive_at_rest_has_no_energies_and_positions_alone_have_no_duty():
    still = motor_duty(solve(crank_rocker(motion=Motion(1.0, 0.0))))
    assert still.peak_power == 0.0 and not still.closed
    assert still.energy_in is still.mean_torque is still.energy_swing is None
    assert motor_duty(solve(crank_rocker(), "position")) is None


def test_the_swing_of_the_energy_of_a_balanced_weight_is_known_by_hand():
    """A weight at the crank's end, T = m g a cos(theta_2), and a constant couple.

    The energy about the mean goes from -m g a to m g a, whichever way the crank turns.
    """
    weight = Bar(0.1, 2.0, 0.0, (0.1, 0.0))
    massless = Bar(0.25), Bar(0.22)
    linkage = FourBar(0.3, weight, *massless)
    couple = fourbar.Load(2, moment=-0.7)
    for speed in (10.0, -10.0):
        turn = Motion(Sweep(0.3, 0.3 + tau, 720), speed)
        scene = Scene(linkage, turn, loads=(couple,), effects=(Gravity(),))
        duty = motor_duty(solve(scene))
        assert duty.mean_torque == approx(0.7, rel=1e-9)
        assert duty.energy_swing == approx(2.0 * 2.0 * 9.81 * 0.1, rel=1e-9)


def test_the_json_holds_the_duty():
    listed = Motion(np.linspace(0.0, tau, 61), 10.0)  # between which nothing stands
    s = solve(crank_rocker(motion=listed))
    duty, entry = motor_duty(s), write_motor(s.scene, s, units("imperial"))
    inch_pound = 0.0254 * 0.45359237 * 9.80665
    assert entry["units"]["rms_power"] == "hp"
    assert entry["units"]["energy_out"] == "lbf in"
    rms_force = entry["pins"]["B"]["rms"] * inch_pound / 0.0254
    for printed, number in (
        (entry["rms_power"] * 6600.0 * inch_pound, duty.rms_power),
        (entry["energy_out"] * inch_pound, duty.energy_out),
        (rms_force, bearing_load(s, "B").rms),
    ):
        assert printed == approx(number, rel=ROUND_OFF)


def test_a_study_has_what_each_of_its_members_has():
    """Closed and open sweeps, with members that differ.

    One has another ground, and one never closes.
    """
    scene = crank_rocker(loads=())
    grounds, angles = [0.3, 0.32, 0.31, 3.0], [0.2, 0.3, 0.1, 0.0]
    turn = np.linspace(0.1, 0.1 + tau, 61)
    theta_2 = np.array([turn, turn, np.linspace(0.1, 3.0, 61), turn])
    values = {
        "lengths.ground": grounds,
        "lengths.ground_angle": angles,
        "motion.theta_2": theta_2,
    }
    s = solve(vary(scene, values))
    force, moment = shaking_force(s), shaking_moment(s)
    duty, load = motor_duty(s), bearing_load(s, "A")
    assert force.shape == (4, 61, 2) and moment.shape == (4, 61)
    for member in range(3):
        linkage = replace(
            scene.linkage, ground=grounds[member], ground_angle=angles[member]
        )
        motion = scene.motion.replace(angle=theta_2[member])
        alone = solve(replace(scene, linkage=linkage, motion=motion))
        assert moment[member] == approx(shaking_moment(alone), rel=1e-12, abs=1e-12)
        assert force[member] == approx(shaking_force(alone), rel=1e-12, abs=1e-12)
        numbers = (*motor_duty(alone), *bearing_load(alone, "A"))
        for array, number in zip((*duty, *load), numbers, strict=True):
            if number is None:  # a member of a study without a number has NaN
                assert array is None or np.isnan(array[member])
            else:
                assert number == approx(array[member], rel=1e-12)
    lost = load.largest, duty.rms_power, duty.energy_in, duty.energy_out
    assert np.isnan([array[3] for array in lost]).all() and np.isnan(moment[3]).all()
    assert duty.closed.tolist()[:3] == [True, True, False]


def test_a_member_at_rest_has_no_energies():
    turn = np.linspace(0.1, 0.1 + tau, 61)
    speeds = {"motion.omega_2": [0.0, 3.0], "motion.theta_2": turn}
    duty = motor_duty(solve(vary(crank_rocker(loads=()), speeds)))
    assert np.isfinite(duty.energy_in).tolist() == [False, True]


def test_a_study_of_a_motion_law_keeps_its_time():
    """Its energies are integrals over time, as those of each member alone.

    Speeds are zero at both ends.
    """
    law = Law((0.0, 0.5, 1.0, 1.5, 2.0), (0.0, 0.0, 2.0, 2.0, 0.0), 20, "rest")
    linkage = uniform(0.3, 0.1, 0.25, 0.22)
    scene = Scene(linkage, Motion(law=law), effects=(Gravity(),))
    study = solve(vary(scene, {"bars.input.mass": [0.1, 0.1]}))
    alone, duty = solve(scene), motor_duty(study)
    assert np.array_equal(study.time, [alone.time, alone.time])
    assert np.round(duty.energy_in, 4).tolist() == [0.4655, 0.4655]
    by_hand = np.trapezoid(np.maximum(alone.power, 0.0), alone.time)
    assert duty.energy_in == approx([by_hand] * 2, rel=1e-12)
    rows = study.to_csv()
    assert len(rows.splitlines()) == 1 + 2 * 21
    assert rows.splitlines()[0].split(",").count("time") == 1


def test_a_law_over_one_turn_is_closed_where_speed_and_acceleration_repeat():
    """The last position counts once only if its angle, speed and acceleration
    repeat.
    """
    time, angle = (0.0, 0.3, 0.7, 1.0), (0.0, 1.5, 5.0, tau)
    linkage = uniform(0.3, 0.1, 0.25, 0.22)
    closed = {}
    for ends in ("free", "rest", "periodic"):
        motion = Motion(law=Law(time, angle, 24, ends))
        solution = solve(Scene(linkage, motion, effects=(Gravity(),)))
        duty = motor_duty(solution)
        closed[ends] = duty.closed
    assert closed == {"free": False, "rest": False, "periodic": True}


@pytest.mark.slow
def test_a_law_of_one_turn_is_not_closed_where_the_assembly_needs_two():
    linkage = uniform(4.0, 1.0, 2.0, 3.0)
    closed = []
    for turns in (1, 2):
        angles = (0.0, 0.4 * turns * tau, turns * tau)
        law = Law((0.0, 0.5, 1.0), angles, 24, "periodic")
        scene = Scene(linkage, Motion(law=law))
        duty = motor_duty(solve(scene))
        closed.append(duty.closed)
    assert closed == [False, True]


@pytest.mark.parametrize("speed", (10.0, -10.0))
def test_the_energy_of_a_backward_sweep_is_that_of_the_work_of_the_loads(speed):
    """What the drive gives and takes back differs by the weight's rise.

    Without mass but one, (m g z) at the ends.
    """
    bars = Bar(0.1), Bar(0.25), Bar(0.22, 0.4)
    scene = Scene(
        FourBar(0.3, *bars),
        Motion(Sweep(2.0, 0.3, 2000), speed),
        effects=(Gravity(9.81),),
    )
    solution = solve(scene)
    duty, heights = motor_duty(solution), solution.G4[:, 1]
    speeds = np.hypot(0.5 * 0.22, 0.22 / math.sqrt(12.0)) * solution.omega_4
    energy = 0.4 * (9.81 * heights + 0.5 * speeds**2)
    # with a speed against its steps the sweep is run from its end
    gained = np.sign(-speed) * (energy[-1] - energy[0])
    assert duty.energy_in >= 0.0 and duty.energy_out >= 0.0
    assert duty.energy_in + duty.energy_out > 0.1 * abs(gained)
    assert duty.energy_in - duty.energy_out == approx(gained, rel=1e-5)


def test_a_position_without_forces_is_not_where_a_light_load_is_largest():
    """Loads below 1 N, in a sweep that begins where the linkage does not assemble."""
    bars = (Bar(length, 1e-3) for length in (0.25, 0.1, 0.22))
    scene = Scene(
        FourBar(0.3, *bars),
        Motion(Sweep(-math.pi, math.pi, 90), 1.0),
        effects=(Gravity(),),
    )
    s = solve(scene)
    assert not s.assembled[0] and s.assembled.any()
    size = np.hypot(*s.F12.T)
    assert np.nanmax(size) < 1.0
    listed = Motion(s.theta_2, 1.0)
    load = bearing_load(solve(replace(s.scene, motion=listed)), "O2")
    assert load.largest == np.nanmax(size)
    assert load.where == s.theta_2[np.nanargmax(size)]


@pytest.mark.slow
def test_a_turn_on_a_part_of_which_a_spring_is_wound_has_no_energies():
    """A spring keeps what it is given: the energies of the rest would be no turn's."""
    torsion = fourbar.effects.Torsion((("A", 2.0, math.radians(86.0), 0.0),))
    turn = Sweep(0.0, tau, 120)
    scene = crank_rocker(motion=Motion(turn, 1.0), effects=(torsion,))
    duty = motor_duty(solve(scene))
    assert duty.closed
    assert (duty.energy_in, duty.energy_out, duty.energy_swing) == (None, None, None)
