"""Pictures of the study: work and precision, each quantity over the timestep with its jumps, and the three sources."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from fourbar.show.plot.labels import Label, Labels
from fourbar.show.plot.style import Drawing, apply_style
from fourbar_validation.advise.worst_errors import QUANTITIES
from fourbar_validation.cost.laws import TOO_LARGE, find_jumps, find_pareto
from fourbar_validation.cost.study import EXACT, FORMULAS, STEPPED, CostPoint

Look = tuple[str, str, str, Any]
"""Curve, colour for all kinds of colour vision, marker and line that tell it apart in grey."""
CURVES: dict[str, Look] = {
    "Euler": ("Euler, tc held", "#d55e00", "s", (0, (4, 2))),
    "implicitfast": ("implicitfast, tc held", "#cc79a7", "v", (0, (1, 1.5))),
    "discrete": ("discrete, tc held", "#e69f00", "D", (0, (6, 2, 1, 2))),
    "RK4": ("RK4, tc held", "#0072b2", "o", "solid"),
}
SHOWN: dict[str, Look] = {
    "Euler, MuJoCo's defaults": (
        "Euler, MuJoCo's defaults",
        "#d55e00",
        "s",
        (0, (4, 2)),
    ),
    "RK4, MuJoCo's defaults": ("RK4, MuJoCo's defaults", "#e69f00", "D", (0, (1, 1.5))),
    "Euler, stiff closure": ("Euler, tc held", "#cc79a7", "v", (0, (6, 2, 1, 2))),
    "RK4, d = 0.9999, tc = 10 h": (
        "RK4, no pads, tc = 10 h",
        "#56b4e9",
        "P",
        (0, (5, 1)),
    ),
    "MuJoCo, recommended": ("recommended", "#0072b2", "o", "solid"),
}
SOFTNESS: dict[str, Look] = {
    "at the scene's speed": ("softness d", "#0072b2", "o", "solid"),
    "at 0.1 rad/s, sag under gravity and loads": (
        "sag d, slow",
        "#d55e00",
        "s",
        (0, (4, 2)),
    ),
    "at 0.1 rad/s, nothing acts": (
        "sag d, slow, nothing acts",
        "#009e73",
        "^",
        (0, (1, 1.5)),
    ),
}
SOLVERS: dict[str, Look] = {
    "Newton": ("tolerance, Newton", "#0072b2", "o", "solid"),
    "PGS": ("tolerance, PGS", "#d55e00", "s", (0, (4, 2))),
    "CG": ("tolerance, CG", "#009e73", "^", (0, (1, 1.5))),
}
"""Look of each solver, by name: its legend, colour, marker and line."""
DEFAULT = "MuJoCo's defaults"
"""Label of the point that a new user gets."""
LARGEST = 10.0
"""A larger error over the timestep, and one without end, is drawn here: at the upper edge."""
LOWEST = 1e-17
"""Bottom of the picture; fifty digits lie far below and are named at the edge."""
NONE = 1e-18
"""Place on the logarithmic axis at which a tolerance of 0 is drawn."""
NAMES = {"torque": "driving torque", "force": "worst pin force"}
INK = "#333333"
PALE = "#d9d9d9"


def draw(
    curves: Mapping[str, Sequence[CostPoint]], title: str, folder: Path
) -> list[Path]:
    """Draw all pictures of a scene as SVG and PNG; the files written."""
    written = []
    with apply_style():
        made = {
            f"work-precision-{quantity}": _draw_work_precision(curves, quantity, title)
            for quantity in NAMES
        }
        if any(name in curves for name, *_ in CURVES.values()):
            made["orders"] = draw_orders(curves, title)
        if "tolerance, Newton" in curves:
            made["sources"] = _draw_sources(curves, title)
        for name, figure in made.items():
            for kind in ("svg", "png"):
                written.append(folder / f"{name}.{kind}")
                Drawing(figure).save(written[-1])
    return written


def draw_line(
    axes: Any,
    x: Sequence[float],
    y: Sequence[float],
    label: str,
    look: Look,
    **style: Any,
) -> None:
    """Draw a curve in its colour, with its marker and line."""
    _, colour, marker, line = look
    common = {"color": colour, "ls": line, "marker": marker, "mec": "white", "mew": 0.5}
    axes.plot(x, y, label=label, **(common | style))


def write_heading(
    figure: Any, statement: str, title: str, upper: float, lower: float
) -> Any:
    """Write what a picture means above it, and what was run."""
    figure.text(0.02, upper, statement, fontsize=12.5, weight="bold", va="center")
    figure.text(0.02, lower, title, fontsize=9.5, color="#666666", va="center")
    return figure


def _draw_work_precision(
    curves: Mapping[str, Sequence[CostPoint]], quantity: str, title: str
) -> Any:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.6, 6.4))
    axes, labels = figure.add_axes((0.085, 0.1, 0.885, 0.735)), Labels()
    points = [
        point for name, row in curves.items() for point in row if "slow" not in name
    ]
    front = find_pareto([p for p in points if p.kind == STEPPED], quantity)
    broad: dict[str, Any] = {
        "lw": 9.0,
        "solid_capstyle": "round",
        "solid_joinstyle": "round",
        "zorder": 1,
    }
    axes.plot(
        *_compute_places(front, quantity),
        **broad,
        color=PALE,
        label="Pareto front of everything stepped",
    )
    labels.keep_off(axes, *zip(*_compute_places(front, quantity), strict=True))
    for label, look in SHOWN.items():
        row = [
            p for p in curves.get(look[0], ()) if math.isfinite(getattr(p, quantity))
        ]
        if row:
            # a cross has no face: with a white edge it would vanish
            style: dict[str, Any] = (
                {"mec": look[1], "mew": 1.4} if look[2] == "x" else {"mew": 0.6}
            )
            style["zorder"] = 3 if look[0] == "recommended" else 2
            draw_line(
                axes,
                *_compute_places(row, quantity),
                label,
                look,
                ms=5.5,
                lw=1.8,
                **style,
            )
            labels.keep_off(
                axes, *zip(*_compute_places(row, quantity), strict=True), width=1.8
            )
    for point in points:  # the point that a new user gets
        if point.setting == DEFAULT and math.isfinite(
            error := getattr(point, quantity)
        ):
            axes.plot(
                *_compute_places([point], quantity),
                marker="*",
                ms=19,
                color="#d55e00",
                mec="black",
                mew=0.9,
                zorder=5,
            )
            text = f"MuJoCo's defaults (Euler, 2 ms): {write_short(error)}"
            _name(labels, axes, point, quantity, text, INK, 10.0)
    _mark_exact(labels, axes, points, quantity)
    for point in curves.get("recommended", ())[::2]:
        text = f"{point.steps_per_revolution:.0f} steps, tc = {point.setting.partition('tc = ')[2]}"
        _name(labels, axes, point, quantity, text, "#0072b2")
    if front and front[-1].curve != "recommended":
        text = front[-1].setting.replace("tc held", "tc a quarter turn")
        _name(labels, axes, front[-1], quantity, text, "#666666")
    axes.set(xscale="log", yscale="log", xlabel="CPU time per revolution [ms]")
    axes.set_ylabel(f"error of the {NAMES[quantity]}, relative to its scale")
    axes.set_ylim(LOWEST / 4.0, 3.0)
    low, high = axes.get_xlim()
    axes.set_xlim(low / 1.3, high * 1.6)
    axes.grid(visible=True, which="major")
    axes.tick_params(labelsize=10)
    axes.xaxis.label.set_fontsize(11)
    axes.yaxis.label.set_fontsize(11)
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, fontsize=8.5)
    labels.settle(figure)
    return write_heading(figure, write_statement(curves, quantity), title, 0.965, 0.928)


def _compute_places(
    points: Sequence[CostPoint], quantity: str
) -> tuple[list[float], list[float]]:
    """Compute ms per revolution, and errors; what lies below the picture at its edge."""
    errors = [max(getattr(point, quantity), LOWEST) for point in points]
    return [1e3 * point.seconds_per_revolution for point in points], errors


def _name(
    labels: Labels,
    axes: Any,
    point: CostPoint,
    quantity: str,
    text: str,
    colour: str = INK,
    size: float = 8.5,
) -> None:
    """Write next to a point, where it covers nothing."""
    (x,), (y,) = _compute_places([point], quantity)
    labels.keep_off(axes, (x, y), (x, y))
    labels.add(
        Label(axes, text, (x, y), (0.5 * x, y), colour, size)
    )  # to the right where that is free


def _mark_exact(
    labels: Labels, axes: Any, points: Sequence[CostPoint], quantity: str
) -> None:
    """Mark the methods that answer each position by itself."""
    marks = {EXACT: ("h", "#009e73"), FORMULAS: ("*", "black")}
    for point in points:
        if point.kind == STEPPED or (
            point.curve == "one state" and point.setting_value > 0.0
        ):
            continue
        (marker, colour), value = marks[point.kind], getattr(point, quantity)
        axes.plot(
            *_compute_places([point], quantity),
            marker=marker,
            ms=9,
            color=colour,
            mec="white",
            mew=0.6,
            zorder=4,
        )
        name = (
            point.setting
            if value >= LOWEST
            else f"{point.setting}: {write_short(value)}, far below"
        )
        _name(labels, axes, point, quantity, name)


def write_short(value: float) -> str:
    """Format one digit and its power of ten."""
    mantissa, _, exponent = f"{value:.0e}".partition("e")
    return f"{mantissa}e{int(exponent)}"


def write_statement(curves: Mapping[str, Sequence[CostPoint]], quantity: str) -> str:
    """Say what the picture means."""
    four = [p for p in curves.get("recommended", ()) if getattr(p, quantity) <= 1e-4]
    default = [p for row in curves.values() for p in row if p.setting == DEFAULT]
    parts = []
    if four:
        cheap = min(four, key=lambda p: p.seconds_per_revolution)
        parts.append(
            f"Four digits of {NAMES[quantity].removeprefix('driving ').removeprefix('worst ')} cost "
            f"{1e3 * cheap.seconds_per_revolution:.2g} ms a revolution"
        )
    if default and math.isfinite(error := getattr(default[0], quantity)):
        parts.append(
            f"the defaults pay {1e3 * default[0].seconds_per_revolution:.2g} ms for an error of {write_short(error)}"
        )
    return "; ".join(parts) or f"Error of the {NAMES[quantity]} against its cost"


def draw_over_timestep(
    axes: Any, curves: Mapping[str, Sequence[CostPoint]], quantity: str
) -> None:
    """Draw one quantity's error over the timestep, by integrator."""
    for label, look in CURVES.items():
        row = sorted(curves.get(look[0], ()), key=lambda point: point.setting_value)
        errors = {
            point.setting_value: min(getattr(point, quantity), LARGEST) for point in row
        }
        draw_line(
            axes,
            [1.0 / n for n in errors],
            list(errors.values()),
            label,
            look,
            ms=4,
            lw=1.6,
        )
        leaps = [point.setting_value for point in find_jumps(row, quantity)]
        ring = {
            "ls": "none",
            "marker": "o",
            "ms": 12,
            "mfc": "none",
            "mec": "black",
            "mew": 1.4,
        }
        axes.plot(
            [1.0 / n for n in leaps],
            [errors[n] for n in leaps],
            gid=f"jump-{quantity}",
            **ring,
        )


def draw_orders(curves: Mapping[str, Sequence[CostPoint]], title: str) -> Any:
    """Draw panels of all quantities on the same axes."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.5, 4.6))
    panels = figure.subplots(1, len(QUANTITIES), sharex=True, sharey=True)
    figure.subplots_adjust(left=0.06, right=0.99, bottom=0.13, top=0.72, wspace=0.08)
    for axes, quantity in zip(panels, QUANTITIES, strict=True):
        draw_over_timestep(axes, curves, quantity)
        axes.set(
            xscale="log",
            yscale="log",
            xlabel="time step, part of a revolution",
            ylim=(1e-12, 2.0 * LARGEST),
        )
        axes.set_title(
            NAMES.get(quantity, f"pin force {quantity}"),
            loc="left",
            fontsize=11,
            weight="bold",
        )
        axes.grid(visible=True)
        axes.tick_params(labelsize=9)
    panels[0].set_ylabel("error, relative to its scale")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="upper left",
        bbox_to_anchor=(0.012, 0.875),
        fontsize=9,
        ncols=len(CURVES),
    )
    return write_heading(figure, state_jumps(curves), title, 0.955, 0.905)


def state_jumps(curves: Mapping[str, Sequence[CostPoint]]) -> str:
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
        lost = dict.fromkeys(
            quantity for quantities in never.values() for quantity in quantities
        )
        return f"No time step brings {', '.join(lost)} below {TOO_LARGE:g} with {', '.join(never)}"
    return "Torque and each pin force over the time step: no error jumps towards finer steps"


def _draw_sources(curves: Mapping[str, Sequence[CostPoint]], title: str) -> Any:
    """Draw time step, softness and solver tolerance, each with the other two too fine to matter."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.5, 5.6))
    left_edge, right, both = 0.075, 0.985, 0.3
    panels = [
        figure.add_axes(
            (
                left_edge + i * (right - left_edge + 0.012) / 3.0,
                0.105,
                both - 0.008,
                0.6,
            )
        )
        for i in range(3)
    ]
    for axes, heading, label, rows in (
        (panels[0], "Time step", "time step, part of a revolution", CURVES),
        (panels[1], "Softness of the closure", "1 - d", SOFTNESS),
        (panels[2], "Solver", "tolerance", SOLVERS),
    ):
        for name, look in rows.items():
            row = [
                p
                for p in curves.get(look[0], ())
                if math.isfinite(p.worst) and p.worst < 10.0
            ]
            x = [
                1.0 / p.setting_value if axes is panels[0] else p.setting_value or NONE
                for p in row
            ]
            draw_line(axes, x, [p.worst for p in row], name, look, ms=5, lw=1.8)
        axes.set(xscale="log", yscale="log", ylim=(1e-12, 20.0), xlabel=label)
        axes.set_title(heading, loc="left", fontsize=11, weight="bold", pad=44.0)
        axes.legend(
            loc="lower left",
            bbox_to_anchor=(0.0, 1.0),
            fontsize=8.5,
            ncols=2 if axes is panels[0] else 1,
        )
        axes.grid(visible=True)
        axes.tick_params(labelsize=9)
        if axes is not panels[0]:
            axes.tick_params(labelleft=False)
    panels[2].set_xticks(
        [NONE, 1e-15, 1e-12, 1e-9, 1e-6], ["0", "1e-15", "1e-12", "1e-9", "1e-6"]
    )
    _draw_slope(panels[0], 1.0, 4e-3, 3e-3, "1")
    _draw_slope(panels[0], 4.0, 8e-3, 1e-8, "4")
    _draw_slope(panels[1], 1.0, 2e-3, 2e-5, "1")
    panels[0].set_ylabel("worst error of torque and pin forces")
    sentence = "Three sources, one at a time: time step by its order, softness in proportion, the solver unless at 0"
    return write_heading(figure, sentence, title, 0.955, 0.912)


def _draw_slope(axes: Any, exponent: float, x: float, y: float, name: str) -> None:
    """Draw a slope with its exponent next to it."""
    axes.plot([x, 4.0 * x], [y, y * 4.0**exponent], color=INK, lw=1.0)
    axes.annotate(
        f"slope {name}",
        (2.0 * x, y * 2.0**exponent),
        xytext=(6, -8),
        textcoords="offset points",
        fontsize=8.5,
    )
