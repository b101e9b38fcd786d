"""The harness against mutants of the formulas: no unit test takes part.

A mutant changes one operator or one number in one function of a module while the
program runs. It counts where it changes a number that `solve` returns by more than 1e-9
of its scale (or what assembles, or which numbers exist, or raises); it is caught where
a comparison then fails.
"""

import ast
import inspect
import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from itertools import chain
from textwrap import dedent
from types import CodeType, FunctionType, ModuleType
from typing import Any, NamedTuple

import click
import numpy as np

from fourbar.errors import FAILED, HOLDS, FourBarError
from fourbar.quantities import UNITS
from fourbar.scene import Scene
from fourbar.solving import solve
from fourbar_validation.engines.registry import ENGINES
from fourbar_validation.run.judge import judge

EXCHANGED_OPERATORS = (
    (ast.Add, ast.Sub),
    (ast.Mult, ast.Div),
    (ast.Lt, ast.LtE),
    (ast.Gt, ast.GtE),
    (ast.Eq, ast.NotEq),
    (ast.And, ast.Or),
    (ast.Is, ast.IsNot),
    (ast.In, ast.NotIn),
    (ast.USub, ast.UAdd),
    (ast.BitAnd, ast.BitOr),
)
OTHER: dict[type, type] = {ast.Pow: ast.Mult}
for _one, _other in EXCHANGED_OPERATORS:
    OTHER |= {_one: _other, _other: _one}
"""Replacement of each operator."""
_CHANGES = 1e-9
MUTANT_SECONDS = 20
"""Time after which a mutant hangs. The run would be stopped, which is a failure too."""
LEAST_CAUGHT = 0.95
"""Share of the mutants that must be caught."""
MODULES = (
    "arithmetic",
    "position",
    "motion",
    "pin_forces",
    "torque",
    "path",
)
SCENES_OF_A_MUTANT = 10


class Mutant(NamedTuple):
    """One change of one function."""

    name: str
    function: Any
    """A FunctionType, which as a member of a class would be taken for a method."""
    code: CodeType

    @contextmanager
    def active(self) -> Iterator[None]:
        """Let the function, wherever it was imported, run the changed code."""
        original = self.function.__code__
        self.function.__code__ = self.code
        try:
            yield
        finally:
            self.function.__code__ = original


def compile_mutants(module: ModuleType) -> Iterator[Mutant]:
    """Compile every mutant of the functions and methods of a module."""
    for owner in (module, *filter(inspect.isclass, vars(module).values())):
        for member in vars(owner).values():
            # the function itself, below its decorators
            inner = getattr(member, "fget", None) or getattr(member, "__func__", member)
            function = inspect.unwrap(inner)
            is_own = getattr(function, "__module__", "") == module.__name__
            if is_own and isinstance(function, FunctionType):
                yield from _compile_function(function)


def _compile_function(function: FunctionType) -> Iterator[Mutant]:
    tree = ast.parse(dedent(inspect.getsource(function)))
    definition = tree.body[0]
    assert isinstance(definition, ast.FunctionDef)
    definition.decorator_list.clear()
    first = function.__code__.co_firstlineno
    for node in chain.from_iterable(map(ast.walk, definition.body)):
        for field, changed in _list_changes(node):
            original = getattr(node, field)
            before = ast.unparse(node)
            setattr(node, field, changed)
            made: dict[str, Any] = {}
            exec(compile(tree, __file__, "exec"), function.__globals__, made)
            line = first - 1 + node.lineno  # type: ignore[attr-defined]
            name = f"{function.__module__}.{function.__qualname__}, line {line}"
            name += f": {before} -> {ast.unparse(node)}"
            setattr(node, field, original)
            yield Mutant(name, function, made[function.__name__].__code__)


def _list_changes(node: ast.AST) -> Iterator[tuple[str, Any]]:
    """Name a field of a node and what may stand in it instead."""
    if isinstance(node, ast.Constant) and isinstance(node.value, bool):
        yield "value", not node.value
    elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        yield "value", node.value + 1
    if (opposite := OTHER.get(type(getattr(node, "op", None)))) is not None:
        yield "op", opposite()
    ops = getattr(node, "ops", [])
    for i, operator in enumerate(ops):
        if type(operator) in OTHER:
            yield "ops", [*ops[:i], OTHER[type(operator)](), *ops[i + 1 :]]


class _HangError(Exception):
    """A mutant did not come back."""


def choose_scenes() -> list[Scene]:
    """Choose random linkages of every type, drive and branch.

    A parallelogram near its change point is added.
    """
    from fourbar_validation.scenes.hard_families import (
        approach_change_point,
        dress,
        sweep_turn,
    )
    from fourbar_validation.scenes.random import DrawnType, draw_random_scene

    chosen = [
        draw_random_scene(0, index, tuple(DrawnType))
        for index in range(SCENES_OF_A_MUTANT)
    ]
    chosen.append(sweep_turn(dress((0.3, 0.1, 0.25, 0.22)), 12))
    chosen += [
        scene
        for name, scene in approach_change_point(distances=(1e-2, 1e-4))
        if name.startswith(("par", "kite a = d"))
    ]
    return chosen


def compute_numbers(scene: Scene) -> dict[str, Any]:
    """Compute every number that `solve` returns for a scene."""
    solution = solve(scene, "force")
    numbers = {name: getattr(solution, name) for name in UNITS}
    numbers["status"] = solution.status_code.astype(float)
    return {name: value for name, value in numbers.items() if value is not None}


def is_changed(before: dict[str, Any], after: dict[str, Any]) -> bool:
    """Compare numbers: whether any differs by more than 1e-9 of its scale."""
    for name, old in before.items():
        new = after.get(name)
        if new is None or np.shape(old) != np.shape(new):
            return True
        scale = float(np.max(np.abs(old), initial=0.0, where=np.isfinite(old))) or 1.0
        if not np.allclose(new, old, rtol=0.0, atol=_CHANGES * scale, equal_nan=True):
            return True
    return False


class Baseline(NamedTuple):
    """A scene, and the numbers of the formulas without a mutant."""

    scene: Scene
    before: dict[str, Any]


def is_caught(scene: Scene) -> bool:
    """Judge a scene by the exact engines: whether any row fails."""
    engines = [engine for engine in ENGINES if not engine.through_time]
    return any(row.failed for row in judge("", scene, engines).rows)


def make_baseline(scene: Scene) -> Baseline:
    """Solve a scene; RuntimeError where the harness fails on it."""
    if is_caught(scene):
        raise RuntimeError(f"the harness fails without a mutant: {scene.title}")
    return Baseline(scene, compute_numbers(scene))


def judge_mutant(mutant: Mutant, tried: Sequence[Baseline]) -> bool | None:
    """Return whether a mutant is caught, or None where it changes nothing."""
    differs = False
    signal.alarm(MUTANT_SECONDS)
    try:
        with np.errstate(all="ignore"), mutant.active():
            for scene, before in tried:
                if is_changed(before, compute_numbers(scene)):
                    differs = True
                    if is_caught(scene):
                        return True
    except Exception:  # a mutant that raises or hangs ends the run: that is noticed
        return True
    finally:
        signal.alarm(0)
    return False if differs else None


@click.command()
@click.option("--module", type=click.Choice(MODULES), help="Only this one.")
def mutants_command(module: str | None) -> int:
    """Change operators and numbers of the formulas, one at a time.

    95 % of those that matter must fail the harness. A change matters that alters a
    number by more than 1e-9. Those that are not caught are listed.
    """
    from rich.console import Console
    from rich.progress import track

    if not hasattr(signal, "SIGALRM"):
        raise FourBarError(
            "mutants ends what hangs by SIGALRM, which Windows does not have"
        )

    def alarm(*_: object) -> None:
        raise _HangError

    before = signal.signal(signal.SIGALRM, alarm)
    tried = [make_baseline(scene) for scene in choose_scenes()]
    shown = Console(stderr=True)
    changing = 0
    missed = list[str]()
    for name in [module] if module else MODULES:
        chosen = list(compile_mutants(import_module(f"fourbar.formulas.{name}")))
        verdicts = [
            judge_mutant(mutant, tried) for mutant in track(chosen, name, console=shown)
        ]
        survivors = [
            mutant.name
            for mutant, verdict in zip(chosen, verdicts, strict=True)
            if verdict is False
        ]
        count = sum(verdict is not None for verdict in verdicts)
        click.echo(
            f"{name}: {count - len(survivors)} of {count} caught, of {len(chosen)}"
            " mutants tried"
        )
        changing = changing + count
        missed = missed + survivors
    signal.signal(signal.SIGALRM, before)
    for line in missed:
        click.echo(f"not caught: {line}")
    click.echo(
        f"the harness catches {changing - len(missed)} of {changing} mutants that"
        " change a number"
    )
    if changing and len(missed) <= (1.0 - LEAST_CAUGHT) * changing:
        return HOLDS
    return FAILED
