"""The bars of a four-bar as an engine holds them.

Loads and effects act on them as wrenches, from its own numbers.
"""

import cmath
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from fourbar.effects import PointDrive
from fourbar.linkage import MOVING_BARS
from fourbar.quantities import Array, ComplexArray
from fourbar.scene import Scene
from fourbar_validation.engines.description import (
    FORCE_AT,
    PART_POINTS,
    name_driving,
)
from fourbar_validation.engines.sliding import continue_couples

if TYPE_CHECKING:
    from fourbar.effects import ForceDrive
    from fourbar.effects.place import Place

FRICTION_PASSES = 100
"""Passes over pin loads and the friction they make. Each lessens the error where the
friction is far from a jam.
"""
REPEATED = 4.0 * 2.0**-52
"""Change of a pin load, in parts of the greatest, that is rounding."""
_DIVERGED = 1e100
"""Load, N, that only passes running away from each other reach."""
Components = tuple[float, float]
"""A vector of the plane as plain numbers, as an engine's calls take it. Everywhere else
vectors are complex numbers, x + i y.
"""
Act = Callable[[], None]
"""Function that applies what acts on the bars at their present motion."""
BarValues = dict[str, Array | Sequence[float] | float]


class Assembled(Protocol):
    """Bars opened at pin A or B, as an engine places them.

    Every number is the engine's own.
    """

    def place(self, q: Sequence[float]) -> None:
        """Move to a configuration."""

    def gap(self) -> tuple[float, float]:
        """Return B on bar 3 minus B on bar 4, or A on bar 2 minus A on bar 3, m."""

    def jacobian(self) -> Array:
        """Return the derivative of the gap, (2, 3), m."""

    def positions(self) -> Mapping[str, Array | Sequence[float]]:
        """Locate O4, A, B and "B4", the end of bar 4; (2,), m.

        If pin A is open, "A2" is that of bar 2.
        """


class Loaded(Assembled, Protocol):
    """Bars on which loads and effects act, by their rows of `applied_effects.TERM_OF`.

    The ground (bar 1) does not move; its line points from O2 to O4. The mass centres
    G2, G3, G4 are among the points.
    """

    own: str
    """Results that the engine finds alone, in words for the report."""
    alone: bool = False
    """True if the engine also answers `torque_inertia`, the torque that the bars take
    without loads and effects.
    """
    ground_angle: float
    drive_bar: int
    force_drive: "ForceDrive | None" = None
    """The drive, where it exerts a force."""
    driving: str
    """Name of the drive's quantity that is solved for."""
    field: tuple[float, float] = (0.0, 0.0)
    """Field of gravity, m/s^2."""
    loaded: list[str]
    """Pins whose friction depends on their load."""
    pin_loads: dict[str, float]
    """Magnitudes of pin forces on which friction depends, by pin, N."""
    wrenches: dict[int, list[float]]
    """Sum of what acts on each moving bar as a force at its first pin and a couple, (x,
    y, moment), N and N m.
    """
    terms: list[Act]

    def ready(self, scene: Scene, terms: list[Act]) -> None:
        """Prepare the evaluation.

        An engine calls this once it has its bars and what acts on them.
        """
        self.ground_angle = scene.linkage.ground_angle
        self.drive_bar = scene.drive_bar
        self.terms = terms
        self.force_drive = scene.drive
        self.driving = name_driving(scene)
        self.loaded = [pin for effect in scene.effects for pin in effect.loaded_pins]

    # methods that the engine defines
    def move(
        self,
        bar: int,
        speed: float,
        acceleration: float,
    ) -> BarValues:
        """Return motion and forces where the bars are placed, by name.

        Empty where a toggle leaves them 0/0.
        """

    def point(self, name: str) -> Array:
        """Locate a point that `description.parts` names, world axes, (2,), m.

        The array may be the engine's own memory.
        """

    def rotation(self, bar: int) -> Array:
        """Return the axes along and across a moving bar's line, (2, 2)."""

    def velocity(self, bar: int) -> float:
        """Return the angular velocity of a bar, rad/s."""

    def alpha(self, bar: int) -> float:
        """Return the angular acceleration of a bar, rad/s^2."""

    # methods that follow from these
    def positions(self) -> Mapping[str, Array | Sequence[float]]:
        """Locate the points of the bars."""
        return {name: self.point(point) for name, point in PART_POINTS.items()}

    def angle(self, bar: int) -> float:
        """Compute the direction of a bar's line from its axes, in (-pi, pi], rad.

        The ground's is as described.
        """
        if bar == 1:
            return self.ground_angle
        return cmath.phase(self.rotate(bar, 1.0))

    def rotate(self, bar: int, vector: complex) -> complex:
        """Rotate a vector along and across a bar's line into world axes."""
        if bar == 1:
            return vector * cmath.rect(1.0, self.ground_angle)
        return vector * complex(*self.rotation(bar)[:, 0].tolist())

    def locate(self, name: str) -> complex:
        """Locate a point that `description.parts` names, m."""
        return complex(*self.point(name).tolist())

    def first_pin(self, bar: int) -> complex:
        """Locate the first pin of a bar (O2, O2, A, O4 of bars 1, 2, 3, 4), m."""
        return 0j if bar == 1 else self.locate(f"first_pin{bar}")

    def end(self, point: "Place") -> complex:
        """Locate an end of a spring or a place of the drive, m."""
        in_bar = cmath.rect(point.distance, point.angle)
        return self.first_pin(point.bar) + self.rotate(point.bar, in_bar)

    def cylinder(self, bar: int) -> tuple[complex, complex]:
        """Return the vectors to the cylinder's ends on the bar and the ground, m.

        Both are from the bar's first pin, with all bars laid down along +x.
        """
        assert self.force_drive is not None
        self.place((0.0, 0.0, 0.0))
        places = [place for _, place in self.force_drive.ends]
        on_bar, on_ground = sorted(places, key=lambda place: -place.bar)
        pivot = self.first_pin(bar)
        return self.end(on_bar) - pivot, self.end(on_ground) - pivot

    def line(self) -> tuple[list[tuple[float, int, complex]], complex]:
        """Place the drive: sense, bar and point of each end, m; and its direction."""
        drive = self.force_drive
        assert drive is not None
        ends = [(sense, place.bar, self.end(place)) for sense, place in drive.ends]
        if isinstance(drive, PointDrive):
            along = cmath.rect(1.0, drive.direction)
            if drive.frame == "bar":
                along = self.rotate(drive.place.bar, along)
            return ends, along
        (_, _, start), (_, _, end) = ends
        return ends, (end - start) / abs(end - start)

    def work(self, size: float) -> None:
        """Let the drive act with a torque, N m, or a force, N."""
        if self.force_drive is None:
            self.couple(self.drive_bar, size)
            return
        ends, along = self.line()
        for sense, bar, point in ends:
            self.push(bar, sense * size * along, point)

    def gravity(self, field: tuple[float, float]) -> None:
        """Set a field (g_x, g_y) for the engine's own gravity, m/s^2."""
        self.field = field

    def push(self, bar: int, force: complex, point: complex) -> None:
        """Add a force (N) at a point (m), both in world axes.

        Forces on the ground have no effect.
        """
        if bar != 1:
            arm = point - self.first_pin(bar)
            wrench = self.wrenches[bar]
            wrench[0] += force.real
            wrench[1] += force.imag
            wrench[2] += (arm.conjugate() * force).imag

    def couple(self, bar: int, couple: float) -> None:
        """Add a couple, N m; on the ground it does nothing."""
        if bar != 1:
            self.wrenches[bar][2] += couple

    def act(self) -> None:
        """Sum anew what acts on the bars at their present motion."""
        self.wrenches = make_no_wrenches()
        for act in self.terms:
            act()

    def settled(self, balanced: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        """Solve for pin forces and torque that balance what acts, by name.

        The result is empty where friction jams. Effects that depend on the load of a
        pin are given the loads of the pass before, until they repeat. Where passes run
        away friction grows from none: forces are linear in the loads, and a pass with
        each of them tells how.
        """

        def passed(loads: Array) -> tuple[dict[str, Any], ComplexArray]:
            self.pin_loads = dict(zip(self.loaded, loads.tolist(), strict=True))
            forces = balanced()
            on_pins = [complex(*forces[FORCE_AT[pin]]) for pin in self.loaded]
            return forces, np.array(on_pins)

        loads = np.zeros(len(self.loaded))
        forces, without = passed(loads)
        if not self.loaded:
            return forces
        on_pins = without
        for _ in range(FRICTION_PASSES):
            before = loads
            loads = np.abs(on_pins)
            if np.abs(loads - before).max() <= REPEATED * loads.max():
                return forces
            if not loads.max() < _DIVERGED:
                break
            forces, on_pins = passed(loads)
        probe = float(np.abs(without).max())
        columns = []
        for load in probe * np.eye(len(loads)):
            _, on_pins = passed(load)
            columns.append((on_pins - without) / probe)
        grown, _ = continue_couples(
            without[None], np.stack(columns, axis=1)[None], np.ones(len(loads))
        )
        if np.isnan(grown).any():
            return {}
        forces, _ = passed(grown[0])
        return forces


def make_no_wrenches() -> dict[int, list[float]]:
    """Return the wrenches of bars on which nothing acts: zeros by the bar's number."""
    return {bar: [0.0, 0.0, 0.0] for bar in MOVING_BARS}
