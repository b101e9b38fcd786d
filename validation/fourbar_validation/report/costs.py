"""Accuracy against cost: what every scene of this run took, for what work, and how far its torque was off."""

import math
from collections.abc import Iterable
from statistics import median

from fourbar_validation.compare.tolerance import EPS
from fourbar_validation.engines.witnesses import WORK
from fourbar_validation.report.colours import GRID, INK, PAPER, SOFT, style_of
from fourbar_validation.report.record import Record
from fourbar_validation.report.svg import svg_text

FLOOR = EPS / 4.0
"""Errors below this, zero among them, are drawn here."""
Point = tuple[float, float]


def cost_points(scenes: Iterable[Record]) -> tuple[dict[str, list[Point]], list[float]]:
    """(microseconds per position, error of the torque) of every scene by engine; the same cost of the formulas."""
    points: dict[str, list[Point]] = {}
    formulas: list[float] = []
    for scene in scenes:
        errors = {row.engine: row.error for row in scene.rows if row.quantity == "torque" and math.isfinite(row.error)}
        for timing in scene.timings:
            cost = 1e6 * timing.seconds / max(1, timing.positions)
            if timing.engine == "formulas":
                formulas.append(cost)
            elif timing.engine in errors:
                points.setdefault(timing.engine, []).append((cost, errors[timing.engine]))
    return points, formulas


def cost_figure(scenes: Iterable[Record]) -> str | None:
    """An SVG of these points with each engine's median; None where no torque was compared."""
    points, formulas = cost_points(scenes)
    if not points or not formulas:
        return None
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 3.9), layout="constrained")
    axes = figure.add_subplot()
    axes.set_xscale("log")
    axes.set_yscale("log")
    for engine, found in sorted(points.items()):
        look = style_of(engine)
        x, y = [cost for cost, _ in found], [max(error, FLOOR) for _, error in found]
        axes.plot(x, y, look.marker, ms=4.0, mfc=PAPER, mec=look.colour, mew=0.9, alpha=0.75)
        centre = (median(x), median(y))
        axes.plot(*centre, look.marker, ms=9.0, color=look.colour, label=_labelled(engine))
    axes.axvline(median(formulas), color=INK, lw=1.1, ls=(0, (5, 2)))
    axes.annotate(
        _labelled("formulas"), (median(formulas), 1.0), xycoords=("data", "axes fraction"), xytext=(4, -9),
        textcoords="offset points", fontsize=8, color=INK,
    )  # fmt: skip
    axes.axhline(EPS, color=SOFT, lw=0.8, ls=(0, (1, 2)))
    axes.annotate(
        "eps", (1.0, EPS), xycoords=("axes fraction", "data"), xytext=(-2, 3), textcoords="offset points",
        fontsize=8, ha="right", color=SOFT,
    )  # fmt: skip
    axes.set_xlabel("µs per position, for the work that the legend names")
    axes.set_ylabel("error of the torque / scale")
    axes.grid(color=GRID, lw=0.5)
    axes.tick_params(which="both", labelsize=8, color=GRID)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(GRID)
    figure.legend(loc="outside upper left", frameon=False, fontsize=8)
    return svg_text(figure, "costs")


def _labelled(engine: str) -> str:
    """An engine and what it did for a position."""
    return f"{engine}: {WORK[engine].short}" if engine in WORK else engine
