"""The limits of speed.

Each is of a row that is measured, is reported with its reason, and costs the run.
"""

from functools import partial
from math import inf, nan, pi

import numpy as np
from click.testing import CliRunner
from pytest import mark

from fourbar.errors import FAILED, HOLDS
from fourbar.quantities import UNKNOWNS
from fourbar.solving import solve
from fourbar_lab import bench, contenders
from fourbar_lab.contenders import command_positions, make_example

ROUNDING = 1e-11
"""Relative to the largest of each unknown: a few hundred roundings."""


@mark.slow
def test_every_limit_is_of_a_row_that_is_measured(tmp_path, monkeypatch):
    """At counts at which the times mean nothing, but everything runs."""
    monkeypatch.setattr(bench, "measure_starts", partial(bench.measure_starts, 1))
    monkeypatch.setattr(contenders, "LEAST_POSITIONS", 1)
    monkeypatch.setattr(contenders, "MOST_LOOPED", 10)
    measured = bench.measure_speed(1000, 10_000, 1)
    assert bench.SPEED_LIMITS.keys() - measured.not_run.keys() <= measured.rows.keys()
    numbers = [
        measured.rows,
        *measured.over_positions.values(),
        *measured.over_linkages.values(),
    ]
    assert all(0.0 < value < inf for row in numbers for value in row.values())
    assert set(measured.over_positions["NumPy"]) == {1000, 10_000}
    assert set(measured.over_linkages["study, NumPy"]) == {1, 10, 100, 1000}
    assert set(measured.over_linkages["one after the other"]) == {1, 10}
    contenders.draw_bench(
        measured.over_positions, measured.over_linkages, tmp_path / "bench.svg"
    )
    picture = (tmp_path / "bench.svg").read_text()
    assert picture.count('<g id="axes_') == 2 and picture.count('<g id="line2d_') > 15


@mark.slow
@mark.posix
@mark.timeout(600)
def test_commands_start_within_their_limits():
    """Two processes that follow one another share what else the machine does. What is
    beyond its limit after a few rounds is measured in more.
    """
    for rounds in (3, 7):
        beyond = {
            what: ratio
            for what, ratio in bench.measure_starts(rounds).items()
            if not ratio <= bench.SPEED_LIMITS[what][0]
        }
        if not beyond:
            break
    assert not beyond


@mark.slow
def test_every_contender_finds_the_same_unknowns(monkeypatch):
    scene, command = make_example(), command_positions(500)
    solution = solve(scene, at=command)
    expected = np.concatenate(
        [np.atleast_2d(getattr(solution, name).T) for name in UNKNOWNS]
    )
    loops, not_run = contenders.collect_loops()
    assert {"NumPy", "C"} == {*loops, *not_run}
    for name, loop in loops.items():
        out = np.full((15, 500), nan)
        loop(command.theta_2, out)
        off = out - expected
        off[:2] = np.remainder(off[:2] + pi, 2 * pi) - pi
        assert (abs(off).max(axis=1) <= ROUNDING * abs(expected).max(axis=1)).all(), (
            name
        )


@mark.parametrize("name", bench.SPEED_LIMITS)
@mark.parametrize("factor", [nan, 1.01, 1.0])
def test_what_is_beyond_its_limit_fails_with_the_reason(name, factor, monkeypatch):
    rows = {what: most for what, (most, _) in bench.SPEED_LIMITS.items()}
    rows["all, 1000 positions"] = 100.0
    _, reason = bench.SPEED_LIMITS[name]
    rows[name] *= factor
    measured = bench.Measured(rows, {}, {}, {})
    monkeypatch.setattr(bench, "measure_speed", lambda *_: measured)
    for variable in bench.ONE_THREAD:
        monkeypatch.setenv(variable, "1")
    done = CliRunner().invoke(bench.bench, standalone_mode=False)
    assert done.return_value == (HOLDS if factor == 1.0 else FAILED)
    assert (f"fails: {name}: {reason}" in done.output) == (factor != 1.0)
