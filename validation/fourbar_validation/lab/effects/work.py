"""What is timed of each effect in each engine: workloads on one linkage."""

import math
import re
from collections.abc import Callable
from functools import cache
from typing import Any

from fourbar import effects as kinds
from fourbar.linkage import Bar, FourBar
from fourbar.scene import Scene, command
from fourbar.scene.motion import Motion, Sweep
from fourbar.solve import solve

EFFECTS: dict[str, kinds.Effect | None] = {
    "none": None,
    "gravity": kinds.Gravity(9.81),
    "viscous": kinds.Viscous.at(O2=0.01, A=0.01, O4=0.01),
    "viscous at pin B": kinds.Viscous.at(B=0.01),
    "friction": kinds.Friction.at(O2=0.01, A=0.01, O4=0.01),
    "friction at pin B": kinds.Friction.at(B=0.01),
    "pin_friction": kinds.PinFriction.at(O2=(0.1, 0.01), A=(0.1, 0.01), B=(0.1, 0.01), O4=(0.1, 0.01)),
    "torsion": kinds.Torsion.at(O4=(2.0, 1.9, 0.1)),
    "springs": kinds.Springs(
        (kinds.Spring(kinds.SpringEnd(1, 0.1, -1.5), kinds.SpringEnd(4, 0.08, 0.0), 200.0, 0.05, 3.0),)
    ),
    "flywheel": kinds.Flywheel(0.02),
    "load": kinds.Load(4, (3.0, 0.7), (0.05, 1.0), 0.2),
    "load over theta_2": kinds.Load(
        4, (3.0, 0.7), (0.05, 1.0), 0.2, "world", kinds.Table((0.0, 3.0, math.tau), (0.0, 1.0, 0.0))
    ),
}
"""By name, each by itself on the same linkage."""
DEFAULT_FLAGS = "none, MuJoCo's default flags"
LEFT_ON = "none, {} left on"
"""One flag of MuJoCo as it is by default, the others as the generated MJCF has them."""
POSITIONS = 1000
"""Of the formulas in one unit of work: they take arrays."""


def scene(effect: str, positions: int) -> Scene:
    """Build a crank-rocker of uniform bars with one effect."""
    linkage = FourBar(0.3, Bar(0.1, 0.2), Bar(0.25, 0.5), Bar(0.22, 0.4))
    acting = EFFECTS[effect]
    loads = (acting,) if isinstance(acting, kinds.Load) else ()
    effects = () if acting is None or loads else (acting,)
    return Scene(linkage, Motion(Sweep(0.13, 0.13 + math.tau, positions - 1), 10.0), loads=loads, effects=effects)


def formulas(effect: str) -> Callable[[int], Any]:
    """Prepare pin forces and torque at POSITIONS positions, a given number of times."""
    given = scene(effect, POSITIONS)

    def work(amount: int) -> None:
        for _ in range(amount):
            solve(given, "force")

    return work


def simulated(effect: str) -> Callable[[int], Any]:
    """Prepare a given number of steps of the generated MJCF."""
    from fourbar.mjcf import write_mjcf
    from fourbar_validation.engines.mujoco.stepping import make_stepper

    text = write_mjcf(scene(effect if effect in EFFECTS else "none", 91))
    if effect == DEFAULT_FLAGS:
        text = re.sub(r"<flag [^>]*/>", "", text)
    elif effect not in EFFECTS:
        text = text.replace(f' {list_flags()[effect]}="disable"', "")
    return make_stepper(text)


@cache
def list_flags() -> dict[str, str]:
    """List the flags that the MJCF of a bare scene switches off, by the name of the workload that leaves one on."""
    from fourbar.mjcf import write_mjcf

    result = re.findall(r'(\w+)="disable"', write_mjcf(scene("none", 91)))
    return {LEFT_ON.format(flag): flag for flag in result}


def inverse(adapter: str) -> Callable[[str], Callable[[int], Any]]:
    """Make workloads of an inverse engine: its answers at a given number of positions."""

    def prepare(effect: str) -> Callable[[int], Any]:
        from importlib import import_module

        module, _, name = adapter.partition(":")
        engine = getattr(import_module(module), name)()

        def work(amount: int) -> None:
            given = scene(effect, amount)
            engine.answer(given, command(given))

        return work

    return prepare


ENGINES: dict[str, Callable[[str], Callable[[int], Any]]] = {
    "formulas": formulas,
    "mujoco-simulated": simulated,
    "mujoco-inverse": inverse("fourbar_validation.engines.mujoco.inverse:MujocoInverse"),
    "pinocchio-inverse": inverse("fourbar_validation.engines.pinocchio:PinocchioInverse"),
}
