"""What acts is drawn.

A symbol for everything a scene file can name, where and in the direction it acts.
"""

from cmath import phase, rect
from dataclasses import replace
from math import copysign, cos, pi, sin, tau

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch
from pytest import fixture, mark

import fourbar
from fourbar import Motion, Point, Table, solve
from fourbar.effects import Load, list_kinds
from fourbar.files import loads
from fourbar.show import animate, motion_curves
from fourbar.show.plot import figures, linkage_figure, symbols, view
from fourbar.show.plot.symbols import list_acting
from tests.support.scenes import crank_rocker
from tests.support.texts import LENGTHS

TURNING = Load(3, (2.0, 0.5), from_centre=(0.03, 1.0), frame="bar")


TABLED = Load(4, (5.0, 0.2), table=Table((0.0, pi, tau), (1.0, -1.0, 1.0)))


@fixture(scope="module")
def everything():
    """Every effect that a scene file can name, by its own example.

    Loads of both frames are added.
    """
    effects = "\n".join(kind.example for kind in list_kinds().values())
    described = loads(f'{LENGTHS}[motion]\nomega_2 = "3 rad/s"\n[effects]\n{effects}\n')
    return crank_rocker(loads=(TURNING, TABLED), effects=described.effects, drive_bar=4)


def test_everything_that_acts_has_a_symbol(everything):
    kinds = [symbol.kind for symbol in list_acting(everything)]
    for key in list_kinds():
        assert {"springs": "spring"}.get(key, key) in kinds
    assert kinds.count("force") == 2 and kinds[0] == "drive"
    released = crank_rocker(Motion(0.5, 0.0, free=fourbar.Free(0.5, 4)))
    for scene in (released, crank_rocker(Motion(0.5))):
        assert "drive" not in [symbol.kind for symbol in list_acting(scene)]


@mark.parametrize("index", [5, 30])
def test_symbols_stand_where_the_formulas_let_them_act(everything, index):
    """A load's arrow begins at its point and points along it.

    A spring joins its two points.
    """
    solution = solve(everything)
    shown = view.make_view(everything)
    shown.units = fourbar.units("m")
    pose = symbols.Pose(shown, solution, index)
    axes = Figure().subplots()

    def ends(name):
        (symbol,) = (one for one in list_acting(everything) if one.name == name)
        symbols.draw_symbol(axes, symbol, pose)
        if name == "spring":
            return axes.lines[-2].get_xydata()[[0, -1]] @ np.array([1.0, 1.0j])
        return axes.patches[-1]._posA_posB @ np.array([1.0, 1.0j])

    theta_3 = solution.theta_3[index]
    theta_4 = solution.theta_4[index]
    G3, G4 = (complex(*solution[name][index]) for name in ("G3", "G4"))
    sign = copysign(1.0, TABLED.table.at(solution.theta_2[index]))
    for name, tail, direction in (
        ("load 1", G3 + rect(0.03, 1.0 + theta_3), rect(1, 0.5 + theta_3)),
        ("load 2", G4, rect(sign, 0.2)),
    ):
        start, tip = ends(name)
        assert abs(start - tail) < 1e-15
        assert abs(phase((tip - start) / direction)) < 1e-12
    start, stop = ends("spring")
    theta_1 = everything.linkage.ground_angle
    O4 = rect(everything.linkage.ground, theta_1)
    assert abs(start - rect(0.1, theta_1 - 0.5 * pi)) < 1e-15
    assert abs(stop - O4 - rect(0.08, theta_4)) < 1e-15


@mark.parametrize("moment", [2.0, -2.0])
def test_the_arrow_of_a_moment_turns_as_the_moment_does(moment):
    scene = crank_rocker(loads=(Load(4, moment=moment),))
    (symbol,) = (one for one in list_acting(scene) if one.kind == "moment")
    shown = view.make_view(scene)
    axes = Figure().subplots()
    symbols.draw_symbol(axes, symbol, symbols.Pose(shown, shown.here, 0))
    x, y = axes.lines[0].get_data()
    area = np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])  # about O2
    middle_x, middle_y = np.mean([x, y], axis=1)
    area -= middle_x * (y[-1] - y[0]) - middle_y * (x[-1] - x[0])
    assert copysign(1.0, area) == copysign(1.0, moment)


@fixture(scope="module")
def crowded(everything):
    """All that acts drawn on a crank of a twelfth of the coupler: axes, view, scale."""
    linkage = everything.linkage
    crank = replace(linkage.input, length=0.02)
    short = replace(linkage, input=crank, coupler=replace(linkage.coupler, length=0.25))
    points = (Point("P", 3, (0.15, 0.7)),)
    shown = view.make_view(replace(everything, linkage=short, points=points))
    axes = Figure().subplots()
    linkage_figure.draw_mechanism(axes, shown, shown.here, 0)
    return axes, shown.here, shown.plane.factor


def test_nothing_at_a_pin_hides_a_bar(crowded):
    axes, here, factor = crowded
    rings = [line for line in axes.lines if len(line.get_xdata()) > 30]
    bars = [line for line in axes.lines if line.get_linewidth() == 4.5]
    lowest = min(bar.get_zorder() for bar in bars)
    assert len(rings) >= 5 and all(ring.get_zorder() < lowest for ring in rings)
    around_crank = []
    for ring in (line.get_xydata() for line in rings):
        middle = ring[:-1].mean(axis=0)
        to_pins = np.hypot(*(middle - [np.zeros(2), factor * here.A[0]]).T)
        if np.allclose(ring[0], ring[-1]) and to_pins.min() < 1e-6:
            around_crank.append(np.ptp(ring, axis=0).max())
    assert len(around_crank) >= 2
    assert max(around_crank) < 2.0 * factor * 0.02


def test_what_lies_off_a_bar_is_joined_to_it(crowded):
    """A plate goes from pin to point to pin."""
    axes, here, factor = crowded
    plates = [
        patch.get_xy()
        for patch in axes.patches
        if patch.get_linestyle() in (":", "dotted")
    ]
    angle = 1.0 + here.theta_3[0]
    load = here.G3[0] + 0.03 * np.array([cos(angle), sin(angle)])
    for point in (here.points["P"][0], load):
        corners = factor * np.array([here.A[0], point, here.B[0]])
        assert any(np.allclose(plate, corners) for plate in plates)


@mark.slow
def test_the_points_of_a_scene_are_drawn_where_they_are():
    """Path, speed and mark in the plot, place and columns in the page."""
    scene = crank_rocker(points=(Point("P", 3, (0.15, 0.7)),))
    solution = motion_curves.describe_motion(solve(scene)).solve_with_peaks()
    units = fourbar.units("mm m/s m/s^2")
    figure = figures.draw_figure(scene, "points", units=units).figure
    paths, speeds, accelerations = (
        {line.get_label(): line.get_xydata() for line in panel.lines}
        for panel in figure.subfigs[0].axes
    )
    assert {"path of $G_2$", "path of $G_4$", "path of P"} <= set(paths)
    for lines, values in (
        (speeds, solution.velocity["P"]),
        (accelerations, solution.acceleration["P"]),
    ):
        assert np.allclose(lines["P"][:, 1], np.hypot(*values.T), rtol=1e-15)
    arrows = figure.subfigs[0].axes[0].findobj(FancyArrowPatch)
    feet = [complex(*arrow._posA_posB[0]) for arrow in arrows]
    at = 1e3 * complex(*view.make_view(scene).here.points["P"][0])
    assert sum(abs(foot - at) < 1e-9 for foot in feet) == 2
    (point,) = animate.collect_page_data(scene, {})["points"]
    assert point["name"] == "P"
    assert abs(complex(*point["at"]) - rect(0.15, 0.7)) < 1e-15
