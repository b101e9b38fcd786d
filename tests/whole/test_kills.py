"""Nothing is lost.

Whatever dies, finished scenes stay, and a rerun ends with the same bytes.
"""

import math
import os
import signal
import subprocess
import sys
import time
import tomllib
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest

import fourbar_validation.run.plan
from fourbar.errors import BROKEN, HOLDS, FourBarError, InputError
from fourbar_validation.cli import status
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.columns import read_columns
from fourbar_validation.compare.rows import FAILS, REFUSES, Row
from fourbar_validation.compare.tolerance import EQUIVALENCE
from fourbar_validation.engines import workers
from fourbar_validation.engines.registry import Engine
from fourbar_validation.engines.table import choose_engines
from fourbar_validation.report.machine import CODE, build, hash_modules
from fourbar_validation.report.record import Record
from fourbar_validation.run import pool
from fourbar_validation.run.plan import COLLECTING, Plan, RunOptions
from fourbar_validation.run.run import run
from fourbar_validation.run.store import Store
from fourbar_validation.scenes.random import DrawnType
from fourbar_validation.scenes.suites import (
    AS_LONG_AS,
    MOST_POSITIONS_OF_A_SCENE,
    Files,
    Random,
    read_scene_files,
)
from tests.support.guests import end_guests, list_processes, write_program
from tests.support.here import Heard, judge_here
from tests.support.unlucky import (
    Few,
    Moody,
    Unlucky,
    die_with_the_pipe,
    dies_at_first,
    start_and_sleep,
)

SEED = 7
KILLS = int(os.environ.get("KILLS", "1"))
"""Kills in each of the tests that kill; `make long-test` takes 50, and runs of full
size.
"""
FULL = "KILLS" in os.environ
KILLS_OF_BLAME = 4
"""Kills of one scene that an engine is blamed for: twice with the others, twice alone.
"""
COUNT, IN_A_TASK = (220, 20) if FULL else (30, 3)
"""Scenes of a run, none of them drawn, so that the work is the judging alone; and as
many tasks in a small run.
"""
SMALL = (
    "import fourbar_validation.run.plan as plan; plan.SCENES_OF_A_QUICK_TASK ="
    f" {IN_A_TASK}; "
)
HARNESS = (
    "import runpy; runpy.run_module('validation', run_name='__main__', alter_sys=True)"
)
PROGRAM = ("-m", "validation") if FULL else ("-c", SMALL + HARNESS)
TYPES = tuple(DrawnType)
EXACT = choose_engines("free-body")


def judge_all(suite, out, engines=EXACT, workers=2):
    heard = Heard()
    options = RunOptions(workers=workers, drawn=False)
    summary = run(Plan(suite, engines, options), out, heard)
    assert heard.scenes[COLLECTING] == len(suite)
    return summary


@pytest.mark.slow
@pytest.mark.timeout(
    300
)  # its hangs alone take half a minute, and every new worker imports the harness again
def test_an_engine_that_crashes_or_hangs_costs_its_own_rows(tmp_path, monkeypatch):
    for size in ("SCENES_OF_A_SLOW_TASK", "SCENES_OF_A_QUICK_TASK"):
        monkeypatch.setattr(fourbar_validation.run.plan, size, 2)
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0
    hangs = 2.0 * max(
        1.0, load / (os.cpu_count() or 1)
    )  # s; a busy machine is given longer
    moody = Engine("moody", Moody, EQUIVALENCE)
    monkeypatch.setattr(workers, "SCENE_SECONDS", hangs)
    judge_all(Few(), tmp_path / "run", (*EXACT, moody))
    rows = list(read_columns(tmp_path / "run" / "results.csv"))
    failing = {
        (row.scene, row.engine): row.reason for row in rows if row.verdict == FAILS
    }
    assert set(failing) == {("b", "moody"), ("c", "moody")}
    assert "crashed" in failing["b", "moody"]
    assert "hung" in failing["c", "moody"]
    for scene in "abcd":
        assert any(row.scene == scene and row.engine == "free-body" for row in rows)


@pytest.mark.slow
@pytest.mark.posix
@pytest.mark.parametrize(("kills", "blamed"), [(1, False), (KILLS_OF_BLAME, True)])
def test_a_worker_killed_once_is_not_held_against_the_engine(
    tmp_path, monkeypatch, kills, blamed
):
    """One that kills its worker each time is: in the scene, and by itself."""
    (tmp_path / "lives").mkdir()
    for life in range(kills):
        (tmp_path / "lives" / str(life)).touch()
    monkeypatch.setenv("LIVES", str(tmp_path / "lives"))
    unlucky = Engine("unlucky", Unlucky, EQUIVALENCE)
    judge_all(
        Few(("a",)),
        tmp_path / "run",
        (*EXACT, unlucky),
        workers=1,
    )
    rows = list(read_columns(tmp_path / "run" / "results.csv"))
    failing = [row.engine for row in rows if row.verdict == FAILS]
    assert failing == ["unlucky"] * blamed
    assert {"formulas", "free-body", "unlucky"} <= {row.engine for row in rows}
    assert not list((tmp_path / "lives").iterdir())


@pytest.mark.slow
def test_workers_that_die_with_nothing_to_do_end_the_run_which_can_be_resumed(
    tmp_path, monkeypatch
):
    (tmp_path / "lives").mkdir()
    (tmp_path / "lives" / "0").touch()
    monkeypatch.setenv("LIVES", str(tmp_path / "lives"))
    with monkeypatch.context() as dying:
        dying.setattr(workers, "prepare_worker", dies_at_first)
        with pytest.raises(workers.NoWorkersError, match="what is finished is kept"):
            judge_all(Few(), tmp_path / "run", workers=1)
    assert not (tmp_path / "run" / "results.csv").exists()
    assert judge_all(Few(), tmp_path / "run", workers=1).counts[FAILS] == 0


@pytest.mark.slow
@pytest.mark.posix
def test_a_worker_killed_with_the_lock_of_the_pipe_ends_the_run_within_seconds():
    """Nobody gives the lock back.

    The others must not wait for it as long as Pebble does, two minutes.
    """
    begin = time.monotonic()
    results = workers.apply_over_processes(
        die_with_the_pipe,
        [(0, [None])],
        1,
        seconds=None,
        instead=workers.fail,
    )
    with pytest.raises(workers.NoWorkersError, match="what is finished is kept"):
        list(results)
    assert time.monotonic() - begin < 60.0


@pytest.mark.slow
def test_a_clock_that_jumps_forward_ends_nothing(tmp_path, monkeypatch):
    """As that of a machine does which slept while an item was worked at."""
    starts = tmp_path / "starts"
    jump = 1e6

    def now():
        return time.time() + jump * starts.exists()

    clock = SimpleNamespace(time=now, sleep=time.sleep)
    monkeypatch.setattr("pebble.pool.process.time", clock)
    results = workers.apply_over_processes(
        start_and_sleep,
        [(0, [starts])],
        1,
        seconds=workers.SCENE_SECONDS,
        instead=workers.fail,
    )
    assert list(results) == [(0, ["done"])]
    assert len(starts.read_text().splitlines()) > 1


def test_random_scenes_depend_on_seed_and_index_alone():
    short, long = Random(3, SEED, TYPES), Random(30, SEED, TYPES)
    assert short.scene(2).linkage == long.scene(2).linkage
    assert short.scene(2).linkage != Random(3, SEED + 1, TYPES).scene(2).linkage
    names = [long.name(index) for index in range(len(long))]
    assert names == sorted(names)


def test_the_hash_of_the_code_is_that_of_its_modules(tmp_path):
    hashes = []
    for name, text in (
        ("fourbar/a.py", "1"),
        ("harness/b.py", "2"),
        ("harness/b.py", "3"),
        ("fourbar/a.txt", ""),
        ("harness/models/a.toml", ""),
    ):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
        hashes.append(hash_modules(tmp_path / "fourbar", tmp_path / "harness"))
    assert len(set(hashes)) == 3 and hashes[2] == hashes[3] == hashes[4]
    project = tomllib.loads(
        (Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8")
    )
    read = project["tool"]["setuptools"]["package-data"][
        "fourbar"
    ]  # what is only shown, and what only lists names, decides no number
    assert {
        Path(name).suffix
        for name in read
        if not name.startswith("show/") and name not in ("py.typed", "__init__.pyi")
    } <= set(CODE)
    assert build("numpy") and build("no-such-package") == ""


def test_a_record_is_read_from_its_part_as_it_was(tmp_path):
    errors = (math.nan, math.inf, REFUSES, "a limit", -0.0, 1e-300)
    record = Record(
        "a",
        title="A",
        rows=[Row("a", "engine", "exact", "F12", *errors)],
    )
    with Store(tmp_path, {}).held() as store:
        store.put(5, [record.kept_all()])
        (kept,) = store.read(5)
    assert repr(Record.restore(kept)) == repr(record)


LIMIT = (
    "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (60_000,"
    " resource.RLIM_INFINITY)); "
)
LIMITED = LIMIT + ("" if FULL else SMALL) + HARNESS
"""The harness on a disk that takes no file of more than 60 kB: the parts fit, the
results do not.
"""


def words_of(out, count, workers, more=()):
    words = f"run --random {count} --workers {workers} --engines free-body"
    return [*words.split(), "--no-pictures", "--out", str(out), *more]


def start(
    out, count, *program, workers=2 if FULL else 1, stderr=subprocess.DEVNULL, more=()
):
    return subprocess.Popen(
        [
            *(sys.executable, *(program or PROGRAM)),
            *words_of(out, count, workers, more),
        ],
        cwd=Path(__file__).parents[2],
        stdout=subprocess.DEVNULL,
        stderr=stderr,
        start_new_session=True,
    )


def assert_unfinished(out):
    """What ended the run left it without results and with parts to go on from."""
    assert not (out / "results.csv").exists()
    assert list(out.glob("parts/0*"))


def wait_for_parts(out, process, at_least):
    deadline = time.monotonic() + 60.0
    while (
        len(list(out.glob("parts/0*"))) < at_least
        and process.poll() is None
        and time.monotonic() < deadline
    ):
        time.sleep(0.01)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """The folder of a run that nothing disturbed, judged in this process."""
    out = tmp_path_factory.mktemp("undisturbed")
    with pytest.MonkeyPatch.context() as monkeypatch:
        judge_here(monkeypatch)
        judge_all(Random(COUNT, 0, TYPES), out)
    return out


@pytest.mark.slow
@pytest.mark.posix
@pytest.mark.usefixtures("interruptible")
@pytest.mark.timeout(120 + 20 * KILLS)
def test_whatever_ended_it_a_rerun_goes_on_and_ends_with_the_same_bytes(
    tmp_path, undisturbed
):
    """A run with one worker is interrupted, killed at random moments and met with a
    full disk, one after the other in one folder.
    """
    process = start(tmp_path, COUNT)
    wait_for_parts(tmp_path, process, at_least=1)
    os.kill(process.pid, signal.SIGINT)
    assert process.wait(timeout=60) == 130
    assert not list(tmp_path.glob("**/*.part"))
    assert_unfinished(tmp_path)

    rng = np.random.default_rng(SEED)
    tasks = len(range(0, COUNT, IN_A_TASK))
    for _ in range(KILLS):
        process = start(tmp_path, COUNT)
        wait_for_parts(tmp_path, process, at_least=int(rng.integers(1, tasks)))
        time.sleep(float(rng.uniform(0.0, 0.3)))
        assert process.poll() is None, "it ended before it was killed"
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        assert_unfinished(tmp_path)

    process = start(tmp_path, COUNT, "-c", LIMITED, stderr=subprocess.PIPE)
    _, printed = process.communicate(timeout=100)
    assert process.returncode == 3
    assert b"Traceback" not in printed
    last = printed.decode().strip().splitlines()[-1]
    assert last.startswith("error: ") and str(tmp_path / "results.") in last
    assert not (tmp_path / "results.csv").exists()

    assert start(tmp_path, COUNT).wait(timeout=100) == 0
    for name in ("results.csv", "results.parquet"):
        assert (tmp_path / name).read_bytes() == (undisturbed / name).read_bytes()
    assert {path.name for path in tmp_path.iterdir()} == {
        path.name for path in undisturbed.iterdir()
    }


def workers_of(process):
    """The processes that judge.

    No zombie of one that was killed, nor Python's tracker of resources.
    """
    try:
        children = (
            Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        )
        return [
            int(pid)
            for pid in children
            if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()
        ]
    except OSError:  # one of them has just gone
        return []


@pytest.mark.slow
@pytest.mark.linux
@pytest.mark.timeout(400 + 20 * KILLS)
def test_a_worker_killed_at_random_moments_changes_no_byte(tmp_path, undisturbed):
    rng = np.random.default_rng(SEED + 1)
    kills = runs = 0
    # a run is over after some ten of them, or before the first: another one takes the
    # rest
    while kills < KILLS:
        out, runs = tmp_path / str(runs), runs + 1
        process = start(out, COUNT, workers=2)
        while kills < KILLS and process.poll() is None:
            wait_for_parts(out, process, at_least=1)
            time.sleep(
                float(rng.uniform(0.0, 0.5))
            )  # a worker needs a moment to start again
            workers = workers_of(process)
            if workers:
                with suppress(ProcessLookupError):
                    os.kill(workers[int(rng.integers(len(workers)))], signal.SIGKILL)
                    kills += 1
        ended = process.wait(timeout=200)
        if ended == BROKEN:  # it was killed while none was at work
            ended = start(out, COUNT, workers=2).wait(timeout=100)
        assert ended == HOLDS
        assert (out / "results.csv").read_bytes() == (
            undisturbed / "results.csv"
        ).read_bytes()


def guests_of(mark, program):
    """The programs of guests among the processes with a mark.

    The run names them too.
    """
    guests = []
    for pid in list_processes(mark):
        with suppress(OSError):  # it has just gone
            command = Path(f"/proc/{pid}/cmdline").read_bytes()
            if program.encode() in command and b"--guest" not in command:
                guests.append(pid)
    return guests


@pytest.mark.slow
@pytest.mark.linux
@pytest.mark.timeout(200 + 120 * KILLS)
def test_a_guest_its_worker_and_its_run_killed_in_turn_change_no_byte(
    tmp_path, monkeypatch
):
    """Each is killed in the middle, with questions left to ask."""
    guest = [f"--guest={write_program(tmp_path, 'plain')}"]
    undisturbed = tmp_path / "undisturbed"
    with monkeypatch.context() as here:
        judge_here(here)
        assert status(words_of(undisturbed, COUNT, 1, guest)) == HOLDS
    end_guests()
    mark = f"MARK_OF_TEST={tmp_path}"
    monkeypatch.setenv("MARK_OF_TEST", str(tmp_path))
    for kill in range(KILLS):
        out = tmp_path / str(kill)
        process = start(out, COUNT, more=guest)
        for victim in ("guest", "worker", "run"):
            parts = len(list(out.glob("parts/0*")))
            wait_for_parts(out, process, at_least=parts + 1)
            victims = []
            while not victims and process.poll() is None:
                time.sleep(0.01)
                victims = {
                    "guest": guests_of(mark, "plain.py"),
                    "worker": workers_of(process),
                    "run": [process.pid],
                }[victim]
            if process.poll() == BROKEN:  # its worker was killed when it had no task
                break
            os.kill(victims[0], signal.SIGKILL)
        process.wait()
        assert_unfinished(out)
        assert start(out, COUNT, more=guest).wait(timeout=100) == 0
        expected, killed = (
            (folder / "results.csv").read_bytes() for folder in (undisturbed, out)
        )
        assert killed == expected
    latest = time.monotonic() + 30.0
    while list_processes(mark) and time.monotonic() < latest:
        time.sleep(0.1)
    assert not list_processes(mark)


@pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() == 0,
    reason="a folder that root may write to",
)
def test_a_read_only_folder_is_reported(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises((OSError, FourBarError)):
        judge_all(Few(), tmp_path / "run")


@pytest.mark.parametrize(
    ("motion", "key"),
    [
        ('theta_2 = { from = "0 deg", to = "9 deg", steps = %d }', "motion.theta_2"),
        (
            (
                'law = { time = ["0 s", "1 s"], theta_2 = ["0 deg", "9 deg"],'
                ' ends = "rest", steps = %d }'
            ),
            "motion.law",
        ),
        ('theta_2 = "1 deg"\nfree = { duration = "1 s", steps = %d }', "motion.free"),
    ],
)
def test_a_scene_of_too_many_positions_is_refused_before_anything_runs(
    motion, key, tmp_path
):
    lengths = (
        '[lengths]\nground = "4 m"\ninput = "1 m"\ncoupler = "3 m"\noutput = "3 m"\n'
    )
    masses = (
        '[bars.input]\nmass = "1 kg"\n[bars.coupler]\nmass = "1 kg"\n'
        '[bars.output]\nmass = "1 kg"\n'
    )
    path = tmp_path / "long.toml"
    path.write_text(
        f"{lengths}{masses}[motion]\n{motion % (MOST_POSITIONS_OF_A_SCENE - 1)}\n"
    )
    a_second = AS_LONG_AS if key == "motion.free" else 0
    assert read_scene_files([path]).positions == MOST_POSITIONS_OF_A_SCENE + a_second
    path.write_text(
        f"{lengths}{masses}[motion]\n{motion % MOST_POSITIONS_OF_A_SCENE}\n"
    )
    with pytest.raises(
        InputError,
        match=(
            rf"{key}.steps = {MOST_POSITIONS_OF_A_SCENE}: must be below"
            rf" {MOST_POSITIONS_OF_A_SCENE} in a run"
        ),
    ):
        read_scene_files([path])


def test_a_scene_of_many_positions_has_longer_before_it_counts_as_hanging():
    """One of fifty thousand needs minutes in the simulators."""
    one = pool.find_time_limit(Random(1, 0, TYPES), ())
    assert pool.find_time_limit(Files((), 50_000), ()) > 5.0 * one


class Blunders:
    """Breaks down in scene b, answers nothing in scene c, and declines elsewhere."""

    name = "blunders"
    titles: ClassVar[list[str]] = []

    def answer(self, scene, command):
        self.titles.append(scene.title)
        if scene.title == "b":
            raise RuntimeError("no licence")
        return Answer(
            "blunders",
            "exact",
            refusal=None if scene.title == "c" else "declined",
        )


@pytest.mark.slow
def test_of_a_long_suite_what_fails_has_pictures_and_what_is_nearest_to_it(
    tmp_path, monkeypatch
):
    """Drawn at the end, without the engine that broke down.

    With --no-pictures not at all.
    """
    judge_here(monkeypatch)
    drawn = []
    judge = pool.judge_job

    def noting(job):
        drawn.extend([job.name] * job.draw)
        return judge(job)

    monkeypatch.setattr(pool, "judge_job", noting)
    monkeypatch.setattr("fourbar_validation.report.summary.PICTURED", 3)
    monkeypatch.setattr(fourbar_validation.run.plan, "PICTURED", 3)
    monkeypatch.setattr(
        fourbar_validation.run.run,
        "write_html",
        lambda *_, **__: "",
    )
    blunders = Engine("blunders", Blunders, EQUIVALENCE)
    without = run(
        Plan(Few(), (*EXACT, blunders), RunOptions(drawn=False)), tmp_path / "without"
    )
    assert not drawn and not any(record.figure for record in without.shown)
    once = Blunders.titles.count("b")
    last = run(Plan(Few(), (*EXACT, blunders)), tmp_path / "with")
    assert len(drawn) == 3 and {"b", "c"} < set(drawn)
    assert {record.name for record in last.shown if record.figure} == set(drawn)
    assert Blunders.titles.count("b") == 2 * once
    assert (tmp_path / "with" / "results.csv").read_bytes() == (
        tmp_path / "without" / "results.csv"
    ).read_bytes()
