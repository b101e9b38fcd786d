"""Equilibria: pendulums and free bodies say where and how fast.

Released motions agree, and none is missed.
"""

import json
import re
from dataclasses import replace
from math import acos, asin, degrees, pi, radians, remainder, sqrt
from pathlib import Path

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
from pytest import approx, mark

from fourbar import (
    Bar,
    FourBar,
    Friction,
    Gravity,
    Load,
    Motion,
    Place,
    Scene,
    Spring,
    Springs,
    Sweep,
    Table,
    Torsion,
    dump,
    equilibrium,
    limit_positions,
    solve,
)
from fourbar.files import load, loads
from fourbar.formulas.mobility import find_intervals
from fourbar.show.lines import BLOCK_WIDTH
from fourbar.show.studies import write_equilibria
from fourbar.studies.circuit_curve import POSITIONS_OF_A_BRANCH, CircuitCurve
from fourbar_validation.places import MODELS
from tests.support.rows import each_branch, slow_but
from tests.support.scenes import (
    MASSLESS,
    balanced_lamp,
    bare,
    recommand,
)

TURN = 2.0 * pi
M, R, INERTIA = 1.5, 0.04, 0.002
J = INERTIA + M * R * R
FALLS = M * 9.81 * R
AT_REST = -pi / 2 - 0.3
"""theta_2 of the crank as a pendulum that hangs."""
DOWN = Gravity()

CLOSE = 1e-12
"""Relative and rad; a dozen operations in doubles, and angles of a few turns."""


def crank_as_pendulum(*effects, loads=(), **motion):
    """A crank-rocker of which the crank alone has mass.

    theta_2 swings as one body about O2.
    """
    linkage = FourBar(0.3, Bar(0.1, M, INERTIA, (R, 0.3)), Bar(0.25), Bar(0.22), 0.2)
    return Scene(
        linkage, Motion(**{"theta_2": 0.7, **motion}), loads=loads, effects=effects
    )


SAMPLE = 0.2 + 700.5 * TURN / POSITIONS_OF_A_BRANCH


def pendulum_under_moment(excess):
    """Q = 0.5 (1 + excess) - 0.5 sin(theta_2 - 0.1)."""
    moment = Load(2, moment=0.5 * (1.0 + excess))
    scene = crank_as_pendulum(Gravity(8.0, 0.0), loads=(moment,))
    crank = Bar(0.1, 1.0, 0.0, (0.0625, -0.1))
    return replace(scene, linkage=replace(scene.linkage, input=crank))


def apart(excess):
    """Half the distance of its two zeros, a sixth of the grid's step at -1e-8."""
    return acos(1.0 + excess)


TOP = pi / 2 + 0.1


SPRING = Springs((Spring(Place(1, (0.3, 1.0)), Place(2, (0.1, 0.0)), 100.0),))


WITHOUT_MASS = replace(crank_as_pendulum(SPRING), linkage=MASSLESS)


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
    "a sweep that a table just covers": (
        crank_as_pendulum(
            Friction.at(O2=0.01),
            loads=(Load(2, moment=-2.0, table=Table((0.3, 1.0), (-0.4, 0.3))),),
            theta_2=Sweep(0.3, 1.0, 10),
        ),
        [("stable", 0.7, -2.0, J)],
        CLOSE,
    ),
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


@mark.parametrize("name", PENDULUMS)
def test_a_crank_with_mass_alone_is_a_pendulum(name):
    scene, expected, close = PENDULUMS[name]
    equilibria = equilibrium(scene)
    assert equilibria.samples >= POSITIONS_OF_A_BRANCH or "sweep" in name
    assert not equilibria.indifferent
    found = sorted(equilibria.found, key=lambda rest: rest.stability)
    assert [rest.stability for rest in found] == [row[0] for row in expected]
    for rest, (stability, theta_2, slope, inertia) in zip(found, expected, strict=True):
        assert remainder(rest.place.theta_2 - theta_2, TURN) == approx(0.0, abs=close)
        assert rest.inertia == approx(inertia, rel=CLOSE, abs=CLOSE)
        assert rest.slope == approx(slope, rel=max(CLOSE, 1e3 * close), abs=close)
        if stability == "stable" and inertia:
            own = sqrt(-rest.slope / inertia) / TURN
            assert rest.frequency == approx(own, rel=CLOSE)
        else:
            assert rest.frequency is None


def test_at_its_limits_the_output_is_a_pendulum_or_has_no_inertia():
    """Bar 4 alone has mass, and a frequency of its own about O4 where it moves.

    Hung along a limit of its own it swings in theta_4; at a limit of its own it stands
    still to first order.
    """
    bars = Bar(0.4), Bar(0.2), Bar(0.25, M, INERTIA, (R, 0.0))
    linkage = FourBar(0.3, *bars, 0.5)
    own = sqrt(FALLS / J) / TURN
    limit = limit_positions(linkage)[0]
    beside = Motion(np.array([limit.theta_2 + off for off in (0.01, -0.01)]))
    along = Scene(linkage, beside, effects=(Gravity(9.81, limit.theta_4),))
    (hanging,) = [rest for rest in equilibrium(along).found if rest.place.branch == 0]
    assert hanging.angle == "theta_4"
    assert hanging.frequency == approx(own, rel=1e-9)
    found = equilibrium(Scene(linkage, effects=(DOWN,))).found
    stands = [rest for rest in found if rest.inertia < 1e-6]
    assert [(rest.inertia, rest.frequency) for rest in stands] == [(0.0, None)] * 2
    swings = [rest for rest in found if rest.stability == "stable" and rest.inertia]
    assert [rest.frequency for rest in swings] == approx([own] * 2)


@mark.slow
def test_friction_holds_a_pendulum_within_the_angle_that_it_can():
    f = 0.2
    away = asin(f / (M * 9.81 * R))
    along = Gravity(9.81, 0.3)  # it hangs at theta_2 = 0, where counting begins
    equilibria = equilibrium(crank_as_pendulum(along, Friction.at(O2=f)))
    for rest in equilibria.found:
        ends = [remainder(end[0] - rest.place[0], TURN) for end in rest.held]
        assert ends == approx([-away, away], abs=CLOSE)
    assert len(equilibria.held) == 2
    assert all(lower.theta_2 < upper.theta_2 for lower, upper in equilibria.held)
    Q = -FALLS * np.sin(equilibria.positions.theta_2)
    assert np.array_equal(equilibria.moves, np.where(abs(Q) <= f, 0.0, np.sign(Q)))
    stuck = equilibrium(crank_as_pendulum(DOWN, Friction.at(O2=10.0)))
    assert not stuck.moves.any() and len(stuck.held) == 1
    assert all(rest.held for rest in stuck.found)


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


@mark.slow
@each_branch
@mark.parametrize(
    "lengths, swept",
    [
        *zip(ONE_CHANGE_POINT, (FULL, HALF, BACK, None), strict=True),
        *zip(ONE_CHANGE_POINT, (BACK, None, FULL, HALF), strict=True),
    ],
)
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
    nothing = 1e-9 * np.nanmax(abs(torques))
    assert abs(solve(moving(angles)).torque).max() < nothing
    signs = np.sign(torques[abs(torques) > nothing])
    assert len(angles) == np.sum(signs[1:] != signs[:-1]) > 0


@mark.slow
def test_friction_holds_on_past_the_one_change_point():
    """Bars in line hold on both sides of it, in one range of the assembly."""
    linkage = FourBar(1.0, Bar(1.0, 10.0), Bar(2.0, 20.0), Bar(2.0, 20.0))
    scene = Scene(linkage, Motion(), effects=(DOWN, Friction.at(O2=40.0, O4=40.0)))
    held = equilibrium(scene).held
    assert any(first.theta_2 < TURN < last.theta_2 for first, last in held)
    for first, last in held:
        angles = np.linspace(first.theta_2, last.theta_2, 101)[1:-1]
        at_rest = solve(replace(scene, motion=Motion(angles, 0.0)))
        assert np.isfinite(at_rest.torque_low).sum() >= len(angles) - 1
        assert np.nanmax(at_rest.torque_low) <= 0.0 <= np.nanmin(at_rest.torque_high)


def test_what_is_balanced_is_indifferent_over_all_that_it_reaches():
    """What rounding leaves of a torque is no torque.

    In the crossed assembly of a rhombus bar 4 rests, and a load on it does nothing.
    """
    hanging = crank_as_pendulum(DOWN)
    centred = replace(hanging.linkage, input=Bar(0.1, M, INERTIA, (0.0, 0.0)))
    square = load(MODELS / "textbook/gtdynamics_square.toml")
    crossed = recommand(square, branch=-1)
    assert not equilibrium(square).indifferent
    lamp = equilibrium(balanced_lamp())
    assert not re.search(r"\de-|largest", write_equilibria("lamp", lamp))
    for equilibria, reached in (
        (lamp, radians(100.0)),
        (equilibrium(crank_as_pendulum()), TURN),
        (equilibrium(replace(hanging, linkage=centred)), TURN),
        (equilibrium(crossed), None),
    ):
        assert not equilibria.found
        first, last = (end.theta_2 for end in equilibria.indifferent[0])
        assert reached is None or last - first == approx(reached)
        assert reached != TURN or 0.0 <= first < TURN
    first, last = (degrees(end.theta_2) for end in lamp.indifferent[0])
    assert (first, last) == approx((-40.0, 60.0), abs=1e-9)


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


@mark.parametrize("start, angles", [(60, []), (160, [167.7867])])
def test_a_torsion_spring_is_followed_from_the_start_of_the_sweep(start, angles):
    """From the first angle that closes the spring at B is wound by 254.5 deg where the
    work of both would vanish, and by half a turn from 113 deg on; a sweep that begins
    beside it has it within half a turn.
    """
    equilibria = equilibrium(loads(ROBOT.replace("START", f"{start} deg")))
    reached = [rest.place.theta_2 for rest in equilibria.found if rest.reached]
    assert np.degrees(reached) == approx(angles, abs=1e-4)
    rows = write_equilibria("robot", equilibria).splitlines()
    ends = [row.split() for row in rows if re.search("(wound|falls|grows|stays)$", row)]
    assert ends
    for angle, *_, word in ends:
        assert (word == "wound") == (start == 60 and float(angle) >= 113.0)


def test_without_a_sweep_a_torsion_spring_is_followed_either_way_round():
    """The one at O2 is wound nowhere. Past half a turn from the rest of the one at O4,
    which swings, no way leads.
    """
    spring = Torsion.at(O2=(2.0, -2.2, 0.0))
    positions = equilibrium(crank_as_pendulum(spring)).positions
    from_rest = np.remainder(positions.theta_2 + 2.0 + pi, TURN) - pi
    assert_allclose(positions.torque, 2.0 * from_rest, rtol=1e-12)
    middle = 0.5 * (positions.theta_4.min() + positions.theta_4.max())
    spring = Torsion.at(O4=(2.0, middle - pi - 0.2, 0.0))
    balances = Load(4, moment=2.0 * (0.05 - pi))  # 0.05 rad past the middle
    beside = positions.theta_2[np.argmin(positions.theta_4)]
    scene = crank_as_pendulum(spring, loads=(balances,), theta_2=beside)
    equilibria = equilibrium(scene)
    wound = np.array(equilibria.positions.status) == "wound"
    assert_array_equal(wound, positions.theta_4 > middle)
    (reached,) = equilibria.found  # where the output turns back
    assert reached.place.theta_4 == approx(positions.theta_4.min(), abs=1e-4)


def springy_table(**motion):
    """A folding table on two legs, pressed up by torsion springs: a double rocker."""
    bars = Bar(0.35, 0.6), Bar(0.45, 8.0), Bar(0.35, 0.6)
    leg = 12.0, radians(120.0), 0.0
    springs = Torsion.at(O2=leg, O4=leg)
    return Scene(FourBar(0.5, *bars), Motion(**motion), effects=(DOWN, springs))


SWEPT = Sweep(radians(20.0), radians(140.0), 60)


@mark.parametrize("branch", slow_but({1}, [1, -1]))
@mark.slow
def test_what_a_sweep_does_not_reach_is_told_apart(branch):
    """The other assembly has the same angles and an equilibrium among them."""
    equilibria = equilibrium(springy_table(theta_2=SWEPT, branch=branch))
    (rest,) = equilibria.found
    assert rest.place.branch == -1
    assert rest.reached == (branch == -1)
    assert all(rest.reached for rest in equilibrium(springy_table(branch=branch)).found)
    if branch == 1:
        first, second, _ = write_equilibria("table", equilibria).split("\n\n")
        assert "0 equilibria in this sweep without friction," in first
        assert second.startswith(
            "1 equilibrium in the other assembly at angles theta_2"
        )
        assert "138.3165" in second and "crossed" in second


def test_a_sweep_of_another_bar_reaches_both_sides_of_a_limit_and_no_more():
    """Bar 2 turns back at its limit, theta_4 = 196.4 deg, within the sweep."""
    scene = springy_table(theta_4=Sweep(radians(150.0), radians(230.0), 60))
    curve = CircuitCurve(scene)
    for low, high in ((150.0, 230.0), (60.0, 149.9), (230.1, 300.0)):
        swept = Motion(theta_4=Sweep(radians(low), radians(high), 977))
        s = solve(replace(scene, motion=swept), "position")
        assert s.assembled.all()
        places = curve.tau(s.theta_2, s.sin_mu)
        assert (curve.reached(places) == (low == 150.0)).all()
        assert low != 150.0 or {*np.sign(s.sin_mu)} == {1.0, -1.0}


def test_a_coarse_sweep_reaches_what_it_passes_in_its_circuit_and_no_more():
    """It leaves the range of theta_2 at one end, and begins again at the other."""
    linkage = bare(0.876, 0.455, 0.276, 0.398)
    first, last = linkage_range = find_intervals(linkage)[0]
    assert len(find_intervals(linkage)) == 1
    sweep = Sweep(last - 0.5, first + TURN + 0.5, 1)
    curve = CircuitCurve(Scene(linkage, Motion(sweep)))
    psi = np.linspace(*linkage_range, 402)[1:-1]
    passed = (psi < first + 0.5) | (psi > last - 0.5)
    for branch in (1, -1):
        places = curve.tau(psi, branch)
        assert_array_equal(curve.reached(places), passed & (branch == 1))


@mark.parametrize(
    "bar, lengths", [(2, (0.1, 0.09, 0.04, 0.085)), (4, (0.3, 0.1, 0.25, 0.22))]
)
def test_a_sweep_past_two_circuits_has_an_equilibrium_in_each(bar, lengths):
    ground, *others = lengths
    linkage = FourBar(ground, *(Bar(length, 1.0) for length in others))
    swept = {f"theta_{bar}": Sweep(0.0, TURN, 720), f"omega_{bar}": 0.0}
    scene = Scene(linkage, Motion(**swept), effects=(DOWN,))
    s = solve(scene)
    (rows,) = np.nonzero(s.torque[1:] * s.torque[:-1] < 0.0)
    found = [rest.place for rest in equilibrium(scene).found if rest.reached]
    at = [getattr(place, f"theta_{bar}") % TURN for place in found]
    assert at == approx(s.at.angle[rows] + TURN / 1440, abs=TURN / 1440)
    assert len(found) == 2


def test_equilibria_are_printed_in_the_units_of_the_file(show):
    text, pound, inch = dump(crank_as_pendulum(DOWN)), 0.45359237, 0.0254
    assert 'ground = "0.3 m"' in text
    stated = text.replace('ground = "0.3 m"', f'ground = "{0.3 / inch!r} in"')
    Path("inches.toml").write_text(stated)
    printed = show("equilibrium", "inches.toml")
    slope = FALLS / (pound * 9.80665 * inch)
    for words in (
        "(lbf in/rad)",
        "(lb in^2)",
        "torque (lbf in)",
        f"{J / (pound * inch**2):.6g}",
        f"{slope:.6g}",
    ):
        assert words in printed


def test_a_crank_that_hangs_stays_there_when_released():
    """Its weight has no lever at 90 and 270 deg, but for the angle's rounding."""
    bars = FourBar(0.4, Bar(0.1, 1.0), Bar(0.35), Bar(0.26))
    motion = Motion(np.radians(np.arange(0.0, 360.0, 30.0)), 0.0)
    equilibria = equilibrium(Scene(bars, motion, effects=(DOWN,)))
    moves = dict(zip(range(0, 360, 30), equilibria.moves.tolist(), strict=True))
    assert (moves[90], moves[270], moves[60], moves[120]) == (0, 0, -1, 1)


@mark.slow
def test_at_a_change_point_a_released_parallelogram_has_two_ways_to_move():
    """Elsewhere it falls: the height of its mass centres grows with sin(theta_2)."""
    arm = Bar(0.5, 21.0)
    scene = Scene(FourBar(0.6, arm, Bar(0.6, 25.0), arm), Motion(0.0), effects=(DOWN,))
    equilibria = equilibrium(scene)
    slope = np.cos(equilibria.positions.theta_2)
    falls = np.where(abs(slope) > CLOSE, -np.sign(slope), 0.0)
    falls[abs(np.sin(equilibria.positions.theta_2)) < CLOSE] = 0.0
    assert_array_equal(equilibria.moves, falls)
    rows = [row.split() for row in write_equilibria("", equilibria).splitlines()]
    words = {row[0]: row[-1] for row in rows if row}
    assert [words[angle] for angle in ("0", "180", "360")] == ["change_point"] * 3


@mark.slow
def test_the_command_prints_what_python_finds(show):
    file = MODELS / "problems/gz_physics_987.toml"
    printed = show("equilibrium", file)
    for words in (" 0.759439\n", "found between 3600 positions", "stable"):
        assert words in printed
    kept = json.loads(show("equilibrium", file, "--json"))
    equilibria = equilibrium(load(file))
    places = [rest.place.theta_2 for rest in equilibria.found]
    assert [rest["place"]["theta_2"] for rest in kept["equilibria"]] == places
    assert kept["samples"] == equilibria.samples
    assert kept["positions"]["theta_2"] == equilibria.positions.theta_2.tolist()
    counterexamples = MODELS.parent / "tests/counterexamples"
    stuck = counterexamples / "dry_friction_on_a_crank_at_rest.toml"
    printed = show("equilibrium", stuck)
    assert max(map(len, printed.splitlines())) <= BLOCK_WIDTH
    assert "friction holds, about no" in printed
    assert "positions, without friction: " in printed
    folded = counterexamples / "kite_with_A_on_O4.toml"
    kite = json.loads(show("equilibrium", folded, "--json"))
    assert kite["not_decided"][0]["theta_4"] is None  # which it has not there
