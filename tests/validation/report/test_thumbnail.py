"""Small pictures of a scene: marks stand where something is judged."""

import re

import numpy as np

import fourbar
from fourbar.quantities import OK
from fourbar.scene import command
from fourbar_validation.compare.answer import Answer
from fourbar_validation.report.record import Record
from fourbar_validation.report.thumbnail import draw_thumbnail
from fourbar_validation.scenes.suites import MODELS


def count_marks(record: Record) -> int:
    """Count the marks of a scene's picture."""
    return len(re.findall('class="mark"', draw_thumbnail(record) or ""))


def test_no_mark_stands_where_nothing_is_judged() -> None:
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
