"""Where gas springs are beyond their stroke, by the geometry of a parallelogram."""

import json
import re
from math import acos, asin, cos, degrees, pi, radians, sin, sqrt, tan, tau

from pytest import mark

from fourbar import (
    Flywheel,
    Free,
    Motion,
    Place,
    Scene,
    Spring,
    Springs,
    Sweep,
    Torsion,
    solve,
)
from fourbar.files import loads
from fourbar.show.acting import list_drawn_notes, list_spring_notes
from fourbar.solution import DEGREES
from tests.support.block import read_block
from tests.support.rows import read_rows
from tests.support.scenes import MASSLESS

HATCH = """
[lengths]
ground = "100 mm"
input = "400 mm"
coupler = "100 mm"
output = "400 mm"
[bars.input]
mass = "10 kg"
[motion]
theta_2 = { from = "10 deg", to = "80 deg", steps = 7 }
omega_2 = "0 rad/s"
[effects]
gravity = ["9.81 m/s^2", "-90 deg"]
[[effects.springs]]
from = { bar = 1, from_pin = ["200 mm", "-90 deg"] }
to = { bar = 2, from_pin = ["300 mm", "0 deg"] }
gas = { extended = "EXTENDED", stroke = "STROKE", extended_force = "300 N" }
"""
"""The spring from 0.2 m below O2 to 0.3 m along the input: by the law of cosines
distance^2 = 0.2^2 + 0.3^2 + 2 0.2 0.3 sin(theta_2)."""


def reach(distance):
    """Return the angle at which the ends are so far apart, as it is printed."""
    sine = (distance**2 - 0.2**2 - 0.3**2) / (2.0 * 0.2 * 0.3)
    return f"{degrees(asin(sine)):.4g} deg"


def torsion(line, motion, **rests):
    """A parallelogram hatch, its ground at `line` deg, with springs of these rests."""
    springs = ", ".join(
        f'{pin} = {{ stiffness = "1 N m/rad", rest = "{rest} deg" }}'
        for pin, rest in rests.items()
    )
    text = hatch(motion=motion).replace(
        "input =", f'ground_angle = "{line} deg"\ninput ='
    )
    return text.replace("[effects]", f"[effects]\ntorsion = {{ {springs} }}")


DRIVE = """
[drive]
from = { bar = 1, from_pin = ["200 mm", "-90 deg"] }
to = { bar = 2, from_pin = ["300 mm", "0 deg"] }
"""


SWEEP = """theta_2 = { from = "10 deg", to = "80 deg", steps = 7 }
omega_2 = "0 rad/s"
"""


def hatch(extended="400 mm", stroke="150 mm", motion=SWEEP):
    text = HATCH.replace("EXTENDED", extended).replace("STROKE", stroke)
    return text.replace(SWEEP, motion)


def spring(length, motion=SWEEP, more=""):
    """A hatch whose spring may push and pull."""
    stated = f'stiffness = "500 N/m"\nlength = "{length}"\n{more}'
    return re.sub(r"gas = .*\n", stated, hatch(motion=motion))


def load(stated):
    """A hatch without the spring, and a load; bar 2 has a mass and the others none."""
    return f"{HATCH.partition('[effects]')[0]}[[loads]]\n{stated}\n"


COUPLE = 'moment = "1 N m"'
FORCE = 'force = ["1 N", "0 deg"]'
ARM = 'arm = ["1 mm", "0 deg"]'
LONGEST = f"{1000.0 * sqrt(0.13 + 0.12 * sin(radians(80.0)))!r} mm"
AT_80 = 'theta_2 = "80 deg"\nomega_2 = "0 rad/s"\n'
LISTED = 'theta_2 = ["10 deg", "80 deg", "12 deg", "50 deg"]\n'
SLOWLY = 'theta_2 = ["10 deg", "20 deg", "80 deg"]\n'
BACK = 'theta_2 = ["80 deg", "20 deg", "10 deg"]\n'
BY_BAR_4 = 'theta_4 = { from = "10 deg", to = "80 deg", steps = 7 }\n'
BY_LAW = """[motion.law]
time = ["0 s", "1 s", "3 s"]
theta_2 = ["10 deg", "30 deg", "80 deg"]
ends = "rest"
steps = 20
"""
BY_STROKE = """stroke = { from = "390 mm", to = "497 mm", steps = 7 }
side = "left"
"""
TOO_LONG = "extended length of 400 mm"
PULLS = "spring 1 pulls"
AT_50 = 'theta_2 = "50 deg"\nomega_2 = "0 rad/s"\n'
FROM_LINE = "from the ground's line, which lies at -20 deg"
TOLD = [
    (hatch(), f"{TOO_LONG} from theta_2 = {reach(0.4)} on"),
    (hatch("600 mm"), f"compressed length of 450 mm up to theta_2 = {reach(0.45)}"),
    (hatch("300 mm"), "extended length of 300 mm throughout"),
    (hatch("600 mm", "300 mm"), "!gas spring"),
    (torsion(-20, AT_50, O2=115), f"at O2: wound by -45 deg, at 70 deg {FROM_LINE}"),
    (torsion(-20, AT_50, O4=290), f"at O4: wound by 140 deg, at 430 deg {FROM_LINE}"),
    (
        torsion(0, AT_50, O2=40),
        "at O2: wound by 10 deg, at 50 deg from the ground's line",
    ),
    (
        torsion(-20, AT_50, A=30),
        "at A: wound by -100 deg, at -70 deg from the line of bar 2",
    ),
    (
        torsion(-20, AT_50, B=70),
        "at B: wound by 0 deg, at 70 deg from the line of bar 3",
    ),
    (torsion(0, SWEEP, O2=9), "!torsion"),
    (torsion(-20, SWEEP, A=9), "!torsion"),
    (
        torsion(0, SWEEP, A=125),
        "spring at A: half a turn or more from rest from theta_2 = 60 deg on, where",
    ),
    (torsion(0, SWEEP, A=125), "3 wound peaks and means are without the positions"),
    (hatch(LONGEST), "!gas spring"),
    (hatch(motion=AT_80), f"longer than its {TOO_LONG} here"),
    (hatch(motion=LISTED), "at theta_2 = 80 deg and from theta_2 = 50 deg on"),
    (hatch(motion=BY_BAR_4), f"{TOO_LONG} from theta_4 = {reach(0.4)} on"),
    (hatch(motion=BY_LAW), f"{TOO_LONG} from t = "),
    (hatch(motion=BY_STROKE + DRIVE), f"{TOO_LONG} from stroke = 400 mm on"),
    (spring("400 mm"), f"{PULLS} from theta_2 = {reach(0.4)} on and pushes elsewhere"),
    (
        spring("400 mm", SLOWLY),
        f"{PULLS} from theta_2 = 20 deg on and pushes elsewhere",
    ),
    (spring("400 mm", BACK), f"{PULLS} down to theta_2 = 20 deg and pushes elsewhere"),
    (spring("600 mm"), "!elsewhere"),
    (spring("400 mm", more='acts = "push"\n'), "!elsewhere"),
    (
        load(f"bar = 4\n{COUPLE}"),
        "load 1 enters bar 4 at O4; its from_pin would state another place",
    ),
    (load(f"bar = 3\n{COUPLE}"), "load 1 enters bar 3 at G"),
    (load(f'bar = 4\n{COUPLE}\nfrom_pin = ["1 mm", "0 deg"]'), "!enters bar"),
    (load(f"bar = 4\n{COUPLE}\n{FORCE}"), "!enters bar"),
    (
        load(f"bar = 4\n{FORCE}\n{ARM}"),
        "load 1: arm counts from G of bar 4, taken to be mid-bar",
    ),
    (load(f"bar = 2\n{FORCE}\n{ARM}"), "!arm counts"),
]
"""Scene files, and what their block tells; "!" before what it does not."""


@mark.parametrize("text, said", TOLD)
def test_where_springs_are_beyond_their_stroke_and_places_are_taken_is_told(text, said):
    told = read_block(solve(loads(text)))
    assert (said.removeprefix("!") in told) == (said[0] != "!"), told


@mark.slow
def test_every_form_of_what_is_printed_tells_it(tmp_path, show):
    """Of an equilibrium the place is that of the input."""
    file = tmp_path / "hatch.toml"
    file.write_text(hatch(motion=BY_BAR_4), encoding="utf-8")
    said = f"{TOO_LONG} from theta_2 = {reach(0.4)} on"
    assert said in " ".join(show("equilibrium", file).split())
    for command in ("analyze", "equilibrium"):
        (note,) = json.loads(show(command, file, "--json"))["notes"]
        assert "has no stops" in note
    file.write_text(load(f"bar = 4\n{FORCE}\n{ARM}"), encoding="utf-8")
    for option in ("--columns=theta_2,torque", "--table", "--json"):
        assert "arm counts from G of bar 4" in show("analyze", file, option)


DRAWN = """
[pins]
O2 = ["0 mm", "0 mm"]
A = ["-98 mm", "ACROSS mm"]
B = ["-450 mm", "200 mm"]
O4 = ["-300 mm", "0 mm"]
[motion]
theta_2 = { from = "FROM", to = "TO", steps = 4 }
omega_2 = "1 rad/s"
[bars.input]
mass = "1 kg"
"""


LONG_WAYS = read_rows("""
drawn | -170 deg | to = "190 deg" is the same direction, 20 deg from
-170 deg | drawn | from = "190 deg" is the same direction, 20 deg from
drawn | 190 deg |
drawn | 530 deg |
169.9 deg | -170 deg |
""")


@mark.parametrize("start, stop, told", LONG_WAYS)
def test_a_sweep_from_a_drawing_that_goes_the_long_way_is_told(start, stop, told):
    """The input is drawn at 170 deg, or at -190 deg, to a ground at 180 deg."""
    text = DRAWN.replace("FROM", start).replace("TO", stop)
    scene = loads(text.replace("ACROSS", repr(98.0 * tan(radians(10.0)))))
    (note,) = list_drawn_notes(scene, DEGREES) or [""]
    assert told in note and bool(told) == note.startswith("theta_2 goes by 340 deg")


ENDS = Place(1, (0.3, 0.0)), Place(2, (0.1, 0.0))


@mark.parametrize("start, stop", [(2.0, 2.0 + tau), (8.0, 2.0)])
def test_a_spring_pulls_between_the_positions_of_a_coarse_sweep(start, stop):
    """It is longest where the crank points away from its end, between two of three."""
    springs = Springs((Spring(*ENDS, 1.0, sqrt(0.1 - 0.06 * cos(pi - 0.2))),))
    scene = Scene(MASSLESS, Motion(Sweep(start, stop, 1), 1.0), effects=(springs,))
    (note,) = list_spring_notes(solve(scene), DEGREES)
    places = [f"theta_2 = {degrees(pi + x):.4g} deg" for x in (-0.2, 0.2)]
    if stop < start:
        places = places[::-1]
    assert f"pulls from {places[0]} to {places[1]} and" in note


@mark.slow
def test_a_spring_pulls_in_a_release_from_between_its_instants():
    """The crank swings about the rest of a spring at O2: theta = 1 - cos(w t)/2."""
    length = sqrt(0.1 - 0.06 * cos(1.1))  # at 1.1 rad
    effects = (
        Flywheel(0.01, 2),
        Torsion.at(O2=(1.0, 1.0, 0.0)),
        Springs((Spring(*ENDS, 1e-12, length),)),
    )
    scene = Scene(MASSLESS, Motion(0.5, 0.0, free=Free(0.3, 3)), effects=effects)
    time = 1e3 * acos(-0.2) / 10.0
    (note,) = list_spring_notes(solve(scene), DEGREES)
    assert f"pulls from t = {time:.4g} ms on" in note
