"""Every position of a loop in which a function of it vanishes, with a proof that none is missed.

Boxes of psi = theta_2 - theta_1 and mu = theta_4 - theta_3 in which the loop cannot close, or the function F not
vanish, are left out. Where the determinant of the derivatives of closure g and F has one sign there is one zero at
most, and Newton's step from the centre c over the box B,
    N = c - J(B)^-1 (g, F)(c),
holds it: no zero lies in B outside N, and where N lies in B there is exactly one.

Source: R. E. Moore, R. B. Kearfott, M. J. Cloud, Introduction to Interval Analysis, ch. 8.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fourbar.formulas.position import Loop
from fourbar.solution import Array
from fourbar.studies.circuit_curve import closure
from fourbar.studies.sloped import Sloped, make_balls

PI = math.pi
FIRST = 24
"""Boxes to begin with, to a side."""
SLACK = 1e-9
"""rad; by how much the boxes overlap a whole turn, so that none of it is left out by rounding."""
AT_CHANGE_POINT = 1e-4
"""rad; nearer to a change point nothing is decided: the curve crosses itself there."""
FINEST = 1e-3 * AT_CHANGE_POINT
"""rad; a box as narrow that is not decided stays so: there the function and its derivative vanish both. A box of a
hundredth of the distance from a change point is too wide to tell: where A comes to O4 the diagonal turns over it."""
MANY = 10_000
"""Boxes evaluated; a function that nearly vanishes along the curve needs more, and is given up."""
STEPS = 6
"""Newton's steps from a unique zero to its last digits."""
MARGIN = 1e-12
"""Margin of the closure and of an angle in rad, far above the rounding of doubles."""


class Zeros(NamedTuple):
    """Positions as psi and mu, rad, (n, 2)."""

    found: Array
    """Zeros, each proven to exist and to be simple."""
    undecided: Array
    """Points where a zero with a vanishing derivative may be."""
    complete: bool
    """True if there are no other zeros, except any nearer than AT_CHANGE_POINT to a change point."""


def find_zeros(
    lengths: Loop,
    function: Callable[[Any, Any], Sloped],
    domain: tuple[tuple[float, float], tuple[float, float]],
    inside: Callable[[Array, Array], NDArray[np.bool_]],
    change_points: list[tuple[float, float]],
) -> Zeros:
    """Find all positions in the domain in which the loop closes and the function vanishes.

    Parameters
    ----------
    lengths : in any unit.
    function : of balls psi and mu, (n,), with its slopes by both.
    domain : ends of psi and of mu, rad.
    inside : whether a box of psi and mu, (n, 2) centres and radii, may hold one of those wanted, (n,).
    change_points : psi and mu of each, rad.
    """
    from flint import arb

    d, a, b, c = lengths[:4]
    exact = Loop(arb(d), arb(a), arb(b), arb(c), 0.0, 0.0)
    ends = [np.linspace(low - SLACK, high + SLACK, FIRST + 1) for low, high in domain]
    grid = np.meshgrid(*(0.5 * (x[1:] + x[:-1]) for x in ends), indexing="ij")
    centres = np.stack([x.ravel() for x in grid], axis=1)
    radii = np.broadcast_to(
        [0.5 * (x[1] - x[0]) * (1.0 + MARGIN) for x in ends], centres.shape
    )
    solved: list[
        tuple[Array, Array, Array]
    ] = []  # zero, and centre and radius of the box in which it is the only one
    undecided: list[Array] = []
    evaluated = 0
    while len(centres):
        kept = _may_close(lengths, centres, radii) & inside(centres, radii)
        for point in change_points:
            kept &= ~(np.abs(_wrap(centres - point)) + radii < AT_CHANGE_POINT).all(
                axis=1
            )
        centres, radii = centres[kept], radii[kept]
        evaluated += len(centres)
        if evaluated > MANY:
            return Zeros(
                np.array([proven[0] for proven in solved]).reshape(-1, 2),
                np.empty((0, 2)),
                False,
            )
        split = np.zeros(len(centres), dtype=bool)
        newton = _Newton(exact, function, centres, 2.0 * radii)
        for i, (box, r) in enumerate(zip(centres, radii, strict=True)):
            if newton.without_zero(i, r) or any(
                _is_inside(box, r, *proven[1:]) for proven in solved
            ):
                continue
            step = newton.step(i)
            if step is not None and any(
                abs(float(z.mid()) - x) > w + z.rad()
                for z, x, w in zip(step, box, r, strict=True)
            ):
                continue
            if step is not None and all(
                _holds(x, 2.0 * w, z) for z, x, w in zip(step, box, r, strict=True)
            ):
                zero = _polish(exact, function, step)
                if not any(
                    _is_inside(zero, np.zeros(2), *proven[1:]) for proven in solved
                ):
                    solved.append((zero, box, 2.0 * r))
            elif r.max() < FINEST:
                undecided.append(box)
            else:
                split[i] = True
        offsets = np.array([[-0.5, -0.5], [-0.5, 0.5], [0.5, -0.5], [0.5, 0.5]])
        halves = radii[split][:, None] * offsets
        centres = (centres[split][:, None] + halves).reshape(-1, 2)
        radii = np.repeat(0.5 * radii[split] * (1.0 + MARGIN), 4, axis=0)
    zeros = np.array([proven[0] for proven in solved]).reshape(-1, 2)
    return Zeros(zeros, _separate(np.array(undecided).reshape(-1, 2)), True)


def _may_close(lengths: Loop, centres: Array, radii: Array) -> NDArray[np.bool_]:
    """Mark boxes in which the loop may close: |g(c)| is no more than its greatest slopes allow."""
    d, a, b, c = lengths[:4]
    slope = np.minimum(np.abs(np.sin(centres)) + radii, 1.0) * [a * d, b * c]
    size = a * d + b * c + 0.5 * (a * a + b * b + c * c + d * d)
    allowed = (slope * radii).sum(axis=1) + MARGIN * size
    return ~np.asarray(np.abs(closure(lengths, centres[:, 0], centres[:, 1])) > allowed)


class _Newton:
    """Closure and function at the centres of boxes, with their derivatives over them."""

    def __init__(
        self,
        lengths: Loop,
        function: Callable[[Any, Any], Sloped],
        centres: Array,
        radii: Array,
    ) -> None:
        from flint import arb

        self.arb = arb
        points, boxes = [*make_balls(centres.T)], [*make_balls(centres.T, radii.T)]
        d, a, b, c = lengths[:4]
        self.points, self.many = points, len(centres)
        self.g, self.F = closure(lengths, *points), function(*points).values
        over = function(*boxes)
        self.over = over.values
        self.F_psi, self.F_mu = np.broadcast_to(over.slopes, (2, self.many))
        self.g_psi, self.g_mu = -(a * d) * np.sin(boxes[0]), (b * c) * np.sin(boxes[1])
        self.det = self.g_psi * self.F_mu - self.g_mu * self.F_psi

    def without_zero(self, i: int, radius: Array) -> bool:
        """Return True if F vanishes nowhere in a box, by its values or from the centre by its slopes."""
        moved = (
            self.F[i]
            + self.F_psi[i] * self.arb(0, radius[0])
            + self.F_mu[i] * self.arb(0, radius[1])
        )
        return any(
            value.is_finite() and not value.contains(0)
            for value in (moved, self.over[i])
        )

    def step(self, i: int) -> tuple[Any, Any] | None:
        """Return Newton's step from the centre; None where the determinant may vanish."""
        det = self.det[i]
        if not det.is_finite() or det.contains(0):
            return None
        psi = (
            self.points[0][i]
            - (self.F_mu[i] * self.g[i] - self.g_mu[i] * self.F[i]) / det
        )
        mu = (
            self.points[1][i]
            - (self.g_psi[i] * self.F[i] - self.F_psi[i] * self.g[i]) / det
        )
        return psi, mu


def _polish(
    lengths: Loop, function: Callable[[Any, Any], Sloped], step: tuple[Any, Any]
) -> Array:
    """Return the zero in a step that holds it."""
    zero = np.array([[float(z.mid()) for z in step]])
    for _ in range(STEPS):
        again = _Newton(lengths, function, zero, np.zeros((1, 2))).step(0)
        assert again is not None  # the determinant has one sign over the whole box
        zero = np.array([[float(z.mid()) for z in again]])
    return np.asarray(zero[0])


def _holds(centre: float, radius: float, ball: Any) -> bool:
    """Return True if a ball lies inside an interval."""
    return abs(float(ball.mid()) - centre) + float(ball.rad()) < radius * (1.0 - MARGIN)


def _is_inside(point: Array, r: Array, centre: Array, radius: Array) -> bool:
    """Return True if a box lies inside another, whole turns apart or not."""
    return bool((np.abs(_wrap(point - centre)) + r <= radius * (1.0 - MARGIN)).all())


def _wrap(angle: Any) -> Any:
    """Wrap angles into half a turn."""
    return angle - 2.0 * PI * np.rint(angle / (2.0 * PI))


def _separate(points: Array) -> Array:
    """Return the middle of each group of neighbouring points."""
    groups: list[list[Array]] = []
    for point in points:
        near = [
            g
            for g in groups
            if any((np.abs(_wrap(point - member)) < 8.0 * FINEST).all() for member in g)
        ]
        groups = [g for g in groups if all(g is not one for one in near)] + [
            [point, *(p for g in near for p in g)]
        ]
    return np.array([np.mean(group, axis=0) for group in groups]).reshape(-1, 2)
