"""The cheapest settings of MuJoCo that keep torque and pin forces within a required error on a given scene.

The laws of the study (`guess`) say where to look, and short runs of the scene itself decide. With fitted pads
the softness of the closure plays no part above 1e-9 (1e-6 in a slow linkage), so that tc may be long.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np

from fourbar.errors import InputError, LimitError
from fourbar.mjcf import Settings, write_mjcf
from fourbar.scene import Command, Scene
from fourbar.scene import command as command_of
from fourbar.writing import require_file, write_text
from fourbar_validation.advise.matters import (
    MATTERS,
    judge_trial,
    measure_influences,
    write_sentence,
)
from fourbar_validation.advise.worst_errors import WorstErrors
from fourbar_validation.engines.mujoco.trial import (
    FEWEST_STEPS,
    LONGEST,
    ORDER,
    SHORTEST,
    TrialSetup,
    guess,
    make_settings,
)
from fourbar_validation.report.terminal import make_table

MARGIN = 0.7
"""The run must stay within this part of the required error: elsewhere it may be larger."""
CLOSE_ENOUGH = 1.15
"""The search stops where the least steps that serve and the most that do not are this close."""
BETWEEN = 180
"""Intervals of the sweep at which a run is read at least."""
MOST_TRIALS = 24
MOST_STEPS = 16_000
"""Most steps of one run, a fifth of a second. An error that needs more steps counts as not reachable."""
LEAST_GAIN = 0.8
"""More steps that leave the error above this part of what it was have met a floor."""


@dataclass(frozen=True, slots=True)
class Attempt:
    """One run of the search."""

    settings: Settings
    steps: int
    errors: WorstErrors
    steps_per_revolution: float


@dataclass(frozen=True, slots=True)
class Advice:
    """Settings that reach a required error, or the most accurate ones tried."""

    required: float
    best: Attempt
    """Cheapest attempt that reaches the required error; the most accurate one if none does."""
    attempts: tuple[Attempt, ...]
    reached: bool

    def cells(self) -> tuple[str, str, str]:
        """Format error, steps per revolution and time constant for a table of several scenes."""
        error = f"{self.best.errors.worst:.1e}" + (
            "" if self.reached else " (not reached)"
        )
        return (
            error,
            f"{self.best.steps_per_revolution:.0f}",
            f"{self.best.settings.time_constant_steps:.3g}",
        )

    @property
    def reason(self) -> str:
        """Write the attempt in one line for the reader."""
        s, e = self.best.settings, self.best.errors
        errors = f"torque {e.torque:.1e}, worst pin force {e.force:.1e}"
        setting = (
            f"RK4, {self.best.steps} steps ({self.best.steps_per_revolution:.0f} per revolution), "
            f"tc = {s.time_constant_steps:.3g} steps, pads {s.pad}, tolerance 0, flywheel {s.flywheel:g}"
        )
        if self.reached:
            return f"{setting}. Errors: {errors}; required: {self.required:g}."
        return (
            f"No setting of plain MJCF within {MOST_STEPS} steps was found to reach {self.required:g}. "
            f"The best was {setting}. Errors: {errors}. "
            "The formulas, and inverse dynamics of either engine with loop multipliers, reach round-off."
        )


def advise(scene: Scene, error: float, setup: TrialSetup | None = None) -> Advice:
    """Search the number of steps, and the time constant around what the law says, by runs of the scene.

    Raises LimitError for a scene that cannot be run through in time.
    """
    if not 0.0 < error < 1.0:
        raise InputError(
            "--error", error, "must be a relative error, above 0 and below 1"
        )
    return _CheapestSearch(
        scene, error, setup or TrialSetup(scene, choose_positions(scene))
    ).advice()


def choose_positions(scene: Scene) -> Command:
    """Take the scene's positions and others between them: the error peaks there, most near a pole of T3, T4."""
    command = command_of(scene)
    if np.ptp(command.branch) != 0:
        return command
    between = np.linspace(command.theta_2.min(), command.theta_2.max(), BETWEEN + 1)
    theta_2 = np.union1d(command.theta_2, between)
    return command._replace(
        angle=theta_2, branch=np.full(theta_2.shape, command.branch[0], dtype=np.int8)
    )


class _CheapestSearch:
    """Settings tried on one scene, for one required error."""

    def __init__(self, scene: Scene, error: float, setup: TrialSetup) -> None:
        self.scene, self.error, self.setup = scene, error, setup
        self.attempts: list[Attempt] = []

    def advice(self) -> Advice:
        """Find the cheapest that serves, by bisection in steps, then with shorter and longer time constants."""
        first, tc = guess(self.error)
        self._bisect(tc, first)
        for factor in (0.5, 2.0, 4.0):
            constant = min(max(tc * factor, SHORTEST), LONGEST)
            if constant != tc:
                self._polish(constant)
        served = self._is_served()
        best = (
            min(served, key=lambda a: a.steps)
            if served
            else _find_nearest(self.attempts)
        )
        return Advice(self.error, best, tuple(self.attempts), bool(served))

    def _polish(self, tc: float) -> None:
        """Try whether another time constant serves with fewer steps, or serves at all."""
        served = self._is_served()
        if not served:
            self._bisect(tc, _find_nearest(self.attempts).settings.steps_per_revolution)
            return
        fewest = min(served, key=lambda a: (a.steps, a.errors.worst))
        n = fewest.settings.steps_per_revolution / CLOSE_ENOUGH
        if n >= FEWEST_STEPS and self._serves(self._try(n, tc)):
            self._bisect(tc, n / CLOSE_ENOUGH, serves=n)

    def _bisect(self, tc: float, n: float, serves: float | None = None) -> None:
        """Narrow down the least steps per revolution that serve with one time constant."""
        fails: float | None = None
        last: Attempt | None = None
        for _ in range(MOST_TRIALS):
            attempt = self._try(n, tc)
            ratio = attempt.errors.worst / (MARGIN * self.error)
            step = ratio ** (1.0 / ORDER) if ratio < float("inf") else 2.0
            if self._serves(attempt):
                serves = n
                ahead = n * min(max(step, 0.4), 1.0 / CLOSE_ENOUGH)
            else:
                if (
                    last is not None
                    and n > (fails or 0.0)
                    and self._is_floored(last, attempt)
                ):
                    return
                fails, last = n, attempt
                ahead = n * min(max(step, CLOSE_ENOUGH), 3.0)
                if attempt.steps >= MOST_STEPS:
                    return
            if serves is not None and fails is not None:
                if serves / fails <= CLOSE_ENOUGH:
                    return
                ahead = (serves * fails) ** 0.5
            if serves is not None and serves <= FEWEST_STEPS:
                return
            n = max(ahead, FEWEST_STEPS)

    def _is_floored(self, before: Attempt, after: Attempt) -> bool:
        """Tell whether more steps bought nothing."""
        worst = after.errors.worst
        return (
            worst < 1e-2
            and worst > LEAST_GAIN * before.errors.worst
            and after.steps > 1.3 * before.steps
        )

    def _serves(self, attempt: Attempt) -> bool:
        return attempt.errors.worst <= MARGIN * self.error

    def _is_served(self) -> list[Attempt]:
        return [attempt for attempt in self.attempts if self._serves(attempt)]

    def _try(self, n: float, tc: float) -> Attempt:
        settings = make_settings(n, tc)
        steps = self.setup.steps(settings)
        if steps > MOST_STEPS:
            settings = make_settings(n * MOST_STEPS / steps, tc)
        trial = self.setup.try_out(settings)
        attempt = Attempt(
            settings,
            max(trial.steps, 1),
            judge_trial(self.scene, trial),
            trial.steps_per_revolution,
        )
        self.attempts.append(attempt)
        return attempt


def _find_nearest(attempts: Sequence[Attempt]) -> Attempt:
    return min(attempts, key=lambda a: a.errors.worst)


@click.command(name="advise")
@click.argument(
    "scenes", nargs=-1, required=True, type=click.Path(path_type=Path, dir_okay=False)
)
@click.option(
    "--error",
    "wanted",
    type=float,
    required=True,
    help="Relative error of torque and pin forces.",
)
@click.option(
    *("-o", "--out", "--output", "output"),
    type=click.Path(path_type=Path, dir_okay=False),
    help="Write the MJCF of one SCENE.",
)
def command(scenes: tuple[Path, ...], wanted: float, output: Path | None) -> int:
    """Find the cheapest MuJoCo settings that keep SCENES within an error; exit 1 where none is found for one of them.

    Of each scene it says which of the settings matters, and why; of several scenes a table is printed at the end.
    """
    from fourbar.files import load

    if output is not None and len(scenes) > 1:
        raise InputError(
            "-o", str(output), f"is the MJCF of one scene, not of {len(scenes)}"
        )
    loaded = [(scene, load(scene)) for scene in scenes]
    if output is not None:
        require_file(output, *scenes)
    rows, reached = [], True
    for file, scene in loaded:
        try:
            setup = TrialSetup(scene, choose_positions(scene))
            advice = advise(scene, wanted, setup)
        except LimitError as error:
            reason = f"cannot be simulated: {error}; inverse dynamics with loop multipliers can answer it"
            click.echo(f"{file.name}: {reason}")
            rows.append((file.name, "-", "-", "-", "cannot be simulated"))
            reached = False
            continue
        influences = measure_influences(scene, setup, advice.best.settings)
        click.echo(f"{file.name}: {advice.reason}")
        click.echo(f"{write_sentence(influences)}")
        steps = sum(attempt.steps for attempt in advice.attempts)
        click.echo(
            f"The search ran the scene {len(advice.attempts)} times, {steps} steps in all."
        )
        reached &= advice.reached
        rows.append(
            (
                file.name,
                *advice.cells(),
                influences[0].setting
                if influences[0].times >= MATTERS
                else "none by itself",
            )
        )
        if output is not None and advice.reached:
            write_text(output, write_mjcf(scene, advice.best.settings))
            click.echo(f"The MJCF is written to {output}.")
    if len(rows) > 1:
        from rich.console import Console

        head = ("scene", "error", "steps/turn", "tc, steps", "matters most")
        Console().print(make_table(head, rows, show_edge=False))
    return 0 if reached else 1
