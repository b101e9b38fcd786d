"""report.html, one self-contained page, and report.md.

Every number leads to its row in results.csv, which the page carries.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

from fourbar.linkage import record
from fourbar.quantities import LINE, UNKNOWNS
from fourbar_validation.compare.rows import (
    FAILS,
    FORMULAS,
    REFUSES,
    UNDECIDED,
    Counts,
    Row,
    sort_rows,
    write_rows,
)
from fourbar_validation.engines.registry import WORK
from fourbar_validation.report.overview import OVERVIEW_GROUPS
from fourbar_validation.report.run_summary import (
    STATEMENT,
    Summary,
)
from fourbar_validation.report.scene_record import Record
from fourbar_validation.report.templating import (
    count_or_size,
    render,
)

ALL_OPEN = 8
"""Most scenes that are all shown open. The bodies of more are packed, and unpacked when
they are opened.
"""
QUANTITY_ORDER = (*UNKNOWNS, "torque_inertia", LINE.value, f"{LINE.value}_inertia")
"""Quantities in the order of the computation; others follow by name."""


class _Cell(NamedTuple):
    """One comparison and the line of results.csv where it stands."""

    line: int
    row: Row

    @property
    def kind(self) -> str:
        """Word for its colour."""
        verdict = self.row.verdict
        return verdict if verdict in (FAILS, REFUSES, UNDECIDED) else "holds"

    @property
    def shown(self) -> str:
        """Return the text of its cell."""
        if self.kind in (REFUSES, UNDECIDED):
            return self.kind
        return f"{self.row.used:.2g}"


class SectionFigure(NamedTuple):
    """A picture of a section, as an inline SVG."""

    alt: str
    caption: str
    svg: str


@record
class Section:
    """A part of the report that another module provides: text, pictures and a table.

    Cells of the table are plain text.
    """

    key: str
    """Anchor in the page, for example "hard"."""
    title: str
    text: str
    headings: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    figures: Sequence[SectionFigure] = ()
    links: Sequence[tuple[str, str]] = ()
    """(words, file next to the report)."""
    numbers: tuple[int, int] = (0, 0)
    """The columns that hold numbers: from, up to."""


def write_html(
    summary: Summary,
    first_lines: dict[str, int],
    sections: Sequence[Section] = (),
) -> str:
    """Write the report as one page that fetches nothing.

    Parameters
    ----------
    first_lines : the line of results.csv at which the rows of each scene start.
    sections : further parts, for example of the hard cases.
    """
    from markupsafe import Markup

    views = [
        _make_scene_view(scene, first_lines.get(scene.name, 2))
        for scene in summary.shown
    ]
    cells = [cell for view in views for cell in view["cells"]]
    rows = [cell.row for cell in cells]
    figure = (summary.first and summary.first.figure) or ""
    failing = [cell for cell in cells if cell.row.failed]
    failing.sort(key=lambda cell: (-cell.row.used, cell.line))
    return render(
        "fourbar_validation.report",
        "report.html.j2",
        s=summary,
        views=views,
        engines=_list_engines(rows),
        failing=failing,
        failing_scenes={cell.row.scene for cell in failing},
        groups=OVERVIEW_GROUPS,
        causes=summary.causes,
        places={
            view["scene"].name: (number, view) for number, view in enumerate(views, 1)
        },
        # the pictures of torque and pin force, without the linkage
        answers=Markup(figure.partition("</svg>")[2] or figure),
        lazy=len(views) > ALL_OPEN,
        sections=sections,
        independence=[
            (engine, *texts) for engine, texts in sorted(summary.independence.items())
        ],
        tolerances=[
            (tolerance.name, count_or_size(tolerance.factor), tolerance.reason)
            for tolerance in summary.tolerances
        ],
        statement=STATEMENT,
        work=WORK,
        csv=write_rows(rows),
    )


def write_summary_page(summary: Summary) -> str:
    """Write the report as Markdown, short enough for a comment on a pull request."""
    return render(
        "fourbar_validation.report",
        "report.md.j2",
        s=summary,
        groups=OVERVIEW_GROUPS,
        causes=summary.causes,
        statement=STATEMENT,
    )


def _make_scene_view(scene: Record, first_line: int) -> dict[str, Any]:
    """Return the data of one scene that the page shows.

    Of each quantity of an engine, and of each engine, it shows the comparison that used
    most of its allowance.
    """
    rows = sort_rows(scene.rows)
    lines = range(first_line, first_line + len(rows))
    cells = [*map(_Cell, lines, rows)]
    ranked = sorted(
        reversed(cells),
        key=lambda cell: (cell.row.compared, cell.row.used),
    )  # the last cell of a place stays
    by_place = {(cell.row.quantity, cell.row.engine): cell for cell in ranked}
    # a share of undecided numbers is no error, unless it fails
    worst = {
        cell.row.engine: cell
        for cell in ranked
        if cell.row.quantity != "undecided" or cell.row.failed
    }
    names = sorted({cell.row.quantity for cell in cells})
    names.sort(key=[*QUANTITY_ORDER, *names].index)
    return {
        "scene": scene,
        "cells": cells,
        "counts": Counts(rows),
        "engines": _list_engines(rows),
        "quantities": names,
        "by_place": by_place,
        "worst": worst,
    }


def _list_engines(rows: Any) -> list[str]:
    """List the engines by name: independent ones first, the formulas last."""
    return sorted(
        {row.engine for row in rows},
        key=lambda name: (name == FORMULAS, name),
    )
