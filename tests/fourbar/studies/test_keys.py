"""Coordinates of drawn pins as the numbers of studies, sensitivities and tolerances.

The second derivation is the file of the moved drawing, read anew.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import fourbar
from fourbar import InputError, Tolerance
from fourbar.cli import status
from fourbar.files import dump, loads
from fourbar.linkage import PINS
from fourbar.scene import Scene
from fourbar.solution import find_values
from fourbar.studies.spread import tolerances

PIN_KEYS = tuple(f"pins.{pin}.{axis}" for pin in PINS for axis in (0, 1))
LENGTH_KEYS = tuple(
    f"lengths.{name}"
    for name in ("ground", "input", "coupler", "output", "ground_angle")
)
STEP = 1e-6
"""Difference of a coordinate, m. Its square is the relative error of a central
difference of bars of 0.1 m, eps over it that of rounding.
"""
OF_DIFFERENCES = 1e-7
"""Error of a central difference relative to the largest quantity per 0.1 m."""
OF_READING = 1e-12
"""Relative: the moved file states lengths and angles rounded by the libraries' own
functions, a condition of 0.01 away from the limits of the motion.
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
DRAWN = {
    "O2": (-10e-3, -10e-3),
    "A": (0.0, 100e-3),
    "B": (175e-3, 50e-3),
    "O4": (250e-3, 50e-3),
}
BY_HAND = {
    "theta_2": ACTS,
    "theta_4": ACTS.replace(
        'theta_2 = { from = "50 deg", to = "80 deg", steps = 4 }',
        'theta_4 = ["170 deg", "175 deg", "185 deg"]',
    )
    .replace("omega_2", "omega_4")
    .replace("alpha_2", "alpha_4"),
}


def write_pins(pins: dict[str, tuple[float, float]], key: str, by: float) -> str:
    """Write the table of the pins, one of them moved along an axis."""
    _, moved, axis = key.split(".")
    rows = ["[pins]"]
    for pin, place in pins.items():
        numbers = list(place)
        if pin == moved:
            numbers[int(axis)] += by
        rows.append(f'{pin} = ["{numbers[0]!r} m", "{numbers[1]!r} m"]')
    return "\n".join(rows) + "\n"


def reader(command: str) -> Callable[[str, float], Scene]:
    """Return the function that reads the file of a drawing with a moved pin."""
    return lambda key, by: loads(write_pins(DRAWN, key, by) + BY_HAND[command])


def list_quantities(solution: fourbar.Solution) -> list[str]:
    return [*solution.evaluated(), *solution.points, "v_P", "a_P"]


def assert_slopes_are_differences(
    slopes: fourbar.Sensitivity,
    key: str,
    read: Callable[[str, float], Scene],
) -> None:
    """Hold the slopes by a key against solutions of files in which it is moved."""
    above, below = (fourbar.solve(read(key, by)) for by in (STEP, -STEP))
    for name in slopes.by:
        ends = find_values(above, name), find_values(below, name)
        difference = (ends[0] - ends[1]) / (2.0 * STEP)
        scale = max(float(np.abs(ends[0]).max()), 1e-3) / 0.1
        np.testing.assert_allclose(
            slopes.of(name, key),
            difference,
            atol=OF_DIFFERENCES * scale,
            err_msg=f"{name} by {key}",
        )


@pytest.mark.parametrize("command", BY_HAND)
def test_slopes_by_a_pin_are_differences_of_the_files_with_the_moved_pin(
    command: str,
) -> None:
    read = reader(command)
    slopes = fourbar.sensitivity(read("pins.A.0", 0.0))
    assert tuple(slopes.keys)[1:14] == (*PIN_KEYS, *LENGTH_KEYS)
    for key in PIN_KEYS:
        assert_slopes_are_differences(slopes, key, read)


@pytest.mark.parametrize("command", BY_HAND)
@pytest.mark.parametrize("key", PIN_KEYS)
def test_a_member_is_the_file_with_the_moved_pin(command: str, key: str) -> None:
    read = reader(command)
    nominal = read(key, 0.0)
    _, pin, axis = key.split(".")
    moves = np.array([0.0, 2e-3, -5e-3])
    study = fourbar.vary(nominal, {key: DRAWN[pin][int(axis)] + moves})
    members = fourbar.solve(study)
    for member, by in enumerate(moves.tolist()):
        alone = fourbar.solve(read(key, by))
        for name in list_quantities(alone):
            np.testing.assert_allclose(
                find_values(members, name)[member],
                find_values(alone, name),
                rtol=OF_READING,
                atol=OF_READING * float(np.abs(find_values(alone, name)).max()),
                err_msg=f"{name} of {by}",
            )
    unmoved = fourbar.solve(nominal)
    assert np.array_equal(members.F32[0], unmoved.F32)


def test_places_of_a_table_are_those_of_each_members_drawing() -> None:
    """O2 moves in the drawing, and O4 does not."""
    scene = reader("theta_2")("pins.A.0", 0.0)
    table = fourbar.solve(
        fourbar.vary(scene, {"pins.O2.0": [-0.010, -0.005], "pins.O2.1": -0.010})
    ).to_pandas()
    for member, x in enumerate((-0.010, -0.005)):
        rows = table[table["member"] == member]
        # B lies at its distance from O4, wherever O2 lies
        away = np.hypot(rows["B_x"] - 0.250, rows["B_y"] - 0.050)
        np.testing.assert_allclose(away, 0.075, rtol=1e-14)
        a = math.hypot(x, 0.110)
        np.testing.assert_allclose(
            rows["A_x"], x + a * np.cos(rows["theta_2"]), rtol=1e-13, atol=1e-16
        )


def test_a_drawn_place_and_angle_stay_as_they_were_built() -> None:
    """The place keeps its distance and angle on the bar, the command its angle."""
    text = (
        write_pins(DRAWN, "pins.A.0", 0.0)
        + '[motion]\ntheta_2 = "drawn"\n'
        + '[points]\nP = { bar = 3, drawn = ["100 mm", "120 mm"] }\n'
    )
    scene = loads(text)
    members = fourbar.solve(fourbar.vary(scene, {"pins.A.0": [0.0, -0.004]}))
    built = scene.points[0].from_pin
    assert built is not None
    for member in (0, 1):
        from_A = members.points["P"][member, 0] - members.A[member, 0]
        along = members.B[member, 0] - members.A[member, 0]
        z = complex(*from_A) / complex(*along)
        assert abs(complex(*from_A)) == pytest.approx(built[0], rel=1e-14)
        assert np.angle(z) == pytest.approx(built[1], abs=1e-14)
    assert (members.theta_2 == scene.motion.theta_2).all()
    # the input is shorter along its nominal direction, and A no longer lies on the
    # drawing
    assert members.lengths is not None
    a = members.lengths[1][:, 0]
    assert a[1] == pytest.approx(math.hypot(0.006, 0.110), rel=1e-15)


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


def test_a_drawn_parallelogram_stays_one_on_both_halves_of_the_turn() -> None:
    stated = "".join(f'"{key}" = "0.01 mm"\n' for key in PIN_KEYS)
    scene = loads(f"{PARALLELOGRAM}[tolerances]\n{stated}")
    study = tolerances(scene, 512)
    torque = study.spreads["torque"]
    weight = 0.3 * 9.81 * scene.linkage.input.length
    expected = weight * np.cos(fourbar.solve(scene).theta_2)
    np.testing.assert_allclose(torque.nominal, expected, rtol=1e-12, atol=1e-14)
    assert (torque.low < torque.nominal).all() and (torque.nominal < torque.high).all()
    assert (torque.high - torque.low < 0.02 * weight).all()
    np.testing.assert_allclose(torque.deviation, torque.first_order, rtol=0.1)


def test_slopes_of_a_drawn_parallelogram_are_differences_of_its_members() -> None:
    scene = loads(PARALLELOGRAM)
    slopes = fourbar.sensitivity(scene)
    for key in PIN_KEYS:
        number = slopes.numbers[list(slopes.keys).index(key)]
        ends = fourbar.vary(scene, {key: number + np.array([-STEP, STEP])})
        below, above = fourbar.solve(ends).torque
        np.testing.assert_allclose(
            slopes.of("torque", key),
            (above - below) / (2.0 * STEP),
            atol=1e-5,
            err_msg=key,
        )


def test_first_order_and_samples_of_pins_agree() -> None:
    scene = reader("theta_2")("pins.A.0", 0.0)
    stated = (
        Tolerance("pins.O2.0", "0.05 mm"),
        Tolerance("pins.B.1", "0.02 mm", sigma=True),
        # a bar may have a tolerance of its own where its pins have none
        Tolerance("lengths.input", "0.02 mm"),
    )
    with pytest.raises(InputError, match=r"lengths\.input.*follows from pins\.O2\.0"):
        tolerances(replace(scene, tolerances=stated), 8)
    study = tolerances(replace(scene, tolerances=stated[:2]), 2048)
    for name in ("torque", "|F12|", "theta_4", "A_x", "P_y", "Q_x"):
        spread = study.spreads[name]
        np.testing.assert_allclose(spread.deviation, spread.first_order, rtol=0.02)
    assert study.spreads["A_x"].deviation.min() > 0.0
    beside = (Tolerance("pins.O4.0", "0.05 mm"), stated[2])
    assert tolerances(replace(scene, tolerances=beside), 8).invalid == 0


def test_a_member_with_two_pins_in_one_place_is_invalid() -> None:
    scene = reader("theta_2")("pins.A.0", 0.0)
    values = {"pins.A.0": [0.0, -0.010], "pins.A.1": [0.100, -0.010]}
    study = fourbar.solve(fourbar.vary(scene, values))
    assert study.status == [["ok"] * 5, ["invalid"] * 5]


@pytest.mark.parametrize(
    ("key", "line"),
    [
        ("pins.C.0", 'unknown key; did you mean "pins.'),
        ("pins.A.2", 'unknown key; did you mean "pins.A.'),
        ("pins.A", "is more than one number; vary pins.A.0, pins.A.1"),
    ],
)
def test_a_key_that_names_no_coordinate_gets_one_line(key: str, line: str) -> None:
    text = write_pins(DRAWN, "pins.A.0", 0.0) + ACTS
    for make in (
        lambda: fourbar.vary(loads(text), {key: [0.0]}),
        lambda: loads(f'{text}[tolerances]\n"{key}" = "0.1 mm"\n'),
    ):
        with pytest.raises(InputError) as caught:
            make()
        assert line in str(caught.value) and "\n" not in str(caught.value)


def test_a_scene_stated_by_lengths_has_no_pins() -> None:
    scene = Scene(fourbar.uniform(0.3, 0.1, 0.25, 0.22))
    with pytest.raises(InputError, match=r"no \[pins\]; it states lengths: lengths\."):
        fourbar.vary(scene, {"pins.A.0": [0.0, 0.1]})
    text = dump(scene) + '[tolerances]\n"pins.A.0" = "0.1 mm"\n'
    with pytest.raises(InputError, match=r"no \[pins\]; it states lengths: lengths\."):
        loads(text)


def test_a_length_beside_a_pin_by_which_it_follows_is_refused() -> None:
    scene = reader("theta_2")("pins.A.0", 0.0)
    for length, pin in (("coupler", "pins.B.1"), ("ground_angle", "pins.O2.0")):
        values = {pin: [0.0, 0.01], f"lengths.{length}": 0.1}
        with pytest.raises(InputError, match=f"follows from {pin}, which varies too"):
            fourbar.vary(scene, values)
    text = write_pins(DRAWN, "pins.A.0", 0.0) + ACTS
    table = '[tolerances]\n"pins.A.0" = "1 mm"\n"lengths.input" = "1 mm"\n'
    with pytest.raises(InputError, match=r"follows from pins\.A\.0, which has a tol"):
        loads(text + table)


def test_tolerances_of_pins_are_written_and_shown(
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> None:
    text = write_pins(DRAWN, "pins.A.0", 0.0) + ACTS
    scene = loads(f'{text}[tolerances]\npins.O2.0 = "0.05 mm"\n')
    assert loads(dump(scene)) == scene
    redrawn = replace(scene, linkage=fourbar.uniform(0.3, 0.1, 0.25, 0.22))
    with pytest.raises(InputError, match="no number of the scene has this key"):
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


PLACES = {
    "points.P": ("80 mm", "120 mm"),
    # the first pins of their bars, where a distance and an angle have no derivative
    "points.Q": ("0 mm", "100 mm"),
    "points.G": ("-10 mm", "-10 mm"),
    "loads.0": ("0 mm", "100 mm"),
    "loads.1": ("230 mm", "70 mm"),
    "drive": ("5 mm", "60 mm"),
    "effects.springs.0.from": ("-10 mm", "-10 mm"),
    "effects.springs.0.to": ("60 mm", "90 mm"),
    "effects.springs.1.from": ("120 mm", "80 mm"),
    "effects.springs.1.to": ("250 mm", "50 mm"),
    "bars.coupler.centre": ("90 mm", "90 mm"),
}
"""Places of every kind, in the drawing."""
CYLINDERS = {
    2: {"drive.from": ("250 mm", "120 mm"), "drive.to": ("20 mm", "85 mm")},
    # from O2, the first pin of the ground
    4: {"drive.from": ("-10 mm", "-10 mm"), "drive.to": ("230 mm", "90 mm")},
}
"""Ends of a cylinder by the bar that it moves."""
STROKES = {2: "222 mm", 4: "262 mm"}
PLACE_KEYS = [f"{place}.drawn.{axis}" for place in PLACES for axis in (0, 1)]


def place_writer(
    key: str,
    by: float,
    places: dict[str, tuple[str, str]] = PLACES,
) -> Callable[[str], str]:
    """Return the function that writes a place in the drawing, one of them moved."""

    def write(place: str) -> str:
        numbers = [float(text.removesuffix(" mm")) / 1e3 for text in places[place]]
        if key.startswith(f"{place}.drawn."):
            numbers[int(key[-1])] += by
        return f'drawn = ["{numbers[0]!r} m", "{numbers[1]!r} m"]'

    return write


def read_places(key: str, by: float) -> Scene:
    """Read the file of a drawing with a moved place."""
    at = place_writer(key, by)
    return loads(
        f"""{write_pins(DRAWN, "pins.A.0", 0.0)}
[bars.coupler]
mass = "1 kg"
centre = {{ {at("bars.coupler.centre")} }}
[motion]
theta_2 = {{ from = "50 deg", to = "80 deg", steps = 4 }}
omega_2 = "3 rad/s"
alpha_2 = "-2 rad/s^2"
[drive]
bar = 2
{at("drive")}
direction = "170 deg"
[points]
P = {{ bar = 3, {at("points.P")} }}
Q = {{ bar = 3, {at("points.Q")} }}
G = {{ bar = 1, {at("points.G")} }}
[[loads]]
bar = 3
force = ["5 N", "20 deg"]
{at("loads.0")}
[[loads]]
bar = 4
force = ["5 N", "20 deg"]
{at("loads.1")}
[effects]
gravity = ["9.81 m/s^2", "-90 deg"]
[[effects.springs]]
from = {{ bar = 1, {at("effects.springs.0.from")} }}
to = {{ bar = 3, {at("effects.springs.0.to")} }}
stiffness = "200 N/m"
length = "20 mm"
[[effects.springs]]
from = {{ bar = 3, {at("effects.springs.1.from")} }}
to = {{ bar = 4, {at("effects.springs.1.to")} }}
stiffness = "300 N/m"
length = "20 mm"
"""
    )


def test_slopes_by_a_drawn_place_are_differences_of_files_with_it_moved() -> None:
    slopes = fourbar.sensitivity(read_places("points.P.drawn.0", 0.0))
    assert set(PLACE_KEYS) <= slopes.keys.keys()
    for key in PLACE_KEYS:
        assert_slopes_are_differences(slopes, key, read_places)


@pytest.mark.parametrize("key", PLACE_KEYS)
def test_a_member_is_the_file_with_the_moved_place(key: str) -> None:
    place, _, axis = key.rpartition(".drawn.")
    number = float(PLACES[place][int(axis)].removesuffix(" mm")) / 1e3
    moves = np.array([0.0, 2e-3, -5e-3])
    nominal = read_places(key, 0.0)
    members = fourbar.solve(fourbar.vary(nominal, {key: number + moves}))
    for member, by in enumerate(moves.tolist()):
        alone = fourbar.solve(read_places(key, by))
        for name in list_quantities(alone):
            np.testing.assert_allclose(
                find_values(members, name)[member],
                find_values(alone, name),
                rtol=OF_READING,
                atol=OF_READING * float(np.abs(find_values(alone, name)).max()),
                err_msg=f"{name} of {by}",
            )


def test_a_drawn_place_and_its_pins_move_independently_of_each_other() -> None:
    """The place moves on its bar as it was drawn, and then goes with the bar."""
    scene = read_places("points.P.drawn.0", 0.0)
    together = {
        "pins.A.0": 0.003,
        "points.P.drawn.1": 0.124,
        "points.P.drawn.0": 0.081,
        "motion.theta_2": [1.0],
    }
    start, right, up = (
        read_places(key, by).points[0].place.settle(scene.linkage, {}).vector()
        for key, by in (
            ("points.P.drawn.0", 0.0),
            ("points.P.drawn.0", 0.001),
            ("points.P.drawn.1", 0.004),
        )
    )
    z = right + up - start
    solution = fourbar.solve(fourbar.vary(scene, together))
    A = complex(*solution.A[0, 0])
    along = complex(*solution.B[0, 0]) - A
    P = complex(*solution.points["P"][0, 0])
    assert (P - A) / (along / abs(along)) == pytest.approx(z, rel=1e-13)


@pytest.mark.parametrize("bar", CYLINDERS)
def test_slopes_of_a_commanded_stroke_by_the_ends_of_its_cylinder(bar: int) -> None:
    cylinder = CYLINDERS[bar]

    def read(key: str, by: float) -> Scene:
        at = place_writer(key, by, cylinder)
        text = f"""{write_pins(DRAWN, "pins.A.0", 0.0)}
[motion]
stroke = "{STROKES[bar]}"
stroke_speed = "0.1 m/s"
[drive]
from = {{ bar = 1, {at("drive.from")} }}
to = {{ bar = {bar}, {at("drive.to")} }}
[bars.coupler]
mass = "1 kg"
"""
        return loads(text)

    slopes = fourbar.sensitivity(read("drive.from.drawn.0", 0.0))
    for key in (f"{end}.drawn.{axis}" for end in cylinder for axis in (0, 1)):
        above, below = (fourbar.solve(read(key, by)) for by in (STEP, -STEP))
        for name in ("theta_2", "drive_force", "F12"):
            ends = find_values(above, name), find_values(below, name)
            np.testing.assert_allclose(
                slopes.of(name, key),
                (ends[0] - ends[1]) / (2.0 * STEP),
                rtol=1e-6,
                atol=1e-6,
                err_msg=f"{name} by {key}",
            )


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


def test_the_tolerance_of_a_drawn_point_is_that_of_its_coordinate() -> None:
    """A double wishbone: 3 kN at the tyre's patch, which the coupler carries.

    The force in the upper bar is that of the moment about A, 3000 N (x - 700 mm), over
    the arm of the line of the upper bar from A.
    """
    spread = tolerances(loads(WISHBONE), 512).spreads["|F43|"]
    upper = complex(-0.250, 0.015)
    arm = abs((upper.conjugate() * complex(0.030, -0.260)).imag) / abs(upper)
    np.testing.assert_allclose(spread.nominal, 3000.0 * 0.060 / arm, rtol=1e-12)
    np.testing.assert_allclose(spread.worst, 3000.0 * 0.005 / arm, rtol=1e-12)
    np.testing.assert_allclose(spread.deviation, spread.first_order, rtol=1e-3)
    scene = loads(WISHBONE)
    assert loads(dump(scene)) == scene


@pytest.mark.parametrize(
    ("key", "line"),
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
def test_no_hint_names_a_number_of_another_meaning(key: str, line: str) -> None:
    lengths = """[lengths]
ground = "0.3 m"
input = "0.1 m"
coupler = "0.25 m"
output = "0.22 m"
"""
    with pytest.raises(InputError) as caught:
        fourbar.vary(loads(lengths + BY_HAND["theta_2"]), {key: [0.0]})
    assert line in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("key", "line"),
    [
        ("pins.A.y", 'did you mean "pins.A.1"?'),
        ("points.P.drawn.y", 'did you mean "points.P.drawn.1"?'),
        ("points.PP.drawn.1", 'did you mean "points.P.drawn.1"?'),
        ("points.P.drawn", "is more than one number; vary points.P.drawn.0, points.P."),
    ],
)
def test_a_hint_of_a_drawing_names_the_coordinate(key: str, line: str) -> None:
    with pytest.raises(InputError) as caught:
        fourbar.vary(read_places("points.P.drawn.0", 0.0), {key: [0.0]})
    assert line in str(caught.value) and "\n" not in str(caught.value)


def test_distance_and_coordinate_of_one_place_do_not_vary_together() -> None:
    scene = read_places("points.P.drawn.0", 0.0)
    for number, place in (
        ("points.P.from_pin.0", "points.P"),
        ("bars.coupler.centre.1", "bars.coupler.centre"),
    ):
        values = {number: 0.1, f"{place}.drawn.0": [0.0, 0.01]}
        with pytest.raises(InputError, match=f"follows from {place}.drawn.0, which"):
            fourbar.vary(scene, values)


def test_a_mass_centre_on_its_pin_has_no_coordinates() -> None:
    text = write_pins(DRAWN, "pins.A.0", 0.0) + (
        '[bars.input]\nmass = "1 kg"\ncentre = { drawn = ["-10 mm", "-10 mm"] }\n'
    )
    words = r"no place .*; it has bars\.input\.centre\.0 \(the distance\) and"
    with pytest.raises(InputError, match=words):
        fourbar.vary(loads(text), {"bars.input.centre.drawn.0": [0.0]})


def test_the_table_of_tolerances_fits_a_terminal_and_shows_no_rounding(
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> None:
    """At the drawn position the patch is at y = 0, within the rounding of doubles."""
    path = tmp_path / "wishbone.toml"
    text = WISHBONE.replace(
        'theta_2 = "drawn"',
        'theta_2 = { from = "drawn", to = "-8 deg", steps = 4 }',
    )
    path.write_text(text.replace("drawn.0", "drawn.1"), encoding="utf-8")
    assert status(["tolerance", str(path), "--samples", "64"]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert max(map(len, shown)) <= 80
    (row,) = (line.split() for line in shown if line.startswith("patch_y  "))
    assert row[3] == "0"
