"""The measure of the checks: what counts as a changed number, and what the command makes of mutmut's list."""

from pathlib import Path

import numpy as np
import pytest

import fourbar
from fourbar_validation.lab.stress.mutation import harness
from fourbar_validation.lab.stress.mutation import mutation as command
from fourbar_validation.lab.stress.mutation.harness import caught, changed, numbers
from tests.support.scenes import crank_rocker

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


def test_without_a_mutant_the_harness_holds() -> None:
    """Near change points too, where the engines lose as many digits as they are expected to."""
    for scene in harness.scenes()[-3:]:
        at = harness.command(scene)
        answers = [(w, w.engine().answer(scene, at)) for w in harness.WITNESSES if w.name in harness.EXACT]
        assert not caught(scene, at, answers)


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


def test_survivors_need_a_reason(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    listed = "\n".join(f"    fourbar.formulas.torque.x_f__mutmut_{i}: killed" for i in range(1, 20))
    listed += "\n    fourbar.formulas.torque.x_f__mutmut_20: survived"
    listed += "\n    fourbar.formulas.mobility.x_g__mutmut_1: not checked\n"
    states = command._states(listed, ["fourbar.formulas.torque*"])
    assert len(states) == 20
    every = command._states(listed, ["fourbar.formulas.torque*", "fourbar.formulas.mobility*"])
    assert len(every) == 21
    survivors = {"fourbar.formulas.torque.x_f__mutmut_20": "torque.f: return a -> return b"}
    reasons = tmp_path / "harmless.json"
    monkeypatch.setattr(command, "HARMLESS", reasons)
    assert command._reported(states, survivors, tmp_path) == 1
    assert "19 of 20" in capsys.readouterr().out
    assert "NO REASON" in (tmp_path / "survivors.txt").read_text(encoding="utf-8")
    reasons.write_text('{"torque.f": {"return a -> return b": "a is b"}}', encoding="utf-8")
    assert command._reported(states, survivors, tmp_path) == 0
    assert "a is b" in (tmp_path / "survivors.txt").read_text(encoding="utf-8")
    assert "of no survivor" not in capsys.readouterr().out
    # a run that ended early proves nothing, nor do nineteen dead of one module speak for another
    assert command._reported(every, survivors, tmp_path) == 1
    assert "1 mutants were not tried" in capsys.readouterr().out
    more = {
        **states,
        "fourbar.formulas.mobility.x_g__mutmut_1": "survived",
        "fourbar.formulas.mobility.x_g__mutmut_2": "killed",
    }
    more |= {f"fourbar.formulas.torque.x_h__mutmut_{i}": "killed" for i in range(40)}
    same = "torque.f: return a -> return b"  # on record too
    assert command._reported(more, {**survivors, "fourbar.formulas.mobility.x_g__mutmut_1": same}, tmp_path) == 1
    capsys.readouterr()
    assert command._reported(states | {"fourbar.formulas.torque.x_f__mutmut_20": "killed"}, {}, tmp_path) == 0
    assert "of no survivor:\n    torque.f: return a -> return b" in capsys.readouterr().out
    # with a reason each, but too many
    del states["fourbar.formulas.torque.x_f__mutmut_1"]
    assert command._reported(states, survivors, tmp_path) == 1
    assert command._reported({}, {}, tmp_path) == 1


SHOWN = """# fourbar.formulas.mobility.xǁReachǁsum__mutmut_11: survived
--- fourbar/mobility.py
+++ fourbar/mobility.py
@@ -1,3 +1,3 @@
 total = 1
-return 0.0 if total <= limit else total
+return 0.0 if total < limit else total
"""


def test_a_survivor_is_known_by_its_function_and_its_line(tmp_path: Path) -> None:
    mutmut = tmp_path / "mutmut"
    mutmut.write_text(f"#!/bin/sh\ncat <<'END'\n{SHOWN}END\n", encoding="utf-8")
    mutmut.chmod(0o755)
    change = command._change(mutmut, tmp_path, "fourbar.formulas.mobility.xǁReachǁsum__mutmut_11")
    assert (
        change
        == "mobility.Reach.sum: return 0.0 if total <= limit else total -> return 0.0 if total < limit else total"
    )
    assert command._change(mutmut, tmp_path, "fourbar.formulas.mobility.x__wrapped__mutmut_1").startswith(
        "mobility._wrapped: "
    )


def test_a_run_that_mutmut_stops_is_no_result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Here mutmut knows of one killed mutant, from before, and finds a test that fails without any."""
    mutmut = tmp_path / "mutmut"
    mutmut.write_text(
        "#!/bin/sh\n[ $1 = results ] && echo 'fourbar.formulas.torque.x_f__mutmut_1: killed' || exit $STOPS\n",
        encoding="utf-8",
    )
    mutmut.chmod(0o755)
    monkeypatch.setattr(command.sys, "executable", str(tmp_path / "python"))
    monkeypatch.setattr(command, "_copy", lambda tree: tree.mkdir(parents=True, exist_ok=True))
    monkeypatch.setattr(command, "_reasons", dict)
    for stops, status in (("0", 0), ("1", 1)):
        monkeypatch.setenv("STOPS", stops)
        arguments = ["--out", str(tmp_path / "out")]
        assert command.mutation.main(arguments, standalone_mode=False) == status
        assert ("mutmut stopped with status 1" in capsys.readouterr().out) == bool(status)
        assert (tmp_path / "out" / "mutmut.log").is_file()
    # nothing survived: there is nothing to try again, and no run before it means nothing to go by
    monkeypatch.setenv("STOPS", "0")
    assert command.mutation.main([*arguments, "--again"], standalone_mode=False) == 0
    with pytest.raises(fourbar.InputError, match="no run into"):
        command.mutation.main(["--again", "--out", str(tmp_path / "other")], standalone_mode=False)


def test_the_whole_suite_is_tried_without_what_fails_on_the_copy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mutants").mkdir()
    test = "import os\ndef test_copy(): assert False\ndef test_one(): assert os.environ['MUTANT_UNDER_TEST'] != 'bad'\n"
    (tmp_path / "mutants" / "test_it.py").write_text(test, encoding="utf-8")
    assert command._caught_by_all(tmp_path, ["bad", "harmless"], 0) == ["bad"]
    assert command._caught_by_all(tmp_path, [], 0) == []
