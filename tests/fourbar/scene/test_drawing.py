"""Vectors, angles and places of a drawing."""

import math

from pytest import approx, mark

from fourbar import DrawnPins

DRAWING = DrawnPins((1.0, 2.0), (1.5, 3.0), (4.0, 3.5), (5.0, 1.5))


def test_a_place_goes_into_a_bar_and_back():
    for bar in (1, 2, 3, 4):
        z = DRAWING.into_bar(bar, (3.0, 0.5))
        assert DRAWING.from_bar(bar, z) == approx(3.0 + 0.5j)


@mark.parametrize("turn", [-3.1, -1.0, 0.4, 2.0, 3.1])
def test_theta_2_is_within_half_a_turn_of_the_ground(turn):
    for angle in (-3.0, -1.0, 0.1, 3.0):
        O4, A, B = (
            (r * math.cos(t), r * math.sin(t))
            for r, t in ((3.0, turn), (1.0, turn + angle), (2.0, turn + 0.5 * angle))
        )
        drawing = DrawnPins((0.0, 0.0), A, B, O4)
        assert drawing.angle(2) - drawing.angle(1) == approx(angle, abs=1e-14)


def test_a_text_has_a_unit():
    drawing = DrawnPins(("0 in", 0), ("0 in", "1 in"), ("2 in", "1 in"), ("3 in", 0))
    assert drawing.length(2) == 0.0254
