"""Display of a scene and a solution in a notebook, and of a solution by pandas."""

from base64 import b64encode
from html import escape

from fourbar.errors import FourBarError, expect
from fourbar.formulas.mobility import classify
from fourbar.linkage import BAR_NAMES
from fourbar.scene import Scene
from fourbar.scene.motion import BRANCH_NAMES
from fourbar.show.driving import describe_drive
from fourbar.show.plot import draw_figure
from fourbar.show.tables import list_columns, write_with_unit
from fourbar.show.units import units as read_units
from fourbar.show.units import write_ends
from fourbar.solution import DEGREES, SI, Conversion, Solution
from fourbar.writing import describe_extent

POSITIONS_AT_EITHER_END = 5
"""Positions shown at either end of a long sweep."""


def show_scene(scene: Scene, units: Conversion = SI) -> str:
    """Draw the linkage next to what the scene states.

    The drawing is that of `scene.plot("linkage")`.
    """
    try:
        drawn = b64encode(
            draw_figure(scene, "linkage", units=units)._repr_svg_().encode()
        ).decode()
        picture = (
            '<img alt="The linkage" style="width:100%"'
            f' src="data:image/svg+xml;base64,{drawn}">'
        )
    except FourBarError as error:  # a notebook shows the reason, not a traceback
        picture = f"<p>{escape(str(error))}</p>"
    rows = "".join(
        f'<tr><th style="text-align:left">{escape(name)}</th><td'
        f' style="text-align:left">{escape(text)}</td></tr>'
        for name, text in _list_facts(scene, units)
    )
    return (
        f"<div><b>{escape(scene.title or 'Four-bar linkage')}</b>"
        '<div style="display:flex;flex-wrap:wrap;align-items:center;gap:1em">'
        f'<div style="width:24em">{picture}</div><table>{rows}</table></div></div>'
    )


def _list_facts(scene: Scene, units: Conversion) -> list[tuple[str, str]]:
    motion = scene.motion
    facts = [("type", classify(scene.linkage).name)]
    masses = (0.0, *(bar.mass for bar in scene.linkage.moving))
    for name, length, mass in zip(
        BAR_NAMES.values(),
        scene.linkage.lengths,
        masses,
        strict=True,
    ):
        facts.append(
            (
                name,
                write_with_unit(length, "m", units)
                + (f", {write_with_unit(mass, 'kg', units)}" if mass else ""),
            )
        )
    speed = "positions only"
    if motion.speed is not None:
        omega = write_ends(motion.speed, lambda x: write_with_unit(x, "rad/s", units))
        alpha = write_ends(
            motion.acceleration, lambda x: write_with_unit(x, "rad/s^2", units)
        )
        speed = f"ω{motion.bar} = {omega}, α{motion.bar} = {alpha}"
    acting = [f"load on bar {load.bar}" for load in scene.loads] + [
        effect.key for effect in scene.effects
    ]
    return [
        *facts,
        ("motion", f"{speed}; {BRANCH_NAMES[motion.branch]} branch"),
        ("drive", "released" if motion.free is not None else describe_drive(scene)),
        ("acting", ", ".join(acting) or "nothing"),
    ]


def show_solution(solution: Solution, units: Conversion = DEGREES) -> str:
    """Show the first and last positions as a table; angles in degrees by default."""
    if solution.theta_2.ndim == 2:
        return (
            f"<div><b>{escape(solution.title or 'Study')}</b>:"
            f" {describe_extent(solution.theta_2)}</div>"
        )
    cells = list_columns(solution, units)
    count = len(solution)
    if count <= 2 * POSITIONS_AT_EITHER_END:
        places = list(range(count))
    else:
        places = [
            *range(POSITIONS_AT_EITHER_END),
            *range(count - POSITIONS_AT_EITHER_END, count),
        ]
    head = "".join(
        f"<th>{escape(name.strip()).replace(chr(10), '<br>')}</th>" for name in cells
    )
    lines = []
    for place in places:
        if (
            count > 2 * POSITIONS_AT_EITHER_END
            and place == count - POSITIONS_AT_EITHER_END
        ):
            more = f"… {count - 2 * POSITIONS_AT_EITHER_END} more …"
            lines.append(
                f'<tr><td colspan="{len(cells)}"'
                f' style="text-align:center">{more}</td></tr>'
            )
        lines.append(
            "<tr>"
            + "".join(f"<td>{escape(column[place])}</td>" for column in cells.values())
            + "</tr>"
        )
    title = escape(solution.title or "Solution")
    positions = f"{count} position{'s' if count != 1 else ''}"
    table = (
        f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(lines)}</tbody></table>"
    )
    return f"<div><b>{title}</b>: {positions}{table}</div>"


class InUnits:
    """A scene or a solution that a notebook shows in other units."""

    def __init__(self, shown: Scene | Solution, units: str) -> None:
        expect("shown", shown, Scene, Solution)
        self.shown: Scene | Solution = shown
        self.units: Conversion = read_units(units)

    def _repr_html_(self) -> str:
        if isinstance(self.shown, Solution):
            return show_solution(self.shown, {**DEGREES, **self.units})
        return show_scene(self.shown, self.units)


def in_units(shown: "Scene | Solution", units: str) -> InUnits:
    """Return a scene or a solution that a notebook shows in other units.

    `units` is "imperial", or a list like "mm N.mm".

    Raises InputError for a word that is no unit of a result, and for two units of one
    dimension.
    """
    return InUnits(shown, units)
