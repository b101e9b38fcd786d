"""Reference of the public names of `fourbar`, made of their docstrings.

The site appends it to docs/api.md.
"""

import ast
import inspect
import re
import textwrap
from typing import Any

import fourbar
from fourbar.quantities import QUANTITIES, Quantities

QUANTITY = {quantity.name: quantity for quantity in QUANTITIES}
METHODS = {
    "Solution": (
        *("title", "drive_bar", "drive", "origin", "status", "assembled"),
        *("evaluated", "to_csv", "to_pandas"),
    ),
    "Bar": ("moment_of_inertia",),
    "Motion": ("replace",),
    "Scene": ("plot",),
    "Released": ("time", "theta_2", "omega_2", "alpha_2"),
    "Sensitivity": ("of", "value", "to_pandas"),
}
"""Methods and properties that are shown with their class."""


def parse(thing: Any) -> Any:
    """Return the syntax tree of a class or function."""
    return ast.parse(textwrap.dedent(inspect.getsource(thing))).body[0]


def is_of_class(statement: ast.AnnAssign) -> bool:
    """Return whether an annotated name belongs to the class and not to its objects."""
    return ast.unparse(statement.annotation).startswith("ClassVar")


def fields(kind: type) -> list[tuple[str, str, str]]:
    """List name, type and docstring of the fields of a class.

    Inherited quantities come last.
    """
    rows: list[tuple[str, str, str]] = []
    last: ast.AnnAssign | None = None
    for statement in parse(kind).body:
        if isinstance(statement, ast.AnnAssign) and isinstance(
            statement.target, ast.Name
        ):
            last = statement
            if not is_of_class(statement):
                rows.append(
                    (statement.target.id, ast.unparse(statement.annotation), "")
                )
        elif (
            last
            and isinstance(statement, ast.Expr)
            and isinstance(statement.value, ast.Constant)
        ):
            if not is_of_class(last):
                rows[-1] = (*rows[-1][:2], " ".join(str(statement.value.value).split()))
            last = None
    return rows + (fields(Quantities) if Quantities in kind.__bases__ else [])


NOT_STATED = "init=False)"
"""End of a field that nobody states, as nobody states those of a solution that have
defaults: `solve` makes it.
"""


def signature(thing: Any) -> str:
    """Return the arguments as the source has them, without "self".

    A description has its fields as arguments.
    """
    written = getattr(thing, "fget", None) or getattr(thing, "func", thing)
    node = parse(written)
    if isinstance(node, ast.ClassDef):
        arguments = [
            ast.unparse(_without_declaration(statement, thing)).replace(
                "field(default_factory=", "("
            )
            for statement in node.body
            if isinstance(statement, ast.AnnAssign)
            and not is_of_class(statement)
            and not ast.unparse(statement).endswith(NOT_STATED)
            and not (thing is fourbar.Solution and statement.value is not None)
        ]
        return f"({', '.join(arguments)})"
    node.args.args = [argument for argument in node.args.args if argument.arg != "self"]
    returned = "" if node.returns is None else f" -> {ast.unparse(node.returns)}"
    return f"({ast.unparse(node.args)}){returned}"


def _without_declaration(statement: ast.stmt, kind: type) -> ast.stmt:
    """Return a field of a class without its declaration: int of Annotated[int, ...].

    The module of the class may have a name for an annotation of several fields.
    """
    match statement:
        case ast.AnnAssign(
            annotation=ast.Subscript(
                value=ast.Name(id="Annotated"), slice=ast.Tuple(elts=[hint, *_])
            )
        ):
            statement.annotation = hint
        case ast.AnnAssign(annotation=ast.Name(id=name)):
            named = getattr(inspect.getmodule(kind), name, None)
            if hasattr(named, "__metadata__"):
                hint = inspect.formatannotation(named.__origin__)
                statement.annotation = ast.parse(hint, mode="eval").body
    return statement


def row(name: str, kind: str, meaning: str) -> str:
    """Write one field as a row of a table.

    A quantity has its meaning from the table of quantities.
    """
    if not meaning and name in QUANTITY:
        meaning = f"{QUANTITY[name].meaning}, {QUANTITY[name].unit}".removesuffix(", 1")
    return (
        "| "
        + " | ".join(
            cell.replace("|", "\\|") for cell in (f"`{name}`", f"`{kind}`", meaning)
        )
        + " |"
    )


def unwrap(text: str) -> str:
    """Join the lines of each paragraph.

    Lists, underlined sections and examples keep theirs.
    """
    paragraphs = text.split("\n\n")
    return "\n\n".join(
        (
            lines
            if re.search(r"^(\s|--|>>>)", lines, re.MULTILINE)
            else " ".join(lines.split("\n"))
        )
        for lines in paragraphs
    )


def entry(name: str, thing: Any, level: str = "###") -> str:
    """Write heading, signature, docstring and fields of one name."""
    text = unwrap(inspect.getdoc(thing) or "")
    parts = [f"{level} {name}"]
    if (callable(thing) and not inspect.isclass(thing)) or (
        "Parameters" in text and not issubclass(thing, Exception)
    ):
        parts.append(f"```python\n{name}{signature(thing)}\n```")
    parts.append(f"```text\n{text}\n```")
    if (
        inspect.isclass(thing)
        and "Parameters" not in text
        and not issubclass(thing, Exception)
    ):
        rows = [row(*field) for field in fields(thing)]
        if rows:
            parts.append(
                "\n".join(["| field | type | meaning |", "|---|---|---|", *rows])
            )
    parts += [
        entry(f"{name}.{method}", getattr(thing, method), "####")
        for method in METHODS.get(name, ())
    ]
    return "\n\n".join(parts)


def results(functions: list[str], names: list[str]) -> dict[str, type]:
    """Find the classes that public functions return and that have no public name."""
    kinds: dict[str, type] = {}
    for name in functions:
        thing = getattr(fourbar, name)
        returned = (
            inspect.get_annotations(thing).get("return")
            if inspect.isfunction(thing)
            else None
        )
        for kind in (returned, *getattr(returned, "__args__", ())):
            if (
                inspect.isclass(kind)
                and kind.__module__.startswith("fourbar.")
                and kind.__name__ not in names
            ):
                kinds[kind.__name__] = kind
    return dict(sorted(kinds.items()))


def text() -> str:
    """Return the reference."""
    names = dir(fourbar)
    functions = [name for name in names if not inspect.isclass(getattr(fourbar, name))]
    classes = [name for name in names if name not in functions]
    parts = [
        "## Functions",
        *(entry(name, getattr(fourbar, name)) for name in functions),
    ]
    parts += [
        "## What they return",
        *(entry(name, kind) for name, kind in results(functions, names).items()),
    ]
    parts += [
        "## Descriptions, results and errors",
        *(entry(name, getattr(fourbar, name)) for name in classes),
    ]
    return "\n\n".join(part.strip() for part in parts) + "\n"
