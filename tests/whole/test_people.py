"""What people ask, from what they have to their answer in three steps at most.

The right values were derived apart from this program (circle intersection, 2x2 systems
of velocities and accelerations, a 9x9 system of free bodies, virtual work), or are
printed in the source of the task.
"""

import re

import numpy as np
from pytest import approx, fixture, mark

import fourbar
from fourbar.cli import status
from fourbar.errors import HOLDS
from tests.support.texts import COORDINATES, PLIERS

WIDTH = 80
PRINTED = 1e-5
"""Relative: a value of six or seven digits against one that is printed with six."""


@fixture
def ask(tmp_path, capsys, monkeypatch):
    """Run one command line of `fourbar` in an empty folder.

    Return what it prints.
    """
    monkeypatch.chdir(tmp_path)

    def run(*words):
        code = status(list(words))
        printed = capsys.readouterr()
        assert (code, printed.err) == (HOLDS, ""), printed.err
        assert max(map(len, printed.out.splitlines())) <= WIDTH, printed.out
        return printed.out

    return run


@fixture
def analyze(ask, tmp_path):
    """Return what `analyze` prints of a text, as of a file."""

    def run(text, *words):
        (tmp_path / "scene.toml").write_text(text)
        return ask("analyze", "scene.toml", *words)

    return run


def row_of(text, label, after=""):
    """Return the numbers of the first row with a label.

    The row is below one that begins with `after`.
    """
    start = text.index(f"\n{after}") if after else 0
    row = re.search(rf"^ *{re.escape(label)}  +(.*)$", text[start:], re.MULTILINE)
    assert row is not None, (label, text)
    return [float(x) for x in re.findall(r"(?<!\S)-?\d[\d.e+-]*(?!\S)", row[1])]


HOMEWORK = """\
title = "Homework linkage with a coupler point"
[lengths]
ground = "5 cm"
input = "2 cm"
coupler = "3 cm"
output = "4.5 cm"
ground_angle = "15 deg"
[motion]
theta_2 = "45 deg"
omega_2 = "15 rad/s"
[points]
P = { bar = 3, from_pin = ["2.5 cm", "30 deg"] }
"""
OPEN = {
    "bar 3": (86.7856, -13.1675, 76.8866),
    "bar 4": (136.1867, -5.8506, 221.0994),
    "P": (0.29, 3.65),
    "v_P": (8.17, 36.05),
    "a_P": (-294.45, -791.77),
}
CROSSED = {
    "bar 3": (-90.8141, 1.1971, 269.4943),
    "bar 4": (-140.2152, -6.1197, 125.2815),
    "v_P": (-18.60, 22.67),
    "a_P": (268.25, 13.47),
}


MIDTERM = """\
title = "Midterm: output angle known"
[lengths]
ground = "5 in"
input = "7 in"
coupler = "3.5 in"
output = "5 in"
[motion]
theta_4 = "30 deg"
[points]
P = { bar = 3, from_pin = ["6 in", "45 deg"] }
"""


def assembled(text, branch):
    """Return a scene with points that states its branch."""
    return text.replace("[points]", f'branch = "{branch}"\n[points]')


def test_pliers_have_their_force_ratio_over_a_sweep(analyze):
    """At 49 deg it is the one of the position; by the speeds of both points."""
    sweep = 'theta_2 = { from = "49 deg", to = "55 deg", steps = 3 }'
    assert 'theta_2 = "49 deg"' in PLIERS
    swept = PLIERS.replace('theta_2 = "49 deg"', sweep)
    names = "theta_2,F_jaw/F_handle,v_handle/v_jaw"
    rows = list_columns(analyze(swept, "--columns", names))
    assert rows[0][1] == approx(31.969, rel=PRINTED)
    assert all(forces == speeds for _, forces, speeds in rows)


def test_four_pins_and_the_speed_of_the_output_as_they_are_drawn(ask, tmp_path):
    """A command, an edit of two lines, a command."""
    ask("new", "pins.toml", "--pins", "0,0 0,100 175,50 250,50", "--unit", "mm")
    text = (tmp_path / "pins.toml").read_text()
    assert 'omega_2 = "60 rpm"' in text
    stated = 'theta_4 = "drawn"\nomega_4 = "2 rad/s"'
    (tmp_path / "pins.toml").write_text(text.replace('omega_2 = "60 rpm"', stated))
    text = ask("analyze", "pins.toml")
    assert row_of(text, "bar 2")[1:] == approx([-0.4285714, -4.338192], rel=PRINTED)
    assert row_of(text, "bar 3")[1:] == approx([-0.8571429, -0.104956], rel=PRINTED)


def test_a_linkage_by_the_coordinates_of_its_joints(analyze):
    """E stands where it is drawn, in the coordinates of the drawing, and its path goes
    through it.
    """
    text = analyze(COORDINATES, "--at", "drawn")
    for name, place in {
        "A": (1.244, 0.196),
        "B": (-2.32, -2.293),
        "E": (-2.591, 1.657),
    }.items():
        assert row_of(text, name) == approx(place, rel=PRINTED)
    scene = fourbar.files.loads(COORDINATES)
    curve = fourbar.coupler_curve(scene, "E", steps=4000)
    x, y = (np.asarray(z) + o for z, o in zip(curve[2:], scene.origin, strict=True))
    assert np.hypot(x + 0.02591, y - 0.01657).min() < 1e-4


def list_columns(text):
    """Return the rows of numbers of a printed table."""
    below = text[text.index("──") :].splitlines()[1:]
    rows = [line.split() for line in below if not line.startswith(("shown", "not"))]
    return [[float(cell) for cell in row] for row in rows if row]


@mark.slow
def test_a_new_parallelogram_is_one_over_the_whole_turn(ask):
    """Two commands; 0.3924 cos(theta_2), at 0 and 180 deg as the limit."""
    ask("new", "tp.toml", "--lengths", "300mm", "100mm", "300mm", "100mm")
    text = ask("analyze", "tp.toml")
    assert text.startswith('Parallelogram "New linkage", open branch:')
    assert "ntiparallelogram" not in text
    assert "change points at theta_2 = 0 deg and 180 deg" in text
    assert row_of(text, "torque")[0] == approx(392.4, rel=PRINTED)
    rows = list_columns(ask("analyze", "tp.toml", "--columns", "theta_2,torque"))
    assert len(rows) == 361
    for theta_2, torque in rows:
        assert torque == approx(0.3924 * np.cos(np.radians(theta_2)), abs=2e-6), theta_2


COUPLE = """\
title = "Bar on two parallel links, given couple"
[pins]
O2 = ["0 m", "0 m"]
A = ["1.5 m", "0 m"]
B = ["1.5 m", "1.8 m"]
O4 = ["0 m", "1.8 m"]
[bars.coupler]
mass = "150 kg"
centre = { drawn = ["1.5 m", "1.2 m"] }
[motion]
theta_2 = "drawn"
omega_2 = "0 rad/s"
free = { duration = "1 s", steps = 200 }
[[loads]]
bar = 2
moment = "5 kN m"
[effects]
gravity = ["9.81 m/s^2", "-90 deg"]
"""


@mark.slow
def test_a_given_couple_moves_two_parallel_links_from_rest(analyze):
    """alpha = 14.8148 - 6.54 cos 30 deg; the upper link carries 2.139 kN."""
    text = analyze(COUPLE, "--at", "30 deg")
    assert text.startswith("Parallelogram")
    right = [30.0, 2.9957, 14.8148148 - 6.54 * np.cos(np.radians(30.0))]
    assert row_of(text, "bar 2") == approx(right, rel=1e-4)
    assert row_of(text, "F43 at B")[2] == approx(2.139, rel=1e-3)
    assert row_of(text, "F14 at O4")[2] == approx(2.139, rel=1e-3)


RODS = """\
title = "Steel rods at 20 rpm, no gravity"
[lengths]
ground = "1 m"
input = "0.4 m"
coupler = "1 m"
output = "0.8 m"
[bars]
input = { density = "7957.748 kg/m^3", diameter = "20 mm" }
coupler = { density = "7957.748 kg/m^3", diameter = "20 mm" }
output = { density = "7957.748 kg/m^3", diameter = "20 mm" }
[motion]
theta_2 = { from = "0 deg", to = "360 deg", steps = 360 }
omega_2 = "20 rpm"
"""


def test_steel_rods_by_their_density(analyze):
    """A file, two commands: torque, pins and stress.

    The shaking force position by position.
    """
    text = analyze(RODS)
    peak, place, rms = row_of(text, "torque")
    assert (peak, rms) == approx((-3.04213, 1.01795), rel=2e-4)
    assert place == approx(2.517, abs=0.02)
    pins = row_of(text, "peak", after="pins")
    assert pins == approx([14.974, 14.151, 8.728, 7.907], rel=5e-4)
    moments, stresses = (
        np.array(row_of(text, label, after="bending")) for label in ("moment", "stress")
    )
    modulus = np.pi * 0.02**3 / 32.0
    assert 1e6 * stresses == approx(moments / modulus, rel=1e-3)
    rows = list_columns(analyze(RODS, "--columns", "shaking_force"))
    assert max(rows)[0] == approx(12.7176, rel=1e-4)


PER_LENGTH = """\
[lengths]
ground = "1000 mm"
input = "500 mm"
coupler = "660 mm"
output = "560 mm"
[bars]
input = { mass = "3.54 kg", inertia = "88500 kg mm^2", centre = ["200 mm", "0 deg"] }
coupler = { mass_per_length = "4.2 kg/m" }
output = { mass_per_length = "4.2 kg/m" }
[motion]
theta_2 = "60 deg"
omega_2 = "10.5 rad/s"
alpha_2 = "-26 rad/s^2"
"""


GUIDED = """\
[lengths]
ground = "4 ft"
input = "4 ft"
coupler = "4 ft"
output = "4 ft"
[bars]
input = { mass = "20 lb" }
coupler = { mass = "20 lb" }
output = { mass = "20 lb" }
[motion]
theta_2 = { from = "10 deg", to = "170 deg", steps = 160 }
[effects]
gravity = ["1 g_0", "-90 deg"]
[[effects.springs]]
from = { bar = 1, from_pin = { x = "-1e6 ft", y = "2 ft" } }
to = { bar = 2, from_pin = ["2 ft", "0 deg"] }
stiffness = "50 lbf/ft"
length = "1e6 ft"
"""


@mark.slow
def test_a_frame_with_a_spring_on_a_roller(ask, tmp_path):
    """V = 160 sin(theta) + 100 cos^2(theta) lbf ft: sin(theta) = 0.8, or upright."""
    (tmp_path / "frame.toml").write_text(GUIDED)
    text = ask("equilibrium", "frame.toml")
    tilt = np.degrees(np.arcsin(0.8))
    rows = re.findall(r"^ *([0-9.]+) +[0-9.]+ open +(\w+)", text, re.MULTILINE)
    angles = [float(angle) for angle, _ in rows]
    assert angles == approx([tilt, 90.0, 180.0 - tilt], abs=PRINTED * 90.0)
    assert [kind for _, kind in rows] == ["unstable", "stable", "unstable"]


LENGTHS = """[lengths]
ground = "{}"
input = "{}"
coupler = "{}"
output = "{}"
"""
TO_SIX_DIGITS = {"rel": PRINTED}
TASKS = {
    **{
        f"everything about one position of a homework linkage, {branch}": (
            assembled(HOMEWORK, branch),
            (),
            {"abs": 6e-3},
            right,
        )
        for branch, right in (("open", OPEN), ("crossed", CROSSED))
    },
    **{
        f"an output angle that is known, {branch}": (
            assembled(MIDTERM, branch),
            ("--units", "in rad"),
            TO_SIX_DIGITS | {"abs": 5e-5},
            {"bar 2": (theta_2,), "P": place},
        )
        for branch, theta_2, place in (
            ("open", -0.015833, (6.659926, 5.879577)),
            ("crossed", 0.539432, (11.363445, 6.296990)),
        )
    },
    "nine equations of the free bodies, of bars that state masses per length": (
        PER_LENGTH,
        (),
        TO_SIX_DIGITS,
        {
            "torque": (24.0736,),
            "F12 at O2": 211.656,
            "F43 at B": 60.2987,
            "F14 at O4": 85.2365,
        },
    ),
    "pliers, whose advantage needs no speed": (
        PLIERS,
        (),
        TO_SIX_DIGITS,
        {
            "omega_4/omega_2": (0.1332544,),
            "mechanical advantage": (1.0 / 0.1332544,),
            "F_jaw/F_handle": (31.969,),
        },
    ),
    "SymPy's test_four_bar_linkage: (M^-1 f) of its printed mass and forcing": (
        LENGTHS.format("0.13 m", "0.24 m", "0.21 m", "0.34 m")
        + """ground_angle = "180 deg"
[bars]
input = { mass = "239.28 kg" }
coupler = { mass = "209.37 kg" }
output = { mass = "338.98 kg" }
[motion]
theta_2 = "2.1 rad"
omega_2 = "0.2 rad/s"
branch = "crossed"
free = { duration = "0.1 s", steps = 10 }
""",
        ("--at", "time=0 s"),
        TO_SIX_DIGITS,
        {
            "bar 2": (120.3211, 0.2, 0.00487581),
            "bar 3": (158.4542, 0.0203627, 0.00487581 - 0.01990181),
            "bar 4": (123.2640, 0.151269, 0.00487581 - 0.01990181 + 0.01218057),
        },
    ),
    "a force on the output, whose moment about O4 the input holds by its ratio": (
        LENGTHS.format("500 mm", "400 mm", "1000 mm", "750 mm")
        + """[motion]
theta_2 = "120 deg"
omega_2 = "0 rad/s"
[[loads]]
bar = 4
force = ["80 N", "150 deg"]
from_pin = ["350 mm", "0 deg"]
""",
        (),
        TO_SIX_DIGITS,
        {"torque": (-18.6940,), "F43 at B": (-43.9418, -17.3602, 47.2468)},
    ),
    "a platform on two links, 52 lbf ft printed: (33 + 10/2) 4 ft sin 20 deg": (
        LENGTHS.format("2 ft", "4 ft", "2 ft", "4 ft")
        + """[bars]
input = { mass = "10 lb" }
[motion]
theta_2 = "70 deg"
omega_2 = "0 rpm"
[[loads]]
bar = 3
force = ["33 lbf", "-90 deg"]
[effects]
gravity = ["1 g_0", "-90 deg"]
""",
        (),
        TO_SIX_DIGITS,
        {"torque": (38.0 * 4.0 * np.sin(np.radians(20.0)),)},
    ),
}


@mark.parametrize("task", TASKS)
def test_a_task_of_a_textbook_or_a_forum(task, analyze):
    """A file, a command."""
    text, words, accuracy, rows = TASKS[task]
    shown = analyze(text, *words)
    assert len(shown.splitlines()) < 40 or "homework" not in task
    for label, numbers in rows.items():
        printed = row_of(shown, label)
        if isinstance(numbers, float):  # the size of a force stands last
            printed = printed[-1]
        else:
            printed = printed[: len(numbers)]
        assert printed == approx(numbers, **accuracy), label
