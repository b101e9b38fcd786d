"""Scenes, commands and answers as JSON.

A judge sends them to an engine outside, and gets them back. SI units and radians. A
scene travels as it is stated, a command holds what is commanded and nothing that the
formulas computed; null stands where there is no value. docs/protocol.md is the
contract.
"""

import math
import re
from collections.abc import Container, Mapping
from contextlib import suppress
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np

from fourbar.effects import list_kinds
from fourbar.errors import InputError
from fourbar.files.fields import Entry, SceneFile, Written
from fourbar.files.scene_file import read_scene
from fourbar.files.scene_text import list_scene_tables
from fourbar.formulas.many_digits import WORKING_DIGITS
from fourbar.linkage import BAR_NAMES, MOVING_BARS, Bar
from fourbar.quantities import VECTORS, Array
from fourbar.scene import (
    Command,
    LimitOrigin,
    Scene,
    StrokeOrigin,
    find_signs,
    with_signs,
)
from fourbar.scene import command as command_of
from fourbar.scene.motion import (
    BAR_OF_ANGLE,
    COMMAND_NAMES,
    STROKE_COMMAND,
    Free,
    Motion,
)
from fourbar_validation.compare.answer import (
    RELEASED_QUANTITIES,
    Answer,
    Arrays,
    EngineError,
)
from fourbar_validation.compare.pins import find_mass, state_from_pins
from fourbar_validation.compare.rows import write_one_line
from fourbar_validation.compare.tolerance import OF_THE_COMMAND
from fourbar_validation.engines.programs import Message

PROTOCOL = 4
"""Number of the contract; a change that an engine must know of raises it."""
_FURTHEST = 0.1
"""rad, and part of the greatest speed and acceleration: a motion that ends further from
the command than this answers another question.
"""
ONE_SIDED = "one_sided"
"""Word of a hello's `effects` for springs that act one way."""
WITH_COUPLES = (*list_kinds(), "loads", "drive")
"""Words for all that acts in a linkage which a couple drives."""
EFFECT_WORDS = (*WITH_COUPLES, "cylinder", "push", ONE_SIDED, "release")
"""Words that a hello may list in `effects`."""
DESCRIBED_TABLES = ("lengths", "bars", "drive", "loads", "effects")
KINDS_OF_COMMAND = (*COMMAND_NAMES.values(), STROKE_COMMAND)


class _NumberEntry(Entry):
    """An entry with numbers in SI and radians in place of texts with units."""

    UNSTATED = (str,)
    FORM = "must be a number, in {}"

    def refuse(self, allowed: str) -> InputError:
        """Make the error, in which a number has no unit beside it."""
        return super().refuse(re.sub('"1 (.+?)"', r"1 (in \1)", allowed))


def scene_to_json(scene: Scene) -> Message:
    """Write lengths, bars, drive, loads and effects of a scene.

    Raises InputError for an effect that no scene file holds. Every place is a pair from
    its bar's first pin, but for the arm of a load. A bar has its mass, whatever states
    it. Points, the place of a moment alone and strokes of gas springs, which change no
    answer, are left out.
    """
    bars: Message = {
        BAR_NAMES[number]: Bar(
            bar.length,
            find_mass(bar),
            bar.inertia,
            bar.centre,
        )
        for number, bar in zip(MOVING_BARS, scene.linkage.moving, strict=True)
    }
    plain = replace(scene, linkage=replace(scene.linkage, **bars))
    tables: Message = _take_numbers(list_scene_tables(state_from_pins(plain)))
    for load in tables["loads"]:
        if "force" not in load:
            load.pop("from_pin", None)
    for spring in tables["effects"].get("springs", ()):
        spring.pop("stroke", None)
    del tables["points"]
    return {name: table for name, table in tables.items() if table}


def _take_numbers(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _take_numbers(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_take_numbers(entry) for entry in value]
    if isinstance(value, Written):
        return value.value
    return value


def scene_from_json(data: Any) -> Scene:
    """Read a scene, whose motion is stated elsewhere.

    Raises an InputError that names what is wrong.
    """
    entry = _NumberEntry(SceneFile("scene"), "", data)
    try:
        entry.table(DESCRIBED_TABLES)
        return read_scene(entry, ".")
    except InputError as error:
        raise (error if error.file else error.in_file("scene")) from None


def command_to_json(scene: Scene, command: Command) -> Message:
    """Write what is commanded: place, speed, acceleration and branch.

    The place is an angle or a stroke.
    """
    place, speed, acceleration = command.names
    values = command.stated
    data = {place: np.asarray(values[0], dtype=float).tolist()}
    if values[1] is not None:
        for name, rate in ((speed, values[1]), (acceleration, values[2])):
            data[name] = np.asarray(rate, dtype=float).tolist()
    if command.moves_stroke:
        data["side"] = scene.motion.side
    same = bool((command.branch == command.branch[0]).all())
    data["branch"] = int(command.branch[0]) if same else command.branch.tolist()
    if command.time is not None:
        data["time"] = command.time.tolist()
    if command.remainder is not None:
        from mpmath import mp, mpf

        with mp.workdps(WORKING_DIGITS):
            digits = str(
                mp.nstr(mpf(command.remainder), WORKING_DIGITS + 5)
            )  # they read back as they were
        data["remainder"] = [digits] * len(command.angle)
    return data


def command_from_json(scene: Scene, data: Any) -> tuple[Scene, Command]:
    """Read a command; the scene gets the motion that it states.

    Raises an InputError that names what is wrong.
    """
    names = _find_names(data)
    of_stroke = names == STROKE_COMMAND
    further = ("branch", "time", "remainder", *(("side",) if of_stroke else ()))
    _refuse_unknown(data, (*names, *further))
    places, omega, alpha = _read_motion(names, data)
    n = len(places)
    branch = _read_branch(data.get("branch", 1), n)
    rates = zip(names[1:], (omega, alpha), strict=True)
    stated: Message = {name: rate for name, rate in rates if isinstance(rate, float)}
    if of_stroke:
        stated["side"] = data.get("side")
    stated |= {names[0]: places, "branch": int(branch[0])}
    scene = replace(scene, motion=Motion(**stated))
    if alpha is None:
        alpha = 0.0
    time = None
    if data.get("time") is not None:
        time = _read_numbers("command.time", data["time"], n)
    bar = scene.motion.bar
    if of_stroke:
        unknown: Array = np.full(n, np.nan)  # no motion of the bar is commanded
        speed_of_bar = None if omega is None else unknown
        origin = StrokeOrigin(places, omega, alpha)
        return scene, Command(unknown, branch, speed_of_bar, unknown, bar, time, origin)
    remainder = _read_digits(data.get("remainder"), n)
    limit = None if remainder is None else LimitOrigin(remainder)
    return scene, Command(places, branch, omega, alpha, bar, time, limit)


def _find_names(data: Any) -> tuple[str, str, str]:
    """Return the names of what is commanded, of its speed and of its acceleration."""
    if not isinstance(data, dict):
        raise InputError("command", data, "must be an object")
    stated = [names for names in KINDS_OF_COMMAND if names[0] in data]
    if len(stated) != 1:
        kinds = ", ".join(names[0] for names in KINDS_OF_COMMAND)
        raise InputError("command", sorted(map(str, data)), f"must have one of {kinds}")
    return stated[0]


def _refuse_unknown(data: Message, allowed: tuple[str, ...]) -> None:
    for name, value in data.items():
        if name not in allowed:
            raise InputError(
                f"command.{write_one_line(name)}",
                value,
                f"unknown key; allowed: {', '.join(allowed)}",
            )


def _read_motion(
    names: tuple[str, str, str], data: Message, n: int | None = None
) -> tuple[Array, float | Array | None, float | Array | None]:
    """Read angles, rad, or strokes, m, (n,), with their speed and acceleration.

    A rate is one number or (n,), per s or s^2; None: it is not stated.
    """
    places = _read_numbers(f"command.{names[0]}", data[names[0]], n)
    n = len(places)
    speed, acceleration = (
        None if data.get(name) is None else _read_rate(name, data[name], n)
        for name in names[1:]
    )
    return places, speed, acceleration


def _read_rate(name: str, value: Any, n: int) -> float | Array:
    """Read one number of all positions, or n of them."""
    key = f"command.{name}"
    if isinstance(value, list):
        return _read_numbers(key, value, n)
    return _read_number(key, value, f"must be a finite number, or a list of {n}")


def _read_number(
    key: str, value: Any, allowed: str = "must be a finite number"
) -> float:
    """Read a finite number."""
    array = _make_array([value], gaps=False)
    if array is None:
        raise InputError(key, value, allowed)
    return float(array[0])


def _read_numbers(
    key: str,
    value: Any,
    n: int | None = None,
    *,
    pairs: bool = False,
    gaps: bool = False,
) -> Array:
    """Read n numbers, or n pairs of them; without n, one number or more.

    `gaps`: null becomes NaN.
    """
    kind = "pairs [x, y]" if pairs else "numbers"
    wanted = f"must be a list of {'one or more' if n is None else n} {kind}"
    if gaps:
        wanted += ", null where there is no value"
    if not isinstance(value, list):
        raise InputError(key, value, wanted)
    if len(value) != (n or len(value) or 1):
        raise InputError(f"entries of {key}", len(value), wanted)
    entries = value
    if pairs:
        both = [(None, None) if pair is None else pair for pair in value]
        if any(not isinstance(pair, (list, tuple)) or len(pair) != 2 for pair in both):
            raise InputError(key, both, wanted)
        entries = list(chain.from_iterable(both))
    array = _make_array(entries, gaps)
    if array is None:
        wrong = next(
            i for i, one in enumerate(entries) if _make_array([one], gaps) is None
        )
        place = f"{key}, entry {wrong // (1 + pairs)}"
        allowed = "must be a finite number" + " or null" * gaps
        raise InputError(place, entries[wrong], allowed)
    return array.reshape(-1, 2) if pairs else array


def _read_branch(value: Any, n: int) -> Any:
    branches = value if isinstance(value, list) else [value] * n
    if len(branches) != n or any(
        type(branch) is not int or branch not in (1, -1) for branch in branches
    ):
        wanted = f"must be 1 (open) or -1 (crossed), or a list of {n}"
        raise InputError("command.branch", value, wanted)
    return np.array(branches, dtype=np.int8)


def _read_digits(value: Any, n: int) -> Any:
    """Return the part of the angle that its double leaves out, as `Command.remainder`.

    All positions of a question have the same.
    """
    if value is None:
        return None
    from mpmath import mp, mpf

    wrong = value
    equal = isinstance(value, list) and value == value[:1] * n
    if equal and value and isinstance(value[0], str):
        wrong = value[0]
        with mp.workdps(WORKING_DIGITS), suppress(ValueError):
            number = mpf(wrong)
            if mp.isfinite(number):
                return number
    wanted = f"must be a list of {n} equal decimal texts"
    raise InputError("command.remainder", wrong, wanted)


def _make_array(values: list[Any], gaps: bool) -> Array | None:
    """Make an array of numbers, and with gaps of None, which becomes NaN.

    None if there is anything else.
    """
    if not set(map(type, values)) <= {int, float, *([type(None)] * gaps)}:
        return None
    try:
        array = np.array(values, dtype=float)
    except OverflowError:  # an integer beyond the doubles
        return None
    # a number beyond the doubles reads as infinity, and NaN is no JSON: no value is
    # null
    if np.isfinite(array).sum() == len(values) - values.count(None):
        return array
    return None


def answer_to_json(
    scene: Scene,
    command: Command | None,
    answer: Answer,
) -> Message:
    """Write an answer, without the engine's name, which its hello states.

    Without a command the answer is a released motion.
    """
    if answer.refusal is not None:
        return {"refusal": answer.refusal, "setting": answer.setting}
    data: Message = {"answers": _write_arrays(answer.quantities)}
    if answer.at is not None and answer.at is not command:
        data["at"] = command_to_json(scene, answer.at)
    if answer.assembled is not None:
        data["assembled"] = np.asarray(answer.assembled, dtype=bool).tolist()
    data["setting"] = answer.setting
    data["predicted"] = _write_arrays(answer.predicted)
    data["evidence"] = _write_arrays(answer.evidence)
    data |= {
        name: getattr(answer, name) for name in ("alarms", "shared", "own", "seconds")
    }
    return {name: value for name, value in data.items() if value or name == "answers"}


def _write_arrays(arrays: Mapping[str, Any]) -> Message:
    """Write numbers or pairs of them; null where there is no finite number."""
    written = {}
    for name, array in arrays.items():
        numbers = np.asarray(array)
        if numbers.dtype.kind not in "iuf":
            raise TypeError(f"an answer holds real numbers, not {numbers.dtype}")
        numbers = numbers.astype(float)
        if not np.isfinite(numbers).all():
            numbers = np.where(np.isfinite(numbers), numbers, None)  # type: ignore[call-overload]
        written[name] = numbers.tolist()
    return written


def answer_from_json(
    engine: str,
    command: Command,
    data: Any,
) -> Answer:
    """Read and check what an engine answered to a command.

    Raises InputError for what is no answer, and EngineError with the engine's words
    where it broke down.
    """
    data, setting, refusal = _read_reply(data)
    if refusal:
        return Answer(engine, setting, refusal=refusal)
    n = len(command.angle)
    quantities = _read_arrays("answers", data, n)
    alarms = data.get("alarms") or []
    if not isinstance(alarms, list):
        raise InputError("alarms", alarms, "must be a list of texts")
    predicted = _read_arrays("predicted", data, n, ())
    evidence = _read_object("evidence", data)
    allowed = "must be a number of 0 or more"
    seconds = _read_number("seconds", data.get("seconds", 0.0), allowed)
    if seconds < 0.0:
        raise InputError("seconds", seconds, allowed)
    return Answer(
        engine,
        setting,
        read_answered_motion(data.get("at"), command),
        _read_assembled(data.get("assembled"), quantities, command),
        quantities,
        predicted=predicted,
        alarms=[require_text("alarms", alarm) for alarm in alarms],
        evidence={
            name: float(_read_numbers(f"evidence.{name}", [value], gaps=True)[0])
            for name, value in evidence.items()
        },
        shared=require_text("shared", data.get("shared", "")) or "not stated",
        own=require_text("own", data.get("own", "")) or "not stated",
        seconds=seconds,
    )


def _read_reply(data: Any) -> tuple[Message, str, str]:
    """Return the object that an engine replied with, its setting and its refusal.

    Raises EngineError with its own words if it broke down.
    """
    if not isinstance(data, dict):
        raise InputError("answer", data, "must be an object")
    if "error" in data:
        raise EngineError(
            require_text("error", data["error"])
            or "the engine reported an error without text"
        )
    setting = require_text("setting", data.get("setting", "exact"))
    refusal = ""
    if "refusal" in data:
        refusal = require_text("refusal", data["refusal"])
        if not refusal:
            raise InputError("refusal", data["refusal"], "must say why")
    return data, setting, refusal


def require_text(name: str, value: Any) -> str:
    """Return a text in one line; InputError for what is none."""
    if not isinstance(value, str):
        raise InputError(name, value, "must be a text")
    return write_one_line(value)


def _read_object(name: str, data: Message) -> Message:
    value = data.get(name)
    if value is None and name != "answers":
        return {}
    if not isinstance(value, dict):
        raise InputError(name, value, "must be an object")
    return {write_one_line(key): entry for key, entry in value.items()}


def _read_arrays(
    table: str, data: Message, n: int, vectors: Container[str] = VECTORS
) -> Arrays:
    """Read n numbers under each name, or n pairs of them."""
    return {
        name: _read_numbers(
            f"{table}.{name}", values, n, pairs=name in vectors, gaps=True
        )
        for name, values in _read_object(table, data).items()
    }


def _read_assembled(
    value: Any,
    quantities: Arrays,
    command: Command,
) -> Any:
    """Read where the loop closes; left out: wherever there is a value.

    What the command alone decides has one at every position and tells nothing, unless
    it is all that is answered.
    """
    n = len(command.angle)
    if value is None:
        telling = quantities.keys() - OF_THE_COMMAND[command.bar] or quantities
        valued = [
            np.isfinite(quantities[name]).reshape(n, -1).any(axis=1) for name in telling
        ]
        if valued:
            return np.any(valued, axis=0)
        return np.zeros(n, dtype=bool)
    if (
        not isinstance(value, list)
        or len(value) != n
        or any(type(entry) is not bool for entry in value)
    ):
        raise InputError("assembled", value, f"must be a list of {n} true or false")
    return np.array(value, dtype=bool)


def read_answered_motion(data: Any, command: Command) -> Command:
    """Read the motion that an engine made; left out: the command."""
    if data is None:
        return command
    names = _find_names(data)
    n = len(command.angle)
    taken = KINDS_OF_COMMAND[:-1]
    if not command.moves_stroke:
        taken = (COMMAND_NAMES[command.bar],)
    if names not in taken:
        raise InputError(
            "at",
            sorted(data),
            f"must have {command.commanded}, or for a stroke an angle of its bar",
        )
    branch = command.branch
    if "branch" in data:
        branch = _read_branch(data["branch"], n)
    angle, speed, acceleration = _read_motion(names, data, n)
    if acceleration is None:
        acceleration = 0.0 if command.moves_stroke else command.acceleration
    made = Command(angle, branch, speed, acceleration, bar=BAR_OF_ANGLE[names[0]])
    if command.moves_stroke:  # no motion of the bar is commanded: the caller knows it
        return made
    require_near(made, command)
    parts = zip(made[:4], command[:4], strict=True)
    if all(np.array_equal(x, y) for x, y in parts):  # type: ignore[arg-type]
        return command
    return command.as_doubles()._replace(
        angle=angle, speed=speed, acceleration=acceleration
    )


def require_near(made: Command, command: Command) -> None:
    """Raise InputError if the motion that an engine made is no answer.

    The motion is held against the command.
    """
    same = made.bar == command.bar and np.array_equal(made.branch, command.branch)
    if not same or (made.speed is None) != (command.speed is None):
        raise InputError(
            "at",
            made.commanded,
            "must have the bar and branch of the command, and speeds where that has",
        )
    speed, acceleration = (
        0.0 if x is None else float(np.abs(x).max())
        for x in (command.speed, command.acceleration)
    )
    # the positions of a command are independent; an engine that runs through time is
    # faster by what accelerates it
    faster = 1.0
    if speed:
        turned = float(np.ptp(command.angle))
        # no square of a speed that a double has not
        faster = math.sqrt(1.0 + 2.0 * (acceleration / speed) * (turned / speed))
    most = {
        "angle": _FURTHEST,
        "speed": (_FURTHEST + faster - 1.0) * speed,
        "acceleration": (_FURTHEST + faster**2 - 1.0) * (speed**2 + acceleration),
    }
    for key, (name, apart) in zip(
        COMMAND_NAMES[command.bar], most.items(), strict=True
    ):
        value = getattr(made, name)
        commanded = getattr(command, name)
        if value is not None and not np.abs(value - commanded).max() <= apart:
            allowed = f"must be within {apart:g} of the command"
            raise InputError(f"at.{key}", None, allowed)


def read_setting(data: Any) -> Message:
    """Read the setting of a question, none if it is left out.

    Raises an InputError that names what is wrong.
    """
    if data is None:
        return {}
    allowed = (
        "must be an object with name, and steps_per_turn (a whole number above 0) or"
        " error (above 0, below 1)"
    )
    checks = {
        "name": lambda value: isinstance(value, str),
        "steps_per_turn": lambda value: type(value) is int and value > 0,
        "error": lambda value: type(value) is float and 0.0 < value < 1.0,
    }
    fits = isinstance(data, dict) and all(
        key in checks and checks[key](value) for key, value in data.items()
    )
    if not fits or {"steps_per_turn", "error"} <= data.keys():
        raise InputError("setting", data, allowed)
    return dict(data)


def release_to_json(scene: Scene) -> Message:
    """Write the start and the times of a released motion."""
    motion = scene.motion
    free = scene.motion.free
    assert free is not None
    start = {"theta_2": float(motion.theta_2), "omega_2": motion.omega_2 or 0.0}
    sign = with_signs(scene.linkage, command_of(scene)).branch
    command = {**start, "branch": int(sign[0])}
    return {
        "command": command,
        "times": np.linspace(0.0, free.duration, free.steps + 1).tolist(),
    }


def release_from_json(
    scene: Scene,
    command: Any,
    times: Any,
) -> Scene:
    """Read the start of a released motion into a scene.

    Raises an InputError that names what is wrong.
    """
    if not isinstance(command, dict) or "theta_2" not in command:
        raise InputError(
            "command",
            command,
            "must be an object with theta_2, omega_2 and branch",
        )
    _refuse_unknown(command, ("theta_2", "omega_2", "branch"))
    instants = _read_numbers("times", times)
    theta, omega = (
        _read_number(f"command.{name}", command.get(name, 0.0))
        for name in ("theta_2", "omega_2")
    )
    sign = _read_branch(command.get("branch", 1), 1)
    assembly = find_signs(scene.linkage, np.array([theta]), sign)
    free = Free(float(instants[-1]), len(instants) - 1)
    return replace(
        scene,
        motion=Motion(theta, omega, 0.0, int(assembly[0]), free),
    )


def released_from_json(engine: str, n: int, data: Any) -> Answer:
    """Read and check a released motion at n times, as `answer_from_json` does."""
    data, setting, refusal = _read_reply(data)
    if refusal:
        return Answer(engine, setting, refusal=refusal)
    answers = _read_object("answers", data)
    quantities = {
        name: _read_numbers(f"answers.{name}", answers.get(name), n, gaps=True)
        for name in RELEASED_QUANTITIES
    }
    return Answer(engine, setting, quantities=quantities)
