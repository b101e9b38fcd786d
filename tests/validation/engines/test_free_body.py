"""The free bodies against levers, energy and 50 digits, never against the formulas."""

from math import pi, prod, tau
from pathlib import Path

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
from pytest import approx, mark

from fourbar import Motion
from fourbar.effects import Friction, Gravity, Load, Place, Spring, Springs, Torsion
from fourbar.linkage import PIN_FORCE, PINS
from fourbar.scene import Scene, command
from fourbar_validation.engines import free_body, free_body_closure
from fourbar_validation.engines.free_body import FreeBody
from fourbar_validation.engines.registry import ask_at
from fourbar_validation.engines.sliding import continue_couples, solve_system
from fourbar_validation.scenes.random import draw_random_scene
from tests.support.rows import read_rows
from tests.support.scenes import EPS, bare, crank_rocker
from tests.validation.engines.test_tree import ACTING
from tests.whole.test_imports import imported

DIGITS = 50.0 * EPS
"""Of the sum of the terms: an equation of some fifty roundings, evaluated in doubles.
"""
RECTANGLE = bare(0.3, 0.1, 0.3, 0.1)


def answered(scene):
    answer = FreeBody().answer(scene, command(scene))
    assert answer.refusal is None and answer.assembled.all()
    return answer.quantities


@mark.parametrize("pin, begin", [("O4", 0.3), ("O2", 0.3 + 3.0 * tau)])
def test_a_spring_is_wound_along_the_assembly_through_change_points(pin, begin):
    """Of a parallelogram bars 2 and 4 turn together: each winds by what bar 2 turns.

    Also where all positions have one sign, and change points lie between them.
    """
    rest = 0.1
    for turned in (np.linspace(0.0, 2.0 * tau, 25), tau * np.arange(3)):
        scene = Scene(
            RECTANGLE,
            Motion(begin + turned, 6.0),
            effects=(Torsion(((pin, 2.0, rest, 0.0),)),),
        )
        torque = ask_at(FreeBody(), scene, command(scene)).quantities["torque"]
        wound = 0.2 + turned > pi
        assert_array_equal(np.isnan(torque), wound)
        assert_allclose(torque[~wound], 2.0 * (0.2 + turned)[~wound], rtol=1e-9)


def test_a_spring_is_followed_through_a_gap_with_bars_3_and_4_in_line():
    """Over the gap between the last two positions their line turns by 3.3 rad, and bar
    3 with it; 3.0 rad the other way would wind the spring beyond half a turn.
    """
    assert np.isfinite(answered(draw_random_scene(401, 1216, ()))["torque"]).all()


def test_it_imports_the_description_and_nothing_of_the_formulas():
    engines, compare = "fourbar_validation.engines.", "fourbar_validation.compare."
    allowed = (
        "fourbar.linkage",
        "fourbar.scene",
        "fourbar.quantities",
        "numpy",
        "collections",
        "dataclasses",
        "itertools",
        "cmath",
        "math",
        "typing",
        *(
            f"{engines}{name}"
            for name in ("free_body", "description", "linear", "sliding")
        ),
        *(f"{compare}{name}" for name in ("answer", "bodies", "line", "pins")),
    )
    for module in (free_body, free_body_closure):
        modules = imported(Path(module.__file__))
        assert modules
        assert not [name for name in modules if not name.startswith(allowed)]


def test_at_rest_the_drive_takes_what_either_beginning_asks():
    """Bars 2 and 4 of a rectangle begin to turn together, and bar 3 not at all."""
    friction = Friction.at(O2=0.1, A=0.2, B=0.3, O4=0.4)
    got = answered(Scene(RECTANGLE, Motion(pi / 2, 0.0), effects=(friction,)))
    ends = got["torque_low"][0], got["torque"][0], got["torque_high"][0]
    assert ends == approx((-1.0, 0.0, 1.0), abs=1e-14)


NOTHING, LEFT, RIGHT = (0.0, 0.0), (-10.0, 0.0), (10.0, 0.0)


@mark.parametrize(
    "drive, forces",
    [(2, (LEFT, RIGHT, RIGHT, NOTHING)), (4, (NOTHING, NOTHING, NOTHING, LEFT))],
)
def test_a_lever_of_an_upright_rectangle(drive, forces):
    """10 N push bar 4 at B along the coupler.

    The bars are upright and 0.1 m long, and the coupler a two-force bar.
    """
    load = Load(4, (10.0, 0.0), arm=(0.05, pi / 2))
    got = answered(Scene(RECTANGLE, Motion(pi / 2, 0.0), drive, (load,)))
    assert got["torque"][0] == approx(1.0, abs=1e-14)
    for name, force in zip(("F12", "F32", "F43", "F14"), forces, strict=True):
        assert got[name][0] == approx(force, abs=1e-13), name


SPRING = Springs(
    (Spring(Place(1, (0.1, -1.5)), Place(4, (0.08, 0.2)), 200.0, 0.05, 3.0),)
)


def test_over_a_turn_what_stores_energy_gives_it_back():
    """The work of the drive over a revolution at constant speed is zero.

    The sum over a period converges like n^-n. A drive of bar 4 has the same power.
    """
    turn = np.arange(512) * (2.0 * pi / 512)

    def power(bar):
        scene = crank_rocker(
            Motion(turn, 10.0),
            loads=(),
            effects=(Gravity(), SPRING, Torsion.at(O4=(2.0, 1.9, 0.1))),
            drive_bar=bar,
        )
        got = answered(scene)
        return got["torque"] * (10.0 if bar == 2 else got["omega_4"])

    of_2, of_4 = power(2), power(4)
    most = abs(of_2).max()
    assert abs(of_2.sum()) < 512 * 1e-14 * most
    assert of_4 == approx(of_2, abs=1e-10 * abs(of_4).max(), rel=0)
    assert most > 1.0


@mark.parametrize("key", ["viscous", "friction", "pin_friction"])
def test_what_brakes_takes_the_power_that_the_drive_gives_more(key):
    """Couple times slip at each pin, at every position.

    Of pin friction with the forces that it changes itself.
    """
    effect = ACTING[key]
    braked = answered(crank_rocker(effects=(effect,)))
    omega = [0.0, 10.0, braked["omega_3"], braked["omega_4"]]
    loss = 0.0
    for pin, *numbers in effect.rows:
        i, j = PINS[pin]
        slip = abs(omega[j - 1] - omega[i - 1])
        load = np.hypot(*braked[PIN_FORCE[pin]].T)
        size = {"viscous": slip, "friction": 1.0, "pin_friction": load}[key]
        loss = loss + prod(numbers) * slip * size
    more = 10.0 * (braked["torque"] - answered(crank_rocker(effects=()))["torque"])
    assert (loss > 0.0).all()
    assert more == approx(loss, abs=1e-12 * 10.0 * abs(braked["torque"]).max(), rel=0)


@mark.parametrize(
    "F, C, x",
    read_rows("""
1 | 0.5 | 2
1 | -0.5 | 0.6666666666666667
3j | 0 | 3
0 | 0.7 | 0
1 | 2 | nan
1 | 1 | nan
"""),
)
def test_friction_of_one_pin(F, C, x):
    """x = |F + C x| by hand.

    Where the couple adds to its own load by as much as it is, the pin jams.
    """
    load, couple = np.array([[complex(F)]]), np.array([[[complex(C)]]])
    couples, _ = continue_couples(load, couple, np.array([1.0]))
    assert couples[0, 0] == approx(float(x), rel=1e-14, nan_ok=True)


def test_friction_of_several_pins_fulfils_its_equations():
    rng = np.random.default_rng(0)
    F, C = (
        rng.normal(size=(200, *shape)) + 1j * rng.normal(size=(200, *shape))
        for shape in ((3,), (3, 3))
    )
    k = np.array([0.05, 0.1, 0.02])
    x, _ = continue_couples(F, C, k)
    load = abs(F + (C * x[:, None, :]).sum(axis=-1))
    assert (x > 0.0).all()
    assert abs(x - k * load).max() <= DIGITS * abs(x).max()


def test_a_singular_position_costs_no_other():
    singular, regular = [[1.0, 2.0], [2.0, 4.0]], [[2.0, 0.0], [0.0, 4.0]]
    matrix = np.array([singular, regular, [[np.nan, 1.0], [1.0, 1.0]]])
    x, residual = solve_system(matrix, np.ones((3, 2, 1)))
    assert np.isnan(x[[0, 2]]).all() and residual == 0.0
    assert_array_equal(x[1, :, 0], [0.5, 0.25])
