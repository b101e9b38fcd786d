"""The command to one moving bar.

A command is one of angles, a sweep, a limit position, a law over time, and release.
"""

import math
import sys
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache
from itertools import accumulate
from typing import Annotated, Any

import numpy as np

from fourbar.errors import (
    InputError,
    expect,
    needing,
    write_in_units,
)
from fourbar.formulas.mobility import TURN
from fourbar.linkage import (
    A_BRANCH,
    AT_LEAST_ZERO,
    MOST_INTERVALS,
    MOVING_BARS,
    POSITIVE,
    Declared,
    Described,
    Listed,
    OneOf,
    Whole,
    record,
    require,
    require_numbers,
    require_whole,
)
from fourbar.quantities import Array

OPEN = 1
CROSSED = -1
BRANCH_NAMES = {OPEN: "open", CROSSED: "crossed"}
BRANCH_OF_NAME = {name: branch for branch, name in BRANCH_NAMES.items()}
LARGEST_SPEED = math.sqrt(sys.float_info.max)
"""Largest speed, rad/s. The square of a greater one is beyond the range of a double,
and so is every acceleration.
"""
COMMAND_NAMES = {
    bar: (f"theta_{bar}", f"omega_{bar}", f"alpha_{bar}") for bar in MOVING_BARS
}
"""Names of the commanded angle, speed and acceleration by bar."""
BAR_OF_ANGLE = {names[0]: bar for bar, names in COMMAND_NAMES.items()}
STROKE_COMMAND = ("stroke", "stroke_speed", "stroke_acceleration")
"""Names of the commanded stroke, speed and acceleration of a cylinder."""
_COMMANDS = (*COMMAND_NAMES.values(), STROKE_COMMAND)
SIDES = {"left": 1.0, "right": -1.0}
"""Signs of the side on which the moving end of a cylinder lies. The line runs from the
bar's pivot to the end on the ground, and is seen towards the latter.
"""
DEFAULT_STEPS = 360
"""Number of steps of the default range, which is swept if a motion names no angle."""
STEPS = Whole(1, MOST_INTERVALS)
"""Declaration of the number of intervals of any motion."""
_Steps = Annotated[int, STEPS]
_Angle = Annotated[float, Declared("rad")]
_FirstAngle = Annotated[float | None, Declared("rad")]
_Duration = Annotated[float, Declared("s", POSITIVE)]
_Pause = Annotated[float, Declared("s", AT_LEAST_ZERO)]
_Angles = Annotated[tuple[float, ...] | None, Listed("rad")]
_Speeds = Annotated[tuple[float, ...] | None, Listed("rad/s")]
_Accelerations = Annotated[tuple[float, ...] | None, Listed("rad/s^2")]
SPLINES = {"free": "not-a-knot", "rest": "clamped", "periodic": "periodic"}
"""End conditions of a law's spline: none, at rest, or one period of a motion."""
FEWEST_POINTS = {"free": 4, "rest": 2, "periodic": 3}
"""Number of points that determine the cubic pieces."""
MOST_LISTED_POSITIONS = 100_000
RISE_LAWS = ("cycloidal", "345")
"""Standard laws of a rise."""
SINE_LAW = "sine"
LAW_KINDS = (*RISE_LAWS, SINE_LAW)
"""Kinds of a law that is no table."""


@record
class Sweep:
    """The commanded angle from `start` to `stop` (rad) in `steps` equal intervals.

    Both ends are included. A sweep of the stroke has lengths in place of angles, m. The
    motion reads ends that are texts with units.
    """

    start: float
    stop: float
    steps: int

    def __post_init__(self) -> None:
        steps = STEPS.check("motion.theta_2.steps", self.steps)
        object.__setattr__(self, "steps", steps)  # the class is frozen


@record
class FromLimit(Described):
    """Limit position number `limit` of the commanded bar, plus `offset` (rad).

    The numbers are 1, 2, ... from theta_1 on.
    """

    limit: Annotated[int, Whole(1, 4)]
    offset: _Angle = 0.0
    stated_at = "motion.theta_2"


@record
class Free(Described):
    """Released motion for `duration` (s), reported at `steps` equal intervals.

    Loads and effects alone move the linkage.
    """

    duration: _Duration
    steps: _Steps
    stated_at = "motion.free"


def _find_command(key: str, stated: Any) -> tuple[str, str, str] | None:
    """Return the names of the command whose numbers a motion or a law states, or None.

    Raises InputError for numbers of two commands.
    """
    found = None
    for names in _COMMANDS:
        for name in names:
            number = getattr(stated, name, None)
            rests = name == names[2] and type(number) is float and not number
            if number is None or rests:
                continue
            if found not in (None, names):
                others = ", ".join(found)
                allowed = f"must be left out beside {others}: one bar is commanded"
                raise InputError(f"{key}.{name}", number, allowed)
            found = names
    return found


class _OverTime:
    """A law over time: its bar, and the times at which it is evaluated."""

    __slots__ = ()

    @property
    def bar(self: Any) -> int:
        """Number of the bar whose angle the law gives: 2, 3 or 4."""
        names = _find_command("motion.law", self) or COMMAND_NAMES[2]
        return BAR_OF_ANGLE[names[0]]

    @property
    def angle(self: Any) -> Any:
        """Stated angles of the law's bar, one for each time of a table, rad."""
        return getattr(self, f"theta_{self.bar}")

    def times(self: Any) -> Array:
        """Return the times at which the law is evaluated, (steps + 1,), s."""
        return np.linspace(self.time[0], self.time[-1], self.steps + 1)


@record
class Law(Described, _OverTime):
    """theta_2(t) through the points of a table.

    A law of angles alone is piecewise cubic, with a continuous acceleration. Speeds at
    the points make each piece the cubic between its ends, and accelerations beside them
    the quintic.

    Parameters
    ----------
    time : rising, s.
    theta_2, theta_3, theta_4 : one angle of the commanded bar for each time, rad; the
        others are left out.
    steps : the law is evaluated at the ends of so many equal intervals of time.
    ends : "free", "rest" (speed 0 at both ends) or "periodic" (the speed and
        acceleration at the end are those at the start; the angle may have gained whole
        turns). It is of angles alone.
    omega_2, alpha_2, ... : one speed and one acceleration of the commanded bar for each
        time, rad/s and rad/s^2; accelerations need speeds.
    """

    time: Annotated[tuple[float, ...], Listed("s")]
    theta_2: _Angles = None
    steps: _Steps = 360
    ends: Annotated[str, OneOf((*SPLINES,))] = "free"
    theta_3: _Angles = None
    theta_4: _Angles = None
    omega_2: _Speeds = None
    omega_3: _Speeds = None
    omega_4: _Speeds = None
    alpha_2: _Accelerations = None
    alpha_3: _Accelerations = None
    alpha_4: _Accelerations = None
    stated_at = "motion.law"

    def __post_init__(self) -> None:
        Described.__post_init__(self)
        key = self.stated_at
        time = self.time
        angles = self.angle or ()
        self._require_rates()
        fewest = FEWEST_POINTS[self.ends] if self.omega is None else 2
        may_be = range(fewest, MOST_LISTED_POSITIONS + 1)
        if len(time) != len(angles) or len(time) not in may_be:
            allowed = (
                f"needs {fewest} to {MOST_LISTED_POSITIONS} times and as many angles"
            )
            raise InputError(key, (len(time), len(angles)), allowed)
        if (np.diff(time) <= 0.0).any():
            raise InputError(f"{key}.time", time, "must rise", unit="s")

    def _require_rates(self) -> None:
        """Raise InputError for speeds and accelerations that do not fit the times."""
        key = self.stated_at
        if self.alpha is not None and self.omega is None:
            allowed = f"needs the speeds omega_{self.bar} beside it"
            raise InputError(f"{key}.alpha_{self.bar}", None, allowed)
        if self.omega is not None and self.ends != "free":
            allowed = "must be left out: the speeds state what the ends do"
            raise InputError(f"{key}.ends", self.ends, allowed)
        count = len(self.time)
        for name, rates in (("omega", self.omega), ("alpha", self.alpha)):
            if rates is not None and len(rates) != count:
                of_bar = f"{key}.{name}_{self.bar}"
                raise InputError(of_bar, len(rates), f"needs {count}, one for a time")

    @property
    def omega(self) -> Any:
        """Speeds of the law's bar at its times, rad/s, or None."""
        return getattr(self, f"omega_{self.bar}")

    @property
    def alpha(self) -> Any:
        """Accelerations of the law's bar at its times, rad/s^2, or None."""
        return getattr(self, f"alpha_{self.bar}")

    def at(self, time: Array) -> tuple[Array, Array, Array]:
        """Compute angle, speed and acceleration of the law's bar at times, each (n,).

        The times lie within the table.

        Raises DependencyError where SciPy is not installed.
        """
        with needing("SciPy is needed for a motion law", "studies"):
            from scipy.interpolate import CubicSpline
        time = require_numbers("time", time)
        t = np.array(self.time)
        angle = np.array(self.angle)
        mean = 0.0
        if self.ends == "periodic":
            # what is periodic is the departure from the mean speed
            mean = (angle[-1] - angle[0]) / (t[-1] - t[0])
            angle = angle - mean * (t - t[0])
            angle[-1] = angle[0]
        if self.omega is None:
            curve = CubicSpline(t, angle, bc_type=SPLINES[self.ends])
        else:
            rates = [self.omega] if self.alpha is None else [self.omega, self.alpha]
            curve = _fit_rates(self.time, self.angle, *rates)
        theta, omega, alpha = (np.asarray(curve(time, order)) for order in range(3))
        if self.omega is not None or self.ends == "rest":
            # a polynomial rounds where it ends, which must not move what rests there
            last = 0.0 if self.omega is None else self.omega[-1]
            omega = np.where(time == t[-1], last, omega)
        return theta + mean * (time - t[0]), omega + mean, alpha


def _rise(kind: str, time: Array, duration: float) -> tuple[Array, Array, Array]:
    """Compute a law that rises from 0 to 1 over a duration, and its rates by time.

    With u = time/duration, cycloidal: u - sin(2 pi u)/(2 pi);   345: 10 u^3 - 15 u^4 +
    6 u^5. Speed and acceleration are 0 at both ends, before and after.
    """
    u = np.clip(time / duration, 0.0, 1.0)
    v = 1.0 - u
    if kind == "cycloidal":
        near = np.minimum(u, v)
        rises = u <= v
        sine = np.sin(TURN * near)
        risen = near - sine / TURN
        angle = np.where(rises, risen, 1.0 - risen)
        speed = 1.0 - np.cos(TURN * near)
        acceleration = TURN * np.where(rises, sine, -sine)
    else:
        angle = u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
        speed = 30.0 * (u * v) ** 2
        acceleration = 60.0 * u * v * (v - u)
    return angle, speed / duration, acceleration / (duration * duration)


@record
class Rise(Described, _OverTime):
    """An angle that rises by a standard law, dwells, falls and rests.

    Parameters
    ----------
    kind : "cycloidal" or "345".
    rise : (angle, duration): how far the bar turns from its first angle and in which
        time, rad and s; a negative angle turns clockwise.
    theta_2, theta_3, theta_4 : first angle of the commanded bar, rad; the others are
        left out.
    dwell : time at the end of the rise, s, >= 0.
    fall : time in which the bar returns by the same law, s; left out: it does not.
    rest : time at the first angle after the fall, s, >= 0.
    steps : the law is evaluated at the ends of so many equal intervals of time.

    >>> Rise("cycloidal", ("60 deg", "0.5 s"), theta_2="20 deg", dwell="0.2 s").time
    (0.0, 0.5, 0.7)
    """

    kind: Annotated[str, OneOf(RISE_LAWS)]
    rise: Annotated[tuple[float, float], Declared("rad", pair="s")]
    theta_2: _FirstAngle = None
    dwell: _Pause = 0.0
    fall: Annotated[float | None, Declared("s", POSITIVE)] = None
    rest: _Pause = 0.0
    steps: _Steps = 360
    theta_3: _FirstAngle = None
    theta_4: _FirstAngle = None
    stated_at = "motion.law"

    def __post_init__(self) -> None:
        Described.__post_init__(self)
        key = self.stated_at
        if self.angle is None:
            raise InputError(f"{key}.theta_2", None, "the first angle is missing")
        if not self.rise[1] > 0.0:
            allowed = "must last longer than 0 s"
            raise InputError(f"{key}.rise", self.rise[1], allowed, unit="s")
        if self.rest > 0.0 and self.fall is None:
            allowed = "needs a fall before it"
            raise InputError(f"{key}.rest", self.rest, allowed, unit="s")

    @property
    def time(self) -> tuple[float, ...]:
        """Times at which rise, dwell, fall and rest begin and end, s.

        Parts that last no time have none.
        """
        _, rise_time = self.rise
        durations = (rise_time, self.dwell, self.fall or 0.0, self.rest)
        lasting = [duration for duration in durations if duration > 0.0]
        return tuple(accumulate(lasting, initial=0.0))

    def at(self, time: Array) -> tuple[Array, Array, Array]:
        """Compute angle, speed and acceleration of the law's bar, each (n,)."""
        time = require_numbers("time", time)
        angle, duration = self.rise
        place, speed, acceleration = _rise(self.kind, time, duration)
        if self.fall is not None:
            start = duration + self.dwell
            # the end is that of `time`, so that nothing moves there by rounding
            lasts = (start + self.fall) - start
            late = time - start
            fallen, fall_speed, fall_acceleration = _rise(self.kind, late, lasts)
            place = place - fallen
            speed = speed - fall_speed
            acceleration = acceleration - fall_acceleration
        place = self.angle + angle * place
        return place, angle * speed, angle * acceleration


@record
class Sine(Described, _OverTime):
    """theta_2 = mean + amplitude sin(frequency t + phase), from t = 0 on.

    Parameters
    ----------
    mean, amplitude : rad.
    frequency : rad/s, > 0.
    duration : s.
    phase : rad.
    steps : the law is evaluated at the ends of so many equal intervals of time.

    >>> swing = Sine("1 rad", "30 deg", "0.5 rev/s", "4 s")
    >>> [round(float(x[0]), 6) for x in swing.at([0.5])]
    [1.523599, 0.0, -5.167713]
    """

    mean: _Angle
    amplitude: _Angle
    frequency: Annotated[float, Declared("rad/s", POSITIVE)]
    duration: _Duration
    phase: _Angle = 0.0
    steps: _Steps = 360
    kind: Annotated[str, OneOf((SINE_LAW,))] = SINE_LAW
    stated_at = "motion.law"
    bar = 2

    @property
    def time(self) -> tuple[float, float]:
        """Times at which the law begins and ends, s."""
        return 0.0, self.duration

    def at(self, time: Array) -> tuple[Array, Array, Array]:
        """Compute angle, speed and acceleration of the law's bar, each (n,)."""
        phase = self.frequency * require_numbers("time", time) + self.phase
        swing = self.amplitude * np.sin(phase)
        cosine = np.cos(phase)
        # what turns back there is at rest, and does not move by the phase's rounding
        rounding = 2.0 * np.finfo(float).eps * np.maximum(1.0, np.abs(phase))
        cosine = np.where(np.abs(cosine) <= rounding, 0.0, cosine)
        omega = self.amplitude * self.frequency * cosine
        return self.mean + swing, omega, -(self.frequency**2) * swing


@lru_cache(maxsize=16)
def _fit_rates(time: tuple[float, ...], *values: tuple[float, ...]) -> Any:
    """Fit the polynomials through angles and their rates at the times of a table.

    An engine asks for them at each of its steps.
    """
    from scipy.interpolate import BPoly

    return BPoly.from_derivatives(np.array(time), np.stack(values, axis=1))


_Places = Annotated[Any, Declared("rad")]
_Rate = Annotated[Any, Declared("rad/s")]
_Growth = Annotated[Any, Declared("rad/s^2")]


@dataclass(frozen=True, slots=True, eq=False)
class Motion(Described):
    """The command to one moving bar, the input unless numbers of bar 3 or 4 are stated.

    Numbers may be texts with units instead, like "60 rpm".

    Parameters
    ----------
    theta_2 : one angle, an array of them (n,), a Sweep, a FromLimit, or None (the
        default range), rad.
    omega_2 : rad/s, one for all angles or, with an array of these, one for each (n,);
        None: positions only.
    alpha_2 : rad/s^2, likewise.
    branch : "open" or +1, "crossed" or -1: the assembly. Open has
        sin(theta_4 - theta_3) > 0 for 0 < theta_2 - theta_1 < 180 deg, and at every
        other angle that it reaches smoothly from there, through change points too.
        Where bar 3 is commanded it is sin(theta_4 - theta_2), by theta_3; where bar 4
        is, it is sin(theta_3 - theta_2), for 180 deg < theta_4 - theta_1 < 360 deg.
    free : released motion instead of a prescribed one.
    law : an angle over time instead of theta_2, omega_2 and alpha_2: a Law through
        points, a Rise, or a Sine.
    theta_3, omega_3, alpha_3, theta_4, omega_4, alpha_4 : of the coupler or the output
        instead.
    stroke, stroke_speed, stroke_acceleration : of the scene's cylinder between the
        ground and bar 2 or 4 instead: one stroke, an array of them or a Sweep, m; m/s;
        m/s^2.
    side : "left" or "right", with a stroke: on which side of the line from the bar's
        ground pin to the cylinder's end on the ground, seen towards that end, its end
        on the bar lies.
    """

    theta_2: _Places = None
    omega_2: _Rate = None
    alpha_2: _Growth = 0.0
    branch: int = OPEN
    """Assembly, +1 open or -1 crossed."""
    free: Free | None = None
    law: Law | Rise | Sine | None = None
    theta_3: _Places = None
    omega_3: _Rate = None
    alpha_3: _Growth = 0.0
    theta_4: _Places = None
    omega_4: _Rate = None
    alpha_4: _Growth = 0.0
    stroke: Annotated[Any, Declared("m")] = None
    stroke_speed: Annotated[Any, Declared("m/s")] = None
    stroke_acceleration: Annotated[Any, Declared("m/s^2")] = 0.0
    side: str | None = None
    names: tuple[str, str, str] = field(repr=False, init=False)
    """Names of the commanded position, speed and acceleration."""
    bar: int = field(repr=False, compare=False, init=False)
    """Number of the commanded bar, 2, 3 or 4. If a stroke is commanded, the scene's
    drive determines it.
    """

    def __post_init__(self) -> None:
        stated = _find_command("motion", self)
        law = self.law
        expect("motion.law", law, Law, Rise, Sine, type(None))
        expect("motion.free", self.free, Free, type(None))
        if stated == STROKE_COMMAND or self.side is not None:
            if self.stroke is None:
                allowed = "is missing: side and stroke_speed are of a stroke"
                raise InputError("motion.stroke", None, allowed)
            OneOf((*SIDES,)).check("motion.side", self.side)
            if self.free is not None:
                allowed = "is commanded alone: no release besides"
                raise InputError("motion.stroke", self.stroke, allowed)
        names = stated or COMMAND_NAMES[2 if law is None else law.bar]
        if law is not None and (stated or self.free is not None):
            of_law = COMMAND_NAMES[law.bar]
            allowed = f"stands alone: it gives {', '.join(of_law[:2])} and {of_law[2]}"
            raise InputError("motion.law", "a law", allowed)
        branch: Any = self.branch
        if isinstance(branch, str):
            branch = BRANCH_OF_NAME.get(branch, branch)
        checked = {
            **dict(zip(names, self._check(names), strict=True)),
            "branch": require_whole("motion.branch", branch, BRANCH_NAMES, A_BRANCH),
            "names": names,
            "bar": BAR_OF_ANGLE.get(names[0], 2),
        }
        for name, value in checked.items():
            # the class is frozen; this is its constructor
            object.__setattr__(self, name, value)

    def _check(self, names: tuple[str, str, str]) -> tuple[Any, Any, Any]:
        """Return the numbers of the command of these names, checked."""
        angle, speed, acceleration = (getattr(self, name) for name in names)
        angle = _require_places(names[0], angle)
        if speed is not None:
            speed = _require_rates(names[1], speed, angle)
            highest = float(np.max(np.abs(speed)))
            if not math.isfinite(highest * highest):
                unit = Motion.numbers[names[1]].unit
                fastest = write_in_units(unit, LARGEST_SPEED)
                allowed = f"must be below {fastest}: every acceleration has its square"
                raise InputError(f"motion.{names[1]}", highest, allowed, unit=unit)
        return angle, speed, _require_rates(names[2], acceleration, angle)

    @property
    def commanded(self) -> str:
        """Name of what is commanded: "theta_2", "theta_3", "theta_4" or "stroke"."""
        return self.names[0]

    @property
    def angle(self) -> Any:
        """Commanded angle, rad, or stroke, m: one, an array (n,), a Sweep, a FromLimit.

        None: the default range, or what a law states.
        """
        return getattr(self, self.names[0])

    @property
    def speed(self) -> Any:
        """Commanded speed, rad/s, or m/s of a stroke; (n,) if each angle has its own.

        None: positions only.
        """
        return getattr(self, self.names[1])

    @property
    def acceleration(self) -> Any:
        """Commanded acceleration, rad/s^2, or m/s^2 of a stroke; likewise."""
        return getattr(self, self.names[2])

    def replace(self, **changes: Any) -> "Motion":
        """Return a copy with other values of fields.

        Besides the constructor's keywords, angle, speed and acceleration are those of
        what this motion commands, a bar or a stroke.
        """
        names = dict(zip(("angle", "speed", "acceleration"), self.names, strict=True))
        keywords = {names.get(name, name): value for name, value in changes.items()}
        return replace(self, **keywords)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Motion) and self._list_values() == other._list_values()

    def __hash__(self) -> int:
        return hash(self._list_values())

    def _list_values(self) -> tuple[object, ...]:
        """List what motions are compared by, arrays as tuples."""
        values = (getattr(self, one.name) for one in fields(self) if one.compare)
        return tuple(tuple(x) if isinstance(x, np.ndarray) else x for x in values)

    @property
    def has_rate_of_each(self) -> bool:
        """True if each angle has a speed or an acceleration of its own."""
        rates = self.speed, self.acceleration
        return any(isinstance(rate, np.ndarray) for rate in rates)

    def find_rates(self, places: Array) -> tuple[float | Array | None, float | Array]:
        """Return speed and acceleration at commanded places (n,): one each, or (n,).

        Raises InputError for a place without rates, where each angle has its own.
        """
        rates = self.speed, self.acceleration
        if not self.has_rate_of_each or (
            places.shape[-1:] == self.angle.shape and (places == self.angle).all()
        ):
            return rates
        rows = dict(zip(self.angle.tolist(), range(len(self.angle)), strict=True))
        chosen: Any = [*map(rows.get, places.ravel().tolist())]
        if None in chosen:
            raise InputError(
                f"motion.{self.names[1 if isinstance(self.speed, np.ndarray) else 2]}",
                f"{len(self.angle)} numbers",
                "are those of the stated positions: no other has one",
            )
        index = np.array(chosen, dtype=int).reshape(places.shape)
        speed, acceleration = (
            rate[index] if isinstance(rate, np.ndarray) else rate for rate in rates
        )
        return speed, acceleration


def _require_places(name: str, stated: Any) -> Any:
    """Return commanded angles, or strokes above 0, checked."""
    key = f"motion.{name}"
    unit = Motion.numbers[name].unit
    if stated is None or (isinstance(stated, FromLimit) and unit == "rad"):
        return stated
    if isinstance(stated, Sweep):
        start = require(f"{key}.from", stated.start, unit)
        stop = require(f"{key}.to", stated.stop, unit)
        if not math.isfinite(stop - start):
            allowed = f"must be within the range of doubles from {start!r}"
            raise InputError(f"{key}.to", stop, allowed)
        places = np.array([start, stop])
        stated = Sweep(start, stop, stated.steps)
    else:
        places = require_numbers(key, stated, unit=unit)
        if places.size == 0:
            raise InputError(key, stated, "must be one position or more")
        places.flags.writeable = False
        stated = float(places) if places.ndim == 0 else places
    if unit == "m" and not places.min() > 0.0:
        raise InputError(key, float(places.min()), "must be above 0", unit=unit)
    return stated


def _require_rates(name: str, rates: Any, angle: Any) -> float | Array:
    """Return one rate, or an array of one for each angle, checked."""
    key = f"motion.{name}"
    array = require_numbers(key, rates, unit=Motion.numbers[name].unit)
    if array.ndim == 0:
        return float(array)
    listed = len(angle) if isinstance(angle, np.ndarray) else 0
    if not listed or len(array) != listed:
        allowed = f"must be one number, or one for each listed position: {listed}"
        raise InputError(key, f"{len(array)} numbers", allowed)
    array.flags.writeable = False
    return array


def require_steps(motion: Motion, most: int, place: str, file: str) -> None:
    """Raise InputError for as many steps or more.

    Every step of a sweep, a law or a release is a position in the memory.
    """
    stated = {motion.commanded: motion.angle, "law": motion.law, "free": motion.free}
    for name, part in stated.items():
        steps = getattr(part, "steps", 0)
        if steps >= most:
            raise InputError(
                f"motion.{name}.steps",
                steps,
                f"must be below {most} {place}",
                file,
            )
