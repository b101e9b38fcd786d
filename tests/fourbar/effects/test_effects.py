"""The effects' formulas against potentials, exact arithmetic and limiting cases."""

import json
from math import pi, tau

import numpy as np
from pytest import approx, mark, raises

import fourbar
from fourbar import (
    Free,
    Friction,
    Load,
    Motion,
    PinFriction,
    Place,
    Spring,
    Table,
    solve,
)
from fourbar.effects.pin_friction import (
    find_least_stretch,
    solve_sliding,
)
from fourbar.errors import InputError, LimitError
from fourbar.evaluation.case import compute_shown_state
from fourbar.quantities import JAMMED, OK, SEVERAL
from fourbar.scene import Command, Scene
from tests.support.rows import read_rows
from tests.support.scenes import CRANK_ROCKER_LENGTHS, UNIFORM, crank_rocker, find_angle

LAST_DIGITS = 64 * 2.0**-52
"""The roundings of one evaluation."""


CONES = read_rows("""
1 0 | 0.5 0 | one | 2 | 0.5
1 0 | -0.5 0 | one | 0.6666666666666666 | 1
1 0 | 2 0 | none | nan | nan
1 0 | -2 0 | many | 0.3333333333333333 | 1
1 0 | 0 2 | none | nan | nan
1 0 | 0 0.6 | one | 1.25 | 0.64
0 0 | 0.5 0.3 | one | 0 | 1
3 4 | 0 0 | one | 5 | 1
# beyond the fold at C_y = 1
1 0 | -2 1.000000001 | none | nan | nan
# beside jamming, 1 - 2^-20
1 0 | 0.9999990463256836 0 | one | 1048576 | 9.5367431640625e-07
""")
"""F, C, then the number of solutions, x and the distance from jamming, by hand."""
NUMBERS = {"none": JAMMED, "one": OK, "many": SEVERAL}


@mark.parametrize("F, C, number, x, far", CONES)
def test_one_cone_has_one_none_or_two_solutions(F, C, number, x, far):
    """On a line F = 1, C = c: x = k (1 + c x), x = k |1 - c x|.

    The distance from jamming is the slope 1 - k e.C of x - k |F + C x|, e along
    F + C x, at most 1.
    """
    F, C = (complex(*map(float, text.split())) for text in (F, C))
    sliding = solve_sliding(np.array([[F]]), np.array([[[C]]]), np.array([[1.0]]))
    assert sliding.status[0] == NUMBERS[number]
    assert sliding.x[0, 0] == approx(float(x), rel=1e-15, nan_ok=True)
    if number != "none":
        distance = approx(float(far), rel=LAST_DIGITS)
        assert find_least_stretch(sliding.slope)[0] == distance


@mark.parametrize(
    "c1, c2, number",
    [
        (0.5, 0.3, OK),
        (2.0, 0.3, JAMMED),
        (-2.0, 0.3, SEVERAL),
        (-2.0, -3.0, SEVERAL),
    ],
)
def test_two_pins_that_do_not_feel_each_other_are_two_single_ones(c1, c2, number):
    F = np.array([[1.0 + 0j, 2.0]] * 2)
    C = np.array([[[c1 + 0j, 0.0], [0.0, c2]]] * 2)
    sliding = solve_sliding(F, C, np.array([[1.0, 1.0], [0.25, 0.125]]))
    assert [*sliding.status] == [number, OK]
    slight = 0.25 / (1.0 - 0.25 * c1), 0.25 / (1.0 - 0.125 * c2)
    assert sliding.x[1] == approx(slight, rel=1e-12)
    if number != JAMMED:
        right = 1.0 / (1.0 - c1), 2.0 / (1.0 - c2)
        assert sliding.x[0] == approx(right, rel=1e-12)
        # both slopes are 1 - k c where F + C x keeps the sense of F
        far = min(1.0, 1.0 - c1, 1.0 - c2)
        assert find_least_stretch(sliding.slope)[0] == approx(far, rel=1e-12)


def test_jamming_is_a_status_and_leaves_no_force():
    s = solve(crank_rocker(effects=(PinFriction.at(A=(50.0, 0.01)),)))
    assert {"jammed", "several"} == set(s.status)
    jammed = [status == "jammed" for status in s.status]
    assert np.array_equal(np.isnan(s.torque), jammed)


def test_pin_load_friction_needs_the_pin_forces():
    motion = Motion(1.0, 0.0, free=Free(1.0, 10))
    friction = PinFriction.at(A=(0.1, 0.01))
    with raises(LimitError, match="pin forces: state effects"):
        solve(crank_rocker(motion, effects=(friction,)))


def test_a_table_is_linear_between_its_points_and_periodic():
    table = Table((1.0, 2.0, 1.0 + tau), (0.0, 4.0, 0.0))
    angles = np.array([1.0, 1.25, 2.0, 1.5 - tau, 1.25 + 3 * tau, 0.5])
    right = [0.0, 1.0, 4.0, 2.0, 1.0, 2.0 / (tau - 1.0)]
    assert table.at(angles) == approx(right, abs=1e-14)
    quarter = Table(("0 deg", "90 deg"), (0.0, 1.0))
    covered = "covers 0 to 90 deg; the position at 480 deg lies outside"
    with raises(InputError, match=f"{covered}: state .*, for equilibria a sweep"):
        quarter.at(np.radians([45.0, 480.0, 125.0]))


def test_breaks_change_their_sign_where_forces_jump_or_bend():
    """Corners of a table lie whole turns apart; the output turns back in line."""
    stated = Table((0.4, 1.0, 1.5), (1.0, 3.0, 2.0))
    load = Load(2, moment=1.0, table=stated)
    places = {f"theta_2 = {corner!r}": [corner] for corner in stated.theta_2}
    d, a, b, c = CRANK_ROCKER_LENGTHS
    places["O4"] = [
        find_angle(c, d, b + a),
        find_angle(c, d, b - a) + pi,
    ]
    friction = Friction.at(O4=0.1)
    scene = Scene(UNIFORM, loads=(load,), effects=(friction,))
    angles = np.linspace(0.0, 2.0 * tau, 1009)
    branch = np.ones(len(angles), dtype=np.int8)
    for speed in (3.0, -3.0):
        state = compute_shown_state(scene, Command(angles, branch, speed, 0.0))
        breaks = load.breaks(state) | friction.breaks(state)
        assert breaks.keys() == places.keys()
        for name, values in breaks.items():
            crossed = np.flatnonzero(values[1:] * values[:-1] < 0.0)
            right = np.add.outer(places[name], [0.0, tau]).ravel()
            assert [*crossed] == sorted(np.searchsorted(angles, right) - 1), name


HERE = Place(2, (0.1, 0.0)), Place(4, (0.2, 0.0))


def test_a_gas_spring_of_one_force_pushes_with_it_everywhere():
    assert Spring.gas(*HERE, 0.5, 0.3, 40.0) == Spring(*HERE, 0.0, 0.5, -40.0)


@mark.parametrize(
    "make, numbers, key",
    [
        (Spring, (*[Place(2, (0.1, 0.0))] * 2, 1.0), "effects.springs.to.bar"),
        (Spring.gas, (*HERE, 0.3, 0.3, 1.0), "effects.springs.gas.stroke"),
        (
            Spring.gas,
            (*HERE, 0.3, 0.1, 2.0, 1.0),
            "effects.springs.gas.compressed_force",
        ),
        (Spring.gas, (*HERE, 0.3, 0.1, -2.0), "effects.springs.gas.extended_force"),
        *(
            (getattr(fourbar, name), json.loads(numbers), key)
            for name, numbers, key in read_rows("""
Flywheel | [1, 3] | effects.flywheel.bar
Torsion | [[["A", 0, 1, 0]]] | effects.torsion.A.stiffness
PinFriction | [[["C", 0.1, 0.1]]] | effects.pin_friction.C
Viscous | [[["O2", 0.1], ["O2", 0.2]]] | effects.viscous.O2
PinFriction | [[["A", -0.1, 0.1]]] | effects.pin_friction.A.coefficient
Table | [[0, 1, 7], [1, 1, 1]] | loads.table.theta_2
Table | [[0, 1, 1], [1, 1, 2]] | loads.table.theta_2
""")
        ),
    ],
)
def test_bad_input_names_its_key(make, numbers, key):
    with raises(InputError) as error:
        make(*numbers)
    assert error.value.key == key
