"""The errors that `cost` plots are those of a second loop, for every drive, integrator and softness."""

import math
from dataclasses import dataclass, replace

import pytest

import fourbar
from fourbar.mjcf import Settings, size_flywheel
from fourbar.scene import command
from fourbar_validation.advise.worst_errors import QUANTITIES, compute_errors
from fourbar_validation.cost.series import BEST, PLAIN
from fourbar_validation.engines.mujoco import drives
from fourbar_validation.engines.mujoco.trial import Build, TrialSetup
from fourbar_validation.scenes.suites import MODELS
from tests.support.second_loop import LoopSettings, measure

AGREES = 0.05
"""Part by which two loops may differ that read the same run at positions of their own."""


@dataclass(frozen=True)
class Case:
    """One setting in the words of the study, and in those of MuJoCo."""

    settings: Settings
    again: LoopSettings
    closure: Build | None = None
    steps: int = 160


def soften(text: str, _: float) -> drives.ClosedLoop:
    """Build the loop with body_invweight0 a hundredth of its own."""
    return drives.Softened(text, 1e-2)


def defaults(integrator: str, steps: int = 160) -> Case:
    """MuJoCo's own solref, solimp and solver."""
    settings = replace(BEST, pad=None, integrator=integrator)
    return Case(
        settings, LoopSettings(steps, integrator), drives.restore_defaults, steps
    )


CASES = {
    "defaults, Euler": defaults("Euler"),
    "defaults, Euler, fine": defaults("Euler", 2560),
    "defaults, RK4": defaults("RK4"),
    "defaults, implicit": defaults("implicit"),
    "defaults, implicitfast": defaults("implicitfast"),
    "defaults, discrete": defaults("discrete"),
    "no pads": Case(PLAIN, LoopSettings(160, "RK4", 10.0)),
    "no pads, d = 0.99": Case(
        replace(PLAIN, impedance=0.99), LoopSettings(160, "RK4", 10.0, 0.99)
    ),
    "regularisation edited": Case(
        replace(BEST, pad=None),
        LoopSettings(160, "RK4", 20.0, weight_factor=1e-2),
        soften,
    ),
    "pads": Case(replace(BEST, pad=1e-3), LoopSettings(160, "RK4", 20.0, pad=1e-3)),
    "pads, Euler": Case(
        replace(BEST, pad=1e-3, integrator="Euler"),
        LoopSettings(160, "Euler", 20.0, pad=1e-3),
    ),
}
QUICK = ("defaults, Euler", "no pads", "pads")


def make_scene(drive: str) -> fourbar.Scene:
    """Return a turn of a crank, or of the window in which the drive stays far from its poles."""
    if drive == "cylinder":
        scene = fourbar.load(MODELS / "capabilities" / "cylinder_2_4.toml")
        window = fourbar.Sweep(math.radians(80.0), math.radians(150.0), 60)
        return replace(
            scene,
            motion=scene.motion.replace(angle=window, speed=20.0, acceleration=0.0),
        )
    name, bar = drive.split()
    return replace(fourbar.load(MODELS / f"{name}.toml"), drive_bar=int(bar))


def compare(drive: str, case: Case) -> None:
    """Compare the errors of both loops, quantity by quantity."""
    scene = make_scene(drive)
    setup = TrialSetup(scene, command(scene))
    settings = replace(case.settings, steps_per_revolution=float(case.steps))
    trial = setup.try_out(settings, case.closure)
    assert not trial.broken
    plotted = compute_errors(scene, trial.at, trial.quantities)
    # a window is read at as many steps as it has positions
    steps = max(trial.steps_per_revolution, case.steps)
    again = replace(
        case.again, steps_per_revolution=steps, wheel=size_flywheel(scene, settings)
    )
    right = measure(scene, again)
    for quantity in QUANTITIES:
        assert getattr(plotted, quantity) == pytest.approx(right[quantity], rel=AGREES)


DRIVES = ("crank_rocker 2", "drag_link 3", "drag_link 4", "cylinder")


@pytest.mark.parametrize("case", QUICK)
@pytest.mark.parametrize("drive", DRIVES)
def test_the_plotted_error_is_that_of_a_second_loop(drive: str, case: str) -> None:
    compare(drive, CASES[case])


@pytest.mark.slow
@pytest.mark.parametrize("case", [name for name in CASES if name not in QUICK])
@pytest.mark.parametrize("drive", DRIVES)
def test_so_is_that_of_every_integrator_and_softness(drive: str, case: str) -> None:
    compare(drive, CASES[case])


def test_finer_steps_do_not_make_the_defaults_worse_where_bar_4_is_driven() -> None:
    """Their softness alone is left; read through another one the error grew as the steps fell."""
    scene = make_scene("drag_link 4")
    setup = TrialSetup(scene, command(scene))
    errors = []
    for steps in (640.0, 2560.0):
        settings = replace(
            BEST, pad=None, integrator="Euler", steps_per_revolution=steps
        )
        trial = setup.try_out(settings, drives.restore_defaults)
        errors.append(compute_errors(scene, trial.at, trial.quantities).torque)
    assert min(errors) > 0.05 and max(errors) < 0.1
