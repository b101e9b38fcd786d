"""Coordinates of drawn pins as the numbers of studies, sensitivities and tolerances.

The oracle of coordinates moves the drawing and states the file anew.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fourbar import Gravity, Tolerance, Viscous, save, solve, tolerances, vary
from fourbar.files import dump, loads
from fourbar.studies.keys import list_entries
from tests.support.rows import read_rows, refused
from tests.support.scenes import UNIFORM, crank_rocker
from tests.support.texts import LENGTHS

DRAWING = """\
[pins]
O2 = ["-10 mm", "-10 mm"]
A = ["0 mm", "100 mm"]
B = ["175 mm", "50 mm"]
O4 = ["250 mm", "50 mm"]
"""


ACTS = """
[bars.coupler]
mass = "1 kg"
[bars.output]
mass = "0.5 kg"
[motion]
theta_2 = { from = "50 deg", to = "80 deg", steps = 4 }
omega_2 = "3 rad/s"
alpha_2 = "-2 rad/s^2"
[points]
P = { bar = 3, from_pin = { x = "90 mm", y = "40 mm" } }
Q = { bar = 1, from_pin = { x = "90 mm", y = "40 mm" } }
[[loads]]
bar = 4
force = ["5 N", "20 deg"]
from_pin = ["60 mm", "10 deg"]
[effects]
gravity = ["9.81 m/s^2", "-90 deg"]
"""


PLACED = (
    DRAWING
    + """
[bars.coupler]
mass = "1 kg"
centre = { drawn = ["90 mm", "90 mm"] }
[motion]
theta_2 = { from = "50 deg", to = "80 deg", steps = 4 }
omega_2 = "3 rad/s"
alpha_2 = "-2 rad/s^2"
[drive]
bar = 2
drawn = ["5 mm", "60 mm"]
direction = "170 deg"
[points]
P = { bar = 3, drawn = ["80 mm", "120 mm"] }
Q = { bar = 3, drawn = ["0 mm", "100 mm"] }
G = { bar = 1, drawn = ["-10 mm", "-10 mm"] }
[[loads]]
bar = 3
force = ["5 N", "20 deg"]
drawn = ["0 mm", "100 mm"]
[[loads]]
bar = 4
force = ["5 N", "20 deg"]
drawn = ["230 mm", "70 mm"]
[effects]
gravity = ["9.81 m/s^2", "-90 deg"]
[[effects.springs]]
from = { bar = 1, drawn = ["-10 mm", "-10 mm"] }
to = { bar = 3, drawn = ["60 mm", "90 mm"] }
stiffness = "200 N/m"
length = "20 mm"
[[effects.springs]]
from = { bar = 3, drawn = ["120 mm", "80 mm"] }
to = { bar = 4, drawn = ["250 mm", "50 mm"] }
stiffness = "300 N/m"
length = "20 mm"
"""
)
"""Places of every kind in the drawing, some on the first pin of their bar, where a
distance and an angle have no derivative.
"""


DRAWN = loads(DRAWING + ACTS)


BY_LENGTHS = LENGTHS + ACTS
CENTRE_ON_PIN = f"""{DRAWING}
[bars.input]
mass = "1 kg"
centre = {{ drawn = ["-10 mm", "-10 mm"] }}
"""
TEXTS = {
    "pins": DRAWING + ACTS,
    "lengths": BY_LENGTHS,
    "places": PLACED,
    "centre": CENTRE_ON_PIN,
}
REFUSED = read_rows("""
pins | pins.C.0 | is no number of this scene; must be among pins.
pins | pins.A | must be among pins.A.0, pins.A.1
pins | pins.B.1 lengths.coupler | follows from pins.B.1, which varies too
pins | pins.O2.0 lengths.ground_angle | follows from pins.O2.0, which varies too
lengths | pins.A.0 | must be among lengths.ground, lengths.input, lengths.coupler
lengths | points.P.drawn.0 | must be among points.P.from_pin.0
lengths | loads.0.force.y | must be among loads.0.force.
lengths | points.P.from_pn.1 | must be among points.P.from_pin.1
places | effects.springs.0.gas.extended_force | preload and stiffness state the force
places | effects.springs.0.gas.extended_force | effects.springs.0.preload
places | pins.A.y | must be among pins.A.
places | points.P.drawn | must be among points.P.drawn.0, points.P.drawn.1
places | points.P.from_pin.0 points.P.drawn.0 | follows from points.P.drawn.0, which
places | bars.coupler.centre.1 bars.coupler.centre.drawn.0 | centre.drawn.0, which
centre | bars.input.centre.drawn.0 | must be among bars.input.centre.0, bars.input.
""")
"""Scenes, keys that cannot vary there, and words of the line that says so."""


@pytest.mark.parametrize("name, keys, words", REFUSED)
def test_a_key_that_cannot_vary_gets_one_line_that_names_others(name, keys, words):
    with refused(words):
        vary(loads(TEXTS[name]), {key: [0.0] for key in keys.split()})


def test_a_tolerance_of_such_a_key_gets_that_line():
    stated = '[tolerances]\n"pins.A.0" = "1 mm"\n"lengths.input" = "1 mm"\n'
    with refused("follows from pins.A.0, which has a tol"):
        loads(DRAWING + ACTS + stated)


def test_tolerances_of_pins_are_written_and_shown(show):
    scene = replace(DRAWN, tolerances=(Tolerance("pins.O2.0", "0.05 mm"),))
    assert loads(dump(scene)) == scene
    redrawn = replace(scene, linkage=UNIFORM)
    with refused("no number of the scene has this key"):
        dump(redrawn)  # its file states lengths
    save(scene, "drawn.toml")
    shown = show("tolerance", "drawn.toml", "--samples", 64)
    assert "torque: 100 % pins.O2.0" in shown
    shown = show("analyze", "drawn.toml", "--sensitivity")
    assert "of a\n    drawn coordinate by 1 % of the longest bar" in shown
    assert "\npins.A.0" in shown  # the coordinate 0 of A has an influence too


WISHBONE = """
[pins]
O2 = ["350 mm", "200 mm"]
A = ["700 mm", "170 mm"]
B = ["670 mm", "430 mm"]
O4 = ["420 mm", "445 mm"]
[motion]
theta_2 = "drawn"
omega_2 = "0 rad/s"
[points]
patch = { bar = 3, drawn = ["760 mm", "0 mm"] }
[[loads]]
point = "patch"
force = ["3000 N", "90 deg"]
[tolerances]
"points.patch.drawn.0" = "5 mm"
"""


def test_the_tolerance_of_a_drawn_point_is_that_of_its_coordinate():
    """A double wishbone: 3 kN at the tyre's patch, which the coupler carries.

    The force in the upper bar is that of the moment about A, 3000 N (x - 700 mm), over
    the arm of the line of the upper bar from A.
    """
    spread = tolerances(loads(WISHBONE), 512).spreads["|F43|"]
    upper = complex(-0.250, 0.015)
    arm = abs((upper.conjugate() * complex(0.030, -0.260)).imag) / abs(upper)
    assert_allclose(spread.nominal, 3000.0 * 0.060 / arm, rtol=1e-12)
    assert_allclose(spread.worst, 3000.0 * 0.005 / arm, rtol=1e-12)
    assert_allclose(spread.deviation, spread.first_order, rtol=1e-3)
    scene = loads(WISHBONE)
    assert loads(dump(scene)) == scene


def test_the_table_of_tolerances_fits_a_terminal_and_shows_no_rounding(show, tmp_path):
    """At the drawn position the patch is at y = 0, within the rounding of doubles."""
    path = tmp_path / "wishbone.toml"
    text = WISHBONE.replace(
        'theta_2 = "drawn"', 'theta_2 = { from = "drawn", to = "-8 deg", steps = 4 }'
    )
    path.write_text(text.replace("drawn.0", "drawn.1"), encoding="utf-8")
    shown = show("tolerance", path, "--samples", 64).splitlines()
    assert max(map(len, shown)) <= 80
    (row,) = (line.split() for line in shown if line.startswith("patch_y  "))
    assert row[3] == "0"


RAM = """
[drive]
from = { bar = 1, drawn = ["600 mm", "-100 mm"] }
to = { bar = 2, drawn = ["500 mm", "260 mm"] }
[effects]
springs = [{ from = { bar = 1, drawn = ["900 mm", "0 mm"] }, \
to = { bar = 3, drawn = ["690 mm", "300 mm"] }, stiffness = "4 N/mm", length = "0 m" }]
"""


def test_what_is_drawn_on_the_ground_stays_while_its_pins_move():
    """The file with the moved pin has the same cylinder and spring."""
    heights = np.array([0.4, 0.47])
    text = WISHBONE.replace('theta_2 = "drawn"', 'theta_2 = "-5 deg"')
    varied = vary(loads(text + RAM), {"pins.O4.1": heights})
    forces = [
        solve(loads(f"{text}{RAM}".replace('"445 mm"', f'"{height} m"'))).drive_force
        for height in heights
    ]
    assert_allclose(solve(varied).drive_force, forces, rtol=1e-12)


def test_a_number_has_the_key_and_the_bound_that_its_file_has():
    effects = Gravity(), Viscous.at(A=0.1)
    entries = list_entries(crank_rocker(effects=effects))
    assert {"effects.gravity.0", "effects.gravity.1"} <= entries.keys()
    assert entries["effects.viscous.A"].holds(np.array([-0.1, 0.0])).tolist() == [0, 1]
