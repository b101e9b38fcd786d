"""Scenes that once failed with engines that are right: the harness holds them, and what is wrong there still fails."""

from dataclasses import replace

import numpy as np
import pytest

import fourbar
from fourbar.effects import Gravity
from fourbar.linkage import Bar, FourBar
from fourbar.scene import Scene
from fourbar.scene.motion import Free, Motion
from fourbar.solution import Solution
from fourbar_lab.fault_scenes import FAULT_SCENES
from fourbar_validation.compare.rows import AGREES, DEGRADED, FAILS
from fourbar_validation.engines.registry import ENGINES
from fourbar_validation.run import printed, released
from fourbar_validation.run.judge import judge
from fourbar_validation.run.question import Question
from fourbar_validation.scenes.random import draw_random_scene

EXACT = [engine for engine in ENGINES if not engine.through_time]
BY_ITSELF = [engine for engine in EXACT if not engine.library]
POSITIONS = np.array([0.14, 1.75, 4.03, 4.73])


def bars(
    d: float, a: float, b: float, c: float, theta_1: float = 0.0, r: float | None = None
) -> FourBar:
    far = None if r is None else (r, 0.35)
    return FourBar(d, Bar(a, 0.01), Bar(b, 1.0, centre=far), Bar(c, 0.5), theta_1)


SCENES = {
    "short input": Scene(
        bars(0.5, 0.002, 0.48, 0.12), Motion(POSITIONS, 10.0), effects=(Gravity(),)
    ),
    "centre 100 m away": Scene(
        bars(0.2, 0.08, 0.18, 0.15, r=100.0), Motion(np.array([0.63, 0.94, 1.26]), 10.0)
    ),
    "ground at 1e7 rad": Scene(
        bars(0.2, 0.08, 0.18, 0.15, 1e7), Motion(np.array([0.63, 1.57]), 10.0)
    ),
    "bars of micrometres": Scene(
        bars(20e-6, 8e-6, 18e-6, 15e-6), Motion(POSITIONS, 10.0)
    ),
    "positions alone": Scene(bars(20e-6, 8e-6, 18e-6, 15e-6), Motion(POSITIONS)),
}


@pytest.mark.parametrize("name", SCENES)
def test_engines_that_are_right_raise_no_alarm(name: str) -> None:
    assert not [row for row in judge(name, SCENES[name], EXACT).rows if row.failed]


@pytest.mark.slow
def test_ratios_over_ten_decades_raise_no_alarm() -> None:
    """As `run --random N --type uneven`. In the last the forces were summed more strictly than its coupler allows."""
    scenes = [
        (index, draw_random_scene(0, index, ()))
        for index in (1, 6, 8, 9, 10, 32, 36, 61)
    ]
    lengths = [scene.linkage.lengths for _, scene in scenes]
    assert max(max(bars) / min(bars) for bars in lengths) > 1e8
    kinds = {effect.key for _, scene in scenes for effect in scene.effects}
    assert kinds == {"gravity", "viscous", "friction", "springs", "torsion", "flywheel"}
    failed = [
        (index, row)
        for index, scene in scenes
        for row in judge(str(index), scene, EXACT).rows
        if row.failed
    ]
    assert not failed


@pytest.mark.slow
def test_a_free_motion_near_a_limit_raises_no_alarm(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The engines get theta_2, omega_2 and alpha_2 of the independent theta_4, rounded: what that costs is computed."""
    monkeypatch.setattr(released, "FORWARD", {})
    scene = FAULT_SCENES["double rocker released"]
    often = replace(
        scene, motion=scene.motion.replace(free=Free(1.0, 1000))
    )  # nearer to its limits
    rows = judge("released", often, BY_ITSELF).rows
    assert not [row for row in rows if row.failed] and DEGRADED in {
        row.verdict for row in rows
    }


def test_what_is_wrong_by_more_than_is_predicted_fails(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where the law in the condition is too strict, what is computed in its place is no licence."""
    true = fourbar.solve

    def off(*arguments: object, **keywords: object) -> Solution:
        solution: Solution = true(*arguments, **keywords)  # type: ignore[arg-type]
        if solution.omega_3 is not None:
            solution.omega_3 *= 1.0 + 1e-11
        return solution

    monkeypatch.setattr("fourbar_validation.run.question.solve", off)
    rows = judge("short", SCENES["short input"], BY_ITSELF).rows
    assert {row.verdict for row in rows if row.quantity == "omega_3"} == {FAILS}


def test_an_error_bar_of_no_error_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = replace(FAULT_SCENES["crank-rocker"], motion=Motion(POSITIONS, 10.0))
    true = printed.solve

    def judged() -> str:
        rows = printed.check_error_bars(Question("", scene, fourbar.command(scene)))
        return {row.quantity: row.verdict for row in rows}["force_error"]

    def without(scene: Scene, *stage: str, **keywords: object) -> Solution:
        solution: Solution = true(scene, *stage, **keywords)  # type: ignore[arg-type]
        if stage == ("error",):
            assert solution.F12 is not None
            solution.F12[1] = np.nan
        return solution

    assert judged() == AGREES
    monkeypatch.setattr(printed, "solve", without)
    assert judged() == FAILS
