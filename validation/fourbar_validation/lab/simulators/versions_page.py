"""The pages of the versions of an engine: where something changed, a table, a chart; Markdown, CSV, JSON and SVG."""

import json
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from fourbar_validation.compare.rows import FAILS, REFUSES, write_csv
from fourbar_validation.lab.simulators.examine import TORQUE_AND_FORCES
from fourbar_validation.lab.simulators.releases import Release
from fourbar_validation.regression.change import Change, Kind
from fourbar_validation.regression.render import write_line
from fourbar_validation.regression.steps import NO_CHANGE, Step, find_steps
from fourbar_validation.report.colours import choose_style
from fourbar_validation.report.machine import name_machine
from fourbar_validation.report.svg import draw_svg
from fourbar_validation.report.templating import render, write_number

SCHEMA = "fourbar-versions/1"
CLOCK = "cpu_s_a_position"


def describe_changed(found: Sequence[Release]) -> list[str]:
    """Describe each version at which something changed: from which on, what, and the row that moved most."""
    ran = [release for release in found if release.run is not None]
    sentences = []
    for step in find_steps([release.run for release in ran if release.run is not None]):
        if not step.changes:  # times alone, which the table has
            continue
        counts = [f"{len(step.found.of(kind))} {kind.value}" for kind in Kind
                  if kind not in NO_CHANGE and step.found.of(kind)]  # fmt: skip
        where = f"{ran[step.number - 1].version} -> {ran[step.number].version}"
        most = write_line(max(step.changes, key=_measure_moved))
        sentences.append(f"{where}: {', '.join(counts)}{_name_with(step)}. Most: {most}")
    return sentences


def _measure_moved(change: Change) -> float:
    """Measure by how many powers of e an error moved; what came or went, last."""
    if change.old is None or change.new is None or not (change.old.error and change.new.error):
        return 0.0
    moved = abs(math.log(change.new.error / change.old.error))
    return 0.0 if math.isnan(moved) else moved


def _name_with(step: Step) -> str:
    others = [f"{what} {old} -> {new}" for what, old, new in step.found.surroundings if what in ("numpy", "scipy")]
    return f" (with {', '.join(others)})" if others else ""


def list_lines(found: Sequence[Release]) -> list[dict[str, Any]]:
    """List greatest errors, verdicts and time of each version and witness, or why it has none."""
    made: list[dict[str, Any]] = []
    for release in found:
        if release.run is None:
            made.append({"version": release.version, "engine": None, "why": release.why})
            continue
        run = release.run
        for engine in dict.fromkeys(row.engine for row in run.rows):
            rows = [row for row in run.rows if row.engine == engine]
            errors: dict[str, float | None] = {}
            for name in TORQUE_AND_FORCES:
                of = [row.error for row in rows if row.quantity == name and row.compared]
                errors[name] = float(np.max(of)) if of else None  # NaN where one is
            counted = {"compared": sum(row.compared for row in rows)}
            counted |= {verdict: sum(row.verdict == verdict for row in rows) for verdict in (FAILS, REFUSES)}
            times = {CLOCK: release.seconds.get(engine)}
            made.append({"version": release.version, "engine": engine, "why": "", **errors, **counted, **times})
    return made


COLUMNS = ("version", "engine", *TORQUE_AND_FORCES, "compared", FAILS, REFUSES, CLOCK, "why")


def write_files(engine: str, found: Sequence[Release], left: int, more: Sequence[str] = ()) -> dict[str, str]:
    """Write the text of each file, by its name."""
    rows, sentences = list_lines(found), describe_changed(found)
    table = write_csv(COLUMNS, ([row.get(name) for name in COLUMNS] for row in rows))
    about = next(release.run.about for release in found if release.run is not None)
    plain = [{key: None if isinstance(x, float) and math.isnan(x) else x for key, x in row.items()} for row in rows]
    kept = {"schema": SCHEMA, "engine": engine, "machine": name_machine(), "changed": sentences, "versions": plain}
    shown = [[_write_cell(name, row.get(name)) for name in COLUMNS] for row in rows]
    made: dict[str, Any] = {
        "machine": name_machine(),
        "python": about.versions.get("python", ""),
        "left": left,
        "more": more,
    }
    made |= {"engine": engine, "rows": shown, "columns": COLUMNS, "changed": sentences}
    page = render("fourbar_validation.lab.simulators", "versions.md.j2", **made)
    texts = {"csv": table, "json": json.dumps(kept, indent=1) + "\n", "md": page, "svg": draw_chart(rows)}
    return {f"versions.{ending}": text for ending, text in texts.items()}


def _write_cell(name: str, value: Any) -> str:
    if value is None:
        return ""
    if name == CLOCK:
        return f"{value:.2e}"
    return write_number(value) if isinstance(value, float) else str(value)


def draw_chart(rows: Sequence[dict[str, Any]]) -> str:
    """Draw the greatest error of the torque and of the pin forces, and the time, by version, as SVG."""
    from matplotlib.figure import Figure

    versions = list(dict.fromkeys(row["version"] for row in rows))
    figure = Figure(figsize=(7.5, 5.0), layout="constrained")
    errors, times = figure.subplots(2, 1, sharex=True)
    for engine in dict.fromkeys(row["engine"] for row in rows if row["engine"]):
        own = [row for row in rows if row["engine"] == engine]
        at, look = [versions.index(row["version"]) for row in own], choose_style(engine).line
        forces = [max((row[name] or 0.0 for name in TORQUE_AND_FORCES[1:]), default=0.0) or math.nan for row in own]
        errors.plot(at, [row["torque"] or math.nan for row in own], label=f"{engine}: torque", **look)
        errors.plot(at, forces, linestyle="--", label=f"{engine}: pin forces", fillstyle="none", **look)
        times.plot(at, [1e3 * (row[CLOCK] or math.nan) for row in own], label=engine, **look)
    label: str | None = "did not install or load"
    for row in rows:
        if row["engine"] is None:
            errors.axvline(versions.index(row["version"]), color="#c74f00", linestyle=":", linewidth=1, label=label)
            label = None
    errors.set_yscale("log")
    errors.set_ylabel("greatest relative error")
    times.set_ylim(bottom=0.0)
    times.set_ylabel("CPU time per position (ms)")
    times.set_xticks(range(len(versions)), versions, rotation=45, ha="right", fontsize=7)
    for axes in (errors, times):
        axes.grid(alpha=0.3)
    errors.legend(fontsize=7, frameon=False)
    return draw_svg(figure, "versions")
