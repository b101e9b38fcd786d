"""Pictures of the study: work and precision, and each setting by itself.

The settings are those that decide.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

from fourbar.show.plot.labels import add_label, settle_labels
from fourbar.show.plot.style import apply_style
from fourbar.writing import write_text
from fourbar_validation.cost.laws import (
    ERROR_IN_WORDS,
    ERROR_OF_FOUR_DIGITS,
    QUANTITY_WORDS,
    SIX_DIGITS,
    Curves,
    find_cheapest,
    find_default,
    find_pareto,
    list_stepped,
    write_one_digit,
)
from fourbar_validation.cost.work_precision import (
    BEST,
    EXACT_MOTION,
    FORMULAS_CURVE,
    MUJOCO_INVERSE,
    PINOCCHIO,
    CostPoint,
)
from fourbar_validation.report.svg import (
    BAND,
    GRID,
    INK,
    LIGHT_COLOURS,
    PAPER,
    SOFT,
    write_alone,
)

_BLUE, _GREEN, _ORANGE, _PINK, _VIOLET = (LIGHT_COLOURS[f"--e{n}"] for n in range(1, 6))
_DASHED = (0, (4, 2))
_DOTTED = (0, (1, 1.5))
LONG = (0, (7, 2, 1.5, 2))
Style = Mapping[str, Any]
"""Options of matplotlib's `plot`."""


Looks = Mapping[str, tuple[str, Style]]
"""Curve of the study by its label, and how it is drawn. Colour, marker and dashes tell
it apart in grey too.
"""
_STYLES = (
    (_BLUE, "o", "solid"),
    (_ORANGE, "s", _DASHED),
    (_GREEN, "v", _DOTTED),
    (_PINK, "D", LONG),
    (_VIOLET, "P", (0, (5, 1))),
)


def _dress(curves: Mapping[str, str]) -> Looks:
    """Give curves, by their labels, colour, marker and dashes."""
    every = {"mec": PAPER, "mew": 0.5, "ms": 5.0, "lw": 1.7}
    looks = {}
    for label, (colour, marker, dashes) in zip(curves, _STYLES, strict=False):
        own = {"color": colour, "ls": dashes, "marker": marker}
        looks[label] = (curves[label], own | every)
    return looks


INTEGRATOR_LOOKS = _dress(
    {name: f"{name}, tc held" for name in ("RK4", "Euler", "implicitfast", "discrete")}
)
METHOD_LOOKS = _dress(
    {
        "advised": "recommended",
        "Euler, defaults": "Euler, MuJoCo's defaults",
        "RK4, defaults": "RK4, MuJoCo's defaults",
        "Euler, stiff closure": "Euler, tc held",
        "RK4, no pads": "RK4, no pads, tc = 10 steps",
    }
)
TIMESTEPS = _dress(
    {
        "tc a quarter turn": "RK4, tc held",
        **{f"tc = {n} steps": f"RK4, pads, tc = {n} steps" for n in (3, 10, 30, 100)},
    }
)
SOFTNESS_LOOKS = _dress(
    {
        "at the scene's speed": "softness d",
        "at 0.1 rad/s": "sag d, slow",
        "at 0.1 rad/s, nothing acts": "sag d, slow, nothing acts",
    }
)
SOLVERS = _dress({name: f"tolerance, {name}" for name in ("Newton", "PGS", "CG")})
_RING = {"ls": "none", "marker": "o", "ms": 12, "mfc": "none", "mec": INK, "mew": 1.4}
LARGEST_DRAWN_ERROR = 10.0
"""Error from which a point is not drawn."""
_LOWEST = 1e-17
"""Bottom of the picture."""
ZERO_TOLERANCE_PLACE = 1e-18
"""Place on the logarithmic axis at which a tolerance of 0 is drawn."""
TEXT = 9.5


def draw_pictures(
    curves: Curves,
    title: str,
    folder: Path,
) -> list[Path]:
    """Draw all pictures of a scene; the files written."""
    with apply_style():
        written = []
        for name, figure in make_pictures(curves, title).items():
            written.append(folder / f"{name}.svg")
            write_text(written[-1], write_alone(figure, name))
    return written


def make_pictures(curves: Curves, title: str) -> dict[str, Any]:
    """Make the figures of the curves that there are, by name."""
    made = {
        f"work-precision-{quantity}": draw_work_precision(curves, quantity, title)
        for quantity in QUANTITY_WORDS
    }
    for name, picture in SETTING_PICTURES.items():
        if curves.get(picture.needs):
            made[name] = _draw_setting(curves, title, picture)
    return made


def make_figure(
    height: float,
    statement: str,
    title: str,
) -> Any:
    """Make a figure with what it means, and what was run, above it."""
    from matplotlib.figure import Figure

    # width of a picture, in: on a screen of 360 px its texts are still 9 px high
    figure = Figure(figsize=(5.0, height), facecolor=PAPER)
    bold: dict[str, Any] = {
        "fontsize": 10.5,
        "weight": "bold",
        "color": INK,
        "wrap": True,
    }
    figure.text(0.02, 1.0 - 0.1 / height, statement, va="top", **bold)
    below = 1.0 - 0.52 / height
    figure.text(0.02, below, title, fontsize=TEXT, color=SOFT, va="top")
    return figure


def set_axes(axes: Any) -> None:
    """Give logarithmic axes their grid, the size of their texts, and a legend above."""
    axes.set(xscale="log", yscale="log", facecolor=PAPER)
    axes.grid(color=GRID)
    axes.tick_params(which="both", labelsize=TEXT, color=GRID, labelcolor=INK)
    axes.spines[:].set_color(GRID)
    for axis in (axes.xaxis, axes.yaxis):
        axis.label.set(fontsize=TEXT, color=INK)
    if axes.get_legend_handles_labels()[1]:
        axes.legend(
            loc="lower left",
            bbox_to_anchor=(-0.13, 1.01),
            ncols=2,
            fontsize=TEXT,
            labelcolor=INK,
            handlelength=2.4,
            columnspacing=1.0,
        )


def draw_work_precision(curves: Curves, quantity: str, title: str) -> Any:
    """Draw the error of torque or of the worst pin force over the cost.

    Cost is the time of a simulated second. What lies below the picture is put at its
    edge.
    """
    figure = make_figure(6.0, write_statement(curves, quantity), title)
    axes = figure.add_axes((0.135, 0.085, 0.84, 0.675))

    def draw(points: Sequence[CostPoint], name: str = "", **style: Any) -> None:
        """Draw points; a name is written next to the last where it covers nothing."""
        x = [1e3 * point.seconds_per_second for point in points]
        y = [max(point.error(quantity), _LOWEST) for point in points]
        axes.plot(x, y, **style)
        if name:
            add_label(axes, name, complex(x[-1], y[-1]), 1.0, INK, TEXT)

    front = find_pareto(list_stepped(curves), quantity)
    draw(
        front,
        lw=8.0,
        solid_capstyle="round",
        solid_joinstyle="round",
        zorder=1,
        color=BAND,
        label="cheapest of everything stepped",
    )
    for label, (curve, style) in METHOD_LOOKS.items():
        row = curves.get(curve, ())
        row = [point for point in row if point.error(quantity) < LARGEST_DRAWN_ERROR]
        if row:
            draw(row, label=label, **style)
    default = find_default(curves)
    if default is not None and default.error(quantity) < LARGEST_DRAWN_ERROR:
        star = {"marker": "*", "ms": 16, "mec": INK, "mew": 0.8}
        draw([default], "Euler, 2 ms", ls="none", color=_ORANGE, zorder=5, **star)
    digits, priced = _find_price(curves, quantity)
    if priced is not None:
        text = f"{digits.lower()}, {1e3 * priced.seconds_per_second:.2g} ms"
        draw([priced], text, zorder=6, **_RING)
    for point in chain.from_iterable(curves.values()):
        if (
            point.kind in _MARKS
            and _LOWEST <= point.error(quantity) < LARGEST_DRAWN_ERROR
        ):
            marker, colour = _MARKS[point.kind]
            look = {"ls": "none", "marker": marker, "ms": 9, "mec": PAPER, "mew": 0.6}
            text = SHORT.get(point.setting, point.setting)
            draw([point], text, color=colour, zorder=4, **look)
    what = f"error of the {QUANTITY_WORDS[quantity]}, of its scale"
    axes.set_ylabel(what, labelpad=1.0)
    set_axes(axes)
    axes.set_ylim(_LOWEST / 4.0, 3.0)
    low, high = axes.get_xlim()
    axes.set_xlim(low / 1.2, high * 1.5)
    text = "CPU time of a simulated second [ms]"
    if front:
        ratio = front[0].seconds_per_revolution / front[0].seconds_per_second
        text += f"; of a revolution: times {ratio:.3g}"
    axes.set_xlabel(text)
    settle_labels(figure)
    return figure


_MARKS = {EXACT_MOTION: ("h", _GREEN), FORMULAS_CURVE: ("*", INK)}
"""Marker and colour of a method that answers each position by itself."""
SHORT = {
    "formulas, double": "formulas",
    PINOCCHIO: "Pinocchio",
    MUJOCO_INVERSE: "MuJoCo, mj_inverse",
}
"""Short names of methods at their marks."""


def write_statement(curves: Curves, quantity: str) -> str:
    """Say what the picture means: the cost of six digits, the error of the defaults.

    The error is the greatest at the steps and between them, as in the front. Where no
    setting reaches six digits, the cost is that of four.
    """
    name = QUANTITY_WORDS[quantity]
    short = "torque" if quantity == "torque" else "pin force"
    parts = []
    digits, cheapest = _find_price(curves, quantity)
    if cheapest is not None:
        time = 1e3 * cheapest.seconds_per_second
        parts.append(f"{digits} of {short} cost {time:.2g} ms a simulated second")
    default = find_default(curves)
    if default is not None and math.isfinite(default.error(quantity)):
        error = write_one_digit(default.error(quantity))
        parts.append(f"MuJoCo's defaults have an error of {error}")
    return ";\n".join(parts) or f"Error of the {name} against its cost"


def _find_price(curves: Curves, quantity: str) -> tuple[str, CostPoint | None]:
    """Find the cheapest point of the most digits that are asked for and reached.

    Return the words for the digits too.
    """
    for error in (SIX_DIGITS, ERROR_OF_FOUR_DIGITS):
        point = find_cheapest(curves, quantity, error)
        if point is not None:
            return ERROR_IN_WORDS[error], point
    return "", None


_TIMESTEP = "timestep, part of a revolution"


class SettingPicture(NamedTuple):
    """Worst error of torque and pin forces at the steps over one setting."""

    needs: str
    """Curve without which there is no picture."""
    statement: str
    looks: Looks
    xlabel: str

    def find_place(self, point: CostPoint) -> float:
        """Return the abscissa of a point: its setting, or the timestep by its steps."""
        x = point.setting_value
        return max(1.0 / x if self.xlabel == _TIMESTEP else x, ZERO_TOLERANCE_PLACE)


SETTING_PICTURES = {
    "timestep": SettingPicture(
        "RK4, pads, tc = 10 steps",
        "A timestep buys digits until the closure's\ntime constant (tc) stops it",
        TIMESTEPS,
        _TIMESTEP,
    ),
    "integrator": SettingPicture(
        "RK4, tc held",
        "RK4 gains four digits where the others\ngain one",
        INTEGRATOR_LOOKS,
        _TIMESTEP,
    ),
    "softness": SettingPicture(
        "softness d",
        "The error goes as 1 - d; under loads a slow\nlinkage sags, which is far worse",
        SOFTNESS_LOOKS,
        "1 - d (d: impedance of solimp; MuJoCo's own 0.9)",
    ),
    "solver": SettingPicture(
        "tolerance, Newton",
        f"Beside a flywheel of {write_one_digit(BEST.flywheel)} Newton's solver needs\n"
        "a tolerance of 0",
        SOLVERS,
        "tolerance of the solver",
    ),
}
"""Pictures of each setting by itself, by name."""


def _draw_setting(curves: Curves, title: str, picture: SettingPicture) -> Any:
    figure = make_figure(4.4, picture.statement, title)
    axes = figure.add_axes((0.135, 0.12, 0.84, 0.565))
    for label, (curve, style) in picture.looks.items():
        row = sorted(curves.get(curve, ()), key=picture.find_place)
        row = [point for point in row if point.at_steps.worst < LARGEST_DRAWN_ERROR]
        y = [point.at_steps.worst for point in row]
        axes.plot([*map(picture.find_place, row)], y, label=label, **style)
    axes.set_ylabel("worst error of torque and pin forces")
    axes.set_xlabel(picture.xlabel)
    set_axes(axes)
    if picture.looks is SOLVERS:
        named = ["1e-15", "1e-12", "1e-9", "1e-6"]
        places = [ZERO_TOLERANCE_PLACE, *map(float, named)]
        axes.set_xticks(places, ["0", *named])
    return figure
