"""The cheapest settings of MuJoCo within a required error on a given scene.

The error is that of torque and pin forces. The laws that `guess` of
engines/mujoco/trial.py holds say where to look, and short runs of the scene itself
decide. With fitted pads the softness of the closure plays no part above 1e-9 (1e-6 in a
slow linkage), so that tc may be long.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np

from fourbar.errors import InputError, LimitError
from fourbar.linkage import record
from fourbar.mjcf import Settings, write_mjcf
from fourbar.scene import Scene
from fourbar.writing import require_file, write_text
from fourbar_validation.advise.clocks import time_kinds
from fourbar_validation.advise.matters import (
    DEGREE_BETWEEN,
    MATTERS,
    WorstErrors,
    judge_trial,
    measure_influences,
    write_sentence,
)
from fourbar_validation.engines.mujoco.robots.loop_facts import (
    MeasureOptions,
)
from fourbar_validation.engines.mujoco.trial import (
    FEWEST_STEPS,
    LONGEST_TIME_CONSTANT,
    ORDER_OF_RK4,
    SHORTEST_TIME_CONSTANT,
    JudgedSetup,
    Trial,
    TrialSetup,
    describe_settings,
    guess,
    make_settings,
)
from fourbar_validation.report.sentences import make_words_table, print_sentence
from fourbar_validation.robots.loop_errors import (
    measure_robot,
    read_measure_options,
)
from fourbar_validation.robots.options import (
    loop_option,
    pose_options,
    range_option,
    speed_option,
)
from fourbar_validation.robots.report import (
    describe_advice,
    show_block,
    write_driven_range,
)

PART_OF_THE_ERROR = 0.7
"""Part of the required error within which the run must stay. Elsewhere the error may be
larger.
"""
_CLOSE_ENOUGH = 1.15
"""Ratio, of the least steps that serve to the most that do not, at which the search
stops.
"""
MOST_STEPS_OF_A_RUN = 16_000
"""Most steps of one run, a fifth of a second. An error that needs more steps counts as
not reachable.
"""
ROBOTS = (".xml", ".mjcf", ".sdf", ".world", ".urdf")
"""Suffixes of a robot's file."""
TIMINGS_OF_A_KIND, STEPS_TIMED, READINGS_TIMED = 5, 200, 30
"""Timings of each kind of step, and what is timed at once."""
_LIGHT: dict[str, Any] = {"tolerance": 1e-8, "iterations": 100}
"""Solver of MuJoCo, whose tolerance is tight enough beside a light flywheel."""
INTEGRATORS_OF_FIRST_ORDER = ("Euler", "implicitfast")
KINDS_OF_STEP: dict[str, dict[str, Any]] = {
    "": {},
    "flywheel 100": {**_LIGHT, "flywheel": 1e2},
    "flywheel 1000": {**_LIGHT, "flywheel": 1e3},
    "flywheel 10000": {**_LIGHT, "flywheel": 1e4},
    "one iteration": {"iterations": 1},
    "no pads": {**_LIGHT, "flywheel": 1e2, "pad": None},
    **{
        # with a closure as stiff as it carries
        name: {
            "integrator": name,
            "iterations": 1,
            "time_constant_steps": SHORTEST_TIME_CONSTANT,
        }
        for name in INTEGRATORS_OF_FIRST_ORDER
    },
}
"""Changes of settings by the kind of step: solver, flywheel, integrator, pads.

Each is tried beside RK4 with tolerance 0, ten iterations and pads, which is "".
"""
_MOST_TRIALS = 24
"""Most runs in which one search looks for the fewest steps that serve."""
_LEAST_GAIN = 0.8
"""More steps that leave the error above this part of what it was have met a floor."""
_CHEAPER = 0.97
"""Part of the work below which a kind of step counts as cheaper. Less is the noise of
its timing.
"""


@record
class SearchRun:
    """One run of the search."""

    settings: Settings
    steps: int
    readings: int
    """States that are read: one a position, or one a step where these are fewer."""
    errors: WorstErrors
    steps_per_revolution: float
    speed_error: float
    """Greatest deviation of the speed from the commanded one, relative."""
    step_cost: float
    """CPU time of a step, in steps of RK4 with tolerance 0, ten iterations and pads."""

    @property
    def description(self) -> str:
        """Return the settings in one line."""
        return describe_settings(self.settings, self.steps_per_revolution)


@record
class _Advice:
    """Settings that reach a required error, or the most accurate ones tried."""

    required: float
    best: SearchRun
    """Cheapest attempt that reaches the required error, or the most accurate one if
    none does.
    """
    attempts: tuple[SearchRun, ...]
    reached: bool

    def cells(self) -> tuple[str, str, str]:
        """Format error, steps per revolution and time constant for a table.

        The table is of several scenes.
        """
        best = self.best
        return (
            f"{best.errors.worst:.1e}" + " (not reached)" * (not self.reached),
            f"{best.steps_per_revolution:.0f}",
            f"{best.settings.time_constant_steps:.3g}",
        )

    @property
    def reason(self) -> str:
        """Write the attempt in one line for the reader."""
        best = self.best
        errors = (
            f"Errors at the steps and between them, by a curve of degree "
            f"{DEGREE_BETWEEN} through the steps: torque {best.errors.torque:.1e}, "
            f"worst pin force {best.errors.force:.1e}"
        )
        setting = (
            f"{best.description} ({best.steps} steps in all); the flywheel "
            f"lets the speed vary by {best.speed_error:.1e} of itself, and the "
            "forces are those of the motion made"
        )
        if self.reached:
            return f"{setting}. {errors}; required: {self.required:g}."
        return (
            f"No setting of plain MJCF within {MOST_STEPS_OF_A_RUN} steps was found"
            f" to reach {self.required:g}."
            f" The best was {setting}. {errors}. The formulas, and"
            " inverse dynamics of either engine with loop multipliers, reach"
            " round-off."
        )


def advise(
    scene: Scene,
    error: float,
    setup: TrialSetup | None = None,
) -> _Advice:
    """Search the number of steps, and the time constant, by runs of the scene.

    The time constant is searched around what the law says.

    Raises LimitError for a scene that cannot be run through in time.
    """
    if not 0.0 < error < 1.0:
        allowed = "must be a relative error, above 0 and below 1"
        raise InputError("--error", error, allowed)
    return _CheapestSearch(scene, error, setup or JudgedSetup(scene)).advice()


def _describe_time(setup: TrialSetup, attempt: SearchRun) -> str:
    """Write the CPU time of a simulated second and of a revolution."""
    ((step, reading),) = _time_settings(setup, [attempt.settings])
    thousandths = 1e3 * (attempt.steps * step + attempt.readings * reading)
    return (
        f"This costs {thousandths / setup.simulated_seconds:.2g} ms of processor time"
        f" per simulated second ({thousandths / setup.revolutions:.2g} ms per"
        f" revolution): {attempt.steps} steps, and {attempt.readings} readings of"
        " torque and pin forces."
    )


def _time_settings(
    setup: TrialSetup, kinds: Sequence[Settings]
) -> list[tuple[float, float]]:
    """Time a step and a reading of each kind, CPU seconds."""
    timings = time_kinds(
        setup,
        [(settings, None) for settings in kinds],
        [STEPS_TIMED] * len(kinds),
        READINGS_TIMED,
        TIMINGS_OF_A_KIND,
    )
    return [(min(steps), min(readings)) for steps, readings in timings]


class _CheapestSearch:
    """Settings tried on one scene, for one required error."""

    def __init__(
        self,
        scene: Scene,
        error: float,
        setup: TrialSetup,
    ) -> None:
        self.scene = scene
        self.error = error
        self.setup = setup
        self.attempts: list[SearchRun] = []
        self.costs = {"": 1.0}
        """CPU time of a step of each kind, as in `SearchRun.step_cost`."""
        self.reading_cost = 0.0
        """CPU time of a reading, in the same steps."""

    def advice(self) -> _Advice:
        """Find the cheapest settings that reach the error.

        Steps are bisected, then shorter and longer time constants and cheaper kinds of
        step are tried.
        """
        n, tc = guess(self.error)
        self._bisect(tc, n)
        for factor in (0.5, 2.0, 4.0):
            longest = min(tc * factor, LONGEST_TIME_CONSTANT)
            constant = max(longest, SHORTEST_TIME_CONSTANT)
            if constant != tc:
                served = self._list_served() or [self._find_nearest()]
                fewest = min(served, key=lambda run: (run.steps, run.errors.worst))
                self._bisect(constant, fewest.settings.steps_per_revolution)
        served = self._list_served()
        if served:
            self._try_kinds(min(served, key=lambda attempt: attempt.steps))
            best = min(self._list_served(), key=self._work)
        else:
            best = self._find_nearest()
        return _Advice(self.error, best, tuple(self.attempts), bool(served))

    def _work(self, attempt: SearchRun) -> float:
        """Return the CPU time of a run with its readings, in steps."""
        return attempt.steps * attempt.step_cost + attempt.readings * self.reading_cost

    def _try_kinds(self, start: SearchRun) -> None:
        """Try each kind of step with as many steps as would be cheaper.

        Where so many serve, fewer are tried.
        """
        settings = start.settings
        kinds = {
            name: replace(settings, **changes)
            for name, changes in KINDS_OF_STEP.items()
        }
        timings = _time_settings(self.setup, [*kinds.values()])
        base, reading = timings[0]
        self.reading_cost = reading / base
        steps_of = dict(zip(kinds, (step for step, _ in timings), strict=True))
        del steps_of[""]
        for name, seconds in sorted(steps_of.items(), key=lambda pair: pair[1]):
            cost = self.costs[name] = seconds / base
            allowed = _CHEAPER * min(map(self._work, self._list_served()))
            # with fewer steps than positions each step has a reading
            steps = max(
                (allowed - start.readings * self.reading_cost) / cost,
                allowed / (cost + self.reading_cost),
            )
            part = steps / start.steps
            if name not in INTEGRATORS_OF_FIRST_ORDER:
                # of the same order: what serves needs about as many steps
                part = min(part, _CLOSE_ENOUGH)
            n = settings.steps_per_revolution * part
            tc = settings.time_constant_steps
            if part >= 1.0 / _CLOSE_ENOUGH:
                self._bisect(tc, n * _CLOSE_ENOUGH, name)

    def _bisect(self, tc: float, n: float, kind: str = "") -> None:
        """Narrow down the least steps per revolution at one time constant.

        Where other settings serve, it begins with somewhat fewer steps than n, and
        leaves off if these do not.
        """
        fewer = bool(self._list_served())
        if fewer:
            n /= _CLOSE_ENOUGH
        if n < FEWEST_STEPS:
            return
        serves: float | None = None
        fails: float | None = None
        last: SearchRun | None = None
        for _ in range(_MOST_TRIALS):
            attempt = self._try(n, tc, kind)
            ratio = attempt.errors.worst / (PART_OF_THE_ERROR * self.error)
            step = ratio ** (1.0 / ORDER_OF_RK4) if ratio < math.inf else 2.0
            if self._serves(attempt):
                serves = n
                ahead = n * min(max(step, 0.4), 1.0 / _CLOSE_ENOUGH)
            else:
                more = n > (fails or 0.0)
                if last is not None and more and _is_floored(last, attempt):
                    return
                fails = n
                last = attempt
                ahead = n * min(max(step, _CLOSE_ENOUGH), 3.0)
                is_worse = fewer and serves is None
                if is_worse or attempt.steps >= MOST_STEPS_OF_A_RUN:
                    return
            if serves is not None and fails is not None:
                if serves / fails <= _CLOSE_ENOUGH:
                    return
                ahead = (serves * fails) ** 0.5
            if serves is not None and serves <= FEWEST_STEPS:
                return
            n = max(ahead, FEWEST_STEPS)

    def _serves(self, attempt: SearchRun) -> bool:
        return attempt.errors.worst <= PART_OF_THE_ERROR * self.error

    def _list_served(self) -> list[SearchRun]:
        return [attempt for attempt in self.attempts if self._serves(attempt)]

    def _find_nearest(self) -> SearchRun:
        return min(self.attempts, key=lambda a: a.errors.worst)

    def _try(self, n: float, tc: float, kind: str) -> SearchRun:
        settings = replace(make_settings(n, tc), **KINDS_OF_STEP[kind])
        steps = self.setup.steps(settings)
        if steps > MOST_STEPS_OF_A_RUN:
            fewer = settings.steps_per_revolution * MOST_STEPS_OF_A_RUN / steps
            settings = replace(settings, steps_per_revolution=fewer)
        trial = self.setup.try_out(settings)
        attempt = SearchRun(
            settings,
            max(trial.steps, 1),
            trial.readings,
            judge_trial(self.scene, trial),
            trial.steps_per_revolution,
            _find_speed_error(self.setup, trial),
            self.costs[kind],
        )
        self.attempts.append(attempt)
        return attempt


def _is_floored(before: SearchRun, after: SearchRun) -> bool:
    """Tell whether more steps bought nothing."""
    worst = after.errors.worst
    return (
        _LEAST_GAIN * before.errors.worst < worst < 1e-2
        and after.steps > 1.3 * before.steps
    )


def _find_speed_error(setup: TrialSetup, trial: Trial) -> float:
    """Find the greatest deviation of the speed from the commanded one, relative."""
    theta_2 = trial.at.theta_2
    course = setup.course
    first = theta_2.min() if course.speed > 0.0 else theta_2.max()
    squared = course.speed**2 + 2.0 * course.acceleration * (theta_2 - first)
    due = np.sqrt(np.maximum(squared, 0.0))
    made = np.abs(np.asarray(trial.at.omega_2, float))
    return float(np.max(np.abs(made - due)) / np.max(due))


def _advise_robot(
    files: tuple[Path, ...],
    options: MeasureOptions,
    assets: Path | None,
) -> int:
    """Print what to type into a robot's file for an error; return the exit status."""
    from fourbar.files import load

    scene = load(files[0]) if len(files) == 2 else None
    measurement = measure_robot(files[-1], options, scene, assets)
    reached = True
    for measured in measurement.loops:
        print_sentence(f"{measured.name}, driven by {write_driven_range(measured)}")
        assert measured.advice is not None
        for block in describe_advice(measured, measured.advice):
            show_block(block)
        for remark in measured.remarks:
            print_sentence(f"note: {measured.name}: {remark}")
        reached &= measured.advice.reached
    for note in measurement.notes:
        print_sentence(f"note: {note}")
    return 0 if reached else 1


@click.command(name="advise")
@click.argument(
    "scenes",
    metavar="SCENE... | [SCENE] FILE.xml",
    nargs=-1,
    required=True,
    type=click.Path(path_type=Path, dir_okay=False),
)
@loop_option
@pose_options
@speed_option
@range_option
@click.option(
    "--error",
    "wanted",
    type=float,
    required=True,
    help="Relative error of torque and pin forces.",
)
@click.option(
    "-o",
    "--out",
    "--output",
    "output",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Write the MJCF of one SCENE.",
)
def advise_command(
    scenes: tuple[Path, ...],
    loop: str | None,
    wanted: float,
    output: Path | None,
    **robot: Any,
) -> int:
    """Find the cheapest MuJoCo settings.

    The settings keep torque and pin forces of each SCENE within an error. The command
    says which of the settings matters, and why; for several scenes it prints a table at
    the end. The exit status is 1 if there are no settings for one of them. For a
    robot's FILE.xml, with or without SCENE before it, the command tries settings in the
    file itself and prints what to type.
    """
    if scenes[-1].suffix.lower() in ROBOTS:
        if output is not None or len(scenes) > 2:
            raise click.UsageError("of a robot: [SCENE] FILE.xml, without -o")
        options = read_measure_options(loop, wanted, robot)
        return _advise_robot(scenes, options, robot["assets"])
    if loop or any(robot.values()):
        raise click.UsageError("the options of a robot need a FILE.xml")
    from fourbar.files import load

    if output is not None and len(scenes) > 1:
        allowed = f"is the MJCF of one scene, not of {len(scenes)}"
        raise InputError("-o", str(output), allowed)
    loaded = [(scene, load(scene)) for scene in scenes]
    if output is not None:
        require_file(output, *scenes)
    rows: list[tuple[str, ...]] = []
    reached = True
    for file, scene in loaded:
        try:
            setup = JudgedSetup(scene)
            advice = advise(scene, wanted, setup)
        except LimitError as error:
            print_sentence(
                f"{file.name}: cannot be simulated: {error}; inverse dynamics with"
                " loop multipliers can answer it"
            )
            rows.append((file.name, "-", "-", "-", "cannot be simulated"))
            reached = False
            continue
        influences = measure_influences(scene, setup, advice.best.settings)
        steps = sum(attempt.steps for attempt in advice.attempts)
        for sentence in (
            f"{file.name}: {advice.reason}",
            _describe_time(setup, advice.best),
            write_sentence(influences),
            f"The search ran the scene {len(advice.attempts)} times, {steps} steps in"
            " all.",
        ):
            print_sentence(sentence)
        reached &= advice.reached
        most = influences[0]
        matters = most.setting if most.times >= MATTERS else "none by itself"
        rows.append((file.name, *advice.cells(), matters))
        if output is not None and advice.reached:
            write_text(output, write_mjcf(scene, advice.best.settings))
            click.echo(f"The MJCF is written to {output}.")
    if len(rows) > 1:
        from rich.console import Console

        head = ("scene", "error", "steps/turn", "tc, steps", "matters most")
        Console().print(make_words_table(head, rows, show_edge=False))
    return 0 if reached else 1
