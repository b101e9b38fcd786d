"""Output of `analyze` and `classify`: one block of aligned lines, at most 80 columns wide."""

import math
from collections.abc import Callable, Iterator
from functools import partial
from textwrap import wrap

import numpy as np

from fourbar.errors import clean_line
from fourbar.formulas.mobility import (
    change_points,
    circuits,
    classify,
    limit_positions,
    reach_of,
    swing,
    time_ratio,
    turns_fully,
)
from fourbar.formulas.transmission import transmission_extremes
from fourbar.linkage import BAR_NAMES, MOVING_BARS, FourBar
from fourbar.quantities import PIN_FORCES
from fourbar.scene import Scene
from fourbar.scene.motion import BRANCH_NAMES
from fourbar.show.duty import describe_drive
from fourbar.show.summary import Facts, summarize
from fourbar.show.units import COMMON, choose_unit, write_digits, write_short
from fourbar.solution import Conversion, Solution
from fourbar.writing import write_object

WIDTH = 80
TIED = "\u00a0"
"""Stands between a number and its unit until the lines are broken."""
COLUMN = 12
"""Least width of a column."""
LABEL = 11
"""Width of what stands before a row."""
FOUR_DIGITS = 5e-5
"""Error bar as a part of the value from which on it changes four digits."""
FEW_DIGITS = 1e-8
"""Error bar as a part of the value from which on the block says where digits are lost: half of those of a double."""
LOST = {2: "3 and 4", 3: "2 and 4", 4: "2 and 3"}
"""Bars that are in line where a command of a bar, or a drive on it, loses digits."""


def write_block(
    scene: Scene, solution: Solution, units: Conversion = COMMON, *, pressure: float | None = None
) -> list[str]:
    """Write the summary of a solved scene, line by line.

    Parameters
    ----------
    units : in which numbers are shown; what is left out has the SI unit with a prefix.
    pressure : of a cylinder, Pa: the bore that it takes is added.
    """
    return _Block(summarize(scene, solution), units).write(pressure)


class _Block:
    """The facts of a scene and the units that they are written in."""

    def __init__(self, facts: Facts, units: Conversion) -> None:
        self.facts, self.units = facts, units
        self.longest = max(facts.scene.linkage.lengths)
        if facts.kind in ("law", "released"):
            self.symbol, self.unit = "t", "s"
        else:
            self.symbol = facts.solution.commanded
            self.unit = "rad" if facts.solution.at.stroke is None else "m"

    def write(self, pressure: float | None) -> list[str]:
        """Write all paragraphs, a blank line between two."""
        paragraphs = [self._write_motion(), self._write_drive(pressure), self._write_pins()]
        paragraphs += [self._write_bending(), self._write_remarks()]
        lines: list[str] = []
        for paragraph in (paragraph for paragraph in paragraphs if paragraph):
            for line in paragraph:
                aligned = len(line) <= WIDTH
                lines += [line] if aligned else wrap(line, WIDTH, subsequent_indent="    ", break_on_hyphens=False)
            lines.append("")
        return [line.replace(TIED, " ") for line in lines[:-1]]

    def _value(self, value: float, unit: str, largest: float | None = None) -> str:
        """Write a quantity of an SI unit, with the prefix that suits it or the largest of its kind."""
        return write_short(value, unit, self.units, largest).replace(" ", TIED)

    def _place(self, place: float, *, named: bool = True) -> str:
        """Write a place as "theta_2 = 22.8 deg", or without its name."""
        text = self._value(place, self.unit, {"m": self.longest, "s": 1.0}.get(self.unit))
        return f"{self.symbol}{TIED}={TIED}{text}" if named else text

    def _angle(self, angle: float) -> str:
        return self._value(angle, "rad")

    def _write_motion(self) -> list[str]:
        """Write what the linkage is, how far it moves, and how well it transmits."""
        facts, scene = self.facts, self.facts.scene
        factor, unit = choose_unit(self.longest, "m", self.units)
        bars = zip(BAR_NAMES.values(), scene.linkage.lengths, strict=True)
        lengths = ", ".join(f"{name} {write_digits(factor * length)}" for name, length in bars)
        name = classify(scene.linkage).name
        title = f' "{clean_line(scene.title)}"' if scene.title else ""
        of_bar = "" if scene.motion.bar == 2 else f" of the command {scene.motion.commanded}"
        head = f"{name[0].upper()}{name[1:]}{title}, {BRANCH_NAMES[scene.motion.branch]} branch{of_bar}:"
        lines = [f"{head} {lengths} {unit}"]
        if len(lines[0]) > WIDTH:
            lines = [head, f"    {lengths} {unit}"]
        if facts.kind == "position":
            at = facts.solution
            angles = ", ".join(
                f"theta_{bar} = {self._angle(float(getattr(at, f'theta_{bar}')[0]))}" for bar in (2, 3, 4)
            )
            stroke = "" if at.stroke is None else f"stroke {self._value(float(at.stroke[0]), 'm')}: "
            lines += [stroke + angles, f"transmission angle {self._angle(facts.transmission.value)}"]
        else:
            lines += [self._write_ranges()]
            least = facts.transmission
            lines += [f"transmission angle: at least {self._angle(least.value)}, at {self._place(least.place)}"]
        bad = {name: count for name, count in facts.counts.items() if name != "ok"}
        if bad:
            counts = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in facts.counts.items())
            lines.append(f"{len(facts.solution)} position{'s' if len(facts.solution) > 1 else ''}: {counts}")
        lines += self._write_stretches()
        acted_on = scene.loads or scene.effects or any(bar.mass > 0.0 for bar in scene.linkage.moving)
        if facts.solution.F12 is None and acted_on:
            lines += [f"positions only, since {scene.motion.names[1]} is left out:", f"    {static(scene)}"]
        return lines

    def _write_ranges(self) -> str:
        """Write how far the commanded bar goes, or the stroke, and how far the output, or else the input."""
        facts = self.facts
        bar, (first, last) = facts.solution.at.bar, facts.commanded
        if facts.kind == "turn":
            begin = f"{BAR_NAMES[bar]} turns fully"
        elif facts.kind == "list":
            begin = f"{len(facts.solution)} positions from {self._place(first)} to {self._place(last, named=False)}"
        elif facts.kind == "released":
            begin = self._write_release()
        elif facts.kind == "law":
            begin = f"{BAR_NAMES[bar]} {self._write_swing(bar)} by a law over {write_digits(last - first)} s"
        else:
            name = "stroke" if self.unit == "m" else BAR_NAMES[bar]
            begin = f"{name} from {self._place(first, named=False)} to {self._place(last, named=False)}"
        others = [2, 4] if facts.kind == "released" else [4 if bar != 4 else 2]
        return "; ".join([begin, *(f"{BAR_NAMES[other]} {self._write_swing(other)}" for other in others)])

    def _write_swing(self, bar: int) -> str:
        low, high = self.facts.angles[bar]
        if self.facts.kind == "turn" and high.value - low.value > 2.0 * math.pi - 1e-9:
            return "turns fully"
        if self.facts.kind == "law" and bar == self.facts.solution.at.bar:
            return f"from {self._angle(low.value)} to {self._angle(high.value)}"
        places = [self._place(end.place, named=False) for end in (low, high)]
        if self.unit == "rad":  # the unit stands next to it
            places = [place.split(TIED)[0] for place in places]
        width, start, stop = (self._angle(angle) for angle in (high.value - low.value, low.value, high.value))
        return f"swings {width}, from {start} ({self.symbol}{TIED}={TIED}{places[0]}) to {stop} ({places[1]})"

    def _write_release(self) -> str:
        free, solution = self.facts.scene.motion.free, self.facts.solution
        assert free is not None
        if solution.stopped_at is None:
            return f"released for {write_digits(free.duration)} s, without a drive"
        stop = f"stops at a limit position at t = {write_digits(solution.stopped_at)} s, where bars 3 and 4 are in line"
        return f"released for {write_digits(free.duration)} s, without a drive: it {stop}"

    def _write_stretches(self) -> list[str]:
        """Write where the assembly ends, and what grows without bound there."""
        facts = self.facts
        if not facts.stretches:
            return []
        parts = []
        for low, high in facts.stretches:
            start = "" if low is None else f"from {self._place(low, named=self.unit != 'm')}"
            stop = "" if high is None else f"up to {self._place(high, named=self.unit != 'm')}"
            parts.append(f"{start} {stop}".strip())
        grows = ""
        if facts.drive is not None and facts.drive.keys.value in facts.between.growing:
            grows = f"; the {facts.drive.name.removeprefix('drive ')} grows without bound there"
        elif facts.between.growing.intersection(PIN_FORCES) and facts.pins:
            grows = "; pin forces grow without bound there"
        return [f"assembles {', and '.join(parts)}{grows}"]

    def _write_drive(self, pressure: float | None) -> list[str]:
        """Write what drives, its peak and mean, power and energy, and what a motor or a cylinder must have."""
        facts = self.facts
        if facts.drive is None or facts.peak is None:
            return []
        drive, duty = facts.drive, facts.duty
        lines = [self._write_drive_head()]
        word = "force" if facts.linear else "torque"
        row = self._value(facts.peak.value, drive.unit)
        if duty is not None:
            rms = duty.rms_force if facts.linear else duty.rms_torque
            beyond = " (of these positions)" if self._is_rough(drive.keys.value) else ""
            row = f"peak {row} at {self._place(facts.peak.place)}{beyond}, RMS {self._value(rms or 0.0, drive.unit)}"
        lines.append(self._row(word, row))
        if facts.held is not None:
            low, high = (self._value(value, drive.unit, max(map(abs, facts.held))) for value in facts.held)
            holds = "dry friction holds it between them" if facts.duty is None else "the range where dry friction holds"
            lines.append(self._row("at rest", f"{low} to {high}: {holds}"))
        if facts.stroke is not None:
            lines += self._write_stroke()
        lines += self._write_power()
        if pressure is not None and facts.linear:
            lines += self._write_bore(pressure)
        return lines

    def _write_power(self) -> list[str]:
        """Write power and energy of the drive, and what a motor must have."""
        facts, duty, power = self.facts, self.facts.duty, self.facts.solution.power
        if duty is None:
            one = float(power[0]) if power is not None else 0.0
            return [self._row("power", self._value(one, "W"))] if one else []
        if not duty.peak_power > 0.0:
            return []
        peak = self._value(duty.peak_power, "W")
        row = f"peak {peak}"
        if facts.kind != "list" and duty.energy_in is not None and duty.energy_out is not None:
            over = "over the motion" if facts.kind == "law" else "over the sweep"
            if facts.kind == "turn":
                turns = round(abs(facts.commanded[1] - facts.commanded[0]) / (2.0 * math.pi))
                over = "per turn" if turns == 1 else f"in {turns} turns"
            most = max(duty.energy_in, duty.energy_out)
            given, back = (self._value(energy, "J", most) for energy in (duty.energy_in, duty.energy_out))
            row += f"; {given} {over} given, {back} taken back"
        lines = [self._row("power", row)]
        if not facts.linear:
            numbers = ((duty.peak_torque, "N m"), (duty.peak_speed, "rad/s"), (duty.rms_torque, "N m"))
            torque, speed, mean = (self._value(number or 0.0, unit) for number, unit in numbers)
            lines.append(f"motor: at least {torque} at {speed} (RMS {mean}), {peak}")
        return lines

    def _write_drive_head(self) -> str:
        scene, motion = self.facts.scene, self.facts.scene.motion
        head = f"cylinder {describe_drive(scene).removeprefix('along a line ')}"
        if scene.drive is None:
            head = f"drive on the {BAR_NAMES[scene.drive_bar]}"
        if motion.speed is None:
            return head if motion.law is None else f"{head}, by a law over time"
        si = "rad/s" if motion.stroke is None else "m/s"
        own = motion.stroke is not None or (scene.drive is None and scene.drive_bar == motion.bar)
        speed = "at rest" if motion.speed == 0.0 else self._value(motion.speed, si)
        if not own:
            speed = f"the {BAR_NAMES[motion.bar]} {'' if motion.speed == 0.0 else 'at '}{speed}"
        if motion.acceleration:
            speed += f", {motion.names[2]} = {self._value(motion.acceleration, f'{si}^2')}"
        return f"{head}, {speed}"

    def _write_stroke(self) -> list[str]:
        """Write the stroke, over what it assembles, and its speed."""
        facts, lines = self.facts, list[str]()
        assert facts.stroke is not None
        low, high = (self._value(x.value, "m", self.longest) for x in facts.stroke)
        row = low if facts.kind == "position" else f"{low} to {high}"
        if facts.strokes is not None:
            ends = (self._value(x, "m", self.longest) for x in facts.strokes)
            row += "; assembles from {} to {}".format(*ends)
        lines.append(self._row("stroke", row))
        speed = facts.solution.stroke_speed
        if speed is not None and facts.scene.motion.stroke is None and np.nanmax(np.abs(speed)) > 0.0:
            peak = self._value(float(np.nanmax(np.abs(speed))), "m/s")
            lines.append(self._row("speed", peak if facts.kind == "position" else f"peak {peak}"))
        return lines

    def _write_bore(self, pressure: float) -> list[str]:
        """Write the bore that pushes, and the area that pulls, at a pressure."""
        values = self.facts.between.solution.drive_force
        assert values is not None
        push, pull = max(0.0, float(np.nanmax(values))), max(0.0, -float(np.nanmin(values)))
        parts = []
        if push:
            bore = math.sqrt(4.0 * push / (math.pi * pressure))
            parts.append(f"{self._value(bore, 'm')} to push {self._value(push, 'N')}")
        if pull:
            bore = math.sqrt(4.0 * pull / (math.pi * pressure))
            parts.append(f"{self._value(bore, 'm')}, and the rod's area besides, to pull {self._value(pull, 'N')}")
        return [self._row("bore", f"at least {'; '.join(parts)}")] if parts else []

    def _write_pins(self) -> list[str]:
        """Write the loads of the four pins, side by side."""
        facts = self.facts
        if not facts.pins:
            return []
        one = facts.kind == "position"
        most = max(load.peak.value for load in facts.pins.values())

        def force(value: float) -> str:
            return self._value(value, "N", most)

        rows = [("pins", list(facts.pins))]
        rows.append(("  force" if one else "  peak", [force(load.peak.value) for load in facts.pins.values()]))
        if not one:
            rows.append(("  at", [self._place(load.peak.place, named=False) for load in facts.pins.values()]))
            rows.append(("  RMS", [force(load.rms) for load in facts.pins.values()]))
        lines = _align(rows)
        if facts.kind == "list":
            lines.append("  peak and RMS are those of these positions")
        elif not one and (
            rough := [pin for pin, name in zip(facts.pins, PIN_FORCES, strict=True) if self._is_rough(name)]
        ):
            lines.append(f"  between these positions the loads of {', '.join(rough)} grow without bound")
        return lines

    def _write_bending(self) -> list[str]:
        """Write the largest bending moment of each bar, where along the bar, and where in the motion."""
        facts = self.facts
        most = max((peak.value for peak, _ in facts.bending.values()), default=0.0)
        if not most:
            return []
        ends = facts.bending.values()
        rows = [("bending", [f"bar {bar}" for bar in facts.bending])]
        rows.append(("  moment", [self._value(peak.value, "N m", most) for peak, _ in ends]))
        rows.append(("  at x", [self._value(x, "m", self.longest) for _, x in ends]))
        if facts.kind != "position":
            rows.append(("  at", [self._place(peak.place, named=False) for peak, _ in ends]))
        return _align(rows)

    def _is_rough(self, name: str) -> bool:
        """Tell whether a peak is that of the positions alone: between them it grows, or nothing was looked for."""
        return self.facts.kind not in ("position", "released") and name in self.facts.between.growing

    def _write_remarks(self) -> list[str]:
        """Write where pin forces jump, and what rounding does."""
        facts, lines = self.facts, list[str]()
        if facts.between.reversals:
            where = ", ".join(f"{self._place(place, named=False)} ({pin})" for place, pin in facts.between.reversals)
            name = facts.solution.commanded
            lines.append(f"dry friction reverses, and the pin forces jump, at {name} = {where}")
        lines += self._warn()
        if facts.error is not None:
            below = f"below 1e{math.ceil(math.log10(facts.error)):+03d}" if facts.error else "zero"
            changed = "none of these" if facts.error < FOUR_DIGITS else "some"
            lines.append(f"rounding changes {changed} digits (worst error bar {below} of the value)")
        return lines

    def _warn(self) -> list[str]:
        """Write where the drive's torque or force has few digits left, and the bars in line that cost them."""
        solution, drive = self.facts.solution, self.facts.drive
        if drive is None or drive.error is None or solution.drive_condition is None or drive.values is None:
            return []
        # of those that matter: one that passes through zero has no digits, and needs none
        with np.errstate(invalid="ignore"):
            share = drive.error / np.maximum(np.abs(drive.values), np.nanmedian(np.abs(drive.values)))
        if not np.nanmax(share, initial=0.0) > FEW_DIGITS:
            return []
        worst = int(np.nanargmax(share))
        left = max(math.floor(-math.log10(share[worst])), 0)
        place = solution.at.places if solution.time is None else solution.time
        where = f"{left} digits left of {drive.symbol} at {self._place(float(place[worst]))}"
        commanded = LOST[solution.at.bar]
        sines = {commanded: solution.condition[worst]}
        if solution.drive is not None:
            lever, sine = solution.drive_condition[worst], sines[commanded]
            return [f"{where}: of its lever {lever:.2g}, of the sine of bars {commanded} {sine:.2g} is left"]
        sines[LOST[solution.drive_bar]] = solution.drive_condition[worst]
        bars = min(sines, key=lambda pair: sines[pair])
        gap = math.asin(min(sines[bars], 1.0))
        return [f"{where}: bars {bars} are {gap:.2g} rad from being in line"]

    @staticmethod
    def _row(label: str, text: str) -> str:
        return f"  {label:<{LABEL - 2}}{text}"


def _align(rows: list[tuple[str, list[str]]]) -> list[str]:
    """Write rows of a label and cells that stand below each other."""
    width = max(COLUMN, 2 + max(len(cell) for _, cells in rows for cell in cells))
    return [f"{label:<{LABEL}}{''.join(f'{cell:<{width}}' for cell in cells)}".rstrip() for label, cells in rows]


def static(scene: Scene) -> str:
    """Say what asks for forces where a scene states positions alone."""
    unit, what = ("rad/s", "torque") if scene.motion.stroke is None else ("m/s", "force")
    return f'{scene.motion.names[1]} = "0 {unit}" gives the static {what} and pin forces'


BRANCHES = {**BRANCH_NAMES, 0: "both"}


def write_type(linkage: FourBar, units: Conversion | None = COMMON, *, everything: bool = False) -> Iterator[str]:
    """Write the type of a linkage, the condition that decides it, what turns, how far, and between which limits.

    `units`: of the lengths; None where they are ratios. `everything`: the limits of all bars, not of the output alone.
    """
    found = classify(linkage)
    relation = "<" if found.surplus > 0.0 else ">" if found.surplus < 0.0 else "="
    outer = min(linkage.lengths) + max(linkage.lengths)
    write = partial(_write_length, linkage=linkage, units=units)
    yield found.name
    yield f"s + l = {write(outer)} {relation} p + q = {write(sum(linkage.lengths) - outer)}"
    yield "bars that turn fully: " + (", ".join(BAR_NAMES[number] for number in found.turning) or "none")
    if found.barker is not None:  # a structure does not move
        yield from _write_mobility(linkage, write, everything)


def _write_length(length: float, linkage: FourBar, units: Conversion | None) -> str:
    if units is None:
        return f"{length:.6g}"
    factor, name = choose_unit(max(linkage.lengths), "m", units)
    return f"{factor * length:.6g} {name}"


def write_type_json(linkage: FourBar) -> str:
    """Write the type as JSON: SI and radians, null where there is nothing; positions as `LimitPosition` has them."""
    found, more = classify(linkage), dict[str, object]()
    if found.barker is not None:
        transmission = transmission_extremes(linkage)
        more = {
            "swing": {BAR_NAMES[bar]: swing(linkage, bar) for bar in MOVING_BARS},
            "limit_positions": {BAR_NAMES[bar]: limit_positions(linkage, bar) for bar in MOVING_BARS},
            "change_points": change_points(linkage),
            "circuits": circuits(linkage),
            "transmission": {**transmission._asdict(), "worst": transmission.worst},
            "time_ratio": time_ratio(linkage),
        }
    lengths = dict(zip(BAR_NAMES.values(), linkage.lengths, strict=True))
    return write_object("fourbar-classify/1", lengths=lengths, **found._asdict(), **more)


def _write_mobility(linkage: FourBar, write: Callable[[float], str], everything: bool) -> Iterator[str]:
    """Line by line; angles in deg, digits as far as a drawing needs them."""
    swings = [
        f"{BAR_NAMES[bar]} {_write_degrees(swing(linkage, bar))}"
        for bar in MOVING_BARS
        if not turns_fully(linkage, bar)
    ]
    if swings:
        yield f"bars that swing: {', '.join(swings)}"
    limits = [(bar, limit) for bar in (MOVING_BARS if everything else (4,)) for limit in limit_positions(linkage, bar)]
    if limits:
        names = "".join(f"{name:>10}" for name in ("theta_2", "theta_3", "theta_4"))
        yield f"{'limit positions (deg)':<34}{names}  branch"
    for bar, limit in limits:
        one, other = (BAR_NAMES[number] for number in MOVING_BARS if number != bar)
        what = f"  {BAR_NAMES[bar]}: {one}, {other} {'stretched' if limit.stretched else 'folded'}"
        angles = "".join(f"{math.degrees(angle):10.4f}" for angle in limit[:3])
        yield f"{what:<34}{angles}  {BRANCHES[limit.branch]}"
    for bar in MOVING_BARS:
        if turns_fully(linkage, bar):
            yield from _explain_turning(linkage, bar, write)
    if points := change_points(linkage):
        yield f"change points: theta_2 = {' and '.join(_write_degrees(point) for point in points)}"
    found = transmission_extremes(linkage)
    yield (
        f"angle between coupler and output: {_write_degrees(found.least)} "
        f"at theta_2 = {_write_degrees(found.theta_2_least)}"
    )
    yield f"    to {_write_degrees(found.greatest)} at {_write_degrees(found.theta_2_greatest)}"
    if found.worst > 0.0:
        yield f"smallest transmission angle: {_write_degrees(found.worst)}"
    if (ratio := time_ratio(linkage)) is not None:
        yield f"slower stroke of the output over the faster, at constant omega_2: {ratio:.4f}"


def _explain_turning(linkage: FourBar, bar: int, write: Callable[[float], str]) -> Iterator[str]:
    """Say why a bar has no limits: the two others would have to be in line, stretched or folded."""
    reach, d, own = reach_of(linkage, bar), linkage.ground, linkage.lengths[bar - 1]
    (one, x), (other, y) = ((BAR_NAMES[k], linkage.lengths[k - 1]) for k in MOVING_BARS if k != bar)
    name, touches = BAR_NAMES[bar], reach.beyond_stretched == 0.0 or reach.beyond_folded == 0.0
    when = "are in line at change points alone" if touches else "are never in line"
    yield f"{name}: no limits, {one} and {other} {when}:"
    relation = "=" if reach.beyond_stretched == 0.0 else "<"
    yield f"    ground + {name} = {write(d + own)} {relation} {one} + {other} = {write(x + y)}"
    relation = "=" if reach.beyond_folded == 0.0 else ">"
    yield f"    |ground - {name}| = {write(abs(d - own))} {relation} |{one} - {other}| = {write(abs(x - y))}"


def _write_degrees(angle: float) -> str:
    return f"{math.degrees(angle):.4f} deg"
