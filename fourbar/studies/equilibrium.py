"""Equilibria: where a linkage stays by itself under weights, springs and loads, and what holds it elsewhere.

With Q the generalised force (its power over q') and J the equivalent inertia, at rest and with no drive,
    J q'' = Q,   stable where Q = 0 and dQ/dq < 0,   frequency sqrt(-Q'/J)/(2 pi).
Dry friction holds wherever it takes Q: from the position in which it gives way forwards to that in which it gives way
backwards.

Source: R. L. Norton, Design of Machinery, ch. 11 (virtual work); L. Meirovitch, Fundamentals of Vibrations, ch. 2.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fourbar.effects.actions import Actions, bodies
from fourbar.errors import NotAssembledError, expect
from fourbar.evaluation.case import Case
from fourbar.formulas.circuits import Circuit, circuit_of, circuits
from fourbar.formulas.closed_curve import on_curve, transmission
from fourbar.formulas.mobility import MARGIN, TURN, change_points, default_range, turns_fully
from fourbar.formulas.motion import State
from fourbar.formulas.path import path
from fourbar.formulas.position import Loop, loop
from fourbar.formulas.torque import inertia
from fourbar.quantities import JAMMED, NOT_ASSEMBLED, SINGULAR
from fourbar.scene import Command, Scene, command
from fourbar.scene.motion import DEFAULT_STEPS, Sweep
from fourbar.solution import Solution
from fourbar.solve import solve
from fourbar.studies.derivatives import differentiable
from fourbar.studies.interval import KNOWN
from fourbar.studies.keys import at_place, entries, left_out, with_numbers
from fourbar.studies.sloped import Sloped
from fourbar.studies.zeros import AT_CHANGE_POINT, Zeros, zeros

Array = NDArray[np.float64]
SAMPLES = 3600
"""Positions of a whole branch that are looked at for friction, and for zeros where they cannot be proven."""
NOTHING = 1e-11
"""Of the sum of the absolute terms of Q: no more than this everywhere is what rounding leaves of zero."""
HALVINGS = 60
"""Of the distance between two samples: to its last digits."""
A_JUMP = 1e-6
"""Of the sum of the absolute terms: a torsion spring wound by half a turn makes Q jump, which is no zero."""
STILL = 1e-3
"""Where bar 2 turns by less than this of bar 4 it stands at a limit, and theta_4 takes its place."""
A_RANGE = 3
"""Samples in a row where Q is nothing: fewer may be a zero that falls on one."""
AT_END = 1e-12
"""rad; an equilibrium so near to an end of the sweep is in it."""


class RestPosition(NamedTuple):
    """A position of the linkage, angles in rad."""

    theta_2: float
    theta_3: float
    theta_4: float
    branch: int
    """+1 or -1; 0 at a limit of theta_2, where the two meet."""


class Equilibrium(NamedTuple):
    """A position in which the linkage stays by itself."""

    place: RestPosition
    stability: str
    """"stable", "unstable", or "undecided" where dQ/dq is zero as far as can be said."""
    angle: str
    """q of the next two: "theta_2", at a limit of it "theta_4"."""
    slope: float
    """dQ/dq, N m/rad."""
    inertia: float
    """Equivalent inertia J, kg m^2."""
    frequency: float | None
    """Of small undamped oscillations, Hz; None: not stable, or without inertia."""
    held: tuple[RestPosition, RestPosition] | None
    """The ends of the positions around it that dry friction holds; None: there is none."""


class Equilibria(NamedTuple):
    """What `equilibrium` returns."""

    found: tuple[Equilibrium, ...]
    """Along theta_2, the open branch first; none where the linkage is indifferent."""
    indifferent: tuple[tuple[RestPosition, RestPosition], ...]
    """Ends of ranges in which Q is zero throughout, to the rounding of the description: it stays wherever it is put."""
    proven: bool
    """Whether no other equilibrium can be; otherwise there may be others between the samples."""
    not_decided: tuple[RestPosition, ...]
    """Change points, nearer than 1e-4 rad to which nothing is decided."""
    held: tuple[tuple[RestPosition, RestPosition], ...]
    """Ends of all ranges that dry friction holds, those without an equilibrium too."""
    positions: Solution
    """The scene's positions at rest: `torque` holds them, anything from `torque_low` to `torque_high` with friction."""
    moves: NDArray[np.int8]
    """How each begins to move when released: +1 as theta_2 grows, -1 as it falls, 0 it stays, or has no speeds."""


def equilibrium(scene: Scene) -> Equilibria:
    """Find the positions in which a linkage stays by itself, whether they are stable, and what holds the others.

    On the circuit of the scene's first position that assembles, on both branches where it has both, within the sweep
    of theta_2 if one is stated (or the angles of its motion law). Speed, acceleration and drive of the scene play no
    part, viscous damping none either. With python-flint (extra "exact") and gravity, springs and constant loads alone
    the equilibria are proven to be all.

    Raises
    ------
    NotAssembledError : the linkage closes at none of the scene's positions.
    """
    expect("scene", scene, Scene)
    with np.errstate(all="ignore"):
        curve = _Curve(scene)
        level = [each for each in curve.ranges(curve.level, np.empty((0, 2))) if each.samples > A_RANGE]
        samples = curve.samples()
        idle = curve.level(samples)
        result = Zeros(np.empty((0, 2)), np.empty((0, 2)), True)
        if not idle.all():
            proof = _proven(curve, samples[idle])
            result = proof if proof is not None and proof.complete else curve.sign_changes(samples)
        points = curve.sorted(np.concatenate([result.found, result.undecided]))
        ranges = curve.ranges(curve.holds, points) if any(term.dry_pins for term in curve.case.terms) else []
        found = []
        for point in points:
            undecided = any(np.array_equal(point, each) for each in result.undecided)
            held = next((each.ends for each in ranges if curve.lies_in(point, each)), None)
            found.append(curve.described(point, held, undecided=undecided))
        singular = tuple(curve.place(np.array(point)) for point in curve.singular)
        positions = _at_rest(scene, curve.circuit)
        psi = positions.theta_2 - curve.theta_1
        moves = curve.moves(np.stack([psi, positions.branch * transmission(curve.ratios, psi)], axis=1))
        moves[np.isin(positions.status_code, (NOT_ASSEMBLED, SINGULAR))] = 0
        flat, ends = (tuple(each.ends for each in of) for of in (level, ranges))
        return Equilibria(tuple(found), flat, result.complete, singular, ends, positions, moves)


def _at_rest(scene: Scene, circuit: Circuit) -> Solution:
    """Solve the scene's positions at rest; of a single one, or a released linkage, those of the circuit."""
    at = command(scene)
    if len(at.theta_2) == 1:
        low, high = default_range(scene.linkage) if turns_fully(scene.linkage) else circuit.theta_2
        margin = 0.0 if turns_fully(scene.linkage) else min(MARGIN, 0.25 * (high - low))
        theta_2 = np.linspace(low + margin, high - margin, DEFAULT_STEPS + 1)
        at = Command(theta_2, np.full(theta_2.shape, scene.motion.branch, dtype=np.int8), 0.0, 0.0)
    return solve(scene, "force", at=Command(at.theta_2, at.branch, 0.0, 0.0, at.remainder))


def generalised_force(scene: Scene, terms: tuple[Any, ...], state: State) -> Any:
    """Compute Q of loads and effects, by the parameter that the state's coefficients belong to."""
    actions = Actions(state, bodies(scene.linkage, terms))
    for term in terms:
        term.act(actions, state)
    return actions.work()[0]


class _Sizes(Actions):
    """Sums of the absolute terms of Q, each with the speed of the fastest bar: one that rests has rounding alone."""

    def __init__(self, state: State, of: Any) -> None:
        super().__init__(state, of)
        self.size: Any = 0.0
        self.fastest = np.max(np.abs([state.k.h2, state.k.h3, state.k.h4]), axis=0)

    def force(self, bar: int, force: Any, arm: Any = 0.0j) -> None:
        super().force(bar, force, arm)
        if bar == 3:
            self.size = self.size + np.abs(force) * self.state.lengths.a * self.fastest

    def moment(self, bar: int, moment: Any) -> None:
        super().moment(bar, moment)
        if bar != 1:
            self.size = self.size + np.abs(moment) * self.fastest

    def couple(self, pin: str, couple: Any) -> None:
        super().couple(pin, couple)
        self.size = self.size + np.abs(couple) * self.fastest


class _Range(NamedTuple):
    """A part of a row of the circuit."""

    ends: tuple[RestPosition, RestPosition]
    row: int
    low: float
    """Where it begins, and how far it goes, rad of the row's own angle."""
    width: float
    samples: int
    """How many are in it."""


class _Curve:
    """The circuit of a scene: its branches as closed rows of psi = theta_2 - theta_1 and mu = theta_4 - theta_3.

    A row is sampled by an angle tau: psi itself where the input turns fully, else psi = middle - half width cos tau, on
    the open branch up to half a turn and back on the crossed one, so that it is smooth through the limits.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene, self.case = scene, Case.of(scene)
        self.case = self.case.with_start(command(scene)) if scene.counts_turns else self.case
        linkage = scene.linkage
        self.lengths, self.theta_1 = loop(*linkage.lengths), linkage.ground_angle
        self.ratios = self.case.path.lengths
        """The lengths by a unit near them, of which no product leaves the range of doubles."""
        at = command(scene)
        number = circuit_of(linkage, at.theta_2, at.branch)
        if (number < 0).all():
            raise NotAssembledError("motion.theta_2: the linkage assembles at none of the positions requested")
        self.circuit = circuits(linkage)[number[number >= 0][0]]
        self.full = turns_fully(linkage)
        self.low, self.high = (end - self.theta_1 for end in self.circuit.theta_2)
        stated = isinstance(scene.motion.theta_2, Sweep) or scene.motion.law is not None
        self.sweep = (float(at.theta_2.min()), float(at.theta_2.max())) if stated else None
        self.singular = [
            (point - self.theta_1, 0.0 if point == self.theta_1 else math.pi) for point in change_points(linkage)
        ]
        self.singular = [each for each in self.singular if self.inside(np.array([each[0]]), np.zeros(1))[0]]

    def inside(self, psi: Array, radius: Array) -> NDArray[np.bool_]:
        """Whether psi, within a radius, lies in the sweep, if one is stated."""
        if self.sweep is None or self.sweep[1] - self.sweep[0] >= TURN:
            return np.ones(psi.shape, dtype=bool)
        middle, half = 0.5 * (self.sweep[0] + self.sweep[1]) - self.theta_1, 0.5 * (self.sweep[1] - self.sweep[0])
        away = psi - middle - TURN * np.rint((psi - middle) / TURN)
        return np.asarray(np.abs(away) <= half + radius + AT_END)

    def point(self, tau: Array, branch: int) -> Array:
        """Return psi and mu, (n, 2), at places of a row; `branch` where the input turns fully."""
        tau = np.asarray(np.remainder(tau, TURN), dtype=float)
        if self.full:
            psi, sign = self.low + tau, np.full(tau.shape, float(branch))
        else:
            psi = 0.5 * (self.low + self.high) - 0.5 * (self.high - self.low) * np.cos(tau)
            sign = np.where(tau <= math.pi, 1.0, -1.0)
        return np.stack([psi, sign * transmission(self.ratios, psi)], axis=1)

    def tau(self, points: Array) -> tuple[Array, NDArray[np.intp]]:
        """Return the place and the row (index into `rows`) of points."""
        psi = self.low + np.remainder(points[:, 0] - self.low, TURN)
        sign = np.where(np.sin(points[:, 1]) >= 0.0, 1, -1)
        if self.full:
            return psi - self.low, np.array([self.rows.index(each) for each in sign], dtype=np.intp)
        part = np.clip((0.5 * (self.low + self.high) - psi) / (0.5 * (self.high - self.low)), -1.0, 1.0)
        tau = np.where(sign > 0, np.arccos(part), TURN - np.arccos(part))
        return tau, np.zeros(len(points), dtype=np.intp)

    @property
    def rows(self) -> tuple[int, ...]:
        """The branch of each row; one row holds both where the input has limits."""
        return self.circuit.branches if self.full else (1,)

    def samples(self) -> Array:
        """All rows at even places within the sweep, off the limits and change points, (n, 2)."""
        tau = np.linspace(0.0, TURN, SAMPLES, endpoint=False) + 0.5 * TURN / SAMPLES
        points = np.concatenate([self.point(tau, branch) for branch in self.rows])
        return points[self.inside(points[:, 0], np.zeros(1))]

    def sorted(self, points: Array) -> Array:
        """Those in the sweep, along the rows."""
        points = points[self.inside(points[:, 0], np.zeros(1))]
        tau, row = self.tau(points)
        return points[np.lexsort((tau, row))]

    def state(self, points: Array) -> State:
        """Positions with their derivatives along the curve."""
        return on_curve(self.lengths, self.theta_1, points[:, 0], points[:, 1])

    def force(self, points: Array) -> Array:
        """Q of all but dry friction, by the curve's parameter."""
        return np.broadcast_to(generalised_force(self.scene, self.case.terms, self.state(points)), len(points))

    def slope(self, points: Array) -> Array:
        """dQ/ds."""
        k = self.state(points).k
        psi, mu = (Sloped(x, h[None]) for x, h in zip(points.T, (k.h2, k.h43), strict=True))
        Q = generalised_force(self.scene, self.case.terms, on_curve(self.lengths, self.theta_1, psi, mu))
        return np.broadcast_to(Q.slopes[0], len(points)) if isinstance(Q, Sloped) else np.zeros(len(points))

    def size(self, points: Array) -> Array:
        """Sum of the absolute terms of Q."""
        actions = _Sizes(state := self.state(points), self.case.bodies)
        for term in self.case.terms:
            term.act(actions, state)
        return np.broadcast_to(actions.size, len(points))

    def level(self, points: Array) -> NDArray[np.bool_]:
        """Whether rounding leaves nothing of Q."""
        return np.asarray(np.abs(self.force(points)) <= NOTHING * self.size(points))

    def sign_changes(self, points: Array) -> Zeros:
        """Find the zeros between samples at which Q changes its sign."""
        tau, row = self.tau(points)
        Q, size, one = self.force(points), self.size(points), np.arange(len(points))
        other = np.concatenate([np.roll(one[row == each], -1) for each in range(len(self.rows))])
        gap = np.remainder(tau[other] - tau, TURN)
        idle = self.level(points)
        between = np.flatnonzero((Q * Q[other] <= 0.0) & (gap < 1.5 * TURN / SAMPLES) & ~idle & ~idle[other])
        low, high, start = tau[between], tau[between] + gap[between], Q[between]
        branch = np.array(self.rows)[row[between]]
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            before = self.force(self._at(middle, branch)) * start > 0.0
            low, high = np.where(before, middle, low), np.where(before, high, middle)
        found = self._at(high, branch)
        real = np.abs(self.force(found)) <= A_JUMP * size[between]
        for point in self.singular:  # where Q vanishes because nothing moves
            real &= ~(np.abs(np.sin(0.5 * (found - point))) < AT_CHANGE_POINT).all(axis=1)
        found = found[real]
        level = np.abs(self.slope(found)) <= A_JUMP * self.size(found)
        return Zeros(found[~level], found[level], False)

    def _at(self, tau: Array, branch: Array) -> Array:
        """Points of several rows."""
        found = np.empty((len(tau), 2))
        for each in self.rows:
            found[branch == each] = self.point(tau[branch == each], each)
        return found

    def with_friction(self, points: Array, side: int) -> Array:
        """Q with what friction does against a motion that begins to one side; -inf or inf where it jams that motion."""
        state, result = self.state(points), np.empty(len(points))
        along = np.abs(state.k.h2) >= np.abs(state.k.h4)  # the torque that balances Q, on the bar that turns faster
        for bar, chosen in ((2, along), (4, ~along)):
            if chosen.any():
                part = self.state(points[chosen])
                # the path of bar 4 takes the drive's sine from directions
                case = self.case._replace(drive_bar=bar, path=path(self.lengths, self.theta_1, 4))
                found = case.dynamics(part, 0.0, side)
                Q = -found.torque * part.k[bar - 2]
                result[chosen] = Q if found.status is None else np.where(found.status == JAMMED, -side * np.inf, Q)
        return result

    def holds(self, points: Array) -> NDArray[np.bool_]:
        """Whether friction holds."""
        return (self.with_friction(points, 1) <= 0.0) & (self.with_friction(points, -1) >= 0.0)

    def moves(self, points: Array) -> NDArray[np.int8]:
        """How positions begin to move: +1 as theta_2 grows, -1 as it falls, 0 they stay."""
        state = self.state(points)
        ahead, back = self.with_friction(points, 1), self.with_friction(points, -1)
        level = NOTHING * self.size(points)
        sense = np.where(ahead > level, 1, np.where(back < -level, -1, 0))
        return np.asarray(sense * np.sign(state.k.h2), dtype=np.int8)

    def ranges(self, holds: Callable[[Array], NDArray[np.bool_]], known: Array) -> "list[_Range]":
        """List the ranges within the sweep in which something holds, row by row; it holds at the points known."""
        result = []
        own_tau, own_row = self.tau(known)
        for row, branch in enumerate(self.rows):

            def there(tau: Array, branch: int = branch) -> NDArray[np.bool_]:
                points = self.point(tau, branch)
                return self.inside(points[:, 0], np.zeros(1)) & holds(points)

            tau = np.concatenate([(np.arange(SAMPLES) + 0.5) * (TURN / SAMPLES), own_tau[own_row == row]])
            order = np.argsort(tau)
            tau, inside = tau[order], (there(tau) | (np.arange(len(tau)) >= SAMPLES))[order]
            if inside.all():
                first, last = self.point(np.array([0.0, math.nextafter(TURN, 0.0)]), branch)
                result.append(_Range((self.place(first), self.place(last)), row, 0.0, TURN, SAMPLES))
                continue
            starts, stops = (np.flatnonzero(inside & ~np.roll(inside, by)) for by in (1, -1))
            if len(starts) and stops[0] < starts[0]:
                stops = np.roll(stops, -1)
            following = tau[(stops + 1) % len(tau)]
            begin = _edge(there, tau[starts], np.remainder(tau[starts] - tau[starts - 1], TURN), -1.0)
            end = _edge(there, tau[stops], np.remainder(following - tau[stops], TURN), 1.0)
            for low, high, count in zip(begin, end, (stops - starts) % len(tau) + 1, strict=True):
                one, other = (self.place(point) for point in self.point(np.array([low, high]), branch))
                if self.full and other.theta_2 < one.theta_2:
                    other = other._replace(theta_2=other.theta_2 + TURN)
                ends = (other, one) if not self.full and one.branch == other.branch == -1 else (one, other)
                width = float(np.remainder(high - low, TURN))
                result.append(_Range(ends, row, low, width, int(count)))
        return result

    def lies_in(self, point: Array, of: "_Range") -> bool:
        """Whether a point lies in a range."""
        tau, row = self.tau(point[None])
        return bool(row[0] == of.row and np.remainder(tau[0] - of.low, TURN) <= of.width)

    def place(self, point: Array) -> RestPosition:
        """Describe a point, theta_2 within the sweep, else counted from the circuit's range."""
        at, from_ = (
            self.state(point[None]).at,
            self.low if self.sweep is None else self.sweep[0] - self.theta_1 - AT_END,
        )
        theta_2 = self.theta_1 + from_ + math.remainder(point[0] - from_ - math.pi, TURN) + math.pi
        theta_3, theta_4 = (float(np.angle(u)[0]) for u in (at.u3, at.u4))
        sine = math.sin(point[1])
        return RestPosition(
            float(theta_2), theta_3, theta_4, 0 if abs(sine) < AT_END else int(math.copysign(1.0, sine))
        )

    def described(
        self, point: Array, held: tuple[RestPosition, RestPosition] | None, *, undecided: bool
    ) -> Equilibrium:
        """Describe an equilibrium by theta_2, at a limit by theta_4."""
        state = self.state(point[None])
        bar = 4 if abs(state.k.h2[0]) < STILL * abs(state.k.h4[0]) else 2
        square = float(state.k[bar - 2][0]) ** 2
        slope = float(self.slope(point[None])[0]) / square
        J = float(np.sum(inertia(self.lengths.a, self.case.bodies, state.at, state.k))) / square
        stable = "undecided" if undecided else "stable" if slope < 0.0 else "unstable"
        frequency = math.sqrt(-slope / J) / TURN if stable == "stable" and J > 0.0 else None
        return Equilibrium(self.place(point), stable, f"theta_{bar}", slope, J, frequency, held)


def _edge(held: Callable[[Array], NDArray[np.bool_]], tau: Array, gap: Array, sense: float) -> Array:
    """Find where a range ends, between a place that is held and the next one, which is not."""
    low, high = np.zeros(tau.shape), gap
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        inside = held(tau + sense * middle)
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return np.asarray(np.remainder(tau + sense * low, TURN))


def _proven(curve: _Curve, idle: Array) -> Zeros | None:
    """All zeros of Q on the circuit; None where ball arithmetic or an effect's form in it is missing.

    Between two change points, where signs of psi and mu tell the ways of moving apart, Q may be zero throughout: a load
    on a bar that rests in one of them. There none is looked for.

    Parameters
    ----------
    idle : samples in which Q is nothing.
    """
    try:
        from flint import arb, ctx
    except ImportError:
        return None
    scene = curve.scene
    acting = tuple(term for term in scene.effects if not term.dry_pins)  # dry friction does no work at rest
    for term in (*scene.loads, *acting):
        if term.key not in KNOWN or getattr(term, "table", None) is not None:
            return None
    scene = differentiable(replace(scene, effects=acting))
    still = np.zeros((2, 1), dtype=object)
    numbers = {
        key: Sloped(np.array([arb(at_place(scene, entry.place))], dtype=object), still)
        for key, entry in entries(scene).items()
        if not key.startswith("motion.") and not left_out(scene, entry)
    }
    exact = with_numbers(scene, numbers)
    d, a, b, c = exact.linkage.lengths
    lengths, theta_1 = Loop(d, a, b, c, 0.0, 0.0), exact.linkage.ground_angle
    terms = (*exact.loads, *exact.effects)

    def force(psi: Any, mu: Any) -> Sloped:
        seeded = (Sloped(x, np.array([[i == 0], [i == 1]], dtype=object) * 1) for i, x in enumerate((psi, mu)))
        Q: Sloped = generalised_force(exact, terms, on_curve(lengths, theta_1, *seeded))
        return Q

    turn, both = (-math.pi, math.pi), len(circuits(scene.linkage)) == 1
    psi, mu = turn, turn
    if not both and curve.full:
        mu = (0.0, math.pi) if curve.circuit.branches == (1,) else (-math.pi, 0.0)
    elif not both:
        psi = (0.0, math.pi) if 0.0 <= curve.low < math.pi else (-math.pi, 0.0)
    signs = [np.sign(np.sin(x)) for x in (curve.samples(), idle)]
    ways = {tuple(way) for way in signs[1]} if curve.singular else set()
    count = [lambda way, of=each: (of == way).all(axis=1).sum() for each in signs]
    idle_ways = [np.array(way) for way in ways if count[0](way) == count[1](way)]

    def wanted(centres: Array, radii: Array) -> NDArray[np.bool_]:
        kept = curve.inside(centres[:, 0], radii[:, 0])
        for way in idle_ways:
            kept &= ~((way * np.sin(centres) > 0.0) & (np.abs(np.sin(centres)) > radii)).all(axis=1)
        return kept

    before, ctx.prec = ctx.prec, 128
    try:
        return zeros(curve.ratios, force, (psi, mu), wanted, curve.singular)
    finally:
        ctx.prec = before
