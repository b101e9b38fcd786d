"""Find the MuJoCo settings that matter for a scene, and why.

The error is measured with one setting changed at a time.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from fourbar.linkage import record
from fourbar.mjcf import Settings
from fourbar.mjcf.document import (
    LIGHT_BAR_RATIO,
    compute_load_ratio,
    compute_mass_ratio,
)
from fourbar.quantities import OK, Array, Mask
from fourbar.scene import Command, Scene
from fourbar.show.panels import split_runs
from fourbar.solving import solve
from fourbar_validation.compare.compare import mark_moving_drive
from fourbar_validation.compare.scales import scale_of
from fourbar_validation.compare.tolerance import find_error
from fourbar_validation.engines.description import name_driving
from fourbar_validation.engines.mujoco.trial import (
    LONGEST_TIME_CONSTANT,
    SHORTEST_TIME_CONSTANT,
    Trial,
    TrialSetup,
)


class WorstErrors(NamedTuple):
    """Worst relative errors over the positions; inf where there is no answer."""

    torque: float
    """Worst error of the drive: of its torque, or of the force of a cylinder."""
    F12: float
    F32: float
    F43: float
    F14: float

    @property
    def force(self) -> float:
        """Return the error of the worst pin force."""
        return max(self[1:])

    @property
    def worst(self) -> float:
        """Return the greatest error, which a required error is compared with."""
        return max(self)


ERROR_NAMES = WorstErrors._fields
INFINITE_ERRORS = WorstErrors(*[math.inf] * len(ERROR_NAMES))


def compute_errors(
    scene: Scene,
    command: Command,
    quantities: dict[str, Array],
) -> WorstErrors:
    """Compute the errors of an answer at the motion that its engine really made.

    A drive on bar 3 or 4, and a cylinder, has a pole where that bar or the stroke
    stands still, and the pin forces have it with the drive. As in the regression report
    they are judged where it moves at more than a tenth of its greatest speed; their
    scale is that of the same positions.
    """
    if not np.isfinite(command.theta_2).all():
        return INFINITE_ERRORS
    formulas = solve(scene, "force", at=command)
    judged = (formulas.status_code == OK) & mark_moving_drive(scene, formulas)
    if not judged.any():
        return INFINITE_ERRORS
    if not judged.all():
        command = command.part(judged)
        formulas = solve(scene, "force", at=command)
    worst = {}
    for field in ERROR_NAMES:
        name = name_driving(scene) if field == "torque" else field
        ours = getattr(formulas, name)
        size = scale_of(name, scene, formulas, ours).size
        error = find_error(name, ours, quantities[name][judged], size)
        worst[field] = find_greatest(error)
    return WorstErrors(**worst)


def mark_far_from_poles(scene: Scene, command: Command) -> Mask:
    """Mark where the drive is far from a pole, (n,).

    The driven bar, or the stroke, moves fast enough there.
    """
    return mark_moving_drive(scene, solve(scene, "velocity", at=command))


def find_greatest(errors: Array | Sequence[float]) -> float:
    """Return the greatest error; inf if one is not finite, or if there are none."""
    value = float(np.max(errors, initial=-math.inf))
    return value if math.isfinite(value) else math.inf


MATTERS = 2.0
"""Growth of the error below which a setting does not matter. The setting is changed by
a factor of two, or lost.
"""
DEGREE_BETWEEN = 7
"""Degree of the curve through what was read at the steps. Its error falls faster with
the steps than that of RK4.
"""
NEAR_A_TOGGLE = 0.3
"""Least |sin(theta_4 - theta_3)| at which the timestep does not feel bars 3 and 4.
Below it they speed up too much.
"""
_MUJOCO_TOLERANCE = 1e-8
"""MuJoCo's own default."""


@record
class SettingInfluence:
    """One setting changed alone."""

    setting: str
    changed: str
    error: float
    times: float
    """The error over that of the settings as they were."""
    why: str

    def __str__(self) -> str:
        effect = "MuJoCo loses the motion"
        if math.isfinite(self.error):
            effect = f"the error is {self.error:.1e}, {self.times:.2g} times as large"
        setting = self.setting[0].upper() + self.setting[1:]
        return (
            f"{setting} matters most here. If it is {self.changed}, {effect}, because"
            f" {self.why}."
        )


def judge_trial(scene: Scene, trial: Trial) -> WorstErrors:
    """Return the worst errors of a trial, at its steps and between them.

    Errors are infinite if MuJoCo lost the motion.
    """
    if trial.broken:
        return INFINITE_ERRORS
    errors = [compute_errors(scene, trial.at, trial.quantities)]
    for samples, steps in trial.segments:
        errors += _compute_errors_between(scene, trial, samples, steps)
    return WorstErrors(*map(max, zip(*errors, strict=True)))


def _compute_errors_between(
    scene: Scene,
    trial: Trial,
    samples: slice,
    steps: int,
) -> Iterator[WorstErrors]:
    """Compute errors between the steps of a segment, by a spline.

    A largest force that lies between two steps is not seen at either of them. Nothing
    is computed where every position has a step. A drive on bar 3 or 4, and a cylinder,
    has poles, through which no curve can be drawn: each stretch between them has a
    spline of its own.
    """
    at = trial.at
    theta_2, first = np.unique(at.theta_2[samples], return_index=True)
    # each gap has a position of its own
    if len(theta_2) <= steps or not np.isfinite(theta_2).all():
        return
    made = {"omega_2": at.omega_2, "alpha_2": at.alpha_2, **trial.quantities}
    read = {name: np.asarray(values)[samples][first] for name, values in made.items()}
    finite = (np.isfinite(values).all() for values in read.values())
    if len(theta_2) < 2 or not all(finite):
        yield INFINITE_ERRORS
        return
    branch = at.branch[samples][first]
    at_steps = Command(theta_2, branch, read["omega_2"], read["alpha_2"])
    places = np.linspace(theta_2[0], theta_2[-1], 2 * (samples.stop - samples.start))
    for stretch in split_at_poles(scene, at_steps):
        known = theta_2[stretch]
        inside = places[(known[0] <= places) & (places <= known[-1])]
        if inside.size:
            curves = _draw_curves(known, stretch, read, inside)
            command = Command(
                inside,
                np.full(inside.shape, branch[0]),
                curves.pop("omega_2"),
                curves.pop("alpha_2"),
            )
            yield compute_errors(scene, command, curves)


def _draw_curves(
    theta_2: Array, stretch: slice, read: Mapping[str, Array], places: Array
) -> dict[str, Array]:
    """Return the values at some places of splines through what was read."""
    from scipy.interpolate import make_interp_spline

    degree = min(DEGREE_BETWEEN, len(theta_2) - 1)
    return {
        name: make_interp_spline(theta_2, values[stretch], degree)(places)
        for name, values in read.items()
    }


def split_at_poles(scene: Scene, command: Command) -> list[slice]:
    """Split positions into stretches in which the drive is far from a pole.

    A stretch has two positions or more.
    """
    far = np.flatnonzero(mark_far_from_poles(scene, command))
    return [slice(rows[0], rows[-1] + 1) for rows in split_runs(far) if len(rows) > 1]


def measure_influences(
    scene: Scene,
    setup: TrialSetup,
    settings: Settings,
) -> list[SettingInfluence]:
    """List every setting changed alone, the one that matters most first."""
    before, at_steps_before = _measure_errors(scene, setup, settings)
    influences = []
    for name, changed, changes, why in _list_changes(scene, settings):
        worst, at_steps = _measure_errors(scene, setup, replace(settings, **changes))
        times = worst / before if 0.0 < before < math.inf else math.nan
        growth = at_steps / at_steps_before if at_steps_before > 0.0 else math.nan
        cause = why or _explain_timestep(setup, times, growth)
        influences.append(SettingInfluence(name, changed, worst, times, cause))
    return sorted(
        influences,
        key=lambda one: math.inf if math.isnan(one.times) else -one.times,
    )


def _measure_errors(
    scene: Scene,
    setup: TrialSetup,
    settings: Settings,
) -> tuple[float, float]:
    """Return the worst error at the steps and between them, and at the steps alone."""
    trial = setup.try_out(settings)
    at_steps = INFINITE_ERRORS
    if not trial.broken:
        at_steps = compute_errors(scene, trial.at, trial.quantities)
    return judge_trial(scene, trial).worst, at_steps.worst


def write_sentence(influences: list[SettingInfluence]) -> str:
    """Name the setting that matters most, and why."""
    if influences and influences[0].times >= MATTERS:
        return str(influences[0])
    return (
        "No setting matters by itself here: none, changed alone, makes the error"
        f" {MATTERS:g} times as large."
    )


def _list_changes(
    scene: Scene, settings: Settings
) -> Iterator[tuple[str, str, dict[str, Any], str]]:
    """List changes of one setting, and what a growth of the error would come from.

    Each is the setting, to what it is changed, the fields of the settings, and the
    cause, "" if that is measured.
    """
    window = max(settings.steps_per_window // 2, 1)
    coarse = {"steps_per_revolution": settings.steps_per_revolution / 2.0}
    yield "the timestep", "twice as long", coarse | {"steps_per_window": window}, ""
    tc = settings.time_constant_steps
    name = "the closure's time constant"
    if tc >= SHORTEST_TIME_CONSTANT:
        why = (
            "a closure of few steps is a spring that RK4 follows badly, in proportion"
            " to (h/tc)^4"
        )
        yield name, "half as long", {"time_constant_steps": tc / 2.0}, why
    if 2.0 * tc <= LONGEST_TIME_CONSTANT:
        why = _find_yielding(scene, "a slow closure")
        yield name, "twice as long", {"time_constant_steps": 2.0 * tc}, why
    if settings.pad is not None:
        why = _find_yielding(scene, "without pads the closure")
        yield "the stiffness by pads", "left out", {"pad": None}, why
    if settings.tolerance == 0.0:
        changed = f"at MuJoCo's own {_MUJOCO_TOLERANCE:g}"
        why = (
            "MuJoCo divides it by the inertia of the flywheel, next to which the"
            " linkage is small"
        )
        loose = {"tolerance": _MUJOCO_TOLERANCE}
        yield "the solver's tolerance", changed, loose, why


def _explain_timestep(
    setup: TrialSetup,
    times: float,
    growth: float,
) -> str:
    """Say what of the growth comes from the steps, and what from the curve.

    The curve is drawn between the steps.
    """
    motion = solve(setup.scene, "position", at=setup.command)
    nearest = int(np.nanargmin(np.abs(motion.sin_mu)))
    sine = abs(motion.sin_mu[nearest])
    if sine < NEAR_A_TOGGLE:
        near = math.degrees(math.asin(sine))
        angle = math.degrees(setup.command.theta_2[nearest])
        return (
            f"bars 3 and 4 come within {near:.2g} deg of one line at theta_2 ="
            f" {angle:.4g} deg and speed up there"
        )
    if times > MATTERS * growth:
        return (
            "between fewer steps a curve misses more: at the steps themselves the "
            f"error grows {growth:.2g} times"
        )
    return f"the error of the steps themselves grows {growth:.2g} times"


def _find_yielding(scene: Scene, what: str) -> str:
    """Describe what makes a soft closure yield in this scene."""
    loads = compute_load_ratio(scene)
    masses = compute_mass_ratio(scene.linkage)
    if masses > LIGHT_BAR_RATIO:
        return (
            f"{what} is soft at the lighter of coupler and output, whose inertia is"
            f" {masses:.1e} times smaller"
        )
    if loads > 1.0:
        return (
            f"{what} sags under loads and weights, which are {loads:.2g} times the"
            " inertial forces"
        )
    return f"{what} yields to the inertial forces"
