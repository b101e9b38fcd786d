"""The page of a history: verdicts, errors and times over the runs, and the steps at which they changed."""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from datetime import datetime
from statistics import fmean, stdev
from typing import TYPE_CHECKING

from fourbar_validation.compare.rows import AGREES, DEGRADED, FAILS, FORMULAS, REFUSES, VERDICTS
from fourbar_validation.compare.tolerance import find_used
from fourbar_validation.regression.change import Key
from fourbar_validation.regression.history import HistoryRun
from fourbar_validation.regression.render import write_line
from fourbar_validation.regression.steps import Step
from fourbar_validation.report.colours import ALLOWED, GRID, INK, SOFT, choose_style
from fourbar_validation.report.svg import FLOOR, set_frame, write_svg
from fourbar_validation.report.templating import render

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = {AGREES: "#00845f", DEGRADED: "#0072b2", FAILS: "#c74f00", REFUSES: SOFT}
"""By verdict; another one is drawn as a refusal."""
HATCHES = {FAILS: "////", DEGRADED: "...."}
"""So that the verdicts stand apart in grey too."""
SIZE = (4.3, 2.7)
"""Inches; the page scales a picture to its column."""
ROWS_DRAWN, ROWS_LISTED = 12, 200
"""Changed rows with a picture of their own, and listed at one step."""
TIMED = "Time over the formulas', as a ratio to the first run's: mean over the scenes, and its scatter"
LABELS = 6
"""Runs named on an axis."""


def write_page(runs: Sequence[HistoryRun], found: Sequence[Step]) -> str:
    """Make the page, complete in one file."""
    changed = list(dict.fromkeys(change.key for step in reversed(found) for change in step.changes if change.new))
    pictures = [
        ("Verdicts of each run", _draw_verdicts(runs)),
        ("Worst error over what is allowed", _draw_errors(runs)),
    ]
    if any(run.times for run in runs):
        pictures.append((TIMED, _draw_times(runs)))
    rows = [(" / ".join(part for part in key if part), _draw_row(runs, key)) for key in changed[:ROWS_DRAWN]]
    listed = [(step, [(c.kind.value, write_line(c)) for c in step.changes[:ROWS_LISTED]]) for step in reversed(found)]
    verdicts = [verdict for verdict in VERDICTS if any(_list_counts(run)[verdict] for run in runs)]
    return render(
        "fourbar_validation.regression",
        "history.html.j2",
        runs=[
            (
                run.name,
                *(_list_counts(run)[verdict] for verdict in verdicts),
                ", ".join(f"{name} {version}" for name, version in run.about.versions.items()),
                run.about.machine,
            )
            for run in reversed(runs)
        ],
        headings=("date, commit", *verdicts, "versions", "machine"),
        steps=listed,
        pictures=pictures,
        rows=rows,
        more=len(changed) - len(rows),
        listed=ROWS_LISTED,
    )


def _list_counts(run: HistoryRun) -> Counter[str]:
    return Counter(row.verdict for row in run.rows)


def _draw_figure(draw: "Callable[[Axes], None]", runs: Sequence[HistoryRun], salt: str) -> str:
    """Draw over the runs, with their names and a legend."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=SIZE, layout="constrained")
    axes = figure.add_subplot()
    draw(axes)
    figure.legend(loc="outside lower center", ncols=3, fontsize=6.5, frameon=False)
    set_frame(axes)
    _name_runs(axes, runs)
    return write_svg(figure, salt)


def _name_runs(axes: "Axes", runs: Sequence[HistoryRun]) -> None:
    """Dates and commits under some of the runs, and a line where the version of a library changed."""
    every = max(1, math.ceil(len(runs) / LABELS))
    shown = range(len(runs) - 1, -1, -every)
    labels = [f"{_write_day(runs[i].about.date)}\n{runs[i].about.commit[:7]}" for i in shown]
    axes.set_xticks(list(shown), labels, fontsize=6.5)
    axes.set_xlim(-0.6, len(runs) - 0.4)
    for i in range(1, len(runs)):
        before, after = runs[i - 1].about.versions, runs[i].about.versions
        names = [f"{name} {after[name]}" for name in after if before.get(name, after[name]) != after[name]]
        if names:
            axes.axvline(i - 0.5, color=ALLOWED, linestyle=":", linewidth=1.0)
            text = "\n".join(names[:3])
            axes.annotate(text, (i - 0.5, 1.0), (0, 2), xycoords=("data", "axes fraction"), va="bottom", ha="center",
                          textcoords="offset points", fontsize=6.5, color=INK)  # fmt: skip


def _write_day(date: str) -> str:
    try:
        return datetime.fromisoformat(date).strftime("%y-%m-%d")
    except ValueError:
        return "no date"


def _draw_verdicts(runs: Sequence[HistoryRun]) -> str:
    def draw(axes: "Axes") -> None:
        below = [0] * len(runs)
        for verdict in VERDICTS:
            counts = [_list_counts(run)[verdict] for run in runs]
            if not any(counts):
                continue
            axes.bar(range(len(runs)), counts, bottom=below, color=COLOURS.get(verdict, SOFT), label=verdict,
                     hatch=HATCHES.get(verdict), edgecolor=GRID, linewidth=0.3)  # fmt: skip
            below = [base + count for base, count in zip(below, counts, strict=True)]
        axes.set_ylabel("rows")

    return _draw_figure(draw, runs, "verdicts")


def _list_engines(runs: Sequence[HistoryRun]) -> list[str]:
    return list(dict.fromkeys(row.engine for run in runs for row in run.rows if row.compared))


def _draw_errors(runs: Sequence[HistoryRun]) -> str:
    def draw(axes: "Axes") -> None:
        for engine in _list_engines(runs):
            judged = [[row for row in run.rows if row.engine == engine and row.compared and math.isfinite(row.error)]
                      for run in runs]  # fmt: skip
            shares = [[max(float(find_used(row.error, row.allowed)), FLOOR) for row in rows] for rows in judged]
            worst = [max(each, default=math.nan) for each in shares]
            axes.plot(range(len(runs)), worst, label=engine, **choose_style(engine).line)
        axes.set_yscale("log")
        axes.axhline(1.0, color=ALLOWED, linewidth=1.0, linestyle="--")
        axes.set_ylabel("error / allowed")

    return _draw_figure(draw, runs, "errors")


def _draw_times(runs: Sequence[HistoryRun]) -> str:
    """Each engine's times over those of the first run that has the scene: their mean and its standard error."""
    first: dict[tuple[str, str], float] = {}
    for run in runs:
        first = {**run.times, **first}
    engines = list(dict.fromkeys(engine for _, engine in first if engine != FORMULAS))

    def draw(axes: "Axes") -> None:
        for engine in engines:
            logs = [[math.log(t / first[key]) for key, t in run.times.items() if key[1] == engine and t > 0.0]
                    for run in runs]  # fmt: skip
            where = [i for i, each in enumerate(logs) if each]
            means = [math.exp(fmean(logs[i])) for i in where]
            spread = [math.exp(stdev(logs[i]) / math.sqrt(len(logs[i]))) if len(logs[i]) > 1 else 1.0 for i in where]
            bars = [[m - m / s for m, s in zip(means, spread, strict=True)],
                    [m * s - m for m, s in zip(means, spread, strict=True)]]  # fmt: skip
            axes.errorbar(where, means, yerr=bars, capsize=2.0, label=engine, **choose_style(engine).line)
        axes.set_ylim(bottom=0.0)
        axes.set_ylabel("time / first time")

    return _draw_figure(draw, runs, "times")


def _draw_row(runs: Sequence[HistoryRun], key: Key) -> str:
    """Draw the error of one row over the runs, what it is allowed, and a ring where it fails."""

    def draw(axes: "Axes") -> None:
        rows = {i: row for i, run in enumerate(runs) for row in run.rows
                if (row.scene, row.engine, row.setting, row.quantity) == key}  # fmt: skip
        there = [i for i, row in rows.items() if math.isfinite(row.error)]
        axes.plot(there, [max(rows[i].error, FLOOR) for i in there], label="error", **choose_style(key[1]).line)
        axes.plot(there, [max(rows[i].allowed, FLOOR) for i in there], color=ALLOWED, linestyle="--",
                  linewidth=1.0, label="allowed")  # fmt: skip
        failed = [i for i in there if rows[i].failed]
        axes.plot(failed, [max(rows[i].error, FLOOR) for i in failed], "o", markersize=9.0, fillstyle="none",
                  color=COLOURS[FAILS], label="fails")  # fmt: skip
        axes.set_yscale("log")
        axes.set_ylabel("error")

    return _draw_figure(draw, runs, "row" + "/".join(key))
