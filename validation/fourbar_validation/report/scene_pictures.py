"""The pictures of one scene.

Drawn are the linkage, every engine's answer over the formulas, and the errors beneath.
"""

import math
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from fourbar.quantities import ANGLES, FORCE_NAMES, LINE, OK, PIN_FORCES, Array
from fourbar.scene import Command, Scene
from fourbar.show.plot.labels import Labels
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
from fourbar_validation.report.run_summary import compute_shares
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
from fourbar_validation.report.thumbnail import choose_base

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
    if (
        record.scene is None
        or solution is None
        or not np.any(solution.status_code == OK)
    ):
        return None
    linkage = _draw_best_position(record.name, record.scene, solution)
    if np.count_nonzero(solution.status_code == OK) < 2:
        return linkage
    return linkage + _draw_answers(record, solution)


def _draw_best_position(
    name: str,
    scene: Scene,
    solution: Solution,
) -> str:
    """Draw the linkage as `fourbar plot` does, at its best conditioned position."""
    from matplotlib.figure import Figure

    best = int(
        np.argmax(np.where(solution.status_code == OK, solution.condition, -1.0))
    )
    with apply_style():
        figure = Figure(figsize=(3.1, 2.9), layout="constrained")
        labels = Labels()
        here = solve(scene, "position", at=solution.at.part(slice(best, best + 1)))
        axes = figure.subplots()
        draw_linkage(axes, View(scene, solution, here), labels)
        legend = axes.get_legend()
        if legend is not None:  # it is wider than this drawing
            legend.remove()
        # the arrow of gravity stands above the axes
        axes.set_title(axes.get_title(loc="left"), pad=22.0)
        labels.settle(figure)
        svg = write_svg(figure, f"{name} linkage")
    for light, variable in _PLOT_COLOURS.items():
        svg = svg.replace(light, f"var({variable})")
    return svg.replace("<svg", '<svg class="linkage"', 1)


def _draw_answers(record: Record, solution: Solution) -> str:
    """Draw one SVG per quantity: values and errors.

    Errors of the simulation and of the exact engines have axes of their own.
    """
    answers = [
        answer
        for answer in record.answers
        if answer.refusal is None and answer.quantities
    ]
    assert record.scene is not None
    drive = name_driving(record.scene)
    shown = ANGLES
    if solution.F32 is not None:
        shown = (drive, _choose_force(record, solution))
    if record.scene is not None and record.scene.motion.free is not None:
        shown = _MOTION_AND_FORCE
    return "".join(
        _draw_quantity(quantity, record, solution, answers) for quantity in shown
    )


def _choose_force(record: Record, solution: Solution) -> str:
    """Return the name of the pin force to draw.

    Drawn is the one that fails most, or else the largest at positions that have a
    value.
    """
    failing = [row for row in record.rows if row.failed and row.quantity in PIN_FORCES]
    if failing:
        return failing[int(np.argmax(compute_shares(failing)))].quantity
    good = solution.status_code == OK
    return max(
        PIN_FORCES,
        key=lambda name: float(np.nanmax(magnitude(getattr(solution, name))[good])),
    )


def _draw_quantity(
    quantity: str,
    record: Record,
    solution: Solution,
    answers: list[Answer],
) -> str:
    from matplotlib.figure import Figure

    shown = [answer for answer in answers if quantity in answer.quantities]
    simulated = [answer for answer in shown if choose_style(answer.engine).simulated]
    exact = [answer for answer in shown if not choose_style(answer.engine).simulated]
    groups = [group for group in (simulated, exact) if group]
    figure = Figure(figsize=(4.3, 2.2 + 1.0 * len(groups)), layout="constrained")
    panels = figure.subplots(
        1 + len(groups),
        1,
        sharex=True,
        height_ratios=[1.9, *[1.0] * len(groups)],
        squeeze=False,
    )
    axes = list(panels[:, 0])
    _draw_values(axes[0], quantity, solution, [*exact, *simulated], record)
    for below, group in zip(axes[1:], groups, strict=True):
        _draw_errors(below, quantity, record, solution, group)
        below.set_ylabel(
            "error / scale" if quantity in FORCE_NAMES else "error (rad)",
            fontsize=8.5,
        )
    angle = f"θ{solution.at.bar} (°)".translate(_SUBSCRIPT)
    axes[-1].set_xlabel("time (s)" if solution.time is not None else angle)
    figure.align_ylabels(axes)
    for panel in axes:
        set_frame(panel)
    return write_svg(figure, f"{record.name} {quantity}")


def _draw_values(
    axes: "Axes",
    quantity: str,
    solution: Solution,
    answers: list[Answer],
    record: Record,
) -> None:
    """Draw the formulas as a band, and each engine's marks.

    The marks stand at positions of their own.
    """
    good = solution.status_code == OK
    axis = _choose_component(quantity, record, solution, answers)
    values = _take_plain(quantity, getattr(solution, quantity), axis)
    ours = np.where(good, values, np.nan)
    base = _choose_base(solution, None)
    axes.plot(base, ours, color=BAND, lw=5, solid_capstyle="butt")
    for turn, answer in enumerate(answers):
        theirs = _take_plain(quantity, answer.quantities[quantity], axis)
        phase = (turn + 0.5) / (len(answers) * MARKS_OF_A_CURVE)
        places = np.unique(
            (
                (np.arange(MARKS_OF_A_CURVE) / MARKS_OF_A_CURVE + phase) * len(theirs)
            ).astype(int)
        )
        axes.plot(
            _choose_base(solution, answer.at)[places],
            theirs[places],
            **_mark(answer, 5.5),
        )
    _limit_to_bulk(axes, ours[good])
    axes.set_ylabel(_label(quantity, solution, axis))


def _draw_errors(
    axes: "Axes",
    quantity: str,
    record: Record,
    solution: Solution,
    answers: list[Answer],
) -> None:
    """Draw the largest error of each segment on a logarithmic axis.

    The worst one is ringed; what is allowed is drawn too.
    """
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    good = solution.status_code == OK
    scene = record.scene
    assert scene is not None
    if choose_style(answers[0].engine).simulated:
        held_to = (
            r.allowed
            for r in record.rows
            if (r.engine, r.quantity) == (answers[0].engine, quantity)
        )
        allowed = np.full(len(solution), next(held_to, SIMULATED.factor))
    else:
        allowed = EQUIVALENCE.allowed(find_condition(quantity, scene.linkage, solution))
    axes.plot(
        _choose_base(solution, None),
        np.where(good, allowed, np.nan),
        color=ALLOWED,
        lw=1.1,
        ls=(0, (5, 2)),
    )
    low = float(np.nanmin(allowed[good]))
    high = float(np.nanmax(allowed[good]))
    for engine, limit in _find_own_limits(quantity, record, answers, high):
        colour = choose_style(engine).colour
        axes.axhline(limit, color=colour, lw=1.1, ls=(0, (5, 2)))
        axes.annotate(
            f"allowed to {engine}",
            (0.99, limit),
            (0, -9),
            xycoords=axes.get_yaxis_transform(),
            textcoords="offset points",
            fontsize=8.5,
            ha="right",
            color=colour,
        )
        high = max(high, limit)
    for turn, answer in enumerate(answers):
        formulas = solution if answer.at is None else solve(scene, at=answer.at)
        mine = getattr(formulas, quantity)
        size = scale_of(quantity, scene, formulas, mine).size
        error = find_error(quantity, mine, answer.quantities[quantity], size)
        places = find_worst_of_segments(error, turn / len(answers))
        if not len(places):
            continue
        x = _choose_base(solution, answer.at)[places]
        heights = np.maximum(error[places], LEAST_DRAWN_ERROR)
        axes.plot(x, heights, **_mark(answer, 3.2) | {"mew": 0.8})
        worst = int(np.argmax(heights))
        axes.plot(
            x[worst],
            heights[worst],
            "o",
            ms=9,
            mfc="none",
            mec=choose_style(answer.engine).colour,
            mew=0.9,
        )
        low = min(low, float(heights.min()))
        high = max(high, float(heights.max()))
    axes.set_yscale("log")
    axes.set_ylim(low / 4.0, 5.0 * high)
    axes.yaxis.set_major_locator(LogLocator(numticks=5))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.0e}"))
    middle = int(np.flatnonzero(good)[np.count_nonzero(good) // 2])
    place = (float(_choose_base(solution, None)[middle]), float(allowed[middle]))
    is_low = place[1] < math.sqrt(low * high)  # marks stand beneath it
    axes.annotate(
        "allowed",
        place,
        (0, 3 if is_low else -9),
        textcoords="offset points",
        fontsize=8.5,
        ha="center",
        color=ALLOWED,
    )


def _find_own_limits(
    quantity: str,
    record: Record,
    answers: list[Answer],
    common: float,
) -> list[tuple[str, float]]:
    """List the engines that are allowed more than the others, with their limit."""
    engines = {answer.engine for answer in answers}
    return [
        (row.engine, row.allowed)
        for row in record.rows
        if row.quantity == quantity and row.engine in engines and row.compared
        if row.allowed > 2.0 * common
    ]


def find_worst_of_segments(
    error: Array,
    phase: float,
) -> np.ndarray[Any, np.dtype[np.intp]]:
    """Find the index of the largest error in each of STRETCHES stretches.

    `phase`: in [0, 1), shifts where they begin. What is not finite is left out: the
    table says that it fails.
    """
    edges = (np.arange(STRETCHES + 2) - 1.0 + phase) * len(error) / STRETCHES
    bounds = np.clip(edges.astype(int), 0, len(error))
    worst = []
    for start, stop in pairwise(bounds):
        piece = error[start:stop]
        if np.isfinite(piece).any():
            worst.append(
                start + int(np.nanargmax(np.where(np.isfinite(piece), piece, np.nan)))
            )
    return np.array(worst, dtype=np.intp)


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


def _choose_component(
    quantity: str,
    record: Record,
    solution: Solution,
    answers: list[Answer],
) -> int | None:
    """Return the component of a force that is wrong; None if none is.

    A force whose sign or direction is wrong lies on the curve of magnitudes.
    """
    wrong = {
        row.engine for row in record.rows if row.failed and row.quantity == quantity
    }
    ours = getattr(solution, quantity)
    differences = [
        np.nanmax(np.abs(answer.quantities[quantity] - ours), axis=0, initial=0.0)
        for answer in answers
        if answer.engine in wrong and answer.quantities[quantity].shape == ours.shape
    ]
    if ours.ndim == 1 or not differences:
        return None
    return int(np.argmax(np.max(differences, axis=0)))


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


def _choose_base(solution: Solution, command: Command | None) -> Array:
    """Return what a curve is drawn over: theta_2 in degrees, or the time in s."""
    base = choose_base(solution, solution.at if command is None else command)
    return base if base is solution.time else np.degrees(base)


def _limit_to_bulk(axes: "Axes", values: Array) -> None:
    """Limit the axis to 96 % of the positions.

    Near a pole the curve leaves the picture.
    """
    low, high = np.nanpercentile(values, [2.0, 98.0])
    span = high - low
    if span > 0.0 and (
        np.nanmax(values) > high + 3 * span or np.nanmin(values) < low - 3 * span
    ):
        axes.set_ylim(low - 0.5 * span, high + 0.5 * span)
        note = "axis ends where the curve leaves towards a pole"
        axes.annotate(
            note,
            (0.99, 0.97),
            xycoords="axes fraction",
            fontsize=8.5,
            ha="right",
            va="top",
            color=INK,
        )
