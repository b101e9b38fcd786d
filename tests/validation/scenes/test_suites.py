"""The suite of a run without arguments uses every capability.

How much is judged of a suite does not depend on pictures.
"""

import itertools

import pytest

from fourbar.scene.motion import Law
from fourbar_validation.engines.applied_effects import TERM_OF
from fourbar_validation.engines.guests import list_needs
from fourbar_validation.run.judge import judge
from fourbar_validation.run.question import FREE_BODY
from fourbar_validation.scenes.suites import read_default_suite
from tests.oracle.variants import is_coordinate

SUITE = read_default_suite()
STATED = ("from_pin", "from_centre", "point", "arm")
"""Forms of the place of a load."""


def uses(scene):
    motion, drive = scene.motion, scene.drive
    keys = {effect.key for effect in scene.effects}
    yield from keys
    yield f"command of {motion.commanded}"
    yield "drive", tuple(end.bar for _, end in drive.ends) if drive else scene.drive_bar
    for load in scene.loads:
        yield f"load in {load.frame} axes"
        yield from (f"load by {name}" for name in STATED if getattr(load, name))
        if load.table:
            yield "load over a table"
    if motion.law is not None:
        yield from uses_of_law(motion.law)
    if motion.free is not None and "flywheel" in keys:
        yield "released with a flywheel"
    for effect in scene.effects:
        if effect.key == "springs":
            yield from (f"spring with {s.acts}" for s in effect.springs)
        if effect.key == "torsion":
            yield from (("torsion", pin) for pin, *_ in effect.springs)
    yield from (
        name for name in ("tolerances", "points", "drawing") if getattr(scene, name)
    )
    if any(is_coordinate(tolerance.key) for tolerance in scene.tolerances):
        yield "tolerance of a coordinate"


def uses_of_law(law):
    if not isinstance(law, Law):
        yield f"{law.kind} law"
        return
    if law.alpha is not None:
        yield "law with speeds and accelerations"
    if law.omega is not None:
        return
    yield f"law with ends {law.ends}"
    if law.ends == "periodic" and law.time[0] != 0.0:
        yield "periodic law that begins late"


def test_the_default_suite_uses_every_capability():
    used = {use for i in range(len(SUITE)) for use in uses(SUITE.scene(i))}
    wanted = TERM_OF.keys() - {"load"}
    commands = ("theta_2", "theta_3", "theta_4", "stroke")
    wanted |= {f"command of {name}" for name in commands}
    wanted |= {("drive", pair) for pair in itertools.combinations((1, 2, 3, 4), 2)}
    wanted |= {("drive", (4,))}  # a force at a point of the output
    wanted |= {("drive", bar) for bar in (2, 3, 4)}
    wanted |= {("torsion", pin) for pin in ("O2", "A", "B", "O4")}
    wanted |= {f"load by {name}" for name in STATED}
    wanted |= {
        "load in world axes",
        "load in bar axes",
        "load over a table",
        "tolerances",
        "tolerance of a coordinate",
        "points",
        "drawing",
        "law with ends rest",
        "cycloidal law",
        "sine law",
        "law with speeds and accelerations",
        "periodic law that begins late",
        "released with a flywheel",
        "spring with push",
        "spring with pull",
    }
    assert wanted <= used
    needs = [{*list_needs(SUITE.scene(i))} - {"gravity"} for i in range(len(SUITE))]
    alone = set().union(*(words for words in needs if len(words) == 1))
    together = set().union(*needs)
    assert together - alone == {"one_sided"}
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
        order=False,
    ).rows
    assert not [row for row in rows if row.failed]
    assert any(row.compared and row.engine == FREE_BODY.name for row in rows)
