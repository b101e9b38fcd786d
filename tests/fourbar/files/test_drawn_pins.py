"""A scene as it is drawn: lengths and back, places, words, and what is refused."""

import os
from math import atan2, hypot, pi, remainder, tau

import numpy as np
from pytest import approx, mark, raises

from fourbar import (
    InputError,
    Motion,
    Scene,
    circuits,
    command,
    from_pins,
    solve,
    uniform,
)
from fourbar.files import dump, loads
from fourbar.mjcf.assembly import write_sdf, write_usd
from fourbar.mjcf.plane import Plane
from tests.support.rows import read_rows, refused, slow_but
from tests.support.scenes import EPS, cis

K = 8.0
"""Roundings of four lengths, two angles and the triangle, each of a few eps of the
longest bar.
"""
DRAWN = """\
[pins]
O2 = ["0 mm", "0 mm"]
A = ["0 mm", "100 mm"]
B = ["175 mm", "50 mm"]
O4 = ["250 mm", "50 mm"]
"""


def random_pins(random, kind):
    """Draw O2, A, B, O4 at a random place and scale.

    Any four, a parallelogram or a kite.
    """
    scale = 10.0 ** random.uniform(-3.0, 3.0)
    O2, A, B, O4 = random.normal(size=4) + 1j * random.normal(size=4)
    if kind == "parallelogram":
        B = A + O4 - O2
    elif kind == "kite":  # A mirrored in the line from O2 to B
        along = (B - O2) / abs(B - O2)
        O4 = O2 + along * ((A - O2) / along).conjugate()
    shift = 10.0 ** random.uniform(-2.0, 1.0) * cis(random.uniform(0.0, 7.0))
    return [complex(scale * (pin + shift)) for pin in (O2, A, B, O4)]


def write_pins(pins):
    """Write O2, A, B, O4 as a scene file has them, to a tenth of a millimetre."""
    rows = ["[pins]"]
    for name, pin in zip(("O2", "A", "B", "O4"), pins, strict=True):
        rows.append(f'{name} = ["{pin.real:.1f} mm", "{pin.imag:.1f} mm"]')
    return "\n".join(rows) + "\n"


def find_gap(pins):
    """Return how far a linkage stands from its drawing, eps of its bars and
    condition.
    """
    O2, A, B, _ = pins
    scene = from_pins(*((pin.real, pin.imag) for pin in pins))
    here = solve(scene, "position")
    found = [complex(*here[name][0]) for name in ("A", "B")]
    gap = max(abs(found[0] - (A - O2)), abs(found[1] - (B - O2)))
    return gap * float(here.condition[0]) / (EPS * max(scene.linkage.lengths))


DRAWINGS = int(os.environ.get("DRAWINGS", "1000"))
"""Drawings at random of the slow test, and a tenth as many with change points; `make
long-fuzz` takes 10 000.
"""


@mark.parametrize("count", slow_but({100}, [100, DRAWINGS]))
def test_drawings_turned_into_lengths_come_back(count):
    random = np.random.default_rng(5)
    special = max(count // 20, 20)
    for kind, drawn in (("any", count), ("parallelogram", special), ("kite", special)):
        for _ in range(drawn):
            assert find_gap(random_pins(random, kind)) < K, kind


def test_places_of_the_drawing_are_where_they_are_drawn():
    """Away from the origin.

    Points of all bars, a mass centre, and coordinates as they are printed.
    """
    pins = DRAWN.replace('"0 mm", "0 mm"', '"-20 mm", "7 mm"')
    places = {1: (30.0, 40.0), 2: (-5.0, 60.0), 3: (120.0, 80.0), 4: (200.0, 20.0)}
    rows = "\n".join(
        f'P{bar} = {{ bar = {bar}, from_pin = {{ drawn = ["{x} mm", "{y} mm"] }} }}'
        for bar, (x, y) in places.items()
    )
    centre = '[bars.coupler]\nmass = "1 kg"\ncentre = { drawn = ["100 mm", "70 mm"] }\n'
    text = f'{pins}{centre}[motion]\ntheta_2 = "drawn"\n[points]\n{rows}\n'
    scene = loads(text)
    listed = loads(text.replace('"drawn"', '["1 rad", "drawn"]')).motion.theta_2
    assert listed.tolist() == [1.0, scene.motion.theta_2]
    table = solve(scene).to_pandas()
    for bar, place in places.items():
        shown = [table[f"P{bar}_{axis}"][0] * 1e3 for axis in "xy"]
        assert shown == approx(place, abs=1e-10)
    assert table["G3_x"][0] == approx(0.1, abs=1e-14)
    assert loads(dump(scene)) == scene and "[pins]" in dump(scene)


def test_a_place_of_the_drawing_stands_beside_its_bar_wherever_a_place_stands():
    acts = """
[motion]
theta_2 = "drawn"
omega_2 = "0 rad/s"
[points]
P = { bar = 3, PLACE ["120 mm", "80 mm"] CLOSED }
[[loads]]
bar = 4
force = ["10 N", "0 deg"]
PLACE ["240 mm", "70 mm"] CLOSED
[[loads]]
bar = 3
moment = "1 N m"
PLACE ["120 mm", "80 mm"] CLOSED
"""
    short = acts.replace("PLACE", "drawn =").replace("CLOSED", "")
    nested = acts.replace("PLACE", "from_pin = { drawn =").replace("CLOSED", "}")
    scene = loads(DRAWN + short)
    assert loads(DRAWN + nested) == loads(dump(scene)) == scene
    assert scene.loads[1].from_pin == scene.points[0].from_pin
    for text, said in (
        (short.replace("bar = 3, ", ""), "points.P.bar: is missing"),
        (short.replace("bar = 3, ", 'bar = 3, from_pin = ["1 m", "0"], '), "already"),
    ):
        with refused(said):
            loads(DRAWN + text)


CYLINDER = """\
[drive]
from = { bar = 1, from_pin = { drawn = ["100 mm", "-50 mm"] } }
to = { bar = 2, from_pin = { drawn = ["10 mm", "60 mm"] } }
[motion]
stroke = "drawn"
side = "drawn"
"""


def test_the_stroke_and_the_side_of_a_cylinder_are_drawn():
    scene = loads(DRAWN + CYLINDER)
    here = solve(scene)
    assert scene.motion.stroke == approx(hypot(0.09, 0.11), rel=4 * EPS)
    assert here.A[0] == approx([0.0, 0.1], abs=1e-14)
    assert here.B[0] == approx([0.175, 0.05], abs=1e-13)
    assert loads(DRAWN + CYLINDER.replace('side = "drawn"\n', "")) == scene
    for side in ("left", "right"):
        stated = CYLINDER.replace('side = "drawn"', f'side = "{side}"')
        assert loads(DRAWN + stated).motion.side == side


@mark.parametrize("commanded", ["theta_2", "theta_3", "theta_4", "stroke"])
def test_what_is_drawn_at_its_limit_is_singular_there(commanded):
    """Two bars are in line, or O2 and both ends of a cylinder, whatever is rounded."""
    random = np.random.default_rng(3)
    for _ in range(12):
        x, y, *other = random.integers(20, 90, 4).tolist()
        A, other = complex(x, y), complex(*other)
        pins = {
            "theta_2": (0.0, A, A + 200.0 * other, A + 600.0 * other),
            "theta_3": (0.0, A, other + 2.0 * A, other),
            "theta_4": (0.0, A, -2.0 * A, other),
            "stroke": (0.0, A, A + other, 1.0),
        }[commanded]
        text = f"""{write_pins(pins)}[drive]
from = {{ bar = 1, drawn = ["{-x} mm", "{-y} mm"] }}
to = {{ bar = 2, drawn = ["{3 * x} mm", "{3 * y} mm"] }}
[motion]
{commanded} = "drawn"
"""
        here = solve(loads(text))
        assert list(here.status) == ["singular"]
        found = [1e3 * complex(*pin[0]) for pin in (here.A, here.B)]
        assert found == approx(pins[1:3], abs=1e-9)


@mark.parametrize(
    "drive",
    [
        "",
        "[drive]\nbar = 2\n",
        """\
[drive]
from = { bar = 2, from_pin = { drawn = ["0 mm", "50 mm"] } }
to = { bar = 4, from_pin = { drawn = ["200 mm", "50 mm"] } }
""",
    ],
)
@mark.parametrize("side", ["", 'side = "drawn"\n'])
def test_a_drawn_stroke_without_its_cylinder_is_refused(drive, side):
    """The drive is wrong, and not a side that the file need not state."""
    with raises(InputError, match=r"is of a cylinder \(\[drive\]\)") as raised:
        loads(DRAWN + drive + '[motion]\nstroke = "drawn"\n' + side)
    assert raised.value.key == "motion.stroke"


def test_a_scene_that_was_changed_since_is_written_by_its_lengths():
    scene = loads(DRAWN)
    crossed = Scene(
        scene.linkage,
        scene.motion.replace(branch=-scene.motion.branch),
        drawing=scene.drawing,
    )
    assert "[lengths]" in dump(crossed) and "[pins]" not in dump(crossed)


def test_the_default_sweep_holds_the_drawn_position():
    """A rocker with two ranges, mirror images in the ground.

    The one in which it is drawn.
    """
    linkage = uniform(3.0, 2.5, 2.0, 1.0)
    assert len(circuits(linkage)) == 2
    for theta_4 in (0.5 * pi, -0.5 * pi):
        here = solve(Scene(linkage, Motion(theta_4=theta_4)))
        A, B = (tuple(pin[0].tolist()) for pin in (here.A, here.B))
        scene = from_pins((0.0, 0.0), A, B, (3.0, 0.0))
        sweep = Scene(
            scene.linkage,
            Motion(branch=scene.motion.branch),
            drawing=scene.drawing,
        )
        angles = command(sweep).angle
        middle = 0.5 * (angles[0] + angles[-1])
        away = remainder(scene.motion.theta_2 - middle, tau)
        assert abs(away) < 0.5 * (angles[-1] - angles[0])


@mark.parametrize(
    "old, new, says",
    read_rows(r"""
[pins] | [lengths]\nground = "1 m"\n[pins] | the pins state the lengths
A = ["0 mm", "100 mm"]\n |  | pins.A: is missing
"100 mm" | 100 | the unit is missing
"0 mm", "100 mm" | "0 mm", "0 mm" | lies where O2 does
"100 mm"] | "100 mm", "0 mm"] | must be a pair like
[pins] | [motion]\nbranch = "open"\n[pins] | the pins state the assembly
"""),
)
def test_a_drawing_that_is_none_is_refused(old, new, says):
    old, new = (text.replace(r"\n", "\n") for text in (old, new))
    with refused(says):
        loads(DRAWN.replace(old, new))


CRANE = """\
[lengths]
ground = { x = "-120 mm", y = "-70 mm" }
input = "455 mm"
coupler = "124 mm"
output = "570 mm"
[drive]
from = { bar = 1, drawn = ["433 mm", "-1768.2 mm"] }
to = { bar = 4, from_pin = ["570 mm", "0 deg"] }
[[loads]]
bar = 2
moment = "-50 kN m"
[motion]
theta_2 = ["-20 deg", "0 deg", "60 deg"]
omega_2 = "0 rad/s"
"""
"""The boom of a crane on bar 2, whose cylinder pushes the pin of two links."""


def test_a_ground_by_coordinates_and_a_place_drawn_on_it():
    """The pin is where two circles meet, the force is that of virtual work."""
    foot, O4 = 0.433 - 1.7682j, -0.12 - 0.07j

    def stroke(angle):
        d = 0.455 * cis(angle) - O4
        along = (0.57**2 + abs(d) ** 2 - 0.124**2) / (2.0 * abs(d))
        pin = O4 + d / abs(d) * (along - 1j * np.sqrt(0.57**2 - along**2))
        return abs(pin - foot)

    scene = loads(CRANE)
    here = solve(scene)
    assert here.stroke == approx(stroke(here.theta_2), rel=1e-14)
    ratio = (stroke(here.theta_2 + 1e-5) - stroke(here.theta_2 - 1e-5)) / 2e-5
    assert here.drive_force == approx(50e3 / ratio, rel=1e-8)
    assert loads(dump(scene)) == scene
    assert scene.linkage.lengths == (hypot(0.12, 0.07), 0.455, 0.124, 0.57)
    assert scene.linkage.ground_angle == atan2(-0.07, -0.12)


@mark.parametrize(
    "old, new, says",
    read_rows(r"""
, y = "-70 mm" |  | lengths.ground.y: is missing
[drive] | ground_angle = "1 deg"\n[drive] | x and y of the ground
bar = 1, drawn | bar = 2, drawn | is a place of a moving bar
x = "-120 mm" | z = "1 mm", x = "-120 mm" | unknown key
"-120 mm", y = "-70 mm" | "0 mm", y = "0 mm" | coordinates of O4
"""),
)
def test_a_ground_by_coordinates_that_is_none_is_refused(old, new, says):
    new = new.replace(r"\n", "\n")
    with refused(says):
        loads(CRANE.replace(old, new))


def test_a_drawing_on_a_change_point_is_refused():
    with refused("lie in one line: at a change point"):
        loads(write_pins((0, 1, 4, 3)))


@mark.slow
def test_a_parallelogram_drawn_on_a_grid_is_one():
    """To a tenth of a millimetre the lengths of opposite bars differ.

    The sum of all is above 500 mm.
    """
    random = np.random.default_rng(1)
    tried = 0
    for _ in range(200):
        O2 = complex(*random.uniform(-200.0, 200.0, 2))
        arm, base = (
            random.uniform(150.0, 300.0) * cis(random.uniform(0.0, 7.0))
            for _ in range(2)
        )
        if abs(np.sin(np.angle(arm / base))) < 0.1:
            continue
        pins = (O2, O2 + arm, O2 + arm + base, O2 + base)
        scene = loads(write_pins(pins))
        tried += 1
        assert scene.linkage.ground == approx(scene.linkage.coupler.length, rel=1e-14)
        assert loads(dump(scene)).linkage == scene.linkage
    assert tried > 150


def test_a_drawing_that_nearly_has_one_change_point_stays_as_it_is():
    """d + a = b + c but for 0.03 mm, within the decimals.

    By chance, and nobody draws that.
    """
    text = """\
[pins]
O2 = ["0.0 mm", "0.0 mm"]
A = ["0.0 mm", "100.0 mm"]
B = ["273.0 mm", "150.8 mm"]
O4 = ["300.0 mm", "30.0 mm"]
"""
    scene = loads(text)
    pins = scene.drawing
    d, a, b, c = drawn = tuple(pins.length(bar) for bar in (1, 2, 3, 4))
    assert 1e-5 < abs(d + a - b - c) < 5e-5
    assert scene.linkage.lengths == drawn


def test_sdf_and_usd_stand_where_the_drawing_has_them():
    """The frame of a model file is the drawing's.

    O2 at its place there, moved on by --origin.
    """
    moved = DRAWN.replace('"0 mm", "0 mm"', '"41 mm", "37.5 mm"')
    masses = (
        f"[bars.{name}]\nmass = '1 kg'" for name in ("input", "coupler", "output")
    )
    scene = loads("\n".join([moved, *masses, '[motion]\nomega_2 = "1 rad/s"\n']))
    assert "<pose>0.041 0.0375 0 " in write_sdf(scene)
    assert "translate = (0.041, 0.0375, 0)" in write_usd(scene)
    on_a_base = Plane(origin=(1.0, 0.0, 2.0))
    assert "translate = (1.041, 0.0375, 2.0)" in write_usd(scene, plane=on_a_base)


@mark.parametrize("bar", [2, 4])
def test_a_commanded_bar_that_stands_still_as_drawn_is_refused(bar):
    """A kite folded onto one pin.

    Two bars turn together about it, and the others rest.
    """
    folded = {2: (0, 300, 300 + 200j, 300), 4: (0, 150 + 80j, 0, 300)}[bar]
    motion = f'[motion]\ntheta_{bar} = "drawn"\nomega_{bar} = "1 rad/s"\n'
    text = write_pins(folded) + motion
    with refused("stands still: command another bar"):
        loads(text)
    other = 6 - bar
    here = solve(loads(text.replace(f"_{bar} =", f"_{other} =")))
    assert here[f"omega_{bar}"][0] == 0.0
