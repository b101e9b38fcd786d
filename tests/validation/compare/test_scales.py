"""What an error is divided by.

No other size than that of the quantity itself, where it has one.
"""

import numpy as np

from fourbar.effects import Load
from fourbar.formulas.mobility import limit_positions
from fourbar.linkage import uniform
from fourbar.scene import Scene
from fourbar.scene.motion import Motion, Sweep
from fourbar.solving import solve
from fourbar_validation.compare.scales import scale_of
from fourbar_validation.compare.tolerance import WELL_CONDITIONED

ROCKER = uniform(0.3, 0.25, 0.1, 0.22)


def test_the_scale_is_the_greatest_well_conditioned_value_and_elsewhere_the_value() -> (
    None
):
    """It would be larger of terms that cancel.

    Near a limit, where forces diverge, it would be too.
    """
    low, high = sorted(
        x.theta_2 for x in limit_positions(ROCKER) if 0.0 < x.theta_2 < np.pi
    )
    scene = Scene(
        ROCKER,
        Motion(
            np.append(
                np.linspace(0.6 * low + 0.4 * high, 0.4 * low + 0.6 * high, 7),
                high - 1e-7,
            ),
            10.0,
        ),
    )
    solution = solve(scene)
    assert solution.condition[-1] < WELL_CONDITIONED <= solution.condition[:-1].min()
    for quantity in ("torque", "F12", "a_G3", "omega_3"):
        values = getattr(solution, quantity)
        size = np.abs(values) if values.ndim == 1 else np.hypot(*values.T)
        expected = np.append(np.full(7, size[:-1].max()), size[-1])
        np.testing.assert_allclose(
            scale_of(quantity, scene, solution, values), expected
        )


def test_where_everything_cancels_the_scale_is_that_of_the_forces_that_cancel() -> None:
    """Two opposite forces at one point of bar 2 of a linkage at rest: no torque.

    2 x 50 N on 0.25 m cancel.
    """
    loads = (
        Load(2, (50.0, 0.0), arm=(0.05, 0.0)),
        Load(2, (-50.0, 0.0), arm=(0.05, 0.0)),
    )
    scene = Scene(ROCKER, Motion(Sweep(0.5, 0.6, 3), 0.0), loads=loads)
    solution = solve(scene)
    scale = scale_of("torque", scene, solution, solution.torque)
    assert np.all(scale >= 0.25 * 100.0)
    assert np.all(scale <= 4.0 * 0.25 * 100.0)


def test_what_the_input_alone_decides_has_no_scale_of_the_other_bars() -> None:
    """Beside a limit alpha_3 grows without bound, and a_A does not."""
    low = min(x.theta_2 for x in limit_positions(ROCKER) if 0.0 < x.theta_2 < np.pi)
    scene = Scene(ROCKER, Motion(np.array([low + 1e-9]), 10.0))
    solution = solve(scene)
    assert abs(solution.alpha_3[0]) > 1e9
    for name in ("v_A", "v_G2", "a_A", "a_G2"):
        values = getattr(solution, name)
        size = np.hypot(*values.T)
        np.testing.assert_allclose(scale_of(name, scene, solution, values), size)
