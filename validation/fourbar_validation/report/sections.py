"""Parts of report.html from elsewhere: the hard cases by family, and the cost."""

import base64
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from fourbar_validation.compare.results_file import read_columns
from fourbar_validation.compare.rows import VERDICTS, Counts, Row
from fourbar_validation.report.html import Section, SectionFigure
from fourbar_validation.scenes.hard_families import HARD_FAMILIES

HARD_FOLDER, _COST = "hard", "cost"
"""Folders of the hard cases and of the study, in OUT."""
_MUST = (
    "each family of singular and extreme linkages must come out as its statement says. "
)
_PICTURES = {
    "work-precision-torque.svg": (
        "Error of the driving torque over the CPU time of a simulated second"
    ),
    "work-precision-force.svg": (
        "Error of the worst pin force over the CPU time of a simulated second"
    ),
    "orders.svg": (
        "Error of the driving torque and of each pin force over the timestep; a jump is"
        " ringed"
    ),
}
"""Pictures of the study, and what they show."""
LARGEST_INLINE_PICTURE = 2_000_000
"""Bytes of a picture that is taken into the page."""
MOST_STUDIES = 3
"""Scenes whose study is shown."""


def collect_sections(hard: Iterable[Row] | None, out: Path) -> list[Section]:
    """Collect the hard cases and the study of cost, if there are any.

    The former are of this run or in OUT/hard, the latter in OUT/cost. Those of this run
    have the limits of the engines with them.
    """
    results = out / HARD_FOLDER / "results.csv"
    sections = []
    if hard is not None:
        sections += [collect_hard_cases(hard), _list_declared_limits()]
    elif results.is_file() and (out / HARD_FOLDER / "report.html").is_file():
        section = collect_hard_cases(read_columns(results))
        links = [(f"{HARD_FOLDER}/report.html",) * 2]
        text = f"From the run in {HARD_FOLDER}/: {_MUST}"
        sections.append(replace(section, text=text, links=links))
    folders = sorted(path.parent for path in (out / _COST).glob("*/cost.csv"))
    return [*sections, *(_read_study(folder) for folder in folders[:MOST_STUDIES])]


def collect_hard_cases(rows: Iterable[Row]) -> Section:
    """Collect the section on a run of the hard suite."""
    counts: dict[str, Counts] = {}
    scenes: dict[str, set[str]] = {}
    for row in rows:
        name = find_family(row.scene) or ""
        counts.setdefault(name, Counts()).add([row])
        scenes.setdefault(name, set()).add(row.scene)
    table = [
        (
            family.name,
            str(len(scenes[family.name])),
            *(str(counts[family.name][verdict]) for verdict in VERDICTS),
            counts[family.name].word,
            family.statement,
        )
        for family in HARD_FAMILIES
        if family.name in scenes
    ]
    headings = ("family", "scenes", *VERDICTS, "verdict", "what must happen")
    text = _MUST.capitalize()
    numbers = (1, 2 + len(VERDICTS))
    return Section(HARD_FOLDER, "Hard cases", text, headings, table, numbers=numbers)


def _list_declared_limits() -> Section:
    """List the limits that engines declare, with the reason of each."""
    from fourbar_validation.engines.limits import BOUNDARIES

    rows = [
        (
            limit.engine,
            limit.name,
            f"{limit.boundary:g} {limit.unit}".rstrip(),
            limit.reason,
        )
        for limit in BOUNDARIES
    ]
    text = "Where an engine refuses to answer, declared as data before it is asked."
    return Section(
        "engine-limits",
        "Limits of the engines",
        text,
        ("engine", "of what", "boundary", "why"),
        rows,
    )


def find_family(scene: str) -> str | None:
    """Find the family whose name a scene's begins with; of several the longest."""
    names = [
        family.name
        for family in HARD_FAMILIES
        if scene.startswith(family.name.replace(" ", "-") + "-")
    ]
    return max(names, key=len, default=None)


def _read_study(folder: Path) -> Section:
    figures = []
    for name, alt in _PICTURES.items():
        picture = folder / name
        if picture.is_file() and picture.stat().st_size <= LARGEST_INLINE_PICTURE:
            data = base64.b64encode(picture.read_bytes()).decode("ascii")
            image = f"data:image/svg+xml;base64,{data}"
            figures.append(SectionFigure(alt, f"{alt}.", image=image))
    text = (
        f"What each digit of {folder.name} costs, from the study in"
        f" {_COST}/{folder.name}/. Times are those of torque and pin forces at the"
        " scene's positions: of MuJoCo with the reading of the forces, of an exact"
        " engine in a plain loop that also assembles. "
    )
    links = [
        (name, f"{_COST}/{folder.name}/{name}") for name in ("cost.md", "cost.csv")
    ]
    return Section(
        f"cost-{folder.name}",
        f"The study of {folder.name}",
        text,
        figures=figures,
        links=links,
    )
