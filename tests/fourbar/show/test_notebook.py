"""Scenes and solutions in a notebook, as tables, and new scene files."""

import csv
import io
import math
import subprocess
import sys
from base64 import b64decode
from dataclasses import replace

import numpy as np
import pytest

import fourbar
from fourbar import Tolerance, sensitivity, solve, tolerances, vary
from fourbar.cli import status
from fourbar.errors import DependencyError, InputError
from fourbar.files import scene_file as files
from fourbar.files.scene_text import write_new_scene
from tests.support.scenes import crank_rocker, thesis

HOSTILE = "<script>alert(1)</script>&"


@pytest.mark.slow
def test_a_scene_shows_itself():
    pytest.importorskip(
        "matplotlib", reason="drawing needs matplotlib: pip install matplotlib"
    )
    shown = thesis()._repr_html_()
    picture = b64decode(
        shown.partition("data:image/svg+xml;base64,")[2].partition('"')[0]
    )
    assert picture.decode() == thesis().plot("linkage")._repr_svg_()
    assert "triple rocker" in shown and "57 kg" in shown and "bar 4 (output)" in shown
    assert HOSTILE not in replace(thesis(), title=HOSTILE)._repr_html_()


def test_a_scene_that_cannot_be_drawn_shows_why():
    shown = thesis(0.9)._repr_html_()
    assert "<img" not in shown and "does not assemble" in shown


def test_without_matplotlib_a_scene_shows_its_table_and_what_to_install(monkeypatch):
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


def test_a_solution_as_pandas_and_csv_says_the_same_bit_for_bit():
    pytest.importorskip("pandas", reason="to_pandas needs pandas: pip install pandas")
    solution = solve(crank_rocker())
    table = solution.to_pandas()
    assert len(table) == len(solution)
    assert np.array_equal(table["torque"].to_numpy(), solution.torque)
    assert np.array_equal(table[["F12_x", "F12_y"]].to_numpy(), solution.F12)
    text = solution.to_csv()
    rows = list(csv.DictReader(io.StringIO(text)))
    assert [float(row["F14_y"]) for row in rows] == solution.F14[:, 1].tolist()
    assert set(table.columns) <= set(rows[0])
    positions = solve(crank_rocker(), "position").to_pandas()
    assert "torque" not in positions and "theta_3" in positions


def test_csv_goes_to_a_file(tmp_path):
    solution = solve(thesis())
    assert solution.to_csv(tmp_path / "a.csv", degrees=True) is None
    assert (tmp_path / "a.csv").read_text() == solution.to_csv(degrees=True)


def test_without_pandas_one_line_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(DependencyError, match="pip install pandas"):
        solve(thesis()).to_pandas()


@pytest.mark.slow
def test_showing_needs_numpy_alone():
    code = (
        "import sys, fourbar as f; s = f.Scene(f.FourBar(4.0, f.Bar(2.0), f.Bar(5.0),"
        " f.Bar(5.0)), f.Motion(1.0, 1.0));sys.modules['matplotlib'] = None;"
        " s._repr_html_(); f.solve(s)._repr_html_(); del sys.modules['matplotlib'];"
        " print(*{n.partition('.')[0] for n in sys.modules})"
    )
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    assert not {"pandas", "matplotlib", "pint", "rich", "click", "scipy"} & set(loaded)


def test_a_new_scene_is_a_scene_and_its_comments_are_entries(tmp_path):
    text = write_new_scene(("20 cm", "0.48 m", "55 cm", "20 cm"))
    scene = files.loads(text)
    assert scene.linkage.lengths == (0.2, 0.48, 0.55, 0.2)
    assert [scene.linkage.bar(n).mass for n in (2, 3, 4)] == [0.48, 0.55, 0.2]
    assert np.isfinite(solve(scene).torque).all()
    opened = []
    for (
        line
    ) in text.splitlines():  # every commented entry is one that a scene file may have
        entry = line.removeprefix("# ")
        opened.append(
            entry
            if line != entry and ("=" in entry.split("#")[0] or entry.startswith("["))
            else line
        )
    uncommented = "\n".join(line for line in opened if not line.startswith("As many"))
    full = files.loads(uncommented.replace("# As many loads", "#"))
    assert len(full.loads) == 2 and len(full.effects) == 2 and full.motion.branch == -1


@pytest.mark.parametrize(
    "lengths, words",
    [
        (("1 m", "2 m", "3 m", "40 m"), "never close"),
        (("1 kg", "2 m", "3 m", "4 m"), "ground"),
        (("1 m", "2 m", "-3 m", "4 m"), "coupler"),
        (("1 m", "2 m", "3 m", "4"), "output.*unit is missing"),
    ],
)
def test_a_new_scene_of_bad_lengths_is_refused(lengths, words):
    with pytest.raises(InputError, match=words):
        write_new_scene(lengths)


def test_a_new_scene_never_replaces_a_file(tmp_path, capsys):
    file = tmp_path / "mine.toml"
    assert (
        status(["new", str(file), "--lengths", "4", "2", "5", "5", "--unit", "m"]) == 0
    )
    before = file.read_text()
    assert (
        status(["new", str(file), "--lengths", "4", "2", "5", "6", "--unit", "m"]) == 2
    )
    assert "file exists" in capsys.readouterr().err
    assert file.read_text() == before


def test_results_say_in_ten_lines_what_they_hold():
    scene = crank_rocker(tolerances=(Tolerance("lengths.input", 1e-4),))
    solution = solve(scene)
    slopes = sensitivity(scene)
    spread = tolerances(scene, 64)
    study = vary(scene, {"lengths.input": np.array([0.1, 0.11, 3.0])})
    for shown in (
        solution,
        slopes,
        spread,
        study,
        solve(study),
        solve(scene, "position"),
    ):
        text = repr(shown)
        assert (
            2 <= len(text.splitlines()) <= 10
            and max(map(len, text.splitlines())) <= 150
        ), text
        assert scene.title in text and "61" in text
    assert (
        f"torque: {solution.torque.min():.6g} to {solution.torque.max():.6g} N m"
        in repr(solution)
    )
    assert "status: 122 ok, 61 not_assembled" in repr(solve(study))
    one = solve(
        vary(fourbar.Scene(scene.linkage, fourbar.Motion(1.0)), {"lengths.input": 0.1})
    )
    assert "1 linkage, 1 position each" in repr(one)
    assert "1 linkage, 1 position each" in one._repr_html_()
    lengths = {
        key: number
        for key, number in zip(slopes.keys, slopes.numbers, strict=True)
        if key.startswith("lengths")
    }
    changes = {
        key: np.abs(slopes.of("torque", key)).max() * 0.01 * number
        for key, number in lengths.items()
    }
    changes["lengths.ground_angle"] *= math.radians(1.0) / (
        0.01 * lengths["lengths.ground_angle"]
    )
    most = max(changes, key=lambda key: changes[key])
    line = next(line for line in repr(slopes).splitlines() if line.startswith("torque"))
    assert f"{most} {changes[most]:.3g}" in line
    assert f"sigma up to {spread.spreads['torque'].deviation.max():.3g}" in repr(spread)
    for outcome in (slopes, spread):
        shown = outcome._repr_html_()
        assert shown.count("<tr>") == 8
        assert (
            HOSTILE
            not in replace(outcome, scene=replace(scene, title=HOSTILE))._repr_html_()
        )


def test_sensitivities_and_tolerances_as_pandas_and_by_one_set_of_names():
    pytest.importorskip("pandas", reason="to_pandas needs pandas: pip install pandas")
    scene = crank_rocker(tolerances=(Tolerance("lengths.input", 1e-4),))
    slopes, spread = sensitivity(scene), tolerances(scene, 64)
    table = slopes.to_pandas()
    assert len(table) == len(slopes.keys) * 61
    rows = table[table["key"] == "lengths.input"]
    for name in ("torque", "F12_x", "|F12|", "|F14|", "A_y"):
        assert np.array_equal(rows[name].to_numpy(), slopes.of(name, "lengths.input"))
    assert set(spread.spreads) <= set(table.columns)
    assert all(np.isfinite(slopes.value(name)).all() for name in spread.spreads)
    step = 1e-6
    sides = [
        solve(vary(scene, {"lengths.input": [0.1 + sign * step]})).F12[0]
        for sign in (1, -1)
    ]
    slope = (np.hypot(*sides[0].T) - np.hypot(*sides[1].T)) / (2.0 * step)
    assert slopes.of("|F12|", "lengths.input") == pytest.approx(
        slope, abs=1e-6 * np.abs(slope).max()
    )
    wide = spread.to_pandas()
    of_F43 = wide[wide["quantity"] == "|F43|"]
    assert len(wide) == 61 * len(spread.spreads)
    assert np.array_equal(
        of_F43["deviation"].to_numpy(), spread.spreads["|F43|"].deviation
    )
    assert np.array_equal(
        of_F43["share of lengths.input"].to_numpy(), spread.spreads["|F43|"].shares[0]
    )
    for wrong in ("|A|", "F12_z", "|torque|", "torque_x", 3):
        with pytest.raises(InputError, match="is not known here"):
            slopes.of(wrong, "lengths.input")
