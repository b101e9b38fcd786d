"""Many positions in one call: what is timed, and what is judged.

MJX and MuJoCo Warp need not be there. Where they are, they run on any device.
"""

from math import tau

import numpy as np
from pytest import importorskip, mark, raises

from fourbar_lab.simulators.mujoco_c import MujocoFile
from fourbar_lab.worlds import CONTENDERS, FORMULAS_ON_ONE_CORE, measure_worlds
from tests.lab.simulators.test_simulators import ask_position
from tests.support.checkout import read, read_table

MUJOCO = "MuJoCo, one core"
EXACT = 1e-10
"""Error of single states of MuJoCo with the generated file; measured 2e-12."""
SINGLE = 0.03
"""Error of MuJoCo Warp in single precision; measured 1.1e-2 on a CPU and 6.1e-3 on a
GPU.
"""
SINGLE_ON_A_GPU = 0.01
"""The same on a GPU, as the page has it; measured 6.1e-3."""
WITHOUT_VELOCITY = (0.4, 0.8)
"""Errors of MJX, which leaves (dJ/dt) v out; measured 0.49 and 0.65."""
TWO_TURNS = 50
"""Worlds that hold each of the 25 positions twice."""


def check_errors(name, torque, force):
    """Check errors against what is known of a contender."""
    low, high = 0.0, SINGLE
    if name == MUJOCO:
        high = EXACT
    elif "MJX" in name:
        low, high = WITHOUT_VELOCITY
    assert low < torque < high, name
    assert low < force < high, name


def test_the_last_worlds_are_judged_and_every_world_has_a_state():
    cost = measure_worlds(MUJOCO, TWO_TURNS)
    check_errors(MUJOCO, cost.torque, cost.force)
    assert cost.first > 0.5 * cost.seconds and cost.exchanged > 0.5 * cost.seconds
    scene, command = ask_position()
    q, v, *_ = MujocoFile().in_worlds(scene, TWO_TURNS).exchange()
    turned = np.remainder(q[:, 0] - np.resize(command.theta_2, TWO_TURNS), tau)
    assert np.minimum(turned, tau - turned).max() < 1e-12
    assert len(v) == TWO_TURNS


def test_a_world_that_is_not_finite_fails():
    scene, _ = ask_position()
    prepared = MujocoFile().in_worlds(scene, TWO_TURNS)
    results = prepared.exchange()
    prepared.read(results)
    # not among the worlds that are judged
    results[2][0] = np.nan
    with raises(ArithmeticError, match="diverged"):
        prepared.read(results)


def test_the_page_states_errors_that_hold():
    rows = {name: cells for name, *cells in read_table(read("docs/cost.md"), "worlds")}
    assert list(rows) == [FORMULAS_ON_ONE_CORE, *CONTENDERS]
    for name in CONTENDERS:
        check_errors(name, *map(float, rows[name][-3:-1]))
    (warp,) = (name for name in rows if "Warp" in name)
    assert max(map(float, rows[warp][-3:-1])) < SINGLE_ON_A_GPU


@mark.nightly
@mark.parametrize("name", [name for name in CONTENDERS if name != MUJOCO])
def test_each_simulator_that_is_installed_evaluates_worlds(name):
    module = CONTENDERS[name].adapter.partition(":")[0]
    importorskip(f"fourbar_lab.simulators.{module}", exc_type=ImportError)
    cost = measure_worlds(name, TWO_TURNS)
    check_errors(name, cost.torque, cost.force)
