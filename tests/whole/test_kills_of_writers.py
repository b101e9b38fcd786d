"""Whatever is killed while it writes leaves what was there, or what is new.

`accept`, `collect` and a save of the workbench run in a process of their own, which is
killed at random moments after its first file appears; its files are looked at from
outside. KILLS states how often.
"""

import os
import signal
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import fourbar
from fourbar.edit.session import Session
from fourbar.errors import HOLDS, InputError
from fourbar_validation.cli import status
from fourbar_validation.regression.record import open_run
from fourbar_validation.run import plan
from tests.support.here import judge_here
from tests.support.runs import HERE, read_run, save_run

pytestmark = [pytest.mark.slow, pytest.mark.posix]
KILLS = int(os.environ.get("KILLS", "3"))
SEED = 11
LONGEST = 60.0
"""s until something is written."""
DRAFT = ".*.part"
"""Hidden files that a killed process may leave: nothing reads them."""
MODELS = Path(__file__).parents[2] / "models"


def kill_while(write, seen, after):
    """Kill a process some seconds after `seen`; return whether it was still running."""
    child = os.fork()
    if child == 0:
        with suppress(BaseException):
            write()
        os._exit(0)
    deadline = time.monotonic() + LONGEST
    while not seen() and time.monotonic() < deadline:
        if os.waitpid(child, os.WNOHANG)[0]:
            return False
    time.sleep(after)
    os.kill(child, signal.SIGKILL)
    return os.WIFSIGNALED(os.waitpid(child, 0)[1])


def stamp(folder):
    """List the files of a folder with the times at which they changed."""
    stamps = []
    for path in folder.glob("*"):
        with suppress(FileNotFoundError):
            stamps.append((path.name, path.stat().st_mtime_ns))
    return sorted(stamps)


def changes(folder):
    before = stamp(folder)
    return lambda: stamp(folder) != before


def test_a_killed_accept_leaves_one_accepted_state_and_is_completed_by_another(
    tmp_path,
):
    _, rows = read_run(
        MODELS.parent / "validation/fourbar_validation/regression/accepted"
    )
    rows = [row for row in rows if not row.failed]
    runs = []
    for number in range(2):
        about = replace(HERE, date=f"2026-01-0{number + 1}T00:00:00+00:00")
        times = "a,b,c,1,1.0,1.0\n" * (number + 1)
        errors = [replace(row, error=row.error / 2**number) for row in rows]
        runs.append(save_run(tmp_path / str(number), errors, times, about))
    target = tmp_path / "accepted"
    assert status(["accept", str(runs[0]), "--to", str(target)]) == HOLDS
    dates = [open_run(run).about.date for run in runs]
    rng = np.random.default_rng(SEED)
    killed = 0
    for kill in range(KILLS):
        number = (kill + 1) % 2
        line = ["accept", str(runs[number]), "--to", str(target)]
        after = float(rng.uniform(0.0, 0.03))
        killed += kill_while(lambda line=line: status(line), changes(target), after)
        with suppress(InputError):  # a table that its record does not describe
            assert open_run(target).about.date in dates
        assert status(line) == HOLDS
        assert open_run(target).about.date == dates[number]
        assert open_run(target).verified
    assert killed
    left = {path.name for path in target.iterdir() if not path.match(DRAFT)}
    assert left <= {"results.csv", "timings.csv", "record.json", "history.parquet"}


def test_a_killed_collect_is_done_again_with_the_same_bytes(tmp_path, monkeypatch):
    judge_here(monkeypatch)
    monkeypatch.setattr(plan, "SCENES_OF_A_QUICK_TASK", 2)
    options = ["--random", "8", "--engines", "free-body", "--no-pictures"]
    folders = [str(tmp_path / str(k)) for k in (1, 2)]
    for k, folder in enumerate(folders, 1):
        line = ["run", *options, "--part", f"{k}/2", "-o", folder]
        assert status(line) == HOLDS
    whole = tmp_path / "whole"
    assert status(["collect", *folders, "-o", str(whole)]) == HOLDS
    rng = np.random.default_rng(SEED)
    out = tmp_path / "out"
    out.mkdir()
    killed = 0
    for _ in range(KILLS):
        line = ["collect", *folders, "-o", str(out)]
        after = float(rng.uniform(0.0, 0.3))
        killed += kill_while(lambda line=line: status(line), changes(out), after)
        assert status(line) == HOLDS
        for name in ("results.csv", "results.parquet"):
            assert (out / name).read_bytes() == (whole / name).read_bytes()
        assert {path.name for path in out.iterdir()} == {
            path.name for path in whole.iterdir()
        }
    assert killed


def test_a_killed_workbench_leaves_a_whole_scene_file(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_bytes((MODELS / "crank_rocker.toml").read_bytes())
    texts = {path.read_text(encoding="utf-8")}
    lengths = ["101 mm", "102 mm"]
    session = Session(path, tmp_path / "exports")
    for length in lengths:
        session.do({"do": "set", "path": ["lengths", "input"], "value": length})
        texts.add(session.now.text)

    def save():
        of_child = Session(path, tmp_path / "exports")
        for number in range(10_000):
            value = lengths[number % 2]
            of_child.do({"do": "set", "path": ["lengths", "input"], "value": value})
            of_child.do({"do": "save", "over": True})

    rng = np.random.default_rng(SEED)
    for _ in range(KILLS):
        assert kill_while(save, changes(tmp_path), float(rng.uniform(0.0, 0.2)))
        assert path.read_text(encoding="utf-8") in texts
        assert fourbar.load(path).linkage.input.length in (0.1, 0.101, 0.102)
