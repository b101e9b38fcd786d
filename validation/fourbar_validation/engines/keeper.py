"""Run a program so that nothing of it outlives its end, or the end of the process that asked for it.

Called as `python -I -S keeper.py PARENT BYTES PROGRAM ARGUMENTS...`: PARENT is the process that asks, BYTES bounds the
data of each process. On Linux the keeper adopts what leaves the program's process group, and ends that too.
"""

import ctypes
import os
import resource
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

ADOPT_ORPHANS, DIE_WITH_PARENT = 36, 1
"""Options of prctl(2)."""
SECONDS = 0.5
"""Interval at which the keeper looks whether its parent lives."""


def call_prctl(option: int, value: int) -> None:
    """Call prctl(2), which only Linux has."""
    with suppress(AttributeError, OSError):
        ctypes.CDLL(None).prctl(option, value, 0, 0, 0)


def bound_memory(size: int) -> None:
    """Bound the data of each process, but no address space: libraries reserve more of that than they use."""
    for limit, wanted in (
        (resource.RLIMIT_AS, -1),
        (resource.RLIMIT_DATA, size),
        (resource.RLIMIT_CORE, 0),
    ):
        _, most = resource.getrlimit(limit)
        with suppress(ValueError, OSError):
            resource.setrlimit(
                limit,
                (
                    most if wanted < 0 else wanted if most < 0 else min(wanted, most),
                    most,
                ),
            )


def end_children(group: int) -> None:
    """End a process group, and every process that has become a child of this one."""
    with suppress(OSError):
        os.killpg(group, signal.SIGKILL)
    while True:
        with suppress(OSError):
            for child in (
                Path(f"/proc/self/task/{os.getpid()}/children")
                .read_text(encoding="ascii")
                .split()
            ):
                os.kill(int(child), signal.SIGKILL)
        try:
            os.waitpid(-1, 0)
        except ChildProcessError:
            return


def keep(child: int, parent: int) -> int:
    """Wait for a child, end what is left of it, and return its exit status; end with it once the parent is gone."""

    def look(*_: Any) -> None:
        if os.getppid() != parent:
            sys.exit(1)

    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    signal.signal(signal.SIGALRM, look)
    signal.setitimer(signal.ITIMER_REAL, SECONDS, SECONDS)
    try:
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        end_children(child)
    return status


def main(parent: int, size: int, command: list[str]) -> int:
    """Start the program below a second keeper: a program that kills its parent is ended by the first."""
    call_prctl(ADOPT_ORPHANS, 1)
    bound_memory(size)
    first = os.getpid()
    if second := os.fork():
        for stream in (0, 1, 2):
            os.close(stream)
        return keep(second, parent)
    call_prctl(ADOPT_ORPHANS, 1)
    os.setsid()
    try:
        program = subprocess.Popen(
            command,
            start_new_session=True,
            preexec_fn=lambda: call_prctl(DIE_WITH_PARENT, signal.SIGKILL),  # noqa: PLW1509 - there are no threads
        )
    except OSError as error:
        print(f"{command[0]}: {error.strerror}", file=sys.stderr)
        return 127
    for stream in (0, 1, 2):
        os.close(stream)
    return keep(program.pid, first)


if __name__ == "__main__":
    status = main(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3:])
    if status < 0:
        with suppress(OSError):
            signal.signal(-status, signal.SIG_DFL)
        os.kill(os.getpid(), -status)
    os._exit(status)
