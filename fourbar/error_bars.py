"""Error bars of torque and pin forces: how far rounding makes them scatter.

The forces are evaluated again with every number of the position, coefficient, arm and term changed in its last
digit. All roundings then fall differently, so the root mean square of the changes is of the size of the error
itself, whatever the formulas lose at this position. As many changes go up as down, in an order drawn at random
for each number, so that those of different numbers do not cancel over the evaluations, which run as one batch.
"""

from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from functools import cache
from itertools import cycle
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fourbar.formulas.motion import Coefficients, State, rates, side_turns_fast
from fourbar.formulas.path import Path, read_backwards
from fourbar.formulas.pin_forces import Body
from fourbar.formulas.position import HalfAngle, Loop, Position, two_sum
from fourbar.scene.case import Case, Dynamics

EVALUATIONS = 16
"""With fewer, all of them may by chance come out as far off as the answer itself."""
NUMBERS = 256
"""Whose signs are independent; a scene has about sixty, and a few for each load and effect."""
LAST_DIGIT = 1.01 * 2.0**-53
"""Relative: x + x LAST_DIGIT is the next double, whatever x."""
LAST_ROUNDING = 2.0**-56
"""An error of rounding to nearest, whose largest is 2^-53, is above this in 7 cases of 8."""
TYPICAL = 0.4
"""The error bar as a share of the root mean square. That holds the error of the answer besides the scatter, sqrt 2
times either, so the bar is 0.57 standard deviations: 2 in 100 million normal errors exceed ten bars, and 5 in 1000
are below a hundredth of one."""


class Roundings:
    """Changes of numbers in their last digit, up or down, EVALUATIONS times at once."""

    def __init__(self, u1: Any) -> None:
        self.signs = _signs()
        self.turned = (np.real(u1) != 0.0) & (np.imag(u1) != 0.0)

    def __call__(self, number: Any) -> Any:
        """Real numbers: the next double up or down, (EVALUATIONS, ...); each part of a complex one by itself.

        A ground at an angle mixes the parts of every direction, and each carries the rounding of the larger one.
        """
        if np.iscomplexobj(number):
            x, y = number.real, number.imag
            size = np.maximum(np.abs(x), np.abs(y))
            of_x, of_y = np.where(self.turned, size, x), np.where(self.turned, size, y)
            return number + (of_x * next(self.signs) + 1j * (of_y * next(self.signs)))
        return number + number * next(self.signs)

    def of(self, value: Any) -> Any:
        """The numbers of an effect likewise: its floats, in tuples and parts too; all else stays."""
        if isinstance(value, (float, np.ndarray)):
            return self(value)
        if isinstance(value, tuple):
            parts = [self.of(part) for part in value]
            return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
        if not is_dataclass(value) or getattr(value, "as_given", False):
            return value
        other = object.__new__(type(value))  # a constructor checks what a user gives, one number at a time
        for field in fields(value):
            object.__setattr__(other, field.name, self.of(getattr(value, field.name)))
        return other


def error_bars(
    case: Case, state: State, acceleration: Any, sign: Any, found: Dynamics, exact: NDArray[np.intp]
) -> dict[str, Any]:
    """`torque_error` (N m) and `force_error` (N, worst of the four pin forces), each (n,).

    Parameters
    ----------
    state, acceleration, sign, found : the evaluation that the error bars are for; the sign is that of the path's root.
    exact : indices of the positions whose half angle is known in many digits.
    """
    rounded = Roundings(state.at.u1)

    def rounded_body(body: Body) -> Body:
        return Body(body.m, rounded(body.I), rounded(body.z))

    path = case.path
    q = state.theta_2 if path.bar == 2 else np.angle(state.at.u4)
    half = _rounded_half_angle(path, q, state.at.half, exact, rounded)
    path = path._replace(lengths=Loop(*path.lengths[:4], *map(rounded, path.lengths[4:])))
    near, k = path.motion(path.position(q, half, sign), sign)
    moved = case._replace(
        path=path,
        bodies=(rounded_body(case.bodies[0]), rounded_body(case.bodies[1]), rounded_body(case.bodies[2])),
        terms=tuple(rounded.of(term) for term in case.terms),
    )
    near = near._replace(sin_mu=rounded(near.sin_mu), diagonal=rounded(near.diagonal))
    near = near._replace(u2=rounded(near.u2), u3=rounded(near.u3), u4=rounded(near.u4))
    k = _rounded_coefficients(path, near, k, rounded)
    moving = rates(k, state.speed, acceleration)
    stated = ("omega_2", "alpha_2") if path.bar == 2 else ()
    moving = moving._replace(**{name: rounded(rate) for name, rate in moving._asdict().items() if name not in stated})
    nearby = state._replace(at=near, k=k, moving=moving)
    other = moved.dynamics(nearby, acceleration, rounded=rounded)
    torque = np.mean((other.torque - found.torque) ** 2, axis=0)
    forces = [
        np.mean(np.abs(after - before) ** 2, axis=0) for before, after in zip(found.pins, other.pins, strict=True)
    ]
    largest = np.max([np.abs(force) for force in found.pins], axis=0)
    torque_error = TYPICAL * np.sqrt(torque) + LAST_ROUNDING * np.abs(found.torque)
    force_error = TYPICAL * np.sqrt(np.max(forces, axis=0)) + LAST_ROUNDING * largest
    # a change that leaves no value, or none in the range of a double: of the value itself no digit is left
    shape = np.shape(found.torque)
    return {
        "torque_error": np.where(np.isfinite(torque_error), torque_error, np.abs(found.torque)).reshape(shape),
        "force_error": np.where(np.isfinite(force_error), force_error, largest).reshape(shape),
    }


def _rounded_half_angle(path: Path, q: Any, half: HalfAngle, exact: NDArray[np.intp], rounded: Roundings) -> HalfAngle:
    """The five numbers with their own roundings, that of q - theta_1, and those of the two sums.

    Those known in many digits carry one rounding each.
    """
    d, a, b, c, E1, E2 = path.lengths
    ss, kk, sk, outer, inner = half
    four_ad = 4.0 * a * d
    of_outer, of_inner = np.abs(E1) + four_ad * kk, np.abs(E2) + four_ad * ss
    of_outer, of_inner = np.minimum(of_outer, 4.0 * b * c + of_inner), np.minimum(of_inner, 4.0 * b * c + of_outer)
    lost = np.where(np.isin(np.arange(np.size(ss)), exact), 0.0, two_sum(q, -path.theta_1)[1])
    turned = lost * np.sign(next(rounded.signs))
    if exact.size:
        known = np.isin(np.arange(np.size(ss)), exact)
        of_outer, of_inner = np.where(known, outer, of_outer), np.where(known, inner, of_inner)
    return HalfAngle(
        rounded(ss) + sk * turned,
        rounded(kk) - sk * turned,
        rounded(sk) + (0.5 * (kk - ss)) * turned,
        outer - (four_ad * sk) * turned + of_outer * next(rounded.signs),
        inner + (four_ad * sk) * turned + of_inner * next(rounded.signs),
    )


def _rounded_coefficients(path: Path, at: Position, k: Coefficients, rounded: Roundings) -> Coefficients:
    """The coefficients from parts rounded each: h3 = m - g, h4 = m + g with m = t + q g, and so their slopes."""
    k = k if path.bar == 2 else read_backwards(k)
    d, a, b, c, _, _ = path.lengths
    g, dg = 0.5 * k.h43, 0.5 * (k.dh4 - k.dh3)
    m, x = k.h3 + g, ((b - c) * (b + c)) / at.e2
    fast = side_turns_fast(path.lengths, at)
    of_t, of_qg = np.where(fast, m, m - x * g), np.where(fast, 0.5, x * g)
    of_rest = np.where(fast, 1.0 - m, 1.0 - of_t)
    w = np.where(fast, m - 0.5, x * g - 0.5 * ((d - a) * (d + a)) / at.e2)
    of_slope, of_side = x * dg, (4.0 * a * d * at.half.sk) * w / at.e2
    g_moved, dg_moved, qg_moved = g * next(rounded.signs), dg * next(rounded.signs), of_qg * next(rounded.signs)
    m_moved = of_t * next(rounded.signs) + qg_moved
    slope_moved = of_slope * next(rounded.signs) + of_side * next(rounded.signs)
    k = Coefficients(
        k.h2,
        rounded(k.h3) + m_moved - g_moved,
        rounded(k.h4) + m_moved + g_moved,
        rounded(k.h23) + of_rest * next(rounded.signs) - qg_moved + g_moved,
        rounded(k.h43) + 2.0 * g_moved,
        k.dh2,
        rounded(k.dh3) + slope_moved - dg_moved,
        rounded(k.dh4) + slope_moved + dg_moved,
    )
    return k if path.bar == 2 else read_backwards(k)


def _signs() -> Iterator[NDArray[np.float64]]:
    """+- one last digit for number 1, 2, ... of each evaluation, over and over; each (EVALUATIONS, 1)."""
    return cycle(_columns())


@cache
def _columns() -> tuple[NDArray[np.float64], ...]:
    """As many as a scene of few effects has numbers, from a generator with a fixed seed."""
    rng = np.random.default_rng(0)
    ends = np.repeat([LAST_DIGIT, -LAST_DIGIT], EVALUATIONS // 2)
    return tuple(rng.permutation(ends)[:, None] for _ in range(NUMBERS))
