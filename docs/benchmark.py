"""Writes the blocks of docs/benchmark.md and docs/findings.md, and figures.

`python docs/benchmark.py` runs it. The blocks lie between comments.
Data and figures of problems come from models/problems, letters and errors from
docs/examples/benchmark.csv, findings from the docstrings of docs/findings/*.py. The
sentences around them are written by hand.
"""

import cmath
import csv
import io
import json
import math
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

import fourbar
from fourbar.quantities import PIN_FORCES
from fourbar.show.plot.labels import settle_labels
from fourbar.show.plot.linkage_figure import (
    draw_bar,
    draw_mechanism,
    draw_pins,
    draw_support,
)
from fourbar.show.plot.style import (
    BAR_COLOURS,
    GROUND_LINE,
    INK,
    MUTED,
    add_dark_form,
    apply_style,
    plot_points,
)
from fourbar.show.plot.symbols import Pose
from fourbar.show.plot.view import make_view
from fourbar.writing import write_text
from fourbar_lab.benchmark import DIFFERENTIATED as LOOP
from fourbar_lab.benchmark import REFUSED, draw_panels, name_row, read_work
from fourbar_lab.simulators.findings import read_findings
from fourbar_validation.check.problem import MISSING, WORSE
from fourbar_validation.compare.rows import read_cell_text
from fourbar_validation.report.svg import COORDINATES, LONG_NUMBER, write_alone

DOCS = Path(__file__).parent
PAGES = ("benchmark.md", "findings.md")
FIGURES = DOCS / "benchmark"
PROBLEMS = DOCS.parent / "models" / "problems"
TABLE = DOCS / "examples" / "benchmark.csv"
TORQUE_AND_FORCES = ("torque", *PIN_FORCES)
BLOCK = re.compile(r"<!-- data (\w+) -->\n.*?<!-- end -->\n", re.DOTALL)
SHOWN_AT = {"change_point": math.radians(40.0), "pinocchio_2729": math.radians(110.0)}
"""Positions of figures, rad. They replace the position that the project's figures
choose where that shows little.
"""
SIZE, LOW = (3.6, 2.6), (3.6, 1.4)
"""Sizes of a figure, and of one of a low mechanism, inches."""


def read_problem(name: str) -> dict[str, Any]:
    """Read a problem as it stands in models/problems."""
    problem: dict[str, Any] = json.loads(
        (PROBLEMS / f"{name}.json").read_text(encoding="utf-8")
    )
    return problem


def write_number(value: float) -> str:
    """Write a number with ten digits at most."""
    return f"{value:.10g}"


def write_pair(pair: list[float]) -> str:
    """Write a size and an angle, rad, which is shown in degrees."""
    return f"{write_number(pair[0])} at {write_number(math.degrees(pair[1]))}°"


def write_effect(value: Any) -> str:
    """Write the numbers of an effect, name by name."""
    if isinstance(value, dict):
        return ", ".join(f"{key} {write_effect(part)}" for key, part in value.items())
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return "; ".join(map(write_effect, value))
    return write_pair(value) if isinstance(value, list) else write_number(value)


def write_data(problem: dict[str, Any]) -> list[str]:
    """Write lengths and bars as a table.

    Effects, drive and command are its last rows.
    """
    lengths, bars = problem["scene"]["lengths"], problem["scene"].get("bars", {})
    columns = [
        name
        for name in dict.fromkeys((*lengths, *bars))
        if name not in ("ground_angle", "offset")
    ]
    rows = [["bar", *columns], ["---"] * (len(columns) + 1)]
    rows.append(
        [
            "length, m",
            *(
                write_number(lengths[name]) if name in lengths else ""
                for name in columns
            ),
        ]
    )
    for key, head in (
        ("mass", "mass, kg"),
        ("inertia", "inertia, kg m²"),
        ("centre", "centre, m"),
    ):
        cells = [bars.get(name, {}).get(key) for name in columns]
        if any(cell is not None for cell in cells):
            write = write_pair if key == "centre" else write_number
            rows.append(
                [head, *("" if cell is None else write(cell) for cell in cells)]
            )
    return [f"|{'|'.join(row)}|" for row in rows]


def write_question(problem: dict[str, Any]) -> str:
    """Write what acts, what is commanded, and what is asked besides the pin forces."""
    scene, command = problem["scene"], problem["command"]
    parts = []
    if turned := scene["lengths"].get("ground_angle"):
        parts.append(f"Ground at {write_number(math.degrees(turned))}°.")
    if (offset := scene["lengths"].get("offset")) is not None:
        parts.append(f"Guide at y = {write_number(offset)} m.")
    acting = list(scene.get("effects", {}).items())
    acting += [("loads", load) for load in scene.get("loads", ())]
    for key, value in acting:
        parts.append(f"{key.replace('_', ' ').capitalize()}: {write_effect(value)}.")
    if "from" in scene.get("drive", {}):
        parts.append(f"Drive: {write_effect(scene['drive'])}.")
    angles = np.atleast_1d(command["theta_2"])
    rates = f"ω₂ {write_number(command['omega_2'])} rad/s"
    rates += (
        f", α₂ {write_number(command['alpha_2'])} rad/s²"
        if command.get("alpha_2")
        else ""
    )
    sign = command["branch"]
    branch = f"branch {sign if np.ndim(sign) == 0 else 'in the file'}"
    if problem["ask"] == "release":
        times = problem["times"]
        start = f"Released at θ₂ {write_number(math.degrees(angles[0]))}°"
        parts.append(
            f"{start}, {rates}, {branch}; {len(times)} instants up to {times[-1]:g} s."
        )
    else:
        ends = [write_number(math.degrees(angle)) for angle in (angles[0], angles[-1])]
        parts.append(
            f"θ₂ from {ends[0]}° to {ends[1]}° in {len(angles)} positions, {rates},"
            f" {branch}."
        )
    asked = [
        f"`{quantity}`" for quantity in problem["answers"] if quantity not in PIN_FORCES
    ]
    return f"{' '.join(parts)} **Asked:** {', '.join(asked)}."


def read_table() -> list[dict[str, str]]:
    """Read the table of the benchmark."""
    with TABLE.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def read_rows() -> list[dict[str, str]]:
    """Read the table of the benchmark, each engine with its version."""
    return [
        {**row, "engine": name_row(row["engine"], row["version"])}
        for row in read_table()
    ]


def write_matrix(names: list[str]) -> list[str]:
    """Write two letters for each engine and problem, and why one is none of A and R.

    The problems that few engines answer have a table of their own: one of all problems
    is wider than the column in which GitHub shows a page.
    """
    letters: dict[str, dict[str, str]] = {}
    reasons: dict[str, list[str]] = {}
    for row in read_rows():
        if row["letters"]:
            letters.setdefault(row["engine"], {})[row["problem"]] = read_cell_text(
                row["letters"]
            )
        if row["level"] in ("B", "C", WORSE, MISSING) and row["reason"] not in (
            "",
            "not read",
        ):
            reasons.setdefault(row["reason"], []).append(row["engine"])
    several = [name for name in names if is_four_bar_at_positions(name)]
    rest = [name for name in names if name not in several]
    answering = [
        engine
        for engine, cells in letters.items()
        if any(cells.get(name, MISSING) != REFUSED for name in rest)
    ]
    return [
        *write_letters(letters, letters, several, names),
        "",
        f"All other engines refuse {names.index(rest[0]) + 1} to {len(names)}:",
        "",
        *write_letters(letters, answering, rest, names),
        "",
        *(f"- {name_together(engines)}: {why}" for why, engines in reasons.items()),
    ]


def is_four_bar_at_positions(name: str) -> bool:
    """Tell whether a problem is a four-bar at single positions."""
    problem = read_problem(name)
    return (problem["mechanism"], problem["ask"]) == ("four-bar", "answer")


def write_letters(
    letters: dict[str, dict[str, str]],
    engines: Iterable[str],
    columns: list[str],
    names: list[str],
) -> list[str]:
    """Write a table of engines and some of the problems, which have their numbers."""
    rows = [
        ["engine", *(str(names.index(name) + 1) for name in columns)],
        ["---", *[":-:"] * len(columns)],
    ]
    rows += [
        [engine, *(letters[engine].get(name, MISSING) for name in columns)]
        for engine in engines
    ]
    return [f"|{'|'.join(row)}|" for row in rows]


def name_together(engines: list[str]) -> str:
    """Name rows by the words that all their names begin with, or by their programs."""
    common = list[str]()
    for words in zip(*(engine.split(" ") for engine in engines), strict=False):
        if len(set(words)) > 1:
            break
        common.append(words[0])
    return " ".join(common).rstrip(":,") or ", ".join(
        dict.fromkeys(engine.partition(":")[0] for engine in engines)
    )


def write_findings(*, known: bool) -> list[str]:
    """Write an entry for each finding.

    The findings are those that its project knows or documents, or the others.
    """
    lines = []
    for finding in read_findings():
        fields = finding.fields
        if fields["Reported"].startswith(("known", "stated")) == known:
            dates = " ".join(
                f"*{name}:* {fields[name]}." for name in ("Since", "Until", "Reported")
            )
            script = finding.script.name
            lines += [
                f"- **{finding.engine[0]}**: {finding.sentence}",
                f"  - {fields['Found']}",
            ]
            lines.append(f"  - {dates} [{script}](findings/{script})")
    return lines


def write_runs() -> list[str]:
    """Write the worst error of torque and forces in one loop, for each engine.

    Engines through time have that of their finest timestep, the others that of states.
    """
    runs: dict[str, dict[str, dict[str, str]]] = {}
    for row in read_rows():
        if (
            row["problem"] == LOOP
            and row["setting"] != "exact"
            and row["quantity"] in ("gap at B", *TORQUE_AND_FORCES)
        ):
            runs.setdefault(row["engine"], {}).setdefault(row["setting"], {})[
                row["quantity"]
            ] = row["error"]
            runs[row["engine"]][row["setting"]]["seconds"] = row["seconds"]
    rows = [
        ["engine", "pin forces", "steps a turn", "error", "gap at B", "s"],
        ["---"] * 2 + ["---:"] * 4,
    ]
    for engine, settings in runs.items():
        setting, errors = list(settings.items())[-1]
        steps = (
            "states"
            if "states" in setting
            else setting.rpartition(" ")[2].removesuffix("/rev")
        )
        if "torque" not in errors:
            continue
        pins = [pin for pin in PIN_FORCES if errors.get(pin, "nan") != "nan"]
        worst = max(float(errors[name]) for name in ("torque", *pins))
        cells = [
            f"{worst:.1g}",
            f"{float(errors['gap at B']):.1g}" if "gap at B" in errors else "",
            errors["seconds"],
        ]
        read = "all" if len(pins) == len(PIN_FORCES) else ", ".join(pins)
        rows.append([engine, read, steps, *cells])
    return [f"|{'|'.join(row)}|" for row in rows]


def draw_problem(name: str) -> str:
    """Draw a problem's mechanism to scale, as SVG."""
    with apply_style():
        problem = read_problem(name)
        sliding = problem["mechanism"] == "slider-crank"
        figure = Figure(figsize=LOW if sliding else SIZE, layout="constrained")
        axes = figure.add_subplot()
        if sliding:
            draw_slider_crank(axes, problem)
        else:
            view = make_view(
                fourbar.load(PROBLEMS / f"{name}.toml"), SHOWN_AT.get(name)
            )
            pins = Pose(view, view.here, 0).pins
            plot_points(axes, [pins["O2"], pins["O4"]], **GROUND_LINE)
            for pin in ("O2", "O4"):
                draw_support(axes, pins[pin], view.plane.size)
            draw_mechanism(axes, view, view.here, 0)
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.12)
        axes.set_axis_off()
        settle_labels(figure)
        drawn = io.StringIO()
        with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": name}):
            figure.savefig(
                drawn,
                format="svg",
                metadata={"Date": None, "Creator": None},
            )
    svg = add_dark_form(drawn.getvalue().encode()).decode()
    return COORDINATES.sub(lambda part: LONG_NUMBER.sub(r"\1", part.group()), svg)


def draw_slider_crank(axes: Any, problem: dict[str, Any]) -> None:
    """Draw crank, rod, slider and guide at the fifth position."""
    lengths, theta_2 = problem["scene"]["lengths"], problem["command"]["theta_2"][4]
    theta_3, stroke = (problem["answers"][key][4] for key in ("theta_3", "stroke"))
    crank, size, level = lengths["crank"], 0.1 * lengths["rod"], lengths["offset"]
    pins = {
        "O2": 0.0j,
        "A": cmath.rect(crank, theta_2),
        "B": complex(stroke, level),
    }
    rod = cmath.rect(lengths["rod"], theta_3)
    assert math.isclose((pins["A"] + rod).imag, level, abs_tol=1e-12)
    draw_support(axes, pins["O2"], 0.5 * size)
    end = 1.3 * (crank + lengths["rod"])
    guide = [complex(-crank, level), complex(end, level)]
    corners = [
        complex(stroke + x * size, level + 0.6 * y * size)
        for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1))
    ]
    plot_points(axes, guide, color=MUTED, lw=1.0, ls=(0, (8, 3, 2, 3)))
    plot_points(axes, corners, color=BAR_COLOURS[4], lw=2.0, zorder=3)
    for bar, (start, stop) in ((2, ("O2", "A")), (3, ("A", "B"))):
        draw_bar(axes, bar, [pins[start], pins[stop]])
    draw_pins(axes, pins, complex(0.5 * stroke))
    if problem["scene"].get("loads"):
        axes.annotate(
            "",
            (stroke + 1.1 * size, level),
            (stroke + 3.0 * size, level),
            arrowprops={"arrowstyle": "-|>", "color": INK, "lw": 1.4},
        )


def text(page: str) -> str:
    """Return a page with its blocks written anew."""
    text = (DOCS / page).read_text(encoding="utf-8")
    names = [name for name in BLOCK.findall(text) if name not in WRITERS]

    def write_block(block: re.Match[str]) -> str:
        name = block.group(1)
        if name in WRITERS:
            lines = WRITERS[name](names)
        else:
            problem = read_problem(name)
            figure = f"![{problem['title']}]({FIGURES.name}/{name}.svg)"
            lines = [figure, "", *write_data(problem), "", write_question(problem)]
        return "\n".join((f"<!-- data {name} -->", "", *lines, "", "<!-- end -->", ""))

    return BLOCK.sub(write_block, text)


WRITERS: dict[str, Callable[[list[str]], list[str]]] = {
    "matrix": write_matrix,
    "findings": lambda _: write_findings(known=False),
    "limits": lambda _: write_findings(known=True),
    "runs": lambda _: write_runs(),
}
"""Writers of the blocks that are no problem's, by name. Each is given the names of the
page's problems.
"""


if __name__ == "__main__":
    for page_name in PAGES:
        write_text(DOCS / page_name, text(page_name))
    for file in PROBLEMS.glob("*.json"):
        write_text(FIGURES / f"{file.stem}.svg", draw_problem(file.stem))
    work = draw_panels(read_work(read_table()))
    write_text(TABLE.with_suffix(".svg"), write_alone(work, "benchmark"))
