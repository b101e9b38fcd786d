"""Free motion against exact solutions and its own equilibrium; test_free_motion_reference.py has the digits."""

import math

import numpy as np
import pytest

import fourbar
from fourbar.free_motion import release
from fourbar.scene import Command, solve

HANGING = fourbar.FourBar(
    0.3, fourbar.Bar(0.1, 0.2), fourbar.Bar(0.25, 0.5, 0.004, (0.13, 0.3)), fourbar.Bar(0.22, 0.4)
)


def test_one_window_of_iftomm_a02() -> None:
    """Ten seconds through the change points (lim.ii.udc.es/mbsbenchmark, A02)."""
    bar = fourbar.Bar(1.0, 1.0)
    linkage = fourbar.FourBar(1.0, bar, bar, bar)
    m = release(linkage, (fourbar.Gravity(),), math.pi / 2, -1.0, 1, np.array([0.0, 10.0]), follow=True)
    x, y, w = math.cos(m.theta_2[-1]), math.sin(m.theta_2[-1]), m.omega_2[-1]
    printed = (0.478385058, 0.878150179, 1.727264076, -0.940952179)
    for ours, theirs in zip((x, y, -y * w, x * w), printed, strict=True):
        assert abs(ours - theirs) <= 0.5e-9
    assert m.energy_drift < 1e-12  # hundreds of steps of 3e-14


def test_needs_no_driving_torque() -> None:
    terms = (fourbar.Gravity(), fourbar.Viscous.at(O2=0.002, B=0.001))
    m = release(HANGING, terms, 0.3, 2.0, -1, np.linspace(0.0, 2.0, 41))
    s = solve(fourbar.Scene(HANGING, effects=terms), "force", at=Command(m.theta_2, m.branch, m.omega_2, m.alpha_2))
    assert s.torque is not None
    assert np.abs(s.torque).max() < 1e-12 * 9.81 * 1.1  # of all the weights at one metre


@pytest.mark.parametrize("coupler", [0.12, 0.15])  # the first has a change point, the second a limit position only
def test_stops_at_a_limit_unless_told_to_follow(coupler: float) -> None:
    linkage = fourbar.FourBar(0.3, fourbar.Bar(0.2, 0.2), fourbar.Bar(coupler, 0.5), fourbar.Bar(0.22, 0.4))
    times = np.linspace(0.0, 5.0, 101)
    halted = release(linkage, (fourbar.Gravity(),), 1.0, 0.0, 1, times)
    assert halted.stopped_at is not None and halted.time[-1] <= halted.stopped_at < 5.0
    assert set(halted.branch) == {1}
    passed = release(linkage, (fourbar.Gravity(),), 1.0, 0.0, 1, times, follow=True)
    assert passed.stopped_at is None and set(passed.branch) == {1, -1} and passed.energy_drift < 1e-11
    n = len(halted.time)
    assert np.array_equal(passed.theta_2[:n], halted.theta_2)


def test_dry_friction_holds() -> None:
    m = release(HANGING, (fourbar.Gravity(), fourbar.Friction.at(O2=0.3)), 0.3, 1.0, 1, np.linspace(0.0, 5.0, 51))
    assert m.omega_2[-1] == 0.0 and m.alpha_2[-1] == 0.0 and m.theta_2[-1] == m.theta_2[-2]


def test_a_scene_reports_its_times() -> None:
    motion = fourbar.Motion(0.3, 2.0, free=fourbar.Free(1.0, 10))
    s = solve(fourbar.Scene(HANGING, motion, effects=(fourbar.Gravity(),)))
    assert s.time is not None and s.torque is not None and s.F12 is not None
    assert np.array_equal(s.time, np.linspace(0.0, 1.0, 11))
    assert np.abs(s.torque).max() < 1e-12 * 9.81 * 1.1
