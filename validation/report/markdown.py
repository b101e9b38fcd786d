"""report.md: short enough for a comment on a pull request."""

import math

from validation.report.summary import STATEMENT, Summary, used


def markdown(summary: Summary) -> str:
    """The report as Markdown."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("validation.report"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,  # the text is Markdown; `cell` escapes what would break out of it
    )
    environment.filters["cell"] = cell
    environment.filters["number"] = number
    environment.filters["degrees"] = lambda radians: f"{math.degrees(radians):.3f}"
    template = environment.get_template("report.md.j2")
    return template.render(s=summary, statement=STATEMENT, used=used)


def number(value: float) -> str:
    """Three significant digits; a dash where there is no number."""
    return "-" if math.isnan(value) else f"{value:.2e}"


def cell(text: object) -> str:
    """Text that can neither end a table cell nor start markup."""
    shown = " ".join(str(text).split())
    for mark in "\\|`*_[]<>#":
        shown = shown.replace(mark, f"\\{mark}")
    return shown.replace("\\<", "&lt;").replace("\\>", "&gt;")
