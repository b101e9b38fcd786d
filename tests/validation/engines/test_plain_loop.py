"""What a plain loop does not know, it refuses."""

from dataclasses import replace

import pytest

import fourbar
from fourbar.errors import LimitError
from fourbar_validation.engines.pinocchio_plain_loop import PinocchioLoop
from fourbar_validation.scenes.suites import MODELS
from tests.support.scenes import crank_rocker


def test_friction_of_loaded_pins_and_cylinders_are_refused():
    sliding = crank_rocker(effects=(fourbar.PinFriction.at(A=(0.2, 0.02)),))
    with pytest.raises(LimitError, match="loads of pins"):
        PinocchioLoop(sliding)
    cylinder = fourbar.load(MODELS / "capabilities" / "cylinder_2_4.toml")
    with pytest.raises(LimitError, match="no cylinder"):
        PinocchioLoop(replace(cylinder, loads=()))
