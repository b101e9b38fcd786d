"""The loops of a robot's file as they are measured: all, one by name, by a scene of one's own."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fourbar.errors import InputError
from fourbar_validation.engines.mujoco.robots.answers import MeasureOptions
from fourbar_validation.engines.mujoco.robots.loop import PoseOptions
from fourbar_validation.engines.mujoco.robots.measure import measure_loops
from fourbar_validation.robots.files import read_robot
from fourbar_validation.robots.measure import find_worst

ROBOTS = Path(__file__).parents[5] / "models" / "robots"


@pytest.mark.slow
def test_both_fingers_of_a_gripper_are_measured_and_are_alike() -> None:
    file = read_robot(ROBOTS / "gripper.xml")
    right, left = measure_loops(file, MeasureOptions(PoseOptions()), None).loops
    assert find_worst(right) == pytest.approx(find_worst(left), rel=1e-3)


@pytest.mark.slow
def test_a_scene_with_axes_of_its_own_gives_the_same_errors() -> None:
    """The axes of the scene are turned by 0.3 rad against those of the loop's plane; no weight acts across it."""
    file = read_robot(ROBOTS / "biped_foot.xml")
    options = MeasureOptions(PoseOptions(), "rod")
    (made,) = measure_loops(file, options, None).loops
    scene = made.scene
    linkage = replace(scene.linkage, ground_angle=scene.linkage.ground_angle + 0.3)
    (gravity, *others) = scene.effects
    turned = replace(
        scene,
        linkage=linkage,
        effects=(replace(gravity, angle=gravity.angle + 0.3), *others),
        motion=scene.motion.replace(angle=np.asarray(made_angles(made)) + 0.3),
    )
    (other,) = measure_loops(file, options, turned).loops
    assert find_worst(other) == pytest.approx(find_worst(made), rel=1e-6)


def made_angles(made: object) -> list[float]:
    return [row.theta_2 - made.turned for row in made.states.rows]  # type: ignore[attr-defined]


def test_a_loop_that_is_not_there_is_refused() -> None:
    file = read_robot(ROBOTS / "gripper.xml")
    with pytest.raises(InputError, match="no such closure"):
        measure_loops(file, MeasureOptions(PoseOptions(), "tail"), None)
