"""The compiled formulas: the digits of NumPy's, its statuses, and its promise of the error bars."""

import functools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fourbar import Bar, FourBar, Motion, Scene, Solution, Sweep, solve
from fourbar.effects import Flywheel, Friction, Gravity, Load, Viscous
from fourbar.errors import DependencyError
from fourbar.evaluation import blocks, compiled, compiled_case
from fourbar.evaluation.error_bars import EVALUATIONS
from fourbar.quantities import NOT_ASSEMBLED, OK
from fourbar.studies.study import vary
from fourbar_validation.lab.stress.forward_error.stability import run
from fourbar_validation.lab.stress.forward_error.tally import TOO_SMALL

pytest.importorskip("numba", reason="the formulas are compiled by numba: pip install numba")

DIGITS = 1e-13
"""Of the largest value: sums in another order, at positions whose condition is at least 1e-2."""
SCATTER = 4.0
"""Between two error bars from different roundings of the same numbers, each the mean of EVALUATIONS squares."""
LINK = FourBar(0.3, Bar(0.1, 0.2, 0.001, (0.04, 0.2)), Bar(0.25, 0.5), Bar(0.22, 0.4, None, (0.1, -0.3)), 0.4)
SWINGS = FourBar(0.3, Bar(0.25, 0.2), Bar(0.1, 0.5), Bar(0.22, 0.4))
LOADS = (
    Load(3, (10.0, 0.3), (0.05, 0.2)),
    Load(4, None, (0.0, 0.0), -0.15),
    Load(2, (3.0, 0.2), (0.01, 0.1), 0.2, "bar"),
)
EFFECTS = (Gravity(9.81, -1.5), Viscous.at(O2=0.01, A=0.02, B=0.03, O4=0.04), Flywheel(0.02, 4))


def scene(linkage: FourBar = LINK, drive: int = 2, effects: tuple[Any, ...] = EFFECTS) -> Scene:
    return Scene(linkage, Motion(Sweep(0.0, 6.2, 300), 3.0, 0.7), drive, LOADS, effects)


def assert_same(ours: Solution, theirs: Solution, names: list[str] | None = None) -> None:
    np.testing.assert_array_equal(ours.status_code, theirs.status_code)
    assert ours.evaluated() == theirs.evaluated()
    well = theirs.condition > 1e-2
    for name in names or ours.evaluated():
        one, other = getattr(ours, name), getattr(theirs, name)
        np.testing.assert_array_equal(np.isnan(one), np.isnan(other), err_msg=name)
        if not name.endswith("_error"):
            size = np.nanmax(np.abs(other[well]), initial=0.0)
            assert np.nanmax(np.abs(one - other)[well], initial=0.0) <= DIGITS * size, name


@pytest.mark.parametrize(("linkage", "drive"), [(LINK, 2), (LINK, 3), (LINK, 4), (SWINGS, 2)])
def test_a_scene_has_the_digits_and_statuses_of_numpy(linkage: FourBar, drive: int) -> None:
    whole = scene(linkage, drive)
    theirs = solve(whole, "error", compiled=False)
    ours = solve(whole, "error", compiled=True)
    assert_same(ours, theirs)
    assert OK in theirs.status_code and (NOT_ASSEMBLED in theirs.status_code) == (linkage is SWINGS)
    for name in ("torque_error", "force_error"):
        ratio = (getattr(ours, name) / getattr(theirs, name))[theirs.status_code == OK]
        assert not np.array_equal(ratio, np.ones_like(ratio)) and 1.0 / SCATTER < ratio.min() <= ratio.max() < SCATTER


def test_a_study_has_them_too_on_any_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    random, m = np.random.default_rng(1), 200
    given = {
        "lengths.input": random.uniform(-0.01, 0.3, m),
        "lengths.ground_angle": random.uniform(-1.0, 1.0, m),
        "bars.coupler.mass": random.uniform(0.0, 1.0, m),
        "loads.0.force.0": random.uniform(0.0, 5.0, m),
        "effects.viscous.A": random.uniform(0.0, 0.1, m),
        "motion.omega_2": random.uniform(-5.0, 5.0, m),
    }
    study = vary(replace(scene(), motion=Motion(np.array([0.2, 2.5, 4.0]), 3.0)), given)
    at_once = solve(study, compiled=True)
    assert len(np.unique(at_once.status_code)) == 3
    assert_same(at_once, solve(study, compiled=False))
    monkeypatch.setattr("fourbar.studies.study.BLOCK", 60)
    apart = solve(study, compiled=True)
    for name in apart.evaluated():
        np.testing.assert_array_equal(getattr(apart, name), getattr(at_once, name), err_msg=name)


def test_error_bars_keep_their_promise(monkeypatch: pytest.MonkeyPatch) -> None:
    quick = functools.partial(solve, compiled=True)
    monkeypatch.setattr("fourbar_validation.lab.stress.forward_error.stability.solve", quick)
    for family in ("random", "change_point", "tables"):
        tally = run(family, range(20))
        assert all(ratio <= 1.0 for ratio, _ in tally.worst.values())
        assert all(ratio <= TOO_SMALL for ratio in tally.too_small.values())


def test_what_it_does_not_carry_is_numpys_to_the_last_digit() -> None:
    for whole in (scene(effects=(Friction.at(B=0.05),)), scene(FourBar(0.3, Bar(0.1), Bar(0.3), Bar(0.1)))):
        one, other = solve(whole, compiled=True), solve(whole, compiled=False)
        for name in one.evaluated():
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


def test_small_work_is_left_to_numpy(monkeypatch: pytest.MonkeyPatch) -> None:
    used: list[bool] = []
    true = compiled_case.run_loop
    monkeypatch.setattr(compiled_case, "run_loop", lambda *given, **named: used.append(True) or true(*given, **named))
    solve(scene(), "error")
    assert not used
    monkeypatch.setattr(blocks, "WORTH_COMPILING", 301 * (EVALUATIONS + 1) - EVALUATIONS - 301)
    solve(scene())
    assert not used
    solve(scene(), "error")
    assert used


def test_without_numba_it_is_refused_only_where_it_is_wanted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(blocks, "find_spec", lambda name: None)
    monkeypatch.setattr(blocks, "WORTH_COMPILING", 1)
    assert set(solve(scene()).status) == {"ok"}
    with pytest.raises(DependencyError, match="pip install"):
        solve(scene(), compiled=True)


def test_a_place_that_cannot_be_written_costs_only_time(monkeypatch: pytest.MonkeyPatch) -> None:
    import numba

    def njit(function: Any, *, cache: bool, **options: Any) -> str:
        if cache:
            raise RuntimeError("cannot cache function: no locator available")
        return "compiled without a cache"

    monkeypatch.setattr(numba, "njit", njit)
    assert compiled.compile_loop.__wrapped__(compiled.run, False) == "compiled without a cache"
    monkeypatch.setattr(compiled, "compile_loop", compiled.compile_loop.__wrapped__)
    assert compiled.compile_loop(compiled.run) == "compiled without a cache"
