"""Whatever dies while it writes leaves what was there, or what is new.

`accept`, `collect` and a save of the workbench run in a process of their own, which
ends without a word just before or just after each file gets its name, in turn.
"""

import os
from contextlib import suppress
from dataclasses import replace
from itertools import count

from pytest import mark

import fourbar
from fourbar.edit.session import Session
from fourbar.errors import HOLDS, InputError
from fourbar_validation.cli import status
from fourbar_validation.regression.record import ACCEPTED, find_baseline, open_run
from tests.support.checkout import ROOT
from tests.support.runs import HERE, read_run, save_run

pytestmark = [mark.slow, mark.posix]
DRAFT = ".*.part"
"""Hidden files that a killed process may leave: nothing reads them."""
DIED = 77


def die_at_each_name(write):
    """Let a process die before and after it names its first file, its second, and so
    on; yield after each death, until all of them are written.
    """
    for death in count():
        child = os.fork()
        if child == 0:
            with suppress(BaseException):
                die_at(*divmod(death, 2))
                write()
            os._exit(HOLDS)
        ended = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        if ended == HOLDS:
            assert death > 1
            return
        assert ended == DIED
        yield


def die_at(number, named):
    """End this process when it names the file of a number, before or after that."""
    name_file, numbers = os.replace, count()

    def name_or_die(draft, target):
        last = next(numbers) == number
        if named or not last:
            name_file(draft, target)
        if last:
            os._exit(DIED)

    os.replace = name_or_die


def test_a_killed_accept_leaves_one_accepted_state_and_is_completed_by_another(
    tmp_path,
):
    _, rows = read_run(find_baseline(ACCEPTED))
    rows = [row for row in rows if not row.failed][:200]
    runs = []
    for number in range(2):
        about = replace(HERE, date=f"2026-01-0{number + 1}T00:00:00+00:00")
        times = "a,b,c,1,1.0,1.0\n" * (number + 1)
        errors = [replace(row, error=row.error / 2**number) for row in rows]
        runs.append(save_run(tmp_path / str(number), errors, times, about))
    first, second = (open_run(run).about.date for run in runs)
    target = tmp_path / "accepted"
    lines = [["accept", str(run), "--to", str(target)] for run in runs]
    assert status(lines[0]) == HOLDS
    for _ in die_at_each_name(lambda: status(lines[1])):
        with suppress(InputError):  # a table that its record does not describe
            assert open_run(target).about.date in (first, second)
        for line, date in zip(lines[::-1], (second, first), strict=True):
            assert status(line) == HOLDS
            assert open_run(target).about.date == date
            assert open_run(target).verified
    left = {path.name for path in target.iterdir() if not path.match(DRAFT)}
    assert left <= {"results.csv", "timings.csv", "record.json", "history.parquet"}


def test_a_killed_workbench_leaves_a_whole_scene_file(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_bytes((ROOT / "models/crank_rocker.toml").read_bytes())
    session = Session(path, tmp_path / "exports")
    session.do({"do": "set", "path": ["lengths", "input"], "value": "101 mm"})
    texts = {path.read_text("utf-8"), session.now.text}
    for _ in die_at_each_name(lambda: session.do({"do": "save", "over": True})):
        assert path.read_text("utf-8") in texts
        assert fourbar.load(path).linkage.input.length in (0.1, 0.101)
