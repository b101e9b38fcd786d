"""Free motion against exact solutions and free bodies."""

import pickle
import re
from dataclasses import replace
from math import pi, radians

import numpy as np
from pytest import approx, mark, raises
from scipy.optimize import brentq

from fourbar import (
    Bar,
    Flywheel,
    FourBar,
    FourBarError,
    Free,
    Friction,
    Gravity,
    InputError,
    Load,
    Motion,
    Place,
    Scene,
    Spring,
    Springs,
    Torsion,
    release,
    solve,
    uniform,
)
from fourbar.errors import LimitError
from fourbar.evaluation import free_motion
from fourbar.evaluation.free_motion import release_at
from fourbar.formulas.mobility import TURN
from fourbar.scene import Command
from fourbar_validation.engines.free_body import FreeBody
from tests.support.scenes import (
    MASSLESS,
    PARALLELOGRAM,
    bare,
    crank_rocker,
    find_angle,
)

HANGING = replace(crank_rocker().linkage, ground_angle=0.0)
DOWN = Gravity()


def let_go(theta_2, omega_2, duration, steps, *effects, linkage=HANGING):
    motion = Motion(theta_2, omega_2, free=Free(duration, steps))
    return Scene(linkage, motion, effects=effects)


def integrate(linkage, effects, theta_2, omega_2, times, loads=()):
    scene = let_go(theta_2, omega_2, times[-1], 1, *effects, linkage=linkage)
    return release_at(replace(scene, loads=loads), times)


@mark.parametrize("bar", [2, 4])
def test_a_flywheel_alone_turns_evenly_faster_under_a_constant_couple(bar):
    """Bars without mass, of a drag link: alpha = M/J."""
    linkage, times = bare(0.1, 0.25, 0.3, 0.28), np.linspace(0.0, 2.0, 21)
    couple = Load(bar, moment=0.2)
    m = integrate(linkage, [Flywheel(0.5, bar)], 0.3, 1.0, times, [couple])
    s = solve(Scene(linkage), "position", at=m.command)
    start = solve(Scene(linkage, Motion(0.3, 1.0)), "velocity")
    angle, speed = {2: (s.theta_2, 1.0), 4: (s.theta_4, start.omega_4[0])}[bar]
    assert angle - angle[0] == approx(speed * times + 0.2 * times**2, abs=1e-11)


def test_a_motion_that_has_stopped_is_handed_to_another_process():
    terms = DOWN, Friction.at(O2=0.3)
    s = solve(let_go(0.3, 1.0, 5.0, 50, *terms, linkage=HANGING))
    again = pickle.loads(pickle.dumps(s))
    here, there = (one.command_at(np.array([0.0, 4.0])) for one in (s, again))
    assert there.speed[-1] == 0.0 and there.angle.tolist() == here.angle.tolist()


ROCKER = FourBar(0.3, Bar(0.25, 0.7), Bar(0.1, 1.3), Bar(0.22, 0.9))
"""A double rocker; released at rest at 50 deg, open, it swings through limit positions
of its input.
"""
SWING = let_go(radians(50.0), 0.0, 1.2, 120, DOWN, linkage=ROCKER)
PINS = ("F12", "F32", "F43", "F14")
BY_FREE_BODIES = 1e-12
"""Of the largest force, at one metre of a torque: an angle of bar 4 in doubles, and a
system of 13 equations whose condition is below 1e4.
"""


@mark.parametrize(
    "motion, says",
    [
        (Motion(1.0, 2.0), "motion.free"),
        (SWING.motion.replace(angle=np.array([1.0, 2.0])), "at one angle"),
    ],
)
def test_what_is_not_released_is_refused(motion, says):
    with raises(InputError, match=says):
        release(replace(SWING, motion=motion))


def test_what_has_no_inertia_at_a_dead_centre_is_named_with_its_place():
    """Bar 4, which alone has a mass, stands still there whatever bar 2 does.

    Bars 2 and 3 are in line, and B is at 0.25 m - 0.1 m from O2.
    """
    linkage = FourBar(0.3, Bar(0.1), Bar(0.25), Bar(0.22, 2.0))
    dead = pi + find_angle(0.22, 0.3, 0.15)
    falling = let_go(radians(100.0), 0.0, 0.5, 100, DOWN, linkage=linkage)
    with raises(FourBarError, match="give each bar its mass") as stopped:
        release(falling)
    angle = float(re.search(r"theta_2 = ([0-9.]+) deg", str(stopped.value))[1])
    assert radians(angle) == approx(dead, abs=1e-3)


LEAST_SINE = 1e-2
"""Nearer to a change point free bodies lose their digits, whichever bar is told."""


def compare_with_free_bodies(scene, s):
    """Compare pin forces with those of free bodies that move so, without a drive."""
    F = np.stack([s[name] for name in PINS], axis=1)
    size = np.max(np.hypot(F[..., 0], F[..., 1]))
    # each position by the bar between whose others the sine is the larger
    sines = {2: np.sin(s.theta_4 - s.theta_3), 4: np.sin(s.theta_3 - s.theta_2)}
    for bar, other in ((2, 4), (4, 2)):
        rows = abs(sines[bar]) >= np.fmax(abs(sines[other]), LEAST_SINE)
        if not rows.any():
            continue
        names = (f"{name}_{bar}" for name in ("theta", "omega", "alpha"))
        angle, *rates = (s[name][rows] for name in names)
        signs = np.sign(sines[bar][rows]).astype(np.int8)
        motion = Motion(**{f"theta_{bar}": 1.0, f"omega_{bar}": 1.0})
        told = replace(scene, motion=motion, drive_bar=bar)
        answer = FreeBody().answer(told, Command(angle, signs, *rates, bar=bar))
        lost = BY_FREE_BODIES * size / abs(sines[bar][rows]) ** 3
        for k, name in enumerate(PINS):
            apart = np.hypot(*(F[rows, k] - answer.quantities[name]).T)
            assert (apart <= lost).all(), name
        # nothing drives the bar that is told
        assert (abs(answer.quantities["torque"]) <= lost).all()


@mark.slow
def test_pin_forces_pass_a_limit_position_smoothly():
    """theta_2, omega_2, alpha_2 as doubles do not hold the forces there.

    The angle of bar 4 does, by which free bodies are told to move.
    """
    coarse = solve(SWING, "position")

    def find_sine(time):
        at = coarse.command_at(np.array([time]))
        return solve(SWING, "position", at=at).sin_mu[0]

    row = int(np.argmax(coarse.branch != coarse.branch[0]))
    line = brentq(find_sine, *coarse.time[row - 1 : row + 1], xtol=1e-15)
    distances = np.logspace(-14, -2, 49)
    dense = line + np.concatenate([-distances[::-1], [0.0], distances])
    times = np.unique(np.concatenate([np.linspace(0.0, 1.2, 121), dense]))
    s = solve(SWING, "force", at=coarse.command_at(times))
    assert set(s.status) == {"ok"}
    assert set(s.branch) == {1, -1} and abs(s.sin_mu).min() < 1e-12
    assert not np.any(s.torque)
    compare_with_free_bodies(SWING, s)


def test_what_begins_to_move_against_friction_does_so_at_once():
    s = solve(let_go(0.3, 0.0, 1e-4, 2, DOWN, Friction.at(O4=0.02)))
    assert s.alpha_2[0] != 0.0
    assert np.allclose(s.alpha_2, s.alpha_2[1], rtol=1e-5)
    for force in PINS:
        then = s[force]
        assert np.allclose(then, then[1], rtol=1e-4, atol=1e-5)


@mark.slow
@mark.parametrize("preload", (0.0, 5.0))
def test_a_spring_between_places_that_are_one_is_refused_where_it_is_released(preload):
    """Rounding gives its pull a direction that differs at each step.

    The integration would never end.
    """
    ends = Place(3, (0.25, 0.0)), Place(4, (0.22, 0.0))
    on_B = Spring(*ends, 200.0, 0.05, preload)
    with raises(LimitError, match="springs: two points coincide"):
        release(let_go(0.5, 0.0, 1.0, 50, DOWN, Springs((on_B,))))
    proportional = replace(on_B, length=0.0, preload=0.0)  # pulls with 0 there
    alone = let_go(0.5, 0.0, 1.0, 50, DOWN)
    with_it = replace(alone, effects=(DOWN, Springs((proportional,))))
    one, other = (release(each).command.theta_2 for each in (with_it, alone))
    assert abs(one - other).max() < 1e-9


@mark.parametrize("sense", [1.0, -1.0])
def test_dry_friction_slows_a_flywheel_evenly_until_it_stands(sense):
    """Bars without mass: J alpha = -f, and rest after 0.5 s."""
    times = np.linspace(0.0, 1.0, 11)
    effects = [Flywheel(0.5), Friction.at(O2=0.4)]
    m = integrate(MASSLESS, effects, 0.3, 0.4 * sense, times)
    assert abs(m.omega_2 - sense * np.maximum(0.4 - 0.8 * m.time, 0.0)).max() < 1e-9


@mark.parametrize("speed", [20.0, -20.0])
def test_the_input_keeps_its_turns_while_the_output_is_read(speed):
    """A drag link that falls over is read in bar 4 where bar 2 is near a limit."""
    linkage = uniform(0.1, 0.15, 0.2, 0.2)
    released = release(let_go(1.0, speed, 0.6, 120, DOWN, linkage=linkage))
    assert {*released.command.origin.bar} == {2, 4}
    turned = np.diff(released.theta_2)
    even = 0.5 * (released.omega_2[1:] + released.omega_2[:-1]) * np.diff(released.time)
    assert abs(turned - even).max() < 0.02
    assert abs(released.theta_2[-1] - 1.0) > 1.5 * TURN


def test_change_points_of_several_turns_are_noted_when_they_are_passed():
    """A flywheel turns a massless parallelogram evenly.

    All bars are in line at each half turn of the input.
    """
    linkage = bare(*PARALLELOGRAM, 0.2)
    for speed in (10.0, -10.0):
        released = release(let_go(0.5, speed, 1.5, 6, Flywheel(0.3), linkage=linkage))
        turned = 0.5 - 0.2 if speed < 0.0 else pi - (0.5 - 0.2)
        right = [(turned + k * pi) / 10.0 for k in range(5)]
        right = [t for t in right if t < 1.5]
        assert released.change_points == approx(right, abs=1e-9)
        assert abs(released.command.omega_2 - speed).max() < 1e-9
        assert set(released.command.branch) == {1}


@mark.slow
def test_a_released_spring_is_followed_up_to_half_a_turn_and_no_further():
    spring = Torsion.at(O2=(0.01, 0.5, 0.0))
    assert len(release(let_go(0.5, 1.0, 0.2, 4, DOWN, spring)).command.time) == 5
    pins = {"O2": (0.01, 0.5, 0.0), "A": (0.01, 0.5, 0.0)}
    said = []
    for names in (("O2", "A"), ("A", "O2")):  # the first that is wound is named
        springs = Torsion.at(**{pin: pins[pin] for pin in names})
        with raises(LimitError) as caught:
            release(let_go(0.5, 40.0, 0.2, 40, DOWN, springs))
        said.append(str(caught.value))
    assert said[0] == said[1]
    wound = r"effects\.torsion\.(O2|A): at 0.*turned \1 by more than half.*duration"
    assert re.search(wound, said[0])


@mark.parametrize(
    "omega, moment, gain, power, drift",
    [
        # from rest all kinetic energy E is work, and 1.01 E the largest of both
        (0.0, 0.2, 1.01, 0.0, 0.01 / 1.01),
        (5.0, 0.0, 1.0, 1e-6, 1e-6 * 0.5 / (0.5 * 0.3 * 5.0**2)),
    ],
)
def test_the_drift_is_a_part_of_the_largest_energy_or_work(
    monkeypatch, omega, moment, gain, power, drift
):
    """Work is counted wrongly by a known part, which the drift then is."""
    true = free_motion._Reading.compute_rates

    def count_wrongly(*arguments):
        theta_2, theta_4, growth, of_work = true(*arguments)
        return [theta_2, theta_4, growth, gain * of_work + power]

    monkeypatch.setattr(free_motion._Reading, "compute_rates", count_wrongly)
    linkage, times = bare(0.1, 0.25, 0.3, 0.28), np.linspace(0.0, 0.5, 6)
    couple = Load(2, moment=moment)
    released = integrate(linkage, [Flywheel(0.3)], 0.9, omega, times, [couple])
    assert released.energy_drift == approx(drift, rel=1e-6)
