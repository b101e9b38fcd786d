"""The report on a robot's loops: printed, as a page, and every state as CSV."""

import csv
import io
import math
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import pytest

from fourbar.linkage import uniform
from fourbar.scene import Scene
from fourbar.scene.motion import Motion
from fourbar_validation.compare.results_file import read_columns
from fourbar_validation.compare.rows import UNDECIDED
from fourbar_validation.engines.mujoco.robots.loop_facts import (
    SettingsAdvice,
    TriedSettings,
    WorstState,
)
from fourbar_validation.robots.loop_errors import list_errors_by_method, write_percent
from fourbar_validation.robots.report import (
    STATES_FILE,
    TextTable,
    Typed,
    _describe_limit,
    describe_advice,
    describe_measurement,
    list_measured_rows,
    show_block,
    write_markdown,
    write_report,
    write_states,
)
from tests.support.robots import FINGER, measure_all
from tests.support.rows import read_rows
from tests.support.scenes import bare, find_angle

SCENE = Scene(bare(0.3, 0.1, 0.3, 0.1), Motion(1.0, 1.0))
"""A parallelogram, in line at 0 and 180 deg."""


@cache
def measured():
    return measure_all(FINGER, loop="pip_link-middle", torque=0.05)


@pytest.mark.slow
def test_the_states_are_those_that_were_asked_at():
    rows = list(csv.DictReader(io.StringIO(write_states(measured().loops))))
    (loop,) = measured().loops
    assert len(rows) == len(loop.states.rows) + len(loop.through_time.rows)
    assert tuple(rows[0]) == STATES_FILE
    first, row = rows[0], loop.states.rows[0]
    assert float(first["drive [N m or N]"]) == row.soft.torque
    assert float(first["gap [mm]"]) == 1e3 * row.gap
    size = sum(part**2 for part in row.rigid["F43"]) ** 0.5
    assert float(first["F43 of rigid pins [N]"]) == pytest.approx(size, rel=1e-15)


@pytest.mark.parametrize(
    "part, written",
    read_rows("""
0.0 | 0 %
5e-08 | < 0.00001 %
5e-07 | 0.0000500 %
0.0999951 | 10.0 %
1.01 | 101 %
12345.6 | 1230000 %
inf | inf %
"""),
)
def test_percentages_have_one_notation(part, written):
    assert write_percent(float(part)) == written


def test_settings_of_too_many_steps_have_neither_an_error_nor_a_cost():
    missing = WorstState(math.inf)
    tried = TriedSettings({}, WorstState(0.1), missing, *[math.inf] * 3)
    advice = SettingsAdvice(0.2, 9, tried, (), tried, 1, (), None)
    *_, table = describe_advice(SimpleNamespace(refusal="too many"), advice)
    assert table.rows == [("nothing", "0.1", "-", "-")]


def test_what_has_no_answer_is_no_number_of_a_sentence():
    """Of the file as it is MuJoCo loses the motion."""
    missing, found = WorstState(math.inf), WorstState(0.1, "F12", 0.5, 0.5)
    before = TriedSettings({}, found, missing, math.inf, 1e-5, 1e-2)
    changes = {"timestep": "0.0001"}
    best = TriedSettings(changes, found, found, 1e-4, 2e-5, 2e-2)
    advice = SettingsAdvice(0.2, 9, before, (), best, 1, (), None)
    (loop,) = measured().loops
    *_, reached, _, _ = describe_advice(loop, advice)
    assert reached == "error none -> 0.1, gap none -> 0.1 mm, 10 -> 20 us a step"


def test_a_page_holds_sentences_tables_and_elements():
    blocks = [
        "one *sentence*",
        TextTable(("a", "b"), [("1|2", "3")]),
        Typed("<connect/>"),
    ]
    page = write_markdown("robot.xml", blocks)
    assert page.startswith("# robot.xml\n")
    assert "one \\*sentence\\*" in page
    assert "| a | b |\n| --- | --- |\n| 1\\|2 | 3 |" in page
    assert "```xml\n<connect/>\n```" in page


def test_an_element_to_paste_is_folded_between_attributes(capsys):
    text = f'<connect name="{"a" * 30}" solref="0.004 1" solimp="0.9 0.9 0.1 0.5 2" />'
    show_block(Typed(text))
    first, second = capsys.readouterr().out.splitlines()
    assert f"{first} {second.strip()}" == text
    assert second.startswith('    solimp="0.9 0.9 0.1 0.5 2"')


@pytest.mark.slow
def test_the_report_is_printed_and_written(tmp_path, capsys):
    blocks = list(describe_measurement(measured()))
    rows = list_measured_rows(measured())
    out = tmp_path / "new"
    write_report(Path("finger.xml"), out, blocks, rows, measured().loops)
    printed = capsys.readouterr().out
    assert "single states" in printed and "written to" in printed
    page = (out / "robot.md").read_text()
    assert page.startswith("# The loops of finger.xml in MuJoCo")
    assert "| single states | torque |" in page
    assert (out / "states.csv").read_text() == write_states(measured().loops)
    written = list(read_columns(out / "results.csv"))
    torque = next(row for row in written if row.quantity == "torque")
    errors = list_errors_by_method(measured().loops[0])
    assert {row.engine for row in written} == {error.method for error in errors}
    assert torque.verdict == UNDECIDED
    assert torque.error in [error.part for error in errors]


def describe(scene, joint):
    return _describe_limit(SimpleNamespace(scene=scene), joint)


def test_a_limit_of_the_bar_that_is_driven_is_told():
    """Driven by its output, whose limits are those of 2 and 3 in line, near 3 + 10."""
    lengths = uniform(9.0, 3.0, 10.0, 8.0)
    limit = math.pi - find_angle(13.0, 9.0, 8.0)
    scene = Scene(lengths, Motion(theta_4=2.0, omega_4=1.0))
    told = describe(scene, limit + math.radians(2.0))
    assert told == "2 deg from a limit position, beyond which the loop does not close"
    assert not describe(scene, limit + 0.4)


@pytest.mark.parametrize(
    "solref, error, reached, said",
    read_rows("""
 | 0.001 | within | The file is within 0.01 as it is.
1 1 | 0.001 | within | Type this into the MJCF for an error within 0.01:
1 1 | 0.1 | | None of 9 combinations was within 0.01; the best:
 | 0.1 | | None of 9 combinations was within 0.01; the best is the file
 | inf | | None of 9 combinations has an answer: too many steps
"""),
)
def test_advice_begins_with_what_was_reached(solref, error, reached, said):
    changes, error = {"solref": solref} if solref else {}, float(error)
    worst = WorstState(error, "F12", 0.5, 0.5)
    tried = TriedSettings(changes, worst, WorstState(0.0), 0.0, 1e-6, 1e-3)
    advice = SettingsAdvice(0.01, 5, tried, (), tried, 9, (), None)
    assert advice.reached == bool(reached)
    loop = SimpleNamespace(refusal="too many steps", scene=SCENE, joint="knee")
    about, first, *others = describe_advice(loop, advice)
    assert about.startswith("Errors are the worst")
    assert first.startswith(said)
    no_part = any("No part of the range" in str(block) for block in others)
    assert no_part == (error == 0.1)
    decides = "F12 at single states decides, at knee = 28.65 deg"
    assert (decides in others) == math.isfinite(error)
