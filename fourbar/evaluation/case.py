"""A scene as the numbers of the formulas, and its forces under all that acts."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fourbar.effects.effect import Actions, SolvedFriction, list_bodies
from fourbar.formulas.arithmetic import U, angle, is_any, select
from fourbar.formulas.longer import change_numbers, lengthen, take_doubles
from fourbar.formulas.motion import Coefficients, State, rates
from fourbar.formulas.path import LoopPath, prepare_path
from fourbar.formulas.pin_forces import (
    MovingBodies,
    PinForces,
    Wrenches,
    about_first_pin,
    coupler_about_B,
    inertia_wrenches,
    pin_forces,
)
from fourbar.formulas.position import HalfAngle, Loop, Passing
from fourbar.formulas.torque import driving_torque, half_slope, inertia
from fourbar.linkage import MOVING_BARS, FourBar
from fourbar.quantities import COUPLE, JAMMED, DriveNames, Indices
from fourbar.scene import Command, Scene

if TYPE_CHECKING:
    from fourbar.effects import Effect, ForceDrive


POSITIONS_OF_A_BLOCK = 8000
"""Positions evaluated at a time, measured: fewer pay for calls, more leave the cache.
Of 8192 an array of complex numbers is a little more than the C library hands out again
without asking the system for fresh pages, and from 10 000 on OpenBLAS starts threads
for the squares by which `withhold_infinite` looks for what is no number.
"""
NEEDS_DIGITS = 32.0 * U
"""A factor of Heron's formula smaller than this times the square of the sum of the
lengths is evaluated in many digits: in doubles it is wrong by at most about 24 U times
that, and one within 4 U of it is a limit.
"""
LARGEST_PERTURBATION = 1e-3
"""Part of the sum of the lengths: a member of a study that misses a change point of the
nominal linkage by more is a linkage of its own.
"""
_NO_MOTION = Coefficients(*[np.nan] * 8)
"""Coefficients of NaN, used where only positions are evaluated."""


class Couple(NamedTuple):
    """Drive that exerts a couple on a bar, as a `ForceDrive` exerts a force."""

    bar: int
    names: DriveNames = COUPLE

    @property
    def may_be_left_out(self) -> tuple[int, ...]:
        """Bar whose moment alone has the couple."""
        return (self.bar,)

    def gain(self, state: State) -> Any:
        """Return h of the bar, the work of 1 N m per change of the angle."""
        return state.k[self.bar - 2]

    def leverage(self, state: State, path: LoopPath) -> tuple[Any, float]:
        """Compute the sine between the two other bars, and its largest value."""
        return path.drive_sine(state.position, self.bar), 1.0

    def status(self, state: State, path: LoopPath) -> None:
        """Return None: a couple has a direction and a lever everywhere."""


class Dynamics(NamedTuple):
    """Pin forces and effort of the drive under everything that acts."""

    pins: PinForces
    from_jamming: Any
    """Field of the same name of `SolvedFriction`, as `residual` and `status` are."""
    residual: Any
    status: Any
    effort: Any
    """Torque of the drive, N m, or its force, N."""
    generalized_force: Any
    """Generalized force of the drive, its power over the commanded angle's speed, N m.
    It has no pole where the driven bar rests.
    """


PlacedPoint = tuple[str, int, Any]
"""Name, bar, and place in the bar's frame from its first pin, complex, m."""


class Case(NamedTuple):
    """A scene in the numbers of the formulas.

    A case is made once for all positions of a command; `at` closes the loop at them,
    and `dynamics` computes pin forces and the effort of the drive.

    >>> from fourbar import Motion, Scene, Sweep, command, uniform
    >>> motion = Motion(theta_2=Sweep("30 deg", "90 deg", 3), omega_2="100 rpm")
    >>> scene = Scene(uniform(0.3, 0.1, 0.25, 0.22, per_metre=2.0), motion)
    >>> at = command(scene)
    >>> case = Case.of(scene)
    >>> state = case.at(at)
    >>> dynamics = case.dynamics(state)
    >>> dynamics.effort.round(4)
    array([-0.1207,  0.2423,  0.2899,  0.1913])
    """

    linkage: FourBar
    lengths: Loop
    bodies: MovingBodies
    terms: "tuple[Effect, ...]"
    """Loads and effects, each a term of what acts; their places are settled."""
    drive: "Couple | ForceDrive"
    path: LoopPath
    """Loop in the order of the commanded bar, whose lengths are in a unit of its own.
    `lengths` are in the usual order, m.
    """
    points: tuple[PlacedPoint, ...]
    """Pins A and B, mass centres, and points of the scene."""
    impending: Any = 0
    """Impending direction of rotation at pins at rest. Or the fraction of its torque
    with which friction holds them.
    """

    @classmethod
    def of(cls, scene: Scene, bar: int = 2, impending: Any = 0) -> "Case":
        """Collect the numbers that stay the same over the positions of a command.

        The command is that of bar 2, 3 or 4.
        """
        scene = scene.settled()
        points = [(one.name, one.bar, one.place.vector()) for one in scene.points]
        terms = (*scene.loads, *scene.effects)
        drive = scene.drive or Couple(scene.drive_bar)
        return cls._collect(scene.linkage, terms, drive, bar, points, impending)

    @classmethod
    def _collect(
        cls,
        linkage: FourBar,
        terms: Any,
        drive: Any,
        bar: int,
        points: Iterable[PlacedPoint],
        impending: Any,
    ) -> "Case":
        """Collect what follows from a linkage and what acts on it."""
        path = prepare_path(linkage.lengths, linkage.ground_angle, bar)
        square = path.unit * path.unit
        E1 = path.lengths.E1 * square
        E2 = path.lengths.E2 * square
        lengths = Loop(*linkage.lengths, E1, E2)
        bodies = list_bodies(linkage, terms)
        pins = ("A", 2, lengths.a), ("B", 4, lengths.c)
        centres = ((f"G{bar}", bar, bodies[bar - 2].z) for bar in MOVING_BARS)
        points = (*pins, *centres, *points)
        return cls(linkage, lengths, bodies, terms, drive, path, points, impending)

    def beside(self, nominal: Scene) -> "Case":
        """Return the case of members near a nominal linkage.

        At each position the assembly is the nearest to that of the nominal linkage. Of
        a nominal linkage with a change point a root changes its sign there. A member
        that misses this change point by less than a perturbation keeps that sign, so
        that it lies beside the nominal one on either side.
        """
        of_nominal = prepare_path(nominal.linkage.lengths, 0.0, self.path.bar).passing
        d, a, b, c, E1, E2 = self.path.lengths
        small = LARGEST_PERTURBATION * (d + a + b + c) ** 2
        of_member = self.path.passing
        passing = Passing(
            of_member.outer | (of_nominal.outer & (abs(E1) <= small)),
            of_member.inner | (of_nominal.inner & (abs(E2) <= small)),
        )
        return self._replace(path=self.path._replace(passing=passing))

    def lengthened(self) -> "Case":
        """Return the case in longer numbers, with all that follows from the scene."""
        linkage, terms, drive = change_numbers(
            (self.linkage, self.terms, self.drive), lengthen
        )
        bar = self.path.bar
        longer = self._collect(linkage, terms, drive, bar, (), self.impending)
        return longer._replace(path=longer.path._replace(passing=self.path.passing))

    def drive_speed(self, state: State) -> Any:
        """Compute the speed of the driven bar, rad/s, or of the stroke, m/s."""
        return self.drive.gain(state) * state.speed

    def drive_condition(self, state: State) -> Any:
        """Compute the drive's leverage over the largest possible one, in [0, 1]."""
        lever, most = self.drive.leverage(state, self.path)
        return abs(lever) / most

    def assemble(
        self,
        at: Command,
        half: HalfAngle,
        *,
        moving: bool = True,
    ) -> State:
        """Return the state at each position of a command: positions and motion.

        Parameters
        ----------
        half : half angles of the command's angles, from `half_angle` or, in longer
            numbers, from `decide_half_angles`.
        moving : False: positions only.
        """
        path = self.path
        q = at.angle
        speed: Any = 0.0
        acceleration: Any = 0.0
        branch: Any = at.branch
        if branch.ndim == 0 or (branch.size and branch.min() == branch.max()):
            branch = float(branch.flat[0])  # the formulas are quicker with one number
        if moving:
            acceleration = at.acceleration
            if at.speed is not None:
                speed = at.speed
            position, k, sine = path.close(
                q,
                half,
                branch,
                condition=at.condition,
                margin=at.margin,
            )
        else:
            position = path.position(q, half, branch)
            k = _NO_MOTION
            sine = position.sin_mu  # before the bars are put in order
            position = path.in_order(position)
        return State(
            self.lengths,
            self.linkage.ground_angle,
            q if path.bar == 2 else angle(position.u2),
            position,
            k,
            speed,
            rates(k, speed, acceleration),
            path.bar,
            q,
            sine,
            path.passing,
            acceleration,
        )

    def at(self, at: Command) -> State:
        """Compute the positions of a command, and their motion."""
        half, _ = self.half_angle(at)
        return self.assemble(at, half)

    def begin_with(self, motion: Command) -> "Case":
        """Return a copy whose path-dependent effects begin where a motion assembles.

        A study has a motion for each linkage, (m, n), which begins where that linkage
        first assembles. The case is returned as it is if the motion assembles nowhere
        or changes its branch.
        """
        half, _ = self.half_angle(motion)
        assembled = (half.outer >= 0.0) & (half.inner >= 0.0)
        if not assembled.any() or np.ptp(motion.branch) != 0:
            return self
        first = np.argmax(assembled, axis=-1)
        if first.ndim == 0:
            start = motion.part(int(first))._replace(speed=0.0, acceleration=0.0)
        else:
            angle = np.take_along_axis(motion.angle, first[:, None], axis=1)
            start = Command(angle, motion.branch[:, :1], 0.0, 0.0, motion.bar)
        state = self.at(start)
        return self._replace(
            terms=tuple(term.begin_at(state, start.branch) for term in self.terms)
        )

    def half_angle(self, at: Command) -> tuple[HalfAngle, Indices]:
        """Compute the half angles, and the indices of those in many digits."""
        q = at.angle
        remainder = at.remainder
        lengths = self.path.lengths
        half = self.path.half_angle(q)
        close: Any = remainder is not None
        if remainder is None:
            factors = ((half.outer, lengths.E1), (half.inner, lengths.E2))
            small = NEEDS_DIGITS * (lengths.a + lengths.b + lengths.c + lengths.d) ** 2
            for factor, constant in factors:
                # a sum of positive terms loses nothing
                if is_any(constant < 0.0):
                    close = close | ((constant < 0.0) & (abs(factor) < small))
        if not is_any(close):
            return half, np.empty(0, dtype=np.intp)
        from fourbar.formulas.many_digits import decide_half_angles

        index = np.flatnonzero(np.broadcast_to(close, np.shape(q)))
        decided = decide_half_angles(self.linkage, self.path, half, index, q, remainder)
        return decided, index

    def _compute_inertial_forces(self, state: State, sine: Any) -> "_InertialForces":
        """Compute d'Alembert's forces and moments, and their generalized force.

        `sine`: of theta_3 - theta_2 if the moment about pin B is wanted, otherwise
        None.
        """
        a = self.lengths.a
        position = state.position
        k = state.k
        acceleration = state.q_acceleration
        square = state.speed * state.speed
        wrenches, mass_at_A = inertia_wrenches(a, self.bodies, position, state.moving)
        inertial = others = half_slope(a, self.bodies, position, k) * square
        if is_any(acceleration != 0.0):
            of_input, of_others = inertia(a, self.bodies, position, k)
            others = others + of_others * acceleration
            inertial = others + of_input * acceleration
        if self.path.bar != 2:  # half_slope has bar 2 in it then
            others = (
                others - (about_first_pin(self.bodies[0]) * (k.h2 * k.dh2)) * square
            )
        about_B = 0.0
        if sine is not None:
            three = self.bodies[1]
            about_B = coupler_about_B(self.lengths, three, position, state.moving, sine)
        return _InertialForces(inertial, others, wrenches, mass_at_A, about_B)

    def dynamics(self, state: State) -> Dynamics:
        """Compute pin forces and the drive under everything that acts."""
        actions = Actions(state, self.bodies, self.impending).add(self.terms)
        gain = self.drive.gain(state)
        sines = {
            bar: self.path.drive_sine(state.position, bar)
            for bar in self.drive.may_be_left_out
        }
        inertial = self._compute_inertial_forces(state, sines.get(4))
        free_bodies = _FreeBodies(state, inertial, sines, self.drive, gain)
        friction = SolvedFriction(free_bodies.solve_pin_forces(actions))
        # a scene holds one effect of a kind, and one kind depends on the forces
        for term in self.terms:
            if term.loaded_pins:
                friction = term.solve_friction(
                    actions,
                    friction.pins,
                    free_bodies.solve_pin_forces,
                )
        Q = actions.generalized_forces()[0]
        effort = driving_torque(gain, inertial.total, Q)
        return Dynamics(*friction, effort, inertial.total - Q)

    def drive_interval(self, state: State, effort: Any) -> tuple[Any, Any, Any]:
        """Compute the least and greatest torque (N m) or force (N) of the drive, (n,).

        Both are equal unless dry friction holds a pin at rest. The third value, (n,),
        is `JAMMED` where one of them is NaN because friction jams the motion that would
        begin, else 0; None: it jams nowhere. `effort`: that with friction at rest as 0.
        The ends are those at which the linkage would begin to move forwards or
        backwards, or, where only a pin comes to rest while the linkage moves, those
        just before and after its reversal.
        """
        actions = Actions(state, self.bodies)
        dry_pins = {pin for term in self.terms for pin in term.dry_pins}
        # where the loop does not close nothing rests
        all_turn = all(
            np.all(actions.turning(pin) | np.isnan(take_doubles(state.slip(pin))))
            for pin in dry_pins
        )
        if np.all(state.speed) and all_turn:
            return effort, effort, None
        ahead = self._replace(impending=1).dynamics(state)
        back = self._replace(impending=-1).dynamics(state)
        low = np.minimum(ahead.effort, back.effort)
        high = np.maximum(ahead.effort, back.effort)
        statuses = [one.status for one in (ahead, back) if one.status is not None]
        if not statuses:
            return low, high, None
        return low, high, JAMMED * np.any(np.equal(statuses, JAMMED), axis=0)


class _InertialForces(NamedTuple):
    """D'Alembert's forces of the bars in a motion; none by default."""

    total: Any = 0.0
    """J q'' + J'/2 q'^2 of all bars, N m."""
    of_others: Any = 0.0
    """The same of bars 3 and 4."""
    wrenches: Wrenches = Wrenches()
    mass_at_A: Any = 0.0j
    """Force of the coupler's mass at pin A, as from `inertia_wrenches`."""
    about_B: Any = 0.0
    """Moment on the coupler about pin B, N m, for a drive that leaves bar 4 out."""


class _FreeBodies(NamedTuple):
    """The free bodies at some positions, and the drive that balances what acts."""

    state: State
    inertial: _InertialForces
    sines: dict[int, Any]
    """Sines between the two other bars, by the bar whose moment is left out."""
    drive: "Couple | ForceDrive"
    gain: Any
    """h of the driven bar, or ds/dq of the drive that exerts a force, m."""

    def solve_pin_forces(
        self,
        actions: Actions,
        *,
        with_inertia: bool = True,
    ) -> PinForces:
        """Solve for the pin forces under some actions and the drive that balances them.

        A couple on one bar leaves the moments of the other two alone, which give the
        force between them. The force of a drive that exerts one is found first, by
        virtual work, and then is one more load; where it acts on two moving bars or on
        bar 3, the pair of bars whose directions differ most keeps the digits.
        """
        inertial = self.inertial if with_inertia else _InertialForces()
        if not isinstance(self.drive, Couple):
            Q = actions.generalized_forces()[0]
            force = driving_torque(self.gain, inertial.total, Q)
            actions = actions.plus(self.drive, force)
        if len(self.sines) == 1:
            (bar,) = self.sines
            return self._solve_from_two_moments(bar, actions, inertial)
        pins = {
            bar: self._solve_from_two_moments(bar, actions, inertial)
            for bar in self.sines
        }
        s2, s3, s4 = (abs(self.sines[bar]) for bar in MOVING_BARS)
        first = (s2 >= s3) & (s2 >= s4)
        second = s3 >= s4
        selected = []
        for of_2, of_3, of_4 in zip(pins[2], pins[3], pins[4], strict=True):
            of_others = select(second, of_3, of_4)
            selected.append(select(first, of_2, of_others))
        return PinForces(*selected)

    def _solve_from_two_moments(
        self,
        left_out: int,
        actions: Actions,
        inertial: _InertialForces,
    ) -> PinForces:
        """Solve from the moments of the two bars other than the one left out."""
        lengths = self.state.lengths
        position = self.state.position
        moment = 0.0
        if left_out == 4:
            # of the coupler about B
            moment = -(actions.about_B() + inertial.about_B)
        elif left_out == 2 and is_any(lengths.d < lengths.a):
            # of F32 about O2, by the virtual work of bars 3 and 4
            Q_of_others = actions.generalized_forces()[1]
            moment = (Q_of_others - inertial.of_others) / self.state.k.h2
        wrenches = actions.wrenches(inertial.wrenches)
        pins = pin_forces(
            lengths,
            position,
            left_out,
            self.sines[left_out],
            wrenches,
            inertial.mass_at_A,
            moment,
        )
        return actions.at_pins(pins)


def compute_shown_state(scene: Scene, at: Command) -> State:
    """Compute the positions of a command and their motion, for what shows them."""
    with np.errstate(all="ignore"):
        return Case.of(scene, at.bar).at(at)
