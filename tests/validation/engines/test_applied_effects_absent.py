"""What a scene does not name does not exist.

Nothing of it in the formulas, in the MJCF or in the compiled model.
"""

import mujoco
import pytest

import fourbar
from fourbar.mjcf import write_mjcf
from fourbar_validation.run.judge import judge
from tests.support.scenes import crank_rocker
from tests.validation.engines.test_applied_effects import ACTING


def compiled(*names):
    """Return the compiled model with these effects, its rows, and what it disables."""
    effects = tuple(ACTING[name] for name in names)
    text = write_mjcf(crank_rocker(loads=(), effects=effects))
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    disabled = {
        name.removeprefix("mjDSBL_").lower()
        for name, flag in mujoco.mjtDisableBit.__members__.items()
        if name != "mjNDISABLE" and model.opt.disableflags & int(flag)
    }
    return model, data.nefc, disabled


BARE = {"contact", "limit", "island", "sensor", "spring", "damper", "frictionloss"}


@pytest.mark.parametrize(
    "name, enabled, more_rows, tendons, actuators",
    [
        (None, set(), 0, 0, 1),
        ("gravity", set(), 0, 0, 1),
        ("viscous", {"damper"}, 0, 1, 1),
        ("friction", {"frictionloss"}, 4, 1, 1),
        ("torsion", {"spring"}, 0, 1, 1),
        # a constant force, and one that pulls at every length, is an actuator
        ("springs", {"spring"}, 0, 7, 3),
        ("flywheel", set(), 0, 0, 1),
    ],
)
def test_each_effect_adds_what_it_needs_and_no_more(
    name, enabled, more_rows, tendons, actuators
):
    """A connect has three rows, the third of them empty in the plane."""
    model, rows, disabled = compiled(*filter(None, [name]))
    assert (model.nv, model.neq, model.nu, model.nsensor) == (3, 1, actuators, 0)
    assert disabled == BARE - enabled and rows == 3 + more_rows
    assert model.opt.gravity.any() == (name == "gravity")
    assert not model.jnt_limited.any()
    assert model.ntendon == tendons  # one at the cut pin B, one for each linear spring


def moved(*motion):
    return judge(
        "scene",
        fourbar.Scene(fourbar.uniform(0.3, 0.1, 0.25, 0.22), fourbar.Motion(*motion)),
    )


@pytest.mark.parametrize(
    "motion, reason",
    [
        (
            (fourbar.Sweep(0.0, 6.0, 20), 0.0),
            "the commanded speed is 0: nothing moves through time",
        ),
        ((1.0, 2.0), "a simulation needs more than one position"),
    ],
)
def test_what_does_not_move_through_time_is_not_simulated(motion, reason):
    record = moved(*motion)
    assert f"mujoco-simulated: {reason}" in record.left_out
    assert {row.engine for row in record.rows} == {
        "formulas",
        "free-body",
        "mujoco-inverse",
        "pinocchio-inverse",
    }


def test_equal_positions_are_evaluated_once():
    assert (
        "positions: all are the same, one is evaluated"
        in moved([1.0, 1.0, 1.0], 2.0).left_out
    )
