"""A harness that cannot catch an injected fault is none.

The list fits the tree, and some of its faults are tried.
"""

import math

import numpy as np
import pytest

import fourbar_validation.run.question
from fourbar_lab import faults
from fourbar_lab.fault_scenes import FAULT_SCENES
from fourbar_lab.faults import explain_survival, try_faults
from fourbar_lab.injection import inject_fault, read_faults
from fourbar_validation.engines.processes import Ended
from fourbar_validation.engines.registry import ENGINES
from fourbar_validation.places import CHECKOUT
from fourbar_validation.run.judge import judge
from tests.support.scenes import thesis

ENTRIES = {entry["fault"]: number for number, entry in enumerate(read_faults())}
IN_FORMULAS = (
    "with the drive on the output F43 of the wrong sense",
    "inertia about the mass centre in place of the pin",
    "the torque off by 1e-9",
    "the other branch is closed",
)
ELSEWHERE = (
    "MuJoCo's loop without the drift of its Jacobian",
    "dry friction that holds a released linkage loads no pin",
)
"""Some of each kind; `make long-faults` tries them all."""
EXACT = {"pinocchio-inverse", "mujoco-inverse", "free-body"}


def test_every_entry_fits_its_module_and_says_what_catches_it():
    assert len(ENTRIES) == len(read_faults()) >= 250
    for entry in read_faults():
        assert inject_fault(entry)
        if "tests" in entry:
            assert (CHECKOUT / entry["tests"].partition("::")[0]).is_file()
        else:
            assert entry["scenes"] and set(entry["scenes"]) <= FAULT_SCENES.keys()
            assert entry["caught_by"] or entry["harmless"], entry["fault"]


@pytest.mark.slow
def test_every_faulted_module_compiles() -> None:
    for entry in read_faults():
        for name, text in inject_fault(entry).items():
            compile(text, name, "exec")


@pytest.mark.slow
@pytest.mark.parametrize(
    "fault",
    [
        "a load's couple bends its bar from the first pin on",
        "K times 10",
        "a drawn place moves along the axes of its bar",
    ],
)
def test_a_fault_falls_in_the_tests_that_its_entry_names(fault, monkeypatch):
    """How soon they fail is for `python -m fourbar_lab faults`.

    A slow machine is no fault.
    """
    monkeypatch.setattr(faults, "TEST_SECONDS", math.inf)
    assert faults.try_tests(ENTRIES[fault]) is None


def test_tests_that_do_not_fail_or_take_long_let_a_fault_survive(monkeypatch):
    for status, seconds, says in ((0, 1.0, "status 0"), (1, 11.0, "take 11.0 s")):
        ended = Ended(
            f'...\n{{"status": {status}, "seconds": {seconds}}}\n', "", False, ""
        )
        monkeypatch.setattr(
            faults,
            "run_to_end",
            lambda *_, e=ended, **__: e,
        )
        assert says in (faults.try_tests(0) or "")
    held = Ended('{"status": 1, "seconds": 2.0}\n', "", False, "")
    monkeypatch.setattr(faults, "run_to_end", lambda *_, **__: held)
    assert faults.try_tests(0) is None


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_an_injected_fault_fails_the_harness_where_its_entry_says():
    """A fault of the formulas is noticed by every exact engine by itself."""
    chosen = (*IN_FORMULAS, *ELSEWHERE)
    outcomes = try_faults([ENTRIES[fault] for fault in chosen])
    assert not isinstance(outcomes, str), outcomes
    for fault, failing in zip(chosen, outcomes, strict=True):
        assert explain_survival(read_faults()[ENTRIES[fault]], failing) is None, fault
        noticed = {row.partition(" ")[0] for rows in failing.values() for row in rows}
        assert fault in ELSEWHERE or noticed >= EXACT, (fault, noticed)


def test_what_does_not_fail_or_fails_elsewhere_survives():
    entry = {"caught_by": ["torque"]}
    assert "nothing fails" in (explain_survival(entry, {"crank": []}) or "")
    assert "none of torque" in (
        explain_survival(entry, {"crank": ["free-body F12: equivalence"]}) or ""
    )
    assert "raises" in (explain_survival(entry, "NameError") or "")
    assert explain_survival(entry, {"crank": ["free-body torque: equivalence"]}) is None


def test_positions_outside_the_range_fail_the_run(monkeypatch):
    true = fourbar_validation.run.question.solve

    def pretend(*arguments, **keywords):
        solution = true(*arguments, **keywords)
        solution.status_code[:] = 0
        return solution

    monkeypatch.setattr(fourbar_validation.run.question, "solve", pretend)
    scene = thesis(np.radians([80.0, 135.0]))  # the range starts at 84.6 deg
    failing = {
        (row.engine, row.quantity)
        for row in judge("", scene, [w for w in ENGINES if w.name in EXACT]).rows
        if not row.passed
    }
    assert {(engine, "assembled") for engine in EXACT} <= failing


def test_a_fault_that_ends_the_process_costs_no_other_one(monkeypatch):
    def tried(numbers):
        return (
            "it ended"
            if 2 in numbers
            else [{"crank": [f"free-body F{n}: "]} for n in numbers]
        )

    monkeypatch.setattr(faults, "try_faults", tried)
    assert faults.try_in_turn([0, 1]) == [
        {"crank": ["free-body F0: "]},
        {"crank": ["free-body F1: "]},
    ]
    assert faults.try_in_turn([1, 2]) == [{"crank": ["free-body F1: "]}, "it ended"]
