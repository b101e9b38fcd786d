"""A linkage in a tilted plane.

The same motion and forces, turned, in each form of file.
"""

import re

import mujoco
import numpy as np
from pytest import approx, mark

from fourbar import load
from fourbar.mjcf import Plane, assembly, write_mjcf
from fourbar_validation.engines.mujoco.closed_loop import open_model
from fourbar_validation.places import MODELS
from tests.support.robots import rotation
from tests.support.rows import read_rows, refused

AXES = [(0.3, 0.0, 1.0), (-2.0, 5.0, 1.0), (0.0, 1.0, 0.0), (0.0, 0.0, -3.0)]
ORIGIN = (1.0, -2.0, 0.5)
SCENE = load(MODELS / "crank_rocker.toml")


@mark.parametrize("axis", AXES)
def test_the_frame_turns_z_to_the_axis_by_the_shortest_way(axis):
    plane = Plane(axis)
    turn = plane.rotation
    unit = np.array(axis) / np.linalg.norm(axis)
    assert np.allclose(turn @ [0.0, 0.0, 1.0], unit, atol=1e-15)
    assert np.allclose(rotation(plane.quaternion), turn, atol=1e-15)
    # the trace of a rotation is 1 + 2 cos of its angle, which is that between z and the
    # axis
    assert np.trace(turn) == approx(1.0 + 2.0 * unit[2])
    roll, pitch, yaw = plane.roll_pitch_yaw
    parts = [
        rotation((np.cos(0.5 * angle), *(np.sin(0.5 * angle) * np.eye(3)[i])))
        for i, angle in enumerate((roll, pitch, yaw))
    ]
    assert np.allclose(parts[2] @ parts[1] @ parts[0], turn, atol=1e-15)
    half = plane.turn_on(0.7)
    about_z = rotation((np.cos(0.35), 0.0, 0.0, np.sin(0.35)))
    assert np.allclose(rotation(half), turn @ about_z, atol=1e-15)


@mark.parametrize(
    "axis, at, expected",
    read_rows("""
# x-z, gravity down
0 -1 0 | 0 -9.81 | 0 0 -9.81
# x points down, y stays
1 0 0 | 9.81 0 | 0 0 -9.81
-1 1 0 | 5 5 | 5 5 0
1e-5 0 -1 | 1 0 | -1 0 -1e-5
"""),
)
def test_a_turned_vector_has_zeros_where_it_has_no_component(axis, at, expected):
    axis, at, expected = (np.array(x.split(), float) for x in (axis, at, expected))
    plane = Plane(tuple(axis.tolist()))
    assert plane.turn(*at) == approx(expected, rel=1e-10, abs=0.0)
    assert np.linalg.norm(plane.quaternion) == approx(1.0, abs=1e-15)


@mark.parametrize("axis", [(0.0, 0.0, 0.0), (1.0, 2.0), (1.0, 0.0, np.nan), "z"])
def test_what_is_no_direction_is_refused(axis):
    with refused("axis"):
        Plane(axis)


@mark.parametrize("axis", AXES)
def test_mujoco_moves_and_loads_a_tilted_linkage_alike(axis):
    plane = Plane(axis, ORIGIN)
    answers = []
    for place in (Plane(), plane):
        model, data = open_model(write_mjcf(SCENE, plane=place))
        mujoco.mj_step(model, data, 50)
        mujoco.mj_forward(model, data)
        mujoco.mj_rnePostConstraint(model, data)
        turn = place.rotation
        bodies = [model.body(name).id for name in ("input", "coupler", "output")]
        # back into the linkage's axes; across the plane a loop of hinges is
        # overdetermined
        forces = (data.cfrc_int[bodies, 3:] @ turn)[:, :2]
        tip = turn.T @ (data.site("B3").xpos - place.origin)
        closing = (turn.T @ data.efc_force[:3])[:2]
        answers.append((data.qpos.copy(), forces, tip, closing))
    for level, tilted in zip(*answers, strict=True):
        assert np.allclose(tilted, level, rtol=0.0, atol=1e-7 * abs(level).max())


def test_only_a_plane_that_is_tilted_is_called_so():
    """A plane that is moved alone says where O2 is."""
    texts = {}
    for name, plane in (
        ("level", Plane()),
        ("moved", Plane(origin=ORIGIN)),
        ("tilted", Plane((0.3, 0.0, 1.0), ORIGIN)),
    ):
        texts[name] = [
            assembly.write_sdf(SCENE, without_loads=True, plane=plane),
            write_mjcf(SCENE, plane=plane),
        ]
    for name, written in texts.items():
        for text in written:
            assert bool(re.search("tilted", text, re.IGNORECASE)) == (name == "tilted")
        place = "O2 is at 1 -2 0.5 m of the world." in written[0]
        assert place == (name != "level")


@mark.parametrize("axis", [(0.0, 0.0, 1.0), *AXES])
def test_the_joints_of_a_usd_meet_wherever_the_plane_is(axis):
    plane = Plane(axis, ORIGIN)
    text = assembly.write_usd(SCENE, without_loads=True, plane=plane)

    def read(name, block):
        found = re.search(rf"{name} = \(([^)]*)\)", block)
        assert found
        return np.array([float(number) for number in found[1].split(",")])

    xforms = re.findall(r'\n    def Xform "(\w+)" \((.*?)\n    }', text, re.S)
    bodies = {
        name: (read("translate", block), rotation(read("orient", block)))
        for name, block in xforms
    }
    world = (np.zeros(3), np.eye(3))
    joints = re.findall(r'RevoluteJoint "(\w+)"(.*?)\n    }', text, re.S)
    assert len(joints) == 4
    for pin, block in joints:
        meets, turns = [], []
        for side in (0, 1):
            body = re.search(rf"body{side} = </four_bar/(\w+)>", block)
            place, turn = bodies[body[1]] if body else world
            meets.append(place + turn @ read(f"localPos{side}", block))
            turns.append(turn @ rotation(read(f"localRot{side}", block)))
        assert np.allclose(*meets, atol=1e-12), pin
        assert np.allclose(*(turn[:, 2] for turn in turns), atol=1e-12), pin
        assert np.allclose(turns[0][:, 2], plane.rotation[:, 2], atol=1e-12), pin
    down = read("gravityDirection", text)
    assert np.allclose(down, plane.rotation @ [0.0, -1.0, 0.0], atol=1e-12)
