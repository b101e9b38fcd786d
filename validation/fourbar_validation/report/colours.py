"""One colour and one mark per engine; each colour has a value for light and one for dark pages.

Matplotlib draws with the light values; `replace_colours` then turns them into custom properties of the
page (Okabe-Ito hues, darkened or lightened until every one has a contrast of 3:1 or more).
"""

from typing import Any, NamedTuple


class Style(NamedTuple):
    """Colours and mark of an engine; marks tell the engines apart in grey."""

    colour: str
    dark: str
    """Colour on dark pages."""
    marker: str
    symbol: str
    """The mark as a character, for legends in text."""
    simulated: bool = False

    @property
    def line(self) -> dict[str, Any]:
        """Return the style of a curve with its marks, as matplotlib takes it."""
        return {"color": self.colour, "marker": self.marker, "markersize": 3.5, "linewidth": 1.0}


STYLES = {
    "pinocchio-inverse": Style("#0072b2", "#58b4f0", "o", "○"),
    "mujoco-inverse": Style("#00845f", "#34c795", "s", "□"),
    "mujoco-simulated": Style("#c74f00", "#ff9350", "^", "△", simulated=True),
    "free-body": Style("#a6478a", "#e59fce", "D", "◇"),
    "ball-arithmetic": Style("#5f5b9e", "#b3aef0", "v", "▽"),
    "exudyn-constraints": Style("#8c564b", "#d8a597", "<", "◁"),
    "opensim-constraints": Style("#3f7d20", "#8fce6a", ">", "▷"),
    "drake-inverse": Style("#00708f", "#5cc3df", "h", "⬡"),
}
_COLOURS = (("#7a6a00", "#d9c64a"), ("#7b4fc9", "#c3a6ff"), ("#9a5b00", "#f0b060"))
_MARKS = (("P", "✚"), ("X", "✖"), ("*", "★"), ("p", "⬟"))
OTHERS = tuple(Style(*_COLOURS[n % 3], *_MARKS[n % 4]) for n in range(12))
"""Styles of engines that are not named above, one after the other."""
NUMBERS: dict[str, int] = {}
"""Number of each engine's style among them, as a run numbers its engines, otherwise in the order of drawing."""
INK, SOFT, GRID, BAND, ALLOWED, PAPER = "#1b1f24", "#57606a", "#d0d7dd", "#c3cad3", "#6e7781", "#fefefe"
VARIABLES = {
    "#000000": ("--ink", "#e6edf3"),
    INK: ("--ink", "#e6edf3"),
    SOFT: ("--soft", "#9aa5b1"),
    GRID: ("--grid", "#30373f"),
    BAND: ("--under", "#4a535e"),
    ALLOWED: ("--allowed", "#98a2ad"),
    PAPER: ("--paper", "#0d1117"),
    **{style.colour: (f"--e{number}", style.dark) for number, style in enumerate((*STYLES.values(), *OTHERS[:3]), 1)},
}
"""Light colour: (custom property, colour on dark pages)."""


def choose_style(engine: str) -> Style:
    """Choose the style of an engine: one that is not named in `STYLES` has the next of `OTHERS`."""
    return STYLES.get(engine) or OTHERS[NUMBERS.setdefault(engine, len(NUMBERS)) % len(OTHERS)]


def replace_colours(svg: str) -> str:
    """Replace every colour of the table by the page's custom property."""
    for light, (name, _) in VARIABLES.items():
        svg = svg.replace(light, f"var({name})")
    return svg


def write_declarations(*, dark: bool) -> str:
    """Write the custom properties as CSS."""
    pairs = ((name, night if dark else day) for day, (name, night) in VARIABLES.items() if day != "#000000")
    return " ".join(f"{name}: {colour};" for name, colour in pairs)
