"""The Jinja environment of every report."""

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jinja2 import Environment


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
    made.filters["degrees"] = lambda radians: "-" if math.isnan(radians) else f"{math.degrees(radians):.3f}"
    return made


def number(value: float) -> str:
    """Three significant digits; a dash where there is no number."""
    return "-" if math.isnan(value) else f"{value:.2e}"
