"""Parallelograms, kites and other linkages with change points as people state them.

Torque, headings, releases.
"""

import math
import re
from dataclasses import replace
from math import radians

import numpy as np
import pytest
from click.testing import CliRunner
from pytest import approx

import fourbar
from fourbar import (
    Bar,
    FourBar,
    Free,
    Gravity,
    Motion,
    Scene,
    Sweep,
    load,
    motor_duty,
    solve,
    uniform,
    units,
)
from fourbar.cli import group
from fourbar.formulas.mobility import classify, find_miss, meet_change_points
from fourbar.show.block import write_block
from fourbar.show.studies import write_equilibria
from fourbar.show.units import COMMON
from tests.support.scenes import balanced_lamp

GRAVITY = Gravity()
PRINTED = radians(1e-4)
"""Angles of equilibria are printed with four decimals of a degree."""


def read(tmp_path, text):
    path = tmp_path / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return load(path)


def state(lengths, more=""):
    names = ("ground", "input", "coupler", "output")
    lines = [f'{n} = "{x}"' for n, x in zip(names, lengths, strict=True)]
    return "\n".join(["[lengths]", *lines, more])


def first_line(scene):
    return write_block(scene, solve(scene))[0]


@pytest.mark.slow
def test_a_new_parallelogram_is_one_at_every_angle(tmp_path):
    """Bars of 0.1, 0.3, 0.1 kg.

    T2 = (0.05 + 0.3 + 0.05) kg * 9.81 m/s^2 * 0.1 m * cos(theta_2).
    """
    path = tmp_path / "tp.toml"
    runner = CliRunner()
    lengths = ["300mm", "100mm", "300mm", "100mm"]
    made = runner.invoke(group, ["new", str(path), "--lengths", *lengths])
    assert made.exit_code == 0, made.output
    shown = runner.invoke(group, ["analyze", str(path)])
    assert shown.exit_code == 0, shown.output
    assert shown.output.startswith("Parallelogram")
    assert "ntiparallelogram" not in shown.output
    assert max(map(len, shown.output.splitlines())) <= 80
    scene = load(path)
    solution = solve(scene)
    weight = sum(
        share * bar.mass
        for share, bar in zip((0.5, 1.0, 0.5), scene.linkage.moving, strict=True)
    )
    right = weight * 9.81 * 0.1 * np.cos(solution.theta_2)
    assert np.abs(solution.torque - right).max() < 1e-14
    on_change_points = np.isclose(np.sin(solution.theta_2), 0.0)
    assert on_change_points.sum() == 3
    assert np.array_equal(np.isnan(solution.F12[:, 0]), on_change_points)


@pytest.mark.parametrize(
    "lengths, motion, head",
    [
        ((0.3, 0.1, 0.3, 0.1), {}, "Parallelogram, open"),
        ((0.3, 0.1, 0.3, 0.1), {"branch": -1}, "Antiparallelogram, crossed"),
        ((0.3, 0.1, 0.3, 0.1), {"theta_4": 3.5}, "Parallelogram, open"),
        ((0.3, 0.1, 0.3, 0.1), {"theta_3": 0.2}, "Antiparallelogram, open"),
        (
            (0.3, 0.3, 0.2, 0.2),
            {},
            "Kite (equal: ground and input; coupler and output)",
        ),
        ((0.2, 0.3, 0.3, 0.2), {"branch": -1}, "Kite"),
        ((0.2, 0.2, 0.2, 0.2), {}, "Rhombus"),
    ],
)
def test_headings_name_the_assembly(lengths, motion, head):
    scene = Scene(uniform(*lengths), Motion(**motion))
    lines = write_block(scene, solve(scene))
    assert lines[0].startswith(head)
    assert any("change point" in line for line in lines)
    said = any("no theta_3 moves the parallelogram" in line for line in lines)
    assert said == ("theta_3" in motion)


@pytest.mark.slow
def test_a_single_change_point_takes_two_turns():
    linkage = uniform(4.0, 1.0, 2.0, 3.0)
    one, two = (
        Scene(linkage, Motion(Sweep(0.0, turns * math.tau, 720), 1.0))
        for turns in (1, 2)
    )
    text = " ".join(" ".join(write_block(one, solve(one))).split())
    assert "the assembly repeats after two turns" in text
    duties = [motor_duty(solve(scene)) for scene in (one, two)]
    assert [duty.closed for duty in duties] == [False, True]
    crossed = Scene(linkage, one.motion.replace(branch=-1))
    later = solve(two).theta_4[360:]
    apart = solve(crossed).theta_4[::2] - later
    assert np.abs(np.sin(0.5 * apart)).max() < 1e-12


@pytest.mark.slow
def test_a_scene_without_a_range_covers_both_turns_of_a_single_change_point():
    """The drive then gives as much energy as it takes back: only weights act."""
    linkage = uniform(0.4, 0.2, 0.3, 0.3)
    scene = Scene(linkage, Motion(omega_2=6.0), effects=(Gravity(),))
    solution = solve(scene)
    assert len(solution) == 721
    assert solution.theta_2[[0, -1]].tolist() == [0.0, 2.0 * math.tau]
    duty = motor_duty(solution)
    assert duty.closed
    assert duty.energy_in == approx(duty.energy_out, rel=1e-6)
    text = " ".join(write_block(scene, solution))
    assert "in 2 turns given" in text
    with_both = uniform(0.3, 0.1, 0.3, 0.1)
    assert len(solve(Scene(with_both))) == 361


@pytest.mark.slow
def test_lengths_are_equal_within_the_rounding_of_what_is_stated(tmp_path):
    motion = '[motion]\nomega_2 = "1 rad/s"\n'
    rounded = ("44.7214 mm", "22.3607 mm", "44.7213 mm", "22.3607 mm")
    scene = read(tmp_path, state(rounded, motion))
    assert classify(scene.linkage).name == "parallelogram"
    assert first_line(scene).startswith("Parallelogram")
    # no length moves by more than its rounding
    off = np.array(scene.linkage.lengths) - [
        44.7214e-3,
        22.3607e-3,
        44.7213e-3,
        22.3607e-3,
    ]
    assert 0.0 < np.abs(off).max() <= 5e-8 * (1.0 + 1e-6)
    beyond = ("22.3607 mm", "44.9998 mm", "22.3605 mm", "45.0002 mm")
    scene = read(tmp_path, state(beyond, motion))
    assert find_miss(scene.linkage) == (approx(6e-7, rel=1e-6), "parallelogram")
    lines = write_block(scene, solve(scene))
    assert any("misses a parallelogram by 600 nm" in line for line in lines)
    # whole numbers and coarse decimals are meant as they stand
    for stated in (
        ("300 mm", "100 mm", "301 mm", "100 mm"),
        ("30.0 cm", "10.0 cm", "30.1 cm", "10.0 cm"),
    ):
        assert classify(read(tmp_path, state(stated)).linkage).name != "parallelogram"


def test_a_parallelogram_that_is_missed_by_one_equality_keeps_a_change_point(tmp_path):
    """Opposite bars differ by 2e-4 both: a + d = b + c is within the rounding."""
    text = state(("22.3607 mm", "44.9998 mm", "22.3605 mm", "45.0002 mm"))
    scene = read(tmp_path, text)
    in_mm = {**COMMON, **units("mm")}
    lines = write_block(scene, solve(scene), in_mm)
    miss = "misses a parallelogram by 0.0006 mm: it has one change point, not two"
    found = [line for line in lines if "change point" in line]
    assert found[:2] == [miss, "change point at theta_2 = 180 deg"], lines


GRIPPER = """
[pins]
O2 = ["38 mm", "69 mm"]
A = ["77.824 mm", "89.953 mm"]
B = ["99.824 mm", "85.954 mm"]
O4 = ["60 mm", "65 mm"]
"""


@pytest.mark.parametrize(
    "text, said",
    [
        (
            GRIPPER,
            "ground and coupler, which differ by 0.0001789 mm; input and output, which"
            " differ by 0.0004656 mm",
        ),
        (
            state(("44.7214 mm", "22.3607 mm", "44.7213 mm", "22.3607 mm")),
            "ground and coupler, which differ by 0.0001 mm",
        ),
        (
            state(("3.333 m", "1.3333 m", "3.0 m", "1.6667 m")),
            "ground + input and coupler + output, which differ by 0.4 mm",
        ),
        (
            state(("10.001 mm", "10.0013 mm", "10.0009 mm", "10.0011 mm")),
            "ground and input, which differ by 0.0003 mm; ground and coupler, which"
            " differ by 0.0001 mm; ground and output, which differ by 0.0001 mm",
        ),
        (state(("300 mm", "100 mm", "0.3 m", "10 cm")), ""),
        (state(("3 in", "1 in", "76.2 mm", "25.4 mm")), ""),
        (state(("300 mm", "101 mm", "0.3 m", "10 cm")), ""),
    ],
)
def test_lengths_that_are_read_as_equal_are_said_with_their_difference(
    tmp_path, text, said
):
    """The loops of a gripper in CAD and of lengths to the fourth decimal.

    Where the stated lengths are equal, or differ by more, nothing is said.
    """
    scene = read(tmp_path, text)
    in_mm = {**COMMON, **units("mm")}
    lines = " ".join(write_block(scene, solve(scene), in_mm)[1:])
    lines = " ".join(lines.split())
    start = "lengths read as equal within the last decimals of what is stated: "
    assert (f"{start}{said}" in lines) == bool(said)
    assert (start in lines) == bool(said)
    longer = replace(scene.linkage.coupler, length=1.0001 * scene.linkage.lengths[2])
    other = replace(scene, linkage=replace(scene.linkage, coupler=longer))
    assert start not in " ".join(write_block(other, solve(other)))


@pytest.mark.parametrize(
    "angles, said",
    [
        ([0.0, 1.0, math.pi], "3 positions: 1 ok, 2 at a change point"),
        ([0.0, 1.0, 3.14159265359], "1 ok, 1 at a change point, 1 within 1.186e-11"),
        ([2e-11, 1.0, 9.42477796077], "3 positions: 1 ok, 2 within 1.146e-09 deg"),
        ([1.0, 3.1416], ""),
    ],
)
def test_a_position_that_misses_a_change_point_by_its_decimals_is_said(angles, said):
    scene = Scene(uniform(0.3, 0.1, 0.3, 0.1), Motion(np.array(angles), 1.0))
    text = " ".join(write_block(scene, solve(scene)))
    text = " ".join(text.split())
    assert said in text
    assert (" within " in text) == (" within " in said)


def test_one_equality_is_met_by_the_least_change():
    met = meet_change_points((4.00001, 1.0, 2.0, 3.0), (1e-5, 0.0, 0.0, 0.0))
    assert met == (4.0, 1.0, 2.0, 3.0)
    lengths = (4.0, 1.0, 2.0, 3.0 + 4e-6)
    met = meet_change_points(lengths, (1e-5,) * 4)
    assert met == approx((4 + 1e-6, 1 + 1e-6, 2 - 1e-6, 3 + 3e-6), abs=1e-12)


@pytest.mark.parametrize("name", ("open", "crossed"))
def test_equilibria_are_named_as_a_scene_states_their_assembly(name):
    """Each, put into a scene with its branch, needs no torque."""
    branch = {"open": 1, "crossed": -1}[name]
    scene = Scene(
        uniform(0.3, 0.1, 0.3, 0.1),
        Motion(branch=branch),
        effects=(Gravity(),),
    )
    rows = write_equilibria("", fourbar.equilibrium(scene)).splitlines()
    found = [row.split() for row in rows if {"stable", "unstable"} & {*row.split()}]
    assert len(found) > 1
    for theta_2, _, named, _, _, slope, *_ in found:
        assert named == name
        at = Motion(radians(float(theta_2)), 0.0, branch=branch)
        torque = solve(replace(scene, motion=at)).torque
        assert abs(torque[0]) <= PRINTED * abs(float(slope))


@pytest.mark.parametrize("omega", [0.0, 1e-9])
def test_a_lamp_that_a_spring_balances_shows_zeros_and_not_their_rounding(omega):
    """Bars 3 and 4 share no load."""
    scene = balanced_lamp(omega)
    lines = write_block(scene, solve(scene, "error"))
    (torque,) = (line for line in lines if line.startswith("  torque"))
    assert re.fullmatch(r"  torque   peak 0 N m at .*, RMS 0 N m", torque), torque
    assert "the torque is zero within rounding" in lines
    assert not re.search("without bound|motor|some digits|nN", "\n".join(lines))


@pytest.mark.slow
def test_rounding_is_written_as_zero():
    """A massless rocker is a two-force bar, and bars without mass need no torque."""
    linkage = FourBar(2.0, Bar(1.0), Bar(3.0, 1.0), Bar(3.0))
    motion = Motion(omega_2=1.0)
    scene = Scene(linkage, motion, effects=(Gravity(),))
    lines = write_block(scene, solve(scene, "error"))
    (moments,) = (line for line in lines if line.startswith("  moment"))
    assert moments.split()[-3:] == ["0", "N", "m"]
    assert not any("growing without bound" in line for line in lines)
    bare = Scene(uniform(2.0, 1.0, 3.0, 3.0, per_metre=0.0), motion)
    text = "\n".join(write_block(bare, solve(bare, "error")))
    assert "-0 " not in text and "digits left" not in text
    kite = Scene(uniform(0.1, 0.1, 0.3, 0.3), motion)
    text = "\n".join(write_block(kite, solve(kite, "error")))
    assert not re.search(r"e-[0-9]+ (?:deg|mm|m|N)\b", text)


@pytest.mark.slow
def test_the_peak_of_a_release_over_change_points_is_said_to_grow():
    linkage = uniform(0.3, 0.1, 0.3, 0.1)
    motion = Motion(0.5, 25.0, free=Free(0.4, 50))
    scene = Scene(
        linkage, motion, loads=(fourbar.Load(2, moment=0.05),), effects=(GRAVITY,)
    )
    solution = solve(scene)
    assert len(solution.change_points) > 2
    text = " ".join(" ".join(write_block(scene, solution)).split())
    assert "at a change point pin forces grow without bound" in text
    for time in solution.change_points:
        angle = np.interp(time, solution.time, solution.theta_2)
        assert abs(math.sin(angle)) < 1e-3


@pytest.mark.slow
def test_the_peak_of_a_release_with_limits_is_not_said_to_grow():
    """Of equal halves each arm carries its own: no pin force grows, however near."""
    motion = Motion(0.5, 6.0, free=Free(0.5, 100))
    scene = Scene(uniform(0.3, 0.1, 0.3, 0.1), motion, effects=(GRAVITY,))
    solution = solve(scene)
    assert solution.change_points
    assert "without bound" not in "\n".join(write_block(scene, solution))


def test_a_kite_on_its_change_point_shows_zeros_and_not_their_rounding():
    kite = FourBar(0.3, Bar(0.3), Bar(0.2, 1.0), Bar(0.2))
    scene = Scene(kite, Motion(0.0, 1.0))
    text = "\n".join(write_block(scene, solve(scene)))
    assert "e-" not in text
    assert "-0.0000" not in text
    assert re.search(r"transmission angle +0 deg", text)
    assert re.search(r"torque +0 N m", text)
