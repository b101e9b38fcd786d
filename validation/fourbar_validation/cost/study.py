"""The work-precision study of one scene: curve after curve, each kept once it is done."""

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any, TypeVar

import numpy as np

from fourbar.errors import FourBarError, LimitError
from fourbar.files import dump
from fourbar.formulas.mobility import turns_fully
from fourbar.scene import Command, Scene
from fourbar.scene import command as command_of
from fourbar_validation.advise.advise import advise
from fourbar_validation.advise.worst_errors import (
    NO_ANSWER,
    WorstErrors,
    compute_errors,
)
from fourbar_validation.compare.answer import Adapter
from fourbar_validation.cost import formulas
from fourbar_validation.cost.series import BEST, SLOW, Curve, Spot, design_curves
from fourbar_validation.engines.mujoco.trial import Trial, TrialSetup
from fourbar_validation.report.machine import list_versions
from fourbar_validation.run.store import Store

ROUNDS, ANSWERS = 7, 3
"""Timings of each setting, and of an engine that answers position by position."""
TIMED_STEPS = 200
"""Steps per timing: some 3 ms of RK4, so that a round of a curve passes within one spell of the machine."""
REQUIRED = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 2e-9)
"""Errors for which the advice is drawn."""
ONE_STATE = (0.9, 0.99, 0.999, 0.9999)
VERSION = 7
"""Version of what is tried; parts made with another version are made again."""
EXACT, STEPPED, FORMULAS = "exact", "stepped", "formulas"
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class CostPoint:
    """One setting of one method: its errors, and what it costs."""

    curve: str
    kind: str
    """ "stepped" through time, "exact" at each position, or "formulas"."""
    setting: str
    setting_value: float
    """The value of the curve's setting: steps per revolution, 1-d, tc in steps, tolerance, ..."""
    steps: int
    """Number of steps of one run through the scene; of positions if nothing is stepped."""
    steps_per_revolution: float
    torque: float
    F12: float
    F32: float
    F43: float
    F14: float
    seconds_per_revolution: float
    """CPU; of an exact method: the scene's positions in one revolution."""
    seconds_per_sample: float
    """CPU, of reading a sample; of an exact method: of a position."""
    rk4_steps: float
    """seconds_per_revolution in steps of the recommended RK4 model."""
    scatter: float
    """Scatter of seconds_per_revolution: half the interquartile range of its timings over their median."""
    broken: str = ""

    @property
    def force(self) -> float:
        """Return the error of the worst pin force."""
        return max(self.F12, self.F32, self.F43, self.F14)

    @property
    def worst(self) -> float:
        """Return the largest of the errors."""
        return max(self.torque, self.force)


COLUMNS = tuple(field.name for field in fields(CostPoint))


class CostStudy:
    """The parts of a study of one scene, each in its own file."""

    def __init__(self, name: str, scene: Scene, folder: Path) -> None:
        self.name, self.scene, self.folder = name, scene, folder
        self.command = command_of(scene)
        self.left_out: list[str] = []
        self._rigs: dict[tuple[bool, bool, bool], TrialSetup] = {}
        self.units: dict[str, Callable[[], list[CostPoint]]] = {
            "formulas": self._time_formulas,
            "inverse": self._time_inverse,
            "one state": self._time_one_state,
            "recommended": self._try_recommended,
            **{
                curve.name: partial(self._try_curve, curve)
                for curve in design_curves(scene)
            },
        }

    def __len__(self) -> int:
        return len(self.units)

    def points(self) -> Iterator[tuple[str, list[CostPoint]]]:
        """Yield curve after curve; what is on disk is not done again."""
        identity = {
            "scene": dump(self.scene),
            "versions": list_versions(),
            "study": VERSION,
        }
        with Store(self.folder, identity).held() as store:
            done = store.done()
            for number, (name, unit) in enumerate(self.units.items()):
                if number in done:
                    points, reasons = store.read(number)
                    self.left_out += reasons
                    yield name, [CostPoint(**row) for row in points]
                    continue
                reasons = []
                try:
                    points = unit()
                except (FourBarError, NotImplementedError) as error:
                    points, reasons = [], [f"{name}: {error}"]
                self.left_out += reasons
                store.put(number, [[asdict(point) for point in points], reasons])
                yield name, points

    def setup(
        self, slow: bool = False, bare: bool = False, settled: bool = False
    ) -> TrialSetup:
        """Assemble the scene for trials: at its own speed or slow, as it is or bare, after a turn or not."""
        if (slow, bare, settled) not in self._rigs:
            scene = self.scene
            if slow:
                sign = math.copysign(1.0, scene.motion.omega_2 or 1.0)
                scene = replace(
                    scene,
                    motion=scene.motion.replace(speed=sign * SLOW, acceleration=0.0),
                )
            if bare:
                scene = replace(scene, loads=(), effects=())
            command = command_of(scene)
            if settled:
                before = float(
                    command.theta_2.min()
                    if command.omega_2 > 0.0  # type: ignore[operator]
                    else command.theta_2.max()
                )
                before -= math.copysign(2.0 * math.pi, command.omega_2)  # type: ignore[arg-type]
                angle, branch = (
                    np.append(command.theta_2, before),
                    np.append(command.branch, command.branch[0]),
                )
                command = command._replace(angle=angle, branch=branch)
            self._rigs[slow, bare, settled] = TrialSetup(scene, command)
        return self._rigs[slow, bare, settled]

    def _try_curve(self, curve: Curve) -> list[CostPoint]:
        settled = (
            curve.settled
            and turns_fully(self.scene.linkage)
            and self.scene.motion.alpha_2 == 0.0
        )
        setup = self.setup(curve.slow, curve.bare, settled)
        return self._try_spots(curve.name, curve.spots, setup, settled)

    def _try_spots(
        self,
        name: str,
        spots: tuple[Spot, ...],
        setup: TrialSetup,
        settled: bool = False,
    ) -> list[CostPoint]:
        """Try each spot: errors, and the CPU time of its steps next to that of the recommended model, interleaved."""
        trials = [setup.try_out(spot.settings, spot.build) for spot in spots]
        if settled:
            for trial in trials:
                _leave_out_first(trial)
        clocks = [setup.seconds_per_step(spot.settings, spot.build) for spot in spots]
        per_step, reference = _time_interleaved(
            clocks,
            setup.seconds_per_step(BEST),
            [min(t.steps, TIMED_STEPS) or 1 for t in trials],
        )
        points = []
        for spot, trial, (cost, scatter) in zip(spots, trials, per_step, strict=True):
            # the laws are those of the steps themselves: between them the advice judges
            errors = (
                NO_ANSWER
                if trial.broken
                else compute_errors(setup.scene, trial.at, trial.quantities)
            )
            n = trial.steps_per_revolution or spot.settings.steps_per_revolution
            samples = max(len(trial.at.theta_2), 1)
            points.append(
                CostPoint(
                    *(name, STEPPED, spot.label, spot.x, trial.steps, n, *errors),
                    *(
                        cost * n,
                        trial.reading / samples,
                        cost * n / reference,
                        scatter,
                        trial.broken,
                    ),
                )
            )
        return points

    def _try_recommended(self) -> list[CostPoint]:
        """Try what the advice gives for each required error, where it is reached."""
        setup, spots = self.setup(), []
        for required in REQUIRED:
            advice = advise(self.scene, required, setup)
            settings = advice.best.settings
            if advice.reached:
                label = (
                    f"required {required:g}: tc = {settings.time_constant_steps:.3g} h"
                )
                spots.append(Spot(label, settings, None, required))
            else:
                self.left_out.append(f"recommended: {advice.reason}")
        return self._try_spots("recommended", tuple(spots), setup)

    def _make_point(
        self,
        name: str,
        kind: str,
        label: str,
        errors: WorstErrors,
        times: Sequence[float],
        n: int,
        setting_value: float = math.nan,
    ) -> CostPoint:
        """Make a point of a method that answers each position by itself."""
        span = float(np.ptp(self.command.theta_2)) or 2.0 * math.pi
        per_revolution = 2.0 * math.pi / span * max(len(self.command.theta_2) - 1, 1)
        reference, (seconds, scatter) = self._time_rk4_step(), summarise_timings(times)
        cost = seconds / n * per_revolution
        return CostPoint(
            name,
            kind,
            label,
            setting_value,
            n,
            per_revolution,
            *errors,
            cost,
            seconds / n,
            cost / reference,
            scatter,
        )

    def _time_rk4_step(self) -> float:
        try:
            clock = self.setup().seconds_per_step(BEST)
        except LimitError:
            return math.nan
        return median(clock(TIMED_STEPS) / TIMED_STEPS for _ in range(ROUNDS))

    def _time_formulas(self) -> list[CostPoint]:
        few = formulas.choose_few(self.command)
        exact = formulas.evaluate_balls(self.scene, few, 2 * formulas.FIFTY_DIGITS)
        points = []
        for label, method in formulas.METHODS.items():
            try:
                errors = formulas.compare_with_reference(
                    self.scene, few, method(self.scene, few), exact
                )
            except (NotImplementedError, AssertionError) as error:
                self.left_out.append(f"{label}: {error}")
                continue
            command = few if label == "50 digits" else self.command
            times = [
                time_call(partial(method, self.scene, command)) for _ in range(ROUNDS)
            ]
            points.append(
                self._make_point(
                    "formulas", FORMULAS, label, errors, times, len(command.theta_2)
                )
            )
        return points

    def _time_inverse(self) -> list[CostPoint]:
        from fourbar_validation.engines.mujoco.inverse import MujocoInverse
        from fourbar_validation.engines.pinocchio import PinocchioInverse

        return [
            self._time_answer("inverse", engine)
            for engine in (PinocchioInverse(), MujocoInverse())
        ]

    def _time_answer(
        self,
        curve: str,
        engine: Adapter,
        label: str = "",
        setting_value: float = math.nan,
    ) -> CostPoint:
        """Time an engine that answers each position."""
        answer = engine.answer(self.scene, self.command)
        if answer.refusal is not None:
            raise LimitError(f"{engine.name}: {answer.refusal}")
        assert answer.assembled is not None
        rows = np.flatnonzero(answer.assembled)
        command = self.command._replace(
            angle=self.command.theta_2[rows], branch=self.command.branch[rows]
        )
        errors = compute_errors(
            self.scene,
            command,
            {name: value[rows] for name, value in answer.quantities.items()},
        )
        times = [
            time_call(partial(engine.answer, self.scene, self.command))
            for _ in range(ANSWERS)
        ]
        return self._make_point(
            curve,
            EXACT,
            label or engine.name,
            errors,
            times,
            len(self.command.theta_2),
            setting_value,
        )

    def _time_one_state(self) -> list[CostPoint]:
        from fourbar_validation.engines.mujoco.forward import MujocoOneState

        points = [
            self._time_answer(
                "one state",
                MujocoOneState((d,)),
                f"MuJoCo at one state, d = {d:g}",
                (1.0 - d) / d,
            )
            for d in ONE_STATE
        ]
        return [
            *points,
            self._time_answer(
                "one state", MujocoOneState(), "MuJoCo at one state, extrapolated", 0.0
            ),
        ]


def _leave_out_first(trial: Trial) -> None:
    """Leave out the turn that a soft closure takes to settle from its exact start."""
    command = trial.at
    trial.at = Command(
        command.theta_2[1:],
        command.branch[1:],
        command.omega_2[1:],  # type: ignore[index]
        command.alpha_2[1:],  # type: ignore[index]
    )
    trial.quantities = {name: values[1:] for name, values in trial.quantities.items()}


def summarise_timings(times: Sequence[float]) -> tuple[float, float]:
    """Compute the median of timings, and half of what their middle half spans, over it."""
    low, middle, high = np.percentile(times, (25, 50, 75)).tolist()
    return middle, 0.5 * (high - low) / middle


def _time_interleaved(
    clocks: list[Callable[[int], float]],
    reference: Callable[[int], float],
    steps: list[int],
) -> tuple[list[tuple[float, float]], float]:
    """Time the steps, and their scatter over rounds; all take turns, so that a slow spell hits all of them."""
    every = list(zip((reference, *clocks), (TIMED_STEPS, *steps), strict=True))
    times = time_in_turns(
        {number: partial(clock, n) for number, (clock, n) in enumerate(every)}, ROUNDS
    )
    base, *rest = (
        [seconds / n for seconds in times[number]]
        for number, (_, n) in enumerate(every)
    )
    return [summarise_timings(kept) for kept in rest], median(base)


def time_call(action: Callable[[], object], calls: int = 1) -> float:
    """Time one call in this process, in CPU seconds."""
    start = time.process_time()
    for _ in range(calls):
        action()
    return (time.process_time() - start) / calls


def time_in_turns(
    clocks: Mapping[Any, Callable[[], T]], rounds: int
) -> dict[Any, list[T]]:
    """Read the clocks in turns, there and back: a slow spell hits all, and none always finds a warmer machine."""
    times: dict[Any, list[T]] = {name: [] for name in clocks}
    for number in range(rounds):
        for name in list(clocks)[:: -1 if number % 2 else 1]:
            times[name].append(clocks[name]())
    return times
