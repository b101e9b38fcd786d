"""The limits of speed.

Each is of a row that is measured, is reported with its reason, and costs the run.
"""

import math

import numpy as np
import pytest
from click.testing import CliRunner

from fourbar.errors import HOLDS
from fourbar.quantities import UNKNOWNS
from fourbar.solving import solve
from fourbar_lab import bench, contenders
from fourbar_lab.contenders import command_positions, make_example
from fourbar_lab.starts import measure_starts

ROUNDING = 1e-11
"""Relative to the largest of each unknown: a few hundred roundings."""


@pytest.fixture
def quick(monkeypatch):
    """Counts at which the times mean nothing, but everything runs."""
    monkeypatch.setattr(bench, "import_cost", lambda: 0.5)
    monkeypatch.setattr(bench, "measure_starts", lambda: measure_starts(1))
    for name, count in (("LEAST_POSITIONS", 1), ("MOST_LOOPED", 10)):
        monkeypatch.setattr(contenders, name, count)


@pytest.mark.slow
@pytest.mark.usefixtures("quick")
def test_every_limit_is_of_a_row_that_is_measured(tmp_path):
    measured = bench.measure_speed(1000, 10_000, 1)
    assert bench.SPEED_LIMITS.keys() - measured.not_run.keys() <= measured.rows.keys()
    numbers = [
        measured.rows,
        *measured.over_positions.values(),
        *measured.over_linkages.values(),
    ]
    assert all(
        math.isfinite(value) and value > 0.0
        for row in numbers
        for value in row.values()
    )
    assert set(measured.over_positions["NumPy"]) == {1000, 10_000}
    assert set(measured.over_linkages["study, NumPy"]) == {1, 10, 100, 1000}
    assert set(measured.over_linkages["one after the other"]) == {1, 10}
    contenders.draw_bench(
        measured.over_positions, measured.over_linkages, tmp_path / "bench.svg"
    )
    picture = (tmp_path / "bench.svg").read_text()
    assert picture.count('<g id="axes_') == 2 and picture.count('<g id="line2d_') > 15


@pytest.mark.slow
@pytest.mark.posix
@pytest.mark.timeout(600)
def test_commands_start_within_their_limits():
    """Two processes that follow one another share what else the machine does. What is
    beyond its limit after a few rounds is measured in more.
    """
    for rounds in (3, 7):
        beyond = {
            what: ratio
            for what, ratio in measure_starts(rounds).items()
            if not bench.SPEED_LIMITS[what].holds(ratio)
        }
        if not beyond:
            break
    assert not beyond


@pytest.mark.slow
def test_every_contender_finds_the_same_unknowns(monkeypatch):
    scene, command = make_example(), command_positions(500)
    solution = solve(scene, at=command)
    expected = np.concatenate(
        [np.atleast_2d(getattr(solution, name).T) for name in UNKNOWNS]
    )
    peers = contenders.collect_loops()
    assert {"NumPy", "C"} <= set(peers.here) or "C" in peers.not_run
    for name, loop in peers.here.items():
        out = np.full((15, 500), np.nan)
        loop(command.theta_2, out)
        off = out - expected
        off[:2] = np.remainder(off[:2] + np.pi, 2 * np.pi) - np.pi
        assert (
            np.abs(off).max(axis=1) <= ROUNDING * np.abs(expected).max(axis=1)
        ).all(), name


def test_more_positions_than_fit_are_evaluated_in_pieces(monkeypatch):
    monkeypatch.setattr(contenders, "POSITIONS_OF_ONE_CALL", 1000)
    monkeypatch.setattr(contenders, "LEAST_POSITIONS", 1)
    sizes = []
    times = contenders.time_positions(
        {"it": lambda theta_2, out: sizes.append(len(theta_2))}, 10_000, 1
    )
    assert set(times["it"]) == {1000, 10_000} and sizes == [1000] * (2 + 2 * 10)


def test_what_is_missing_is_named_with_its_reason(monkeypatch):
    monkeypatch.setenv("PATH", "")
    peers = contenders.collect_loops()
    assert set(peers.here) == {"NumPy"} and set(peers.not_run) == {"C"}
    rows = {"growth from 1000 positions on": 1.0}
    monkeypatch.setattr(
        bench, "measure_speed", lambda *_: bench.Measured(rows, {}, {}, peers.not_run)
    )
    for variable in bench.ONE_THREAD:
        monkeypatch.setenv(variable, "1")
    process = CliRunner().invoke(bench.bench, standalone_mode=False)
    assert (
        process.return_value == HOLDS
        and "not run: C: no C compiler is installed\n" in process.output
    )


@pytest.mark.parametrize("name", bench.SPEED_LIMITS)
@pytest.mark.parametrize("spoiled", [math.nan, "beyond", None])
def test_what_is_beyond_its_limit_fails_with_the_reason(name, spoiled, monkeypatch):
    rows = {what: limit.bound for what, limit in bench.SPEED_LIMITS.items()} | {
        "all, 1000 positions": 100.0
    }
    limit = bench.SPEED_LIMITS[name]
    if spoiled is not None:
        rows[name] = (
            math.nan
            if spoiled != "beyond"
            else limit.bound * (0.99 if limit.sign == ">=" else 1.01)
        )
    monkeypatch.setattr(
        bench, "measure_speed", lambda *_: bench.Measured(rows, {}, {}, {})
    )
    for variable in bench.ONE_THREAD:
        monkeypatch.setenv(variable, "1")
    process = CliRunner().invoke(bench.bench, standalone_mode=False)
    assert process.return_value == (0 if spoiled is None else 1)
    assert (f"fails: {name}: {limit.reason}" in process.output) == (spoiled is not None)
