"""A released linkage that reaches a limit position: judged to its end, whatever an engine does there."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import fourbar
from fourbar.scene import Scene
from fourbar.solve import solve
from fourbar_validation.compare.rows import DEGRADED, FAILS, UNDECIDED, Row
from fourbar_validation.engines.loop import LimitDetector
from fourbar_validation.report.record import Record
from fourbar_validation.run import released as free
from fourbar_validation.run.judge import judge, judge_for_report


def falling(coupler: float = 0.15, **motion: Any) -> Scene:
    """It falls from rest until bars 3 and 4 lie in one line; with a coupler of 0.12 m that is a change point."""
    linkage = fourbar.FourBar(
        0.3, fourbar.Bar(0.2, 0.2), fourbar.Bar(coupler, 0.5), fourbar.Bar(0.22, 0.4)
    )
    released = fourbar.Motion(1.0, 0.0, free=fourbar.Free(1.0, 100), **motion)
    return Scene(linkage, released, effects=(fourbar.Gravity(),))


def row(rows: list[Row], engine: str, quantity: str) -> Row:
    (found,) = (row for row in rows if (row.engine, row.quantity) == (engine, quantity))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("coupler", [0.12, 0.15])
def test_every_engine_is_judged_up_to_the_limit_and_by_its_instant(
    coupler: float,
) -> None:
    scene = falling(coupler)
    solution = solve(scene)
    assert solution.stopped_at is not None and solution.time is not None
    assert solution.time[-1] <= solution.stopped_at < solution.time[-1] + 0.01
    page = judge_for_report("falling", scene)
    assert {row.engine for row in page.rows} > set(free.FORWARD)
    assert all(row.passed for row in page.rows)
    for engine in free.FORWARD:
        assert (
            row(page.rows, engine, "stopped_at").error < 2e-5
        )  # of the second, as measured
        assert row(page.rows, engine, "theta_2").error < 2e-6
    assert page.figure is not None


@pytest.mark.slow
def test_what_follows_the_path_has_no_instant_to_compare() -> None:
    rows = judge("falling", falling(through="follow")).rows
    assert rows and all(row.passed for row in rows)
    assert not any(row.quantity == "stopped_at" for row in rows)


def answering(monkeypatch: pytest.MonkeyPatch, change: Any) -> list[Row]:
    """The rows of Pinocchio where its answer is changed."""
    from fourbar_validation.engines.pinocchio import PinocchioReleased

    true = PinocchioReleased.release
    monkeypatch.setattr(
        PinocchioReleased, "release", lambda *arguments: change(true(*arguments))
    )
    return [
        row
        for row in judge("falling", falling()).rows
        if row.engine == "pinocchio-forward"
    ]


def test_an_engine_that_stops_before_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    def cut(answer: Any) -> Any:
        return replace(
            answer,
            theta_2=answer.theta_2[:20],
            omega_2=answer.omega_2[:20],
            energy=answer.energy[:20],
        )

    (only,) = answering(monkeypatch, cut)
    assert only.verdict == FAILS and "20 of 44 instants" in only.reason


@pytest.mark.slow
def test_an_engine_that_is_nan_before_it_fails_and_one_that_is_nan_behind_the_limit_does_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def struck(index: int) -> Any:
        def strike(answer: Any) -> Any:
            answer.theta_2[index] = np.nan
            return answer

        return strike

    with monkeypatch.context() as patch:
        assert (
            row(answering(patch, struck(20)), "pinocchio-forward", "theta_2").verdict
            == FAILS
        )
    with monkeypatch.context() as patch:
        assert all(row.passed for row in answering(patch, struck(60)))


def test_an_engine_that_meets_no_limit_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = answering(monkeypatch, lambda answer: replace(answer, stopped_at=None))
    assert [row.quantity for row in rows if row.verdict == FAILS] == ["stopped_at"]


def test_an_engine_is_run_at_twice_its_step_however_close_the_instants_are() -> None:
    """Released from rest by a couple alone: kinetic energy and work are equal, and their difference is no scale."""
    scene = replace(falling(), effects=(), loads=(fourbar.Load(4, moment=0.1),))
    for steps in (20, 200):  # 10 and 1 ms apart
        released = fourbar.Free(0.2, steps)
        rows = judge(
            "pushed", replace(scene, motion=scene.motion.replace(free=released))
        ).rows
        assert not any(row.failed for row in rows)
        energy = row(rows, "mujoco-forward", "energy")
        assert energy.verdict == DEGRADED and energy.error < 1e-3, energy


def test_an_engine_that_predicts_nothing_of_itself_is_undecided(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One that is wrong by 3 rad at its step and by 5 rad at twice it has no digit by which it could agree."""
    off = iter([3.0, 5.0])
    rows = answering(
        monkeypatch,
        lambda released: replace(released, theta_2=released.theta_2 + next(off)),
    )
    assert row(rows, "pinocchio-forward", "theta_2").verdict == UNDECIDED


def test_formulas_that_stop_too_early_are_found(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Cut after three instants all that is left would agree."""

    def short(scene: Scene) -> Any:
        solution = solve(scene)
        assert solution.omega_2 is not None
        solution.theta_2, solution.omega_2, solution.stopped_at = (
            solution.theta_2[:3],
            solution.omega_2[:3],
            0.025,
        )
        solution.branch, solution.status_code = (
            solution.branch[:3],
            solution.status_code[:3],
        )
        return solution

    monkeypatch.setattr("fourbar_validation.run.question.solve", short)
    rows = judge("falling", falling()).rows
    for engine in free.FORWARD:
        assert row(rows, engine, "stopped_at").verdict == FAILS


def test_a_limit_is_seen_once_and_between_two_steps() -> None:
    detector = LimitDetector(-1)
    for time, theta_4 in ((1.0, -0.2), (2.0, 0.2), (3.0, -0.2), (4.0, 0.2)):
        detector.look(time, 0.0, theta_4)
    assert detector.stopped_at == pytest.approx(1.5, rel=1e-15)


def test_the_summary_says_that_the_motion_ended() -> None:
    from fourbar.show.block import write_block
    from fourbar.solution import write_json

    scene = falling()
    solution, free = solve(scene), scene.motion.free
    assert free is not None and len(solution) <= free.steps
    wanted = f"released for {free.duration:g} s, without a drive: it stops at a limit position at t = 0.4399 s"
    assert wanted in " ".join(" ".join(write_block(scene, solution)).split())
    assert json.loads(write_json(solution))["stopped_at"] == solution.stopped_at


@pytest.mark.slow
def test_a_released_scene_is_reported_without_a_torque_that_is_rounding(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from fourbar_validation.report import figures

    scene = falling()
    shown: list[str] = []
    monkeypatch.setattr(
        figures, "_draw_picture", lambda quantity, *_: shown.append(quantity) or ""
    )
    figures.draw_scene_figure(Record("falling", scene, solution=solve(scene)))
    assert shown == ["theta_4", "F32"]
