"""Coulomb friction in the pins: a couple mu r |F| against the rotation.

F is the pin force, which depends on the couple. The couples x >= 0 of sliding friction
fulfil

    x_p = k_p |F_p + sum over q of C_pq x_q|.

With K_pq = k_p |C_pq| the right-hand side is a contraction in a weighted maximum norm
where the spectral radius of K is below 1 (Perron): exactly one solution. Beyond that
radius solutions are searched for from many starts: what is not found there is taken not
to exist. For one pin the right-hand side is convex, and Newton's steps find the least
solution from 0 and the other one from far away.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from fourbar.effects.effect import Actions, PinRows, SolvedFriction
from fourbar.formulas.arithmetic import is_any, make_like
from fourbar.formulas.longer import take_doubles
from fourbar.formulas.pin_forces import PinForces
from fourbar.linkage import AT_LEAST_ZERO, PIN_FORCE, Declared, record
from fourbar.quantities import JAMMED, OK, SEVERAL, Array, Codes, Mask

NEWTON_STEPS = 60
"""Steps after which an iteration that goes on does not converge; most take five."""
SETTLED = 32.0 * 2.0**-52
"""Change of x, relative, that is the rounding of its evaluation."""
SOLVED = 1e-12
"""Gap of a solution, relative. Where solutions meet it is the square of SAME_SOLUTION:
a larger one would find two where there is none.
"""
SAME_SOLUTION = 1e-6
"""Two solutions found by the search are the same if they differ by less, relative."""
FARTHEST = 1e12
"""Largest couple that is looked at, over the size of the couples without friction."""
MAGNITUDES = np.logspace(-2.0, 3.0, 6)
"""Sizes of the starts of a search, over the size of the couples without friction."""
RANDOM_DIRECTIONS = 24
"""Directions of starts besides the axes and their middle. With 386 starts in all in
place of 168 a search of 1100 random problems found no solution more.
"""
STARTS_AT_ONCE = 10_000
"""Starts that are followed at a time: each problem has all its own in memory."""


@record
class PinFriction(PinRows):
    """Pins as (pin, coefficient of friction mu, pin radius r in m).

    The couple is mu r |F| where the pin turns. At a pin that does not turn the couple
    may have any value up to that; 0, the middle, is taken, and `torque_low`,
    `torque_high` of the solution are the torques at which the motion would begin. Where
    no couples fulfil the equations the status is "jammed", where several do it is
    "several".
    """

    pins: tuple[tuple[str, float, float], ...]
    key = "pin_friction"
    example = 'pin_friction = { A = { coefficient = 0.1, radius = "8 mm" } }'
    numbers: ClassVar[dict[str, Declared]] = {
        "coefficient": Declared("1", AT_LEAST_ZERO),
        "radius": Declared("m", AT_LEAST_ZERO),
    }
    dry = True

    @property
    def loaded_pins(self) -> tuple[str, ...]:
        """Pins with friction, on whose forces the couples depend."""
        return tuple(pin for pin, mu, r in self.pins if is_any(mu * r != 0.0))

    @property
    def dry_pins(self) -> tuple[str, ...]:
        """Pins with friction."""
        return self.loaded_pins

    def solve_friction(
        self,
        actions: Actions,
        pins: PinForces,
        solve_pin_forces: Callable[..., PinForces],
    ) -> SolvedFriction:
        """Add the couples that fulfil x_p = mu_p r_p |F_p(x)|.

        The pin forces are F_p = F0_p + sum over q of C_pq x_q. From couples in doubles
        two of Newton's steps follow in numbers of the forces' kind,

            (1 - J) dx = mu r |F + C x| - x,

        J the slope of the right-hand side by x: of numbers that carry their derivatives
        the same steps are the theorem of the implicit function.
        """
        arms = {pin: mu * r for pin, mu, r in self.pins if pin in self.loaded_pins}
        senses = {pin: actions.sense(pin) for pin in arms}
        per_unit = []  # under a couple of 1 N m at a pin, against its rotation
        for pin, sense in senses.items():
            single = Actions(actions.state, actions.bodies)
            single.pin_couple(pin, -sense)
            per_unit.append(solve_pin_forces(single, with_inertia=False))
        shape = np.shape(pins.F12)
        forces = _list_forces(pins, arms)
        per_couple = [_list_forces(unit, arms) for unit in per_unit]

        C = np.stack([_stack(row, shape) for row in per_couple], axis=2)
        sliding = solve_sliding(_stack(forces, shape), C, _stack(arms.values(), shape))
        like = pins.F12.real
        couples = [make_like(column.reshape(shape), like) for column in sliding.x.T]
        slope = sliding.slope.reshape(*shape, len(arms), len(arms))
        # in numbers of the forces' kind
        inverse = _invert(slope)
        for _ in range(2):
            gaps = []
            for row, arm in enumerate(arms.values()):
                force = forces[row]
                for of_one, couple in zip(per_couple, couples, strict=True):
                    force = force + of_one[row] * couple
                gaps.append(arm * np.abs(force) - couples[row])
            for row in range(len(arms)):
                for column, gap in enumerate(gaps):
                    couples[row] = couples[row] + inverse[..., row, column] * gap

        for pin, couple in zip(arms, couples, strict=True):
            actions.pin_couple(pin, -senses[pin] * couple)
        loaded = solve_pin_forces(actions)
        residuals = []
        loads = _list_forces(loaded, arms)
        for arm, couple, load in zip(arms.values(), couples, loads, strict=True):
            residuals.append(np.abs(take_doubles(couple - arm * np.abs(load))))
        return SolvedFriction(
            loaded,
            find_least_stretch(sliding.slope).reshape(shape),
            np.max(residuals, axis=0),
            sliding.status.reshape(shape),
        )

    def act_known(self, actions: Actions, forces: Mapping[str, Array]) -> None:
        """Add the friction couples for pin forces that are known (name: (n, 2), N)."""
        for pin, mu, r in self.pins:
            force = np.asarray(forces[PIN_FORCE[pin]])
            load = np.hypot(force[:, 0], force[:, 1])
            couple = mu * r * load
            actions.pin_couple(pin, -actions.sense(pin) * couple)


def _list_forces(forces: PinForces, pins: Iterable[str]) -> list[Any]:
    """List the forces at some pins, complex, N."""
    return [getattr(forces, PIN_FORCE[pin]) for pin in pins]


def _stack(numbers: Iterable[Any], shape: tuple[int, ...]) -> Array:
    """Return the doubles of p numbers over all positions, (n, p)."""
    columns = []
    for number in numbers:
        columns.append(np.broadcast_to(take_doubles(number), shape).ravel())
    return np.stack(columns, axis=1)


def _invert(slope: Array) -> Array:
    """Return the inverse of 1 - slope, zero where there is none, (..., p, p)."""
    matrix = np.eye(slope.shape[-1]) - slope
    regular = np.asarray(np.isfinite(matrix).all(axis=(-2, -1)))
    regular[regular] = np.linalg.det(matrix[regular]) != 0.0
    inverse = np.zeros_like(matrix)
    inverse[regular] = np.linalg.inv(matrix[regular])
    return inverse


class _Problems(NamedTuple):
    """Independent problems in p unknowns x_p = k_p |F_p + sum over q of C_pq x_q|."""

    F: Array
    """(n, p), complex, N."""
    C: Array
    """(n, p, p), complex, 1/m."""
    k: Array
    """(n, p), m."""

    def part(self, index: Any) -> Self:
        """Return some of the problems."""
        return type(self)(*(array[index] for array in self))

    def right_side(self, x: Array) -> tuple[Array, Array]:
        """Compute k |F + C x| and its derivative, (n, p) and (n, p, p)."""
        force = self.F + np.einsum("...pq,...q->...p", self.C, x)
        size = np.abs(force)
        direction = force / np.where(size == 0.0, 1.0, size)
        slope = (direction.conj()[..., None] * self.C).real
        return self.k * size, self.k[..., None] * slope

    def size(self) -> Array:
        """Return the largest couple k |F| of each, N m, (n,)."""
        return np.asarray(np.max(self.k * np.abs(self.F), axis=-1))

    def are_solved(self, x: Array) -> Mask:
        """Mark the problems whose equations couples fulfil, (n,)."""
        right, _ = self.right_side(x)
        largest = np.maximum(x.max(axis=-1), self.size())
        gap = np.abs(right - x).max(axis=-1)
        return np.asarray(gap <= SOLVED * largest)

    def follow_newton(self, x: Array) -> Array:
        """Take Newton's steps from starts, (n, p), each until it stands still."""
        most = FARTHEST * self.size()[:, None]
        moving = np.arange(len(x))
        for _ in range(NEWTON_STEPS):
            last = x[moving]
            right, slope = self.part(moving).right_side(last)
            step = _invert(slope) @ (right - last)[..., None]
            new = np.clip(last + step[..., 0], 0.0, most[moving])
            x[moving] = new
            change = np.abs(new - last).max(axis=1)
            moving = moving[change > SETTLED * new.max(axis=1)]
            if not moving.size:
                break
        return x


class _Sliding(NamedTuple):
    """Solutions of n independent problems."""

    x: Array
    """(n, p), N m; the only or the least solution, NaN where there is none."""
    status: Codes
    """(n,), OK if there is one solution, JAMMED if none, SEVERAL if more."""
    slope: Array
    """(n, p, p), slope of k |F + C x| at the solution."""


def solve_sliding(F: Array, C: Array, k: Array) -> _Sliding:
    """Solve n problems in p unknowns x_p = k_p |F_p + sum over q of C_pq x_q|.

    F (n, p), complex, is in N, C (n, p, p), complex, in 1/m, k (n, p) in m.
    """
    problems = _Problems(F, C, k)
    p = k.shape[1]
    x = np.full(k.shape, np.nan)
    status = np.full(len(k), OK, dtype=np.uint8)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        K = k[:, :, None] * np.abs(C)
        finite = np.isfinite(F).all(axis=1) & np.isfinite(K).all(axis=(1, 2))
        rows = np.flatnonzero(finite)
        radius = np.abs(np.linalg.eigvals(K[rows])).max(axis=1)
        contract = rows[radius < 1.0]
        x[contract], status[contract] = _search(
            problems.part(contract), np.zeros((1, p))
        )
        searched = np.setdiff1d(rows, contract[status[contract] == OK])
        starts = _list_starts(p)
        for block in np.array_split(
            searched, 1 + searched.size * len(starts) // STARTS_AT_ONCE
        ):
            x[block], status[block] = _search(problems.part(block), starts)
        _, slope = problems.right_side(x)
    return _Sliding(x, status, slope)


def find_least_stretch(slope: Array) -> Array:
    """Return the distance from jamming, (n,): the least singular value of 1 - slope.

    At most 1, and 0 where the equations jam.
    """
    matrix = np.eye(slope.shape[1]) - slope
    finite = np.isfinite(matrix).all(axis=(1, 2))
    least = np.ones(len(slope))
    singular_values = np.linalg.svd(matrix[finite], compute_uv=False)
    least[finite] = np.minimum(singular_values[:, -1], 1.0)
    return least


def _search(problems: _Problems, starts: Array) -> tuple[Array, Codes]:
    """Find the least solution of each problem, and the status by how many there are.

    `starts`: (s, p), over the size of the couples.
    """
    n, p = problems.k.shape
    s = len(starts)
    at_starts = problems.part(np.repeat(np.arange(n), s))
    scaled = problems.size()[:, None, None] * starts
    ends = at_starts.follow_newton(scaled.reshape(n * s, p))
    solves = at_starts.are_solved(ends).reshape(n, s)
    x = ends.reshape(n, s, p)
    sums = np.where(solves, x.sum(axis=2), np.inf)
    # some starts have not settled where solutions meet
    least = problems.follow_newton(x[np.arange(n), np.argmin(sums, axis=1)])

    distance = np.abs(x - least[:, None]).max(axis=2)
    larger = np.maximum(x.max(axis=2), least.max(axis=1)[:, None])
    others = solves & (distance > SAME_SOLUTION * larger)
    status = np.full(n, JAMMED, dtype=np.uint8)
    status[solves.any(axis=1)] = OK
    status[others.any(axis=1)] = SEVERAL
    least[status == JAMMED] = np.nan
    return least, status


def _list_starts(p: int) -> Array:
    """List the starts of a search in p unknowns, over the size of the couples."""
    if p == 1:
        return np.array([[0.0], [FARTHEST]])
    generator = np.random.default_rng(0)
    random = generator.uniform(0.0, 1.0, (RANDOM_DIRECTIONS, p))
    directions = np.vstack([np.ones(p), np.eye(p) + 0.01, random])
    scaled = MAGNITUDES[:, None, None] * directions
    return np.vstack([np.zeros(p), scaled.reshape(-1, p)])
