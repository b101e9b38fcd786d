"""PyBullet: an articulated body, a point constraint at B, and a velocity motor on O2."""

import tempfile
import time
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pybullet as bullet

from fourbar.linkage import BAR_NAMES, FIRST_PIN
from fourbar.scene import Scene
from validation.subjects.motion import Readings, gap, start, turn, weight

VERSION = version("pybullet")
STEPS = (628, 2512, 10048)
CHANGED = "built from URDF, which holds no loop, and a point constraint"
SETTINGS: dict[str, dict[str, float]] = {
    "its defaults": {},
    "500 iterations, no residual": {"numSolverIterations": 500, "solverResidualThreshold": 0.0},
}
STRONG = 1e9
"""N and N m that constraint and motor may exert: no limit."""


def urdf(scene: Scene) -> str:
    """The tree: bars 2 and 3 one after the other, bar 4 on the ground; each link's frame lies in its mass centre."""
    linkage = scene.linkage
    theta_1, foot = linkage.ground_angle, {2: 0j, 3: complex(linkage.input.length)}
    foot[4] = linkage.ground * complex(np.cos(theta_1), np.sin(theta_1))
    parts = ['<robot name="four_bar"><link name="ground"/>']
    for number, parent in ((2, 1), (3, 2), (4, 1)):
        bar = linkage.bar(number)
        turned = " ".join(f'{axes}="{bar.moment_of_inertia!r}"' for axes in ("ixx", "iyy", "izz"))
        parts.append(
            f'<link name="{BAR_NAMES[number]}"><inertial>'
            f'<origin xyz="{bar.to_centre.real!r} {bar.to_centre.imag!r} 0"/>'
            f'<mass value="{bar.mass!r}"/><inertia {turned} ixy="0" ixz="0" iyz="0"/></inertial></link>'
            f'<joint name="{FIRST_PIN[number]}" type="continuous"><parent link="{BAR_NAMES[parent]}"/>'
            f'<child link="{BAR_NAMES[number]}"/><origin xyz="{foot[number].real!r} {foot[number].imag!r} 0"/>'
            '<axis xyz="0 0 1"/></joint>'
        )
    return "".join([*parts, "</robot>"])


def through(scene: Scene, steps: int, setting: str) -> Readings:
    """A turn in so many steps; torque and force are those with which the step began."""
    timestep, stops = turn(scene, steps)
    begin, linkage = start(scene), scene.linkage
    client = bullet.connect(bullet.DIRECT)
    try:
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "four_bar.urdf"
            file.write_text(urdf(scene))
            flags = bullet.URDF_USE_INERTIA_FROM_FILE
            body = bullet.loadURDF(str(file), useFixedBase=True, flags=flags, physicsClientId=client)
        bullet.setPhysicsEngineParameter(fixedTimeStep=timestep, **SETTINGS[setting])
        bullet.setGravity(*weight(scene))
        for joint, (angle, speed) in enumerate(zip(begin.qpos, begin.qvel, strict=True)):
            bullet.changeDynamics(body, joint, linearDamping=0.0, angularDamping=0.0, jointDamping=0.0)
            bullet.resetJointState(body, joint, angle, speed)
            bullet.setJointMotorControl2(body, joint, bullet.VELOCITY_CONTROL, force=0.0)
        bullet.changeDynamics(body, -1, linearDamping=0.0, angularDamping=0.0)
        drive = {"targetVelocity": begin.qvel[0], "force": STRONG}
        bullet.setJointMotorControl2(body, 0, bullet.VELOCITY_CONTROL, **drive)
        ends = [linkage.bar(n).length - linkage.bar(n).to_centre for n in (3, 4)]
        frames = [[end.real, end.imag, 0.0] for end in ends]
        none = [0.0, 0.0, 0.0]
        ball = bullet.createConstraint(body, 1, body, 2, bullet.JOINT_POINT2POINT, none, *frames)
        bullet.changeConstraint(ball, maxForce=STRONG)
        found, done = Readings(setting, steps), 0
        for stop in stops:
            began = time.process_time()
            for _ in range(stop - done - 1):
                bullet.stepSimulation()
            before = [bullet.getJointState(body, joint)[:2] for joint in range(3)]
            bullet.stepSimulation()
            found.seconds += time.process_time() - began
            done = stop
            after = bullet.getJointState(body, 0)
            q, speed = [state[0] for state in before], before[0][1]
            force = [-part for part in bullet.getConstraintState(ball)[:2]]  # it speaks of the force on the child
            theta = (q[0], q[0] + q[1], q[2])
            found.read(theta, speed, (after[1] - speed) / timestep, after[3], {"F43": force})
            found.gap = max(found.gap, gap(scene, theta))
        return found
    finally:
        bullet.disconnect(client)
