"""Labels next to points, where they cover neither each other nor a line."""

import cmath
import math
from dataclasses import dataclass, field
from itertools import pairwise, product
from operator import itemgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from fourbar.show.plot.style import (
    Points,
    fit_legends,
    split_complex,
    split_points,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

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
POINT_DISTANCE, _MARK = 3.0, 4.5
"""Distance of the points along a line, and radius of a mark, typographic points."""
RING_POINTS = np.array([cmath.rect(1.0, k * math.tau / 12) for k in range(12)])


@dataclass(slots=True)
class Label:
    """A text that wants to stand next to `at` (data coordinates), away from `shun`."""

    axes: "Axes"
    text: str
    at: complex
    shun: complex
    colour: str
    size: float
    dots_clear: float = 0.0
    """Radius of the mark at the point itself, typographic points."""
    ring: float = 0.0
    """Radius of a ring around `at` that the label names, data coordinates: the label
    stands next to any point of it.
    """


@dataclass(slots=True)
class Labels:
    """The labels of one figure, and the lines and marks that they must keep off.

    Points are complex numbers x + iy in data coordinates.
    """

    wanted: list[Label] = field(default_factory=list)
    lines: list[tuple["Axes", Points, float]] = field(default_factory=list)

    def add(self, label: Label) -> None:
        """Request a label; it is placed by `settle`."""
        self.wanted.append(label)

    def keep_off(self, axes: "Axes", *points: complex, width: float = 1.0) -> None:
        """Keep labels off a line, given by its points, or off a mark at one point.

        A broad line (`width` in typographic points) counts by what of it would be
        covered.
        """
        self.lines.append((axes, np.array(points), width))

    def settle(self, figure: "Figure") -> None:
        """Place every label at its nearest free spot once the layout is final."""
        from matplotlib.axes import Axes
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        renderer = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
        fit_legends(figure)
        # labels must not move what they were measured against
        figure.set_layout_engine(None)
        rooms = {}
        for axes in figure.findobj(Axes):
            room = _Room(axes, figure.dpi / 72.0)
            # an arrow between places of the plane is kept off as a line
            texts = [
                text
                for text in axes.texts
                if text.get_text() or getattr(text, "xycoords", "data") != "data"
            ]
            room.boxes += [text.get_window_extent(renderer) for text in texts]
            rooms[axes] = room
        for axes, points, width in self.lines:
            rooms[axes].keep_off(_transform(axes.transData, points), width)
        for label in self.wanted:
            text = label.axes.text(
                *split_complex(label.at),
                label.text,
                color=label.colour,
                size=label.size,
                ha="center",
                va="center",
                zorder=9,
                clip_on=False,
            )
            box = text.get_window_extent(renderer)
            half = 0.5 * complex(box.x1 - box.x0, box.y1 - box.y0)
            centre, leader = rooms[label.axes].place(label, half)
            to_data = label.axes.transData.inverted()
            text.set_position(split_complex(_transform(to_data, centre)[0]))
            if leader is not None:
                # the limits stay, by which the labels were placed
                label.axes.plot(
                    *split_points(_transform(to_data, leader)).T,
                    color=label.colour,
                    zorder=8.5,
                    lw=0.5,
                    scalex=False,
                    scaley=False,
                )


class _Room:
    """Axes in pixels, with what is drawn and written there."""

    def __init__(self, axes: "Axes", per_point: float) -> None:
        self.axes = axes
        self.inside = axes.get_window_extent()
        self.per_point = per_point
        """Pixels of a typographic point."""
        self.boxes: list[Any] = []
        """Boxes of texts."""
        self.leaders: list[Points] = []
        """Ends of the lines that lead labels to their points."""
        self.dots = [np.empty(0, complex)]
        """Points of lines and marks."""
        self.widths = [np.empty(0)]
        """Width of the line of each of them, typographic points."""

    def keep_off(self, points: Points, width: float) -> None:
        """Add a line or a mark that labels should not cover."""
        dots = _sample_line(points, self.per_point)
        self.dots.append(dots)
        self.widths.append(np.full(len(dots), width))

    def place(self, label: Label, half: complex) -> tuple[complex, Points | None]:
        """Return the centre of a label, and the ends of the line that leads to it.

        The candidate that covers least is taken, among equal ones the nearest and most
        outward. A leader crosses neither a text nor another leader.

        `half`: half the width and height of the label's text.
        """
        half += complex(self.per_point, self.per_point)
        ends = label.at, label.shun, label.at + label.ring
        point, shun, beside = _transform(self.axes.transData, ends).tolist()
        away = math.pi / 2 if point == shun else cmath.phase(point - shun)
        ring = (beside - point).real
        dots = np.concatenate(self.dots)
        widths = np.concatenate(self.widths)
        edge = 0.5 * self.per_point * widths
        lower, upper = (complex(*corner) for corner in self.inside.get_points())
        placed = [box.get_points() for box in self.boxes]
        best = (math.inf, point, point)
        for reach, k in product(_REACH, range(LABEL_DIRECTIONS)):
            # outwards first, then by turns to either side
            side = 1 if k % 2 else -1
            turned = (k + 1) // 2 * side * math.tau / LABEL_DIRECTIONS
            towards = cmath.rect(1.0, away + turned)
            start = point + towards * ring
            gap = (reach + label.dots_clear) * self.per_point
            away_x = towards.real * (gap + half.real)
            centre = start + complex(away_x, towards.imag * (gap + half.imag))
            hit_in_x = np.abs(dots.real - centre.real) < half.real + edge
            hit_in_y = np.abs(dots.imag - centre.imag) < half.imag + edge
            covered = float((hit_in_x & hit_in_y) @ widths)
            box = _make_box(centre, half)
            below = centre - half - lower
            above = upper - centre - half
            leaves = min(below.real, below.imag, above.real, above.imag) < 0.0
            clashes = box.count_overlaps(placed) if placed else 0
            cost = 100.0 * clashes + 30.0 * leaves
            if reach > _LED:
                crossed = self._count_crossed(start, _clip(start, box))
                cost += _COST_OF_A_LEADER + 40.0 * crossed
            cost += covered + 0.04 * reach + 0.05 * k
            best = min(best, (cost, centre, start), key=itemgetter(0))
        _, centre, start = best
        box = _make_box(centre, half)
        self.boxes.append(box)
        leader = np.array([start, _clip(start, box)])
        length = math.dist(*split_points(leader))
        if length <= (_LED + label.dots_clear) * self.per_point:
            return centre, None
        self.leaders.append(leader)
        self.keep_off(leader, _LEADER_WIDTH)
        return centre, leader

    def _count_crossed(self, start: complex, end: complex) -> int:
        """Count the texts and leaders that the leader of a label would cross."""
        crossed = sum(_lines_cross(start, end, *leader) for leader in self.leaders)
        for box in self.boxes:
            a, b, c, d = (complex(*corner) for corner in box.corners())
            crossed += _lines_cross(start, end, a, d) or _lines_cross(start, end, b, c)
        return crossed


def _make_box(centre: complex, half: complex) -> Any:
    """Make a box of matplotlib about a centre, from half its width and height."""
    from matplotlib.transforms import Bbox

    return Bbox([split_complex(centre - half), split_complex(centre + half)])


def _transform(transform: Any, points: Any) -> Points:
    """Transform points from one system of coordinates to another, (n,)."""
    x, y = transform.transform(split_points(np.atleast_1d(points))).T
    return np.asarray(x + 1j * y)


def _clip(point: complex, box: Any) -> complex:
    """Return the point of a box that is nearest to a point."""
    return complex(*np.clip(split_complex(point), box.min, box.max))


def _lines_cross(p: complex, q: complex, r: complex, s: complex) -> bool:
    """Return True if the lines from p to q and from r to s cross."""

    def is_left(a: complex, b: complex, c: complex) -> bool:
        return ((b - a).conjugate() * (c - a)).imag > 0.0

    return is_left(p, q, r) != is_left(p, q, s) and is_left(r, s, p) != is_left(r, s, q)


def _sample_line(points: Points, per_point: float) -> Points:
    """Sample points along a polyline, or around a mark.

    A mark is a single point, or a line that ends where it begins.
    """
    pieces = [np.empty(0, complex)]
    step = POINT_DISTANCE * per_point
    for p, q in pairwise(points if len(points) > 1 else np.repeat(points, 2)):
        if not np.isfinite(p + q):
            continue
        if p == q:
            pieces.append(p + _MARK * per_point * RING_POINTS)
        between = int(min(abs(q - p) / step, 2000))
        pieces.append(p + np.linspace(0.0, 1.0, 2 + between) * (q - p))
    return np.concatenate(pieces)
