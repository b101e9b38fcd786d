"""What fourbar derives from a solution holds by every oracle, over many scenes.

`ORACLE_SHARE=1` asks every oracle about every random scene.
"""

import os
from contextlib import suppress

import pytest

from fourbar_validation.run.question import NotAskedError
from fourbar_validation.scenes.random import DrawnType, draw_random_scene
from fourbar_validation.scenes.suites import read_default_suite
from tests.oracle.oracles import ORACLES, judge_by
from tests.oracle.scenes import take_scene

SHIPPED = read_default_suite()
RANDOM_SCENES = 200
SHARE = int(os.environ.get("ORACLE_SHARE", "21"))
"""Each oracle is asked about one random scene in so many: all of them about all scenes
take six minutes. No multiple of five, in which the types of linkages take turns.
"""
SEED = 68
SAMPLE = {
    "slender": ORACLES.keys() - {"blocks", "error_bars", "friction_residual"},
    "limited": {"study", "sensitivity", "equilibria"},
    "loaded": {"internal_forces", "summary"},
    "part of a turn": {"summary"},
    "simulated, damped": {"sdf"},
    "simulated, tolerances": {"tolerances", "sdf"},
    "simulated, drawn": {"study", "sensitivity"},
    "crank-rocker": {"points", "blocks", "error_bars"},
    "sliding pins": {"blocks", "friction_residual"},
    "near a limit": {"error_bars"},
    "short output": {"error_bars"},
    "short coupler and output near a limit": {"error_bars"},
}
"""Oracles that have something to compare in each scene of the quick sample."""


def find_failing(rows):
    return [f"{row.engine} {row.quantity}: {row.reason}" for row in rows if row.failed]


@pytest.mark.parametrize(
    ("name", "oracle"),
    [(name, oracle) for name, oracles in SAMPLE.items() for oracle in sorted(oracles)],
)
def test_the_sample_is_compared_and_holds(name, oracle):
    rows = judge_by(take_scene(name), oracle)
    assert any(row.compared for row in rows)
    assert not find_failing(rows)


def test_every_oracle_is_in_the_sample():
    assert set().union(*SAMPLE.values()) == ORACLES.keys()


@pytest.mark.slow
@pytest.mark.parametrize(
    "number", range(len(SHIPPED)), ids=[SHIPPED.name(i) for i in range(len(SHIPPED))]
)
def test_every_shipped_scene_holds(number):
    assert not find_failing(judge_by(SHIPPED.scene(number)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "oracle"),
    [
        (number, oracle)
        for place, oracle in enumerate(ORACLES)
        for number in range(place % SHARE, RANDOM_SCENES, SHARE)
    ],
)
def test_random_scenes_hold(number, oracle):
    scene = draw_random_scene(SEED, number, tuple(DrawnType))
    with suppress(NotAskedError):
        assert not find_failing(judge_by(scene, oracle))
