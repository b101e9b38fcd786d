"""Summary of a solved scene: ranges, peaks and their places, drive and ends of motion.

`locate_between` finds what the steps of a sweep pass over: reversals of dry friction,
and the largest torque and pin forces; `locate_bending` the largest bending moments.
`summarize` computes the facts; `fourbar.show.block` prints them.
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
    find_mean_torque,
    is_once_round,
    motor_duty,
    read_drive_demand,
)
from fourbar.show.panels import Panels, fit_panels
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
_LEAST_PANELS = 48
"""Panels that a motion is cut to at least, before they are halved."""
_MOST_EDGES = 200
"""Positions of a sweep that its first panels end at. Of more every second is taken, or
every third, and so on.
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


class HeldRange(NamedTuple):
    """Neighbouring positions at which dry friction holds a pin at rest."""

    low: float
    """Least torque or force of the drive that holds one of them."""
    high: float
    """Greatest torque or force that holds one of them."""
    ends: tuple[float, float]
    """Commanded angle or stroke of the first and the last, rad or m, or the time, s."""


class Sums(NamedTuple):
    """Quantities that are summed over the positions, for want of an integral."""

    names: list[str]
    """Names among torque, power, drive force and pin forces."""
    change: float
    """Largest change of a mean or energy by leaving out every second position, over
    its value. NaN where so few are left that none is known.
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
        """Return the solution that gives the peaks of magnitudes.

        The sweep alone is returned if one of them grows without bound.
        """
        if self.growing.intersection(names):
            return self.sweep
        return self.solution


def list_sizes(solution: Solution) -> dict[str, Array]:
    """Return the magnitudes whose largest values are located, by name, (n,).

    Torque (or force), power and speed of the drive, and pin forces are included.
    """
    drive = read_drive_demand(solution)
    torque = drive.keys.value
    sizes = {
        torque: np.abs(getattr(solution, torque)),
        "power": np.abs(np.asarray(solution.power)),
        "speed": np.abs(getattr(solution, drive.speed_key)),
    }
    forces = _compute_pin_loads(solution)
    largest = np.max([*forces.values()], axis=0)
    # what a balanced linkage leaves of a load is rounding, and has no peak
    rounding = SHOWN_AS_ZERO * largest * _find_lever(solution)
    idle = sizes[torque] <= rounding
    for name in (torque, "power"):
        sizes[name] = np.where(idle, 0.0, sizes[name])
    for name, force in forces.items():
        sizes[name] = drop_rounding(force, largest)
    return sizes


def _compute_pin_loads(solution: Solution) -> dict[str, Array]:
    """Compute the magnitudes of the pin forces, N, by name.

    What a cylinder leaves of the load that it holds end to end is rounding, and zero.
    """
    loads = {}
    held = 0.0 if solution.drive_force is None else np.abs(solution.drive_force)
    for name in PIN_FORCES:
        force = getattr(solution, name)
        loads[name] = drop_rounding(np.hypot(force[:, 0], force[:, 1]), held)
    return loads


def find_drive_rounding(solution: Solution) -> float:
    """Return the rounding of the torques (forces) that the drive sums, N m or N.

    Inertial forces and usual pin forces are taken at the longest bar. At a change point
    an error bar is less, and where springs balance weights, as far as their numbers are
    rounded.
    """
    assert solution.scene is not None
    inertial = 0.0
    for number, bar in zip(MOVING_BARS, solution.scene.linkage.moving, strict=True):
        a_G = getattr(solution, f"a_G{number}")
        accelerations = np.hypot(a_G[:, 0], a_G[:, 1])
        inertial += bar.mass * float(np.nanmax(accelerations, initial=0.0))
    usual = 0.0
    for load in _compute_pin_loads(solution).values():
        if np.isfinite(load).any():
            usual = max(usual, float(np.nanmedian(load)))
    return SHOWN_AS_ZERO * max(inertial, usual) * _find_lever(solution)


def _find_lever(solution: Solution) -> float:
    """Return the arm at which pin forces load the drive: the longest bar, m.

    A drive that exerts a force itself has the arm 1.
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
    pins, low, high = _locate_reversals(scene, solution)
    merged = _merge(scene, solution, np.concatenate([low, high]))
    if scene.motion.law is None:
        angles = low
    else:
        angles, *_ = scene.motion.law.at(low)
    reversals = sorted(zip(angles.tolist(), pins, strict=True))
    peaks, growing = _find_peaks(scene, merged, list_sizes)
    return Between(solution, _merge(scene, merged, peaks), reversals, growing)


def fit_motion(scene: Scene, between: Between) -> Panels | None:
    """Fit panels to drive, power and pin forces over a sweep or motion law.

    Curves that grow without bound have no integral, and are left out. None is returned
    where the linkage does not assemble throughout, or nothing stands between the
    positions.
    """
    sweep = between.sweep
    if not _has_between(scene, sweep) or not sweep.assembled.all():
        return None
    drive = read_drive_demand(sweep)
    rounding = find_drive_rounding(sweep)
    speed = float(np.nanmax(np.abs(getattr(sweep, drive.speed_key)), initial=0.0))
    loads = _compute_pin_loads(sweep)
    largest = max(float(np.nanmax(load, initial=0.0)) for load in loads.values())
    roundings = {drive.keys.value: rounding, "power": rounding * speed}
    for name in PIN_FORCES:
        roundings[name] = SHOWN_AS_ZERO * largest
    bounded = [name for name in roundings if name not in between.growing]

    def compute(places: Array) -> dict[str, Array]:
        there = _solve_at(scene, places)
        return {name: np.asarray(getattr(there, name)) for name in bounded}

    return fit_panels(compute, _list_edges(scene, between), roundings)


def _list_edges(scene: Scene, between: Between) -> Array:
    """List where the first panels of a motion end, in rising order.

    Edges are positions of the sweep and places found between them, where friction may
    reverse, and the times at which one part of a law follows on another.
    """
    places = between.sweep.at.places
    found = np.setdiff1d(between.solution.at.places, places)
    every = -(-len(places) // _MOST_EDGES)
    law = scene.motion.law
    return np.unique(
        np.concatenate(
            [
                np.linspace(places[0], places[-1], _LEAST_PANELS + 1),
                places[::every],
                found,
                [] if law is None else law.time,
            ]
        )
    )


def _locate_reversals(
    scene: Scene,
    solution: Solution,
) -> tuple[list[str], Array, Array]:
    """Locate where the slip of a pin with dry friction changes sign.

    The pin of each reversal and the places just before and after it are returned.
    """
    pins, low, high = _find_reversing(scene, solution)
    if not pins:
        return pins, low, high
    rows = np.arange(len(pins))
    for _ in range(LOCATING_ROUNDS):
        places = _cut_range(low, high)
        inside = _solve_at(scene, places.ravel(), "velocity")
        slips = np.empty(places.shape)
        for row, pin in enumerate(pins):
            slips[row] = _slip_of_pin(inside, pin).reshape(places.shape)[row]
        turned = np.argmax(slips * slips[:, :1] <= 0.0, axis=1)
        low = places[rows, turned - 1]
        high = places[rows, turned]
    return pins, low, high


def locate_bending(scene: Scene, between: Between) -> dict[int, _BarBending]:
    """Locate the largest bending moment of each bar, between the positions too.

    Only `analyze` and its figure need it. Empty where no position has forces.
    """
    solution = between.bounded(*between.growing)
    if solution.F12 is None or not np.isfinite(solution.F12).any():
        return {}

    def list_moments(solution: Solution) -> dict[str, Array]:
        bending = _compute_bending(scene, solution)
        return {str(bar): np.abs(largest.moment) for bar, largest in bending.items()}

    growing = {str(bar) for bar in MOVING_BARS}
    searched = [solution]
    if _has_between(scene, solution):
        places, growing = _find_peaks(
            scene,
            solution,
            list_moments,
            _BENDING_PEAKS,
            _BENDING_ROUNDS,
        )
        if len(places):
            searched.append(_solve_at(scene, places))
    located = dict[int, _BarBending]()
    for index, one in enumerate(searched):
        for bar, largest in _compute_bending(scene, one).items():
            grows = str(bar) in growing
            if grows and index > 0:
                continue  # the peak of another bar may stand beside a pole
            moment = np.abs(largest.moment)
            peak = _find_peak(one, moment)
            if bar not in located or peak.value > located[bar].peak.value:
                row = int(np.argmax(np.nan_to_num(moment, nan=-1.0)))
                x = float(largest.x[row])
                located[bar] = _BarBending(peak, x, one, row, grows)
    return located


def _compute_bending(scene: Scene, solution: Solution) -> dict[int, Bending]:
    """Compute the largest bending moment of each bar at each position."""
    forces = [*_compute_pin_loads(solution).values()]
    if solution.drive_force is not None:
        forces.append(np.abs(solution.drive_force))
    size = max(scene.linkage.lengths) * np.max(forces, axis=0)
    round_off = _NO_BENDING * size
    bending = {}
    for bar in MOVING_BARS:
        largest = internal_forces(scene, solution, bar, np.zeros(1)).largest
        # a two-force bar has none
        is_round_off = np.abs(largest.moment) <= round_off
        moment = np.where(is_round_off, 0.0, largest.moment)
        bending[bar] = largest._replace(moment=moment)
    return bending


def _list_stresses(
    scene: Scene,
    bending: dict[int, _BarBending],
) -> dict[int, float | None]:
    """Return the largest bending stress of each bar, Pa; None without a cross-section.

    The stress is the bending moment over the section modulus.
    """
    stresses = dict[int, float | None]()
    for bar, largest in bending.items():
        modulus = scene.linkage.bar(bar).section_modulus
        stresses[bar] = None if modulus is None else largest.peak.value / modulus
    return stresses


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
    width = high - low
    shares = np.linspace(0.0, 1.0, CUTS + 1)
    return low[:, None] + width[:, None] * shares


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
    _, order = np.unique(merged, return_index=True)
    if merged[0] > merged[1]:
        order = order[::-1]
    return _solve_at(scene, merged[order], stage)


def _slip_of_pin(solution: Solution, pin: str) -> Array:
    """Compute omega_j - omega_i of the bars that meet at a pin."""
    first, second = PINS[pin]
    omega_i = 0.0 if first == 1 else getattr(solution, f"omega_{first}")
    omega_j = 0.0 if second == 1 else getattr(solution, f"omega_{second}")
    return np.asarray(omega_j - omega_i)


def _find_reversing(scene: Scene, solution: Solution) -> tuple[list[str], Array, Array]:
    """List the steps in which the slip of a pin with dry friction changes sign.

    Pins and both ends of their steps are returned. The ends are one position where a
    turn begins and ends.
    """
    dry_pins = {pin for effect in scene.effects for pin in effect.dry_pins}
    pins = []
    first = []
    last = []
    for pin in sorted(dry_pins):
        slip = np.nan_to_num(_slip_of_pin(solution, pin))
        size = np.abs(slip)
        moving = np.flatnonzero(size > SLIP_AT_REST * size.max())
        for i, j in pairwise(moving.tolist()):
            if slip[i] * slip[j] < 0.0 and solution.assembled[i:j].all():
                pins.append(pin)
                first.append(i)
                last.append(j)
        # what lies at both ends of a turn is passed like any other position
        repeats = is_once_round(solution) and solution.assembled.all()
        if repeats and len(moving) and slip[moving[-1]] * slip[moving[0]] < 0.0:
            pins.append(pin)
            first.append(0)
            last.append(0)
    places = solution.at.places
    return pins, places[np.array(first, dtype=int)], places[np.array(last, dtype=int)]


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
    present = sizes(solution)
    searches = _list_searches(scene, solution, present, most)
    if not searches:
        return np.zeros(0), set()
    names, *columns = zip(*searches, strict=True)
    top, start, stop, inward = map(np.array, columns)
    assembled = solution.assembled
    opens = inward | ~(assembled[start] & assembled[stop])
    begins = assembled[start] & ~(inward & (top == stop))
    places = solution.at.places
    low = places[start]
    high = places[stop]
    peak_places = places[top]
    reached = [np.array([present[one.name][one.top] for one in searches])]
    growing = np.zeros(len(searches), dtype=bool)
    rows = np.arange(len(searches))
    outer_end = np.where(begins, 0, CUTS)
    steps_inward = np.abs(np.arange(CUTS + 1) - outer_end[:, None])
    for count in range(LOCATING_ROUNDS):
        if count >= rounds and not growing.any():
            break
        cut_range = _cut_range(low, high)
        inside = sizes(_solve_at(scene, cut_range.ravel()))
        values = np.empty(cut_range.shape)
        for row, name in enumerate(names):
            values[row] = inside[name].reshape(cut_range.shape)[row]
        values = np.nan_to_num(values, nan=-1.0)
        # beside a gap the last value before it, otherwise the largest
        exists = opens[:, None] & (values >= 0.0)
        best = np.argmax(np.where(exists, steps_inward, values), axis=1)
        peak_places = cut_range[rows, best]
        low = cut_range[rows, np.maximum(best - 1, 0)]
        high = cut_range[rows, np.minimum(best + 1, CUTS)]
        reached.append(values[rows, best])
        if count + 1 >= rounds:
            growing = _find_growing(reached, values, best)
    # beside a gap other magnitudes grow
    kept = ~growing & (reached[-1] > reached[0]) & ~opens
    growing_names = {names[row] for row in np.flatnonzero(growing)}
    return peak_places[kept], growing_names


def _list_searches(
    scene: Scene,
    solution: Solution,
    sizes: dict[str, Array],
    most: int,
) -> list[_Search]:
    """List the steps in which a magnitude may have a maximum or a pole."""
    assembled = solution.assembled
    passed = _find_dead_points(scene, solution) + _find_change_points(solution)
    searches = []
    for name, size in sizes.items():
        values = np.nan_to_num(size, nan=-1.0, posinf=-1.0)
        searches += _list_tops(name, values, most)
        for step in passed:
            rises = bool(values[step] < values[step + 1])
            searches.append(_Search(name, step + rises, step, step + 1))
        # towards a gap a magnitude may grow without a local maximum
        for step in _list_sign_changes(values):
            following = step + 1
            top = step if values[following] < 0.0 else following
            beside = _Search(name, top, step, following)
            searches.append(beside)
            if assembled[step] and assembled[following]:
                searches.append(beside._replace(inward=True))
    return searches


def _list_tops(name: str, values: Array, most: int) -> list[_Search]:
    """List searches around the highest local maxima; values below 0 are missing."""
    padded = np.concatenate([[-1.0], values, [-1.0]])
    before = padded[:-2]
    after = padded[2:]
    is_highest = (values >= before) & (values >= after)
    stands_out = values > np.minimum(before, after)
    tops = np.flatnonzero(is_highest & stands_out & (values > 0.0))
    falling = np.argsort(-values[tops], kind="stable")
    searches = []
    for i in tops[falling][:most]:
        start = i - (before[i] >= 0.0)
        stop = i + (after[i] >= 0.0)
        searches.append(_Search(name, i, start, stop))
    return searches


def _find_change_points(solution: Solution) -> list[int]:
    """List the steps within which the linkage passes a change point."""
    # on a change point itself the sine is rounding
    between = solution.status_code != CHANGE_POINT
    sine = np.where(between, np.nan_to_num(solution.sin_mu), 0.0)
    return _list_sign_changes(sine)


def _list_sign_changes(values: Array) -> list[int]:
    steps: list[int] = np.flatnonzero(values[:-1] * values[1:] < 0.0).tolist()
    return steps


def _find_dead_points(scene: Scene, solution: Solution) -> list[int]:
    """List the steps within which the drive stands still and the linkage moves.

    Forces have a pole there. Its two ends need not be maxima of the positions.
    """
    at = solution.at
    drives_commanded_bar = scene.drive is None and scene.drive_bar == at.bar
    if at.stroke is not None or drives_commanded_bar:
        return []
    one = np.ones(len(solution))
    at_unit_speed = at._replace(speed=one, acceleration=0.0 * one)
    moving = solve(scene, "velocity", at=at_unit_speed)
    speed = getattr(moving, read_drive_demand(moving).speed_key)
    return _list_sign_changes(np.nan_to_num(speed))


def _find_growing(
    reached: list[Array],
    values: Array,
    best: NDArray[np.intp],
) -> NDArray[np.bool_]:
    """Mark the searches for a maximum that end beside a pole.

    Towards a pole the values of the last calls rise. A call may hit the pole to within
    rounding, after which nothing rises; the value then stands out from both beside it,
    and these from the next. Where dry friction reverses the forces jump, and a position
    at which the pin rests has one value more, but beside it they are level.

    Parameters
    ----------
    reached : largest value of each search after each call, (k,) each.
    values : values of the last call, (k, CUTS + 1).
    best : index of the largest of them, (k,).
    """
    rises: NDArray[np.bool_] = reached[-1] > (1.0 + GROWING) * reached[-3]
    padded = np.pad(values, ((0, 0), (2, 2)), constant_values=-1.0)
    rows = np.arange(len(best))
    next_but_one, before, here, after, last = (
        padded[rows, best + step] for step in range(5)
    )
    stands_out = here > (1.0 + GROWING) * np.maximum(before, after)
    steep = (next_but_one >= 0.0) & (before > (1.0 + GROWING) * next_but_one)
    steep |= (last >= 0.0) & (after > (1.0 + GROWING) * last)
    return rises | (stands_out & steep)


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
    held: list[HeldRange]
    """Where dry friction holds a pin at rest, in the order of the positions."""
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
    sums: Sums | None
    """None: the means and energies do not depend on the positions, or these are a list.
    """
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
    panels = fit_motion(scene, between)
    kind = _find_kind(scene, solution)
    places = _list_commanded(solution)
    smooth = kind in ("sweep", "turn", "law")
    if smooth:
        fine, stretches = _solve_finely(scene, places)
    else:
        fine = solution
        stretches = []
    if stretches and kind == "turn":
        kind = "sweep"

    def find_range(values: Array) -> tuple[Peak, Peak]:
        commanded = _list_commanded(fine)
        low = _find_extreme(-1 * values, commanded, -1, smooth)
        high = _find_extreme(1 * values, commanded, 1, smooth)
        return low, high

    angles = {}
    for bar in MOVING_BARS:
        angles[bar] = find_range(_join_stretches(solution, fine, bar))
    stroke_range = None
    if fine.stroke is not None:
        stroke_range = find_range(fine.stroke)
    stroke_limits = None
    if solution.stroke is not None:
        stroke_limits = _find_stroke_limits(scene, solution)
    released = scene.motion.free is not None
    drive = None
    if not released and solution.F12 is not None:
        drive = read_drive_demand(solution)
    peak = _find_drive_peak(between, drive)
    duty = None
    if peak is not None and kind != "position":
        duty = find_duty(scene, between, panels)
    bending = locate_bending(scene, between)
    return Facts(
        scene=scene,
        solution=solution,
        kind=kind,
        counts=_count_statuses(solution),
        commanded=(float(places[0]), float(places[-1])),
        angles=angles,
        transmission=_find_transmission(find_range(np.square(fine.sin_mu))[0]),
        stretches=stretches,
        drive=None if peak is None else drive,
        peak=peak,
        duty=duty,
        held=[] if drive is None else _list_held(solution, drive, kind),
        pins=_list_pin_loads(solution, between, panels),
        rates=_find_rates(solution, smooth=smooth),
        bending=bending,
        stresses=_list_stresses(scene, bending),
        stroke_range=stroke_range,
        stroke_limits=stroke_limits,
        between=between,
        sums=_find_sums(scene, solution, panels, kind),
        error=_find_largest_error_bar(solution, drive),
    )


def _count_statuses(solution: Solution) -> dict[str, int]:
    counts = {}
    codes, numbers = np.unique(solution.status_code, return_counts=True)
    for code, number in zip(codes, numbers, strict=True):
        counts[STATUS_NAMES[code]] = int(number)
    return counts


def _find_transmission(least: Peak) -> Peak:
    """Return the smallest transmission angle from the least sin(mu)^2."""
    square = min(1.0, max(least.value, 0.0))
    mu = math.asin(math.sqrt(square))
    if mu <= ZERO_TRANSMISSION_ANGLE:
        mu = 0.0
    return Peak(mu, least.place)


def _find_drive_peak(between: Between, drive: Driving | None) -> Peak | None:
    """Find the largest torque or force of the drive; None without a finite one."""
    if drive is None or drive.values is None or not np.isfinite(drive.values).any():
        return None
    located = between.bounded(drive.keys.value)
    return _find_peak(located, read_drive_demand(located).values)


def _find_rates(solution: Solution, *, smooth: bool) -> dict[int, tuple[Peak, Peak]]:
    """Find the largest speed and acceleration of the bars that follow the command."""
    rates = dict[int, tuple[Peak, Peak]]()
    if solution.omega_4 is None or len(solution) == 1:
        return rates
    places = _list_commanded(solution)
    is_over_time = solution.time is not None
    for bar in MOVING_BARS:
        if bar == solution.at.bar and not is_over_time:
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
    """Return the commanded angle or stroke, or the time, at each position."""
    if solution.time is None:
        return solution.at.places
    return solution.time


def _find_extreme(values: Array, places: Array, sign: int, smooth: bool) -> Peak:
    """Find the largest of signed values.

    On a smooth curve the top of the parabola through this value and its neighbours is
    taken.
    """
    i = int(np.nanargmax(values))
    value = float(values[i])
    place = float(places[i])
    if smooth and 0 < i < len(values) - 1:
        beside = slice(i - 1, i + 2)
        first_step, second_step = np.diff(places[beside])
        even = np.isclose(first_step, second_step)
        if even and np.isfinite(values[beside]).all():
            rise = values[i + 1] - values[i - 1]
            bend = values[i + 1] - 2.0 * values[i] + values[i - 1]
            width = places[i + 1] - places[i - 1]
            if bend < 0.0:
                value -= float(rise * rise / (8.0 * bend))
                place -= float(0.5 * rise / bend * 0.5 * width)
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
    ends = list[float | None]()
    if closes[0]:
        ends.append(None)
    for i in np.flatnonzero(closes[1:] != closes[:-1]):
        low = places[i]
        high = places[i + 1]
        for _ in range(_END_ROUNDS):
            cut_range = np.linspace(low, high, CUTS + 1)
            assembled = _solve_at(scene, cut_range, "position").assembled
            first = int(np.argmax(assembled != closes[i]))
            low = cut_range[max(first - 1, 0)]
            high = cut_range[first]
        ends.append(float(low if closes[i] else high))
    if closes[-1]:
        ends.append(None)
    return list(zip(ends[::2], ends[1::2], strict=True))


def _solve_finely(
    scene: Scene,
    places: Array,
) -> tuple[Solution, list[tuple[float | None, float | None]]]:
    """Solve many positions of a sweep in its sense; list the stretches.

    The ends of its stretches are among them.
    """
    fine_places = np.linspace(places[0], places[-1], RANGE_POSITIONS + 1)
    fine = _solve_at(scene, fine_places, "position")
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
    finite = np.flatnonzero(np.isfinite(angles))
    coarse = getattr(solution, f"theta_{bar}")
    first = int(np.flatnonzero(np.isfinite(coarse))[0])
    distances = _list_commanded(fine)[finite] - _list_commanded(solution)[first]
    nearest = finite[np.argmin(np.abs(distances))]
    angles += TURN * np.round((coarse[first] - angles[nearest]) / TURN)
    low = math.inf
    high = -math.inf
    gaps = np.flatnonzero(np.diff(finite) > 1)
    for stretch in np.split(finite, gaps + 1):
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
    """Return the whole turns that bring an interval of angles closest to another.

    Both intervals together then cover the least range.
    """
    distance = 0.5 * (low + high) - 0.5 * (start + stop)
    nearest = round(distance / TURN)

    def measure(turns: int) -> tuple[int, int]:
        top = max(high, stop + TURN * turns)
        bottom = min(low, start + TURN * turns)
        width = top - bottom
        return round(width / _AS_WIDE), abs(turns)

    return min((nearest - 1, nearest, nearest + 1), key=measure)


def find_duty(
    scene: Scene,
    between: Between,
    panels: Panels | None,
) -> MotorDuty | None:
    """Return the duty of the drive over the motion, whatever its steps.

    Peaks are located between the positions; one without a bound is that of the
    positions. Means and energies are integrals over the panels, or sums over the
    positions where there are no panels.
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
    duty = duty._replace(
        peak_torque=None if linear else peak,
        peak_force=peak if linear else None,
        peak_speed=find_largest("speed", drive.speed_key),
        peak_power=find_largest("power", "power"),
    )
    if panels is None:
        return duty
    if drive.keys.value in panels.values:
        rms = math.sqrt(panels.find_mean_square(drive.keys.value))
        duty = duty._replace(
            rms_torque=None if linear else rms,
            rms_force=rms if linear else None,
        )
    if "power" in panels.values:
        rms_power = math.sqrt(panels.find_mean_square("power"))
        duty = duty._replace(rms_power=rms_power)
        if duty.energy_in is not None:
            duty = _integrate_energies(scene, between.sweep, panels, duty)
    return duty


def _integrate_energies(
    scene: Scene,
    sweep: Solution,
    panels: Panels,
    duty: MotorDuty,
) -> MotorDuty:
    """Integrate the power over time, from each of its zeros to the next.

    The swing of the energy of a closed motion goes between zeros of the power less its
    mean.
    """
    if scene.motion.law is not None:
        second = 1.0  # a law is integrated over its time
    else:
        assert scene.motion.speed is not None
        second = abs(float(scene.motion.speed))
    work = np.diff(panels.accumulate("power")) / second
    duty = duty._replace(
        energy_in=float(work[work > 0.0].sum()),
        energy_out=float(-work[work < 0.0].sum()),
    )
    if duty.energy_swing is None:
        return duty
    length = float(panels.high[-1] - panels.low[0])
    mean_power = panels.integrate("power") / length
    swing = float(np.ptp(panels.accumulate("power", mean_power))) / second
    mean_torque = duty.mean_torque
    if mean_torque is not None:
        mean_torque = find_mean_torque(sweep, mean_power * length / second)
    return duty._replace(energy_swing=swing, mean_torque=mean_torque)


def _list_held(solution: Solution, drive: Driving, kind: str) -> list[HeldRange]:
    """List where dry friction holds a pin at rest.

    A turn that begins at such a position ends at the same, which is listed once.
    """
    low, high = (getattr(solution, name) for name in (drive.keys.low, drive.keys.high))
    if low is None:
        return []
    places = _list_commanded(solution)
    rows = np.flatnonzero(np.isfinite(low) & np.isfinite(high) & (low < high))
    ranges = list[HeldRange]()
    for run in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1):
        if len(run) == 0:
            continue
        if kind == "turn" and ranges and run[0] == len(solution) - 1 and rows[0] == 0:
            continue
        ends = float(places[run[0]]), float(places[run[-1]])
        ranges.append(HeldRange(float(low[run].min()), float(high[run].max()), ends))
    return ranges


def _find_peak(solution: Solution, values: Array | None) -> Peak:
    """Find the value of largest magnitude, and its place."""
    assert values is not None
    worst = int(np.nanargmax(np.abs(values)))
    place = _list_commanded(solution)[worst]
    return Peak(float(values[worst]), float(place))


def find_pin_rms(solution: Solution, panels: Panels | None, pin: str) -> float:
    """Return the RMS load of a pin over the motion, N.

    Without panels it is that of the positions.
    """
    name = PIN_FORCE[pin]
    if panels is not None and name in panels.values:
        return math.sqrt(panels.find_mean_square(name))
    return bearing_load(solution, pin).rms


def _list_pin_loads(
    solution: Solution,
    between: Between,
    panels: Panels | None,
) -> dict[str, _PinLoad]:
    if solution.F12 is None or not np.isfinite(solution.F12).any():
        return {}
    loads = dict[str, _PinLoad]()
    for pin, name in PIN_FORCE.items():
        bounded = between.bounded(name)
        size = _compute_pin_loads(bounded)[name]
        peak = _find_peak(bounded, np.where(np.isfinite(size), size, np.nan))
        loads[pin] = _PinLoad(peak, find_pin_rms(solution, panels, pin))
    return loads


def _find_sums(
    scene: Scene,
    solution: Solution,
    panels: Panels | None,
    kind: str,
) -> Sums | None:
    """Find the means and energies that are sums, and what half the positions change."""
    if kind in ("position", "list") or solution.F12 is None:
        return None
    names = [*PIN_FORCES]
    if kind != "released":
        names += [read_drive_demand(solution).keys.value, "power"]
    if panels is not None:
        names = [name for name in names if name not in panels.values]
    if not names:
        return None
    positions = len(solution)
    kept = np.unique([*range(0, positions, 2), positions - 1])
    if len(kept) == positions:
        return Sums(names, math.nan)
    half = solve(scene, "force", at=solution.at.part(kept))
    changes = [0.0]
    sums = [_list_sums(one, names) for one in (solution, half)]
    for all_positions, half_of_them in zip(*sums, strict=True):
        size = np.max(np.abs(all_positions))
        if size > 0.0:
            change = np.max(np.abs(half_of_them - all_positions)) / size
            changes.append(float(change))
    return Sums(names, max(changes))


def _list_sums(solution: Solution, names: list[str]) -> list[Array]:
    """List means and energies over the positions, those of one kind together."""
    pins = [
        bearing_load(solution, pin).rms
        for pin, name in PIN_FORCE.items()
        if name in names
    ]
    sums = [np.array(pins or [0.0])]
    duty = None if names == [*PIN_FORCES] else motor_duty(solution)
    if duty is None:
        return sums
    rms = duty.rms_torque if solution.drive is None else duty.rms_force
    if read_drive_demand(solution).keys.value in names:
        sums.append(np.array([rms]))
    if "power" in names:
        sums.append(np.array([duty.rms_power]))
        sums.append(np.array([duty.energy_in or 0.0, duty.energy_out or 0.0]))
    return sums


def _find_stroke_limits(scene: Scene, solution: Solution) -> tuple[float, float]:
    """Find the least and the greatest stroke over all angles of the commanded bar.

    The angles are those that the bar reaches on its branch.
    """
    at = solution.at
    first = int(np.argmax(solution.assembled))
    here = float(at.angle[first])

    def find_excess(interval: tuple[float, float]) -> float:
        start, stop = interval
        return (here - start) % TURN - (stop - start)

    low, high = min(find_intervals(scene.linkage, at.bar), key=find_excess)
    width = high - low
    if width < TURN:
        low = here - (here - low) % TURN
    else:
        low = here - 0.5 * TURN
    inner_low = low + _INSET * width
    inner_high = low + (1.0 - _INSET) * width
    angles = np.linspace(inner_low, inner_high, RANGE_POSITIONS + 1)

    def compute_stroke(angles: Array) -> Array:
        motion = Motion(
            **{f"theta_{at.bar}": angles},  # type: ignore[arg-type]
            branch=int(at.branch[first]),
        )
        moved = replace(scene, motion=motion, tolerances=())
        stroke = solve(moved, "position").stroke
        assert stroke is not None
        return stroke

    stroke = compute_stroke(angles)
    if at.stroke is not None:  # its side ends where the stroke turns back
        place = int(np.argmin(np.abs(angles - here)))
        senses = np.sign(np.diff(stroke))
        sense = senses[min(place, RANGE_POSITIONS - 1)]
        turns = np.flatnonzero(senses != sense)
        start = turns[turns < place].max(initial=-1) + 1
        stop = turns[turns >= place].min(initial=RANGE_POSITIONS) + 1
        angles = angles[start:stop]
        stroke = stroke[start:stop]

    def find_limit(sign: float) -> float:
        """Cut the steps around the least of sign * stroke until it is located."""
        cut_range = angles
        strokes = stroke
        for _ in range(_END_ROUNDS):
            best = int(np.nanargmin(sign * strokes))
            start = cut_range[max(best - 1, 0)]
            stop = cut_range[min(best + 1, len(cut_range) - 1)]
            cut_range = np.linspace(start, stop, CUTS + 1)
            strokes = compute_stroke(cut_range)
        return sign * float(np.nanmin(sign * strokes))

    least = find_limit(1.0)
    most = find_limit(-1.0)
    # a cylinder whose ends meet has the rounding of their places
    return float(drop_rounding(np.array(least), most)), most


def _find_largest_error_bar(solution: Solution, drive: Driving | None) -> float | None:
    """Find the largest error bar over its value.

    Where the value passes through zero, it is over the median.
    """
    if solution.force_error is None:
        return None
    loads = _compute_pin_loads(solution)
    pairs = [(solution.force_error, np.max([*loads.values()], axis=0))]
    if drive is not None and drive.error is not None and drive.values is not None:
        pairs.append((drive.error, np.abs(drive.values)))
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
