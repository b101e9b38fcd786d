"""Curves of derived quantities and paths of points are what the solution has.

A path runs along its curve: no false corner, through both branches.
"""

import re
from math import pi

import numpy as np
from matplotlib.figure import Figure
from pytest import approx, mark

import fourbar
from fourbar import Friction, Motion, Point, Sweep, solve
from fourbar.files import loads
from fourbar.show.columns import choose_columns
from fourbar.show.derived import derive
from fourbar.show.plot.curves import CHARTS, draw_chart, list_demand
from fourbar.show.plot.figures import draw_figure
from fourbar.show.plot.view import make_view
from tests.support.rows import read_rows
from tests.support.scenes import WEIGHT, bare, crank_rocker
from tests.support.texts import COORDINATES

SCENE = crank_rocker(Motion(Sweep(0.0, 2.0 * pi, 120), 10.0), effects=WEIGHT)
DEGREES = np.linspace(0.0, 360.0, 121)
LONGEST = 2.0 / 150.0
"""Of a chord of a drawn path, as a part of its extent: 2 mm in a figure of 150 mm."""


def list_lines(figure, scene=SCENE, units="m"):
    drawing = draw_figure(scene, figure, units=fourbar.units(units))
    lines = (line for axes in drawing.figure.axes for line in axes.lines)
    return {
        str(line.get_label()): np.asarray(line.get_xydata(), dtype=float)
        for line in lines
    }


def join(path):
    return path @ np.array([1.0, 1.0j])


CURVES = read_rows("""
shaking | $|F|$ | shaking_force
shaking | $F_x$ | shaking_force_x
shaking | $F_y$ | shaking_force_y
forces | $F_{12}$ | F12
ratios | ω₄/ω₂ | omega_4/omega_2
""")
"""Figures, their curves, and the columns that these draw."""


@mark.slow
@mark.parametrize("figure, name, column", CURVES)
def test_curves_are_columns_in_the_unit_of_their_axis(figure, name, column):
    shown = np.interp(DEGREES, *list_lines(figure, units="mN")[name].T)
    (expected,) = choose_columns(solve(SCENE), column)
    values = expected.convert(fourbar.units("mN"))[1]
    assert shown == approx(values, rel=1e-9, abs=1e-9 * abs(values).max())


@mark.slow
def test_what_a_clipped_axis_leaves_out_is_a_pure_number():
    """A ratio has no prefix: a thousand is no "k1"."""
    scene = crank_rocker(Motion(Sweep(0.0, 2.0 * pi, 3601), 10.0))
    caption = draw_figure(scene, "ratios").figure.subfigs[0].get_supxlabel()
    assert re.search(
        r"clipped at [\d.]+; the largest evaluated, T₄/T₂ = −?\d{4,}",
        " ".join(caption.split()),
    )


@mark.slow
def test_no_line_crosses_a_dead_centre():
    jumps = np.isnan(list_lines("ratios")["T₄/T₂"][:, 1]).sum()
    assert jumps == np.sum(np.diff(np.sign(solve(SCENE).omega_4)) != 0.0)


@mark.slow
def test_instant_centres_lie_on_the_lines_of_the_bars():
    path = list_lines("centres")["$I_{24}$"]
    theta_1 = SCENE.linkage.ground_angle
    across = path @ np.array([-np.sin(theta_1), np.cos(theta_1)])
    assert np.isfinite(across).sum() > 30
    assert across[np.isfinite(across)] == approx(0.0, abs=1e-9)
    here = make_view(SCENE).here
    bar = here.B[0] - here.A[0]
    away = derive(here, "I24")[0] - here.A[0]
    assert bar[0] * away[1] == approx(bar[1] * away[0], rel=1e-9)


def measure_chords(path):
    """Return the longest chord as a part of the extent.

    The sharpest turn between two, deg, is returned too.
    """
    steps = np.diff(path)
    extent = float(max(np.ptp(path.real), np.ptp(path.imag)))
    turns = abs(np.angle(steps[1:] / steps[:-1]))
    return float(abs(steps).max()) / extent, float(np.degrees(turns.max()))


@mark.slow
def test_the_whole_circuit_is_traced_without_a_corner_and_drawn():
    """By degrees of the input this path has chords of 40 mm; its extent is 120 mm."""
    view = make_view(loads(COORDINATES))
    assert view.goes_round
    path = join(view.trace().points["E"])
    assert path[0] == approx(path[-1])
    longest, sharpest = measure_chords(path)
    assert longest < LONGEST and sharpest < 30.0
    away = abs(path - join(view.here.points["E"][0]))
    assert away.min() < 0.5 * LONGEST * np.ptp(path.real)
    # the curve of the formulas, by many more positions
    curve = fourbar.coupler_curve(view.scene, "E", steps=200_000)
    dense = curve.x + 1j * curve.y
    apart = abs(np.diff(dense)).max()
    for point in path[:: len(path) // 40]:
        assert abs(dense - point).min() < apart
    drawn = join(list_lines("coupler", view.scene)["E"])
    assert drawn == approx(path + complex(*view.scene.origin))


def test_a_stated_sweep_keeps_its_ends_and_a_point_of_the_output_is_no_coupler_s():
    points = Point("P", 3, (0.1, 0.7)), Point("Q", 4, (0.1, 0.0))
    scene = crank_rocker(Motion(Sweep(0.2, 1.4, 3), 10.0), points=points)
    view = make_view(scene)
    path = join(view.trace().points["P"])
    assert not view.goes_round
    assert path[[0, -1]] == approx(join(view.sweep.points["P"][[0, -1]]))
    assert measure_chords(path)[0] < LONGEST
    drawn = list_lines("coupler", scene)
    assert [name for name in drawn if name[0] != "_"] == ["$A$", "$B$", "P"]
    assert join(drawn["P"]) == approx(path)


def test_a_falling_sweep_is_drawn_with_the_turns_of_its_own_order():
    """theta_4 passes -180 deg on the way."""
    scene = crank_rocker(
        Motion(Sweep(4.5, 1.5, 9), 1.0), linkage=bare(0.3, 0.1, 0.25, 0.22, 1.0)
    )
    drawn = make_view(scene).sweep.theta_4[::-1]
    assert drawn == approx(solve(scene).theta_4) and drawn[-1] < -pi < drawn[0]


def test_the_centres_of_a_drawing_are_moved_by_its_origin_once():
    scene = loads(COORDINATES)
    assert any(scene.origin)
    places = join(derive(make_view(scene).sweep, "I24"))
    drawn = join(list_lines("centres", scene)["$I_{24}$"])
    (first, *_) = drawn[np.isfinite(drawn)]
    assert np.nanmin(abs(places - first)) < 1e-9


def test_a_clipped_end_of_what_friction_holds_is_named_by_its_column():
    friction = Friction.at(O2=2.0)
    turn = Motion(Sweep(0.0, 2.0 * pi, 200), 0.0)
    view = make_view(crank_rocker(turn, drive_bar=4, effects=(friction,)))
    draw_chart(Figure().subplots(), view, CHARTS["drive"])
    assert re.search(r"evaluated, torque_(low|high)\s=\s", view.notes[-1])


@mark.parametrize("acceleration, lines", [(0.0, 3), (3.0, 1)])
def test_a_start_is_no_range_that_friction_holds(acceleration, lines):
    rest = Motion(Sweep(0.5, 1.5, 20), 0.0, acceleration)
    view = make_view(crank_rocker(rest, effects=(Friction.at(O2=2.0),)))
    assert len(list_demand(view).curves) == lines
