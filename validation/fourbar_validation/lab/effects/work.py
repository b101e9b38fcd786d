"""Workloads for counting instructions: `python -m fourbar_validation.lab.effects.work ENGINE FEW MANY EFFECT...`."""

import ctypes
import gc
import math
import re
import sys
from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any

from fourbar import effects as kinds
from fourbar.linkage import Bar, FourBar
from fourbar.scene import Scene, command
from fourbar.scene.motion import Motion, Sweep
from fourbar.solve import solve

if TYPE_CHECKING:
    from fourbar.effects import Effect, Load

EFFECTS: dict[str, "Callable[[], Effect | None]"] = {
    "none": lambda: None,
    "gravity": lambda: kinds.Gravity(9.81),
    "viscous": lambda: kinds.Viscous.at(O2=0.01, A=0.01, O4=0.01),
    "viscous at pin B": lambda: kinds.Viscous.at(B=0.01),
    "friction": lambda: kinds.Friction.at(O2=0.01, A=0.01, O4=0.01),
    "friction at pin B": lambda: kinds.Friction.at(B=0.01),
    "pin_friction": lambda: kinds.PinFriction.at(O2=(0.1, 0.01), A=(0.1, 0.01), B=(0.1, 0.01), O4=(0.1, 0.01)),
    "torsion": lambda: kinds.Torsion.at(O4=(2.0, 1.9, 0.1)),
    "springs": lambda: kinds.Springs(
        (kinds.Spring(kinds.SpringEnd(1, 0.1, -1.5), kinds.SpringEnd(4, 0.08, 0.0), 200.0, 0.05, 3.0),)
    ),
    "flywheel": lambda: kinds.Flywheel(0.02),
    "load": lambda: kinds.Load(4, (3.0, 0.7), (0.05, 1.0), 0.2),
    "load over theta_2": lambda: kinds.Load(
        4, (3.0, 0.7), (0.05, 1.0), 0.2, "world", kinds.Table((0.0, 3.0, math.tau), (0.0, 1.0, 0.0))
    ),
}
"""What is counted, each by itself on the same linkage; made when requested, so that a build without one still works."""
DEFAULT_FLAGS = "none, MuJoCo's default flags"
LEFT_ON = "none, {} left on"
"""One flag of MuJoCo as it is by default, the others as the generated MJCF has them."""
POSITIONS = 1000
"""Of the formulas in one unit of work: they take arrays."""


def scene(effect: str, positions: int) -> Scene:
    """A crank-rocker of uniform bars with one effect."""
    linkage = FourBar(0.3, Bar(0.1, 0.2), Bar(0.25, 0.5), Bar(0.22, 0.4))
    term = EFFECTS[effect]()
    loads: tuple[Load, ...] = (term,) if isinstance(term, getattr(kinds, "Load", ())) else ()  # type: ignore[assignment]
    effects = () if term is None or loads else (term,)
    return Scene(linkage, Motion(Sweep(0.13, 0.13 + math.tau, positions - 1), 10.0), loads=loads, effects=effects)


def formulas(effect: str) -> Callable[[int], Any]:
    """Pin forces and torque at POSITIONS positions, a given number of times."""
    given = scene(effect, POSITIONS)

    def work(amount: int) -> None:
        for _ in range(amount):
            solve(given, "force")

    return work


def simulated(effect: str) -> Callable[[int], Any]:
    """A given number of steps of the generated MJCF."""
    from fourbar.mjcf import mjcf
    from fourbar_validation.engines.mujoco.stepping import steps

    text = mjcf(scene(effect if effect in EFFECTS else "none", 91))
    if effect == DEFAULT_FLAGS:
        text = re.sub(r"<flag [^>]*/>", "", text)
    elif effect not in EFFECTS:
        text = text.replace(f' {flags()[effect]}="disable"', "")
    return steps(text)


@cache
def flags() -> dict[str, str]:
    """The flags that the MJCF of a bare scene switches off, by the name of the workload that leaves one on."""
    from fourbar.mjcf import mjcf

    found = re.findall(r'(\w+)="disable"', mjcf(scene("none", 91)))
    return {LEFT_ON.format(flag): flag for flag in found}


def inverse(adapter: str) -> Callable[[str], Callable[[int], Any]]:
    """Answers of an inverse engine at a given number of positions."""

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


def bracketed(work: Callable[[int], Any], amount: int) -> None:
    """The work within one call of C through ctypes: valgrind counts what runs inside `ffi_call`, and nothing else."""

    def called(*_: object) -> int:
        work(amount)
        return 0

    compares = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)(called)
    one = ctypes.create_string_buffer(8)
    # a search among one element compares once
    ctypes.CDLL(None).bsearch(one, one, ctypes.c_size_t(1), ctypes.c_size_t(8), compares)


def main() -> None:
    """Prepare everything requested, then work, each by itself, a little and more: what a call costs is in both."""
    engine, few, many, *effects = sys.argv[1:]
    works = [ENGINES[engine](effect) for effect in effects]
    for work in works:
        work(2)
    gc.collect()
    gc.disable()
    for work in works:
        bracketed(work, int(few))
        bracketed(work, int(many))


if __name__ == "__main__":
    main()
