"""What MuJoCo says of a loop, as data: errors, sizes and changes of settings."""

from dataclasses import replace

import numpy as np
import pytest

from fourbar_validation.engines.mujoco.robots.answers import (
    InsideAnswer,
    InsideRow,
    LoopMotion,
    PinsAndTorque,
    RobotSettings,
    find_scales,
)

PINS = ("F12", "F32", "F43", "F14")
OWN = RobotSettings(
    (0.02, 1.0), (0.9, 0.95, 0.001, 0.5, 2.0), 0.002, "Euler", "Newton", 100, 1e-8
)


def make_row(torque: float, off: float) -> InsideRow:
    rigid = PinsAndTorque(torque, {name: np.array([3.0, 4.0]) for name in PINS})
    soft = PinsAndTorque(
        torque + off, {name: np.array([3.0, 4.0 + off]) for name in PINS}
    )
    return InsideRow(0.1, 1.0, 0.0, 0.2, soft, rigid, 1e-4)


def test_errors_are_sizes_of_differences_and_scales_of_the_rigid_answer() -> None:
    answer = InsideAnswer([make_row(2.0, 0.5), make_row(-4.0, -0.25)])
    assert answer.errors()["torque"] == pytest.approx([0.5, 0.25])
    assert answer.errors()["F43"] == pytest.approx([0.5, 0.25])
    assert answer.scales(0.5)["torque"] == 4.0
    assert answer.scales(0.5)["F12"] == pytest.approx(5.0)


def test_what_vanishes_is_scaled_by_the_largest_pin_force() -> None:
    """A torque is a sum of couples of pin forces, which may cancel."""
    largest = {"torque": 1e-12, "F12": 30.0, "F32": 20.0, "F43": 0.0, "F14": 1.0}
    scales = find_scales(largest, 0.5)
    assert scales == {"torque": 15.0, "F12": 30.0, "F32": 20.0, "F43": 30.0, "F14": 1.0}
    nothing = dict.fromkeys(largest, 0.0)
    assert find_scales(nothing, 0.5) == nothing


def test_fewer_positions_keep_both_ends() -> None:
    motion = LoopMotion(tuple(np.linspace(0.0, 1.0, 101).tolist()), 1.0, 0.0)
    assert motion.thin_out(3).theta_2 == (0.0, 0.5, 1.0)
    assert motion.thin_out(500) == motion


def test_changes_are_written_as_attributes() -> None:
    changed = replace(OWN, solref=(0.002, 1.0), integrator="RK4")
    assert changed.list_changes(OWN) == {"solref": "0.002 1", "integrator": "RK4"}
    assert OWN.list_changes(OWN) == {}
