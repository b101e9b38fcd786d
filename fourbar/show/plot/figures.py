"""The figures by name, and how a scene becomes a file."""

import textwrap
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from fourbar.errors import InputError
from fourbar.linkage import require
from fourbar.scene import Scene
from fourbar.show.columns import explain_static
from fourbar.show.motion_curves import describe_motion
from fourbar.show.plot import curves, freebody, linkage_figure
from fourbar.show.plot.labels import settle_labels
from fourbar.show.plot.style import (
    CAPTION_STYLE,
    TITLE,
    Drawing,
    apply_style,
    format_of,
    shorten_text,
)
from fourbar.show.plot.view import View, is_over_time, make_view
from fourbar.solution import SI, Conversion, require_units

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

_PANELS: dict[str, Callable[["Axes", View], None]] = {
    "linkage": linkage_figure.draw_linkage,
    "moving linkage": partial(linkage_figure.draw_linkage, moving=True),
    "coupler": linkage_figure.draw_coupler_curves,
    "centres": linkage_figure.draw_centres,
    **{
        name: partial(curves.draw_chart, list_curves=list_curves)
        for name, list_curves in curves.CHARTS.items()
    },
}
"""Panels, in the order in which their notes are written."""


class FigureKind(NamedTuple):
    """Declaration of a figure."""

    size: tuple[float, float]
    """Width and height, inches."""
    paint: Callable[["SubFigure", View], None]
    needs_speed: bool = False


def _draw_panels(figure: "SubFigure", shown: View, *, rows: list[Any]) -> None:
    """Draw panels by their names, row by row; a name that is repeated is one panel."""
    # widths of two columns, of which the left one has the linkage
    widths = [1.15, 1.0] if len(rows[0]) == 2 else None
    panels = figure.subplot_mosaic(rows, width_ratios=widths)
    for name, draw_panel in _PANELS.items():
        if name in panels:
            draw_panel(panels[name], shown)


def _draw_overview(figure: "SubFigure", shown: View) -> None:
    free = shown.scene.motion.free is not None
    # what drives; in a free motion the work of loads and effects
    rows = [["linkage", "linkage", "energy" if free else "drive"]]
    if not shown.moves:
        rows = [["linkage", "angles"], ["linkage", "mu"]]
    elif shown.rests:
        rows += [["linkage", "linkage", "angles"], ["forces", "forces", "mu"]]
    else:
        rows += [
            ["linkage", "linkage", "forces" if free else "power"],
            ["angles", "omega", "alpha"],
            ["mu", "mu", "mu"] if free else ["forces", "forces", "mu"],
        ]
    _draw_panels(figure, shown, rows=rows)


def _draw_kinematics(figure: "SubFigure", shown: View) -> None:
    rates = [["omega"], ["alpha"]] if shown.moves and not shown.rests else []
    _draw_panels(figure, shown, rows=[["angles"], *rates])


def _show(
    size: tuple[float, float], *rows: list[str], needs_speed: bool = False
) -> FigureKind:
    """Declare a figure of the same panels for every scene."""
    return FigureKind(size, partial(_draw_panels, rows=[*rows]), needs_speed)


FIGURES = {
    "overview": FigureKind((7.7, 9.2), _draw_overview),
    "linkage": _show((5.6, 5.2), ["linkage"]),
    "coupler": _show((5.6, 5.4), ["coupler"]),
    "kinematics": FigureKind((5.6, 6.8), _draw_kinematics),
    "points": _show(
        (11.0, 5.6),
        ["moving linkage", "speeds"],
        ["moving linkage", "accelerations"],
        needs_speed=True,
    ),
    "torque": _show((5.6, 3.2), ["drive"], needs_speed=True),
    "stroke": _show((5.6, 3.2), ["stroke"]),
    "forces": _show((5.6, 3.2), ["forces"], needs_speed=True),
    "energy": _show((5.6, 3.2), ["energy"], needs_speed=True),
    "transmission": _show((5.6, 3.2), ["mu"]),
    "shaking": _show(
        (5.6, 5.4), ["shaking force"], ["shaking moment"], needs_speed=True
    ),
    "ratios": _show((5.6, 5.4), ["ratios"], ["advantage"]),
    "centres": _show((5.6, 5.4), ["centres"]),
    "freebody": FigureKind((9.6, 4.6), freebody.draw_free_bodies, True),
    "bars": FigureKind((9.6, 6.2), freebody.draw_internal_forces, True),
}
WITH_DIMENSIONS = ("overview", "linkage", "points")
"""Figures in which bars are numbered."""


def _choose_figure(scene: Scene, figure: str) -> FigureKind:
    """Choose a figure that the scene can show."""
    if not isinstance(figure, str) or figure not in FIGURES:
        raise InputError("figure", figure, "must be one of " + ", ".join(FIGURES))
    motion = scene.motion
    drive = scene.drive
    if FIGURES[figure].needs_speed and motion.speed is None and not is_over_time(scene):
        raise InputError(
            f"motion.{motion.names[1]}",
            None,
            f"is needed for the figure {figure!r}; {explain_static(scene)}",
        )
    stroked = drive is not None and drive.has_stroke and motion.stroke is None
    wanting = {
        "stroke": (
            not stroked,
            "needs a linear drive (drive.from, drive.to) whose stroke is not commanded",
        ),
        "energy": (motion.free is None, "needs a free motion: motion.free"),
        "torque": (
            motion.free is not None,
            "a free motion has no driving torque; energy shows what moves it",
        ),
    }
    is_wanting, reason = wanting.get(figure, (False, ""))
    if is_wanting:
        raise InputError("figure", figure, reason)
    return FIGURES[figure]


def draw_figure(
    scene: Scene,
    figure: str = "overview",
    *,
    position: float | None = None,
    units: Conversion = SI,
    dimensions: bool = False,
) -> Drawing:
    """Draw a figure of a scene for a notebook.

    `Scene.plot` describes the parameters.
    """
    kind = _choose_figure(scene, figure)
    units = require_units(units)
    if dimensions and figure not in WITH_DIMENSIONS:
        raise InputError(
            "dimensions",
            dimensions,
            f"must be left out of the figure {figure}, which does not show it;"
            f" these do: {', '.join(WITH_DIMENSIONS)}",
        )
    if position is not None:
        position = require("position", position)
    with apply_style():
        shown = make_view(scene, position)
        shown.units = units
        shown.dimensions = dimensions
        _look_between(shown)

        def paint(part: "SubFigure") -> str:
            kind.paint(part, shown)
            return textwrap.fill(" ".join(shown.notes), int(kind.size[0] * 18.5))

        return Drawing(compose(kind.size, write_heading(scene), paint))


def _look_between(shown: View) -> None:
    """Add what lies between the positions of the sweep.

    Jumps and poles are drawn where they are, peaks to their height.
    """
    motion = describe_motion(shown.sweep)
    panels = motion.panels
    shown.poles = {name: panels.list_poles(name) for name in panels.growing}
    shown.sweep = motion.solve_with_peaks()
    shown.notes += [
        f"{jumps[0].upper()}{jumps[1:]}."
        for jumps in motion.list_jumps(shown.axis.symbol, shown.axis.write)
    ]


def draw(
    scene: Scene,
    path: str | Path,
    figure: str = "overview",
    **options: Any,
) -> None:
    """Draw a figure of a scene, as `draw_figure` does, into a file.

    The same scene gives the same bytes.
    """
    format_of(path)
    draw_figure(scene, figure, **options).save(path)


def compose(
    size: tuple[float, float], heading: str, paint: Callable[["SubFigure"], str]
) -> "Figure":
    """Compose a figure of a size (inches), laid out and labelled.

    `paint`: draws its panels, and returns the caption beneath them.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    (part,) = figure.subfigures(squeeze=False).ravel()
    caption = paint(part)
    part.suptitle(heading, **TITLE)
    if caption:
        part.supxlabel(caption, linespacing=1.35, **CAPTION_STYLE)
    settle_labels(figure)
    return figure


def write_heading(scene: Scene) -> str:
    """Write the title of a scene over a figure."""
    return shorten_text(scene.title, 90) or "Four-bar linkage"
