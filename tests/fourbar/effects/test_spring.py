"""Where a spring has no value.

The status says so, there are no forces, and every engine says the same.
"""

from dataclasses import replace
from math import pi

import numpy as np
from pytest import mark

from fourbar import (
    Motion,
    PinFriction,
    Place,
    Scene,
    Spring,
    Springs,
    Torsion,
    solve,
    uniform,
)
from fourbar.formulas.mobility import choose_range
from fourbar.linkage import PINS
from fourbar.quantities import CHANGE_POINT, WOUND
from fourbar_validation.run.judge import judge
from tests.support.rows import read_rows, slow_but
from tests.support.scenes import UNIFORM

EDGE = 1e-9
"""rad; nearer than this to half a turn rounding may put a position on either side."""


def test_a_spring_whose_ends_meet_once_loses_that_position_alone():
    spring = Spring(Place(1, (0.1, 0.5)), Place(2, (0.1, 0.0)), 200.0, 0.05)
    motion = Motion([0.3, 0.5, 0.5 + 1e-9, 0.7], 8.0)
    for others in ((), (PinFriction.at(O2=(0.2, 0.01)),)):
        effects = (*others, Springs((spring,)))
        solution = solve(Scene(UNIFORM, motion, effects=effects))
        assert solution.status == ["ok", "no_direction", "ok", "ok"]
        assert list(np.isnan(solution.torque)) == [False, True, False, False]


def continuous(scene, pin):
    """theta_j - theta_i along a sweep, each position from the one before."""
    solution = solve(scene, "position")
    angle = {1: scene.linkage.ground_angle, 2: solution.theta_2}
    angle |= {3: solution.theta_3, 4: solution.theta_4}
    i, j = PINS[pin]
    between = angle[j] - angle[i]
    finite = np.isfinite(between)
    between[finite] = np.unwrap(between[finite])
    return between


def test_where_the_loop_closes_between_the_positions_alone_no_spring_begins():
    scene = Scene(
        uniform(0.25, 0.22, 0.3, 0.1),
        Motion([0.3, 2.6], 5.0),
        effects=(Torsion.at(B=(2.0, 0.3, 0.1)),),
    )
    record = judge("scene", scene)
    assert set(solve(scene).status) == {"not_assembled"}
    assert [row for row in record.rows if row.failed] == []


COUNTED = read_rows("""
crank-rocker | 0.3 0.1 0.25 0.22
drag link | 0.1 0.25 0.3 0.28
double rocker | 0.25 0.22 0.1 0.3
triple rocker | 0.4 0.25 0.25 0.28
parallelogram | 0.3 0.1 0.3 0.1
parallelogram with a short ground | 0.1 0.3 0.1 0.3
kite, a = d | 0.2 0.2 0.3 0.3
kite, a = b | 0.2 0.1 0.1 0.2
kite with a short ground | 0.1 0.2 0.2 0.1
rhombus | 0.1 0.1 0.1 0.1
b + c = a + d | 0.1 0.2 0.25 0.05
d + b = a + c | 0.1 0.2 0.25 0.15
d + c = a + b | 0.1 0.2 0.15 0.25
a rocker that passes a change point | 0.3 0.1 0.25 0.05
crank as the output | 0.3 0.22 0.25 0.1
""")
"""Ground, input, coupler, output, m."""


@mark.parametrize("bar", (2, 3, 4))
@mark.parametrize("branch", slow_but({-1}, (1, -1)))
@mark.parametrize("name, lengths", COUNTED)
def test_turns_are_counted_whichever_bar_is_commanded(name, lengths, branch, bar):
    """A spring winds as its pin turns along an assembly, in any order of positions."""
    link = replace(uniform(*map(float, lengths.split())), ground_angle=0.4)
    least, most = choose_range(link, bar)
    if most - least > 2.0 * pi - 1e-6:
        most = least + 4.0 * pi
    angles = np.linspace(least + 0.03, most - 0.03, 2001)
    some = np.r_[0, np.random.default_rng(5).permutation(np.arange(10, 2001, 10))]
    rates = {f"omega_{bar}": 5.0, "branch": branch}
    scene = Scene(link, Motion(**{f"theta_{bar}": angles}, **rates))
    shuffled = Scene(link, Motion(**{f"theta_{bar}": angles[some]}, **rates))
    assert (solve(scene, "velocity").status_code == 0).any()
    for pin in PINS:
        between = continuous(scene, pin)
        for rest in between[0] + np.array([-3.0, 1.0, 6.0 * pi]):
            spring = Torsion.at(**{pin: (2.0, rest, 0.1)})
            solution = solve(replace(shuffled, effects=(spring,)), "force")
            from_start = 2.0 * pi * round((between[0] - rest) / (2.0 * pi))
            away = abs(between[some] - rest - from_start)
            sure = abs(away - pi) > EDGE
            sure &= solution.status_code != CHANGE_POINT
            wound = solution.status_code[sure] == WOUND
            assert np.array_equal(wound, away[sure] > pi), (pin, rest)
            assert np.isnan(solution.torque[solution.status_code == WOUND]).all()
