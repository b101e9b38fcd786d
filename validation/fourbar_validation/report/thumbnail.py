"""Small pictures of a scene: linkage, and what drives it over the motion."""

import numpy as np

from fourbar.quantities import LINE, OK, Array
from fourbar.scene import Command, Scene
from fourbar.solution import Solution
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
        f"{_draw_four_bars(scene, solution)}"
        f"{_draw_curve(record, scene, solution)}</svg>"
    )


def _draw_four_bars(scene: Scene, solution: Solution) -> str:
    """Draw the four bars at the best conditioned position."""
    good = solution.status_code == OK
    best = int(np.argmax(np.where(good, solution.condition, -1.0)))
    d = scene.linkage.ground
    theta_1 = scene.linkage.ground_angle
    O4 = (d * np.cos(theta_1), d * np.sin(theta_1))
    pins = np.array([(0.0, 0.0), solution.A[best], solution.B[best], O4])
    low = pins.min(axis=0)
    high = pins.max(axis=0)
    picture = np.array([LINKAGE_WIDTH, THUMBNAIL_HEIGHT])
    room = picture - 2.0 * EDGE - 4.0
    scale = float(np.min(room / np.maximum(high - low, 1e-300)))
    from_middle = pins - 0.5 * (low + high)
    places = from_middle * [scale, -scale] + 0.5 * picture
    points = [f"{x:.1f},{y:.1f}" for x, y in places]
    dots = "".join(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.6"/>' for x, y in places)
    return (
        f'<polyline class="ground" points="{points[0]} {points[3]}"/>'
        f'<polyline class="bars" points="{" ".join(points)}"/>{dots}'
    )


def _draw_curve(record: Record, scene: Scene, solution: Solution) -> str:
    """Draw the formulas' torque as a band, and each engine's as marks on it.

    Where the curve leaves the picture, as towards a pole, it is cut, and a bar says so.
    Where the formulas have no value, as at a change point, nothing is judged, and a
    mark beside the curve would look like an error.
    """
    name = name_driving(scene)
    ours = getattr(solution, name, None)
    good = solution.status_code == OK
    released = scene.motion.free is not None  # no torque acts
    if released or ours is None or np.count_nonzero(good) < 2:
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

    x, y = place(base, np.where(good, ours, np.nan))
    drawn = ""
    pen = "M"
    points = min(len(ours), POINTS_OF_A_CURVE)
    for i in np.linspace(0, len(ours) - 1, points).astype(int):
        shown = np.isfinite(y[i])  # the path is broken where there is no value
        drawn += f"{pen}{x[i]:.1f} {y[i]:.1f}" * bool(shown)
        pen = "L" if shown else "M"
    marks = ""
    answers = [one for one in record.answers if name in one.quantities]
    for turn, answer in enumerate(answers):
        values = answer.quantities[name]
        across, up = place(choose_base(solution, answer.at or solution.at), values)
        if len(values) == len(good):  # a simulation makes positions of its own
            up = np.where(good, up, np.nan)
        phase = turn / len(answers)
        parts = (np.arange(MARKS_OF_AN_ENGINE) + phase) / MARKS_OF_AN_ENGINE
        colour = choose_style(answer.engine).variable
        for i in np.unique((parts * len(values)).astype(int)):
            if np.isfinite(up[i]):
                marks += (
                    f'<circle class="mark" cx="{across[i]:.1f}" cy="{up[i]:.1f}"'
                    f' r="2.2" style="stroke:var({colour})"/>'
                )
    cut = np.isin(np.clip((ours - low) / span, -0.1, 1.1), (-0.1, 1.1)) & good
    ends = np.flatnonzero(np.diff(cut.astype(int), prepend=0, append=0))
    for start, stop in ends.reshape(-1, 2):
        left, right = x[start] - 1.5, x[stop - 1] + 1.5
        marks += f'<path class="cut" d="M{left:.1f} {y[start]:.1f}H{right:.1f}"/>'
    words = f"torque on bar {solution.drive_bar}"
    if name == LINE.value:
        words = "drive force"
    label = (
        f'<text class="name" x="{LINKAGE_WIDTH + EDGE:g}"'
        f' y="{THUMBNAIL_HEIGHT - 1.0:g}">{words}</text>'
    )
    return f'<path class="formulas" d="{drawn}"/>{marks}{label}'
