"""Vectors, angles and places of a drawing."""

import math

from pytest import approx

import fourbar
from fourbar.scene.drawing import DrawnPins

DRAWING = DrawnPins((1.0, 2.0), (1.5, 3.0), (4.0, 3.5), (5.0, 1.5))


def test_a_place_goes_into_a_bar_and_back():
    for bar in (1, 2, 3, 4):
        z = DRAWING.into_bar(bar, (3.0, 0.5))
        assert DRAWING.from_bar(bar, z) == approx(3.0 + 0.5j)
        place = fourbar.Place(bar, (abs(z), math.atan2(z.imag, z.real)))
        assert DRAWING.from_bar(bar, place.vector()) == approx(3.0 + 0.5j)
