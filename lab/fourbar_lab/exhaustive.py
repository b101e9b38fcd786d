"""The cheapest setting found by trying them all: what the advice is measured against.

Cost is counted in steps of the recommended RK4 model; a step of another integrator counts by its
CPU time relative to that, measured once, interleaved.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from statistics import median

from fourbar.mjcf import Settings
from fourbar_validation.advise.advise import MOST_STEPS
from fourbar_validation.advise.matters import judge_trial
from fourbar_validation.cost.study import time_in_turns
from fourbar_validation.engines.mujoco.trial import FEWEST_STEPS, TrialSetup, make_settings

COARSE, FINE = 2.0, 2.0 ** (1.0 / 3.0)
"""Ratios of the ladder of steps: first by factors of two, then thirds of an octave below what serves."""
TIME_CONSTANTS = (3.0, 5.0, 8.0, 12.0, 20.0, 35.0, 60.0, 120.0, 300.0)
FIRST_ORDER = ("Euler", "implicit", "implicitfast", "discrete")
FIRST_ORDER_TIME_CONSTANTS = (2.0, 3.0, 6.0, 12.0)
ROUNDS, STEPS = 15, 400


def time_relative_costs(setup: TrialSetup) -> dict[tuple[str, bool], float]:
    """Time a step by integrator and pads, relative to RK4 with pads: medians of interleaved rounds."""
    kinds = [("RK4", True), ("RK4", False), *((name, False) for name in FIRST_ORDER)]
    clocks = {kind: setup.seconds_per_step(change_kind(kind, make_settings(628.0, 20.0))) for kind in kinds}
    times = time_in_turns({kind: partial(clock, STEPS) for kind, clock in clocks.items()}, ROUNDS)
    reference = median(times["RK4", True])
    return {kind: median(values) / reference for kind, values in times.items()}


def change_kind(kind: tuple[str, bool], settings: Settings) -> Settings:
    """Change the integrator, and leave out the pads where requested."""
    integrator, pads = kind
    return replace(settings, integrator=integrator, pad=settings.pad if pads else None)


def find_cheapest(setup: TrialSetup, error: float, costs: Mapping[tuple[str, bool], float]) -> float | None:
    """Try every integrator, with and without pads, over time constants and steps: the least cost of a run that serves.

    In recommended RK4 steps; None where nothing serves.
    """
    best: float | None = None
    for kind, ratio in costs.items():
        fourth_order = kind[0] == "RK4"
        for tc in TIME_CONSTANTS if fourth_order else FIRST_ORDER_TIME_CONSTANTS:
            most = MOST_STEPS if best is None else best / ratio
            if not fourth_order and best is not None and not _serves(setup, kind, tc, most / FINE, error):
                continue  # not even with as many steps as the best costs
            steps = _find_least_steps(setup, kind, tc, most, error)
            if steps is not None and (best is None or steps * ratio < best):
                best = steps * ratio
    return best


def _find_least_steps(setup: TrialSetup, kind: tuple[str, bool], tc: float, most: float, error: float) -> int | None:
    """Find the least steps of the ladder, fewer than `most`, that serve."""
    n = FEWEST_STEPS
    while n < most:
        if _serves(setup, kind, tc, n, error):
            finer = (each for each in (n / FINE**2, n / FINE) if _serves(setup, kind, tc, each, error))
            return int(next(finer, n) + 0.5)
        n *= COARSE
    return None


def _serves(setup: TrialSetup, kind: tuple[str, bool], tc: float, steps: float, error: float) -> bool:
    per_run = setup.steps(make_settings(1000.0, tc)) / 1000.0
    trial = setup.try_out(change_kind(kind, make_settings(steps / per_run, tc)))
    return judge_trial(setup.scene, trial).worst <= error
