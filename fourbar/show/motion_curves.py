"""Curves of a scene over its whole motion: what peaks, ranges and means are taken from.

A sweep or a motion law is described by polynomials on panels, whatever its steps. The
panels end where effects say that forces jump or bend, and where one part of a law
follows on another. Between listed positions nothing is searched, and between the
instants of a released motion only where its angles are largest or smallest.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fourbar.evaluation.case import POSITIONS_OF_A_BLOCK, compute_shown_state
from fourbar.formulas.mobility import TURN, find_circuit_where
from fourbar.linkage import MOVING_BARS, PIN_FORCE, PINS
from fourbar.quantities import NO_LEVER, NO_TORQUE, RATES, Array
from fourbar.scene import ReleaseOrigin, Scene, command_at
from fourbar.show.driving import (
    begin_to_move,
    find_senses,
    is_once_round,
    lacks_friction,
    read_drive_demand,
)
from fourbar.show.panels import (
    DEEP,
    SHALLOW,
    Curves,
    PanelCurve,
    Panels,
    Peak,
    Wanted,
    fit_panels,
    split_runs,
)
from fourbar.show.shown_units import SHOWN_AS_ZERO, drop_rounding
from fourbar.solution import Solution, where_assembled
from fourbar.solving import solve, split
from fourbar.studies.course import Stretch, list_stretches
from fourbar.studies.internal_forces import Bending, largest_bending

_PANELS_OF_A_TURN, _MOST_FIRST_PANELS = 48, 960
"""Panels that a motion is cut to before they are halved, for each turn of what is
commanded.
"""
_SAME_EDGE = 1e-9
"""Part of the motion within which two ends of panels are one."""
_BESIDE_A_POLE = 1e-4
"""Distance from a listed position without a lever at which its forces are compared with
those at a quarter of it, rad. Positions have some 12 digits there.
"""
_Named = list[tuple[float, str]]
"""Places with the name of what happens there."""
_BESIDE_A_BREAK = 1e-6
"""Part of the motion from a break to where its sides are shown. A law that comes to
rest by a square still moves there.
"""
_NO_BENDING = 1e-13
"""Bending moment that is round-off, over the pin forces times the longest bar."""
_HALF_A_TURN = 1e-6
"""Part by which half a turn between two ranges of angles may be more, and is no turn.
An end in its last digits leaves some 1e-8.
"""


@dataclass
class MotionCurves:
    """Curves of a solved scene over its motion."""

    scene: Scene
    solution: Solution
    """Solution from which the motion is known."""
    positions: Panels
    """Angles, "sin_mu" and "stroke", by name."""
    panels: Panels
    """Torque or force of the drive, "power", its "speed", pin forces and largest
    bending moments; where nothing acts, speeds and accelerations of the bars.
    """
    reversals: list[tuple[float, str]]
    """Place, and the pin at which dry friction reverses, in the order of the motion.
    Torque or pin forces jump there.
    """
    rests: list[tuple[float, str]]
    """Place, and the pin with dry friction that stops or starts there, likewise."""
    breaks: Array
    """Places at which forces jump or bend: those of effects, and the times of a law."""

    def solve_at(self, places: Array, stage: str = "force") -> Solution:
        """Solve at commanded angles or strokes, or at the times of a motion law."""
        return solve(self.scene, stage, at=command_at(self.scene, places))

    def list_jumps(self, symbol: str, write: Callable[[float], str]) -> Iterator[str]:
        """Say where dry friction makes forces jump, places as `write` has them."""
        for cause, jumps in (
            ("dry friction reverses", self.reversals),
            ("pins with dry friction stop or start", self.rests),
        ):
            pins: dict[str, list[str]] = {}
            for place, pin in jumps:
                pins.setdefault(write(place), []).append(pin)
            places = [f"{place} ({', '.join(names)})" for place, names in pins.items()]
            if places:
                at = f"{symbol} = {', '.join(places)}"
                yield f"{cause}, and torque or pin forces jump, at {at}"

    def solve_with_peaks(self) -> Solution:
        """Solve at the positions of the sweep and at what its steps pass over.

        Steps pass over the largest of each magnitude, and over both sides of a jump.
        """
        panels = self.panels
        if not panels.located or self.solution.F12 is None:
            return self.solution
        peaks = map(self.find_peak, panels.curves)
        tops = [peak.place for peak in peaks if math.isfinite(peak.value)]
        away = _BESIDE_A_BREAK * panels.length
        stated = self.solution.at.places
        found = np.concatenate([tops, self.breaks - away, self.breaks + away])
        places = np.union1d(stated, np.clip(found, stated.min(), stated.max()))
        if panels.start[0] > panels.stop[-1]:
            places = places[::-1]
        return self.solve_at(places)

    @cached_property
    def begun(self) -> "list[MotionCurves]":
        """Curves of the ways in which whatever dry friction holds begins to move.

        An acceleration says which way. Along a law, where friction at rest is a limit
        of what stands beside it, and where nothing is held, they are these curves.
        """
        solution = self.solution
        held = lacks_friction(solution) & (solution.at.speed == 0.0)
        moves = solution.time is not None and np.any(solution.at.speed)
        if moves or not held.any():
            return [self]
        senses = find_senses(solution)
        if senses[0, held].all():
            return self.started
        return [
            self._begin(np.where(of_each == 0.0, sense, of_each))
            for sense, of_each in zip((1.0, -1.0), senses, strict=True)
        ]

    @cached_property
    def started(self) -> "list[MotionCurves]":
        """Curves of the motion where its accelerations start it from rest or stop it.

        The whole of dry friction acts there, of a list that turns back in the one sense
        or the other. Along a law what stands beside an instant at rest has it already,
        but beside a single instant nothing stands.
        """
        solution = self.solution
        senses = find_senses(solution)
        alone = solution.time is None or len(solution) == 1
        if not alone or not senses.any():
            return [self]
        turns_back = np.any(senses[0] != senses[1])
        return list(map(self._begin, senses[: 1 + turns_back]))

    def _begin(self, senses: Array) -> "MotionCurves":
        """Return the curves with a beginning wherever the motion is at rest.

        `senses`: of the speed at each position, (n,); 0: nothing begins there.
        """
        scene = self.scene
        at = self.solution.at
        if self.panels.located and scene.motion.law is None:
            speed = float(begin_to_move(0.0, senses[np.argmax(np.abs(senses))]))
            scene = replace(scene, motion=scene.motion.replace(speed=speed))
            at = command_at(scene, at.places)
        else:
            at = at._replace(speed=begin_to_move(at.speed, senses))
        return describe_motion(solve(scene, at=at))

    @cached_property
    def start(self) -> Peak:
        """Largest torque or force of the drive that starts the motion from rest.

        The value is NaN if nothing starts.
        """
        way = self.started[0]
        if way is self:
            return Peak(math.nan, math.nan)
        if not way.panels.located:
            at = self.solution.at
            starts = find_senses(self.solution)[0] * at.acceleration > 0.0
            way = replace(way, panels=way.panels.leave_out(~starts))
        return way.find_peak(read_drive_demand(self.solution).keys.value)

    @property
    def is_steady(self) -> bool:
        """Return False for a sweep that passes its positions at no one speed."""
        motion = self.scene.motion
        is_over_time = motion.law is not None or motion.free is not None
        return is_over_time or not self.panels.located or motion.acceleration == 0.0

    @property
    def places_of_second(self) -> float | None:
        """What is passed in a second, rad, m or s; None at rest or at no one speed."""
        motion = self.scene.motion
        if motion.law is not None:
            return 1.0
        if not (self.panels.located and self.is_steady):
            return None
        return abs(float(motion.speed or 0.0))

    def find_peak(self, name: str) -> Peak:
        """Find the largest size of a curve.

        The size is infinite, at the first pole, if the curve grows without bound, and
        NaN if it has none.
        """
        if self.panels.has_value(name):
            return self.panels.find_peak(name)
        poles = [*self.panels.list_poles(name), math.nan]
        return Peak(math.inf if poles[1:] else math.nan, poles[0])

    def find_rms(self, name: str) -> float:
        """Return the RMS value of a curve; NaN if it has none."""
        if not self.is_steady or not self.panels.has_value(name):
            return math.nan
        return self.panels.find_rms(name)

    def find_theta_2(self, place: float) -> float:
        """Return theta_2 at a place, rad."""
        solution = self.solution
        if self.panels.located:
            solution = self.solve_at(np.array([place]), "position")
        return float(solution.theta_2[np.argmin(np.abs(solution.at.places - place))])

    @cached_property
    def stretches(self) -> list[Stretch]:
        """Places from and up to which the linkage assembles, in the motion's order.

        None at the ends of the motion; empty if it always assembles.
        """
        positions = self.positions
        if not positions.located:
            return []
        places = positions.list_nodes().ravel()
        assembles = np.isfinite(positions.curves["sin_mu"].values[..., 0]).ravel()
        return [] if assembles.all() else list_stretches(assembles, places)

    @cached_property
    def of_circuits(self) -> list[Panels]:
        """Curves of `positions` in each circuit that the motion passes, in its order.

        The linkage does not move from one to the other.
        """
        numbers = _find_circuits(self.positions, self.scene).max(axis=1)
        passed = dict.fromkeys(numbers[numbers >= 0].tolist())
        others = [numbers == 1 - number for number in passed]
        return list(map(self.positions.leave_out, others))


def find_largest(name: str, ways: Iterable[MotionCurves]) -> float:
    """Find the largest size of a curve in any of several ways of a motion.

    The size is infinite if the curve grows without bound in one of them, and NaN if it
    has no value in one.
    """
    # np.max keeps a NaN, wherever it stands
    return float(np.max([abs(way.find_peak(name).value) for way in ways]))


def describe_motion(solution: Solution) -> MotionCurves:
    """Describe the motion of a solved scene by its curves, which the solution keeps.

    `solution`: of the scene's positions, or of its sweep in rising order.
    """
    kept = vars(solution)
    if "_motion_curves" not in kept:
        kept["_motion_curves"] = _fit_curves(solution)
    curves: MotionCurves = kept["_motion_curves"]
    return curves


def _fit_curves(solution: Solution) -> MotionCurves:
    """Fit the curves of a motion, or take those of its positions."""
    scene = solution.scene
    if not goes_on_between(solution):
        extremes = solution
        if solution.with_extremes is not None:
            extremes = solve(scene, "position", at=solution.with_extremes)
        positions = _take_positions(extremes, _list_position_curves)
        panels = _take_positions(solution, _list_curves)
        _mark_poles(solution, panels)
        return MotionCurves(scene, solution, positions, panels, [], [], np.zeros(0))
    exact, even = _cut(solution)
    zeros, rests = _locate_breaks(solution, _join_edges(exact, even))
    places = [place for place, _ in zeros]
    exact = np.union1d(exact, places)
    breaks = np.unique(places) if scene.motion.law is None else exact
    edges = _join_edges(exact, even)

    def fit(
        list_curves: Callable[[Solution], Curves], stage: str, most_halvings: int
    ) -> Panels:
        """Fit panels to the curves that solutions up to a stage have."""

        def compute(places: Array) -> Curves:
            return list_curves(solve(scene, stage, at=command_at(scene, places)))

        points = exact
        if stage == "force" and scene.motion.law is not None:
            # what accelerates from rest bears what stands beside that instant
            at_edges = solve(scene, stage, at=command_at(scene, edges))
            points = exact[~np.isin(exact, edges[find_senses(at_edges)[0] != 0.0])]
        return fit_panels(compute, edges, most_halvings, points)

    positions = fit(_list_position_curves, "position", DEEP)
    for bar in MOVING_BARS:
        _join_turns(positions, solution, bar)
    panels = positions
    if solution.omega_4 is not None:
        stage = "acceleration" if solution.F12 is None else "force"
        panels = fit(_list_curves, stage, SHALLOW)
    reversals, rests = (
        [(place, name) for place, name in found if name in PINS]
        for found in (zeros, rests)
    )
    return MotionCurves(scene, solution, positions, panels, reversals, rests, breaks)


def _take_positions(
    solution: Solution, list_curves: Callable[[Solution], Curves]
) -> Panels:
    """Take the curves at positions alone, as panels of one node each."""
    share = np.ones(len(solution))
    unknown = np.full(len(solution), np.inf)
    curves = {
        name: PanelCurve(values.reshape(len(solution), 1, -1), unknown, [])
        for name, (values, _) in list_curves(solution).items()
    }
    if is_once_round(solution):
        share[-1] = 0.0  # the first position again
    places = solution.at.places
    return Panels(places, places, share, curves, located=False)


def _mark_poles(solution: Solution, panels: Panels) -> None:
    """Mark listed positions without a lever, beside which a curve grows.

    A curve that does not double at a quarter of the distance stays bounded there.
    """
    scene = solution.scene
    rows = np.flatnonzero(np.isin(solution.status_code, (NO_LEVER, NO_TORQUE)))
    listed = scene.motion.free is None and not solution.at.moves_stroke
    if not listed or not rows.size:
        return
    at = solution.at.part(rows).as_doubles()
    beside = [
        _list_curves(solve(scene, at=at._replace(angle=at.angle + away)))
        for away in _BESIDE_A_POLE * np.array([-1.0, 1.0, -0.25, 0.25])
    ]
    for name, curve in panels.curves.items():
        values = np.abs([curves[name][0].reshape(len(rows), -1) for curves in beside])
        sizes = values.max(axis=-1)
        curve.poles = rows[(sizes[2:] > 2.0 * sizes[:2]).any(axis=0)].tolist()


def goes_on_between(solution: Solution) -> bool:
    """Return True if the scene says what happens between the positions."""
    at = solution.at
    motion = solution.scene.motion
    listed = motion.free is not None or isinstance(motion.angle, np.ndarray)
    if listed or len(solution) < 2 or at.commanded != motion.commanded:
        return False
    steps = np.diff(at.places)
    if not (np.all(steps > 0.0) or np.all(steps < 0.0)):
        return False
    stated = command_at(solution.scene, at.places)
    names = ["angle", "branch"]
    if at.speed is not None:
        names += ["speed", "acceleration"]
    return all(
        getattr(stated, name) is not None
        and np.array_equal(getattr(at, name), getattr(stated, name), equal_nan=True)
        for name in names
    )


def _cut(solution: Solution) -> tuple[Array, Array]:
    """Return the ends of the parts of a motion, and of the first panels besides.

    The parts are those of a law; the latter are in the order of the motion.
    """
    places = solution.at.places
    turned = np.nansum(np.abs(np.diff(solution.at.angle))) / TURN
    count = np.clip(np.ceil(turned), 1, _MOST_FIRST_PANELS // _PANELS_OF_A_TURN)
    even = np.linspace(places[0], places[-1], int(count) * _PANELS_OF_A_TURN + 1)
    ends = even[[0, -1]]
    law = solution.scene.motion.law
    if law is None:
        return ends, even
    times = np.array(law.time)
    inside = (times > ends[0]) & (times < ends[1])
    return np.append(ends, times[inside]), even


def _join_edges(exact: Array, others: Array) -> Array:
    """Join ends of panels; those beside an exact one give way to it."""
    width = _SAME_EDGE * abs(others[-1] - others[0])
    away = np.abs(others[:, None] - exact).min(axis=1)
    edges = np.unique(np.concatenate([exact, others[away > width]]))
    return edges if others[-1] > others[0] else edges[::-1]


def _locate_breaks(solution: Solution, edges: Array) -> tuple[_Named, _Named]:
    """Locate where forces jump or bend, with the names of what breaks there.

    The second places are those at which a name comes to rest or leaves it.
    """
    if solution.F12 is None:
        return [], []
    scene = solution.scene.settled()

    def compute(places: Array) -> Curves:
        state = compute_shown_state(scene, command_at(scene, places))
        breaks = dict[str, Any]()
        for term in (*scene.loads, *scene.effects):
            breaks |= term.breaks(state)
        asked = Wanted(zeros=True)
        none = np.zeros(len(places))
        return {name: (values + none, asked) for name, values in breaks.items()}

    if not compute(edges[:1]):
        return [], []
    panels = fit_panels(compute, edges)
    width = _SAME_EDGE * panels.length
    breaks: _Named = []
    rests: _Named = []
    for name, curve in panels.curves.items():
        zeros = panels.find_zeros(name)
        away = np.abs(zeros[:, None] - edges[[0, -1]])
        places = zeros[away.min(axis=1) > width].tolist()
        first, last = curve.values[[0, -1], [0, -1], 0]
        # what lies at both ends of a turn is passed like any other position
        if is_once_round(solution) and first * last < 0.0:
            places.append(float(edges[0]))
        breaks += [(place, name) for place in places]
        rests += [(place, name) for place in panels.find_rests(name).tolist()]
    backwards = bool(edges[0] > edges[-1])
    return sorted(breaks, reverse=backwards), sorted(rests, reverse=backwards)


def _list_position_curves(solution: Solution) -> Curves:
    """List the curves of the positions alone, by name.

    A commanded angle has a value where the linkage does not assemble, too.
    """
    asked = Wanted(SHOWN_AS_ZERO, ranged=True)
    curves = {
        name: (getattr(solution, name), asked)
        for name in ("theta_2", "theta_3", "theta_4", "sin_mu")
    }
    if solution.stroke is not None:
        stroke = where_assembled(solution, solution.stroke)
        asked = Wanted(
            SHOWN_AS_ZERO * max(solution.stated.linkage.lengths), ranged=True
        )
        curves["stroke"] = stroke, asked
    return curves


def _list_curves(solution: Solution) -> Curves:
    """List the curves of loads, or where nothing acts of rates, by name.

    Commanded rates end, as all others do, where the linkage ceases to assemble.
    """
    scene = solution.scene
    curves: Curves = {}
    if solution.omega_4 is not None and not (acts(scene) and solution.F12 is not None):
        for name in RATES:
            curves[name] = where_assembled(solution, getattr(solution, name)), Wanted()
    if solution.F12 is None:
        return curves
    loads = compute_pin_loads(solution)
    largest = np.max([*loads.values()], axis=0)
    rounding = SHOWN_AS_ZERO * float(np.nanmax(largest, initial=0.0))
    for name, load in loads.items():
        kept = drop_rounding(load, largest) != 0.0
        force = np.where(kept[:, None], getattr(solution, name), 0.0)
        curves[name] = force, Wanted(rounding, integrated=True)
    asked = Wanted(rounding * max(solution.stated.linkage.lengths))
    for bar, bending in compute_bending(solution).items():
        curves[f"bending_{bar}"] = np.abs(bending.moment), asked
    drive = read_drive_demand(solution)
    if scene.motion.free is not None:
        return curves
    # what a balanced linkage leaves of a load is rounding, and has no peak
    idle = drive.sizes <= SHOWN_AS_ZERO * largest * _find_longest_arm(solution)
    speed = where_assembled(solution, getattr(solution, drive.speed_key))
    fastest = float(np.nanmax(np.abs(speed), initial=0.0))
    curves["speed"] = speed, Wanted(SHOWN_AS_ZERO * fastest)
    rounding = find_drive_rounding(solution)
    for name, size in ((drive.keys.value, rounding), ("power", rounding * fastest)):
        values = np.where(idle, 0.0, getattr(solution, name))
        curves[name] = values, Wanted(size, integrated=True)
    return curves


def acts(scene: Scene) -> bool:
    """Return True if anything acts or a bar has inertia: forces are of interest."""
    bars = scene.linkage.moving
    has_inertia = any(bar.mass > 0.0 or bar.moment_of_inertia > 0.0 for bar in bars)
    return bool(scene.loads or scene.effects or has_inertia)


def compute_pin_loads(solution: Solution) -> dict[str, Array]:
    """Compute the magnitudes of the pin forces, N, by name.

    What a cylinder leaves of the load that it holds end to end is rounding, and zero.
    """
    held = 0.0 if solution.drive_force is None else np.abs(solution.drive_force)
    loads = {}
    for name in PIN_FORCE.values():
        size = np.hypot(*getattr(solution, name).T)
        loads[name] = drop_rounding(size, held)
    return loads


def compute_bending(solution: Solution) -> dict[int, Bending]:
    """Compute the largest bending moment of each bar at each position.

    Many positions are solved again block by block: the forces along the bars of all of
    them would take several times the memory of the solution.
    """
    scene = solution.scene
    count = len(solution)
    released = isinstance(solution.at.origin, ReleaseOrigin)
    if count > POSITIONS_OF_A_BLOCK and not released:
        blocks = [
            compute_bending(solve(scene, at=solution.at.part(rows)))
            for rows in split(count, POSITIONS_OF_A_BLOCK)
        ]
        return {
            bar: Bending(*np.hstack([block[bar] for block in blocks]))
            for bar in MOVING_BARS
        }
    forces = [*compute_pin_loads(solution).values()]
    if solution.drive_force is not None:
        forces.append(np.abs(solution.drive_force))
    size = max(scene.linkage.lengths) * np.max(forces, axis=0)
    bending = {}
    for bar in MOVING_BARS:
        largest = largest_bending(scene, solution, bar)
        # a two-force bar has none
        is_round_off = np.abs(largest.moment) <= _NO_BENDING * size
        moment = np.where(is_round_off, 0.0, largest.moment)
        bending[bar] = largest._replace(moment=moment)
    return bending


def find_drive_rounding(solution: Solution) -> float:
    """Return the rounding of the torques (forces) that the drive sums, N m or N.

    Summed are inertial ones, and usual pin forces at the longest bar. At a change
    point an error bar is less, and where springs balance weights, as far as their
    numbers are rounded.
    """
    inertial = 0.0
    for number, bar in zip(MOVING_BARS, solution.scene.linkage.moving, strict=True):
        a_G = getattr(solution, f"a_G{number}")
        accelerations = np.hypot(a_G[:, 0], a_G[:, 1])
        inertial += bar.mass * float(np.nanmax(accelerations, initial=0.0))
    usual = 0.0
    for load in compute_pin_loads(solution).values():
        if np.isfinite(load).any():
            usual = max(usual, float(np.nanmedian(load)))
    return SHOWN_AS_ZERO * max(inertial, usual) * _find_longest_arm(solution)


def _find_longest_arm(solution: Solution) -> float:
    """Return the arm at which pin forces load the drive: the longest bar, m.

    The arm is 1 for a drive that exerts a force itself.
    """
    if solution.drive is None and solution.scene is not None:
        return max(solution.scene.linkage.lengths)
    return 1.0


def _find_circuits(panels: Panels, scene: Scene) -> NDArray[np.int8]:
    """Return the index of the circuit at each node, (p, N); -1 where there is none."""
    theta_2, sines = (
        panels.curves[name].values[..., 0] for name in ("theta_2", "sin_mu")
    )
    branch = np.where(sines < 0.0, -1, 1).astype(np.int8)
    return find_circuit_where(np.isfinite(sines), scene.linkage, theta_2, branch)


def _join_turns(panels: Panels, solution: Solution, bar: int) -> None:
    """Add whole turns to an angle on the panels, so that they belong together.

    The first stretch has the angles of the solution. The linkage does not pass from one
    stretch to the next, so that no turn of a later one follows from the first: it has
    the one that lies nearest those of its circuit.
    """
    name = f"theta_{bar}"
    if solution.commanded == name:
        return  # as it is commanded
    curve = panels.curves[name]
    angles = curve.values.ravel()
    rows = np.flatnonzero(np.isfinite(angles))
    stretches = split_runs(rows)
    for stretch in stretches:
        angles[stretch] = np.unwrap(angles[stretch])
    coarse = getattr(solution, name)
    first = np.flatnonzero(np.isfinite(coarse))[0]
    away = np.abs(panels.list_nodes().ravel()[rows] - solution.at.places[first])
    nearest = angles[rows[np.argmin(away)]]
    angles += TURN * np.round((coarse[first] - nearest) / TURN)
    numbers = _find_circuits(panels, solution.scene).ravel()
    ends_of: dict[int, Array] = {}
    for stretch in stretches:
        part = angles[stretch]
        ends = ends_of.get(numbers[stretch[0]], angles[stretches[0]])
        away = 0.5 * (ends.min() + ends.max()) - 0.5 * (part.min() + part.max())
        # half a turn away is no turn, whatever the rounding
        angles[stretch] += TURN * np.round((1.0 - _HALF_A_TURN) * away / TURN)
        ends_of[numbers[stretch[0]]] = np.append(ends, angles[stretch])
    curve.values = angles.reshape(curve.values.shape)
