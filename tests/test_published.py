"""Printed figures: the thesis's torque error by error, and its tables."""

import pytest
from click.testing import CliRunner

from validation.published import published
from validation.published.command import figures
from validation.published.program import ladder

STEP = 1e-11
"""N cm; elimination leaves 2-3e-13, the last digit listed is 1e-12."""
T4 = (
    309.30935923198564, 309.330779939797, 309.313000742774, 309.304477356844,
    309.002005400392, 308.804407126702, 308.8044071267012, 308.80440716278196,
)  # fmt: skip
F12X = (7.033117757022, 7.033839565011, 161.418472567466, 161.418320162565, 161.418168408309)


def test_the_published_torque_error_by_error() -> None:
    steps = [x for _, x in ladder()]
    assert [x["T4"] for x in steps] == pytest.approx(T4, rel=0.0, abs=STEP)
    assert [x["F12x"] for x in steps[:5]] == pytest.approx(F12X, rel=0.0, abs=STEP)


def test_one_angle_differs_and_it_is_the_lost_exponent() -> None:
    assert [f.name for f in figures() if f.verdict() == "differs"] == ["136 theta3_1"]
    assert sum(1 for _ in figures()) == 281 * 4 + 2 * 13


def test_the_command_explains_every_difference() -> None:
    assert CliRunner().invoke(published).exit_code == 0
