"""Writes docs/cost/*.svg, light and dark.

`python docs/cost.py results/cost/crank_rocker` runs it. The argument is the folder of a
study, by `fourbar-validation cost models/crank_rocker.toml`.
"""

import csv
import re
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from fourbar.quantities import PIN_FORCES, Array
from fourbar.scene import command
from fourbar.show.plot.style import apply_style
from fourbar.solving import solve
from fourbar_validation.compare.tolerance import EPS, K, find_condition
from fourbar_validation.cost.charts import (
    GRID,
    INK,
    PAPER,
    TEXT,
    make_figure,
    set_axes,
)
from fourbar_validation.cost.work_precision import PINOCCHIO
from fourbar_validation.engines.registry import HARD_ENGINES
from fourbar_validation.report.hard_picture import list_approaches, list_errors
from fourbar_validation.report.svg import LIGHT_COLOURS, choose_style, write_alone

DOCS = Path(__file__).parent
TARGET = DOCS / "cost"
PAGE = DOCS / "cost.md"
STUDIED = (
    "work-precision-torque",
    "work-precision-force",
    "timestep",
    "integrator",
    "softness",
    "solver",
)
"""Pictures of the study that the page shows."""
SHOWN = "torque"
"""Quantity whose error is drawn over the condition."""
NO_DIGITS = K * EPS
"""Condition at which the limit allows any number."""


def list_hard_points() -> Iterator[tuple[Array, Array, str]]:
    """Yield condition and error of each exact engine near singular positions.

    There are three kinds of them.
    """
    for scene in list_approaches():
        solution = solve(scene, "force")
        condition = find_condition(SHOWN, scene.linkage, solution)
        commanded = command(scene).theta_2
        order = np.argsort(commanded)
        for engine in HARD_ENGINES:
            if engine.through_time:
                continue
            curve = list_errors(scene, SHOWN, engine)
            if curve is not None:
                rows = order[np.searchsorted(commanded, curve[0], sorter=order)]
                yield condition[rows], curve[1], engine.name


def draw_hard() -> Any:
    """Draw the error of exact engines over the condition, near three singularities."""
    figure = make_figure(
        4.6,
        "Near a singular position the error grows as\n1/condition, and stays below the"
        " limit",
        "torque, towards a toggle, a pole of T4 and a change point",
    )
    axes = figure.add_axes((0.135, 0.12, 0.84, 0.6))
    seen: set[str] = set()
    for condition, error, engine in list_hard_points():
        style = {**choose_style(engine).line, "ls": "none"}
        label = None if engine in seen else engine
        axes.plot(condition, error, label=label, **style)
        seen.add(engine)
    ends = np.array([NO_DIGITS, 1.0])
    axes.plot(ends, K * EPS / ends, color=INK, lw=1.5, label="limit K eps/condition")
    axes.set_xlabel("condition (1 is best)")
    axes.set_ylabel("error of the torque, of its own size")
    set_axes(axes)
    axes.set_xlim(0.3 * NO_DIGITS, 2.0)
    axes.set_ylim(1e-18, 10.0)
    return figure


def read_effects() -> dict[str, float]:
    """Read from the page what each effect adds to a step of MuJoCo, in parts of it."""
    table = (
        PAGE.read_text(encoding="utf-8").partition("|effect|")[2].partition("\n\n")[0]
    )
    effects = {}
    for line in table.splitlines()[2:]:
        name, _, simulated, *_ = (cell.strip() for cell in line.strip("|").split("|"))
        found = re.fullmatch(r"\+?(\d+) ?%?", simulated)
        if found and name != "none":
            effects[name] = float(found.group(1))
    return effects


def draw_effects() -> Any:
    """Draw what each effect adds to the time of a step of MuJoCo."""
    effects = read_effects()
    figure = make_figure(
        3.4,
        "Dry friction costs most: what each effect\nadds to a step of MuJoCo",
        "median over neighbouring runs, against a scene without effects",
    )
    axes = figure.add_axes((0.24, 0.14, 0.7, 0.58))
    names = sorted(effects, key=effects.__getitem__)
    bars = axes.barh(
        names,
        [effects[name] for name in names],
        color=LIGHT_COLOURS["--e1"],
    )
    axes.bar_label(bars, fmt="%.0f %%", fontsize=TEXT, color=INK, padding=3)
    axes.set_facecolor(figure.get_facecolor())
    axes.tick_params(labelsize=TEXT, color=GRID, labelcolor=INK)
    axes.spines[:].set_color(GRID)
    axes.set_xlabel("processor time of an RK4 step, %", fontsize=TEXT, color=INK)
    axes.margins(x=0.12)
    axes.grid(visible=False)
    return figure


def make_small(statement: str) -> tuple[Any, Any]:
    """Make a small figure, three of which stand side by side."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(3.0, 2.6), facecolor=PAPER)
    figure.text(0.03, 0.97, statement, fontsize=8.5, weight="bold", color=INK, va="top")
    axes = figure.add_axes((0.2, 0.17, 0.77, 0.63))
    return figure, axes


def set_small(axes: Any, xlabel: str, ylabel: str = "") -> None:
    """Give small axes grid, texts and names."""
    axes.set_facecolor(PAPER)
    axes.grid(visible=True, which="major", color=GRID, lw=0.5)
    axes.set_axisbelow(True)
    axes.tick_params(which="both", labelsize=7.5, color=GRID, labelcolor=INK)
    axes.spines[:].set_color(GRID)
    axes.set_xlabel(xlabel, fontsize=7.5, color=INK, labelpad=1.0)
    axes.set_ylabel(ylabel, fontsize=7.5, color=INK, labelpad=0.0)


def read_points(study: Path, curve: str) -> list[tuple[float, float, str]]:
    """Read the points of a curve.

    Each is ms of a simulated second, error of the worst pin force, and setting.
    """
    with (study / "cost.csv").open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["curve"] == curve]
    return [
        (
            1e3 * float(row["seconds_per_second"]),
            max(float(row[name]) for name in PIN_FORCES),
            row["setting"],
        )
        for row in rows
    ]


def draw_small_accuracy(study: Path) -> Any:
    """Draw the advised settings, MuJoCo's defaults and the formulas."""
    figure, axes = make_small("Time for digits of a pin force")
    for curve, name, look in (
        ("Euler, MuJoCo's defaults", "MuJoCo's defaults", ("--e3", "s")),
        ("recommended", "MuJoCo, advised", ("--e1", "o")),
    ):
        points = [point for point in read_points(study, curve) if point[1] < 1.0]
        x, y, _ = zip(*points, strict=True)
        colour, marker = LIGHT_COLOURS[look[0]], look[1]
        axes.loglog(x, y, color=colour, marker=marker, ms=3.5, lw=1.2)
        beside = len(x) // 2
        axes.annotate(
            name,
            (x[beside], y[beside]),
            xytext=(-5, -9) if curve == "recommended" else (0, 6),
            textcoords="offset points",
            ha="right" if curve == "recommended" else "left",
            fontsize=7.5,
            color=colour,
        )
    for curve, wanted, name in (
        ("formulas", "formulas, double", "formulas"),
        ("inverse", PINOCCHIO, "Pinocchio"),
    ):
        for x, y, setting in read_points(study, curve):
            if setting == wanted:
                axes.plot(x, y, marker="*", ms=8, color=INK)
                axes.annotate(
                    name,
                    (x, y),
                    xytext=(0, 6),
                    textcoords="offset points",
                    ha="center",
                    fontsize=7.5,
                    color=INK,
                )
    low, high = axes.get_xlim()
    axes.set_xlim(low, 2.0 * high)
    axes.set_ylim(1e-17, 3.0)
    set_small(axes, "ms of a simulated second", "error")
    return figure


def draw_small_effects() -> Any:
    """Draw what each effect adds to a step."""
    effects = read_effects()
    figure, axes = make_small("What effects add to a step")
    names = sorted(effects, key=effects.__getitem__)
    bars = axes.barh(
        names,
        [effects[name] for name in names],
        color=LIGHT_COLOURS["--e1"],
    )
    axes.bar_label(bars, fmt="%.0f", fontsize=7.5, color=INK, padding=2)
    axes.margins(x=0.12)
    set_small(axes, "processor time of an RK4 step, %")
    return figure


def draw_small_hard() -> Any:
    """Draw the error of one exact engine over the condition, with the limit."""
    figure, axes = make_small("Error near singular positions")
    for condition, error, engine in list_hard_points():
        if engine == "pinocchio-inverse":
            axes.plot(
                condition,
                error,
                ls="none",
                marker="o",
                ms=3,
                color=LIGHT_COLOURS["--e1"],
            )
    ends = np.array([NO_DIGITS, 1.0])
    axes.loglog(ends, K * EPS / ends, color=INK, lw=1.2)
    axes.annotate("limit", (1e-6, 3e-8), fontsize=7.5, color=INK)
    axes.set_xlim(0.3 * NO_DIGITS, 2.0)
    axes.set_ylim(1e-18, 10.0)
    set_small(axes, "condition (1 is best)", "error of the torque")
    return figure


def main(study: Path) -> None:
    """Copy the pictures of a study, and draw the others."""
    TARGET.mkdir(exist_ok=True)
    for name in STUDIED:
        shutil.copyfile(study / f"{name}.svg", TARGET / f"{name}.svg")
    drawings: dict[str, Callable[[], Any]] = {
        "hard": draw_hard,
        "effects": draw_effects,
        "small-accuracy": lambda: draw_small_accuracy(study),
        "small-effects": draw_small_effects,
        "small-hard": draw_small_hard,
    }
    with apply_style():
        for name, draw in drawings.items():
            (TARGET / f"{name}.svg").write_text(
                write_alone(draw(), name),
                encoding="utf-8",
            )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
