"""Mutants of a module: each changes one operator or one number in one of its functions, while the program runs."""

import ast
import inspect
from collections.abc import Iterator
from contextlib import contextmanager
from types import CodeType, FunctionType, ModuleType
from typing import Any, NamedTuple

PAIRS = (
    *((ast.Add, ast.Sub), (ast.Mult, ast.Div), (ast.Lt, ast.LtE), (ast.Gt, ast.GtE), (ast.Eq, ast.NotEq)),
    *((ast.And, ast.Or), (ast.Is, ast.IsNot), (ast.In, ast.NotIn), (ast.USub, ast.UAdd), (ast.BitAnd, ast.BitOr)),
)
OTHER: dict[type, type] = {a: b for a, b in PAIRS} | {b: a for a, b in PAIRS} | {ast.Pow: ast.Mult}
"""What replaces an operator."""


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
    tree = ast.parse(inspect.getsource(module))
    classes = [node for node in tree.body if isinstance(node, ast.ClassDef)]
    for prefix, body in (("", tree.body), *((f"{each.name}.", each.body) for each in classes)):
        for definition in body:
            if not isinstance(definition, ast.FunctionDef):
                continue
            qualified = prefix + definition.name
            for node in (inner for statement in definition.body for inner in ast.walk(statement)):
                for field, changed in _list_changes(node):
                    original, before = getattr(node, field), ast.unparse(node)
                    setattr(node, field, changed)
                    code = _find_code(compile(tree, inspect.getfile(module), "exec"), qualified)
                    name = f"{module.__name__}.{qualified}, line {node.lineno}: {before} -> {ast.unparse(node)}"  # type: ignore[attr-defined]
                    setattr(node, field, original)
                    assert code is not None
                    yield Mutant(name, _find_function(module, qualified), code)


def _list_changes(node: ast.AST) -> Iterator[tuple[str, Any]]:
    """Name a field of a node and what may stand in it instead."""
    if isinstance(node, ast.Constant) and isinstance(node.value, bool):
        yield "value", not node.value
    elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        yield "value", node.value + 1
    if (other := OTHER.get(type(getattr(node, "op", None)))) is not None:
        yield "op", other()
    ops = getattr(node, "ops", [])
    for i, each in enumerate(ops):
        if type(each) in OTHER:
            yield "ops", [*ops[:i], OTHER[type(each)](), *ops[i + 1 :]]


def _find_code(within: CodeType, qualified: str) -> CodeType | None:
    """Find the code of a function in that of its module."""
    for each in within.co_consts:
        if isinstance(each, CodeType):
            if each.co_qualname == qualified:
                return each
            if (inner := _find_code(each, qualified)) is not None:
                return inner
    return None


def _find_function(module: ModuleType, qualified: str) -> FunctionType:
    """Find the function itself, below its decorators."""
    owner, _, name = qualified.rpartition(".")
    result = inspect.getattr_static(getattr(module, owner) if owner else module, name)
    result = inspect.unwrap(getattr(result, "fget", None) or getattr(result, "__func__", result))
    assert isinstance(result, FunctionType)
    return result
