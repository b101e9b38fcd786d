"""Mobility: limit positions of the moving bars, ranges, change points, swing.

The time ratio follows from these.

Let bar k (length l) close the loop with the ground (d) and the other two moving bars
(x, y). With e the distance from the bar's free end to the far end of the ground, the
loop closes where
    |x - y| <= e <= x + y,
while e runs from |d - l| to d + l. At e = x + y the other two bars are stretched, at
e = |x - y| they are folded: a limit of bar k. Where an end of e meets an end of the
allowed range all four bars are collinear: a change point. All sums of lengths are
exact, rounded once.
"""

import math
from operator import mul
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fourbar.errors import expect
from fourbar.formulas.arithmetic import power_of_two
from fourbar.formulas.path import prepare_path
from fourbar.formulas.position import ROLES_OF_BARS, TOUCHING, find_parallel_pairs
from fourbar.linkage import BAR_NAMES, MOVING_BARS, FourBar, Lengths, require_bar

Array = NDArray[np.float64]

TURN = math.tau
ANGLE_FROM_LIMITS = math.radians(1.0)
"""Angle that `choose_range` leaves out at each end of an interval. No speeds exist at a
limit itself.
"""
_NARROW = 4.0
"""Divisor of an interval's width that bounds what `choose_range` leaves out at each
end.
"""


class LimitPosition(NamedTuple):
    """A position in which bar k is at a limit: the other two bars are collinear."""

    theta_2: float
    """rad, in [theta_1, theta_1 + 2 pi)."""
    theta_3: float
    """rad, in (-pi, pi]."""
    theta_4: float
    """rad, in (-pi, pi]."""
    branch: int
    """+1 open, -1 crossed, 0 where the two branches meet (every limit of bar 2)."""
    stretched: bool
    """True if the other two bars lie in each other's prolongation (e = x + y).
    Otherwise they are folded.
    """


class Reach(NamedTuple):
    """Bar k against the rest of the loop, in a power of two above the longest bar.

    Sums within rounding of 0 are 0.
    """

    d: float
    own: float
    x: float
    y: float

    def sum(self, d: int, own: int, x: int, y: int) -> float:
        """Sum the lengths with these signs exactly, rounded once."""
        terms = (d * self.d, own * self.own, x * self.x, y * self.y)
        total = math.fsum(terms)
        perimeter = self.d + self.own + self.x + self.y
        return 0.0 if abs(total) <= TOUCHING * perimeter else total

    @property
    def beyond_stretched(self) -> float:
        """(d + l) - (x + y): > 0 if stretched bars stop bar k, 0 at a change point."""
        return self.sum(1, 1, -1, -1)

    @property
    def beyond_folded(self) -> float:
        """|x - y| - |d - l|: > 0 where folded bars stop bar k, 0 at a change point."""
        p = 1 if self.x >= self.y else -1
        q = 1 if self.d >= self.own else -1
        return self.sum(-q, q, p, -p)

    def triangle(self, stretched: bool) -> tuple[float, float]:
        """Compute the angles of the triangle d, l, e at both ends of the ground, rad.

        Heron's factors give the angle between d and l,

            tan^2(psi/2) = (e + l - d)(e + d - l)/((d + l - e)(d + l + e)),

        and the same with d, e for d, l.
        """
        sign_x = 1
        sign_y = 1  # e = x + y
        if not stretched and self.x >= self.y:
            sign_y = -1  # e = x - y
        elif not stretched:
            sign_x = -1  # e = y - x
        root_d = math.sqrt(self.sum(-1, 1, sign_x, sign_y))  # e + l - d
        root_l = math.sqrt(self.sum(1, -1, sign_x, sign_y))  # e + d - l
        root_e = math.sqrt(self.sum(1, 1, -sign_x, -sign_y))  # d + l - e
        root_sum = math.sqrt(self.sum(1, 1, sign_x, sign_y))  # d + l + e
        half_at_near = math.atan2(root_d * root_l, root_e * root_sum)
        half_at_far = math.atan2(root_d * root_e, root_l * root_sum)
        return 2.0 * half_at_near, 2.0 * half_at_far


def reach_of(linkage: FourBar, bar: int = 2) -> Reach:
    """Return bar 2, 3 or 4 against the rest of the loop; InputError for another bar."""
    expect("linkage", linkage, FourBar)
    bar = require_bar("bar", bar)
    # the division is exact, and no product of lengths leaves the range of doubles
    unit = power_of_two(max(linkage.lengths))
    d, *moving = (length / unit for length in linkage.lengths)
    driven = moving.pop(bar - 2)
    return Reach(d, driven, *moving)


def _wrap(angle: float) -> float:
    rest = math.remainder(angle, TURN)
    return math.pi if rest <= -math.pi else rest


def limit_positions(linkage: FourBar, bar: int = 2) -> tuple[LimitPosition, ...]:
    """Find the positions in which a bar reverses, counter-clockwise from theta_1.

    All mirror solutions are included. With psi the angle between the ground and the
    bar,

        cos psi = (d^2 + l^2 - (x +- y)^2)/(2 d l).

    Bar 2 gives the limits of the input (bars 3, 4 collinear), bar 4 those of the output
    (bars 2, 3 collinear), and every bar the dead centres of a drive on it. A change
    point is none.

    Parameters
    ----------
    bar : 2, 3 or 4; InputError otherwise.

    Source: R. L. Norton, Design of Machinery; Linares Mendoza, eqs 3.7-3.15 (one of
    each mirror pair).
    """
    reach = reach_of(linkage, bar)
    theta_1 = linkage.ground_angle
    first, second = (number for number in MOVING_BARS if number != bar)
    shorter = second if reach.x >= reach.y else first
    limits: list[LimitPosition] = []
    for stretched in (False, True):
        if (reach.beyond_stretched if stretched else reach.beyond_folded) <= 0.0:
            continue
        psi, eta = reach.triangle(stretched)
        straight = psi in (0.0, math.pi)
        signs = (1.0,) if straight else (1.0, -1.0)
        for sign in signs:
            # directions in the sum of vectors around the loop, in which bar 4 runs
            # from B back to O4: its vector is -c u4
            directions = {bar: sign * psi, first: -sign * eta, second: -sign * eta}
            if not stretched:
                directions[shorter] += math.pi
            theta_2 = theta_1 + directions[2] % TURN
            theta_3 = theta_1 + directions[3]
            theta_4 = theta_1 + directions[4] + math.pi
            branch = 0
            if bar != 2 and not straight:
                branch = int(math.copysign(1.0, math.sin(theta_4 - theta_3)))
            angles = (theta_2, _wrap(theta_3), _wrap(theta_4))
            limits.append(LimitPosition(*angles, branch, stretched))
    return tuple(sorted(limits))


def find_intervals(linkage: FourBar, bar: int = 2) -> tuple[tuple[float, float], ...]:
    """Find the ranges [from, to] of a bar's angle in which the linkage assembles, rad.

    `to` may exceed 2 pi. One range where the bar turns fully (a whole turn from the
    ground's line) or has one pair of limits, two mirror images where it has two pairs;
    the range that contains the ground's direction (for bar 4: its opposite) or lies
    first counter-clockwise from it comes first.
    """
    reach = reach_of(linkage, bar)
    start = linkage.ground_angle + (math.pi if bar == 4 else 0.0)
    inner = None
    outer = None
    if reach.beyond_folded > 0.0:
        inner, _ = reach.triangle(False)
    if reach.beyond_stretched > 0.0:
        outer, _ = reach.triangle(True)
    if inner is None:
        if outer is None:
            return ((start, start + TURN),)
        return ((start - outer, start + outer),)
    if outer is None:
        return ((start + inner, start + (TURN - inner)),)
    first = (start + inner, start + outer)
    mirrored = (start + (TURN - outer), start + (TURN - inner))
    return first, mirrored


def turns_fully(linkage: FourBar, bar: int = 2) -> bool:
    """Return True if a moving bar can turn through 360 deg against the ground.

    Change points may lie within the turn.
    """
    reach = reach_of(linkage, bar)
    return max(reach.beyond_folded, reach.beyond_stretched) <= 0.0


def choose_range(
    linkage: FourBar,
    bar: int = 2,
    holding: float | None = None,
    margin: float = ANGLE_FROM_LIMITS,
) -> tuple[float, float]:
    """Choose the range of a commanded bar's angle for a scene that names none, rad.

    0..2 pi where the bar turns fully; otherwise the first of `find_intervals`, or the
    one that holds an angle, shrunk by a margin at each end.
    """
    if turns_fully(linkage, bar):
        return 0.0, TURN
    every = find_intervals(linkage, bar)
    start, stop = every[0]
    if holding is not None:
        # two ranges have one width; a limit may lie on either side of an end
        start, stop = min(
            every, key=lambda ends: abs(math.remainder(holding - sum(ends) / 2, TURN))
        )
    margin = min(margin, (stop - start) / _NARROW)
    return start + margin, stop - margin


def find_limit_angles(linkage: FourBar, bar: int) -> tuple[float, ...]:
    """Find the angles at which a bar reverses, rad, counter-clockwise from theta_1."""
    theta_1 = linkage.ground_angle
    angles = []
    for limit in limit_positions(linkage, bar):
        angles.append(theta_1 + (limit[bar - 2] - theta_1) % TURN)
    return tuple(sorted(angles))


def change_points(linkage: FourBar, bar: int = 2) -> tuple[float, ...]:
    """Find the angles of a bar at which all bars are collinear and branches cross, rad.

    Bar 2, which is the default, has its change points at

        theta_1 where |a - d| = |b - c|,   theta_1 + pi where a + d = b + c,

    within the rounding of the lengths; likewise of the lengths as they are read from
    another bar, from bar 4 with the ground reversed.
    """
    reach = reach_of(linkage, bar)
    theta_1 = linkage.ground_angle
    folded = reach.beyond_folded == 0.0
    stretched = reach.beyond_stretched == 0.0
    if bar == 4:
        folded, stretched = stretched, folded
    return (theta_1,) * folded + (theta_1 + math.pi,) * stretched


def swing(linkage: FourBar, bar: int = 4) -> float:
    """Compute the angle through which a bar swings, rad; 2 pi for a full turn."""
    start, stop = find_intervals(linkage, bar)[0]
    return stop - start


def time_ratio(linkage: FourBar) -> float | None:
    """Compute the quick return of a crank-rocker at constant omega_2.

    The time of the slower stroke over that of the faster is

        (2 pi - delta)/delta,

    delta <= pi the input's angle between the two limits of the output (R. L. Norton,
    Design of Machinery). None where the input does not turn fully
    or the output has no stroke of its own.
    """
    if not turns_fully(linkage) or change_points(linkage):
        return None
    stroke = [
        limit.theta_2 for limit in limit_positions(linkage, 4) if limit.branch == 1
    ]
    if len(stroke) != 2:
        return None
    delta = stroke[1] - stroke[0]
    delta = min(delta, TURN - delta)
    return (TURN - delta) / delta


_BOTH = (1, -1)


class Circuit(NamedTuple):
    """Positions that are connected by motion."""

    theta_2: tuple[float, float]
    """Range [from, to] in which it assembles, rad; a whole turn if the input turns
    fully.
    """
    branches: tuple[int, ...]
    """Branches of the circuit; two meet at the limits of theta_2 or at change points.
    """


def circuits(linkage: FourBar) -> tuple[Circuit, ...]:
    """List the circuits of a linkage, each with its range of theta_2 and its branches.

    A Grashof linkage has two: the branches, where the input turns fully, else the two
    ranges of theta_2. Every other linkage has one; at a change point both branches
    count as reachable.

    Source: T. R. Chase, J. A. Mirth, Circuits and branches of single-degree-of-freedom
    planar linkages, J. Mechanical Design 115 (1993) 223-230.
    """
    ranges = find_intervals(linkage)
    if turns_fully(linkage) and not change_points(linkage):
        return tuple(Circuit(ranges[0], (branch,)) for branch in _BOTH)
    return tuple(Circuit(interval, _BOTH) for interval in ranges)


def find_circuit(
    linkage: FourBar,
    theta_2: Array,
    branch: int | NDArray[np.int8],
) -> NDArray[np.int8]:
    """Return the index in `circuits` of each position, (n,); -1 if not assembled.

    `theta_2`: (n,), rad. `branch`: +1 or -1, or one of them for each position (n,).
    """
    theta_2 = np.asarray(theta_2, dtype=float)
    path = prepare_path(linkage.lengths, linkage.ground_angle)
    half = path.half_angle(theta_2)
    assembles = (half.outer >= 0.0) & (half.inner >= 0.0)
    return find_circuit_where(assembles, linkage, theta_2, branch)


def find_circuit_where(
    assembles: NDArray[np.bool_],
    linkage: FourBar,
    theta_2: Array,
    branch: int | NDArray[np.int8],
) -> NDArray[np.int8]:
    """Return the index in `circuits` of positions known to assemble, else -1."""
    every = circuits(linkage)
    is_second: NDArray[np.bool_] | bool = False
    if len(every[0].branches) == 1:
        is_second = np.not_equal(branch, every[0].branches)
    elif len(every) == 2:  # their ranges are mirror images in the ground's line
        is_second = (theta_2 - linkage.ground_angle) % TURN >= 0.5 * TURN
    return np.where(assembles, is_second, -1).astype(np.int8)


_GRASHOF = {
    1: ("GCCC", "double crank (drag link)"),
    2: ("GCRR", "crank-rocker"),
    3: ("GRCR", "double rocker"),
    4: ("GRRC", "rocker-crank"),
}
"""Barker's code and name by the number of the shortest bar. That bar turns fully
against all others.
"""
CHANGE_POINT_TYPES = {1: "SCCC", 2: "SCRR", 3: "SRCR", 4: "SRRC"}
PARALLELOGRAM = "parallelogram"
_NEARLY = 1e-3
"""Miss of a change point, over the sum of the lengths, up to which it is reported."""
DIGITS_STATED = 1e-4
"""Part of the sum of the lengths up to which the last decimal of a length is a
rounding; a coarser one is meant as it stands.
"""
_EQUALITIES = ((-1, -1, 1, 1), (1, -1, -1, 1), (1, -1, 1, -1))
"""Signs of ground, input, coupler, output in the sums that vanish at change points. The
sums are those of E1, and both of E2.
"""


class LinkageType(NamedTuple):
    """Type of a linkage and the sums and bars that decide it."""

    surplus: float
    """p + q - s - l, m: > 0 Grashof, 0 change point, < 0 non-Grashof."""
    barker: int | None
    """Barker's class 1..14; None for a structure, which cannot move."""
    code: str
    """Barker's letters for bars 2, 3, 4 in turn. G Grashof, S special (change point), R
    rocker, C crank.
    """
    name: str
    shortest: int
    """Number of the shortest bar, the lowest of equal ones."""
    longest: int
    """Number of the longest bar, the lowest of equal ones."""
    turning: tuple[int, ...]
    """Bars among 2, 3, 4 that turn fully against the ground. Change points may lie
    within the turn.
    """


def classify(linkage: FourBar, within: float = TOUCHING) -> LinkageType:
    """Classify a linkage by the Grashof condition s + l < p + q.

    The bar that is shortest or longest names the type. s, l are the shortest and
    longest lengths, p, q the other two. The sums are exact; equality is decided within
    the rounding of the four lengths. Which of the three sums of two bars and the other
    two are equal tells the change-point types apart: one equality 9-12, two 13
    (opposite bars equal: parallelogram; adjacent bars equal: kite, also deltoid or
    Galloway), three 14 (rhombus).

    `within`: part of the sum of the lengths within which sums count as equal.

    Source: C. R. Barker, A complete classification of planar four-bar linkages,
    Mechanism and Machine Theory 20 (1985).
    """
    expect("linkage", linkage, FourBar)
    unit = power_of_two(max(linkage.lengths))
    lengths = tuple(length / unit for length in linkage.lengths)
    least = min(lengths)
    most = max(lengths)
    shortest = 1 + lengths.index(least)
    longest = 1 + lengths.index(most)
    perimeter = math.fsum(lengths)
    excess = math.fsum((2.0 * least, 2.0 * most, *(-length for length in lengths)))
    if abs(excess) <= within * perimeter:
        excess = 0.0
    with_input, with_output, opposite = (
        gap <= within * perimeter for gap in _find_gaps(lengths)
    )
    equalities = with_input + with_output + opposite
    found: tuple[int | None, str, str]
    if math.fsum((*lengths, -2.0 * most)) <= TOUCHING * perimeter:
        name = f"structure (the {BAR_NAMES[longest]} is as long as the other three)"
        found = (None, "structure", name)
    elif excess < 0.0:
        found = (shortest, *_GRASHOF[shortest])
    elif excess > 0.0:
        name = f"triple rocker (longest: {BAR_NAMES[longest]})"
        found = (4 + longest, f"RRR{longest}", name)
    elif equalities == 3:
        found = (14, "S3X", "rhombus (triple change point)")
    elif equalities == 2:
        # d + b = a + c and d + c = a + b give d = a;
        # d + b = a + c and d + a = b + c give d = c
        name = PARALLELOGRAM
        if opposite and with_output:
            name = "kite (equal: ground and input; coupler and output)"
        elif opposite:
            name = "kite (equal: ground and output; input and coupler)"
        found = (13, "S2X", name)
    else:
        name = f"change-point {_GRASHOF[shortest][1]}"
        found = (8 + shortest, CHANGE_POINT_TYPES[shortest], name)
    turning = tuple(bar for bar in MOVING_BARS if turns_fully(linkage, bar))
    barker, code, name = found
    surplus = -excess * unit
    return LinkageType(surplus, barker, code, name, shortest, longest, turning)


def name_assembly(linkage: FourBar, bar: int, branch: int) -> str:
    """Name a linkage in the assembly that a command of a bar and its branch state.

    A parallelogram's other assembly, and both that a command of its coupler can have,
    are the antiparallelogram. In one assembly of a kite or a rhombus two bars lie on
    each other and turn together, and one bar stands still.

    >>> from fourbar import uniform
    >>> linkage = uniform(3, 1, 3, 1)
    >>> name_assembly(linkage, 2, 1), name_assembly(linkage, 2, -1)
    ('parallelogram', 'antiparallelogram')
    """
    name = classify(linkage).name
    path = prepare_path(linkage.lengths, linkage.ground_angle, bar)
    parallel, folded = find_parallel_pairs(path.lengths, branch)
    if folded:
        return f"{name}, {BAR_NAMES[ROLES_OF_BARS[bar][2]]} at rest"
    if name == PARALLELOGRAM and not parallel:
        return "antiparallelogram"
    return name


def find_miss(linkage: FourBar) -> tuple[float, str] | None:
    """Find by how much a linkage misses one with a change point, m, and its name.

    None: by too much.
    """
    meant = classify(linkage, _NEARLY)
    exact = classify(linkage)
    if meant.name == exact.name or meant.barker is None or meant.barker < 9:
        return None
    largest = _NEARLY * math.fsum(linkage.lengths)
    gaps = _find_gaps(linkage.lengths)
    return max(gap for gap in gaps if gap <= largest), meant.name


def _find_gaps(lengths: tuple[float, ...]) -> list[float]:
    """Return by how much each of the equalities of change points is missed, m."""
    return [abs(math.fsum(map(mul, signs, lengths))) for signs in _EQUALITIES]


def count_equalities(lengths: Lengths) -> int:
    """Count the equalities of change points that hold.

    Two hold for a parallelogram or a kite, three for a rhombus.
    """
    touching = TOUCHING * math.fsum(lengths)
    return sum(gap <= touching for gap in _find_gaps(lengths))


def list_met_equalities(
    stated: tuple[float, ...],
    met: tuple[float, ...],
) -> list[tuple[str, str, float]]:
    """List what is equal only in the lengths that `meet_change_points` returns.

    An entry has the names of both sides (bars, or sums of two bars if no two bars are
    equal) and the difference of the lengths as stated, m.
    """
    touching = TOUCHING * math.fsum(met)
    bars = tuple(BAR_NAMES.values())
    pairs = []
    for second, length in enumerate(met):
        for first in range(second):
            if abs(met[first] - length) <= touching:
                gap = abs(stated[first] - stated[second])
                if gap > touching:
                    pairs.append((bars[first], bars[second], gap))
                break
    if pairs:
        return pairs
    gaps = zip(_EQUALITIES, _find_gaps(stated), _find_gaps(met), strict=True)
    for signs, gap, left in gaps:
        if left <= touching < gap:
            sides: dict[int, list[str]] = {-1: [], 1: []}
            for sign, bar in zip(signs, bars, strict=True):
                sides[sign].append(bar)
            pairs.append((" + ".join(sides[-1]), " + ".join(sides[1]), gap))
    return pairs


def meet_change_points(
    lengths: Lengths,
    roundings: Lengths,
    decimals: Lengths | None = None,
) -> Lengths:
    """Return the four lengths with the equalities that they miss by rounding.

    The lengths are those of ground, input, coupler and output.

    The equalities b + c = a + d, d + c = a + b, d + b = a + c of change points hold
    within the sum of the roundings or not; the lengths nearest to the stated ones that
    fulfil those which hold are returned, the stated ones if none.

    Parameters
    ----------
    lengths : as stated, m.
    roundings : largest error of each length by the rounding of what was stated, m.
    decimals : half of the last decimals of what was stated, if not the roundings; too
        coarse ones round nothing.
    """
    perimeter = math.fsum(lengths)
    fine = []
    for rounding, last in zip(roundings, decimals or roundings, strict=True):
        fine.append(rounding if last <= DIGITS_STATED * perimeter else 0.0)
    allowed = math.fsum(fine)
    meant = []
    misses = []
    for signs in _EQUALITIES:
        miss = math.fsum(map(mul, signs, lengths))
        if abs(miss) <= allowed:
            meant.append(signs)
            misses.append(miss)
    touching = TOUCHING * perimeter
    if all(abs(miss) <= touching for miss in misses):
        return lengths  # none is missed by more than the formulas count as nothing
    # least changes, weighted by the roundings: W E^T (E W E^T)^-1 misses
    equalities = np.array(meant, dtype=float)
    weights = np.square(fine)
    normal = (equalities * weights) @ equalities.T
    multipliers = np.linalg.pinv(normal) @ np.array(misses)
    changes = weights * (equalities.T @ multipliers)
    d, a, b, c = (np.array(lengths) - changes).tolist()
    return d, a, b, c
