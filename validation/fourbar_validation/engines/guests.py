"""Engines outside the judge's process: programs that exchange lines of JSON.

The judge imports nothing of a guest. docs/protocol.md is the contract.
"""

import hashlib
import os
import re
import shlex
import shutil
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain, count
from pathlib import Path
from typing import Any, TypeVar

from fourbar.effects import Springs
from fourbar.errors import InputError
from fourbar.linkage import record
from fourbar.quantities import ANGLES, DRY_FRICTION_QUANTITIES, Array
from fourbar.scene import Command, Scene
from fourbar_validation.compare.answer import Answer, EngineError
from fourbar_validation.compare.compare import COMPARED_QUANTITIES
from fourbar_validation.compare.rows import FORMULAS, write_one_line
from fourbar_validation.compare.tolerance import EQUIVALENCE, ErrorBound, hold_simulated
from fourbar_validation.engines import protocol
from fourbar_validation.engines.description import name_drive
from fourbar_validation.engines.prediction import predict_for_any_method
from fourbar_validation.engines.programs import (
    Ask,
    Message,
    Program,
    Running,
)
from fourbar_validation.engines.registry import (
    SIMULATED_TO_ERROR,
    Engine,
)
from fourbar_validation.places import CHECKOUT, PACKAGE

CLASS_OF_THE_USER = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*", re.ASCII)
"""A class of the user's, which our host serves: "module:Class". Anything else is a
command line.
"""
NOT_FOUND = 2
"""Exit status of our host where there is no such class or engine."""
QUESTIONS = 4
"""Most questions to a guest about one scene, hello included. Each may take as long as
the guest's time limit.
"""
ANSWERABLE_QUANTITIES = (*COMPARED_QUANTITIES, *DRY_FRICTION_QUANTITIES)
"""Names of what an engine can answer."""
STATED_BY_THE_ENGINE = "as the engine states"
"""Class of the tolerance that a guest states itself."""
COMMANDED_NAMES = tuple(names[0] for names in protocol.KINDS_OF_COMMAND)
_Read = TypeVar("_Read")
Texts = tuple[str, ...]
HELLO = {"ask": "hello", "protocol": protocol.PROTOCOL}


@record
class Hello:
    """First message of an engine, which states what it answers, checked."""

    name: str
    answers: Texts = COMPARED_QUANTITIES
    commands: Texts = ("theta_2",)
    effects: Texts = ()
    tolerance: ErrorBound = EQUIVALENCE
    version: str = ""
    code: str = ""
    settings: Texts = ()
    device: str = ""
    made_for: str = ""


@record
class Guest(Engine):
    """Engine in a process outside."""

    version: str = ""
    stated_name: str = ""
    """Name without version, by which later runs find it."""
    number: int = 0
    """Number of the engine, so that it is drawn with the same mark in every process."""
    seconds: float | None = None
    """Time limit for each question."""
    effects: Texts = ()
    """Words of the hello's `effects`."""
    setting: str = ""
    """Name of the setting with which it is asked, one of those that its hello lists."""

    def renamed(self, name: str) -> "Guest":
        """Return the guest under another name."""
        return replace(self, name=name, start=partial(self.start, name=name))  # type: ignore[call-arg]

    def at_step(self, step: float) -> "GuestClient":
        """Return the engine that integrates with this step, s."""
        return partial(self.start, step=step)()  # type: ignore[call-arg, return-value]

    def at_setting(self, **setting: Any) -> "Guest":
        """Return the guest that is asked with this setting.

        Without `name` the named setting stays.
        """
        name = setting.setdefault("name", self.setting)
        if not name:
            del setting["name"]
        return replace(self, setting=name, start=partial(self.start, setting=setting))  # type: ignore[call-arg]


def read_guests(
    entries: Sequence[str],
    known: Iterable[str],
    seconds: float | None = None,
) -> tuple[Guest, ...]:
    """Start each guest of the command line and read its hello.

    Raises InputError if there is no such program or class.
    """
    return name_guests(
        [(entry, "", _make_program(entry, seconds)) for entry in entries], known
    )


def name_guests(
    entries: Sequence[tuple[str, str, Program]],
    known: Iterable[str],
) -> tuple[Guest, ...]:
    """Read the hello of programs, and return the guests, each of another name.

    An entry has the text of the user, the name that it is given, and the program.
    """
    names = {FORMULAS, *known}
    guests = list[Guest]()
    for entry, chosen, program in entries:
        hello = Hello(_name_program(entry, program))
        trouble = ""
        try:
            hello = ask_hello(program)
        except (InputError, EngineError) as error:
            trouble = str(error)
            not_found = trouble.startswith(f"exit status {NOT_FOUND}: ")
            if not_found and CLASS_OF_THE_USER.fullmatch(entry):
                raise InputError("--guest", entry, trouble.partition(": ")[2]) from None
        stated = chosen or hello.name
        counted = (f"{stated}-{number}" for number in count(2))
        name = next(one for one in chain([stated], counted) if one not in names)
        names.add(name)
        words = [word for word in stated.split() if word != hello.version]
        guest = Guest(
            name,
            partial(
                GuestClient, name=name, program=program, hello=hello, trouble=trouble
            ),
            hello.tolerance,
            answers=hello.answers,
            positions=tuple(
                quantity for quantity in hello.answers if quantity in ANGLES
            ),
            predictor=predict_for_any_method,
            code=hash_files(filter(os.path.isfile, program.command)),
            version=" on ".join(filter(None, (hello.version, hello.device))),
            stated_name=" ".join(words) or stated,
            seconds=program.seconds,
            effects=hello.effects,
        )
        guests.append(guest)
    return tuple(guests)


def name_by_versions(
    engines: Sequence[Engine],
    taken: Iterable[str],
) -> tuple[Engine, ...]:
    """Name the guests of a run without version, which no later version changes.

    Two versions of one name are "name version" each; others of one name are counted.

    `taken`: names of engines that need not be in the run.
    """
    guests = [engine for engine in engines if isinstance(engine, Guest)]
    alone = Counter(guest.stated_name for guest in guests)
    alone.update({FORMULAS, *taken} - {guest.name for guest in guests})
    versions = Counter((guest.stated_name, guest.version) for guest in guests)

    def name(engine: Engine) -> Engine:
        if not isinstance(engine, Guest):
            return engine
        stated = engine.stated_name
        version = engine.version
        if alone[stated] == 1:
            return engine.renamed(stated)
        if version and versions[stated, version] == 1:
            return engine.renamed(f"{stated} {version}")
        return engine

    return tuple(map(name, engines))


def adjust_engines(engines: Sequence[Engine], error: float) -> tuple[Engine, ...]:
    """Lay out simulations for an error and hold them to it.

    Guests are asked for it, and exact engines stay exact.
    """
    tolerance = hold_simulated(error, "steps and softness are laid out for it")
    adjusted = []
    for stated in engines:
        engine = stated
        if isinstance(engine, Guest):
            engine = engine.at_setting(error=error)
        elif engine.through_time:
            engine = replace(engine, start=partial(SIMULATED_TO_ERROR, error))
        adjusted.append(
            replace(engine, tolerance=tolerance) if engine.through_time else engine
        )
    return tuple(adjusted)


def number_guests(engines: Iterable[Engine]) -> dict[str, int]:
    """List the numbers of the guests, by name."""
    return {guest.name: guest.number for guest in engines if isinstance(guest, Guest)}


def _make_program(entry: str, seconds: float | None) -> Program:
    """Make the program of "module:Class" or a command line.

    Raises InputError if there is none.
    """
    if CLASS_OF_THE_USER.fullmatch(entry):
        return serve_adapter(entry, seconds)
    try:
        command = shlex.split(entry)
    except ValueError as error:
        raise InputError("--guest", entry, f"is no command line: {error}") from None
    if not command or (program := shutil.which(command[0])) is None:
        raise InputError(
            "--guest",
            entry,
            "must be module:Class, or the command line of a program that is there",
        )
    return Program((os.path.abspath(program), *command[1:]), seconds)


def serve_adapter(
    entry: str,
    seconds: float | None,
    python: str = sys.executable,
) -> Program:
    """Make the program that serves one of our adapters, or a class of the user's."""
    if CHECKOUT is None:
        ours = []
    else:
        ours = [str(CHECKOUT), str(PACKAGE.parent), str(CHECKOUT / "lab")]
    path = os.pathsep.join(filter(None, [*ours, os.environ.get("PYTHONPATH", "")]))
    return Program(
        (python, "-m", "fourbar_validation.engine", entry),
        seconds,
        (("PYTHONPATH", path),) * bool(path),
    )


def _name_program(entry: str, program: Program) -> str:
    """Name a guest whose hello is not read.

    The name is that of its class, or of the first argument that is a file, else of the
    program.
    """
    if CLASS_OF_THE_USER.fullmatch(entry):
        return entry.partition(":")[2]
    first, *arguments = program.command
    return (
        write_one_line(Path(next(filter(os.path.isfile, arguments), first)).stem)
        or "guest"
    )


def hash_files(paths: Iterable[str], besides: str = "") -> str:
    """Hash files with their names, and a text."""
    digest = hashlib.sha256()
    for path in paths:
        digest.update(
            f"{path} ".encode() + hashlib.sha256(Path(path).read_bytes()).digest()
        )
    digest.update(besides.encode())
    return digest.hexdigest()[:16]


def ask_hello(program: Program) -> Hello:
    """Start a program, read its hello and end it."""
    running = Running(program)
    try:
        return _read_hello(running.ask_again(HELLO, 0))
    finally:
        running.end()


def _read_hello(data: Message) -> Hello:
    """Check the hello of an engine; InputError names what is wrong."""

    def texts(
        name: str,
        default: Texts = (),
        allowed: Sequence[str] | None = None,
    ) -> Texts:
        values = data.get(name, list(default))
        if not isinstance(values, list) or not all(
            isinstance(value, str) for value in values
        ):
            raise InputError(name, values, "must be a list of texts")
        for value in values:
            if allowed is not None and value not in allowed:
                raise InputError(name, value, f"must be among {', '.join(allowed)}")
        return tuple(map(write_one_line, values))

    def text(name: str) -> str:
        return protocol.require_text(name, data.get(name, ""))

    if "error" in data:
        raise EngineError(text("error") or "the engine reported an error without text")
    name = text("engine")
    if not name or name != data["engine"]:
        wanted = "must be a name of printable characters in one line"
        raise InputError("engine", data.get("engine"), wanted)
    answers = texts("answers", allowed=ANSWERABLE_QUANTITIES)
    if not answers:
        wanted = f"must name quantities among {', '.join(ANSWERABLE_QUANTITIES)}"
        raise InputError("answers", data.get("answers"), wanted)
    if "four-bar" not in texts("mechanisms", ("four-bar",)):
        raise InputError("mechanisms", data["mechanisms"], 'must hold "four-bar"')
    return Hello(
        name,
        tuple(quantity for quantity in ANSWERABLE_QUANTITIES if quantity in answers),
        texts("commands", ("theta_2",), COMMANDED_NAMES),
        texts("effects", allowed=protocol.EFFECT_WORDS),
        _read_tolerance(data.get("tolerance", EQUIVALENCE.name)),
        text("version"),
        text("code"),
        texts("settings"),
        text("device"),
        text("made_for"),
    )


def _read_tolerance(stated: Any) -> ErrorBound:
    if stated == EQUIVALENCE.name:
        return EQUIVALENCE
    match stated:
        case [float(error), str(reason)] if 0.0 < error < 1.0 and reason.strip():
            reason = f"{error:g} of the scale: {write_one_line(reason)}"
            return ErrorBound(STATED_BY_THE_ENGINE, reason, error, conditioned=False)
    allowed = (
        f'must be "{EQUIVALENCE.name}", or [relative error above 0 and below 1, its'
        " reason]"
    )
    raise InputError("tolerance", stated, allowed)


def list_needs(scene: Scene) -> list[str]:
    """List what a scene asks of an engine, in the words of hello's `effects`."""
    needs = ["release"] * (scene.motion.free is not None)
    needs += [effect.key for effect in scene.effects]
    needs += ["loads"] * bool(scene.loads)
    for effect in scene.effects:
        if isinstance(effect, Springs) and any(one.acts for one in effect.springs):
            needs.append(protocol.ONE_SIDED)
    if scene.drive is not None:
        needs.append(name_drive(scene.drive))
    elif scene.drive_bar != 2:
        needs.append("drive")
    return needs


@dataclass
class GuestClient:
    """Client of a guest's program, which runs on from scene to scene.

    A program that failed is started again.
    """

    name: str
    program: Program
    hello: Hello
    trouble: str = ""
    """Why the hello was not read."""
    setting: Message = field(default_factory=dict)
    step: float | None = None
    """Step of a released motion, s."""

    @property
    def commands(self) -> Texts:
        """Return the names of what it can be commanded by."""
        return COMMANDED_NAMES if self.trouble else self.hello.commands

    def answer(self, scene: Scene, command: Command) -> Answer:
        """Return the answer of the guest; EngineError where it fails."""
        if refusal := self._explain_refusal(scene):
            return Answer(self.name, "exact", refusal=refusal)
        data = {"command": protocol.command_to_json(scene, command)}
        if self.setting:
            data["setting"] = self.setting
        n = len(command.angle)
        return self._ask(
            "answer",
            scene,
            data,
            n,
            partial(protocol.answer_from_json, self.name, command),
        )

    def release(self, scene: Scene, times: Array) -> Answer:
        """Return the released motion as the guest integrates it."""
        if refusal := self._explain_refusal(scene):
            return Answer(self.name, "-", refusal=refusal)
        data = protocol.release_to_json(scene)
        if self.step is not None:
            data["step"] = self.step
        n = len(times)
        return self._ask(
            "release",
            scene,
            data,
            n,
            partial(protocol.released_from_json, self.name, n),
        )

    def _explain_refusal(self, scene: Scene) -> str:
        if self.trouble:
            raise EngineError(self.trouble)
        name = self.setting.get("name")
        if name is not None and name not in self.hello.settings:
            return f"the engine's hello does not list {name!r} in settings"
        needs = list_needs(scene)
        lacking = [need for need in needs if need not in self.hello.effects]
        if lacking:
            return f"the engine's hello does not list {', '.join(lacking)} in effects"
        return ""

    def _ask(
        self,
        what: str,
        scene: Scene,
        data: Message,
        positions: int,
        read: Callable[[Any], _Read],
    ) -> _Read:
        """Ask about positions of a scene; EngineError where the reply is no answer."""
        question = {"ask": what, "scene": protocol.scene_to_json(scene), **data}
        running = _RUNNING.setdefault(self.program, Running(self.program))
        try:
            return read(running.ask_again(question, positions, self._greet))
        except InputError as error:
            raise EngineError(str(error)) from None

    def _greet(self, ask: Ask) -> None:
        if _read_hello(ask(HELLO, 0)) != self.hello:
            raise EngineError("the engine's hello changed after a restart")


_RUNNING: dict[Program, Running] = {}
"""The programs that this process started."""
