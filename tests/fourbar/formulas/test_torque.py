"""The torque by virtual work against free bodies, energy and published figures."""

import mpmath as mp
import numpy as np
from pytest import mark

from fourbar import (
    Bar,
    FourBar,
    FromLimit,
    Gravity,
    Load,
    Motion,
    Scene,
    equilibrium,
    limit_positions,
    solve,
)
from tests.fourbar.test_solving_properties import ACTING, BODIES, embody
from tests.support.balls import answer_in_balls
from tests.support.scenes import EPS, draw_linkage

K = 200.0
"""eps/condition of the sum of absolute terms; two derivations of some hundred roundings
each, over 7000 samples.
"""
ROUNDED_SUM = 2.0**-51
"""Of the sum of four lengths: what is missing of it where each is rounded by four U."""


@mark.parametrize("offset", [1e-2, 1e-8, 1e-14, 1e-30])
@mark.parametrize("seed", [0, 1])
def test_digits_are_kept_at_a_stated_distance_from_a_limit(seed, offset):
    """On one side of a limit the linkage assembles, with the torque of balls."""
    linkage = embody(draw_linkage(np.random.default_rng(seed)), BODIES[0])
    loads, effects = ACTING[1]
    for number in range(1, len(limit_positions(linkage)) + 1):
        drive, branch = 2 + number % 3, 1 - 2 * (number // 2 % 2)
        assembled = []
        for side in (offset, -offset):
            motion = Motion(FromLimit(number, side), 1.3, 0.7, branch=branch)
            scene = Scene(linkage, motion, drive, loads, effects)
            s = solve(scene, "force")
            exact = answer_in_balls(scene).get("torque", [np.nan])[0]
            assembled.append(bool(s.assembled[0]))
            assert assembled[-1] == np.isfinite(exact)
            if assembled[-1]:
                allowed = K * EPS * abs(s.torque[0]) / s.drive_condition[0]
                assert abs(exact - s.torque[0]) <= allowed
        assert any(assembled) and (offset > 1e-3 or not all(assembled))


def test_where_the_loop_closes_is_known_at_the_last_digits_of_a_limit():
    """Bars that miss each other by less than the rounding of the lengths meet."""
    compared, rng = [0, 0], np.random.default_rng(4)
    for linkage in (draw_linkage(rng) for _ in range(8)):
        for limit in limit_positions(linkage):
            angles = limit.theta_2 + np.arange(-4, 5) * np.spacing(limit.theta_2)
            ours = solve(Scene(linkage, Motion(angles))).assembled
            with mp.workdps(50):
                d, a, b, c = (mp.mpf(length) for length in linkage.lengths)
                for angle, assembled in zip(angles.tolist(), ours, strict=True):
                    psi = mp.mpf(angle) - mp.mpf(linkage.ground_angle)
                    e = abs(d - a * mp.expj(psi))
                    missed = max(e - (b + c), abs(b - c) - e)
                    assert assembled == (missed <= ROUNDED_SUM * (a + b + c + d))
                    compared[int(assembled)] += 1
    assert min(compared) > 8


def test_statics_of_motiongenesis():
    """Equilibrium angles under H = 200 N (motiongenesis MGFourBarDynamicsFBD)."""
    bars = (Bar(1.0, 10.0), Bar(2.0, 20.0), Bar(2.0, 20.0))
    linkage = FourBar(1.0, *bars, ground_angle=np.pi / 2)
    pull = Load(3, (200.0, np.pi / 2), from_pin=(2.0, 0.0))
    effects = (Gravity(9.81, 0.0),)
    found = equilibrium(Scene(linkage, loads=(pull,), effects=effects)).found
    angles = [np.degrees(rest.place[:3]) for rest in found]
    printed = [19.98690555, 71.66202052, 38.32488502]
    assert any(abs(angle - printed).max() <= 0.5e-8 for angle in angles)
