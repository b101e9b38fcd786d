"""Labels next to points, where they cover neither each other nor a line."""

import cmath
import math
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from fourbar.show.plot.style import (
    INK,
    Points,
    fit_legends,
    join_points,
    split_complex,
    split_points,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_IS_LABEL = "label"
"""Mark of the texts that are labels."""
_NEAR = 10.0
"""Distance of a label's middle from its point until it is settled. This and the other
distances are in typographic points.
"""
_REACH = (7.0, 11.0, 16.0, 23.0)
"""Distances from the point to the label's edge that are tried."""
LABEL_DIRECTIONS = 24
POINT_DISTANCE = 2.5
"""Distance of the dots along a line."""
_MARGIN = 2.5
"""Space around a label: half the width of a bar and a little more."""
_MARK_WEIGHT, _TEXT_WEIGHT, _HATCH_WEIGHT = 12.0, 30.0, 1.0
"""Weights of a mark, and of each dot of a text and around a hatching. A dot of a line
has the line's width.
"""


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
    """Lay a figure out, and move every label to its nearest free spot."""
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    renderer = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
    fit_legends(figure)
    # labels must not move what they were measured against
    figure.set_layout_engine(None)
    for axes in figure.findobj(Axes):
        if any(text.get_gid() == _IS_LABEL for text in axes.texts):
            _Room(axes, renderer).settle()


class _Room:
    """Axes in pixels, with what is drawn and written there."""

    def __init__(self, axes: "Axes", renderer: Any) -> None:
        self.axes = axes
        self.renderer = renderer
        self.per_point = float(renderer.points_to_pixels(1.0))
        """Pixels of a typographic point."""
        self.dots = np.empty(0, complex)
        """Points of lines, marks and texts."""
        self.weights = np.empty(0)
        """What it costs to cover each of them."""

    def settle(self) -> None:
        """Place every label of the axes."""
        drawn: list[Any] = [*self.axes.lines, *self.axes.patches]
        for artist in drawn:
            path = artist.get_transform().transform_path(artist.get_path())
            if artist.get_linestyle() == "None":
                self.keep_off(join_points(path.vertices), _MARK_WEIGHT)
                continue
            for line in path.cleaned(remove_nans=True).to_polygons(closed_only=False):
                self.keep_off(
                    self.sample(line), artist.get_linewidth() or _HATCH_WEIGHT
                )
        labels = []
        for text in self.axes.texts:
            if text.get_gid() == _IS_LABEL:
                labels.append(text)
            else:
                self.add_box(text.get_window_extent(self.renderer))
        for label in sorted(labels, key=lambda text: -len(text.get_text())):
            self.place(label)

    def keep_off(self, dots: Points, weight: float) -> None:
        """Add points that labels should not cover."""
        self.dots = np.append(self.dots, dots)
        self.weights = np.append(self.weights, np.full(len(dots), weight))

    def sample(self, line: Any) -> Points:
        """Sample dots along a polyline, (n, 2) pixels."""
        corners = join_points(line)
        along = np.append(0.0, np.cumsum(np.abs(np.diff(corners))))
        places = np.arange(0.0, along[-1], POINT_DISTANCE * self.per_point)
        return np.asarray(np.interp(places, along, corners))

    def add_box(self, box: Any) -> None:
        """Add the box of a text, which no label should cover."""
        for height in np.linspace(box.y0, box.y1, 3):
            row = self.sample([(box.x0, height), (box.x1, height)])
            self.keep_off(row, _TEXT_WEIGHT)

    def place(self, label: Any) -> None:
        """Place a label where it covers least, near and outward."""
        from matplotlib.transforms import Bbox

        point = complex(*self.axes.transData.transform(label.xy))
        outward = cmath.phase(complex(*label.xyann))
        extent = label.get_window_extent(self.renderer)
        margin = _MARGIN * self.per_point
        half = complex(0.5 * extent.width + margin, 0.5 * extent.height + margin)
        least = math.inf
        for reach, k in product(_REACH, range(LABEL_DIRECTIONS)):
            # outwards first, then by turns to either side
            side = 1 if k % 2 else -1
            turned = (k + 1) // 2 * side * math.tau / LABEL_DIRECTIONS
            towards = cmath.rect(1.0, outward + turned)
            gap = reach * self.per_point
            x = towards.real * (gap + half.real)
            offset = complex(x, towards.imag * (gap + half.imag))
            apart = self.dots - point - offset
            covers = (np.abs(apart.real) < half.real) & (np.abs(apart.imag) < half.imag)
            corners = point + offset - half, point + offset + half
            box = Bbox(split_points(corners))
            is_whole = self.axes.bbox.count_contains(box.corners()) == 4
            cost = float(covers @ self.weights) + 30.0 * (not is_whole)
            cost += 0.04 * reach + 0.05 * k
            if cost < least:
                least = cost
                best = offset, box
        offset, box = best
        label.set_ha("center")
        label.xyann = split_complex(offset / self.per_point)
        self.add_box(box)
