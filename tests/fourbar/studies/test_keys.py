"""Coordinates of drawn pins as the numbers of studies, sensitivities and tolerances.

The oracle of coordinates moves the drawing and states the file anew.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pytest import approx, raises

import fourbar
from fourbar import InputError, Tolerance, sensitivity, solve, uniform, vary
from fourbar.cli import status
from fourbar.files import dump, loads
from fourbar.linkage import PINS
from fourbar.scene import Scene
from fourbar.studies.spread import tolerances
from tests.oracle.oracles import judge_by
from tests.oracle.test_derived import failing
from tests.oracle.variants import DRAWN_SETTING, is_coordinate

PIN_KEYS = tuple(f"pins.{pin}.{axis}" for pin in PINS for axis in (0, 1))
STEP = 1e-6
"""Difference of a coordinate, m."""
DRAWING = """\
[pins]
O2 = ["-10 mm", "-10 mm"]
A = ["0 mm", "100 mm"]
B = ["175 mm", "50 mm"]
O4 = ["250 mm", "50 mm"]
"""
ACTS = """
[bars.coupler]
mass = "1 kg"
[bars.output]
mass = "0.5 kg"
[motion]
theta_2 = { from = "50 deg", to = "80 deg", steps = 4 }
omega_2 = "3 rad/s"
alpha_2 = "-2 rad/s^2"
[points]
P = { bar = 3, from_pin = { x = "90 mm", y = "40 mm" } }
Q = { bar = 1, from_pin = { x = "90 mm", y = "40 mm" } }
[[loads]]
bar = 4
force = ["5 N", "20 deg"]
from_pin = ["60 mm", "10 deg"]
[effects]
gravity = ["9.81 m/s^2", "-90 deg"]
"""
PLACED = (
    DRAWING
    + """
[bars.coupler]
mass = "1 kg"
centre = { drawn = ["90 mm", "90 mm"] }
[motion]
theta_2 = { from = "50 deg", to = "80 deg", steps = 4 }
omega_2 = "3 rad/s"
alpha_2 = "-2 rad/s^2"
[drive]
bar = 2
drawn = ["5 mm", "60 mm"]
direction = "170 deg"
[points]
P = { bar = 3, drawn = ["80 mm", "120 mm"] }
Q = { bar = 3, drawn = ["0 mm", "100 mm"] }
G = { bar = 1, drawn = ["-10 mm", "-10 mm"] }
[[loads]]
bar = 3
force = ["5 N", "20 deg"]
drawn = ["0 mm", "100 mm"]
[[loads]]
bar = 4
force = ["5 N", "20 deg"]
drawn = ["230 mm", "70 mm"]
[effects]
gravity = ["9.81 m/s^2", "-90 deg"]
[[effects.springs]]
from = { bar = 1, drawn = ["-10 mm", "-10 mm"] }
to = { bar = 3, drawn = ["60 mm", "90 mm"] }
stiffness = "200 N/m"
length = "20 mm"
[[effects.springs]]
from = { bar = 3, drawn = ["120 mm", "80 mm"] }
to = { bar = 4, drawn = ["250 mm", "50 mm"] }
stiffness = "300 N/m"
length = "20 mm"
"""
)
"""Places of every kind in the drawing, some on the first pin of their bar, where a
distance and an angle have no derivative.
"""
PUSHED = (
    DRAWING
    + """
[motion]
stroke = "STROKE"
stroke_speed = "0.1 m/s"
[drive]
from = { bar = 1, drawn = FROM }
to = { bar = BAR, drawn = TO }
[bars.coupler]
mass = "1 kg"
"""
)


def push(bar, stroke, start, end):
    parts = {"BAR": bar, "STROKE": stroke, "FROM": start, "TO": end}
    text = PUSHED
    for name, part in parts.items():
        text = text.replace(name, part)
    return text


TURNED_BY_BAR_4 = (
    ACTS.replace("omega_2", "omega_4")
    .replace("alpha_2", "alpha_4")
    .replace(
        'theta_2 = { from = "50 deg", to = "80 deg", steps = 4 }',
        'theta_4 = ["170 deg", "175 deg", "185 deg"]',
    )
)
STATED = {
    "pins": DRAWING + ACTS,
    "pins, of a command of bar 4": DRAWING + TURNED_BY_BAR_4,
    "places": PLACED,
    "cylinder on bar 2": push(
        "2", "222 mm", '["250 mm", "120 mm"]', '["20 mm", "85 mm"]'
    ),
    "cylinder on bar 4, from O2": push(
        "4", "262 mm", '["-10 mm", "-10 mm"]', '["230 mm", "90 mm"]'
    ),
}

COORDINATES = {"pins": 14, "pins,": 14, "places": 30, "cylinder": 12}
"""Count of the coordinates of pins and places, by the first word of the name."""


@pytest.mark.slow
@pytest.mark.parametrize("check", ["sensitivity", "study"])
@pytest.mark.parametrize("name", STATED)
def test_coordinates_move_as_in_files_with_them_moved(name, check):
    scene = loads(STATED[name])
    rows = [row for row in judge_by(scene, check) if row.setting == DRAWN_SETTING]
    assert {"theta_4", "F12"} <= {row.quantity for row in rows if row.compared}
    assert not failing(rows)
    coordinates = {key for key in sensitivity(scene).keys if is_coordinate(key)}
    assert coordinates >= {*PIN_KEYS}
    assert len(coordinates) == COORDINATES[name.split(maxsplit=1)[0]]


def test_places_of_a_table_are_those_of_each_members_drawing():
    """O2 moves in the drawing, and O4 does not."""
    scene = loads(DRAWING + ACTS)
    table = solve(
        vary(scene, {"pins.O2.0": [-0.010, -0.005], "pins.O2.1": -0.010})
    ).to_pandas()
    for member, x in enumerate((-0.010, -0.005)):
        rows = table[table["member"] == member]
        # B lies at its distance from O4, wherever O2 lies
        away = np.hypot(rows["B_x"] - 0.250, rows["B_y"] - 0.050)
        assert_allclose(away, 0.075, rtol=1e-14)
        a = math.hypot(x, 0.110)
        assert_allclose(
            rows["A_x"], x + a * np.cos(rows["theta_2"]), rtol=1e-13, atol=1e-16
        )


def test_a_drawn_place_and_angle_stay_as_they_were_built():
    """The place keeps its distance and angle on the bar, the command its angle."""
    text = (
        DRAWING
        + '[motion]\ntheta_2 = "drawn"\n'
        + '[points]\nP = { bar = 3, drawn = ["100 mm", "120 mm"] }\n'
    )
    scene = loads(text)
    members = solve(vary(scene, {"pins.A.0": [0.0, -0.004]}))
    built = scene.points[0].from_pin
    for member in (0, 1):
        from_A = members.points["P"][member, 0] - members.A[member, 0]
        along = members.B[member, 0] - members.A[member, 0]
        z = complex(*from_A) / complex(*along)
        assert abs(complex(*from_A)) == approx(built[0], rel=1e-14)
        assert np.angle(z) == approx(built[1], abs=1e-14)
    assert (members.theta_2 == scene.motion.theta_2).all()
    # the input is shorter along its nominal direction, and A no longer lies on the
    # drawing
    a = members.lengths[1][:, 0]
    assert a[1] == approx(math.hypot(0.006, 0.110), rel=1e-15)


PARALLELOGRAM = """\
[pins]
O2 = ["0 mm", "0 mm"]
A = ["70.7 mm", "70.7 mm"]
B = ["370.7 mm", "80.7 mm"]
O4 = ["300 mm", "10 mm"]
[bars.coupler]
mass = "0.3 kg"
[motion]
theta_2 = { from = "25 deg", to = "325 deg", steps = 5 }
omega_2 = "60 rpm"
[effects]
gravity = ["9.81 m/s^2", "-90 deg"]
"""


def test_a_drawn_parallelogram_stays_one_on_both_halves_of_the_turn():
    stated = "".join(f'"{key}" = "0.01 mm"\n' for key in PIN_KEYS)
    scene = loads(f"{PARALLELOGRAM}[tolerances]\n{stated}")
    study = tolerances(scene, 512)
    torque = study.spreads["torque"]
    weight = 0.3 * 9.81 * scene.linkage.input.length
    expected = weight * np.cos(solve(scene).theta_2)
    assert_allclose(torque.nominal, expected, rtol=1e-12, atol=1e-14)
    assert (torque.low < torque.nominal).all() and (torque.nominal < torque.high).all()
    assert (torque.high - torque.low < 0.02 * weight).all()
    assert_allclose(torque.deviation, torque.first_order, rtol=0.1)


def test_slopes_of_a_drawn_parallelogram_are_differences_of_its_members():
    scene = loads(PARALLELOGRAM)
    slopes = sensitivity(scene)
    for key in PIN_KEYS:
        number = slopes.numbers[list(slopes.keys).index(key)]
        ends = vary(scene, {key: number + np.array([-STEP, STEP])})
        below, above = solve(ends).torque
        assert_allclose(
            slopes.of("torque", key),
            (above - below) / (2.0 * STEP),
            atol=1e-5,
            err_msg=key,
        )


@pytest.mark.parametrize("name", ["A", "P"])
def test_the_value_of_a_place_is_what_its_slopes_are_of(name):
    """The drawing's coordinates, whose origin a moved O2 leaves; `solve` has O2's."""
    scene = loads(DRAWING + ACTS)
    slopes = sensitivity(scene)
    value = slopes.value(name)
    assert value.shape == (5, 2)
    assert_array_equal(value, solve(scene)[name] + scene.origin)
    for axis in (0, 1):
        key = f"pins.O2.{axis}"
        moved = scene.drawing.place("O2")[axis] + np.array([-STEP, STEP])
        ends = solve(vary(scene, {key: moved}))
        origins = np.stack(np.broadcast_arrays(*ends.origin), axis=-1)
        below, above = ends[name] + origins.reshape(2, 1, 2)
        difference = (above - below) / (2.0 * STEP)
        assert_allclose(slopes.of(name, key), difference, atol=1e-5)


def test_first_order_and_samples_of_pins_agree():
    scene = loads(DRAWING + ACTS)
    stated = (
        Tolerance("pins.O2.0", "0.05 mm"),
        Tolerance("pins.B.1", "0.02 mm", sigma=True),
        # a bar may have a tolerance of its own where its pins have none
        Tolerance("lengths.input", "0.02 mm"),
    )
    with raises(InputError, match=r"lengths\.input.*follows from pins\.O2\.0"):
        tolerances(replace(scene, tolerances=stated), 8)
    study = tolerances(replace(scene, tolerances=stated[:2]), 2048)
    for name in ("torque", "|F12|", "theta_4", "A_x", "P_y", "Q_x"):
        spread = study.spreads[name]
        assert_allclose(spread.deviation, spread.first_order, rtol=0.02)
    assert study.spreads["A_x"].deviation.min() > 0.0
    beside = (Tolerance("pins.O4.0", "0.05 mm"), stated[2])
    assert tolerances(replace(scene, tolerances=beside), 8).invalid == 0


def test_a_member_with_two_pins_in_one_place_is_invalid():
    scene = loads(DRAWING + ACTS)
    values = {"pins.A.0": [0.0, -0.010], "pins.A.1": [0.100, -0.010]}
    study = solve(vary(scene, values))
    assert study.status == [["ok"] * 5, ["invalid"] * 5]


@pytest.mark.parametrize(
    "key, line",
    [
        ("pins.C.0", 'unknown key; did you mean "pins.'),
        ("pins.A.2", 'unknown key; did you mean "pins.A.'),
        ("pins.A", "is more than one number; vary pins.A.0, pins.A.1"),
    ],
)
def test_a_key_that_names_no_coordinate_gets_one_line(key, line):
    text = DRAWING + ACTS
    for make in (
        lambda: vary(loads(text), {key: [0.0]}),
        lambda: loads(f'{text}[tolerances]\n"{key}" = "0.1 mm"\n'),
    ):
        with raises(InputError) as caught:
            make()
        assert line in str(caught.value) and "\n" not in str(caught.value)


def test_a_scene_stated_by_lengths_has_no_pins():
    scene = Scene(uniform(0.3, 0.1, 0.25, 0.22))
    with raises(InputError, match=r"no \[pins\]; it states lengths: lengths\."):
        vary(scene, {"pins.A.0": [0.0, 0.1]})
    text = dump(scene) + '[tolerances]\n"pins.A.0" = "0.1 mm"\n'
    with raises(InputError, match=r"no \[pins\]; it states lengths: lengths\."):
        loads(text)


def test_a_length_beside_a_pin_by_which_it_follows_is_refused():
    scene = loads(DRAWING + ACTS)
    for length, pin in (("coupler", "pins.B.1"), ("ground_angle", "pins.O2.0")):
        values = {pin: [0.0, 0.01], f"lengths.{length}": 0.1}
        with raises(InputError, match=f"follows from {pin}, which varies too"):
            vary(scene, values)
    text = DRAWING + ACTS
    table = '[tolerances]\n"pins.A.0" = "1 mm"\n"lengths.input" = "1 mm"\n'
    with raises(InputError, match=r"follows from pins\.A\.0, which has a tol"):
        loads(text + table)


def test_tolerances_of_pins_are_written_and_shown(capsys, tmp_path):
    text = DRAWING + ACTS
    scene = loads(f'{text}[tolerances]\npins.O2.0 = "0.05 mm"\n')
    assert loads(dump(scene)) == scene
    redrawn = replace(scene, linkage=uniform(0.3, 0.1, 0.25, 0.22))
    with raises(InputError, match="no number of the scene has this key"):
        dump(redrawn)  # its file states lengths
    path = tmp_path / "drawn.toml"
    fourbar.save(scene, path)
    assert status(["tolerance", str(path), "--samples", "64"]) == 0
    shown = capsys.readouterr().out
    assert "torque: 100 % pins.O2.0" in shown
    assert status(["analyze", str(path), "--sensitivity"]) == 0
    shown = capsys.readouterr().out
    lines = shown.splitlines()
    assert "of a\n    drawn coordinate by 1 % of the longest bar" in shown
    # the coordinate 0 of A has an influence too
    assert any(line.startswith("pins.A.0") for line in lines)


def test_a_drawn_place_and_its_pins_move_independently_of_each_other():
    """The place moves on its bar as it was drawn, and then goes with the bar."""
    scene = loads(PLACED)
    together = {
        "pins.A.0": 0.003,
        "points.P.drawn.1": 0.124,
        "points.P.drawn.0": 0.081,
        "motion.theta_2": [1.0],
    }
    start, right, up = (
        loads(text).points[0].place.settle(scene.linkage, {}).vector()
        for text in (
            PLACED,
            PLACED.replace('["80 mm", "120 mm"]', '["81 mm", "120 mm"]'),
            PLACED.replace('["80 mm", "120 mm"]', '["80 mm", "124 mm"]'),
        )
    )
    z = right + up - start
    solution = solve(vary(scene, together))
    A = complex(*solution.A[0, 0])
    along = complex(*solution.B[0, 0]) - A
    P = complex(*solution.points["P"][0, 0])
    assert (P - A) / (along / abs(along)) == approx(z, rel=1e-13)


WISHBONE = """
[pins]
O2 = ["350 mm", "200 mm"]
A = ["700 mm", "170 mm"]
B = ["670 mm", "430 mm"]
O4 = ["420 mm", "445 mm"]
[motion]
theta_2 = "drawn"
omega_2 = "0 rad/s"
[points]
patch = { bar = 3, drawn = ["760 mm", "0 mm"] }
[[loads]]
point = "patch"
force = ["3000 N", "90 deg"]
[tolerances]
"points.patch.drawn.0" = "5 mm"
"""


def test_the_tolerance_of_a_drawn_point_is_that_of_its_coordinate():
    """A double wishbone: 3 kN at the tyre's patch, which the coupler carries.

    The force in the upper bar is that of the moment about A, 3000 N (x - 700 mm), over
    the arm of the line of the upper bar from A.
    """
    spread = tolerances(loads(WISHBONE), 512).spreads["|F43|"]
    upper = complex(-0.250, 0.015)
    arm = abs((upper.conjugate() * complex(0.030, -0.260)).imag) / abs(upper)
    assert_allclose(spread.nominal, 3000.0 * 0.060 / arm, rtol=1e-12)
    assert_allclose(spread.worst, 3000.0 * 0.005 / arm, rtol=1e-12)
    assert_allclose(spread.deviation, spread.first_order, rtol=1e-3)
    scene = loads(WISHBONE)
    assert loads(dump(scene)) == scene


@pytest.mark.parametrize(
    "key, line",
    [
        (
            "points.P.drawn.0",
            "the scene has no [pins], in whose drawing a place has coordinates; it has"
            " points.P.from_pin.0 (the distance) and points.P.from_pin.1 (the"
            " angle)",
        ),
        (
            "points.P.from_pin.x",
            "no number has the components x and y; it has points.P.from_pin.0 (the"
            " distance) and points.P.from_pin.1 (the angle)",
        ),
        (
            "loads.0.force.y",
            "no number has the components x and y; it has loads.0.force.0 (the"
            " magnitude) and loads.0.force.1 (the angle)",
        ),
        ("points.P.from_pn.1", 'did you mean "points.P.from_pin.1"?'),
    ],
)
def test_no_hint_names_a_number_of_another_meaning(key, line):
    lengths = """[lengths]
ground = "0.3 m"
input = "0.1 m"
coupler = "0.25 m"
output = "0.22 m"
"""
    with raises(InputError) as caught:
        vary(loads(lengths + ACTS), {key: [0.0]})
    assert line in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "key, line",
    [
        ("pins.A.y", 'did you mean "pins.A.1"?'),
        ("points.P.drawn.y", 'did you mean "points.P.drawn.1"?'),
        ("points.PP.drawn.1", 'did you mean "points.P.drawn.1"?'),
        ("points.P.drawn", "is more than one number; vary points.P.drawn.0, points.P."),
    ],
)
def test_a_hint_of_a_drawing_names_the_coordinate(key, line):
    with raises(InputError) as caught:
        vary(loads(PLACED), {key: [0.0]})
    assert line in str(caught.value) and "\n" not in str(caught.value)


def test_distance_and_coordinate_of_one_place_do_not_vary_together():
    scene = loads(PLACED)
    for number, place in (
        ("points.P.from_pin.0", "points.P"),
        ("bars.coupler.centre.1", "bars.coupler.centre"),
    ):
        values = {number: 0.1, f"{place}.drawn.0": [0.0, 0.01]}
        with raises(InputError, match=f"follows from {place}.drawn.0, which"):
            vary(scene, values)


def test_a_mass_centre_on_its_pin_has_no_coordinates():
    text = DRAWING + (
        '[bars.input]\nmass = "1 kg"\ncentre = { drawn = ["-10 mm", "-10 mm"] }\n'
    )
    words = r"no place .*; it has bars\.input\.centre\.0 \(the distance\) and"
    with raises(InputError, match=words):
        vary(loads(text), {"bars.input.centre.drawn.0": [0.0]})


def test_the_table_of_tolerances_fits_a_terminal_and_shows_no_rounding(
    capsys, tmp_path
):
    """At the drawn position the patch is at y = 0, within the rounding of doubles."""
    path = tmp_path / "wishbone.toml"
    text = WISHBONE.replace(
        'theta_2 = "drawn"', 'theta_2 = { from = "drawn", to = "-8 deg", steps = 4 }'
    )
    path.write_text(text.replace("drawn.0", "drawn.1"), encoding="utf-8")
    assert status(["tolerance", str(path), "--samples", "64"]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert max(map(len, shown)) <= 80
    (row,) = (line.split() for line in shown if line.startswith("patch_y  "))
    assert row[3] == "0"
