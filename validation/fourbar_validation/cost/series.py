"""List what the study tries: one setting at a time around the recommended settings and around MuJoCo's defaults."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

from fourbar.mjcf import Settings
from fourbar.scene import Scene
from fourbar_validation.engines.mujoco import drives
from fourbar_validation.engines.mujoco.trial import FLYWHEEL, Build

STEPS = (20, 40, 80, 160, 320, 640, 1280, 2560)
MORE_STEPS = (*STEPS, 5120, 10240)
"""Steps per revolution; a first-order integrator needs more."""
MIDDLE = 640
"""Steps per revolution where a setting other than the timestep changes."""
IMPEDANCES = (0.9, 0.97, 0.99, 0.997, 0.999, 0.9997, 0.9999)
TIME_CONSTANTS = (3.0, 5.0, 10.0, 20.0, 40.0, 80.0)
TOLERANCES = (0.0, 1e-16, 1e-14, 1e-12, 1e-10, 1e-8, 1e-6)
REGULARISATIONS = (1.0, 1e-2, 1e-4, 1e-6, 1e-8)
PADS = (None, 1e-1, 1e-2, 1e-3, 1e-4)
SLOW = 0.1
"""rad/s at which gravity and loads outweigh inertia, and the loop sags under them."""
DEFAULT_TIMESTEP = 0.002
"""s, of MuJoCo."""
PART_OF_TURN = 0.25
"""Time constant, as a part of a revolution, that stays what it is while the timestep changes."""
INTEGRATORS = ("Euler", "implicit", "implicitfast", "discrete", "RK4")
"""Integrators, all that MuJoCo 4.0 has."""


@dataclass(frozen=True, slots=True)
class Spot:
    """One setting of one curve."""

    label: str
    settings: Settings
    build: Build | None = None
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
    """Judged after a first turn, where the input turns fully: from an exact start a soft closure first sags, and its
    worst error would be that of the start (three to four times as large) at every setting."""


BEST = Settings(
    steps_per_window=1,
    flywheel=FLYWHEEL,
    time_constant_steps=20.0,
    steps_per_revolution=MIDDLE,
)


def trace(
    name: str,
    label: str,
    values: Iterable[float],
    settings: Callable[[float], Settings],
    build: Callable[[float], Build | None] = lambda _: None,
) -> Curve:
    """Make a curve over the values of a setting, each with its label, settings and build."""
    return Curve(
        name, tuple(Spot(label.format(x), settings(x), build(x), x) for x in values)
    )


def trace_steps(
    name: str,
    settings: Settings,
    build: Build | None = None,
    steps: Iterable[int] = STEPS,
    held: float | None = None,
) -> Curve:
    """Make a curve over the timestep.

    `held`: a part of a revolution at which the closure's time constant is held in seconds, so that the timestep alone
    changes; None: it is so many steps as in the settings.
    """

    def at(n: float) -> Settings:
        tc = settings.time_constant_steps if held is None else held * n
        return replace(settings, steps_per_revolution=n, time_constant_steps=tc)

    return trace(name, name + ", {:g}/rev", steps, at, lambda _: build)


def design_curves(scene: Scene) -> list[Curve]:
    """Design the curves of one scene."""
    curves = [
        _vary_default_closure(name, abs(scene.motion.omega_2 or 1.0))
        for name in INTEGRATORS
    ]
    for suffix, tc, held in (
        ("pads, tc = 10 h", 10.0, None),
        ("tc held", 20.0, PART_OF_TURN),
    ):
        for name in INTEGRATORS:
            settings = replace(BEST, integrator=name, time_constant_steps=tc)
            curves.append(
                trace_steps(
                    f"{name}, {suffix}", settings, None, _choose_ladder(name), held
                )
            )
    for tc in (3.0, 30.0, 100.0):
        curves.append(
            trace_steps(
                f"RK4, pads, tc = {tc:g} h", replace(BEST, time_constant_steps=tc)
            )
        )
    curves.append(trace_steps("RK4, no pads, tc = 10 h", PLAIN))
    curves += [*_vary_softness(), *_vary_tolerance()]
    return curves + (_vary_drives() if scene.motion.alpha_2 == 0.0 else [])


PLAIN = replace(BEST, pad=None, time_constant_steps=10.0)


def _choose_ladder(integrator: str) -> tuple[int, ...]:
    return STEPS if integrator == "RK4" else MORE_STEPS


def _vary_default_closure(integrator: str, speed: float) -> Curve:
    """Vary MuJoCo's solref, solimp and solver around Euler at 2 ms, which a new user gets."""
    settings = replace(BEST, integrator=integrator, pad=None)
    curve = trace_steps(
        f"{integrator}, MuJoCo's defaults",
        settings,
        drives.restore_defaults,
        _choose_ladder(integrator),
    )
    spots = list(curve.spots)
    if integrator == "Euler":
        n = 2.0 * math.pi / speed / DEFAULT_TIMESTEP
        spots.append(
            Spot(
                "MuJoCo's defaults",
                replace(settings, steps_per_revolution=n),
                drives.restore_defaults,
                n,
            )
        )
    return replace(
        curve, spots=tuple(sorted(spots, key=lambda spot: spot.x)), settled=True
    )


def _vary_softness() -> list[Curve]:
    by_d = tuple(
        Spot(f"d = {d:g}", replace(PLAIN, impedance=d), None, 1.0 - d)
        for d in IMPEDANCES
    )

    def by_tc(name: str, impedance: float) -> Curve:
        return trace(
            name,
            "tc = {:g} h",
            TIME_CONSTANTS,
            lambda tc: replace(PLAIN, impedance=impedance, time_constant_steps=tc),
        )

    pads = (
        Spot(
            "no pads" if f is None else f"pads {f:g}",
            replace(BEST, pad=f),
            None,
            f or 1.0,
        )
        for f in PADS
    )
    return [
        Curve("softness d", by_d),
        by_tc("softness tc", PLAIN.impedance),
        Curve("sag d, slow", by_d, slow=True),
        replace(by_tc("sag tc, slow", 0.999), slow=True),
        Curve("sag d, slow, nothing acts", by_d, slow=True, bare=True),
        trace(
            "regularisation edited",
            "body_invweight0 x {:g}",
            REGULARISATIONS,
            lambda _: replace(BEST, pad=None),
            lambda factor: lambda text, _: drives.Softened(text, factor),
        ),
        Curve("pads", tuple(pads)),
    ]


def _vary_tolerance() -> list[Curve]:
    curves = []
    for solver, iterations in (("Newton", 10), ("CG", 100), ("PGS", 100)):
        settings = replace(BEST, solver=solver, iterations=iterations)
        label = solver + ", tolerance {:g}"
        curves.append(
            trace(
                f"tolerance, {solver}",
                label,
                TOLERANCES,
                lambda x, s=settings: replace(s, tolerance=x),  # type: ignore[misc]
            )
        )
    return curves


def _vary_drives() -> list[Curve]:
    """List each drive with the integrator that carries it."""
    light = replace(BEST, flywheel=1.0)
    fast = replace(light, integrator="implicitfast", time_constant_steps=3.0)
    curves = [
        trace_steps(f"flywheel {f:g}, RK4", replace(BEST, flywheel=f))
        for f in (1e2, 1e4, 1e6, 1e8)
    ]
    tried: list[tuple[str, Build]] = [
        ("joint equality, RK4", drives.WheelEquality),
        ("joint equality, softness edited, RK4", drives.StiffWheelEquality),
        ("servo, implicitfast", drives.Servo),
        ("gentle servo, RK4", drives.GentleServo),
        ("velocity actuator, implicitfast", drives.VelocityActuator),
        ("gentle velocity actuator, RK4", drives.GentleVelocityActuator),
    ]
    for name, drive in tried:
        carried = (light, drive) if name.endswith("RK4") else (fast, drive, MORE_STEPS)
        curves.append(trace_steps(name, *carried))
    return curves
