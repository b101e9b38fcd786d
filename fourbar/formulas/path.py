"""The path of a linkage in one independent angle.

The angle is theta_2, or that of another bar which is commanded or free.

The loop is a sum of four vectors, in any order. Read from bar 3 or from bar 4 it is one
of the same kind, whose input is that bar, and every formula of position and motion
holds as it stands:
    b e^{i theta_3} + a e^{i theta_2} = d e^{i theta_1} + c e^{i theta_4},
    c e^{i theta_4} + b e^{i (theta_3 + pi)} = d e^{i (theta_1 + pi)} + a e^{i theta_2}.
The sine between its coupler and its output is sin(theta_4 - theta_2) read from bar 3
and sin(theta_3 - theta_2) read from bar 4: the sign of the root, zero at the limits of
that bar, and by it what is singular at the limits of theta_2 is not.

The branch of a path is an assembly: its root keeps its formula, and with it the motion
is smooth through change points. The sign of the sine at a position follows from the
lengths and the angle alone: `find_root_sign` of `position.py`, read by `LoopPath.sign`.
"""

from typing import NamedTuple

import numpy as np

from fourbar.formulas.arithmetic import (
    Number,
    is_any,
    polar,
    power_of_two,
    select,
    sine,
    vector,
)
from fourbar.formulas.motion import (
    Coefficients,
    State,
    coefficients,
    put_parallel_speeds,
    rates,
    take_sines_of_rates,
)
from fourbar.formulas.position import (
    ROLES_OF_BARS,
    HalfAngle,
    Loop,
    Passing,
    Position,
    close_loop,
    direction,
    find_parallel_pairs,
    find_passing,
    half_angle,
    loop,
    put_parallel_pairs,
    reorder_lengths,
)
from fourbar.linkage import FourBar

NO_DIGIT_LEFT = 16.0 * 2.0**-53
"""|sin mu| at or below this: the directions of bars 3 and 4 are the same in doubles."""


class LoopPath(NamedTuple):
    """The loop as it is read from the bar whose angle is independent.

    Read from bar 4, the triangle that closes is that of bars 2 and 3, and `in_order`
    gives the bars their own names back.

    >>> path = prepare_path((4.0, 1.0, 3.5, 2.0), 0.0, bar=4)
    >>> theta_4 = 2.0
    >>> position = path.position(theta_4, path.half_angle(theta_4), branch=1.0)
    >>> p = path.in_order(position)
    >>> abs(1.0 * p.u2 + 3.5 * p.u3 - 4.0 - 2.0 * p.u4) < 1e-14
    True
    """

    bar: int
    """2, 3 or 4."""
    lengths: Loop
    """Loop in the order of this path: ground, the bar itself, coupler, the other bar.
    """
    theta_1: Number
    """Direction of the ground from O2 to O4, rad."""
    u1: Number
    """e^{i theta_1}, its opposite where the loop is read from bar 4."""
    unit: Number = 1.0
    """Unit of the lengths, a power of two near the longest, m. No product of them
    leaves the range of doubles.
    """
    may_stay_parallel: bool = False
    """True if there are two pairs of equal bars."""
    passing: Passing = Passing(False, False)
    """Roots that pass through zero at a change point, with their sign."""

    def half_angle(self, q: Number) -> HalfAngle:
        """Compute the half angle for the independent angle q (rad, not reduced).

        The angle is measured against the ground.
        """
        psi = q - self.theta_1
        return half_angle(
            self.lengths,
            psi,
            opposite=self.bar == 4,
            passing=self.passing,
        )

    def sign(self, q: Number, branch: Number) -> Number:
        """Compute the sign of the bar's own sine at an angle in an assembly.

        Given the sign at that angle, it returns the assembly.
        """
        if not is_any(self.passing.outer | self.passing.inner):
            return branch
        return branch * self.half_angle(q).root_sign

    def passes_zero(self, half: HalfAngle) -> Number:
        """Mark where the smaller root is one that passes through zero.

        Near it lies a change point, and no limit.
        """
        return select(half.outer < half.inner, self.passing.outer, self.passing.inner)

    def input_direction(self, q: Number, half: HalfAngle) -> Number:
        """Compute e^{i q}: over level ground from the half angle, which is at hand."""
        level = self.theta_1 == 0.0
        if not is_any(level):
            return direction(q)
        u2 = vector(half.kk - half.ss, 2.0 * half.sk)
        if self.bar == 4:
            u2 = -u2
        turned = self.theta_1 != 0.0
        if is_any(turned):  # many linkages, some on level ground
            u2 = select(turned, direction(q), u2)
        return u2

    def position(self, q: Number, half: HalfAngle, branch: Number) -> Position:
        """Compute positions with the bars in the order of the path.

        `branch`: assembly, the sign of `drive_sine` for a drive on the bar itself while
        the bar turns through the first half turn from the ground (for bar 4 from its
        opposite).
        """
        u2 = self.input_direction(q, half)
        position = close_loop(self.lengths, self.u1, u2, half, branch, self.unit)
        if self.may_stay_parallel:
            position = put_parallel_pairs(
                position,
                *find_parallel_pairs(self.lengths, branch),
            )
        return position

    def close(
        self,
        q: Number,
        half: HalfAngle,
        branch: Number,
        *,
        condition: Number = 1.0,
        margin: float = NO_DIGIT_LEFT,
    ) -> tuple[Position, Coefficients, Number]:
        """Close the loop at a half angle.

        Return positions, coefficients by q, and the sine. The sine is that between the
        two other moving bars. Coefficients are NaN where they are 0/0: where it, or the
        condition of the command, is no larger than `margin`; nowhere if that is
        negative, and on a change point they are limits.
        """
        position = self.position(q, half, branch)
        singular = abs(position.sin_mu) <= margin
        if is_any(singular):
            singular = singular & ~np.asarray(self.passes_zero(half), dtype=bool)
        singular = singular | (condition <= margin)
        if is_any(singular):
            root = np.where(singular, np.nan, position.root)
            position = position._replace(root=root)
        sine = position.sin_mu
        k = coefficients(self.lengths, position)
        position = take_sines_of_rates(self.lengths, position, k)
        if self.may_stay_parallel:
            first, second = find_parallel_pairs(self.lengths, branch)
            regular = ~np.isnan(position.root)
            k = put_parallel_speeds(k, first & regular, second & regular)
        return self.in_order(position), _read_from(self.bar, k), sine

    def in_order(self, position: Position) -> Position:
        """Put the bars in their usual order; the triangle stays that of the reading."""
        if self.bar == 2:
            return position
        roles = ROLES_OF_BARS[self.bar]
        u1 = position.u1
        directions: tuple[Number, ...] = position[:4]
        u2, u3, u4 = (directions[role - 1] for role in roles)
        if self.bar == 4:
            u1 = -u1
            u3 = -u3
        d, _, b, c, _, _ = self.lengths
        a = self.lengths[roles[0] - 1]
        diagonal = (d * self.unit) * u1 - (a * self.unit) * u2
        # the root is NaN where speeds are 0/0; the sine still has its value
        closed = position._replace(root=position.sin_mu * (2.0 * b * c))
        sin_mu = self.drive_sine(closed, 2)
        return position._replace(
            u1=u1, u2=u2, u3=u3, u4=u4, sin_mu=sin_mu, diagonal=diagonal
        )

    def drive_sine(self, position: Position, drive_bar: int) -> Number:
        """Compute the sine between the two bars that are not driven.

        The positions are those of `close`; those of `on_curve` in
        `studies/circuit_curve.py` have no half angle.
        """
        if position.half is None:
            return drive_sine(position, drive_bar)
        role = ROLES_OF_BARS[self.bar][drive_bar - 2]
        if role == 2:
            if self.bar == 2:
                return position.sin_mu
            return position.root * (0.5 / (self.lengths.b * self.lengths.c))
        sine = drive_sine_of_triangle(self.lengths, position, role)
        if self.may_stay_parallel:  # all bars make one angle, whose sine is exact
            assembly = np.sign(position.root) * np.sign(position.half.sk)
            first, second = find_parallel_pairs(self.lengths, assembly)
            with_first, with_second = (
                (0.0, 2.0 * position.half.sk)
                if role == 3
                else (-2.0 * position.half.sk, 0.0)
            )
            sine = select(first, with_first, select(second, with_second, sine))
        # read in order for a command of bar 3 or 4, bars 3 and 4 have changed places
        if {self.bar, drive_bar} == {3, 4}:
            return -sine
        return sine


def prepare_path(
    lengths: tuple[Number, Number, Number, Number],
    theta_1: Number,
    bar: int = 2,
) -> LoopPath:
    """Prepare the path in the angle of bar 2, 3 or 4.

    `lengths`: of ground, input, coupler and output, m.
    """
    d, a, b, c = lengths
    unit = power_of_two(0.25 * (d + a + b + c))
    reordered = loop(*reorder_lengths(bar, (d / unit, a / unit, b / unit, c / unit)))
    u1 = polar(1.0, theta_1)
    passing = find_passing(reordered)
    meets = is_any(passing.outer & passing.inner)
    if bar == 4:
        u1 = -u1
    return LoopPath(bar, reordered, theta_1, u1, unit, meets, passing)


def count_turns(lengths: tuple[Number, Number, Number, Number], bar: int) -> Number:
    """Count the turns of a bar after which an assembly repeats: 2 or 1.

    Two turns are needed by a linkage with a single change point.
    """
    passing = find_passing(loop(*reorder_lengths(bar, lengths)))
    return np.where(passing.outer ^ passing.inner, 2, 1)


def compute_state(
    linkage: FourBar,
    theta_2: Number,
    branch: Number,
    omega_2: Number = 1.0,
    alpha_2: Number = 0.0,
) -> State:
    """Compute positions and motion for a motion of the input.

    Positions are NaN where the loop does not close, speeds also where they are 0/0. If
    omega_2 and alpha_2 are left out, speeds are first and accelerations second
    kinematic coefficients.
    """
    with np.errstate(all="ignore"):
        lengths = loop(*linkage.lengths)
        path = prepare_path(linkage.lengths, linkage.ground_angle)
        half = path.half_angle(theta_2)
        position, k, _ = path.close(theta_2, half, branch)
        return State(
            lengths,
            linkage.ground_angle,
            theta_2,
            position,
            k,
            omega_2,
            rates(k, omega_2, alpha_2),
        )


def drive_sine(position: Position, drive_bar: int) -> Number:
    """Compute the sine between the two bars that are not driven.

    A drive on bar 2, 3 or 4 has sin(theta_4 - theta_3), sin(theta_4 - theta_2) or
    sin(theta_3 - theta_2).
    """
    if drive_bar == 2:
        return position.sin_mu
    return sine(position.u2, position.u4 if drive_bar == 3 else position.u3)


def drive_sine_of_triangle(lengths: Loop, position: Position, drive_bar: int) -> Number:
    """Compute the drive's sine from the triangle A, B, O4.

    Nearly equal directions of a short ground lose digits:

        sin(theta_4 - theta_2)
            = ((d cos psi - a) root + d sin psi (e^2 - b^2 + c^2))/(2 c e^2),
        sin(theta_3 - theta_2)
            = ((d cos psi - a) root - d sin psi (e^2 + b^2 - c^2))/(2 b e^2).

    `lengths`: of the loop that the position was closed with.
    """
    d, a, b, c, _, _ = lengths
    ss, _, sk, _, inner, _ = position.half
    along = ((d - a) - 2.0 * d * ss) * position.root
    across = 2.0 * d * sk
    if drive_bar == 3:
        across = across * (inner - 2.0 * c * (b - c))
        return (along + across) / (2.0 * c * position.e2)
    across = across * (inner + 2.0 * b * (b - c))
    return (along - across) / (2.0 * b * position.e2)


def _read_from(bar: int, k: Coefficients) -> Coefficients:
    """Return the coefficients of the loop read from a bar, bars in usual order."""
    if bar == 2:
        return k
    if bar == 3:
        return Coefficients(
            k.h3,
            k.h2,
            k.h4,
            -k.h23,
            k.h43 - k.h23,
            k.dh3,
            k.dh2,
            k.dh4,
        )
    return Coefficients(k.h4, k.h3, k.h2, k.h43, k.h23, k.dh4, k.dh3, k.dh2)
