"""Error bars of what the drive does and of the pin forces: how far rounding makes them scatter.

The forces are evaluated again with every number of the position, coefficient and term of a sum changed in its last
digit. All roundings then fall differently, so the root mean square of the changes is of the size of the error
itself, whatever the formulas lose at this position. What is stated of the bars, loads and effects is exact, and
what a product of it loses is no more than its other factors are changed by. As many changes go up as down, in an order
of its own for each number, so that those of different numbers do not cancel over the evaluations, which run as one
batch.
"""

from functools import cache
from itertools import combinations, cycle
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fourbar.effects.actions import keep_number
from fourbar.evaluation.case import Case, Dynamics
from fourbar.formulas.arithmetic import angle, is_any, select, split_sum
from fourbar.formulas.motion import Coefficients, State, find_fast_turns, may_turn_fast, rates
from fourbar.formulas.path import read_from
from fourbar.formulas.position import HalfAngle, Loop, Position
from fourbar.scene.stroke import find_triangle

EVALUATIONS = 14
"""Of the orders of seven changes up and seven down half are the others reversed, which leaves NUMBERS of them: so many
numbers of which no two change alike in all evaluations, or against each other, and so cancel. With fewer evaluations
the mean scatters more."""
NUMBERS = 1716
"""A scene has about fifty, and a few for each load and effect."""
LAST_DIGIT = 1.01 * 2.0**-53
"""Relative: x + x LAST_DIGIT is the next double, whatever x."""
LAST_ROUNDING = 2.0**-53
"""Relative: half the distance to the next double, or more; the result itself was rounded by as much."""
TYPICAL = 0.45
"""The error bar as a share of the root mean square. That holds the error of the answer besides the scatter, sqrt 2
times either, so the bar is 0.64 standard deviations: 2 in ten billion normal errors exceed ten bars, and 5 in 1000
are below a hundredth of one."""


class Roundings:
    """Changes of numbers in their last digit, up or down, EVALUATIONS times at once."""

    def __init__(self, u1: Any) -> None:
        of_reals, of_parts = take_signs()
        self.of_reals, self.of_parts = cycle(of_reals), cycle(of_parts)
        turned = (np.real(u1) != 0.0) & (np.imag(u1) != 0.0)
        self.turned = turned[..., None] if np.ndim(turned) else turned

    def __call__(self, number: Any, *, turned: bool = False) -> Any:
        """Real numbers: the next double up or down, (EVALUATIONS, ...); each part of a complex one by itself.

        `turned`: whether a direction, known to its last digit, mixes the parts, and each carries the larger's, as all
        do with a ground at an angle.
        """
        if type(number) is float and number == 0.0:  # exact, and quicker alone than as many zeros
            return number
        if not isinstance(number, complex) and not (isinstance(number, np.ndarray) and number.dtype.kind == "c"):
            return round_real(number, next(self.of_reals))
        size = parts = np.asarray(number)[..., None].view(float)
        mixed = turned or self.turned
        if is_any(mixed):
            size = select(mixed, np.maximum(np.abs(parts[..., :1]), np.abs(parts[..., 1:])), parts)
        return (parts + size * next(self.of_parts)).view(complex)[..., 0]

    def next(self, count: int) -> list[Any]:
        """Return the signs of the next real numbers."""
        return [next(self.of_reals) for _ in range(count)]


@cache
def take_signs() -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    """Return signs for real numbers, each (EVALUATIONS, 1), and for both parts of complex ones, (EVALUATIONS, 1, 2)."""
    of_reals, of_parts = np.split(draw_signs().T, 2)
    pairs = of_parts.reshape(-1, 2, EVALUATIONS).transpose(0, 2, 1)
    return list(of_reals[:, :, None]), list(np.ascontiguousarray(pairs)[:, :, None])


def compute_error_bars(
    case: Case, state: State, acceleration: Any, sign: Any, found: Dynamics, exact: NDArray[np.intp]
) -> dict[str, Any]:
    """Compute that of the drive (N m or N) and `force_error` (N, worst of the four pin forces), by name, each (n,).

    Parameters
    ----------
    state, acceleration, sign, found : the evaluation that the error bars are for; the sign is that of the path's root.
    exact : indices of the positions whose half angle is known in many digits.
    """
    rounded, path = Roundings(state.at.u1), case.path
    q, speed = state.theta_2 if state.q is None else state.q, state.speed
    known = exact.size > 0 and np.isin(np.arange(np.size(state.at.half.ss)), exact)
    signs = rounded.next(6)
    turned = select(known, 0.0, split_sum(q, -path.theta_1)[1]) * np.sign(signs[0])
    if case.stroke is not None:
        moved, faster, harder = change_command(case, q, speed, acceleration, rounded)
        q, turned, speed, acceleration = q + moved, turned + moved, speed + faster, acceleration + harder
    half = round_half_angle(path.lengths, state.at.half, turned, known, signs)
    near, k = path.motion(path.position(q, half, sign), sign)
    near = near._replace(sin_mu=rounded(near.sin_mu), diagonal=rounded(near.diagonal))
    near = near._replace(u2=rounded(near.u2), u3=rounded(near.u3), u4=rounded(near.u4))
    k = read_from(path.bar, round_coefficients(path.lengths, near, read_from(path.bar, k), rounded.next(13)))
    nearby = state._replace(theta_2=q, at=near, k=k, speed=speed, moving=rates(k, speed, acceleration))
    if path.bar != 2:  # there both are found from the directions
        to_O4, to_A = rounded(case.lengths.d * near.u1), case.lengths.a * near.u2
        nearby = nearby._replace(at=near._replace(diagonal=rounded(to_O4 - to_A)), theta_2=rounded(angle(near.u2)))
    other = case.dynamics(nearby, acceleration, case.side, rounded)
    values, others = (*found.pins, found.drive), (*other.pins, other.drive)
    spread = compute_root_mean_square(np.array([after - before for before, after in zip(values, others, strict=True)]))
    size = np.array([np.abs(value) for value in values]).reshape(spread.shape)
    force_error, drive_error = compute_bar(
        np.array([spread[:4].max(axis=0), spread[4]]), np.array([size[:4].max(axis=0), size[4]])
    ).reshape(2, *np.shape(found.drive))
    return {case.names.error: drive_error, "force_error": force_error}


def change_command(case: Case, q: Any, speed: Any, acceleration: Any, rounded: Roundings) -> list[Any]:
    """Compute by how much roundings change the angle, speed and acceleration that a commanded stroke gives its bar."""
    exact, near = (find_triangle(case.linkage, case.drive, by) for by in (keep_number, rounded))
    across, along = (exact.length * exact.reach * of(q - exact.angle) for of in (np.sin, np.cos))
    lever = across / case.stroke  # of either sign, as the side
    growth = lever * acceleration + (along - lever * lever) * speed * speed / case.stroke
    given = (case.stroke, lever * speed, growth, "left" if np.nansum(lever) > 0.0 else "right")
    pairs = zip(exact.turned(*given), near.turned(*given, rounded), strict=True)
    return [after - before for before, after in pairs][:3]


def round_real(x: Any, sign: Any) -> Any:
    """Return the next double up or down."""
    return x + x * sign


def round_half_angle(lengths: Loop, half: HalfAngle, turned: Any, known: Any, signs: Any) -> HalfAngle:
    """Compute the five numbers with their own roundings, a change of theta_2 - theta_1, and those of the two sums.

    Parameters
    ----------
    turned : by how much theta_2 - theta_1 is changed, rad.
    known : where the five are known in many digits and carry one rounding each.
    signs : six of them, of which the first is that of the change.
    """
    d, a, b, c, E1, E2 = lengths
    ss, kk, sk, outer, inner = half
    four_ad, four_bc = 4.0 * a * d, 4.0 * b * c
    of_outer, of_inner = abs(E1) + four_ad * kk, abs(E2) + four_ad * ss
    of_outer, of_inner = np.minimum(of_outer, four_bc + of_inner), np.minimum(of_inner, four_bc + of_outer)
    of_outer, of_inner = select(known, outer, of_outer), select(known, inner, of_inner)
    return HalfAngle(
        round_real(ss, signs[1]) + sk * turned,
        round_real(kk, signs[2]) - sk * turned,
        round_real(sk, signs[3]) + (0.5 * (kk - ss)) * turned,
        outer - (four_ad * sk) * turned + of_outer * signs[4],
        inner + (four_ad * sk) * turned + of_inner * signs[5],
    )


def round_coefficients(lengths: Loop, at: Position, k: Coefficients, signs: Any) -> Coefficients:
    """Compute the coefficients from parts rounded each: h3 = n - g, h4 = n + g, n = t + x g/e^2, and so their slopes.

    `at` and `k` are in the order in which the loop is read; of the signs there are thirteen.
    """
    d, a, b, c, _, _ = lengths
    g, dg = 0.5 * k.h43, 0.5 * (k.dh4 - k.dh3)
    n, x = k.h3 + g, ((b - c) * (b + c)) / at.e2
    of_g, w = x * g, x * g - 0.5 * ((d - a) * (d + a)) / at.e2
    of_t = n - of_g
    if is_any(may_turn_fast(lengths)):
        fast = find_fast_turns(lengths, at)
        of_t, of_g, w = select(fast, n, of_t), select(fast, 0.5, of_g), select(fast, n - 0.5, w)
    of_slope, of_side = x * dg, (4.0 * a * d * at.half.sk) * w / at.e2
    g_moved, dg_moved, of_g_moved = g * signs[0], dg * signs[1], of_g * signs[2]
    n_moved = of_t * signs[3] + of_g_moved
    slope_moved = of_slope * signs[4] + of_side * signs[5]
    return Coefficients(
        k.h2,
        round_real(k.h3, signs[6]) + n_moved - g_moved,
        round_real(k.h4, signs[7]) + n_moved + g_moved,
        round_real(k.h23, signs[8]) + (1.0 - of_t) * signs[9] - of_g_moved + g_moved,
        round_real(k.h43, signs[10]) + 2.0 * g_moved,
        k.dh2,
        round_real(k.dh3, signs[11]) + slope_moved - dg_moved,
        round_real(k.dh4, signs[12]) + slope_moved + dg_moved,
    )


def compute_root_mean_square(changes: Any) -> Any:
    """Of the sizes of the changes, (..., EVALUATIONS, n), whose squares may be beyond the range of a double."""
    size = np.abs(changes)
    largest = size.max(axis=-2, keepdims=True)
    size /= np.where(largest == 0.0, 1.0, largest)
    return largest[..., 0, :] * np.sqrt(np.square(size).sum(axis=-2) / EVALUATIONS)


def compute_bar(spread: Any, value: Any) -> Any:
    """Compute the error bar from the root mean square of the changes and the size of the value.

    A change that leaves no value, or none in the range of a double: of the value itself no digit is left.
    """
    size = np.abs(value)
    width = np.maximum(TYPICAL * spread, LAST_ROUNDING * size)
    return select(np.isfinite(width), width, size)


@cache
def draw_signs() -> NDArray[np.float64]:
    """+- one last digit, (EVALUATIONS, NUMBERS): of number 1, 2, ... in each evaluation, by a fixed seed."""
    rng, others = np.random.default_rng(0), range(1, EVALUATIONS)
    up = np.array([[0, *rest] for rest in combinations(others, EVALUATIONS // 2 - 1)])
    changes = np.full((NUMBERS, EVALUATIONS), -LAST_DIGIT)
    np.put_along_axis(changes, up, LAST_DIGIT, axis=1)
    return np.asarray((rng.permutation(changes) * rng.choice([1.0, -1.0], (NUMBERS, 1))).T)
