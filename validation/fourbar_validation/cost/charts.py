"""Pictures of the study: work and precision, and each setting by itself.

The settings are those that decide.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from fourbar.show.plot.labels import Label, Labels
from fourbar.show.plot.style import Drawing, apply_style
from fourbar.writing import write_text
from fourbar_validation.advise.worst_errors import ERROR_NAMES
from fourbar_validation.cost.conclusion import (
    ERROR_IN_WORDS,
    ERROR_OF_FOUR_DIGITS,
    QUANTITY_WORDS,
    SIX_DIGITS,
    Curves,
    find_cheapest,
    find_default,
    list_stepped,
    write_one_digit,
)
from fourbar_validation.cost.laws import LARGEST_LAWFUL_ERROR, find_jumps, find_pareto
from fourbar_validation.cost.series import BEST
from fourbar_validation.cost.work_precision import (
    EXACT_MOTION,
    FORMULAS_CURVE,
    MUJOCO_INVERSE,
    PINOCCHIO,
    STEPPED_MOTION,
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


class Look(NamedTuple):
    """Curve of the study, and how it is drawn.

    Colour, marker and dashes tell it apart in grey too.
    """

    curve: str
    colour: str
    marker: str
    dashes: Any = "solid"


_DASHED = (0, (4, 2))
_DOTTED = (0, (1, 1.5))
LONG = (0, (7, 2, 1.5, 2))
INTEGRATOR_LOOKS = {
    "Euler": Look("Euler, tc held", _ORANGE, "s", _DASHED),
    "implicitfast": Look("implicitfast, tc held", _PINK, "v", _DOTTED),
    "discrete": Look("discrete, tc held", _GREEN, "D", LONG),
    "RK4": Look("RK4, tc held", _BLUE, "o"),
}
METHOD_LOOKS = {
    "Euler, defaults": Look("Euler, MuJoCo's defaults", _ORANGE, "s", _DASHED),
    "RK4, defaults": Look("RK4, MuJoCo's defaults", _PINK, "D", _DOTTED),
    "Euler, stiff closure": Look("Euler, tc held", _GREEN, "v", LONG),
    "RK4, no pads": Look("RK4, no pads, tc = 10 steps", _VIOLET, "P", (0, (5, 1))),
    "advised": Look("recommended", _BLUE, "o"),
}
TIMESTEPS = {
    "tc = 3 steps": Look("RK4, pads, tc = 3 steps", _ORANGE, "s", _DASHED),
    "tc = 10 steps": Look("RK4, pads, tc = 10 steps", _PINK, "D", _DOTTED),
    "tc = 30 steps": Look("RK4, pads, tc = 30 steps", _GREEN, "v", LONG),
    "tc = 100 steps": Look("RK4, pads, tc = 100 steps", _VIOLET, "P", (0, (5, 1))),
    "tc a quarter turn": Look("RK4, tc held", _BLUE, "o"),
}
SOFTNESS_LOOKS = {
    "at the scene's speed": Look("softness d", _BLUE, "o"),
    "at 0.1 rad/s": Look("sag d, slow", _ORANGE, "s", _DASHED),
    "at 0.1 rad/s, nothing acts": Look(
        "sag d, slow, nothing acts",
        _GREEN,
        "^",
        _DOTTED,
    ),
}
SOLVERS = {
    "Newton": Look("tolerance, Newton", _BLUE, "o"),
    "PGS": Look("tolerance, PGS", _ORANGE, "s", _DASHED),
    "CG": Look("tolerance, CG", _GREEN, "^", _DOTTED),
}
LARGEST_DRAWN_ERROR = 10.0
"""Largest error over the timestep that is drawn in its place. A larger one, and one
without end, is drawn at the upper edge.
"""
_LOWEST = 1e-17
"""Bottom of the picture; fifty digits lie far below and are not drawn."""
ZERO_TOLERANCE_PLACE = 1e-18
"""Place on the logarithmic axis at which a tolerance of 0 is drawn."""
PICTURE_WIDTH = 5.0
"""Width of a picture, in: on a screen of 360 px its texts are still 9 px high."""
TEXT = 9.5
_NEAR_FRONT = 1.1
"""Time over that of the cheapest within which an advised setting is one of them."""


def draw_pictures(
    curves: Curves,
    title: str,
    folder: Path,
) -> list[Path]:
    """Draw all pictures of a scene as SVG and PNG; the files written."""
    with apply_style():
        made = make_pictures(curves, title)
        written = []
        for name, figure in made.items():
            written.append(folder / f"{name}.svg")
            write_text(written[-1], write_alone(figure, name))
            written.append(folder / f"{name}.png")
            Drawing(figure).save(written[-1])
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
    if curves.get("RK4, tc held"):
        made["orders"] = draw_orders(curves, title)
    return made


def _draw_look(
    axes: Any,
    x: Sequence[float],
    y: Sequence[float],
    label: str,
    look: Look,
) -> None:
    """Draw a curve in its colour, with its marker and line."""
    axes.plot(
        x,
        y,
        label=label,
        color=look.colour,
        ls=look.dashes,
        marker=look.marker,
        mec=PAPER,
        mew=0.5,
        ms=5.0,
        lw=1.7,
    )


def make_figure(
    height: float,
    statement: str,
    title: str,
) -> Any:
    """Make a figure with what it means, and what was run, above it."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(PICTURE_WIDTH, height), facecolor=PAPER)
    figure.text(
        0.02,
        1.0 - 0.1 / height,
        statement,
        fontsize=10.5,
        weight="bold",
        color=INK,
        va="top",
        wrap=True,
    )
    figure.text(
        0.02,
        1.0 - 0.52 / height,
        title,
        fontsize=TEXT,
        color=SOFT,
        va="top",
    )
    return figure


def set_axes(axes: Any) -> None:
    """Give logarithmic axes their grid, the size of their texts, and a legend above."""
    axes.set(xscale="log", yscale="log")
    axes.set_facecolor(PAPER)
    axes.grid(visible=True, which="major", color=GRID, lw=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(which="both", labelsize=TEXT, color=GRID, labelcolor=INK)
    axes.spines[:].set_color(GRID)
    for axis in (axes.xaxis, axes.yaxis):
        axis.label.set_fontsize(TEXT)
        axis.label.set_color(INK)
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


def draw_work_precision(
    curves: Curves,
    quantity: str,
    title: str,
) -> Any:
    """Draw the error of torque or of the worst pin force over the cost.

    Cost is the time of a simulated second.
    """
    height = 6.0
    figure = make_figure(height, write_statement(curves, quantity), title)
    axes = figure.add_axes((0.135, 0.085, 0.84, 0.675))
    labels = Labels()
    front = find_pareto(list_stepped(curves), quantity)
    broad = {"lw": 8.0, "solid_capstyle": "round", "solid_joinstyle": "round"}
    axes.plot(
        *_take_coordinates(front, quantity),
        **broad,
        zorder=1,
        color=BAND,
        label="cheapest of everything stepped",
    )
    labels.keep_off(axes, *map(complex, *_take_coordinates(front, quantity)), width=8.0)
    for name, look in METHOD_LOOKS.items():
        label = name
        if look.curve == "recommended":
            most = _measure_distance(curves, quantity)
            label += "" if most <= _NEAR_FRONT else f", up to {most:.1f} times as long"
        row = [
            point
            for point in curves.get(look.curve, ())
            if getattr(point.errors, quantity) < LARGEST_DRAWN_ERROR
        ]
        if row:
            _draw_look(axes, *_take_coordinates(row, quantity), label, look)
            places = map(complex, *_take_coordinates(row, quantity))
            labels.keep_off(axes, *places, width=1.8)
    default = find_default(curves)
    if default is not None and getattr(default.errors, quantity) < LARGEST_DRAWN_ERROR:
        place = _take_coordinates([default], quantity)
        axes.plot(*place, marker="*", ms=16, color=_ORANGE, mec=INK, mew=0.8, zorder=5)
        _name_point(labels, axes, default, quantity, "Euler, 2 ms")
    _mark_price(labels, axes, curves, quantity)
    for point in (point for row in curves.values() for point in row):
        _mark_exact(labels, axes, point, quantity)
    axes.set_ylabel(
        f"error of the {QUANTITY_WORDS[quantity]}, of its scale",
        labelpad=1.0,
    )
    set_axes(axes)
    axes.set_ylim(_LOWEST / 4.0, 3.0)
    low, high = axes.get_xlim()
    axes.set_xlim(low / 1.2, high * 1.5)
    _name_time(axes, front)
    labels.settle(figure)
    return figure


def _take_coordinates(
    points: Sequence[CostPoint],
    quantity: str,
) -> tuple[list[float], list[float]]:
    """Return ms of a simulated second, and errors.

    What lies below the picture is put at its edge.
    """
    errors = [max(getattr(point.errors, quantity), _LOWEST) for point in points]
    return [1e3 * point.seconds_per_second for point in points], errors


def _name_time(axes: Any, front: Sequence[CostPoint]) -> None:
    """Say what the time is of, and what part of it a revolution takes."""
    text = "CPU time of a simulated second [ms]"
    if front:
        ratio = front[0].seconds_per_revolution / front[0].seconds_per_second
        text += f"; of a revolution: times {ratio:.3g}"
    axes.set_xlabel(text)


def _name_point(
    labels: Labels,
    axes: Any,
    point: CostPoint,
    quantity: str,
    text: str,
) -> None:
    """Write next to a point, where it covers nothing."""
    (x,), (y,) = _take_coordinates([point], quantity)
    labels.keep_off(axes, complex(x, y))
    labels.add(Label(axes, text, complex(x, y), complex(0.5 * x, y), INK, TEXT))


def _mark_exact(
    labels: Labels,
    axes: Any,
    point: CostPoint,
    quantity: str,
) -> None:
    """Mark a method that answers each position by itself."""
    marks = {EXACT_MOTION: ("h", _GREEN), FORMULAS_CURVE: ("*", INK)}
    value = getattr(point.errors, quantity)
    if point.kind == STEPPED_MOTION or not math.isfinite(point.seconds_per_second):
        return
    if not _LOWEST <= value < LARGEST_DRAWN_ERROR:
        return
    marker, colour = marks[point.kind]
    axes.plot(
        *_take_coordinates([point], quantity),
        marker=marker,
        ms=9,
        color=colour,
        mec=PAPER,
        mew=0.6,
        zorder=4,
    )
    _name_point(labels, axes, point, quantity, SHORT.get(point.setting, point.setting))


SHORT = {
    "formulas, double": "formulas",
    "formulas, single": "formulas, float32",
    "13x13": "13 equations",
    PINOCCHIO: "Pinocchio",
    MUJOCO_INVERSE: "MuJoCo, mj_inverse",
}
"""Short names of methods at their marks."""


def write_statement(curves: Curves, quantity: str) -> str:
    """Say what the picture means: the cost of six digits, the error of the defaults.

    The error is the greatest at the steps and between them, as in the front. Where no
    setting reaches six digits, the cost is that of four.
    """
    digits, cheapest = _find_price(curves, quantity)
    default = find_default(curves)
    if quantity == "torque":
        name = QUANTITY_WORDS[quantity].split()[-1]
    else:
        name = "pin force"
    parts = []
    if cheapest is not None:
        parts.append(
            f"{digits} of {name} cost {1e3 * cheapest.seconds_per_second:.2g} ms "
            "a simulated second"
        )
    if default is not None:
        error = getattr(default.errors, quantity)
        if math.isfinite(error):
            parts.append(f"MuJoCo's defaults have an error of {write_one_digit(error)}")
    return (
        ";\n".join(parts) or f"Error of the {QUANTITY_WORDS[quantity]} against its cost"
    )


def _find_price(curves: Curves, quantity: str) -> tuple[str, CostPoint | None]:
    """Find the cheapest point of the most digits that are asked for and reached.

    Return the words for the digits too.
    """
    for error in (SIX_DIGITS, ERROR_OF_FOUR_DIGITS):
        point = find_cheapest(curves, quantity, error)
        if point is not None:
            return ERROR_IN_WORDS[error], point
    return "", None


def _mark_price(
    labels: Labels,
    axes: Any,
    curves: Curves,
    quantity: str,
) -> None:
    """Ring the point that the title prices, with its digits and time."""
    digits, point = _find_price(curves, quantity)
    if point is None:
        return
    axes.plot(
        *_take_coordinates([point], quantity),
        ls="none",
        marker="o",
        ms=12,
        mfc="none",
        mec=INK,
        mew=1.4,
        zorder=6,
    )
    text = f"{digits.lower()}, {1e3 * point.seconds_per_second:.2g} ms"
    _name_point(labels, axes, point, quantity, text)


def _measure_distance(curves: Curves, quantity: str) -> float:
    """Return the greatest time of an advised setting over that of the front.

    The error is the same.
    """
    front = find_pareto(list_stepped(curves), quantity)
    most = 1.0
    for point in curves.get("recommended", ()):
        error = getattr(point.errors, quantity)
        cheaper = [
            other.seconds_per_second
            for other in front
            if getattr(other.errors, quantity) <= error
        ]
        if cheaper:
            most = max(most, point.seconds_per_second / min(cheaper))
    return most


def _take_timestep(point: CostPoint) -> float:
    """Return the timestep as a part of a revolution."""
    return 1.0 / point.setting_value


class SettingPicture(NamedTuple):
    """Worst error of torque and pin forces at the steps over one setting."""

    needs: str
    """Curve without which there is no picture."""
    statement: str
    looks: Mapping[str, Look]
    abscissa: Callable[[CostPoint], float]
    xlabel: str
    slopes: tuple[tuple[float, float, float], ...] = ()
    """Exponents that are drawn, and where."""


_TIMESTEP = "timestep, part of a revolution"
SETTING_PICTURES = {
    "timestep": SettingPicture(
        "RK4, pads, tc = 10 steps",
        "A timestep buys digits until the closure's\ntime constant (tc) stops it",
        TIMESTEPS,
        _take_timestep,
        _TIMESTEP,
    ),
    "integrator": SettingPicture(
        "RK4, tc held",
        "RK4 gains four digits where the others\ngain one",
        INTEGRATOR_LOOKS,
        _take_timestep,
        _TIMESTEP,
        ((1.0, 4e-4, 2e-4), (4.0, 3e-3, 1e-9)),
    ),
    "softness": SettingPicture(
        "softness d",
        "The error goes as 1 - d; under loads a slow\nlinkage sags, which is far worse",
        SOFTNESS_LOOKS,
        lambda point: point.setting_value,
        "1 - d (d: impedance of solimp; MuJoCo's own 0.9)",
        ((1.0, 2e-3, 1e-5),),
    ),
    "solver": SettingPicture(
        "tolerance, Newton",
        f"Beside a flywheel of {write_one_digit(BEST.flywheel)} Newton's solver needs\n"
        "a tolerance of 0",
        SOLVERS,
        lambda point: point.setting_value or ZERO_TOLERANCE_PLACE,
        "tolerance of the solver",
    ),
}
"""Pictures of each setting by itself, by name."""


def _draw_setting(curves: Curves, title: str, picture: SettingPicture) -> Any:
    figure = make_figure(4.4, picture.statement, title)
    axes = figure.add_axes((0.135, 0.12, 0.84, 0.565))
    for label, look in picture.looks.items():
        row = [
            point
            for point in curves.get(look.curve, ())
            if point.at_steps.worst < LARGEST_DRAWN_ERROR
        ]
        row.sort(key=picture.abscissa)
        y = [point.at_steps.worst for point in row]
        _draw_look(axes, [*map(picture.abscissa, row)], y, label, look)
    axes.set_ylabel("worst error of torque and pin forces")
    axes.set_xlabel(picture.xlabel)
    set_axes(axes)
    for slope in picture.slopes:
        _draw_slope(axes, *slope)
    if picture.looks is SOLVERS:
        axes.set_xticks(
            [ZERO_TOLERANCE_PLACE, 1e-15, 1e-12, 1e-9, 1e-6],
            ["0", "1e-15", "1e-12", "1e-9", "1e-6"],
        )
    return figure


def _draw_slope(
    axes: Any,
    exponent: float,
    x: float,
    y: float,
) -> None:
    """Draw a slope with its exponent next to it."""
    axes.plot([x, 4.0 * x], [y, y * 4.0**exponent], color=INK, lw=1.0)
    axes.annotate(
        f"slope {exponent:g}",
        (2.0 * x, y * 2.0**exponent),
        xytext=(6, -10),
        textcoords="offset points",
        fontsize=TEXT,
        color=INK,
    )


def _draw_over_timestep(
    axes: Any,
    curves: Curves,
    quantity: str,
) -> None:
    """Draw one quantity's error over the timestep, by integrator; ring the jumps."""
    for label, look in INTEGRATOR_LOOKS.items():
        row = sorted(curves.get(look.curve, ()), key=lambda point: point.setting_value)
        errors = {
            point.setting_value: min(
                getattr(point.at_steps, quantity), LARGEST_DRAWN_ERROR
            )
            for point in row
        }
        _draw_look(axes, [1.0 / n for n in errors], list(errors.values()), label, look)
        leaps = [point.setting_value for point in find_jumps(row, quantity)]
        axes.plot(
            [1.0 / n for n in leaps],
            [errors[n] for n in leaps],
            gid=f"jump-{quantity}",
            ls="none",
            marker="o",
            ms=12,
            mfc="none",
            mec=INK,
            mew=1.4,
        )


def draw_orders(curves: Curves, title: str) -> Any:
    """Draw panels of all quantities on the same axes."""
    height = 8.4
    figure = make_figure(height, state_jumps(curves), title)
    panels = figure.subplots(3, 2, sharex=True, sharey=True)
    figure.subplots_adjust(
        left=0.135,
        right=0.98,
        bottom=0.065,
        top=0.81,
        wspace=0.08,
        hspace=0.2,
    )
    flat = panels.ravel()
    for axes, quantity in zip(flat, ERROR_NAMES, strict=False):
        _draw_over_timestep(axes, curves, quantity)
        set_axes(axes)
        axes.get_legend().remove()
        axes.set_ylim(1e-12, 2.0 * LARGEST_DRAWN_ERROR)
        name = QUANTITY_WORDS.get(quantity, f"pin force {quantity}")
        axes.set_title(name, loc="left", fontsize=TEXT, weight="bold", color=INK)
    flat[-1].set_axis_off()
    flat[-1].legend(
        *flat[0].get_legend_handles_labels(),
        loc="center",
        fontsize=TEXT,
        labelcolor=INK,
    )
    for axes in (flat[3], flat[4]):
        axes.tick_params(labelbottom=True)
        axes.set_xlabel("timestep, part of a revolution", fontsize=TEXT, color=INK)
    return figure


def state_jumps(curves: Curves) -> str:
    """Say what the picture means."""
    leaping: dict[str, None] = {}
    never: dict[str, list[str]] = {}
    for label, look in INTEGRATOR_LOOKS.items():
        row = sorted(curves.get(look.curve, ()), key=lambda point: point.setting_value)
        for quantity in ERROR_NAMES:
            if find_jumps(row, quantity):
                leaping[quantity] = None
            errors = [getattr(point.at_steps, quantity) for point in row]
            if row and min(errors) >= LARGEST_LAWFUL_ERROR:
                never.setdefault(label, []).append(quantity)
    if leaping:
        return f"{', '.join(leaping)} jumps where it is ringed"
    if never:
        quantities = [quantity for row in never.values() for quantity in row]
        lost = ", ".join(dict.fromkeys(quantities))
        return (
            f"No timestep brings {lost} below {LARGEST_LAWFUL_ERROR:g}\n"
            f"with {', '.join(never)}"
        )
    return "No error of torque or pin force jumps\ntowards finer steps"
