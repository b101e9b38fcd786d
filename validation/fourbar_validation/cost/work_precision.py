"""The work-precision study of one scene: curve after curve, each stored once done."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, fields, replace
from functools import cache, partial
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from fourbar.errors import FourBarError, LimitError
from fourbar.files import dump
from fourbar.formulas.mobility import turns_fully
from fourbar.linkage import record
from fourbar.mjcf import Settings
from fourbar.scene import Command, Scene
from fourbar.scene import command as command_of
from fourbar.solving import solve
from fourbar_validation.advise.advise import advise
from fourbar_validation.advise.clocks import summarise_timings, time_call, time_kinds
from fourbar_validation.advise.matters import (
    ERROR_NAMES,
    INFINITE_ERRORS,
    WorstErrors,
    compute_errors,
    judge_trial,
)
from fourbar_validation.engines.loop import PlainLoop
from fourbar_validation.engines.mujoco.trial import (
    TRIAL_FLYWHEEL,
    Edit,
    JudgedSetup,
    Trial,
    restore_defaults,
)
from fourbar_validation.engines.registry import BALLS, ask_at
from fourbar_validation.report.machine import list_versions
from fourbar_validation.run.store import Store

STEPS_PER_TURN = (20, 40, 80, 160, 320, 640, 1280, 2560)
_MORE_STEPS = (*STEPS_PER_TURN, 5120, 10240)
"""Steps per revolution; a first-order integrator needs more."""
MIDDLE = 640
"""Steps per revolution where a setting other than the timestep changes."""
_IMPEDANCES = (0.9, 0.97, 0.99, 0.997, 0.999, 0.9997, 0.9999)
TIME_CONSTANTS = (3.0, 5.0, 10.0, 20.0, 40.0, 80.0)
SOLVER_TOLERANCES = (0.0, 1e-16, 1e-14, 1e-12, 1e-10, 1e-8, 1e-6)
SLOW = 0.1
"""rad/s at which gravity and loads outweigh inertia, and the loop sags under them."""
MUJOCO_TIMESTEP = 0.002
"""s, of MuJoCo."""
_PART_OF_TURN = 0.25
"""Time constant, as a part of a revolution, that stays the same while the timestep
changes.
"""
INTEGRATORS = ("Euler", "implicit", "implicitfast", "discrete", "RK4")
"""Integrators, all that MuJoCo 4.0 has."""
MOST_STEPS_TIMED = 200
"""Steps per timing: some 3 ms of RK4. A round of a curve then passes within one spell
of the machine.
"""
TIMED_READINGS = 50
"""Readings per timing."""


@record
class Spot:
    """One setting of one curve."""

    label: str
    settings: Settings
    edit: Edit | None = None
    """Changes the text of every loop of a trial."""
    x: float = math.nan
    """The value of the curve's setting, where it is not the steps."""


@record
class SettingCurve:
    """A row of settings that differ in one number."""

    name: str
    spots: tuple[Spot, ...]
    slow: bool = False
    """Run at SLOW instead of the scene's own speed."""
    bare: bool = False
    """Run without gravity and loads."""
    settled: bool = False
    """Judged after a first turn, where the input turns fully: from an exact start a
    soft closure first sags, and its worst error would be that of the start (three to
    four times as large) at every setting.
    """


BEST = Settings(
    steps_per_window=1,
    flywheel=TRIAL_FLYWHEEL,
    time_constant_steps=20.0,
    steps_per_revolution=MIDDLE,
)
WITHOUT_PADS = replace(BEST, pad=None, time_constant_steps=10.0)


def _vary(
    field: str,
    label: str,
    values: Iterable[float],
    settings: Settings,
    held: float | None = None,
) -> tuple[Spot, ...]:
    """Vary one field of the settings; of an impedance what it lacks to 1 counts.

    `held`: a part of a revolution at which the closure's time constant is held in
    seconds, so that the timestep alone changes; None: it is so many steps as in the
    settings.
    """
    spots = []
    for x in values:
        changed: dict[str, Any] = {field: x}
        if held is not None:
            changed["time_constant_steps"] = held * x
        place = 1.0 - x if field == "impedance" else x
        spots.append(Spot(label.format(x), replace(settings, **changed), x=place))
    return tuple(spots)


def _vary_impedance() -> tuple[Spot, ...]:
    return _vary("impedance", "d = {:g}", _IMPEDANCES, WITHOUT_PADS)


def _vary_steps(held: float | None = None, **changes: Any) -> tuple[Spot, ...]:
    """Vary the timestep of settings that are the best ones but for some changes."""
    settings = replace(BEST, **changes)
    steps = STEPS_PER_TURN if settings.integrator == "RK4" else _MORE_STEPS
    label = "{:g} steps a revolution"
    return _vary("steps_per_revolution", label, steps, settings, held)


def design_curves(scene: Scene) -> Iterator[SettingCurve]:
    """Design the curves of one scene."""
    for name in INTEGRATORS:
        yield _vary_defaults(name, abs(scene.motion.omega_2 or 1.0))
    for name in INTEGRATORS:
        spots = _vary_steps(integrator=name, time_constant_steps=10.0)
        yield SettingCurve(f"{name}, pads, tc = 10 steps", spots)
    for name in INTEGRATORS:
        yield SettingCurve(
            f"{name}, tc held", _vary_steps(_PART_OF_TURN, integrator=name)
        )
    for tc in (3.0, 30.0, 100.0):
        spots = _vary_steps(time_constant_steps=tc)
        yield SettingCurve(f"RK4, pads, tc = {tc:g} steps", spots)
    spots = _vary_steps(pad=None, time_constant_steps=10.0)
    yield SettingCurve("RK4, no pads, tc = 10 steps", spots)
    for factor in (1e2, 1e4, 1e6, 1e8):
        yield SettingCurve(f"RK4, flywheel {factor:g}", _vary_steps(flywheel=factor))
    yield SettingCurve("softness d", _vary_impedance())
    label = "tc = {:g} steps"
    tc_varied = _vary("time_constant_steps", label, TIME_CONSTANTS, WITHOUT_PADS)
    yield SettingCurve("softness tc", tc_varied)
    pads = _vary("pad", "pads {:g}", (1e-1, 1e-2, 1e-3, 1e-4), BEST)
    yield SettingCurve("pads", (Spot("no pads", replace(BEST, pad=None), x=1.0), *pads))
    for name, bare in (("sag d, slow", False), ("sag d, slow, nothing acts", True)):
        yield SettingCurve(name, _vary_impedance(), slow=True, bare=bare)
    for solver, iterations in (("Newton", 10), ("CG", 100), ("PGS", 100)):
        settings = replace(BEST, solver=solver, iterations=iterations)
        label = solver + ", tolerance {:g}"
        spots = _vary("tolerance", label, SOLVER_TOLERANCES, settings)
        yield SettingCurve(f"tolerance, {solver}", spots)


def _vary_defaults(integrator: str, speed: float) -> SettingCurve:
    """Vary the timestep with MuJoCo's solref, solimp and solver.

    A new user gets these, with Euler at 2 ms.
    """
    steps = [*_vary_steps(integrator=integrator, pad=None)]
    if integrator == "Euler":
        n = 2.0 * math.pi / speed / MUJOCO_TIMESTEP
        settings = replace(steps[0].settings, steps_per_revolution=n)
        steps.append(Spot("MuJoCo's defaults", settings, x=n))
        steps.sort(key=lambda spot: spot.x)
    spots = tuple(replace(spot, edit=restore_defaults) for spot in steps)
    return SettingCurve(f"{integrator}, MuJoCo's defaults", spots, settled=True)


TIMINGS_OF_A_SETTING = 7
"""Timings of each setting."""
ERRORS_ADVISED = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 2e-9)
"""Errors for which the advice is drawn."""
STUDY_VERSION = 14
"""Version of what is tried; parts made with another version are made again."""
POSITIONS_WITH_REFERENCE = 25
"""Positions at which errors against the reference are taken. They take a few
milliseconds each.
"""
EXACT_MOTION = "exact"
STEPPED_MOTION = "stepped"
FORMULAS_CURVE = "formulas"
PINOCCHIO = "Pinocchio, rnea and multipliers"
MUJOCO_INVERSE = "MuJoCo, mj_inverse and multipliers"


@record
class CostPoint:
    """One setting of one method: its errors, and what it costs."""

    curve: str
    kind: str
    """ "stepped" through time, "exact" at each position, or "formulas"."""
    setting: str
    setting_value: float
    """Value of the curve's setting: steps per revolution, 1-d, tc in steps, tolerance,
    ...
    """
    steps: int
    """Steps of one run through the scene; positions if nothing is stepped."""
    steps_per_revolution: float
    errors: WorstErrors
    """Worst errors at the steps and between them."""
    at_steps: WorstErrors
    """Worst errors at the steps alone. The laws of the steps are those of the engine
    there.
    """
    seconds_per_second: float
    """CPU seconds of a simulated second, in which torque and pin forces are read at the
    scene's positions.
    """
    seconds_per_revolution: float
    """CPU seconds of torque and pin forces in a revolution of the input."""
    scatter: float
    """Middle timing less the least one, over the least one. The least one is the one
    that counts.
    """
    broken: str = ""

    @property
    def name(self) -> str:
        """Return the curve and the setting."""
        return f"{self.curve}, {self.setting}"

    def error(self, quantity: str) -> float:
        """Return an error at the steps and between them, "force" the worst of pins."""
        return float(getattr(self.errors, quantity))


_AT_STEPS = [f"{quantity}_at_steps" for quantity in ERROR_NAMES]
COST_COLUMNS = [field.name for field in fields(CostPoint)]
_ERRORS = slice(COST_COLUMNS.index("errors"), COST_COLUMNS.index("at_steps") + 1)
COST_COLUMNS[_ERRORS] = [*ERROR_NAMES, *_AT_STEPS]


def list_cells(point: CostPoint) -> list[Any]:
    """List the values of a point under COST_COLUMNS."""
    cells = [getattr(point, field.name) for field in fields(point)]
    cells[_ERRORS] = [*point.errors, *point.at_steps]
    return cells


def _read_cost_point(row: dict[str, Any]) -> CostPoint:
    errors = {name: WorstErrors(*row[name]) for name in ("errors", "at_steps")}
    return CostPoint(**row | errors)


class CostStudy:
    """The parts of a study of one scene, each in its own file."""

    def __init__(
        self,
        name: str,
        scene: Scene,
        folder: Path,
    ) -> None:
        self.name = name
        self.scene = scene
        self.folder = folder
        self.command = command_of(scene)
        self.left_out: list[str] = []
        self.setup = cache(self._set_up)
        """The scene set up for trials; a second call returns the same object."""
        self.units: dict[str, Callable[[], Iterable[CostPoint]]] = {
            "formulas": self._time_formulas,
            "inverse": self._time_inverse,
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
            "study": STUDY_VERSION,
        }
        with Store(self.folder, identity).held() as store:
            done = store.done()
            for number, (name, unit) in enumerate(self.units.items()):
                if number not in done:
                    known = len(self.left_out)
                    points: list[dict[str, Any]] = []
                    try:
                        points += map(asdict, unit())
                    except FourBarError as error:
                        points = []
                        self.left_out.append(f"{name}: {error}")
                    store.put(number, [points, self.left_out[known:]])
                else:
                    points, reasons = store.read(number)
                    self.left_out += reasons
                yield name, [_read_cost_point(row) for row in points]

    def _set_up(
        self,
        slow: bool = False,
        bare: bool = False,
        settled: bool = False,
    ) -> JudgedSetup:
        """Set the scene up for trials.

        Parameters
        ----------
        slow : run at 0.1 rad/s instead of the scene's speed.
        bare : without loads and effects.
        settled : begin a turn before the scene.
        """
        scene = self.scene
        sense = math.copysign(1.0, scene.motion.omega_2 or 1.0)
        if slow:
            motion = scene.motion.replace(speed=sense * SLOW, acceleration=0.0)
            scene = replace(scene, motion=motion)
        if bare:
            scene = replace(scene, loads=(), effects=())
        before = None
        if settled:
            first = float(np.min(sense * self.command.theta_2))
            before = sense * (first - 2.0 * math.pi)
        return JudgedSetup(scene, before=before)

    def _try_curve(self, curve: SettingCurve) -> Iterator[CostPoint]:
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
        spots: Sequence[Spot],
        setup: JudgedSetup,
        settled: bool = False,
    ) -> Iterator[CostPoint]:
        """Try each spot: its errors, and CPU time of steps and readings.

        The timings are interleaved with those of the others.
        """
        kinds = [(spot.settings, spot.edit) for spot in spots]
        trials = [setup.try_out(*kind) for kind in kinds]
        steps = [min(trial.steps, MOST_STEPS_TIMED) or 1 for trial in trials]
        timings = time_kinds(setup, kinds, steps, TIMED_READINGS, TIMINGS_OF_A_SETTING)
        for spot, trial, timed in zip(spots, trials, timings, strict=True):
            (step, scatter), (reading, _) = map(summarise_timings, timed)
            seconds = step * trial.steps + reading * trial.readings
            if settled:
                _leave_out_first(trial)
            at_steps = errors = INFINITE_ERRORS
            if not trial.broken:
                at_steps = compute_errors(setup.scene, trial.at, trial.quantities)
                errors = judge_trial(setup.scene, trial)
            yield CostPoint(
                name,
                STEPPED_MOTION,
                spot.label,
                spot.x,
                trial.steps,
                trial.steps_per_revolution or spot.settings.steps_per_revolution,
                errors,
                at_steps,
                seconds / setup.simulated_seconds,
                seconds / setup.revolutions,
                scatter,
                trial.broken,
            )

    def _try_recommended(self) -> Iterator[CostPoint]:
        """Try what the advice gives for each required error, where it is reached."""
        setup = self.setup()
        spots = []
        for required in ERRORS_ADVISED:
            advice = advise(self.scene, required, setup)
            if advice.reached:
                label = advice.best.description
                spots.append(Spot(label, advice.best.settings, x=required))
            else:
                self.left_out.append(f"recommended: {advice.reason}")
        return self._try_spots("recommended", spots, setup)

    def _make_point(
        self,
        name: str,
        kind: str,
        label: str,
        errors: WorstErrors,
        n: int,
        action: Callable[[], object],
    ) -> CostPoint:
        """Make a point of a method that answers each position by itself.

        The action, which is timed, answers n positions.
        """
        setup = self.setup()
        positions = sum(map(len, setup.segments))
        times = [time_call(action) for _ in range(TIMINGS_OF_A_SETTING)]
        seconds, scatter = summarise_timings(times)
        total = seconds / n * positions
        return CostPoint(
            name,
            kind,
            label,
            math.nan,
            n,
            positions / setup.revolutions,
            errors,
            errors,
            total / setup.simulated_seconds,
            total / setup.revolutions,
            scatter,
        )

    def _time_formulas(self) -> Iterator[CostPoint]:
        scene, command = self.scene, self.command
        few = choose_few(command)
        reference = ask_at(BALLS.start(), scene, few)
        if reference.refusal:
            raise LimitError(f"ball arithmetic: {reference.refusal}")
        errors = compute_errors(scene, few, reference.quantities)
        action = partial(solve, scene, "force", at=command)
        n = len(command.theta_2)
        label = "formulas, double"
        yield self._make_point("formulas", FORMULAS_CURVE, label, errors, n, action)

    def _time_inverse(self) -> Iterator[CostPoint]:
        """Time the exact engines in a plain loop over their own calls.

        The loop goes from position to position.
        """
        from fourbar_validation.engines.mujoco.inverse import MujocoTree
        from fourbar_validation.engines.pinocchio import PinocchioTree

        kinds: dict[str, Any] = {PINOCCHIO: PinocchioTree, MUJOCO_INVERSE: MujocoTree}
        setup = self.setup()
        rows = sorted(chain.from_iterable(setup.segments))
        command = setup.command.part(np.array(rows))
        for label, kind in kinds.items():
            try:
                loop = PlainLoop(kind, self.scene)
            except LimitError as error:
                self.left_out.append(f"{label}: {error}")
                continue
            action = partial(loop.answer, command)
            errors = compute_errors(self.scene, command, action())
            yield self._make_point(
                "inverse", EXACT_MOTION, label, errors, len(rows), action
            )


def _leave_out_first(trial: Trial) -> None:
    """Leave out the turn that a soft closure takes to settle from its exact start."""
    command = trial.at
    trial.at = command.part(slice(1, None))
    trial.quantities = {name: values[1:] for name, values in trial.quantities.items()}
    ((rows, steps),) = trial.segments
    part = np.ptp(trial.at.theta_2) / np.ptp(command.theta_2)
    trial.segments = ((slice(rows.start, rows.stop - 1), round(steps * part)),)


def choose_few(command: Command) -> Command:
    """Choose at most POSITIONS_WITH_REFERENCE positions, evenly over the sweep."""
    n = len(command.theta_2)
    places = np.linspace(0, n - 1, min(POSITIONS_WITH_REFERENCE, n))
    return command.part(np.unique(places.round().astype(int)))
