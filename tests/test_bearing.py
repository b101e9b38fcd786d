"""Shaking force and moment from momentum, and the loads of the pins."""

import numpy as np

import fourbar
from fourbar.show.bearing import bearing_load, drive_power, shaking_force, shaking_moment
from tests.scenes import crank_rocker

ROUND_OFF = 1e-11
"""Some hundred roundings, divided by the smallest sine of this sweep squared."""


def test_shaking_is_the_momentum_that_the_bars_lose() -> None:
    scene = crank_rocker(loads=(), effects=())
    s = fourbar.solve(scene)
    force, moment = np.zeros((61, 2)), np.zeros(61)
    for number, G, a, alpha in (
        (2, s.G2, s.a_G2, s.alpha_2),
        (3, s.G3, s.a_G3, s.alpha_3),
        (4, s.G4, s.a_G4, s.alpha_4),
    ):
        bar = scene.linkage.bar(number)
        force -= bar.mass * a
        moment -= bar.mass * (G[:, 0] * a[:, 1] - G[:, 1] * a[:, 0]) + bar.moment_of_inertia * alpha
    assert np.abs(shaking_force(s) - force).max() < ROUND_OFF * np.abs(force).max()
    assert np.abs(shaking_moment(scene.linkage, s) - moment).max() < ROUND_OFF * np.abs(moment).max()
    assert np.array_equal(drive_power(s), s.torque * 10.0)


def test_bearing_load() -> None:
    s = fourbar.solve(crank_rocker())
    load = np.hypot(s.F43[:-1, 0], s.F43[:-1, 1])
    found = bearing_load(s, "B")
    assert found.largest == load.max() and found.where == s.theta_2[load.argmax()]
    assert abs(found.rms - np.linalg.norm(load) / np.sqrt(60)) < 1e-14 * found.rms * 60
