"""The hard cases as a part of report.html: how each family came out, and where to look further."""

from collections.abc import Iterable
from pathlib import Path

from validation.compare.columns import read_columns
from validation.compare.counts import Counts
from validation.compare.rows import VERDICTS, Row
from validation.report.html import Figure, Section
from validation.scenes.hard_families import FAMILIES

KEY, TITLE, FOLDER, PAGE = "hard", "Hard cases", "hard", "hard.html"
ALT = "Error of each engine over the distance to a toggle, a pole of T4 and a change point"
CAPTION = (
    "Error against the formulas, relative to the value itself, towards a singular position. Dotted: the law "
    "K eps/condition. Band: what rounding was computed to do there, up to ten times that; above it a row fails."
)


def section(rows: Iterable[Row], picture: str | None = None) -> Section:
    """Of a run of the hard suite; `picture`: the inline SVG of `validation.report.hard_page`."""
    text = "Each family of singular and extreme linkages must come out as its statement says. "
    figures = [Figure(ALT, CAPTION, svg=picture)] if picture else []
    return _section(rows, text, figures, [("Limits of the engines, and the picture to download: " + PAGE, PAGE)])


def found_in(out: Path) -> Section | None:
    """Of an earlier run of the hard suite into OUT/hard, or None where there is none."""
    folder = out / FOLDER
    results = folder / "results.csv"
    if not (results.is_file() and (folder / PAGE).is_file()):
        return None
    text = (
        f"From the run in {FOLDER}/: each family of singular and extreme linkages must come out as its statement says. "
    )
    links = [(f"{FOLDER}/{name}", f"{FOLDER}/{name}") for name in (PAGE, "report.html")]
    return _section(read_columns(results), text, [], links)


def _section(rows: Iterable[Row], text: str, figures: list[Figure], links: list[tuple[str, str]]) -> Section:
    found = {family.name: Counts() for family in FAMILIES}
    scenes: dict[str, set[str]] = {family.name: set() for family in FAMILIES}
    for row in rows:
        family = family_of(row.scene)
        if family is not None:
            found[family].add([row])
            scenes[family].add(row.scene)
    table = [
        (
            family.name,
            str(len(scenes[family.name])),
            *(str(found[family.name][verdict]) for verdict in VERDICTS),
            found[family.name].word,
            family.statement,
        )
        for family in FAMILIES
        if scenes[family.name]
    ]
    headings = ("family", "scenes", *VERDICTS, "verdict", "what must happen")
    return Section(KEY, TITLE, text, headings, table, figures, links, (1, 2 + len(VERDICTS)))


def family_of(scene: str) -> str | None:
    """The family whose name a scene's begins with; of several the longest."""
    names = [family.name for family in FAMILIES if scene.startswith(family.name.replace(" ", "-") + "-")]
    return max(names, key=len, default=None)
