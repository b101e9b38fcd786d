"""The picture of `bench`: what one position and one linkage cost, by how many there are."""

from pathlib import Path
from typing import TYPE_CHECKING

from fourbar.show.plot.style import apply_style, format_of, save
from fourbar_validation.report.machine import name_machine

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LOOKS = (("#0072B2", "o"), ("#D55E00", "s"), ("#1a1a1a", "^"), ("#007A5A", "v"), ("#8A3B78", "D"))
"""Colours and marks in the order of the contenders."""


Times = dict[str, dict[int, float]]
"""ns for each, by who and by how many."""


def draw_bench(over_positions: Times, over_linkages: Times, path: Path) -> None:
    """Draw both growths on logarithmic axes into a file."""
    kind = format_of(path)
    with apply_style():
        from matplotlib.figure import Figure

        figure = Figure(figsize=(8.4, 4.0), layout="constrained")
        left, right = figure.subplots(1, 2)
        _draw_panel(left, over_positions, "ns per position, every unknown", "positions")
        _draw_panel(right, over_linkages, "ns per linkage, every force at one position", "linkages")
        figure.supxlabel(f"One core: {name_machine()}", size=6.8, x=0.012, ha="left", parse_math=False)
        save(figure, path, kind)


def _draw_panel(axes: "Axes", times: Times, title: str, over: str) -> None:
    for (who, own), (colour, mark) in zip(times.items(), LOOKS, strict=False):
        axes.loglog(list(own), list(own.values()), color=colour, marker=mark, ms=3.5, lw=1.1, label=who)
    axes.set_title(title)
    axes.set_xlabel(over)
    axes.set_ylabel("ns")
    axes.legend(loc="upper left", bbox_to_anchor=(0.0, -0.2), ncols=2)
