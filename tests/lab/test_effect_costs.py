"""Switching off what a bare loop never needs pays.

What every effect costs is measured by `effects`.
"""

import time

import pytest

from fourbar.errors import HOLDS
from fourbar_lab import effect_costs
from fourbar_lab.cli import status
from fourbar_lab.effect_costs import DEFAULT_FLAGS

SAVED = 0.08
"""Part of the time of a step that the flags of the bare scene must save; they save some
0.2.
"""


@pytest.mark.slow
def test_the_bare_scene_steps_faster_than_with_default_flags():
    works = {
        effect: effect_costs.prepare_simulation(effect)
        for effect in ("none", DEFAULT_FLAGS)
    }
    best = dict.fromkeys(works, float("inf"))
    for _ in range(
        100
    ):  # by turns, a millisecond each: the least is free of what else the machine does
        for effect, work in works.items():
            began = time.perf_counter()
            work(50)
            best[effect] = min(best[effect], time.perf_counter() - began)
    assert best["none"] <= (1.0 - SAVED) * best[DEFAULT_FLAGS]


def test_a_workload_with_twice_the_work_costs_twice_as_much(monkeypatch):
    def prepare(effect):
        return lambda amount: sum(range((1 + (effect == "twice")) * 1000 * amount))

    monkeypatch.setitem(effect_costs.WORKLOADS, "formulas", prepare)
    measured = effect_costs.measure_effect("formulas", "twice", 25)
    assert (
        1.5 < measured.median < 2.5
        and measured.low <= measured.median <= measured.high
        and measured.seconds > 0.0
    )


def test_the_table_has_a_row_for_each_effect_and_flag(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(
        effect_costs,
        "measure_effect",
        lambda engine, effect: effect_costs.EffectCost(
            engine, effect, 2e-6, 1.1, 1.2, 1.25
        ),
    )
    assert (
        status(
            ["effects", "--only", "pin_friction", "-o", str(tmp_path / "effects.md")]
        )
        == HOLDS
    )
    text = (tmp_path / "effects.md").read_text().replace("\\", "")
    assert "| none | 2 us | 2 us | 2 us | 2 us |" in text
    assert (
        "| pin_friction | +20 % [+10, +25] | no counterpart | +20 % [+10, +25] | +20 %"
        " [+10, +25] |" in text
    )
    assert (
        "| none, island left on |  | +20 % [+10, +25] |  |  |" in text
        and "written to" in capsys.readouterr().out
    )
