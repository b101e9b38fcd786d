"""Drives of a scene on the loop of a file: couples, cylinders and pushes."""

from pathlib import Path

import pytest

from fourbar.files import load, loads
from fourbar.mjcf import write_mjcf
from fourbar.scene import Scene
from fourbar_validation.engines.description import name_driving
from fourbar_validation.engines.mujoco.robots.answers import (
    LoopMeasurement,
    MeasureOptions,
)
from fourbar_validation.engines.mujoco.robots.examine import examine_file
from fourbar_validation.engines.mujoco.robots.loop import PoseOptions, RobotFile
from fourbar_validation.engines.mujoco.robots.measure import measure_loops
from fourbar_validation.robots.measure import find_left_out, list_errors_by_method

SCENE = """
[lengths]
ground = "300 mm"
input = "100 mm"
coupler = "250 mm"
output = "220 mm"
ground_angle = "15 deg"
[bars]
input = { mass = "0.2 kg" }
coupler = { mass = "0.5 kg", centre = ["120 mm", "10 deg"] }
output = { mass = "0.4 kg" }
[motion]
theta_2 = { from = "50 deg", to = "90 deg", steps = 20 }
omega_2 = "5 rad/s"
alpha_2 = "3 rad/s^2"
[effects]
gravity = ["9.81 m/s^2", "-90 deg"]
"""
DRIVES = {
    "bar 2": "bar = 2",
    "bar 3": "bar = 3",
    "bar 4": "bar = 4",
    "cylinder on the ground": """
from = { bar = 1, from_pin = ["200 mm", "-60 deg"] }
to = { bar = 3, from_pin = ["100 mm", "20 deg"] }""",
    "cylinder between bars": """
from = { bar = 2, from_pin = ["60 mm", "30 deg"] }
to = { bar = 4, from_pin = ["150 mm", "20 deg"] }""",
    "push": 'bar = 4\nfrom_pin = ["100 mm", "20 deg"]\ndirection = "30 deg"',
    "push from the centre": """
bar = 4
from_centre = ["90 mm", "25 deg"]
direction = "30 deg\"""",
    "push that turns": """
bar = 3
from_pin = ["90 mm", "0 deg"]
direction = "80 deg"
frame = "bar\"""",
}
SOFT = 1e-3
"""Error that the stiffest constraint may leave, of the largest: 4e-5 with a cylinder of
a small lever. A wrench at a wrong place is off by tenths.
"""


MODELS = Path(__file__).parents[5] / "models"
VARIES = "omega or alpha differs"
COMMANDS = {
    "capabilities/command_coupler": "",
    "capabilities/command_output": "brings the input to rest",
    "capabilities/stroke_output": VARIES,
    "capabilities/law_rates": VARIES,
    "capabilities/law_cycloidal": VARIES,
    # its flywheel of 1e14 kg m^2 asks for trials that are no numbers for MuJoCo
    "gallery/excavator_bucket": "",
}
"""Commands of bars 2, 3 and 4, of strokes and over time, and why they have no motion at
one speed through time; empty where they have one.
"""


def measured(drive: str) -> LoopMeasurement:
    scene: Scene = loads(f"{SCENE}[drive]\n{DRIVES[drive]}\n")
    bare: Scene = loads(SCENE)
    file = RobotFile(Path("bare.xml"), write_mjcf(bare, drive="none"))
    options = MeasureOptions(PoseOptions(), loop="B")
    (loop,) = measure_loops(file, options, scene).loops
    return loop


@pytest.mark.slow
@pytest.mark.parametrize("drive", DRIVES)
def test_every_drive_is_that_of_the_formulas_in_a_file_without_it(drive: str) -> None:
    loop = measured(drive)
    assert find_left_out(loop) < 1e-8
    errors = list_errors_by_method(loop)
    assert {error.quantity for error in errors} >= {name_driving(loop.scene), "F43"}
    for error in errors:
        assert error.median < SOFT, error
    assert loop.through_time is not None and len(loop.through_time.rows) > 10


@pytest.mark.parametrize(("name", "refusal"), COMMANDS.items())
def test_every_command_is_judged_at_single_states(name: str, refusal: str) -> None:
    loop = examine_file(load(MODELS / f"{name}.toml"), None).measured
    assert find_left_out(loop) < 1e-8
    for error in list_errors_by_method(loop):
        assert error.part < SOFT, error
    assert refusal in loop.refusal
    assert (loop.through_time is None) == bool(refusal)
