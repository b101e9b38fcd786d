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
_REACH = (7.0, 11.0, 16.0, 23.0, 32.0, 44.0, 60.0)
"""Distances from the point to the label's edge that are tried, typographic points."""
LABEL_DIRECTIONS = 24
_LEADER_WIDTH = 10.0
"""Width that a leader counts as where a label would cover it, typographic points."""
_LED = 15.0
"""Distance from which a label is led to its point by a thin line, points. The points
are typographic.
"""
_COST_OF_A_LEADER = 3.0
"""What a led label costs beside one that stands near but less outward, or that touches
a thin line: as much as three dots of that line.
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
    ring: float = 0.0
    """Radius of a ring around `at` that the label names, data coordinates: the label
    stands next to any point of it.
    """


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
        rooms = {
            axes: _Room(axes.get_window_extent().extents, per_point)
            for axes in figure.findobj(Axes)
        }
        for axes, room in rooms.items():
            texts = [text for text in axes.texts if text.get_text()]
            room.boxes += [text.get_window_extent(renderer).extents for text in texts]
        for axes, points, width in self.lines:
            rooms[axes].keep_off(axes.transData.transform(points), width)
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
            away = math.atan2(y - sy, x - sx) if (x, y) != (sx, sy) else math.pi / 2
            room = rooms[axes]
            beside = label.at[0] + label.ring, label.at[1]
            ring = float(axes.transData.transform(beside)[0] - x)
            centre, (x, y) = room.choose_spot(
                (x, y), away, half, label.dots_clear, ring
            )
            lower = (centre[0] - half[0], centre[1] - half[1])
            upper = (centre[0] + half[0], centre[1] + half[1])
            room.boxes.append((*lower, *upper))
            to_data = axes.transData.inverted().transform
            text.set_position(tuple(to_data(centre)))
            edge = np.clip((x, y), lower, upper)
            if math.dist(edge, (x, y)) > (_LED + label.dots_clear) * per_point:
                room.leaders.append(((x, y), edge))
                room.keep_off(np.array([(x, y), edge]), _LEADER_WIDTH)
                # the limits stay, by which the labels were placed
                keep_limits: dict[str, Any] = {"scalex": False, "scaley": False}
                axes.plot(
                    *zip(to_data((x, y)), to_data(edge), strict=True),
                    color=label.colour,
                    lw=0.5,
                    zorder=8.5,
                    **keep_limits,
                )


@dataclass(slots=True)
class _Room:
    """Axes in pixels, with what is drawn and written there."""

    inside: _Box
    per_point: float
    """Pixels of a typographic point."""
    boxes: list[_Box] = field(default_factory=list)
    """Boxes of texts."""
    leaders: list[tuple[Any, Any]] = field(default_factory=list)
    """Ends of the lines that lead labels to their points."""
    dots: list[np.ndarray] = field(default_factory=lambda: [np.empty((0, 3))])
    """Points of lines and marks, each with the width of its line."""

    def keep_off(self, points: np.ndarray, width: float) -> None:
        """Add a line or a mark that labels should not cover."""
        dots = _sample_line(points, self.per_point)
        self.dots.append(np.column_stack([dots, np.full(len(dots), width)]))

    def choose_spot(
        self,
        point: DrawnPoint,
        away: float,
        half: DrawnPoint,
        mark: float,
        ring: float,
    ) -> tuple[DrawnPoint, DrawnPoint]:
        """Choose the centre of a label, and the point of its ring next to which it is.

        The candidate that covers least is taken, among equal ones the nearest and most
        outward. A leader crosses neither a text nor another leader.
        """
        best = (point, point)
        best_cost = math.inf
        dots = np.concatenate(self.dots)
        edge = 0.5 * self.per_point * dots[:, 2]
        for reach in _REACH:
            gap = (reach + mark) * self.per_point
            for k in range(LABEL_DIRECTIONS):
                # outwards first, then by turns to either side
                side = 1 if k % 2 else -1
                angle = away + (k + 1) // 2 * side * math.tau / LABEL_DIRECTIONS
                start = (
                    point[0] + math.cos(angle) * ring,
                    point[1] + math.sin(angle) * ring,
                )
                x = start[0] + math.cos(angle) * (gap + half[0])
                y = start[1] + math.sin(angle) * (gap + half[1])
                hit_in_x = np.abs(dots[:, 0] - x) < half[0] + edge
                hit_in_y = np.abs(dots[:, 1] - y) < half[1] + edge
                covered = float((hit_in_x & hit_in_y) @ dots[:, 2])
                clashes = sum(_overlaps((x, y), half, box) for box in self.boxes)
                cost = 100.0 * clashes + 30.0 * self._leaves((x, y), half)
                if reach > _LED:
                    crossed = self._count_crossed(start, (x, y), half)
                    cost += _COST_OF_A_LEADER + 40.0 * crossed
                cost += covered + 0.04 * reach + 0.05 * k
                if cost < best_cost:
                    best = ((x, y), start)
                    best_cost = cost
        return best

    def _leaves(self, centre: DrawnPoint, half: DrawnPoint) -> bool:
        """Return True if a label does not lie inside the axes."""
        left, bottom, right, top = self.inside
        (x, y), (wide, high) = centre, half
        in_x = left <= x - wide and x + wide <= right
        return not (in_x and bottom <= y - high and y + high <= top)

    def _count_crossed(
        self,
        point: DrawnPoint,
        centre: DrawnPoint,
        half: DrawnPoint,
    ) -> int:
        """Count the texts and leaders that the leader of a label would cross."""
        end = np.clip(point, np.subtract(centre, half), np.add(centre, half))
        crossed = sum(_lines_cross(point, end, *leader) for leader in self.leaders)
        for left, bottom, right, top in self.boxes:
            one = _lines_cross(point, end, (left, bottom), (right, top))
            crossed += one or _lines_cross(point, end, (left, top), (right, bottom))
        return crossed


def _lines_cross(p: Any, q: Any, r: Any, s: Any) -> bool:
    """Return True if the lines from p to q and from r to s cross."""

    def is_left(a: Any, b: Any, c: Any) -> bool:
        return bool((b[0] - a[0]) * (c[1] - a[1]) > (b[1] - a[1]) * (c[0] - a[0]))

    return is_left(p, q, r) != is_left(p, q, s) and is_left(r, s, p) != is_left(r, s, q)


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
