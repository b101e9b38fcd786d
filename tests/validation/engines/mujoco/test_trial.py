"""Errors that `cost` plots are a second loop's: every drive, integrator, softness."""

import math
from dataclasses import dataclass, replace

import pytest

import fourbar
from fourbar.mjcf import Settings, size_flywheel
from fourbar.scene import command
from fourbar_validation.advise.worst_errors import ERROR_NAMES, compute_errors
from fourbar_validation.cost.series import BEST, WITHOUT_PADS
from fourbar_validation.engines.mujoco import drives
from fourbar_validation.engines.mujoco.trial import Build, TrialSetup
from fourbar_validation.scenes.suites import MODELS
from tests.support.second_loop import (
    LoopSettings,
    Servo,
    TurningWheel,
    measure,
)

AGREES = 0.05
"""Part by which two loops may differ that read the same run at positions of their own.
"""


@dataclass(frozen=True)
class Case:
    """One setting in the words of the study, and in those of MuJoCo."""

    settings: Settings
    again: LoopSettings
    closure: Build | None = None
    steps: int = 160
    drive: Build | None = None
    """Builds the loop that is stepped, if no flywheel carries it."""
    gains: tuple[float, float] | None = None
    """Gains of position and speed of a servo, per (inertia omega^2) and
    (inertia omega).
    """
    softness: float | None = None
    """Factor on dof_invweight0 where a joint equality holds the crank to a wheel."""


def soften(text, _):
    """Build the loop with body_invweight0 a hundredth of its own."""
    return drives.Softened(text, 1e-2)


def defaults(integrator, steps=160):
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
    "no pads": Case(WITHOUT_PADS, LoopSettings(160, "RK4", 10.0)),
    "no pads, d = 0.99": Case(
        replace(WITHOUT_PADS, impedance=0.99), LoopSettings(160, "RK4", 10.0, 0.99)
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
LIGHT = replace(BEST, flywheel=1.0, pad=1e-3)
FAST = replace(LIGHT, integrator="implicitfast", time_constant_steps=3.0)
RK4 = LoopSettings(160, "RK4", 20.0, pad=1e-3)
IMPLICIT = LoopSettings(160, "implicitfast", 3.0, pad=1e-3)
CARRIED = {
    "servo": Case(FAST, IMPLICIT, None, 320, drives.Servo, (1e6, 1e4)),
    "gentle servo": Case(LIGHT, RK4, drive=drives.GentleServo, gains=(1.0, 1.0)),
    "velocity actuator": Case(
        FAST,
        IMPLICIT,
        drive=drives.VelocityActuator,
        gains=(0.0, 1e4),
    ),
    "gentle velocity actuator": Case(
        LIGHT,
        RK4,
        drive=drives.GentleVelocityActuator,
        gains=(0.0, 1.0),
    ),
    "joint equality": Case(LIGHT, RK4, drive=drives.WheelEquality, softness=1.0),
    "joint equality, softness edited": Case(
        LIGHT,
        RK4,
        drive=drives.StiffWheelEquality,
        softness=1e-8,
    ),
}
"""What else carries the crank, with the integrator that the study gives it."""
WHEEL = 1e8
"""Armature of the wheel that a joint equality follows, per inertia of the crank."""
QUICK = ("defaults, Euler", "no pads", "pads")


def make_scene(drive):
    """Return a turn of a crank, or a window.

    The drive stays far from its poles in it.
    """
    if drive == "cylinder":
        scene = fourbar.load(MODELS / "capabilities" / "cylinder_2_4.toml")
        window = fourbar.Sweep(
            math.radians(80.0),
            math.radians(150.0),
            60,
        )
        return replace(
            scene,
            motion=scene.motion.replace(angle=window, speed=30.0, acceleration=0.0),
        )
    name, bar = drive.split()
    return replace(fourbar.load(MODELS / f"{name}.toml"), drive_bar=int(bar))


def make_carrier(case, inertia, omega):
    """Return what keeps the crank's speed in place of a flywheel."""
    if case.gains is not None:
        position, velocity = case.gains
        return Servo(position * inertia * omega**2, velocity * inertia * abs(omega))
    if case.softness is not None:
        return TurningWheel(WHEEL * inertia, case.softness)
    return None


def compare(drive, case):
    """Compare the errors of both loops, quantity by quantity."""
    scene = make_scene(drive)
    setup = TrialSetup(scene, command(scene))
    settings = replace(case.settings, steps_per_revolution=float(case.steps))
    trial = setup.try_out(settings, case.closure, case.drive)
    assert not trial.broken
    plotted = compute_errors(scene, trial.at, trial.quantities)
    # a window is read at as many steps as it has positions
    steps = max(trial.steps_per_revolution, case.steps)
    wheel = size_flywheel(scene, settings)
    carrier = make_carrier(case, wheel, float(scene.motion.omega_2))
    again = replace(
        case.again,
        steps_per_revolution=steps,
        wheel=wheel,
        carrier=carrier,
    )
    right = measure(scene, again)
    for quantity in ERROR_NAMES:
        assert getattr(plotted, quantity) == pytest.approx(right[quantity], rel=AGREES)


DRIVES = ("crank_rocker 2", "drag_link 3", "drag_link 4", "cylinder")


@pytest.mark.parametrize("case", QUICK)
@pytest.mark.parametrize("drive", DRIVES)
def test_the_plotted_error_is_that_of_a_second_loop(drive, case):
    compare(drive, CASES[case])


@pytest.mark.slow
@pytest.mark.parametrize("case", [name for name in CASES if name not in QUICK])
@pytest.mark.parametrize("drive", DRIVES)
def test_so_is_that_of_every_integrator_and_softness(drive, case):
    compare(drive, CASES[case])


@pytest.mark.slow
@pytest.mark.parametrize("case", CARRIED)
@pytest.mark.parametrize("drive", DRIVES)
def test_so_is_that_of_every_other_drive_of_the_crank(drive, case):
    compare(drive, CARRIED[case])


def test_finer_steps_do_not_make_the_defaults_worse_where_bar_4_is_driven():
    """Their softness alone is left.

    Read through another one the error grew as the steps fell.
    """
    scene = make_scene("drag_link 4")
    setup = TrialSetup(scene, command(scene))
    errors = []
    for steps in (640.0, 2560.0):
        settings = replace(
            BEST,
            pad=None,
            integrator="Euler",
            steps_per_revolution=steps,
        )
        trial = setup.try_out(settings, drives.restore_defaults)
        errors.append(compute_errors(scene, trial.at, trial.quantities).torque)
    assert min(errors) > 0.05 and max(errors) < 0.1
