"""Drives of a scene on the loop of a file: couples, cylinders and pushes."""

import cmath
import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from pytest import approx

from fourbar.files import load, loads
from fourbar.formulas.mobility import find_circuit
from fourbar.mjcf import write_mjcf
from fourbar.scene.motion import BRANCH_NAMES, Motion
from fourbar.solving import solve
from fourbar_validation.engines.description import name_driving
from fourbar_validation.engines.mujoco.robots.measure import measure_loops
from fourbar_validation.engines.mujoco.robots.onto_scene import find_loop_of_scene
from fourbar_validation.places import MODELS
from fourbar_validation.robots.loop_errors import find_left_out, list_errors_by_method
from tests.support.robots import AS_DRAWN, Planar, file_of, measure, read_scene
from tests.support.rows import slow_but

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


@pytest.mark.slow
@pytest.mark.parametrize("drive", DRIVES)
def test_every_drive_is_that_of_the_formulas_in_a_file_without_it(drive):
    scene = loads(f"{SCENE}[drive]\n{DRIVES[drive]}\n")
    loop = measure(write_mjcf(loads(SCENE), drive="none"), scene, loop="B")
    assert find_left_out(loop) < 1e-8
    errors = list_errors_by_method(loop)
    assert {error.quantity for error in errors} >= {name_driving(loop.scene), "F43"}
    for error in errors:
        assert error.median < SOFT, error
    assert len(loop.through_time.rows) > 10


def write_cylinders(*ends, across=0.0):
    """Write a planar robot with motors on tendons between two of its sites each."""
    tendons = "".join(
        f'<spatial name="rope{i}"><site site="{one}"/><site site="{two}"/></spatial>'
        for i, (one, two) in enumerate(ends)
    )
    motors = "".join(
        f'<motor name="ram{i}" tendon="rope{i}"/>' for i in range(len(ends))
    )
    return Planar(
        drive="",
        ground='<site name="base" pos=".05 -.15 0"/><site name="eye" pos="0 0 .1"/>',
        on_coupler=f'<site name="tip" pos=".01 .02 {across}"/>',
        more=f"<tendon>{tendons}</tendon><actuator>{motors}</actuator>",
    ).text()


def test_a_cylinder_of_the_file_drives_its_scene():
    """A second one joins sites of one bar, and moves nothing."""
    text = write_cylinders(("base", "tip"), ("eye", "base"))
    made = read_scene(text)
    pins = Planar().pins
    ground, coupler = (
        complex(*np.subtract(pins[end], pins[start]))
        for start, end in (("O2", "O4"), ("A", "B"))
    )
    for place, bar, point, line in (
        (made.scene.drive.start, 1, 0.05 - 0.15j, ground),
        (made.scene.drive.end, 3, 0.01 + 0.02j, coupler),
    ):
        assert place.bar == bar
        there = cmath.rect(*place.from_pin) * line / abs(line)
        assert there == approx(point, abs=1e-10)
    assert "the actuator ram0 drives it as a cylinder (--drive O2 states a couple)" in (
        made.remarks
    )
    loop = measure(text)
    assert find_left_out(loop) < 1e-8
    assert "drive_force" in {error.quantity for error in list_errors_by_method(loop)}
    assert read_scene(text, drive="O2").scene.drive is None
    both = write_cylinders(("base", "tip"), ("eye", "tip"))
    assert read_scene(both).scene.drive is None


def test_how_far_a_cylinder_leans_out_of_the_plane_is_said():
    made = read_scene(write_cylinders(("base", "tip"), across=0.03))
    said = "not in the scene: 0.03 m across the plane between its cylinder's ends"
    assert said in made.remarks


STIFF = 'solref="0.005 1" solimp="0.9999 0.9999 0.001 0.5 2"'
SOLVER = '<option timestep="0.0002" integrator="RK4" tolerance="0"/>'
ANGLES = ("theta_2", "theta_3", "theta_4")


def command(scene, bar, angles, branch):
    """Return a scene that commands a bar, on which its drive acts too."""
    stated = {f"theta_{bar}": angles, f"omega_{bar}": 2.0}
    return replace(scene, motion=Motion(**stated, branch=branch), drive_bar=bar)


def find_circuit_of(scene):
    solution = solve(scene, "position")
    numbers = find_circuit(scene.linkage, solution.theta_2, solution.branch)
    return int(numbers[0])


def list_ways(scene):
    """Return cosine and sine of the angles of the moving bars, (n, 3, 2)."""
    solution = solve(scene, "position")
    angles = np.stack([getattr(solution, name) for name in ANGLES], axis=-1)
    return np.stack([np.cos(angles), np.sin(angles)], axis=-1)


@pytest.mark.parametrize(
    "cut, bar, away",
    slow_but(
        {("O2", 4, True), ("A", 2, False), ("B", 3, True), ("O4", 2, False)},
        product(["O2", "A", "B", "O4"], [2, 3, 4], [False, True]),
    ),
)
def test_a_loop_closed_at_any_pin_is_moved_by_any_bar(cut, bar, away):
    """Half a turn of the crank away from its pose the loop is in the other assembly of
    a command of each other bar: it moves there, through a limit of that bar.
    """
    text = Planar(base="", drive="", cut=cut, equality=STIFF, more=SOLVER).text()
    file = file_of(text)
    made = read_scene(text, speed=2.0).scene
    posed = find_loop_of_scene(file, made, AS_DRAWN)
    bars = made.linkage.moving
    crank = 2 + int(np.argmin([one.length for one in bars]))
    start = posed.loop.angles[crank - 1] + math.pi * away
    turn = start + np.linspace(0.0, 0.2, 9)
    circuit = find_circuit_of(made)
    in_circuit = next(
        way
        for way in (command(made, crank, turn, branch) for branch in BRANCH_NAMES)
        if find_circuit_of(way) == circuit
    )
    there = solve(in_circuit, "position")
    angles = getattr(there, f"theta_{bar}")
    scene = min(
        (command(made, bar, angles, branch) for branch in BRANCH_NAMES),
        key=lambda way: np.ptp(list_ways(way) - list_ways(in_circuit)),
    )
    loop = measure(file, scene)
    assert find_left_out(loop) < 1e-8
    for error in list_errors_by_method(loop):
        assert error.median < SOFT, error
    moved = any("it is moved there" in remark for remark in loop.remarks)
    assert moved == (away and bar != crank)


@pytest.mark.parametrize(
    "name, refusal", slow_but([*COMMANDS.items()][:2], COMMANDS.items())
)
def test_every_command_is_judged_at_single_states(name, refusal):
    loop = measure_loops(None, AS_DRAWN, load(MODELS / f"{name}.toml")).loops[0]
    assert find_left_out(loop) < 1e-8
    for error in list_errors_by_method(loop):
        assert error.part < SOFT, error
    assert refusal in loop.refusal
    assert (loop.through_time is None) == bool(refusal)
