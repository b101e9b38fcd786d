"""Mutants of the formulas.

How they are made, what counts as a changed number, and what the harness catches.
"""

from dataclasses import replace

import numpy as np
from pytest import mark

from fourbar.formulas import torque
from fourbar_lab import mutants as harness
from fourbar_lab.mutants import compile_mutants, compute_numbers, is_caught, is_changed
from tests.support.here import spoil_formulas
from tests.support.scenes import crank_rocker

SCENE = crank_rocker()


def test_a_number_counts_as_changed_from_a_billionth_on():
    before = compute_numbers(SCENE)
    assert not is_changed(before, compute_numbers(SCENE))
    torque = before["torque"]
    lost = np.where(np.arange(len(torque)) == 3, np.nan, torque)
    for other, counts in (
        (torque * (1.0 + 1e-12), False),
        (torque * (1.0 + 1e-8), True),
        (lost, True),
        (None, True),
    ):
        assert is_changed(before, {**before, "torque": other}) == counts


@mark.slow
def test_without_a_mutant_the_harness_holds():
    """Near change points too it holds.

    The engines lose as many digits there as they are expected to.
    """
    for scene in harness.choose_scenes()[-3:]:
        harness.make_baseline(scene)


@mark.slow
def test_the_harness_alone_catches_a_wrong_sign(monkeypatch):
    harness.make_baseline(SCENE)
    spoil_formulas(monkeypatch, lambda right: replace(right, F14=-right.F14))
    assert is_caught(SCENE)


def test_a_mutant_acts_wherever_its_function_was_imported_and_only_while_active():
    before = compute_numbers(SCENE)
    tried = list(compile_mutants(torque))
    assert len(tried) > 40 and len({mutant.name for mutant in tried}) == len(tried)
    chosen = next(mutant for mutant in tried if mutant.function is torque.inertia)
    with chosen.active():
        assert is_changed(before, compute_numbers(SCENE))
    assert not is_changed(before, compute_numbers(SCENE))
