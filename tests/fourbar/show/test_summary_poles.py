"""Summaries of motions that pass a pole, a change point or a gap between two positions
of the sweep.
"""

import math
from dataclasses import replace
from math import pi, tau
from pathlib import Path

import numpy as np
import pytest
from pytest import approx
from scipy.optimize import brentq

import fourbar
from fourbar import Bar, Gravity, Load, Motion, Scene, Sweep, solve, uniform
from fourbar.effects import PinFriction, Place, PointDrive
from fourbar.linkage import PIN_FORCE
from fourbar.scene import command_at
from fourbar.show.block import write_facts, write_motor
from fourbar.show.motion_curves import describe_motion
from fourbar.show.summary import summarize
from tests.fourbar.show.test_summary import list_sizes
from tests.support.scenes import CYLINDER, crank_rocker
from tests.support.shares import slow_but

GROWN = 2.5
"""Times that a size grows from a distance of 1e-4 of a pole to 1e-6 of it: at least as
a root, by 10, and what has a bound hardly.
"""
LOCATED = 1e-6
"""rad; near a limit an angle changes as the root of the distance, whose last digits are
some 1e-16.
"""
PEAK = 1e-9
"""Relative, of a largest value: a panel settles to that."""
GRAVITY = Gravity(9.81)
CRANK_ROCKER = (0.3, 0.1, 0.25, 0.22)
PARALLELOGRAM = (0.3, 0.1, 0.3, 0.1)


def sweep(lengths, start, stop, bar=2, **parts):
    """Make a scene of bars of 1 kg/m under gravity, between two angles of a bar."""
    rates = {f"theta_{bar}": Sweep(start, stop, 20), f"omega_{bar}": 10.0}
    scene = Scene(uniform(*lengths), Motion(**rates), effects=(GRAVITY,))
    return replace(scene, **parts)


def find_facts(scene):
    return summarize(scene, solve(scene))


def write(facts, **options):
    lines = write_facts(facts, **options)
    return " ".join(" ".join(lines).split())


def find_angle(side, first, second):
    """Return the angle between two sides of a triangle, opposite to the third."""
    return math.acos((first**2 + second**2 - side**2) / (2.0 * first * second))


def find_dead(lengths):
    """List the angles of bar 2 at which bars 2 and 3 are in line."""
    d, a, b, c = lengths
    return [find_angle(c, d, b + a), find_angle(c, d, b - a) + pi]


def clamp(last):
    """Make a toggle clamp whose bars 2 and 3 would be in line at -6e-5 deg."""
    scene = fourbar.from_pins((0.0, 0.0), (0.04, 0.002), (0.08, 0.0), (0.08, -0.06))
    angle = Sweep(math.atan2(2.0, 40.0), math.radians(last), 20)
    return replace(
        scene,
        motion=Motion(angle, 0.0, branch=scene.motion.branch),
        loads=(Load(2, (100.0, -0.5 * pi), from_pin=(0.16, 0.4)),),
        drive=PointDrive(Place(4, (0.1, 0.0)), 0.0),
        drive_bar=None,
    )


def find_stroke_speed(scene, angle):
    at = command_at(scene, np.array([angle]))
    speed = solve(scene, "velocity", at=at).stroke_speed
    return float(speed[0])


MODELS = Path(__file__).parents[3] / "models"
LEVER, ON_GROUND = (place.from_pin for _, place in reversed(CYLINDER.ends))
IN_LINE = crank_rocker().linkage.ground_angle + ON_GROUND[1] - LEVER[1]
DEAD, FOLDED = find_dead(CRANK_ROCKER)
LIMITS = [pi - find_angle(reach, 0.3, 0.22) for reach in (0.35, 0.15)]
STRAIGHT = 2.0 * math.hypot(0.04, 0.002)
CLAMPED = find_angle(0.06, 0.1, STRAIGHT) - math.atan2(0.06, 0.08)
DIGGER = fourbar.load(MODELS / "capabilities" / "cylinder_1_4.toml")
MET = brentq(lambda angle: find_stroke_speed(DIGGER, angle), 0.8, 1.0)
"""Angle of bar 2 where the cylinder of a model has no lever."""
RUBBING = (PinFriction.at(O4=(0.12, 0.006)), Gravity())
POLES = {
    "cylinder in line with the crank": (
        crank_rocker(motion=sweep(CRANK_ROCKER, 0.1, 0.1 + tau).motion, drive=CYLINDER),
        [IN_LINE + pi, IN_LINE + tau],
    ),
    "torque on the output": (
        sweep(CRANK_ROCKER, 0.0, tau, drive_bar=4),
        [DEAD, FOLDED],
    ),
    "change points": (
        sweep(PARALLELOGRAM, 5.0, 5.0 + tau),
        [tau, 3 * pi],
    ),
    "change points, backwards": (sweep(PARALLELOGRAM, 6.3, 0.5), [tau, pi]),
    "change point of the output": (
        sweep(
            (0.36419445229114195, 0.3900709389998438) * 2, 0.09, 4.489191916441563, 4
        ),
        [pi],
    ),
    "friction that grows with its load": (
        sweep((0.06, 0.18, 0.06, 0.18), -0.7, 0.7, 4, drive_bar=4, effects=RUBBING),
        [0.0],
    ),
    "cylinder where friction reverses": (DIGGER, [MET]),
    "limits of the output": (sweep(CRANK_ROCKER, 1.5, 3.5, 4), LIMITS),
    "toggle clamp that stops before": (clamp(0.0), []),
    "toggle clamp that goes beyond": (clamp(-2.0), [CLAMPED]),
}
"""Scenes, and the places at which something grows without bound, in their order."""


@pytest.mark.parametrize(
    "name",
    slow_but({"cylinder in line with the crank", "limits of the output"}, POLES),
)
def test_what_grows_without_bound_is_no_number_anywhere(name):
    scene, places = POLES[name]
    facts = find_facts(scene)
    panels = facts.motion.panels
    far, near = (
        list_sizes(scene, solve(scene, at=command_at(scene, np.ravel(beside))))
        for away in (1e-4, 1e-6)
        for beside in [np.add.outer(places, [-away, away])]
    )
    with np.errstate(all="ignore"):
        growth = {
            quantity: np.nan_to_num(near[quantity] / size).max(initial=0.0)
            for quantity, size in far.items()
        }
    growing = {quantity for quantity, times in growth.items() if times > GROWN}
    assert panels.growing == growing
    for quantity in growing:
        poles = panels.list_poles(quantity)
        assert np.abs(np.subtract.outer(poles, places)).min(axis=1).max() < LOCATED
    entry = write_motor(scene, facts.solution, {})
    for pin, force in PIN_FORCE.items():
        peaks = facts.pins[pin].peak, facts.pins[pin].rms, entry["pins"][pin]["peak"]
        assert [peak is None for peak in peaks] == [force in growing] * 3
    drive, *_ = far
    kind = "torque" if drive == "torque" else "force"
    numbers = facts.peak, entry[f"peak_{kind}"], entry[f"rms_{kind}"]
    assert [number is None for number in numbers] == [drive in growing] * 3
    text = write(facts, pressure=1e6)
    head = f"{kind} grows without bound at {scene.motion.commanded} = "
    assert (head in text) == (drive in growing)
    if drive in growing:
        poles = panels.list_poles(drive)
        assert poles == approx(places, abs=LOCATED)
        written = [f"{math.degrees(pole):.4g} deg" for pole in poles]
        assert head + " and ".join(written).replace("-0 ", "0 ") in text
        sized = scene.drive is None or facts.stroke_range is not None
        assert ("none is enough, as the" in text) == sized


@pytest.mark.slow
def test_a_torque_is_largest_where_pin_forces_have_a_pole():
    """T2 = (0.05 + 0.3 + 0.05) kg g 0.1 m cos(theta_2), largest at change points."""
    for start, stop in ((-1.0, 1.0), (1.0, -1.0), (2.0, 4.0)):
        facts = find_facts(sweep(PARALLELOGRAM, start, stop))
        weight = math.copysign(0.4 * 9.81 * 0.1, facts.peak.value)
        assert facts.peak.value == approx(weight, rel=PEAK)
        assert abs(math.sin(facts.peak.place)) < LOCATED
        assert facts.motion.panels.growing == {*PIN_FORCE.values()}


@pytest.mark.slow
def test_power_beside_a_pole_of_the_torque_has_its_peak_and_mean():
    """Whichever bar is driven, it gives the same power."""
    scene, _ = POLES["torque on the output"]
    duty, right = (
        fourbar.motor_duty(solve(replace(scene, drive_bar=bar))) for bar in (4, 2)
    )
    for name in ("peak_power", "rms_power", "energy_in", "energy_out"):
        number = approx(getattr(right, name), rel=LOCATED)
        assert getattr(duty, name) == number, name
    scene, _ = POLES["cylinder in line with the crank"]
    facts = find_facts(scene)
    assert facts.duty.peak_speed == approx(10.0 * LEVER[0], rel=PEAK)
    assert "speed peak 0.9 m/s power" in write(facts)


@pytest.mark.parametrize("speed", (10.0, np.array([10.0, 5.0])))
def test_a_listed_position_without_a_lever_is_one_at_which_the_force_grows(speed):
    """Ends of the cylinder and O2 are in line; another position has a force."""
    motion = Motion(np.array([1.0, IN_LINE]), speed)
    scene = crank_rocker(motion=motion, drive=CYLINDER)
    assert list(solve(scene).status) == ["ok", "no_lever"]
    facts = find_facts(scene)
    assert facts.peak is None and facts.pins["O2"].peak is None
    assert facts.pins["B"].peak is not None
    text = write(facts, pressure=1e6)
    assert f"grows without bound at theta_2 = {math.degrees(IN_LINE):.4g} deg" in text
    assert "bore none is enough" in text and "peak unbounded" in text


@pytest.mark.slow
@pytest.mark.parametrize("lengths", ((0.37, 0.09, 0.09, 0.37), (0.2, 0.25, 0.21, 0.22)))
def test_ranges_over_change_points_and_gaps_are_those_of_the_angles(lengths):
    """Both circuits are one for the last lengths.

    Over the gap the output goes on from the other end of its range, which is counted
    once, wherever the sweep begins.
    """
    widths = []
    for start, stop in ((-170.0, 190.0), (40.0, 400.0), (400.0, 40.0)):
        facts = find_facts(sweep(lengths, *np.radians([start, stop])))
        for bar in (2, 4):
            low, high = facts.angles[bar]
            angles = getattr(facts.solution, f"theta_{bar}")
            first = angles[np.flatnonzero(facts.solution.assembled)[0]]
            assert low.value - LOCATED <= first <= high.value + LOCATED
            if facts.solution.assembled.all():
                assert low.value <= angles.min() <= low.value + 0.1
                assert high.value - 0.1 <= angles.max() <= high.value
        widths.append(high.value - low.value)
    if not facts.solution.assembled.all():
        assert widths == approx([widths[0]] * 3, abs=LOCATED)
        assert widths[0] <= fourbar.swing(uniform(*lengths)) + LOCATED


@pytest.mark.slow
def test_a_gap_within_a_step_is_no_full_turn():
    """The longest bar exceeds what lets bar 2 turn by 1 um.

    No position of the sweep lies in the gap.
    """
    scene = sweep((0.3, 0.1, 0.25, 0.15 - 1e-6), 0.1, 0.1 + tau)
    facts = find_facts(scene)
    assert facts.solution.assembled.all()
    text = write(facts)
    assert "assembles up to theta_2 = " in text
    assert "input turns fully" not in text and "per turn" not in text


@pytest.mark.slow
@pytest.mark.parametrize(
    "start, steps, pins",
    [(0.0, 36, ("O2", "A", "B", "O4")), (-pi, 97, ("B",)), (0.3, 36, ("B",))],
)
def test_a_jump_where_pin_friction_reverses_is_no_pole(start, steps, pins):
    """Coupler and output turn alike where the diagonal is shortest and longest.

    Pin B reverses there, at positions of some sweeps and at the ends of some turns.
    """
    scene = Scene(
        fourbar.FourBar(0.3, Bar(0.04), Bar(0.29), Bar(0.065)),
        Motion(Sweep(start, start + tau, steps), tau),
        loads=(Load(4, moment=-20.0),),
        effects=(PinFriction.at(**dict.fromkeys(pins, (0.15, 0.005))),),
    )
    motion = describe_motion(solve(scene))
    assert not motion.panels.growing
    at_B = [place for place, pin in motion.reversals if pin == "B"]
    assert np.abs(np.sin(at_B)).max() < LOCATED and len(at_B) == 2
    sides = np.add.outer([0.0, pi], [-1e-9, 1e-9]).ravel()
    fine = np.concatenate([np.linspace(0.0, tau, 721) + 0.01, sides])
    everywhere = solve(replace(scene, motion=Motion(fine, tau)))
    for name in ("F12", "F14"):
        most = np.hypot(*getattr(everywhere, name).T).max()
        peak = motion.panels.find_peak(name).value
        assert most * (1.0 - LOCATED) <= peak <= most * 1.001
