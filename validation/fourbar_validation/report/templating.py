"""The templates of every report, and how numbers and somebody's text stand in them."""

import base64
import gzip
import hashlib
import math
from pathlib import Path

from fourbar_validation.compare.rows import escape_controls
from fourbar_validation.report.svg import choose_style

WITHOUT_A_POWER = (1e-2, 1e6)
"""Numbers between these are written without a power of ten. The larger ones are if they
are whole.
"""

_SCRIPT = Path(__file__).with_name("templates") / "report.js"


def render(package: str, name: str, /, **what: object) -> str:
    """Fill in a template of a package.

    An unknown name in it is an error; in a page every text is escaped for HTML. It may
    build on those of the report: one page, one stylesheet, one form of a table.
    """
    from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

    page = name.endswith(
        ".html.j2"
    )  # in Markdown `escape_cell` escapes what would break out
    environment = Environment(
        loader=ChoiceLoader(
            [PackageLoader(package), PackageLoader("fourbar_validation.report")]
        ),
        undefined=StrictUndefined,
        autoescape=page,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=not page,
    )
    environment.filters |= {
        "number": write_error,
        "plain": count_or_size,
        "degrees": lambda radians: (
            "-" if math.isnan(radians) else f"{math.degrees(radians):.3f}"
        ),
        "cell": escape_cell,
        "packed": (
            lambda text: base64.b64encode(
                gzip.compress(text.encode("utf-8"), mtime=0)
            ).decode()
        ),
        "colour": lambda engine: f"var({choose_style(engine).variable})",
        "symbol": lambda engine: choose_style(engine).symbol,
    }
    # the only script that the page's security policy lets run
    script = _SCRIPT.read_text(encoding="utf-8")
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    environment.globals |= {"script": script, "script_hash": f"sha256-{digest}"}
    return environment.get_template(name).render(**what)


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
    if math.isnan(value):
        return "-"
    return f"{value:.2e}"


def count_or_size(value: float) -> str:
    """Write three significant digits: 628, 0.125, 3.10e-09.

    A dash stands for no number.
    """
    if math.isnan(value):
        return "-"
    if value == 0.0 or (float(value).is_integer() and abs(value) < WITHOUT_A_POWER[1]):
        return f"{value:.0f}"
    if WITHOUT_A_POWER[0] <= abs(value) < 1000.0:
        return f"{value:.3g}"
    return f"{value:.2e}"
