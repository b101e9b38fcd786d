"""Curves of what follows from a solution.

Shaking force and moment, ratios, and paths of instant centres are drawn.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from fourbar.show.derived import derive
from fourbar.show.plot.curves import (
    choose_limit,
    choose_scale,
    clip,
    draw_axes,
    find_poles,
    note,
    plot_between_poles,
)
from fourbar.show.plot.labels import Labels
from fourbar.show.plot.linkage_figure import (
    choose_drawing_scale,
    draw_mechanism,
    locate_pins,
)
from fourbar.show.plot.style import (
    BAR_COLOURS,
    INK,
    MUTED,
    POINT,
    choose_bar_line,
    draw_zero_line,
    join_points,
    place_legend,
    plot_points,
)
from fourbar.show.plot.view import View

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SYMBOLS = {
    "omega_3/omega_2": "ω₃/ω₂",
    "omega_4/omega_2": "ω₄/ω₂",
    "mechanical_advantage": "T₄/T₂",
}
_FORCE_LOOKS: dict[str, dict[str, Any]] = {
    "|F|": {"color": INK, "ls": "-"},
    "F_x": {"color": BAR_COLOURS[2], "ls": (0, (4, 1.5))},
    "F_y": {"color": BAR_COLOURS[4], "ls": (0, (1, 1))},
}
FARTHEST_CENTRE = 1.5
"""Instant centres are drawn up to this multiple of the linkage's size from it."""


def draw_shaking_force(axes: "Axes", view: View) -> None:
    """Draw the force on the frame: its size and its components."""
    over = draw_axes(axes, view)
    poles = find_poles(view)
    x, y = derive(view.sweep, "shaking_force").T
    curves = {"|F|": np.hypot(x, y), "F_x": x, "F_y": y}
    limit, factor, unit = choose_scale([curves["|F|"]], "N", view)
    for name, values in curves.items():
        look = {**_FORCE_LOOKS[name], "label": f"${name}$"}
        plot_between_poles(axes, over, factor * values, poles, **look)
    draw_zero_line(axes)
    axes.set(ylabel=f"$F$ ({unit})", title="Shaking force on the frame")
    clip(axes, view, curves, limit, "Shaking force", "N")
    place_legend(axes)


def draw_shaking_moment(axes: "Axes", view: View) -> None:
    """Draw the moment on the frame about O2."""
    over = draw_axes(axes, view)
    poles = find_poles(view)
    moment = derive(view.sweep, "shaking_moment")
    limit, factor, unit = choose_scale([moment], "N m", view)
    plot_between_poles(axes, over, factor * moment, poles, color=INK)
    draw_zero_line(axes)
    axes.set(ylabel=f"$M$ ({unit})", title="Shaking moment about $O_2$")
    clip(axes, view, {"M": moment}, limit, "Shaking moment", "N m")


def draw_speed_ratios(axes: "Axes", view: View) -> None:
    """Draw the ratios of the speeds of coupler and output to that of the input."""
    _draw_ratios(axes, view, {3: "omega_3/omega_2", 4: "omega_4/omega_2"})
    axes.set(ylabel="ratio", title="Speed ratios")
    place_legend(axes)


def draw_advantage(axes: "Axes", view: View) -> None:
    """Draw the mechanical advantage, the torque of the output to that of the input."""
    _draw_ratios(axes, view, {2: "mechanical_advantage"})
    axes.set(ylabel="T₄/T₂", title="Mechanical advantage")


def _draw_ratios(axes: "Axes", view: View, names: dict[int, str]) -> None:
    """Draw ratios by the bars whose colours they have.

    No line goes on beyond a pole.
    """
    over = draw_axes(axes, view)
    curves = {_SYMBOLS[name]: derive(view.sweep, name) for name in names.values()}
    limit = choose_limit([*curves.values()])
    for bar, (symbol, values) in zip(names, curves.items(), strict=True):
        before = values[:-1]
        after = values[1:]
        # a ratio changes its sign at a pole, where it is large, or at zero
        is_large = np.minimum(np.abs(before), np.abs(after)) > 1.0
        poles = np.flatnonzero((before * after < 0.0) & is_large)
        look = choose_bar_line(bar)
        plot_between_poles(axes, over, values, poles, label=symbol, **look)
    draw_zero_line(axes)
    clip(axes, view, curves, limit, "Ratio", "1")


def draw_centres(axes: "Axes", view: View, labels: Labels) -> None:
    """Draw the paths of the instant centres I13 and I24 near the linkage."""
    factor, unit, _ = choose_drawing_scale(view)
    middle = sum(locate_pins(view).values()) / 4.0
    reach = FARTHEST_CENTRE * max(view.scene.linkage.lengths)
    for name, colour, dashes in (("I13", POINT, "-"), ("I24", INK, (0, (4, 1.5)))):
        path, here = (
            join_points(derive(solution, name)) for solution in (view.sweep, view.here)
        )
        near = factor * np.where(np.abs(path - middle) <= reach, path, np.nan)
        label = f"$I_{{{name[1:]}}}$"
        plot_points(axes, near, color=colour, ls=dashes, lw=1.2, label=label)
        if np.abs(here - middle) <= reach:
            plot_points(axes, factor * here, "o", ms=4.5, color=colour, zorder=6)
    draw_mechanism(axes, view, view.here, 0, labels)
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(color=MUTED, alpha=0.2)
    title = f"Instant centres at {view.at}"
    axes.set(xlabel=f"$x$ ({unit})", ylabel=f"$y$ ({unit})", title=title)
    place_legend(axes)
    note(
        view,
        f"Centres further than {FARTHEST_CENTRE:g} longest bars away are left out.",
    )
