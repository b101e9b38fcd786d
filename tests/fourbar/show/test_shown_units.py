"""Results in other units: table, CSV, JSON, and which a scene is shown in."""

import csv
import io
import json
from math import pi, tau

import numpy as np
from pytest import approx, mark

from fourbar import load, solve
from fourbar.show.shown_units import units, units_of_scene, write_digits
from fourbar_validation.places import MODELS
from tests.support.rows import read_rows, refused

PURE = (
    "sin_mu",
    "condition",
    "drive_condition",
    "omega_3/omega_2",
    "omega_4/omega_2",
    "mechanical_advantage",
)
"""Columns without a unit."""


MODEL = MODELS / "crank_rocker.toml"


INCH = 0.0254
POUND = 0.45359237 * 9.80665

SIZES = {
    **dict.fromkeys(("in", "in/s", "in/s^2"), INCH),
    "lbf": POUND,
    "lbf in": POUND * INCH,
    "rpm": tau / 60.0,
    "deg": pi / 180.0,
    "hp": 550.0 * 12.0 * POUND * INCH,
    **dict.fromkeys(("rad/s^2", "1", "J"), 1.0),
}
"""Size of each unit that a result of the model has in imperial units, by definition."""


def test_every_number_is_in_the_unit_that_is_named(show):
    solution = solve(load(MODEL), "error")
    document = json.loads(show("analyze", MODEL, "--json", "--units", "imperial"))
    assert document["angle_unit"] == "deg"
    named = document["units"]
    for name, unit in named.items():
        values = np.array(document[name], dtype=float) * SIZES[unit]
        expected = getattr(solution, name)
        if expected is None:
            assert np.isnan(values).all(), name
        else:
            assert np.allclose(values, expected, rtol=2e-15, atol=0.0), name
    assert {*named.values()} >= {"in", "lbf", "lbf in", "deg", "rpm", "in/s^2", "hp"}
    text = show("analyze", MODEL, "--csv", "--units", "imperial")
    table = csv.DictReader(io.StringIO(text))
    forces = [float(row["F12_y [lbf]"]) * POUND for row in table]
    assert forces == approx(solution.F12[:, 1], rel=1e-14)


def test_a_spreadsheet_of_decimal_commas_has_magnitudes_power_and_time(show):
    scene = load(MODEL)
    text = show("analyze", MODEL, "--csv-comma", "--units", "mm kW")
    header, *rows = csv.reader(io.StringIO(text), delimiter=";")
    assert not any("." in cell for row in rows for cell in row)
    assert all(" [" in name for name in header[3:] if name not in PURE)
    solution = solve(scene)
    for name, expected in {
        "|F14| [N]": np.hypot(*solution.F14.T),
        "power [kW]": solution.torque * scene.motion.omega_2 / 1000.0,
        "time [s]": np.linspace(0.0, tau / scene.motion.omega_2, 361),
    }.items():
        column = [float(row[header.index(name)].replace(",", ".")) for row in rows]
        assert np.allclose(column, expected, rtol=1e-14, atol=1e-15), name


REFUSED = read_rows("""
furlong | unit
mm in | unit
N.mm J | unit
m^2 | unit
mm lb-in | no unit of a result; must be "SI"
inches pounds | write lbf for pounds-force
in lb | write lbf for pounds-force
mm lbs deg | write lbf for pounds-force
""")


@mark.parametrize("text, words", REFUSED)
def test_what_is_no_list_of_units_is_refused(text, words, run):
    with refused(words):
        units(text)
    code, _, err = run("analyze", MODEL, "--units", text)
    assert code == 2 and "units" in err


def test_units_are_read_as_people_write_them():
    assert units("mm, N,lbf-in") == units("mm N lbf-in")
    assert units("Imperial") == units("imperial")
    assert not units("si")
    assert units("in lb lbf")["N"][0] == "lbf"


@mark.parametrize(
    "stated, shown",
    [({}, "rad/s"), ({"omega_2": "60 rpm"}, "rpm"), ({"omega_2": "9 deg/s"}, "deg/s")],
)
@mark.parametrize("length", ("300 mm", "12 in"))
def test_a_released_motion_has_speeds_that_suit_its_accelerations(
    stated, shown, length
):
    motion = {"theta_2": "0 deg", "free": {"duration": "1 s"}, **stated}
    of_scene = units_of_scene({"lengths": {"ground": length}, "motion": motion})
    assert of_scene["rad/s"][0] == shown


@mark.parametrize(
    "length, names, of_length, of_torque",
    read_rows("""
12 in | in, in/s, lbf in | 12 | 12
1 foot | ft, ft/s, lbf ft | 1 | 1
1 yd | ft, ft/s, lbf ft | 1 | 1
1 km | km, km/s, N m | 0.3048e-3 | 1.3558179483314004
"""),
)
def test_lengths_have_results_in_their_unit(length, names, of_length, of_torque):
    """12 in and 1 ft are 0.3048 m; 1 lbf ft is 1.35581795 N m.

    A ground may be stated by coordinates.
    """
    for ground in (length, {"x": length, "y": length}):
        shown = units_of_scene({"lengths": {"ground": ground}})
        of = [shown.get(unit, (unit, 1.0)) for unit in ("m", "m/s", "N m")]
        assert ", ".join(name for name, _ in of) == names
        assert 0.3048 * of[0][1] == approx(float(of_length))
        assert 1.3558179483314004 * of[2][1] == approx(float(of_torque))


@mark.parametrize("value, text", [(-0.0, "0"), (-1e-3, "-0.001"), (123456.7, "123500")])
def test_a_number_has_four_digits_and_zero_no_sign(value, text):
    assert write_digits(value) == text
