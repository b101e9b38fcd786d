"""What `fourbar analyze` prints for the reader: a summary and a table; and how every printed table looks."""

import io
import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from fourbar.errors import clean_line
from fourbar.linkage import BAR_NAMES, PIN_FORCE
from fourbar.quantities import ANGLES, PIN_FORCES, STATUS_NAMES, UNITS
from fourbar.scene import Scene
from fourbar.scene.motion import BRANCH_NAMES
from fourbar.show.between import Between, locate_between
from fourbar.show.duty import bearing_load, describe_drive, motor_duty, read_drive
from fourbar.solution import DEGREES, Array, Conversion, Solution, find_unit, find_unit_in

if TYPE_CHECKING:
    from rich.table import Table

MOST_DIGITS = 16
"""Of a double."""
GAP = 2
"""Blanks between two columns of the table, the divider among them."""
MOST_ROWS = 40
"""Rows of the table on a terminal where --every does not state them: they and the summary can be read at a glance."""
STEPS = (1, 2, 5, 10, 15, 20, 30, 45, 60, 90)
"""A terminal is shown every so many positions, of a longer sweep a multiple of the last."""


def write_table(
    title: str, lines: list[str], shown: "Table", after: Sequence[str] = (), width: int | None = None
) -> str:
    """Write a table with its title and what stands above it and below, as text; `width` is that of a terminal."""
    from rich.console import Console
    from rich.text import Text

    text = io.StringIO()
    console = Console(file=text, width=width or 10_000, color_system=None)
    for part in (*([clean_line(title)] if title else []), *lines, shown, *after):
        console.print(Text(part) if isinstance(part, str) else part)
    return "\n".join(line.rstrip() for line in text.getvalue().split("\n"))


def make_plain_table(
    heads: Iterable[str], rows: Iterable[Iterable[str]], left: Iterable[str] = (), gap: int = 1
) -> "Table":
    """Make a table whose columns stand to the right, but for those headed by one of `left`."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    shown = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, gap, 0, 0))
    for head in heads:
        shown.add_column(Text(head), justify="left" if head in left else "right", no_wrap=True)
    for row in rows:
        shown.add_row(*map(Text, row))
    return shown


def print_tables(
    scene: Scene, solution: Solution, width: int | None, units: Conversion = DEGREES, *, every: int | None = None
) -> str:
    """Write the summary and the table as text.

    Parameters
    ----------
    width : columns of a terminal, where the summary stands last and the positions are thinned out; None: a file or
        a pipe, which gets the summary first and every position.
    every : show every so many positions; left out: as `width` says.
    """
    step = every or (1 if width is None else _choose_step(len(solution)))
    shown, left_out = make_table(solution, width, units, every=step)
    summary, notes = write_heading(scene, solution, units), []
    if step > 1:
        more = "; --all shows each" if every is None else ""
        notes.append(f"shown: every {step}{_write_ordinal(step)} of the {len(solution)} positions{more}")
    if left_out:
        notes.append(f"not shown: {', '.join(left_out)} (a wider terminal, --csv or --json has them)")
    if width is None:
        return write_table(scene.title, summary, shown, notes)
    title = [clean_line(scene.title)] if scene.title else []
    return write_table("", [], shown, [*notes, *title, *summary], width)


def _choose_step(count: int) -> int:
    """Show every so many of the positions, so that no more than MOST_ROWS are."""
    wanted = math.ceil((count - 1) / (MOST_ROWS - 1))
    return next((step for step in STEPS if step >= wanted), STEPS[-1] * math.ceil(wanted / STEPS[-1]))


def _write_ordinal(number: int) -> str:
    if number % 100 in (11, 12, 13):
        return "th"
    return {1: "st", 2: "nd", 3: "rd"}.get(number % 10, "th")


def write_heading(scene: Scene, solution: Solution, units: Conversion = DEGREES) -> list[str]:
    """Write the lines above the table: what was requested, and how many of the positions have an answer."""
    lengths = zip(BAR_NAMES.values(), scene.linkage.lengths, strict=True)
    drive = f"drive {'on ' if scene.drive is None else ''}{describe_drive(scene)}"
    if scene.motion.free is not None:
        drive = "released, no drive"
    branch = BRANCH_NAMES[scene.motion.branch]
    theta, omega, _ = scene.motion.names
    of_bar = "" if scene.motion.bar == 2 else f" of the command {theta}"
    lines = [
        ", ".join(f"{name} {write_value(length, 'm', units)}" for name, length in lengths),
        f"{branch} branch{of_bar}; {drive}",
    ]
    counts = np.bincount(solution.status_code, minlength=len(STATUS_NAMES))
    statuses = zip(STATUS_NAMES, counts.tolist(), strict=True)
    parts = [f"{count} {name.replace('_', ' ')}" for name, count in statuses if count]
    lines.append(f"{len(solution)} position{'s' if len(solution) != 1 else ''}: " + ", ".join(parts))
    if solution.stopped_at is not None and scene.motion.free is not None:
        lines.append(
            f"{scene.motion.free.steps + 1} instants were wanted: the motion stops at a limit position at "
            f"t = {solution.stopped_at:.6g} s, where bars 3 and 4 are in line"
        )
    of_drive = read_drive(solution)
    acted_on = scene.loads or scene.effects or any(bar.mass > 0.0 for bar in scene.linkage.moving)
    if scene.motion.speed is None and of_drive.values is None and acted_on:
        lines.append(f"positions only, since {omega} is left out; {static(scene)}")
    found = locate_between(scene, solution)
    if found.reversals:
        unit = UNITS[solution.commanded]
        where = ", ".join(f"{write_value(place, unit, units)} ({pin})" for place, pin in found.reversals)
        lines.append(f"dry friction reverses, and the pin forces jump, at {solution.commanded} = {where}")
    if scene.motion.free is None and of_drive.values is not None and np.isfinite(of_drive.values).any():
        values = read_drive(found.solution).values
        assert values is not None
        worst = int(np.nanargmax(np.abs(values)))
        where = write_value(found.solution.theta_2[worst], "rad", units)
        most = f"largest {of_drive.name}{_remark_grid(solution, found, of_drive.keys.value)}"
        lines.append(f"{most} {write_value(values[worst], of_drive.unit, units)} at theta_2 = {where}")
        if solution.stroke is not None:
            ends = (write_value(end(solution.stroke), "m", units) for end in (np.nanmin, np.nanmax))
            lines.append("stroke from {} to {}".format(*ends))
        lines += _warn(scene, solution, units)
        lines += _write_motor(solution, units, found)
    if solution.F12 is not None and np.isfinite(solution.F12).any():
        peaks = ((pin, bearing_load(found.solution, pin)) for pin in PIN_FORCE)
        parts = [f"{p} {write_value(x.largest, 'N', units)} at {write_value(x.where, 'rad', units)}" for p, x in peaks]
        rms = [f"{pin} {write_value(bearing_load(solution, pin).rms, 'N', units)}" for pin in PIN_FORCE]
        most = f"largest pin loads{_remark_grid(solution, found, *PIN_FORCES)}"
        lines += [f"{most}: " + ", ".join(parts), "RMS pin loads: " + ", ".join(rms)]
    return lines


def _remark_grid(solution: Solution, found: Between, *names: str) -> str:
    """Say that a largest value is that of the positions alone, where between them there may be a larger one."""
    return " of these positions" if len(solution) > 1 and found.growing.intersection(names) else ""


def _write_motor(solution: Solution, units: Conversion, found: Between) -> list[str]:
    """Write what the drive delivers, for the choice of a motor."""
    duty = motor_duty(solution, found.solution)
    if duty is None or len(solution) == 1:
        return []
    rms = f"RMS torque {write_value(duty.rms_torque, 'N m', units)}" if duty.rms_torque is not None else ""
    if duty.rms_force is not None:
        rms = f"RMS force {write_value(duty.rms_force, 'N', units)}"
    lines = [
        f"motor: {rms}, peak speed {write_value(duty.peak_speed, 'rad/s' if solution.drive is None else 'm/s', units)}"
        f", power peak {write_value(duty.peak_power, 'W', units)}, RMS {write_value(duty.rms_power, 'W', units)}"
    ]
    if duty.energy_in is not None and duty.energy_out is not None:
        over = "per turn" if duty.closed else "over the sweep"
        energy_in, energy_out = write_value(duty.energy_in, "J", units), write_value(duty.energy_out, "J", units)
        lines.append(f"the drive gives {energy_in} {over} and takes back {energy_out}")
    return lines


def static(scene: Scene) -> str:
    """Say what asks for forces where a scene states positions alone."""
    unit, what = ("rad/s", "torque") if scene.motion.stroke is None else ("m/s", "force")
    return f'{scene.motion.names[1]} = "0 {unit}" gives the static {what} and pin forces'


def write_value(number: float, unit: str, units: Conversion) -> str:
    """Write a number of an SI unit with six digits and the unit it is shown in."""
    name, factor = find_unit_in(unit, units)
    return f"{number * factor:.6g} {name}"


def _warn(scene: Scene, solution: Solution, units: Conversion) -> list[str]:
    """Where the drive's torque or force has few digits left, and how far from in line the bars are that cost them."""
    drive = read_drive(solution)
    assert drive.values is not None
    if drive.error is None or solution.drive_condition is None:
        return []
    # of those that matter: one that passes through zero has no digits, and needs none
    with np.errstate(invalid="ignore"):
        share = drive.error / np.maximum(np.abs(drive.values), np.nanmedian(np.abs(drive.values)))
    if not np.nanmax(share, initial=0.0) > FEW_DIGITS:
        return []
    worst = int(np.nanargmax(share))
    left = max(math.floor(-math.log10(share[worst])), 0)
    where = f"at theta_2 = {write_value(solution.theta_2[worst], 'rad', units)}"
    others = {2: "3 and 4", 3: "2 and 4", 4: "2 and 3"}
    commanded = others[solution.at.bar]
    sines = {commanded: solution.condition[worst]}
    if scene.drive is not None:
        lever, sine = solution.drive_condition[worst], sines[commanded]
        of_bars = f"of the sine of bars {commanded} {sine:.2g} is left"
        return [f"{left} digits left of F {where}: of its lever {lever:.2g}, {of_bars}"]
    sines[others[scene.drive_bar]] = solution.drive_condition[worst]
    bars = min(sines, key=lambda pair: sines[pair])
    gap = math.asin(min(sines[bars], 1.0))
    return [f"{left} digits left of T{scene.drive_bar} {where}: bars {bars} are {gap:.2g} rad from being in line"]


FEW_DIGITS = 1e-8
"""Relative error of the torque above which the heading says so: half of what a double carries is lost."""


def list_columns(solution: Solution, units: Conversion = DEGREES) -> dict[str, list[str]]:
    """List the columns of the table, most wanted first: heading with unit -> cells."""
    shown: dict[str, list[str]] = {}

    def add(name: str, unit: str, values: Array | None) -> None:
        assert values is not None
        label, factor = find_unit_in(unit, units)
        shown[f"{name}\n{label}"] = write_cells(values * factor, ".4f" if unit == "rad" else ".6g")

    if solution.time is not None:
        add("time", "s", solution.time)
    add("theta_2", "rad", solution.theta_2)
    drive = read_drive(solution)
    if drive.values is not None:
        if solution.time is None:  # released, it has no drive: its torque is rounding
            add(drive.symbol, drive.unit, drive.values)
            add("power", "W", solution.power)
        for name in PIN_FORCES:
            add(f"|{name}|", "N", np.hypot(*getattr(solution, name).T))
    moving = {"": solution.points, "v_": solution.velocity, "a_": solution.acceleration}
    for name, vector in ((start + name, v) for start, arrays in moving.items() for name, v in arrays.items()):
        for axis, letter in enumerate("xy"):
            add(f"{name}_{letter}", find_unit(name), vector[:, axis])
    for name in ANGLES:
        add(name, "rad", getattr(solution, name))
    sought = [bar for bar in "234" if bar != solution.commanded[-1]]
    for name in ("stroke", "stroke_speed", *(f"{kind}_{bar}" for kind in ("omega", "alpha") for bar in sought)):
        if getattr(solution, name) is not None:
            add(name, UNITS[name], getattr(solution, name))
    shown["sin mu\n"] = write_cells(solution.sin_mu)
    if solution.time is None and drive.values is not None and drive.error is not None:
        shown[f"digits\nof {drive.symbol[0]}"] = _count_digits(drive.values, drive.error)
    return shown


def make_table(
    solution: Solution, width: int | None, units: Conversion = DEGREES, *, every: int = 1
) -> "tuple[Table, list[str]]":
    """Make the table for a terminal of the given width (None: as wide as it needs), and name the columns left out.

    Every so many positions are shown, the last one always.
    """
    cells = list_columns(solution, units)
    if (solution.status_code != 0).any():
        cells = {"status\n": [status.replace("_", " ") for status in solution.status], **cells}
    needed = -GAP
    kept: list[str] = []
    for name, column in cells.items():
        needed += GAP + max(len(cell) for cell in (*name.split("\n"), *column))
        if width is not None and needed > width:
            break
        kept.append(name)
    rows = list(zip(*(cells[name] for name in kept), strict=True))
    last = rows[-1:] if (len(rows) - 1) % every else []
    left_out = [name.split("\n")[0] for name in cells if name not in kept]
    return make_plain_table(kept, rows[::every] + last, gap=GAP - 1), left_out


def write_cells(values: Array, form: str = ".6g") -> list[str]:
    """Six digits, or another form; a dash where there is no value."""
    return [format(value, form) if math.isfinite(value) else "-" for value in values.tolist()]


def _count_digits(torque: Array, error: Array) -> list[str]:
    """How many digits of the torque are not rounding."""
    with np.errstate(all="ignore"):
        digits = np.clip(np.floor(np.log10(np.abs(torque) / error)), 0, MOST_DIGITS)
    known = np.isfinite(torque) & np.isfinite(error)
    return write_cells(np.where(known, np.where(error == 0.0, MOST_DIGITS, digits), np.nan))
