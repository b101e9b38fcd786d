"""Writes docs/wiper-torque.svg with the program of the guide. `python docs/wiper.py`

The program is the one of docs/guide-roboticist.md that minimizes the peak torque.
"""

import os
import re
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

import fourbar
from fourbar.show.plot.curves import mark_peak
from fourbar.show.plot.labels import settle_labels
from fourbar.show.plot.style import (
    BAR_COLOURS,
    BAR_DASHES,
    INK,
    Drawing,
    apply_style,
    place_legend,
    set_degree_ticks,
)

DOCS = Path(__file__).parent
PROGRAM = re.compile(r"```python\n([^`]*minimize[^`]*)```")


def minimize() -> dict[str, Any]:
    """Run the program of the guide, and return its names."""
    (program,) = PROGRAM.findall(
        (DOCS / "guide-roboticist.md").read_text(encoding="utf-8")
    )
    names: dict[str, Any] = {}
    os.chdir(DOCS.parent)  # the program reads a file of models/
    exec(program, names)
    return names


def draw(path: Path) -> None:
    """Draw the torque over a turn with the first lengths and with the best ones."""
    names = minimize()
    curves = {"before": names["scene"], "after": names["resized"](names["best"].x)}
    with apply_style():
        figure = Figure(figsize=(7.7, 3.4), layout="constrained")
        axes = figure.add_subplot()
        degrees = np.degrees(names["turn"])
        axes.set_xlim(degrees[0], degrees[-1])
        axes.axhline(0.0, color=INK, lw=0.6, zorder=1)
        for bar, (name, scene) in zip((2, 3), curves.items(), strict=True):
            torque = fourbar.solve(scene).torque
            look = {"color": BAR_COLOURS[bar], "ls": BAR_DASHES[bar]}
            axes.plot(degrees, torque, label=name, **look)
            peak = torque[np.abs(torque).argmax()]
            mark_peak(axes, degrees, torque, f"{peak:.3g} N m")
        set_degree_ticks(axes.xaxis)
        axes.set(
            xlabel=r"$\theta_2$ (°)",
            ylabel="$T_2$ (N m)",
            title="Torque of the wiper's motor",
        )
        place_legend(axes)
        settle_labels(figure)
        Drawing(figure).save(path)


if __name__ == "__main__":
    draw(DOCS / "wiper-torque.svg")
