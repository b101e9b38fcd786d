"""External loads: a force at a point of a bar, or a couple on it.

A load is constant or a table over theta_2.
"""

import math
from dataclasses import KW_ONLY
from itertools import pairwise
from typing import Annotated, Any

import numpy as np

from fourbar.effects.effect import Actions, Effect
from fourbar.effects.place import Place, StatedPair
from fourbar.errors import InputError, LimitError
from fourbar.formulas.arithmetic import (
    PI_LOW,
    Number,
    angle,
    is_any,
    make_like,
    polar,
    split_sum,
)
from fourbar.formulas.longer import shorten
from fourbar.formulas.mobility import TURN
from fourbar.formulas.motion import State
from fourbar.linkage import (
    Declared,
    Described,
    FourBar,
    Listed,
    OfBar,
    OneOf,
    Part,
    Text,
    record,
)

_BEYOND_TURN = 2.0 * PI_LOW
"""2 pi less TURN, rad: what counts after many turns."""
FRAMES = ("world", "bar")
"""Axes in which the direction of a force is kept."""
PLACES_OF_LOADS = ("from_pin", "from_centre", "point", "arm")
"""Keys of which one says where a force acts."""


@record
class Table(Described):
    """Factor of a load over theta_2, linear between its points, modulo a turn.

    Parameters
    ----------
    theta_2 : rising angles over at most one turn, rad.
    factor : one for each angle; over a whole turn the last equals the first.
    """

    theta_2: Annotated[tuple[float, ...], Listed("rad")]
    factor: Annotated[tuple[float, ...], Listed("1")]
    stated_at = "loads.table"
    as_given = True
    """Error bars leave its numbers alone: they are looked up."""

    def __post_init__(self) -> None:
        Described.__post_init__(self)
        key = self.stated_at
        angles = self.theta_2
        factors = self.factor
        if len(angles) < 2 or len(angles) != len(factors):
            raise InputError(
                key,
                (len(angles), len(factors)),
                "needs two or more angles and as many factors",
            )
        if any(b <= a for a, b in pairwise(angles)):
            allowed = "must rise; a jump needs a second angle just beside the first"
            raise InputError(f"{key}.theta_2", angles, allowed, unit="rad")
        if angles[-1] - angles[0] > TURN and not self.covers_a_turn:
            allowed = "must not exceed one turn"
            raise InputError(f"{key}.theta_2", angles, allowed, unit="rad")
        if self.covers_a_turn and factors[0] != factors[-1]:
            raise InputError(
                f"{key}.factor",
                factors,
                "must end as it begins, since its ends are one turn apart: a jump there"
                " needs one more angle just inside",
            )

    @property
    def covers_a_turn(self) -> bool:
        """Return True if the table covers every angle."""
        return math.isclose(self.theta_2[-1] - self.theta_2[0], TURN, rel_tol=1e-12)

    def at(self, theta_2: Any) -> Any:
        """Interpolate the factor; InputError for a position outside the table.

        Between two points theta_2 is taken less the first of them and less whole turns:
        only the difference is rounded.
        """
        first = self.theta_2[0]
        wrapped = shorten(angle(polar(1.0, theta_2)))
        place = first + np.remainder(wrapped - first, TURN)
        place = self._require_covered(theta_2, place)
        piece = np.searchsorted(np.array(self.theta_2), place, "right") - 1
        piece = np.clip(piece, 0, len(self.theta_2) - 2)
        points = make_like(self.theta_2, theta_2)
        factors = make_like(self.factor, theta_2)
        start = points[piece]
        width = points[piece + 1] - points[piece]
        before = factors[piece]
        rise = factors[piece + 1] - factors[piece]
        away, lost = split_sum(theta_2, -start)
        rest = np.fmod(away, TURN)
        turns = np.rint((theta_2 - place) / TURN)
        turns_left = np.rint((away - rest) / TURN) - turns
        past = rest + turns_left * TURN + (lost - turns * _BEYOND_TURN)
        return before + rise * (past / width)

    def _require_covered(self, theta_2: Any, place: Any) -> Any:
        """Return the places of angles within a turn from the first.

        Raises InputError for one that the table does not cover.
        """
        first = self.theta_2[0]
        last = self.theta_2[-1]
        beyond = place > last + 1e-12 * TURN
        # a position just below the first angle has come round to a whole turn above it
        round_ = beyond & (first + TURN - place < 1e-12 * TURN)
        outside = beyond & ~round_
        if outside.any():
            there = self.replace_outside(np.extract(outside, theta_2))
            place = np.where(outside, there, place)
        return np.where(round_, first, place)

    def replace_outside(self, theta_2: Any) -> float:
        """Raise InputError for angles that the table does not cover.

        A table that states NaN there, in place of an error, returns NaN.
        """
        ends = np.degrees((self.theta_2[0], self.theta_2[-1]))
        bad = math.degrees(theta_2[0])
        allowed = (
            f"covers {ends[0]:.6g} to {ends[1]:.6g} deg; the position at {bad:.6g}"
            " deg lies outside: state a motion within, for equilibria a sweep"
        )
        raise InputError("loads.table.theta_2", None, allowed)


@record
class Load(Effect):
    """A force and a couple on a moving bar, at a place that turns with the bar.

    The force keeps its direction in the world's axes or turns with the bar too. Only
    the bending of the bar depends on where the couple acts.

    Parameters
    ----------
    bar : 2, 3 or 4.
    force : (magnitude, direction), N and rad, or None.
    from_pin : (distance, angle) from the bar's first pin (O2, A, O4) to where the force
        acts, m, the angle from the bar's line, rad.
    from_centre : likewise from the mass centre G; (0, 0), which is G itself, where the
        place of a force is left out. A couple alone without a place acts at the shafts
        O2 and O4 of bars 2 and 4, and at G of bar 3.
    point : name of the point of the scene at which the force acts.
    arm : (distance, angle) from G in world axes, m and rad: the force keeps its lever
        about G as the bar turns. In place of a place of the bar, for "world" alone.
    moment : couple, N m, counter-clockwise.
    frame : "world": the force's direction is from +x; "bar": from the bar's line.
    table : factor of force and couple over theta_2; None: constant.
    """

    bar: Annotated[int, OfBar()]
    force: Annotated[tuple[float, float] | None, Declared("N", pair="rad")] = None
    _: KW_ONLY
    from_pin: StatedPair = None
    from_centre: StatedPair = None
    point: Annotated[str | None, Text()] = None
    arm: StatedPair = None
    moment: Annotated[float, Declared("N m")] = 0.0
    frame: Annotated[str, OneOf(FRAMES)] = "world"
    table: Annotated[Table | None, Part(Table)] = None
    stated_at = "loads"
    key = "load"

    def __post_init__(self) -> None:
        Effect.__post_init__(self)
        forms = {
            name: value
            for name in PLACES_OF_LOADS
            if (value := getattr(self, name)) is not None
        }
        if len(forms) > 1:
            raise InputError(
                "loads",
                " and ".join(forms),
                "a load acts at one place: state one",
            )
        if self.arm is not None and self.force is None:
            allowed = "needs a force; a moment alone acts at from_pin or from_centre"
            raise InputError("loads.arm", None, allowed)
        if self.arm is not None and self.frame == "bar":
            allowed = (
                "is in world axes, for a force of fixed direction; where the force "
                "turns with the bar state from_pin or from_centre"
            )
            raise InputError("loads.arm", None, allowed)
        if not forms and self.force is not None:
            object.__setattr__(self, "from_centre", (0.0, 0.0))

    @property
    def place(self) -> Place | None:
        """Place of the load; None: its arm states it, or a couple alone has none."""
        forms = self.from_pin, self.from_centre, self.point
        return None if forms == (None, None, None) else Place(self.bar, *forms)

    def foot(self, G: Any) -> Any:
        """Return where the settled load acts from the bar's first pin, complex, m.

        The vector is in the bar's frame, as G is, from which an arm begins.
        """
        if (place := self.place) is not None:
            return place.vector()
        return G if self.arm is not None or self.bar == 3 else 0.0j

    def act(self, actions: Actions, state: State) -> None:
        """Add F at its place, and the couple."""
        factor = 1.0
        if self.table is not None:
            factor = self.table.at(state.theta_2)
        if self.force is not None:
            force = polar(*self.force)
            if self.frame == "bar":
                force = force * state.direction(self.bar)
            foot = self.foot(actions.bodies[self.bar - 2].z)
            beyond = None if self.arm is None else polar(*self.arm)
            actions.force(self.bar, factor * force, foot, beyond)
        if is_any(self.moment != 0.0):
            actions.couple(self.bar, factor * self.moment)

    def breaks(self, state: State) -> dict[str, Number]:
        """Return sin((theta_2 - corner)/2) for each corner of the table."""
        if self.table is None:
            return {}
        return {
            f"theta_2 = {corner!r}": np.sin(0.5 * (state.theta_2 - corner))
            for corner in self.table.theta_2
        }

    def add_to_mjcf(self, model: Any) -> None:
        """Add a constant actuator on a site (force) or on the bar (couple)."""
        if self.table is not None:
            raise LimitError(
                "a load that is a table over theta_2 has no counterpart in MJCF"
            )
        model.loads.append(self)

    def couple_on_drive(self, linkage: FourBar, speed: float) -> float:
        """Return the couple that the load may ask of the drive, N m.

        The greatest force, with its lever, acts at the longest bar; the couple counts
        over the bar's length. The load is a settled one.
        """
        bar = linkage.bar(self.bar)
        total = abs(self.moment) / bar.length
        if self.force is not None:
            reach = abs(bar.mass_centre[0])
            if self.arm is not None:
                reach += abs(self.arm[0])
            else:
                assert self.place is not None
                reach = abs(self.place.distance)
            total += abs(self.force[0]) * (1.0 + reach / bar.length)
        if self.table is not None:
            total *= max(map(abs, self.table.factor))
        return total * max(linkage.lengths)
