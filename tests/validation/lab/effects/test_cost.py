"""Switching off what a bare loop never needs pays: in time, and with `INSTRUCTIONS=all` in instructions under valgrind.

What every effect costs in every engine, and that one which is not named costs nothing, are counted by
`python -m validation effects-cost` and `effects-cost --absent`: minutes, not seconds.
"""

import os
import time

import pytest

from fourbar_validation.lab.effects.cost import available, counts
from fourbar_validation.lab.effects.work import DEFAULT_FLAGS, simulated

SAVED = 0.08
"""Part of a step's instructions, and of its time, that the flags of the bare scene must save; some 0.2 of the time."""
NOTHING = 0.01
"""Gravity is an addition among 100 000 instructions of a step."""


def test_the_bare_scene_steps_faster_than_with_default_flags() -> None:
    works = {effect: simulated(effect) for effect in ("none", DEFAULT_FLAGS)}
    best = dict.fromkeys(works, float("inf"))
    for _ in range(100):  # by turns, a millisecond each: the least is free of what else the machine does
        for effect, work in works.items():
            began = time.perf_counter()
            work(50)
            best[effect] = min(best[effect], time.perf_counter() - began)
    assert best["none"] <= (1.0 - SAVED) * best[DEFAULT_FLAGS]


@pytest.mark.skipif("INSTRUCTIONS" not in os.environ, reason="half a minute of valgrind: part of `make long-test`")
@pytest.mark.skipif(not available(), reason="valgrind or setarch is not installed: no instruction is counted")
@pytest.mark.timeout(400)
def test_the_bare_scene_saves_what_it_does_not_need() -> None:
    found = counts("mujoco-simulated", ["none", DEFAULT_FLAGS, "gravity"])
    assert found["none"] <= (1.0 - SAVED) * found[DEFAULT_FLAGS]
    assert abs(found["gravity"] / found["none"] - 1.0) < NOTHING
