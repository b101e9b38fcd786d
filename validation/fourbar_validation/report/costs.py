"""Accuracy against cost: what every scene of this run took, for what work, and how far its torque was off."""

import math
from collections.abc import Iterable
from statistics import median

from fourbar_validation.compare.tolerance import EPS
from fourbar_validation.engines.witnesses import WORK
from fourbar_validation.report.colours import INK, PAPER, SOFT, choose_style
from fourbar_validation.report.record import Record
from fourbar_validation.report.svg import FLOOR, set_frame, write_svg

Point = tuple[float, float]


def collect_cost_points(scenes: Iterable[Record]) -> tuple[dict[str, list[Point]], list[float]]:
    """Return (microseconds per position, error of the torque) of every scene by engine, and the formulas' cost."""
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


def draw_costs(scenes: Iterable[Record]) -> str | None:
    """Draw these points as SVG, with each engine's median; None where no torque was compared."""
    points, formulas = collect_cost_points(scenes)
    if not points or not formulas:
        return None
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 3.9), layout="constrained")
    axes = figure.add_subplot()
    axes.set_xscale("log")
    axes.set_yscale("log")
    for engine, found in sorted(points.items()):
        look = choose_style(engine)
        x, y = [cost for cost, _ in found], [max(error, FLOOR) for _, error in found]
        axes.plot(x, y, look.marker, ms=4.0, mfc=PAPER, mec=look.colour, mew=0.9, alpha=0.75)
        centre = (median(x), median(y))
        axes.plot(*centre, look.marker, ms=9.0, color=look.colour, label=_write_label(engine))
    axes.axvline(median(formulas), color=INK, lw=1.1, ls=(0, (5, 2)))
    axes.annotate(
        _write_label("formulas"), (median(formulas), 1.0), xycoords=("data", "axes fraction"), xytext=(4, -9),
        textcoords="offset points", fontsize=8, color=INK,
    )  # fmt: skip
    axes.axhline(EPS, color=SOFT, lw=0.8, ls=(0, (1, 2)))
    axes.annotate(
        "eps", (1.0, EPS), xycoords=("axes fraction", "data"), xytext=(-2, 3), textcoords="offset points",
        fontsize=8, ha="right", color=SOFT,
    )  # fmt: skip
    axes.set_xlabel("µs per position, for the work that the legend names")
    axes.set_ylabel("error of the torque / scale")
    set_frame(axes)
    figure.legend(loc="outside upper left", frameon=False, fontsize=8)
    return write_svg(figure, "costs")


def _write_label(engine: str) -> str:
    """Name an engine and what it did for a position."""
    return f"{engine}: {WORK[engine].short}" if engine in WORK else engine
