"""Coulomb friction in the pins: a couple mu r |F| against the rotation.

F is the pin force, which depends on the couple. The couples x >= 0 of sliding friction
fulfil

    x_p = k_p |F_p + sum over q of C_pq x_q|.

With K_pq = k_p |C_pq| the right-hand side is a contraction in a weighted maximum norm
where the spectral radius of K is below 1 (Perron): exactly one solution. For one pin
the squared equation is a quadratic, and decides at any K. For several pins beyond that
radius solutions are searched for from many starts: what is not found there is taken not
to exist.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fourbar.effects.effect import Actions, PinRows, SolvedFriction
from fourbar.errors import InputError
from fourbar.formulas.arithmetic import is_any, make_like
from fourbar.formulas.longer import take_doubles
from fourbar.formulas.pin_forces import PinForces
from fourbar.linkage import AT_LEAST_ZERO, PIN_FORCE, Declared
from fourbar.quantities import JAMMED, OK, SEVERAL, Array

ONE_SOLUTION, NO_SOLUTION, MANY = range(3)
"""Number of solutions of the friction equations."""
ROUNDING_OF_X = 32.0 * 2.0**-52
"""Change of x, relative, that is the rounding of its evaluation."""
CONTRACTION_STEPS = 200
"""Steps of the contraction, each of which halves the error at a spectral radius of 1/2.
Newton's steps end it long before.
"""
SAME_SOLUTION = 1e-6
"""Two solutions found by the search are the same if they differ by less, relative."""
SETTLED_START = 1e-12
"""Relative change by which a start of the search has settled. The last two steps remove
what that leaves.
"""
SEARCH_STARTS = 64
LEAST_SEARCHED = 256
"""Least number of problems among which equal ones are searched once. Many are equal
where many ranges are cut at one dead point.
"""


@dataclass(frozen=True, slots=True)
class PinFriction(PinRows):
    """Pins as (pin, coefficient of friction mu, pin radius r in m).

    The couple is mu r |F| where the pin turns. At a pin that does not turn the couple
    may have any value up to that; 0, the middle, is taken, and `torque_low`,
    `torque_high` of the solution are the torques at which the motion would begin. Where
    no couples fulfil the equations the status is "jammed", where several do it is
    "several".
    """

    pins: tuple[tuple[str, float, float], ...]
    key: ClassVar[str] = "pin_friction"
    example: ClassVar[str] = (
        'pin_friction = { A = { coefficient = 0.1, radius = "8 mm" } }'
    )
    numbers: ClassVar[dict[str, Declared]] = {
        "coefficient": Declared("1", AT_LEAST_ZERO),
        "radius": Declared("m", AT_LEAST_ZERO),
    }
    dry: ClassVar[bool] = True

    def __post_init__(self) -> None:
        PinRows.__post_init__(self)
        if not self.pins:
            raise InputError("effects.pin_friction", {}, "must name at least one pin")

    @property
    def loaded_pins(self) -> tuple[str, ...]:
        """The pins whose forces it depends on."""
        return tuple(pin for pin, mu, r in self.pins if is_any(mu * r != 0.0))

    @property
    def dry_pins(self) -> tuple[str, ...]:
        """The pins at which it acts."""
        return self.loaded_pins

    def per_unit(
        self,
        actions: Actions,
        eliminate: Callable[..., PinForces],
    ) -> dict[str, PinForces]:
        """Compute the pin forces that a couple of 1 N m at each pin causes.

        The couple is against the pin's rotation.
        """
        forces = {}
        for pin in self.loaded_pins:
            single = Actions(actions.state, actions.bodies)
            single.pin_couple(pin, -actions.sense(pin))
            forces[pin] = eliminate(single, with_inertia=False)
        return forces

    def solve_friction(
        self,
        actions: Actions,
        pins: PinForces,
        eliminate: Callable[..., PinForces],
    ) -> SolvedFriction:
        """Add the couples that fulfil x_p = mu_p r_p |F_p(x)|.

        The pin forces are F_p = F0_p + sum over q of C_pq x_q.
        """
        names, arms = self.loaded_pins, {pin: mu * r for pin, mu, r in self.pins}
        senses, per_unit = (
            {pin: actions.sense(pin) for pin in names},
            self.per_unit(actions, eliminate),
        )
        shape = np.shape(pins.F12)

        def column(force: Any) -> Any:
            """Return the components of a force over all positions, (n, 2)."""
            flat = np.broadcast_to(take_doubles(force), shape).ravel()
            return np.stack([flat.real, flat.imag], axis=-1)

        k = np.stack(
            [np.broadcast_to(take_doubles(arms[pin]), shape).ravel() for pin in names],
            axis=1,
        )
        F = np.stack([column(getattr(pins, PIN_FORCE[pin])) for pin in names], axis=1)
        C = np.stack(
            [
                np.stack(
                    [column(getattr(per_unit[q], PIN_FORCE[pin])) for q in names],
                    axis=1,
                )
                for pin in names
            ],
            axis=1,
        )
        sliding = solve_sliding(F, C, k)
        couples = {
            pin: make_like(sliding.x[:, p].reshape(shape), pins.F12.real)
            for p, pin in enumerate(names)
        }
        couples = self._refine(couples, pins, per_unit)
        for pin, couple in couples.items():
            actions.pin_couple(pin, -senses[pin] * couple)
        loaded = eliminate(actions)
        residuals = [
            np.abs(
                take_doubles(
                    couple - arms[pin] * np.abs(getattr(loaded, PIN_FORCE[pin]))
                )
            )
            for pin, couple in couples.items()
        ]
        status = np.where(
            sliding.number == ONE_SOLUTION,
            OK,
            np.where(sliding.number == NO_SOLUTION, JAMMED, SEVERAL),
        ).astype(np.uint8)
        return SolvedFriction(
            loaded,
            sliding.from_jamming.reshape(shape),
            np.max(residuals, axis=0),
            status.reshape(shape),
        )

    def _refine(
        self,
        couples: dict[str, Any],
        pins: PinForces,
        per_unit: dict[str, PinForces],
    ) -> dict[str, Any]:
        """Take Newton's steps from couples in doubles.

        The numbers are of the kind that the forces are.

        (1 - J) dx = mu r |F + C x| - x, J the slope of the right-hand side by x: of
        numbers that carry their derivatives the same steps are the theorem of the
        implicit function.
        """
        names = list(couples)
        arms = {pin: mu * r for pin, mu, r in self.pins}
        for _ in range(2):
            gaps = []
            slopes = []
            for pin in names:
                by = [getattr(per_unit[q], PIN_FORCE[pin]) for q in names]
                force = getattr(pins, PIN_FORCE[pin])
                for c, couple in zip(by, couples.values(), strict=True):
                    force = force + c * couple
                gaps.append(arms[pin] * np.abs(force) - couples[pin])
                along = take_doubles(force) / np.abs(take_doubles(force))
                pulls = [
                    take_doubles(arms[pin]) * (along.conjugate() * take_doubles(c)).real
                    for c in by
                ]
                slopes.append(np.broadcast_arrays(*pulls, along.real)[:-1])
            slope = np.moveaxis(np.array(slopes), (0, 1), (-2, -1))
            matrix = np.eye(len(names), dtype=slope.dtype) - slope
            usable = np.asarray(np.isfinite(matrix).all(axis=(-2, -1)))
            usable[usable] = np.linalg.det(matrix[usable]) != 0.0
            inverse = np.zeros_like(matrix)
            inverse[usable] = np.linalg.inv(matrix[usable])
            for row, pin in enumerate(names):
                for column, gap in enumerate(gaps):
                    couples[pin] = couples[pin] + inverse[..., row, column] * gap
        return couples

    def act_known(self, actions: Actions, forces: Mapping[str, Array]) -> None:
        """Add the friction couples for pin forces that are known (name: (n, 2), N)."""
        for pin, mu, r in self.pins:
            load = np.hypot(*np.asarray(forces[PIN_FORCE[pin]]).T)
            actions.pin_couple(pin, -actions.sense(pin) * (mu * r * load))


class _Sliding(NamedTuple):
    """Solutions of n independent problems."""

    x: Array
    """(n, p), N m; the only or the least solution, NaN where there is none."""
    number: NDArray[np.uint8]
    """(n,), ONE_SOLUTION, NO_SOLUTION or MANY."""
    from_jamming: Array
    """(n,), in (0, 1]: the least stretch of the equations' slope, 0 where they jam."""


def solve_sliding(F: Array, C: Array, k: Array) -> _Sliding:
    """Solve n problems in p unknowns.

    F (n, p, 2) is in N, C (n, p, p, 2) in 1/m, k (n, p) in m.
    """
    n, p = F.shape[:2]
    finite = np.isfinite(F).all(axis=(1, 2)) & np.isfinite(C).all(axis=(1, 2, 3))
    x = np.full((n, p), np.nan)
    count = np.full(n, ONE_SOLUTION, dtype=np.uint8)
    if p == 1:
        with np.errstate(invalid="ignore", divide="ignore"):
            x[:, 0], counted = _solve_quadratic(F[:, 0], C[:, 0, 0], k[:, 0])
        count[finite] = counted[finite]
    else:
        K = k[:, :, None] * np.hypot(C[..., 0], C[..., 1])
        radius = np.full(n, np.nan)
        radius[finite] = np.abs(np.linalg.eigvals(K[finite])).max(axis=1)
        sure = np.flatnonzero(finite & (radius < 1.0))
        x[sure] = _iterate(F[sure], C[sure], k[sure], np.zeros((len(sure), p)))
        unsure = np.flatnonzero(finite & ~(radius < 1.0))
        for start in range(0, len(unsure), LEAST_SEARCHED):
            some = unsure[start : start + LEAST_SEARCHED]
            numbers = np.concatenate(
                [
                    array[some].reshape(len(some), math.prod(array.shape[1:]))
                    for array in (F, C, k)
                ],
                axis=1,
            )
            _, first, same = np.unique(
                numbers,
                axis=0,
                return_index=True,
                return_inverse=True,
            )
            first = some[first]
            x[some], count[some] = (
                array[same.ravel()] for array in _search(F[first], C[first], k[first])
            )
    with np.errstate(invalid="ignore"):
        for _ in range(2):  # removes the rounding of the search and of the quadratic
            right, slope = _compute_right_side(F, C, k, x)
            x = x + _compute_step(right - x, slope)
        _, slope = _compute_right_side(F, C, k, x)
    matrix = np.eye(p) - slope
    far = np.ones(n)
    usable = np.isfinite(matrix).all(axis=(1, 2))
    far[usable] = np.minimum(
        np.linalg.svd(matrix[usable], compute_uv=False)[:, -1], 1.0
    )
    return _Sliding(x, count, far)


def _solve_quadratic(F: Array, C: Array, k: Array) -> tuple[Array, NDArray[np.uint8]]:
    """Solve (k^2 |C|^2 - 1) x^2 + 2 k^2 F.C x + k^2 |F|^2 = 0."""
    c2 = k * np.hypot(C[:, 0], C[:, 1])
    a = (c2 - 1.0) * (c2 + 1.0)
    b = k * k * (F[:, 0] * C[:, 0] + F[:, 1] * C[:, 1])
    c = (k * k) * (F[:, 0] * F[:, 0] + F[:, 1] * F[:, 1])
    # b^2 - a c written as k^2 |F|^2 - k^4 (F x C)^2, which cancels only near jamming
    turned = k * k * (F[:, 0] * C[:, 1] - F[:, 1] * C[:, 0])
    under = c - turned * turned
    root = np.sqrt(under)
    q = -(b + np.where(b < 0.0, -root, root))
    first = np.where(a == 0.0, np.inf, q / a)
    second = np.where(q == 0.0, 0.0, c / q)
    low = np.fmin(first, second)
    high = np.fmax(first, second)
    x = np.where(a < 0.0, high, low)
    count = np.full(len(x), ONE_SOLUTION, dtype=np.uint8)
    count[~(a < 0.0) & ((under < 0.0) | (b >= 0.0)) & (c > 0.0)] = NO_SOLUTION
    count[(a > 0.0) & (under > 0.0) & (b < 0.0)] = MANY
    x = np.where(c == 0.0, 0.0, x)
    x[count == NO_SOLUTION] = np.nan
    return x, count


def _compute_right_side(F: Array, C: Array, k: Array, x: Array) -> tuple[Array, Array]:
    """Compute k |F + C x| and its derivative, (n, p) and (n, p, p)."""
    force = F + np.einsum("npqi,nq->npi", C, x)
    size = np.hypot(force[..., 0], force[..., 1])
    unit = force / np.where(size == 0.0, 1.0, size)[..., None]
    return k * size, k[..., None] * np.einsum("npi,npqi->npq", unit, C)


def _compute_step(gap: Array, slope: Array) -> Array:
    """Solve (1 - slope) step = gap, zero where that cannot be solved, (n, p)."""
    matrix = np.eye(gap.shape[1]) - slope
    usable = np.asarray(
        np.isfinite(matrix).all(axis=(1, 2)) & np.isfinite(gap).all(axis=1)
    )
    usable[usable] = np.linalg.det(matrix[usable]) != 0.0
    step = np.zeros_like(gap)
    step[usable] = np.linalg.solve(matrix[usable], gap[usable][..., None])[..., 0]
    return step


def _iterate(F: Array, C: Array, k: Array, x: Array) -> Array:
    """Take Newton's step if it lessens the gap, otherwise that of the contraction."""
    done = np.zeros(len(x), dtype=bool)
    for _ in range(CONTRACTION_STEPS):
        right, slope = _compute_right_side(F, C, k, x)
        newton = np.maximum(x + _compute_step(right - x, slope), 0.0)
        plain_gap = np.abs(_compute_right_side(F, C, k, right)[0] - right).max(axis=1)
        newton_gap = np.abs(_compute_right_side(F, C, k, newton)[0] - newton).max(
            axis=1
        )
        new = np.where((newton_gap < plain_gap)[:, None], newton, right)
        new = np.where(
            done[:, None], x, new
        )  # solved problems keep their digits while others go on
        done |= np.abs(new - x).max(axis=1, initial=0.0) <= ROUNDING_OF_X * new.max(
            axis=1,
            initial=0.0,
        )
        x = new
        if done.all():
            break
    return x


def _search(F: Array, C: Array, k: Array) -> tuple[Array, NDArray[np.int_]]:
    """Find the least solution of each problem, and how many there are.

    The starts cover many magnitudes.
    """
    n, p = k.shape
    size = np.max(k * np.hypot(F[..., 0], F[..., 1]), axis=1)
    directions = np.vstack(
        [
            np.ones(p),
            np.eye(p) + 0.01,
            np.random.default_rng(0).uniform(0.0, 1.0, (SEARCH_STARTS // p, p)),
        ]
    )
    starts = np.vstack(
        [
            np.zeros((1, p)),
            (np.logspace(-2, 3, 11)[:, None, None] * directions).reshape(-1, p),
        ]
    )
    x = (size[:, None, None] * starts).reshape(-1, p)
    problem = np.repeat(np.arange(n), len(starts))
    moving = np.arange(len(x))
    before = np.full_like(x, np.inf)
    for _ in range(60):
        members = problem[moving]
        last = x[moving]
        right, slope = _compute_right_side(F[members], C[members], k[members], last)
        new = np.clip(
            last + _compute_step(right - last, slope), 0.0, 1e12 * size[members, None]
        )
        least_change = np.minimum(
            np.abs(new - last).max(axis=1), np.abs(new - before[moving]).max(axis=1)
        )
        x[moving], before[moving] = new, last
        moving = moving[
            least_change > SETTLED_START * new.max(axis=1)
        ]  # the others stand still or alternate
    right, _ = _compute_right_side(F[problem], C[problem], k[problem], x)
    solves = np.abs(right - x).max(axis=1) <= 1e-9 * np.maximum(
        x.max(axis=1), size[problem]
    )
    x = x.reshape(n, -1, p)
    solves = solves.reshape(n, -1)
    least = x[np.arange(n), np.argmin(np.where(solves, x.sum(axis=2), np.inf), axis=1)]
    apart = np.abs(x - least[:, None]).max(axis=2) > SAME_SOLUTION * np.maximum(
        x.max(axis=2), least.max(axis=1)[:, None]
    )
    count = np.where(
        (solves & apart).any(axis=1),
        MANY,
        np.where(solves.any(axis=1), ONE_SOLUTION, NO_SOLUTION),
    )
    return np.where(count[:, None] == NO_SOLUTION, np.nan, least), count
