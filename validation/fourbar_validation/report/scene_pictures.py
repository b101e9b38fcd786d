"""The pictures of one scene.

Drawn are the linkage, every engine's answer over the formulas, and the errors beneath.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

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
    SIMULATED,
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
    SOFT,
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
_MOTION_AND_FORCE = ("theta_4", "F32")
"""Quantities shown of a released linkage, whose torque is mere rounding."""
_SUBSCRIPT = str.maketrans("234", "₂₃₄")


def draw_scene_figure(record: Record) -> str | None:
    """Return the linkage and, for a sweep, the answers as SVGs.

    The text is None if nothing assembles.
    """
    solution = record.solution
    scene = record.scene
    if scene is None or solution is None or not np.any(solution.status_code == OK):
        return None
    linkage = _draw_best_position(record.name, scene, solution)
    if np.count_nonzero(solution.status_code == OK) < 2:
        return linkage
    shown = ANGLES
    if scene.motion.free is not None:
        shown = _MOTION_AND_FORCE
    elif solution.F32 is not None:
        shown = (name_driving(scene), _choose_force(record, solution))
    curves = [_Curve(name, record, scene, solution) for name in shown]
    return linkage + "".join(curve.draw() for curve in curves)


def draw_thumbnail(record: Record) -> str | None:
    """Draw linkage and torque as one small SVG; None where nothing assembles."""
    from matplotlib.figure import Figure

    solution = record.solution
    scene = record.scene
    if scene is None or solution is None or not np.any(solution.status_code == OK):
        return None
    figure = Figure(figsize=(3.3, 1.0), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=[2.0, 3.0])
    best = find_best_position(solution)
    bars = scene.linkage
    O4 = [part(bars.ground_angle) * bars.ground for part in (math.cos, math.sin)]
    pins = np.array([[0.0, 0.0], solution.A[best], solution.B[best], O4])
    left.plot(*pins[[0, 3]].T, color=SOFT, lw=1.0, ls="--")
    left.plot(*pins.T, color=INK, lw=1.6, marker="o", ms=4.0)
    left.set_aspect("equal", adjustable="datalim")
    quantity = name_driving(scene)
    # no torque acts on a released motion
    if scene.motion.free is None and getattr(solution, quantity) is not None:
        curve = _Curve(quantity, record, scene, solution)
        curve.draw_values(right, curve.list_answers(), 3.0)
        right.set_title(right.get_ylabel(), size=7.0, color=SOFT, loc="left")
    for axes in (left, right):
        axes.set_axis_off()
    settle_labels(figure)
    return write_svg(figure, f"{record.name} small")


def find_best_position(solution: Solution) -> int:
    """Return the index of the best conditioned position that assembles."""
    return int(np.argmax(np.where(solution.status_code == OK, solution.condition, -1)))


def _draw_best_position(name: str, scene: Scene, solution: Solution) -> str:
    """Draw the linkage as `fourbar plot` does, at its best conditioned position."""
    from matplotlib.figure import Figure

    best = find_best_position(solution)
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

    Errors of the simulation and of the exact engines have axes of their own.
    """

    quantity: str
    record: Record
    scene: Scene
    solution: Solution

    @property
    def good(self) -> NDArray[np.bool_]:
        """Positions at which the formulas have values."""
        return np.equal(self.solution.status_code, OK)

    def list_answers(self, *, simulated: bool | None = None) -> list[Answer]:
        """List the answers that have the quantity, of all engines or of one kind."""
        return [
            answer
            for answer in self.record.answers
            if answer.refusal is None
            and self.quantity in answer.quantities
            and simulated in (None, choose_style(answer.engine).simulated)
        ]

    def draw(self) -> str:
        """Draw it as an SVG."""
        from matplotlib.figure import Figure

        groups = [self.list_answers(simulated=simulated) for simulated in (True, False)]
        groups = [group for group in groups if group]
        figure = Figure(figsize=(4.3, 2.2 + 1.0 * len(groups)), layout="constrained")
        heights = [1.9, *[1.0] * len(groups)]
        panels = figure.subplots(
            len(heights), sharex=True, height_ratios=heights, squeeze=False
        )
        first, *others = axes = panels[:, 0]
        self.draw_values(first, self.list_answers(), 5.5)
        unit = "error / scale" if self.quantity in FORCE_NAMES else "error (rad)"
        for below, group in zip(others, groups, strict=True):
            self.draw_errors(below, group)
            below.set_ylabel(unit, fontsize=8.5)
        angle = f"θ{self.solution.at.bar} (°)".translate(_SUBSCRIPT)
        axes[-1].set_xlabel("time (s)" if self.solution.time is not None else angle)
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

    def draw_values(self, axes: "Axes", answers: list[Answer], size: float) -> None:
        """Draw the formulas as a band, and each engine's marks, of a size in points.

        The marks stand at positions of their own. Where the formulas have no value, as
        at a change point, nothing is judged, and a mark would look like an error. Near
        a pole the curve leaves the picture, which ends beyond 96 % of the positions.
        """
        quantity = self.quantity
        axis = self.choose_component(answers)
        values = _take_plain(quantity, getattr(self.solution, quantity), axis)
        ours = np.where(self.good, values, np.nan)
        base = self.choose_base(None)
        axes.plot(base, ours, color=BAND, lw=0.9 * size, solid_capstyle="butt")
        for turn, answer in enumerate(answers):
            theirs = _take_plain(quantity, answer.quantities[quantity], axis)
            if len(theirs) == len(ours):  # a simulation makes positions of its own
                theirs = np.where(self.good, theirs, np.nan)
            phase = (turn + 0.5) / (len(answers) * MARKS_OF_A_CURVE)
            parts = np.arange(MARKS_OF_A_CURVE) / MARKS_OF_A_CURVE + phase
            places = np.unique((parts * len(theirs)).astype(int))
            x = self.choose_base(answer.at)[places]
            axes.plot(x, theirs[places], **_mark(answer, size))
        low, high = np.nanpercentile(ours, [2.0, 98.0])
        span = high - low
        beyond = max(np.nanmax(ours) - high, low - np.nanmin(ours))
        if span > 0.0 and beyond > 3.0 * span:
            axes.set_ylim(low - 0.5 * span, high + 0.5 * span)
            top = float(base[np.nanargmax(np.abs(ours))]), high + 0.5 * span
            add_label(axes, "leaves towards a pole", complex(*top), -1j, INK, 8.0)
        axes.set_ylabel(_label(quantity, self.solution, axis))

    def draw_errors(self, axes: "Axes", answers: list[Answer]) -> None:
        """Draw the largest error of each segment on a logarithmic axis.

        The worst one is ringed; what is allowed is drawn too.
        """
        from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

        quantity = self.quantity
        solution = self.solution
        rows = [row for row in self.record.rows if row.quantity == quantity]
        first = answers[0].engine
        condition = find_condition(quantity, self.scene.linkage, solution)
        allowed = EQUIVALENCE.allowed(condition)
        if choose_style(first).simulated:
            held_to = [row.allowed for row in rows if row.engine == first]
            allowed = np.full(len(solution), [*held_to, SIMULATED.factor][0])
        shown = np.where(self.good, allowed, np.nan)
        limits = [("allowed", ALLOWED, shown)]
        common = float(np.nanmax(shown))
        for row in rows:  # of an engine that is allowed more than the others
            is_drawn = row.engine in {answer.engine for answer in answers}
            if is_drawn and row.compared and row.allowed > 2.0 * common:
                colour = choose_style(row.engine).colour
                own = np.full(len(solution), row.allowed)
                limits.append((f"allowed to {row.engine}", colour, own))
        base = self.choose_base(None)
        middle = int(np.flatnonzero(self.good)[np.count_nonzero(self.good) // 2])
        for text, colour, limit in limits:
            axes.plot(base, limit, color=colour, lw=1.1, ls=(0, (5, 2)))
            place = complex(base[middle], limit[middle])
            add_label(axes, text, place, -1j, colour, 8.5)
        for turn, answer in enumerate(answers):
            formulas = (
                solution if answer.at is None else solve(self.scene, at=answer.at)
            )
            mine = getattr(formulas, quantity)
            size = scale_of(quantity, self.scene, formulas, mine).size
            error = find_error(quantity, mine, answer.quantities[quantity], size)
            error = np.where(formulas.status_code == OK, error, np.nan)
            places = find_worst_of_segments(error, turn / len(answers))
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

    def choose_component(self, answers: list[Answer]) -> int | None:
        """Return the component of a force that is wrong; None if none is.

        A force whose sign or direction is wrong lies on the curve of magnitudes.
        """
        failed = [row for row in self.record.rows if row.failed]
        wrong = {row.engine for row in failed if row.quantity == self.quantity}
        ours = getattr(self.solution, self.quantity)
        differences = []
        for answer in answers:
            theirs = answer.quantities[self.quantity]
            if answer.engine in wrong and theirs.shape == ours.shape:
                apart = np.nanmax(np.abs(theirs - ours), axis=0, initial=0.0)
                differences.append(apart)
        if ours.ndim == 1 or not differences:
            return None
        return int(np.argmax(np.max(differences, axis=0)))


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


def _take_plain(quantity: str, values: Array, axis: int | None) -> Array:
    """Take a scalar as it is (angles in degrees).

    `axis`: component to take of a vector; left out: its magnitude.
    """
    if quantity in ANGLES:
        return np.degrees(values)
    if values.ndim == 2 and axis is not None:
        return values[:, axis]
    if values.ndim == 2:
        return magnitude(values)
    return values


def _label(quantity: str, solution: Solution, axis: int | None) -> str:
    if quantity == LINE.value:
        return "F (N)"
    if quantity == "torque":
        return f"T{solution.drive_bar} (N m)".translate(_SUBSCRIPT)
    name = quantity.replace("theta_", "θ").translate(_SUBSCRIPT)
    if quantity in ANGLES:
        return f"{name} (°)"
    if axis is not None:
        return f"{quantity} {'xy'[axis]} (N)"
    return f"|{quantity}| (N)"
