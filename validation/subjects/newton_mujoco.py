"""Newton's MuJoCo solver (MuJoCo Warp inside, single precision), from the MJCF file."""

import tempfile
import time
from importlib.metadata import version
from pathlib import Path

import mujoco_warp as mjw
import newton
import warp

from fourbar.scene import Scene
from validation.subjects.motion import Readings, gap, start, turn, weight
from validation.subjects.mujoco_c import text

VERSION = version("newton")
DEVICE = str(warp.get_preferred_device().name)
STEPS = (78, 157)
CHANGED = "add_mjcf takes neither timestep, gravity nor keyframe: all three given by hand; --for newton"
SETTINGS = {"SolverMuJoCo": None}


def through(scene: Scene, steps: int, setting: str) -> Readings:
    """A turn in so many steps."""
    timestep, stops = turn(scene, steps)
    builder = newton.ModelBuilder(gravity=weight(scene))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "four_bar.xml"
        file.write_text(text(scene, steps, "newton"))
        builder.add_mjcf(str(file))
    model = builder.finalize(device=warp.get_preferred_device())
    solver, control = newton.solvers.SolverMuJoCo(model), model.control()
    now, then = model.state(), model.state()
    speeds = now.joint_qd.numpy()
    speeds[:3] = start(scene).qvel
    now.joint_qd.assign(speeds)
    newton.solvers.SolverMuJoCo(model).step(now, then, control, None, timestep)  # compiled before the clock runs
    found, done = Readings(setting, steps), 0
    names = [solver.mj_model.body(number).name for number in range(solver.mj_model.nbody)]
    assert [name.rpartition("_")[2] for name in names[2:]] == ["input", "coupler", "output"]
    for stop in stops:
        began = time.process_time()
        for _ in range(stop - done):
            solver.step(now, then, control, None, timestep)
            now, then = then, now
        found.seconds += time.process_time() - began
        done = stop
        data = solver.mjw_data
        for _ in range(2):
            mjw.forward(solver.mjw_model, data)
        q, v, a, drive = (x.numpy()[0].astype(float) for x in (data.qpos, data.qvel, data.qacc, data.actuator_force))
        torque = drive[0] - float(solver.mj_model.dof_armature[0]) * a[0]
        theta = (q[0], q[0] + q[1], q[2])
        found.read(theta, v[0], a[0], torque, {"F43": data.efc.force.numpy()[0, :2].astype(float)})
        found.gap = max(found.gap, gap(scene, theta))
    return found
