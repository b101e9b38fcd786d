"""The page on many machines is run.

A Slurm array, a workflow's matrix and Dask judge parts, and no byte changes. A worker
is a machine here: it shares with the others what the page says that it shares.
"""

import importlib.util
import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path
from string import Template

import pytest

from fourbar.errors import HOLDS
from fourbar_validation.cli import status
from tests.support.here import judge_here

ROOT = Path(__file__).parents[2]
CI = ROOT / "docs" / "ci"
SCENES = 41
"""Scenes of the run: three tasks, the last of which has one scene."""
OPTIONS = ["--random", str(SCENES), "--engines", "free-body", "--no-pictures"]
TABLES = ("results.csv", "results.parquet")
PROGRAM = Path(sys.executable).with_name("fourbar-validation")
TIME = 240.0
"""s; what takes longer has failed."""

pytestmark = [pytest.mark.slow, pytest.mark.posix, pytest.mark.timeout(600)]


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """The folder of the same run on one machine."""
    out = tmp_path_factory.mktemp("alone")
    with pytest.MonkeyPatch.context() as monkeypatch:
        judge_here(monkeypatch)
        assert status(["run", *OPTIONS, "--out", str(out)]) == HOLDS
    return out


def assert_same_bytes(out, alone):
    for name in TABLES:
        assert (out / name).read_bytes() == (alone / name).read_bytes(), name


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


def collect_as_shown(folder):
    """Run the command that the page shows for collecting."""
    page = (ROOT / "docs" / "many-machines.md").read_text(encoding="utf-8")
    line = "fourbar-validation collect parts/* --out results"
    assert line in page
    run_shell(line, folder)
    return folder / "results"


def test_a_slurm_array_changes_no_byte(alone, tmp_path):
    """One task is killed in the middle, and submitted again."""
    script = (CI / "slurm.sh").read_text(encoding="utf-8")
    for task in (1, 2):
        of_slurm = {
            "SLURM_ARRAY_TASK_ID": str(task),
            "SLURM_ARRAY_TASK_COUNT": "2",
            "SLURM_CPUS_PER_TASK": "1",
        }
        run_shell(script, tmp_path, OPTIONS, **of_slurm)
    (tmp_path / "parts" / "2" / "parts" / "000001").unlink()
    run_shell(
        script,
        tmp_path,
        OPTIONS,
        SLURM_ARRAY_TASK_ID="2",
        SLURM_ARRAY_TASK_COUNT="1",
        SLURM_CPUS_PER_TASK="1",
        PARTS="2",
    )
    assert_same_bytes(collect_as_shown(tmp_path), alone)


def test_a_matrix_of_a_workflow_changes_no_byte(alone, tmp_path, monkeypatch):
    """Every machine has folders of its own; artefacts alone go from one to another.

    The first one is a shell, the others are this process.
    """
    workflow = (CI / "parts.yml").read_text(encoding="utf-8")
    (numbers,) = re.findall(r"part: \[(.*)\]", workflow)
    judge, collect = re.findall(
        r"- run: \.venv/bin/python -m validation ((?:run|collect) .*)", workflow
    )
    (options,) = re.findall(r"^  RUN: (.*)$", workflow, re.MULTILINE)
    assert {"--random", "--engines", "--no-pictures"} <= set(options.split())
    parts = numbers.split(", ")
    assert f"/{len(parts)}" in judge
    last = tmp_path / "last"
    judge_here(monkeypatch)
    for part in parts:
        machine = tmp_path / part
        machine.mkdir()
        variables = {"RUN": " ".join([*OPTIONS, "--workers", "1"]), "PART": part}
        if part == parts[0]:
            run_shell(f"fourbar-validation {judge}", machine, **variables)
        else:
            monkeypatch.chdir(machine)
            words = shlex.split(Template(judge).substitute(variables))
            assert status(words) == HOLDS
        monkeypatch.chdir(tmp_path)
        shutil.copytree(machine / "parts", last / "parts", dirs_exist_ok=True)
        shutil.rmtree(machine)
    run_shell(f"fourbar-validation {collect}", last)
    assert_same_bytes(last / "results", alone)


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
    latest = time.monotonic() + TIME
    while process.poll() is None and not ready():
        assert time.monotonic() < latest, "it takes too long"
        time.sleep(0.02)
    assert process.poll() is None, "it has ended"


def has_address(scheduler):
    """Whether the file of a scheduler is there, whole."""
    return scheduler.exists() and scheduler.read_text().rstrip().endswith("}")


@pytest.mark.skipif(
    importlib.util.find_spec("distributed") is None,
    reason="not run: distributed is not installed: pip install distributed",
)
def test_a_dask_worker_that_dies_and_one_that_joins_change_no_byte(alone, tmp_path):
    scheduler = tmp_path / "scheduler.json"
    worker = ("worker", "--scheduler-file", str(scheduler), "--nthreads", "1")
    worker = (*worker, "--no-nanny", "--no-dashboard")
    out = tmp_path / "parts"
    with started(
        *("scheduler", "--scheduler-file", str(scheduler), "--port", "0"),
        "--no-dashboard",
        folder=tmp_path,
    ) as serving:
        wait_for(lambda: has_address(scheduler), serving)
        address = json.loads(scheduler.read_text())["address"]
        with started(*worker, folder=tmp_path) as first:
            line = [str(CI / "dask_run.py"), address, "2", str(out), *OPTIONS]
            program = subprocess.Popen([sys.executable, *line], cwd=tmp_path)
            wait_for(lambda: any(out.glob("[0-9]")), program)
            first.send_signal(signal.SIGKILL)
            with started(*worker, folder=tmp_path):
                assert program.wait(TIME) == 0
    assert_same_bytes(out, alone)


@pytest.mark.skipif(
    importlib.util.find_spec("distributed") is None,
    reason="not run: distributed is not installed: pip install distributed",
)
def test_a_worker_with_other_code_judges_nothing():
    with pytest.raises(AssertionError, match="other versions or code"):
        load_dask_run().judge("1/1", {"code": "of yesterday"}, OPTIONS)


@pytest.mark.skipif(
    importlib.util.find_spec("distributed") is None,
    reason="not run: distributed is not installed: pip install distributed",
)
def test_a_part_whose_unpacking_is_interrupted_is_not_there(tmp_path, monkeypatch):
    program = load_dask_run()
    (tmp_path / "judged").mkdir()
    (tmp_path / "judged" / "results.csv").write_text("scene")
    archive = shutil.make_archive(str(tmp_path / "a"), "zip", tmp_path / "judged")
    packed = Path(archive).read_bytes()
    parts = tmp_path / "parts"
    parts.mkdir()

    def interrupted(archive, folder):
        folder.mkdir()
        raise KeyboardInterrupt

    with monkeypatch.context() as context:
        context.setattr(shutil, "unpack_archive", interrupted)
        with pytest.raises(KeyboardInterrupt):
            program.unpack(packed, parts / "1")
    assert not list(parts.iterdir())
    program.unpack(packed, parts / "1")
    assert [path.name for path in parts.rglob("*")] == ["1", "results.csv"]


def load_dask_run():
    """Import the program that the page on many machines shows."""
    spec = importlib.util.spec_from_file_location("dask_run", CI / "dask_run.py")
    assert spec is not None and spec.loader is not None
    program = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(program)
    return program
