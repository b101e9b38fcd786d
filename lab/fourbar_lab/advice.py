"""Judge the advice of `advise` on random linkages.

Each advice must reach the error asked for and cost little more than the cheapest
settings that a search finds.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from statistics import median
from typing import NamedTuple

import click
import numpy as np

from fourbar.errors import FAILED, HOLDS
from fourbar.formulas.mobility import turns_fully
from fourbar.mjcf import Settings
from fourbar.scene import Scene, command
from fourbar.scene.motion import Motion, Sweep
from fourbar_lab import LAB_FOLDER
from fourbar_validation.advise.advise import MOST_STEPS_OF_A_RUN, advise
from fourbar_validation.advise.clocks import time_in_turns
from fourbar_validation.advise.matters import judge_trial
from fourbar_validation.engines.mujoco.trial import (
    FEWEST_STEPS,
    JudgedSetup,
    TrialSetup,
    make_settings,
)
from fourbar_validation.report.machine import name_code
from fourbar_validation.run.store import Store
from fourbar_validation.scenes.random import DrawnType, draw_random_scene

COARSE, STEP_RATIOS = 2.0, 2.0 ** (1.0 / 3.0)
"""Ratios of the ladder of steps: factors of two first, then thirds of an octave below
what serves.
"""
TIME_CONSTANTS_TRIED = (3.0, 5.0, 8.0, 12.0, 20.0, 35.0, 60.0, 120.0, 300.0)
STEPPED_INTEGRATORS = ("Euler", "implicit", "implicitfast", "discrete")
_FIRST_ORDER_TIME_CONSTANTS: tuple[float, ...] = (2.0, 3.0, 6.0, 12.0)
TIMED_ROUNDS = 15
STEPS_OF_A_TIMING = 400
TYPES = tuple(kind for kind in DrawnType if kind is not DrawnType.ROCKER_CRANK)
_SPEEDS = (-1.0, 3.0)
"""log10 of rad/s."""
REQUIRED_ERRORS = (-7.0, -2.0)
"""log10 of the required error."""
PART_OF_THE_RANGE = 0.8
"""Part of the range of a rocker that is run through: away from its limits."""
_GENTLE = 0.02
"""Value of |alpha_2|/omega_2^2. Over a turn the speed changes by an eighth and never
vanishes.
"""
SCENE_INTERVALS, _DENSER, INTERVALS_SEARCHED = 36, 4, 2
"""Intervals of the scene. The answer is judged at a multiple of them, and the search
decides at another.
"""
_NEEDED_MET = 0.95
_NEEDED_CHEAP = 0.80
_CHEAP = 3.0
StepKind = tuple[str, bool]
"""Integrator, and whether the pins have pads."""


def time_relative_costs(setup: TrialSetup) -> dict[StepKind, float]:
    """Time a step by integrator and pads, relative to RK4 with pads.

    The times are medians of interleaved rounds.
    """
    kinds = [("RK4", True), *((name, False) for name in ("RK4", *STEPPED_INTEGRATORS))]
    clocks = {}
    for kind in kinds:
        time_steps, _ = setup.make_clocks(_make_settings(kind, 628.0, 20.0))
        clocks[kind] = partial(time_steps, STEPS_OF_A_TIMING)
    times = time_in_turns(clocks, TIMED_ROUNDS)
    reference = median(times["RK4", True])
    return {kind: median(values) / reference for kind, values in times.items()}


def _make_settings(kind: StepKind, steps_per_revolution: float, tc: float) -> Settings:
    """Make settings of an integrator, without the pads where requested."""
    integrator, pads = kind
    settings = make_settings(steps_per_revolution, tc)
    return replace(settings, integrator=integrator, pad=settings.pad if pads else None)


def try_all_settings(
    setup: TrialSetup, error: float, costs: Mapping[StepKind, float]
) -> float:
    """Try every integrator, with and without pads, over time constants and steps.

    The result is the least cost of a run that serves, in recommended RK4 steps; NaN
    where nothing serves.
    """
    best = math.nan
    for kind, ratio in costs.items():
        tried = _FIRST_ORDER_TIME_CONSTANTS
        if kind[0] == "RK4":
            tried = TIME_CONSTANTS_TRIED
        for tc in tried:
            most = MOST_STEPS_OF_A_RUN if math.isnan(best) else best / ratio
            steps = _find_least_steps(setup, kind, tc, most, error)
            best = float(np.fmin(best, steps * ratio))
    return best


def _find_least_steps(
    setup: TrialSetup, kind: StepKind, tc: float, most: float, error: float
) -> float:
    """Find the least steps of the ladder, fewer than `most`, that serve, or NaN."""
    per_run = setup.steps(make_settings(1000.0, tc)) / 1000.0

    def serves(steps: float) -> bool:
        trial = setup.try_out(_make_settings(kind, steps / per_run, tc))
        return judge_trial(setup.scene, trial).worst <= error

    n = FEWEST_STEPS
    while n < most:
        if serves(n):
            finer = filter(serves, (n / STEP_RATIOS**2, n / STEP_RATIOS))
            return int(next(finer, n) + 0.5)
        n *= COARSE
    return math.nan


class AdviceCase(NamedTuple):
    """One linkage, one required error."""

    number: int
    asked: float
    """The required error."""
    reached: bool
    """The advice says that it serves."""
    error: float
    """Judged at the denser positions."""
    cost: float
    """RK4 steps per run of the advice."""
    cheapest: float
    """Cheapest of the exhaustive search; NaN if it found nothing."""

    @property
    def met(self) -> bool:
        """Return whether it is within the required error.

        An error that is rightly called unreachable counts too.
        """
        if self.reached:
            return self.error <= self.asked
        return math.isnan(self.cheapest)

    @property
    def cheap(self) -> bool:
        """Return whether it is within CHEAP times the cheapest.

        An error that is rightly called unreachable counts too.
        """
        return not self.cost > _CHEAP * self.cheapest if self.reached else self.met


def draw_advised_scene(seed: int, index: int) -> tuple[Scene, float]:
    """Draw a linkage away from its limits, with a random speed and error.

    The error is the one that is required of it.
    """
    scene = draw_random_scene(seed, index, TYPES)
    rng = np.random.default_rng([seed, index, 1])
    omega = float(rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(*_SPEEDS))
    alpha = float(rng.choice([0.0, omega**2 * rng.uniform(-_GENTLE, _GENTLE)]))
    sweep = replace(scene.motion.theta_2, steps=SCENE_INTERVALS)
    if not turns_fully(scene.linkage):
        left_out = 0.5 * (1.0 - PART_OF_THE_RANGE) * (sweep.stop - sweep.start)
        sweep = Sweep(sweep.start + left_out, sweep.stop - left_out, SCENE_INTERVALS)
    motion = Motion(sweep, omega, alpha, scene.motion.branch)
    return replace(scene, motion=motion), float(10.0 ** rng.uniform(*REQUIRED_ERRORS))


def _make_denser(scene: Scene, times: int) -> Scene:
    """Divide the same motion into more positions."""
    sweep = scene.motion.theta_2
    sweep = replace(sweep, steps=sweep.steps * times)
    return replace(scene, motion=scene.motion.replace(angle=sweep))


def measure_case(
    seed: int,
    index: int,
    costs: Mapping[StepKind, float],
) -> AdviceCase:
    """Ask for advice, judge it at denser positions, and search exhaustively."""
    scene, required = draw_advised_scene(seed, index)
    advice = advise(scene, required)
    dense = _make_denser(scene, _DENSER)
    searched = _make_denser(scene, INTERVALS_SEARCHED)
    trial = TrialSetup(dense, command(dense)).try_out(advice.best.settings)
    cheapest = try_all_settings(JudgedSetup(searched), required, costs)
    return AdviceCase(
        index,
        required,
        advice.reached,
        judge_trial(dense, trial).worst,
        advice.best.steps * advice.best.step_cost,
        cheapest,
    )


def measure_cases(
    seed: int,
    count: int,
    out: Path,
) -> Iterator[AdviceCase]:
    """Yield the measured cases in order, and store each one as soon as it is measured.

    Cases stored by an interrupted run are read and not measured again.
    """
    with Store(out, {"seed": seed, **name_code(LAB_FOLDER)}).held() as store:
        done = store.done()
        first = draw_advised_scene(seed, 0)[0]
        costs: dict[StepKind, float] = {}
        for index in range(count):
            if index not in done:
                costs = costs or time_relative_costs(TrialSetup(first, command(first)))
                store.put(index, [measure_case(seed, index, costs)])
            yield AdviceCase(*store.read(index)[0])


@click.command("advice")
@click.option(
    "--count",
    type=click.IntRange(min=1),
    default=400,
    show_default=True,
    help="Random linkages.",
)
@click.option("--seed", type=click.IntRange(min=0), default=1, show_default=True)
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("results/advise-study"),
)
def advice_command(count: int, seed: int, out: Path) -> int:
    """Measure the advice on random linkages.

    Exit with status 1 if it is not met, or not cheap often enough. That it is met often
    enough is a statement on all linkages, which few of them cannot prove.
    """
    from rich.console import Console
    from rich.progress import track
    from scipy.stats import binomtest

    measured = measure_cases(seed, count, out)
    shown = Console(stderr=True)
    cases = list(track(measured, "advising", total=count, console=shown))
    met = sum(case.met for case in cases)
    cheap = sum(case.cheap for case in cases)
    refused = [case for case in cases if not case.reached]
    wrongly = sum(not case.met for case in refused)
    # the lower bound of the Wilson score interval of a proportion, at 95 %
    bound = float(binomtest(met, len(cases)).proportion_ci(0.95, "wilson").low)
    share = cheap / len(cases)
    click.echo(
        f"met: {met} of {len(cases)}, lower Wilson bound {bound:.3f} (needed"
        f" {_NEEDED_MET})\n"
        f"called unreachable: {len(refused)}, of which the search reached {wrongly}\n"
        f"within {_CHEAP:g} times the cheapest: {cheap} of {len(cases)}, {share:.3f}"
        f" (needed {_NEEDED_CHEAP})"
    )
    ratios = sorted(
        case.cost / case.cheapest
        for case in cases
        if case.reached and not math.isnan(case.cheapest)
    )
    if ratios:
        high = ratios[int(0.95 * (len(ratios) - 1))]
        click.echo(
            f"cost over the cheapest: median {ratios[len(ratios) // 2]:.2f}, 95 % below"
            f" {high:.2f}, most {ratios[-1]:.2f}"
        )
    return HOLDS if bound >= _NEEDED_MET and share >= _NEEDED_CHEAP else FAILED
