"""Plots of tolerances: bands and shares of the variance.

Bands are drawn for torque, pin forces and points.
"""

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fourbar.errors import InputError
from fourbar.quantities import Array
from fourbar.scene import command
from fourbar.show.plot.figures import compose, write_heading
from fourbar.show.plot.style import (
    FAINT,
    FORCE_COLOURS,
    INK,
    Drawing,
    apply_style,
    choose_scale,
    format_of,
    place_legend,
)
from fourbar.show.plot.view import axis_of
from fourbar.show.tolerances import describe_parted, find_part_unit, list_drawn_parts
from fourbar.solution import Conversion
from fourbar.studies.spread import BAND_PERCENTILES, Tolerances

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure

_MOST_SHARES = 5
"""Tolerances that have a colour of their own; the others are drawn together."""
_SHADES = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", FAINT)
_MOST_BANDS = 7
"""Torque, four pin forces, and the components of one point; the eighth is for shares.
"""
_OFF_SCALE = 98.0
"""Percentile of the half widths beyond which an axis is not stretched. Towards a limit
they grow without end.
"""


def draw_tolerances(
    spreads: Tolerances,
    path: str | Path,
    units: Conversion,
) -> None:
    """Draw the deviations from the nominal with their bands into a file.

    The file is written atomically.

    Raises InputError for another ending than of svg, png, pdf, or a single position;
    DependencyError without matplotlib.
    """
    format_of(path)
    if len(spreads.theta_2) < 2:
        raise InputError(
            f"motion.{spreads.scene.motion.commanded}",
            "one position",
            "a picture of bands needs a sweep",
        )
    parts = list_drawn_parts(spreads)[:_MOST_BANDS]
    columns = (len(parts) + 2) // 2
    axis = axis_of(spreads.scene, command(spreads.scene), units)

    def paint(figure: "SubFigure") -> str:
        panels = figure.subplots(2, columns, squeeze=False).ravel()
        for axes in panels[: len(parts) + 1]:
            axis.lay_out(axes, 4)
        for axes, part in zip(panels, parts, strict=False):
            _draw_band(axes, spreads, part, axis.values, units)
        for axes in panels[len(parts) + 1 :]:
            axes.set_axis_off()
        _draw_shares(panels[len(parts)], spreads, parts[0], axis.values)
        low, high = BAND_PERCENTILES
        lines = [
            f"Deviation from the nominal. Filled: {low:g} to {high:g} % of the samples;"
            " thin: least and greatest sampled; dashed: first-order worst case."
        ]
        for part in parts:
            lines += describe_parted(spreads, part)
        return "\n".join(textwrap.fill(line, 52 * columns) for line in lines)

    with apply_style():
        heading = f"{write_heading(spreads.scene)}: what the tolerances do"
        size = 2.95 * columns, 5.6
        figure = compose(size, f"{heading} ({spreads.samples} samples)", paint)
        Drawing(figure).save(path)


def _draw_band(
    axes: "Axes", spreads: Tolerances, part: str, over: Array, units: Conversion
) -> None:
    spread = spreads.spreads[part]
    ends = np.array([spread.low, spread.high, spread.least, spread.greatest])
    lines = np.concatenate([ends - spread.nominal, [spread.worst, -spread.worst]])
    sizes = np.abs(lines[:5])
    sizes = sizes[np.isfinite(sizes)]
    most = 1.1 * float(np.percentile(sizes, _OFF_SCALE)) if sizes.size else 0.0
    factor, unit = choose_scale(most, find_part_unit(part), units)
    low, high, least, greatest, *worst = factor * lines
    colour = FORCE_COLOURS.get(part.strip("|"), INK)
    axes.fill_between(over, low, high, color=colour, alpha=0.35, lw=0.0)
    for line in (least, greatest):
        axes.plot(over, line, color=colour, lw=0.7)
    for line in worst:
        axes.plot(over, line, color=INK, lw=0.9, ls=(0, (4, 2)))
    if sizes.max(initial=0.0) > 2.0 * most > 0.0:
        axes.set_ylim(-factor * most, factor * most)
    axes.axhline(0.0, color=INK, lw=0.6)
    axes.set(ylabel=f"deviation ({unit})", title=part)


def _draw_shares(axes: "Axes", spreads: Tolerances, part: str, over: Array) -> None:
    spread = spreads.spreads[part]
    with np.errstate(all="ignore"):
        shares = 100.0 * spread.shares / spread.shares.sum(axis=0)
    order = np.argsort(-np.nan_to_num(shares).sum(axis=1))
    names = [spreads.scene.tolerances[i].key for i in order]
    rows = [*shares[order]]
    if len(order) > _MOST_SHARES:
        rows[_MOST_SHARES:] = [np.sum(rows[_MOST_SHARES:], axis=0)]
        names[_MOST_SHARES:] = ["the others"]
    axes.stackplot(over, rows, colors=_SHADES[: len(rows)], labels=names, lw=0.0)
    axes.set(
        ylim=(0.0, 100.0),
        ylabel="share of the variance (%)",
        title=f"{part}: from which dimension",
    )
    place_legend(axes, 6)
