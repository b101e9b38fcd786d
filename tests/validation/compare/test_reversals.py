"""Where dry friction reverses, engines are judged on both sides of it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fourbar import Bar, FourBar, Friction, Scene, solve
from fourbar.scene.motion import Motion, Sweep
from fourbar_validation.compare.reversals import mark_reversing
from fourbar_validation.run.judge import judge
from tests.support.here import EXACT

D, A, B, C = 0.3, 0.1, 0.25, 0.22
FRICTION = 0.5
LINKAGE = FourBar(D, Bar(A, 0.2), Bar(B, 0.5), Bar(C, 0.4))


def scene(pin, start=0.1):
    motion = Motion(Sweep(start, start + 2 * math.pi, 36), 10.0)
    return Scene(LINKAGE, motion, effects=(Friction.at(**{pin: FRICTION}),))


@pytest.mark.parametrize("start", [0.1, 0.0])
def test_both_sides_are_judged_and_the_reversal_itself_is_not(start):
    """From 0 the sweep meets both reversals of pin B exactly.

    The engines' rounding decides their sense there.
    """
    record = judge("scene", scene("B", start=start), EXACT)
    assert [row for row in record.rows if not row.passed] == []
    noted = [row.reason for row in record.rows if "reverses not judged" in row.reason]
    assert bool(noted) == (start == 0.0)


def test_only_a_pin_that_hardly_slips_reverses():
    """Bars 2 and 3 turn at 2 and 2 + x: the mask is x <= slip (2 + 2 + x + 2)."""
    slip = 1e-6
    x = np.array([0.0, 5.9e-6, 6.1e-6, 1e-3, 1.0])
    dry = replace(scene("A"), motion=Motion(Sweep(0.1, 0.5, 4), 2.0))
    solved, ones = solve(dry), np.ones(5)

    def find_reversals(omega_2, omega_3, omega_4, **how):
        speeds = {"omega_2": omega_2, "omega_3": omega_3, "omega_4": omega_4}
        solution = replace(solved, condition=ones, **speeds)
        return mark_reversing(dry, solution, slip, **how).tolist()

    reversing = find_reversals(2.0 * ones, 2.0 + x, ones)
    assert reversing == [True, True, False, False, False]
    slow = np.array([1.0, 1.1e-6, 0.9e-6, 1e-3, 0.5])
    at_rest = find_reversals(slow, 2.0 * slow, slow, in_time=True)
    assert at_rest == [False, False, True, False, False]
