"""Engines outside the judge's process: programs that read lines of JSON and answer with lines of JSON.

The judge imports nothing of a guest. docs/protocol.md is the contract.
"""

import hashlib
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import IO, Any

from fourbar.errors import FourBarError, InputError
from fourbar.quantities import ANGLES, DRY_FRICTION_QUANTITIES
from fourbar.scene import Command, Scene
from fourbar_validation.compare.answer import Answer, Array, EngineError, ReleasedAnswer
from fourbar_validation.compare.compare import COMPARED
from fourbar_validation.compare.rows import FORMULAS, write_one_line
from fourbar_validation.compare.tolerance import EQUIVALENCE, ErrorBound
from fourbar_validation.engines import keeper, protocol
from fourbar_validation.engines.processes import KEPT, WORKER_MEMORY, print_kept
from fourbar_validation.engines.registry import Engine
from fourbar_validation.places import CHECKOUT, PACKAGE

CLASS = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*", re.ASCII)
"""A class of the user's, which our host serves: "module:Class"; anything else is a command line."""
NOT_FOUND = 2
"""Exit status of our host where there is no such class or engine."""
SECONDS, SECONDS_PER_POSITION = 60.0, 0.03
"""Time for a question where no limit is stated."""
QUESTIONS = 4
"""Questions to a guest about one scene at most, with hello: its limit of time is that of each."""
LONGEST_LINE, BYTES_PER_POSITION = 10**6, 10**4
"""Bytes of an answer: ten times as many as all quantities take."""
MOST_ERRORS = 10**8
"""Bytes that a program may write to its standard error for one answer."""
KILLED = (-9, 137)
"""Exit status of a program that was killed: its own, or its shell's."""
QUANTITIES = (*COMPARED, *DRY_FRICTION_QUANTITIES)
"""Names of what an engine can answer."""
COMMANDS = tuple(names[0] for names in protocol.KINDS_OF_COMMAND)
HELLO = {"ask": "hello", "protocol": protocol.PROTOCOL}
ATTEMPTS = 5
"""A guest that is killed from outside is asked so often before it is given up."""
ENDING = 5.0
"""Seconds for a program that is told to end; then it is killed."""


class _KilledError(EngineError):
    """The program was killed, by itself or from outside."""


@dataclass(frozen=True, slots=True)
class Program:
    """A command line, and what it is started with."""

    command: tuple[str, ...]
    seconds: float | None = None
    """Limit of time for each question; None: a minute, and more for many positions."""
    variables: tuple[tuple[str, str], ...] = ()
    """Added to the environment."""

    def limit(self, positions: int) -> float:
        """Return the seconds within which a question is answered."""
        return SECONDS + SECONDS_PER_POSITION * positions if self.seconds is None else self.seconds


@dataclass(frozen=True, slots=True)
class Hello:
    """First message of an engine, which states what it answers, checked."""

    name: str
    answers: tuple[str, ...] = COMPARED
    commands: tuple[str, ...] = ("theta_2",)
    effects: tuple[str, ...] = ()
    tolerance: ErrorBound = EQUIVALENCE
    version: str = ""
    code: str = ""
    settings: tuple[str, ...] = ()
    device: str = ""
    made_for: str = ""


@dataclass(frozen=True, slots=True)
class Guest(Engine):
    """Engine in a process outside."""

    code: str = ""
    """Hashes of what its answers come from."""
    version: str = ""
    number: int = 0
    """Number of the engine, so that it is drawn with the same mark in every process."""
    seconds: float | None = None
    """Limit of time for each question."""
    releases: bool = False
    """True if it integrates released motions."""
    setting: str = ""
    """Name of the setting with which it is asked, one of those that its hello lists."""

    def at_step(self, step: float) -> "Asked":
        """Return the engine that integrates with this step, s."""
        engine = self.start()
        assert isinstance(engine, Asked)
        engine.step = step
        return engine

    def at_setting(self, **setting: Any) -> "Guest":
        """Return the guest that is asked with this setting, under the name that was chosen before."""
        name = setting.pop("name", self.setting)
        asked = {"name": name, **setting} if name else setting
        return replace(self, setting=name, start=partial(self.start, setting=asked))  # type: ignore[call-arg]


def read_guests(entries: Sequence[str], known: Iterable[str], seconds: float | None = None) -> tuple[Guest, ...]:
    """Start each guest of the command line and read its hello; InputError where there is no such program or class."""
    return name_guests([(entry, "", make_program(entry, seconds)) for entry in entries], known)


def name_guests(entries: Sequence[tuple[str, str, Program]], known: Iterable[str]) -> tuple[Guest, ...]:
    """Read the hello of programs, each with its entry and the name that it is given, and name them apart."""
    names, guests = {FORMULAS, *known}, list[Guest]()
    for entry, chosen, program in entries:
        hello, trouble = Hello(_name_program(entry, program)), ""
        try:
            hello = ask_hello(program)
        except InputError as error:
            trouble = str(error)
        except EngineError as error:
            trouble = str(error)
            if CLASS.fullmatch(entry) and trouble.startswith(f"exit status {NOT_FOUND}: "):
                raise InputError("--witness", entry, trouble.partition(": ")[2]) from None
        name = stem = chosen or hello.name
        for count in range(2, 2 + len(names)):
            if name not in names:
                break
            name = f"{stem}-{count}"
        names.add(name)
        guests.append(_make_guest(name, program, hello, trouble, number=len(names)))
    return tuple(guests)


def _make_guest(name: str, program: Program, hello: Hello, trouble: str, number: int) -> Guest:
    return Guest(
        name,
        partial(Asked, name, program, hello, trouble),
        hello.tolerance,
        answers=hello.answers,
        positions=tuple(name for name in hello.answers if name in ANGLES),
        stated=False,
        code=_hash_files(program.command),
        version=" on ".join(filter(None, (hello.version, hello.device))),
        number=number,
        seconds=program.seconds,
        releases="release" in hello.effects,
    )


def list_numbers(engines: Iterable[Engine]) -> dict[str, int]:
    """List the numbers of the guests, by name."""
    return {guest.name: guest.number for guest in engines if isinstance(guest, Guest)}


def make_program(entry: str, seconds: float | None = None) -> Program:
    """Make the program of "module:Class" or a command line; InputError where there is none."""
    if CLASS.fullmatch(entry):
        return serve(entry, seconds)
    try:
        command = shlex.split(entry)
    except ValueError as error:
        raise InputError("--witness", entry, f"is no command line: {error}") from None
    if not command or (program := shutil.which(command[0])) is None:
        raise InputError("--witness", entry, "must be module:Class, or the command line of a program that is there")
    return Program((os.path.abspath(program), *command[1:]), seconds)


def serve(entry: str, seconds: float | None = None, python: str = sys.executable) -> Program:
    """Make the program that serves one of our adapters, or a class of the user's."""
    ours = [] if CHECKOUT is None else [str(CHECKOUT), str(PACKAGE.parent), str(CHECKOUT / "lab")]
    path = os.pathsep.join(filter(None, [*ours, os.environ.get("PYTHONPATH", "")]))
    return Program((python, "-m", "fourbar_validation.engine", entry), seconds, (("PYTHONPATH", path),) * bool(path))


def _name_program(entry: str, program: Program) -> str:
    """Name a guest whose hello is not read: its class, or the first argument that is a file, else the program."""
    if CLASS.fullmatch(entry):
        return entry.partition(":")[2]
    first, *arguments = program.command
    return write_one_line(Path(next(filter(os.path.isfile, arguments), first)).stem) or "guest"


def _hash_files(command: Sequence[str]) -> str:
    """Hash the files that a command line names."""
    digest = hashlib.sha256()
    for part in filter(os.path.isfile, command):
        digest.update(f"{part} ".encode() + hashlib.sha256(Path(part).read_bytes()).digest())
    return digest.hexdigest()[:16]


def ask_hello(program: Program) -> Hello:
    """Start a program, read its hello and end it."""
    running = Running(program)
    try:
        return read_hello(running.ask_again(HELLO, 0))
    finally:
        running.end()


def read_hello(data: dict[str, Any]) -> Hello:
    """Check what an engine says of itself; InputError names what is wrong."""

    def texts(name: str, default: tuple[str, ...], allowed: Sequence[str] | None = None) -> tuple[str, ...]:
        values = data.get(name, list(default))
        if not isinstance(values, list) or not all(isinstance(value, str) for value in values):
            raise InputError(name, values, "must be a list of texts")
        if allowed is not None and (unknown := [value for value in values if value not in allowed]):
            raise InputError(name, unknown[0], f"must be among {', '.join(allowed)}")
        return tuple(map(write_one_line, values))

    def text(name: str) -> str:
        value = data.get(name, "")
        if not isinstance(value, str):
            raise InputError(name, value, "must be a text")
        return write_one_line(value)

    if "error" in data:
        raise EngineError(text("error") or "it broke down without a word")
    name = text("engine")
    if not name or name != data["engine"]:
        raise InputError("engine", data.get("engine"), "must be a name of printable characters in one line")
    answers = texts("answers", (), QUANTITIES)
    if not answers:
        raise InputError("answers", data.get("answers"), f"must name quantities among {', '.join(QUANTITIES)}")
    if "four-bar" not in texts("mechanisms", ("four-bar",)):
        raise InputError("mechanisms", data["mechanisms"], 'must hold "four-bar"')
    return Hello(
        name,
        tuple(quantity for quantity in QUANTITIES if quantity in answers),
        texts("commands", ("theta_2",), COMMANDS),
        texts("effects", ()),
        _read_tolerance(data.get("tolerance", EQUIVALENCE.name)),
        text("version"),
        text("code"),
        texts("settings", ()),
        text("device"),
        text("made_for"),
    )


def _read_tolerance(stated: Any) -> ErrorBound:
    if stated == EQUIVALENCE.name:
        return EQUIVALENCE
    error, reason = stated if isinstance(stated, list) and len(stated) == 2 else (0.0, "")
    if type(error) is not float or not 0.0 < error < 1.0 or not isinstance(reason, str) or not reason.strip():
        allowed = f'must be "{EQUIVALENCE.name}", or [relative error above 0 and below 1, its reason]'
        raise InputError("tolerance", stated, allowed)
    reason = f"{error:g} of the scale: {write_one_line(reason)}"
    return ErrorBound("as the engine states", reason, error, conditioned=False)


def find_needs(scene: Scene) -> list[str]:
    """List what a scene asks of an engine, in the words of hello's `effects`."""
    needs = [effect.key for effect in scene.effects]
    needs += ["loads"] * bool(scene.loads)
    needs += ["cylinder"] if scene.drive is not None else ["drive"] * (scene.drive_bar != 2)
    return needs


class Asked:
    """The engine of a guest: its program runs on from scene to scene, and is started anew after it broke down."""

    def __init__(
        self, name: str, program: Program, hello: Hello, trouble: str = "", setting: dict[str, Any] | None = None
    ) -> None:
        self.name, self._program, self._hello, self._trouble = name, program, hello, trouble
        self._setting = {"setting": setting} if setting else {}
        self.commands = COMMANDS if trouble else hello.commands
        self.step: float | None = None
        """Step of a released motion, s."""

    def answer(self, scene: Scene, command: Command) -> Answer:
        """Return its answer; EngineError says how it broke down."""
        if refusal := self._explain_refusal(find_needs(scene)):
            return Answer(self.name, "exact", refusal=refusal)
        data = {
            "ask": "answer",
            "scene": protocol.scene_to_json(scene),
            "command": protocol.command_to_json(scene, command),
            **self._setting,
        }
        try:
            return protocol.answer_from_json(self.name, command, self._ask(data, len(command.angle)))
        except InputError as error:
            raise EngineError(str(error)) from None

    def release(self, scene: Scene, times: Array) -> ReleasedAnswer:
        """Return the released motion as the guest integrates it."""
        if refusal := self._explain_refusal(["release", *find_needs(scene)]):
            return ReleasedAnswer.refused(self.name, "-", refusal)
        data = {"ask": "release", "scene": protocol.scene_to_json(scene), **protocol.release_to_json(scene)}
        data |= {} if self.step is None else {"step": self.step}
        try:
            return protocol.released_from_json(self.name, len(times), self._ask(data, len(times)))
        except InputError as error:
            raise EngineError(str(error)) from None

    def _explain_refusal(self, needs: Iterable[str]) -> str:
        if self._trouble:
            raise EngineError(self._trouble)
        lacking = [need for need in needs if need not in self._hello.effects]
        name = self._setting.get("setting", {}).get("name")
        if name is not None and name not in self._hello.settings:
            return f"it does not name {name!r} among its settings"
        return f"it does not name {', '.join(lacking)} among its effects" if lacking else ""

    def _ask(self, data: dict[str, Any], positions: int) -> dict[str, Any]:
        return _RUNNING.setdefault(self._program, Running(self._program)).ask_again(data, positions, self._hello)


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

    def ask_again(self, data: dict[str, Any], positions: int, hello: Hello | None = None) -> dict[str, Any]:
        """Ask, and ask anew what is killed from outside; one that is started for it must say hello as before."""
        with self._lock:
            for attempt in range(1, ATTEMPTS + 1):
                try:
                    if hello is not None and self._process is None:
                        self._greet(hello)
                    return self._ask(data, positions)
                except _KilledError:
                    if attempt == ATTEMPTS:
                        raise
        raise AssertionError

    def _greet(self, hello: Hello) -> None:
        """Begin with hello, which must be as before; a program that fails to say so is ended."""
        try:
            if read_hello(self._ask(HELLO, 0)) != hello:
                raise EngineError("its hello is another than before")
        except FourBarError:
            self.end()
            raise

    def _ask(self, data: dict[str, Any], positions: int) -> dict[str, Any]:
        """Send a question and return the object that answers it; a program that fails is ended, and the error says how.

        Its own words for a breakdown are an answer.
        """
        process = self._process or self._start()
        assert process.stdin is not None and process.stdout is not None
        self._number += 1
        line = json.dumps({"id": self._number, **data}, allow_nan=False).encode() + b"\n"
        seconds, most = self.program.limit(positions), LONGEST_LINE + BYTES_PER_POSITION * positions
        answered = threading.Event()
        watch = threading.Thread(target=self._watch, args=(process, seconds, answered), daemon=True)
        watch.start()
        try:
            with suppress(OSError):  # it closed its input, or is gone: what it said before tells
                process.stdin.write(line)
                process.stdin.flush()
            reply = process.stdout.readline(most + 1)
            answered.set()
            watch.join()
            if not reply.endswith(b"\n") or self._stopped:
                raise self._find_end(process, reply, most)
            return self._read(reply)
        except BaseException:
            answered.set()
            self.end()
            raise
        finally:
            print_kept(self._take_errors())

    def _read(self, reply: bytes) -> dict[str, Any]:
        """Read a line; EngineError where it is not the answer that was asked for."""
        said = write_one_line(reply[:KEPT].decode(errors="backslashreplace"))
        try:
            data = json.loads(reply, object_pairs_hook=_make_object, parse_constant=_refuse_constant)
        except (ValueError, RecursionError) as error:
            raise EngineError(f"said what is no JSON ({write_one_line(str(error))}): {said}") from None
        if not isinstance(data, dict) or type(data.get("id")) is not int:
            raise EngineError(f"said what is no object with an id: {said}")
        if data["id"] != self._number:
            raise EngineError(f"answered question {data['id']} where {self._number} was asked")
        return data

    def _start(self) -> "subprocess.Popen[bytes]":
        command = list(self.program.command)
        if os.name == "posix":
            kept_by = [sys.executable, "-I", "-S", keeper.__file__, str(os.getpid()), str(WORKER_MEMORY)]
            command = [*kept_by, *command]
        self._errors = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115 - as long as the program
        environment, pipe = {**os.environ, **dict(self.program.variables)}, subprocess.PIPE
        self._process = subprocess.Popen(
            command,
            bufsize=2**16,
            stdin=pipe,
            stdout=pipe,
            stderr=self._errors,
            env=environment,
            start_new_session=True,
        )
        self._number, self._stopped = 0, ""
        return self._process

    def _watch(self, process: "subprocess.Popen[bytes]", seconds: float, answered: threading.Event) -> None:
        """Stop a program that takes too long or writes too much."""
        until = time.monotonic() + seconds
        while not answered.wait(min(1.0, max(0.0, until - time.monotonic()))):
            if time.monotonic() >= until:
                self._stopped = f"no answer within {seconds:g} s"
            elif self._errors is not None and os.fstat(self._errors.fileno()).st_size > MOST_ERRORS:
                self._stopped = f"wrote more than {MOST_ERRORS} bytes to its standard error"
            if self._stopped:
                _stop(process)
                return

    def _take_errors(self) -> bytes:
        """Take the beginning and the end of what it wrote to its standard error since the last question."""
        if self._errors is None:
            return b""
        size = self._errors.seek(0, os.SEEK_END)
        self._errors.seek(0)
        text = self._errors.read(min(size, KEPT // 2))
        self._errors.seek(max(size - KEPT // 2, len(text)))
        text += self._errors.read(KEPT // 2)
        self._errors.truncate(0)
        self._errors.seek(0)
        return text

    def _find_end(self, process: "subprocess.Popen[bytes]", reply: bytes, most: int) -> EngineError:
        """Say in one line how a program ended, or that it did not end its line."""
        if self._stopped:
            return EngineError(self._stopped)
        if len(reply) > most:
            return EngineError(f"said more than {most} bytes without an end of line")
        try:
            status = process.wait(1.0)
        except subprocess.TimeoutExpired:
            return EngineError("closed its standard output")
        errors = self._take_errors()
        print_kept(errors)
        lines = errors.decode(errors="backslashreplace").strip().splitlines()
        said = f": {write_one_line(lines[-1])}" if lines else ""
        if status in KILLED:
            return _KilledError(f"was killed{said}")
        how = f"exit status {status}" if status >= 0 else f"ended by signal {-status}"
        return EngineError(how + " in the middle of a line" * bool(reply) + said)

    def end(self) -> None:
        """End the program and all that it started."""
        process, self._process = self._process, None
        if process is not None:
            _stop(process)
            print_kept(self._take_errors())
            errors, self._errors = self._errors, None
            for stream in (process.stdin, process.stdout, errors):
                with suppress(OSError):
                    assert stream is not None
                    stream.close()


def _stop(process: "subprocess.Popen[bytes]") -> None:
    process.terminate()
    try:
        process.wait(ENDING)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


_RUNNING: dict[Program, Running] = {}
"""The programs that this process started."""


def _make_object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    data = dict(pairs)
    if len(data) < len(pairs):
        raise ValueError("a key stands twice")
    return data


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is no number; null stands where there is no value")
