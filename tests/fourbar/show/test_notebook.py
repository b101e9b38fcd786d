"""Scenes, solutions and studies in a notebook and as tables."""

import math
import re
import sys
from base64 import b64decode
from dataclasses import replace
from html import unescape

import numpy as np
from numpy.testing import assert_array_equal
from pytest import approx, importorskip, mark, raises

from fourbar import (
    DependencyError,
    InputError,
    Motion,
    Tolerance,
    dump,
    sensitivity,
    solve,
    tolerances,
    vary,
)
from tests.support.scenes import crank_rocker, thesis

HOSTILE = "<script>alert(1)</script>&"

LOOSE = crank_rocker(tolerances=(Tolerance("lengths.input", 1e-4),))
STUDY = vary(LOOSE, {"lengths.input": np.array([0.1, 0.11, 3.0])})


@mark.slow
def test_a_scene_shows_itself():
    shown = thesis()._repr_html_()
    picture = shown.partition("data:image/svg+xml;base64,")[2].partition('"')[0]
    assert b64decode(picture).decode() == thesis().plot("linkage")._repr_svg_()
    assert "triple rocker" in shown
    assert unescape(shown.partition("<pre>")[2]) == f"{dump(thesis())}</pre>"
    assert HOSTILE not in replace(thesis(), title=HOSTILE)._repr_html_()


def test_a_scene_that_cannot_be_drawn_shows_its_table_and_why(monkeypatch):
    shown = thesis(0.9)._repr_html_()
    assert "<img" not in shown and "does not assemble" in shown
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    shown = thesis()._repr_html_()
    assert "<img" not in shown and "pip install" in shown and "triple rocker" in shown


def test_a_solution_shows_its_ends_and_says_what_is_between():
    solution = solve(crank_rocker())
    shown = solution._repr_html_()
    assert shown.count("<tr>") == 1 + 10 + 1 and "51 more" in shown
    assert f"{math.degrees(solution.theta_2[-1]):.4f}" in shown
    short = solve(thesis())._repr_html_()
    assert short.count("<tr>") == 2 and "more" not in short


def test_without_pandas_one_line_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with raises(DependencyError, match="pip install pandas"):
        solve(thesis()).to_pandas()


@mark.parametrize(
    "result",
    [
        lambda: solve(LOOSE),
        lambda: solve(LOOSE, "position"),
        lambda: sensitivity(LOOSE),
        lambda: tolerances(LOOSE, 64),
        lambda: STUDY,
        lambda: solve(STUDY),
    ],
    ids=["solution", "positions", "slopes", "spread", "study", "solved study"],
)
def test_results_say_in_ten_lines_what_they_hold(result):
    text = repr(result())
    rows = text.splitlines()
    assert 2 <= len(rows) <= 10 and max(map(len, rows)) <= 150
    assert LOOSE.title in text and "61" in text


def test_a_solution_says_how_many_positions_it_has():
    assert "evaluated: theta_2, " in repr(solve(LOOSE))
    assert "status: 122 ok, 61 not_assembled" in repr(solve(STUDY))
    one = solve(vary(replace(LOOSE, motion=Motion(1.0)), {"lengths.input": 0.1}))
    for shown in (repr(one), one._repr_html_()):
        assert "1 linkage, 1 position each" in shown


def test_slopes_name_the_length_that_changes_most_and_spreads_their_deviation():
    """By 1 % of a length, and by 1 deg."""
    slopes = sensitivity(LOOSE)
    spread = tolerances(LOOSE, 64)
    steps = {
        key: 0.01 * number
        for key, number in zip(slopes.keys, slopes.numbers, strict=True)
        if key.startswith("lengths.")
    }
    steps["lengths.ground_angle"] = math.radians(1.0)
    change, most = max(
        (abs(slopes.of("torque", key)).max() * step, key) for key, step in steps.items()
    )
    line = re.search("<td>torque</td>.*?</tr>", slopes._repr_html_())
    assert f"{most} {change:.3g}" in line[0]
    sigma = f"{spread.spreads['torque'].deviation.max():.3g}"
    assert re.search(f"<td>torque</td>.*?<td>{sigma}</td>", spread._repr_html_())
    for outcome in (slopes, spread):
        hostile = replace(outcome, scene=replace(LOOSE, title=HOSTILE))
        assert outcome._repr_html_().count("<tr>") == 8
        assert HOSTILE not in hostile._repr_html_()


def test_sensitivities_and_tolerances_as_pandas_and_by_one_set_of_names():
    importorskip("pandas", reason="to_pandas needs pandas: pip install pandas")
    slopes = sensitivity(LOOSE)
    spread = tolerances(LOOSE, 64)
    table = slopes.to_pandas()
    assert len(table) == len(slopes.keys) * 61
    rows = table[table["key"] == "lengths.input"]
    for name in ("torque", "F12_x", "|F12|", "|F14|", "A_y"):
        assert_array_equal(rows[name], slopes.of(name, "lengths.input"))
    assert set(spread.spreads) <= set(table.columns)
    assert all(np.isfinite(slopes.value(name)).all() for name in spread.spreads)


def test_the_slope_of_a_size_is_its_difference():
    step = 1e-6
    around = vary(LOOSE, {"lengths.input": 0.1 + step * np.array([1.0, -1.0])})
    ahead, back = np.hypot(*np.moveaxis(solve(around).F12, -1, 0))
    slope = (ahead - back) / (2.0 * step)
    slopes = sensitivity(LOOSE)
    close = 1e-6 * abs(slope).max()
    assert slopes.of("|F12|", "lengths.input") == approx(slope, abs=close)
    for wrong in ("|A|", "F12_z", "|torque|", "torque_x", 3):
        with raises(InputError, match=r"is not known here; known: .*F12"):
            slopes.of(wrong, "lengths.input")
    with raises(InputError, match=r"is not known here; known: .*lengths\.input"):
        slopes.of("torque", "lengths.inptu")
