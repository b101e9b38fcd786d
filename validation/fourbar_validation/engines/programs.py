"""Run other programs, to their end or question by question.

The memory of this process is bounded, and its output kept.
"""

import ctypes
import json
import math
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing import parent_process
from multiprocessing.resource_tracker import ensure_running
from pathlib import Path
from typing import IO, Any, NamedTuple

from fourbar.linkage import record
from fourbar_validation.compare.answer import EngineError
from fourbar_validation.compare.rows import (
    LONGEST_REASON,
    QUOTED,
    escape_controls,
    write_one_line,
)

WORKER_MEMORY = 8 * 2**30
"""Bytes of data of one process, a guest too; a scene takes a hundredth."""
ENDING_SECONDS = 5.0
"""Seconds for a program that is told to end; then it is killed."""
_KILLED = (-9, 137)
"""Exit status of a program that was killed: its own, or its shell's."""


def bound_memory(process: int = 0) -> None:
    """Bound the data of a process (0: this one) and of what it starts from now on.

    The address space is not bounded: libraries reserve more of that than they use.
    Only Linux has this limit; elsewhere nothing happens.
    """
    try:
        from resource import RLIMIT_DATA, prlimit
    except ImportError:
        return
    with suppress(
        ValueError, OSError
    ):  # a hard limit below it, or a process that ended
        _, hard = prlimit(process, RLIMIT_DATA)
        soft = WORKER_MEMORY if hard < 0 else min(WORKER_MEMORY, hard)
        prlimit(process, RLIMIT_DATA, (soft, hard))


_LIBC = ctypes.CDLL(None) if sys.platform == "linux" else None
"""Loaded before any fork, after which nothing may be loaded."""


def set_parent_death_signal() -> None:
    """Let Linux kill this process when its parent ends, whatever this process does.

    Only Linux has this signal; elsewhere nothing happens.
    """
    if _LIBC is not None:
        # the option of prctl(2) that sets the parent-death signal
        _LIBC.prctl(1, signal.SIGKILL)


def end_with_parent() -> None:
    """Let this process of `multiprocessing` end when its parent does.

    A thread sees on every system that the pipe from the parent closes. While a library
    holds the interpreter's lock the thread sees nothing; on Linux the parent-death
    signal ends the process all the same.
    """
    set_parent_death_signal()
    parent = parent_process()
    if parent is None:
        return

    def wait_for_end() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait_for_end, daemon=True).start()


def open_no_windows() -> None:
    """Let MuJoCo load no library of windows in this process, which draws nothing.

    The library starts a program of its own to ask for its version: this costs a tenth
    of a second, and a program that is killed midway complains on standard error.
    """
    os.environ["MUJOCO_GL"] = "disable"


@contextmanager
def hold_interruption() -> Iterator[None]:
    """Hold Ctrl-C back until the body ends, in the processes too that it starts.

    A process inherits the block and keeps it, so that nothing interrupts its first
    imports: the command ends it. Windows has no such block; there nothing is held.
    """
    if sys.platform == "win32":
        yield
        return
    # the tracker of `multiprocessing` ends a block where it is started itself
    ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def bound_processor_time(seconds: float) -> None:
    """Bound the processor time that this process takes from now on, on every core.

    The system ends a process that exceeds the bound. Windows has no such limit; there
    nothing happens.
    """
    try:
        from resource import RLIM_INFINITY, RLIMIT_CPU, getrlimit, setrlimit
    except ImportError:
        return
    most = math.ceil(time.process_time() + seconds * (os.cpu_count() or 1))
    _, hard = getrlimit(RLIMIT_CPU)
    if hard != RLIM_INFINITY:
        most = min(most, hard)
    setrlimit(RLIMIT_CPU, (most, hard))


class Ended(NamedTuple):
    """Output and exit of a process that ended."""

    out: str
    errors: str
    failed: bool
    last: str
    """Line of the errors, or the exit status."""

    @property
    def why(self) -> str:
        """Return in one line why the process failed; an empty string if it did not."""
        return self.last if self.failed else ""


def run_to_end(
    command: Sequence[object],
    *,
    folder: Path | None = None,
    seconds: float | None = None,
    variables: Mapping[str, str] | None = None,
) -> Ended:
    """Run a command to its end, with these variables added to the environment."""
    line = [str(part) for part in command]
    environment = {**os.environ, "PYTHONUTF8": "1", **(variables or {})}
    try:
        done = subprocess.run(
            line,
            cwd=folder,
            env=environment,
            capture_output=True,
            encoding="utf-8",
            errors="replace",
            timeout=seconds,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return Ended(
            "",
            "",
            True,
            f"no answer within {seconds:g} s",
        )
    why = find_reason(done.stderr) or f"exit status {done.returncode}"
    return Ended(
        done.stdout,
        done.stderr,
        done.returncode != 0,
        write_one_line(why),
    )


_SAYS_WHY = (
    re.compile(
        r"^\s*(Caused by: |Exception in thread |Uncaught )?"
        r"(\w+[.:/])*\w*(Error|Exception)\b.*: *\S"
    ),
    re.compile(r"\b(what\(\): |panicked at|terminate called)", re.IGNORECASE),
    re.compile(
        r"\b(error|cannot|can't|could not|failed|fatal|no such|not found|undefined|"
        r"segmentation fault|out of memory|aborted)\b",
        re.IGNORECASE,
    ),
)
"""Patterns of a line that says why a program ended, the surest first. The last line of
what Node, Java or a shell print is a version or a place in a file."""


def find_reason(errors: str) -> str:
    """Return the line of a program's standard error that says why it ended, if any."""
    lines = [line for line in errors.splitlines() if line.strip()]
    for pattern in _SAYS_WHY:
        for line in reversed(lines):
            if pattern.search(line):
                return line.strip()
    return lines[-1].strip() if lines else ""


OUTPUT_KEPT = 20_000
"""Bytes that are kept of one answer's output. Half are from its beginning, half from
its end.
"""
_file: list[IO[bytes]] = []
"""The one file of this process, once it keeps what is printed."""


def keep_output() -> None:
    """Send what this process prints into a file that goes with it, from now on."""
    if not _file:
        _file.append(tempfile.TemporaryFile(buffering=0))  # noqa: SIM115 - as long as the process
        sys.stdout = sys.stderr = None
    _take_printed()


@contextmanager
def keep_printed(outputs: dict[str, str], engine: str) -> Iterator[None]:
    """Add what is printed meanwhile to the outputs, under the name of the engine."""
    _take_printed()
    try:
        yield
    finally:
        if text := _take_printed():
            outputs[engine] = outputs.get(engine, "") + text


def _take_printed() -> str:
    """Take what was printed since the last call, as plain text.

    The text is empty if this process does not keep what it prints.
    """
    if not _file:
        return ""
    file = _file[0]
    for stream in (sys.stdout, sys.stderr):
        with suppress(Exception):  # there is none, it was closed, or is somebody else's
            stream.flush()
    with suppress(
        AttributeError,
        OSError,
        TypeError,
    ):  # another system than those of the Unix family
        ctypes.CDLL(None).fflush(None)
    text = _take_written(file)
    for name, descriptor in (
        ("stdout", 1),
        ("stderr", 2),
    ):  # an engine may have closed them, or sent them elsewhere
        os.dup2(file.fileno(), descriptor)
        if getattr(getattr(sys, name), "closed", True):
            # line by line, in the order of what libraries print
            stream = open(  # noqa: SIM115
                descriptor,
                "w",
                1,
                "utf-8",
                "backslashreplace",
                closefd=False,
            )
            setattr(sys, name, stream)
    return escape_controls(text.decode(errors="backslashreplace"))


def _take_written(file: IO[bytes]) -> bytes:
    """Empty a file, and return what it held.

    Beyond the size that is kept, the middle is left out.
    """
    size = file.seek(0, os.SEEK_END)
    file.seek(0)
    text = file.read(min(size, OUTPUT_KEPT // 2))
    skipped = max(size - OUTPUT_KEPT, 0)
    file.seek(skipped, os.SEEK_CUR)
    text += f"\n... {skipped} bytes left out ...\n".encode() * bool(
        skipped
    ) + file.read(OUTPUT_KEPT // 2)
    file.truncate(0)
    file.seek(0)
    return text


ANSWER_SECONDS, SECONDS_PER_POSITION = 60.0, 0.03
"""Time for a question and for each of its positions if no limit is stated, s: ten times
what a position takes with all engines.
"""
LONGEST_ANSWER, _BYTES_PER_POSITION = 10**6, 10**4
"""Bytes of an answer: ten times as many as all quantities take."""
MOST_ERRORS = 10**8
"""Bytes that a program may write to its standard error for one answer."""
Message = dict[str, Any]
"""A question or an answer, as an object of JSON."""
Ask = Callable[[Message, int], Message]
"""Function that asks a question about a number of positions."""


class _KilledError(EngineError):
    """The program was killed, by itself or from outside."""


@record
class Program:
    """A command line, and what it is started with."""

    command: tuple[str, ...]
    seconds: float | None = None
    """Limit of time for each question; None: a minute, and more for many positions."""
    variables: tuple[tuple[str, str], ...] = ()
    """Added to the environment."""

    def limit(self, positions: int) -> float:
        """Return the seconds within which a question is answered."""
        if self.seconds is None:
            return ANSWER_SECONDS + SECONDS_PER_POSITION * positions
        return self.seconds


@dataclass(eq=False)
class Running:
    """A program that runs: one question and one answer at a time."""

    program: Program
    _process: "subprocess.Popen[bytes] | None" = None
    _number: int = 0
    """Number of the last question."""
    _errors: IO[bytes] | None = None
    """File that takes what the engine writes to its standard error."""
    _stopped: str = ""
    """Why it was stopped."""
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def ask_again(
        self,
        question: Message,
        positions: int,
        greet: Callable[[Ask], None] | None = None,
    ) -> Message:
        """Ask, and ask once more a program that was killed; one that fails is ended.

        `greet` asks what a program that is started must be asked first, and raises
        where the answer is wrong.
        """
        with self._lock:
            try:
                return self._greet_and_ask(question, positions, greet)
            except _KilledError:  # perhaps from outside, for example out of memory
                return self._greet_and_ask(question, positions, greet)

    def _greet_and_ask(
        self,
        question: Message,
        positions: int,
        greet: Callable[[Ask], None] | None,
    ) -> Message:
        try:
            if greet is not None and self._process is None:
                greet(self._ask)
            return self._ask(question, positions)
        except BaseException:
            self.end()
            raise

    def _ask(self, question: Message, positions: int) -> Message:
        """Send a question and return the object that answers it.

        The object may say why it has no answer.
        """
        process = self._process or self._start()
        assert process.stdin is not None and process.stdout is not None
        self._number += 1
        line = (
            json.dumps({"id": self._number, **question}, allow_nan=False).encode()
            + b"\n"
        )
        seconds = self.program.limit(positions)
        most = LONGEST_ANSWER + _BYTES_PER_POSITION * positions
        answered = threading.Event()
        watch = threading.Thread(
            target=self._watch,
            args=(process, seconds, answered),
            daemon=True,
        )
        watch.start()
        try:
            with suppress(
                OSError
            ):  # it closed its input, or is gone: what it said before tells
                process.stdin.write(line)
                process.stdin.flush()
            reply = process.stdout.readline(most + 1)
            answered.set()
            watch.join()
            if not reply.endswith(b"\n") or self._stopped:
                raise self._find_end(process, reply, most)
            return self._read(reply)
        finally:
            answered.set()
            self._take_errors()

    def _read(self, reply: bytes) -> Message:
        """Read a line; EngineError where it is not the answer that was asked for."""
        said = _quote(reply)
        try:
            data = json.loads(
                reply,
                object_pairs_hook=_make_object,
                parse_constant=_refuse_constant,
            )
        except (ValueError, RecursionError) as error:
            said = _quote(reply, getattr(error, "pos", 0))
            raise EngineError(
                f"said what is no JSON ({write_one_line(str(error))}){QUOTED}{said}"
            ) from None
        if not isinstance(data, dict) or type(data.get("id")) is not int:
            raise EngineError(f"said what is no object with an id{QUOTED}{said}")
        if data["id"] != self._number:
            raise EngineError(
                f"answered question {data['id']} where {self._number} was asked"
            )
        return data

    def _start(self) -> "subprocess.Popen[bytes]":
        self._errors = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115 - as long as the program
        self._process = subprocess.Popen(
            self.program.command,
            bufsize=2**16,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            env={**os.environ, **dict(self.program.variables)},
            start_new_session=True,
            preexec_fn=None if _LIBC is None else set_parent_death_signal,  # noqa: PLW1509 - only prctl is called between fork and exec
        )
        bound_memory(self._process.pid)
        self._number = 0
        self._stopped = ""
        return self._process

    def _watch(
        self,
        process: "subprocess.Popen[bytes]",
        seconds: float,
        answered: threading.Event,
    ) -> None:
        """Stop a program that takes too long or writes too much."""
        until = time.monotonic() + seconds
        while not answered.wait(min(1.0, max(0.0, until - time.monotonic()))):
            if time.monotonic() >= until:
                self._stopped = f"no answer within {seconds:g} s"
            elif (
                self._errors is not None
                and os.fstat(self._errors.fileno()).st_size > MOST_ERRORS
            ):
                self._stopped = (
                    f"wrote more than {MOST_ERRORS} bytes to its standard error"
                )
            if self._stopped:
                _stop(process)
                return

    def _take_errors(self) -> bytes:
        """Take what the process wrote to its standard error.

        The text is kept too, as what this process prints.
        """
        text = b"" if self._errors is None else _take_written(self._errors)
        if _file and text:
            _file[0].write(text)
        return text

    def _find_end(
        self,
        process: "subprocess.Popen[bytes]",
        reply: bytes,
        most: int,
    ) -> EngineError:
        """Say in one line how a program ended, or that it did not end its line."""
        if self._stopped:
            return EngineError(self._stopped)
        if len(reply) > most:
            return EngineError(f"said more than {most} bytes without an end of line")
        try:
            status = process.wait(1.0)
        except subprocess.TimeoutExpired:
            return EngineError("closed its standard output")
        errors = self._take_errors().decode(errors="backslashreplace")
        reason = find_reason(errors)
        if reason:
            said = f": {write_one_line(reason)}"
            # A place in a file, as a traceback of Python names it
            places = re.findall(r'^ *File "(.+)", (line \d+)', errors, re.MULTILINE)
            for place in places[-1:]:
                said += f" ({', '.join(place)})"
        else:
            said = ""
        if status in _KILLED:
            return _KilledError(f"was killed{said}")
        if status >= 0:
            how = f"exit status {status}"
        else:
            how = f"ended by signal {-status}"
        return EngineError(how + " in the middle of a line" * bool(reply) + said)

    def end(self) -> None:
        """End the program and all that it started."""
        process = self._process
        self._process = None
        if process is not None:
            _stop(process)
            self._take_errors()
            errors = self._errors
            self._errors = None
            for stream in (process.stdin, process.stdout, errors):
                with suppress(OSError):
                    assert stream is not None
                    stream.close()


def _stop(process: "subprocess.Popen[bytes]") -> None:
    """End a program and what it started in its session."""
    _signal(process, "SIGTERM")
    with suppress(subprocess.TimeoutExpired):
        process.wait(ENDING_SECONDS)
    _signal(process, "SIGKILL")
    process.wait()


def _signal(process: "subprocess.Popen[bytes]", name: str) -> None:
    """Send a signal to a program and all that is left of its session."""
    if os.name == "posix":
        with suppress(OSError):  # all of them have ended
            os.killpg(process.pid, getattr(signal, name))
    elif process.poll() is None:
        process.terminate()


def _quote(reply: bytes, place: int = 0) -> str:
    """Write a reply in one line, from shortly before a place on."""
    start = max(0, place - LONGEST_REASON // 4)
    kept = reply[: OUTPUT_KEPT + start].decode(errors="backslashreplace")[start:]
    return "... " * bool(start) + write_one_line(kept)


def _make_object(pairs: list[tuple[str, Any]]) -> Message:
    data = dict(pairs)
    if len(data) < len(pairs):
        raise ValueError("a key stands twice")
    return data


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is no number; null stands where there is no value")
