"""Drawings: what they show against the formulas.

Nothing may overlap, and they must reach the file atomically.
"""

import math
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache
from itertools import combinations, cycle
from math import radians
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text
from numpy.testing import assert_allclose
from pytest import approx, raises

import fourbar
from fourbar import (
    Bar,
    Free,
    Gravity,
    LinearDrive,
    Motion,
    Point,
    Sweep,
    Viscous,
    load,
    solve,
)
from fourbar.effects import Flywheel, PinFriction, Place, Spring, Springs, Torsion
from fourbar.effects.effect import list_bodies
from fourbar.errors import InputError, NotAssembledError
from fourbar.formulas.mobility import find_intervals
from fourbar.formulas.path import compute_state
from fourbar.formulas.torque import inertia
from fourbar.scene.motion import Law
from fourbar.show import plot
from fourbar.show.duty import compute_energies
from fourbar.show.motion_curves import describe_motion
from fourbar.show.plot.curves import (
    break_at_poles,
    choose_limit,
    find_free_place,
    find_poles,
)
from fourbar.show.plot.figures import FIGURES, TAKERS, draw_figure
from fourbar.show.plot.film import choose_frames
from fourbar.show.plot.frames import Stage
from fourbar.show.plot.freebody import list_actions
from fourbar.show.plot.labels import Label, Labels
from fourbar.show.plot.linkage import draw_mechanism
from fourbar.show.plot.style import INK, shorten_text, write_number
from fourbar.show.plot.view import CLEAR, choose_common_position, make_view, set_branch
from fourbar.show.units import choose_unit
from tests.support.scenes import crank_rocker, thesis
from tests.support.shares import slow_but

SIGNATURES = {"svg": b"<?xml", "png": b"\x89PNG", "pdf": b"%PDF"}
BALANCE = 1e-12
"""Force and moment sums of a free body, relative to their largest term: a few tens of
roundings.
"""


BESIDE_A_CHORD = 150.0**-2
"""Of a path's extent: a chord of a 150th leaves a curve whose radius is an eighth by
that.
"""
TOUCH = 1.0
"""Boxes of texts may share this many pixels: a box is wider than its ink."""


WHOLE_PIXEL = 1.0
"""A film puts its labels at whole pixels."""
GALLERY = Path(__file__).parents[4] / "models" / "gallery"
GALLERY = Path(__file__).parents[4] / "models" / "gallery"
FULL_TURN = Sweep(0.0, 2 * math.pi, 360)


CRANK_ROCKER = crank_rocker()


@cache
def composed(scene, name, branches="one", units="SI", **options):
    """A figure of a scene, composed once for all that look at it."""
    units = fourbar.units(units)
    return draw_figure(scene, name, branches=branches, units=units, **options).figure


def compose_both(name):
    """A figure of both branches with all that it takes, drawn once."""
    options = {"position": radians(77.7), "dimensions": True}
    taken = {key: value for key, value in options.items() if name in TAKERS[key]}
    return composed(CRANK_ROCKER, name, "both", "mm", **taken)


@pytest.mark.slow
@pytest.mark.parametrize("file_format", plot.FORMATS)
def test_the_same_scene_gives_the_same_bytes(tmp_path, file_format):
    files = [tmp_path / f"{k}.{file_format}" for k in (1, 2)]
    for path in files:
        plot.draw(crank_rocker(), path, "torque")
    first, second = (path.read_bytes() for path in files)
    assert first.startswith(SIGNATURES[file_format])
    assert first == second
    assert sorted(tmp_path.iterdir()) == files  # nothing half-written


def texts_shown(figure):
    """Every text that reaches the paper, with its box in pixels."""
    renderer = figure.canvas.get_renderer()
    off_axis = set()
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks()):
                if not axes.axison or not low - 1e-9 <= tick.get_loc() <= high + 1e-9:
                    off_axis |= {tick.label1, tick.label2}
        if not axes.axison:
            off_axis |= {axes.xaxis.label, axes.yaxis.label}
    texts = figure.findobj(lambda artist: isinstance(artist, Text))
    shown = [
        t
        for t in texts
        if t.get_visible() and t.get_text().strip() and t not in off_axis
    ]
    return [(t.get_text(), t.get_window_extent(renderer)) for t in shown]


def clashes(figure):
    """Texts that cover each other."""
    texts = texts_shown(figure)
    return [
        (p, q)
        for k, (p, a) in enumerate(texts)
        for q, b in texts[k + 1 :]
        if min(a.x1, b.x1) - max(a.x0, b.x0) > TOUCH
        and min(a.y1, b.y1) - max(a.y0, b.y0) > TOUCH
    ]


def require_clear_texts(figure):
    """No text covers another one or leaves the page."""
    texts, page = texts_shown(figure), figure.bbox
    assert len(texts) > 5
    for text, box in texts:
        assert page.x0 <= box.x0 and box.x1 <= page.x1, text
        assert page.y0 <= box.y0 and box.y1 <= page.y1, text
    assert not clashes(figure)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(set(FIGURES) - {"energy", "stroke"}))
def test_every_figure_draws_both_branches_alike_and_no_texts_overlap(name):
    """A position and dimensions show where they are taken; panels share scales."""
    figure = compose_both(name)
    words = " ".join(text for text, _ in texts_shown(figure))
    assert ("77.7°" in words) == (name in TAKERS["position"])
    assert ("2: 100 mm" in words) == (name in TAKERS["dimensions"])
    require_clear_texts(figure)
    half = len(figure.axes) // 2
    assert half and len(figure.axes) == 2 * half
    for panel, twin in zip(figure.axes[:half], figure.axes[half:], strict=True):
        # free bodies move their window with the bar: its width is the scale
        ends = [np.array([axes.get_xlim(), axes.get_ylim()]) for axes in (panel, twin)]
        if name in ("overview", "coupler", "hodograph") and panel.axison:
            assert_allclose(ends[0], ends[1], rtol=1e-9)
        if name in ("overview", "coupler", "hodograph", "freebody"):
            assert_allclose(np.diff(ends[0]), np.diff(ends[1]), rtol=1e-9)
            assert panel.get_ylabel() == twin.get_ylabel()


@pytest.mark.slow
@pytest.mark.parametrize("name", ("overview", "coupler", "freebody"))
def test_no_texts_of_a_position_of_three_rockers_overlap(name):
    require_clear_texts(composed(thesis(), name))


def compose_gallery(name, dimensions=True):
    """The axes of a linkage of the gallery, and a function that finds its lines."""
    scene = load(GALLERY / f"{name}.toml")
    (axes,) = draw_figure(scene, "linkage", dimensions=dimensions).figure.axes

    def paths(is_wanted):
        return [
            line.get_path().transformed(axes.transData)
            for line in axes.lines
            if is_wanted(line)
        ]

    return axes, paths


@pytest.mark.parametrize(
    "name, dimensions",
    slow_but(
        {("landing_gear", True)},
        [("tailgate", True), ("landing_gear", True), ("double_crank_pump", False)],
    ),
)
def test_a_leader_crosses_neither_a_text_nor_another_leader(name, dimensions):
    axes, paths = compose_gallery(name, dimensions)
    leaders = paths(lambda line: line.get_zorder() == 8.5)
    boxes = [text.get_window_extent() for text in axes.texts]
    assert len(leaders) > 1
    assert not any(leader.intersects_bbox(box) for leader in leaders for box in boxes)
    assert not any(one.intersects_path(two) for one, two in combinations(leaders, 2))


@pytest.mark.slow
def test_no_text_stands_on_a_bar():
    scene = load(Path(__file__).parents[4] / "models" / "gallery" / "hoecken.toml")
    figure = draw_figure(scene, "linkage", dimensions=True).figure
    (axes,) = figure.axes
    bars = [
        line.get_path().transformed(axes.transData)
        for line in axes.lines
        if line.get_linewidth() > 4.0
    ]
    boxes = [
        text.get_window_extent().padded(2.25 * figure.dpi / 72.0) for text in axes.texts
    ]
    assert len(bars) == 3 and len(boxes) > 8
    assert not any(
        bar.intersects_bbox(box, filled=False) for bar in bars for box in boxes
    )


@pytest.mark.slow
def test_every_axis_of_theta_2_is_in_degrees_and_every_axis_has_a_unit():
    turn = np.degrees([0.1, 0.1 + math.tau])
    flat = [axes for axes in compose_both("overview").axes if axes.name != "polar"]
    assert len(flat) == 2 * 8
    for axes in flat:
        assert axes.get_xlabel().endswith(")") and axes.get_ylabel().endswith(")")
        if "theta_2" in axes.get_xlabel():
            assert axes.get_xlabel().endswith("(°)")
            assert axes.get_xlim() == approx(turn)


@pytest.mark.slow
@pytest.mark.parametrize(
    "figure, at_rest, moving", [("overview", 5, 8), ("kinematics", 1, 3)]
)
def test_positions_at_rest_have_no_panel_of_zeros(figure, at_rest, moving):
    """With a speed there are speeds, accelerations and power besides."""
    for speed, panels in ((0.0, at_rest), (1.0, moving)):
        motion = Motion(Sweep(1.0, 2.0, 10), speed)
        axes = composed(replace(CRANK_ROCKER, motion=motion), figure).axes
        labels = " ".join(one.get_ylabel() for one in axes)
        assert len(axes) == panels
        assert ("rad/s" in labels) == (speed > 0.0)


def solved(scene):
    """At the positions of a scene, and those that a figure shows between them."""
    return describe_motion(solve(scene)).solve_with_peaks()


@pytest.mark.slow
def test_drawn_curves_are_those_of_the_solution():
    scene = crank_rocker()
    solution = solved(scene)
    axes = composed(scene, "kinematics").axes
    drawn = {
        line.get_label(): line.get_ydata() for panel in axes for line in panel.lines
    }
    assert_allclose(drawn[r"$\theta_4$"], np.degrees(solution.theta_4))
    assert_allclose(drawn[r"$\omega_3$"], solution.omega_3)
    assert_allclose(drawn[r"$\alpha_4$"], solution.alpha_4)
    torque = composed(scene, "torque").axes[0]
    assert torque.get_ylabel() == "$T_2$ (mN m)"
    assert_allclose(torque.lines[1].get_ydata(), 1e3 * solution.torque)


def test_bars_are_drawn_to_scale_at_the_requested_position():
    axes = composed(crank_rocker(), "linkage", position=1.3).axes[0]
    bars = [
        np.diff(line.get_xydata(), axis=0)[0]
        for line in axes.lines
        if line.get_linewidth() == 4.5
    ]
    lengths = [math.hypot(*bar) for bar in bars]
    assert lengths == approx([100.0, 250.0, 220.0])  # mm
    assert math.atan2(*bars[0][::-1]) == approx(1.3)
    assert axes.get_aspect() == 1.0


@pytest.mark.slow
def test_the_coupler_figure_shows_the_points_of_the_scene():
    scene = crank_rocker(points=(Point("P", 3, (0.15, 0.7)), Point("Q", 4, (0.1, 0.0))))
    (axes,) = draw_figure(scene, "coupler", units=fourbar.units("m")).figure.axes
    curves = {
        line.get_label(): line.get_xydata()
        for line in axes.lines
        if line.get_label()[0] != "_"
    }
    assert list(curves) == ["$A$", "$B$", "P"]  # Q belongs to the output
    # each solved position lies on the finer path: beside one of its chords
    path = np.asarray(curves["P"])
    starts, chords = path[:-1], np.diff(path, axis=0)
    extent = np.ptp(path, axis=0).max()
    for place in solved(scene).points["P"]:
        along = np.sum((place - starts) * chords, axis=1) / np.sum(chords**2, axis=1)
        nearest = starts + np.clip(along, 0.0, 1.0)[:, None] * chords
        assert np.hypot(*(nearest - place).T).min() < BESIDE_A_CHORD * extent


@pytest.mark.slow
def test_free_bodies_say_their_position_and_couples_have_an_arrow_and_no_sign():
    figure = composed(crank_rocker(), "freebody", position=radians(135.0))
    lines = [text for text, _ in texts_shown(figure) if text[0] in "↺↻"]
    assert lines and not any(" = −" in line for line in lines)
    assert " ".join(figure.subfigs[0].get_supxlabel().split()).startswith(
        "At θ₂ = 135°. "
    )


@pytest.mark.slow
def test_the_sensitivities_have_the_units_asked_for_and_whole_names():
    panels = composed(crank_rocker(), "sensitivity", units="imperial").axes
    assert [axes.get_xlabel() for axes in panels[:2]] == ["lbf in", "lbf"]
    largest = np.abs(solve(crank_rocker()).torque).max() / 0.112984829
    assert f"{largest:.3g} lbf in" in panels[0].texts[0].get_text()


@pytest.mark.slow
def test_positions_that_do_not_assemble_leave_a_gap_and_poles_cut_the_line():
    sweep = make_view(thesis(FULL_TURN)).sweep
    figure = composed(thesis(FULL_TURN), "torque")
    panel = figure.axes[0]
    curve = panel.lines[1]
    closed = np.degrees(sweep.theta_2[~sweep.assembled])
    assert closed.size > 30
    at_closed = np.isin(curve.get_xdata(), closed)
    assert np.all(np.isnan(curve.get_ydata()[at_closed]))
    (pole,) = find_poles(make_view(thesis(FULL_TURN)))
    # the torque of bar 4 diverges where omega_4 changes sign, bars 2 and 3 being in
    # line
    for values in (sweep.omega_4, sweep.torque):
        assert values[pole] * values[pole + 1] < 0
    assert np.isnan(break_at_poles(sweep.torque, np.array([pole]))[pole + 1])
    assert panel.get_ylim()[1] < np.nanmax(np.abs(sweep.torque))
    words = " ".join(text.get_text() for text in figure.findobj(Text))
    assert "Torque clipped at" in words.replace("\n", " ")


def test_an_ordinary_curve_is_not_clipped():
    assert choose_limit([np.sin(np.linspace(0, 6, 100))]) is None
    assert choose_limit([1.0 / np.linspace(-1, 1, 100)]) is not None
    assert choose_limit([np.full(3, np.nan)]) is None


def find_marks(figure):
    """Where a curve has marks, by the first word of their label."""
    (axes,) = figure.axes
    return {
        line.get_label().split(":")[0]: np.sort(line.get_xdata())
        for line in axes.lines
        if line.get_marker() in "sD"
    }


@pytest.mark.slow
@pytest.mark.parametrize("branch", [1, -1])
def test_transmission_angle_marks_limits_and_dead_centres(branch):
    """By the law of cosines about the ground's direction of 45 deg."""
    d, a, b, c = thesis().linkage.lengths

    def angle(first, second, opposite):
        cosine = (first**2 + second**2 - opposite**2) / (2.0 * first * second)
        return math.degrees(math.acos(cosine))

    marks = find_marks(composed(set_branch(thesis(FULL_TURN), branch), "transmission"))
    # bars 3 and 4 folded: |b - c| between A and O4
    limit = angle(a, d, b - c)
    assert marks["limit"] == approx(np.sort([45 - limit, 45 + limit]), abs=1e-9)
    # bars 2 and 3 folded: c seen from O2 at b - a, A on the other side
    dead_centre = 45 + 180 + branch * angle(b - a, d, c)
    assert marks["dead centre"] % 360 == approx([dead_centre % 360], abs=1e-9)


SPRUNG = ((1, 3), (2, 3), (4, 3))
EFFECTS = (
    Gravity(),
    Viscous.at(A=0.02, O4=0.01),
    fourbar.Friction.at(B=0.03),
    PinFriction.at(A=(0.2, 0.01), O4=(0.1, 0.02)),
    Torsion.at(B=(0.5, 1.0, 0.1)),
    Springs(
        tuple(
            Spring(Place(i, (0.1, -1.5)), Place(j, (0.08, 0.2)), 50.0, 0.05)
            for i, j in SPRUNG
        )
    ),
    Flywheel(0.01, 4),
)


CYLINDER = LinearDrive(Place(2, (0.17, -1.1)), Place(4, (0.09, 0.7)))


BETWEEN_NEIGHBOURS = LinearDrive(Place(2, (0.17, -1.1)), Place(3, (0.09, 0.7)))


@pytest.mark.parametrize(
    "drive, effects",
    [
        *((drive, EFFECTS) for drive in (2, 3, 4, CYLINDER, BETWEEN_NEIGHBOURS)),
        *((3, (one,)) for one in EFFECTS),
    ],
)
def test_free_bodies_balance(drive, effects):
    drive_bar, line = (drive, None) if isinstance(drive, int) else (None, drive)
    shown = make_view(crank_rocker(drive_bar=drive_bar, drive=line, effects=effects))
    for bar in (2, 3, 4):
        arrows, couples = list_actions(shown, bar)
        forces = np.array([arrow.force for arrow in arrows])
        assert np.abs(forces.sum()) <= BALANCE * np.abs(forces).max()
        moments = [(a.at.conjugate() * a.force).imag for a in arrows] + [
            c.moment for c in couples
        ]
        assert abs(sum(moments)) <= BALANCE * max(map(abs, moments))
        assert any(c.text == f"$T_{bar}$" for c in couples) == (bar == drive_bar)


@pytest.mark.slow
def test_a_linear_drive_is_drawn_with_its_force_and_the_poles_of_that():
    scene = crank_rocker(drive=CYLINDER)
    for figure in ("torque", "freebody"):
        assert not clashes(composed(scene, figure))
    shown = make_view(scene)
    stands = np.flatnonzero(np.diff(np.sign(shown.sweep.stroke_speed)))
    assert len(stands) and np.array_equal(find_poles(shown), stands)


@pytest.mark.slow
def test_a_file_has_a_dark_form_and_a_figure_within_a_page_leaves_the_page(tmp_path):
    drawing = draw_figure(crank_rocker(), "torque")
    drawing.save(tmp_path / "a.svg")
    written = (tmp_path / "a.svg").read_text(encoding="utf-8")
    assert "@media (prefers-color-scheme: dark)" in written and "svg:root" in written
    assert "prefers-color-scheme" not in drawing._repr_svg_()


@pytest.mark.slow
@pytest.mark.parametrize("turned", (False, True), ids=("up", "down"))
def test_the_peak_of_the_torque_is_marked_with_its_value(turned):
    scene = crank_rocker()
    if turned:  # speed changes sign, and so does the angle at which friction acts
        scene = replace(scene, motion=scene.motion.replace(speed=-10.0))
    torque = 1e3 * solved(scene).torque
    peak = torque[np.abs(torque).argmax()]
    figure = composed(scene, "torque")
    (ring,) = (line for line in figure.axes[0].lines if line.get_marker() == "o")
    assert ring.get_ydata()[0] == approx(peak)
    words = [text.get_text() for text in figure.findobj(Text)]
    assert f"{write_number(peak)} mN m" in words
    place = f"{math.degrees(make_view(scene).here.theta_2[0]):.4g}°"
    assert any(f"Dashed upright line: θ₂\u00a0=\u00a0{place}" in word for word in words)


def test_a_scene_without_velocity_draws_positions_only(tmp_path):
    scene = crank_rocker(motion=Motion(Sweep(0.0, 6.0, 30)))
    assert len(composed(scene, "kinematics").axes) == 1
    with raises(InputError, match="omega_2"):
        plot.draw(scene, tmp_path / "b.svg", "torque")
    assert not (tmp_path / "b.svg").exists()


@pytest.mark.slow
def test_the_position_drawn_of_both_branches_is_one_and_clear_of_their_poles():
    """The two poles leave no position clear of both by more than 0.25."""
    scenes = [set_branch(thesis(FULL_TURN), sign) for sign in (1, -1)]

    def quality(view, here="here"):
        positions = getattr(view, here)
        return np.fmin(positions.condition, positions.drive_condition)

    of_both = np.fmin(*(quality(make_view(scene), "sweep") for scene in scenes))
    best = min(CLEAR, float(np.nanmax(of_both)))
    assert best > 0.2
    position = choose_common_position(scenes)
    for scene in scenes:
        assert quality(make_view(scene, position))[0] >= best
    # the position of the open branch alone is a pole of the crossed one
    alone = make_view(scenes[0])
    assert quality(alone)[0] >= CLEAR
    of_open = float(alone.here.theta_2[0])
    assert quality(make_view(scenes[1], of_open))[0] < CLEAR
    axes = composed(thesis(FULL_TURN), "linkage", "both").axes
    assert len({one.get_title(loc="left").split(",")[0] for one in axes}) == 1


def test_a_remark_stands_where_the_curve_keeps_away():
    share = np.linspace(0.0, 1.0, 361)
    for mu, low, high in (
        (90.0 * np.sin(np.pi * share), 0.3, 0.7),
        (90.0 * share, 0.6, 1.0),
        (90.0 - 90.0 * share, 0.0, 0.4),
    ):
        assert low <= find_free_place(mu) <= high
    assert 0.0 < find_free_place(np.full(361, np.nan)) < 1.0


@pytest.mark.slow
def test_hostile_titles_are_text(tmp_path):
    title = "$\\frac{ <script>alert(1)</script> & \x1b[31m\u2028 %s {0} " + 300 * "x"
    plot.draw(replace(crank_rocker(), title=title), tmp_path / "a.svg", "torque")
    assert "<script" not in (tmp_path / "a.svg").read_text(encoding="utf-8")
    assert len(shorten_text(title, 50)) == 50


@pytest.mark.parametrize(
    "name, options",
    [
        ("a.bmp", {}),
        ("a.png", {"figure": "pie"}),
        ("a.png", {"branches": "all"}),
        *(
            ("a.png", {"figure": figure, "position": 1.0})
            for figure in ("hodograph", "sensitivity")
        ),
        *(
            ("a.png", {"figure": figure, "dimensions": True})
            for figure in ("torque", "coupler", "freebody")
        ),
    ],
)
def test_what_is_not_allowed_is_named(tmp_path, name, options):
    with raises(InputError, match="must"):
        plot.draw(crank_rocker(), tmp_path / name, **options)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_threads_draw_what_one_draws_and_leave_the_settings_as_they_were():
    drawn = crank_rocker().plot("torque")._repr_svg_()
    before = dict(matplotlib.rcParams)
    with ThreadPoolExecutor(2) as pool:
        assert set(
            pool.map(lambda _: crank_rocker().plot("torque")._repr_svg_(), range(2))
        ) == {drawn}
    assert dict(matplotlib.rcParams) == before


def test_a_position_that_does_not_assemble_is_refused(tmp_path):
    with raises(NotAssembledError, match="45 deg"):
        plot.draw(thesis(), tmp_path / "a.png", "linkage", position=radians(45.0))


def released(steps=300, duration=0.6, **changes):
    """The crank-rocker let go from rest under gravity, a load and damping."""
    motion = Motion(0.5, 0.0, free=Free(duration, steps))
    parts = {
        "motion": motion,
        "effects": (Gravity(), Viscous.at(O2=0.002, B=0.001)),
        **changes,
    }
    return crank_rocker(**parts)


def by_law():
    law = Law((0.0, 1.0, 2.0), (0.3, 2.0, 1.0), ends="rest")
    return crank_rocker(motion=Motion(law=law), drive_bar=4)


@pytest.mark.slow
@pytest.mark.parametrize(
    "scene", (released(20, 1.2), by_law()), ids=("released", "by law")
)
def test_a_motion_through_time_is_drawn_over_time(scene):
    solution = solved(scene)
    drawn = {
        line.get_label(): line
        for panel in composed(scene, "kinematics").axes
        for line in panel.lines
    }
    for name, values in (
        (r"$\theta_2$", np.degrees(solution.theta_2)),
        (r"$\omega_4$", solution.omega_4),
    ):
        assert_allclose(drawn[name].get_xdata(), solution.time)
        assert_allclose(drawn[name].get_ydata(), values)
    free = scene.motion.free is not None
    for name in ("overview", "energy") if free else ("torque",):
        figure = composed(scene, name)
        assert not clashes(figure), name
        flat = [
            axes for axes in figure.axes if axes.name == "rectilinear" and axes.axison
        ]
        assert all(axes.get_xlabel().endswith(("(s)", "m)")) for axes in flat)


@pytest.mark.slow
def test_both_branches_of_a_release_share_their_scales():
    bars = [Bar(0.22, 0.5), Bar(0.25, 0.8), Bar(0.2, 0.4)]
    motion = Motion(radians(60.0), 0.0, free=Free(0.3, 30))
    linkage = fourbar.FourBar(0.3, *bars)
    scene = fourbar.Scene(linkage, motion, effects=(Gravity(),))
    solutions = [solve(set_branch(scene, sign)) for sign in (1, -1)]
    fastest = [np.abs(solution.omega_4).max() for solution in solutions]
    assert abs(fastest[0] - fastest[1]) > 0.1 * max(fastest)  # alone each has its own
    for name in ("kinematics", "energy"):
        axes = composed(scene, name, "both").axes
        scales = [
            (one.get_xlim(), one.get_ylim(), one.get_xlabel(), one.get_ylabel())
            for one in axes
        ]
        half = len(axes) // 2
        assert scales[:half] == scales[half:]


@pytest.mark.slow
def test_the_position_of_a_motion_through_time_is_one_that_it_passes(tmp_path):
    shown = make_view(released(), position=0.3)
    k = int(np.argmin(np.abs(shown.sweep.theta_2 - 0.3)))
    assert shown.here.time[0] == shown.sweep.time[k]
    assert shown.here.F12[0] == approx(shown.sweep.F12[k])
    with raises(NotAssembledError, match="does not pass"):
        plot.draw(released(), tmp_path / "a.svg", position=9.0)


ENERGY = 1e-6
"""Of the work against the kinetic energy, relative: the spline's (dt omega)^4, its
instants 2 ms apart.
"""


@pytest.mark.slow
def test_the_work_of_what_acts_is_the_kinetic_energy():
    damped = Viscous.at(O2=0.002, B=0.001)
    scene = released(effects=(Gravity(), damped, Flywheel(0.01, 4)))
    motion = solve(scene)
    energies = compute_energies(scene, motion)
    assert set(energies.work) == {"loads", "gravity", "viscous"}
    linkage = scene.linkage
    place = compute_state(linkage, motion.theta_2, motion.branch)
    bodies = list_bodies(linkage, scene.effects)
    parts = inertia(linkage.input.length, bodies, place.position, place.k)
    expected = 0.5 * sum(parts) * motion.omega_2**2
    assert_allclose(energies.kinetic, expected, rtol=1e-9, atol=1e-15)
    largest = energies.kinetic.max()
    assert largest > 0.1
    assert np.all(np.diff(energies.work["viscous"]) <= 0.0)
    done = sum(energies.work.values())
    assert_allclose(done, energies.kinetic, atol=ENERGY * largest)
    panel = composed(scene, "energy").axes[0]
    assert panel.get_ylabel() in ("energy (J)", "energy (mJ)")


def test_figures_that_a_motion_does_not_have_are_refused_in_one_line(tmp_path):
    for scene, figure in (
        (released(), "torque"),
        (crank_rocker(), "energy"),
        (by_law(), "energy"),
    ):
        with raises(InputError, match="free motion"):
            plot.draw(scene, tmp_path / "a.svg", figure)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_matplotlib_is_loaded_only_to_draw_and_its_absence_is_one_line(tmp_path):
    code = """
import sys, fourbar.show.plot, fourbar.show.animate
assert 'matplotlib' not in sys.modules
sys.modules['matplotlib'] = None
from tests.support.scenes import crank_rocker
try:
    fourbar.show.plot.draw(crank_rocker(), sys.argv[1])
except fourbar.errors.DependencyError as error:
    print(error)
"""
    command = [sys.executable, "-c", code, str(tmp_path / "a.png")]
    said = subprocess.check_output(command, text=True)
    assert said == 'drawing needs matplotlib: pip install ".[plot]" in the checkout\n'


@pytest.mark.parametrize(
    "value, shown",
    [
        (0.0, "0"),
        (-1234.6, "−1235"),
        (0.012345, "0.0123"),
        (3.09312, "3.09"),
        (2.5e7, "2.50·10⁷"),
        (-3.12e-14, "−3.12·10⁻¹⁴"),
    ],
)
def test_numbers_have_three_digits(value, shown):
    assert write_number(value) == shown


def test_units_get_the_prefix_that_suits():
    assert choose_unit(0.94, "N m") == (1e3, "mN m")
    assert choose_unit(15218.0, "N m") == (1e-3, "kN m")
    assert choose_unit(0.0, "N") == (1.0, "N")


BOTTOM, SIDE = Place(1, (0.25, radians(-160.0))), Place(2, (0.09, 0.17))
COMMANDS = {
    r"$\theta_3$ (°)": Motion(theta_3=Sweep(1.25, 0.67, 40), omega_3=-2.0),
    r"$\theta_4$ (°)": Motion(theta_4=Sweep(1.95, 2.78, 40), omega_4=4.0),
    "stroke (mm)": Motion(stroke=Sweep(0.2, 0.32, 40), stroke_speed=0.2, side="left"),
}
"""Each command and the name of the axis that curves are drawn over."""


DRAWN = 2e-2
"""Of a curve between its points, where it is not near a pole."""
GREEK = {"theta_3": "θ₃", "theta_4": "θ₄"}


DRAWN = 2e-2
"""Of a curve between its points, where it is not near a pole."""
GREEK = {"theta_3": "θ₃", "theta_4": "θ₄"}


def commanding(motion):
    return crank_rocker(
        motion=motion,
        drive=LinearDrive(BOTTOM, SIDE),
        effects=(Gravity(),),
    )


def longest_line(axes):
    return max(axes.lines, key=lambda line: len(line.get_xdata()))


@pytest.mark.slow
@pytest.mark.parametrize("label", COMMANDS)
def test_curves_are_drawn_over_what_is_commanded(label):
    scene = commanding(COMMANDS[label])
    s, name = solve(scene), scene.motion.commanded
    over = getattr(s, name) * (1000.0 if name == "stroke" else 180.0 / math.pi)
    (drive,) = panels = composed(scene, "torque").axes
    if name == "stroke":
        overview = composed(scene, "overview").axes
        panels += [axes for axes in overview if axes.get_xlabel() != "$x$ (mm)"]
        assert len(panels) == 8
    for axes in panels:
        assert axes.get_xlabel() == label
        assert axes.get_xlim() == approx((over.min(), over.max()))
    x, y = longest_line(drive).get_data()
    drawn = np.isfinite(y)
    order = np.argsort(over)
    force = s.drive_force[order]
    at_positions = np.interp(over[order], x[drawn], y[drawn])
    usual = np.abs(force) < np.percentile(np.abs(force), 80.0)
    assert_allclose(at_positions[usual], force[usual], rtol=DRAWN, atol=DRAWN)
    (linkage,) = composed(scene, "linkage").axes
    place = getattr(make_view(scene).here, name)[0]
    if name == "stroke":
        stated = f"stroke = {1000.0 * place:.4g} mm"
    else:
        stated = f"{GREEK[name]} = {math.degrees(place):.4g}°"
    assert stated in linkage.get_title(loc="left")


@pytest.mark.slow
@pytest.mark.parametrize(
    "figure, label",
    [
        *zip(
            ("freebody", "hodograph", "transmission", "kinematics", "sensitivity"),
            cycle(COMMANDS),
            strict=False,
        )
    ],
)
def test_figures_take_every_command(figure, label):
    assert not clashes(composed(commanding(COMMANDS[label]), figure))


@pytest.mark.parametrize(
    "scene", (thesis(), *map(commanding, COMMANDS.values())), ids=("thesis", *COMMANDS)
)
def test_a_film_of_what_swings_goes_there_and_back(scene):
    sweep = make_view(scene).sweep
    order = choose_frames(make_view(scene), 40)
    closes = np.flatnonzero(sweep.assembled)
    assert (np.diff(sweep.at.places) > 0.0).all() and sweep.assembled[order].all()
    assert len(order) == 38 and order[-1] > order[0]
    assert (order[0], order[19]) == (closes[0], closes[-1])
    assert (np.diff(order[:20]) > 0).all() and (np.diff(order[19:]) < 0).all()


def test_a_film_of_what_turns_goes_round():
    assert np.all(np.diff(choose_frames(make_view(CRANK_ROCKER), 30)) == 2)


def test_one_position_of_another_command_stands_in_its_range():
    single = COMMANDS["stroke (mm)"].replace(angle=0.3)
    shown = make_view(commanding(single))
    assert shown.at == "stroke = 300 mm"
    assert shown.here.stroke[0] == approx(0.3, rel=1e-14)
    places = shown.sweep.at.places
    # the cylinder's shortest and longest stroke
    assert places.min() > 0.16 and places.max() < 0.34 and len(places) == 362
    shown = make_view(commanding(Motion(theta_4=2.0, omega_4=1.0)))
    ranges = find_intervals(CRANK_ROCKER.linkage, 4)
    (low, high) = next(ends for ends in ranges if ends[0] < 2.0 + math.tau < ends[1])
    assert shown.sweep.theta_4.min() > low and shown.sweep.theta_4.max() < high
    assert shown.at == "θ₄ = 114.6°"


@pytest.mark.parametrize("bar", slow_but({3}, [2, 3]))
def test_dead_centres_stand_where_the_bars_are_in_line_on_every_axis(bar):
    """Bars 2 and 3 stretched: cosine rule for O2, B, O4, where theta_3 = theta_2."""
    d, a, b, c = CRANK_ROCKER.linkage.lengths
    cosine = ((a + b) ** 2 + d * d - c * c) / (2.0 * (a + b) * d)
    stretched = math.degrees(CRANK_ROCKER.linkage.ground_angle + math.acos(cosine))
    sweep = {f"theta_{bar}": Sweep(0.7, 1.25, 40), f"omega_{bar}": 1.0}
    figure = composed(commanding(Motion(**sweep)), "transmission")
    assert find_marks(figure)["dead centre"] == approx([stretched])


def test_a_cylinder_keeps_its_barrel_and_its_rod_comes_out():
    shown = make_view(commanding(COMMANDS["stroke (mm)"]))
    lengths = []
    for index in (0, 20, 40):
        axes = Figure().subplots()
        draw_mechanism(axes, shown, shown.sweep, index, Labels())
        (barrel,) = (
            line
            for line in axes.lines
            if line.get_linewidth() == 4.5 and line.get_color() == INK
        )
        lengths.append(np.hypot(*np.ptp(np.array(barrel.get_data()), axis=1)))
    assert np.ptp(lengths) < 1e-9 * lengths[0]
    assert lengths[0] < 1000.0 * shown.sweep.stroke.min()


@pytest.mark.slow
def test_the_stroke_is_a_figure_where_it_is_not_the_axis():
    scene = commanding(COMMANDS[r"$\theta_4$ (°)"])
    (axes,) = composed(scene, "stroke").axes
    s = solve(scene)
    drawn = np.interp(np.degrees(s.theta_4), *longest_line(axes).get_data())
    assert_allclose(drawn, 1000.0 * s.stroke, rtol=1e-14)
    for refused in (CRANK_ROCKER, commanding(COMMANDS["stroke (mm)"])):
        with raises(InputError, match="needs a linear drive"):
            draw_figure(refused, "stroke")


def test_the_name_of_a_ring_stands_beyond_it_in_a_film():
    axes = Figure().subplots(subplot_kw={"xlim": (-10.0, 10.0)})
    stage = Stage(axes)

    def corner(ring):
        label = Label(axes, "flywheel", (0.0, 0.0), (-1.0, 0.0), ring=ring)
        return stage.add_label(label)._corner

    centre, ring = axes.transData.transform([(0.0, 0.0), (4.0, 0.0)])
    beyond = np.subtract(corner(4.0), corner(0.0))
    assert beyond == approx(ring - centre, abs=WHOLE_PIXEL)
