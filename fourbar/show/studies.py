"""Output of `classify`, `analyze --sensitivity` and `equilibrium`.

Output is text, or one JSON object in SI units and radians.
"""

import math
from collections.abc import Iterator

import numpy as np

from fourbar.formulas.mobility import (
    TURN,
    change_points,
    circuits,
    classify,
    limit_positions,
    swing,
    time_ratio,
    turns_fully,
)
from fourbar.formulas.transmission import transmission_extremes
from fourbar.linkage import BAR_NAMES, MOVING_BARS, FourBar
from fourbar.quantities import (
    CHANGE_POINT,
    COUPLE,
    LINE,
    NO_DIRECTION,
    NOT_ASSEMBLED,
    PIN_FORCES,
    SINGULAR,
    WOUND,
)
from fourbar.scene import find_signs
from fourbar.scene.motion import BRANCH_NAMES
from fourbar.show.acting import list_spring_notes
from fourbar.show.driving import read_drive_demand
from fourbar.show.lines import BLOCK_WIDTH
from fourbar.show.motion_curves import find_drive_rounding
from fourbar.show.shown_units import COMMON, choose_unit, write_cell
from fourbar.show.tables import (
    MOST_ROWS_PRINTED,
    write_cells,
    write_table,
)
from fourbar.solution import Conversion, find_unit_in, find_unit_of_quantity
from fourbar.studies.circuit_curve import RestPosition
from fourbar.studies.derivatives import Sensitivity
from fourbar.studies.equilibrium import Equilibria, Equilibrium
from fourbar.writing import write_object


def write_type(
    linkage: FourBar,
    units: Conversion,
    *,
    everything: bool,
) -> Iterator[str]:
    """Write the type of a linkage and the condition that decides it.

    Further lines say which bars turn, how far, and between which limits. Angles are in
    deg, with the digits that a drawing needs.

    `units`: of the lengths, which may be ratios. `everything`: limits of the coupler
    too.
    """
    mobility = classify(linkage)
    relation = {1.0: "<", -1.0: ">", 0.0: "="}[float(np.sign(mobility.surplus))]
    outer = min(linkage.lengths) + max(linkage.lengths)
    factor, unit = choose_unit(max(linkage.lengths), "m", units)

    def write(length: float) -> str:
        return f"{factor * length:.9g} {unit}".rstrip()

    inner = sum(linkage.lengths) - outer
    turning = ", ".join(BAR_NAMES[number] for number in mobility.turning)
    yield mobility.name
    yield f"s + l = {write(outer)} {relation} p + q = {write(inner)}"
    yield f"bars that turn fully: {turning or 'none'}"
    if mobility.barker is None:  # a structure does not move
        return
    swings = [
        f"{BAR_NAMES[bar]} {_write_angle(swing(linkage, bar))}"
        for bar in MOVING_BARS
        if not turns_fully(linkage, bar)
    ]
    if swings:
        yield f"bars that swing: {', '.join(swings)}"
    limits = [
        (bar, limit)
        for bar in (MOVING_BARS if everything else (2, 4))
        for limit in limit_positions(linkage, bar)
    ]
    if limits:
        names = "".join(f"{name:>10}" for name in ("theta_2", "theta_3", "theta_4"))
        yield f"{'limit positions (deg)':<34}{names}  branch"
    for bar, limit in limits:
        others = ", ".join(BAR_NAMES[other] for other in MOVING_BARS if other != bar)
        how = "stretched" if limit.stretched else "folded"
        what = f"  {BAR_NAMES[bar]}: {others} {how}"
        angles = "".join(f"{math.degrees(angle):z10.4f}" for angle in limit[:3])
        yield f"{what:<34}{angles}  {BRANCH_NAMES.get(limit.branch, 'both')}"
    if points := change_points(linkage):
        yield f"change points: theta_2 = {' and '.join(map(_write_angle, points))}"
    transmission = transmission_extremes(linkage)
    yield (
        f"angle between coupler and output: {_write_angle(transmission.least)} "
        f"at theta_2 = {_write_angle(transmission.theta_2_least)}"
    )
    yield (
        f"    to {_write_angle(transmission.greatest)} at"
        f" {_write_angle(transmission.theta_2_greatest)}"
    )
    if transmission.worst > 0.0:
        yield f"smallest transmission angle: {_write_angle(transmission.worst)}"
    if (ratio := time_ratio(linkage)) is not None:
        yield f"time ratio of the output strokes at constant omega_2: {ratio:.4f}"


def write_type_json(linkage: FourBar) -> str:
    """Write the type as JSON in SI units and radians, null for no value.

    Positions are as `LimitPosition` has them.
    """
    mobility = classify(linkage)
    more = dict[str, object]()
    if mobility.barker is not None:
        transmission = transmission_extremes(linkage)
        more = {
            "swing": {BAR_NAMES[bar]: swing(linkage, bar) for bar in MOVING_BARS},
            "limit_positions": {
                BAR_NAMES[bar]: limit_positions(linkage, bar) for bar in MOVING_BARS
            },
            "change_points": change_points(linkage),
            "circuits": circuits(linkage),
            "transmission": {**transmission._asdict(), "worst": transmission.worst},
            "time_ratio": time_ratio(linkage),
        }
    lengths = dict(zip(BAR_NAMES.values(), linkage.lengths, strict=True))
    return write_object(
        "fourbar-classify/1",
        lengths=lengths,
        **mobility._asdict(),
        **more,
    )


def _write_angle(angle: float) -> str:
    return f"{_write_degrees(angle)} deg"


def write_sensitivity(derivatives: Sensitivity, width: int | None) -> str:
    """Write the numbers that matter most, as lines and a table.

    Shown are torque, with friction at rest what it holds, pin forces and points; if the
    scene states no speed, angles replace torque and forces. The rank of a number
    follows from its largest share of a largest value.

    `width`: that of a terminal.
    """
    solution = derivatives.solution
    names = [name for name in (*COUPLE, *LINE) if name in derivatives.by]
    names = [*names, *PIN_FORCES] if names else ["theta_3", "theta_4"]
    names += [point.name for point in derivatives.scene.points]
    lines = [
        f"largest change over the positions {derivatives.describe_steps()};"
        " pin forces by their magnitude"
    ]
    shares: dict[str, float] = {}
    largest = ["largest value"]
    changes = []
    for name in names:
        value = derivatives.value(name).reshape(len(solution), -1)
        size = float(np.fmax.reduce(np.linalg.norm(value, axis=1)))
        largest.append(write_cell(size, ".4g"))
        ranked = derivatives.influences(name)
        for row in ranked:
            share = abs(row.change) / size if size > 0.0 else 0.0
            shares[row.key] = max(shares.get(row.key, 0.0), share)
        no_change = 0.0 if np.isfinite(derivatives.by[name]).any() else math.nan
        of_name = dict.fromkeys(derivatives.keys, no_change)
        changes.append(of_name | {row.key: row.change for row in ranked})
    without = [status for status in derivatives.status if status != "ok"]
    lacking = [
        key
        for row, key in enumerate(derivatives.keys)
        if any(np.isnan(derivatives.by[name][row]).any() for name in names)
    ]
    if without and lacking:
        counts = ", ".join(
            f"{without.count(word)} {word.replace('_', ' ')}"
            for word in dict.fromkeys(without)
        )
        by = "all derivatives"
        if len(lacking) < len(derivatives.keys):
            by = f"derivatives by {', '.join(lacking)}"
        lines.append(f"positions without {by}: {counts}")
    rows = [largest]
    for key in sorted(shares, key=lambda key: -shares[key]):
        rows.append([key, *(write_cell(of_name[key], ".3g") for of_name in changes)])
    heads = [f"{name}\n{find_unit_of_quantity(name)}" for name in names]
    width = width or BLOCK_WIDTH
    return write_table(solution.title, lines, ["", *heads], rows, width=width)


def write_sensitivity_json(derivatives: Sensitivity) -> str:
    """Write d(quantity)/d(key) over the positions as one JSON object, SI and rad.

    Vectors are [x, y]; null stands for no value.
    """
    return write_object(
        "fourbar-sensitivity/1",
        title=derivatives.solution.title,
        drive_bar=derivatives.solution.drive_bar,
        status=derivatives.status,
        theta_2=derivatives.solution.theta_2,
        keys={
            key: {"value": number, "unit": entry.unit}
            for (key, entry), number in zip(
                derivatives.keys.items(),
                derivatives.numbers.tolist(),
                strict=True,
            )
        },
        by={
            name: dict(zip(derivatives.keys, rows, strict=True))
            for name, rows in derivatives.by.items()
        },
    )


_MOVES = {0: "stays", 1: "theta_2 grows", -1: "theta_2 falls"}


def write_equilibria(
    title: str,
    rest: Equilibria,
    units: Conversion = COMMON,
    width: int | None = None,
) -> str:
    """Write the tables of equilibria and of what holds the positions as text.

    A branch in the tables is the assembly, as a scene states it with the position.

    `units`: units of the numbers; one that is left out is the SI unit. `width`: that
    of a terminal.
    """
    reached = [position for position in rest.found if position.reached]
    others = [position for position in rest.found if not position.reached]
    lines = _count_equilibria(rest, len(reached), units)
    blocks = [_write_resting(title, lines, rest, reached, units, width)]
    if others:
        line = (
            f"{_write_count(len(others))} in the other assembly at angles theta_2 of"
            " this sweep, which does not reach it"
        )
        blocks.append(_write_resting("", [line], rest, others, units, width))
    blocks.append(_write_holding(rest, units, width))
    return "\n\n".join(block.rstrip("\n") for block in blocks) + "\n"


def _write_resting(
    title: str,
    lines: list[str],
    rest: Equilibria,
    found: list[Equilibrium],
    units: Conversion,
    width: int | None,
) -> str:
    """Write the table of some equilibria with its title and lines."""
    torque, per_torque = find_unit_in("N m", units)
    inertia = "kg m^2"
    per_inertia = 1.0
    if "kg" in units and "m" in units:
        # as lb and in make lb in^2
        mass, per_mass = units["kg"]
        length, per_length = units["m"]
        inertia = f"{mass} {length}^2"
        per_inertia = per_mass * per_length**2
    heads = [
        "theta_2\n(deg)",
        "theta_4\n(deg)",
        "branch",
        "",
        "by",
        f"dQ/dq\n({torque}/rad)",
        f"J\n({inertia})",
        "frequency\n(Hz)",
    ]
    rows = []
    for position in found:
        place = position.place
        frequency = position.frequency
        row = [
            _write_degrees(place.theta_2),
            _write_degrees(place.theta_4),
            BRANCH_NAMES.get(_find_assembly(rest, place), "limit"),
            position.stability,
            position.angle,
            f"{per_torque * position.slope:.6g}",
            f"{per_inertia * position.inertia:.6g}",
            "-" if frequency is None else f"{frequency:.6g}",
        ]
        rows.append(row)
    held = [
        f"friction holds {_write_range(rest, position.held)} about theta_2 ="
        f" {_write_degrees(position.place.theta_2)} deg"
        for position in found
        if position.held is not None
    ]
    left = ["branch", "", "by"]
    return write_table(title, lines, heads, rows, left=left, after=held, width=width)


def _find_assembly(rest: Equilibria, place: RestPosition) -> int:
    """Return the assembly of a place, whose branch is a sign."""
    theta_2 = np.array([place.theta_2])
    return int(find_signs(rest.positions.scene.linkage, theta_2, place.branch)[0])


def _write_count(count: int) -> str:
    return f"{count} equilibri{'um' if count == 1 else 'a'}"


def _count_equilibria(rest: Equilibria, reached: int, units: Conversion) -> list[str]:
    grid = (
        f"found between {rest.samples} positions where Q changes its sign or touches 0"
    )
    within = "" if reached == len(rest.found) else " in this sweep"
    lines = [f"{_write_count(reached)}{within} without friction,", grid]
    if rest.not_decided:
        angles = " and ".join(
            f"theta_2 = {_write_degrees(place.theta_2)}" for place in rest.not_decided
        )
        lines.append(
            f"at the change point {angles} deg nothing is decided: there the linkage"
            " has two ways to move"
        )
    lines += [
        f"indifferent (Q = 0 throughout): {_write_range(rest, ends)}"
        for ends in rest.indifferent
    ]
    lines += [
        f"friction holds, about no single equilibrium: {_write_range(rest, ends)}"
        for ends in rest.held
        if all(position.held != ends for position in rest.found)
    ]
    return [*lines, *list_spring_notes(rest.positions, units)]


def _write_holding(rest: Equilibria, units: Conversion, width: int | None) -> str:
    """Write what holds the scene's positions, thinned out to what can be read."""
    positions = rest.positions
    drive = read_drive_demand(positions)
    values = drive.values
    low = getattr(positions, drive.keys.low)
    values = np.where(np.abs(values) <= find_drive_rounding(positions), 0.0, values)
    unit, factor = find_unit_in(drive.unit, units)
    columns = {"theta_2 (deg)": write_cells(np.degrees(positions.theta_2))}
    shown = {drive.name: values}
    if low is not None:
        shown = {"from": low, "to": getattr(positions, drive.keys.high)}
    for head, numbers in shown.items():
        columns[f"{head} ({unit})"] = write_cells(factor * numbers)
    moves = np.array([_MOVES[move] for move in rest.moves])
    # statuses at which no force says how a released linkage moves
    undecided = np.isin(
        positions.status_code,
        (NOT_ASSEMBLED, SINGULAR, NO_DIRECTION, WOUND, CHANGE_POINT),
    )
    columns["released"] = np.where(undecided, positions.status, moves).tolist()
    rows = list(zip(*columns.values(), strict=True))
    every = math.ceil(len(positions) / MOST_ROWS_PRINTED)

    on = "" if positions.drive is not None else f" on bar {positions.drive_bar}"
    lines = [f"{drive.name}{on} that holds it at rest, and how it moves when released"]
    sizes = np.nan_to_num(np.abs(values))
    most = int(np.argmax(sizes >= (1.0 - _SAME_SIZE) * sizes.max()))  # the first
    if sizes[most] > 0.0:
        largest = "largest of these positions"
        if low is not None:
            largest += ", without friction"
        lines.append(
            f"{largest}: {factor * values[most]:.6g} {unit} at theta_2 ="
            f" {_write_degrees(positions.theta_2[most])} deg"
        )
    return write_table(
        "", lines, columns, rows[::every], left=["released"], gap=1, width=width
    )


def _write_range(rest: Equilibria, ends: tuple[RestPosition, RestPosition]) -> str:
    first, last = ends
    apart = math.remainder(last.theta_2 - first.theta_2, TURN)
    text = f"{_write_degrees(first.theta_2)} to {_write_degrees(last.theta_2)}"
    if _find_assembly(rest, first) != _find_assembly(rest, last):
        return f"{text} through a limit"
    return "everywhere on its circuit" if abs(apart) < _SAME_PLACE else text


_SAME_SIZE = 1e-9
"""Part of the largest torque or force by which another one is as large."""
_SAME_PLACE = 1e-9
"""Angle between the ends of a range, rad, below which it goes round: no friction holds
within less, and nothing is printed finer than 1e-6 rad.
"""


def _write_degrees(angle: float) -> str:
    return write_cell(math.degrees(angle), ".4f")


def write_equilibria_json(title: str, rest: Equilibria) -> str:
    """Write equilibria as one JSON object, SI and rad."""
    positions = rest.positions
    keys = read_drive_demand(positions).keys
    return write_object(
        "fourbar-equilibrium/1",
        title=title,
        samples=rest.samples,
        equilibria=rest.found,
        indifferent=rest.indifferent,
        held=rest.held,
        not_decided=rest.not_decided,
        notes=list_spring_notes(positions, COMMON),
        positions={
            "drive_bar": positions.drive_bar,
            "status": positions.status,
            "branch": positions.branch,
            **{
                name: getattr(positions, name)
                for name in ("theta_2", keys.value, keys.low, keys.high)
            },
            "moves": rest.moves,
        },
    )
