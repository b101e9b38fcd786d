"""Display of a scene and a solution in a notebook, and of a solution by pandas."""

from base64 import b64encode
from html import escape

from fourbar.errors import FourBarError
from fourbar.formulas.mobility import classify
from fourbar.linkage import BAR_NAMES, MOVING_BARS
from fourbar.scene import Scene
from fourbar.scene.motion import BRANCH_NAMES
from fourbar.show.driving import describe_drive
from fourbar.show.plot import draw_figure
from fourbar.show.shown_units import write_ends
from fourbar.show.tables import list_columns
from fourbar.solution import Solution
from fourbar.writing import describe_extent, make_html

POSITIONS_AT_EITHER_END = 5
"""Positions shown at either end of a long sweep."""


def show_scene(scene: Scene) -> str:
    """Draw the linkage above what the scene states.

    The drawing is that of `scene.plot("linkage")`.
    """
    try:
        svg = draw_figure(scene, "linkage")._repr_svg_()
        drawn = b64encode(svg.encode()).decode()
        picture = (
            '<img alt="The linkage" style="width:24em"'
            f' src="data:image/svg+xml;base64,{drawn}">'
        )
    except FourBarError as error:  # a notebook shows the reason, not a traceback
        picture = f"<p>{escape(str(error))}</p>"
    title = scene.title or "Four-bar linkage"
    return picture + make_html(title, (), _list_facts(scene))


def _list_facts(scene: Scene) -> list[tuple[str, str]]:
    motion = scene.motion
    facts = [("type", classify(scene.linkage).name)]
    bars = zip(BAR_NAMES.items(), scene.linkage.lengths, strict=True)
    for (number, name), length in bars:
        text = _write_in_si(length, "m")
        if number in MOVING_BARS and (mass := scene.linkage.bar(number).mass):
            text = f"{text}, {_write_in_si(mass, 'kg')}"
        facts.append((name, text))
    speed = "positions only"
    if motion.speed is not None:
        omega = write_ends(motion.speed, lambda x: _write_in_si(x, "rad/s"))
        alpha = write_ends(motion.acceleration, lambda x: _write_in_si(x, "rad/s^2"))
        speed = f"ω{motion.bar} = {omega}, α{motion.bar} = {alpha}"
    acting = [f"load on bar {load.bar}" for load in scene.loads]
    acting += [effect.key for effect in scene.effects]
    return [
        *facts,
        ("motion", f"{speed}; {BRANCH_NAMES[motion.branch]} branch"),
        ("drive", "released" if motion.free is not None else describe_drive(scene)),
        ("acting", ", ".join(acting) or "nothing"),
    ]


def _write_in_si(number: float, unit: str) -> str:
    return f"{number + 0.0:.6g} {unit}"


def show_solution(solution: Solution) -> str:
    """Show the first and last positions as a table; angles in degrees."""
    extent = describe_extent(solution.theta_2)
    if solution.theta_2.ndim == 2:
        return make_html(f"{solution.title or 'Study'}: {extent}", (), ())
    cells = list_columns(solution)
    rows = [*zip(*cells.values(), strict=True)]
    more = len(rows) - 2 * POSITIONS_AT_EITHER_END
    if more > 0:
        between = slice(POSITIONS_AT_EITHER_END, -POSITIONS_AT_EITHER_END)
        rows[between] = [(f"… {more} more …",)]
    return make_html(f"{solution.title or 'Solution'}: {extent}", [*cells], rows)
