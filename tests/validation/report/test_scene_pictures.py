"""Pictures of a scene: marks stand where something is judged."""

import re
from dataclasses import replace

import numpy as np

from fourbar import load, solve
from fourbar.quantities import OK
from fourbar.scene import command
from fourbar_validation.compare.answer import Answer
from fourbar_validation.report.scene_pictures import draw_scene_figure
from fourbar_validation.report.scene_record import Record
from fourbar_validation.scenes.suites import MODELS

PLAIN = load(MODELS / "crank_rocker.toml")
WHOLE = solve(PLAIN, "force")


def list_marks(scene, solution, torque, *at):
    """Return the places of the marks of an engine's torque in a scene's picture."""
    answer = Answer(
        "free-body",
        "exact",
        *at,
        quantities={"torque": torque},
    )
    figure = draw_scene_figure(Record("scene"), scene, solution, [answer, answer])
    _, drawn, *_ = figure.split("</svg>")
    assert ">T₂ (N m)</text>" in drawn
    groups = re.findall(r"<g clip-path[^>]*>((?:<use [^>]*>)+)</g>", drawn)
    of_answers = "".join(groups[:2])  # before their errors
    places = re.findall(r'x="([\d.]+)" y="([\d.]+)"', of_answers)
    return [(float(x), float(y)) for x, y in places]


def test_no_mark_stands_where_nothing_is_judged():
    """A kite begins at its change point, where its torque has a limit alone.

    An engine's number there is not judged; beside the curve it would look wrong.
    """
    scene = load(MODELS / "capabilities" / "kite.toml")
    solution = solve(scene, "force")
    judged = solution.status_code == OK
    assert np.flatnonzero(~judged).tolist() == [0, 18, 36]
    torque = np.where(judged, solution.torque, -1e3)
    assert (WHOLE.status_code == OK).all()
    everywhere = list_marks(
        PLAIN,
        WHOLE,
        WHOLE.torque,
        command(PLAIN),
    )
    # the first mark of one answer and the last of the other
    assert len(list_marks(scene, solution, torque)) == len(everywhere) - 2


def test_marks_stand_at_the_positions_of_their_engine():
    """An engine of the second half of a turn has no mark before its middle."""
    at = command(PLAIN)
    whole_turn, half_turn = (
        sorted(list_marks(PLAIN, WHOLE, WHOLE.torque[part], at.part(part)))
        for part in (slice(None), slice(len(at.angle) // 2, None))
    )
    x = [x for x, _ in whole_turn]
    middle = 0.5 * (x[0] + x[-1])
    assert x[0] < middle <= half_turn[0][0]


def test_where_a_curve_is_cut_a_label_says_so():
    pole = WHOLE.torque.copy()
    pole[100:102] *= 1e3
    for torque, cuts in ((1e3 * WHOLE.torque, 0), (pole, 1)):
        solution = replace(WHOLE, torque=torque)
        figure = draw_scene_figure(Record("pole"), PLAIN, solution, [])
        assert figure.count("towards a pole") == cuts
