"""What a scene does not name does not exist.

Nothing of it in the formulas, in the MJCF or in the compiled model.
"""

import mujoco
from pytest import mark

import fourbar
from fourbar.mjcf import write_mjcf
from fourbar_validation.run.judge import judge
from tests.support.robots import forward
from tests.support.rows import read_rows
from tests.support.scenes import UNIFORM, crank_rocker
from tests.validation.engines.test_tree import ACTING

BARE = {"contact", "limit", "island", "sensor", "spring", "damper", "frictionloss"}


@mark.parametrize(
    "name, enabled, more_rows, tendons, actuators",
    read_rows("""
 | | 0 | 0 | 1
gravity | | 0 | 0 | 1
viscous | damper | 0 | 1 | 1
friction | frictionloss | 4 | 1 | 1
torsion | spring | 0 | 1 | 1
# a constant force, and one that pulls at every length, is an actuator
springs | spring | 0 | 7 | 3
flywheel | | 0 | 0 | 1
"""),
)
def test_each_effect_adds_what_it_needs_and_no_more(
    name, enabled, more_rows, tendons, actuators
):
    """A connect has three rows, the third of them empty in the plane.

    A tendon is one at the cut pin B, or one for each linear spring.
    """
    effects = (ACTING[name],) if name else ()
    model, data = forward(write_mjcf(crank_rocker(loads=(), effects=effects)))
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    disabled = {
        flag.removeprefix("mjDSBL_").lower()
        for flag, bit in mujoco.mjtDisableBit.__members__.items()
        if flag != "mjNDISABLE" and model.opt.disableflags & int(bit)
    }
    assert disabled == BARE - {enabled}
    assert data.nefc == 3 + int(more_rows)
    assert (model.ntendon, model.nu) == (int(tendons), int(actuators))
    assert (model.nv, model.neq, model.nsensor) == (3, 1, 0)
    assert model.opt.gravity.any() == (name == "gravity")
    assert not model.jnt_limited.any()


@mark.parametrize(
    "motion, note",
    [
        (
            (fourbar.Sweep(0.0, 6.0, 20), 0.0),
            "mujoco-simulated: the commanded speed is 0: nothing moves through time",
        ),
        ((1.0, 2.0), "mujoco-simulated: a simulation needs more than one position"),
        (([1.0, 1.0, 1.0], 2.0), "positions: all are the same, one is evaluated"),
    ],
)
def test_what_does_not_move_through_time_is_not_simulated(motion, note):
    record = judge("scene", fourbar.Scene(UNIFORM, fourbar.Motion(*motion)))
    assert note in record.left_out
    exact = {"formulas", "free-body", "mujoco-inverse", "pinocchio-inverse"}
    assert {row.engine for row in record.rows} == exact
