"""What to type into a robot's file: typed, it does what was measured."""

from dataclasses import replace
from pathlib import Path

import pytest

from fourbar_validation.engines.mujoco.robots.answers import LoopMotion, SettingsAdvice
from fourbar_validation.engines.mujoco.robots.closures import find_closures
from fourbar_validation.engines.mujoco.robots.compiled import compile_robot
from fourbar_validation.engines.mujoco.robots.loop import PoseOptions, RobotFile
from fourbar_validation.engines.mujoco.robots.pose import pose_robot
from fourbar_validation.engines.mujoco.robots.settings import SettingsSearch
from fourbar_validation.robots.files import read_robot

FOOT = Path(__file__).parents[5] / "models" / "robots" / "biped_foot.xml"
LIGHT_LOAD = 0.3
"""rad to either side of the pose."""


def search(file: RobotFile) -> SettingsSearch:
    posed = pose_robot(compile_robot(file).model, PoseOptions())
    (loop,) = (one.loop for one in find_closures(posed, PoseOptions()))
    assert loop is not None
    middle = loop.angles[1]
    angles = tuple(middle + LIGHT_LOAD * step / 4.0 for step in range(-4, 5))
    return SettingsSearch(posed.model, loop, LoopMotion(angles, 2.0, 0.0))


def paste(text: str, advice: SettingsAdvice) -> str:
    """Put the elements that were printed in the place of those of the file."""
    for element in advice.typed:
        if element.startswith("<option"):
            text = text.replace('<option timestep="0.001" />', element)
        else:
            text = text.replace(
                '<connect name="rod" site1="rod_end" site2="heel" />', element
            )
        assert element in text
    return text


@pytest.mark.slow
def test_what_is_typed_reaches_the_error_that_was_wanted() -> None:
    file = read_robot(FOOT)
    advice = search(file).advise(2e-3, file)
    assert advice.reached and advice.best.error <= 2e-3 < advice.before.error
    assert advice.before.settings.solref == (0.005, 1.0)
    typed = search(replace(file, text=paste(file.text, advice)))
    again = typed.measure(typed.own)
    assert again.settings.list_changes(advice.best.settings) == {}
    assert again.error == pytest.approx(advice.best.error, rel=1e-3)


@pytest.mark.slow
def test_stiffness_alone_helps_and_what_costs_nothing_is_tried_first() -> None:
    file = read_robot(FOOT)
    advice = search(file).advise(2e-3, file)
    stiff = next(one for one in advice.alone if list(one.changes) == ["solimp"])
    assert stiff.error < 0.1 * advice.before.error
    assert advice.best.changes.keys() <= {"solimp", "solref"}
    assert advice.best.settings.timestep == advice.before.settings.timestep


@pytest.mark.slow
def test_an_error_that_nothing_reaches_is_not_reached(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(
        "fourbar_validation.engines.mujoco.robots.settings.SEARCH_SECONDS", 3.0
    )
    file = read_robot(FOOT)
    advice = search(file).advise(1e-12, file)
    assert not advice.reached
    assert advice.best.error == min(
        one.error for one in (advice.before, *advice.alone, advice.best)
    )
