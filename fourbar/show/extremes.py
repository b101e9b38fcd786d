"""What `fourbar extremes` prints: each enclosure with its angle, and over what it holds."""

from typing import TYPE_CHECKING, Any

from fourbar.scene import Scene
from fourbar.show.tables import make_plain_table, write_value
from fourbar.solution import DEGREES, Conversion, find_unit, find_unit_in
from fourbar.studies.enclosure import PROVEN, Extremes
from fourbar.writing import write_object

if TYPE_CHECKING:
    from rich.table import Table

SCHEMA = "fourbar-extremes/1"


def write_heading(scene: Scene, found: Extremes, units: Conversion = DEGREES) -> list[str]:
    """Write the lines above the table."""
    unit, factor = find_unit_in("rad", units)
    parts = " and ".join(f"{low * factor:.6g} to {high * factor:.6g}" for low, high in found.parts)
    lines = [f"guaranteed over theta_2 = {parts} {unit}, by interval arithmetic in {found.boxes} pieces of it"]
    if found.distance:
        lines.append(
            f"left out: theta_2 within {write_value(found.distance, 'rad', units)} "
            "of a limit of the input or of a pole of "
            "the drive, where the loads grow without bound"
        )
    if found.nominal is None:
        lines.append(
            f"each extreme lies between the two numbers given, which differ by about {PROVEN:g} of the largest load"
        )
    else:
        lines.append(
            f"for every linkage within the {len(scene.tolerances)} tolerances (within three sigma where one is normal):"
            " none goes beyond the outer number, the inner number is that of a linkage that was tried; over-estimate: "
            "how many times as far from the nominal extreme the outer number lies as the inner one"
        )
    return lines


def make_table(found: Extremes, units: Conversion = DEGREES) -> "Table":
    """Two rows for each quantity."""
    rows, (angle_unit, of_angle) = [], find_unit_in("rad", units)
    for name in found.least:
        unit, factor = find_unit_in("rad" if name == "transmission" else find_unit(name.strip("|")), units)
        for word, sign, extreme in (("least", -1, found.least[name]), ("greatest", 1, found.greatest[name])):
            ends = (f"{factor * extreme.low:.11g}", f"{factor * extreme.high:.11g}")
            rows.append([name, unit, word, *ends, f"{of_angle * extreme.theta_2:.6f}"])
            if found.nominal is not None:
                over = found.over_estimate(name, sign)
                rows[-1].append("-" if over is None else f"{over:.3g} times")
    heads = ("", "unit", "", "from", "to", f"theta_2 ({angle_unit})", *(["over-estimate"] if found.nominal else []))
    return make_plain_table(heads, rows, left=("", "unit", "over-estimate"))


def write_json(scene: Scene, found: Extremes) -> str:
    """One object, SI and rad."""

    def rows(of: Extremes) -> dict[str, Any]:
        return {name: {"least": of.least[name], "greatest": of.greatest[name]} for name in of.least}

    return write_object(
        SCHEMA,
        title=scene.title,
        theta_2=found.parts,
        distance_from_poles=found.distance,
        boxes=found.boxes,
        extremes=rows(found),
        nominal=None if found.nominal is None else rows(found.nominal),
        over_estimate={
            name: {word: found.over_estimate(name, sign) for word, sign in (("least", -1), ("greatest", 1))}
            for name in found.least
        },
    )
