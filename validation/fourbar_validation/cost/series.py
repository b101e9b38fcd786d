"""List what the study tries: one setting at a time is changed.

The other settings are the recommended ones or MuJoCo's defaults.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

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
_SAGGING_CONSTANTS = (3.0, 4.0, 5.0, 7.0, 10.0)
"""Steps of the time constant: longer ones follow the load through a turn too late."""
_SAGGING = 0.999
"""Impedance at which a slow linkage sags well above the truncation."""
_MANY_STEPS = 10240
"""Steps per revolution at which a time constant of ten steps is too short to sag."""
SOLVER_TOLERANCES = (0.0, 1e-16, 1e-14, 1e-12, 1e-10, 1e-8, 1e-6)
_PADS = (None, 1e-1, 1e-2, 1e-3, 1e-4)
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


@dataclass(frozen=True, slots=True)
class Spot:
    """One setting of one curve."""

    label: str
    settings: Settings
    edit: Edit | None = None
    """Changes the text of every loop of a trial."""
    x: float = math.nan
    """The value of the curve's setting, where it is not the steps."""


@dataclass(frozen=True, slots=True)
class Curve:
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


def make_curve(
    name: str,
    label: str,
    values: Iterable[float],
    settings: Callable[[float], Settings],
    edit: Edit | None = None,
) -> Curve:
    """Make a curve over the values of a setting, each with its label and settings."""
    spots = [Spot(label.format(x), settings(x), edit, x) for x in values]
    return Curve(name, tuple(spots))


def _trace_steps(
    name: str,
    settings: Settings,
    edit: Edit | None = None,
    steps: Iterable[int] = STEPS_PER_TURN,
    held: float | None = None,
) -> Curve:
    """Make a curve over the timestep.

    `held`: a part of a revolution at which the closure's time constant is held in
    seconds, so that the timestep alone changes; None: it is so many steps as in the
    settings.
    """

    def at(n: float) -> Settings:
        tc = settings.time_constant_steps if held is None else held * n
        return replace(settings, steps_per_revolution=n, time_constant_steps=tc)

    return make_curve(name, "{:g} steps a revolution", steps, at, edit)


def design_curves(scene: Scene) -> list[Curve]:
    """Design the curves of one scene."""
    curves = [
        _vary_default_closure(name, abs(scene.motion.omega_2 or 1.0))
        for name in INTEGRATORS
    ]
    for suffix, tc, held in (
        ("pads, tc = 10 steps", 10.0, None),
        ("tc held", 20.0, _PART_OF_TURN),
    ):
        for name in INTEGRATORS:
            settings = replace(BEST, integrator=name, time_constant_steps=tc)
            curves.append(
                _trace_steps(
                    f"{name}, {suffix}",
                    settings,
                    steps=_choose_ladder(name),
                    held=held,
                )
            )
    for tc in (3.0, 30.0, 100.0):
        curves.append(
            _trace_steps(
                f"RK4, pads, tc = {tc:g} steps", replace(BEST, time_constant_steps=tc)
            )
        )
    curves.append(_trace_steps("RK4, no pads, tc = 10 steps", WITHOUT_PADS))
    for factor in (1e2, 1e4, 1e6, 1e8):
        settings = replace(BEST, flywheel=factor)
        curves.append(_trace_steps(f"RK4, flywheel {factor:g}", settings))
    return [*curves, *_vary_softness(), *_vary_sag(), *_vary_tolerance()]


WITHOUT_PADS = replace(BEST, pad=None, time_constant_steps=10.0)


def _choose_ladder(integrator: str) -> tuple[int, ...]:
    if integrator == "RK4":
        return STEPS_PER_TURN
    return _MORE_STEPS


def _vary_default_closure(integrator: str, speed: float) -> Curve:
    """Vary MuJoCo's solref, solimp and solver around Euler at 2 ms.

    A new user gets these.
    """
    settings = replace(BEST, integrator=integrator, pad=None)
    curve = _trace_steps(
        f"{integrator}, MuJoCo's defaults",
        settings,
        restore_defaults,
        steps=_choose_ladder(integrator),
    )
    spots = list(curve.spots)
    if integrator == "Euler":
        n = 2.0 * math.pi / speed / MUJOCO_TIMESTEP
        spots.append(
            Spot(
                "MuJoCo's defaults",
                replace(settings, steps_per_revolution=n),
                restore_defaults,
                x=n,
            )
        )
    return replace(
        curve,
        spots=tuple(sorted(spots, key=lambda spot: spot.x)),
        settled=True,
    )


def _vary_softness() -> list[Curve]:
    pads = (
        Spot(
            "no pads" if f is None else f"pads {f:g}",
            replace(BEST, pad=f),
            x=f or 1.0,
        )
        for f in _PADS
    )
    by_tc = make_curve(
        "softness tc",
        "tc = {:g} steps",
        TIME_CONSTANTS,
        lambda tc: replace(WITHOUT_PADS, time_constant_steps=tc),
    )
    return [
        Curve("softness d", _list_impedances()),
        by_tc,
        Curve("pads", tuple(pads)),
    ]


def _list_impedances() -> tuple[Spot, ...]:
    return tuple(
        Spot(f"d = {d:g}", replace(WITHOUT_PADS, impedance=d), x=1.0 - d)
        for d in _IMPEDANCES
    )


def _vary_sag() -> list[Curve]:
    """Vary what a loop at rest would sag by.

    The rest of the error at a short time constant is varied too.
    """
    by_tc = make_curve(
        "sag tc, slow",
        "tc = {:g} steps",
        _SAGGING_CONSTANTS,
        lambda tc: replace(WITHOUT_PADS, impedance=_SAGGING, time_constant_steps=tc),
    )
    short = Spot(
        f"{_MANY_STEPS} steps a revolution",
        replace(WITHOUT_PADS, impedance=_SAGGING, steps_per_revolution=_MANY_STEPS),
        x=_MANY_STEPS,
    )
    return [
        Curve("sag d, slow", _list_impedances(), slow=True),
        replace(by_tc, slow=True),
        Curve("softness alone, slow", (short,), slow=True),
        Curve("sag d, slow, nothing acts", _list_impedances(), slow=True, bare=True),
    ]


def _vary_tolerance() -> list[Curve]:
    curves = []
    for solver, iterations in (("Newton", 10), ("CG", 100), ("PGS", 100)):
        settings = replace(BEST, solver=solver, iterations=iterations)
        label = solver + ", tolerance {:g}"
        curves.append(
            make_curve(
                f"tolerance, {solver}",
                label,
                SOLVER_TOLERANCES,
                lambda x, s=settings: replace(s, tolerance=x),  # type: ignore[misc]
            )
        )
    return curves
