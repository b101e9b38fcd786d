"""A matplotlib figure as inline SVG: small, with ids of its own, its text as text, in the page's colours."""

import hashlib
import io
import re
from typing import Any

from fourbar_validation.compare.tolerance import EPS
from fourbar_validation.report.colours import GRID, replace_colours

FLOOR = EPS / 16.0
"""Errors below this, zero among them, are drawn here."""
LONG_NUMBER = re.compile(r"(\d+\.\d)\d+")
COORDINATES = re.compile(r' (?:d|x|y|transform|points)="[^"]*"')
STYLE = re.compile(r' style="([^"]*)"')
BETWEEN_TAGS = re.compile(r">\s+<")
METADATA = re.compile(r"<metadata>.*?</metadata>", re.DOTALL)
GROUP_NAME = re.compile(r'<g id="[^"]*"')


def set_frame(axes: Any) -> None:
    """Give axes the frame and grid of all pictures in pages."""
    axes.grid(color=GRID, lw=0.5)
    axes.set_axisbelow(True)
    axes.tick_params(which="both", labelsize=8, color=GRID)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(GRID)


def write_svg(figure: Any, salt: str) -> str:
    """Draw the figure, to stand in a page; `salt` keeps the ids of two figures in one page apart."""
    return shrink_svg(draw_svg(figure, salt))


def draw_svg(figure: Any, salt: str) -> str:
    """Draw the figure as matplotlib does, transparent: an SVG that stands by itself."""
    import matplotlib

    text = io.StringIO()
    settings: Any = {"svg.fonttype": "none", "svg.hashsalt": salt, "font.size": 8.5, "font.family": "sans-serif"}
    with matplotlib.rc_context(settings):
        figure.savefig(text, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    svg = text.getvalue()
    return svg[svg.index("<svg") :]


def shrink_svg(svg: str) -> str:
    """Make the SVG smaller, and take the colours of the page around it."""
    svg = METADATA.sub("", svg)
    svg = COORDINATES.sub(lambda found: LONG_NUMBER.sub(r"\1", found.group()), svg)
    svg = GROUP_NAME.sub("<g", BETWEEN_TAGS.sub("><", svg))
    return _name_styles(replace_colours(svg))


def _name_styles(svg: str) -> str:
    """Write each style once, as a class, as matplotlib repeats it on every mark and text.

    A class is named by its content, so that equal names in one page mean equal styles.
    """
    classes: dict[str, str] = {}

    def name(found: re.Match[str]) -> str:
        style = found.group(1)
        classes[style] = "m" + hashlib.sha256(style.encode()).hexdigest()[:8]
        return f' class="{classes[style]}"'

    svg = STYLE.sub(name, svg)
    rules = "".join(f".{short}{{{style}}}" for style, short in classes.items())
    # the rule that matplotlib writes for every element would otherwise hold for the whole page
    return re.sub(r"<style[^>]*>[^<]*</style>", f"<style>{rules}</style>", svg, count=1)
