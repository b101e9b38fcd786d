"""The command line.

Schema of JSON and CSV, the table, exit statuses, files that appear whole or not at all.
"""

import csv
import io
import json
import math
import os
import re
import shlex
import stat
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import fourbar
from fourbar.cli import group, status
from fourbar.errors import BAD_INPUT, BROKEN, HOLDS, INTERRUPTED, DependencyError
from fourbar.evaluation.case import Case
from fourbar.files import load, save
from fourbar.quantities import UNITS, VECTORS
from fourbar.show import tables
from tests.support.scenes import crank_rocker, thesis

ROOT = Path(__file__).parents[3]
MODELS = ROOT / "models"
STROKE = MODELS / "capabilities" / "stroke_input.toml"
CONTRACT = (
    "schema",
    "title",
    "status",
    "branch",
    "theta_2",
    "theta_3",
    "theta_4",
    "omega_2",
    "omega_3",
    "omega_4",
    "alpha_2",
    "alpha_3",
    "alpha_4",
    "A",
    "B",
    "G2",
    "G3",
    "G4",
    "a_A",
    "a_B",
    "a_G2",
    "a_G3",
    "a_G4",
    "F12",
    "F32",
    "F43",
    "F14",
    "torque",
    "drive_bar",
    "sin_mu",
    "condition",
    "assembled",
)
"""The keys that programs which read the JSON rely on."""
Ended = tuple[int, str, str]
Fourbar = Callable[..., Ended]


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Fourbar:
    """Runs a command in this process: exit status, standard output, standard error."""

    def call(*arguments: object) -> Ended:
        code = status([str(argument) for argument in arguments])
        printed = capsys.readouterr()
        return code, printed.out, printed.err

    return call


def strict(text: str) -> dict[str, object]:
    """JSON without the NaN and Infinity that Python would let pass."""

    def refuse(name: str) -> float:
        raise AssertionError(name)

    document = json.loads(text, parse_constant=refuse)
    assert isinstance(document, dict)
    return document


def same(printed: object, array: np.ndarray) -> bool:
    """Bit-equal, with null for NaN."""
    expected = np.where(np.isfinite(array), array, np.nan)
    return np.array_equal(np.array(printed, dtype=float), expected, equal_nan=True)


@pytest.mark.parametrize("name", ["thesis", "drag_link"])
def test_json_has_every_key_and_every_digit(name: str, run: Fourbar) -> None:
    code, out, err = run("analyze", MODELS / f"{name}.toml", "--json")
    document, solution = strict(out), fourbar.solve(load(MODELS / f"{name}.toml"))
    assert (code, err, out.count("\n")) == (HOLDS, "", 1)
    assert set(CONTRACT) <= set(document)
    for quantity in solution.evaluated():
        assert same(document[quantity], getattr(solution, quantity)), quantity
    assert document["status"] == solution.status and document["assembled"] == [
        True
    ] * len(solution)
    assert document["drive_bar"] == solution.drive_bar and document["branch"] == [
        1
    ] * len(solution)
    assert document["title"] == solution.title and document["angle_unit"] == "rad"
    assert "time" not in document


def test_one_position_is_still_an_array(tmp_path: Path, run: Fourbar) -> None:
    save(thesis(math.radians(135.0)), tmp_path / "scene.toml")
    document = strict(run("analyze", tmp_path / "scene.toml", "--json")[1])
    assert np.shape(document["torque"]) == (1,) and np.shape(document["F12"]) == (1, 2)


def test_null_where_there_is_no_value(tmp_path: Path, run: Fourbar) -> None:
    sweep = fourbar.Motion(np.radians([10.0, 135.0]), 0.2244)
    save(crank_rocker(linkage=thesis().linkage, motion=sweep), tmp_path / "scene.toml")
    code, out, _ = run("analyze", tmp_path / "scene.toml", "--json")
    document = strict(out)
    assert (
        code == HOLDS
        and document["status"] == ["not_assembled", "ok"]
        and document["assembled"] == [False, True]
    )
    for quantity in set(UNITS) & set(CONTRACT) - {
        "theta_2",
        "omega_2",
        "alpha_2",
        "A",
        "G2",
        "a_A",
        "a_G2",
    }:
        first, second = document[quantity]  # type: ignore[misc]
        nothing = [None, None] if quantity in VECTORS else None
        assert first == nothing and second not in (None, [None, None]), quantity


def test_positions_only(tmp_path: Path, run: Fourbar) -> None:
    save(crank_rocker(motion=fourbar.Motion(1.0)), tmp_path / "scene.toml")
    document = strict(run("analyze", tmp_path / "scene.toml", "--json")[1])
    assert document["theta_3"] is not None and set(CONTRACT) <= set(document)
    assert (
        document["torque"] is None
        and document["F12"] is None
        and document["omega_2"] is None
    )
    code, out, _ = run("analyze", tmp_path / "scene.toml")
    assert code == HOLDS and "bar 3 " in out and "N m" not in out
    rows = list(
        csv.DictReader(io.StringIO(run("analyze", tmp_path / "scene.toml", "--csv")[1]))
    )
    assert rows[0]["torque [N m]"] == "" and rows[0]["theta_2 [rad]"] == "1.0"


def test_a_free_motion_has_time_and_no_drive(tmp_path: Path, run: Fourbar) -> None:
    released = fourbar.Motion(0.5, 0.0, free=fourbar.Free(0.5, 4))
    save(crank_rocker(motion=released), tmp_path / "scene.toml")
    assert strict(run("analyze", tmp_path / "scene.toml", "--json")[1])["time"] == [
        0.0,
        0.125,
        0.25,
        0.375,
        0.5,
    ]
    out = run("analyze", tmp_path / "scene.toml")[1]
    assert (
        "released for 0.5 s, without a drive" in out
        and " at t = " in out
        and "torque" not in out
    )


@pytest.mark.parametrize("ending", ["csv", "json", "txt"])
def test_a_file_holds_what_would_be_printed_and_its_name_asks_for_the_form(
    ending: str,
    tmp_path: Path,
    run: Fourbar,
) -> None:
    scene, named, asked = (
        tmp_path / "scene.toml",
        tmp_path / f"named.{ending}",
        tmp_path / "asked",
    )
    save(crank_rocker(), scene)
    form = () if ending == "txt" else (f"--{ending}",)
    printed = run("analyze", scene, *form)[1]
    for options in ((named,), (asked, *form)):
        assert run("analyze", scene, "-o", *options) == (HOLDS, "", "")
        assert options[0].read_text() == printed
    if ending == "json":
        assert (
            run("classify", 4, 2, 3, 3, "-o", named)[0]
            == 0
            == run("classify", 4, 2, 3, 3, "--json", "-o", asked)[0]
        )
        assert named.read_bytes() == asked.read_bytes()


@pytest.mark.parametrize(
    ("command", "name", "written"),
    [
        ("analyze", "a.xlsx", ".csv"),
        ("equilibrium", "a.csv", ".json"),
        ("usd", "a.usdc", ".usda"),
        ("mjcf", "a.sdf", ".xml"),
    ],
)
def test_text_is_not_written_under_a_name_whose_readers_refuse_it(
    command: str,
    name: str,
    written: str,
    tmp_path: Path,
    run: Fourbar,
) -> None:
    code, _, err = run(command, MODELS / "crank_rocker.toml", "-o", tmp_path / name)
    assert (
        code == BAD_INPUT
        and err.count("\n") == 1
        and written in err
        and "no ending" in err
    )
    assert not (tmp_path / name).exists()


@pytest.mark.parametrize(("command", "ending"), [("sdf", "sdf"), ("usd", "usda")])
def test_four_lengths_are_written_for_every_simulator(
    command: str,
    ending: str,
    tmp_path: Path,
    run: Fourbar,
) -> None:
    lengths = ("300 mm", "10 cm", 0.25, 0.22)
    target = tmp_path / f"bars.{ending}"
    code, out, err = run(
        command, "--lengths", *lengths, "--omega", "60 rpm", "-o", target
    )
    assert (code, err) == (0, "") and "1 kg/m" in out
    writer = import_module("fourbar.mjcf.assembly")
    made = import_module("fourbar.mjcf").make_scene(
        0.3,
        0.1,
        0.25,
        0.22,
        omega=2.0 * math.pi,
    )
    written = getattr(writer, f"write_{command}")(made)
    assert target.read_text(encoding="utf-8") == written


def test_what_rests_at_every_angle_is_no_range_of_one(
    tmp_path: Path,
    run: Fourbar,
) -> None:
    bar = fourbar.Bar(0.1, 1.0, centre=(0.0, 0.0))
    linkage = fourbar.FourBar(0.3, bar, fourbar.Bar(0.25), fourbar.Bar(0.22))
    motion = fourbar.Motion(fourbar.Sweep(0.0, 2.0 * math.pi, 36), 1.0)
    scene = fourbar.Scene(linkage, motion, effects=(fourbar.Gravity(),))
    save(scene, tmp_path / "balanced.toml")
    code, out, _ = run("equilibrium", tmp_path / "balanced.toml")
    assert code == 0
    assert "indifferent (Q = 0 throughout): everywhere on its circuit" in out


def test_csv_has_the_same_numbers(run: Fourbar) -> None:
    file = MODELS / "crank_rocker.toml"
    code, out, err = run("analyze", file, "--csv", "--units", "SI")
    rows, solution = list(csv.DictReader(io.StringIO(out))), fourbar.solve(load(file))
    assert (code, err, len(rows)) == (HOLDS, "", 361)
    for quantity in solution.evaluated():
        names = (
            [f"{quantity}_x", f"{quantity}_y"] if quantity in VECTORS else [quantity]
        )
        printed = np.array([[float(row[name]) for name in names] for row in rows])
        assert np.array_equal(
            printed, getattr(solution, quantity).reshape(printed.shape)
        ), quantity
    assert {row["status"] for row in rows} == {"ok"} and {
        row["drive_bar"] for row in rows
    } == {"2"}


@pytest.mark.parametrize(
    "name", ["=cmd|'calc'!A0", "+1", "-A1", "@SUM(A1)", "P,=1+1", "P\n=1+1"]
)
def test_a_heading_of_csv_is_a_word_and_no_formula(
    name: str,
    tmp_path: Path,
    run: Fourbar,
) -> None:
    """A spreadsheet calculates a cell that begins with =.

    A point's name heads its columns.
    """
    save(
        crank_rocker(points=(fourbar.Point("P", 3, (0.1, 0.7)),)),
        tmp_path / "scene.toml",
    )
    printed = run("analyze", tmp_path / "scene.toml", "--csv", "--units", "SI")[1]
    header = printed.splitlines()[0]
    assert "P_x" in header and all(
        cell.strip("|").replace("/", "_").isidentifier() for cell in header.split(",")
    )
    text = (tmp_path / "scene.toml").read_text()
    (tmp_path / "scene.toml").write_text(
        text.replace("P = ", f"{json.dumps(name)} = ", 1)
    )
    code, out, err = run("analyze", tmp_path / "scene.toml", "--csv")
    assert (code, out) == (BAD_INPUT, "") and "must be a word of letters" in err


def test_degrees_are_of_angles_alone_and_named(run: Fourbar) -> None:
    file = MODELS / "crank_rocker.toml"
    plain, turned = (
        strict(run("analyze", file, "--json", *more)[1])
        for more in ((), ("--degrees",))
    )
    assert turned["angle_unit"] == "deg"
    for key in CONTRACT[1:]:
        if key in ("theta_2", "theta_3", "theta_4"):
            assert np.allclose(
                turned[key],
                np.degrees(plain[key]),
                rtol=1e-15,
                atol=0.0,
            )  # type: ignore[arg-type]
        else:
            assert turned[key] == plain[key], key
    rows = list(
        csv.DictReader(
            io.StringIO(run("analyze", file, "--csv", "--units", "SI", "--degrees")[1])
        )
    )
    assert (
        float(rows[90]["theta_2 [deg]"]) == pytest.approx(90.0, rel=1e-15)
        and "theta_2" not in rows[0]
    )


@pytest.mark.slow
def test_the_table_of_positions_says_in_what_units(run: Fourbar) -> None:
    code, out, err = run("analyze", MODELS / "thesis.toml", "--table")
    assert (code, err) == (HOLDS, "")
    lines = out.split("\n")
    assert lines[0] == "Thesis model mechanism"
    heading = next(
        index for index, line in enumerate(lines) if "theta_2 " in line and "T4" in line
    )
    assert lines[heading + 1].split()[:3] == ["deg", "N", "m"]
    assert "…" not in out and len([line for line in lines if line.strip()]) > 361
    radians = run("analyze", MODELS / "thesis.toml", "--table", "--radians")[1].split(
        "\n"
    )
    assert radians[heading + 1].split()[0] == "rad"


def test_a_terminal_gets_some_forty_rows() -> None:
    lines = tables_text(load(MODELS / "crank_rocker.toml"), 80).splitlines()
    rows = [line for line in lines if re.match(r" *\d+\.\d{4} ", line)]
    assert (
        len(rows) == 37
        and rows[1].split()[0] == "10.0000"
        and rows[-1].split()[0] == "360.0000"
    )
    assert lines.index(rows[-1]) < lines.index(
        "shown: every 10th of the 361 positions; --all shows each"
    )
    assert max(map(len, lines)) <= 80


@pytest.mark.slow
def test_every_thins_the_table_and_keeps_its_last_position(run: Fourbar) -> None:
    thinned = run("analyze", MODELS / "crank_rocker.toml", "--every", 100)[
        1
    ].splitlines()
    rows = [line.split()[0] for line in thinned if re.match(r" *\d+\.\d{4} ", line)]
    assert rows == ["0.0000", "100.0000", "200.0000", "300.0000", "360.0000"]
    every = [
        run("analyze", MODELS / "crank_rocker.toml", form)[1]
        for form in ("--all", "--table")
    ]
    assert every[0] == every[1] and every[0].count("\n") > 361


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("analyze", "x.toml", "--json", "--csv"), "give one of them"),
        (("analyze", "x.toml", "--json", "--every", 2), "hold every position"),
        (
            ("analyze", MODELS / "crank_rocker.toml", "--pressure", "210 bar"),
            "needs a cylinder",
        ),
        (
            (
                "analyze",
                MODELS / "capabilities" / "push_output.toml",
                "--pressure",
                "10 MPa",
            ),
            "needs a cylinder",
        ),
        (
            (
                "analyze",
                MODELS / "gallery" / "excavator_bucket.toml",
                "--pressure",
                210,
            ),
            'did you mean "210 bar"?',
        ),
        (
            ("plot", MODELS / "crank_rocker.toml", "-o", "a.svg", "--at", "12"),
            'did you mean "12 deg"?',
        ),
        (
            ("plot", STROKE, "-o", "a.svg", "--at", "350"),
            'did you mean "350 mm"?',
        ),
        (("new", "--lengths", 3, 1, 2, 2), "name the new file once"),
    ],
)
def test_what_contradicts_itself_or_lacks_a_unit_is_refused(
    arguments: tuple[object, ...],
    words: str,
    run: Fourbar,
) -> None:
    code, out, err = run(*arguments)
    assert (code, out) == (2, "") and words in err and err.count("\n") == 1


def test_no_command_is_a_question_for_help(
    run: Fourbar,
    capsys: pytest.CaptureFixture[str],
) -> None:
    code, out, err = run()
    assert (code, err) == (HOLDS, "") and out == run("-h")[1] and "analyze" in out
    described = out[out.index("Begin:") :].split()
    for command in group.commands.values():  # each whole, in the lines of 80 columns
        words = [command.name, *command.get_short_help_str(limit=1000).split()]
        assert any(
            described[i : i + len(words)] == words for i in range(len(described))
        ), command.name
    assert max(map(len, out.splitlines())) <= 80
    assert run("-V")[1] == f"fourbar, version {fourbar.__version__}\n"
    harness = import_module("fourbar_validation.cli").status([])
    assert harness == HOLDS and "advise" in capsys.readouterr().out


def test_the_shell_completes(run: Fourbar, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("_FOURBAR_COMPLETE", "zsh_source")
    code, out, _ = run()
    assert code == HOLDS and "compdef" in out


def test_a_narrow_terminal_gets_whole_columns_and_the_names_of_what_is_missing() -> (
    None
):
    scene = crank_rocker()
    for width in (40, 80, 120):
        text = tables_text(scene, width)
        assert (
            max(
                len(line)
                for line in text.split("\n")
                if not line.startswith("not shown")
            )
            <= width
        )
        assert "…" not in text and "not shown: " in text and "T2" in text
    assert "not shown" not in tables_text(scene, 400)


def tables_text(scene: fourbar.Scene, width: int) -> str:
    return tables.print_positions(fourbar.solve(scene), width)


def test_the_digits_of_the_torque() -> None:
    solution = fourbar.solve(crank_rocker(), "error")
    column = next(
        cells
        for name, cells in tables.list_columns(solution).items()
        if "digits" in name
    )
    for cell, torque, error in zip(
        column,
        solution.torque,
        solution.torque_error,
        strict=True,
    ):
        digits = int(cell)
        assert error <= abs(torque) * 10.0**-digits or digits == 0
        assert digits == tables.MOST_DIGITS or error > abs(torque) * 10.0 ** -(
            digits + 1
        )


CLASSES = [
    ("0.3 0.1 0.25 0.22", "crank-rocker"),
    ("0.1 0.3 0.25 0.28", "double crank"),
    ("0.3 0.24 0.1 0.22", "double rocker"),
    ("0.3 0.22 0.25 0.1", "rocker-crank"),
    ("20cm 48cm 55cm 20cm", "triple rocker"),
    (
        "0.3 0.1 0.2 0.2",
        "change-point crank-rocker",
    ),  # 0.3 + 0.1 and 0.2 + 0.2 differ as doubles
    ("0.1 0.3 0.1 0.3", "parallelogram"),
]


@pytest.mark.parametrize(("lengths", "name"), CLASSES)
def test_classify(lengths: str, name: str, run: Fourbar) -> None:
    code, out, err = run("classify", *lengths.split())
    assert (code, err) == (HOLDS, "") and out.startswith(name)


def test_what_is_printed_can_be_written(tmp_path: Path, run: Fourbar) -> None:
    assert run("classify", 3, 1, 2.5, 2.2, "-o", tmp_path / "type.txt") == (
        HOLDS,
        "",
        "",
    )
    assert (tmp_path / "type.txt").read_text() == run("classify", 3, 1, 2.5, 2.2)[1]
    assert (
        run(
            "new",
            "-o",
            tmp_path / "a.toml",
            "--lengths",
            300,
            100,
            "25cm",
            220,
            "--unit",
            "mm",
        )[0]
        == HOLDS
    )
    assert load(tmp_path / "a.toml").linkage.lengths == (0.3, 0.1, 0.25, 0.22)
    for name, command in group.commands.items():
        wanted = (
            "--exports" if name == "edit" else "--out"
        )  # the workbench writes what its page asks for
        assert any(wanted in option.opts for option in command.params), name


def test_a_length_that_is_written_to_a_file_has_a_unit(
    tmp_path: Path,
    run: Fourbar,
) -> None:
    code, _, err = run("new", tmp_path / "a.toml", "--lengths", 300, 100, 250, 220)
    assert (
        code == BAD_INPUT and "--unit mm" in err and not (tmp_path / "a.toml").exists()
    )
    assert "s + l = 400 < p + q = 470\n" in run("classify", 300, 100, 250, 220)[1]
    assert (
        "s + l = 400 mm < p + q = 470 mm\n"
        in run("classify", "30cm", "100mm", "25cm", "0.22m")[1]
    )
    assert (
        "s + l = 40 in < p + q = 47 in\n"
        in run("classify", "30in", "10in", "25in", "22in")[1]
    )
    assert run("classify", "30cm", 100, 250, 220)[0] == BAD_INPUT


def test_classify_says_what_turns_and_how_far(run: Fourbar) -> None:
    """Numbers by the law of cosines in the triangles that the bars make.

    There two of them are collinear.
    """

    def angle(opposite: float, first: float, second: float) -> float:
        return math.degrees(
            math.acos((first**2 + second**2 - opposite**2) / (2.0 * first * second))
        )

    d, a, b, c = 0.3, 0.1, 0.25, 0.22
    lines = run("classify", d, a, b, c)[1].splitlines()
    stretched, folded = angle(c, d, b + a), 180.0 + angle(c, d, b - a)
    row = next(
        line.split()
        for line in lines
        if line.startswith("  output: input, coupler stretched") and "open" in line
    )
    assert [float(cell) for cell in row[4:7]] == pytest.approx(
        [stretched, stretched, 180.0 - angle(a + b, d, c)],
        abs=6e-5,
    )
    row = next(
        line.split()
        for line in lines
        if line.startswith("  output: input, coupler folded") and "open" in line
    )
    assert [float(cell) for cell in row[4:6]] == pytest.approx(
        [folded, folded - 180.0],
        abs=6e-5,
    )
    least, greatest = angle(d - a, b, c), angle(d + a, b, c)
    swung = angle(b - a, d, c) - angle(b + a, d, c)
    one_stroke = folded - stretched
    for line in (
        f"angle between coupler and output: {least:.4f} deg at theta_2 = 0.0000 deg",
        f"    to {greatest:.4f} deg at 180.0000 deg",
        "input: no limits, coupler and output are never in line:",
        "    ground + input = 0.4 < coupler + output = 0.47",
        "    |ground - input| = 0.2 > |coupler - output| = 0.03",
        f"smallest transmission angle: {least:.4f} deg",
        (
            "time ratio of the output strokes at constant omega_2:"
            f" {one_stroke / (360.0 - one_stroke):.4f}"
        ),
    ):
        assert line in lines
    assert f"output {abs(swung):.4f} deg" in lines[3]
    assert not any(line.startswith("  coupler:") for line in lines)
    every = run("classify", d, a, b, c, "--all")[1].splitlines()
    assert sum(line.startswith("  coupler:") for line in every) == 4 and set(
        lines
    ) <= set(every)
    assert (
        "change points: theta_2 = 0.0000 deg and 180.0000 deg"
        in run("classify", 2, 1, 2, 1)[1]
    )
    assert (
        "are in line at change points alone:\n    ground + input = 3 = coupler"
        in run("classify", 2, 1, 2, 1)[1]
    )
    assert (
        len(run("classify", 3, 1, 1, 1)[1].splitlines()) == 3
    )  # a structure does not move


def test_mjcf_of_a_scene_and_of_bare_lengths(tmp_path: Path, run: Fourbar) -> None:
    from fourbar.mjcf import list_defaults, make_scene
    from fourbar.mjcf.document import write_mjcf_for

    code, out, err = run("mjcf", MODELS / "crank_rocker.toml", "-o", tmp_path / "a.xml")
    assert (code, out, err) == (HOLDS, "", "")
    assert (tmp_path / "a.xml").read_text() == write_mjcf_for(
        load(MODELS / "crank_rocker.toml")
    )
    lengths = ["--lengths", 0.3, "10 cm", "250 mm", 0.22]
    code, out, err = run(
        "mjcf", *lengths, "--omega", "60 rpm", "-o", tmp_path / "b.xml"
    )
    scene = make_scene(0.3, 0.1, 0.25, 0.22, omega=2.0 * math.pi)
    assert (code, err) == (HOLDS, "") and out.splitlines() == list_defaults(scene)
    assert (tmp_path / "b.xml").read_text() == write_mjcf_for(scene)
    assert (
        run(
            "mjcf", MODELS / "thesis.toml", "--drive", "motor", "-o", tmp_path / "c.xml"
        )[0]
        == HOLDS
    )
    assert (tmp_path / "c.xml").read_text() == write_mjcf_for(
        load(MODELS / "thesis.toml"),
        drive="motor",
    )


def test_the_command_that_new_names_can_be_copied(tmp_path: Path, run: Fourbar) -> None:
    path = tmp_path / "my wiper.toml"
    out = run("new", path, "--lengths", "3 m", "1 m", "2.5 m", "2.2 m")[1]
    assert shlex.split(out.strip())[-3:] == ["fourbar", "analyze", str(path)]


@pytest.mark.parametrize(
    "bars",
    [
        ("--lengths", "300mm", "100mm", "250mm", "220mm"),
        ("--pins", "0,0 0,100 175,50 250,50", "--unit", "mm"),
    ],
    ids=lambda bars: bars[0],
)
def test_who_asks_for_positions_only_is_told_no_force(
    bars: tuple[str, ...], tmp_path: Path, run: Fourbar
) -> None:
    path = tmp_path / "positions.toml"
    assert run("new", path, *bars, "--positions-only")[0] == HOLDS
    assert load(path).motion.speed is None and load(path).effects == ()
    code, out, _ = run("analyze", path)
    assert code == HOLDS and "transmission angle: at least" in out
    assert not re.search("motor|torque|drive|mass|force", out + path.read_text())


@pytest.mark.parametrize(
    "texts",
    [
        ('12"', '4"', '10"', '9"'),
        ("12″", "4 ″", "10”", "9 in"),
        ("2'", '8"', "1'8\"", "1'6\""),
    ],
)
def test_new_writes_lengths_with_marks_of_inches_as_a_file_that_is_read(
    texts: tuple[str, ...],
    tmp_path: Path,
    run: Fourbar,
) -> None:
    path = tmp_path / "inches.toml"
    assert run("new", path, "--lengths", *texts)[0] == HOLDS
    lengths = load(path).linkage.lengths
    scale = 2.0 if "'" in texts[0] else 1.0
    expected = [0.0254 * scale * inches for inches in (12, 4, 10, 9)]
    assert lengths == pytest.approx(expected, rel=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("units", "unit"), [((), "lbf in"), (("--units", "SI"), "N m")]
)
def test_plot_and_animate_show_the_units_of_the_scene(
    units: tuple[str, ...],
    unit: str,
    tmp_path: Path,
    run: Fourbar,
) -> None:
    path, picture = tmp_path / "inches.toml", tmp_path / "a.svg"
    run("new", path, "--lengths", "12 in", "4 in", "10 in", "9 in")
    assert run("plot", path, *units, "-o", picture)[0] == HOLDS
    assert f"$T_2$ ({unit})" in picture.read_text().replace("mN m", "N m")
    page = tmp_path / "a.html"
    assert run("animate", path, *units, "-o", page)[0] == HOLDS
    assert ('"lbf in"' in page.read_text()) == (unit == "lbf in")


@pytest.mark.parametrize("form", ["sdf", "usd"])
def test_sdf_and_usd_name_the_loads_that_they_leave_out(
    form: str,
    tmp_path: Path,
    run: Fourbar,
) -> None:
    code, _, err = run(form, MODELS / "crank_rocker.toml", "-o", tmp_path / "a")
    assert (
        code == BAD_INPUT
        and "loads (here on bar 3, bar 4)" in err
        and "--without-loads" in err
    )
    assert (
        run(
            form, MODELS / "crank_rocker.toml", "--without-loads", "-o", tmp_path / "a"
        )[0]
        == HOLDS
    )


@pytest.mark.slow
def test_plot_and_animate_write_what_their_ending_says(
    tmp_path: Path,
    run: Fourbar,
) -> None:
    file = MODELS / "crank_rocker.toml"
    drawn = tmp_path / "a.svg"
    assert run("plot", file, "-o", drawn, "--figure", "linkage", "--at", "30 deg") == (
        HOLDS,
        f"wrote {drawn}\n",
        "",
    )
    assert "<svg" in drawn.read_text()
    page = tmp_path / "a.html"
    assert run("animate", file, "-o", page) == (HOLDS, f"wrote {page}\n", "")
    assert "<html" in page.read_text()
    film = tmp_path / "a.gif"
    said = (HOLDS, f"wrote {film}: 3 frames\n", "")
    assert run("animate", file, "-o", film, "--seconds", "0.12") == said
    code, _, err = run("plot", file, "-o", tmp_path / "a.doc")
    assert code == 2 and err.count("\n") == 1 and not (tmp_path / "a.doc").exists()


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (RuntimeError("two\nlines"), BROKEN),
        (MemoryError(), BROKEN),
        (DependencyError("no such library"), BROKEN),
        (KeyboardInterrupt(), INTERRUPTED),
    ],
)
def test_what_goes_wrong_is_one_line_and_a_status(
    error: BaseException,
    code: int,
    run: Fourbar,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    def broken(*_: object) -> None:
        raise error

    monkeypatch.setattr(Case, "of", broken)
    monkeypatch.delenv("FOURBAR_TRACEBACK", raising=False)
    exit_status, out, err = run(
        "analyze", MODELS / "thesis.toml", "--json", "-o", tmp_path / "out"
    )
    # after an interrupt click ends the line that the terminal has started with ^C
    assert (exit_status, out, err.strip().count("\n")) == (code, "", 0) and not list(
        tmp_path.iterdir()
    )
    if isinstance(error, RuntimeError):
        monkeypatch.setenv("FOURBAR_TRACEBACK", "1")
        with pytest.raises(RuntimeError):
            run("analyze", MODELS / "thesis.toml")


def test_a_full_disk_leaves_the_old_file(
    run: Fourbar,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    (tmp_path / "out").write_text("old")
    monkeypatch.setattr("os.fsync", full)
    code, _, err = run(
        "analyze", MODELS / "thesis.toml", "--json", "-o", tmp_path / "out"
    )
    assert code == BROKEN and "No space left" in err and err.count("\n") == 1
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [
        ("out", "old")
    ]


@pytest.mark.parametrize(
    ("out", "why"),
    [
        ("no/out", "no such folder"),
        (".", "a file, not a folder"),
        ("a", "is read here"),
    ],
)
@pytest.mark.parametrize("command", ["analyze", "mjcf"])
def test_an_output_that_cannot_be_is_refused_before_anything_is_solved(
    run: Fourbar,
    command: str,
    out: str,
    why: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(Case, "of", None)
    text = (MODELS / "thesis.toml").read_text()
    (tmp_path / "a").write_text(text)
    code, _, err = run(command, tmp_path / "a", "-o", tmp_path / out)
    assert code == BAD_INPUT and why in err and err.count("\n") == 1
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [
        ("a", text)
    ]


@pytest.mark.posix
def test_a_device_is_written_to_and_stays_one(run: Fourbar, tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDWR | os.O_NONBLOCK)
    try:
        assert run("mjcf", "--lengths", 0.3, 0.1, 0.25, 0.22, "-o", pipe)[0] == HOLDS
        assert b"</mujoco>" in os.read(reader, 60_000) and stat.S_ISFIFO(
            pipe.stat().st_mode
        )
    finally:
        os.close(reader)


def test_a_title_does_not_steer_the_terminal(tmp_path: Path, run: Fourbar) -> None:
    title = "\x1b[2J\x1b]0;x\x07\r\n[bold]name"
    save(crank_rocker(title=title), tmp_path / "scene.toml")
    out = run("analyze", tmp_path / "scene.toml")[1]
    assert (
        "\x1b" not in out
        and "\x07" not in out
        and out.startswith('Crank-rocker "[2J ]0;x [bold]name", open')
    )
    assert (
        strict(run("analyze", tmp_path / "scene.toml", "--json")[1])["title"] == title
    )


def child(*arguments: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=ROOT,
        text=True,
        capture_output=True,
        check=False,
    )


@pytest.mark.slow
def test_the_command_line_starts_light() -> None:
    heavy = "pint rich matplotlib scipy mujoco pinocchio jinja2"
    code = (
        f"import sys, fourbar.cli; print([m for m in {heavy.split()!r} if m in"
        " sys.modules])"
    )
    assert child("-c", code).stdout == "[]\n"
    done = child("-m", "fourbar", "--version")
    assert (done.returncode, done.stdout) == (
        0,
        f"fourbar, version {fourbar.__version__}\n",
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [("classify", "3", "1", "2", "3"), ("analyze", "models/thesis.toml", "--json")],
)
def test_a_reader_that_leaves_early_is_no_error(arguments: tuple[str, ...]) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    command = [sys.executable, "-m", "fourbar", *arguments]
    done = subprocess.run(
        command,
        cwd=ROOT,
        stdout=writing,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
    )
    os.close(writing)
    assert (done.returncode, done.stderr) == (HOLDS, "")


@pytest.mark.slow
@pytest.mark.skipif(
    not Path("/dev/full").exists(),
    reason="only Linux has a device that is always full",
)
def test_standard_output_that_is_full() -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "fourbar", "analyze", "models/thesis.toml"],
            cwd=ROOT, stdout=full, stderr=subprocess.PIPE, text=True, check=False,
        )  # fmt: skip
    assert (done.returncode, done.stderr.count("\n")) == (
        BROKEN,
        1,
    ) and "No space left" in done.stderr


INCHES = """\
[lengths]
ground = "5 in"
input = "2 in"
coupler = "4 in"
output = "4.5 in"
[bars.coupler]
mass = "1 lb"
[motion]
theta_2 = "60 deg"
omega_2 = "60 rpm"
"""
RAM = """\
[drive]
from = { bar = 1, from_pin = ["3 in", "-60 deg"] }
to = { bar = 2, from_pin = ["1 in", "0 deg"] }
"""
GAS_SPRING = """\
[effects]
[[effects.springs]]
from = { bar = 1, from_pin = ["3 in", "-60 deg"] }
to = { bar = 3, from_pin = ["1 in", "0 deg"] }
[effects.springs.gas]
extended = "4 in"
stroke = "2 in"
extended_force = "30 lbf"
compressed_force = "40 lbf"
"""
BY_STROKE = INCHES.replace('theta_2 = "60 deg"', 'stroke = "1 in"\nside = "left"')
BY_STROKE = BY_STROKE.replace('omega_2 = "60 rpm"', 'stroke_speed = "1 in/s"') + RAM


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (INCHES.replace('"5 in"', '"50 in"'), "lengths = 50, 2, 4, 4.5 in: the bars"),
        (INCHES.replace('"5 in"', '"50 in"'), "of the other three, 10.5 in"),
        (INCHES.replace('"2 in"', "2"), 'did you mean "2 in"?'),
        (INCHES.replace('"1 lb"', '"1 in"'), 'like "1 lb"'),
        (BY_STROKE, "motion.stroke = 1 in: this cylinder can have 2 to 4 in"),
        (INCHES + RAM.replace('"1 in"', '"0 in"'), "drive.to = 'bar 2 at 0 in'"),
        (
            INCHES + GAS_SPRING.replace('"2 in"', '"6 in"'),
            "springs[0].gas.stroke = 6 in: must be less than the extended length, 4 in",
        ),
        (
            INCHES + GAS_SPRING.replace('"40 lbf"', '"20 lbf"'),
            "compressed_force = 20 lbf: must be no less than the extended_force,"
            " 30 lbf",
        ),
        (
            INCHES + '[tolerances]\n"lengths.input" = "3 in"\n',
            "must be less than the number itself, 2 in",
        ),
        (
            INCHES.replace('"5 in"', '"7 in"').replace('"60 deg"', '"180 deg"'),
            "positions requested; theta_2 goes from -133.433 to 133.433 deg",
        ),
        (
            '[pins]\nO2 = ["1 in", "2 in"]\nA = ["1 in", "2 in"]\n'
            'B = ["7 in", "2 in"]\nO4 = ["9 in", "1 in"]\n',
            "pins.A = 1, 2 in: lies where O2 does",
        ),
    ],
)
def test_a_message_has_the_units_of_the_scene(
    text: str,
    words: str,
    tmp_path: Path,
    run: Fourbar,
) -> None:
    """The limit of bar 2 by cosines: (49 + 4 - 72.25)/28 is that of 133.4 deg."""
    (tmp_path / "scene.toml").write_text(text)
    code, _, err = run("analyze", tmp_path / "scene.toml")
    assert code == BAD_INPUT and words in err, err


def test_a_message_has_the_units_of_the_lengths_that_were_typed(run: Fourbar) -> None:
    lengths = ("50in", "2in", "4in", "4.5in")
    words = "lengths = 50, 2, 4, 4.5 in: the bars"
    for command in (
        ("classify", *lengths),
        ("new", "never.toml", "--lengths", *lengths),
        ("mjcf", "--lengths", *lengths, "-o", "never.xml"),
    ):
        code, _, err = run(*command)
        assert code == BAD_INPUT and words in err, err
    code, _, err = run("classify", "50", "2", "4", "4.5")
    assert "lengths = 50, 2, 4, 4.5: the bars" in err


def test_an_output_angle_out_of_range_is_refused_with_the_range(
    tmp_path: Path,
    run: Fourbar,
) -> None:
    (tmp_path / "scene.toml").write_text(INCHES)
    scene = tmp_path / "scene.toml"
    code, _, err = run("analyze", scene, "--at", "theta_4=200 deg")
    # the crank in line with the coupler: sides 5, 4.5 and 2 or 6
    cosines = ((5**2 + 4.5**2 - side**2) / (2 * 5 * 4.5) for side in (2, 6))
    high, low = (180.0 - math.degrees(math.acos(cosine)) for cosine in cosines)
    assert code == BAD_INPUT
    assert f"theta_4 goes from {low:.4g} deg to {high:.4g} deg" in err


def test_points_in_the_table_have_the_coordinates_of_the_drawing(
    run: Fourbar,
    tmp_path: Path,
) -> None:
    """O2 is not the origin of the drawing; `--at` and CSV have its coordinates too."""
    file = tmp_path / "drawn.toml"
    file.write_text(
        '[pins]\nO2 = ["100 mm", "20 mm"]\nA = ["100 mm", "120 mm"]\n'
        'B = ["275 mm", "70 mm"]\nO4 = ["350 mm", "70 mm"]\n'
        '[points]\nP = { bar = 2, drawn = ["150 mm", "80 mm"] }\n'
        '[motion]\ntheta_2 = "drawn"\nomega_2 = "0 rad/s"\n'
    )
    code, out, _ = run("analyze", file, "--table")
    lines = [line.split() for line in out.splitlines()]
    (heading,) = (line for line in lines if "P_x" in line)
    row = lines[-1]
    assert code == 0
    assert [row[heading.index(name)] for name in ("P_x", "P_y")] == ["150", "80"]


SIX_BARS = """\
[lengths]
ground = "900 mm"
input = "400 mm"
coupler = "700 mm"
output = "380 mm"
"""


@pytest.mark.parametrize(
    "more",
    [
        *('bellcrank2 = "350 mm"', 'link2 = "600 mm"', 'slider = "1 mm"'),
        *('sixth = "1 mm"', 'fixed = "1 mm"', '[bars.link5]\nmass = "1 kg"'),
        *('[link2]\nlength = "1 mm"', '[motion]\ntheta_5 = "1 rad"'),
        '[motion]\nlaw = { time = ["0 s", "1 s"], theta_6 = ["0 rad", "1 rad"] }',
        "[drive]\nbar = 6",
        '[[loads]]\nbar = 5\nmoment = "1 N m"',
        '[points]\nP = { bar = 5, from_pin = ["1 mm", "0 deg"] }',
        '[effects]\nviscous = { C = "1 N m s" }',
        '[effects]\nfriction = { O6 = "1 N m" }',
        '[tolerances]\n"lengths.link5" = "1 mm"',
    ],
)
def test_a_part_of_another_mechanism_points_on(
    more: str,
    tmp_path: Path,
    run: Fourbar,
) -> None:
    (tmp_path / "scene.toml").write_text(SIX_BARS + more + "\n")
    code, _, err = run("analyze", tmp_path / "scene.toml")
    assert code == BAD_INPUT and err.count("\n") == 1
    assert "several loops (six bars) in PMKS+" in err


@pytest.mark.parametrize(
    "arguments",
    [
        ("classify", "1", "2", "3", "4", "5", "6"),
        ("new", "f.toml", "--lengths", "1m", "2m", "3m", "4m", "5m", "6m"),
        ("new", "f.toml", "--pins", "0,0 0,1 1,2 3,3 4,4 5,5", "--unit", "mm"),
        ("mjcf", "--lengths", "1", "2", "3", "4", "5", "6", "-o", "f.xml"),
        ("sdf", "--lengths", "1", "2", "3", "4", "5", "-o", "f.sdf"),
        ("analyze", MODELS / "crank_rocker.toml", "--at", "theta_5=30 deg"),
        ("analyze", MODELS / "crank_rocker.toml", "--columns", "omega_6/omega_2"),
        ("analyze", MODELS / "crank_rocker.toml", "--columns", "F56_x"),
    ],
)
def test_six_bars_on_the_command_line_point_on(
    arguments: tuple[str, ...],
    run: Fourbar,
) -> None:
    code, _, err = run(*arguments)
    assert code == BAD_INPUT and "several loops (six bars) in PMKS+" in err


def test_classify_says_who_reads_a_scene_file(run: Fourbar) -> None:
    code, _, err = run("classify", "scene.toml")
    assert code == BAD_INPUT
    assert err.endswith(
        "takes 4 values; for a scene file: fourbar analyze scene.toml\n"
    )


def test_a_linkage_moves_as_the_bar_of_another_does(
    tmp_path: Path, run: Fourbar
) -> None:
    """By two commands the torque is that of the motion stated as three arrays."""
    first, second = MODELS / "crank_rocker.toml", MODELS / "drag_link.toml"
    moved = fourbar.solve(load(first))
    motion = fourbar.Motion(moved.theta_4 - 0.7, moved.omega_4, moved.alpha_4)
    expected = fourbar.solve(replace(load(second), motion=motion))
    code, out, _ = run(
        *("analyze", second, "--positions", f"{first}:theta_4-0.7 rad", "--json")
    )
    assert code == HOLDS and strict(out)["torque"] == expected.torque.tolist()
    assert strict(out)["alpha_4"] == expected.alpha_4.tolist()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (f"{MODELS / 'crank_rocker.toml'}", "must be a file and an angle, like"),
        (f"{MODELS / 'crank_rocker.toml'}:theta_5", "must be a file and an angle"),
        (f"{MODELS / 'crank_rocker.toml'}:theta_4 + 3 mm", "does not convert to rad"),
        ("none.toml:theta_4", "none.toml"),
    ],
)
def test_a_motion_that_another_scene_does_not_have_is_refused(
    text: str, said: str, run: Fourbar
) -> None:
    code, _, err = run("analyze", MODELS / "drag_link.toml", "--positions", text)
    assert code == BAD_INPUT and err.count("\n") == 1 and said in err


@pytest.mark.parametrize(
    ("word", "key"),
    [
        *(("crank", "input"), ("rocker", "output")),
        *(("follower", "output"), ("frame", "ground")),
    ],
)
def test_other_words_for_the_bars_are_asked_back(
    word: str,
    key: str,
    tmp_path: Path,
    run: Fourbar,
) -> None:
    (tmp_path / "scene.toml").write_text(SIX_BARS.replace(key, word))
    code, _, err = run("analyze", tmp_path / "scene.toml")
    assert code == BAD_INPUT and f'did you mean "{key}"' in err


@pytest.mark.parametrize(
    "arguments",
    [
        ("mjcf", "a.toml", "b.toml", "-o", "f.xml"),
        ("mjcf", "a.toml", "--lengths", "3", "1", "2.5", "2.2", "-o", "f.xml"),
        ("analyze", MODELS / "crank_rocker.toml", "--columns", "theta_44"),
    ],
)
def test_what_is_no_other_mechanism_does_not_point_on(
    arguments: tuple[str, ...], run: Fourbar
) -> None:
    code, _, err = run(*arguments)
    assert code == BAD_INPUT and "PMKS+" not in err


def test_one_position_has_the_angles_that_the_sweep_has_there(
    tmp_path: Path,
    run: Fourbar,
) -> None:
    """Beyond half a turn of the output of a drag-link, and whatever else is asked."""
    scene = load(MODELS / "drag_link.toml")
    save(scene, tmp_path / "scene.toml")
    sweep = fourbar.solve(scene)
    rows = [120, 10, 300]
    at = [f"--at={sweep.theta_2[row]!r} rad".replace("np.float64(", "") for row in rows]
    at = [text.replace(")", "") for text in at]
    table = run("analyze", tmp_path / "scene.toml", "--json", *at)[1]
    for name in ("theta_3", "theta_4"):
        assert strict(table)[name] == pytest.approx(getattr(sweep, name)[rows]), name
    block = run("analyze", tmp_path / "scene.toml", at[2])[1]
    assert f"{math.degrees(sweep.theta_4[300]):.4f}" in block
    assert abs(sweep.theta_4[300]) > math.pi
