"""What fourbar derives from a solution holds by every oracle, over many scenes.

`ORACLE_SHARE=1` asks every oracle about every random scene.
"""

import os
from contextlib import suppress

from pytest import mark

from fourbar_validation.run.question import NotAskedError
from fourbar_validation.scenes.random import DrawnType, draw_random_scene
from fourbar_validation.scenes.suites import read_default_suite
from tests.oracle.oracles import ORACLES, judge_by
from tests.oracle.scenes import draw_motion, take_scene
from tests.support.rows import slow_but

SHIPPED = read_default_suite()
RANDOM_SCENES = 200
SHARE = int(os.environ.get("ORACLE_SHARE", "21"))
"""Each oracle is asked about one random scene in so many: all of them about all scenes
take six minutes. No multiple of five, in which the types of linkages take turns.
"""
SHIPPED_SHARE = min(SHARE, 4)
"""The same of the shipped scenes."""
SEED = 68
LAWS, LAW_SHARE = 60, min(SHARE, 7)
SAMPLE = {
    "slender": ORACLES,
    "load_table": ("study",),
    "limited": ("study", "sensitivity", "equilibria"),
    "loaded": ("internal_forces", "summary"),
    "part of a turn": ("summary",),
    "damped": ("sdf",),
    "tolerances": ("tolerances", "sdf"),
    "drawn": ("study", "sensitivity"),
    "crank-rocker": ("points", "summary"),
    "load with corners": ("summary",),
    "fall in 5 ms": ("summary",),
    "fall in 20 ms": ("summary",),
    "slow fall": ("summary",),
    "pushed": ("summary",),
}
"""Oracles that have something to compare in each scene of the quick sample."""
SLOW = ("fall in 20 ms", "slow fall")
ASKED = [(name, oracle) for name, oracles in SAMPLE.items() for oracle in oracles]


def find_failing(rows):
    return [f"{row.engine} {row.quantity}: {row.reason}" for row in rows if row.failed]


@mark.parametrize(
    "name, oracle",
    slow_but([asked for asked in ASKED if asked[0] not in SLOW], ASKED),
)
def test_the_sample_is_compared_and_holds(name, oracle):
    rows = judge_by(take_scene(name), oracle)
    assert any(row.compared for row in rows)
    assert not find_failing(rows)


def share_out(count, share):
    """List pairs of a scene and an oracle; the oracles take turns."""
    return [
        (number, oracle)
        for place, oracle in enumerate(ORACLES)
        for number in range(place % share, count, share)
    ]


def hold(scene, oracle):
    with suppress(NotAskedError):
        assert not find_failing(judge_by(scene, oracle))


@mark.slow
@mark.parametrize("number, oracle", share_out(len(SHIPPED), SHIPPED_SHARE))
def test_shipped_scenes_hold(number, oracle):
    hold(SHIPPED.scene(number), oracle)


@mark.slow
@mark.parametrize("number, oracle", share_out(RANDOM_SCENES, SHARE))
def test_random_scenes_hold(number, oracle):
    hold(draw_random_scene(SEED, number, tuple(DrawnType)), oracle)


@mark.slow
@mark.parametrize("number", range(0, LAWS, LAW_SHARE))
def test_random_laws_hold(number):
    hold(draw_motion(SEED, number), "summary")
