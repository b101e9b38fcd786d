"""Scenes, commands and answers as JSON.

A judge sends them to an engine outside, and gets them back. SI units and radians. A
scene travels as it is stated, a command holds what is commanded and nothing that the
formulas computed; null stands where there is no value. docs/protocol.md is the
contract.
"""

import math
from collections.abc import Iterable
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np

from fourbar.errors import InputError
from fourbar.files.fields import Reader, Written
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
from fourbar_validation.compare.answer import Answer, EngineError, ReleasedAnswer
from fourbar_validation.compare.pins import find_mass, state_from_pins
from fourbar_validation.compare.rows import write_one_line

PROTOCOL = 4
"""Number of the contract; a change that an engine must know of raises it."""
_FURTHEST = 0.1
"""rad, and part of the greatest speed and acceleration: a motion that ends further from
the command than this answers another question.
"""
ONE_SIDED = "one_sided"
"""Word of a hello's `effects` for springs that act one way."""
DESCRIBED_TABLES = ("lengths", "bars", "drive", "loads", "effects")
KINDS_OF_COMMAND = (*COMMAND_NAMES.values(), STROKE_COMMAND)
_OF_RELEASED = ("theta_2", "omega_2", "energy", "terms")


class _NumberReader(Reader):
    """Reads numbers in SI and radians where a scene file has texts with units."""

    QUANTITY = "in {}"
    QUANTITIES = "[1.0, 2.0], in {}"
    POLAR = "[1.0, 0.0], in {} and rad"
    COORDINATES = ""

    def in_si(
        self,
        key: str,
        value: object,
        unit: str,
        wanted: str,
    ) -> float:
        if type(value) is int and value.bit_length() < 1024:
            return float(value)
        if type(value) is not float or not math.isfinite(value):
            raise self.refuse(key, value, wanted)
        return value


def scene_to_json(scene: Scene) -> dict[str, Any]:
    """Write lengths, bars, drive, loads and effects of a scene.

    Raises InputError for an effect that no scene file holds. Every place is a pair from
    its bar's first pin, but for the arm of a load. A bar has its mass, whatever states
    it. Points, the place of a moment alone and strokes of gas springs, which change no
    answer, are left out.
    """
    bars: dict[str, Any] = {
        BAR_NAMES[number]: Bar(
            bar.length,
            find_mass(bar),
            bar.inertia,
            bar.centre,
        )
        for number, bar in zip(MOVING_BARS, scene.linkage.moving, strict=True)
    }
    plain = replace(scene, linkage=replace(scene.linkage, **bars))
    tables: dict[str, Any] = _take_numbers(list_scene_tables(state_from_pins(plain)))
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
    read = _NumberReader("scene")
    try:
        return read_scene(read, read.table("", data, DESCRIBED_TABLES), ".")
    except InputError as error:
        raise (error if error.file else error.in_file("scene")) from None


def command_to_json(scene: Scene, command: Command) -> dict[str, Any]:
    """Write what is commanded: place, speed, acceleration and branch.

    The place is an angle or a stroke.
    """
    place, speed, acceleration = command.names
    values = command.stated
    data = {place: _write_json_numbers(values[0])}
    if values[1] is not None:
        data |= {
            speed: _write_json_numbers(values[1]),
            acceleration: _write_json_numbers(values[2]),
        }
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


def _write_json_numbers(value: Any) -> Any:
    if np.ndim(value) == 0:
        return float(value)
    return np.asarray(value, dtype=float).tolist()


def command_from_json(scene: Scene, data: Any) -> tuple[Scene, Command]:
    """Read a command; the scene gets the motion that it states.

    Raises an InputError that names what is wrong.
    """
    names = _find_names(data)
    place, speed, acceleration = names
    _refuse_unknown(
        data,
        (
            *names,
            "branch",
            "time",
            "remainder",
            *(("side",) if place == "stroke" else ()),
        ),
    )
    places = _read_list(place, data[place])
    n = len(places)
    rates = {
        name: _read_rate(name, data[name], n)
        for name in names[1:]
        if data.get(name) is not None
    }
    branch = _read_branch(data.get("branch", 1), n)
    stated: dict[str, Any] = {
        name: rate for name, rate in rates.items() if isinstance(rate, float)
    }
    if place == "stroke":
        stated["side"] = data.get("side")
    stated |= {
        place: places,
        "branch": int(branch[0]),
    }
    scene = replace(scene, motion=Motion(**stated))
    omega = rates.get(speed)
    alpha = rates.get(acceleration, 0.0)
    if data.get("time") is not None:
        time = _read_list("time", data["time"], n)
    else:
        time = None
    bar = scene.motion.bar
    if place == "stroke":
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


def _refuse_unknown(data: dict[str, Any], allowed: tuple[str, ...]) -> None:
    for name, value in data.items():
        if name not in allowed:
            raise InputError(
                f"command.{write_one_line(name)}",
                value,
                f"unknown key; allowed: {', '.join(allowed)}",
            )


def _read_list(
    name: str,
    value: Any,
    n: int | None = None,
) -> Array:
    if n is None:
        wanted = "must be a list of one finite number or more"
    else:
        wanted = f"must be a list of {n} finite numbers"
    if not isinstance(value, list) or not value or len(value) not in (n or len(value),):
        raise InputError(f"command.{name}", value, wanted)
    array = _make_array(value)
    if array is None or not np.isfinite(array).all():
        raise InputError(f"command.{name}", value, wanted)
    return array


def _read_rate(
    name: str,
    value: Any,
    n: int,
) -> float | Array:
    if isinstance(value, list):
        return _read_list(name, value, n)
    array = _make_array([value])
    if array is None or not np.isfinite(array).all():
        raise InputError(
            f"command.{name}",
            value,
            f"must be a finite number, or a list of {n}",
        )
    return float(array[0])


def _read_branch(value: Any, n: int) -> Any:
    branches = value if isinstance(value, list) else [value] * n
    if len(branches) != n or any(
        type(branch) is not int or branch not in (1, -1) for branch in branches
    ):
        raise InputError(
            "command.branch",
            value,
            f"must be 1 (open) or -1 (crossed), or a list of {n}",
        )
    return np.array(branches, dtype=np.int8)


def _read_digits(value: Any, n: int) -> Any:
    """Return the part of the angle that its double leaves out, as `Command.remainder`.

    All positions of a question have the same.
    """
    if value is None:
        return None
    from mpmath import mp, mpf

    wanted = f"must be a list of {n} equal decimal texts"
    if (
        not isinstance(value, list)
        or len(value) != n
        or not isinstance(value[0], str)
        or value != value[:1] * n
    ):
        raise InputError("command.remainder", value, wanted)
    try:
        with mp.workdps(WORKING_DIGITS):
            number = mpf(value[0])
    except ValueError:
        raise InputError("command.remainder", value[0], wanted) from None
    if not mp.isfinite(number):
        raise InputError("command.remainder", value[0], wanted)
    return number


def _make_array(values: Iterable[Any]) -> Array | None:
    """Make an array of numbers and None, which becomes NaN.

    None if there is anything else.
    """
    values = list(values)
    if not set(map(type, values)) <= {int, float, type(None)}:
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
    command: Command,
    answer: Answer,
) -> dict[str, Any]:
    """Write an answer, without the engine's name, which its hello states."""
    if answer.refusal is not None:
        return {"refusal": answer.refusal, "setting": answer.setting}
    data: dict[str, Any] = {
        "answers": {
            name: _write_array(array) for name, array in answer.quantities.items()
        }
    }
    if answer.at is not None and answer.at is not command:
        data["at"] = command_to_json(scene, answer.at)
    if answer.assembled is not None:
        data["assembled"] = np.asarray(answer.assembled, dtype=bool).tolist()
    data["setting"] = answer.setting
    data["predicted"] = {
        name: _write_array(array) for name, array in answer.predicted.items()
    }
    data["evidence"] = {
        name: float(x) if math.isfinite(x) else None
        for name, x in answer.evidence.items()
    }
    data |= {
        name: getattr(answer, name) for name in ("alarms", "shared", "own", "seconds")
    }
    return {name: value for name, value in data.items() if value or name == "answers"}


def _write_array(array: Array) -> list[Any]:
    """Write numbers or pairs of them; null where there is no finite number."""
    numbers = np.asarray(array)
    if numbers.dtype.kind not in "iuf":
        raise TypeError(f"an answer holds real numbers, not {numbers.dtype}")
    array = numbers.astype(float)
    finite = np.isfinite(array)
    if finite.all():
        values: Any = array
    else:
        values = np.where(finite, array, np.full(array.shape, None))
    return values.tolist()  # type: ignore[no-any-return]


def answer_from_json(
    engine: str,
    command: Command,
    data: Any,
) -> Answer:
    """Read and check what an engine answered to a command.

    Raises InputError for what is no answer, and EngineError with the engine's words
    where it broke down.
    """
    data = _read_reply(data)
    setting = require_text("setting", data.get("setting", "exact"))
    if "refusal" in data:
        return Answer(engine, setting, refusal=_read_reason(data["refusal"]))
    n = len(command.angle)
    quantities = {
        name: _read_values("answers", name, values, n)
        for name, values in _read_object("answers", data)
    }
    alarms = data.get("alarms") or []
    if not isinstance(alarms, list):
        raise InputError("alarms", alarms, "must be a list of texts")
    predicted, evidence = (
        _read_object(name, data) for name in ("predicted", "evidence")
    )
    return Answer(
        engine,
        setting,
        read_answered_motion(data.get("at"), command),
        _read_assembled(data.get("assembled"), quantities, n),
        quantities,
        predicted={
            name: _read_values("predicted", name, values, n, ())
            for name, values in predicted
        },
        alarms=[require_text("alarms", alarm) for alarm in alarms],
        evidence={
            name: float(_read_values("evidence", name, [value], 1, ())[0])
            for name, value in evidence
        },
        shared=require_text("shared", data.get("shared", "")) or "not stated",
        own=require_text("own", data.get("own", "")) or "not stated",
        seconds=_read_seconds(data.get("seconds", 0.0)),
    )


def _read_reply(data: Any) -> dict[str, Any]:
    """Return the object that an engine replied with.

    Raises EngineError with its own words if it broke down.
    """
    if not isinstance(data, dict):
        raise InputError("answer", data, "must be an object")
    if "error" in data:
        raise EngineError(
            require_text("error", data["error"])
            or "the engine reported an error without text"
        )
    return data


def _read_reason(value: Any) -> str:
    if not (reason := require_text("refusal", value)):
        raise InputError("refusal", value, "must say why")
    return reason


def require_text(name: str, value: Any) -> str:
    """Return a text in one line; InputError for what is none."""
    if not isinstance(value, str):
        raise InputError(name, value, "must be a text")
    return write_one_line(value)


def _read_seconds(value: Any) -> float:
    seconds = _make_array([value])
    if seconds is None or not seconds[0] >= 0.0:
        raise InputError("seconds", value, "must be a number of 0 or more")
    return float(seconds[0])


def _read_object(name: str, data: dict[str, Any]) -> list[tuple[str, Any]]:
    value = data.get(name)
    if value is None and name != "answers":
        return []
    if not isinstance(value, dict):
        raise InputError(name, value, "must be an object")
    return [(write_one_line(key), entry) for key, entry in value.items()]


def _read_values(
    table: str,
    name: str,
    value: Any,
    n: int,
    vectors: Iterable[str] = VECTORS,
) -> Array:
    """Read n numbers, or n pairs of them; null becomes NaN."""
    pairs = name in vectors
    wanted = (
        f"must be a list of {n} {'pairs [x, y]' if pairs else 'numbers'}, null where"
        " there is no value"
    )
    key = f"{table}.{name}"
    if not isinstance(value, list):
        raise InputError(key, value, wanted)
    if len(value) != n:
        raise InputError(f"entries of {key}", len(value), wanted)
    if pairs:
        value = [(None, None) if pair is None else pair for pair in value]
        if any(not isinstance(pair, (list, tuple)) or len(pair) != 2 for pair in value):
            raise InputError(key, value, wanted)
    entries = list(chain.from_iterable(value) if pairs else value)
    array = _make_array(entries)
    if array is None:
        wrong = next(i for i, one in enumerate(entries) if _make_array([one]) is None)
        place = f"{key}, entry {wrong // (1 + pairs)}"
        raise InputError(place, entries[wrong], "must be a finite number or null")
    return array.reshape(n, 2) if pairs else array


def _read_assembled(
    value: Any,
    quantities: dict[str, Array],
    n: int,
) -> Any:
    """Read where the loop closes; left out: wherever there is a value."""
    if value is None:
        valued = [
            np.isfinite(array).reshape(n, -1).any(axis=1)
            for array in quantities.values()
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
    if names not in (
        KINDS_OF_COMMAND[:-1] if command.moves_stroke else (COMMAND_NAMES[command.bar],)
    ):
        raise InputError(
            "at",
            sorted(data),
            f"must have {command.commanded}, or for a stroke an angle of its bar",
        )
    bar = BAR_OF_ANGLE[names[0]]
    if "branch" in data:
        branch = _read_branch(data["branch"], n)
    else:
        branch = command.branch
    speed, acceleration = (
        _read_rate(key, data[key], n) if data.get(key) is not None else None
        for key in names[1:]
    )
    if acceleration is None:
        acceleration = 0.0 if command.moves_stroke else command.acceleration
    made = Command(
        _read_list(names[0], data[names[0]], n),
        branch,
        speed,
        acceleration,
        bar=bar,
    )
    if command.moves_stroke:  # no motion of the bar is commanded: the caller knows it
        return made
    require_near(made, command)
    stated: dict[str, Any] = {
        "angle": made.angle,
        "speed": speed,
        "acceleration": acceleration,
    }
    if all(
        np.array_equal(value, getattr(command, name)) for name, value in stated.items()
    ):
        return command
    return command.as_doubles()._replace(**stated)


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
    if speed:
        faster = float(
            np.sqrt(1.0 + 2.0 * acceleration * np.ptp(command.angle) / speed**2)
        )
    else:
        faster = 1.0
    sizes = (1.0, speed, speed**2 + acceleration)
    allowances = (_FURTHEST, _FURTHEST + faster - 1.0, _FURTHEST + faster**2 - 1.0)
    names = ("angle", "speed", "acceleration")
    for key, name, size, most in zip(
        COMMAND_NAMES[command.bar],
        names,
        sizes,
        allowances,
        strict=True,
    ):
        value = getattr(made, name)
        commanded = getattr(command, name)
        if value is not None and not np.abs(value - commanded).max() <= most * size:
            allowed = f"must be within {most * size:g} of the command"
            raise InputError(f"at.{key}", None, allowed)


def read_setting(data: Any) -> dict[str, Any]:
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


def release_to_json(scene: Scene) -> dict[str, Any]:
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
    instants = _read_list("times", times)
    theta, omega = (
        float(_read_list(name, [command.get(name, 0.0)])[0])
        for name in ("theta_2", "omega_2")
    )
    sign = _read_branch(command.get("branch", 1), 1)
    assembly = find_signs(scene.linkage, np.array([theta]), sign)
    free = Free(float(instants[-1]), len(instants) - 1)
    return replace(
        scene,
        motion=Motion(theta, omega, 0.0, int(assembly[0]), free),
    )


def released_to_json(released: ReleasedAnswer) -> dict[str, Any]:
    """Write a released motion as an engine integrated it."""
    if released.refusal is not None:
        return {"refusal": released.refusal, "setting": released.setting}
    answers = {name: _write_array(getattr(released, name)) for name in _OF_RELEASED}
    return {"answers": answers, "setting": released.setting}


def released_from_json(
    engine: str,
    n: int,
    data: Any,
) -> ReleasedAnswer:
    """Read and check a released motion at n times, as `answer_from_json` does."""
    data = _read_reply(data)
    setting = require_text("setting", data.get("setting", "exact"))
    if "refusal" in data:
        return ReleasedAnswer.refused(engine, setting, _read_reason(data["refusal"]))
    answers = dict(_read_object("answers", data))
    theta, omega, energy, terms = (
        _read_values("answers", name, answers.get(name), n) for name in _OF_RELEASED
    )
    return ReleasedAnswer(engine, setting, theta, omega, energy, terms)
