"""Assemblies through change points against circles that meet, followed step by step."""

import itertools
import math
from math import hypot, pi

import numpy as np
import pytest

import fourbar
from fourbar.formulas.mobility import turns_fully
from fourbar.linkage import uniform

LINKAGES = {
    "parallelogram": (0.3, 0.1, 0.3, 0.1),
    "kite with A on O4": (0.3, 0.3, 0.2, 0.2),
    "kite with B on O2": (0.2, 0.3, 0.3, 0.2),
    "rhombus": (0.2, 0.2, 0.2, 0.2),
    "change-point crank": (4.0, 1.0, 2.0, 3.0),
    "change-point rocker": (2.0, 4.0, 3.0, 1.0),
    "change-point drag link": (1.0, 2.0, 4.0, 3.0),
    "equal coupler and output": (3.0, 1.0, 2.0, 2.0),
    "computed": (
        hypot(3.1, 0.7),
        hypot(1.3, 0.2),
        hypot(3.1, 0.7),
        hypot(1.3, 0.2),
    ),
}
STEP = math.radians(1.5)
TURNS = 3
GROUND_ANGLE = -7.0
ALLOWED = 1e-12
"""rad; 0.7 deg from a change point the intersection of circles in long doubles loses
five digits of nineteen.
"""


def intersect_circles(linkage, bar, q):
    """The two places of the free pin at each angle of a bar, complex (n, 2).

    The angles of the other two bars are returned too. The bar's far end P and the far
    end of the others' common chain are the centres of two circles.
    """
    d, a, b, c = linkage.lengths
    O4 = d * np.exp(1j * np.longdouble(linkage.ground_angle))
    unit = np.exp(1j * q.astype(np.longdouble))
    # centre and radius of both circles, and the angles that follow from the pin where
    # they meet
    if bar == 2:
        first, r, second, s = a * unit, b, O4 + 0 * unit, c
    elif bar == 3:
        first, r, second, s = 0 * unit, a, O4 - b * unit, c  # A
    else:
        first, r, second, s = 0 * unit, a, O4 + c * unit, b  # A
    apart = second - first
    e2 = np.abs(apart) ** 2
    along = (e2 + r * r - s * s) / (2 * e2)
    square = r * r / e2 - along * along
    across = np.sqrt(np.where(square < 0, np.nan, square))
    meet = np.stack(
        [first + apart * (along + sign * 1j * across) for sign in (1, -1)],
        axis=1,
    )
    if bar == 2:
        others = meet - first[:, None], meet - second[:, None]  # bars 3 and 4 to B
    elif bar == 3:
        others = meet, meet - second[:, None]  # bar 2 to A; bar 4 as O4 - b u3 to A
    else:
        others = meet, second[:, None] - meet  # bar 2 to A, bar 3 from A to B
    return meet, np.angle(np.stack(others).astype(complex))


def follow(places, start):
    """Follow one of two points through a table (n, 2) by linear extrapolation.

    The index in each row.
    """
    chosen = [start, start]
    for row in range(2, len(places)):
        ahead = 2 * places[row - 1, chosen[-1]] - places[row - 2, chosen[-2]]
        chosen.append(int(np.argmin(np.abs(places[row] - ahead))))
    return np.array(chosen)


def list_angles(linkage, bar):
    """Angles over three turns from the first quarter, between all change points."""
    first = linkage.ground_angle + (pi if bar == 4 else 0.0) + math.radians(45.7)
    return first + STEP * np.arange(round(TURNS * 2 * pi / STEP))


@pytest.mark.parametrize("bar", [2, 3, 4])
@pytest.mark.parametrize("lengths", LINKAGES.values(), ids=LINKAGES)
def test_an_assembly_goes_on_smoothly_through_change_points(lengths, bar):
    bars = uniform(*lengths)
    linkage = fourbar.FourBar(
        bars.ground, bars.input, bars.coupler, bars.output, GROUND_ANGLE
    )
    if not turns_fully(linkage, bar):
        pytest.skip("the bar has limits")
    compared = 0
    for backwards, branch in itertools.product((False, True), (1, -1)):
        q = list_angles(linkage, bar)
        q = 2 * q[0] - q if backwards else q
        motion = fourbar.Motion(
            **{f"theta_{bar}": q, f"omega_{bar}": 1.0},
            branch=branch,
        )
        ours = fourbar.solve(fourbar.Scene(linkage, motion), "velocity")
        places, angles = intersect_circles(linkage, bar, q)
        # the sine's sign in the first half turn is the assembly's name
        free = [number for number in (2, 3, 4) if number != bar]
        first, second = angles[:, 0, 0], angles[:, 0, 1]
        sines = {side: math.sin(x[1] - x[0]) for side, x in ((0, first), (1, second))}
        start = next(side for side, sine in sines.items() if sine * branch > 0.0)
        chosen = follow(places, start)
        rows = np.arange(len(q))
        for index, number in enumerate(free):
            theirs = angles[index][rows, chosen]
            gap = np.angle(np.exp(1j * (getattr(ours, f"theta_{number}") - theirs)))
            assert np.abs(gap).max() <= ALLOWED * abs(GROUND_ANGLE)
        for number in free:
            # speeds run on: a corner would be a jump of the size of the speed
            speed = getattr(ours, f"omega_{number}")
            assert np.abs(np.diff(speed)).max() <= 0.2 * max(1.0, np.abs(speed).max())
        compared += len(q)
    assert compared == 4 * round(TURNS * 2 * pi / STEP)
