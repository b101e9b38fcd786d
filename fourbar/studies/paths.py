"""Extent, straightness and stroke of the paths of points, located between positions."""

from typing import NamedTuple

import numpy as np

from fourbar.formulas.mobility import TURN, find_circuit_where
from fourbar.quantities import Array, Indices, Mask, Signs
from fourbar.solution import Solution, shift_to_drawing
from fourbar.studies.course import MotionCourse, states_single_positions

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
MOST_LINES = 300
"""Directions of nearest lines that are told apart. A circle has more of them."""
SAME_HEIGHT = 1e-13
"""Part of the largest height by which others differ by rounding."""
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

    A motion that passes both circuits has a path in each, as the linkage does not move
    from one to the other. Nothing is measured of a scene that states single positions.
    """
    scene = solution.scene
    if not scene.points or states_single_positions(scene.motion):
        return {}
    course = MotionCourse(scene, "position", solution)
    numbers = _find_circuits(course.solution)
    passed = dict.fromkeys(numbers[numbers >= 0].tolist())
    return {
        point.name + where: _measure_path(course, point.name, number)
        for point in scene.points
        for number, where in zip(passed, ("", " in the other circuit"), strict=False)
    }


def _find_circuits(solution: Solution) -> Signs:
    return find_circuit_where(
        solution.assembled, solution.scene.linkage, solution.theta_2, solution.branch
    )


def _measure_path(course: MotionCourse, name: str, circuit: int) -> Path:
    """Measure a path, dividing the steps beside its extremes round by round."""
    places = course.places
    points = _locate_point(course, name, circuit, places)
    for number in range(ROUNDS):
        if len(places) > MOST_PLACES:
            break
        missed = NEAREST * PARTS ** (-2.0 * number)
        extremes = _list_extremes(points, missed)
        steps = np.unique([extremes - 1, extremes])
        steps = steps[(steps >= 0) & (steps < len(places) - 1)]
        first = places[steps, None]
        inside = np.arange(1, PARTS) / PARTS
        between = first + (places[steps + 1, None] - first) * inside
        between = np.setdiff1d(between, places)  # a step at a limit may be a rounding
        # all stay: without the others another direction would seem narrower
        places = np.concatenate([places, between])
        points = np.concatenate([points, _locate_point(course, name, circuit, between)])
        order = np.argsort(places)
        places = places[order]
        points = points[order]
    law = course.scene.motion.law
    stated = course.places[[0, -1]]
    if law is not None:
        stated = np.append(stated, law.time)
    return _measure_points(places, points, np.isin(places, stated))


def _locate_point(
    course: MotionCourse, name: str, circuit: int, places: Array
) -> Array:
    """Return a point at places of the motion, (n, 2); NaN in the other circuit."""
    solution = course.solve(places)
    points = shift_to_drawing(solution, solution.points[name])
    beyond = _find_circuits(solution) == 1 - circuit
    return np.where(beyond[:, None], np.nan, points)


def _list_extremes(points: Array, missed: float) -> Indices:
    """List the rows of the points that decide the extents of a path.

    `missed`: part of the path by which the points may miss an extreme.
    """
    direction, lines = _find_direction(points, missed)
    heights = np.column_stack([points @ direction, points])
    ends = [np.nanargmin(heights, axis=0), np.nanargmax(heights, axis=0)]
    return np.unique([*lines, *np.ravel(ends)])


def _find_direction(points: Array, missed: float = 0.0) -> tuple[Array, list[int]]:
    """Return a unit vector along the two nearest parallel lines that hold the points.

    One of the lines goes through two neighbouring corners of their convex hull, the
    other through the corner that is farthest from it. The second result has the rows of
    the points on these lines, and on others that are hardly farther apart.
    """
    hull = np.array(_list_hull(points))
    if len(hull) < 3:
        across = points[hull[-1]] - points[hull[0]]
        length = np.hypot(*across)
        along = across / length if length > 0.0 else np.array([1.0, 0.0])
        return along, hull.tolist()
    corners = points[hull]
    sides = np.roll(corners, -1, axis=0) - corners
    along = sides / np.hypot(*sides.T)[:, None]
    normals = np.stack([-along[:, 1], along[:, 0]])
    bases = np.sum(corners.T * normals, axis=0)
    # the farthest corner is where the sides have turned by half a turn
    angles = np.unwrap(np.arctan2(sides[:, 1], sides[:, 0]))
    farthest = np.searchsorted(np.append(angles, angles + TURN), angles + 0.5 * TURN)
    opposite = corners[farthest % len(hull)]
    widths = np.sum(opposite.T * normals, axis=0) - bases
    direction = along[np.argmin(widths)]
    room = missed * np.hypot(*np.ptp(corners, axis=0))
    near = np.flatnonzero(widths <= widths.min() + room)
    if len(near) > MOST_LINES:
        return direction, hull.tolist()
    # what is no corner between these places may be one between closer ones
    heights = points @ normals[:, near] - bases[near]
    with np.errstate(invalid="ignore"):
        touching = (heights <= room) | (heights >= widths[near] - room)
    return direction, np.flatnonzero(touching.any(axis=1)).tolist()


def _list_hull(points: Array) -> list[int]:
    """List the rows of the corners of the convex hull, counter-clockwise.

    Andrew's monotone chain: the points from left to right turn to the left below, and
    back from right to left above.
    """
    x, y = points.T.tolist()
    finite = np.flatnonzero(np.isfinite(points).all(axis=1))
    order = finite[np.lexsort(points[finite].T[::-1])].tolist()
    halves = []
    for rows in (order, order[::-1]):
        chain: list[int] = []
        for row in rows:
            while len(chain) > 1:
                first, second = chain[-2:]
                across = (x[second] - x[first]) * (y[row] - y[first])
                if across - (y[second] - y[first]) * (x[row] - x[first]) > 0.0:
                    break
                chain.pop()
            chain.append(row)
        halves.append(chain[:-1])
    corners = halves[0] + halves[1]
    return corners or order[:1]


def _list_first_ends(heights: Array, stated: Mask) -> list[int]:
    """List the rows of the least and the greatest height.

    Of heights that differ by rounding, as where a law comes to rest, one is taken where
    the motion or a part of it ends.
    """
    rows = []
    rounding = SAME_HEIGHT * np.nanmax(np.abs(heights))
    for sizes in (-heights, heights):
        tied = sizes >= np.nanmax(sizes) - rounding
        # the first of what is true: where the motion ends, or else any
        rows.append(int(np.argmax(2 * (tied & stated) + tied)))
    return rows


def _measure_points(places: Array, points: Array, stated: Mask) -> Path:
    """Measure the points of a path, at these places of the motion.

    `stated`: True where the motion begins, ends, or has a new part of a law.
    """
    along, _ = _find_direction(points)
    if along[0] < 0.0 or (along[0] == 0.0 and along[1] < 0.0):
        along = -along
    across = np.array([-along[1], along[0]])
    ends = _list_first_ends(points @ along, stated)
    lengths = (points @ along)[ends]
    sides = points @ across
    heights = np.array([np.nanmin(sides), np.nanmax(sides)])
    extents = np.stack([np.nanmin(points, axis=0), np.nanmax(points, axis=0)], axis=1)
    (x_low, x_high), (y_low, y_high) = extents.tolist()
    low, high = sorted(places[ends].tolist())
    at_ends = np.outer(lengths[[0, 1, 1, 0]], along)
    at_sides = np.outer(heights[[0, 0, 1, 1]], across)
    return Path(
        (x_low, x_high),
        (y_low, y_high),
        float(np.ptp(heights)),
        float(np.ptp(lengths)),
        float(np.arctan2(along[1], along[0])),
        (low, high),
        at_ends + at_sides,
    )
