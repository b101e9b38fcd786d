"""Shaking force and moment from momentum, and the duty of a motor.

The loads of the pins are tested too.
"""

from math import copysign, radians, sin, tau

import numpy as np
from pytest import approx, mark, raises

from fourbar import (
    Bar,
    FourBar,
    Friction,
    Gravity,
    InputError,
    Law,
    Load,
    Motion,
    Place,
    Scene,
    Springs,
    Sweep,
    Torsion,
    Viscous,
    solve,
    units,
    vary,
)
from fourbar.effects import Spring
from fourbar.linkage import MOVING_BARS
from fourbar.show.duty import (
    bearing_load,
    list_duty,
    motor_duty,
    shaking_force,
    shaking_moment,
)
from fourbar.show.motion_curves import describe_motion
from tests.support.scenes import CYLINDER, WEIGHT, crank_rocker

ROUND_OFF = 1e-11
"""Some hundred roundings, divided by the smallest sine of this sweep squared."""
INTEGRATED = 1e-9
"""Relative: the rule is exact on periods, and panels settle to that."""


@mark.parametrize("drive", [None, CYLINDER], ids=("couple", "cylinder"))
def test_shaking_is_the_momentum_that_the_bars_lose(drive):
    s = solve(crank_rocker(loads=(), effects=(), drive=drive))
    force = 0.0
    moment = 0.0
    for number, bar in zip(MOVING_BARS, s.scene.linkage.moving, strict=True):
        G = s[f"G{number}"]
        a = s[f"a_G{number}"]
        force -= bar.mass * a
        moment -= bar.mass * (G[:, 0] * a[:, 1] - G[:, 1] * a[:, 0])
        moment -= bar.moment_of_inertia * s[f"alpha_{number}"]
    assert abs(shaking_force(s) - force).max() < ROUND_OFF * abs(force).max()
    assert abs(shaking_moment(s) - moment).max() < ROUND_OFF * abs(moment).max()


SPRING = Spring(Place(1, (0.05, 0.4)), Place(3, (0.1, 0.2)), 300.0, 0.05)
WITHIN = {
    "spring": {"effects": (Gravity(), Springs((SPRING,)))},
    "torsion": {
        "effects": (Gravity(), Torsion.at(O2=(3.0, 0.2, 0.0), O4=(2.0, 0.1, 0.5)))
    },
    "friction": {"effects": (Gravity(), Viscous.at(O2=0.3), Friction.at(O4=0.2))},
    "cylinder": {"effects": (Gravity(), Springs((SPRING,))), "drive": CYLINDER},
}


@mark.parametrize("within", WITHIN.values(), ids=WITHIN)
def test_what_acts_within_a_linkage_at_rest_leaves_its_weight_on_the_frame(within):
    s = solve(crank_rocker(Motion(np.linspace(0.3, 1.2, 4), 0.0), loads=(), **within))
    weights = [-9.81 * bar.mass for bar in s.scene.linkage.moving]
    moment = sum(
        weight * s[f"G{bar}"][:, 0]
        for bar, weight in zip(MOVING_BARS, weights, strict=True)
    )
    size = abs(sum(weights))
    upright = np.array([0.0, sum(weights)])
    assert shaking_force(s) == approx(np.tile(upright, (4, 1)), abs=ROUND_OFF * size)
    assert shaking_moment(s) == approx(moment, abs=ROUND_OFF * size)
    study = solve(vary(s.scene, {"bars.input.mass": [1.0, 2.0]}))
    assert np.diff(shaking_force(study)[:, 0, 1]) == approx([-9.81])


@mark.parametrize("second", [1.2, -1.2])
def test_the_mean_torque_of_a_law_is_the_work_over_the_angle(second):
    """The bar that goes back at first turns forwards in the end."""
    law = Law((0.0, 0.2, 0.5, 1.0), (0.1, second, 3.7, 0.1 + tau), ends="periodic")
    assert (law.at(np.zeros(1))[1] > 0.0) == (second > 0.0)
    damped = (Viscous.at(O2=0.01),)
    solution = solve(crank_rocker(Motion(law=law), effects=damped))
    duty = motor_duty(solution)
    load = bearing_load(solution, "A")
    assert law.at(np.array([load.time]))[0] == approx(load.where)
    work = duty.energy_in - duty.energy_out
    # the difference of the energies has the roundings of the larger one
    assert duty.mean_torque * tau == approx(work, abs=ROUND_OFF * duty.energy_in)


@mark.parametrize("speed", [10.0, -10.0])
@mark.parametrize("start, stop", [(0.3, 0.3 + tau), (2.0, 0.3), (0.3, 2.0)])
def test_the_energies_of_a_weight_on_the_crank_are_known_by_hand(start, stop, speed):
    """T = m g a cos(theta_2) and a constant couple.

    Over a turn the energy about the mean goes from -m g a to m g a, whichever way the
    crank turns. A speed against the steps runs the sweep from its end.
    """
    linkage = FourBar(0.3, Bar(0.1, 2.0, 0.0, (0.1, 0.0)), Bar(0.25), Bar(0.22))
    motion = Motion(Sweep(start, stop, 720), speed)
    couple = Load(2, moment=-0.7)
    duty = motor_duty(solve(Scene(linkage, motion, loads=(couple,), effects=WEIGHT)))
    turned = copysign(1.0, speed) * abs(stop - start)
    first, last = (start, stop) if turned * (stop - start) > 0.0 else (stop, start)
    lifted = 2.0 * 9.81 * 0.1 * (sin(last) - sin(first))
    given = duty.energy_in - duty.energy_out
    assert given == approx(lifted + 0.7 * turned, rel=INTEGRATED)
    assert min(duty.energy_in, duty.energy_out) >= 0.0
    assert duty.closed == (stop - start > 6.0)
    if duty.closed:
        assert duty.mean_torque == approx(0.7, rel=INTEGRATED)
        assert duty.energy_swing == approx(2.0 * 2.0 * 9.81 * 0.1, rel=INTEGRATED)


def test_the_json_holds_the_duty():
    s = solve(crank_rocker(Motion(Sweep(0.1, 0.1 + tau, 60), 10.0)))
    duty = motor_duty(s)
    entry = list_duty(s, units("imperial"))
    inch = 0.0254
    pound = 0.45359237 * 9.80665
    assert entry["units"]["rms_power"] == "hp"
    assert entry["units"]["energy_out"] == "lbf in"
    for printed, unit, number in (
        (entry["rms_power"], 6600.0 * inch * pound, duty.rms_power),
        (entry["energy_out"], inch * pound, duty.energy_out),
        (entry["pins"]["B"]["rms"], pound, bearing_load(s, "B").rms),
    ):
        assert printed * unit == approx(number, rel=ROUND_OFF)


@mark.parametrize("stop", [0.1 + tau, 2.5])
def test_a_list_has_peaks_and_means_of_its_positions_and_no_energies(stop):
    """Nothing stands between them; equal ends of a turn count once in a mean."""
    s = solve(crank_rocker(Motion(np.linspace(0.1, stop, 61), 10.0)))
    assert describe_motion(s).solve_with_peaks() is s
    duty = motor_duty(s)
    assert duty.peak_power == abs(s.power).max()
    counted = s.power[: 61 - (stop > tau)]
    assert duty.rms_power == approx(np.sqrt(np.mean(counted**2)), rel=ROUND_OFF)
    assert (duty.energy_in, duty.energy_swing, duty.mean_torque) == (None, None, None)
    load = np.hypot(*s.F32.T)
    assert bearing_load(s, "A")[::2] == (load.max(), s.theta_2[load.argmax()])
    assert bearing_load(s, "A").time is None


def test_a_study_has_shaking_and_its_members_a_duty():
    study = solve(vary(crank_rocker(), {"bars.input.mass": [0.2, 0.3]}))
    for ask in (motor_duty, lambda solution: bearing_load(solution, "A")):
        with raises(InputError, match="members of a study one by one"):
            ask(study)


def test_a_study_of_a_motion_law_keeps_its_time():
    law = Law((0.0, 0.5, 1.0, 1.5, 2.0), (0.0, 0.0, 2.0, 2.0, 0.0), 20, "rest")
    scene = crank_rocker(Motion(law=law), loads=())
    study = solve(vary(scene, {"bars.input.mass": [0.2, 0.2]}))
    alone = solve(scene)
    assert np.array_equal(study.time, [alone.time, alone.time])
    heading, *rows = study.to_csv().splitlines()
    assert heading.split(",").count("time") == 1 and len(rows) == 2 * 21


@mark.slow
def test_a_turn_on_a_part_of_which_a_spring_is_wound_has_no_energies():
    """A spring keeps what it is given: the energies of the rest would be no turn's."""
    torsion = Torsion.at(A=(2.0, radians(86.0), 0.0))
    scene = crank_rocker(Motion(Sweep(0.0, tau, 120), 1.0), effects=(torsion,))
    duty = motor_duty(solve(scene))
    assert duty.closed
    assert (duty.energy_in, duty.energy_out, duty.energy_swing) == (None, None, None)
