"""The summary of `analyze`: its numbers by geometry and finer steps, and its words."""

import math
import re
from dataclasses import replace
from math import pi, radians, sqrt, tau
from pathlib import Path

import numpy as np
import pytest
from pytest import approx

import fourbar
from fourbar import (
    Bar,
    FourBar,
    Friction,
    Gravity,
    Motion,
    Place,
    Scene,
    Sweep,
    solve,
    uniform,
)
from fourbar.cli import status
from fourbar.scene import command_at
from fourbar.scene.motion import Law
from fourbar.show.block import write_block, write_facts
from fourbar.show.lines import BLOCK_WIDTH
from fourbar.show.summary import summarize
from fourbar.show.tables import write_cells
from fourbar.solving import find_last_stage
from tests.support.scenes import CYLINDER, crank_rocker, thesis

PSI = 0.45359237 * 9.80665 / 0.0254**2
D, A, B, C = 0.3, 0.1, 0.25, 0.22
TURN = crank_rocker(motion=Motion(Sweep(0.0, tau, 360), 10.0))


def block(scene, **options):
    lines = write_block(scene, solve(scene, find_last_stage(scene)), **options)
    assert max(map(len, lines)) <= BLOCK_WIDTH, lines
    return "\n".join(lines)


def plain(text):
    """One line, for phrases that the width of the block breaks."""
    return " ".join(text.split())


def opposite(side, first, second):
    return math.acos((first**2 + second**2 - side**2) / (2.0 * first * second))


@pytest.mark.slow
def test_where_the_assembly_ends_is_the_limit_of_the_commanded_bar():
    scene = thesis(Sweep(0.0, tau, 360))
    limits = fourbar.limit_positions(scene.linkage, 2)
    limits = sorted(limit.theta_2 % tau for limit in limits)
    facts = summarize(scene, solve(scene))
    bounds = [end for ends in facts.motion.stretches for end in ends if end is not None]
    assert sorted(bounds) == approx(limits, abs=1e-12)
    low, high = (f"{math.degrees(limit):.4g} deg" for limit in limits)
    text = plain(block(scene))
    for words in (
        f"assembles up to theta_2 = {low}, and from theta_2 = {high}",
        "torque grows without bound at theta_2 = ",
        "transmission angle: at least 0 deg",
    ):
        assert words in text
    assert re.search(r"361 positions: \d+ ok, \d+ not assembled", text)


def test_the_block_has_the_numbers_of_the_facts():
    facts = summarize(TURN, solve(TURN, "error"))
    text = "\n".join(write_facts(facts))
    duty, peak = facts.duty, facts.peak

    def write(number, factor=1e3):
        return f"{factor * number:.4g}"

    degrees = 180.0 / pi
    torque, rms = write(peak.value), write(duty.rms_torque)
    place = write(peak.place, degrees)
    row = f"  torque   peak {torque} mN m at theta_2 = {place} deg, RMS {rms} mN m\n"
    assert row in text
    power, swing = write(duty.peak_power, 1.0), write(duty.energy_swing, 1.0)
    row = f"peak {power} W; {write(duty.energy_in, 1.0)} J per turn given"
    assert row in text and f"{write(duty.energy_out, 1.0)} J taken back" in text
    needs = f"{write(duty.peak_torque)} mN m at 95.49 rpm (RMS {rms} mN m)"
    assert f"\nmotor: at least {needs}, {power} W\n" in text
    # weights and constant couples give back all that they take
    assert f"cycle    mean torque 0 mN m; energy swings by {swing} J about" in text
    loads = [*facts.pins.values()]
    cells = {line[2:11].strip(): line[11:].split("  ") for line in text.splitlines()}
    for label, numbers in (
        ("peak", [write(load.peak.value, 1.0) + " N" for load in loads]),
        ("at", [write(load.peak.place, degrees) + " deg" for load in loads]),
        ("RMS", [write(load.rms, 1.0) + " N" for load in loads]),
    ):
        assert [*filter(None, map(str.strip, cells[label]))] == numbers
    assert "of these positions" not in text
    assert "rounding changes none of these digits" in text


POSITIONS = Motion(Sweep(0.0, tau, 36))
ONE = Motion(1.0, 10.0)
LISTED = Motion(np.radians([10.0, 50.0, 200.0]), 10.0)
PART = Motion(Sweep(0.5, 2.0, 50), 10.0)
FASTER = Motion(Sweep(0.5, 2.0, 5), 10.0, 1.0)
TWICE = Motion(Sweep(0.0, 2.0 * tau, 720), 10.0)
BY_LAW = Motion(law=Law((0.0, 1.0, 2.0), (0.3, 2.0, 1.0), steps=20, ends="rest"))
RELEASED = Motion(0.5, 0.0, free=fourbar.Free(0.5, 50))
NO_MEANS = "the positions are passed at no one speed: no RMS values, no energies"


@pytest.mark.slow
@pytest.mark.parametrize(
    "motion, said, unsaid",
    [
        (POSITIONS, ['omega_2 = "0 rad/s" gives the static'], "drive|pins|rounding"),
        (ONE, ["  47.3346 ", "F12 at O2 "], "peak|RMS|motor"),
        (
            LISTED,
            [
                "3 positions from theta_2 = 10 deg to 200 deg",
                "(of these positions)",
                "peak and RMS are those of these positions",
            ],
            "given|mean torque",
        ),
        (PART, ["over the sweep given", "input from 28.65 deg to 114.6 deg"], "turn "),
        (FASTER, [NO_MEANS], "RMS (?!values)"),
        (TWICE, ["in 2 turns given"], "of these positions"),
        (BY_LAW, ["by a law over 2 s", "over the motion given", " at t = "], "turns"),
        (
            RELEASED,
            ["released for 0.5 s, without a drive", "\n  at       0"],
            "torque|power|motor",
        ),
    ],
    ids=["positions", "one", "listed", "part", "faster", "twice", "law", "released"],
)
def test_each_kind_of_motion_shows_what_it_has_and_nothing_else(motion, said, unsaid):
    text = block(crank_rocker(motion=motion))
    for words in said:
        assert words in text, text
    assert not re.search(unsaid, text), text


def test_friction_at_rest_gives_the_range_that_it_holds():
    effects = (Gravity(), Friction.at(O2=0.5))
    scene = crank_rocker(motion=Motion(1.0, 0.0), effects=effects)
    s = solve(scene)
    ends = [1e3 * s.torque_low[0], 1e3 * s.torque_high[0]]
    words = r"at rest  (\S+) mN m to (\S+) mN m: dry friction holds it between them"
    printed = re.search(words, block(scene)).groups()
    assert [*map(float, printed)] == approx(ends, rel=6e-4)
    assert ends[1] - ends[0] == approx(1e3)


def test_a_stroke_is_answered_in_strokes_with_its_range_and_bore():
    """A cylinder can have difference and sum of its ends' distances from the pivot."""
    motion = Motion(stroke=Sweep(0.17, 0.33, 40), stroke_speed=0.2, side="left")
    scene = crank_rocker(motion=motion, drive=CYLINDER)
    text, s = plain(block(scene, pressure=210e5)), solve(scene)
    assert "stroke 170 mm to 330 mm; assembles from 160 mm to 340 mm" in text
    assert re.search(r"force peak \S+ N at stroke = 330 mm, RMS", text)
    assert "peak 26.88 N" in text.replace("O2 ", "")
    bore = 1e3 * sqrt(4.0 * np.nanmax(s.drive_force) / (pi * 210e5))
    assert (
        f"bore at least {bore:.4g} mm to push {np.nanmax(s.drive_force):.4g} N" in text
    )
    assert "to pull" in text
    assert "cylinder from bar 1 (ground) to bar 2 (input), 0.2 m/s" in text
    assert "motor" not in text
    right = replace(scene, motion=motion.replace(side="right"))
    assert summarize(right, solve(right)).stroke_limits == approx(
        (0.16, 0.34), abs=1e-6
    )


def test_a_cylinder_that_nothing_loads_has_its_range_too():
    motion = Motion(stroke=Sweep(0.17, 0.33, 40), side="left")
    bars = FourBar(0.3, *map(Bar, (0.1, 0.25, 0.22)))
    text = plain(block(Scene(bars, motion, drive=CYLINDER)))
    assert "stroke 170 mm to 330 mm; assembles from 160 mm to 340 mm" in text


def test_a_bore_is_that_of_the_motion_and_not_of_its_positions():
    """The couple on the crank is largest at 101.3 deg, between two positions."""
    corners = tuple(np.radians((0.0, 95.0, 101.3, 107.0, 360.0)))
    table = fourbar.Table(corners, (1.0, 1.0, 50.0, 1.0, 1.0))
    scene = crank_rocker(
        motion=Motion(Sweep(1.0, 2.6, 8), 10.0),
        loads=(fourbar.Load(2, moment=-1.0, table=table),),
        effects=(),
        drive=CYLINDER,
    )
    corner = command_at(scene, np.radians([101.3]))
    (force,) = solve(scene, at=corner).drive_force
    word = "push" if force > 0.0 else "pull"
    bore = 1e3 * sqrt(4.0 * abs(force) / (pi * 1e6))
    text = plain(block(scene, pressure=1e6))
    assert re.search(rf"{bore:.4g} mm\b[^;]* to {word} {abs(force):.4g} N", text)


@pytest.mark.slow
@pytest.mark.parametrize("bar", (2, 3))
def test_a_cylinder_assembles_from_where_its_ends_meet(bar):
    """The ends lie as far from O2, or the ground's end is on the path of the other,
    which passes it at theta_2 = 40 deg.
    """
    linkage = uniform(0.3, 0.1, 0.25, 0.22)
    motion = Motion(Sweep(1.0, 2.0, 10), 0.0)
    scene = Scene(linkage, motion, effects=(Gravity(),))
    if bar == 2:
        ground = Place(1, (0.1, -1.5))
        moving = Place(2, (0.1, 0.0))
    else:
        met = solve(replace(scene, motion=Motion(radians(40.0))))
        x = 0.1 * math.cos(radians(40.0)) + 0.1 * math.cos(met.theta_3[0])
        y = 0.1 * math.sin(radians(40.0)) + 0.1 * math.sin(met.theta_3[0])
        ground = Place(1, (math.hypot(x, y), math.atan2(y, x)))
        moving = Place(3, (0.1, 0.0))
    pushed = replace(scene, drive_bar=None, drive=fourbar.LinearDrive(ground, moving))
    limits = summarize(pushed, solve(pushed)).stroke_limits
    assert limits[0] == 0.0
    assert "assembles from 0 mm to" in block(pushed)
    if bar == 2:
        assert limits[1] == approx(0.2, rel=1e-12)


def test_the_command_line_states_the_bore(capsys):
    path = Path(__file__).parents[3] / "models" / "gallery" / "excavator_bucket.toml"
    assert status(["analyze", str(path), "--pressure", "3000 psi"]) == 0
    force = np.nanmax(solve(fourbar.load(path)).drive_force)
    bore = 1e3 * sqrt(4.0 * force / (pi * 3000.0 * PSI))
    assert f"  bore     at least {bore:.4g} mm to push" in capsys.readouterr().out


@pytest.mark.parametrize(
    "lengths, words",
    [
        ("12in 4in 10in 9in", "ground 12, input 4, coupler 10, output 9 in"),
        ("1.5ft 6in 15in 14in", "ground 18, input 6, coupler 15, output 14 in"),
        (
            "300mm 100mm 250mm 220mm",
            "ground 300, input 100, coupler 250, output 220 mm",
        ),
    ],
)
def test_a_new_scene_has_weight_sixty_turns_a_minute_and_the_units_of_its_lengths(
    lengths, words, tmp_path, capsys
):
    file = str(tmp_path / "a.toml")
    assert status(["new", file, "--lengths", *lengths.split()]) == 0
    scene = fourbar.load(file)
    assert scene.motion.omega_2 == approx(tau)
    assert [effect.key for effect in scene.effects] == ["gravity"]
    capsys.readouterr()
    assert status(["analyze", file]) == 0
    stated = capsys.readouterr().out
    assert words in stated and "60 rpm" in stated
    assert ("lbf in" in stated) == words.endswith(" in")
    assert 12 <= len(stated.splitlines()) <= 20
    assert status(["analyze", file, "--units", "SI"]) == 0
    si = capsys.readouterr().out
    assert f"ground {1e3 * scene.linkage.ground:.4g}" in si
    assert "N m" in si and "6.283 rad/s" in si and "lbf" not in si


@pytest.mark.slow
def test_the_range_at_rest_reaches_from_the_least_to_the_greatest_that_is_held():
    """A friction couple of 0.5 N m at O2 holds the static torque within as much."""
    sweep = Motion(Sweep(0.2, 1.4, 6), 0.0)
    bare = crank_rocker(motion=sweep, effects=(Gravity(),))
    static = solve(bare).torque
    assert np.ptp(static) > 0.1
    held = replace(bare, effects=(*bare.effects, Friction.at(O2=0.5)))
    facts = summarize(held, solve(held))
    outer = static.min() - 0.5, static.max() + 0.5
    ((low, high, ends),) = facts.held
    assert (low, high) == approx(outer, rel=1e-12) and ends == (0.2, 1.4)
    row = f"at rest {1e3 * outer[0]:.4g} mN m to {1e3 * outer[1]:.4g} mN m over"
    text = plain(block(held))
    assert f"{row} theta_2 = 11.46 deg to 80.21 deg, a part of it at each" in text


@pytest.mark.slow
def test_each_position_at_rest_has_its_own_range():
    """Pin B stands against the coupler at 0 and 180 deg, pin O4 between positions.

    The torque jumps by each range while B reverses.
    """
    lengths = 0.3, Bar(0.04), Bar(0.29), Bar(0.065)
    pins = ("O2", "A", "B", "O4")
    friction = fourbar.PinFriction.at(**dict.fromkeys(pins, (0.15, 0.005)))
    scene = Scene(
        FourBar(*lengths),
        Motion(Sweep(0.0, tau, 72), tau),
        effects=(Friction.at(O4=20.0), friction),
    )
    facts = summarize(scene, solve(scene))
    assert [held.ends for held in facts.held] == [(0.0, 0.0), (pi, pi)]
    for held in facts.held:
        beside = held.ends[0] + np.array([-1e-9, 1e-9])
        motion = Motion(beside, tau)
        torque = solve(replace(scene, motion=motion)).torque
        assert sorted(torque) == approx([held.low, held.high], rel=1e-6)
    text = plain(block(scene))
    first, second = ([f"{held.low:.4g}", f"{held.high:.4g}"] for held in facts.held)
    assert (
        f"at rest {first[0]} N m to {first[1]} N m at theta_2 = 0 deg, {second[0]} N m"
        f" to {second[1]} N m at theta_2 = 180 deg: dry friction holds" in text
    )
    assert "at theta_2 = 0 deg (B), 10.52 deg (O4), 180 deg (B), 188.7 deg (O4)" in text
    assert "of these positions" not in text and "without bound" not in text


@pytest.mark.slow
def test_a_reversal_of_a_motion_law_is_named_by_its_angle():
    """Half of A (1 - cos) swings from 0.3 to 2.0 rad and back.

    O2 reverses at the far end, at t = 1 s.
    """
    time = np.linspace(0.0, 2.0, 41)
    angle = 0.3 + 0.85 * (1.0 - np.cos(pi * time))
    law = Law(tuple(time), tuple(angle), steps=30, ends="rest")
    scene = crank_rocker(motion=Motion(law=law), effects=(Friction.at(O2=0.05),))
    facts = summarize(scene, solve(scene))
    ((place, pin),) = facts.motion.reversals
    assert pin == "O2" and place == approx(2.0, abs=1e-6)
    assert "reverses, and the pin forces jump, at theta_2 = 114.6 deg (O2)" in plain(
        block(scene)
    )


def test_digits_left_are_those_that_the_error_bar_leaves():
    """A torque on bar 4 beside its dead centre.

    The whole digits of value over error bar.
    """
    linkage = uniform(D, A, B, C)
    stretched = opposite(C, D, A + B)  # bars 2 and 3 in one line
    said = {}
    for away in (1e-6, 1e-9, 1e-10, 1e-11):
        scene = Scene(
            linkage,
            Motion(stretched + away, 3.0),
            4,
            effects=(Gravity(),),
        )
        s = solve(scene, "error")
        digits = math.floor(math.log10(abs(s.torque[0]) / s.torque_error[0]))
        row = re.search(r"(\d+) digits left of T4 at", plain(block(scene)))
        said[away] = (None if row is None else int(row.group(1)), digits)
    for shown, digits in said.values():
        assert shown == (digits if digits < 8 else None)
    assert any(shown is not None for shown, _ in said.values())


@pytest.mark.slow
@pytest.mark.parametrize("lengths", [(0.3, 0.4, 0.2, 0.25), (0.2, 0.25, 0.21, 0.22)])
@pytest.mark.parametrize("bar", [2, 4])
def test_a_range_that_is_left_out_is_printed_with_the_limits(lengths, bar):
    """The program chooses one degree less at each end, which is no limit."""
    motion = Motion(**{f"omega_{bar}": 1.0})
    scene = Scene(uniform(*lengths), motion)
    swept = getattr(solve(scene, "position"), f"theta_{bar}")
    limits = swept[[0, -1]] + np.radians([-1.0, 1.0])
    stated = Sweep(float(swept[0]), float(swept[-1]), 72)
    commanded = {f"theta_{bar}": limits + np.radians([-0.001, 0.001])}
    beyond = replace(scene, motion=Motion(**commanded))
    assert not solve(beyond, "position").assembled.any()
    low, high = (f"{math.degrees(limit):.4g} deg" for limit in limits)
    line = f"1 deg inside its limits {low} and {high}; "
    assert line in plain(block(scene))
    motion = scene.motion.replace(angle=stated)
    assert "inside its limits" not in plain(block(replace(scene, motion=motion)))


def test_a_spring_that_the_cylinder_holds_end_to_end_loads_no_pin():
    """Massless bars, and both ends in common: what is left at the pins is rounding."""
    spring = fourbar.effects.Spring(CYLINDER.start, CYLINDER.end, 1e5, 0.5)
    at = Motion([0.1, 0.4, 0.7], 1.0)
    scene = Scene(
        FourBar(0.3, *(Bar(x) for x in (0.1, 0.25, 0.22))),
        motion=at,
        drive=CYLINDER,
        effects=(fourbar.effects.Springs((spring,)),),
    )
    force = solve(scene).drive_force
    stroke = solve(scene).stroke
    assert force == approx(1e5 * (stroke - 0.5), rel=1e-12)
    text = block(scene)
    assert text.count("0 N ") > 4 and "e-1" not in text.split("rounding")[0]
    assert "bending" not in text and "rounding changes none" in text


@pytest.mark.slow
def test_rates_stand_in_place_of_zeros_where_nothing_acts():
    lengths = (0.1, 0.25, 0.22)
    bare = FourBar(0.3, *map(Bar, lengths))
    wheel = replace(bare, output=Bar(0.22, inertia=0.01))
    for linkage in (bare, wheel, uniform(0.3, *lengths)):
        scene = Scene(linkage, TURN.motion)
        facts = summarize(scene, solve(scene))
        lines = write_facts(facts)
        starts = [line.split()[0] for line in lines if line]
        assert ("rates" in starts) == (linkage is bare)
        assert ("pins" in starts) == ("drive" in starts) == (linkage is not bare)
        if linkage is bare:
            speed, growth = facts.rates[4]
            rows = {line.split()[0]: line for line in lines if line}
            shown = f"{speed.value * 30.0 / math.pi:.4g} rpm"
            assert rows["omega"].endswith(shown)
            assert rows["alpha"].endswith(f"{growth.value:.4g} rad/s²")


def test_a_cell_that_is_rounding_of_its_column_is_zero_without_a_sign():
    values = np.array([0.0392, -1.7e-16, -0.0, np.nan, 0.02])
    assert write_cells(values) == ["0.0392", "0", "0", "-", "0.02"]
    assert write_cells(np.array([12.0, -1e-5, 30.0]), ".4f")[1] == "0.0000"
    beside_a_pole = np.array([10.0] * 99 + [1e15])
    assert write_cells(beside_a_pole)[0] == "10"


def test_a_torque_and_its_mean_have_one_prefix():
    """1.1 N m and 0.6 N m are read side by side; 0.6 N m alone is 600 mN m."""
    motion = fourbar.Motion(fourbar.Sweep(0.0, math.tau, 90), 12.5)
    scene = crank_rocker(motion=motion)
    duty = fourbar.motor_duty(fourbar.solve(scene))
    assert duty.rms_torque < 1.0 < duty.peak_torque
    torques = [line for line in block(scene).splitlines() if "RMS" in line][:2]
    for line in torques:
        assert "N m" in line
        assert "mN m" not in line
