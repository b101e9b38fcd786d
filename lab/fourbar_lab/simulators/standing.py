"""`standing`: what simulators say of one closed loop, on one page."""

import math
import sys
from pathlib import Path
from typing import Any

import click

import fourbar
from fourbar.errors import InputError
from fourbar.quantities import PIN_FORCES
from fourbar.writing import write_text
from fourbar_lab.simulators.examine import TORQUE_AND_FORCES, Examination, Line, examine
from fourbar_lab.simulators.findings import run_findings
from fourbar_validation.compare.rows import write_csv
from fourbar_validation.places import MODELS
from fourbar_validation.report.machine import name_machine
from fourbar_validation.report.svg import draw_svg, shrink_svg
from fourbar_validation.report.templating import render

PROBLEM = MODELS / "problems" / "crank_rocker.toml"
HEAD = ("setting", "of", *TORQUE_AND_FORCES, "gap at B", "CPU s per s", "order")
PERCENT = 9.5e-4
"""Errors from here on are written in percent, smaller ones as a power of ten."""
EXPLAINED = (
    "Torque and pin forces: the largest error, divided by the largest value in a turn. The simulator is compared with "
    "the formulas at the angle, speed and acceleration that it had itself. 'states': single states; 'N steps': a turn "
    "at constant speed, without its first quarter. Empty: not read here (of Genesis no pin force but the closing one "
    "was found). Gap at B: the largest "
    "distance between the ends of bars 3 and 4, divided by the longest bar. Order: the power of the timestep with "
    "which the torque's error fell from the line above to this one. CPU time is without reading results and without "
    "compilation. This is no ranking: double and single precision, compiled and interpreted loops stand side by side."
)

DIFFERENTIATED = (
    "The driving torque at a state, and its derivatives by numbers of the scene, at most a quarter turn after a set "
    "state: the difference from the formulas, divided by their value. Assembling the loop and compiling a model are no "
    "part of what a simulator differentiates, so how its state and the numbers of its model change with each number of "
    "the scene is taken from two assembled scenes, and its derivative is that along this change. zero: what the "
    "simulator answers, without an error. A line without numbers is what it refuses."
)


@click.command()
@click.argument("scene", type=click.Path(path_type=Path), default=PROBLEM)
@click.option(
    "--python", "pythons", type=click.Path(path_type=Path), multiple=True, help="An environment of simulators."
)
@click.option("-o", "--out", type=click.Path(path_type=Path), default=Path("results/standing"), show_default=True)
@click.option("--time-limit", default=600.0, show_default=True, help="Seconds for each simulator and each finding.")
def command(scene: Path, pythons: tuple[Path, ...], out: Path, time_limit: float) -> None:
    """Examine every simulator that is installed here or under a --python, and write one page (repeat --python).

    It runs the findings too, and says what could not run: the command of a night.
    """
    for python in pythons:
        if not python.is_file():
            raise InputError("--python", str(python), "must be a Python interpreter, such as .venv-warp/bin/python")
    given = fourbar.load(scene)
    out.mkdir(parents=True, exist_ok=True)
    interpreters = [Path(sys.executable), *(path.absolute() for path in pythons)]
    found = examine(given, scene, interpreters, time_limit)
    if not found.lines:
        raise InputError("--python", ", ".join(map(str, pythons)) or None, "no simulator answered there")
    chart = draw_work_precision(found)
    examined_versions = dict.fromkeys(f"{line.simulator} {line.version}" for line in found.lines)
    lists = {
        "What had to be changed, and what it ran on": [
            f"{name} ({found.devices[name]}): {what}" for name, what in found.changed.items()
        ],
        "Not examined": [f"{name}: {why}" for name, why in found.left_out.items()],
    }
    page = {
        "title": given.title,
        "made": f"{name_machine()}; {', '.join(examined_versions)}",
        "verdicts": write_verdicts(found),
        "explained": EXPLAINED,
        "head": HEAD,
        "tables": [
            ("The table", list_groups(found, apart=False)),
            ("Apart: settings not meant for the simulator", list_groups(found, apart=True)),
        ],
        "differentiated": lay_out_derivatives(found),
        "lists": [(heading, texts) for heading, texts in lists.items() if texts],
        "findings": run_findings(interpreters, time_limit),
        "svg": shrink_svg(chart),
    }
    for ending in ("html", "md"):
        write_text(out / f"standing.{ending}", render("fourbar_lab.simulators", f"standing.{ending}.j2", **page))
    write_text(out / "standing.svg", chart)
    write_text(out / "standing.csv", write_table(found))
    for name, why in found.left_out.items():
        click.echo(f"not examined: {name}: {why}")
    click.echo(
        f"wrote {out}/standing.html, .md, .csv, .svg: {len(found.lines)} lines of {len(found.changed)} simulators"
    )


def lay_out_derivatives(found: Examination) -> dict[str, Any] | None:
    """Lay out the derivatives of the simulators that can be differentiated; None where there are none."""
    columns = list(dict.fromkeys(key for line in found.slopes for key in line.errors))
    rows = []
    for line in found.slopes:
        values = [line.errors.get(key, "") for key in columns]
        cells = [x if isinstance(x, str) else "zero" if x is None else write_size(x) for x in values]
        rows.append([f"{line.simulator} {line.version}", line.how, *cells])
    by = [key if key == "torque" else f"by {key}" for key in columns]
    return {"text": DIFFERENTIATED, "head": ["simulator", "how", *by], "rows": rows} if rows else None


def write_size(error: float) -> str:
    """Write an error with one digit: in percent, or as a power of ten where it is small."""
    if not error >= PERCENT:
        return "nan" if math.isnan(error) else f"{error:.0e}".replace("e-0", "e-")
    return f"{float(f'{100.0 * error:.1g}'):g} %"


def write_verdicts(found: Examination) -> list[tuple[str, str]]:
    """State for each simulator in one sentence what its settings reach in their finest turn, and at single states."""
    made: dict[str, dict[str, list[Line]]] = {}
    for line in found.lines:
        if not line.apart:
            made.setdefault(f"{line.simulator} {line.version}", {}).setdefault(line.setting, []).append(line)
    return [(name, f"{'; '.join(map(_summarise_reached, settings.values()))}.") for name, settings in made.items()]


def _summarise_reached(lines: list[Line]) -> str:
    """Summarise one setting; the pins are named where it does not report all."""
    turns, at_states = [line for line in lines if line.steps], [line for line in lines if not line.steps]
    said = [f"{write_size(line.worst)} in {line.steps} steps" for line in turns[-1:]]
    said += [f"{write_size(line.worst)} at single states" for line in at_states]
    pins = [pin for pin in PIN_FORCES if pin in lines[0].errors]
    read = "every force" if len(pins) == len(PIN_FORCES) else f"{', '.join(pins)} alone"
    return f"{lines[0].setting}: {read} and torque to {', '.join(said)}"


def list_groups(found: Examination, *, apart: bool) -> list[tuple[str, list[list[str]]]]:
    """List the simulators with what they ran on and their rows of the table."""
    made: dict[str, list[list[str]]] = {}
    for line in found.lines:
        if bool(line.apart) == apart:
            told = [line.apart if apart else "", found.made_for.get(line.simulator, "")]
            told[1] = told[1] and f"made for {told[1]}; here one world"
            name = f"{line.simulator} {line.version}, {found.devices.get(line.simulator, '')}"
            made.setdefault("; ".join(filter(None, [name, *told])), []).append(write_cells(line))
    return list(made.items())


def write_cells(line: Line) -> list[str]:
    """Format one line of the table."""
    of = "states" if line.steps is None else f"{line.steps} steps"
    numbers = [write_size(line.errors[name]) if name in line.errors else "" for name in TORQUE_AND_FORCES]
    cost = "" if line.cost is None else f"{float(f'{line.cost:.2g}'):g}"
    order = "" if line.order is None else f"{line.order:.1f}"
    return [line.setting, of, *numbers, write_size(line.gap), cost, order]


def write_table(found: Examination) -> str:
    """Write the table as CSV, every digit."""
    columns = ["subject", "version", "setting", "steps", *TORQUE_AND_FORCES, "gap", "cpu_s_per_s", "order"]
    rows: list[list[Any]] = []
    for line in found.lines:
        values = [line.errors.get(name) for name in TORQUE_AND_FORCES]
        rows.append([line.simulator, line.version, line.setting, line.steps, *values, line.gap, line.cost, line.order])
    return write_csv(columns, rows)


def draw_work_precision(found: Examination) -> str:
    """Draw the greatest error through a turn over the cost of a simulated second, a colour a simulator, as SVG."""
    from matplotlib import colormaps
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.8, 8.2), layout="constrained")
    axes = figure.add_subplot()
    series: dict[tuple[str, str], list[Line]] = {}
    for line in found.lines:
        if line.cost:
            series.setdefault((line.simulator, line.setting), []).append(line)
    simulators = list(dict.fromkeys(simulator for simulator, _ in series))
    settings: dict[str, int] = {}
    for (simulator, setting), lines in series.items():
        nth = settings[simulator] = settings.get(simulator, -1) + 1
        axes.loglog(
            [line.cost or 0.0 for line in lines],
            [line.worst for line in lines],
            marker="osD^vP*Xh<>"[simulators.index(simulator) % 11],
            color=[
                0.8 * part for part in colormaps["turbo"]((simulators.index(simulator) + 0.5) / len(simulators))[:3]
            ],
            linestyle=("-", "--", ":", "-.")[nth % 4],
            markersize=4,
            linewidth=1,
            label=f"{simulator}: {setting}",
        )
    axes.set_xlabel("processor seconds for one simulated second")
    axes.set_ylabel("greatest error of torque and pin forces")
    axes.grid(alpha=0.3)
    figure.legend(loc="outside lower center", fontsize=7, frameon=False)
    return draw_svg(figure, "standing")
