"""The look of the drawings, and how they reach a file.

Drawings use matplotlib's object interface and leave no global state behind.
"""

import io
import logging
import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import RLock
from typing import TYPE_CHECKING, Any

import numpy as np

from fourbar.errors import InputError, clean_line, expect, needing
from fourbar.quantities import Array, ComplexArray
from fourbar.show.shown_units import choose_unit, write_short
from fourbar.solution import Conversion
from fourbar.writing import STANDARD_STREAM, write_bytes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK = "#1a1a1a"
MUTED = "#6b6b6b"
FAINT = "#d9d9d9"
POINT = "#8A3B78"
"""Colour of the scene's own points."""
# Okabe and Ito's palette: distinguished by colour-blind readers, and by lightness and
# dashes in grey
BAR_COLOURS = {2: "#0072B2", 3: "#D55E00", 4: "#007A5A"}
BAR_DASHES: dict[int, Any] = {
    2: "-",
    3: (0, (5, 1.6)),
    4: (0, (7, 1.6, 1.4, 1.6)),
}
BAR_LINES: dict[int, dict[str, Any]] = {
    bar: {"color": colour, "ls": BAR_DASHES[bar]} for bar, colour in BAR_COLOURS.items()
}
"""Looks of the curves of bars."""
FORCE_LINES: dict[str, dict[str, Any]] = {
    "F12": {**BAR_LINES[2], "lw": 2.6},
    "F32": {**BAR_LINES[3], "lw": 2.0},
    "F43": {"color": POINT, "ls": (0, (1.4, 1.4)), "lw": 1.6},
    "F14": {**BAR_LINES[4], "lw": 1.1},
}
"""Looks of the curves of pin forces. Thick beneath thin: forces that are equal still
show all lines.
"""
FORCE_COLOURS = {name: look["color"] for name, look in FORCE_LINES.items()}


def write_force_name(name: str) -> str:
    """Write the name of a pin force as it is typeset."""
    return f"$F_{{{name[1:]}}}$"


def write_pin_name(name: str) -> str:
    """Write the name of a pin, or another letter with its index, as it is typeset."""
    return "$" + "_".join(name) + "$"


def write_plain(text: str) -> str:
    """Write a text for a caption, which is not typeset."""
    return re.sub(r"[$_{}]", "", text.replace("\\,", " ")).replace("-", "−")


_AT_EDGE: dict[str, Any] = {"parse_math": False, "x": 0.012, "ha": "left"}
TITLE: dict[str, Any] = {**_AT_EDGE, "size": 10.5, "weight": "bold"}
CAPTION_STYLE: dict[str, Any] = {**_AT_EDGE, "size": 6.8, "color": MUTED}
"""Styles of the texts of a whole figure, above and below its panels."""
RING_MARK: dict[str, Any] = {"mfc": "white", "mec": INK}
"""A mark that is a ring."""
GROUND_LINE: dict[str, Any] = {
    "color": MUTED,
    "lw": 1.0,
    "ls": (0, (8, 3, 2, 3)),
    "zorder": 1,
}
"""The line of the ground."""
Points = ComplexArray
"""Points of a drawing as complex numbers x + iy."""
# else its notes on a home without rights, where it has no cache, go to standard error
logging.getLogger("matplotlib").addHandler(logging.NullHandler())
STYLE_FILE = Path(__file__).with_name("fourbar.mplstyle")
PICTURE_DPI = 200
FORMATS = ("svg", "png", "pdf")


_ONE_AT_A_TIME = RLock()
"""Lock of the threads that draw. matplotlib's settings apply to the whole program."""


@contextmanager
def apply_style() -> Iterator[None]:
    """Apply the settings of `STYLE_FILE` for the time of one drawing.

    Raises DependencyError where matplotlib is not installed.
    """
    with needing("drawing needs matplotlib", "plot"):
        import matplotlib as mpl
    with _ONE_AT_A_TIME, mpl.rc_context():
        mpl.rcdefaults()  # a user's matplotlibrc does not change a published figure
        mpl.rcParams.update(
            mpl.rc_params_from_file(STYLE_FILE, use_default_template=False)
        )
        yield


def format_of(path: str | Path, formats: tuple[str, ...] = FORMATS) -> str:
    """Return the format that a file's ending names, the first for `-`.

    Raises InputError for one that is not among `formats`.
    """
    expect("path", path, str, Path)
    if Path(path) == STANDARD_STREAM:
        return formats[0]
    kind = Path(path).suffix.removeprefix(".").lower()
    if kind not in formats:
        raise InputError(
            "output",
            str(path),
            "must end in one of " + ", ".join(f".{end}" for end in formats),
        )
    return kind


PICTURE_METADATA: dict[str, dict[str, Any]] = {
    "svg": {"Date": None, "Creator": "fourbar"},
    "pdf": {"CreationDate": None, "Producer": None, "Creator": "fourbar"},
    "png": {"Software": "fourbar"},
}
"""Without a date: the same scene gives the same bytes."""


_DARK_FORM = b"""<style>
@media (prefers-color-scheme: dark) {
  svg:root { filter: invert(0.92) hue-rotate(180deg) }
}
</style>
"""
"""Style of an SVG file: lightness turned over, hues kept, where pages are dark.

White becomes the grey of dark pages. `:root` leaves an SVG within a page as it is, and
what draws SVG but is no browser does not read it.
"""


def add_dark_form(svg: bytes) -> bytes:
    """Give an SVG file the form that readers of dark pages see."""
    head, tag, rest = svg.partition(b"<defs>")
    return head + _DARK_FORM + tag + rest


class Drawing:
    """A figure that a notebook shows, and that `save` writes."""

    def __init__(self, figure: "Figure") -> None:
        self.figure = figure

    def _repr_svg_(self) -> str:
        return self._render("svg").decode()

    def save(self, path: str | Path) -> None:
        """Save it as SVG, PNG or PDF, by the ending of the path.

        The file is written atomically.
        """
        write_bytes(Path(path), self.render(format_of(path)))

    def render(self, file_format: str) -> bytes:
        """Return the bytes of a file; an SVG file has a form for dark pages too."""
        drawn = self._render(file_format)
        return add_dark_form(drawn) if file_format == "svg" else drawn

    def _render(self, file_format: str) -> bytes:
        buffer = io.BytesIO()
        with apply_style():
            self.figure.savefig(
                buffer,
                format=file_format,
                dpi=PICTURE_DPI,
                metadata=PICTURE_METADATA[file_format],
            )
        return buffer.getvalue()


def shorten_text(text: str, width: int) -> str:
    """Shorten a stranger's text to one line of at most `width` characters."""
    line = clean_line(text)
    if len(line) <= width:
        return line
    return line[: width - 1].rstrip() + "…"


def split_complex(z: complex) -> tuple[float, float]:
    """Split a point into x and y."""
    return (z.real, z.imag)


def split_points(points: Any) -> Array:
    """Split points into x and y, (n, 2)."""
    return np.stack([np.real(points), np.imag(points)], axis=-1)


def join_points(coordinates: Any) -> Points:
    """Join coordinates (..., 2) to points."""
    x, y = np.moveaxis(np.asarray(coordinates), -1, 0)
    return np.asarray(x + 1j * y)


def plot_points(axes: "Axes", points: Any, *marks: str, **look: Any) -> None:
    """Plot a line through points, or marks at them."""
    axes.plot(*split_points(np.atleast_1d(points)).T, *marks, **look)


def draw_arrow(
    axes: "Axes", tail: complex, tip: complex, colour: str, **look: Any
) -> None:
    """Draw an arrow over the bars, from end to end; none of no length."""
    from matplotlib.patches import FancyArrowPatch

    if tail == tip:
        return
    ends = split_points([tail, tip])
    arrow = FancyArrowPatch(
        *ends,
        arrowstyle="-|>",
        mutation_scale=10.0,
        lw=1.5,
        shrinkA=0.0,
        shrinkB=0.0,
        zorder=8,
        color=colour,
        clip_on=False,
        **look,
    )
    axes.add_patch(arrow)
    axes.update_datalim(ends)


def largest_magnitude(*values: Array) -> float:
    """Return the largest finite magnitude, or 0."""
    sizes = np.abs(np.concatenate([*map(np.ravel, values)]))
    return float(np.max(sizes, where=np.isfinite(sizes), initial=0.0))


def find_peak_index(values: Array) -> int:
    """Return the index of the largest finite magnitude; one is finite."""
    return int(np.argmax(np.where(np.isfinite(values), np.abs(values), -1.0)))


_RAISED_CHARACTERS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def choose_scale(largest: float, unit: str, units: Conversion) -> tuple[float, str]:
    """Choose the factor from SI and the unit of an axis.

    A number whose unit has no prefix may need a power of ten before the unit.
    """
    factor, name = choose_unit(largest, unit, units)
    power = math.floor(math.log10(factor * largest)) if largest > 0.0 else 0
    if -4 < power < 5:
        return factor, name
    raised = str(power).translate(_RAISED_CHARACTERS)
    return factor / 10.0**power, f"10{raised} {name}".removesuffix(" 1")


def write_labelled_quantity(value: float, unit: str, units: Conversion) -> str:
    """Write three digits of a quantity, in a unit or with the prefix that suits it."""
    return write_short(value, unit, units, digits=3).replace("-", "−")


def set_degree_ticks(axis: Any, most: int = 8) -> None:
    """Set ticks at round numbers of degrees."""
    from matplotlib.ticker import MultipleLocator

    span = float(np.ptp(axis.get_view_interval()))
    for step in (1, 2, 5, 10, 15, 30, 45, 60, 90, 180, 360):
        # finer and coarser ones are matplotlib's
        if 1.0 < span <= most * step:
            axis.set_major_locator(MultipleLocator(step))
            return


def place_legend(axes: "Axes", columns: int = 4) -> None:
    """Place the legend between title and panel.

    No curve is covered there; a drawing to scale has a narrower legend.
    """
    to_scale = axes.get_aspect() == 1.0
    above, pad, line = (1.005, 6.0, 12.0) if to_scale else (1.02, 7.0, 11.0)
    legend = axes.legend(loc="lower left", bbox_to_anchor=(0.0, above), ncols=columns)
    legend.set_in_layout(False)  # it would make its panel narrower
    pad += line * math.ceil(len(legend.get_texts()) / columns)
    axes.set_title(axes.get_title(loc="left"), pad=pad)


def fit_legends(figure: "Figure") -> None:
    """Lay a figure out; a legend wider than its panel gets the columns that fit."""
    from matplotlib.axes import Axes

    figure.draw_without_rendering()
    dpi = figure.dpi
    figure.set_dpi(PICTURE_DPI)  # on coarser pixels letters are narrower
    for axes in figure.findobj(Axes):
        legend = axes.get_legend()
        if legend is None or legend.get_in_layout():
            continue
        columns = len(legend.get_texts())
        while legend and legend.get_window_extent().width > axes.bbox.width and columns:
            place_legend(axes, columns)
            legend = axes.get_legend()
            columns -= 1
    figure.set_dpi(dpi)
