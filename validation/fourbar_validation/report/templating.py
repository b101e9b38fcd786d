"""The templates of every report, and how numbers and somebody's text stand in them."""

import base64
import gzip
import hashlib
import math
from pathlib import Path

from fourbar_validation.compare.rows import escape_controls
from fourbar_validation.report.svg import choose_style


def render(package: str, name: str, /, **what: object) -> str:
    """Fill in a template of a package.

    An unknown name in it is an error; in a page every text is escaped for HTML. It may
    build on those of the report: one page, one stylesheet, one form of a table.
    """
    from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

    # in Markdown `escape_cell` escapes what would break out
    page = name.endswith(".html.j2")
    folders = map(PackageLoader, (package, "fourbar_validation.report"))
    environment = Environment(
        loader=ChoiceLoader([*folders]),
        undefined=StrictUndefined,
        autoescape=page,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=not page,
    )
    environment.filters |= {
        "number": write_error,
        "plain": count_or_size,
        "degrees": lambda angle: f"{math.degrees(angle):.3f}".replace("nan", "-"),
        "cell": escape_cell,
        "packed": lambda text: _encode(gzip.compress(text.encode(), mtime=0)),
        "colour": lambda engine: f"var({choose_style(engine).variable})",
        "symbol": lambda engine: choose_style(engine).symbol,
    }
    # the only script that the page's security policy lets run
    file = Path(__file__).with_name("templates") / "report.js"
    script = file.read_text(encoding="utf-8")
    digest = _encode(hashlib.sha256(script.encode()).digest())
    environment.globals |= {"script": script, "script_hash": f"sha256-{digest}"}
    return environment.get_template(name).render(**what)


def _encode(data: bytes) -> str:
    return base64.b64encode(data).decode()


def escape_cell(text: object) -> str:
    """Write text that can neither end a table cell of Markdown nor start markup."""
    shown = " ".join(escape_controls(str(text)).split())
    for mark in "\\|`*_[]<>#":
        shown = shown.replace(mark, f"\\{mark}")
    return shown.replace("\\<", "&lt;").replace("\\>", "&gt;")


def write_error(value: float) -> str:
    """Write an error: three significant digits and a power of ten.

    A dash stands for no number.
    """
    return f"{value:.2e}".replace("nan", "-")


def count_or_size(value: float) -> str:
    """Write at most three significant digits; a dash stands for NaN.

    A count, which is a whole number below a million, is written in full.
    """
    if abs(value) < 1e6 and value == round(value):
        return str(round(value))
    return f"{value:.3g}".replace("nan", "-")
