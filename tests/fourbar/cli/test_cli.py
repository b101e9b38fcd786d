"""The command line: what it prints and writes, what it refuses, how it ends."""

import csv
import io
import json
import os
import re
import shlex
import stat
import subprocess
import sys
from dataclasses import replace
from importlib import import_module
from math import degrees, tau
from pathlib import Path

import numpy as np
from pytest import approx, mark, raises

from fourbar import (
    Free,
    LinearDrive,
    Motion,
    Place,
    Sweep,
    __version__,
    cli,
    load,
    mjcf,
    quantities,
    save,
    solve,
)
from fourbar.errors import BAD_INPUT, BROKEN, HOLDS, INTERRUPTED, DependencyError
from fourbar.evaluation.case import Case
from fourbar.mjcf import assembly
from fourbar.mjcf.document import write_mjcf_for
from fourbar.show import tables
from fourbar_validation.places import MODELS
from tests.support.rows import read_rows, slow_but
from tests.support.scenes import RESTING, balance, crank_rocker, find_angle

CRANK_ROCKER = MODELS / "crank_rocker.toml"


THESIS = MODELS / "thesis.toml"


KEYS = """
schema title status branch theta_2 theta_3 theta_4 omega_2 omega_3 omega_4 alpha_2
alpha_3 alpha_4 A B G2 G3 G4 a_A a_B a_G2 a_G3 a_G4 F12 F32 F43 F14 torque drive_bar
sin_mu condition assembled
"""


CONTRACT = KEYS.split()
"""The keys that programs which read the JSON rely on."""


LENGTHS = ("0.3", "0.1", "0.25", "0.22")


BARE = ("--lengths", "300 mm", "10 cm", "0.25", "0.22", "--omega", "60 rpm")


MADE = mjcf.make_scene(0.3, 0.1, 0.25, 0.22, omega=tau)


def strict(text):
    """JSON without the NaN and Infinity that Python would let pass."""
    assert text.count("\n") == 1
    assert not re.search("NaN|Infinity", text)
    return json.loads(text)


def read_csv(text):
    return list(csv.DictReader(io.StringIO(text)))


@mark.parametrize("name", slow_but({"drag_link"}, ["thesis", "drag_link"]))
def test_json_and_csv_have_every_key_and_every_digit(name, show):
    file = MODELS / f"{name}.toml"
    document = strict(show("analyze", file, "--json"))
    solution = solve(load(file))
    rows = read_csv(show("analyze", file, "--csv", "--units", "SI"))
    assert set(CONTRACT) <= set(document)
    for quantity in solution.evaluated():
        array = solution[quantity]
        expected = np.where(np.isfinite(array), array, np.nan)  # null for NaN
        printed = np.array(document[quantity], dtype=float)
        assert np.array_equal(printed, expected, equal_nan=True), quantity
        ends = ("_x", "_y") if quantity in quantities.VECTORS else ("",)
        cells = [[float(row[quantity + end]) for end in ends] for row in rows]
        assert np.array_equal(np.reshape(cells, array.shape), array), quantity
    assert document["status"] == solution.status == [row["status"] for row in rows]
    assert document["assembled"] == [True] * len(solution)
    assert document["drive_bar"] == solution.drive_bar == int(rows[0]["drive_bar"])
    assert document["branch"] == [1] * len(solution)
    assert document["title"] == solution.title and document["angle_unit"] == "rad"
    assert "time" not in document


def test_one_position_is_an_array_and_has_no_forces_without_a_speed(show):
    save(crank_rocker(Motion(1.0)), "scene.toml")
    document = strict(show("analyze", "scene.toml", "--json"))
    assert set(CONTRACT) <= set(document) and np.shape(document["theta_3"]) == (1,)
    assert document["torque"] is document["F12"] is document["omega_2"] is None
    assert "N m" not in show("analyze", "scene.toml")
    (row,) = read_csv(show("analyze", "scene.toml", "--csv"))
    assert row["torque [N m]"] == "" and row["theta_2 [rad]"] == "1.0"


@mark.slow
def test_a_free_motion_has_time_and_no_drive(show):
    save(crank_rocker(Motion(0.5, 0.0, free=Free(0.5, 4))), "scene.toml")
    document = strict(show("analyze", "scene.toml", "--json"))
    assert document["time"] == [0.0, 0.125, 0.25, 0.375, 0.5]


@mark.parametrize(
    "command, write", [("sdf", assembly.write_sdf), ("usd", assembly.write_usd)]
)
def test_sdf_and_usd_are_written_of_four_lengths_and_name_what_they_leave_out(
    command, write, show, run
):
    target = Path(f"bars.{command}")
    assert "1 kg/m" in show(command, *BARE, "-o", target)
    assert target.read_text(encoding="utf-8") == write(MADE)
    code, _, err = run(command, CRANK_ROCKER, "-o", "a")
    assert code == BAD_INPUT and "loads (here on bar 3, bar 4)" in err
    assert "--without-loads" in err
    show(command, CRANK_ROCKER, "--without-loads", "-o", "a")


@mark.parametrize(
    "asked, printed, text",
    [
        ((CRANK_ROCKER,), [], write_mjcf_for(load(CRANK_ROCKER))),
        (BARE, mjcf.list_defaults(MADE), write_mjcf_for(MADE)),
        ((THESIS, "--drive", "motor"), [], write_mjcf_for(load(THESIS), drive="motor")),
    ],
    ids=["scene", "lengths", "motor"],
)
def test_mjcf_of_a_scene_and_of_bare_lengths(asked, printed, text, show):
    assert show("mjcf", *asked, "-o", "a.xml").splitlines() == printed
    assert Path("a.xml").read_text() == text


def test_what_rests_at_every_angle_is_no_range_of_one(show):
    save(replace(balance(0.0), effects=()), "balanced.toml")
    out = show("equilibrium", "balanced.toml")
    assert "indifferent (Q = 0 throughout): everywhere on its circuit" in out


@mark.slow
def test_degrees_are_of_angles_alone_and_named(show):
    plain = strict(show("analyze", CRANK_ROCKER, "--json"))
    turned = strict(show("analyze", CRANK_ROCKER, "--json", "--degrees"))
    assert turned["angle_unit"] == "deg"
    for key in CONTRACT[1:]:
        in_degrees = key in ("theta_2", "theta_3", "theta_4")
        expected = np.degrees(plain[key]) if in_degrees else plain[key]
        assert np.all(np.asarray(turned[key]) == expected), key
    rows = read_csv(
        show("analyze", CRANK_ROCKER, "--csv", "--units", "SI", "--degrees")
    )
    assert float(rows[90]["theta_2 [deg]"]) == approx(90.0, rel=1e-15)
    assert "theta_2" not in rows[0]
    for heading in rows[0]:
        name, _, _ = heading.replace("|", "").replace("/", "_").partition(" [")
        assert name.isidentifier(), heading


ROW = re.compile(r" *\d+\.\d{4} ")


@mark.slow
def test_the_table_of_positions_says_in_what_units_and_may_be_thinned(show):
    lines = show("analyze", THESIS, "--table").split("\n")
    assert lines[0] == "Thesis model mechanism" and len(lines) > 361
    heading = next(n for n, line in enumerate(lines) if "theta_2 " in line)
    assert "T4" in lines[heading]
    assert lines[heading + 1].split()[:3] == ["deg", "N", "m"]
    radians = show("analyze", THESIS, "--table", "--radians").split("\n")
    assert radians[heading + 1].split()[0] == "rad"
    assert show("analyze", THESIS, "--all").split("\n") == lines
    thinned = show("analyze", CRANK_ROCKER, "--every", 100).splitlines()
    rows = [line.split()[0] for line in thinned if ROW.match(line)]
    assert rows == ["0.0000", "100.0000", "200.0000", "300.0000", "360.0000"]


def test_a_terminal_gets_some_forty_rows():
    lines = tables.print_positions(solve(load(CRANK_ROCKER)), 80).splitlines()
    rows = [line for line in lines if ROW.match(line)]
    assert len(rows) == 37
    assert [rows[n].split()[0] for n in (1, -1)] == ["10.0000", "360.0000"]
    shown = "shown: every 10th of the 361 positions; --all shows each"
    assert lines.index(rows[-1]) < lines.index(shown)
    columns = tables.list_columns(solve(load(CRANK_ROCKER)))
    assert any("omega_4" in name for name in columns)
    assert not any(name.startswith("omega_2\n") for name in columns)
    alone = tables.print_positions(solve(crank_rocker(Motion(1.0, 10.0))), 80)
    assert len([line for line in alone.splitlines() if ROW.match(line)]) == 1


def test_a_table_over_time_has_the_drive_of_a_law_and_none_of_a_release():
    law, released = (
        tables.list_columns(solve(load(MODELS / f"capabilities/{name}.toml")))
        for name in ("law_sine", "released")
    )
    names = [heading.split("\n")[0] for heading in law]
    assert names[:4] == ["time", "theta_2", "T2", "power"]
    assert not {"T2\nN m", "power\nW"} & released.keys()


def test_a_table_has_the_range_that_dry_friction_at_rest_leaves_the_drive():
    _, *drive = tables.list_columns(solve(RESTING)).values()
    shown, low, high = (float(*cells) for cells in drive[:3])
    assert [shown - low, high - shown] == approx([0.2, 0.2])


def test_the_digits_of_the_torque():
    solution = solve(crank_rocker(), "error")
    columns = tables.list_columns(solution)
    (cells,) = (columns[name] for name in columns if "digits" in name)
    for cell, torque, error in zip(
        cells, solution.torque, solution.torque_error, strict=True
    ):
        digits, relative = int(cell), error / abs(torque)
        assert digits == 0 or relative <= 10.0**-digits
        assert digits == tables.MOST_DIGITS or relative > 10.0 ** -(digits + 1)


def test_no_command_is_a_question_for_help(show, capsys):
    """The line of each command stands there whole, in 80 columns."""
    out = show()
    assert out == show("-h")
    described = " ".join(out.split())
    for command in cli.group.commands.values():
        line = f"{command.name} {command.get_short_help_str(limit=1000)}"
        assert " ".join(line.split()) in described
    assert max(map(len, out.splitlines())) <= 80
    assert show("-V") == f"fourbar, version {__version__}\n"
    harness = import_module("fourbar_validation.cli").status([])
    assert harness == HOLDS and "advise" in capsys.readouterr().out


def test_the_shell_completes(show, monkeypatch):
    monkeypatch.setenv("_FOURBAR_COMPLETE", "zsh_source")
    assert "compdef" in show()


CLASSIFIED = read_rows("""
# 0.3 + 0.1 and 0.2 + 0.2 differ as doubles
0.3 0.1 0.2 0.2 | change-point crank-rocker
20cm 48cm 55cm 20cm | triple rocker
300 100 250 220 | s + l = 400 < p + q = 470
30cm 100mm 25cm 0.22m | s + l = 40 cm < p + q = 47 cm
30in 10in 25in 22in | s + l = 40 in < p + q = 47 in
# at its limits the input is the corner of 80, 100 and 90 + 50, or 90 - 50 mm
80mm 100mm 50mm 90mm | input: coupler, output folded      22.3316
80mm 100mm 50mm 90mm | input: coupler, output stretched  101.5370
3 1 3 1.0000001 | s + l = 4 < p + q = 4.0000001
3 1 3 1.000000000001 | folded     180.0000    0.0000 -179.9999  crossed
3/2 1/2 1 9/8 | s + l = 2 < p + q = 2.125
2 1 2 1 | change points: theta_2 = 0.0000 deg and 180.0000 deg
""")


@mark.parametrize("lengths, line", CLASSIFIED)
def test_classify(lengths, line, show):
    assert line in show("classify", *lengths.split())


def test_a_stroke_that_is_not_commanded_is_found_where_the_column_has_it(
    show, tmp_path
):
    """Of a cylinder from the ground to the coupler."""
    drive = LinearDrive(Place(1, (0.29, -1.0)), Place(3, (0.1, -0.26)))
    scene = crank_rocker(Motion(Sweep(0.3, 1.2, 9), 1.0), drive=drive)
    stroke = solve(scene).stroke[4]
    save(scene, tmp_path / "cylinder.toml")
    out = show("analyze", tmp_path / "cylinder.toml", "--at", f"stroke={stroke:.17g} m")
    assert f"at theta_2 = {degrees(0.7):.6g} deg" in out


def test_classify_says_what_turns_and_how_far(show):
    """By the law of cosines where two bars are collinear."""

    def angle(*sides):
        return degrees(find_angle(*sides))

    d, a, b, c = map(float, LENGTHS)
    text = show("classify", *LENGTHS)
    stretched, folded = angle(c, d, b + a), 180.0 + angle(c, d, b - a)
    for name, cells in (
        ("stretched", [stretched, stretched, 180.0 - angle(a + b, d, c)]),
        ("folded", [folded, folded - 180.0, 180.0 - angle(b - a, d, c)]),
    ):
        row = re.search(rf"  output: input, coupler {name} +(.*) +open", text)[1]
        assert [float(cell) for cell in row.split()] == approx(cells, abs=6e-5)
    least = angle(d - a, b, c)
    ratio = (folded - stretched) / (360.0 - folded + stretched)
    for words in (
        f"angle between coupler and output: {least:.4f} deg at theta_2 = 0.0000 deg\n"
        f"    to {angle(d + a, b, c):.4f} deg at 180.0000 deg\n",
        f"\nsmallest transmission angle: {least:.4f} deg\n",
        f"strokes at constant omega_2: {ratio:.4f}\n",
        f"output {angle(a + b, d, c) - angle(b - a, d, c):.4f} deg",
    ):
        assert words in text
    every = show("classify", *LENGTHS, "--all").splitlines()
    of_coupler = {line for line in every if line.startswith("  coupler:")}
    assert len(of_coupler) == 4 and {*every} - of_coupler >= {*text.splitlines()}
    assert len(show("classify", 3, 1, 1, 1).splitlines()) == 3  # a structure


NEW = read_rows("""
300 100 25cm 220 --unit mm | 0.3 0.1 0.25 0.22
'12"' '4"' '10"' '9"' | 0.3048 0.1016 0.254 0.2286
12″ '4 ″' 10” '9 in' | 0.3048 0.1016 0.254 0.2286
3 1-1/4 25/8 2.5 --unit ft | 0.9144 0.381 0.9525 0.762
"2'" '8"' "1'8\\"" "1'6\\"" | 0.6096 0.2032 0.508 0.4572
""")
"""Lengths as people write them, and in metres."""


@mark.parametrize("texts, metres", NEW)
def test_new_writes_a_file_and_names_the_command_that_reads_it(
    texts, metres, show, run
):
    out = show("new", "my wiper.toml", "--lengths", *shlex.split(texts))
    assert shlex.split(out.strip())[-3:] == ["fourbar", "analyze", "my wiper.toml"]
    again = "--unit", "m", "--lengths", *LENGTHS
    refuses(run("new", "my wiper.toml", *again), "file exists")
    lengths = [float(metre) for metre in metres.split()]
    assert load("my wiper.toml").linkage.lengths == approx(lengths, rel=1e-15)


@mark.parametrize(
    "bars",
    [
        ("--lengths", "300mm", "100mm", "250mm", "220mm"),
        ("--pins", "0,0 0,100 175,50 250,50", "--unit", "mm"),
    ],
    ids=lambda bars: bars[0],
)
def test_who_asks_for_positions_only_is_told_no_force(bars, show):
    path = Path("positions.toml")
    show("new", path, *bars, "--positions-only")
    assert load(path).motion.speed is None and load(path).effects == ()
    out = show("analyze", path)
    assert "transmission angle: at least" in out
    assert not re.search("motor|torque|drive|mass|force", out + path.read_text())


DRAWINGS = read_rows("""
plot @crank_rocker.toml --figure=linkage --at '30 deg' -o a.svg | | <svg
plot @gallery/pump_jack.toml -o a.svg | | $T_2$ (lbf in)
animate @gallery/pump_jack.toml -o a.html | | "lbf in"
animate @gallery/pump_jack.toml --units SI -o a.html | | "N m"
animate @gallery/pump_jack.toml --seconds 0.12 -o a.gif | : 3 frames | GIF89a
""")
"""Commands, what is said of the file, and what it holds."""


@mark.slow
@mark.parametrize("line, said, holds", DRAWINGS)
def test_plot_and_animate_write_what_their_ending_says(line, said, holds, show):
    """Without an option they show the units of the scene: those of the pump-jack are
    inches and pounds.
    """
    arguments = shlex.split(line.replace("@", f"{MODELS}/"))
    file = Path(arguments[-1])
    assert show(*arguments) == f"wrote {file}{said}\n"
    assert holds.encode() in file.read_bytes()


@mark.parametrize(
    "error, code",
    [
        (RuntimeError("two\nlines"), BROKEN),
        (MemoryError(), BROKEN),
        (DependencyError("no such library"), BROKEN),
        (KeyboardInterrupt(), INTERRUPTED),
    ],
)
def test_what_goes_wrong_is_one_line_and_a_status(error, code, run, monkeypatch):
    """After an interrupt click ends the line that the terminal has started with ^C."""

    def broken(*_):
        raise error

    monkeypatch.setattr(Case, "of", broken)
    monkeypatch.delenv("FOURBAR_TRACEBACK", raising=False)
    exit_status, out, err = run("analyze", THESIS, "--json", "-o", "out")
    assert (exit_status, out, err.strip().count("\n")) == (code, "", 0)
    assert not Path("out").exists()
    if isinstance(error, RuntimeError):
        monkeypatch.setenv("FOURBAR_TRACEBACK", "1")
        with raises(RuntimeError):
            run("analyze", THESIS)


@mark.slow
def test_a_full_disk_leaves_the_old_file(run, monkeypatch, tmp_path):
    def full(_):
        raise OSError(28, "No space left on device")

    Path("out").write_text("old")
    monkeypatch.setattr("os.fsync", full)
    code, _, err = run("analyze", THESIS, "--json", "-o", "out")
    said = f"error: {tmp_path / 'out'}: No space left on device\n"
    assert (code, err) == (BROKEN, said)
    assert [path.read_text() for path in tmp_path.iterdir()] == ["old"]


def test_the_name_of_a_file_asks_for_its_form(show):
    for ending, *option in (("csv", "--csv"), ("json", "--json"), ("txt", "--every=9")):
        expected = show("analyze", CRANK_ROCKER, *option)
        file = Path(f"a.{ending}")
        every = option if ending == "txt" else ()
        assert show("analyze", CRANK_ROCKER, *every, "-o", file) == ""
        assert file.read_text() == expected


@mark.posix
def test_a_device_is_written_to_and_stays_one(show):
    pipe = Path("pipe")
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDWR | os.O_NONBLOCK)
    try:
        show("mjcf", "--lengths", *LENGTHS, "-o", pipe)
        assert b"</mujoco>" in os.read(reader, 60_000)
        assert stat.S_ISFIFO(pipe.stat().st_mode)
    finally:
        os.close(reader)


def test_a_title_does_not_steer_the_terminal(show):
    title = "\x1b[2J\x1b]0;x\x07\r\n[bold]name"
    save(crank_rocker(title=title), "scene.toml")
    out = show("analyze", "scene.toml")
    assert "\x1b" not in out and "\x07" not in out
    assert out.startswith('Crank-rocker "[2J ]0;x [bold]name", open')
    assert strict(show("analyze", "scene.toml", "--json"))["title"] == title


@mark.slow
def test_the_command_line_starts_light():
    heavy = ["pint", "rich", "matplotlib", "scipy", "mujoco", "pinocchio", "jinja2"]
    program = "import sys, fourbar.cli; print({*sys.argv[1:]} & {*sys.modules})"
    command = [sys.executable, "-c", program, *heavy]
    assert subprocess.check_output(command, cwd=MODELS.parent, text=True) == "set()\n"


SIX_BARS = """\
[lengths]
ground = "900 mm"
input = "400 mm"
coupler = "700 mm"
output = "380 mm"
"""
REFUSED_FILES = """\
lengths = 50, 2, 4, 4.5 in: the bars
lengths = { ground = "50 in", input = "2 in", coupler = "4 in", output = "4.5 in" }
---
of the other three, 10.5 in
lengths = { ground = "50 in", input = "2 in", coupler = "4 in", output = "4.5 in" }
---
it is written like "1 in"
lengths = { ground = "5 in", input = 2, coupler = "4 in", output = "4.5 in" }
---
like "1 lb"
lengths = { ground = "5 in", input = "2 in", coupler = "4 in", output = "4.5 in" }
bars.coupler.mass = "1 in"
---
motion.theta_2 = 99 deg: the linkage does not assemble there; theta_2 goes from -51.31
lengths = { ground = "6 in", input = "2 in", coupler = "3 in", output = "2 in" }
motion = { theta_2 = "99 deg", free = { duration = "1 s", steps = 9 } }
bars.input.mass = "1 lb"
---
motion.stroke.to = 5 in: this cylinder can have 2 to 4 in
lengths = { ground = "5 in", input = "2 in", coupler = "4 in", output = "4.5 in" }
motion = { stroke = { from = "3 in", to = "5 in", steps = 9 }, side = "left" }
[drive]
from = { bar = 1, from_pin = ["3 in", "-60 deg"] }
to = { bar = 2, from_pin = ["1 in", "0 deg"] }
---
drive.to = 'bar 2 at 0 in'
lengths = { ground = "5 in", input = "2 in", coupler = "4 in", output = "4.5 in" }
[drive]
from = { bar = 1, from_pin = ["3 in", "-60 deg"] }
to = { bar = 2, from_pin = ["0 in", "0 deg"] }
---
springs[0].gas.stroke = 6 in: must be less than the extended length, 4 in
lengths = { ground = "5 in", input = "2 in", coupler = "4 in", output = "4.5 in" }
[[effects.springs]]
from = { bar = 1, from_pin = ["3 in", "-60 deg"] }
to = { bar = 3, from_pin = ["1 in", "0 deg"] }
gas = { extended = "4 in", stroke = "6 in", extended_force = "30 lbf" }
---
compressed_force = 20 lbf: must be no less than the extended_force, 30 lbf
lengths = { ground = "5 in", input = "2 in", coupler = "4 in", output = "4.5 in" }
[[effects.springs]]
from = { bar = 1, from_pin = ["3 in", "-60 deg"] }
to = { bar = 3, from_pin = ["1 in", "0 deg"] }
[effects.springs.gas]
extended = "4 in"
stroke = "2 in"
extended_force = "30 lbf"
compressed_force = "20 lbf"
---
must be less than the number itself, 2 in
lengths = { ground = "5 in", input = "2 in", coupler = "4 in", output = "4.5 in" }
tolerances."lengths.input" = "3 in"
---
positions requested; theta_2 goes from -133.432537 to 133.432537 deg
# by cosines: (49 + 4 - 72.25)/28 is that of 133.4 deg
lengths = { ground = "7 in", input = "2 in", coupler = "4 in", output = "4.5 in" }
motion = { theta_2 = "180 deg", omega_2 = "60 rpm" }
---
pins.A = 1, 2 in: lies where O2 does
[pins]
O2 = ["1 in", "2 in"]
A = ["1 in", "2 in"]
B = ["7 in", "2 in"]
O4 = ["9 in", "1 in"]
---
lengths.crank = '2 in': unknown key; must be among ground, input
lengths = { ground = "5 in", crank = "2 in", coupler = "4 in", output = "4.5 in" }
---
lengths.rocker = '4.5 in': unknown key; must be among ground, input
lengths = { ground = "5 in", input = "2 in", coupler = "4 in", rocker = "4.5 in" }
---
lengths.follower = '4.5 in': unknown key; must be among ground, input
lengths = { ground = "5 in", input = "2 in", coupler = "4 in", follower = "4.5 in" }
---
lengths.frame = '5 in': unknown key; must be among ground, input
lengths = { frame = "5 in", input = "2 in", coupler = "4 in", output = "4.5 in" }
"""
"""Words of the line that refuses a scene file, and the file."""
OF_SIX_BARS = r"""bellcrank2 = "350 mm"
link2 = "600 mm"
slider = "1 mm"
sixth = "1 mm"
slot = "1 mm"
crank = "1 mm"\nrod = "1 mm"
[bars.link5]
[link2]
[gears]
[motion]\ntheta_5 = "1 rad"
[motion]\nlaw = { time = ["0 s", "1 s"], theta_6 = ["0 rad", "1 rad"] }
[drive]\nbar = 6
[[loads]]\nbar = 5\nmoment = "1 N m"
[points]\nP = { bar = 5, from_pin = ["1 mm", "0 deg"] }
[tolerances]\n"lengths.link5" = "1 mm"
"""


@mark.parametrize(
    "text, words",
    [
        *(case.split("\n", 1)[::-1] for case in REFUSED_FILES.split("---\n")),
        *(
            (SIX_BARS + more, "(six bars) in PMKS+")
            for more in OF_SIX_BARS.splitlines()
        ),
        ('pins = { O = "", A = "", B = "", C = "", D = "", E = "" }', "bars) in PMKS+"),
    ],
)
def test_a_file_is_refused_in_its_own_units_and_points_on(text, words, run):
    Path("scene.toml").write_text(text.replace(r"\n", "\n"))
    refuses(run("analyze", "scene.toml"), words)


def refuses(ended, words):
    code, out, err = ended
    assert (code, out) == (BAD_INPUT, "") and words in err and err.count("\n") == 1, err


REFUSED = read_rows("""
analyze x.toml --json --csv | give one of them
analyze x.toml --json --every 2 | hold every position
analyze @crank_rocker.toml --pressure '210 bar' | needs a cylinder
analyze @capabilities/push_output.toml --pressure '10 MPa' | needs a cylinder
analyze @gallery/excavator_bucket.toml --pressure 210 | did you mean "210 bar"?
plot @crank_rocker.toml -o a.svg --at 12 | did you mean "12 deg"?
plot @capabilities/stroke_input.toml -o a.svg --at 350 | did you mean "350 mm"?
plot @crank_rocker.toml -o a.doc | a.doc
plot @crank_rocker.toml -o a.svg --figure torque --dimensions | dimensions = True: must
plot @crank_rocker.toml -o a.svg --figure pie | figure = 'pie': must be one of
mjcf @crank_rocker.toml -o a.xml --axis '0 0 0' | axis = (0.0, 0.0, 0.0): must
new --lengths 3 1 2 2 | name the new file once
new a.toml --lengths 300 100 250 220 | --unit mm
new a.toml --lengths 3m 1m 2m 0m | error: --lengths: lengths.output = '0m': must be a
classify 30cm 100 250 220 | unit

# no reader of the form takes a file of that name
analyze @crank_rocker.toml -o a.xlsx | .txt, .json, .csv, or have no ending
equilibrium @crank_rocker.toml -o a.csv | .txt, .json, or have no ending
usd @crank_rocker.toml -o a.usdc | .usda, .usd, or have no ending
mjcf @crank_rocker.toml -o a.sdf | .xml, .mjcf, or have no ending

# a message has the units that were typed
classify 50in 2in 4in 4.5in | lengths = 50, 2, 4, 4.5 in: the bars
new never.toml --lengths 50in 2in 4in 4.5in | lengths = 50, 2, 4, 4.5 in: the bars
mjcf --lengths 50in 2in 4in 4.5in -o a.xml | lengths = 50, 2, 4, 4.5 in: the bars
classify 50 2 4 4.5 | lengths = 50, 2, 4, 4.5: the bars

# other mechanisms
classify 50mm 150mm 0mm | takes 4 values, ground, input, coupler, output (fourbar
classify 50mm 150mm 0mm | sliders and several loops (six bars) in PMKS+
classify 1 2 3 4 5 6 | several loops (six bars) in PMKS+
new f.toml --lengths 1m 2m 3m 4m 5m 6m | several loops (six bars) in PMKS+
new f.toml --pins '0,0 0,1 1,2 3,3 4,4 5,5' --unit mm | several loops (six bars) in
mjcf --lengths 1 2 3 4 5 6 -o f.xml | several loops (six bars) in PMKS+
sdf --lengths 1 2 3 4 5 -o f.sdf | several loops (six bars) in PMKS+
analyze @crank_rocker.toml --at 'theta_5=30 deg' | several loops (six bars) in PMKS+
analyze @crank_rocker.toml --columns omega_6/omega_2 | several loops (six bars) in
analyze @crank_rocker.toml --columns F56_x | several loops (six bars) in PMKS+
classify 1 2 3 | takes 4 values
analyze @crank_rocker | did you mean "

# positions of another scene
analyze @drag_link.toml --positions @crank_rocker.toml | must be a file and an angle
analyze @drag_link.toml --positions @crank_rocker.toml:theta_5 | must be a file and an
analyze @drag_link.toml --positions '@crank_rocker.toml:theta_4 + 3 mm' | convert to rad
analyze @drag_link.toml --positions '@crank_rocker.toml:theta_4 - 40' | mean "-40 deg"?
analyze @drag_link.toml --positions none.toml:theta_4 | none.toml
""")
"""Command lines, and words of the line that refuses them; @ stands for the models."""


@mark.parametrize("line, words", REFUSED)
def test_arguments_are_refused_in_one_line_and_nothing_is_written(
    line, words, run, tmp_path
):
    refuses(run(*shlex.split(line.replace("@", f"{MODELS}/"))), words)
    assert not [*tmp_path.iterdir()]


@mark.parametrize(
    "out, why",
    [
        ("no/out", "no such folder"),
        (".", "a file, not a folder"),
        ("a", "is read here"),
    ],
)
@mark.parametrize("command", ["analyze", "mjcf"])
def test_an_output_that_cannot_be_is_refused_before_anything_is_solved(
    command, out, why, run, monkeypatch, tmp_path
):
    monkeypatch.setattr(Case, "of", None)
    text = THESIS.read_text()
    Path("a").write_text(text)
    refuses(run(command, "a", "-o", out), why)
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a": text}


def test_an_angle_of_more_than_half_a_turn_is_that_of_the_sweep(show):
    """The output of a drag-link turns with its input, by 233.8 deg at 300 deg."""
    asked = "--json", "--degrees", "--at", "300 deg"
    shown = strict(show("analyze", MODELS / "drag_link.toml", *asked))
    assert shown["theta_4"] == approx([233.8003], abs=1e-4)


@mark.parametrize("name", ["law_sine", "released"])
def test_an_angle_of_a_motion_over_time_is_that_of_each_instant(show, name):
    """A released motion begins at its angle, and passes it again."""
    file = MODELS / "capabilities" / f"{name}.toml"
    angles = solve(load(file), "position").theta_2
    angle = float(angles[0] if name == "released" else angles.mean())
    first, *lines = show("analyze", file, "--at", f"{angle!r} rad").splitlines()
    assert first.endswith(f" at {len(lines)} positions:") and len(lines) > 1
    assert all('--at "time=' in line for line in lines)


def test_a_printed_time_is_a_position(show):
    """0.1 s at 10 rad/s are 1 rad."""
    out = show("analyze", CRANK_ROCKER, "--at", "t=0.1 s")
    assert f"at theta_2 = {degrees(1.0):.6g} deg" in out


def test_a_value_that_no_position_has_leaves_the_others(show, run):
    """In a circle of 0.1 m about O2 A_x is at most 0.1 m, and 0.05 m at 60 deg."""
    wanted = ("--at", "A_x=0.2 m", "--at", "A_x=max", "--at", "60 deg")
    out = show("analyze", CRANK_ROCKER, *wanted)
    assert re.findall(r"^at theta_2 = (.*)", out, re.MULTILINE) == ["0 deg", "60 deg"]
    left_out = "left out: --at A_x = 0.2 m: no position has it"
    assert out.splitlines()[-1].startswith(left_out)
    code, out, err = run("analyze", CRANK_ROCKER, *wanted, "--csv", "--columns", "A_x")
    assert code == 0 and err.startswith(left_out)
    assert [float(cell) for cell in out.split()[2:]] == approx([100.0, 50.0])
    refuses(run("analyze", CRANK_ROCKER, *wanted[:2]), "error: --at A_x = 0.2 m: no")


def test_points_in_the_table_have_the_coordinates_of_the_drawing(show):
    """O2 is not the origin of the drawing; `--at` and CSV have its coordinates too."""
    Path("drawn.toml").write_text(
        '[pins]\nO2 = ["100 mm", "20 mm"]\nA = ["100 mm", "120 mm"]\n'
        'B = ["275 mm", "70 mm"]\nO4 = ["350 mm", "70 mm"]\n'
        '[points]\nP = { bar = 2, drawn = ["150 mm", "80 mm"] }\n'
        '[motion]\ntheta_2 = "drawn"\nomega_2 = "0 rad/s"\n'
    )
    out = show("analyze", "drawn.toml", "--table")
    lines = [line.split() for line in out.splitlines()]
    (heading,) = (line for line in lines if "P_x" in line)
    shown = dict(zip(heading, lines[-1], strict=False))
    assert (shown["P_x"], shown["P_y"]) == ("150", "80")


def test_a_linkage_moves_as_the_bar_of_another_does(show):
    """By two commands the torque is that of the motion stated as three arrays."""
    second = MODELS / "drag_link.toml"
    moved = solve(load(CRANK_ROCKER))
    motion = Motion(moved.theta_4 - 0.7, moved.omega_4, moved.alpha_4)
    expected = solve(replace(load(second), motion=motion))
    positions = f"{CRANK_ROCKER}:theta_4-0.7 rad"
    document = strict(show("analyze", second, "--positions", positions, "--json"))
    assert document["torque"] == expected.torque.tolist()
    assert document["alpha_4"] == expected.alpha_4.tolist()


def test_a_limit_of_the_output_is_met_by_its_rounding(run, show):
    """It is at 101.862 deg, beyond the angle that is typed."""
    lengths = '{ ground = "5 in", input = "2 in", coupler = "4 in", output = "4.5 in" }'
    motion = '{ theta_2 = "60 deg", omega_2 = "60 rpm" }'
    Path("scene.toml").write_text(f"lengths = {lengths}\nmotion = {motion}")
    out = show("analyze", "scene.toml", "--at", "theta_4=101.86 deg")
    assert re.search(r"bar 4 +101\.8620 ", out)
    code, _, error = run("analyze", "scene.toml", "--at", "theta_4=258.138 deg")
    assert code == BAD_INPUT and "258.138 deg" in error
