"""Results in other units: table, CSV, JSON, data frame, plot, page, notebook."""

import csv
import io
import json
import math
from pathlib import Path

import numpy as np
import pytest
from pytest import approx, raises

import fourbar
from fourbar import load, solve
from fourbar.cli import status
from fourbar.errors import HOLDS, InputError
from fourbar.quantities import UNITS
from fourbar.show import notebook
from fourbar.show.units import units, units_of_scene, write_digits
from tests.support.scenes import crank_rocker

PURE = (
    "sin_mu",
    "condition",
    "drive_condition",
    "omega_3/omega_2",
    "omega_4/omega_2",
    "mechanical_advantage",
)
"""Columns without a unit."""
MODEL = Path(__file__).parents[3] / "models" / "crank_rocker.toml"
INCH, POUND = 0.0254, 0.45359237 * 9.80665
IN_SI = {
    **{
        "in": INCH,
        "in/s": INCH,
        "in/s^2": INCH,
        "lbf": POUND,
        "lbf in": POUND * INCH,
        "rpm": math.tau / 60.0,
    },
    **{
        "deg": math.pi / 180.0,
        "rad/s^2": 1.0,
        "1": 1.0,
        "J": 1.0,
        "hp": 550.0 * 12.0 * POUND * INCH,
    },
}
"""Size of each unit that a result of the model has in imperial units, by definition."""


def test_every_number_is_in_the_unit_that_is_named(capsys):
    solution = solve(load(MODEL), "error")
    for form in ("--json", "--csv"):
        assert status(["analyze", str(MODEL), form, "--units", "imperial"]) == HOLDS
        out = capsys.readouterr().out
        if form == "--json":
            document = json.loads(out)
            assert document["angle_unit"] == "deg"
            assert set(document["units"]) <= set(document)
            printed = {
                name: (np.array(document[name], dtype=float), unit)
                for name, unit in document["units"].items()
            }
        else:
            header, *rows = csv.reader(io.StringIO(out))
            column = next(
                index for index, name in enumerate(header) if name.startswith("F12_y")
            )
            assert header[column] == "F12_y [lbf]"
            assert "torque [lbf in]" in header
            assert "condition" in header
            assert float(rows[90][column]) * POUND == approx(
                solution.F12[90, 1], rel=1e-14
            )
    for name, (values, unit) in printed.items():
        if UNITS[name] != unit or unit in ("rad/s^2", "1"):
            expected = getattr(solution, name)
            assert np.allclose(
                values * IN_SI[unit],
                np.full_like(values, np.nan) if expected is None else expected,
                rtol=4e-16 * 4,
                atol=0.0,
                equal_nan=True,
            ), name
    assert {unit for _, unit in printed.values()} >= {
        "in",
        "lbf",
        "lbf in",
        "deg",
        "rpm",
        "in/s^2",
        "hp",
    }


def test_a_spreadsheet_of_decimal_commas_has_magnitudes_power_and_time(capsys):
    scene = load(MODEL)
    assert status(["analyze", str(MODEL), "--csv-comma", "--units", "mm kW"]) == HOLDS
    header, *rows = csv.reader(io.StringIO(capsys.readouterr().out), delimiter=";")
    assert {len(row) for row in rows} == {len(header)}
    assert not any("." in cell for row in rows for cell in row)
    solution = solve(scene)
    wanted = {
        "|F14| [N]": np.hypot(*solution.F14.T),
        "power [kW]": solution.torque * scene.motion.omega_2 / 1000.0,
    }
    wanted["time [s]"] = np.linspace(0.0, math.tau / scene.motion.omega_2, 361)
    for name, numbers in wanted.items():
        column = [float(row[header.index(name)].replace(",", ".")) for row in rows]
        assert np.allclose(column, numbers, rtol=1e-14, atol=1e-15), name
    assert all(" [" in name for name in header[3:] if name not in PURE)
    growing = fourbar.Scene(
        scene.linkage, fourbar.Motion(np.array([1.0, 2.0]), 1.0, 1.0)
    )
    assert "time" not in (solve(growing).to_csv() or "")


@pytest.mark.slow
def test_the_table_names_its_units(capsys):
    assert (
        status(["analyze", str(MODEL), "--units", "mm kN N.mm", "--table", "--all"])
        == HOLDS
    )
    lines = capsys.readouterr().out.splitlines()
    heading = next(
        index for index, line in enumerate(lines) if line.startswith(" theta_2")
    )
    assert lines[heading + 1].split() == [
        *[
            "deg",
            "N",
            "mm",
            "W",
            *["kN"] * 4,
            "deg",
            "deg",
            *["rad/s"] * 2,
            *["rad/s^2"] * 2,
            "of",
            "T",
            "s",
            *["kN"] * 3,
            "N",
            "mm",
            "deg",
            *["mm"] * 4,
        ]
    ]
    torque = [float(line.split()[1]) for line in lines[heading + 3 :]]
    assert torque == approx(list(1000.0 * solve(load(MODEL)).torque), rel=1e-4)


@pytest.mark.parametrize("text", ["furlong", "mm in", "N.mm J", "m^2"])
def test_what_is_no_list_of_units_is_refused(text, capsys):
    with raises(InputError):
        units(text)
    assert status(["analyze", str(MODEL), "--units", text]) == 2
    assert "units" in capsys.readouterr().err


def test_units_are_read_as_people_write_them():
    assert units("mm, N,lbf-in") == units("mm N lbf-in")
    assert units("Imperial") == units("imperial")
    assert not units("si")
    with raises(InputError, match=r'lb-in.*did you mean "lbf-in"'):
        units("mm lb-in")


@pytest.mark.slow
def test_plots_and_notebooks_say_theirs():
    pytest.importorskip(
        "matplotlib", reason="drawing needs matplotlib: pip install matplotlib"
    )
    from fourbar.show.plot.figures import draw_figure

    scene, imperial = crank_rocker(), units("imperial")
    for name, label in (("torque", "$T_2$ (lbf in)"), ("forces", "$|F|$ (lbf)")):
        axes = draw_figure(scene, name, units=imperial).figure.subfigs[0].axes[0]
        assert axes.get_ylabel() == label
        if name == "torque":
            torque = solve(scene).torque
            curve = max((np.asarray(line.get_ydata()) for line in axes.lines), key=len)
            assert np.nanmax(curve) == approx(np.max(torque) / (POUND * INCH), rel=0.01)
    assert " in" in notebook.in_units(scene, "imperial")._repr_html_()
    table = notebook.in_units(solve(scene), "imperial")._repr_html_()
    assert "lbf in" in table and "deg" in table and "N m" not in table


@pytest.mark.parametrize("text", ["inches pounds", "in lb", "mm lbs deg"])
def test_pounds_without_a_unit_of_force_are_one_line_that_says_what_to_write(text):
    with raises(InputError, match="write lbf for pounds-force"):
        units(text)
    assert units("in lb lbf")["N"][0] == "lbf"


@pytest.mark.parametrize(
    "stated, shown",
    [({}, "rad/s"), ({"omega_2": "60 rpm"}, "rpm"), ({"omega_2": "9 deg/s"}, "deg/s")],
)
@pytest.mark.parametrize("length", ("300 mm", "12 in"))
def test_a_released_motion_has_speeds_that_suit_its_accelerations(
    stated, shown, length
):
    motion = {"theta_2": "0 deg", "free": {"duration": "1 s"}, **stated}
    of_scene = units_of_scene({"lengths": {"ground": length}, "motion": motion})
    assert of_scene["rad/s"][0] == shown


@pytest.mark.parametrize(
    "value, text", [(-0.0, "0"), (-1e-3, "-0.001"), (123456.7, "123500")]
)
def test_a_number_has_four_digits_and_zero_no_sign(value, text):
    assert write_digits(value) == text
