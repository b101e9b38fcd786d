"""Paths run along the curve.

No false corner, through both branches, and where the drawing has the point.
"""

from dataclasses import replace

import numpy as np
import pytest
from pytest import approx

import fourbar
from fourbar.files.scene_file import loads
from fourbar.show.plot.figures import draw_figure
from fourbar.show.plot.paths import trace
from fourbar.show.plot.view import make_view
from tests.support.scenes import crank_rocker
from tests.support.texts import COORDINATES

LONGEST = 2.0 / 150.0
"""Of a chord of a drawn path, as a part of its extent: 2 mm in a figure of 150 mm."""


def measure_chords(path):
    """Return the longest chord as a part of the extent.

    The sharpest turn between two, deg, is returned too.
    """
    steps = np.diff(path, axis=0) @ np.array([1.0, 1.0j])
    extent = float(np.ptp(path, axis=0).max())
    turns = np.abs(np.angle(steps[1:] / steps[:-1]))
    return float(np.abs(steps).max()) / extent, float(np.degrees(turns.max()))


@pytest.mark.slow
def test_the_whole_circuit_is_traced_without_a_corner():
    """By degrees of the input this path has chords of 40 mm; its extent is 120 mm."""
    view = make_view(loads(COORDINATES))
    traced = trace(view)
    assert traced.circuit
    path = traced.path(traced.solution.points["E"])
    assert path[0] == approx(path[-1])
    longest, sharpest = measure_chords(path)
    assert longest < LONGEST
    assert sharpest < 30.0
    assert len(path) < 2000
    away = path - view.here.points["E"][0]
    assert np.hypot(*away.T).min() < 0.5 * LONGEST * np.ptp(path, axis=0).max()
    # the curve of the formulas, by many more positions
    scene = view.scene
    curve = fourbar.coupler_curve(scene, "E", steps=200_000)
    dense = np.stack([curve.x, curve.y], axis=1)
    apart = np.hypot(*np.diff(dense, axis=0).T).max()
    for point in path[:: len(path) // 40]:
        assert np.hypot(*(dense - point).T).min() < apart


def test_a_stated_sweep_keeps_its_ends():
    scene = replace(
        crank_rocker(points=(fourbar.Point("P", 3, (0.1, 0.7)),)),
        motion=fourbar.Motion(fourbar.Sweep(0.2, 1.4, 3), 10.0),
    )
    view = make_view(scene)
    traced = trace(view)
    path = traced.path(traced.solution.points["P"])
    assert not traced.circuit
    assert path[[0, -1]] == approx(view.sweep.points["P"][[0, -1]])
    assert measure_chords(path)[0] < LONGEST


@pytest.mark.slow
def test_the_coupler_figure_draws_that_path():
    scene = loads(COORDINATES)
    figure = draw_figure(scene, "coupler").figure
    (axes,) = (axes for axes in figure.axes if axes.get_title(loc="left"))
    lines = {line.get_label(): line.get_xydata() for line in axes.lines}
    assert measure_chords(np.asarray(lines["E"]))[0] < LONGEST
    assert "circuit" in axes.get_title(loc="left")
