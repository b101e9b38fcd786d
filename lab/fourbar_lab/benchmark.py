"""`python -m fourbar_lab benchmark`: every engine is asked every problem; one table, one page with a letter a cell."""

import json
import shlex
import time
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import click

from fourbar.errors import DependencyError, InputError
from fourbar.writing import write_text
from fourbar_lab.simulators.problems import PROBLEMS, list_problems
from fourbar_validation.check.problem import MISSING, RESULT, find_levels, judge, read_problem
from fourbar_validation.compare.answer import EngineError
from fourbar_validation.compare.rows import write_csv, write_one_line
from fourbar_validation.engines.environments import FILE, Entry, prepare_program, read_engines, read_engines_of
from fourbar_validation.engines.guests import HELLO, Running
from fourbar_validation.places import find_checkout
from fourbar_validation.report.machine import name_machine
from fourbar_validation.report.templating import render

ENGINES = Path(__file__).parent / FILE
REFUSED = "R"
COLUMNS = ("problem", "engine", "version", "setting", "quantity", "error", "level", "seconds", "reason")


class Outcome(NamedTuple):
    """Result of one engine on one problem."""

    letters: str
    """Reactions and torque; of a released motion reactions and motion."""
    numbers: list[tuple[str, str, str]]
    """Quantity, error, level."""
    reason: str
    setting: str
    seconds: float
    script: str
    folder: str
    """Folder of its result files."""


def read_reasons(files: Iterable[Path]) -> dict[str, str]:
    """Read why an engine's letters are not A, by its name."""
    reasons: dict[str, str] = {}
    for file in files:
        if file.is_file():
            reasons = {**tomllib.loads(file.read_text(encoding="utf-8")).get("because", {}), **reasons}
    return reasons


class Benchmark:
    """A run over engines and problems; what an earlier one wrote for the same version is not asked again."""

    def __init__(
        self, engines: Iterable[Entry], reasons: Mapping[str, str], problems: Iterable[str], out: Path
    ) -> None:
        self.engines, self.reasons, self.out = list(engines), reasons, out
        self.problems = {name: read_problem(PROBLEMS / f"{name}.json") for name in problems}
        self.outcomes: dict[str, dict[str, Outcome]] = {}
        """Outcomes by engine and problem."""
        self.versions: dict[str, str] = {}
        self.rows: list[list[Any]] = []

    def run(self, seconds: float) -> None:
        """Ask every engine every problem, each question within its limit of time."""
        for engine in self.engines:
            try:
                running = Running(prepare_program(engine, seconds))
            except (DependencyError, InputError) as error:
                self._leave_out(engine, str(error))
                continue
            try:
                self._ask_engine(engine, running)
            finally:
                running.end()

    def _leave_out(self, engine: Entry, reason: str) -> None:
        for problem in self.problems:
            self._add(engine, "", problem, None, f"not run: {reason}")

    def _ask_engine(self, engine: Entry, running: Running) -> None:
        try:
            hello = running.ask_again(HELLO, 0)
        except EngineError as error:
            self._leave_out(engine, str(error))
            return
        version = write_one_line(str(hello.get("version", "")))
        for name, problem in self.problems.items():
            lacking = sorted(_list_needs(problem) - set(hello.get("effects", [])))
            if problem["mechanism"] not in hello.get("mechanisms", ["four-bar"]):
                lacking = [problem["mechanism"]]
            if lacking:
                self._add(engine, version, name, None, f"refused: it does not take {', '.join(lacking)}")
                continue
            file = self.out / "results" / engine.name / f"{name}.json"
            result = _read_earlier(file, version)
            if result is None:
                result = {"schema": RESULT, "problem": name, "engine": engine.name, "version": version}
                result |= _ask_problem(running, problem)
                file.parent.mkdir(parents=True, exist_ok=True)
                write_text(file, json.dumps(result))
            self._add(engine, version, name, result, result.get("reason", ""))

    def _add(self, engine: Entry, version: str, name: str, result: dict[str, Any] | None, reason: str) -> None:
        """Judge one result."""
        setting, numbers, letters = "", list[tuple[str, str, str]](), MISSING
        seconds = 0.0 if result is None else float(result["seconds"])
        if result is not None and "answers" in result:
            setting = str(result.get("setting", "exact"))
            try:
                judged = judge(self.problems[name], result)
            except InputError as error:
                judged, reason = [], f"no answer that can be judged: {error}"
            levels = find_levels(judged)
            other = "torque" if "torque" in levels else "motion"
            letters = levels.get("reactions", MISSING) + levels.get(other, MISSING) if levels else MISSING
            numbers = [(row.quantity, f"{row.error:.1e}", row.level) for row in judged]
            reason = reason or ("" if set(letters) == {"A"} else self.reasons.get(engine.name, ""))
        elif reason.startswith("refused"):
            letters = REFUSED
        self.versions[engine.name] = version
        script = engine.adapter or shlex.join(engine.command)
        self.outcomes.setdefault(engine.name, {})[name] = Outcome(
            letters, numbers, reason, setting, seconds, script, engine.name
        )
        quantities = [(*row, reason if row[2] != "A" else "") for row in numbers] or [("all", "", letters, reason)]
        for quantity, size, level, why in quantities:
            self.rows.append([name, engine.name, version, setting, quantity, size, level, f"{seconds:.3g}", why])

    def _label(self, name: str) -> str:
        """Name an engine with its version."""
        version = self.versions[name]
        return name if version in name else f"{name} {version}"

    def write(self) -> None:
        """Write the table and the page."""
        cells = {self._label(name): list(row.items()) for name, row in self.outcomes.items()}
        requires = [", ".join(engine.requires) for engine in self.engines]
        write_text(self.out / "benchmark.csv", write_csv(COLUMNS, sorted(self.rows)))
        page = {"machine": name_machine(), "problems": self.problems, "cells": cells,
                "requires": dict(zip(cells, requires, strict=True))}  # fmt: skip
        for ending in ("html", "md"):
            write_text(self.out / f"benchmark.{ending}", render("fourbar_lab", f"benchmark.{ending}.j2", **page))


def _list_needs(problem: dict[str, Any]) -> set[str]:
    """List what a problem asks of an engine, in the words of hello's `effects`."""
    scene = problem["scene"]
    needs = {*scene.get("effects", {}), *(["loads"] if scene.get("loads") else [])}
    needs |= {"cylinder"} if "from" in scene.get("drive", {}) else set()
    return needs | ({"release"} if problem["ask"] == "release" else set())


def _read_earlier(file: Path, version: str) -> dict[str, Any] | None:
    """Return what an earlier run was answered, unless by another version or not at all."""
    if not file.is_file():
        return None
    result: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return result if result.get("version") == version and ("answers" in result or "reason" in result) else None


def _ask_problem(running: Running, problem: dict[str, Any]) -> dict[str, Any]:
    """Ask one problem; what came of it as entries of a result."""
    question: dict[str, Any] = {key: problem[key] for key in ("ask", "scene", "command", "times") if key in problem}
    positions = len(problem.get("times", problem["command"].get("theta_2", [])))
    began = time.perf_counter()
    try:
        reply = running.ask_again(question, positions)
    except EngineError as error:
        reply = {"error": str(error)}
    spent = {"seconds": time.perf_counter() - began}
    if "answers" in reply:
        return {key: reply[key] for key in ("answers", "at", "setting") if key in reply} | spent
    word, text = ("refused", reply["refusal"]) if "refusal" in reply else ("broke down", reply.get("error", ""))
    return {"reason": f"{word}: {write_one_line(str(text))}", **spent}


@click.command()
@click.option(
    "--engines", type=click.Path(path_type=Path), help="A file like engines.toml, whose engines alone are asked."
)
@click.option("--problem", "problems", multiple=True, metavar="NAME", help="These alone (repeat).")
@click.option("-o", "--out", type=click.Path(path_type=Path), default=Path("results/benchmark"), show_default=True)
@click.option("--time-limit", default=600.0, show_default=True, help="Seconds for each question.")
def command(engines: Path | None, problems: tuple[str, ...], out: Path, time_limit: float) -> None:
    """Ask every engine every problem of models/problems, and write benchmark.csv and one page.

    Each engine runs in its environment, which pip makes once. What was answered before is not asked again.
    """
    find_checkout("benchmark")
    for name in problems:
        if name not in list_problems():
            raise InputError("--problem", name, f"must be one of {', '.join(list_problems())}")
    entries = read_engines([ENGINES.parent]) if engines is None else read_engines_of(engines)
    out.mkdir(parents=True, exist_ok=True)
    made = Benchmark(entries.values(), read_reasons([engines or ENGINES]), problems or list_problems(), out)
    made.run(time_limit)
    made.write()
    click.echo(f"wrote {out}/benchmark.csv, .html, .md: {len(made.outcomes)} engines, {len(made.problems)} problems")
