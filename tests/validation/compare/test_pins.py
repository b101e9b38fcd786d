"""Places stated from the first pins of their bars, judged without the formulas'
conversion of them.
"""

import numpy as np

from fourbar import Load, Point, solve
from fourbar.effects import Place
from fourbar_validation.compare.scales import TermSizes
from tests.support.scenes import crank_rocker

LOADED = crank_rocker(
    loads=(
        Load(4, (3.0, 0.7), from_centre=(0.05, 1.0)),
        Load(3, (2.0, -1.4), point="P"),
    ),
    points=(Point("P", 3, from_centre=(0.04, -2.0)),),
)


def test_a_place_that_the_formulas_misread_widens_nothing(monkeypatch):
    """With places from G far away, a torque would be allowed to be as far off."""
    solution = solve(LOADED)

    def sum_terms():
        names = ("F12", "torque")
        return [TermSizes(LOADED, solution).sum_terms(name) for name in names]

    sizes, polar = sum_terms(), Place.polar_from_pin

    def misread(place):
        distance, angle = polar(place)
        return (distance if place.from_centre is None else 1e8 * distance), angle

    monkeypatch.setattr(Place, "polar_from_pin", misread)
    np.testing.assert_array_equal(sum_terms(), sizes)
