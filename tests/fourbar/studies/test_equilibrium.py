"""Equilibria: pendulums and free bodies say where and how fast.

Released motions agree, and none is missed.
"""

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

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
)
from fourbar.cli import status
from fourbar.effects import Place
from fourbar.files import loads
from fourbar.scene.motion import Free
from fourbar.show.lines import BLOCK_WIDTH
from fourbar.show.studies import write_equilibria
from fourbar.studies.circuit_curve import POSITIONS_OF_A_BRANCH, CircuitCurve
from fourbar.studies.equilibrium import Equilibria, Equilibrium, equilibrium
from tests.support.scenes import CYLINDER, crank_rocker

MODELS = Path(__file__).parents[3] / "models"
TURN = 2.0 * math.pi
M, R, INERTIA = 1.5, 0.04, 0.002
DOWN = Gravity()
CLOSE = 1e-12
"""Relative and rad; a dozen operations in doubles, and angles of a few turns."""


def crank_as_pendulum(
    *effects: object, loads: tuple[Load, ...] = (), **motion: object
) -> Scene:
    """A crank-rocker of which the crank alone has mass.

    theta_2 swings as one body about O2.
    """
    linkage = FourBar(0.3, Bar(0.1, M, INERTIA, (R, 0.3)), Bar(0.25), Bar(0.22), 0.2)
    return Scene(
        linkage,
        Motion(**{"theta_2": 0.7, **motion}),
        loads=loads,
        effects=effects,
    )  # type: ignore[arg-type]


def one(equilibria: Equilibria, stability: str) -> Equilibrium:
    (rest,) = [rest for rest in equilibria.found if rest.stability == stability]
    return rest


def test_a_crank_with_mass_alone_is_a_pendulum() -> None:
    equilibria = equilibrium(crank_as_pendulum(DOWN))
    stable, unstable = one(equilibria, "stable"), one(equilibria, "unstable")
    assert len(equilibria.found) == 2 and not equilibria.indifferent
    assert equilibria.samples == POSITIONS_OF_A_BRANCH
    assert math.remainder(
        stable.place.theta_2 + math.pi / 2 + 0.3, 2 * math.pi
    ) == pytest.approx(0.0, abs=CLOSE)
    assert math.remainder(
        unstable.place.theta_2 - math.pi / 2 + 0.3, 2 * math.pi
    ) == pytest.approx(0.0, abs=CLOSE)
    J = INERTIA + M * R * R
    assert (stable.slope, stable.inertia) == pytest.approx(
        (-M * 9.81 * R, J),
        rel=CLOSE,
    )
    assert stable.frequency == pytest.approx(
        math.sqrt(M * 9.81 * R / J) / (2 * math.pi),
        rel=CLOSE,
    )
    assert unstable.frequency is None and unstable.slope == pytest.approx(
        M * 9.81 * R,
        rel=CLOSE,
    )


def test_the_frequency_at_a_limit_is_that_of_the_output_as_a_pendulum() -> None:
    linkage = FourBar(0.3, Bar(0.4), Bar(0.2), Bar(0.25, M, INERTIA, (R, 0.0)), 0.5)
    limit = fourbar.limit_positions(linkage)[0]
    beside = Motion(np.array([limit.theta_2 + off for off in (0.01, -0.01)]))
    scene = Scene(linkage, beside, effects=(Gravity(9.81, limit.theta_4),))
    (hanging,) = [rest for rest in equilibrium(scene).found if rest.place.branch == 0]
    assert hanging.angle == "theta_4"
    pendulum = math.sqrt(M * 9.81 * R / (INERTIA + M * R * R)) / (2 * math.pi)
    assert hanging.frequency == pytest.approx(pendulum, rel=1e-9)


def pendulum_under_moment(excess: float, **motion: object) -> Scene:
    """Q = 0.5 (1 + excess) - 0.5 sin(theta_2 - 0.1)."""
    moment = Load(2, moment=0.5 * (1.0 + excess))
    scene = crank_as_pendulum(Gravity(8.0, 0.0), loads=(moment,), **motion)
    crank = Bar(0.1, 1.0, 0.0, (0.0625, -0.1))
    return replace(scene, linkage=replace(scene.linkage, input=crank))


def test_a_zero_that_touches_is_found_between_two_positions() -> None:
    (touching,) = equilibrium(pendulum_under_moment(0.0)).found
    assert touching.stability == "undecided" and touching.frequency is None
    assert touching.place.theta_2 == pytest.approx(math.pi / 2 + 0.1, abs=1e-7)
    assert not equilibrium(pendulum_under_moment(1e-9)).found


def test_two_zeros_between_the_same_two_positions_are_found() -> None:
    excess = (
        -1e-8
    )  # zeros at sqrt(2e-8) on both sides, a sixth of the grid's step apart
    lower, upper = equilibrium(pendulum_under_moment(excess)).found
    away = math.acos(1.0 + excess)
    assert 2.0 * away < 2.0 * math.pi / POSITIONS_OF_A_BRANCH
    assert (lower.stability, upper.stability) == ("stable", "unstable")
    for rest, sign in ((lower, -1.0), (upper, 1.0)):
        expected = math.pi / 2 + 0.1 + sign * away
        assert rest.place.theta_2 == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("first", [True, False])
def test_a_zero_at_the_end_of_a_sweep_is_found(first: bool) -> None:
    at_rest = -math.pi / 2 - 0.3
    ends = (at_rest, at_rest + 1.0) if first else (at_rest - 1.0, at_rest)
    (rest,) = equilibrium(crank_as_pendulum(DOWN, theta_2=Sweep(*ends, 10))).found
    assert rest.stability == "stable"
    assert rest.place.theta_2 == pytest.approx(at_rest, abs=CLOSE)


def test_a_slope_that_is_no_number_is_neither_stable_nor_unstable(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def no_slope(curve: CircuitCurve, points: np.ndarray) -> np.ndarray:
        return np.full(len(points), np.nan)

    monkeypatch.setattr(CircuitCurve, "slope", no_slope)
    found = equilibrium(crank_as_pendulum(DOWN)).found
    assert [rest.stability for rest in found] == ["undecided"] * 2
    assert all(rest.frequency is None for rest in found)


def test_friction_holds_a_pendulum_within_the_angle_that_it_can() -> None:
    f = 0.2
    away = math.asin(f / (M * 9.81 * R))
    equilibria = equilibrium(crank_as_pendulum(DOWN, Friction.at(O2=f)))
    for rest in equilibria.found:
        assert rest.held is not None
        ends = [
            math.remainder(end.theta_2 - rest.place.theta_2, 2 * math.pi)
            for end in rest.held
        ]
        assert ends == pytest.approx([-away, away], abs=1e-12)
    assert len(equilibria.held) == 2
    assert all(lower.theta_2 < upper.theta_2 for lower, upper in equilibria.held)
    stays = equilibria.moves == 0
    Q = -M * 9.81 * R * np.cos(equilibria.positions.theta_2 + 0.3)
    assert (stays == (np.abs(Q) <= f)).all() and (
        equilibria.moves[~stays] == np.sign(Q[~stays])
    ).all()
    stuck = equilibrium(crank_as_pendulum(DOWN, Friction.at(O2=10.0)))
    assert (
        (stuck.moves == 0).all()
        and len(stuck.held) == 1
        and all(rest.held for rest in stuck.found)
    )


@pytest.mark.slow
def test_loaded_friction_holds_up_to_where_no_torque_is_needed_to_move() -> None:
    scene = fourbar.load(MODELS / "crank_rocker.toml")
    scene = replace(
        scene,
        loads=(),
        effects=(DOWN, PinFriction.at(O2=(0.2, 0.01), A=(0.1, 0.01), O4=(0.2, 0.02))),
    )
    equilibria = equilibrium(scene)
    assert len(equilibria.held) == 2
    for ends in equilibria.held:
        theta = np.array([end.theta_2 for end in ends])
        command = fourbar.scene.Command(
            theta, np.array([end.branch for end in ends], dtype=np.int8), 0.0, 0.0
        )
        torques = fourbar.solve(scene, at=command)
        size = np.abs(equilibria.positions.torque).max()
        assert (
            min(abs(torques.torque_low[0]), abs(torques.torque_high[0])) <= 1e-9 * size
        )
        assert (
            min(abs(torques.torque_low[1]), abs(torques.torque_high[1])) <= 1e-9 * size
        )


@pytest.mark.slow
@pytest.mark.parametrize(
    "lengths", [(3.0, 3.0, 4.0, 4.0), (4.0, 4.0, 3.0, 3.0), (1.0, 1.0, 3.0, 3.0)]
)
def test_beside_a_change_point_nothing_is_taken_for_a_rest(
    lengths: tuple[float, ...],
) -> None:
    """A kite in which A comes to O4, turned with its gravity.

    As many equilibria, and as many undecided, none.
    """
    d, a, b, c = lengths
    for turn in (0.0, 0.3, 2.0):
        linkage = FourBar(
            d, Bar(a, 50.0, None, (1.2, 2.4)), Bar(b, 1.0), Bar(c, 6.0), turn
        )
        equilibria = equilibrium(
            Scene(linkage, Motion(1.0 + turn), effects=(Gravity(9.81, turn - 1.9),))
        )
        stabilities = sorted(rest.stability for rest in equilibria.found)
        assert stabilities == ["stable"] * 2 + ["unstable"] * 2


ONE_CHANGE_POINT = [
    (1.0, 1.0, 2.0, 2.0),  # folded at theta_1: both kites, and a = d, b = c
    (2.0, 1.0, 2.5, 1.5),  # folded, of four lengths
    (1.5, 1.0, 1.25, 1.25),  # stretched at theta_1 + 180 deg
    (2.0, 0.5, 1.25, 1.25),
]
"""Ground, input, coupler and output: the input turns fully, past one change point."""
FULL = Sweep(0.0, 4.0 * math.pi, 360)
HALF = Sweep(math.radians(30.0), math.radians(390.0), 180)
BACK = Sweep(math.radians(500.0), math.radians(-100.0), 300)


@pytest.mark.slow
@pytest.mark.parametrize("motion", [None, FULL, HALF, BACK])
@pytest.mark.parametrize("branch", [1, -1])
@pytest.mark.parametrize("lengths", ONE_CHANGE_POINT)
def test_past_one_change_point_the_angle_is_that_of_the_scenes_assembly(
    lengths: tuple[float, ...], branch: int, motion: Sweep | None
) -> None:
    """An assembly repeats after two turns of the input.

    The scene needs no torque at any angle that is found, and changes the sign of its
    torque at no others.
    """
    d, a, b, c = lengths
    bars = Bar(a, 10.0), Bar(b, 20.0), Bar(c, 20.0)
    load = Load(4, force=(0.0, 200.0), from_pin=(c, 0.0))
    scene = Scene(
        FourBar(d, *bars, 0.5 * math.pi),
        Motion(theta_2=motion, omega_2=0.0, alpha_2=0.0, branch=branch),
        loads=(load,),
        effects=(Gravity(9.81, 0.1),),
    )
    equilibria = equilibrium(scene)
    angles = np.array([rest.place.theta_2 for rest in equilibria.found])
    assert all(rest.reached for rest in equilibria.found)
    swept = FULL if motion is None else motion
    grid = np.linspace(swept.start, swept.stop, 3000)

    def solve_at(angles: np.ndarray) -> np.ndarray:
        at = Motion(theta_2=angles, omega_2=0.0, alpha_2=0.0, branch=branch)
        torque = fourbar.solve(replace(scene, motion=at)).torque
        assert torque is not None
        return torque

    torque, torques = solve_at(angles), solve_at(grid)
    largest = np.nanmax(np.abs(torques))
    assert np.abs(torque).max() < 1e-9 * largest
    assert (np.diff(angles) > 0.0).all()
    signs = np.sign(torques[np.abs(torques) > 1e-9 * largest])
    assert len(angles) == np.sum(signs[1:] != signs[:-1]) > 0


def test_friction_holds_on_past_the_one_change_point() -> None:
    """Bars in line hold on both sides of it, in one range of the assembly."""
    linkage = FourBar(1.0, Bar(1.0, 10.0), Bar(2.0, 20.0), Bar(2.0, 20.0))
    scene = Scene(linkage, Motion(), effects=(DOWN, Friction.at(O2=40.0, O4=40.0)))
    held = equilibrium(scene).held
    assert any(first.theta_2 < TURN < last.theta_2 for first, last in held)
    for first, last in held:
        angles = np.linspace(first.theta_2, last.theta_2, 101)[1:-1]
        at = Motion(theta_2=angles, omega_2=0.0, alpha_2=0.0)
        at_rest = fourbar.solve(replace(scene, motion=at))
        low, high = at_rest.torque_low, at_rest.torque_high
        assert low is not None and high is not None
        solved = np.isfinite(low)
        assert solved.sum() >= len(angles) - 1
        assert (low[solved] <= 0.0).all() and (high[solved] >= 0.0).all()


def test_a_balanced_linkage_is_indifferent_over_its_sweep_as_it_is_stated() -> None:
    """A parallelogram lamp and a spring of no free length: k = m g l/(r h)."""
    arms = Bar(0.3), Bar(0.06, 2.0), Bar(0.3)
    linkage = FourBar(0.06, *arms, 0.5 * math.pi)
    post = Place(1, (0.1, 0.0))
    stiffness = 2.0 * 9.81 * 0.3 / (0.08 * 0.1)
    spring = Springs((Spring(post, Place(2, (0.08, 0.0)), stiffness),))
    swept = Sweep(math.radians(-40.0), math.radians(60.0), 10)
    scene = Scene(linkage, Motion(swept), effects=(DOWN, spring))
    rest = equilibrium(scene)
    # what rounding leaves of the torque is no torque
    assert not re.search(r"\de-|largest", write_equilibria("lamp", rest))
    ((first, last),) = rest.indifferent
    ends = math.degrees(first.theta_2), math.degrees(last.theta_2)
    assert ends == pytest.approx((-40.0, 60.0), abs=1e-9)


def test_what_has_no_answer_says_so() -> None:
    assert (
        equilibrium(crank_as_pendulum()).indifferent
        and not equilibrium(crank_as_pendulum()).found
    )
    balanced = crank_as_pendulum(DOWN)
    balanced = replace(
        balanced,
        linkage=replace(balanced.linkage, input=Bar(0.1, M, INERTIA, (0.0, 0.0))),
    )
    (ends,) = equilibrium(balanced).indifferent
    assert ends[1].theta_2 - ends[0].theta_2 == pytest.approx(2 * math.pi)
    spring = Springs((Spring(Place(1, (0.3, 1.0)), Place(2, (0.1, 0.0)), 100.0),))
    massless = replace(
        crank_as_pendulum(spring),
        linkage=FourBar(0.3, Bar(0.1), Bar(0.25), Bar(0.22)),
    )
    rest = one(equilibrium(massless), "stable")
    assert (rest.inertia, rest.frequency) == (
        0.0,
        None,
    ) and rest.place.theta_2 == pytest.approx(1.0, abs=1e-12)


def test_a_load_on_a_bar_that_rests_is_indifferent_in_one_way_of_moving_alone() -> None:
    """A rhombus: in its crossed assembly bar 4 rests."""
    scene = fourbar.load(MODELS / "textbook" / "gtdynamics_square.toml")
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


@pytest.mark.parametrize(("start", "count"), [("60 deg", 0), ("160 deg", 1)])
def test_a_torsion_spring_is_followed_from_the_start_of_the_sweep(
    start: str, count: int
) -> None:
    """Two circles close the loop at 5000 angles, along which the pins are followed.

    From the first that closes the spring at B is wound by 254.5 deg where the work of
    both would vanish; a sweep that begins beside it has it within half a turn.
    """
    scene = loads(ROBOT.replace("START", start))
    theta = np.radians(np.linspace(float(start.split(maxsplit=1)[0]), 170.0, 5000))
    to_O4 = -6.0 - 4.0 * np.exp(1j * theta)
    d = np.abs(to_O4)
    closes = d < 8.0
    along = (5.0**2 - 3.0**2 + d**2) / (2.0 * d)
    across = np.sqrt(5.0**2 - np.where(closes, along, 0.0) ** 2)
    coupler = ((along + 1j * across) * to_O4 / d)[closes]
    output = coupler - to_O4[closes]
    theta = theta[closes]
    theta_3 = np.unwrap(np.angle(coupler))
    at_A = theta_3 - theta
    at_B = np.unwrap(np.angle(output)) - theta_3
    from_rest = []
    for turned, rest in ((at_A, math.pi / 2), (at_B, -math.pi / 2)):
        turns = np.rint((turned[0] - rest) / math.tau)
        from_rest.append(turned - rest - turns * math.tau)
    near = np.argmin(np.abs(theta - math.radians(167.7867)))
    wound = float(np.degrees(np.abs(from_rest[1][near])))
    assert wound == pytest.approx(254.5 if count == 0 else 105.5, abs=0.05)
    rows = write_equilibria("robot", equilibrium(scene)).splitlines()
    half_a_turn = theta[np.argmax(np.abs(from_rest[1]) >= math.pi)]
    has_word = {
        float(row.split()[0]): row.endswith("wound")
        for row in rows
        if row.endswith(("wound", "falls", "grows", "stays"))
    }
    assert all(
        word == (count == 0 and degrees >= math.degrees(half_a_turn))
        for degrees, word in has_word.items()
    )
    found = [one for one in fourbar.equilibrium(scene).found if one.reached]
    assert len(found) == count
    if count:
        assert math.degrees(found[0].place.theta_2) == pytest.approx(167.7867, abs=1e-4)
    within = np.all(np.abs(from_rest) < math.pi, axis=0)
    energy = sum(5.0 * angle**2 for angle in from_rest)
    assert np.any(np.diff(np.sign(np.diff(energy[within])))) == bool(count)


def test_the_half_turn_of_a_torsion_spring_is_no_equilibrium() -> None:
    scene = crank_as_pendulum(Torsion.at(O2=(2.0, 0.5, 0.0)))
    equilibria = equilibrium(scene)
    (rest,) = equilibria.found
    assert rest.stability == "stable"
    assert rest.place.theta_2 == pytest.approx(0.5 + 0.2, abs=1e-9)
    assert rest.frequency == pytest.approx(
        math.sqrt(2.0 / (INERTIA + M * R * R)) / (2 * math.pi),
        rel=1e-9,
    )


def test_a_sweep_bounds_the_search() -> None:
    sweep = crank_as_pendulum(DOWN, theta_2=Sweep(-3.0, 1.2, 30))
    equilibria = equilibrium(sweep)
    assert [rest.stability for rest in equilibria.found] == ["stable"] and len(
        equilibria.positions
    ) == 31
    assert equilibria.found[0].place.theta_2 == pytest.approx(
        -math.pi / 2 - 0.3,
        abs=CLOSE,
    )


def springy_table(**motion: object) -> Scene:
    """A folding table on two legs, pressed up by torsion springs: a double rocker."""
    bars = Bar(0.35, 0.6), Bar(0.45, 8.0), Bar(0.35, 0.6)
    leg = 12.0, math.radians(120.0), 0.0
    springs = Torsion.at(O2=leg, O4=leg)
    return Scene(FourBar(0.5, *bars), Motion(**motion), effects=(DOWN, springs))  # type: ignore[arg-type]


SWEPT = Sweep(math.radians(20.0), math.radians(140.0), 60)


@pytest.mark.parametrize("branch", [1, -1])
def test_what_a_sweep_does_not_reach_is_told_apart(branch: int) -> None:
    """The other assembly has the same angles and an equilibrium among them."""
    (rest,) = equilibrium(springy_table(theta_2=SWEPT, branch=branch)).found
    assert rest.place.branch == -1
    assert rest.reached == (branch == -1)
    everywhere = equilibrium(springy_table(branch=branch)).found
    assert all(rest.reached for rest in everywhere)


def points_of(scene: Scene, low: float, high: float) -> np.ndarray:
    """Return psi and mu where bar 4 turns between two angles, deg."""
    sweep = Sweep(math.radians(low), math.radians(high), 977)
    solution = fourbar.solve(replace(scene, motion=Motion(theta_4=sweep)), "position")
    assert solution.assembled.all()
    return np.stack([solution.theta_2, solution.theta_4 - solution.theta_3], axis=1)


def test_a_sweep_of_another_bar_reaches_both_sides_of_a_limit_and_no_more() -> None:
    """Bar 2 turns back at its limit, theta_4 = 196.4 deg, within the sweep."""
    sweep = Sweep(math.radians(150.0), math.radians(230.0), 60)
    scene = springy_table(theta_4=sweep)
    curve = CircuitCurve(scene)
    within = points_of(scene, 150.0, 230.0)
    assert set(np.sign(np.sin(within[:, 1]))) == {1.0, -1.0}
    assert curve.reached(within).all()
    assert not curve.reached(points_of(scene, 60.0, 149.9)).any()
    assert not curve.reached(points_of(scene, 230.1, 300.0)).any()


def test_the_other_assembly_stands_apart_in_the_print(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    fourbar.save(springy_table(theta_2=SWEPT), tmp_path / "table.toml")
    assert status(["equilibrium", str(tmp_path / "table.toml")]) == 0
    first, second, _ = capsys.readouterr().out.split("\n\n")
    assert first.startswith("0 equilibria in this sweep without friction,")
    assert second.startswith("1 equilibrium in the other assembly at angles theta_2")
    assert "138.3165" in second and "crossed" in second
    assert max(map(len, [*first.splitlines(), *second.splitlines()])) <= BLOCK_WIDTH


def test_equilibria_are_printed_in_the_units_of_the_file(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    scene = crank_as_pendulum(DOWN)
    fourbar.save(scene, tmp_path / "metres.toml")
    text = (tmp_path / "metres.toml").read_text()
    ground = f'ground = "{0.3 / 0.0254!r} in"'
    assert 'ground = "0.3 m"' in text
    text = text.replace('ground = "0.3 m"', ground)
    (tmp_path / "inches.toml").write_text(text)
    assert status(["equilibrium", str(tmp_path / "inches.toml")]) == 0
    printed = capsys.readouterr().out
    assert "(lbf in/rad)" in printed and "(lb in^2)" in printed
    pound, inch = 0.45359237, 0.0254
    J = (INERTIA + M * R * R) / (pound * inch**2)
    slope = M * 9.81 * R / (pound * 9.80665 * inch)
    assert f"{J:.6g}" in printed and f"{slope:.6g}" in printed
    assert "torque (lbf in)" in printed
    assert max(map(len, printed.splitlines())) <= BLOCK_WIDTH


def test_released_ones_begin_to_move_as_stated() -> None:
    scene = fourbar.load(MODELS / "crank_rocker.toml")
    equilibria = equilibrium(
        replace(scene, effects=(*scene.effects, Friction.at(O2=0.2)))
    )
    chosen = range(7, len(equilibria.positions), 80)
    for i in chosen:
        motion = Motion(float(equilibria.positions.theta_2[i]), 0.0, free=Free(1e-2, 1))
        released = fourbar.solve(
            replace(
                scene,
                motion=motion,
                effects=(*scene.effects, Friction.at(O2=0.2)),
            ),
            "position",
        )
        assert np.sign(released.theta_2[1] - released.theta_2[0]) == equilibria.moves[i]
    assert {*equilibria.moves[list(chosen)].tolist()} >= {0} and len(
        set(equilibria.moves.tolist())
    ) == 3


@pytest.mark.slow
def test_at_a_change_point_a_released_parallelogram_has_two_ways_to_move() -> None:
    """Elsewhere it falls: the height of its mass centres grows with sin(theta_2)."""
    arm = Bar(0.5, 21.0)
    scene = Scene(FourBar(0.6, arm, Bar(0.6, 25.0), arm), Motion(0.0), effects=(DOWN,))
    equilibria = equilibrium(scene)
    angle = equilibria.positions.theta_2
    at_change_point = np.abs(np.sin(angle)) < CLOSE
    falls = -np.sign(np.cos(angle)) * (np.abs(np.cos(angle)) > CLOSE)
    np.testing.assert_array_equal(equilibria.moves, np.where(at_change_point, 0, falls))
    rows = write_equilibria("", equilibria).splitlines()
    words = {row.split()[0]: row.split()[-1] for row in rows if row.split()}
    assert [words[angle] for angle in ("0", "180", "360")] == ["change_point"] * 3


def test_the_command_prints_what_python_finds(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    file = MODELS / "problems" / "gz_physics_987.toml"
    assert status(["equilibrium", str(file)]) == 0
    text = capsys.readouterr().out
    assert (
        "0.759439193" in text
        and "found between 3600 positions" in text
        and "stable" in text
    )
    assert (
        status(["equilibrium", str(file), "--json", "-o", str(tmp_path / "rest.json")])
        == 0
    )
    kept = json.loads((tmp_path / "rest.json").read_text())
    equilibria = equilibrium(fourbar.load(file))
    assert [rest["place"]["theta_2"] for rest in kept["equilibria"]] == [
        rest.place.theta_2 for rest in equilibria.found
    ]
    assert kept["samples"] == equilibria.samples
    assert kept["positions"]["theta_2"] == equilibria.positions.theta_2.tolist()
    friction = (
        MODELS.parent
        / "tests"
        / "counterexamples"
        / "dry_friction_on_a_crank_at_rest.toml"
    )
    assert status(["equilibrium", str(friction)]) == 0
    printed = capsys.readouterr().out
    assert "friction alone holds" in printed and "largest without friction: " in printed
    kite = (
        MODELS.parent / "tests" / "counterexamples" / "kite_with_A_on_O4.toml"
    )  # which has no theta_4 there
    assert status(["equilibrium", str(kite), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["not_decided"][0]["theta_4"] is None
    bad = tmp_path / "bad.toml"
    bad.write_text(
        '[lengths]\nground = "1 m"\ninput = "1.5 m"\n'
        'coupler = "1 m"\noutput = "0.2 m"\n'
        '[motion]\ntheta_2 = "180 deg"\n'
    )
    assert status(["equilibrium", str(bad)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "assembles at none" in error


@pytest.mark.parametrize("unit", [1e-9, 1e120])
def test_no_unit_of_length_changes_an_equilibrium(unit: float) -> None:
    bars = [Bar(x * unit, M, 1e-3 * unit * unit) for x in (0.1, 0.25, 0.22)]
    equilibria = equilibrium(
        Scene(FourBar(0.3 * unit, *bars, 0.2), Motion(0.7), effects=(DOWN,))
    )  # type: ignore[misc]
    bars = [Bar(x, M, 1e-3) for x in (0.1, 0.25, 0.22)]
    same = equilibrium(Scene(FourBar(0.3, *bars, 0.2), Motion(0.7), effects=(DOWN,)))  # type: ignore[misc]
    assert len(equilibria.found) == len(same.found) == 2
    for rest, in_metres in zip(equilibria.found, same.found, strict=True):
        assert rest.place == pytest.approx(in_metres.place, abs=CLOSE)
        assert rest.slope / unit == pytest.approx(in_metres.slope, rel=1e-9)


def test_a_zero_that_falls_on_a_sample_is_found() -> None:
    sample = 0.5 * 2 * math.pi / POSITIONS_OF_A_BRANCH + 700 * (
        2 * math.pi / POSITIONS_OF_A_BRANCH
    )
    linkage = replace(crank_as_pendulum().linkage, ground_angle=0.0)
    scene = replace(
        crank_as_pendulum(Torsion.at(O2=(2.0, sample, 0.0))),
        linkage=linkage,
    )
    (rest,) = equilibrium(scene).found
    assert rest.place.theta_2 == pytest.approx(sample, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["theta_3", "theta_4", "stroke"])
def test_another_command_has_the_equilibria_of_the_positions_that_it_passes(
    name: str,
) -> None:
    """Those of the input swept over the same.

    A single position has those of its circuit.
    """
    swept = {"theta_3": (1.0, 1.25), "theta_4": (1.95, 2.4), "stroke": (0.17, 0.3)}[
        name
    ]
    side: dict[str, Any] = {"side": "left"} if name == "stroke" else {"branch": -1}
    motion = Motion(**{name: Sweep(*swept, 90)}, **side)
    commanded = crank_rocker(
        motion=motion,
        effects=(fourbar.Gravity(),),
        drive=CYLINDER,
    )
    theta_2 = fourbar.solve(commanded).theta_2
    same = replace(
        commanded,
        motion=Motion(Sweep(float(theta_2.min()), float(theta_2.max()), 90)),
    )
    equilibria, by_input = equilibrium(commanded), equilibrium(same)
    assert len(by_input.found) == len(equilibria.found) > 0
    for rest, same_rest in zip(equilibria.found, by_input.found, strict=True):
        assert rest.place == pytest.approx(
            same_rest.place
        ) and rest.frequency == pytest.approx(same_rest.frequency)
    single = replace(commanded, motion=Motion(**{name: swept[0]}, **side))
    single_input = replace(commanded, motion=Motion(float(theta_2[0])))
    assert len(equilibrium(single).found) == len(equilibrium(single_input).found) > 0


def test_what_stands_at_a_limit_has_no_inertia_and_no_frequency() -> None:
    """Bar 4 alone has mass and stands still to first order at its limits."""
    output = fourbar.Bar(0.25, 1.0, 0.002, (0.1, 0.0))
    bars = fourbar.Bar(0.4), fourbar.Bar(0.2), output
    scene = Scene(fourbar.FourBar(0.3, *bars, 0.5), effects=(fourbar.Gravity(),))
    found = equilibrium(scene).found
    at_limits = [each for each in found if each.inertia < 1e-6]
    assert len(at_limits) == 2
    assert all(each.inertia == 0.0 for each in at_limits)
    assert all(each.frequency is None for each in at_limits)
    others = [each for each in found if each.stability == "stable" and each.inertia]
    # a pendulum of bar 4 about O4, whatever moves with it
    pendulum = math.sqrt(9.81 * 0.1 / (0.002 + 0.01)) / (2.0 * math.pi)
    assert [each.frequency for each in others] == pytest.approx([pendulum] * 2)
