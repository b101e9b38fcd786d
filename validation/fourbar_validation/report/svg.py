"""A matplotlib figure as inline SVG, small and with ids of its own.

Text stays text. Matplotlib draws with the light colours of page.css; in the page each
is the custom property that it came from, which has a value for dark pages too
(Okabe-Ito hues, darkened or lightened until every one has a contrast of 3:1 or more).
"""

import hashlib
import io
import re
from pathlib import Path
from typing import Any, NamedTuple

from fourbar_validation.compare.tolerance import EPS

PAGE_STYLES = Path(__file__).parent / "templates" / "page.css"
_COLOURS: list[tuple[str, str, str]] = re.findall(
    r"(--[\w-]+): light-dark\((#\w+), (#\w+)\)", PAGE_STYLES.read_text(encoding="utf-8")
)
"""Custom property, and its colour in a light and in a dark page."""
LIGHT_COLOURS = {name: light for name, light, _ in _COLOURS}
INK, SOFT, GRID, BAND, ALLOWED, PAPER = (
    LIGHT_COLOURS[f"--{name}"]
    for name in ("ink", "soft", "grid", "under", "allowed", "paper")
)


class Style(NamedTuple):
    """Colour and mark of an engine; marks tell the engines apart in grey."""

    variable: str
    """Custom property of the page."""
    marker: str
    symbol: str
    """The mark as a character, for legends in text."""

    @property
    def colour(self) -> str:
        """Return the colour with which matplotlib draws."""
        return LIGHT_COLOURS[self.variable]

    @property
    def line(self) -> dict[str, Any]:
        """Return the style of a curve with its marks, as matplotlib takes it."""
        return {
            "color": self.colour,
            "marker": self.marker,
            "markersize": 3.5,
            "linewidth": 1.0,
        }


_STYLES = {
    "pinocchio-inverse": Style("--e1", "o", "○"),
    "mujoco-inverse": Style("--e2", "s", "□"),
    "mujoco-simulated": Style("--e3", "^", "△"),
    "free-body": Style("--e4", "D", "◇"),
    "ball-arithmetic": Style("--e5", "v", "▽"),
    "exudyn-constraints": Style("--e6", "<", "◁"),
    "opensim-constraints": Style("--e7", ">", "▷"),
    "drake-inverse": Style("--e8", "h", "⬡"),
}
_MARK_SHAPES = (("P", "✚"), ("X", "✖"), ("*", "★"), ("p", "⬟"))
OTHER_STYLES = tuple(Style(f"--e{9 + n % 3}", *_MARK_SHAPES[n % 4]) for n in range(12))
"""Styles of engines that are not named above, one after the other."""
STYLE_NUMBERS: dict[str, int] = {}
"""Number of each engine's style, as a run numbers its engines, otherwise in the order
of drawing.
"""
LEAST_DRAWN_ERROR = EPS / 16.0
"""Errors below this, zero among them, are drawn here."""
LONG_NUMBER = re.compile(r"(\d+\.\d)\d+")
COORDINATES = re.compile(r' (?:d|x|y|transform|points)="[^"]*"')


def choose_style(engine: str) -> Style:
    """Choose the style of an engine.

    One that is not named in `_STYLES` has the next of `OTHER_STYLES`.
    """
    return (
        _STYLES.get(engine)
        or OTHER_STYLES[
            STYLE_NUMBERS.setdefault(engine, len(STYLE_NUMBERS)) % len(OTHER_STYLES)
        ]
    )


def set_frame(axes: Any) -> None:
    """Give axes the frame and grid of all pictures in pages."""
    axes.grid(color=GRID, lw=0.5)
    axes.set_axisbelow(True)
    axes.tick_params(which="both", labelsize=8, color=GRID)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(GRID)


def write_svg(figure: Any, salt: str, **paper: Any) -> str:
    """Draw the figure, small, to stand in a page.

    `salt`: keeps the ids of two figures in one page apart; a copy of a figure has the
    same ids, of the same things. `paper`: what lies beneath
    it, as matplotlib's `savefig` takes it; left out: the page.
    """
    import matplotlib

    text = io.StringIO()
    settings: Any = {
        "svg.fonttype": "none",
        "svg.hashsalt": salt,
        "font.size": 8.5,
        "font.family": "sans-serif",
    }
    paper = paper or {"transparent": True, "facecolor": "none"}
    with matplotlib.rc_context(settings):
        metadata = {"Date": None, "Creator": None}
        figure.savefig(text, format="svg", metadata=metadata, **paper)
    svg = text.getvalue()
    return _shrink_svg(svg[svg.index("<svg") :])


def write_alone(figure: Any, salt: str) -> str:
    """Return the figure as the SVG of a file of its own.

    The paper is light or dark as the reader's pages are.
    """
    svg = write_svg(figure, salt, facecolor=figure.get_facecolor())
    light, dark = (
        "".join(f"{colours[0]}:{colours[form]};" for colours in _COLOURS)
        for form in (1, 2)
    )
    rules = f"svg{{{light}}}@media(prefers-color-scheme:dark){{svg{{{dark}}}}}"
    return svg.replace("<style>", f"<style>{rules}", 1)


def _shrink_svg(svg: str) -> str:
    """Make the SVG smaller, and take the colours of the page around it."""
    svg = re.sub("<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = COORDINATES.sub(lambda match: LONG_NUMBER.sub(r"\1", match.group()), svg)
    svg = re.sub('<g id="[^"]*"', "<g", re.sub(r">\s+<", "><", svg))
    black = "#000000"  # of matplotlib's own; in a page it is the ink
    for variable, colour in (("--ink", black), *LIGHT_COLOURS.items()):
        svg = svg.replace(colour, f"var({variable})")
    return _name_styles(svg)


def _name_styles(svg: str) -> str:
    """Write each style once, as a class.

    matplotlib repeats it on every mark and text. A class is named by its content, so
    that equal names in one page mean equal styles.
    """
    classes: dict[str, str] = {}

    def name(match: re.Match[str]) -> str:
        style = match.group(1)
        classes[style] = "m" + hashlib.sha256(style.encode()).hexdigest()[:8]
        return f' class="{classes[style]}"'

    svg = re.sub(' style="([^"]*)"', name, svg)
    rules = "".join(f".{short}{{{style}}}" for style, short in classes.items())
    # the rule that matplotlib writes for every element would otherwise hold for the
    # whole page
    return re.sub(r"<style[^>]*>[^<]*</style>", f"<style>{rules}</style>", svg, count=1)
