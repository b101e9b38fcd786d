"""The energy method against Newton-Euler, and against outside answers."""

import numpy as np
import pytest
from scipy.optimize import brentq

import fourbar
from fourbar.dynamics import acceleration, driving_torque, generalised_force, inertia, path
from fourbar.mobility import limit_positions
from fourbar.scene import Command, command, solve
from validation.engines.energy import EnergyMethod

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
                s, theirs = solve(scene, "force", at=at), EnergyMethod().answer(scene, at)
                assert theirs.assembled is not None and s.torque is not None and s.drive_condition is not None
                assert np.array_equal(s.assembled, theirs.assembled)
                assembled.append(bool(s.assembled[0]))
                if assembled[-1]:
                    allowed = K * EPS * np.abs(s.torque) / s.drive_condition
                    assert np.all(np.abs(theirs.quantities["torque"] - s.torque) <= allowed)
            assert any(assembled) and (offset > 1e-3 or not all(assembled))


def test_both_say_alike_where_the_loop_closes_at_the_last_digits_of_a_limit() -> None:
    for seed in range(10):
        linkage, _, _ = random_case(np.random.default_rng(seed))
        for limit in limit_positions(linkage):
            angles = limit.theta_2 + np.arange(-4, 5) * np.spacing(limit.theta_2)
            at = Command(angles, np.ones(9, dtype=np.int8), None, 0.0)
            ours, theirs = solve(fourbar.Scene(linkage), at=at), EnergyMethod().answer(fourbar.Scene(linkage), at)
            assert theirs.assembled is not None and np.array_equal(ours.assembled, theirs.assembled)


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
