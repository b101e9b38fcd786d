"""Laws of the error and what is concluded from them.

The points follow a stated law.
"""

import math
from dataclasses import replace

from pytest import approx, mark

from fourbar_validation.advise.matters import ERROR_NAMES
from fourbar_validation.cost.laws import (
    ErrorLaw,
    find_cheapest,
    find_floor,
    find_pareto,
    fit_laws,
)
from tests.support.costs import point

STEPS = [40.0 * 2**k for k in range(6)]


@mark.parametrize("order, holds", [(4.0, True), (3.8, True), (3.5, False)])
def test_a_law_holds_within_a_third_of_an_order(order, holds):
    ladder = [point(n, 1e-2 * (STEPS[0] / n) ** order) for n in STEPS]
    law, *others = fit_laws({"RK4, tc held": ladder})
    assert [one.quantity for one in (law, *others)] == list(ERROR_NAMES)
    assert law.exponent == approx(order, abs=1e-6) and law.expected == 4.0
    assert law.decided and law.holds == holds == ("FAILS" not in str(law))


def test_a_law_with_a_jump_does_not_hold_whatever_its_slope():
    law = ErrorLaw("RK4", "F12", 4.0, 0.01, 4.0, 6, jumps=("at 320",))
    assert law.decided and not law.holds
    assert replace(law, jumps=()).holds


def test_a_floor_is_the_last_error_that_twice_the_steps_do_not_lessen():
    falling = [point(n, 1.0 / n) for n in STEPS]
    assert find_floor(falling, "torque") is None
    floored = [*falling, point(2560.0, 0.9 / STEPS[-1])]
    assert find_floor(floored, "torque") == approx(0.9 / STEPS[-1])
    assert find_floor([*falling, point(2560.0, math.inf)], "torque") is None


def test_the_cheapest_within_an_error_is_judged_by_the_quantity_that_is_asked():
    cheap = point(40.0, 1e-7)
    cheap = replace(cheap, errors=cheap.errors._replace(F43=1e-3))
    dear = point(400.0, 1e-7)
    curves = {"RK4": [cheap, dear]}
    assert find_cheapest(curves, "torque", 1e-6) is cheap
    assert find_cheapest(curves, "force", 1e-6) is dear
    assert find_cheapest(curves, "force", 1e-9) is None


def test_nothing_on_the_front_is_beaten_in_cost_and_error():
    points = [
        point(10.0, 1e-3),
        point(20.0, 1.5e-3),
        point(30.0, 1e-5),
        point(35.0, 1e-5),
        point(40.0, math.nan),
        point(50.0, 1e-4),
    ]
    assert [p.steps for p in find_pareto(points, "F12")] == [10, 30]
