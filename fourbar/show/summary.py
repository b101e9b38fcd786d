"""Summary of a solved scene: ranges, peaks and their places, and more.

It has the needs of the drive and the ends of the motion. `locate_between` finds what
the steps of a sweep pass over: reversals of dry friction, and the largest torque and
pin forces; `locate_bending` the largest bending moments. `summarize` computes the
facts; `fourbar.show.block` prints them.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fourbar.formulas.mobility import TURN, find_intervals
from fourbar.linkage import MOVING_BARS, PIN_FORCE, PINS
from fourbar.quantities import (
    CHANGE_POINT,
    COUPLE,
    LINE,
    OK,
    PIN_FORCES,
    STATUS_NAMES,
    Array,
)
from fourbar.scene import Scene, command_at
from fourbar.scene.motion import Motion
from fourbar.show.duty import (
    Driving,
    MotorDuty,
    bearing_load,
    is_once_round,
    motor_duty,
    read_drive_demand,
)
from fourbar.show.units import SHOWN_AS_ZERO, drop_rounding
from fourbar.solution import Solution
from fourbar.solving import solve
from fourbar.studies.internal_forces import Bending, internal_forces

CUTS = 40
"""Parts into which one call of `solve` cuts every interval that is looked at."""
LOCATING_ROUNDS = 5
"""Calls of `solve` to locate a reversal or a peak. From steps of 5 degrees a reversal
is located to 5e-8 degrees, a peak to 1.6e-6 degrees.
"""
_MOST_PEAKS = 6
"""Number of peaks of one quantity that are listed, the highest."""
_BENDING_PEAKS, _BENDING_ROUNDS = 3, 3
"""The same for bending moments. Only the largest of a bar is shown, with four digits.
"""
_NO_BENDING = 1e-13
"""Bending moment that is round-off, over the pin forces times the longest bar."""
GROWING = 1e-3
"""Growth over the last two calls above which a quantity has a pole. It is a part of the
value; less growth is that of a maximum.
"""
SLIP_AT_REST = 1e-12
"""Part of its largest slip below which a pin is at rest at a position."""
RANGE_POSITIONS = 7200
"""Positions at which ranges are looked for, by the position formula alone."""
_INSET = 1e-9
"""Part of a range that is left out at its limit positions. These may not assemble as
doubles.
"""
_END_ROUNDS = 9
"""Rounds of cutting the interval in which the assembly ends by 40. They go down to the
last digits of a double.
"""
_AS_WIDE = 1e-6
"""Difference below which ranges of angles are equally wide, rad. An end in its last
digits leaves some 1e-8.
"""
ZERO_TRANSMISSION_ANGLE = 1e-6
"""Transmission angle that counts as zero, rad. At a limit, a place in its last digits
leaves some 1e-8.
"""
ComputeSizes = Callable[[Solution], dict[str, Array]]
"""List magnitudes at the positions of a solution, by name."""


class Peak(NamedTuple):
    """Largest or smallest value of a quantity, and where it is taken."""

    value: float
    place: float
    """Commanded angle or stroke at the peak, rad or m. For a motion over time it is the
    time, s.
    """


class _BarBending(NamedTuple):
    """Largest size of the bending moment of a bar, N m."""

    peak: Peak
    x: float
    """Place of the peak along the bar, m from its first pin."""
    solution: Solution
    row: int
    """Index of the peak's position in `solution`."""
    grows: bool
    """True if the moment grows without bound between the positions. Or nothing was
    searched between them.
    """


class Between(NamedTuple):
    """A sweep with what its steps pass over."""

    sweep: Solution
    """Solution at the positions of the sweep alone."""
    solution: Solution
    """Solution at the positions of the sweep and at those found between them. These are
    both sides of each reversal, and the largest of each magnitude.
    """
    reversals: list[tuple[float, str]]
    """Commanded angle or stroke, rad or m, and the pin at which friction reverses. The
    friction is dry, and the pin forces jump there.
    """
    growing: set[str]
    """Names of the magnitudes that grow without bound within a step. They are all if no
    step was searched.
    """

    def bounded(self, *names: str) -> Solution:
        """Return the solution to take the peaks of magnitudes from.

        It is the sweep alone if one grows without bound.
        """
        if self.growing.intersection(names):
            return self.sweep
        return self.solution


def list_sizes(solution: Solution) -> dict[str, Array]:
    """List the magnitudes whose largest values are located.

    These are torque, power and speed of the drive, and pin forces.
    """
    drive = read_drive_demand(solution)
    keys = {
        drive.keys.value: drive.keys.value,
        "power": "power",
        "speed": drive.speed_key,
    }
    forces = {name: np.hypot(*getattr(solution, name).T) for name in PIN_FORCES}
    works = {name: np.abs(getattr(solution, key)) for name, key in keys.items()}
    # what a balanced linkage leaves of a load is rounding, and has no peak
    largest = np.max([*forces.values()], axis=0)
    forces = {name: drop_rounding(size, largest) for name, size in forces.items()}
    lever = _find_lever(solution)
    idle = works[drive.keys.value] <= SHOWN_AS_ZERO * largest * lever
    for name in (drive.keys.value, "power"):
        works[name] = np.where(idle, 0.0, works[name])
    return {**works, **forces}


def find_drive_rounding(solution: Solution) -> float:
    """Return the rounding of the torques (forces) that the drive sums, N m or N.

    They are inertial ones, and usual pin forces at the longest bar. At a change
    point an error bar is less, and where springs balance weights, as far as their
    numbers are rounded.
    """
    assert solution.scene is not None
    inertial = 0.0
    for number, bar in zip(MOVING_BARS, solution.scene.linkage.moving, strict=True):
        a_G = getattr(solution, f"a_G{number}")
        inertial += bar.mass * float(np.nanmax(np.hypot(*a_G.T), initial=0.0))
    usual = 0.0
    for name in PIN_FORCES:
        sizes = np.hypot(*getattr(solution, name).T)
        if np.isfinite(sizes).any():
            usual = max(usual, float(np.nanmedian(sizes)))
    return SHOWN_AS_ZERO * max(inertial, usual) * _find_lever(solution)


def _find_lever(solution: Solution) -> float:
    """Return the arm at which pin forces load the drive: the longest bar, m.

    It is 1 for a drive that exerts a force itself.
    """
    if solution.drive is None and solution.scene is not None:
        return max(solution.scene.linkage.lengths)
    return 1.0


def locate_between(scene: Scene, solution: Solution) -> Between:
    """Locate reversals and largest values between the positions.

    The positions are of a sweep or motion law; finer ones are solved. Nothing is
    searched for a released motion, a list of angles, or a scene without a speed.

    `solution`: of the scene's positions, or of its sweep in rising order, to the stage
    "force".
    """
    if not _has_between(scene, solution):
        return Between(solution, solution, [], {COUPLE.value, LINE.value, *PIN_FORCES})
    pins, low, high = _find_reversing(scene, solution)
    for _ in range(LOCATING_ROUNDS if pins else 0):
        places = _cut_range(low, high)
        inside = _solve_at(scene, places.ravel(), "velocity")
        slips = np.array(
            [
                _slip_of_pin(inside, pin).reshape(places.shape)[row]
                for row, pin in enumerate(pins)
            ]
        )
        turned = np.argmax(slips * slips[:, :1] <= 0.0, axis=1)
        rows = np.arange(len(pins))
        low = places[rows, turned - 1]
        high = places[rows, turned]
    merged = _merge(scene, solution, np.concatenate([low, high]))
    if scene.motion.law is None:
        angles = low
    else:
        angles = scene.motion.law.at(low)[0]
    peaks, growing = _find_peaks(scene, merged, list_sizes)
    reversals = sorted(zip(angles.tolist(), pins, strict=True))
    return Between(solution, _merge(scene, merged, peaks), reversals, growing)


def locate_bending(scene: Scene, between: Between) -> dict[int, _BarBending]:
    """Locate the largest bending moment of each bar, between the positions too.

    Only `analyze` and its figure need it. Empty where no position has forces.
    """
    solution = between.bounded(*between.growing)
    if solution.F12 is None or not np.isfinite(solution.F12).any():
        return {}

    longest = max(scene.linkage.lengths)

    def find(solution: Solution) -> dict[str, Bending]:
        forces = [np.hypot(*getattr(solution, name).T) for name in PIN_FORCES]
        size = longest * np.max(forces, axis=0)
        return {
            str(bar): _drop_bending_round_off(
                internal_forces(scene, solution, bar, np.zeros(1)).largest, size
            )
            for bar in MOVING_BARS
        }

    def list_moments(solution: Solution) -> dict[str, Array]:
        return {bar: np.abs(bending.moment) for bar, bending in find(solution).items()}

    growing = {str(bar) for bar in MOVING_BARS}
    searched = [(solution, find(solution))]
    if _has_between(scene, solution):
        places, growing = _find_peaks(
            scene, solution, list_moments, _BENDING_PEAKS, _BENDING_ROUNDS
        )
        if len(places):
            peaks = _solve_at(scene, places)
            searched.append((peaks, find(peaks)))
    bending = dict[int, _BarBending]()
    for bar in MOVING_BARS:
        grows = str(bar) in growing
        for solution, largest in (
            searched[:1] if grows else searched
        ):  # the peak of another bar may stand beside a pole
            moment, x = largest[str(bar)]
            peak = _find_peak(solution, np.abs(moment))
            row = int(np.argmax(np.nan_to_num(np.abs(moment), nan=-1.0)))
            if bar not in bending or peak.value > bending[bar].peak.value:
                bending[bar] = _BarBending(peak, float(x[row]), solution, row, grows)
    return bending


def _list_stresses(
    scene: Scene,
    bending: dict[int, _BarBending],
) -> dict[int, float | None]:
    """List the largest bending stresses.

    Each is the bending moment over the section modulus.
    """
    stresses = dict[int, float | None]()
    for bar, largest in bending.items():
        modulus = scene.linkage.bar(bar).section_modulus
        stresses[bar] = None if modulus is None else largest.peak.value / modulus
    return stresses


def _drop_bending_round_off(bending: Bending, size: Array) -> Bending:
    """Return bending moments with zero where they are rounding of the pin forces.

    A two-force bar has none.
    """
    moment = np.where(np.abs(bending.moment) <= _NO_BENDING * size, 0.0, bending.moment)
    return bending._replace(moment=moment)


def _has_between(scene: Scene, solution: Solution) -> bool:
    listed = isinstance(scene.motion.angle, np.ndarray)
    return (
        scene.motion.free is None
        and not listed
        and solution.F12 is not None
        and len(solution) > 1
    )


def _solve_at(scene: Scene, places: Array, stage: str = "force") -> Solution:
    """Solve at commanded angles or strokes, or at the times of a motion law."""
    return solve(scene, stage, at=command_at(scene, places))


def _cut_range(low: Array, high: Array) -> Array:
    return low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, CUTS + 1)


def _merge(
    scene: Scene,
    solution: Solution,
    places: Array,
    stage: str = "force",
) -> Solution:
    """Solve at the positions of a solution and at others among them.

    The order is that of the solution.
    """
    if not len(places):
        return solution
    merged = np.concatenate([solution.at.places, places])
    order = np.unique(merged, return_index=True)[1][
        :: 1 if merged[0] < merged[1] else -1
    ]
    return _solve_at(scene, merged[order], stage)


def _slip_of_pin(solution: Solution, pin: str) -> Array:
    """Compute omega_j - omega_i of the bars that meet at a pin."""
    first, second = (
        0.0 if bar == 1 else getattr(solution, f"omega_{bar}") for bar in PINS[pin]
    )
    return np.asarray(second - first)


def _find_reversing(scene: Scene, solution: Solution) -> tuple[list[str], Array, Array]:
    """List the steps in which the slip of a pin with dry friction changes sign.

    Each has the pin and its ends.
    """
    places = solution.at.places
    steps = list[tuple[str, int, int]]()
    for pin in sorted({pin for effect in scene.effects for pin in effect.dry_pins}):
        slip = np.nan_to_num(_slip_of_pin(solution, pin))
        moving = np.flatnonzero(np.abs(slip) > SLIP_AT_REST * np.abs(slip).max())
        steps += [
            (pin, i, j)
            for i, j in pairwise(moving.tolist())
            if slip[i] * slip[j] < 0.0 and solution.assembled[i:j].all()
        ]
    first, last = (np.array([step[end] for step in steps], dtype=int) for end in (1, 2))
    return [pin for pin, *_ in steps], places[first], places[last]


class _Search(NamedTuple):
    """Search for the largest value of a magnitude around one position."""

    name: str
    top: int
    """Index of the position of largest value."""
    start: int
    """Index of the first position of the steps that are searched."""
    stop: int
    inward: bool = False
    """True if it goes away from the top, as far as values exist: a maximum on the way
    would hide the pole of a change point.
    """


def _find_peaks(
    scene: Scene,
    solution: Solution,
    sizes: ComputeSizes,
    most: int = _MOST_PEAKS,
    rounds: int = LOCATING_ROUNDS,
) -> tuple[Array, set[str]]:
    """Find the places of the local maxima of each magnitude.

    The names of those that grow are returned too. A pole close beside the positions
    looks like one between them after few rounds, so that more follow then.
    """
    places = solution.at.places
    searches = list[_Search]()
    passed = _find_dead_points(scene, solution) + _find_change_points(solution)
    present = sizes(solution)
    for name, size in present.items():
        padded = np.concatenate(
            [[-1.0], np.nan_to_num(size, nan=-1.0, posinf=-1.0), [-1.0]]
        )
        before = padded[:-2]
        here = padded[1:-1]
        after = padded[2:]
        tops = np.flatnonzero(
            (here >= before)
            & (here >= after)
            & (here > np.minimum(before, after))
            & (here > 0.0)
        )
        for i in tops[np.argsort(-here[tops], kind="stable")][:most]:
            start = i - (before[i] >= 0.0)
            stop = i + (after[i] >= 0.0)
            searches.append(_Search(name, i, start, stop))
        for step in passed:
            rises = bool(padded[step + 1] < padded[step + 2])
            searches.append(_Search(name, step + rises, step, step + 1))
        for i, j in pairwise(
            range(len(places))
        ):  # towards a gap a magnitude may grow without a local maximum
            if padded[i + 1] * padded[j + 1] < 0.0:
                beside = _Search(name, i if padded[j + 1] < 0.0 else j, i, j)
                searches.append(beside)
                if solution.assembled[i] and solution.assembled[j]:
                    searches.append(beside._replace(inward=True))
    if not searches:
        return np.zeros(0), set()
    names, *columns = zip(*searches, strict=True)
    top, start, stop, inward = map(np.array, columns)
    opens = inward | ~(solution.assembled[start] & solution.assembled[stop])
    begins = solution.assembled[start] & ~(inward & (top == stop))
    low = places[start]
    high = places[stop]
    peak_places = places[top]
    reached = [np.array([present[one.name][one.top] for one in searches])]
    growing = np.zeros(len(searches), dtype=bool)
    rows = np.arange(len(searches))
    for count in range(LOCATING_ROUNDS):
        if count >= rounds and not growing.any():
            break
        cut_range = _cut_range(low, high)
        inside = sizes(_solve_at(scene, cut_range.ravel()))
        values = np.array(
            [
                np.nan_to_num(inside[n].reshape(cut_range.shape)[k], nan=-1.0)
                for k, n in enumerate(names)
            ]
        )
        inwards = np.abs(np.arange(CUTS + 1) - np.where(begins, 0, CUTS)[:, None])
        best = np.argmax(
            np.where(opens[:, None] & (values >= 0.0), inwards, values),
            axis=1,
        )
        peak_places, low, high = (
            cut_range[rows, np.clip(best + step, 0, CUTS)] for step in (0, -1, 1)
        )
        reached.append(values[rows, best])
        if count + 1 >= rounds:
            growing = _find_growing(reached, values, best)
    kept = (
        ~growing & (reached[-1] > reached[0]) & ~opens
    )  # beside a gap other magnitudes grow
    return (
        peak_places[kept],
        {name for name, grows in zip(names, growing, strict=True) if grows},
    )


def _find_change_points(solution: Solution) -> list[int]:
    """List the steps within which the linkage passes a change point."""
    # on a change point itself the sine is rounding
    between = solution.status_code != CHANGE_POINT
    sine = np.where(between, np.nan_to_num(solution.sin_mu), 0.0)
    steps: list[int] = np.flatnonzero(sine[:-1] * sine[1:] < 0.0).tolist()
    return steps


def _find_dead_points(scene: Scene, solution: Solution) -> list[int]:
    """List the steps within which the drive stands still and the linkage moves.

    Forces have a pole there. Its two ends need not be maxima of the positions.
    """
    at = solution.at
    if at.stroke is not None or (scene.drive is None and scene.drive_bar == at.bar):
        return []
    one = np.ones(len(solution))
    moving = solve(scene, "velocity", at=at._replace(speed=one, acceleration=0.0 * one))
    speed = np.nan_to_num(getattr(moving, read_drive_demand(moving).speed_key))
    steps: list[int] = np.flatnonzero(speed[:-1] * speed[1:] < 0.0).tolist()
    return steps


def _find_growing(
    reached: list[Array],
    values: Array,
    best: NDArray[np.intp],
) -> NDArray[np.bool_]:
    """Mark the searches for a maximum that end beside a pole.

    Towards a pole the values of the last calls rise. A call may hit the pole to within
    rounding, after which nothing rises; the value then stands out from both beside it.

    Parameters
    ----------
    reached : largest value of each search after each call, (k,) each.
    values : values of the last call, (k, CUTS + 1).
    best : index of the largest of them, (k,).
    """
    rises: NDArray[np.bool_] = reached[-1] > (1.0 + GROWING) * reached[-3]
    padded = np.pad(values, ((0, 0), (1, 1)), constant_values=-1.0)
    rows = np.arange(len(best))
    beside = np.maximum(padded[rows, best], padded[rows, best + 2])
    return rises | (reached[-1] > (1.0 + GROWING) * beside)


class _PinLoad(NamedTuple):
    """Load of one pin over the positions, N."""

    peak: Peak
    rms: float


@dataclass(frozen=True, slots=True)
class Facts:
    """Facts of a solved scene, SI units and radians."""

    scene: Scene
    solution: Solution
    kind: str
    """"position", "list", "sweep", "turn", "law" or "released". A turn is whole turns
    of what is commanded.
    """
    counts: dict[str, int]
    """Number of positions of each status."""
    commanded: tuple[float, float]
    """First and last commanded angle or stroke. It is a time for a motion law or a
    released motion.
    """
    angles: dict[int, tuple[Peak, Peak]]
    """Smallest and largest angle of bars 2, 3 and 4."""
    transmission: Peak
    """Smallest transmission angle."""
    stretches: list[tuple[float | None, float | None]]
    """Places from and up to which the linkage assembles. None at the ends of the
    motion; empty if it always assembles.
    """
    drive: Driving | None
    """Drive; None for a released linkage, and where only positions are known."""
    peak: Peak | None
    """Largest torque or force of the drive, signed."""
    duty: MotorDuty | None
    held: tuple[float, float] | None
    """Least and greatest torque or force while dry friction holds a pin at rest."""
    pins: dict[str, _PinLoad]
    rates: dict[int, tuple[Peak, Peak]]
    """Largest speed and acceleration, signed, of the bars that follow. Empty if no
    speed is stated.
    """
    bending: dict[int, _BarBending]
    stresses: dict[int, float | None]
    """Largest bending stress of each bar, Pa; None if its cross-section is not stated.
    """
    stroke_range: tuple[Peak, Peak] | None
    """Smallest and largest stroke of the motion."""
    stroke_limits: tuple[float, float] | None
    """Smallest and largest stroke that assembles on the branch. With a stroke commanded
    it is that of the side.
    """
    between: Between
    """Events within the steps of the sweep."""
    error: float | None
    """Largest error bar of the drive and of the pin forces, over the value. None: no
    error bar was computed.
    """

    @property
    def linear(self) -> bool:
        """Return True if the drive exerts a force."""
        return self.solution.drive is not None


def summarize(scene: Scene, solution: Solution) -> Facts:
    """Collect the facts of a scene solved up to the forces or the error bars.

    At least one position assembles.
    """
    between = locate_between(scene, solution)
    kind = _find_kind(scene, solution)
    places = _list_commanded(solution)
    codes = solution.status_code
    fine = solution
    stretches = list[tuple[float | None, float | None]]()
    if smooth := kind in ("sweep", "turn", "law"):
        fine, stretches = _solve_finely(scene, places)
        if stretches and kind == "turn":
            kind = "sweep"

    def find_range(values: Array) -> tuple[Peak, Peak]:
        low, high = (
            _find_extreme(sign * values, _list_commanded(fine), sign, smooth)
            for sign in (-1, 1)
        )
        return low, high

    least, _ = find_range(np.square(fine.sin_mu))
    mu = math.asin(min(1.0, math.sqrt(max(least.value, 0.0))))
    released = scene.motion.free is not None
    bending = locate_bending(scene, between)
    if released or solution.F12 is None:
        drive = None
    else:
        drive = read_drive_demand(solution)
    peak = None
    if drive is not None and np.isfinite(drive.values).any():  # type: ignore[arg-type]
        located = between.bounded(drive.keys.value)
        peak = _find_peak(located, read_drive_demand(located).values)
    return Facts(
        scene=scene,
        solution=solution,
        kind=kind,
        counts={
            STATUS_NAMES[code]: int(np.sum(codes == code)) for code in np.unique(codes)
        },
        commanded=(float(places[0]), float(places[-1])),
        angles={
            bar: find_range(_join_stretches(solution, fine, bar)) for bar in MOVING_BARS
        },
        transmission=Peak(mu if mu > ZERO_TRANSMISSION_ANGLE else 0.0, least.place),
        stretches=stretches,
        drive=drive if peak is not None else None,
        peak=peak,
        duty=find_duty(between) if peak is not None and kind != "position" else None,
        held=None if drive is None else _find_held(solution, drive),
        pins=_list_pin_loads(solution, between),
        rates=_find_rates(solution, smooth=smooth),
        bending=bending,
        stresses=_list_stresses(scene, bending),
        stroke_range=None if fine.stroke is None else find_range(fine.stroke),
        stroke_limits=(
            None if solution.stroke is None else _find_stroke_limits(scene, solution)
        ),
        between=between,
        error=_find_largest_error_bar(solution, drive),
    )


def _find_rates(solution: Solution, *, smooth: bool) -> dict[int, tuple[Peak, Peak]]:
    """Find the largest speed and acceleration of the bars that follow.

    They follow what is commanded.
    """
    places, rates = _list_commanded(solution), dict[int, tuple[Peak, Peak]]()
    if solution.omega_4 is None or len(solution) == 1:
        return rates
    moved = () if solution.time is not None else (solution.at.bar,)
    for bar in MOVING_BARS:
        if bar in moved:
            continue
        peaks = []
        for letter in ("omega", "alpha"):
            values = getattr(solution, f"{letter}_{bar}")
            if not np.isfinite(values).any():
                return {}
            sign = 1 if np.nanmax(values) >= -np.nanmin(values) else -1
            peaks.append(_find_extreme(sign * values, places, sign, smooth))
        rates[bar] = (peaks[0], peaks[1])
    return rates


def _find_kind(scene: Scene, solution: Solution) -> str:
    motion = scene.motion
    if len(solution) == 1:
        return "position"
    if motion.free is not None:
        return "released"
    if motion.law is not None:
        return "law"
    if isinstance(motion.angle, np.ndarray):
        return "list"
    once_round = (
        solution.at.stroke is None
        and is_once_round(solution)
        and solution.assembled.all()
    )
    return "turn" if once_round else "sweep"


def _list_commanded(solution: Solution) -> Array:
    """List the commanded angle or stroke at each position.

    It is the time for a motion over time.
    """
    if solution.time is None:
        return solution.at.places
    return solution.time


def _find_extreme(values: Array, places: Array, sign: int, smooth: bool) -> Peak:
    """Find the largest of signed values.

    Of a smooth curve it is the top of the parabola through it and its neighbours.
    """
    i = int(np.nanargmax(values))
    value = float(values[i])
    place = float(places[i])
    beside = slice(i - 1, i + 2)
    inside = 0 < i < len(values) - 1
    if (
        smooth
        and inside
        and np.isfinite(values[beside]).all()
        and np.isclose(*np.diff(places[beside]))
    ):
        rise = values[i + 1] - values[i - 1]
        bend = values[i + 1] - 2.0 * values[i] + values[i - 1]
        if bend < 0.0:
            value -= float(rise * rise / (8.0 * bend))
            place -= float(0.5 * rise / bend * 0.5 * (places[i + 1] - places[i - 1]))
    return Peak(sign * value, place)


def _list_assembled_stretches(
    scene: Scene,
    fine: Solution,
) -> list[tuple[float | None, float | None]]:
    """List where the linkage assembles within a sweep.

    The position formula locates the ends.
    """
    closes = fine.assembled
    places = fine.at.places
    if closes.all():
        return []
    if places[0] > places[-1]:  # from the smallest place on
        closes = closes[::-1]
        places = places[::-1]
    if closes[0]:
        ends: list[float | None] = [None]
    else:
        ends = []
    for i in np.flatnonzero(closes[1:] != closes[:-1]):
        low = places[i]
        high = places[i + 1]
        for _ in range(_END_ROUNDS):
            cut_range = np.linspace(low, high, CUTS + 1)
            first = int(
                np.argmax(
                    _solve_at(scene, cut_range, "position").assembled != closes[i]
                )
            )
            low = cut_range[max(first - 1, 0)]
            high = cut_range[first]
        ends.append(float(low if closes[i] else high))
    ends += [None] if closes[-1] else []
    return list(zip(ends[::2], ends[1::2], strict=True))


def _solve_finely(
    scene: Scene,
    places: Array,
) -> tuple[Solution, list[tuple[float | None, float | None]]]:
    """Solve many positions of a sweep in its sense; list the stretches.

    The ends of its stretches are among them.
    """
    fine = _solve_at(
        scene, np.linspace(places[0], places[-1], RANGE_POSITIONS + 1), "position"
    )
    stretches = _list_assembled_stretches(scene, fine)
    ends = [end for stretch in stretches for end in stretch if end is not None]
    return _merge(scene, fine, np.array(ends), "position"), stretches


def _join_stretches(solution: Solution, fine: Solution, bar: int) -> Array:
    """Return the angles of a bar at the fine positions, rad.

    Whole turns are added so that they belong together. The first stretch has the angles
    of the solution. The linkage does not pass from one stretch to the next, so that no
    turn of a later one follows from the first: it has the one with which all stretches
    together cover least.
    """
    angles = np.array(getattr(fine, f"theta_{bar}"))
    if bar == fine.at.bar and fine.at.stroke is None:
        return angles  # as it is commanded
    known = np.flatnonzero(np.isfinite(angles))
    own = getattr(solution, f"theta_{bar}")
    first = int(np.flatnonzero(np.isfinite(own))[0])
    distances = _list_commanded(fine)[known] - _list_commanded(solution)[first]
    nearest = known[np.argmin(np.abs(distances))]
    angles += TURN * np.round((own[first] - angles[nearest]) / TURN)
    low = math.inf
    high = -math.inf
    for stretch in np.split(known, np.flatnonzero(np.diff(known) > 1) + 1):
        start = angles[stretch].min()
        stop = angles[stretch].max()
        if low < high:
            turns = _find_turns(start, stop, low, high)
            angles[stretch] += TURN * turns
            start = start + TURN * turns
            stop = stop + TURN * turns
        low = min(low, start)
        high = max(high, stop)
    return angles


def _find_turns(start: float, stop: float, low: float, high: float) -> int:
    """Return the whole turns by which an interval of angles is moved.

    With them it covers least together with another.
    """
    between = round((0.5 * (low + high) - 0.5 * (start + stop)) / TURN)

    def measure(turns: int) -> tuple[int, int]:
        moved = max(high, stop + TURN * turns) - min(low, start + TURN * turns)
        return round(moved / _AS_WIDE), abs(turns)

    return min((between - 1, between, between + 1), key=measure)


def find_duty(between: Between) -> MotorDuty | None:
    """Return the duty of the drive, each peak located between the positions.

    A peak without a bound is that of the positions.
    """
    duty = motor_duty(between.sweep)
    drive = read_drive_demand(between.sweep)
    if duty is None:
        return None

    def find_largest(name: str, key: str) -> float:
        values = getattr(between.bounded(name), key)
        return float(np.nanmax(np.abs(values)))

    peak = find_largest(drive.keys.value, drive.keys.value)
    linear = between.sweep.drive is not None
    return duty._replace(
        peak_torque=None if linear else peak,
        peak_force=peak if linear else None,
        peak_speed=find_largest("speed", drive.speed_key),
        peak_power=find_largest("power", "power"),
    )


def _find_held(solution: Solution, drive: Driving) -> tuple[float, float] | None:
    low, high = (getattr(solution, name) for name in (drive.keys.low, drive.keys.high))
    if (
        low is None
        or not (held := np.isfinite(low) & np.isfinite(high) & (low < high)).any()
    ):
        return None
    return float(low[held].min()), float(high[held].max())


def _find_peak(solution: Solution, values: Array | None) -> Peak:
    """Find the value of largest magnitude, and its place."""
    assert values is not None
    worst = int(np.nanargmax(np.abs(values)))
    return Peak(float(values[worst]), float(_list_commanded(solution)[worst]))


def _list_pin_loads(solution: Solution, between: Between) -> dict[str, _PinLoad]:
    if solution.F12 is None or not np.isfinite(solution.F12).any():
        return {}
    loads = dict[str, _PinLoad]()
    for pin, name in PIN_FORCE.items():
        bounded = between.bounded(name)
        size = np.hypot(*getattr(bounded, name).T)
        peak = _find_peak(bounded, np.where(np.isfinite(size), size, np.nan))
        loads[pin] = _PinLoad(peak, bearing_load(solution, pin).rms)
    return loads


def _find_stroke_limits(scene: Scene, solution: Solution) -> tuple[float, float]:
    """Find the least and the greatest stroke of the commanded bar's angles.

    The angles are all that it reaches on its branch.
    """
    positions = solution.at
    first = int(np.argmax(solution.assembled))
    here = float(positions.angle[first])
    intervals = find_intervals(scene.linkage, positions.bar)
    low, high = min(
        intervals,
        key=lambda ends: (here - ends[0]) % TURN - (ends[1] - ends[0]),
    )
    width = high - low
    low = here - ((here - low) % TURN if width < TURN else 0.5 * TURN)
    angles = np.linspace(
        low + _INSET * width, low + (1.0 - _INSET) * width, RANGE_POSITIONS + 1
    )
    motion = Motion(
        **{f"theta_{positions.bar}": angles},  # type: ignore[arg-type]
        branch=int(positions.branch[first]),
    )
    stroke = solve(replace(scene, motion=motion, tolerances=()), "position").stroke
    assert stroke is not None
    if positions.stroke is not None:  # its side ends where the stroke turns back
        place = int(np.argmin(np.abs(angles - here)))
        steps = np.sign(np.diff(stroke))
        way = steps[min(place, RANGE_POSITIONS - 1)]
        turns = np.flatnonzero(steps != way)
        start = turns[turns < place].max(initial=-1) + 1
        stroke = stroke[start : turns[turns >= place].min(initial=RANGE_POSITIONS) + 1]
    return float(np.nanmin(stroke)), float(np.nanmax(stroke))


def _find_largest_error_bar(solution: Solution, drive: Driving | None) -> float | None:
    """Find the largest error bar over its value.

    Where the value passes through zero, it is over the median.
    """
    if solution.force_error is None:
        return None
    loads = np.max(
        [np.hypot(*getattr(solution, name).T) for name in PIN_FORCE.values()],
        axis=0,
    )
    pairs = [(solution.force_error, loads)]
    if drive is not None and drive.error is not None and drive.values is not None:
        pairs.append((drive.error, np.abs(drive.values)))
    shares = []
    for error, size in pairs:
        solved = np.isfinite(error) & np.isfinite(size) & (solution.status_code == OK)
        usual = np.median(size[solved]) if solved.any() else 0.0
        reference = np.maximum(size, usual)
        # where most are exactly zero, so may be one with an error bar
        solved &= reference > 0.0
        if solved.any():
            shares.append(float((error[solved] / reference[solved]).max()))
    return max(shares, default=None)
