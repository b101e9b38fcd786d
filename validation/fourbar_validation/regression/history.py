"""The history of accepted runs: one table, history.parquet, for pandas and DuckDB.

A line is a row of a run, or a time (quantity "time": `times_formulas` is the engine's
time over that of the formulas on the scene), with the run's date, commit, machine and
versions in columns of their own (`version_mujoco`).
"""

import hashlib
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fourbar.errors import InputError
from fourbar.writing import write_bytes
from fourbar_validation.compare.rows import COMPARED_VERDICTS, FORMULAS
from fourbar_validation.regression.record import Recorded
from fourbar_validation.report.html import Section, SectionFigure
from fourbar_validation.report.svg import ALLOWED, choose_style, set_frame, write_svg

if TYPE_CHECKING:
    from pandas import DataFrame

HISTORY = "history.parquet"
TIME = "time"


MOST_RUNS_DRAWN = 60
"""Latest runs in the picture."""


def append(file: Path, run: Recorded) -> None:
    """Append a run to the table, which is made if there is none.

    A run with the same date and rows is appended once. InputError if the file is
    damaged or no such table.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = _make_table(run)
    if file.exists():
        try:
            old = pq.read_table(
                pa.BufferReader(file.read_bytes()),
                page_checksum_verification=True,
            )
            if table["run"][0].as_py() in set(old["run"].to_pylist()):
                return
            table = pa.concat_tables([old, table], promote_options="default")
        except (OSError, ValueError, KeyError, TypeError, pa.ArrowException):
            raise InputError(
                "--to",
                str(file),
                "is damaged, or no table written by `accept`",
            ) from None
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, compression="zstd", write_page_checksum=True)
    file.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(file, sink.getvalue().to_pybytes())


def _make_table(run: Recorded) -> Any:
    """Return the rows and times of a run; a text that recurs is kept once."""
    import pandas
    import pyarrow as pa

    about = run.about
    rows = run.frame()
    times = pandas.DataFrame(
        [
            (scene, engine, TIME, ratio)
            for scene, some in run.times()
            for engine, ratio in some
        ],
        columns=["scene", "engine", "quantity", "times_formulas"],
    )
    lines = pandas.concat([rows, times], ignore_index=True)
    digest = hashlib.sha256(f"{about.date}\n{lines.to_csv()}".encode())
    entries = {
        scene: hashlib.sha256(json.dumps(stated, sort_keys=True).encode())
        for scene, stated in about.scenes.items()
    }
    hashes = {scene: one.hexdigest()[:16] for scene, one in entries.items()}
    stated = {
        "run": digest.hexdigest()[:16],
        "date": about.date,
        "commit": about.commit,
        "machine": about.machine,
        "settings": json.dumps(about.settings, sort_keys=True),
    }
    stated |= {f"version_{name}": text for name, text in about.versions.items()}
    lines = pandas.concat(
        [
            pandas.DataFrame(stated, index=lines.index),
            lines.drop(columns="times_formulas").assign(
                scene_hash=[hashes.get(scene, "") for scene in lines.scene],
                times_formulas=lines.times_formulas.astype(float),
            ),
        ],
        axis=1,
    )
    word = pa.dictionary(pa.int32(), pa.string())
    schema = pa.schema(
        [
            (name, pa.float64() if kind.kind == "f" else word)
            for name, kind in lines.dtypes.items()
        ]
    )
    return pa.Table.from_pandas(
        lines, schema, preserve_index=False
    ).replace_schema_metadata()


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
        svg=_draw(table),
    )
    text = f"From {file.name} of the accepted state, to which `accept` appends. "
    return [Section("history", "Over the accepted runs", text, figures=[figure])]


def summarise(file: Path) -> "DataFrame":
    """Return a line for each run and engine, by date: `used` and `time`.

    Their values are the largest error over what is allowed, and the median of the time
    over that of the formulas. InputError if the file is damaged.
    """
    import pandas

    columns = ["run", "date", "commit", "engine", "quantity", "verdict", "error"]
    try:
        lines = pandas.read_parquet(
            file, columns=[*columns, "allowed", "times_formulas"]
        )
    except (OSError, ValueError):
        raise InputError(
            "--against", str(file), "is damaged, or no table written by `accept`"
        ) from None
    lines = lines[lines.engine != FORMULAS]
    compared = lines.verdict.isin(COMPARED_VERDICTS) & (lines.allowed > 0.0)
    lines["used"] = (lines.error / lines.allowed).where(compared)
    of_runs = lines.groupby(["date", "run", "commit", "engine"], observed=True)
    return of_runs.agg(
        used=("used", "max"), time=("times_formulas", "median")
    ).reset_index()


def _draw(table: "DataFrame") -> str:
    """Draw error and time of each engine over the runs, labelled by their commits."""
    from matplotlib.figure import Figure

    runs = table[["run", "date", "commit"]].drop_duplicates().tail(MOST_RUNS_DRAWN)
    places = {run: place for place, run in enumerate(runs.run)}
    table = table[table.run.isin(places)]
    figure = Figure(figsize=(8.6, 4.2), layout="constrained")
    panels = figure.subplots(2, 1, sharex=True)
    for engine, lines in table.groupby("engine", observed=True):
        for axes, column in zip(panels, ("used", "time"), strict=True):
            drawn = lines[np.isfinite(lines[column]) & (lines[column] > 0.0)]
            if len(drawn):
                axes.plot(
                    drawn.run.astype(str).map(places),
                    drawn[column],
                    label=engine if column == "used" else None,
                    **choose_style(str(engine)).line,
                )
    panels[0].axhline(1.0, color=ALLOWED, lw=1.1, ls=(0, (5, 2)))
    panels[0].set_ylabel("error / allowed")
    panels[1].set_ylabel("time / formulas")
    labels = [f"{run.date[:10]}\n{run.commit[:7]}" for run in runs.itertuples()]
    step = -(-len(labels) // 8)
    panels[1].set_xticks(range(0, len(labels), step), labels[::step], fontsize=8)
    for axes in panels:
        axes.set_yscale("log")
        set_frame(axes)
    figure.legend(loc="outside upper left", ncols=4, frameon=False, fontsize=8)
    return write_svg(figure, "history")
