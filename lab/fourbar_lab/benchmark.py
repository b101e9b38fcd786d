"""`python -m fourbar_lab benchmark`: ask every engine every problem of models/problems.

The answers make a table (CSV) and a page with a letter for each engine and problem.
"""

import json
import math
import re
import shlex
import time
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import cycle
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np

from fourbar import sensitivity
from fourbar.errors import DependencyError, FourBarError, InputError
from fourbar.quantities import PIN_FORCES
from fourbar.writing import write_text
from fourbar_lab.simulators.problems import PROBLEMS, list_problems
from fourbar_validation.check.problem import (
    MISSING,
    RESULT,
    find_levels,
    judge_answers,
    read_problem,
)
from fourbar_validation.compare.answer import EngineError
from fourbar_validation.compare.rows import say_error, write_csv_rows, write_one_line
from fourbar_validation.engines import protocol
from fourbar_validation.engines.environments import (
    ENGINES_FILE,
    EngineEntry,
    prepare_program,
    read_engines_of,
)
from fourbar_validation.engines.guests import HELLO
from fourbar_validation.engines.programs import Running
from fourbar_validation.places import find_checkout
from fourbar_validation.report.machine import name_machine
from fourbar_validation.report.svg import (
    BAND,
    INK,
    LIGHT_COLOURS,
    PAPER,
    set_frame,
    write_alone,
    write_svg,
)
from fourbar_validation.report.templating import render

BENCHMARKED_ENGINES = Path(__file__).parent / ENGINES_FILE
JsonObject = dict[str, Any]
"""A question, a reply, a result or a problem."""
REFUSED = "R"
DIFFERENTIATED = "crank_rocker"
"""Problem whose errors are drawn over time. An engine that has derivatives is asked for
them at it.
"""
BENCHMARK_COLUMNS = (
    "problem",
    "engine",
    "version",
    "setting",
    "quantity",
    "error",
    "level",
    "letters",
    "seconds",
    "reason",
)
"""Columns of the table."""
KIND = re.compile(r" \((released|slider-crank)\)$")
"""End of the name of an entry that answers one kind of problem. It answers for the row
that the rest of its name names.
"""


class BenchmarkRun(NamedTuple):
    """One answer: of several timesteps each is one."""

    setting: str
    seconds: float
    """Processor time as the engine states it, else the time to its answer, s."""
    numbers: list[tuple[str, str, str]]
    """Quantity, error, level."""


class TimedWork(NamedTuple):
    """Cost of a run through time, and its error."""

    seconds: float
    """Processor time, s."""
    error: float
    """Largest error of torque and pin forces, each divided by its largest value."""


@dataclass(slots=True)
class _MatrixCell:
    """Answer of one engine to one problem."""

    letters: str = MISSING
    """Reactions and torque, in the finest of its timesteps. Of a released motion they
    are reactions and motion.
    """
    reason: str = ""
    runs: list[BenchmarkRun] = field(default_factory=list)
    order: float | None = None
    """Power of the timestep with which the torque's error fell in the last step."""
    script: str = ""
    file: str = ""
    """Result file of the finest timestep."""


@dataclass(slots=True)
class _MatrixRow:
    """One engine in one setting."""

    entry: EngineEntry
    hello: JsonObject = field(default_factory=dict)
    cells: dict[str, _MatrixCell] = field(default_factory=dict)
    slopes: list[tuple[str, dict[str, str]]] = field(default_factory=list)
    """Ways of differentiation with the relative errors of the torque and of each of its
    derivatives.
    """
    changed: str = ""
    """Changes to the engine's input or defaults that its adapter states."""

    def text(self, key: str) -> str:
        """Return a text of hello, in one line."""
        return write_one_line(str(self.hello.get(key, "")))


def name_row(engine: str, version: str) -> str:
    """Name an engine with its version before the way in which it is used."""
    program, colon, way = engine.partition(":")
    if not version or version in engine:
        return engine
    return f"{program} {version}{colon}{way}"


def read_reasons(file: Path) -> dict[str, str]:
    """Read why letters are not A, by the name of a row, or by what it begins with."""
    document = tomllib.loads(file.read_text(encoding="utf-8"))
    return dict(document.get("because", {}))


class Benchmark:
    """A run over engines and problems.

    An engine is not asked again what the same version answered in an earlier run.
    """

    def __init__(
        self,
        engines: Iterable[EngineEntry],
        reasons: Mapping[str, str],
        problems: Iterable[str],
        out: Path,
    ) -> None:
        self.engines = list(engines)
        self.reasons = reasons
        self.out = out
        self.problems = {
            name: read_problem(PROBLEMS / f"{name}.json") for name in problems
        }
        self.rows: dict[str, _MatrixRow] = {}

    def run(self, seconds: float) -> None:
        """Ask every engine every problem, each question within its limit of time."""
        for entry in self.engines:
            try:
                running = Running(prepare_program(entry, seconds))
            except (DependencyError, InputError) as error:
                self._leave_out(entry, str(error))
                continue
            try:
                hello = running.ask_again(HELLO, 0)
                if "error" in hello:
                    raise EngineError(str(hello["error"]))
                settings = hello.get("settings") or [""]
                for setting in [entry.setting] if entry.setting else settings:
                    self._ask_engine(entry, hello, setting, running)
            except EngineError as error:
                self._leave_out(entry, str(error))
            finally:
                running.end()

    def _leave_out(self, entry: EngineEntry, reason: str) -> None:
        row = self.rows.setdefault(KIND.sub("", entry.name), _MatrixRow(entry))
        cell = _MatrixCell(reason=f"not run: {write_one_line(reason)}")
        row.cells = dict.fromkeys(self.problems, cell) | row.cells

    def _ask_engine(
        self,
        entry: EngineEntry,
        hello: JsonObject,
        setting: str,
        running: Running,
    ) -> None:
        """Ask an engine in one setting every problem."""
        way = "" if entry.setting else setting
        joint = ", " if ":" in entry.name else ": "
        label = KIND.sub("", entry.name) + (f"{joint}{way}" if way else "")
        row = self.rows.setdefault(label, _MatrixRow(entry))
        row.hello = hello
        for name, problem in self.problems.items():
            cell = _MatrixCell(script=entry.adapter or shlex.join(entry.command))
            lacking = sorted(_list_effects_of(problem) - set(hello.get("effects", [])))
            if problem["mechanism"] not in hello.get("mechanisms", ["four-bar"]):
                lacking = [problem["mechanism"]]
            if lacking:
                cell.letters = REFUSED
                cell.reason = f"refused: it does not take {', '.join(lacking)}"
            else:
                for result in self._ask_problem(row, setting, label, problem, running):
                    row.changed = row.changed or str(result.get("shared", ""))
                    self._judge(problem, result, cell)
            if cell.letters not in ("AA", REFUSED):
                cell.reason = cell.reason or self._explain(label)
            # another kind of this row may have answered
            if cell.letters != REFUSED or name not in row.cells:
                row.cells[name] = cell
        if DIFFERENTIATED in self.problems and not row.slopes:
            problem = self.problems[DIFFERENTIATED]
            question = {key: problem[key] for key in ("scene", "command")}
            stated = {"problem": DIFFERENTIATED}
            question["ask"] = "slopes"
            result = self._take_or_ask(row, label, "slopes", stated, question, running)
            row.slopes = compare_slopes(problem, result.get("slopes", []))

    def _ask_problem(
        self,
        row: _MatrixRow,
        setting: str,
        label: str,
        problem: JsonObject,
        running: Running,
    ) -> Iterator[JsonObject]:
        """Ask one problem, at each number of steps."""
        keys = ("ask", "scene", "command", "times")
        question = {key: problem[key] for key in keys if key in problem}
        name = problem["problem"]
        stated = {"schema": RESULT, "problem": name}
        several = row.entry.steps if problem["ask"] == "answer" else ()
        for steps in several or (None,):
            asked: JsonObject = {"name": setting} if setting else {}
            stem = name
            if steps is not None:
                asked["steps_per_turn"] = steps
                stem = f"{name}-{steps}"
            if asked:
                question["setting"] = asked
            yield self._take_or_ask(row, label, stem, stated, question, running)

    def _take_or_ask(
        self,
        row: _MatrixRow,
        label: str,
        stem: str,
        stated: JsonObject,
        question: JsonObject,
        running: Running,
    ) -> JsonObject:
        """Take the result of an earlier run by the same version, or ask.

        The result is stored; one that broke down is asked for again.
        """
        file = self.out / "results" / re.sub(r"[^\w.-]+", "-", label) / f"{stem}.json"
        version = row.text("version")
        result = json.loads(file.read_text("utf-8")) if file.is_file() else {}
        broke_down = result.get("reason", "").startswith("broke down")
        if result.get("version") != version or broke_down:
            result = stated | {"engine": label, "version": version}
            result |= _ask_question(running, question)
            file.parent.mkdir(parents=True, exist_ok=True)
            write_text(file, json.dumps(result))
        return {**result, "file": file.relative_to(self.out)}

    def _judge(
        self,
        problem: JsonObject,
        result: JsonObject,
        cell: _MatrixCell,
    ) -> None:
        """Judge one result; of several timesteps the finest that is answered stands."""
        if "answers" not in result:
            if not cell.runs:
                cell.reason = result["reason"]
                refused = cell.reason.startswith("refused")
                cell.letters = REFUSED if refused else MISSING
            return
        try:
            judged = judge_answers(problem, result)
        except InputError as error:
            cell.letters = MISSING
            cell.reason = f"an answer that cannot be judged: {error}"
            return
        levels = find_levels([row for row in judged if row.level != MISSING])
        second = "torque" if "torque" in find_levels(judged) else "motion"
        groups = "reactions", second
        cell.letters = "".join(levels.get(group, MISSING) for group in groups)
        cell.reason, cell.file = "", str(result["file"])
        numbers = [(row.quantity, f"{row.error:.1e}", row.level) for row in judged]
        if (gap := result.get("evidence", {}).get("gap")) is not None:
            numbers.append(("gap at B", f"{gap:.1e}", ""))
        waited: float = result["asked_for"]
        seconds = float(result.get("seconds", waited))
        setting = str(result.get("setting", "exact"))
        cell.runs.append(BenchmarkRun(setting, seconds, numbers))
        cell.order = _find_order(cell.runs)

    def _explain(self, label: str) -> str:
        """Return the reason for a row's letters, "" if none is stated.

        Of several names with which the row's label begins, the longest counts.
        """
        names = [name for name in self.reasons if label.startswith(name)]
        return self.reasons.get(max(names, key=len, default=""), "")

    def list_rows(self) -> list[JsonObject]:
        """Return the rows of the table by column, problem by problem.

        A run at a coarser timestep than the finest has no level.
        """
        table = []
        blank = dict.fromkeys(BENCHMARK_COLUMNS, "")
        for problem in self.problems:
            for label, row in self.rows.items():
                lines = [*_list_numbers(row.cells[problem])]
                if problem == DIFFERENTIATED:
                    lines += _list_slopes(row)
                stated = blank | {"problem": problem, "engine": label}
                stated["version"] = row.text("version")
                table += [stated | line for line in lines]
        return table

    def write(self) -> None:
        """Write the table and the page."""
        table = self.list_rows()
        lists = [[*line.values()] for line in table]
        write_text(self.out / "benchmark.csv", write_csv_rows(BENCHMARK_COLUMNS, lists))
        rows = {
            name_row(label, row.text("version")): row
            for label, row in self.rows.items()
        }
        chart = ""
        if lines := read_work(table):
            chart = write_svg(draw_panels(lines), "benchmark")
            picture = write_alone(draw_panels(lines), "benchmark")
            write_text(self.out / "benchmark.svg", picture)
        page = render(
            "fourbar_lab",
            "benchmark.html.j2",
            machine=name_machine(),
            problems=self.problems,
            rows=rows,
            chart=chart,
        )
        write_text(self.out / "benchmark.html", page)


def _list_numbers(cell: _MatrixCell) -> Iterator[dict[str, str]]:
    """Yield the entries of a cell's rows, by column."""
    if not cell.runs:
        letters = dict.fromkeys(("level", "letters"), cell.letters)
        yield {"quantity": "all", "reason": cell.reason, **letters}
    for run in cell.runs:
        finest = run is cell.runs[-1]
        for quantity, error, level in run.numbers:
            reason = cell.reason if finest and level not in ("A", "") else ""
            yield {
                "setting": run.setting,
                "quantity": quantity,
                "error": error,
                "level": level if finest else "",
                "letters": cell.letters if finest else "",
                "seconds": f"{run.seconds:.3g}",
                "reason": "not read" if level == MISSING else reason,
            }


def _list_slopes(row: _MatrixRow) -> list[dict[str, str]]:
    """List the entries of the rows of an engine's derivatives, by column."""
    return [
        {"setting": how, "quantity": f"d torque / d {key}", "error": error}
        for how, errors in row.slopes
        for key, error in errors.items()
    ]


PANELS = {
    "Pinocchio": ("Pinocchio",),
    "MuJoCo": ("MuJoCo",),
    "Descendants of MuJoCo": ("MJX-JAX", "MuJoCo Warp", "Newton: MuJoCo", "Genesis"),
    "Exudyn": ("Exudyn",),
    "Drake": ("Drake",),
    "Others": ("",),
}
"""Panels of the picture, and what the names of their engines begin with."""
VERSION_IN_A_NAME = re.compile(r" \d[\d.]*")
"""Version within the name of a row."""
_FAMILY_COLOURS = ("--e1", "--e3", "--e4", "--e2", "--e8", "--e9")
_MARKERS = "os^DvP"
"""Markers of the settings of a family, one after the other."""


def read_work(table: Iterable[Mapping[str, Any]]) -> dict[str, list[TimedWork]]:
    """Read processor time and worst error of torque and pin forces of every run."""
    errors: dict[str, dict[float, float]] = {}
    for row in table:
        seconds = float(row["seconds"] or 0.0)
        timed = row["setting"].endswith("/rev") and seconds > 0.0
        wanted = row["quantity"] in ("torque", *PIN_FORCES)
        if row["problem"] == DIFFERENTIATED and timed and wanted:
            runs = errors.setdefault(name_row(row["engine"], row["version"]), {})
            error = float(row["error"])
            runs[seconds] = float(np.fmax(runs.get(seconds, math.nan), error))
    return {
        name: [TimedWork(*run) for run in runs.items()] for name, runs in errors.items()
    }


def find_panel(name: str) -> str:
    """Find the panel of an engine: that of the longest beginning of its name."""
    beginnings = {
        beginning: family for family, names in PANELS.items() for beginning in names
    }
    plain = VERSION_IN_A_NAME.sub("", name)
    return beginnings[max(filter(plain.startswith, beginnings), key=len)]


def draw_panels(lines: Mapping[str, list[TimedWork]]) -> Any:
    """Draw error over processor time: a panel a family, the others in grey."""
    from matplotlib.figure import Figure

    present = {find_panel(name) for name in lines}
    colours = dict(zip(PANELS, _FAMILY_COLOURS, strict=True))
    shown = [family for family in PANELS if family in present]
    rows = math.ceil(len(shown) / 2)
    size = (7.7, 3.1 * rows)
    figure = Figure(figsize=size, layout="constrained", facecolor=PAPER)
    panels = figure.subplots(rows, 2, sharex=True, sharey=True).ravel()
    for axes in panels[len(shown) :]:
        axes.set_axis_off()
    for axes, family in zip(panels, shown, strict=False):
        axes.set_facecolor("none")
        set_frame(axes)
        axes.tick_params(which="both", labelcolor=INK)
        markers = cycle(_MARKERS)
        for name, points in lines.items():
            look: JsonObject = {"color": BAND, "linewidth": 0.8, "zorder": 1.5}
            if find_panel(name) == family:
                look = {
                    "color": LIGHT_COLOURS[colours[family]],
                    "linewidth": 1.5,
                    "zorder": 3.0,
                    "marker": next(markers),
                    "markersize": 5.0,
                    "label": name,
                }
            axes.loglog(*zip(*points, strict=True), **look)
        below = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "labelcolor": INK}
        legend = axes.legend(fontsize=8, frameon=False, borderaxespad=0.2, **below)
        height = 12.5 * len(legend.get_texts())
        title = {"loc": "left", "fontsize": 9.5, "weight": "bold", "color": INK}
        axes.set_title(family, pad=5.0 + height, **title)
    figure.supxlabel("processor time of the run, s", fontsize=9, color=INK)
    errors = "largest error of torque and pin forces"
    figure.supylabel(errors, fontsize=9, color=INK)
    return figure


def _list_effects_of(problem: JsonObject) -> set[str]:
    """List what a problem asks of an engine, in the words of hello's `effects`."""
    scene = problem["scene"]
    needs = set(scene.get("effects", {}))
    if scene.get("loads"):
        needs.add("loads")
    if "from" in scene.get("drive", {}):
        needs.add("cylinder")
    if problem["ask"] == "release":
        needs.add("release")
    if any("acts" in spring for spring in scene.get("effects", {}).get("springs", ())):
        needs.add(protocol.ONE_SIDED)
    return needs


def _ask_question(running: Running, question: JsonObject) -> JsonObject:
    """Ask one question; what came of it as entries of a result."""
    positions = len(question.get("times", question["command"].get("theta_2", [])))
    began = time.perf_counter()
    try:
        reply = running.ask_again(question, positions)
    except EngineError as error:
        reply = {"error": str(error)}
    spent = {"asked_for": time.perf_counter() - began}
    if "answers" in reply or "slopes" in reply:
        kept = ("answers", "at", "setting", "evidence", "shared", "seconds", "slopes")
        return {key: reply[key] for key in kept if key in reply} | spent
    word, text = "broke down", reply.get("error", "")
    if "refusal" in reply:
        word, text = "refused", reply["refusal"]
    return {"reason": f"{word}: {write_one_line(str(text))}", **spent}


def compare_slopes(
    problem: JsonObject,
    slopes: Iterable[Any],
) -> list[tuple[str, dict[str, str]]]:
    """Compare derivatives of the torque with those of the formulas.

    The state is the one that the engine took; the errors are relative.
    """
    scene, _ = protocol.command_from_json(
        protocol.scene_from_json(problem["scene"]), problem["command"]
    )
    compared = []
    try:
        for way in slopes:
            errors = {}
            if "by" in way:
                moves = [float(way[str(key)]) for key in scene.motion.names]
                motion: Any = zip(
                    ("angle", "speed", "acceleration"), moves, strict=True
                )
                moved = replace(scene, motion=scene.motion.replace(**dict(motion)))
                ours = sensitivity(moved)
                errors = {"torque": _tell_error(way["torque"], ours.value("torque"))}
                for key, theirs in way["by"].items():
                    errors[key] = _tell_error(theirs, ours.of("torque", key))
            compared.append((write_one_line(str(way["how"])), errors))
    except (AttributeError, KeyError, TypeError, ValueError, FourBarError) as error:
        compared.append((f"no derivatives that can be read: {say_error(error)}", {}))
    return compared


def _tell_error(theirs: float, ours: Any) -> str:
    """Write the relative error of a number."""
    if theirs == 0.0:
        return "zero"
    return f"{abs(theirs / float(np.ravel(ours)[0]) - 1.0):.1e}"


def _find_order(runs: list[BenchmarkRun]) -> float | None:
    """Return the order in the timestep of the torque's error, from the last two runs.

    None: fewer than two runs with a positive error and different timesteps.
    """
    points = []
    for run in runs[-2:]:
        errors = {quantity: float(error) for quantity, error, _ in run.numbers}
        steps = re.search(r"(\d+)/rev$", run.setting)
        if steps is not None and 0.0 < errors.get("torque", 0.0) < math.inf:
            points.append((float(steps[1]), errors["torque"]))
    if len({steps for steps, _ in points}) < 2:
        return None
    (coarse, before), (fine, after) = points
    return math.log(before / after) / math.log(fine / coarse)


@click.command()
@click.option(
    "--engines",
    type=click.Path(path_type=Path),
    default=BENCHMARKED_ENGINES,
    help="A file like engines.toml, whose engines alone are asked.",
)
@click.option(
    "--problem",
    "problems",
    multiple=True,
    metavar="NAME",
    help="These alone (repeat).",
)
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path),
    default=Path("results/benchmark"),
    show_default=True,
)
@click.option(
    "--time-limit",
    default=600.0,
    show_default=True,
    help="Seconds for each question.",
)
def benchmark_command(
    engines: Path,
    problems: tuple[str, ...],
    out: Path,
    time_limit: float,
) -> None:
    """Ask every engine every problem of models/problems.

    Each engine runs in an environment that pip makes once. An engine that runs through
    time is asked at each of its numbers of steps. What was answered before is not asked
    again. The results are written to benchmark.csv and one page.
    """
    find_checkout("benchmark")
    known = list_problems()
    for name in problems:
        if name not in known:
            allowed = f"must be one of {', '.join(known)}"
            raise InputError("--problem", name, allowed)
    entries = read_engines_of(engines)
    out.mkdir(parents=True, exist_ok=True)
    benchmark = Benchmark(
        entries.values(),
        read_reasons(engines),
        problems or known,
        out,
    )
    benchmark.run(time_limit)
    benchmark.write()
    click.echo(
        f"wrote {out}/benchmark.csv, .html: {len(benchmark.rows)} engines,"
        f" {len(benchmark.problems)} problems"
    )
