"""The Jinja environment of every report."""

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jinja2 import Environment


PLAIN = (1e-2, 1e6)
"""Numbers between these are written without a power of ten, the larger ones where they are whole."""


def environment(package: str, *, escape: bool) -> "Environment":
    """Templates of `package`, an unknown name an error; with `escape` every text is escaped for HTML."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    made = Environment(
        loader=PackageLoader(package),
        undefined=StrictUndefined,
        autoescape=escape,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=not escape,
    )
    made.filters["number"] = number
    made.filters["plain"] = count_or_size
    made.filters["degrees"] = lambda radians: "-" if math.isnan(radians) else f"{math.degrees(radians):.3f}"
    return made


def number(value: float) -> str:
    """An error: three significant digits and a power of ten; a dash where there is no number."""
    return "-" if math.isnan(value) else f"{value:.2e}"


def count_or_size(value: float) -> str:
    """Three significant digits, as a person writes them: 628, 0.125, 3.10e-09; a dash where there is no number."""
    if math.isnan(value):
        return "-"
    if value == 0.0 or (float(value).is_integer() and abs(value) < PLAIN[1]):
        return f"{value:.0f}"
    return f"{value:.3g}" if PLAIN[0] <= abs(value) < 1000.0 else f"{value:.2e}"
