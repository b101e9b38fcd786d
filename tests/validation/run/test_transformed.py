"""Scenes stated otherwise have the same numbers, and one that has not fails its row."""

from itertools import product
from math import pi

import numpy as np
from pytest import mark

import fourbar
from fourbar import (
    Bar,
    Flywheel,
    Friction,
    Gravity,
    InputError,
    Load,
    Motion,
    PinFriction,
    PointDrive,
    Scene,
    Spring,
    Springs,
    Sweep,
    Torsion,
    Viscous,
)
from fourbar.effects import Place
from fourbar_validation.run import transformed
from fourbar_validation.run.judge import make_question
from fourbar_validation.run.transformed import TRANSFORMATIONS, check_transformed
from fourbar_validation.scenes.random import DrawnType, draw_random_scene
from tests.support.rows import read_rows
from tests.support.scenes import ON_COUPLER, WEIGHT, cis, crank_rocker

EVERYTHING = (
    Gravity(9.81, -1.2),
    Viscous.at(A=0.02, O4=0.03),
    Springs((Spring(Place(1, (0.1, -1.0)), Place(3, (0.2, 0.4)), 90.0, 0.1, 2.0),)),
    Torsion.at(A=(0.4, 0.3, 0.2), O4=(0.3, 1.0, -0.1), B=(0.2, 0.8, 0.0)),
    Flywheel(0.02, 4),
)
LOADS = (
    Load(4, (3.0, 0.7), from_centre=(0.05, 1.0)),
    Load(
        3,
        (2.0, -1.4),
        from_pin=(0.1, 0.3),
        frame="bar",
        moment=-0.2,
    ),
    Load(2, (1.0, 2.0), from_pin=(0.04, -0.6)),
)
SCENES = {
    "everything": crank_rocker(loads=LOADS, effects=EVERYTHING),
    "arm": crank_rocker(),
    "friction": crank_rocker(
        loads=LOADS,
        effects=(Friction.at(A=0.1), PinFriction.at(B=(0.1, 0.01))),
    ),
    "drive on the coupler": crank_rocker(loads=LOADS, drive_bar=3),
    "drive on the output": crank_rocker(loads=LOADS, drive_bar=4),
    "cylinder": crank_rocker(loads=LOADS, drive=ON_COUPLER),
    "point": crank_rocker(
        loads=LOADS, drive=PointDrive(Place(3, (0.1, 0.2)), 1.1, "bar")
    ),
    "bar 4 commanded": crank_rocker(
        Motion(theta_4=Sweep(2.3, 2.8, 12), omega_4=2.0),
        loads=LOADS,
    ),
    "bar 3 commanded": crank_rocker(
        Motion(theta_3=Sweep(0.4, 0.7, 12), omega_3=-2.0, branch=-1),
        loads=LOADS,
    ),
}


def ask(scene):
    """Return the question of a scene, and its rows stated otherwise by quantity."""
    question = make_question("scene", scene, ())
    return question, {row.quantity: row for row in check_transformed(question)}


def list_held(scene):
    """Return the quantities whose rows are made and do not fail."""
    _, rows = ask(scene)
    assert not [row for row in rows.values() if row.failed]
    return rows.keys()


@mark.parametrize("name", SCENES)
def test_a_scene_has_the_same_numbers_however_it_is_stated(name):
    left_out = {
        "friction": {"superposed", "split masses"},
        "arm": {"split masses"},
    }
    assert list_held(SCENES[name]) == TRANSFORMATIONS.keys() - left_out.get(name, set())
    _, rows = ask(SCENES[name])
    assert rows["scaled"].error == rows["scaled"].allowed == 0.0


@mark.parametrize(
    "scene, lines",
    [
        (
            SCENES["arm"],
            ["split masses: a load at an arm from the mass centre moves with it"],
        ),
        (
            SCENES["friction"],
            [
                f"{name}: forces with dry friction are no sum of what each adds"
                for name in ("superposed", "split masses")
            ],
        ),
        (
            crank_rocker(Motion(np.array([0.1, 0.2]))),
            ["scenes stated otherwise: the scene states positions only"],
        ),
    ],
    ids=("arm", "friction", "positions"),
)
def test_what_cannot_be_stated_otherwise_is_said_with_its_reason(scene, lines):
    assert ask(scene)[0].left_out == lines


def make_linkage(d, *lengths):
    bars = [Bar(length, 0.8, centre=(0.3 * length, 0.2)) for length in lengths]
    return fourbar.FourBar(d, *bars, ground_angle=0.4)


@mark.parametrize("command", [2, 3, 4])
@mark.parametrize(
    "name, lengths",
    read_rows("""
parallelogram | 0.3 0.1 0.3 0.1
kite, a = b | 0.1 0.1 0.3 0.3
kite, a = d | 0.2 0.2 0.35 0.35
rhombus | 0.2 0.2 0.2 0.2
crank-rocker | 0.3 0.1 0.25 0.15
"""),
)
def test_an_assembly_through_change_points_is_the_same_however_it_is_stated(
    name, lengths, command
):
    """Lengths of ground, input, coupler and output, whose bars come in line."""
    judged = 0
    # a sweep of each quarter, in the turn of the ground's angle and in two others
    quarters = np.arange(0.2, 2.0 * pi, 0.5 * pi)
    turns = np.array((0.0, 0.0, 6.28, -12.56))
    for start, branch in product(quarters + turns, (1, -1)):
        angles = Sweep(start, start + 1.5, 5)
        stated = {f"theta_{command}": angles, f"omega_{command}": 1.3}
        motion = Motion(**stated, branch=branch)
        scene = Scene(
            make_linkage(*map(float, lengths.split())), motion, effects=WEIGHT
        )
        try:
            held = list_held(scene)
        except InputError as error:
            assert "stands still" in str(error)  # as bar 3 of a kite does
            continue
        if held:  # none of the positions may be well-conditioned
            assert {"mirrored", "exchanged"} <= held
            judged += 1
    assert judged >= 4


IN_LINE = ((0.1, 0.25, 0.22), (0.17, 0.3, 0.22))
"""Lengths of input, coupler and output."""


@mark.slow
@mark.parametrize("gap", (0, 1, 2, 3, 5, 8, 13, 21, 31, 33, 64, 1000))
@mark.parametrize("command", (2, 3, 4))
def test_lengths_that_miss_a_change_point_by_roundings_are_the_same(command, gap):
    """Rounding decides in each statement whether there is a change point.

    The ground is as long as two of the bars less the third, but for the gap.
    """
    judged = 0
    for lengths, less, sign in product(IN_LINE, range(3), product((-1, 1), (-1, 1))):
        sense, branch = sign
        ground = sum(lengths) - 2.0 * lengths[less]
        missed = sense * gap * np.spacing(max(ground, *lengths))
        stated = {f"theta_{command}": Sweep(0.9, 5.9, 7)}
        stated |= {f"omega_{command}": 1.3, "branch": branch}
        linkage = make_linkage(ground + missed, *lengths)
        judged += len(list_held(Scene(linkage, Motion(**stated))))
    assert judged >= 20


def test_springs_that_are_wound_through_a_change_point_by_rounding_are_not_judged():
    motion = Motion(Sweep(0.9, 5.9, 7), 1.3)
    springs = Torsion.at(A=(0.4, 0.3, 0.2))
    for d, many in ((0.3 + 4 * np.spacing(0.3), 1), (0.31, 0)):
        linkage = make_linkage(
            d,
            0.1,
            0.25,
            0.15,
        )
        question, rows = ask(Scene(linkage, motion, effects=(springs,)))
        assert bool(rows) == (many == 0)
        assert sum("wound" in line for line in question.left_out) == many


@mark.parametrize("index", range(6))
def test_random_scenes_have_the_same_numbers(index):
    assert list_held(draw_random_scene(3, index, tuple(DrawnType)))


@mark.parametrize("name", TRANSFORMATIONS)
def test_one_number_that_differs_fails_its_row(name, monkeypatch):
    solve = transformed.solve
    calls = []

    def differ(scene, *stage, **at):
        """Change a torque in the last digits from the second call on."""
        solution = solve(scene, *stage, **at)
        calls.append(scene)
        if len(calls) > 1:
            solution.torque[1] *= 1.0 + 1e-11
        return solution

    scene = crank_rocker(loads=LOADS, effects=EVERYTHING)
    monkeypatch.setattr(transformed, "TRANSFORMATIONS", {name: TRANSFORMATIONS[name]})
    monkeypatch.setattr(transformed, "solve", differ)
    (row,) = ask(scene)[1].values()
    assert row.failed and row.reason.endswith("worst in torque")


def test_a_field_that_forgets_the_ground_fails_where_it_is_turned(monkeypatch):
    """As a fault would: gravity from the ground's line in place of the world's."""
    field = Gravity.field.fget
    held = crank_rocker().linkage.ground_angle

    def turn(load):
        return field(load) * cis(load.angle + 0.5 * pi - held)

    monkeypatch.setattr(Gravity, "field", property(turn))
    _, rows = ask(crank_rocker())
    assert rows["turned"].failed and rows["mirrored"].failed


def test_every_effect_of_the_package_can_be_stated_otherwise():
    """Without a conversion, scenes with the effect would silently lose the check."""
    stated = {type(effect) for scene in SCENES.values() for effect in scene.effects}
    assert stated >= {*fourbar.effects.list_kinds().values()}
