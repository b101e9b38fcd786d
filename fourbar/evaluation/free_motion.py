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

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from fourbar.effects.effect import Actions
from fourbar.errors import (
    FourBarError,
    InputError,
    LimitError,
    expect,
    needing,
)
from fourbar.evaluation.case import Case
from fourbar.formulas.arithmetic import angle
from fourbar.formulas.mobility import TURN
from fourbar.formulas.motion import State, rates
from fourbar.formulas.path import NO_DIGIT_LEFT, drive_sine, prepare_path
from fourbar.formulas.torque import half_slope, inertia
from fourbar.quantities import NO_DIRECTION, Array
from fourbar.scene import Command, ReleaseOrigin, Scene, command, say_range

RELATIVE, ABSOLUTE = 3e-15, 3e-15
"""Tolerances of a step of DOP853. Below them a long fast motion errs by its round-off.
"""
_CHANGE_OVER = 0.5
"""Part of the other angle's sine below which the angle is changed."""
_LONGEST_TURN = 1.0
"""Angle, rad, through which a bar turns at most between two instants that are looked
at.
"""
MOST_INTEGRATION_STEPS = 200_000
"""A motion that needs more steps than this is given up, after a few minutes: some
hundred turns of the fastest bar take a thousand, so it is thousands of turns long, or
something makes it infinitely fast.
"""
_STANDS = 1e-12
"""Part of the largest velocity coefficient below which another one is rounding."""
VANISHING_SPEED = 2.0**-300
"""Speed at which viscous damping vanishes and dry friction has its direction."""
_SCIPY_LEAST = 100.0 * 2.0**-52
"""Least relative tolerance that SciPy's constructor takes without a warning. The solver
works with a smaller one.
"""


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
    with_extremes: Command | None = None
    """The same command with more instants between: those at which the angle of a bar or
    the sine of the transmission angle is largest or smallest.
    """
    _run: "_Run" = field(repr=False, init=False)
    """Integration that the motion is read from."""

    def command_at(self, times: Array) -> Command:
        """Return the command at other times, (n,) rising from 0, s, of the same run."""
        return self._run.report(times).command

    @property
    def time(self) -> Array:
        """Times of the instants, (n,), s."""
        return np.asarray(self.command.time)

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

    SciPy integrates it. The error is 1e-9 rad over 5 s wherever the motion itself does
    not amplify errors by more than 1000.

    Raises
    ------
    InputError : the scene says nothing of a release, or names more than one angle; the
        linkage does not assemble there, or the motion takes more than
        MOST_INTEGRATION_STEPS steps.
    LimitError : it winds a spring beyond half a turn from its rest, or friction that
        depends on the pin forces acts.
    FourBarError : nothing that moves has inertia, or the motion cannot be continued.
    DependencyError : SciPy is not installed.

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
        allowed = "is needed for a release: its duration and steps"
        raise InputError("motion.free", None, allowed)
    return release_at(scene, np.linspace(0.0, free.duration, free.steps + 1))


def release_at(scene: Scene, times: Array) -> Released:
    """Compute the motion of a released linkage at other times, as `release` does.

    `times`: (n,) rising from 0, s.
    """
    start = command(scene)
    if len(start.angle) != 1:
        allowed = "a free motion is released at one angle"
        raise InputError(f"motion.{start.commanded}", scene.motion.angle, allowed)
    run = _Run(scene, times)
    with np.errstate(all="ignore"):
        run.follow(*run.begin(start))
        return run.report(times)


class _Reading(NamedTuple):
    """A motion as it is read in the angle of bar 2 or 4.

    The numbers y are theta_2, theta_4, both continuous over the turns, the speed of the
    bar that is read, and the work done; one instant in Python's own numbers, or (4, n).
    """

    case: Case
    """Linkage in the angle of the bar, and what acts."""
    branch: float
    side: float = 0.0
    """Sense in which dry friction lets the linkage move, 0: there is none; or the
    fraction of its torque with which it holds the linkage.
    """
    stands: bool = False
    """True if dry friction holds it."""

    @property
    def bar(self) -> int:
        """Number of the bar."""
        return self.case.path.bar

    def angle(self, y: Any) -> Any:
        """Return the angle that is read, rad."""
        return y[0] if self.bar == 2 else y[1]

    def state(self, y: Any, rate: Any = None) -> State:
        """Compute positions and speeds; `rate`: in place of the speed in y."""
        q = self.angle(y)
        rate = y[2] if rate is None else rate
        at = Command(q, np.float64(self.branch), rate, 0.0, self.bar)  # type: ignore[arg-type]
        return self.case.assemble(at, self.case.path.half_angle(q))

    def generalized_force(self, state: State) -> Any:
        """Compute the generalized force of all that acts, N m."""
        actions = Actions(state, self.case.bodies).add(self.case.terms)
        return actions.generalized_forces()[0]

    def inertia(self, state: State) -> Any:
        """Compute the equivalent inertia, kg m^2."""
        a = self.case.lengths.a
        return sum(inertia(a, self.case.bodies, state.position, state.k))

    def compute_rates(self, y: Any) -> list[Any]:
        """Compute the rates of the numbers y.

        Friction keeps its side beyond a standstill, at which the step is then cut.
        """
        rate = y[2]
        moving = rate
        if self.side:
            moving = self.side * np.maximum(self.side * rate, VANISHING_SPEED)
        state = self.state(y, moving)
        Q = self.generalized_force(state)
        bodies = self.case.bodies
        slope = half_slope(self.case.lengths.a, bodies, state.position, state.k)
        equivalent_inertia = self.inertia(state)
        # NumPy's division raises no error where the inertia vanishes
        growth = np.divide(Q - slope * rate * rate, equivalent_inertia)
        return [state.k.h2 * rate, state.k.h4 * rate, growth, Q * rate]

    def measure_room(self, state: State) -> float:
        """Return how far the bar's sine is above that at which the other is read."""
        own = drive_sine(state.position, self.bar)
        other = drive_sine(state.position, 6 - self.bar)
        return float(abs(own) - _CHANGE_OVER * abs(other))

    def on_its_side(self, y: Array) -> "_Reading":
        """Return the same reading on the side of dry friction.

        At a standstill it holds the linkage against any weaker force.
        """
        if not any(term.dry for term in self.case.terms):
            return self
        numbers = y.tolist()
        if numbers[2]:
            return self._replace(side=math.copysign(1.0, numbers[2]))
        ahead, back = (
            float(self.generalized_force(self.state(numbers, slow)))
            for slow in (VANISHING_SPEED, -VANISHING_SPEED)
        )
        if ahead <= 0.0 <= back:
            held = (ahead + back) / (back - ahead) if ahead < back else 0.0
            return self._replace(side=held, stands=True)
        return self._replace(side=1.0 if ahead > 0.0 else -1.0)


def _count_turns(u: Any, near: Any) -> Any:
    """Return the angle of a direction with the whole turns of one that is near, rad."""
    phase = angle(u)
    return phase + TURN * np.rint((near - phase) / TURN)


class _Stretch(NamedTuple):
    """Part of a motion that is read in one angle, and on one side of dry friction."""

    reading: _Reading
    stop: float
    """Time of its end, s; inf where the linkage stands from then on."""
    solve: Callable[[Array], Array]
    """Numbers of the reading at times, (4, n)."""
    extremes: list[float]
    """Times at which an angle or sin(mu) turns back, s."""


def _stand_at(y: Array, times: Array) -> Array:
    """Return the numbers of a linkage that stays where it is, (4, n)."""
    return np.repeat(y[:, np.newaxis], times.size, axis=1)


class _Run:
    """Integration of a motion, stretch by stretch."""

    def __init__(self, scene: Scene, times: Array) -> None:
        self.scene = scene
        self.end = float(times[-1])
        self.steps = 0
        self.stretches: list[_Stretch] = []
        self.change_points: list[float] = []

    def begin(self, start: Command) -> tuple[_Reading, Array]:
        """Read the motion where it is released."""
        bar = start.bar
        case = Case.of(self.scene, bar)
        if any(term.loaded_pins for term in case.terms):
            raise LimitError(
                "a free motion cannot carry friction that depends on the pin forces:"
                " state effects.friction, constant torques, in place of pin_friction"
            )
        speed = float(self.scene.motion.speed or 0.0)
        theta: Any = start.angle.item()
        one = start.part((0,))._replace(angle=theta, speed=speed, acceleration=0.0)
        state = case.at(one)
        if not np.isfinite(state.position.u3):
            key = f"motion.theta_{bar}"
            allowed = f"the linkage does not assemble there; {say_range(self.scene)}"
            raise InputError(key, theta, allowed, unit="rad")
        for term in case.terms:
            codes = term.status(state, None)
            if codes is not None and np.any(codes == NO_DIRECTION):
                # rounding would give the force a direction at each step
                raise LimitError(
                    f"effects.{term.key}: two points coincide where the linkage is "
                    "released, and a force along their line has no direction"
                )
        y = np.zeros(4)
        y[:2] = [theta if k == bar else angle(state.direction(k)) for k in (2, 4)]
        reading = self._read_in(bar if bar != 3 else 2, state, y)
        if reading.measure_room(state) < 0.0:
            reading = self._read_in(6 - reading.bar, state, y)
        if speed:
            y[2] = state.omega(reading.bar)
        if not float(reading.inertia(reading.state(y.tolist()))) > 0.0:
            raise FourBarError(
                "nothing that moves has inertia: the free motion is undetermined"
            )
        return reading, y

    def _read_in(self, bar: int, state: State, y: Array) -> _Reading:
        """Read a motion in the angle of bar 2 or 4, from one of its positions."""
        case = Case.of(self.scene, bar)
        sine = float(drive_sine(state.position, bar))
        q = float(y[0] if bar == 2 else y[1])
        return _Reading(case, float(case.path.sign(q, math.copysign(1.0, sine))))

    def follow(self, reading: _Reading, y: Array) -> None:
        """Follow the motion stretch by stretch to its end.

        A stretch ends at a standstill, or where another angle is read.
        """
        start = 0.0
        while True:
            reading = reading.on_its_side(y)
            if reading.stands or start == self.end:
                stop = math.inf if reading.stands else start
                stands = _Stretch(reading, stop, partial(_stand_at, y), [])
                self.stretches.append(stands)
                return
            solved = self._integrate(reading, start, y)
            start = float(solved.t[-1])
            extremes = self._find_extremes(reading, solved)
            self.stretches.append(_Stretch(reading, start, solved.sol, extremes))
            if start == self.end:
                return
            y = np.array(solved.y[:, -1])
            if solved.t_events[0].size:
                state = reading.state(y.tolist())
                y[0] = _count_turns(state.direction(2), y[0])
                y[1] = _count_turns(state.direction(4), y[1])
                reading = self._read_in(6 - reading.bar, state, y)
                y[2] = state.omega(reading.bar)
            else:
                y[2] = 0.0

    def _integrate(self, reading: _Reading, start: float, y: Array) -> Any:
        """Integrate one stretch, to the end of the motion at most."""
        with needing("SciPy is needed for free motion", "studies"):
            from scipy.integrate import DOP853, solve_ivp
        run = self

        class Solver(DOP853):  # type: ignore[misc]  # SciPy has no types
            """SciPy's, with a smaller tolerance and a largest number of steps."""

            def __init__(self, *arguments: Any, **options: Any) -> None:
                super().__init__(*arguments, rtol=_SCIPY_LEAST, **options)
                self.rtol = RELATIVE

            def step(self) -> Any:
                run.steps += 1
                if run.steps > MOST_INTEGRATION_STEPS:
                    allowed = (
                        f"this motion is followed for {MOST_INTEGRATION_STEPS} steps,"
                        f" here to {self.t:.6g} s; make it shorter"
                    )
                    raise InputError("motion.free.duration", run.end, allowed)
                return super().step()

        def has_room(_: float, y: Array) -> float:
            return reading.measure_room(reading.state(y.tolist()))

        def moves(_: float, y: Array) -> float:
            return reading.side * float(y[2])

        events: list[Any] = [has_room, moves] if reading.side else [has_room]
        for event in events:
            event.terminal = True
            event.direction = -1.0
        solved = solve_ivp(
            lambda _, y: reading.compute_rates(y.tolist()),
            (start, self.end),
            y,
            method=Solver,
            dense_output=True,
            events=events,
            atol=ABSOLUTE,
        )
        if not solved.success:
            reached = np.degrees(reading.angle(solved.y[:, -1]))
            raise FourBarError(
                f"the free motion cannot be continued beyond {solved.t[-1]:.9g} s,"
                f" theta_{reading.bar} = {reached:.6g} deg: its steps vanish"
                " there, as where no bar that moves has a mass; give each bar its mass"
            )
        return solved

    def _find_extremes(self, reading: _Reading, solved: Any) -> list[float]:
        """Find the times in a stretch at which an angle or sin(mu) turns back.

        The times at which all bars are collinear are noted: another motion is possible
        there.
        """
        from scipy.optimize import brentq

        path = reading.case.path
        beginning = path.theta_1 + (math.pi if path.bar == 4 else 0.0)
        points = [beginning] * bool(path.passing.inner)
        points += [beginning + math.pi] * bool(path.passing.outer)

        def watch(times: Array) -> Array:
            """Return the speeds, and what vanishes at change points, (k, n)."""
            y = solved.sol(times)
            state = reading.state(y)
            k = state.k
            cosine = (state.direction(4) * np.conj(state.direction(3))).real
            coefficients = np.broadcast_arrays(k.h2, k.h3, k.h4, cosine * k.h43)
            slopes = np.array(coefficients, dtype=float)
            sizes = np.abs(slopes)
            slopes[sizes <= _STANDS * sizes.max(axis=0)] = 0.0
            collinear = [np.sin(0.5 * (reading.angle(y) - point)) for point in points]
            return np.array([*slopes, y[2], *collinear])

        # a step may be several turns long
        turned = np.abs(np.diff(reading.angle(solved.y)))
        parts = math.ceil(turned.max() / _LONGEST_TURN)
        rows = np.arange(parts * turned.size + 1) / parts
        times = np.interp(rows, np.arange(solved.t.size), solved.t)
        values = watch(times)
        extremes = [float(time) for event in solved.t_events[1:] for time in event]
        signs = values[:, 1:] * values[:, :-1]
        for row, step in np.argwhere(signs <= 0.0):
            turns_back = row < 5
            if turns_back and not signs[row, step]:
                continue
            time = brentq(
                lambda time, row: float(watch(np.array([time]))[row, 0]),
                *times[step : step + 2],
                (row,),
                xtol=1e-15,
            )
            (extremes if turns_back else self.change_points).append(time)
        return extremes

    def _read(self, stretch: _Stretch, times: Array) -> Array:
        """Read instants of a stretch, (n, 13), as `report` needs them."""
        reading = stretch.reading
        y = stretch.solve(times)
        state = reading.state(y)
        theta_2, _, rate, work = y
        if reading.bar != 2:
            theta_2 = _count_turns(state.direction(2), theta_2)
        growth = 0.0 if reading.stands else reading.compute_rates(y)[2]
        moving = rates(state.k, rate, growth)
        columns = (
            times,
            theta_2,
            moving.omega_2,
            moving.alpha_2,
            drive_sine(state.position, 2),
            0.5 * reading.inertia(state) * rate * rate,
            work,
            reading.bar,
            state.q,
            rate,
            growth,
            reading.branch,
            np.where(rate == 0.0, reading.side, 0.0),
        )
        return np.stack(np.broadcast_arrays(*columns), axis=1)

    def report(self, times: Array) -> Released:
        """Report the motion at times, (n,) rising from 0, s."""
        linkage = self.scene.linkage
        rows = []
        due = times
        with np.errstate(all="ignore"):
            for stretch in self.stretches:
                now = due[due <= stretch.stop]
                due = due[now.size :]
                extremes = [time for time in stretch.extremes if time <= times[-1]]
                now = np.union1d(now, extremes)
                if now.size:
                    rows.append(self._read(stretch, now))
            columns = np.concatenate(rows).T
        instants, theta_2, omega_2, alpha_2, sine, energy, work, bar, *independent = (
            columns
        )
        path = prepare_path(linkage.lengths, linkage.ground_angle)
        signs = np.array(path.sign(theta_2, np.copysign(1.0, sine)))
        # at a limit of theta_2 both branches meet, and the last one goes on
        is_sure = np.abs(sine) > NO_DIGIT_LEFT
        last = np.maximum.accumulate(np.where(is_sure, np.arange(sine.size), -1))
        signs = np.where(last < 0, command(self.scene).branch[0], signs[last])
        whole = Command(
            theta_2,
            signs.astype(np.int8),
            omega_2,
            alpha_2,
            time=instants.copy(),
            origin=ReleaseOrigin(bar.astype(np.int8), *independent),
        )
        motion = whole.part(np.isin(instants, times))
        if self.scene.counts_turns:
            self._require_unwound(motion)
        largest = float(np.max(np.abs([energy, work])))
        drift = float(np.max(np.abs(energy - energy[0] - work)))
        # two may lie within one step
        passed = {time for time in self.change_points if time <= times[-1]}
        drift = drift / largest if largest else 0.0
        released = Released(motion, drift, tuple(sorted(passed)), whole)
        released._run = self
        return released

    def _require_unwound(self, motion: Command) -> None:
        """Raise LimitError where a spring is beyond half a turn from its rest."""
        with np.errstate(all="ignore"):
            begun = Case.of(self.scene).begin_with(motion.part(slice(0, 1)))
            state = begun.at(motion)
            wound = []
            for term in begun.terms:
                for pin, rows in term.list_wound(state, motion.branch).items():
                    instants = motion.places[rows]
                    wound += [(time, f"{term.key}.{pin}", pin) for time in instants[:1]]
        if wound:
            time, key, pin = min(wound)
            raise LimitError(
                f"effects.{key}: at {time:.6g} s the free motion has turned {pin} by"
                " more than half a turn from the rest of its spring, which is not"
                " modelled: state a shorter motion.free.duration"
            )
