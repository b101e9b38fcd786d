"""A command that is told to end ends with all that it started.

The process table is looked at from outside.
"""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from fourbar.errors import INTERRUPTED
from tests.support.guests import list_processes

ROOT = Path(__file__).parents[2]
PATIENCE = 8.0
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


def start(what: str, folder: Path, mark: str) -> "subprocess.Popen[bytes]":
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
    )


def wait_until_busy(what: str, mark: str) -> None:
    """Wait until the process that takes long has begun."""
    word = b"spawn_main" if what == READING else b"busy.py"
    for _ in range(600):
        for process in list_processes(mark):
            line = Path(f"/proc/{process}/cmdline").read_bytes()
            # the harness's own line names the guest too
            if word in line and b"validation" not in line:
                time.sleep(1.0)
                return
        time.sleep(0.05)
    raise AssertionError("nothing was started")


@pytest.mark.slow
@pytest.mark.linux
@pytest.mark.parametrize("ended_by", [signal.SIGTERM, signal.SIGKILL])
@pytest.mark.parametrize("what", [READING, GUEST])
def test_nothing_outlives_a_command_that_is_ended(
    what: str,
    ended_by: signal.Signals,
    tmp_path: Path,
) -> None:
    mark = f"{tmp_path}/{what}"
    process = start(what, tmp_path, mark)
    try:
        wait_until_busy(what, mark)
        process.send_signal(ended_by)
        _, errors = process.communicate(timeout=PATIENCE)
        until = time.monotonic() + PATIENCE
        while list_processes(mark) and time.monotonic() < until:
            time.sleep(0.1)
        assert not list_processes(mark)
    finally:
        for left in list_processes(mark):
            os.kill(left, signal.SIGKILL)
    if ended_by == signal.SIGTERM:
        assert process.returncode == INTERRUPTED
        # click ends the line of the terminal's ^C first
        assert errors.decode().strip() == "error: interrupted"


@pytest.mark.slow
@pytest.mark.posix
def test_processor_time_is_bounded_by_the_process_itself() -> None:
    spinning = (
        "from fourbar_validation.engines.processes import bound_processor_time\n"
        "bound_processor_time(0.1)\n"
        "while True: pass"
    )
    ended = subprocess.run([sys.executable, "-c", spinning], timeout=60, check=False)
    assert ended.returncode == -signal.SIGXCPU
