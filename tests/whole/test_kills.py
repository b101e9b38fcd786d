"""Nothing is lost.

Whatever dies, finished scenes stay, and a rerun ends with the same bytes.
"""

import filecmp
import math
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from pytest import fixture, mark, raises

from fourbar.errors import BROKEN, HOLDS, INTERRUPTED, InputError
from fourbar_validation.cli import status
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.results_file import read_columns
from fourbar_validation.compare.rows import FAILS, REFUSES, Row
from fourbar_validation.compare.tolerance import EQUIVALENCE
from fourbar_validation.engines import workers
from fourbar_validation.engines.environments import choose_engines
from fourbar_validation.engines.registry import Engine
from fourbar_validation.report.machine import hash_modules
from fourbar_validation.report.scene_record import Record
from fourbar_validation.run import run as plan_module
from fourbar_validation.run.run import COLLECTING, Plan, run
from fourbar_validation.run.store import Store
from fourbar_validation.scenes.random import DrawnType
from fourbar_validation.scenes.suites import (
    AS_LONG_AS,
    MOST_POSITIONS_OF_A_SCENE,
    Files,
    Random,
    read_scene_files,
)
from tests.support.checkout import BUSY, ROOT, wait_until
from tests.support.guests import end_guests, list_processes, write_program
from tests.support.here import Heard, judge_here
from tests.support.texts import LENGTHS
from tests.support.unlucky import Few, Moody, Unlucky, dies_at_first, start_and_sleep

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
"""Scenes of a run, none of them drawn, and those of a task."""
SMALL = (
    "import fourbar_validation.run.run as plan; plan.SCENES_OF_A_QUICK_TASK ="
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
    run(Plan(suite, engines, workers=workers, drawn=False), out, heard)
    assert heard.scenes[COLLECTING] == len(suite)
    return list(read_columns(out / "results.csv"))


@mark.slow
@mark.timeout(300)  # every new worker imports the harness again
def test_an_engine_that_crashes_or_hangs_costs_its_own_rows(tmp_path, monkeypatch):
    for size in ("SCENES_OF_A_SLOW_TASK", "SCENES_OF_A_QUICK_TASK"):
        monkeypatch.setattr(f"fourbar_validation.run.run.{size}", 2)
    moody = Engine("moody", Moody, EQUIVALENCE)
    # s; a busy machine is given longer
    monkeypatch.setattr(workers, "SCENE_SECONDS", 2.0 * BUSY)
    rows = judge_all(Few(), tmp_path / "run", (*EXACT, moody))
    failing = {
        (row.scene, row.engine): row.reason for row in rows if row.verdict == FAILS
    }
    assert failing.keys() == {("b", "moody"), ("c", "moody")}
    assert "crashed" in failing["b", "moody"] and "hung" in failing["c", "moody"]
    assert {row.scene for row in rows if row.engine == "free-body"} == {*"abcd"}


@fixture
def give_lives(tmp_path, monkeypatch):
    """Gives so many lives, each of which costs a worker its own."""

    def give(count):
        (tmp_path / "lives").mkdir()
        for life in range(count):
            (tmp_path / "lives" / str(life)).touch()
        monkeypatch.setenv("LIVES", str(tmp_path / "lives"))
        return tmp_path / "lives"

    return give


@mark.slow
@mark.posix
@mark.parametrize("kills, blamed", [(1, False), (KILLS_OF_BLAME, True)])
def test_a_worker_killed_once_is_not_held_against_the_engine(
    tmp_path, give_lives, kills, blamed
):
    """One that kills its worker each time is: in the scene, and by itself."""
    lives = give_lives(kills)
    unlucky = Engine("unlucky", Unlucky, EQUIVALENCE)
    rows = judge_all(Few(("a",)), tmp_path / "run", (*EXACT, unlucky), workers=1)
    assert [row.engine for row in rows if row.verdict == FAILS] == ["unlucky"] * blamed
    assert {"formulas", "free-body", "unlucky"} <= {row.engine for row in rows}
    assert not any(lives.iterdir())


@mark.slow
def test_workers_that_die_with_nothing_to_do_end_the_run_which_can_be_resumed(
    tmp_path, monkeypatch, give_lives
):
    give_lives(1)
    with monkeypatch.context() as dying:
        dying.setattr(workers, "prepare_worker", dies_at_first)
        with raises(workers.NoWorkersError, match="what is finished is kept"):
            judge_all(Few(), tmp_path / "run", workers=1)
    assert not (tmp_path / "run" / "results.csv").exists()
    rows = judge_all(Few(), tmp_path / "run", workers=1)
    assert rows and FAILS not in {row.verdict for row in rows}


@mark.slow
def test_a_clock_that_jumps_forward_ends_nothing(tmp_path, monkeypatch):
    """As that of a machine does which slept while an item was worked at."""
    starts = tmp_path / "starts"

    def now():
        return time.time() + 1e6 * starts.exists()

    clock = SimpleNamespace(time=now, sleep=time.sleep)
    monkeypatch.setattr("pebble.pool.process.time", clock)
    judging = {"seconds": workers.SCENE_SECONDS, "instead": lambda _, error, __: error}
    results = workers.apply_over_processes(
        start_and_sleep, [(0, [starts])], 1, **judging
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


def test_a_record_is_read_from_its_part_as_it_was(tmp_path):
    errors = (math.nan, math.inf, REFUSES, "a limit", -0.0, 1e-300)
    record = Record("a", title="A", rows=[Row("a", "engine", "exact", "F12", *errors)])
    with Store(tmp_path, {}).held() as store:
        store.put(5, [record.kept_all()])
        (kept,) = store.read(5)
    assert repr(Record.restore(kept)) == repr(record)


LIMITED = (
    "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (60_000,"
    " resource.RLIM_INFINITY)); " + ("" if FULL else SMALL) + HARNESS
)
"""The harness on a disk that takes no file of more than 60 kB: the parts fit, the
results do not.
"""
VICTIMS = ("worker", "guest", "run") if Path("/proc/self").exists() else ("run",)
"""Processes that are killed in turn, as far as the system tells which they are."""


def words_of(out, guest):
    words = f"run --random {COUNT} --workers {2 if FULL else 1} --engines free-body"
    return [*words.split(), "--no-pictures", f"--guest={guest}", "--out", str(out)]


def runs(pid, word):
    """Return whether a process has a word in its line; one of them names its guest."""
    command = Path(f"/proc/{pid}/cmdline").read_bytes()
    return word in command and b"--guest" not in command


class Disturbed:
    """A run with a guest in one folder, started again and again."""

    def __init__(self, out, guest, sign):
        self.out, self.guest, self.sign = out, guest, sign
        self.rng = np.random.default_rng(SEED)

    @property
    def parts(self):
        return sorted(self.out.glob("parts/0*"))

    def start(self, *program, more=1, stderr=subprocess.DEVNULL):
        """Start the run, and wait until it has finished some tasks more."""
        wanted = len(self.parts) + more
        process = subprocess.Popen(
            [sys.executable, *(program or PROGRAM), *words_of(self.out, self.guest)],
            cwd=ROOT,
            stdout=subprocess.DEVNULL,
            stderr=stderr,
            start_new_session=True,
        )
        wait_until(
            lambda: len(self.parts) >= wanted or process.poll() is not None, 60.0
        )
        return process

    def kill(self, victim, process):
        """Kill one of those who take part at a random moment."""
        time.sleep(float(self.rng.uniform(0.0, 0.3)))
        while process.poll() is None:
            with suppress(OSError):  # it has just gone
                pid = self.rng.choice(self.list_victims(victim, process) or [0])
                if pid:
                    os.kill(int(pid), signal.SIGKILL)
                    return

    def list_victims(self, victim, process):
        if victim == "run":
            return [process.pid]
        if victim == "guest":
            return [pid for pid in list_processes(self.sign) if runs(pid, b"plain.py")]
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text()
        # those that judge: no zombie, nor Python's tracker of resources
        return [pid for pid in map(int, children.split()) if runs(pid, b"spawn_main")]

    def require_unfinished(self):
        """Hold that nothing passes for results; leave work for the next start."""
        assert not (self.out / "results.csv").exists()
        assert self.parts
        for part in self.parts[1:]:
            part.unlink()


@mark.slow
@mark.posix
@mark.usefixtures("interruptible")
@mark.timeout(200 + 120 * KILLS)
def test_whatever_disturbs_a_run_it_goes_on_and_ends_with_the_same_bytes(
    tmp_path, monkeypatch
):
    """A run is interrupted, its guest, a worker and itself are killed at random moments
    with questions left to ask, and it meets a full disk, all in one folder.
    """
    guest, expected = write_program(tmp_path, "plain"), tmp_path / "undisturbed"
    judge_here(monkeypatch)
    assert status(words_of(expected, guest)) == HOLDS
    end_guests()
    out, sign = tmp_path / "out", f"MARK_OF_TEST={tmp_path}"
    monkeypatch.setenv("MARK_OF_TEST", str(tmp_path))
    run = Disturbed(out, guest, sign)

    process = run.start()
    os.kill(process.pid, signal.SIGINT)
    assert process.wait(timeout=60) == INTERRUPTED
    assert not list(out.glob("**/*.part"))
    run.require_unfinished()

    for _ in range(KILLS):
        process = run.start()
        for victim in VICTIMS:
            if process.poll() is not None:  # its worker was killed when it had no task
                assert process.returncode == BROKEN
                process = run.start()
            run.kill(victim, process)
        process.wait(timeout=100)
        run.require_unfinished()

    process = run.start("-c", LIMITED, more=COUNT, stderr=subprocess.PIPE)
    printed = process.communicate(timeout=100)[1].decode()
    assert process.returncode == BROKEN and "Traceback" not in printed
    last = printed.strip().splitlines()[-1]
    assert last.startswith("error: ") and str(out / "results.") in last
    run.require_unfinished()

    process = run.start()
    run.kill(VICTIMS[0], process)
    if process.wait(timeout=100) != HOLDS:
        assert run.start(more=COUNT).wait(timeout=100) == HOLDS
    tables = ("results.csv", "results.parquet")
    assert filecmp.cmpfiles(out, expected, tables, shallow=False)[0] == [*tables]
    assert sorted(os.listdir(out)) == sorted(os.listdir(expected))
    wait_until(lambda: not (VICTIMS[1:] and list_processes(sign)), 30.0)


@mark.parametrize(
    "motion, key",
    [
        ('theta_2 = { from = "0 deg", to = "9 deg", steps = %d }', "motion.theta_2"),
        (
            'law = { time = ["0 s", "1 s"], theta_2 = ["0 deg", "9 deg"],'
            ' ends = "rest", steps = %d }',
            "motion.law",
        ),
        ('theta_2 = "1 deg"\nfree = { duration = "1 s", steps = %d }', "motion.free"),
    ],
)
def test_a_scene_of_too_many_positions_is_refused_before_anything_runs(
    motion, key, tmp_path
):
    path = tmp_path / "long.toml"
    path.write_text(f"{LENGTHS}[motion]\n{motion % (MOST_POSITIONS_OF_A_SCENE - 1)}\n")
    a_second = AS_LONG_AS if key == "motion.free" else 0
    assert read_scene_files([path]).positions == MOST_POSITIONS_OF_A_SCENE + a_second
    most = MOST_POSITIONS_OF_A_SCENE
    path.write_text(f"{LENGTHS}[motion]\n{motion % most}\n")
    words = rf"{key}.steps = {most}: must be below {most} in a run"
    with raises(InputError, match=words):
        read_scene_files([path])


def test_a_scene_of_many_positions_has_longer_before_it_counts_as_hanging():
    """One of fifty thousand needs minutes in the simulators."""
    one = plan_module.find_time_limit(Random(1, 0, TYPES), ())
    assert plan_module.find_time_limit(Files((), 50_000), ()) > 5.0 * one


class Blunders:
    """Breaks down in scene b, answers nothing in scene c, and declines elsewhere."""

    name = "blunders"
    asked_about_b = 0

    def answer(self, scene, command):
        if scene.title == "b":
            Blunders.asked_about_b += 1
            raise RuntimeError("no licence")
        return Answer(
            "blunders", "exact", refusal=None if scene.title == "c" else "declined"
        )


@mark.slow
def test_of_a_long_suite_what_fails_has_pictures_and_what_is_nearest_to_it(
    tmp_path, monkeypatch
):
    """Drawn at the end, without the engine that broke down.

    With --no-pictures not at all.
    """
    judge_here(monkeypatch)
    drawn = []
    judge = plan_module.judge_job

    def noting(job):
        drawn.extend([job.name] * job.draw)
        return judge(job)

    monkeypatch.setattr(plan_module, "judge_job", noting)
    for module in ("report.run_summary", "run.run"):
        monkeypatch.setattr(f"fourbar_validation.{module}.PICTURED", 3)
    monkeypatch.setattr("fourbar_validation.run.run.write_html", lambda *_, **__: "")
    blunders = Engine("blunders", Blunders, EQUIVALENCE)
    without = run(Plan(Few(), (*EXACT, blunders), drawn=False), tmp_path / "without")
    assert not drawn and not any(record.figure for record in without.shown)
    once = Blunders.asked_about_b
    last = run(Plan(Few(), (*EXACT, blunders)), tmp_path / "with")
    assert len(drawn) == 3 and {"b", "c"} < set(drawn)
    assert {record.name for record in last.shown if record.figure} == set(drawn)
    assert Blunders.asked_about_b == 2 * once
    tables = [tmp_path / name / "results.csv" for name in ("with", "without")]
    assert filecmp.cmp(*tables, shallow=False)
