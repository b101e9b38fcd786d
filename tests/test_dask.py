"""Over the workers of a Dask scheduler: the same bytes, also when a worker is killed during the run."""

import json
import os
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

import validation.run.run
from fourbar.errors import InputError
from tests.test_suite import COUNT, EXACT, IN_A_CHUNK, KILLS, SEED, TYPES, judge_all
from validation.report.summary import Summary
from validation.run import pool
from validation.run.run import run
from validation.scenes.suites import Random

distributed = pytest.importorskip("distributed", reason="Dask is optional")
dask = pytest.importorskip("dask", reason="Dask is optional")
ROOT = Path(__file__).parent.parent
# Dask's own clean-up of killed workers is not what is tested here
pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")


@pytest.fixture(scope="module")
def cluster() -> Iterator[object]:
    # else the cluster looks 15 s after a kill, and drops a worker for good that starts again at that moment
    patient = {"distributed.deploy.lost-worker-timeout": "1 hour"}
    with warnings.catch_warnings(), dask.config.set(patient):
        warnings.simplefilter("ignore")
        local = distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, host="127.0.0.1")
        with local:
            yield local


def running(nanny: object) -> int | None:
    """The process of a worker that is up: one that is killed while it starts is not started again by Dask."""
    watched = nanny.process  # type: ignore[attr-defined]
    if watched is None or watched.status.name != "running" or watched.process is None:
        return None
    return watched.process.pid


@pytest.mark.timeout(120 + 20 * KILLS)
def test_killed_workers_change_no_byte(cluster: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(validation.run.run, "SCENES_SHOWN", 0)
    monkeypatch.setattr(validation.run.run, "CHUNK", {False: IN_A_CHUNK})
    suite = Random(COUNT, SEED, TYPES)
    judge_all(suite, tmp_path / "here")
    rng = np.random.default_rng(SEED)
    kills = 0
    while kills < KILLS:
        out, before = tmp_path / f"dask{kills}", kills
        for step in run(suite, out, EXACT, scheduler=cluster.scheduler_address):  # type: ignore[attr-defined]
            alive = [pid for nanny in cluster.workers.values() if (pid := running(nanny))]  # type: ignore[attr-defined]
            if not isinstance(step, Summary) and step and alive and kills < KILLS:
                with suppress(ProcessLookupError):  # killed before, and its nanny has not noticed yet
                    os.kill(alive[int(rng.integers(len(alive)))], signal.SIGKILL)
                    kills += 1
        assert kills > before
        for name in ("results.csv", "results.parquet"):
            assert (tmp_path / "here" / name).read_bytes() == (out / name).read_bytes()


def test_a_worker_in_which_an_engine_hangs_ends_itself() -> None:
    code = (
        "from tests.unlucky import Few; from validation.run.pool import judge_watched; "
        "from validation.compare.tolerance import EQUIVALENCE; from validation.engines.witnesses import Witness; "
        "judge_watched(2.0, Few(), [2], [Witness('moody', 'tests.unlucky:Moody', EQUIVALENCE)], False)"
    )
    began = time.monotonic()
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, timeout=100, check=False, cwd=ROOT)
    assert done.returncode == 1 and b"Timeout" in done.stderr and b"answer" in done.stderr
    assert time.monotonic() - began < 100.0


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nonsense"])
def test_no_scheduler_is_one_line(address: str, tmp_path: Path) -> None:
    with dask.config.set({"distributed.comm.timeouts.connect": "1s"}), pytest.raises(InputError) as caught:
        list(run(Random(1, SEED, TYPES), tmp_path, EXACT, scheduler=address))
    assert "must be the address of a Dask scheduler" in str(caught.value) and "\n" not in str(caught.value)


def test_a_scheduler_without_workers_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A process of its own: a second event loop next to the cluster's may take long to start."""
    monkeypatch.setattr(pool, "STALL", 0.5)
    written = tmp_path / "scheduler.json"
    line = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0"]
    line += ["--no-dashboard", "--scheduler-file", str(written)]
    empty = subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        while not (written.is_file() and written.read_text()):
            assert empty.poll() is None
            time.sleep(0.1)
        address = json.loads(written.read_text())["address"]
        with pytest.raises(pool.NoWorkersError, match="no workers; start some"):
            list(run(Random(1, SEED, TYPES), tmp_path / "out", EXACT, scheduler=address))
    finally:
        empty.kill()
        empty.wait()
