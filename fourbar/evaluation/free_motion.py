"""Free motion: the linkage released and moved by loads and effects alone.

SciPy integrates it.

The reduced equation
    J q'' + J'/2 q'^2 = Q
is integrated with theta_2 or theta_4 as q, whichever is further from its limit
position: bars 3, 4 collinear stop theta_2, bars 2, 3 collinear stop theta_4, and both
at once happen at a change point alone, where an assembly is regular. The loop therefore
closes to round-off at every instant, and nothing drifts off it. The motion runs on
through limit positions, and through change points on its assembly, where another motion
is possible.
"""

import cmath
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from fourbar.effects.effect import Actions, Effect, list_bodies
from fourbar.errors import (
    DependencyError,
    FourBarError,
    InputError,
    LimitError,
    expect,
    say_install,
)
from fourbar.evaluation.case import Case
from fourbar.formulas.motion import Coefficients, State, rates
from fourbar.formulas.path import NO_DIGIT_LEFT, drive_sine, prepare_path
from fourbar.formulas.pin_forces import Body
from fourbar.formulas.position import HalfAngle, Position, loop
from fourbar.formulas.torque import half_slope, inertia
from fourbar.linkage import MOVING_BARS, FourBar
from fourbar.quantities import NO_DIRECTION, Array
from fourbar.scene import Command, Scene, command
from fourbar.scene.scene import Independent

RELATIVE, ABSOLUTE = 3e-15, 3e-15
"""Tolerances of a step of DOP853. Below them a long fast motion errs by its round-off.
"""
_SCIPY_LEAST = 100.0 * 2.0**-52
"""Least relative tolerance that SciPy's constructor takes without a warning. The solver
works with a smaller one.
"""
_CHANGE_OVER = 0.5
"""Part of the other angle's sine below which the angle is changed."""
MOST_INTEGRATION_STEPS = 200_000
"""A motion that needs more steps than this is given up, after a few minutes: some
hundred turns of the fastest bar take a thousand, so it is thousands of turns long, or
something makes it infinitely fast.
"""
VANISHING_SPEED = 2.0**-300
"""Speed at which viscous damping vanishes and dry friction has its direction."""


@dataclass(slots=True, eq=False)
class Released:
    """Motion of a released linkage at the times of the scene."""

    command: Command
    """theta_2 (continuous), branch, omega_2, alpha_2, time and the independent angle.
    They are the command of `solve(scene, at=...)`.
    """
    energy_drift: float
    """Largest |kinetic energy - work done| over the motion, over the larger of both.
    It is 0 where nothing moves.
    """
    change_points: tuple[float, ...] = ()
    """Times at which the motion passed a change point, s. Another motion was possible
    there.
    """

    @property
    def time(self) -> Array:
        """Times of the instants, (n,), s."""
        assert self.command.time is not None
        return self.command.time

    @property
    def theta_2(self) -> Array:
        """Angle of the input, continuous, (n,), rad."""
        return self.command.angle

    @property
    def omega_2(self) -> Array:
        """Speed of the input, (n,), rad/s."""
        return np.asarray(self.command.speed)

    @property
    def alpha_2(self) -> Array:
        """Acceleration of the input, (n,), rad/s^2."""
        return np.asarray(self.command.acceleration)


def release(scene: Scene) -> Released:
    """Compute the motion of a linkage that is released, as its scene says (`free`).

    SciPy integrates it.

    Raises
    ------
    InputError : the scene says nothing of a release, or names more than one angle; and
        as of `integrate`.
    LimitError : it winds a spring beyond half a turn from its rest; and as of
        `integrate`.

    >>> import fourbar
    >>> free = fourbar.Free(duration=0.2, steps=2)
    >>> linkage = fourbar.uniform(0.3, 0.1, 0.25, 0.22)
    >>> motion = fourbar.Motion(1.0, 5.0, free=free)
    >>> scene = fourbar.Scene(linkage, motion, effects=(fourbar.Gravity(),))
    >>> released = release(scene)
    >>> fourbar.solve(scene, at=released.command).torque
    array([0., 0., 0.])
    """
    expect("scene", scene, Scene)
    free = scene.motion.free
    if free is None:
        raise InputError(
            "motion.free",
            None,
            "is needed for a release: its duration and steps",
        )
    return release_at(scene, np.linspace(0.0, free.duration, free.steps + 1))


def release_at(scene: Scene, times: Array) -> Released:
    """Compute the motion of a released linkage at other times, as `release` does.

    `times`: (n,) rising from 0, s.
    """
    start = command(scene)
    if len(start.angle) != 1:
        raise InputError(
            f"motion.{start.commanded}",
            scene.motion.angle,
            "a free motion is released at one angle",
        )
    placed = scene.settled()
    released = integrate(
        scene.linkage,
        (*placed.loads, *placed.effects),
        float(start.angle[0]),
        float(scene.motion.speed or 0.0),
        int(start.branch[0]),
        times,
        bar=start.bar,
    )
    if scene.counts_turns:
        motion = released.command
        with np.errstate(all="ignore"):
            begun = Case.of(scene).begin_with(motion.part(slice(0, 1)))
            state, _ = begun.at(motion)
            for term in begun.terms:
                if term.counts_turns:
                    codes = term.status(state, motion.branch)
                else:
                    codes = None
                if codes is not None and codes.any():
                    raise LimitError(
                        f"effects.{term.key}: at {released.time[np.argmax(codes)]:.6g}"
                        " s the free motion has turned a pin by more than half a turn"
                        " from the rest of its spring, which is not modelled"
                    )
    return released


def _convert_to_floats(numbers: Any) -> Any:
    """Return numbers as those of Python, with which one position is quicker."""
    converted = []
    for number in numbers:
        of_numpy = isinstance(number, np.generic | np.ndarray)
        converted.append(number.item() if of_numpy else number)
    return type(numbers)(*converted)


class _Reading:
    """The linkage read in the angle of bar 2, 3 or 4, with its assembly."""

    def __init__(self, linkage: FourBar, bar: int) -> None:
        path = prepare_path(linkage.lengths, linkage.ground_angle, bar)
        self.path = path._replace(
            lengths=_convert_to_floats(path.lengths),
            u1=complex(path.u1),
            unit=float(path.unit),
        )
        self.bar = bar
        self.branch = 1.0
        self.last: tuple[tuple[float, float], tuple[Position, Coefficients]] | None = (
            None
        )

    def evaluate(self, q: float) -> tuple[Position, Coefficients]:
        """Compute the position and its coefficients by q; the last results are kept."""
        if self.last is None or self.last[0] != (q, self.branch):
            self.last = (q, self.branch), self._at(q)
        return self.last[1]

    def _at(self, q: float) -> tuple[Position, Coefficients]:
        half = self.path.half_angle(q)
        try:
            return self._by(q, _convert_to_floats(half))
        except ZeroDivisionError:  # NumPy's numbers give inf or NaN instead
            return self._by(q, half)

    def _by(self, q: float, half: HalfAngle) -> tuple[Position, Coefficients]:
        # a motion may start at a limit of the bar that it is read from: coefficients
        # are then infinite, and another bar is taken
        position, k, _ = self.path.close(q, half, self.branch, margin=-1.0)
        if self.path.may_stay_parallel:
            return (_convert_to_floats(position), _convert_to_floats(k))
        return (position, k)


def _compute_sines(position: Position) -> dict[int, float]:
    """Compute the sines between two bars by the number of the third.

    At the limits of that bar they are zero.
    """
    return {bar: float(drive_sine(position, bar)) for bar in MOVING_BARS}


def integrate(
    linkage: FourBar,
    terms: Iterable[Effect],
    theta: float,
    omega: float,
    branch: int,
    times: Array,
    *,
    bar: int = 2,
) -> Released:
    """Integrate the motion from theta_2 with omega_2, without a driving torque.

    The error is 1e-9 rad over 5 s wherever the motion itself does not amplify errors by
    more than 1000.

    Parameters
    ----------
    terms : loads and effects.
    theta, omega, branch : of the bar that is released, at the start; its assembly is +1
        or -1.
    times : (n,) rising from 0, s.
    bar : 2, or 3 or 4.

    Raises
    ------
    InputError : the linkage does not assemble at theta_2, or the motion takes more than
        MOST_INTEGRATION_STEPS steps.
    LimitError : friction that depends on the pin forces acts.
    FourBarError : nothing that moves has inertia, or the motion cannot be continued.
    DependencyError : SciPy is not installed.
    """
    terms = tuple(terms)
    if any(term.loaded_pins for term in terms):
        raise LimitError(
            "a free motion cannot carry friction that depends on the pin forces"
        )
    with np.errstate(invalid="ignore", divide="ignore", over="ignore", under="ignore"):
        return _IntegrationRun(linkage, terms, theta, omega, branch, bar).integrate(
            times
        )


class _IntegrationRun:
    """State of an integration: its angle, and what has been reported so far."""

    def __init__(
        self,
        linkage: FourBar,
        terms: tuple[Effect, ...],
        theta: float,
        omega: float,
        branch: int,
        bar: int,
    ) -> None:
        self.linkage = linkage
        self.terms = terms
        self.bar = bar
        self.lengths = _convert_to_floats(loop(*linkage.lengths))
        two, three, four = (
            _convert_to_floats(body) for body in list_bodies(linkage, terms)
        )
        self.bodies: tuple[Body, Body, Body] = two, three, four
        self.readings = {each: _Reading(linkage, each) for each in (2, 4)}
        if bar != 3:
            self.reading = self.readings[bar]
        else:
            self.reading = _Reading(linkage, 3)
        self.reading.branch = self.branch = float(branch)
        position, k = self.reading.evaluate(theta)
        if not np.isfinite(position.u3):
            raise InputError(
                f"motion.theta_{bar}",
                theta,
                "the linkage does not assemble there",
            )
        self.theta = {
            2: float(np.angle(position.u2)),
            4: float(np.angle(position.u4)),
            bar: theta,
        }
        self.y = np.array([theta, omega, 0.0])
        if not float(self._compute_inertia(position, k)) > 0.0:
            raise FourBarError(
                "nothing that moves has inertia: the free motion is undetermined"
            )
        self._require_directions(theta, position, k, omega)
        self._change_over()
        self.side = 0.0  # sense of motion if dry friction depends on it
        self.holding = (
            0.0  # fraction of its torque with which dry friction holds at a standstill
        )
        ahead, back = self._try_both_senses()
        self.dry = ahead != back
        self.start_energy = self._compute_kinetic_energy()
        self.times = np.empty(0)
        self.t = 0.0
        self.steps = 0
        self.change_points: list[float] = []
        self.drift = self.largest = 0.0
        self.rows: list[tuple[float, ...]] = []

    def _require_directions(
        self,
        q: float,
        position: Position,
        k: Coefficients,
        rate: float,
    ) -> None:
        """Raise a LimitError if a force has no direction at the start.

        Rounding would give it a direction at each step.
        """
        state = self._make_state(q, position, k, rate)
        for term in self.terms:
            codes = term.status(state, None)
            if codes is not None and np.any(codes == NO_DIRECTION):
                raise LimitError(
                    f"effects.{term.key}: two points coincide where the linkage is "
                    "released, and a force along their line has no direction"
                )

    def _compute_inertia(self, position: Position, k: Coefficients) -> Any:
        return sum(inertia(self.lengths.a, self.bodies, position, k))

    def _compute_kinetic_energy(self) -> float:
        position, k = self._at()
        equivalent_inertia = float(self._compute_inertia(position, k))
        return 0.5 * equivalent_inertia * float(self.y[1]) ** 2

    def _at(self) -> tuple[Position, Coefficients]:
        return self.reading.evaluate(float(self.y[0]))

    def _compute_generalized_force(
        self,
        q: float,
        position: Position,
        k: Coefficients,
        rate: float,
    ) -> float:
        """Compute Q under everything that acts.

        The speed is not zero where friction needs a direction.
        """
        state = self._make_state(q, position, k, rate)
        return float(
            Actions(state, self.bodies).add(self.terms).generalized_forces()[0]
        )

    def _make_state(
        self,
        q: float,
        position: Position,
        k: Coefficients,
        rate: float,
    ) -> State:
        """Make the state at an angle and a speed of the bar that is read."""
        return State(
            self.lengths,
            self.linkage.ground_angle,
            q if self.reading.bar == 2 else cmath.phase(position.u2),
            position,
            k,
            rate,
            rates(k, rate, 0.0),
        )

    def _try_both_senses(self) -> list[float]:
        q = float(self.y[0])
        return [
            self._compute_generalized_force(q, *self._at(), rate)
            for rate in (VANISHING_SPEED, -VANISHING_SPEED)
        ]

    def _compute_rates(self, _: float, y: Array) -> list[float]:
        q = float(y[0])
        rate = float(y[1])
        position, k = self.reading.evaluate(q)
        # friction keeps its sense beyond a standstill, at which the step is then cut
        if self.side:
            moving = self.side * max(self.side * rate, VANISHING_SPEED)
        else:
            moving = rate
        Q = self._compute_generalized_force(q, position, k, moving)
        slope = half_slope(self.lengths.a, self.bodies, position, k)
        # NumPy's division raises no error where the inertia vanishes
        return [
            rate,
            float(
                np.float64(Q - slope * rate * rate) / self._compute_inertia(position, k)
            ),
            Q * rate,
        ]

    def _change_over(self) -> bool:
        """Take the other angle if it is further from its limit.

        Position, velocity and work are kept.
        """
        position, k = self._at()
        sines = _compute_sines(position)
        bar = 6 - self.reading.bar
        if self.reading.bar == 3:  # only at the start
            bar = max((2, 4), key=lambda number: abs(sines[number]))
        elif abs(sines[self.reading.bar]) >= _CHANGE_OVER * abs(sines[bar]):
            return False
        q = self.theta[bar]
        reading = self.readings[bar]
        reading.branch = float(reading.path.sign(q, math.copysign(1.0, sines[bar])))
        _, speed, work = self.y
        rate = 0.0
        if speed:
            rate = float(speed * (k.h2 if bar == 2 else k.h4))
        self.reading = reading
        self.y = np.array([q, rate, work])
        return True

    def _turn(self, position: Position) -> None:
        """Bring theta_2 and theta_4 up to date, continuous over the steps."""
        for bar, u in ((2, position.u2), (4, position.u4)):
            now = cmath.phase(u)
            self.theta[bar] = now + 2.0 * math.pi * round(
                (self.theta[bar] - now) / (2.0 * math.pi)
            )

    def _starts(self) -> bool:
        """Return True if the linkage moves on.

        At a standstill dry friction holds it against any weaker force.
        """
        self.side = 0.0
        rate = float(self.y[1])
        if not self.dry:
            return True
        if rate == 0.0:
            ahead, back = self._try_both_senses()
            if ahead <= 0.0 <= back:
                if ahead < back:
                    self.holding = (ahead + back) / (back - ahead)
                else:
                    self.holding = 0.0
                return False
            rate = 1.0 if ahead > 0.0 else -1.0
        self.side = math.copysign(1.0, rate)
        return True

    def integrate(self, times: Array) -> Released:
        """Integrate over the times and report."""
        try:
            from scipy.integrate import DOP853
        except ModuleNotFoundError:
            raise DependencyError(
                f"SciPy is needed for free motion: {say_install('studies')}"
            ) from None
        end = float(times[-1])
        self.times = times
        self.largest = self.start_energy
        moves = self._starts()
        self._report(0.0, lambda _: self.y)
        while self.t < end:
            if not moves:
                self._report(end, lambda _: self.y)
                break
            solver = DOP853(
                self._compute_rates,
                self.t,
                self.y,
                end,
                rtol=_SCIPY_LEAST,
                atol=ABSOLUTE,
            )
            solver.rtol = RELATIVE
            moves = self._follow_solver(solver)
        theta_2, omega_2, alpha_2, branch, bar, *independent = (
            np.array(self.rows).reshape(-1, 10).T
        )
        time = np.asarray(times[: len(self.rows)])
        motion = Command(theta_2, branch.astype(np.int8), omega_2, alpha_2, None, time)
        motion = motion._replace(
            independent=Independent(bar.astype(np.int8), *independent)
        )
        return Released(
            motion,
            self.drift / self.largest if self.largest else 0.0,
            tuple(sorted(self.change_points)),  # two may lie within one step
        )

    def _follow_solver(self, solver: Any) -> bool:
        """Take steps until the motion ends or another solver is needed.

        Return True if the linkage moves then.
        """
        while solver.status == "running":
            self.steps += 1
            message = solver.step()
            if solver.status == "failed":
                raise FourBarError(
                    f"the free motion cannot be continued beyond {self.t:.9g} s:"
                    f" {message}"
                )
            if self.steps > MOST_INTEGRATION_STEPS:
                allowed = (
                    f"this motion is followed for {MOST_INTEGRATION_STEPS} steps,"
                    f" here to {self.t:.6g} s; make it shorter"
                )
                raise InputError("motion.free.duration", float(self.times[-1]), allowed)
            dense = _interpolate(solver)
            t = solver.t
            new = solver.y
            rested = bool(self.side and self.side * new[1] < 0.0)
            if rested:
                t = _find_root(dense, lambda y: float(y[1]), solver.t_old, t)
                q, _, work = dense(t)
                new = np.array([q, 0.0, work])
            self._note_change_points(solver.t_old, t, dense)
            self._report(t, dense)
            self.t, self.y = t, np.array(new)
            self._turn(self._at()[0])
            energy = self._compute_kinetic_energy() - self.start_energy
            self.drift = max(self.drift, abs(energy - float(self.y[2])))
            self.largest = max(
                self.largest,
                abs(energy + self.start_energy),
                abs(float(self.y[2])),
            )
            if rested or self._change_over():
                return self._starts()
        return True

    def _note_change_points(
        self,
        start: float,
        stop: float,
        dense: Callable[[float], Array],
    ) -> None:
        """Note the times within a step at which all bars are collinear.

        Another motion is possible there.
        """
        path = self.reading.path
        beginning = path.theta_1 + (math.pi if path.bar == 4 else 0.0)
        for passes, psi in ((path.passing.inner, 0.0), (path.passing.outer, math.pi)):
            if not passes:
                continue
            point = beginning + psi
            before = (float(dense(start)[0]) - point) / (2.0 * math.pi)
            after = (float(dense(stop)[0]) - point) / (2.0 * math.pi)
            passed = range(math.floor(before) + 1, math.floor(after) + 1)
            if after < before:
                passed = range(math.ceil(after), math.ceil(before))
            for turn in passed:

                def find_gap(y: Array, turn: int = turn, point: float = point) -> float:
                    return float(y[0]) - (point + 2.0 * math.pi * turn)

                self.change_points.append(_find_root(dense, find_gap, start, stop))

    def _report(self, until: float, dense: Callable[[float], Array]) -> None:
        """Report the instants up to a time, from the motion as a function of time."""
        for time in self.times[len(self.rows) :]:
            if time > until:
                break
            self.rows.append(self._make_row(dense(float(time))))

    def _make_row(self, y: Array) -> tuple[float, ...]:
        """Return one instant as a row of numbers.

        The row holds theta_2, omega_2, alpha_2, the branch, and the angle, speed and
        acceleration of the independent angle.
        """
        q = float(y[0])
        rate = float(y[1])
        position, k = self.reading.evaluate(q)
        wrapped = cmath.phase(position.u2)
        turns = round((self.theta[2] - wrapped) / (2.0 * math.pi))
        theta_2 = wrapped + 2.0 * math.pi * turns
        if self.reading.bar == 2:
            theta_2 = q
        still = self.dry and rate == 0.0 and not self.side
        if still:
            growth = 0.0
        else:
            growth = self._compute_rates(0.0, y)[1]
        moving = rates(k, rate, growth)
        sine = _compute_sines(position)[2]
        if abs(sine) > NO_DIGIT_LEFT:  # at a limit of theta_2 both branches meet
            self.branch = float(
                self.readings[2].path.sign(theta_2, math.copysign(1.0, sine))
            )
        if self.dry and rate == 0.0:
            side = self.side or self.holding
        else:
            side = 0.0
        independent = (
            float(self.reading.bar),
            q,
            rate,
            growth,
            self.reading.branch,
            side,
        )
        return (
            theta_2,
            float(moving.omega_2),
            float(moving.alpha_2),
            self.branch,
            *independent,
        )


def _find_root(
    dense: Callable[[float], Array],
    f: Callable[[Array], float],
    low: float,
    high: float,
) -> float:
    """Find the time in a step at which f of the motion is zero.

    The start of the step is returned if f is zero there.
    """
    from scipy.optimize import brentq

    if f(dense(low)) * f(dense(high)) >= 0.0:
        return low
    return float(brentq(lambda t: f(dense(t)), low, high, xtol=1e-15, rtol=1e-15))


def _interpolate(solver: Any) -> Callable[[float], Array]:
    """Return the motion within the last step of the solver.

    Three more evaluations of it wait for the first call.
    """
    dense_output = cache(solver.dense_output)

    def motion(t: float) -> Array:
        state: Array = dense_output()(t)
        return state

    return motion
