"""The page on many machines is run.

A Slurm array, a workflow's matrix and Dask judge parts, and no byte changes. A worker
is a machine here: it shares with the others what the page says that it shares.
"""

import filecmp
import importlib.util
import json
import os
import signal
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

from pytest import MonkeyPatch, fixture, mark

from fourbar.errors import HOLDS
from fourbar_validation.cli import status
from tests.support.checkout import ROOT, read, wait_until
from tests.support.here import judge_here

SCENES = 41
"""Scenes of the run: three tasks, the last of which has one scene."""
OPTIONS = ["--random", str(SCENES), "--engines", "free-body", "--no-pictures"]
TABLES = ("results.csv", "results.parquet")
PROGRAM = Path(sys.executable).with_name("fourbar-validation")
TIME = 240.0
"""s; what takes longer has failed."""

pytestmark = [mark.slow, mark.posix, mark.timeout(600)]


@fixture(scope="module")
def alone(tmp_path_factory):
    """The folder of the same run on one machine."""
    out = tmp_path_factory.mktemp("alone")
    with MonkeyPatch.context() as monkeypatch:
        judge_here(monkeypatch)
        assert status(["run", *OPTIONS, "--out", str(out)]) == HOLDS
    return out


def assert_same_bytes(out, alone):
    assert filecmp.cmpfiles(out, alone, TABLES, shallow=False)[0] == [*TABLES]


def run_shell(script, folder, options=(), **variables):
    """Run a script as a machine does that has the programs of this environment."""
    path = f"{PROGRAM.parent}{os.pathsep}{os.environ['PATH']}"
    subprocess.run(
        ["sh", "-e", "-c", script, "sh", *options],
        cwd=folder,
        env=os.environ | {"PATH": path} | variables,
        check=True,
        timeout=TIME,
    )


def test_a_slurm_array_changes_no_byte(alone, tmp_path):
    """One task is killed in the middle, and submitted again."""

    def submit(task, tasks, **variables):
        of_slurm = {"SLURM_ARRAY_TASK_ID": task, "SLURM_ARRAY_TASK_COUNT": tasks}
        variables |= of_slurm | {"SLURM_CPUS_PER_TASK": "1"}
        run_shell(read("docs/ci/slurm.sh"), tmp_path, OPTIONS, **variables)

    submit("1", "2")
    submit("2", "2")
    (tmp_path / "parts" / "2" / "parts" / "000001").unlink()
    submit("2", "1", PARTS="2")
    line = "fourbar-validation collect parts/* --out results"
    assert line in read("docs/many-machines.md")
    run_shell(line, tmp_path)
    assert_same_bytes(tmp_path / "results", alone)


@contextmanager
def started(*line, folder):
    """Start a program of Dask, and end it."""
    process = subprocess.Popen(
        [sys.executable, "-m", "dask", *line],
        cwd=folder,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def wait_for(ready, process):
    """Wait for what a process makes while it runs; it must not have ended then."""
    wait_until(lambda: process.poll() is not None or ready(), TIME)
    assert process.poll() is None, "it has ended"


def has_address(scheduler):
    """Whether the file of a scheduler is there, whole."""
    return scheduler.exists() and scheduler.read_text().rstrip().endswith("}")


@mark.skipif(
    importlib.util.find_spec("distributed") is None,
    reason="not run: distributed is not installed: pip install distributed",
)
def test_a_dask_worker_that_dies_and_one_that_joins_change_no_byte(alone, tmp_path):
    scheduler = tmp_path / "scheduler.json"
    out = tmp_path / "parts"
    options = ("--scheduler-file", str(scheduler), "--no-dashboard")
    worker = ("worker", *options, "--nthreads", "1", "--no-nanny")
    with started("scheduler", *options, "--port", "0", folder=tmp_path) as serving:
        wait_for(lambda: has_address(scheduler), serving)
        address = json.loads(scheduler.read_text())["address"]
        with started(*worker, folder=tmp_path) as first:
            line = [str(ROOT / "docs/ci/dask_run.py"), address, "2", str(out), *OPTIONS]
            program = subprocess.Popen([sys.executable, *line], cwd=tmp_path)
            wait_for(lambda: any(out.glob("[0-9]")), program)
            first.send_signal(signal.SIGKILL)
            with started(*worker, folder=tmp_path):
                assert program.wait(TIME) == 0
    assert_same_bytes(out, alone)
