"""The benchmarks that asv runs over commits answer here too."""

import math
from itertools import product

from benchmarks import engines, formulas
from fourbar_validation.engines.registry import ENGINES


def test_the_benchmarks_judge_a_model_and_time_what_is_installed(monkeypatch):
    free_body = next(engine for engine in ENGINES if engine.name == "free-body")
    monkeypatch.setattr(engines, "ENGINES", (free_body,))
    monkeypatch.setattr(
        engines, "SCENES", {"crank_rocker": engines.SCENES["crank_rocker"]}
    )
    verdict = engines.Verdict()
    verdicts = verdict.setup_cache()
    assert (
        {engine for engine, _ in verdicts}
        == set(engines.BY_NAME)
        == set(verdict.params[0])
    )
    assert 0.0 < verdict.track_worst_error(verdicts, "free-body", "crank_rocker") < 1.0
    assert verdict.track_failing_rows(verdicts, "free-body", "crank_rocker") == 0
    assert math.isnan(
        verdict.track_failing_rows(verdicts, "mujoco-inverse", "crank_rocker")
    )  # not asked
    answer = engines.Answer()
    answer.setup("free-body", "crank_rocker")
    answer.time_answer("free-body", "crank_rocker")
    for positions, stage in product(
        formulas.Solve.params[0][:2], formulas.Solve.params[1]
    ):
        formulas.Solve().setup(positions, stage)
