"""`python -m validation check-mjcf`: what differs from the generated MJCF, and why.

Each difference has a cost: what it does to the accuracy. The file is somebody's: it is
compiled and run in a process of its own, with a limit on time and memory.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np

from fourbar.errors import InputError
from fourbar.quantities import FORCE_NAMES, PIN_FORCES, UNKNOWNS, Array
from fourbar.scene import Scene
from fourbar.solving import solve
from fourbar.writing import write_text
from fourbar_validation.check.differences import (
    Difference,
    find_differences,
    is_of_another_linkage,
    is_setting,
    order,
    price,
)
from fourbar_validation.check.unread import list_unread
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.compare import Comparison, Demands
from fourbar_validation.compare.rows import (
    DEGRADED,
    FAILS,
    Counts,
    Row,
    escape_controls,
    write_results,
)
from fourbar_validation.compare.tolerance import (
    SIMULATED,
    TIMES_PREDICTED,
    ErrorBound,
    Mask,
    hold_simulated,
)
from fourbar_validation.engines.mujoco.robots.loop import RobotFile
from fourbar_validation.report.sentences import make_words_table
from fourbar_validation.report.templating import render, write_error
from fourbar_validation.robots.files import is_four_bar_alone, read_robot
from fourbar_validation.robots.guard import examine_guarded
from fourbar_validation.robots.measure import (
    find_worst_of_loop,
    measure_robot,
    read_measure_options,
)
from fourbar_validation.robots.mimic import measure_mimic, show_mimic
from fourbar_validation.robots.options import (
    ROBOT_PATH,
    loop_option,
    pose_options,
    speed_option,
    torque_option,
)
from fourbar_validation.robots.report import report_measurement
from fourbar_validation.scenes.suites import read_scene_files

_ABOUT_COSTS = (
    "cost: what this one entry adds to the error of the file itself, if it is a"
    " setting, a weld, contacts, a range or a motor; of the others what it adds, as in"
    " the file, to the error of the generated one. Of torque and pin forces the one"
    " that grows most. A dash: this entry cannot be set by itself, or the file holds"
    " what it is held to"
)
_ADVICE = (
    "What to type into the file for an error E, if its settings are the cause: "
    "fourbar-validation advise SCENE FILE.xml --error E"
)
_LENGTHS_FIRST = (
    "Mend the lengths first: what contacts and settings cost here is a cost in another"
    " linkage."
)
_WIDTH_OF_PRICES = 16
"""Columns of the costs: one with the longest name of a quantity."""
JUDGED_QUANTITIES = tuple(
    name for name in UNKNOWNS if name not in ("alpha_3", "alpha_4")
)
"""Quantities that a file is held to. A soft loop lets the bars accelerate by themselves
for an instant; what that does to the torque and the pin forces is judged there.
"""
MODEL_HEADINGS = ("quantity", "theirs", "generated", "allowed", "verdict")
_EXAMINE = "fourbar_validation.engines.mujoco.theirs:examine_file"
_CHANGED = "fourbar_validation.engines.mujoco.theirs:examine_changed"
_MENDED = "fourbar_validation.engines.mujoco.theirs:examine_mended"
SOFTNESS_ENTRY = "fourbar_validation.engines.mujoco.theirs:predict_softness"
_BY_STIFFEST = (
    "as what MuJoCo's stiffest constraint (solimp 0.9999) leaves in this file"
)
"""Method by which the error of a file is predicted that nobody holds to another."""


@dataclass(frozen=True, slots=True)
class _CostOfModel:
    """One quantity by one method: the error of their file, and of the generated one."""

    row: Row
    generated: float

    @property
    def method(self) -> str:
        """Engine and setting."""
        return f"{self.row.engine} {self.row.setting}"

    def cells(self) -> tuple[str, ...]:
        """Return the rows under MODEL_HEADINGS; a row without an error says why."""
        row = self.row
        if not math.isnan(row.error):
            verdict = row.verdict
        else:
            verdict = f"{row.verdict}: {row.reason}"
        return (
            row.quantity,
            write_error(row.error),
            write_error(self.generated),
            write_error(row.allowed),
            verdict,
        )


@dataclass(frozen=True, slots=True)
class ModelReport:
    """Report on a user's file."""

    differences: list[Difference]
    """Differences, the dearest first."""
    costs: list[_CostOfModel]
    notes: list[str]

    def methods(self) -> list[str]:
        """List the methods by which their file was evaluated."""
        return list(dict.fromkeys(cost.method for cost in self.costs))

    def sentences(self) -> Iterator[str]:
        """Yield a sentence for each method: the errors of torque and worst force."""
        for method in self.methods():
            errors = {
                cost.row.quantity: cost.row.error
                for cost in self.costs
                if cost.method == method and cost.row.quantity in FORCE_NAMES
            }
            if not errors or any(math.isnan(error) for error in errors.values()):
                continue
            driving = {
                name: errors.pop(name) for name in [*errors] if name not in PIN_FORCES
            }
            parts = [
                f"{name} is off by {write_error(error)}"
                for name, error in driving.items()
            ]
            if errors:
                worst = max(errors, key=lambda name: errors[name])
                parts.append(
                    f"the worst pin force, {worst}, by {write_error(errors[worst])}"
                )
            yield f"{method}: {', '.join(parts)}, of its largest value."
        soft = [cost.row for cost in self.costs if cost.row.verdict == DEGRADED]
        if soft and not self.counts[FAILS]:
            softest = max(soft, key=lambda row: row.error)
            left = write_error(softest.allowed / TIMES_PREDICTED)
            yield (
                "The file is right as far as MuJoCo's constraints let it be: the "
                f"stiffest (solimp 0.9999) leaves {left} of {softest.quantity} in it."
            )
        if self.is_of_another_linkage:
            yield _LENGTHS_FIRST
        elif self.counts[FAILS]:
            yield _ADVICE

    @property
    def is_of_another_linkage(self) -> bool:
        """Tell whether lengths make their file one of another linkage."""
        return any(map(is_of_another_linkage, self.differences))

    @property
    def counts(self) -> Counts:
        """Return the comparisons of their file by verdict."""
        return Counts(cost.row for cost in self.costs)


def _read_role_names(pairs: tuple[str, ...]) -> dict[str, str]:
    """Read ROLE=NAME pairs of the command line."""
    allowed = ("input", "coupler", "output", "B3", "B4")
    names = {}
    for pair in pairs:
        role, equals, name = pair.partition("=")
        if not equals or role not in allowed or not name:
            raise InputError(
                "--name",
                pair,
                f"must be ROLE=NAME, ROLE one of {', '.join(allowed)}",
            )
        names[role] = name
    return names


def examine_model(
    name: str,
    scene: Scene,
    mjcf: Path,
    names: Mapping[str, str],
    wanted: float | None = None,
    assets: Path | None = None,
) -> ModelReport:
    """Examine a file in a guarded process, and the generated one before.

    Parameters
    ----------
    wanted : relative error that theirs is held to; None: that of the generated file,
        and where its torque or pin forces exceed this, what MuJoCo's stiffest
        constraint leaves in it.
    """
    tolerance = SIMULATED
    if wanted is not None:
        tolerance = hold_simulated(wanted, "what this file may be wrong by")
    file = read_robot(mjcf, assets)
    with examine_guarded(mjcf) as examined:
        generated = examined(_EXAMINE, scene, None, {})
        theirs = examined(_EXAMINE, scene, file, dict(names))
        ours = {
            (row.engine, row.quantity): row.error
            for row in _list_rows(name, scene, generated.answers, SIMULATED)
        }
        softness: dict[str, float] = {}
        rows = _list_rows(name, scene, theirs.answers, tolerance)
        if wanted is None and any(row.failed for row in rows):
            softness = examined(SOFTNESS_ENTRY, scene, file, theirs.names)
            rows = _list_rows(name, scene, theirs.answers, tolerance, softness)
        costs = [
            _CostOfModel(row, ours.get((row.engine, row.quantity), math.nan))
            for row in rows
        ]
        differences = find_differences(generated.described, theirs.described)
        if any(row.failed for row in rows):
            differences = _price_differences(
                name,
                scene,
                file,
                theirs,
                differences,
                rows,
                tolerance,
                examined,
            )
    if parts := list_unread(file.text):
        unread = [f"not looked at: {', '.join(parts)}"]
    else:
        unread = []
    return ModelReport(
        order(differences),
        costs,
        [*theirs.notes, *unread],
    )


def _price_differences(
    name: str,
    scene: Scene,
    file: RobotFile,
    theirs: Any,
    differences: list[Difference],
    rows: list[Row],
    tolerance: ErrorBound,
    examined: Callable[..., Any],
) -> list[Difference]:
    """Return the differences, each with its cost in accuracy.

    Differences of the mechanism are put one at a time into the generated file;
    settings, and what the generated file cannot hold, are corrected in theirs.
    """
    of_mechanism = [one for one in differences if not is_setting(one.key)]
    answered = examined(
        _CHANGED,
        scene,
        [(one.key, one.theirs) for one in of_mechanism],
    )
    unchanged, *changed = (
        _list_rows(name, scene, answers or [], tolerance) for answers in answered
    )
    priced = {
        one.key: price(one, its_rows, unchanged)
        for one, its_rows in zip(of_mechanism, changed, strict=True)
    }
    for one in differences:
        priced.setdefault(one.key, one)
    left = [one for one in priced.values() if one.cost is None]
    changes = [(one.key, one.generated) for one in left]
    answered = examined(_MENDED, scene, file, theirs.names, changes)
    for one, answers in zip(left, answered, strict=True):
        if answers is not None:
            mended = _list_rows(name, scene, answers, tolerance)
            priced[one.key] = price(one, rows, mended)
    return [priced[one.key] for one in differences]


def _list_rows(
    name: str,
    scene: Scene,
    answers: list[Answer],
    tolerance: ErrorBound,
    softness: Mapping[str, float] | None = None,
) -> list[Row]:
    """Hold answers to a tolerance, N m and N.

    Where the softness of their loop is known, they are held to what it leaves.
    """

    def predicted(quantity: str, mask: Mask) -> Array:
        return np.full(len(mask), (softness or {}).get(quantity, 0.0))

    held = Demands(tolerance, JUDGED_QUANTITIES)
    if softness:
        held = held._replace(predicted=predicted, method=f", {_BY_STIFFEST}")
    rows = []
    for answer in answers:
        formulas = solve(scene, "force", at=answer.at)
        rows += Comparison(name, scene, answer, formulas, held).rows()
    return rows


def show_model_report(
    report: ModelReport,
    mjcf: Path,
    out: Path,
) -> None:
    """Print the report and write theirs.md and results.csv."""
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    console = Console()
    if not report.differences:
        console.print("It differs in nothing from the generated MJCF.")
    else:
        if report.is_of_another_linkage:
            order = "the lengths of another linkage first, then the dearest difference"
        else:
            order = "the dearest difference first"
        console.print(
            f"{escape(escape_controls(mjcf.name))} against the generated MJCF, {order}"
        )
        console.print(f"[dim]{_ABOUT_COSTS}[/]\n")
    entries = Table.grid(padding=(0, 2, 0, 0))
    entries.add_column(justify="right", min_width=_WIDTH_OF_PRICES)
    entries.add_column(overflow="fold")
    for difference in report.differences:
        entries.add_row(difference.price, escape(escape_controls(difference.line())))
        for text in (
            f"in the file: {difference.written}" if difference.written else "",
            difference.remark,
        ):
            if text:
                entries.add_row("", escape(escape_controls(text)))
    console.print(entries)
    for note in report.notes:
        console.print(f"note: {escape(escape_controls(note))}")
    for method in report.methods():
        costs = [cost for cost in report.costs if cost.method == method]
        table = make_words_table(
            MODEL_HEADINGS,
            (cost.cells() for cost in costs),
            title=f"what it costs, {escape(method)}: error",
        )
        for shown, cost in zip(table.rows, costs, strict=True):
            if cost.row.failed:
                shown.style = "bold red"
            else:
                shown.style = ""
        console.print(table)
    out.mkdir(parents=True, exist_ok=True)
    write_text(out / "theirs.md", write_model_page(report, mjcf))
    write_results([cost.row for cost in report.costs], out / "results.csv")
    for sentence in report.sentences():
        console.print(sentence)
    sentence = (
        f"{report.counts.sentence()}. It differs in {len(report.differences)} entries"
    )
    console.print(
        f"[bold]{sentence}[/]; written to {escape(escape_controls(str(out)))}"
    )


def write_model_page(report: ModelReport, mjcf: Path) -> str:
    """Write the same as text for a page."""
    what = {
        "report": report,
        "mjcf": mjcf.name,
        "about": _ABOUT_COSTS,
        "headings": ("method", *MODEL_HEADINGS),
    }
    what |= {"differences": [difference.cells() for difference in report.differences]}
    what |= {"costs": [(cost.method, *cost.cells()) for cost in report.costs]}
    return render("fourbar_validation.check", "theirs.md.j2", **what)


@click.command(name="check-mjcf")
@click.argument(
    "files",
    metavar="[SCENE] FILE.xml",
    nargs=-1,
    required=True,
    type=ROBOT_PATH,
)
@click.option(
    "--name",
    "names",
    metavar="ROLE=NAME",
    multiple=True,
    help=(
        "The body that is the input, coupler or output; B3, B4: the sites of pin B on"
        " the coupler and the output, where no connect or weld closes the loop. Left"
        " out: guessed from structure and lengths, and printed."
    ),
)
@loop_option
@pose_options
@speed_option
@torque_option
@click.option(
    "--mimic",
    metavar="JOINT",
    help=(
        "Joint whose equality, a polynomial, stands for the loop of SCENE: what it"
        " loses."
    ),
)
@click.option(
    "--error",
    "wanted",
    type=float,
    metavar="E",
    help=(
        "The relative error that FILE.xml may have; of a loop in a robot also: what to"
        " type to reach it."
    ),
)
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("results"),
    show_default=True,
    help=(
        "Folder for the report: theirs.md and results.csv of a four-bar alone, robot.md"
        " and robot.csv of loops."
    ),
)
def check_mjcf_command(
    files: tuple[Path, ...],
    names: tuple[str, ...],
    loop: str | None,
    mimic: str | None,
    wanted: float | None,
    out: Path,
    **robot: Any,
) -> int:
    """Compare your own MJCF with a scene.

    Printed are the errors of torque and pin forces, and their causes.

    A four-bar alone is compared with the generated MJCF of SCENE, entry by entry. With
    --loop, without SCENE, or where FILE.xml has more joints, loops are measured inside
    the whole robot; without SCENE it is taken from the file.
    """
    if len(files) > 2:
        raise click.UsageError("give one FILE.xml, and SCENE before it or not")
    theirs = files[-1]
    name = ""
    scene = None
    if len(files) == 2:
        suite = read_scene_files(files[:1])
        name = suite.name(0)
        scene = suite.scene(0)
    if mimic is not None:
        if scene is None:
            raise click.UsageError("--mimic needs the SCENE of the loop")
        show_mimic(measure_mimic(theirs, mimic, scene, robot["assets"]))
        return 0
    assets = robot.pop("assets")
    if loop is not None or scene is None or _is_robot(theirs, names, assets, robot):
        if names:
            raise click.UsageError("--name is for the MJCF of a four-bar alone")
        options = read_measure_options(loop, wanted, robot)
        measurement = measure_robot(theirs, options, scene, assets)
        report_measurement(measurement, theirs, out)
        worst = max(map(find_worst_of_loop, measurement.loops))
        return int(wanted is not None and not worst <= wanted)
    examined = examine_model(
        name,
        scene,
        theirs,
        _read_role_names(names),
        wanted,
        assets,
    )
    show_model_report(examined, theirs, out)
    return examined.counts.status


def _is_robot(
    mjcf: Path,
    names: tuple[str, ...],
    assets: Path | None,
    robot: Mapping[str, Any],
) -> bool:
    """Return whether a file is to be measured as a robot.

    A robot has options of its own, or more joints than a four-bar.
    """
    return any(robot.values()) or (
        not names and not is_four_bar_alone(read_robot(mjcf, assets))
    )
