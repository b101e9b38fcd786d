"""Labels next to points, where they cover neither each other nor what is drawn."""

import cmath
import math
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from fourbar.quantities import Mask
from fourbar.show.plot.style import INK, fit_legends, split_complex

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_IS_LABEL = "label"
"""Mark of the texts that are labels."""
LABEL_DIRECTIONS = 24
_NEAR = 10.0
"""Distance of a label's middle from its point until it is settled. This and the other
distances are in typographic points.
"""
_REACH = (7.0, 11.0, 16.0, 21.0)
"""Distances from the point to the label's edge that are tried."""
_MARGIN = 2.5
"""Space around a label: half the width of a bar and a little more."""
_INKED = 200
"""Level of its darkest channel, of 255, below which a pixel is drawn on. Plates and
grids are fainter, and may be covered.
"""
_CUT = 300.0
"""Cost of a label that leaves its axes, in square points of what it covers."""


def add_label(
    axes: "Axes",
    text: str,
    at: complex,
    away: complex,
    colour: str = INK,
    size: float = 8.0,
) -> None:
    """Write a text next to a point (data coordinates), in a direction from there.

    `settle_labels` then moves it to a free spot.
    """
    towards = cmath.rect(1.0, cmath.phase(away))
    sides = ("center", "left", "right")  # -1 is the last
    axes.annotate(
        text,
        split_complex(at),
        split_complex(_NEAR * towards),
        textcoords="offset points",
        ha=sides[round(towards.real)],
        va="center",
        color=colour,
        size=size,
        zorder=9,
        annotation_clip=False,
        gid=_IS_LABEL,
        in_layout=False,
    )


def settle_labels(figure: "Figure") -> None:
    """Lay a figure out, and move every label to its nearest free spot.

    The longest have the first choice.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.text import Annotation

    found = figure.findobj(Annotation)
    labels: list[Any] = [text for text in found if text.get_gid() == _IS_LABEL]
    for label in labels:
        label.set_visible(False)
    fit_legends(figure)
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    # labels must not move what they were measured against
    figure.set_layout_engine(None)
    levels = np.asarray(canvas.buffer_rgba())[::-1, :, :3].min(axis=2)
    inked = levels < _INKED
    for label in sorted(labels, key=lambda label: -len(label.get_text())):
        label.set_visible(True)
        _place(label, inked, canvas.get_renderer())


def _place(label: Any, inked: Mask, renderer: Any) -> None:
    """Place a label where it covers least, near and outward, and ink its box.

    `inked`: True for pixels that are drawn on, from below, (height, width).
    """
    per_point = renderer.points_to_pixels(1.0)
    window = label.axes.bbox
    point = complex(*label.axes.transData.transform(label.xy))
    outward = cmath.phase(complex(*label.xyann))
    extent = label.get_window_extent(renderer)
    margin = _MARGIN * per_point
    half = complex(0.5 * extent.width + margin, 0.5 * extent.height + margin)
    least = math.inf
    for reach, k in product(_REACH, range(LABEL_DIRECTIONS)):
        # outwards first, then by turns to either side
        side = 1 if k % 2 else -1
        turned = (k + 1) // 2 * side * math.tau / LABEL_DIRECTIONS
        towards = cmath.rect(1.0, outward + turned)
        gap = reach * per_point
        x = towards.real * (gap + half.real)
        offset = complex(x, towards.imag * (gap + half.imag))
        low, high = point + offset - half, point + offset + half
        box = inked[_span(low.imag, high.imag), _span(low.real, high.real)]
        is_whole = window.contains(*split_complex(low))
        is_whole &= window.contains(*split_complex(high))
        cost = box.sum() / per_point**2 + _CUT * (not is_whole)
        cost += 0.1 * (reach + k)
        if cost < least:
            least = cost
            best = offset, box
    offset, box = best
    label.set_ha("center")
    label.xyann = split_complex(offset / per_point)
    box[:] = True


def _span(start: float, stop: float) -> slice:
    """Return the pixels from one place to another."""
    return slice(max(0, math.floor(start)), max(0, math.ceil(stop)))
