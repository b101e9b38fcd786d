"""The history of accepted runs: one table, history.parquet, for pandas and DuckDB.

A line is a row of a run, or a time (quantity "time": `times_formulas` is the engine's
time over that of the formulas on the scene), with the run's date, commit, machine and
versions in columns of their own (`version_mujoco`).
"""

import hashlib
import io
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fourbar.writing import write_bytes
from fourbar_validation.compare.rows import COMPARED_VERDICTS, FAILS, FORMULAS
from fourbar_validation.regression.changes import WITHOUT_SETTING
from fourbar_validation.regression.record import Recorded, name_damage
from fourbar_validation.report.html import Section, SectionFigure
from fourbar_validation.report.svg import ALLOWED, choose_style, set_frame, write_svg

if TYPE_CHECKING:
    from pandas import DataFrame

HISTORY = "history.parquet"
TIME = "time"
_NO_HISTORY = "is damaged, or no table written by `accept`"
MOST_RUNS_DRAWN = 60
"""Latest runs in the picture."""


def append(file: Path, run: Recorded) -> None:
    """Append a run to the table, which is made if there is none.

    A run with the same date and rows is appended once. InputError if the file is
    damaged or no such table.
    """
    import pandas

    lines = _tabulate_run(run)
    if file.exists():
        with name_damage("--to", file, _NO_HISTORY):
            old = pandas.read_parquet(
                io.BytesIO(file.read_bytes()), page_checksum_verification=True
            )
            if (old["run"] == lines["run"][0]).any():
                return
            lines = pandas.concat([old, lines], ignore_index=True)
    file.parent.mkdir(parents=True, exist_ok=True)
    packed = lines.to_parquet(compression="zstd", write_page_checksum=True)
    write_bytes(file, packed)


def _tabulate_run(run: Recorded) -> "DataFrame":
    """Return the rows and times of a run, with what it was made with."""
    import pandas

    about = run.about
    times = run.times().assign(quantity=TIME)
    lines = pandas.concat([run.frame(), times], ignore_index=True)
    stated = {
        "run": _hash(f"{about.date}\n{lines.to_csv()}"),
        "date": about.date,
        "commit": about.commit,
        "machine": about.machine,
        "settings": json.dumps(about.settings, sort_keys=True),
    }
    stated |= {f"version_{name}": text for name, text in about.versions.items()}
    hashes = {
        scene: _hash(json.dumps(entries, sort_keys=True))
        for scene, entries in about.scenes.items()
    }
    place = lines.columns.get_loc("times_formulas")
    lines.insert(place, "scene_hash", [hashes.get(one, "") for one in lines.scene])
    of_run = pandas.DataFrame(stated, index=lines.index)
    return pandas.concat([of_run, lines], axis=1)


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


RowKey = tuple[str, str, str]
"""Scene, engine and quantity of a row."""


def read_history(before: Recorded) -> "DataFrame":
    """Return the rows of the accepted runs up to one, the oldest first.

    A run that was not accepted, whose folder has no history, is the only one.
    """
    import pandas

    file = before.table.parent / HISTORY
    columns = ["date", "commit", *WITHOUT_SETTING, "verdict", "error", "allowed"]
    if not file.is_file():
        about = before.about
        lines = before.frame().assign(date=about.date, commit=about.commit)[columns]
    else:
        with name_damage("--against", file, _NO_HISTORY):
            lines = pandas.read_parquet(file, columns=columns)
        lines = lines[lines.quantity != TIME]
    return lines.astype(dict.fromkeys(columns[:6], str)).sort_values(
        "date", kind="stable"
    )


def find_since(
    history: "DataFrame",
    before: Recorded,
    failing: Iterable[RowKey],
) -> dict[RowKey, str]:
    """Say since which accepted run each failing row fails, as the end of "It ...".

    An engine without an answer (quantity "all") has no such row where it answered.
    """
    of_engines = dict(list(history.groupby(["scene", "engine"])))
    since = {}
    for key in failing:
        *of, quantity = key
        lines = of_engines.get(tuple(of), history[:0])
        since[key] = _write_since(lines, quantity, before)
    return since


def _write_since(lines: "DataFrame", quantity: str, before: Recorded) -> str:
    """Say since which run a quantity of an engine does not hold, from rows in a scene.

    An engine that broke down there has no row of the quantity, which then fails too.
    """
    fails = (lines.verdict == FAILS) & lines.quantity.isin([quantity, "all"])
    if quantity != "all":
        lines = lines[fails | (lines.quantity == quantity)]
        fails = fails[lines.index]
    runs = fails.groupby([lines.date, lines.commit], sort=False).any()
    here = before.describe()
    if runs.empty:
        return f"is not in {here}"
    names = [
        f"the run of {date[:19].replace('T', ' ')}"
        + f" at commit {commit}" * bool(commit)
        for date, commit in runs.index
    ]
    verb = "answered" if quantity == "all" else "held"
    if runs.index[-1] != (before.about.date, before.about.commit):
        end = "failed" if runs.iloc[-1] else verb
        return f"is not in {here}; it {end} in {names[-1]}"
    if not runs.iloc[-1]:
        return f"{verb} in {here}"
    if runs.all():
        many = f", and in every accepted run since {names[0]}"
        return f"failed too in {here}" + many * (len(runs) > 1)
    last = np.flatnonzero(~runs)[-1]
    return f"has not {verb} since {names[last + 1]}; it {verb} in {names[last]}"


def draw_row(history: "DataFrame", row: Any) -> str:
    """Draw error over what is allowed of one row, over the accepted runs and this one.

    `row`: line of the table of differences. Empty if no run has a number.
    """
    same = [history[name] == getattr(row, name) for name in WITHOUT_SETTING]
    lines = history[np.logical_and.reduce(same)]
    this = {"date": "this run", "commit": "", "error": row.error_new}
    lines = [*lines.to_dict("records"), this | {"allowed": row.allowed_new}]
    errors = np.array([line["error"] for line in lines], dtype=float)
    if not np.any(errors > 0.0):
        return ""
    allowed = [line["allowed"] for line in lines]
    runs = [(line["date"], line["commit"]) for line in lines]
    return _draw_panels("row", runs, {"error / scale": {row.engine: errors}}, allowed)


def _draw_panels(
    name: str,
    runs: Sequence[tuple[str, str]],
    panels: Mapping[str, Any],
    allowed: Any,
) -> str:
    """Draw numbers of engines over runs, on panels by their labels.

    `runs`: date and commit of each. `allowed`: of the first panel.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.6, 0.8 + 1.8 * len(panels)), layout="constrained")
    shown = slice(-MOST_RUNS_DRAWN, None)
    labels = [f"{date[:10]}\n{commit[:7]}" for date, commit in runs][shown]
    places = np.arange(len(labels))
    step = -(-len(labels) // 8)
    rows = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    limit = np.broadcast_to(allowed, len(runs))[shown]
    dashed = {"color": ALLOWED, "lw": 1.1, "ls": (0, (5, 2)), "label": "allowed"}
    rows[0].plot(places, limit, **dashed)
    for axes, (label, numbers) in zip(rows, panels.items(), strict=True):
        for engine, values in numbers.items():
            style = choose_style(engine).line
            axes.plot(places, np.asarray(values)[shown], label=engine, **style)
        axes.set_ylabel(label)
        axes.set_xticks(places[::step], labels[::step], fontsize=8)
        axes.set_yscale("log")
        set_frame(axes)
    handles = rows[0].get_legend_handles_labels()
    figure.legend(
        *handles, loc="outside upper left", ncols=4, frameon=False, fontsize=8
    )
    return write_svg(figure, name)


def collect_history(folder: Path) -> list[Section]:
    """Return the section on the accepted runs of a folder; none without a history."""
    file = folder / HISTORY
    if not file.is_file():
        return []
    table = summarise(file)
    runs = table.run.nunique()
    caption = (
        f"Above, the largest error of each engine over what is allowed; beneath, the"
        f" median of its time over that of the formulas; {runs} accepted runs, the"
        f" oldest first."
    )
    figure = SectionFigure(
        "Error and time of each engine over the accepted runs",
        caption,
        svg=_draw_history(table),
    )
    text = f"From {file.name} of the accepted state, to which `accept` appends. "
    return [Section("history", "Over the accepted runs", text, figures=[figure])]


def summarise(file: Path) -> "DataFrame":
    """Return a line for each run and engine, by date, with `used` and `time`.

    `used` is the largest error over what is allowed, `time` the median over that of the
    formulas. A damaged file raises InputError.
    """
    import pandas

    columns = ["run", "date", "commit", "engine", "quantity", "verdict", "error"]
    with name_damage("--against", file, _NO_HISTORY):
        lines = pandas.read_parquet(
            file, columns=[*columns, "allowed", "times_formulas"]
        )
    lines = lines[lines.engine != FORMULAS]
    compared = lines.verdict.isin(COMPARED_VERDICTS) & (lines.allowed > 0.0)
    lines["used"] = (lines.error / lines.allowed).where(compared)
    of_runs = lines.groupby(["date", "run", "commit", "engine"], observed=True)
    return of_runs.agg(
        used=("used", "max"), time=("times_formulas", "median")
    ).reset_index()


def _draw_history(table: "DataFrame") -> str:
    """Draw error and time of each engine over the runs, labelled by their commits."""
    of_runs = table.pivot_table(
        index=["date", "run", "commit"],
        columns="engine",
        values=["used", "time"],
        dropna=False,
        observed=True,
    )
    finite = of_runs.where(np.isfinite(of_runs) & (of_runs > 0.0))
    panels = {"error / allowed": finite["used"], "time / formulas": finite["time"]}
    runs = [(str(date), str(commit)) for date, _, commit in of_runs.index]
    return _draw_panels("history", runs, panels, 1.0)
