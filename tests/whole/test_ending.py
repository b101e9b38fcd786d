"""A command that is told to end ends with all that it started.

The process table is looked at from outside.
"""

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np
from pytest import mark

from fourbar.errors import INTERRUPTED
from tests.support.checkout import BUSY, ROOT, run_python, wait_until
from tests.support.guests import list_processes

pytestmark = mark.slow
PATIENCE = 8.0 * BUSY
"""Seconds after which nothing may be left, as SECURITY.md promises."""
ENDLESS_MJCF = """<mujoco><worldbody><replicate count="20000" offset="0.1 0 0">
<body><joint/><geom size="0.1"/></body></replicate></worldbody></mujoco>"""
"""Bodies that MuJoCo compiles for minutes, in little memory."""
ACTING = ["gravity", "loads"]
HELLO = {"id": 1, "engine": "busy", "answers": ["theta_3"], "effects": ACTING}
BUSY_GUEST = f"""
import os, sys
sys.stdin.readline()
print({json.dumps(HELLO)!r}, flush=True)
sys.stdin.readline()
while True:
    pass
"""
STARTING = b"spawn_main"
"""Word in the command line of a process that `multiprocessing` starts."""
START_SECONDS = 1.0
"""What a worker takes until it is at work, on an idle machine."""
KILLS = int(os.environ.get("KILLS", "1"))
"""Moments of a start at which it is interrupted; every night there are fifty."""


def start(what, folder, sign):
    """Start a command that would take minutes, with a mark in its environment."""
    harness = [sys.executable, "-m", "validation"]
    if what == "loops":
        file = folder / "endless.xml"
        file.write_text(ENDLESS_MJCF)
        line = [*harness, "loops", str(file)]
    else:
        guest = folder / "busy.py"
        guest.write_text(BUSY_GUEST)
        scene = str(ROOT / "models" / "crank_rocker.toml")
        program = f"{sys.executable} -I -S {guest}"
        options = "--engines free-body --no-pictures --workers 1"
        line = [*harness, "run", scene, *options.split(), "--guest", program]
        line += ["--out", str(folder / "out")]
    return subprocess.Popen(
        line,
        cwd=ROOT,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        env={**os.environ, "MARK_OF_A_TEST": sign},
        start_new_session=True,
    )


def has_process(word, sign):
    """Tell whether a process runs that has the word in its command line."""
    processes = list_processes(sign)
    lines = [Path(f"/proc/{process}/cmdline").read_bytes() for process in processes]
    # the harness's own line names the guest too
    return any(word in line and b"validation" not in line for line in lines)


@contextmanager
def leaving_nothing(sign):
    """Hold that soon after the body no process has the mark."""
    try:
        yield
        wait_until(lambda: not list_processes(sign), PATIENCE)
    finally:
        for left in list_processes(sign):
            os.kill(left, signal.SIGKILL)


@mark.linux
@mark.usefixtures("interruptible")
@mark.timeout(120 + 10 * KILLS)
@mark.parametrize("ended_by", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
@mark.parametrize("what", ["loops", "guest"])
def test_nothing_outlives_a_command_that_is_ended(what, ended_by, tmp_path):
    """A terminal sends SIGINT to all processes of the command, while workers start."""
    by_terminal = ended_by == signal.SIGINT
    moments = [START_SECONDS]
    if by_terminal:
        moments = START_SECONDS * (np.arange(KILLS) + 0.5) / KILLS
    for moment in moments:
        sign = f"{tmp_path}/{what}/{moment}"
        process = start(what, tmp_path, sign)
        with leaving_nothing(sign):
            started = STARTING if by_terminal or what == "loops" else b"busy.py"
            wait_until(partial(has_process, started, sign), 30.0 * BUSY)
            time.sleep(moment)
            (os.killpg if by_terminal else os.kill)(process.pid, ended_by)
            _, errors = process.communicate(timeout=PATIENCE)
        if ended_by != signal.SIGKILL:
            # click ends the line of the terminal's ^C first
            assert errors.decode().strip() == "error: interrupted", moment
            assert process.returncode == INTERRUPTED


@mark.posix
@mark.parametrize(
    "program, status",
    [
        ("bound_processor_time(0.1)\nwhile True: pass", -signal.SIGXCPU),
        # the library starts a program, which outlives the worker or complains
        ("open_no_windows()\nimport mujoco\nsys.exit('glfw' in sys.modules)", 0),
    ],
    ids=["processor time", "library of windows"],
)
def test_a_process_bounds_itself(program, status):
    name = program.partition("(")[0]
    line = f"import sys; from fourbar_validation.engines.programs import {name}\n"
    assert run_python("-c", line + program).returncode == status
