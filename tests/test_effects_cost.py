"""Instructions under valgrind: switching off what a bare loop never needs pays.

What every effect costs in every engine, and that one which is not named costs nothing, are counted by
`python -m validation effects-cost` and `effects-cost --absent`: minutes, not seconds.
"""

import pytest

from validation.studies.effects.cost import available, counts
from validation.studies.effects.work import DEFAULT_FLAGS

SAVED = 0.08
"""Part of a step's instructions that the flags of the bare scene must save."""
NOTHING = 0.01
"""Gravity is an addition among 100 000 instructions of a step."""


@pytest.mark.skipif(not available(), reason="valgrind or setarch is not installed: no instruction is counted")
@pytest.mark.timeout(400)
def test_the_bare_scene_saves_what_it_does_not_need() -> None:
    found = counts("mujoco-simulated", ["none", DEFAULT_FLAGS, "gravity"])
    assert found["none"] <= (1.0 - SAVED) * found[DEFAULT_FLAGS]
    assert abs(found["gravity"] / found["none"] - 1.0) < NOTHING
