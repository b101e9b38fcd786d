"""Places of a scene's motion, close to each other, and what is solved between them."""

from collections.abc import Callable

import numpy as np

from fourbar.formulas.mobility import TURN
from fourbar.quantities import ANGLES, Array, Indices, Mask
from fourbar.scene import Command, Scene, command, command_at, default_places
from fourbar.scene.motion import Motion, Sweep
from fourbar.solution import Solution
from fourbar.solving import solve

LADDER = 0.5 ** np.arange(1, 50)
"""Parts of the interval in which the linkage ceases to assemble: quantities may grow
there as the root of what is commanded.
"""
SAME_PLACE = 1e-12
"""Part of a motion within which two of its times are one."""
Condition = Callable[[Solution], Mask]
Stretch = tuple[float | None, float | None]
"""Places of the start and of the end; None: the motion begins or ends within."""
HALVINGS_OF_A_STEP = 60
"""Halvings of the distance between two samples down to its last digits."""
INTERVALS = 2000
"""Least number of intervals of a motion."""


def list_stretches(
    holds: Mask,
    places: Array,
    locate: Callable[[Indices, Array], Array] = lambda rows, ends: ends,
) -> list[Stretch]:
    """List from where and up to where a condition holds.

    Parameters
    ----------
    holds : (n,), at the places.
    locate : function of the rows after which the condition changes, and of the place
        beside each at which it holds; it returns better places.
    """
    rows = np.flatnonzero(holds[1:] != holds[:-1])
    ends = locate(rows, np.where(holds[rows], places[rows], places[rows + 1])).tolist()
    all_ends = [*[None] * int(holds[0]), *ends, *[None] * int(holds[-1])]
    return list(zip(all_ends[::2], all_ends[1::2], strict=True))


def states_single_positions(motion: Motion) -> bool:
    """Return True for a motion of angles or strokes with nothing between them."""
    moves = motion.law is not None or motion.free is not None
    return not moves and not isinstance(motion.angle, Sweep | None)


def follow(scene: Scene, solution: Solution) -> None:
    """Turn angles that follow, in place, to where the motion of the scene has them.

    An angle that follows is in (-pi, pi] at the first position of the motion and
    continuous from there, whichever positions of it are solved. Single positions have
    no motion.
    """
    if states_single_positions(scene.motion):
        return
    course = MotionCourse(scene, "position")
    order = np.argsort(course.places)
    between = np.searchsorted(course.places[order], solution.at.places)
    nearest = order[np.clip(between, 0, len(order) - 1)]
    for name in ("theta_2", *ANGLES):
        if name != solution.at.commanded:
            angles = solution[name]
            turns = np.rint((course.solution[name][nearest] - angles) / TURN)
            angles += TURN * np.nan_to_num(turns)


class MotionCourse:
    """Motion of a scene, of which any place can be solved.

    A scene that states single positions has the range that holds the first of them.

    `released`: solution of the scene's free motion, which is then not integrated again.

    `holds`: there are more places where it ceases to hold, at first where the linkage
    ceases to assemble.
    """

    def __init__(
        self,
        scene: Scene,
        stage: str,
        released: Solution | None = None,
        holds: Condition = lambda solution: solution.assembled,
    ) -> None:
        self.scene = scene
        self.stage = stage
        self.command_at = None if released is None else released.command_at
        """Function that returns the command of a free motion at other times."""
        if scene.motion.free is not None and self.command_at is None:
            released = solve(scene, "position")
            self.command_at = released.command_at
        self.released = released
        self.places = self._list_places()
        """Commanded angles or strokes, or times, in the order of the motion, (n,)."""
        self.even = self.places
        """Those of them that do not crowd where the condition ceases to hold."""
        self.solution = self.solve(self.places)
        """Solution at the places."""
        self._refine(holds)

    @property
    def commanded(self) -> str:
        """Name of the places: an angle, "stroke" or "time"."""
        if self.solution.time is None:
            return self.solution.commanded
        return "time"

    @property
    def span(self) -> float:
        """Distance of the first place from the last one."""
        return float(np.ptp(self.places))

    def command(self, places: Array) -> Command:
        """Return the command at some places of the motion."""
        if self.command_at is None:
            return command_at(self.scene, places)
        times, rows = np.unique(np.append(0.0, places), return_inverse=True)
        return self.command_at(times).part(rows[1:])

    def solve(self, places: Array) -> Solution:
        """Solve some places of the motion."""
        return solve(self.scene, self.stage, at=self.command(places))

    def _list_places(self) -> Array:
        """List the places that the scene states, with others between them."""
        motion = self.scene.motion
        if self.released is not None and motion.free is not None:
            stated = self.released.at.places
        elif states_single_positions(motion):
            first = float(command(self.scene).angle[0])
            stated = default_places(self.scene, first)
        else:
            stated = command(self.scene).places
        steps = len(stated) - 1
        parts = -(-INTERVALS // max(steps, 1))
        rows = np.linspace(0.0, steps, parts * steps + 1)
        places = np.interp(rows, np.arange(steps + 1), stated)
        if motion.law is not None:
            knots = np.array(motion.law.time)
            apart = np.abs(places[:, None] - knots).min(axis=1)
            places = np.union1d(places[apart > SAME_PLACE * np.ptp(places)], knots)
        return places

    def _refine(self, holds: Condition) -> None:
        """Add places where a condition ceases to hold."""
        held = holds(self.solution)
        rows = np.flatnonzero(held[1:] != held[:-1])
        if not rows.size:
            return
        before = held[rows]
        inside = np.where(before, self.places[rows], self.places[rows + 1])
        outside = np.where(before, self.places[rows + 1], self.places[rows])
        edge, _ = bisect(lambda places: holds(self.solve(places)), inside, outside)
        more = edge[:, None] + (inside - edge)[:, None] * LADDER
        places = np.unique(np.concatenate([self.places, more.ravel(), edge]))
        self.places = places if self.places[0] <= self.places[-1] else places[::-1]
        self.solution = self.solve(self.places)


def bisect(
    holds: Callable[[Array], Mask],
    low: Array,
    high: Array,
) -> tuple[Array, Array]:
    """Narrow each interval to two neighbours between which a condition ends.

    The condition holds at the lower end of each interval alone.
    """
    for _ in range(HALVINGS_OF_A_STEP):
        middle = 0.5 * (low + high)
        held = holds(middle)
        low = np.where(held, middle, low)
        high = np.where(held, high, middle)
    return low, high
