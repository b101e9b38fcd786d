"""One colour and one mark per engine; each colour has a value for light and one for dark pages.

Matplotlib draws with the light values; `by_variable` then turns them into custom properties of the
page (Okabe-Ito hues, darkened or lightened until every one has a contrast of 3:1 or more).
"""

from typing import NamedTuple


class Style(NamedTuple):
    """How an engine is drawn: marks tell the engines apart in grey."""

    colour: str
    marker: str
    symbol: str
    """The mark as a character, for legends in text."""
    simulated: bool = False


STYLES = {
    "pinocchio-inverse": Style("#0072b2", "o", "○"),
    "mujoco-inverse": Style("#00845f", "s", "□"),
    "mujoco-simulated": Style("#c74f00", "^", "△", simulated=True),
    "free-body": Style("#a6478a", "D", "◇"),
    "ball-arithmetic": Style("#5f5b9e", "v", "▽"),
}
OTHER = Style("#7a6a00", "P", "✚")
INK, SOFT, GRID, BAND, ALLOWED, PAPER = "#1b1f24", "#57606a", "#d0d7dd", "#c3cad3", "#6e7781", "#fefefe"
VARIABLES = {
    "#000000": ("--ink", "#e6edf3"),
    INK: ("--ink", "#e6edf3"),
    SOFT: ("--soft", "#9aa5b1"),
    GRID: ("--grid", "#30373f"),
    BAND: ("--under", "#4a535e"),
    ALLOWED: ("--allowed", "#98a2ad"),
    PAPER: ("--paper", "#0d1117"),
    "#0072b2": ("--e1", "#58b4f0"),
    "#00845f": ("--e2", "#34c795"),
    "#c74f00": ("--e3", "#ff9350"),
    "#a6478a": ("--e4", "#e59fce"),
    "#5f5b9e": ("--e5", "#b3aef0"),
    "#7a6a00": ("--e6", "#d9c64a"),
}
"""Light colour: (custom property, colour on dark pages)."""


def style_of(engine: str) -> Style:
    """The style of an engine; all that are not known here look alike."""
    return STYLES.get(engine, OTHER)


def by_variable(svg: str) -> str:
    """The SVG with every known colour replaced by the page's custom property."""
    for light, (name, _) in VARIABLES.items():
        svg = svg.replace(light, f"var({name})")
    return svg


def declarations(*, dark: bool) -> str:
    """The custom properties as CSS."""
    return " ".join(
        f"{name}: {night if dark else day};" for day, (name, night) in VARIABLES.items() if day != "#000000"
    )
