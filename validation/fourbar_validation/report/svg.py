"""A matplotlib figure as inline SVG: small, with ids of its own, its text as text, in the page's colours."""

import hashlib
import io
import re
from typing import Any

from fourbar_validation.report.colours import by_variable

LONG_NUMBER = re.compile(r"(\d+\.\d)\d+")
COORDINATES = re.compile(r' (?:d|x|y|transform|points)="[^"]*"')
STYLE = re.compile(r' style="([^"]*)"')
BETWEEN_TAGS = re.compile(r">\s+<")
METADATA = re.compile(r"<metadata>.*?</metadata>", re.DOTALL)
GROUP_NAME = re.compile(r'<g id="[^"]*"')


def svg_text(figure: Any, salt: str) -> str:
    """The figure, to stand in a page; `salt` keeps the ids of two figures in one page apart."""
    return inline(drawn(figure, salt))


def drawn(figure: Any, salt: str) -> str:
    """The figure as matplotlib draws it, transparent: an SVG that stands by itself."""
    import matplotlib

    text = io.StringIO()
    settings: Any = {"svg.fonttype": "none", "svg.hashsalt": salt, "font.size": 8.5, "font.family": "sans-serif"}
    with matplotlib.rc_context(settings):
        figure.savefig(text, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    svg = text.getvalue()
    return svg[svg.index("<svg") :]


def inline(svg: str) -> str:
    """The same, smaller and in the colours of the page around it."""
    svg = METADATA.sub("", svg)
    svg = COORDINATES.sub(lambda found: LONG_NUMBER.sub(r"\1", found.group()), svg)
    svg = GROUP_NAME.sub("<g", BETWEEN_TAGS.sub("><", svg))
    return _classed(by_variable(svg))


def _classed(svg: str) -> str:
    """Each style once, as a class: matplotlib repeats it on every mark and text.

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
