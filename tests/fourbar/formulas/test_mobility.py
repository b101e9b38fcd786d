"""Limits, ranges, circuits and types against scans, 50 digits and published figures."""

import itertools
import math

import mpmath as mp
import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fourbar.errors import InputError
from fourbar.formulas.mobility import (
    change_points,
    choose_range,
    circuits,
    classify,
    find_circuit,
    find_intervals,
    limit_positions,
    swing,
    time_ratio,
    turns_fully,
)
from fourbar.formulas.path import compute_state
from fourbar.linkage import Bar, FourBar, uniform

EPS = 2.0**-52
ANGLE = 8.0 * EPS
"""Rounding of a limit's angle: exact sums, then four roots, two products and an arc
tangent, each 1/2 eps of
the angle, and the sum with theta_1 and pi, 2 pi: 1/2 eps of at most 4 pi.
"""
PRINTED_8 = 0.5e-8
"""Half a unit in the last digit of an angle printed to eight decimals of a degree, deg.
"""
SCAN = 20_000
SCAN_STEP = 20.0 * math.pi / SCAN
"""What a scan of SCAN positions can miss of a range, rad: one step at each end, the
output up to ten times as fast.
"""
GRID = 2000
"""Positions of a scan over one turn."""


def linkage(d: float, a: float, b: float, c: float, theta_1: float = 0.0) -> FourBar:
    return FourBar(d, Bar(a), Bar(b), Bar(c), theta_1)


def random_linkages(seed: int, count: int) -> list[FourBar]:
    """Random lengths and theta_1.

    A third of them integers, which makes change points common.
    """
    rng = np.random.default_rng(seed)
    linkages: list[FourBar] = []
    while len(linkages) < count:
        lengths = (
            rng.integers(1, 7, 4).astype(float)
            if len(linkages) % 3 == 0
            else rng.uniform(0.1, 1.0, 4)
        )
        if 2.0 * lengths.max() < lengths.sum():
            linkages.append(
                linkage(
                    *lengths.tolist(),
                    theta_1=float(rng.uniform(-math.pi, math.pi)),
                )
            )
    return linkages


def closes(bars: FourBar, theta_2: np.ndarray) -> np.ndarray:
    """Return how far circles of radii b, c about A, O4 are from missing each other,
    m.
    """
    d, a, b, c = bars.lengths
    distance = np.abs(a * np.exp(1j * theta_2) - d * np.exp(1j * bars.ground_angle))
    return np.minimum(b + c - distance, distance - abs(b - c))


def angle(
    bars: FourBar,
    theta_2: np.ndarray,
    branch: int | np.ndarray,
    bar: int,
) -> np.ndarray:
    return np.angle(compute_state(bars, theta_2, branch).direction(bar))


def inside(angle: np.ndarray, ranges: tuple[tuple[float, float], ...]) -> np.ndarray:
    return np.any(
        [(angle - start) % (2 * math.pi) <= stop - start for start, stop in ranges],
        axis=0,
    )


# the thesis's model mechanism: 20, 48, 55, 20 cm, theta_1 = 45 deg; Linares Mendoza,
# table 3.2 (rows 2 and 4), with the mirror positions that it leaves out: 145.078...,
# 5.3819... deg
THESIS = linkage(0.20, 0.48, 0.55, 0.20, math.radians(45.0))


def test_thesis_limits_of_the_input() -> None:
    limits = limit_positions(THESIS)
    assert np.degrees([limit.theta_2 for limit in limits]) == pytest.approx(
        [84.61804062253105, 365.38195937746895],
        abs=PRINTED_8,
    )
    # theta_4 of chapter 2 (from B to O4) is ours + 180 deg
    assert (math.degrees(limits[0].theta_4) + 180.0) % 360.0 == pytest.approx(
        105.98752759110246,
        abs=PRINTED_8,
    )
    assert (math.degrees(limits[1].theta_4) + 180.0) % 360.0 == pytest.approx(
        344.01247240889757,
        abs=PRINTED_8,
    )
    assert np.degrees(choose_range(THESIS)) == pytest.approx(
        [85.61804062253105, 364.38195937746895],
        abs=PRINTED_8,
    )
    assert math.degrees(swing(THESIS, 2)) == pytest.approx(
        280.7639187549379,
        abs=PRINTED_8,
    )


def test_thesis_limits_of_the_output() -> None:
    limits = limit_positions(THESIS, 4)
    assert np.degrees([limit.theta_2 for limit in limits]) == pytest.approx(
        [145.07865810778765, 304.92134189221235],
        abs=PRINTED_8,
    )
    assert sorted(
        (math.degrees(limit.theta_4) + 180.0) % 360.0 for limit in limits
    ) == pytest.approx([24.842683784424707, 65.15731621557532], abs=PRINTED_8)
    classification = classify(THESIS)
    assert (classification.code, classification.barker, classification.longest) == (
        "RRR3",
        7,
        3,
    )
    assert classification.surplus == pytest.approx(-0.07)


PAIRS = {
    (2, 1, 2, 1): "parallelogram",
    (1, 1, 2, 2): "ground and input",
    (2, 1, 1, 2): "ground and output",
}


@pytest.mark.parametrize(
    ("lengths", "barker", "code"),
    [
        ((1, 3, 2.5, 3.2), 1, "GCCC"),
        ((3, 1, 2.5, 2.2), 2, "GCRR"),
        ((3, 2.5, 1, 2.2), 3, "GRCR"),
        ((3, 2.5, 2.2, 1), 4, "GRRC"),
        ((4, 2, 2.5, 2.2), 5, "RRR1"),
        ((2, 4, 2.5, 2.2), 6, "RRR2"),
        ((2, 2.5, 4, 2.2), 7, "RRR3"),
        ((2, 2.5, 2.2, 4), 8, "RRR4"),
        ((1, 2, 4, 3), 9, "SCCC"),
        ((2, 1, 4, 3), 10, "SCRR"),
        ((2, 4, 1, 3), 11, "SRCR"),
        ((2, 4, 3, 1), 12, "SRRC"),
        ((2, 1, 2, 1), 13, "S2X"),
        ((1, 1, 2, 2), 13, "S2X"),
        ((2, 1, 1, 2), 13, "S2X"),
        ((0.1, 0.1, 0.1, 0.1), 14, "S3X"),
    ],
)
def test_barker_classes(lengths: tuple[float, ...], barker: int, code: str) -> None:
    for scale in (1.0, 1e-9, 1e9, 1e300):
        classification = classify(linkage(*(scale * length for length in lengths)))
        assert (classification.barker, classification.code) == (barker, code)
    assert (classification.surplus == 0.0) == (barker >= 9)
    assert PAIRS.get(lengths, "") in classification.name
    if barker <= 4:  # the shortest bar turns against all others
        shortest = 1 + lengths.index(min(lengths))
        turning = {2, 3, 4} if shortest == 1 else {shortest}
        bars = linkage(*lengths)
        assert {bar for bar in (2, 3, 4) if turns_fully(bars, bar)} == turning


def test_equality_is_decided_within_the_rounding_of_the_lengths() -> None:
    assert 0.1 + 0.7 != 0.2 + 0.6  # in doubles; the lengths meant are equal sums
    assert classify(uniform(0.2, 0.1, 0.7, 0.6)).barker == 10
    assert change_points(uniform(0.2, 0.1, 0.7, 0.6))
    for ulps, barker in ((1, 10), (16, 2), (-16, 7)):
        longest = 0.7 - ulps * math.ulp(0.7)
        assert classify(uniform(0.2, 0.1, longest, 0.6)).barker == barker


def test_a_structure_stands_in_one_position() -> None:
    for lengths in itertools.permutations((1.0, 2.0, 3.0, 6.0)):
        bars = linkage(*lengths, theta_1=0.3)
        assert classify(bars).code == "structure" and classify(bars).turning == ()
        (limit,) = limit_positions(bars)
        start, stop = choose_range(bars)
        assert start == stop == limit.theta_2
        assert closes(bars, np.array([start]))[0] == pytest.approx(0.0, abs=12.0 * EPS)


@pytest.mark.parametrize(
    "bars",
    random_linkages(1, 60),
    ids=lambda bars: "-".join(f"{x:.3g}" for x in bars.lengths),
)
def test_ranges_and_circuits_agree_with_a_scan(bars: FourBar) -> None:
    theta_2 = bars.ground_angle + (np.arange(GRID) + 0.5) * (2 * math.pi / GRID)
    margin = closes(bars, theta_2)
    sure = np.abs(margin) > 16.0 * EPS * sum(bars.lengths)
    assert (inside(theta_2, find_intervals(bars))[sure] == (margin >= 0.0)[sure]).all()
    assert turns_fully(bars) == bool((margin[sure] >= 0.0).all())

    # positions as a graph: neighbours on a branch, both branches next to a gap or
    # across a change point
    place, ahead, closed = np.arange(GRID), np.roll(np.arange(GRID), -1), margin >= 0.0
    joined = closed & closed[ahead]
    meets = closed & ~(joined & np.roll(closed, 1))
    if change_points(bars):
        touches = np.abs(closes(bars, theta_2 - math.pi / GRID)) < 1e-12
        meets |= closed & touches & np.isin(place, (0, GRID // 2))
    starts = np.concatenate([place[joined], GRID + place[joined], place[meets]])
    ends = np.concatenate([ahead[joined], GRID + ahead[joined], GRID + place[meets]])
    graph = coo_array(
        (np.ones(starts.size), (starts, ends)),
        shape=(2 * GRID, 2 * GRID),
    )
    component = connected_components(graph, directed=False)[1][np.tile(closed, 2)]
    number = find_circuit(
        bars, np.tile(theta_2, 2), np.repeat(np.array([1, -1], np.int8), GRID)
    )[np.tile(closed, 2)]
    for partition in (component, number, zip(component, number, strict=True)):
        assert len(set(partition)) == len(circuits(bars))


def test_positions_that_a_motion_connects_have_one_circuit_and_open_ones_none() -> None:
    crank_rocker, rocker = uniform(3, 1, 2.5, 2.2), uniform(3, 2.5, 1, 2.2)
    assert find_circuit(
        crank_rocker, np.array([0.1, 3.0, 3.0]), np.array([1, 1, -1])
    ).tolist() == [0, 0, 1]
    start, stop = choose_range(rocker)
    beside = np.array(
        [start, stop, -start, 3.0, 0.0]
    )  # 3.0 beyond stretched bars 3 and 4, 0.0 beyond folded ones
    assert find_circuit(rocker, beside, np.array([1, -1, 1, 1, 1])).tolist() == [
        0,
        0,
        1,
        -1,
        -1,
    ]


def exact_psi(bars: FourBar, bar: int, stretched: bool) -> mp.mpf:
    """The limit's angle from the ground by the law of cosines in 50 digits."""
    d, *moving = (mp.mpf(length) for length in bars.lengths)
    bar_length = moving.pop(bar - 2)
    e = moving[0] + moving[1] if stretched else moving[0] - moving[1]
    return mp.acos((d * d + bar_length * bar_length - e * e) / (2 * d * bar_length))


def nearly_special(seed: int, count: int) -> list[FourBar]:
    """Linkages whose surplus of the longest bar is 1e-14..1e-1 of their size.

    Or the rest of that bar is.
    """
    rng = np.random.default_rng(seed)
    linkages: list[FourBar] = []
    while len(linkages) < count:
        p, q, s = rng.uniform(0.1, 1.0, 3)
        gap = float(rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-14, -1))
        longest = p + q - s + gap if len(linkages) % 2 else p + q + s - abs(gap)
        lengths = rng.permutation([p, q, s, longest])
        if (lengths > 0.02).all() and 2.0 * lengths.max() < lengths.sum():
            linkages.append(linkage(*lengths.tolist(), theta_1=0.0))
    return linkages


def test_limits_keep_their_digits_near_special_linkages() -> None:
    checked = 0
    with mp.workdps(50):
        for bars in nearly_special(3, 100) + random_linkages(4, 30):
            theta_1 = bars.ground_angle
            for bar in (2, 3, 4):
                for limit in limit_positions(bars, bar):
                    value = {
                        2: limit.theta_2,
                        3: limit.theta_3,
                        4: limit.theta_4 + math.pi,
                    }[bar]
                    psi = exact_psi(bars, bar, limit.stretched)
                    error = min(
                        abs(_mod(mp.mpf(value) - theta_1 - s * psi)) for s in (1, -1)
                    )
                    # theta_1 = 0, first of the pair: nothing is added, so the angle is
                    # good relative to itself
                    size = (
                        psi
                        if bar == 2 and theta_1 == 0.0 and 0.0 < value < math.pi
                        else 4 * mp.pi
                    )
                    assert error <= ANGLE * size, (
                        bars.lengths,
                        bar,
                        limit,
                        float(error),
                    )
                    checked += 1
    assert checked > 300


def _mod(angle: mp.mpf) -> mp.mpf:
    return angle - 2 * mp.pi * mp.nint(angle / (2 * mp.pi))


def test_limits_close_the_loop_with_two_bars_collinear() -> None:
    for bars in random_linkages(5, 100):
        d, a, b, c = bars.lengths
        for bar, pair in ((2, (3, 4)), (3, (2, 4)), (4, (2, 3))):
            limits = limit_positions(bars, bar)
            ahead = [limit.theta_2 - bars.ground_angle for limit in limits]
            assert ahead == sorted(ahead) and all(
                -EPS * 8 <= angle < 2 * math.pi for angle in ahead
            )
            for limit in limits:
                angles = {2: limit.theta_2, 3: limit.theta_3, 4: limit.theta_4}
                gap = a * np.exp(1j * angles[2]) + b * np.exp(1j * angles[3])
                gap -= d * np.exp(1j * bars.ground_angle) + c * np.exp(1j * angles[4])
                assert abs(gap) <= ANGLE * 2 * math.pi * sum(bars.lengths)
                assert (
                    abs(math.sin(angles[pair[0]] - angles[pair[1]]))
                    <= ANGLE * 2 * math.pi
                )
                # bars 2, 3 lie along each other where stretched; the output runs from
                # its far end
                along = math.cos(angles[pair[0]] - angles[pair[1]]) > 0.0
                assert along == (limit.stretched == (bar == 4))
                assert limit.branch == (
                    0
                    if bar == 2
                    else math.copysign(1.0, math.sin(angles[4] - angles[3]))
                )


def test_swing_is_what_a_scan_of_the_output_finds() -> None:
    seen = set()
    for bars in random_linkages(6, 60):
        if change_points(bars):
            continue  # there the output's range is that of several smooth paths
        seen.add(classify(bars).code[:4])
        start, stop = find_intervals(bars)[0]
        phase = np.arange(0.5, SCAN) * (math.pi / SCAN)
        theta_2 = 0.5 * (start + stop) - 0.5 * (stop - start) * np.cos(
            phase
        )  # dense where theta_4 goes as a root
        branches = (1,) if turns_fully(bars) else (1, -1)
        theta_4 = [np.unwrap(angle(bars, theta_2, branch, 4)) for branch in branches]
        if len(theta_4) == 2:  # both branches start from the same limit position
            theta_4[1] += (
                2 * math.pi * round((theta_4[0][0] - theta_4[1][0]) / (2 * math.pi))
            )
        scanned = max(x.max() for x in theta_4) - min(x.min() for x in theta_4)
        assert scanned == pytest.approx(swing(bars), abs=SCAN_STEP), bars.lengths
    assert seen >= {"GCCC", "GCRR", "GRCR", "GRRC", "RRR1", "RRR2", "RRR3", "RRR4"}


def test_ranges_of_coupler_and_output_hold_every_position_and_no_more() -> None:
    for bars in random_linkages(8, 24):
        theta_2 = bars.ground_angle + (np.arange(GRID) + 0.5) * (2 * math.pi / GRID)
        theta_2 = theta_2[closes(bars, theta_2) > 0.0]
        for bar in (3, 4):
            reached = np.concatenate(
                [angle(bars, theta_2, branch, bar) for branch in (1, -1)]
            )
            clear = np.min(
                [
                    np.abs(np.sin(0.5 * (reached - end)))
                    for end in np.ravel(find_intervals(bars, bar))
                ],
                axis=0,
            )
            assert inside(reached[clear > 1e-6], find_intervals(bars, bar)).all()
            # the first range holds the ground's direction (bar 4: its opposite) or
            # begins less than pi after it
            first, half = find_intervals(bars, bar)[0][0], math.pi if bar == 4 else 0.0
            assert abs(first - (bars.ground_angle + half)) <= math.pi * (1.0 + EPS)
            for start, stop in find_intervals(bars, bar):
                for end in (start, stop) if not turns_fully(bars, bar) else ():
                    # theta_k goes as a square root near its limit's theta_2, or is
                    # tangent to it
                    assert (
                        np.abs(np.sin(0.5 * (reached - end))).min()
                        < 20.0 * math.pi / GRID
                    )


def test_time_ratio_is_the_time_of_both_strokes() -> None:
    bars = uniform(3.0, 1.0, 2.5, 2.2)
    n = 200_000
    theta_2 = (np.arange(n) + 0.5) * (2 * math.pi / n)
    position = compute_state(bars, theta_2, 1).position
    ahead = np.count_nonzero(
        np.sin(theta_2 - np.angle(position.u3)) * position.sin_mu > 0.0
    )  # omega_4 > 0
    ratio = max(ahead, n - ahead) / min(ahead, n - ahead)
    assert time_ratio(bars) == pytest.approx(
        ratio,
        rel=8.0 / n,
    )  # both ends counted to one step
    assert time_ratio(uniform(1, 3, 2.5, 3.2)) is None
    assert time_ratio(THESIS) is None
    # limits of the output alone are not enough: there are change points, or the input
    # does not turn
    assert (
        time_ratio(uniform(3, 1, 2, 2)) is None
        and len(limit_positions(linkage(3, 1, 2, 2), 4)) == 2
    )
    for bars in random_linkages(11, 100):
        assert turns_fully(bars) or time_ratio(bars) is None
    # a central (in-line) crank-rocker, d^2 + a^2 = b^2 + c^2, has equal strokes
    assert time_ratio(
        uniform(math.sqrt(2.5**2 + 2.2**2 - 1), 1, 2.5, 2.2)
    ) == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize(
    ("lengths", "turns"),
    [
        ((2, 1, 2, 1), (0.0, math.pi)),
        ((1, 2, 4, 3), (0.0,)),
        ((3, 1, 2, 2), (math.pi,)),
        ((3, 1, 2.5, 2.2), ()),
        # of lengths whose sum is 2 those touch that miss by 8 U = 4 EPS
        ((0.5, 0.5 + 4 * EPS, 0.5, 0.5), (0.0, math.pi)),
        ((0.5, 0.5 + 5 * EPS, 0.5, 0.5), ()),
    ],
)
def test_change_points_lie_along_the_ground_and_opposite(
    lengths: tuple[float, ...], turns: tuple[float, ...]
) -> None:
    bars = linkage(*lengths, theta_1=0.4)
    assert change_points(bars) == tuple(0.4 + turn for turn in turns)
    assert turns_fully(bars) == (lengths[1] != 0.5 + 5 * EPS)


def test_angles_of_limits_exclude_minus_pi() -> None:
    straight = linkage(
        6.0, 1.0, 2.0, 3.0, -math.pi
    )  # a structure: all bars along the ground
    assert len(limit_positions(straight)) == 1
    for limit in limit_positions(straight):
        assert limit.theta_3 == math.pi
    for limit in limit_positions(linkage(6.0, 1.0, 2.0, 3.0001, -math.pi)):
        assert (
            -math.pi < limit.theta_3 <= math.pi and -math.pi < limit.theta_4 <= math.pi
        )


def test_a_range_narrower_than_two_margins_is_halved() -> None:
    bars = linkage(6.0, 1.0, 2.0, 3.0001, 0.3)  # 1e-4 beyond a structure
    (start, stop), (low, high) = find_intervals(bars)[0], choose_range(bars)
    assert 0.0 < stop - start < math.radians(4.0)
    assert (low - start, stop - high) == pytest.approx(
        2 * [(stop - start) / 4.0],
        rel=1e-12,
    )


def test_the_default_range_is_as_wide_as_the_contract_says() -> None:
    assert choose_range(uniform(3, 1, 2.5, 2.2)) == (0.0, 2 * math.pi)
    for bars in random_linkages(7, 100):
        start, stop = choose_range(bars)
        if turns_fully(bars):
            continue
        touching = (
            -16.0 * EPS * sum(bars.lengths)
        )  # at a change point the bars just meet
        assert (
            start < stop
            and (closes(bars, np.linspace(start, stop, 50)) > touching).all()
        )
        ends = closes(
            bars, np.array([start - math.radians(1.001), stop + math.radians(1.001)])
        )
        assert (ends < 0.0).all()
        holds_theta_1 = closes(bars, np.array([bars.ground_angle]))[0] > touching
        assert (start < bars.ground_angle < stop) == holds_theta_1


def test_a_bar_that_does_not_move_is_refused_and_so_is_what_is_no_linkage() -> None:
    with pytest.raises(InputError, match=r"^bar = 1: must be 2, 3 or 4"):
        limit_positions(THESIS, 1)
    with pytest.raises(InputError, match=r"^linkage = .*FourBar"):
        limit_positions("thesis.toml")  # type: ignore[arg-type]
