"""What a scene does not name does not exist.

Nothing of it in the formulas, in the MJCF or in the compiled model.
"""

import sys

import mujoco
import pytest

import fourbar
from fourbar.effects import Viscous, list_kinds
from fourbar.mjcf import write_mjcf
from fourbar_validation.run.judge import judge
from tests.support.scenes import crank_rocker
from tests.validation.engines.test_applied_effects import ACTING


def called(**acting):
    """Functions of the package that `solve` calls."""
    scene, calls = crank_rocker(**acting), set()

    def note(frame, event, _):
        if event == "call" and "fourbar" in frame.f_code.co_filename:
            calls.add(frame.f_code.co_qualname)

    sys.setprofile(note)
    fourbar.solve(scene)
    sys.setprofile(None)
    return calls


def test_a_term_of_an_effect_runs_where_a_scene_names_it_and_nowhere_else():
    kinds = {kind.__name__ for kind in list_kinds().values()}
    names = {*kinds, "Load", "torque_interval", "solve_sliding"}
    bare, viscous = (
        called(loads=(), effects=()),
        called(loads=(), effects=(Viscous.at(O2=0.1),)),
    )
    assert "inertia_wrenches" in bare and not [
        call for call in bare if names & set(call.split("."))
    ]
    assert "Viscous.act" in viscous and "Gravity.act" not in viscous


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


def test_the_bare_model_has_the_closed_loop_and_nothing_else():
    model, rows, disabled = compiled()
    counts = (model.nv, model.neq, model.nu, model.ntendon, model.nsensor, model.njnt)
    assert counts == (3, 1, 1, 0, 0, 3)
    assert rows == 3  # connect has three, the third of them empty in the plane
    assert disabled == BARE and not model.opt.enableflags
    for acting in (
        model.opt.gravity,
        model.dof_damping,
        model.dof_frictionloss,
        model.geom_contype,
        model.jnt_limited,
    ):
        assert not acting.any()


@pytest.mark.parametrize(
    ("name", "enabled", "more_rows", "tendons", "actuators"),
    [
        ("gravity", set(), 0, 0, 1),
        ("viscous", {"damper"}, 0, 1, 1),
        ("friction", {"frictionloss"}, 4, 1, 1),
        ("torsion", {"spring"}, 0, 1, 1),
        (
            "springs",
            {"spring"},
            0,
            7,
            3,
        ),  # a constant force, and one that pulls at every length, is an actuator
        ("flywheel", set(), 0, 0, 1),
    ],
)
def test_each_effect_adds_what_it_needs_and_no_more(
    name, enabled, more_rows, tendons, actuators
):
    model, rows, disabled = compiled(name)
    assert (model.nv, model.neq, model.nu, model.nsensor) == (3, 1, actuators, 0)
    assert disabled == BARE - enabled and rows == 3 + more_rows
    assert model.ntendon == tendons  # one at the cut pin B, one for each linear spring


def moved(*motion):
    return judge(
        "scene",
        fourbar.Scene(fourbar.uniform(0.3, 0.1, 0.25, 0.22), fourbar.Motion(*motion)),
    )


@pytest.mark.parametrize(
    ("motion", "reason"),
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
