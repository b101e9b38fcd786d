"""Small pictures of a scene: marks stand where something is judged."""

import re
from dataclasses import replace

import numpy as np

import fourbar
from fourbar.quantities import OK
from fourbar.scene import command
from fourbar_validation.compare.answer import Answer
from fourbar_validation.report.record import Record
from fourbar_validation.report.thumbnail import draw_thumbnail
from fourbar_validation.scenes.suites import MODELS


def count_marks(record):
    """Count the marks of a scene's picture."""
    return len(re.findall('class="mark"', draw_thumbnail(record) or ""))


def test_no_mark_stands_where_nothing_is_judged():
    """A kite begins at its change point, where its torque has a limit alone.

    An engine's number there is not judged; beside the curve it would look wrong.
    """
    scene = fourbar.load(MODELS / "capabilities" / "kite.toml")
    solution = fourbar.solve(scene, "force")
    judged = solution.status_code == OK
    assert np.flatnonzero(~judged).tolist() == [0, 18, 36]
    torque = np.where(judged, solution.torque, -1e3)
    answer = Answer("free-body", "exact", quantities={"torque": torque})
    record = Record("kite", scene, solution=solution, answers=[answer])
    of_the_kite = count_marks(record)

    plain = fourbar.load(MODELS / "crank_rocker.toml")
    whole = fourbar.solve(plain, "force")
    assert (whole.status_code == OK).all()
    answer = Answer(
        "free-body",
        "exact",
        command(plain),
        quantities={"torque": whole.torque},
    )
    everywhere = count_marks(Record("all", plain, solution=whole, answers=[answer]))
    assert of_the_kite == everywhere - 1


def test_marks_stand_at_the_positions_of_their_engine():
    """An engine that answers the first half of a turn has no mark beyond its middle."""
    plain = fourbar.load(MODELS / "crank_rocker.toml")
    whole = fourbar.solve(plain, "force")
    at = command(plain)
    half = at.part(slice(0, len(at.angle) // 2 + 1))
    torque = whole.torque[: len(half.angle)]
    answers = [
        Answer("free-body", "exact", at, quantities={"torque": whole.torque}),
        Answer("mujoco-simulated", "RK4", half, quantities={"torque": torque}),
    ]
    places = []
    for answer in answers:
        record = Record("half", plain, solution=whole, answers=[answer])
        drawn = draw_thumbnail(record) or ""
        marks = re.findall(r'mark" cx="([\d.]+)" cy="([\d.]+)"', drawn)
        places.append({(float(x), float(y)) for x, y in marks})
        assert ">torque on bar 2</text>" in drawn
    (whole_turn, half_turn) = places
    x = sorted(x for x, _ in whole_turn)
    middle = 0.5 * (x[0] + x[-1] + (x[1] - x[0]))
    assert max(x for x, _ in half_turn) <= middle < max(x)


def test_where_a_curve_is_cut_a_bar_says_so():
    plain = fourbar.load(MODELS / "crank_rocker.toml")
    whole = fourbar.solve(plain, "force")
    pole = whole.torque.copy()
    pole[100:102] *= 1e3
    bars = [
        len(re.findall('class="cut"', draw_thumbnail(record) or ""))
        for record in (
            Record("as it is", plain, solution=whole),
            Record("pole", plain, solution=replace(whole, torque=pole)),
        )
    ]
    assert bars == [0, 1]
