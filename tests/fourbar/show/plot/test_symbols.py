"""What acts is drawn.

A symbol for everything a scene file can name, where and in the direction it acts.
"""

import cmath
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import fourbar
from fourbar import Point, solve
from fourbar.effects import Load, list_kinds
from fourbar.effects.load import Table
from fourbar.files import loads
from fourbar.linkage import MOVING_BARS
from fourbar.show import animate
from fourbar.show.animate import collect_page_data
from fourbar.show.motion_curves import describe_motion
from fourbar.show.plot import symbols
from fourbar.show.plot.figures import draw_figure
from fourbar.show.plot.film import _make_stage
from fourbar.show.plot.labels import Labels
from fourbar.show.plot.linkage import choose_drawing_scale, draw_mechanism
from fourbar.show.plot.style import apply_style
from fourbar.show.plot.symbols import list_acting
from fourbar.show.plot.view import make_view
from tests.fourbar.show.plot.test_plot import clashes, composed
from tests.fourbar.show.test_animate import embedded
from tests.support.scenes import crank_rocker
from tests.support.texts import LENGTHS

TURNING = Load(3, (2.0, 0.5), from_centre=(0.03, 1.0), frame="bar")
TABLED = Load(4, (5.0, 0.2), table=Table((0.0, math.pi, math.tau), (1.0, -1.0, 1.0)))


@pytest.fixture(scope="module")
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
    released = crank_rocker(motion=fourbar.Motion(0.5, 0.0, free=fourbar.Free(0.5, 4)))
    assert "drive" not in [symbol.kind for symbol in list_acting(released)]


def test_symbols_stand_where_the_formulas_let_them_act(everything):
    """A load's arrow begins at its point and points along it.

    A spring joins its two points.
    """
    solution = solve(everything)
    axes = Figure().subplots()
    for index in (5, 30):
        place = symbols.place_of(everything.linkage, solution, index, 1.0)
        drawn = {
            s.name: symbols.draw_symbol(axes, s, place, 0.01)
            for s in list_acting(everything)
            if s.kind in ("force", "spring")
        }
        theta_3, theta_4 = solution.theta_3[index], solution.theta_4[index]
        tail, tip = (complex(*point) for point in drawn["load 1"].lines[0])
        expected = complex(*solution.G3[index]) + cmath.rect(0.03, 1.0 + theta_3)
        assert abs(tail - expected) < 1e-15
        assert abs(cmath.phase((tip - tail) / cmath.rect(1.0, 0.5 + theta_3))) < 1e-12
        tail, tip = (complex(*point) for point in drawn["load 2"].lines[0])
        factor = float(TABLED.table.at(solution.theta_2[index]))
        assert abs(tail - complex(*solution.G4[index])) < 1e-15
        assert (
            abs(cmath.phase((tip - tail) / cmath.rect(math.copysign(1.0, factor), 0.2)))
            < 1e-12
        )
        line = drawn["spring"].lines[0]
        O4 = cmath.rect(everything.linkage.ground, everything.linkage.ground_angle)
        assert (
            abs(
                complex(*line[0])
                - cmath.rect(0.1, everything.linkage.ground_angle - 0.5 * math.pi)
            )
            < 1e-15
        )
        assert abs(complex(*line[-1]) - O4 - cmath.rect(0.08, theta_4)) < 1e-15


def test_nothing_at_a_pin_hides_a_bar_and_what_lies_off_a_bar_is_joined_to_it(
    everything,
):
    """Rings stay within a crank of a twelfth of the coupler.

    A plate goes from pin to point to pin.
    """
    lengths = {"input": 0.02, "coupler": 0.25, "output": 0.22}
    short = replace(
        everything.linkage,
        **{
            k: replace(getattr(everything.linkage, k), length=v)
            for k, v in lengths.items()
        },
    )
    shown = make_view(
        replace(everything, linkage=short, points=(Point("P", 3, (0.15, 0.7)),))
    )
    factor, *_ = choose_drawing_scale(shown)
    axes = Figure().subplots()
    draw_mechanism(axes, shown, shown.here, 0, Labels())
    bars = [line for line in axes.lines if line.get_linewidth() == 4.5]
    rings = [line for line in axes.lines if len(line.get_xdata()) > 30]
    assert len(rings) >= 5
    assert all(
        line.get_zorder() < min(bar.get_zorder() for bar in bars) for line in rings
    )
    pins = [np.zeros(2), factor * shown.here.A[0]]
    closed = [
        line.get_xydata()[:-1]
        for line in rings
        if np.allclose(line.get_xydata()[0], line.get_xydata()[-1])
    ]
    at_crank = [
        ring
        for ring in closed
        if any(np.allclose(ring.mean(axis=0), pin, atol=1e-6) for pin in pins)
    ]
    assert len(at_crank) >= 2
    assert all(
        np.ptp(ring, axis=0).max() < 2.0 * factor * short.input.length
        for ring in at_crank
    )
    plates = [
        patch.get_xy()
        for patch in axes.patches
        if patch.get_linestyle() in (":", "dotted")
    ]
    places = {
        name: factor * getattr(shown.here, name)[0] for name in ("A", "B", "G3", "G4")
    }
    assert any(
        np.allclose(
            corners, [places["A"], factor * shown.here.points["P"][0], places["B"]]
        )
        for corners in plates
    )
    angle = 1.0 + shown.here.theta_3[0]
    load = places["G3"] + factor * 0.03 * np.array([math.cos(angle), math.sin(angle)])
    assert any(
        np.allclose(corners, [places["A"], load, places["B"]]) for corners in plates
    )


def test_the_page_is_given_the_same_symbols(everything):
    data = embedded(animate.write_page(everything))
    assert [one["kind"] for one in data["acting"]] == [
        symbol.kind for symbol in list_acting(everything)
    ]
    factors = next(one["factor"] for one in data["acting"] if one["name"] == "load 2")
    assert np.allclose(factors, TABLED.table.at(np.array(data["theta_2"])), rtol=1e-15)


@pytest.mark.slow
def test_the_points_of_a_scene_are_drawn_where_they_are():
    """Path, speed and mark in the plot, place and columns in the page."""
    scene = crank_rocker(points=(Point("P", 3, (0.15, 0.7)),))
    solution = describe_motion(solve(scene)).solve_with_peaks()
    panels = (
        draw_figure(scene, "points", units=fourbar.units("m m/s m/s^2"))
        .figure.subfigs[0]
        .axes
    )
    path = next(line for line in panels[0].lines if line.get_label() == "path of P")
    assert {f"path of $G_{bar}$" for bar in (2, 4)} <= {
        line.get_label() for line in panels[0].lines
    }
    # the path has steps of its own along the curve: each position lies between two
    drawn = np.asarray(path.get_xydata()) @ (1.0, 1.0j)
    stated = solution.points["P"] @ (1.0, 1.0j)
    steps = np.abs(np.diff(drawn))
    away = np.abs(stated[:, None] - drawn).min(axis=1)
    assert away.max() < steps.max() < 0.01 * np.abs(drawn).max()
    for panel, of_points in zip(
        panels[1:], (solution.velocity, solution.acceleration), strict=True
    ):
        line = next(line for line in panel.lines if line.get_label() == "P")
        assert np.allclose(line.get_ydata(), np.hypot(*of_points["P"].T), rtol=1e-15)
    data = collect_page_data(scene, {})
    assert data["points"][0]["name"] == "P"
    assert abs(complex(*data["points"][0]["at"]) - cmath.rect(0.15, 0.7)) < 1e-15


@pytest.mark.slow
def test_no_text_covers_another_where_much_acts_and_numbers_are_long(everything):
    pins = (
        fourbar.Viscous((("O2", 0.01), ("A", 0.01))),
        fourbar.Friction((("O2", 0.05), ("A", 0.05))),
    )
    loads = (*everything.loads, Load(2, moment=0.1), Load(2, (15.0, 0.0)))
    kept = [
        effect
        for effect in everything.effects
        if effect.key not in ("viscous", "friction")
    ]
    scene = replace(everything, loads=loads, effects=(*kept, *pins), drive_bar=2)
    assert not clashes(composed(scene, "freebody"))
    pump = fourbar.load(
        Path(__file__).parents[4] / "models" / "gallery" / "pump_jack.toml"
    )
    assert not clashes(composed(pump, "overview", units="imperial"))


@pytest.mark.slow
def test_a_film_names_and_moves_what_the_plot_does(everything):
    scene = replace(everything, points=(Point("P", 3, (0.15, 0.7)),))
    with apply_style():
        figure, move = _make_stage(make_view(scene), moving=True)
        move(3)
        move(7)
        figure.draw_without_rendering()
    (axes,) = figure.axes
    solution = solve(scene)
    bars = [line for line in axes.lines if line.get_lw() == 4.5 and line.get_visible()]
    at_7 = [getattr(solution, name)[7] for name in ("A", "B")]
    ratios = np.transpose(bars[1].get_data()) / at_7
    assert len(bars) == len(MOVING_BARS) and np.allclose(ratios, ratios[0, 0])
    names = {artist.get_label() for artist in axes.artists if artist.get_visible()}
    assert names >= {
        "$O_2$",
        "$A$",
        "2",
        "3",
        "4",
        "$G_2$",
        "$G_3$",
        "$G_4$",
        "P",
        "load 1",
        "viscous",
        "pin friction",
    }
    assert axes.title.get_window_extent().y0 > axes.get_legend().get_window_extent().y1
    for arrows, name, of_points in zip(
        axes.collections[-2:],
        ("v_A", "a_A"),
        (solution.velocity, solution.acceleration),
        strict=True,
    ):
        shafts = np.column_stack([arrows.U, arrows.V])
        scale = np.hypot(*shafts[0]) / np.hypot(*getattr(solution, name)[7])
        assert np.allclose(
            shafts[[0, -1]],
            scale * np.array([getattr(solution, name)[7], of_points["P"][7]]),
            rtol=1e-12,
        )
