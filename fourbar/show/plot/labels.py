"""Labels next to points, where they cover neither each other nor a line."""

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from fourbar.show.plot.style import INK

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DrawnPoint = tuple[float, float]
_Box = tuple[float, float, float, float]
_REACH = (7.0, 11.0, 16.0, 23.0, 32.0, 44.0)
"""Distances from the point to the label's edge that are tried, typographic points."""
LABEL_DIRECTIONS = 16
_LED = 15.0
"""Distance from which a label is led to its point by a thin line, points. The points
are typographic.
"""


@dataclass(slots=True)
class Label:
    """A text that wants to stand next to `at` (data coordinates), away from `shun`."""

    axes: "Axes"
    text: str
    at: DrawnPoint
    shun: DrawnPoint
    colour: str = INK
    size: float = 8.5
    dots_clear: float = 0.0
    """Radius of the mark at the point itself, typographic points."""


@dataclass(slots=True)
class Labels:
    """The labels of one figure, and the lines and marks that they must keep off.

    The marks are in data coordinates.
    """

    wanted: list[Label] = field(default_factory=list)
    lines: list[tuple["Axes", list[DrawnPoint], float]] = field(default_factory=list)

    def add(self, label: Label) -> None:
        """Request a label; it is placed by `settle`."""
        self.wanted.append(label)

    def keep_off(self, axes: "Axes", *points: DrawnPoint, width: float = 1.0) -> None:
        """Keep labels off lines, given by their points; twice the same point is a mark.

        A broad line (`width` in typographic points) counts by what of it would be
        covered.
        """
        self.lines.append((axes, list(points), width))

    def settle(self, figure: "Figure") -> None:
        """Place every label at its nearest free spot once the layout is final."""
        from matplotlib.axes import Axes
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        renderer = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
        figure.draw_without_rendering()
        # labels must not move what they were measured against
        figure.set_layout_engine(None)
        per_point = figure.dpi / 72.0
        texts = [
            (axes, text)
            for axes in figure.findobj(Axes)
            for text in axes.texts
            if text.get_text()
        ]
        taken: list[tuple[Axes, _Box]] = [
            (axes, text.get_window_extent(renderer).extents) for axes, text in texts
        ]
        samples: dict[int, list[np.ndarray]] = {}
        for axes, points, width in self.lines:
            dots = _sample_line(axes.transData.transform(points), per_point)
            widths = np.full(len(dots), width)
            with_widths = np.column_stack([dots, widths])
            samples.setdefault(id(axes), []).append(with_widths)
        for label in self.wanted:
            axes = label.axes
            text = axes.text(
                *label.at,
                label.text,
                color=label.colour,
                size=label.size,
                ha="center",
                va="center",
            )
            text.set_zorder(9)
            text.set_clip_on(False)
            extent = text.get_window_extent(renderer)
            half = (0.5 * extent.width + per_point, 0.5 * extent.height + per_point)
            x, y = axes.transData.transform(label.at)
            sx, sy = axes.transData.transform(label.shun)
            if (x, y) != (sx, sy):
                away = math.atan2(y - sy, x - sx)
            else:
                away = math.pi / 2
            if id(axes) in samples:
                dots = np.concatenate(samples[id(axes)])
            else:
                dots = np.empty((0, 3))
            boxes = [box for owner, box in taken if owner is axes]
            panel = axes.get_window_extent().extents
            centre = _choose_spot(
                (x, y),
                away,
                half,
                dots,
                boxes,
                per_point,
                label.dots_clear,
                panel,
            )
            lower = (centre[0] - half[0], centre[1] - half[1])
            upper = (centre[0] + half[0], centre[1] + half[1])
            taken.append((axes, (*lower, *upper)))
            to_data = axes.transData.inverted().transform
            text.set_position(tuple(to_data(centre)))
            edge = np.clip((x, y), lower, upper)
            if math.dist(edge, (x, y)) > (_LED + label.dots_clear) * per_point:
                # the limits stay, by which the labels were placed
                keep_limits: dict[str, Any] = {"scalex": False, "scaley": False}
                axes.plot(
                    *zip(label.at, to_data(edge), strict=True),
                    color=label.colour,
                    lw=0.5,
                    zorder=8.5,
                    **keep_limits,
                )


POINT_DISTANCE, _MARK = 3.0, 4.5
"""Distance of the points along a line, and radius of a mark, typographic points."""
RING_POINTS = np.array(
    [(math.cos(k * math.tau / 12), math.sin(k * math.tau / 12)) for k in range(12)]
)


def _sample_line(points: np.ndarray, per_point: float) -> np.ndarray:
    """Sample points along a polyline, or around a mark.

    A mark is a line that ends where it begins.
    """
    pieces = []
    step = POINT_DISTANCE * per_point
    for p, q in pairwise(points):
        if not (np.all(np.isfinite(p)) and np.all(np.isfinite(q))):
            continue
        if np.array_equal(p, q):
            pieces.append(p + _MARK * per_point * RING_POINTS)
        dx, dy = q - p
        between = int(min(np.hypot(dx, dy) / step, 2000))
        shares = np.linspace(0.0, 1.0, 2 + between)
        pieces.append(p + shares[:, None] * (q - p))
    if pieces:
        return np.concatenate(pieces)
    return np.empty((0, 2))


def _overlaps(centre: DrawnPoint, half: DrawnPoint, box: _Box) -> bool:
    """Return True if a label with this centre and half size overlaps a box."""
    left, bottom, right, top = box
    in_x = abs(centre[0] - 0.5 * (left + right)) < half[0] + 0.5 * (right - left)
    in_y = abs(centre[1] - 0.5 * (bottom + top)) < half[1] + 0.5 * (top - bottom)
    return bool(in_x and in_y)


def _choose_spot(
    point: DrawnPoint,
    away: float,
    half: DrawnPoint,
    dots: np.ndarray,
    boxes: list[_Box],
    per_point: float,
    mark: float,
    inside: _Box,
) -> DrawnPoint:
    """Choose the centre of the label: the candidate that covers least.

    Among equal ones the nearest and most outward is taken.
    """
    best = point
    best_cost = math.inf
    edge = 0.5 * per_point * dots[:, 2]
    for reach in _REACH:
        gap = (reach + mark) * per_point
        for k in range(LABEL_DIRECTIONS):
            # outwards first, then by turns to either side
            side = 1 if k % 2 else -1
            angle = away + (k + 1) // 2 * side * math.tau / LABEL_DIRECTIONS
            x = point[0] + math.cos(angle) * (gap + half[0])
            y = point[1] + math.sin(angle) * (gap + half[1])
            hit_in_x = np.abs(dots[:, 0] - x) < half[0] + edge
            hit_in_y = np.abs(dots[:, 1] - y) < half[1] + edge
            covered = float((hit_in_x & hit_in_y) @ dots[:, 2])
            clashes = sum(_overlaps((x, y), half, box) for box in boxes)
            outside = x - half[0] < inside[0] or x + half[0] > inside[2]
            outside = outside or y - half[1] < inside[1] or y + half[1] > inside[3]
            cost = 100.0 * clashes + 30.0 * outside + covered + 0.04 * reach + 0.05 * k
            if cost < best_cost:
                best = (x, y)
                best_cost = cost
    return best
