"""Summaries of motions that pass a pole, a change point or a gap between two positions
of the sweep.
"""

from dataclasses import replace
from math import atan2, degrees, hypot, inf, isfinite, pi, radians, sin, tau

import numpy as np
from pytest import approx, mark
from scipy.optimize import brentq

from fourbar import (
    Bar,
    FourBar,
    Gravity,
    Load,
    Motion,
    PinFriction,
    Scene,
    Sweep,
    load,
    solve,
    swing,
    uniform,
)
from fourbar.files import loads
from fourbar.linkage import PIN_FORCE
from fourbar.scene import command_at
from fourbar.show import motion_curves, summary
from fourbar.show.duty import list_duty
from fourbar_validation.places import MODELS
from tests.fourbar.show.test_summary import list_sizes
from tests.support.block import read_block
from tests.support.rows import slow_but
from tests.support.scenes import (
    CRANK_ROCKER_LENGTHS,
    CYLINDER,
    PARALLELOGRAM,
    crank_rocker,
    find_angle,
)

LOCATED = 1e-6
"""rad; near a limit an angle changes as the root of the distance, whose last digits are
some 1e-16.
"""


PEAK = 1e-9
"""Relative, of a largest value: a panel settles to that."""


def sweep(lengths, start, stop, bar=2, **parts):
    """Make a scene of bars of 1 kg/m under gravity, between two angles of a bar."""
    rates = {f"theta_{bar}": Sweep(start, stop, 20), f"omega_{bar}": 10.0}
    scene = Scene(uniform(*lengths), Motion(**rates), effects=(Gravity(9.81),))
    return replace(scene, **parts)


def find_facts(scene):
    return summary.Facts(solve(scene))


CLAMP = loads("""
[pins]
O2 = ["0 mm", "0 mm"]
A = ["40 mm", "2 mm"]
B = ["80 mm", "0 mm"]
O4 = ["80 mm", "-60 mm"]
[motion]
theta_2 = { from = "drawn", to = "0 deg", steps = 20 }
omega_2 = "0 rad/s"
[[loads]]
bar = 2
force = ["100 N", "-90 deg"]
from_pin = ["0.16 m", "0.4 rad"]
[drive]
bar = 4
from_pin = ["100 mm", "0 deg"]
direction = "0 deg"
""")
"""A toggle clamp whose bars 2 and 3 would be in line at -6e-5 deg."""


DIGGER = load(MODELS / "capabilities/cylinder_1_4.toml")
"""The cylinder has no lever at one angle of bar 2."""


def find_stroke_speed(angle):
    at = command_at(DIGGER, np.array([angle]))
    return solve(DIGGER, "velocity", at=at).stroke_speed[0]


LEVER, ON_GROUND = (place.from_pin for _, place in reversed(CYLINDER.ends))
IN_LINE = crank_rocker().linkage.ground_angle + ON_GROUND[1] - LEVER[1]
LIMITS = [pi - find_angle(reach, 0.3, 0.22) for reach in (0.35, 0.15)]
DEAD = [find_angle(0.22, 0.3, 0.35), find_angle(0.22, 0.3, 0.15) + pi]
"""Angles of the output's limits, and of bar 2 where bars 2 and 3 are in line."""
BEYOND = CLAMP.motion.replace(angle=replace(CLAMP.motion.angle, stop=radians(-2.0)))
CLAMPED = find_angle(0.06, 0.1, 2.0 * hypot(0.04, 0.002)) - atan2(0.06, 0.08)

RUBBING = PinFriction.at(O4=(0.12, 0.006)), Gravity()

POLES = {
    "cylinder in line with the crank": (
        crank_rocker(
            sweep(CRANK_ROCKER_LENGTHS, 0.1, 0.1 + tau).motion, drive=CYLINDER
        ),
        [IN_LINE + pi, IN_LINE + tau],
    ),
    "torque on the output": (sweep(CRANK_ROCKER_LENGTHS, 0.0, tau, drive_bar=4), DEAD),
    "change points": (sweep(PARALLELOGRAM, 5.0, 5.0 + tau), [tau, 3 * pi]),
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
    "cylinder where friction reverses": (DIGGER, [brentq(find_stroke_speed, 0.8, 1.0)]),
    "limits of the output": (sweep(CRANK_ROCKER_LENGTHS, 1.5, 3.5, 4), LIMITS),
    "toggle clamp that stops before": (CLAMP, []),
    "toggle clamp that goes beyond": (replace(CLAMP, motion=BEYOND), [CLAMPED]),
}
"""Scenes, and the places at which something grows without bound, in their order."""


@mark.parametrize(
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
    # what grows does so at least as a root, by 10, and what has a bound hardly
    growing = {name for name, size in far.items() if (near[name] > 2.5 * size).any()}
    assert panels.growing == growing
    for quantity in growing:
        poles = panels.list_poles(quantity)
        assert abs(np.subtract.outer(poles, places)).min(axis=1).max() < LOCATED
    entry = list_duty(facts.solution, {})
    for pin, force in PIN_FORCE.items():
        found = facts.motion.find_peak(force).value, facts.motion.find_rms(force)
        assert [isfinite(number) for number in found] == [force not in growing] * 2
        assert (entry["pins"][pin]["peak"] is None) == (force in growing)
    drive, *_ = far
    kind = "torque" if drive == "torque" else "force"
    numbers = entry[f"peak_{kind}"], entry[f"rms_{kind}"]
    assert [number is None for number in numbers] == [drive in growing] * 2
    assert isfinite(facts.peak.value) == (drive not in growing)
    text = read_block(facts.solution, pressure=1e6)
    head = f"{kind} grows without bound at {scene.motion.commanded} = "
    assert (head in text) == (drive in growing)
    if drive in growing:
        poles = panels.list_poles(drive)
        assert poles == approx(places, abs=LOCATED)
        written = " and ".join(f"{degrees(pole):.4g} deg" for pole in poles)
        assert head + written.replace("-0 ", "0 ") in text
        sized = scene.drive is None or bool(facts.stroke_ranges)
        assert ("none is enough, as the" in text) == sized


@mark.slow
@mark.parametrize("start, stop", ((-1.0, 1.0), (1.0, -1.0), (2.0, 4.0)))
def test_a_torque_is_largest_where_pin_forces_have_a_pole(start, stop):
    """T2 = (0.05 + 0.3 + 0.05) kg g 0.1 m cos(theta_2), largest at change points."""
    facts = find_facts(sweep(PARALLELOGRAM, start, stop))
    assert abs(facts.peak.value) == approx(0.4 * 9.81 * 0.1, rel=PEAK)
    assert abs(sin(facts.peak.place)) < LOCATED
    assert facts.motion.panels.growing == {*PIN_FORCE.values()}


@mark.slow
def test_power_beside_a_pole_of_the_torque_has_its_peak_and_mean():
    """Whichever bar is driven, it gives the same power."""
    scene, _ = POLES["torque on the output"]
    duty, right = (find_facts(replace(scene, drive_bar=bar)).duty for bar in (4, 2))
    for name in ("peak_power", "rms_power", "energy_in", "energy_out"):
        assert getattr(duty, name) == approx(getattr(right, name), rel=LOCATED), name
    facts = find_facts(POLES["cylinder in line with the crank"][0])
    assert facts.duty.peak_speed == approx(10.0 * LEVER[0], rel=PEAK)
    assert "speed peak 0.9 m/s power" in read_block(facts.solution)


@mark.parametrize("speed", (10.0, np.array([10.0, 5.0])))
def test_a_listed_position_without_a_lever_is_one_at_which_the_force_grows(speed):
    """Ends of the cylinder and O2 are in line; another position has a force."""
    scene = crank_rocker(Motion(np.array([1.0, IN_LINE]), speed), drive=CYLINDER)
    assert list(solve(scene).status) == ["ok", "no_lever"]
    facts = find_facts(scene)
    assert facts.peak.value == facts.motion.find_peak("F12").value == inf
    assert isfinite(facts.motion.find_peak("F43").value)
    text = read_block(facts.solution, pressure=1e6)
    assert f"grows without bound at theta_2 = {degrees(IN_LINE):.4g} deg" in text
    assert "bore none is enough" in text and "peak unbounded" in text


@mark.slow
@mark.parametrize("lengths", ((0.37, 0.09, 0.09, 0.37), (0.2, 0.25, 0.21, 0.22)))
def test_ranges_over_change_points_and_gaps_are_those_of_the_angles(lengths):
    """Both circuits are one for the last lengths.

    Over the gap the output goes on from the other end of its range, which is counted
    once, wherever the sweep begins.
    """
    widths = []
    for start, stop in ((-170.0, 190.0), (40.0, 400.0), (400.0, 40.0)):
        facts = find_facts(sweep(lengths, *np.radians([start, stop])))
        assembled = facts.solution.assembled
        for bar in (2, 4):
            ((low, high),) = facts.angles[bar]
            angles = facts.solution[f"theta_{bar}"][assembled]
            assert low.value - LOCATED <= angles[0] <= high.value + LOCATED
            if assembled.all():
                ends = [angles.min(), angles.max()]
                assert [low.value, high.value] == approx(ends, abs=0.1)
                assert low.value <= ends[0] and ends[1] <= high.value
        widths.append(high.value - low.value)
    if not assembled.all():
        assert widths == approx([widths[0]] * 3, abs=LOCATED)
        assert widths[0] <= swing(uniform(*lengths)) + LOCATED


@mark.slow
def test_a_gap_within_a_step_is_no_full_turn():
    """The longest bar exceeds what lets bar 2 turn by 1 um.

    No position of the sweep lies in the gap.
    """
    facts = find_facts(sweep((0.3, 0.1, 0.25, 0.15 - 1e-6), 0.1, 0.1 + tau))
    assert facts.solution.assembled.all()
    text = read_block(facts.solution)
    assert "assembles up to theta_2 = " in text
    assert "input turns fully" not in text and "per turn" not in text


@mark.slow
@mark.parametrize(
    "start, steps, pins",
    [(0.0, 36, ("O2", "A", "B", "O4")), (-pi, 97, ("B",)), (0.3, 36, ("B",))],
)
def test_a_jump_where_pin_friction_reverses_is_no_pole(start, steps, pins):
    """Coupler and output turn alike where the diagonal is shortest and longest.

    Pin B reverses there, at positions of some sweeps and at the ends of some turns.
    """
    scene = Scene(
        FourBar(0.3, Bar(0.04), Bar(0.29), Bar(0.065)),
        Motion(Sweep(start, start + tau, steps), tau),
        loads=(Load(4, moment=-20.0),),
        effects=(PinFriction.at(**dict.fromkeys(pins, (0.15, 0.005))),),
    )
    motion = motion_curves.describe_motion(solve(scene))
    assert not motion.panels.growing
    at_B = [place for place, pin in motion.reversals if pin == "B"]
    assert abs(np.sin(at_B)).max() < LOCATED and len(at_B) == 2
    sides = np.add.outer([0.0, pi], [-1e-9, 1e-9]).ravel()
    fine = Motion(np.array([*np.linspace(0.0, tau, 721) + 0.01, *sides]), tau)
    everywhere = solve(replace(scene, motion=fine))
    for name in ("F12", "F14"):
        most = np.hypot(*everywhere[name].T).max()
        peak = motion.panels.find_peak(name).value
        assert most * (1.0 - LOCATED) <= peak <= most * 1.001
