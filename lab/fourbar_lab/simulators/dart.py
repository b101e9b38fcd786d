"""DART: revolute joints, a ball joint constraint at B, and a flywheel on the input."""

from importlib.metadata import version
from typing import Any, ClassVar

import dartpy
import numpy as np

from fourbar.mjcf import size_flywheel
from fourbar.scene import Scene
from fourbar_lab.simulators.protocol_engines import (
    RECIPE_WITH_A_LIGHT_FLYWHEEL,
    Course,
    Instant,
    Readings,
    Simulator,
    bar_directions,
    gravity_field,
    read_flywheel,
    rotate,
    start,
)
from fourbar_validation.engines.description import list_moving_parts


class Dart(Simulator):
    """DART's own time stepping; its closing constraint offers no force."""

    name = "DART"
    version = version("dartpy")
    changed = (
        "built in Python; the input carries a light flywheel as an inertia about its"
        " own pin"
    )
    quantities = ("theta_3", "theta_4", "torque", "F12", "F32", "F14")
    settings: ClassVar[dict[str, None]] = {"its defaults": None}

    def through(self, scene: Scene, course: Course) -> Readings:
        """Run through a course.

        Torque and forces are those with which the last step began.
        """
        begin = start(scene)
        inertia = size_flywheel(scene, RECIPE_WITH_A_LIGHT_FLYWHEEL)
        world = dartpy.simulation.World()
        linkage = dartpy.dynamics.Skeleton("four_bar")
        bodies: dict[int, Any] = {}
        for part, angle, speed in zip(
            list_moving_parts(scene.linkage),
            begin.qpos,
            begin.qvel,
            strict=True,
        ):
            joint, body = linkage.createRevoluteJointAndBodyNodePair(
                bodies.get(part.bearer)
            )
            joint.setAxis([0.0, 0.0, 1.0])
            place = dartpy.math.Isometry3()
            place.set_translation([*part.first_pin, 0.0])
            joint.setTransformFromParentBodyNode(place)
            about = part.inertia + (inertia if part.bar == 2 else 0.0)
            of_body = dartpy.dynamics.Inertia()
            of_body.setMass(part.mass)
            of_body.setLocalCOM([*part.centre, 0.0])
            of_body.setMoment(np.diag([about] * 3))
            body.setInertia(of_body)
            joint.setPosition(0, angle)
            joint.setVelocity(0, speed)
            bodies[part.bar] = body
        world.addSkeleton(linkage)
        world.setGravity(list(gravity_field(scene)))
        world.setTimeStep(course.timestep)
        length = scene.linkage.coupler.length
        end = bodies[3].getWorldTransform().multiply([length, 0.0, 0.0])
        world.getConstraintSolver().addConstraint(
            dartpy.constraint.BallJointConstraint(bodies[3], bodies[4], end)
        )
        joints = [linkage.getJoint(number) for number in range(3)]

        def look() -> tuple[Any, float]:
            return np.array(linkage.getPositions()), float(linkage.getVelocities()[0])

        def read(before: tuple[Any, float]) -> Instant:
            q, speed = before
            theta = bar_directions(q)
            # by the child, in its axes
            F21, F32, F41 = (
                np.array(rotate(angle, *joint.getWrenchToChildBodyNode()[3:5]))
                for angle, joint in zip(theta, joints, strict=True)
            )
            speeds = speed, float(linkage.getVelocities()[0])
            forces = {"F12": -F21, "F32": F32, "F14": -F41}
            return read_flywheel(course, inertia, theta, speeds, forces)

        return self.run_by_steps(scene, course, world.step, look, read)
