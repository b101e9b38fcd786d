"""List what the study tries: one setting at a time is changed.

The other settings are the recommended ones or MuJoCo's defaults.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

from fourbar.linkage import record
from fourbar.mjcf import Settings
from fourbar.scene import Scene
from fourbar_validation.engines.mujoco.defaults import restore_defaults
from fourbar_validation.engines.mujoco.trial import TRIAL_FLYWHEEL, Edit

STEPS_PER_TURN = (20, 40, 80, 160, 320, 640, 1280, 2560)
_MORE_STEPS = (*STEPS_PER_TURN, 5120, 10240)
"""Steps per revolution; a first-order integrator needs more."""
MIDDLE = 640
"""Steps per revolution where a setting other than the timestep changes."""
_IMPEDANCES = (0.9, 0.97, 0.99, 0.997, 0.999, 0.9997, 0.9999)
TIME_CONSTANTS = (3.0, 5.0, 10.0, 20.0, 40.0, 80.0)
SOLVER_TOLERANCES = (0.0, 1e-16, 1e-14, 1e-12, 1e-10, 1e-8, 1e-6)
_PADS = (1e-1, 1e-2, 1e-3, 1e-4)
SLOW = 0.1
"""rad/s at which gravity and loads outweigh inertia, and the loop sags under them."""
MUJOCO_TIMESTEP = 0.002
"""s, of MuJoCo."""
_PART_OF_TURN = 0.25
"""Time constant, as a part of a revolution, that stays the same while the timestep
changes.
"""
INTEGRATORS = ("Euler", "implicit", "implicitfast", "discrete", "RK4")
"""Integrators, all that MuJoCo 4.0 has."""


@record
class Spot:
    """One setting of one curve."""

    label: str
    settings: Settings
    edit: Edit | None = None
    """Changes the text of every loop of a trial."""
    x: float = math.nan
    """The value of the curve's setting, where it is not the steps."""


@record
class SettingCurve:
    """A row of settings that differ in one number."""

    name: str
    spots: tuple[Spot, ...]
    slow: bool = False
    """Run at SLOW instead of the scene's own speed."""
    bare: bool = False
    """Run without gravity and loads."""
    settled: bool = False
    """Judged after a first turn, where the input turns fully: from an exact start a
    soft closure first sags, and its worst error would be that of the start (three to
    four times as large) at every setting.
    """


BEST = Settings(
    steps_per_window=1,
    flywheel=TRIAL_FLYWHEEL,
    time_constant_steps=20.0,
    steps_per_revolution=MIDDLE,
)
WITHOUT_PADS = replace(BEST, pad=None, time_constant_steps=10.0)


def _vary(
    field: str,
    label: str,
    values: Iterable[float],
    settings: Settings,
    held: float | None = None,
) -> tuple[Spot, ...]:
    """Vary one field of the settings; of an impedance what it lacks to 1 counts.

    `held`: a part of a revolution at which the closure's time constant is held in
    seconds, so that the timestep alone changes; None: it is so many steps as in the
    settings.
    """
    spots = []
    for x in values:
        changed: dict[str, Any] = {field: x}
        if held is not None:
            changed["time_constant_steps"] = held * x
        place = 1.0 - x if field == "impedance" else x
        spots.append(Spot(label.format(x), replace(settings, **changed), x=place))
    return tuple(spots)


def _vary_impedance() -> tuple[Spot, ...]:
    return _vary("impedance", "d = {:g}", _IMPEDANCES, WITHOUT_PADS)


def _vary_steps(held: float | None = None, **changes: Any) -> tuple[Spot, ...]:
    """Vary the timestep of settings that are the best ones but for some changes."""
    settings = replace(BEST, **changes)
    steps = STEPS_PER_TURN if settings.integrator == "RK4" else _MORE_STEPS
    label = "{:g} steps a revolution"
    return _vary("steps_per_revolution", label, steps, settings, held)


def design_curves(scene: Scene) -> Iterator[SettingCurve]:
    """Design the curves of one scene."""
    for name in INTEGRATORS:
        yield _vary_defaults(name, abs(scene.motion.omega_2 or 1.0))
    for name in INTEGRATORS:
        spots = _vary_steps(integrator=name, time_constant_steps=10.0)
        yield SettingCurve(f"{name}, pads, tc = 10 steps", spots)
    for name in INTEGRATORS:
        yield SettingCurve(
            f"{name}, tc held", _vary_steps(_PART_OF_TURN, integrator=name)
        )
    for tc in (3.0, 30.0, 100.0):
        spots = _vary_steps(time_constant_steps=tc)
        yield SettingCurve(f"RK4, pads, tc = {tc:g} steps", spots)
    spots = _vary_steps(pad=None, time_constant_steps=10.0)
    yield SettingCurve("RK4, no pads, tc = 10 steps", spots)
    for factor in (1e2, 1e4, 1e6, 1e8):
        yield SettingCurve(f"RK4, flywheel {factor:g}", _vary_steps(flywheel=factor))
    yield SettingCurve("softness d", _vary_impedance())
    label = "tc = {:g} steps"
    tc_varied = _vary("time_constant_steps", label, TIME_CONSTANTS, WITHOUT_PADS)
    yield SettingCurve("softness tc", tc_varied)
    pads = _vary("pad", "pads {:g}", _PADS, BEST)
    yield SettingCurve("pads", (Spot("no pads", replace(BEST, pad=None), x=1.0), *pads))
    for name, bare in (("sag d, slow", False), ("sag d, slow, nothing acts", True)):
        yield SettingCurve(name, _vary_impedance(), slow=True, bare=bare)
    for solver, iterations in (("Newton", 10), ("CG", 100), ("PGS", 100)):
        settings = replace(BEST, solver=solver, iterations=iterations)
        label = solver + ", tolerance {:g}"
        spots = _vary("tolerance", label, SOLVER_TOLERANCES, settings)
        yield SettingCurve(f"tolerance, {solver}", spots)


def _vary_defaults(integrator: str, speed: float) -> SettingCurve:
    """Vary the timestep with MuJoCo's solref, solimp and solver.

    A new user gets these, with Euler at 2 ms.
    """
    steps = [*_vary_steps(integrator=integrator, pad=None)]
    if integrator == "Euler":
        n = 2.0 * math.pi / speed / MUJOCO_TIMESTEP
        settings = replace(steps[0].settings, steps_per_revolution=n)
        steps.append(Spot("MuJoCo's defaults", settings, x=n))
        steps.sort(key=lambda spot: spot.x)
    spots = tuple(replace(spot, edit=restore_defaults) for spot in steps)
    return SettingCurve(f"{integrator}, MuJoCo's defaults", spots, settled=True)
