"""Drawings: what they show against the formulas.

Nothing may overlap, and they must reach the file atomically.
"""

import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache
from itertools import cycle, product
from math import atan2, degrees, pi, radians, tau

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.text import Text
from numpy.testing import assert_allclose
from pytest import approx, mark, raises

import fourbar
from fourbar import (
    Flywheel,
    FourBarError,
    Free,
    Friction,
    Gravity,
    Law,
    LinearDrive,
    Motion,
    Place,
    Point,
    Scene,
    Sweep,
    Torsion,
    Viscous,
    load,
    solve,
)
from fourbar.files import loads
from fourbar.formulas.mobility import find_intervals, limit_positions
from fourbar.show import duty, motion_curves, plot
from fourbar.show.plot import curves, film, freebody, linkage_figure, style
from fourbar.show.plot.figures import FIGURES, WITH_DIMENSIONS, draw_figure
from fourbar.show.plot.view import CLEAR, make_view, set_branch
from fourbar_validation.places import MODELS
from tests.support.rows import read_rows, slow_but
from tests.support.scenes import (
    CYLINDER,
    RESTING,
    UNIFORM_PARALLELOGRAM,
    WEIGHT,
    crank_rocker,
    recommand,
    thesis,
)
from tests.support.texts import EVERYTHING

SIGNATURES = {"svg": b"<?xml", "png": b"\x89PNG", "pdf": b"%PDF"}

BALANCE = 1e-12
"""Force and moment sums of a free body, relative to their largest term: a few tens of
roundings.
"""


TOUCH = 1.0
"""Boxes of texts may share this many pixels: a box is wider than its ink."""


CRANK_ROCKER = crank_rocker()
THREE_ROCKERS = thesis(Sweep(0.0, 2 * pi, 360))

BETWEEN_CRANKS = LinearDrive(Place(2, (0.17, -1.1)), Place(4, (0.09, 0.7)))

COMMANDS = {
    r"$\theta_3$ (°)": Motion(theta_3=Sweep(1.25, 0.67, 40), omega_3=-2.0),
    r"$\theta_4$ (°)": Motion(theta_4=Sweep(1.95, 2.78, 40), omega_4=4.0),
    "stroke (mm)": Motion(stroke=Sweep(0.2, 0.32, 40), stroke_speed=0.2, side="left"),
}
"""Each command and the name of the axis that curves are drawn over."""


def commanding(motion):
    return crank_rocker(motion, drive=CYLINDER, effects=WEIGHT)


def released(steps=300, duration=0.6, **changes):
    """The crank-rocker let go from rest under gravity, a load and damping."""
    motion = Motion(0.5, 0.0, free=Free(duration, steps))
    damped = Gravity(), Viscous.at(O2=0.002, B=0.001)
    return crank_rocker(**{"motion": motion, "effects": damped} | changes)


def by_law():
    law = Law((0.0, 1.0, 2.0), (0.3, 2.0, 1.0), ends="rest")
    return crank_rocker(Motion(law=law), drive_bar=4)


@cache
def composed(scene, name, units="SI", **options):
    """A figure of a scene, composed once for all that look at it."""
    units = fourbar.units(units)
    return draw_figure(scene, name, units=units, **options).figure


def solved(scene):
    """At the positions of a scene, and those that a figure shows between them."""
    return motion_curves.describe_motion(solve(scene)).solve_with_peaks()


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
    shown = [
        t
        for t in figure.findobj(lambda artist: isinstance(artist, Text))
        if t.get_visible() and t.get_text().strip() and t not in off_axis
    ]
    return [(t.get_text(), t.get_window_extent(renderer)) for t in shown]


def caption_of(figure):
    """What stands beneath the panels of a figure, in one line."""
    return " ".join(figure.subfigs[0].get_supxlabel().split())


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


@mark.slow
@mark.parametrize("file_format", plot.FORMATS)
def test_the_same_scene_gives_the_same_bytes_in_every_thread(tmp_path, file_format):
    before = dict(matplotlib.rcParams)
    files = [tmp_path / f"{k}.{file_format}" for k in (1, 2, 3)]
    plot.draw(crank_rocker(), files[0], "torque")
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(plot.draw, 2 * [crank_rocker()], files[1:], 2 * ["torque"]))
    (content,) = {path.read_bytes() for path in files}
    assert content.startswith(SIGNATURES[file_format])
    assert sorted(tmp_path.iterdir()) == files  # nothing half-written
    assert dict(matplotlib.rcParams) == before


@mark.slow
def test_a_file_has_a_dark_form_and_a_hostile_title_is_text(tmp_path):
    """A figure within a page leaves its colours to the page."""
    title = "$\\frac{ <script>alert(1)</script> & \x1b[31m\u2028 %s {0} " + 300 * "x"
    drawing = draw_figure(replace(CRANK_ROCKER, title=title), "torque")
    drawing.save(tmp_path / "a.svg")
    written = (tmp_path / "a.svg").read_text(encoding="utf-8")
    assert "@media (prefers-color-scheme: dark)" in written
    assert "<script" not in written
    assert "prefers-color-scheme" not in drawing._repr_svg_()
    assert len(style.shorten_text(title, 50)) == 50


@mark.slow
@mark.parametrize("name", sorted(set(FIGURES) - {"energy", "stroke"}))
def test_every_figure_shows_what_it_takes_and_no_texts_overlap(name):
    """A position shows, dimensions where they are taken; panels share scales.

    No text leaves the page.
    """
    dimensions = name in WITH_DIMENSIONS
    taken = {"position": radians(77.7), "dimensions": dimensions}
    figure = composed(CRANK_ROCKER, name, "mm", **taken)
    texts = texts_shown(figure)
    words = " ".join(text for text, _ in texts)
    assert "77.7°" in words and ("2: 100 mm" in words) == dimensions
    page = figure.bbox
    for text, box in texts:
        assert page.x0 <= box.x0 and box.x1 <= page.x1, text
        assert page.y0 <= box.y0 and box.y1 <= page.y1, text
    assert len(texts) > 5 and not clashes(figure)
    for panel in figure.axes:
        if name == "overview" and panel.name != "polar":
            assert panel.get_xlabel().endswith(")") and panel.get_ylabel().endswith(")")


CLEAR_FIGURES = [
    *product([thesis()], ["overview", "coupler", "freebody"]),
    *product([crank_rocker(drive=BETWEEN_CRANKS, loads=())], ["torque", "freebody"]),
    *product([released(20, 1.2)], ["overview", "energy"]),
    (by_law(), "torque"),
    *zip(
        map(commanding, cycle(COMMANDS.values())),
        ("freebody", "shaking", "transmission", "kinematics", "points"),
        strict=False,
    ),
]


@mark.slow
@mark.parametrize("scene, name", CLEAR_FIGURES)
def test_no_texts_overlap_whatever_moves(scene, name):
    figure = composed(scene, name)
    assert not clashes(figure)
    if scene.motion.free is not None or scene.motion.law is not None:
        flat = (axes for axes in figure.axes if axes.axison and axes.name != "polar")
        assert all(axes.get_xlabel().endswith(("(s)", "m)")) for axes in flat)


@mark.parametrize(
    "name, dimensions",
    slow_but(
        {("landing_gear", True)},
        [
            ("tailgate", True),
            ("landing_gear", True),
            ("double_crank_pump", False),
            ("hoecken", True),
        ],
    ),
)
def test_no_text_stands_on_a_support_or_a_bar(name, dimensions):
    scene = load(MODELS / f"gallery/{name}.toml")
    figure = draw_figure(scene, "linkage", dimensions=dimensions).figure
    (axes,) = figure.axes
    paths = [(x, x.get_path().transformed(axes.transData)) for x in axes.lines]
    bars = [path for line, path in paths if line.get_linewidth() > 4.0]
    boxes = [text.get_window_extent() for text in axes.texts]
    hatched = [patch.get_window_extent() for patch in axes.patches if patch.get_hatch()]
    assert len(hatched) == 2
    assert not any(box.overlaps(other) for box, other in product(boxes, hatched))
    if name == "hoecken":
        wide = [box.padded(2.25 * figure.dpi / 72.0) for box in boxes]
        assert len(bars) == 3 and len(wide) > 8
        assert not any(
            bar.intersects_bbox(box, False) for bar, box in product(bars, wide)
        )


MOVING = {
    "turn": (CRANK_ROCKER, r"$\theta_2$ (°)"),
    **{label: (commanding(motion), label) for label, motion in COMMANDS.items()},
    "law": (by_law(), "$t$ (s)"),
    "release": (released(20, 1.2), "$t$ (s)"),
}
"""Scenes, and the axis that their curves are drawn over."""


LOCATED = 1e-5
"""Relative: a flat peak is located to the root of round-off."""


@mark.slow
@mark.parametrize("scene, label", MOVING.values(), ids=MOVING)
def test_drawn_curves_are_those_of_the_solution(scene, label):
    """A curve over an angle or a stroke goes from the least one to the greatest."""
    solution = solved(scene)
    over = solution.at.places
    order = np.argsort(over, kind="stable")
    over = over * {"°)": degrees(1.0), "m)": 1000.0, "s)": 1.0}[label[-2:]]
    panels = composed(scene, "kinematics").axes
    lines = {line.get_label(): line for panel in panels for line in panel.lines}
    for name, values in (
        (r"$\theta_4$", np.degrees(solution.theta_4)),
        ("$ω_3$", solution.omega_3),
        ("$α_4$", solution.alpha_4),
        ("$α_2$", solution.alpha_2),
    ):
        if name not in lines:
            assert solution.commanded.endswith(name[-2])
            continue
        assert solution.at.bar != int(name[-2]) or np.any(values)
        assert_allclose(lines[name].get_xdata(), over[order], rtol=LOCATED)
        assert_allclose(lines[name].get_ydata(), values[order], rtol=LOCATED)
    for panel in panels:
        assert panel.get_xlabel() == label
        assert panel.get_xlim() == approx((over.min(), over.max()))


@mark.slow
def test_bars_are_drawn_to_scale_at_the_requested_position():
    axes = composed(crank_rocker(), "linkage", position=1.3).axes[0]
    bars = [
        np.diff(line.get_xydata(), axis=0)[0]
        for line in axes.lines
        if line.get_linewidth() == 4.5
    ]
    assert np.hypot(*np.transpose(bars)) == approx([100.0, 250.0, 220.0])  # mm
    assert atan2(*bars[0][::-1]) == approx(1.3)
    assert axes.get_aspect() == 1.0


@mark.slow
def test_positions_that_do_not_assemble_leave_a_gap_and_poles_cut_the_line():
    """The torque of bar 4 diverges where bars 2 and 3 are in line."""
    sweep = make_view(THREE_ROCKERS).sweep
    figure = composed(THREE_ROCKERS, "torque")
    panel = figure.axes[0]
    x, y = panel.lines[1].get_data()
    closed = np.degrees(sweep.theta_2[~sweep.assembled])
    assert closed.size > 30
    assert np.all(np.isnan(y[np.isin(x, closed)]))
    (pole,) = np.flatnonzero(sweep.omega_4[1:] * sweep.omega_4[:-1] < 0.0)
    assert sweep.torque[pole] * sweep.torque[pole + 1] < 0.0
    places = np.degrees(sweep.theta_2[[pole, pole + 1]])
    (first,) = np.flatnonzero(x == places[0])
    assert np.isnan(x[first + 1]) and np.isnan(y[first + 1])
    assert x[first + 2] == places[1]
    assert panel.get_ylim()[1] < np.nanmax(abs(sweep.torque))
    assert "Torque of the drive on bar 4 clipped at" in caption_of(figure)


def test_the_largest_of_what_is_clipped_may_be_commanded():
    """The law turns bar 2 by 1 rad in 10 ms, the others turn less."""
    law = Law((0.0, 1.0, 1.01, 3.0), (0.1, 0.2, 1.2, 1.3), omega_2=(0.0,) * 4)
    figure = composed(crank_rocker(Motion(law=law)), "kinematics")
    assert "the largest evaluated, ω2 =" in caption_of(figure)


def test_an_ordinary_curve_is_not_clipped():
    assert curves.choose_limit([np.sin(np.linspace(0, 6, 100))]) is None
    assert curves.choose_limit([1.0 / np.linspace(-1, 1, 100)]) is not None
    assert curves.choose_limit([np.full(3, np.nan)]) is None


@mark.parametrize(
    "drive",
    [
        {"drive_bar": 2},
        {"drive_bar": 3},
        {"drive_bar": 4},
        {"drive": BETWEEN_CRANKS},
        {"drive": LinearDrive(Place(2, (0.17, -1.1)), Place(3, (0.09, 0.7)))},
    ],
)
def test_free_bodies_balance(drive):
    shown = make_view(crank_rocker(effects=loads(EVERYTHING).effects, **drive))
    for bar in (2, 3, 4):
        freed = freebody.FreedBar(shown, bar)
        forces = np.array([arrow.force for arrow in freed.arrows])
        assert abs(forces.sum()) <= BALANCE * abs(forces).max()
        moments = [(arrow.at.conjugate() * arrow.force).imag for arrow in freed.arrows]
        moments += [moment for _, moment in freed.couples]
        assert abs(sum(moments)) <= BALANCE * max(map(abs, moments))
        texts = [text for text, _ in freed.couples]
        assert (f"$T_{bar}$" in texts) == (bar == drive.get("drive_bar"))
        at_pins = ("viscous", "friction", "pin friction", "torsion")
        named = [text for text in texts if text.startswith(at_pins)]
        assert named and all(" at $" in text for text in named)


@mark.parametrize("name", ["freebody", "bars", "forces"])
def test_a_figure_says_what_dry_friction_at_rest_leaves_the_drive(name):
    words = caption_of(draw_figure(RESTING, name).figure)
    assert "Dry friction at rest is taken as 0" in words
    torque = 1e3 * solve(RESTING).torque[0]
    ends = f"between {torque - 200.0:.3g} mN m and {torque + 200.0:.3g} mN m"
    assert (ends in words) == (name != "forces"), words


@mark.parametrize("angle, position", [(radians(60.0), None), (None, radians(60.0))])
def test_the_inside_of_bars_is_drawn_at_the_position_that_is_stated(angle, position):
    """Bar 4 hangs between two pins at 60 deg: its moment is m g cos 60 deg c/8."""
    scene = Scene(UNIFORM_PARALLELOGRAM, Motion(angle, 0.0), effects=WEIGHT)
    figure = composed(scene, "bars", position=position)
    moment = 1e3 * UNIFORM_PARALLELOGRAM.output.mass * 9.81 * 0.5 * 0.1 / 8.0
    assert f"Bar 4: largest |M| = {moment:.3g} mN m at x = 50 mm" in caption_of(figure)
    assert all(axes.get_title("left").endswith("60°") for axes in figure.axes[:3])


def test_the_inside_of_bars_is_drawn_beside_a_change_point_with_the_largest_moment():
    """That of bar 4 has no pin forces: m g c/8 at 0 deg."""
    motion = Motion(Sweep(0.0, tau, 12), 1.0)
    words = caption_of(
        composed(Scene(UNIFORM_PARALLELOGRAM, motion, effects=WEIGHT), "bars")
    )
    moment = 1e3 * UNIFORM_PARALLELOGRAM.output.mass * 9.81 * 0.1 / 8.0
    assert f"Bar 4: largest |M| = {moment:.3g} mN m at x = 50 mm" in words
    assert "Pin forces grow without bound" in words


def test_what_stands_at_an_axis_is_whole():
    """A name that is too long for three columns, a power of ten, and a place at 0."""
    points = tuple(Point(30 * name, 3, (0.1, 0.7)) for name in "PQR")
    scene = crank_rocker(Motion(Sweep(-1.0, 1.0, 20), 1e-4), points=points)
    figure = composed(scene, "overview")
    for axes in figure.axes:
        if (legend := axes.get_legend()) is not None:
            assert legend.get_window_extent().x1 <= figure.bbox.x1
    names = [axes.get_ylabel() for axes in figure.axes]
    fastest = np.abs([solve(scene).alpha_3, solve(scene).alpha_4]).max()
    assert f"{fastest:.0e}".endswith("e-09") and "$α$ (10⁻⁹ rad/s²)" in names
    assert "Linkage at θ₂ = 0°" in figure.axes[0].get_title("left")


@mark.parametrize("from_pin", [(0.2, -0.3), (0.15, -0.35)])
def test_a_label_keeps_off_the_arrow_of_gravity_and_the_outline_of_a_path(from_pin):
    scene = crank_rocker(points=(Point("tip", 4, from_pin),))
    (axes,) = composed(scene, "linkage").axes
    boxes = {text.get_text(): text.get_window_extent() for text in axes.texts}
    arrow, *_ = (patch for patch in axes.patches if patch.get_zorder() == 8)
    shaft = arrow.get_path().transformed(axes.transData)
    assert "tip" in boxes
    assert not any(shaft.intersects_bbox(box, False) for box in boxes.values())
    (outline,) = (line for line in axes.lines if line.get_linewidth() == 0.6)
    shown = outline.get_path().transformed(axes.transData)
    assert not any(shown.intersects_bbox(box, False) for box in boxes.values())


def test_the_force_of_a_linear_drive_has_poles_where_its_stroke_stands_still():
    scene = crank_rocker(drive=BETWEEN_CRANKS)
    stands = np.flatnonzero(np.diff(np.sign(solved(scene).stroke_speed)))
    (panel,) = composed(scene, "torque").axes
    assert len(stands)
    gaps = np.flatnonzero(np.isnan(panel.lines[1].get_xdata()))
    assert np.array_equal(gaps, stands + 1 + np.arange(len(stands)))


@mark.parametrize(
    "figure, quantity, rings", [("torque", "Torque", 0), ("overview", "Power", 1)]
)
def test_a_pole_is_dotted_where_it_is_and_what_grows_has_no_ring(
    figure, quantity, rings
):
    """The power stays bounded where the output, which is driven, stands still."""
    scene = crank_rocker(Motion(Sweep(0.2, 1.5, 5), 10.0), drive_bar=4)
    panels = composed(scene, figure).axes
    (panel,) = (axes for axes in panels if axes.get_title("left").startswith(quantity))
    crossed = [line.get_xdata() for line in panel.lines if len(line.get_xdata()) == 2]
    places = np.degrees([limit.theta_2 for limit in limit_positions(scene.linkage, 4)])
    (pole,) = places[(places > degrees(0.2)) & (places < degrees(1.5))]
    assert any(ends == approx([pole, pole], rel=1e-6) for ends in crossed)
    assert [line.get_marker() for line in panel.lines].count("o") == rings


@mark.slow
@mark.parametrize("turned", (False, True), ids=("up", "down"))
def test_the_peak_of_the_torque_is_marked_with_its_value(turned):
    scene = crank_rocker()
    if turned:  # speed changes sign, and so does the angle at which friction acts
        scene = recommand(scene, speed=-10.0)
    torque = 1e3 * solved(scene).torque
    peak = torque[abs(torque).argmax()]
    figure = composed(scene, "torque")
    panel = figure.axes[0]
    assert panel.get_ylabel() == "$T_2$ (mN m)"
    assert_allclose(panel.lines[1].get_ydata(), torque)
    (ring,) = (line for line in panel.lines if line.get_marker() == "o")
    assert ring.get_ydata()[0] == approx(peak)
    words = [text.get_text() for text in figure.findobj(Text)]
    assert f"{peak:.3g} mN m".replace("-", "−") in words
    place = f"{degrees(make_view(scene).here.theta_2[0]):.4g}°"
    assert any(f"Dashed upright line: θ₂\u00a0=\u00a0{place}" in word for word in words)


def test_what_dry_friction_holds_is_drawn_about_the_torque():
    """0.5 N m at O2, to either side."""
    held = (Gravity(), Friction.at(O2=0.5))
    scene = crank_rocker(Motion(Sweep(0.2, 1.4, 5), 0.0), effects=held)
    (panel,) = composed(scene, "torque").axes
    _, torque, low, high, *_ = (line.get_ydata() for line in panel.lines)
    half = 0.5 * torque[0] / solved(scene).torque[0]
    assert_allclose([low, high], [torque - half, torque + half])


@mark.slow
def test_the_position_drawn_is_clear_of_poles_of_its_own_branch():
    """The one of the open branch is a pole of the crossed one."""

    def quality(sign, position=None):
        here = make_view(set_branch(THREE_ROCKERS, sign), position).here
        return min(here.condition[0], here.drive_condition[0])

    assert quality(1) >= CLEAR and quality(-1) >= CLEAR
    of_open = float(make_view(set_branch(THREE_ROCKERS, 1)).here.theta_2[0])
    assert quality(-1, of_open) < CLEAR


OTHERS = {
    "crank-rocker": CRANK_ROCKER,
    "cylinder": commanding(COMMANDS["stroke (mm)"]),
    "without speed": crank_rocker(Motion(Sweep(0.0, 6.0, 30))),
    "law": by_law(),
    "release": released(),
    "three rockers": thesis(),
    "no torque": Scene(UNIFORM_PARALLELOGRAM, Motion([0.3], 1.0), 3),
}
REFUSED = read_rows(r"""
crank-rocker | {} | must
crank-rocker | {"figure": "pie"} | must
crank-rocker | {"figure": "torque", "dimensions": true} | left out of the figure torque
crank-rocker | {"figure": "energy"} | free motion
crank-rocker | {"figure": "stroke"} | needs a linear drive
cylinder | {"figure": "stroke"} | needs a linear drive
without speed | {"figure": "torque"} | omega_2
law | {"figure": "energy"} | free motion
three rockers | {"figure": "linkage", "position": 0.7853981633974483} | 45 deg
release | {"figure": "torque"} | free motion
release | {"position": 9.0} | does not pass
no torque | {"figure": "freebody"} | no value at theta_2 = 17\.1887 deg: no_torque
""")


@mark.parametrize("name, options, words", slow_but(REFUSED[:8] + REFUSED[-1:], REFUSED))
def test_what_cannot_be_drawn_is_named_and_leaves_no_file(
    tmp_path, name, options, words
):
    path = tmp_path / ("a.bmp" if options == "{}" else "a.png")
    with raises(FourBarError, match=words):
        plot.draw(OTHERS[name], path, **json.loads(options))
    assert not list(tmp_path.iterdir())


ENERGY = 1e-6
"""Of the work against the kinetic energy, relative: the spline's (dt omega)^4, its
instants 2 ms apart.
"""


@mark.slow
def test_the_work_of_what_acts_is_the_kinetic_energy():
    damped = Viscous.at(O2=0.002, B=0.001)
    scene = released(effects=(Gravity(), damped, Flywheel(0.01, 4)))
    energies = duty.compute_energies(scene, solve(scene))
    assert set(energies.work) == {"loads", "gravity", "viscous"}
    largest = energies.kinetic.max()
    assert largest > 0.1
    assert np.all(np.diff(energies.work["viscous"]) <= 0.0)
    done = sum(energies.work.values())
    assert_allclose(done, energies.kinetic, atol=ENERGY * largest)
    assert composed(scene, "energy").axes[0].get_ylabel() == "energy (J)"
    more = Friction.at(A=1e-3), Torsion.at(O2=(0.1, 0.4, 0.0))
    (axes,) = composed(
        released(20, 0.3, effects=(*scene.effects, *more)), "energy"
    ).axes
    looks = [(line.get_color(), line.get_linestyle()) for line in axes.lines[:-1]]
    assert len(looks) == len({*looks}) == 6


@mark.parametrize(
    "scene", (thesis(), *map(commanding, COMMANDS.values())), ids=("thesis", *COMMANDS)
)
def test_a_film_of_what_swings_goes_there_and_back(scene):
    sweep = make_view(scene).sweep
    order = film.choose_frames(make_view(scene), 40)
    closes = np.flatnonzero(sweep.assembled)
    assert (np.diff(sweep.at.places) > 0.0).all() and sweep.assembled[order].all()
    assert len(order) == 38 and order[-1] > order[0]
    assert (order[0], order[19]) == (closes[0], closes[-1])
    assert (np.diff(order[:20]) > 0).all() and (np.diff(order[19:]) < 0).all()


def test_a_film_leaps_over_no_gap():
    shown = make_view(thesis(Sweep(0.0, 4 * pi, 240)))
    order = film.choose_frames(shown, 40)
    assert shown.sweep.assembled[min(order) : max(order) + 1].all()


def test_a_film_of_what_turns_goes_round():
    assert np.all(np.diff(film.choose_frames(make_view(CRANK_ROCKER), 30)) == 2)


def test_one_position_of_another_command_stands_in_its_range():
    """The cylinder's shortest and longest stroke, and the limits of the output."""
    shown = make_view(commanding(COMMANDS["stroke (mm)"].replace(angle=0.3)))
    assert shown.at == "stroke = 300 mm"
    assert shown.here.stroke[0] == approx(0.3, rel=1e-14)
    places = shown.sweep.at.places
    assert 0.16 < places.min() < places.max() < 0.34 and len(places) == 362
    shown = make_view(commanding(Motion(theta_4=2.0, omega_4=1.0)))
    assert shown.at == "θ₄ = 114.6°"
    limits = find_intervals(CRANK_ROCKER.linkage, 4)
    low, high = next(ends for ends in limits if ends[0] < 2.0 + tau < ends[1])
    assert low < shown.sweep.theta_4.min() < shown.sweep.theta_4.max() < high


def test_a_cylinder_keeps_its_barrel_and_its_rod_comes_out():
    shown = make_view(commanding(COMMANDS["stroke (mm)"]))
    lengths = []
    for index in (0, 20, 40):
        axes = Figure().subplots()
        linkage_figure.draw_mechanism(axes, shown, shown.sweep, index)
        (barrel,) = (
            np.ptp(line.get_xydata(), axis=0)
            for line in axes.lines
            if line.get_linewidth() == 4.5 and line.get_color() == style.INK
        )
        lengths.append(np.hypot(*barrel))
    assert np.ptp(lengths) < 1e-9 * lengths[0]
    assert lengths[0] < 1000.0 * shown.sweep.stroke.min()


@mark.slow
def test_the_stroke_is_a_figure_where_it_is_not_the_axis():
    scene = commanding(COMMANDS[r"$\theta_4$ (°)"])
    (axes,) = composed(scene, "stroke").axes
    curve = max(axes.lines, key=lambda line: len(line.get_xdata()))
    s = solve(scene)
    drawn = np.interp(np.degrees(s.theta_4), *curve.get_data())
    assert_allclose(drawn, 1000.0 * s.stroke, rtol=1e-14)
