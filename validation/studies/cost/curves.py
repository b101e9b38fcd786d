"""What the study tries: one dial at a time around the recommended settings and around MuJoCo's defaults."""

import math
from dataclasses import dataclass, replace
from functools import partial

from fourbar.mjcf import Settings
from fourbar.scene import Scene
from validation.engines.mujoco import drives
from validation.engines.mujoco.dialled import FLYWHEEL
from validation.engines.mujoco.trial import Build

STEPS = (20, 40, 80, 160, 320, 640, 1280, 2560)
MORE_STEPS = (*STEPS, 5120, 10240)
"""Per revolution; a first-order integrator needs more."""
MIDDLE = 640
"""Steps per revolution where a dial other than the timestep is turned."""
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
"""All that MuJoCo 4.0 has."""


@dataclass(frozen=True, slots=True)
class Spot:
    """One setting of one curve."""

    label: str
    settings: Settings
    build: Build | None = None
    x: float = math.nan
    """What the curve's dial stands at, where it is not the steps."""


@dataclass(frozen=True, slots=True)
class Curve:
    """A row of settings that differ in one dial."""

    name: str
    dial: str
    """ "steps", "1-d", "tc", "tolerance", "regularisation" or "pads"."""
    spots: tuple[Spot, ...]
    slow: bool = False
    """Run at SLOW instead of the scene's own speed."""
    bare: bool = False
    """Run without gravity and loads."""
    settled: bool = False
    """Judged after a first turn, where the input turns fully: from an exact start a soft closure first sags, and its
    worst error would be that of the start (three to four times as large) at every setting."""


BEST = Settings(steps_per_window=1, flywheel=FLYWHEEL, time_constant_steps=20.0, steps_per_revolution=MIDDLE)


def over_steps(
    name: str, settings: Settings, build: Build | None = None, steps: tuple[int, ...] = STEPS, label: str = ""
) -> Curve:
    """A curve over the timestep."""
    return Curve(
        name,
        "steps",
        tuple(Spot(f"{label or name}, {n}/rev", replace(settings, steps_per_revolution=n), build, n) for n in steps),
    )


def held(name: str, settings: Settings, steps: tuple[int, ...]) -> Curve:
    """Over the timestep with the closure's time constant held in seconds, so that the timestep alone changes."""
    return Curve(
        name,
        "steps",
        tuple(
            Spot(
                f"{name}, {n}/rev",
                replace(settings, steps_per_revolution=n, time_constant_steps=PART_OF_TURN * n),
                None,
                n,
            )
            for n in steps
        ),
    )


def curves(scene: Scene) -> list[Curve]:
    """The design for one scene."""
    speed = abs(scene.motion.omega_2 or 1.0)
    found = [_with_default_closure(name, speed) for name in INTEGRATORS]
    found += [
        over_steps(
            f"{name}, pads, tc = 10 h", replace(BEST, integrator=name, time_constant_steps=10.0), None, _ladder(name)
        )
        for name in INTEGRATORS
    ]
    found += [held(f"{name}, tc held", replace(BEST, integrator=name), _ladder(name)) for name in INTEGRATORS]
    found += [
        over_steps(f"RK4, pads, tc = {tc:g} h", replace(BEST, time_constant_steps=tc)) for tc in (3.0, 30.0, 100.0)
    ]
    found.append(over_steps("RK4, no pads, tc = 10 h", replace(BEST, pad=None, time_constant_steps=10.0)))
    found += _softness()
    found += _tolerance()
    if scene.motion.alpha_2 == 0.0:
        found += _drives()
    return found


def _ladder(integrator: str) -> tuple[int, ...]:
    return STEPS if integrator == "RK4" else MORE_STEPS


def _with_default_closure(integrator: str, speed: float) -> Curve:
    """MuJoCo's solref, solimp and solver; Euler at 2 ms is what a new user gets."""
    settings = replace(BEST, integrator=integrator, pad=None)
    curve = over_steps(f"{integrator}, MuJoCo's defaults", settings, drives.all_defaults, _ladder(integrator))
    curve = replace(curve, settled=True)
    if integrator != "Euler":
        return curve
    n = 2.0 * math.pi / speed / DEFAULT_TIMESTEP
    spot = Spot("MuJoCo's defaults", replace(settings, steps_per_revolution=n), drives.all_defaults, n)
    return replace(curve, spots=tuple(sorted((*curve.spots, spot), key=lambda each: each.x)))


def _softness() -> list[Curve]:
    plain = replace(BEST, pad=None, time_constant_steps=10.0)
    by_d = tuple(Spot(f"d = {d:g}", replace(plain, impedance=d), None, 1.0 - d) for d in IMPEDANCES)
    by_tc = tuple(Spot(f"tc = {tc:g} h", replace(plain, time_constant_steps=tc), None, tc) for tc in TIME_CONSTANTS)
    soft = tuple(replace(spot, settings=replace(spot.settings, impedance=0.999)) for spot in by_tc)
    return [
        Curve("softness d", "1-d", by_d),
        Curve("softness tc", "tc", by_tc),
        Curve("sag d, slow", "1-d", by_d, slow=True),
        Curve("sag tc, slow", "tc", soft, slow=True),
        Curve("sag d, slow, nothing acts", "1-d", by_d, slow=True, bare=True),
        Curve(
            "regularisation edited",
            "regularisation",
            tuple(
                Spot(f"body_invweight0 x {f:g}", replace(BEST, pad=None), partial(_softened, factor=f), f)
                for f in REGULARISATIONS
            ),
        ),
        Curve(
            "pads",
            "pads",
            tuple(Spot("no pads" if f is None else f"pads {f:g}", replace(BEST, pad=f), None, f or 1.0) for f in PADS),
        ),
    ]


def _softened(text: str, _omega: float, factor: float) -> drives.Softened:
    return drives.Softened(text, factor)


def _tolerance() -> list[Curve]:
    return [
        Curve(
            f"tolerance, {solver}",
            "tolerance",
            tuple(
                Spot(
                    f"{solver}, tolerance {tol:g}",
                    replace(BEST, solver=solver, tolerance=tol, iterations=10 if solver == "Newton" else 100),
                    None,
                    tol,
                )
                for tol in TOLERANCES
            ),
        )
        for solver in ("Newton", "CG", "PGS")
    ]


def _drives() -> list[Curve]:
    """Each drive with the integrator that carries it."""
    at = replace(BEST, flywheel=1.0)
    fast = replace(at, integrator="implicitfast", time_constant_steps=3.0)
    found = [over_steps(f"flywheel {f:g}, RK4", replace(BEST, flywheel=f)) for f in (1e2, 1e4, 1e6, 1e8)]
    found.append(over_steps("joint equality, RK4", at, drives.WheelEquality))
    found.append(over_steps("joint equality, softness edited, RK4", at, drives.StiffWheelEquality))
    found.append(over_steps("servo, implicitfast", fast, drives.Servo, MORE_STEPS))
    found.append(over_steps("gentle servo, RK4", at, drives.GentleServo))
    found.append(over_steps("velocity actuator, implicitfast", fast, drives.VelocityActuator, MORE_STEPS))
    found.append(over_steps("gentle velocity actuator, RK4", at, drives.GentleVelocityActuator))
    return found
