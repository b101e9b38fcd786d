"""Measurements of a robot's loops, as sentences and tables.

Forms are for the terminal, in Markdown, and as CSV.
"""

import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import click
import numpy as np

from fourbar.errors import write_count
from fourbar.formulas.mobility import change_points, find_limit_angles
from fourbar.linkage import record
from fourbar.quantities import PIN_FORCES, UNITS
from fourbar.scene import command
from fourbar.writing import write_text
from fourbar_validation.compare.rows import (
    UNDECIDED,
    Row,
    escape_controls,
    write_csv_rows,
    write_results,
)
from fourbar_validation.engines.mujoco.robots.loop_facts import (
    LoopMeasurement,
    RobotMeasurement,
    SettingsAdvice,
    TriedSettings,
    name_following,
)
from fourbar_validation.report.sentences import make_words_table, print_sentence
from fourbar_validation.report.templating import escape_cell, write_error
from fourbar_validation.robots.judge_loop import LoopJudgement
from fourbar_validation.robots.loop_errors import (
    MEASURED_THROUGH_TIME,
    RIGID,
    STATES,
    InsideError,
    find_left_out,
    find_worst_of_loop,
    list_errors_by_method,
    list_without_value,
    write_degrees,
)

ERROR_HEADINGS = ("method", "quantity", "error", "of largest", "at", "median")
JUDGED_HEADINGS = ("quantity", "theirs", "generated", "allowed", "verdict")
_DIFFERENCES = ("cost", "what differs")
_ABOUT_COSTS = (
    "cost: what this one entry adds to the error, in the formulas if it is a length,"
    " a number of a bar, a load's couple or gravity, else in the file itself, first"
    " contacts and stops, then the others without them. It is that of the torque or pin"
    " force whose error grows most; of a setting, how far the worst error of all grows."
    " A dash: this entry cannot be set by itself, or the file holds what it is held to"
)
_SETTINGS = ("changed alone", "single states", "through time", "cost")
SCENE_ROUND_OFF = 1e-8
"""Difference of two exact answers, over the largest torque and pin forces, that the
digits of the scene make.
"""
LEAST_LEFT_OUT = 1e-4
"""Part of the largest that a scene leaves out, below which the table has no rows of
it: MuJoCo's errors have about as many digits.
"""
NEAR_A_LIMIT = math.radians(10.0)
"""Angle of the driven bar from a limit position or a change point within which a
report names it: beyond a change point of a parallelogram forces are then six times
those of its rectangle.
"""
STATES_FILE = (
    "loop",
    "method",
    "joint [deg]",
    "omega [rad/s]",
    "alpha [rad/s^2]",
    "drive [N m or N]",
    "drive of rigid pins [N m or N]",
    *(f"{name} [N]" for name in PIN_FORCES),
    *(f"{name} of rigid pins [N]" for name in PIN_FORCES),
    "gap [mm]",
)
"""Columns of the file of states: omega and alpha are those of the commanded bar, pin
forces are sizes.
"""


@record
class TextTable:
    """Rows of text under headings."""

    headings: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    words: int = 1
    """First columns that are words; the others are numbers."""


@record
class Typed:
    """Element of MJCF to paste."""

    text: str


ReportBlock = str | TextTable | Typed
"""A sentence, a table, or an element to paste."""


def describe_measurement(measurement: RobotMeasurement) -> Iterator[ReportBlock]:
    """Describe the loops of a robot, the worst first."""
    for loop in sorted(measurement.loops, key=find_worst_of_loop, reverse=True):
        yield from _describe_loop(loop)
        if loop.advice is not None:
            yield from describe_advice(loop, loop.advice)
    for note in measurement.notes:
        yield f"note: {note}"


def describe_judgement(judgement: LoopJudgement, stated: str) -> Iterator[ReportBlock]:
    """Describe a file that is judged against a scene.

    `stated`: options that win over the scene, as they were typed; "" without any.
    """
    yield from _describe_loop(judgement.measured, judgement, stated)
    for note in judgement.notes:
        yield f"note: {note}"
    yield from judgement.sentences()
    yield (
        f"{judgement.counts.sentence()}. It differs in"
        f" {write_count(len(judgement.differences), 'entry')}"
    )


def _describe_differences(judgement: LoopJudgement) -> Iterator[ReportBlock]:
    """List what differs from the generated file, with its cost, and the errors."""
    if not judgement.differences:
        yield "It differs in nothing from the generated MJCF."
    else:
        order = "the dearest difference first"
        if judgement.is_of_another_linkage:
            order = f"the lengths of another linkage first, then {order}"
        yield f"what differs from the generated MJCF, {order}"
        yield _ABOUT_COSTS
        rows = [(one.price, one.write()) for one in judgement.differences]
        yield TextTable(_DIFFERENCES, rows, 2)
    by_method: dict[str, list[tuple[str, ...]]] = {}
    for row in judgement.rows:
        generated = judgement.generated.get((row.engine, row.quantity), math.nan)
        errors = map(write_error, (row.error, generated, row.allowed))
        why = f": {row.reason}" if math.isnan(row.error) else ""
        cells = (row.quantity, *errors, f"{row.verdict}{why}")
        by_method.setdefault(f"{row.engine} {row.setting}", []).append(cells)
    for method, errors_of_method in by_method.items():
        yield f"what it costs, {method}:"
        yield TextTable(JUDGED_HEADINGS, errors_of_method)


def write_driven_range(loop: LoopMeasurement) -> str:
    """Write the driven joint of a loop and the range in which it is measured."""
    joints = loop.states.rows.joint
    first, last = (write_degrees(end) for end in (min(joints), max(joints)))
    return f"{loop.joint} from {first} to {last} deg"


def _write_heading(loop: LoopMeasurement, *, judged: bool, stated: str) -> str:
    speeds = loop.states.rows.speed
    ends = (f"{end:.4g}" for end in (min(speeds), max(speeds)))
    speed = " to ".join(dict.fromkeys(ends))
    how = "in the whole robot against rigid pins, and these against the formulas"
    if judged:
        how = "in the whole robot against the formulas"
        if loop.as_it_is:
            how = "with the file as it is against the formulas"
    given = f" (stated by {stated})" if stated else ""
    return (
        f"{loop.name}: {write_driven_range(loop)} at {speed} rad/s{given}, MuJoCo {how}"
    )


def _describe_loop(
    loop: LoopMeasurement,
    judgement: LoopJudgement | None = None,
    stated: str = "",
) -> Iterator[ReportBlock]:
    yield _write_heading(loop, judged=judgement is not None, stated=stated)
    yield _write_held(loop)
    if loop.switched_off:
        names = ", ".join(loop.switched_off)
        yield (
            "switched off, because it ties its bars to joints that are held, or to each"
            f" other: {names}"
        )
    left_out = find_left_out(loop)
    yield _write_left_out(left_out, lengths_are_read=bool(loop.rounding))
    if loop.states.in_line:
        within_digits = " within the digits of the file" if loop.rounding else ""
        places = ", ".join(map(write_degrees, loop.states.in_line))
        count = len(loop.states.in_line)
        yield (
            f"left out: {count} of {count + len(loop.states.rows)} states, with"
            f" {name_following(command(loop.scene).bar)} in line{within_digits}"
            f" ({loop.joint} = {places} deg), where the loop may go on in two ways"
        )
    for status, joints in list_without_value(loop).items():
        ends = " to ".join(map(write_degrees, (min(joints), max(joints))))
        yield (
            f"the formulas have no forces at {len(joints)} of {len(loop.states.rows)}"
            f" states ({loop.joint} = {ends} deg, status {status}): rigid pins are"
            " compared at the others"
        )
    errors = list_errors_by_method(loop)
    if left_out <= LEAST_LEFT_OUT:
        errors = [error for error in errors if error.method != RIGID]
    if judgement is None:
        yield TextTable(ERROR_HEADINGS, [error.cells() for error in errors])
    else:
        yield from _describe_differences(judgement)
    yield from _describe_vanishing(errors)
    yield from _describe_worst_near_limits(loop, errors)
    if loop.through_time is None:
        yield f"not simulated: {loop.refusal}"
    elif loop.through_time.lost:
        yield f"through time: {loop.through_time.lost}"
    else:
        if loop.through_time.other_assembly is not None:
            place = write_degrees(loop.through_time.other_assembly)
            yield (
                f"through time {name_following(command(loop.scene).bar)} come into"
                " line, and MuJoCo goes over to the other assembly, seen at"
                f" {loop.joint} = {place} deg: no state from there on is in a"
                " percentage"
            )
        worst = loop.through_time.rows[loop.through_time.rows.gap.argmax()]
        yield (
            f"gap through time: {1e3 * worst.gap:.3g} mm at {loop.joint} = "
            f"{write_degrees(worst.joint)} deg; a step takes "
            f"{1e6 * loop.through_time.seconds_per_step:.2g} us"
        )
    yield from _describe_torn(loop)
    for remark in loop.remarks:
        yield f"note: {remark}"


def _write_left_out(left_out: float, *, lengths_are_read: bool) -> str:
    """Write how far rigid pins differ from the formulas, and why."""
    size = f"{left_out:.1e}"
    if left_out <= SCENE_ROUND_OFF:
        size = f"less than {SCENE_ROUND_OFF:g}"
    reasons = "what the scene leaves out"
    if lengths_are_read:
        reasons += " and the lengths that it reads as equal"
    if left_out > LEAST_LEFT_OUT:
        reasons += " (the notes name what is known of it)"
    return (
        f"with rigid pins the robot differs from the formulas by {size} of the largest:"
        f" {reasons}; MuJoCo differs from rigid pins by its soft constraint"
    )


def _write_held(loop: LoopMeasurement) -> str:
    """Write what holds the other joints, what keeps the speed, and what is off."""
    text = "no other degree of freedom is held"
    if loop.held:
        are = "degree of freedom is" if loop.held == 1 else "degrees of freedom are"
        text = f"{loop.held} other {are} held: at single states by generalized forces"
        if loop.through_time is not None:
            text += ", through time (once the loop has settled) by armature"
    if loop.as_it_is:
        return f"{text}; contacts, joint limits and other motors act as in the file"
    return f"{text}; contacts, joint limits and motors are off"


def _describe_worst_near_limits(
    loop: LoopMeasurement, errors: Sequence[InsideError]
) -> Iterator[ReportBlock]:
    """Say that errors are worst near a limit position or a change point."""
    for error in errors:
        if near := _describe_limit(loop, error.angle):
            yield (
                f"{write_degrees(error.joint)} deg is {near}: the median tells of the"
                " rest of the motion"
            )
            return


def _describe_limit(loop: LoopMeasurement, angle: float) -> str:
    """Say how near the scene's commanded bar is to a place where errors are large.

    Such a place is a limit or a change point. The text is empty beyond NEAR_A_LIMIT.
    `angle`: rad.
    """
    scene = loop.scene
    linkage = scene.linkage
    bar = command(scene).bar
    places = dict.fromkeys(
        find_limit_angles(linkage, bar),
        "a limit position, beyond which the loop does not close",
    )
    places |= dict.fromkeys(
        change_points(linkage, bar),
        "a change point, where the bars are in line and the constraint is nearly"
        " singular",
    )
    near = [
        (abs(math.remainder(angle - at, math.tau)), kind) for at, kind in places.items()
    ]
    distance, kind = min(near, default=(math.inf, ""))
    if distance > NEAR_A_LIMIT:
        return ""
    return f"{round(math.degrees(distance), 6):.2g} deg from {kind}"


def _describe_vanishing(errors: Sequence[InsideError]) -> Iterator[ReportBlock]:
    """Say what the errors of a quantity are divided by that (nearly) vanishes."""
    scales = {error.quantity: error.scale for error in errors if error.vanishes}
    for quantity, scale in scales.items():
        size = f"{scale:.4g} {UNITS[quantity]}"
        factor = ""
        if quantity == "torque":
            factor = " times the longest moving bar"
        yield (
            f"{quantity} is zero but for rounding: its error is of the largest pin"
            f" force{factor}, {size}"
        )


def _describe_torn(loop: LoopMeasurement) -> Iterator[ReportBlock]:
    """Describe the state of the largest gap under a motor's torque."""
    if not loop.torn:
        return
    worst = max(loop.torn, key=lambda state: state.gap)
    if not math.isfinite(worst.gap):
        yield "under the torque the loop comes apart: MuJoCo lost the motion"
        return
    sizes = zip(PIN_FORCES, np.hypot(*worst.forces.T), strict=True)
    forces = ", ".join(f"{name} {size:.4g} N" for name, size in sizes)
    yield (
        "under the torque, let go from rest at"
        f" {write_count(len(loop.torn), 'position')} for ten time constants of the"
        " closure, with the file's joint limits: gap at most"
        f" {1e3 * worst.gap:.3g} mm, when {loop.joint} has come to"
        f" {write_degrees(worst.joint)} deg with {forces}"
    )


def describe_advice(
    loop: LoopMeasurement, advice: SettingsAdvice
) -> Iterator[ReportBlock]:
    """Describe what to type, what it reaches, and what each setting does alone."""
    before = advice.before
    best = advice.best
    yield (
        f"Errors are the worst of torque and pin forces at {advice.positions}"
        " positions, against rigid pins, over the largest of each. check-mjcf takes"
        " more positions and renews the torque at each, which changes its errors"
        " through time."
    )
    if not math.isfinite(best.error):
        reason = loop.refusal or "MuJoCo loses the motion"
        yield f"None of {advice.tried} combinations has an answer: {reason}"
    elif not advice.reached:
        yield (
            f"None of {advice.tried} combinations was within {advice.wanted:g}; the"
            f" best{':' if best.changes else ' is the file as it is.'}"
        )
    elif best.changes:
        yield f"Type this into the MJCF for an error within {advice.wanted:g}:"
    else:
        yield f"The file is within {advice.wanted:g} as it is."
    for element in advice.typed:
        yield Typed(element)
    if best.changes:
        error, gap, step = (
            " -> ".join(f"{one:.2g}" if math.isfinite(one) else "none" for one in pair)
            for pair in (
                (before.error, best.error),
                (1e3 * before.gap, 1e3 * best.gap),
                (1e6 * before.seconds_per_step, 1e6 * best.seconds_per_step),
            )
        )
        yield f"error {error}, gap {gap} mm, {step} us a step"
    yield from _describe_deciding(loop, advice)
    rows = [_write_tried(one) for one in (before, *advice.alone)]
    yield TextTable(_SETTINGS, rows)


def _describe_deciding(
    loop: LoopMeasurement, advice: SettingsAdvice
) -> Iterator[ReportBlock]:
    """Say which state decides the error, and in which range it is within the wanted."""
    state = advice.best.deciding
    if math.isfinite(state.error):
        through_time = state is advice.best.through_time
        method = MEASURED_THROUGH_TIME if through_time else f"at {STATES}"
        near = _describe_limit(loop, state.angle)
        yield (
            f"{state.quantity} {method} decides, at {loop.joint} ="
            f" {write_degrees(state.joint)} deg{', ' if near else ''}{near}"
        )
    if advice.within is not None:
        ends = [f"{write_degrees(end)}deg" for end in advice.within]
        yield (
            f"The best is within {advice.wanted:g} from {ends[0]} to {ends[1]}:"
            f" --range {','.join(ends)} looks for the cheapest there"
        )
    elif not advice.reached and math.isfinite(advice.best.error):
        yield "No part of the range was found in which it is within the wanted error."


def _write_tried(tried: TriedSettings) -> tuple[str, ...]:
    """Write a row of settings; what was not simulated, in too many steps, is a dash."""
    changes = " ".join(f'{name}="{value}"' for name, value in tried.changes.items())
    simulated = (f"{tried.through_time.error:.2g}", f"{1e3 * tried.cost:.2g} ms/s")
    return (
        changes or "nothing",
        f"{tried.states.error:.2g}",
        *(simulated if math.isfinite(tried.cost) else ("-", "-")),
    )


def show_block(block: ReportBlock) -> None:
    """Print a sentence, a table or an element."""
    if isinstance(block, TextTable):
        from rich.console import Console

        table = make_words_table(
            block.headings, block.rows, block.words, show_edge=False
        )
        Console().print(table)
    elif isinstance(block, Typed):
        print_sentence(block.text, whole=re.compile('"[^"]*"'))
    else:
        print_sentence(block)


def write_markdown(title: str, blocks: Sequence[ReportBlock]) -> str:
    """Write sentences, tables and elements as a page of Markdown."""
    parts = [f"# {escape_cell(title)}"]
    for block in blocks:
        if isinstance(block, TextTable):
            headings, *rows = (
                f"| {' | '.join(map(escape_cell, row))} |"
                for row in (block.headings, *block.rows)
            )
            rule = f"|{' --- |' * len(block.headings)}"
            parts.append("\n".join([headings, rule, *rows]))
        elif isinstance(block, Typed):
            parts.append(f"```xml\n{escape_controls(block.text)}\n```")
        else:
            parts.append(escape_cell(block))
    return "\n\n".join(parts) + "\n"


def write_states(loops: Sequence[LoopMeasurement]) -> str:
    """Write every state that MuJoCo was asked at as CSV, under STATES_FILE."""
    return write_csv_rows(STATES_FILE, _list_states(loops))


def _list_states(
    loops: Sequence[LoopMeasurement],
) -> Iterator[tuple[str | float, ...]]:
    for loop in loops:
        for method, answer in (
            (STATES, loop.states),
            (MEASURED_THROUGH_TIME, loop.through_time),
        ):
            for row in () if answer is None else answer.rows:
                both = (row.soft, row.rigid)
                numbers = [math.degrees(row.joint), row.speed, row.acceleration]
                numbers += [one.torque for one in both]
                for one in both:
                    numbers += [math.hypot(*one[name]) for name in PIN_FORCES]
                numbers.append(1e3 * row.gap)
                yield escape_controls(loop.name), method, *map(float, numbers)


def list_measured_rows(measurement: RobotMeasurement) -> list[Row]:
    """List the errors of loops that nobody's scene judges, as rows of a run."""
    return [
        Row(
            escape_controls(loop.name),
            error.method,
            "-",
            error.quantity,
            error.part,
            math.nan,
            UNDECIDED,
            "measured, and not judged: no SCENE is given",
            error.theta_2,
            math.nan,
        )
        for loop in measurement.loops
        for error in list_errors_by_method(loop)
    ]


def write_report(
    robot: Path,
    out: Path,
    blocks: Sequence[ReportBlock],
    rows: Sequence[Row],
    loops: Sequence[LoopMeasurement],
) -> None:
    """Print a report, and write robot.md, results.csv and states.csv into a folder."""
    for block in blocks:
        show_block(block)
    out.mkdir(parents=True, exist_ok=True)
    title = f"The loops of {robot.name} in MuJoCo"
    write_text(out / "robot.md", write_markdown(title, blocks))
    write_results(rows, out / "results.csv")
    write_text(out / "states.csv", write_states(loops))
    click.echo(escape_controls(f"written to {out}"))
