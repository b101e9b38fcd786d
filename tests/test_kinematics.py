"""Kinematics against second derivations: Newton on the closure, 50-digit differences of positions, symmetry."""

import cmath
import math
from decimal import Decimal

import mpmath
import numpy as np
import pytest

import fourbar
from fourbar.kinematics import add_accelerations, add_velocities, close_loop
from fourbar.sixty_digits import limit_remainder

EPS = 2.0**-52
LENGTHS = (0.3, 0.1, 0.25, 0.22)
ANGLES = np.linspace(-3.0, 6.0, 41)
CLOSURE = 8 * EPS
"""Of the sum of the lengths: eight roundings of unit vectors and their sum."""
DIFFERENCES = 1e-12
"""Relative: the double results against 50-digit differences, well away from limits."""


def linkage(theta_1: float = 0.4) -> fourbar.FourBar:
    d, a, b, c = LENGTHS
    return fourbar.FourBar(d, fourbar.Bar(a), fourbar.Bar(b), fourbar.Bar(c), theta_1)


def newton(link: fourbar.FourBar, theta_2: mpmath.mpf, start: tuple[float, float]) -> tuple[mpmath.mpf, mpmath.mpf]:
    """theta_3, theta_4 of the branch nearest to a start, by Newton's iteration on the closure in 50 digits."""
    d, a, b, c = (mpmath.mpf(length) for length in link.lengths)

    def gap(t3: mpmath.mpf, t4: mpmath.mpf) -> list[mpmath.mpf]:
        z = (
            a * mpmath.expj(mpmath.mpc(theta_2))
            + b * mpmath.expj(mpmath.mpc(t3))
            - d * mpmath.expj(mpmath.mpc(link.ground_angle))
            - c * mpmath.expj(mpmath.mpc(t4))
        )
        return [z.real, z.imag]

    solution = mpmath.findroot(gap, start)
    return solution[0], solution[1]


@pytest.mark.parametrize("branch", [1, -1])
@pytest.mark.parametrize("theta_1", [0.0, 0.4, 1.0, -2.5])
@pytest.mark.parametrize("lengths", [LENGTHS, (0.3, 0.1, 0.3, 0.1), (0.3, 0.1, 0.1, 0.3)])
def test_the_loop_closes_on_the_branch_asked_for(lengths: tuple[float, ...], branch: int, theta_1: float) -> None:
    d, a, b, c = lengths
    link = fourbar.FourBar(d, fourbar.Bar(a), fourbar.Bar(b), fourbar.Bar(c), theta_1)
    state = close_loop(link, theta_1 + ANGLES, branch)
    e2, e3, e4 = (np.exp(1j * state.angle(bar)) for bar in (2, 3, 4))
    gap = a * e2 + b * e3 - d * cmath.exp(1j * theta_1) - c * e4
    assert np.max(np.abs(gap)) <= CLOSURE * sum(lengths)
    diagonal = d * cmath.exp(1j * theta_1) - a * e2
    assert np.all(np.sign((np.conj(diagonal) * b * e3).imag) == branch)


def test_velocity_and_acceleration_are_differences_of_the_position() -> None:
    link, omega, alpha = linkage(), 3.0, -7.0
    state = close_loop(link, np.array([1.1]), -1)
    add_velocities(state, omega)
    add_accelerations(state, alpha)
    start = (float(state.angle(3)[0]), float(state.angle(4)[0]))
    with mpmath.workdps(50):
        h = mpmath.mpf("1e-12")
        at = [newton(link, mpmath.mpf(1.1) + omega * t + alpha * t * t / 2, start) for t in (-h, mpmath.mpf(0), h)]
        for k, bar in enumerate((3, 4)):
            speed = (at[2][k] - at[0][k]) / (2 * h)
            growth = (at[2][k] - 2 * at[1][k] + at[0][k]) / h**2
            assert abs(state.omega(bar)[0] / speed - 1) < DIFFERENCES  # type: ignore[index]
            assert abs(state.alpha(bar)[0] / growth - 1) < DIFFERENCES  # type: ignore[index]


def test_mirror_image() -> None:
    """Mirrored at the ground line: angles change sign, and so does the branch."""
    up, down = close_loop(linkage(0.0), ANGLES, 1), close_loop(linkage(0.0), -ANGLES, -1)
    for bar in (3, 4):
        assert np.array_equal(up.angle(bar), -down.angle(bar))


@pytest.mark.parametrize("lengths", [(0.3, 0.1, 0.3, 0.1), (0.1, 0.3, 0.3, 0.1)], ids=["parallelogram", "kite"])
def test_parallel_bars_are_exact_beside_the_change_point(lengths: tuple[float, ...]) -> None:
    d, a, b, c = lengths
    link = fourbar.FourBar(d, fourbar.Bar(a), fourbar.Bar(b), fourbar.Bar(c))
    parallelogram = a == c
    for delta in (1e-8, 1e-4, 0.5):
        state = close_loop(link, np.array([math.pi - delta]), 1 if parallelogram else -1)
        add_velocities(state, 2.0)
        add_accelerations(state, 0.0)
        expected = (0.0, 2.0) if parallelogram else (2.0, 0.0)
        assert (state.omega(3)[0], state.omega(4)[0]) == expected  # type: ignore[index]
        assert (state.alpha(3)[0], state.alpha(4)[0]) == (0.0, 0.0)  # type: ignore[index]


def test_positions_that_cannot_close_are_nan_and_say_so() -> None:
    link = fourbar.uniform(1.0, 1.0, 0.4, 0.4)
    state = close_loop(link, np.array([0.5, 2.0]), 1)
    assert state.assembled.tolist() == [True, False]
    assert np.isnan(state.angle(3)).tolist() == [False, True]


@pytest.mark.parametrize(
    "lengths",  # no bars alike, or one pair: one alone never stays parallel
    [(0.5, 0.4, 0.3, 0.25), (0.5, 0.3, 0.4, 0.3), (0.5, 0.6, 0.5, 0.45), (0.5, 0.3, 0.3, 0.25), (0.5, 0.6, 0.45, 0.5)],
)
@pytest.mark.parametrize("offset", [1e-6, 1e-12, 1e-20, 1e-40])
def test_beyond_a_limit_nothing_assembles_however_near(lengths: tuple[float, ...], offset: float) -> None:
    d, a, b, c = lengths
    link = fourbar.FourBar(d, fourbar.Bar(a), fourbar.Bar(b), fourbar.Bar(c), 0.2)
    # the first limit ends the range in which the linkage closes, the second begins it
    for limit, inside in ((1, -1.0), (2, 1.0)):
        status = [
            fourbar.solve(fourbar.Scene(link, fourbar.Motion(fourbar.FromLimit(limit, side * offset), 1.0))).status
            for side in (inside, 0.0, -inside)
        ]
        assert status == [["ok"], ["singular"], ["not_assembled"]]


@pytest.mark.parametrize("offset", [1e-6, 1e-12, 1e-20])
def test_an_offset_from_a_limit_keeps_all_its_digits(offset: float) -> None:
    """Near a limit sin mu grows as the square root of the offset, however small."""
    link = fourbar.FourBar(0.5, fourbar.Bar(0.4), fourbar.Bar(0.3), fourbar.Bar(0.25), 0.2)
    with mpmath.workdps(60):
        D, A, B, C = (mpmath.mpf(x) for x in link.lengths)
        limit = mpmath.mpf(0.2) + mpmath.acos((A**2 + D**2 - (B + C) ** 2) / (2 * A * D))
        psi = limit - mpmath.mpf(offset) - mpmath.mpf(0.2)
        squared = A**2 + D**2 - 2 * A * D * mpmath.cos(psi)
        cosine = (B**2 + C**2 - squared) / (2 * B * C)
        sine = float(mpmath.sqrt(1 - cosine**2))
        theta_2 = float(limit) - offset
    remainder = limit_remainder(link, float(limit), theta_2, -offset)
    at = fourbar.scene.Command(np.array([theta_2]), np.array([1], np.int8), 1.0, 0.0, remainder)
    scene = fourbar.Scene(link, fourbar.Motion(theta_2, 1.0))
    solution = fourbar.solve(scene, at=at)
    assert isinstance(remainder, Decimal)
    assert abs(solution.sin_mu[0] / sine - 1.0) < 8 * EPS
    assert solution.status == ["ok"]
    assert solution.omega_3 is not None and np.isfinite(solution.omega_3).all()


STEP = 1e-4
"""s; a central difference then misses STEP^2 of the third derivative of positions that turn at 3 rad/s."""
BY_DIFFERENCES = 1e-5


@pytest.mark.parametrize("alpha", [0.0, 1.0, -7.0])
@pytest.mark.parametrize("theta_1", [0.0, 0.4])
@pytest.mark.parametrize("point", [(0.05, -0.02), (0.07, 0.0), (0.0, 1.0)])
def test_points_move_as_their_positions_do(point: tuple[float, float], theta_1: float, alpha: float) -> None:
    """Points of all bars as complex numbers; speeds and accelerations as differences of their positions."""
    link, omega = linkage(theta_1), 3.0
    angles = np.linspace(0.3, 6.0, 9)

    def at(t: float) -> fourbar.state.State:
        return close_loop(link, angles + omega * t + 0.5 * alpha * t * t, 1)

    state = at(0.0)
    add_velocities(state, omega)
    add_accelerations(state, alpha)
    d, a, b, _ = link.lengths
    e2, e3, e4 = (np.exp(1j * state.angle(bar)) for bar in (2, 3, 4))
    O4 = d * cmath.exp(1j * theta_1)
    first = {2: np.zeros(9), 3: a * e2, 4: np.full(9, O4)}
    pins = {"O2": first[2], "A": a * e2, "B": a * e2 + b * e3, "O4": first[4]}
    for name, place in pins.items():
        x, y = state.pin(name)
        assert x.shape == y.shape == (9,) and np.max(np.abs(x + 1j * y - place)) <= CLOSURE
    for bar, unit in ((2, e2), (3, e3), (4, e4)):
        arm, u = state.arm(bar, *point), state.unit(bar)
        assert np.max(np.abs(u[0] + 1j * u[1] - unit)) <= CLOSURE
        assert np.max(np.abs(arm[0] + 1j * arm[1] - complex(*point) * unit)) <= CLOSURE
        x, y = state.point(bar, *point)
        assert np.max(np.abs(x + 1j * y - (first[bar] + complex(*point) * unit))) <= CLOSURE
        ahead, back = (complex_of(at(t).point(bar, *point)) for t in (STEP, -STEP))
        assert complex_of(state.velocity(bar, *point)) == pytest.approx((ahead - back) / (2 * STEP), abs=BY_DIFFERENCES)
        bend = (ahead - 2.0 * complex_of((x, y)) + back) / STEP**2
        assert complex_of(state.acceleration(bar, *point)) == pytest.approx(bend, abs=BY_DIFFERENCES)
    with pytest.raises(KeyError, match="C"):
        state.pin("C")


def complex_of(vector: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    return vector[0] + 1j * vector[1]


def test_speeds_given_one_by_one_are_speeds_given_at_once() -> None:
    """Zero at every position, as a number or as an array, is the same motion; the ground does not move."""
    states = []
    for omega, alpha in ((3.0, 0.0), (np.full(5, 3.0), np.zeros(5)), (3, 0)):
        state = close_loop(linkage(), np.linspace(0.3, 6.0, 5), 1)
        add_velocities(state, omega)
        add_accelerations(state, alpha)
        states.append(state)
        assert state.omega(1) == 0.0 and state.alpha(1) == 0.0
    for state in states[1:]:
        for bar in (2, 3, 4):
            assert np.all(state.omega(bar) == states[0].omega(bar))
            assert np.all(state.alpha(bar) == states[0].alpha(bar))
            assert np.array_equal(state.acceleration(bar, 0.1, 0.2), states[0].acceleration(bar, 0.1, 0.2))


def test_what_was_not_evaluated_is_not_there() -> None:
    state = close_loop(linkage(), ANGLES, 1)
    with pytest.raises(AssertionError, match=r"^velocities were not evaluated$"):
        state.omega(3)
    with pytest.raises(AssertionError, match=r"^velocities come first$"):
        add_accelerations(state, 0.0)
    add_velocities(state, 1.0)
    with pytest.raises(AssertionError, match=r"^accelerations were not evaluated$"):
        state.alpha(4)


def test_the_cosine_at_B_is_that_of_the_two_bars() -> None:
    for lengths, branch in ((LENGTHS, 1), (LENGTHS, -1), ((0.3, 0.1, 0.3, 0.1), 1), ((0.1, 0.3, 0.3, 0.1), -1)):
        d, a, b, c = lengths
        state = close_loop(fourbar.FourBar(d, fourbar.Bar(a), fourbar.Bar(b), fourbar.Bar(c), 0.4), ANGLES, branch)
        ok = state.assembled
        expected = np.cos(state.angle(4) - state.angle(3))
        assert state.cos_mu[ok] == pytest.approx(expected[ok], abs=64 * EPS)
        assert state.sin_mu[ok] == pytest.approx(np.sin(state.angle(4) - state.angle(3))[ok], abs=1e-13)


def test_singular_positions_have_no_speed_and_their_neighbours_keep_theirs() -> None:
    link = fourbar.uniform(0.3, 0.1, 0.3, 0.1)
    theta_2 = np.array([0.0, 1.0, math.pi])
    state = close_loop(link, theta_2, 1)
    assert state.singular.tolist() == [True, False, True] and state.assembled.all()
    for regular, plain in ((state.regular_sine(), state.sin_mu), (state.regular_root(), state.signed_root)):
        assert np.isnan(regular).tolist() == [True, False, True] and regular[1] == plain[1]
    add_velocities(state, 2.0)
    add_accelerations(state, 5.0)
    assert np.isnan(state.omega(3)).tolist() == [True, False, True]  # type: ignore[arg-type]
    assert (state.omega(4)[1], state.alpha(4)[1], state.alpha(3)[1]) == (2.0, 5.0, 0.0)  # type: ignore[index]
    still = close_loop(link, theta_2, 1)
    add_velocities(still, 2.0)
    add_accelerations(still, 0.0)
    assert np.isnan(still.alpha(3)).tolist() == np.isnan(still.alpha(4)).tolist() == [True, False, True]  # type: ignore[arg-type]
    crank = close_loop(linkage(), ANGLES, 1)
    assert crank.regular_sine() is crank.sin_mu and not crank.singular.any()


@pytest.mark.parametrize("lengths", [(3, 1, 2, 2), (0.99, 0.97, 0.98, 0.98)])
def test_within_the_rounding_of_a_change_point_no_direction_is_left(lengths: tuple[float, ...]) -> None:
    theta_2 = math.pi + 2.0 * EPS * np.arange(5)  # the next doubles after pi
    state = close_loop(fourbar.uniform(*lengths), theta_2, 1)
    assert (state.sin_mu > 0.0).all() and (state.sin_mu < 8.0 * EPS).all()
    assert state.singular.all() and np.isnan(state.regular_sine()).all()
    assert not close_loop(fourbar.uniform(*lengths), theta_2 + 1e-13, 1).singular.any()


def test_branches_may_differ_from_position_to_position() -> None:
    branches = np.where(np.arange(41) % 3 == 0, -1, 1).astype(np.int8)
    mixed = close_loop(linkage(), ANGLES, branches)
    add_velocities(mixed, 2.0)
    add_accelerations(mixed, 1.0)
    for branch in (1, -1):
        alone = close_loop(linkage(), ANGLES, branch)
        add_velocities(alone, 2.0)
        add_accelerations(alone, 1.0)
        which = branches == branch
        for bar in (3, 4):
            assert np.array_equal(mixed.angle(bar)[which], alone.angle(bar)[which])
            assert np.array_equal(mixed.omega(bar)[which], alone.omega(bar)[which])  # type: ignore[index]
            assert np.array_equal(mixed.alpha(bar)[which], alone.alpha(bar)[which])  # type: ignore[index]
    assert np.array_equal(mixed.branch, branches)
    assert close_loop(linkage(), ANGLES, -1).branch.dtype == np.int8


@pytest.mark.parametrize("centre", [(0.3, 0.0), (0.3, 1.0), (0.3, -2.5), (0.0, 0.0)])
def test_a_mass_centre_in_the_frame_of_its_bar(centre: tuple[float, float]) -> None:
    place = fourbar.state.centre_in_bar(fourbar.Bar(0.2, 1.0, 0.1, centre))
    assert complex(*place) == pytest.approx(cmath.rect(*centre), abs=EPS)
    assert place[1] == 0.0 or centre[1] != 0.0
    assert all(type(part) is float for part in place)


@pytest.mark.parametrize(
    ("lengths", "branch"), [((0.3, 0.1, 0.3, 0.1), 1), ((0.1, 0.3, 0.3, 0.1), -1), ((0.2, 0.2, 0.2, 0.2), 1)]
)
@pytest.mark.parametrize("half_turn", [0, 1])
@pytest.mark.parametrize("theta_1", [0.0, 0.4])
def test_pairs_that_stay_parallel_keep_the_directions_of_ground_and_input(
    lengths: tuple[float, ...], branch: int, half_turn: int, theta_1: float
) -> None:
    """A parallelogram's coupler lies as its ground and bar 4 as bar 2; a folded kite has B on O2."""
    d, a, b, c = lengths
    link = fourbar.FourBar(d, fourbar.Bar(a), fourbar.Bar(b), fourbar.Bar(c), theta_1)
    theta_2 = theta_1 + math.pi * half_turn + np.array([1e-9, 0.5, 2.0])
    branch = -branch if half_turn else branch
    state = close_loop(link, theta_2, branch)
    add_velocities(state, 2.0)
    add_accelerations(state, 3.0)
    u1 = (math.cos(theta_1), math.sin(theta_1))
    together = a == c
    expected = (
        ((u1, state.u2), (0.0, 2.0), (0.0, 3.0))
        if together
        else ((tuple(-x for x in state.u2), tuple(-x for x in u1)), (2.0, 0.0), (3.0, 0.0))
    )
    for k, bar in enumerate((3, 4)):
        for i in (0, 1):
            assert state.unit(bar)[i] == pytest.approx(np.broadcast_to(expected[0][k][i], 3), abs=EPS)
        assert np.array_equal(state.omega(bar), np.full(3, expected[1][k]))
        assert np.array_equal(state.alpha(bar), np.full(3, expected[2][k]))
    # between the bars: the angle of input and ground
    assert np.abs(state.sin_mu) == pytest.approx(np.abs(np.sin(theta_2 - theta_1)), rel=8 * EPS, abs=2 * EPS)


@pytest.mark.parametrize("alpha", [0.0, 5.0])
def test_what_has_room_is_written_there(alpha: float) -> None:
    plain, placed = close_loop(linkage(), ANGLES, 1), close_loop(linkage(), ANGLES, 1)
    room = {name: np.empty(41) for name in ("omega_3", "omega_4", "alpha_3", "alpha_4")}
    add_velocities(plain, 2.0)
    add_accelerations(plain, alpha)
    add_velocities(placed, 2.0, room)
    add_accelerations(placed, alpha, room)
    for name, array in room.items():
        assert getattr(placed, name) is array and np.array_equal(array, getattr(plain, name))
    into = np.empty(41)
    assert plain.angle(3, into) is into and np.array_equal(into, placed.angle(3))


def test_a_kite_whose_A_lies_on_O4_has_no_speed_there_and_no_warning() -> None:
    """a = d, b = c: at theta_2 = theta_1 bars 3 and 4 lie on each other and turn freely."""
    link = fourbar.uniform(0.3, 0.3, 0.2, 0.2)
    for branch in (1, -1):
        state = close_loop(link, np.array([0.0, 0.5]), branch)
        add_velocities(state, 2.0)
        add_accelerations(state, 3.0)
        for value in (state.omega(3), state.omega(4), state.alpha(3), state.alpha(4)):
            assert np.isfinite(value).tolist() == [False, True]  # type: ignore[arg-type]


@pytest.mark.parametrize("theta_1", [0.0, 0.4, -2.5])
@pytest.mark.parametrize("branch", [1, -1])
def test_a_kite_whose_A_lies_on_O4_lies_where_its_neighbours_do(branch: int, theta_1: float) -> None:
    """As theta_2 falls to theta_1 bars 3 and 4 come to lie on the ground's line, both the same way."""
    link = fourbar.FourBar(0.3, fourbar.Bar(0.3), fourbar.Bar(0.2), fourbar.Bar(0.2), theta_1)
    beside = 2.0**-30
    # on it, and so near that e^2 leaves the range of doubles
    for psi, towards in ((0.0, 1.0), *((side * psi, side) for psi in (1e-170, 1e-157) for side in (1.0, -1.0))):
        if psi != 0.0 and theta_1 != 0.0:
            continue
        on, near = (close_loop(link, theta_1 + np.array([psi, 0.5]), branch) for psi in (psi, towards * beside))
        for bar in (3, 4):
            for ours, limit in zip(on.unit(bar), near.unit(bar), strict=True):
                assert ours == pytest.approx(limit, abs=2.0 * beside)
        assert on.singular.tolist() == [True, False]
        add_velocities(on, 2.0)
        add_accelerations(on, 3.0)
        assert np.isnan(on.omega(3)).tolist() == np.isnan(on.alpha(4)).tolist() == [True, False]  # type: ignore[arg-type]
    # with b and c unlike each other nothing closes there
    assert not close_loop(fourbar.uniform(0.3, 0.3, 0.2, 0.25), np.zeros(1), branch).assembled.any()


def test_beside_parallel_bars_mu_is_the_angle_of_the_input_to_the_last_bit() -> None:
    """Bars 3 and 4 of a parallelogram lie as its ground and input do: so does the angle between them."""
    link = fourbar.uniform(0.3, 0.1, 0.3, 0.1)
    state = close_loop(link, np.linspace(0.01, 3.1, 200), 1)
    assert np.array_equal(state.sin_mu, state.u2[1]) and np.array_equal(state.cos_mu, state.u2[0])
    # 8 EPS has no digit left, the next double has
    assert close_loop(link, np.array([8.0 * EPS, 8.0 * EPS * (1.0 + EPS)]), 1).singular.tolist() == [True, False]


def test_short_ground_and_input_leave_no_digit_of_mu() -> None:
    """b = c, d and a a billiardth of them: mu = e/b, and A passes O4 so near that 8 EPS is reached."""
    b, psi = 0.9, np.linspace(0.0, 2.0 * math.pi, 41)
    for least, most in ((0.7, 2.0), (0.02, 0.03), (1.1, 1.3)):
        d, a = (4.0 * EPS * b * part for part in (most + least, most - least))
        state = close_loop(fourbar.uniform(d, a, b, b), psi, 1)
        e = np.abs(d - a * np.exp(1j * psi))
        assert state.assembled.all() and np.array_equal(state.singular, e / b <= 8.0 * EPS)
        add_velocities(state, 2.0)
        assert np.array_equal(np.isnan(state.omega(3)), state.singular)
        motion = fourbar.Motion(psi, 2.0)
        status = fourbar.solve(fourbar.Scene(state.linkage, motion)).status
        assert [each == "singular" for each in status] == state.singular.tolist()
