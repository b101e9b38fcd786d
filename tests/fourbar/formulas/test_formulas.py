"""The formulas as they stand.

Exact sums, the path read from either end, shapes, the half angle in many digits.
"""

import itertools
import math
from fractions import Fraction
from typing import Any

import mpmath as mp
import numpy as np
import pytest

import fourbar.formulas
from fourbar.formulas.arithmetic import (
    angle,
    cross,
    exact_difference,
    polar,
    power_of_two,
    split_sum,
    square_root,
    tangent,
    vector,
)
from fourbar.formulas.many_digits import (
    decide_half_angles,
    exact_half_angle,
    limit_remainder,
)
from fourbar.formulas.mobility import limit_positions
from fourbar.formulas.motion import Coefficients, Rates, State, rates
from fourbar.formulas.path import (
    drive_sine,
    drive_sine_of_triangle,
    prepare_path,
)
from fourbar.formulas.pin_forces import Body, inertia_wrenches, pin_forces
from fourbar.formulas.position import (
    HalfAngle,
    close_loop,
    direction,
    half_angle,
    loop,
)
from fourbar.formulas.torque import driving_torque, half_slope, inertia
from fourbar.linkage import MOVING_BARS, Bar, FourBar, uniform
from tests.fourbar.formulas.test_points import Drawn, random_positions

U = 2.0**-53
THREE_SUMS = 3.0 * U
"""Relative, of a difference of two sums of two: nothing is lost but in the last three
sums.
"""
PRODUCTS = 8.0 * U
"""Relative, of E1 and E2: two such differences, or one and a sum of four, and their
product.
"""
TANGENT = 10.0 * U
"""Relative, of sin^2 h, cos^2 h and sin h cos h from a tangent that a library gives to
2 U: two or three of it, a square, a sum, a quotient and a product; of a factor of
Heron's formula likewise, relative to its terms.
"""
ROUNDED_SUM = 2.0**-51
"""Of the sum of four lengths: what is missing of it where each is rounded by four U."""
SEEN_OF_A_BAR, SEEN_OF_THE_DIAGONAL = 1e-9, 1e-11
"""Of a length and of d - a: what is more than that is stated and no rounding."""
FROM_EITHER_END = 64.0 * 2.0**-52
"""Roundings of two methods for one position; for the n-th derivative magnified as those
of the coefficients are.
"""
DIGITS_LEFT = 1e-40
"""Relative to the offset: of 120 digits an offset of 1e-40 takes 40, and a limit near a
change point some 20 more.
"""


class Carrying(float):
    """A number that carries its derivatives, as far as `vector` asks."""

    slopes = ()


def test_plain_numbers_stay_plain_and_arrays_broadcast() -> None:
    """Python's own floats give Python's own results, in a third of the time of
    NumPy's.
    """
    assert vector(1.0, 2.0) == 1.0 + 2.0j and type(vector(1.0, 2.0)) is complex
    for x, y in ((Carrying(1.0), 2.0), (1.0, Carrying(2.0))):
        assert vector(x, y) == 1.0 + 2.0j and type(vector(x, y)) is complex
    assert (
        type(vector(np.float64(1.0), 2.0)) is np.complex128
        and vector(1.0, np.float64(2.0)) == 1.0 + 2.0j
    )
    column, row = np.array([[1.0], [2.0]]), np.array([3.0, 4.0, 5.0])
    for x, y in ((column, row), (column, 3.0), (3.0, row)):
        assert np.array_equal(vector(x, y), x + 1j * np.asarray(y))
    assert type(angle(1j)) is float and angle(1j) == 0.5 * math.pi
    assert [type(square_root(x)) for x in (0.0, 0.25)] == [
        float,
        float,
    ] and square_root(0.25) == 0.5
    assert type(polar(2.0, 0.0)) is complex and polar(2.0, 0.0) == 2.0
    assert type(tangent(0.25)) is float and type(power_of_two(0.7)) is float
    assert power_of_two(0.7) == 1.0 and np.array_equal(
        power_of_two(np.array([0.7, 1.0, 3.0])), [1.0, 2.0, 4.0]
    )


def hard_doubles(seed: int, count: int) -> list[tuple[float, float, float, float]]:
    """p, q, r, s > 0 with p + q and r + s equal, or apart by a rounding or a few."""
    rng = np.random.default_rng(seed)

    def one() -> float:
        tight = (1.0, 1.5, 2.0 - 2.0**-52, 1.0 + 2.0**-52)
        significand = (
            float(rng.choice(tight)) if rng.random() < 0.4 else rng.uniform(1.0, 2.0)
        )
        return float(
            significand
            * 2.0
            ** int(rng.integers(-60, 5) if rng.random() < 0.5 else rng.integers(-3, 3))
        )

    quadruples = []
    while len(quadruples) < count:
        p, q, r = one(), one(), one()
        s = float(Fraction(p) + Fraction(q) - Fraction(r))
        if len(quadruples) % 3 == 0:
            r, s = max(p, q), min(p, q)
        s *= 1.0 + int(rng.integers(-2, 3)) * 2.0**-52
        if s > 0.0:
            quadruples.append((p, q, r, s))
    return quadruples


@pytest.mark.slow
def test_a_difference_of_two_sums_is_zero_where_it_is_zero_and_nowhere_else() -> None:
    zeros = 0
    # two lengths a billiardth of the others: what both sums lose is no double
    small = (
        0.9999999999999999,
        5.551115123125782e-17,
        0.9999999999999999,
        5.551115123125783e-17,
    )
    plain = [tuple(row) for row in np.random.default_rng(2).random((5000, 4))]
    for p, q, r, s in [small, *plain, *hard_doubles(1, 20_000)]:
        exact = Fraction(p) + Fraction(q) - Fraction(r) - Fraction(s)
        difference = Fraction(exact_difference(p, q, r, s))
        zeros += exact == 0
        assert abs(difference - exact) <= THREE_SUMS * abs(exact), (p, q, r, s)
        total, rest = split_sum(p, q)
        assert total == p + q and Fraction(total) + Fraction(rest) == Fraction(
            p
        ) + Fraction(q)
    assert zeros > 1000


def is_rounding(
    difference: Fraction,
    lengths: tuple[Fraction, ...],
    diagonal: Fraction | None,
) -> bool:
    """Decide exactly whether a difference of lengths is no more than their rounding."""
    size = abs(difference)
    invisible = all(size <= Fraction(SEEN_OF_A_BAR) * length for length in lengths)
    if diagonal is not None:
        seen = Fraction(SEEN_OF_THE_DIAGONAL) * abs(diagonal)
        invisible = invisible and size <= seen
    return invisible and size <= Fraction(ROUNDED_SUM) * sum(lengths)


def is_nearly_at_the_bound(
    difference: Fraction,
    lengths: tuple[Fraction, ...],
    diagonal: Fraction,
) -> bool:
    """Decide whether the squares in doubles may compare otherwise than exact ones."""
    bounds = [Fraction(ROUNDED_SUM) * sum(lengths)]
    bounds += [Fraction(SEEN_OF_THE_DIAGONAL) * abs(diagonal)]
    bounds += [Fraction(SEEN_OF_A_BAR) * length for length in lengths]
    return any(abs(abs(difference) - bound) <= 16 * U * bound for bound in bounds)


@pytest.mark.slow
def test_the_constants_of_the_loop_vanish_within_rounding_alone() -> None:
    zeros, judged, at_a_bound = [0, 0], 0, 0
    # a + d and b + c, or a + c and b + d, from the same two sums
    for p, q, r, s in hard_doubles(3, 5000):
        for stated in ((p, q, r, s), (p, r, q, s), (p, r, s, q)):
            bars = loop(*stated)
            read = (bars.d, bars.a, bars.b, bars.c)
            for length, other in zip(read, stated, strict=True):
                assert abs(length - other) <= 2.0 * ROUNDED_SUM * other
            d, a, b, c = lengths = tuple(map(Fraction, read))
            sums = b + c - a - d, d + c - a - b, d + b - a - c
            if any(is_nearly_at_the_bound(each, lengths, d - a) for each in sums):
                at_a_bound += 1
                continue
            judged += 1
            outer = is_rounding(sums[0], lengths, None)
            inner = any(is_rounding(each, lengths, d - a) for each in sums[1:])
            for k, (value, exact, vanishes) in enumerate(
                (
                    (bars.E1, sums[0] * (a + b + c + d), outer),
                    (bars.E2, sums[1] * sums[2], inner),
                )
            ):
                zeros[k] += vanishes
                assert (value == 0.0) == vanishes, stated
                if not vanishes:
                    assert abs(Fraction(value) - exact) <= PRODUCTS * abs(exact)
    assert min(zeros) > 300
    assert judged > 12_000 and at_a_bound < 2000, (judged, at_a_bound)


def read_from_the_output(drawn: Drawn) -> tuple[State, Any, Any]:
    """The state read in theta_2, and position and coefficients read in theta_4."""
    moving, from_output = (
        drawn.moving(),
        prepare_path(drawn.bars.lengths, drawn.bars.ground_angle, 4),
    )
    theta_4 = np.angle(moving.position.u4)
    # of the triangle B, A, O2: bars 3 and 2 there are as bars 4 and 3 in the order of
    # theta_2
    sign = -np.sign((moving.position.u2 * moving.position.u3.conjugate()).imag)
    return moving, *from_output.motion(
        from_output.position(theta_4, from_output.half_angle(theta_4), sign), sign
    )


def test_read_in_theta_4_the_linkage_lies_and_moves_the_same() -> None:
    """By the chain rule: h2 = 1/h4, h3 becomes h3/h4, and so on for the second ones."""
    compared = 0
    for drawn in random_positions(31, 300, 0.2):
        moving, position, k = read_from_the_output(drawn)
        other_sine = abs(
            float((moving.position.u2 * moving.position.u3.conjugate()).imag[0])
        )
        if other_sine < 0.2:
            continue
        compared += 1
        size = (max(drawn.bars.lengths) / min(drawn.bars.lengths)) ** 2
        allowed = FROM_EITHER_END * size / (drawn.sine * other_sine)
        for name in ("u1", "u2", "u3", "u4", "sin_mu", "diagonal"):
            assert (
                abs(getattr(position, name) - getattr(moving.position, name)) <= allowed
            ), name
        mine = moving.k
        grown = (
            size
            * (1.0 + abs(mine.h3) + 1.0 / abs(mine.h4)) ** 3
            / (drawn.sine * other_sine) ** 2
        )
        for coefficient, expected in (
            (k.h2, 1.0 / mine.h4),
            (k.h3, mine.h3 / mine.h4),
            (k.h4, 1.0),
            (k.h23, mine.h23 / mine.h4),
            (k.h43, mine.h43 / mine.h4),
            (k.dh2, -mine.dh4 / mine.h4**3),
            (k.dh3, (mine.dh3 * mine.h4 - mine.h3 * mine.dh4) / mine.h4**3),
            (k.dh4, 0.0),
        ):
            assert abs(coefficient - expected) <= allowed * grown
    assert compared > 150


def test_read_in_theta_4_the_input_stands_at_its_limit() -> None:
    """There theta_4 alone is an independent angle.

    The input has no speed and the output may have any.
    """
    bars = FourBar(0.5, Bar(0.4), Bar(0.3), Bar(0.25), 0.2)
    for limit in limit_positions(bars):
        from_output = prepare_path(bars.lengths, bars.ground_angle, 4)
        sign = math.copysign(1.0, math.sin(limit.theta_3 - limit.theta_2))
        position, k = from_output.motion(
            from_output.position(
                limit.theta_4, from_output.half_angle(limit.theta_4), sign
            ),
            sign,
        )
        assert math.remainder(
            float(np.angle(position.u2)) - limit.theta_2, math.tau
        ) == pytest.approx(0.0, abs=8.0 * U)
        assert abs(position.sin_mu) <= 16.0 * U and abs(k.h2) <= 32.0 * U
        assert (
            np.isfinite(k).all()
            and k.h4 == 1.0
            and abs(k.h43) > 0.1
            and abs(k.dh2) > 0.1
        )


def test_read_in_theta_4_a_parallelogram_stays_parallel_exactly() -> None:
    from_output = prepare_path((0.3, 0.1, 0.3, 0.1), 0.0, 4)
    theta_4 = np.array([1e-9, 0.5, 3.0])
    sign = 1.0  # sin(theta_3 - theta_2) > 0 for 180 deg < theta_4 < 360 deg
    position, k = from_output.motion(
        from_output.position(theta_4, from_output.half_angle(theta_4), sign), sign
    )
    assert position.u2 == pytest.approx(np.exp(1j * theta_4), abs=4.0 * U)
    assert position.u3 == pytest.approx(np.ones(3), abs=4.0 * U)
    for coefficient, expected in ((k.h2, 1.0), (k.h3, 0.0), (k.dh2, 0.0), (k.dh3, 0.0)):
        assert np.array_equal(coefficient, np.full(3, expected))


@pytest.mark.parametrize(
    "lengths", [(0.3, 0.1, 0.25, 0.22), (0.3, 0.1, 0.3, 0.1), (0.2, 0.3, 0.3, 0.2)]
)
def test_the_sine_of_the_drive_is_that_of_the_two_bars_not_driven(
    lengths: tuple[float, float, float, float],
) -> None:
    """Of bars that stay parallel it is exactly zero."""
    d, a, _, _ = lengths
    angles, u1 = np.linspace(-2.9, 3.0, 30), np.exp(0.4j)
    for bar, branch in itertools.product((2, 4), (1.0, -1.0)):
        reading = prepare_path(lengths, 0.4, bar)
        with np.errstate(
            invalid="ignore"
        ):  # read from the output the loop does not close at every angle
            position, _ = reading.motion(
                reading.position(angles, reading.half_angle(angles), branch), branch
            )
        closed = np.isfinite(position.sin_mu)
        assert closed.any()
        for drive_bar, (u, v) in {
            2: (position.u3, position.u4),
            3: (position.u2, position.u4),
            4: (position.u2, position.u3),
        }.items():
            with np.errstate(invalid="ignore"):
                sine = reading.drive_sine(position, drive_bar)
            assert sine[closed] == pytest.approx(cross(u, v)[closed], abs=32.0 * U)
            if bar == 2 and lengths in STAY_PARALLEL:
                parallel = (u == v) | (u == -v)
                assert parallel.any() == ((drive_bar, branch) == STAY_PARALLEL[lengths])
                assert (sine[parallel] == 0.0).all()
    plain = close_loop(
        loop(*lengths), u1, np.exp(1j), half_angle(loop(*lengths), 0.6), 1.0
    )
    assert plain.diagonal == pytest.approx(d * u1 - a * np.exp(1j), abs=8.0 * U)


STAY_PARALLEL = {(0.3, 0.1, 0.3, 0.1): (3, 1.0), (0.2, 0.3, 0.3, 0.2): (4, -1.0)}
"""Drive and assembly in which the two bars not driven are parallel: 2 and 4 of a
parallelogram, 2 and 3 of a kite.
"""


LINKAGES = np.array(
    [
        (0.3, 0.1, 0.25, 0.22),
        (0.25, 0.22, 0.3, 0.1),
        (0.3, 0.1, 0.3, 0.1),  # a parallelogram
        (
            0.1,
            0.3,
            0.3,
            0.1,
        ),  # kites; with the second A lies on O4 at theta_2 = theta_1
        (0.3, 0.3, 0.2, 0.2),
        (0.2, 0.2, 0.2, 0.2),
        (0.08, 0.24, 0.2, 0.26),  # input longer than the ground
        (0.4, 0.35, 0.1, 0.08),  # 4 a d > 4 b c, and few positions close
    ]
)
ANGLES = np.array([-2.5, -1e-7, 0.0, 0.3, 1.0, 2.0, math.pi, 4.0, 7.0])


OF_REAL_NUMBERS = {*HalfAngle._fields, *Coefficients._fields, *Rates._fields}
"""Complex products are rounded otherwise where the processor does several at once;
these are the same to the bit.
"""
FUSED = 64.0 * U
"""Relative to the largest: by what the roundings of some ten complex products differ,
where all sines are above 0.1.
"""


def everything(
    d: Any,
    a: Any,
    b: Any,
    c: Any,
    theta_1: Any,
    q: Any,
    branch: Any,
    bar: int = 2,
) -> dict[str, Any]:
    """All that the formulas give, on the path in the angle of a bar."""
    lengths = loop(d, a, b, c)
    from_output = prepare_path((d, a, b, c), theta_1, bar)
    half = from_output.half_angle(q)
    position, k = from_output.motion(from_output.position(q, half, branch), branch)
    moving = rates(k, 2.0, -3.0)
    here = State(lengths, theta_1, q, position, k, 2.0, moving)
    bodies = (
        Body(0.2, 0.01, 0.3 * a + 0.01j),
        Body(0.5, 0.02, 0.6 * b - 0.02j),
        Body(0.4, 0.03, 0.5 * c + 0j),
    )
    w, mass_at_A = inertia_wrenches(a, bodies, position, moving)
    inertial = (
        sum(inertia(a, bodies, position, k)) * -3.0
        + half_slope(a, bodies, position, k) * 4.0
    )
    values = {
        **half._asdict(),
        **k._asdict(),
        **moving._asdict(),
        "u3": position.u3,
        "u4": position.u4,
        "sin_mu": position.sin_mu,
    }
    values |= {
        "sine_A": cross(position.u2, position.u3),
        "sine_24": cross(position.u2, position.u4),
    }
    for k_th in MOVING_BARS:
        values[f"G{k_th}"] = here.point(k_th, bodies[k_th - 2].z)
        values[f"a_G{k_th}"] = here.acceleration(k_th, bodies[k_th - 2].z)
        values[f"T{k_th}"] = driving_torque(k[k_th - 2], inertial, 0.5)
        pins = pin_forces(
            lengths, position, k_th, drive_sine(position, k_th), w, mass_at_A, 0.25
        )
        values |= {
            f"{name} of drive {k_th}": value for name, value in pins._asdict().items()
        }
    return values


def plainly(number: type, *arguments: Any) -> dict[str, Any]:
    """Everything in one kind of number.

    Where Python's own refuse to divide by zero `solve` takes NumPy's too.
    """
    try:
        return everything(*arguments)
    except ZeroDivisionError:
        assert number is float
        return everything(*map(np.float64, arguments[:-2]), *arguments[-2:])


@pytest.mark.parametrize("bar", MOVING_BARS)
@pytest.mark.parametrize("branch", [1, -1])
@pytest.mark.parametrize("theta_1", [0.0, 0.4])
def test_numbers_arrays_and_many_linkages_at_once_are_the_same_formulas(
    theta_1: float,
    branch: int,
    bar: int,
) -> None:
    q = theta_1 + ANGLES
    shape = (len(LINKAGES), len(ANGLES))
    with np.errstate(all="ignore"):
        columns = [LINKAGES[:, k : k + 1] for k in range(4)]
        at_once = everything(*columns, theta_1, q, branch, bar)
        at_once = {
            name: np.broadcast_to(value, shape) for name, value in at_once.items()
        }
        others = [
            everything(
                *columns,
                np.full((len(LINKAGES), 1), theta_1),
                np.tile(q, (len(LINKAGES), 1)),
                np.full(shape, branch),
                bar,
            )
        ]
        rows = [
            everything(*lengths.tolist(), theta_1, q, branch, bar)
            for lengths in LINKAGES
        ]
        others.append(
            {
                name: [np.broadcast_to(row[name], q.shape) for row in rows]
                for name in at_once
            }
        )
        for number in (float, np.float64):
            alone = [
                [
                    plainly(
                        number,
                        *map(number, lengths),
                        number(theta_1),
                        number(angle),
                        branch,
                        bar,
                    )
                    for angle in q
                ]
                for lengths in LINKAGES
            ]
            assert {
                np.ndim(value)
                for row in alone
                for answer in row
                for value in answer.values()
            } == {0}
            others.append(
                {
                    name: [[answer[name] for answer in row] for row in alone]
                    for name in at_once
                }
            )
    regular = (
        np.min(
            [np.abs(at_once[name]) for name in ("sin_mu", "sine_A", "sine_24")],
            axis=0,
        )
        > 0.1
    )
    assert 15 < regular.sum() < regular.size
    for answers in others:
        for name, value in at_once.items():
            broadcast = np.broadcast_to(answers[name], shape)
            if name in OF_REAL_NUMBERS:
                assert np.array_equal(broadcast, value, equal_nan=True), name
            else:
                allowed = FUSED * np.abs(value[regular]).max()
                assert (np.abs(broadcast[regular] - value[regular]) <= allowed).all(), (
                    name
                )


def five(bars: FourBar, psi: mp.mpf) -> list[mp.mpf]:
    """sin^2 h, cos^2 h, sin h cos h and the factors, from A and O4 in the complex
    plane.
    """
    d, a, b, c = map(mp.mpf, bars.lengths)
    e = abs(d - a * mp.expj(psi))
    return [
        (1 - mp.cos(psi)) / 2,
        (1 + mp.cos(psi)) / 2,
        mp.sin(psi) / 2,
        (b + c) ** 2 - e**2,
        e**2 - (b - c) ** 2,
    ]


def test_the_half_angle_in_many_digits_is_rounded_once() -> None:
    with mp.workdps(200):
        for drawn in random_positions(41, 60):
            bars, theta_2 = drawn.bars, float(drawn.theta_2[0])
            expected = five(bars, mp.mpf(theta_2) - mp.mpf(bars.ground_angle))
            for ours, exact in zip(
                exact_half_angle(bars, theta_2)[:5],
                expected,
                strict=True,
            ):
                assert abs(ours - exact) <= U * abs(exact)
            offset = mp.mpf("1e-25") * theta_2
            expected = five(bars, mp.mpf(theta_2) + offset - mp.mpf(bars.ground_angle))
            for ours, exact in zip(
                exact_half_angle(bars, theta_2, offset)[:5],
                expected,
                strict=True,
            ):
                assert abs(ours - exact) <= U * abs(exact)


def test_the_half_angle_in_doubles_keeps_the_digits_of_the_angle() -> None:
    """From the ground's direction to the opposite, and after many turns.

    Angles are as near to both as doubles come.
    """
    near = 10.0 ** -np.arange(1.0, 17.0)
    turns = 2.0 * math.pi * np.array([3.0, 800.0, -800.0])[:, None] + [
        1e-9,
        0.7,
        math.pi + 1e-9,
    ]
    psi = np.concatenate(
        [
            near,
            -near,
            math.pi - near,
            near - math.pi,
            np.linspace(-7.0, 7.0, 40),
            [math.pi],
        ]
    )
    psi = np.append(psi, turns)
    with mp.workdps(200):
        for lengths in [*LINKAGES.tolist(), (0.4, 0.397, 0.003, 0.002)]:
            bars = uniform(*lengths)
            half = half_angle(loop(*bars.lengths), psi)
            d, a, b, c, E1, E2 = loop(*bars.lengths)
            for i, angle in enumerate(psi):
                ss, kk, sk, outer, inner = five(bars, mp.mpf(float(angle)))
                for ours, exact in ((half.ss, ss), (half.kk, kk), (half.sk, sk)):
                    assert abs(ours[i] - exact) <= TANGENT * abs(exact)
                of_outer, of_inner = abs(E1) + 4 * a * d * kk, abs(E2) + 4 * a * d * ss
                # one is what the other leaves of 4 b c, where that has fewer digits to
                # lose
                for ours, exact, terms, of_other in (
                    (half.outer, outer, of_outer, of_inner),
                    (half.inner, inner, of_inner, of_outer),
                ):
                    assert abs(ours[i] - exact) <= TANGENT * min(
                        terms, 4 * b * c + of_other
                    )


def exact_limit(bars: FourBar, stretched: bool) -> mp.mpf:
    """theta_2 of a limit position by Heron's factors of the sides ground, input and
    e.
    """
    d, a, b, c = map(mp.mpf, bars.lengths)
    e = b + c if stretched else abs(b - c)
    squared = (e + a - d) * (e + d - a) / ((d + a - e) * (d + a + e))
    return mp.mpf(bars.ground_angle) + 2 * mp.atan(mp.sqrt(squared))


@pytest.mark.parametrize("size", [1e-6, 1e-12, 1e-20, 1e-30, 1e-40])
@pytest.mark.parametrize(
    ("bars", "stretched"),
    [
        (FourBar(0.5, Bar(0.4), Bar(0.3), Bar(0.25), 0.2), True),
        (FourBar(0.9, Bar(0.7), Bar(0.65), Bar(0.1), -2.5), True),
        (FourBar(0.9, Bar(0.7), Bar(0.65), Bar(0.1), -2.5), False),
        (FourBar(0.5, Bar(0.5), Bar(0.7), Bar(0.3 - 1e-9), 0.0), True),
        (
            FourBar(0.5, Bar(0.1), Bar(0.7), Bar(0.3 - 1e-9), 0.0),
            False,
        ),  # a billionth short of a change point
    ],
    ids=[
        "rocker",
        "double rocker, outer",
        "double rocker, inner",
        "equal ground and input",
        "near a change point",
    ],
)
def test_an_offset_from_a_limit_in_many_digits(
    bars: FourBar,
    stretched: bool,
    size: float,
) -> None:
    first = next(
        limit.theta_2 for limit in limit_positions(bars) if limit.stretched == stretched
    )
    for offset in (size, -size):
        theta_2 = first + offset
        remainder = limit_remainder(bars, first, theta_2, offset)
        with mp.workdps(200):
            limit = exact_limit(bars, stretched)
            meant = limit + mp.mpf(offset)
            assert abs(limit - first) < 1e-15 * math.pi
            assert abs(mp.mpf(theta_2) + remainder - meant) <= DIGITS_LEFT * size
            expected = five(bars, meant - mp.mpf(bars.ground_angle))
            half = exact_half_angle(bars, theta_2, remainder)
            for ours, exact in zip(half[:5], expected, strict=True):
                assert abs(ours - exact) <= (1.0 + DIGITS_LEFT) * U * abs(exact)
            # beyond the limit nothing closes, however near: stretched bars stop it
            # going on, folded ones going back
            assert (half.outer if stretched else half.inner) * (
                -offset if stretched else offset
            ) > 0.0


def test_a_limit_position_itself_closes_in_many_digits() -> None:
    bars = FourBar(0.5, Bar(0.4), Bar(0.3), Bar(0.25), 0.2)
    for limit in limit_positions(bars):
        half = exact_half_angle(
            bars,
            limit.theta_2,
            limit_remainder(bars, limit.theta_2, limit.theta_2, 0.0),
        )
        assert half.outer == 0.0 < half.inner


def test_bars_that_miss_by_the_rounding_of_their_lengths_touch() -> None:
    """0.1 + 0.7 = 0.2 + 0.6 of the lengths meant, and not of the doubles."""
    for lengths in ((0.6, 0.7, 0.1, 0.2), (0.7, 0.6, 0.2, 0.1)):
        d, a, b, c = lengths
        assert Fraction(d) + Fraction(c) != Fraction(a) + Fraction(b)
        bars = uniform(*lengths)
        assert loop(*lengths).E2 == 0.0
        for remainder in (None, mp.mpf(0)):
            assert exact_half_angle(bars, 0.0, remainder).inner == 0.0
        assert fourbar.solve(fourbar.Scene(bars, fourbar.Motion(0.0, 1.0))).status == [
            "change_point"
        ]


def test_positions_decided_in_many_digits_replace_their_own_alone() -> None:
    bars, theta_2 = uniform(0.3, 0.1, 0.25, 0.22), np.linspace(0.1, 6.0, 7)
    half = half_angle(loop(*bars.lengths), theta_2)
    for offset in (None, mp.mpf("1e-3")):
        decided = decide_half_angles(bars, 1.0, half, np.array([1, 4]), theta_2, offset)
        assert decided.root_sign == half.root_sign == 1.0
        for name, before, after in zip(
            half._fields[:5],
            half[:5],
            decided[:5],
            strict=True,
        ):
            exact = [
                float(getattr(exact_half_angle(bars, float(angle), offset), name))
                for angle in theta_2
            ]
            assert after[[1, 4]].tolist() == [exact[1], exact[4]]
            assert np.array_equal(np.delete(after, [1, 4]), np.delete(before, [1, 4]))
            assert offset is None or not np.array_equal(after, before)


@pytest.mark.parametrize("bar", [3, 4])
@pytest.mark.parametrize("branch", [1, -1])
def test_the_sine_of_the_drive_by_the_triangle_is_that_of_the_directions(
    bar: int,
    branch: int,
) -> None:
    """On linkages whose directions differ by much, and on a short ground.

    The latter is against 60 digits of the closed loop.
    """
    from mpmath import mp, mpf

    theta_2 = np.linspace(0.1, 6.0, 13)
    lengths = loop(0.3, 0.1, 0.25, 0.22)
    position = close_loop(
        lengths, 1.0, direction(theta_2), half_angle(lengths, theta_2), branch
    )
    sine = drive_sine_of_triangle(lengths, position, bar)
    assert np.allclose(sine, drive_sine(position, bar), rtol=0.0, atol=16.0 * U)
    with mp.workdps(60):
        d, a, b, c = map(mpf, (2.0**-14, 1.5, 0.75, 1.25))
        D = d - a * mp.expj(mpf(0.7))
        e2 = abs(D) ** 2
        root = branch * mp.sqrt(((b + c) ** 2 - e2) * (e2 - (b - c) ** 2))
        u = D * (e2 + b * b - c * c + mp.j * root) / (2 * b * e2)
        u = u if bar == 4 else (b * u - D) / c
        exact = float((mp.conj(mp.expj(mpf(0.7))) * u).imag)
    short = loop(2.0**-14, 1.5, 0.75, 1.25)
    position = close_loop(short, 1.0, direction(0.7), half_angle(short, 0.7), branch)
    assert drive_sine_of_triangle(short, position, bar) == pytest.approx(
        exact,
        rel=16.0 * U,
    )


def test_the_factor_that_changes_less_gives_the_other_its_digits() -> None:
    """outer + inner = 4 b c.

    With a short coupler or output both are small against 4 a d.
    """
    for psi, lengths in (
        (3.141, (0.75, 0.75, 1.5, 1e-6)),
        (1e-3, (0.75, 0.75 + 1.4e-3, 2e-6, 1.4e-3)),
    ):
        d, a, b, c = map(mp.mpf, lengths)
        half = half_angle(loop(*lengths), psi)
        with mp.workdps(50):
            e2 = (d - a) ** 2 + 4 * a * d * mp.sin(mp.mpf(psi) / 2) ** 2
            exact = ((b + c) ** 2 - e2, e2 - (b - c) ** 2)
        changes = float(
            4 * a * d * abs(mp.sin(psi)) * psi
        )  # with the last digit of psi
        for ours, factor in zip((half.outer, half.inner), exact, strict=True):
            assert abs(factor - float(ours)) <= PRODUCTS * (float(4 * b * c) + changes)
