"""Picture of the study: torque and each pin force over the timestep, side by side, with jumps ringed."""

from collections.abc import Mapping, Sequence
from typing import Any

from fourbar_validation.advise.worst_errors import QUANTITIES
from fourbar_validation.lab.cost.laws import TOO_LARGE, find_jumps
from fourbar_validation.lab.cost.study import CostPoint

Look = tuple[str, str, str, Any]
"""Curve, colour for all kinds of colour vision, marker and line that tell it apart in grey."""
CURVES: dict[str, Look] = {
    "Euler": ("Euler, tc held", "#d55e00", "s", (0, (4, 2))),
    "implicitfast": ("implicitfast, tc held", "#cc79a7", "v", (0, (1, 1.5))),
    "discrete": ("discrete, tc held", "#e69f00", "D", (0, (6, 2, 1, 2))),
    "RK4": ("RK4, tc held", "#0072b2", "o", "solid"),
}
"""By name in the legend."""
LARGEST = 10.0
"""A larger error, and one without end, is drawn here: at the upper edge."""
NAMES = {"torque": "driving torque"}


def draw_line(axes: Any, x: Sequence[float], y: Sequence[float], label: str, look: Look, **style: Any) -> None:
    """Draw a curve in its colour, with its marker and line."""
    _, colour, marker, line = look
    common = {"color": colour, "ls": line, "marker": marker, "mec": "white", "mew": 0.5}
    axes.plot(x, y, label=label, **(common | style))


def write_heading(figure: Any, statement: str, title: str, upper: float, lower: float) -> Any:
    """Write what a picture means above it, and what was run."""
    figure.text(0.02, upper, statement, fontsize=12.5, weight="bold", va="center")
    figure.text(0.02, lower, title, fontsize=9.5, color="#666666", va="center")
    return figure


def draw_over_timestep(axes: Any, curves: Mapping[str, Sequence[CostPoint]], quantity: str) -> None:
    """Draw one quantity's error over the timestep, by integrator."""
    for label, look in CURVES.items():
        row = sorted(curves.get(look[0], ()), key=lambda point: point.setting_value)
        errors = {point.setting_value: min(getattr(point, quantity), LARGEST) for point in row}
        draw_line(axes, [1.0 / n for n in errors], list(errors.values()), label, look, ms=4, lw=1.6)
        leaps = [point.setting_value for point in find_jumps(row, quantity)]
        ring = {"ls": "none", "marker": "o", "ms": 12, "mfc": "none", "mec": "black", "mew": 1.4}
        axes.plot([1.0 / n for n in leaps], [errors[n] for n in leaps], gid=f"jump-{quantity}", **ring)


def draw_picture(curves: Mapping[str, Sequence[CostPoint]], title: str) -> Any:
    """Draw panels of all quantities on the same axes."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.5, 4.6))
    panels = figure.subplots(1, len(QUANTITIES), sharex=True, sharey=True)
    figure.subplots_adjust(left=0.06, right=0.99, bottom=0.13, top=0.72, wspace=0.08)
    for axes, quantity in zip(panels, QUANTITIES, strict=True):
        draw_over_timestep(axes, curves, quantity)
        axes.set(xscale="log", yscale="log", xlabel="time step, part of a revolution", ylim=(1e-12, 2.0 * LARGEST))
        axes.set_title(NAMES.get(quantity, f"pin force {quantity}"), loc="left", fontsize=11, weight="bold")
        axes.grid(visible=True)
        axes.tick_params(labelsize=9)
    panels[0].set_ylabel("error, relative to its scale")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper left", bbox_to_anchor=(0.012, 0.875), fontsize=9, ncols=len(CURVES))
    return write_heading(figure, write_statement(curves), title, 0.955, 0.905)


def write_statement(curves: Mapping[str, Sequence[CostPoint]]) -> str:
    """Say what the picture means."""
    leaping: dict[str, None] = {}
    never: dict[str, list[str]] = {}
    for label, (name, *_) in CURVES.items():
        row = sorted(curves.get(name, ()), key=lambda point: point.setting_value)
        for quantity in QUANTITIES:
            if find_jumps(row, quantity):
                leaping[quantity] = None
            if row and not any(getattr(point, quantity) < TOO_LARGE for point in row):
                never.setdefault(label, []).append(quantity)
    if leaping:
        return f"Not every quantity falls by its order: {', '.join(leaping)} jumps where it is ringed"
    if never:
        lost = dict.fromkeys(quantity for quantities in never.values() for quantity in quantities)
        return f"No time step brings {', '.join(lost)} below {TOO_LARGE:g} with {', '.join(never)}"
    return "Torque and each pin force over the time step: no error jumps towards finer steps"
