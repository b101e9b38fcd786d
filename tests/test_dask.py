"""Over the workers of a Dask scheduler: the same bytes, also when a worker is killed on the way."""

import os
import signal
import warnings
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.test_suite import COUNT, EXACT, SEED, TYPES, judge_all
from validation.report.summary import Summary
from validation.run import run
from validation.suite.scenes import Random

distributed = pytest.importorskip("distributed", reason="Dask is optional")
# Dask's own clean-up of killed workers is not what is tested here
pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")


@pytest.fixture(scope="module")
def cluster() -> Iterator[object]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        local = distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, host="127.0.0.1")
        with local:
            yield local


def test_a_killed_worker_changes_no_byte(cluster: object, tmp_path: Path) -> None:
    suite = Random(COUNT, SEED, TYPES)
    judge_all(suite, tmp_path / "here")
    pids = [worker.process.process.pid for worker in cluster.workers.values()]  # type: ignore[attr-defined]
    killed = False
    for step in run(suite, tmp_path / "dask", EXACT, scheduler=cluster.scheduler_address):  # type: ignore[attr-defined]
        if not isinstance(step, Summary) and step and not killed:
            os.kill(pids[0], signal.SIGKILL)
            killed = True
    assert killed
    for name in ("results.csv", "results.parquet"):
        assert (tmp_path / "here" / name).read_bytes() == (tmp_path / "dask" / name).read_bytes()
