"""Instructions under valgrind: switching off what a bare loop never needs pays.

What every effect costs in every engine, and that one which is not named costs nothing, are counted by
`python -m validation effects-cost` and `effects-cost --absent`: minutes, not seconds.
"""

from concurrent.futures import ThreadPoolExecutor

import pytest

from validation.effect_cost import available, count
from validation.effect_work import DEFAULT_FLAGS

SAVED = 0.08
"""Part of a step's instructions that the flags of the bare scene must save."""
FEW, MANY = 50, 250


@pytest.mark.skipif(not available(), reason="valgrind or setarch is not installed: no instruction is counted")
@pytest.mark.timeout(400)
def test_the_bare_scene_saves_what_it_does_not_need() -> None:
    work = [("none", FEW), ("none", MANY), (DEFAULT_FLAGS, MANY)]
    with ThreadPoolExecutor(2) as pool:
        few, bare, default = pool.map(lambda each: count("mujoco-simulated", *each), work)
    # until the first step the two do the same but for reading eight flags, less than one step
    assert bare - few <= (1.0 - SAVED) * (default - few)
