"""Loop closure on a branch, angular velocities and angular accelerations.

    a e^{i theta_2} + b e^{i theta_3} = d e^{i theta_1} + c e^{i theta_4}

(R. L. Norton, Design of Machinery, ch. 4). The position is solved from the triangle A, B, O4 and its
four Heron factors, never from the half-angle quadratic: nothing passes through zero at theta = 180 deg,
and near a limit position the digits that are lost are those that the data themselves do not carry. A term
that is zero at every position (alpha_2 = 0, theta_1 = 0) is not evaluated.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fourbar.linkage import FourBar
from fourbar.margins import NO_DIGIT_LEFT, Diagonal, diagonal_to_O4, in_precision_of
from fourbar.state import NO_ROOM, Array, FirstCoefficients, State, Vector, is_zero


def close_loop(
    linkage: FourBar, theta_2: Array, branch: int | NDArray[np.int8], diagonal: Diagonal | None = None
) -> State:
    """Positions on a branch: theta_3 = phi + sigma beta, theta_4 = phi + pi - sigma gamma.

    phi is the direction A to O4, beta and gamma are the angles of the triangle A, B, O4 at A and
    O4, from the cosine rule and Heron's formula (root = 4 times its area):
        cos beta = (e^2 + b^2 - c^2)/(2 b e),  sin beta = root/(2 b e),
        sin(theta_4 - theta_3) = sigma root/(2 b c).

    Parameters
    ----------
    theta_2 : (n,), rad.
    branch : +1 or -1, or one of them for each position (n,).
    diagonal : the diagonal A to O4 where it is known already.
    """
    diagonal = diagonal_to_O4(linkage, theta_2) if diagonal is None else diagonal
    _, _, b, c = diagonal.lengths
    signs = np.asarray(branch, dtype=np.int8)
    root = diagonal.root
    if not (signs == 1).all():
        root = signs * root
    x, y = diagonal.x, diagonal.y
    theta_1 = linkage.ground_angle
    u1: tuple[Any, Any] = (1.0, 0.0)
    cos_psi = diagonal.w - diagonal.v
    u2 = (cos_psi, 2.0 * diagonal.h)
    if theta_1 != 0.0:
        c1, s1 = u1 = unit_vector(in_precision_of(theta_2, theta_1))
        x, y = c1 * x - s1 * y, s1 * x + c1 * y
        u2 = unit_vector(theta_2)  # not u2 turned by theta_1: a small component keeps its digits
    squared = diagonal.squared
    # e^2 + b^2 - c^2 and e^2 - b^2 + c^2 by Heron's factor, from which the root is too: u3 and u4 keep their length
    inner, more = diagonal.inner, 2.0 * (b - c)
    at_A, at_O4 = inner + b * more, inner - c * more
    with np.errstate(all="ignore"):  # e = 0: A on O4, where beta is free
        to_3 = (0.5 / b) / squared
        to_4 = to_3 * -(b / c)
        x_root, y_root = x * root, y * root
        (x3, y3), (x4, y4) = u3, u4 = (x * at_A, y * at_A), (x * at_O4, y * at_O4)
        x3 -= y_root
        y3 += x_root
        x4 += y_root
        y4 -= x_root
        for component, scale in ((x3, to_3), (y3, to_3), (x4, to_4), (y4, to_4)):
            component *= scale  # noqa: PLW2901 - in place
    sin_mu = (0.5 / (b * c)) * root
    if diagonal.least_root != 0.0:
        singular = np.zeros(theta_2.shape, dtype=bool)
    else:  # false where it is NaN
        singular = np.abs(sin_mu) <= (NO_DIGIT_LEFT if diagonal.offset is None else 0.0)
    state = State(
        linkage=linkage,
        theta_2=theta_2,
        branch=np.broadcast_to(signs, theta_2.shape),
        assembled=diagonal.assembled,
        u2=u2,
        u3=u3,
        u4=u4,
        O4=(float(linkage.ground * np.cos(theta_1)), float(linkage.ground * np.sin(theta_1))),
        diagonal=diagonal,
        signed_root=root,
        sin_mu=sin_mu,
        at_A=at_A,
        at_O4=at_O4,
        cos_psi=cos_psi,
        singular=singular,
    )
    _parallel(state, u1)
    if linkage.ground == linkage.input.length and linkage.coupler.length == linkage.output.length:
        _put_A_on_O4(state, u1)
    return state


def unit_vector(angle: Any) -> tuple[Any, Any]:
    """(cos, sin) of an angle by one tangent, a fifth of the cost, in the precision of the angle."""
    t = np.tan(0.5 * angle)
    w = 1.0 / (1.0 + t * t)
    return ((1.0 - t * t) * w, (2.0 * t) * w)


def _put_A_on_O4(state: State, u1: tuple[Any, Any]) -> None:
    """Bars 3 and 4 of a kite lie on each other and turn freely where A meets O4: put where theta_2 falls to that."""
    if not isinstance(state.diagonal.squared, np.ndarray):
        return  # singular, and so none of the second pass
    met = np.flatnonzero(state.assembled & ~np.isfinite(state.u3[0]))
    side = np.where(state.diagonal.h[met] < 0.0, -1.0, 1.0)  # so near that e^2 left the range of doubles
    for u in (state.u3, state.u4):
        for i in (0, 1):
            u[i][met] = side * state.branch[met] * u1[i]


def _parallel(state: State, u1: tuple[Any, Any]) -> None:
    """Put the exact directions where two pairs of bars stay parallel or coincide.

    a = c, b = d: the coupler keeps the ground's direction and bars 2, 4 turn together;
    a = b, c = d: B stays on O2, bars 2, 3 turn together and bar 4 rests.
    """
    d, a, b, c = state.linkage.lengths
    if not ((a == c and b == d) or (a == b and c == d)) or not isinstance(state.sin_mu, np.ndarray):
        return  # no such pairs, or positions of the second pass, which are others
    half_turn = np.sign(state.diagonal.h)
    none = np.zeros(state.theta_2.shape, dtype=bool)
    together = (state.branch == half_turn) if (a == c and b == d) else none
    folded = (state.branch == -half_turn) if (a == b and c == d) else none
    where = together | folded
    u2, u3, u4 = state.u2, state.u3, state.u4
    state.u3 = tuple(np.where(together, u1[i], np.where(folded, -u2[i], u3[i])) for i in (0, 1))  # type: ignore[assignment]
    state.u4 = tuple(np.where(together, u2[i], np.where(folded, -u1[i], u4[i])) for i in (0, 1))  # type: ignore[assignment]
    state.sin_mu = np.where(where, state.branch * np.abs(2.0 * state.diagonal.h), state.sin_mu)
    state.singular = state.assembled & ~(np.abs(state.sin_mu) > NO_DIGIT_LEFT)
    state.parallel = (where, together.astype(float))


def add_velocities(state: State, omega_2: Array | float, room: Mapping[str, Any] = NO_ROOM) -> None:
    """omega_3 = h3 omega_2, omega_4 = h4 omega_2 with the kinematic coefficients h_k = d theta_k/d theta_2.

    In the triangle A, B, O4, whose side e turns by kappa = d phi/d theta_2 and grows by lambda = e'/e:
        h3 = kappa - sigma lambda cot gamma,  h4 = kappa + sigma lambda cot beta,
        kappa = a (a - d cos psi)/e^2,  lambda = a d sin psi/e^2,  psi = theta_2 - theta_1.
    The same as Norton's (ch. 6), but where the ground is short and all bars turn together the
    difference of nearly equal speeds keeps its digits. What `room` has an array for is written there.
    """
    coefficients = first_coefficients(state)
    state.first = coefficients
    state.omega_2 = omega_2
    state.omega_3 = np.multiply(coefficients.h3, omega_2, out=room.get("omega_3"))
    state.omega_4 = np.multiply(coefficients.h4, omega_2, out=room.get("omega_4"))


def add_accelerations(state: State, alpha_2: Array | float, room: Mapping[str, Any] = NO_ROOM) -> None:
    """alpha_k = h_k alpha_2 + h_k' omega_2^2, with h_k' = d h_k/d theta_2:

    h3' = kappa' - sigma (lambda' cot gamma + lambda^2 cot beta / sin^2 gamma),
    h4' = kappa' + sigma (lambda' cot beta + lambda^2 cot gamma / sin^2 beta),
    kappa' = lambda (d^2 - a^2)/e^2,  lambda' = a d cos psi/e^2 - 2 lambda^2.

    Evaluated with 1/sin^2 = 1 + cot^2 and what both share taken together:
        h3' = kappa' - lambda p4 - Z cot gamma,  h4' = kappa' + lambda p3 + Z cot beta,
        p3 = sigma lambda cot gamma,  p4 = sigma lambda cot beta,  Z = sigma (lambda' + p3 p4).
    What `room` has an array for is written there.
    """
    assert state.first is not None, "velocities come first"
    w2 = state.omega_2 * state.omega_2
    h3, h4 = second_coefficients(state, state.first)
    state.alpha_2 = alpha_2
    state.alpha_3 = np.multiply(h3, w2, out=room.get("alpha_3"))
    state.alpha_4 = np.multiply(h4, w2, out=room.get("alpha_4"))
    if not is_zero(alpha_2):
        state.alpha_3 = np.add(state.alpha_3, state.first.h3 * alpha_2, out=room.get("alpha_3"))
        state.alpha_4 = np.add(state.alpha_4, state.first.h4 * alpha_2, out=room.get("alpha_4"))


def first_coefficients(state: State) -> FirstCoefficients:
    """The first kinematic coefficients; NaN where the position is singular."""
    diagonal = state.diagonal
    d, a, _, _ = diagonal.lengths
    root = state.regular_root()
    cot_beta, cot_gamma = state.at_A / root, state.at_O4 / root
    growth, turn = (2.0 * a * d) * diagonal.h, (a * (a - d)) * diagonal.w
    turn += (a * (a + d)) * diagonal.v
    with np.errstate(all="ignore"):  # A on O4
        growth /= diagonal.squared
        turn /= diagonal.squared
    with_beta, with_gamma = growth * cot_beta, growth * cot_gamma
    h3, h4 = turn - with_gamma, turn + with_beta
    if state.parallel is not None:
        where, fourth = state.parallel
        gap = np.where(state.singular, np.nan, 0.0)
        h3, h4 = np.where(where, (1.0 - fourth) + gap, h3), np.where(where, fourth + gap, h4)
    return FirstCoefficients(h3, h4, growth, cot_beta, cot_gamma, with_beta, with_gamma)


def second_coefficients(state: State, first: FirstCoefficients) -> Vector:
    """d^2 theta_3/d theta_2^2 and d^2 theta_4/d theta_2^2, each (n,)."""
    diagonal = state.diagonal
    d, a, _, _ = diagonal.lengths
    growth = first.growth
    with np.errstate(all="ignore"):  # A on O4
        turn, shared = ((d - a) * (d + a)) * growth, (a * d) * state.cos_psi
        turn /= diagonal.squared
        shared /= diagonal.squared
        twice = growth * growth
        twice *= 2.0
        shared -= twice
        shared += first.with_beta * first.with_gamma
        h3, h4 = growth * first.with_beta, growth * first.with_gamma
        h3 += shared * first.cot_gamma
        h4 += shared * first.cot_beta
        h3 = turn - h3
        h4 += turn
    if state.parallel is not None:
        rest = np.where(state.singular, np.nan, 0.0)
        h3, h4 = (np.where(state.parallel[0], rest, h) for h in (h3, h4))
    return h3, h4
