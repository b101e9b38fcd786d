"""x_p = k_p |F_p + sum over q of C_pq x_q|, x >= 0: sliding friction couples that make the pin forces they depend on.

With K_pq = k_p |C_pq| the right-hand side is a contraction in a weighted maximum norm where the
spectral radius of K is below 1 (Perron): exactly one solution. For one pin the squared equation
is a quadratic, and decides at any K. For several pins beyond that radius solutions are searched
for from many starts: what is not found there is taken not to exist.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ONE, NONE, SEVERAL = range(3)
"""How many solutions there are."""
ROUNDING = 32.0 * 2.0**-52
"""Change of x, relative, that is the rounding of its evaluation."""
STEPS = 200
"""Each halves the error where the spectral radius is 1/2; Newton's steps end it long before."""
SAME = 1e-6
"""Two solutions found by the search are the same if they differ by less, relative."""
SETTLED = 1e-12
"""Relative change by which a start of the search has settled; the last two steps take back what that leaves."""
STARTS = 64
SEARCHED = 256
"""Problems of which those that are the same are searched once, as where many ranges are cut at one dead point."""


class Sliding(NamedTuple):
    """Solutions of n independent problems."""

    x: Array
    """(n, p), N m; the only or the least solution, NaN where there is none."""
    number: NDArray[np.uint8]
    """(n,), ONE, NONE or SEVERAL."""
    from_jamming: Array
    """(n,), in (0, 1]: the least stretch of the equations' slope, 0 where they jam."""


def solve_sliding(F: Array, C: Array, k: Array) -> Sliding:
    """Solve n problems in p unknowns: F (n, p, 2) in N, C (n, p, p, 2) in 1/m, k (n, p) in m."""
    n, p = F.shape[:2]
    known = np.isfinite(F).all(axis=(1, 2)) & np.isfinite(C).all(axis=(1, 2, 3))
    x = np.full((n, p), np.nan)
    count = np.full(n, ONE, dtype=np.uint8)
    if p == 1:
        with np.errstate(invalid="ignore", divide="ignore"):
            x[:, 0], found = _solve_quadratic(F[:, 0], C[:, 0, 0], k[:, 0])
        count[known] = found[known]
    else:
        K = k[:, :, None] * np.hypot(C[..., 0], C[..., 1])
        radius = np.full(n, np.nan)
        radius[known] = np.abs(np.linalg.eigvals(K[known])).max(axis=1)
        sure = np.flatnonzero(known & (radius < 1.0))
        x[sure] = _iterate(F[sure], C[sure], k[sure], np.zeros((len(sure), p)))
        unsure = np.flatnonzero(known & ~(radius < 1.0))
        for start in range(0, len(unsure), SEARCHED):
            some = unsure[start : start + SEARCHED]
            numbers = np.concatenate([of[some].reshape(len(some), math.prod(of.shape[1:])) for of in (F, C, k)], axis=1)
            _, first, same = np.unique(numbers, axis=0, return_index=True, return_inverse=True)
            first = some[first]
            x[some], count[some] = (of[same.ravel()] for of in _search(F[first], C[first], k[first]))
    with np.errstate(invalid="ignore"):
        for _ in range(2):  # takes back the rounding of the search and of the quadratic
            right, slope = _compute_right_side(F, C, k, x)
            x = x + compute_step(right - x, slope)
        _, slope = _compute_right_side(F, C, k, x)
    matrix = np.eye(p) - slope
    far = np.ones(n)
    usable = np.isfinite(matrix).all(axis=(1, 2))
    far[usable] = np.minimum(np.linalg.svd(matrix[usable], compute_uv=False)[:, -1], 1.0)
    return Sliding(x, count, far)


def _solve_quadratic(F: Array, C: Array, k: Array) -> tuple[Array, NDArray[np.uint8]]:
    """(k^2 |C|^2 - 1) x^2 + 2 k^2 F.C x + k^2 |F|^2 = 0."""
    c2 = k * np.hypot(C[:, 0], C[:, 1])
    a = (c2 - 1.0) * (c2 + 1.0)
    b = k * k * (F[:, 0] * C[:, 0] + F[:, 1] * C[:, 1])
    c = (k * k) * (F[:, 0] * F[:, 0] + F[:, 1] * F[:, 1])
    # b^2 - a c as k^2 |F|^2 - k^4 (F x C)^2: nothing cancels where there is no jam
    turned = k * k * (F[:, 0] * C[:, 1] - F[:, 1] * C[:, 0])
    under = c - turned * turned
    root = np.sqrt(under)
    q = -(b + np.where(b < 0.0, -root, root))
    one, other = np.where(a == 0.0, np.inf, q / a), np.where(q == 0.0, 0.0, c / q)
    low, high = np.fmin(one, other), np.fmax(one, other)
    x = np.where(a < 0.0, high, low)
    count = np.full(len(x), ONE, dtype=np.uint8)
    count[~(a < 0.0) & ((under < 0.0) | (b >= 0.0)) & (c > 0.0)] = NONE
    count[(a > 0.0) & (under > 0.0) & (b < 0.0)] = SEVERAL
    x = np.where(c == 0.0, 0.0, x)
    x[count == NONE] = np.nan
    return x, count


def _compute_right_side(F: Array, C: Array, k: Array, x: Array) -> tuple[Array, Array]:
    """Compute k |F + C x| and its derivative, (n, p) and (n, p, p)."""
    force = F + np.einsum("npqi,nq->npi", C, x)
    size = np.hypot(force[..., 0], force[..., 1])
    unit = force / np.where(size == 0.0, 1.0, size)[..., None]
    return k * size, k[..., None] * np.einsum("npi,npqi->npq", unit, C)


def compute_step(gap: Array, slope: Array) -> Array:
    """(1 - slope) step = gap, zero where that cannot be solved, (n, p)."""
    matrix = np.eye(gap.shape[1]) - slope
    usable = np.asarray(np.isfinite(matrix).all(axis=(1, 2)) & np.isfinite(gap).all(axis=1))
    usable[usable] = np.linalg.det(matrix[usable]) != 0.0
    step = np.zeros_like(gap)
    step[usable] = np.linalg.solve(matrix[usable], gap[usable][..., None])[..., 0]
    return step


def _iterate(F: Array, C: Array, k: Array, x: Array) -> Array:
    """Newton's step where it lessens the gap, else the plain one of the contraction."""
    done = np.zeros(len(x), dtype=bool)
    for _ in range(STEPS):
        right, slope = _compute_right_side(F, C, k, x)
        newton = np.maximum(x + compute_step(right - x, slope), 0.0)
        plain_gap = np.abs(_compute_right_side(F, C, k, right)[0] - right).max(axis=1)
        newton_gap = np.abs(_compute_right_side(F, C, k, newton)[0] - newton).max(axis=1)
        new = np.where((newton_gap < plain_gap)[:, None], newton, right)
        new = np.where(done[:, None], x, new)  # what others need changes no digit of this one
        done |= np.abs(new - x).max(axis=1, initial=0.0) <= ROUNDING * new.max(axis=1, initial=0.0)
        x = new
        if done.all():
            break
    return x


def _search(F: Array, C: Array, k: Array) -> tuple[Array, NDArray[np.int_]]:
    """Find the least solution of each problem, and how many there are, from starts over many magnitudes."""
    n, p = k.shape
    size = np.max(k * np.hypot(F[..., 0], F[..., 1]), axis=1)
    directions = np.vstack([np.ones(p), np.eye(p) + 0.01, np.random.default_rng(0).uniform(0.0, 1.0, (STARTS // p, p))])
    starts = np.vstack([np.zeros((1, p)), (np.logspace(-2, 3, 11)[:, None, None] * directions).reshape(-1, p)])
    x = (size[:, None, None] * starts).reshape(-1, p)
    problem, moving, before = np.repeat(np.arange(n), len(starts)), np.arange(len(x)), np.full_like(x, np.inf)
    for _ in range(60):
        of, last = problem[moving], x[moving]
        right, slope = _compute_right_side(F[of], C[of], k[of], last)
        new = np.clip(last + compute_step(right - last, slope), 0.0, 1e12 * size[of, None])
        least_change = np.minimum(np.abs(new - last).max(axis=1), np.abs(new - before[moving]).max(axis=1))
        x[moving], before[moving] = new, last
        moving = moving[least_change > SETTLED * new.max(axis=1)]  # the others stand still or alternate
    right, _ = _compute_right_side(F[problem], C[problem], k[problem], x)
    solves = np.abs(right - x).max(axis=1) <= 1e-9 * np.maximum(x.max(axis=1), size[problem])
    x, solves = x.reshape(n, -1, p), solves.reshape(n, -1)
    least = x[np.arange(n), np.argmin(np.where(solves, x.sum(axis=2), np.inf), axis=1)]
    apart = np.abs(x - least[:, None]).max(axis=2) > SAME * np.maximum(x.max(axis=2), least.max(axis=1)[:, None])
    count = np.where((solves & apart).any(axis=1), SEVERAL, np.where(solves.any(axis=1), ONE, NONE))
    return np.where(count[:, None] == NONE, np.nan, least), count
