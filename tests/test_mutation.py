"""The measure of the checks: what counts as a changed number, and what the command makes of mutmut's list."""

from pathlib import Path

import numpy as np
import pytest

from tests.scenes import crank_rocker
from validation.mutation import command, harness
from validation.mutation.harness import caught, changed, numbers

SCENE = crank_rocker()


def test_a_number_counts_as_changed_from_a_billionth_on() -> None:
    at = harness.command(SCENE)
    before = numbers(SCENE, at)
    assert not changed(before, numbers(SCENE, at))
    for part, counts in ((1e-12, False), (1e-8, True)):
        after = {**before, "torque": before["torque"] * (1.0 + part)}
        assert changed(before, after) == counts
    assert changed(before, {**before, "torque": np.where(np.arange(61) == 3, np.nan, before["torque"])})
    assert changed(before, {**before, "F12": None})


def test_the_harness_alone_catches_a_wrong_sign(monkeypatch: pytest.MonkeyPatch) -> None:
    at = harness.command(SCENE)
    answers = [(w, w.engine().answer(SCENE, at)) for w in harness.WITNESSES if w.name in harness.EXACT]
    assert not caught(SCENE, at, answers)
    true = harness.solve

    def wrong(*arguments: object, **keywords: object) -> object:
        solution = true(*arguments, **keywords)  # type: ignore[arg-type]
        solution.F14 *= -1.0
        return solution

    monkeypatch.setattr(harness, "solve", wrong)
    assert caught(SCENE, at, answers)


def test_survivors_need_a_reason(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    listed = "\n".join(f"    fourbar.dynamics.x_f__mutmut_{i}: killed" for i in range(1, 19))
    listed += "\n    fourbar.dynamics.x_f__mutmut_19: survived\n    fourbar.mobility.x_g__mutmut_1: not checked\n"
    assert command._told(listed, tmp_path, ["fourbar.dynamics*", "fourbar.mobility*"]) == 1
    assert "18 of 19" in capsys.readouterr().out
    assert "NO REASON" in (tmp_path / "survivors.txt").read_text(encoding="utf-8")
    assert command._told(listed + "    fourbar.dynamics.x_f__mutmut_20: killed\n", tmp_path, ["fourbar.dynamics*"]) == 0
    assert command._told("", tmp_path, ["fourbar.dynamics*"]) == 1
