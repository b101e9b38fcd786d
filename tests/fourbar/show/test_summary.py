"""Facts of a motion against a dense scan of `solve`, and releases by the energy."""

import math
import time
from dataclasses import replace
from itertools import pairwise
from math import pi, sin, sqrt, tau
from pathlib import Path

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss
from pytest import approx
from scipy.integrate import quad
from scipy.special import ellipk

import fourbar
from fourbar import Bar, FourBar, Load, Motion, Scene, Sweep, Viscous, solve
from fourbar.files import loads
from fourbar.linkage import MOVING_BARS, PIN_FORCE, PINS
from fourbar.scene import command_at
from fourbar.scene.motion import Law, Rise
from fourbar.show.block import write_motor
from fourbar.show.motion_curves import acts, describe_motion
from fourbar.show.summary import summarize
from fourbar.studies.internal_forces import largest_bending
from tests.support.scenes import CYLINDER, crank_rocker
from tests.support.shares import slow_but

NODES, WEIGHTS = leggauss(600)
"""Positions of each smooth piece of a motion, closer to each other at its ends."""
EXACT = 1e-8
"""Relative: a panel is settled to 1e-9 of the largest value."""
SLIPS = 1e-7
"""Part of the largest relative speed of a pin that is left where it reverses."""
SUMMED = 1e-4
"""Part of the work that a corner of a curve between two positions takes from sums."""
SLOWER = 12.0
"""Times a summary with friction in two pins may take: they are solved together."""
BETWEEN_STEPS = 1e-3
"""What 20 000 steps of a turn miss of an angle that grows as the root at a limit, rad.
"""
SWING = 1e-2
"""Relative, of an integral that is known at the ends of steps of 1/100."""


def fall(duration):
    return Motion(law=Rise("cycloidal", (1.0, 0.5), 0.3, 0.2, duration, 0.1, 12))


def rub(**torques):
    return fourbar.Friction.at(**torques)


WIPER = fourbar.load(Path(__file__).parents[3] / "models" / "gallery" / "wiper.toml")
TURN = Motion(Sweep(0.1, 0.1 + tau, 12), 10.0)
BACK = Motion(Sweep(2.6, 1.3, 12), -4.0)
PULLED = Motion(stroke=Sweep(0.33, 0.17, 37), stroke_speed=-0.2, side="left")
THERE_AND_ON = (0.1, -1.2, 3.7, 0.1 + tau)
CORNERS = tuple(np.radians([0.0, 98.3, 101.3, 104.3, 360.0]))
SPIKE = Load(
    2, (-1.0, 0.3), moment=-0.05, table=fourbar.Table(CORNERS, (0.5, 0.5, 50, 0.5, 0.5))
)
MASSLESS = FourBar(0.3, *map(Bar, (0.1, 0.25, 0.22)))
SCENES = {
    "turn": (crank_rocker(motion=TURN), ""),
    "turn backwards": (crank_rocker(motion=TURN.replace(speed=-10.0)), ""),
    "accelerated": (crank_rocker(motion=TURN.replace(acceleration=5.0)), ""),
    "wiper": (replace(WIPER, motion=WIPER.motion.replace(angle=TURN.angle)), "O4"),
    "part of a turn": (crank_rocker(motion=BACK, drive_bar=4), ""),
    "load with corners": (crank_rocker(motion=TURN, loads=(SPIKE,)), ""),
    "fall in 5 ms": (crank_rocker(motion=fall(0.005)), ""),
    "fall in 100 ms": (crank_rocker(motion=fall(0.1)), ""),
    "law of a table": (
        crank_rocker(
            motion=Motion(law=Law((0.0, 1.0, 2.0), (0.3, 2.0, 1.0), 20, "rest")),
            effects=(rub(O2=0.05),),
        ),
        "O2",
    ),
    "closed law that goes back": (
        crank_rocker(
            motion=Motion(law=Law((0.0, 0.2, 0.5, 1.0), THERE_AND_ON, 16, "periodic")),
            effects=(Viscous.at(O2=0.01),),
        ),
        "",
    ),
    "stroke": (
        crank_rocker(motion=PULLED, drive=CYLINDER, effects=(rub(O4=0.01),)),
        "O4",
    ),
    "nothing acts": (Scene(MASSLESS, TURN), ""),
}
"""Scenes, and the pin at which dry friction acts."""


def list_sizes(scene, s):
    """List the sizes of what a summary has the peaks of, by name."""
    drive, speed = "drive_force", s.stroke_speed
    if s.drive is None:
        drive, speed = "torque", getattr(s, f"omega_{s.drive_bar}")
    curves = {drive: getattr(s, drive), "power": s.power, "speed": speed}
    for name in PIN_FORCE.values():
        curves[name] = np.hypot(*getattr(s, name).T)
    for bar in MOVING_BARS:
        curves[f"bending_{bar}"] = largest_bending(scene, s, bar).moment
        if not acts(scene):
            curves |= {n: getattr(s, n) for n in (f"omega_{bar}", f"alpha_{bar}")}
    return {name: np.abs(values) for name, values in curves.items()}


def find_slip(s, pin):
    """Return the relative speed of the two bars at a pin, rad/s."""
    first, second = PINS[pin]
    turned = getattr(s, f"omega_{second}")
    return turned if first == 1 else turned - getattr(s, f"omega_{first}")


def scan(scene, ends, *corners):
    """Return places in the pieces between corners, and weights that integrate."""
    low, high = np.sort(ends)
    edges = np.unique([low, high, *(x for x in corners if low < x < high)])
    centres = [(0.5 * (start + stop), stop - start) for start, stop in pairwise(edges)]
    places = [centre + 0.5 * width * NODES for centre, width in centres]
    weights = [0.5 * width * WEIGHTS for _, width in centres]
    return np.concatenate(places), np.concatenate(weights)


@pytest.mark.parametrize(
    "name",
    slow_but({"turn", "load with corners", "fall in 5 ms", "stroke"}, SCENES),
)
def test_facts_are_those_of_a_dense_scan(name):
    scene, pin = SCENES[name]
    solution = solve(scene)
    facts = summarize(scene, solution)
    panels = facts.motion.panels
    assert not panels.growing
    ends = solution.at.places[[0, -1]]
    law = scene.motion.law
    corners = [] if law is None else [*law.time]
    corners += [x + k * tau for x in CORNERS for k in (0, 1) if "corners" in name]
    assert [found for _, found in facts.motion.reversals] == [pin] * (
        len(facts.motion.breaks) if pin else 0
    )
    if pin:
        slips = find_slip(solve(scene, at=command_at(scene, scan(scene, ends)[0])), pin)
        left = find_slip(facts.motion.solve_at(facts.motion.breaks), pin)
        assert len(left) == np.count_nonzero(slips[1:] * slips[:-1] < 0.0) > 0
        assert np.abs(left).max() < SLIPS * np.abs(slips).max()
        corners += facts.motion.breaks.tolist()
    places, weights = scan(scene, ends, *corners)
    dense = solve(scene, at=command_at(scene, places))
    sizes = list_sizes(scene, dense)
    with_peaks = facts.motion.solve_with_peaks()
    assert np.isin(solution.at.places, with_peaks.at.places).all()
    assert (np.diff(with_peaks.at.places) * (ends[1] - ends[0]) > 0.0).all()
    shown = list_sizes(scene, with_peaks)
    for quantity, size in sizes.items():
        peak = panels.find_peak(quantity)
        assert size.max() <= abs(peak.value) * (1.0 + EXACT) + 1e-12, quantity
        (there,) = list_sizes(scene, facts.motion.solve_at(np.array([peak.place])))[
            quantity
        ]
        assert there == approx(abs(peak.value), rel=EXACT, abs=1e-12), quantity
        if quantity in (*PIN_FORCE.values(), "power", "speed"):
            most = shown[quantity].max()
            assert most == approx(abs(peak.value), rel=EXACT, abs=1e-12)
    for bar, (low, high) in facts.angles.items():
        angles = getattr(dense, f"theta_{bar}")
        assert low.value - EXACT <= angles.min() <= angles.max() <= high.value + EXACT
        reached = facts.motion.solve_at(np.array([low.place, high.place]))
        away = getattr(reached, f"theta_{bar}") - [low.value, high.value]
        assert np.abs(np.sin(0.5 * away)).max() < EXACT
        assert facts.bending[bar].peak == panels.find_peak(f"bending_{bar}")
    sines = np.abs(dense.sin_mu)
    assert sin(facts.transmission.value) <= sines.min() * (1.0 + EXACT)
    (sine,) = facts.motion.solve_at(np.array([facts.transmission.place])).sin_mu
    assert abs(sine) == approx(sin(facts.transmission.value), rel=EXACT)
    for bar, rates in facts.rates.items():
        if not acts(scene):
            assert rates == tuple(
                panels.find_peak(f"{letter}_{bar}") for letter in ("omega", "alpha")
            )
    check_entry(scene, facts, dense, weights)


def check_entry(scene, facts, dense, weights):
    """Check the numbers of the JSON against sums over the positions of a scan."""
    entry = write_motor(scene, facts.solution, {})
    panels = facts.motion.panels
    drive, *_ = sizes = list_sizes(scene, dense)
    kind = "torque" if drive == "torque" else "force"
    peaks = {f"peak_{kind}": drive, "peak_power": "power", "peak_speed": "speed"}
    for key, quantity in peaks.items():
        assert entry[key] == abs(panels.find_peak(quantity).value)
    assert facts.peak == panels.find_peak(drive)
    steady = not np.any(scene.motion.acceleration)
    means = {
        quantity: approx(sqrt(weights @ size**2 / weights.sum()), rel=EXACT, abs=1e-12)
        if steady
        else None
        for quantity, size in sizes.items()
    }
    assert entry[f"rms_{kind}"] == means[drive] and entry["rms_power"] == means["power"]
    for pin, name in PIN_FORCE.items():
        of_pin = entry["pins"][pin]
        peak = panels.find_peak(name)
        assert (of_pin["peak"], of_pin["rms"]) == (peak.value, means[name])
        assert facts.pins[pin] == (peak, of_pin["rms"])
        assert of_pin["theta_2"] == facts.motion.find_theta_2(peak.place)
    if not steady:
        assert (
            entry["energy_in"] is entry["energy_out"] is entry["energy_swing"] is None
        )
        return
    pace = abs(scene.motion.speed) if scene.motion.law is None else 1.0
    work = weights * dense.power / pace
    most = np.abs(work).sum()
    for key, sign in (("energy_in", 1.0), ("energy_out", -1.0)):
        right = np.maximum(sign * work, 0.0).sum()
        assert entry[key] == approx(right, abs=SUMMED * most)
    first, last = facts.solution.at.angle[[0, -1]]
    closed = math.isclose(abs(last - first), tau)
    assert entry["closed"] == closed
    if not closed:
        assert entry["mean_torque"] is entry["energy_swing"] is None
        return
    sense = math.copysign(tau, np.mean(dense.at.speed))
    mean = work.sum() / sense
    assert entry["mean_torque"] == approx(mean, abs=SUMMED * sizes[drive].max())
    surplus = np.cumsum(work - work.sum() * weights / weights.sum())
    assert entry["energy_swing"] == approx(np.ptp(surplus), rel=SWING, abs=1e-12)


def test_a_list_has_its_own_peaks_and_means():
    angles = np.array([0.3, 2.5, 0.4])
    scene = crank_rocker(motion=Motion(angles, 10.0))
    solution = solve(scene)
    assert describe_motion(solution).solve_with_peaks() is solution
    entry = write_motor(scene, solution, {})
    assert entry["peak_torque"] == np.abs(solution.torque).max()
    rms = sqrt(np.square(solution.torque).mean())
    assert entry["rms_torque"] == approx(rms, rel=EXACT)


@pytest.mark.slow
def test_forces_whose_squares_overflow_have_the_peaks_and_means_of_smaller_ones():
    """Nothing acts but one force, so that everything is in proportion to it."""
    small, huge = (
        summarize(scene, solve(scene))
        for force in (1.0, 1e300)
        for load in [Load(3, (force, 0.4), from_pin=(0.05, 0.0))]
        for scene in [Scene(MASSLESS, TURN, loads=(load,))]
    )
    names = ("peak_torque", "rms_torque", "peak_power", "rms_power", "energy_in")
    pairs = [(getattr(huge.duty, n), getattr(small.duty, n)) for n in names]
    pairs += [(huge.pins[pin].rms, load.rms) for pin, load in small.pins.items()]
    for large, usual in pairs:
        assert large / 1e300 == approx(usual, rel=EXACT)


BUCKET = """
[lengths]
ground = "16.5 in"
input = "23.6 in"
coupler = "22 in"
output = "17.7 in"
ground_angle = "-65 deg"
[bars.output]
mass = "1650 lb"
centre = ["26 in", "-75 deg"]
[motion]
stroke = { from = "44 in", to = "90.6 in", steps = 12 }
stroke_speed = "3 in/s"
side = "left"
[drive]
from = { bar = 1, from_pin = ["67 in", "172 deg"] }
to = { bar = 2, from_pin = ["23.6 in", "0 deg"] }
[effects]
gravity = ["1 g_0", "-90 deg"]
"""
PIN = '{ coefficient = 0.15, radius = "2 in" }'
FRICTION = f"pin_friction = {{ A = {PIN}, B = {PIN} }}\n"


@pytest.mark.slow
def test_the_summary_beside_a_dead_point_is_as_quick_with_pin_friction():
    """From 44 in on the linkage does not assemble at first.

    Many couples jam beside the dead point where it begins.
    """
    seconds = []
    for text in (BUCKET, BUCKET + FRICTION):
        scene = loads(text)
        before = time.process_time()
        facts = summarize(scene, solve(scene))
        assert facts.motion.stretches
        seconds.append(time.process_time() - before)

    assert seconds[1] < SLOWER * seconds[0], seconds


EXTREME = 1e-9
"""rad and relative: the dense output of the integrator, and equal extremes."""
ARM, AWAY, CRANK, COUPLER = 0.5, math.radians(25.0), 2.0, 5.0
INERTIA = 2.0 * CRANK * ARM**2 / 3.0 + COUPLER * ARM**2
WEIGHT = 9.8 * (CRANK + COUPLER) * ARM


def release_pendulum(omega, duration, *effects):
    """Release a parallelogram, which is one pendulum: its coupler does not turn.

    The seven instants that it states are never extreme.
    """
    crank = Bar(ARM, CRANK)
    linkage = FourBar(0.6, crank, Bar(0.6, COUPLER), crank)
    free = fourbar.Free(duration, 7)
    motion = Motion(1.5 * pi - AWAY, omega, free=free)
    scene = Scene(linkage, motion, effects=(fourbar.Gravity(9.8), *effects))
    return summarize(scene, solve(scene))


@pytest.mark.slow
def test_a_released_swing_has_its_period_and_the_first_of_equal_extremes():
    """The period of a pendulum is an elliptic integral."""
    facts = release_pendulum(0.0, 1.7)
    slow = sqrt(INERTIA / WEIGHT)
    period = 4.0 * slow * float(ellipk(sin(0.5 * AWAY) ** 2))
    assert facts.period == approx(period, rel=EXTREME)
    low, high = facts.angles[2]
    assert low == approx((1.5 * pi - AWAY, 0.0), abs=EXTREME)
    highest = 1.5 * pi + AWAY
    assert high == approx((highest, 0.5 * period), abs=EXTREME)
    damped = release_pendulum(0.0, 1.7, Viscous((("O2", 1e-6),)))
    assert damped.period is None


def test_a_released_turn_has_its_period():
    """The time of a turn is the integral of 1/omega, by the energy."""
    energy = 0.5 * INERTIA * 30.0**2 - WEIGHT * math.cos(AWAY)

    def compute_slowness(theta):
        return sqrt(0.5 * INERTIA / (energy + WEIGHT * math.cos(theta)))

    period, _ = quad(compute_slowness, 0.0, 2.0 * pi, epsabs=1e-13)
    facts = release_pendulum(30.0, 0.5)
    assert facts.period == approx(period, rel=EXTREME)


@pytest.mark.slow
def test_transmission_angle_is_the_least_of_all_stretches():
    """The coupler rocks in two stretches; the sine of mu is positive in one of them and
    negative in the other.
    """
    inch = 0.0254
    bars = [Bar(length * inch) for length in (0.2906, 1.203, 1.152)]
    linkage = FourBar(1.102 * inch, *bars)

    def sweep(steps):
        angle = Sweep(0.0, tau, steps)
        return Scene(linkage, Motion(theta_3=angle, omega_3=1.0))

    scene = sweep(12)
    least = summarize(scene, solve(scene)).transmission
    dense = solve(sweep(20_000))
    turned = (dense.theta_4 - dense.theta_3) % pi
    scanned = np.nanmin(np.minimum(turned, pi - turned))
    signs = np.sign(dense.sin_mu[np.isfinite(dense.sin_mu)])
    assert {*signs} == {-1.0, 1.0}
    assert least.value == approx(scanned, abs=BETWEEN_STEPS)
