"""The suite of a run without arguments uses every capability.

How much is judged of a suite does not depend on pictures.
"""

import tomllib
from itertools import combinations

import pytest

import fourbar
from fourbar_validation.engines.guests import list_needs
from fourbar_validation.engines.loaded import TERM_OF
from fourbar_validation.run.judge import judge
from fourbar_validation.run.question import FREE_BODY
from fourbar_validation.scenes.suites import read_default_suite

SUITE = read_default_suite()
WANTED = """
motion.theta_2.from, motion.theta_3.from, motion.theta_4.from, motion.stroke.from,
drive.bar = 2, drive.bar = 3, drive.bar = 4, effects.torsion.O2.rest,
effects.torsion.A.rest, effects.torsion.B.rest, effects.torsion.O4.rest,
effects.springs.acts = push, effects.springs.acts = pull,
loads.from_centre, loads.point, loads.arm, loads.frame = world, loads.frame = bar,
loads.table.factor, tolerances.lengths.input, tolerances.points.P.drawn.0, points.P.bar,
pins.O2, motion.law.ends = rest, motion.law.kind = cycloidal,
motion.law.kind = sine, motion.law.alpha_2
"""
"""What files of the suite state, effects apart."""


def list_keys(stated, path):
    """Yield the keys of what a file states, with their words too."""
    if isinstance(stated, dict):
        for key, value in stated.items():
            yield from list_keys(value, f"{path}.{key}".lstrip("."))
    elif isinstance(stated, list):
        for entry in stated:
            yield from list_keys(entry, path)
    else:
        yield from (path, f"{path} = {stated}")


def test_the_default_suite_uses_every_capability():
    scenes = [SUITE.scene(i) for i in range(len(SUITE))]
    files = [tomllib.loads(fourbar.dump(scene)) for scene in scenes]
    used = {key for file in files for key in list_keys(file, "")}
    assert {*WANTED.strip().replace("\n", " ").split(", ")} <= used
    effects = [{effect.key for effect in scene.effects} for scene in scenes]
    assert TERM_OF.keys() - {"load"} <= set().union(*effects)
    drives = [scene.drive for scene in scenes if scene.drive]
    ends = {tuple(end.bar for _, end in drive.ends) for drive in drives}
    assert {*combinations((1, 2, 3, 4), 2), (4,)} <= ends  # a force at a point of bar 4
    laws = [file["motion"]["law"] for file in files if "law" in file["motion"]]
    late = [law["time"][0] for law in laws if law.get("ends") == "periodic"]
    assert any(float(time.split()[0]) for time in late)
    released = [scene.motion.free is not None for scene in scenes]
    assert any(one and "flywheel" in keys for one, keys in zip(released, effects))  # noqa: B905
    needs = [{*list_needs(scene)} - {"gravity"} for scene in scenes]
    alone = set().union(*(words for words in needs if len(words) == 1))
    assert set().union(*needs) - alone == {"one_sided"}
    assert {"springs", "one_sided"} in needs


@pytest.mark.parametrize(
    "index",
    range(len(SUITE)),
    ids=[SUITE.name(i) for i in range(len(SUITE))],
)
def test_every_scene_of_it_holds(index):
    rows = judge(
        SUITE.name(index),
        SUITE.scene(index),
        [FREE_BODY],
    ).rows
    assert not [row for row in rows if row.failed]
    assert any(row.compared and row.engine == FREE_BODY.name for row in rows)
