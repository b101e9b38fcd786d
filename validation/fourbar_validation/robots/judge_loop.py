"""Somebody's MJCF judged against a scene: errors, what differs, and what that costs.

Lengths, numbers of bars and gravity are put one at a time into the scene; all other
differences are corrected in their file.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from fourbar.formulas.mobility import change_points
from fourbar.linkage import record
from fourbar.quantities import OK, UNKNOWNS, Array
from fourbar.scene import Command, Scene, command, find_signs
from fourbar.scene.motion import COMMAND_NAMES
from fourbar.solution import Solution
from fourbar.solving import solve
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.compare import Comparison, Demands
from fourbar_validation.compare.rows import DEGRADED, FAILS, Counts, Row
from fourbar_validation.compare.tolerance import (
    SIMULATED,
    TIMES_PREDICTED,
    ErrorBound,
    Mask,
    divide,
    find_condition,
    hold_simulated,
    magnitude,
)
from fourbar_validation.engines.description import list_unknowns
from fourbar_validation.engines.mujoco.robots.loop_facts import (
    HIDING,
    MOTION_OF_BARS,
    OTHER_ASSEMBLY,
    SETTINGS_OF_AN_SDF,
    InsideAnswer,
    LoopMeasurement,
    MeasureOptions,
    PoseOptions,
    RobotFile,
)
from fourbar_validation.report.templating import write_error
from fourbar_validation.robots.differences import (
    Difference,
    change_scene,
    find_differences,
    is_of_another_linkage,
    is_setting,
    order,
    price,
)
from fourbar_validation.robots.guard import examine_guarded
from fourbar_validation.robots.loop_errors import MEASURE
from fourbar_validation.robots.unread import list_unread

FILE_AT_ONE_STATE = "mjcf-one-state"
FILE_THROUGH_TIME = "mjcf-simulated"
JUDGED_QUANTITIES = tuple(
    name for name in UNKNOWNS if name not in ("alpha_3", "alpha_4")
)
"""Quantities that a file is held to. A soft loop lets the bars accelerate by themselves
for an instant; what that does to the torque and the pin forces is judged there.
"""
_MENDED = "fourbar_validation.engines.mujoco.robots.measure:examine_mended"
_SOFTNESS = "fourbar_validation.engines.mujoco.robots.measure:predict_softness"
_NOTHING = 1e-9
"""Cost below which a difference is one of the digits of a scene, which has twelve."""
_MOST_ALLOWED = 0.1
"""Part of the largest torque or force, of a radian, or of the commanded speed, beyond
which a file is wrong, whatever MuJoCo's stiffest constraint leaves in it.
"""
_BY_STIFFEST = (
    "as what MuJoCo's stiffest constraint (solimp 0.9999) and the rounding of lengths"
    " leave in this file"
)
"""Method by which the error of a file is predicted that nobody holds to another."""
_ADVICE = (
    "What to type into the file for an error E, as far as its settings are the cause: "
    "fourbar-validation advise SCENE FILE.xml --error E"
)
_AS_GENERATED = (
    "The generated MJCF is wrong by as much: beside a limit position or a change point"
    " its timestep is too long. --error E states what this file may be wrong by, and"
    " fourbar-validation advise SCENE --error E finds a timestep."
)
_LENGTHS_FIRST = (
    "Mend the lengths first: what contacts and settings cost here is a cost in another"
    " linkage."
)


@record
class LoopJudgement:
    """Report on the loop of a user's file that is nearest to a scene."""

    measured: LoopMeasurement
    differences: list[Difference]
    """Differences, the dearest first."""
    rows: list[Row]
    """Errors of each quantity by one method."""
    generated: dict[tuple[str, str], float]
    """Errors of the generated file by engine and quantity."""
    notes: list[str]

    def sentences(self) -> Iterator[str]:
        """Say why the file is right, or what is to be mended first."""
        soft = [row for row in self.rows if row.verdict == DEGRADED]
        if soft and not self.counts[FAILS]:
            softest = max(soft, key=lambda row: row.error)
            left = write_error(softest.allowed / TIMES_PREDICTED)
            rounded = self.measured.rounding and ", with the rounding of lengths,"
            yield (
                "The file is right as far as MuJoCo's constraints let it be: the "
                f"stiffest (solimp 0.9999){rounded or ''} leaves at least {left} of"
                f" {softest.quantity} in it."
            )
        if self.is_of_another_linkage:
            yield _LENGTHS_FIRST
        elif self.counts[FAILS] and not self.differences:
            yield _AS_GENERATED
        elif self.counts[FAILS] and any(
            is_setting(one.key) and one.written for one in self.differences
        ):
            yield _ADVICE

    @property
    def is_of_another_linkage(self) -> bool:
        """Tell whether lengths make their file one of another linkage."""
        return any(map(is_of_another_linkage, self.differences))

    @property
    def counts(self) -> Counts:
        """Return the comparisons of their file by verdict."""
        return Counts(self.rows)


def judge_file(
    name: str,
    scene: Scene,
    file: RobotFile,
    options: MeasureOptions,
) -> LoopJudgement:
    """Judge a file in a guarded process.

    The error of the options is what it is held to; None: that of the generated file,
    and where its torque or pin forces exceed this, what MuJoCo's stiffest constraint
    leaves in it.
    """
    tolerance = SIMULATED
    if options.error is not None:
        tolerance = hold_simulated(options.error, "what this file may be wrong by")
    held = replace(options, error=None)
    scene = options.state_speed(scene)
    with examine_guarded(file) as examined:
        theirs = examined(MEASURE, file, held, scene)
        (measured,) = theirs.loops
        at = measured.command(measured.states)
        plain = MeasureOptions(PoseOptions())
        if options.span is not None:
            plain = replace(plain, span=(at.angle.min(), at.angle.max()))
        (generated,) = examined(MEASURE, None, plain, scene).loops
        ours = {
            (row.engine, row.quantity): row.error
            for row in list_rows(name, generated, SIMULATED)
        }
        rows = list_rows(name, measured, tolerance)
        if options.error is None and any(row.failed for row in rows):
            softness = examined(_SOFTNESS, scene, file, held)
            rows = list_rows(name, measured, tolerance, softness)
        differences = find_differences(generated.described, measured.described)
        if any(row.failed for row in rows):
            judge = partial(judge_answers, name, measured, tolerance=tolerance)
            mend = partial(examined, _MENDED, scene, file, held)
            differences = [*_price(differences, rows, scene, at, judge, mend)]
    notes = [*theirs.notes, *measured.parts]
    if file.kind != "URDF" and (parts := list_unread(file.text)):
        notes.append(f"not looked at: {', '.join(parts)}")
    if file.kind != "MJCF":
        differences = [
            replace(one, written="") if is_setting(one.key) else one
            for one in differences
        ]
        notes.append(SETTINGS_OF_AN_SDF)
    return LoopJudgement(measured, order(differences), rows, ours, notes)


def _price(
    differences: Sequence[Difference],
    rows: Sequence[Row],
    scene: Scene,
    at: Command,
    judge: Callable[..., list[Row]],
    mend: Callable[..., list[LoopMeasurement | None]],
) -> Iterator[Difference]:
    """Yield differences with their costs in accuracy, but for digits of the scene.

    Parameters
    ----------
    judge : judges answers.
    mend : measures the file with each of some entries mended.
    """
    left = []
    for one in differences:
        changed = answer_changed(scene, one, at)
        if changed is None:
            left.append(one)
        else:
            priced = price(one, judge(answers=[changed]), ())
            if priced.cost is None or priced.cost > _NOTHING:
                yield priced
    left.sort(key=lambda one: not one.key.endswith(HIDING))
    mended = mend([(one.key, one.generated) for one in left])
    for one, measured in zip(left, mended, strict=True):
        if measured is None:
            yield one
        else:
            after = judge(answers=list_answers(measured))
            yield price(one, rows, after)
            if one.key.endswith(HIDING):
                rows = after


def answer_changed(scene: Scene, one: Difference, at: Command) -> Answer | None:
    """Answer with the formulas of a scene that has one entry as in their file.

    The bars stay in the assembly nearest to that of the scene, beyond a change point
    too. None where a scene cannot have it.
    """
    changed = change_scene(scene, one)
    if changed is None:
        return None
    signs = find_signs(scene.linkage, at.angle, at.branch, at.bar)
    branch = find_signs(changed.linkage, at.angle, signs, at.bar)
    motion = replace(scene.motion, branch=int(branch[0]))
    changed = replace(changed, motion=motion)
    solution = solve(changed, "force", at=at._replace(branch=branch))
    names = list_unknowns(scene, JUDGED_QUANTITIES)
    quantities = {name: np.asarray(getattr(solution, name)) for name in names}
    closed = solution.status_code == OK
    return Answer(FILE_AT_ONE_STATE, "formulas", at, closed, quantities)


def list_rows(
    name: str,
    measured: LoopMeasurement,
    tolerance: ErrorBound,
    softness: Mapping[str, float] | None = None,
) -> list[Row]:
    """Hold what a file answers to a tolerance, N m and N.

    Where the softness of its loop is known, errors are held to what it leaves.
    """
    answers = list_answers(measured)
    rows = judge_answers(name, measured, answers, tolerance, softness)
    through = measured.through_time or InsideAnswer()
    reason = through.lost
    left = through.other_assembly is not None or measured.refusal == OTHER_ASSEMBLY
    if left and not change_points(measured.scene.linkage, 2):
        reason = "the simulation goes over to the other assembly"
    if reason:
        who = (name, FILE_THROUGH_TIME, "-")
        rows.append(Row.unmeasured(*who, "watch", FAILS, reason))
    return rows


def judge_answers(
    name: str,
    measured: LoopMeasurement,
    answers: Sequence[Answer],
    tolerance: ErrorBound,
    softness: Mapping[str, float] | None = None,
) -> list[Row]:
    """Hold answers on a measured loop to a tolerance; see `list_rows`."""
    softness = softness or {}
    vanishing = measured.find_vanishing()
    scene = measured.scene
    at = command(scene)
    judged = [name for name in JUDGED_QUANTITIES if name not in COMMAND_NAMES[at.bar]]
    if at.bar != 2:
        judged += ["theta_2", "omega_2"]
    rows = []
    # to the first order, and a tenth more where the bars are nearly in line
    rounding = 1.1 * measured.rounding / max(scene.linkage.lengths)
    for answer in answers:
        formulas = solve(scene, "force", at=answer.at)

        def predicted(quantity: str, _: Mask, formulas: Solution = formulas) -> Array:
            left = softness.get(quantity, 0.0)
            largest = float(np.nanmax(magnitude(getattr(formulas, quantity))))
            speed = np.abs(np.asarray(formulas.at.speed, float)).max()
            unit = float({"theta": 1.0, "omega": speed}.get(quantity[:5], largest))
            condition = find_condition(quantity, scene.linkage, formulas)
            turned = divide(rounding * unit, condition)
            allowed = turned + TIMES_PREDICTED * left
            return np.minimum(allowed, _MOST_ALLOWED * unit) / TIMES_PREDICTED

        held = Demands(tolerance, judged)
        if softness:
            held = held._replace(predicted=predicted, method=f", {_BY_STIFFEST}")
        for row in Comparison(name, scene, answer, formulas, held).rows():
            scale = vanishing.get(row.quantity)
            if scale is None or answer.refusal is not None:
                rows.append(row)
                continue
            left = TIMES_PREDICTED * softness.get(row.quantity, 0.0) / scale
            allowed = max(tolerance.factor, min(left, _MOST_ALLOWED))
            rows.append(_judge_vanishing(row, answer, formulas, scale, allowed))
    return rows


def _judge_vanishing(
    row: Row, answer: Answer, formulas: Solution, scale: float, allowed: float
) -> Row:
    """Judge a quantity that is the rounding of its terms by the scale of these."""
    ours = np.asarray(getattr(formulas, row.quantity))
    errors = magnitude(answer.quantities[row.quantity] - ours) / scale
    return Row.judged(
        (row.scene, row.engine, row.setting),
        row.quantity,
        errors,
        allowed,
        f"it vanishes but for rounding: over that of its terms, {scale:.4g}",
        np.asarray(formulas.theta_2),
        where=formulas.status_code == OK,
    )


def list_answers(measured: LoopMeasurement) -> list[Answer]:
    """Return the answers at single states and through time, in the scene's axes."""
    states = measured.states
    through = measured.through_time
    answers = [_make_answer(measured, states, FILE_AT_ONE_STATE, "as compiled")]
    simulated = (FILE_THROUGH_TIME, measured.setting)
    if through is not None:
        if len(through.rows):
            answers.append(_make_answer(measured, through, *simulated))
    elif states.rows.speed.any() and len(states.rows) + len(states.open) > 1:
        # the scene names a motion and not a few states at rest
        answers.append(Answer(*simulated, refusal=measured.refusal))
    return answers


def _make_answer(
    measured: LoopMeasurement, inside: InsideAnswer, engine: str, setting: str
) -> Answer:
    rows = inside.rows
    at = measured.command(inside)
    quantities = measured.collect(inside, "soft")
    for name in MOTION_OF_BARS:
        if not name.endswith(f"_{at.bar}"):
            quantities[name] = rows.bars[name]
    for name, values in quantities.items():
        missing = np.full((len(inside.open), *values.shape[1:]), np.nan)
        quantities[name] = np.concatenate([values, missing])
    return Answer(engine, setting, at, np.arange(len(at.angle)) < len(rows), quantities)
