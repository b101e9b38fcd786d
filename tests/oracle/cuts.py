"""Internal forces of each bar, cut, with the piece beyond the cut freed.

Nothing of the formulas' beam is used. The free bodies give pin forces and the drive. A
piece of a uniform bar is a rigid bar of its own, with a mass, a centre and an inertia;
of any other bar all of that is in the piece that has G's foot on the line.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

import fourbar
from fourbar.linkage import ENDS, MOVING_BARS, PIN_FORCE, PINS
from fourbar.scene import command as command_of
from fourbar_validation.compare.bodies import BodyMotion, make_vector, pose
from fourbar_validation.compare.line import place_line
from fourbar_validation.compare.pins import (
    find_centre,
    find_inertia,
    find_mass,
    state_from_pins,
)
from fourbar_validation.compare.tolerance import divide
from fourbar_validation.engines.free_body import (
    BodyWrenches,
    apply_effect,
    apply_load,
    find_arm,
    list_sliding_pins,
    speeds_and_accelerations,
)
from tests.oracle.bounds import CUT
from tests.oracle.variants import ask_free_bodies, make_row, take_few

CUT_POSITIONS = (0.0, 0.137, 0.479, 0.863)
"""Cuts, in parts of the bar's length from its first pin. The first is just beyond that
pin, and none is at another foot.
"""


def internal_forces(question):
    """Judge N, V, M of each bar at a few cuts and positions.

    No cut may bend more than the largest moment.
    """
    scene = take_few(question)
    command = command_of(scene)
    answer = ask_free_bodies(scene, command)
    solution = fourbar.solve(scene)
    motion = move_bars(scene, command, answer)
    rows = []
    for bar in MOVING_BARS:
        length = scene.linkage.bar(bar).length
        cuts = np.array([part * length for part in CUT_POSITIONS])
        stated = state_from_pins(scene)
        pieces = [free_piece(stated, motion, answer, bar, cut) for cut in cuts]
        forces = fourbar.internal_forces(scene, solution, bar, cuts)
        for name, terms in (("N", "pushing"), ("V", "pushing"), ("M", "turning")):
            theirs, size = (
                np.stack([getattr(piece, of) for piece in pieces], axis=1)
                for of in (name, terms)
            )
            error = divide(abs(getattr(forces, name) - theirs), size).max(axis=1)
            if name == "M":
                beyond = abs(theirs).max(axis=1) - abs(forces.largest.moment)
                error = np.maximum(error, divide(beyond, size.max(axis=1)))
            rows.append(
                make_row(
                    question,
                    "internal_forces",
                    f"{name}{bar}",
                    error,
                    CUT,
                    solution.theta_2,
                    f"bar {bar} cut at {len(cuts)} places, at {len(error)} positions",
                )
            )
    return rows


def move_bars(scene, command, answer):
    """Move the bars as the free bodies have them."""
    theta = [answer.quantities[f"theta_{bar}"] for bar in MOVING_BARS]
    omega, alpha = (
        answer.quantities[f"{name}_{command.bar}"] for name in ("omega", "alpha")
    )
    return speeds_and_accelerations(
        pose(scene.linkage, theta), omega, alpha, command.bar
    )


@dataclass
class Piece(BodyWrenches):
    """The piece of a bar beyond a cut, with its forces in the bar's axes and their
    moment about the cut, counter-clockwise.
    """

    bar: int
    cut: float
    motion: BodyMotion
    place: Any = 0.0
    """Foot of a pure couple."""

    def __post_init__(self):
        n = len(self.motion.theta_2)
        super().__init__(n)
        self.N, self.V, self.M, self.pushing, self.turning = np.zeros((5, n))
        """The last two: sums of the absolute terms of the whole bar, N and N m."""

    def push(self, bar, force, arm):
        """Add a force, world axes, at an arm from the bar's first pin, on the piece
        of its foot.
        """
        if bar != self.bar:
            return
        turned, lever = (
            np.conj(self.motion.unit[bar]) * vector for vector in (force, arm)
        )
        beyond = lever.real > self.cut
        self.N += np.where(beyond, turned.real, 0.0)
        self.V -= np.where(beyond, turned.imag, 0.0)
        self.M += np.where(
            beyond,
            (lever.real - self.cut) * turned.imag - lever.imag * turned.real,
            0.0,
        )
        self.pushing += abs(turned)
        self.turning += abs(turned) * (abs(lever) + abs(self.cut))

    def couple(self, bar, couple):
        """Add a couple, to the piece on which its place lies."""
        if bar == self.bar:
            self.M += np.where(self.place > self.cut, couple, 0.0)
            self.turning += abs(couple)

    def twist_at(self, pin, couple):
        """Add a couple between two bars at their pin."""
        if self.bar in PINS[pin]:
            length = self.motion.linkage.bar(self.bar).length
            self.place = length * (ENDS[self.bar][1] == pin)
            super().twist_at(pin, couple)
            self.place = 0.0


def free_piece(scene, motion, answer, bar, cut):
    """Free the piece of a bar beyond a cut."""
    described = scene.linkage.bar(bar)
    piece = Piece(bar, cut, motion)
    length = described.length
    uniform = described.inertia is None and described.centre is None
    for pin in ENDS[bar]:
        name = PIN_FORCE[pin]
        force = answer.quantities[name] @ np.array([1.0, 1.0j])
        along = 0.0 if ENDS[bar][0] == pin else length
        piece.push(
            bar, force if name.endswith(str(bar)) else -force, along * motion.unit[bar]
        )
    _push_drive(scene, motion, answer, piece)
    for load in scene.loads:
        if load.bar == bar:
            piece.place = (np.conj(motion.unit[bar]) * find_arm(load, motion)).real
            apply_load(load, motion, piece)
            piece.place = 0.0
    gravity = 0.0
    for effect in scene.effects:
        if effect.key == "gravity" and uniform:
            gravity = make_vector((effect.magnitude, effect.angle))
        else:
            apply_effect(effect, motion, piece)
    for pin, radius in list_sliding_pins(scene).items():
        piece.twist_at(
            pin,
            -motion.sense(pin)
            * radius
            * np.hypot(*answer.quantities[PIN_FORCE[pin]].T),
        )
    a_pin = motion.swing(2, motion.first_pin[3]) if bar == 3 else 0.0
    if uniform:
        for start, end in ((0.0, cut), (cut, length)):
            _push_rigid(
                piece,
                find_mass(described) * (end - start) / length,
                (start, end),
                a_pin,
                gravity,
            )
    else:
        centre = make_vector(find_centre(described))
        to_G = motion.unit[bar] * centre
        piece.push(bar, -find_mass(described) * (a_pin + motion.swing(bar, to_G)), to_G)
        piece.place = centre.real
        piece.couple(bar, -find_inertia(described) * motion.alpha[bar])
    return piece


def _push_rigid(piece, mass, ends, a_pin, gravity):
    """Put weight and inertia of a piece of a uniform bar on it.

    The piece is that of a rigid bar between two places.
    """
    start, end = ends
    middle = 0.5 * (start + end)
    bar = piece.bar
    arm = middle * piece.motion.unit[bar]
    piece.push(bar, mass * (gravity - a_pin - piece.motion.swing(bar, arm)), arm)
    piece.place = middle
    piece.couple(bar, -mass * (end - start) ** 2 / 12.0 * piece.motion.alpha[bar])
    piece.place = 0.0


def _push_drive(scene, motion, answer, piece):
    """Put the couple of the drive at the first pin of its bar.

    A force of the drive acts at the ends of its line.
    """
    if scene.drive is None:
        if scene.drive_bar == piece.bar:
            piece.couple(piece.bar, answer.quantities["torque"])
        return
    line = place_line(motion, scene.drive)
    force = answer.quantities["drive_force"]
    for (sense, point), arm in zip(line.drive.ends, line.arms, strict=True):
        piece.push(point.bar, sense * force * line.unit, arm)
