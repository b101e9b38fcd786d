"""What the exact engines say of the models is the accepted state, on whatever machine that was made."""

from dataclasses import replace

import numpy as np
import pytest

import fourbar
from fourbar_validation.compare.rows import DEGRADED
from fourbar_validation.compare.tolerance import EPS, K
from fourbar_validation.engines.registry import ENGINES
from fourbar_validation.regression import render
from fourbar_validation.regression.changes import compare_rows
from fourbar_validation.regression.record import ACCEPTED, describe_run, find_baseline, read_run
from fourbar_validation.run.judge import judge
from fourbar_validation.scenes.suites import list_model_files

SCENES = [(file.stem, fourbar.load(file)) for file in list_model_files()]
EXACT = [engine for engine in ENGINES if not engine.through_time]
"""A simulation through time takes longer than all of them; `validation run --against accepted` asks it too."""


def test_nothing_got_worse_since_the_accepted_state() -> None:
    left_out = {engine.name for engine in ENGINES} - {engine.name for engine in EXACT}
    record, accepted = read_run(find_baseline(ACCEPTED))
    kept = [row for row in accepted if row.engine not in left_out]
    rows = [row for scene in SCENES for row in judge(*scene, EXACT).rows]
    found = compare_rows((record, kept), (describe_run((), "models"), rows))
    assert {row.engine for row in kept} == {"formulas", *(engine.name for engine in EXACT)}
    assert not found.regressed, render.write_text(found)


@pytest.mark.parametrize("turns", [0, 800])
def test_a_row_states_the_condition_that_its_allowance_comes_from(turns: int) -> None:
    """By which a move is distinguished from round-off: one limit position has 7 digits, the next 13."""
    name, scene = next((name, scene) for name, scene in SCENES if name == "triple_rocker")
    if turns:
        motion = scene.motion.replace(angle=np.array([2.0, 3.0]) + turns * 2.0 * np.pi)
        scene = replace(scene, motion=motion)
    apart = {"torque_error", "force_error", "undecided", "status"}  # bars against their errors, and counts
    rows = [row for row in judge(name, scene, EXACT).rows if row.allowed > 0.0 and row.quantity not in apart]
    assert {"closure", "moment_sum", "F12", "limit_positions", "transmission"} <= {row.quantity for row in rows}
    assert all(row.passed for row in rows)
    for row in rows:
        if row.verdict == DEGRADED:  # held to what is computed for the position: no law in the condition
            continue
        assert row.condition == pytest.approx(min(1.0, K * EPS / row.allowed), rel=1e-9), row
