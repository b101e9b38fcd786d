"""A harness that cannot catch an injected fault is none.

The list fits the tree, and some of its faults are tried.
"""

import math

from pytest import mark

from fourbar_lab import faults
from fourbar_lab.fault_scenes import FAULT_SCENES
from fourbar_lab.faults import explain_survival, try_faults
from fourbar_lab.injection import inject_fault, read_faults
from fourbar_validation.engines.programs import Ended
from fourbar_validation.places import CHECKOUT

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
    "the damping of B turns with the wrong bars in MJCF",
)
"""Some of each kind; `make long-faults` tries them all."""
EXACT = {"pinocchio-inverse", "mujoco-inverse", "free-body"}


def test_every_entry_fits_its_module_and_says_what_catches_it():
    assert len(ENTRIES) == len(read_faults()) >= 250
    for entry in read_faults():
        assert inject_fault(entry)
        if "tests" in entry:
            path, _, test = entry["tests"].partition("::")
            text = (CHECKOUT / path).read_text("utf-8")
            assert f"def {test.partition('[')[0]}" in text
        else:
            names = [name.rpartition(", ")[-1] for name in entry["scenes"]]
            assert names and set(names) <= FAULT_SCENES.keys()
            assert entry["caught_by"] or entry["harmless"], entry["fault"]


@mark.slow
def test_every_faulted_module_compiles():
    for entry in read_faults():
        for name, text in inject_fault(entry).items():
            compile(text, name, "exec")


@mark.slow
@mark.parametrize(
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
    for status, seconds, says in (
        (0, 1.0, "status 0"),
        (1, 11.0, "take 11.0 s"),
        (1, 2.0, None),
    ):
        out = f'...\n{{"status": {status}, "seconds": {seconds}}}\n'
        ended = Ended(out, "", False, "")
        monkeypatch.setattr(faults, "run_to_end", lambda *_, e=ended, **__: e)
        why = faults.try_tests(0)
        assert why is None if says is None else says in why


@mark.slow
@mark.timeout(300)
def test_an_injected_fault_fails_the_harness_where_its_entry_says():
    """A fault of the formulas is noticed by every exact engine by itself."""
    chosen = (*IN_FORMULAS, *ELSEWHERE)
    outcomes = try_faults([ENTRIES[fault] for fault in chosen])
    assert not isinstance(outcomes, str), outcomes
    for fault, failing in zip(chosen, outcomes, strict=True):
        assert explain_survival(read_faults()[ENTRIES[fault]], failing) is None, fault
        noticed = {row.partition(" ")[0] for rows in failing.values() for row in rows}
        assert fault in ELSEWHERE or noticed >= EXACT, (fault, noticed)


@mark.parametrize(
    "failing, why",
    [
        ({"crank": []}, "nothing fails"),
        ({"crank": ["free-body F12: equivalence"]}, "none of torque"),
        ("NameError", "raises"),
        ({"crank": ["free-body torque: equivalence"]}, ""),
    ],
)
def test_what_does_not_fail_or_fails_elsewhere_survives(failing, why):
    said = explain_survival({"caught_by": ["torque"]}, failing)
    assert why in said if why else said is None
