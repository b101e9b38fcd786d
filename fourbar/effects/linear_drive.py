"""A drive along the line between two points of two bars: a cylinder, a spindle, a linear actuator.

Per newton that it pushes its ends apart the bars get the unit vector of the line at one end, its opposite at the other.
The power of that over the speed of the independent angle q is ds/dq, s the stroke, and virtual work gives the force,
    F ds/dq = J q'' + J'/2 q'^2 - Q,
as it gives the torque on a bar k, where h_k stands for ds/dq. There is no force where
    P = (ds/dtheta_2) sin(theta_4 - theta_3) = 0,
which is of the same form, with (theta_2', theta_3', theta_4') = (sin(theta_4 - theta_3), (a/b) sin(theta_2 - theta_4),
(a/c) sin(theta_2 - theta_3)) for the coefficients h_k, and so is finite where these are not.
"""

from dataclasses import dataclass

import numpy as np

from fourbar.effects.effect import Actions
from fourbar.effects.spring import COINCIDE, SpringEnd, require_ends
from fourbar.errors import InputError
from fourbar.formulas.arithmetic import Number, is_any
from fourbar.formulas.motion import State
from fourbar.formulas.path import NO_DIGIT_LEFT
from fourbar.formulas.pin_forces import Body
from fourbar.linkage import ENDS, MOVING_BARS, PINS, FourBar
from fourbar.quantities import NO_DIRECTION, NO_LEVER, OK

MASSLESS = (Body(0.0, 0.0, 0.0j),) * 3


@dataclass(frozen=True, slots=True)
class LinearDrive:
    """A force along the line between two points, N, positive where it pushes them apart.

    Parameters
    ----------
    start, end : points on two different bars, one of them the ground perhaps.
    """

    start: SpringEnd
    end: SpringEnd

    def __post_init__(self) -> None:
        for name, point in zip(
            ("start", "end"), require_ends("drive", self.start, self.end), strict=True
        ):
            object.__setattr__(self, name, point)

    @property
    def ends(self) -> tuple[tuple[float, SpringEnd], tuple[float, SpringEnd]]:
        """Return both ends, each with the sense in which the drive pushes it along its line."""
        return (-1.0, self.start), (1.0, self.end)

    @property
    def apart(self) -> tuple[int, ...]:
        """Bars of which one may be left out so that the moments of the other two give the force between them.

        From the ground to bar 2 or 4 it is in the moment of that bar alone, as a couple is; else it is in any pair's.
        """
        bars = {self.start.bar, self.end.bar}
        return (*bars - {1},) if bars in ({1, 2}, {1, 4}) else MOVING_BARS

    def require_stroke(self, linkage: FourBar) -> None:
        """Raise InputError where no motion changes the distance of the ends, as where one bar holds both."""
        if common := _list_bars(linkage, self.start) & _list_bars(linkage, self.end):
            allowed = f"keeps its distance from `from` at every position: bar {min(common)} holds both"
            raise InputError(
                "drive.to", f"bar {self.end.bar} at {self.end.distance:g} m", allowed
            )

    def line(self, state: State) -> tuple[Number, Number]:
        """Compute the stroke, m, and the unit vector from `start` to `end`, no number where they coincide."""
        across = self.end.place(state) - self.start.place(state)
        stroke = np.abs(across)
        return stroke, across / stroke

    def gain(self, state: State) -> Number:
        """Compute ds/dq, m: the work of 1 N, whose parts between two bars that meet go by the turn at their pin."""
        return self.per_newton(Actions(state, MASSLESS)).work()[0]

    def act(self, actions: Actions, force: Number) -> None:
        """Push its ends apart."""
        actions.pull(self.end, self.start, force * self.line(actions.state)[1])

    def per_newton(self, actions: Actions) -> Actions:
        """Make what 1 N of it does to the bars."""
        single = Actions(actions.state, actions.bodies)
        self.act(single, 1.0)
        return single

    def leverage(self, state: State, sines: dict[int, Number]) -> tuple[Number, Number]:
        """Compute P and the most that it could be: L, the sum of what each end could move, m.

        That is r on bar 2, a + r a/b on bar 3, r a/c on bar 4, r its distance from the bar's first pin.

        `sines`: of theta_4 - theta_3, theta_4 - theta_2, theta_3 - theta_2, as of a drive on bar 2, 3, 4.
        """
        _, a, b, c, _, _ = state.lengths
        h2, h3, h4 = sines[2], (-a / b) * sines[3], (-a / c) * sines[4]
        turned = state._replace(
            k=state.k._replace(h2=h2, h3=h3, h4=h4, h23=h2 - h3, h43=h4 - h3)
        )
        reach = {1: (0.0, 0.0), 2: (0.0, 1.0), 3: (a, a / b), 4: (0.0, a / c)}
        most = sum(
            reach[p.bar][0] + reach[p.bar][1] * abs(p.distance) for _, p in self.ends
        )
        return self.gain(turned), most

    def status(self, state: State, sines: dict[int, Number]) -> Number:
        """Return NO_DIRECTION where the ends coincide, NO_LEVER where P lies within its rounding; None: nowhere.

        Places are rounded by the lengths over which they are reached, the line's direction by that over the stroke.
        """
        stroke, (lever, most) = self.line(state)[0], self.leverage(state, sines)
        away = (
            sum(state.lengths[:4]) + abs(self.start.distance) + abs(self.end.distance)
        )
        none, meet = (
            abs(lever) * stroke <= NO_DIGIT_LEFT * most * away,
            stroke <= COINCIDE * away,
        )
        if not is_any(none | meet):
            return None
        return np.where(meet, NO_DIRECTION, np.where(none, NO_LEVER, OK))


def _list_bars(linkage: FourBar, point: SpringEnd) -> set[int]:
    """List the bars that hold a point: its own, and at one of its pins the other one too."""
    length = linkage.lengths[point.bar - 1]
    places = zip({1: ("O2", "O4"), **ENDS}[point.bar], (0.0, length), strict=True)
    pins = [
        pin for pin, along in places if abs(point.in_bar - along) <= COINCIDE * length
    ]
    return {point.bar}.union(*(PINS[pin] for pin in pins))
