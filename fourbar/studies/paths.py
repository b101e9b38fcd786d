"""Extent, straightness and stroke of the paths of points, located between positions."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fourbar.formulas.mobility import TURN
from fourbar.quantities import Array
from fourbar.scene.motion import Sweep
from fourbar.solution import Solution, shift_to_drawing
from fourbar.studies.course import MotionCourse

ROUNDS = 3
"""Rounds in which the steps beside an extreme are divided."""
PARTS = 16
"""Parts into which a step is divided in a round: with n places at first an extreme is
missed by the square of 1/(n PARTS^ROUNDS), which is round-off.
"""
NEAREST = 1e-4
"""Part of the path by which the places of a course may miss an extreme. It falls as
the square of the steps.
"""
DIRECTIONS = np.linspace(0.0, 0.5 * TURN, 360, endpoint=False)
"""Directions, rad, in which the width of a path is measured before the least is found
between two of them. Around it the width has one least value.
"""
THIRDS = 90
"""Rounds that leave two thirds of the directions: round-off of the first is left."""
MOST_PLACES = 50_000
"""Places from which on the steps are not divided: they are short all around."""


class Path(NamedTuple):
    """Extent of the path of a point, m, in the coordinates that places are shown in."""

    x: tuple[float, float]
    y: tuple[float, float]
    straightness: float
    """Least distance of two parallel lines that hold the path, as in ISO 1101."""
    stroke: float
    """Extent of the path along these lines."""
    direction: float
    """Angle of the lines, rad, in (-pi/2, pi/2]."""
    ends: tuple[float, float]
    """Commanded angles or strokes, or times, at the ends of the stroke, in order."""
    corners: Array
    """Corners of the rectangle of stroke and straightness, (4, 2)."""


def measure_paths(solution: Solution) -> dict[str, Path]:
    """Measure the path of each point over the motion of a solved scene.

    Nothing is measured of a scene that states single positions.
    """
    scene = solution.scene
    motion = scene.motion
    moves = motion.law is not None or motion.free is not None
    if not scene.points or not (moves or isinstance(motion.angle, Sweep | None)):
        return {}
    course = MotionCourse(scene, "position", solution)
    if not course.solution.assembled.any():
        return {}
    return {point.name: _measure_path(course, point.name) for point in scene.points}


def _measure_path(course: MotionCourse, name: str) -> Path:
    """Measure a path, dividing the steps beside its extremes round by round."""
    places = course.places
    points = _locate_point(course, name, places)
    for number in range(ROUNDS):
        if len(places) > MOST_PLACES:
            break
        missed = NEAREST * PARTS ** (-2.0 * number)
        extremes = _list_extremes(points, missed)
        steps = np.unique([extremes - 1, extremes])
        steps = steps[(steps >= 0) & (steps < len(places) - 1)]
        first, last = places[steps], places[steps + 1]
        inside = np.arange(1, PARTS) / PARTS
        between = (first[:, None] + (last - first)[:, None] * inside).ravel()
        # all stay: without the others another direction would seem narrower
        places = np.concatenate([places, between])
        points = np.concatenate([points, _locate_point(course, name, between)])
        order = np.argsort(places)
        places, points = places[order], points[order]
    return _measure_points(places, points)


def _locate_point(course: MotionCourse, name: str, places: Array) -> Array:
    """Return a point at places of the motion, (n, 2)."""
    solution = course.solve(places)
    return shift_to_drawing(solution, solution.points[name])


def _list_extremes(points: Array, missed: float) -> NDArray[np.intp]:
    """List the rows of the points that decide the extents of a path.

    `missed`: part of the path by which the points may miss an extreme.
    """
    direction, near = _find_direction(points, missed)
    ends = _list_ends(points @ direction)
    sides = [np.nanargmin(points, axis=0), np.nanargmax(points, axis=0)]
    room = missed * np.ptp(points[ends] @ direction)
    # what is no corner between these places may be one between closer ones
    touching = np.zeros(len(points), dtype=bool)
    for angle in near:
        heights = points @ np.array([-np.sin(angle), np.cos(angle)])
        with np.errstate(invalid="ignore"):
            touching |= heights <= np.nanmin(heights) + room
            touching |= heights >= np.nanmax(heights) - room
    return np.unique([*np.flatnonzero(touching), *ends, *np.ravel(sides)])


def _list_ends(heights: Array) -> list[int]:
    """List the rows of the least and the greatest height."""
    return [int(np.nanargmin(heights)), int(np.nanargmax(heights))]


def _find_direction(points: Array, missed: float = 0.0) -> tuple[Array, list[float]]:
    """Return a unit vector along the two nearest parallel lines that hold the points.

    The second result has the angles of these lines, and of others, rad, that are hardly
    farther apart: by `missed` as a part of the path.
    """
    points = points[np.isfinite(points).all(axis=1)]

    def measure_width(angle: float) -> float:
        return float(np.ptp(points @ np.array([-np.sin(angle), np.cos(angle)])))

    widths = np.array([measure_width(angle) for angle in DIRECTIONS])
    best = int(np.argmin(widths))
    angle = float(DIRECTIONS[best])
    step = float(DIRECTIONS[1])
    for _ in range(THIRDS):
        beside = [angle - step, angle, angle + step]
        angle = min(beside, key=measure_width)
        step *= 2.0 / 3.0
    room = missed * widths.max()
    near = DIRECTIONS[widths <= widths[best] + room].tolist()
    return np.array([np.cos(angle), np.sin(angle)]), [angle, *near]


def _measure_points(places: Array, points: Array) -> Path:
    """Measure the points of a path, at these places of the motion."""
    along, _ = _find_direction(points)
    if along[0] < 0.0 or (along[0] == 0.0 and along[1] < 0.0):
        along = -along
    across = np.array([-along[1], along[0]])
    ends = _list_ends(points @ along)
    lengths = (points @ along)[ends]
    heights = (points @ across)[_list_ends(points @ across)]
    (x_low, y_low), (x_high, y_high) = (
        np.nanmin(points, axis=0),
        np.nanmax(points, axis=0),
    )
    low, high = sorted(places[ends].tolist())
    return Path(
        (float(x_low), float(x_high)),
        (float(y_low), float(y_high)),
        float(heights[1] - heights[0]),
        float(lengths[1] - lengths[0]),
        float(np.arctan2(along[1], along[0])),
        (low, high),
        np.array(
            [
                length * along + height * across
                for length, height in zip(
                    lengths[[0, 1, 1, 0]], heights[[0, 0, 1, 1]], strict=True
                )
            ]
        ),
    )
