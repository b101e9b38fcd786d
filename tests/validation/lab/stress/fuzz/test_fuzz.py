"""Fuzzing: counter-examples stay fixed, the fuzzer itself notices what it must, a stretch of scenes holds."""

import json
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import fourbar.formulas.mobility
from fourbar.files import loads
from fourbar_validation.lab.stress.fuzz import fuzz as examine
from fourbar_validation.lab.stress.fuzz.fuzz import examine_chunk, run
from fourbar_validation.lab.stress.fuzz.scenes import scene_of
from fourbar_validation.lab.stress.fuzz.shrink import KEPT, keep, shrunk
from tests.support.scenes import crank_rocker

SEED = 0


@pytest.mark.parametrize("path", sorted(KEPT.glob("*.toml")), ids=lambda path: path.stem)
def test_a_kept_counterexample_holds(path: Path) -> None:
    assert examine.findings(loads(path.read_text(encoding="utf-8"))) == []


def test_a_stretch_of_scenes_holds() -> None:
    assert examine_chunk(SEED, 0, 60) == {}


def test_a_scene_depends_on_its_number_alone() -> None:
    assert fourbar.dump(scene_of(3, 17)) == fourbar.dump(scene_of(3, 17)) != fourbar.dump(scene_of(3, 19))


def test_half_are_adversarial() -> None:
    """Odd scenes reach where even ones never go: bars in a ratio beyond 100, or positions that barely close."""
    spread = [max(s.linkage.lengths) / min(s.linkage.lengths) for s in (scene_of(SEED, i) for i in range(200))]
    assert max(spread[0::2]) < 20.0
    assert max(spread[1::2]) > 1e3


def small_error(true: object) -> object:
    """One part in 1e9 of the moment of bar 3."""

    def wrong(lengths, at, drive_bar, w, *others):  # type: ignore[no-untyped-def]
        return true(lengths, at, drive_bar, w._replace(M3=(1.0 + 1e-9) * w.M3), *others)  # type: ignore[operator]

    return wrong


def test_an_error_of_a_billionth_is_found_and_shrunk(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    solving = import_module("fourbar.evaluation.case")
    monkeypatch.setattr(solving, "pin_forces", small_error(solving.pin_forces))
    scene = replace(crank_rocker(), motion=fourbar.Motion(np.array([1.0, 2.0]), 10.0, 5.0))
    assert examine.findings(scene)
    small = shrunk(scene, lambda candidate: bool(examine.findings(candidate)))
    assert len(small.loads) + len(small.effects) < 3 and examine.findings(small)
    kept = keep(small, "billionth", tmp_path)
    assert examine.findings(loads(kept.read_text(encoding="utf-8")))


def test_a_limit_off_by_a_billionth_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = replace(crank_rocker(), motion=fourbar.Motion(np.array([1.0, 2.0]), 10.0, 5.0))
    assert examine.findings(scene) == []
    true = fourbar.formulas.mobility.limit_positions
    monkeypatch.setattr(
        fourbar.formulas.mobility,
        "limit_positions",
        lambda *of: tuple(limit._replace(theta_4=limit.theta_4 + 1e-9) for limit in true(*of)),
    )
    found = {finding.split(":")[0] for finding in examine.findings(scene)}
    assert found == {"pinocchio-inverse range", "pinocchio-inverse limit_positions"}


@pytest.mark.parametrize(("times", "found"), [(9.0, False), (11.0, True)])
def test_a_force_that_vanishes_is_held_to_its_prediction(
    monkeypatch: pytest.MonkeyPatch, times: float, found: bool
) -> None:
    """Relative to 0 no error has a size: it is judged in newtons, and not left unjudged."""
    scene = loads((KEPT / "bar_with_all_mass_stands_for_an_instant.toml").read_text(encoding="utf-8"))
    witness = next(witness for witness in examine.EXACT if witness.name == "pinocchio-inverse")
    solution = fourbar.solve(scene, "force")
    assert solution.F12 is not None and not solution.F12.any()
    answer = witness.engine().answer(scene, examine.command(scene))
    wrong = np.array([[times, 0.0]])
    answer.quantities["F12"] = wrong
    rows = examine.compare("", scene, answer, solution, witness.tolerance, ("F12",), lambda quantity, where: np.ones(1))
    assert [row.verdict == "fails" for row in rows if row.quantity == "F12"] == [found]


def test_a_traceback_is_a_finding(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise ZeroDivisionError("oops")

    monkeypatch.setattr(examine, "_file", broken)
    assert examine.findings(crank_rocker()) == ["ZeroDivisionError: oops"]


def test_a_position_that_does_not_close_is_a_finding(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = replace(crank_rocker(), linkage=fourbar.uniform(0.3, 0.25, 0.1, 0.22))
    scene = replace(scene, motion=fourbar.Motion(np.array([3.0]), 1.0), loads=())
    true = examine.solve

    def pretend(*arguments: object, **keywords: object) -> object:
        solution = true(*arguments, **keywords)  # type: ignore[arg-type]
        solution.status_code[:] = 0
        return solution

    assert examine.findings(scene) == []
    monkeypatch.setattr(examine, "solve", pretend)
    assert any(line.startswith("assembled") for line in examine.findings(scene))


def test_an_interrupted_run_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fourbar_validation.lab.stress.fuzz.fuzz.CHUNK", 4)
    first = run(12, 1, tmp_path, 1)
    next(first)
    first.close()
    done = next(iter(sorted(tmp_path.glob("chunk-*.json"))))
    done.write_text(json.dumps({"0": ["left by the run before"]}), encoding="utf-8")
    found = list(run(12, 1, tmp_path, 1))
    assert len(found) == 3 and found[0] == {"0": ["left by the run before"]}
