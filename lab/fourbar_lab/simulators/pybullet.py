"""PyBullet: an articulated body, a point constraint at B, and a motor on O2.

The motor is one of velocity.
"""

from importlib.metadata import version
from typing import Any, ClassVar

import pybullet as bullet

from fourbar.linkage import BAR_NAMES, FIRST_PIN
from fourbar.scene import Scene
from fourbar_lab.simulators.protocol_engines import (
    Course,
    Instant,
    Readings,
    Simulator,
    bar_directions,
    gravity_field,
    rotate,
    start,
    write_temp,
)
from fourbar_validation.engines.description import list_moving_parts

_STRONG = 1e9
"""N and N m that constraint and motor may exert: no limit."""


def _write_urdf(scene: Scene) -> str:
    """Return the URDF of the tree: bars 2 and 3 in series, bar 4 on the ground.

    The frame of each link lies in its mass centre.
    """
    links = ['<robot name="four_bar"><link name="ground"/>']
    for part in list_moving_parts(scene.linkage):
        turned = " ".join(
            f'{axes}="{part.inertia!r}"' for axes in ("ixx", "iyy", "izz")
        )
        x, y = part.centre
        pin_x, pin_y = part.first_pin
        links += [
            f'<link name="{BAR_NAMES[part.bar]}"><inertial>',
            f'<origin xyz="{x!r} {y!r} 0"/>',
            f'<mass value="{part.mass!r}"/>',
            f'<inertia {turned} ixy="0" ixz="0" iyz="0"/>',
            "</inertial></link>",
            f'<joint name="{FIRST_PIN[part.bar]}" type="continuous">',
            f'<parent link="{BAR_NAMES[part.bearer]}"/>',
            f'<child link="{BAR_NAMES[part.bar]}"/>',
            f'<origin xyz="{pin_x!r} {pin_y!r} 0"/>',
            '<axis xyz="0 0 1"/>',
            "</joint>",
        ]
    return "".join([*links, "</robot>"])


class PyBullet(Simulator):
    """Bullet through its Python interface."""

    name = "PyBullet"
    version = version("pybullet")
    changed = "built from URDF, which holds no loop, and a point constraint"
    settings: ClassVar[dict[str, dict[str, float]]] = {
        "its defaults": {},
        "500 iterations": {"numSolverIterations": 500, "solverResidualThreshold": 0.0},
    }

    def through(self, scene: Scene, course: Course) -> Readings:
        """Run through a course.

        Torque and forces are those with which the step began.
        """
        begin = start(scene)
        client = bullet.connect(bullet.DIRECT)
        try:
            with write_temp(_write_urdf(scene), "four_bar.urdf") as file:
                flags = bullet.URDF_USE_INERTIA_FROM_FILE
                body = bullet.loadURDF(
                    file,
                    useFixedBase=True,
                    flags=flags,
                    physicsClientId=client,
                )
            bullet.setPhysicsEngineParameter(
                fixedTimeStep=course.timestep,
                **self.settings[self.setting],
            )
            bullet.setGravity(*gravity_field(scene))
            for joint, (angle, speed) in enumerate(
                zip(begin.qpos, begin.qvel, strict=True)
            ):
                bullet.changeDynamics(
                    body,
                    joint,
                    linearDamping=0.0,
                    angularDamping=0.0,
                    jointDamping=0.0,
                )
                bullet.resetJointState(body, joint, angle, speed)
                bullet.setJointMotorControl2(
                    body,
                    joint,
                    bullet.VELOCITY_CONTROL,
                    force=0.0,
                )
                bullet.enableJointForceTorqueSensor(body, joint, True)
            bullet.changeDynamics(body, -1, linearDamping=0.0, angularDamping=0.0)
            drive = {"targetVelocity": begin.qvel[0], "force": _STRONG}
            bullet.setJointMotorControl2(body, 0, bullet.VELOCITY_CONTROL, **drive)
            _, three, four = list_moving_parts(scene.linkage)
            frames = [
                [part.length - part.centre[0], -part.centre[1], 0.0]
                for part in (three, four)
            ]
            none = [0.0, 0.0, 0.0]
            ball = bullet.createConstraint(
                body,
                1,
                body,
                2,
                bullet.JOINT_POINT2POINT,
                none,
                *frames,
            )
            bullet.changeConstraint(ball, maxForce=_STRONG)

            def look() -> list[Any]:
                return [bullet.getJointState(body, joint)[:2] for joint in range(3)]

            def read(before: list[Any]) -> Instant:
                q, (speed, *_) = zip(*before, strict=True)
                theta = bar_directions(q)
                # by the parent, in the link's axes
                F12, F23, F14 = (
                    rotate(angle, *bullet.getJointState(body, joint)[2][:2])
                    for joint, angle in enumerate(theta)
                )
                # of the force on the child
                x, y, *_ = bullet.getConstraintState(ball)
                forces = {
                    "F12": F12,
                    "F32": (-F23[0], -F23[1]),
                    "F43": (-x, -y),
                    "F14": F14,
                }
                _, after, _, torque = bullet.getJointState(body, 0)
                alpha = (after - speed) / course.timestep
                return Instant(theta, speed, alpha, torque, forces)

            return self.run_by_steps(scene, course, bullet.stepSimulation, look, read)
        finally:
            bullet.disconnect(client)
