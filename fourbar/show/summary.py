"""Summary of a solved scene: ranges, peaks and their places, drive and ends of motion.

`summarize` collects the facts from the curves over the motion; `fourbar.show.block`
prints them.
"""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from fourbar.formulas.mobility import TURN, find_intervals
from fourbar.linkage import MOVING_BARS, PIN_FORCE
from fourbar.quantities import OK, STATUS_NAMES
from fourbar.scene import Scene
from fourbar.scene.motion import Motion, Sweep
from fourbar.scene.scene import find_stroke_ranges
from fourbar.show.driving import Driving, is_once_round, read_drive_demand
from fourbar.show.duty import MotorDuty, motor_duty
from fourbar.show.motion_curves import (
    MotionCurves,
    compute_bending,
    compute_pin_loads,
    describe_motion,
)
from fourbar.show.panels import EXTREME_ERROR, TIED, PanelCurve, Peak, split_runs
from fourbar.solution import Solution
from fourbar.solving import solve
from fourbar.studies.internal_forces import Bending

_INSET = 1e-9
"""Part of a range that is left out at its limit positions. These may not assemble as
doubles.
"""
_STEPS_OF_RANGE = 48
ZERO_TRANSMISSION_ANGLE = 1e-6
"""Transmission angle that counts as zero, rad. At a limit, a place in its last digits
leaves some 1e-8.
"""


class BarBending(NamedTuple):
    """Largest size of the bending moment of a bar."""

    peak: Peak | None
    """N m; None if it grows without bound."""
    x: float
    """Place of the peak along the bar, m from its first pin."""
    solution: Solution
    row: int
    """Index of the peak's position in `solution`, or of the position of the motion with
    the largest moment.
    """


class PinLoad(NamedTuple):
    """Load of one pin over the motion, N."""

    peak: Peak | None
    """None if it grows without bound."""
    rms: float | None
    """None if there is none."""


class HeldRange(NamedTuple):
    """Neighbouring positions at which dry friction holds a pin at rest."""

    low: float
    """Least torque or force of the drive that holds one of them."""
    high: float
    """Greatest torque or force that holds one of them."""
    ends: tuple[float, float]
    """Commanded angle or stroke of the first and the last, rad or m, or the time, s."""
    varies: bool
    """False if each of them is held from `low` to `high`, as in a dwell."""


@dataclass(frozen=True, slots=True)
class Facts:
    """Facts of a solved scene, SI units and radians."""

    scene: Scene
    solution: Solution
    kind: str
    """"position", "list", "sweep", "turn", "law" or "released". A turn is whole turns
    of what is commanded.
    """
    motion: MotionCurves
    """Curves over the motion, with what grows without bound."""
    counts: dict[str, int]
    """Number of positions of each status."""
    ends: tuple[float, float]
    """First and last commanded angle or stroke. It is a time for a motion law or a
    released motion.
    """
    angles: dict[int, tuple[Peak, Peak]]
    """Smallest and largest angle of bars 2, 3 and 4."""
    transmission: Peak
    """Smallest transmission angle."""
    drive: Driving | None
    """Drive; None for a released linkage, and where only positions are known."""
    peak: Peak | None
    """Largest torque or force of the drive, signed; None if it grows without bound."""
    duty: MotorDuty | None
    held: list[HeldRange]
    """Where dry friction holds a pin at rest, in the order of the positions."""
    pins: dict[str, PinLoad]
    bending: dict[int, BarBending]
    stroke_range: tuple[Peak, Peak] | None
    """Smallest and largest stroke of the motion."""
    period: float | None
    """Time after which a released motion repeats itself, s; None if it does not."""
    stroke_limits: tuple[float, float] | None
    """Smallest and largest stroke that assembles on the branch. With a stroke commanded
    it is that of the side.
    """
    error: float | None
    """Largest error bar of the drive and of the pin forces, over the value. None: no
    error bar was computed.
    """

    @property
    def linear(self) -> bool:
        """Return True if the drive exerts a force."""
        return self.solution.drive is not None

    @property
    def following(self) -> list[int]:
        """Return the bars that follow, over time all; none if no speed is stated."""
        if len(self.solution) == 1 or self.solution.omega_4 is None:
            return []
        commanded = 0 if self.solution.time is not None else self.solution.at.bar
        return [bar for bar in MOVING_BARS if bar != commanded]

    def find_peak(self, name: str) -> Peak | None:
        """Find the largest size of a curve; None if it grows without bound."""
        panels = self.motion.panels
        return panels.find_peak(name) if panels.has_value(name) else None


def summarize(scene: Scene, solution: Solution) -> Facts:
    """Collect the facts of a scene solved up to the forces or the error bars.

    At least one position assembles.
    """
    motion = describe_motion(solution)
    panels = motion.panels
    places = solution.at.places

    def find_range(name: str) -> tuple[Peak, Peak]:
        low, high = (motion.positions.find_peak(name, sense) for sense in (-1, 1))
        return low, high

    kind = _classify_motion(scene, solution, motion)
    drive = None
    if scene.motion.free is None and solution.F12 is not None:
        drive = read_drive_demand(solution)
        if not np.isfinite(drive.sizes).any():
            drive = None
    has_forces = solution.F12 is not None and bool(np.isfinite(solution.F12).any())
    has_stroke = solution.stroke is not None
    peak = None
    if drive is not None and panels.has_value(drive.keys.value):
        peak = panels.find_peak(drive.keys.value)
    return Facts(
        scene=scene,
        solution=solution,
        kind=kind,
        motion=motion,
        counts=_count_statuses(solution),
        ends=(float(places[0]), float(places[-1])),
        angles={bar: find_range(f"theta_{bar}") for bar in MOVING_BARS},
        transmission=_find_transmission(motion),
        drive=drive,
        peak=peak,
        duty=None if drive is None or kind == "position" else motor_duty(solution),
        held=[] if drive is None else _list_held(solution, drive, kind),
        pins=_list_pin_loads(motion) if has_forces else {},
        bending=locate_bending(motion) if has_forces else {},
        stroke_range=find_range("stroke") if has_stroke else None,
        period=_find_period(scene, solution),
        stroke_limits=_find_stroke_limits(scene, solution) if has_stroke else None,
        error=_find_largest_error_bar(solution, drive),
    )


def _classify_motion(scene: Scene, solution: Solution, motion: MotionCurves) -> str:
    if len(solution) == 1:
        return "position"
    if scene.motion.free is not None:
        return "released"
    if scene.motion.law is not None:
        return "law"
    if isinstance(scene.motion.angle, np.ndarray):
        return "list"
    closes = not solution.at.moves_stroke and is_once_round(solution)
    return "turn" if closes and not motion.stretches else "sweep"


def _count_statuses(solution: Solution) -> dict[str, int]:
    codes, numbers = np.unique(solution.status_code, return_counts=True)
    pairs = zip(codes, numbers, strict=True)
    return {STATUS_NAMES[code]: int(number) for code, number in pairs}


def _find_transmission(motion: MotionCurves) -> Peak:
    """Find the smallest transmission angle; it is 0 where its sine changes its sign."""
    panels = motion.positions
    solution = motion.solution
    if panels.located:
        first = Peak(abs(float(solution.sin_mu[0])), float(solution.at.places[0]))
        if first.value <= ZERO_TRANSMISSION_ANGLE:
            return first._replace(value=0.0)
        zeros = panels.find_zeros("sin_mu")
        if len(zeros):
            return Peak(0.0, float(zeros[0]))
        sines = panels.curves["sin_mu"]
        # between two stretches it may change its sign without a zero
        sizes = PanelCurve(np.abs(sines.values), sines.error, [])
        least = replace(panels, curves={"": sizes}).find_peak("", -1)
    else:
        absolute = np.abs(panels.curves["sin_mu"].sizes[:, 0])
        row = int(np.argmax(absolute <= np.nanmin(absolute) + TIED))
        least = Peak(float(absolute[row]), float(panels.start[row]))
    mu = math.asin(min(1.0, abs(least.value)))
    return Peak(0.0 if mu <= ZERO_TRANSMISSION_ANGLE else mu, least.place)


def _list_pin_loads(motion: MotionCurves) -> dict[str, PinLoad]:
    """List the largest and the RMS load of each pin."""
    loads = {}
    for pin, name in PIN_FORCE.items():
        bounded = motion.panels.has_value(name)
        peak = motion.panels.find_peak(name) if bounded else None
        loads[pin] = PinLoad(peak, motion.find_rms(name))
    return loads


def locate_bending(motion: MotionCurves) -> dict[int, BarBending]:
    """Locate the largest bending moment of each bar, and where along the bar it is."""
    panels = motion.panels
    peaks = {
        bar: panels.find_peak(name)
        for bar in MOVING_BARS
        if panels.has_value(name := f"bending_{bar}")
    }
    of_positions = dict[int, Bending]()
    if not panels.located or len(peaks) < len(MOVING_BARS):
        of_positions = compute_bending(motion.scene, motion.solution)
    located = {}
    for bar in MOVING_BARS:
        solution = motion.solution
        row = 0
        if panels.located and bar in peaks:
            solution = motion.solve_at(np.array([peaks[bar].place]))
            x = compute_bending(motion.scene, solution)[bar].x
        else:
            x = of_positions[bar].x
            moment = np.abs(of_positions[bar].moment)
            row = int(np.argmax(np.nan_to_num(moment, nan=-1.0)))
        located[bar] = BarBending(peaks.get(bar), float(x[row]), solution, row)
    return located


def _list_held(solution: Solution, drive: Driving, kind: str) -> list[HeldRange]:
    """List where dry friction holds a pin at rest.

    A turn that begins at such a position ends at the same, which is listed once.
    """
    low, high = (getattr(solution, name) for name in (drive.keys.low, drive.keys.high))
    if low is None:
        return []
    places = solution.at.places
    rows = np.flatnonzero(np.isfinite(low) & np.isfinite(high) & (low < high))
    ranges = list[HeldRange]()
    for run in split_runs(rows):
        if kind == "turn" and ranges and run[0] == len(solution) - 1 and rows[0] == 0:
            continue
        ends = float(places[run[0]]), float(places[run[-1]])
        least, most = float(low[run].min()), float(high[run].max())
        gap = max(np.ptp(low[run]), np.ptp(high[run]))
        varies = bool(gap > TIED * (most - least))
        ranges.append(HeldRange(least, most, ends, varies))
    return ranges


def _find_stroke_limits(scene: Scene, solution: Solution) -> tuple[float, float]:
    """Find the least and the greatest stroke over all angles of the commanded bar.

    The angles are all that it reaches on its branch, and on its side of the cylinder if
    a stroke is commanded.
    """
    at = solution.at
    first = int(np.argmax(solution.assembled))
    if at.moves_stroke:
        stroke = float(at.stated[0][first])
        ranges = find_stroke_ranges(scene)
        return min(ranges, key=lambda ends: max(ends[0] - stroke, stroke - ends[1]))
    here = float(at.angle[first])

    def find_excess(interval: tuple[float, float]) -> float:
        start, stop = interval
        return (here - start) % TURN - (stop - start)

    low, high = min(find_intervals(scene.linkage, at.bar), key=find_excess)
    width = high - low
    low = here - (here - low) % TURN if width < TURN else here - 0.5 * TURN
    high = low + (1.0 - _INSET) * width
    low += _INSET * width
    sweep = {f"theta_{at.bar}": Sweep(low, high, _STEPS_OF_RANGE)}
    motion = Motion(**sweep, branch=int(at.branch[first]))  # type: ignore[arg-type]
    whole = solve(replace(scene, motion=motion, tolerances=()), "position")
    panels = describe_motion(whole).positions
    least, most = (panels.find_peak("stroke", sense).value for sense in (-1, 1))
    # a cylinder whose ends meet has a corner there
    return 0.0 if least <= EXTREME_ERROR * most else least, most


def _find_period(scene: Scene, solution: Solution) -> float | None:
    """Find the time after which a released motion repeats itself; None if it does not.

    A motion that loses no energy comes back to its start, and to where an angle is
    largest or smallest for the first time.
    """
    if solution.with_extremes is None:
        return None
    motion = solve(scene, "velocity", at=solution.with_extremes)
    times = np.asarray(motion.time)
    rows = np.flatnonzero(~np.isin(times[1:], solution.time)) + 1
    speeds = np.array([getattr(motion, f"omega_{bar}") for bar in MOVING_BARS])
    same_speed = TIED * np.abs(speeds).max()
    units = np.exp(1j * np.array([motion.theta_2, motion.theta_4]))
    for start in [0, *rows[:1].tolist()]:
        later = rows[rows > start]
        is_same = (np.abs(units[:, later] - units[:, [start]]) <= TIED).all(axis=0)
        speed_changes = np.abs(speeds[:, later] - speeds[:, [start]])
        is_same &= (speed_changes <= same_speed).all(axis=0)
        if is_same.any():
            return float(times[later[np.argmax(is_same)]] - times[start])
    return None


def _find_largest_error_bar(solution: Solution, drive: Driving | None) -> float | None:
    """Find the largest error bar over its value.

    Where the value passes through zero, it is over the median.
    """
    if solution.force_error is None:
        return None
    loads = compute_pin_loads(solution)
    pairs = [(solution.force_error, np.max([*loads.values()], axis=0))]
    if drive is not None and drive.error is not None:
        pairs.append((drive.error, drive.sizes))
    largest = None
    for error, size in pairs:
        solved = np.isfinite(error) & np.isfinite(size) & (solution.status_code == OK)
        usual = np.median(size[solved]) if solved.any() else 0.0
        reference = np.maximum(size, usual)
        # where most are exactly zero, so may be one with an error bar
        solved &= reference > 0.0
        if solved.any():
            relative = float((error[solved] / reference[solved]).max())
            largest = relative if largest is None else max(largest, relative)
    return largest
