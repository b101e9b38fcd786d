"""A witness from outside at work: it is given copies, and what it answers becomes plain numbers or an error."""

import signal
from copy import deepcopy
from pkgutil import resolve_name
from typing import Any

import numpy as np

from fourbar.quantities import VECTORS
from fourbar.scene import Command, Scene
from fourbar.scene.motion_law import COMMANDS
from fourbar_validation.compare.answer import Answer, Array, Engine, WitnessError, explain_refusal
from fourbar_validation.compare.rows import say_error, write_one_line

FURTHEST = 0.1
"""rad, and part of the greatest speed and acceleration: a motion that ends further from the command than this answers
another question."""


class Checked:
    """An engine from outside, under the name that it was described by."""

    commands = ("theta_2", "theta_3", "theta_4", "stroke")
    """Whatever is commanded: the engine itself is asked what it takes."""

    def __init__(self, name: str, adapter: str) -> None:
        self.name, self._adapter = name, adapter

    def answer(self, scene: Scene, command: Command) -> Answer:
        """Return its answer; WitnessError where it is none, whatever the engine raises."""
        given_scene, at = deepcopy((scene, command))
        for array in (given_scene.motion.theta_2, *at):
            if isinstance(array, np.ndarray):
                array.flags.writeable = False
        try:
            with np.errstate():  # as it was before, for the engines that come after
                engine: Engine = resolve_name(self._adapter)()
                if scene.drive is not None and not getattr(engine, "linear_drive", False):
                    return Answer(self.name, "exact", refusal="it does not declare linear_drive")
                if refusal := explain_refusal(engine, at):
                    return Answer(self.name, "exact", refusal=refusal)
                return self._read(engine.answer(given_scene, at), command)
        except BaseException as error:
            if isinstance(error, KeyboardInterrupt) and signal.getsignal(signal.SIGINT) != signal.SIG_IGN:
                raise  # the user's; a worker ignores it
            raise WitnessError(say_error(error)) from None

    def _read(self, answer: Any, command: Command) -> Answer:
        if not isinstance(answer, Answer):
            raise TypeError(f"the answer of {self.name} is a {type(answer).__name__}, not a fourbar_validation.Answer")
        setting = _check_text("setting", answer.setting)
        if answer.refusal is not None:
            return Answer(self.name, setting, refusal=self._find_reason(answer.refusal))
        if not isinstance(answer.quantities, dict):
            raise TypeError("quantities must be a dictionary of arrays")
        n = len(command.angle)
        return Answer(
            self.name,
            setting,
            at=command if answer.at is None else _check_motion(answer.at, command),
            assembled=_check_numbers("assembled", answer.assembled, (n,), "b").astype(bool),
            quantities={
                name: _check_numbers(name, value, (n, 2) if name in VECTORS else (n,))
                for name, value in answer.quantities.items()
            },
            alarms=[_check_text("an alarm", alarm) for alarm in answer.alarms],
            shared=_check_text("shared", answer.shared) or "not stated",
            own=_check_text("own", answer.own) or "not stated",
        )

    def _find_reason(self, refusal: Any) -> str:
        if not (reason := _check_text("refusal", refusal)):
            raise ValueError(f"{self.name} refuses without a reason: refusal must say why")
        return reason


def _check_text(name: str, value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{name} must be a text, not a {type(value).__name__}")
    return write_one_line(value)


def _check_numbers(name: str, value: Any, shape: tuple[int, ...], kinds: str = "iuf") -> Array:
    array = np.asarray(value)
    if array.dtype.kind not in kinds:
        wanted = "true or false" if kinds == "b" else "real numbers"
        raise TypeError(f"{name} must hold {wanted}, not {array.dtype}")
    if array.shape != shape:
        raise ValueError(f"{name} must be of shape {shape}, not {array.shape}")
    return np.array(array, dtype=float)


def _check_motion(at: Any, command: Command) -> Command:
    """Check the motion that a witness says it made: it must be near the one that was commanded."""
    if not isinstance(at, Command):
        raise TypeError(f"at must be the command or one made of it, not a {type(at).__name__}")
    if not np.array_equal(at.branch, command.branch) or (at.speed is None) != (command.speed is None):
        raise ValueError("at must have the branch of the command, and speeds where that has")
    n, made = len(command.angle), dict[str, Any]()
    speed, acceleration = (0.0 if x is None else float(np.abs(x).max()) for x in (command.speed, command.acceleration))
    keys = dict(zip(("angle", "speed", "acceleration"), COMMANDS[command.bar], strict=True))
    for name, size in {"angle": 1.0, "speed": speed, "acceleration": speed**2 + acceleration}.items():
        commanded, value = getattr(command, name), getattr(at, name)
        if commanded is None or command.stroke is not None:  # of a stroke nothing of the bar is given
            continue
        made[name] = _check_numbers(f"at.{keys[name]}", value, (n,) if np.ndim(value) else ())
        if not np.abs(made[name] - commanded).max() <= FURTHEST * size:
            raise ValueError(
                f"at.{keys[name]} is too far from the command: it must be within {FURTHEST * size:g} of it"
            )
    same = all(np.array_equal(value, getattr(command, name)) for name, value in made.items())
    return command if same else command._replace(**made, remainder=None)
