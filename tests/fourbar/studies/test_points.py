"""Instant centres and coupler curves of scenes and solutions."""

import numpy as np

from fourbar import coupler_curve, instant_centres, solve
from tests.support.rows import refused
from tests.support.scenes import TURN, recommand


def test_centres_of_a_scene_and_of_its_solution_are_those_of_its_linkage():
    of_scene, of_solution = (instant_centres(of) for of in (TURN, solve(TURN)))
    assert np.array_equal(of_scene[1, 3].x, of_solution[1, 3].x)
    with refused("must be left out"):
        instant_centres(TURN, np.array([1.0]), 1)
    with refused("needs theta_2 and branch"):
        instant_centres(TURN.linkage)


def test_a_coupler_curve_of_a_scene_passes_through_its_point():
    curve = coupler_curve(TURN, "P", steps=4000)
    path = solve(TURN).points["P"]
    away = np.hypot(curve.x[:, None] - path[:, 0], curve.y[:, None] - path[:, 1])
    assert away.min(axis=0).max() < 1e-4
    other = coupler_curve(solve(recommand(TURN, branch=-1)), "P", steps=400)
    assert set(other.branch) == {-1} and set(curve.branch) == {1}
    with refused("must be a point of the coupler: P"):
        coupler_curve(TURN, "J")
