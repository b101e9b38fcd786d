"""The limits of speed: each is of a row that is measured, is told with its reason, and costs the run."""

import math

import pytest
from click.testing import CliRunner

from validation import bench


def test_every_limit_is_of_a_row_that_is_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench, "import_cost", lambda: 0.5)
    rows = bench.measure(1000, 1, 1000)
    assert bench.LIMITS.keys() <= rows.keys()
    assert all(math.isfinite(value) and value > 0.0 for value in rows.values())


@pytest.mark.parametrize("name", bench.LIMITS)
@pytest.mark.parametrize("spoiled", [math.nan, "beyond", None])
def test_what_is_beyond_its_limit_fails_with_the_reason(
    name: str, spoiled: float | str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = {what: limit.bound for what, limit in bench.LIMITS.items()} | {"all, 1000 positions": 100.0}
    limit = bench.LIMITS[name]
    if spoiled is not None:
        rows[name] = math.nan if spoiled != "beyond" else limit.bound * (0.99 if limit.sign == ">=" else 1.01)
    monkeypatch.setattr(bench, "measure", lambda *_: rows)
    for variable in bench.ONE_THREAD:
        monkeypatch.setenv(variable, "1")
    result = CliRunner().invoke(bench.bench, standalone_mode=False)
    assert result.return_value == (0 if spoiled is None else 1)
    assert (f"fails: {name}: {limit.reason}" in result.output) == (spoiled is not None)
