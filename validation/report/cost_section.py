"""The study of cost as a part of report.html, where `python -m validation cost` has left one."""

import base64
from pathlib import Path

from validation.report.html import Figure, Section

FOLDER = "cost"
PICTURES = {
    "work-precision-force.svg": "Error of the worst pin force over the CPU time of a revolution, for every method",
    "orders.svg": "Error of the driving torque and of each pin force over the time step; a jump is ringed",
    "sources.svg": "Error over time step, softness of the closure and tolerance of the solver, one at a time",
}
"""Pictures of the study, and what they show."""
LARGEST = 2_000_000
"""Bytes of a picture that is taken into the page."""
MOST = 3
"""Scenes whose study is shown."""


def found_in(out: Path) -> list[Section]:
    """One for each scene of which OUT/cost holds a study."""
    folders = sorted(path.parent for path in (out / FOLDER).glob("*/cost.csv"))
    return [_section(folder) for folder in folders[:MOST]]


def _section(folder: Path) -> Section:
    figures = []
    for name, alt in PICTURES.items():
        picture = folder / name
        if picture.is_file() and picture.stat().st_size <= LARGEST:
            data = base64.b64encode(picture.read_bytes()).decode("ascii")
            figures.append(Figure(alt, f"{alt}.", image=f"data:image/svg+xml;base64,{data}"))
    text = (
        f"What each digit of {folder.name} costs, from the study in {FOLDER}/{folder.name}/. Times are per revolution: "
        "what is stepped runs through it once and reads nothing, what is exact answers each of the scene's positions. "
    )
    links = [(name, f"{FOLDER}/{folder.name}/{name}") for name in ("cost.md", "cost.csv")]
    return Section(
        f"cost-{folder.name}", f"The study of {folder.name}", text, figures=figures, links=links, under="cost"
    )
