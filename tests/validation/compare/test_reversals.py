"""Where dry friction reverses.

Found where geometry says, jumping by what statics says, judged on both sides of it.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

import fourbar
from fourbar.effects import Friction
from fourbar.scene import Scene, command
from fourbar.scene.motion import Motion, Sweep
from fourbar.solving import solve
from fourbar_validation.compare.reversals import (
    break_curve,
    find_reversals,
    mark_reversing,
)
from fourbar_validation.engines.registry import ENGINES
from fourbar_validation.run.judge import judge

D, A, B, C = 0.3, 0.1, 0.25, 0.22
FRICTION = 0.5
LINKAGE = fourbar.FourBar(
    D, fourbar.Bar(A, 0.2), fourbar.Bar(B, 0.5), fourbar.Bar(C, 0.4)
)
ROUNDING = 1e-13
"""rad; near the reversal the speed that vanishes carries some hundred roundings."""


def scene(pin, start=0.1):
    motion = Motion(Sweep(start, start + 2 * math.pi, 36), 10.0)
    return Scene(LINKAGE, motion, effects=(Friction.at(**{pin: FRICTION}),))


def reverse(pin, start=0.1):
    """Return the solution of a scene, and its reversals."""
    posed = scene(pin, start)
    solution = solve(posed)
    return solution, find_reversals(posed, command(posed), solution)


def dead_centres():
    """theta_2 where bars 2 and 3 lie in one line, by the cosine rule.

    There the rocker turns back.
    """
    stretched = math.acos(((A + B) ** 2 + D**2 - C**2) / (2 * (A + B) * D))
    folded = math.acos(((B - A) ** 2 + D**2 - C**2) / (2 * (B - A) * D)) + math.pi
    return [stretched, folded]


@pytest.mark.parametrize(
    ("pin", "start", "places"),
    [
        ("O4", 0.1, dead_centres()),
        ("B", 0.1, [math.pi, 2 * math.pi]),
        ("B", math.pi - 1e-12, [math.pi, 2 * math.pi]),
        ("O2", 0.1, []),
    ],
)
def test_they_are_where_geometry_puts_them(pin, start, places):
    """The rocker turns at its dead centres.

    Bars 3 and 4 turn together where A lies on the line of centres. A sweep that begins
    1e-12 rad before is not at rest there.
    """
    _, reversals = reverse(pin, start)
    found = [reversal.theta_2 for reversal in reversals]
    assert found == pytest.approx(places, abs=ROUNDING)
    assert {reversal.pin for reversal in reversals} <= {pin}


def test_the_jump_is_that_of_statics():
    """The couple on bar 4 changes by 2 f.

    Bar 3 takes the change as a force along itself: 2 f = c |sin mu| |dF43|.
    """
    for reversal in reverse("O4")[1]:
        sine = abs(float(reversal.before.sin_mu[0]))
        due = 2 * FRICTION / (C * sine)
        assert reversal.jump("F43") == pytest.approx(due, rel=1e-9)
        assert reversal.jump("torque") < 1e-9  # its power f |slip| is continuous
        assert "O4" in str(reversal) and "jumps from" in str(reversal)


@pytest.mark.parametrize("start", [0.1, 0.0])
def test_both_sides_are_judged_and_the_reversal_itself_is_not(start):
    """From 0 the sweep meets both reversals of pin B exactly.

    The engines' rounding decides their sense there.
    """
    exact = [engine for engine in ENGINES if not engine.through_time]
    record = judge("scene", scene("B", start=start), exact)
    assert [row for row in record.rows if not row.passed] == []
    noted = [row.reason for row in record.rows if "reverses not judged" in row.reason]
    assert bool(noted) == (start == 0.0)
    assert len(record.reversals) == (
        2 if start else 1
    )  # the ends of a sweep that starts in one have a single side


def test_a_curve_is_not_drawn_across_the_jump():
    solution, reversals = reverse("O4")
    x, y = break_curve(
        solution.theta_2, solution.F43[:, 0], reversals, lambda side: side.F43[:, 0]
    )
    gaps = np.flatnonzero(np.isnan(y))
    assert len(gaps) == len(reversals) == 2 and len(x) == len(y) == len(solution) + 6
    for gap, reversal in zip(gaps, reversals, strict=True):
        assert x[gap - 1] == x[gap + 1] == reversal.theta_2
        assert abs(y[gap + 1] - y[gap - 1]) > 0.1
    assert (np.diff(x) >= 0).all()


def test_only_a_pin_that_hardly_slips_reverses():
    """Bars 2 and 3 turn at 2 and 2 + x: the mask is x <= slip (2 + 2 + x + 2)."""
    slip = 1e-6
    x = np.array([0.0, 5.9e-6, 6.1e-6, 1e-3, 1.0])
    dry = replace(scene("A"), motion=Motion(Sweep(0.1, 0.5, 4), 2.0))
    solved, ones = solve(dry), np.ones(5)

    def mark(omega_2, omega_3, omega_4, **how):
        speeds = {"omega_2": omega_2, "omega_3": omega_3, "omega_4": omega_4}
        solution = replace(solved, condition=ones, **speeds)
        return mark_reversing(
            dry,
            solution,
            slip,
            **how,
        ).tolist()

    reversing = mark(2.0 * ones, 2.0 + x, ones)
    assert reversing == [True, True, False, False, False]
    slow = np.array([1.0, 1.1e-6, 0.9e-6, 1e-3, 0.5])
    at_rest = mark(
        slow,
        2.0 * slow,
        slow,
        in_time=True,
    )
    assert at_rest == [False, False, True, False, False]
