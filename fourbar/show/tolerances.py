"""Output of `fourbar tolerance`: a table and one JSON object.

Every row of the table is of the place where the spread is largest.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from fourbar.errors import DependencyError, InputError, write_count
from fourbar.linkage import MOVING_BARS
from fourbar.quantities import COUPLE, LINE, PIN_FORCES, UNITS, Array, Indices
from fourbar.scene import Scene
from fourbar.show.lines import BLOCK_WIDTH
from fourbar.show.panels import split_runs
from fourbar.show.shown_units import drop_rounding, write_cell
from fourbar.show.tables import write_table
from fourbar.solution import DEGREES, Conversion, find_unit_in
from fourbar.studies.spread import (
    BAND_PERCENTILES,
    PARTED,
    Tolerances,
    tolerances,
)
from fourbar.writing import write_object

PAGE_SAMPLES = 2048
"""Samples behind the bands of a page. They take seconds, and give a percentile to a
fiftieth of the deviation.
"""
_MOST_SHOWN, _FEWEST_SHOWN = 6, 3
"""Significant digits of the table; fewer than the most where it would be wider than a
block.
"""
_MOST_RUNS = 5
"""Intervals of theta_2, or of time, that one line names."""


def list_shown_parts(spreads: Tolerances) -> list[str]:
    """List what is drawn, and the angles that follow the command."""
    return list(dict.fromkeys([*list_drawn_parts(spreads), *_list_angles(spreads)]))


def list_drawn_parts(spreads: Tolerances) -> list[str]:
    """List torque (with friction at rest what it holds), pin forces and points.

    Pin forces are magnitudes. If the scene states no speed, or nothing loads its drive
    at any position, angles replace torque and forces.
    """
    parts = [
        name
        for name in (*COUPLE, *LINE)
        if name in spreads.spreads
        and np.nan_to_num(spreads.spreads[name].nominal).any()
    ]
    parts += [f"|{name}|" for name in PIN_FORCES] if parts else _list_angles(spreads)
    points = [point.name for point in spreads.scene.points]
    return [*parts, *(f"{name}_{letter}" for name in points for letter in "xy")]


def _list_angles(spreads: Tolerances) -> list[str]:
    """List the angles that follow the command."""
    angles = [f"theta_{bar}" for bar in MOVING_BARS]
    commanded = spreads.scene.motion.commanded
    return [name for name in angles if name in spreads.spreads and name != commanded]


def find_part_unit(part: str) -> str:
    """Return the unit of a quantity, a magnitude, or a component of a point.

    A point may be called v or a.
    """
    unit: str = UNITS.get(part.strip("|"), "m")
    return unit


def write_spreads(
    spreads: Tolerances,
    units: Conversion,
    width: int | None,
) -> str:
    """Write one row for each quantity.

    The lines above say what was tried and what the variance of each is due to.
    """
    lines = [
        *_describe_counts(spreads, units),
        (
            "each quantity at the position where its first-order worst case (worst) is"
            " largest; sigma is the standard deviation of the samples; the variance"
            " there is due to"
        ),
    ]
    shown = {}
    for part in list_shown_parts(spreads):
        spread = spreads.spreads[part]
        size = spread.worst if np.isfinite(spread.worst).any() else spread.deviation
        if np.isfinite(size).any():
            shown[part] = int(np.nanargmax(size))
    for part, worst in shown.items():
        shares = spreads.spreads[part].shares[:, worst]
        percents = 100.0 * shares / (shares.sum() or 1.0)
        most = ", ".join(
            f"{percents[i]:.0f} % {spreads.scene.tolerances[i].key}"
            for i in np.argsort(-shares)[:2]
            if percents[i] > 0.0
        )
        if most:
            lines.append(f"  {part}: {most}")
    title = spreads.scene.title
    for digits in range(_MOST_SHOWN, _FEWEST_SHOWN - 1, -1):
        table = _tabulate_parts(spreads, shown, units, digits)
        written = write_table("", [], *table)
        if max(map(len, written.split("\n"))) <= BLOCK_WIDTH:
            break
    return write_table(title, lines, *table, width=width or BLOCK_WIDTH)


def _tabulate_parts(
    spreads: Tolerances,
    shown: Mapping[str, int],
    units: Conversion,
    digits: int,
) -> tuple[list[str], list[list[str]]]:
    """Make headings and rows of parts, each at its position, with so many digits."""
    rows = []
    name, si, places = _list_places(spreads)
    unit_of_place, of_place = find_unit_in(si, units)
    for part, worst in shown.items():
        spread = spreads.spreads[part]
        columns = np.array(spread[:6])  # from nominal to greatest
        unit, factor = find_unit_in(find_part_unit(part), units)
        largest = np.nanmax(np.abs(columns), initial=0.0)
        cleaned = (factor * drop_rounding(columns[:, worst], largest)).tolist()
        numbers = [write_cell(number, f".{digits}g") for number in cleaned]
        numbers[1] = write_cell(cleaned[1], ".3g")
        place = write_cell(of_place * places[worst], f".{digits}g")
        most = write_cell(factor * spread.worst[worst], ".3g")
        rows.append([part, unit, place, *numbers, most])
    band = [f"\n{percentile:g} %" for percentile in BAND_PERCENTILES]
    heads = ["", "\nunit", f"{name}\n{unit_of_place}", "\nnominal", "\nsigma", *band]
    heads += ["\nleast", "\ngreatest", "worst\n+-"]
    return heads, rows


def _describe_counts(spreads: Tolerances, units: Conversion = DEGREES) -> list[str]:
    """Say what was tried and what of it has no answer.

    The last lines say where first order and samples part.
    """
    samples = spreads.samples
    tolerance = write_count(len(spreads.scene.tolerances), "tolerance")
    lines = [
        f"{tolerance}, {samples} samples ({spreads.describe_seed()}),"
        f" {write_count(len(spreads.theta_2), 'position')}"
    ]
    reasons = {
        "have an impossible dimension, such as a length below 0": spreads.invalid,
        "do not assemble at some position at which the nominal linkage does": (
            spreads.apart
        ),
    }
    for why, lost in reasons.items():
        if lost:
            share = f"({100.0 * lost / samples:.3g} %)"
            lines.append(f"{lost} of {samples} samples {share} {why}")
    for part in list_shown_parts(spreads):
        lines += describe_parted(spreads, part, units)
    return lines


def describe_parted(
    spreads: Tolerances,
    part: str,
    units: Conversion = DEGREES,
) -> list[str]:
    """Say where first order and samples differ, and where only samples have a value."""
    spread = spreads.spreads[part]
    alone = np.isnan(spread.first_order)
    differ = (
        f"the samples spread by more than {100.0 * PARTED:g} % more or less than first"
        " order says"
    )
    return [
        f"{part}: {words} at {_name_positions(spreads, rows, units)}: trust the samples"
        " there"
        for words, rows in (
            (differ, np.flatnonzero(spread.parted & ~alone)),
            ("first order has no value", np.flatnonzero(spread.parted & alone)),
        )
        if rows.size
    ]


def _list_places(spreads: Tolerances) -> tuple[str, str, Array]:
    """Return what tells the positions apart: its name, its SI unit and the values."""
    if spreads.time is None:
        return "theta_2", "rad", spreads.theta_2
    return "time", "s", spreads.time


def _name_positions(spreads: Tolerances, rows: Indices, units: Conversion) -> str:
    """Count positions, and name the first intervals that they fill."""
    name, si, values = _list_places(spreads)
    unit, factor = find_unit_in(si, units)
    runs = split_runs(rows)
    ends = [
        " to ".join(
            f"{factor * values[i]:.6g}" for i in dict.fromkeys((run[0], run[-1]))
        )
        for run in runs
    ]
    if len(ends) > _MOST_RUNS:
        ends[_MOST_RUNS:] = ["..."]
    positions = write_count(len(spreads.theta_2), "position")
    return f"{rows.size} of {positions} ({name} = {', '.join(ends)} {unit})"


def collect_tolerances(
    scene: Scene,
    places: list[float],
    progress: Callable[[float], None] | None,
) -> dict[str, Any]:
    """Collect what a page shows of tolerances at places of its axis.

    Deviations from the nominal and shares of the variance are collected. A scene that
    has none of this (a free motion, SciPy not installed) gives the sentence that says
    so. `progress` is that of `tolerances`.
    """
    positions = scene
    if not scene.motion.law:
        motion = scene.motion.replace(angle=np.array(places))
        positions = replace(scene, motion=motion)
    try:
        spreads = tolerances(positions, PAGE_SAMPLES, progress=progress)
    except (InputError, DependencyError) as error:
        return {"lines": [str(error)], "parts": {}}
    # a law is thinned as in `animate`
    rows = np.linspace(0, len(spreads.theta_2) - 1, len(places)).round().astype(int)

    def short(values: Array, digits: int = 4) -> list[float | None]:
        return [
            float(f"{x:.{digits}g}") if math.isfinite(x) else None
            for x in values[rows].tolist()
        ]

    parts: dict[str, Any] = {}
    for part in list_shown_parts(spreads):
        spread = spreads.spreads[part]
        with np.errstate(all="ignore"):
            shares = spread.shares / spread.shares.sum(axis=0)
        ends = ("low", "high", "least", "greatest")
        parts[part] = {
            "unit": find_part_unit(part),
            "nominal": short(spread.nominal, 9),
            **{name: short(getattr(spread, name) - spread.nominal) for name in ends},
            "worst": short(spread.worst),
            "deviation": short(spread.deviation),
            "shares": [short(share, 3) for share in shares],
        }
    return {
        "lines": _describe_counts(spreads),
        "keys": [tolerance.key for tolerance in scene.tolerances],
        "parts": parts,
    }


def write_spreads_json(spreads: Tolerances) -> str:
    """Write the spreads as one JSON object, SI and rad.

    Arrays are over the positions, null where there is no value.
    """
    stated = spreads.scene.tolerances
    keys = [tolerance.key for tolerance in stated]
    return write_object(
        "fourbar-tolerance/1",
        title=spreads.scene.title,
        samples=spreads.samples,
        seed=spreads.seed,
        tolerances={
            tolerance.key: {
                "width": tolerance.width,
                "distribution": "normal" if tolerance.sigma else "uniform",
            }
            for tolerance in stated
        },
        apart=spreads.apart,
        invalid=spreads.invalid,
        theta_2=spreads.theta_2,
        time=spreads.time,
        without_value=spreads.without,
        quantities={
            part: {
                **{
                    name: array
                    for name, array in spread._asdict().items()
                    if name != "shares"
                },
                "first_order": spread.first_order,
                "shares": dict(zip(keys, spread.shares, strict=True)),
                "parted": spread.parted,
            }
            for part, spread in spreads.spreads.items()
        },
    )
