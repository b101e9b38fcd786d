"""report.md: short enough for a comment on a pull request."""

from validation.report.summary import STATEMENT, Summary
from validation.report.templating import environment


def markdown(summary: Summary) -> str:
    """The report as Markdown."""
    templates = environment("validation.report", escape=False)  # Markdown: `cell` escapes what would break out
    templates.filters["cell"] = cell
    template = templates.get_template("report.md.j2")
    return template.render(s=summary, statement=STATEMENT)


def cell(text: object) -> str:
    """Text that can neither end a table cell nor start markup."""
    shown = " ".join(str(text).split())
    for mark in "\\|`*_[]<>#":
        shown = shown.replace(mark, f"\\{mark}")
    return shown.replace("\\<", "&lt;").replace("\\>", "&gt;")
