"""report.html: one self-contained page; every number can be traced to its row in results.csv, which it carries."""

import base64
import math
from itertools import groupby

from validation.report.markdown import number
from validation.report.summary import STATEMENT, TOLERANCES, Summary, used
from validation.results import to_csv


def html(summary: Summary, first_lines: dict[str, int]) -> str:
    """The report as one page: no script is needed to read it, and nothing is fetched.

    `first_lines` gives the line of results.csv at which the rows of each scene start.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    environment = Environment(
        loader=PackageLoader("validation.report"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        autoescape=True,
    )
    environment.filters["number"] = number
    environment.filters["degrees"] = lambda radians: "-" if math.isnan(radians) else f"{math.degrees(radians):.3f}"
    numbered = [
        (line, row) for page in summary.pages for line, row in enumerate(page.rows, first_lines.get(page.name, 2))
    ]
    csv = base64.b64encode(to_csv(row for _, row in numbered).encode("utf-8")).decode("ascii")
    template = environment.get_template("report.html.j2")
    return template.render(
        s=summary,
        row_number={(row.scene, row.engine, row.setting, row.quantity): line for line, row in numbered},
        by_scene={name: list(group) for name, group in groupby(numbered, key=lambda pair: pair[1].scene)},
        # drawn by our own figure code, titles escaped by the SVG writer
        figures={page.name: Markup(page.figure) for page in summary.pages if page.figure},
        tolerances=TOLERANCES,
        statement=STATEMENT,
        used=used,
        csv=csv,
    )
