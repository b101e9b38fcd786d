"""One colour and one mark per engine; each colour has a value for light and one for dark pages.

Matplotlib draws with the light values; `by_variable` then turns them into custom properties of the
page (Okabe-Ito hues, darkened or lightened until every one has a contrast of 3:1 or more).
"""

from typing import NamedTuple


class Style(NamedTuple):
    """How an engine is drawn: marks tell the engines apart in grey."""

    colour: str
    dark: str
    """The same on dark pages."""
    marker: str
    symbol: str
    """The mark as a character, for legends in text."""
    simulated: bool = False


STYLES = {
    "pinocchio-inverse": Style("#0072b2", "#58b4f0", "o", "○"),
    "mujoco-inverse": Style("#00845f", "#34c795", "s", "□"),
    "mujoco-simulated": Style("#c74f00", "#ff9350", "^", "△", simulated=True),
    "free-body": Style("#a6478a", "#e59fce", "D", "◇"),
    "ball-arithmetic": Style("#5f5b9e", "#b3aef0", "v", "▽"),
}
OTHER = Style("#7a6a00", "#d9c64a", "P", "✚")
INK, SOFT, GRID, BAND, ALLOWED, PAPER = "#1b1f24", "#57606a", "#d0d7dd", "#c3cad3", "#6e7781", "#fefefe"
VARIABLES = {
    "#000000": ("--ink", "#e6edf3"),
    INK: ("--ink", "#e6edf3"),
    SOFT: ("--soft", "#9aa5b1"),
    GRID: ("--grid", "#30373f"),
    BAND: ("--under", "#4a535e"),
    ALLOWED: ("--allowed", "#98a2ad"),
    PAPER: ("--paper", "#0d1117"),
    **{style.colour: (f"--e{number}", style.dark) for number, style in enumerate((*STYLES.values(), OTHER), 1)},
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
    pairs = ((name, night if dark else day) for day, (name, night) in VARIABLES.items() if day != "#000000")
    return " ".join(f"{name}: {colour};" for name, colour in pairs)
