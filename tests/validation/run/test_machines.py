"""Over the workers of a Dask scheduler: the same bytes, also when a worker is killed during the run."""

import gzip
import json
import os
import signal
import subprocess
import sys
import time
import warnings
import weakref
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

import fourbar_validation.run.run
from fourbar.errors import InputError
from fourbar_validation.compare.rows import FAILS
from fourbar_validation.engines import workers
from fourbar_validation.report.machine import name_code
from fourbar_validation.run import machines
from fourbar_validation.run.machines import ClusterError
from fourbar_validation.run.run import Progress, RunOptions, run
from fourbar_validation.scenes.suites import Random
from tests.support.here import judge_here
from tests.whole.test_kills import COUNT, EXACT, FULL, IN_A_CHUNK, KILLS, SEED, TYPES, judge_all

distributed = pytest.importorskip("distributed", reason="Dask is optional")
dask = pytest.importorskip("dask", reason="Dask is optional")
ROOT = Path(__file__).parents[3]
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


@pytest.mark.slow
@pytest.mark.posix
@pytest.mark.timeout(120 + 20 * KILLS)
def test_killed_workers_change_no_byte(cluster: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fourbar_validation.run.run, "CHUNK", {False: IN_A_CHUNK})
    suite = Random(COUNT, SEED, TYPES)
    with monkeypatch.context() as alone:
        judge_here(alone)
        judge_all(suite, tmp_path / "here")
    rng = np.random.default_rng(SEED)
    kills = 0

    class Killing(Progress):
        def advance(self, stage: str, scenes: int) -> None:
            nonlocal kills
            alive = [pid for nanny in cluster.workers.values() if (pid := running(nanny))]  # type: ignore[attr-defined]
            if scenes and alive and kills < KILLS:
                with suppress(ProcessLookupError):  # killed before, and its nanny has not noticed yet
                    os.kill(alive[int(rng.integers(len(alive)))], signal.SIGKILL)
                    kills += 1

    while kills < KILLS:
        out, before = tmp_path / f"dask{kills}", kills
        options = RunOptions(drawn=False, sample=0, scheduler=cluster.scheduler_address)  # type: ignore[attr-defined]
        run(suite, out, EXACT, options, progress=Killing())
        assert kills > before
        for name in ("results.csv", "results.parquet"):
            assert (tmp_path / "here" / name).read_bytes() == (out / name).read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "tls://127.0.0.1:1", "tcp://a..b:1", "nonsense"])
def test_no_scheduler_is_one_line_and_leaves_no_client_half_open(
    address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that is left closes when it is collected: in the thread of the next client, each waits for the other."""
    made = weakref.WeakSet()

    class Noted(distributed.Client):
        def __init__(self, *arguments: object, **options: object) -> None:
            made.add(self)
            super().__init__(*arguments, **options)

    monkeypatch.setattr(distributed, "Client", Noted)
    with dask.config.set({"distributed.comm.timeouts.connect": "1s"}), pytest.raises(InputError) as caught:
        run(Random(1, SEED, TYPES), tmp_path, EXACT, RunOptions(drawn=False, scheduler=address))
    assert "must be the address of a Dask scheduler" in str(caught.value) and "\n" not in str(caught.value)
    assert not made


def distributed_process(tmp_path: Path, what: str, *options: str, path: Path = ROOT) -> subprocess.Popen[bytes]:
    """A scheduler or worker that looks for its modules in a folder first."""
    line = [sys.executable, "-P", "-m", f"distributed.cli.dask_{what}", *options, "--no-dashboard"]
    line += ["--scheduler-file", str(tmp_path / "scheduler.json")]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, (path, path / "validation")))}
    return subprocess.Popen(
        line,
        cwd=tmp_path,
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


@pytest.fixture
def started(tmp_path: Path) -> Iterator[Callable[..., tuple[subprocess.Popen[bytes], str]]]:
    """Schedulers and workers in processes of their own; the process, and the address of the scheduler."""
    processes = []

    def start(what: str, *options: str, path: Path = ROOT) -> tuple[subprocess.Popen[bytes], str]:
        processes.append(distributed_process(tmp_path, what, *options, path=path))
        written = tmp_path / "scheduler.json"
        while not (written.is_file() and written.read_text()):
            assert processes[0].poll() is None
            time.sleep(0.1)
        return processes[-1], json.loads(written.read_text())["address"]

    yield start
    for process in processes:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


WORKER = ("--nthreads", "1", "--no-nanny")


@pytest.mark.slow
@pytest.mark.posix
def test_a_cluster_without_workers_or_without_the_checkout_is_one_line(
    started: Callable[..., tuple[subprocess.Popen[bytes], str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "bare").mkdir()
    (tmp_path / "bare" / "fourbar_validation.py").write_text("raise ModuleNotFoundError('no such module')")
    _, address = started("scheduler", "--host", "127.0.0.1", "--port", "0", path=tmp_path / "bare")
    suite, out = Random(1, SEED, TYPES), tmp_path / "out"
    with monkeypatch.context() as hurried, pytest.raises(workers.NoWorkersError, match="no workers; start some"):
        hurried.setattr(workers, "STALL", 0.5)
        run(suite, out, EXACT, RunOptions(drawn=False, scheduler=address))
    started("worker", *WORKER)
    with pytest.raises(ClusterError, match="PYTHONPATH") as caught:
        run(suite, out, EXACT, RunOptions(drawn=False, scheduler=address))
    assert "\n" not in str(caught.value) and "no such module" in str(caught.value)


@pytest.mark.slow
@pytest.mark.posix
@pytest.mark.parametrize("how", ["SIGKILL", "SIGTERM"] if FULL else ["SIGKILL"])
def test_a_lost_scheduler_ends_the_run_and_writes_nothing(
    how: str,
    started: Callable[..., tuple[subprocess.Popen[bytes], str]],
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
) -> None:
    scheduler, address = started("scheduler", "--host", "127.0.0.1", "--port", "0")
    started("worker", *WORKER)
    suite, judged = Random(100, SEED, TYPES), 0

    class Losing(Progress):
        def advance(self, stage: str, scenes: int) -> None:
            nonlocal judged
            judged += bool(scenes)
            if judged:
                scheduler.send_signal(getattr(signal, how))

    with pytest.raises(ClusterError, match="the scheduler is gone; what is finished is kept"):
        run(suite, tmp_path / "out", EXACT, RunOptions(drawn=False, scheduler=address), progress=Losing())
    assert not [each for each in caplog.records if each.exc_info]  # two tracebacks before the one line
    written = [path.read_bytes().partition(b"\n")[2] for path in (tmp_path / "out" / "parts").iterdir()]
    assert len(written) >= judged
    assert all(f'"{FAILS}"' not in gzip.decompress(part).decode() for part in written)


@pytest.mark.slow
def test_a_worker_of_another_code_or_library_is_refused(
    cluster: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(machines, "name_code", lambda: name_code() | {"numpy": "1.0"})
    with pytest.raises(ClusterError, match=r"not set up as this machine: numpy is [2-9]\S+ there and 1\.0 here"):
        options = RunOptions(drawn=False, scheduler=cluster.scheduler_address)  # type: ignore[attr-defined]
        run(Random(1, SEED, TYPES), tmp_path, EXACT, options)
