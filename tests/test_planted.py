"""The list of planted faults fits the tree, and the harness tells one with a fault from one without."""

import pytest

from validation.stress.mutation.planted import outcome, survives
from validation.stress.mutation.planting import faults, planted
from validation.stress.mutation.specimens import SPECIMENS

ENTRIES = {entry["fault"]: number for number, entry in enumerate(faults())}


def test_every_entry_fits_its_module_and_is_tried_on_a_specimen() -> None:
    assert len(ENTRIES) == len(faults()) >= 70
    for entry in faults():
        for name, text in planted(entry).items():
            compile(text, name, "exec")
        assert entry["specimens"] and set(entry["specimens"]) <= SPECIMENS.keys(), entry["fault"]
        assert entry["caught_by"] or entry["harmless"], entry["fault"]


@pytest.mark.parametrize("fault", ["a third of all positions is called singular", "the law's speed without its mean"])
def test_a_planted_fault_fails_the_harness_where_its_entry_says(fault: str) -> None:
    number = ENTRIES[fault]
    assert survives(faults()[number], outcome(number)) is None


def test_what_does_not_fail_or_fails_elsewhere_survives() -> None:
    entry = {"caught_by": ["torque"]}
    assert "nothing fails" in (survives(entry, {"crank": []}) or "")
    assert "none of torque" in (survives(entry, {"crank": ["free-body F12: equivalence"]}) or "")
    assert "raises" in (survives(entry, "NameError") or "")
    assert survives(entry, {"crank": ["free-body torque: equivalence"]}) is None
