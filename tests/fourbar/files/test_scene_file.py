"""Bad input: exit status 2, one line with file, key and value, and nothing written."""

import io
import os
import random
import time

import numpy as np
import pytest
from pytest import approx, raises

import fourbar
from fourbar.cli import status
from fourbar.errors import BAD_INPUT, FourBarError, InputError
from fourbar.files import load, loads, read_scene_text
from fourbar.files.scene_file import LARGEST_SCENE_FILE
from fourbar.files.scene_text import write_new_scene

GOOD = """title = "good"
[lengths]
ground = "0.3 m"
input = "0.1 m"
coupler = "0.25 m"
output = "0.22 m"
[bars.input]
mass = "0.2 kg"
[motion]
theta_2 = "60 deg"
omega_2 = "10 rad/s"
branch = "open"
[drive]
bar = 2
[[loads]]
bar = 4
force = ["3 N", "40 deg"]
from_pin = ["5 cm", "0 deg"]
[effects]
gravity = ["9.81 m/s^2", "-90 deg"]
viscous = { O2 = "0.01 N m s/rad" }
"""
SPRINGS = """springs = [
  {{ from = {{ bar = 1 }}, to = {{ bar = 4 }}, stiffness = "1 N/m", length = "0 m" }},
  {{ from = {{ bar = 1 }}, to = {{ bar = {1} }}, stiffness = "1 N/m", length = "{0}" }},
]
viscous ="""
GAS = (
    "springs = [{{ from = {{ bar = 1 }}, to = {{ bar = 4 }}, gas = {{"
    ' extended = "50 cm", {0}extended_force = "9 N" }} }}]\n'
    "viscous ="
)
LONGEST_LINE = 700
"""Characters of an error: a few lines of a terminal, whatever was given."""
PATIENCE = 5.0
"""Seconds of processor time in which any file is answered, on a machine that does other
things too.
"""


def test_the_file_that_the_mistakes_are_made_in_is_good(tmp_path, capsys):
    (tmp_path / "good.toml").write_text(GOOD)
    assert status(["analyze", str(tmp_path / "good.toml")]) == 0
    assert capsys.readouterr().err == ""


MISTAKES = [
    # id, what is replaced, by what, words that the line must hold
    (
        "unknown key at the top",
        'title = "good"',
        "colour = 1",
        ["colour", "title, source, lengths"],
    ),
    (
        "key of another table at the top",
        'title = "good"',
        'branch = "open"',
        ["branch = 'open'", "write it under [motion]"],
    ),
    (
        "effect in the motion",
        "omega_2",
        'gravity = "9.81 m/s^2"\nomega_2',
        ["motion.gravity", "write it under [effects]"],
    ),
    (
        "unknown key, closest named",
        "omega_2",
        "omega2",
        ["motion.omega2", 'did you mean "omega_2"?'],
    ),
    *(
        (f"{word} is meant as {key}", old, f"{word} =", [f'did you mean "{key}"?'])
        for word, old, key in (
            ("omega", "omega_2 =", "omega_2"),
            ("angle", "theta_2 =", "theta_2"),
            ("pin", "from_pin =", "from_pin"),
            ("cg", "mass =", "centre"),
            ("I", "mass =", "inertia"),
        )
    ),
    (
        "radius of gyration",
        "mass =",
        "radius_of_gyration =",
        ["write inertia = m k^2, or m (k^2 - r^2)"],
    ),
    (
        "a pin is no point",
        'from_pin = ["5 cm", "0 deg"]',
        'point = "B"',
        ["loads[0].point = 'B'", "a point of [points]", 'from_pin = ["0 m", "0 deg"]'],
    ),
    (
        "unknown bar",
        "[bars.input]",
        "[bars.imput]",
        ["bars.imput", 'did you mean "input"?'],
    ),
    (
        "ground has no mass",
        "[bars.input]",
        "[bars.ground]",
        ["bars.ground", "input, coupler, output"],
    ),
    (
        "unknown effect",
        "gravity",
        "gravitiy",
        ["effects.gravitiy", 'did you mean "gravity"?'],
    ),
    ("unknown pin", "{ O2 =", "{ O3 =", ["effects.viscous.O3", "O2, A, B, O4"]),
    ("unknown key of a load", "from_pin =", "where =", ["loads[0].where"]),
    (
        "wrong dimension",
        '"0.1 m"',
        '"48 kg"',
        ["lengths.input", "48 kg", "does not convert to m"],
    ),
    ("wrong force unit", '"3 N"', '"3 kg"', ["loads[0].force[0]", "3 kg", "N"]),
    (
        "Hz is no angular speed",
        '"10 rad/s"',
        '"10 Hz"',
        ["motion.omega_2", "10 Hz", 'like "1 rpm"'],
    ),
    (
        "damping without an angle",
        '"0.01 N m s/rad"',
        '"0.01 N m s"',
        ["effects.viscous.O2", "N m s/rad"],
    ),
    ("temperature", '"0.2 kg"', '"20 degC"', ["bars.input.mass", "20 degC"]),
    (
        "inches without quotes",
        '"0.1 m"',
        "9 in",
        ["line 4, column", 'in quotes, like "9 in"'],
    ),
    ("angle without quotes", '"40 deg"', "40 deg", ['in quotes, like "40 deg"']),
    ("bare length", '"0.1 m"', "0.1", ["lengths.input", "0.1", "with a unit"]),
    ("length without unit", '"0.1 m"', '"0.1"', ["lengths.input", "unit is missing"]),
    (
        "bare angle",
        '"60 deg"',
        "60",
        ["motion.theta_2", "the unit is missing", "60 deg"],
    ),
    ("unit without number", '"0.1 m"', '"m"', ["lengths.input", "no finite number"]),
    ("NaN", '"0.1 m"', '"nan m"', ["lengths.input", "nan m", "finite"]),
    ("bare NaN", '"0.1 m"', "nan", ["lengths.input", "nan", "finite"]),
    ("infinite", '"0.1 m"', '"inf m"', ["lengths.input", "inf m", "finite"]),
    ("too large", '"0.1 m"', '"1e999 m"', ["lengths.input", "1e999 m", "too large"]),
    ("negative length", '"0.1 m"', '"-0.1 m"', ["lengths.input", "-0.1 m", "> 0"]),
    ("zero length", '"0.1 m"', '"0 m"', ["lengths.input", "0 m", "> 0"]),
    ("length that rounds to zero", '"0.1 m"', '"1e-400 m"', ["lengths.input", "> 0"]),
    ("negative mass", '"0.2 kg"', '"-1 kg"', ["bars.input.mass", "-1 kg", ">= 0"]),
    (
        "negative damping",
        '"0.01 N',
        '"-0.01 N',
        ["effects.viscous.O2", "-0.01 N m s/rad", ">= 0"],
    ),
    (
        "negative spring",
        "viscous =",
        SPRINGS.format("-0.1 m", 4),
        ["effects.springs[1].length", "-0.1", ">= 0"],
    ),
    (
        "spring on one bar",
        "viscous =",
        SPRINGS.format("0.1 m", 1),
        ["effects.springs[1].to.bar", "another bar"],
    ),
    (
        "spring on a truth",
        "viscous =",
        SPRINGS.format("0.1 m", "true"),
        ["springs[1].to.bar", "True", "1 (ground)"],
    ),
    (
        "spring that softens",
        "viscous =",
        SPRINGS.format("0.1 m", 4).replace("1 N/m", "-5 N/cm"),
        ["-5 N/cm", ">= 0"],
    ),
    (
        "gas and coil",
        "viscous =",
        SPRINGS.format('1 m", gas = "', 3),
        ["springs[1].stiffness", "from, to, acts, gas"],
    ),
    (
        "gas without a stroke",
        "viscous =",
        GAS.format(""),
        ["effects.springs[0].gas.stroke", "missing", "1 m"],
    ),
    (
        "gas of too long a stroke",
        "viscous =",
        GAS.format('stroke = "60 cm", '),
        ["springs[0].gas.stroke", "0.5 m"],
    ),
    (
        "inertia overflows",
        '"0.2 kg"',
        '"1e308 kg"\n[bars.coupler]\nmass = "1e400 kg"',
        ["bars.coupler.mass"],
    ),
    (
        "lengths missing",
        GOOD[GOOD.index("[lengths]") : GOOD.index("[bars")],
        "",
        ["lengths.ground", "missing"],
    ),
    ("one length missing", 'output = "0.22 m"\n', "", ["lengths.output", "missing"]),
    ("can never close", '"0.1 m"', '"10 m"', ["lengths", "never close"]),
    (
        "lengths without a finite sum",
        '"0.25 m"\noutput = "0.22 m"',
        '"1.7e308 m"\noutput = "1.7e308 m"',
        ["lengths"],
    ),
    (
        "branch misspelt",
        '"open"',
        '"opne"',
        ["motion.branch", "opne", 'did you mean "open"?', '"crossed"'],
    ),
    ("branch as a sign", '"open"', "1", ["motion.branch", '"open" or "crossed"']),
    (
        "drive on the ground",
        "[drive]\nbar = 2",
        "[drive]\nbar = 1",
        ["drive.bar", "1", "must be 2 (input), 3 (coupler) or 4"],
    ),
    ("drive as text", "[drive]\nbar = 2", '[drive]\nbar = "2"', ["drive.bar", "'2'"]),
    (
        "drive as truth",
        "[drive]\nbar = 2",
        "[drive]\nbar = true",
        ["drive.bar", "True"],
    ),
    ("load on the ground", "bar = 4", "bar = 1", ["loads[0].bar", "1"]),
    (
        "load that does nothing",
        'force = ["3 N", "40 deg"]\nfrom_pin = ["5 cm", "0 deg"]\n',
        "",
        ["loads[0]", "force"],
    ),
    (
        "arm without a force",
        'force = ["3 N", "40 deg"]\nfrom_pin',
        'moment = "1 N m"\narm',
        ["loads[0].arm", "needs a force"],
    ),
    (
        "force without an angle",
        '["3 N", "40 deg"]',
        '"3 N"',
        ["loads[0].force", "pair"],
    ),
    (
        "force by one component",
        '["3 N", "40 deg"]',
        '{ x = "1 N" }',
        ["loads[0].force.y", "is missing"],
    ),
    (
        "force downwards",
        '["3 N", "40 deg"]',
        '["3 N", "down"]',
        ["loads[0].force[1]", 'did you mean "-90 deg"?'],
    ),
    (
        "torque for moment",
        'force = ["3 N", "40 deg"]',
        'torque = "1 N m"',
        ["loads[0].torque", '"moment"?'],
    ),
    (
        "unit left out in quotes",
        '"60 deg"',
        '"60"',
        ["motion.theta_2", 'did you mean "60 deg"?'],
    ),
    (
        "degrees in German",
        '"60 deg"',
        '"60 Grad"',
        ["motion.theta_2", '"Grad" is not known; did you mean "60 deg"?'],
    ),
    (
        "force with three parts",
        '["3 N", "40 deg"]',
        '["3 N", "40 deg", "1 m"]',
        ["loads[0].force", "pair"],
    ),
    ("loads as a table", "[[loads]]", "[loads]", ["loads", "[[loads]]"]),
    (
        "gravity without a direction",
        '["9.81 m/s^2", "-90 deg"]',
        '"9.81 m/s^2"',
        ["effects.gravity", 'like gravity = ["9.81 m/s^2", "-90 deg"]'],
    ),
    (
        "sweep as a text",
        '"60 deg"',
        '"0 deg to 360 deg"',
        ["motion.theta_2", "steps = 360 }"],
    ),
    (
        "torque that is given",
        "[drive]",
        '[drive]\ntorque = "5 N m"',
        ["drive.torque", "is a load", "motion.free"],
    ),
    (
        "load over time",
        "bar = 4",
        'bar = 4\ntable = { time = ["0 s", "1 s"], factor = [0.0, 1.0] }',
        ["loads[0].table.time", "follows theta_2, not time", "--drive motor"],
    ),
    (
        "frame misspelt",
        "bar = 4",
        'bar = 4\nframe = "body"',
        ["loads[0].frame", '"world" or "bar"'],
    ),
    (
        "gravity as truth",
        '["9.81 m/s^2", "-90 deg"]',
        "true",
        ["effects.gravity", "True"],
    ),
    (
        "sweep without end",
        '"60 deg"',
        '{ from = "0 deg", steps = 9 }',
        ["motion.theta_2.to", "missing"],
    ),
    (
        "no steps",
        '"60 deg"',
        '{ from = "0 deg", to = "9 deg", steps = 0 }',
        ["motion.theta_2.steps", "0"],
    ),
    (
        "half a step",
        '"60 deg"',
        '{ from = "0 deg", to = "9 deg", steps = 1.5 }',
        ["motion.theta_2.steps", "1.5"],
    ),
    (
        "steps without end",
        '"60 deg"',
        '{ from = "0 deg", to = "9 deg", steps = 99999999 }',
        ["motion.theta_2.steps"],
    ),
    ("no angles", '"60 deg"', "[]", ["motion.theta_2"]),
    (
        "limit and sweep",
        '"60 deg"',
        '{ limit = 1, from = "0 deg" }',
        ["motion.theta_2.from", "limit, offset"],
    ),
    ("limit zero", '"60 deg"', "{ limit = 0 }", ["motion.theta_2.limit", "0"]),
    (
        "a limit the linkage lacks",
        '"60 deg"',
        "{ limit = 1 }",
        ["motion.theta_2.limit", "no limit positions"],
    ),
    (
        "free without duration",
        'branch = "open"',
        "free = { steps = 3 }",
        ["motion.free.duration", "missing"],
    ),
    ("title as a number", '"good"', "7", ["title", "7", "text"]),
    (
        "lengths as a number",
        GOOD[GOOD.index("[lengths]") : GOOD.index("[bars")],
        "lengths = 3\n",
        ["lengths", "table"],
    ),
    ("huge number", '"good"', "0x" + "f" * 5000, ["title", "huge whole number"]),
    ("more digits than Python reads", '"good"', "1" * 5000, ["TOML"]),
    ("broken quote", '"good"', '"good', ["TOML", "line 1"]),
    ("a key twice", 'title = "good"', 'title = "a"\ntitle = "b"', ["TOML"]),
    ("deep nesting", '"good"', "[" * 20000, ["TOML", "deep"]),
    ("deep table", '"good"', "{a=" * 20000, ["TOML", "deep"]),
    (
        "hostile key",
        'title = "good"',
        '"a\\nb\\u001b[31m" = 1',
        ["'a\\nb\\x1b[31m'", "unknown key"],
    ),
    (
        "hostile value",
        '"open"',
        '"\\n\\u001b[2J\\u202e"',
        ["motion.branch", "\\x1b", "\\u202e"],
    ),
    ("endless key", 'title = "good"', "k" * 50000 + " = 1", ["unknown key"]),
    ("endless value", '"open"', '"' + "x" * 50000 + '"', ["motion.branch"]),
    (
        "code for a unit",
        '"0.1 m"',
        "\"1 __import__('os').system('true')\"",
        ["lengths.input"],
    ),
    ("tower of powers", '"0.1 m"', '"1 m**9**9**9**9"', ["lengths.input"]),
    ("another language", GOOD, "<mujoco/>", ["TOML", "line 1, column 1 = '<mujoco/>'"]),
    (
        "open heading",
        GOOD,
        'title = "a"\n\n[lengths\nground = "1 m"\n',
        ["line 3, column 9 = '[lengths'"],
    ),
    (
        "open text",
        GOOD,
        'title = "a"\nsource = """b',
        ["line 2, column 14", "Unterminated"],
    ),
    ("a date", '"good"', "2024-02-31", ["TOML"]),
]


@pytest.mark.parametrize(
    "old, new, words",
    [case[1:] for case in MISTAKES],
    ids=[case[0] for case in MISTAKES],
)
def test_a_mistake_in_a_scene_file(old, new, words, tmp_path, capsys):
    assert GOOD.count(old) >= 1
    file = tmp_path / "scene.toml"
    file.write_text(GOOD.replace(old, new, 1), encoding="utf-8")
    refused(["analyze", str(file)], [str(file), *words], tmp_path, capsys)


def refused(arguments, words, folder, capsys):
    """The command is refused with these words, and writes nothing into the folder."""
    before = sorted(folder.rglob("*"))
    started = time.process_time()
    assert status([*arguments, "-o", str(folder / "written")]) == BAD_INPUT
    assert time.process_time() - started < PATIENCE
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("error: ")
    assert printed.err.endswith("\n")
    assert printed.err.count("\n") == 1
    assert "Traceback" not in printed.err and len(printed.err) <= LONGEST_LINE
    assert printed.err[:-1].isprintable()
    for word in words:
        assert word in printed.err, printed.err
    assert sorted(folder.rglob("*")) == before


@pytest.mark.parametrize("command", ["analyze", "mjcf", "plot", "animate"])
def test_every_command_refuses_a_bad_file(command, tmp_path, capsys):
    refused(
        [command, str(tmp_path / "missing.toml")],
        ["missing.toml", "file not found"],
        tmp_path,
        capsys,
    )
    bad = tmp_path / "bad.toml"
    bad.write_text(GOOD.replace('"open"', '"opne"'))
    refused([command, str(bad)], [str(bad), "motion.branch", "opne"], tmp_path, capsys)


def test_a_directory(tmp_path, capsys):
    refused(["analyze", str(tmp_path)], [str(tmp_path), "directory"], tmp_path, capsys)


def test_a_huge_file_is_not_read(tmp_path, capsys):
    huge = tmp_path / "huge.toml"
    with huge.open("wb") as file:
        file.truncate(100_000_000)
    os.chmod(huge, 0)  # it would not even open
    refused(
        ["analyze", str(huge)],
        ["100000000 bytes", str(LARGEST_SCENE_FILE)],
        tmp_path,
        capsys,
    )


@pytest.mark.parametrize(
    "encode", [io.StringIO, lambda text: io.BytesIO(text.encode())]
)
def test_an_open_file_is_read(encode, tmp_path):
    (tmp_path / "scene.toml").write_text(GOOD)
    assert load(encode(GOOD)) == load(tmp_path / "scene.toml")


@pytest.mark.parametrize("content", [b"\xff\xfe\x00", b"x" * (LARGEST_SCENE_FILE + 1)])
def test_a_stream_that_holds_no_scene_is_refused(content):
    with raises(InputError, match="scene file = 'stream'"):
        load(io.BytesIO(content))


@pytest.mark.parametrize("name", ["a\nb\x1b[31m.toml", "n" * 300])
def test_hostile_names(name, tmp_path, capsys):
    refused(["analyze", str(tmp_path / name)], [], tmp_path, capsys)


def test_a_name_that_no_file_can_have():
    with raises(InputError, match="cannot be read"):
        read_scene_text("nul\0.toml")


@pytest.mark.parametrize(
    "data",
    [b"\xff\xfe\x00", GOOD.encode() + b"\n# \xe9\n", b"\x89PNG\r\n\x1a\n" + bytes(100)],
)
def test_what_is_not_text(data, tmp_path, capsys):
    (tmp_path / "scene.toml").write_bytes(data)
    refused(["analyze", str(tmp_path / "scene.toml")], ["UTF-8"], tmp_path, capsys)


def rocker(theta_2):
    """A linkage that closes for theta_2 between 22.3 and 71.7 deg."""
    text = GOOD.replace('"0.1 m"', '"0.24 m"').replace('"0.25 m"', '"0.1 m"')
    return text.replace('"60 deg"', theta_2)


def test_no_position_assembles(tmp_path, capsys):
    (tmp_path / "scene.toml").write_text(rocker('"180 deg"'))
    refused(
        ["analyze", str(tmp_path / "scene.toml")],
        ["scene.toml", "theta_2", "assembles at none"],
        tmp_path,
        capsys,
    )


@pytest.mark.slow
def test_some_positions_do_not_assemble(tmp_path, capsys):
    (tmp_path / "scene.toml").write_text(
        rocker('{ from = "0 deg", to = "90 deg", steps = 9 }')
    )
    assert status(["analyze", str(tmp_path / "scene.toml")]) == 0
    shown = capsys.readouterr()
    assert "10 positions: 5 ok, 5 not assembled" in shown.out and shown.err == ""


@pytest.mark.parametrize(
    "arguments, words",
    [
        (["mjcf"], ["scene file or --lengths"]),
        (["mjcf", "x.toml", "--lengths", "1", "1", "1", "1"], ["one of the two"]),
        (["mjcf", "x.toml", "--omega", "1"], ["--omega goes with --lengths"]),
        (["sdf", "x.toml", "--lengths", "1", "1", "1", "1"], ["one of the two"]),
        (["usd"], ["one of the two"]),
        (["mjcf", "--lengths", "0.3", "0.1", "0.25"], ["Missing option"]),
        (
            ["mjcf", "--lengths", "0.3", "0.1", "0.25", "-1"],
            ["length of output", "> 0"],
        ),
        (
            ["mjcf", "--lengths", "0.3", "0.1", "0.25", "nan"],
            ["length of output", "nan"],
        ),
        (
            ["mjcf", "--lengths", "0.3", "0.1", "0.25", "2 kg"],
            ["length of output", "2 kg"],
        ),
        (["mjcf", "--lengths", "9", "0.1", "0.25", "0.2"], ["never close"]),
        (
            ["mjcf", "--lengths", "0.3", "0.1", "0.25", "0.2", "--omega", "1 Hz"],
            ["--omega", "1 Hz"],
        ),
        (
            ["mjcf", "--lengths", "0.3", "0.1", "0.25", "0.2", "--omega", "inf"],
            ["--omega", "inf"],
        ),
        *(
            (["classify", *lengths.split()], [])
            for lengths in ("x", "1 1 1", "1 1 1 0", "1 1 1 1s")
        ),
        (["analyse"], ["analyse"]),
        (["analyze"], ["SCENE"]),
        (["analyze", "x.toml", "--xml"], ["--xml"]),
    ],
)
def test_bad_arguments(arguments, words, tmp_path, capsys):
    refused(arguments, words, tmp_path, capsys)


@pytest.mark.parametrize(
    "pattern",
    [
        "a.",
        '"a b".',
        "a." * 99 + "a=1\n",
        "[" + "a." * 99 + "a]\n",
        "[",
        "{a=",
        '"',
        "[[a]]\n",
        "'''",
        "a=1\n",
        "[a.b.c]\n",
        "#",
        "\\",
        "a" * 99 + "\n",
    ],
)
def test_large_nonsense_is_answered_soon(pattern):
    text = pattern * (LARGEST_SCENE_FILE // len(pattern))
    started = time.process_time()
    with raises(FourBarError):
        loads(text, "nonsense")
    assert time.process_time() - started < PATIENCE


@pytest.mark.slow
@pytest.mark.parametrize(
    "pattern", ["a{n}." + "a." * 98 + "a=1\n", "[a{n}]\nb=1\n", "[[a]]\nb={n}\n"]
)
def test_large_files_without_a_repeated_key_are_answered_soon(pattern):
    text = "".join(
        pattern.format(n=n) for n in range(LARGEST_SCENE_FILE // (len(pattern) + 3))
    )
    started = time.process_time()
    with raises(FourBarError):
        loads(text, "nonsense")
    assert time.process_time() - started < PATIENCE


@pytest.mark.slow
def test_mutated_files_end_in_a_scene_or_in_one_line():
    """2000 seeded mutations of a good file.

    Any other exception than ours fails the test.
    """
    random.seed(20261121)
    pieces = [
        *GOOD.split(),
        "nan",
        "[",
        "]",
        "{",
        "}",
        '"',
        "\x00",
        "é",
        "-1",
        "1e999",
        "= =",
        "\n",
        "deg",
        "🤖",
    ]
    answered = 0
    for _ in range(2000):
        text = list(GOOD)
        for _ in range(random.randint(1, 2)):
            offset = random.randrange(len(text))
            action = random.randrange(4)
            if action == 0:
                del text[offset : offset + random.randint(1, 12)]
            elif action == 1:
                text[offset:offset] = random.choice(pieces)
            elif action == 2:
                text[offset] = chr(random.randrange(32, 0x250))
            else:
                digits = [
                    index for index, letter in enumerate(text) if letter.isdecimal()
                ]
                text[random.choice(digits)] = random.choice("0123456789.e-")
        try:
            loads("".join(text), "mutated")
            answered += 1
        except FourBarError as error:
            assert "\n" not in str(error) and len(str(error)) < LONGEST_LINE, str(error)
    assert 50 < answered < 1950  # the mutations reach both ends


def test_forces_and_gravity_by_components_are_written_so_again():
    text = """\
[lengths]
ground = "300 mm"
input = "100 mm"
coupler = "250 mm"
output = "220 mm"
[[loads]]
bar = 4
force = { x = "3 N", y = "-4 N" }
[effects]
gravity = { x = "1.5 m/s^2", y = "-9.81 m/s^2" }
"""
    scene = loads(text)
    assert scene.loads[0].force == approx((5.0, np.arctan2(-4.0, 3.0)))
    (gravity,) = scene.effects
    assert gravity.magnitude == approx(np.hypot(1.5, 9.81))
    written = fourbar.dump(scene)
    assert 'force = { x = "3.0 N", y = "-4.0 N" }' in written
    assert loads(written).loads == scene.loads


IN_OTHER_UNITS = """\
[lengths]
ground = "48 in"
input = "1.5 ft"
coupler = "40 in"
output = "36 in"
[bars.input]
mass = "200 g"
inertia = "30 kg cm^2"
[bars.coupler]
mass = "300 g"
inertia = "3 kg cm^2"
[motion]
theta_2 = { from = "1 rad", to = "2 rad" }
omega_2 = "2 deg/s"
[points]
P = { bar = 3, from_pin = ["40 mm", "0.2 rad"] }
Q = { bar = 3, from_pin = ["50 mm", "0.2 rad"] }
[[loads]]
bar = 4
moment = "3 N cm"
force = ["2 kgf", "0.1 rad"]
[[loads]]
bar = 3
moment = "4 N cm"
force = ["2 lbf", "0.1 rad"]
[effects]
viscous = { O2 = "0.01 N cm s/deg", A = "3 N cm s/deg" }
[tolerances]
"lengths.input" = "0.01 mm"
"lengths.coupler" = "0.02 mm"
"""


@pytest.mark.parametrize(
    "old, new, meant",
    [
        ('coupler = "40 in"', "coupler = 40", "40 in"),
        ('coupler = "40 in"', 'coupler = "40"', "40 in"),
        # the nearest number of its kind stands in another table
        ('mass = "300 g"', "mass = 300", "300 g"),
        ('inertia = "3 kg cm^2"', "inertia = 3", "3 kg cm^2"),
        ('to = "2 rad"', "to = 2", "2 rad"),
        ('["40 mm", "0.2 rad"]', '[40, "0.2 rad"]', "40 mm"),
        ('moment = "4 N cm"', "moment = 4", "4 N cm"),
        # the table's own comes before those of other loads, in the file's order
        ('["2 lbf", "0.1 rad"]', '[2, "0.1 rad"]', "2 kgf"),
        ('["2 lbf", "0.1 rad"]', '["2 lbf", 5]', "5 rad"),
        ('A = "3 N cm s/deg"', "A = 3", "3 N cm s/deg"),
        ('"lengths.coupler" = "0.02 mm"', '"lengths.coupler" = 0.02', "0.02 mm"),
        # no number of the file is a speed of rotation
        ('omega_2 = "2 deg/s"', "omega_2 = 60", "60 rpm"),
    ],
)
def test_a_number_without_a_unit_is_suggested_in_that_of_its_neighbours(
    old, new, meant
):
    assert IN_OTHER_UNITS.count(old) == 1
    loads(IN_OTHER_UNITS)
    with raises(InputError) as caught:
        loads(IN_OTHER_UNITS.replace(old, new))
    assert f'the unit is missing; did you mean "{meant}"?' in str(caught.value)


def test_lengths_of_a_new_scene_without_a_unit_are_suggested_alike():
    with raises(InputError, match='did you mean "4 in"'):
        write_new_scene(["12 in", "4", "10 in", "9 in"])
