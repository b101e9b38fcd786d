"""Fuzzing: counter-examples stay fixed, and a stretch of scenes holds.

The fuzzer itself notices what it must.
"""

from dataclasses import replace
from importlib import import_module
from unittest.mock import Mock

import numpy as np
from click.testing import CliRunner
from pytest import mark

from fourbar import Motion, Scene, uniform
from fourbar.files import loads
from fourbar_lab import fuzz as examine
from fourbar_lab.fuzz import (
    COUNTEREXAMPLES,
    draw_fuzz_scene,
    keep_counterexample,
    shrink_scene,
)
from tests.support.here import spoil_formulas
from tests.support.scenes import crank_rocker

SEED = 0


@mark.slow
@mark.parametrize(
    "path", sorted(COUNTEREXAMPLES.glob("*.toml")), ids=lambda path: path.stem
)
def test_a_kept_counterexample_holds(path):
    assert examine.list_findings(loads(path.read_text("utf-8"))) == []


@mark.slow
def test_a_stretch_of_scenes_holds():
    assert not [number for number in range(60) if examine.examine_scene(SEED, number)]


def test_a_scene_depends_on_its_number_alone():
    """Even numbers are of one family."""
    assert draw_fuzz_scene(3, 18) == draw_fuzz_scene(3, 18) != draw_fuzz_scene(3, 20)


def test_an_error_of_a_billionth_is_found_and_shrunk(monkeypatch, tmp_path):
    """Of the moment of bar 3."""
    solving = import_module("fourbar.evaluation.case")
    true = solving.pin_forces

    def wrong(lengths, angles, drive_bar, w, *others):
        wrenches = w._replace(M3=(1.0 + 1e-9) * w.M3)
        return true(lengths, angles, drive_bar, wrenches, *others)

    monkeypatch.setattr(solving, "pin_forces", wrong)
    scene = replace(crank_rocker(), motion=Motion(np.array([1.0, 2.0]), 10.0, 5.0))
    assert examine.list_findings(scene)
    small = shrink_scene(scene, examine.list_findings)
    assert len(small.loads) + len(small.effects) < 3 and examine.list_findings(small)
    kept = keep_counterexample(small, "billionth", tmp_path)
    assert examine.list_findings(loads(kept.read_text("utf-8")))


def test_a_traceback_is_a_finding_and_so_is_a_file_of_another_scene(monkeypatch):
    another = replace(crank_rocker(), title="another")
    monkeypatch.setattr(examine, "loads", lambda _: another)
    (finding,) = examine.list_findings(crank_rocker())
    assert finding.startswith("file: ")
    monkeypatch.setattr(examine, "judge", Mock(side_effect=ZeroDivisionError("oops")))
    assert examine.list_findings(crank_rocker()) == ["ZeroDivisionError: oops"]


def test_a_run_that_is_broken_off_keeps_what_it_found(monkeypatch):
    def break_off(*_):
        yield {4: [f"{examine.WORKER_LOST} killed"]}
        raise KeyboardInterrupt

    kept = Mock()
    monkeypatch.setattr(examine, "examine_scenes", break_off)
    monkeypatch.setattr(examine, "keep_counterexample", kept)
    CliRunner().invoke(examine.fuzz)
    assert kept.call_args.args[1] == "seed_0_scene_4"


def test_a_position_that_does_not_close_is_a_finding(monkeypatch):
    scene = Scene(uniform(0.3, 0.25, 0.1, 0.22), Motion([3.0], 1.0))

    def pretend(solution):
        solution.status_code[:] = 0

    assert examine.list_findings(scene) == []
    spoil_formulas(monkeypatch, pretend)
    assert any(" assembled: " in line for line in examine.list_findings(scene))
