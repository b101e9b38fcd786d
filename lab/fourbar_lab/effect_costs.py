"""`python -m fourbar_lab effects`: what each effect and flag costs in time.

The flags are those of MuJoCo; each engine is timed.
"""

import math
import re
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cache, partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np

from fourbar import effects as kinds
from fourbar.errors import DependencyError, InputError
from fourbar.files import loads
from fourbar.linkage import PINS
from fourbar.mjcf import write_mjcf
from fourbar.scene import Scene, command
from fourbar.scene.motion import Motion, Sweep
from fourbar.solving import solve
from fourbar_lab.contenders import CONTENDED_LINKAGE
from fourbar_lab.tables import show_table
from fourbar_validation.advise.clocks import time_call, time_in_turns
from fourbar_validation.engines.description import declares
from fourbar_validation.engines.registry import ENGINES, ask_at

LENGTHS_TEXT = 'ground = "30 cm"\ninput = "10 cm"\ncoupler = "25 cm"\noutput = "22 cm"'
_OTHER_PINS = ("O2", "A", "O4")
_LOAD = kinds.Load(4, (3.0, 0.7), arm=(0.05, 1.0), moment=0.2)
EFFECTS: dict[str, kinds.Effect | None] = {"none": None}
EFFECTS |= {
    key: loads(f"[lengths]\n{LENGTHS_TEXT}\n[effects]\n{kind.example}").effects[0]
    for key, kind in kinds.list_kinds().items()
}
EFFECTS |= {
    "viscous": kinds.Viscous.at(**dict.fromkeys(_OTHER_PINS, 0.01)),
    "viscous at pin B": kinds.Viscous.at(B=0.01),
    "friction": kinds.Friction.at(**dict.fromkeys(_OTHER_PINS, 0.01)),
    "friction at pin B": kinds.Friction.at(B=0.01),
    "pin_friction": kinds.PinFriction.at(**dict.fromkeys(PINS, (0.1, 0.01))),
    "torsion": kinds.Torsion.at(O4=(2.0, 1.9, 0.1)),
    "load": _LOAD,
    "load over theta_2": replace(
        _LOAD, table=kinds.Table((0.0, 3.0, math.tau), (0.0, 1.0, 0.0))
    ),
}
"""Effects by name, each alone on the same linkage: as in the example of a scene file,
unless it is written here.
"""
SIMULATION = "mujoco-simulated"
NO_COUNTERPART = {
    (SIMULATION, name)
    for name, effect in EFFECTS.items()
    if name == "load over theta_2"
    or (effect is not None and not declares(effect, "add_to_mjcf"))
}
DEFAULT_FLAGS = "none, MuJoCo's default flags"
_LEFT_ON = "none, {} left on"
"""One flag of MuJoCo as it is by default, the others as the generated MJCF has them."""
POSITIONS_OF_A_CALL = 1000
"""Positions of the formulas in one unit of work, as they take arrays."""
PAIRS_OF_RUNS = 31
"""Pairs of runs, first one ahead and then the other."""
_AMOUNTS = {
    "formulas": 40,
    SIMULATION: 1000,
    "mujoco-inverse": 100,
    "pinocchio-inverse": 100,
}
"""Units of work of one run. It takes 10 to 20 ms, long against the clock's resolution
and short against disturbances.
"""
CAPTION_OF_THE_TABLE = (
    "Processor time of a position, of a step of the simulation (RK4), in us without"
    " effects; with an effect relative to that: the median of the ratios of"
    " neighbouring runs and their middle half."
)


def make_effect_scene(effect: str, positions: int) -> Scene:
    """Build a crank-rocker of uniform bars with one effect."""
    acting = EFFECTS[effect]
    loads = (acting,) if isinstance(acting, kinds.Load) else ()
    effects = () if acting is None or loads else (acting,)
    return Scene(
        CONTENDED_LINKAGE,
        Motion(Sweep(0.13, 0.13 + math.tau, positions - 1), 10.0),
        loads=loads,
        effects=effects,
    )


def _prepare_formulas(effect: str) -> Callable[[int], Any]:
    """Prepare pin forces and torque at POSITIONS_OF_A_CALL positions, some times."""
    scene = make_effect_scene(effect, POSITIONS_OF_A_CALL)
    return lambda amount: [solve(scene, "force") for _ in range(amount)]


def prepare_simulation(effect: str) -> Callable[[int], Any]:
    """Prepare a given number of steps of the generated MJCF."""
    from fourbar_validation.engines.mujoco.closed_loop import make_stepper

    text = write_mjcf(make_effect_scene(effect if effect in EFFECTS else "none", 91))
    if effect == DEFAULT_FLAGS:
        text = re.sub(r"<flag [^>]*/>", "", text)
    elif effect not in EFFECTS:
        text = text.replace(f' {_list_flags()[effect]}="disable"', "")
    return make_stepper(text)


@cache
def _list_flags() -> dict[str, str]:
    """List the flags that the MJCF of a bare scene switches off.

    The key is the name of the workload that leaves one on.
    """
    flags = re.findall(r'(\w+)="disable"', write_mjcf(make_effect_scene("none", 91)))
    return {_LEFT_ON.format(flag): flag for flag in flags}


def _prepare_answers(name: str, effect: str) -> Callable[[int], Any]:
    """Prepare the answers of an inverse engine at a given number of positions."""
    adapter = next(engine for engine in ENGINES if engine.name == name).start()

    def work(amount: int) -> None:
        scene = make_effect_scene(effect, amount)
        ask_at(adapter, scene, command(scene))

    return work


WORKLOADS: dict[str, Callable[[str], Callable[[int], Any]]] = {
    "formulas": _prepare_formulas,
    SIMULATION: prepare_simulation,
    "mujoco-inverse": partial(_prepare_answers, "mujoco-inverse"),
    "pinocchio-inverse": partial(_prepare_answers, "pinocchio-inverse"),
}


class EffectCost(NamedTuple):
    """Time with one effect or flag in one engine, as a ratio to that of the bare scene.

    Ratios are of neighbouring runs: the median and the quartiles.
    """

    engine: str
    effect: str
    seconds: float
    """Seconds for the bare scene, per position or step."""
    low: float
    median: float
    high: float
    """The middle half of the pairs lies between low and high."""


def measure_effect(
    engine: str,
    effect: str,
    rounds: int = PAIRS_OF_RUNS,
) -> EffectCost:
    """Time neighbouring runs with and without an effect, and return their ratio.

    Other work on the machine slows both runs of a pair alike.
    """
    amount = _AMOUNTS[engine]
    clocks = {}
    for which, name in enumerate(("none", effect)):
        work = partial(WORKLOADS[engine](name), amount)
        work()
        clocks[which] = partial(time_call, work)
    bare, loaded = map(np.array, time_in_turns(clocks, rounds).values())
    units = amount * (POSITIONS_OF_A_CALL if engine == "formulas" else 1)
    return EffectCost(
        engine,
        effect,
        float(np.median(bare)) / units,
        *np.percentile(loaded / bare, [25, 50, 75]).tolist(),
    )


def list_cost_rows(costs: Iterable[EffectCost]) -> tuple[list[str], list[list[str]]]:
    """Return the names of the engines, and a row for each effect.

    A row has the name of the effect and a text for each engine: the time without
    effects in us, otherwise what the effect adds to it in %, and the quartiles.
    """
    by_name = {(one.engine, one.effect): one for one in costs}
    engines = list(dict.fromkeys(engine for engine, _ in by_name))
    table = []
    for effect in dict.fromkeys(effect for _, effect in by_name):
        cells = [effect]
        for engine in engines:
            one = by_name.get((engine, effect))
            if one is None:
                cells.append("no counterpart" if effect in EFFECTS else "")
            elif effect == "none":
                cells.append(f"{1e6 * one.seconds:.3g} us")
            else:
                low, median, high = (
                    f"{100.0 * (ratio - 1.0):+.0f}" for ratio in one[3:]
                )
                cells.append(f"{median} % [{low}, {high}]")
        table.append(cells)
    return engines, table


def list_pairs(
    engines: tuple[str, ...],
    effects: tuple[str, ...],
) -> list[tuple[str, str]]:
    """Pair each engine with each effect that it has.

    The simulation is paired with each flag that the bare scene switches off.
    """
    chosen = [pair for pair in product(engines, effects) if pair not in NO_COUNTERPART]
    if SIMULATION in engines:
        chosen += [(SIMULATION, name) for name in (DEFAULT_FLAGS, *_list_flags())]
    return chosen


@click.command()
@click.option(
    "--engines",
    metavar="NAMES",
    default=",".join(WORKLOADS),
    show_default=True,
    help="Comma-separated.",
)
@click.option("--only", metavar="NAMES", help="Comma-separated; left out: all.")
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Write the table as Markdown too.",
)
def effects(
    engines: str,
    only: str | None,
    out: Path | None,
) -> int:
    """Time each effect in each engine, and each flag of MuJoCo; a minute."""
    from rich.progress import track

    wanted = tuple(name.strip() for name in engines.split(","))
    if only is None:
        chosen = tuple(EFFECTS)
    else:
        chosen = tuple(dict.fromkeys(["none", *only.split(",")]))
    for option, names, allowed in (
        ("--engines", wanted, WORKLOADS),
        ("--only", chosen, EFFECTS),
    ):
        for name in names:
            if name not in allowed:
                raise InputError(option, name, "must be among " + ", ".join(allowed))
    for engine in ENGINES:
        if engine.name in wanted and (reason := engine.missing()):
            raise DependencyError(f"{engine.name}: {reason}")
    costs = [
        measure_effect(*pair)
        for pair in track(
            list_pairs(wanted, chosen),
            description="timing",
            transient=True,
        )
    ]
    columns, rows = list_cost_rows(costs)
    show_table("effects", CAPTION_OF_THE_TABLE, ["effect", *columns], rows, out)
    return 0
