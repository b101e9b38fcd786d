"""Output of `analyze`: one block of aligned lines, at most 80 columns wide."""

import math
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from itertools import chain

import numpy as np

from fourbar.errors import clean_line, write_count
from fourbar.formulas.mobility import (
    PARALLELOGRAM,
    TURN,
    change_points,
    classify,
    find_miss,
    list_met_equalities,
    name_assembly,
    turns_fully,
)
from fourbar.linkage import BAR_NAMES, MOVING_BARS, PIN_FORCE
from fourbar.quantities import (
    CHANGE_POINT,
    JAMMED,
    LINE,
    OK,
    PIN_FORCES,
    SEVERAL,
    STATUS_NAMES,
    WOUND,
    Array,
)
from fourbar.scene.motion import BRANCH_NAMES
from fourbar.show.acting import list_couple_notes, list_notes, write_stretch
from fourbar.show.change_point import has_growing_forces
from fourbar.show.columns import explain_static
from fourbar.show.driving import name_places
from fourbar.show.duty import MotorDuty
from fourbar.show.lines import find_block_width, wrap_line
from fourbar.show.motion_curves import (
    MotionCurves,
    acts,
    find_drive_rounding,
    find_largest,
)
from fourbar.show.panels import LOWER, TIED, UPPER, Peak
from fourbar.show.position_sheet import PositionSheet
from fourbar.show.shown_units import (
    COMMON,
    POSITION_DIGITS,
    SHOWN_AS_ZERO,
    SHOWN_DIGITS,
    choose_unit,
    drop_place_rounding,
    drop_rounding,
    write_digits,
    write_ends,
    write_short,
)
from fourbar.show.summary import Facts
from fourbar.solution import Conversion, Solution, find_unit_in
from fourbar.studies.paths import measure_paths

_NBSP = "\u00a0"
"""Stands between a number and its unit until the lines are broken."""
INDENT = 11
"""Width of what stands before a row."""
_FEW_DIGITS = 1e-8
"""Error bar over the value from which on the block says where digits are lost. Half of
the digits of a double are lost then.
"""
OF_ONE_PREFIX = 1e-4
"""Part of the largest of its kind below which a quantity has a prefix of its own."""
FAR_BELOW_PEAK = 0.1
"""Part of its peak below which a mean has a prefix of its own: it would begin with 0.0.
In a table all of one kind have one prefix, to be compared at a glance.
"""
_MOST_PLACES = 4
"""Number of places that are listed: of poles, and where dry friction holds a pin."""
_BENDING = [f"bending_{bar}" for bar in MOVING_BARS]
"""Names of the curves of the bending moments."""
BARS_IN_LINE = {2: "3 and 4", 3: "2 and 4", 4: "2 and 3"}
"""Bars that are in line where a command of a bar, or a drive on it, loses digits."""
LEAST_COLUMN = 12
"""Least width of a column."""
_HALF_OF_LAST = 0.5
"""Part of the last digit shown from which on an error bar changes it."""
_BESIDE_CHANGE_POINT = 1e-9
"""rad; an angle nearer to a change point is rounded from it: files state angles with
nine decimals and more.
"""
_NO_ANGLE = 1e-14
"""rad; rounding of an angle of a turn."""


class SceneBlock(Facts):
    """Facts of a solved scene with the units that they are written in.

    Parameters
    ----------
    solution : as of `Facts`.
    units : units of the numbers; one that is left out is the SI unit with a prefix.
    pressure : pressure of a cylinder, Pa; adds the bore that it needs.
    width : that of a terminal.
    """

    def __init__(
        self,
        solution: Solution,
        units: Conversion = COMMON,
        pressure: float | None = None,
        width: int | None = None,
    ) -> None:
        super().__init__(solution)
        self.linkage = self.scene.linkage
        self.pressure = pressure
        self.width = find_block_width(width)
        self.units = units
        self.digits = POSITION_DIGITS if self.kind == "position" else SHOWN_DIGITS
        self.longest = max(self.linkage.lengths)
        self.symbol, self.unit = name_places(solution)

    def write(self, *, headed: bool = True) -> list[str]:
        """Write all paragraphs; a blank line parts them. `headed`: with the linkage."""
        paragraphs = [self._write_motion(), self._write_loads()]
        if self.kind == "position":
            paragraphs = self._list_paragraphs_of_position()
        if headed:
            paragraphs[0] = chain(self._write_head(), paragraphs[0])
        lines: list[str] = []
        for paragraph in filter(None, map(list, paragraphs)):
            lines.append("")
            for line in paragraph:
                lines += wrap_line(line, self.width)
        return [line.replace(_NBSP, " ") for line in lines[1:]]

    def _write_loads(self) -> Iterator[str]:
        """Write the drive, the loads of pins and bars, and remarks.

        If nothing acts, it writes the rates.
        """
        if acts(self.scene):
            yield from self._write_drive()
            yield from self._write_pins()
            yield from self._write_bending()
            yield from self._write_remarks()
            return
        yield from self._write_stroke()
        solution = self.solution
        if self.kind != "position" and solution.omega_4 is not None:
            # over time all bars follow
            commanded = 0 if solution.time is not None else solution.at.bar
            bars = [bar for bar in MOVING_BARS if bar != commanded]
            heads = [f"bar {bar} ({BAR_NAMES[bar]})" for bar in bars]
            rows = [("rates", heads)]
            for label, unit in (("omega", "rad/s"), ("alpha", "rad/s^2")):
                names = [f"{label}_{bar}" for bar in bars]
                cells, places = self._write_peaks(names, unit)
                rows += [(f"  {label}", cells), ("  at", places)]
            yield from _align(rows, self.width)
            yield "no mass, load or effect: nothing loads pins and drive"

    def _list_paragraphs_of_position(self) -> list[Iterator[str]]:
        """List the paragraphs of one position: motion, forces, ratios."""
        sheet = PositionSheet(self.solution, self.units)
        one = self.solution
        place = self._value(float(one.at.stated[0][0]), one.at.unit)
        at = f"at {one.commanded} = {place}"
        if one.time is not None:
            at += f", t = {self._value(float(one.time[0]), 's', 1.0)}"
        motion = chain([at], self._write_statuses())
        loads = [self._write_stroke()]
        if self.solution.F12 is not None and acts(self.scene):
            from_rest = self._list_from_rest(PIN_FORCES, "N")
            forces = sheet.write_pin_forces()
            if from_rest:
                rows = [("pins", [*PIN_FORCE]), *from_rest]
                forces += _align(rows, self.width)
            loads = [chain(self._write_drive(), forces), self._write_bending()]
        return [
            motion,
            iter(sheet.write_bars()),
            iter(sheet.write_points()),
            *loads,
            chain(sheet.write_ratios(), self._write_static_hint()),
            self._write_remarks(),
        ]

    def _value(
        self,
        value: float,
        unit: str,
        largest: float | None = None,
        least: float = OF_ONE_PREFIX,
    ) -> str:
        """Write a quantity of an SI unit, with a prefix that suits it.

        `largest`: of its kind, which then chooses the prefix unless the quantity is
        below this part of it, `least`; None: the quantity does.
        """
        if largest is not None:
            largest = abs(largest)
            if 0.0 < abs(value) < least * largest:
                largest = None
        text = write_short(value, unit, self.units, largest, self.digits)
        return text.replace(" ", _NBSP)

    def _place(self, place: float, *, named: bool = True) -> str:
        """Write a place as "theta_2 = 22.8 deg", or without its name."""
        first, last = self.ends
        shown = drop_place_rounding(place, last - first)
        largest = {"m": self.longest, "s": 1.0}.get(self.unit)
        text = self._value(shown, self.unit, largest)
        return f"{self.symbol}{_NBSP}={_NBSP}{text}" if named else text

    def _angle(self, angle: float) -> str:
        return self._value(0.0 if abs(angle) < _NO_ANGLE else angle, "rad")

    def _write_head(self) -> Iterator[str]:
        """Write what the linkage is: type, title, branch, lengths, change points."""
        motion = self.scene.motion
        name = name_assembly(self.linkage, motion.bar, motion.branch)
        title = f' "{clean_line(self.scene.title)}"' if self.scene.title else ""
        of_bar = "" if motion.bar == 2 else f" of the command {motion.commanded}"
        branch = f"{BRANCH_NAMES[motion.branch]} branch{of_bar}"
        name = f"{name[0].upper()}{name[1:]}{title}, {branch}:"
        factor, unit = choose_unit(self.longest, "m", self.units)
        bars = zip(BAR_NAMES.values(), self.linkage.lengths, strict=True)
        lengths = [f"{bar} {write_digits(factor * length)}" for bar, length in bars]
        line = f"{name} {', '.join(lengths)} {unit}"
        if len(line) <= self.width:
            yield line
        else:
            yield name
            yield f"    {line.removeprefix(name).strip()}"
        yield from self._write_change_points()

    def _write_motion(self) -> Iterator[str]:
        """Write how far the linkage moves, and how well it transmits."""
        least = self.transmission
        yield self._write_ranges()
        yield (
            f"transmission angle: at least {self._angle(least.value)}, at"
            f" {self._place(least.place)}"
        )
        yield from self._write_statuses()
        stretches = [
            write_stretch(self.solution, stretch, self.units)
            for stretch in self.motion.stretches
        ]
        if stretches:
            yield f"assembles {', and '.join(stretches)}"
        yield from self._write_static_hint()

    def _write_statuses(self) -> Iterator[str]:
        """Write how many positions have which status, where one is not ok."""
        codes = self.solution.status_code
        away = self._measure_to_change_points()
        beside = (codes == OK) & (away <= _BESIDE_CHANGE_POINT)
        words = [name.replace("_", " ") for name in STATUS_NAMES]
        words[CHANGE_POINT] = "at a change point"
        furthest = self._angle(float(np.max(away, where=beside, initial=0.0)))
        words.append(f"within {furthest} of a change point")
        counts = np.bincount(np.where(beside, len(STATUS_NAMES), codes))
        if counts[OK] == len(codes):
            return
        parts = [f"{counts[code]} {words[code]}" for code in np.flatnonzero(counts)]
        yield f"{write_count(len(codes), 'position')}: {', '.join(parts)}"
        # statuses of positions between which no forces exist either
        if self.has_forces and np.isin(codes, (WOUND, JAMMED, SEVERAL)).any():
            yield "    peaks and means are without the positions that have no forces"

    def _measure_to_change_points(self) -> Array:
        """Measure how far each position is from the nearest change point, rad, (n,).

        The rounding of the angle keeps a position from the change point that is meant.
        """
        at = self.solution.at
        away = at.angle[:, None] - np.array(change_points(self.linkage, at.bar))
        away = np.abs(away - TURN * np.rint(away / TURN))
        return np.asarray(np.min(away, axis=1, initial=np.inf))

    def _write_static_hint(self) -> Iterator[str]:
        """Say what asks for forces, if a scene with loads states positions alone."""
        if self.solution.F12 is None and acts(self.scene):
            yield f"positions only, since {self.scene.motion.names[1]} is left out:"
            yield f"    {explain_static(self.scene)}"

    def _write_change_points(self) -> Iterator[str]:
        """Write where change points lie and what the assembly does there.

        If there is none, write how nearly there would be one.
        """
        linkage = self.linkage
        bar = self.scene.motion.bar
        points = change_points(linkage, bar)
        met = self.scene.met_lengths
        if met is not None and met[1] == linkage.lengths:
            equal = [
                f"{first} and {second}, which differ by {self._value(gap, 'm')}"
                for first, second, gap in list_met_equalities(*met)
            ]
            if equal:
                yield (
                    "lengths read as equal within the last decimals of what is stated:"
                    f" {'; '.join(equal)}"
                )
        if (miss := find_miss(linkage)) is not None:
            has = "one change point, not two" if points else "no change point"
            yield f"misses a {miss[1]} by {self._value(miss[0], 'm')}: it has {has}"
        if not points:
            return
        if bar == 3 and classify(linkage).name == PARALLELOGRAM:
            yield "no theta_3 moves the parallelogram, whose coupler does not turn"
        line = f"change point{'s' if len(points) > 1 else ''} at theta_{bar} ="
        line += f" {' and '.join(map(self._angle, points))}"
        if len(points) == 1 and turns_fully(linkage, bar):
            line += (
                ": the assembly repeats after two turns, open and crossed are one "
                "motion, a turn apart"
            )
        yield line

    def _write_ranges(self) -> str:
        """Write how far the commanded bar goes, or the stroke, and the output.

        If the output is commanded, it is the input.
        """
        kind = self.kind
        bar = self.solution.at.bar
        first, last = self.ends
        name = BAR_NAMES[bar]
        following = [4 if bar != 4 else 2]
        start, stop = (self._place(end, named=False) for end in (first, last))
        if kind == "turn":
            begin = f"{name} turns fully"
        elif kind == "list":
            begin = write_count(len(self.solution), "position")
            begin += f" from {self._place(first)} to {stop}"
        elif kind == "released":
            begin = self._write_release()
            following = [2, 4]
        elif kind == "law":
            begin = f"{name} {self._write_swing(bar)} by a law over"
            begin += f" {write_digits(last - first)} s"
        else:
            name = "stroke" if self.unit == "m" else name
            begin = f"{name} from {start} to {stop}"
        swings = [
            f"{BAR_NAMES[other]} {self._write_swing(other)}" for other in following
        ]
        return "; ".join([begin, *swings])

    def _write_swing(self, bar: int) -> str:
        swings = [self._write_range(bar, *ends) for ends in self.angles[bar]]
        return " and, in the other circuit, ".join(swings)

    def _write_range(self, bar: int, low: Peak, high: Peak) -> str:
        width = high.value - low.value
        if self.kind == "turn" and width > 2.0 * math.pi - 1e-9:
            return "turns fully"
        start = f"from {self._angle(low.value)}"
        stop = f"to {self._angle(high.value)}"
        if self.kind == "law" and bar == self.solution.at.bar:
            return f"{start} {stop}"
        places = [self._place(end.place, named=False) for end in (low, high)]
        if self.unit == "rad":  # the unit stands next to it
            places = [place.split(_NBSP)[0] for place in places]
        return (
            f"swings {self._angle(width)}, {start}"
            f" ({self.symbol}{_NBSP}={_NBSP}{places[0]}) {stop} ({places[1]})"
        )

    def _write_release(self) -> str:
        free = self.scene.motion.free
        assert free is not None
        begin = f"released for {write_digits(free.duration)} s, without a drive"
        if self.period is not None:
            begin += f", period {write_digits(self.period)} s"
        at = self.solution.with_extremes
        assert at is not None and at.time is not None and at.speed is not None
        last = max(np.flatnonzero(at.speed), default=0)  # the instant of the stop
        if last < len(at.time) - 1:
            place = self._value(float(self.solution.theta_2[-1]), "rad")
            begin += (
                f", at rest from t = {write_digits(float(at.time[last]))} s on,"
                f" at theta_2{_NBSP}={_NBSP}{place}"
            )
        instants = self.solution.change_points or ()
        if times := " and ".join(f"{write_digits(t)} s" for t in instants):
            begin += f"; at t = {times} all bars are in line, where another motion is"
            begin += " possible"
        return begin

    def _write_drive(self) -> Iterator[str]:
        """Write what drives: peak and mean, power and energy, and its needs.

        The needs are those of a motor or a cylinder.
        """
        if not self.drives:
            return
        yield self._write_drive_head()
        kind = "torque" if self.scene.drive is None else "force"
        yield _row(kind, self._write_peak())
        if self.held and math.isfinite(self.peak.value):
            name = "at rest" if self.is_held_at_rest else "range"
            yield _row(name, self._write_held(self.drive.unit))
        started = self.motion.started
        start = self.motion.start
        row = self._write_growth(self.drive.keys.value, *started)
        if math.isfinite(start.value):
            row = self._value(start.value, self.drive.unit)
            row += f" at {self._place(start.place)}"
        if row and started[0] is not self.motion:
            yield _row("to start", f"{row}, against dry friction")
        yield from self._write_stroke()
        yield from self._write_power()
        if self.pressure is not None and self.stroke_ranges:
            yield from self._write_bore(self.pressure)

    def _write_peak(self) -> str:
        """Write the largest and the RMS value of the drive's torque or force."""
        drive = self.drive
        if math.isinf(self.peak.value):
            return self._write_growth(drive.keys.value)
        largest = self._without_rounding(self.peak.value)
        peak = self._value(largest, drive.unit)
        if self.duty is None:
            return peak
        row = f"peak {peak} at {self._place(self.peak.place)}{self._of_positions}"
        rms = self._without_rounding(self.motion.find_rms(drive.keys.value))
        if math.isnan(rms):
            return row
        return f"{row}, RMS {self._value(rms, drive.unit, largest, FAR_BELOW_PEAK)}"

    def _write_growth(self, name: str, *motions: MotionCurves) -> str:
        """Write where a quantity grows without bound, of this motion or of others.

        The text is empty where it does not.
        """
        poles = [
            self._place(pole, named=False)
            for motion in motions or [self.motion]
            for pole in motion.panels.list_poles(name)
        ]
        places = " and ".join(_shorten([*dict.fromkeys(poles)]))
        at = f"{self.symbol}{_NBSP}={_NBSP}{places}"
        return f"grows without bound at {at}" if poles else ""

    @property
    def _of_positions(self) -> str:
        """Say that a peak is that of the positions, between which nothing stands."""
        return " (of these positions)" if self.kind == "list" else ""

    def _write_held(self, unit: str) -> str:
        """Write between which torques or forces dry friction holds, and where."""
        rests = "dry friction holds"
        if not self.is_held_at_rest:
            rests = "a pin with dry friction rests"
        growth = self._write_growth(self.drive.keys.value, *self.motion.begun)
        parts = [growth] if growth else []
        for least, most, ends, varies in () if growth else self.held:
            bounds = [*map(self._without_rounding, (least, most))]
            size = max(map(abs, bounds))
            holds = " to ".join(self._value(bound, unit, size) for bound in bounds)
            if ends is not None and len(self.solution) > 1:
                first, last = ends
                over = f"over {self._place(first)} to {self._place(last, named=False)}"
                holds += f" {f'at {self._place(first)}' if first == last else over}"
            parts.append(holds + ", a part of it at each position" * varies)
        return f"{', '.join(_shorten(parts))}: {rests}"

    def _without_rounding(self, value: float) -> float:
        """Return zero for a torque or force of the drive within its rounding."""
        return 0.0 if abs(value) <= self._rounding else value

    @cached_property
    def _rounding(self) -> float:
        """Rounding of the drive's torque or force, or its error bar if that is more."""
        rounding = find_drive_rounding(self.solution)
        return max(rounding, float(np.nanmax(self.drive.error, initial=0.0)))

    def _is_balanced(self) -> bool:
        """Tell whether the drive has nothing to do: its peak is rounding alone."""
        moves = np.nan_to_num(self.drive.sizes).any()
        return bool(moves) and not self._without_rounding(self.peak.value)

    def _write_power(self) -> Iterator[str]:
        """Write power and energy of the drive, and what a motor must have."""
        duty = self.duty
        power = self.solution.power
        if duty is None:
            idle = not self._without_rounding(self.peak.value)
            if power is not None and power[0] and not idle:
                yield _row("power", self._value(float(power[0]), "W"))
            return
        if duty.peak_power == 0.0 or self._is_balanced():
            return
        if duty.peak_power is None:
            row = self._write_growth("power")
        else:
            row = f"peak {self._write_peak_power(duty.peak_power)}{self._of_positions}"
        energies = duty.energy_in, duty.energy_out
        if self.kind != "list" and None not in energies:
            over = "over the motion" if self.kind == "law" else "over the sweep"
            if self.kind == "turn":
                turns = round(abs(self.ends[1] - self.ends[0]) / (2.0 * math.pi))
                over = "per turn" if turns == 1 else f"in {turns} turns"
            forward, back = self._cells(energies, "J")
            row += f"; {forward} {over} given, {back} taken back"
        yield _row("power", row)
        if duty.energy_swing is not None:
            mean = ""
            if duty.mean_torque is not None:
                torque = self._without_rounding(duty.mean_torque)
                mean = self._value(torque, "N m", duty.peak_torque, FAR_BELOW_PEAK)
                mean = f"mean torque {mean}; "
            swing = f"{self._value(duty.energy_swing, 'J')} about the mean"
            yield _row("cycle", f"{mean}energy swings by {swing}")
        if self.scene.drive is None:
            yield f"motor: {self._write_motor_needs(duty)}"

    def _write_motor_needs(self, duty: MotorDuty) -> str:
        """Write the torque, speed and power that a motor must have."""
        if duty.peak_torque is None or duty.peak_speed is None:
            word = "speed" if duty.peak_speed is None else "torque"
            return f"none is enough, as the {word} grows without bound"
        assert duty.peak_power is not None
        mean = ""
        if duty.rms_torque is not None:
            peak = duty.peak_torque
            rms = self._value(duty.rms_torque, "N m", peak, FAR_BELOW_PEAK)
            mean = f" (RMS {rms})"
        return (
            f"at least {self._value(duty.peak_torque, 'N m')} at"
            f" {self._value(duty.peak_speed, 'rad/s')}{mean},"
            f" {self._write_peak_power(duty.peak_power)}"
        )

    def _write_peak_power(self, peak: float) -> str:
        """Write the largest power; if the drive brakes there, say what drives too."""
        panels = self.motion.panels
        driving = max(panels.find_peak("power", UPPER).value, 0.0)
        text = self._value(peak, "W")
        if driving >= (1.0 - TIED) * peak:
            return text
        driving = 0.0 if driving <= SHOWN_AS_ZERO * peak else driving
        return f"{text} braking, {self._value(driving, 'W', peak)} driving"

    def _write_drive_head(self) -> str:
        scene = self.scene
        motion = self.scene.motion
        if scene.drive is None:
            head = f"drive on the {BAR_NAMES[scene.drive_bar]}"
        else:
            kind = "cylinder" if scene.drive.has_stroke else "force"
            numbers = [place.bar for _, place in scene.drive.ends]
            bars = [f"bar {number} ({BAR_NAMES[number]})" for number in numbers]
            way = "from" if len(bars) > 1 else "at a point of"
            head = f"{kind} {way} {' to '.join(bars)}"
        if motion.speed is None:
            return head if motion.law is None else f"{head}, by a law over time"
        _, speeds, accelerations = self.solution.at.stated
        si = "rad/s" if motion.stroke is None else "m/s"
        drives = scene.drive is None and scene.drive_bar == motion.bar
        other = not drives and motion.stroke is None
        speed = "at rest"
        if np.any(speeds):
            speed = write_ends(speeds, lambda x: self._value(x, si))
            speed = f"at {speed}" if other else speed
        if other:
            speed = f"the {BAR_NAMES[motion.bar]} {speed}"
        if np.any(accelerations):
            growth = write_ends(accelerations, lambda x: self._value(x, f"{si}^2"))
            speed += f", {motion.names[2]} = {growth}"
        return f"{head}, {speed}"

    def _write_stroke(self) -> Iterator[str]:
        """Write the stroke, over what it assembles, and its speed."""
        if not self.stroke_ranges:
            return
        ranges = [
            [self._value(end.value, "m", self.longest) for end in ends]
            for ends in self.stroke_ranges
        ]
        row = " and, in the other circuit, ".join(map(" to ".join, ranges))
        if self.kind == "position":
            row = ranges[0][0]
        if self.stroke_limits is not None:
            limits = (self._value(x, "m", self.longest) for x in self.stroke_limits)
            row += f"; assembles from {' to '.join(limits)}"
        yield _row("stroke", row)
        speed = self.solution.stroke_speed
        if speed is None or self.scene.motion.stroke is not None:
            return
        largest = float(np.nanmax(np.abs(speed)))
        if not largest > 0.0:
            return
        if self.duty is None:
            row = self._value(largest, "m/s")
        elif self.duty.peak_speed is None:
            row = self._write_growth("speed")
        else:
            row = f"peak {self._value(self.duty.peak_speed, 'm/s')}{self._of_positions}"
        yield _row("speed", row)

    def _write_bore(self, pressure: float) -> Iterator[str]:
        """Write the bore that pushes, and the area that pulls, at a pressure.

        Where dry friction holds a linkage at rest, they suffice to move it.
        """
        ways = [way.panels for way in self.motion.begun]
        if math.isinf(find_largest(LINE.value, self.motion.begun)):
            yield _row("bore", "none is enough, as the force grows without bound")
            return
        parts = []
        for sense, rank, does in (
            (1.0, UPPER, " to push"),
            (-1.0, LOWER, ", and the rod's area besides, to pull"),
        ):
            force = max(sense * way.find_peak(LINE.value, rank).value for way in ways)
            if force > 0.0:
                bore = math.sqrt(4.0 * force / (math.pi * pressure))
                parts.append(
                    f"{self._value(bore, 'm')}{does} {self._value(force, 'N')}"
                )
        if parts:
            yield _row("bore", f"at least {'; '.join(parts)}")

    def _write_pins(self) -> Iterator[str]:
        """Write the loads of the four pins, side by side."""
        if not self.has_forces:
            return
        cells, places = self._write_peaks(PIN_FORCES, "N")
        rows = [("pins", [*PIN_FORCE]), ("  peak", cells), ("  at", places)]
        means = [self.motion.find_rms(name) for name in PIN_FORCES]
        if np.isfinite(means).any():
            rows.append(("  RMS", self._cells(means, "N")))
        rows += self._list_from_rest(PIN_FORCES, "N")
        yield from _align(rows, self.width)
        if self.kind in ("list", "released"):
            yield "  peak and RMS are those of these positions"

    def _list_from_rest(
        self, names: Sequence[str], unit: str
    ) -> list[tuple[str, list[str]]]:
        """List the row of what a linkage at rest bears as it begins to move.

        Stresses stand below that of bending moments. The list is empty where dry
        friction does not hold the linkage, or adds nothing.
        """
        ways = self.motion.begun
        if ways[0] is self.motion:
            return []
        sizes = [find_largest(name, ways) for name in names]
        cells = self._cells(sizes, unit)
        adds = cells != self._write_peaks(names, unit)[0]
        stresses = self._list_stresses(sizes) if unit == "N m" else []
        return [("  to move", cells), *stresses] if adds else []

    def _write_bending(self) -> Iterator[str]:
        """Write the largest bending moment of each bar, with its place and position."""
        bending = self.bending
        from_rest = self._list_from_rest(_BENDING, "N m")
        peaks = [bar.peak.value for bar in bending.values()]
        if not from_rest and not any(peaks):
            return
        moments, places = self._write_peaks(_BENDING, "N m")
        for index, (peak, x, *_) in enumerate(bending.values()):
            if peak.value and math.isfinite(peak.value):
                along = self._value(x, "m", self.longest)
                over = "" if self.kind == "position" else f", {places[index]}"
                places[index] = along + over
        rows = [
            ("bending", [f"bar {bar}" for bar in bending]),
            ("  moment", moments),
            ("  at x", places),
            *self._list_stresses(peaks),
            *from_rest,
        ]
        yield from _align(rows, self.width)
        yield from list_couple_notes(self.scene)

    def _list_stresses(self, moments: Sequence[float]) -> list[tuple[str, list[str]]]:
        """List the row of stresses by bending moments of bars 2, 3 and 4.

        A bar without a cross-section has none.
        """
        moduli = [bar.section_modulus or math.nan for bar in self.linkage.moving]
        stresses = np.divide(moments, moduli)
        stresses[np.isinf(stresses)] = np.nan
        if np.isnan(stresses).all():
            return []
        return [("  stress", self._cells(stresses, "Pa"))]

    def _write_peaks(
        self, names: Sequence[str], unit: str
    ) -> tuple[list[str], list[str]]:
        """Write the largest sizes of curves of one kind, and where they are taken.

        A curve may grow without bound there.
        """
        peaks = [self.motion.find_peak(name) for name in names]
        sizes = _drop_small([peak.value for peak in peaks])
        places = [
            self._place(peak.place, named=False) if size else "-"
            for peak, size in zip(peaks, sizes, strict=True)
        ]
        return self._cells(sizes, unit), places

    def _cells(self, values: Iterable[float | None], unit: str) -> list[str]:
        """Write quantities of one kind: a dash for NaN, "unbounded" for infinity."""
        numbers = _drop_small(values)
        largest = _find_largest(numbers)
        cells = []
        for number in numbers.tolist():
            if math.isfinite(number):
                cells.append(self._value(number, unit, largest))
            else:
                cells.append("-" if math.isnan(number) else "unbounded")
        return cells

    def _write_remarks(self) -> Iterator[str]:
        """Write where pin forces jump, and what rounding does."""
        solution = self.solution
        passes = self.has_forces and solution.change_points
        if passes and has_growing_forces(solution):
            yield (
                "at a change point pin forces grow without bound: the peaks are those "
                "of these instants"
            )
        if self.has_forces and not self.motion.is_steady:
            yield "the positions are passed at no one speed: no RMS values, no energies"
        yield from self.motion.list_jumps(
            self.symbol, lambda place: self._place(place, named=False)
        )
        of_pins = self._list_from_rest(PIN_FORCES, "N")
        if of_pins or self._list_from_rest(_BENDING, "N m"):
            yield (
                "to move: the largest as it starts or stops, with the whole of dry "
                "friction; the rows above take friction at rest as 0"
            )
        yield from self._warn()
        yield from list_notes(solution, self.units)
        if self._is_balanced():
            yield f"the {self.drive.name} is zero within rounding"
        elif self.error is not None:
            below = "zero"
            if self.error:
                below = f"below 1e{math.ceil(math.log10(self.error)):+03d}"
            last_digit = _HALF_OF_LAST * 10.0 ** (1 - self.digits) / 10.0
            changed = "none of these" if self.error < last_digit else "some"
            yield (
                f"rounding changes {changed} digits (worst error bar {below} of the"
                " value)"
            )

    def _warn(self) -> Iterator[str]:
        """Write where the drive's torque or force has few digits left.

        The warning names the collinear bars that cost the digits.
        """
        solution = self.solution
        drive = self.drive
        share = self.relate_errors(drive.error, drive.sizes)
        if not np.nanmax(share, initial=0.0) > _FEW_DIGITS:
            return
        if not self._without_rounding(float(np.nanmax(drive.sizes))):
            return  # nothing has digits to lose
        worst = int(np.nanargmax(share))
        digits = max(math.floor(-math.log10(share[worst])), 0)
        start = f"{digits} digits left of {drive.symbol} at"
        start += f" {self._place(float(solution.at.places[worst]))}"
        commanded = BARS_IN_LINE[solution.at.bar]
        sines = {commanded: solution.condition[worst]}
        condition = solution.drive_condition[worst]
        if solution.drive is not None:
            yield (
                f"{start}: of its lever {condition:.2g}, of the sine of bars"
                f" {commanded} {sines[commanded]:.2g} is left"
            )
            return
        sines[BARS_IN_LINE[solution.drive_bar]] = condition
        bars = min(sines, key=lambda pair: sines[pair])
        gap = math.asin(min(sines[bars], 1.0))
        apart = write_short(gap, "rad", self.units, digits=2)
        # bars 2 and 4 share no pin
        meeting = "parallel" if bars == BARS_IN_LINE[3] else "in line"
        yield f"{start}: bars {bars} are {apart} from being {meeting}"


def _shorten(places: list[str]) -> list[str]:
    """Return the first places, and how many follow."""
    more = [write_count(len(places) - _MOST_PLACES, "more place")]
    return places[:_MOST_PLACES] + (more if len(places) > _MOST_PLACES else [])


def _row(label: str, text: str) -> str:
    return f"  {label:<{INDENT - 2}}{text}"


def _drop_small(values: Iterable[float | None]) -> Array:
    """Return zero for what is rounding of the largest of their kind, NaN for none."""
    numbers = np.array([*values], dtype=float)
    return drop_rounding(numbers, _find_largest(numbers))


def _find_largest(numbers: Array) -> float:
    sizes = np.abs(numbers)
    return float(np.max(sizes, where=np.isfinite(sizes), initial=0.0))


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


def write_paths(solution: Solution, units: Conversion) -> list[str]:
    """Write lines for each point: its extent, and how straight its path is."""
    lines = []
    name, unit = name_places(solution)
    factor, place = choose_unit(1.0, unit, units)
    turned, angle = find_unit_in("rad", units)
    for point, path in measure_paths(solution).items():
        largest = max(path.stroke, *map(abs, (*path.x, *path.y)))
        per_metre, length = choose_unit(largest, "m", units)
        extents = np.array([*path.x, *path.y, path.straightness, path.stroke])
        left, right, below, above, across, along = (
            f"{per_metre * number:#.6g}".rstrip(".")
            for number in drop_rounding(extents, largest).tolist()
        )
        (direction,) = drop_rounding(np.array([path.direction]), np.pi)
        first, last = (f"{factor * end + 0.0:.6g}" for end in path.ends)
        extent = (
            f"x from {left} to {right} {length}, y from {below} to {above} {length}"
        )
        lines += [
            *wrap_line(f"path of {clean_line(point)}: {extent}"),
            f"    straightness {across} {length}, stroke {along} {length} along"
            f" {angle * direction:.6g} {turned},",
            f"    from {name} = {first} to {last} {place}",
        ]
    return lines
