"""Output of `analyze`: one block of aligned lines, at most 80 columns wide.

The duty of the drive in the JSON of `analyze` is made here too.
"""

import math
from collections.abc import Iterator
from functools import cached_property
from typing import Any

import numpy as np

from fourbar.errors import clean_line
from fourbar.formulas.mobility import (
    PARALLELOGRAM,
    TURN,
    change_points,
    classify,
    find_intervals,
    find_miss,
    list_met_equalities,
    name_assembly,
    turns_fully,
)
from fourbar.linkage import BAR_NAMES, PIN_FORCE
from fourbar.quantities import LINE, OK, PIN_FORCES, Array
from fourbar.scene import Scene
from fourbar.scene.motion import BRANCH_NAMES
from fourbar.show.acting import (
    list_arm_notes,
    list_couple_notes,
    list_drawn_notes,
    list_law_notes,
    list_spring_notes,
)
from fourbar.show.change_point import has_growing_forces
from fourbar.show.columns import explain_static
from fourbar.show.driving import describe_drive
from fourbar.show.duty import DUTY_UNITS, MotorDuty, bearing_load, motor_duty
from fourbar.show.lines import find_block_width, wrap_line
from fourbar.show.motion_curves import acts, find_drive_rounding
from fourbar.show.panels import Peak
from fourbar.show.position import PositionSheet
from fourbar.show.summary import Facts, summarize
from fourbar.show.units import (
    COMMON,
    POSITION_DIGITS,
    SHOWN_AS_ZERO,
    SHOWN_DIGITS,
    choose_unit,
    write_digits,
    write_ends,
    write_short,
)
from fourbar.solution import Conversion, Solution, find_unit_in
from fourbar.studies.passing import move_inside_limit

_NO_LARGEST = "unbounded"
"""Stands in place of a largest value that there is none of."""
_NBSP = "\u00a0"
"""Stands between a number and its unit until the lines are broken."""
LEAST_COLUMN = 12
"""Least width of a column."""
INDENT = 11
"""Width of what stands before a row."""
_HALF_OF_LAST = 0.5
"""Part of the last digit shown from which on an error bar changes it."""
_FEW_DIGITS = 1e-8
"""Error bar over the value from which on the block says where digits are lost. Half of
the digits of a double are lost then.
"""
OF_ONE_PREFIX = 1e-4
"""Part of the largest of its kind below which a quantity has a prefix of its own."""
FAR_BELOW_PEAK = 0.1
"""Part of its peak below which a mean has a prefix of its own: it would begin with 0.0.
"""
_STATUS_WORDS = {"change_point": "at a change point"}
"""Words for the statuses of positions that are not the names alone."""
_BESIDE_CHANGE_POINT = 1e-9
"""rad; an angle nearer to a change point is rounded from it: files state angles with
nine decimals and more.
"""
_MOST_POLES = 4
"""Number of places at which a quantity grows without bound that are listed."""
_MOST_HELD = 4
"""Number of places at which dry friction holds a pin that are listed."""
PLACE_ROUNDING = 1e-6
"""Part of the motion within which the place of a flat maximum is located. A place
nearer to zero than that is zero.
"""
_IN_LINE = 1e-9
"""Sine below which two bars are in line: places are located to some 1e-12."""
_NO_ANGLE = 1e-14
"""rad; rounding of an angle of a turn."""
BARS_IN_LINE = {2: "3 and 4", 3: "2 and 4", 4: "2 and 3"}
"""Bars that are in line where a command of a bar, or a drive on it, loses digits."""


def write_block(
    scene: Scene,
    solution: Solution,
    units: Conversion = COMMON,
    *,
    pressure: float | None = None,
    headed: bool = True,
    width: int | None = None,
) -> list[str]:
    """Write the summary of a solved scene line by line; of one position, everything.

    The parameters are those of `write_facts`.
    """
    facts = summarize(scene, solution)
    return write_facts(facts, units, pressure=pressure, headed=headed, width=width)


def write_facts(
    facts: Facts,
    units: Conversion = COMMON,
    *,
    pressure: float | None = None,
    headed: bool = True,
    width: int | None = None,
) -> list[str]:
    """Write facts that are collected already.

    Parameters
    ----------
    units : units of the numbers; one that is left out is the SI unit with a prefix.
    pressure : pressure of a cylinder, Pa; adds the bore that it needs.
    headed : begin with the linkage.
    width : that of a terminal.
    """
    return _SceneBlock(facts, units, width).write(pressure, headed=headed)


class _SceneBlock:
    """The facts of a scene and the units that they are written in."""

    def __init__(
        self,
        facts: Facts,
        units: Conversion,
        width: int | None,
    ) -> None:
        self.facts = facts
        self.width = find_block_width(width)
        self.units = units
        self.digits = POSITION_DIGITS if facts.kind == "position" else SHOWN_DIGITS
        self.longest = max(facts.scene.linkage.lengths)
        if facts.kind in ("law", "released"):
            self.symbol = "t"
            self.unit = "s"
        else:
            self.symbol = facts.solution.commanded
            self.unit = facts.solution.at.unit

    def write(self, pressure: float | None, *, headed: bool = True) -> list[str]:
        """Write all paragraphs; a blank line parts them. `headed`: with the linkage."""
        head = self._write_head() if headed else []
        if self.facts.kind == "position":
            paragraphs = [*self._write_position(head, pressure)]
        else:
            paragraphs = [[*head, *self._write_motion()], self._write_loads(pressure)]
        lines: list[str] = []
        for paragraph in filter(None, paragraphs):
            if lines:
                lines.append("")
            for line in paragraph:
                lines += wrap_line(line, self.width)
        return [line.replace(_NBSP, " ") for line in lines]

    def _write_loads(self, pressure: float | None) -> list[str]:
        """Write the drive, the loads of pins and bars, and remarks.

        If nothing acts, it writes the rates.
        """
        if not acts(self.facts.scene):
            stroke = [] if self.facts.stroke_range is None else self._write_stroke()
            return [*stroke, *self._write_rates()]
        return [
            *self._write_drive(pressure),
            *self._write_pins(),
            *self._write_bending(),
            *self._write_remarks(),
        ]

    def _write_rates(self) -> list[str]:
        """Write the largest speed and acceleration of the bars that follow, if any.

        Bars are columns of one table.
        """
        rates = self.facts.rates
        if not rates:
            return []
        rows = [("rates", [f"bar {bar} ({BAR_NAMES[bar]})" for bar in rates])]
        for label, unit, index in (("omega", "rad/s", 0), ("alpha", "rad/s^2", 1)):
            peaks = [pair[index] for pair in rates.values()]
            rows.append((f"  {label}", self._cells_of_peaks(peaks, unit)))
            names = [f"{label}_{bar}" for bar in rates]
            rows.append(("  at", self._places_of_peaks(peaks, names)))
        return [
            *_align(rows, self.width),
            "no mass, load or effect: nothing loads pins and drive",
        ]

    def _write_position(
        self,
        head: list[str],
        pressure: float | None,
    ) -> Iterator[list[str]]:
        """Write the paragraphs of one position: motion, forces, ratios."""
        facts = self.facts
        sheet = PositionSheet(facts.scene, facts.solution, self.units)
        yield [*head, self._write_place(), *self._write_statuses()]
        yield sheet.write_bars()
        yield sheet.write_points()
        if facts.solution.F12 is not None and acts(self.facts.scene):
            yield [*self._write_drive(pressure), *sheet.write_pin_forces()]
            yield self._write_bending()
        elif facts.stroke_range is not None:
            yield self._write_stroke()
        yield [*sheet.write_ratios(), *self._write_static_hint()]
        yield self._write_remarks()

    def _write_place(self) -> str:
        """Write what is commanded at the position.

        A motion over time has its time written too.
        """
        one = self.facts.solution
        name = one.commanded
        place = float(one.at.stated[0][0])
        text = f"at {name} = {self._value(place, one.at.unit)}"
        if one.time is not None:
            text += f", t = {self._value(float(one.time[0]), 's', 1.0)}"
        return f"{text}{self._write_limit()}"

    def _write_limit(self) -> str:
        """Write which bar is at a limit of its own at the position."""
        one = self.facts.solution
        gaps = {2: one.theta_4 - one.theta_3, 3: one.theta_4 - one.theta_2}
        gaps[4] = one.theta_3 - one.theta_2
        scene = self.facts.scene
        for bar, gap in gaps.items():
            theta = f"theta_{bar}"
            _, is_limit = move_inside_limit(scene, bar, float(one[theta][0]))
            # at a change point each bar moves on
            is_alone = bar != one.at.bar and one.status_code[0] == OK
            if is_limit and is_alone and abs(math.sin(gap[0])) <= _IN_LINE:
                bars = (
                    f"bars {BARS_IN_LINE[bar]} are {_name_meeting(BARS_IN_LINE[bar])}"
                )
                return f", where {theta} is at a limit: {bars}"
        return ""

    def _value(self, value: float, unit: str, largest: float | None = None) -> str:
        """Write a quantity of an SI unit, with a prefix that suits it.

        `largest`: of its kind, which then chooses the prefix unless the quantity lies
        far below it; None: the quantity does.
        """
        if largest is not None and 0.0 < abs(value) < OF_ONE_PREFIX * abs(largest):
            largest = None
        text = write_short(value, unit, self.units, largest, self.digits)
        return text.replace(" ", _NBSP)

    def _beside(self, value: float, unit: str, peak: float | None) -> str:
        """Write a mean of a line, with the prefix of its peak unless it is far below.

        In a table all of one kind have one prefix, to be compared at a glance.
        """
        if peak is None or 0.0 < abs(value) < FAR_BELOW_PEAK * abs(peak):
            return self._value(value, unit)
        return self._value(value, unit, abs(peak))

    def _place(self, place: float, *, named: bool = True) -> str:
        """Write a place as "theta_2 = 22.8 deg", or without its name."""
        first, last = self.facts.ends
        if abs(place) <= PLACE_ROUNDING * abs(last - first):
            place = 0.0
        text = self._value(
            place,
            self.unit,
            {"m": self.longest, "s": 1.0}.get(self.unit),
        )
        if named:
            return f"{self.symbol}{_NBSP}={_NBSP}{text}"
        return text

    def _angle(self, angle: float) -> str:
        return self._value(0.0 if abs(angle) < _NO_ANGLE else angle, "rad")

    def _write_head(self) -> list[str]:
        """Write what the linkage is."""
        name = f"{self._name_linkage()}:"
        lengths = self._write_lengths()
        line = f"{name} {lengths}"
        lines = [line] if len(line) <= self.width else [name, f"    {lengths}"]
        return [*lines, *self._write_change_points()]

    def _name_linkage(self) -> str:
        """Name the linkage by its type, its title and its branch."""
        scene, motion = self.facts.scene, self.facts.scene.motion
        name = name_assembly(scene.linkage, motion.bar, motion.branch)
        title = f' "{clean_line(scene.title)}"' if scene.title else ""
        of_bar = "" if motion.bar == 2 else f" of the command {motion.commanded}"
        branch = f"{BRANCH_NAMES[motion.branch]} branch{of_bar}"
        return f"{name[0].upper()}{name[1:]}{title}, {branch}"

    def _write_lengths(self) -> str:
        """Write the lengths of the bars and their unit."""
        factor, unit = choose_unit(self.longest, "m", self.units)
        lengths = ", ".join(
            f"{name} {write_digits(factor * length)}"
            for name, length in zip(
                BAR_NAMES.values(),
                self.facts.scene.linkage.lengths,
                strict=True,
            )
        )
        return f"{lengths} {unit}"

    def _write_motion(self) -> list[str]:
        """Write how far the linkage moves, and how well it transmits."""
        facts = self.facts
        least = facts.transmission
        return [
            self._write_ranges(),
            (
                f"transmission angle: at least {self._angle(least.value)}, at"
                f" {self._place(least.place)}"
            ),
            *self._write_statuses(),
            *self._write_stretches(),
            *self._write_static_hint(),
        ]

    def _write_statuses(self) -> list[str]:
        """Write how many positions have which status, where one is not ok."""
        facts = self.facts
        counts = dict(facts.counts)
        beside = self._find_beside_change_points()
        if not len(beside) and all(name == "ok" for name in counts):
            return []
        if len(beside):
            counts["ok"] -= len(beside)
        parts = [
            f"{count} {_STATUS_WORDS.get(name, name.replace('_', ' '))}"
            for name, count in counts.items()
            if count
        ]
        if len(beside):
            away = self._angle(float(beside.max()))
            parts.append(f"{len(beside)} within {away} of a change point")
        return [
            f"{len(facts.solution)} position{'s' if len(facts.solution) > 1 else ''}:"
            f" {', '.join(parts)}"
        ]

    def _find_beside_change_points(self) -> Array:
        """Return the distances of positions evaluated beside a change point, rad, (n,).

        The rounding of the angle keeps such a position from the change point that is
        meant.
        """
        solution = self.facts.solution
        angle = solution.at.angle[solution.status_code == OK]
        points = change_points(self.facts.scene.linkage, solution.at.bar)
        if not points:
            return np.empty(0)
        away = angle[:, None] - np.array(points)
        away = np.abs(away - TURN * np.rint(away / TURN)).min(axis=1)
        return np.asarray(away[away <= _BESIDE_CHANGE_POINT])

    def _write_static_hint(self) -> list[str]:
        """Say what asks for forces, if a scene with loads states positions alone."""
        scene = self.facts.scene
        if self.facts.solution.F12 is not None or not acts(self.facts.scene):
            return []
        return [
            f"positions only, since {scene.motion.names[1]} is left out:",
            f"    {explain_static(scene)}",
        ]

    def _write_change_points(self) -> list[str]:
        """Write where change points lie and what the assembly does there.

        If there is none, write how nearly there would be one.
        """
        linkage = self.facts.scene.linkage
        motion = self.facts.scene.motion
        points = change_points(linkage, motion.bar)
        lines = self._write_met_equalities()
        if (miss := find_miss(linkage)) is not None:
            gap = self._value(miss[0], "m")
            has = "one change point, not two" if points else "no change point"
            lines.append(f"misses a {miss[1]} by {gap}: it has {has}")
        if not points:
            return lines
        if motion.bar == 3 and classify(linkage).name == PARALLELOGRAM:
            lines.append(
                "no theta_3 moves the parallelogram, whose coupler does not turn"
            )
        angles = " and ".join(self._angle(angle) for angle in points)
        line = (
            f"change point{'s' if len(points) > 1 else ''} at theta_{motion.bar} ="
            f" {angles}"
        )
        if len(points) == 1 and turns_fully(linkage, motion.bar):
            line += (
                ": the assembly repeats after two turns, open and crossed are one "
                "motion, a turn apart"
            )
        return [*lines, line]

    def _write_met_equalities(self) -> list[str]:
        """Write what lengths are read as equal, and by how much they differ."""
        scene = self.facts.scene
        if scene.met_lengths is None or scene.met_lengths[1] != scene.linkage.lengths:
            return []
        equal = [
            f"{first} and {second}, which differ by {self._value(gap, 'm')}"
            for first, second, gap in list_met_equalities(*scene.met_lengths)
        ]
        if not equal:
            return []
        return [
            "lengths read as equal within the last decimals of what is stated:"
            f" {'; '.join(equal)}"
        ]

    def _write_ranges(self) -> str:
        """Write how far the commanded bar goes, or the stroke, and the output.

        If the output is commanded, it is the input.
        """
        facts = self.facts
        bar = facts.solution.at.bar
        first, last = facts.ends
        if facts.kind == "turn":
            begin = f"{BAR_NAMES[bar]} turns fully"
        elif facts.kind == "list":
            begin = (
                f"{len(facts.solution)} positions from {self._place(first)} to"
                f" {self._place(last, named=False)}"
            )
        elif facts.kind == "released":
            begin = self._write_release()
        elif facts.kind == "law":
            begin = (
                f"{BAR_NAMES[bar]} {self._write_swing(bar)} by a law over"
                f" {write_digits(last - first)} s"
            )
        else:
            name = "stroke" if self.unit == "m" else BAR_NAMES[bar]
            begin = (
                f"{name} from {self._place(first, named=False)} to"
                f" {self._place(last, named=False)}{self._write_inset()}"
            )
        following = [2, 4] if facts.kind == "released" else [4 if bar != 4 else 2]
        return "; ".join(
            [
                begin,
                *(
                    f"{BAR_NAMES[number]} {self._write_swing(number)}"
                    for number in following
                ),
            ]
        )

    def _write_inset(self) -> str:
        """Write how far a range that the scene leaves out stays inside the limits."""
        motion = self.facts.scene.motion
        linkage = self.facts.scene.linkage
        bar = motion.bar
        stated = motion.angle is not None or motion.stroke is not None
        if stated or turns_fully(linkage, bar):
            return ""
        first, last = self.facts.ends
        inset = min(
            (first - low) % TURN
            for low, high in find_intervals(linkage, bar)
            if (first - low) % TURN <= high - low
        )
        inside, low, high = map(self._angle, (inset, first - inset, last + inset))
        return f", {inside} inside its limits {low} and {high}"

    def _write_swing(self, bar: int) -> str:
        low, high = self.facts.angles[bar]
        if self.facts.kind == "turn" and high.value - low.value > 2.0 * math.pi - 1e-9:
            return "turns fully"
        if self.facts.kind == "law" and bar == self.facts.solution.at.bar:
            return f"from {self._angle(low.value)} to {self._angle(high.value)}"
        places = [self._place(end.place, named=False) for end in (low, high)]
        if self.unit == "rad":  # the unit stands next to it
            places = [place.split(_NBSP)[0] for place in places]
        width, start, stop = (
            self._angle(angle)
            for angle in (high.value - low.value, low.value, high.value)
        )
        return (
            f"swings {width}, from {start} ({self.symbol}{_NBSP}={_NBSP}{places[0]}) to"
            f" {stop} ({places[1]})"
        )

    def _write_release(self) -> str:
        free = self.facts.scene.motion.free
        solution = self.facts.solution
        assert free is not None
        begin = f"released for {write_digits(free.duration)} s, without a drive"
        if self.facts.period is not None:
            begin += f", period {write_digits(self.facts.period)} s"
        if not solution.change_points:
            return begin
        times = " and ".join(f"{write_digits(t)} s" for t in solution.change_points)
        return (
            f"{begin}; at t = {times} all bars are in line, where another motion is"
            " possible"
        )

    def _write_stretches(self) -> list[str]:
        """Write where the assembly ends."""
        parts = []
        for low, high in self.facts.motion.stretches:
            if low is None:
                start = ""
            else:
                start = f"from {self._place(low, named=self.unit != 'm')}"
            if high is None:
                stop = ""
            else:
                stop = f"up to {self._place(high, named=self.unit != 'm')}"
            parts.append(f"{start} {stop}".strip())
        return [f"assembles {', and '.join(parts)}"] if parts else []

    def _write_drive(self, pressure: float | None) -> list[str]:
        """Write what drives: peak and mean, power and energy, and its needs.

        The needs are those of a motor or a cylinder.
        """
        facts = self.facts
        if facts.drive is None:
            return []
        drive = facts.drive
        word = "force" if facts.linear else "torque"
        lines = [self._write_drive_head(), self._row(word, self._write_peak())]
        if facts.held:
            lines.append(self._row("at rest", self._write_held(drive.unit)))
        if facts.stroke_range is not None:
            lines += self._write_stroke()
        lines += self._write_power()
        if pressure is not None and facts.stroke_range is not None:
            lines += self._write_bore(pressure)
        return lines

    def _write_peak(self) -> str:
        """Write the largest and the RMS value of the drive's torque or force."""
        facts = self.facts
        drive = facts.drive
        assert drive is not None
        if facts.peak is None:
            return self._write_growth(drive.keys.value)
        peak = self._value(self._without_rounding(facts.peak.value), drive.unit)
        if facts.duty is None:
            return peak
        row = f"peak {peak} at {self._place(facts.peak.place)}{self._of_positions}"
        rms = facts.duty.rms_force if facts.linear else facts.duty.rms_torque
        if rms is None:
            return row
        rms = self._without_rounding(rms)
        return f"{row}, RMS {self._beside(rms, drive.unit, facts.peak.value)}"

    def _write_growth(self, name: str) -> str:
        """Write where a quantity grows without bound."""
        poles = self.facts.motion.panels.list_poles(name)
        places = [self._place(pole, named=False) for pole in poles[:_MOST_POLES]]
        if len(poles) > _MOST_POLES:
            places.append(f"{len(poles) - _MOST_POLES} more places")
        places[0] = self._place(poles[0])
        return f"grows without bound at {' and '.join(places)}"

    @property
    def _of_positions(self) -> str:
        """Say that a peak is that of the positions, between which nothing stands."""
        return " (of these positions)" if self.facts.kind == "list" else ""

    def _write_held(self, unit: str) -> str:
        """Write between which torques or forces dry friction holds, and where."""
        facts = self.facts
        parts = []
        for held in facts.held[:_MOST_HELD]:
            size = max(abs(held.low), abs(held.high))
            low = self._value(held.low, unit, size)
            high = self._value(held.high, unit, size)
            first, last = held.ends
            if len(facts.solution) == 1:
                return f"{low} to {high}: dry friction holds it between them"
            if first == last:
                parts.append(f"{low} to {high} at {self._place(first)}")
            else:
                until = self._place(last, named=False)
                parts.append(
                    f"{low} to {high} over {self._place(first)} to {until}, a part of"
                    " it at each position"
                )
        if len(facts.held) > _MOST_HELD:
            parts.append(f"and at {len(facts.held) - _MOST_HELD} more places")
        return f"{', '.join(parts)}: dry friction holds"

    def _without_rounding(self, value: float) -> float:
        """Return zero for a torque or force of the drive within its rounding."""
        if self.facts.drive is not None and abs(value) <= self._rounding:
            return 0.0
        return value

    @cached_property
    def _rounding(self) -> float:
        """Rounding of the drive's torque or force, or its error bar if that is more."""
        rounding = find_drive_rounding(self.facts.solution)
        drive = self.facts.drive
        if drive is None or drive.error is None:
            return rounding
        return max(rounding, float(np.nanmax(drive.error, initial=0.0)))

    def _is_balanced(self) -> bool:
        """Tell whether the drive has nothing to do: its peak is rounding alone."""
        peak = self.facts.peak
        drive = self.facts.drive
        if peak is None or drive is None or drive.values is None:
            return False
        if not np.nan_to_num(drive.values).any():
            return False
        return not self._without_rounding(peak.value)

    def _write_power(self) -> list[str]:
        """Write power and energy of the drive, and what a motor must have."""
        facts, duty, power = self.facts, self.facts.duty, self.facts.solution.power
        if duty is None:
            one = float(power[0]) if power is not None else 0.0
            if facts.peak is not None and not self._without_rounding(facts.peak.value):
                one = 0.0
            if one:
                return [self._row("power", self._value(one, "W"))]
            return []
        if duty.peak_power == 0.0 or self._is_balanced():
            return []
        if duty.peak_power is None:
            row = self._write_growth("power")
        else:
            row = f"peak {self._value(duty.peak_power, 'W')}{self._of_positions}"
        if (
            facts.kind != "list"
            and duty.energy_in is not None
            and duty.energy_out is not None
        ):
            over = "over the motion" if facts.kind == "law" else "over the sweep"
            if facts.kind == "turn":
                turns = round(abs(facts.ends[1] - facts.ends[0]) / (2.0 * math.pi))
                over = "per turn" if turns == 1 else f"in {turns} turns"
            most = max(duty.energy_in, duty.energy_out)
            forward, back = (
                self._value(energy, "J", most)
                for energy in (duty.energy_in, duty.energy_out)
            )
            row += f"; {forward} {over} given, {back} taken back"
        lines = [self._row("power", row), *self._write_cycle(duty)]
        if not facts.linear:
            lines.append(f"motor: {self._write_motor_needs(duty)}")
        return lines

    def _write_motor_needs(self, duty: MotorDuty) -> str:
        """Write the torque, speed and power that a motor must have."""
        if duty.peak_torque is None or duty.peak_speed is None:
            word = "speed" if duty.peak_speed is None else "torque"
            return f"none is enough, as the {word} grows without bound"
        assert duty.peak_power is not None
        torque = self._value(duty.peak_torque, "N m")
        speed = self._value(duty.peak_speed, "rad/s")
        mean = ""
        if duty.rms_torque is not None:
            rms = self._beside(duty.rms_torque, "N m", duty.peak_torque)
            mean = f" (RMS {rms})"
        power = self._value(duty.peak_power, "W")
        return f"at least {torque} at {speed}{mean}, {power}"

    def _write_cycle(self, duty: MotorDuty) -> list[str]:
        """Write the mean torque of a closed sweep, and what a flywheel must store."""
        if duty.energy_swing is None:
            return []
        energy = self._value(duty.energy_swing, "J")
        swing = f"energy swings by {energy} about the mean"
        if duty.mean_torque is None:
            return [self._row("cycle", swing)]
        mean_torque = self._without_rounding(duty.mean_torque)
        mean = self._beside(mean_torque, "N m", duty.peak_torque)
        return [self._row("cycle", f"mean torque {mean}; {swing}")]

    def _write_drive_head(self) -> str:
        scene, motion = self.facts.scene, self.facts.scene.motion
        where = describe_drive(scene)
        head = f"cylinder {where.removeprefix('along a line ')}"
        if scene.drive is not None and not scene.drive.has_stroke:
            head = f"force {where}"
        if scene.drive is None:
            head = f"drive on the {BAR_NAMES[scene.drive_bar]}"
        if motion.speed is None:
            if motion.law is None:
                return head
            return f"{head}, by a law over time"
        si = "rad/s" if motion.stroke is None else "m/s"
        drives = motion.stroke is not None or (
            scene.drive is None and scene.drive_bar == motion.bar
        )
        if np.any(motion.speed):
            speed = write_ends(motion.speed, lambda x: self._value(x, si))
        else:
            speed = "at rest"
        if not drives:
            at = "at " if np.any(motion.speed) else ""
            speed = f"the {BAR_NAMES[motion.bar]} {at}{speed}"
        if np.any(motion.acceleration):
            growth = write_ends(
                motion.acceleration, lambda x: self._value(x, f"{si}^2")
            )
            speed += f", {motion.names[2]} = {growth}"
        return f"{head}, {speed}"

    def _write_stroke(self) -> list[str]:
        """Write the stroke, over what it assembles, and its speed."""
        facts = self.facts
        lines = list[str]()
        assert facts.stroke_range is not None
        low, high = (
            self._value(x.value, "m", self.longest) for x in facts.stroke_range
        )
        row = low if facts.kind == "position" else f"{low} to {high}"
        if facts.stroke_limits is not None:
            ends = (self._value(x, "m", self.longest) for x in facts.stroke_limits)
            row += "; assembles from {} to {}".format(*ends)
        lines.append(self._row("stroke", row))
        speed = facts.solution.stroke_speed
        if (
            speed is not None
            and facts.scene.motion.stroke is None
            and np.nanmax(np.abs(speed)) > 0.0
        ):
            largest = float(np.nanmax(np.abs(speed)))
            if facts.duty is None:
                row = self._value(largest, "m/s")
            elif facts.duty.peak_speed is None:
                row = self._write_growth("speed")
            else:
                peak = self._value(facts.duty.peak_speed, "m/s")
                row = f"peak {peak}{self._of_positions}"
            lines.append(self._row("speed", row))
        return lines

    def _write_bore(self, pressure: float) -> list[str]:
        """Write the bore that pushes, and the area that pulls, at a pressure."""
        if self.facts.peak is None:
            none = "none is enough, as the force grows without bound"
            return [self._row("bore", none)]
        panels = self.facts.motion.panels
        parts = []
        for sense, does in (
            (1, " to push"),
            (-1, ", and the rod's area besides, to pull"),
        ):
            force = sense * panels.find_peak(LINE.value, sense).value
            if force > 0.0:
                bore = math.sqrt(4.0 * force / (math.pi * pressure))
                parts.append(
                    f"{self._value(bore, 'm')}{does} {self._value(force, 'N')}"
                )
        if parts:
            return [self._row("bore", f"at least {'; '.join(parts)}")]
        return []

    def _write_pins(self) -> list[str]:
        """Write the loads of the four pins, side by side."""
        facts, loads = self.facts, self.facts.pins.values()
        if not loads:
            return []
        peaks = [load.peak for load in loads]
        rows = [
            ("pins", list(facts.pins)),
            ("  peak", self._cells_of_peaks(peaks, "N")),
            ("  at", self._places_of_peaks(peaks, [*PIN_FORCES])),
        ]
        means = [load.rms for load in loads]
        if any(mean is not None for mean in means):
            rows.append(("  RMS", self._cells(self._without_small(means), "N")))
        lines = _align(rows, self.width)
        if facts.kind in ("list", "released"):
            return [*lines, "  peak and RMS are those of these positions"]
        return lines

    def _write_bending(self) -> list[str]:
        """Write the largest bending moment of each bar, with its place and position."""
        facts = self.facts
        peaks = [bar.peak for bar in facts.bending.values()]
        if all(peak is not None and peak.value == 0.0 for peak in peaks):
            return []
        names = [f"bending_{bar}" for bar in facts.bending]
        places = self._places_of_peaks(peaks, names)
        for index, bar in enumerate(facts.bending.values()):
            if bar.peak is not None and bar.peak.value:
                along = self._value(bar.x, "m", self.longest)
                in_motion = "" if facts.kind == "position" else f", {places[index]}"
                places[index] = f"{along}{in_motion}"
        rows = [
            ("bending", [f"bar {bar}" for bar in facts.bending]),
            ("  moment", self._cells_of_peaks(peaks, "N m")),
            ("  at x", places),
        ]
        stresses = self._write_stresses()
        if any(stress != "-" for stress in stresses):
            rows.append(("  stress", stresses))
        return [*_align(rows, self.width), *list_couple_notes(facts.scene)]

    def _write_stresses(self) -> list[str]:
        """Write the largest bending stress of each bar.

        A bar without a cross-section has a dash.
        """
        stresses = list[float | None]()
        for bar, bending in self.facts.bending.items():
            modulus = self.facts.scene.linkage.bar(bar).section_modulus
            if bending.peak is None or modulus is None:
                stresses.append(None)
            else:
                stresses.append(bending.peak.value / modulus)
        return self._cells(stresses, "Pa")

    def _list_sizes(self, peaks: list[Peak | None]) -> list[float | None]:
        """List the values of peaks of one kind; None: without a bound."""
        return self._without_small([peak and peak.value for peak in peaks])

    @staticmethod
    def _without_small(values: list[float | None]) -> list[float | None]:
        """Return zero for what is rounding of the largest of their kind."""
        largest = max((abs(value) for value in values if value), default=0.0)
        least = SHOWN_AS_ZERO * largest
        return [0.0 if value and abs(value) <= least else value for value in values]

    def _cells_of_peaks(self, peaks: list[Peak | None], unit: str) -> list[str]:
        """Write largest values of one kind, and which have no bound."""
        return self._cells(self._list_sizes(peaks), unit, _NO_LARGEST)

    def _places_of_peaks(
        self,
        peaks: list[Peak | None],
        names: list[str],
    ) -> list[str]:
        """Write where largest values of one kind are taken, or grow without bound."""
        panels = self.facts.motion.panels
        places = []
        for peak, size, name in zip(peaks, self._list_sizes(peaks), names, strict=True):
            if peak is None:
                places.append(self._place(panels.list_poles(name)[0], named=False))
            else:
                places.append(self._place(peak.place, named=False) if size else "-")
        return places

    def _cells(
        self, values: list[float | None], unit: str, missing: str = "-"
    ) -> list[str]:
        """Write quantities of one kind; `missing` stands for none."""
        largest = max((abs(value) for value in values if value), default=0.0)
        return [
            missing if value is None else self._value(value, unit, largest)
            for value in values
        ]

    def _write_remarks(self) -> list[str]:
        """Write where pin forces jump, and what rounding does."""
        facts = self.facts
        lines = list[str]()
        if (
            facts.solution.change_points
            and facts.pins
            and has_growing_forces(facts.scene, facts.solution)
        ):
            lines.append(
                "at a change point pin forces grow without bound: the peaks are those "
                "of these instants"
            )
        if facts.pins and not facts.motion.is_steady:
            lines.append(
                "the positions are passed at no one speed: no RMS values, no energies"
            )
        if facts.motion.reversals:
            unit = facts.solution.at.unit
            places = ", ".join(  # of a motion law too by its angle, not by its time
                f"{self._value(place, unit, self.longest if unit == 'm' else None)}"
                f" ({pin})"
                for place, pin in facts.motion.reversals
            )
            name = facts.solution.commanded
            lines.append(
                f"dry friction reverses, and the pin forces jump, at {name} = {places}"
            )
        lines += self._warn()
        lines += list_drawn_notes(facts.scene, self.units)
        lines += list_arm_notes(facts.scene)
        lines += list_law_notes(facts.scene, self.units)
        lines += list_spring_notes(facts.scene, facts.solution, self.units)
        if facts.drive is not None and self._is_balanced():
            lines.append(f"the {facts.drive.name} is zero within rounding")
        elif facts.error is not None:
            if facts.error:
                below = f"below 1e{math.ceil(math.log10(facts.error)):+03d}"
            else:
                below = "zero"
            changed = "none of these" if facts.error < self._changes_a_digit else "some"
            lines.append(
                f"rounding changes {changed} digits (worst error bar {below} of the"
                " value)"
            )
        return lines

    @property
    def _changes_a_digit(self) -> float:
        """Part of a value that changes the last digit shown."""
        return _HALF_OF_LAST * 10.0 ** (1 - self.digits) / 10.0

    def _warn(self) -> list[str]:
        """Write where the drive's torque or force has few digits left.

        The warning names the collinear bars that cost the digits.
        """
        solution = self.facts.solution
        drive = self.facts.drive
        if (
            drive is None
            or drive.error is None
            or solution.drive_condition is None
            or drive.values is None
        ):
            return []
        # of those that matter: one that passes through zero has no digits, and needs
        # none
        with np.errstate(invalid="ignore"):
            sizes = np.abs(drive.values)
            reference = np.maximum(sizes, np.nanmedian(sizes))
            reference[reference == 0.0] = np.nan
            share = drive.error / reference
        largest = np.nanmax(np.abs(drive.values), initial=0.0)
        if self._without_rounding(float(largest)) == 0.0:  # nothing has digits to lose
            return []
        if not np.nanmax(share, initial=0.0) > _FEW_DIGITS:
            return []
        worst = int(np.nanargmax(share))
        digits = max(math.floor(-math.log10(share[worst])), 0)
        place = solution.at.places if solution.time is None else solution.time
        start = (
            f"{digits} digits left of {drive.symbol} at"
            f" {self._place(float(place[worst]))}"
        )
        commanded = BARS_IN_LINE[solution.at.bar]
        sines = {commanded: solution.condition[worst]}
        if solution.drive is not None:
            lever = solution.drive_condition[worst]
            sine = sines[commanded]
            return [
                f"{start}: of its lever {lever:.2g}, of the sine of bars {commanded}"
                f" {sine:.2g} is left"
            ]
        sines[BARS_IN_LINE[solution.drive_bar]] = solution.drive_condition[worst]
        bars = min(sines, key=lambda pair: sines[pair])
        gap = math.asin(min(sines[bars], 1.0))
        apart = write_short(gap, "rad", self.units, digits=2)
        meeting = _name_meeting(bars)
        return [f"{start}: bars {bars} are {apart} from being {meeting}"]

    @staticmethod
    def _row(label: str, text: str) -> str:
        return f"  {label:<{INDENT - 2}}{text}"


def _name_meeting(bars: str) -> str:
    """Name what two bars of `BARS_IN_LINE` are; bars 2 and 4 share no pin."""
    return "parallel" if bars == BARS_IN_LINE[3] else "in line"


def _align(rows: list[tuple[str, list[str]]], most: int) -> list[str]:
    """Write rows of a label and cells that stand below each other.

    Cells beyond so many columns follow in further rows of the same labels.
    """
    width = max(LEAST_COLUMN, 2 + max(len(cell) for _, cells in rows for cell in cells))
    fitting = max(1, (most - INDENT + 2) // width)
    return [
        f"{label:<{INDENT}}{''.join(f'{cell:<{width}}' for cell in part)}".rstrip()
        for first in range(0, len(rows[0][1]), fitting)
        for label, cells in rows
        if (part := cells[first : first + fitting])
    ]


def write_motor(
    scene: Scene,
    solution: Solution,
    units: Conversion,
) -> dict[str, Any] | None:
    """Return the duty and the loads of the pins as the JSON has them.

    Numbers have the units of the output, and the keys are those of `motor_duty`.
    """
    duty = motor_duty(solution)
    if duty is None:
        return None
    si = DUTY_UNITS if solution.drive is None else {**DUTY_UNITS, "peak_speed": "m/s"}
    shown = {name: find_unit_in(unit, units) for name, unit in si.items()}
    force = find_unit_in("N", units)[1]
    angle = find_unit_in("rad", units)[1]

    def convert(number: float | None, factor: float) -> float | None:
        return None if number is None else number * factor

    loads = {pin: bearing_load(solution, pin) for pin in PIN_FORCE}
    return {
        "closed": duty.closed,
        **{name: convert(getattr(duty, name), shown[name][1]) for name in si},
        "pins": {
            pin: {
                "peak": convert(load.largest, force),
                "rms": convert(load.rms, force),
                "theta_2": convert(load.where, angle),
            }
            for pin, load in loads.items()
        },
        "units": {name: unit for name, (unit, _) in shown.items()},
    }
