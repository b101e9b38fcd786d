"""Studies: a member of many linkages is that linkage alone, to the last digit.

What no scene takes has a status.
"""

import tomllib
from importlib import import_module

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pytest import raises

import fourbar
from fourbar import (
    Bar,
    FourBar,
    InputError,
    Motion,
    Scene,
    Sweep,
    Tolerance,
    dump,
    solve,
    uniform,
)
from fourbar.effects import (
    Flywheel,
    Friction,
    Gravity,
    LinearDrive,
    Load,
    PinFriction,
    Place,
    Spring,
    Springs,
    Torsion,
    Viscous,
)
from fourbar.quantities import VECTORS
from fourbar.scene import command
from fourbar.scene.motion import Free, FromLimit, Law
from fourbar.scene.numbers import Point
from fourbar.studies.keys import list_entries, read_place, replace_place
from fourbar.studies.study import vary

M, ANGLES = 9, np.array([0.2, 0.9, 2.5, 3.9, 5.6])
LINK = FourBar(
    0.3,
    Bar(0.1, 0.2, 0.001, (0.04, 0.2)),
    Bar(0.25, 0.5),
    Bar(0.22, 0.4, None, (0.1, -0.3)),
    0.4,
)
LOADS = (
    Load(3, (10.0, 0.3), arm=(0.05, 0.2)),
    Load(4, None, moment=-0.15),
    Load(2, (3.0, 0.2), from_centre=(0.01, 0.1), moment=0.0, frame="bar"),
)
SPRINGS = Springs(
    (Spring(Place(1, (0.1, -1.5)), Place(4, (0.08, 0.1)), 200.0, 0.12, 3.0),)
)
DRIVEN = (
    *(Gravity(9.81, -1.5), Viscous.at(O2=0.01, A=0.02), Friction.at(B=0.05)),
    *(Torsion.at(B=(2.0, 0.5, 0.1)), SPRINGS, Flywheel(0.02, 2)),
)
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


@pytest.mark.parametrize(
    "effects, drive, stage",
    [
        (DRIVEN, 4, "error"),
        (RUBBING, 2, "force"),
        (DRIVEN, 3, None),
        ((), 2, "position"),
    ],
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
            array = getattr(solution, name)
            assert array.shape == (
                (M, len(ANGLES), 2) if name in VECTORS else (M, len(ANGLES))
            )
            if name.endswith("_error"):
                assert_allclose(
                    array[member], getattr(single, name), rtol=BARS, err_msg=name
                )
            else:
                assert_array_equal(array[member], getattr(single, name), err_msg=name)


def test_blocks_over_members_and_positions_change_no_digit(monkeypatch):
    case = scene(DRIVEN)
    study = vary(case, spread(case))
    at_once = solve(study)
    for size in (3, 12):  # positions of one member, and members
        monkeypatch.setattr(
            import_module("fourbar.solving"), "POSITIONS_OF_A_BLOCK", size
        )
        piece = solve(study)
        for name in at_once.evaluated():
            assert_array_equal(
                getattr(piece, name), getattr(at_once, name), err_msg=name
            )


def test_angles_of_its_own_for_each_member_and_arrays_to_write_into():
    theta_2 = np.array([[0.2, 0.4, 0.6], [1.2, 1.4, 1.6]])
    study = vary(scene(), {"motion.theta_2": theta_2, "lengths.input": [0.1, 0.12]})
    out = {"torque": np.zeros((2, 3)), "a_G3": np.zeros((2, 2, 3)).swapaxes(1, 2)}
    solution = solve(study, out=out)
    assert solution.torque is out["torque"] and solution.F12 is None
    for member, length in enumerate((0.1, 0.12)):
        values = {"lengths.input": [length] * 2}
        one = alone(study, values, 0)
        single = solve(Scene(one.linkage, Motion(theta_2[member], 3.0, 0.5), 2, LOADS))
        assert_array_equal(out["torque"][member], single.torque)
        assert_array_equal(out["a_G3"][member], single.a_G3)


def test_what_the_scene_leaves_out_follows_the_length():
    plain = Scene(uniform(0.3, 0.1, 0.25, 0.22), Motion(1.0, 5.0), effects=(Gravity(),))
    solution = solve(
        vary(plain, {"lengths.coupler": [0.25, 0.28], "bars.coupler.mass": 0.5})
    )
    longer = FourBar(0.3, Bar(0.1, 0.1), Bar(0.28, 0.5), Bar(0.22, 0.22))
    single = solve(Scene(longer, Motion(1.0, 5.0), effects=(Gravity(),)))
    assert solution.torque[1, 0] == pytest.approx(single.torque[0], rel=1e-14)


def test_a_bad_member_has_a_status_and_disturbs_no_other():
    plain = Scene(uniform(0.3, 0.1, 0.25, 0.22), Motion(Sweep(0.0, 6.0, 3), 5.0))
    lengths = [0.1, -0.1, 0.0, np.nan, 3.0, 0.1]
    solution = solve(
        vary(
            plain,
            {
                "lengths.input": lengths,
                "bars.coupler.mass": [1.0, 1.0, 1.0, 1.0, 1.0, -1.0],
            },
        )
    )
    assert [row[0] for row in solution.status] == [
        "ok",
        "invalid",
        "invalid",
        "invalid",
        "not_assembled",
        "invalid",
    ]
    for name in solution.evaluated():
        if name != "theta_2":
            assert np.isnan(getattr(solution, name)[[1, 2, 3, 5]]).all(), name
    assert_array_equal(
        solution.torque[0], solve(vary(plain, {"bars.coupler.mass": 1.0})).torque[0]
    )


def test_a_law_and_a_path_through_change_points():
    law = Law((0.0, 0.5, 1.0), (0.0, 2.0, 6.0), 6, "rest")
    values = {"lengths.input": np.array([0.1, 0.11])}
    study = vary(Scene(LINK, Motion(law=law)), values)
    solution = solve(study)
    assert_array_equal(solution.torque[1], solve(alone(study, values, 1)).torque)
    kite = Scene(uniform(0.3, 0.1, 0.3, 0.1), Motion(Sweep(2.0, 8.0, 8), 1.0))
    for values in (
        {"lengths.input": np.array([0.1, 0.09])},
        {"bars.coupler.mass": np.array([1.0, 2.0])},
    ):
        study = vary(kite, values)
        solution = solve(study)
        assert -1 in solution.branch[0]
        for member in (0, 1):
            single = solve(alone(study, values, member))
            assert_array_equal(solution.branch[member], single.branch)
            assert_array_equal(solution.theta_4[member], single.theta_4)


REFUSED = {
    "a slip of the pen": ({"lengths.inptu": [1.0]}, 'did you mean "lengths.input"?'),
    "an effect that does not act": ({"effects.viscous.O2": [1.0]}, "unknown key"),
    "a pair": (
        {"bars.coupler.centre": [0.1]},
        "vary bars.coupler.centre.0, bars.coupler.centre.1",
    ),
    "a bar's number": ({"drive.bar": [2, 3]}, "is the same for every member"),
    "the branch": ({"motion.branch": [1, -1]}, "is the same for every member"),
    "two lengths": (
        {"lengths.input": [0.1, 0.2], "lengths.output": [0.2, 0.2, 0.2]},
        "lengths.input has 2",
    ),
    "two lengths, of angles": (
        {"lengths.input": [0.1, 0.2], "motion.theta_2": np.ones((3, 2))},
        "has 2",
    ),
    "words": ({"lengths.input": ["ten"]}, "there is no finite number"),
    "no unit": ({"lengths.input": ["10"]}, "the unit is missing"),
    "truths": ({"lengths.input": [True]}, "must be an array of numbers"),
    "rows of different lengths": (
        {"lengths.input": [[0.1], [0.1, 0.2]]},
        "must be an array of numbers",
    ),
    "nothing": ({"lengths.input": []}, "at least one"),
    "a table": ({"lengths.input": np.ones((2, 2))}, "must have the shape (m,)"),
}


def test_a_key_has_the_unit_that_a_scene_file_has():
    drive = LinearDrive(Place(1, (0.1, -1.5)), Place(3, (0.08, 0.1)))
    linkage = FourBar(
        0.3, *(Bar(size, 0.2, 0.001, (0.04, 0.2)) for size in (0.1, 0.25, 0.22)), 0.4
    )
    acting = (*DRIVEN, PinFriction.at(A=(0.1, 0.01)))
    points = (Point("P", 3, (0.1, 0.2)),)
    scene = Scene(
        linkage,
        Motion(ANGLES, 2.0, alpha_2=0.5),
        loads=LOADS,
        effects=acting,
        points=points,
        drive=drive,
    )
    written = tomllib.loads(dump(scene))
    for key, number in list_entries(scene).items():
        entry = written
        for name in key.split("."):
            entry = entry[int(name) if isinstance(entry, list) else name]
        assert (
            entry.partition(" ")[2] if isinstance(entry, str) else "1"
        ) == number.unit, key


def test_texts_with_units_are_the_numbers():
    scene = Scene(LINK, Motion(ANGLES, 2.0), effects=DRIVEN)
    texts = {
        "lengths.input": ["10 cm", "4 in", 0.1],
        "bars.coupler.centre.1": "180 deg",
        "effects.torsion.B.rest": 0.5,
    }
    si = texts | {"lengths.input": [0.1, 0.1016, 0.1], "bars.coupler.centre.1": np.pi}
    theta = {"motion.theta_2": [["10 deg", "0.5 rev"], [0.1, 0.2], ["1 rad", 0]]}
    from_texts, from_si = vary(scene, texts | theta), vary(scene, si)
    assert all((from_texts.values[key] == from_si.values[key]).all() for key in si)
    assert (
        from_texts.at.angle == [[np.radians(10.0), np.pi], [0.1, 0.2], [1.0, 0.0]]
    ).all()
    assert Tolerance("lengths.input", "0.1 mm") == Tolerance("lengths.input", 1e-4)
    for key, text, words in (
        ("lengths.input", "1 deg", 'lengths.input = .*"deg" does not convert to m'),
        ("effects.viscous.O2", "1 N m", "does not convert to N m s/rad"),
        ("lengths.x", "1 mm", "unknown key"),
    ):
        with raises(InputError, match=words):
            Tolerance(key, text)
        with raises(InputError, match=words):
            vary(scene, {key: [text]})


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_vary_is_refused_in_one_line(name):
    values, words = REFUSED[name]
    with raises(InputError) as caught:
        vary(scene(), values)
    assert words in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "motion, words",
    [
        (Motion(None, 1.0), "a study states it"),
        (Motion(FromLimit(1, 0.1), 1.0), "a study states it"),
        (Motion(1.0, free=Free(1.0, 10)), "is integrated for one linkage"),
    ],
)
def test_a_motion_of_one_linkage_is_refused_in_one_line(motion, words):
    with raises(InputError, match=words):
        vary(Scene(LINK, motion), {"bars.coupler.mass": [1.0, 2.0]})


def test_a_study_is_given_no_other_positions():
    study = vary(scene(), {"bars.coupler.mass": [1.0, 2.0]})
    with raises(InputError, match="states its own positions"):
        solve(study, at=command(scene()))


def test_springs_of_members_count_their_turns_from_where_each_assembles():
    """The sweep begins where the members do not assemble; each is what it is alone."""
    linkage = uniform(0.2, 0.25, 0.21, 0.22)
    low, high = fourbar.formulas.mobility.choose_range(linkage)
    sweep = Sweep(low - 0.5, high + 0.2, 40)
    for effect in (
        Torsion.at(O2=(2.0, low - 2.5, 0.1)),
        Torsion.at(B=(2.0, 3.0, 0.1), O2=(1.0, high + 2.5, 0.0)),
    ):
        scene = Scene(linkage, Motion(sweep, 1.0), effects=(effect,))
        together = solve(vary(scene, {"bars.coupler.mass": [0.1, 0.1]}))
        alone = solve(scene)
        assert not alone.assembled[0] and alone.assembled.any()
        assert {"ok", "wound"} <= set(alone.status)
        assert together.status == [alone.status, alone.status]
