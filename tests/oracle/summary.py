"""Checks of what `analyze` prints and its JSON holds.

Free bodies at many positions and plain sums judge it. Each peak and each end of a range
is taken at the place that is printed with it, and none of many positions between the
scene's own may exceed it. RMS and energies are integrated anew over the free bodies'
forces.
"""

from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from math import inf, isfinite, isinf, nan, pi, sin, sqrt
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Legendre
from numpy.polynomial.legendre import leggauss

from fourbar.linkage import MOVING_BARS, PIN_FORCE
from fourbar.quantities import OK, Array
from fourbar.scene import command_at
from fourbar.scene.motion import Sine
from fourbar.show.duty import list_duty
from fourbar.show.summary import Facts
from fourbar_validation.compare.pins import state_from_pins
from fourbar_validation.compare.scales import make_reference
from fourbar_validation.compare.tolerance import (
    EPS,
    K,
    divide,
    magnitude,
    wrap_difference,
)
from fourbar_validation.engines.description import name_driving
from fourbar_validation.run.question import NotAskedError, Question
from tests.oracle.bounds import LOCATED_ROUGHLY, PRINTED
from tests.oracle.cuts import CUT_POSITIONS, free_piece, move_bars
from tests.oracle.variants import ask_free_bodies, make_row

_CUT_BESIDE = 1e-10
"""Part of the length by which a bar is cut on either side of a place. A couple that
acts there makes a jump.
"""
PEAK_INTERVALS = 1440
"""Intervals between two edges at whose ends nothing may exceed a peak or a range."""
MOST_INTERVALS = 20 * PEAK_INTERVALS
"""Intervals of a whole motion, of which a fast sine has hundreds of swings."""
EXCESS_BETWEEN_POSITIONS = 1e-3
"""Part by which a largest value without a place may exceed that of many positions. Its
own position lies between two of them.
"""
_LEAST_CONDITION = 1e-2
"""Condition below which a motion counts as one with poles. Beside a pole peaks are
those of the positions.
"""
_LEAST_KNOWN_CONDITION = K * EPS / PRINTED.factor
"""Condition below which the rounding of the free bodies, K eps over it, is more than a
row allows.
"""
PANELS = 400
"""Panels of a motion: beside a pole, at a condition of 1e-2, one is as wide as the pole
is far.
"""
LEAST_PANELS = 3
"""Panels between two edges at the least: a sine has an edge where it turns round, and
integrals by three panels are right to 5e-10.
"""
_NODES, _WEIGHTS = leggauss(12)
BALANCED_SHARE = 1e-13
"""Part of the largest pin force below which a load is its rounding."""
_REPEATS = 1e-9
"""Greatest difference, rad, of angles of which one repeats the other."""


@dataclass
class _SummaryJudge:
    """A scene, what is said of it, and the free bodies' answers."""

    question: Question
    facts: Facts
    errors: dict = field(default_factory=dict)
    """Errors in parts of the value, by the name of the row."""

    @property
    def scene(self):
        """Return the scene."""
        return self.facts.scene

    @property
    def solution(self):
        """Return the solution of the scene's own positions."""
        return self.facts.solution

    @cached_property
    def own(self):
        """Return the free bodies' answer at the scene's own positions."""
        return ask_free_bodies(self.scene, self.solution.at)

    @cached_property
    def edges(self):
        """Return the places at which the motion or a load changes its law, and its
        ends.
        """
        places, scene = self.solution.at.places, self.scene
        inner = getattr(scene.motion.law, "time", ())
        if scene.motion.law is None and scene.motion.bar == 2:
            tables = (load.table for load in scene.loads if load.table is not None)
            inner = [corner for table in tables for corner in table.theta_2]
        low, high = np.sort(places[[0, -1]])
        inside = [place for place in inner if low < place < high]
        return np.union1d([low, high], inside)

    @cached_property
    def swings(self):
        """Return the edges, and the times at which a sine turns round."""
        law = self.scene.motion.law
        if not isinstance(law, Sine):
            return self.edges
        turned = law.phase + law.frequency * law.duration
        phases = np.arange(law.phase // pi, turned / pi) * pi + 0.5 * pi
        turns = (phases - law.phase) / law.frequency
        return np.union1d(self.edges, turns[(turns > 0.0) & (turns < law.duration)])

    @cached_property
    def fine_places(self):
        """Return many places between the scene's own, the closest beside the edges."""
        intervals = min(PEAK_INTERVALS, MOST_INTERVALS // (len(self.swings) - 1))
        graded = 0.5 - 0.5 * np.cos(np.linspace(0.0, pi, intervals + 1))
        pieces = [low + (high - low) * graded for low, high in pairwise(self.swings)]
        return np.unique(np.concatenate(pieces))

    def integrates(self, name):
        """Return whether a quantity has an integral over the motion.

        The free bodies must know it at all of the many positions.
        """
        known = len(self.fine.quantities["theta_2"]) == len(self.fine_places)
        return known and self.facts.motion.is_steady and name not in self.growing

    @property
    def growing(self):
        """Return the names of what is said to grow without bound."""
        return self.facts.motion.panels.growing

    @cached_property
    def fine(self):
        """Return their answer at many positions.

        Left out are those beside a pole that they cannot know.
        """
        places = self.fine_places
        answer = self.ask(places)
        least = _find_conditions(self.scene, answer).min(axis=0)
        known = least > _LEAST_KNOWN_CONDITION
        return answer if known.all() else self.ask(places[known])

    @cached_property
    def motor(self):
        """Return the entry of the JSON."""
        return list_duty(self.solution, {})

    @cached_property
    def closed(self):
        """Return whether the free bodies end as they begin, after whole turns."""
        at = self.solution.at
        if at.moves_stroke or abs(at.angle[-1] - at.angle[0]) < pi:
            return False
        for bar in MOVING_BARS:
            theta = self.own.quantities[f"theta_{bar}"]
            if abs(wrap_difference(theta[-1] - theta[0])) > _REPEATS:
                return False
        return True

    @cached_property
    def loaded_pins(self):
        """Return the pins whose load is more than the rounding of the largest."""
        loads = self._loads
        return {pin for pin in loads if loads[pin].max() > self._rounding}

    @cached_property
    def _loads(self):
        """Return the load of each pin, N."""
        quantities = self.own.quantities
        return {pin: magnitude(quantities[name]) for pin, name in PIN_FORCE.items()}

    @property
    def _rounding(self):
        return BALANCED_SHARE * np.max([*self._loads.values()])

    def ask(self, places):
        """Ask the free bodies at other positions of the motion."""
        return ask_free_bodies(self.scene, command_at(self.scene, np.ravel(places)))

    def add(self, row, error):
        """Add errors to a row."""
        self.errors.setdefault(row, []).extend(np.ravel(error).tolist())

    def add_value(self, row, ours, theirs):
        """Add the error of a number."""
        self.add(row, nan if ours is None else abs(ours - theirs) / abs(theirs))

    def add_peak(self, row, peak, at_peak, fine):
        """Add by how much a peak is no value at its place.

        Another value may exceed it; by how much is added too.
        """
        size = abs(peak.value)
        self.add(row, abs(abs(at_peak) - size) / size)
        self.add_excess(row, (abs(fine).max() - size) / size)

    def add_excess(self, row, *excess):
        """Add the largest of some excesses, or zero where none is one.

        NaN if one is no number.
        """
        self.add(row, np.max((*excess, 0.0)))


def _find_conditions(scene, answer):
    """Find the conditions of motion and drive by the free bodies' angles, (2, n)."""
    reference = make_reference(scene, answer)
    return np.stack((reference.condition, reference.drive_condition))


def summary(question):
    """Judge ranges, peaks, RMS, energies, pin loads and more.

    Bending is judged too.
    """
    judged = _SummaryJudge(question, _summarize_scene(question))
    _judge_ranges(judged)
    _judge_drive(judged)
    _judge_pins(judged)
    _judge_integrals(judged)
    _judge_bending(judged)
    _judge_growth(judged)
    for name, errors in judged.errors.items():
        error = np.array(errors)
        tolerance = LOCATED_ROUGHLY if name == "bending" else PRINTED
        nowhere = np.full(len(errors), nan)
        reason = f"{len(errors)} numbers, {len(judged.fine_places)} positions"
        yield make_row(question, "summary", name, error, tolerance, nowhere, reason)


def _summarize_scene(question):
    """Summarize the scene.

    Raises NotAskedError if its motion has poles, or forces that jump.
    """
    scene = question.scene
    solution = question.solution
    if any(effect.dry for effect in scene.effects):
        raise NotAskedError("dry friction, whose forces jump between the positions")
    worst = np.minimum(solution.condition, solution.drive_condition).min()
    if (solution.status_code != OK).any() or not worst > _LEAST_CONDITION:
        raise NotAskedError("the motion has no forces somewhere, or nearly none")
    return Facts(solution)


def _judge_ranges(judged):
    """Judge the ends of the ranges of all bars, and the smallest transmission angle."""
    for bar in MOVING_BARS:
        ((low, high),) = judged.facts.angles[bar]
        there = judged.ask([low.place, high.place]).quantities[f"theta_{bar}"]
        fine = np.unwrap(judged.fine.quantities[f"theta_{bar}"])
        fine -= 2.0 * pi * round((fine.min() - low.value) / (2.0 * pi))
        # both ends of one range: one that is a whole turn too wide has another end
        near = np.array([fine.min(), fine.max()])
        reached = near + wrap_difference(there - near)
        judged.add("ranges", abs(reached - [low.value, high.value]))
        judged.add_excess("ranges", near[1] - high.value, low.value - near[0])
    least = judged.facts.transmission
    answers = judged.ask(least.place), judged.fine
    # at a change point the sine is the root of a rounding, and its square has digits
    squares = [
        np.sin(of.quantities["theta_4"] - of.quantities["theta_3"]) ** 2
        for of in answers
    ]
    square = sin(least.value) ** 2
    judged.add("ranges", abs(squares[0] - square))
    judged.add_excess("ranges", square - squares[1].min())


def _find_work(judged, answer):
    """Return torque or force of the drive, and its speed."""
    scene = judged.scene
    values = answer.quantities[name_driving(scene)]
    if scene.drive is None:
        return values, answer.quantities[f"omega_{scene.drive_bar}"]
    return values, make_reference(scene, answer).stroke_speed


def _judge_drive(judged):
    """Judge the peaks of the drive, as printed and in the JSON."""
    facts = judged.facts
    entry = judged.motor
    name = name_driving(judged.scene)
    fine_values, fine_speed = _find_work(judged, judged.fine)
    kind = name.removeprefix("drive_")
    if name not in judged.growing:
        at_peak, _ = _find_work(judged, judged.ask(facts.peak.place))
        judged.add_peak("peaks", facts.peak, at_peak, fine_values)
        judged.add_value("peaks", entry[f"peak_{kind}"], abs(facts.peak.value))
    judged.add("integrals", float(entry["closed"] != judged.closed))
    for name, fine in ("speed", fine_speed), ("power", fine_values * fine_speed):
        most = abs(fine).max()
        if name not in judged.growing and most != 0.0:
            beyond = entry[f"peak_{name}"] / most - 1.0
            judged.add_excess("peaks", -beyond, beyond - EXCESS_BETWEEN_POSITIONS)


class _Panels(NamedTuple):
    """Curves of the free bodies at the Gauss nodes of panels that follow each other."""

    width: Array
    curves: dict
    """(panels, nodes, components)."""

    def find_rms(self, name):
        """Return the root of the mean square of a number or vector."""
        squares = np.square(self.curves[name]).sum(axis=2)
        return sqrt(self.width @ squares @ (0.5 * _WEIGHTS) / self.width.sum())

    def accumulate(self, name, less=0.0):
        """Return the integral of a curve, less a number, up to each edge and zero."""
        totals = [np.zeros(1)]
        curve = self.curves[name][:, :, 0] - less
        for width, values in zip(self.width, curve, strict=True):
            polynomial = Legendre.fit(_NODES, values, len(_NODES) - 1, [-1.0, 1.0])
            zeros = polynomial.roots()
            zeros = np.sort(zeros[np.isreal(zeros) & (abs(zeros) < 1.0)].real)
            area = 0.5 * width * polynomial.integ(lbnd=-1.0)
            totals.append(totals[-1][-1] + area(np.append(zeros, 1.0)))
        return np.concatenate(totals)


def _lay_panels(sample, edges):
    """Lay as many panels of equal widths between each two edges."""
    count = max(-(-PANELS // (len(edges) - 1)), LEAST_PANELS)
    pieces = [np.linspace(*ends, count + 1) for ends in pairwise(edges)]
    low = np.concatenate([piece[:-1] for piece in pieces])
    high = np.concatenate([piece[1:] for piece in pieces])
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    places = middle[:, np.newaxis] + half[:, np.newaxis] * _NODES
    curves = sample(places.ravel())
    shaped = {name: curves[name].reshape(*places.shape, -1) for name in curves}
    return _Panels(high - low, shaped)


def _judge_integrals(judged):
    """Judge RMS, energies, swing and mean torque over the motion."""
    entry = judged.motor
    drive = name_driving(judged.scene)

    def sample(places):
        answer = judged.ask(places)
        values, speed = _find_work(judged, answer)
        return answer.quantities | {drive: values, "power": values * speed}

    panels = _lay_panels(sample, judged.swings)

    def judge_mean(ours, name):
        if judged.integrates(name) and (rms := panels.find_rms(name)) != 0.0:
            judged.add_value("integrals", ours, rms)

    for pin, name in PIN_FORCE.items():
        if pin in judged.loaded_pins:
            judge_mean(entry["pins"][pin]["rms"], name)
    judge_mean(entry[f"rms_{drive.removeprefix('drive_')}"], drive)
    judge_mean(entry["rms_power"], "power")
    motion = judged.scene.motion
    second = 1.0 if motion.law is not None else abs(motion.speed or 0.0)
    if not judged.integrates("power") or second == 0.0:
        return
    work = np.diff(panels.accumulate("power")) / second
    sums = (work[work > 0.0].sum(), -work[work < 0.0].sum())
    most = max(sums)
    for key, total in zip(("energy_in", "energy_out"), sums, strict=True):
        judged.add("integrals", divide(abs(entry[key] - total), most))
    if not entry["closed"]:
        judged.add("integrals", 0.0 if entry["energy_swing"] is None else inf)
        return
    given = sums[0] - sums[1]
    surplus = panels.accumulate("power", given * second / np.ptp(judged.edges)) / second
    judged.add("integrals", divide(abs(entry["energy_swing"] - np.ptp(surplus)), most))
    at = judged.solution.at
    if judged.scene.drive is None and judged.scene.drive_bar == at.bar:
        turned = np.sign(np.mean(at.speed)) * abs(at.angle[-1] - at.angle[0])
        of_mean = given - entry["mean_torque"] * turned
        judged.add("integrals", divide(abs(of_mean), most))


def _judge_pins(judged):
    """Judge peak and place of each pin's load, printed and in the JSON."""
    facts = judged.facts
    for pin, name in PIN_FORCE.items():
        if pin not in judged.loaded_pins or name in judged.growing:
            continue
        peak = facts.motion.find_peak(name)
        there = judged.ask(peak.place)
        at_peak = magnitude(there.quantities[name])
        judged.add_peak("pins", peak, at_peak, magnitude(judged.fine.quantities[name]))
        of_pin = judged.motor["pins"][pin]
        judged.add_value("pins", of_pin["peak"], peak.value)
        apart = there.quantities["theta_2"] - of_pin["theta_2"]
        judged.add("pins", abs(wrap_difference(apart)))


def _judge_bending(judged):
    """Judge the largest bending moment of each bar: cut at its place, and at many
    positions.
    """
    stated = state_from_pins(judged.scene)
    commanded = judged.solution.at
    fine_motion = move_bars(judged.scene, commanded, judged.fine)
    for bar in MOVING_BARS:
        largest = judged.facts.bending[bar]
        if isinf(largest.peak.value):
            continue
        there = judged.ask(largest.peak.place)
        motion = move_bars(judged.scene, commanded, there)
        length = judged.scene.linkage.bar(bar).length
        off = np.array([-_CUT_BESIDE, _CUT_BESIDE])
        beside = largest.x * (1.0 + off) + off * length
        anywhere = [*beside, *np.multiply(CUT_POSITIONS, length)]
        at_peak, others = (
            [free_piece(stated, moved, answer, bar, cut) for cut in cuts]
            for moved, answer, cuts in (
                (motion, there, beside),
                (fine_motion, judged.fine, anywhere),
            )
        )
        most = np.max([abs(piece.M).max() for piece in others])
        size = abs(largest.peak.value)
        moment = np.max([abs(piece.M[0]) for piece in at_peak])
        judged.add("bending", abs(moment - size) / size)
        judged.add_excess("bending", (most - size) / size)


def _judge_growth(judged):
    """Fail what is said to grow without bound far from every pole.

    The bars are far from poles throughout the motion. What grows has neither a peak nor
    an integral that could be judged, so none of it is believed.
    """
    bending = judged.facts.bending.values()
    if not judged.growing and all(isfinite(largest.peak.value) for largest in bending):
        return
    conditions = _find_conditions(judged.scene, judged.fine)
    # a sine that passes through zero between two positions is no further from it there
    # than it changes in a step
    if conditions.min() - abs(np.diff(conditions)).max() > _LEAST_CONDITION:
        judged.add("peaks", inf)
