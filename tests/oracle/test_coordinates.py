"""Coordinates that move are those of a file whose drawing is moved by hand."""

import numpy as np
import pytest

import fourbar
from fourbar.files import dump, loads
from fourbar_validation.places import MODELS
from tests.oracle.coordinates import is_coordinate
from tests.oracle.variants import SceneFile, ask_free_bodies

DRAWN = MODELS / "capabilities" / "drawn.toml"
ROUNDING = 1e-13
"""Relative: both files state lengths and angles rounded by functions of their own, at
conditions above 0.8.
"""
PIN_MOVES = {
    "pins.O2.0": ('O2 = ["0.04 m", ', 'O2 = ["0.041 m", ', 1e-3),
    "pins.A.1": ('"0.095 m", "0.06 m"', '"0.095 m", "0.058 m"', -2e-3),
    "pins.B.0": ('B = ["0.33 m", ', 'B = ["0.333 m", ', 3e-3),
    "pins.O4.1": ('"0.345 m", "-0.06 m"', '"0.345 m", "-0.059 m"', 1e-3),
}
"""Coordinate, its pin before and after as a written file has it, difference, m."""
PLACE_MOVES = {
    "bars.coupler.centre.drawn.0": ('"210 mm", "135 mm"', '"212 mm", "135 mm"', 2e-3),
    "bars.output.centre.drawn.1": ('"325 mm", "50 mm"', '"325 mm", "47 mm"', -3e-3),
    "points.P.drawn.1": ('"180 mm", "190 mm"', '"180 mm", "194 mm"', 4e-3),
    "loads.1.drawn.0": ('"360 mm", "90 mm"', '"361 mm", "90 mm"', 1e-3),
    # on O2, where a distance has no angle: the place leaves the pin
    "effects.springs.0.from.drawn.1": (
        'drawn = ["40 mm", "-25 mm"]',
        'drawn = ["40 mm", "-30 mm"]',
        -5e-3,
    ),
    "effects.springs.0.to.drawn.1": (
        '"250 mm", "180 mm"',
        '"250 mm", "182 mm"',
        2e-3,
    ),
}
"""Coordinate, its place before and after as the file has it, difference, m."""


def replace_in(text, before, after):
    assert text.count(before) == 1
    return text.replace(before, after)


def assert_alike(one, other):
    """Hold what free bodies answer of two scenes against each other."""
    answers = [ask_free_bodies(scene).quantities for scene in (one, other)]
    for name in ("theta_3", "theta_4", "G3", "G4", "F12", "F43", "torque"):
        np.testing.assert_allclose(
            answers[0][name],
            answers[1][name],
            rtol=ROUNDING,
            atol=ROUNDING * float(np.abs(answers[1][name]).max()),
            err_msg=name,
        )


def test_every_coordinate_is_found_where_it_is_drawn():
    scene = fourbar.load(DRAWN)
    keys = [key for key in fourbar.sensitivity(scene).keys if is_coordinate(key)]
    stated = SceneFile(scene).find_stated(keys)
    # four pins, two mass centres, two points, a load, both ends of a spring
    assert list(stated) == keys and len(keys) == 22
    for key, place in (
        ("pins.B.1", 0.150),
        ("points.P.drawn.0", 0.180),
        ("bars.output.centre.drawn.1", 0.050),
        ("effects.springs.0.from.drawn.1", -0.025),
        ("effects.springs.0.to.drawn.0", 0.250),
    ):
        assert stated[key].number == pytest.approx(place, rel=1e-14)


@pytest.mark.parametrize("key", PIN_MOVES)
def test_a_moved_pin_is_that_of_the_file_with_places_on_their_bars(key):
    before, after, change = PIN_MOVES[key]
    scene = fourbar.load(DRAWN)
    by_hand = loads(replace_in(dump(scene), before, after))
    file = SceneFile(scene)
    assert_alike(file.move({key: change}), by_hand)
    assert by_hand.drawing is not None
    origin = complex(*by_hand.drawing.O2)
    assert file.find_origin({key: change}) == pytest.approx(origin, rel=1e-15)


@pytest.mark.parametrize("key", PLACE_MOVES)
def test_a_moved_place_is_that_of_the_drawing(key):
    before, after, change = PLACE_MOVES[key]
    text = DRAWN.read_text(encoding="utf-8")
    by_hand = loads(replace_in(text, before, after))
    moved = SceneFile(fourbar.load(DRAWN)).move({key: change})
    assert_alike(moved, by_hand)
    name, _, _ = key.partition(".drawn.")
    if name == "points.P":
        here = fourbar.solve(moved, "position").points["P"]
        there = fourbar.solve(by_hand, "position").points["P"]
        np.testing.assert_allclose(here, there, rtol=ROUNDING)
