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
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fourbar.errors import expect
from fourbar.formulas.mobility import (
    MARGIN,
    TURN,
    Circuit,
    choose_range,
    circuits,
    turns_fully,
)
from fourbar.formulas.position import Loop
from fourbar.formulas.torque import inertia
from fourbar.quantities import JAMMED, NOT_ASSEMBLED, SINGULAR
from fourbar.scene import Command, Scene
from fourbar.scene.motion import DEFAULT_STEPS
from fourbar.solution import Array, Solution
from fourbar.solve import solve
from fourbar.studies.circuit_curve import (
    NOTHING,
    SAMPLES,
    CircuitCurve,
    RestPosition,
    compute_generalised_force,
    of_input,
    on_curve,
    transmission,
)
from fourbar.studies.derivatives import make_differentiable
from fourbar.studies.enclosure import PROVABLE
from fourbar.studies.keys import read_numbers, replace_numbers
from fourbar.studies.sloped import Sloped, make_balls
from fourbar.studies.zeros import AT_CHANGE_POINT, Zeros, find_zeros

A_JUMP = 1e-6
"""Fraction of the sum of the absolute terms: a torsion spring wound by half a turn makes Q jump, which is no zero."""
STILL = 1e-3
"""Ratio of the turns of bars 2 and 4 below which bar 2 stands at a limit, and theta_4 takes its place."""
A_RANGE = 3
"""Samples in a row where Q is nothing: fewer may be a zero that falls on one."""
HALVINGS = 60
"""Number of halvings of the distance between two samples, enough to reach its last digits."""


class _CircuitRange(NamedTuple):
    """A part of a row of the circuit."""

    ends: tuple[RestPosition, RestPosition]
    row: int
    low: float
    """Start and extent of the range, rad of the row's own angle."""
    width: float
    samples: int
    """Number of samples in the range."""


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
    """Frequency of small undamped oscillations, Hz; None: not stable, or without inertia."""
    held: tuple[RestPosition, RestPosition] | None
    """The ends of the positions around it that dry friction holds; None: there is none."""


class Equilibria(NamedTuple):
    """Result of `equilibrium`."""

    found: tuple[Equilibrium, ...]
    """Along theta_2, the open branch first; none where the linkage is indifferent."""
    indifferent: tuple[tuple[RestPosition, RestPosition], ...]
    """Ends of ranges in which Q is zero throughout, to the rounding of the description: it stays wherever it is put."""
    proven: bool
    """True if no other equilibrium can exist; otherwise there may be others between the samples."""
    not_decided: tuple[RestPosition, ...]
    """Change points, nearer than 1e-4 rad to which nothing is decided."""
    held: tuple[tuple[RestPosition, RestPosition], ...]
    """Ends of all ranges that dry friction holds, those without an equilibrium too."""
    positions: Solution
    """The scene's positions at rest: `torque` holds them, anything from `torque_low` to `torque_high` with friction."""
    moves: NDArray[np.int8]
    """Sign of the change of theta_2 when each position is released; 0: it stays, or has no speeds."""


def equilibrium(scene: Scene) -> Equilibria:
    """Find the positions in which a linkage stays by itself, whether they are stable, and what holds the others.

    On the circuit of the scene's first position that assembles, on both branches where it has both, within the sweep
    of theta_2 if one is stated (or that of its motion law, or of the command of another bar or a stroke). Speed,
    acceleration and drive of the scene play no part, viscous damping none either. With python-flint (extra "exact") and
    gravity, springs and constant loads alone the equilibria are proven to be all.

    Raises
    ------
    NotAssembledError : the linkage closes at none of the scene's positions.
    """
    expect("scene", scene, Scene)
    with np.errstate(all="ignore"):
        curve = CircuitCurve(scene)
        level = [
            part
            for part in _list_ranges(curve, curve.level, np.empty((0, 2)))
            if part.samples > A_RANGE
        ]
        samples = curve.samples()
        idle = curve.level(samples)
        zeros = Zeros(np.empty((0, 2)), np.empty((0, 2)), True)
        if not idle.all():
            proof = _prove_zeros(curve, samples[idle])
            zeros = (
                proof
                if proof is not None and proof.complete
                else _find_sign_changes(curve, samples)
            )
        points = curve.sorted(np.concatenate([zeros.found, zeros.undecided]))
        held: list[_CircuitRange] = []
        if any(term.dry_pins for term in curve.case.terms):
            held = _list_ranges(curve, partial(_holds, curve), points)
        equilibria = []
        for point in points:
            undecided = any(np.array_equal(point, part) for part in zeros.undecided)
            around = next(
                (part.ends for part in held if _is_inside(curve, point, part)), None
            )
            equilibria.append(_describe(curve, point, around, undecided=undecided))
        singular = tuple(curve.place(np.array(point)) for point in curve.singular)
        positions = _solve_at_rest(scene, curve.circuit)
        psi = positions.theta_2 - curve.theta_1
        sense = _moves(
            curve,
            np.stack([psi, positions.branch * transmission(curve.ratios, psi)], axis=1),
        )
        sense[np.isin(positions.status_code, (NOT_ASSEMBLED, SINGULAR))] = 0
        flat, ends = (tuple(part.ends for part in ranges) for ranges in (level, held))
        return Equilibria(
            tuple(equilibria), flat, zeros.complete, singular, ends, positions, sense
        )


def _solve_at_rest(scene: Scene, circuit: Circuit) -> Solution:
    """Solve the scene's positions at rest; of a single one, or a released linkage, those of the circuit."""
    commanded = of_input(scene)
    if len(commanded.theta_2) == 1:
        low, high = (
            choose_range(scene.linkage)
            if turns_fully(scene.linkage)
            else circuit.theta_2
        )
        margin = 0.0 if turns_fully(scene.linkage) else min(MARGIN, 0.25 * (high - low))
        theta_2 = np.linspace(low + margin, high - margin, DEFAULT_STEPS + 1)
        commanded = Command(
            theta_2,
            np.full(theta_2.shape, commanded.branch[0], dtype=np.int8),
            0.0,
            0.0,
        )
    return solve(
        scene,
        "force",
        at=Command(commanded.theta_2, commanded.branch, 0.0, 0.0, commanded.remainder),
    )


def _describe(
    curve: CircuitCurve,
    point: Array,
    held: tuple[RestPosition, RestPosition] | None,
    *,
    undecided: bool,
) -> Equilibrium:
    """Describe an equilibrium by theta_2, at a limit by theta_4."""
    state = curve.state(point[None])
    bar = 4 if abs(state.k.h2[0]) < STILL * abs(state.k.h4[0]) else 2
    square = float(state.k[bar - 2][0]) ** 2
    slope = float(curve.slope(point[None])[0]) / square
    J = (
        float(
            np.sum(inertia(curve.lengths.a, curve.case.bodies, state.position, state.k))
        )
        / square
    )
    stable = "undecided" if undecided else "stable" if slope < 0.0 else "unstable"
    frequency = math.sqrt(-slope / J) / TURN if stable == "stable" and J > 0.0 else None
    return Equilibrium(
        curve.place(point), stable, f"theta_{bar}", slope, J, frequency, held
    )


def _find_sign_changes(curve: CircuitCurve, points: Array) -> Zeros:
    """Find the zeros between samples at which Q changes its sign."""
    idle = curve.level(points)
    points = points[
        ~idle | np.roll(idle, 1) | np.roll(idle, -1)
    ]  # a zero may fall on a sample
    tau, row = curve.tau(points)
    Q, size, one, idle = (
        curve.force(points),
        curve.size(points),
        np.arange(len(points)),
        curve.level(points),
    )
    following = np.concatenate(
        [np.roll(one[row == number], -1) for number in range(len(curve.rows))]
    )
    gap = np.remainder(tau[following] - tau, TURN)
    between = np.flatnonzero(
        (Q * Q[following] < 0.0)
        & (gap < 2.5 * TURN / SAMPLES)
        & ~idle
        & ~idle[following]
    )
    start, branch = Q[between], np.array(curve.rows)[row[between]]

    def has_sign_of_start(tau: Array) -> NDArray[np.bool_]:
        return curve.force(curve.in_rows(tau, branch)) * start > 0.0

    _, after = _bisect(has_sign_of_start, tau[between], tau[between] + gap[between])
    zeros = curve.in_rows(after, branch)
    real = np.abs(curve.force(zeros)) <= A_JUMP * size[between]
    for point in curve.singular:  # nothing moves there, so that Q vanishes
        real &= ~(np.abs(np.sin(0.5 * (zeros - point))) < AT_CHANGE_POINT).all(axis=1)
    zeros = zeros[real]
    level = np.abs(curve.slope(zeros)) <= A_JUMP * curve.size(zeros)
    return Zeros(zeros[~level], zeros[level], False)


def _prove_zeros(curve: CircuitCurve, idle: Array) -> Zeros | None:
    """Find all zeros of Q on the circuit; None if ball arithmetic or an effect's form in it is missing.

    `idle`: samples in which Q is nothing.
    """
    try:
        from flint import ctx
    except ImportError:
        return None
    before, ctx.prec = ctx.prec, 128
    try:
        force = _enclose_force(curve.scene)
        if force is None:
            return None
        return find_zeros(
            curve.ratios,
            force,
            _bound_circuit(curve),
            _choose_boxes(curve, idle),
            curve.singular,
        )
    finally:
        ctx.prec = before


def _enclose_force(scene: Scene) -> Callable[[Any, Any], Sloped] | None:
    """Make Q of psi and mu in ball arithmetic, with its slopes by both; None if an effect has no form in it."""
    acting = tuple(
        term for term in scene.effects if not term.dry_pins
    )  # dry friction does no work at rest
    if any(
        term.key not in PROVABLE or getattr(term, "table", None)
        for term in (*scene.loads, *acting)
    ):
        return None
    scene = make_differentiable(replace(scene, effects=acting))
    still = np.zeros((2, 1), dtype=object)
    numbers = {
        key: Sloped(make_balls(value), still)
        for key, value in read_numbers(scene).items()
        if not key.startswith("motion.")
    }
    exact = replace_numbers(scene, numbers)
    lengths, theta_1 = (
        Loop(*exact.linkage.lengths, 0.0, 0.0),
        exact.linkage.ground_angle,
    )
    by_psi, by_mu = (
        np.array(column, dtype=object) for column in ([[1], [0]], [[0], [1]])
    )

    def force(psi: Any, mu: Any) -> Sloped:
        state = on_curve(lengths, theta_1, Sloped(psi, by_psi), Sloped(mu, by_mu))
        Q: Sloped = compute_generalised_force(
            exact, (*exact.loads, *exact.effects), state
        )
        return Q

    return force


def _bound_circuit(
    curve: CircuitCurve,
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return ranges of psi and mu that hold the circuit: half a turn of one of them where there is another circuit."""
    turn, ahead, back = (-math.pi, math.pi), (0.0, math.pi), (-math.pi, 0.0)
    if len(circuits(curve.scene.linkage)) == 1:
        return turn, turn
    if curve.full:
        return turn, ahead if curve.circuit.branches == (1,) else back
    return ahead if 0.0 <= curve.low < math.pi else back, turn


def _choose_boxes(
    curve: CircuitCurve, idle: Array
) -> Callable[[Array, Array], NDArray[np.bool_]]:
    """Make the choice of the boxes in which a zero is looked for: those within the sweep where Q may be something.

    Between two change points, where signs of psi and mu tell the ways of moving apart, Q may be zero throughout: a load
    on a bar that rests in one of them.
    """
    idle_ways: list[Array] = []
    if curve.singular:
        ways, idle_of = (np.sign(np.sin(points)) for points in (curve.samples(), idle))
        for way in np.unique(idle_of, axis=0):
            if (ways == way).all(axis=1).sum() == (idle_of == way).all(axis=1).sum():
                idle_ways.append(way)

    def holds_a_zero(centres: Array, radii: Array) -> NDArray[np.bool_]:
        kept = curve.inside(centres[:, 0], radii[:, 0])
        sines = np.sin(centres)
        for way in idle_ways:
            kept &= ~((way * sines > 0.0) & (np.abs(sines) > radii)).all(axis=1)
        return kept

    return holds_a_zero


def _add_friction(curve: CircuitCurve, points: Array, side: int) -> Array:
    """Compute Q with the friction that opposes impending motion to one side; infinite where friction jams."""
    state, force = curve.state(points), np.empty(len(points))
    along = np.abs(state.k.h2) >= np.abs(
        state.k.h4
    )  # the torque that balances Q, on the bar that turns faster
    for bar, chosen in ((2, along), (4, ~along)):
        if chosen.any():
            part = curve.state(points[chosen])
            case = curve.case._replace(drive_bar=bar, drive=None)
            dynamics = case.dynamics(part, 0.0, side)
            Q = -dynamics.drive * part.k[bar - 2]
            force[chosen] = (
                Q
                if dynamics.status is None
                else np.where(dynamics.status == JAMMED, -side * np.inf, Q)
            )
    return force


def _holds(curve: CircuitCurve, points: Array) -> NDArray[np.bool_]:
    """Mark the points where friction holds."""
    return (_add_friction(curve, points, 1) <= 0.0) & (
        _add_friction(curve, points, -1) >= 0.0
    )


def _moves(curve: CircuitCurve, points: Array) -> NDArray[np.int8]:
    """Find the direction in which positions start to move: sign of the change of theta_2, 0 where they stay."""
    state = curve.state(points)
    ahead, back = _add_friction(curve, points, 1), _add_friction(curve, points, -1)
    level = NOTHING * curve.size(points)
    sense = np.where(ahead > level, 1, np.where(back < -level, -1, 0))
    return np.asarray(sense * np.sign(state.k.h2), dtype=np.int8)


def _list_ranges(
    curve: CircuitCurve, holds: Callable[[Array], NDArray[np.bool_]], points_held: Array
) -> list[_CircuitRange]:
    """List the ranges within the sweep in which something holds, row by row; it holds at the points known."""
    ranges = []
    own_tau, own_row = curve.tau(points_held)
    for row, branch in enumerate(curve.rows):

        def there(tau: Array, branch: int = branch) -> NDArray[np.bool_]:
            points = curve.point(tau, branch)
            return curve.inside(points[:, 0], np.zeros(1)) & holds(points)

        tau = np.concatenate(
            [(np.arange(SAMPLES) + 0.5) * (TURN / SAMPLES), own_tau[own_row == row]]
        )
        order = np.argsort(tau)
        tau, inside = tau[order], (there(tau) | (np.arange(len(tau)) >= SAMPLES))[order]
        if inside.all():
            first, last = curve.point(
                np.array([0.0, math.nextafter(TURN, 0.0)]), branch
            )
            ranges.append(
                _CircuitRange(
                    (curve.place(first), curve.place(last)), row, 0.0, TURN, SAMPLES
                )
            )
            continue
        starts, stops = (
            np.flatnonzero(inside & ~np.roll(inside, by)) for by in (1, -1)
        )
        if len(starts) and stops[0] < starts[0]:
            stops = np.roll(stops, -1)
        following = tau[(stops + 1) % len(tau)]
        begin = _find_edge(
            there, tau[starts], np.remainder(tau[starts] - tau[starts - 1], TURN), -1.0
        )
        end = _find_edge(
            there, tau[stops], np.remainder(following - tau[stops], TURN), 1.0
        )
        for low, high, count in zip(
            begin, end, (stops - starts) % len(tau) + 1, strict=True
        ):
            one, stop = (
                curve.place(point)
                for point in curve.point(np.array([low, high]), branch)
            )
            if curve.full and stop.theta_2 < one.theta_2:
                stop = stop._replace(theta_2=stop.theta_2 + TURN)
            ends = (
                (stop, one)
                if not curve.full and one.branch == stop.branch == -1
                else (one, stop)
            )
            width = float(np.remainder(high - low, TURN))
            ranges.append(_CircuitRange(ends, row, low, width, int(count)))
    return ranges


def _is_inside(curve: CircuitCurve, point: Array, part: _CircuitRange) -> bool:
    """Return True if a point lies in a range."""
    tau, row = curve.tau(point[None])
    return bool(
        row[0] == part.row and np.remainder(tau[0] - part.low, TURN) <= part.width
    )


def _find_edge(
    held: Callable[[Array], NDArray[np.bool_]], tau: Array, gap: Array, sense: float
) -> Array:
    """Find where a range ends, between a place that is held and the next one, which is not."""
    inside, _ = _bisect(lambda away: held(tau + sense * away), np.zeros(tau.shape), gap)
    return np.asarray(np.remainder(tau + sense * inside, TURN))


def _bisect(
    holds: Callable[[Array], NDArray[np.bool_]], low: Array, high: Array
) -> tuple[Array, Array]:
    """Narrow each interval, at whose lower end alone something holds, to the two neighbours between which it ends."""
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        held = holds(middle)
        low, high = np.where(held, middle, low), np.where(held, high, middle)
    return low, high
