"""The couple that gives an acceleration: bracketed, and none where none gives it."""

import pytest

from fourbar_validation.engines.mujoco.closed_loop import bracket_couple


def test_a_couple_that_nothing_gives_is_none():
    """A clamped drive reaches 2 rad/s^2, a ratchet jumps over 5."""
    assert bracket_couple(lambda couple: min(couple, 2.0), 3.0, 1.0, 1e-3) is None
    assert bracket_couple(lambda couple: 10.0 * (couple > 4.0), 5.0, 1.0, 1e-3) is None
    for wanted in (-7.0, 0.0, 1.5):
        couple = bracket_couple(
            lambda couple: min(couple, 2.0),
            wanted,
            1e-3,
            1e-9,
        )
        assert couple == pytest.approx(wanted, abs=1e-12)
