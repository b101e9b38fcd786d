"""What moves in a film: each artist is made once, and then put elsewhere."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from matplotlib.text import Annotation

from fourbar.quantities import Array
from fourbar.show.plot.labels import Label

FILM_DPI = 100
"""Pixels per inch of a film."""


class Stage:
    """Axes for what moves, which use the artists of earlier frames again.

    `draw_mechanism` draws on them as on axes. The limits stay as they are.
    """

    def __init__(self, axes: Axes) -> None:
        self._axes = axes
        self._idle: dict[Any, list[Any]] = {}
        self._shown: list[tuple[Any, Any]] = []
        self._patches: list[Patch] = []
        self.update_datalim = axes.update_datalim

    def clear(self) -> None:
        """Hide what the last frame has."""
        for key, artist in self._shown:
            artist.set_visible(False)
            self._idle[key].append(artist)
        self._shown = []
        for patch in self._patches:
            patch.remove()
        self._patches = []

    def _take(self, key: Any, make: Callable[[], Any]) -> Any:
        """Take an idle artist of this look; if there is none, make one."""
        idle = self._idle.setdefault(key, [])
        artist = idle.pop() if idle else make()
        artist.set_visible(True)
        self._shown.append((key, artist))
        return artist

    def plot(self, x: Any, y: Any, *marks: str, **look: Any) -> list[Line2D]:
        """Put a line of this look here."""
        line = self._take(
            (*marks, *look.items()),
            lambda: self._axes.plot(x, y, *marks, **look)[0],
        )
        line.set_data(x, y)
        return [line]

    def add_patch(self, patch: Patch) -> Patch:
        """Add a patch for one frame."""
        self._patches.append(patch)
        self._axes.add_artist(patch)
        return patch

    def annotate(self, text: str, **look: Any) -> Annotation:
        """Write a text or an arrow that stands still."""
        annotation = self._take(text, lambda: self._axes.annotate(text, **look))
        assert isinstance(annotation, Annotation)
        return annotation

    def add_label(self, label: Label) -> Artist:
        """Put the picture of a label outwards from its point, or from its ring.

        No free spot is searched: from frame to frame the label would jump.
        """
        key = (label.text, label.colour, label.size)
        picture = self._take(key, lambda: self._axes.add_artist(_LabelPicture(*key)))
        assert isinstance(picture, _LabelPicture)
        dx, dy = np.subtract(label.at, label.shun)
        away = complex(dx, dy) / max(math.hypot(dx, dy), 1e-300)
        beside = np.add(label.at, (label.ring * away.real, label.ring * away.imag))
        picture.put(self._axes.transData.transform(beside), away)
        return picture


class _LabelPicture(Artist):
    """A label as a picture, which is drawn once and moved by whole pixels."""

    zorder = 9

    def __init__(self, text: str, colour: str, size: float) -> None:
        super().__init__()
        self.set_label(text)
        self._pixels = _draw_label(text, colour, size)
        self._corner = (0, 0)

    def put(self, point: Array, away: complex) -> None:
        """Put the picture beside a point (px), towards a direction of length 1."""
        height, width = self._pixels.shape[:2]
        share_left = 0.5 if abs(away.real) < 0.5 else float(away.real < 0.0)
        per_point = FILM_DPI / 72.0
        left = point[0] + 8.0 * per_point * away.real - share_left * width
        bottom = point[1] + 11.0 * per_point * away.imag - 0.5 * height
        self._corner = (round(left), round(bottom))

    def draw(self, renderer: Any) -> None:
        """Draw the picture as it is."""
        if self.get_visible():
            renderer.draw_image(renderer.new_gc(), *self._corner, self._pixels)


def _draw_label(text: str, colour: str, size: float) -> Array:
    """Draw a text as a picture, (rows, columns, 4), its lowest row first.

    A bright edge keeps the text clear of a bar of its own colour.
    """
    figure = Figure(dpi=FILM_DPI, facecolor="none")
    canvas = FigureCanvasAgg(figure)
    edge = withStroke(linewidth=2.5, foreground="white")
    figure.text(0.05, 0.5, text, size=size, color=colour, path_effects=[edge])
    canvas.draw()  # type: ignore[no-untyped-call]
    pixels = np.asarray(canvas.buffer_rgba())  # type: ignore[no-untyped-call]
    rows, columns = np.nonzero(pixels[:, :, 3])
    if not len(rows):
        return pixels[:1, :1].copy()
    kept = pixels[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
    return np.ascontiguousarray(kept[::-1])
