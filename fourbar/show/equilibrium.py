"""What `fourbar equilibrium` prints: where the linkage stays by itself, and what holds it elsewhere."""

import math
from typing import Any

import numpy as np

from fourbar.quantities import NOT_ASSEMBLED, SINGULAR
from fourbar.scene.motion import BRANCH_NAMES
from fourbar.show.duty import read_drive
from fourbar.show.tables import MOST_ROWS, make_plain_table, write_cells, write_table
from fourbar.studies.circuit_curve import RestPosition
from fourbar.studies.equilibrium import Equilibria, Equilibrium
from fourbar.writing import write_object

SCHEMA = "fourbar-equilibrium/1"
MOVES = {0: "stays", 1: "theta_2 grows", -1: "theta_2 falls"}


def write_tables(title: str, found: Equilibria) -> str:
    """Write both tables as text."""
    friction = bool(found.held)
    heads = ["theta_2 (deg)", "theta_4 (deg)", "branch", "", "by", "dQ/dq (N m/rad)", "J (kg m^2)", "frequency (Hz)"]
    rows = [_write_row(each, friction=friction) for each in found.found]
    own = make_plain_table([*heads, *(["friction holds (deg)"] if friction else [])], rows, left=("branch", "", "by"))
    text = (
        write_table(title, _write_heading(found), own)
        if rows
        else "\n".join([*([title] if title else []), *_write_heading(found)])
    )
    return text.rstrip("\n") + "\n\n" + write_table("", *_write_holding(found))


def _write_heading(found: Equilibria) -> list[str]:
    count = len(found.found)
    how = "proven to be all" if found.proven else "of those found, by changes of sign: there may be others"
    lines = [f"{count} equilibri{'um' if count == 1 else 'a'} without friction, {how}"]
    if found.not_decided:
        at = " and ".join(f"theta_2 = {_write_degrees(place.theta_2)}" for place in found.not_decided)
        lines.append(f"at the change point {at} deg nothing is decided: there the linkage has two ways to move")
    lines += [f"indifferent (Q = 0 throughout): {_write_range(ends)}" for ends in found.indifferent]
    lines += [
        f"friction alone holds, without an equilibrium: {_write_range(ends)}"
        for ends in found.held
        if all(each.held != ends for each in found.found)
    ]
    return lines


def _write_holding(found: Equilibria) -> tuple[list[str], Any]:
    """Write what holds the scene's positions, thinned out to what can be read."""
    at = found.positions
    drive = read_drive(at)
    values, low, high = drive.values, getattr(at, drive.keys.low), getattr(at, drive.keys.high)
    assert values is not None
    heads, columns = ["theta_2 (deg)", f"{drive.name} ({drive.unit})"], [np.degrees(at.theta_2), values]
    if low is not None and high is not None:
        heads, columns = [heads[0], f"from ({drive.unit})", f"to ({drive.unit})"], [columns[0], low, high]
    still = np.isin(at.status_code, (NOT_ASSEMBLED, SINGULAR))
    released = [status if no else MOVES[move] for status, no, move in zip(at.status, still, found.moves, strict=True)]
    rows = list(zip(*map(write_cells, columns), released, strict=True))[:: -(-len(at) // MOST_ROWS)]
    on = "" if at.drive is not None else f" on bar {at.drive_bar}"
    lines = [f"{drive.name}{on} that holds it at rest, and how it moves when released"]
    if np.isfinite(values).any():
        most = int(np.nanargmax(np.abs(values)))
        largest = "largest" if low is None else "largest without friction"
        lines.append(f"{largest}: {values[most]:.6g} {drive.unit} at theta_2 = {_write_degrees(at.theta_2[most])} deg")
    return lines, make_plain_table([*heads, "released"], rows, left=("released",))


def _write_row(each: Equilibrium, *, friction: bool) -> list[str]:
    place, frequency = each.place, "-" if each.frequency is None else f"{each.frequency:.10g}"
    row = [
        _write_degrees(place.theta_2),
        _write_degrees(place.theta_4),
        BRANCH_NAMES.get(place.branch, "limit"),
        each.stability,
    ]
    row += [each.angle, f"{each.slope:.6g}", f"{each.inertia:.6g}", frequency]
    return row + ([_write_range(each.held) if each.held else "-"] if friction else [])


def _write_range(ends: tuple[RestPosition, RestPosition]) -> str:
    one, other = ends
    text = f"{_write_degrees(one.theta_2)} to {_write_degrees(other.theta_2)}"
    return text if one.branch == other.branch else f"{text} through a limit"


def _write_degrees(angle: float) -> str:
    return f"{math.degrees(angle):.4f}"


def write_json(title: str, found: Equilibria) -> str:
    """One object, SI and rad."""
    at, keys = found.positions, read_drive(found.positions).keys
    return write_object(
        SCHEMA,
        title=title,
        proven=found.proven,
        equilibria=found.found,
        indifferent=found.indifferent,
        held=found.held,
        not_decided=found.not_decided,
        positions={
            "drive_bar": at.drive_bar,
            "status": at.status,
            "branch": at.branch,
            **{name: getattr(at, name) for name in ("theta_2", keys.value, keys.low, keys.high)},
            "moves": found.moves,
        },
    )
