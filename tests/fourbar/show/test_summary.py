"""Facts of a motion against a dense scan of `solve`, and releases by the energy."""

import time
import tomllib
from dataclasses import replace
from itertools import pairwise
from math import asin, cos, pi, radians, sin, sqrt, tau

import numpy as np
from numpy.polynomial.legendre import leggauss
from pytest import approx, mark
from scipy.integrate import quad
from scipy.special import ellipk

from fourbar import (
    Bar,
    FourBar,
    Free,
    Gravity,
    Load,
    Motion,
    Scene,
    Sweep,
    Viscous,
    dump,
    solve,
)
from fourbar.files import loads, scene_file
from fourbar.linkage import MOVING_BARS, PIN_FORCE, PINS
from fourbar.scene import command_at
from fourbar.show.duty import list_duty
from fourbar.show.motion_curves import acts
from fourbar.show.summary import Facts
from fourbar.studies.internal_forces import largest_bending
from fourbar_validation.places import MODELS
from tests.support.rows import slow_but
from tests.support.scenes import MASSLESS, bare, crank_rocker

NODES, WEIGHTS = leggauss(600)
"""Positions of each smooth piece of a motion, closer to each other at its ends."""


EXACT = 1e-8
"""Relative: a panel is settled to 1e-9 of the largest value."""


SIDES = 1e-5
"""Part of the motion within which both sides of a corner are shown."""


WIPER = MODELS / "gallery/wiper.toml"


CORNERS = tuple(np.radians([0.0, 98.3, 101.3, 104.3, 360.0]))


SCENES = tomllib.loads("""
["turn backwards"]
motion.theta_2 = { from = "6 deg", to = "366 deg", steps = 12 }
motion.omega_2 = "-10 rad/s"
["part of a turn"]
motion.theta_2 = { from = "2.6 rad", to = "1.3 rad", steps = 12 }
motion.omega_2 = "-4 rad/s"
drive.bar = 4
["load with corners"]
motion.theta_2 = { from = "6 deg", to = "366 deg", steps = 12 }
motion.omega_2 = "10 rad/s"
[["load with corners".loads]]
bar = 2
force = ["-1 N", "0.3 rad"]
moment = "-0.05 N m"
table.theta_2 = ["0 deg", "98.3 deg", "101.3 deg", "104.3 deg", "360 deg"]
table.factor = [0.5, 0.5, 50.0, 0.5, 0.5]
["fall in 5 ms".motion.law]
kind = "cycloidal"
theta_2 = "0.3 rad"
rise = ["1 rad", "0.5 s"]
dwell = "0.2 s"
fall = "0.005 s"
rest = "0.1 s"
steps = 12
["law of a table"]
motion.law.time = ["0 s", "1 s", "2 s"]
motion.law.theta_2 = ["0.3 rad", "2 rad", "1 rad"]
motion.law.ends = "rest"
motion.law.steps = 20
effects.friction.O2 = "0.05 N m"
["stroke"]
motion.stroke = { from = "0.33 m", to = "0.17 m", steps = 37 }
motion.stroke_speed = "-0.2 m/s"
motion.side = "left"
drive.from = { bar = 1, from_pin = ["0.25 m", "-160 deg"] }
drive.to = { bar = 2, from_pin = ["0.09 m", "0.17 rad"] }
effects.friction.O4 = "0.01 N m"
["nothing acts"]
lengths = { ground = "0.3 m", input = "0.1 m", coupler = "0.25 m", output = "0.22 m" }
motion.theta_2 = { from = "6 deg", to = "366 deg", steps = 12 }
motion.omega_2 = "10 rad/s"
["wiper"]
motion.theta_2 = { from = "6 deg", to = "366 deg", steps = 12 }
motion.omega_2 = "45 rpm"
""")
"""What the scenes state besides the crank-rocker."""
CRANK_ROCKER = tomllib.loads(dump(crank_rocker()))
REVERSES = {"wiper": "O4", "law of a table": "O2", "stroke": "O4"}
"""Pin at which dry friction acts."""


def list_sizes(scene, s):
    """List the sizes of what a summary has the peaks of, by name."""
    drive = "drive_force"
    speed = s.stroke_speed
    if s.drive is None:
        drive = "torque"
        speed = s[f"omega_{s.drive_bar}"]
    curves = {drive: s[drive], "power": s.power, "speed": speed}
    for name in PIN_FORCE.values():
        curves[name] = np.hypot(*s[name].T)
    for bar in MOVING_BARS:
        curves[f"bending_{bar}"] = largest_bending(scene, s, bar).moment
        if not acts(scene):
            curves |= {n: s[n] for n in (f"omega_{bar}", f"alpha_{bar}")}
    return {name: abs(values) for name, values in curves.items()}


def find_slip(s, pin):
    """Return the relative speed of the two bars at a pin, rad/s."""
    first, second = PINS[pin]
    turned = s[f"omega_{second}"]
    return turned if first == 1 else turned - s[f"omega_{first}"]


def scan(scene, ends, *corners):
    """Return places in the pieces between corners, and weights that integrate."""
    low, high = np.sort(ends)
    edges = np.unique([low, high, *(x for x in corners if low < x < high)])
    centres = [(0.5 * (start + stop), stop - start) for start, stop in pairwise(edges)]
    places = [centre + 0.5 * width * NODES for centre, width in centres]
    weights = [0.5 * width * WEIGHTS for _, width in centres]
    return np.concatenate(places), np.concatenate(weights)


@mark.parametrize(
    "name", slow_but({"turn backwards", "load with corners", "stroke"}, SCENES)
)
def test_facts_are_those_of_a_dense_scan(name):
    wholes = {"wiper": tomllib.loads(WIPER.read_text()), "nothing acts": {}}
    scene = scene_file.read_tables(wholes.get(name, CRANK_ROCKER) | SCENES[name])
    pin = REVERSES.get(name, "")
    solution = solve(scene)
    facts = Facts(solution)
    motion = facts.motion
    panels = motion.panels
    assert not panels.growing
    ends = solution.at.places[[0, -1]]
    corners = [*getattr(scene.motion.law, "time", ())]
    corners += [x + k * tau for x in CORNERS for k in (0, 1) if "corners" in name]
    assert {found for _, found in motion.reversals} == {pin} - {""}
    if pin:
        reversals = np.array([place for place, _ in motion.reversals])
        slips = find_slip(solve(scene, at=command_at(scene, scan(scene, ends)[0])), pin)
        left = find_slip(motion.solve_at(reversals), pin)
        assert len(left) == np.count_nonzero(slips[1:] * slips[:-1] < 0.0) > 0
        assert abs(left).max() < 1e-7 * abs(slips).max()
        corners += reversals.tolist()
    places, weights = scan(scene, ends, *corners)
    dense = solve(scene, at=command_at(scene, places))
    with_peaks = motion.solve_with_peaks()
    assert np.isin(solution.at.places, with_peaks.at.places).all()
    assert (np.diff(with_peaks.at.places) * (ends[1] - ends[0]) > 0.0).all()
    for corner in corners:
        beside = np.sort((with_peaks.at.places - corner) / np.ptp(ends))
        if beside[0] < 0.0 < beside[-1]:
            assert beside[beside < 0.0][-1] > -SIDES and beside[beside > 0.0][0] < SIDES
    shown = list_sizes(scene, with_peaks)
    sizes = list_sizes(scene, dense)
    for quantity, size in sizes.items():
        peak = panels.find_peak(quantity)
        assert size.max() <= abs(peak.value) * (1.0 + EXACT) + 1e-12, quantity
        at_peak = list_sizes(scene, motion.solve_at(np.array([peak.place])))
        right = approx(abs(peak.value), rel=EXACT, abs=1e-12)
        assert at_peak[quantity][0] == right, quantity
        if quantity in (*PIN_FORCE.values(), "power", "speed"):
            assert shown[quantity].max() == right
    for bar, ((low, high),) in facts.angles.items():
        angles = dense[f"theta_{bar}"]
        assert low.value - EXACT <= angles.min() <= angles.max() <= high.value + EXACT
        reached = motion.solve_at(np.array([low.place, high.place]))
        away = reached[f"theta_{bar}"] - [low.value, high.value]
        assert abs(np.sin(0.5 * away)).max() < EXACT
        assert facts.bending[bar].peak == panels.find_peak(f"bending_{bar}")
    least = facts.transmission
    assert sin(least.value) <= abs(dense.sin_mu).min() * (1.0 + EXACT)
    (sine,) = motion.solve_at(np.array([least.place])).sin_mu
    assert abs(sine) == approx(sin(least.value), rel=EXACT)
    check_loads(facts, sizes, weights / weights.sum())


def check_loads(facts, sizes, weights):
    """Check the loads of pins and drive, and that the JSON has the same numbers."""
    motion = facts.motion
    panels = motion.panels
    entry = list_duty(facts.solution, {})
    for pin, force in PIN_FORCE.items():
        peak = panels.find_peak(force)
        rms = motion.find_rms(force)
        assert rms == approx(sqrt(weights @ sizes[force] ** 2), rel=EXACT, abs=1e-12)
        theta_2 = motion.find_theta_2(peak.place)
        of_pin = {"peak": peak.value, "rms": rms, "theta_2": theta_2}
        assert of_pin.items() <= entry["pins"][pin].items()
    drive, *_ = sizes
    kind = "torque" if drive == "torque" else "force"
    assert facts.peak == panels.find_peak(drive)
    for key, quantity in ((f"peak_{kind}", drive), ("peak_power", "power")):
        assert entry[key] == abs(panels.find_peak(quantity).value)


@mark.slow
def test_forces_whose_squares_overflow_have_the_peaks_and_means_of_smaller_ones():
    """Nothing acts but one force, so that everything is in proportion to it."""

    def list_numbers(force):
        motion = Motion(Sweep(0.1, 0.1 + tau, 12), 10.0)
        load = Load(3, (force, 0.4), from_pin=(0.05, 0.0))
        facts = Facts(solve(Scene(MASSLESS, motion, loads=(load,))))
        duty = facts.duty
        torques = duty.peak_torque, duty.rms_torque, duty.energy_in
        of_pins = map(facts.motion.find_rms, PIN_FORCE.values())
        return np.array([*torques, duty.peak_power, duty.rms_power, *of_pins])

    assert list_numbers(1e300) / 1e300 == approx(list_numbers(1.0), rel=EXACT)


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


FRICTION = """\
pin_friction.A = { coefficient = 0.15, radius = "2 in" }
pin_friction.B = { coefficient = 0.15, radius = "2 in" }
"""


@mark.slow
def test_the_summary_beside_a_dead_point_is_as_quick_with_pin_friction():
    """From 44 in on the linkage does not assemble at first.

    Many couples jam beside the dead point where it begins.
    """
    seconds = []
    for text in (BUCKET, BUCKET + FRICTION):
        scene = loads(text)
        before = time.process_time()
        assert Facts(solve(scene)).motion.stretches
        seconds.append(time.process_time() - before)
    # friction in two pins is solved together
    assert seconds[1] < 12.0 * seconds[0], seconds


EXTREME = 1e-9
"""rad and relative: the dense output of the integrator, and equal extremes."""


AWAY = radians(25.0)
CRANK = Bar(0.5, 2.0)
COUPLER = Bar(0.6, 5.0)


INERTIA = (2.0 * 2.0 / 3.0 + 5.0) * 0.5**2


WEIGHT = 9.8 * (2.0 + 5.0) * 0.5


def release_pendulum(omega, duration, *effects):
    """Release a parallelogram, which is one pendulum: its coupler does not turn.

    The seven instants that it states are never extreme.
    """
    linkage = FourBar(0.6, CRANK, COUPLER, CRANK)
    motion = Motion(1.5 * pi - AWAY, omega, free=Free(duration, 7))
    return Facts(solve(Scene(linkage, motion, effects=(Gravity(9.8), *effects))))


@mark.slow
def test_a_released_swing_has_its_period_and_the_first_of_equal_extremes():
    """The period of a pendulum is an elliptic integral."""
    facts = release_pendulum(0.0, 1.7)
    period = 4.0 * sqrt(INERTIA / WEIGHT) * float(ellipk(sin(0.5 * AWAY) ** 2))
    assert facts.period == approx(period, rel=EXTREME)
    ((low, high),) = facts.angles[2]
    assert low == approx((1.5 * pi - AWAY, 0.0), abs=EXTREME)
    assert high == approx((1.5 * pi + AWAY, 0.5 * period), abs=EXTREME)
    assert release_pendulum(0.0, 1.7, Viscous.at(O2=1e-6)).period is None


def test_a_released_turn_has_its_period():
    """The time of a turn is the integral of 1/omega, by the energy."""
    energy = 0.5 * INERTIA * 30.0**2 - WEIGHT * cos(AWAY)

    def compute_slowness(theta):
        return sqrt(0.5 * INERTIA / (energy + WEIGHT * cos(theta)))

    period, _ = quad(compute_slowness, 0.0, 2.0 * pi, epsabs=1e-13)
    assert release_pendulum(30.0, 0.5).period == approx(period, rel=EXTREME)


def test_the_angles_of_two_stretches_cover_no_more_than_those_of_one():
    """A turn from 0 has a gap within, a turn from 2 rad at its ends alone."""
    linkage = bare(4.0, 5.0, 3.0, 3.5)
    two, one = (
        Facts(solve(Scene(linkage, Motion(Sweep(start, start + tau, 24)))))
        for start in (0.0, 2.0)
    )
    assert (len(two.motion.stretches), len(one.motion.stretches)) == (2, 1)
    for bar in (3, 4):
        ranges = (facts.angles[bar][0] for facts in (two, one))
        cover, whole = (high.value - low.value for low, high in ranges)
        assert cover == approx(whole, abs=1e-6)  # a limit leaves the root of rounding


def test_three_stretches_of_a_turn_are_two_swings_that_make_a_turn():
    """The sweep begins inside one of two circuits and cuts it in two.

    Bar 4 turns fully: it goes on in one circuit, and back in the other.
    """
    motion = Motion(Sweep(pi / 4.0, -7.0 * pi / 4.0, 24))
    facts = Facts(solve(Scene(bare(0.3, 0.31, 0.14, 0.11), motion)))
    widths = [high.value - low.value for low, high in facts.angles[4]]
    assert (len(facts.motion.stretches), len(widths)) == (3, 2)
    assert sum(widths) == approx(tau, abs=1e-5)  # limits leave roots of rounding


def test_angles_have_the_turn_of_the_first_position():
    """Bar 4 passes 180 deg between that and the first node of the curves."""
    (at_start,) = solve(Scene(MASSLESS, Motion(1.5))).theta_4
    turned = pi - 1e-3 - at_start
    sweep = Sweep(1.5 + turned, 2.5 + turned, 8)
    scene = Scene(replace(MASSLESS, ground_angle=turned), Motion(sweep))
    ((low, _),) = Facts(solve(scene)).angles[4]
    assert low.value == approx(pi - 1e-3)


@mark.slow
def test_transmission_angle_is_the_least_of_all_stretches():
    """The coupler rocks in two stretches, of which the sine of mu has both signs."""
    linkage = bare(1.102, 0.2906, 1.203, 1.152)
    scene, fine = (
        Scene(linkage, Motion(theta_3=Sweep(0.0, tau, steps), omega_3=1.0))
        for steps in (12, 20_000)
    )
    sines = solve(fine).sin_mu
    assert np.nanmin(sines) < 0.0 < np.nanmax(sines)
    least = Facts(solve(scene)).transmission
    # 20 000 steps of a turn miss an angle that grows as the root at a limit
    assert least.value == approx(asin(np.nanmin(abs(sines))), abs=1e-3)


def test_transmission_angle_of_a_release_is_zero_on_its_change_points():
    scene = Scene(
        FourBar(0.3, Bar(0.1), Bar(0.3), Bar(0.1, mass=1.0)),
        Motion(0.5, 10.0, free=Free(0.7, 6)),
    )
    solution = solve(scene)
    assert Facts(solution).transmission == (0.0, solution.change_points[0])
