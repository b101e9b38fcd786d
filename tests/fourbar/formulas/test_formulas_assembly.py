"""Assemblies through change points close the loop and go on smoothly."""

import itertools
from math import pi, radians, sin

import numpy as np
from pytest import mark, skip

from fourbar import Motion, Scene, solve
from fourbar.formulas.mobility import turns_fully
from tests.support.rows import read_rows
from tests.support.scenes import bare, cis

LINKAGES = read_rows("""
parallelogram | 0.3 0.1 0.3 0.1
kite with A on O4 | 0.3 0.3 0.2 0.2
kite with B on O2 | 0.2 0.3 0.3 0.2
rhombus | 0.2 0.2 0.2 0.2
change-point crank | 4 1 2 3
change-point rocker | 2 4 3 1
change-point drag link | 1 2 4 3
equal coupler and output | 3 1 2 2
of roots | 3.1780497164141406 1.3152946437965907 3.1780497164141406 1.3152946437965907
""")
STEP = radians(1.5)
GROUND_ANGLE = -7.0
CLOSED = 1e-14
"""Of the sum of the lengths: some twenty roundings of angles of several turns."""


@mark.parametrize("bar", [2, 3, 4])
@mark.parametrize("name, lengths", LINKAGES)
def test_an_assembly_goes_on_smoothly_through_change_points(name, lengths, bar):
    """Over three turns from the first quarter, between all change points."""
    linkage = bare(*map(float, lengths.split()), GROUND_ANGLE)
    if not turns_fully(linkage, bar):
        skip("the bar has limits")
    first = GROUND_ANGLE + (pi if bar == 4 else 0.0) + radians(45.7)
    turns = STEP * np.arange(round(3 * 2 * pi / STEP))
    for q, branch in itertools.product((first + turns, first - turns), (1, -1)):
        rates = {f"theta_{bar}": q, f"omega_{bar}": 1.0}
        ours = solve(Scene(linkage, Motion(**rates, branch=branch)), "velocity")
        d, a, b, c = linkage.lengths
        u2, u3, u4 = (cis(ours[f"theta_{number}"]) for number in (2, 3, 4))
        gap = a * u2 + b * u3 - d * cis(GROUND_ANGLE) - c * u4
        assert abs(gap).max() <= CLOSED * sum(linkage.lengths)
        # the sine's sign in the first half turn is the assembly's name
        first, second = (ours[f"theta_{k}"][0] for k in (2, 3, 4) if k != bar)
        assert sin(second - first) * branch > 0.0
        for number in (2, 3, 4):
            # speeds run on: a corner would be a jump of the size of the speed
            speed = ours[f"omega_{number}"]
            assert abs(np.diff(speed)).max() <= 0.2 * max(1.0, abs(speed).max())
            # and they are those of the angles: none changes over to the other assembly
            turned = np.diff(ours[f"theta_{number}"])
            mean = 0.5 * np.diff(q)[0] * (speed[1:] + speed[:-1])
            assert abs(turned - mean).max() <= 0.1 * STEP
