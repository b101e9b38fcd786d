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
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple, Self

import numpy as np

from fourbar.effects.effect import Actions, Effect, list_bodies
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
from fourbar.formulas.motion import Coefficients, State, rates
from fourbar.formulas.path import NO_DIGIT_LEFT, LoopPath, drive_sine, prepare_path
from fourbar.formulas.pin_forces import Body
from fourbar.formulas.position import Position, loop
from fourbar.formulas.torque import half_slope, inertia
from fourbar.linkage import FourBar
from fourbar.quantities import NO_DIRECTION, Array
from fourbar.scene import Command, ReleaseOrigin, Scene, command

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
_STANDS = 1e-12
"""Part of the largest velocity coefficient below which another one is rounding."""
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
    run = _Run(scene, times, float(start.branch[0]))
    with np.errstate(invalid="ignore", divide="ignore", over="ignore", under="ignore"):
        run.begin(float(start.angle[0]), float(scene.motion.speed or 0.0), start.bar)
    return run.report(times)


def _convert_to_floats(numbers: Any) -> Any:
    """Return numbers as those of Python, with which one position is quicker."""
    converted = []
    for number in numbers:
        of_numpy = isinstance(number, np.generic | np.ndarray)
        converted.append(number.item() if of_numpy else number)
    return type(numbers)(*converted)


class _Reading(NamedTuple):
    """The angle in which a motion is read: that of bar 2, 3 or 4, with its assembly."""

    path: LoopPath
    branch: float

    @classmethod
    def of(cls, linkage: FourBar, bar: int, branch: float) -> Self:
        """Read a linkage in the angle of a bar, in Python's own numbers."""
        path = prepare_path(linkage.lengths, linkage.ground_angle, bar)
        plain = path._replace(
            lengths=_convert_to_floats(path.lengths),
            u1=complex(path.u1),
            unit=float(path.unit),
        )
        return cls(plain, branch)

    def close(self, q: Any) -> tuple[Position, Coefficients]:
        """Compute position and coefficients at one angle, a Python float, or at (n,).

        A motion may start at a limit of the bar that it is read from: coefficients are
        then infinite, and another bar is taken.
        """
        half = self.path.half_angle(q)
        if not isinstance(q, float):
            return self.path.close(q, half, self.branch, margin=-1.0)[:2]
        try:
            plain = _convert_to_floats(half)
            position, k, _ = self.path.close(q, plain, self.branch, margin=-1.0)
        except ZeroDivisionError:  # NumPy's numbers give inf or NaN instead
            position, k, _ = self.path.close(q, half, self.branch, margin=-1.0)
        if self.path.may_stay_parallel:
            return _convert_to_floats(position), _convert_to_floats(k)
        return position, k

    def measure_room(self, position: Position) -> float:
        """Return how far the bar's sine is above that at which the other one is read.

        Bar 3, in which a motion may start alone, has none.
        """
        if self.path.bar == 3:
            return -1.0
        own, other = (drive_sine(position, bar) for bar in (self.path.bar, self.other))
        return float(abs(own) - _CHANGE_OVER * abs(other))

    @property
    def other(self) -> int:
        """Number of the other bar of 2 and 4."""
        return 6 - self.path.bar


class _Stretch(NamedTuple):
    """Part of a motion that is read in one angle, and on one side of dry friction."""

    reading: _Reading
    stop: float
    """Time of its end, s; inf where the linkage stands from then on."""
    extremes: Array
    """Times at which an angle or sin(mu) turns back, s."""
    instants: Array
    """Times at which the angles of both bars are kept, s."""
    angles: dict[int, Array]
    """Angles of bars 2 and 4 at these times, continuous over the turns."""
    energies: Array
    """Kinetic energy and work at these times, (2, n), J."""
    solve: Callable[[Array], Array]
    """Angle, speed and work at times, (3, n)."""
    side: float
    moves: bool


def _stand_at(y: Array, times: Array) -> Array:
    """Return angle, speed and work of a linkage that stays where it is, (3, n)."""
    return np.repeat(y[:, np.newaxis], times.size, axis=1)


class _Run:
    """Integration of a motion: the linkage, what acts on it, and its stretches."""

    def __init__(self, scene: Scene, times: Array, branch: float) -> None:
        placed = scene.settled()
        self.scene = scene
        self.linkage = scene.linkage
        self.terms: tuple[Effect, ...] = (*placed.loads, *placed.effects)
        if any(term.loaded_pins for term in self.terms):
            raise LimitError(
                "a free motion cannot carry friction that depends on the pin forces"
            )
        self.times = times
        self.branch = branch
        self.lengths = _convert_to_floats(loop(*self.linkage.lengths))
        two, three, four = map(
            _convert_to_floats, list_bodies(self.linkage, self.terms)
        )
        self.bodies: tuple[Body, Body, Body] = two, three, four
        self.is_dry = any(term.dry for term in self.terms)
        self.steps = 0
        self.stretches: list[_Stretch] = []
        self.change_points: list[float] = []

    def begin(self, theta: float, omega: float, bar: int) -> None:
        """Follow the motion from an angle and a speed of a bar."""
        reading = _Reading.of(self.linkage, bar, self.branch)
        position, k = reading.close(theta)
        if not np.isfinite(position.u3):
            key = f"motion.theta_{bar}"
            raise InputError(key, theta, "the linkage does not assemble there")
        if not float(self._compute_inertia(position, k)) > 0.0:
            raise FourBarError(
                "nothing that moves has inertia: the free motion is undetermined"
            )
        for term in self.terms:
            codes = term.status(self._make_state(reading, theta, omega), None)
            if codes is not None and np.any(codes == NO_DIRECTION):
                # rounding would give the force a direction at each step
                raise LimitError(
                    f"effects.{term.key}: two points coincide where the linkage is "
                    "released, and a force along their line has no direction"
                )
        angles = {2: cmath.phase(position.u2), 4: cmath.phase(position.u4), bar: theta}
        y = np.array([theta, omega, 0.0])
        if reading.measure_room(position) < 0.0:
            reading, y = self._change_over(reading, angles, y)
        self._follow(reading, angles, y)

    def _compute_inertia(self, position: Position, k: Coefficients) -> Any:
        return sum(inertia(self.lengths.a, self.bodies, position, k))

    def _make_state(self, reading: _Reading, q: Any, rate: Any) -> State:
        """Make the state at angles and speeds of the bar that is read."""
        position, k = reading.close(q)
        return State(
            self.lengths,
            self.linkage.ground_angle,
            q if reading.path.bar == 2 else angle(position.u2),
            position,
            k,
            rate,
            rates(k, rate, 0.0),
        )

    def _compute_generalized_force(self, state: State) -> Any:
        return Actions(state, self.bodies).add(self.terms).generalized_forces()[0]

    def _compute_rates(self, reading: _Reading, y: Any, side: float) -> list[Any]:
        """Compute the rates of angle, speed and work, at one instant or at (n,).

        Friction keeps its side beyond a standstill, at which the step is then cut.
        """
        q, rate, _ = y
        moving = side * np.maximum(side * rate, VANISHING_SPEED) if side else rate
        state = self._make_state(reading, q, moving)
        Q = self._compute_generalized_force(state)
        slope = half_slope(self.lengths.a, self.bodies, state.position, state.k)
        equivalent_inertia = self._compute_inertia(state.position, state.k)
        # NumPy's division raises no error where the inertia vanishes
        growth = np.divide(Q - slope * rate * rate, equivalent_inertia)
        return [rate, growth, Q * rate]

    def _change_over(
        self,
        reading: _Reading,
        angles: Mapping[int, float],
        y: Array,
    ) -> tuple[_Reading, Array]:
        """Read the motion in the angle of the other bar; from bar 3, the better one.

        Position, velocity and work are kept.
        """
        position, k = reading.close(float(y[0]))
        sines = {bar: float(drive_sine(position, bar)) for bar in (2, 4)}
        bar = reading.other
        if bar == 3:
            bar = max(sines, key=lambda number: abs(sines[number]))
        _, speed, work = y
        rate = speed and float(speed * (k.h2 if bar == 2 else k.h4))
        other = _Reading.of(self.linkage, bar, 1.0)
        sign = other.path.sign(angles[bar], math.copysign(1.0, sines[bar]))
        return other._replace(branch=float(sign)), np.array([angles[bar], rate, work])

    def _find_side(self, reading: _Reading, y: Array) -> tuple[float, bool]:
        """Return the side of dry friction, and True if the linkage moves on.

        At a standstill dry friction holds the linkage against any weaker force, with a
        fraction of its torque in place of the side.
        """
        q, rate, _ = map(float, y)
        if not self.is_dry or rate:
            return (math.copysign(1.0, rate) if self.is_dry else 0.0), True
        ahead, back = (
            float(self._compute_generalized_force(self._make_state(reading, q, slow)))
            for slow in (VANISHING_SPEED, -VANISHING_SPEED)
        )
        if ahead <= 0.0 <= back:
            return ((ahead + back) / (back - ahead) if ahead < back else 0.0), False
        return (1.0 if ahead > 0.0 else -1.0), True

    def _follow(self, reading: _Reading, angles: dict[int, float], y: Array) -> None:
        """Follow the motion stretch by stretch to its end.

        A stretch ends at a standstill, or where another angle is read.
        """
        start = 0.0
        end = float(self.times[-1])
        while True:
            side, moves = self._find_side(reading, y)
            if not moves or start == end:
                here = np.empty(0), np.array([start])
                self._keep(reading, angles, here, partial(_stand_at, y), side, moves)
                break
            solved = self._integrate(reading, start, y, side)
            extremes = self._find_extremes(reading, solved)
            times = extremes, solved.t
            angles = self._keep(reading, angles, times, solved.sol, side, moves)
            start = float(solved.t[-1])
            if start == end:
                break
            y = np.array(solved.y[:, -1])
            if not solved.t_events[0].size:
                y[1] = 0.0
            else:
                reading, y = self._change_over(reading, angles, y)

    def _integrate(self, reading: _Reading, start: float, y: Array, side: float) -> Any:
        """Integrate one stretch, to the end of the motion at most."""
        with needing("SciPy is needed for free motion", "studies"):
            from scipy.integrate import DOP853, solve_ivp
        run = self
        end = float(self.times[-1])

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
                    raise InputError("motion.free.duration", end, allowed)
                return super().step()

        def compute_rates(_: float, y: Array) -> list[Any]:
            return self._compute_rates(reading, y.tolist(), side)

        def has_room(_: float, y: Array) -> float:
            return reading.measure_room(reading.close(float(y[0]))[0])

        def moves(_: float, y: Array) -> float:
            return side * float(y[1])

        events: list[Any] = [has_room, moves] if side else [has_room]
        for event in events:
            event.terminal = True
            event.direction = -1.0
        solved = solve_ivp(
            compute_rates,
            (start, end),
            y,
            method=Solver,
            dense_output=True,
            events=events,
            atol=ABSOLUTE,
        )
        if not solved.success:
            reached = np.degrees(solved.y[0, -1])
            raise FourBarError(
                f"the free motion cannot be continued beyond {solved.t[-1]:.9g} s,"
                f" theta_{reading.path.bar} = {reached:.6g} deg: its steps vanish"
                " there, as where no bar that moves has a mass; give each bar its mass"
            )
        self._note_change_points(reading.path, solved)
        return solved

    def _find_extremes(self, reading: _Reading, solved: Any) -> Array:
        """Find the times in a stretch at which an angle or sin(mu) turns back."""
        from scipy.optimize import brentq

        def compute_slopes(y: Array) -> Array:
            position, k = reading.close(y[0])
            cosine = (position.u4 * np.conj(position.u3)).real
            by_angle = (k.h2, k.h3, k.h4, cosine * (k.h4 - k.h3))
            slopes = np.array(np.broadcast_arrays(y[1], *by_angle), dtype=float)
            sizes = np.abs(slopes[1:])
            slopes[1:][sizes <= _STANDS * sizes.max(axis=0)] = 0.0
            return slopes

        slopes = compute_slopes(solved.sol(solved.t))
        times = [time for event in solved.t_events[1:] for time in event]
        rows, steps = np.nonzero(slopes[:, 1:] * slopes[:, :-1] < 0.0)
        for row, step in zip(rows.tolist(), steps.tolist(), strict=True):

            def find_slope(time: float, row: int = row) -> float:
                return float(compute_slopes(solved.sol(time))[row])

            ends = solved.t[step : step + 2]
            if find_slope(ends[0]) * find_slope(ends[1]) < 0.0:
                times.append(brentq(find_slope, *ends, xtol=1e-15))
        return np.array(times)

    def _note_change_points(self, path: LoopPath, solved: Any) -> None:
        """Note the times at which all bars are collinear: another motion is possible.

        A step may be several turns long.
        """
        from scipy.optimize import brentq

        beginning = path.theta_1 + (math.pi if path.bar == 4 else 0.0)
        for passes, psi in ((path.passing.inner, 0.0), (path.passing.outer, math.pi)):
            if not passes:
                continue

            def count(time: float, point: float = beginning + psi) -> float:
                return float(solved.sol(time)[0] - point) / TURN

            for low, high in pairwise(solved.t):
                first, last = sorted((count(low), count(high)))
                for turn in range(math.ceil(first), math.floor(last) + 1):
                    time = brentq(lambda t, n, f: f(t) - n, low, high, (turn, count))
                    self.change_points.append(time)

    def _keep(
        self,
        reading: _Reading,
        angles: Mapping[int, float],
        times: tuple[Array, Array],
        solve: Callable[[Array], Array],
        side: float,
        moves: bool,
    ) -> dict[int, float]:
        """Keep a stretch, and return the angles of bars 2 and 4 at its end.

        Parameters
        ----------
        angles : of both bars at its beginning.
        times : those at which an angle or sin(mu) turns back, and its steps, s.
        solve : angle, speed and work at times, (3, n).
        """
        extremes, steps = times
        stop = float(steps[-1]) if moves else np.inf
        due = self.times[(self.times >= steps[0]) & (self.times <= stop)]
        instants = np.unique(np.concatenate([extremes, steps, due]))
        q, rate, work = solve(instants)
        position, k = reading.close(q)
        energy = 0.5 * self._compute_inertia(position, k) * rate * rate
        turned = {}
        for bar, u in ((2, position.u2), (4, position.u4)):
            phase = np.unwrap(np.broadcast_to(angle(u), q.shape))
            turned[bar] = phase + TURN * round((angles[bar] - phase[0]) / TURN)
        turned[reading.path.bar] = q
        energies = np.array([energy, work])
        stretch = _Stretch(
            reading, stop, extremes, instants, turned, energies, solve, side, moves
        )
        self.stretches.append(stretch)
        return {bar: float(values[-1]) for bar, values in turned.items()}

    def _read(self, stretch: _Stretch, times: Array) -> Array:
        """Read instants of a stretch, (n, 10), as `report` needs them."""
        reading = stretch.reading
        q, rate, _ = motion = stretch.solve(times)
        position, k = reading.close(q)
        theta_2 = q
        if reading.path.bar != 2:
            theta_2 = np.broadcast_to(angle(position.u2), q.shape)
            near = np.interp(times, stretch.instants, stretch.angles[2])
            theta_2 = theta_2 + TURN * np.round((near - theta_2) / TURN)
        growth = 0.0 * q
        if stretch.moves:
            growth = self._compute_rates(reading, motion, stretch.side)[1]
        moving = rates(k, rate, growth)
        columns = (
            theta_2,
            moving.omega_2,
            moving.alpha_2,
            drive_sine(position, 2),
            reading.path.bar,
            q,
            rate,
            growth,
            reading.branch,
            np.where(rate == 0.0, stretch.side, 0.0),
        )
        return np.stack(np.broadcast_arrays(*columns), axis=1)

    def report(self, times: Array) -> Released:
        """Report the motion at times, (n,) rising from 0, s."""
        reported = []
        rows = []
        due = times
        with np.errstate(all="ignore"):
            for stretch in self.stretches:
                now = due[due <= stretch.stop]
                due = due[now.size :]
                now = np.union1d(now, stretch.extremes[stretch.extremes <= times[-1]])
                if now.size:
                    reported.append(now)
                    rows.append(self._read(stretch, now))
        released = self._conclude(times, np.concatenate(reported), np.concatenate(rows))
        if self.scene.counts_turns:
            self._require_unwound(released.command)
        return released

    def _require_unwound(self, motion: Command) -> None:
        """Raise LimitError where a spring is beyond half a turn from its rest."""
        with np.errstate(all="ignore"):
            begun = Case.of(self.scene).begin_with(motion.part(slice(0, 1)))
            state = begun.at(motion)
            for term in begun.terms:
                codes = term.status(state, motion.branch) if term.counts_turns else None
                if codes is not None and codes.any():
                    assert motion.time is not None
                    raise LimitError(
                        f"effects.{term.key}: at {motion.time[np.argmax(codes)]:.6g}"
                        " s the free motion has turned a pin by more than half a turn"
                        " from the rest of its spring, which is not modelled"
                    )

    def _conclude(self, times: Array, reported: Array, rows: Array) -> Released:
        """Put the reported instants together; the branch is that of the start."""
        theta_2, omega_2, alpha_2, sine, bar, *independent = rows.T
        path = _Reading.of(self.linkage, 2, self.branch).path
        signs = np.array(path.sign(theta_2, np.copysign(1.0, sine)))
        # at a limit of theta_2 both branches meet, and the last one goes on
        is_sure = np.abs(sine) > NO_DIGIT_LEFT
        last = np.maximum.accumulate(np.where(is_sure, np.arange(sine.size), -1))
        signs = np.where(last < 0, self.branch, signs[last])
        command = Command(
            theta_2,
            signs.astype(np.int8),
            omega_2,
            alpha_2,
            time=reported,
            origin=ReleaseOrigin(bar.astype(np.int8), *independent),
        )
        energies = [stretch.energies for stretch in self.stretches]
        energy, work = np.concatenate(energies, axis=1)
        largest = float(np.max(np.abs([energy, work])))
        drift = float(np.max(np.abs(energy - energy[0] - work)))
        released = Released(
            command.part(np.isin(reported, times)),
            drift / largest if largest else 0.0,
            # two may lie within one step
            tuple(sorted({time for time in self.change_points if time <= times[-1]})),
            command,
        )
        released._run = self
        return released
