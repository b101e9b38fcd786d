"""What `fourbar extremes` prints: each enclosure with its angle, and over what it holds."""

import json
import math
from typing import TYPE_CHECKING, Any

from fourbar.quantities import UNITS
from fourbar.scene import Scene
from fourbar.show.tables import plain_table
from fourbar.studies.enclosure import PROVEN, Extremes

if TYPE_CHECKING:
    from rich.table import Table

SCHEMA = "fourbar-extremes/1"


def heading(scene: Scene, found: Extremes) -> list[str]:
    """Write the lines above the table."""
    parts = " and ".join(f"{math.degrees(low):.6g} to {math.degrees(high):.6g}" for low, high in found.parts)
    lines = [f"proven over theta_2 = {parts} deg, in {found.boxes} boxes of ball arithmetic"]
    if found.distance:
        lines.append(
            f"nearer than {math.degrees(found.distance):g} deg to a limit of the input, or to a pole of the drive, "
            "nothing is proven: there the loads grow without end"
        )
    if found.nominal is None:
        lines.append(f"each extreme lies between its two numbers, as a rule {PROVEN:g} of the largest load apart")
    else:
        lines.append(
            f"for every linkage within the {len(scene.tolerances)} tolerances (three sigma of a normal one): the outer "
            "number is proven, the inner one is reached by a linkage that was found"
        )
    return lines


def table(found: Extremes) -> "Table":
    """Two rows for each quantity."""
    rows = []
    for name in found.least:
        unit, factor = _unit(name)
        for word, sign, extreme in (("least", -1, found.least[name]), ("greatest", 1, found.greatest[name])):
            ends = (f"{factor * extreme.low:.11g}", f"{factor * extreme.high:.11g}")
            rows.append([name, unit, word, *ends, f"{math.degrees(extreme.theta_2):.6f}"])
            if found.nominal is not None:
                over = found.over_estimate(name, sign)
                rows[-1].append("-" if over is None else f"{over:.3g} times")
    heads = ("", "unit", "", "from", "to", "theta_2 (deg)", *(["over-estimate"] if found.nominal else []))
    return plain_table(heads, rows, left=("", "unit", "over-estimate"))


def _unit(name: str) -> tuple[str, float]:
    if name == "transmission":
        return "deg", 180.0 / math.pi
    return UNITS.get(name, "N"), 1.0


def json_text(scene: Scene, found: Extremes) -> str:
    """One object, SI and rad."""

    def rows(of: Extremes) -> dict[str, Any]:
        return {name: {"least": of.least[name]._asdict(), "greatest": of.greatest[name]._asdict()} for name in of.least}

    document = {
        "schema": SCHEMA,
        "title": scene.title,
        "theta_2": found.parts,
        "distance_from_poles": found.distance,
        "boxes": found.boxes,
        "extremes": rows(found),
        "nominal": None if found.nominal is None else rows(found.nominal),
        "over_estimate": {
            name: {"least": found.over_estimate(name, -1), "greatest": found.over_estimate(name, 1)}
            for name in found.least
        },
    }
    return json.dumps(document, allow_nan=False) + "\n"
