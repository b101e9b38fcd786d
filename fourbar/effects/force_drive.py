"""Drives that exert a force instead of a couple: along a line, or at a point.

Per newton of the drive the bars get unit vectors at its points. The power of that over
the speed of the independent angle q is ds/dq, and virtual work gives the force,
    F ds/dq = J q'' + J'/2 q'^2 - Q,
as it gives the torque on a bar k, where h_k stands for ds/dq. There is no force where
    P = (ds/dtheta_2) sin(theta_4 - theta_3) = 0,
which is of the same form, with
    theta_2' = sin(theta_4 - theta_3),
    theta_3' = (a/b) sin(theta_2 - theta_4),
    theta_4' = (a/c) sin(theta_2 - theta_3)
for the coefficients h_k, and so is finite where these are not.
"""

from abc import ABC, abstractmethod
from typing import Annotated, Any

import numpy as np

from fourbar.effects.effect import Actions
from fourbar.effects.load import FRAMES
from fourbar.effects.place import COINCIDENT_POINTS, At, Line, Place, Placed
from fourbar.errors import InputError, write_in_units
from fourbar.formulas.arithmetic import Number, is_any, polar
from fourbar.formulas.motion import State
from fourbar.formulas.path import NO_DIGIT_LEFT, LoopPath
from fourbar.formulas.pin_forces import Body
from fourbar.linkage import ENDS, MOVING_BARS, PINS, Declared, FourBar, OneOf, record
from fourbar.quantities import LINE, NO_DIRECTION, NO_LEVER, OK

MASSLESS = (Body(0.0, 0.0, 0.0j),) * 3


class ForceDrive(Placed, ABC):
    """A drive that exerts a force, N; a subclass says where and in which direction."""

    __slots__ = ()
    stated_at = "drive"
    names = LINE
    has_stroke = False
    """True if the drive is between two points, whose distance is its stroke."""

    @property
    @abstractmethod
    def ends(self) -> tuple[tuple[float, Place], ...]:
        """Places at which the drive acts, each with the sense of its force there.

        The sense is along the drive's direction.
        """

    @property
    def may_be_left_out(self) -> tuple[int, ...]:
        """Return the bars of which one may be left out.

        The moments of the other two then give the force between them. What the ground
        exerts on bar 2 or 4 is in the moment of that bar alone, as a couple is; all
        else is in any pair's.
        """
        moving = {place.bar for _, place in self.ends} - {1}
        return (*moving,) if moving in ({2}, {4}) else MOVING_BARS

    def require_motion(self, linkage: FourBar) -> None:
        """Raise InputError if one bar holds both ends, or the ground the only one.

        The drive then does no work at any position.
        """
        held = [_list_bars(linkage, place) for _, place in self.ends]
        if common := held[0].intersection(held[1] if self.has_stroke else {1}):
            _, last = self.ends[-1]
            raise InputError(
                "drive.to" if self.has_stroke else "drive",
                f"bar {last.bar} at {write_in_units('m', last.distance)}",
                f"does no work at any position: bar {min(common)} holds what it moves",
            )

    @abstractmethod
    def line(self, state: State) -> tuple[Any, Number]:
        """Compute the stroke, m (None: there is none), and the force's unit vector."""

    @abstractmethod
    def act(self, actions: Actions, force: Number) -> None:
        """Exert a force, N."""

    def reach(self, state: State) -> Number:
        """Return the path from one end to the other, m; 1 for a drive at one place."""
        return 1.0

    def status(self, state: State, path: LoopPath) -> Number:
        """Return NO_DIRECTION where the ends coincide, NO_LEVER where P vanishes.

        P vanishes within its rounding. None: there is no such position. Places are
        rounded by the lengths over which they are reached, the line's direction by that
        over the stroke.
        """
        stroke, _ = self.line(state)
        distance = 1.0 if stroke is None else stroke
        lever, most = self.leverage(state, path)
        away = self.reach(state)
        without_lever = abs(lever) * distance <= NO_DIGIT_LEFT * most * away
        coincide = distance <= COINCIDENT_POINTS * away
        if not is_any(without_lever | coincide):
            return None
        status = np.where(without_lever, NO_LEVER, OK)
        return np.where(coincide, NO_DIRECTION, status)

    def gain(self, state: State) -> Number:
        """Compute ds/dq, m: the work of 1 N per change of the independent angle."""
        single = Actions(state, MASSLESS)
        self.act(single, 1.0)
        return single.generalized_forces()[0]

    def leverage(self, state: State, path: LoopPath) -> tuple[Number, Number]:
        """Compute P and L, the largest value that P could have.

        L is the sum of what each end could move, m: r on bar 2, a + r a/b on bar 3, r
        a/c on bar 4, with r the end's distance from the bar's first pin.
        """
        _, a, b, c, _, _ = state.lengths
        h2, s3, s4 = (path.drive_sine(state.position, bar) for bar in MOVING_BARS)
        h3 = (-a / b) * s3
        h4 = (-a / c) * s4
        k = state.k._replace(h2=h2, h3=h3, h4=h4, h23=h2 - h3, h43=h4 - h3)
        # largest sines of the first pin and, per distance from it, of the bar
        of_pin = {1: 0.0, 2: 0.0, 3: a, 4: 0.0}
        per_distance = {1: 0.0, 2: 1.0, 3: a / b, 4: a / c}
        most = sum(
            of_pin[place.bar] + per_distance[place.bar] * abs(place.distance)
            for _, place in self.ends
        )
        return self.gain(state._replace(k=k)), most


def _list_bars(linkage: FourBar, point: Place) -> set[int]:
    """List the bars that hold a point: its own, and at a pin the other bar there."""
    length = linkage.lengths[point.bar - 1]
    nothing = COINCIDENT_POINTS * length
    bars = {point.bar}
    for pin, along in zip(ENDS[point.bar], (0.0, length), strict=True):
        if abs(point.in_bar - along) <= nothing:
            bars.update(PINS[pin])
    return bars


@record
class LinearDrive(Line, ForceDrive):
    """A force along the line between two points, as of a cylinder.

    The force is in N, positive where it pushes.

    Parameters
    ----------
    start, end : points on two different bars, one of them the ground perhaps.
    """

    start: Annotated[Place, At("from")]
    end: Annotated[Place, At("to")]
    has_stroke = True

    @property
    def ends(self) -> tuple[tuple[float, Place], ...]:
        """Return both ends, each with the sense in which the drive pushes it."""
        return (-1.0, self.start), (1.0, self.end)

    @property
    def may_be_commanded(self) -> bool:
        """Return True if the stroke turns bar 2 or 4, as between it and the ground."""
        return {self.start.bar, self.end.bar} in ({1, 2}, {1, 4})

    def line(self, state: State) -> tuple[Number, Number]:
        """Compute the stroke, m, and the unit vector from `start` to `end`.

        The vector is NaN where they coincide.
        """
        across = self.across(state)
        stroke = np.abs(across)
        return stroke, across / stroke

    def act(self, actions: Actions, force: Number) -> None:
        """Push the ends of the drive apart."""
        _, direction = self.line(actions.state)
        actions.pull(self.end, self.start, force * direction)


@record
class PointDrive(ForceDrive):
    """A force at a place of bar 2, 3 or 4 in a direction, N, positive along it.

    A hand on a lid and the handle of pliers are examples. ds/dq is the component in the
    direction of the point's derivative by the independent angle.

    Parameters
    ----------
    place : where the force acts, which turns with its bar.
    direction : angle of the force, rad.
    frame : "world": the direction is from +x; "bar": from the bar's line, and turns
        with it.
    """

    place: Annotated[Place, At(bars=MOVING_BARS, is_value=True)]
    direction: Annotated[float, Declared("rad")]
    frame: Annotated[str, OneOf(FRAMES)] = "world"

    @property
    def ends(self) -> tuple[tuple[float, Place], ...]:
        """Return the place, along the direction."""
        return ((1.0, self.place),)

    def line(self, state: State) -> tuple[None, Number]:
        """Return no stroke, and the unit vector of the direction in world axes."""
        unit = polar(1.0, self.direction)
        if self.frame == "bar":
            return None, unit * state.direction(self.place.bar)
        return None, unit + 0.0 * state.direction(self.place.bar)

    def act(self, actions: Actions, force: Number) -> None:
        """Push the point of the drive."""
        _, direction = self.line(actions.state)
        actions.force(self.place.bar, force * direction, self.place.in_bar)
