"""Rows of what `analyze` prints agree, and each number that is off fails its own."""

import math
import re
from dataclasses import is_dataclass, replace
from pathlib import Path

import numpy as np
import pytest

import fourbar
from fourbar.show import driving
from fourbar_validation.run.judge import make_question
from fourbar_validation.run.question import NotAskedError
from tests.oracle import summary as module
from tests.oracle.summary import summary
from tests.support.scenes import CYLINDER, crank_rocker


def turn(turns=1.0, steps=36, **changes):
    sweep = fourbar.Sweep(0.1, 0.1 + math.tau * turns, steps)
    return crank_rocker(motion=fourbar.Motion(sweep, 9.0), **changes)


TURN = turn()
PUSHED = crank_rocker(
    motion=fourbar.Motion(
        stroke=fourbar.Sweep(0.19, 0.31, 36), stroke_speed=0.2, side="left"
    ),
    drive=CYLINDER,
)


def judge(scene):
    """Return the names of the rows that fail; a check that breaks down is "all"."""
    question = make_question("scene", scene, ())
    rows = question.attempt(lambda: summary(question), "summary")
    return {row.quantity for row in rows if row.failed}


@pytest.mark.parametrize(
    ("scene", "last"), [(TURN, "frame_force"), (PUSHED, "bore")], ids=("turn", "pushed")
)
def test_the_summary_of_a_scene_agrees_with_free_bodies(scene, last):
    rows = summary(make_question("scene", scene, ()))
    assert not [row for row in rows if row.failed]
    names = {"ranges", "peaks", "integrals", "pins", "bending", last}
    assert {row.quantity for row in rows} == names


def put(whole, path, change):
    """Return a copy of nested records, mappings and tuples with one part changed."""
    if not path:
        return change(whole)
    first, *rest = path
    if isinstance(whole, dict):
        return {**whole, first: put(whole[first], tuple(rest), change)}
    if isinstance(first, int):
        part = put(whole[first], tuple(rest), change)
        return (*whole[:first], part, *whole[first + 1 :])
    part = put(getattr(whole, first), tuple(rest), change)
    if is_dataclass(whole):
        return replace(whole, **{first: part})
    return whole._replace(**{first: part})


def times(factor):
    return lambda number: number * factor


def plus(difference):
    return lambda number: number + difference


def become(value):
    return lambda _: value


SHORT, LOST = times(1.0 - 1e-6), become(math.nan)
A_PART_MORE = times(1.0 + 2e-3)
FACTS = {
    "angles 3 1 value": (plus(math.tau), "ranges"),
    "transmission value": (LOST, "ranges"),
    "peak value": (SHORT, "peaks"),
    "peak place": (plus(0.01), "peaks"),
    "motion panels curves torque poles": (become([0]), "peaks"),
    "bending 3 peak": (become(None), "peaks"),
    "pins": (lambda pins: {**pins, "A": pins["B"]}, "pins integrals"),
    "pins A rms": (times(1.001), "integrals"),
    "bending 3 x": (times(0.9), "bending"),
    "bending 3 peak value": (become(0.0), "bending"),
    "angles 4 0 value": (LOST, "all"),
}
"""Part of the facts, how it is spoilt, and the rows that fail."""
MOTOR = {
    "peak_torque": (A_PART_MORE, "peaks"),
    "peak_power": (A_PART_MORE, "peaks"),
    "peak_speed": (LOST, "peaks"),
    "rms_torque": (A_PART_MORE, "integrals"),
    "rms_power": (A_PART_MORE, "integrals"),
    "energy_out": (A_PART_MORE, "integrals"),
    "energy_swing": (A_PART_MORE, "integrals"),
    "mean_torque": (plus(1e-4), "integrals"),  # a turn without damping has none
    "pins B peak": (LOST, "pins"),
}
"""The same of the entry of the JSON."""


@pytest.fixture(scope="module")
def said():
    """What is said of the turn, by the function that says it."""
    question = make_question("scene", TURN, ())
    motor = module.write_motor(TURN, question.solution, {})
    return {"summarize": module.summarize_scene(question), "write_motor": motor}


@pytest.mark.slow
@pytest.mark.parametrize("path", [*FACTS, *MOTOR])
def test_what_is_off_or_missing_fails_its_row(path, said, monkeypatch):
    change, rows = (FACTS | MOTOR)[path]
    function = "summarize" if path in FACTS else "write_motor"
    steps = tuple(int(step) if step.isdigit() else step for step in path.split())
    spoilt = put(said[function], steps, change)
    monkeypatch.setattr(module, function, lambda *_: spoilt)
    assert judge(TURN) == {*rows.split()}


@pytest.mark.slow
@pytest.mark.parametrize("turns", [1, 24])
def test_what_grows_between_positions_is_believed(turns):
    """The drive's bar stands still between the positions, of which none is near."""
    sweep = fourbar.Sweep(0.12, 0.12 + math.tau * turns, 40 * turns)
    scene = crank_rocker(motion=fourbar.Motion(sweep, 9.0), drive_bar=4)
    question = make_question("scene", scene, ())
    assert module.summarize_scene(question).motion.panels.growing
    assert "peaks" not in judge(scene)


@pytest.mark.parametrize("part", [0.0, 0.479])
def test_a_bar_that_bends_more_elsewhere_fails(part, monkeypatch):
    """The largest moment that is said may be a true one, at another place."""
    free_piece = module.free_piece

    def bend_more(*of):
        piece = free_piece(*of)
        if piece.bar == 3 and piece.cut == part * TURN.linkage.coupler.length:
            piece.M += 1e3
        return piece

    monkeypatch.setattr(module, "free_piece", bend_more)
    assert judge(TURN) == {"bending"}


@pytest.mark.slow
@pytest.mark.parametrize(("turns", "factor"), [(1, 5), (3, 5), (0.75, 0.75)])
def test_an_open_motion_is_told_from_a_turn(turns, factor, monkeypatch):
    """The package's word for a closed motion follows from it."""
    scene = turn(turns, round(36 * turns))
    assert not judge(scene)
    count = driving.count_turns
    monkeypatch.setattr(driving, "count_turns", lambda *of: factor * count(*of))
    assert judge(scene) == {"integrals"}


def test_a_printed_bore_that_is_off_fails_its_row(monkeypatch):
    write = module.write_block

    def off(*of, **options):
        lines = write(*of, **options)
        return [re.sub(r"at least (\d)", r"at least 1\1", line) for line in lines]

    monkeypatch.setattr(module, "write_block", off)
    assert judge(PUSHED) == {"bore"}


BESIDE_A_POLE = {
    # a force drives the coupler, and has no lever at two places within steps
    "the same bending everywhere": fourbar.load(
        Path(__file__).parents[1]
        / "counterexamples/bar_without_drive_beside_a_pole.toml"
    ),
    # the force passes through O2 at 65 degrees, where the judge looks too: free bodies
    # divide rounding by a lever of 4e-17 of the crank
    "positions of the judge on a pole": crank_rocker(
        motion=fourbar.Motion(fourbar.Sweep(0.0, math.tau, 36), 9.0, 3.0),
        drive_bar=None,
        drive=fourbar.PointDrive(fourbar.Place(2, (0.05, 0.0)), math.radians(65.0)),
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", BESIDE_A_POLE)
def test_beside_a_pole_bending_agrees(name):
    rows = summary(make_question("scene", BESIDE_A_POLE[name], ()))
    assert [row.compared for row in rows if row.quantity == "bending"] == [True]
    assert not [row for row in rows if row.failed]


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        (
            {"motion": fourbar.Motion(theta_4=fourbar.Sweep(1.5, 3.5, 20), omega_4=2)},
            "no forces somewhere",
        ),
        ({"effects": (fourbar.Friction.at(A=0.1),)}, "jump"),
        ({"motion": fourbar.Motion(np.array([0.1, 0.2]), 1.0)}, "no sweep"),
    ],
)
def test_what_has_poles_or_jumps_is_not_asked(changes, why):
    with pytest.raises(NotAskedError, match=why):
        summary(make_question("scene", crank_rocker(**changes), ()))
