"""Display of a scene and a solution in a notebook, and of a solution by pandas."""

from base64 import b64encode
from html import escape

from fourbar.errors import FourBarError
from fourbar.files import dump
from fourbar.formulas.mobility import classify
from fourbar.scene import Scene
from fourbar.show.plot import draw_figure
from fourbar.show.tables import list_columns
from fourbar.solution import Solution
from fourbar.writing import describe_extent, make_html

POSITIONS_AT_EITHER_END = 5
"""Positions shown at either end of a long sweep."""


def show_scene(scene: Scene) -> str:
    """Return HTML: the drawing of the linkage, its type, and the text of the scene.

    The drawing is that of `scene.plot("linkage")`, the text in SI and radians. Where
    one of them cannot be made, the reason stands in its place.
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
    try:
        text = dump(scene)
    except FourBarError as error:
        text = str(error)
    name = escape(classify(scene.linkage).name)
    return f"{picture}<b>{name}</b><pre>{escape(text)}</pre>"


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
