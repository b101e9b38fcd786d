"""`python -m fourbar_validation.engine NAME | MODULE:CLASS`: serve an engine.

The engine answers by the protocol, one line a question. NAME is one of our adapters.
docs/protocol.md states what a class has.
"""

import json
import os
import sys
import sysconfig
import traceback
from collections.abc import Callable, Sequence
from importlib import import_module
from importlib.metadata import PackageNotFoundError, distributions, version
from pathlib import Path
from typing import IO, Any

import numpy as np

from fourbar.errors import InputError, LimitError
from fourbar.quantities import UNKNOWNS
from fourbar_validation.compare.answer import Answer, explain_refusal
from fourbar_validation.compare.rows import say_error
from fourbar_validation.engines import protocol
from fourbar_validation.engines.guests import NOT_FOUND, adjust_engines, hash_files
from fourbar_validation.engines.programs import Message
from fourbar_validation.engines.registry import list_engines
from fourbar_validation.places import PACKAGE
from fourbar_validation.report.machine import DISTRIBUTIONS

OURS = frozenset(sys.modules)
"""Modules that were imported before those of the engine."""
_Factory = Callable[..., Any]
"""Function that makes an engine. Its keywords are those of a question's setting, or the
step of a released motion.
"""


class _NotFoundError(Exception):
    """Error raised if there is no such engine."""


def open_engine(entry: str) -> tuple[_Factory, Message]:
    """Return what makes an engine, and its hello.

    Raises _NotFoundError where there is none.
    """
    if ":" in entry:
        return _open_class(entry)
    engines = list_engines()
    if entry not in engines:
        raise _NotFoundError(f"must be module:Class, or one of {', '.join(engines)}")
    engine = engines[entry]
    if reason := engine.missing():
        raise _NotFoundError(reason)
    adapter = engine.start()
    hello = {
        "engine": entry,
        "answers": list(engine.answers),
        "commands": list(getattr(adapter, "commands", ("theta_2",))),
        "effects": list(protocol.EFFECT_WORDS[:-1]),
    }
    library = engine.library.removeprefix("py")  # pydrake is of the distribution drake
    try:
        hello["version"] = version(DISTRIBUTIONS.get(library, "fourbar"))
    except PackageNotFoundError:
        hello["version"] = ""

    def make(error: float | None = None, **setting: Any) -> Any:
        if error is None:
            laid_out = engine
        else:
            laid_out = adjust_engines((engine,), error)[0]
        return _apply_setting(laid_out.start(), setting, ())

    return make, hello


def _apply_setting(
    engine: Any,
    setting: Message,
    names: Sequence[str],
) -> Any:
    """Return the engine with a setting.

    One that takes none has no timestep, and no error but round-off.
    """
    if "name" in setting and setting["name"] not in names:
        raise LimitError(
            f"it has no setting {setting['name']!r}; it has:"
            f" {', '.join(names) or 'none'}"
        )
    if setting and hasattr(engine, "at_setting"):
        return engine.at_setting(**setting)
    return engine


def _open_class(entry: str) -> tuple[_Factory, Message]:
    module, _, name = entry.partition(":")
    if os.getcwd() not in sys.path:
        sys.path.append(os.getcwd())
    try:
        served = getattr(import_module(module), name)
    except (ModuleNotFoundError, AttributeError) as error:
        if getattr(error, "name", None) in (module, module.partition(".")[0], name):
            raise _NotFoundError(say_error(error)) from None
        raise
    hello: Message = {
        "engine": getattr(served, "name", None),
        "answers": getattr(served, "quantities", UNKNOWNS),
        "commands": getattr(served, "commands", ("theta_2",)),
        "effects": [
            *getattr(served, "effects", protocol.WITH_COUPLES),
            *(["release"] * hasattr(served, "release")),
        ],
        "tolerance": getattr(served, "tolerance", "equivalence"),
        "version": str(getattr(served, "version", "")),
        "code": _hash_code(module),
        "settings": list(getattr(served, "settings", ())),
        "device": getattr(served, "device", ""),
        "made_for": getattr(served, "made_for", ""),
    }

    def make(step: float | None = None, **setting: Any) -> Any:
        return _apply_setting(
            served() if step is None else served(step),
            setting,
            hello["settings"],
        )

    return make, hello


def _hash_code(module: str) -> str:
    """Hash the modules imported with a class, and the others in its folder.

    What is installed is hashed too.
    """
    files = {
        getattr(loaded, "__file__", None)
        for name, loaded in list(sys.modules.items())
        if name not in OURS
    }
    if file := sys.modules[module].__file__:
        files |= {str(path) for path in Path(file).parent.glob("*.py")}
    present = sorted(
        file for file in files if file and os.path.isfile(file)
    )  # modules made by code may name none
    return hash_files(
        present,
        repr(
            sorted(f"{package.name} {package.version}" for package in distributions())
        ),
    )


def answer(make: _Factory, question: Message) -> Message:
    """Answer one question."""
    scene = protocol.scene_from_json(question["scene"])
    if question["ask"] == "release":
        scene = protocol.release_from_json(
            scene,
            question["command"],
            question["times"],
        )
        step = {"step": float(question["step"])} if "step" in question else {}
        released = make(**step).release(scene, np.array(question["times"]))
        return protocol.answer_to_json(scene, None, released)
    scene, command = protocol.command_from_json(scene, question["command"])
    try:
        engine = make(**protocol.read_setting(question.get("setting")))
    except LimitError as limit:
        return {"refusal": str(limit)}
    if question["ask"] == "slopes":
        if hasattr(engine, "slopes"):
            return {"slopes": engine.slopes(scene)}
        return {"refusal": "it has no derivatives"}
    if not hasattr(engine, "answer"):
        return {"refusal": "it integrates released motions alone"}
    if refusal := explain_refusal(engine, command):
        return {"refusal": refusal}
    reply = engine.answer(scene, command)
    if not isinstance(reply, Answer):
        raise TypeError(
            f"the answer is a {type(reply).__name__}, not a fourbar_validation.Answer"
        )
    return protocol.answer_to_json(scene, command, reply)


def _say_where(error: BaseException) -> str:
    """Say in which line of the engine's own code an error was raised."""
    frames = [
        frame
        for frame in traceback.extract_tb(error.__traceback__)
        if not Path(frame.filename).is_relative_to(PACKAGE)
    ]
    installed = sysconfig.get_path("purelib"), sysconfig.get_path("stdlib")
    own = [frame for frame in frames if not frame.filename.startswith(installed)]
    for frame in (own or frames)[-1:]:
        return f" ({frame.filename}, line {frame.lineno})"
    return ""


def serve(
    entry: str,
    questions: IO[bytes],
    replies: IO[bytes],
) -> None:
    """Answer line by line, until there are no more."""
    engine: _Factory | None = None
    for line in questions:
        question = json.loads(line)
        try:
            if engine is None:
                engine, hello = open_engine(entry)
            if question["ask"] == "hello":
                reply = hello
            elif question["ask"] in ("answer", "release", "slopes"):
                reply = answer(engine, question)
            else:
                reply = {"error": f"unknown question {question['ask']!r}"}
            text = json.dumps({"id": question["id"], **reply}, allow_nan=False)
        except _NotFoundError:
            raise
        except InputError as error:
            text = json.dumps({"id": question["id"], "error": str(error)})
        except BaseException as error:  # whatever a class of the user's raises
            traceback.print_exception(error)  # to output.txt
            told = f"{say_error(error)}{_say_where(error)}"
            text = json.dumps({"id": question["id"], "error": told})
        replies.write(text.encode() + b"\n")
        replies.flush()


if __name__ == "__main__":
    with os.fdopen(os.dup(0), "rb") as questions, os.fdopen(os.dup(1), "wb") as replies:
        with open(os.devnull, "rb") as nothing:
            os.dup2(nothing.fileno(), 0)
        os.dup2(2, 1)  # an engine's prints are no answer
        try:
            serve(" ".join(sys.argv[1:]), questions, replies)
        except _NotFoundError as error:
            print(error, file=sys.stderr)
            sys.exit(NOT_FOUND)
