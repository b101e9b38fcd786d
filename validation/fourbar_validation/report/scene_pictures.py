"""The pictures of one scene.

Drawn are the linkage, every engine's answer over the formulas, and the errors beneath.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fourbar.quantities import ANGLES, FORCE_NAMES, LINE, OK, PIN_FORCES, Array
from fourbar.scene import Command, Scene
from fourbar.show.plot.labels import add_label, settle_labels
from fourbar.show.plot.linkage_figure import draw_linkage
from fourbar.show.plot.style import apply_style
from fourbar.show.plot.view import View
from fourbar.solution import Solution
from fourbar.solving import solve
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.scales import scale_of
from fourbar_validation.compare.tolerance import (
    EQUIVALENCE,
    find_condition,
    find_error,
    magnitude,
)
from fourbar_validation.engines.description import name_driving
from fourbar_validation.report.scene_record import Record
from fourbar_validation.report.svg import (
    ALLOWED,
    BAND,
    INK,
    LEAST_DRAWN_ERROR,
    PAPER,
    choose_style,
    set_frame,
    write_svg,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MARKS_OF_A_CURVE = 10
"""Marks of one engine on a curve. Every engine has its own positions, so no mark hides
another.
"""
STRETCHES = 24
"""Stretches of a sweep; the error shown in each is its largest."""
_PLOT_COLOURS = {
    "#1a1a1a": "--ink",
    "#6b6b6b": "--soft",
    "#d9d9d9": "--grid",
    "#e4e4e4": "--grid",
    "#ffffff": "--paper",
    "#007a5a": "--e2",
    "#d55e00": "--e3",
    "#8a3b78": "--e4",
}
"""Colours of `fourbar plot`, and the page's own that take their place."""
_SUBSCRIPT = str.maketrans("234", "₂₃₄")


def draw_scene_figure(
    record: Record, scene: Scene, solution: Solution, answers: Sequence[Answer]
) -> str | None:
    """Return the linkage and, for a sweep, the answers as SVGs.

    The text is None if nothing assembles. The record is told whose answers are drawn.
    """
    if not np.any(solution.status_code == OK):
        return None
    drawn = _draw_best_position(record.name, scene, solution)
    if np.count_nonzero(solution.status_code == OK) < 2:
        return drawn
    shown = ANGLES
    if scene.motion.free is not None:
        shown = ("theta_4", "F32")  # the torque is mere rounding
    elif solution.F32 is not None:
        shown = (name_driving(scene), _choose_force(record, solution))
    curves = [_Curve(name, record, scene, solution, answers) for name in shown]
    record.drawn = sorted({one.engine for curve in curves for one in curve.answers})
    return drawn + "".join(curve.draw() for curve in curves)


def _draw_best_position(name: str, scene: Scene, solution: Solution) -> str:
    """Draw the linkage as `fourbar plot` does, at its best conditioned position."""
    from matplotlib.figure import Figure

    conditions = np.where(solution.status_code == OK, solution.condition, -1.0)
    best = int(np.argmax(conditions))
    with apply_style():
        figure = Figure(figsize=(3.1, 2.9), layout="constrained")
        here = solve(scene, "position", at=solution.at.part(slice(best, best + 1)))
        axes = figure.subplots()
        draw_linkage(axes, View(scene, solution, here))
        legend = axes.get_legend()
        if legend is not None:  # it is wider than this drawing
            legend.remove()
        axes.set_title(axes.get_title(loc="left"), pad=6.0)
        settle_labels(figure)
        svg = write_svg(figure, f"{name} linkage")
    for light, variable in _PLOT_COLOURS.items():
        svg = svg.replace(light, f"var({variable})")
    return svg.replace("<svg", '<svg class="linkage"', 1)


def _choose_force(record: Record, solution: Solution) -> str:
    """Return the name of the pin force to draw.

    Drawn is the one that fails most, or else the largest at positions that have a
    value.
    """
    failing = [row for row in record.rows if row.failed and row.quantity in PIN_FORCES]
    if failing:
        return max(failing, key=lambda row: row.used).quantity
    good = solution.status_code == OK
    return max(
        PIN_FORCES,
        key=lambda name: float(np.nanmax(magnitude(getattr(solution, name))[good])),
    )


@dataclass
class _Curve:
    """The picture of one quantity of a scene: its values, and their errors beneath.

    Of a force the larger component is drawn: one of the wrong sign lies on the curve of
    magnitudes.
    """

    quantity: str
    record: Record
    scene: Scene
    solution: Solution
    answers: Sequence[Answer]

    def __post_init__(self) -> None:
        self.good = self.solution.status_code == OK
        self.answers = [
            answer
            for answer in self.answers
            if answer.refusal is None and self.quantity in answer.quantities
        ]

    def draw(self) -> str:
        """Draw it as an SVG."""
        from matplotlib.figure import Figure

        figure = Figure(figsize=(4.3, 4.0), layout="constrained")
        axes = figure.subplots(2, sharex=True)
        self.draw_values(axes[0])
        self.draw_errors(axes[1])
        unit = "error / scale" if self.quantity in FORCE_NAMES else "error (rad)"
        axes[1].set_ylabel(unit, fontsize=8.5)
        angle = f"θ{self.solution.at.bar} (°)".translate(_SUBSCRIPT)
        axes[1].set_xlabel("time (s)" if self.solution.time is not None else angle)
        figure.align_ylabels(axes)
        for panel in axes:
            set_frame(panel)
        settle_labels(figure)
        return write_svg(figure, f"{self.record.name} {self.quantity}")

    def choose_base(self, command: Command | None) -> Array:
        """Return what is drawn over: the commanded angle in degrees, or the time.

        The time takes its place where the motion is free or follows a law.
        """
        angle = (command or self.solution.at).angle
        time = self.solution.time
        if time is not None and len(time) == len(angle):
            return time
        return np.degrees(angle)

    def draw_values(self, axes: "Axes") -> None:
        """Draw the formulas as a band, and each engine's marks on it.

        The marks stand at positions of their own. Where the formulas have no value, as
        at a change point, nothing is judged, and a mark would look like an error. Near
        a pole the curve leaves the picture, which ends beyond 96 % of the positions.
        """
        quantity = self.quantity
        values = getattr(self.solution, quantity)
        axis = None
        if values.ndim == 2:
            axis = int(np.nanmax(np.abs(values[self.good]), axis=0).argmax())

        def take(values: Array) -> Array:
            if quantity in ANGLES:
                return np.degrees(values)
            return values if axis is None else values[:, axis]

        ours = np.where(self.good, take(values), np.nan)
        base = self.choose_base(None)
        axes.plot(base, ours, color=BAND, lw=5.0, solid_capstyle="butt")
        for turn, answer in enumerate(self.answers):
            theirs = take(answer.quantities[quantity])
            if len(theirs) == len(ours):  # a simulation makes positions of its own
                theirs = np.where(self.good, theirs, np.nan)
            phase = (turn + 0.5) / len(self.answers)
            parts = (np.arange(MARKS_OF_A_CURVE) + phase) / MARKS_OF_A_CURVE
            places = np.unique((parts * len(theirs)).astype(int))
            x = self.choose_base(answer.at)[places]
            axes.plot(x, theirs[places], **_mark(answer, 5.5))
        low, high = np.nanpercentile(ours, [2.0, 98.0])
        span = high - low
        beyond = max(np.nanmax(ours) - high, low - np.nanmin(ours))
        if span > 0.0 and beyond > 3.0 * span:
            axes.set_ylim(low - 0.5 * span, high + 0.5 * span)
            top = float(base[np.nanargmax(np.abs(ours))]), high + 0.5 * span
            add_label(axes, "leaves towards a pole", complex(*top), -1j, INK, 8.0)
        name = quantity.replace("theta_", "θ").translate(_SUBSCRIPT)
        label = f"{quantity} {'xy'[axis or 0]} (N)"
        if quantity in ANGLES:
            label = f"{name} (°)"
        elif axis is None:
            torque = f"T{self.solution.drive_bar} (N m)".translate(_SUBSCRIPT)
            label = "F (N)" if quantity == LINE.value else torque
        axes.set_ylabel(label)

    def draw_errors(self, axes: "Axes") -> None:
        """Draw the largest error of each segment on a logarithmic axis.

        The worst one is ringed; what is allowed is drawn too.
        """
        from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

        quantity = self.quantity
        solution = self.solution
        engines = {answer.engine for answer in self.answers}
        condition = find_condition(quantity, self.scene.linkage, solution)
        shown = np.where(self.good, EQUIVALENCE.allowed(condition), np.nan)
        limits = [("allowed", ALLOWED, shown)]
        for row in self.record.rows:  # of an engine that is allowed more than others
            more = row.compared and row.allowed > 2.0 * np.nanmax(shown)
            if more and row.quantity == quantity and row.engine in engines:
                colour = choose_style(row.engine).colour
                own = np.full(len(solution), row.allowed)
                limits.append((f"allowed to {row.engine}", colour, own))
        base = self.choose_base(None)
        good = np.flatnonzero(self.good)
        middle = good[len(good) // 2]
        for text, colour, limit in limits:
            axes.plot(base, limit, color=colour, lw=1.1, ls=(0, (5, 2)))
            place = complex(base[middle], limit[middle])
            add_label(axes, text, place, -1j, colour, 8.5)
        for turn, answer in enumerate(self.answers):
            formulas = solution
            if answer.at is not None:
                formulas = solve(self.scene, at=answer.at)
            mine = getattr(formulas, quantity)
            size = scale_of(quantity, self.scene, formulas, mine).size
            error = find_error(quantity, mine, answer.quantities[quantity], size)
            error = np.where(formulas.status_code == OK, error, np.nan)
            places = find_worst_of_segments(error, turn / len(self.answers))
            if not places:
                continue
            x = self.choose_base(answer.at)[places]
            heights = np.maximum(error[places], LEAST_DRAWN_ERROR)
            mark = _mark(answer, 3.2) | {"mew": 0.8}
            axes.plot(x, heights, **mark)
            worst = int(np.argmax(heights))
            ring = mark | {"marker": "o", "ms": 9.0, "mfc": "none"}
            axes.plot(x[worst], heights[worst], **ring)
        axes.set_yscale("log")
        axes.margins(y=0.15)
        axes.yaxis.set(
            major_locator=LogLocator(numticks=5),
            minor_locator=NullLocator(),
            major_formatter=FuncFormatter(lambda value, _: f"{value:.0e}"),
        )


def find_worst_of_segments(error: Array, phase: float) -> list[int]:
    """Find the index of the largest error in each of STRETCHES stretches.

    `phase`: in [0, 1), shifts where they begin. What is not finite is left out: the
    table says that it fails.
    """
    shift = int(phase * len(error) / STRETCHES)
    rows = np.roll(np.arange(len(error)), -shift)
    finite = [
        piece[np.isfinite(error[piece])] for piece in np.array_split(rows, STRETCHES)
    ]
    return [int(piece[np.argmax(error[piece])]) for piece in finite if len(piece)]


def _mark(answer: Answer, size: float) -> dict[str, Any]:
    look = choose_style(answer.engine)
    return {
        "color": look.colour,
        "ls": "none",
        "marker": look.marker,
        "ms": size,
        "mfc": PAPER,
        "mew": 1.2,
    }
