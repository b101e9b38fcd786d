"""Free motion: the linkage released and moved by loads and effects alone, integrated by SciPy.

The reduced equation J q'' + J'/2 q'^2 = Q is integrated with q = theta_2 or q = theta_4, whichever
is further from its limit position: bars 3, 4 collinear stop theta_2, bars 2, 3 collinear stop
theta_4, and both at once happen at a change point alone, where the path itself is regular. The
loop therefore closes to round-off at every instant, and nothing drifts off it.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fourbar.dynamics import (
    VANISHING,
    Path,
    Power,
    acceleration,
    along_input,
    carrying,
    generalised_force,
    inertia,
    kinetic_energy,
    trace,
    triangle,
)
from fourbar.errors import DependencyError, FourBarError, InputError
from fourbar.linkage import FourBar
from fourbar.state import Array

RELATIVE, ABSOLUTE = 3e-15, 3e-15
"""Tolerances of a step of DOP853: below them a long fast motion errs by its round-off."""
SCIPY_LEAST = 100.0 * 2.0**-52
"""The least relative tolerance that SciPy's constructor takes without a warning; the solver itself works with less."""
CHANGE_OVER = 0.5
"""The angle is changed when its sine falls below this times the sine of the other one."""
STEPS = 200_000
"""A motion that needs more steps than this is given up, after a few minutes: some hundred turns of the fastest bar
take a thousand, so it is thousands of turns long, or something makes it infinitely fast."""


@dataclass(slots=True, eq=False)
class FreeMotion:
    """What the linkage did at the times asked for, until it stopped."""

    time: Array
    """(n,), s; ends before `stopped_at` where the motion did."""
    theta_2: Array
    """(n,), rad, continuous."""
    omega_2: Array
    alpha_2: Array
    branch: NDArray[np.int8]
    energy_drift: float
    """Largest |kinetic energy - work done| over the motion, by the largest of either; 0 where nothing moves."""
    stopped_at: float | None = None
    """Time at which a limit position or change point was reached, s; None: the whole duration was run."""


@dataclass(slots=True)
class _Chart:
    """The independent angle: that of bar 2 or bar 4, and the constants of its path."""

    linkage: FourBar
    bar: int
    sign: float = 1.0

    def path(self, q: float) -> Path:
        """The path at q; bar 4 is the input of the same loop read backwards from O4."""
        d, a, b, c = self.linkage.lengths
        theta_1 = self.linkage.ground_angle
        if self.bar == 2:
            return along_input(self.linkage, triangle(d, a, b, c, touching=True), q, self.sign, follow=True)
        back, u_2, t_3, t_2, tt_3, tt_2, _, slip, sine = trace(
            triangle(d, c, b, a, touching=True), theta_1 + math.pi, q, self.sign, follow=True
        )
        u = complex(math.cos(q), math.sin(q))
        return Path({2: u_2, 3: -back, 4: u}, {2: t_2, 3: t_3, 4: 1.0}, {2: tt_2, 3: tt_3, 4: 0.0}, slip, sine)


def _sines(way: Path) -> tuple[float, float]:
    """sin(theta_4 - theta_3) and sin(theta_3 - theta_2): zero at the limits of theta_2 and of theta_4."""
    u2, u3, u4 = way.unit[2], way.unit[3], way.unit[4]
    return float((u3.conjugate() * u4).imag), float((u2.conjugate() * u3).imag)


def release(
    linkage: FourBar,
    terms: Iterable[Power],
    theta_2: float,
    omega_2: float,
    branch: int,
    times: Array,
    *,
    follow: bool = False,
) -> FreeMotion:
    """The motion from theta_2 with omega_2 under the terms, with no driving torque.

    To 1e-9 rad over 5 s wherever the motion itself does not amplify errors by more than 1000.

    Parameters
    ----------
    terms : loads and effects.
    branch : +1 or -1, of the start.
    times : (n,) rising from 0, s.
    follow : run through limit positions and change points; otherwise the motion stops there.

    Raises
    ------
    InputError : the linkage does not assemble at theta_2, or the motion takes more than STEPS steps.
    FourBarError : nothing that moves has inertia, or the motion cannot be continued.
    DependencyError : SciPy is not installed.
    """
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        terms = tuple(terms)
        return _Run(carrying(linkage, terms), terms, theta_2, omega_2, branch, follow).through(times)


class _Run:
    """One integration: its angle, and what has been reported so far."""

    def __init__(
        self, linkage: FourBar, terms: tuple[Power, ...], theta_2: float, omega_2: float, branch: int, follow: bool
    ) -> None:
        self.linkage, self.terms, self.follow, self.branch = linkage, terms, follow, branch
        self.chart = _Chart(linkage, 2)
        # the sign of the path is that of the branch just after the start, should that be a change point
        ahead = theta_2 + math.copysign(1e-8, omega_2)
        for near in (theta_2, ahead, 2.0 * theta_2 - ahead):
            sine = float(self.chart.path(near).sine)
            if sine != 0.0 and math.isfinite(sine):
                self.chart.sign = branch * math.copysign(1.0, sine)
                break
        way = self.chart.path(theta_2)
        if not math.isfinite(way.sine):
            raise InputError("motion.theta_2", theta_2, "the linkage does not assemble there")
        self.theta = {2: theta_2, 4: float(np.angle(way.unit[4]))}
        self.state = np.array([theta_2, omega_2, 0.0])
        if not float(inertia(linkage, way)[0]) > 0.0:
            raise FourBarError("nothing that moves has inertia: the free motion is undetermined")
        self._change_over()
        self.side = 0.0  # the way it moves, where dry friction makes the two ways different
        self.dry = self._is_dry()
        self.start_energy = float(kinetic_energy(linkage, self._way(), self.state[1]))

    def _way(self) -> Path:
        return self.chart.path(float(self.state[0]))

    def _is_dry(self) -> bool:
        way = self._way()
        either = [generalised_force(self.linkage, way, side, self.terms) for side in (VANISHING, -VANISHING)]
        return bool(either[0] != either[1])

    def _rates(self, _: float, y: Array) -> list[float]:
        way = self.chart.path(float(y[0]))
        rate = float(y[1])
        # beyond a standstill friction keeps its sense, until the step is cut there
        moving = self.side * max(self.side * rate, VANISHING) if self.side else rate
        Q = generalised_force(self.linkage, way, moving, self.terms)
        return [rate, float(acceleration(self.linkage, way, rate, Q)), float(Q * rate)]

    def _change_over(self) -> bool:
        """Take the other angle where it is further from its limit; keeps position, velocity and work."""
        way = self._way()
        to_3, to_4 = (abs(sine) for sine in _sines(way))
        own, other = (to_3, to_4) if self.chart.bar == 2 else (to_4, to_3)
        if own >= CHANGE_OVER * other:
            return False
        bar = 6 - self.chart.bar
        q = self.theta[bar]
        chart = _Chart(self.linkage, bar)
        wanted = _sines(way)[0 if bar == 2 else 1]
        chart.sign = math.copysign(1.0, float(chart.path(q).sine) * wanted)
        rate = float(self.state[1] * way.first[bar]) if self.state[1] else 0.0
        self.chart, self.state = chart, np.array([q, rate, self.state[2]])
        return True

    def _turn(self, way: Path) -> None:
        """Bring theta_2 and theta_4 up to date, continuous from one step to the next."""
        for bar in (2, 4):
            now = float(np.angle(way.unit[bar]))
            self.theta[bar] = now + 2.0 * math.pi * round((self.theta[bar] - now) / (2.0 * math.pi))

    def _starts(self) -> bool:
        """Whether it moves on: at a standstill dry friction holds what is weaker than it."""
        self.side = 0.0
        rate = float(self.state[1])
        if not self.dry:
            return True
        if rate == 0.0:
            way = self._way()
            ahead, back = (generalised_force(self.linkage, way, s, self.terms) for s in (VANISHING, -VANISHING))
            if ahead <= 0.0 <= back:
                return False
            rate = 1.0 if ahead > 0.0 else -1.0
        self.side = math.copysign(1.0, rate)
        return True

    def through(self, times: Array) -> FreeMotion:
        """Integrate over the times and report."""
        DOP853, brentq = _scipy()
        rows: list[tuple[float, ...]] = []
        t, end, steps, stopped = 0.0, float(times[-1]), 0, None
        worst, largest = 0.0, self.start_energy

        def report(upto: float, at: Callable[[float], Array]) -> None:
            while len(rows) < len(times) and times[len(rows)] <= upto:
                rows.append(self._row(at(float(times[len(rows)]))))

        report(0.0, lambda _: self.state)
        while t < end and stopped is None:
            if not self._starts():
                report(end, lambda _: self.state)
                break
            solver = DOP853(self._rates, t, self.state, end, rtol=SCIPY_LEAST, atol=ABSOLUTE)
            solver.rtol = RELATIVE
            while solver.status == "running" and stopped is None:
                steps += 1
                message = solver.step()
                if solver.status == "failed":
                    raise FourBarError(f"the free motion cannot be continued beyond {t!r} s: {message}")
                if steps > STEPS:
                    allowed = f"this motion is followed for {STEPS} steps, here to {t:.6g} s; make it shorter"
                    raise InputError("motion.free.duration", end, allowed)
                dense, t_new, new = solver.dense_output(), solver.t, solver.y
                rested = bool(self.side and self.side * new[1] < 0.0)
                if rested:
                    t_new = self._root(brentq, dense, self._rate, solver.t_old, t_new)
                    new = np.array([dense(t_new)[0], 0.0, dense(t_new)[2]])
                if not self.follow and self._past(new):
                    stopped = t_new = self._root(brentq, dense, self._sine, solver.t_old, t_new)
                    new = dense(t_new)
                report(t_new, dense)
                t, self.state = t_new, np.array(new)
                way = self._way()
                self._turn(way)
                energy = float(kinetic_energy(self.linkage, way, self.state[1])) - self.start_energy
                worst = max(worst, abs(energy - float(self.state[2])))
                largest = max(largest, abs(energy + self.start_energy), abs(float(self.state[2])))
                if rested or self._change_over():
                    break
        done = np.array(rows).reshape(-1, 4)
        return FreeMotion(
            np.asarray(times[: len(done)]),
            done[:, 0],
            done[:, 1],
            done[:, 2],
            done[:, 3].astype(np.int8),
            worst / largest if largest else 0.0,
            stopped,
        )

    @staticmethod
    def _root(
        brentq: Any, dense: Callable[[float], Array], f: Callable[[Array], float], low: float, high: float
    ) -> float:
        """The time at which f of the state is zero; the start of the step where it is zero there already."""
        if f(dense(low)) * f(dense(high)) >= 0.0:
            return low
        return float(brentq(lambda t: f(dense(t)), low, high, xtol=1e-15, rtol=1e-15))

    def _rate(self, y: Array) -> float:
        return float(y[1])

    def _sine(self, y: Array) -> float:
        """sin(theta_4 - theta_3): zero where bars 3, 4 lie in one line."""
        return _sines(self.chart.path(float(y[0])))[0]

    def _past(self, y: Array) -> bool:
        """Whether bars 3, 4 have gone through their common line."""
        return self.branch * self._sine(y) < 0.0

    def _row(self, y: Array) -> tuple[float, ...]:
        """theta_2, omega_2, alpha_2 and branch of one instant."""
        q, rate = float(y[0]), float(y[1])
        way = self.chart.path(q)
        now = float(np.angle(way.unit[2]))
        theta_2 = now + 2.0 * math.pi * round((self.theta[2] - now) / (2.0 * math.pi))
        if self.chart.bar == 2:
            theta_2 = q
        still = self.dry and rate == 0.0 and not self.side
        q_2 = 0.0 if still else self._rates(0.0, y)[1]
        omega_2 = way.first[2] * rate
        alpha_2 = way.first[2] * q_2 + way.second[2] * rate * rate
        sine = _sines(way)[0]
        return theta_2, float(omega_2), float(alpha_2), math.copysign(1.0, sine) if sine else float(self.branch)


def _scipy() -> tuple[Any, Any]:
    try:
        from scipy.integrate import DOP853
        from scipy.optimize import brentq
    except ModuleNotFoundError:
        raise DependencyError('SciPy is needed for free motion: pip install "fourbar[dynamics]"') from None
    return DOP853, brentq
