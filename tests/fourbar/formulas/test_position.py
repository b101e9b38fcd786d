"""Directions and coefficients of every reading against circles in many digits."""

from pytest import approx, mark

from fourbar import uniform
from fourbar.formulas.motion import coefficients, take_sines_of_rates
from fourbar.formulas.path import compute_state, drive_sine_of_triangle
from fourbar.formulas.position import close_loop, direction, half_angle, loop
from tests.support.balls import move_in_balls
from tests.support.rows import each_branch, read_rows
from tests.support.scenes import EPS, bare, cis

FEW_ROUNDINGS = 8.0 * EPS
"""Of 1 + |h3| + |h4|, which the coefficients are sums of; their slopes are quotients of
these and h.
"""
DRIVEN = {2: (3, 4), 3: (2, 4), 4: (2, 3)}
"""The two bars whose sine a drive on a bar is divided by."""


@mark.parametrize(
    "stated, psi, sign",
    read_rows("""
# d, a, b, c, psi and the sign of the root: d - a = +-(b - c) exactly, so the diagonal
# turns fast and the bars do not
0.859375 0.853515625 0.58984375 0.583984375 | -0.0018 | -1
0.859375 0.853515625 0.58984375 0.583984375 | 0.0018 | 1
0.859375 0.853515625 0.583984375 0.58984375 | 0.0018 | -1
0.859375 0.853515625 0.583984375 0.58984375 | 0.0018 | 1
0.853515625 0.859375 0.58984375 0.583984375 | 0.0018 | -1
0.853515625 0.859375 0.58984375 0.583984375 | 0.0018 | 1
0.853515625 0.859375 0.583984375 0.58984375 | -0.0005 | -1
0.8125 0.810546875 0.140625 0.138671875 | 0.0008 | 1
0.75 0.71875 0.53125 0.5 | 0.01 | 1
"""),
)
def test_digits_are_kept_where_the_diagonal_is_short(stated, psi, sign):
    """With E2 = 0 the assembly of this sign of the root changes at psi = 0."""
    lengths = [float(length) for length in stated.split()]
    psi, sign = float(psi), int(sign)
    assembly = sign if psi > 0.0 else -sign
    k = compute_state(uniform(*lengths), psi, assembly).k
    exact = move_in_balls(uniform(*lengths), 2, psi, sign)
    h3, h4 = exact["omega_3"], exact["omega_4"]
    size = FEW_ROUNDINGS * float(1 + abs(h3) + abs(h4))
    for ours, theirs in ((k.h3, h3), (k.h4, h4), (k.h23, 1 - h3), (k.h43, h4 - h3)):
        assert abs(theirs - float(ours)) < size
    for ours, theirs in ((k.dh3, exact["alpha_3"]), (k.dh4, exact["alpha_4"])):
        assert abs(theirs - float(ours)) < size / abs(psi)

    bars, half = loop(*lengths), half_angle(loop(*lengths), psi)
    for theta_1 in (0.0, 0.4):
        u1 = complex(cis(theta_1))
        plain = close_loop(bars, u1, direction(psi) * u1, half, assembly)
        corrected = take_sines_of_rates(bars, plain, coefficients(bars, plain))
        for name, of in (("u3", exact["u_3"]), ("u4", exact["u_4"])):
            ours = getattr(corrected, name)
            for right in (of * u1, getattr(plain, name)):
                assert abs(ours - right) < FEW_ROUNDINGS / abs(psi)
            if theta_1 == 0.0:  # a small sine has all its digits
                assert ours.imag == approx(of.imag, rel=4.0 * FEW_ROUNDINGS)


@mark.parametrize("drive", [3, 4])
@each_branch
def test_the_sine_of_the_drive_keeps_its_digits_on_a_short_ground(branch, drive):
    lengths = loop(2.0**-14, 1.5, 0.75, 1.25)
    half = half_angle(lengths, 0.7)
    position = close_loop(lengths, 1.0, direction(0.7), half, branch)
    exact = move_in_balls(bare(*lengths[:4]), 2, 0.7, branch)
    i, j = (exact[f"theta_{number}"] for number in DRIVEN[drive])
    computed = drive_sine_of_triangle(lengths, position, drive)
    assert computed == approx(float((j - i).sin()), rel=8.0 * EPS)
