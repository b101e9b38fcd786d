"""What MJCF cannot say and MuJoCo is given at each stage of a step.

Motion laws and loads over theta_2.
"""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest

import fourbar
from fourbar.effects import Friction, Gravity, Load, Table
from fourbar.scene.motion import Law, Rise
from fourbar_validation.engines.mujoco import runner, simulate
from fourbar_validation.engines.mujoco.runner import OVERRUN, clip_angles
from fourbar_validation.run.judge import judge
from tests.support.here import THROUGH_TIME
from tests.support.rows import slow_but
from tests.support.scenes import crank_rocker
from tests.validation.engines.test_tree import ACTING

KINK = 1e-5
"""rad; where the cubic pieces of a law meet within a step of RK4 the motion errs by
h^2: measured 3e-6 here.
"""
LAWS = {
    "periodic": Law(
        (0.0, 0.2, 0.5, 1.0), (0.0, 1.0, 3.5, 2.0 * math.pi), 24, "periodic"
    ),
    "from rest to rest, turning back between": Law(
        (0.0, 0.2, 0.5, 1.0), (0.0, 1.0, 0.2, 2.0), 24, "rest"
    ),
    "backwards, time not from 0": Law(
        (1.0, 1.2, 1.5, 2.0, 2.2), (0.0, -1.0, -2.2, -2.5, -2.6), 24, "free"
    ),
    "cycloidal, with a dwell": Rise(
        "cycloidal",
        (1.2, 0.4),
        0.3,
        0.1,
        0.3,
        steps=24,
    ),
    "at constant speed": Law(
        (0.0, 0.1, 0.2, 0.3),
        (0.0, 1.0, 2.0, 3.0),
        12,
        "free",
    ),
}
OVER_A_PART = Table((0.1, 1.0, 2.0), (2.0, -5.0, 2.0))
PART_OF_A_TURN = replace(ACTING["load"], table=OVER_A_PART)
WHOLE_TURN = ACTING["load over theta_2"]


def simulated(posed):
    record = judge("scene", posed, THROUGH_TIME)
    assert not [line for line in record.left_out if line.startswith("mujoco")]
    return [row for row in record.rows if row.engine == "mujoco-simulated"]


@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.parametrize("name, drive", [*zip(LAWS, (2, 4, 2, 4, 2), strict=True)])
def test_a_motion_law_is_run_through(name, drive):
    """A load over theta_2, gravity and dry friction act at once.

    Friction changes its sense with the law's.
    """
    effects = (Gravity(), Friction.at(O2=0.02, O4=0.03))
    posed = crank_rocker(
        motion=fourbar.Motion(law=LAWS[name]),
        loads=(WHOLE_TURN,),
        effects=effects,
        drive_bar=drive,
    )
    rows = simulated(posed)
    assert [row for row in rows if not row.passed] == []
    assert {"theta_4", "alpha_4", "F32", "torque"} <= {row.quantity for row in rows}


PERIODIC = crank_rocker(
    motion=fourbar.Motion(law=LAWS["periodic"]), loads=(), effects=()
)


def test_the_law_is_followed_at_its_own_times():
    command = fourbar.command(PERIODIC)
    at = simulate.MujocoSimulated().answer(PERIODIC, command).at
    assert np.abs(at.theta_2 - command.theta_2).max() < KINK
    apart = np.abs(at.omega_2 - command.omega_2).max()
    assert apart < 1e-5 * np.abs(command.omega_2).max()


@pytest.mark.parametrize("omega", slow_but({-10.0}, [10.0, -10.0]))
def test_a_table_that_ends_where_the_sweep_does(omega):
    motion = fourbar.Motion(fourbar.Sweep(0.1, 2.0, 12), omega)
    loads = (PART_OF_A_TURN, Load(2, moment=-0.2))
    posed = crank_rocker(motion=motion, loads=loads, effects=())
    assert [row for row in simulated(posed) if not row.passed] == []


def test_an_overrun_is_put_back_only_if_it_is_a_rounding():
    posed = crank_rocker(loads=(PART_OF_A_TURN,))
    angles = np.array([0.1, 2.0, 2.0 * math.pi + 0.5])
    put_back = clip_angles(posed, angles + np.array([-OVERRUN, OVERRUN, 0.0]) / 2.0)
    assert put_back == pytest.approx(angles, abs=1e-15)
    with pytest.raises(fourbar.FourBarError, match="leaves the table"):
        clip_angles(posed, angles + 2.0 * OVERRUN)


@pytest.mark.parametrize("factor", [-1.0, 1.001, 0.0])
def test_a_drive_that_does_not_follow_the_law_fails_the_run(factor, monkeypatch):
    """The engine is judged at the motion it made; its own speed says that it is not the
    law's.
    """
    right = runner.RunCourse.accelerate

    def accelerate(*arguments):
        alpha = right(*arguments)
        return lambda *state: factor * alpha(*state)

    monkeypatch.setattr(runner.RunCourse, "accelerate", accelerate)
    failed = [row.reason for row in simulated(PERIODIC) if not row.passed]
    assert any("does not turn as commanded" in reason for reason in failed)


@pytest.mark.slow
def test_the_callback_ends_with_the_run():
    simulated(
        crank_rocker(
            motion=fourbar.Motion(law=LAWS["at constant speed"]),
            loads=(WHOLE_TURN,),
        )
    )
    assert mujoco.get_mjcb_act_bias() is None
