"""Writes docs/api.md: every public name of `fourbar` with its signature and docstring. `python docs/api.py`"""

import ast
import inspect
import textwrap
from pathlib import Path
from typing import Any

import fourbar
from fourbar.quantities import QUANTITIES, Quantities

TARGET = Path(__file__).with_suffix(".md")
HEAD = """\
# The Python API

Everything that `dir(fourbar)` shows; SI and radians everywhere; a description takes texts with units too,
like `uniform("6 in", ...)`. `import fourbar` loads numpy alone: what needs
more (files, effects, drawings) is loaded on first use.

`scene.plot()` draws a figure that a notebook shows and `.save("a.pdf")` writes; a scene, a solution, sensitivities and
tolerances as the last line of a cell show themselves. Threads may solve and draw at the same time.

*Written by `python docs/api.py` from the docstrings.*
"""
MEANINGS = {quantity.name: quantity for quantity in QUANTITIES}
METHODS = {
    "Solution": ("status", "assembled", "evaluated", "to_csv", "to_pandas"),
    "Bar": ("moment_of_inertia",),
    "Motion": ("replace",),
    "Scene": ("plot",),
    "Sensitivity": ("of", "value", "to_pandas"),
}
"""Methods and properties that are shown with their class."""


def fields(kind: type) -> list[tuple[str, str, str]]:
    """Name, type and docstring of the fields of a class, as its source has them; then the quantities it inherits."""
    body = ast.parse(textwrap.dedent(inspect.getsource(kind))).body[0].body  # type: ignore[attr-defined]
    found: list[tuple[str, str, str]] = []
    for statement in body:
        if isinstance(statement, ast.AnnAssign) and ast.unparse(statement.annotation).startswith("ClassVar"):
            found.append(("", "", ""))  # of the class, not of what it describes; its docstring goes with it
        elif isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name):
            found.append((statement.target.id, ast.unparse(statement.annotation), ""))
        elif found and isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
            name, of, _ = found.pop()
            found.append((name, of, " ".join(str(statement.value.value).split())))
    found = [each for each in found if each[0]]
    return found + (fields(Quantities) if Quantities in kind.__bases__ else [])


def signature(thing: Any) -> str:
    """The arguments as the source has them, without "self"; of a description its fields."""
    thing = thing.fget if isinstance(thing, property) else thing
    node: Any = ast.parse(textwrap.dedent(inspect.getsource(thing))).body[0]
    constructor = [each for each in getattr(node, "body", ()) if getattr(each, "name", "") == "__init__"]
    if hasattr(thing, "__dataclass_fields__") and constructor:
        taken, defaults = constructor[0].args.args[1:], constructor[0].args.defaults
        pairs = zip(taken, defaults, strict=True)
        return f"({', '.join(f'{ast.unparse(name)} = {ast.unparse(default)}' for name, default in pairs)})"
    if isinstance(node, ast.ClassDef):
        taken = [
            ast.unparse(each).replace("field(default_factory=", "(")
            for each in node.body
            if isinstance(each, ast.AnnAssign)
            and not ast.unparse(each).endswith("init=False)")
            and not ast.unparse(each.annotation).startswith("ClassVar")
        ]
        return f"({', '.join(taken)})"
    node.args.args = [each for each in node.args.args if each.arg != "self"]
    returned = "" if node.returns is None else f" -> {ast.unparse(node.returns)}"
    return f"({ast.unparse(node.args)}){returned}"


def row(name: str, of: str, what: str) -> str:
    """One field as a row of a table; what a quantity is stands in the table of quantities."""
    known = MEANINGS.get(name)
    what = what or (f"{known.meaning}, {known.unit}".removesuffix(", 1") if known else "")
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in (f"`{name}`", f"`{of}`", what)) + " |"


def entry(name: str, thing: Any, level: str = "###") -> str:
    """Heading, signature, docstring and fields of one name."""
    text = inspect.getdoc(thing) or ""
    parts = [f"{level} {name}"]
    if (callable(thing) and not inspect.isclass(thing)) or ("Parameters" in text and not issubclass(thing, Exception)):
        parts.append(f"```python\n{name}{signature(thing)}\n```")
    parts.append(f"```text\n{text}\n```")
    if inspect.isclass(thing) and "Parameters" not in text and not issubclass(thing, Exception):
        rows = [row(*each) for each in fields(thing)]
        if rows:
            parts.append("\n".join(["| field | type | what |", "|---|---|---|", *rows]))
    parts += [entry(f"{name}.{method}", getattr(thing, method), "####") for method in METHODS.get(name, ())]
    return "\n\n".join(parts)


def results(functions: list[str], names: list[str]) -> dict[str, type]:
    """Classes of this package that a public function returns and that have no public name of their own."""
    found: dict[str, type] = {}
    for name in functions:
        thing = getattr(fourbar, name)
        returned = inspect.get_annotations(thing).get("return") if inspect.isfunction(thing) else None
        for kind in (returned, *getattr(returned, "__args__", ())):
            if inspect.isclass(kind) and kind.__module__.startswith("fourbar.") and kind.__name__ not in names:
                found[kind.__name__] = kind
    return dict(sorted(found.items()))


def text() -> str:
    """The page."""
    names = [name for name in dir(fourbar) if name != "__version__"]
    functions = [name for name in names if not inspect.isclass(getattr(fourbar, name))]
    classes = [name for name in names if name not in functions]
    parts = [HEAD, "## Functions", *(entry(name, getattr(fourbar, name)) for name in functions)]
    parts += ["## What they return", *(entry(name, kind) for name, kind in results(functions, names).items())]
    parts += ["## Descriptions, results and errors", *(entry(name, getattr(fourbar, name)) for name in classes)]
    return "\n\n".join(part.strip() for part in parts) + "\n"


if __name__ == "__main__":
    TARGET.write_text(text(), encoding="utf-8")
