"""A released linkage by Taylor series in 77 digits: the reference of the free motions.

Shares nothing with the formulas. The coordinates are the three angles themselves, the
equations d'Alembert's: with P the derivative of the loop's closure and t = P_x x P_y,
the one motion it can make,
    P alpha = gamma,   t . (M alpha - f) = 0,   so
    alpha = ((gamma_x P_y - gamma_y P_x) x M t + (t . f) t)/(t . M t).
Nothing happens to them at a limit position. At a change point t = 0 and the quotient is
0/0, but the motion is analytic there, and a Taylor step passes over the point.
"""

import math
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np
from flint import arb, arb_series, ctx

from fourbar import Gravity, Load, Viscous
from fourbar.linkage import MOVING_BARS, PINS
from fourbar_validation.engines.balls import compute_directions

BITS = 256
"""Near a change point the terms of 1/(t . M t) grow as SINGULAR^-ORDER = 1e-34, and
cancel.
"""
ORDER = 20
TRUNCATION = 1e-16
"""Last terms of a step, rad; some hundred steps err by less than 1e-13."""
SINGULAR = 0.02
"""A step should not end where |t| is below this part of the product of the two longest
moving bars ...
"""
SHORTER = tuple(0.85**k for k in range(9))
"""... and is made as much shorter there as suits best."""

Ball = Any
"""arb or arb_series."""


class Reference(NamedTuple):
    """The motion at the requested times."""

    theta_2: np.ndarray
    sine: np.ndarray
    """sin(theta_4 - theta_3)."""
    limits: int
    """How often bars 3, 4 came into one line and bar 2 did not: limit positions
    reached.
    """
    change_points: int
    """How often all came into one line."""


class Step(NamedTuple):
    """Angles and speeds as the terms of their Taylor series about its start."""

    theta: list[list[Ball]]
    omega: list[list[Ball]]

    def at(self, h):
        """Angles and speeds h seconds after the start."""
        return [_sum(terms, h) for terms in self.theta], [
            _sum(terms, h) for terms in self.omega
        ]

    def length(self):
        """The step at whose end the last two terms are TRUNCATION."""
        return arb(
            min(
                (TRUNCATION / abs(float(terms[k]))) ** (1.0 / k)
                for terms in self.theta
                for k in (ORDER - 1, ORDER)
                if terms[k] != 0
            )
        )


def _sum(terms, h):
    total = arb(0)
    for term in reversed(terms):
        total = total * h + term
    return total.mid()  # without its radius: this is no proof


def _dot(u, v):
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def _cross(u, v):
    return [
        u[1] * v[2] - u[2] * v[1],
        u[2] * v[0] - u[0] * v[2],
        u[0] * v[1] - u[1] * v[0],
    ]


class Equations:
    """The accelerations of one linkage in theta_2, theta_3, theta_4."""

    def __init__(self, linkage, terms):
        self.lengths = d, a, _, _ = tuple(arb(length) for length in linkage.lengths)
        theta_1 = arb(linkage.ground_angle)
        self.O4 = d * theta_1.cos(), d * theta_1.sin()
        bars = [linkage.bar(number) for number in MOVING_BARS]
        mass = [arb(bar.mass) for bar in bars]
        polar = [(arb(bar.mass_centre[0]), arb(bar.mass_centre[1])) for bar in bars]
        self.centre = [(r * phi.cos(), r * phi.sin()) for r, phi in polar]
        self.M = [
            arb(bar.moment_of_inertia) + m * r * r
            for bar, m, (r, _) in zip(bars, mass, polar, strict=True)
        ]
        self.M[0] += mass[1] * a * a
        self.m3_a = mass[1] * a
        # constant forces at the mass centres, those of a bar's own axes, and couples
        self.world, self.own = (
            [[arb(0), arb(0)] for _ in bars],
            [[arb(0), arb(0)] for _ in bars],
        )
        self.couple = [arb(0)] * 3
        # of forces in the world's axes at places of a bar's own: the couple at its
        # angles 0 and -90 deg
        self.turning = [[arb(0), arb(0)] for _ in bars]
        self.damping = []
        for term in terms:
            self._add(term, mass)

    def _add(self, term, mass):
        if isinstance(term, Gravity):
            for k in range(3):
                _push(
                    self.world[k],
                    mass[k] * arb(term.magnitude),
                    arb(term.angle),
                )
        elif isinstance(term, Viscous):
            self.damping += [(*PINS[pin], arb(k)) for pin, k in term.coefficients]
        elif isinstance(term, Load):
            self._add_load(term)
        else:
            raise NotImplementedError(type(term).__name__)

    def _add_load(self, load):
        """Add a load at G: its force in the axes that it is stated in, its couple about
        G.
        """
        if load.table is not None or load.point is not None:
            raise NotImplementedError("a load of a table, or at a named point")
        k = load.bar - 2
        self.couple[k] += arb(load.moment)
        if load.force is None:
            return
        size, angle = map(arb, load.force)
        _push(
            (self.own if load.frame == "bar" else self.world)[k],
            size,
            angle,
        )
        force, place = [arb(0), arb(0)], [arb(0), arb(0)]
        _push(force, size, angle)
        if load.from_pin is not None:
            r, phi = load.from_pin
            place = [-x for x in self.centre[k]]
        else:
            r, phi = load.arm or load.from_centre or (0.0, 0.0)
        _push(place, arb(r), arb(phi))
        (x, y), (fx, fy) = place, force
        if load.arm is None and load.frame == "world":  # the place turns alone
            self.turning[k][0] += x * fy - y * fx
            self.turning[k][1] += x * fx + y * fy
        else:
            self.couple[k] += x * fy - y * fx

    def start(self, linkage, theta_2, omega_2, branch):
        """Angles and speeds; not at a limit position."""
        x = dict(zip(("d", "a", "b", "c"), self.lengths, strict=True))
        closed = compute_directions(
            x | {"theta_1": arb(linkage.ground_angle), "theta_2": arb(theta_2)}, branch
        )
        assert closed is not None
        theta = [arb(theta_2), *(u.arg().mid() for u in closed[1:])]
        t = self.direction(theta)
        return theta, [(arb(omega_2) * w / t[0]).mid() for w in t]

    def loop(self, C, S):
        """P_x, P_y: derivatives of a u_2 + b u_3 - c u_4."""
        _, a, b, c = self.lengths
        return [-a * S[0], -b * S[1], c * S[2]], [a * C[0], b * C[1], -c * C[2]]

    def direction(self, theta):
        """t = P_x x P_y."""
        return _cross(*self.loop([q.cos() for q in theta], [q.sin() for q in theta]))

    def stretch(self, theta):
        """|t| of the product of the two longest moving bars: 0 at a change point."""
        t = self.direction(theta)
        return float(_dot(t, t).sqrt()) / math.prod(
            sorted(map(float, self.lengths[1:]))[1:]
        )

    def closed(self, theta, omega):
        """The nearest angles and speeds that close the loop.

        An open one has no change point to pass.
        """
        for _ in range(4):  # 16, 32, 64, 128 digits
            S, y_C = self.loop([q.cos() for q in theta], [q.sin() for q in theta])
            gap = sum(y_C, start=-self.O4[0]), -sum(S, start=self.O4[1])
            xx, xy, yy = _dot(S, S), _dot(S, y_C), _dot(y_C, y_C)
            det = xx * yy - xy * xy
            p, q = (yy * gap[0] - xy * gap[1]) / det, (xx * gap[1] - xy * gap[0]) / det
            theta = [
                (angle - p * x - q * y).mid()
                for angle, x, y in zip(theta, S, y_C, strict=True)
            ]
        t = self.direction(theta)
        share = _dot(t, omega) / _dot(t, t)
        return list(theta), [(w * share).mid() for w in t]

    def accelerations(self, theta, omega):
        """alpha_2, alpha_3, alpha_4."""
        S, C = zip(*(q.sin_cos() for q in theta), strict=True)
        squared = [w * w for w in omega]
        cosine, sine = C[0] * C[1] + S[0] * S[1], S[1] * C[0] - C[1] * S[0]
        x, y = self.centre[1]
        M23, h = (
            self.m3_a * (x * cosine - y * sine),
            self.m3_a * (x * sine + y * cosine),
        )
        f = [h * squared[1], -h * squared[0], 0 * h]
        for k, force in enumerate(self.forces(C, S, omega)):
            f[k] = f[k] + force
        P_x, P_y = self.loop(C, S)
        # a u_2 omega_2^2 + b u_3 omega_3^2 - c u_4 omega_4^2
        gamma_x, gamma_y = _dot(P_y, squared), -_dot(P_x, squared)
        t = _cross(P_x, P_y)
        Mt = [
            self.M[0] * t[0] + M23 * t[1],
            self.M[1] * t[1] + M23 * t[0],
            self.M[2] * t[2],
        ]
        bound = _cross(
            [gamma_x * v - gamma_y * u for u, v in zip(P_x, P_y, strict=True)], Mt
        )
        share, work = 1 / _dot(t, Mt), _dot(t, f)
        return [(u + work * v) * share for u, v in zip(bound, t, strict=True)]

    def forces(self, C, S, omega):
        """The couple of everything that acts on each angle."""
        total = list(self.couple)
        for k in range(3):
            (x, y), (fx, fy), (own_x, own_y) = (
                self.centre[k],
                self.world[k],
                self.own[k],
            )
            # F . i u (x + i y)
            total[k] = (
                total[k]
                + (x * fy - y * fx) * C[k]
                - (x * fx + y * fy) * S[k]
                + (x * own_y - y * own_x)
                + self.turning[k][0] * C[k]
                - self.turning[k][1] * S[k]
            )
        (fx, fy), (own_x, own_y), a = self.world[1], self.own[1], self.lengths[1]
        force = fx + own_x * C[1] - own_y * S[1], fy + own_y * C[1] + own_x * S[1]
        total[0] = total[0] + a * (force[1] * C[0] - force[0] * S[0])
        for i, j, k in self.damping:
            slip = (omega[j - 2] if j > 1 else 0) - (omega[i - 2] if i > 1 else 0)
            for bar, couple in ((i, k * slip), (j, -k * slip)):
                if bar > 1:
                    total[bar - 2] = total[bar - 2] + couple
        return total

    def step(self, theta, omega):
        """The series of the motion, one term longer with each evaluation."""
        angles, speeds = (
            [[q, w] for q, w in zip(theta, omega, strict=True)],
            [[w] for w in omega],
        )
        for count in range(1, ORDER):
            ctx.cap = count
            alpha = self.accelerations(
                [arb_series(q) for q in angles], [arb_series(w) for w in speeds]
            )
            for q, w, terms in zip(angles, speeds, alpha, strict=True):
                w.append((terms[count - 1] / count).mid())
                q.append(w[count] / (count + 1))
        return Step(angles, speeds)


def _push(total, size, angle):
    total[0] += size * angle.cos()
    total[1] += size * angle.sin()


def _sine(theta, i=1, j=2):
    """sin(theta_4 - theta_3), or of two other bars."""
    return float((theta[j] - theta[i]).sin())


@contextmanager
def _digits():
    """flint's context is one for the process."""
    before = ctx.prec, ctx.cap
    ctx.prec = BITS
    try:
        yield
    finally:
        ctx.prec, ctx.cap = before


def released(linkage, terms, theta_2, omega_2, branch, times):
    """The motion under loads, gravity and viscous damping, with nothing driving it."""
    with _digits():
        equations = Equations(linkage, terms)
        theta, omega = equations.start(linkage, theta_2, omega_2, branch)
        rows = []
        t, limits, change_points = arb(0), 0, 0
        while len(rows) < len(times):
            step = equations.step(theta, omega)
            h = step.length()
            if equations.stretch(step.at(h)[0]) < SINGULAR:
                h *= arb(
                    max(
                        SHORTER,
                        key=lambda part: equations.stretch(step.at(h * arb(part))[0]),
                    )
                )
            before = _sine(theta)
            new = equations.closed(*step.at(h))
            if _sine(new[0]) * before < 0.0:
                all_bars = _sine(new[0], 0, 1) * _sine(theta, 0, 1) < 0.0
                limits, change_points = (
                    limits + (not all_bars),
                    change_points + all_bars,
                )
            while len(rows) < len(times) and arb(float(times[len(rows)])) <= t + h:
                q, _ = step.at(arb(float(times[len(rows)])) - t)
                rows.append([float(q[0]), _sine(q)])
            t, (theta, omega) = (t + h).mid(), new
    angles = np.array(rows)
    return Reference(
        angles[:, 0],
        angles[:, 1],
        limits,
        change_points,
    )
