"""`python -m validation standing`: what simulators say of one closed loop, on one page."""

import ast
import sys
from pathlib import Path
from typing import Any

import click

import fourbar
from fourbar.errors import InputError
from fourbar.writing import write_text
from fourbar_validation.compare.rows import csv_text
from fourbar_validation.lab.subjects.examine import TORQUE_AND_FORCES, Examination, Line, examine
from fourbar_validation.places import CHECKOUT, MODELS
from fourbar_validation.report.machine import machine
from fourbar_validation.report.svg import drawn, inline
from fourbar_validation.report.templating import rendered

PROBLEM = MODELS / "problems" / "crank_rocker.toml"
FINDINGS = None if CHECKOUT is None else CHECKOUT / "docs" / "findings"
HEAD = ("simulator", "version", "setting", "of", *TORQUE_AND_FORCES, "gap at B", "CPU s per s", "order")
EXPLAINED = (
    "Torque and pin forces: the largest error, divided by the largest value in a turn. The simulator is compared with "
    "the formulas at the angle, speed and acceleration that it had itself. 'states': single states; 'N steps': a turn "
    "at constant speed, without its first quarter. Empty: the simulator does not report it. Gap at B: the largest "
    "distance between the ends of bars 3 and 4, divided by the longest bar. Order: the power of the timestep with "
    "which the torque's error fell from the line above to this one. CPU time is without reading results and without "
    "compilation. This is no ranking: double and single precision, compiled and interpreted loops stand side by side."
)


@click.command()
@click.argument("scene", type=click.Path(path_type=Path), default=PROBLEM)
@click.option(
    "--python", "pythons", type=click.Path(path_type=Path), multiple=True, help="An environment of simulators."
)
@click.option("-o", "--out", type=click.Path(path_type=Path), default=Path("results/standing"), show_default=True)
@click.option("--time-limit", default=600.0, show_default=True, help="Seconds for each simulator.")
def command(scene: Path, pythons: tuple[Path, ...], out: Path, time_limit: float) -> None:
    """Examine every simulator that is installed here or under a --python, and write one page (repeat --python)."""
    for python in pythons:
        if not python.is_file():
            raise InputError("--python", str(python), "must be a Python interpreter, such as .venv-warp/bin/python")
    given = fourbar.load(scene)
    out.mkdir(parents=True, exist_ok=True)
    found = examine(given, scene, [Path(sys.executable), *(path.absolute() for path in pythons)], time_limit)
    if not found.lines:
        raise InputError("--python", ", ".join(map(str, pythons)) or None, "no simulator answered there")
    chart = work_precision(found)
    versions = dict.fromkeys(f"{line.simulator} {line.version}" for line in found.lines)
    page = {
        "title": given.title,
        "made": f"{machine()}; {', '.join(versions)}",
        "explained": EXPLAINED,
        "head": HEAD,
        "rows": [cells(line) for line in found.lines],
        "lists": [(heading, texts) for heading, texts in _lists(found).items() if texts],
        "svg": inline(chart),
    }
    for ending in ("html", "md"):
        write_text(
            out / f"standing.{ending}", rendered("fourbar_validation.lab.subjects", f"standing.{ending}.j2", **page)
        )
    write_text(out / "standing.svg", chart)
    write_text(out / "standing.csv", table(found))
    for name, why in found.left_out.items():
        click.echo(f"not examined: {name}: {why}")
    click.echo(
        f"wrote {out}/standing.html, .md, .csv, .svg: {len(found.lines)} lines of {len(found.changed)} simulators"
    )


def _lists(found: Examination) -> dict[str, list[str]]:
    changed = [f"{name} ({found.devices[name]}): {what}" for name, what in found.changed.items()]
    return {
        "What had to be changed, and what it ran on": changed,
        "Not examined": [f"{name}: {why}" for name, why in found.left_out.items()],
        "Findings, each with a script that reproduces it (docs/findings)": [
            f"{sentence} ({script})" for script, sentence in findings()
        ],
    }


def cells(line: Line) -> list[str]:
    """Format one line of the table."""
    of = "states" if line.steps is None else f"{line.steps} steps"
    numbers = [f"{line.errors[name]:.1e}" if name in line.errors else "" for name in TORQUE_AND_FORCES]
    cost = "" if line.cost is None else f"{line.cost:.2g}"
    order = "" if line.order is None else f"{line.order:.1f}"
    return [line.simulator, line.version, line.setting, of, *numbers, f"{line.gap:.1e}", cost, order]


def table(found: Examination) -> str:
    """Write the table as CSV, every digit."""
    columns = ["subject", "version", "setting", "steps", *TORQUE_AND_FORCES, "gap", "cpu_s_per_s", "order"]
    rows: list[list[Any]] = []
    for line in found.lines:
        values = [line.errors.get(name) for name in TORQUE_AND_FORCES]
        rows.append([line.simulator, line.version, line.setting, line.steps, *values, line.gap, line.cost, line.order])
    return csv_text(columns, rows)


def work_precision(found: Examination) -> str:
    """Draw the error of the torque through a turn over the cost of a simulated second, as SVG."""
    from matplotlib import colormaps
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 4.2), layout="constrained")
    axes = figure.add_subplot()
    series: dict[tuple[str, str], list[Line]] = {}
    for line in found.lines:
        if line.cost:
            series.setdefault((line.simulator, line.setting), []).append(line)
    names = list(dict.fromkeys(simulator for simulator, _ in series))
    for index, ((simulator, setting), lines) in enumerate(series.items()):
        nth = [own for name, own in series if name == simulator].index(setting)
        axes.loglog(
            [line.cost or 0.0 for line in lines],
            [line.errors["torque"] for line in lines],
            color=[0.8 * part for part in colormaps["turbo"]((names.index(simulator) + 0.5) / len(names))[:3]],
            marker="osD^vP*Xh<>"[index % 11],
            linestyle=("-", "--", ":", "-.")[nth % 4],
            markersize=4,
            linewidth=1,
            label=f"{simulator}: {setting}",
        )
    axes.set_xlabel("processor seconds for one simulated second")
    axes.set_ylabel("error of the torque by its greatest value")
    axes.grid(alpha=0.3)
    figure.legend(loc="outside right upper", fontsize=7, frameon=False)
    return drawn(figure, "standing")


def findings() -> list[tuple[str, str]]:
    """List the name of each script of a checkout and the first sentence of its docstring."""
    return [
        (path.name, (ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").partition("\n")[0])
        for path in sorted(FINDINGS.glob("*.py") if FINDINGS else ())
    ]
