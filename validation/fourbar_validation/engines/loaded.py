"""The bars of a four-bar as an engine holds them, and what acts on them.

Each kind of load and effect, a row of a table, acts on the bars as a wrench from the
engine's own numbers; nothing of the formulas' `act` is used, so that this is a second
derivation.
"""

import cmath
import math
from collections.abc import Callable, Container, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from fourbar.effects import PointDrive
from fourbar.linkage import MOVING_BARS, PINS
from fourbar.quantities import Array, ComplexArray
from fourbar.scene import Scene
from fourbar_validation.engines.description import (
    FORCE_AT,
    PART_POINTS,
    declares,
    find_field,
    look_up,
    name_driving,
)
from fourbar_validation.engines.sliding import continue_couples

if TYPE_CHECKING:
    from fourbar.effects import (
        Effect,
        Flywheel,
        ForceDrive,
        Friction,
        Gravity,
        Load,
        PinFriction,
        Springs,
        Torsion,
        Viscous,
    )
    from fourbar.effects.place import Place

REPEATED = 4.0 * 2.0**-52
"""Change of a pin load, in parts of the greatest, that is rounding."""
Components = tuple[float, float]
"""A vector of the plane as plain numbers, as an engine's calls take it. Everywhere else
vectors are complex numbers, x + i y.
"""
Wrenches = dict[int, list[float]]
"""Sum of what acts on each moving bar as a force at its first pin and a couple, (x, y,
moment), N and N m.
"""
Act = Callable[[], None]
"""Function that applies what acts on the bars at their present motion."""
BarValues = dict[str, Array | Sequence[float] | float]
FRICTION_PASSES = 100
"""Passes over pin loads and the friction they make. Each lessens the error where the
friction is far from a jam.
"""
_DIVERGED = 1e100
"""Load, N, that only passes running away from each other reach."""


class Assembled(Protocol):
    """Bars opened at pin A or B, as an engine places them.

    Every number is the engine's own.
    """

    def place(self, q: Sequence[float]) -> None:
        """Move to a configuration."""

    def gap(self) -> Components:
        """Return B on bar 3 minus B on bar 4, or A on bar 2 minus A on bar 3, m."""

    def jacobian(self) -> Array:
        """Return the derivative of the gap, (2, 3), m."""

    def positions(self) -> Mapping[str, Array | Sequence[float]]:
        """Locate O4, A, B and "B4", the end of bar 4; (2,), m.

        If pin A is open, "A2" is that of bar 2.
        """


class Loaded(Assembled, Protocol):
    """Bars on which loads and effects act, by their rows of `tree.TERM_OF`.

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
    field: Components = (0.0, 0.0)
    """Field of gravity, m/s^2."""
    loaded: list[str]
    """Pins whose friction depends on their load."""
    pin_loads: dict[str, float]
    """Magnitudes of pin forces on which friction depends, by pin, N."""
    wrenches: Wrenches
    """What acts on the moving bars."""
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
        """Locate a point that `list_moving_parts` names, world axes, (2,), m.

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
        """Locate a point that `list_moving_parts` names, m."""
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

    def gravity(self, field: Components) -> None:
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


def make_no_wrenches() -> Wrenches:
    """Return the wrenches of bars on which nothing acts: zeros by the bar's number."""
    return {bar: [0.0, 0.0, 0.0] for bar in MOVING_BARS}


def _set_gravity(effect: "Gravity", bars: Loaded) -> None:
    """Set the engine's own gravity."""
    bars.gravity(find_field(effect))


def _find_slip(bars: Loaded, pin: str) -> float:
    """Return omega_j - omega_i of the bars i, j that meet at a pin, rad/s."""
    i, j = PINS[pin]
    return bars.velocity(j) - bars.velocity(i)


def _apply_pin_couple(
    bars: Loaded,
    pin: str,
    couple: float,
) -> None:
    """Apply a couple to bar j of a pin (i, j), and its opposite to bar i."""
    i, j = PINS[pin]
    bars.couple(j, couple)
    bars.couple(i, -couple)


def _apply_viscous(effect: "Viscous", bars: Loaded) -> None:
    """Apply couples against the slip, in proportion to it."""
    for pin, k in effect.coefficients:
        _apply_pin_couple(bars, pin, -k * _find_slip(bars, pin))


def _apply_friction(effect: "Friction", bars: Loaded) -> None:
    """Apply couples of constant size.

    MuJoCo's own frictionloss is a soft constraint.
    """
    for pin, f in effect.torques:
        _apply_pin_couple(bars, pin, -f * float(np.sign(_find_slip(bars, pin))))


def _pin_friction(effect: "PinFriction", bars: Loaded) -> None:
    """Apply couples of mu r times the load at the pin.

    The engine computed the load in its last pass.
    """
    for pin, mu, r in effect.pins:
        greatest = mu * r * bars.pin_loads.get(pin, 0.0)
        sense = float(np.sign(_find_slip(bars, pin)))
        _apply_pin_couple(bars, pin, -greatest * sense)


def _apply_torsion(effect: "Torsion", bars: Loaded) -> None:
    """Apply couples from the engine's own angles of the two bars."""
    for pin, k, rest, preload in effect.springs:
        i, j = PINS[pin]
        turned = math.remainder(bars.angle(j) - bars.angle(i) - rest, math.tau)
        _apply_pin_couple(bars, pin, -(preload + k * turned))


def _apply_springs(effect: "Springs", bars: Loaded) -> None:
    """Pull at the engine's own places of the two points."""
    for spring in effect.springs:
        start = bars.end(spring.start)
        end = bars.end(spring.end)
        across = end - start
        distance = abs(across)
        if spring.preload == spring.stiffness * spring.length:
            per_metre = spring.stiffness
        else:
            tension = spring.preload + spring.stiffness * (distance - spring.length)
            if spring.acts is not None and (tension < 0.0) != (spring.acts == "push"):
                continue
            per_metre = tension / distance if distance else math.nan
        bars.push(spring.start.bar, per_metre * across, start)
        bars.push(spring.end.bar, -per_metre * across, end)


def _apply_flywheel(effect: "Flywheel", bars: Loaded) -> None:
    """Apply the couple that accelerating the wheel takes.

    The angular acceleration is the engine's own.
    """
    bars.couple(effect.bar, -effect.inertia * bars.alpha(effect.bar))


def _carry_load(load: "Load", bars: Loaded) -> None:
    """Apply a force at its place, which the engine's bar carries along.

    A couple is applied too.
    """
    factor = 1.0
    if load.table is not None:
        factor = float(look_up(load.table, bars.angle(2)))
    if load.force is not None:
        force = cmath.rect(*load.force)
        if load.frame == "bar":
            force = bars.rotate(load.bar, force)
        if load.arm is not None:
            point = bars.locate(f"G{load.bar}") + cmath.rect(*load.arm)
        else:
            assert load.place is not None
            point = bars.end(load.place)
        bars.push(load.bar, factor * force, point)
    bars.couple(load.bar, factor * load.moment)


TERM_OF: dict[str, Callable[[Any, Loaded], None]] = {
    "gravity": _set_gravity,
    "viscous": _apply_viscous,
    "friction": _apply_friction,
    "pin_friction": _pin_friction,
    "torsion": _apply_torsion,
    "springs": _apply_springs,
    "flywheel": _apply_flywheel,
    "load": _carry_load,
}
"""Function that applies an effect at a state of the bars, by the effect's key. Others
bring their own.
"""


def has_term(effect: "Effect") -> bool:
    """Return True if an effect can be applied to an engine's bars."""
    return effect.key in TERM_OF or declares(effect, "act_on_engine")


def list_wrenches(
    scene: Scene,
    bars: Loaded,
    own: Container[str] = (),
) -> list[Act]:
    """List what loads and effects do at each state of the bars.

    Gravity is the engine's own, and is set once.

    `own`: the keys of effects for which the engine has elements of its own.
    """
    acts: list[Act] = []
    for effect in (*scene.effects, *scene.loads):
        term = TERM_OF.get(effect.key, type(effect).act_on_engine)
        act = partial(term, effect, bars)
        if effect.key == "gravity":
            act()
        elif effect.key not in own:
            acts.append(act)
    return acts
