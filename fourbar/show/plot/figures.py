"""The figures by name, and how a scene becomes a file."""

import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fourbar.errors import InputError
from fourbar.linkage import require
from fourbar.scene import Scene
from fourbar.show.columns import explain_static
from fourbar.show.motion_curves import describe_motion
from fourbar.show.plot import curves, derived, freebody, linkage
from fourbar.show.plot.curves import draw_transmission
from fourbar.show.plot.labels import Labels
from fourbar.show.plot.style import (
    CAPTION_STYLE,
    TITLE,
    Drawing,
    apply_style,
    format_of,
    shorten_text,
)
from fourbar.show.plot.view import (
    View,
    is_over_time,
    make_view,
)
from fourbar.solution import SI, Conversion, require_units

if TYPE_CHECKING:
    from matplotlib.figure import Figure, SubFigure

_Painter = Callable[["SubFigure", View, Labels], None]


def _draw_overview(figure: "SubFigure", shown: View, labels: Labels) -> None:
    free = shown.scene.motion.free is not None
    layout: list[Any]
    widths = None
    if not shown.moves:
        layout = [["linkage", "angles"], ["linkage", "mu"]]
        widths = [1.15, 1.0]
    elif shown.rests:
        layout = [
            ["linkage", "linkage", "torque"],
            ["linkage", "linkage", "angles"],
            ["forces", "forces", "mu"],
        ]
    else:
        layout = [
            ["linkage", "linkage", "torque"],
            ["linkage", "linkage", "forces" if free else "power"],
            ["angles", "omega", "alpha"],
            ["mu", "mu", "mu"] if free else ["forces", "forces", "mu"],
        ]
    panels = figure.subplot_mosaic(layout, width_ratios=widths)
    linkage.draw_linkage(panels["linkage"], shown, labels)
    painters: dict[str, Callable[[Any, View], None]] = {
        "angles": curves.draw_angles,
        "omega": curves.draw_velocities,
        "alpha": curves.draw_accelerations,
        # what drives; in a free motion the work of loads and effects
        "torque": curves.draw_energy if free else curves.draw_drive,
        "power": curves.draw_power,
        "forces": curves.draw_forces,
        "mu": draw_transmission,
    }
    for name, paint in painters.items():
        if name in panels:
            paint(panels[name], shown)


def _draw_kinematics(figure: "SubFigure", shown: View, labels: Labels) -> None:
    has_rates = shown.moves and not shown.rests
    panels = figure.subplots(3 if has_rates else 1, 1, squeeze=False)[:, 0]
    painters: tuple[Any, ...] = (
        curves.draw_angles,
        curves.draw_velocities,
        curves.draw_accelerations,
    )
    for axes, paint in zip(panels, painters, strict=False):
        paint(axes, shown)


def _draw_points(figure: "SubFigure", shown: View, labels: Labels) -> None:
    """Draw paths, speeds and accelerations of points."""
    panels = figure.subplot_mosaic(
        [["linkage", "speeds"], ["linkage", "accelerations"]],
        width_ratios=[1.15, 1.0],
    )
    linkage.draw_linkage(panels["linkage"], shown, labels, moving=True)
    curves.draw_speeds(panels["speeds"], shown)
    curves.draw_point_accelerations(panels["accelerations"], shown)


def _draw_one_panel(paint: Callable[[Any, View], None]) -> _Painter:
    return lambda figure, shown, labels: paint(figure.subplots(), shown)


def _draw_rows(*painters: Callable[[Any, View], None]) -> _Painter:
    """Draw panels below each other."""

    def paint(figure: "SubFigure", shown: View, labels: Labels) -> None:
        for axes, painter in zip(
            figure.subplots(len(painters), 1),
            painters,
            strict=True,
        ):
            painter(axes, shown)

    return paint


FIGURES: dict[str, tuple[_Painter, tuple[float, float], bool]] = {
    "overview": (_draw_overview, (7.7, 9.2), False),
    "linkage": (
        lambda figure, *of: linkage.draw_linkage(figure.subplots(), *of),
        (5.6, 5.2),
        False,
    ),
    "coupler": (
        lambda figure, *of: linkage.draw_coupler_curves(figure.subplots(), *of),
        (5.6, 5.4),
        False,
    ),
    "kinematics": (_draw_kinematics, (5.6, 6.8), False),
    "points": (_draw_points, (11.0, 5.6), True),
    "torque": (_draw_one_panel(curves.draw_drive), (5.6, 3.2), True),
    "stroke": (_draw_one_panel(curves.draw_stroke), (5.6, 3.2), False),
    "forces": (_draw_one_panel(curves.draw_forces), (5.6, 3.2), True),
    "energy": (_draw_one_panel(curves.draw_energy), (5.6, 3.2), True),
    "transmission": (_draw_one_panel(draw_transmission), (5.6, 3.2), False),
    "shaking": (
        _draw_rows(derived.draw_shaking_force, derived.draw_shaking_moment),
        (5.6, 5.4),
        True,
    ),
    "ratios": (
        _draw_rows(derived.draw_speed_ratios, derived.draw_advantage),
        (5.6, 5.4),
        False,
    ),
    "centres": (
        lambda figure, *of: derived.draw_centres(figure.subplots(), *of),
        (5.6, 5.4),
        False,
    ),
    "freebody": (freebody.draw_free_bodies, (9.6, 4.6), True),
    "bars": (freebody.draw_internal_forces, (9.6, 6.2), True),
}
"""Painter of each figure, size of one branch in inches, and need of omega_2."""
TAKERS = {
    "position": tuple(name for name in FIGURES if name != "bars"),
    "dimensions": ("overview", "linkage", "points"),
}
"""Figures in which one position is marked, and in which bars are numbered."""


def _choose_painter(scene: Scene, figure: str) -> tuple[_Painter, tuple[float, float]]:
    """Choose the painter and the size of a figure that the scene can show."""
    if not isinstance(figure, str) or figure not in FIGURES:
        raise InputError("figure", figure, "must be one of " + ", ".join(FIGURES))
    painter, size, dynamic = FIGURES[figure]
    if dynamic and scene.motion.speed is None and not is_over_time(scene):
        raise InputError(
            f"motion.{scene.motion.names[1]}",
            None,
            f"is needed for the figure {figure!r}; {explain_static(scene)}",
        )
    stroked = scene.drive is not None and scene.drive.has_stroke
    if figure == "stroke" and (not stroked or scene.motion.stroke is not None):
        raise InputError(
            "figure",
            figure,
            "needs a linear drive (drive.from, drive.to) whose stroke is not commanded",
        )
    if figure == "energy" and scene.motion.free is None:
        raise InputError("figure", figure, "needs a free motion: motion.free")
    if figure == "torque" and scene.motion.free is not None:
        raise InputError(
            "figure",
            figure,
            "a free motion has no driving torque; energy shows what moves it",
        )
    return painter, size


def draw_figure(
    scene: Scene,
    figure: str = "overview",
    *,
    position: float | None = None,
    units: Conversion = SI,
    dimensions: bool = False,
) -> Drawing:
    """Draw a figure of a scene for a notebook.

    `Scene.plot` describes the parameters.
    """
    painter, size = _choose_painter(scene, figure)
    require_units(units)
    for key, value in (("position", position), ("dimensions", dimensions or None)):
        if value is not None and figure not in TAKERS[key]:
            raise InputError(
                key,
                value,
                f"must be left out of {figure}; it shows in {', '.join(TAKERS[key])}",
            )
    if position is not None:
        position = require("position", position)
    with apply_style():
        shown = make_view(scene, position)
        shown.units = units
        shown.dimensions = dimensions
        _look_between(shown)
        return Drawing(_compose(painter, size, shown))


def _look_between(shown: View) -> None:
    """Add what lies between the positions of the sweep.

    Jumps are drawn where they are, peaks to their height.
    """
    motion = describe_motion(shown.sweep)
    shown.sweep = motion.solve_with_peaks()
    if motion.reversals:
        axis = shown.axis
        places = ", ".join(
            f"{axis.factor * place:.4g}{axis.unit} ({pin})"
            for place, pin in motion.reversals
        )
        shown.notes.append(
            f"Dry friction reverses, and the pin forces jump, at {axis.symbol} ="
            f" {places}.".replace("-", "−")
        )


def draw(
    scene: Scene,
    path: str | Path,
    figure: str = "overview",
    **options: Any,
) -> None:
    """Draw a figure of a scene, as `draw_figure` does, into a file.

    The same scene gives the same bytes.
    """
    format_of(path)
    draw_figure(scene, figure, **options).save(path)


def _compose(painter: _Painter, size: tuple[float, float], shown: View) -> "Figure":
    """Compose the figure itself, laid out and labelled."""
    from matplotlib.figure import Figure

    width, _ = size
    figure = Figure(figsize=size, layout="constrained")
    (part,) = figure.subfigures(squeeze=False).ravel()
    labels = Labels()
    painter(part, shown, labels)
    heading = shorten_text(shown.scene.title, 90) or "Four-bar linkage"
    part.suptitle(heading, **TITLE)
    caption = textwrap.fill(" ".join(shown.notes), int(width * 18.5))
    if caption:
        part.supxlabel(caption, linespacing=1.35, **CAPTION_STYLE)
    labels.settle(figure)
    return figure
