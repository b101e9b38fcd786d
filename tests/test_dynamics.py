"""The energy method against Newton-Euler, and against outside answers."""

import mpmath as mp
import numpy as np
import pytest
from scipy.optimize import brentq

import fourbar
from fourbar.dynamics import (
    Path,
    acceleration,
    along_input,
    driving_torque,
    generalised_force,
    half_angle,
    inertia,
    kinetic_energy,
    path,
    trace,
    triangle,
)
from fourbar.mobility import limit_positions, on_smooth_path
from fourbar.scene import Command, command, solve
from validation.stability.energy import by_energy

EPS = 2.0**-52
K = 200.0
"""eps/condition of the sum of absolute terms; two derivations of some hundred roundings each, over 7000 samples."""


def random_case(rng: np.random.Generator) -> tuple[fourbar.FourBar, tuple, Command]:  # type: ignore[type-arg]
    while True:
        lengths = rng.uniform(0.1, 1.0, 4)
        if 2.0 * lengths.max() < 0.999 * lengths.sum():
            break
    bars = [
        fourbar.Bar(x, rng.uniform(0, 2), rng.uniform(0, 0.1), (rng.uniform(-0.5, 0.5), rng.uniform(-3, 3)))
        for x in lengths[1:]
    ]
    linkage = fourbar.FourBar(lengths[0], *bars, ground_angle=rng.uniform(-3, 3))
    pins = {"O2": 0.1, "A": 0.2, "B": 0.3, "O4": 0.1}
    terms = (
        fourbar.Load(2, (3.0, 0.7), (0.05, 1.0)),
        fourbar.Load(3, (2.0, 0.3), (0.1, 2.0), 0.4, "bar"),
        fourbar.Load(4, (1.0, 0.9), (0.2, -1.0), -0.3),
        fourbar.Gravity(),
        fourbar.Viscous.at(**pins),
        fourbar.Friction.at(**pins),
    )
    omega, alpha = rng.uniform(-3, 3, 40), rng.uniform(-3, 3, 40)
    omega[:5] = 0.0
    alpha[:3] = 0.0
    branch = rng.choice([-1, 1], 40).astype(np.int8)
    return linkage, terms, Command(rng.uniform(-3, 3, 40), branch, omega, alpha)


@pytest.mark.parametrize("drive", [2, 3, 4])
def test_torque_agrees_with_newton_euler(drive: int) -> None:
    rng = np.random.default_rng(drive)
    compared = 0
    for _ in range(80):
        linkage, terms, at = random_case(rng)
        loads, effects = terms[:3], terms[3:]
        s = solve(fourbar.Scene(linkage, fourbar.Motion(0.0, 1.0), drive, loads, effects), "force", at=at)
        way = path(linkage, at.theta_2, at.branch)
        torque = driving_torque(linkage, way, at.omega_2, at.alpha_2, terms, drive)
        assert s.torque is not None and s.drive_condition is not None
        ok = np.isfinite(s.torque)
        assert np.array_equal(ok, np.isfinite(torque))
        J, J_1 = inertia(linkage, way)
        scale = np.abs(J * at.alpha_2) + np.abs(0.5 * J_1 * at.omega_2**2)
        for term in terms:
            scale = scale + np.abs(generalised_force(linkage, way, at.omega_2, (term,)))
        scale = scale / np.abs(way.first[drive]) + np.abs(s.torque)
        condition = s.condition**2 * s.drive_condition
        assert np.all(np.abs(torque - s.torque)[ok] <= K * EPS * (scale / condition)[ok])
        compared += int(ok.sum())
    assert compared > 1000


@pytest.mark.parametrize("offset", [1e-2, 1e-8, 1e-14, 1e-30])
def test_both_keep_their_digits_at_a_stated_distance_from_a_limit(offset: float) -> None:
    """theta_2 = limit + offset: both assemble and agree on one side of the limit, neither on the other."""
    for seed in range(6):
        rng = np.random.default_rng(seed)
        linkage, terms, _ = random_case(rng)
        for number in range(1, len(limit_positions(linkage)) + 1):
            drive, branch = int(rng.integers(2, 5)), int(rng.choice([-1, 1]))
            assembled = []
            for side in (offset, -offset):
                motion = fourbar.Motion(fourbar.FromLimit(number, side), 1.3, 0.7, branch=branch)
                scene = fourbar.Scene(linkage, motion, drive, terms[:3], terms[3:5])
                at = command(scene)
                s, (closes, energy) = solve(scene, "force", at=at), by_energy(scene, at)
                assert s.torque is not None and s.drive_condition is not None
                assert np.array_equal(s.assembled, closes)
                assembled.append(bool(s.assembled[0]))
                if assembled[-1]:
                    allowed = K * EPS * np.abs(s.torque) / s.drive_condition
                    assert np.all(np.abs(energy["torque"] - s.torque) <= allowed)
            assert any(assembled) and (offset > 1e-3 or not all(assembled))


def test_both_say_alike_where_the_loop_closes_at_the_last_digits_of_a_limit() -> None:
    for seed in range(10):
        linkage, _, _ = random_case(np.random.default_rng(seed))
        for limit in limit_positions(linkage):
            angles = limit.theta_2 + np.arange(-4, 5) * np.spacing(limit.theta_2)
            at = Command(angles, np.ones(9, dtype=np.int8), None, 0.0)
            ours, (closes, _) = solve(fourbar.Scene(linkage), at=at), by_energy(fourbar.Scene(linkage), at)
            assert np.array_equal(ours.assembled, closes)


def test_four_bar_of_gtdynamics() -> None:
    """Torque 1 N m between crank and coupler of a square: 0.125 rad/s^2 (borglab/GTDynamics test_four_bar.py)."""
    bar = fourbar.Bar(2.0, 1.0, 1.0)
    linkage = fourbar.FourBar(2.0, bar, bar, bar)
    way = path(linkage, np.array([np.pi / 2]), np.array([1.0]))
    terms = (fourbar.Load(2, moment=1.0), fourbar.Load(3, moment=-1.0))
    Q = generalised_force(linkage, way, 0.0, terms)
    assert abs(acceleration(linkage, way, 0.0, Q)[0] - 0.125) < 0.0005


def test_free_acceleration_of_sympy() -> None:
    """Links of 997 kg/m, crossed (sympy test_jointsmethod.py, four bar with manual constraints)."""
    linkage = fourbar.uniform(0.13, 0.24, 0.21, 0.34, per_metre=997.0)
    relative = np.array([2.1, 0.6655470375077588, 2.527408138024188])
    rate = 0.2
    for theta_1 in (0.0, np.pi):
        linkage = fourbar.FourBar(0.13, linkage.input, linkage.coupler, linkage.output, theta_1)
        for branch in (1.0, -1.0):
            way = path(linkage, np.array([relative[0]]), np.array([branch]))
            turn = np.angle(way.unit[3] / way.unit[2])
            if abs(turn[0] - relative[1]) < 1e-8:
                alpha = acceleration(linkage, way, rate, 0.0)
                alpha_3 = way.first[3] * alpha + way.second[3] * rate**2
                assert abs(way.first[3][0] * rate - rate - -0.17963733938852067) < 1e-9
                assert abs(alpha[0] - 0.00487581) < 0.5e-8
                assert abs(alpha_3[0] - alpha[0] - -0.01990181) < 0.5e-8
                return
    pytest.fail("the configuration of the source was not found")


def test_statics_of_motiongenesis() -> None:
    """Equilibrium angles under H = 200 N (motiongenesis MGFourBarDynamicsFBD)."""
    bars = (fourbar.Bar(1.0, 10.0), fourbar.Bar(2.0, 20.0), fourbar.Bar(2.0, 20.0))
    linkage = fourbar.FourBar(1.0, *bars, ground_angle=np.pi / 2)

    def held(angle: float, branch: float) -> tuple[float, float, float]:
        way = path(linkage, np.array([angle]), np.array([branch]))
        theta_3, theta_4 = (float(np.angle(way.unit[bar][0])) for bar in (3, 4))
        terms = (fourbar.Gravity(9.81, 0.0), fourbar.Load(3, (200.0, np.pi / 2), (1.0, theta_3)))
        return float(generalised_force(linkage, way, 0.0, terms)[0]), theta_3, theta_4

    near = np.radians(19.98690555)
    branch = min((1.0, -1.0), key=lambda sign: abs(held(near, sign)[0]))
    angle = brentq(lambda q: held(q, branch)[0], near - 1e-3, near + 1e-3, xtol=1e-15)
    _, theta_3, theta_4 = held(angle, branch)
    for ours, theirs in ((angle, 19.98690555), (theta_3, 71.66202052), (theta_4, 38.32488502)):
        assert abs(np.degrees(ours) - theirs) <= 0.5e-8


CIRCLES = mp.mpf(10) ** -45
"""What 50 digits leave of the loop."""
PATH = 64.0 * EPS
"""Roundings of a coefficient, divided by the sine squared and by e^2 over the lengths squared, both above 0.05 here."""
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
    """A linkage with masses beside their bars."""
    d, *moving, theta_1 = lengths
    bars = (fourbar.Bar(x, 2.0 + x, 0.01, (0.4 * x, phase)) for x, phase in zip(moving, (0.5, -0.7, 2.0), strict=True))
    return fourbar.FourBar(d, *bars, ground_angle=theta_1)


def angles_in_fifty_digits(
    linkage: fourbar.FourBar, theta_2: mp.mpf, near: tuple[float, float]
) -> tuple[mp.mpf, mp.mpf]:
    """theta_3, theta_4 by Newton on the loop from an assembly near it."""
    d, a, b, c = (mp.mpf(length) for length in linkage.lengths)

    theta_1 = mp.mpf(linkage.ground_angle)

    def gap(theta_3: mp.mpf, theta_4: mp.mpf) -> tuple[mp.mpf, mp.mpf]:
        return (
            a * mp.cos(theta_2) + b * mp.cos(theta_3) - c * mp.cos(theta_4) - d * mp.cos(theta_1),
            a * mp.sin(theta_2) + b * mp.sin(theta_3) - c * mp.sin(theta_4) - d * mp.sin(theta_1),
        )

    theta_3, theta_4 = mp.findroot(gap, near, tol=CIRCLES**2)
    return theta_3, theta_4


@pytest.mark.parametrize("lengths", SHAPES.values(), ids=SHAPES.keys())
@pytest.mark.parametrize("branch", [1, -1])
def test_coefficients_are_the_derivatives_of_the_loop(lengths: tuple[float, ...], branch: int) -> None:
    linkage = of(lengths)
    d, a, b, c = linkage.lengths
    for psi in (0.7, 2.5, 4.6):
        theta_2 = linkage.ground_angle + psi
        e = abs(a * np.exp(1j * psi) - d)
        if not abs(b - c) + 0.01 < e < b + c - 0.01:
            continue
        way = path(linkage, np.array([theta_2]), np.array([float(branch)]))
        near = tuple(float(np.angle(way.unit[bar][0])) for bar in (3, 4))
        assert np.sign(np.sin(near[1] - near[0])) == branch
        with mp.workdps(50):
            at = mp.mpf(theta_2)
            exact = angles_in_fifty_digits(linkage, at, near)
            # central differences, 15 digits at least: the step is 1e-15 and 1e-13 of a number with 45
            one, two = mp.mpf(10) ** -15, mp.mpf(10) ** -13
            ends = [angles_in_fifty_digits(linkage, at + step, near) for step in (one, -one, two, -two)]
            first = [(ends[0][k] - ends[1][k]) / (2 * one) for k in (0, 1)]
            second = [(ends[2][k] - 2 * exact[k] + ends[3][k]) / two**2 for k in (0, 1)]
            size = 1.0 + max(abs(float(x)) for x in (*first, *second))
            worth = PATH * size / float(abs(mp.sin(exact[1] - exact[0]))) ** 2 * (d + a + b + c) ** 2 / e**2
            for bar, k in ((3, 0), (4, 1)):
                assert abs(mp.mpc(mp.cos(exact[k]), mp.sin(exact[k])) - complex(way.unit[bar][0])) <= worth
                assert abs(first[k] - float(way.first[bar][0])) <= worth
                assert abs(second[k] - float(way.second[bar][0])) <= worth
            assert abs((1 - first[0]) - float(way.slip[0])) <= worth
            assert abs(mp.sin(exact[1] - exact[0]) - float(way.sine[0])) <= worth
        assert way.first[2] == 1.0 and way.second[2] == 0.0 and way.unit[2][0] == np.exp(1j * theta_2)


@pytest.mark.parametrize("lengths", SHAPES.values(), ids=SHAPES.keys())
def test_equivalent_inertia_is_that_of_the_kinetic_energy(lengths: tuple[float, ...]) -> None:
    """J against the speeds of the mass centres, J' against its difference, both also in another coordinate."""
    linkage = of(lengths)
    state = fourbar.kinematics.close_loop(linkage, linkage.ground_angle + np.array([0.7, 2.5, 4.6]), 1)
    fourbar.kinematics.add_velocities(state, 3.0)
    way = path(linkage, state.theta_2, np.ones(3))
    energy = np.zeros(3)
    for number in (2, 3, 4):
        bar = linkage.bar(number)
        v = state.velocity(number, *fourbar.state.centre_in_bar(bar))
        energy += 0.5 * bar.mass * (v[0] ** 2 + v[1] ** 2) + 0.5 * bar.inertia * np.asarray(state.omega(number)) ** 2
    ok = state.assembled
    assert ok.any()
    assert kinetic_energy(linkage, way, 3.0)[ok] == pytest.approx(energy[ok], rel=1e-13)
    J, slope = inertia(linkage, way)
    step = 1e-5
    ahead, back = (inertia(linkage, path(linkage, state.theta_2 + s, np.ones(3)))[0] for s in (step, -step))
    assert slope[ok] == pytest.approx(((ahead - back) / (2 * step))[ok], abs=1e-6 * float(np.max(J[ok])))
    # q = theta_4: the chain rule
    rate, bend = way.first[4], way.second[4]
    first = {k: way.first[k] / rate for k in (2, 3, 4)}
    second = {k: (way.second[k] - first[k] * bend) / rate**2 for k in (2, 3, 4)}
    J_4, slope_4 = inertia(linkage, Path(way.unit, first, second, way.slip / rate, way.sine))
    assert J_4[ok] == pytest.approx((J / rate**2)[ok], rel=1e-12)
    expected = (slope - 2.0 * J * bend / rate) / rate**3
    assert slope_4[ok] == pytest.approx(expected[ok], rel=1e-10, abs=1e-10 * float(np.max(np.abs(expected[ok]))))


def test_bars_whose_inertia_about_the_pin_is_one() -> None:
    """A crank with I = 1 kg m^2, without mass: J = 1 and J' = 0 whatever the position."""
    linkage = fourbar.FourBar(0.3, fourbar.Bar(0.1, 0.0, 1.0), fourbar.Bar(0.25), fourbar.Bar(0.22))
    J, slope = inertia(linkage, path(linkage, np.linspace(0.0, 6.0, 5), np.ones(5)))
    assert np.array_equal(np.broadcast_to(J, 5), np.ones(5)) and not np.any(slope)
    rocker = fourbar.FourBar(0.3, fourbar.Bar(0.1), fourbar.Bar(0.25), fourbar.Bar(0.22, 0.0, 1.0))
    way = path(rocker, np.linspace(0.0, 6.0, 5), np.ones(5))
    J, slope = inertia(rocker, way)
    assert np.array_equal(J, way.first[4] ** 2) and np.array_equal(slope, 2.0 * way.first[4] * way.second[4])


@pytest.mark.parametrize("drive", [2, 3, 4])
def test_springs_tables_and_rest_have_the_torque_of_newton_euler(drive: int) -> None:
    """What depends on O4, on theta_2 and on rest beside motion, in one sweep."""
    linkage = of(SHAPES["crank-rocker"])
    ends = fourbar.effects.Point(1, 0.2, 0.3), fourbar.effects.Point(4, 0.15, 0.2)
    table = fourbar.effects.Table((0.0, 2.0, 6.0), (1.0, 3.0, -1.0))
    loads = (fourbar.Load(3, (2.0, 0.3), (0.1, 2.0), 0.4, table=table),)
    effects = (
        fourbar.effects.Springs((fourbar.effects.Spring(*ends, 300.0, 0.05),)),
        fourbar.Friction.at(O2=0.1, B=0.3),
    )
    omega = np.array([0.0, 3.0, -3.0, 0.0, 1.0])
    at = Command(np.linspace(0.2, 5.5, 5), np.ones(5, np.int8), omega, np.full(5, 4.0))
    for terms in ((loads, effects), (loads, effects[:1]), ((), ())):
        s = solve(fourbar.Scene(linkage, fourbar.Motion(0.0, 1.0), drive, *terms), "force", at=at)
        way = path(linkage, at.theta_2, np.ones(5))
        every = (*terms[0], *terms[1])
        assert driving_torque(linkage, way, omega, 4.0, every, drive) == pytest.approx(s.torque, rel=1e-11)
        if terms[1]:
            for rate in (0.0, 2.0):
                alone = [float(generalised_force(linkage, path(linkage, q, 1.0), rate, every)) for q in at.theta_2]
                assert generalised_force(linkage, way, rate, every) == pytest.approx(alone, rel=1e-13)
    assert generalised_force(linkage, way, 3.0, ()) == 0.0


def test_a_free_linkage_needs_no_torque() -> None:
    linkage = of(SHAPES["crank-rocker"])
    way = path(linkage, np.linspace(0.2, 5.5, 5), np.ones(5))
    gravity = (fourbar.Gravity(),)
    alpha = acceleration(linkage, way, 3.0, generalised_force(linkage, way, 3.0, gravity))
    size = np.abs(generalised_force(linkage, way, 3.0, gravity)) + np.abs(inertia(linkage, way)[0] * alpha)
    assert np.all(np.abs(driving_torque(linkage, way, 3.0, alpha, gravity, 2)) <= 1e-14 * size + 1e-14)


def test_positions_that_do_not_close_and_limits_are_quiet() -> None:
    linkage = of((0.3, 0.25, 0.1, 0.22, 0.4))
    limit = limit_positions(linkage)[0].theta_2
    at = np.array([limit, 0.4 + np.pi, 0.4])
    shape = triangle(*linkage.lengths)
    exact = half_angle(shape, 0.4, at)
    exact.outer[0], exact.inner[0] = max(exact.outer[0], 0.0), 0.0
    way = path(linkage, at, np.ones(3), exact)
    assert np.isnan(way.unit[3][1:]).all() and way.sine[0] == 0.0 and np.isinf(way.first[3][0])
    terms = (fourbar.Gravity(), fourbar.Viscous.at(B=0.1))
    assert not np.isfinite(driving_torque(linkage, way, 3.0, 4.0, terms, 2)).any()


@pytest.mark.parametrize(
    "lengths", [(2, 1, 2, 1), (1, 1, 2, 2), (2, 1, 1, 2), (2, 1, 4, 3), (3, 1, 2, 2), (1, 1, 1, 1)]
)
def test_followed_through_change_points_it_is_the_smooth_path(lengths: tuple[float, ...]) -> None:
    linkage = of((*lengths, 0.4))
    q = 0.4 + np.linspace(0.1, 12.0, 60)
    branch = on_smooth_path(linkage, q, 1)
    assert (branch == -1).any()
    shape = triangle(*(float(x) for x in lengths), touching=True)
    smooth = path(linkage, q, branch.astype(float))
    sign = float(branch[0])
    with np.errstate(all="ignore"):
        found = along_input(linkage, shape, q, sign, follow=True)
    for bar in (3, 4):
        assert np.allclose(found.unit[bar], smooth.unit[bar], rtol=0.0, atol=1e-12)
        assert np.allclose(found.first[bar], smooth.first[bar], rtol=1e-11, atol=1e-11)
        assert np.allclose(found.second[bar], smooth.second[bar], rtol=1e-9, atol=1e-9)
    assert np.allclose(found.sine, smooth.sine, rtol=0.0, atol=1e-12)


def test_what_touches_is_up_to_the_rounding_of_the_lengths() -> None:
    """The lengths add up to 2: what misses a change point by 2 U = EPS touches, by twice that it does not."""
    exact, beyond = (0.5, 0.5 + EPS, 0.5, 0.5), (0.5, 0.5 + 2 * EPS, 0.5, 0.5)
    for lengths, touches in ((exact, True), (beyond, False)):
        assert (triangle(*lengths, touching=True).E1 == 0.0) == touches
        assert (triangle(*lengths, touching=True).E2 == 0.0) == touches
        assert triangle(*lengths).E1 < 0.0
    wide = triangle(0.3, 0.1, 0.25, 0.22, touching=True)
    assert wide == triangle(0.3, 0.1, 0.25, 0.22)
    products = 0.47**2 - 0.4**2, 0.2**2 - 0.03**2
    assert wide[4:] == pytest.approx(products)


def test_half_angles_keep_their_digits_after_many_turns() -> None:
    """sin h and cos h near their zeros, where the rounding of theta_2 - theta_1 is what is left of them."""
    shape = triangle(0.3, 0.1, 0.25, 0.22)
    for theta_1 in (0.4, -2.9, 3.1):
        for turns in (0, 3, 800, -800):
            q = theta_1 + 2.0 * np.pi * turns + np.array([1e-9, 0.7, np.pi + 1e-9])
            found = half_angle(shape, theta_1, q)
            with mp.workdps(50):
                h = [(mp.mpf(x) - mp.mpf(theta_1)) / 2 for x in q.tolist()]
                for ours, exact in ((found.s, mp.sin), (found.k, mp.cos)):
                    assert all(abs(mp.mpf(x) / exact(y) - 1) <= 8 * EPS for x, y in zip(ours.tolist(), h, strict=True))


def test_a_drive_on_a_bar_that_stands_is_quiet() -> None:
    """A folded kite has B on O2: bar 4 stands still, and no torque on it is found."""
    kite = fourbar.FourBar(2.0, fourbar.Bar(1.0, 1.0), fourbar.Bar(1.0, 1.0), fourbar.Bar(2.0, 1.0))
    way = path(kite, np.array([1.0]), np.array([-1.0]))
    standing = Path(way.unit, {**way.first, 4: np.zeros(1)}, way.second, way.slip, way.sine)
    assert not np.isfinite(driving_torque(kite, standing, 2.0, 1.0, (fourbar.Gravity(),), 4)).any()


def test_directions_are_unit_vectors_and_the_last_rate_is_that_of_bar_4_against_bar_3() -> None:
    lengths = (0.3, 0.3 + 1e-9, 0.25, 0.25 - 1e-9)  # A passes O4 at a billionth of the bars
    q = np.concatenate([np.linspace(0.3, 1.5, 20), np.linspace(-1e-8, 1e-8, 40)])
    for sign in (1.0, -1.0):
        with np.errstate(invalid="ignore"):
            u_3, u_4, t_3, t_4, _, _, _, apart, _ = trace(triangle(*lengths), 0.0, q, sign, follow=False)
        closed = np.isfinite(t_3)
        assert closed.sum() > 30 and closed[:20].all()
        for u in (u_3, u_4):
            assert np.all(np.abs(np.abs(u[closed]) - 1.0) <= 2 * EPS)
        assert np.all(np.abs(apart - (t_4 - t_3))[:20] <= 64 * EPS * (np.abs(t_3) + np.abs(t_4))[:20])
