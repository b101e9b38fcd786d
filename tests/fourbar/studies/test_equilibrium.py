"""Equilibria: pendulums and free bodies say where and how fast.

Released motions agree, and none is missed.
"""

import json
import math
import re
from collections.abc import Callable
from dataclasses import replace
from math import pi, radians, sqrt
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from pytest import approx

import fourbar
from fourbar import (
    Bar,
    FourBar,
    Friction,
    Gravity,
    Load,
    Motion,
    PinFriction,
    Scene,
    Spring,
    Springs,
    Sweep,
    Torsion,
    solve,
)
from fourbar.cli import status
from fourbar.effects import Place
from fourbar.files import load, loads
from fourbar.scene.motion import Free
from fourbar.show.lines import BLOCK_WIDTH
from fourbar.show.studies import write_equilibria
from fourbar.studies.circuit_curve import POSITIONS_OF_A_BRANCH, CircuitCurve
from fourbar.studies.equilibrium import equilibrium
from tests.support.scenes import CYLINDER, balanced_lamp, bare, crank_rocker
from tests.support.shares import slow_but

ROOT = Path(__file__).parents[3]
MODELS = ROOT / "models"
COUNTEREXAMPLES = ROOT / "tests" / "counterexamples"
TURN = 2.0 * pi
M, R, INERTIA = 1.5, 0.04, 0.002
DOWN = Gravity()
CLOSE = 1e-12
"""Relative and rad; a dozen operations in doubles, and angles of a few turns."""


Run = Callable[..., str]


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Runs `fourbar equilibrium`, which must hold, and returns what it prints."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        assert status(["equilibrium", *arguments]) == 0
        printed = capsys.readouterr().out
        if "--json" not in arguments:
            assert max(map(len, printed.splitlines()), default=0) <= BLOCK_WIDTH
        return printed

    return call


def crank_as_pendulum(*effects, loads=(), **motion):
    """A crank-rocker of which the crank alone has mass.

    theta_2 swings as one body about O2.
    """
    linkage = FourBar(0.3, Bar(0.1, M, INERTIA, (R, 0.3)), Bar(0.25), Bar(0.22), 0.2)
    return Scene(
        linkage, Motion(**{"theta_2": 0.7, **motion}), loads=loads, effects=effects
    )


J = INERTIA + M * R * R
AT_REST = -pi / 2 - 0.3
"""theta_2 of the crank as a pendulum that hangs."""
FALLS = M * 9.81 * R
GRID = TURN / POSITIONS_OF_A_BRANCH
SAMPLE = 0.2 + 700.5 * GRID


def pendulum_under_moment(excess):
    """Q = 0.5 (1 + excess) - 0.5 sin(theta_2 - 0.1)."""
    moment = Load(2, moment=0.5 * (1.0 + excess))
    scene = crank_as_pendulum(Gravity(8.0, 0.0), loads=(moment,))
    crank = Bar(0.1, 1.0, 0.0, (0.0625, -0.1))
    return replace(scene, linkage=replace(scene.linkage, input=crank))


def apart(excess):
    """Half the distance of its two zeros, a sixth of the grid's step at -1e-8."""
    return math.acos(1.0 + excess)


TOP = pi / 2 + 0.1
SPRING = Springs((Spring(Place(1, (0.3, 1.0)), Place(2, (0.1, 0.0)), 100.0),))
WITHOUT_MASS = replace(
    crank_as_pendulum(SPRING), linkage=bare(0.3, 0.1, 0.25, 0.22, 0.0)
)
HANGS = ("stable", AT_REST, -FALLS, J)
STEEP = 0.5 * sqrt(2e-8)
PENDULUMS = {
    # stability, theta_2, dQ/dq and inertia of each equilibrium; rad that they may miss
    "hanging and standing": (
        crank_as_pendulum(DOWN),
        [HANGS, ("unstable", AT_REST + pi, FALLS, J)],
        CLOSE,
    ),
    **{
        f"a sweep {name}": (crank_as_pendulum(DOWN, theta_2=sweep), [HANGS], CLOSE)
        for name, sweep in {
            "from it": Sweep(AT_REST, AT_REST + 1.0, 10),
            "to it": Sweep(AT_REST - 1.0, AT_REST, 10),
            "that leaves out the other": Sweep(-3.0, 1.2, 30),
        }.items()
    },
    # at half a turn from rest its force jumps, which is no equilibrium
    **{
        f"torsion {name}": (
            crank_as_pendulum(Torsion.at(O2=(2.0, rest - 0.2, 0.0))),
            [("stable", rest, -2.0, J)],
            1e-9,
        )
        for name, rest in {"spring": 0.7, "on a sample": SAMPLE}.items()
    },
    "without mass": (
        WITHOUT_MASS,
        [("stable", 1.0, -3.0, 0.0), ("unstable", 1.0 + pi, 3.0, 0.0)],
        CLOSE,
    ),
    "touching between two samples": (
        pendulum_under_moment(0.0),
        [("undecided", TOP, 0.0, 1 / 256)],
        1e-7,
    ),
    "hardly not touching": (pendulum_under_moment(1e-9), [], 0.0),
    "two between the same samples": (
        pendulum_under_moment(-1e-8),
        [
            ("stable", TOP - apart(-1e-8), -STEEP, 1 / 256),
            ("unstable", TOP + apart(-1e-8), STEEP, 1 / 256),
        ],
        1e-9,
    ),
}


@pytest.mark.parametrize("name", PENDULUMS)
def test_a_crank_with_mass_alone_is_a_pendulum(name):
    scene, expected, close = PENDULUMS[name]
    equilibria = equilibrium(scene)
    assert equilibria.samples >= POSITIONS_OF_A_BRANCH or "sweep" in name
    assert not equilibria.indifferent
    found = sorted(equilibria.found, key=lambda rest: rest.stability)
    assert [rest.stability for rest in found] == [row[0] for row in expected]
    for rest, (stability, theta_2, slope, inertia) in zip(found, expected, strict=True):
        turned = math.remainder(rest.place.theta_2 - theta_2, TURN)
        assert turned == approx(0.0, abs=close)
        assert rest.inertia == approx(inertia, rel=CLOSE, abs=CLOSE)
        assert rest.slope == approx(slope, rel=max(CLOSE, 1e3 * close), abs=close)
        if stability == "stable" and inertia:
            own = sqrt(-rest.slope / inertia) / TURN
            assert rest.frequency == approx(own, rel=CLOSE)
        else:
            assert rest.frequency is None


def test_the_frequency_at_a_limit_is_that_of_the_output_as_a_pendulum():
    linkage = FourBar(0.3, Bar(0.4), Bar(0.2), Bar(0.25, M, INERTIA, (R, 0.0)), 0.5)
    limit = fourbar.limit_positions(linkage)[0]
    beside = Motion(np.array([limit.theta_2 + off for off in (0.01, -0.01)]))
    scene = Scene(linkage, beside, effects=(Gravity(9.81, limit.theta_4),))
    (hanging,) = [rest for rest in equilibrium(scene).found if rest.place.branch == 0]
    assert hanging.angle == "theta_4"
    pendulum = sqrt(M * 9.81 * R / (INERTIA + M * R * R)) / (TURN)
    assert hanging.frequency == approx(pendulum, rel=1e-9)


def test_a_slope_that_is_no_number_is_neither_stable_nor_unstable(monkeypatch):
    nothing = np.full(1, np.nan)
    monkeypatch.setattr(CircuitCurve, "slope", lambda _, points: nothing * points[:, 0])
    found = equilibrium(crank_as_pendulum(DOWN)).found
    assert [(rest.stability, rest.frequency) for rest in found] == [
        ("undecided", None)
    ] * 2


@pytest.mark.slow
def test_friction_holds_a_pendulum_within_the_angle_that_it_can():
    f = 0.2
    away = math.asin(f / (M * 9.81 * R))
    equilibria = equilibrium(crank_as_pendulum(DOWN, Friction.at(O2=f)))
    for rest in equilibria.found:
        ends = [math.remainder(end[0] - rest.place[0], TURN) for end in rest.held]
        assert ends == approx([-away, away], abs=CLOSE)
    assert len(equilibria.held) == 2
    assert all(lower.theta_2 < upper.theta_2 for lower, upper in equilibria.held)
    Q = -FALLS * np.cos(equilibria.positions.theta_2 + 0.3)
    moves = np.where(np.abs(Q) <= f, 0.0, np.sign(Q))
    assert np.array_equal(equilibria.moves, moves)
    stuck = equilibrium(crank_as_pendulum(DOWN, Friction.at(O2=10.0)))
    assert not stuck.moves.any() and len(stuck.held) == 1
    assert all(rest.held for rest in stuck.found)


@pytest.mark.slow
def test_loaded_friction_holds_up_to_where_no_torque_is_needed_to_move():
    friction = PinFriction.at(O2=(0.2, 0.01), A=(0.1, 0.01), O4=(0.2, 0.02))
    scene = load(MODELS / "crank_rocker.toml")
    scene = replace(scene, loads=(), effects=(DOWN, friction))
    equilibria = equilibrium(scene)
    assert len(equilibria.held) == 2
    size = np.abs(equilibria.positions.torque).max()
    for ends in equilibria.held:
        signs = np.array([end.branch for end in ends], dtype=np.int8)
        theta = np.array([end.theta_2 for end in ends])
        at_ends = fourbar.scene.Command(theta, signs, 0.0, 0.0)
        torques = solve(scene, at=at_ends)
        least = np.minimum(abs(torques.torque_low), abs(torques.torque_high))
        assert least.max() <= 1e-9 * size


@pytest.mark.slow
@pytest.mark.parametrize(
    "lengths", [(3.0, 3.0, 4.0, 4.0), (4.0, 4.0, 3.0, 3.0), (1.0, 1.0, 3.0, 3.0)]
)
def test_beside_a_change_point_nothing_is_taken_for_a_rest(lengths):
    """A kite in which A comes to O4, turned with its gravity.

    As many equilibria, and as many undecided, none.
    """
    d, a, b, c = lengths
    bars = Bar(a, 50.0, None, (1.2, 2.4)), Bar(b, 1.0), Bar(c, 6.0)
    for turn in (0.0, 0.3, 2.0):
        gravity, motion = Gravity(9.81, turn - 1.9), Motion(1.0 + turn)
        scene = Scene(FourBar(d, *bars, turn), motion, effects=(gravity,))
        found = sorted(rest.stability for rest in equilibrium(scene).found)
        assert found == ["stable"] * 2 + ["unstable"] * 2


ONE_CHANGE_POINT = [
    (1.0, 1.0, 2.0, 2.0),  # folded at theta_1: both kites, and a = d, b = c
    (2.0, 1.0, 2.5, 1.5),  # folded, of four lengths
    (1.5, 1.0, 1.25, 1.25),  # stretched at theta_1 + 180 deg
    (2.0, 0.5, 1.25, 1.25),
]
"""Ground, input, coupler and output: the input turns fully, past one change point."""
FULL = Sweep(0.0, 4.0 * pi, 360)
HALF = Sweep(radians(30.0), radians(390.0), 180)
BACK = Sweep(radians(500.0), radians(-100.0), 300)


@pytest.mark.slow
@pytest.mark.parametrize("swept", [FULL, HALF, BACK, None])
@pytest.mark.parametrize("branch", [1, -1])
@pytest.mark.parametrize("lengths", ONE_CHANGE_POINT)
def test_past_one_change_point_the_angle_is_that_of_the_scenes_assembly(
    lengths, branch, swept
):
    """An assembly repeats after two turns of the input.

    The scene needs no torque at any angle that is found, and changes the sign of its
    torque at no others.
    """
    d, a, b, c = lengths
    linkage = FourBar(d, Bar(a, 10.0), Bar(b, 20.0), Bar(c, 20.0), 0.5 * pi)
    load = Load(4, force=(0.0, 200.0), from_pin=(c, 0.0))

    def moving(angles):
        motion = Motion(angles, 0.0, branch=branch)
        return Scene(linkage, motion, loads=(load,), effects=(Gravity(9.81, 0.1),))

    found = equilibrium(moving(swept)).found
    assert all(rest.reached for rest in found)
    angles = np.array([rest.place.theta_2 for rest in found])
    assert (np.diff(angles) > 0.0).all()
    ends = (swept or FULL).start, (swept or FULL).stop
    torques = solve(moving(np.linspace(*ends, 3000))).torque
    nothing = 1e-9 * np.nanmax(np.abs(torques))
    assert np.abs(solve(moving(angles)).torque).max() < nothing
    signs = np.sign(torques[np.abs(torques) > nothing])
    assert len(angles) == np.sum(signs[1:] != signs[:-1]) > 0


@pytest.mark.slow
def test_friction_holds_on_past_the_one_change_point():
    """Bars in line hold on both sides of it, in one range of the assembly."""
    linkage = FourBar(1.0, Bar(1.0, 10.0), Bar(2.0, 20.0), Bar(2.0, 20.0))
    scene = Scene(linkage, Motion(), effects=(DOWN, Friction.at(O2=40.0, O4=40.0)))
    held = equilibrium(scene).held
    assert any(first.theta_2 < TURN < last.theta_2 for first, last in held)
    for first, last in held:
        angles = np.linspace(first.theta_2, last.theta_2, 101)[1:-1]
        at = Motion(theta_2=angles, omega_2=0.0, alpha_2=0.0)
        at_rest = solve(replace(scene, motion=at))
        solved = np.isfinite(at_rest.torque_low)
        assert solved.sum() >= len(angles) - 1
        assert (at_rest.torque_low[solved] <= 0.0).all()
        assert (at_rest.torque_high[solved] >= 0.0).all()


def test_a_balanced_linkage_is_indifferent_over_its_sweep_as_it_is_stated():
    rest = equilibrium(balanced_lamp())
    # what rounding leaves of the torque is no torque
    assert not re.search(r"\de-|largest", write_equilibria("lamp", rest))
    ((first, last),) = rest.indifferent
    ends = math.degrees(first.theta_2), math.degrees(last.theta_2)
    assert ends == approx((-40.0, 60.0), abs=1e-9)


def test_nothing_that_acts_and_a_balanced_crank_are_indifferent_all_round():
    scene = crank_as_pendulum(DOWN)
    centred = replace(scene.linkage, input=Bar(0.1, M, INERTIA, (0.0, 0.0)))
    for balanced in (crank_as_pendulum(), replace(scene, linkage=centred)):
        equilibria = equilibrium(balanced)
        ((first, last),) = equilibria.indifferent
        assert not equilibria.found
        assert last.theta_2 - first.theta_2 == approx(TURN)


def test_a_load_on_a_bar_that_rests_is_indifferent_in_one_way_of_moving_alone():
    """A rhombus: in its crossed assembly bar 4 rests."""
    scene = load(MODELS / "textbook" / "gtdynamics_square.toml")
    crossed = replace(scene, motion=scene.motion.replace(branch=-1))
    assert not equilibrium(scene).indifferent
    equilibria = equilibrium(crossed)
    assert equilibria.indifferent and not equilibria.found


ROBOT = """
[lengths]
ground = "6 m"
input = "4 m"
coupler = "5 m"
output = "3 m"
ground_angle = "180 deg"
[motion]
theta_2 = { from = "START", to = "170 deg", steps = 110 }
branch = "crossed"
[effects.torsion]
A = { stiffness = "10 N m/rad", rest = "90 deg" }
B = { stiffness = "10 N m/rad", rest = "-90 deg" }
"""


@pytest.mark.parametrize(
    "start, turned, angles", [(60.0, 254.5, []), (160.0, 105.5, [167.7867])]
)
def test_a_torsion_spring_is_followed_from_the_start_of_the_sweep(
    start, turned, angles
):
    """Two circles close the loop at 5000 angles, along which the pins are followed.

    From the first that closes the spring at B is wound by 254.5 deg where the work of
    both would vanish; a sweep that begins beside it has it within half a turn.
    """
    theta = np.radians(np.linspace(start, 170.0, 5000))
    to_O4 = -6.0 - 4.0 * np.exp(1j * theta)
    theta, to_O4 = theta[np.abs(to_O4) < 8.0], to_O4[np.abs(to_O4) < 8.0]
    d = np.abs(to_O4)
    along = (5.0**2 - 3.0**2 + d**2) / (2.0 * d)
    coupler = (along + 1j * np.sqrt(5.0**2 - along**2)) * to_O4 / d
    theta_3, theta_4 = (np.unwrap(np.angle(u)) for u in (coupler, coupler - to_O4))
    wound = np.array([theta_3 - theta - pi / 2, theta_4 - theta_3 + pi / 2])
    wound -= TURN * np.rint(wound[:, :1] / TURN)
    near = np.argmin(np.abs(theta - math.radians(167.7867)))
    assert math.degrees(abs(wound[1, near])) == approx(turned, abs=0.05)
    within = np.all(np.abs(wound) < pi, axis=0)
    energy = 5.0 * np.sum(wound**2, axis=0)[within]
    assert np.any(np.diff(np.sign(np.diff(energy)))) == bool(angles)

    found = equilibrium(loads(ROBOT.replace("START", f"{start} deg")))
    reached = [math.degrees(r.place.theta_2) for r in found.found if r.reached]
    assert reached == approx(angles, abs=1e-4)
    from_here = math.degrees(theta[np.argmax(np.abs(wound[1]) >= pi)])
    rows = [row.split() for row in write_equilibria("robot", found).splitlines()]
    ends = [
        row for row in rows if row and row[-1] in ("wound", "falls", "grows", "stays")
    ]
    assert ends
    for angle, *_, word in ends:
        assert (word == "wound") == (not angles and float(angle) >= from_here)


def springy_table(**motion):
    """A folding table on two legs, pressed up by torsion springs: a double rocker."""
    bars = Bar(0.35, 0.6), Bar(0.45, 8.0), Bar(0.35, 0.6)
    leg = 12.0, radians(120.0), 0.0
    springs = Torsion.at(O2=leg, O4=leg)
    return Scene(FourBar(0.5, *bars), Motion(**motion), effects=(DOWN, springs))


SWEPT = Sweep(radians(20.0), radians(140.0), 60)


@pytest.mark.parametrize("branch", slow_but({1}, [1, -1]))
def test_what_a_sweep_does_not_reach_is_told_apart(branch):
    """The other assembly has the same angles and an equilibrium among them."""
    (rest,) = equilibrium(springy_table(theta_2=SWEPT, branch=branch)).found
    assert rest.place.branch == -1
    assert rest.reached == (branch == -1)
    everywhere = equilibrium(springy_table(branch=branch)).found
    assert all(rest.reached for rest in everywhere)


def points_of(scene, low, high):
    """Return psi and mu where bar 4 turns between two angles, deg."""
    sweep = Sweep(radians(low), radians(high), 977)
    solution = solve(replace(scene, motion=Motion(theta_4=sweep)), "position")
    assert solution.assembled.all()
    return np.stack([solution.theta_2, solution.theta_4 - solution.theta_3], axis=1)


def test_a_sweep_of_another_bar_reaches_both_sides_of_a_limit_and_no_more():
    """Bar 2 turns back at its limit, theta_4 = 196.4 deg, within the sweep."""
    sweep = Sweep(radians(150.0), radians(230.0), 60)
    scene = springy_table(theta_4=sweep)
    curve = CircuitCurve(scene)
    within = points_of(scene, 150.0, 230.0)
    assert set(np.sign(np.sin(within[:, 1]))) == {1.0, -1.0}
    assert curve.reached(within).all()
    assert not curve.reached(points_of(scene, 60.0, 149.9)).any()
    assert not curve.reached(points_of(scene, 230.1, 300.0)).any()


def test_the_other_assembly_stands_apart_in_the_print(run):
    fourbar.save(springy_table(theta_2=SWEPT), "table.toml")
    first, second, _ = run("table.toml").split("\n\n")
    assert first.startswith("0 equilibria in this sweep without friction,")
    assert second.startswith("1 equilibrium in the other assembly at angles theta_2")
    assert "138.3165" in second and "crossed" in second


def test_equilibria_are_printed_in_the_units_of_the_file(run):
    text, pound, inch = fourbar.dump(crank_as_pendulum(DOWN)), 0.45359237, 0.0254
    assert 'ground = "0.3 m"' in text
    stated = text.replace('ground = "0.3 m"', f'ground = "{0.3 / inch!r} in"')
    Path("inches.toml").write_text(stated)
    printed = run("inches.toml")
    slope = FALLS / (pound * 9.80665 * inch)
    for words in (
        *("(lbf in/rad)", "(lb in^2)", "torque (lbf in)"),
        *(f"{J / (pound * inch**2):.6g}", f"{slope:.6g}"),
    ):
        assert words in printed


@pytest.mark.slow
def test_released_ones_begin_to_move_as_stated():
    scene = load(MODELS / "crank_rocker.toml")
    scene = replace(scene, effects=(*scene.effects, Friction.at(O2=0.2)))
    equilibria = equilibrium(scene)
    chosen = range(7, len(equilibria.positions), 80)
    for i in chosen:
        motion = Motion(float(equilibria.positions.theta_2[i]), 0.0, free=Free(1e-2, 1))
        released = solve(replace(scene, motion=motion), "position")
        moved = np.sign(released.theta_2[1] - released.theta_2[0])
        assert moved == equilibria.moves[i]
    assert 0 in equilibria.moves[list(chosen)]
    assert len(set(equilibria.moves.tolist())) == 3


@pytest.mark.slow
def test_at_a_change_point_a_released_parallelogram_has_two_ways_to_move():
    """Elsewhere it falls: the height of its mass centres grows with sin(theta_2)."""
    arm = Bar(0.5, 21.0)
    scene = Scene(FourBar(0.6, arm, Bar(0.6, 25.0), arm), Motion(0.0), effects=(DOWN,))
    equilibria = equilibrium(scene)
    slope = np.cos(equilibria.positions.theta_2)
    falls = np.where(np.abs(slope) > CLOSE, -np.sign(slope), 0.0)
    falls[np.abs(np.sin(equilibria.positions.theta_2)) < CLOSE] = 0.0
    assert_array_equal(equilibria.moves, falls)
    rows = [row.split() for row in write_equilibria("", equilibria).splitlines()]
    words = {row[0]: row[-1] for row in rows if row}
    assert [words[angle] for angle in ("0", "180", "360")] == ["change_point"] * 3


@pytest.mark.slow
def test_the_command_prints_what_python_finds(run):
    file = MODELS / "problems" / "gz_physics_987.toml"
    printed = run(str(file))
    for words in ("0.759439193", "found between 3600 positions", "stable"):
        assert words in printed
    kept, equilibria = json.loads(run(str(file), "--json")), equilibrium(load(file))
    places = [rest.place.theta_2 for rest in equilibria.found]
    assert [rest["place"]["theta_2"] for rest in kept["equilibria"]] == places
    assert kept["samples"] == equilibria.samples
    assert kept["positions"]["theta_2"] == equilibria.positions.theta_2.tolist()
    friction = COUNTEREXAMPLES / "dry_friction_on_a_crank_at_rest.toml"
    printed = run(str(friction))
    assert "friction alone holds" in printed and "largest without friction: " in printed
    kite = json.loads(run(str(COUNTEREXAMPLES / "kite_with_A_on_O4.toml"), "--json"))
    assert kite["not_decided"][0]["theta_4"] is None  # which it has not there


def test_what_assembles_nowhere_is_refused():
    scene = Scene(fourbar.uniform(1.0, 1.5, 1.0, 0.2), Motion(pi))
    with pytest.raises(fourbar.NotAssembledError, match="assembles at none"):
        equilibrium(scene)


@pytest.mark.parametrize("unit", [1e-9, 1e120])
def test_no_unit_of_length_changes_an_equilibrium(unit):
    def find(unit):
        bars = [Bar(x * unit, M, 1e-3 * unit * unit) for x in (0.1, 0.25, 0.22)]
        linkage = FourBar(0.3 * unit, *bars, 0.2)
        return equilibrium(Scene(linkage, Motion(0.7), effects=(DOWN,)))

    found, same = find(unit).found, find(1.0).found
    assert len(found) == len(same) == 2
    for rest, in_metres in zip(found, same, strict=True):
        assert rest.place == approx(in_metres.place, abs=CLOSE)
        assert rest.slope / unit == approx(in_metres.slope, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name, start, stop, side",
    [
        ("theta_3", 1.0, 1.25, {"branch": -1}),
        ("theta_4", 1.95, 2.4, {"branch": -1}),
        ("stroke", 0.17, 0.3, {"side": "left"}),
    ],
)
def test_another_command_has_the_equilibria_of_the_positions_that_it_passes(
    name, start, stop, side
):
    """Those of the input swept over the same.

    A single position has those of its circuit.
    """
    swept = Motion(**{name: Sweep(start, stop, 90)}, **side)
    commanded = crank_rocker(motion=swept, effects=(DOWN,), drive=CYLINDER)
    theta_2 = solve(commanded).theta_2
    same = Sweep(float(theta_2.min()), float(theta_2.max()), 90)
    for by_name, by_input in (
        (swept, Motion(same)),
        (Motion(**{name: start}, **side), Motion(float(theta_2[0]))),
    ):
        one, other = (
            [(*rest.place, rest.frequency) for rest in equilibrium(scene).found]
            for scene in (
                replace(commanded, motion=by_name),
                replace(commanded, motion=by_input),
            )
        )
        assert len(one) == len(other) > 0
        for rest, same_rest in zip(one, other, strict=True):
            assert rest == approx(same_rest)


def test_what_stands_at_a_limit_has_no_inertia_and_no_frequency():
    """Bar 4 alone has mass and stands still to first order at its limits."""
    bars = Bar(0.4), Bar(0.2), Bar(0.25, 1.0, 0.002, (0.1, 0.0))
    found = equilibrium(Scene(FourBar(0.3, *bars, 0.5), effects=(DOWN,))).found
    at_limits = [rest for rest in found if rest.inertia < 1e-6]
    assert [(rest.inertia, rest.frequency) for rest in at_limits] == [(0.0, None)] * 2
    # a pendulum of bar 4 about O4, whatever moves with it
    pendulum = sqrt(9.81 * 0.1 / (0.002 + 0.01)) / TURN
    others = [
        rest.frequency for rest in found if rest.stability == "stable" and rest.inertia
    ]
    assert others == approx([pendulum] * 2)
