"""Parts of report.html besides the scenes: the hard cases by family, limits, links."""

from collections.abc import Iterable
from pathlib import Path

from fourbar_validation.compare.rows import VERDICTS, Counts, Row
from fourbar_validation.report.html import Section
from fourbar_validation.scenes.hard_families import HARD_FAMILIES


def collect_sections(hard: Iterable[Row] | None, out: Path) -> list[Section]:
    """Collect the section on hard cases, and links to what lies beside the report.

    `hard`: rows of a run of the hard suite, which has the limits of the engines too.
    """
    sections = []
    if hard is not None:
        sections += [collect_hard_cases(hard), _list_declared_limits()]
    pages = [*out.glob("hard/report.html"), *sorted(out.glob("cost/*/cost.md"))]
    if pages:
        names = [page.relative_to(out).as_posix() for page in pages]
        links = [(name, name) for name in names]
        text = "Hard cases and studies of cost that lie beside this report:"
        sections.append(Section("beside", "Beside this report", text, links=links))
    return sections


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
    text = "Each family of singular and extreme linkages must come out as stated."
    numbers = (1, 2 + len(VERDICTS))
    return Section("hard", "Hard cases", text, headings, table, numbers=numbers)


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
