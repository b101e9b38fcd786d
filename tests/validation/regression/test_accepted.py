"""The accepted state is what the exact engines say of the scenes of a run, on any
machine.
"""

import numpy as np
from pytest import approx, mark

import fourbar
from fourbar_validation.compare.rows import DEGRADED
from fourbar_validation.compare.tolerance import EPS, K
from fourbar_validation.engines.registry import ENGINES
from fourbar_validation.places import MODELS
from fourbar_validation.regression import render
from fourbar_validation.regression.record import ACCEPTED, describe_run, find_baseline
from fourbar_validation.run.judge import judge
from fourbar_validation.scenes.suites import read_default_suite
from tests.support.here import EXACT
from tests.support.runs import compare_rows, read_run
from tests.support.scenes import recommand

SUITE = read_default_suite()


@mark.slow
def test_nothing_got_worse_since_the_accepted_state():
    """Of prescribed motions; a released one is simulated.

    A simulation through time takes longer than all exact engines: `validation run
    --against accepted` asks it too.
    """
    record, accepted = read_run(find_baseline(ACCEPTED))
    scenes = {SUITE.name(index): SUITE.scene(index) for index in range(len(SUITE))}
    assert {row.scene for row in accepted} == set(scenes)
    assert {row.engine for row in accepted} >= {
        "formulas",
        *(engine.name for engine in ENGINES),
    }
    prescribed = {
        name: scene for name, scene in scenes.items() if scene.motion.free is None
    }
    exact = {"formulas", *(engine.name for engine in EXACT)}
    kept = [row for row in accepted if row.engine in exact and row.scene in prescribed]
    rows = [
        row
        for name, scene in prescribed.items()
        for row in judge(name, scene, EXACT).rows
    ]
    differences = compare_rows((record, kept), (describe_run((), "models"), rows))
    assert not differences.regressed, render.write_differences(differences)


@mark.parametrize("turns", [0, 800])
def test_a_row_states_the_condition_that_its_allowance_comes_from(turns):
    """A move is distinguished from round-off by the condition."""
    name = "triple_rocker"
    scene = fourbar.load(MODELS / f"{name}.toml")
    if turns:
        scene = recommand(scene, angle=np.array([2.0, 3.0]) + turns * 2.0 * np.pi)
    # bars against their errors, and counts
    apart = {"torque_error", "force_error", "undecided", "status"}
    rows = [
        row
        for row in judge(name, scene, EXACT).rows
        if row.allowed > 0.0 and row.quantity not in apart
    ]
    assert {"closure", "moment_sum", "F12"} <= {row.quantity for row in rows}
    assert all(row.passed for row in rows)
    for row in rows:
        # what is degraded is held to what is computed for it: no law in the condition
        if row.verdict != DEGRADED:
            condition = min(1.0, K * EPS / row.allowed)
            assert row.condition == approx(condition, rel=1e-9), row
