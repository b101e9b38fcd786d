"""What torque, pin forces and a named point depend on most: bars, the longest first."""

from typing import TYPE_CHECKING

from fourbar.show.influence import ranked
from fourbar.show.plot.labels import Labels
from fourbar.show.plot.style import FORCE_COLOURS, INK, unit_for
from fourbar.show.plot.view import View
from fourbar.solution import unit_of
from fourbar.studies.derivatives import sensitivity
from fourbar.studies.influence import influences, largest, shown_quantities

if TYPE_CHECKING:
    from matplotlib.figure import SubFigure

MOST_NUMBERS = 12
"""Of a scene's numbers, those that matter most: more are thin bars that nobody reads."""
MOST_PANELS = 6
"""Torque, the four pin forces, and a point."""


def draw_influences(figure: "SubFigure", shown: View, labels: Labels) -> None:
    """One panel for each quantity over the same rows."""
    del labels
    found = sensitivity(shown.scene)
    names = shown_quantities(found)[:MOST_PANELS]
    keys = ranked(found, names)[:MOST_NUMBERS][::-1]
    panels = figure.subplots(1, len(names), squeeze=False)[0]
    for axes, name in zip(panels, names, strict=True):
        size = {row.key: abs(row.change) for row in influences(found, name)}
        factor, unit = unit_for(max([size.get(key, 0.0) for key in keys], default=0.0), unit_of(name))
        axes.barh(
            range(len(keys)),
            [factor * size.get(key, 0.0) for key in keys],
            height=0.62,
            color=FORCE_COLOURS.get(name, INK),
        )
        axes.set_yticks(range(len(keys)), keys if axes is panels[0] else [""] * len(keys), size=6.8)
        axes.set_ylim(-0.6, len(keys) - 0.4)
        axes.set_title(name if len(name) <= 10 else name[:9] + "…")
        axes.set_xlabel(unit)
        axes.grid(False, axis="y")
        axes.locator_params(axis="x", nbins=3)
        most, own_unit = unit_for(largest(found, name), unit_of(name))
        axes.text(
            0.98,
            0.02,
            f"largest\n{most * largest(found, name):.3g} {own_unit}",
            transform=axes.transAxes,
            ha="right",
            va="bottom",
            size=6.8,
        )
    shown.notes.append(
        "Bars: the largest change over the sweep by 1 % of a number, of an angle by 1°; pin forces by their magnitude."
    )
