"""Summary of a solved scene: ranges, peaks and their places, drive and ends of motion.

The facts come from the curves over the motion; `fourbar.show.block` prints them.
"""

import math
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fourbar.formulas.mobility import choose_range, turns_fully
from fourbar.formulas.path import count_turns
from fourbar.linkage import MOVING_BARS
from fourbar.quantities import OK, Array
from fourbar.scene import find_stroke_ranges
from fourbar.scene.motion import BRANCH_NAMES, Motion, Sweep
from fourbar.show.driving import (
    is_once_round,
    leaves_range,
    read_drive_demand,
)
from fourbar.show.duty import MotorDuty, motor_duty
from fourbar.show.motion_curves import (
    compute_bending,
    compute_pin_loads,
    describe_motion,
)
from fourbar.show.panels import EXTREME_ERROR, LOWER, TIED, UPPER, Peak, split_runs
from fourbar.solution import Solution
from fourbar.solving import solve
from fourbar.studies.internal_forces import Bending

_BESIDE = 1e-6
"""Part of the motion from a change point to where a bending moment is read."""
ZERO_TRANSMISSION_ANGLE = 1e-6
"""Transmission angle that counts as zero, rad. At a limit, a place in its last digits
leaves some 1e-8.
"""
_INSET = 1e-9
"""Angle that is left out of a range at its limit positions, rad. These may not assemble
as doubles.
"""
_STEPS_OF_RANGE = 48
"""Steps of the range of a bar in which a single position lies."""


class BarBending(NamedTuple):
    """Largest size of the bending moment of a bar."""

    peak: Peak
    """N m; infinite if it grows without bound."""
    x: float
    """Place of the peak along the bar, m from its first pin."""
    solution: Solution
    row: int
    """Index of the peak's position in `solution`, or of the position of the motion with
    the largest moment.
    """


class HeldRange(NamedTuple):
    """Neighbouring positions at which dry friction holds a pin at rest."""

    low: float
    """Least torque or force of the drive that holds one of them."""
    high: float
    """Greatest torque or force that holds one of them."""
    ends: tuple[float, float] | None
    """Commanded angle or stroke of the first and the last, rad or m, or the time, s.
    None: all positions.
    """
    varies: bool
    """False if each of them is held from `low` to `high`, as in a dwell."""

    @classmethod
    def of(cls, ends: tuple[float, float] | None, bounds: Array) -> "HeldRange":
        """Return the range of what holds, each of two bounds at some places, (2, n)."""
        low, high = float(bounds.min()), float(bounds.max())
        varies = np.ptp(bounds, axis=1).max() > TIED * (high - low)
        return cls(low, high, ends, bool(varies))


class Facts:
    """Facts of a solved scene over its motion, SI units and radians.

    Each is found when it is first asked for.

    Parameters
    ----------
    solution : of a scene, solved up to the forces or the error bars; at least one
        position assembles.
    """

    def __init__(self, solution: Solution) -> None:
        self.solution = solution
        self.scene = solution.scene
        self.motion = describe_motion(solution)
        """Curves over the motion, with what grows without bound."""
        self.drive = read_drive_demand(solution)

    @cached_property
    def kind(self) -> str:
        """One of "position", "list", "sweep", "turn", "law" and "released".

        A turn is whole turns of what is commanded.
        """
        motion = self.scene.motion
        if len(self.solution) == 1:
            return "position"
        if motion.free is not None:
            return "released"
        if motion.law is not None:
            return "law"
        if isinstance(motion.angle, np.ndarray):
            return "list"
        closes = not self.solution.at.moves_stroke and is_once_round(self.solution)
        return "turn" if closes and not self.motion.stretches else "sweep"

    @property
    def ends(self) -> tuple[float, float]:
        """First and last commanded angle or stroke.

        A motion law and a released motion have times instead.
        """
        first, last = self.solution.at.places[[0, -1]].tolist()
        return first, last

    @cached_property
    def angles(self) -> dict[int, list[tuple[Peak, Peak]]]:
        """Smallest and largest angle of bars 2, 3 and 4 in each circuit."""
        return {bar: self._find_ranges(f"theta_{bar}") for bar in MOVING_BARS}

    @cached_property
    def stroke_ranges(self) -> list[tuple[Peak, Peak]]:
        """Smallest and largest stroke in each circuit; empty without a stroke."""
        return [] if self.solution.stroke is None else self._find_ranges("stroke")

    def _find_ranges(self, name: str) -> list[tuple[Peak, Peak]]:
        """Find the least and the greatest value of a curve in each circuit passed."""
        return [
            (panels.find_peak(name, LOWER), panels.find_peak(name, UPPER))
            for panels in self.motion.of_circuits
        ]

    @property
    def drives(self) -> bool:
        """Return True if torque or force of the drive is known at any position."""
        return bool(np.isfinite(self.drive.values).any())

    @property
    def has_forces(self) -> bool:
        """Return True if pin forces are known at any position."""
        F12 = self.solution.F12
        return F12 is not None and bool(np.isfinite(F12).any())

    @cached_property
    def peak(self) -> Peak:
        """Largest torque or force of the drive, as of `MotionCurves.find_peak`."""
        return self.motion.find_peak(self.drive.keys.value)

    @cached_property
    def duty(self) -> MotorDuty | None:
        """Duty of the drive over a motion."""
        at_one = not self.drives or self.kind == "position"
        return None if at_one else motor_duty(self.solution)

    @cached_property
    def transmission(self) -> Peak:
        """Smallest transmission angle; it is 0 where its sine changes its sign."""
        panels = self.motion.positions
        solution = self.solution
        if abs(solution.sin_mu[0]) <= ZERO_TRANSMISSION_ANGLE:
            return Peak(0.0, float(solution.at.places[0]))
        # a released motion states those of its change points alone
        zeros = panels.find_zeros("sin_mu") if panels.located else ()
        if passed := [*zeros, *(solution.change_points or ())]:
            return Peak(0.0, float(passed[0]))
        # between two stretches it may change its sign without a zero
        least = panels.find_peak("sin_mu", lambda sines: -np.abs(sines))
        mu = math.asin(min(1.0, abs(least.value)))
        return Peak(0.0 if mu <= ZERO_TRANSMISSION_ANGLE else mu, least.place)

    @cached_property
    def bending(self) -> dict[int, BarBending]:
        """Largest bending moment of each bar, and where along the bar it is."""
        if not self.has_forces:
            return {}
        motion = self.motion
        peaks = {bar: motion.find_peak(f"bending_{bar}") for bar in MOVING_BARS}
        located = {}
        coarse = dict[int, Bending]()
        for bar, peak in peaks.items():
            solution = self.solution
            if motion.panels.located and math.isfinite(peak.value):
                # on a change point there are no forces, which it has beside it
                away = _BESIDE * motion.panels.length * np.array([0.0, -1.0, 1.0])
                places = np.clip(peak.place + away, min(self.ends), max(self.ends))
                solution = motion.solve_at(places)
                bending = compute_bending(solution)[bar]
            else:
                coarse = coarse or compute_bending(solution)
                bending = coarse[bar]
            row = int(np.argmax(np.nan_to_num(np.abs(bending.moment), nan=-1.0)))
            located[bar] = BarBending(peak, float(bending.x[row]), solution, row)
        return located

    @cached_property
    def held(self) -> list[HeldRange]:
        """Where dry friction holds a pin at rest, in the order of the positions.

        A turn that begins at such a position ends at the same, which is listed once.
        """
        solution = self.solution
        rows = np.flatnonzero(leaves_range(solution))
        if not self.drives or not len(rows):
            return []
        name, _, *both = self.drive.keys
        if self.motion.panels.located and not np.any(solution.at.speed):
            peaks = [  # between the positions too
                [way.panels.find_peak(name, rank).value for rank in (LOWER, UPPER)]
                for way in self.motion.begun
            ]
            return [HeldRange.of(None, np.array(peaks))]
        bounds = np.array([solution[end] for end in both])
        places = solution.at.places.tolist()
        law = self.scene.motion.law
        times = np.array([] if law is None else law.time)
        rests = times if law is None else times[law.at(times)[1] == 0.0]
        beside = [places[0], *places, places[-1]]
        ranges = list[HeldRange]()
        for run in split_runs(rows):
            is_end = run[0] == len(solution) - 1 and rows[0] == 0
            if self.kind == "turn" and ranges and is_end:
                continue
            ends = places[run[0]], places[run[-1]]
            # a dwell lasts from one of a law's times to another
            beyond = (beside[run[0]] <= rests) & (rests <= beside[run[-1] + 2])
            ends = min([ends[0], *rests[beyond]]), max([ends[1], *rests[beyond]])
            ranges.append(HeldRange.of(ends, bounds[:, run]))
        return ranges

    @cached_property
    def is_held_at_rest(self) -> bool:
        """Return True if nothing moves where dry friction holds a pin."""
        rows = np.flatnonzero(leaves_range(self.solution))
        return not np.any(self.solution.at.part(rows).speed)

    @cached_property
    def stroke_limits(self) -> tuple[float, float] | None:
        """The least and the greatest stroke over the circuit of the motion.

        The circuit goes on where the commanded bar reverses. A commanded stroke stays
        on its side of the cylinder.
        """
        solution = self.solution
        if solution.stroke is None:
            return None
        scene = self.scene
        at = solution.at
        first = int(np.argmax(solution.assembled))
        if at.moves_stroke:
            stroke = float(at.stated[0][first])
            ranges = find_stroke_ranges(scene)
            return min(ranges, key=lambda ends: max(ends[0] - stroke, stroke - ends[1]))
        here = float(at.angle[first])
        linkage = scene.linkage
        low, high = choose_range(linkage, at.bar, here, _INSET)
        sweep = {f"theta_{at.bar}": Sweep(low, high, _STEPS_OF_RANGE)}
        in_one_turn = count_turns(linkage.lengths, at.bar) == 1
        is_whole = turns_fully(linkage, at.bar) and in_one_turn
        strokes = []
        for branch in (int(at.branch[first]),) if is_whole else BRANCH_NAMES:
            motion = Motion(**sweep, branch=branch)  # type: ignore[arg-type]
            of_branch = solve(replace(scene, motion=motion, tolerances=()), "position")
            panels = describe_motion(of_branch).positions
            strokes += [panels.find_peak("stroke", end).value for end in (LOWER, UPPER)]
        least, most = min(strokes), max(strokes)
        # a cylinder whose ends meet has a corner there
        return 0.0 if least <= EXTREME_ERROR * most else least, most

    @cached_property
    def period(self) -> float | None:
        """Time after which a released motion repeats itself, s; None if it does not.

        A motion that loses no energy comes back to its start, and to where an angle is
        largest or smallest for the first time.
        """
        solution = self.solution
        if solution.with_extremes is None:
            return None
        motion = solve(self.scene, "velocity", at=solution.with_extremes)
        times = np.asarray(motion.time)
        rows = np.flatnonzero(~np.isin(times[1:], solution.time)) + 1
        speeds = np.array([getattr(motion, f"omega_{bar}") for bar in MOVING_BARS])
        turned = np.exp(1j * np.array([motion.theta_2, motion.theta_4]))
        states = np.concatenate([turned, speeds / (np.abs(speeds).max() or 1.0)])
        for start in [0, *rows[:1].tolist()]:
            later = rows[rows > start]
            away = np.abs(states[:, later] - states[:, [start]]).max(axis=0)
            same = times[later[away <= TIED]]
            if same.size:
                return float(same[0] - times[start])
        return None

    @cached_property
    def error(self) -> float | None:
        """Largest error bar of the drive and of the pin forces, over the value.

        None: no error bar was computed.
        """
        error = self.solution.force_error
        if error is None:
            return None
        loads = compute_pin_loads(self.solution)
        shares = self.relate_errors(error, np.max([*loads.values()], axis=0))
        of_drive = self.relate_errors(self.drive.error, self.drive.sizes)
        shares = np.append(shares, of_drive)
        known = shares[np.isfinite(shares)]
        return float(known.max()) if known.size else None

    def relate_errors(self, error: Array, size: Array) -> Array:
        """Return error bars over the sizes of the values, (n,), NaN where none is.

        Where a value passes through zero, its error bar is over the median.
        """
        solved = np.isfinite(error + size) & (self.solution.status_code == OK)
        usual = np.median(size[solved]) if solved.any() else 0.0
        reference = np.maximum(size, usual)
        # where most are exactly zero, so may be one with an error bar
        solved &= reference > 0.0
        shares = np.full(len(size), np.nan)
        np.divide(error, reference, out=shares, where=solved)
        return shares
