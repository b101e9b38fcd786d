"""Writes docs/cost/*.svg, light and dark: `python docs/cost.py results/cost/crank_rocker`.

The argument is the folder of a study, by `fourbar-validation cost models/crank_rocker.toml`.
"""

import re
import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np

from fourbar.scene import command
from fourbar.show.plot.style import apply_style
from fourbar.solve import solve
from fourbar_validation.compare.tolerance import EPS, K, find_condition
from fourbar_validation.cost.pictures import GRID, INK, TEXT, make_figure, set_axes
from fourbar_validation.engines.registry import HARD_ENGINES
from fourbar_validation.report.hard_picture import list_approaches, list_errors
from fourbar_validation.report.svg import LIGHT, choose_style, write_alone

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


def draw_hard() -> Any:
    """Draw the error of the exact engines over the condition, towards three kinds of singular position."""
    figure = make_figure(
        4.6,
        "Near a singular position the error grows as\n1/condition, and stays below the limit",
        "torque, towards a toggle, a pole of T4 and a change point",
    )
    axes = figure.add_axes((0.135, 0.12, 0.84, 0.6))
    seen: set[str] = set()
    for approach in list_approaches():
        solution = solve(approach.scene, "force")
        condition = find_condition(SHOWN, approach.scene.linkage, solution)
        commanded = command(approach.scene).theta_2
        for engine in HARD_ENGINES:
            if engine.through_time:
                continue
            curve = list_errors(approach.scene, SHOWN, engine)
            if curve is None:
                continue
            rows = np.searchsorted(commanded, curve[0])
            if commanded[0] > commanded[-1]:
                rows = len(commanded) - 1 - np.searchsorted(commanded[::-1], curve[0])
            style = {**choose_style(engine.name).line, "ls": "none"}
            label = None if engine.name in seen else engine.name
            axes.plot(condition[rows], curve[1], label=label, **style)
            seen.add(engine.name)
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
        "processor time of an RK4 step, %",
    )
    axes = figure.add_axes((0.24, 0.1, 0.7, 0.62))
    names = sorted(effects, key=effects.__getitem__)
    bars = axes.barh(names, [effects[name] for name in names], color=LIGHT["--e1"])
    axes.bar_label(bars, fmt="%.0f %%", fontsize=TEXT, color=INK, padding=3)
    axes.set_facecolor(figure.get_facecolor())
    axes.tick_params(labelsize=TEXT, color=GRID, labelcolor=INK)
    axes.spines[:].set_color(GRID)
    axes.margins(x=0.12)
    axes.grid(visible=False)
    return figure


def main(study: Path) -> None:
    """Copy the pictures of a study, and draw the others."""
    TARGET.mkdir(exist_ok=True)
    for name in STUDIED:
        shutil.copyfile(study / f"{name}.svg", TARGET / f"{name}.svg")
    with apply_style():
        for name, draw in (("hard", draw_hard), ("effects", draw_effects)):
            (TARGET / f"{name}.svg").write_text(
                write_alone(draw(), name), encoding="utf-8"
            )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
