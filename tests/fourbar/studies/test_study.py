"""Studies: a member of many linkages is that linkage alone, to the last digit.

What no scene takes has a status.
"""

import json
from dataclasses import replace
from math import pi

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
from pytest import mark

from fourbar import (
    Bar,
    FourBar,
    Free,
    FromLimit,
    Gravity,
    Motion,
    PinFriction,
    Scene,
    Sweep,
    Tolerance,
    Torsion,
    command,
    solve,
    vary,
)
from fourbar.files import loads
from fourbar.studies.keys import list_entries, read_place, replace_place
from tests.support.rows import read_rows, refused
from tests.support.scenes import UNIFORM

M, ANGLES = 9, np.array([0.2, 0.9, 2.5, 3.9, 5.6])
ACTED_ON = loads("""
[lengths]
ground = "0.3 m"
input = "0.1 m"
coupler = "0.25 m"
output = "0.22 m"
ground_angle = "0.4 rad"
[bars.input]
mass = "0.2 kg"
inertia = "0.001 kg m^2"
centre = ["0.04 m", "0.2 rad"]
[bars.coupler]
mass = "0.5 kg"
[bars.output]
mass = "0.4 kg"
centre = ["0.1 m", "-0.3 rad"]
[motion]
[[loads]]
bar = 3
force = ["10 N", "0.3 rad"]
arm = ["0.05 m", "0.2 rad"]
[[loads]]
bar = 4
moment = "-0.15 N m"
[[loads]]
bar = 2
force = ["3 N", "0.2 rad"]
from_centre = ["0.01 m", "0.1 rad"]
frame = "bar"
[effects]
gravity = ["9.81 m/s^2", "-1.5 rad"]
viscous = { O2 = "0.01 N m s/rad", A = "0.02 N m s/rad" }
friction = { B = "0.05 N m" }
torsion = { B = { stiffness = "2 N m/rad", rest = "0.5 rad", preload = "0.1 N m" } }
flywheel = { bar = 2, inertia = "0.02 kg m^2" }
[[effects.springs]]
from = { bar = 1, from_pin = ["0.1 m", "-1.5 rad"] }
to = { bar = 4, from_pin = ["0.08 m", "0.1 rad"] }
stiffness = "200 N/m"
length = "0.12 m"
preload = "3 N"
""")
LINK, LOADS, DRIVEN = ACTED_ON.linkage, ACTED_ON.loads, ACTED_ON.effects

RUBBING = (Gravity(), PinFriction.at(A=(0.1, 0.008), O4=(0.2, 0.01)))


BARS = 0.05
"""Of an error bar: longer numbers lose digits too, a thousandth of what doubles lose,
otherwise in arrays.
"""


def scene(effects=(), drive=2, **motion):
    return Scene(
        LINK,
        Motion(**({"theta_2": ANGLES, "omega_2": 3.0, "alpha_2": 0.5} | motion)),
        drive,
        LOADS,
        effects,
    )


def spread(case):
    """Values about each number that the scene has."""
    random = np.random.default_rng(3)
    return {
        key: read_place(case, entry.place) * random.uniform(0.9, 1.1, M)
        for key, entry in list_entries(case).items()
    }


def alone(study, values, member):
    """The scene of one member, its numbers floats."""
    one, entries = study.scene, list_entries(study.scene)
    for key in entries:
        if key in values:
            one = replace_place(one, entries[key].place, float(values[key][member]))
    return one


@mark.parametrize(
    "effects, drive, stage",
    [(DRIVEN, 4, "error"), (RUBBING, 2, "force"), ((), 2, "position")],
)
def test_a_member_is_its_linkage_alone(effects, drive, stage):
    case = scene(effects, drive)
    values = spread(case)
    study = vary(case, values)
    solution = solve(study, stage)
    for member in range(M):
        single = solve(alone(study, values, member), stage)
        assert single.evaluated() == solution.evaluated()
        assert solution.status[member] == single.status
        for name in single.evaluated():
            array, expected = solution[name], single[name]
            assert array.shape == (M, *expected.shape)
            if name.endswith("_error"):
                assert_allclose(array[member], expected, rtol=BARS, err_msg=name)
            else:
                assert_array_equal(array[member], expected, err_msg=name)


@mark.parametrize("size", (3, 12))
def test_blocks_over_members_and_positions_change_no_digit(size, monkeypatch):
    """A block holds positions of one member, or several members."""
    case = scene(DRIVEN)
    study = vary(case, spread(case))
    at_once = solve(study)
    monkeypatch.setattr("fourbar.solving.POSITIONS_OF_A_BLOCK", size)
    piece = solve(study)
    for name in at_once.evaluated():
        assert_array_equal(piece[name], at_once[name], err_msg=name)


def test_angles_of_its_own_for_each_member_and_arrays_to_write_into():
    theta_2 = np.array([[0.2, 0.4, 0.6], [1.2, 1.4, 1.6]])
    study = vary(scene(), {"motion.theta_2": theta_2, "lengths.input": [0.1, 0.12]})
    out = {"torque": np.zeros((2, 3)), "a_G3": np.zeros((2, 2, 3)).swapaxes(1, 2)}
    solution = solve(study, out=out)
    assert solution.scene is None
    assert solution.torque is out["torque"] and solution.F12 is None
    for member, length in enumerate((0.1, 0.12)):
        one = alone(study, {"lengths.input": [length] * 2}, 0)
        single = solve(Scene(one.linkage, Motion(theta_2[member], 3.0, 0.5), 2, LOADS))
        assert_array_equal(out["torque"][member], single.torque)
        assert_array_equal(out["a_G3"][member], single.a_G3)


def test_listed_angles_keep_their_rates_in_every_member():
    listed = replace(scene(), motion=Motion([1.0, 2.0], [1.0, 3.0]))
    study = solve(vary(listed, {"lengths.input": [0.1, 0.12]}), "velocity")
    assert study.omega_2.tolist() == [[1.0, 3.0], [1.0, 3.0]]


def test_a_bad_member_has_a_status_and_disturbs_no_other():
    plain = Scene(UNIFORM, Motion(Sweep(0.0, 6.0, 3), 5.0))
    values = {
        "lengths.input": [0.1, -0.1, 0.0, np.nan, 3.0, 0.1],
        "bars.coupler.mass": [1.0, 1.0, 1.0, 1.0, 1.0, -1.0],
    }
    solution = solve(vary(plain, values))
    invalid = ["invalid"] * 3
    said = ["ok", *invalid, "not_assembled", "invalid"]
    assert [row[0] for row in solution.status] == said
    for name in solution.evaluated():
        if name != "theta_2":
            assert np.isnan(solution[name][[1, 2, 3, 5]]).all(), name
    single = solve(vary(plain, {"bars.coupler.mass": 1.0}))
    assert_array_equal(solution.torque[0], single.torque[0])


REFUSED = read_rows("""
{"lengths.inptu": [1.0]} | must be among lengths.input, lengths.
{"effects.viscous.O2": [1.0]} | is no number of this scene
{"bars.coupler.centre": [0.1]} | must be among bars.coupler.centre.0, bars.
{"drive.bar": [2, 3]} | is no number of this scene
{"lengths.input": [0.1, 0.2], "lengths.output": [0.2, 0.2, 0.2]} | lengths.input has 2
{"lengths.input": [0.1, 0.2], "motion.theta_2": [[1, 1], [1, 1], [1, 1]]} | has 2
{"lengths.input": ["ten"]} | there is no finite number
{"lengths.input": ["10"]} | the unit is missing
{"lengths.input": [true]} | must be an array of numbers
{"lengths.input": [[0.1], [0.1, 0.2]]} | must be an array of numbers
{"lengths.input": []} | at least one
{"lengths.input": [[1, 1], [1, 1]]} | must have the shape (m,)
""")
"""Values of the members, and words of their refusal."""
OTHER_MOTIONS = [
    (Motion(None, 1.0), "a study states it"),
    (Motion(FromLimit(1, 0.1), 1.0), "a study states it"),
    (Motion(1.0, free=Free(1.0, 10)), "is integrated for one linkage"),
]
MASSES = {"bars.coupler.mass": [1.0, 2.0]}


@mark.parametrize(
    "motion, values, words",
    [
        *((Motion(ANGLES, 3.0), json.loads(values), said) for values, said in REFUSED),
        *((motion, MASSES, said) for motion, said in OTHER_MOTIONS),
    ],
)
def test_what_cannot_vary_is_refused_in_one_line(motion, values, words):
    with refused(words):
        vary(replace(scene(), motion=motion), values)


def test_texts_with_units_are_the_numbers():
    case = scene(DRIVEN)
    texts = {
        "lengths.input": ["10 cm", "4 in", 0.1],
        "bars.coupler.centre.1": "180 deg",
        "effects.torsion.B.rest": 0.5,
    }
    si = texts | {"lengths.input": [0.1, 0.1016, 0.1], "bars.coupler.centre.1": pi}
    theta = {"motion.theta_2": [["10 deg", "0.5 rev"], [0.1, 0.2], ["1 rad", 0]]}
    from_texts, from_si = vary(case, texts | theta), vary(case, si)
    assert all((from_texts.values[key] == from_si.values[key]).all() for key in si)
    angles = [[np.radians(10.0), pi], [0.1, 0.2], [1.0, 0.0]]
    assert (from_texts.at.angle == angles).all()
    assert Tolerance("lengths.input", "0.1 mm") == Tolerance("lengths.input", 1e-4)
    for key, text, words in read_rows("""
lengths.input | 1 deg | "deg" does not convert to m
effects.viscous.O2 | 1 N m | does not convert to N m s/rad
"""):
        with refused(key, words):
            Tolerance(key, text)
        with refused(key, words):
            vary(case, {key: [text]})
    with refused("lengths.x = '1 mm': unknown key"):
        Tolerance("lengths.x", "1 mm")
    with refused("lengths.x = ['1 mm']: is no number of this scene"):
        vary(case, {"lengths.x": ["1 mm"]})


def test_a_study_is_given_no_other_positions():
    study = vary(scene(), {"bars.coupler.mass": [1.0, 2.0]})
    with refused("states its own positions"):
        solve(study, at=command(scene()))


def test_a_torsion_spring_is_followed_from_where_each_member_begins():
    """Each member is that linkage alone: two of them assemble later in the sweep."""
    spring = Torsion.at(A=(10.0, 1.5, 0.0), B=(10.0, -1.5, 0.0))
    motion = Motion(Sweep(0.0, np.radians(359.0), 80), 1.0, branch=-1)
    linkage = FourBar(6.0, Bar(4.0, 1.0), Bar(5.0, 1.0), Bar(3.0, 1.0), pi)
    scene = Scene(linkage, motion, effects=(spring,))
    coupler = [5.0, 2.2, 7.7]
    study = solve(vary(scene, {"lengths.coupler": coupler}))
    for row, length in enumerate(coupler):
        alone = replace(scene, linkage=replace(linkage, coupler=Bar(length, 1.0)))
        assert study.status[row] == solve(alone).status
        assert "wound" in study.status[row]
    assert [status[0] == "ok" for status in study.status] == [False, False, True]


def test_a_position_that_is_listed_twice_keeps_both_rates_in_every_member():
    scene = Scene(UNIFORM, Motion([0.1, 0.5, 0.1], [1.0, 2.0, -1.0], [3.0, 4.0, 5.0]))
    members = solve(vary(scene, {"lengths.input": [0.1, 0.1]}))
    for name in ("omega_4", "alpha_4", "torque"):
        assert (getattr(members, name) == getattr(solve(scene), name)).all()
