"""Errors that `cost` plots are a second loop's: every integrator and softness."""

from dataclasses import dataclass, replace

import pytest

import fourbar
from fourbar.mjcf import Settings, size_flywheel
from fourbar_validation.advise.matters import ERROR_NAMES, compute_errors
from fourbar_validation.cost.work_precision import BEST, WITHOUT_PADS
from fourbar_validation.engines.mujoco.trial import Edit, TrialSetup, restore_defaults
from fourbar_validation.scenes.suites import MODELS
from tests.support.second_loop import LoopSettings, measure

AGREES = 0.05
"""Part by which two loops may differ that read the same run at positions of their own.
"""


@dataclass(frozen=True)
class Case:
    """One setting in the words of the study, and in those of MuJoCo."""

    settings: Settings
    again: LoopSettings
    edit: Edit | None = None
    steps: int = 160


def defaults(integrator, steps=160):
    """MuJoCo's own solref, solimp and solver."""
    settings = replace(BEST, pad=None, integrator=integrator)
    return Case(settings, LoopSettings(steps, integrator), restore_defaults, steps)


CASES = {
    "defaults, Euler": defaults("Euler"),
    "defaults, Euler, fine": defaults("Euler", 2560),
    "defaults, RK4": defaults("RK4"),
    "defaults, implicit": defaults("implicit"),
    "defaults, implicitfast": defaults("implicitfast"),
    "defaults, discrete": defaults("discrete"),
    "no pads": Case(WITHOUT_PADS, LoopSettings(160, "RK4", 10.0)),
    "no pads, d = 0.99": Case(
        replace(WITHOUT_PADS, impedance=0.99), LoopSettings(160, "RK4", 10.0, 0.99)
    ),
    "pads": Case(replace(BEST, pad=1e-3), LoopSettings(160, "RK4", 20.0, pad=1e-3)),
    "pads, Euler": Case(
        replace(BEST, pad=1e-3, integrator="Euler"),
        LoopSettings(160, "Euler", 20.0, pad=1e-3),
    ),
}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_the_plotted_error_is_that_of_a_second_loop(case):
    """Of bars with their weight: `test_simulate.py` has loads and other drives."""
    scene = replace(fourbar.load(MODELS / "crank_rocker.toml"), loads=())
    setup = TrialSetup(scene, fourbar.command(scene))
    settings = replace(case.settings, steps_per_revolution=float(case.steps))
    trial = setup.try_out(settings, case.edit)
    assert not trial.broken
    plotted = compute_errors(scene, trial.at, trial.quantities)
    # a turn is read at as many steps as it has positions
    steps = max(trial.steps_per_revolution, case.steps)
    wheel = size_flywheel(scene, settings)
    again = replace(case.again, steps_per_revolution=steps, wheel=wheel)
    right = measure(scene, again)
    for quantity in ERROR_NAMES:
        assert getattr(plotted, quantity) == pytest.approx(right[quantity], rel=AGREES)


def test_without_pads_another_drive_is_read_from_the_linkage_by_itself():
    scene = replace(fourbar.load(MODELS / "drag_link.toml"), drive_bar=3)
    setup = TrialSetup(scene, fourbar.command(scene))
    run = setup._start(setup.segments[0], WITHOUT_PADS, None)
    assert run.light.model.dof_armature[0] == 0.0
