"""report.html: one self-contained page; every number can be traced to its row in results.csv, which it carries."""

import base64
import math
from collections.abc import Sequence
from itertools import groupby

from validation.judge import Record
from validation.report.figures import scene_figure
from validation.report.markdown import number
from validation.report.summary import STATEMENT, TOLERANCES, summarise, used
from validation.results import sorted_rows, to_csv


def html(records: Sequence[Record]) -> str:
    """The report as one page: no script is needed to read it, and nothing is fetched."""
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
    environment.filters["degrees"] = number_of_degrees
    rows = sorted_rows(row for record in records for row in record.rows)
    csv = base64.b64encode(to_csv(rows).encode("utf-8")).decode("ascii")
    figures = {record.name: scene_figure(record) for record in records}
    template = environment.get_template("report.html.j2")
    return template.render(
        s=summarise(records),
        records=records,
        row_number={(row.scene, row.engine, row.setting, row.quantity): line for line, row in enumerate(rows, 2)},
        by_scene={name: list(group) for name, group in groupby(enumerate(rows, 2), key=lambda pair: pair[1].scene)},
        figures={name: Markup(svg) for name, svg in figures.items() if svg is not None},
        tolerances=TOLERANCES,
        statement=STATEMENT,
        used=used,
        csv=csv,
    )


def number_of_degrees(radians: float) -> str:
    """An angle in degrees, three decimals; a dash where there is none."""
    return "-" if math.isnan(radians) else f"{math.degrees(radians):.3f}"
