"""Witnesses from outside: a class named on the command line, or by an entry point of an installed package.

Such a class has a `name` and `answer(scene, at) -> fourbar_validation.Answer`; it may state `quantities`, the names
that it answers (left out: `UNKNOWNS`), and `tolerance`: "equivalence" (default), or a relative error and its reason.
"""

import hashlib
import os
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from importlib.metadata import distributions, entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

from fourbar.errors import InputError
from fourbar.quantities import ANGLES, UNKNOWNS
from fourbar_validation.compare.compare import COMPARED
from fourbar_validation.compare.rows import FORMULAS, make_plain, say_error, write_one_line
from fourbar_validation.compare.tolerance import EQUIVALENCE, ErrorBound
from fourbar_validation.engines import workers
from fourbar_validation.engines.checked import Checked
from fourbar_validation.engines.witnesses import Witness

GROUP = "fourbar.witnesses"
"""Entry points of this group join every run; their value is "module:Class" too."""
LONGEST_IMPORT = 60.0
"""Seconds after which a module that is imported hangs."""
OURS = frozenset(sys.modules)
"""Modules that were imported before any witness's."""


@dataclass(frozen=True, slots=True)
class AddedWitness(Witness):
    """A witness whose answers are looked at before they are compared."""

    adapter: str = ""
    """Its class, "module:Class"."""
    trouble: str = ""
    """Why its class cannot be used, or nothing."""
    code: str = ""
    """Hash of what its answers come from."""
    number: int = 0
    """Which one it is: each is drawn with a mark of its own, in whatever process."""

    def missing(self) -> str | None:
        """Why it cannot answer here, or None."""
        return self.trouble or None


class _UnusableError(Exception):
    """A class that is no witness; the text says what is allowed."""


def read_witnesses(adapters: Sequence[str], known: Iterable[str]) -> tuple[Witness, ...]:
    """Read the witnesses of the command line; InputError where one is none."""
    if os.getcwd() not in sys.path:  # a console script does not look there
        sys.path.append(os.getcwd())
    result = list(zip(adapters, _ask_descriptions(adapters, known), strict=True))
    for adapter, each in result:
        if isinstance(each, _UnusableError):
            raise InputError("--witness", adapter, str(each))
    return tuple(each for _, each in result if isinstance(each, Witness))


def find_installed(known: Iterable[str]) -> tuple[Witness, ...]:
    """Those of the entry points; one that cannot be used is missing, with the reason."""
    points = sorted(entry_points(group=GROUP), key=lambda point: point.name)
    return tuple(
        _make_witness(make_plain(point.name), point.value, EQUIVALENCE, trouble=f"{point.value} {each}")
        if isinstance(each, _UnusableError)
        else each
        for point, each in zip(points, _ask_descriptions([point.value for point in points], known), strict=True)
    )


def _ask_descriptions(adapters: Sequence[str], known: Iterable[str]) -> list[Witness | _UnusableError]:
    """Ask each class what it says of itself, in another process: nothing of it runs where the verdict is given."""
    if not adapters:
        return []
    names, result = {FORMULAS, *known}, list[Witness | _UnusableError]()
    for each in workers.apply_each(_describe, adapters, seconds=LONGEST_IMPORT, instead=_find_trouble):
        if isinstance(each, Witness) and each.name in names:
            result.append(_UnusableError(f"must have a name of its own; {each.name!r} is another's"))
            continue
        result.append(replace(each, number=len(names)) if isinstance(each, AddedWitness) else each)
        names |= {each.name} if isinstance(each, Witness) else set()
    return result


def list_numbers(witnesses: Iterable[Witness]) -> dict[str, int]:
    """List the numbers of those from outside, by name."""
    return {each.name: each.number for each in witnesses if isinstance(each, AddedWitness)}


def _find_trouble(_: str, error: Exception, __: object) -> _UnusableError:
    """Say why a class cannot be used whose description failed, took too long, or ended its process."""
    if isinstance(error, _UnusableError):
        return error
    if isinstance(error, TimeoutError):
        return _UnusableError(f"cannot be imported: it takes more than {LONGEST_IMPORT:g} s")
    return _UnusableError(f"cannot be imported: it ends its process (exit code {getattr(error, 'exitcode', 0) or 0})")


def _describe(adapter: str) -> AddedWitness:
    """Describe the witness that a class makes in plain words and numbers; _UnusableError where it is none."""
    module, _, attribute = adapter.partition(":")
    if not module or not attribute:
        raise _UnusableError("must be module:Class")
    try:
        return _read(adapter, getattr(import_module(module), attribute))
    except _UnusableError:
        raise
    except BaseException as error:  # whatever the user's module raises while it is imported
        raise _UnusableError(f"cannot be imported: {say_error(error)}") from None


def _read(adapter: str, made: Any) -> AddedWitness:
    name = getattr(made, "name", None)
    if type(name) is not str or not name or name != write_one_line(name) or not callable(getattr(made, "answer", None)):
        raise _UnusableError("must have a `name` of printable characters and a method `answer(scene, at)`")
    stated = tuple(getattr(made, "quantities", UNKNOWNS))
    unknown = [quantity for quantity in stated if quantity not in COMPARED]
    if unknown or not stated:
        raise _UnusableError(f"must have `quantities` among {', '.join(COMPARED)}; it has {unknown or 'none'}")
    quantities = tuple(quantity for quantity in COMPARED if quantity in stated)
    positions = tuple(quantity for quantity in quantities if quantity in ANGLES)
    tolerance = _make_tolerance(getattr(made, "tolerance", EQUIVALENCE.name))
    code = _hash_code(sys.modules[adapter.partition(":")[0]])
    return _make_witness(name, adapter, tolerance, expected=quantities, positions=positions, stated=False, code=code)


def _make_witness(name: str, adapter: str, tolerance: ErrorBound, **rest: Any) -> AddedWitness:
    return AddedWitness(name, partial(Checked, name, adapter), tolerance, adapter=adapter, **rest)


def _hash_code(module: ModuleType) -> str:
    """Hash of the modules imported with a witness, of the others in its folder, and of what is installed."""
    files = {getattr(each, "__file__", None) for name, each in list(sys.modules.items()) if name not in OURS}
    files |= {str(path) for path in Path(module.__file__ or "").parent.glob("*.py")}
    digest = hashlib.sha256()
    for file in sorted(filter(None, files)):
        digest.update(f"{file} ".encode() + hashlib.sha256(Path(file).read_bytes()).digest())
    digest.update(repr(sorted(f"{each.name} {each.version}" for each in distributions())).encode())
    return digest.hexdigest()[:16]


def _make_tolerance(stated: Any) -> ErrorBound:
    if isinstance(stated, str) and stated == EQUIVALENCE.name:
        return EQUIVALENCE
    try:
        error, reason = stated
        error = float(error)
    except (TypeError, ValueError):
        error, reason = 0.0, ""
    if not (0.0 < error < 1.0 and isinstance(reason, str) and reason):
        allowed = f'"{EQUIVALENCE.name}", or a relative error above 0 and below 1 and its reason'
        raise _UnusableError(f"must have a `tolerance` that is {allowed}")
    return ErrorBound(
        "as the witness states", f"{error:g} of the scale: {write_one_line(reason)}", error, conditioned=False
    )
