"""Base classes of effects, and the sums of what loads and effects apply to the bars."""

from collections.abc import Callable, Iterable, Mapping
from copy import copy
from dataclasses import fields
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from fourbar.effects.place import Placed
from fourbar.errors import InputError, LimitError, expect
from fourbar.formulas.arithmetic import Number, cross, is_any, polar, select
from fourbar.formulas.motion import State
from fourbar.formulas.pin_forces import Body, MovingBodies, PinForces, Wrenches
from fourbar.linkage import PINS, Declared, FourBar
from fourbar.quantities import Array, Codes, Signs

_PIN_OF_BARS = {frozenset(bars): pin for pin, bars in PINS.items()}
Joints = tuple[float, float, float]
"""Angles of pins O2, A, O4, rad."""
LARGEST_SLIP_AT_REST = 50.0 * 2.0**-52
"""Largest slip that counts as zero, relative to the sum of the input's coefficient and
of the two that it is the difference of; less is round-off.
"""


def list_bodies(linkage: FourBar, effects: Iterable[Any] = ()) -> MovingBodies:
    """List the inertial properties of bars 2, 3, 4.

    The inertia that effects add, such as that of a flywheel, is included.
    """
    bodies = [
        Body(bar.mass, bar.moment_of_inertia, polar(*bar.mass_centre))
        for bar in linkage.moving
    ]
    for effect in effects:
        for number, inertia in effect.added_inertia.items():
            body = bodies[number - 2]
            bodies[number - 2] = body._replace(I=body.I + inertia)
    two, three, four = bodies
    return two, three, four


def _add_to(sums: dict[Any, Any], key: Any, value: Any) -> None:
    """Add a value to the sum of a key; the first one is the sum."""
    if key in sums:
        sums[key] = sums[key] + value
    else:
        sums[key] = value


class Actions:
    """Sums over everything that acts on bars 2, 3, 4 apart from pins and inertia.

    An effect states what it does by `force`, `couple`, `pin_couple` and `pull`; what
    the drive has to balance is the generalized force of the sums. A force of 3 N that
    pulls up at pin A, the end of a level crank of 0.1 m:

    >>> from fourbar import uniform
    >>> from fourbar.formulas.path import compute_state
    >>> linkage = uniform(0.3, 0.1, 0.25, 0.22)
    >>> state = compute_state(linkage, theta_2=0.0, branch=1.0)
    >>> actions = Actions(state, list_bodies(linkage))
    >>> actions.force(2, 3.0j, point=0.1)
    >>> Q, _ = actions.generalized_forces()
    >>> round(float(Q), 12)
    0.3

    Parameters
    ----------
    state : positions and motion.
    bodies : of bars 2, 3, 4.
    impending : the sense in which pins at rest are about to turn: +1 as theta_2 grows,
        -1 as it falls, 0 neither; between them the part of its torque that dry friction
        holds them with.
    """

    def __init__(
        self, state: State, bodies: MovingBodies, impending: Number = 0
    ) -> None:
        self.state = state
        self.bodies = bodies
        self.impending = impending
        self.forces: dict[int, Any] = {}
        """Resultants of the bars on which any acts, complex, N."""
        self.moments: dict[int, Any] = {}
        """Moments about the first pins O2, A, O4, N m, without the couples between two
        bars.
        """
        self.on_coupler: list[tuple[Any, Any, Any, Any]] = []
        """Forces on the coupler with where they act, as in `force`, and moments."""
        self.couples: dict[str, Any] = {}
        """Couples between the two bars that meet at a pin, on the second of them, N m.
        """
        self.through: dict[str, Any] = {}
        """Forces between bars 2 and 3, and 3 and 4, on the second of them, complex, N.
        They act as if through the pin of the two bars.
        """

    def add(self, terms: Iterable[Any]) -> Self:
        """Add what loads and effects do, and return these sums.

        Couples that depend on the pin forces are left out.
        """
        for term in terms:
            term.act(self, self.state)
        return self

    def force(
        self,
        bar: int,
        force: Number,
        point: Number = 0.0j,
        beyond: Number = None,
    ) -> None:
        """Add a force (complex, N, world axes) on a bar; on the ground it does nothing.

        Parameters
        ----------
        point : of the bar's frame at its first pin, complex, m.
        beyond : vector from there to where the force acts, complex, m, world axes; left
            out: it acts there.
        """
        if bar == 1:
            return
        arm = point * self.state.direction(bar)
        if beyond is not None:
            arm = arm + beyond
        _add_to(self.forces, bar, force)
        self.moment_about_pin(bar, cross(-force, arm))
        if bar == 3:
            self.on_coupler.append((force, point, beyond, 0.0))

    def couple(self, bar: int, moment: Number) -> None:
        """Add a pure couple on a bar, N m; on the ground it does nothing."""
        self.moment_about_pin(bar, moment)
        if bar == 3:
            self.on_coupler.append((None, 0.0j, None, moment))

    def moment_about_pin(self, bar: int, moment: Number) -> None:
        """Add a moment about a bar's first pin."""
        _add_to(self.moments, bar, moment)

    def pin_couple(self, pin: str, couple: Number) -> None:
        """Add a couple on the second of the two bars at a pin, N m.

        The first bar gets the opposite couple.
        """
        _add_to(self.couples, pin, couple)

    def pull(self, start: Any, end: Any, force: Number) -> None:
        """Add a force at a point of a bar, and its opposite at one of another bar.

        The force is complex, N, in world axes. It acts along the line of the two
        points. Between bars that meet at a pin it goes through the pin and leaves a
        couple, by the arm of the point that is nearer to the pin; between moving bars
        it is in no sum of another bar.
        """
        pin = _PIN_OF_BARS.get(frozenset((start.bar, end.bar)))
        if pin is None:
            self.pull_ends(start, end, force)
            return
        first, second = PINS[pin]
        on_second = force if start.bar == second else -force
        arm_of_start, square_of_start = start.arm_from(pin, self.state)
        arm_of_end, square_of_end = end.arm_from(pin, self.state)
        to_start = arm_of_start * self.state.direction(start.bar)
        to_end = arm_of_end * self.state.direction(end.bar)
        couple = select(
            square_of_start < square_of_end,
            cross(-on_second, to_start),
            cross(-on_second, to_end),
        )
        self.pin_couple(pin, couple)
        if first == 1:  # the pin is the first one of the other bar
            self.force(second, on_second)
        else:
            _add_to(self.through, pin, on_second)

    def pull_ends(self, start: Any, end: Any, force: Number) -> None:
        """Add the two forces where they act."""
        for point, sense in ((start, 1.0), (end, -1.0)):
            self.force(point.bar, sense * force, point.in_bar)

    def plus(self, drive: Any, force: Number) -> "Actions":
        """Return the sum of these actions and those of a drive's force, N."""
        total = copy(self)
        for name, sums in vars(self).items():
            if isinstance(sums, (dict, list)):
                setattr(total, name, copy(sums))
        drive.act(total, force)
        return total

    def generalized_forces(self) -> tuple[Number, Number]:
        """Compute the generalized force Q of all bars, and of bars 3 and 4, N m.

        Q is the power over the speed of the independent angle. That of bars 3 and 4 is
        without what goes through pin A.
        """
        k = self.state.k
        parts = []
        if 3 in self.moments:
            parts.append(self.moments[3] * k.h3)
        if 4 in self.moments:
            parts.append(self.moments[4] * k.h4)
        if 3 in self.forces:
            weighted = -self.state.lengths.a * k.h2 * self.forces[3]
            parts.append(cross(weighted, self.state.position.u2))
        others = sum(parts[1:], parts[0]) if parts else 0.0
        total = others + self.moments[2] * k.h2 if 2 in self.moments else others
        for pin, couple in self.couples.items():
            slip = self.state.slip(pin)
            total = total + couple * slip
            if pin == "A":
                others = others + couple * k.h3
            elif pin != "O2":
                others = others + couple * slip
        return total, others

    def about_B(self) -> Number:
        """Compute the moment on the coupler about pin B, N m.

        Forces that act near B give a small moment, which keeps its digits.
        """
        total = self.couples.get("A", 0.0) - self.couples.get("B", 0.0)
        for force, point, beyond, moment in self.on_coupler:
            total = total + moment
            if force is not None:
                arm = (point - self.state.lengths.b) * self.state.position.u3
                if beyond is not None:
                    arm = arm + beyond
                total = total + cross(-force, arm)
        return total

    def sense(self, pin: str) -> Number:
        """Return the sign of omega_j - omega_i at a pin.

        At rest it is the sign of the impending motion. A linkage at rest begins to move
        as theta_2 grows or falls; a pin that is at rest in a linkage that moves turns
        in either sense.
        """
        slip = self.state.slip(pin)
        speed = self.state.speed
        turning = self.turning(pin)
        in_motion = np.sign(slip * speed)
        if not is_any(self.impending != 0):
            return turning * in_motion
        in_motion = np.where(turning, in_motion, self.impending)
        at_rest = self.impending * turning * np.sign(slip)
        return np.where(np.equal(speed, 0.0), at_rest, in_motion)

    def turning(self, pin: str) -> Number:
        """Mark where two bars rotate relative to each other.

        Relative rotation within round-off does not count.
        """
        i, j = PINS[pin]
        h = self.state.coefficient
        sizes = abs(h(2)) + abs(h(i)) + abs(h(j))
        return abs(self.state.slip(pin)) > LARGEST_SLIP_AT_REST * sizes

    def wrenches(self, inertia: Wrenches) -> Wrenches:
        """Sum everything that acts on each bar.

        D'Alembert's forces and moments are included.
        """
        R2, R3, R4, M2, M3, M4, _ = inertia
        R = {2: R2, 3: R3, 4: R4}
        M = {2: M2, 3: M3, 4: M4}
        for bar, force in self.forces.items():
            _add_to(R, bar, force)
        for bar, moment in self.moments.items():
            _add_to(M, bar, moment)
        for pin, couple in self.couples.items():
            i, j = PINS[pin]
            if pin != "B":  # its couple is a field of the wrenches
                _add_to(M, j, couple)
                if i != 1:
                    _add_to(M, i, -couple)
        at_B = self.couples.get("B", 0.0)
        return Wrenches(R[2], R[3], R[4], M[2], M[3], M[4], at_B)

    def at_pins(self, pins: PinForces) -> PinForces:
        """Return what the pins themselves carry of the forces between their bars."""
        if not self.through:
            return pins
        A = self.through.get("A", 0.0)
        B = self.through.get("B", 0.0)
        return pins._replace(F32=pins.F32 + A, F43=pins.F43 + B)


class SolvedFriction(NamedTuple):
    """Pin forces with the friction that they make."""

    pins: PinForces
    from_jamming: Any = 1.0
    """Distance of the friction from jamming, in (0, 1]."""
    residual: Any = 0.0
    """Largest |mu r |F| - couple| that remains, N m."""
    status: Any = None


class Effect(Placed):
    """Base class of an effect: what it does to the bars, and where it has no value."""

    __slots__ = ()
    stated_at = "effects.{0.key}"
    key: ClassVar[str]
    """Name of the effect under ``[effects]`` and in every table."""
    example: ClassVar[str] = ""
    """One line of a scene file."""
    dry: ClassVar[bool] = False
    """True if the couples jump where the relative rotation at a pin reverses."""

    counts_turns: ClassVar[bool] = False
    """True if the effect depends on where the motion began (`begin_at`)."""
    in_balls: ClassVar[bool] = False
    """True if the reference in ball arithmetic has a model of it."""
    joint_elements: ClassVar[Mapping[str, str]] = {}
    """Elements of an SDF joint that state its number, by reader ("gazebo", "drake")."""

    @classmethod
    def draw(cls, rng: "np.random.Generator", couple: float) -> Self | None:
        """Draw an effect for a random scene, about as strong as a couple, N m.

        None: random scenes have none.
        """
        return None

    def add_to_mjcf(self, model: Any) -> None:
        """Add the effect to an MJCF; LimitError where it has no counterpart."""
        raise LimitError(f"the effect {self.key!r} has no counterpart in MJCF")

    def couple_on_drive(self, linkage: FourBar, speed: float) -> float:
        """Return the couple that the effect may ask of the drive at a speed, N m.

        The flywheel of an MJCF is laid out for this couple. `speed`: rad/s.
        """
        return 0.0

    def list_wound(self, state: State, branch: Number) -> dict[str, Number]:
        """List where each pin is wound too far for the effect to have a value, (n,)."""
        return {}

    def unwind(self, linkage: FourBar, q: Joints) -> Joints:
        """Move the angles of pins O2, A, O4 by the whole turns that count, rad."""
        return q

    def act_on_engine(self, bars: Any) -> None:
        """Apply the effect to an engine's bars, from the engine's own motion.

        The code is a second derivation and uses nothing of `act`.

        `bars`: of `engines.loaded.Loaded`, with `push`, `couple`, `angle`, `velocity`,
        `alpha`, `rotate`, `first_pin`, `locate`, `end`, `pin_loads`.
        """
        raise NotImplementedError

    def act_on_free_bodies(self, motion: Any, wrenches: Any) -> None:
        """Apply the effect to the free bodies, from their own motion.

        The code is a second derivation. `motion`, `wrenches`: of
        `engines.free_body`.
        """
        raise NotImplementedError

    def size(self, linkage: FourBar, solution: Any) -> Any:
        """Return the size at which forces of the effect count as zero, N.

        One number or (n,) is returned. The harness asks for it before every comparison,
        of effects that are not part of the package. Effects of the package leave it
        out: the harness states their sizes itself, in
        `fourbar_validation/compare/effect_sizes.py`.
        """
        raise NotImplementedError

    @property
    def loaded_pins(self) -> tuple[str, ...]:
        """Pins on whose forces the effect itself depends."""
        return ()

    @property
    def added_inertia(self) -> Mapping[int, Number]:
        """Inertia that turns with bar 2, 3 or 4, kg m^2, by its number."""
        return {}

    @property
    def dry_pins(self) -> tuple[str, ...]:
        """Pins at which couples of the effect jump."""
        return ()

    def act(self, actions: Actions, state: State) -> None:
        """Add forces and couples of the effect on the bars; its places are settled."""

    def solve_friction(
        self,
        actions: Actions,
        pins: PinForces,
        solve_pin_forces: Callable[..., PinForces],
    ) -> SolvedFriction:
        """Solve for what depends on the pin forces, and add it to the actions.

        Only effects with `loaded_pins` are asked.

        `pins`: pin forces under the actions, without it. `solve_pin_forces`: solves for
        those under some actions, and under inertia if `with_inertia`.
        """
        raise NotImplementedError

    def act_known(self, actions: Actions, forces: Mapping[str, Array]) -> None:
        """Add what `act` leaves to the solution of the pin forces.

        `forces`: solved pin forces by name, (n, 2), N.
        """

    def breaks(self, state: State) -> dict[str, Number]:
        """Return functions of the motion, (n,), at whose zeros forces jump or bend.

        Each function passes smoothly through zero there, as the slip of a pin with dry
        friction does, or the length of a spring less the length at which it goes slack.
        Peaks, means and energies of a motion are found on panels that end at the zeros.
        A slip has the name of its pin; other names tell one function from another,
        within all effects.
        """
        return {pin: state.slip(pin) * state.speed for pin in self.dry_pins}

    def begin_at(self, start: State, branch: Number) -> Self:
        """Return the effect in a motion that begins at this position and branch."""
        return self

    def status(
        self,
        state: State,
        branch: Signs | None,
    ) -> Codes | None:
        """Return status codes, (n,): other than `OK` where the effect has no value.

        None: it has a value everywhere.
        """
        return None


class PinRows(Effect):
    """An effect whose first field holds rows (pin, number, ...), in the pins' order.

    The one number that a pin has is called "".
    """

    __slots__ = ()

    @classmethod
    def at(cls, **values: Any) -> Self:
        """Make the effect from the numbers of each pin.

        Examples are ``Viscous.at(O2=0.01)`` and ``PinFriction.at(A=(mu, radius))``.
        """
        rows = []
        for pin, value in values.items():
            numbers = value if isinstance(value, (tuple, list)) else (value,)
            rows.append((pin, *numbers))
        return cls(tuple(rows))  # type: ignore[call-arg]

    @property
    def field(self) -> str:
        """Name of the field that holds the rows."""
        return fields(self)[0].name  # type: ignore[arg-type]

    @property
    def rows(self) -> tuple[tuple[Any, ...], ...]:
        """Rows (pin, number, ...)."""
        return getattr(self, self.field)  # type: ignore[no-any-return]

    def __post_init__(self) -> None:
        key = f"effects.{self.key}"
        numbers = self.numbers
        expect(key, self.rows, tuple, list)
        by_pin: dict[str, tuple[Any, ...]] = {}
        for row in self.rows:
            is_row = isinstance(row, (tuple, list)) and len(row) == 1 + len(numbers)
            if not is_row or not isinstance(row[0], str):
                named = ", ".join(name or "value" for name in numbers)
                raise InputError(key, row, f"must be (pin, {named})")
            pin, *values = row
            if pin not in PINS or pin in by_pin:
                reason = f"the pins are {', '.join(PINS)}, each once"
                raise InputError(f"{key}.{pin}", row[1:], reason)
            paths = (f"{key}.{pin}.{name}".rstrip(".") for name in numbers)
            by_pin[pin] = (pin, *map(Declared.check, numbers.values(), paths, values))
        in_order = tuple(by_pin[pin] for pin in PINS if pin in by_pin)
        object.__setattr__(self, self.field, in_order)
