"""Bad input: exit status 2, one line with file, key and value, and nothing written."""

import os
import time
from contextlib import contextmanager

import numpy as np
from pytest import approx, fixture, mark, raises

from fourbar import dump, solve
from fourbar.errors import BAD_INPUT, FourBarError, InputError
from fourbar.files import loads
from fourbar.files.scene_file import LARGEST_SCENE_FILE
from tests.support.rows import read_rows, slow_but

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


@contextmanager
def soon():
    started = time.process_time()
    yield
    assert time.process_time() - started < PATIENCE


LONGEST_LINE = 700
"""Characters of an error: a few lines of a terminal, whatever was given."""
PATIENCE = 5.0
"""Seconds of processor time in which any file is answered, on a machine that does other
things too.
"""


MISTAKES = read_rows(r"""
title = "good" | colour = 1 | colour | title, source, lengths
title = "good" | branch = "open" | branch = 'open' | unknown key; must be among title
omega_2 | omega2 | motion.omega2 | must be among omega_2,
omega_2 = | omega = | must be among omega_2,
theta_2 = | angle = | motion.angle | theta_2
from_pin = | pin = | must be among from_pin,
mass = | length = | bars.input.length | must be among mass
mass = | cg = | bars.input.cg | mass, inertia, centre
mass = | damping = | a damper between two points is in MuJoCo
mass = | radius_of_gyration = | write inertia = m k^2, or m (k^2 - r^2)
[bars.input] | [bars.imput] | bars.imput | must be among input, coupler
gravity | gravitiy | effects.gravitiy | must be among gravity,
{ O2 = | { O3 = | effects.viscous.O3 | O2, A, B, O4
"0.1 m" | "48 kg" | lengths.input | 48 kg | does not convert to m
"3 N" | "3 kg" | loads[0].force[0] | 3 kg | N
"10 rad/s" | "10 Hz" | motion.omega_2 | 10 Hz | "Hz" is not known
"0.01 N m s/rad" | "0.01 N m s" | effects.viscous.O2 | N m s/rad
"0.1 m" | 9 in | at line 4, column | in quotes, like "9 in"
"0.1 m" | 0.1 | lengths.input | 0.1 | the unit is missing | like "1 m"
"0.1 m" | "nan m" | lengths.input | nan m | finite
"0.1 m" | nan | lengths.input | nan | the unit is missing
"0.1 m" | [] | lengths.input | a finite number > 0, like "1 m"
"0.1 m" | "1e999 m" | lengths.input | 1e999 m | too large
"0.1 m" | "-0.1 m" | lengths.input | -0.1 m | > 0
"0.1 m" | "1e-400 m" | lengths.input | > 0
"0.2 kg" | "-1 kg" | bars.input.mass | -1 kg | >= 0
mass = "0.2 kg" | density = "7850 kg/m^3" | bars.input.density = 7850 kg/m^3: needs
output = "0.22 m"\n |  | lengths.output | missing
"0.1 m" | "10 m" | lengths | never close
"open" | "opne" | motion.branch | opne | must be "open" or "crossed"
"open" | 1 | motion.branch | "open" or "crossed"
[drive]\nbar = 2 | [drive]\nbar = "2" | drive.bar | '2'
force = ["3 N", "40 deg"]\nfrom_pin = ["5 cm", "0 deg"]\n |  | loads[0] | force
["3 N", "40 deg"] | "3 N" | loads[0].force | pair
["3 N", "40 deg"] | { x = "1 N" } | loads[0].force.y | is missing
["3 N", "40 deg"] | ["3 N", "down"] | loads[0].force[1] | no finite number | "1 rad"
["3 N", "40 deg"] | ["3 N", 40] | loads[0].force[1] = 40 | the unit is missing | "1 rad"
["3 N", "40 deg"] | { x = "1e308 N", y = "1.5e308 N" } | loads[0].force = inf | finite
force = ["3 N", "40 deg"] | torque = "1 N m" | loads[0].torque | moment
"60 deg" | "60" | motion.theta_2 | the unit is missing
"60 deg" | "drawn" | motion.theta_2 = 'drawn' | "drawn" needs [pins]
branch = "open" | law = { time = ["drawn"] } | directly under [motion] alone
bar = 4 | bar = 4\ntable.stroke = ["1 m", "2 m"] | table.stroke | is over theta_2
"60 deg" | ["1 deg", 2] | motion.theta_2[1] = 2 | like "1 rad"
"60 deg" | "60 Grad" | motion.theta_2 | "Grad" is not known
[[loads]] | [loads] | loads | [[loads]]
"60 deg" | "0 deg to 360 deg" | motion.theta_2 | steps = 360 }
[drive] | [drive]\ntorque = "5 N m" | drive.torque | is a load | motion.free
bar = 4 | bar = 4\nframe = "body" | loads[0].frame | "world" or "bar"
"60 deg" | { from = "0 deg", steps = 9 } | motion.theta_2.to | missing
"60 deg" | { from = "0 deg", to = "9 deg", steps = 1.5 } | motion.theta_2.steps | 1.5
"60 deg" | { limit = 1, from = "0 deg" } | motion.theta_2.from | limit, offset
"60 deg" | { limit = 1 } | motion.theta_2.limit | no limit positions
branch = "open" | free = { steps = 3 } | motion.free.duration | missing
"good" | "good | TOML | line 1
from_pin = ["5 cm", "0 deg"] | point = "B" | loads[0].point = 'B' | a point of [points]
[drive]\nbar = 2 | [drive]\nbar = 1 | drive.bar | must be 2 (input), 3 (coupler) or 4
force = ["3 N", "40 deg"]\nfrom_pin | moment = "1 N m"\narm | .arm | needs a force
viscous = { | pin_friction.A.coefficient = "0.1"\nviscous = { | like 1, without quotes
["9.81 m/s^2", "-90 deg"] | "9.81 m/s^2" | like gravity = ["9.81 m/s^2", "-90 deg"]
""")
"""What is replaced, by what, and words that the line must hold."""
HEAVY = """
lengths = { ground = "30 m", input = "10 m", coupler = "25 m", output = "22 m" }
bars.input.mass = "1e308 kg"
"""
LENGTHS = GOOD[GOOD.index("[lengths]") : GOOD.index("[bars")]
ACROSS_LINES = [
    ("viscous =", SPRINGS.format("-0.1 m", 4), "effects.springs[1].length", ">= 0"),
    ("viscous =", SPRINGS.format("1 m", "true"), "springs[1].to.bar", "1 (ground)"),
    ("viscous =", SPRINGS.format('1 m", gas = "', 3), "from, to, acts, gas"),
    ("viscous =", GAS.format(""), "effects.springs[0].gas.stroke", "missing", "1 m"),
    (
        "bar = 4",
        'bar = 4\ntable = { time = ["0 s", "1 s"], factor = [0.0, 1.0] }',
        "follows theta_2, not time",
        "--drive motor",
    ),
    (LENGTHS, "", "lengths.ground", "missing"),
    (LENGTHS, "lengths = 3\n", "lengths", "table"),
    (GOOD, HEAVY, "bars.input.mass", "a finite number"),
    ('"good"', "0x" + "f" * 5000, "title", "huge whole number"),
    ('"good"', "1" * 5000, "TOML"),
    ('"good"', "[" * 20000, "TOML", "deep"),
    ('title = "good"', '"a\\nb\\u001b[31m" = 1', "a b [31m = 1", "unknown key"),
    ('"open"', '"\\n\\u001b[2J\\u202e"', "motion.branch", "\\x1b", "\\u202e"),
    ('title = "good"', "k" * 50000 + " = 1", "unknown key"),
    (GOOD, ".".join(["1"] * 203) + " = 1", "more than 100 dots besides those of"),
    (GOOD, ".".join(["10"] * 203) + " = 1", "more than 100 dots besides those of"),
    (GOOD, "<mujoco/>", "TOML", "'<mujoco/>': Invalid statement (at line 1, column 1)"),
    (GOOD, 'title = "a"\n\n[lengths\nground = 1', "TOML = '[lengths'"),
]


@mark.parametrize(
    "mistake",
    [*([cell.replace(r"\n", "\n") for cell in row] for row in MISTAKES), *ACROSS_LINES],
)
def test_a_mistake_in_a_scene_file(mistake):
    old, new, *words = mistake
    assert GOOD.count(old) >= 1
    with soon(), raises(InputError) as caught:
        solve(loads(GOOD.replace(old, new, 1), "scene.toml"))
    line = str(caught.value)
    assert line.isprintable() and len(line) <= LONGEST_LINE
    for word in words:
        assert word in line, line


@fixture
def refused(run, tmp_path):
    """A command is refused in one line with these words, and writes nothing."""

    def call(arguments, *words):
        before = sorted(tmp_path.rglob("*"))
        with soon():
            code, out, err = run(*arguments, "-o", "written")
        assert (code, out) == (BAD_INPUT, "")
        assert err.startswith("error: ") and err.endswith("\n")
        assert err[:-1].isprintable() and len(err) <= LONGEST_LINE
        for word in words:
            assert word in err, err
        assert sorted(tmp_path.rglob("*")) == before

    return call


def test_a_huge_file_is_not_read(tmp_path, refused):
    huge = tmp_path / "huge.toml"
    with huge.open("wb") as file:
        file.truncate(100_000_000)
    os.chmod(huge, 0)  # it would not even open
    refused(["analyze", huge], "100000000 bytes", str(LARGEST_SCENE_FILE))


@mark.parametrize("name", ["a\nb\x1b[31m.toml", "n" * 300])
def test_hostile_names(name, refused):
    refused(["analyze", name])


@mark.parametrize(
    "arguments, words",
    read_rows("""
mjcf | scene file or --lengths
mjcf x.toml --lengths 1 1 1 1 | one of the two
mjcf x.toml --omega 1 | --omega goes with --lengths
usd | one of the two
mjcf --lengths 0.3 0.1 0.25 | Missing option
mjcf --lengths 0.3 0.1 0.25 -1 | length of output
mjcf --lengths 0.3 0.1 0.25 2kg | length of output
mjcf --lengths 0.3 0.1 0.25 0.2 --omega 1Hz | --omega
classify x |
classify 1 1 1 |
classify 1 1 1 1s |
analyse | analyse
analyze | SCENE
analyze x.toml --xml | --xml
"""),
)
def test_bad_arguments(arguments, words, refused):
    refused(arguments.split(), words)


NONSENSE = ["a." * 99 + "a=1\n", "[" + "a." * 99 + "a]\n", "[", '"', "[[a]]\n", "#"]
NUMBERED = ["a{n}." + "a." * 98 + "a=1\n", "[a{n}]\nb=1\n", "[[a]]\nb={n}\n"]
"""Without a repeated key."""


@mark.parametrize("pattern", slow_but(NONSENSE, NONSENSE + NUMBERED))
def test_large_nonsense_is_answered_soon(pattern):
    times = LARGEST_SCENE_FILE // len(pattern.format(n=100_000))
    text = "".join(pattern.format(n=n) for n in range(times))
    with soon(), raises(FourBarError):
        loads(text, "nonsense")


def test_a_line_may_have_many_decimals():
    angles = ", ".join(f'"{n}.5 deg"' for n in range(200))
    assert len(loads(GOOD.replace('"60 deg"', f"[{angles}]")).motion.angle) == 200


def test_forces_and_gravity_by_components():
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
    assert loads(dump(scene)).loads == scene.loads
