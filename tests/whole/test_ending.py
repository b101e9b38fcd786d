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
from pathlib import Path

import numpy as np
import pytest

from fourbar.errors import INTERRUPTED
from tests.support.guests import list_processes

ROOT = Path(__file__).parents[2]
LOAD = os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0
BUSY = max(1.0, LOAD / (os.cpu_count() or 1))
"""Factor of time on cores that others use too."""
PATIENCE = 8.0 * BUSY
"""Seconds after which nothing may be left, as SECURITY.md promises."""
ENDLESS_MJCF = """<mujoco><worldbody><replicate count="20000" offset="0.1 0 0">
<body><joint/><geom size="0.1"/></body></replicate></worldbody></mujoco>"""
"""Bodies that MuJoCo compiles for minutes, in little memory."""
HELLO = json.dumps(
    {
        "id": 1,
        "engine": "busy",
        "answers": ["theta_3"],
        "effects": ["gravity", "loads"],
    }
)
BUSY_GUEST = f"""
import os, sys
sys.stdin.readline()
print({HELLO!r}, flush=True)
sys.stdin.readline()
while True:
    pass
"""
READING = "loops"
GUEST = "guest"
STARTING = b"spawn_main"
"""Word in the command line of a process that `multiprocessing` starts."""
START_SECONDS = 1.0
"""What a worker takes until it is at work, on an idle machine."""
KILLS = int(os.environ.get("KILLS", "1"))
"""Moments of a start at which it is interrupted; every night there are fifty."""


def start(what, folder, mark):
    """Start a command that would take minutes, with a mark in its environment."""
    harness = [sys.executable, "-m", "validation"]
    if what == READING:
        file = folder / "endless.xml"
        file.write_text(ENDLESS_MJCF)
        line = [*harness, "loops", str(file)]
    else:
        guest = folder / "busy.py"
        guest.write_text(BUSY_GUEST)
        scene = str(ROOT / "models" / "crank_rocker.toml")
        program = f"{sys.executable} -I -S {guest}"
        line = [*harness, "run", scene, "--guest", program, "--engines", "free-body"]
        line += ["--no-pictures", "--workers", "1", "--out", str(folder / "out")]
    return subprocess.Popen(
        line,
        cwd=ROOT,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        env={**os.environ, "MARK_OF_A_TEST": mark},
        start_new_session=True,
    )


def wait_for_process(word, mark):
    """Wait until a process runs that has the word in its command line."""
    for _ in range(3000):
        for process in list_processes(mark):
            line = Path(f"/proc/{process}/cmdline").read_bytes()
            # the harness's own line names the guest too
            if word in line and b"validation" not in line:
                return
        time.sleep(0.01)
    raise AssertionError("nothing was started")


@contextmanager
def leaving_nothing(mark):
    """Hold that soon after the body no process has the mark."""
    try:
        yield
        until = time.monotonic() + PATIENCE
        while list_processes(mark) and time.monotonic() < until:
            time.sleep(0.1)
        assert not list_processes(mark)
    finally:
        for left in list_processes(mark):
            os.kill(left, signal.SIGKILL)


@pytest.mark.slow
@pytest.mark.linux
@pytest.mark.usefixtures("interruptible")
@pytest.mark.timeout(120 + 10 * KILLS)
@pytest.mark.parametrize("what", [READING, GUEST])
def test_ctrl_c_while_workers_start_is_one_line(what, tmp_path):
    """A terminal sends it to all processes of the command."""
    for moment in START_SECONDS * (np.arange(KILLS) + 0.5) / KILLS:
        mark = f"{tmp_path}/{what}/{moment}"
        process = start(what, tmp_path, mark)
        with leaving_nothing(mark):
            wait_for_process(STARTING, mark)
            time.sleep(moment)
            os.killpg(process.pid, signal.SIGINT)
            _, errors = process.communicate(timeout=PATIENCE)
        assert errors.decode().strip() == "error: interrupted", moment
        assert process.returncode == INTERRUPTED


@pytest.mark.slow
@pytest.mark.linux
@pytest.mark.parametrize("ended_by", [signal.SIGTERM, signal.SIGKILL])
@pytest.mark.parametrize("what", [READING, GUEST])
def test_nothing_outlives_a_command_that_is_ended(what, ended_by, tmp_path):
    mark = f"{tmp_path}/{what}"
    process = start(what, tmp_path, mark)
    with leaving_nothing(mark):
        wait_for_process(STARTING if what == READING else b"busy.py", mark)
        time.sleep(START_SECONDS)
        process.send_signal(ended_by)
        _, errors = process.communicate(timeout=PATIENCE)
    if ended_by == signal.SIGTERM:
        assert process.returncode == INTERRUPTED
        # click ends the line of the terminal's ^C first
        assert errors.decode().strip() == "error: interrupted"


@pytest.mark.slow
@pytest.mark.posix
def test_processor_time_is_bounded_by_the_process_itself():
    spinning = (
        "from fourbar_validation.engines.processes import bound_processor_time\n"
        "bound_processor_time(0.1)\n"
        "while True: pass"
    )
    ended = subprocess.run(
        [sys.executable, "-c", spinning],
        timeout=60,
        check=False,
    )
    assert ended.returncode == -signal.SIGXCPU


@pytest.mark.slow
def test_a_worker_loads_no_library_of_windows():
    """The library starts a program, which outlives the worker or complains."""
    looking = (
        "from fourbar_validation.engines.processes import open_no_windows\n"
        "open_no_windows()\n"
        "import mujoco, sys\n"
        "sys.exit('glfw' in sys.modules)"
    )
    subprocess.run(
        [sys.executable, "-c", looking],
        timeout=60,
        check=True,
    )
