"""Limits, ranges, circuits and types against scans and 50 digits."""

import itertools
from math import copysign, cos, pi, radians, sin, sqrt, tau

import mpmath as mp
import numpy as np
from pytest import approx, mark, raises
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fourbar import InputError
from fourbar.formulas.mobility import (
    change_points,
    choose_range,
    circuits,
    classify,
    find_circuit,
    find_intervals,
    limit_positions,
    time_ratio,
    turns_fully,
)
from fourbar.linkage import MOVING_BARS, uniform
from tests.support.rows import read_rows
from tests.support.scenes import EPS, bare, cis, draw_linkage

ANGLE = 8.0 * EPS
"""Rounding of a limit's angle: exact sums, then four roots, two products and an arc
tangent, each 1/2 eps of the angle, and the sum with theta_1 and pi, 2 pi: 1/2 eps of
at most 4 pi.
"""
GRID = 2000
"""Positions of a scan over one turn."""
OTHERS = {2: (3, 4), 3: (2, 4), 4: (2, 3)}


def random_linkages(seed, count):
    """Draw lengths and theta_1, a third integers: change points are common there."""
    rng = np.random.default_rng(seed)
    return [draw_linkage(rng, integers=n % 3 == 0) for n in range(count)]


def nearly_special(seed, count):
    """Linkages whose longest bar misses an equal sum by 1e-14..1e-1 of their size."""
    rng = np.random.default_rng(seed)
    linkages = []
    while len(linkages) < count:
        p, q, s = rng.uniform(0.1, 1.0, 3)
        gap = float(rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-14, -1))
        longest = p + q - s + gap if len(linkages) % 2 else p + q + s - abs(gap)
        lengths = rng.permutation([p, q, s, longest])
        if (lengths > 0.02).all() and 2.0 * lengths.max() < lengths.sum():
            linkages.append(uniform(*lengths.tolist()))
    return linkages


def closes(bars, theta_2):
    """Return how far circles of radii b, c about A, O4 are from missing, m."""
    d, a, b, c = bars.lengths
    distance = abs(a * cis(theta_2) - d * cis(bars.ground_angle))
    return np.minimum(b + c - distance, distance - abs(b - c))


THESIS = bare(0.2, 0.48, 0.55, 0.2, radians(45.0))
"""The linkage of Linares Mendoza's thesis."""


@mark.parametrize(
    "stated, barker, code, name",
    read_rows("""
1 3 2.5 3.2 | 1 | GCCC | drag link
3 1 2.5 2.2 | 2 | GCRR | crank-rocker
3 2.5 1 2.2 | 3 | GRCR | double rocker
3 2.5 2.2 1 | 4 | GRRC | rocker-crank
4 2 2.5 2.2 | 5 | RRR1 | triple rocker
2 4 2.5 2.2 | 6 | RRR2 | triple rocker
2 2.5 4 2.2 | 7 | RRR3 | triple rocker
2 2.5 2.2 4 | 8 | RRR4 | triple rocker
1 2 4 3 | 9 | SCCC | change-point
2 1 4 3 | 10 | SCRR | change-point
2 4 1 3 | 11 | SRCR | change-point
2 4 3 1 | 12 | SRRC | change-point
2 1 2 1 | 13 | S2X | parallelogram
1 1 2 2 | 13 | S2X | ground and input
2 1 1 2 | 13 | S2X | ground and output
0.1 0.1 0.1 0.1 | 14 | S3X | rhombus
"""),
)
def test_barker_classes(stated, barker, code, name):
    lengths, barker = np.array(stated.split(), dtype=float), int(barker)
    for scale in (1.0, 1e-9, 1e9, 1e300):
        kind = classify(uniform(*scale * lengths))
        assert (kind.barker, kind.code) == (barker, code)
    assert (kind.surplus == 0.0) == (barker >= 9)
    assert name in kind.name
    if barker <= 4:  # the shortest bar turns against all others
        shortest = 1 + lengths.argmin()
        turning = {2, 3, 4} if shortest == 1 else {shortest}
        bars = uniform(*lengths)
        assert {bar for bar in MOVING_BARS if turns_fully(bars, bar)} == turning


@mark.parametrize("lengths", [*itertools.permutations((1.0, 2.0, 3.0, 6.0))])
@mark.parametrize("theta_1", [0.3, -pi])
def test_a_structure_stands_in_one_position(lengths, theta_1):
    bars = bare(*lengths, theta_1)
    assert classify(bars).code == "structure" and classify(bars).turning == ()
    (limit,) = limit_positions(bars)
    assert choose_range(bars) == (limit.theta_2, limit.theta_2)
    assert closes(bars, limit.theta_2) == approx(0.0, abs=12.0 * EPS)
    assert -pi < limit.theta_3 <= pi and -pi < limit.theta_4 <= pi


@mark.parametrize("bars", random_linkages(1, 60))
def test_circuits_agree_with_a_scan(bars):
    """Positions are a graph.

    Neighbours on a branch are joined, and both branches next to a gap or across a
    change point.
    """
    theta_2 = bars.ground_angle + (np.arange(GRID) + 0.5) * (tau / GRID)
    margin = closes(bars, theta_2)
    sure = abs(margin) > 16.0 * EPS * sum(bars.lengths)
    ranges = [(theta_2 - a) % tau <= b - a for a, b in find_intervals(bars)]
    assert (np.any(ranges, axis=0)[sure] == (margin >= 0.0)[sure]).all()
    assert turns_fully(bars) == bool((margin[sure] >= 0.0).all())
    assert turns_fully(bars) or time_ratio(bars) is None

    place, ahead, closed = np.arange(GRID), np.roll(np.arange(GRID), -1), margin >= 0.0
    joined = closed & closed[ahead]
    meets = closed & ~(joined & np.roll(closed, 1))
    if change_points(bars):
        touches = abs(closes(bars, theta_2 - pi / GRID)) < 1e-12
        meets |= closed & touches & np.isin(place, (0, GRID // 2))
    starts = np.concatenate([place[joined], GRID + place[joined], place[meets]])
    ends = np.concatenate([ahead[joined], GRID + ahead[joined], GRID + place[meets]])
    joints = np.ones(starts.size), (starts, ends)
    graph = coo_array(joints, shape=(2 * GRID, 2 * GRID))
    component = connected_components(graph, directed=False)[1]
    branch = np.repeat(np.array([1, -1], np.int8), GRID)
    number = find_circuit(bars, np.tile(theta_2, 2), branch)
    both = np.tile(closed, 2)
    assert (number[~both & np.tile(sure, 2)] == -1).all()
    pairs = [*zip(component[both], number[both], strict=True)]
    for partition in (component[both], number[both], pairs):
        assert len(set(partition)) == len(circuits(bars))


@mark.parametrize("bar", MOVING_BARS)
def test_limits_keep_their_digits_and_close_the_loop_with_two_bars_in_line(bar):
    """Against the law of cosines in 50 digits."""
    checked, (first, second) = 0, OTHERS[bar]
    for bars in nearly_special(3, 100) + random_linkages(4, 80):
        d, a, b, c = bars.lengths
        theta_1, limits = bars.ground_angle, limit_positions(bars, bar)
        assert list(limits) == sorted(limits, key=lambda limit: limit.theta_2)
        for limit in limits:
            checked += 1
            angles = dict(zip(MOVING_BARS, limit, strict=False))
            value = limit[bar - 2] + (pi if bar == 4 else 0.0)
            with mp.workdps(50):
                ground, *moving = map(mp.mpf, bars.lengths)
                own = moving.pop(bar - 2)
                e = moving[0] + (1 if limit.stretched else -1) * moving[1]
                psi = mp.acos((ground**2 + own**2 - e**2) / (2 * ground * own))
                turned = mp.mpf(value) - theta_1
                error = min(
                    abs(mp.fmod(turned - sign * psi + 9 * mp.pi, 2 * mp.pi) - mp.pi)
                    for sign in (1, -1)
                )
            # theta_1 = 0, first of the pair: nothing is added, so the angle is good
            # relative to itself
            alone = bar == 2 and theta_1 == 0.0 and 0.0 < value < pi
            assert error <= ANGLE * (psi if alone else 4 * pi)
            u2, u3, u4 = (cis(angles[k]) for k in MOVING_BARS)
            gap = a * u2 + b * u3 - d * cis(theta_1) - c * u4
            assert abs(gap) <= ANGLE * tau * sum(bars.lengths)
            # bars 2, 3 lie along each other where stretched; the output runs from
            # its far end
            between = angles[first] - angles[second]
            assert abs(sin(between)) <= ANGLE * tau
            assert (cos(between) > 0.0) == (limit.stretched == (bar == 4))
            sine = sin(angles[4] - angles[3])
            assert limit.branch == (0 if bar == 2 else copysign(1.0, sine))
    assert checked > 300


def test_a_central_crank_rocker_has_strokes_of_one_time_and_others_may_have_none():
    """It has d^2 + a^2 = b^2 + c^2."""
    central = uniform(sqrt(2.5**2 + 2.2**2 - 1), 1, 2.5, 2.2)
    assert time_ratio(central) == approx(1.0, abs=1e-14)
    # limits of the output alone are not enough: there are change points
    assert len(limit_positions(uniform(3, 1, 2, 2), 4)) == 2
    for without in (uniform(1, 3, 2.5, 3.2), THESIS, uniform(3, 1, 2, 2)):
        assert time_ratio(without) is None


@mark.parametrize(
    "stated, turns",
    read_rows("""
2 1 2 1 | 0 1
1 2 4 3 | 0
3 1 2 2 | 1
3 1 2.5 2.2 |
# of lengths whose sum is 2 those touch that miss by 8 U: 8 U and 10 U
0.5 0.5000000000000009 0.5 0.5 | 0 1
0.5 0.5000000000000011 0.5 0.5 |
"""),
)
def test_change_points_lie_along_the_ground_and_opposite(stated, turns):
    bars = bare(*map(float, stated.split()), 0.4)
    places = [0.4 + pi * float(turn) for turn in turns.split()]
    assert list(change_points(bars)) == places
    assert turns_fully(bars) == (bars.input.length != 0.5 + 5 * EPS)


def test_a_bar_that_does_not_move_is_refused_and_so_is_what_is_no_linkage():
    with raises(InputError, match=r"^bar = 1: must be 2, 3 or 4"):
        limit_positions(THESIS, 1)
    with raises(InputError, match=r"^linkage = .*FourBar"):
        limit_positions("thesis.toml")
