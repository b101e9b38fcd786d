"""The torque by virtual work against free bodies, energy and published figures."""

import mpmath as mp
import numpy as np
import pytest

import fourbar
from fourbar.effects.effect import Actions, list_bodies
from fourbar.evaluation.case import compute_shown_state
from fourbar.formulas.mobility import limit_positions
from fourbar.formulas.motion import State
from fourbar.formulas.path import compute_state as state_of
from fourbar.formulas.position import loop
from fourbar.formulas.torque import half_slope, inertia
from fourbar.scene import Command
from fourbar.solving import solve
from fourbar_validation.cost.formulas import solve_thirteen_equations
from tests.support.balls import answer_in_balls

EPS = 2.0**-52
K = 200.0
"""eps/condition of the sum of absolute terms; two derivations of some hundred roundings
each, over 7000 samples.
"""
U = 2.0**-53
"""Unit round-off of a double."""
ROUNDED_SUM = 4.0 * U
"""Of the sum of four lengths: what is missing of it where each is rounded by four U."""


def random_case(rng: np.random.Generator) -> tuple[fourbar.FourBar, tuple, Command]:  # type: ignore[type-arg]
    while True:
        lengths = rng.uniform(0.1, 1.0, 4)
        if 2.0 * lengths.max() < 0.999 * lengths.sum():
            break
    bars = [
        fourbar.Bar(
            x,
            rng.uniform(0, 2),
            rng.uniform(0, 0.1),
            (rng.uniform(-0.5, 0.5), rng.uniform(-3, 3)),
        )
        for x in lengths[1:]
    ]
    linkage = fourbar.FourBar(lengths[0], *bars, ground_angle=rng.uniform(-3, 3))
    pins = {"O2": 0.1, "A": 0.2, "B": 0.3, "O4": 0.1}
    terms = (
        fourbar.Load(2, (3.0, 0.7), arm=(0.05, 1.0)),
        fourbar.Load(3, (2.0, 0.3), from_centre=(0.1, 2.0), moment=0.4, frame="bar"),
        fourbar.Load(4, (1.0, 0.9), arm=(0.2, -1.0), moment=-0.3),
        fourbar.Gravity(),
        fourbar.Viscous.at(**pins),
        fourbar.Friction.at(**pins),
    )
    omega, alpha = rng.uniform(-3, 3, 40), rng.uniform(-3, 3, 40)
    omega[:5] = 0.0
    alpha[:3] = 0.0
    branch = rng.choice([-1, 1], 40).astype(np.int8)
    return linkage, terms, Command(rng.uniform(-3, 3, 40), branch, omega, alpha)


def some_of(command: Command, mask: np.ndarray) -> Command:
    """The positions of a command at which `mask` is true."""
    omega, alpha = (
        np.broadcast_to(x, command.theta_2.shape)[mask]
        for x in (command.omega_2, command.alpha_2)
    )
    return command._replace(
        angle=command.theta_2[mask],
        branch=command.branch[mask],
        speed=omega,
        acceleration=alpha,
    )


@pytest.mark.parametrize("offset", [1e-2, 1e-8, 1e-14, 1e-30])
def test_they_keep_their_digits_at_a_stated_distance_from_a_limit(
    offset: float,
) -> None:
    """On one side of a limit the linkage assembles, with the torque of balls."""
    for seed in range(2):
        rng = np.random.default_rng(seed)
        linkage, terms, _ = random_case(rng)
        for number in range(1, len(limit_positions(linkage)) + 1):
            drive, branch = int(rng.integers(2, 5)), int(rng.choice([-1, 1]))
            assembled = []
            for side in (offset, -offset):
                motion = fourbar.Motion(
                    fourbar.FromLimit(number, side),
                    1.3,
                    0.7,
                    branch=branch,
                )
                scene = fourbar.Scene(linkage, motion, drive, terms[:3], terms[3:5])
                s, exact = (
                    solve(scene, "force"),
                    answer_in_balls(scene).get("torque", [np.nan])[0],
                )
                assembled.append(bool(s.assembled[0]))
                assert assembled[-1] == np.isfinite(exact)
                if assembled[-1]:
                    assert (
                        abs(exact - s.torque[0])
                        <= K * EPS * abs(s.torque[0]) / s.drive_condition[0]
                    )
            assert any(assembled) and (offset > 1e-3 or not all(assembled))


def test_where_the_loop_closes_is_known_at_the_last_digits_of_a_limit() -> None:
    """Bars that miss each other by less than the rounding of the lengths meet."""
    compared = [0, 0]
    for seed in range(4, 10):
        linkage, _, _ = random_case(np.random.default_rng(seed))
        for limit in limit_positions(linkage):
            angles = limit.theta_2 + np.arange(-4, 5) * np.spacing(limit.theta_2)
            command = Command(angles, np.ones(9, dtype=np.int8), None, 0.0)
            ours = solve(fourbar.Scene(linkage), at=command).assembled
            with mp.workdps(50):
                d, a, b, c = (mp.mpf(length) for length in linkage.lengths)
                for angle, assembled in zip(
                    angles.tolist(),
                    ours.tolist(),
                    strict=True,
                ):
                    e = abs(
                        d - a * mp.expj(mp.mpf(angle) - mp.mpf(linkage.ground_angle))
                    )
                    missed = max(e - (b + c), abs(b - c) - e)
                    assert assembled == (missed <= ROUNDED_SUM * (a + b + c + d))
                    compared[assembled] += 1
    assert min(compared) > 8


def test_statics_of_motiongenesis() -> None:
    """Equilibrium angles under H = 200 N (motiongenesis MGFourBarDynamicsFBD)."""
    bars = (fourbar.Bar(1.0, 10.0), fourbar.Bar(2.0, 20.0), fourbar.Bar(2.0, 20.0))
    linkage = fourbar.FourBar(1.0, *bars, ground_angle=np.pi / 2)
    pull = fourbar.Load(3, (200.0, np.pi / 2), from_pin=(2.0, 0.0))
    effects = (fourbar.Gravity(9.81, 0.0),)
    found = fourbar.equilibrium(
        fourbar.Scene(linkage, loads=(pull,), effects=effects)
    ).found
    angles = [np.degrees(rest.place[:3]) for rest in found]
    printed = [19.98690555, 71.66202052, 38.32488502]
    assert any(np.abs(angle - printed).max() <= 0.5e-8 for angle in angles)


SHAPES = {
    "crank-rocker": (0.3, 0.1, 0.25, 0.22, 0.4),
    "a = d": (0.3, 0.3, 0.25, 0.22, -2.0),
    "b = c": (0.3, 0.1, 0.25, 0.25, 1.0),
    "input longer than ground": (0.1, 0.3, 0.25, 0.32, 0.0),
    "parallelogram": (0.3, 0.1, 0.3, 0.1, 0.4),
    "kite b = c, a = d": (0.3, 0.3, 0.2, 0.2, 0.4),
    "change point in line": (0.3, 0.1, 0.2, 0.2, 0.4),
    "touching folded": (0.2, 0.1, 0.4, 0.3, 0.4),
}


def of(lengths: tuple[float, ...]) -> fourbar.FourBar:
    """A linkage with masses off their bars."""
    d, *moving, theta_1 = lengths
    bars = (
        fourbar.Bar(x, 2.0 + x, 0.01, (0.4 * x, phase))
        for x, phase in zip(moving, (0.5, -0.7, 2.0), strict=True)
    )
    return fourbar.FourBar(d, *bars, ground_angle=theta_1)


def J_of(linkage: fourbar.FourBar, state: State) -> np.ndarray:
    """The equivalent inertia of all bars, kg m^2."""
    return np.asarray(
        sum(
            inertia(linkage.input.length, list_bodies(linkage), state.position, state.k)
        )
    )


def slope_of(linkage: fourbar.FourBar, state: State) -> np.ndarray:
    """Its derivative by the independent angle."""
    return np.asarray(
        2.0
        * half_slope(
            linkage.input.length, list_bodies(linkage), state.position, state.k
        )
    )


@pytest.mark.parametrize("lengths", SHAPES.values(), ids=SHAPES.keys())
def test_equivalent_inertia_is_that_of_the_kinetic_energy(
    lengths: tuple[float, ...],
) -> None:
    """J against the speeds of the mass centres, J' against its difference."""
    linkage = of(lengths)
    theta_2 = linkage.ground_angle + np.array([0.7, 2.5, 4.6])
    state = state_of(linkage, theta_2, 1, 3.0)
    energy = np.zeros(3)
    for number in (2, 3, 4):
        bar = linkage.bar(number)
        v = np.abs(state.velocity(number, bar.to_centre))
        energy += (
            0.5 * bar.mass * v**2
            + 0.5 * bar.moment_of_inertia * np.asarray(state.omega(number)) ** 2
        )
    ok = np.isfinite(state.position.u3)
    assert ok.any()
    J, slope = J_of(linkage, state), slope_of(linkage, state)
    assert 0.5 * J[ok] * 3.0**2 == pytest.approx(energy[ok], rel=1e-13)
    step = 1e-5
    ahead, back = (
        J_of(linkage, state_of(linkage, theta_2 + s, 1)) for s in (step, -step)
    )
    assert slope[ok] == pytest.approx(
        ((ahead - back) / (2 * step))[ok],
        abs=1e-6 * float(np.max(J[ok])),
    )


@pytest.mark.parametrize("drive", [2, 3, 4])
def test_springs_tables_and_rest_have_the_torque_of_the_thirteen_equations(
    drive: int,
) -> None:
    """What depends on O4, on theta_2 and on rest next to motion, in one sweep."""
    linkage = of(SHAPES["crank-rocker"])
    ends = (
        fourbar.effects.Place(1, (0.2, 0.3)),
        fourbar.effects.Place(4, (0.15, 0.2)),
    )
    table = fourbar.effects.Table((0.0, 2.0, 6.0), (1.0, 3.0, -1.0))
    loads = (fourbar.Load(3, (2.0, 0.3), arm=(0.1, 2.0), moment=0.4, table=table),)
    effects = (
        fourbar.effects.Springs((fourbar.effects.Spring(*ends, 300.0, 0.05),)),
        fourbar.Friction.at(O2=0.1, B=0.3),
    )
    omega = np.array([0.0, 3.0, -3.0, 0.0, 1.0])
    command = Command(
        np.linspace(0.2, 5.5, 5), np.ones(5, np.int8), omega, np.full(5, 4.0)
    )
    for terms in ((loads, effects), (loads, effects[:1]), ((), ())):
        scene = fourbar.Scene(linkage, fourbar.Motion(0.0, 1.0), drive, *terms)
        s = solve(scene, "force", at=command)
        assert solve_thirteen_equations(scene, command)["torque"] == pytest.approx(
            s.torque,
            rel=1e-11,
        )
        for i in range(5):  # one by one
            alone = solve(scene, "force", at=some_of(command, np.arange(5) == i)).torque
            assert alone[0] == pytest.approx(s.torque[i], rel=1e-13)
    state = compute_shown_state(scene, command)
    assert Actions(state, list_bodies(linkage)).generalized_forces() == (0.0, 0.0)


def test_positions_that_do_not_close_and_limits_are_quiet() -> None:
    linkage = of((0.3, 0.25, 0.1, 0.22, 0.4))
    limit = limit_positions(linkage)[0].theta_2
    state = state_of(linkage, np.array([limit, 0.4 + np.pi, 0.4]), 1, 3.0, 4.0)
    assert (
        np.isnan(state.position.u3[1:]).all() and not np.isfinite(state.k.h3[1:]).any()
    )
    for number in (1, 2):
        motion = fourbar.Motion(fourbar.FromLimit(number), 3.0, 4.0)
        effects = (fourbar.Gravity(), fourbar.Viscous.at(B=0.1))
        s = solve(fourbar.Scene(linkage, motion, effects=effects))
        assert (
            s.status == ["singular"]
            and s.sin_mu[0] == 0.0
            and np.isfinite(s.theta_3).all()
        )
        assert np.isnan(s.omega_3).all() and np.isnan(s.torque).all()


def test_what_touches_is_up_to_the_rounding_of_the_lengths() -> None:
    """Lengths that add up to 1.875, of which d - a = b - c, touch within 7.5 U."""
    for misses, touches in ((3.0 * EPS, True), (5.0 * EPS, False)):
        assert (loop(0.6875, 0.3125, 0.625 + misses, 0.25).E2 == 0.0) == touches
    wide = loop(0.3, 0.1, 0.25, 0.22)
    products = 0.47**2 - 0.4**2, 0.2**2 - 0.03**2
    assert wide[4:] == pytest.approx(products)


def test_a_bar_as_short_as_the_rounding_of_the_others_keeps_its_length() -> None:
    """d - a = 1e-15 is no rounding of a ground of 3e-15, but one of a coupler of 1."""
    assert loop(3e-15, 2e-15, 1.0, 1.0).E2 > 0.0
    # within the rounding of their own, and no further, lengths become equal
    assert loop(0.3, 0.3 * (1.0 + EPS), 0.2, 0.2).a == 0.3
    assert loop(3e-6, 3.0000001e-6, 1.0, 1.0).a == 3.0000001e-6


def test_directions_are_unit_vectors_and_the_last_rate_is_of_bar_4_against_bar_3() -> (
    None
):
    lengths = (
        0.3,
        0.3 + 1e-9,
        0.25,
        0.25 - 1e-9,
    )  # A passes O4 at a billionth of the bars
    q = np.concatenate([np.linspace(0.3, 1.5, 20), np.linspace(-1e-8, 1e-8, 40)])
    for sign in (1, -1):
        state = state_of(of((*lengths, 0.0)), q, sign)
        k, closed = state.k, np.isfinite(state.k.h3)
        assert closed.sum() > 30 and closed[:20].all()
        for u in (state.position.u2, state.position.u3, state.position.u4):
            assert np.all(np.abs(np.abs(u[closed]) - 1.0) <= 2 * EPS)
        assert np.all(
            np.abs(k.h43 - (k.h4 - k.h3))[:20]
            <= 64 * EPS * (np.abs(k.h3) + np.abs(k.h4))[:20]
        )


def test_a_single_pendulum() -> None:
    """Of a crank alone: T = (I + m r^2) alpha + m g r cos(theta_2 + phi).

    Of bars without mass none.
    """
    m, r, phi = 0.7, 0.04, 0.5
    linkage = fourbar.FourBar(
        0.3, fourbar.Bar(0.1, m, 1e-3, (r, phi)), fourbar.Bar(0.25), fourbar.Bar(0.22)
    )
    for alpha in (0.0, 5.0):
        motion = fourbar.Motion(np.linspace(0.0, 6.0, 13), 3.0, alpha)
        s = solve(fourbar.Scene(linkage, motion, effects=(fourbar.Gravity(),)), "force")
        expected = (1e-3 + m * r * r) * alpha + m * 9.81 * r * np.cos(s.theta_2 + phi)
        assert s.torque == pytest.approx(expected, rel=0.0, abs=16 * EPS * m * 9.81 * r)
