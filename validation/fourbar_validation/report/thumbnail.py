"""Small pictures of a scene: linkage, and what drives it over the motion."""

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fourbar.quantities import LINE, OK, Array
from fourbar.scene import Command
from fourbar.solution import Solution
from fourbar_validation.compare.answer import Answer
from fourbar_validation.engines.description import name_driving
from fourbar_validation.report.scene_record import Record
from fourbar_validation.report.svg import choose_style

THUMBNAIL_HEIGHT, LINKAGE_WIDTH, _CURVE, EDGE = 76.0, 96.0, 150.0, 6.0
"""Sizes in pixels: height, widths of both pictures, and their margin."""
POINTS_OF_A_CURVE = 120
"""Points of a curve."""
MARKS_OF_AN_ENGINE = 7
"""Marks of one engine on it."""


def choose_base(solution: Solution, command: Command) -> Array:
    """Return what a curve is drawn over: the commanded angle, or the time.

    The time takes its place where the motion is free or follows a law.
    """
    if solution.time is not None and len(solution.time) == len(command.angle):
        return solution.time
    return command.angle


def draw_thumbnail(record: Record) -> str | None:
    """Draw linkage and torque as one SVG; None where nothing assembles."""
    solution = record.solution
    scene = record.scene
    if scene is None or solution is None or not np.any(solution.status_code == OK):
        return None
    width = LINKAGE_WIDTH + _CURVE
    return (
        f'<svg viewBox="0 0 {width:g} {THUMBNAIL_HEIGHT:g}" width="{width:g}" '
        f'height="{THUMBNAIL_HEIGHT:g}" aria-hidden="true">'
        f"{_draw_four_bars(record, solution)}{_draw_curve(record, solution)}</svg>"
    )


def _draw_four_bars(record: Record, solution: Solution) -> str:
    """Draw the four bars at the best conditioned position."""
    assert record.scene is not None
    good = solution.status_code == OK
    best = int(np.argmax(np.where(good, solution.condition, -1.0)))
    d = record.scene.linkage.ground
    theta_1 = record.scene.linkage.ground_angle
    O4 = (d * np.cos(theta_1), d * np.sin(theta_1))
    pins = np.array([(0.0, 0.0), solution.A[best], solution.B[best], O4])
    low = pins.min(axis=0)
    high = pins.max(axis=0)
    picture = np.array([LINKAGE_WIDTH, THUMBNAIL_HEIGHT])
    room = picture - 2.0 * EDGE - 4.0
    size = np.maximum(high - low, 1e-300)
    scale = float(np.min(room / size))
    from_middle = pins - 0.5 * (low + high)
    places = from_middle * [scale, -scale] + 0.5 * picture
    bars = _write_points(places)
    ground = _write_points(places[[0, 3]])
    dots = "".join(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.6"/>' for x, y in places)
    return (
        f'<polyline class="ground" points="{ground}"/>'
        f'<polyline class="bars" points="{bars}"/>{dots}'
    )


def _write_points(places: Array) -> str:
    """Write the points of a polyline."""
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in places)


def _draw_curve(record: Record, solution: Solution) -> str:
    """Draw the formulas' torque as a band, and each engine's as marks on it.

    Where the curve leaves the picture, as towards a pole, it is cut, and a bar says so.
    """
    assert record.scene is not None
    name = name_driving(record.scene)
    released = record.scene.motion.free is not None  # no torque acts
    ours = None if released else getattr(solution, name, None)
    good = solution.status_code == OK
    if ours is None or np.count_nonzero(good) < 2:
        return ""
    low, high = np.nanpercentile(ours[good], [2.0, 98.0])
    span = max(float(high - low), 1e-300)

    base = choose_base(solution, solution.at)
    first, last = float(base.min()), float(base.max())

    def place(base: Array, values: Array) -> tuple[Array, Array]:
        along = (base - first) / max(last - first, 1e-300)
        x = LINKAGE_WIDTH + EDGE + (_CURVE - 2.0 * EDGE) * along
        height = np.clip((values - low) / span, -0.1, 1.1)
        bottom = THUMBNAIL_HEIGHT - 3.0 * EDGE
        room = THUMBNAIL_HEIGHT - 5.0 * EDGE
        return x, bottom - room * height

    points = min(len(ours), POINTS_OF_A_CURVE)
    kept = np.linspace(0, len(ours) - 1, points).astype(int)
    x, y = place(base, np.where(good, ours, np.nan))
    drawn = "".join(_write_path(x[kept], y[kept]))
    marks = ""
    answers = [one for one in record.answers if name in one.quantities]
    for turn, answer in enumerate(answers):
        at = solution.at if answer.at is None else answer.at
        over = choose_base(solution, at)
        phase = turn / max(len(answers), 1)
        marks += _draw_marks(answer, name, phase, partial(place, over), good)
    heights = np.clip((ours - low) / span, -0.1, 1.1)
    cut = np.isin(heights, (-0.1, 1.1)) & good
    ends = np.flatnonzero(np.diff(np.concatenate(([0], cut.astype(int), [0]))))
    for start, stop in ends.reshape(-1, 2).tolist():
        left, right = float(x[start]) - 1.5, float(x[stop - 1]) + 1.5
        marks += f'<path class="cut" d="M{left:.1f} {y[start]:.1f}H{right:.1f}"/>'
    words = (
        "drive force" if name == LINE.value else f"torque on bar {solution.drive_bar}"
    )
    label = (
        f'<text class="name" x="{LINKAGE_WIDTH + EDGE:g}"'
        f' y="{THUMBNAIL_HEIGHT - 1.0:g}">{words}</text>'
    )
    return f'<path class="formulas" d="{drawn}"/>{marks}{label}'


def _write_path(x: Array, y: Array) -> list[str]:
    """Write a path that is broken where there is no value."""
    parts = []
    pen = "M"
    for across, up in zip(x.tolist(), y.tolist(), strict=True):
        if np.isfinite(up):
            parts.append(f"{pen}{across:.1f} {up:.1f}")
            pen = "L"
        else:
            pen = "M"
    return parts


def _draw_marks(
    answer: Answer,
    name: str,
    phase: float,
    place: Callable[[Array], tuple[Array, Array]],
    good: NDArray[np.bool_],
) -> str:
    """Draw some answers of an engine.

    Where the formulas have no value, as at a change point, nothing is judged, and a
    mark beside the curve would look like an error.
    """
    values = answer.quantities[name]
    x, y = place(values)
    if len(values) == len(good):  # a simulation makes positions of its own
        y = np.where(good, y, np.nan)
    parts = (np.arange(MARKS_OF_AN_ENGINE) + phase) / MARKS_OF_AN_ENGINE
    rows = (parts * len(values)).astype(int)
    colour = choose_style(answer.engine).variable
    marks = ""
    for i in np.unique(rows):
        if np.isfinite(y[i]):
            marks += (
                f'<circle class="mark" cx="{x[i]:.1f}" cy="{y[i]:.1f}" r="2.2" '
                f'style="stroke:var({colour})"/>'
            )
    return marks
