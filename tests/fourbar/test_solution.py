"""A solution as its users hold it.

By name, frozen, as a data frame with units.
"""

from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose
from pytest import importorskip, mark, raises

import fourbar
from fourbar import Motion, Point, solve
from fourbar.solution import unwrap
from tests.support.rows import refused
from tests.support.scenes import cis, crank_rocker


def pointed():
    return crank_rocker(points=(Point("P", 3, (0.1, 0.2)),))


def test_a_quantity_is_found_by_its_name():
    solution = solve(pointed())
    assert solution["torque"] is solution.torque
    assert solution["F12"] is solution.F12
    assert solution["P"] is solution.points["P"]
    assert solution["v_P"] is solution.velocity["P"]
    for name in ("tork", 0, "F12_x"):
        with refused("must be among theta_2, "):
            solution[name]
    positions = solve(crank_rocker(), "position")
    with refused("'torque': was not evaluated"):
        positions["torque"]
    with raises(TypeError, match="not iterable"):
        iter(solution)


def test_a_scene_without_a_title_leaves_no_empty_quotes():
    scene = crank_rocker()
    named, unnamed = (
        repr(solve(replace(scene, title=title))) for title in ("press", "")
    )
    assert named.startswith("Solution 'press': ")
    assert unnamed.startswith("Solution: ")


def test_one_position_is_written_into_an_array():
    scene = crank_rocker(Motion(theta_3=0.8, branch=-1))
    place = np.empty((1, 2))
    solution = solve(scene, out={"A": place})
    whole = solve(scene)
    assert_allclose(place, whole.A)
    assert solution.branch == whole.branch
    assert "torque" not in whole.to_pandas()


def test_solutions_are_equal_bit_by_bit():
    scene = pointed()
    solution, again = solve(scene), solve(scene)
    assert solution == again
    assert solution != "a solution"
    again.torque[3] = np.nextafter(again.torque[3], np.inf)
    assert solution != again
    solution.torque[3] = again.torque[3] = np.nan
    assert solution == again
    again.points["P"][0, 0] += 1e-15
    assert solution != again
    assert solve(scene, "velocity") != solve(scene)
    alike = replace(again, torque=np.zeros_like(again.torque))
    assert replace(alike, torque=-alike.torque) == alike
    assert replace(alike, torque=0.0) != alike


def test_a_data_frame_names_the_unit_of_each_column():
    importorskip("pandas", reason="to_pandas needs pandas: pip install pandas")
    table = solve(pointed()).to_pandas()
    units = table.attrs["units"]
    assert set(units) == set(table.columns) - {"status", "branch", "drive_bar"}
    wanted = """theta_2: rad, torque: N m, F12_x: N, |F12|: N, B_y: m, v_P_x: m/s,
        P_y: m, sin_mu: 1, a_B_x: m/s^2, omega_3: rad/s, power: W"""
    for row in wanted.split(","):
        name, unit = row.strip().split(": ")
        assert units[name] == unit
    inches = solve(pointed()).to_pandas(fourbar.units("imperial")).attrs
    assert inches["units"]["torque [lbf in]"] == "lbf in"
    assert inches["units"]["P_x [in]"] == "in"


@mark.parametrize("missing", [[], [0, 1], [4, 8, 12, 17, 21, 26]])
def test_angles_of_several_turns_are_continuous_across_gaps(missing):
    sweep = np.array([np.linspace(-3.0, 16.0, 30), np.linspace(2.0, -14.0, 30)])
    sweep[:, missing] = np.nan
    wrapped = np.angle(cis(sweep))
    unwrap(wrapped)
    assert_allclose(wrapped, sweep, atol=1e-14)
