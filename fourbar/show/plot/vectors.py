"""Arrows of velocity and acceleration at A, B, the mass centres and the scene's own points."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from fourbar.show.plot.curves import limit_of
from fourbar.show.plot.style import largest
from fourbar.show.plot.view import View, point_vectors
from fourbar.solution import Solution

if TYPE_CHECKING:
    from matplotlib.axes import Axes

KINDS = {"v": ("#0B6E99", "velocity"), "a": ("#B3261E", "acceleration")}
LONGEST = 7.0
"""Of an arrow, in sizes of a support: the largest of the sweep, or where values diverge all that are as large."""


def vectors(axes: "Axes", view: View, solution: Solution, factor: float, size: float) -> Callable[[int], None]:
    """Draw the arrows of a solution's first position, each kind to one scale of the sweep.

    Returns the function that moves them to another position.
    """
    drawn = []
    for letter, (colour, label) in KINDS.items():
        sizes = [np.hypot(*values.T) for values in point_vectors(view.scene, view.sweep, letter).values()]
        if not (top := limit_of(sizes) or largest(*sizes)):
            continue
        found = point_vectors(view.scene, solution, letter)
        feet = [solution.points[name] if name in solution.points else getattr(solution, name) for name in found]
        shafts = [LONGEST * size * v / np.maximum(np.hypot(*v.T), top)[:, None] for v in found.values()]
        tips = np.concatenate([factor * foot + shaft for foot, shaft in zip(feet, shafts, strict=True)])
        axes.update_datalim(tips[np.isfinite(tips).all(axis=1)])
        look: dict[str, Any] = {
            "angles": "xy",
            "scale_units": "xy",
            "scale": 1.0,
            "width": 0.0045,
            "zorder": 7,
            "label": label,
        }
        start = np.zeros((2, len(found)))
        drawn.append((axes.quiver(*start, *start, color=colour, **look), feet, shafts))

    def move(index: int) -> None:
        for arrows, feet, shafts in drawn:
            arrows.set_offsets(factor * np.array([foot[index] for foot in feet]))
            arrows.set_UVC(*np.nan_to_num(np.array([shaft[index] for shaft in shafts])).T)

    move(0)
    return move
