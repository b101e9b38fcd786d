"""Witnesses from outside: a class named on the command line, or by an entry point of an installed package.

Such a class has a `name` and `answer(scene, at) -> validation.Answer`; it may state `quantities`, the names
that it answers (left out: all), and `tolerance`: "equivalence" (the default), or a relative error and its reason.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any

import numpy as np

from fourbar.errors import InputError
from fourbar.quantities import ANGLES, VECTORS
from fourbar.scene import Command, Scene
from validation.compare.answer import Answer, Array, Engine
from validation.compare.compare import COMPARED
from validation.compare.identities import FORMULAS
from validation.compare.rows import plain
from validation.compare.tolerance import EQUIVALENCE, Tolerance
from validation.engines.witnesses import Witness

GROUP = "fourbar.witnesses"
"""Entry points of this group join every run; their value is "module:Class" too."""


@dataclass(frozen=True, slots=True)
class AddedWitness(Witness):
    """A witness whose answers are looked at before they are compared."""

    trouble: str = ""
    """Why its class cannot be used, or nothing."""

    def engine(self) -> Engine:
        """The class of the user, its answers looked at."""
        return Checked(self.name, Witness.engine(self))

    def missing(self) -> str | None:
        """Why it cannot answer here, or None."""
        return self.trouble or None


class Checked:
    """An engine from outside: what it answers becomes arrays of numbers under its own name, or an error."""

    def __init__(self, name: str, engine: Engine) -> None:
        self.name, self.engine = name, engine

    def answer(self, scene: Scene, command: Command) -> Answer:
        """Its answer; TypeError or ValueError where it is none."""
        answer = self.engine.answer(scene, command)
        if not isinstance(answer, Answer):
            raise TypeError(f"the answer is a {type(answer).__name__}, not a validation.Answer")
        if answer.refusal is not None:
            return Answer(self.name, answer.setting, refusal=plain(str(answer.refusal)))
        at = command if answer.at is None else answer.at
        n = len(at.theta_2)
        assembled = _shaped("assembled", answer.assembled, (n,)).astype(bool)
        quantities = {
            name: _shaped(name, value, (n, 2) if name in VECTORS else (n,)) for name, value in answer.quantities.items()
        }
        shared, own = answer.shared or "not stated", answer.own or "not stated"
        return replace(
            answer, engine=self.name, at=at, assembled=assembled, quantities=quantities, shared=shared, own=own
        )


def _shaped(name: str, value: Any, shape: tuple[int, ...]) -> Array:
    array = np.asarray(value, dtype=float)
    if array.shape != shape:
        raise ValueError(f"{name} must be of shape {shape}, not {array.shape}")
    return array


def named(adapters: Iterable[str], known: Iterable[str]) -> tuple[Witness, ...]:
    """The witnesses of the command line; InputError where one is none."""
    found: list[Witness] = []
    for adapter in adapters:
        try:
            found.append(_described(adapter, [*known, *(witness.name for witness in found)]))
        except _UnusableError as reason:
            raise InputError("--witness", adapter, str(reason)) from None
    return tuple(found)


def installed(known: Iterable[str]) -> tuple[Witness, ...]:
    """Those of the entry points; one that cannot be used is missing, with the reason."""
    found: list[Witness] = []
    for point in sorted(entry_points(group=GROUP), key=lambda point: point.name):
        try:
            found.append(_described(point.value, [*known, *(witness.name for witness in found)]))
        except _UnusableError as reason:
            found.append(AddedWitness(plain(point.name), point.value, EQUIVALENCE, trouble=f"{point.value} {reason}"))
    return tuple(found)


class _UnusableError(Exception):
    """A class that is no witness; the text says what is allowed."""


def _described(adapter: str, known: Iterable[str]) -> AddedWitness:
    module, _, attribute = adapter.partition(":")
    if not module or not attribute:
        raise _UnusableError("must be module:Class")
    try:
        made = getattr(import_module(module), attribute)
    except Exception as error:  # whatever the user's module raises while it is imported
        raise _UnusableError(f"cannot be imported: {' '.join(f'{type(error).__name__}: {error}'.split())}") from None
    name = getattr(made, "name", None)
    if not isinstance(name, str) or not name or name != plain(name) or not callable(getattr(made, "answer", None)):
        raise _UnusableError("must have a `name` of printable characters and a method `answer(scene, at)`")
    if name in (FORMULAS, *known):
        raise _UnusableError(f"must have a name of its own; {name!r} is another's")
    quantities = tuple(getattr(made, "quantities", COMPARED))
    unknown = [quantity for quantity in quantities if quantity not in COMPARED]
    if unknown or not quantities:
        raise _UnusableError(f"must have `quantities` among {', '.join(COMPARED)}; it has {unknown or 'none'}")
    positions = tuple(quantity for quantity in quantities if quantity in ANGLES)
    tolerance = _tolerance(getattr(made, "tolerance", EQUIVALENCE.name))
    return AddedWitness(name, adapter, tolerance, expected=quantities, positions=positions, stated=False)


def _tolerance(stated: Any) -> Tolerance:
    if stated == EQUIVALENCE.name:
        return EQUIVALENCE
    try:
        error, reason = stated
        error = float(error)
    except (TypeError, ValueError):
        error, reason = 0.0, ""
    if not (0.0 < error < 1.0 and isinstance(reason, str) and reason):
        allowed = f'"{EQUIVALENCE.name}", or a relative error above 0 and below 1 and its reason'
        raise _UnusableError(f"must have a `tolerance` that is {allowed}")
    return Tolerance("as the witness states", f"{error:g} of the scale: {plain(reason)}", error, conditioned=False)
