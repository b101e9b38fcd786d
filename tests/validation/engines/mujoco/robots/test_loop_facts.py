"""What MuJoCo says of a loop, as data: errors, sizes and changes of settings."""

import numpy as np
import pytest
from pytest import approx

from fourbar_validation.engines.mujoco.robots.loop_facts import find_scales

FORCES = {
    "F12": np.array([30.0, 3000.0]),
    "F32": np.array([20.0, 2000.0]),
    "F43": np.zeros(2),
    "F14": np.array([1.0, 100.0]),
}
"""Pin forces of a well-conditioned state and of one beside a change point."""


@pytest.mark.parametrize(
    "torque, scale",
    [
        ([0.0, 0.0], 1500.0),
        ([1e-6 * 15.0, 1.0], 1500.0),
        ([1.0, 1.0], 1.0),
        ([1e-3, 0.0], 1e-3),
    ],
)
def test_what_vanishes_is_judged_by_the_largest_pin_force(torque, scale):
    """A torque is a sum of couples of pin forces, which may cancel.

    Rounded lengths leave little of it, and more beside a change point, where pin forces
    grow.
    """
    sizes = np.column_stack([torque, *FORCES.values()])
    scales = find_scales(sizes, np.array([0.9, 0.01]), 0.5)
    assert scales == approx([scale, 3000.0, 2000.0, 3000.0, 100.0])
