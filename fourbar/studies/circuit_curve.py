"""The circuit of a scene as a curve that can be walked through its limits.

The generalized force along it is computed here too.

With psi = theta_2 - theta_1 and mu = theta_4 - theta_3, the diagonal from A to O4,
squared, is in both triangles
    a^2 + d^2 - 2 a d cos psi = b^2 + c^2 - 2 b c cos mu,
and along the curve, by a parameter s that does not stop where a bar reverses,
    theta_2' = sin(theta_4 - theta_3),
    theta_3' = (a/b) sin(theta_2 - theta_4),
    theta_4' = (a/c) sin(theta_2 - theta_3).
All three vanish at change points alone.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from fourbar.effects.effect import Actions
from fourbar.errors import NotAssembledError
from fourbar.evaluation.case import Case
from fourbar.formulas.arithmetic import Number, polar, sine
from fourbar.formulas.mobility import (
    TURN,
    change_points,
    circuits,
    find_circuit,
    turns_fully,
)
from fourbar.formulas.motion import Coefficients, State, rates
from fourbar.formulas.path import count_turns
from fourbar.formulas.position import Loop, Position, half_angle, loop
from fourbar.quantities import Array, Indices, Mask
from fourbar.scene import Command, Scene, command, find_signs
from fourbar.scene.motion import Sweep
from fourbar.solution import Solution
from fourbar.solving import solve
from fourbar.studies.course import MotionCourse
from fourbar.studies.passing import say_nowhere
from fourbar.studies.sloped import Sloped, take_slopes

POSITIONS_OF_A_BRANCH = 3600
"""Positions of a whole branch that are looked at for friction and for zeros."""
ROUND_OFF_OF_Q = 1e-11
"""Fraction of the sum of the absolute terms of Q that is round-off. A Q no larger than
this everywhere is zero.
"""
AT_END_OF_SWEEP = 1e-12
"""rad; an equilibrium so near to an end of the sweep is in it."""


class RestPosition(NamedTuple):
    """A position of the linkage, angles in rad."""

    theta_2: float
    theta_3: float
    theta_4: float
    branch: int
    """+1 or -1; 0 at a limit of theta_2, where the two meet."""


class _Sizes(Actions):
    """Sums of the absolute terms of Q, for bars that all turn by 1 rad."""

    size: Any = 0.0

    def force(
        self,
        bar: int,
        force: Any,
        point: Any = 0.0j,
        beyond: Any = None,
    ) -> None:
        super().force(bar, force, point, beyond)
        if bar == 3:
            self.size = self.size + np.abs(force) * self.state.lengths.a

    def moment_about_pin(self, bar: int, moment: Any) -> None:
        self.size = self.size + np.abs(moment)

    def pin_couple(self, pin: str, couple: Any) -> None:
        self.size = self.size + np.abs(couple)


def of_input(scene: Scene) -> Command:
    """Command the input where the scene's motion has it.

    The motion may command another bar or a stroke.
    """
    at = command(scene)
    if at.commanded == "theta_2":
        return at
    solution = solve(scene, "position", at=at)
    closes = solution.assembled
    theta_2 = solution.theta_2[closes]
    assembly = find_signs(scene.linkage, theta_2, solution.branch[closes])
    return Command(theta_2, assembly, None, 0.0)


class CircuitCurve:
    """The circuit of a scene as a closed row of psi and mu.

    psi = theta_2 - theta_1, mu = theta_4 - theta_3.

    The row is sampled by an angle tau: psi itself where the input turns fully,
    otherwise
        psi = middle - half width cos tau,
    on the open branch up to half a turn and back on the crossed one, so that it is
    smooth through the limits. A linkage with change points has the row of its assembly:
    a parallelogram never becomes an antiparallelogram. With a single change point the
    row goes through two turns, after which the assembly repeats: a turn of theta_2
    leads to the mirror image.
    """

    def __init__(self, scene: Scene, which: int = 0) -> None:
        """Take a circuit of the scene's motion, by its place among those `passed`."""
        at, linkage = of_input(scene), scene.linkage
        self.scene, self.case = scene, Case.of(scene)
        self.lengths, self.theta_1 = loop(*linkage.lengths), linkage.ground_angle
        self.ratios = self.case.path.lengths
        """The lengths by a unit near them. No product of them leaves the range of
        doubles.
        """
        numbers = find_circuit(linkage, at.theta_2, at.branch)
        if (numbers < 0).all():
            raise NotAssembledError(say_nowhere(scene))
        if scene.counts_turns:  # from the first position on
            assembly = np.full_like(at.branch, at.branch[0])
            self.case = self.case.begin_with(at._replace(branch=assembly))
        self.swept: Solution | None = None
        """Close positions of a sweep or a law; None: there is neither."""
        if isinstance(scene.motion.angle, Sweep) or scene.motion.law is not None:
            self.swept = MotionCourse(scene, "position").solution
            numbers = find_circuit(linkage, self.swept.theta_2, self.swept.branch)
        self.passed = list(dict.fromkeys(numbers[numbers >= 0].tolist()))
        """Indices of the circuits that the motion passes, in its order."""
        self.number: int = self.passed[which]
        """Index of the circuit."""
        circuit = circuits(linkage)[self.number]
        self.full, singular = turns_fully(linkage), change_points(linkage)
        first = int(at.branch[0])
        self.branch = first if first in circuit.branches else -first
        """Branch of a row without limits, of others that of the first position."""
        turns = int(count_turns(linkage.lengths, 2)) if self.full else 1
        self.period = turns * TURN
        """Angle of the whole row, rad."""
        self.positions = turns * POSITIONS_OF_A_BRANCH
        """Number of positions of the row."""
        self.low, self.high = (end - self.theta_1 for end in circuit.theta_2)
        self.at = at
        self.start = -self.theta_1 if self.full else self.low
        """Least psi of a sweep or a law, else where psi is counted from, rad."""
        self.extent = math.inf
        """Extent of theta_2 in a sweep or a law, rad; inf: there is none."""
        if self.swept is not None:
            theta_2 = self.swept.theta_2[(numbers == self.number) | (numbers < 0)]
            self.start = float(np.nanmin(theta_2)) - self.theta_1
            self.extent = float(np.nanmax(theta_2) - np.nanmin(theta_2))
        self.middle = self.start + 0.5 * min(self.extent, self.period)
        """Place of psi within half a period of which theta_2 is counted, rad."""
        self.grid = np.linspace(0.0, self.period, self.positions, endpoint=False)
        """Places of the samples in the row: limits and change points lie between."""
        self.grid += 0.5 * self.period / self.positions
        points = [
            (point - self.theta_1 + turn, 0.0 if point == self.theta_1 else math.pi)
            for turn in np.arange(0.0, self.period, TURN).tolist()
            for point in singular
        ]
        self.singular = np.reshape(points, (-1, 2))
        """Change points within the sweep as psi and mu, (k, 2)."""
        self.singular = self.singular[self.inside(self.singular[:, 0])]

    def inside(self, psi: Array) -> Mask:
        """Mark where psi lies in the sweep, if one is stated."""
        apart = np.abs(_measure_apart(psi, self.middle, self.period))
        return np.asarray(apart <= 0.5 * self.extent + AT_END_OF_SWEEP)

    def reached(self, tau: Array) -> Mask:
        """Mark the places that the sweep passes, all of them without a sweep.

        The others have the same theta_2 on the other side of a limit or change point
        at which the sweep does not arrive.
        """
        swept = self.swept
        if swept is None:
            return np.ones(len(tau), dtype=bool)
        passes = self._holds(swept.theta_2, swept.branch)
        places = self.tau(swept.theta_2 - self.theta_1, swept.branch)
        steps = _measure_apart(np.diff(places), 0.0, self.period)
        middles = places[:-1] + 0.5 * steps
        apart = np.abs(_measure_apart(tau[:, None], middles, self.period))
        within = apart <= 0.5 * np.abs(steps) + AT_END_OF_SWEEP
        return np.asarray((within & passes[1:] & passes[:-1]).any(axis=1))

    def _holds(self, theta_2: Array, branch: Any) -> Mask:
        """Mark the positions that assemble in this circuit."""
        numbers = find_circuit(self.scene.linkage, theta_2, branch)
        return np.equal(numbers, self.number)

    def points(self, tau: Array) -> Array:
        """Return psi and mu, (n, 2), at places of the row."""
        tau = np.asarray(np.remainder(tau, self.period), dtype=float)
        if self.full:
            psi = self.low + tau
            sign = self.sign(psi)
        else:
            centre = 0.5 * (self.low + self.high)
            psi = centre - 0.5 * (self.high - self.low) * np.cos(tau)
            sign = np.where(tau <= math.pi, 1.0, -1.0)
        return np.stack([psi, sign * transmission_angle(self.ratios, psi)], axis=1)

    def tau(self, psi: Array, sign: Any) -> Array:
        """Return the places in the row of psi on the branches of some signs, rad."""
        psi = self.low + np.remainder(psi - self.low, self.period)
        if self.full:
            return np.asarray(psi - self.low)
        away = 0.5 * (self.low + self.high) - psi
        part = np.arccos(np.clip(2.0 * away / (self.high - self.low), -1.0, 1.0))
        return np.asarray(np.where(np.greater_equal(sign, 0), part, TURN - part))

    def sign(self, psi: Array) -> Array:
        """Return the sign of sin mu in a row without limits, (n,)."""
        root_sign = half_angle(self.ratios, psi).root_sign
        return np.full(psi.shape, self.branch * root_sign)

    def samples(self) -> Array:
        """List places of the row in the sweep, and its ends on each branch, (n,)."""
        places = self.grid
        if self.extent < self.period:
            psi = self.start + np.array([0.0, self.extent])
            sines = np.sin(transmission_angle(self.ratios, psi))
            on_circuit = self._holds(self.theta_1 + psi, self.branch)
            psi = psi[on_circuit & (sines > AT_END_OF_SWEEP)]
            ends = self.tau(psi, 1), self.tau(psi, -1)
            places = np.concatenate([places, *ends])
        places = np.unique(places)
        return places[self.inside(self.points(places)[:, 0])]

    def order(self, tau: Array) -> Indices:
        """Return the indices of the places in the sweep, in order along the row.

        A row that goes round begins where theta_2 is counted from.
        """
        psi = self.points(tau)[:, 0]
        order = np.argsort(self.count(psi) if self.full else tau, kind="stable")
        return order[self.inside(psi[order])]

    def state(self, points: Array) -> State:
        """Compute positions with their derivatives along the curve."""
        return on_curve(self.lengths, self.theta_1, points[:, 0], points[:, 1])

    def _force_of(self, state: State) -> Any:
        actions = Actions(state, self.case.bodies).add(self.case.terms)
        return actions.generalized_forces()[0]

    def generalized_force(self, points: Array) -> Array:
        """Compute Q of all but dry friction, by the curve's parameter."""
        return np.broadcast_to(self._force_of(self.state(points)), len(points))

    def slope(self, points: Array) -> Array:
        """Compute dQ/ds along the curve."""
        k = self.state(points).k
        psi = Sloped(points[:, 0], k.h2[None])
        mu = Sloped(points[:, 1], k.h43[None])
        Q = self._force_of(on_curve(self.lengths, self.theta_1, psi, mu))
        return np.broadcast_to(np.ravel(take_slopes(Q)), len(points))

    def size(self, points: Array) -> Array:
        """Return the sum of the absolute terms of Q, each by the fastest bar's speed.

        A bar at rest has rounding alone.
        """
        state = self.state(points)
        actions = _Sizes(state, self.case.bodies).add(self.case.terms)
        fastest = np.max(np.abs(state.k[:3]), axis=0)
        return np.asarray(fastest * actions.size)

    def level(self, points: Array) -> Mask:
        """Mark points where Q is zero within round-off."""
        return np.asarray(
            np.abs(self.generalized_force(points)) <= ROUND_OFF_OF_Q * self.size(points)
        )

    def count(self, psi: Array) -> Array:
        """Return psi as it is counted within the sweep.

        Without a sweep theta_2 is counted from 0 where the input turns fully, otherwise
        from the circuit's range.
        """
        # an end may lie beyond the sweep by a rounding
        apart: Array = _measure_apart(psi, self.middle, self.period)
        return np.asarray(self.middle + apart)

    def place(self, point: Array) -> RestPosition:
        """Describe a point by theta_2 as it is counted."""
        _, _, u3, u4 = self.state(point[None]).position[:4]
        sine = math.sin(point[1])
        return RestPosition(
            float(self.theta_1 + self.count(point[0])),
            float(np.angle(u3)[0]),
            float(np.angle(u4)[0]),
            0 if abs(sine) < AT_END_OF_SWEEP else int(np.sign(sine)),
        )


def _measure_apart(psi: Array, middle: float | Array, period: float) -> Array:
    """Return how far psi lies from a middle, within half a period."""
    away = psi - middle
    return away - period * np.rint(away / period)


def on_curve(lengths: Loop, theta_1: Number, psi: Number, mu: Number) -> State:
    """Compute the position at rest, with derivatives by s in place of an angle.

        u3 = (d u1 - a u2)/(b - c e^{i mu}),   u4 = u3 e^{i mu}.

    Off the curve the directions of bars 3 and 4 are no unit vectors.

    >>> from math import pi
    >>> from fourbar.formulas.position import loop
    >>> lengths = loop(100, 40, 120, 80)  # mm; Norton, example 4-1, as in `close_loop`
    >>> psi = 40 * pi / 180
    >>> s = on_curve(lengths, 0.0, psi, transmission_angle(lengths, psi))
    >>> [f"{np.angle(u, deg=True):.3f}" for u in (s.position.u3, s.position.u4)]
    ['20.298', '57.325']
    """
    d, a, b, c = lengths[:4]
    u1 = polar(1.0, theta_1)
    u2 = polar(1.0, theta_1) * polar(1.0, psi)
    diagonal = u1 * _less_turned(d, a, psi)
    u3 = diagonal / _less_turned(b, c, mu)
    u4 = u3 * polar(1.0, mu)
    h2 = np.sin(mu)
    h3 = (a / b) * sine(u4, u2)
    h4 = (a / c) * sine(u3, u2)
    k = Coefficients(
        h2, h3, h4, h2 - h3, (a / b) * (d / c) * np.sin(psi), 0.0, 0.0, 0.0
    )
    # the last three are asked for by nothing here
    position = Position(u1, u2, u3, u4, h2, diagonal, None, None, None)  # type: ignore[arg-type]
    return State(lengths, theta_1, theta_1 + psi, position, k, 0.0, rates(k, 0.0, 0.0))


def _less_turned(p: Number, q: Number, angle: Number) -> Number:
    """Compute p - q e^{i angle}, which keeps its digits where it is small."""
    half = 0.5 * angle
    return (p - q) - (2j * q) * (np.sin(half) * polar(1.0, half))


def transmission_angle(lengths: Loop, psi: Number) -> Number:
    """Compute theta_4 - theta_3 on the open branch, in [0, pi].

    Where the loop does not close, it is the nearest end.

    tan^2(mu/2) = (e^2 - (b - c)^2)/((b + c)^2 - e^2), the factors of Heron's formula.
    """
    half = half_angle(lengths, psi)
    return 2.0 * np.arctan2(
        np.sqrt(np.maximum(half.inner, 0.0)), np.sqrt(np.maximum(half.outer, 0.0))
    )
