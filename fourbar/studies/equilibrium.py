"""Equilibria: where a linkage stays by itself, and what holds it elsewhere.

Weights, springs and loads act.

With Q the generalized force (its power over q') and J the equivalent inertia, at rest
and with no drive,
    J q'' = Q,   stable where Q = 0 and dQ/dq < 0,   frequency sqrt(-Q'/J)/(2 pi).
Dry friction holds wherever it takes Q: from the position in which it gives way forwards
to that in which it gives way backwards.

Source: R. L. Norton, Design of Machinery, ch. 11 (virtual work); L. Meirovitch,
Fundamentals of Vibrations, ch. 2.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from fourbar.errors import expect
from fourbar.evaluation.case import Couple
from fourbar.formulas.mobility import TURN
from fourbar.formulas.motion import Coefficients
from fourbar.formulas.position import Loop
from fourbar.formulas.torque import inertia
from fourbar.quantities import (
    CHANGE_POINT,
    JAMMED,
    NOT_ASSEMBLED,
    SINGULAR,
    WOUND,
    Array,
    Indices,
    Mask,
    Signs,
)
from fourbar.scene import Command, Scene, default_places
from fourbar.scene.motion import Motion
from fourbar.solution import Solution
from fourbar.solving import solve
from fourbar.studies.circuit_curve import (
    ROUND_OFF_OF_Q,
    CircuitCurve,
    RestPosition,
    transmission_angle,
)
from fourbar.studies.course import bisect, list_stretches

_A_JUMP = 1e-6
"""Fraction of the sum of the absolute terms above which a sign change is a jump. A
torsion spring wound by half a turn makes Q jump, which is no zero.
"""
STANDING_BAR = 1e-3
"""Ratio of the turns of bars 2 and 4 below which bar 2 stands at a limit. theta_4 then
takes the place of theta_2.
"""
ROUNDING_OF_A_SINE = 50.0 * 2.0**-52
"""Sine between two bars, times that between bars 3 and 4, below which it is rounding.
An angle of the input has 16 digits, and bars 3 and 4 lose what this sine is small by.
"""
SINE_AT_A_LIMIT = 2.0**-26
"""Sine between bars 3 and 4 that a rounded angle of the input leaves at a limit."""
_A_RANGE = 3
"""Steps of the grid over which Q is nothing: fewer may be a zero that falls on one."""
_AT_CHANGE_POINT = 1e-4
"""rad; nearer to a change point nothing is decided: the curve crosses itself there."""


class _CircuitRange(NamedTuple):
    """A part of the row of the circuit."""

    ends: tuple[RestPosition, RestPosition]
    low: float
    """Start and extent of the range, rad of the row's own angle."""
    width: float
    is_reached: bool
    """True if the scene's sweep passes an end or the middle of the range."""


class Equilibrium(NamedTuple):
    """A position in which the linkage stays by itself."""

    place: RestPosition
    stability: str
    """"stable", "unstable", or "undecided" where dQ/dq is zero or has no value."""
    angle: str
    """q of the next two: "theta_2", at a limit of it "theta_4"."""
    slope: float
    """dQ/dq, N m/rad."""
    inertia: float
    """Equivalent inertia J, kg m^2."""
    frequency: float | None
    """Frequency of small undamped oscillations, Hz. None: it is not stable, or without
    inertia.
    """
    held: tuple[RestPosition, RestPosition] | None
    """Ends of the positions around it that dry friction holds; None: there are none."""
    reached: bool
    """True if the scene's sweep or law passes here, and where the scene has neither.
    False: theta_2 is in the sweep, but the linkage is in its other assembly.
    """


class Equilibria(NamedTuple):
    """Result of `equilibrium`."""

    found: tuple[Equilibrium, ...]
    """Circuit by circuit in the order of the motion, in each along theta_2, the open
    branch first; none where the linkage is indifferent.
    """
    indifferent: tuple[tuple[RestPosition, RestPosition], ...]
    """Ends of ranges in which Q is zero throughout. Zero is within the rounding of the
    description: the linkage stays wherever it is put.
    """
    samples: int
    """Number of positions of the grid. Every zero of Q at which its sign differs
    between two neighbours is found, and every one at which Q touches zero or passes it
    twice between two neighbours whose slopes differ in sign; there may be others
    between.
    """
    not_decided: tuple[RestPosition, ...]
    """Change points, nearer than 1e-4 rad to which nothing is decided."""
    held: tuple[tuple[RestPosition, RestPosition], ...]
    """Ends of all ranges that dry friction holds, those without an equilibrium too.
    What the sweep does not reach is left out, here and of `indifferent`.
    """
    positions: Solution
    """The scene's positions at rest. `torque` holds them; with friction anything from
    `torque_low` to `torque_high` does.
    """
    moves: Signs
    """Sign of the change of theta_2 when each position is released. 0: it stays, has no
    speeds, or has two ways to move.
    """


def equilibrium(scene: Scene) -> Equilibria:
    """Find the positions in which a linkage stays by itself, and their stability.

    The result also says what holds the linkage elsewhere. The search covers the
    circuits that the scene's motion passes, each on both branches where it has both. If
    the scene states a sweep (of theta_2, of another bar or of a stroke) or a motion
    law, the search stays within the angles theta_2 of it, and `reached` tells apart
    what the sweep itself passes. Speed, acceleration and drive of the scene play no
    part, nor does viscous damping. Torsion springs are followed from the scene's first
    position; without a sweep an input that turns fully gets from there to the others
    either way round, and what no way reaches is no equilibrium. Zeros of the
    generalized force Q are sought between the positions of a grid (3600 a turn, and the
    ends of the sweep): where Q changes its sign, and where its size is least.

    Raises
    ------
    NotAssembledError : the linkage closes at none of the scene's positions.
    LimitError : an effect uses a function that derivatives cannot follow.
    """
    expect("scene", scene, Scene)
    with np.errstate(all="ignore"):
        first = CircuitCurve(scene)
        others = range(1, len(first.passed))
        curves = [first, *(CircuitCurve(scene, which) for which in others)]
        found = list[Equilibrium]()
        indifferent = list[_CircuitRange]()
        all_held = list[_CircuitRange]()
        not_decided = list[RestPosition]()
        count = 0
        for curve in curves:
            indifferent += _list_ranges(curve, curve.level, _A_RANGE)
            not_decided += map(curve.place, curve.singular)
            samples = curve.samples()
            count += len(samples)
            places, sizes = _find_zeros(curve, samples)
            order = curve.order(places)
            order = order[~_mark_wound(curve, places[order])]
            held = list[_CircuitRange]()
            if any(term.dry_pins for term in curve.case.terms):
                held = _list_ranges(curve, partial(_holds, curve), 0, places[order])
                all_held += held
            for row in order:
                size = float(sizes[row])
                found.append(_describe_equilibrium(curve, places[row], size, held))
        positions = _solve_at_rest(first)
        moves = _find_moves(first, positions)
    return Equilibria(
        tuple(found),
        tuple(part.ends for part in indifferent if part.is_reached),
        count,
        tuple(not_decided),
        tuple(part.ends for part in all_held if part.is_reached),
        positions,
        moves,
    )


def _mark_wound(curve: CircuitCurve, tau: Array) -> Mask:
    """Mark places, (n,), where a torsion spring is wound beyond half a turn from rest.

    Not marked is what lies beyond a limit or a change point from the first position.
    """
    if not curve.scene.counts_turns:
        return np.zeros(len(tau), dtype=bool)
    psi, mu = curve.points(tau).T
    passed = curve.reached(tau)
    if curve.extent == math.inf and not curve.full:
        passed &= np.sin(mu) * curve.branch > 0.0
    theta_2 = curve.theta_1 + curve.count(psi)
    return passed & _is_wound(curve, _turn_to(curve, theta_2))


def _is_wound(curve: CircuitCurve, theta_2: Array) -> Mask:
    """Mark angles at which a torsion spring is wound.

    The spring is followed from the scene's first position that assembles.
    """
    branch = np.full(theta_2.shape, curve.branch, dtype=np.int8)
    state = curve.case.at(Command(theta_2, branch, 0.0, 0.0))
    codes = np.array(
        [term.status(state, branch) for term in curve.case.terms if term.counts_turns]
    )
    return np.asarray((codes == WOUND).any(axis=0))


def _turn_to(curve: CircuitCurve, theta_2: Array) -> Array:
    """Return the angles at which positions are reached from the scene's first one.

    Without a sweep an input that turns fully is turned the other way round where a
    torsion spring would be wound.
    """
    if curve.extent < math.inf or not curve.full or not curve.scene.counts_turns:
        return theta_2
    back = np.copysign(curve.period, theta_2 - curve.at.theta_2[0])
    return np.where(_is_wound(curve, theta_2), theta_2 - back, theta_2)


def _solve_at_rest(curve: CircuitCurve) -> Solution:
    """Solve the scene's positions at rest.

    For a single position, or a released linkage, these are those of the circuit.
    """
    at = curve.at
    at = Command(at.theta_2, at.branch, 0.0, 0.0, origin=at.origin)
    if len(at.theta_2) == 1:
        of_circuit = replace(curve.scene, motion=Motion())
        theta_2 = default_places(of_circuit, float(at.theta_2[0]))
        branch = np.full(theta_2.shape, at.branch[0], dtype=np.int8)
        at = Command(theta_2, branch, 0.0, 0.0)
    turned = at._replace(angle=_turn_to(curve, at.theta_2))
    return replace(solve(curve.scene, "force", at=turned), theta_2=at.theta_2, at=at)


def _describe_equilibrium(
    curve: CircuitCurve,
    tau: float,
    size: float,
    held: list[_CircuitRange],
) -> Equilibrium:
    """Describe an equilibrium by theta_2, at a limit by theta_4.

    `size`: of the terms of Q about there. `held`: the ranges that friction holds.
    """
    places = np.array([tau])
    points = curve.points(places)
    state = curve.state(points)
    bar = 4 if abs(state.k.h2[0]) < STANDING_BAR * abs(state.k.h4[0]) else 2
    square = float(state.k[bar - 2][0]) ** 2
    along_curve = float(curve.slope(points)[0])
    moving = _drop_standing_bar(curve.lengths, state.k)
    inertias = inertia(curve.lengths.a, curve.case.bodies, state.position, moving)
    slope = along_curve / square
    J = float(np.sum(inertias)) / square
    stability = "undecided"
    if abs(along_curve) > _A_JUMP * size:  # never of NaN
        stability = "stable" if slope < 0.0 else "unstable"
    frequency = None
    if stability == "stable" and J > 0.0:
        frequency = math.sqrt(-slope / J) / TURN
    holding = (
        part.ends
        for part in held
        if np.remainder(tau - part.low, curve.period) <= part.width
    )
    return Equilibrium(
        curve.place(points[0]),
        stability,
        f"theta_{bar}",
        slope,
        J,
        frequency,
        next(holding, None),
        bool(curve.reached(places)[0]),
    )


def _drop_standing_bar(lengths: Loop, k: Coefficients) -> Coefficients:
    """Return the coefficients with zero for a bar that stands at a limit.

    The square of what rounding leaves there is no inertia. Each coefficient is the sine
    between the other two bars, over the length of its own bar.
    """
    h = np.array([k.h2, k.h3, k.h4])
    ratios = np.array([1.0, lengths.b / lengths.a, lengths.c / lengths.a])
    sines = np.abs(h * ratios[:, np.newaxis])
    lost_by = np.maximum(sines[0], SINE_AT_A_LIMIT)
    h[sines * lost_by < ROUNDING_OF_A_SINE] = 0.0
    return k._replace(h2=h[0], h3=h[1], h4=h[2])


class _Grid:
    """Places of the row, and which of them are neighbours."""

    def __init__(self, curve: CircuitCurve, places: Array) -> None:
        """Pair neighbouring places along the row, but not across a gap of the sweep."""
        self.curve = curve
        places = np.sort(places)
        self.places = places
        self.gap = np.remainder(np.roll(places, -1) - places, curve.period)
        """Distance to the next place along the row, rad."""
        near = self.gap < 2.5 * curve.period / curve.positions
        self.near = near
        """True where no gap of the sweep lies between."""
        points = curve.points(places)
        size = curve.size(points)
        after = np.where(near, np.roll(size, -1), 0.0)
        before = np.roll(np.where(near, size, 0.0), 1)
        self.size = np.maximum(size, np.maximum(before, after))
        """Sum of the absolute terms of Q there or at a neighbour: the larger one."""
        self.Q = curve.generalized_force(points)
        self.idle = np.abs(self.Q) <= ROUND_OFF_OF_Q * self.size
        """True where Q is nothing."""

    def locate(
        self,
        compute: Callable[[Array], Array],
        among: Mask | bool = True,
    ) -> tuple[Array, Array, Array]:
        """Locate where a function of points changes its sign between neighbours.

        Return the places, and Q and its size at the first neighbour, (k,) each.

        `among`: marks the pairs that may have such a place; one where Q is nothing has
        none.
        """
        values = compute(self.curve.points(self.places))
        chosen = among & self.near & (values * np.roll(values, -1) < 0.0)
        chosen &= ~self.idle & ~np.roll(self.idle, -1)
        low = self.places[chosen]
        sides = values[chosen]

        def has_sign_of_start(tau: Array) -> Mask:
            return np.asarray(compute(self.curve.points(tau)) * sides > 0.0)

        _, after = bisect(has_sign_of_start, low, low + self.gap[chosen])
        places = np.remainder(after, self.curve.period)
        return places, self.Q[chosen], self.size[chosen]


def _find_zeros(curve: CircuitCurve, samples: Array) -> tuple[Array, Array]:
    """Find the zeros of Q between samples: where its sign changes or its size is least.

    A sample without Q may itself be a zero; with another one beside it, it is in a
    range where Q is nothing. Returned are the places, (n,), and the sum of the absolute
    terms of Q about each, (n,).
    """
    grid = _Grid(curve, samples)
    both_idle = grid.near & grid.idle & np.roll(grid.idle, -1)
    alone = grid.idle & ~both_idle & ~np.roll(both_idle, 1)
    # at an end of the sweep nothing beyond shows a sign
    ending = alone & (grid.near != np.roll(grid.near, 1))
    zeros = grid.places[ending]
    sizes = grid.size[ending]

    grid = _Grid(curve, grid.places[~alone])
    one_sign = grid.Q * np.roll(grid.Q, -1) > 0.0
    least, Q_beside, size = grid.locate(curve.slope, one_sign)
    Q = curve.generalized_force(curve.points(least))
    touches = np.abs(Q) <= ROUND_OFF_OF_Q * size
    zeros = np.append(zeros, least[touches])
    sizes = np.append(sizes, size[touches])

    turns_back = least[(Q * Q_beside < 0.0) & ~touches]
    grid = _Grid(curve, np.append(grid.places, turns_back))
    crossed, _, size = grid.locate(curve.generalized_force)
    Q = curve.generalized_force(curve.points(crossed))
    continuous = np.abs(Q) <= _A_JUMP * size
    zeros = np.append(zeros, crossed[continuous])
    sizes = np.append(sizes, size[continuous])
    for point in curve.singular:  # nothing moves there, so that Q vanishes
        away = np.abs(np.sin(0.5 * (curve.points(zeros) - point)))
        apart = (away >= _AT_CHANGE_POINT).any(axis=1)
        zeros = zeros[apart]
        sizes = sizes[apart]
    return zeros, sizes


def _add_friction(curve: CircuitCurve, points: Array, impending: int) -> Array:
    """Compute Q with the friction that opposes impending motion to one side.

    Positions where friction jams have an infinite Q.
    """
    k = curve.state(points).k
    force = np.empty(len(points))
    # the torque that balances Q, on the bar that turns faster
    along = np.abs(k.h2) >= np.abs(k.h4)
    for bar, chosen in ((2, along), (4, ~along)):
        if chosen.any():
            part = curve.state(points[chosen])
            case = curve.case._replace(drive=Couple(bar), impending=impending)
            dynamics = case.dynamics(part)
            Q = -dynamics.effort * part.k[bar - 2]
            is_jammed = dynamics.status == JAMMED
            force[chosen] = np.where(is_jammed, -impending * np.inf, Q)
    return force


def _holds(curve: CircuitCurve, points: Array) -> Mask:
    ahead = _add_friction(curve, points, 1)
    return (ahead <= 0.0) & (_add_friction(curve, points, -1) >= 0.0)


def _find_moves(curve: CircuitCurve, positions: Solution) -> Signs:
    """Return the sign of the change of theta_2 at each released position, 0 at rest."""
    psi = positions.theta_2 - curve.theta_1
    mu = positions.branch * transmission_angle(curve.ratios, psi)
    points = np.stack([psi, mu], axis=1)
    size = curve.size(points)
    # where all terms vanish together their rounding does not
    level = ROUND_OFF_OF_Q * np.fmax(size, np.nanmedian(size))
    ahead = _add_friction(curve, points, 1) > level
    back = _add_friction(curve, points, -1) < -level
    sense = np.where(ahead, 1, -1 * back) * np.sign(curve.state(points).k.h2)
    undecided = (NOT_ASSEMBLED, SINGULAR, WOUND, CHANGE_POINT)
    sense[np.isin(positions.status_code, undecided)] = 0
    return np.asarray(sense, dtype=np.int8)


def _list_ranges(
    curve: CircuitCurve,
    holds: Callable[[Array], Mask],
    least: int,
    known: Sequence[float] | Array = (),
) -> list[_CircuitRange]:
    """List the ranges within the sweep in which a condition holds, along the row.

    Parameters
    ----------
    least : steps of the grid over which it holds at least.
    known : places at which the condition holds, besides those of the grid.
    """

    def there(tau: Array) -> Mask:
        points = curve.points(tau)
        inside = curve.inside(points[:, 0])
        inside[inside] = holds(points[inside])  # a load may have no value beyond
        return inside

    tau = np.append(curve.grid, known)
    inside = there(tau)
    inside[len(curve.grid) :] = True
    if inside.all():
        first = last = curve.place(curve.points(np.zeros(1))[0])
        if curve.full:
            last = first._replace(theta_2=first.theta_2 + curve.period)
        return [_CircuitRange((first, last), 0.0, curve.period, True)]
    # once round, from a place outside
    begin = tau[np.argmin(inside)]
    tau = np.append(begin + np.remainder(tau - begin, curve.period), begin)
    tau[-1] += curve.period
    inside = np.append(inside, False)
    order = np.argsort(tau)
    tau = tau[order]

    def locate(rows: Indices, ends: Array) -> Array:
        beyond = np.where(ends == tau[rows], tau[rows + 1], tau[rows])
        return bisect(there, ends, beyond)[0]

    ranges = []
    for low, high in list_stretches(inside[order], tau, locate):
        assert low is not None and high is not None
        if high - low < least * curve.period / curve.positions:
            continue
        places = np.array([low, 0.5 * (low + high), high])
        one, _, stop = map(curve.place, curve.points(places))
        if curve.full and stop.theta_2 < one.theta_2:
            stop = stop._replace(theta_2=stop.theta_2 + curve.period)
        ends = (one, stop)
        if not curve.full and one.branch == stop.branch == -1:
            ends = (stop, one)
        is_reached = bool(curve.reached(places).any())
        ranges.append(_CircuitRange(ends, low, high - low, is_reached))
    return ranges
