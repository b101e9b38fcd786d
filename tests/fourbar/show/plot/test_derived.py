"""Curves of shaking force, ratios and instant centres.

What they draw is what the solution has.
"""

import numpy as np
import pytest
from pytest import approx

import fourbar
from fourbar import solve
from fourbar.show.derived import derive
from fourbar.show.plot.figures import draw_figure
from fourbar.show.plot.view import make_view
from tests.support.scenes import crank_rocker

SCENE = crank_rocker(
    motion=fourbar.Motion(fourbar.Sweep(0.0, 2.0 * np.pi, 120), 10.0),
    effects=(fourbar.Gravity(),),
)


def list_lines(figure):
    drawing = draw_figure(SCENE, figure)
    return {
        str(line.get_label()): np.asarray(line.get_xydata(), dtype=float)
        for axes in drawing.figure.axes
        for line in axes.lines
    }


@pytest.mark.slow
def test_the_shaking_force_is_drawn_with_its_components():
    lines = list_lines("shaking")
    force = derive(solve(SCENE), "shaking_force")
    for name, values in {
        "$|F|$": np.hypot(*force.T),
        "$F_x$": force[:, 0],
        "$F_y$": force[:, 1],
    }.items():
        drawn = lines[name]
        shown = np.interp(np.linspace(0.0, 360.0, 121), *drawn.T)
        assert shown == approx(values, rel=1e-9, abs=1e-9 * np.abs(force).max())


@pytest.mark.slow
def test_ratios_are_those_of_the_speeds_and_no_line_crosses_a_dead_centre():
    lines = list_lines("ratios")
    s = solve(SCENE)
    drawn = lines["ω₄/ω₂"]
    shown = np.interp(np.linspace(0.0, 360.0, 121), *drawn.T)
    assert shown == approx(s.omega_4 / 10.0, abs=1e-9)
    advantage = lines["T₄/T₂"][:, 1]
    jumps = np.isnan(advantage).sum()
    assert jumps == np.sum(np.diff(np.sign(s.omega_4)) != 0.0)


@pytest.mark.slow
def test_instant_centres_lie_on_the_lines_of_the_bars():
    lines = list_lines("centres")
    here = make_view(SCENE).here
    path = lines["$I_{24}$"]
    theta_1 = SCENE.linkage.ground_angle
    across = path @ np.array([-np.sin(theta_1), np.cos(theta_1)])
    assert np.isfinite(across).sum() > 30
    assert across[np.isfinite(across)] == approx(0.0, abs=1e-9)
    A, B = (here.A[0], here.B[0])
    centre = derive(here, "I24")
    along, away = B - A, centre[0] - A
    assert along[0] * away[1] == approx(along[1] * away[0], rel=1e-9)
