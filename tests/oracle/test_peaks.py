"""No position of a dense sweep by the free bodies exceeds a peak that is printed."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from fourbar.effects import Load, Table
from fourbar.formulas.mobility import TURN, choose_range
from fourbar.linkage import PIN_FORCE
from fourbar.scene import command_at
from fourbar.scene.motion import RISE_LAWS, Motion, Rise, Sine
from fourbar.show.block import write_motor
from fourbar_lab.fault_scenes import CRANK_ROCKER
from fourbar_validation.compare.scales import make_reference
from fourbar_validation.compare.tolerance import magnitude
from fourbar_validation.engines.description import name_driving
from fourbar_validation.run.judge import make_question
from fourbar_validation.run.question import NotAskedError
from fourbar_validation.scenes.random import DrawnType, draw_random_scene
from tests.oracle.summary import summarize_scene
from tests.oracle.test_oracles import RANDOM_SCENES, SEED, SHARE, SHIPPED
from tests.oracle.variants import ask_free_bodies

POSITIONS_OF_A_PIECE = 4001
LAWS = 60
SCENE_SHARE, LAW_SHARE = 6, 3
"""One random scene and one law in so many are swept, all where `ORACLE_SHARE` is 1."""
EXCESS = 1e-4
"""Part by which a value may exceed a printed peak, which has four digits."""


def find_excess(scene):
    """Return by what part each printed peak is exceeded, by quantity."""
    question = make_question("", scene, ())
    facts = summarize_scene(question)
    solution = question.solution
    entry = write_motor(scene, solution, {})
    assert entry is not None and solution.at is not None
    edges = np.union1d(
        solution.at.places[[0, -1]], getattr(scene.motion.law, "time", ())
    )
    graded = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, POSITIONS_OF_A_PIECE))
    places = [low + (high - low) * graded for low, high in pairwise(edges)]
    answer = ask_free_bodies(scene, command_at(scene, np.concatenate(places)))
    reference = make_reference(scene, answer)
    assert reference is not None
    name = name_driving(scene)
    values = np.abs(answer.quantities[name])
    speed = reference.stroke_speed
    if scene.drive is None:
        speed = answer.quantities[f"omega_{scene.drive_bar}"]
    kind = "torque" if scene.drive is None else "force"
    peaks = {
        name: (values, entry[f"peak_{kind}"]),
        "power": (np.abs(values * speed), entry["peak_power"]),
    }
    for pin, force in PIN_FORCE.items():
        load = magnitude(answer.quantities[force])
        peaks[force] = (load, entry["pins"][pin]["peak"])
    return {
        quantity: float(dense.max() / peak - 1.0)
        for quantity, (dense, peak) in peaks.items()
        if quantity not in facts.motion.panels.growing and dense.max() > 0.0
    }


def fall(duration, steps):
    law = Rise(
        "cycloidal",
        (1.2, 0.5),
        0.3,
        0.1,
        duration,
        0.1,
        steps=steps,
    )
    return replace(CRANK_ROCKER, motion=Motion(law=law))


SPIKE = Load(
    2,
    moment=-0.5,
    table=Table(
        tuple(np.radians((0.0, 98.3, 101.3, 104.3, 360.0))),
        (0.5, 0.5, 50.0, 0.5, 0.5),
    ),
)
"""A couple whose corners lie between the positions of a turn."""


@pytest.mark.parametrize(
    "scene",
    [
        pytest.param(CRANK_ROCKER, id="turn"),
        pytest.param(replace(CRANK_ROCKER, loads=(SPIKE,)), id="load with corners"),
        pytest.param(fall(0.4, 90), id="slow fall", marks=pytest.mark.slow),
        pytest.param(fall(0.005, 24), id="fall in 5 ms"),
        pytest.param(fall(0.02, 24), id="fall in 20 ms", marks=pytest.mark.slow),
    ],
)
def test_no_position_exceeds_a_printed_peak(scene):
    excess = find_excess(scene)
    assert {"torque", "power", *PIN_FORCE.values()} == excess.keys()
    assert max(excess.values()) <= EXCESS, excess


def require_no_excess(scene):
    try:
        excess = find_excess(scene)
    except NotAskedError as reason:
        pytest.skip(str(reason))
    assert max(excess.values()) <= EXCESS, excess


@pytest.mark.slow
@pytest.mark.parametrize("number", range(len(SHIPPED)))
def test_no_position_of_a_shipped_scene_exceeds_a_peak(number):
    require_no_excess(SHIPPED.scene(number))


@pytest.mark.slow
@pytest.mark.parametrize("number", range(0, RANDOM_SCENES, min(SHARE, SCENE_SHARE)))
def test_no_position_of_a_random_scene_exceeds_a_peak(number):
    require_no_excess(draw_random_scene(SEED, number, tuple(DrawnType)))


def draw_motion(seed, number):
    """Draw a random linkage whose commanded angle follows a random law.

    Parts of the law last from 5 ms to 1 s, and 12 to 90 steps cover all of them.
    """
    rng = np.random.default_rng([seed, number])
    kinds = tuple(DrawnType)
    scene = draw_random_scene(seed, number, kinds)
    low, high = choose_range(scene.linkage)
    first, last = low + (high - low) * rng.uniform((0.05, 0.55), (0.45, 0.95))
    steps = int(rng.integers(12, 91))
    dwell, rise, fall, rest = 10.0 ** rng.uniform(-2.3, 0.0, 4)
    if rng.random() < 0.2:
        half = 0.5 * (last - first)
        law = Sine(first + half, half, TURN / rise, dwell, fall, steps)
    else:
        kind = str(rng.choice(RISE_LAWS))
        falls = {"fall": fall, "rest": rest} if rng.random() < 0.8 else {}
        law = Rise(
            kind,
            (last - first, rise),
            first,
            dwell,
            steps=steps,
            **falls,
        )
    return replace(
        scene,
        motion=Motion(law=law),
        drive=None,
        drive_bar=2,
    )


@pytest.mark.slow
@pytest.mark.parametrize("number", range(0, LAWS, min(SHARE, LAW_SHARE)))
def test_no_position_of_a_random_law_exceeds_a_peak(number):
    require_no_excess(draw_motion(SEED, number))
