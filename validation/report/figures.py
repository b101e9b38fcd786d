"""The picture of one scene: the linkage, every engine over the formulas, and the differences on their own axes."""

import io
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from fourbar.scene import solve
from fourbar.solution import OK, Solution
from validation.answer import Answer
from validation.compare import angle_aware_difference
from validation.judge import Record
from validation.scales import divisor, magnitude, yardstick
from validation.tolerance import EQUIVALENCE, Array, condition_of

INK = "#777777"
"""Grey that reads on white and on black; the page lets text follow its own colour."""
STYLES = {
    "pinocchio-inverse": ("#0072b2", "o", (0, (4, 3))),
    "mujoco-inverse": ("#009e73", "s", (0, (1, 2))),
    "mujoco-simulated": ("#d55e00", "^", "solid"),
    "energy-method": ("#cc79a7", "x", (0, (6, 2, 1, 2))),
}
"""Colour-blind-safe colours; marker and line style tell them apart in grey."""
MARKS = 12
"""Markers per curve: enough to see that it lies on the band, few enough to see the band."""
FLOOR = 1e-18
"""Differences of exactly zero are drawn here."""


def scene_figure(record: Record) -> str | None:
    """An SVG of the scene's answers, or None where there is no sweep with forces to draw."""
    solution = record.solution
    if solution is None or solution.torque is None or np.count_nonzero(solution.status_code == OK) < 2:
        return None
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.5, 4.6), layout="constrained")
    FigureCanvasSVG(figure)
    grid = figure.add_gridspec(2, 3, width_ratios=(1.0, 1.5, 1.5), height_ratios=(1.5, 1.0))
    _draw_linkage(figure.add_subplot(grid[:, 0]), record, solution)
    answers = [answer for answer in record.answers if answer.refusal is None and answer.at is not None]
    for column, (quantity, label) in enumerate((("torque", f"T{solution.drive_bar} [N m]"), ("F32", "|F32| [N]")), 1):
        top = figure.add_subplot(grid[0, column])
        below = figure.add_subplot(grid[1, column], sharex=top)
        _draw_quantity(top, below, quantity, record, solution, answers)
        top.set_ylabel(label)
        top.tick_params(labelbottom=False)
        below.set_ylabel("|difference| / scale")
        below.set_xlabel("theta_2 [deg]")
    handles, labels = figure.axes[1].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), frameon=False, fontsize=8)
    return _svg(figure, record.name)


def _draw_quantity(
    top: Any, below: Any, quantity: str, record: Record, solution: Solution, answers: list[Answer]
) -> None:
    shown = solution.status_code == OK
    degrees = np.degrees(solution.theta_2)
    ours = getattr(solution, quantity)
    value: Callable[[Array], Array] = (lambda v: v) if quantity == "torque" else magnitude
    top.plot(
        degrees, np.where(shown, value(ours), np.nan), color="#bbbbbb", lw=6, solid_capstyle="butt", label="formulas"
    )
    allowed = EQUIVALENCE.allowed(condition_of(quantity, record.scene.linkage, solution))
    below.plot(degrees, np.where(shown, allowed, np.nan), color=INK, lw=1, ls="dashed")
    below.annotate("allowed to exact engines", (0.01, 0.9), xycoords="axes fraction", fontsize=7, color=INK)
    for answer in answers:
        if quantity not in answer.quantities or answer.at is None:
            continue
        formulas = solution if len(answer.at.theta_2) == 0 else solve(record.scene, at=answer.at)
        theirs = answer.quantities[quantity]
        colour, marker, line = STYLES.get(answer.engine, ("#56b4e9", "d", "solid"))
        x = np.degrees(answer.at.theta_2)
        top.plot(
            *(x, value(theirs)),
            **{"color": colour, "lw": 1.0, "ls": line, "marker": marker, "ms": 4},
            markevery=max(1, len(x) // MARKS),
            label=answer.engine,
        )
        mine = getattr(formulas, quantity)
        error = angle_aware_difference(quantity, mine, theirs) / divisor(
            yardstick(quantity, record.scene, formulas, mine)
        )
        below.plot(x, np.maximum(error, FLOOR), color=colour, lw=1.0, ls=line)
    below.set_yscale("log")
    _limit_to_bulk(top, value(ours)[shown])
    for axes in (top, below):
        axes.grid(color=INK, alpha=0.25, lw=0.5)
        axes.tick_params(labelsize=7)


def _limit_to_bulk(axes: Any, values: Array) -> None:
    """Near a pole the curve leaves the picture; the axis follows the other 96 % of the positions."""
    low, high = np.nanpercentile(values, [2.0, 98.0])
    span = high - low
    if span > 0.0 and (np.nanmax(values) > high + 3 * span or np.nanmin(values) < low - 3 * span):
        axes.set_ylim(low - 0.5 * span, high + 0.5 * span)


def _draw_linkage(axes: Any, record: Record, solution: Solution) -> None:
    index = int(np.argmax(np.where(solution.status_code == OK, solution.condition, -1.0)))
    d, theta_1 = record.scene.linkage.ground, record.scene.linkage.ground_angle
    O2, O4 = np.zeros(2), d * np.array([math.cos(theta_1), math.sin(theta_1)])
    A, B = solution.A[index], solution.B[index]
    for start, end, colour in ((O2, A, "#0072b2"), (A, B, "#e69f00"), (O4, B, "#009e73")):
        axes.plot(*np.transpose([start, end]), color=colour, lw=4, solid_capstyle="round")
    axes.plot(*np.transpose([O2, O4]), color=INK, lw=1, ls="dotted")
    for name, point, ground in (("O2", O2, True), ("A", A, False), ("B", B, False), ("O4", O4, True)):
        axes.plot(*point, marker="^" if ground else "o", ms=7, color=INK, mec="white")
        axes.annotate(name, point, xytext=(5, 6), textcoords="offset points", fontsize=8)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.2)
    axes.tick_params(labelsize=7)
    axes.set_xlabel("x [m]")
    axes.set_title(f"theta_2 = {math.degrees(solution.theta_2[index]):.1f} deg", fontsize=8)


def _svg(figure: Any, salt: str) -> str:
    """The figure as inline SVG without a date, with ids of its own, text in the page's colour."""
    import matplotlib

    text = io.StringIO()
    with matplotlib.rc_context(
        {"svg.fonttype": "none", "svg.hashsalt": salt, "font.size": 8, "font.family": "sans-serif"}
    ):
        figure.savefig(text, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    svg = text.getvalue()
    return svg[svg.index("<svg") :].replace("#000000", "currentColor")
