"""Pin forces on a change point against balances of the whole linkage, and both sides."""

from dataclasses import replace

import numpy as np
import pytest

import fourbar
from fourbar.scene import command_at
from fourbar.show.position import PositionSheet
from fourbar.show.units import units
from tests.fourbar.show.test_position import SIX_DIGITS, numbers

PARALLELOGRAM = fourbar.FourBar(
    0.3,
    fourbar.Bar(0.1, mass=0.1),
    fourbar.Bar(0.3, mass=0.3),
    fourbar.Bar(0.1, mass=0.1),
)


@pytest.mark.parametrize(("theta_2", "sense"), ((0.0, 1.0), (np.pi, -1.0)))
def test_pin_forces_that_are_bounded_on_a_change_point_have_their_limit(
    theta_2: float, sense: float
) -> None:
    """Weights along the line of all bars ask for no moment there.

    On the frame the bars then act with their weights less m a, and each side has the
    limit.
    """
    scene = fourbar.Scene(
        PARALLELOGRAM,
        fourbar.Motion(theta_2, 6.0),
        effects=(fourbar.Gravity(9.81, 0.0),),
    )
    rows = PositionSheet(scene, fourbar.solve(scene), units("N m")).write_pin_forces()
    assert rows[-1] == "on the change point: the limits from both sides"
    # of G2 and G4 half of the acceleration of the coupler
    mass_times_acceleration = -sense * 0.1 * 36.0 * (0.1 * 0.5 + 0.3 + 0.1 * 0.5)
    along = 0.5 * 9.81 - mass_times_acceleration
    assert numbers(rows[5]) == pytest.approx([along, 0.0, along], rel=SIX_DIGITS)
    assert numbers(rows[6]) == [0.0]
    beside = fourbar.Motion(theta_2 + np.array([-1e-5, 1e-5]), 6.0)
    two = fourbar.solve(replace(scene, motion=beside))
    for row, name in zip(rows[1:5], ("F12", "F32", "F43", "F14"), strict=True):
        mean = getattr(two, name).mean(axis=0)
        assert numbers(row)[:2] == pytest.approx(mean, rel=SIX_DIGITS, abs=1e-8)


def test_pin_forces_that_have_no_bound_on_a_change_point_have_no_value() -> None:
    scene = fourbar.Scene(
        PARALLELOGRAM,
        fourbar.Motion(0.0, 6.0),
        effects=(fourbar.Gravity(9.81, -0.5 * np.pi),),
    )
    rows = PositionSheet(scene, fourbar.solve(scene), units("N m")).write_pin_forces()
    assert [row.split()[-4:-1] for row in rows[1:6]] == [["-", "-", "-"]] * 5
    assert rows[-1] == "on the change point no pin force has a limit"


def test_nothing_is_said_of_limits_where_a_law_begins() -> None:
    law = fourbar.Rise("cycloidal", (1.0, 1.0), theta_2=0.0)
    scene = fourbar.Scene(
        PARALLELOGRAM,
        fourbar.Motion(law=law),
        effects=(fourbar.Gravity(9.81, 0.0),),
    )
    start = fourbar.solve(scene, at=command_at(scene, np.array([0.0])))
    assert start.status == ["change_point"]
    rows = PositionSheet(scene, start, units("N m")).write_pin_forces()
    assert not any("limit" in row for row in rows)
    assert numbers(rows[1]) == []
